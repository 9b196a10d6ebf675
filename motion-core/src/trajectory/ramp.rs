//! The fastest change of velocity, in normalised units: jerk 1, so that velocities, accelerations and
//! positions are those of the axis divided by its jerk, and times stay what they are.

use super::math::{greater, lesser, sqrt};
use super::profile::SIXTH;

/// Normalised limits: what [`super::Limits`] says, divided by the jerk.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounds {
    pub(super) velocity: f64,
    /// Acceleration while the speed grows.
    pub(super) grow: f64,
    /// Acceleration while the speed falls.
    pub(super) fall: f64,
    /// 1/`grow` and 1/`fall`: a division costs as much as ten multiplications.
    pub(super) per_grow: f64,
    pub(super) per_fall: f64,
}

impl Bounds {
    /// The bound of |a| that holds at this velocity and acceleration. Standstill counts as growing.
    #[inline]
    fn at(&self, v: f64, a: f64) -> f64 {
        if v * a < 0.0 { self.fall } else { self.grow }
    }

    /// What |a| may be when the velocity changes its sign.
    #[inline]
    pub(super) fn crossing(&self) -> f64 {
        lesser(self.grow, self.fall)
    }

    /// Whether a rise along v = `w` + a²/2 (jerk +1) reaches velocity 0 with more acceleration than
    /// may be there.
    #[inline]
    pub(super) fn crosses(&self, v: f64, a: f64, w: f64) -> bool {
        let most = self.crossing();
        // One branch instead of five that cannot be predicted.
        (self.grow != self.fall) & (w < 0.0) & ((a <= 0.0) | (v < 0.0)) & (-2.0 * w > most * most)
    }
}

/// A stretch of constant jerk: −1, 0 or +1.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Leg {
    pub(super) time: f64,
    pub(super) jerk: f64,
}

/// The legs of one change of velocity, in order.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Ramp {
    legs: [Leg; 6],
    len: usize,
}

impl Ramp {
    /// The fastest way from velocity and acceleration to `target` without acceleration, for an axis
    /// that runs the other way if `turn` is −1.
    pub(super) fn to(v: f64, a: f64, target: f64, turn: f64, bounds: &Bounds) -> Self {
        let mut ramp = Self::default();
        change(v, a, target, bounds, |time, jerk| {
            if time > 0.0
                && let Some(leg) = ramp.legs.get_mut(ramp.len)
            {
                *leg = Leg { time, jerk: jerk * turn };
                ramp.len += 1;
            }
        });
        ramp
    }

    pub(super) fn legs(&self) -> &[Leg] {
        self.legs.get(..self.len).unwrap_or(&[])
    }
}

/// Way of the fastest change of velocity to `target`.
pub(super) fn change_way(mut v: f64, mut a: f64, target: f64, bounds: &Bounds) -> f64 {
    let mut way = 0.0;
    change(v, a, target, bounds, |time, jerk| {
        if time > 0.0 {
            way += time * (v + time * (a * 0.5 + time * jerk * SIXTH));
            v += time * (a + time * jerk * 0.5);
            a += time * jerk;
        }
    });
    way
}

/// The fastest way from velocity and acceleration to `target` without acceleration: its legs, time and
/// jerk, in order; those whose time is not positive are none. The start must be one that [`restore`]
/// leaves.
#[inline]
fn change(v: f64, a: f64, target: f64, bounds: &Bounds, mut leg: impl FnMut(f64, f64)) {
    if target >= resting_velocity(v, a) {
        rise(v, a, target, bounds, leg);
    } else {
        rise(-v, -a, -target, bounds, |time, jerk| leg(time, -jerk));
    }
}

/// As [`change`], to a velocity that is not below the resting velocity.
#[inline(always)]
pub(super) fn rise(v: f64, a: f64, target: f64, bounds: &Bounds, mut leg: impl FnMut(f64, f64)) {
    let w = v - a * a * 0.5;
    let through_zero = target > 0.0 && bounds.crosses(v, a, w);
    let half = bounds.crossing() * bounds.crossing() * 0.5;
    if through_zero && target > half {
        // The acceleration has to be `most` at velocity 0, with the other bound on either side.
        let most = bounds.crossing();
        let up = lesser(bounds.fall, sqrt(half - w));
        leg(up - a, 1.0);
        if up == bounds.fall {
            leg((half - w) / up - up, 0.0);
        }
        leg(up - most, -1.0);
        single(most, target + half, bounds.grow, bounds.per_grow, leg);
    } else {
        let falls = target <= 0.0 || through_zero;
        let bound = if falls { bounds.fall } else { bounds.grow };
        let per_bound = if falls { bounds.per_fall } else { bounds.per_grow };
        single(a, target - w, bound, per_bound, leg);
    }
}

/// Up from acceleration `a` to at most `bound` and back to none; `gain` is the gain of velocity as if it
/// began at acceleration 0.
#[inline(always)]
fn single(a: f64, gain: f64, bound: f64, per_bound: f64, mut leg: impl FnMut(f64, f64)) {
    let peak = lesser(bound, sqrt(gain));
    leg(peak - a, 1.0);
    leg(greater(0.0, gain * per_bound - bound), 0.0);
    leg(peak, -1.0);
}

/// The velocity that is left when the present acceleration is taken to zero at once.
#[inline]
pub(super) fn resting_velocity(v: f64, a: f64) -> f64 {
    v + a * a.abs() / 2.0
}

/// The next leg that brings an acceleration back within its bound; `None` when it is. A braking that
/// must cross velocity 0 with too much acceleration whatever is done counts as beyond.
#[inline]
pub(super) fn restore(v: f64, a: f64, bounds: &Bounds) -> Option<Leg> {
    let size = a.abs();
    if size <= bounds.crossing() {
        return None;
    }
    let bound = bounds.at(v, a);
    let crosses_above =
        v * a < 0.0 && size > bounds.grow && size * size - bounds.grow * bounds.grow > 2.0 * v.abs();
    let goal = if crosses_above {
        bounds.grow
    } else if size > bound {
        bound
    } else {
        return None;
    };
    // Rounding may leave an acceleration that exceeds its bound by its last digit.
    let time = size - goal;
    (time > 4.0 * f64::EPSILON * size).then_some(Leg { time, jerk: -(1.0_f64.copysign(a)) })
}
