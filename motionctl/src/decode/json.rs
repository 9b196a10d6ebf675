//! The JSON objects of CAN captures, one a line.
//!
//! Written by hand and not through a tree of values: a capture has millions of them.

use std::io::{self, Write};

use canopen_master::lss;
use canopen_master::nmt::{Command, State};
use canopen_master::sdo::message::{Request, Response};
use canopen_master::trace::{
    Content, Direction as TransferDirection, Kind, Lss, Mode, Outcome, PdoDirection, SdoFrame, Tracer,
    Transfer, Way,
};
use motion_io::capture::{Direction, FrameKind, Record, Time};

use super::names::Names;
use super::{ERROR_FRAME, NAMES, Teller, Totals, UNKNOWN, name_of};

/// Writes JSON without blanks.
pub(super) struct Json<'a> {
    out: Vec<u8>,
    names: &'a Names,
    /// The last bus and how it is written.
    bus: (String, Vec<u8>),
}

/// Two digits for every byte.
const HEX: [[u8; 2]; 256] = {
    const DIGITS: &[u8; 16] = b"0123456789ABCDEF";
    let mut table = [[0; 2]; 256];
    let mut byte = 0;
    while byte < 256 {
        table[byte] = [DIGITS[byte >> 4], DIGITS[byte & 15]];
        byte += 1;
    }
    table
};

fn put_hex(out: &mut Vec<u8>, data: &[u8]) {
    for &byte in data {
        out.extend_from_slice(&HEX[usize::from(byte)]);
    }
}

fn put_number(out: &mut Vec<u8>, number: impl itoa::Integer) {
    out.extend_from_slice(itoa::Buffer::new().format(number).as_bytes());
}

/// `"name":` with the comma before it.
macro_rules! key {
    ($out:expr, $name:literal) => {
        $out.extend_from_slice(concat!(",\"", $name, "\":").as_bytes())
    };
}

/// Seconds with six decimals, or nine where six would lose something.
fn put_time(out: &mut Vec<u8>, time: Option<Time>) {
    let Some(Time(nanos)) = time else { return out.extend_from_slice(b"null") };
    if nanos < 0 {
        out.push(b'-');
    }
    let nanos = nanos.unsigned_abs();
    put_number(out, nanos / 1_000_000_000);
    let fraction = (nanos % 1_000_000_000) as u32;
    let mut digits = [b'.', b'0', b'0', b'0', b'0', b'0', b'0', b'0', b'0', b'0'];
    let (mut rest, count) = if fraction.is_multiple_of(1000) { (fraction / 1000, 6) } else { (fraction, 9) };
    for digit in digits.iter_mut().take(count + 1).skip(1).rev() {
        *digit = b'0' + (rest % 10) as u8;
        rest /= 10;
    }
    out.extend_from_slice(digits.get(..=count).unwrap_or(&[]));
}

/// Any text, quoted.
fn put_text(out: &mut Vec<u8>, text: &str) {
    // Writing to a vector does not fail.
    let _ = serde_json::to_writer(out, text);
}

/// A text without characters that would have to be escaped.
fn put_word(out: &mut Vec<u8>, word: &str) {
    out.push(b'"');
    out.extend_from_slice(word.as_bytes());
    out.push(b'"');
}

fn put_state(out: &mut Vec<u8>, state: Option<State>) {
    match state {
        Some(State::BootUp) => put_word(out, "boot-up"),
        Some(State::Stopped) => put_word(out, "stopped"),
        Some(State::Operational) => put_word(out, "operational"),
        Some(State::PreOperational) => put_word(out, "pre-operational"),
        None => out.extend_from_slice(b"null"),
    }
}

impl<'a> Json<'a> {
    pub(super) fn new(names: &'a Names) -> Self {
        Self { out: Vec::with_capacity(2 * super::BLOCK), names, bus: (String::new(), b"\"\"".to_vec()) }
    }

    fn put_bus(&mut self, bus: Option<&str>) {
        let Some(bus) = bus else { return self.out.extend_from_slice(b"null") };
        if self.bus.0 != bus {
            self.bus.0.clear();
            self.bus.0.push_str(bus);
            self.bus.1.clear();
            put_text(&mut self.bus.1, bus);
        }
        self.out.extend_from_slice(&self.bus.1);
    }
}

