//! What clients send.

use pdo::Address;

use super::super::AbortCode;
use super::word::{
    Raw, bit, crc_bit, toggle_bit, with_address, with_block_size, with_confirmation, with_content, with_end,
    with_segment,
};
use super::{ABORT, Bytes, Content, MessageError, SEGMENT};

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
    // Where it is used, the variant is known: a few instructions, less than a call.
    #[must_use]
    #[inline(always)]
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
        let expedited = |bytes| Content::Expedited { data: short(bytes), sized: true };
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
                Request::InitiateDownload {
                    at: AT,
                    content: Content::Expedited { data: short(&[1, 2, 3, 4]), sized: false },
                },
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
}
