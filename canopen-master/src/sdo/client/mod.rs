//! The client: one transfer at a time on one channel, each with exactly one outcome.

mod block;
mod outcome;
mod segmented;

use core::time::Duration;

use pdo::{Frame, Handled};

use super::block::{Receiver, Sender};
use super::message::{ABORT, Content, Request, Response, SEGMENT};
use super::{AbortCode, Address, Buffer, Channel, UNNAMED, data_on};
use crate::clock::{after, is_due};
pub use block::Block;
pub use outcome::{Fault, Finished, Outcome, Refused, SubmitError, Ticket};

/// Time that a server has for each answer, unless set (CiA 301 names none).
pub const ANSWER: Duration = Duration::from_millis(500);

/// How one transfer is carried out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Longest time from a request to its answer; not the time of the whole transfer.
    pub timeout: Duration,
    /// In blocks; `None`: expedited or in segments.
    pub block: Option<Block>,
}

impl Options {
    /// Expedited or in segments.
    #[must_use]
    pub const fn new(timeout: Duration) -> Self {
        Self { timeout, block: None }
    }

    /// In blocks with CRC.
    #[must_use]
    pub fn block(timeout: Duration) -> Self {
        Self { timeout, block: Some(Block::default()) }
    }
}

impl Default for Options {
    fn default() -> Self {
        Self::new(ANSWER)
    }
}

#[derive(Debug, Clone, Copy)]
enum State {
    Idle,
    /// The request to begin was given; its answer is awaited.
    UploadBegun,
    /// A segment is awaited.
    UploadSegment {
        toggle: bool,
    },
    /// As `UploadBegun`. `sent` bytes went with it.
    DownloadBegun {
        sent: u8,
    },
    /// A segment of `sent` bytes is to be confirmed.
    DownloadSegment {
        toggle: bool,
        sent: u8,
        last: bool,
    },
    /// As `UploadBegun`, in blocks, or plain as the server likes, unless the threshold is 0.
    BlockUploadBegun {
        threshold: u8,
    },
    /// Segments of a sub-block come in.
    BlockReceive,
    /// All segments have come; the server's last word is awaited.
    BlockUploadEnd,
    /// As `DownloadBegun`, in blocks. A CRC was offered or not.
    BlockDownloadBegun {
        crc: bool,
    },
    /// Segments of a sub-block are to be sent.
    BlockSend,
    /// A sub-block is to be confirmed.
    BlockConfirm,
    /// The end is to be confirmed.
    BlockDownloadEnd,
    /// All data were transferred; the outcome waits to be polled.
    Done,
    /// It ended otherwise.
    Failed,
}

/// What the first request says.
#[derive(Debug, Clone, Copy)]
enum Opening {
    Upload,
    Download(Content),
    BlockDownload { crc: bool, size: Option<u32> },
}

/// The answer to a request that was given up, which may still come.
#[derive(Debug, Clone, Copy)]
struct Outstanding {
    upload: bool,
    /// `None`: segments, which any transfer could take for its own.
    at: Option<Address>,
    until: Duration,
}

/// An SDO client on one channel.
///
/// - Commands: [`upload`](Self::upload), [`download`](Self::download), [`cancel`](Self::cancel).
/// - Input: [`handle_frame`](Self::handle_frame), [`handle_timeout`](Self::handle_timeout).
/// - Output: [`poll_transmit`](Self::poll_transmit), [`poll_event`](Self::poll_event),
///   [`poll_timeout`](Self::poll_timeout).
/// - Getters: [`channel`](Self::channel), [`is_idle`](Self::is_idle), [`strays`](Self::strays),
///   [`progress`](Self::progress).
///
/// Nothing is ever repeated. A transfer that is given up is told to the server by an abort.
///
/// Late answers: while a transfer begins, every frame that does not answer it (another object, another
/// service) is counted and otherwise ignored, so no answer of an earlier transfer enters the next one.
/// An answer carries nothing to tell two like requests apart; therefore after a time-out or a cancel
/// before the first answer, the *same* request to the *same* object is held back until the old answer
/// has come, or for one more time-out. Segments do not even name their object: after a transfer that
/// failed among them, and after a block transfer in which some were repeated, the next transfer begins one
/// time-out later than it could.
#[derive(Debug, Clone)]
pub struct Client<B> {
    channel: Channel,
    state: State,
    /// Of a transfer that has failed.
    failure: Outcome,
    buffer: Option<B>,
    at: Address,
    timeout: Duration,
    deadline: Option<Duration>,
    /// Bytes transferred.
    offset: u32,
    /// Bytes in all, if known.
    size: Option<u32>,
    tx: Option<[u8; 8]>,
    /// The last word on a transfer that has ended.
    parting: Option<[u8; 8]>,
    sender: Sender,
    receiver: Receiver,
    /// Block download: a CRC was agreed on.
    check: bool,
    /// Block upload: the last segment, of which maybe not all bytes count.
    held: Option<[u8; SEGMENT]>,
    outstanding: Option<Outstanding>,
    /// Segments of the last transfer may still be on their way.
    unsettled: bool,
    ticket: u32,
    strays: u32,
}

