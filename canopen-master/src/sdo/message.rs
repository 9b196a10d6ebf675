//! The 8 bytes of an SDO frame as typed values (CiA 301, 7.2.4.3).
//!
//! Segments inside a block transfer have no command specifier; only the state of the transfer says
//! that a frame is one: [`BlockSegment`].
//!
//! Parsers do not look at reserved bits and bytes, nor at bytes that a length marks as unused: devices
//! leave garbage there. Frames shorter than 8 bytes are taken as far as what they say is complete.

use pdo::Address;

use super::AbortCode;

/// Data bytes of a segment.
pub const SEGMENT: usize = 7;

/// Up to `N` bytes; what lies behind them is zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Bytes<const N: usize> {
    /// All 8, whatever `N`: they move as one.
    word: u64,
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

    #[inline]
    const fn unused(&self) -> u8 {
        (N as u8).saturating_sub(self.len)
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

/// What an initiate frame of a download or an initiate answer of an upload carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Content {
    /// All of it, 1…4 bytes, their number indicated.
    Expedited(Bytes<4>),
    /// All of it in 4 bytes, of which the object's type says how many count.
    ExpeditedUnsized([u8; 4]),
    /// Segments follow; in all so many bytes, if indicated.
    Segmented(Option<u32>),
}

/// From the client to the server.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Request {
    /// ccs 1 (7.2.4.3.3).
    InitiateDownload {
        /// Object written.
        at: Address,
        /// The data or their size.
        content: Content,
    },
    /// ccs 0 (7.2.4.3.4).
    DownloadSegment {
        /// Alternates, `false` in the first segment.
        toggle: bool,
        /// No more segments follow.
        last: bool,
        /// 0…7 bytes.
        data: Bytes<SEGMENT>,
    },
    /// ccs 2 (7.2.4.3.5).
    InitiateUpload {
        /// Object read.
        at: Address,
    },
    /// ccs 3 (7.2.4.3.6).
    UploadSegment {
        /// Alternates, `false` in the first request.
        toggle: bool,
    },
    /// cs 4 (7.2.4.3.17).
    Abort {
        /// Object of the transfer.
        at: Address,
        /// Reason.
        code: AbortCode,
    },
    /// ccs 6, cs 0 (7.2.4.3.8).
    InitiateBlockDownload {
        /// Object written.
        at: Address,
        /// The client can compute a CRC.
        crc: bool,
        /// Number of bytes, if indicated.
        size: Option<u32>,
    },
    /// ccs 6, cs 1 (7.2.4.3.11).
    EndBlockDownload {
        /// Bytes of the last segment that are no data, 0…7.
        unused: u8,
        /// Over all data; 0 without CRC.
        crc: u16,
    },
    /// ccs 5, cs 0 (7.2.4.3.12).
    InitiateBlockUpload {
        /// Object read.
        at: Address,
        /// The client can compute a CRC.
        crc: bool,
        /// Segments per sub-block, 1…127.
        block_size: u8,
        /// Protocol switch threshold: up to so many bytes the server may answer with a plain upload;
        /// 0 forbids it.
        threshold: u8,
    },
    /// ccs 5, cs 3 (7.2.4.3.12).
    StartBlockUpload,
    /// ccs 5, cs 2 (7.2.4.3.14).
    AckBlockUpload {
        /// Last segment of the sub-block received in order, 0…127.
        sequence: u8,
        /// Segments of the next sub-block, 1…127.
        block_size: u8,
    },
    /// ccs 5, cs 1 (7.2.4.3.15).
    EndBlockUpload,
}

