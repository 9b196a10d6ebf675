//! Scalars as Rust types.

use super::{DataType, TimeOfDay};
use crate::sdo::Small;

/// Another number of bytes than the type has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{data_type} has {expected} bytes, {found} came")]
pub struct LengthError {
    /// The type.
    pub data_type: DataType,
    /// Bytes of the type.
    pub expected: u8,
    /// Bytes there are.
    pub found: usize,
}

/// A Rust type whose values are those of a CiA 301 type of fixed length.
pub trait Scalar: Copy {
    /// Its code.
    const TYPE: DataType;

    /// From little-endian bytes, exactly as many as the type has.
    ///
    /// # Errors
    /// [`LengthError`] for another number of bytes.
    fn from_bytes(bytes: &[u8]) -> Result<Self, LengthError>;

    /// As little-endian bytes.
    fn to_small(self) -> Small;
}

#[inline]
pub(super) fn exactly<const N: usize>(data_type: DataType, bytes: &[u8]) -> Result<[u8; N], LengthError> {
    bytes.try_into().map_err(|_| LengthError { data_type, expected: N as u8, found: bytes.len() })
}

macro_rules! numbers {
    ($($number:ty = $data_type:ident;)*) => {$(
        impl Scalar for $number {
            const TYPE: DataType = DataType::$data_type;

            #[inline]
            fn from_bytes(bytes: &[u8]) -> Result<Self, LengthError> {
                exactly(Self::TYPE, bytes).map(Self::from_le_bytes)
            }

            #[inline]
            fn to_small(self) -> Small {
                Small::new(&self.to_le_bytes()).unwrap_or(Small::EMPTY)
            }
        }
    )*};
}

numbers! {
    i8 = INTEGER8;
    i16 = INTEGER16;
    i32 = INTEGER32;
    i64 = INTEGER64;
    u8 = UNSIGNED8;
    u16 = UNSIGNED16;
    u32 = UNSIGNED32;
    u64 = UNSIGNED64;
    f32 = REAL32;
    f64 = REAL64;
}

/// Any byte but 00h is true.
impl Scalar for bool {
    const TYPE: DataType = DataType::BOOLEAN;

    fn from_bytes(bytes: &[u8]) -> Result<Self, LengthError> {
        exactly(Self::TYPE, bytes).map(|[byte]: [u8; 1]| byte != 0)
    }

    fn to_small(self) -> Small {
        u8::from(self).to_small()
    }
}

impl Scalar for TimeOfDay {
    const TYPE: DataType = DataType::TIME_OF_DAY;

    fn from_bytes(bytes: &[u8]) -> Result<Self, LengthError> {
        exactly(Self::TYPE, bytes).map(Self::parse)
    }

    fn to_small(self) -> Small {
        Small::new(&self.encode()).unwrap_or(Small::EMPTY)
    }
}

impl Small {
    /// The value as a Rust type.
    ///
    /// # Errors
    /// [`LengthError`] if it has another number of bytes than the type.
    #[inline]
    pub fn get<T: Scalar>(&self) -> Result<T, LengthError> {
        T::from_bytes(self.as_slice())
    }
}

impl<T: Scalar> From<T> for Small {
    #[inline]
    fn from(value: T) -> Self {
        value.to_small()
    }
}
