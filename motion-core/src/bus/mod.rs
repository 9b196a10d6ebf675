//! The two CAN buses (manual A 4.3.4.4, 6.5, 7.2): scan, guarding, SYNC, and the process data of objects
//! IN 1…4 and OUT 1…4, as CANopen master or slave, or CAN Link.
//!
//! A bus is an engine as those of `canopen-master`: frames and time in, frames out. The control cycle
//! reads the drives' positions from it and gives it set values.

mod drive;
mod image;
mod master;
mod settings;
mod slave;

pub use image::Image;
pub use settings::{Kind, OBJECTS, Object, Role, Settings};

use core::time::Duration;

use can_link::Link;
use canopen_master::master::{BusStatus, Master};
use canopen_master::scan::{self, BusState};
use canopen_master::sdo::Small;
use canopen_master::slave::Event as SlaveEvent;
use canopen_master::{NodeSet, ds402, nmt, sync};
use lb2::code::Failure;
use pdo::layout::ld2000;
use pdo::{Frame, Handled, NodeId, Payload};

use crate::control::DriveInputs;
use crate::output::DriveSetpoint;
use crate::parameters::Values;
use drive::Drive;

/// Addresses that are scanned and guarded (4.3.4.4, 6.5.1.1).
pub const NODES: usize = 16;

/// CANopen as a master.
type CanMaster = Master<'static, Small, NODES>;

/// What takes the frames of a bus.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "one value a bus, and nothing to allocate it with")]
enum Engine {
    Master(CanMaster),
    /// Process data only: the addresses of a slave are those of its objects.
    Slave(slave::Slave),
    Link(Link),
}

/// One CAN bus.
#[derive(Debug)]
pub struct CanBus {
    /// 0 = CAN 1, 1 = CAN 2.
    at: usize,
    role: Role,
    settings: Settings,
    engine: Engine,
    image: Image,
    drives: [Drive; 2 * OBJECTS],
    /// Last words to drives that no object OUT is for any more.
    farewells: [Option<Frame>; OBJECTS],
    /// Nodes that have booted.
    ready: NodeSet,
    /// Nodes that were found and are to boot.
    to_boot: NodeSet,
    now: Duration,
    started: bool,
    scanning: bool,
}

impl CanBus {
    /// Bus `at`, 0 or 1, of a controller of this model as it is switched on.
    #[must_use]
    pub fn new(model: u16, values: &Values, at: usize) -> Self {
        let role = Role::read(values, at);
        let settings = Settings::read(values, at);
        let engine = match role {
            Role::Master => Engine::Master(Master::default()),
            // Its own objects tell its address; bypassed ones are shared with another slave.
            Role::Slave => {
                let own = settings.iter().find(|object| !object.bypass).map(|object| object.node);
                Engine::Slave(slave::new(model, own))
            }
            Role::Link => Engine::Link(Link::new()),
        };
        Self {
            at,
            role,
            settings,
            engine,
            image: Image::default(),
            drives: Default::default(),
            farewells: [None; OBJECTS],
            ready: NodeSet::EMPTY,
            to_boot: NodeSet::EMPTY,
            now: Duration::ZERO,
            started: false,
            scanning: false,
        }
    }

    /// What the bus is.
    #[must_use]
    pub const fn role(&self) -> Role {
        self.role
    }

    /// Its address as a slave: that of its first object without master bypass as it was switched on, or
    /// what LSS has given it. `None`: it is silent until LSS gives it one, or it is no slave.
    #[must_use]
    pub const fn node(&self) -> Option<NodeId> {
        match &self.engine {
            Engine::Slave(slave) => slave.node(),
            Engine::Master(_) | Engine::Link(_) => None,
        }
    }

    /// The objects in use.
    #[must_use]
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Takes over the objects. Master or slave, and CAN Link, are effective after switching on (6.5.1);
    /// new objects take part after a scan (4.3.4.4).
    ///
    /// A drive whose object OUT goes or becomes another one is stopped (project-defined); by place, whether
    /// it had one.
    pub fn configure(&mut self, values: &Values) -> [bool; OBJECTS] {
        let settings = Settings::read(values, self.at);
        let mut left = [false; OBJECTS];
        let objects = self.settings.outputs.into_iter().zip(settings.outputs).enumerate();
        for ((place, (before, after)), left) in objects.zip(&mut left) {
            if before != after {
                self.image.withdraw(place);
                *left = before.is_some_and(|object| self.leave(place, object));
            }
        }
        // Drives that keep an object are what they were.
        let mut drives: [Drive; 2 * OBJECTS] = Default::default();
        for (object, drive) in settings.inputs.into_iter().chain(settings.outputs).zip(&mut drives) {
            if let Some(object) = object.filter(|object| object.kind == Kind::Axis)
                && let Some(before) = self.drive_mut(object.node)
            {
                *drive = core::mem::take(before);
            }
        }
        (self.settings, self.drives) = (settings, drives);
        left
    }

