//! The server: answers one client on one channel from an [`Access`].

mod access;
mod block;
mod segmented;

use core::time::Duration;

use pdo::{Frame, Handled};

use super::block::{MAX_BLOCK_SIZE, Receiver, Sender, is_block_size};
use super::message::{Request, Response, first};
use super::{AbortCode, Address, Channel, UNNAMED, data_on};
use crate::clock::{after, is_due};
pub use access::{Access, Piece, Total, read_slice};

/// Time that a client has for each next request, unless set (CiA 301 names none).
pub const NEXT_REQUEST: Duration = Duration::from_secs(1);

/// Bytes held between frames: what must not be torn (8), and the end of a block download whose
/// length is only known at last (14).
const HELD: usize = 14;

/// An encoded [`Response`].
type Answer = [u8; 8];

#[derive(Debug, Clone, Copy)]
enum State {
    Idle,
    /// A request for the next segment is awaited.
    Upload {
        toggle: bool,
    },
    /// The next segment is awaited.
    Download {
        toggle: bool,
    },
    /// Segments of a sub-block come in.
    BlockReceive,
    /// All segments have come; the client's last word is awaited.
    BlockDownloadEnd,
    /// The client is to say that it is ready.
    BlockUploadBegun,
    /// Segments of a sub-block are to be sent.
    BlockSend,
    /// A sub-block is to be confirmed.
    BlockConfirm,
    /// The end is to be confirmed.
    BlockUploadEnd,
}

/// An SDO server on one channel.
///
/// - Input: [`handle_frame`](Self::handle_frame), [`handle_timeout`](Self::handle_timeout),
///   [`reset`](Self::reset).
/// - Output: [`poll_transmit`](Self::poll_transmit), [`poll_timeout`](Self::poll_timeout).
/// - Getters: [`channel`](Self::channel), [`is_idle`](Self::is_idle).
///
/// Every method that may touch objects is given them by the caller. A new request to begin replaces the
/// transfer under way: its client has given it up, even if its abort was lost. An answer that was not
/// polled before the next request is replaced.
#[derive(Debug, Clone)]
pub struct Server {
    channel: Channel,
    timeout: Duration,
    state: State,
    at: Address,
    deadline: Option<Duration>,
    /// Bytes transferred; of a download, bytes given to the objects.
    offset: u32,
    size: Option<u32>,
    held: [u8; HELD],
    held_len: u8,
    tx: Option<[u8; 8]>,
    block_size: u8,
    sender: Sender,
    receiver: Receiver,
    /// Block upload: the client wants a CRC.
    check: bool,
}

impl Server {
    /// An idle server that gives a transfer up when the client is silent for `timeout`.
    #[must_use]
    pub const fn new(channel: Channel, timeout: Duration) -> Self {
        Self {
            channel,
            timeout,
            state: State::Idle,
            at: Address::new(0, 0),
            deadline: None,
            offset: 0,
            size: None,
            held: [0; HELD],
            held_len: 0,
            tx: None,
            block_size: MAX_BLOCK_SIZE,
            sender: Sender::EMPTY,
            receiver: Receiver::EMPTY,
            check: false,
        }
    }

    /// The same with so many segments per sub-block of a download, 1…127; another number becomes 127.
    /// Fewer suit a receiver that can miss frames.
    #[must_use]
    pub const fn with_block_size(mut self, block_size: u8) -> Self {
        self.block_size = if is_block_size(block_size) { block_size } else { MAX_BLOCK_SIZE };
        self
    }

    /// Its identifiers.
    #[must_use]
    pub const fn channel(&self) -> Channel {
        self.channel
    }

    /// Whether no transfer is under way.
    #[must_use]
    pub const fn is_idle(&self) -> bool {
        matches!(self.state, State::Idle)
    }

    /// Ends the transfer under way without a word, as a change of the NMT state does, and takes over
    /// other identifiers.
    pub fn reset(&mut self, channel: Channel, objects: &mut impl Access) {
        self.replace(objects);
        self.tx = None;
        self.channel = channel;
    }

    /// Takes a frame from the bus.
    #[inline]
    pub fn handle_frame(
        &mut self,
        now: Duration,
        frame: &impl embedded_can::Frame,
        objects: &mut impl Access,
    ) -> Handled {
        let Some(data) = data_on(self.channel.request, frame) else { return Handled::Ignored };
        self.handle_data(now, data, objects);
        Handled::Taken
    }

