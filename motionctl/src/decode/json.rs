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
use super::{NAMES, Teller, Totals, name_of, number_of};

/// Writes JSON without blanks.
pub(super) struct Json<'a> {
    out: Vec<u8>,
    names: &'a Names,
    /// The last bus and how it is written.
    bus: (String, Vec<u8>),
    /// By 11-bit identifier: what stands between the time and the data of plain data frames.
    heads: Vec<Head>,
    /// Whole seconds of the frame before, and how they are written.
    seconds: (u64, Piece<24>),
}

/// A short piece of text that is copied in one go.
#[derive(Debug, Clone, Copy)]
struct Piece<const N: usize> {
    text: [u8; N],
    len: usize,
}

impl<const N: usize> Piece<N> {
    const EMPTY: Self = Self { text: [0; N], len: 0 };

    /// `None` where the text is longer.
    fn new(text: &[u8]) -> Option<Self> {
        let mut piece = Self { len: text.len(), ..Self::EMPTY };
        piece.text.get_mut(..text.len())?.copy_from_slice(text);
        Some(piece)
    }

    #[inline]
    fn put(&self, out: &mut Vec<u8>) {
        let end = out.len() + self.len;
        out.extend_from_slice(&self.text);
        out.truncate(end);
    }
}

/// The constant text around the data of one identifier on one bus.
#[derive(Debug, Clone, Copy)]
struct Head {
    bus: u16,
    known: bool,
    text: Piece<96>,
    /// What follows the data, while the frame is of the same kind.
    tail: Option<(Kind, Piece<96>)>,
}

/// Eight digits of four bytes, the first byte lowest in both: one nibble goes to each byte of the
/// result.
#[inline]
const fn hex_of_4(bytes: u32) -> u64 {
    const ONES: u64 = 0x0101_0101_0101_0101;
    let spread = bytes as u64;
    let spread = (spread | spread << 16) & 0x0000_FFFF_0000_FFFF;
    let spread = (spread | spread << 8) & 0x00FF_00FF_00FF_00FF;
    let nibbles = (spread >> 4 & 0x000F_000F_000F_000F) | (spread & 0x000F_000F_000F_000F) << 8;
    let letters = (nibbles + 6 * ONES) >> 4 & ONES;
    nibbles + b'0' as u64 * ONES + letters * (b'A' - b'9' - 1) as u64
}

