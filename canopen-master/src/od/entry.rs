//! What one entry of the dictionary is.

use pdo::Address;

use crate::data_type::{DataType, Kind};
use crate::sdo::AbortCode;
use crate::sdo::message::load;

/// Who may do what with an entry (CiA 301, 7.4.3, "access").
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Rights {
    /// May be read; changes by itself.
    Ro,
    /// May be written.
    Wo,
    /// May be read and written.
    Rw,
    /// May be read; never changes.
    Const,
    /// May be read and written; process data that the device sends.
    Rwr,
    /// May be read and written; process data that the device receives.
    Rww,
}

impl Rights {
    /// Whether a client may read it.
    #[must_use]
    pub const fn can_read(self) -> bool {
        !matches!(self, Self::Wo)
    }

    /// Whether a client may write it.
    #[must_use]
    pub const fn can_write(self) -> bool {
        matches!(self, Self::Wo | Self::Rw | Self::Rwr | Self::Rww)
    }

    /// Whether an RPDO (else a TPDO) may carry an entry that may be mapped: what can be written, or read;
    /// `Rwr` only goes into a TPDO, `Rww` only into an RPDO.
    #[must_use]
    pub const fn can_map(self, rpdo: bool) -> bool {
        if rpdo {
            self.can_write() && !matches!(self, Self::Rwr)
        } else {
            self.can_read() && !matches!(self, Self::Rww)
        }
    }
}

/// The lowest and highest value of an integer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Limits {
    /// Anything below is refused with 06090032h.
    pub low: i64,
    /// Anything above is refused with 06090031h.
    pub high: i64,
}

impl Limits {
    /// Whether an integer of this type, as on the wire, is within them.
    ///
    /// # Errors
    /// [`AbortCode::TOO_HIGH`], [`AbortCode::TOO_LOW`].
    pub fn check(&self, data_type: DataType, value: &[u8]) -> Result<(), AbortCode> {
        let bits = load(value);
        let number = match data_type.kind() {
            Kind::Signed(_) => {
                let unused = 64 - 8 * value.len().clamp(1, 8);
                (bits << unused) as i64 >> unused
            }
            // Beyond what limits can say is too high for any.
            _ => i64::try_from(bits).map_err(|_| AbortCode::TOO_HIGH)?,
        };
        if number > self.high {
            return Err(AbortCode::TOO_HIGH);
        }
        if number < self.low { Err(AbortCode::TOO_LOW) } else { Ok(()) }
    }
}

/// The value at power-on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Initial<'a> {
    /// Of a scalar: as many low bytes as the type has. A negative number is given as `-1i64 as u64`,
    /// a real as its bits.
    Number(u64),
    /// Of a string or domain.
    Bytes(&'a [u8]),
}

/// Where the value is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// In the table: its initial value for ever.
    Constant,
    /// In memory; so many bytes of a type without fixed length.
    Memory {
        /// The most bytes, of a type without fixed length.
        capacity: u16,
    },
    /// The application reads and writes it: [`Hooks::read`](super::Hooks::read),
    /// [`Hooks::write`](super::Hooks::write).
    Application,
    /// 1010h: writing "save" stores the values.
    Store,
    /// 1011h: writing "load" restores the initial values.
    Restore,
}

/// One entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entry<'a> {
    /// Where it is.
    pub at: Address,
    /// Type of its value.
    pub data_type: DataType,
    /// Who may do what.
    pub rights: Rights,
    /// May be mapped into the PDOs that [`Rights::can_map`] says.
    pub mappable: bool,
    /// Kept by 1010h.
    pub stored: bool,
    /// Limits of an integer.
    pub limits: Option<&'a Limits>,
    /// Where the value is.
    pub place: Place,
    /// The value at power-on.
    pub initial: Initial<'a>,
}

impl<'a> Entry<'a> {
    /// A scalar in memory that can be read and written.
    #[must_use]
    pub const fn variable(index: u16, sub: u8, data_type: DataType, initial: u64) -> Self {
        Self {
            at: Address::new(index, sub),
            data_type,
            rights: Rights::Rw,
            mappable: false,
            stored: false,
            limits: None,
            place: Place::Memory { capacity: 0 },
            initial: Initial::Number(initial),
        }
    }

