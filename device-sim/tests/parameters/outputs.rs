//! Nominal value outputs 1…3 on their plants, 6.7. The drives of outputs 1…6 on the CAN buses are looked at
//! with six axes, in `controller_axes`.

use device_sim::plant::{Connection, Drive, Stepper};
use motion_core::application::Order;

use super::bench::{Bench, CONTROL, Effect, FAST, Family, RAMPS, SIGNALS, SLOW};

fn effect<'a>(parameter: u16, left: f64, cases: &'a [(i32, f64)], tolerance: f64) -> Effect<'a> {
    let modes = &[CONTROL, RAMPS];
    Effect { family: Family::Outputs, modes, parameter, base: &[], left, cases, tolerance }
}

/// `[450]`: of a drive on the voltage, a motor behind contactors and a stepper motor one moves.
#[test]
fn parameter_450_selects_what_is_put_out() {
    let cases = [(0, 0.0), (1, 1.0), (2, 0.0), (4, 4.0)];
    let base = [(540, 10_000)];
    Effect { base: &base, ..effect(450, 1.0, &cases, 0.0) }.shows(|bench| {
        let block = bench.route.output;
        let mut stepper = bench.machine.axes[0].clone();
        stepper.plant = device_sim::plant::Plant::new(stepper_motor());
        stepper.connection = Connection::Clock { block };
        stepper.sensor = None;
        bench.machine.axes.push(stepper);
        bench.jog(true, false);
        bench.run(500);
        let moves = |at: usize| bench.machine.axes[at].plant.velocity().abs() > 500.0;
        f64::from(u8::from(moves(0))) + 4.0 * f64::from(u8::from(moves(1)))
    });
    let cases = [(0, 0.0), (1, 0.0), (3, FAST), (4, 0.0)];
    Effect { modes: &[SIGNALS], ..effect(450, FAST, &cases, 1.0) }.shows(|bench| bench.jog_speed(true, true));
}

fn stepper_motor() -> Drive {
    let mut motor = Stepper::new(1.0);
    motor.acceleration = 200_000.0;
    Drive::Stepper(motor)
}

/// `[468]`: the sign of forward.
#[test]
fn parameter_468_is_the_direction() {
    effect(468, 1_000.0, &[(0, 1_000.0), (1, -1_000.0)], 4.0).shows(|bench| bench.jog_speed(true, false));
}

/// `[474]`: with one polarity only a drive without a direction signal goes forward.
#[test]
fn parameter_474_is_the_voltage_range() {
    effect(474, -2_000.0, &[(0, -2_000.0), (1, 2_000.0)], 4.0).shows(|bench| bench.jog_speed(false, false));
    // One with it on Qx.1 goes where it should, and both ways arrive.
    let base = [(474, 1), (546, 3)];
    Effect { base: &base, ..effect(474, 0.0, &[(0, 0.0)], 4.0) }.each(&[], |bench| {
        bench.machine.axes[0].connection = Connection::Analog { block: bench.route.output, unipolar: true };
        for position in [2_000, -1_000] {
            assert!(bench.go(position) > 0.0);
            bench.run(300);
            assert!((bench.real() - f64::from(position)).abs() < 21.0);
        }
    });
}

/// `[480]`: the voltage that V max. stands for.
#[test]
fn parameter_480_is_the_voltage_at_v_max() {
    effect(480, 1_000.0, &[(5_000, 500.0), (8_000, 800.0)], 4.0).shows(|bench| bench.jog_speed(true, false));
}

/// `[504]`: where forward begins: 1 V and a tenth of the 9 V above it.
#[test]
fn parameter_504_is_the_least_positive_voltage() {
    let cases = [(1_000, 1_900.0), (500, 1_450.0)];
    effect(504, 1_000.0, &cases, 4.0).shows(|bench| bench.jog_speed(true, false));
    effect(504, 1_000.0, &cases, 4.0).each(&[(504, 1_000), (768, 1_000)], |bench| {
        assert!((bench.jog_speed(false, false) + 1_000.0).abs() < 4.0, "backward as before");
    });
}

