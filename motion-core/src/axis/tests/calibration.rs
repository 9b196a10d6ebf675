//! Automatic calibration: V1 to the turning point, V2 back to the reference point.

use super::*;
use crate::failure::{HW_LIMIT_MINUS, HW_LIMIT_PLUS};

/// Turning points at ±3,000 on I2.0 and I2.1, the reference point at 1,000.
fn with(changes: &[(u16, i32)]) -> Rig {
    let base = [(792, 4_000), (798, 500), (948, 2), (954, 6), (960, 2), (966, 7)];
    rig(&[&base[..], changes].concat())
}

fn cycle(rig: &mut Rig) {
    let (upper, lower) = (Terminal::new(2, 0).unwrap(), Terminal::new(2, 1).unwrap());
    rig.input.digital.set(upper, rig.position >= 3_000.0);
    rig.input.digital.set(lower, rig.position <= -3_000.0);
    let before = rig.input.actual.position;
    let now = rig.position.round() as i32;
    let passed = before < 1_000 && now >= 1_000 || before > 1_000 && now <= 1_000;
    rig.input.actual.calibrated = passed && rig.output.armed;
    rig.cycle();
}

/// Fastest velocities before and after the turn, and how it ended.
fn calibrate(rig: &mut Rig) -> (f64, f64, Option<Progress>) {
    let (mut first, mut second) = (0.0_f64, 0.0_f64);
    rig.order(Order::Home);
    let start = rig.ms;
    while rig.ended.is_empty() && rig.ms - start < 30_000 {
        cycle(rig);
        let velocity = rig.output.status.nominal_velocity;
        if rig.output.armed {
            // Braking from V1 comes first.
            if rig.axis.generator.arrived() {
                second = velocity;
            }
        } else if velocity.abs() > first.abs() && second == 0.0 {
            first = velocity;
        }
    }
    (first, second, rig.last_end())
}

#[test]
fn parameter_792_is_the_velocity_to_the_turning_point() {
    for velocity in [1_000, 4_000] {
        assert_eq!(calibrate(&mut with(&[(804, 1), (792, velocity)])).0, -f64::from(velocity));
    }
    assert_eq!(
        calibrate(&mut with(&[(804, 1), (792, 0)])).2,
        Some(Progress::Failed(MotionError::NOT_CONFIGURED))
    );
}

#[test]
fn parameter_798_is_the_velocity_to_the_reference_point() {
    for velocity in [300, 900] {
        assert_eq!(calibrate(&mut with(&[(804, 1), (798, velocity)])).1, f64::from(velocity));
    }
    assert_eq!(
        calibrate(&mut with(&[(804, 1), (798, 0)])).2,
        Some(Progress::Failed(MotionError::NOT_CONFIGURED))
    );
}

#[test]
fn parameter_804_is_the_direction_of_the_calibration() {
    assert_eq!(calibrate(&mut with(&[(804, 0)])).2, Some(Progress::Failed(MotionError::NOT_CONFIGURED)));
    for (choice, sign) in [(1, 1.0), (2, -1.0)] {
        let mut rig = with(&[(804, choice)]);
        let done = calibrate(&mut rig);
        assert_eq!(done, (-4_000.0 * sign, 500.0 * sign, Some(Progress::Done)));
        assert!(rig.output.status.homed && rig.failures.is_empty());
        assert_eq!(rig.output.status.state, State::Standstill);
    }
}

/// `[810]`: with feedback, or with a fixed voltage.
#[test]
fn parameter_810_controls_the_calibration() {
    let velocity = |choice| {
        let mut rig = with(&[(804, 1), (810, choice)]);
        rig.gain = 0.9;
        rig.order(Order::Home);
        rig.run(600).command.velocity
    };
    assert_eq!(velocity(0), -4_000.0);
    assert!(velocity(1) < -4_200.0);
}

/// Software limits do not affect it, the switch on the other side does.
#[test]
fn limits_while_calibrating() {
    let soft = [(804, 1), (936, 1), (942, -500), (924, 1), (930, 500)];
    assert_eq!(calibrate(&mut with(&soft)).2, Some(Progress::Done));
    let mut rig = with(&[(804, 1)]);
    rig.order(Order::Home);
    while !rig.output.armed {
        cycle(&mut rig);
    }
    // The reference signal never comes.
    while rig.ended.is_empty() {
        let armed = rig.output.armed;
        rig.output.armed = false;
        cycle(&mut rig);
        assert!(armed || !rig.ended.is_empty());
    }
    assert_eq!(rig.failures, [HW_LIMIT_PLUS]);
    let mut rig = with(&[(804, 2)]);
    rig.order(Order::Home);
    while rig.ended.is_empty() {
        rig.output.armed = false;
        cycle(&mut rig);
    }
    assert_eq!(rig.failures, [HW_LIMIT_MINUS]);
}

/// On the turning point already: with V2 at once; without one too.
#[test]
fn a_start_on_the_turning_point() {
    let mut rig = with(&[(804, 1)]);
    rig.position = -3_100.0;
    cycle(&mut rig);
    rig.run(1);
    let (first, second, end) = calibrate(&mut rig);
    assert_eq!((first, second, end), (0.0, 500.0, Some(Progress::Done)));
    let (first, second, end) = calibrate(&mut with(&[(804, 1), (960, 0)]));
    assert_eq!((first, second, end), (0.0, 500.0, Some(Progress::Done)));
}

/// By signals: slow only.
#[test]
fn by_signals_without_fast() {
    let mut rig = with(&[(600, 2), (804, 1), (858, 1), (864, 1)]);
    rig.order(Order::Home);
    let mut turned = false;
    while rig.ended.is_empty() {
        cycle(&mut rig);
        assert!(!rig.output.command.signals.fast);
        turned |= rig.output.command.signals.forward;
    }
    assert!(turned && rig.last_end() == Some(Progress::Done));
}
