//! Fresh moves in whole units: all solved, none beyond the limits, none slower than the optimum.

use motion_core::trajectory::{Limits, Profile, State};
use oorandom::Rand64;

use crate::check::{SLACK, assert_continuous, excess};
use crate::{between, count, decades, limits, moving, oracle};

#[derive(Debug)]
#[expect(dead_code, reason = "printed when a move fails")]
struct Move {
    from: State,
    limits: Limits,
    target: f64,
    last: f64,
}

fn whole_way(random: &mut Rand64, scale: f64) -> f64 {
    let way = decades(random, scale, 10_000.0 * scale).round();
    if random.rand_float() < 0.5 { -way } else { way }
}

fn check(from: State, limits: Limits, target: f64, last: f64) -> (f64, f64) {
    let what = Move { from, limits, target, last };
    let mut profile = Profile::at_rest(0.0);
    profile.pass(&from, &limits, target, last).unwrap_or_else(|error| panic!("{error}: {what:?}"));
    assert_continuous(&profile, &from, &limits, &what);
    let excess = excess(&profile, &limits);
    assert!(excess <= SLACK, "{excess:e} beyond the limits: {what:?}\n{profile:?}");
    let least = oracle::least_time(&from, &limits, target, last);
    let late = profile.duration() / least - 1.0;
    assert!(late.abs() <= SLACK, "{late:e} slower than the optimum {least}: {what:?}\n{profile:?}");
    (excess, late.abs())
}

fn class(scale: f64, from_rest: bool, symmetric: bool, passing: bool) {
    let seed =
        scale as u128 * 8 + u128::from(from_rest) * 4 + u128::from(symmetric) * 2 + u128::from(passing);
    let mut random = Rand64::new(seed);
    let (mut most, mut latest) = (0.0_f64, 0.0_f64);
    // The slow solver is at its slowest where the target is passed.
    let count = if passing { count() / 5 } else { count() };
    for _ in 0..count {
        let limits = limits(&mut random, scale, symmetric, true);
        let position = (between(&mut random, -1e3, 1e3) * scale).round();
        let from = if from_rest { State::at_rest(position) } else { moving(&mut random, &limits, position) };
        let target = position + whole_way(&mut random, scale);
        let last = if passing { between(&mut random, -1.0, 1.0) * limits.velocity() } else { 0.0 };
        let (excess, late) = check(from, limits, target, last);
        (most, latest) = (most.max(excess), latest.max(late));
    }
    println!(
        "scale {scale:e}, {}, {}{}: {} moves, excess {most:.1e}, from the optimum {latest:.1e}",
        if from_rest { "from rest" } else { "moving" },
        if symmetric { "symmetric" } else { "asymmetric" },
        if passing { ", passing the target" } else { "" },
        count,
    );
}

