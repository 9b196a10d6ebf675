//! The values, and the access of a client to them.

use pdo::Address;

use super::entry::LENGTH;
use super::{Entry, Hooks, Initial, Place, ProcessData, Stored, View};
use crate::data_type::{DataType, Scalar};
use crate::sdo::message::load;
use crate::sdo::{AbortCode, Access, Piece, Small, Total, read_slice};

/// The memory given for the values is too small.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{found} bytes of memory, the table needs {needed}")]
pub struct RamError {
    /// What [`Table::memory`](super::Table::memory) says.
    pub needed: u16,
    /// What was given.
    pub found: usize,
}

/// What is written to 1010h (CiA 301, 7.5.2.13).
pub const SAVE: &[u8] = b"save";
/// What is written to 1011h (CiA 301, 7.5.2.14).
pub const LOAD: &[u8] = b"load";
/// What is read there: the device stores on command, and not by itself.
const ON_COMMAND: u32 = 1;

/// An object dictionary: the values of a [`Table`](super::Table) in memory that the caller gives.
#[derive(Debug)]
pub struct Dictionary<'a, H> {
    table: View<'a>,
    memory: &'a mut [u8],
    /// The application.
    pub hooks: H,
    /// The entry found last: a transfer asks for the same one again and again.
    last: usize,
}

impl<'a, H: Hooks> Dictionary<'a, H> {
    /// With all values as at power-on.
    ///
    /// # Errors
    /// [`RamError`] if `memory` is smaller than the table says.
    pub fn new(table: View<'a>, memory: &'a mut [u8], hooks: H) -> Result<Self, RamError> {
        if memory.len() < usize::from(table.memory) {
            return Err(RamError { needed: table.memory, found: memory.len() });
        }
        let mut dictionary = Self { table, memory, hooks, last: 0 };
        dictionary.reset();
        Ok(dictionary)
    }

    /// Sets all values to what they are at power-on.
    pub fn reset(&mut self) {
        for (place, entry) in self.table.entries.iter().enumerate() {
            let number;
            let value = match entry.initial {
                Initial::Number(value) => {
                    number = value.to_le_bytes();
                    number.get(..usize::from(entry.data_type.size().unwrap_or(0))).unwrap_or(&[])
                }
                Initial::Bytes(bytes) => bytes,
            };
            put(&self.table, place, self.memory, value);
        }
    }

