//! How far to push when the target is to be passed with a velocity: there is no closed form, but the
//! way grows with the peak wherever the peak is positive, so that a search between two ends finds it.

use super::profile::SIXTH;
use super::ramp::{Bounds, change_way, resting_velocity};
use super::solve::Peak;

/// The peak of the fastest way from a state to `d` ahead with velocity `last`; `d` is more than the
/// way of the immediate change of velocity, and the resting velocity is at most the highest.
pub(super) fn peak(v: f64, a: f64, d: f64, last: f64, bounds: &Bounds) -> Peak {
    let resting = resting_velocity(v, a);
    if a < 0.0 && resting > last {
        let way = |alpha: f64| released(v, a, alpha, last, bounds);
        // The way may grow and then shrink, when the velocity passes 0 while it is released. The
        // fastest is where it first is long enough.
        let high = if way(0.0) > d { 0.0 } else { highest(a, 0.0, way) };
        if way(high) > d {
            return Peak::Release(root(a, high, d, way));
        }
    }
    let way = |u: f64| change_way(v, a, u, bounds) + change_way(u, 0.0, last, bounds);
    if d >= way(bounds.velocity) {
        return Peak::Cruise;
    }
    Peak::Velocity(root(resting.max(last), bounds.velocity, d, way))
}

/// Where a function with one peak is highest (golden section; its peak is flat, so that half the
/// digits are all there are).
fn highest(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    const RATIO: f64 = 0.618_033_988_749_895;
    for _ in 0..50 {
        let span = (high - low) * RATIO;
        let (left, right) = (high - span, low + span);
        if f(left) < f(right) {
            low = left;
        } else {
            high = right;
        }
    }
    (low + high) / 2.0
}

/// Way of a braking that is released to acceleration `alpha` in between.
fn released(v: f64, a: f64, alpha: f64, last: f64, bounds: &Bounds) -> f64 {
    let time = alpha - a;
    let then = v + time * (a + time / 2.0);
    time * (v + time * (a / 2.0 + time * SIXTH)) + change_way(then, alpha, last, bounds)
}

/// Where a growing function reaches `goal`: regula falsi (Illinois), with halvings so that it always
/// ends.
fn root(mut low: f64, mut high: f64, goal: f64, f: impl Fn(f64) -> f64) -> f64 {
    let (mut below, mut above) = (f(low) - goal, f(high) - goal);
    let mut side = 0;
    for turn in 0..200 {
        let middle = (low + high) / 2.0;
        let secant = (low * above - high * below) / (above - below);
        let x = if turn % 4 != 3 && secant > low && secant < high { secant } else { middle };
        if x <= low || x >= high {
            break;
        }
        let value = f(x) - goal;
        if value == 0.0 {
            return x;
        }
        if value < 0.0 {
            (low, below) = (x, value);
            if side == -1 {
                above /= 2.0;
            }
            side = -1;
        } else {
            (high, above) = (x, value);
            if side == 1 {
                below /= 2.0;
            }
            side = 1;
        }
    }
    (low + high) / 2.0
}