/// From the server to the client.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Response {
    /// scs 3 (7.2.4.3.3).
    InitiateDownload {
        /// Object written.
        at: Address,
    },
    /// scs 1 (7.2.4.3.4).
    DownloadSegment {
        /// As in the request.
        toggle: bool,
    },
    /// scs 2 (7.2.4.3.5).
    InitiateUpload {
        /// Object read.
        at: Address,
        /// The data or their size.
        content: Content,
    },
    /// scs 0 (7.2.4.3.6).
    UploadSegment {
        /// As in the request.
        toggle: bool,
        /// No more segments follow.
        last: bool,
        /// 0…7 bytes.
        data: Bytes<SEGMENT>,
    },
    /// cs 4 (7.2.4.3.17).
    Abort {
        /// Object of the transfer.
        at: Address,
        /// Reason.
        code: AbortCode,
    },
    /// scs 5, ss 0 (7.2.4.3.8).
    InitiateBlockDownload {
        /// Object written.
        at: Address,
        /// The server can compute a CRC.
        crc: bool,
        /// Segments of the first sub-block, 1…127.
        block_size: u8,
    },
    /// scs 5, ss 2 (7.2.4.3.10).
    AckBlockDownload {
        /// Last segment of the sub-block received in order, 0…127.
        sequence: u8,
        /// Segments of the next sub-block, 1…127.
        block_size: u8,
    },
    /// scs 5, ss 1 (7.2.4.3.11).
    EndBlockDownload,
    /// scs 6, ss 0 (7.2.4.3.12).
    InitiateBlockUpload {
        /// Object read.
        at: Address,
        /// The server can compute a CRC.
        crc: bool,
        /// Number of bytes, if indicated.
        size: Option<u32>,
    },
    /// scs 6, ss 1 (7.2.4.3.15).
    EndBlockUpload {
        /// Bytes of the last segment that are no data, 0…7.
        unused: u8,
        /// Over all data; 0 without CRC.
        crc: u16,
    },
}

/// A segment of a block transfer (7.2.4.3.9, 7.2.4.3.13).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct BlockSegment {
    /// Number in the sub-block, 1…127.
    pub sequence: u8,
    /// No more segments follow.
    pub last: bool,
    /// 7 bytes; how many of the last segment count is said at the end of the transfer.
    pub data: [u8; SEGMENT],
}

/// Why 8 bytes are no SDO message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MessageError {
    /// First byte with no meaning in this direction.
    #[error("command byte {0:02X}h not known")]
    Command(u8),
    /// Less than the command byte says.
    #[error("{found} bytes, at least {expected} expected after command byte {command:02X}h")]
    Short {
        /// First byte.
        command: u8,
        /// Bytes there must be.
        expected: usize,
        /// Bytes there are.
        found: usize,
    },
}

impl MessageError {
    /// The first byte, 0 of an empty frame.
    #[must_use]
    pub const fn command(self) -> u8 {
        match self {
            Self::Command(command) | Self::Short { command, .. } => command,
        }
    }
}

/// First byte of an abort in both directions.
pub(crate) const ABORT: u8 = 0x80;

/// Bits of the first byte.
mod bit {
    pub(super) const EXPEDITED: u8 = 1 << 1;
    pub(super) const SIZED: u8 = 1;
    pub(super) const TOGGLE: u8 = 1 << 4;
    pub(super) const LAST: u8 = 1;
    pub(super) const CRC: u8 = 1 << 2;
    pub(super) const BLOCK_SIZED: u8 = 1 << 1;
}

/// The bytes of a frame as one word, zeros behind those there are.
#[derive(Clone, Copy)]
struct Raw {
    word: u64,
    len: usize,
}

impl Raw {
    #[inline]
    fn new(data: &[u8]) -> Self {
        if let Ok(&bytes) = <&[u8; 8]>::try_from(data) {
            return Self { word: u64::from_le_bytes(bytes), len: 8 };
        }
        let data = data.get(..8).unwrap_or(data);
        Self { word: load(data), len: data.len() }
    }

    #[inline]
    const fn command(&self) -> u8 {
        self.word as u8
    }

    #[inline]
    const fn byte(&self, at: u32) -> u8 {
        (self.word >> (8 * at)) as u8
    }

    #[inline]
    const fn need(&self, expected: usize) -> Result<(), MessageError> {
        if self.len < expected {
            return Err(MessageError::Short { command: self.command(), expected, found: self.len });
        }
        Ok(())
    }

    #[inline]
    fn address(&self) -> Result<Address, MessageError> {
        self.need(4)?;
        Ok(Address::new((self.word >> 8) as u16, self.byte(3)))
    }

    /// The last 4 bytes.
    #[inline]
    const fn tail(&self) -> u32 {
        (self.word >> 32) as u32
    }

