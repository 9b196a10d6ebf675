//! Mappings: which objects lie where in a PDO (CiA 301, 7.5.2.36 and 7.5.2.38).

use core::fmt;

use crate::{Address, Bits, Payload};

/// The most entries of a mapping: 64 objects of one bit.
pub const MAX_ENTRIES: usize = 64;
/// The most bits of a PDO.
pub const MAX_BITS: u8 = 64;

/// One entry of a mapping: an object and its width.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Entry {
    /// The object. An index below 0020h is a data type: a dummy, which only takes room.
    pub at: Address,
    /// Width in bits, 1…64.
    pub bits: u8,
}

impl Entry {
    /// Object `index`:`sub` with `bits` bits.
    #[must_use]
    pub const fn new(index: u16, sub: u8, bits: u8) -> Self {
        Self { at: Address::new(index, sub), bits }
    }

    /// As written to 1600h and 1A00h: index in the upper 16 bits, sub-index, width.
    #[must_use]
    pub const fn raw(self) -> u32 {
        (self.at.index as u32) << 16 | (self.at.sub as u32) << 8 | self.bits as u32
    }

    /// From the value of 1600h or 1A00h.
    #[must_use]
    pub const fn from_raw(raw: u32) -> Self {
        Self::new((raw >> 16) as u16, (raw >> 8) as u8, raw as u8)
    }

    /// Whether it is a dummy (CiA 301, 7.4.7.1): the bits of an RPDO that this device does not use.
    #[must_use]
    #[inline]
    pub const fn is_dummy(self) -> bool {
        self.at.index < 0x0020
    }
}

/// As in the standard's examples: `6041h:00/16`.
impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.at, self.bits)
    }
}

impl fmt::Debug for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Why a mapping is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MappingError {
    /// Abort code 06040042h.
    #[error("entry {entry} {object} ends at bit {end}, a PDO has 64")]
    TooLong {
        /// Number of the entry, from 1.
        entry: u8,
        /// The entry.
        object: Entry,
        /// Bits up to its end.
        end: u16,
    },
    /// Abort code 06040042h.
    #[error("more than {0} entries")]
    TooMany(usize),
    /// Abort code 06090030h.
    #[error("entry {entry} {object} has a width of 0")]
    NoBits {
        /// Number of the entry, from 1.
        entry: u8,
        /// The entry.
        object: Entry,
    },
}

/// A frame of another length than the mapping.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("PDO of {found} bytes, {expected} are mapped")]
pub struct LengthError {
    /// Bytes of the mapping.
    pub expected: u8,
    /// Bytes received.
    pub found: u8,
}

/// A mapping with room for `N` entries (at most 64 make sense).
///
/// It can be changed in the steps of 1600h and 1A00h: [`disable`](Self::disable), [`set`](Self::set) for
/// each entry, [`enable`](Self::enable).
#[derive(Clone, Copy)]
pub struct Mapping<const N: usize = MAX_ENTRIES> {
    /// Those behind `len` are set, but not in effect.
    entries: [Entry; N],
    len: u8,
    bits: u8,
}

/// The same objects in the same order.
impl<const N: usize> PartialEq for Mapping<N> {
    fn eq(&self, other: &Self) -> bool {
        self.entries() == other.entries()
    }
}

impl<const N: usize> Eq for Mapping<N> {}

impl<const N: usize> Default for Mapping<N> {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl<const N: usize> Mapping<N> {
    /// Without entries.
    pub const EMPTY: Self = Self { entries: [Entry::new(0, 0, 0); N], len: 0, bits: 0 };

    /// From entries in the order of the PDO.
    ///
    /// # Errors
    /// [`MappingError`] names the first entry that does not fit.
    pub const fn new(entries: &[Entry]) -> Result<Self, MappingError> {
        let mut mapping = Self::EMPTY;
        let mut rest = entries;
        while let [entry, tail @ ..] = rest {
            if let Err(error) = mapping.push(*entry) {
                return Err(error);
            }
            rest = tail;
        }
        Ok(mapping)
    }

    /// Adds an entry behind the last.
    ///
    /// # Errors
    /// [`MappingError`] where it does not fit; nothing is changed then.
    pub const fn push(&mut self, object: Entry) -> Result<(), MappingError> {
        let number = self.len.saturating_add(1);
        let end = match Self::end(number, self.bits, object) {
            Ok(end) => end,
            Err(error) => return Err(error),
        };
        let (_, room) =
            self.entries.split_at_mut(if (self.len as usize) < N { self.len as usize } else { N });
        let [slot, ..] = room else { return Err(MappingError::TooMany(N)) };
        *slot = object;
        self.len = number;
        self.bits = end;
        Ok(())
    }

