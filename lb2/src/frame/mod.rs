//! LB2 framing: head, data block, check byte, doubling (manual A, Appendix 1 "Telegram structure").
//!
//! On the wire a telegram is `82h 96h | number | function | data … | check byte`.
//! *Number* counts all bytes that follow it up to and including the check byte; the check byte is
//! the XOR of everything between head and check byte. Number, function, data and check byte are the
//! *block*: wherever it holds 82h, that byte is sent twice. Doubled bytes count neither in the
//! number nor in the check byte; the number byte itself is doubled when it is 82h (decision 1).
//!
//! [`encode`] writes a telegram, [`Decoder`] finds telegrams in a byte stream of any quality.

mod decoder;
mod encode;
#[cfg(target_pointer_width = "64")]
mod wide;

pub use decoder::{Damage, DamageKind, Decoder, Item};
pub use encode::{EncodeError, encode, encoded_len};

/// First byte of the head; doubled wherever it stands in a block.
pub const HEAD_0: u8 = 0x82;
/// Second byte of the head.
pub const HEAD_1: u8 = 0x96;
/// Most data bytes one telegram can carry: number (1 byte) counts function, data and check byte.
pub const MAX_DATA: usize = 253;
/// Longest block in bytes: number, function, data, check byte, not doubled.
pub const MAX_BLOCK: usize = MAX_DATA + 3;
/// Longest telegram on the wire in bytes: head and a block in which every byte is doubled.
pub const MAX_WIRE: usize = 2 + 2 * MAX_BLOCK;

/// A verified telegram: number and check byte are right. Borrows its block, not doubled.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a> {
    block: &'a [u8],
}

/// Why a block is not a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// The number byte does not say how many bytes follow it.
    #[error("number byte says {expected} bytes follow, there are {found}")]
    Number {
        /// Bytes that the number byte announces (at least 2 are needed).
        expected: usize,
        /// Bytes that follow the number byte.
        found: usize,
    },
    /// The check byte is not the XOR of the block before it.
    #[error("check byte is {found:02X}h, the block's XOR is {expected:02X}h")]
    CheckByte {
        /// XOR of number, function and data.
        expected: u8,
        /// The check byte that came.
        found: u8,
    },
}

impl<'a> Frame<'a> {
    /// Checks a block (number, function, data, check byte; not doubled).
    ///
    /// # Errors
    /// [`FrameError::Number`] unless the number byte is at least 2 and counts the bytes after it,
    /// [`FrameError::CheckByte`] unless all bytes of the block XOR to zero.
    pub fn new_checked(block: &'a [u8]) -> Result<Self, FrameError> {
        let (expected, found) = match block.split_first() {
            Some((&number, rest)) => (usize::from(number), rest.len()),
            None => (0, 0),
        };
        if expected != found || expected < 2 {
            return Err(FrameError::Number { expected, found });
        }
        match (xor(block), block.last()) {
            (0, _) | (_, None) => Ok(Self { block }),
            (rest, Some(&check)) => Err(FrameError::CheckByte { expected: rest ^ check, found: check }),
        }
    }

    /// The whole block: number, function, data, check byte; not doubled.
    #[must_use]
    pub const fn block(&self) -> &'a [u8] {
        self.block
    }

    /// The number byte: bytes that follow it up to and including the check byte, 2…255.
    #[must_use]
    pub fn number(&self) -> u8 {
        self.block.first().copied().unwrap_or(0)
    }

    /// The function byte.
    #[must_use]
    pub fn function(&self) -> u8 {
        self.block.get(1).copied().unwrap_or(0)
    }

    /// The data between function and check byte, 0…253 bytes.
    #[must_use]
    pub fn data(&self) -> &'a [u8] {
        self.block.get(2..self.block.len().saturating_sub(1)).unwrap_or(&[])
    }

    /// The check byte: XOR of number, function and data.
    #[must_use]
    pub fn check(&self) -> u8 {
        self.block.last().copied().unwrap_or(0)
    }

    /// Bytes that this telegram takes on the wire: head, block and one byte more for every 82h.
    #[must_use]
    pub fn wire_len(&self) -> usize {
        2 + self.block.len() + count_head(self.block)
    }
}

impl core::fmt::Debug for Frame<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Frame({:02X}h", self.function())?;
        for byte in self.data() {
            write!(f, " {byte:02X}")?;
        }
        f.write_str(")")
    }
}

fn xor(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |x, b| x ^ b)
}

fn count_head(bytes: &[u8]) -> usize {
    bytes.iter().filter(|&&b| b == HEAD_0).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_is_checked_and_taken_apart() {
        let frame = Frame::new_checked(&[0x03, 0x00, 0x02, 0x01]).unwrap();
        assert_eq!(frame.number(), 3);
        assert_eq!(frame.function(), 0);
        assert_eq!(frame.data(), [2]);
        assert_eq!(frame.check(), 1);
        assert_eq!(frame.wire_len(), 6);
    }

    #[test]
    fn number_and_check_byte_errors_say_what_came() {
        assert_eq!(Frame::new_checked(&[]), Err(FrameError::Number { expected: 0, found: 0 }));
        assert_eq!(Frame::new_checked(&[1, 1]), Err(FrameError::Number { expected: 1, found: 1 }));
        assert_eq!(Frame::new_checked(&[3, 0, 2]), Err(FrameError::Number { expected: 3, found: 2 }));
        assert_eq!(Frame::new_checked(&[3, 0, 2, 0]), Err(FrameError::CheckByte { expected: 1, found: 0 }));
    }
}
