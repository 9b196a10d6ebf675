//! A whole slave: NMT, SDO server over an object dictionary, PDOs, guarding, heartbeat, SYNC, TIME,
//! EMCY and LSS behind one dispatch.
//!
//! The dictionary is anything that implements [`Objects`]. What it holds in the
//! communication area takes effect when the slave boots and when it is written: 1005h, 1006h, 1019h
//! (SYNC), 100Ch, 100Dh (guarding), 1014h, 1015h (EMCY), 1016h, 1017h (heartbeat), 1029h (error
//! behaviour). Objects that are not there have their defaults. 1001h and 1003h are the slave's own.

mod device;
mod errors;
mod objects;
mod process;

use core::time::Duration;

use embedded_can::Id;
use pdo::{Address, CobId, Frame, Handled, NodeId, RpdoEvent, cob};

use crate::bus::BusStatus;
use crate::clock::{earlier, earliest};
use crate::emcy::{self, Emergency, ErrorCode};
use crate::heartbeat::{self, Consumer, Producer};
use crate::lss::{self, BitTiming, Identity};
use crate::nmt::{self, Change, Command, State};
use crate::ring::Ring;
use crate::sdo::{Channel, Server};
use crate::time::TimeOfDay;
use crate::{guarding, sync};

pub use device::Device;
pub use errors::EMERGENCIES;
pub use process::Objects;

use errors::Errors;
use objects::{View, number};

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
    /// An RPDO: its number, from 0, and what happened; its data are in the dictionary.
    Rpdo(usize, RpdoEvent),
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
///   [`stored`](Self::stored).
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
    boot_up: Option<Frame>,
    events: Ring<Event, EVENTS>,
    lost_events: u32,
    bus: BusStatus,
}

