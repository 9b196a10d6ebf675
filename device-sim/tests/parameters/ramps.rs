//! Mode Ramps, 6.8.1.3: the velocity at a distance from the target.

use motion_core::application::Order;

use super::bench::{Bench, Effect, Family, RAMPS};

/// The velocity of the axis when so much is left of 12,000.
fn velocity(bench: &mut Bench, distance: f64) -> f64 {
    bench.order(Order::MoveAbsolute { position: 12_000, velocity: None });
    assert!(bench.until(|bench| bench.real() >= 12_000.0 - distance) > 0.0);
    bench.speed()
}

/// Seen within a cycle's way and the drive's lag.
fn point(parameter: u16, distance: f64, left: f64, cases: &[(i32, f64)], tolerance: f64) {
    let effect =
        Effect { family: Family::Axes, modes: &[RAMPS], parameter, base: &[], left, cases, tolerance };
    effect.shows(|bench| velocity(bench, distance));
}

/// `[894]`: where braking from V max. begins.
#[test]
fn parameter_894_is_the_distance_of_the_first_point() {
    point(894, 3_000.0, 2_000.0 + 8_000.0 * 2.0 / 3.0, &[(8_000, 2_000.0 + 8_000.0 * 2.0 / 7.0)], 250.0);
}

#[test]
fn parameter_906_is_the_distance_of_the_second_point() {
    point(906, 1_000.0, 2_000.0, &[(2_000, 300.0 + 1_700.0 * 8.0 / 18.0)], 90.0);
}

#[test]
fn parameter_918_is_the_velocity_of_the_second_point() {
    point(918, 1_000.0, 2_000.0, &[(4_000, 4_000.0), (1_000, 1_000.0)], 100.0);
}

#[test]
fn parameter_900_is_the_distance_of_the_last_point() {
    point(900, 100.0, 150.0, &[(50, 300.0 + 1_700.0 * 50.0 / 950.0), (400, 75.0)], 15.0);
}

#[test]
fn parameter_912_is_the_velocity_of_the_last_point() {
    point(912, 200.0, 300.0, &[(600, 600.0), (150, 150.0)], 20.0);
}
