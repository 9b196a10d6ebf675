//! A whole slave: NMT, SDO server over an object dictionary, PDOs, guarding, heartbeat, SYNC, TIME,
//! EMCY and LSS behind one dispatch.
//!
//! The dictionary is anything that implements [`Objects`]. What it holds in the
//! communication area takes effect when the slave boots and when it is written: 1005h, 1006h, 1019h
//! (SYNC), 100Ch, 100Dh (guarding), 1014h, 1015h (EMCY), 1016h, 1017h (heartbeat), 1029h (error
//! behaviour). Objects that are not there have their defaults. 1001h and 1003h are the slave's own: a reset
//! empties the error history, as the power-on values of the communication area do (CiA 301, 7.3.2.2.1), and
//! ends errors of the communication; those of the device go on in the error register.
//!
//! Of the communication's errors, a lost master or node is there until it is back or watched no more, an RPDO
//! that was too short or is missing until one is taken: told once, and gone with 0000h.

mod configure;
mod errors;
mod objects;
mod process;
mod receive;
mod timer;

use core::time::Duration;

use pdo::{Address, Frame, NodeId, RpdoFault};

use crate::bus::BusStatus;
use crate::emcy::{self, ErrorCode};
use crate::heartbeat::{self, Consumer, Producer};
use crate::lss::{self, BitTiming, Identity};
use crate::nmt::{self, State};
use crate::ring::Ring;
use crate::sdo::{Channel, Server};
use crate::time::TimeOfDay;
use crate::{guarding, sync};

pub use errors::EMERGENCIES;
pub use process::Objects;

/// Objects of a slave with an [`od::Dictionary`](crate::od::Dictionary) and `R` RPDOs and `T` TPDOs of up
/// to `M` mapped objects each.
pub type Device<'a, H, const R: usize, const T: usize, const M: usize> =
    crate::od::Objects<crate::od::Dictionary<'a, H>, R, T, M>;

use errors::{Cause, Errors};

/// Nodes whose heartbeat a slave watches: entries of 1016h that it acts on.
pub const CONSUMERS: usize = 4;
/// Events held until polled.
const EVENTS: usize = 16;
/// Answers to guarding and LSS that wait to be sent.
const ANSWERS: usize = 4;

/// What a slave is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config<'a> {
    /// 1018h; LSS tells devices apart by it.
    pub identity: Identity,
    /// Its address; `None` waits for LSS.
    pub node: Option<NodeId>,
    /// Bit rates that LSS may set.
    pub bit_rates: &'a [BitTiming],
    /// Time that an SDO client has for each next request.
    pub sdo_timeout: Duration,
}

impl Config<'_> {
    /// A device with this identity and address, that LSS may change but for the bit rate.
    #[must_use]
    pub const fn new(identity: Identity, node: Option<NodeId>) -> Self {
        Self { identity, node, bit_rates: &[], sdo_timeout: crate::sdo::NEXT_REQUEST }
    }
}

/// What [`Slave::poll_event`] tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event {
    /// The NMT state has changed: by a command, or after an error as 1029h says.
    State(State),
    /// The application and the communication shall start anew: the application's objects (2000h to
    /// 9FFFh) take their power-on values, then [`Slave::boot`].
    ResetNode,
    /// The communication shall start anew: the communication objects (1000h to 1FFFh) take their
    /// power-on values, then [`Slave::boot`].
    ResetCommunication,
    /// An object was written over SDO.
    Written(Address),
    /// The master's guarding.
    LifeGuarding(guarding::Event),
    /// Another node's heartbeat.
    Heartbeat {
        /// Which.
        node: NodeId,
        /// What happened.
        event: heartbeat::Event,
    },
    /// SYNC. Of PDOs, those that it sets free have been written to the dictionary.
    Sync(sync::Event),
    /// An RPDO: its number, from 0. Its data are in the dictionary, unless something was wrong.
    Rpdo(usize, Result<(), RpdoFault>),
    /// TIME.
    Time(TimeOfDay),
    /// What LSS asks of the device. After [`lss::Action::Store`], call [`Slave::stored`].
    Lss(lss::Action),
    /// Events that found no place, because nobody polled.
    Overflow(u32),
}

