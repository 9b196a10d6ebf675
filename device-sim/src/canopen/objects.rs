//! The object dictionary of a virtual node.

use std::collections::BTreeMap;

use canopen_master::data_type::{DataType, Kind};
use canopen_master::sdo::AbortCode;
use pdo::Address;

/// What may be done with an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Rights {
    /// It can be read.
    pub read: bool,
    /// It can be written.
    pub write: bool,
    /// It can be mapped into TPDOs.
    pub transmit: bool,
    /// It can be mapped into RPDOs.
    pub receive: bool,
}

impl Rights {
    /// Read only.
    pub const RO: Self = Self { read: true, write: false, transmit: false, receive: false };
    /// Read and write.
    pub const RW: Self = Self { read: true, write: true, transmit: false, receive: false };
    /// Read only, in TPDOs.
    pub const TRANSMIT: Self = Self { read: true, write: false, transmit: true, receive: false };
    /// Read and write, in RPDOs.
    pub const RECEIVE: Self = Self { read: true, write: true, transmit: true, receive: true };
}

/// One object or sub-object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Its type.
    pub data_type: DataType,
    /// What may be done with it.
    pub rights: Rights,
    /// Its value as on the wire; of a type with fixed length, that length.
    pub value: Vec<u8>,
    /// Longest value, for types without fixed length.
    pub longest: usize,
    /// Limits of integers, lowest and highest.
    pub limits: Option<(i128, i128)>,
}

impl Entry {
    /// A number of `data_type`, cut to its length.
    #[must_use]
    pub fn number(data_type: DataType, rights: Rights, value: i128) -> Self {
        let mut entry = Self {
            data_type,
            rights,
            value: vec![0; usize::from(data_type.size().unwrap_or(4))],
            longest: 0,
            limits: None,
        };
        entry.set(value);
        entry
    }

    /// A read-only text.
    #[must_use]
    pub fn text(text: &str) -> Self {
        let value = text.as_bytes().to_vec();
        Self {
            data_type: DataType::VISIBLE_STRING,
            rights: Rights::RO,
            longest: value.len(),
            value,
            limits: None,
        }
    }

    /// An empty store that can be written with up to `longest` bytes.
    #[must_use]
    pub const fn domain(longest: usize) -> Self {
        Self { data_type: DataType::DOMAIN, rights: Rights::RW, value: Vec::new(), longest, limits: None }
    }

    /// The same with limits.
    #[must_use]
    pub const fn within(mut self, low: i128, high: i128) -> Self {
        self.limits = Some((low, high));
        self
    }

    /// The value as a number, signed as its type is; 0 for what is no number.
    #[must_use]
    pub fn get(&self) -> i128 {
        number(self.data_type, &self.value)
    }

    /// Sets the value to a number, cut to its length.
    pub fn set(&mut self, value: i128) {
        for (place, byte) in self.value.iter_mut().zip(value.to_le_bytes()) {
            *place = byte;
        }
    }

    /// Bits in a PDO; `None` if it does not fit into one.
    #[must_use]
    pub fn bits(&self) -> Option<u32> {
        match self.data_type.kind() {
            Kind::Boolean => Some(1),
            _ => u32::try_from(self.value.len() * 8).ok().filter(|bits| (1..=64).contains(bits)),
        }
    }

    /// Whether a value may be written, by length and limits.
    pub(super) fn check(&self, value: &[u8]) -> Result<(), AbortCode> {
        match self.data_type.size().map(usize::from) {
            Some(len) if value.len() > len => return Err(AbortCode::TOO_LONG),
            Some(len) if value.len() < len => return Err(AbortCode::TOO_SHORT),
            Some(_) => {}
            None if value.len() > self.longest => return Err(AbortCode::TOO_LONG),
            None => {}
        }
        let value = number(self.data_type, value);
        match self.limits {
            Some((_, high)) if value > high => Err(AbortCode::TOO_HIGH),
            Some((low, _)) if value < low => Err(AbortCode::TOO_LOW),
            _ => Ok(()),
        }
    }
}

