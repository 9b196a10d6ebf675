//! The entries of a dictionary, in order, and where their values lie in memory.

use pdo::Address;

use super::Entry;

/// Why entries are no dictionary.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// Entries must ascend by index and sub-index, without repetition.
    #[error("entry {0} is not behind the one before it")]
    Order(Address),
    /// The initial value or the limits do not suit the type or the place.
    #[error("initial value or limits of entry {0} do not suit its type or place")]
    Initial(Address),
    /// The values need more memory than 65,535 bytes.
    #[error("values up to entry {0} need more than 65,535 bytes")]
    Memory(Address),
}

/// `N` entries; made once, in a `const` or `static`.
///
/// ```
/// use canopen_master::data_type::DataType;
/// use canopen_master::od::{Dictionary, Entry, Table};
/// use canopen_master::Address;
///
/// const TABLE: Table<'static, 3> = match Table::new([
///     Entry::constant(0x1000, 0, DataType::UNSIGNED32, 0x0003_0191),
///     Entry::text(0x1008, 0, "I/O node"),
///     Entry::variable(0x2000, 0, DataType::INTEGER16, 100),
/// ]) {
///     Ok(table) => table,
///     Err(_) => panic!("entries out of order"),
/// };
///
/// let mut memory = [0; TABLE.memory()];
/// let dictionary = Dictionary::new(TABLE.view(), &mut memory, ())?;
/// assert_eq!(dictionary.get::<i16>(Address::new(0x2000, 0)), Ok(100));
/// # Ok::<(), canopen_master::od::RamError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Table<'a, const N: usize> {
    entries: [Entry<'a>; N],
    offsets: [u16; N],
    memory: u16,
}

impl<'a, const N: usize> Table<'a, N> {
    /// Checks the entries and lays their values out.
    ///
    /// # Errors
    /// [`TableError`] names the first entry that is wrong.
    pub const fn new(entries: [Entry<'a>; N]) -> Result<Self, TableError> {
        let mut offsets = [0; N];
        let mut memory = 0u16;
        let mut before: Option<Address> = None;
        let mut rest: &[Entry<'a>] = &entries;
        let mut places: &mut [u16] = &mut offsets;
        while let ([entry, tail @ ..], [place, others @ ..]) = (rest, places) {
            let at = entry.at;
            if let Some(before) = before
                && key(before) >= key(at)
            {
                return Err(TableError::Order(at));
            }
            if !entry.is_sound() {
                return Err(TableError::Initial(at));
            }
            *place = memory;
            memory = match memory.checked_add(entry.memory()) {
                Some(memory) => memory,
                None => return Err(TableError::Memory(at)),
            };
            before = Some(at);
            (rest, places) = (tail, others);
        }
        Ok(Self { entries, offsets, memory })
    }

    /// Bytes of memory that a dictionary needs for the values.
    #[must_use]
    pub const fn memory(&self) -> usize {
        self.memory as usize
    }

    /// The table without its length in the type.
    #[must_use]
    pub const fn view(&self) -> View<'_> {
        View { entries: &self.entries, offsets: &self.offsets, memory: self.memory }
    }
}

const fn key(at: Address) -> u32 {
    (at.index as u32) << 8 | at.sub as u32
}

/// A table of any length, borrowed.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    pub(super) entries: &'a [Entry<'a>],
    pub(super) offsets: &'a [u16],
    pub(super) memory: u16,
}

impl<'a> View<'a> {
    /// The entries in ascending order.
    #[must_use]
    pub const fn entries(&self) -> &'a [Entry<'a>] {
        self.entries
    }

    /// Position of an entry; `Err` tells whether others of its index exist.
    pub(super) fn find(&self, at: Address) -> Result<usize, bool> {
        self.entries.binary_search_by_key(&key(at), |entry| key(entry.at)).map_err(|place| {
            let other =
                |place: usize| self.entries.get(place).is_some_and(|entry| entry.at.index == at.index);
            other(place) || other(place.wrapping_sub(1))
        })
    }
}
