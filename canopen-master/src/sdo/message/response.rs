//! What servers send.

use pdo::Address;

use super::super::AbortCode;
use super::word::{
    Raw, bit, crc_bit, toggle_bit, with_address, with_block_size, with_confirmation, with_content, with_end,
    with_segment,
};
use super::{ABORT, Bytes, Content, MessageError, SEGMENT};

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
    // Where it is used, the variant is known: a few instructions, less than a call.
    #[must_use]
    #[inline(always)]
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

#[cfg(test)]
mod tests {
    use super::*;

    const AT: Address = Address::new(0x6041, 0x02);

    fn short<const N: usize>(bytes: &[u8]) -> Bytes<N> {
        Bytes::new(bytes).unwrap()
    }

    /// CiA 301, 7.2.4.3: command bytes and positions.
    #[test]
    fn golden_responses() {
        for (response, bytes) in [
            (
                Response::InitiateUpload {
                    at: AT,
                    content: Content::Expedited { data: short(&[0x40, 0]), sized: true },
                },
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
}
