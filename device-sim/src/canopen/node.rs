//! A virtual node: the slave's engine of `canopen-master`, and what the device makes of what it tells.

use core::time::Duration;

use canopen_master::lss::{self, BitTiming, Identity};
use canopen_master::nmt::State;
use canopen_master::slave::{Config, Event, Slave};
use canopen_master::{guarding, heartbeat, od};
use pdo::{Address, CobId, Communication, DefaultPdo, Frame, NodeId, Payload, Service, Transmission};

use super::common::{PDOS, Slot};
use super::dictionary::Dictionary;
use super::objects::Objects;
use super::served::Served;
use super::{Context, Device, Error, Pdos};
use crate::can;

/// What a node is set to before it starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// Its address; `None`: it waits for one over LSS.
    pub node: Option<NodeId>,
    /// 1018h.
    pub identity: Identity,
}

/// All values of a node.
#[derive(Debug, Clone)]
struct Image {
    objects: Objects,
    pdos: Pdos,
}

/// A virtual CANopen node.
///
/// - Input: [`handle_frame`](crate::can::Node::handle_frame), [`handle_timeout`](crate::can::Node::handle_timeout),
///   [`handle_bus`](crate::can::Node::handle_bus).
/// - Output: [`poll_transmit`](crate::can::Node::poll_transmit), [`poll_timeout`](crate::can::Node::poll_timeout).
///
/// It boots with the first call of `handle_timeout` or `poll_transmit`. Every reset, of the communication
/// too, gives all its objects the values after power-up or those stored with 1010h.
#[derive(Debug)]
pub struct Node<D> {
    slave: Slave<Served<D>>,
    /// Values after power-up.
    factory: Image,
    /// Values stored with 1010h.
    stored: Option<Image>,
    started: bool,
    /// What the TPDOs carried last since operational began, to see changes.
    sent: [Option<Payload>; PDOS],
}

impl<D: Device> Node<D> {
    /// A node that has not started yet. An identifier of 0 in `pdos` stands for that of the predefined
    /// connection set; one that is that of `settings.node` follows another address as well.
    #[must_use]
    pub fn new(settings: Settings, device: D, objects: Objects, pdos: Pdos) -> Self {
        let rates: Vec<_> = (0..=8).filter_map(BitTiming::from_index).collect();
        let config = Config { bit_rates: &rates, ..Config::new(settings.identity, settings.node) };
        let mut factory = Image { objects: objects.clone(), pdos: pdos.clone() };
        if let Some(node) = settings.node {
            factory.leave(node);
        }
        let dictionary = Dictionary::new(device, objects);
        let slave = Slave::new(&config, Served(od::Objects { dictionary, pdos }));
        Self { slave, factory, stored: None, started: false, sent: [None; PDOS] }
    }

    /// Its address; `None` while it waits for one.
    #[must_use]
    pub const fn node(&self) -> Option<NodeId> {
        self.slave.node()
    }

    /// Its NMT state; [`State::BootUp`] before it starts.
    #[must_use]
    pub const fn state(&self) -> State {
        self.slave.state()
    }

    /// Its objects but for the error register, the error history and the values of its
    /// [`pdos`](Self::pdos).
    #[must_use]
    pub const fn objects(&self) -> &Objects {
        &self.slave.objects().0.dictionary.objects
    }

    /// Its PDOs.
    #[must_use]
    pub const fn pdos(&self) -> &Pdos {
        &self.slave.objects().0.pdos
    }

    /// What it does.
    #[must_use]
    pub const fn device(&self) -> &D {
        &self.slave.objects().0.dictionary.device
    }

