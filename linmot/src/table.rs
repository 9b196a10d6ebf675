//! The command table: entries, presence lists, links (manual B 6).

use core::ops::RangeInclusive;

/// Entry numbers (manual B 6: "up to 255 entries").
pub const ENTRIES: RangeInclusive<u16> = 1..=255;
/// Size of an entry in bytes.
pub const ENTRY_SIZE: usize = 64;
/// 32-bit words that carry an entry.
pub const ENTRY_WORDS: usize = ENTRY_SIZE / 4;
/// Presence lists, 32 entries each (87h…8Eh).
pub const LISTS: u8 = 8;
/// Characters of a name, bytes 26h…35h.
const NAME: usize = 16;
/// Bytes 0…1 of every entry.
pub const VERSION: u16 = 0xA701;
/// Bytes 2…3 of an entry that none follows.
pub const NOT_LINKED: u16 = 0xFFFF;

/// One entry (manual B, table 10). Reserved bytes are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entry {
    bytes: [u8; ENTRY_SIZE],
}

/// Why 64 bytes are no entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum EntryError {
    /// Bytes 0…1.
    #[error("version {0:04X}h, A701h expected")]
    Version(u16),
    /// Another number of bytes.
    #[error("{0} bytes, 64 expected")]
    Size(usize),
    /// More characters than the field has, or one that ends it.
    #[error("name of {0} characters, up to 16 expected, none of them 00h")]
    Name(usize),
}

impl Entry {
    /// An entry with this motion command header and its parameters, not linked, without name.
    #[must_use]
    pub fn new(header: u16, parameters: [u8; 32]) -> Self {
        let mut entry = Self { bytes: [0; ENTRY_SIZE] };
        entry.put(0, VERSION);
        entry.put(2, NOT_LINKED);
        entry.put(4, header);
        if let Some(room) = entry.bytes.get_mut(6..0x26) {
            room.copy_from_slice(&parameters);
        }
        entry
    }

    /// From the bytes of an entry.
    ///
    /// # Errors
    /// [`EntryError`] for another size or version.
    pub fn parse(bytes: &[u8]) -> Result<Self, EntryError> {
        let bytes = <[u8; ENTRY_SIZE]>::try_from(bytes).map_err(|_| EntryError::Size(bytes.len()))?;
        let entry = Self { bytes };
        match entry.get(0) {
            VERSION => Ok(entry),
            other => Err(EntryError::Version(other)),
        }
    }

    /// From the words on the wire.
    ///
    /// # Errors
    /// [`EntryError::Version`].
    pub fn from_words(words: &[u32; ENTRY_WORDS]) -> Result<Self, EntryError> {
        let mut bytes = [0; ENTRY_SIZE];
        for (four, word) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(words) {
            *four = word.to_le_bytes();
        }
        Self::parse(&bytes)
    }

    /// Its bytes.
    #[must_use]
    pub const fn bytes(&self) -> &[u8; ENTRY_SIZE] {
        &self.bytes
    }

    /// Its words on the wire, low byte first.
    #[must_use]
    pub fn words(&self) -> [u32; ENTRY_WORDS] {
        let mut words = [0; ENTRY_WORDS];
        for (word, four) in words.iter_mut().zip(self.bytes.as_chunks::<4>().0) {
            *word = u32::from_le_bytes(*four);
        }
        words
    }

    /// The entry that follows by itself.
    #[must_use]
    pub fn linked(&self) -> Option<u16> {
        Some(self.get(2)).filter(|linked| *linked != NOT_LINKED)
    }

    /// Sets or clears the entry that follows.
    pub fn link(&mut self, entry: Option<u16>) {
        self.put(2, entry.unwrap_or(NOT_LINKED));
    }

    /// Motion command header.
    #[must_use]
    pub fn header(&self) -> u16 {
        self.get(4)
    }

    /// Motion command parameters.
    #[must_use]
    pub fn parameters(&self) -> &[u8] {
        self.bytes.get(6..0x26).unwrap_or(&[])
    }

    /// The name up to its end, whatever its characters.
    #[must_use]
    pub fn name(&self) -> &[u8] {
        let field = self.bytes.get(0x26..0x36).unwrap_or(&[]);
        field.split(|byte| *byte == 0).next().unwrap_or(&[])
    }

