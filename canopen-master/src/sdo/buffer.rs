//! Where the data of a client's transfer come from or go to.

use super::AbortCode;
use super::message::load;

/// The caller's storage of one transfer: handed to the client with the command, handed back with the
/// outcome.
///
/// [`Small`] holds any scalar; `&mut [u8]`, `[u8; N]` and (feature `alloc`) `Vec<u8>` are made for
/// plain memory; an own type streams to and from a file or flash in constant memory. Where both small
/// and large transfers share one client, [`Either`] is the buffer.
pub trait Buffer {
    /// An upload begins; `size` in bytes if the server indicated it.
    ///
    /// # Errors
    /// An abort code, sent to the server: the upload has no room.
    fn begin(&mut self, size: Option<u32>) -> Result<(), AbortCode> {
        let _ = size;
        Ok(())
    }

    /// Takes uploaded bytes. `offset` is where the last ones ended.
    ///
    /// # Errors
    /// An abort code, sent to the server.
    fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), AbortCode>;

    /// Bytes to download, if known beforehand.
    fn size(&self) -> Option<u32>;

    /// Copies bytes to download from `offset` on; less than `out` holds only at the end. A block
    /// transfer that lost a segment asks once more for up to 889 bytes (one sub-block).
    ///
    /// # Errors
    /// An abort code, sent to the server.
    fn read(&mut self, offset: u32, out: &mut [u8]) -> Result<usize, AbortCode>;
}

/// Copies from `data` at `offset` what fits, and says how much.
#[cfg_attr(target_pointer_width = "32", inline(never))]
#[cfg_attr(not(target_pointer_width = "32"), inline)]
pub(crate) fn copy_from(data: &[u8], offset: u32, out: &mut [u8]) -> usize {
    let rest = data.get(offset as usize..).unwrap_or(&[]);
    // Whole segments and short objects are most of all: copies of known length.
    if let (Some(from), Ok(to)) = (rest.first_chunk::<7>(), <&mut [u8; 7]>::try_from(&mut *out)) {
        *to = *from;
        return 7;
    }
    if let (1..=8, Ok(to)) = (rest.len(), <&mut [u8; 8]>::try_from(&mut *out)) {
        *to = load(rest).to_le_bytes();
        return rest.len();
    }
    let len = rest.len().min(out.len());
    if let (Some(out), Some(rest)) = (out.get_mut(..len), rest.get(..len)) {
        out.copy_from_slice(rest);
    }
    len
}

#[inline]
fn copy_to(data: &mut [u8], offset: u32, from: &[u8]) -> Result<(), AbortCode> {
    let rest = data.get_mut(offset as usize..).ok_or(AbortCode::OUT_OF_MEMORY)?;
    if let (Some(to), Ok(from)) = (rest.first_chunk_mut::<7>(), <&[u8; 7]>::try_from(from)) {
        *to = *from;
        return Ok(());
    }
    rest.get_mut(..from.len()).ok_or(AbortCode::OUT_OF_MEMORY)?.copy_from_slice(from);
    Ok(())
}

impl Buffer for [u8] {
    #[inline]
    fn begin(&mut self, size: Option<u32>) -> Result<(), AbortCode> {
        match size {
            Some(size) if size as usize > self.len() => Err(AbortCode::OUT_OF_MEMORY),
            _ => Ok(()),
        }
    }

    #[inline]
    fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), AbortCode> {
        copy_to(self, offset, data)
    }

    #[inline]
    fn size(&self) -> Option<u32> {
        u32::try_from(self.len()).ok()
    }

    #[inline]
    fn read(&mut self, offset: u32, out: &mut [u8]) -> Result<usize, AbortCode> {
        Ok(copy_from(self, offset, out))
    }
}

impl<const N: usize> Buffer for [u8; N] {
    #[inline]
    fn begin(&mut self, size: Option<u32>) -> Result<(), AbortCode> {
        self.as_mut_slice().begin(size)
    }

    #[inline]
    fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), AbortCode> {
        copy_to(self, offset, data)
    }

    #[inline]
    fn size(&self) -> Option<u32> {
        u32::try_from(N).ok()
    }

    #[inline]
    fn read(&mut self, offset: u32, out: &mut [u8]) -> Result<usize, AbortCode> {
        Ok(copy_from(self, offset, out))
    }
}

impl<T: Buffer + ?Sized> Buffer for &mut T {
    #[inline]
    fn begin(&mut self, size: Option<u32>) -> Result<(), AbortCode> {
        T::begin(self, size)
    }

    #[inline]
    fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), AbortCode> {
        T::write(self, offset, data)
    }

    #[inline]
    fn size(&self) -> Option<u32> {
        T::size(self)
    }

    #[inline]
    fn read(&mut self, offset: u32, out: &mut [u8]) -> Result<usize, AbortCode> {
        T::read(self, offset, out)
    }
}

/// Download only, as from a firmware image in flash: an upload into it is refused.
impl Buffer for &[u8] {
    fn begin(&mut self, _: Option<u32>) -> Result<(), AbortCode> {
        Err(AbortCode::OUT_OF_MEMORY)
    }

