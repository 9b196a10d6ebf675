//! SDO abort codes (CiA 301, 7.2.4.3.17, table "SDO abort codes").

use core::fmt;

/// Why one side ended an SDO transfer: UNSIGNED32, little-endian on the wire.
///
/// Manufacturers use codes that the standard does not name; those print as a number only.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AbortCode(pub u32);

macro_rules! abort_codes {
    ($($constant:ident = $value:literal, $text:literal;)*) => {
        impl AbortCode {
            $(#[doc = concat!("`", stringify!($value), "`: ", $text, ".")]
            pub const $constant: Self = Self($value);)*

            /// Every code that CiA 301 names, in ascending order.
            pub const ALL: &'static [Self] = &[$(Self::$constant),*];

            /// What CiA 301 says the code means; `None` for a code that it does not name.
            #[must_use]
            pub const fn text(self) -> Option<&'static str> {
                match self.0 {
                    $($value => Some($text),)*
                    _ => None,
                }
            }
        }
    };
}

abort_codes! {
    TOGGLE = 0x0503_0000, "toggle bit not alternated";
    TIMED_OUT = 0x0504_0000, "SDO protocol timed out";
    COMMAND = 0x0504_0001, "command specifier not valid or unknown";
    BLOCK_SIZE = 0x0504_0002, "invalid block size";
    SEQUENCE = 0x0504_0003, "invalid sequence number";
    CRC = 0x0504_0004, "CRC error";
    OUT_OF_MEMORY = 0x0504_0005, "out of memory";
    UNSUPPORTED_ACCESS = 0x0601_0000, "unsupported access to an object";
    WRITE_ONLY = 0x0601_0001, "attempt to read a write only object";
    READ_ONLY = 0x0601_0002, "attempt to write a read only object";
    NO_OBJECT = 0x0602_0000, "object does not exist in the object dictionary";
    NOT_MAPPABLE = 0x0604_0041, "object cannot be mapped to the PDO";
    PDO_LENGTH = 0x0604_0042, "number and length of the objects to be mapped would exceed PDO length";
    INCOMPATIBLE_PARAMETER = 0x0604_0043, "general parameter incompatibility";
    INCOMPATIBLE_DEVICE = 0x0604_0047, "general internal incompatibility in the device";
    HARDWARE = 0x0606_0000, "access failed due to a hardware error";
    LENGTH = 0x0607_0010, "data type does not match, length of service parameter does not match";
    TOO_LONG = 0x0607_0012, "data type does not match, length of service parameter too high";
    TOO_SHORT = 0x0607_0013, "data type does not match, length of service parameter too low";
    NO_SUB_INDEX = 0x0609_0011, "sub-index does not exist";
    INVALID_VALUE = 0x0609_0030, "invalid value for parameter";
    TOO_HIGH = 0x0609_0031, "value of parameter written too high";
    TOO_LOW = 0x0609_0032, "value of parameter written too low";
    MAX_BELOW_MIN = 0x0609_0036, "maximum value is less than minimum value";
    NO_SDO = 0x060A_0023, "resource not available: SDO connection";
    GENERAL = 0x0800_0000, "general error";
    CANNOT_STORE = 0x0800_0020, "data cannot be transferred or stored to the application";
    LOCAL_CONTROL = 0x0800_0021, "data cannot be transferred or stored because of local control";
    DEVICE_STATE = 0x0800_0022, "data cannot be transferred or stored because of the present device state";
    NO_DICTIONARY = 0x0800_0023, "object dictionary dynamic generation failed or no object dictionary present";
    NO_DATA = 0x0800_0024, "no data available";
}

/// Text and number: `object does not exist in the object dictionary (06020000h)`.
impl fmt::Display for AbortCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({:08X}h)", self.text().unwrap_or("unknown abort code"), self.0)
    }
}

impl fmt::Debug for AbortCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "AbortCode({:08X}h: {})", self.0, self.text().unwrap_or("unknown"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn codes_ascend_and_have_texts() {
        assert_eq!(AbortCode::ALL.len(), 31);
        assert!(AbortCode::ALL.is_sorted_by(|a, b| a < b));
        assert!(AbortCode::ALL.iter().all(|code| code.text().is_some()));
        assert_eq!(AbortCode(0x0602_0000), AbortCode::NO_OBJECT);
        assert_eq!(AbortCode(0x1234_5678).to_string(), "unknown abort code (12345678h)");
    }
}