    #[inline]
    fn content(&self) -> Result<Content, MessageError> {
        let command = self.command();
        let (expedited, sized) = (command & bit::EXPEDITED != 0, command & bit::SIZED != 0);
        Ok(match (expedited, sized) {
            (true, true) => {
                let len = 4 - usize::from(command >> 2 & 3);
                self.need(4 + len)?;
                Content::Expedited(Bytes::of_word(self.word >> 32, len))
            }
            (true, false) => {
                self.need(5)?;
                Content::ExpeditedUnsized(self.tail().to_le_bytes())
            }
            (false, true) => {
                self.need(8)?;
                Content::Segmented(Some(self.tail()))
            }
            (false, false) => Content::Segmented(None),
        })
    }

    #[inline]
    fn segment(&self) -> Result<Bytes<SEGMENT>, MessageError> {
        let len = SEGMENT - usize::from(self.command() >> 1 & 7);
        self.need(1 + len)?;
        Ok(Bytes::of_word(self.word >> 8, len))
    }

    #[inline]
    fn abort(&self) -> Result<(Address, AbortCode), MessageError> {
        self.need(8)?;
        Ok((self.address()?, AbortCode(self.tail())))
    }

    #[inline]
    fn block_size(&self) -> Result<Option<u32>, MessageError> {
        if self.command() & bit::BLOCK_SIZED == 0 {
            return Ok(None);
        }
        self.need(8)?;
        Ok(Some(self.tail()))
    }

    #[inline]
    fn end(&self) -> Result<(u8, u16), MessageError> {
        self.need(3)?;
        Ok((self.command() >> 2 & 7, (self.word >> 8) as u16))
    }
}

#[inline]
const fn with_address(command: u8, at: Address, tail: u32) -> u64 {
    command as u64 | (at.index as u64) << 8 | (at.sub as u64) << 24 | (tail as u64) << 32
}

#[inline]
const fn with_content(command: u8, at: Address, content: &Content) -> u64 {
    match content {
        Content::Expedited(bytes) => {
            let command = command | bytes.unused() << 2 | bit::EXPEDITED | bit::SIZED;
            with_address(command, at, bytes.word as u32)
        }
        Content::ExpeditedUnsized(bytes) => {
            with_address(command | bit::EXPEDITED, at, u32::from_le_bytes(*bytes))
        }
        Content::Segmented(Some(size)) => with_address(command | bit::SIZED, at, *size),
        Content::Segmented(None) => with_address(command, at, 0),
    }
}

#[inline]
const fn with_segment(command: u8, toggle: bool, last: bool, bytes: &Bytes<SEGMENT>) -> u64 {
    let command = command | toggle_bit(toggle) | bytes.unused() << 1 | last as u8;
    command as u64 | bytes.word << 8
}

#[inline]
const fn with_block_size(command: u8, crc: bool, at: Address, size: Option<u32>) -> u64 {
    let command = command | crc_bit(crc);
    match size {
        Some(size) => with_address(command | bit::BLOCK_SIZED, at, size),
        None => with_address(command, at, 0),
    }
}

#[inline]
const fn toggle_bit(toggle: bool) -> u8 {
    if toggle { bit::TOGGLE } else { 0 }
}

#[inline]
const fn crc_bit(crc: bool) -> u8 {
    if crc { bit::CRC } else { 0 }
}

#[inline]
const fn with_end(command: u8, unused: u8, crc: u16) -> u64 {
    (command | (unused & 7) << 2) as u64 | (crc as u64) << 8
}

#[inline]
const fn with_confirmation(command: u8, sequence: u8, block_size: u8) -> u64 {
    command as u64 | (sequence as u64) << 8 | (block_size as u64) << 16
}

impl Request {
    /// Reads the data of a frame.
    ///
    /// # Errors
    /// [`MessageError`] for a command no client sends, or too few bytes for it.
    // Where it is used, most variants then never exist: worth half the time of a transfer.
    #[inline(always)]
    pub fn parse(data: &[u8]) -> Result<Self, MessageError> {
        let raw = Raw::new(data);
        raw.need(1)?;
        let command = raw.command();
        let toggle = command & bit::TOGGLE != 0;
        Ok(match command >> 5 {
            0 => Self::DownloadSegment { toggle, last: command & bit::LAST != 0, data: raw.segment()? },
            1 => Self::InitiateDownload { at: raw.address()?, content: raw.content()? },
            2 => Self::InitiateUpload { at: raw.address()? },
            3 => Self::UploadSegment { toggle },
            4 => {
                let (at, code) = raw.abort()?;
                Self::Abort { at, code }
            }
            5 => match command & 3 {
                0 => {
                    raw.need(5)?;
                    Self::InitiateBlockUpload {
                        at: raw.address()?,
                        crc: command & bit::CRC != 0,
                        block_size: raw.byte(4),
                        threshold: raw.byte(5),
                    }
                }
                1 => Self::EndBlockUpload,
                2 => {
                    raw.need(3)?;
                    Self::AckBlockUpload { sequence: raw.byte(1), block_size: raw.byte(2) }
                }
                _ => Self::StartBlockUpload,
            },
            6 if command & 1 == 0 => Self::InitiateBlockDownload {
                at: raw.address()?,
                crc: command & bit::CRC != 0,
                size: raw.block_size()?,
            },
            6 => {
                let (unused, crc) = raw.end()?;
                Self::EndBlockDownload { unused, crc }
            }
            _ => return Err(MessageError::Command(command)),
        })
    }

