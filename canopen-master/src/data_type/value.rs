//! Values of any type.

use core::fmt;

use super::scalar::exactly;
use super::{DataType, Kind, LengthError, Scalar, TimeOfDay};
use crate::sdo::message::load;

/// A value of any type of CiA 301, borrowed where it has no fixed length.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Value<'a> {
    /// BOOLEAN.
    Boolean(bool),
    /// INTEGER8…INTEGER64.
    Signed(i64),
    /// UNSIGNED8…UNSIGNED64.
    Unsigned(u64),
    /// REAL32.
    Real32(f32),
    /// REAL64.
    Real64(f64),
    /// VISIBLE_STRING: ISO 646; devices also send ISO 8859-1 or UTF-8.
    VisibleString(&'a [u8]),
    /// OCTET_STRING.
    OctetString(&'a [u8]),
    /// UNICODE_STRING: UTF-16, little-endian.
    UnicodeString(&'a [u8]),
    /// TIME_OF_DAY.
    TimeOfDay(TimeOfDay),
    /// TIME_DIFFERENCE, which has the form of a time of day.
    TimeDifference(TimeOfDay),
    /// DOMAIN, and every type that is not known here.
    Domain(&'a [u8]),
}

/// Why a value cannot be written as a type.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ValueError {
    /// A number outside of the type's range.
    #[error("number out of the range of {0}")]
    Range(DataType),
    /// Another kind of value.
    #[error("not a value of {0}")]
    Kind(DataType),
    /// The caller's buffer is too small.
    #[error("{needed} bytes needed, room for {room}")]
    Room {
        /// Bytes of the value.
        needed: usize,
        /// Bytes of the buffer.
        room: usize,
    },
}

impl<'a> Value<'a> {
    /// Reads the bytes of an object of this type.
    ///
    /// # Errors
    /// [`LengthError`] if the type has another length.
    pub fn parse(data_type: DataType, bytes: &'a [u8]) -> Result<Self, LengthError> {
        Ok(match data_type.kind() {
            Kind::Boolean => Self::Boolean(bool::from_bytes(bytes)?),
            Kind::Unsigned(len) => Self::Unsigned(integer(data_type, len, bytes)?),
            Kind::Signed(len) => {
                let unused = 64 - 8 * u32::from(len);
                Self::Signed((integer(data_type, len, bytes)? << unused) as i64 >> unused)
            }
            Kind::Real(4) => Self::Real32(f32::from_bytes(bytes)?),
            Kind::Real(_) => Self::Real64(f64::from_bytes(bytes)?),
            Kind::VisibleString => Self::VisibleString(bytes),
            Kind::OctetString => Self::OctetString(bytes),
            Kind::UnicodeString => Self::UnicodeString(bytes),
            Kind::TimeOfDay => Self::TimeOfDay(TimeOfDay::parse(exactly(data_type, bytes)?)),
            Kind::TimeDifference => Self::TimeDifference(TimeOfDay::parse(exactly(data_type, bytes)?)),
            Kind::Domain | Kind::Other => Self::Domain(bytes),
        })
    }

    /// Writes the bytes of an object of this type to `out` and returns their number. Integers may be
    /// given signed or unsigned, as long as their number fits.
    ///
    /// # Errors
    /// [`ValueError`].
    pub fn encode(&self, data_type: DataType, out: &mut [u8]) -> Result<usize, ValueError> {
        let kind = data_type.kind();
        let range = || ValueError::Range(data_type);
        match (kind, *self) {
            (Kind::Boolean, Self::Boolean(value)) => put(out, &[u8::from(value)]),
            (Kind::Unsigned(len), Self::Unsigned(value)) => put_unsigned(data_type, len, value, out),
            (Kind::Unsigned(len), Self::Signed(value)) => {
                put_unsigned(data_type, len, u64::try_from(value).map_err(|_| range())?, out)
            }
            (Kind::Signed(len), Self::Signed(value)) => put_signed(data_type, len, value, out),
            (Kind::Signed(len), Self::Unsigned(value)) => {
                put_signed(data_type, len, i64::try_from(value).map_err(|_| range())?, out)
            }
            (Kind::Real(4), Self::Real32(value)) => put(out, &value.to_le_bytes()),
            (Kind::Real(8), Self::Real64(value)) => put(out, &value.to_le_bytes()),
            (Kind::TimeOfDay, Self::TimeOfDay(value)) => put(out, &value.encode()),
            (Kind::TimeDifference, Self::TimeDifference(value)) => put(out, &value.encode()),
            (Kind::VisibleString, Self::VisibleString(bytes))
            | (Kind::OctetString, Self::OctetString(bytes))
            | (Kind::UnicodeString, Self::UnicodeString(bytes))
            | (Kind::Domain | Kind::Other, Self::Domain(bytes)) => put(out, bytes),
            _ => Err(ValueError::Kind(data_type)),
        }
    }
}

fn integer(data_type: DataType, len: u8, bytes: &[u8]) -> Result<u64, LengthError> {
    if bytes.len() != usize::from(len) {
        return Err(LengthError { data_type, expected: len, found: bytes.len() });
    }
    Ok(load(bytes))
}

fn put_unsigned(data_type: DataType, len: u8, value: u64, out: &mut [u8]) -> Result<usize, ValueError> {
    if value.checked_shr(8 * u32::from(len)).unwrap_or(0) != 0 {
        return Err(ValueError::Range(data_type));
    }
    put(out, value.to_le_bytes().get(..usize::from(len)).unwrap_or(&[]))
}

fn put_signed(data_type: DataType, len: u8, value: i64, out: &mut [u8]) -> Result<usize, ValueError> {
    let unused = 64 - 8 * u32::from(len);
    if value << unused >> unused != value {
        return Err(ValueError::Range(data_type));
    }
    put(out, value.to_le_bytes().get(..usize::from(len)).unwrap_or(&[]))
}

fn put(out: &mut [u8], bytes: &[u8]) -> Result<usize, ValueError> {
    let room = out.len();
    out.get_mut(..bytes.len()).ok_or(ValueError::Room { needed: bytes.len(), room })?.copy_from_slice(bytes);
    Ok(bytes.len())
}

/// Numbers in decimal, strings as text (bytes that are none as `.`), octets and domains in hexadecimal.
impl fmt::Display for Value<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Boolean(value) => value.fmt(f),
            Self::Signed(value) => value.fmt(f),
            Self::Unsigned(value) => value.fmt(f),
            Self::Real32(value) => value.fmt(f),
            Self::Real64(value) => value.fmt(f),
            Self::VisibleString(bytes) => {
                let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
                let text = bytes.get(..end).unwrap_or(&[]);
                text.iter().try_for_each(|&byte| {
                    let printable = matches!(byte, b' '..=b'~');
                    fmt::Write::write_char(f, if printable { char::from(byte) } else { '.' })
                })
            }
            Self::UnicodeString(bytes) => {
                let units = bytes.chunks_exact(2).map(|pair| match *pair {
                    [low, high] => u16::from_le_bytes([low, high]),
                    _ => 0,
                });
                char::decode_utf16(units.take_while(|&unit| unit != 0))
                    .try_for_each(|c| fmt::Write::write_char(f, c.unwrap_or(char::REPLACEMENT_CHARACTER)))
            }
            Self::OctetString(bytes) | Self::Domain(bytes) => {
                bytes.iter().try_for_each(|byte| write!(f, "{byte:02X}"))
            }
            Self::TimeOfDay(time) => write!(f, "day {} + {} ms", time.days(), time.ms()),
            Self::TimeDifference(time) => write!(f, "{} d {} ms", time.days(), time.ms()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sdo::Small;
    use std::string::ToString;

    /// CiA 301, 7.1.4: sign extension of the odd lengths, little-endian.
    #[test]
    fn golden_integers() {
        for (data_type, bytes, value) in [
            (DataType::INTEGER24, &[0xFE, 0xFF, 0xFF][..], Value::Signed(-2)),
            (DataType::INTEGER40, &[0, 0, 0, 0, 0x80], Value::Signed(-(1 << 39))),
            (DataType::INTEGER56, &[1, 0, 0, 0, 0, 0, 0], Value::Signed(1)),
            (DataType::INTEGER64, &[0, 0, 0, 0, 0, 0, 0, 0x80], Value::Signed(i64::MIN)),
            (DataType::UNSIGNED24, &[0xFE, 0xFF, 0xFF], Value::Unsigned(0xFF_FFFE)),
            (DataType::UNSIGNED48, &[1, 2, 3, 4, 5, 6], Value::Unsigned(0x0605_0403_0201)),
            (DataType::UNSIGNED64, &[0xFF; 8], Value::Unsigned(u64::MAX)),
            (DataType::BOOLEAN, &[1], Value::Boolean(true)),
            (DataType::REAL32, &[0, 0, 0x80, 0x3F], Value::Real32(1.0)),
            (
                DataType::TIME_OF_DAY,
                &[4, 3, 2, 1, 6, 5],
                Value::TimeOfDay(TimeOfDay::new(0x0506, 0x0102_0304).unwrap()),
            ),
        ] {
            assert_eq!(Value::parse(data_type, bytes), Ok(value));
            let mut out = [0xA5; 8];
            assert_eq!(value.encode(data_type, &mut out), Ok(bytes.len()));
            assert_eq!(&out[..bytes.len()], bytes);
        }
        assert_eq!(
            Value::parse(DataType::INTEGER24, &[0; 4]),
            Err(LengthError { data_type: DataType::INTEGER24, expected: 3, found: 4 })
        );
    }

    #[test]
    fn ranges() {
        let mut out = [0; 8];
        let range = |data_type| Err(ValueError::Range(data_type));
        for (data_type, low, high) in [
            (DataType::INTEGER8, -128, 127),
            (DataType::INTEGER24, -(1 << 23), (1 << 23) - 1),
            (DataType::UNSIGNED24, 0, (1 << 24) - 1),
            (DataType::UNSIGNED56, 0, (1 << 56) - 1),
        ] {
            assert!(Value::Signed(low).encode(data_type, &mut out).is_ok());
            assert!(Value::Signed(high).encode(data_type, &mut out).is_ok());
            assert_eq!(Value::Signed(low - 1).encode(data_type, &mut out), range(data_type));
            assert_eq!(Value::Signed(high + 1).encode(data_type, &mut out), range(data_type));
        }
        assert_eq!(
            Value::Unsigned(1 << 63).encode(DataType::INTEGER64, &mut out),
            range(DataType::INTEGER64)
        );
        assert_eq!(
            Value::Boolean(true).encode(DataType::REAL32, &mut out),
            Err(ValueError::Kind(DataType::REAL32))
        );
        assert_eq!(
            Value::VisibleString(b"123456789").encode(DataType::VISIBLE_STRING, &mut out),
            Err(ValueError::Room { needed: 9, room: 8 })
        );
    }

    #[test]
    fn scalars_and_small() {
        assert_eq!(Small::from(-2i16).as_slice(), [0xFE, 0xFF]);
        assert_eq!(Small::from(-2i16).get::<i16>(), Ok(-2));
        assert_eq!(Small::from(1.5f64).get::<f64>(), Ok(1.5));
        assert_eq!(Small::from(true).get::<bool>(), Ok(true));
        assert_eq!(
            Small::from(7u32).get::<u16>(),
            Err(LengthError { data_type: DataType::UNSIGNED16, expected: 2, found: 4 })
        );
    }

    #[test]
    fn texts() {
        assert_eq!(Value::VisibleString(b"SD03\0\0").to_string(), "SD03");
        assert_eq!(Value::UnicodeString(&[0xFC, 0, 0x3D, 0xD8, 0x00, 0xDE, 0x41]).to_string(), "ü😀");
        assert_eq!(Value::Domain(&[1, 0xAB]).to_string(), "01AB");
        assert_eq!(DataType::TIME_OF_DAY.to_string(), "TIME_OF_DAY");
        assert_eq!(DataType(0x40).to_string(), "type 0040h");
    }
}