impl<D: Objects> Slave<D> {
    /// A silent slave.
    #[must_use]
    pub fn new(config: &Config<'_>, objects: D) -> Self {
        let node = config.node.unwrap_or(NodeId::MAX);
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
            boot_up: None,
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

    /// Its NMT state; [`State::BootUp`] while it is silent.
    #[must_use]
    pub const fn state(&self) -> State {
        self.nmt.state()
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

    /// Starts the communication: reads the communication objects, sends the boot-up message and is
    /// pre-operational. Returns whether it did: not without an address.
    pub fn boot(&mut self, now: Duration) -> bool {
        self.lss.restart();
        self.objects.stop();
        let Some(node) = self.lss.node() else {
            self.running = false;
            return false;
        };
        self.nmt = nmt::Slave::new(node);
        self.boot_up = Some(self.nmt.boot());
        self.running = true;
        self.answers = Ring::new();
        let (server, mut view) = self.serving();
        server.reset(Channel::default_of(node), &mut view);
        self.guard = guarding::Slave::new(node, None);
        self.producer = Producer::new(node, 0, now);
        self.consumers = [None; CONSUMERS];
        for index in [0x1005, 0x100C, 0x1014, 0x1015, 0x1016, 0x1017] {
            self.configure(now, index);
        }
        true
    }

    /// An error has occurred: sends an emergency and sets the error register's bits until
    /// [`clear`](Self::clear). An error that is there already is not told again.
    ///
    /// # Errors
    /// [`emcy::ProducerFull`]: too many emergencies wait; the history has it all the same.
    pub fn raise(&mut self, code: ErrorCode, data: [u8; 5]) -> Result<(), emcy::ProducerFull> {
        self.errors.raise(code, data)
    }

    /// An error is gone: sends the emergency 0000h, with the register of those that are left.
    ///
    /// # Errors
    /// [`emcy::ProducerFull`]: too many emergencies wait.
    pub fn clear(&mut self, code: ErrorCode) -> Result<(), emcy::ProducerFull> {
        self.errors.clear(code)
    }

    /// Answers LSS after [`lss::Action::Store`].
    pub fn stored(&mut self, result: Result<(), lss::Refusal>) {
        self.answer(lss::Slave::stored(result));
    }

    /// Takes a frame from the bus.
    #[inline]
    pub fn handle_frame<F: embedded_can::Frame>(&mut self, now: Duration, frame: &F) -> Handled {
        let Id::Standard(id) = frame.id() else { return Handled::Ignored };
        let id = id.as_raw();
        if self.running && id == self.server.channel().request {
            return self.on_sdo(now, frame);
        }
        let Some(frame) = Frame::from_can(frame) else { return Handled::Ignored };
        if id == cob::LSS_REQUEST {
            return self.on_lss(&frame);
        }
        if !self.running {
            return Handled::Ignored;
        }
        let own = u16::from(self.nmt.node().raw());
        match id {
            cob::NMT => {
                let change =
                    Command::parse(&frame).and_then(|(command, target)| self.nmt.handle(command, target));
                self.on_change(now, change);
                Handled::Taken
            }
            cob::TIME if self.state().has_sdo() => {
                if let Some(time) = TimeOfDay::from_frame(&frame) {
                    self.tell(Event::Time(time));
                }
                Handled::Taken
            }
            _ if id == cob::ERROR_CONTROL + own && frame.is_remote() => {
                let (answer, event) = self.guard.handle_request(now, self.nmt.state());
                self.answer(answer);
                if let Some(event) = event {
                    let _ = self.errors.clear(ErrorCode::LIFE_GUARD);
                    self.tell(Event::LifeGuarding(event));
                }
                Handled::Taken
            }
            _ if id == self.sync.id() && self.state().has_sdo() => {
                if let Some(event) = self.sync.handle_frame(now, &frame) {
                    self.on_sync(event);
                }
                Handled::Taken
            }
            cob::ERROR_CONTROL.. => self.on_heartbeat(now, id, &frame),
            _ if self.state().has_pdo() => {
                let handled = self.objects.handle_frame(now, &frame);
                self.collect_pdos();
                handled
            }
            _ => Handled::Ignored,
        }
    }

    /// What RPDOs brought.
    fn collect_pdos(&mut self) {
        while let Some((number, event)) = self.objects.poll_event() {
            let index = (0x1600 + number as u16).to_le_bytes();
            match event {
                RpdoEvent::TooShort(error) => {
                    let data = [index[0], index[1], error.expected, error.found, 0];
                    self.errors.mention(ErrorCode::PDO_LENGTH, data);
                }
                RpdoEvent::TooLong(error) => {
                    let data = [index[0], index[1], error.expected, error.found, 0];
                    self.errors.mention(ErrorCode::PDO_TOO_LONG, data);
                }
                RpdoEvent::TimedOut => {
                    self.errors.mention(ErrorCode::RPDO_TIMEOUT, [index[0], index[1], 0, 0, 0]);
                }
                _ => {}
            }
            self.tell(Event::Rpdo(number, event));
        }
    }

    /// The NMT state has changed.
    fn entered(&mut self, now: Duration, state: State) {
        if state.has_pdo() {
            self.objects.start(now);
        } else {
            self.objects.stop();
        }
        self.tell(Event::State(state));
    }

    /// The adapter's state has changed. While the bus is not there, nothing is sent; what waited is
    /// dropped. Error passive and the recovery from bus-off are told by emergencies (8120h, 8140h).
    pub fn handle_bus(&mut self, now: Duration, status: BusStatus) {
        let before = core::mem::replace(&mut self.bus, status);
        match (before, status) {
            (_, BusStatus::Passive) => {
                let _ = self.errors.raise(ErrorCode::CAN_PASSIVE, [0; 5]);
            }
            (BusStatus::Passive, BusStatus::Active | BusStatus::Warning) => {
                let _ = self.errors.clear(ErrorCode::CAN_PASSIVE);
            }
            (BusStatus::Off, BusStatus::Active | BusStatus::Warning) => {
                let _ = self.errors.clear(ErrorCode::CAN_PASSIVE);
                self.errors.mention(ErrorCode::BUS_OFF_RECOVERED, [0; 5]);
            }
            _ => {}
        }
        if before.is_on() && !status.is_on() {
            self.answers = Ring::new();
            let channel = self.server.channel();
            let (server, mut view) = self.serving();
            server.reset(channel, &mut view);
        } else if status.is_on() && !before.is_on() && self.producer.time_ms() != 0 {
            let time = self.producer.time_ms();
            self.producer.set_time(time, now);
        }
    }

    /// The SDO server and what it serves.
    fn serving(&mut self) -> (&mut Server, View<'_, D>) {
        let view = View { dictionary: &mut self.objects, errors: &mut self.errors, written: None };
        (&mut self.server, view)
    }

    fn on_sdo<F: embedded_can::Frame>(&mut self, now: Duration, frame: &F) -> Handled {
        if !self.nmt.state().has_sdo() {
            return Handled::Taken;
        }
        let (server, mut view) = self.serving();
        let handled = server.handle_frame(now, frame, &mut view);
        if let Some(at) = view.written {
            self.configure(now, at.index);
            self.tell(Event::Written(at));
        }
        handled
    }

    fn on_lss(&mut self, frame: &Frame) -> Handled {
        // In any NMT state, and without address too.
        let Some(request) = lss::Request::from_frame(frame) else { return Handled::Taken };
        let (answer, action) = self.lss.handle(request);
        if let Some(answer) = answer {
            self.answer(answer);
        }
        match action {
            Some(lss::Action::Start(_)) => self.tell(Event::ResetCommunication),
            Some(action) => self.tell(Event::Lss(action)),
            None => {}
        }
        Handled::Taken
    }

    fn on_change(&mut self, now: Duration, change: Option<Change>) {
        match change {
            Some(Change::State(state)) => self.entered(now, state),
            Some(reset) => {
                self.running = false;
                self.objects.stop();
                self.boot_up = None;
                self.answers = Ring::new();
                self.tell(match reset {
                    Change::ResetNode => Event::ResetNode,
                    _ => Event::ResetCommunication,
                });
            }
            None => {}
        }
    }

    fn on_sync(&mut self, event: sync::Event) {
        if matches!(event, sync::Event::Length { .. }) {
            self.errors.mention(ErrorCode::SYNC_LENGTH, [0; 5]);
        }
        let counter = match event {
            sync::Event::Sync { counter } => Some(counter),
            sync::Event::Jump { found, .. } => Some(Some(found)),
            _ => None,
        };
        if let Some(counter) = counter.filter(|_| self.state().has_pdo()) {
            self.objects.handle_sync(counter);
            self.collect_pdos();
        }
        self.tell(Event::Sync(event));
    }

    fn on_heartbeat(&mut self, now: Duration, id: u16, frame: &Frame) -> Handled {
        let watched = self.consumers.iter_mut().flatten();
        let mut watched = watched.filter(|(node, _)| cob::ERROR_CONTROL + u16::from(node.raw()) == id);
        let Some((node, consumer)) = watched.next().filter(|_| !frame.is_remote()) else {
            return Handled::Ignored;
        };
        let node = *node;
        if let Some(event) = consumer.handle(now) {
            let _ = self.errors.clear(ErrorCode::LIFE_GUARD);
            self.tell(Event::Heartbeat { node, event });
        }
        Handled::Taken
    }

    /// Lets everything happen whose time has come; early calls do nothing.
    pub fn handle_timeout(&mut self, now: Duration) {
        if !self.running {
            return;
        }
        let (server, mut view) = self.serving();
        server.handle_timeout(now, &mut view);
        self.objects.handle_timeout(now);
        self.collect_pdos();
        if let Some(event) = self.guard.handle_timeout(now) {
            self.tell(Event::LifeGuarding(event));
            self.on_lost(now);
        }
        for index in 0..CONSUMERS {
            let Some((node, consumer)) = self.consumers.get_mut(index).and_then(Option::as_mut) else {
                continue;
            };
            let node = *node;
            if let Some(event) = consumer.handle_timeout(now) {
                self.tell(Event::Heartbeat { node, event });
                self.on_lost(now);
            }
        }
        if let Some(event) = self.sync.handle_timeout(now) {
            self.on_sync(event);
        }
    }

    /// The master, or a node watched, is gone: emergency 8130h, and what 1029h:01 says (CiA 301,
    /// 7.5.2.26).
    fn on_lost(&mut self, now: Duration) {
        let _ = self.errors.raise(ErrorCode::LIFE_GUARD, [0; 5]);
        let next = match number(&mut self.objects, 0x1029, 1).map(|behaviour| behaviour as u8) {
            None | Some(0) if self.state() == State::Operational => State::PreOperational,
            Some(2) => State::Stopped,
            _ => return,
        };
        if self.nmt.enter(next) {
            self.entered(now, next);
        }
    }

    /// The next frame to send, until `None`.
    #[inline]
    pub fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        if !self.bus.is_on() {
            return None;
        }
        if let Some(frame) = self.boot_up.take().or_else(|| self.answers.pop()) {
            return Some(frame);
        }
        if !self.running {
            return None;
        }
        let state = self.nmt.state();
        if state.has_sdo() {
            if let Some(id) = self.emcy_id
                && let Some(emergency) = self.errors.producer().poll_transmit(now)
            {
                return emergency_frame(id, &emergency);
            }
            if let Some(frame) = self.objects.poll_transmit(now).filter(|_| state.has_pdo()) {
                return Some(frame);
            }
            let (server, mut view) = self.serving();
            if let Some(frame) = server.poll_transmit(now, &mut view) {
                return Some(frame);
            }
        }
        self.producer.poll_transmit(now, state)
    }

    /// When to call [`handle_timeout`](Self::handle_timeout) and then
    /// [`poll_transmit`](Self::poll_transmit); `None` = idle.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Duration> {
        if !self.running {
            return None;
        }
        let on = self.bus.is_on();
        let emcy =
            self.emcy_id.filter(|_| on && self.state().has_sdo()).and_then(|_| self.errors.poll_timeout());
        let own = earliest(&[
            self.server.poll_timeout(),
            self.guard.poll_timeout(),
            self.producer.poll_timeout().filter(|_| on),
            self.objects.poll_timeout().filter(|_| on && self.state().has_pdo()),
            self.sync.poll_timeout(),
            emcy,
        ]);
        let consumers = self.consumers.iter().flatten().map(|(_, consumer)| consumer.poll_timeout());
        consumers.fold(own, earlier)
    }

