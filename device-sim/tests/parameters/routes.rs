//! Mode, actual value input and nominal value output of an axis, 6.8.1.

use device_sim::plant::{Connection, Drive, Incremental, Plant, Sensor, Stepper, TwoSpeed, Wiring};
use motion_core::application::{MotionError, Order, Progress};

use super::bench::{Bench, CONTROL, Effect, FAST, Family, RAMPS, SIGNALS, SLOW, V_MAX};

/// `[600]`: what a drive on the analog output and a motor behind contactors make of each mode. None takes
/// no orders; Control brakes late and hard, Ramps early, Signals moves the contactors only.
#[test]
fn parameter_600_is_the_controlling_mode() {
    let cases = [(0, 0.0), (1, 1.0), (2, 2.0), (3, 3.0)];
    for (mode, left) in [(CONTROL, 1.0), (SIGNALS, 2.0), (RAMPS, 3.0)] {
        let base = &[(546, 3)];
        let effect = |cases| Effect {
            family: Family::Axes,
            modes: core::slice::from_ref(match mode {
                CONTROL => &CONTROL,
                SIGNALS => &SIGNALS,
                _ => &RAMPS,
            }),
            parameter: 600,
            base,
            left,
            cases,
            tolerance: 0.0,
        };
        // The output's type is that of the mode at the start: the other ones do not move it.
        let fits = |&(value, seen): &(i32, f64)| {
            let moves = value == mode || value != 0 && mode != SIGNALS && value != SIGNALS;
            (
                value,
                if value == 0 {
                    0.0
                } else if moves {
                    seen
                } else {
                    -1.0
                },
            )
        };
        let cases: Vec<_> = cases.iter().map(fits).collect();
        effect(&cases).shows(kind_of_motion);
    }
}

/// 0 = refused, −1 = does not move, else the mode that it moves like.
fn kind_of_motion(bench: &mut Bench) -> f64 {
    let axis = bench.route.axis;
    let ticket =
        bench.controller.axis(axis).unwrap().order(Order::MoveAbsolute { position: 6_000, velocity: None });
    bench.run(12);
    let Ok(ticket) = ticket else {
        assert_eq!(bench.controller.axis(axis).unwrap().set_power(true), Err(MotionError::NO_AXIS));
        return 0.0;
    };
    if bench.controller.axis(axis).unwrap().progress(ticket) == Progress::Failed(MotionError::NOT_CONFIGURED)
    {
        return 0.0;
    }
    bench.until(|bench| bench.real() >= 5_000.0 || bench.now_ms() > 5_000);
    match bench.speed() {
        0.0 => -1.0,
        speed if (speed - FAST).abs() < 1.0 || (speed - SLOW).abs() < 1.0 => 2.0,
        // 20,000 a second² and 1,000 to go; the ramp's second point is there.
        speed if (speed - 6_325.0).abs() < 250.0 => 1.0,
        speed if (speed - 2_000.0).abs() < 150.0 => 3.0,
        speed => panic!("{speed}"),
    }
}

/// `[606]`: what the axis takes for its position, with a drive that is 10 % slow. None takes no orders,
/// input 1 is that of the plant, at input 2 nothing turns, Virtual is its own set value.
#[test]
fn parameter_606_is_the_actual_value() {
    let cases = [(0, 0.0), (1, 2_000.0), (8, 1_800.0)];
    let effect = Effect {
        family: Family::Axes,
        modes: &[CONTROL],
        parameter: 606,
        base: &[],
        left: 2_000.0,
        cases: &cases,
        tolerance: 4.0,
    };
    let observe = |bench: &mut Bench| {
        bench.set_drive(Drive::first_order(9_000.0, 0.005));
        bench.order(Order::MoveAbsolute { position: 2_000, velocity: None });
        bench.run(2_000);
        bench.real()
    };
    effect.shows(observe);
    // Without the plant's position the set value is passed.
    for choice in 2..=3 {
        effect.each(&[(606, choice)], |bench| assert!(observe(bench) > 5_000.0));
    }
    // A stepper motor's clock is followed to the pulse.
    let base = [(606, 7), (450, 4), (540, 10_000), (546, 3), (534, 0)];
    effect.each(&base, |bench| {
        bench.machine.axes[0].connection = Connection::Clock { block: 0 };
        bench.machine.axes[0].sensor = None;
        // Each cycle is a step of 120 Hz.
        let mut motor = Stepper::new(1.0);
        motor.acceleration = 200_000.0;
        bench.set_drive(Drive::Stepper(motor));
        for position in [3_000, -500] {
            bench.order(Order::MoveAbsolute { position, velocity: None });
            bench.run(2_000);
            assert_eq!((bench.real(), bench.status().position), (f64::from(position), position));
        }
    });
}

/// `[612]`: of four outputs the plant of one moves; with None the set values are there all the same.
#[test]
fn parameter_612_is_the_output() {
    let cases = [(0, 0.0), (1, 1.0), (2, 2.0), (3, 3.0), (4, 0.0)];
    let effect = Effect {
        family: Family::Axes,
        modes: &[CONTROL, RAMPS],
        parameter: 612,
        base: &[],
        left: 1.0,
        cases: &cases,
        tolerance: 0.0,
    };
    effect.shows(|bench| {
        let plant = |block| {
            let sensor = Sensor::Incremental(Incremental::new(1.0, 0, 0));
            let connection = Connection::Analog { block, unipolar: false };
            Wiring::new(Plant::new(Drive::first_order(V_MAX, 0.005)), connection, sensor)
        };
        bench.machine.axes.extend([plant(1), plant(2)]);
        bench.jog(true, false);
        bench.run(500);
        assert!((bench.status().nominal_velocity - 1_000.0).abs() < 1e-9);
        let moved: Vec<_> = (0..3).filter(|at| bench.machine.axes[*at].plant.velocity() > 900.0).collect();
        assert!(moved.len() <= 1);
        moved.first().map_or(0.0, |at| *at as f64 + 1.0)
    });
    // By signals alike.
    let effect = Effect { modes: &[SIGNALS], cases: &cases[..2], ..effect };
    effect.shows(|bench| {
        bench.set_drive(Drive::TwoSpeed(TwoSpeed::new(SLOW, FAST, 20_000.0)));
        f64::from(u8::from(bench.jog_speed(true, false) > 900.0))
    });
}
