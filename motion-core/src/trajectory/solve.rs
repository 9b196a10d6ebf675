//! How far to push before braking to a standstill: the closed forms and Newton iterations of the
//! normalised problem (jerk 1).
//!
//! All times are measured along two curves: a push with jerk +1 runs along v = w + a²/2, and the jerk
//! −1 that ends it along v = u − a²/2. Pushed until acceleration α, then braked at once, the peak
//! velocity is u = w + α² and the way F(α) = α³ + 2wα + G(u), counted from where the push had no
//! acceleration; G(u) is the way from velocity u to a stop.

use super::math::{cbrt, greater, lesser, sqrt};
use super::profile::SIXTH;
use super::ramp::Bounds;

/// How the way to the target is driven, upwards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Peak {
    /// Braking goes on with less: up to this acceleration, below 0, then down again.
    Release(f64),
    /// Up to this velocity without acceleration, then towards the final velocity.
    Velocity(f64),
    /// Up to the highest velocity, and with it as far as needed.
    Cruise,
}

/// Way from velocity `u` without acceleration to a stop.
#[inline]
pub(super) fn stopping_way(u: f64, bounds: &Bounds) -> f64 {
    let held = 0.5 * (u * bounds.per_fall + bounds.fall);
    u * if u <= bounds.fall * bounds.fall { sqrt(u) } else { held }
}

/// The peak of the fastest way from a state to a standstill `d` ahead; `d` is more than the way of
/// the immediate stop, and the resting velocity is at most the highest.
#[inline]
pub(super) fn peak(v: f64, a: f64, d: f64, bounds: &Bounds) -> Peak {
    let w = v - a * a / 2.0;
    let k = d + w * a + a * a * a * SIXTH;
    if !bounds.crosses(v, a, w) {
        return push(w, a, k, bounds.grow, bounds.velocity, bounds);
    }
    // Through velocity 0, where the acceleration may be `most`. Short ways turn back before it.
    let most = bounds.crossing();
    let half = most * most / 2.0;
    let first = lesser(half, bounds.velocity);
    let alpha = lesser(bounds.fall, sqrt(first - w));
    let way = if alpha < bounds.fall {
        alpha * (alpha * alpha + 2.0 * w) + stopping_way(first, bounds)
    } else {
        held(w, first, alpha, bounds)
    };
    if k <= way || first < half {
        return push(w, a, k, bounds.fall, first, bounds);
    }
    // From (velocity 0, acceleration `most`) it is a push along w = −most²/2. The way to there is that
    // to the peak `half`, less what the jerk −1 still adds from `most` to 0, less the stop.
    let there = way - stopping_way(half, bounds) - most * most * most * (2.0 * SIXTH);
    let k = k - there - half * most + most * most * most * SIXTH;
    push(-half, most, k, bounds.grow, bounds.velocity, bounds)
}

/// Way of a push that holds `bound`, up to the peak `u`, and the stop.
#[inline]
fn held(w: f64, u: f64, bound: f64, bounds: &Bounds) -> f64 {
    u * (u / bound + bound) / 2.0 + stopping_way(u, bounds) + held_part(w, bound)
}

#[inline]
fn held_part(w: f64, bound: f64) -> f64 {
    w / 2.0 * (bound - w / bound)
}

/// The peak of a push along `w`, from acceleration `a`, with the acceleration up to `bound` and the
/// velocity up to `highest`, such that the whole way is `k`.
#[inline]
fn push(w: f64, a: f64, k: f64, bound: f64, highest: f64, bounds: &Bounds) -> Peak {
    let fall = bounds.fall;
    let free = highest - w;
    let top = lesser(bound, sqrt(free));
    let u = w + top * top;
    if (u >= 0.0) & (k < top * (top * top + 2.0 * w) + stopping_way(u, bounds)) {
        let alpha = triangle(w, a, top, k, bounds);
        return if alpha < 0.0 { Peak::Release(alpha) } else { Peak::Velocity(w + alpha * alpha) };
    }
    if free > bound * bound {
        let k = greater(0.0, k - held_part(w, bound));
        let root = sqrt(2.0 * bound * k);
        let s = 2.0 * root / (bound + sqrt(bound * bound + 4.0 * root));
        let u = if s <= fall {
            s * s
        } else {
            let b = (bound + fall) / 2.0;
            let c = 1.0 / bound + 1.0 / fall;
            2.0 * k / (b + sqrt(b * b + 2.0 * c * k))
        };
        if u < highest {
            return Peak::Velocity(greater(0.0, u));
        }
    }
    Peak::Cruise
}

