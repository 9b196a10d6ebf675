//! Expedited and segmented transfers (CiA 301, 7.2.4.2.2, 7.2.4.2.9).

use super::super::message::{Bytes, Content, Request, SEGMENT, first, segment};
use super::super::{AbortCode, Buffer};
use super::{Block, Client, Fault, Opening, Options, State};

/// How a download begins: in blocks above their threshold, else with the data if they are few.
#[inline]
pub(super) fn open_download(buffer: &mut impl Buffer, options: &Options) -> Result<Opening, AbortCode> {
    let size = buffer.size();
    let blocks = |block: &&Block| size.is_none_or(|size| size > u32::from(block.threshold));
    if let Some(block) = options.block.as_ref().filter(blocks) {
        return Ok(Opening::BlockDownload { crc: block.crc, size });
    }
    let Some(size @ 1..=4) = size else {
        return Ok(Opening::Download(Content::Segmented(size)));
    };
    let mut data = [0; 4];
    let out = data.get_mut(..size as usize).unwrap_or_default();
    if buffer.read(0, out)? != out.len() {
        return Err(AbortCode::NO_DATA);
    }
    let data = Bytes::new(out).unwrap_or(Bytes::EMPTY);
    Ok(Opening::Download(Content::Expedited { data, sized: true }))
}

/// The next piece to download: up to 7 bytes, their number, and whether no more follow.
#[inline]
pub(super) fn next_piece(
    buffer: &mut impl Buffer,
    offset: u32,
    size: Option<u32>,
) -> Result<([u8; SEGMENT], u8, bool), AbortCode> {
    let mut data = [0; SEGMENT];
    if let Some(size) = size {
        let rest = size.saturating_sub(offset);
        let last = rest <= SEGMENT as u32;
        let wanted = data.get_mut(..rest.min(SEGMENT as u32) as usize).unwrap_or_default();
        let len = wanted.len();
        if buffer.read(offset, wanted)? != len {
            return Err(AbortCode::NO_DATA);
        }
        return Ok((data, len as u8, last));
    }
    // One byte more than fits tells whether this is the end.
    let mut ahead = [0; SEGMENT + 1];
    let len = buffer.read(offset, &mut ahead)?;
    let [first @ .., _] = ahead;
    Ok((first, len.min(SEGMENT) as u8, len <= SEGMENT))
}

impl<B: Buffer> Client<B> {
    #[inline]
    pub(super) fn on_upload_begun(&mut self, content: Content) {
        match content {
            Content::Expedited { data, .. } => self.take_all(first(&data.padded(), data.len())),
            Content::Segmented(size) => {
                self.size = size;
                if self.with_buffer(|buffer| buffer.begin(size)).is_none() {
                    return;
                }
                self.state = State::UploadSegment { toggle: false };
                self.send(Request::UploadSegment { toggle: false });
            }
        }
    }

    #[inline]
    fn take_all(&mut self, bytes: &[u8]) {
        let size = bytes.len() as u32;
        if self.with_buffer(|buffer| buffer.begin(Some(size)).and_then(|()| buffer.write(0, bytes))).is_some()
        {
            self.offset = size;
            self.done();
        }
    }

    #[inline]
    pub(super) fn on_upload_segment(
        &mut self,
        expected: bool,
        toggle: bool,
        last: bool,
        data: Bytes<SEGMENT>,
    ) {
        if toggle != expected {
            return self.give_up(Fault::Toggle);
        }
        // A server may end with nothing; one that goes on with nothing would never end.
        if data.is_empty() && !last {
            return self.give_up(Fault::EmptySegment);
        }
        if !self.take(first(&data.padded(), data.len())) {
            return;
        }
        if last {
            return self.finish_upload();
        }
        self.state = State::UploadSegment { toggle: !toggle };
        self.send(Request::UploadSegment { toggle: !toggle });
    }

    /// Stores uploaded bytes; `false` if that ended the transfer.
    #[inline]
    pub(super) fn take(&mut self, bytes: &[u8]) -> bool {
        let offset = self.offset;
        let Some(found) = offset.checked_add(bytes.len() as u32) else {
            self.give_up(Fault::Buffer(AbortCode::OUT_OF_MEMORY));
            return false;
        };
        if let Some(indicated) = self.size.filter(|&size| found > size) {
            self.give_up(Fault::Size { indicated, found });
            return false;
        }
        if self.with_buffer(|buffer| buffer.write(offset, bytes)).is_none() {
            return false;
        }
        self.offset = found;
        true
    }

    #[inline]
    pub(super) fn finish_upload(&mut self) {
        let found = self.offset;
        match self.size {
            Some(indicated) if indicated != found => self.give_up(Fault::Size { indicated, found }),
            _ => self.done(),
        }
    }

    #[inline]
    pub(super) fn on_download_begun(&mut self, sent: u8) {
        if sent > 0 {
            self.offset = u32::from(sent);
            return self.done();
        }
        self.send_segment(false);
    }

    #[inline]
    pub(super) fn on_download_segment(&mut self, expected: bool, toggle: bool, sent: u8, last: bool) {
        if toggle != expected {
            return self.give_up(Fault::Toggle);
        }
        self.offset = self.offset.saturating_add(u32::from(sent));
        if last {
            return self.done();
        }
        self.send_segment(!toggle);
    }

    #[inline]
    fn send_segment(&mut self, toggle: bool) {
        let (offset, size) = (self.offset, self.size);
        let Some((data, len, last)) = self.with_buffer(|buffer| next_piece(buffer, offset, size)) else {
            return;
        };
        let data = segment(data, len);
        self.state = State::DownloadSegment { toggle, sent: len, last };
        self.send(Request::DownloadSegment { toggle, last, data });
    }

    /// Works on the buffer; what it refuses ends the transfer.
    #[inline]
    pub(super) fn with_buffer<T>(&mut self, work: impl FnOnce(&mut B) -> Result<T, AbortCode>) -> Option<T> {
        let result = self.buffer.as_mut().map_or(Err(AbortCode::GENERAL), work);
        match result {
            Ok(value) => Some(value),
            Err(code) => {
                self.give_up(Fault::Buffer(code));
                None
            }
        }
    }
}
