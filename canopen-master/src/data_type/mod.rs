//! The data types of CiA 301 (7.4.7): their codes, scalars as Rust types, and values of any type.
//!
//! All are little-endian on the wire.

mod scalar;
mod value;

use core::fmt;

pub use crate::time::TimeOfDay;
pub use scalar::{LengthError, Scalar};
pub use value::{Value, ValueError};

/// Code of a data type: the index of its entry in the object dictionary, 0001h…025Fh.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct DataType(pub u16);

/// What the bits of a type mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// 00h or 01h.
    Boolean,
    /// Two's complement of so many bytes.
    Signed(u8),
    /// So many bytes.
    Unsigned(u8),
    /// IEEE 754 of so many bytes.
    Real(u8),
    /// ISO 646 characters.
    VisibleString,
    /// Bytes.
    OctetString,
    /// UTF-16 code units.
    UnicodeString,
    /// Milliseconds after midnight and days since 1984-01-01.
    TimeOfDay,
    /// Milliseconds and days.
    TimeDifference,
    /// Bytes whose meaning the application knows.
    Domain,
    /// A record or a type this table does not know.
    Other,
}

macro_rules! types {
    ($($constant:ident = $value:literal, $kind:expr;)*) => {
        impl DataType {
            $(#[doc = concat!("Code ", stringify!($value), ".")]
            pub const $constant: Self = Self($value);)*

            /// Every type named here, in ascending order.
            pub const ALL: &'static [Self] = &[$(Self::$constant),*];

            /// Its name in CiA 301; `None` for another type.
            #[must_use]
            pub const fn name(self) -> Option<&'static str> {
                match self.0 {
                    $($value => Some(stringify!($constant)),)*
                    _ => None,
                }
            }

            /// What its bits mean.
            #[must_use]
            #[inline]
            pub const fn kind(self) -> Kind {
                match self.0 {
                    $($value => $kind,)*
                    _ => Kind::Other,
                }
            }
        }
    };
}

// CiA 301, table "object dictionary data types".
types! {
    BOOLEAN = 0x0001, Kind::Boolean;
    INTEGER8 = 0x0002, Kind::Signed(1);
    INTEGER16 = 0x0003, Kind::Signed(2);
    INTEGER32 = 0x0004, Kind::Signed(4);
    UNSIGNED8 = 0x0005, Kind::Unsigned(1);
    UNSIGNED16 = 0x0006, Kind::Unsigned(2);
    UNSIGNED32 = 0x0007, Kind::Unsigned(4);
    REAL32 = 0x0008, Kind::Real(4);
    VISIBLE_STRING = 0x0009, Kind::VisibleString;
    OCTET_STRING = 0x000A, Kind::OctetString;
    UNICODE_STRING = 0x000B, Kind::UnicodeString;
    TIME_OF_DAY = 0x000C, Kind::TimeOfDay;
    TIME_DIFFERENCE = 0x000D, Kind::TimeDifference;
    DOMAIN = 0x000F, Kind::Domain;
    INTEGER24 = 0x0010, Kind::Signed(3);
    REAL64 = 0x0011, Kind::Real(8);
    INTEGER40 = 0x0012, Kind::Signed(5);
    INTEGER48 = 0x0013, Kind::Signed(6);
    INTEGER56 = 0x0014, Kind::Signed(7);
    INTEGER64 = 0x0015, Kind::Signed(8);
    UNSIGNED24 = 0x0016, Kind::Unsigned(3);
    UNSIGNED40 = 0x0018, Kind::Unsigned(5);
    UNSIGNED48 = 0x0019, Kind::Unsigned(6);
    UNSIGNED56 = 0x001A, Kind::Unsigned(7);
    UNSIGNED64 = 0x001B, Kind::Unsigned(8);
    PDO_COMMUNICATION_PARAMETER = 0x0020, Kind::Other;
    PDO_MAPPING = 0x0021, Kind::Other;
    SDO_PARAMETER = 0x0022, Kind::Other;
    IDENTITY = 0x0023, Kind::Other;
}

impl DataType {
    /// Bytes of a value over SDO; `None` where it depends on the value.
    #[must_use]
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    pub const fn size(self) -> Option<u8> {
        match SIZES.split_at_checked(self.0 as usize) {
            Some((_, [size, ..])) if *size > 0 => Some(*size),
            _ => None,
        }
    }
}

/// Bytes of the types by code; 0 where it depends on the value.
const SIZES: [u8; 28] = {
    let mut sizes = [0; 28];
    let mut rest: &[DataType] = DataType::ALL;
    while let [data_type, tail @ ..] = rest {
        if let Some((_, [size, ..])) = sizes.split_at_mut_checked(data_type.0 as usize) {
            *size = match data_type.kind() {
                Kind::Boolean => 1,
                Kind::Signed(bytes) | Kind::Unsigned(bytes) | Kind::Real(bytes) => bytes,
                Kind::TimeOfDay | Kind::TimeDifference => 6,
                _ => 0,
            };
        }
        rest = tail;
    }
    sizes
};

impl fmt::Display for DataType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name() {
            Some(name) => f.write_str(name),
            None => write!(f, "type {:04X}h", self.0),
        }
    }
}

impl fmt::Debug for DataType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}
