//! A MotionController between its interfaces: parameters, failures, flash and RAM banks, and the LB2
//! device that shows them (manual A, chapters 4.3.4 and 6, Appendix 1).

use core::time::Duration;

use lb2::code::{ErrorCode, Failure, StoredFailure, Version};
use lb2::device::{Device, LoaderAnswer};
use lb2::telegram::{BANK_LEN, Description, MAX_FAILURES, Text, bank};

use crate::loader::{self, Finding};
use crate::parameters::{COUNT, Values, get};
use crate::storage::{Record, Storage, StorageError};

/// Device models (manual A 1.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Model {
    /// GEL 8230: with display and keys.
    Gel8230,
    /// GEL 8231: as 8230, with more inputs.
    Gel8231,
    /// GEL 8235: for mounting plates, without display.
    Gel8235,
    /// GEL 8236: as 8235, with more inputs.
    Gel8236,
}

impl Model {
    /// All models.
    pub const ALL: [Self; 4] = [Self::Gel8230, Self::Gel8231, Self::Gel8235, Self::Gel8236];

    /// The model number, which is also the device code of LB2 40h in binary: 8230 = 2026h.
    #[must_use]
    pub const fn number(self) -> u16 {
        match self {
            Self::Gel8230 => 8230,
            Self::Gel8231 => 8231,
            Self::Gel8235 => 8235,
            Self::Gel8236 => 8236,
        }
    }

    /// Whether it has the inputs I4, I62, I63 and I54…I57 (3.8 to 3.10, 7.2).
    #[must_use]
    pub const fn has_extra_inputs(self) -> bool {
        matches!(self, Self::Gel8231 | Self::Gel8236)
    }

    /// The model with this number.
    #[must_use]
    pub fn from_number(number: u16) -> Option<Self> {
        Self::ALL.into_iter().find(|model| model.number() == number)
    }
}

/// Greatest number of axes of every model.
pub const AXES: u8 = 6;
/// Version of the operating system that this one follows: firmware 5.15, of manual A's last edition.
pub const OS_VERSION: Version = Version { version: 5, revision: 15 };

/// Parameters as saved by 35h.
const SAVED: Record = Record::new(0, COUNT);
/// The parameter image (6.2.2).
const IMAGE: Record = Record::new(SAVED.end(), COUNT);
/// Run time and stored failures.
const STATUS: Record = Record::new(IMAGE.end(), STATUS_WORDS);
const STATUS_WORDS: usize = 3 + MAX_FAILURES;
/// Flash banks 15 and 16.
const FLASH: usize = STATUS.end();
/// Bytes of [`Storage`] that a controller needs.
pub const STORAGE_LEN: usize = FLASH + 2 * BANK_LEN;

/// How often the run time is retained.
const RETAIN: Duration = Duration::from_secs(60);

/// A whole controller. `S` is its non-volatile memory of [`STORAGE_LEN`] bytes, `R` its RAM bank 12 of
/// 65536 bytes (where it is shorter, accesses beyond its end are refused with error 27h).
#[derive(Debug)]
pub struct Controller<S, R> {
    model: Model,
    storage: S,
    ram: R,
    /// As written by 32h and 33h.
    edited: Values,
    /// As taken over by the loader: what is effective, and what 35h saves.
    working: Values,
    failures: [StoredFailure; MAX_FAILURES],
    failure_count: u8,
    run_time: Duration,
    since_retained: Duration,
    retain: bool,
    /// Write pointers of 23h for banks 15 and 16.
    pointers: [usize; 2],
}

/// Where [`Controller::reset`] takes the parameters from (6.2.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reset {
    /// Factory defaults.
    Factory,
    /// The image made by [`Controller::create_image`].
    Image,
}

/// Why parameters could not be reset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ResetError {
    /// No image was created.
    #[error("there is no parameter image")]
    NoImage,
    /// The non-volatile memory failed.
    #[error(transparent)]
    Storage(#[from] StorageError),
}

impl<S: Storage, R: AsRef<[u8]> + AsMut<[u8]>> Controller<S, R> {
    /// Switches a controller on: parameters, failures and run time come from `storage`, or are as
    /// delivered where nothing (or nothing readable) was saved there.
    pub fn power_on(model: Model, storage: S, ram: R) -> Self {
        let working = load(&SAVED, &storage).unwrap_or_default();
        let mut controller = Self {
            model,
            storage,
            ram,
            edited: working.clone(),
            working,
            failures: [StoredFailure { axis: 0, failure: Failure(0) }; MAX_FAILURES],
            failure_count: 0,
            run_time: Duration::ZERO,
            since_retained: Duration::ZERO,
            retain: false,
            pointers: [0; 2],
        };
        controller.load_status();
        controller
    }

    /// Switches the controller off: what is left is its non-volatile memory.
    pub fn power_off(self) -> S {
        self.storage
    }

    /// The model.
    #[must_use]
    pub const fn model(&self) -> Model {
        self.model
    }

