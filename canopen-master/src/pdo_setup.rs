//! Reading and writing the parameters of a node's PDOs over SDO, in the order that CiA 301 (7.5.2.35…38)
//! asks for: disable, count 0, entries, count, communication parameters, enable.
//!
//! [`Write`] and [`Read`] name one SDO transfer after the other; the caller carries them out, with
//! whatever client, and hands the outcome back.
//!
//! ```
//! use canopen_master::pdo_setup::{Parameters, PdoNumber, Write};
//! use canopen_master::sdo::Outcome;
//! use pdo::layout::ds402;
//! use pdo::{CobId, Mapping, Transmission};
//!
//! let parameters: Parameters<8> = Parameters {
//!     mapping: Some(Mapping::new(ds402::tpdo(3).unwrap_or_default())?),
//!     ..Parameters::new(CobId(0x385), Transmission::SyncCyclic(1))
//! };
//! let mut write = Write::new(PdoNumber::tpdo(3)?, &parameters);
//! while let Some((at, value)) = write.request() {
//!     // client.download(at, value, …), then its outcome:
//!     let outcome = Outcome::Done(value.as_slice().len() as u32);
//!     write.handle(outcome)?;
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use core::fmt;

use pdo::mapping::{Entry, MAX_ENTRIES, MappingError};
use pdo::{Address, CobId, Mapping, Transmission, TransmissionError};

use crate::data_type::LengthError;
use crate::sdo::{AbortCode, Outcome, Small};

/// The most PDOs of a node in each direction.
pub const MAX_PDOS: u16 = 512;

/// Which PDO of a node, named from the node's view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct PdoNumber {
    rpdo: bool,
    number: u16,
}

/// A number that no PDO has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("PDO {0}, 1 to 512 expected")]
pub struct PdoNumberError(pub u16);

impl PdoNumber {
    /// RPDO `number`.
    ///
    /// # Errors
    /// [`PdoNumberError`] outside 1…512.
    pub const fn rpdo(number: u16) -> Result<Self, PdoNumberError> {
        Self::new(true, number)
    }

    /// TPDO `number`.
    ///
    /// # Errors
    /// [`PdoNumberError`] outside 1…512.
    pub const fn tpdo(number: u16) -> Result<Self, PdoNumberError> {
        Self::new(false, number)
    }

    const fn new(rpdo: bool, number: u16) -> Result<Self, PdoNumberError> {
        match number {
            1..=MAX_PDOS => Ok(Self { rpdo, number }),
            _ => Err(PdoNumberError(number)),
        }
    }

    /// Communication parameter: 1400h… or 1800h…
    #[must_use]
    pub const fn communication(self) -> u16 {
        if self.rpdo { 0x13FF + self.number } else { 0x17FF + self.number }
    }

    /// Mapping parameter: 1600h… or 1A00h…
    #[must_use]
    pub const fn mapping(self) -> u16 {
        self.communication() + 0x200
    }
}

impl fmt::Display for PdoNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", if self.rpdo { "RPDO" } else { "TPDO" }, self.number)
    }
}

/// The parameters of a PDO. What is `None` is not written, and was not there when read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parameters<const M: usize = MAX_ENTRIES> {
    /// Sub-index 01h. Where it is not valid, the PDO stays disabled.
    pub cob_id: CobId,
    /// Sub-index 02h.
    pub transmission: Transmission,
    /// Sub-index 03h, 100 µs.
    pub inhibit: Option<u16>,
    /// Sub-index 05h, 1 ms.
    pub event_timer: Option<u16>,
    /// Sub-index 06h, of a TPDO.
    pub sync_start: Option<u8>,
    /// The mapped objects; `None` leaves the mapping of the device.
    pub mapping: Option<Mapping<M>>,
}

impl<const M: usize> Parameters<M> {
    /// Only these two.
    #[must_use]
    pub const fn new(cob_id: CobId, transmission: Transmission) -> Self {
        Self { cob_id, transmission, inhibit: None, event_timer: None, sync_start: None, mapping: None }
    }
}