    fn write(&mut self, _: u32, _: &[u8]) -> Result<(), AbortCode> {
        Err(AbortCode::OUT_OF_MEMORY)
    }

    #[inline]
    fn size(&self) -> Option<u32> {
        u32::try_from(self.len()).ok()
    }

    #[inline]
    fn read(&mut self, offset: u32, out: &mut [u8]) -> Result<usize, AbortCode> {
        Ok(copy_from(self, offset, out))
    }
}

/// What a `Vec` takes at most, in bytes.
#[cfg(feature = "alloc")]
const MOST: usize = 16 << 20;

/// An upload replaces what the vector held; what it allocates grows with the data that came, not with
/// the size that the server indicated.
#[cfg(feature = "alloc")]
impl Buffer for alloc::vec::Vec<u8> {
    /// Room for 16 MiB, so that a server that never ends does not take all memory.
    fn begin(&mut self, size: Option<u32>) -> Result<(), AbortCode> {
        /// Reserved at once at most.
        const RESERVE: usize = 4096;
        if size.is_some_and(|size| size as usize > MOST) {
            return Err(AbortCode::OUT_OF_MEMORY);
        }
        self.clear();
        self.reserve(size.map_or(0, |size| (size as usize).min(RESERVE)));
        Ok(())
    }

    #[inline]
    fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), AbortCode> {
        if (offset as usize).saturating_add(data.len()) > MOST {
            return Err(AbortCode::OUT_OF_MEMORY);
        }
        self.truncate(offset as usize);
        self.extend_from_slice(data);
        Ok(())
    }

    #[inline]
    fn size(&self) -> Option<u32> {
        u32::try_from(self.len()).ok()
    }

    #[inline]
    fn read(&mut self, offset: u32, out: &mut [u8]) -> Result<usize, AbortCode> {
        Ok(copy_from(self, offset, out))
    }
}

/// Up to 8 bytes held in place: every scalar type of CiA 301 (see [`data_type`](crate::data_type)).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Small {
    data: [u8; 8],
    /// Wide, so that it is read as it was written.
    len: u32,
}

impl Small {
    /// No bytes: to upload into.
    pub const EMPTY: Self = Self { data: [0; 8], len: 0 };

    /// A copy; `None` of more than 8 bytes.
    #[must_use]
    #[inline]
    pub fn new(bytes: &[u8]) -> Option<Self> {
        (bytes.len() <= 8).then(|| Self { data: load(bytes).to_le_bytes(), len: bytes.len() as u32 })
    }

    /// The bytes.
    #[must_use]
    #[inline]
    pub fn as_slice(&self) -> &[u8] {
        self.data.get(..self.len as usize).unwrap_or(&[])
    }
}

impl Buffer for Small {
    #[inline]
    fn begin(&mut self, size: Option<u32>) -> Result<(), AbortCode> {
        self.len = 0;
        self.data.as_mut_slice().begin(size)
    }

    #[inline]
    fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), AbortCode> {
        if let (0, Some(small)) = (offset, Self::new(data)) {
            *self = small;
            return Ok(());
        }
        copy_to(&mut self.data, offset, data)?;
        self.len = offset + data.len() as u32;
        Ok(())
    }

    #[inline]
    fn size(&self) -> Option<u32> {
        Some(self.len)
    }

    #[inline]
    fn read(&mut self, offset: u32, out: &mut [u8]) -> Result<usize, AbortCode> {
        Ok(copy_from(self.as_slice(), offset, out))
    }
}

/// One of two kinds of buffer, such as scalars held in place and the application's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Either<A, B> {
    /// The one.
    Left(A),
    /// The other.
    Right(B),
}

impl<A: Buffer, B: Buffer> Buffer for Either<A, B> {
    #[inline]
    fn begin(&mut self, size: Option<u32>) -> Result<(), AbortCode> {
        match self {
            Self::Left(buffer) => buffer.begin(size),
            Self::Right(buffer) => buffer.begin(size),
        }
    }

    #[inline]
    fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), AbortCode> {
        match self {
            Self::Left(buffer) => buffer.write(offset, data),
            Self::Right(buffer) => buffer.write(offset, data),
        }
    }

    #[inline]
    fn size(&self) -> Option<u32> {
        match self {
            Self::Left(buffer) => buffer.size(),
            Self::Right(buffer) => buffer.size(),
        }
    }

    #[inline]
    fn read(&mut self, offset: u32, out: &mut [u8]) -> Result<usize, AbortCode> {
        match self {
            Self::Left(buffer) => buffer.read(offset, out),
            Self::Right(buffer) => buffer.read(offset, out),
        }
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;

    #[test]
    fn a_vector_takes_no_byte_too_many() {
        let mut vec = alloc::vec::Vec::new();
        let end = MOST as u32;
        for offset in [end - 6, end, u32::MAX] {
            assert_eq!(Buffer::write(&mut vec, offset, &[0; 7]), Err(AbortCode::OUT_OF_MEMORY));
        }
        assert_eq!(Buffer::write(&mut vec, end - 7, &[0; 7]), Ok(()));
        assert_eq!(vec.begin(Some(end + 1)), Err(AbortCode::OUT_OF_MEMORY));
    }
}
