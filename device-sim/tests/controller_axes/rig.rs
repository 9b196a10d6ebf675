//! A controller with six drives: axes 1…4 on CAN 2, axes 5 and 6 on CAN 1, as delivered.

use core::time::Duration;

use canopen_master::ds402;
use device_sim::can::{Bus, Event as CanEvent, Faults, Network, Node, StationId};
use device_sim::canopen::{self, Fault, Ld2000};
use device_sim::plant::{Machine, Switch};
use lb2::code::{Failure, StoredFailure};
use lb2::device::{Device, DeviceEngine};
use lb2::master::{Config, Event, Master, Outcome};
use lb2::telegram::{BANK_LEN, Request, Response};
use motion_core::application::{AxisStatus, Order, Progress, State, Ticket};
use motion_core::bus::CanBus;
use motion_core::io::{Inputs, Outputs, Terminal};
use motion_core::{Controller, Model, STORAGE_LEN};
use pdo::{Frame, NodeId};

pub(crate) const AXES: usize = 6;
/// 10 turns/s: a drive that is lost turns on for 0.3 s, and its position repeats after 16 turns.
pub(crate) const V_MAX: i32 = 655_360;
const BIT_RATE: u32 = 500_000;

/// Six axes with control, jog and tolerance as in 6.11, each on the drive of its number.
const SETTINGS: [(u16, i32); 13] = [
    (107, 1),
    (100, 2),
    (450, 2),
    (600, 1),
    (642, V_MAX),
    (654, 500),
    (648, 200),
    (708, 100),
    (714, 100),
    (756, 65_536),
    (762, 327_680),
    (768, 65_536),
    (774, 327_680),
];
/// Objects 1 and 2 of CAN 1 are axes.
const OBJECTS: [(u16, i32); 4] = [(326, 3), (327, 3), (330, 3), (331, 3)];

/// What the controller has handed to one bus.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sent {
    pub(crate) sync: u64,
    pub(crate) rpdo: u64,
}

struct Station<'a> {
    bus: &'a mut CanBus,
    sent: &'a mut Sent,
}

impl Node for Station<'_> {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        self.bus.handle_frame(now, frame);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.bus.handle_timeout(now);
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        let frame = self.bus.poll_transmit(now)?;
        match frame.standard_id() {
            Some(0x080) => self.sent.sync += 1,
            Some(0x200..0x280) => self.sent.rpdo += 1,
            _ => {}
        }
        Some(frame)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.bus.poll_timeout()
    }

    fn handle_bus(&mut self, now: Duration, event: CanEvent) {
        Node::handle_bus(self.bus, now, event);
    }
}

pub(crate) type Drive = canopen::Node<Ld2000>;

pub(crate) struct Rig {
    pub(crate) controller: Controller<Vec<u8>, Vec<u8>>,
    /// CAN 1 and CAN 2. Station 0 is the controller.
    pub(crate) networks: [Network; 2],
    /// By axis.
    pub(crate) drives: Vec<Drive>,
    /// Whether it is plugged in.
    pub(crate) present: [bool; AXES],
    pub(crate) sent: [Sent; 2],
    /// Axes on the terminals, where there are any.
    pub(crate) machine: Machine,
    /// Switches on the way of an axis, by place, in user measuring units.
    pub(crate) switches: Vec<(usize, Switch)>,
    pub(crate) inputs: Inputs,
    pub(crate) outputs: Outputs,
}

impl Rig {
    /// Switched on with these parameters changed.
    pub(crate) fn new(changes: &[(u16, i32)], faults: Faults) -> Self {
        let mut controller = Controller::power_on(Model::Gel8231, vec![0xFF; STORAGE_LEN], vec![0; BANK_LEN]);
        let axes = (0..AXES as u16).flat_map(|at| SETTINGS.map(|(first, value)| (first + at, value)));
        // More inputs than activated axes are refused at any moment.
        for (index, value) in [(0, 6)].into_iter().chain(axes).chain(OBJECTS).chain(changes.iter().copied()) {
            let answer = controller.write_parameter(index, value);
            assert!(!answer.code.is_error(), "[{index}] = {value}: {}", answer.text);
        }
        assert_eq!(controller.call_loader(), -1);
        let network = |stations, seed| Network::new(Bus::new(BIT_RATE, Faults { seed, ..faults }), stations);
        let mut inputs = Inputs::default();
        inputs.digital.set(Terminal::PLC_RUN, true);
        Self {
            controller,
            networks: [network(4, faults.seed), network(6, faults.seed ^ 1)],
            drives: (0..AXES).map(switched_on).collect(),
            present: [true; AXES],
            sent: [Sent::default(); 2],
            machine: Machine { axes: Vec::new(), inputs },
            switches: Vec::new(),
            inputs,
            outputs: Outputs::default(),
        }
    }