    /// Lets go of the drive behind an object OUT: quick stop, which ends with its output stage off. Whether
    /// there was one.
    fn leave(&mut self, place: usize, object: Object) -> bool {
        if object.kind != Kind::Axis || !self.ready.contains(object.node) {
            return false;
        }
        if let Some(drive) = self.drive_mut(object.node) {
            drive.forget();
        }
        let stop = ld2000::Command { control_word: ds402::Command::QuickStop.bits(), speed: 0 };
        let id = embedded_can::StandardId::new(object.id(self.role, false));
        if let Some(slot) = self.farewells.get_mut(place) {
            *slot = id.map(|id| stop.encode().frame(id));
        }
        true
    }

    /// Process data of the objects.
    pub const fn image(&mut self) -> &mut Image {
        &mut self.image
    }

    /// The channels of CAN Link, where `[302]` or `[303]` says so.
    pub const fn link(&mut self) -> Option<&mut Link> {
        match &mut self.engine {
            Engine::Link(link) => Some(link),
            Engine::Master(_) | Engine::Slave(_) => None,
        }
    }

    /// Nodes that the scan expects: addresses 1…16 with an object that is not inactive and not Other.
    /// Bypassed addresses have neither scan nor guarding (6.5.1.1).
    fn expected(&self) -> NodeSet {
        let scanned = |object: &Object| {
            !object.bypass && object.kind != Kind::Other && usize::from(object.node.raw()) <= NODES
        };
        self.settings.iter().filter(scanned).map(|object| object.node).collect()
    }

    /// `BUS WARN` or `OK` of the last scan (4.3.4.4); a bus without a scan of its own is OK.
    #[must_use]
    pub fn state(&self) -> BusState {
        match &self.engine {
            Engine::Master(master) if self.started => master.bus_state(self.expected()),
            _ => BusState::Ok,
        }
    }

    /// The scan's line of a node (4.3.4.4).
    pub fn row(&mut self, node: NodeId) -> Option<scan::Row> {
        let number = |objects: &[Option<Object>; OBJECTS]| {
            let place = objects.iter().position(|object| object.is_some_and(|object| object.node == node));
            place.map(|place| place as u8 + 1)
        };
        let (input, output) = (number(&self.settings.inputs), number(&self.settings.outputs));
        match &mut self.engine {
            Engine::Master(master) => Some(master.row(node, input, output)),
            Engine::Slave(_) | Engine::Link(_) => None,
        }
    }

    /// Whether a scan is under way.
    #[must_use]
    pub const fn is_scanning(&self) -> bool {
        self.scanning
    }

    /// Nodes that have booted and are there.
    #[must_use]
    pub const fn ready(&self) -> NodeSet {
        self.ready
    }

    /// Scans the bus and boots what is found; done by itself after switching on. A master whose objects
    /// are all inactive has nothing to do with the bus: it is silent, without SYNC (project-defined).
    pub fn scan(&mut self) {
        let expected = self.expected();
        let used = self.settings.iter().next().is_some();
        let Engine::Master(master) = &mut self.engine else { return };
        // A period of 10 ms without a counter is always taken.
        let sync = sync::Producer::new(sync::PERIOD, 0, Duration::ZERO, self.now).ok();
        master.set_sync(sync.filter(|_| used));
        // Refused while one is under way, or without a bus: what is expected stays silent then.
        self.scanning = !expected.is_empty() && master.scan(expected, scan::Options::default()).is_ok();
        self.ready = NodeSet::EMPTY;
        self.to_boot = NodeSet::EMPTY;
        if used && expected.is_empty() {
            self.start_others();
        }
    }

    fn start(&mut self, now: Duration) {
        if let Engine::Slave(slave) = &mut self.engine {
            slave.boot(now);
        }
        self.scan();
    }

    /// Takes a frame.
    pub fn handle_frame(&mut self, now: Duration, frame: &impl embedded_can::Frame) -> Handled {
        self.now = self.now.max(now);
        let Some(frame) = Frame::from_can(frame) else { return Handled::Ignored };
        let mut handled = match &mut self.engine {
            Engine::Master(master) => master.handle_frame(now, &frame),
            Engine::Slave(slave) => slave.handle_frame(now, &frame),
            Engine::Link(link) => match link.handle_frame(now, &frame) {
                can_link::Handled::Ignored => Handled::Ignored,
                _ => Handled::Taken,
            },
        };
        if self.receive(now, &frame) {
            handled = Handled::Taken;
        }
        self.events(now);
        handled
    }

    /// Takes process data.
    fn receive(&mut self, now: Duration, frame: &Frame) -> bool {
        if frame.is_remote() || self.role == Role::Link || !self.is_operational() {
            return false;
        }
        let mut taken = false;
        for (place, object) in self.settings.inputs.into_iter().enumerate() {
            let Some(object) = object else { continue };
            if frame.standard_id() != Some(object.id(self.role, true)) {
                continue;
            }
            let data = Payload::from_slice(frame.data());
            self.image.receive(place, data);
            if object.kind == Kind::Axis
                && let Some(drive) = self.drive_mut(object.node)
            {
                drive.receive(now, data);
            }
            taken = true;
        }
        taken
    }