    /// What happened, until `None`.
    pub fn poll_event(&mut self) -> Option<Event> {
        if let Some(event) = self.events.pop() {
            return Some(event);
        }
        (self.lost_events > 0).then(|| Event::Overflow(core::mem::take(&mut self.lost_events)))
    }

    /// Takes over what a communication object says.
    fn configure(&mut self, now: Duration, index: u16) {
        let objects = &mut self.objects;
        match index {
            0x1005 | 0x1006 | 0x1019 => {
                let id =
                    number(objects, 0x1005, 0).and_then(|entry| CobId(entry & 0x1FFF_FFFF).standard_id());
                let period = number(objects, 0x1006, 0).unwrap_or(0);
                let overflow = number(objects, 0x1019, 0).unwrap_or(0) as u8;
                self.sync = sync::Consumer::new(Duration::from_micros(period.into()), overflow)
                    .with_id(id.unwrap_or(cob::SYNC));
            }
            0x100C | 0x100D => {
                let period_ms = number(objects, 0x100C, 0).unwrap_or(0) as u16;
                let life_time_factor = number(objects, 0x100D, 0).unwrap_or(0) as u8;
                let on = period_ms != 0 && life_time_factor != 0;
                self.guard.set_config(on.then_some(guarding::Config { period_ms, life_time_factor }));
            }
            0x1014 => {
                let default = cob::EMCY + u16::from(self.nmt.node().raw());
                let entry = number(objects, 0x1014, 0).map_or(CobId::standard(default), CobId);
                self.emcy_id = entry.standard_id().filter(|_| entry.is_valid());
            }
            0x1015 => {
                let inhibit = number(objects, 0x1015, 0).unwrap_or(0) as u16;
                self.errors.producer().set_inhibit(inhibit);
            }
            0x1016 => {
                for (sub, slot) in (1..).zip(&mut self.consumers) {
                    let entry = number(objects, 0x1016, sub).unwrap_or(0);
                    let node = NodeId::new((entry >> 16) as u8).ok().filter(|_| entry as u16 != 0);
                    let new = node.map(|node| (node, Consumer::new(entry as u16)));
                    let same = |old: &(NodeId, Consumer)| {
                        new.is_some_and(|(node, it)| old.0 == node && old.1.time_ms() == it.time_ms())
                    };
                    // An entry that has not changed goes on watching.
                    *slot = slot.filter(same).or(new);
                }
            }
            0x1017 => {
                let time_ms = number(objects, 0x1017, 0).unwrap_or(0) as u16;
                if time_ms != self.producer.time_ms() {
                    self.producer.set_time(time_ms, now);
                }
            }
            _ => {}
        }
    }

    fn answer(&mut self, frame: Frame) {
        // A master that asks again without having seen the answer has lost the older one anyway.
        if let Err(frame) = self.answers.push(frame) {
            self.answers.pop();
            let _ = self.answers.push(frame);
        }
    }

    fn tell(&mut self, event: Event) {
        if self.events.push(event).is_err() {
            self.lost_events = self.lost_events.saturating_add(1);
        }
    }
}

fn emergency_frame(id: u16, emergency: &Emergency) -> Option<Frame> {
    let frame = emergency.frame(NodeId::MIN);
    Frame::data_frame(embedded_can::StandardId::new(id)?, frame.data())
}
