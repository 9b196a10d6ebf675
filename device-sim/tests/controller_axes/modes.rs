//! Failures, limits and the application's stop in every mode, whatever the axis is doing: one axis on the
//! terminals with an encoder, behind an analog drive (Control, Ramps) or contactors (Signals).

use core::time::Duration;

use device_sim::can::Faults;
use device_sim::plant::{Connection, Drive, Incremental, Plant, Sensor, TwoSpeed, Wiring};
use lb2::code::Failure;
use lb2::device::Device;
use motion_core::application::{MotionError, Order, Progress, State, Ticket};
use motion_core::failure::{
    ACTUAL_VALUE_JUMP, HW_LIMIT_MINUS, HW_LIMIT_PLUS, READING_LOST, SW_LIMIT_MINUS, SW_LIMIT_PLUS,
};
use motion_core::io::Terminal;

use super::rig::Rig;

const MS: Duration = Duration::from_millis(1);

/// `[600]`.
const CONTROL: i32 = 1;
const SIGNALS: i32 = 2;
const RAMPS: i32 = 3;
const MODES: [i32; 3] = [CONTROL, SIGNALS, RAMPS];

/// 10 V, or V max.
const V_MAX: f64 = 10_000.0;
/// I2.0 and I2.1, high when operated: choices 6 and 7 of `[954]`, `[966]`.
const UPPER: (u8, u8) = (2, 0);
const LOWER: (u8, u8) = (2, 1);

/// What the axis is doing when it happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Doing {
    Jog,
    Position,
    /// Calibrating, on the way to the turning point: backward.
    Turning,
    /// Calibrating, on the way to the reference point.
    Referencing,
}

const ALL: [Doing; 4] = [Doing::Jog, Doing::Position, Doing::Turning, Doing::Referencing];

/// An axis of one mode, enabled; forward is towards greater values in every [`Doing`] but `Turning`, and
/// the other way round where `backward`.
struct Bench {
    rig: Rig,
    mode: i32,
    backward: bool,
}

impl Bench {
    fn new(mode: i32, backward: bool, more: &[(u16, i32)]) -> Self {
        let signals = mode == SIGNALS;
        let changes = [
            (600, mode),
            (100, 0),
            (450, if signals { 3 } else { 1 }),
            (546, if signals { 3 } else { 0 }),
            (528, 2),
            (642, 10_000),
            (684, 8_000),
            (708, 40),
            (714, 40),
            (756, 1_000),
            (762, 5_000),
            (768, 1_000),
            (774, 5_000),
            (786, 1),
            (792, 4_000),
            (798, 2_000),
            (804, if backward { 2 } else { 1 }),
            (810, 1),
            (816, 0),
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
            (948, 2),
            (954, 6),
            (960, 2),
            (966, 7),
        ];
        // Nobody is looked for on the buses.
        let silent: Vec<_> = (326..=333).chain(358..=365).map(|object| (object, 0)).collect();
        let mut rig = Rig::new(&[&silent[..], &changes, more].concat(), Faults::NONE);
        let (drive, connection) = if signals {
            (Drive::TwoSpeed(TwoSpeed::new(1_000.0, 5_000.0, 20_000.0)), Connection::Signals { block: 0 })
        } else {
            (Drive::first_order(V_MAX, 0.005), Connection::Analog { block: 0, unipolar: false })
        };
        let sensor = Sensor::Incremental(Incremental::new(1.0, i64::MAX - 8, 0));
        rig.machine.axes = vec![Wiring::new(Plant::new(drive), connection, sensor)];
        rig.set_power(true);
        rig.run(30 * MS);
        Self { rig, mode, backward }
    }

    fn switch(&mut self, (block, bit): (u8, u8), operated: bool) {
        self.rig.inputs.digital.set(Terminal::new(block, bit).unwrap(), operated);
    }

    /// The limit switch at which it turns, and the one beyond the reference point.
    const fn switches(&self) -> ((u8, u8), (u8, u8)) {
        if self.backward { (UPPER, LOWER) } else { (LOWER, UPPER) }
    }

    const fn sign(&self) -> i32 {
        if self.backward { -1 } else { 1 }
    }