    /// Sets the name.
    ///
    /// # Errors
    /// [`EntryError::Name`] for more than 16 characters, or a 00h among them; the name is as it was.
    pub fn set_name(&mut self, name: &[u8]) -> Result<(), EntryError> {
        if name.len() > NAME || name.contains(&0) {
            return Err(EntryError::Name(name.len()));
        }
        let field = self.bytes.get_mut(0x26..0x36).unwrap_or(&mut []);
        field.fill(0);
        for (room, character) in field.iter_mut().zip(name) {
            *room = *character;
        }
        Ok(())
    }

    fn get(&self, at: usize) -> u16 {
        match self.bytes.get(at..at + 2) {
            Some(&[low, high]) => u16::from_le_bytes([low, high]),
            _ => 0,
        }
    }

    fn put(&mut self, at: usize, value: u16) {
        if let Some(room) = self.bytes.get_mut(at..at + 2) {
            room.copy_from_slice(&value.to_le_bytes());
        }
    }
}

/// Number of a presence list, 0…7: that of entries 32·n and the 31 that follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ListNumber(u8);

impl ListNumber {
    /// `None` above 7.
    #[must_use]
    pub const fn new(number: u8) -> Option<Self> {
        if number < LISTS { Some(Self(number)) } else { None }
    }

    /// 0…7.
    #[must_use]
    pub const fn get(self) -> u8 {
        self.0
    }

    /// All of them.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..LISTS).map(Self)
    }
}

/// Which entries exist.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Presence([u32; LISTS as usize]);

impl Presence {
    /// The saving format's bit fields: bit set = entry exists (manual B, table 9).
    #[must_use]
    pub const fn saved(&self) -> [u32; LISTS as usize] {
        self.0
    }

    /// One presence list as commands 87h…8Eh answer it: bit set = undefined, cleared = used
    /// (manual B 7.2.1.19).
    #[must_use]
    pub fn list(&self, list: u8) -> u32 {
        !self.0.get(usize::from(list)).copied().unwrap_or(0)
    }

    /// Takes one presence list as commands 87h…8Eh answer it. Entry 0 does not exist.
    pub fn set_list(&mut self, list: u8, answer: u32) {
        if let Some(word) = self.0.get_mut(usize::from(list)) {
            *word = if list == 0 { !answer & !1 } else { !answer };
        }
    }

    /// Whether the entry exists.
    #[must_use]
    pub fn contains(&self, entry: u16) -> bool {
        self.0.get(usize::from(entry / 32)).is_some_and(|word| word >> (entry % 32) & 1 == 1)
    }

    /// Adds or removes an entry.
    pub fn set(&mut self, entry: u16, exists: bool) {
        if ENTRIES.contains(&entry)
            && let Some(word) = self.0.get_mut(usize::from(entry / 32))
        {
            let bit = 1 << (entry % 32);
            *word = if exists { *word | bit } else { *word & !bit };
        }
    }

    /// Entries that exist, in ascending order.
    pub fn iter(&self) -> impl Iterator<Item = u16> {
        ENTRIES.filter(|entry| self.contains(*entry))
    }
}

/// A remark about the links between entries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LinkFault {
    /// An entry is followed by one that does not exist.
    #[error("entry {entry} is linked to entry {linked}, which does not exist")]
    Missing {
        /// The entry.
        entry: u16,
        /// What follows it.
        linked: u16,
    },
    /// A sequence comes back to one of its entries and never ends.
    #[error("entry {entry} begins a loop of {length} {}", if *length == 1 { "entry" } else { "entries" })]
    Loop {
        /// Lowest entry of the loop.
        entry: u16,
        /// Entries in it.
        length: u16,
    },
}

