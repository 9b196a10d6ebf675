//! Axes in closed loop with a plant on virtual time: one named test a parameter, and what happens when
//! things fail.

mod calibration;
mod control;
mod failures;
mod gear;
mod limits;
mod ramps;
mod signals;

use super::*;
use crate::application::Order;
use crate::input::ActualValue;
use crate::io::{DigitalInputs, Terminal};
use crate::parameters::get;
use std::vec::Vec;

/// A drive that follows its set velocity with a first-order lag, or slow and fast signals with two
/// velocities, and an encoder that counts whole units.
pub(super) struct Rig {
    values: Values,
    pub(super) axis: Axis,
    pub(super) input: AxisInput,
    /// All actual value inputs.
    pub(super) inputs: [ActualValue; 6],
    pub(super) output: AxisOutput,
    /// Time constant of the drive, s; 0 = follows at once.
    lag: f64,
    /// The drive's velocity is that much of what it is told.
    gain: f64,
    position: f64,
    velocity: f64,
    /// Velocities of slow and fast, units/s.
    signals: (f64, f64),
    pub(super) ms: u32,
    /// How orders ended or were refused, and when, ms.
    pub(super) ended: Vec<(u32, Progress)>,
    failures: Vec<Failure>,
}

/// Something that works: V max. 10,000, 0.5 s to it and back, KSP 20.
const CONTROL: [(u16, i32); 6] = [(600, 1), (642, 10_000), (648, 200), (654, 500), (708, 5), (714, 5)];

pub(super) fn rig(changes: &[(u16, i32)]) -> Rig {
    let mut values = Values::factory();
    for &(index, value) in CONTROL.iter().chain(changes) {
        values.set(index, value).unwrap();
    }
    let mut axis = Axis::default();
    axis.configure(&values, 0, 1);
    let mut rig = Rig {
        values,
        axis,
        input: AxisInput {
            actual: ActualValue { reading: Reading::Real, ..ActualValue::default() },
            digital: DigitalInputs::default(),
            power: true,
            held: false,
            reset: false,
            order: None,
            stop: None,
            failure: None,
        },
        inputs: [ActualValue::default(); 6],
        output: AxisOutput::default(),
        lag: 0.0,
        gain: 1.0,
        position: 0.0,
        velocity: 0.0,
        signals: (500.0, 2_000.0),
        ms: 0,
        ended: Vec::new(),
        failures: Vec::new(),
    };
    rig.cycle();
    rig
}

impl Rig {
    /// One cycle of 1 ms: the axis, then its plant.
    pub(super) fn cycle(&mut self) -> AxisOutput {
        let before = self.input.actual.position;
        self.input.actual.position = self.position.round() as i64 as i32;
        self.input.actual.velocity = self.input.actual.position.wrapping_sub(before) * 1000;
        self.output = self.axis.cycle(&self.input, &self.inputs);
        self.input.order = None;
        self.input.reset = false;
        self.input.stop = None;
        self.input.failure = None;
        self.input.actual.failure = None;
        self.input.actual.calibrated = false;
        self.input.actual.shift = 0;
        let signals = self.output.command.signals;
        let direction = f64::from(i8::from(signals.forward) - i8::from(signals.backward));
        let steps = if signals.fast {
            self.signals.1
        } else if signals.slow {
            self.signals.0
        } else {
            0.0
        };
        let told = self.output.command.velocity * self.gain + direction * steps;
        let told = if self.output.command.enable { told } else { 0.0 };
        let share = if self.lag > 0.0 { 0.001 / self.lag } else { 1.0 };
        self.velocity += (told - self.velocity) * share.min(1.0);
        self.position += self.velocity * 0.001;
        self.ms += 1;
        if let Some(error) = self.output.refused {
            self.ended.push((self.ms, Progress::Failed(error)));
        }
        if let Some(progress) = self.output.ended {
            self.ended.push((self.ms, progress));
        }
        self.failures.extend(self.output.failure);
        self.output
    }

    pub(super) fn run(&mut self, ms: u32) -> AxisOutput {
        for _ in 0..ms {
            self.cycle();
        }
        self.output
    }

    /// Cycles until the condition holds; the ms it took.
    pub(super) fn until(&mut self, what: &str, mut holds: impl FnMut(&Self) -> bool) -> u32 {
        let start = self.ms;
        while !holds(self) {
            self.cycle();
            assert!(self.ms - start < 60_000, "never {what}: {:?}", self.output);
        }
        self.ms - start
    }

    pub(super) fn order(&mut self, order: Order) -> AxisOutput {
        self.input.order = Some(order);
        self.cycle()
    }

    pub(super) fn go(&mut self, position: i32) -> AxisOutput {
        self.order(Order::MoveAbsolute { position, velocity: None })
    }

    /// Moves to a position; the ms that it takes.
    pub(super) fn arrive(&mut self, position: i32) -> u32 {
        let before = self.ended.len();
        self.go(position);
        1 + self.until("arrived", |rig| rig.ended.len() > before)
    }

    pub(super) fn set(&mut self, index: u16, value: i32) {
        self.values.set(index, value).unwrap();
        self.axis.configure(&self.values, 0, 1);
    }

    /// Greatest set velocity and set acceleration (units/s²) until the order ends.
    pub(super) fn extremes(&mut self) -> (f64, f64, f64) {
        let before = self.ended.len();
        let (mut v, mut up, mut down) = (0.0_f64, 0.0_f64, 0.0_f64);
        let mut last = self.output.status.nominal_velocity;
        while self.ended.len() == before {
            let now = self.cycle().status.nominal_velocity;
            let change = (now.abs() - last.abs()) * 1000.0;
            (v, up, down) = (v.max(now.abs()), up.max(change), down.max(-change));
            last = now;
        }
        (v, up, down)
    }

    pub(super) fn last_end(&self) -> Option<Progress> {
        self.ended.last().map(|(_, progress)| *progress)
    }
}

pub(super) fn near(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() <= relative * b.abs()
}

/// Every parameter of an axis has its test, here or where the cycle routes inputs and outputs.
#[test]
fn every_parameter_of_an_axis_has_a_test() {
    let sources = [
        include_str!("calibration.rs"),
        include_str!("control.rs"),
        include_str!("failures.rs"),
        include_str!("limits.rs"),
        include_str!("ramps.rs"),
        include_str!("signals.rs"),
        include_str!("../../control/tests.rs"),
    ];
    for first in (600..972).filter(|index| get(*index).is_some_and(|entry| entry.instance() == 0)) {
        let name = std::format!("fn parameter_{first}_");
        assert!(sources.iter().any(|source| source.contains(&name)), "no test for [{first}]");
    }
}

/// Values of another axis' instance are its own.
#[test]
fn an_axis_reads_its_own_instance() {
    let mut values = Values::factory();
    for (index, value) in [(603, 2), (645, 7_000), (657, 700)] {
        values.set(index, value).unwrap();
    }
    let settings = Settings::read(&values, 3);
    assert_eq!((settings.mode, settings.maximum), (Mode::Signals, 7_000.0));
    assert_eq!(settings.limits.unwrap().acceleration(), 10_000.0);
}

#[test]
fn state_is_at_most_a_kibibyte() {
    assert!(size_of::<Axis>() <= 1024, "{}", size_of::<Axis>());
}
