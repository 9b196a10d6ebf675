//! What a frame does to the transfer that is open.

use pdo::Address;

use super::{Content, Direction, Mode, Open, Outcome, Phase, Way};
use crate::sdo::message::{self, Request, Response};
use crate::sdo::{AbortCode, UNNAMED};

/// The transfer that a request begins.
pub(super) const fn initiates(request: &Request) -> Option<(Address, Direction, Mode)> {
    match *request {
        Request::InitiateUpload { at } => Some((at, Direction::Upload, Mode::Expedited)),
        Request::InitiateDownload { at, content } => Some((at, Direction::Download, mode(&content))),
        Request::InitiateBlockUpload { at, .. } => Some((at, Direction::Upload, Mode::Block)),
        Request::InitiateBlockDownload { at, .. } => Some((at, Direction::Download, Mode::Block)),
        _ => None,
    }
}

pub(super) const fn mode(content: &message::Content) -> Mode {
    match content {
        message::Content::Segmented(_) => Mode::Segmented,
        _ => Mode::Expedited,
    }
}

pub(super) const fn address(content: &Content) -> Option<Address> {
    match *content {
        Content::Request(
            Request::InitiateUpload { at }
            | Request::InitiateDownload { at, .. }
            | Request::InitiateBlockUpload { at, .. }
            | Request::InitiateBlockDownload { at, .. }
            | Request::Abort { at, .. },
        )
        | Content::Response(
            Response::InitiateUpload { at, .. }
            | Response::InitiateDownload { at }
            | Response::InitiateBlockUpload { at, .. }
            | Response::InitiateBlockDownload { at, .. }
            | Response::Abort { at, .. },
        ) => Some(at),
        _ => None,
    }
}

/// What a frame does to the open transfer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// Nothing: it does not belong to it.
    Foreign,
    /// It goes on.
    Goes,
    /// It ends.
    Ended(Outcome),
}

pub(super) fn step(open: &mut Open, content: &Content) -> Step {
    match content {
        Content::Request(Request::Abort { at, code }) => aborted(open, *at, Way::Request, *code),
        Content::Response(Response::Abort { at, code }) => aborted(open, *at, Way::Response, *code),
        Content::Request(request) => step_request(open, request),
        Content::Response(response) => step_response(open, response),
        Content::Segment(segment) => {
            open.segment(segment);
            Step::Goes
        }
        Content::Malformed(_) => Step::Foreign,
    }
}

/// An abort ends the transfer of its object. Servers that cannot tell the object say 0000h:00.
fn aborted(open: &mut Open, at: Address, by: Way, code: AbortCode) -> Step {
    if open.transfer.late && open.transfer.at == UNNAMED {
        open.transfer.at = at;
    }
    if at == open.transfer.at || at == UNNAMED {
        Step::Ended(Outcome::Aborted { by, code })
    } else {
        Step::Foreign
    }
}

fn step_request(open: &mut Open, request: &Request) -> Step {
    let upload = open.transfer.direction == Direction::Upload;
    match (*request, open.phase) {
        (Request::InitiateDownload { content, .. }, _) => {
            match content {
                message::Content::Expedited { data, .. } => {
                    open.push(message::first(&data.padded(), data.len()));
                }
                message::Content::Segmented(size) => open.transfer.announced = size,
            }
            Step::Goes
        }
        (Request::InitiateUpload { .. }, _) => Step::Goes,
        (Request::InitiateBlockUpload { crc, .. }, _) => {
            open.check = crc;
            Step::Goes
        }
        (Request::InitiateBlockDownload { crc, size, .. }, _) => {
            open.check = crc;
            open.transfer.announced = size;
            Step::Goes
        }
        (Request::UploadSegment { toggle }, Phase::Segments { toggle: next, .. })
            if upload && toggle == next =>
        {
            open.phase = Phase::Segments { toggle, asked: true, last: false };
            Step::Goes
        }
        (Request::DownloadSegment { toggle, last, data }, Phase::Segments { toggle: next, asked, .. })
            if !upload && toggle == next =>
        {
            // The same segment again, before its answer, carries nothing new.
            if !asked {
                open.push(message::first(&data.padded(), data.len()));
            }
            open.phase = Phase::Segments { toggle, asked: true, last };
            Step::Goes
        }
        (Request::StartBlockUpload, Phase::BlockStart) => {
            open.phase = Phase::BlockData;
            Step::Goes
        }
        (Request::AckBlockUpload { sequence, .. }, Phase::BlockData) if upload => {
            open.acknowledge(sequence);
            Step::Goes
        }
        (Request::EndBlockUpload, Phase::BlockEnding) if upload => Step::Ended(Outcome::Done),
        (Request::EndBlockDownload { unused, crc }, Phase::BlockEnd | Phase::BlockData) if !upload => {
            open.end_of_blocks(unused, crc);
            Step::Goes
        }
        _ => Step::Foreign,
    }
}

