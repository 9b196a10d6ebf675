//! The application's part in the dictionary.

use pdo::Address;

use super::View;
use super::dictionary::slot;
use crate::sdo::{AbortCode, Piece, Total};

/// What the application does when entries are read and written. Every method has a default: `()` is an
/// application that does nothing.
pub trait Hooks {
    /// Reads an entry whose place is the application; as
    /// [`sdo::Access::read`](crate::sdo::Access::read).
    ///
    /// # Errors
    /// An abort code, sent to the client.
    fn read(&mut self, at: Address, offset: u32, out: &mut [u8]) -> Result<(usize, Total), AbortCode> {
        let _ = (at, offset, out);
        Err(AbortCode::NO_DATA)
    }

    /// A download in several frames to an entry whose place is the application.
    ///
    /// # Errors
    /// An abort code, sent to the client.
    fn begin_write(&mut self, at: Address, size: Option<u32>) -> Result<(), AbortCode> {
        let _ = (at, size);
        Ok(())
    }

    /// Writes an entry whose place is the application; as
    /// [`sdo::Access::write`](crate::sdo::Access::write).
    ///
    /// # Errors
    /// An abort code, sent to the client.
    fn write(&mut self, at: Address, piece: &Piece<'_>) -> Result<(), AbortCode> {
        let _ = (at, piece);
        Err(AbortCode::CANNOT_STORE)
    }

    /// A download ended before its last piece.
    fn abandon(&mut self, at: Address) {
        let _ = at;
    }

    /// A client wants to write a scalar in memory; type and limits have been checked.
    ///
    /// # Errors
    /// An abort code, sent to the client; the value stays as it was.
    fn check(&mut self, at: Address, value: &[u8]) -> Result<(), AbortCode> {
        let _ = (at, value);
        Ok(())
    }

    /// A client has written an entry in memory.
    fn written(&mut self, at: Address) {
        let _ = at;
    }

    /// 1010h:`group` was written with "save": 1 all, 2 communication (1000h…1FFFh), 3 application
    /// (6000h…9FFFh), 4…127 as the manufacturer likes. `values` are those to keep, for
    /// [`Dictionary::load`](super::Dictionary::load) at the next start.
    ///
    /// # Errors
    /// An abort code, sent to the client; 06060000h (hardware) by default.
    fn store(&mut self, group: u8, values: Stored<'_>) -> Result<(), AbortCode> {
        let _ = (group, values);
        Err(AbortCode::HARDWARE)
    }

    /// 1011h:`group` was written with "load": the initial values hold from the next reset on.
    ///
    /// # Errors
    /// An abort code, sent to the client; 06060000h (hardware) by default.
    fn restore(&mut self, group: u8) -> Result<(), AbortCode> {
        let _ = group;
        Err(AbortCode::HARDWARE)
    }
}

impl Hooks for () {}

/// The values that 1010h keeps, in ascending order.
#[derive(Debug, Clone)]
pub struct Stored<'a> {
    table: View<'a>,
    memory: &'a [u8],
    group: u8,
    next: usize,
}

impl<'a> Stored<'a> {
    pub(super) const fn new(table: View<'a>, memory: &'a [u8], group: u8) -> Self {
        Self { table, memory, group, next: 0 }
    }
}

impl<'a> Iterator for Stored<'a> {
    type Item = (Address, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let place = self.next;
            let entry = self.table.entries.get(place)?;
            self.next += 1;
            let wanted = match self.group {
                2 => (0x1000..0x2000).contains(&entry.at.index),
                3 => (0x6000..0xA000).contains(&entry.at.index),
                _ => true,
            };
            if wanted && entry.stored {
                return Some((entry.at, slot(&self.table, place, entry, self.memory)?));
            }
        }
    }
}
