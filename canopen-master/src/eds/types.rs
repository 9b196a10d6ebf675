//! The code spaces of an object's description: kind, access, PDO mapping, list.

use core::fmt;

use crate::data_type::{DataType, Kind};
use crate::od::Rights;

/// Kind of an object (CiA 301, 7.4.3, "object code").
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ObjectType(pub u8);

impl ObjectType {
    /// An object without data fields.
    pub const NULL: Self = Self(0);
    /// A large variable amount of data.
    pub const DOMAIN: Self = Self(2);
    /// Definition of a data type.
    pub const DEFTYPE: Self = Self(5);
    /// Definition of a record type.
    pub const DEFSTRUCT: Self = Self(6);
    /// A single value.
    pub const VAR: Self = Self(7);
    /// Fields of one data type; sub-index 0 is their number.
    pub const ARRAY: Self = Self(8);
    /// Fields of any data types; sub-index 0 is the highest sub-index.
    pub const RECORD: Self = Self(9);

    /// The standard's name of the code; `None` for one that it does not name.
    #[must_use]
    pub const fn name(self) -> Option<&'static str> {
        Some(match self {
            Self::NULL => "NULL",
            Self::DOMAIN => "DOMAIN",
            Self::DEFTYPE => "DEFTYPE",
            Self::DEFSTRUCT => "DEFSTRUCT",
            Self::VAR => "VAR",
            Self::ARRAY => "ARRAY",
            Self::RECORD => "RECORD",
            _ => return None,
        })
    }
}

impl fmt::Display for ObjectType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name() {
            Some(name) => f.write_str(name),
            None => write!(f, "object type {:X}h", self.0),
        }
    }
}

impl fmt::Debug for ObjectType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Length in bits of an integer or BOOLEAN; `None` for every other type.
pub(crate) const fn integer_bits(data_type: DataType) -> Option<u8> {
    match data_type.kind() {
        Kind::Boolean => Some(1),
        Kind::Signed(bytes) | Kind::Unsigned(bytes) => Some(bytes * 8),
        _ => None,
    }
}

/// Length in bits of a type of fixed length, as in a PDO mapping; `None` for strings, domains, records.
pub(crate) const fn length_in_bits(data_type: DataType) -> Option<u8> {
    match (data_type.kind(), data_type.size()) {
        (Kind::Boolean, _) => Some(1),
        (_, Some(bytes)) => Some(bytes * 8),
        _ => None,
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
    /// What it allows.
    #[must_use]
    pub const fn rights(self) -> Rights {
        match self {
            Self::ReadOnly => Rights::Ro,
            Self::WriteOnly => Rights::Wo,
            Self::ReadWrite => Rights::Rw,
            Self::ReadWriteInput => Rights::Rwr,
            Self::ReadWriteOutput => Rights::Rww,
            Self::Const => Rights::Const,
        }
    }

    /// How a file says that these are the rights.
    #[must_use]
    pub const fn of(rights: Rights) -> Self {
        match rights {
            Rights::Ro => Self::ReadOnly,
            Rights::Wo => Self::WriteOnly,
            Rights::Rw => Self::ReadWrite,
            Rights::Rwr => Self::ReadWriteInput,
            Rights::Rww => Self::ReadWriteOutput,
            Rights::Const => Self::Const,
        }
    }

    /// Whether SDO may read it.
    #[must_use]
    pub const fn can_read(self) -> bool {
        self.rights().can_read()
    }

    /// Whether SDO may write it.
    #[must_use]
    pub const fn can_write(self) -> bool {
        self.rights().can_write()
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
