//! Manual operation, 6.8.1.1.

use device_sim::plant::Drive;

use super::bench::{CONTROL, Effect, Family, RAMPS, SIGNALS};

const DRIVEN: [i32; 2] = [CONTROL, RAMPS];

/// The velocity of one direction and speed.
fn jog(parameter: u16, forward: bool, fast: bool, left: f64) {
    let sign = if forward { 1.0 } else { -1.0 };
    let cases = [(700, sign * 700.0), (3_500, sign * 3_500.0)];
    let effect = Effect {
        family: Family::Axes,
        modes: &DRIVEN,
        parameter,
        base: &[],
        left: sign * left,
        cases: &cases,
        tolerance: 4.0,
    };
    effect.shows(|bench| bench.jog_speed(forward, fast));
}

#[test]
fn parameter_756_is_jog_slow_forward() {
    jog(756, true, false, 1_000.0);
}

#[test]
fn parameter_762_is_jog_fast_forward() {
    jog(762, true, true, 5_000.0);
}

#[test]
fn parameter_768_is_jog_slow_backward() {
    jog(768, false, false, 2_000.0);
}

#[test]
fn parameter_774_is_jog_fast_backward() {
    jog(774, false, true, 4_000.0);
}

/// `[780]`: the key forward moves backward, with that direction's velocity.
#[test]
fn parameter_780_swaps_the_jog_keys() {
    let effect = |modes, swapped: &'static [(i32, f64)]| Effect {
        family: Family::Axes,
        modes,
        parameter: 780,
        base: &[],
        left: 1_000.0,
        cases: swapped,
        tolerance: 4.0,
    };
    effect(&DRIVEN, &[(0, 1_000.0), (1, -2_000.0)]).shows(|bench| bench.jog_speed(true, false));
    // The motor behind contactors has one slow speed.
    effect(&[SIGNALS], &[(0, 1_000.0), (1, -1_000.0)]).shows(|bench| bench.jog_speed(true, false));
}

/// `[786]`: with a fixed voltage a drive that is 10 % slow stays so, with feedback it does not.
#[test]
fn parameter_786_controls_the_jog() {
    let effect = Effect {
        family: Family::Axes,
        modes: &[CONTROL],
        parameter: 786,
        base: &[],
        left: 900.0,
        cases: &[(0, 900.0), (1, 1_000.0)],
        tolerance: 4.0,
    };
    effect.shows(|bench| {
        bench.set_drive(Drive::first_order(9_000.0, 0.005));
        bench.jog_speed(true, false)
    });
}
