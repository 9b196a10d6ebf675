//! The fields of every service.

use canopen_master::lss;
use canopen_master::nmt::{Command, State};
use canopen_master::sdo::message::{Request, Response};
use canopen_master::trace::{Content, Kind, Lss, PdoDirection, SdoFrame, Tracer, Way};
use motion_io::capture::{Direction, FrameKind, Record, Time};

use super::super::names::Names;
use super::super::{NAMES, name_of};
use super::text::{key, put_hex, put_number, put_option, put_time, put_word};

/// What follows the data, the objects of a PDO apart.
pub(super) fn put_tail(out: &mut Vec<u8>, record: &Record, kind: &Kind) {
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
                put_time(out, Some(Time::from_zero(interval)));
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

const fn lss_request(request: &lss::Request) -> &'static str {
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

const fn lss_response(response: &lss::Response) -> &'static str {
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
pub(super) fn put_mapped(
    out: &mut Vec<u8>,
    names: &Names,
    kind: &Kind,
    tracer: &Tracer,
    bus: u16,
    data: &[u8],
) {
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

fn put_state(out: &mut Vec<u8>, state: Option<State>) {
    match state {
        Some(State::BootUp) => put_word(out, "boot-up"),
        Some(State::Stopped) => put_word(out, "stopped"),
        Some(State::Operational) => put_word(out, "operational"),
        Some(State::PreOperational) => put_word(out, "pre-operational"),
        None => out.extend_from_slice(b"null"),
    }
}
