//! The data of one PDO.

use core::fmt;

/// 0…8 bytes as one 64-bit word: byte 0 of the frame in bits 0…7, so that bit `n` of the PDO is bit `n`
/// of the word.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Payload {
    word: u64,
    len: u8,
}

impl Payload {
    /// No bytes.
    pub const EMPTY: Self = Self { word: 0, len: 0 };

    /// The first `len` bytes of a word, at most 8; bits above them are cleared.
    #[must_use]
    #[inline]
    pub const fn new(word: u64, len: u8) -> Self {
        match len {
            0 => Self::EMPTY,
            1..=7 => Self { word: word & (u64::MAX >> (64 - 8 * len as u32)), len },
            _ => Self { word, len: 8 },
        }
    }

    /// As [`new`](Self::new) for up to 8 bytes with all bits above them clear.
    #[inline]
    pub(crate) const fn checked(word: u64, len: u8) -> Self {
        Self { word, len }
    }

    /// The data of a frame; bytes beyond the 8th are cut off.
    #[must_use]
    #[inline]
    pub fn from_slice(data: &[u8]) -> Self {
        if let Ok(bytes) = data.try_into() {
            return Self { word: u64::from_le_bytes(bytes), len: 8 };
        }
        let word = data.iter().take(8).rev().fold(0, |word, &byte| word << 8 | u64::from(byte));
        Self { word, len: data.len().min(8) as u8 }
    }

    /// All bits; those beyond [`len`](Self::len) are 0.
    #[must_use]
    #[inline]
    pub const fn word(self) -> u64 {
        self.word
    }

    /// Number of bytes.
    #[must_use]
    #[inline]
    pub const fn len(self) -> u8 {
        self.len
    }

    /// Whether there are no bytes.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.len == 0
    }

    /// The bytes; those beyond [`len`](Self::len) are 0.
    #[must_use]
    #[inline]
    pub const fn bytes(self) -> [u8; 8] {
        self.word.to_le_bytes()
    }

    /// `bits` bits from bit `offset` on; 0 where there are none.
    #[must_use]
    #[inline]
    pub const fn bits(self, offset: u8, bits: u8) -> Bits {
        Bits::new(if offset < 64 { self.word >> offset } else { 0 }, bits)
    }

    /// The data frame on an 11-bit identifier.
    #[must_use]
    #[inline]
    pub fn frame(self, id: embedded_can::StandardId) -> crate::Frame {
        crate::Frame::of_payload(id, self)
    }
}

impl fmt::Debug for Payload {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Payload(")?;
        self.bytes().iter().take(self.len.into()).try_for_each(|byte| write!(f, "{byte:02X}"))?;
        f.write_str(")")
    }
}

/// The value of one mapped object, 0…64 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Bits {
    value: u64,
    bits: u8,
}

impl Bits {
    /// The lowest `bits` bits of a value, at most 64.
    #[must_use]
    #[inline]
    pub const fn new(value: u64, bits: u8) -> Self {
        let bits = if bits > 64 { 64 } else { bits };
        let mask = if bits == 0 { 0 } else { u64::MAX >> (64 - bits as u32) };
        Self { value: value & mask, bits }
    }

    /// As [`new`](Self::new) for 1…64 bits, which the caller has made sure of.
    #[inline]
    pub(crate) const fn checked(value: u64, bits: u8) -> Self {
        Self { value: value & u64::MAX.wrapping_shr(64u32.wrapping_sub(bits as u32)), bits }
    }

    /// A signed value in `bits` bits: two's complement, higher bits cut off.
    #[must_use]
    #[inline]
    pub const fn from_signed(value: i64, bits: u8) -> Self {
        Self::new(value as u64, bits)
    }

    /// Number of bits.
    #[must_use]
    #[inline]
    pub const fn len(self) -> u8 {
        self.bits
    }

    /// Whether there are no bits.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.bits == 0
    }

    /// As an unsigned number.
    #[must_use]
    #[inline]
    pub const fn unsigned(self) -> u64 {
        self.value
    }

    /// As a signed number: the highest bit is the sign.
    #[must_use]
    #[inline]
    pub const fn signed(self) -> i64 {
        if self.bits == 0 {
            return 0;
        }
        let unused = 64 - self.bits as u32;
        (self.value << unused) as i64 >> unused
    }
}
