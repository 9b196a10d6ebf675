//! Block transfers (CiA 301, 7.2.4.2.10…15).

use core::time::Duration;

use pdo::Frame;

use super::super::Buffer;
use super::super::block::{Confirmed, MAX_BLOCK_SIZE, Receiver, STALLS, Sender, is_block_size};
use super::super::message::{ABORT, BlockSegment, Content, Request, Response, SEGMENT};
use super::segmented::next_piece;
use super::{Client, Fault, State};
use crate::clock::after;

/// How a block transfer is carried out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Block {
    /// Segments per sub-block that an upload asks for, 1…127; another number becomes 127.
    pub block_size: u8,
    /// Offer a CRC. Without one, only the numbers of the segments are checked.
    pub crc: bool,
    /// Protocol switch threshold: up to so many bytes go expedited or in segments. In an upload the
    /// server decides, and one without blocks that answers so above it is understood; 0 forbids it.
    pub threshold: u8,
}

impl Default for Block {
    /// 127 segments, CRC, and a threshold of 21 bytes, up to which segments take fewer frames.
    fn default() -> Self {
        Self { block_size: MAX_BLOCK_SIZE, crc: true, threshold: 21 }
    }
}

impl<B: Buffer> Client<B> {
    pub(super) fn begin_block_upload(&mut self, block: &Block) -> Request {
        let Block { block_size, crc, threshold } = *block;
        let block_size = if is_block_size(block_size) { block_size } else { MAX_BLOCK_SIZE };
        self.receiver = Receiver::new(block_size, crc);
        self.held = None;
        self.state = State::BlockUploadBegun { threshold };
        Request::InitiateBlockUpload { at: self.at, crc, block_size, threshold }
    }

    /// The server answers without blocks. One that has none does so above the threshold, too; the data
    /// are as good, so only a caller who wants blocks and nothing else refuses them.
    pub(super) fn on_protocol_switch(&mut self, content: Content, threshold: u8, data: &[u8]) {
        if threshold == 0 {
            return self.give_up(Fault::Unexpected { command: data.first().copied().unwrap_or(0) });
        }
        self.on_upload_begun(content);
    }

    pub(super) fn on_block_upload_begun(&mut self, crc: bool, size: Option<u32>) {
        self.size = size;
        self.receiver.check &= crc;
        if self.with_buffer(|buffer| buffer.begin(size)).is_some() {
            self.state = State::BlockReceive;
            self.send(Request::StartBlockUpload);
        }
    }

    /// Any frame while a sub-block comes in.
    #[inline]
    pub(super) fn on_block_frame(&mut self, now: Duration, data: &[u8]) {
        let Some(segment) = BlockSegment::parse(data) else {
            return match Response::parse(data) {
                Ok(Response::Abort { at, code }) if data.first() == Some(&ABORT) => {
                    self.on_abort(at, code, data);
                }
                _ => self.give_up(Fault::Unexpected { command: data.first().copied().unwrap_or(0) }),
            };
        };
        let (next, over) = self.receiver.segment(segment.sequence, segment.last);
        if next {
            if !self.take_held(0) {
                return;
            }
            self.held = Some(segment.data);
        }
        if over {
            self.confirm_block();
        } else {
            // Half the time, so that what the silence cut off can still be asked for.
            self.deadline = Some(after(now, self.timeout / 2));
        }
    }

    /// Whether a silence was answered by asking for what was lost.
    pub(super) fn ask_again(&mut self) -> bool {
        let again = matches!(self.state, State::BlockReceive) && self.receiver.is_cut_short();
        if again {
            self.confirm_block();
        }
        again
    }

    fn confirm_block(&mut self) {
        let Some(sequence) = self.receiver.confirm() else {
            return self.give_up(Fault::NoProgress(STALLS));
        };
        if self.receiver.ended {
            self.state = State::BlockUploadEnd;
        }
        self.send(Request::AckBlockUpload { sequence, block_size: self.receiver.block_size() });
    }

    /// Stores the segment that was held until it was known whether all its bytes count.
    #[inline]
    fn take_held(&mut self, unused: u8) -> bool {
        let Some(held) = self.held.take() else { return true };
        let bytes = held.get(..SEGMENT.saturating_sub(usize::from(unused))).unwrap_or(&[]);
        self.receiver.update(bytes);
        self.take(bytes)
    }

    pub(super) fn on_block_upload_end(&mut self, unused: u8, found: u16) {
        if !self.take_held(unused) {
            return;
        }
        let computed = self.receiver.crc.0;
        if self.receiver.check && computed != found {
            return self.give_up(Fault::Crc { computed, found });
        }
        self.finish_upload();
        if matches!(self.state, State::Done) {
            self.unsettled = self.receiver.disordered;
            self.parting = Some(Request::EndBlockUpload.encode());
        }
    }

    pub(super) fn on_block_download_begun(&mut self, offered: bool, crc: bool, block_size: u8) {
        if !is_block_size(block_size) {
            return self.give_up(Fault::BlockSize(block_size));
        }
        self.sender = Sender::new(block_size);
        self.check = offered && crc;
        self.deadline = None;
        self.state = State::BlockSend;
    }

    /// The next segment of the sub-block.
    #[inline]
    pub(super) fn next_block_segment(&mut self, now: Duration) -> Option<Frame> {
        let (offset, size) = (self.offset.saturating_add(self.sender.offset()), self.size);
        let (data, len, last) = self.with_buffer(|buffer| next_piece(buffer, offset, size))?;
        let sequence = self.sender.push(offset, data.get(..usize::from(len)).unwrap_or(&[]), last);
        if self.sender.is_done() {
            self.state = State::BlockConfirm;
            self.deadline = Some(after(now, self.timeout));
        }
        Some(Frame::standard(self.channel.request, BlockSegment { sequence, last, data }.encode()))
    }

    pub(super) fn on_block_confirmed(&mut self, sequence: u8, block_size: u8) {
        match self.sender.confirm(sequence, block_size) {
            Confirmed::All(bytes) => {
                self.offset = self.offset.saturating_add(bytes);
                let (unused, crc) = self.sender.end();
                self.state = State::BlockDownloadEnd;
                self.send(Request::EndBlockDownload { unused, crc: if self.check { crc } else { 0 } });
            }
            Confirmed::Bytes(_) if !is_block_size(block_size) => self.give_up(Fault::BlockSize(block_size)),
            Confirmed::Bytes(bytes) => {
                self.offset = self.offset.saturating_add(bytes);
                self.deadline = None;
                self.state = State::BlockSend;
            }
            Confirmed::TooMany(sent) => self.give_up(Fault::Sequence { sent, found: sequence }),
            Confirmed::Stalled => self.give_up(Fault::NoProgress(STALLS)),
        }
    }
}
