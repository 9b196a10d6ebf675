//! PDO parameters as they are learned, and the values that a mapping finds in a frame.

use alloc::vec::Vec;

use pdo::Address;

/// Most objects in one PDO (CiA 301, 7.5.2.36).
const MAX_OBJECTS: u8 = 64;

/// Which way a PDO goes, from the device's view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PdoDirection {
    /// TPDO: the device sends it.
    Transmit,
    /// RPDO: the device listens to it.
    Receive,
}

/// One object of a mapping.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Mapped {
    /// Index.
    pub index: u16,
    /// Sub-index.
    pub sub: u8,
    /// Length in bits, 1…64.
    pub bits: u8,
}

impl Mapped {
    /// From an entry of a mapping object: index, sub-index, length (CiA 301, 7.5.2.36).
    #[must_use]
    pub const fn from_entry(entry: u32) -> Self {
        Self { index: (entry >> 16) as u16, sub: (entry >> 8) as u8, bits: entry as u8 }
    }

    /// Where the object lies.
    #[must_use]
    pub const fn address(self) -> Address {
        Address::new(self.index, self.sub)
    }
}

/// What is known of one PDO.
#[derive(Debug, Default)]
pub(super) struct PdoState {
    /// The identifier that the traffic gave it, where it is valid and has 11 bits.
    pub(super) id: Option<u16>,
    /// How many objects count; `None` while nobody has said.
    count: Option<u8>,
    objects: Vec<Mapped>,
}

impl PdoState {
    /// The value of a mapping object's sub-index.
    pub(super) fn learn_mapping(&mut self, sub: u8, value: &[u8]) {
        match (sub, value) {
            (0, &[count, ..]) => self.count = Some(count.min(MAX_OBJECTS)),
            (1..=MAX_OBJECTS, value) => {
                let Some(&entry) = value.first_chunk::<4>() else { return };
                let at = usize::from(sub) - 1;
                if self.objects.len() <= at {
                    self.objects.resize(at + 1, Mapped::default());
                }
                if let Some(object) = self.objects.get_mut(at) {
                    *object = Mapped::from_entry(u32::from_le_bytes(entry));
                }
            }
            _ => {}
        }
    }

    /// The objects that count; none where the mapping is not known whole.
    pub(super) fn objects(&self) -> &[Mapped] {
        let count = self.count.map_or(self.objects.len(), usize::from);
        match self.objects.get(..count) {
            Some(objects) if objects.iter().all(|object| object.bits != 0) => objects,
            _ => &[],
        }
    }
}

/// The value of one mapped object in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// The object.
    pub object: Mapped,
    /// Its bits, the rest 0.
    pub raw: u64,
}

/// The values of a PDO, in the order of its mapping. Ends where the frame ends.
#[derive(Debug, Clone)]
pub struct Fields<'a> {
    objects: core::slice::Iter<'a, Mapped>,
    data: &'a [u8],
    bit: usize,
}

impl<'a> Fields<'a> {
    pub(super) fn new(objects: &'a [Mapped], data: &'a [u8]) -> Self {
        Self { objects: objects.iter(), data, bit: 0 }
    }

    /// The objects that are mapped from here on, also those that the frame is too short for.
    #[must_use]
    pub fn objects(&self) -> &'a [Mapped] {
        self.objects.as_slice()
    }
}

impl Iterator for Fields<'_> {
    type Item = Field;

    fn next(&mut self) -> Option<Field> {
        let object = *self.objects.next()?;
        let bits = usize::from(object.bits);
        if bits > 64 || self.bit + bits > self.data.len() * 8 {
            self.objects = [].iter();
            return None;
        }
        let mut raw = 0;
        for bit in 0..bits {
            let at = self.bit + bit;
            let byte = self.data.get(at / 8).copied().unwrap_or(0);
            raw |= u64::from(byte >> (at % 8) & 1) << bit;
        }
        self.bit += bits;
        Some(Field { object, raw })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_are_packed_bit_by_bit() {
        let objects = [
            Mapped { index: 0x6000, sub: 1, bits: 3 },
            Mapped { index: 0x6000, sub: 2, bits: 13 },
            Mapped { index: 0x6041, sub: 0, bits: 16 },
            Mapped { index: 0x6064, sub: 0, bits: 32 },
        ];
        let data = [0b1010_1101, 0xFF, 0x34, 0x12, 1, 2];
        let values: Vec<u64> = Fields::new(&objects, &data).map(|field| field.raw).collect();
        assert_eq!(values, [5, 0x1FF5, 0x1234]);
        assert_eq!(Fields::new(&objects, &data).objects(), objects);
    }

    #[test]
    fn a_mapping_counts_when_it_is_whole() {
        let mut pdo = PdoState::default();
        pdo.learn_mapping(1, &[0x10, 0, 0x41, 0x60]);
        assert_eq!(pdo.objects(), [Mapped { index: 0x6041, sub: 0, bits: 16 }]);
        pdo.learn_mapping(0, &[3]);
        pdo.learn_mapping(3, &[0x20, 0, 0x64, 0x60]);
        assert_eq!(pdo.objects(), []);
        pdo.learn_mapping(2, &[0x08, 0, 0x61, 0x60]);
        assert_eq!(pdo.objects().len(), 3);
        pdo.learn_mapping(0, &[0]);
        assert_eq!(pdo.objects(), []);
    }
}
