//! A message as one word: where its parts are (CiA 301, 7.2.4.3).

use pdo::Address;

use super::super::AbortCode;
use super::bytes::{Bytes, load};
use super::{Content, MessageError, SEGMENT};

/// Bits of the first byte.
pub(super) mod bit {
    pub(in super::super) const EXPEDITED: u8 = 1 << 1;
    pub(in super::super) const SIZED: u8 = 1;
    pub(in super::super) const TOGGLE: u8 = 1 << 4;
    pub(in super::super) const LAST: u8 = 1;
    pub(in super::super) const CRC: u8 = 1 << 2;
    pub(in super::super) const BLOCK_SIZED: u8 = 1 << 1;
}

/// The bytes of a frame as one word, zeros behind those there are.
#[derive(Clone, Copy)]
pub(super) struct Raw {
    word: u64,
    len: u8,
}

impl Raw {
    #[inline]
    pub(super) fn new(data: &[u8]) -> Self {
        if let Ok(&bytes) = <&[u8; 8]>::try_from(data) {
            return Self { word: u64::from_le_bytes(bytes), len: 8 };
        }
        let data = data.get(..8).unwrap_or(data);
        Self { word: load(data), len: data.len() as u8 }
    }

    #[inline]
    pub(super) const fn command(&self) -> u8 {
        self.word as u8
    }

    #[inline]
    pub(super) const fn byte(&self, at: u32) -> u8 {
        (self.word >> (8 * at)) as u8
    }

    #[inline]
    pub(super) const fn need(&self, expected: u8) -> Result<(), MessageError> {
        if self.len < expected {
            return Err(MessageError::Short { command: self.command(), expected, found: self.len });
        }
        Ok(())
    }

    #[inline]
    pub(super) fn address(&self) -> Result<Address, MessageError> {
        self.need(4)?;
        Ok(Address::new((self.word >> 8) as u16, self.byte(3)))
    }

    /// The last 4 bytes.
    #[inline]
    pub(super) const fn tail(&self) -> u32 {
        (self.word >> 32) as u32
    }

    #[inline]
    pub(super) fn content(&self) -> Result<Content, MessageError> {
        let command = self.command();
        let sized = command & bit::SIZED != 0;
        if command & bit::EXPEDITED != 0 {
            let len = if sized { 4 - (command >> 2 & 3) } else { 4 };
            self.need(if sized { 4 + len } else { 5 })?;
            return Ok(Content::Expedited { data: Bytes::of_word(self.word >> 32, len.into()), sized });
        }
        if !sized {
            return Ok(Content::Segmented(None));
        }
        self.need(8)?;
        Ok(Content::Segmented(Some(self.tail())))
    }

    #[inline]
    pub(super) fn segment(&self) -> Result<Bytes<SEGMENT>, MessageError> {
        let len = SEGMENT as u8 - (self.command() >> 1 & 7);
        self.need(1 + len)?;
        Ok(Bytes::of_word(self.word >> 8, len.into()))
    }

    #[inline]
    pub(super) fn abort(&self) -> Result<(Address, AbortCode), MessageError> {
        self.need(8)?;
        Ok((self.address()?, AbortCode(self.tail())))
    }

    #[inline]
    pub(super) fn block_size(&self) -> Result<Option<u32>, MessageError> {
        if self.command() & bit::BLOCK_SIZED == 0 {
            return Ok(None);
        }
        self.need(8)?;
        Ok(Some(self.tail()))
    }

    #[inline]
    pub(super) fn end(&self) -> Result<(u8, u16), MessageError> {
        self.need(3)?;
        Ok((self.command() >> 2 & 7, (self.word >> 8) as u16))
    }
}

#[inline]
pub(super) const fn with_address(command: u8, at: Address, tail: u32) -> u64 {
    command as u64 | (at.index as u64) << 8 | (at.sub as u64) << 24 | (tail as u64) << 32
}

#[inline]
pub(super) const fn with_content(command: u8, at: Address, content: &Content) -> u64 {
    match content {
        Content::Expedited { data, sized } => {
            let size = if *sized { data.unused() << 2 | bit::SIZED } else { 0 };
            with_address(command | bit::EXPEDITED | size, at, data.word as u32)
        }
        Content::Segmented(Some(size)) => with_address(command | bit::SIZED, at, *size),
        Content::Segmented(None) => with_address(command, at, 0),
    }
}

#[inline]
pub(super) const fn with_segment(command: u8, toggle: bool, last: bool, bytes: &Bytes<SEGMENT>) -> u64 {
    let command = command | toggle_bit(toggle) | bytes.unused() << 1 | last as u8;
    command as u64 | bytes.word << 8
}

#[inline]
pub(super) const fn with_block_size(command: u8, crc: bool, at: Address, size: Option<u32>) -> u64 {
    let command = command | crc_bit(crc);
    match size {
        Some(size) => with_address(command | bit::BLOCK_SIZED, at, size),
        None => with_address(command, at, 0),
    }
}

#[inline]
pub(super) const fn toggle_bit(toggle: bool) -> u8 {
    if toggle { bit::TOGGLE } else { 0 }
}

#[inline]
pub(super) const fn crc_bit(crc: bool) -> u8 {
    if crc { bit::CRC } else { 0 }
}

#[inline]
pub(super) const fn with_end(command: u8, unused: u8, crc: u16) -> u64 {
    (command | (unused & 7) << 2) as u64 | (crc as u64) << 8
}

#[inline]
pub(super) const fn with_confirmation(command: u8, sequence: u8, block_size: u8) -> u64 {
    command as u64 | (sequence as u64) << 8 | (block_size as u64) << 16
}