impl<B: Buffer> Client<B> {
    /// An idle client.
    #[must_use]
    pub const fn new(channel: Channel) -> Self {
        Self {
            channel,
            state: State::Idle,
            failure: Outcome::Cancelled,
            buffer: None,
            at: Address::new(0, 0),
            timeout: ANSWER,
            deadline: None,
            offset: 0,
            size: None,
            tx: None,
            parting: None,
            sender: Sender::EMPTY,
            receiver: Receiver::EMPTY,
            check: false,
            held: None,
            outstanding: None,
            unsettled: false,
            ticket: 0,
            strays: 0,
        }
    }

    /// Its identifiers.
    #[must_use]
    pub const fn channel(&self) -> Channel {
        self.channel
    }

    /// Whether a transfer can be submitted.
    #[must_use]
    pub const fn is_idle(&self) -> bool {
        matches!(self.state, State::Idle)
    }

    /// Frames on the channel that answered nothing asked.
    #[must_use]
    pub const fn strays(&self) -> u32 {
        self.strays
    }

    /// Bytes transferred so far and, if known, in all, of the transfer under way.
    #[must_use]
    pub const fn progress(&self) -> (u32, Option<u32>) {
        (self.offset, self.size)
    }

    /// Reads an object into `buffer`.
    ///
    /// # Errors
    /// [`SubmitError::Busy`] until the last outcome has been polled.
    #[inline]
    pub fn upload(&mut self, at: Address, buffer: B, options: &Options) -> Result<Ticket, Refused<B>> {
        self.submit(at, buffer, options, false, |buffer| buffer)
    }

    /// Writes what `buffer` holds to an object.
    ///
    /// # Errors
    /// [`SubmitError::Busy`] until the last outcome has been polled, [`SubmitError::Source`] if the
    /// buffer cannot be read.
    #[inline]
    pub fn download(&mut self, at: Address, buffer: B, options: &Options) -> Result<Ticket, Refused<B>> {
        self.submit(at, buffer, options, true, |buffer| buffer)
    }

    /// The same where the client's buffer is made of the caller's.
    #[inline]
    pub(crate) fn submit<U: Buffer>(
        &mut self,
        at: Address,
        mut buffer: U,
        options: &Options,
        write: bool,
        wrap: impl FnOnce(U) -> B,
    ) -> Result<Ticket, Refused<U>> {
        if !self.is_idle() {
            return Err(Refused { error: SubmitError::Busy, buffer });
        }
        let opening =
            if write { segmented::open_download(&mut buffer, options) } else { Ok(Opening::Upload) };
        match opening {
            Ok(opening) => {
                self.buffer = Some(wrap(buffer));
                Ok(self.begin(at, opening, options))
            }
            Err(code) => Err(Refused { error: SubmitError::Source(code), buffer }),
        }
    }

    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    fn begin(&mut self, at: Address, opening: Opening, options: &Options) -> Ticket {
        self.at = at;
        self.size = None;
        self.timeout = options.timeout;
        self.offset = 0;
        let request = match (opening, &options.block) {
            (Opening::Upload, None) => {
                self.state = State::UploadBegun;
                Request::InitiateUpload { at }
            }
            (Opening::Upload, Some(block)) => self.begin_block_upload(block),
            (Opening::Download(content), _) => {
                let (size, sent) = match content {
                    Content::Expedited { data, .. } => (Some(data.len() as u32), data.len() as u8),
                    Content::Segmented(size) => (size, 0),
                };
                self.size = size;
                self.state = State::DownloadBegun { sent };
                Request::InitiateDownload { at, content }
            }
            (Opening::BlockDownload { crc, size }, _) => {
                self.size = size;
                self.state = State::BlockDownloadBegun { crc };
                Request::InitiateBlockDownload { at, crc, size }
            }
        };
        self.send(request);
        self.ticket = self.ticket.wrapping_add(1);
        Ticket(self.ticket)
    }

