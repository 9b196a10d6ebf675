//! Automatic calibration, 6.8.1.1: turning points at ±3,000 on I2.0 and I2.1, the reference mark at 1,000.

use device_sim::plant::{Drive, Switch};
use motion_core::application::{MotionError, Order, Progress};
use motion_core::io::Terminal;

use super::bench::{Bench, CONTROL, Effect, Family, RAMPS, SIGNALS};

const DRIVEN: [i32; 2] = [CONTROL, RAMPS];
/// Forward, on the mark of E1; both switches high when operated.
const FORWARD: [(u16, i32); 6] = [(804, 1), (948, 2), (960, 2), (226, 3), (233, 2), (240, 1)];

fn effect<'a>(parameter: u16, left: f64, cases: &'a [(i32, f64)], tolerance: f64) -> Effect<'a> {
    Effect { family: Family::Axes, modes: &DRIVEN, parameter, base: &FORWARD, left, cases, tolerance }
}

/// Greatest velocities backward and forward until it has ended, and how.
fn calibrate(bench: &mut Bench) -> (f64, f64, Progress) {
    for (bit, position, upper) in [(0, 3_000.0, true), (1, -3_000.0, false)] {
        bench.add_switch(Switch::limit(Terminal::new(2, bit).unwrap(), position, upper));
    }
    let axis = bench.route.axis;
    let ticket = bench.controller.axis(axis).unwrap().order(Order::Home).unwrap();
    let (mut least, mut most) = (0.0_f64, 0.0_f64);
    let mut progress = Progress::Waiting;
    for _ in 0..3_000 {
        bench.cycle();
        (least, most) = (least.min(bench.speed()), most.max(bench.speed()));
        progress = bench.controller.axis(axis).unwrap().progress(ticket);
        if !matches!(progress, Progress::Waiting | Progress::Active) {
            break;
        }
    }
    if progress == Progress::Done {
        // The mark is four edges long: downward it begins at its last one, which is the calibration value.
        let mark = if most > -least { 1_003 } else { 1_000 };
        bench.run(500);
        assert!(bench.status().homed && bench.failures().is_empty());
        assert_eq!(bench.status().position, bench.real().floor() as i32 - mark);
    }
    (least, most, progress)
}

/// `[792]`: V1; without one there is no calibration.
#[test]
fn parameter_792_is_the_velocity_to_the_turning_point() {
    let cases = [(1_000, -1_000.0), (3_000, -3_000.0), (0, 0.0)];
    effect(792, -4_000.0, &cases, 4.0).shows(|bench| calibrate(bench).0);
}

/// `[798]`: V2; without one there is no calibration.
#[test]
fn parameter_798_is_the_velocity_to_the_reference_point() {
    let cases = [(300, 300.0), (900, 900.0), (0, 0.0)];
    effect(798, 500.0, &cases, 4.0).shows(|bench| calibrate(bench).1);
}

/// `[804]`: the direction of the first way: the reference value is set in the other one.
#[test]
fn parameter_804_is_the_direction_of_the_calibration() {
    let observe = |bench: &mut Bench| {
        let (least, most, progress) = calibrate(bench);
        match progress {
            Progress::Done => (least + most).signum(),
            other => {
                assert_eq!(other, Progress::Failed(MotionError::NOT_CONFIGURED));
                assert_eq!(bench.real(), 0.0);
                0.0
            }
        }
    };
    let base = &FORWARD[1..];
    Effect { base, ..effect(804, 0.0, &[(0, 0.0), (1, -1.0), (2, 1.0)], 0.0) }.shows(observe);
    // By signals there is one speed; the way it goes first is backward for `Forward`.
    let first = |bench: &mut Bench| {
        bench.order(Order::Home);
        bench.run(300);
        bench.speed().signum() * f64::from(u8::from(bench.speed() != 0.0))
    };
    let cases = [(0, 0.0), (1, -1.0), (2, 1.0)];
    Effect { modes: &[SIGNALS], base, ..effect(804, 0.0, &cases, 0.0) }.shows(first);
}

/// `[810]`: with a fixed voltage a drive that is 10 % slow stays so, with feedback it does not.
#[test]
fn parameter_810_controls_the_calibration() {
    let cases = [(0, 450.0), (1, 500.0)];
    Effect { modes: &[CONTROL], ..effect(810, 450.0, &cases, 4.0) }.shows(|bench| {
        bench.set_drive(Drive::first_order(9_000.0, 0.005));
        bench.order(Order::Home);
        // No switch is there to turn at: it is put on by hand.
        bench.inputs.digital.set(Terminal::new(2, 1).unwrap(), true);
        bench.machine.inputs.digital.set(Terminal::new(2, 1).unwrap(), true);
        bench.run(1_000);
        bench.speed()
    });
}
