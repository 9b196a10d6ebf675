//! Code spaces that others may extend: command IDs, status values, parameter types.
//!
//! Each is a newtype over the byte on the wire with named constants and a text, in one table with
//! the clause of manual B beside it.

use core::fmt;

macro_rules! codes {
    ($(#[$doc:meta])* $name:ident, $unknown:literal { $($constant:ident = $value:literal, $text:literal;)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub u8);

        impl $name {
            $(#[doc = $text] pub const $constant: Self = Self($value);)*

            /// Every code that the documents name, in ascending order.
            pub const ALL: &'static [Self] = &[$(Self::$constant),*];

            /// What the documents say the code means; `None` for a code that they do not name.
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
    /// Command ID of the configuration module, bits 15…8 of its control word (manual B 7.1.2).
    Command, "unknown command" {
        NO_OPERATION = 0x00, "no operation";
        READ_ROM = 0x10, "read ROM value of parameter by UPID";
        READ_RAM = 0x11, "read RAM value of parameter by UPID";
        WRITE_ROM = 0x12, "write ROM value of parameter by UPID";
        WRITE_RAM = 0x13, "write RAM value of parameter by UPID";
        WRITE_BOTH = 0x14, "write RAM and ROM value of parameter by UPID";
        READ_MINIMUM = 0x15, "get minimal value of parameter by UPID";
        READ_MAXIMUM = 0x16, "get maximal value of parameter by UPID";
        READ_DEFAULT = 0x17, "get default value of parameter by UPID";
        START_LIST = 0x20, "start getting UPID list";
        NEXT_ITEM = 0x21, "get next UPID list item";
        START_MODIFIED = 0x22, "start getting modified UPID list";
        NEXT_MODIFIED = 0x23, "get next modified UPID list item";
        RESTART = 0x30, "restart drive";
        DEFAULT_OS = 0x31, "set parameter ROM values to default, OS software";
        DEFAULT_MC = 0x32, "set parameter ROM values to default, MC software";
        DEFAULT_INTERFACE = 0x33, "set parameter ROM values to default, interface software";
        DEFAULT_APPLICATION = 0x34, "set parameter ROM values to default, application software";
        STOP = 0x35, "stop MC and application software (for flash access)";
        START = 0x36, "start MC and application software";
        SAVE_CURVES = 0x40, "save all curves from RAM to flash";
        DELETE_CURVES = 0x41, "delete all curves (RAM)";
        ADD_CURVE = 0x50, "start adding curve (RAM)";
        ADD_CURVE_INFO = 0x51, "add curve info block (RAM)";
        ADD_CURVE_DATA = 0x52, "add curve data (RAM)";
        MODIFY_CURVE = 0x53, "start modifying curve (RAM)";
        MODIFY_CURVE_INFO = 0x54, "modify curve info block (RAM)";
        MODIFY_CURVE_DATA = 0x55, "modify curve data (RAM)";
        GET_CURVE = 0x60, "start getting curve (RAM)";
        GET_CURVE_INFO = 0x61, "get curve info block (RAM)";
        GET_CURVE_DATA = 0x62, "get curve data (RAM)";
        ERROR_COUNTS = 0x70, "get error log entry counter";
        ERROR_CODE = 0x71, "get error log entry error code";
        ERROR_TIME_LOW = 0x72, "get error log entry time low";
        ERROR_TIME_HIGH = 0x73, "get error log entry time high";
        ERROR_TEXT = 0x74, "get error code text stringlet";
        SAVE_TABLE = 0x80, "command table: save to flash";
        CLEAR_TABLE = 0x81, "command table: delete all entries (RAM)";
        DELETE_ENTRY = 0x82, "command table: delete entry";
        WRITE_ENTRY = 0x83, "command table: write entry";
        WRITE_ENTRY_DATA = 0x84, "command table: write entry data";
        GET_ENTRY = 0x85, "command table: get entry";
        GET_ENTRY_DATA = 0x86, "command table: get entry data";
        PRESENCE_0 = 0x87, "get presence list of entries 0..31 from RAM";
        PRESENCE_1 = 0x88, "get presence list of entries 32..63 from RAM";
        PRESENCE_2 = 0x89, "get presence list of entries 64..95 from RAM";
        PRESENCE_3 = 0x8A, "get presence list of entries 96..127 from RAM";
        PRESENCE_4 = 0x8B, "get presence list of entries 128..159 from RAM";
        PRESENCE_5 = 0x8C, "get presence list of entries 160..191 from RAM";
        PRESENCE_6 = 0x8D, "get presence list of entries 192..223 from RAM";
        PRESENCE_7 = 0x8E, "get presence list of entries 224..255 from RAM";
    }
}

codes! {
    /// Status of a command, bits 15…8 of the module's status word (manual B 7.2.1; D7h from the
    /// LinRS manual). D0h and D4h have a second meaning in the CANopen and curve chapters.
    Status, "unknown status" {
        OK = 0x00, "OK, done";
        RUNNING = 0x02, "command running, busy";
        NOT_FINISHED = 0x04, "block not finished";
        BUSY = 0x05, "busy";
        UPID = 0xC0, "UPID error";
        TYPE = 0xC1, "parameter type error";
        RANGE = 0xC2, "range error";
        USAGE = 0xC3, "address usage error";
        NO_START = 0xC5, "next UPID list item without start getting UPID list";
        END = 0xC6, "end of UPID list reached";
        ODD_ADDRESS = 0xD0, "odd address, or block already finished";
        SIZE = 0xD1, "size error";
        DEFINED = 0xD4, "curve already defined or not present, or invalid entry number";
        NOT_STOPPED = 0xD7, "MC software not stopped";
    }
}

impl Command {
    /// Whether it reads and changes nothing that the drive keeps.
    #[must_use]
    pub const fn is_reading(self) -> bool {
        matches!(self.0, 0x00 | 0x10 | 0x11 | 0x15..=0x17 | 0x20..=0x23 | 0x60..=0x62 | 0x70..=0x74 | 0x85..=0x8E)
    }
}

impl Status {
    /// 00h and 04h: the command was carried out.
    #[must_use]
    pub const fn is_done(self) -> bool {
        matches!(self, Self::OK | Self::NOT_FINISHED)
    }

    /// 02h and 05h: another status will follow.
    #[must_use]
    pub const fn is_running(self) -> bool {
        matches!(self, Self::RUNNING | Self::BUSY)
    }
}

codes! {
    /// Type of a parameter (LinRS manual, "get parameter type").
    ParameterType, "unknown type" {
        BOOL = 0x00, "BOOL";
        U8 = 0x01, "U8";
        S8 = 0x02, "S8";
        U16 = 0x03, "U16";
        S16 = 0x04, "S16";
        U32 = 0x05, "U32";
        S32 = 0x06, "S32";
        FLOAT = 0x07, "float";
        STRING = 0x08, "STRING";
        CAP_DIR = 0x09, "CAP_DIR";
        RADIO_DIR_BIT = 0x0A, "RADIO_DIR_BIT";
        RADIO_DIR16 = 0x0B, "RADIO_DIR16";
        ENUM_DIR8 = 0x0C, "ENUM_DIR8";
        ENUM_DIR16 = 0x0D, "ENUM_DIR16";
        STRINGLET = 0x0E, "STRINGLET";
        CAP_DIRLET = 0x0F, "CAP_DIRLET";
    }
}

impl ParameterType {
    /// The bits of a 32-bit access that belong to a parameter of this type; the drive filters out
    /// the others (manual B 2.5).
    #[must_use]
    pub const fn mask(self) -> u32 {
        match self {
            Self::BOOL | Self::RADIO_DIR_BIT => 1,
            Self::U8 | Self::S8 | Self::ENUM_DIR8 => 0xFF,
            Self::U16 | Self::S16 | Self::RADIO_DIR16 | Self::ENUM_DIR16 => 0xFFFF,
            _ => u32::MAX,
        }
    }

    /// The number that a raw value means: signed types by their sign bit, others unsigned.
    #[must_use]
    pub const fn number(self, raw: u32) -> i64 {
        match self {
            Self::S8 => raw as u8 as i8 as i64,
            Self::S16 => raw as u16 as i16 as i64,
            Self::S32 => raw as i32 as i64,
            _ => (raw & self.mask()) as i64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::{format, vec::Vec};

    /// Manual B 7.1.2 and 7.2.1, every line.
    #[test]
    fn commands_and_status_have_the_manuals_numbers() {
        let commands: Vec<u8> = Command::ALL.iter().map(|c| c.0).collect();
        let mut expected: Vec<u8> = [0x00].into();
        for range in [
            0x10..=0x17,
            0x20..=0x23,
            0x30..=0x36,
            0x40..=0x41,
            0x50..=0x55,
            0x60..=0x62,
            0x70..=0x74,
            0x80..=0x8E,
        ] {
            expected.extend(range);
        }
        assert_eq!(commands, expected);
        let status: Vec<u8> = Status::ALL.iter().map(|s| s.0).collect();
        assert_eq!(status, [0, 2, 4, 5, 0xC0, 0xC1, 0xC2, 0xC3, 0xC5, 0xC6, 0xD0, 0xD1, 0xD4, 0xD7]);
        assert_eq!(format!("{:?}", Status::END), "Status(C6h: end of UPID list reached)");
        assert_eq!(format!("{}", Status(0x77)), "unknown status");
        assert_eq!(ParameterType::ALL.len(), 16);
    }

    #[test]
    fn types_filter_their_bits() {
        assert_eq!(ParameterType::S16.number(0xFFFF_FFFE), -2);
        assert_eq!(ParameterType::U16.number(0xFFFF_FFFE), 0xFFFE);
        assert_eq!(ParameterType::S32.number(0xFFFF_FEDC), -292);
        assert_eq!(ParameterType::BOOL.mask(), 1);
    }
}