    /// Begins, and goes on until it is well under way.
    fn begin(&mut self, doing: Doing) -> Ticket {
        let order = match doing {
            Doing::Jog => Order::Jog { forward: !self.backward, fast: true },
            Doing::Position => Order::MoveAbsolute { position: self.sign() * 30_000, velocity: None },
            Doing::Turning | Doing::Referencing => Order::Home,
        };
        let ticket = self.rig.order(0, order);
        self.rig.run(600 * MS);
        if doing == Doing::Referencing {
            let (turning, _) = self.switches();
            self.switch(turning, true);
            self.rig.cycle();
            self.switch(turning, false);
            self.rig.run(2_000 * MS);
        }
        assert_eq!(self.rig.failures(), []);
        let direction = if doing == Doing::Turning { -self.sign() } else { self.sign() };
        assert!(self.velocity() * f64::from(direction) > 900.0, "{doing:?}: {}", self.velocity());
        ticket
    }

    fn velocity(&self) -> f64 {
        self.rig.machine.axes[0].plant.velocity()
    }

    /// What drives it: mV, or 1000 a signal.
    fn driven(&self) -> i32 {
        if self.mode == SIGNALS {
            // Slow and fast are bits 3 and 4.
            (self.rig.outputs.digital[0] >> 3).count_ones() as i32 * 1_000
        } else {
            i32::from(self.rig.outputs.analog[0])
        }
    }

    /// The next cycle, which must brake: what drives it is less than in the cycle before, none by signals.
    fn brakes(&mut self) {
        let before = self.driven();
        self.rig.cycle();
        let after = self.driven();
        if self.mode == SIGNALS {
            assert_eq!((before != 0, after), (true, 0));
        } else {
            assert!(after.abs() < before.abs() && after.signum() == before.signum(), "{before} {after} mV");
        }
    }

    fn broken(&mut self, broken: bool) {
        self.rig.machine.axes[0].sensor.as_mut().unwrap().1.set_broken(broken);
        // What the next cycle reads.
        self.rig.inputs.encoders[0].fault = broken;
    }

    /// The cycle that comes sees a failure: it stops the axis and stores the failure.
    fn fails(&mut self, ticket: Ticket, failure: Failure) {
        self.brakes();
        self.rig.assert_failed(0, failure);
        assert_eq!(self.rig.failures(), [(1, failure)]);
        assert_eq!(self.rig.progress(0, ticket), Progress::Failed(MotionError::from_failure(failure)));
        self.rig.run(1_000 * MS);
        assert_eq!((self.velocity().abs() < 1.0, self.driven()), (true, 0));
        assert_eq!(self.rig.status(0).state, State::ErrorStop);
    }

    /// Reset, and to a place where it has not been.
    fn works_again(&mut self) {
        self.rig.reset(0);
        self.rig.cycle();
        assert_eq!(
            (self.rig.status(0).state, self.rig.status(0).error),
            (State::Standstill, MotionError::NONE)
        );
        let position = self.rig.status(0).position - self.sign() * 1_500;
        self.rig.arrive(0, position, 5_000);
        assert_eq!(self.rig.failures().len(), 1);
    }
}

/// Every mode, everything that an axis may be doing, both ways round.
fn each(more: &[(u16, i32)], doings: &[Doing], mut look: impl FnMut(&mut Bench, Ticket)) {
    for mode in MODES {
        for &doing in doings {
            for backward in [false, true] {
                println!("mode {mode}, {doing:?}, backward {backward}");
                let mut bench = Bench::new(mode, backward, more);
                let ticket = bench.begin(doing);
                look(&mut bench, ticket);
            }
        }
    }
}

#[test]
fn loss_of_the_encoder() {
    each(&[], &ALL, |bench, ticket| {
        bench.broken(true);
        bench.fails(ticket, READING_LOST);
        bench.rig.reset(0);
        bench.rig.cycle();
        assert_eq!(bench.rig.status(0).state, State::ErrorStop, "it is still broken");
        bench.broken(false);
        bench.rig.run(10 * MS);
        bench.works_again();
    });
}

/// `[184]` without failure tolerance.
#[test]
fn a_jump_of_the_actual_value() {
    each(&[(184, 200)], &ALL, |bench, ticket| {
        bench.rig.inputs.encoders[0].count += 5_000;
        // The machine counts on from where it is.
        let plant = &mut bench.rig.machine.axes[0].plant;
        *plant = plant.clone().at(plant.position() + 5_000.0);
        bench.fails(ticket, ACTUAL_VALUE_JUMP);
        bench.works_again();
    });
}

