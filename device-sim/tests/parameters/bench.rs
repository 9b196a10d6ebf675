//! One axis of a whole controller on its plant, and what a parameter changes there.

use core::fmt::Debug;
use core::time::Duration;

use device_sim::plant::{Connection, Drive, Incremental, Machine, Plant, Sensor, Switch, TwoSpeed, Wiring};
use lb2::code::{Failure, StoredFailure};
use lb2::device::Device;
use lb2::telegram::BANK_LEN;
use motion_core::application::{AxisStatus, Order, Progress};
use motion_core::io::{Inputs, Outputs, Terminal};
use motion_core::parameters::get;
use motion_core::{Controller, Model, STORAGE_LEN};

/// `[600]`.
pub(crate) const NONE: i32 = 0;
pub(crate) const CONTROL: i32 = 1;
pub(crate) const SIGNALS: i32 = 2;
pub(crate) const RAMPS: i32 = 3;

/// 10 V, or V max.
pub(crate) const V_MAX: f64 = 10_000.0;
/// Speeds of the motor behind contactors.
pub(crate) const SLOW: f64 = 1_000.0;
pub(crate) const FAST: f64 = 5_000.0;

/// What every axis is set to, in user measuring units of one edge; each mode has its own there.
const SETTINGS: [(u16, i32); 30] = [
    (600, NONE),
    (606, 0),
    (612, 0),
    (642, 10_000),
    (648, 200),
    (654, 500),
    (708, 20),
    (714, 20),
    (756, 1_000),
    (762, 5_000),
    (768, 2_000),
    (774, 4_000),
    (792, 4_000),
    (798, 500),
    (822, 650),
    (828, 28),
    (834, 650),
    (840, 28),
    (858, 1),
    (864, 1),
    (870, 30),
    (894, 4_000),
    (900, 200),
    (906, 1_000),
    (912, 300),
    (918, 2_000),
    (930, 3_000),
    (942, -3_000),
    (954, 6),
    (966, 7),
];

/// Which axis is looked at, and the input and output it is on; by place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Route {
    pub(crate) axis: usize,
    pub(crate) input: usize,
    pub(crate) output: usize,
}

impl Route {
    /// Index of this route's instance of a parameter.
    fn index(self, first: u16) -> u16 {
        first
            + match first {
                100..=280 => self.input as u16,
                450..=548 => self.output as u16,
                600.. => self.axis as u16,
                _ => 0,
            }
    }
}

pub(crate) struct Bench {
    pub(crate) route: Route,
    pub(crate) controller: Controller<Vec<u8>, Vec<u8>>,
    /// The plant; more of them where a test adds some.
    pub(crate) machine: Machine,
    pub(crate) inputs: Inputs,
    pub(crate) outputs: Outputs,
    now: Duration,
}

impl Bench {
    /// The axis enabled, in a mode, with the plant of that mode; parameters changed by the first index of
    /// their kind.
    pub(crate) fn new(route: Route, mode: i32, changes: &[(u16, i32)]) -> Self {
        Self::with(route, mode, changes, &[])
    }

    /// The same with further changes, of single indices.
    pub(crate) fn with(route: Route, mode: i32, changes: &[(u16, i32)], single: &[(u16, i32)]) -> Self {
        let mut controller = Controller::power_on(Model::Gel8231, vec![0xFF; STORAGE_LEN], vec![0; BANK_LEN]);
        let axes = (0..6u16).flat_map(|at| SETTINGS.map(|(first, value)| (first + at, value)));
        let signals = mode == SIGNALS;
        let route_of = [
            (107, 1),
            (606, route.input as i32 + 1),
            (612, route.output as i32 + 1),
            (600, mode),
            (450, if signals { 3 } else { 1 }),
            (528, 2),
            (546, if signals { 3 } else { 0 }),
        ];
        // Inputs 4…6 have no encoder of their own: they take over the actual value of input 1.
        let virtual2 = [(100, 4), (156, 0), (163, 1)];
        let virtual2 = if route.input < 3 { &[][..] } else { &virtual2[..] };
        let own =
            route_of.iter().chain(virtual2).chain(changes).map(|&(first, value)| (route.index(first), value));
        for (index, value) in [(0, 6)].into_iter().chain(axes).chain(own).chain(single.iter().copied()) {
            let answer = controller.write_parameter(index, value);
            assert!(!answer.code.is_error(), "[{index}] = {value}: {}", answer.text);
        }
        assert_eq!(controller.call_loader(), -1, "{changes:?} {single:?}");
        let block = route.output;
        let (drive, connection) = if signals {
            (Drive::TwoSpeed(TwoSpeed::new(SLOW, FAST, 20_000.0)), Connection::Signals { block })
        } else {
            (Drive::first_order(V_MAX, 0.005), Connection::Analog { block, unipolar: false })
        };
        let mut wiring =
            Wiring::new(Plant::new(drive), connection, Sensor::Incremental(Incremental::new(1.0, 1_000, 0)));
        wiring.sensor.as_mut().unwrap().0 = if route.input < 3 { route.input } else { 0 };
        let mut inputs = Inputs::default();
        inputs.digital.set(Terminal::PLC_RUN, true);
        let machine = Machine { axes: vec![wiring], inputs };
        let mut bench =
            Self { route, controller, machine, inputs, outputs: Outputs::default(), now: Duration::ZERO };
        bench.cycle();
        // In mode None there is no such axis.
        let powered = bench.controller.axis(route.axis).unwrap().set_power(true);
        assert_eq!(powered.is_ok(), bench.controller.working().at(600, route.axis) != NONE);
        bench.cycle();
        bench
    }

