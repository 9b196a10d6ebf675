//! Feedback, following error and position control at rest: 6.8.1.1, mode Control.

use device_sim::plant::Drive;
use lb2::code::Failure;
use motion_core::application::{Order, State};

use super::bench::{Bench, CONTROL, Effect, Family, RAMPS};

fn effect<'a>(parameter: u16, left: f64, cases: &'a [(i32, f64)], tolerance: f64) -> Effect<'a> {
    Effect { family: Family::Axes, modes: &[CONTROL], parameter, base: &[], left, cases, tolerance }
}

/// `[648]`: KSP; with it a drive that is 2 % slower than told arrives, without it (0.0) it does not. In
/// steady motion the deviation is what the drive lacks divided by KSP.
#[test]
fn parameter_648_is_the_feedback_factor() {
    effect(648, 1_000.0, &[(0, 980.0), (100, 1_000.0)], 2.0).shows(|bench| {
        bench.set_drive(Drive::first_order(9_800.0, 0.005));
        bench.order(Order::MoveAbsolute { position: 1_000, velocity: None });
        bench.run(3_000);
        bench.real()
    });
    // 20 % of 5000 a second are missing: KSP · Δs makes up for v/0.8 − v.
    let cases = [(100, 125.0), (400, 31.25)];
    effect(648, 62.5, &cases, 8.0).shows(|bench| {
        bench.set_drive(Drive::first_order(8_000.0, 0.005));
        bench.order(Order::MoveVelocity { velocity: 5_000 });
        bench.run(3_000);
        f64::from(bench.status().deviation)
    });
}

/// An axis that is stuck: the deviation at which it is stopped, 0 if it is not.
fn stuck(bench: &mut Bench, velocity: i32, failure: Failure) -> f64 {
    bench.set_drive(Drive::first_order(0.0, 0.005));
    bench.order(Order::MoveVelocity { velocity });
    if bench.until(|bench| bench.status().state == State::ErrorStop) < 0.0 {
        assert_eq!(bench.failures(), []);
        return 0.0;
    }
    assert_eq!(bench.failures(), [failure]);
    f64::from(bench.status().deviation)
}

/// `[696]`: the deviation forward that stops the axis; 0 = none.
#[test]
fn parameter_696_is_the_greatest_deviation() {
    let cases = [(500, 500.0), (2_000, 2_000.0), (0, 0.0)];
    effect(696, 0.0, &cases, 6.0).shows(|bench| stuck(bench, 1_000, Failure::DELTA_S_MAX));
}

/// `[702]`: the deviation backward.
#[test]
fn parameter_702_is_the_least_deviation() {
    let cases = [(500, -500.0), (2_000, -2_000.0), (0, 0.0)];
    effect(702, 0.0, &cases, 6.0).shows(|bench| stuck(bench, -1_000, Failure::DELTA_S_MIN));
}

/// `[732]`: after a stop, a push is taken back, or not.
#[test]
fn parameter_732_controls_the_position_in_stop() {
    effect(732, 50.0, &[(0, 50.0), (1, 0.0)], 1.5).shows(|bench| {
        bench.order(Order::Halt);
        bench.run(12);
        bench.push(50.0);
        bench.run(1_000);
        bench.real()
    });
}

/// `[738]`: at the nominal position, a push is taken back, or not.
#[test]
fn parameter_738_controls_the_nominal_position() {
    Effect { modes: &[CONTROL, RAMPS], ..effect(738, 1_000.0, &[(0, 1_200.0), (1, 1_000.0)], 21.0) }.shows(
        |bench| {
            bench.go(1_000);
            bench.push(1_200.0);
            bench.run(3_000);
            bench.real()
        },
    );
}