/// A CANopen slave around a dictionary `D`.
///
/// - Commands: [`boot`](Self::boot), [`raise`](Self::raise), [`clear`](Self::clear),
///   [`mention`](Self::mention), [`stored`](Self::stored).
/// - Input: [`handle_frame`](Self::handle_frame), [`handle_timeout`](Self::handle_timeout),
///   and from the adapter [`handle_bus`](Self::handle_bus).
/// - Output: [`poll_transmit`](Self::poll_transmit), [`poll_event`](Self::poll_event),
///   [`poll_timeout`](Self::poll_timeout).
/// - Getters: [`node`](Self::node), [`state`](Self::state), [`objects`](Self::objects), …
///
/// A new slave is silent until [`boot`](Self::boot), and again after the reset events.
#[derive(Debug)]
pub struct Slave<D> {
    objects: D,
    nmt: nmt::Slave,
    /// Whether it has an address and has booted.
    running: bool,
    server: Server,
    guard: guarding::Slave,
    producer: Producer,
    consumers: [Option<(NodeId, Consumer)>; CONSUMERS],
    sync: sync::Consumer,
    errors: Errors,
    emcy_id: Option<u16>,
    lss: lss::Slave,
    answers: Ring<Frame, ANSWERS>,
    /// The boot-up message is to be sent.
    boot_up: bool,
    events: Ring<Event, EVENTS>,
    lost_events: u32,
    bus: BusStatus,
}

impl<D: Objects> Slave<D> {
    /// A silent slave.
    #[must_use]
    pub fn new(config: &Config<'_>, objects: D) -> Self {
        // Until it boots, no node.
        let node = NodeId::MAX;
        Self {
            objects,
            nmt: nmt::Slave::new(node),
            running: false,
            server: Server::new(Channel::default_of(node), config.sdo_timeout),
            guard: guarding::Slave::new(node, None),
            producer: Producer::new(node, 0, Duration::ZERO),
            consumers: [None; CONSUMERS],
            sync: sync::Consumer::new(Duration::ZERO, 0),
            errors: Errors::new(),
            emcy_id: None,
            lss: lss::Slave::new(config.identity, config.node, config.bit_rates),
            answers: Ring::new(),
            boot_up: false,
            events: Ring::new(),
            lost_events: 0,
            bus: BusStatus::Active,
        }
    }

    /// Its address; `None` while it waits for LSS.
    #[must_use]
    pub const fn node(&self) -> Option<NodeId> {
        self.lss.node()
    }

    /// The address that it will have from the next [`boot`](Self::boot) on: LSS may have given another.
    #[must_use]
    pub const fn next_node(&self) -> Option<NodeId> {
        self.lss.pending()
    }

    /// Its NMT state; [`State::BootUp`] while it is silent.
    #[must_use]
    pub const fn state(&self) -> State {
        self.nmt.state()
    }

    /// The identifier of the SYNC that it listens to (1005h).
    #[must_use]
    pub const fn sync_id(&self) -> u16 {
        self.sync.id()
    }

    /// The dictionary.
    #[must_use]
    pub const fn objects(&self) -> &D {
        &self.objects
    }

    /// The dictionary, for the application to read and write. What it changes in the communication
    /// area takes effect at the next [`boot`](Self::boot).
    pub const fn objects_mut(&mut self) -> &mut D {
        &mut self.objects
    }

    /// The error register (1001h).
    #[must_use]
    pub fn error_register(&self) -> u8 {
        self.errors.register()
    }

    /// An error has occurred: sends an emergency and sets the error register's bits until
    /// [`clear`](Self::clear). An error that is there already is not told again. Where [`EMERGENCIES`] others
    /// are there, it is only told, as [`mention`](Self::mention) does.
    ///
    /// # Errors
    /// [`emcy::ProducerFull`]: too many emergencies wait; the history has it all the same.
    pub fn raise(&mut self, code: ErrorCode, data: [u8; 5]) -> Result<(), emcy::ProducerFull> {
        self.errors.raise(code, Cause::Device, data)
    }

    /// Something was wrong and is over: sends an emergency and enters it into the history (1003h), nothing
    /// more. Where too many emergencies wait, only the history has it.
    pub fn mention(&mut self, code: ErrorCode, data: [u8; 5]) {
        self.errors.mention(code, data);
    }

    /// An error is gone: sends the emergency 0000h, with the register of those that are left.
    ///
    /// # Errors
    /// [`emcy::ProducerFull`]: too many emergencies wait.
    pub fn clear(&mut self, code: ErrorCode) -> Result<(), emcy::ProducerFull> {
        self.errors.clear(|active, cause| active == code && cause == Cause::Device, true)
    }

    /// Answers LSS after [`lss::Action::Store`].
    pub fn stored(&mut self, result: Result<(), lss::Refusal>) {
        self.answer(lss::Slave::stored(result));
    }

    /// What happened, until `None`.
    pub fn poll_event(&mut self) -> Option<Event> {
        if let Some(event) = self.events.pop() {
            return Some(event);
        }
        (self.lost_events > 0).then(|| Event::Overflow(core::mem::take(&mut self.lost_events)))
    }

    fn tell(&mut self, event: Event) {
        if self.events.push(event).is_err() {
            self.lost_events = self.lost_events.saturating_add(1);
        }
    }
}