    /// With another drive, from where the axis is.
    pub(crate) fn set_drive(&mut self, drive: Drive) {
        let at = self.real();
        self.machine.axes[0].plant = Plant::new(drive).at(at);
    }

    /// With one more switch on the way, which shows at once.
    pub(crate) fn add_switch(&mut self, switch: Switch) {
        self.machine.axes[0].switches.push(switch);
        switch.read(self.real(), &mut self.inputs.digital);
    }

    /// Pushes the axis to a position.
    pub(crate) fn push(&mut self, position: f64) {
        let plant = &mut self.machine.axes[0].plant;
        *plant = plant.clone().at(position);
        self.inputs = self.machine.run(0, &self.outputs);
    }

    pub(crate) fn cycle(&mut self) {
        self.outputs = self.controller.cycle(self.now, &self.inputs, &mut ());
        let cycle = self.controller.cycle_time();
        self.controller.advance(cycle).unwrap();
        self.inputs = self.machine.run(cycle.as_millis() as u32, &self.outputs);
        self.now += cycle;
    }

    pub(crate) fn run(&mut self, ms: u64) {
        let end = self.now + Duration::from_millis(ms);
        while self.now < end {
            self.cycle();
        }
    }

    /// Cycles until the condition holds: the ms it took, −1 if it does not within 6 s.
    pub(crate) fn until(&mut self, mut holds: impl FnMut(&mut Self) -> bool) -> f64 {
        let start = self.now;
        while !holds(self) {
            if self.now - start > Duration::from_secs(6) {
                return -1.0;
            }
            self.cycle();
        }
        (self.now - start).as_millis() as f64
    }

    /// ms since it was switched on.
    pub(crate) const fn now_ms(&self) -> u128 {
        self.now.as_millis()
    }

    /// Where the axis really is.
    pub(crate) fn real(&self) -> f64 {
        self.machine.axes[0].plant.position()
    }

    /// How fast it really is.
    pub(crate) fn speed(&self) -> f64 {
        self.machine.axes[0].plant.velocity()
    }

    pub(crate) fn status(&self) -> AxisStatus {
        *self.controller.axis_status(self.route.axis).unwrap()
    }

    /// mV on the output.
    pub(crate) fn voltage(&self) -> i16 {
        self.outputs.analog[self.route.output]
    }

    /// A terminal of the output's block.
    pub(crate) fn terminal(&self, bit: u8) -> bool {
        self.outputs.digital[self.route.output] >> bit & 1 != 0
    }

    pub(crate) fn order(&mut self, order: Order) {
        self.controller.axis(self.route.axis).unwrap().order(order).unwrap();
    }

    /// An order, and how far it is after `ms`.
    pub(crate) fn ordered(&mut self, order: Order, ms: u64) -> Progress {
        let ticket = self.controller.axis(self.route.axis).unwrap().order(order).unwrap();
        self.run(ms);
        self.controller.axis(self.route.axis).unwrap().progress(ticket)
    }

    /// To a position; the ms until it is reached, −1 if it is not within 6 s.
    pub(crate) fn go(&mut self, position: i32) -> f64 {
        self.order(Order::MoveAbsolute { position, velocity: None });
        self.cycle();
        self.until(|bench| bench.status().at_target)
    }

    pub(crate) fn jog(&mut self, forward: bool, fast: bool) {
        self.order(Order::Jog { forward, fast });
    }