    /// The entries.
    #[must_use]
    pub const fn table(&self) -> View<'a> {
        self.table
    }

    /// An entry.
    #[must_use]
    pub fn entry(&self, at: Address) -> Option<&'a Entry<'a>> {
        self.table.entries.get(self.table.find(at).ok()?)
    }

    /// The value of an entry in memory or of a constant string; `None` of any other.
    #[must_use]
    pub fn bytes(&self, at: Address) -> Option<&[u8]> {
        let place = self.table.find(at).ok()?;
        slot(&self.table, place, self.table.entries.get(place)?, self.memory)
    }

    /// A scalar, for the application: rights do not matter.
    ///
    /// # Errors
    /// The abort code that a client would get: no such entry, or of another length.
    pub fn get<T: Scalar>(&self, at: Address) -> Result<T, AbortCode> {
        let place = self.place(at)?;
        let value = self.scalar(place).ok_or(AbortCode::NO_DATA)?;
        value.get().map_err(|_| AbortCode::LENGTH)
    }

    /// Changes a scalar in memory, for the application: rights and limits do not matter, hooks are not
    /// called.
    ///
    /// # Errors
    /// The abort code that a client would get: no such entry, not in memory, or of another length.
    pub fn set<T: Scalar>(&mut self, at: Address, value: T) -> Result<(), AbortCode> {
        self.set_bytes(at, value.to_small().as_slice())
    }

    /// Changes a value in memory, for the application, as [`set`](Self::set).
    ///
    /// # Errors
    /// As [`set`](Self::set).
    pub fn set_bytes(&mut self, at: Address, value: &[u8]) -> Result<(), AbortCode> {
        let place = self.place(at)?;
        if put(&self.table, place, self.memory, value) { Ok(()) } else { Err(AbortCode::LENGTH) }
    }

    /// Takes over a value that [`Hooks::store`] was given; one that does not fit any more is left out.
    pub fn load(&mut self, at: Address, value: &[u8]) {
        if self.entry(at).is_some_and(|entry| entry.stored) {
            // A table of newer software may have another type: its own initial value is better.
            let _ = self.set_bytes(at, value);
        }
    }

    fn place(&self, at: Address) -> Result<usize, AbortCode> {
        self.table
            .find(at)
            .map_err(|others| if others { AbortCode::NO_SUB_INDEX } else { AbortCode::NO_OBJECT })
    }

    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    fn find(&mut self, at: Address) -> Result<(usize, &'a Entry<'a>), AbortCode> {
        if let Some(entry) = self.table.entries.get(self.last)
            && entry.at == at
        {
            return Ok((self.last, entry));
        }
        self.last = self.place(at)?;
        self.table.entries.get(self.last).map(|entry| (self.last, entry)).ok_or(AbortCode::NO_OBJECT)
    }

    /// A scalar in memory or a constant one.
    fn scalar(&self, place: usize) -> Option<Small> {
        let entry = self.table.entries.get(place)?;
        entry.data_type.size()?;
        Small::new(self.value(place, entry, &mut [0; 8])?)
    }

    /// The value of an entry that is not the application's; a number that lies nowhere in `own`.
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    fn value<'s>(&'s self, place: usize, entry: &Entry<'s>, own: &'s mut [u8; 8]) -> Option<&'s [u8]> {
        let number = match (entry.place, entry.initial) {
            (Place::Constant, Initial::Number(value)) => value,
            (Place::Store | Place::Restore, _) => ON_COMMAND.into(),
            _ => return slot(&self.table, place, entry, self.memory),
        };
        *own = number.to_le_bytes();
        own.get(..usize::from(entry.data_type.size()?))
    }

    fn write_scalar(&mut self, place: usize, entry: &Entry<'_>, piece: &Piece<'_>) -> Result<(), AbortCode> {
        let value = piece.exactly(entry.data_type.size().unwrap_or(0).into())?;
        match entry.place {
            Place::Store if value == SAVE => {
                let stored = Stored::new(self.table, self.memory, entry.at.sub);
                return self.hooks.store(entry.at.sub, stored);
            }
            Place::Restore if value == LOAD => return self.hooks.restore(entry.at.sub),
            // A wrong signature (CiA 301, 7.5.2.13 and 7.5.2.14).
            Place::Store | Place::Restore => return Err(AbortCode::CANNOT_STORE),
            _ => {}
        }
        check_limits(entry, value)?;
        self.hooks.check(entry.at, value)?;
        put(&self.table, place, self.memory, value);
        self.hooks.written(entry.at);
        Ok(())
    }

    fn write_string(&mut self, place: usize, entry: &Entry<'_>, piece: &Piece<'_>) -> Result<(), AbortCode> {
        let room = room(&self.table, place, self.memory).ok_or(AbortCode::GENERAL)?;
        let (length, bytes) = room.split_at_mut(usize::from(LENGTH));
        // Until its last piece has come, it is empty.
        let from = piece.offset as usize;
        let end = from.saturating_add(piece.data.len());
        let to = bytes.get_mut(from..end).ok_or(AbortCode::TOO_LONG)?;
        to.copy_from_slice(piece.data);
        length.copy_from_slice(&if piece.last { end as u16 } else { 0 }.to_le_bytes());
        if piece.last {
            self.hooks.written(entry.at);
        }
        Ok(())
    }
}

impl<H: Hooks> ProcessData for Dictionary<'_, H> {
    fn mapped_type(&self, at: Address, rpdo: bool) -> Result<DataType, AbortCode> {
        let entry = self.entry(at).ok_or(AbortCode::NO_OBJECT)?;
        if entry.is_mappable(rpdo) { Ok(entry.data_type) } else { Err(AbortCode::NOT_MAPPABLE) }
    }

    fn bits(&self, at: Address) -> u64 {
        let value = self.place(at).ok().and_then(|place| self.scalar(place)).unwrap_or_default();
        load(value.as_slice())
    }

    /// Within its limits, and unless the application vetoes it.
    fn set_bits(&mut self, at: Address, bits: u64) {
        let Ok((place, entry)) = self.find(at) else { return };
        let bytes = bits.to_le_bytes();
        let value = bytes.get(..usize::from(entry.data_type.size().unwrap_or(0))).unwrap_or(&[]);
        if matches!(entry.place, Place::Memory { .. })
            && check_limits(entry, value).is_ok()
            && self.hooks.check(at, value).is_ok()
            && put(&self.table, place, self.memory, value)
        {
            self.hooks.written(at);
        }
    }
}

