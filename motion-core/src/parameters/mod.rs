//! The system parameters of manual A, chapter 6: one table, from which everything that knows
//! parameters reads (loader, LB2 30h…35h, files, the program's tree).
//!
//! A parameter is addressed by its number `[000]`…`[971]`, of which 606 are in use. Values are `i32` in
//! display units: the decimal point is ignored (Appendix 1: 50.83 = 5083), and a characteristic's
//! value is the number of the choice.

#[cfg(feature = "alloc")]
mod find;
mod row;
mod table;
mod text;
mod values;

#[cfg(feature = "alloc")]
pub use find::{FindError, find};
pub use row::{Choice, Decimals, Default, Family, Kind, Row};
pub use table::TABLE;
pub use text::{Formatted, ValueError};
pub use values::{RangeError, Values};

/// Parameters in use.
pub const COUNT: usize = count();
/// Parameter numbers that LB2 can address: 0…999 (Appendix 1, 30h).
pub const INDICES: usize = 1000;

const UNUSED: u16 = u16::MAX;

const fn count() -> usize {
    let mut count = 0;
    let mut at = 0;
    while at < TABLE.len() {
        count += (TABLE[at].last - TABLE[at].first) as usize + 1;
        at += 1;
    }
    count
}

/// Row and instance of every parameter in use, in the order of the numbers.
const ENTRIES: [(u8, u8); COUNT] = tables().0;
/// Place in `ENTRIES` of every number.
const SLOTS: [u16; INDICES] = tables().1;

const fn tables() -> ([(u8, u8); COUNT], [u16; INDICES]) {
    let mut slots = [UNUSED; INDICES];
    let mut row = 0;
    while row < TABLE.len() {
        let mut index = TABLE[row].first;
        while index <= TABLE[row].last {
            assert!(slots[index as usize] == UNUSED, "a number stands in two rows");
            slots[index as usize] = row as u16;
            index += 1;
        }
        row += 1;
    }
    let mut entries = [(0, 0); COUNT];
    let mut next = 0;
    let mut index = 0;
    while index < INDICES {
        if slots[index] != UNUSED {
            let row = slots[index];
            entries[next] = (row as u8, (index as u16 - TABLE[row as usize].first) as u8);
            slots[index] = next as u16;
            next += 1;
        }
        index += 1;
    }
    (entries, slots)
}

/// One parameter in use: a row of the table and one of its instances.
#[derive(Clone, Copy)]
pub struct Entry {
    row: &'static Row,
    instance: u8,
    slot: u16,
}

/// The parameter with this number; `None` for a number that is not in use.
#[must_use]
pub fn get(index: u16) -> Option<Entry> {
    let slot = *SLOTS.get(usize::from(index))?;
    entry(slot)
}

/// All parameters in use, in the order of their numbers.
pub fn iter() -> impl DoubleEndedIterator<Item = Entry> + ExactSizeIterator {
    ENTRIES.iter().enumerate().map(|(slot, &(row, instance))| Entry {
        row: &TABLE[usize::from(row) % TABLE.len()],
        instance,
        slot: slot as u16,
    })
}

fn entry(slot: u16) -> Option<Entry> {
    let &(row, instance) = ENTRIES.get(usize::from(slot))?;
    Some(Entry { row: TABLE.get(usize::from(row))?, instance, slot })
}

impl Entry {
    /// The parameter's number, as manual A prints it in brackets.
    #[must_use]
    pub const fn index(&self) -> u16 {
        self.row.first + self.instance as u16
    }