    /// Velocity of a jog once it is reached.
    pub(crate) fn jog_speed(&mut self, forward: bool, fast: bool) -> f64 {
        self.jog(forward, fast);
        self.run(1_500);
        self.speed()
    }

    /// Greatest real velocity in `ms`.
    pub(crate) fn fastest(&mut self, ms: u64) -> f64 {
        let end = self.now + Duration::from_millis(ms);
        let mut most = 0.0_f64;
        while self.now < end {
            self.cycle();
            most = most.max(self.speed().abs());
        }
        most
    }

    /// The failures stored of this axis, as LB2 reads them; others must not have any.
    pub(crate) fn failures(&self) -> Vec<Failure> {
        let stored = (0..self.controller.failure_count()).filter_map(|at| self.controller.failure(at));
        stored
            .map(|StoredFailure { axis, failure }| {
                assert_eq!(usize::from(axis), self.route.axis + 1, "{failure:?}");
                failure
            })
            .collect()
    }
}

/// What there are several of: the axes; inputs and outputs with the axis of their number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Family {
    /// Axes 1…6, each on input and output 1.
    Axes,
    /// Inputs 1…6.
    Inputs,
    /// Input 1.
    First,
    /// Inputs 2…6.
    Others,
    /// Inputs 1…3, those with terminals.
    Encoders,
    /// Outputs 1…3.
    Outputs,
}

impl Family {
    fn routes(self) -> Vec<Route> {
        let places = match self {
            Self::Axes | Self::Inputs => 0..6,
            Self::First => 0..1,
            Self::Others => 1..6,
            Self::Encoders | Self::Outputs => 0..3,
        };
        let route = |at| match self {
            Self::Axes => Route { axis: at, input: 0, output: 0 },
            Self::Outputs => Route { axis: at, input: 0, output: at },
            _ => Route { axis: at, input: at, output: 0 },
        };
        places.map(route).collect()
    }
}

/// What a parameter does, closed loop.
pub(crate) struct Effect<'a> {
    pub(crate) family: Family,
    /// Modes it works in.
    pub(crate) modes: &'a [i32],
    /// First index.
    pub(crate) parameter: u16,
    /// What else is set.
    pub(crate) base: &'a [(u16, i32)],
    /// What is seen while the parameter is left alone.
    pub(crate) left: f64,
    /// Values, and what is seen with each.
    pub(crate) cases: &'a [(i32, f64)],
    /// By how much anything seen may be off.
    pub(crate) tolerance: f64,
}

impl Effect<'_> {
    /// Looks at every instance in every mode with further parameters.
    pub(crate) fn each(&self, changes: &[(u16, i32)], look: impl Fn(&mut Bench)) {
        for &mode in self.modes {
            for route in self.family.routes() {
                look(&mut Bench::new(route, mode, &[self.base, changes].concat()));
            }
        }
    }

    /// Looks at every instance in every mode: what is seen is what each value makes of it, and what it was
    /// while the parameter is left alone or written to another instance. So that the parameter shows, one
    /// value at least must make a difference.
    pub(crate) fn shows(&self, observe: impl Fn(&mut Bench) -> f64) {
        let Self { parameter, left, tolerance, .. } = *self;
        let differs = |seen: f64| (seen - left).abs() > 2.0 * tolerance;
        let telling =
            self.cases.iter().filter(|(_, seen)| differs(*seen)).map(|(value, _)| *value).next_back();
        let telling = telling.expect("no value makes a difference");
        let row = get(parameter).unwrap().row();
        let terminals = matches!(self.family, Family::Encoders | Family::Outputs);
        let last = if terminals { row.first + 2 } else { row.last };
        for (&mode, route) in self
            .modes
            .iter()
            .flat_map(|mode| self.family.routes().into_iter().map(move |route| (mode, route)))
        {
            let check = |changes: &[(u16, i32)], single: &[(u16, i32)], expected: f64| {
                let mut bench = Bench::with(route, mode, &[self.base, changes].concat(), single);
                let seen = observe(&mut bench);
                assert!(
                    (seen - expected).abs() <= tolerance,
                    "mode {mode}, {route:?}, {changes:?} {single:?}: {seen}, {expected} ± {tolerance} expected"
                );
            };
            check(&[], &[], left);
            for &(value, expected) in self.cases {
                check(&[(parameter, value)], &[], expected);
            }
            if last > row.first {
                let own = route.index(parameter);
                let other = if own < last { own + 1 } else { own - 1 };
                check(&[], &[(other, telling)], left);
            }
        }
    }
}