/// α in `low`…`high` with F(α) = `k`.
#[inline]
fn triangle(w: f64, low: f64, high: f64, k: f64, bounds: &Bounds) -> f64 {
    let fall = bounds.fall;
    let brake = fall * fall;
    if w < 0.0 {
        // F is convex from u = 0 on, so Newton's way down from above cannot miss.
        let low = greater(low, sqrt(-w));
        let full = sqrt(brake - w);
        let start = if high <= full || k <= full * (full * full + 2.0 * w) + fall * brake {
            // An upper bound of s = α + √u, and one step of s³ = 4k − 4ws + w²/s nearer.
            let s = cbrt(4.0 * k) + 2.06 * sqrt(-w);
            let s = cbrt(4.0 * (k - w * s) + w * w / s);
            (s - w / s) / 2.0
        } else {
            let q = sqrt(fall * (2.0 * k - w * (2.0 * high + fall))) - w;
            half_root(fall, q)
        };
        return descend(w, between(low, start, high), low, k, bounds);
    }
    if w == 0.0 {
        let alpha = cbrt(4.0 * k) / 2.0;
        let alpha = if alpha <= fall { alpha } else { half_root(fall, sqrt(2.0 * fall * k)) };
        return between(low, alpha, high);
    }
    let flat = k >= stopping_way(w, bounds);
    // The braking reaches its bound: for α ≥ 0 beyond √(D² − w), for α < 0 below its negative.
    let full = sqrt(brake - w);
    let side = if flat { full } else { -full };
    let limit = side * (side * side + 2.0 * w) + fall * brake;
    let triangular = w <= brake && if flat { k <= limit } else { low >= side || k >= limit };
    if triangular {
        between(low, quartic(w, k), high)
    } else if flat {
        let q = sqrt(fall * (2.0 * k - w * fall)) - w;
        descend(w, lesser(half_root(fall, q), high), greater(low, 0.0), k, bounds)
    } else {
        bracket(w, low, if w <= brake { side } else { 0.0 }, k, bounds)
    }
}

#[inline(always)]
fn between(low: f64, x: f64, high: f64) -> f64 {
    greater(low, lesser(high, x))
}

/// Positive root of α(α + `b`) = `q`.
#[inline]
fn half_root(b: f64, q: f64) -> f64 {
    2.0 * q / (b + sqrt(b * b + 4.0 * q))
}

/// α from s = α + √u, the only positive root of s⁴ + 4ws² − 4ks − w², which is convex there for
/// w > 0; it is at most the start.
#[inline]
fn quartic(w: f64, k: f64) -> f64 {
    let mut s = greater(cbrt(4.0 * k), sqrt(w) / 2.0);
    for _ in 0..50 {
        let square = s * s;
        let value = ((square + 4.0 * w) * s - 4.0 * k) * s - w * w;
        let step = value / (4.0 * ((square + 2.0 * w) * s - k));
        if step <= 1e-16 * s {
            break;
        }
        s -= step;
        // Quadratic convergence: after a step of 1e-8 the next one is below rounding.
        if step < 1e-8 * s {
            break;
        }
    }
    (s - w / s) / 2.0
}

#[inline]
fn value_and_slope(w: f64, alpha: f64, bounds: &Bounds) -> (f64, f64) {
    let square = alpha * alpha;
    let u = greater(0.0, w + square);
    let (way, slope) = if u <= bounds.fall * bounds.fall {
        let root = sqrt(u);
        (u * root, 1.5 * root)
    } else {
        let held = u * bounds.per_fall;
        (0.5 * u * (held + bounds.fall), held + 0.5 * bounds.fall)
    };
    (alpha * (square + 2.0 * w) + way, 3.0 * square + 2.0 * w + 2.0 * alpha * slope)
}

/// Newton where F is convex: from above straight down to the root.
#[inline]
fn descend(w: f64, start: f64, low: f64, k: f64, bounds: &Bounds) -> f64 {
    let mut alpha = start;
    for _ in 0..50 {
        let (value, slope) = value_and_slope(w, alpha, bounds);
        let step = (value - k) / slope;
        alpha = greater(low, alpha - step);
        if step.abs() <= 1e-8 * alpha {
            break;
        }
    }
    alpha
}

/// Newton between two ends, halving where it leads out of them: F has no slope at −D.
fn bracket(w: f64, mut low: f64, mut high: f64, k: f64, bounds: &Bounds) -> f64 {
    let mut alpha = (low + high) / 2.0;
    for _ in 0..200 {
        let (value, slope) = value_and_slope(w, alpha, bounds);
        if value < k {
            low = alpha;
        } else {
            high = alpha;
        }
        let next = alpha - (value - k) / slope;
        let next = if next > low && next < high { next } else { (low + high) / 2.0 };
        if (next - alpha).abs() <= f64::EPSILON * alpha.abs() {
            break;
        }
        alpha = next;
    }
    alpha
}