    /// The data of a frame; reserved bits and bytes are 0.
    #[must_use]
    #[inline]
    pub const fn encode(&self) -> [u8; 8] {
        let word = match self {
            Self::DownloadSegment { toggle, last, data } => with_segment(0, *toggle, *last, data),
            Self::InitiateDownload { at, content } => with_content(0x20, *at, content),
            Self::InitiateUpload { at } => with_address(0x40, *at, 0),
            Self::UploadSegment { toggle } => (0x60 | toggle_bit(*toggle)) as u64,
            Self::Abort { at, code } => with_address(ABORT, *at, code.0),
            Self::InitiateBlockUpload { at, crc, block_size, threshold } => {
                with_address(0xA0 | crc_bit(*crc), *at, *block_size as u32 | (*threshold as u32) << 8)
            }
            Self::EndBlockUpload => 0xA1,
            Self::AckBlockUpload { sequence, block_size } => with_confirmation(0xA2, *sequence, *block_size),
            Self::StartBlockUpload => 0xA3,
            Self::InitiateBlockDownload { at, crc, size } => with_block_size(0xC0, *crc, *at, *size),
            Self::EndBlockDownload { unused, crc } => with_end(0xC1, *unused, *crc),
        };
        word.to_le_bytes()
    }
}

impl Response {
    /// Reads the data of a frame.
    ///
    /// # Errors
    /// [`MessageError`] for a command no server sends, or too few bytes for it.
    // Where it is used, most variants then never exist: worth half the time of a transfer.
    #[inline(always)]
    pub fn parse(data: &[u8]) -> Result<Self, MessageError> {
        let raw = Raw::new(data);
        raw.need(1)?;
        let command = raw.command();
        let toggle = command & bit::TOGGLE != 0;
        Ok(match command >> 5 {
            0 => Self::UploadSegment { toggle, last: command & bit::LAST != 0, data: raw.segment()? },
            1 => Self::DownloadSegment { toggle },
            2 => Self::InitiateUpload { at: raw.address()?, content: raw.content()? },
            3 => Self::InitiateDownload { at: raw.address()? },
            4 => {
                let (at, code) = raw.abort()?;
                Self::Abort { at, code }
            }
            5 => match command & 3 {
                0 => {
                    raw.need(5)?;
                    Self::InitiateBlockDownload {
                        at: raw.address()?,
                        crc: command & bit::CRC != 0,
                        block_size: raw.byte(4),
                    }
                }
                1 => Self::EndBlockDownload,
                2 => {
                    raw.need(3)?;
                    Self::AckBlockDownload { sequence: raw.byte(1), block_size: raw.byte(2) }
                }
                _ => return Err(MessageError::Command(command)),
            },
            6 if command & 1 == 0 => Self::InitiateBlockUpload {
                at: raw.address()?,
                crc: command & bit::CRC != 0,
                size: raw.block_size()?,
            },
            6 => {
                let (unused, crc) = raw.end()?;
                Self::EndBlockUpload { unused, crc }
            }
            _ => return Err(MessageError::Command(command)),
        })
    }