    /// Where entry `number` ends that begins at bit `begin`.
    const fn end(number: u8, begin: u8, object: Entry) -> Result<u8, MappingError> {
        if object.bits == 0 {
            return Err(MappingError::NoBits { entry: number, object });
        }
        let end = begin as u16 + object.bits as u16;
        if end > MAX_BITS as u16 {
            return Err(MappingError::TooLong { entry: number, object, end });
        }
        Ok(end as u8)
    }

    /// Nothing is mapped any more; the entries can be [`set`](Self::set) anew.
    pub const fn disable(&mut self) {
        self.len = 0;
        self.bits = 0;
    }

    /// Sets entry `number`, from 1, of a mapping that is disabled; `false` where it is not, or has no such
    /// entry.
    pub fn set(&mut self, number: u8, object: Entry) -> bool {
        let slot = self.entries.get_mut(usize::from(number).wrapping_sub(1));
        slot.filter(|_| self.len == 0).map(|slot| *slot = object).is_some()
    }

    /// Entry `number`, from 1, whether in effect or only set.
    #[must_use]
    pub fn entry(&self, number: u8) -> Option<Entry> {
        self.entries.get(usize::from(number).wrapping_sub(1)).copied()
    }

    /// The first `count` entries that were set are mapped from now on.
    ///
    /// # Errors
    /// [`MappingError`] where they do not fit; nothing is changed then.
    pub fn enable(&mut self, count: u8) -> Result<(), MappingError> {
        let mut end = 0;
        for (number, &object) in (1..=count).zip(&self.entries) {
            end = Self::end(number, end, object)?;
        }
        if usize::from(count) > N {
            return Err(MappingError::TooMany(N));
        }
        self.len = count;
        self.bits = end;
        Ok(())
    }

    /// The entries.
    #[must_use]
    #[inline]
    pub fn entries(&self) -> &[Entry] {
        self.entries.get(..usize::from(self.len)).unwrap_or(&[])
    }

    /// Width of the PDO in bits, 0…64.
    #[must_use]
    pub const fn bits(&self) -> u8 {
        self.bits
    }

    /// Width of the PDO in bytes, the last one perhaps not full.
    #[must_use]
    #[inline]
    pub const fn bytes(&self) -> u8 {
        self.bits.div_ceil(8)
    }

    /// The values of a PDO, entry by entry, dummies among them. A payload that is too long is read as
    /// far as it is mapped.
    ///
    /// # Errors
    /// [`LengthError`] if the payload is too short.
    #[inline]
    pub fn unpack(&self, payload: Payload) -> Result<impl Iterator<Item = (Entry, Bits)>, LengthError> {
        if payload.len() < self.bytes() {
            return Err(LengthError { expected: self.bytes(), found: payload.len() });
        }
        let mut rest = payload.word();
        Ok(self.entries().iter().map(move |&entry| {
            let value = Bits::checked(rest, entry.bits);
            // Nothing follows an entry of 64 bits.
            rest = rest.wrapping_shr(entry.bits.into());
            (entry, value)
        }))
    }

    /// Puts values into a PDO; `value` is asked for each entry, higher bits of its answer are cut off.
    #[inline]
    pub fn pack(&self, mut value: impl FnMut(Entry) -> u64) -> Payload {
        let (mut word, mut offset) = (0, 0u32);
        for &entry in self.entries() {
            let bits = Bits::checked(value(entry), entry.bits).unsigned();
            word |= bits.wrapping_shl(offset);
            offset += u32::from(entry.bits);
        }
        Payload::checked(word, self.bytes())
    }
}

impl<const N: usize> fmt::Debug for Mapping<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.entries()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;
    use std::vec::Vec;

    fn values<const N: usize>(mapping: &Mapping<N>, bytes: &[u8]) -> Vec<u64> {
        mapping.unpack(Payload::from_slice(bytes)).unwrap().map(|(_, bits)| bits.unsigned()).collect()
    }

    /// CiA 301, 7.5.2.36: 6040h:00 with 16 bits is 60400010h.
    #[test]
    fn raw_entries() {
        let entry = Entry::new(0x6040, 0, 16);
        assert_eq!((entry.raw(), Entry::from_raw(0x6040_0010)), (0x6040_0010, entry));
        assert_eq!(entry.to_string(), "6040h:00/16");
        assert!(Entry::from_raw(0x0005_0008).is_dummy() && !entry.is_dummy());
    }

