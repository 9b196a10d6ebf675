//! SDO transfers put together by listening: expedited, segmented, block, both directions.

mod late;
mod step;

use alloc::boxed::Box;
use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::time::Duration;

use pdo::{Address, NodeId};

use crate::sdo::message::{BlockSegment, Request, Response, SEGMENT};
use crate::sdo::{AbortCode, UNNAMED, check_sum};
use late::Lead;
use step::{Step, address, initiates, step};

/// Bytes of one transfer that are kept; of a longer one only its size is counted on.
pub const MAX_KEPT: usize = 1 << 24;

/// Which way an SDO frame goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Way {
    /// From the client to the server.
    Request,
    /// From the server to the client.
    Response,
}

/// What an SDO frame says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content {
    /// Of the client.
    Request(Request),
    /// Of the server.
    Response(Response),
    /// A segment of a block transfer, from either side.
    Segment(BlockSegment),
    /// No SDO message; the first byte, 0 of an empty frame.
    Malformed(u8),
}

/// An SDO frame in its context.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SdoFrame {
    /// Whose server.
    pub node: NodeId,
    /// Which way it goes.
    pub way: Way,
    /// What it says.
    pub content: Content,
    /// The object: from the frame, or from the transfer that it belongs to.
    pub at: Option<Address>,
    /// It is part of a transfer, which comes out as a [`Transfer`]. False of an answer or an abort whose
    /// request was not heard, and of what a protocol fault leaves over.
    pub belongs: bool,
}

impl SdoFrame {
    /// The code, where it ends a transfer.
    #[must_use]
    pub const fn abort(&self) -> Option<AbortCode> {
        match self.content {
            Content::Request(Request::Abort { code, .. })
            | Content::Response(Response::Abort { code, .. }) => Some(code),
            _ => None,
        }
    }
}

/// Upload reads from the server, download writes to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Direction {
    /// The client reads.
    Upload,
    /// The client writes.
    Download,
}

/// How the data travel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Mode {
    /// Up to 4 bytes in the initiate frame; also a transfer that ended before it was clear.
    Expedited,
    /// 7 bytes a frame, each answered.
    Segmented,
    /// Up to 127 segments answered at once.
    Block,
}

/// How a transfer ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Outcome {
    /// All of it arrived.
    Done,
    /// One side gave up.
    Aborted {
        /// Who.
        by: Way,
        /// Why.
        code: AbortCode,
    },
    /// Another transfer began, or the capture ended, before this one had; or the capture lacks
    /// segments of it.
    Incomplete,
}

/// A CRC that is not that of the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct WrongCrc {
    /// It came in the frame that ends the blocks.
    pub found: u16,
    /// Over the data that came.
    pub computed: u16,
}

/// An SDO frame of fewer than the 8 bytes that every one has (CiA 301, 7.2.4.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ShortFrame {
    /// Which way it goes.
    pub way: Way,
    /// Bytes there are.
    pub len: usize,
}

impl ShortFrame {
    /// `None` of one that is long enough.
    #[must_use]
    pub const fn of(way: Way, data: &[u8]) -> Option<Self> {
        if data.len() < 8 { Some(Self { way, len: data.len() }) } else { None }
    }
}

/// An SDO transfer that has ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Transfer {
    /// Bus.
    pub bus: u16,
    /// Whose server.
    pub node: NodeId,
    /// Read or write.
    pub direction: Direction,
    /// How.
    pub mode: Mode,
    /// Object; 0000h:00 of a late transfer that nothing names.
    pub at: Address,
    /// Its beginning was not heard: the first frame of its channel was one from inside it. Its data and
    /// its size are those from there on.
    pub late: bool,
    /// The capture lacks segments of it: its data and its size are those before the first of them.
    pub lacking: bool,
    /// What was transferred, the first [`MAX_KEPT`] bytes of it.
    pub data: Vec<u8>,
    /// Bytes transferred.
    pub size: u64,
    /// The first of its frames that is too short; what it says is taken all the same.
    pub short: Option<ShortFrame>,
    /// Bytes announced at its beginning, of one in segments or blocks.
    pub announced: Option<u32>,
    /// Of a block transfer heard without a gap, of which both sides agreed on a CRC: it is wrong.
    pub wrong_crc: Option<WrongCrc>,
    /// How it ended.
    pub outcome: Outcome,
    /// Frames of both sides, the abort included.
    pub frames: u64,
    /// Time of the first frame.
    pub began: Option<Duration>,
    /// Time of the last frame.
    pub ended: Option<Duration>,
}

