//! One value for every parameter.

use super::{COUNT, Entry, get, iter};

/// A value for each of the 606 parameters, in display units.
#[derive(Clone, PartialEq, Eq)]
pub struct Values([i32; COUNT]);

/// A value that a parameter does not take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RangeError {
    /// The number is not in use.
    #[error("there is no parameter [{index:03}]")]
    Unused {
        /// The number given.
        index: u16,
    },
    /// Outside of the range.
    #[error("{entry}: {value} is out of range, {} to {} expected", .entry.minimum(), .entry.maximum())]
    Range {
        /// The parameter.
        entry: Entry,
        /// The value given, display units.
        value: i32,
    },
    /// A choice that this instance does not have.
    #[error("{entry}: {} cannot be selected here, {} expected", .entry.chosen(*.value), .entry.takes())]
    Choice {
        /// The parameter.
        entry: Entry,
        /// The number of the choice.
        value: i32,
    },
}

impl Default for Values {
    fn default() -> Self {
        Self::factory()
    }
}

impl Values {
    /// The factory defaults (manual A 6.2).
    #[must_use]
    pub fn factory() -> Self {
        let mut values = Self([0; COUNT]);
        for (value, entry) in values.0.iter_mut().zip(iter()) {
            *value = entry.default();
        }
        values
    }

    /// Values in the order of the parameters' numbers, each within its range.
    ///
    /// # Errors
    /// The first value that its parameter does not take.
    pub fn from_array(array: [i32; COUNT]) -> Result<Self, RangeError> {
        for (&value, entry) in array.iter().zip(iter()) {
            check(entry, value)?;
        }
        Ok(Self(array))
    }

    /// The values in the order of the parameters' numbers.
    #[must_use]
    pub const fn as_array(&self) -> &[i32; COUNT] {
        &self.0
    }

    /// The value of a parameter in use.
    #[must_use]
    pub fn of(&self, entry: Entry) -> i32 {
        self.0.get(entry.slot()).copied().unwrap_or(0)
    }

    /// The value by number; `None` for a number that is not in use.
    #[must_use]
    pub fn get(&self, index: u16) -> Option<i32> {
        get(index).map(|entry| self.of(entry))
    }

    /// The value of one instance of a row, by the number of the row's first instance; 0 for numbers
    /// not in use. Instances count from 0: `at(642, 1)` is V max. of axis 2.
    #[must_use]
    pub fn at(&self, first: u16, instance: usize) -> i32 {
        u16::try_from(instance)
            .ok()
            .and_then(|instance| self.get(first.saturating_add(instance)))
            .unwrap_or(0)
    }

    /// Sets a value if the parameter takes it; else the old one stays. Returns the old one.
    ///
    /// # Errors
    /// [`RangeError`] says what the parameter takes.
    pub fn set(&mut self, index: u16, value: i32) -> Result<i32, RangeError> {
        let entry = get(index).ok_or(RangeError::Unused { index })?;
        check(entry, value)?;
        match self.0.get_mut(entry.slot()) {
            Some(slot) => Ok(core::mem::replace(slot, value)),
            None => Err(RangeError::Unused { index }),
        }
    }
}

impl core::fmt::Debug for Values {
    /// Only what differs from the factory defaults.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let changed =
            iter().map(|entry| (entry, self.of(entry))).filter(|(entry, value)| *value != entry.default());
        f.debug_map().entries(changed).finish()
    }
}

fn check(entry: Entry, value: i32) -> Result<(), RangeError> {
    if entry.allows(value) {
        Ok(())
    } else if (entry.minimum()..=entry.maximum()).contains(&value) {
        Err(RangeError::Choice { entry, value })
    } else {
        Err(RangeError::Range { entry, value })
    }
}
