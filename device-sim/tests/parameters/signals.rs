//! Mode Signals, 6.8.1.2, with a motor behind contactors.

use motion_core::application::Order;

use super::bench::{Bench, Effect, FAST, Family, SIGNALS, SLOW};

fn effect<'a>(parameter: u16, left: f64, cases: &'a [(i32, f64)], tolerance: f64) -> Effect<'a> {
    Effect { family: Family::Axes, modes: &[SIGNALS], parameter, base: &[], left, cases, tolerance }
}

/// Bits of the output's block.
const SLOW_JOG: u8 = 3;
const FAST_JOG: u8 = 4;

fn order(bench: &mut Bench, position: i32) {
    bench.order(Order::MoveAbsolute { position, velocity: None });
}

/// `[816]`: fast only where its way is there: 28 + 650 are needed to stop.
#[test]
fn parameter_816_is_the_way_from_slow_to_fast() {
    effect(816, 1.0, &[(700, 1.0), (900, 0.0)], 0.0).shows(|bench| {
        order(bench, 1_500);
        f64::from(u8::from(bench.fastest(3_000) > SLOW + 1.0))
    });
}

/// How much is left when a signal goes off.
fn left_at(bench: &mut Bench, position: i32, bit: u8) -> f64 {
    order(bench, position);
    assert!(bench.until(|bench| bench.terminal(bit)) >= 0.0);
    let mut seen = 0.0;
    bench.until(|bench| {
        seen = f64::from(bench.status().position);
        !bench.terminal(bit)
    });
    (f64::from(position) - seen).abs()
}

/// `[822]`: with `[828]` the way that is left when fast goes off, forward.
#[test]
fn parameter_822_is_the_way_from_fast_to_slow_forward() {
    let cases = [(1_000, 1_028.0), (1_500, 1_528.0)];
    effect(822, 678.0, &cases, 31.0).shows(|bench| left_at(bench, 6_000, FAST_JOG));
}

/// `[834]`: the same backward.
#[test]
fn parameter_834_is_the_way_from_fast_to_slow_backward() {
    let cases = [(1_000, 1_028.0), (1_500, 1_528.0)];
    effect(834, 678.0, &cases, 31.0).shows(|bench| left_at(bench, -6_000, FAST_JOG));
}

/// Where the axis is in the end, seen from its target: the way that it does not need is missing.
fn missing(bench: &mut Bench, position: i32) -> f64 {
    order(bench, position);
    bench.run(4_000);
    assert_eq!(bench.speed(), 0.0);
    (f64::from(position) - bench.real()).abs()
}

/// `[828]`: 25 are needed from slow to standstill.
#[test]
fn parameter_828_is_the_way_from_slow_to_standstill_forward() {
    effect(828, 3.0, &[(100, 75.0), (200, 175.0)], 7.0).shows(|bench| missing(bench, 3_000));
}

/// `[840]`: the same backward.
#[test]
fn parameter_840_is_the_way_from_slow_to_standstill_backward() {
    effect(840, 3.0, &[(100, 75.0), (200, 175.0)], 7.0).shows(|bench| missing(bench, -3_000));
}

/// Fast forward, then backward: ms until slow goes off, and from then until the axis is driven backward.
fn reversal(bench: &mut Bench) -> (f64, f64) {
    bench.jog(true, true);
    bench.run(600);
    assert!((bench.speed() - FAST).abs() < 1.0);
    bench.jog(false, false);
    bench.until(|bench| !bench.terminal(FAST_JOG));
    let slow = bench.until(|bench| !bench.terminal(SLOW_JOG));
    (slow, bench.until(|bench| bench.terminal(1)))
}

/// `[846]`: from fast to slow, before a reversal.
#[test]
fn parameter_846_is_the_time_from_fast_to_slow() {
    effect(846, 6.0, &[(300, 300.0), (600, 600.0)], 6.0).shows(|bench| reversal(bench).0);
}

/// `[870]`: from slow to the other direction; a cycle between the end of the run-out and the new direction.
#[test]
fn parameter_870_is_the_time_from_slow_to_the_other_direction() {
    effect(870, 36.0, &[(300, 306.0), (600, 606.0)], 6.0).shows(|bench| reversal(bench).1);
}

/// `[852]`: slow goes before fast by this time.
#[test]
fn parameter_852_is_the_time_from_slow_to_fast() {
    effect(852, 6.0, &[(240, 240.0), (600, 600.0)], 6.0).shows(|bench| {
        bench.jog(true, true);
        bench.until(|bench| bench.terminal(SLOW_JOG));
        bench.until(|bench| bench.terminal(FAST_JOG))
    });
}

/// `[858]`: fast by hand.
#[test]
fn parameter_858_allows_fast_by_hand() {
    effect(858, FAST, &[(0, SLOW), (1, FAST)], 1.0).shows(|bench| bench.jog_speed(true, true));
}

/// `[864]`: fast while positioning.
#[test]
fn parameter_864_allows_fast_while_positioning() {
    effect(864, FAST, &[(0, SLOW), (1, FAST)], 1.0).shows(|bench| {
        order(bench, 8_000);
        bench.fastest(3_000)
    });
}