    /// A scalar that never changes.
    #[must_use]
    pub const fn constant(index: u16, sub: u8, data_type: DataType, value: u64) -> Self {
        let entry = Self::variable(index, sub, data_type, value);
        Self { rights: Rights::Const, place: Place::Constant, ..entry }
    }

    /// A text that never changes.
    #[must_use]
    pub const fn text(index: u16, sub: u8, text: &'a str) -> Self {
        let entry = Self::constant(index, sub, DataType::VISIBLE_STRING, 0);
        Self { initial: Initial::Bytes(text.as_bytes()), ..entry }
    }

    /// A string or domain of up to `capacity` bytes in memory.
    #[must_use]
    pub const fn string(index: u16, sub: u8, data_type: DataType, capacity: u16, initial: &'a [u8]) -> Self {
        let entry = Self::variable(index, sub, data_type, 0);
        Self { place: Place::Memory { capacity }, initial: Initial::Bytes(initial), ..entry }
    }

    /// A value that the application reads and writes.
    #[must_use]
    pub const fn application(index: u16, sub: u8, data_type: DataType, rights: Rights) -> Self {
        let entry = Self::variable(index, sub, data_type, 0);
        Self { rights, place: Place::Application, ..entry }
    }

    /// 1010h:`sub` (1…127).
    #[must_use]
    pub const fn store(sub: u8) -> Self {
        let entry = Self::variable(0x1010, sub, DataType::UNSIGNED32, 0);
        Self { place: Place::Store, ..entry }
    }

    /// 1011h:`sub` (1…127).
    #[must_use]
    pub const fn restore(sub: u8) -> Self {
        let entry = Self::variable(0x1011, sub, DataType::UNSIGNED32, 0);
        Self { place: Place::Restore, ..entry }
    }

    /// With these rights.
    #[must_use]
    pub const fn with_rights(self, rights: Rights) -> Self {
        Self { rights, ..self }
    }

    /// With limits.
    #[must_use]
    pub const fn with_limits(self, limits: &'a Limits) -> Self {
        Self { limits: Some(limits), ..self }
    }

    /// May be mapped into PDOs.
    #[must_use]
    pub const fn mappable(self) -> Self {
        Self { mappable: true, ..self }
    }

    /// Kept by 1010h.
    #[must_use]
    pub const fn stored(self) -> Self {
        Self { stored: true, ..self }
    }

    /// Whether an RPDO (else a TPDO) may carry it.
    #[must_use]
    pub const fn is_mappable(&self, rpdo: bool) -> bool {
        self.mappable && self.rights.can_map(rpdo)
    }

    /// Bytes of the value in memory; of a type without fixed length its length before it (2 bytes).
    #[must_use]
    pub(super) const fn memory(&self) -> u16 {
        match (self.place, self.data_type.size()) {
            (Place::Memory { .. }, Some(size)) => size as u16,
            (Place::Memory { capacity }, None) => capacity.saturating_add(LENGTH),
            _ => 0,
        }
    }

    /// Whether the initial value fits the type and the memory.
    pub(super) const fn is_sound(&self) -> bool {
        let limits = match (self.limits, self.data_type.kind()) {
            (Some(limits), Kind::Signed(_) | Kind::Unsigned(_)) => limits.low <= limits.high,
            (Some(_), _) => false,
            (None, _) => true,
        };
        let value = match (self.initial, self.place, self.data_type.size()) {
            (_, Place::Application, _) | (Initial::Number(_), _, Some(_)) => true,
            (Initial::Bytes(bytes), Place::Memory { capacity }, None) => bytes.len() <= capacity as usize,
            (Initial::Bytes(_), Place::Constant, None) => true,
            _ => false,
        };
        limits && value
    }
}

/// Bytes that hold the length of a string.
pub(super) const LENGTH: u16 = 2;
