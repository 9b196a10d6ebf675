//! What the server reads from and writes to.

use super::super::{AbortCode, Address};

/// Number of bytes of an object, as far as it is known when reading begins.
pub type Total = Option<u32>;

/// A piece of a download.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Piece<'a> {
    /// Where it belongs, in bytes from the beginning.
    pub offset: u32,
    /// The bytes.
    pub data: &'a [u8],
    /// The object is complete with this piece (of a block transfer: and its CRC is right).
    pub last: bool,
    /// Bytes in all: with the last piece, or if the client indicated it. An expedited download without
    /// indicated size has none: it brings 4 bytes, of which those count that the object has.
    pub size: Option<u32>,
}

impl<'a> Piece<'a> {
    /// Whether it is the whole object, which is certain for up to 8 bytes.
    #[must_use]
    #[inline]
    pub const fn is_whole(&self) -> bool {
        self.offset == 0 && self.last
    }

    /// The value of an object of `size` bytes, 1…8.
    ///
    /// # Errors
    /// [`AbortCode::TOO_LONG`], [`AbortCode::TOO_SHORT`]: another number of bytes came.
    #[inline]
    pub fn exactly(&self, size: usize) -> Result<&'a [u8], AbortCode> {
        let value = if self.size.is_none() { self.data.get(..size) } else { None }.unwrap_or(self.data);
        if !self.is_whole() || value.len() > size {
            return Err(AbortCode::TOO_LONG);
        }
        if value.len() < size { Err(AbortCode::TOO_SHORT) } else { Ok(value) }
    }
}

/// The objects that a [`Server`](super::Server) serves.
///
/// Objects of any size pass in constant memory: they are read and written in pieces. What has up to 8
/// bytes is always read and written in one piece, so that no scalar is ever torn. A longer object
/// that changes while it is read should give what it was at offset 0.
pub trait Access {
    /// Copies bytes of an object from `offset` on to `out`, as many as there are room and data;
    /// returns their number and, at offset 0, the size of the object if it is known. An object of
    /// unknown size ends with the first call that fills less than `out`.
    ///
    /// `offset` goes up without gaps; in a block transfer that lost a segment it goes back by up to 889
    /// bytes (one sub-block).
    ///
    /// # Errors
    /// An abort code, sent to the client.
    fn read(&mut self, at: Address, offset: u32, out: &mut [u8]) -> Result<(usize, Total), AbortCode>;

    /// A download in several frames begins; the pieces follow.
    ///
    /// # Errors
    /// An abort code, sent to the client.
    fn begin_write(&mut self, at: Address, size: Option<u32>) -> Result<(), AbortCode>;

    /// Takes a piece. What is only complete as a whole must not be used before [`Piece::last`].
    /// A download of up to 8 bytes may come without [`begin_write`](Self::begin_write).
    ///
    /// # Errors
    /// An abort code, sent to the client.
    fn write(&mut self, at: Address, piece: &Piece<'_>) -> Result<(), AbortCode>;

    /// A download that had begun ends before its last piece: it was aborted, given up or replaced.
    fn abandon(&mut self, at: Address) {
        let _ = at;
    }
}

/// What [`Access::read`] returns for an object that lies in memory as a whole.
#[must_use]
#[inline]
pub fn read_slice(object: &[u8], offset: u32, out: &mut [u8]) -> (usize, Total) {
    (super::super::buffer::copy_from(object, offset, out), u32::try_from(object.len()).ok())
}