impl Transfer {
    /// Whether all of it arrived.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.outcome == Outcome::Done
    }

    /// The bytes announced, where more or fewer came.
    #[must_use]
    pub fn misannounced(&self) -> Option<u32> {
        self.announced.filter(|announced| u64::from(*announced) != self.size)
    }
}

/// Where an open transfer stands: what comes next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// The server's answer to the initiate request.
    Initiate,
    /// Segments; `toggle` is that of the next one. `asked`: the request is out, `last`: it was the
    /// last one.
    Segments { toggle: bool, asked: bool, last: bool },
    /// The client's start of a block upload.
    BlockStart,
    /// Segments of a sub-block, or its acknowledge.
    BlockData,
    /// The end of a block transfer.
    BlockEnd,
    /// The answer to the end.
    BlockEnding,
}

#[derive(Debug)]
struct Open {
    transfer: Transfer,
    phase: Phase,
    /// Bytes before the sub-block.
    confirmed: u64,
    /// Next sequence number of the sub-block.
    next: u8,
    /// Sequence number of the last segment of all, once seen.
    last: Option<u8>,
    /// Both sides compute a CRC, and everything that it is over was heard.
    check: bool,
}

impl Open {
    fn new(
        bus: u16,
        node: NodeId,
        (at, direction, mode): (Address, Direction, Mode),
        phase: Phase,
        now: Option<Duration>,
    ) -> Self {
        let transfer = Transfer {
            bus,
            node,
            direction,
            mode,
            at,
            late: false,
            lacking: false,
            data: Vec::new(),
            size: 0,
            short: None,
            announced: None,
            wrong_crc: None,
            outcome: Outcome::Incomplete,
            frames: 0,
            began: now,
            ended: now,
        };
        Self { transfer, phase, confirmed: 0, next: 1, last: None, check: false }
    }

    fn push(&mut self, bytes: &[u8]) {
        if self.transfer.lacking {
            return;
        }
        let room = MAX_KEPT.saturating_sub(self.transfer.data.len()).min(bytes.len());
        self.transfer.data.extend_from_slice(bytes.get(..room).unwrap_or(&[]));
        self.transfer.size = self.transfer.size.saturating_add(bytes.len() as u64);
    }

    fn truncate(&mut self, size: u64) {
        if size < self.transfer.size {
            self.transfer.size = size;
            self.transfer.data.truncate(usize::try_from(size).unwrap_or(usize::MAX));
        }
    }

    fn segment(&mut self, segment: &BlockSegment) {
        // Sequence number 1 again: the acknowledge between is missing in the capture.
        if segment.sequence == 1 && self.next > 1 {
            self.begin_sub_block();
            self.check = false;
        }
        if segment.last {
            self.last = Some(segment.sequence);
        }
        if segment.sequence == self.next {
            self.next += 1;
            self.push(&segment.data);
        }
    }

    fn begin_sub_block(&mut self) {
        self.confirmed = self.transfer.size;
        self.next = 1;
        self.last = None;
    }

    /// The receiver has the segments up to `sequence`; what came behind them comes again.
    fn acknowledge(&mut self, sequence: u8) {
        if sequence >= self.next {
            self.transfer.lacking = true;
        }
        self.truncate(self.confirmed + u64::from(sequence) * SEGMENT as u64);
        let last = self.last == Some(sequence);
        self.begin_sub_block();
        if last {
            self.phase = Phase::BlockEnd;
        }
    }

    fn end_of_blocks(&mut self, unused: u8, found: u16) {
        if !self.transfer.lacking {
            self.truncate(self.transfer.size.saturating_sub(u64::from(unused)));
            let kept = self.transfer.data.len() as u64 == self.transfer.size;
            // Without the last acknowledge nobody knows what was taken of the segments before it.
            if self.check && kept && self.phase == Phase::BlockEnd {
                let computed = check_sum(&self.transfer.data);
                self.transfer.wrong_crc = (computed != found).then_some(WrongCrc { found, computed });
            }
        }
        self.phase = Phase::BlockEnding;
    }
}

/// The channel between the clients and one server.
#[derive(Debug)]
pub(super) struct Watch {
    node: NodeId,
    open: Option<Box<Open>>,
    /// Until a transfer is heard from its beginning.
    lead: Option<Lead>,
}

impl Watch {
    pub(super) const fn new(node: NodeId) -> Self {
        Self { node, open: None, lead: Some(Lead::NEW) }
    }

