//! The object dictionary of a virtual node.

use std::collections::BTreeMap;

use canopen_master::data_type::{DataType, Value};
use canopen_master::od::{Limits, Rights};
use canopen_master::sdo::AbortCode;
use pdo::Address;

/// One object or sub-object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Its type.
    pub data_type: DataType,
    /// Who may do what with it.
    pub rights: Rights,
    /// May be mapped into the PDOs that its rights allow.
    pub mappable: bool,
    /// Its value as on the wire; of a type with fixed length, that length.
    pub value: Vec<u8>,
    /// Longest value, for types without fixed length.
    pub longest: usize,
    /// Limits of an integer.
    pub limits: Option<Limits>,
}

impl Entry {
    /// A number of `data_type`, cut to its length.
    #[must_use]
    pub fn number(data_type: DataType, rights: Rights, value: i128) -> Self {
        let mut entry = Self {
            data_type,
            rights,
            mappable: false,
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
            rights: Rights::Const,
            mappable: false,
            longest: value.len(),
            value,
            limits: None,
        }
    }

    /// An empty store that can be written with up to `longest` bytes.
    #[must_use]
    pub const fn domain(longest: usize) -> Self {
        Self {
            data_type: DataType::DOMAIN,
            rights: Rights::Rw,
            mappable: false,
            value: Vec::new(),
            longest,
            limits: None,
        }
    }

    /// The same with limits.
    #[must_use]
    pub const fn within(mut self, low: i64, high: i64) -> Self {
        self.limits = Some(Limits { low, high });
        self
    }

    /// The same, that may be mapped into PDOs.
    #[must_use]
    pub const fn mappable(mut self) -> Self {
        self.mappable = true;
        self
    }

    /// The value as a number, signed as its type is; 0 for what is no number.
    #[must_use]
    pub fn get(&self) -> i128 {
        match Value::parse(self.data_type, &self.value) {
            Ok(Value::Signed(value)) => value.into(),
            Ok(Value::Unsigned(value)) => value.into(),
            Ok(Value::Boolean(value)) => value.into(),
            _ => 0,
        }
    }

    /// Sets the value to a number, cut to its length.
    pub fn set(&mut self, value: i128) {
        for (place, byte) in self.value.iter_mut().zip(value.to_le_bytes()) {
            *place = byte;
        }
    }

    /// The most bytes that it takes.
    pub(super) fn longest(&self) -> usize {
        self.data_type.size().map_or(self.longest, usize::from)
    }

    /// Whether a value may be written, by length and limits.
    pub(super) fn check(&self, value: &[u8]) -> Result<(), AbortCode> {
        if value.len() > self.longest() {
            return Err(AbortCode::TOO_LONG);
        }
        if self.data_type.size().is_some_and(|size| value.len() < size.into()) {
            return Err(AbortCode::TOO_SHORT);
        }
        self.limits.map_or(Ok(()), |limits| limits.check(self.data_type, value))
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
        self.insert(index, 0, Entry::number(DataType::UNSIGNED8, Rights::Ro, i128::from(count)));
    }

    /// Takes those away that are not to be kept.
    pub(super) fn retain(&mut self, mut keep: impl FnMut(Address) -> bool) {
        self.0.retain(|at, _| keep(*at));
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

    /// An object that a client asks for.
    ///
    /// # Errors
    /// Its index is not there, or only its sub-index.
    pub(super) fn found(&self, at: Address) -> Result<&Entry, AbortCode> {
        let whole = Address::new(at.index, 0)..=Address::new(at.index, u8::MAX);
        let others = || self.0.range(whole).next().is_some();
        self.entry(at).ok_or_else(|| if others() { AbortCode::NO_SUB_INDEX } else { AbortCode::NO_OBJECT })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_sign_and_limits() {
        let mut speed = Entry::number(DataType::INTEGER24, Rights::Rw, -2);
        assert_eq!((speed.value.as_slice(), speed.get()), (&[0xFE, 0xFF, 0xFF][..], -2));
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
        objects.insert_all(0x1018, (1..=4).map(|n| Entry::number(DataType::UNSIGNED32, Rights::Ro, n)));
        assert_eq!((objects.get(0x1018, 0), objects.get(0x1018, 4)), (4, 4));
        assert_eq!(objects.found(Address::new(0x1018, 5)), Err(AbortCode::NO_SUB_INDEX));
        assert_eq!(objects.found(Address::new(0x1019, 0)), Err(AbortCode::NO_OBJECT));
    }
}