/// An axis that goes by another one's encoder (Virtual2, 6.6.1.5) stops with it, in the same cycle.
#[test]
fn what_fails_at_the_source_of_virtual2() {
    for mode in [CONTROL, RAMPS] {
        for (failure, more) in [(READING_LOST, (184, 0)), (ACTUAL_VALUE_JUMP, (184, 200))] {
            let follower =
                [(101, 4), (157, 0), (164, 1), (601, mode), (607, 2), (613, 2), (451, 1), (643, 10_000)];
            let mut bench = Bench::new(mode, false, &[&follower[..], &[more]].concat());
            let tickets = [0, 1].map(|axis| bench.rig.order(axis, Order::MoveVelocity { velocity: 5_000 }));
            bench.rig.run(600 * MS);
            if failure == READING_LOST {
                bench.broken(true);
            } else {
                bench.rig.inputs.encoders[0].count += 5_000;
            }
            let before = bench.rig.outputs.analog;
            bench.rig.cycle();
            for (axis, ticket) in tickets.into_iter().enumerate() {
                let status = bench.rig.status(axis);
                assert_eq!((status.state, status.error.failure()), (State::ErrorStop, Some(failure)));
                assert!(bench.rig.outputs.analog[axis] < before[axis], "axis {axis} brakes");
                assert_eq!(
                    bench.rig.progress(axis, ticket),
                    Progress::Failed(MotionError::from_failure(failure))
                );
            }
            assert_eq!(bench.rig.failures(), [(1, failure), (2, failure)]);
        }
    }
}

/// The switch in the way; the turning point is none on the way to it.
#[test]
fn a_hardware_limit_switch() {
    each(&[], &[Doing::Jog, Doing::Position, Doing::Referencing], |bench, ticket| {
        let (_, end) = bench.switches();
        let failure = if bench.backward { HW_LIMIT_MINUS } else { HW_LIMIT_PLUS };
        bench.switch(end, true);
        bench.fails(ticket, failure);
        let further = bench.rig.order(0, Order::Jog { forward: !bench.backward, fast: false });
        bench.rig.cycle();
        assert_eq!(bench.rig.progress(0, further), Progress::Failed(MotionError::from_failure(failure)));
        bench.switch(end, false);
        bench.works_again();
    });
}

#[test]
fn a_software_limit() {
    let limits = [(924, 1), (930, 10_000), (936, 1), (942, -10_000)];
    each(&limits, &[Doing::Jog, Doing::Position], |bench, ticket| {
        let failure = if bench.backward { SW_LIMIT_MINUS } else { SW_LIMIT_PLUS };
        // The cycle that is about to see the position, which is that of the encoder.
        while bench.rig.inputs.encoders[0].count.abs() <= 10_000 {
            bench.rig.cycle();
        }
        bench.fails(ticket, failure);
        let back = bench.rig.status(0).position - bench.sign() * 5_000;
        bench.rig.arrive(0, back, 5_000);
        assert_eq!((bench.rig.status(0).error, bench.rig.failures().len()), (MotionError::NONE, 1));
    });
}

/// An order to stop does not stay open in a failure: it says what the failure is.
#[test]
fn a_stop_on_a_limit_switch_ends() {
    for order in [Order::Stop, Order::Halt] {
        each(&[], &[Doing::Jog], |bench, ticket| {
            let (_, end) = bench.switches();
            let failure = if bench.backward { HW_LIMIT_MINUS } else { HW_LIMIT_PLUS };
            bench.switch(end, true);
            bench.fails(ticket, failure);
            let stop = bench.rig.order(0, order);
            bench.rig.run(100 * MS);
            assert_eq!(bench.rig.progress(0, stop), Progress::Failed(MotionError::from_failure(failure)));
        });
    }
}