    /// Scanned, booted, enabled, at rest.
    pub(crate) fn enabled(changes: &[(u16, i32)]) -> Self {
        let mut rig = Self::new(changes, Faults::NONE);
        rig.start();
        rig
    }

    pub(crate) fn start(&mut self) {
        self.until("all drives booted", Self::is_booted);
        self.set_power(true);
        self.until("all drives enabled", |rig| {
            (0..AXES).all(|axis| rig.state(axis) == ds402::State::OperationEnabled)
        });
    }

    pub(crate) fn is_booted(&mut self) -> bool {
        [2, 4].into_iter().enumerate().all(|(at, drives)| {
            let bus = self.controller.bus(at).unwrap();
            !bus.is_scanning() && bus.ready().len() == drives
        })
    }

    pub(crate) fn set_power(&mut self, on: bool) {
        for axis in 0..AXES {
            self.controller.axis(axis).unwrap().set_power(on).unwrap();
        }
    }

    pub(crate) fn now(&self) -> Duration {
        self.networks[0].now()
    }

    /// The bus of an axis, by place, and its station there.
    pub(crate) fn place(&self, axis: usize) -> (usize, StationId) {
        let (bus, station) = if axis < 4 { (1, axis + 1) } else { (0, axis - 3) };
        (bus, self.networks[bus].station(station).unwrap())
    }

    /// Switches a drive off and on again.
    pub(crate) fn power_cycle(&mut self, axis: usize) {
        self.drives[axis] = switched_on(axis);
    }

    /// Pulls a drive's plug, or puts it in again.
    pub(crate) fn plug(&mut self, axis: usize, on: bool) {
        let (bus, station) = self.place(axis);
        self.networks[bus].bus().plug(station, on);
        self.present[axis] = on;
    }

    pub(crate) fn drive<T>(&mut self, axis: usize, work: impl FnOnce(&mut Ld2000) -> T) -> T {
        let now = self.now();
        self.drives[axis].with_device(now, |drive, _| work(drive))
    }

    /// The motor of an axis fails.
    pub(crate) fn fault(&mut self, axis: usize) {
        let now = self.now();
        self.drives[axis].with_device(now, |drive, context| drive.fail(context, Fault::Motor));
    }

    pub(crate) fn state(&mut self, axis: usize) -> ds402::State {
        self.drive(axis, |drive| drive.state())
    }

    /// Where a drive really is, in user measuring units.
    pub(crate) fn real(&mut self, axis: usize) -> f64 {
        self.drive(axis, |drive| drive.motion().0) / 16.0
    }

    pub(crate) fn status(&self, axis: usize) -> AxisStatus {
        *self.controller.axis_status(axis).unwrap()
    }

    /// One control cycle, then what happens until the next one.
    pub(crate) fn cycle(&mut self) -> &Outputs {
        for (axis, switch) in self.switches.clone() {
            let position = self.real(axis);
            switch.read(position, &mut self.inputs.digital);
        }
        let (now, cycle) = (self.now(), self.controller.cycle_time());
        self.outputs = self.controller.cycle(now, &self.inputs, &mut ());
        self.controller.advance(cycle).unwrap();
        let (four, two) = self.drives.split_at_mut(4);
        for (at, drives) in [(0, two), (1, four)] {
            let bus = self.controller.bus(at).unwrap();
            let mut controller = Station { bus, sent: &mut self.sent[at] };
            let mut monitor = Monitor;
            let mut nodes: Vec<&mut dyn Node> = vec![&mut controller];
            nodes.extend(drives.iter_mut().map(|drive| drive as &mut dyn Node));
            nodes.push(&mut monitor);
            while self.networks[at].step(&mut nodes, now + cycle) {}
        }
        if !self.machine.axes.is_empty() {
            self.machine.inputs = self.inputs;
            let inputs = self.machine.run(cycle.as_millis() as u32, &self.outputs);
            self.inputs.encoders = inputs.encoders;
        }
        &self.outputs
    }