    /// Gives a transfer up; its outcome becomes [`Outcome::Cancelled`] unless it has one already.
    pub fn cancel(&mut self, ticket: Ticket) {
        if ticket != Ticket(self.ticket) || matches!(self.state, State::Idle | State::Done | State::Failed) {
            return;
        }
        // Before the first frame has left, the server knows of nothing.
        let begun = self.tx.is_none() || !self.is_beginning();
        self.expect_late(self.deadline);
        self.fail(Outcome::Cancelled);
        if begun {
            self.send_abort(AbortCode::TIMED_OUT);
        }
    }

    /// Takes a frame from the bus.
    #[inline]
    pub fn handle_frame(&mut self, now: Duration, frame: &impl embedded_can::Frame) -> Handled {
        let Some(data) = data_on(self.channel.response, frame) else { return Handled::Ignored };
        self.handle_data(now, data);
        Handled::Taken
    }

    /// Gives up what has waited too long; early calls do nothing.
    pub fn handle_timeout(&mut self, now: Duration) {
        if is_due(self.outstanding.map(|outstanding| outstanding.until), now) {
            self.outstanding = None;
        }
        let Some(deadline) = self.deadline.filter(|_| is_due(self.deadline, now)) else { return };
        if self.ask_again() {
            return;
        }
        self.expect_late(Some(after(deadline, self.timeout)));
        self.fail(Outcome::TimedOut);
        self.send_abort(AbortCode::TIMED_OUT);
    }

    /// When to call [`handle_timeout`](Self::handle_timeout); `None` = idle.
    #[must_use]
    #[inline]
    pub fn poll_timeout(&self) -> Option<Duration> {
        if self.tx.is_some() {
            return self.held_back_until();
        }
        self.deadline
    }

