//! A MotionController between its interfaces: parameters, failures, flash and RAM banks, the LB2
//! device that shows them, and the control cycle (manual A, chapters 1.4, 4.3.4 and 6, Appendix 1).

mod device;
mod model;
mod service;

pub use model::Model;
pub use service::{CONFIGURATION_PASSWORD, ComPort, Parity, SERVICE_PASSWORD, SerialPort, WrongPassword};

use core::time::Duration;

use lb2::code::{Failure, StoredFailure, Version};
use lb2::telegram::{BANK_LEN, MAX_FAILURES};

use crate::application::{Application, AxisAccess, AxisStatus};
use crate::axis::Axis;
use crate::bus::CanBus;
use crate::control::{Control, DRIVES, DriveInputs};
use crate::failure::FailureLog;
use crate::input::ActualValue;
use crate::io::{FieldBus, Inputs, Outputs};
use crate::loader::{self, Finding};
use crate::parameters::{COUNT, Values};
use crate::storage::{Record, Storage, StorageError};

/// Greatest number of axes of every model.
pub const AXES: u8 = 6;
/// Version of the operating system that this one follows: firmware 5.15, of manual A's last edition.
pub const OS_VERSION: Version = Version { version: 5, revision: 15 };

/// Parameters as saved by 35h.
const SAVED: Record = Record::new(0, COUNT);
/// The parameter image (6.2.2).
const IMAGE: Record = Record::new(SAVED.end(), COUNT);
/// Run time, internal offsets of the actual value inputs, and stored failures.
const STATUS: Record = Record::new(IMAGE.end(), STATUS_WORDS);
const STATUS_WORDS: usize = 3 + AXES as usize + MAX_FAILURES;
/// Flash banks 15 and 16.
const FLASH: usize = STATUS.end();
/// Number of the model, whose memory it is.
const MODEL: Record = Record::new(FLASH + 2 * BANK_LEN, 1);
/// Bytes of [`Storage`] that a controller needs.
pub const STORAGE_LEN: usize = MODEL.end();

/// Places of the drives of CAN 1 (objects 1 and 2) and CAN 2 (objects 1…4) among all.
const PLACES: [core::ops::Range<usize>; 2] = [0..2, 2..6];

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
    control: Control<Axis>,
    buses: [CanBus; 2],
    failures: FailureLog,
    run_time: Duration,
    since_retained: Duration,
    retain: bool,
    /// Whether a scan that was begun by hand is under way.
    manual_scan: bool,
    /// Whether user interfaces let everybody configure, until power is lost (4.3.4.5).
    service_mode: bool,
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
    /// delivered where nothing (or nothing readable, see [`is_damaged`]) was saved there.
    pub fn power_on(model: Model, storage: S, ram: R) -> Self {
        let working = load(&SAVED, &storage).unwrap_or_default();
        let status = Status::load(&storage).unwrap_or_default();
        Self {
            model,
            storage,
            ram,
            edited: working.clone(),
            control: Control::new(model, &working, status.offsets),
            buses: [0, 1].map(|at| CanBus::new(model.number(), &working, at)),
            working,
            failures: status.failures,
            run_time: status.run_time,
            since_retained: Duration::ZERO,
            retain: false,
            manual_scan: false,
            service_mode: false,
            pointers: [0; 2],
        }
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
            let status = Status {
                run_time: self.run_time,
                offsets: self.control.offsets(),
                failures: self.failures.clone(),
            };
            status.save(&mut self.storage)?;
            if stored_model(&self.storage) != Some(self.model.number()) {
                MODEL.save(&mut self.storage, &[i32::from(self.model.number())])?;
            }
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
        self.edited = values;
        self.take_over();
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
            self.take_over();
        }
        good
    }

    /// Makes the edited parameters effective.
    fn take_over(&mut self) {
        self.working = self.edited.clone();
        let mut left = [false; DRIVES];
        for (bus, places) in self.buses.iter_mut().zip(PLACES) {
            let of_bus = left.iter_mut().skip(places.start).take(places.len());
            of_bus.zip(bus.configure(&self.working)).for_each(|(to, from)| *to = from);
        }
        self.control.lose_drives(&left);
        self.control.configure(&self.working);
        // Another type of input sets its offset back.
        self.retain = true;
    }

    /// Length of a control cycle: 1 ms × activated axes (`[000]`).
    #[must_use]
    pub const fn cycle_time(&self) -> Duration {
        Duration::from_millis(self.control.cycle_time() as u64)
    }

    /// One control cycle at `now`: terminals in, terminals out; the buses' set values are ready to be
    /// sent then. Failures are stored, and [`advance`](Self::advance) retains them.
    ///
    /// While a scan runs that was begun by [`scan`](Self::scan), application and feedback control
    /// stand still, as 4.3.4.4 says, and nothing is put out.
    pub fn cycle(&mut self, now: Duration, inputs: &Inputs, application: &mut impl Application) -> Outputs {
        let Self { control, buses, failures, retain, manual_scan, .. } = self;
        *manual_scan &= buses.iter().any(CanBus::is_scanning);
        if *manual_scan {
            return Outputs::default();
        }
        let mut drives = DriveInputs::default();
        for (bus, places) in buses.iter_mut().zip(PLACES) {
            bus.read_drives(now, places.start, places.len(), &mut drives);
        }
        let offsets = control.offsets();
        let outputs = control.cycle(inputs, &drives, buses, application, |failure| {
            failures.store(failure);
            *retain = true;
        });
        for (bus, places) in buses.iter_mut().zip(PLACES) {
            let wanted = outputs.drives.get(places).unwrap_or(&[]);
            for (place, wanted) in wanted.iter().enumerate() {
                if let Some(wanted) = wanted {
                    bus.command(now, place, wanted);
                }
            }
        }
        *retain |= control.offsets() != offsets;
        outputs.terminals
    }

    /// Begins anew on both CAN buses, as after switching on: the roles of `[300]`…`[303]` that are effective
    /// only then (6.5.1) are so now.
    pub fn restart_buses(&mut self) {
        self.buses = [0, 1].map(|at| CanBus::new(self.model.number(), &self.working, at));
        self.manual_scan = false;
    }

    /// CAN 1 (0) or CAN 2 (1): frames and time go in, frames come out.
    pub fn bus(&mut self, at: usize) -> Option<&mut CanBus> {
        self.buses.get_mut(at)
    }

    /// Scans a bus, 0 or 1, by hand (4.3.4.4); to be called with all axes at standstill. Whether there is
    /// such a bus.
    pub fn scan(&mut self, at: usize) -> bool {
        let Some(bus) = self.buses.get_mut(at) else { return false };
        bus.scan();
        self.manual_scan = true;
        true
    }

    /// Exchanges the process image with the field bus in the extension slot (6.9).
    pub fn exchange(&mut self, bus: &mut impl FieldBus) {
        self.control.exchange(bus, &self.working);
    }

    /// Status of an axis, 0…5, after the last cycle.
    #[must_use]
    pub fn axis_status(&self, axis: usize) -> Option<&AxisStatus> {
        self.control.status(axis)
    }

    /// An axis, 0…5, to be moved by hand from outside of the application, as with the keys of the
    /// device (4.3.2).
    pub fn axis(&mut self, axis: usize) -> Option<&mut AxisAccess> {
        self.control.access(axis)
    }

    /// The stored failures (4.3.4.2).
    #[must_use]
    pub const fn failures(&self) -> &FailureLog {
        &self.failures
    }

    /// Values of the actual value inputs in the last cycle.
    #[must_use]
    pub const fn actual_values(&self) -> &[ActualValue; AXES as usize] {
        self.control.actual_values()
    }

    /// Whether the application runs (I3.7, `[003]`).
    #[must_use]
    pub const fn is_running(&self) -> bool {
        self.control.is_running()
    }

    fn ram(&self, offset: u16, len: usize) -> Option<&[u8]> {
        self.ram.as_ref().get(usize::from(offset)..usize::from(offset) + len)
    }
}

