//! Boot of a node by the master (CiA 302-2, boot slave): who is it, is it configured, does it live,
//! may it start. The engine is [`Master::boot`](crate::master::Master::boot).

mod dcf;
mod process;

use core::fmt;
use core::time::Duration;

use pdo::Address;

use crate::guarding;
use crate::lss::Part;
use crate::nmt::State;
use crate::sdo;

pub use dcf::{ConciseDcf, DcfError};
pub(crate) use process::{Action, Process};

/// What becomes of a node that runs already.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Running {
    /// It is reset: reset communication, then wait for its boot-up message.
    #[default]
    Reset,
    /// It is taken over as it is if it is operational (CiA 302-2, "keep alive"); else it is reset.
    TakeOver,
}

/// How a node is watched once it has booted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ErrorControl {
    /// Not at all.
    #[default]
    None,
    /// By its heartbeat.
    Heartbeat {
        /// Written to 1017h; 0 = the device has it already.
        producer_ms: u16,
        /// Consumer time; must be above the producer's.
        consumer_ms: u16,
    },
    /// By node guarding.
    Guarding(guarding::Config),
}

/// What a node should be and what is to be done with it. Objects 1F81h…1F88h and 1F22h, 1F26h, 1F27h
/// of a CiA 302 master, as far as they concern one node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config<'d> {
    /// What becomes of it if it runs already.
    pub running: Running,
    /// 1F84h; `None` = any.
    pub device_type: Option<u32>,
    /// 1F85h…1F88h in order: vendor, product, revision, serial number; `None` = any, and not read.
    pub identity: [Option<u32>; 4],
    /// 1F26h and 1F27h: date and time that 1020h:01 and :02 show where the node is configured
    /// already; `None` = it never is.
    pub configured: Option<(u32, u32)>,
    /// 1F22h: what is written to it.
    pub dcf: ConciseDcf<'d>,
    /// How it is watched from then on.
    pub error_control: ErrorControl,
    /// Start it at the end.
    pub start: bool,
    /// Longest time from the reset to the boot-up message, after which the node is asked all the
    /// same.
    pub boot_up: Duration,
    /// Time for each SDO answer.
    pub answer: Duration,
}

/// Any device, reset, not configured, not watched, started; 1 s to boot, 500 ms for an answer.
impl Default for Config<'_> {
    fn default() -> Self {
        Self {
            running: Running::Reset,
            device_type: None,
            identity: [None; 4],
            configured: None,
            dcf: ConciseDcf::EMPTY,
            error_control: ErrorControl::None,
            start: true,
            boot_up: Duration::from_secs(1),
            answer: Duration::from_millis(500),
        }
    }
}

/// A node that has booted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Booted {
    /// 1000h.
    pub device_type: u32,
    /// Status L: it was operational and has been left so.
    pub taken_over: bool,
    /// Entries of the DCF written; 0 where it was configured already.
    pub written: u32,
}

/// Why a node has not booted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Failure {
    /// Status B.
    #[error("device type (1000h) not read: {0}")]
    NoDeviceType(sdo::Outcome),
    /// Status C.
    #[error("device type is {found:08X}h, {expected:08X}h expected")]
    DeviceType {
        /// 1F84h.
        expected: u32,
        /// 1000h.
        found: u32,
    },
    /// Status D, M, N or O.
    #[error("{} is {found:08X}h, {expected:08X}h expected", name(*part))]
    Identity {
        /// Which number of 1018h.
        part: Part,
        /// 1F85h…1F88h.
        expected: u32,
        /// 1018h.
        found: u32,
    },
    /// Status D, M, N or O.
    #[error("{} (1018h) not read, {expected:08X}h expected: {outcome}", name(*part))]
    NoIdentity {
        /// Which number of 1018h.
        part: Part,
        /// 1F85h…1F88h.
        expected: u32,
        /// How the reading ended.
        outcome: sdo::Outcome,
    },
    /// Status E.
    #[error("no heartbeat within {0} ms while the node's state was checked")]
    NoHeartbeat(u16),
    /// Status F.
    #[error("no answer to node guarding within {0:?}")]
    NoGuarding(Duration),
    /// Status J.
    #[error("configuration entry {entry} ({at}) not written: {outcome}")]
    Configuration {
        /// Entry of the DCF, counted from 1; 0 = what the error control needs.
        entry: u32,
        /// The object.
        at: Address,
        /// How the writing ended.
        outcome: sdo::Outcome,
    },
    /// Status K.
    #[error("no heartbeat within {0} ms when error control was started")]
    NoHeartbeatAtStart(u16),
    /// The boot was given up by the caller.
    #[error("given up")]
    Cancelled,
}

const fn name(part: Part) -> &'static str {
    match part {
        Part::Vendor => "vendor ID",
        Part::Product => "product code",
        Part::Revision => "revision number",
        Part::Serial => "serial number",
    }
}

impl Failure {
    /// The status letter of CiA 302-2; `None` where the caller gave up.
    #[must_use]
    pub const fn letter(&self) -> Option<char> {
        Some(match self {
            Self::NoDeviceType(_) => 'B',
            Self::DeviceType { .. } => 'C',
            Self::Identity { part, .. } | Self::NoIdentity { part, .. } => match part {
                Part::Vendor => 'D',
                Part::Product => 'M',
                Part::Revision => 'N',
                Part::Serial => 'O',
            },
            Self::NoHeartbeat(_) => 'E',
            Self::NoGuarding(_) => 'F',
            Self::Configuration { .. } => 'J',
            Self::NoHeartbeatAtStart(_) => 'K',
            Self::Cancelled => return None,
        })
    }
}

/// What has become of a boot, as a sentence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Report(pub Result<Booted, Failure>);

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Ok(Booted { device_type, taken_over: true, .. }) => {
                write!(f, "L: was operational and was taken over, device type {device_type:08X}h")
            }
            Ok(Booted { device_type, written, .. }) => {
                write!(f, "booted, device type {device_type:08X}h, {written} objects configured")
            }
            Err(failure) => match failure.letter() {
                Some(letter) => write!(f, "{letter}: {failure}"),
                None => write!(f, "{failure}"),
            },
        }
    }
}

/// Whether a state lets a node be taken over.
const fn runs(state: State) -> bool {
    matches!(state, State::Operational)
}