/// An encoder that has failed before the axis is enabled, or enabled anew: it does not move blindly.
#[test]
fn an_axis_is_not_enabled_on_a_broken_encoder() {
    for mode in MODES {
        let mut bench = Bench::new(mode, false, &[]);
        bench.rig.set_power(false);
        bench.rig.run(12 * MS);
        bench.broken(true);
        bench.rig.run(12 * MS);
        assert_eq!(
            (bench.rig.failures(), bench.rig.status(0).state),
            (vec![(1, READING_LOST)], State::Disabled)
        );
        for _ in 0..2 {
            bench.rig.set_power(true);
            bench.rig.run(12 * MS);
            let error = MotionError::from_failure(READING_LOST);
            assert_eq!((bench.rig.status(0).state, bench.rig.status(0).error), (State::ErrorStop, error));
            assert!(
                bench
                    .rig
                    .controller
                    .axis(0)
                    .unwrap()
                    .order(Order::Jog { forward: true, fast: true })
                    .is_err()
            );
            bench.rig.run(200 * MS);
            assert_eq!((bench.velocity(), bench.driven()), (0.0, 0));
            bench.rig.set_power(false);
            bench.rig.run(12 * MS);
        }
        bench.broken(false);
        bench.rig.set_power(true);
        bench.rig.run(12 * MS);
        assert_eq!(bench.rig.status(0).state, State::Standstill);
        bench.rig.arrive(0, 2_000, 5_000);
        assert_eq!(bench.rig.failures().len(), 1);
    }
}

/// How the application is stopped.
#[derive(Debug, Clone, Copy)]
enum By {
    /// I3.7.
    Terminal,
    /// `[003]` = No.
    Parameter,
}

/// `[004]` in every mode and motion: No, Control, Regulate; the ms that the stop takes.
fn plc_stop(choice: i32, look: impl Fn(&mut Bench, Ticket)) {
    for by in [By::Terminal, By::Parameter] {
        each(&[(4, choice), (678, 2_000)], &ALL, |bench, ticket| {
            match by {
                By::Terminal => bench.rig.inputs.digital.set(Terminal::PLC_RUN, false),
                By::Parameter => {
                    assert!(!bench.rig.controller.write_parameter(3, 1).code.is_error());
                    assert_eq!(bench.rig.controller.call_loader(), -1);
                }
            }
            look(bench, ticket);
            assert!(!bench.rig.controller.is_running());
            assert_eq!(bench.rig.failures(), [], "a stop is no failure");
        });
    }
}

/// The axis goes on with what it does.
#[test]
fn plc_stop_no() {
    plc_stop(0, |bench, ticket| {
        let state = bench.rig.status(0).state;
        bench.rig.run(100 * MS);
        assert_eq!((bench.rig.status(0).state, bench.rig.progress(0, ticket)), (state, Progress::Active));
        assert!(bench.velocity().abs() > 900.0);
    });
}

/// Brakes in the same cycle from one velocity to the other, in ms.
fn stops(bench: &mut Bench, ticket: Ticket, deceleration: f64) {
    let velocity = bench.velocity().abs();
    bench.brakes();
    assert_eq!(bench.rig.progress(0, ticket), Progress::Aborted);
    let start = bench.rig.now();
    bench.rig.until("stopped", |rig| rig.status(0).state == State::Standstill);
    let took = (bench.rig.now() - start).as_secs_f64();
    // By signals it is the motor that takes its time, and dt run out.
    let expected = if bench.mode == SIGNALS { 0.03 } else { velocity / deceleration };
    assert!((took - expected).abs() < 0.03, "{took} s, {expected} expected");
    bench.rig.run(300 * MS);
    assert_eq!((bench.velocity().abs() < 1.0, bench.driven()), (true, 0));
}

/// As hard as can be: V max. in 500 ms.
#[test]
fn plc_stop_control() {
    plc_stop(1, |bench, ticket| stops(bench, ticket, 20_000.0));
}

/// As the axis is configured: V max. in 2000 ms.
#[test]
fn plc_stop_regulate() {
    plc_stop(2, |bench, ticket| stops(bench, ticket, 5_000.0));
}