fn number(data_type: DataType, bytes: &[u8]) -> i128 {
    let len = bytes.len().min(8);
    let raw = bytes.iter().take(8).rev().fold(0i128, |value, byte| value << 8 | i128::from(*byte));
    match data_type.kind() {
        Kind::Signed(_) if len > 0 && bytes.get(len - 1).is_some_and(|top| top & 0x80 != 0) => {
            raw - (1 << (8 * len))
        }
        _ => raw,
    }
}

/// All objects of a node.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Objects(BTreeMap<Address, Entry>);

impl Objects {
    /// Adds an object, or puts another one in its place.
    pub fn insert(&mut self, index: u16, sub: u8, entry: Entry) {
        self.0.insert(Address::new(index, sub), entry);
    }

    /// Adds an array or record: its number of entries at sub-index 0, and the entries from 1 on.
    pub fn insert_all(&mut self, index: u16, entries: impl IntoIterator<Item = Entry>) {
        let mut count = 0;
        for (entry, sub) in entries.into_iter().zip(1..) {
            self.insert(index, sub, entry);
            count = sub;
        }
        self.insert(index, 0, Entry::number(DataType::UNSIGNED8, Rights::RO, i128::from(count)));
    }

    /// An object.
    #[must_use]
    pub fn entry(&self, at: Address) -> Option<&Entry> {
        self.0.get(&at)
    }

    pub(super) fn entry_mut(&mut self, at: Address) -> Option<&mut Entry> {
        self.0.get_mut(&at)
    }

    /// All objects in order.
    pub fn iter(&self) -> impl Iterator<Item = (Address, &Entry)> {
        self.0.iter().map(|(at, entry)| (*at, entry))
    }

    /// An object as a number; 0 where there is none.
    #[must_use]
    pub fn get(&self, index: u16, sub: u8) -> i128 {
        self.entry(Address::new(index, sub)).map_or(0, Entry::get)
    }

    /// Sets an object to a number, whatever its rights; nothing happens where there is none.
    pub fn set(&mut self, index: u16, sub: u8, value: i128) {
        if let Some(entry) = self.entry_mut(Address::new(index, sub)) {
            entry.set(value);
        }
    }

    /// The abort code for an object that is not there: its index is not, or only its sub-index.
    pub(super) fn missing(&self, at: Address) -> AbortCode {
        let whole = Address::new(at.index, 0)..=Address::new(at.index, u8::MAX);
        if self.0.range(whole).next().is_some() { AbortCode::NO_SUB_INDEX } else { AbortCode::NO_OBJECT }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_sign_and_limits() {
        let mut speed = Entry::number(DataType::INTEGER24, Rights::RECEIVE, -2);
        assert_eq!(
            (speed.value.as_slice(), speed.get(), speed.bits()),
            (&[0xFE, 0xFF, 0xFF][..], -2, Some(24))
        );
        speed = speed.within(-5, 5);
        assert_eq!(speed.check(&[5, 0, 0]), Ok(()));
        assert_eq!(speed.check(&[6, 0, 0]), Err(AbortCode::TOO_HIGH));
        assert_eq!(speed.check(&[0xFA, 0xFF, 0xFF]), Err(AbortCode::TOO_LOW));
        assert_eq!(speed.check(&[0, 0]), Err(AbortCode::TOO_SHORT));
        assert_eq!(speed.check(&[0; 4]), Err(AbortCode::TOO_LONG));
    }

    #[test]
    fn what_is_missing() {
        let mut objects = Objects::default();
        objects.insert_all(0x1018, (1..=4).map(|n| Entry::number(DataType::UNSIGNED32, Rights::RO, n)));
        assert_eq!((objects.get(0x1018, 0), objects.get(0x1018, 4)), (4, 4));
        assert_eq!(objects.missing(Address::new(0x1018, 5)), AbortCode::NO_SUB_INDEX);
        assert_eq!(objects.missing(Address::new(0x1019, 0)), AbortCode::NO_OBJECT);
    }
}