/// One step of reading or writing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Step {
    /// Bit 31 of the COB-ID is set.
    Disable,
    /// The number of mapped objects becomes 0.
    Clear,
    /// Entry of the mapping, from 1; when read, it is not known yet.
    Entry(u8, Option<Entry>),
    /// The number of mapped objects.
    Count,
    /// Transmission type.
    Transmission,
    /// Inhibit time.
    Inhibit,
    /// Event timer.
    EventTimer,
    /// SYNC start value.
    SyncStart,
    /// The COB-ID; when written, the PDO lives again.
    CobId,
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Disable => "disable the PDO",
            Self::Clear => "set the number of mapped objects to 0",
            Self::Entry(number, Some(entry)) => return write!(f, "map entry {number}, {entry}"),
            Self::Entry(number, None) => return write!(f, "mapping entry {number}"),
            Self::Count => "number of mapped objects",
            Self::Transmission => "transmission type",
            Self::Inhibit => "inhibit time",
            Self::EventTimer => "event timer",
            Self::SyncStart => "SYNC start value",
            Self::CobId => "COB-ID",
        })
    }
}

/// A step that the device refused, or that failed otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{pdo}: {step} ({at}): {outcome}")]
pub struct Failed {
    /// Which PDO.
    pub pdo: PdoNumber,
    /// Which step.
    pub step: Step,
    /// The object.
    pub at: Address,
    /// How its transfer ended.
    pub outcome: Outcome,
}

/// Writing the parameters of a PDO.
#[derive(Debug, Clone)]
pub struct Write<'a, const M: usize> {
    pdo: PdoNumber,
    parameters: &'a Parameters<M>,
    position: usize,
}

impl<'a, const M: usize> Write<'a, M> {
    /// Before the first step.
    #[must_use]
    pub const fn new(pdo: PdoNumber, parameters: &'a Parameters<M>) -> Self {
        Self { pdo, parameters, position: 0 }
    }

    /// What to write next; `None`: all is written.
    #[must_use]
    pub fn request(&self) -> Option<(Address, Small)> {
        self.current().map(|(_, at, value)| (at, value))
    }

    /// The step that [`request`](Self::request) belongs to.
    #[must_use]
    pub fn step(&self) -> Option<Step> {
        self.current().map(|(step, ..)| step)
    }

    /// The outcome of that transfer.
    ///
    /// # Errors
    /// [`Failed`] says which step the device did not accept. The PDO is left disabled then.
    pub fn handle(&mut self, outcome: Outcome) -> Result<(), Failed> {
        let Some((step, at, _)) = self.current() else { return Ok(()) };
        if !matches!(outcome, Outcome::Done(_)) {
            return Err(Failed { pdo: self.pdo, step, at, outcome });
        }
        self.position += 1;
        Ok(())
    }

    fn current(&self) -> Option<(Step, Address, Small)> {
        let Parameters { cob_id, transmission, inhibit, event_timer, sync_start, mapping } = self.parameters;
        let com = |sub| Address::new(self.pdo.communication(), sub);
        let map = |sub| Address::new(self.pdo.mapping(), sub);
        let entries = mapping.as_ref().map_or(&[][..], Mapping::entries);
        let mapped = mapping.as_ref().map(|mapping| mapping.entries().len() as u8);
        let before = [
            Some((Step::Disable, com(1), Small::from(cob_id.with_valid(false).0))),
            mapped.map(|_| (Step::Clear, map(0), Small::from(0u8))),
        ];
        let each = entries.iter().zip(1u8..).map(|(&entry, number)| {
            (Step::Entry(number, Some(entry)), map(number), Small::from(entry.raw()))
        });
        let after = [
            mapped.map(|count| (Step::Count, map(0), Small::from(count))),
            Some((Step::Transmission, com(2), Small::from(transmission.raw()))),
            inhibit.map(|time| (Step::Inhibit, com(3), Small::from(time))),
            event_timer.map(|time| (Step::EventTimer, com(5), Small::from(time))),
            sync_start.map(|start| (Step::SyncStart, com(6), Small::from(start))),
            cob_id.is_valid().then(|| (Step::CobId, com(1), Small::from(cob_id.0))),
        ];
        before.into_iter().flatten().chain(each).chain(after.into_iter().flatten()).nth(self.position)
    }
}