impl Teller for Json<'_> {
    fn frame(&mut self, record: &Record, bus: Option<&str>, kind: Option<&Kind>, tracer: &Tracer) {
        let frame = &record.frame;
        self.out.extend_from_slice(b"{\"t\":");
        put_time(&mut self.out, record.time);
        key!(self.out, "bus");
        self.put_bus(bus);
        let out = &mut self.out;
        key!(out, "id");
        put_number(out, frame.id);
        let remote = frame.kind == FrameKind::Remote;
        out.extend_from_slice(match (frame.extended, remote) {
            (false, false) => b",\"ext\":false,\"rtr\":false,\"data\":\"".as_slice(),
            (false, true) => b",\"ext\":false,\"rtr\":true,\"data\":\"",
            (true, false) => b",\"ext\":true,\"rtr\":false,\"data\":\"",
            (true, true) => b",\"ext\":true,\"rtr\":true,\"data\":\"",
        });
        put_hex(out, frame.data());
        out.push(b'"');
        match frame.kind {
            FrameKind::Remote => {
                key!(out, "dlc");
                put_number(out, frame.len());
            }
            FrameKind::Fd { .. } => out.extend_from_slice(b",\"fd\":true"),
            FrameKind::Data | FrameKind::Error => {}
        }
        match record.direction {
            Some(Direction::Rx) => out.extend_from_slice(b",\"dir\":\"RX\""),
            Some(Direction::Tx) => out.extend_from_slice(b",\"dir\":\"TX\""),
            None => {}
        }
        if record.loopback {
            out.extend_from_slice(b",\"loopback\":true");
        }
        let name = match (kind, frame.kind) {
            (Some(kind), _) => name_of(kind),
            (None, FrameKind::Error) => ERROR_FRAME,
            (None, _) => UNKNOWN,
        };
        key!(out, "kind");
        put_word(out, NAMES[name]);
        if let Some(kind) = kind {
            put_fields(out, kind, frame.data());
            if let Kind::Pdo { .. } = kind {
                let number = record.bus.map_or(u16::MAX, |bus| bus.0);
                put_mapped(out, self.names, kind, tracer, number, frame.data());
            }
        }
        out.extend_from_slice(b"}\n");
    }

    fn transfer(&mut self, transfer: &Transfer, bus: Option<&str>) {
        self.out.extend_from_slice(b"{\"kind\":\"sdo-transfer\",\"bus\":");
        self.put_bus(bus);
        let out = &mut self.out;
        key!(out, "node");
        put_number(out, transfer.node.raw());
        key!(out, "direction");
        put_word(
            out,
            match transfer.direction {
                TransferDirection::Upload => "upload",
                TransferDirection::Download => "download",
            },
        );
        key!(out, "mode");
        put_word(
            out,
            match transfer.mode {
                Mode::Expedited => "expedited",
                Mode::Segmented => "segmented",
                Mode::Block => "block",
            },
        );
        key!(out, "index");
        put_number(out, transfer.at.index);
        key!(out, "subindex");
        put_number(out, transfer.at.sub);
        key!(out, "size");
        put_number(out, transfer.size);
        key!(out, "data");
        out.push(b'"');
        put_hex(out, &transfer.data);
        out.push(b'"');
        if transfer.data.len() as u64 != transfer.size {
            out.extend_from_slice(b",\"truncated\":true");
        }
        key!(out, "outcome");
        put_word(
            out,
            match transfer.outcome {
                Outcome::Done => "done",
                Outcome::Aborted { .. } => "aborted",
                Outcome::Incomplete => "incomplete",
            },
        );
        key!(out, "abort_code");
        match transfer.outcome {
            Outcome::Aborted { code, .. } => put_number(out, code.0),
            _ => out.extend_from_slice(b"null"),
        }
        key!(out, "frames");
        put_number(out, transfer.frames);
        if let Some(name) = self.names.given(transfer.node, transfer.at) {
            key!(out, "name");
            put_text(out, name);
            if let Some(value) = self.names.value(transfer.node, transfer.at, &transfer.data) {
                key!(out, "value");
                let _ = serde_json::to_writer(&mut *out, &value);
            }
        }
        key!(out, "t");
        let nanos = transfer.ended.and_then(|time| i64::try_from(time.as_nanos()).ok());
        put_time(out, nanos.map(Time));
        out.extend_from_slice(b"}\n");
    }

    fn text(&mut self) -> &mut Vec<u8> {
        &mut self.out
    }
}