    /// Its line in the table.
    #[must_use]
    pub const fn row(&self) -> &'static Row {
        self.row
    }

    /// Which instance it is, from 0: axis 1 is 0.
    #[must_use]
    pub const fn instance(&self) -> usize {
        self.instance as usize
    }

    pub(crate) const fn slot(&self) -> usize {
        self.slot as usize
    }

    /// Name, at most 20 characters; the same for all instances.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        self.row.name
    }

    /// Group, at most 25 characters: the menu of the instance ("Axis 1") or of a single parameter
    /// ("General"). Manual A gives no example; that the instance is part of it is project-defined.
    #[must_use]
    pub fn group(&self) -> &'static str {
        match self.row.family.labels().get(self.instance()) {
            Some(label) => label,
            None if self.row.page.is_empty() => self.row.family.menu(self.row.first),
            None => self.row.page,
        }
    }

    /// The menus that lead to the parameter, as in manual A's menu "Configuration": one to three.
    pub fn menu(&self) -> impl Iterator<Item = &'static str> + use<> {
        let main = self.row.family.menu(self.row.first);
        let group = self.group();
        let page = if group == self.row.page { "" } else { self.row.page };
        let group = if group == main { "" } else { group };
        [main, group, page].into_iter().filter(|menu| !menu.is_empty())
    }

    /// Least value, display units.
    #[must_use]
    pub const fn minimum(&self) -> i32 {
        match self.row.kind {
            Kind::Value { minimum, .. } => minimum,
            Kind::Choice(_) => 0,
        }
    }

    /// Greatest value, display units.
    #[must_use]
    pub const fn maximum(&self) -> i32 {
        match self.row.kind {
            Kind::Value { maximum, .. } => maximum,
            Kind::Choice(choices) => choices.len() as i32 - 1,
        }
    }

    /// Factory default, display units.
    #[must_use]
    pub fn default(&self) -> i32 {
        match self.row.default {
            Default::Same(value) => value,
            Default::Each(values) => values.get(self.instance()).copied().unwrap_or(0),
        }
    }

    /// Unit of the displayed value; empty for characteristics and plain numbers.
    #[must_use]
    pub const fn unit(&self) -> &'static str {
        match self.row.kind {
            Kind::Value { unit, .. } => unit,
            Kind::Choice(_) => "",
        }
    }

    /// The choices of a characteristic; empty for a value parameter.
    #[must_use]
    pub const fn choices(&self) -> &'static [Choice] {
        match self.row.kind {
            Kind::Value { .. } => &[],
            Kind::Choice(choices) => choices,
        }
    }

    /// The choice that `value` stands for; `None` for value parameters and numbers without a choice.
    #[must_use]
    pub fn choice(&self, value: i32) -> Option<&'static Choice> {
        self.choices().get(usize::try_from(value).ok()?)
    }

    /// Digits after the decimal point, 0…4, where `values` hold what the display settings are.
    #[must_use]
    pub fn decimals(&self, values: &Values) -> u8 {
        match self.row.kind {
            Kind::Value { decimals: Decimals::Fixed(digits), .. } => digits,
            Kind::Value { decimals: Decimals::As(first), .. } => {
                let digits = values.get(first + u16::from(self.instance)).unwrap_or(0);
                digits.clamp(0, 4) as u8
            }
            Kind::Choice(_) => 0,
        }
    }

    /// Whether `value` lies in the range and, for a characteristic, can be chosen for this instance:
    /// inputs 4…6 have no encoder terminals (6.6.1), outputs 4…6 only the CAN bus (6.7.1), CAN 2 is
    /// always master, without bypass, and has only axes (6.5.1), objects 3 and 4 of CAN 1 are no axes
    /// (6.5.1.1).
    #[must_use]
    pub fn allows(&self, value: i32) -> bool {
        (self.minimum()..=self.maximum()).contains(&value)
            && match (self.index(), value) {
                (103..=105, 0 | 1) => false,
                (453..=455, value) => matches!(value, 0 | 2),
                (301, value) => value == 0,
                (328 | 329 | 332 | 333, 3) => false,
                // Only `Axis` is printed for CAN 2; that `Inactive` is accepted too is project-defined.
                (358..=365, value) => matches!(value, 0 | 3),
                (366..=373, value) => value == 0,
                _ => true,
            }
    }
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.slot == other.slot
    }
}

impl Eq for Entry {}

impl core::fmt::Debug for Entry {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{self}")
    }
}

impl core::fmt::Display for Entry {
    /// `[642] V max., Axis 1`
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "[{:03}] {}", self.index(), self.name())?;
        if self.row.family == Family::Single { Ok(()) } else { write!(f, ", {}", self.group()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_whole() {
        assert_eq!((TABLE.len(), COUNT, iter().len()), (122, 606, 606));
        for (entry, index) in iter().zip((0..INDICES as u16).filter(|&index| get(index).is_some())) {
            assert_eq!(entry.index(), index);
            assert_eq!(get(index), Some(entry));
            assert!(entry.name().len() <= 20, "{entry}");
            assert!(entry.group().len() <= 25 && !entry.group().is_empty(), "{entry}");
            assert!(entry.allows(entry.default()), "{entry}: default {}", entry.default());
            assert!(entry.minimum() <= entry.maximum());
        }
        assert_eq!(get(50), None);
        assert_eq!(get(1000), None);
    }

    #[test]
    fn menus_are_the_manuals() {
        let menu = |index| get(index).unwrap().menu().collect::<alloc::vec::Vec<_>>().join("/");
        assert_eq!(menu(0), "Basic settings/General");
        assert_eq!(menu(7), "Basic settings/COM 1");
        assert_eq!(menu(56), "Extension module");
        assert_eq!(menu(80), "Extension module/PROFIBUS-DP");
        assert_eq!(menu(642), "Axes configuration/Axis 1/Feedback control, Ramps");
        assert_eq!(menu(365), "CAN bus/CAN 2 Object/PDO OUT 4");
        assert_eq!(alloc::format!("{}", get(643).unwrap()), "[643] V max., Axis 2");
    }
}