    /// Gives up a transfer whose client is silent; early calls do nothing.
    pub fn handle_timeout(&mut self, now: Duration, objects: &mut impl Access) {
        if is_due(self.deadline, now) && !self.ask_again(now, objects) {
            self.abort(AbortCode::TIMED_OUT, objects);
        }
    }

    /// When to call [`handle_timeout`](Self::handle_timeout); `None` = idle.
    #[must_use]
    #[inline]
    pub const fn poll_timeout(&self) -> Option<Duration> {
        self.deadline
    }

    /// The frame to send now, once.
    #[inline]
    pub fn poll_transmit(&mut self, now: Duration, objects: &mut impl Access) -> Option<Frame> {
        if let Some(tx) = self.tx.take() {
            return Some(Frame::standard(self.channel.response, tx));
        }
        if matches!(self.state, State::BlockSend) { self.next_block_segment(now, objects) } else { None }
    }

    #[inline]
    fn handle_data(&mut self, now: Duration, data: &[u8], objects: &mut impl Access) {
        if matches!(self.state, State::BlockReceive) {
            return self.on_block_frame(now, data, objects);
        }
        let request = match Request::parse(data) {
            Ok(request) => request,
            Err(_) => {
                self.name_nothing_if_idle();
                return self.abort(AbortCode::COMMAND, objects);
            }
        };
        let done = match (request, self.state) {
            (Request::InitiateUpload { at }, _) => {
                self.begin(at, objects);
                self.load(objects).map(|first| self.answer_upload(first))
            }
            (Request::InitiateDownload { at, content }, _) => {
                self.begin(at, objects);
                self.begin_download(content, objects)
            }
            (Request::UploadSegment { toggle }, State::Upload { toggle: expected }) => {
                self.upload_segment(expected, toggle, objects)
            }
            (Request::DownloadSegment { toggle, last, data }, State::Download { toggle: expected }) => {
                self.download_segment(expected, toggle, last, first(&data.padded(), data.len()), objects)
            }
            (Request::InitiateBlockUpload { at, crc, block_size, threshold }, _) => {
                self.begin(at, objects);
                self.begin_block_upload(crc, block_size, threshold, objects)
            }
            (Request::InitiateBlockDownload { at, crc, size }, _) => {
                self.begin(at, objects);
                self.begin_block_download(crc, size, objects)
            }
            (Request::EndBlockDownload { unused, crc }, State::BlockDownloadEnd) => {
                self.end_block_download(unused, crc, objects)
            }
            (Request::StartBlockUpload, State::BlockUploadBegun) => {
                self.state = State::BlockSend;
                self.deadline = None;
                return;
            }
            (Request::AckBlockUpload { sequence, block_size }, State::BlockSend | State::BlockConfirm) => {
                match self.on_block_confirmed(sequence, block_size) {
                    Ok(Some(response)) => Ok(response),
                    Ok(None) => {
                        self.deadline = None;
                        return;
                    }
                    Err(code) => Err(code),
                }
            }
            (Request::EndBlockUpload, State::BlockUploadEnd) => {
                self.state = State::Idle;
                self.deadline = None;
                return;
            }
            (Request::Abort { .. }, _) => return self.replace(objects),
            _ => {
                self.name_nothing_if_idle();
                Err(AbortCode::COMMAND)
            }
        };
        match done {
            Ok(response) => {
                self.tx = Some(response);
                self.deadline = (!self.is_idle()).then(|| after(now, self.timeout));
            }
            Err(code) => self.abort(code, objects),
        }
    }

    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    fn begin(&mut self, at: Address, objects: &mut impl Access) {
        if !self.is_idle() {
            self.replace(objects);
        }
        self.at = at;
        self.offset = 0;
        self.size = None;
        self.held_len = 0;
    }

    /// Leaves the transfer under way.
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    fn replace(&mut self, objects: &mut impl Access) {
        if matches!(self.state, State::Download { .. } | State::BlockReceive | State::BlockDownloadEnd) {
            objects.abandon(self.at);
        }
        self.state = State::Idle;
        self.deadline = None;
    }

    /// A frame out of place may be a repeated one of a transfer that is over: an abort that named its
    /// object could hit the next transfer.
    fn name_nothing_if_idle(&mut self) {
        if self.is_idle() {
            self.at = UNNAMED;
        }
    }

    #[cold]
    fn abort(&mut self, code: AbortCode, objects: &mut impl Access) {
        self.replace(objects);
        self.tx = Some(Response::Abort { at: self.at, code }.encode());
    }
}