#[inline]
fn put_hex(out: &mut Vec<u8>, data: &[u8]) {
    // The data of a classic frame in one go; of a longer one piece by piece.
    for data in data.chunks(8) {
        let bytes = match data.first_chunk() {
            Some(bytes) => u64::from_le_bytes(*bytes),
            None => data.iter().rev().fold(0, |bytes, &byte| bytes << 8 | u64::from(byte)),
        };
        let text = [hex_of_4(bytes as u32).to_le_bytes(), hex_of_4((bytes >> 32) as u32).to_le_bytes()];
        let end = out.len() + 2 * data.len();
        out.extend_from_slice(text.as_flattened());
        out.truncate(end);
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
        Self {
            out: Vec::with_capacity(2 * super::BLOCK),
            names,
            bus: (String::new(), b"\"\"".to_vec()),
            heads: vec![Head { bus: 0, known: false, text: Piece::EMPTY, tail: None }; 0x800],
            seconds: (u64::MAX, Piece::EMPTY),
        }
    }

    /// `{"t":…` with six decimals, the whole seconds from the frame before where they are the same.
    #[inline]
    fn put_start(&mut self, time: Option<Time>) {
        let nanos = match time {
            Some(Time(nanos)) if nanos >= 0 && nanos % 1000 == 0 => nanos as u64,
            _ => {
                self.out.extend_from_slice(b"{\"t\":");
                return put_time(&mut self.out, time);
            }
        };
        let seconds = nanos / 1_000_000_000;
        if self.seconds.0 != seconds {
            let text = format!("{{\"t\":{seconds}.");
            self.seconds = (seconds, Piece::new(text.as_bytes()).unwrap_or(Piece::EMPTY));
        }
        self.seconds.1.put(&mut self.out);
        let micros = (nanos % 1_000_000_000 / 1000) as u32;
        let pair = |number: u32| {
            let number = (number % 100) as u8;
            [b'0' + number / 10, b'0' + number % 10]
        };
        self.out.extend_from_slice([pair(micros / 10_000), pair(micros / 100), pair(micros)].as_flattened());
    }

    /// What stands between time and data.
    #[inline]
    fn put_head(&mut self, record: &Record, bus: Option<&str>) {
        let frame = &record.frame;
        let number = number_of(record);
        let plain = !frame.extended && frame.kind == FrameKind::Data;
        let at = frame.id as usize;
        if plain
            && let Some(head) = self.heads.get(at)
            && head.known
            && head.bus == number
        {
            return head.text.put(&mut self.out);
        }
        let from = self.out.len();
        key!(self.out, "bus");
        self.put_bus(bus);
        key!(self.out, "id");
        put_number(&mut self.out, frame.id);
        let remote = frame.kind == FrameKind::Remote;
        self.out.extend_from_slice(match (frame.extended, remote) {
            (false, false) => b",\"ext\":false,\"rtr\":false,\"data\":\"".as_slice(),
            (false, true) => b",\"ext\":false,\"rtr\":true,\"data\":\"",
            (true, false) => b",\"ext\":true,\"rtr\":false,\"data\":\"",
            (true, true) => b",\"ext\":true,\"rtr\":true,\"data\":\"",
        });
        let text = self.out.get(from..).and_then(Piece::new);
        if plain && let (Some(head), Some(text)) = (self.heads.get_mut(at), text) {
            *head = Head { bus: number, known: true, text, tail: None };
        }
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
    fn frame(&mut self, record: &Record, bus: Option<&str>, kind: &Kind, tracer: &Tracer) {
        let frame = &record.frame;
        self.put_start(record.time);
        self.put_head(record, bus);
        let out = &mut self.out;
        put_hex(out, frame.data());
        let plain = !frame.extended
            && frame.kind == FrameKind::Data
            && record.direction.is_none()
            && !record.loopback
            && matches!(kind, Kind::Pdo { .. } | Kind::Heartbeat { .. } | Kind::Unknown);
        let head = self.heads.get_mut(frame.id as usize).filter(|_| plain);
        if let Some(Head { tail: Some((same, tail)), .. }) = &head
            && same == kind
            && tracer.mapped(number_of(record), kind, frame.data()).next().is_none()
        {
            return tail.put(out);
        }
        let from = out.len();
        put_tail(out, record, kind);
        let constant = !put_mapped(out, self.names, kind, tracer, number_of(record), frame.data());
        out.extend_from_slice(b"}\n");
        if let Some(head) = head.filter(|_| constant) {
            head.tail = out.get(from..).and_then(Piece::new).map(|tail| (*kind, tail));
        }
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

/// What follows the data, the objects of a PDO apart.
fn put_tail(out: &mut Vec<u8>, record: &Record, kind: &Kind) {
    let frame = &record.frame;
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
    key!(out, "kind");
    put_word(out, NAMES[name_of(frame.kind, kind)]);
    put_fields(out, kind, frame.data());
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

/// The objects in a PDO whose mapping is known; whether there are any.
fn put_mapped(out: &mut Vec<u8>, names: &Names, kind: &Kind, tracer: &Tracer, bus: u16, data: &[u8]) -> bool {
    let Kind::Pdo { node, .. } = *kind else { return false };
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
    !first
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hex_and_times() {
        let every: Vec<u8> = (0..=255).collect();
        let mut out = Vec::new();
        put_hex(&mut out, &every);
        let expected: String = every.iter().map(|byte| format!("{byte:02X}")).collect();
        assert_eq!(String::from_utf8(out).unwrap(), expected);
        for (nanos, text) in [
            (Some(0), "0.000000"),
            (Some(1_682_489_978_627_243_000), "1682489978.627243"),
            (Some(1_000_000_001), "1.000000001"),
            (Some(-1_500_000_000), "-1.500000"),
            (None, "null"),
        ] {
            let mut out = Vec::new();
            put_time(&mut out, nanos.map(Time));
            assert_eq!(String::from_utf8(out).unwrap(), text);
        }
    }
}