/// The client's access; [`Objects`](super::Objects) adds the PDO parameters.
impl<H: Hooks> Access for Dictionary<'_, H> {
    #[inline]
    fn read(&mut self, at: Address, offset: u32, out: &mut [u8]) -> Result<(usize, Total), AbortCode> {
        let (place, entry) = self.find(at)?;
        if !entry.rights.can_read() {
            return Err(AbortCode::WRITE_ONLY);
        }
        if entry.place == Place::Application {
            return self.hooks.read(at, offset, out);
        }
        let mut own = [0; 8];
        let value = self.value(place, entry, &mut own).ok_or(AbortCode::NO_DATA)?;
        Ok(read_slice(value, offset, out))
    }

    fn begin_write(&mut self, at: Address, size: Option<u32>) -> Result<(), AbortCode> {
        let (_, entry) = self.find(at)?;
        if !entry.rights.can_write() {
            return Err(AbortCode::READ_ONLY);
        }
        match (entry.place, entry.data_type.size(), size) {
            (Place::Application, ..) => self.hooks.begin_write(at, size),
            (_, Some(expected), Some(size)) if size > u32::from(expected) => Err(AbortCode::TOO_LONG),
            (_, Some(expected), Some(size)) if size < u32::from(expected) => Err(AbortCode::TOO_SHORT),
            (Place::Memory { capacity }, None, Some(size)) if size > u32::from(capacity) => {
                Err(AbortCode::TOO_LONG)
            }
            _ => Ok(()),
        }
    }

    fn write(&mut self, at: Address, piece: &Piece<'_>) -> Result<(), AbortCode> {
        let (place, entry) = self.find(at)?;
        if !entry.rights.can_write() {
            return Err(AbortCode::READ_ONLY);
        }
        match (entry.place, entry.data_type.size()) {
            (Place::Application, _) => self.hooks.write(at, piece),
            (Place::Constant, _) => Err(AbortCode::READ_ONLY),
            (_, Some(_)) => self.write_scalar(place, entry, piece),
            (_, None) => self.write_string(place, entry, piece),
        }
    }

    fn abandon(&mut self, at: Address) {
        if self.entry(at).is_some_and(|entry| entry.place == Place::Application) {
            self.hooks.abandon(at);
        }
    }
}

fn check_limits(entry: &Entry<'_>, value: &[u8]) -> Result<(), AbortCode> {
    entry.limits.map_or(Ok(()), |limits| limits.check(entry.data_type, value))
}

/// The memory of an entry.
fn room<'m>(table: &View<'_>, place: usize, memory: &'m mut [u8]) -> Option<&'m mut [u8]> {
    let len = usize::from(table.entries.get(place)?.memory());
    let offset = usize::from(*table.offsets.get(place)?);
    memory.get_mut(offset..offset + len).filter(|room| !room.is_empty())
}

/// The value of an entry in memory, or a constant string.
#[cfg_attr(target_pointer_width = "32", inline(never))]
#[cfg_attr(not(target_pointer_width = "32"), inline)]
pub(super) fn slot<'m>(
    table: &View<'m>,
    place: usize,
    entry: &Entry<'m>,
    memory: &'m [u8],
) -> Option<&'m [u8]> {
    match (entry.place, entry.initial) {
        (Place::Constant, Initial::Bytes(bytes)) => return Some(bytes),
        (Place::Memory { .. }, _) => {}
        _ => return None,
    }
    let room = memory.get(usize::from(*table.offsets.get(place)?)..)?;
    if let Some(size) = entry.data_type.size() {
        return room.get(..usize::from(size));
    }
    let (length, bytes) = room.split_first_chunk()?;
    bytes.get(..usize::from(u16::from_le_bytes(*length)))
}

/// Sets the value of an entry in memory; `false` if it does not fit or has no memory.
fn put(table: &View<'_>, place: usize, memory: &mut [u8], value: &[u8]) -> bool {
    let Some(entry) = table.entries.get(place) else { return false };
    let Some(room) = room(table, place, memory) else { return false };
    if entry.data_type.size().is_some() {
        let fits = room.len() == value.len();
        if fits {
            room.copy_from_slice(value);
        }
        return fits;
    }
    let Some((length, bytes)) = room.split_first_chunk_mut() else { return false };
    let Some(bytes) = bytes.get_mut(..value.len()) else { return false };
    bytes.copy_from_slice(value);
    *length = (value.len() as u16).to_le_bytes();
    true
}