    /// Status word, 24-bit position, 24-bit speed: TPDO 22 of the LD 2000.
    #[test]
    fn golden_bytes() {
        let mapping: Mapping =
            Mapping::new(&[Entry::new(0x6041, 0, 16), Entry::new(0x2070, 1, 24), Entry::new(0x2070, 2, 24)])
                .unwrap();
        let bytes = [0x37, 0x02, 0x56, 0x34, 0x12, 0xFE, 0xFF, 0xFF];
        assert_eq!(values(&mapping, &bytes), [0x0237, 0x12_3456, 0xFF_FFFE]);
        let (_, speed) = mapping.unpack(Payload::from_slice(&bytes)).unwrap().last().unwrap();
        assert_eq!(speed.signed(), -2);
        let packed = mapping.pack(|entry| match (entry.at.index, entry.at.sub) {
            (0x6041, 0) => 0x0237,
            (0x2070, 1) => 0x12_3456,
            _ => -2i64 as u64,
        });
        assert_eq!(packed.bytes(), bytes);
    }

    /// CiA 301, 7.5.2.36: count 0, entries, count.
    #[test]
    fn changed_step_by_step() {
        let [one, two] = [Entry::new(0x6040, 0, 16), Entry::new(0x60FF, 0, 32)];
        let mut mapping: Mapping<2> = Mapping::new(&[one, two]).unwrap();
        assert!(!mapping.set(1, two), "still in effect");
        mapping.disable();
        assert_eq!((mapping, mapping.bits(), mapping.entry(2)), (Mapping::EMPTY, 0, Some(two)));
        assert!(mapping.set(1, two) && !mapping.set(0, one) && !mapping.set(3, one));
        mapping.enable(1).unwrap();
        assert_eq!((mapping.entries(), mapping.bits()), (&[two][..], 32));
        assert_eq!(mapping.enable(3), Err(MappingError::TooMany(2)));
        assert_eq!(mapping.entries(), [two], "nothing is changed");
        mapping.enable(2).unwrap();
        assert_eq!(mapping.entries(), [two, two]);
    }

    /// 64 objects of one bit.
    #[test]
    fn single_bits() {
        let entries: Vec<Entry> = (1..=64).map(|sub| Entry::new(0x6020, sub, 1)).collect();
        let mapping: Mapping = Mapping::new(&entries).unwrap();
        let word = 0x8000_0000_0000_0005u64;
        let set: Vec<usize> = values(&mapping, &word.to_le_bytes())
            .iter()
            .enumerate()
            .filter_map(|(bit, &value)| (value == 1).then_some(bit))
            .collect();
        assert_eq!(set, [0, 2, 63]);
        assert_eq!(mapping.pack(|entry| word >> (entry.at.sub - 1) & 1).word(), word);
    }

    #[test]
    fn a_whole_word_is_one_entry() {
        let mapping: Mapping<1> = Mapping::new(&[Entry::new(0x2000, 0, 64)]).unwrap();
        assert_eq!(values(&mapping, &[0xFF; 8]), [u64::MAX]);
        assert_eq!(mapping.pack(|_| u64::MAX).bytes(), [0xFF; 8]);
    }

    #[test]
    fn what_does_not_fit() {
        let wide = Entry::new(0x2000, 0, 40);
        assert_eq!(
            Mapping::<64>::new(&[wide, wide]),
            Err(MappingError::TooLong { entry: 2, object: wide, end: 80 })
        );
        let none = Entry::new(0x2000, 0, 0);
        assert_eq!(Mapping::<64>::new(&[none]), Err(MappingError::NoBits { entry: 1, object: none }));
        let bit = Entry::new(0x2000, 0, 1);
        assert_eq!(Mapping::<2>::new(&[bit; 3]), Err(MappingError::TooMany(2)));
        let mapping: Mapping = Mapping::new(&[Entry::new(0x6041, 0, 16), bit]).unwrap();
        assert_eq!((mapping.bits(), mapping.bytes()), (17, 3));
        let short = mapping.unpack(Payload::from_slice(&[1, 2])).map(Iterator::count);
        assert_eq!(short, Err(LengthError { expected: 3, found: 2 }));
        assert_eq!(values(&mapping, &[1, 2, 0xFF, 9, 9]), [0x0201, 1]);
    }
}
