//! SDO transfers put together by listening: expedited, segmented, block, both directions.

use alloc::boxed::Box;
use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::time::Duration;

use pdo::{Address, NodeId};

use crate::sdo::AbortCode;
use crate::sdo::message::{self, BlockSegment, Request, Response, SEGMENT};

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
    /// Object.
    pub at: Address,
    /// What was transferred, the first [`MAX_KEPT`] bytes of it.
    pub data: Vec<u8>,
    /// Bytes transferred.
    pub size: u64,
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
    /// Segments are missing in the capture.
    holes: bool,
}

impl Open {
    fn push(&mut self, bytes: &[u8]) {
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
            self.holes = true;
        }
        self.truncate(self.confirmed + u64::from(sequence) * SEGMENT as u64);
        let last = self.last == Some(sequence);
        self.begin_sub_block();
        if last {
            self.phase = Phase::BlockEnd;
        }
    }

    fn end_of_blocks(&mut self, unused: u8) {
        self.truncate(self.transfer.size.saturating_sub(u64::from(unused)));
        self.phase = Phase::BlockEnding;
    }
}

/// The channel between the clients and one server.
#[derive(Debug)]
pub(super) struct Watch {
    node: NodeId,
    open: Option<Box<Open>>,
}

impl Watch {
    pub(super) const fn new(node: NodeId) -> Self {
        Self { node, open: None }
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
            self.end(Outcome::Incomplete, events);
            let transfer = Transfer {
                bus,
                node: self.node,
                direction,
                mode,
                at,
                data: Vec::new(),
                size: 0,
                outcome: Outcome::Incomplete,
                frames: 0,
                began: now,
                ended: now,
            };
            let (phase, next) = (Phase::Initiate, 1);
            let open = Open { transfer, phase, confirmed: 0, next, last: None, holes: false };
            self.open = Some(Box::new(open));
        }
        let known = self.open.as_ref().map(|open| open.transfer.at);
        let belongs = match self.open.as_mut() {
            Some(open) => step(open, &content),
            None => Step::Foreign,
        };
        let at = address(&content).or(if belongs == Step::Foreign { None } else { known });
        if let (Some(open), true) = (self.open.as_mut(), belongs != Step::Foreign) {
            open.transfer.frames += 1;
            open.transfer.ended = now;
        }
        if let Step::Ended(outcome) = belongs {
            self.end(outcome, events);
        }
        SdoFrame { node: self.node, way, content, at }
    }

    /// What a frame of the channel says, without any consequence.
    pub(super) fn look(&self, way: Way, data: &[u8]) -> SdoFrame {
        let content = self.parse(way, data);
        SdoFrame { node: self.node, way, content, at: address(&content) }
    }

    /// Ends the open transfer as incomplete.
    pub(super) fn finish(&mut self, events: &mut VecDeque<Transfer>) {
        self.end(Outcome::Incomplete, events);
    }

    fn end(&mut self, outcome: Outcome, events: &mut VecDeque<Transfer>) {
        if let Some(open) = self.open.take() {
            let holes = open.holes && outcome == Outcome::Done;
            let outcome = if holes { Outcome::Incomplete } else { outcome };
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

/// The transfer that a request begins.
const fn initiates(request: &Request) -> Option<(Address, Direction, Mode)> {
    match *request {
        Request::InitiateUpload { at } => Some((at, Direction::Upload, Mode::Expedited)),
        Request::InitiateDownload { at, content } => Some((at, Direction::Download, mode(&content))),
        Request::InitiateBlockUpload { at, .. } => Some((at, Direction::Upload, Mode::Block)),
        Request::InitiateBlockDownload { at, .. } => Some((at, Direction::Download, Mode::Block)),
        _ => None,
    }
}

const fn mode(content: &message::Content) -> Mode {
    match content {
        message::Content::Segmented(_) => Mode::Segmented,
        _ => Mode::Expedited,
    }
}

const fn address(content: &Content) -> Option<Address> {
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
enum Step {
    /// Nothing: it does not belong to it.
    Foreign,
    /// It goes on.
    Goes,
    /// It ends.
    Ended(Outcome),
}

fn step(open: &mut Open, content: &Content) -> Step {
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
fn aborted(open: &Open, at: Address, by: Way, code: AbortCode) -> Step {
    if at == open.transfer.at || at == Address::new(0, 0) {
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
                message::Content::Segmented(_) => {}
            }
            Step::Goes
        }
        (
            Request::InitiateUpload { .. }
            | Request::InitiateBlockUpload { .. }
            | Request::InitiateBlockDownload { .. },
            _,
        ) => Step::Goes,
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
        (Request::EndBlockDownload { unused, .. }, Phase::BlockEnd | Phase::BlockData) if !upload => {
            open.end_of_blocks(unused);
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
                message::Content::Segmented(_) => {
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
        (Response::InitiateBlockDownload { at, .. }, Phase::Initiate)
            if !upload && mode == Mode::Block && mine(at, open) =>
        {
            open.phase = Phase::BlockData;
            Step::Goes
        }
        (Response::AckBlockDownload { sequence, .. }, Phase::BlockData) if !upload => {
            open.acknowledge(sequence);
            Step::Goes
        }
        (Response::EndBlockDownload, Phase::BlockEnding) if !upload => Step::Ended(Outcome::Done),
        (Response::InitiateBlockUpload { at, .. }, Phase::Initiate)
            if upload && mode == Mode::Block && mine(at, open) =>
        {
            open.phase = Phase::BlockStart;
            Step::Goes
        }
        (Response::EndBlockUpload { unused, .. }, Phase::BlockEnd | Phase::BlockData) if upload => {
            open.end_of_blocks(unused);
            Step::Goes
        }
        _ => Step::Foreign,
    }
}