    /// The data of a frame; reserved bits and bytes are 0.
    #[must_use]
    #[inline]
    pub const fn encode(&self) -> [u8; 8] {
        let word = match self {
            Self::UploadSegment { toggle, last, data } => with_segment(0, *toggle, *last, data),
            Self::DownloadSegment { toggle } => (0x20 | toggle_bit(*toggle)) as u64,
            Self::InitiateUpload { at, content } => with_content(0x40, *at, content),
            Self::InitiateDownload { at } => with_address(0x60, *at, 0),
            Self::Abort { at, code } => with_address(ABORT, *at, code.0),
            Self::InitiateBlockDownload { at, crc, block_size } => {
                with_address(0xA0 | crc_bit(*crc), *at, *block_size as u32)
            }
            Self::EndBlockDownload => 0xA1,
            Self::AckBlockDownload { sequence, block_size } => {
                with_confirmation(0xA2, *sequence, *block_size)
            }
            Self::InitiateBlockUpload { at, crc, size } => with_block_size(0xC0, *crc, *at, *size),
            Self::EndBlockUpload { unused, crc } => with_end(0xC1, *unused, *crc),
        };
        word.to_le_bytes()
    }
}

impl BlockSegment {
    /// Reads the data of a frame; `None` for sequence number 0 (an abort is one) and for less than 8
    /// bytes.
    #[must_use]
    #[inline]
    pub fn parse(data: &[u8]) -> Option<Self> {
        let [first, data @ ..] = <[u8; 8]>::try_from(data).ok()?;
        let sequence = first & 0x7F;
        (sequence != 0).then_some(Self { sequence, last: first & 0x80 != 0, data })
    }

