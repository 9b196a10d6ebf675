//! The communication of a virtual node.

mod bus;
mod serving;

use core::fmt;
use core::time::Duration;
use std::collections::VecDeque;

use canopen_master::emcy::{self, Emergency, ErrorCode};
use canopen_master::lss::{self, BitTiming, Identity};
use canopen_master::nmt::{self, Change, Command, State};
use canopen_master::sdo::{self, Channel, NEXT_REQUEST};
use canopen_master::{guarding, heartbeat, sync};
use pdo::{Address, Frame, NodeId};

use super::common::PDOS;
use super::objects::Objects;
use super::pdo::{Pdos, Received};
use super::{Context, Device};

/// Emergencies that wait for the inhibit time.
const EMERGENCIES: usize = 8;

/// What a node is set to before it starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// Its address; `None`: it waits for one over LSS.
    pub node: Option<NodeId>,
    /// 1018h.
    pub identity: Identity,
}

/// A virtual CANopen node.
///
/// - Input: [`handle_frame`](crate::can::Node::handle_frame), [`handle_timeout`](crate::can::Node::handle_timeout),
///   [`handle_bus`](crate::can::Node::handle_bus).
/// - Output: [`poll_transmit`](crate::can::Node::poll_transmit), [`poll_timeout`](crate::can::Node::poll_timeout).
///
/// It boots with the first call of `handle_timeout` or `poll_transmit`.
pub struct Node<D> {
    device: D,
    objects: Objects,
    /// Values after power-up.
    factory: Objects,
    /// Values stored with 1010h.
    stored: Option<Objects>,
    nmt: nmt::Slave,
    lss: lss::Slave,
    sdo: sdo::Server,
    /// A download in several frames.
    download: Vec<u8>,
    guard: guarding::Slave,
    heartbeat: heartbeat::Producer,
    masters: Vec<(NodeId, heartbeat::Consumer)>,
    sync: sync::Consumer,
    emergencies: emcy::Producer<EMERGENCIES>,
    pdos: Pdos,
    out: VecDeque<Frame>,
    started: bool,
    was_off: bool,
}

impl<D> fmt::Debug for Node<D> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Node")
            .field("node", &self.lss.node())
            .field("state", &self.nmt.state())
            .finish_non_exhaustive()
    }
}

fn slave_of(node: Option<NodeId>) -> NodeId {
    node.unwrap_or(NodeId::MAX)
}

impl<D: Device> Node<D> {
    /// A node that has not started yet.
    #[must_use]
    pub fn new(settings: Settings, device: D, objects: Objects) -> Self {
        let rates: Vec<_> = (0..=8).filter_map(BitTiming::from_index).collect();
        let id = slave_of(settings.node);
        Self {
            device,
            factory: objects.clone(),
            objects,
            stored: None,
            nmt: nmt::Slave::new(id),
            lss: lss::Slave::new(settings.identity, settings.node, &rates),
            sdo: sdo::Server::new(Channel::default_of(id), NEXT_REQUEST),
            download: Vec::new(),
            guard: guarding::Slave::new(id, None),
            heartbeat: heartbeat::Producer::new(id, 0, Duration::ZERO),
            masters: Vec::new(),
            sync: sync::Consumer::new(Duration::ZERO, 0),
            emergencies: emcy::Producer::new(0),
            pdos: Pdos::default(),
            out: VecDeque::new(),
            started: false,
            was_off: false,
        }
    }

    /// Its address; `None` while it waits for one.
    #[must_use]
    pub const fn node(&self) -> Option<NodeId> {
        self.lss.node()
    }

    /// Its NMT state; [`State::BootUp`] before it starts.
    #[must_use]
    pub const fn state(&self) -> State {
        self.nmt.state()
    }

    /// Its objects.
    #[must_use]
    pub const fn objects(&self) -> &Objects {
        &self.objects
    }

    /// What it does.
    #[must_use]
    pub const fn device(&self) -> &D {
        &self.device
    }

