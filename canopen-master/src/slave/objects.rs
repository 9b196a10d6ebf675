//! The communication objects (CiA 301, 7.5.2) between the dictionary and the engines.

use pdo::Address;

use super::errors::Errors;
use crate::sdo::{AbortCode, Access, Piece, Total, read_slice};

/// Error register.
const ERROR_REGISTER: u16 = 0x1001;
/// Pre-defined error field.
const ERROR_HISTORY: u16 = 0x1003;

/// The application's dictionary as the SDO server sees it: 1001h and 1003h are the engine's, and what
/// is written to the communication area is noted, so that it takes effect.
pub(super) struct View<'a, D> {
    pub(super) dictionary: &'a mut D,
    pub(super) errors: &'a mut Errors,
    /// The last object written.
    pub(super) written: Option<Address>,
}

impl<D: Access> Access for View<'_, D> {
    fn read(&mut self, at: Address, offset: u32, out: &mut [u8]) -> Result<(usize, Total), AbortCode> {
        let history = self.errors.history();
        let (value, size) = match (at.index, at.sub) {
            (ERROR_REGISTER, 0) => (self.errors.register().into(), 1),
            (ERROR_REGISTER, _) => return Err(AbortCode::NO_SUB_INDEX),
            (ERROR_HISTORY, 0) => (history.len() as u32, 1),
            (ERROR_HISTORY, sub) => (*history.get(usize::from(sub) - 1).ok_or(AbortCode::NO_DATA)?, 4),
            _ => return self.dictionary.read(at, offset, out),
        };
        Ok(read_slice(value.to_le_bytes().get(..size).unwrap_or(&[]), offset, out))
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
                self.errors.producer().clear_history();
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

/// A number of up to 4 bytes, or what it is where the dictionary does not have the object.
#[cfg_attr(target_pointer_width = "32", inline(never))]
pub(super) fn number(dictionary: &mut impl Access, index: u16, sub: u8, absent: u32) -> u32 {
    let mut bytes = [0; 4];
    match dictionary.read(Address::new(index, sub), 0, &mut bytes) {
        Ok(_) => u32::from_le_bytes(bytes),
        Err(_) => absent,
    }
}
