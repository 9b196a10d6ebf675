//! Expedited and segmented transfers (CiA 301, 7.2.4.2.2, 7.2.4.2.9).

use super::super::AbortCode;
use super::super::message::{Bytes, Content, Response, SEGMENT, first, segment};
use super::{Access, Answer, Piece, Server, State};

/// What is read and written in one piece.
const WHOLE: usize = 8;

impl Server {
    /// Reads the beginning of the object, all of it if it is short.
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    pub(super) fn load(&mut self, objects: &mut impl Access) -> Result<[u8; WHOLE], AbortCode> {
        let mut first = [0; WHOLE];
        let (len, total) = objects.read(self.at, 0, &mut first)?;
        // Less than there was room for is all there is.
        self.size = total.or((len < WHOLE).then_some(len as u32));
        if let Some(size) = self.size.filter(|&size| size <= WHOLE as u32) {
            if len != size as usize {
                return Err(AbortCode::NO_DATA);
            }
            if let Some(held) = self.held.first_chunk_mut() {
                *held = first;
            }
            self.held_len = size as u8;
        }
        Ok(first)
    }

    /// Whether the object of an upload was short enough to be read as a whole.
    #[inline]
    pub(super) const fn is_held(&self) -> bool {
        matches!(self.size, Some(size) if size <= WHOLE as u32)
    }

    /// The answer that begins an upload of an object whose `first` bytes were loaded: the object itself
    /// if it is short.
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    pub(super) fn answer_upload(&mut self, first: [u8; WHOLE]) -> Answer {
        let content = match self.size {
            Some(size @ 1..=4) => {
                let data = Bytes::of_word(u64::from_le_bytes(first), size as usize);
                Content::Expedited { data, sized: true }
            }
            size => {
                self.state = State::Upload { toggle: false };
                Content::Segmented(size)
            }
        };
        Response::InitiateUpload { at: self.at, content }.encode()
    }

    #[inline]
    pub(super) fn upload_segment(
        &mut self,
        expected: bool,
        toggle: bool,
        objects: &mut impl Access,
    ) -> Result<Answer, AbortCode> {
        if toggle != expected {
            return Err(AbortCode::TOGGLE);
        }
        let (data, len, last) = self.next_piece(self.offset, objects)?;
        self.offset = self.offset.saturating_add(u32::from(len));
        self.state = if last { State::Idle } else { State::Upload { toggle: !toggle } };
        Ok(Response::UploadSegment { toggle, last, data: segment(data, len) }.encode())
    }

    /// The next piece to upload: up to 7 bytes, their number, and whether no more follow.
    #[inline]
    pub(super) fn next_piece(
        &mut self,
        offset: u32,
        objects: &mut impl Access,
    ) -> Result<([u8; SEGMENT], u8, bool), AbortCode> {
        let mut data = [0; SEGMENT];
        if let Some(size) = self.size {
            let rest = size.saturating_sub(offset);
            let last = rest <= SEGMENT as u32;
            let wanted = data.get_mut(..rest.min(SEGMENT as u32) as usize).unwrap_or_default();
            let len = if self.is_held() {
                super::super::buffer::copy_from(self.held(), offset, wanted)
            } else {
                objects.read(self.at, offset, wanted)?.0
            };
            if len != wanted.len() {
                return Err(AbortCode::NO_DATA);
            }
            return Ok((data, len as u8, last));
        }
        // One byte more than fits tells whether this is the end.
        let mut ahead = [0; SEGMENT + 1];
        let (len, _) = objects.read(self.at, offset, &mut ahead)?;
        let [first @ .., _] = ahead;
        Ok((first, len.min(SEGMENT) as u8, len <= SEGMENT))
    }

    #[inline]
    pub(super) fn begin_download(
        &mut self,
        content: Content,
        objects: &mut impl Access,
    ) -> Result<Answer, AbortCode> {
        let at = self.at;
        match content {
            Content::Expedited { data, sized } => {
                let padded = data.padded();
                let data = first(&padded, data.len());
                let size = sized.then_some(data.len() as u32);
                objects.write(at, &Piece { offset: 0, data, last: true, size })?;
            }
            Content::Segmented(size) => {
                objects.begin_write(at, size)?;
                self.size = size;
                self.state = State::Download { toggle: false };
            }
        }
        Ok(Response::InitiateDownload { at }.encode())
    }

    #[inline]
    pub(super) fn download_segment(
        &mut self,
        expected: bool,
        toggle: bool,
        last: bool,
        data: &[u8],
        objects: &mut impl Access,
    ) -> Result<Answer, AbortCode> {
        if toggle != expected {
            return Err(AbortCode::TOGGLE);
        }
        self.check_size(data.len(), last)?;
        if self.offset == 0 && usize::from(self.held_len) + data.len() <= WHOLE {
            self.hold(data);
            if last {
                self.flush(true, objects)?;
            }
        } else {
            self.flush(false, objects)?;
            self.give(data, last, objects)?;
        }
        self.state = if last { State::Idle } else { State::Download { toggle: !toggle } };
        Ok(Response::DownloadSegment { toggle }.encode())
    }

    /// Whether `more` bytes are as many as the client has indicated.
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    pub(super) fn check_size(&self, more: usize, last: bool) -> Result<(), AbortCode> {
        let Some(size) = self.size else { return Ok(()) };
        let found = u64::from(self.offset) + u64::from(self.held_len) + more as u64;
        match found.cmp(&u64::from(size)) {
            core::cmp::Ordering::Greater => Err(AbortCode::TOO_LONG),
            core::cmp::Ordering::Less if last => Err(AbortCode::TOO_SHORT),
            _ => Ok(()),
        }
    }

    #[inline]
    pub(super) fn held(&self) -> &[u8] {
        self.held.get(..usize::from(self.held_len)).unwrap_or(&[])
    }

    /// Keeps bytes for later; the caller has made sure that there is room.
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    pub(super) fn hold(&mut self, data: &[u8]) {
        let from = usize::from(self.held_len);
        if let Some(room) = self.held.get_mut(from..from + data.len()) {
            room.copy_from_slice(data);
            self.held_len += data.len() as u8;
        }
    }

    /// Gives the objects what was held.
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    pub(super) fn flush(&mut self, last: bool, objects: &mut impl Access) -> Result<(), AbortCode> {
        let len = core::mem::take(&mut self.held_len);
        if len == 0 && !last {
            return Ok(());
        }
        let held = self.held;
        self.give(held.get(..usize::from(len)).unwrap_or(&[]), last, objects)
    }

    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    fn give(&mut self, data: &[u8], last: bool, objects: &mut impl Access) -> Result<(), AbortCode> {
        let offset = self.offset;
        // More than 4 GiB have no size that the protocol could indicate.
        self.offset = offset.checked_add(data.len() as u32).ok_or(AbortCode::OUT_OF_MEMORY)?;
        // With the last piece, the size is known; only an expedited download leaves it open.
        let size = if last { Some(self.offset) } else { self.size };
        objects.write(self.at, &Piece { offset, data, last, size })
    }
}
