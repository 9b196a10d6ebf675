//! Concise DCF (CiA 302-3, object 1F22h): a node's configuration as one run of bytes.
//!
//! UNSIGNED32 number of entries, then per entry index (2 bytes), sub-index (1), size (4) and data,
//! all little endian.

use pdo::Address;

/// What is wrong with a concise DCF.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DcfError {
    /// It ends inside an entry, or before the entries it announces.
    #[error("concise DCF ends inside entry {entry} of {entries}")]
    Truncated {
        /// The entry, counted from 1; 0 = the number of entries itself.
        entry: u32,
        /// Entries announced.
        entries: u32,
    },
    /// Bytes follow the last entry.
    #[error("concise DCF has {0} bytes after its last entry")]
    Trailing(usize),
}

/// A concise DCF whose structure has been checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConciseDcf<'d> {
    entries: u32,
    rest: &'d [u8],
}

impl<'d> ConciseDcf<'d> {
    /// One without entries.
    pub const EMPTY: Self = Self { entries: 0, rest: &[] };

    /// Checks that the entries are where they should be. No bytes at all are a DCF without entries.
    ///
    /// # Errors
    /// [`DcfError`].
    pub const fn new(bytes: &'d [u8]) -> Result<Self, DcfError> {
        if bytes.is_empty() {
            return Ok(Self::EMPTY);
        }
        let Some((entries, rest)) = bytes.split_first_chunk() else {
            return Err(DcfError::Truncated { entry: 0, entries: 0 });
        };
        let entries = u32::from_le_bytes(*entries);
        let mut walk = Self { entries, rest };
        let mut entry = 0;
        while walk.entries > 0 {
            entry += 1;
            if walk.take_entry().is_none() {
                return Err(DcfError::Truncated { entry, entries });
            }
        }
        match walk.rest.len() {
            0 => Ok(Self { entries, rest }),
            trailing => Err(DcfError::Trailing(trailing)),
        }
    }

    /// Takes the next entry.
    const fn take_entry(&mut self) -> Option<(Address, &'d [u8])> {
        let Some(entries) = self.entries.checked_sub(1) else { return None };
        let Some((&[low, high, sub, a, b, c, d], rest)) = self.rest.split_first_chunk::<7>() else {
            return None;
        };
        // A size that does not fit is beyond every slice.
        let size = u32::from_le_bytes([a, b, c, d]) as usize;
        let Some((data, rest)) = rest.split_at_checked(size) else { return None };
        self.entries = entries;
        self.rest = rest;
        Some((Address::new(u16::from_le_bytes([low, high]), sub), data))
    }

    /// Entries left.
    #[must_use]
    pub const fn len(&self) -> u32 {
        self.entries
    }

    /// Whether no entry is left.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.entries == 0
    }
}

impl<'d> Iterator for ConciseDcf<'d> {
    type Item = (Address, &'d [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        self.take_entry()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    const TWO: [u8; 21] = [2, 0, 0, 0, 0x17, 0x10, 0, 2, 0, 0, 0, 0xE8, 3, 0x00, 0x26, 1, 1, 0, 0, 0, 22];

    #[test]
    fn entries_in_order() {
        let dcf = ConciseDcf::new(&TWO).unwrap();
        assert_eq!(dcf.len(), 2);
        let entries: Vec<_> = dcf.collect();
        let expected: [(_, &[u8]); 2] =
            [(Address::new(0x1017, 0), &[0xE8, 3]), (Address::new(0x2600, 1), &[22])];
        assert_eq!(entries, expected);
        assert!(ConciseDcf::new(&[]).unwrap().is_empty());
    }

    #[test]
    fn every_cut_is_named() {
        for len in 1..TWO.len() {
            let error = ConciseDcf::new(&TWO[..len]).unwrap_err();
            assert!(matches!(error, DcfError::Truncated { .. }), "{len}: {error}");
        }
        let mut long = Vec::from(TWO);
        long.push(0);
        assert_eq!(ConciseDcf::new(&long), Err(DcfError::Trailing(1)));
        let huge = [1, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF];
        assert_eq!(ConciseDcf::new(&huge), Err(DcfError::Truncated { entry: 1, entries: 1 }));
    }
}