    /// Whether process data pass: a slave has them only while its master lets it.
    fn is_operational(&self) -> bool {
        match &self.engine {
            Engine::Slave(slave) => slave.state() == nmt::State::Operational,
            Engine::Master(_) | Engine::Link(_) => true,
        }
    }

    /// Lets everything happen whose time has come; early calls do nothing.
    pub fn handle_timeout(&mut self, now: Duration) {
        self.now = self.now.max(now);
        if !core::mem::replace(&mut self.started, true) {
            self.start(now);
        }
        match &mut self.engine {
            Engine::Master(master) => master.handle_timeout(now),
            Engine::Slave(slave) => slave.handle_timeout(now),
            Engine::Link(link) => link.handle_timeout(now),
        }
        self.events(now);
    }

    /// What the adapter says about the bus.
    pub fn handle_bus(&mut self, now: Duration, status: BusStatus) {
        if let Engine::Master(master) = &mut self.engine {
            master.handle_bus(now, status);
            self.events(now);
        }
    }

    /// When to call [`handle_timeout`](Self::handle_timeout).
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Duration> {
        if !self.started {
            return Some(Duration::ZERO);
        }
        match &self.engine {
            Engine::Master(master) => master.poll_timeout(),
            Engine::Slave(slave) => slave.poll_timeout(),
            Engine::Link(link) => link.poll_timeout(),
        }
    }

    /// The next frame to send, until `None`.
    pub fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        if let Some(farewell) = self.farewells.iter_mut().find_map(Option::take) {
            return Some(farewell);
        }
        if self.is_operational() {
            while let Some((place, data)) = self.image.take_due() {
                let object = self.settings.outputs.get(place).copied().flatten();
                if let Some(object) = object
                    && let Some(id) = embedded_can::StandardId::new(object.id(self.role, false))
                {
                    return Some(data.frame(id));
                }
            }
        }
        let frame = match &mut self.engine {
            Engine::Master(master) => master.poll_transmit(now),
            Engine::Slave(slave) => slave.poll_transmit(now),
            Engine::Link(link) => link.poll_transmit(now),
        };
        self.events(now);
        frame
    }

    /// The drive of a node: each has one place, that of its first object.
    fn drive_mut(&mut self, node: NodeId) -> Option<&mut Drive> {
        let objects = self.settings.inputs.into_iter().chain(self.settings.outputs);
        let mut places = objects.zip(&mut self.drives);
        places
            .find(|(object, _)| object.is_some_and(|object| object.node == node && object.kind == Kind::Axis))
            .map(|(_, drive)| drive)
    }

    /// Reads the drives behind the first `places` objects: positions and failures of this cycle.
    pub fn read_drives(&mut self, now: Duration, first: usize, places: usize, to: &mut DriveInputs) {
        let Settings { inputs, outputs } = self.settings;
        let mut failures: [Option<Failure>; 2 * OBJECTS] = [None; 2 * OBJECTS];
        for (failure, drive) in failures.iter_mut().zip(&mut self.drives) {
            *failure = drive.take_failure();
        }
        for place in 0..places {
            let axis = |objects: &[Option<Object>; OBJECTS]| {
                objects.get(place).copied().flatten().filter(|object| object.kind == Kind::Axis)
            };
            let slot = |node: NodeId| {
                inputs.iter().chain(&outputs).position(|other| {
                    other.is_some_and(|other| other.node == node && other.kind == Kind::Axis)
                })
            };
            let failed = |node| slot(node).and_then(|slot| failures.get(slot).copied().flatten());
            if let Some(object) = axis(&inputs) {
                if let Some(failure) = to.input_failures.get_mut(first + place) {
                    *failure = failed(object.node);
                }
                let position = self.drive_mut(object.node).and_then(|drive| drive.position(now));
                if let Some(slot) = to.positions.get_mut(first + place) {
                    *slot = position;
                }
            }
            if let Some(object) = axis(&outputs)
                && let Some(failure) = to.output_failures.get_mut(first + place)
            {
                *failure = failed(object.node);
            }
        }
    }

    /// Gives the drive behind object OUT `place` (0…3) its set value.
    pub fn command(&mut self, now: Duration, place: usize, wanted: &DriveSetpoint) {
        let object = self.settings.outputs.get(place).copied().flatten();
        let Some(object) = object.filter(|object| object.kind == Kind::Axis) else { return };
        if !self.ready.contains(object.node) {
            return;
        }
        if let Some(data) = self.drive_mut(object.node).map(|drive| drive.command(now, wanted)) {
            self.image.put(place, data);
        }
    }

    /// Follows what the engine tells.
    fn events(&mut self, now: Duration) {
        match &mut self.engine {
            Engine::Master(_) => {}
            Engine::Slave(slave) => {
                while let Some(event) = slave.poll_event() {
                    if matches!(event, SlaveEvent::ResetNode | SlaveEvent::ResetCommunication) {
                        slave.boot(now);
                    }
                }
                return;
            }
            Engine::Link(_) => return,
        }
        while let Engine::Master(master) = &mut self.engine
            && let Some(event) = master.poll_event()
        {
            self.event(now, &event);
        }
        self.boot_next(now);
    }
}