/// Reports every missing link and every loop, each loop once. `linked` tells of an entry which one
/// follows it; it is asked for entries of `presence` only.
pub fn check_links(
    presence: &Presence,
    mut linked: impl FnMut(u16) -> Option<u16>,
    mut report: impl FnMut(LinkFault),
) {
    let mut next = [0u8; 256];
    for entry in presence.iter() {
        match linked(entry) {
            Some(follower) if presence.contains(follower) => {
                if let Some(slot) = next.get_mut(usize::from(entry)) {
                    // `contains` has checked that it fits.
                    *slot = follower as u8;
                }
            }
            Some(follower) => report(LinkFault::Missing { entry, linked: follower }),
            None => {}
        }
    }
    let follow = |entry: u16| u16::from(next.get(usize::from(entry)).copied().unwrap_or(0));
    for entry in presence.iter() {
        // An entry is on a loop if following the links comes back to it; it names the loop if it is
        // the lowest on it.
        let (mut at, mut length) = (follow(entry), 1);
        while at > entry && length < 256 {
            at = follow(at);
            length += 1;
        }
        if at == entry {
            report(LinkFault::Loop { entry, length });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// Manual B, table 10.
    #[test]
    fn fields_lie_where_the_manual_says() {
        let mut entry = Entry::new(0x0100, core::array::from_fn(|n| n as u8 + 1));
        entry.set_name(b"Move out and bac").unwrap();
        assert_eq!(entry.set_name(b"Move out and back again"), Err(EntryError::Name(23)));
        assert_eq!(entry.set_name(b"a\0b"), Err(EntryError::Name(3)));
        entry.link(Some(5));
        let bytes = entry.bytes();
        assert_eq!(bytes[..6], [0x01, 0xA7, 0x05, 0x00, 0x00, 0x01]);
        assert_eq!((bytes[6], bytes[0x25]), (1, 32));
        assert_eq!(&bytes[0x26..0x36], b"Move out and bac");
        assert_eq!(bytes[0x36..], [0; 10]);
        assert_eq!(
            (entry.name(), entry.linked(), entry.header()),
            (&b"Move out and bac"[..], Some(5), 0x100)
        );
        assert_eq!(entry.words()[0], 0x0005_A701);
        assert_eq!((Entry::parse(bytes), Entry::from_words(&entry.words())), (Ok(entry), Ok(entry)));
        entry.link(None);
        assert_eq!((entry.bytes()[2..4].to_vec(), entry.linked()), (Vec::from([0xFF, 0xFF]), None));
        assert_eq!(Entry::parse(&[0; 64]), Err(EntryError::Version(0)));
        assert_eq!(Entry::parse(&[0; 63]), Err(EntryError::Size(63)));
    }

    /// Manual B, table 9 (set = exists) and 7.2.1.19 (cleared = used).
    #[test]
    fn presence_has_two_forms() {
        let mut presence = Presence::default();
        for entry in [0, 1, 31, 32, 255, 256] {
            presence.set(entry, true);
        }
        assert_eq!(presence.iter().collect::<Vec<_>>(), [1, 31, 32, 255]);
        assert_eq!((presence.saved()[0], presence.saved()[1]), (0x8000_0002, 1));
        assert_eq!(
            (presence.list(0), presence.list(7), presence.list(2)),
            (0x7FFF_FFFD, 0x7FFF_FFFF, u32::MAX)
        );
        let mut back = Presence::default();
        (0..LISTS).for_each(|list| back.set_list(list, presence.list(list)));
        assert_eq!(back, presence);
    }

    #[test]
    fn missing_links_and_loops_are_named() {
        let links = [
            (1, Some(2)),
            (2, Some(3)),
            (3, Some(2)),
            (4, Some(99)),
            (5, None),
            (6, Some(6)),
            (7, Some(300)),
        ];
        let mut presence = Presence::default();
        links.iter().for_each(|(entry, _)| presence.set(*entry, true));
        let mut found = Vec::new();
        let linked = |entry| links.iter().find(|(e, _)| *e == entry).and_then(|(_, l)| *l);
        check_links(&presence, linked, |fault| found.push(fault));
        assert_eq!(
            found,
            [
                LinkFault::Missing { entry: 4, linked: 99 },
                LinkFault::Missing { entry: 7, linked: 300 },
                LinkFault::Loop { entry: 2, length: 2 },
                LinkFault::Loop { entry: 6, length: 1 },
            ]
        );
        // All 255 in one circle.
        let mut all = Presence::default();
        ENTRIES.for_each(|entry| all.set(entry, true));
        let mut found = Vec::new();
        check_links(&all, |entry| Some(entry % 255 + 1), |fault| found.push(fault));
        assert_eq!(found, [LinkFault::Loop { entry: 1, length: 255 }]);
    }
}
