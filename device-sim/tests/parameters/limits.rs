//! Limit switches, 6.8.1.1. How they react while jogging, positioning and calibrating is looked at with six
//! axes on their buses, in `controller_axes`.

use device_sim::plant::Switch;
use lb2::code::Failure;
use motion_core::application::{MotionError, State};
use motion_core::failure::{HW_LIMIT_MINUS, HW_LIMIT_PLUS, SW_LIMIT_MINUS, SW_LIMIT_PLUS};
use motion_core::io::Terminal;

use super::bench::{Bench, CONTROL, Effect, Family, RAMPS, SIGNALS};

/// Where a slow jog of 4 s ends: 4,000 away less the ramp, or where a limit stops it.
fn end(bench: &mut Bench, upper: bool, failure: Failure) -> f64 {
    bench.jog(upper, false);
    bench.run(4_000);
    if bench.speed().abs() < 0.5 {
        assert_eq!(bench.status().error, MotionError::from_failure(failure));
    } else {
        assert_eq!((bench.failures().len(), bench.status().state), (0, State::ContinuousMotion));
    }
    bench.real()
}

fn effect<'a>(parameter: u16, base: &'a [(u16, i32)], left: f64, cases: &'a [(i32, f64)]) -> Effect<'a> {
    let modes = &[CONTROL, RAMPS, SIGNALS];
    // Up to a cycle's way, and 25 to 30 to stop.
    Effect { family: Family::Axes, modes, parameter, base, left, cases, tolerance: 45.0 }
}

/// Both directions have one speed in every mode.
const SLOW: (u16, i32) = (768, 1_000);
const FREE: f64 = 3_975.0;

#[test]
fn parameter_924_activates_the_upper_software_limit() {
    effect(924, &[], FREE, &[(0, FREE), (1, 3_025.0)]).shows(|bench| end(bench, true, SW_LIMIT_PLUS));
}

#[test]
fn parameter_930_is_the_upper_software_limit() {
    let cases = [(1_000, 1_025.0), (2_500, 2_525.0)];
    effect(930, &[(924, 1)], 3_025.0, &cases).shows(|bench| end(bench, true, SW_LIMIT_PLUS));
}

#[test]
fn parameter_936_activates_the_lower_software_limit() {
    effect(936, &[SLOW], -FREE, &[(0, -FREE), (1, -3_025.0)])
        .shows(|bench| end(bench, false, SW_LIMIT_MINUS));
}

#[test]
fn parameter_942_is_the_lower_software_limit() {
    let cases = [(-1_000, -1_025.0), (-2_500, -2_525.0)];
    effect(942, &[SLOW, (936, 1)], -3_025.0, &cases).shows(|bench| end(bench, false, SW_LIMIT_MINUS));
}

/// With a switch on I2.3 that is high from 2,000 on, upward or downward.
fn switched(bench: &mut Bench, upper: bool) -> f64 {
    let (at, failure) = if upper { (2_000.0, HW_LIMIT_PLUS) } else { (-2_000.0, HW_LIMIT_MINUS) };
    bench.add_switch(Switch::limit(Terminal::new(2, 3).unwrap(), at, upper));
    end(bench, upper, failure)
}

/// `[948]`: with the wrong level the axis does not get away at all.
#[test]
fn parameter_948_is_the_upper_hardware_limit_and_its_level() {
    effect(948, &[(954, 9)], FREE, &[(0, FREE), (1, 0.0), (2, 2_025.0)]).shows(|bench| switched(bench, true));
}

/// `[954]`: I1.0 is choice 0, I2.3 is choice 9, I4.7 is choice 29.
#[test]
fn parameter_954_is_the_upper_limit_switchs_input() {
    let cases = [(0, FREE), (8, FREE), (9, 2_025.0), (10, FREE), (29, FREE)];
    effect(954, &[(948, 2)], FREE, &cases).shows(|bench| switched(bench, true));
}

#[test]
fn parameter_960_is_the_lower_hardware_limit_and_its_level() {
    effect(960, &[SLOW, (966, 9)], -FREE, &[(0, -FREE), (1, 0.0), (2, -2_025.0)])
        .shows(|bench| switched(bench, false));
}

#[test]
fn parameter_966_is_the_lower_limit_switchs_input() {
    let cases = [(0, -FREE), (8, -FREE), (9, -2_025.0), (10, -FREE), (29, -FREE)];
    effect(966, &[SLOW, (960, 2)], -FREE, &cases).shows(|bench| switched(bench, false));
}
