//! Writing telegrams.

use super::{HEAD_0, HEAD_1, MAX_DATA};

/// Why a telegram could not be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// More data than the number byte can count.
    #[error("{len} data bytes, a telegram carries at most 253")]
    TooLong {
        /// Data bytes given.
        len: usize,
    },
    /// The output buffer is too small for the telegram with its doubled bytes.
    #[error("the telegram takes {needed} bytes, the buffer has {len}")]
    BufferTooSmall {
        /// Bytes that the telegram takes on the wire.
        needed: usize,
        /// Bytes of the buffer.
        len: usize,
    },
}

/// Writes a telegram with `function` and `data` (0…253 bytes) to the front of `out` and returns its
/// length on the wire. A buffer of [`super::MAX_WIRE`] bytes is always enough. What `out` holds
/// after an error is not specified.
///
/// ```
/// let mut out = [0; 16];
/// // Manual A, Appendix 1: calling the MotionController with the number 2.
/// let n = lb2::frame::encode(0x00, &[0x02], &mut out)?;
/// assert_eq!(out[..n], [0x82, 0x96, 0x03, 0x00, 0x02, 0x01]);
/// # Ok::<(), lb2::frame::EncodeError>(())
/// ```
///
/// # Errors
/// [`EncodeError::TooLong`] for more than 253 data bytes, [`EncodeError::BufferTooSmall`].
#[inline]
pub fn encode(function: u8, data: &[u8], out: &mut [u8]) -> Result<usize, EncodeError> {
    #[cfg(target_pointer_width = "64")]
    if let Some(len) = super::wide::encode(function, data, out) {
        return Ok(len);
    }
    encode_bytes(function, data, out)
}

/// Byte by byte: where the buffer is tight, and on processors without a faster path.
#[inline(never)]
fn encode_bytes(function: u8, data: &[u8], out: &mut [u8]) -> Result<usize, EncodeError> {
    let number = number(data)?;
    let len = out.len();
    let mut writer = Writer { out, at: 0, check: 0 };
    writer.raw(HEAD_0);
    writer.raw(HEAD_1);
    writer.unit(number);
    writer.unit(function);
    for &byte in data {
        writer.unit(byte);
    }
    writer.unit(writer.check);
    match writer.at {
        needed if needed > len => Err(EncodeError::BufferTooSmall { needed, len }),
        written => Ok(written),
    }
}

/// Bytes that a telegram with `function` and `data` takes on the wire, doubled bytes included.
///
/// # Errors
/// [`EncodeError::TooLong`] for more than 253 data bytes.
pub fn encoded_len(function: u8, data: &[u8]) -> Result<usize, EncodeError> {
    let number = number(data)?;
    let check = super::xor(data) ^ number ^ function;
    Ok(5 + data.len() + super::count_head(&[number, function, check]) + super::count_head(data))
}

fn number(data: &[u8]) -> Result<u8, EncodeError> {
    match u8::try_from(data.len() + 2) {
        Ok(number) if data.len() <= MAX_DATA => Ok(number),
        _ => Err(EncodeError::TooLong { len: data.len() }),
    }
}

/// Writes as far as there is room, and counts on.
struct Writer<'a> {
    out: &'a mut [u8],
    at: usize,
    check: u8,
}

impl Writer<'_> {
    fn raw(&mut self, byte: u8) {
        if let Some(room) = self.out.get_mut(self.at) {
            *room = byte;
        }
        self.at += 1;
    }

    fn unit(&mut self, byte: u8) {
        self.check ^= byte;
        self.raw(byte);
        if byte == HEAD_0 {
            self.raw(byte);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::MAX_WIRE;

    fn wire(function: u8, data: &[u8]) -> ([u8; MAX_WIRE], usize) {
        let mut out = [0xA5; MAX_WIRE];
        let n = encode(function, data, &mut out).unwrap();
        assert_eq!(encoded_len(function, data), Ok(n));
        (out, n)
    }

    /// Decision 1: number, data and check byte 82h are each sent twice, the head is not.
    #[test]
    fn every_82h_of_the_block_is_doubled() {
        let (out, n) = wire(0x40, &[0x82]);
        assert_eq!(out[..n], [0x82, 0x96, 0x03, 0x40, 0x82, 0x82, 0xC1]);
        let (out, n) = wire(0xFF, &[0x7E]);
        assert_eq!(out[..n], [0x82, 0x96, 0x03, 0xFF, 0x7E, 0x82, 0x82]);
        let (out, n) = wire(0xCC, &[0; 0x80]);
        assert_eq!(out[..5], [0x82, 0x96, 0x82, 0x82, 0xCC]);
        assert_eq!((n, out[n - 1]), (2 + 2 + 1 + 0x80 + 1, 0x82 ^ 0xCC));
    }

    #[test]
    fn limits_are_named() {
        let mut out = [0; MAX_WIRE];
        assert_eq!(encode(0x82, &[0x82; 253], &mut out).unwrap(), 2 + 1 + 2 + 506 + 1);
        assert_eq!(encode(0, &[0; 254], &mut out), Err(EncodeError::TooLong { len: 254 }));
        assert_eq!(encode(0, &[0x82], &mut out[..6]), Err(EncodeError::BufferTooSmall { needed: 7, len: 6 }));
    }
}