    /// The frame to send now, once.
    #[inline]
    pub fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        if self.parting.is_some() {
            return self.parting_frame();
        }
        let Some(tx) = self.tx else {
            if matches!(self.state, State::BlockSend) {
                return self.next_block_segment(now).or_else(|| self.parting_frame());
            }
            return None;
        };
        if self.unsettled {
            self.settle(now);
        }
        if self.held_back_until().is_some_and(|until| now < until) {
            return None;
        }
        self.tx = None;
        self.deadline = Some(after(now, self.timeout));
        Some(Frame::standard(self.channel.request, tx))
    }

    #[cold]
    fn settle(&mut self, now: Duration) {
        self.unsettled = false;
        self.outstanding = Some(Outstanding { upload: false, at: None, until: after(now, self.timeout) });
    }

    fn parting_frame(&mut self) -> Option<Frame> {
        self.parting.take().map(|parting| Frame::standard(self.channel.request, parting))
    }

    /// The outcome of the transfer and its buffer, once.
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    pub fn poll_event(&mut self) -> Option<Finished<B>> {
        let outcome = match self.state {
            State::Done => Outcome::Done(self.offset),
            State::Failed => self.failure,
            _ => return None,
        };
        self.state = State::Idle;
        let buffer = self.buffer.take()?;
        Some(Finished { ticket: Ticket(self.ticket), at: self.at, outcome, buffer })
    }

    #[inline]
    fn handle_data(&mut self, now: Duration, data: &[u8]) {
        // With our next request still to be sent, nothing but an abort of what was begun makes sense.
        let asked = self.tx.is_none() || (!self.is_beginning() && data.first() == Some(&ABORT));
        if !asked || matches!(self.state, State::Idle | State::Done | State::Failed) {
            return self.stray(data);
        }
        if matches!(self.state, State::BlockReceive) {
            return self.on_block_frame(now, data);
        }
        let response = match Response::parse(data) {
            Ok(response) => response,
            // Nothing says that damage belongs to this transfer while it begins.
            Err(_) if self.is_beginning() => return self.stray(data),
            Err(error) => return self.give_up(Fault::Message(error)),
        };
        match (response, self.state) {
            (Response::Abort { at, code }, _) => self.on_abort(at, code, data),
            (Response::InitiateUpload { at, content }, State::UploadBegun) if at == self.at => {
                self.on_upload_begun(content);
            }
            (Response::InitiateDownload { at }, State::DownloadBegun { sent }) if at == self.at => {
                self.on_download_begun(sent);
            }
            (Response::UploadSegment { toggle, last, data }, State::UploadSegment { toggle: expected }) => {
                self.on_upload_segment(expected, toggle, last, data);
            }
            (
                Response::DownloadSegment { toggle },
                State::DownloadSegment { toggle: expected, sent, last },
            ) => {
                self.on_download_segment(expected, toggle, sent, last);
            }
            (Response::InitiateUpload { at, content }, State::BlockUploadBegun { threshold })
                if at == self.at =>
            {
                self.on_protocol_switch(content, threshold, data);
            }
            (Response::InitiateBlockUpload { at, crc, size }, State::BlockUploadBegun { .. })
                if at == self.at =>
            {
                self.on_block_upload_begun(crc, size);
            }
            (Response::EndBlockUpload { unused, crc }, State::BlockUploadEnd) => {
                self.on_block_upload_end(unused, crc);
            }
            (
                Response::InitiateBlockDownload { at, crc, block_size },
                State::BlockDownloadBegun { crc: offered },
            ) if at == self.at => self.on_block_download_begun(offered, crc, block_size),
            (Response::AckBlockDownload { sequence, block_size }, State::BlockSend | State::BlockConfirm) => {
                self.on_block_confirmed(sequence, block_size);
            }
            (Response::EndBlockDownload, State::BlockDownloadEnd) => {
                self.unsettled = self.sender.repeated;
                self.done();
            }
            _ if self.is_beginning() => self.stray(data),
            _ => self.give_up(Fault::Unexpected { command: data.first().copied().unwrap_or(0) }),
        }
    }

    /// An abort of another object is late while ours begins; later on, devices that abort without
    /// naming the object (0000h:00) are understood.
    fn on_abort(&mut self, at: Address, code: AbortCode, data: &[u8]) {
        let unnamed = at == UNNAMED && !self.is_beginning();
        if at == self.at || unnamed {
            self.fail(Outcome::Aborted(code));
        } else {
            self.stray(data);
        }
    }

    const fn is_beginning(&self) -> bool {
        matches!(
            self.state,
            State::UploadBegun
                | State::DownloadBegun { .. }
                | State::BlockUploadBegun { .. }
                | State::BlockDownloadBegun { .. }
        )
    }

    /// Whether the request that is ready to go waits for an old answer.
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    fn held_back_until(&self) -> Option<Duration> {
        let outstanding = self.outstanding?;
        let upload = match self.state {
            State::UploadBegun | State::BlockUploadBegun { .. } => true,
            State::DownloadBegun { .. } | State::BlockDownloadBegun { .. } => false,
            _ => return None,
        };
        let mine = |at| outstanding.upload == upload && at == self.at;
        outstanding.at.is_none_or(mine).then_some(outstanding.until)
    }

    /// A first answer may come too late from now on.
    fn expect_late(&mut self, until: Option<Duration>) {
        if let Some(until) = until.filter(|_| self.is_beginning() && self.tx.is_none()) {
            let upload = matches!(self.state, State::UploadBegun | State::BlockUploadBegun { .. });
            self.outstanding = Some(Outstanding { upload, at: Some(self.at), until });
        }
    }

    #[cold]
    fn stray(&mut self, data: &[u8]) {
        self.strays = self.strays.saturating_add(1);
        let Some(outstanding) = self.outstanding else { return };
        let answers = match Response::parse(data) {
            Ok(Response::InitiateUpload { at, .. } | Response::InitiateBlockUpload { at, .. }) => {
                outstanding.upload && Some(at) == outstanding.at
            }
            Ok(Response::InitiateDownload { at } | Response::InitiateBlockDownload { at, .. }) => {
                !outstanding.upload && Some(at) == outstanding.at
            }
            Ok(Response::Abort { at, .. }) => Some(at) == outstanding.at,
            _ => false,
        };
        if answers {
            self.outstanding = None;
        }
    }

    #[inline]
    fn send(&mut self, request: Request) {
        self.tx = Some(request.encode());
        self.deadline = None;
    }

    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    fn done(&mut self) {
        self.tx = None;
        self.deadline = None;
        self.state = State::Done;
    }

    #[cold]
    fn fail(&mut self, outcome: Outcome) {
        self.unsettled |= !self.is_beginning();
        self.done();
        self.state = State::Failed;
        self.failure = outcome;
    }

    fn send_abort(&mut self, code: AbortCode) {
        self.parting = Some(Request::Abort { at: self.at, code }.encode());
    }

    #[cold]
    fn give_up(&mut self, fault: Fault) {
        self.fail(Outcome::GaveUp(fault));
        self.send_abort(fault.abort_code());
    }
}