    /// The data of a frame.
    #[must_use]
    #[inline]
    pub const fn encode(&self) -> [u8; 8] {
        let [a, b, c, d, e, f, g] = self.data;
        [self.sequence & 0x7F | (self.last as u8) << 7, a, b, c, d, e, f, g]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT: Address = Address::new(0x6041, 0x02);

    fn short<const N: usize>(bytes: &[u8]) -> Bytes<N> {
        Bytes::new(bytes).unwrap()
    }

    /// CiA 301, 7.2.4.3: command bytes and positions.
    #[test]
    fn golden_requests() {
        let expedited = |bytes| Content::Expedited(short(bytes));
        for (request, bytes) in [
            (Request::InitiateUpload { at: AT }, [0x40, 0x41, 0x60, 0x02, 0, 0, 0, 0]),
            (
                Request::InitiateDownload { at: AT, content: expedited(&[1, 2, 3, 4]) },
                [0x23, 0x41, 0x60, 0x02, 1, 2, 3, 4],
            ),
            (
                Request::InitiateDownload { at: AT, content: expedited(&[1]) },
                [0x2F, 0x41, 0x60, 0x02, 1, 0, 0, 0],
            ),
            (
                Request::InitiateDownload { at: AT, content: Content::ExpeditedUnsized([1, 2, 3, 4]) },
                [0x22, 0x41, 0x60, 0x02, 1, 2, 3, 4],
            ),
            (
                Request::InitiateDownload { at: AT, content: Content::Segmented(Some(0x0102_0304)) },
                [0x21, 0x41, 0x60, 0x02, 4, 3, 2, 1],
            ),
            (
                Request::DownloadSegment { toggle: true, last: true, data: short(&[9, 8]) },
                [0x1B, 9, 8, 0, 0, 0, 0, 0],
            ),
            (Request::UploadSegment { toggle: true }, [0x70, 0, 0, 0, 0, 0, 0, 0]),
            (
                Request::Abort { at: AT, code: AbortCode::TIMED_OUT },
                [0x80, 0x41, 0x60, 0x02, 0, 0, 0x04, 0x05],
            ),
            (
                Request::InitiateBlockDownload { at: AT, crc: true, size: Some(0x10) },
                [0xC6, 0x41, 0x60, 0x02, 0x10, 0, 0, 0],
            ),
            (Request::EndBlockDownload { unused: 3, crc: 0x31C3 }, [0xCD, 0xC3, 0x31, 0, 0, 0, 0, 0]),
            (
                Request::InitiateBlockUpload { at: AT, crc: true, block_size: 127, threshold: 21 },
                [0xA4, 0x41, 0x60, 0x02, 127, 21, 0, 0],
            ),
            (Request::StartBlockUpload, [0xA3, 0, 0, 0, 0, 0, 0, 0]),
            (Request::AckBlockUpload { sequence: 5, block_size: 9 }, [0xA2, 5, 9, 0, 0, 0, 0, 0]),
            (Request::EndBlockUpload, [0xA1, 0, 0, 0, 0, 0, 0, 0]),
        ] {
            assert_eq!(request.encode(), bytes, "{request:?}");
            assert_eq!(Request::parse(&bytes), Ok(request));
        }
    }

    #[test]
    fn golden_responses() {
        for (response, bytes) in [
            (
                Response::InitiateUpload { at: AT, content: Content::Expedited(short(&[0x40, 0])) },
                [0x4B, 0x41, 0x60, 0x02, 0x40, 0, 0, 0],
            ),
            (
                Response::InitiateUpload { at: AT, content: Content::Segmented(Some(26)) },
                [0x41, 0x41, 0x60, 0x02, 26, 0, 0, 0],
            ),
            (
                Response::UploadSegment { toggle: false, last: false, data: short(b"abcdefg") },
                [0x00, b'a', b'b', b'c', b'd', b'e', b'f', b'g'],
            ),
            (
                Response::UploadSegment { toggle: true, last: true, data: Bytes::EMPTY },
                [0x1F, 0, 0, 0, 0, 0, 0, 0],
            ),
            (Response::InitiateDownload { at: AT }, [0x60, 0x41, 0x60, 0x02, 0, 0, 0, 0]),
            (Response::DownloadSegment { toggle: true }, [0x30, 0, 0, 0, 0, 0, 0, 0]),
            (
                Response::Abort { at: AT, code: AbortCode::NO_OBJECT },
                [0x80, 0x41, 0x60, 0x02, 0, 0, 0x02, 0x06],
            ),
            (
                Response::InitiateBlockDownload { at: AT, crc: true, block_size: 16 },
                [0xA4, 0x41, 0x60, 0x02, 16, 0, 0, 0],
            ),
            (Response::AckBlockDownload { sequence: 16, block_size: 4 }, [0xA2, 16, 4, 0, 0, 0, 0, 0]),
            (Response::EndBlockDownload, [0xA1, 0, 0, 0, 0, 0, 0, 0]),
            (
                Response::InitiateBlockUpload { at: AT, crc: false, size: None },
                [0xC0, 0x41, 0x60, 0x02, 0, 0, 0, 0],
            ),
            (Response::EndBlockUpload { unused: 6, crc: 0xABCD }, [0xD9, 0xCD, 0xAB, 0, 0, 0, 0, 0]),
        ] {
            assert_eq!(response.encode(), bytes, "{response:?}");
            assert_eq!(Response::parse(&bytes), Ok(response));
        }
    }

    #[test]
    fn garbage_in_unused_places_is_not_seen() {
        assert_eq!(
            Request::parse(&[0x5F, 0x41, 0x60, 0x02, 0xDE, 0xAD, 0xBE, 0xEF]),
            Ok(Request::InitiateUpload { at: AT })
        );
        assert_eq!(
            Response::parse(&[0x5F, 0x41, 0x60, 0x02, 7, 0xAD, 0xBE, 0xEF]),
            Ok(Response::InitiateUpload { at: AT, content: Content::Expedited(short(&[7])) })
        );
        assert_eq!(
            Response::parse(&[0x0D, 7, 0xAD, 0xBE, 0xEF, 1, 2, 3]),
            Ok(Response::UploadSegment { toggle: false, last: true, data: short(&[7]) })
        );
    }

    #[test]
    fn short_frames() {
        assert_eq!(Request::parse(&[0x40, 0x41, 0x60, 0x02]), Ok(Request::InitiateUpload { at: AT }));
        assert_eq!(
            Response::parse(&[0x4B, 0x41, 0x60, 0x02, 0x40, 0x00]),
            Ok(Response::InitiateUpload { at: AT, content: Content::Expedited(short(&[0x40, 0])) })
        );
        assert_eq!(
            Response::parse(&[0x4B, 0x41, 0x60, 0x02, 0x40]),
            Err(MessageError::Short { command: 0x4B, expected: 6, found: 5 })
        );
        assert_eq!(Request::parse(&[]), Err(MessageError::Short { command: 0, expected: 1, found: 0 }));
        assert_eq!(Request::parse(&[0xFF; 8]), Err(MessageError::Command(0xFF)));
        assert_eq!(BlockSegment::parse(&[1, 2, 3]), None);
        assert_eq!(BlockSegment::parse(&[0x80, 0, 0, 0, 0, 0, 0, 0]), None);
    }
}