macro_rules! classes {
    ($($name:ident: $scale:expr, $rest:expr, $symmetric:expr, $passing:expr;)*) => {
        $(#[test] fn $name() { class($scale, $rest, $symmetric, $passing); })*
    };
}

classes! {
    rest_symmetric_1: 1.0, true, true, false;
    rest_symmetric_1e3: 1e3, true, true, false;
    rest_symmetric_1e6: 1e6, true, true, false;
    rest_asymmetric_1: 1.0, true, false, false;
    rest_asymmetric_1e3: 1e3, true, false, false;
    rest_asymmetric_1e6: 1e6, true, false, false;
    moving_symmetric_1: 1.0, false, true, false;
    moving_symmetric_1e3: 1e3, false, true, false;
    moving_symmetric_1e6: 1e6, false, true, false;
    moving_asymmetric_1: 1.0, false, false, false;
    moving_asymmetric_1e3: 1e3, false, false, false;
    moving_asymmetric_1e6: 1e6, false, false, false;
    passing_symmetric: 1e3, false, true, true;
    passing_asymmetric: 1e3, false, false, true;
}

#[test]
fn partial_release_of_a_braking() {
    // The study's example: through acceleration 0 it would take 3.3416 s.
    let limits = Limits::new(100.0, 2.0, 2.0, 1.0).unwrap();
    let from = State { position: 0.0, velocity: 2.0, acceleration: -1.0 };
    let mut profile = Profile::at_rest(0.0);
    profile.move_to(&from, &limits, 2.5).unwrap();
    assert!((profile.duration() - 2.7473).abs() < 1e-4, "{}", profile.duration());
}

#[test]
fn exact_over_the_whole_range() {
    let mut random = Rand64::new(31);
    for _ in 0..count() {
        let limits = limits(&mut random, 1e6, false, true);
        let ends = [-2_147_483_648.0, 2_147_483_647.0];
        let start = ends[random.rand_range(0..2) as usize];
        let target = if random.rand_float() < 0.5 {
            (between(&mut random, ends[0], ends[1])).round()
        } else {
            start - start.signum() * decades(&mut random, 1.0, 1e6).round()
        };
        let from = State::at_rest(start);
        let mut profile = Profile::at_rest(0.0);
        profile.move_to(&from, &limits, target).unwrap();
        let what = (from, limits, target);
        assert_continuous(&profile, &from, &limits, &what);
        let excess = excess(&profile, &limits);
        assert!(excess <= SLACK, "{excess:e} beyond the limits: {what:?}");
        assert_eq!(profile.at(profile.duration()).position, target);
        assert_eq!(profile.at(f64::MAX).position, target);
    }
}

#[test]
fn reach_velocity_and_stop() {
    for (seed, symmetric) in [(5, true), (6, false)] {
        let mut random = Rand64::new(seed);
        for _ in 0..count() {
            let limits = limits(&mut random, 1e3, symmetric, true);
            let from = moving(&mut random, &limits, 0.0);
            let velocity = if random.rand_float() < 0.5 {
                0.0
            } else {
                between(&mut random, -1.0, 1.0) * limits.velocity()
            };
            let mut profile = Profile::at_rest(0.0);
            profile.reach(&from, &limits, velocity).unwrap();
            let what = (from, limits, velocity);
            assert_continuous(&profile, &from, &limits, &what);
            let excess = excess(&profile, &limits);
            assert!(excess <= SLACK, "{excess:e} beyond the limits: {what:?}");
            let oracle = oracle::reach(&from, &limits, velocity);
            let late = profile.duration() - oracle.time;
            assert!(late.abs() <= SLACK * oracle.time.max(1e-3), "{late}: {what:?}");
            let off = profile.end().position - oracle.position;
            let scale = oracle.time * limits.velocity();
            assert!(off.abs() <= 1e-9 * scale, "{off}: {what:?}");
            assert_eq!((profile.end().velocity, profile.end().acceleration), (velocity, 0.0));
        }
    }
}

/// Without a limit of jerk, three formulas of motion say what the least time is.
#[test]
fn trapezoids() {
    let mut random = Rand64::new(9);
    for turn in 0..count() {
        let limits = limits(&mut random, 1e3, false, false);
        let from = moving(&mut random, &limits, 0.0);
        let target = whole_way(&mut random, 1e3);
        let last = if turn % 2 == 0 { 0.0 } else { between(&mut random, -1.0, 1.0) * limits.velocity() };
        let what = Move { from, limits, target, last };
        let mut profile = Profile::at_rest(0.0);
        profile.pass(&from, &limits, target, last).unwrap();
        assert_continuous(&profile, &from, &limits, &what);
        let excess = excess(&profile, &limits);
        assert!(excess <= SLACK, "{excess:e} beyond the limits: {what:?}");
        // A very high jerk comes close to none.
        let (v, a, d) = (limits.velocity(), limits.acceleration(), limits.deceleration());
        let steep = Limits::new(v, a, d, a.max(d) * 1e6).unwrap();
        let least = oracle::least_time(&from, &steep, target, last);
        let late = profile.duration() - least;
        assert!(late < 1e-9 * least && late > -1e-4, "{late} s after {least} s: {what:?}");
    }
}
