//! Up to 8 bytes held as one word.

use super::SEGMENT;

/// Up to `N` bytes; what lies behind them is zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Bytes<const N: usize> {
    /// All 8, whatever `N`: they move as one.
    pub(super) word: u64,
    len: u8,
}

impl<const N: usize> Bytes<N> {
    /// No bytes.
    pub const EMPTY: Self = Self { word: 0, len: 0 };

    /// A copy; `None` of more than `N` bytes.
    #[must_use]
    #[inline]
    pub fn new(bytes: &[u8]) -> Option<Self> {
        const { assert!(N <= 8) };
        (bytes.len() <= N).then(|| Self { word: load(bytes), len: bytes.len() as u8 })
    }

    /// The first `len` bytes of a word, at most `N`.
    #[inline]
    pub(crate) fn of_word(word: u64, len: usize) -> Self {
        let len = len.min(N);
        Self { word: word & mask(len), len: len as u8 }
    }

    /// Number of bytes, 0…`N`.
    #[must_use]
    #[inline]
    pub const fn len(&self) -> usize {
        self.len as usize
    }

    /// Whether there are none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The bytes, of which the first [`len`](Self::len) count; zeros behind them.
    #[must_use]
    #[inline]
    pub const fn padded(&self) -> [u8; 8] {
        self.word.to_le_bytes()
    }

    /// How many of `N` there are not; `len` is never above.
    #[inline]
    pub(super) const fn unused(&self) -> u8 {
        (N as u8).wrapping_sub(self.len)
    }
}

/// Up to 8 bytes as a little-endian word; all of them in two overlapping loads, for speed.
#[cfg_attr(target_pointer_width = "32", inline(never))]
#[cfg_attr(not(target_pointer_width = "32"), inline)]
pub(crate) fn load(bytes: &[u8]) -> u64 {
    let len = bytes.len();
    if let Some(&first) = bytes.first_chunk() {
        return u64::from_le_bytes(first);
    }
    if let (Some(&first), Some(&last)) = (bytes.first_chunk(), bytes.last_chunk()) {
        return u64::from(u32::from_le_bytes(first)) | u64::from(u32::from_le_bytes(last)) << (8 * (len - 4));
    }
    let byte = |at: usize| bytes.get(at).map_or(0, |&byte| u64::from(byte));
    byte(0) | byte(1) << 8 | byte(2) << 16
}

/// The lowest `len` bytes of a word, at most 8.
#[inline]
pub(crate) const fn mask(len: usize) -> u64 {
    match len {
        0 => 0,
        1..=7 => u64::MAX >> (64 - 8 * len),
        _ => u64::MAX,
    }
}

/// The first `len` bytes of a segment.
#[inline]
pub(crate) fn segment([a, b, c, d, e, f, g]: [u8; SEGMENT], len: u8) -> Bytes<SEGMENT> {
    Bytes::of_word(u64::from_le_bytes([a, b, c, d, e, f, g, 0]), len.into())
}

/// The first `len` bytes of 8.
#[inline]
pub(crate) fn first(bytes: &[u8; 8], len: usize) -> &[u8] {
    bytes.get(..len).unwrap_or(bytes)
}