/// Why what was read are no parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// A transfer failed.
    #[error(transparent)]
    Failed(#[from] Failed),
    /// A value has another length than its type.
    #[error("{step} ({at}): {error}")]
    Length {
        /// Which step.
        step: Step,
        /// The object.
        at: Address,
        /// What came.
        error: LengthError,
    },
    /// A reserved transmission type.
    #[error(transparent)]
    Transmission(#[from] TransmissionError),
    /// Entries that are no mapping.
    #[error(transparent)]
    Mapping(#[from] MappingError),
    /// More mapped objects than there are: such a mapping is none of single objects (CiA 301: FEh and
    /// FFh are multiplex PDOs).
    #[error("{found} mapped objects, up to {room} expected")]
    Count {
        /// What the device says.
        found: u8,
        /// The most that fit.
        room: usize,
    },
}

/// Reading the parameters of a PDO.
#[derive(Debug, Clone)]
pub struct Read<const M: usize = MAX_ENTRIES> {
    pdo: PdoNumber,
    step: Option<Step>,
    count: u8,
    parameters: Parameters<M>,
    mapping: Mapping<M>,
}

impl<const M: usize> Read<M> {
    /// Before the first step.
    #[must_use]
    pub const fn new(pdo: PdoNumber) -> Self {
        Self {
            pdo,
            step: Some(Step::CobId),
            count: 0,
            parameters: Parameters::new(CobId(CobId::INVALID), Transmission::EventProfile),
            mapping: Mapping::EMPTY,
        }
    }

    /// What to read next; `None`: all is read.
    #[must_use]
    pub fn request(&self) -> Option<Address> {
        let sub = match self.step? {
            Step::CobId | Step::Disable => 1,
            Step::Transmission => 2,
            Step::Inhibit => 3,
            Step::EventTimer => 5,
            Step::SyncStart => 6,
            Step::Count | Step::Clear => return Some(Address::new(self.pdo.mapping(), 0)),
            Step::Entry(number, _) => return Some(Address::new(self.pdo.mapping(), number)),
        };
        Some(Address::new(self.pdo.communication(), sub))
    }

    /// The outcome of that transfer and what was read.
    ///
    /// # Errors
    /// [`ReadError`]. Sub-indices 03h, 05h and 06h may be missing.
    pub fn handle(&mut self, outcome: Outcome, value: &Small) -> Result<(), ReadError> {
        let (Some(step), Some(at)) = (self.step, self.request()) else { return Ok(()) };
        let optional = matches!(step, Step::Inhibit | Step::EventTimer | Step::SyncStart);
        let absent = matches!(outcome, Outcome::Aborted(AbortCode::NO_SUB_INDEX | AbortCode::NO_OBJECT));
        let missing = optional && absent;
        if !missing && !matches!(outcome, Outcome::Done(_)) {
            return Err(Failed { pdo: self.pdo, step, at, outcome }.into());
        }
        let length = |error| ReadError::Length { step, at, error };
        let parameters = &mut self.parameters;
        self.step = match step {
            Step::CobId | Step::Disable => {
                parameters.cob_id = CobId(value.get().map_err(length)?);
                Some(Step::Transmission)
            }
            Step::Transmission => {
                parameters.transmission = Transmission::new(value.get().map_err(length)?)?;
                Some(Step::Inhibit)
            }
            Step::Inhibit => {
                parameters.inhibit = (!missing).then(|| value.get()).transpose().map_err(length)?;
                Some(Step::EventTimer)
            }
            Step::EventTimer => {
                parameters.event_timer = (!missing).then(|| value.get()).transpose().map_err(length)?;
                Some(if self.pdo.rpdo { Step::Count } else { Step::SyncStart })
            }
            Step::SyncStart => {
                parameters.sync_start = (!missing).then(|| value.get()).transpose().map_err(length)?;
                Some(Step::Count)
            }
            Step::Count | Step::Clear => {
                self.count = value.get().map_err(length)?;
                let room = M.min(MAX_ENTRIES);
                if usize::from(self.count) > room {
                    return Err(ReadError::Count { found: self.count, room });
                }
                (self.count > 0).then_some(Step::Entry(1, None))
            }
            Step::Entry(number, _) => {
                self.mapping.push(Entry::from_raw(value.get().map_err(length)?))?;
                (number < self.count).then(|| Step::Entry(number + 1, None))
            }
        };
        if self.step.is_none() {
            self.parameters.mapping = Some(self.mapping);
        }
        Ok(())
    }

    /// What was read; `None` before the last step.
    #[must_use]
    pub fn parameters(&self) -> Option<&Parameters<M>> {
        self.step.is_none().then_some(&self.parameters)
    }
}
