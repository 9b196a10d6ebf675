//! The code spaces of an object's description: kind, data type, access, PDO mapping.

use core::fmt;

/// Kind of an object (CiA 301, 7.4.3, "object code").
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ObjectType(pub u8);

macro_rules! table {
    ($name:ident, $kind:literal { $($(#[$doc:meta])* $constant:ident = $value:literal;)* }) => {
        impl $name {
            $($(#[$doc])* pub const $constant: Self = Self($value);)*

            /// Every code that has a name, in ascending order.
            pub const ALL: &'static [Self] = &[$(Self::$constant),*];

            /// The standard's name of the code; `None` for one that it does not name.
            #[must_use]
            pub const fn name(self) -> Option<&'static str> {
                match self.0 {
                    $($value => Some(stringify!($constant)),)*
                    _ => None,
                }
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                match self.name() {
                    Some(name) => f.write_str(name),
                    None => write!(f, concat!($kind, " {:X}h"), self.0),
                }
            }
        }

        impl fmt::Debug for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{self}")
            }
        }
    };
}

table! { ObjectType, "object type" {
    /// An object without data fields.
    NULL = 0;
    /// A large variable amount of data.
    DOMAIN = 2;
    /// Definition of a data type.
    DEFTYPE = 5;
    /// Definition of a record type.
    DEFSTRUCT = 6;
    /// A single value.
    VAR = 7;
    /// Fields of one data type; sub-index 0 is their number.
    ARRAY = 8;
    /// Fields of any data types; sub-index 0 is the highest sub-index.
    RECORD = 9;
} }

/// Data type by its index in the object dictionary (CiA 301, 7.4.7.1, table 44).
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct DataType(pub u16);

table! { DataType, "data type" {
    /// 1 bit.
    BOOLEAN = 0x01;
    /// 8 bits, signed.
    INTEGER8 = 0x02;
    /// 16 bits, signed.
    INTEGER16 = 0x03;
    /// 32 bits, signed.
    INTEGER32 = 0x04;
    /// 8 bits.
    UNSIGNED8 = 0x05;
    /// 16 bits.
    UNSIGNED16 = 0x06;
    /// 32 bits.
    UNSIGNED32 = 0x07;
    /// IEEE 754 single.
    REAL32 = 0x08;
    /// ASCII text.
    VISIBLE_STRING = 0x09;
    /// Bytes.
    OCTET_STRING = 0x0A;
    /// UTF-16 text.
    UNICODE_STRING = 0x0B;
    /// Milliseconds of the day and days since 1984-01-01, 48 bits.
    TIME_OF_DAY = 0x0C;
    /// Milliseconds and days, 48 bits.
    TIME_DIFFERENCE = 0x0D;
    /// Application data of any length.
    DOMAIN = 0x0F;
    /// 24 bits, signed.
    INTEGER24 = 0x10;
    /// IEEE 754 double.
    REAL64 = 0x11;
    /// 40 bits, signed.
    INTEGER40 = 0x12;
    /// 48 bits, signed.
    INTEGER48 = 0x13;
    /// 56 bits, signed.
    INTEGER56 = 0x14;
    /// 64 bits, signed.
    INTEGER64 = 0x15;
    /// 24 bits.
    UNSIGNED24 = 0x16;
    /// 40 bits.
    UNSIGNED40 = 0x18;
    /// 48 bits.
    UNSIGNED48 = 0x19;
    /// 56 bits.
    UNSIGNED56 = 0x1A;
    /// 64 bits.
    UNSIGNED64 = 0x1B;
    /// Record: PDO communication parameter.
    PDO_COMMUNICATION_PARAMETER = 0x20;
    /// Record: PDO mapping.
    PDO_MAPPING = 0x21;
    /// Record: SDO parameter.
    SDO_PARAMETER = 0x22;
    /// Record: identity.
    IDENTITY = 0x23;
} }

impl DataType {
    /// Length in bits of an integer or BOOLEAN; `None` for every other type.
    #[must_use]
    pub const fn integer_bits(self) -> Option<u8> {
        Some(match self {
            Self::BOOLEAN => 1,
            Self::INTEGER8 | Self::UNSIGNED8 => 8,
            Self::INTEGER16 | Self::UNSIGNED16 => 16,
            Self::INTEGER24 | Self::UNSIGNED24 => 24,
            Self::INTEGER32 | Self::UNSIGNED32 => 32,
            Self::INTEGER40 | Self::UNSIGNED40 => 40,
            Self::INTEGER48 | Self::UNSIGNED48 => 48,
            Self::INTEGER56 | Self::UNSIGNED56 => 56,
            Self::INTEGER64 | Self::UNSIGNED64 => 64,
            _ => return None,
        })
    }

    /// Length in bits of a type of fixed length; `None` for strings, domains, records.
    #[must_use]
    pub const fn bits(self) -> Option<u8> {
        match self {
            Self::REAL32 => Some(32),
            Self::REAL64 => Some(64),
            Self::TIME_OF_DAY | Self::TIME_DIFFERENCE => Some(48),
            _ => self.integer_bits(),
        }
    }

    /// Whether it is a signed integer.
    #[must_use]
    pub const fn is_signed(self) -> bool {
        matches!(self.0, 0x02..=0x04 | 0x10 | 0x12..=0x15)
    }
}

macro_rules! words {
    ($(#[$doc:meta])* $name:ident { $($(#[$line:meta])* $variant:ident = $word:literal;)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
        pub enum $name {
            $($(#[$line])* $variant,)*
        }

        impl $name {
            /// As it is written.
            #[must_use]
            pub const fn word(self) -> &'static str {
                match self { $(Self::$variant => $word,)* }
            }

            /// Reads the word, in upper or lower case.
            #[must_use]
            pub fn parse(text: &str) -> Option<Self> {
                $(if text.eq_ignore_ascii_case($word) { return Some(Self::$variant); })*
                None
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(self.word())
            }
        }
    };
}

words! {
    /// Who may read and write (CiA 306-1, 6.6.3.2, `AccessType`).
    Access {
        /// Read only.
        ReadOnly = "ro";
        /// Write only.
        WriteOnly = "wo";
        /// Read and write.
        ReadWrite = "rw";
        /// Read and write, a process input: mapped into TPDOs.
        ReadWriteInput = "rwr";
        /// Read and write, a process output: mapped into RPDOs.
        ReadWriteOutput = "rww";
        /// Read only, never changes.
        Const = "const";
    }
}

impl Access {
    /// Whether SDO may read it.
    #[must_use]
    pub const fn can_read(self) -> bool {
        !matches!(self, Self::WriteOnly)
    }

    /// Whether SDO may write it.
    #[must_use]
    pub const fn can_write(self) -> bool {
        !matches!(self, Self::ReadOnly | Self::Const)
    }
}

words! {
    /// Whether the value goes into PDOs (CiA 306-1, 6.6.3.2, `PDOMapping`; finer in CiA 311).
    PdoMapping {
        /// Not mappable.
        No = "no";
        /// Mappable; what `PDOMapping=1` of an EDS says.
        Optional = "optional";
        /// Mapped by default.
        Default = "default";
        /// Mappable into TPDOs only.
        Tpdo = "TPDO";
        /// Mappable into RPDOs only.
        Rpdo = "RPDO";
    }
}

impl PdoMapping {
    /// Whether it can be mapped at all.
    #[must_use]
    pub const fn is_mappable(self) -> bool {
        !matches!(self, Self::No)
    }
}

words! {
    /// The three lists of objects (CiA 306-1, 6.6.3.1).
    List {
        /// 1000h, 1001h, 1018h.
        Mandatory = "MandatoryObjects";
        /// 1000h…1FFFh and 6000h…FFFFh.
        Optional = "OptionalObjects";
        /// 2000h…5FFFh.
        Manufacturer = "ManufacturerObjects";
    }
}

impl List {
    /// All three in the order of a file.
    pub const ALL: [Self; 3] = [Self::Mandatory, Self::Optional, Self::Manufacturer];

    /// The list where the standard has the object.
    #[must_use]
    pub const fn of(index: u16) -> Self {
        match index {
            0x1000 | 0x1001 | 0x1018 => Self::Mandatory,
            0x2000..=0x5FFF => Self::Manufacturer,
            _ => Self::Optional,
        }
    }
}