/// The fields of a frame's service.
fn put_fields(out: &mut Vec<u8>, kind: &Kind, data: &[u8]) {
    match *kind {
        Kind::Nmt { command, target } => {
            key!(out, "node");
            put_number(out, target);
            key!(out, "command");
            match command {
                Some(command) => put_word(out, command_word(command)),
                None => out.extend_from_slice(b"null"),
            }
        }
        Kind::Sync { counter, interval } => {
            if let Some(counter) = counter {
                key!(out, "counter");
                put_number(out, counter);
            }
            if let Some(interval) = interval {
                key!(out, "interval");
                put_time(out, i64::try_from(interval.as_nanos()).ok().map(Time));
            }
        }
        Kind::Time(Some(time)) => {
            key!(out, "days");
            put_number(out, time.days());
            key!(out, "ms");
            put_number(out, time.ms());
        }
        Kind::Emcy { node, code, register } => {
            key!(out, "node");
            put_number(out, node.raw());
            key!(out, "code");
            put_option(out, code.map(|code| code.0));
            key!(out, "register");
            put_option(out, register);
            key!(out, "manufacturer");
            out.push(b'"');
            put_hex(out, data.get(3..).unwrap_or(&[]));
            out.push(b'"');
        }
        Kind::Pdo { node, direction, number } => {
            key!(out, "node");
            put_number(out, node.raw());
            key!(out, "pdo");
            put_number(out, number);
            key!(out, "direction");
            put_word(
                out,
                match direction {
                    PdoDirection::Transmit => "transmit",
                    PdoDirection::Receive => "receive",
                },
            );
        }
        Kind::SdoRequest(frame) | Kind::SdoResponse(frame) => put_sdo(out, &frame),
        Kind::SdoAbort(frame) => {
            put_sdo(out, &frame);
            key!(out, "code");
            put_option(out, frame.abort().map(|code| code.0));
            key!(out, "from");
            put_word(out, if frame.way == Way::Request { "client" } else { "server" });
        }
        Kind::GuardRequest { node, unanswered } => {
            key!(out, "node");
            put_number(out, node.raw());
            if unanswered {
                out.extend_from_slice(b",\"unanswered\":true");
            }
        }
        Kind::GuardReply { node, toggle, wrong_toggle, state, .. } => {
            key!(out, "node");
            put_number(out, node.raw());
            key!(out, "state");
            put_state(out, state);
            key!(out, "toggle");
            put_number(out, u8::from(toggle));
            if wrong_toggle {
                out.extend_from_slice(b",\"toggle_error\":true");
            }
        }
        Kind::Heartbeat { node, state, .. } => {
            key!(out, "node");
            put_number(out, node.raw());
            key!(out, "state");
            put_state(out, state);
        }
        Kind::BootUp { node, .. } => {
            key!(out, "node");
            put_number(out, node.raw());
            out.extend_from_slice(b",\"state\":\"boot-up\"");
        }
        Kind::Lss(message) => put_lss(out, message),
        Kind::CanLink { channel } => {
            key!(out, "channel");
            put_number(out, channel);
        }
        _ => {}
    }
}

fn put_option(out: &mut Vec<u8>, number: Option<impl itoa::Integer>) {
    match number {
        Some(number) => put_number(out, number),
        None => out.extend_from_slice(b"null"),
    }
}

const fn command_word(command: Command) -> &'static str {
    match command {
        Command::Start => "start",
        Command::Stop => "stop",
        Command::EnterPreOperational => "enter-pre-operational",
        Command::ResetNode => "reset-node",
        Command::ResetCommunication => "reset-communication",
    }
}

fn put_sdo(out: &mut Vec<u8>, frame: &SdoFrame) {
    key!(out, "node");
    put_number(out, frame.node.raw());
    key!(out, "command");
    put_word(out, sdo_word(&frame.content));
    if let Some(at) = frame.at {
        key!(out, "index");
        put_number(out, at.index);
        key!(out, "subindex");
        put_number(out, at.sub);
    }
    match frame.content {
        Content::Request(Request::UploadSegment { toggle } | Request::DownloadSegment { toggle, .. })
        | Content::Response(Response::UploadSegment { toggle, .. } | Response::DownloadSegment { toggle }) => {
            key!(out, "toggle");
            put_number(out, u8::from(toggle));
        }
        Content::Segment(segment) => {
            key!(out, "sequence");
            put_number(out, segment.sequence);
        }
        Content::Request(Request::AckBlockUpload { sequence, block_size })
        | Content::Response(Response::AckBlockDownload { sequence, block_size }) => {
            key!(out, "sequence");
            put_number(out, sequence);
            key!(out, "block_size");
            put_number(out, block_size);
        }
        _ => {}
    }
}

