//! The controller as an LB2 device (Appendix 1).

use lb2::code::{ErrorCode, StoredFailure, Version};
use lb2::device::{Device, LoaderAnswer};
use lb2::telegram::{BANK_LEN, Description, Text, bank};

use super::{AXES, Controller, FLASH, OS_VERSION, SAVED};
use crate::loader;
use crate::parameters::get;
use crate::storage::Storage;

/// Place of a flash bank among the two.
const fn which(bank: u8) -> usize {
    if bank == bank::FLASH_15 { 0 } else { 1 }
}

/// Value of an erased flash cell.
const ERASED: u8 = 0xFF;

impl<S: Storage, R: AsRef<[u8]> + AsMut<[u8]>> Device for Controller<S, R> {
    fn device_number(&self) -> u8 {
        self.working.at(5, 0).clamp(0, 31) as u8
    }

    fn device_type(&self) -> (u16, u8) {
        (self.model.number(), AXES)
    }

    fn os_version(&self) -> Version {
        OS_VERSION
    }

    fn custom_version(&self) -> Version {
        Version { version: 0, revision: 0 }
    }

    fn failure_count(&self) -> u8 {
        // At most 20.
        self.failures.stored().len() as u8
    }

    fn failure(&self, position: u8) -> Option<StoredFailure> {
        self.failures.stored().get(usize::from(position)).copied()
    }

    fn delete_failures(&mut self) -> u8 {
        self.retain = true;
        self.failures.clear() as u8
    }

    fn store_failure(&mut self, failure: StoredFailure) {
        self.retain = true;
        self.failures.store(failure);
    }

    fn erase_flash(&mut self, bank: u8) -> Result<(), ErrorCode> {
        let base = FLASH + which(bank) * BANK_LEN;
        let erased = [ERASED; 256];
        for block in 0..BANK_LEN / erased.len() {
            self.storage.write(base + block * erased.len(), &erased).map_err(|_| ErrorCode::FLASH_DELETE)?;
        }
        if let Some(pointer) = self.pointers.get_mut(which(bank)) {
            *pointer = 0;
        }
        Ok(())
    }

    /// A memory that cannot be read answers as a faulty flash component (22h).
    fn read_flash(&self, bank: u8, offset: u16, out: &mut [u8]) -> Result<(), ErrorCode> {
        let base = FLASH + which(bank) * BANK_LEN + usize::from(offset);
        self.storage.read(base, out).map_err(|_| ErrorCode::FLASH_DELETE)
    }

    fn write_flash(&mut self, bank: u8, enable: bool, data: &[u8]) -> Result<(), ErrorCode> {
        if !enable {
            return Err(ErrorCode::FLASH_PROTECTED);
        }
        let pointer = self.pointers.get(which(bank)).copied().unwrap_or(0);
        if pointer + data.len() > BANK_LEN {
            return Err(ErrorCode::RANGE);
        }
        if !data.is_empty() {
            // Below BANK_LEN, for there is room for data.
            self.write_flash_at(bank, u16::try_from(pointer).map_err(|_| ErrorCode::RANGE)?, data)?;
        }
        if let Some(pointer) = self.pointers.get_mut(which(bank)) {
            *pointer += data.len();
        }
        Ok(())
    }

    /// A cell that is not erased is error 23h, and nothing is written (decision 5).
    fn write_flash_at(&mut self, bank: u8, offset: u16, data: &[u8]) -> Result<(), ErrorCode> {
        let base = FLASH + which(bank) * BANK_LEN + usize::from(offset);
        for at in 0..data.len() {
            let mut cell = [0];
            self.storage.read(base + at, &mut cell).map_err(|_| ErrorCode::FLASH_WRITE)?;
            if cell != [ERASED] {
                return Err(ErrorCode::FLASH_WRITE);
            }
        }
        self.storage.write(base, data).map_err(|_| ErrorCode::FLASH_WRITE)
    }

    fn read_ram(&self, _bank: u8, offset: u16, out: &mut [u8]) -> Result<(), ErrorCode> {
        let from = self.ram(offset, out.len()).ok_or(ErrorCode::RANGE)?;
        out.copy_from_slice(from);
        Ok(())
    }

    fn write_ram(&mut self, _bank: u8, offset: u16, data: &[u8]) -> Result<(), ErrorCode> {
        let offset = usize::from(offset);
        let to = self.ram.as_mut().get_mut(offset..offset + data.len()).ok_or(ErrorCode::RANGE)?;
        to.copy_from_slice(data);
        Ok(())
    }

    fn read_parameter(&self, index: u16) -> i32 {
        self.edited.get(index).unwrap_or(0)
    }

    fn describe_parameter(&self, index: u16) -> Description<'_> {
        let Some(entry) = get(index) else { return Description { index, ..Description::default() } };
        let variant = entry.choice(self.edited.of(entry)).map_or(Text::default(), |choice| choice.variant());
        Description {
            index,
            variant,
            minimum: entry.minimum(),
            maximum: entry.maximum(),
            default: entry.default(),
            name: Text::from(entry.name()),
            group: Text::from(entry.group()),
        }
    }

    fn write_parameter(&mut self, index: u16, value: i32) -> LoaderAnswer<'_> {
        let (code, text) = match self.edited.set(index, value) {
            Ok(_) if loader::is_no_address(index, value) => {
                loader::correct(&mut self.edited);
                loader::NO_ADDRESS
            }
            Ok(old) => loader::remark(index, old != value),
            Err(error) => loader::refusal(&error),
        };
        LoaderAnswer { code, text: Text::from(text) }
    }

    fn call_loader(&mut self) -> i32 {
        let mut first = None;
        self.load(|finding| {
            first.get_or_insert(i32::from(finding.index));
        });
        first.unwrap_or(-1)
    }

    /// Saves what is effective: parameters that the loader has refused never reach the flash
    /// (project-defined).
    fn save_parameters(&mut self) -> Result<(), ErrorCode> {
        SAVED.save(&mut self.storage, self.working.as_array()).map_err(|_| ErrorCode::FLASH_WRITE)
    }
}