    /// The parameters that are effective.
    #[must_use]
    pub const fn working(&self) -> &Values {
        &self.working
    }

    /// The parameters as written, not yet taken over by the loader.
    #[must_use]
    pub const fn edited(&self) -> &Values {
        &self.edited
    }

    /// Time switched on, over the whole life (4.3.4.3); kept to the minute when power is lost.
    #[must_use]
    pub const fn run_time(&self) -> Duration {
        self.run_time
    }

    /// Lets time pass: counts the run time and retains what is to survive a loss of power.
    ///
    /// # Errors
    /// [`StorageError`] if the non-volatile memory cannot be written; it is tried again next time.
    pub fn advance(&mut self, elapsed: Duration) -> Result<(), StorageError> {
        self.run_time = self.run_time.saturating_add(elapsed);
        self.since_retained = self.since_retained.saturating_add(elapsed);
        if self.retain || self.since_retained >= RETAIN {
            self.save_status()?;
            self.since_retained = Duration::ZERO;
            self.retain = false;
        }
        Ok(())
    }

    /// Sets the parameters back (6.2.1). They are effective at once, and saved.
    ///
    /// # Errors
    /// [`ResetError`]; the parameters are as they were.
    pub fn reset(&mut self, to: Reset) -> Result<(), ResetError> {
        let values = match to {
            Reset::Factory => Values::factory(),
            Reset::Image => load(&IMAGE, &self.storage).ok_or(ResetError::NoImage)?,
        };
        SAVED.save(&mut self.storage, values.as_array())?;
        self.working = values.clone();
        self.edited = values;
        Ok(())
    }

    /// Files a copy of all effective parameters as the parameter image (6.2.2).
    ///
    /// # Errors
    /// [`StorageError`]; an older image is still there.
    pub fn create_image(&mut self) -> Result<(), StorageError> {
        IMAGE.save(&mut self.storage, self.working.as_array())
    }

    /// Runs the loader (34h): corrects and checks the edited parameters, tells every finding, and
    /// makes them effective unless one of the findings is an error.
    pub fn load(&mut self, mut found: impl FnMut(Finding)) -> bool {
        loader::correct(&mut self.edited);
        let mut good = true;
        loader::check(&self.edited, |finding| {
            good &= !finding.rule.code.is_error();
            found(finding);
        });
        if good {
            self.working = self.edited.clone();
        }
        good
    }

    fn load_status(&mut self) {
        let mut words = [0; STATUS_WORDS];
        if !STATUS.load(&self.storage, &mut words).unwrap_or(false) {
            return;
        }
        let [low, high, count, failures @ ..] = words;
        let seconds = u64::from(low as u32) | u64::from(high as u32) << 32;
        self.run_time = Duration::from_secs(seconds);
        self.failure_count = u8::try_from(count).unwrap_or(0).min(MAX_FAILURES as u8);
        for (stored, word) in self.failures.iter_mut().zip(failures) {
            let [axis, failure, ..] = word.to_le_bytes();
            *stored = StoredFailure { axis, failure: Failure(failure) };
        }
    }

    fn save_status(&mut self) -> Result<(), StorageError> {
        let seconds = self.run_time.as_secs();
        let mut words = [0; STATUS_WORDS];
        let [low, high, count, failures @ ..] = &mut words;
        *low = seconds as u32 as i32;
        *high = (seconds >> 32) as u32 as i32;
        *count = i32::from(self.failure_count);
        for (word, stored) in failures.iter_mut().zip(&self.failures) {
            *word = i32::from_le_bytes([stored.axis, stored.failure.0, 0, 0]);
        }
        STATUS.save(&mut self.storage, &words)
    }

    fn ram(&self, offset: u16, len: usize) -> Option<&[u8]> {
        self.ram.as_ref().get(usize::from(offset)..usize::from(offset) + len)
    }
}

fn load(record: &Record, storage: &impl Storage) -> Option<Values> {
    let mut words = [0; COUNT];
    if !record.load(storage, &mut words).unwrap_or(false) {
        return None;
    }
    Values::from_array(words).ok()
}

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
        self.failure_count
    }

    fn failure(&self, position: u8) -> Option<StoredFailure> {
        let stored = self.failures.get(..usize::from(self.failure_count))?;
        stored.get(usize::from(position)).copied()
    }

    fn delete_failures(&mut self) -> u8 {
        self.retain = true;
        core::mem::take(&mut self.failure_count)
    }

    /// The list holds 20 failures; of more, the oldest is dropped (project-defined).
    fn store_failure(&mut self, failure: StoredFailure) {
        self.retain = true;
        match self.failures.get_mut(usize::from(self.failure_count)) {
            Some(slot) => {
                *slot = failure;
                self.failure_count += 1;
            }
            None => {
                self.failures.rotate_left(1);
                if let Some(last) = self.failures.last_mut() {
                    *last = failure;
                }
            }
        }
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