    /// Takes a frame of the channel; a transfer that ends with it goes to `events`.
    pub(super) fn handle(
        &mut self,
        now: Option<Duration>,
        bus: u16,
        way: Way,
        data: &[u8],
        events: &mut VecDeque<Transfer>,
    ) -> SdoFrame {
        let content = self.parse(way, data);
        let initiated = match content {
            Content::Request(request) => initiates(&request),
            _ => None,
        };
        if let Some((at, direction, mode)) = initiated {
            if direction == Direction::Upload
                && self.lead.as_ref().is_some_and(|lead| lead.goes_on(way, data))
            {
                // Nobody begins an upload with 41h after 40h: the one before was a segment, too.
                self.open = None;
            }
            self.end(Outcome::Incomplete, events);
            self.open =
                Some(Box::new(Open::new(bus, self.node, (at, direction, mode), Phase::Initiate, now)));
        } else if let Some(lead) = &self.lead
            && (self.open.is_none() || lead.is_inside_a_block(way, data))
        {
            // A segment may have looked like the beginning of a transfer: that one never was.
            self.open = late::open(bus, self.node, way, &content, now).map(Box::new);
        }
        let known = self.open.as_ref().map(|open| open.transfer.at).filter(|at| *at != UNNAMED);
        let belongs = match self.open.as_mut() {
            Some(open) => step(open, &content),
            None => Step::Foreign,
        };
        let at = address(&content).or(if belongs == Step::Foreign { None } else { known });
        if let (Some(open), true) = (self.open.as_mut(), belongs != Step::Foreign) {
            open.transfer.frames += 1;
            open.transfer.short = open.transfer.short.or(ShortFrame::of(way, data));
            open.transfer.ended = now;
        }
        // What looks like segments of a late transfer may turn out to be those of a block.
        let known = |open: &Open| {
            open.phase != Phase::Initiate && !(open.transfer.late && open.transfer.mode == Mode::Segmented)
        };
        if matches!(belongs, Step::Ended(_)) || self.open.as_deref().is_some_and(known) {
            self.lead = None;
        } else if let Some(lead) = &mut self.lead {
            lead.heard(way, data);
        }
        if let Step::Ended(outcome) = belongs {
            self.end(outcome, events);
        }
        SdoFrame { node: self.node, way, content, at, belongs: belongs != Step::Foreign }
    }

    /// What a frame of the channel says, without any consequence.
    pub(super) fn look(&self, way: Way, data: &[u8]) -> SdoFrame {
        let content = self.parse(way, data);
        SdoFrame { node: self.node, way, content, at: address(&content), belongs: false }
    }

    /// Ends the open transfer as incomplete.
    pub(super) fn finish(&mut self, events: &mut VecDeque<Transfer>) {
        self.end(Outcome::Incomplete, events);
    }

    fn end(&mut self, outcome: Outcome, events: &mut VecDeque<Transfer>) {
        if let Some(open) = self.open.take() {
            let lacking = open.transfer.lacking && outcome == Outcome::Done;
            let outcome = if lacking { Outcome::Incomplete } else { outcome };
            events.push_back(Transfer { outcome, ..open.transfer });
        }
    }

    /// Inside a sub-block the sender's frames have no command byte.
    fn parse(&self, way: Way, data: &[u8]) -> Content {
        let sends = |open: &Open| match open.transfer.direction {
            Direction::Upload => way == Way::Response,
            Direction::Download => way == Way::Request,
        };
        let whole = match way {
            Way::Request => Request::parse(data).map(Content::Request),
            Way::Response => Response::parse(data).map(Content::Response),
        };
        let whole = whole.unwrap_or_else(|error| Content::Malformed(error.command()));
        if self.lead.as_ref().is_some_and(|lead| lead.is_inside_a_block(way, data)) {
            return BlockSegment::parse(data).map_or(whole, Content::Segment);
        }
        let Some(open) = self.open.as_ref().filter(|open| open.phase == Phase::BlockData && sends(open))
        else {
            return whole;
        };
        match BlockSegment::parse(data) {
            Some(segment) => {
                let in_order = segment.sequence == open.next;
                let ends = open.last.is_some() && is_block_end(&whole);
                let restarts = matches!(whole, Content::Request(Request::InitiateUpload { .. }))
                    && data.get(4..) == Some(&[0; 4]);
                if !in_order && (ends || restarts) { whole } else { Content::Segment(segment) }
            }
            None => whole,
        }
    }
}

const fn is_block_end(content: &Content) -> bool {
    matches!(
        content,
        Content::Request(Request::EndBlockDownload { .. })
            | Content::Response(Response::EndBlockUpload { .. })
    )
}