const fn sdo_word(content: &Content) -> &'static str {
    match content {
        Content::Request(request) => match request {
            Request::InitiateDownload { .. } => "initiate-download",
            Request::DownloadSegment { .. } => "download-segment",
            Request::InitiateUpload { .. } => "initiate-upload",
            Request::UploadSegment { .. } => "upload-segment",
            Request::Abort { .. } => "abort",
            Request::InitiateBlockDownload { .. } => "initiate-block-download",
            Request::EndBlockDownload { .. } => "end-block-download",
            Request::InitiateBlockUpload { .. } => "initiate-block-upload",
            Request::StartBlockUpload => "start-block-upload",
            Request::AckBlockUpload { .. } => "acknowledge-block-upload",
            Request::EndBlockUpload => "end-block-upload",
        },
        Content::Response(response) => match response {
            Response::InitiateDownload { .. } => "initiate-download",
            Response::DownloadSegment { .. } => "download-segment",
            Response::InitiateUpload { .. } => "initiate-upload",
            Response::UploadSegment { .. } => "upload-segment",
            Response::Abort { .. } => "abort",
            Response::InitiateBlockDownload { .. } => "initiate-block-download",
            Response::AckBlockDownload { .. } => "acknowledge-block-download",
            Response::EndBlockDownload => "end-block-download",
            Response::InitiateBlockUpload { .. } => "initiate-block-upload",
            Response::EndBlockUpload { .. } => "end-block-upload",
        },
        Content::Segment(_) => "block-segment",
        Content::Malformed(_) => "malformed",
    }
}

fn put_lss(out: &mut Vec<u8>, message: Lss) {
    let (direction, command) = match message {
        Lss::Request(request) => ("request", request.map(|request| lss_request(&request))),
        Lss::Response(response) => ("response", response.map(|response| lss_response(&response))),
    };
    key!(out, "direction");
    put_word(out, direction);
    key!(out, "command");
    match command {
        Some(command) => put_word(out, command),
        None => out.extend_from_slice(b"null"),
    }
}

pub(super) const fn lss_request(request: &lss::Request) -> &'static str {
    match request {
        lss::Request::SwitchGlobal(_) => "switch-global",
        lss::Request::Select(..) => "select",
        lss::Request::ConfigureNodeId(_) => "configure-node-id",
        lss::Request::ConfigureBitTiming { .. } => "configure-bit-timing",
        lss::Request::ActivateBitTiming { .. } => "activate-bit-timing",
        lss::Request::Store => "store",
        lss::Request::Inquire(_) => "inquire-identity",
        lss::Request::InquireNodeId => "inquire-node-id",
        lss::Request::IdentifyUnconfigured => "identify-unconfigured",
        lss::Request::Fastscan { .. } => "fastscan",
    }
}

pub(super) const fn lss_response(response: &lss::Response) -> &'static str {
    match response {
        lss::Response::Selected => "selected",
        lss::Response::Done { .. } => "done",
        lss::Response::Identity(..) => "identity",
        lss::Response::NodeId(_) => "node-id",
        lss::Response::Identified => "identified",
        lss::Response::Unconfigured => "unconfigured",
    }
}

/// The objects in a PDO whose mapping is known.
fn put_mapped(out: &mut Vec<u8>, names: &Names, kind: &Kind, tracer: &Tracer, bus: u16, data: &[u8]) {
    let Kind::Pdo { node, .. } = *kind else { return };
    let mut first = true;
    for field in tracer.mapped(bus, kind, data) {
        out.extend_from_slice(if first { b",\"mapped\":[{\"index\":" } else { b",{\"index\":" });
        first = false;
        put_number(out, field.object.index);
        key!(out, "subindex");
        put_number(out, field.object.sub);
        key!(out, "bits");
        put_number(out, field.object.bits);
        key!(out, "value");
        put_number(out, names.signed(node, field.object.address(), field.object.bits, field.raw));
        out.push(b'}');
    }
    if !first {
        out.push(b']');
    }
}

/// The last object.
pub(super) fn summary(totals: &Totals, out: &mut impl Write) -> io::Result<()> {
    let by_kind: serde_json::Map<_, _> =
        totals.kinds().map(|(name, count)| (name.into(), count.into())).collect();
    let summary = serde_json::json!({
        "kind": "summary",
        "schema_version": crate::output::SCHEMA_VERSION,
        "frames": totals.frames,
        "damaged": totals.damaged,
        "discarded_bytes": totals.discarded_bytes,
        "by_kind": by_kind,
    });
    writeln!(out, "{summary}")
}