/// A drive that sticks: failure 5 forward, 6 backward, by hand, positioning and calibrating; and an axis
/// that is pushed while it holds its position. Signals and Ramps have no tracking error (6.8.1.3).
#[test]
fn following_error() {
    let limits = [(696, 300), (702, 300)];
    each(&limits, &ALL, |bench, ticket| {
        let at = bench.rig.machine.axes[0].plant.position();
        let forward = bench.velocity() > 0.0;
        bench.rig.machine.axes[0].plant = Plant::new(Drive::first_order(1e-9, 0.005)).at(at);
        if bench.mode != CONTROL {
            bench.rig.run(500 * MS);
            assert_eq!((bench.rig.failures(), bench.rig.progress(0, ticket)), (vec![], Progress::Active));
            return;
        }
        let failure = if forward { Failure::DELTA_S_MAX } else { Failure::DELTA_S_MIN };
        loop {
            bench.rig.cycle();
            let status = bench.rig.status(0);
            // Told in whole units.
            let failed = status.state == State::ErrorStop;
            assert!((-300..=300).contains(&status.deviation) || failed, "{status:?}");
            if failed {
                assert!(status.deviation.abs() >= 300, "{status:?}");
                break;
            }
        }
        bench.rig.assert_failed(0, failure);
        assert_eq!(bench.rig.progress(0, ticket), Progress::Failed(MotionError::from_failure(failure)));
        assert_eq!(bench.rig.failures().len(), 1);
    });
    for (push, failure) in [(-400.0, Failure::DELTA_S_MAX), (400.0, Failure::DELTA_S_MIN)] {
        for stop in [false, true] {
            let mut bench = Bench::new(CONTROL, false, &[&limits[..], &[(732, 1)]].concat());
            if !stop {
                bench.rig.arrive(0, 1_000, 5_000);
                bench.rig.run(100 * MS);
            }
            let plant = &mut bench.rig.machine.axes[0].plant;
            *plant = Plant::new(Drive::first_order(1e-9, 0.005)).at(plant.position() + push);
            bench.rig.cycle();
            bench.rig.cycle();
            bench.rig.assert_failed(0, failure);
        }
    }
}

/// `[744]` delays every start, also the one after an arrival, a stop and a failure: at rest without position
/// control the brake is closed.
#[test]
fn the_brake_opens_before_every_start() {
    const OPEN: u128 = 200;
    for (mode, ksp) in [(CONTROL, 200), (CONTROL, 0), (SIGNALS, 200), (RAMPS, 200)] {
        // [738] where it has no effect, and switched off where it has.
        let hold = i32::from(mode == SIGNALS || ksp == 0);
        let mut bench = Bench::new(mode, false, &[(744, 20), (738, hold), (648, ksp)]);
        let starts = |bench: &mut Bench, order| {
            let ticket = bench.rig.order(0, order);
            let start = bench.rig.now();
            bench
                .rig
                .until("driven", |rig| rig.outputs.analog[0] != 0 || rig.outputs.digital[0] >> 3 & 0b11 != 0);
            let took = (bench.rig.now() - start).as_millis();
            assert!((OPEN..=OPEN + 12).contains(&took), "mode {mode}, KSP {ksp}: {order:?} after {took} ms");
            ticket
        };
        let to = |position| Order::MoveAbsolute { position, velocity: None };
        let jog = Order::Jog { forward: true, fast: false };
        for position in [3_000, -3_000] {
            let ticket = starts(&mut bench, to(position));
            bench.rig.until("done", |rig| rig.progress(0, ticket) == Progress::Done);
            bench.rig.run(18 * MS);
        }
        starts(&mut bench, jog);
        bench.rig.order(0, Order::Halt);
        bench.rig.run(300 * MS);
        starts(&mut bench, jog);
        bench.broken(true);
        bench.rig.run(600 * MS);
        bench.broken(false);
        bench.rig.cycle();
        bench.rig.reset(0);
        bench.rig.cycle();
        starts(&mut bench, to(0));
    }
}

#[test]
fn a_refused_order_leaves_the_move_under_way() {
    let mut rig = Rig::enabled(&[]);
    let first = rig.order(0, Order::MoveAbsolute { position: 200_000, velocity: None });
    rig.run(Duration::from_millis(300));
    let second = rig.order(0, Order::MoveAbsolute { position: 0, velocity: Some(9_999_999) });
    rig.run(Duration::from_millis(50));
    assert_eq!(rig.progress(0, second), Progress::Failed(MotionError::RANGE));
    assert_eq!(rig.progress(0, first), Progress::Active);
    rig.until("arrived", |rig| rig.progress(0, first) == Progress::Done);
    assert_eq!(rig.progress(0, second), Progress::Failed(MotionError::RANGE));
}