    /// Lets something happen to the device, such as a fault; what comes of it is sent.
    pub fn with_device<T>(&mut self, now: Duration, work: impl FnOnce(&mut D, &mut Context<'_>) -> T) -> T {
        let done = self.with(now, work);
        self.look(now);
        done
    }

    fn with<T>(&mut self, now: Duration, work: impl FnOnce(&mut D, &mut Context<'_>) -> T) -> T {
        let mut emergencies = Vec::new();
        let mut context = Context {
            now,
            objects: &mut self.objects,
            state: self.nmt.state(),
            emergencies: &mut emergencies,
        };
        let done = work(&mut self.device, &mut context);
        for emergency in emergencies {
            self.emergency(emergency);
        }
        done
    }

    /// Event-driven TPDOs become due.
    fn look(&mut self, now: Duration) {
        for number in self.pdos.changed(&self.objects) {
            if !self.with(now, |device, context| device.holds_back(context, number)) {
                self.pdos.trigger(number);
            }
        }
    }

    fn emergency(&mut self, emergency: Emergency) {
        self.objects.set(0x1001, 0, i128::from(emergency.register));
        // A full queue drops the message, not the history.
        let _ = self.emergencies.push(emergency);
        self.show_history();
    }

    /// An error of the communication: generic and communication bits of the error register.
    fn communication_error(&mut self, code: ErrorCode, data: [u8; 5]) {
        let register = self.objects.get(0x1001, 0) as u8 | code.register_bit();
        self.emergency(Emergency { code, register, data });
    }

    fn show_history(&mut self) {
        let history: Vec<_> = self.emergencies.history().to_vec();
        self.objects.set(0x1003, 0, history.len() as i128);
        for (entry, sub) in history.iter().zip(1..) {
            self.objects.set(0x1003, sub, i128::from(*entry));
        }
    }

    /// Starts, or starts anew: objects from the store, communication as they say.
    fn boot(&mut self, now: Duration) {
        self.started = true;
        self.lss.restart();
        self.out.clear();
        self.objects = self.stored.clone().unwrap_or_else(|| self.factory.clone());
        let Some(id) = self.lss.node() else { return };
        self.predefined(id);
        self.nmt = nmt::Slave::new(id);
        self.emergencies = emcy::Producer::new(0);
        self.configure(now);
        let (channel, node) = (Channel::default_of(id), id);
        self.sdo = sdo::Server::new(channel, NEXT_REQUEST);
        self.guard = guarding::Slave::new(node, self.guard_config());
        self.with(now, |device, context| device.state(context, State::BootUp));
        self.out.push_back(self.nmt.boot());
        self.with(now, |device, context| device.state(context, State::PreOperational));
    }

    /// COB-IDs of the predefined connection set, where the objects do not say otherwise.
    fn predefined(&mut self, id: NodeId) {
        let id = i128::from(id.raw());
        self.objects.set(0x1014, 0, 0x80 + id);
        self.objects.set(0x100B, 0, id);
        for number in 0..PDOS {
            for (index, base) in [(0x1400, 0x200), (0x1800, 0x180)] {
                let cob = self.objects.get(index + number, 1);
                if cob & 0x1FFF_FFFF == 0 {
                    let own = base + 0x100 * i128::from(number) + id;
                    self.objects.set(index + number, 1, cob | own);
                }
            }
        }
    }

    fn guard_config(&self) -> Option<guarding::Config> {
        let (period_ms, factor) = (self.objects.get(0x100C, 0) as u16, self.objects.get(0x100D, 0) as u8);
        (period_ms > 0 && factor > 0).then_some(guarding::Config { period_ms, life_time_factor: factor })
    }

    /// Takes over what the communication objects say.
    fn configure(&mut self, now: Duration) {
        let id = slave_of(self.lss.node());
        let time = self.objects.get(0x1017, 0) as u16;
        if time != self.heartbeat.time_ms() || self.nmt.state() == State::BootUp {
            self.heartbeat = heartbeat::Producer::new(id, time, now);
        }
        self.guard.set_config(self.guard_config());
        self.emergencies.set_inhibit(self.objects.get(0x1015, 0) as u16);
        let period = Duration::from_micros(self.objects.get(0x1006, 0) as u64);
        let sync_id = (self.objects.get(0x1005, 0) & 0x7FF) as u16;
        self.sync = sync::Consumer::new(period, self.objects.get(0x1019, 0) as u8).with_id(sync_id);
        let wanted = (1..=4).filter_map(|sub| {
            let raw = self.objects.get(0x1016, sub) as u32;
            let node = NodeId::new((raw >> 16) as u8).ok()?;
            Some((node, raw as u16)).filter(|(_, time)| *time > 0)
        });
        let wanted: Vec<_> = wanted.collect();
        self.masters.retain(|(node, consumer)| wanted.contains(&(*node, consumer.time_ms())));
        for (node, time) in wanted {
            if !self.masters.iter().any(|(known, _)| *known == node) {
                self.masters.push((node, heartbeat::Consumer::new(time)));
            }
        }
    }

    fn nmt(&mut self, now: Duration, frame: &Frame) {
        let Some((command, target)) = Command::parse(frame) else { return };
        match self.nmt.handle(command, target) {
            Some(Change::State(state)) => self.enter(now, state),
            Some(Change::ResetNode | Change::ResetCommunication) => self.boot(now),
            None => {}
        }
    }

    fn enter(&mut self, now: Duration, state: State) {
        if !state.has_sdo() {
            let channel = self.sdo.channel();
            self.serve(now, |sdo, objects| sdo.reset(channel, objects));
        }
        if state.has_pdo() {
            self.with(now, Device::update);
            self.pdos.start(now, &self.objects);
        }
        self.with(now, |device, context| device.state(context, state));
    }

    fn rpdo(&mut self, now: Duration, frame: &Frame) {
        for (number, received) in self.pdos.receive(now, &mut self.objects, frame) {
            let index = (0x1600 + number).to_le_bytes();
            match received {
                Received::Nothing => {}
                Received::Written(written) => self.written(now, &written),
                Received::TooShort { expected, found } => {
                    self.communication_error(ErrorCode::PDO_LENGTH, [index[0], index[1], expected, found, 0]);
                }
                Received::TooLong { expected, found, written } => {
                    let data = [index[0], index[1], expected, found, 0];
                    self.communication_error(ErrorCode::PDO_TOO_LONG, data);
                    self.written(now, &written);
                }
            }
        }
    }

    fn written(&mut self, now: Duration, written: &[Address]) {
        self.with(now, |device, context| {
            for at in written {
                device.written(context, *at);
            }
        });
    }

    fn synchronise(&mut self, now: Duration, event: sync::Event) {
        let counter = match event {
            sync::Event::Sync { counter } => counter,
            sync::Event::Jump { found, .. } => Some(found),
            sync::Event::Length { expected, found } => {
                return self.communication_error(ErrorCode::SYNC_LENGTH, [expected, found, 0, 0, 0]);
            }
            sync::Event::Lost => return,
        };
        if !self.nmt.state().has_pdo() {
            return;
        }
        let written = self.pdos.sync_receive(&mut self.objects);
        self.written(now, &written);
        self.with(now, Device::update);
        self.pdos.sync_transmit(&self.objects, counter);
    }

    fn lss(&mut self, now: Duration, request: lss::Request) {
        let (answer, action) = self.lss.handle(request);
        self.out.extend(answer);
        match action {
            // The store is this process's memory: node ID and bit rate survive a reset.
            Some(lss::Action::Store { .. }) => self.out.push_back(lss::Slave::stored(Ok(()))),
            Some(lss::Action::Start(_)) => self.boot(now),
            // A virtual bus has one bit rate.
            Some(lss::Action::ActivateBitTiming { .. }) | None => {}
        }
    }

    fn master(&mut self, now: Duration, lost: bool) {
        if lost {
            self.communication_error(ErrorCode::LIFE_GUARD, [0; 5]);
            // 1029h:01 at its default: operational is left (CiA 301, 7.5.2.32).
            if self.nmt.state() == State::Operational && self.nmt.enter(State::PreOperational) {
                self.enter(now, State::PreOperational);
            }
        } else {
            let register = self.objects.get(0x1001, 0) as u8 & !ErrorCode::LIFE_GUARD.register_bit();
            self.emergency(Emergency { code: ErrorCode::NO_ERROR, register, data: [0; 5] });
        }
        self.with(now, |device, context| device.master(context, lost));
    }

    fn error_control(&mut self, now: Duration, frame: &Frame, other: NodeId) {
        if Some(other) == self.lss.node() && frame.is_remote() {
            let (answer, event) = self.guard.handle_request(now, self.nmt.state());
            self.out.push_back(answer);
            if event == Some(guarding::Event::Back) {
                self.master(now, false);
            }
            return;
        }
        let watched = self.masters.iter_mut().find(|(node, _)| *node == other && !frame.is_remote());
        if let Some((_, consumer)) = watched
            && consumer.handle(now) == Some(heartbeat::Event::Back)
        {
            self.master(now, false);
        }
    }
}