/// Number of the model whose memory this is; `None` while none has retained anything there.
#[must_use]
pub fn stored_model(storage: &impl Storage) -> Option<u16> {
    let mut words = [0];
    let [model] = MODEL.load(storage, &mut words).ok()?.then_some(words)?;
    u16::try_from(model).ok()
}

/// Whether a memory holds what cannot be read any more: [`Controller::power_on`] takes what was saved there
/// before it, or what is delivered, in its place.
///
/// # Errors
/// [`StorageError`] if the memory cannot be read.
pub fn is_damaged(storage: &impl Storage) -> Result<bool, StorageError> {
    for record in [SAVED, IMAGE, STATUS, MODEL] {
        if record.is_damaged(storage)? {
            return Ok(true);
        }
    }
    Ok(false)
}

fn load(record: &Record, storage: &impl Storage) -> Option<Values> {
    let mut words = [0; COUNT];
    if !record.load(storage, &mut words).unwrap_or(false) {
        return None;
    }
    Values::from_array(words).ok()
}

/// What survives a loss of power besides parameters.
#[derive(Debug, Default)]
struct Status {
    run_time: Duration,
    offsets: [i32; AXES as usize],
    failures: FailureLog,
}

impl Status {
    fn load(storage: &impl Storage) -> Option<Self> {
        let mut words = [0; STATUS_WORDS];
        if !STATUS.load(storage, &mut words).unwrap_or(false) {
            return None;
        }
        let [low, high, count, rest @ ..] = words;
        let seconds = u64::from(low as u32) | u64::from(high as u32) << 32;
        let (offsets, failures) = rest.split_first_chunk()?;
        let mut status = Self {
            run_time: Duration::from_secs(seconds),
            offsets: *offsets,
            failures: FailureLog::default(),
        };
        for word in failures.iter().take(usize::try_from(count).unwrap_or(0)) {
            let [axis, failure, ..] = word.to_le_bytes();
            status.failures.store(StoredFailure { axis, failure: Failure(failure) });
        }
        Some(status)
    }

    fn save(&self, storage: &mut impl Storage) -> Result<(), StorageError> {
        let seconds = self.run_time.as_secs();
        let stored = self.failures.stored();
        let mut words = [0; STATUS_WORDS];
        let head = [seconds as u32 as i32, (seconds >> 32) as u32 as i32, stored.len() as i32];
        let failures = stored.iter().map(|stored| i32::from_le_bytes([stored.axis, stored.failure.0, 0, 0]));
        for (word, value) in words.iter_mut().zip(head.into_iter().chain(self.offsets).chain(failures)) {
            *word = value;
        }
        STATUS.save(storage, &words)
    }
}