    /// Lets something happen to the device, such as a fault; what comes of it is sent.
    pub fn with_device<T>(&mut self, now: Duration, work: impl FnOnce(&mut D, &mut Context<'_>) -> T) -> T {
        let done = self.with(now, work);
        self.watch(now, false);
        done
    }

    fn with<T>(&mut self, now: Duration, work: impl FnOnce(&mut D, &mut Context<'_>) -> T) -> T {
        let mut errors = Vec::new();
        let state = self.slave.state();
        let od::Objects { dictionary: Dictionary { device, objects, .. }, pdos } =
            &mut self.slave.objects_mut().0;
        let done = work(device, &mut Context { now, objects, pdos, state, errors: &mut errors });
        for error in errors {
            // A full queue drops the message, not the history.
            let _ = match error {
                Error::Raised(code, data) => self.slave.raise(code, data),
                Error::Gone(code) => self.slave.clear(code),
                Error::Mentioned(code, data) => {
                    self.slave.mention(code, data);
                    Ok(())
                }
            };
        }
        done
    }

    fn is_operational(&self) -> bool {
        self.slave.state().has_pdo()
    }

    /// TPDOs whose objects have changed since they were sent, or that were never sent, become due: acyclic
    /// ones, for which it counts what they carry when SYNC comes, or event-driven ones.
    fn watch(&mut self, now: Duration, acyclic: bool) {
        if !self.is_operational() {
            return;
        }
        for number in 0..PDOS {
            let od::Objects { dictionary, pdos } = &self.slave.objects().0;
            let slot = pdos.tpdo_slots().get(number);
            let watched = slot.is_some_and(|slot| match slot.communication.transmission {
                Transmission::SyncAcyclic => acyclic,
                transmission => transmission.is_event_driven() && !acyclic,
            });
            let Some(data) = pdos.data(number, dictionary).filter(|_| watched) else { continue };
            let changed = self.sent.get(number) != Some(&Some(data));
            if changed && !self.with(now, |device, context| device.holds_back(context, number)) {
                self.slave.objects_mut().0.pdos.trigger(number);
            }
        }
    }

    /// A TPDO begins, or begins anew: not what the engine says, [`watch`](Self::watch) sends it.
    fn begins(&mut self, number: usize) {
        if let Some(sent) = self.sent.get_mut(number) {
            *sent = None;
        }
        self.slave.objects_mut().0.pdos.withdraw(number);
    }

    /// Remembers what a TPDO carries.
    fn sends(&mut self, frame: &Frame) {
        let slots = self.slave.objects().0.pdos.tpdo_slots();
        for (slot, sent) in slots.iter().zip(&mut self.sent) {
            if frame.standard_id() == slot.communication.cob_id.standard_id() {
                *sent = Some(Payload::from_slice(frame.data()));
            }
        }
    }

    fn start(&mut self, now: Duration) {
        if !self.started {
            self.boot(now);
        }
    }

    /// Starts, or starts anew: objects from the store, communication as they say.
    fn boot(&mut self, now: Duration) {
        self.started = true;
        let mut image = self.stored.as_ref().unwrap_or(&self.factory).clone();
        if let Some(node) = self.slave.next_node() {
            image.follow(node);
        }
        let own = &mut self.slave.objects_mut().0;
        (own.dictionary.objects, own.pdos) = (image.objects, image.pdos);
        if self.slave.boot(now) {
            for state in [State::BootUp, State::PreOperational] {
                self.with(now, |device, context| device.state(context, state));
            }
        }
    }

    /// What the slave tells takes effect.
    fn settle(&mut self, now: Duration) {
        while let Some(event) = self.slave.poll_event() {
            match event {
                Event::ResetNode | Event::ResetCommunication => self.boot(now),
                Event::State(state) => self.entered(now, state),
                Event::Written(at) => self.written(now, at),
                Event::Rpdo(number, Ok(())) => self.received(now, number),
                Event::LifeGuarding(guarding::Event::Lost)
                | Event::Heartbeat { event: heartbeat::Event::Lost, .. } => self.master(now, true),
                Event::LifeGuarding(guarding::Event::Back)
                | Event::Heartbeat { event: heartbeat::Event::Back, .. } => self.master(now, false),
                // The store is this process's memory: node ID and bit rate survive a reset.
                Event::Lss(lss::Action::Store { .. }) => self.slave.stored(Ok(())),
                _ => {}
            }
        }
    }

    fn entered(&mut self, now: Duration, state: State) {
        self.with(now, |device, context| device.state(context, state));
        if state.has_pdo() {
            (0..PDOS).for_each(|number| self.begins(number));
        }
    }

    /// After a write over SDO.
    fn written(&mut self, now: Duration, at: Address) {
        match at.index {
            0x1010 => {
                let od::Objects { dictionary, pdos } = &self.slave.objects().0;
                let mut image = Image { objects: dictionary.objects.clone(), pdos: pdos.clone() };
                if let Some(node) = self.node() {
                    image.leave(node);
                }
                self.stored = Some(image);
            }
            // The factory's values come back with the next start (CiA 301, 7.5.2.14).
            0x1011 => self.stored = None,
            _ => {}
        }
        self.with(now, |device, context| device.written(context, at));
        if let 0x1800..0x1C00 = at.index {
            self.begins(usize::from(at.index & 0x1FF));
        }
    }

    /// An RPDO has brought values.
    fn received(&mut self, now: Duration, number: usize) {
        let Some(slot) = self.pdos().rpdo_slots().get(number) else { return };
        let mapping = slot.mapping;
        let written = mapping.entries().iter().filter(|entry| !entry.is_dummy());
        self.with(now, |device, context| written.for_each(|entry| device.written(context, entry.at)));
    }

    fn master(&mut self, now: Duration, lost: bool) {
        self.with(now, |device, context| device.master(context, lost));
    }
}

impl<D: Device> can::Node for Node<D> {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        self.start(now);
        let asked = self.node().map(|node| Service::SdoRequest(node).id());
        if self.is_operational() || frame.standard_id() == asked {
            self.with(now, Device::update);
        }
        if frame.standard_id() == Some(self.slave.sync_id()) {
            self.watch(now, true);
        }
        self.slave.handle_frame(now, frame);
        self.settle(now);
        self.watch(now, false);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.start(now);
        if self.is_operational() || self.device().poll_timeout().is_some_and(|at| at <= now) {
            self.with(now, Device::update);
        }
        self.slave.handle_timeout(now);
        self.settle(now);
        self.watch(now, false);
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        self.start(now);
        let frame = self.slave.poll_transmit(now)?;
        self.sends(&frame);
        Some(frame)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        if !self.started {
            return Some(Duration::ZERO);
        }
        self.node()?;
        [self.slave.poll_timeout(), self.device().poll_timeout()].into_iter().flatten().min()
    }

    fn handle_bus(&mut self, now: Duration, event: can::Event) {
        if let can::Event::State(state) = event {
            self.slave.handle_bus(now, state.into());
        }
    }
}

impl Image {
    /// What depends on the address: identifiers of the predefined connection set, where the objects do not
    /// say otherwise, and the drive's own object of it.
    fn follow(&mut self, node: NodeId) {
        self.objects.set(0x1014, 0, i128::from(Service::Emcy(node).id()));
        self.objects.set(0x100B, 0, i128::from(node.raw()));
        self.identifiers(node, |cob_id, predefined| match cob_id.id() {
            0 => CobId(cob_id.0 | predefined),
            _ => cob_id,
        });
    }