    pub(crate) fn run(&mut self, time: Duration) {
        let end = self.now() + time;
        while self.now() < end {
            self.cycle();
        }
    }

    /// Cycles until the condition holds, at most 20 s; how long it took.
    pub(crate) fn until(&mut self, what: &str, mut holds: impl FnMut(&mut Self) -> bool) -> Duration {
        let start = self.now();
        while !holds(self) {
            self.cycle();
            let states: Vec<_> =
                (0..AXES).map(|axis| (self.status(axis).state, self.status(axis).error)).collect();
            assert!(
                self.now() - start < Duration::from_secs(20),
                "never {what}: {states:?} {:?}",
                self.failures()
            );
        }
        self.now() - start
    }

    pub(crate) fn order(&mut self, axis: usize, order: Order) -> Ticket {
        self.controller.axis(axis).unwrap().order(order).unwrap()
    }

    pub(crate) fn progress(&mut self, axis: usize, ticket: Ticket) -> Progress {
        self.controller.axis(axis).unwrap().progress(ticket)
    }

    /// To a position, at the velocity given; waits for the end.
    pub(crate) fn arrive(&mut self, axis: usize, position: i32, velocity: u32) {
        let ticket = self.order(axis, Order::MoveAbsolute { position, velocity: Some(velocity) });
        self.until("arrived", |rig| rig.progress(axis, ticket) == Progress::Done);
    }

    pub(crate) fn reset(&mut self, axis: usize) {
        self.controller.axis(axis).unwrap().reset();
    }

    /// The stored failures as LB2 50h reads them: axis and number.
    pub(crate) fn failures(&mut self) -> Vec<(u8, Failure)> {
        let now = self.now();
        let (mut master, mut engine) = (Master::new(Config::default()), DeviceEngine::default());
        master.submit(&Request::Failures, 0).unwrap();
        let bytes = master.poll_transmit(now).unwrap().to_vec();
        engine.handle_bytes(now, &bytes, &mut self.controller);
        let answer = engine.poll_transmit(now).unwrap().to_vec();
        master.handle_transmit_done(now);
        master.handle_bytes(now, &answer);
        match master.poll_event() {
            Some(Event::Outcome { outcome: Outcome::Done(Response::Failures(list)), .. }) => {
                list.iter().map(|StoredFailure { axis, failure }| (axis, failure)).collect()
            }
            other => panic!("{other:?}"),
        }
    }

    /// What the cycle that has just been must have done with an axis: failure stored with its number, axis
    /// in ErrorStop with that error.
    pub(crate) fn assert_failed(&mut self, axis: usize, failure: Failure) {
        let status = self.status(axis);
        assert_eq!((status.state, status.error.failure()), (State::ErrorStop, Some(failure)));
        let stored = self.failures();
        assert_eq!(stored.last(), Some(&(axis as u8 + 1, failure)), "{stored:?}");
    }

    /// Cycles until an axis fails, which must be in the cycle in which `cause` first holds: it looks at
    /// what the cycle is about to see. The time it took.
    pub(crate) fn until_failed(
        &mut self,
        axis: usize,
        failure: Failure,
        cause: impl Fn(&mut Self) -> bool,
    ) -> Duration {
        let start = self.now();
        loop {
            let expected = cause(self);
            let before = self.failures().len();
            self.cycle();
            let failed = self.status(axis).state == State::ErrorStop;
            assert_eq!(failed, expected, "at {:?}: {:?}", self.now(), self.failures());
            if failed {
                assert_eq!(self.failures().len(), before + 1);
                self.assert_failed(axis, failure);
                return self.now() - start;
            }
            assert!(self.now() - start < Duration::from_secs(20), "no failure");
        }
    }
}

/// Somebody else on the bus, who acknowledges when all drives are away.
struct Monitor;

impl Node for Monitor {
    fn handle_frame(&mut self, _: Duration, _: &Frame) {}
    fn handle_timeout(&mut self, _: Duration) {}
    fn poll_transmit(&mut self, _: Duration) -> Option<Frame> {
        None
    }
    fn poll_timeout(&self) -> Option<Duration> {
        None
    }
}

fn switched_on(axis: usize) -> Drive {
    Ld2000::node(NodeId::new([1, 2, 3, 4, 1, 2][axis]).ok(), axis as u32)
}
