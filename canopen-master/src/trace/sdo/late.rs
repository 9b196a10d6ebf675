//! Transfers that were under way when listening began.

use core::time::Duration;

use pdo::NodeId;

use super::{Content, Direction, Mode, Open, Phase, Way};
use crate::sdo::UNNAMED;
use crate::sdo::message::{self, Request, Response};

/// So many frames one way, numbered one after the other, are segments of a block transfer: what begins a
/// transfer is answered, or said again as it was.
const RUN: u8 = 2;

/// What a channel has brought before the first transfer was heard from its beginning.
#[derive(Debug)]
pub(super) struct Lead {
    way: Way,
    /// First byte of the frame before, without the bit of the last segment.
    sequence: u8,
    /// Frames before this one that were numbered one after the other.
    run: u8,
}

impl Lead {
    pub(super) const NEW: Self = Self { way: Way::Request, sequence: 0, run: 0 };

    /// Whether the frame is numbered as if it followed on the one before.
    pub(super) fn goes_on(&self, way: Way, data: &[u8]) -> bool {
        self.run > 0 && way == self.way && data.len() == 8 && sequence(data) == self.sequence + 1
    }

    /// Whether the frame is a segment that follows on others.
    pub(super) fn is_inside_a_block(&self, way: Way, data: &[u8]) -> bool {
        self.run >= RUN && self.goes_on(way, data)
    }

    pub(super) fn heard(&mut self, way: Way, data: &[u8]) {
        let run = if self.goes_on(way, data) { self.run.saturating_add(1) } else { 1 };
        *self = Self { way, sequence: sequence(data), run };
    }
}

/// The number that the first byte of a segment is.
fn sequence(data: &[u8]) -> u8 {
    data.first().map_or(0, |byte| byte & 0x7F)
}

/// The transfer that a frame is from the middle of; `None` where it may be all that there was.
pub(super) fn open(
    bus: u16,
    node: NodeId,
    way: Way,
    content: &Content,
    now: Option<Duration>,
) -> Option<Open> {
    use Direction::{Download, Upload};
    let segments = |toggle, asked| Phase::Segments { toggle, asked, last: false };
    let (at, direction, mode, phase) = match *content {
        Content::Response(Response::InitiateUpload { at, content: message::Content::Segmented(_) }) => {
            (at, Upload, Mode::Segmented, Phase::Initiate)
        }
        Content::Response(Response::InitiateBlockUpload { at, .. }) => {
            (at, Upload, Mode::Block, Phase::Initiate)
        }
        Content::Response(Response::InitiateBlockDownload { at, .. }) => {
            (at, Download, Mode::Block, Phase::Initiate)
        }
        Content::Request(Request::UploadSegment { toggle }) => {
            (UNNAMED, Upload, Mode::Segmented, segments(toggle, false))
        }
        Content::Response(Response::UploadSegment { toggle, .. }) => {
            (UNNAMED, Upload, Mode::Segmented, segments(toggle, true))
        }
        Content::Request(Request::DownloadSegment { toggle, .. }) => {
            (UNNAMED, Download, Mode::Segmented, segments(toggle, false))
        }
        Content::Response(Response::DownloadSegment { toggle }) => {
            (UNNAMED, Download, Mode::Segmented, segments(toggle, true))
        }
        Content::Request(Request::StartBlockUpload) => (UNNAMED, Upload, Mode::Block, Phase::BlockStart),
        Content::Request(Request::AckBlockUpload { .. }) => (UNNAMED, Upload, Mode::Block, Phase::BlockData),
        Content::Response(Response::EndBlockUpload { .. }) => (UNNAMED, Upload, Mode::Block, Phase::BlockEnd),
        Content::Request(Request::EndBlockUpload) => (UNNAMED, Upload, Mode::Block, Phase::BlockEnding),
        Content::Response(Response::AckBlockDownload { .. }) => {
            (UNNAMED, Download, Mode::Block, Phase::BlockData)
        }
        Content::Request(Request::EndBlockDownload { .. }) => {
            (UNNAMED, Download, Mode::Block, Phase::BlockEnd)
        }
        Content::Response(Response::EndBlockDownload) => (UNNAMED, Download, Mode::Block, Phase::BlockEnding),
        Content::Segment(_) if way == Way::Request => (UNNAMED, Download, Mode::Block, Phase::BlockData),
        Content::Segment(_) => (UNNAMED, Upload, Mode::Block, Phase::BlockData),
        _ => return None,
    };
    let mut open = Open::new(bus, node, (at, direction, mode), phase, now);
    open.transfer.late = true;
    if let Content::Segment(segment) = content {
        open.next = segment.sequence;
    }
    Some(open)
}