    /// The opposite of [`follow`](Self::follow), so that what is kept goes on to follow the address.
    fn leave(&mut self, node: NodeId) {
        self.identifiers(node, |cob_id, predefined| match cob_id.id() {
            own if own == predefined => CobId(cob_id.0 & !own),
            _ => cob_id,
        });
    }

    /// Changes the identifiers of all PDOs; `change` gets one and that of the predefined connection set.
    fn identifiers(&mut self, node: NodeId, change: impl Fn(CobId, u32) -> CobId) {
        for (number, pdo) in DefaultPdo::ALL.into_iter().enumerate() {
            let changed = |slot: &Slot, predefined: Service| {
                let cob_id = change(slot.communication.cob_id, predefined.id().into());
                Slot { communication: Communication { cob_id, ..slot.communication }, ..*slot }
            };
            let rpdo = self.pdos.rpdo_slots().get(number).map(|slot| changed(slot, Service::Rpdo(pdo, node)));
            let tpdo = self.pdos.tpdo_slots().get(number).map(|slot| changed(slot, Service::Tpdo(pdo, node)));
            if let Some(slot) = rpdo {
                self.pdos.set_rpdo_slot(number, slot);
            }
            if let Some(slot) = tpdo {
                self.pdos.set_tpdo_slot(number, slot);
            }
        }
    }
}
