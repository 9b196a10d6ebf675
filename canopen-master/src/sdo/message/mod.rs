//! The 8 bytes of an SDO frame as typed values (CiA 301, 7.2.4.3).
//!
//! Segments inside a block transfer have no command specifier; only the state of the transfer says
//! that a frame is one: [`BlockSegment`].
//!
//! Parsers do not look at reserved bits and bytes, nor at bytes that a length marks as unused: devices
//! leave garbage there. Frames shorter than 8 bytes are taken as far as what they say is complete.
//!
//! A message is one little-endian word inside: it is read and written with one access each.

mod bytes;
mod request;
mod response;
mod word;

pub use bytes::Bytes;
pub(crate) use bytes::{first, load, segment};
pub use request::Request;
pub use response::Response;

/// Data bytes of a segment.
pub const SEGMENT: usize = 7;

/// First byte of an abort in both directions.
pub(crate) const ABORT: u8 = 0x80;

/// What an initiate frame of a download or an initiate answer of an upload carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Content {
    /// All of it.
    Expedited {
        /// 1…4 bytes.
        data: Bytes<4>,
        /// Their number is indicated; if not, all 4 are sent, and the object's type says how many count.
        sized: bool,
    },
    /// Segments follow; in all so many bytes, if indicated.
    Segmented(Option<u32>),
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
        expected: u8,
        /// Bytes there are.
        found: u8,
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

#[cfg(test)]
mod tests {
    use super::*;
    use pdo::Address;

    const AT: Address = Address::new(0x6041, 0x02);

    fn short<const N: usize>(bytes: &[u8]) -> Bytes<N> {
        Bytes::new(bytes).unwrap()
    }

    #[test]
    fn garbage_in_unused_places_is_not_seen() {
        assert_eq!(
            Request::parse(&[0x5F, 0x41, 0x60, 0x02, 0xDE, 0xAD, 0xBE, 0xEF]),
            Ok(Request::InitiateUpload { at: AT })
        );
        assert_eq!(
            Response::parse(&[0x5F, 0x41, 0x60, 0x02, 7, 0xAD, 0xBE, 0xEF]),
            Ok(Response::InitiateUpload {
                at: AT,
                content: Content::Expedited { data: short(&[7]), sized: true }
            })
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
            Ok(Response::InitiateUpload {
                at: AT,
                content: Content::Expedited { data: short(&[0x40, 0]), sized: true }
            })
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
