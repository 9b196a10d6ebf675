//! The communication objects (CiA 301, 7.5.2) between the dictionary and the engines.

use pdo::Address;

use crate::emcy;
use crate::sdo::{AbortCode, Access, Piece, Total, read_slice};

/// Error register.
const ERROR_REGISTER: u16 = 0x1001;
/// Pre-defined error field.
const ERROR_HISTORY: u16 = 0x1003;

/// The application's dictionary as the SDO server sees it: 1001h and 1003h are the engine's, and what
/// is written to the communication area is noted, so that it takes effect.
pub(super) struct View<'a, D, const E: usize> {
    pub(super) dictionary: &'a mut D,
    pub(super) register: u8,
    pub(super) emergencies: &'a mut emcy::Producer<E>,
    /// The last object written.
    pub(super) written: Option<Address>,
}

impl<D: Access, const E: usize> Access for View<'_, D, E> {
    fn read(&mut self, at: Address, offset: u32, out: &mut [u8]) -> Result<(usize, Total), AbortCode> {
        match (at.index, at.sub) {
            (ERROR_REGISTER, 0) => Ok(read_slice(&[self.register], offset, out)),
            (ERROR_HISTORY, 0) => Ok(read_slice(&[self.emergencies.history().len() as u8], offset, out)),
            (ERROR_HISTORY, sub) => match self.emergencies.history().get(usize::from(sub) - 1) {
                Some(entry) => Ok(read_slice(&entry.to_le_bytes(), offset, out)),
                None => Err(AbortCode::NO_DATA),
            },
            _ => self.dictionary.read(at, offset, out),
        }
    }

    fn begin_write(&mut self, at: Address, size: Option<u32>) -> Result<(), AbortCode> {
        match at.index {
            ERROR_REGISTER | ERROR_HISTORY => Ok(()),
            _ => self.dictionary.begin_write(at, size),
        }
    }

    fn write(&mut self, at: Address, piece: &Piece<'_>) -> Result<(), AbortCode> {
        match (at.index, at.sub) {
            (ERROR_REGISTER, _) | (ERROR_HISTORY, 1..) => Err(AbortCode::READ_ONLY),
            (ERROR_HISTORY, 0) if piece.data.iter().any(|byte| *byte != 0) => Err(AbortCode::INVALID_VALUE),
            (ERROR_HISTORY, 0) => {
                self.emergencies.clear_history();
                Ok(())
            }
            _ => {
                self.dictionary.write(at, piece)?;
                if piece.last {
                    self.written = Some(at);
                }
                Ok(())
            }
        }
    }

    fn abandon(&mut self, at: Address) {
        if at.index != ERROR_REGISTER && at.index != ERROR_HISTORY {
            self.dictionary.abandon(at);
        }
    }
}

/// A number of up to 4 bytes; `None` where the dictionary does not have the object.
pub(super) fn number(dictionary: &mut impl Access, index: u16, sub: u8) -> Option<u32> {
    let mut bytes = [0; 4];
    dictionary.read(Address::new(index, sub), 0, &mut bytes).ok()?;
    Some(u32::from_le_bytes(bytes))
}
