//! Block transfers (CiA 301, 7.2.4.2.10…15).

use core::time::Duration;

use pdo::Frame;

use super::super::AbortCode;
use super::super::block::{Confirmed, Receiver, Sender, is_block_size};
use super::super::message::{ABORT, BlockSegment, Response, SEGMENT};
use super::{Access, Answer, Server, State};
use crate::clock::after;

impl Server {
    #[inline(never)]
    pub(super) fn begin_block_download(
        &mut self,
        crc: bool,
        size: Option<u32>,
        objects: &mut impl Access,
    ) -> Result<Answer, AbortCode> {
        objects.begin_write(self.at, size)?;
        self.size = size;
        self.receiver = Receiver::new(self.block_size, crc);
        self.state = State::BlockReceive;
        Ok(Response::InitiateBlockDownload { at: self.at, crc: true, block_size: self.block_size }.encode())
    }

    /// Any frame while a sub-block comes in.
    #[inline]
    pub(super) fn on_block_frame(&mut self, now: Duration, data: &[u8], objects: &mut impl Access) {
        let Some(segment) = BlockSegment::parse(data) else {
            if data.first() == Some(&ABORT) {
                return self.replace(objects);
            }
            return self.abort(AbortCode::COMMAND, objects);
        };
        let (next, over) = self.receiver.segment(segment.sequence, segment.last);
        if next && let Err(code) = self.take_segment(&segment.data, objects) {
            return self.abort(code, objects);
        }
        if over {
            self.confirm_block(now, objects);
        } else {
            // Half the time, so that what the silence cut off can still be asked for.
            self.deadline = Some(after(now, self.timeout / 2));
        }
    }

    /// Keeps the last segment, whose length is not known yet, and the first two together, so that up to
    /// 8 bytes stay in one piece.
    #[inline]
    fn take_segment(&mut self, data: &[u8; SEGMENT], objects: &mut impl Access) -> Result<(), AbortCode> {
        // Of the last segment, up to 7 bytes may not count.
        let held = usize::from(self.held_len);
        self.check_size(0, false)?;
        if held > SEGMENT || (held > 0 && self.offset > 0) {
            self.receiver.update(self.held.get(..held).unwrap_or(&[]));
            self.flush(false, objects)?;
        }
        self.hold(data);
        Ok(())
    }

    /// Whether a silence was answered by asking for what was lost.
    pub(super) fn ask_again(&mut self, now: Duration, objects: &mut impl Access) -> bool {
        let again = matches!(self.state, State::BlockReceive) && self.receiver.is_cut_short();
        if again {
            self.confirm_block(now, objects);
        }
        again
    }

    fn confirm_block(&mut self, now: Duration, objects: &mut impl Access) {
        let Some(sequence) = self.receiver.confirm() else {
            return self.abort(AbortCode::SEQUENCE, objects);
        };
        if self.receiver.ended {
            self.state = State::BlockDownloadEnd;
        }
        self.tx = Some(Response::AckBlockDownload { sequence, block_size: self.block_size }.encode());
        self.deadline = Some(after(now, self.timeout));
    }

    pub(super) fn end_block_download(
        &mut self,
        unused: u8,
        crc: u16,
        objects: &mut impl Access,
    ) -> Result<Answer, AbortCode> {
        self.held_len = self.held_len.saturating_sub(unused);
        self.check_size(0, true)?;
        let held = self.held;
        self.receiver.update(held.get(..usize::from(self.held_len)).unwrap_or(&[]));
        if self.receiver.check && self.receiver.crc.0 != crc {
            return Err(AbortCode::CRC);
        }
        self.flush(true, objects)?;
        self.state = State::Idle;
        Ok(Response::EndBlockDownload.encode())
    }

    #[inline(never)]
    pub(super) fn begin_block_upload(
        &mut self,
        crc: bool,
        block_size: u8,
        threshold: u8,
        objects: &mut impl Access,
    ) -> Result<Answer, AbortCode> {
        if !is_block_size(block_size) {
            return Err(AbortCode::BLOCK_SIZE);
        }
        let first = self.load(objects)?;
        if self.size.is_some_and(|size| threshold > 0 && size <= u32::from(threshold)) {
            return Ok(self.answer_upload(first));
        }
        self.sender = Sender::new(block_size);
        self.check = crc;
        self.state = State::BlockUploadBegun;
        // Without the client's CRC there is none; some clients check one all the same if we claim ours.
        Ok(Response::InitiateBlockUpload { at: self.at, crc, size: self.size }.encode())
    }

    /// The next segment of the sub-block.
    #[inline]
    pub(super) fn next_block_segment(&mut self, now: Duration, objects: &mut impl Access) -> Option<Frame> {
        let offset = self.offset.saturating_add(self.sender.offset());
        let (data, len, last) = match self.next_piece(offset, objects) {
            Ok(piece) => piece,
            Err(code) => {
                self.abort(code, objects);
                return self.tx.take().map(|tx| Frame::standard(self.channel.response, tx));
            }
        };
        let sequence = self.sender.push(offset, data.get(..usize::from(len)).unwrap_or(&[]), last);
        if self.sender.is_done() {
            self.state = State::BlockConfirm;
            self.deadline = Some(after(now, self.timeout));
        }
        Some(Frame::standard(self.channel.response, BlockSegment { sequence, last, data }.encode()))
    }

    /// The answer, if there is one to give before more segments.
    pub(super) fn on_block_confirmed(
        &mut self,
        sequence: u8,
        block_size: u8,
    ) -> Result<Option<Answer>, AbortCode> {
        match self.sender.confirm(sequence, block_size) {
            Confirmed::All(_) => {
                let (unused, crc) = self.sender.end();
                self.state = State::BlockUploadEnd;
                let crc = if self.check { crc } else { 0 };
                Ok(Some(Response::EndBlockUpload { unused, crc }.encode()))
            }
            Confirmed::Bytes(_) if !is_block_size(block_size) => Err(AbortCode::BLOCK_SIZE),
            Confirmed::Bytes(bytes) => {
                self.offset = self.offset.saturating_add(bytes);
                self.state = State::BlockSend;
                Ok(None)
            }
            Confirmed::TooMany(_) | Confirmed::Stalled => Err(AbortCode::SEQUENCE),
        }
    }
}
