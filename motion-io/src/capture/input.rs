//! A source read in blocks: lines and chunks are borrowed from the block.

use core::ops::Range;
use std::io::{self, Read};

/// Room for reading; a block is read at once.
const BLOCK: usize = 256 * 1024;
/// Longest line that is looked at; a longer one is damaged.
pub(super) const MAX_LINE: usize = 64 * 1024;

pub(super) struct Input<R> {
    source: R,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    at_end: bool,
}

impl<R> core::fmt::Debug for Input<R> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Input").field("held", &(self.end - self.start)).finish_non_exhaustive()
    }
}

/// A line, by its place in the block.
pub(super) enum Line {
    /// Without line end.
    Whole(Range<usize>),
    /// Longer than [`MAX_LINE`], and skipped.
    TooLong,
}

impl<R: Read> Input<R> {
    pub(super) fn new(source: R) -> Self {
        Self { source, buffer: vec![0; BLOCK], start: 0, end: 0, at_end: false }
    }

    /// Reads on; `false` at the end of the source or with a full block.
    fn fill(&mut self) -> io::Result<bool> {
        if self.at_end {
            return Ok(false);
        }
        if self.start > 0 && (self.start == self.end || self.buffer.len() - self.end < BLOCK / 4) {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        if self.end == self.buffer.len() {
            return Ok(false);
        }
        loop {
            match self.source.read(&mut self.buffer[self.end..]) {
                Ok(0) => {
                    self.at_end = true;
                    return Ok(false);
                }
                Ok(count) => {
                    self.end += count;
                    return Ok(true);
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Up to `len` bytes from here without taking them; fewer only at the end of the source.
    pub(super) fn peek(&mut self, len: usize) -> io::Result<&[u8]> {
        while self.end - self.start < len && self.fill()? {}
        Ok(self.held(self.start..self.end.min(self.start + len)))
    }

    /// What has been read and not been taken.
    #[inline]
    pub(super) fn at_hand(&self) -> &[u8] {
        self.held(self.start..self.end)
    }

    /// Takes `len` bytes that have been shown.
    #[inline]
    pub(super) fn take(&mut self, len: usize) {
        self.start = self.end.min(self.start + len);
    }

    /// Skips `len` bytes; `false` where the source ends before.
    pub(super) fn skip(&mut self, mut len: u64) -> io::Result<bool> {
        loop {
            let now = len.min((self.end - self.start) as u64);
            self.start += now as usize;
            len -= now;
            if len == 0 {
                return Ok(true);
            }
            if !self.fill()? {
                return Ok(false);
            }
        }
    }

    /// Whatever is at hand, at least one byte unless the source has ended.
    pub(super) fn chunk(&mut self) -> io::Result<Range<usize>> {
        if self.start == self.end {
            self.fill()?;
        }
        let range = self.start..self.end;
        self.start = self.end;
        Ok(range)
    }

    /// The next line, its end taken.
    #[inline]
    pub(super) fn line(&mut self) -> io::Result<Option<Line>> {
        let mut searched = 0;
        loop {
            let held = &self.buffer[self.start + searched..self.end];
            if let Some(at) = memchr::memchr(b'\n', held) {
                let from = self.start;
                let to = from + searched + at;
                self.start = to + 1;
                let range = from..to - usize::from(to > from && self.buffer[to - 1] == b'\r');
                return Ok(Some(if range.len() > MAX_LINE { Line::TooLong } else { Line::Whole(range) }));
            }
            searched = self.end - self.start;
            if searched > MAX_LINE {
                return self.skip_line().map(Some);
            }
            if !self.fill()? {
                let range = self.start..self.end;
                self.start = self.end;
                return Ok((!range.is_empty()).then_some(Line::Whole(range)));
            }
        }
    }

    /// Skips the rest of a line that is too long.
    fn skip_line(&mut self) -> io::Result<Line> {
        loop {
            let held = self.buffer.get(self.start..self.end).unwrap_or(&[]);
            if let Some(at) = memchr::memchr(b'\n', held) {
                self.start += at + 1;
                return Ok(Line::TooLong);
            }
            self.start = self.end;
            if !self.fill()? {
                return Ok(Line::TooLong);
            }
        }
    }

    /// Bytes of a range that this input gave, valid until it is asked for more.
    #[inline]
    pub(super) fn held(&self, range: Range<usize>) -> &[u8] {
        self.buffer.get(range).unwrap_or(&[])
    }
}