fn step_response(open: &mut Open, response: &Response) -> Step {
    let upload = open.transfer.direction == Direction::Upload;
    let mode = open.transfer.mode;
    let mine = |at: Address, open: &Open| at == open.transfer.at;
    match (*response, open.phase) {
        (Response::InitiateUpload { at, content }, Phase::Initiate) if upload && mine(at, open) => {
            // The answer to a block upload may be a plain one.
            open.transfer.mode = self::mode(&content);
            match content {
                message::Content::Expedited { data, .. } => {
                    open.push(message::first(&data.padded(), data.len()));
                }
                message::Content::Segmented(size) => {
                    open.transfer.announced = size;
                    open.phase = Phase::Segments { toggle: false, asked: false, last: false };
                    return Step::Goes;
                }
            }
            Step::Ended(Outcome::Done)
        }
        (
            Response::UploadSegment { toggle, last, data },
            Phase::Segments { toggle: next, asked: true, .. },
        ) if upload && toggle == next => {
            open.push(message::first(&data.padded(), data.len()));
            if last {
                return Step::Ended(Outcome::Done);
            }
            open.phase = Phase::Segments { toggle: !toggle, asked: false, last: false };
            Step::Goes
        }
        (Response::InitiateDownload { at }, Phase::Initiate) if !upload && mine(at, open) => match mode {
            Mode::Expedited => Step::Ended(Outcome::Done),
            Mode::Segmented => {
                open.phase = Phase::Segments { toggle: false, asked: false, last: false };
                Step::Goes
            }
            Mode::Block => Step::Foreign,
        },
        (Response::DownloadSegment { toggle }, Phase::Segments { toggle: next, asked: true, last })
            if !upload && toggle == next =>
        {
            if last {
                return Step::Ended(Outcome::Done);
            }
            open.phase = Phase::Segments { toggle: !toggle, asked: false, last: false };
            Step::Goes
        }
        (Response::InitiateBlockDownload { at, crc, .. }, Phase::Initiate)
            if !upload && mode == Mode::Block && mine(at, open) =>
        {
            open.check &= crc;
            open.phase = Phase::BlockData;
            Step::Goes
        }
        (Response::AckBlockDownload { sequence, .. }, Phase::BlockData) if !upload => {
            open.acknowledge(sequence);
            Step::Goes
        }
        (Response::EndBlockDownload, Phase::BlockEnding) if !upload => Step::Ended(Outcome::Done),
        (Response::InitiateBlockUpload { at, crc, size }, Phase::Initiate)
            if upload && mode == Mode::Block && mine(at, open) =>
        {
            open.check &= crc;
            open.transfer.announced = size;
            open.phase = Phase::BlockStart;
            Step::Goes
        }
        (Response::EndBlockUpload { unused, crc }, Phase::BlockEnd | Phase::BlockData) if upload => {
            open.end_of_blocks(unused, crc);
            Step::Goes
        }
        _ => Step::Foreign,
    }
}
