//! Code spaces that others may extend: error codes, failure numbers, loader values.
//!
//! Each is a newtype over the byte on the wire with named constants and a text, in one table with
//! the clause of manual A beside each line.

use core::fmt;

macro_rules! codes {
    ($(#[$doc:meta])* $name:ident, $unknown:literal { $($(#[$line:meta])* $constant:ident = $value:literal, $text:literal;)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub u8);

        impl $name {
            $($(#[$line])* pub const $constant: Self = Self($value);)*

            /// Every code that manual A names, in ascending order.
            pub const ALL: &'static [Self] = &[$(Self::$constant),*];

            /// What manual A says the code means; `None` for a code that it does not name.
            #[must_use]
            pub const fn text(self) -> Option<&'static str> {
                match self.0 {
                    $($value => Some($text),)*
                    _ => None,
                }
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(self.text().unwrap_or($unknown))
            }
        }

        impl fmt::Debug for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{}({:02X}h: {self})", stringify!($name), self.0)
            }
        }
    };
}

codes! {
    /// Code of the error telegram FFh (manual A, Appendix 1, "error telegram").
    ErrorCode, "unknown error code" {
        /// a) Transmission error.
        PARITY = 0x01, "parity error";
        /// a) Stop bit has the wrong polarity.
        STOP_BIT = 0x02, "stop bit error";
        /// a) Characters were overwritten before they were read.
        OVERWRITE = 0x03, "overwrite error";
        /// a) Check byte wrong, or transmission error.
        CHECK_BYTE = 0x04, "check byte error";
        /// a) Number byte not permitted for the function.
        NUMBER = 0x05, "number error";
        /// b) Function error.
        FUNCTION = 0x10, "wrong function number";
        /// b) Sub-function of CCh.
        SUB_FUNCTION = 0x20, "wrong sub-function number";
        /// b) Bank is not one of those the function knows.
        BANK = 0x21, "wrong flash/RAM bank number";
        /// b) Flash component faulty.
        FLASH_DELETE = 0x22, "flash delete error";
        /// b) Flash component faulty, or a cell written twice.
        FLASH_WRITE = 0x23, "flash write error";
        /// b) Flash is write protected.
        FLASH_PROTECTED = 0x24, "flash write protection";
        /// b) More than 128 values.
        TOO_MANY = 0x25, "number of values too large";
        /// b) Flash is written in words of two bytes.
        UNEVEN = 0x26, "uneven number";
        /// b) Offset and length pass the end of the bank (65536).
        RANGE = 0x27, "range overflow";
    }
}

impl ErrorCode {
    /// Whether the code tells of a transmission error (01h…05h): the telegram did not arrive as it
    /// was sent, the function was not carried out.
    #[must_use]
    pub const fn is_transmission(self) -> bool {
        matches!(self.0, 0x01..=0x05)
    }
}

codes! {
    /// Number of a stored failure (manual A 4.3.4.2 and Appendix 1, 50h).
    Failure, "unknown failure" {
        /// Following error above `[696]`.
        DELTA_S_MAX = 5, "DeltaS > DeltaS max.";
        /// Following error below `[702]`.
        DELTA_S_MIN = 6, "DeltaS < DeltaS min.";
        /// Serial line.
        STOP_BIT = 26, "stop bit error";
        /// Serial line.
        PARITY = 27, "parity error";
        /// Serial line.
        OVERWRITE = 34, "overwrite error";
        /// Serial line.
        CHECK_BYTE = 35, "check byte error";
        /// LB2: an 82h of the block came only once.
        REPEAT_MISSING = 39, "82h repeat missing (LB2)";
        /// LB2: number byte and received bytes do not agree.
        RECEIVE_COUNT = 40, "number of errors for the serial communication";
    }
}

codes! {
    /// Value that the loader returns to 32h and 33h: 00h OK, 01h…7Fh warning, 80h…FFh error
    /// (manual A, Appendix 1, 32h). The device's parameters decide which values there are.
    LoaderCode, "see the parameter" {
        /// The value was taken.
        OK = 0x00, "OK";
    }
}

impl LoaderCode {
    /// 01h…7Fh: the value was taken, with a remark.
    #[must_use]
    pub const fn is_warning(self) -> bool {
        matches!(self.0, 0x01..=0x7F)
    }

    /// 80h…FFh: the value was not taken.
    #[must_use]
    pub const fn is_error(self) -> bool {
        self.0 >= 0x80
    }
}

/// One entry of the failure list (50h).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StoredFailure {
    /// Axis that caused the failure, 1…6; 0 = system failure.
    pub axis: u8,
    /// What failed.
    pub failure: Failure,
}

/// A version as 41h and 43h send it: number before and after the separating point, both 16 bit,
/// low byte first. V5.15 is 5 and 15; V5.01 is 5 and 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Version {
    /// Before the separating point.
    pub version: u16,
    /// After the separating point, two digits.
    pub revision: u16,
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{:02}", self.version, self.revision)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::format;

    #[test]
    fn codes_have_the_manuals_numbers_and_texts() {
        let codes: alloc::vec::Vec<u8> = ErrorCode::ALL.iter().map(|c| c.0).collect();
        assert_eq!(codes, [1, 2, 3, 4, 5, 0x10, 0x20, 0x21, 0x22, 0x23, 0x24, 0x25, 0x26, 0x27]);
        let failures: alloc::vec::Vec<u8> = Failure::ALL.iter().map(|c| c.0).collect();
        assert_eq!(failures, [5, 6, 26, 27, 34, 35, 39, 40]);
        assert_eq!(format!("{:?}", ErrorCode(0x27)), "ErrorCode(27h: range overflow)");
        assert_eq!(format!("{}", Failure(99)), "unknown failure");
        assert_eq!(ErrorCode(0x99).text(), None);
        assert!(LoaderCode(0x7F).is_warning() && LoaderCode(0x80).is_error() && !LoaderCode::OK.is_warning());
        assert_eq!(format!("{}", Version { version: 5, revision: 1 }), "5.01");
    }
}