/// `[510]`: where backward begins.
#[test]
fn parameter_510_is_the_least_negative_voltage() {
    let cases = [(1_000, -2_800.0), (500, -2_400.0)];
    effect(510, -2_000.0, &cases, 4.0).shows(|bench| bench.jog_speed(false, false));
    effect(510, -2_000.0, &cases, 4.0).each(&[(510, 1_000)], |bench| {
        assert!((bench.jog_speed(true, false) - 1_000.0).abs() < 4.0, "forward as before");
    });
}

/// How far off its nominal position an axis stays that was pushed by 30.
fn pushed(bench: &mut Bench, off: f64) -> f64 {
    bench.go(1_000);
    bench.run(300);
    bench.push(1_000.5 + off);
    bench.run(1_000);
    (bench.real() - 1_000.5).round()
}

/// `[516]`: below the nominal position nothing is put out that near to it.
#[test]
fn parameter_516_is_the_dead_range_below() {
    let effect =
        Effect { modes: &[CONTROL], ..effect(516, 0.0, &[(29, -29.0), (30, -30.0), (40, -30.0)], 4.0) };
    effect.shows(|bench| pushed(bench, -30.0));
    effect.each(&[(516, 40)], |bench| assert!(pushed(bench, 30.0).abs() < 2.0, "above as before"));
}

/// `[522]`: above it.
#[test]
fn parameter_522_is_the_dead_range_above() {
    let effect = Effect { modes: &[CONTROL], ..effect(522, 0.0, &[(29, 29.0), (30, 30.0), (40, 30.0)], 4.0) };
    effect.shows(|bench| pushed(bench, 30.0));
    effect.each(&[(522, 40)], |bench| assert!(pushed(bench, -30.0).abs() < 2.0, "below as before"));
}

/// `[528]`: slow on Qx.3, fast on Qx.4.
#[test]
fn parameter_528_is_the_jog_signals() {
    let cases = [(0, 0.0), (1, SLOW), (2, FAST)];
    Effect { modes: &[SIGNALS], ..effect(528, FAST, &cases, 1.0) }.shows(|bench| bench.jog_speed(true, true));
}

/// `[534]`: the direction signals are swapped, of contactors and of a stepper motor.
#[test]
fn parameter_534_reverses_the_direction_signals() {
    let cases = [(0, SLOW), (1, -SLOW)];
    Effect { modes: &[SIGNALS], ..effect(534, SLOW, &cases, 1.0) }
        .shows(|bench| bench.jog_speed(true, false));
    let base = [(450, 4), (540, 10_000), (546, 3)];
    Effect { base: &base, ..effect(534, 1_000.0, &[(0, 1_000.0), (1, -1_000.0)], 1.0) }.shows(stepping);
}

/// Pulses that a stepper motor follows in a second of slow jog forward.
fn stepping(bench: &mut Bench) -> f64 {
    bench.machine.axes[0].connection = Connection::Clock { block: bench.route.output };
    bench.set_drive(stepper_motor());
    bench.jog_speed(true, false);
    let before = bench.real();
    bench.run(996);
    ((bench.real() - before) / 0.996).round()
}

/// `[540]`: pulses a second at V max.
#[test]
fn parameter_540_is_the_stepping_frequency() {
    let base = [(450, 4), (546, 3)];
    let cases = [(10_000, 1_000.0), (5_000, 500.0), (1, 0.0)];
    Effect { base: &base, ..effect(540, 0.0, &cases, 1.0) }.shows(stepping);
}

/// `[546]`: which directions a motor goes that needs forward on Qx.2 and backward on Qx.1: 1 forward,
/// 2 backward, 4 forward though it should go backward.
#[test]
fn parameter_546_is_the_direction_signals() {
    let cases = [(0, 0.0), (1, 1.0), (2, 4.0), (3, 3.0)];
    Effect { modes: &[SIGNALS], ..effect(546, 3.0, &cases, 0.0) }.shows(|bench| {
        let forward = bench.jog_speed(true, false);
        bench.order(Order::Halt);
        bench.run(300);
        let backward = bench.jog_speed(false, false);
        let bit = |is: bool, bit: f64| if is { bit } else { 0.0 };
        bit(forward > 0.0, 1.0) + bit(backward < 0.0, 2.0) + bit(backward > 0.0, 4.0)
    });
}
