//! From limits and states to phases: normalises the problem, decides the direction, and integrates the
//! legs forward from the start and backward from the target, so that both ends are exact.

use super::limits::Limits;
use super::math::{greater, lesser, sqrt};
use super::profile::{Phase, Profile, SIXTH, State};
use super::ramp::{Bounds, Ramp, change_way, resting_velocity, restore, rise};
use super::search;
use super::solve::{self, Peak};

/// Where a stop would end this near to the target, relative to all that was added up, it is the way.
pub(super) const ROUNDING: f64 = 32.0 * f64::EPSILON;
/// Beyond the target by less than this, relative to all that was added up, is not beyond.
pub(super) const TOUCH: f64 = 1e-12;
/// A start can be beyond its bound on one side of velocity 0, then on the other.
const MAX_RESTORES: usize = 3;

/// Appends phases to a profile, in the axis's own units.
struct Drive<'a> {
    profile: &'a mut Profile,
    jerk: f64,
    /// Phases so far.
    len: usize,
    time: f64,
    /// Position from the start, velocity, acceleration.
    state: State,
}

impl Drive<'_> {
    #[inline(always)]
    fn leg(&mut self, time: f64, jerk: f64) {
        let time = greater(0.0, time);
        let phase = self.put(self.state, jerk * self.jerk, time);
        self.state = phase.after(time);
    }

    /// A phase of `time`. One without any is written over by the next: that costs less than a branch that
    /// cannot be predicted.
    #[inline(always)]
    fn put(&mut self, state: State, jerk: f64, time: f64) -> Phase {
        let State { position, velocity, acceleration } = state;
        let phase = Phase { begin: self.time, position, velocity, acceleration, jerk };
        if let Some(slot) = self.profile.phases.get_mut(self.len) {
            *slot = phase;
            self.len += usize::from(time > 0.0);
        }
        self.time += time;
        phase
    }

    fn end(&mut self) {
        self.profile.len = self.len as u8;
        self.profile.duration = self.time;
    }

    /// With constant velocity, if one is given, up to `start`, where the phases counted from the
    /// target begin.
    #[inline(always)]
    fn cruise(&mut self, velocity: Option<f64>, start: f64) {
        if let Some(velocity) = velocity {
            self.state.velocity = velocity;
            self.state.acceleration = 0.0;
            let gap = self.profile.end.position - self.profile.start + (start - self.state.position);
            self.put(self.state, 0.0, greater(0.0, gap / velocity));
        }
        self.profile.tail = self.len as u8;
    }

    /// The stop at the target, from velocity `u` without acceleration, or from where the jerk −1 that
    /// comes from there has made it `a`; computed backward from the end.
    #[inline(always)]
    fn stop(&mut self, u: f64, a: f64, bounds: &Bounds, sign: f64, velocity: Option<f64>) {
        let scale = self.jerk * sign;
        let peak = lesser(bounds.fall, sqrt(u));
        let hold = greater(0.0, u * bounds.per_fall - bounds.fall);
        // Velocity and way left, when the last leg begins, when the hold begins, and at `a`.
        let half = peak * peak * 0.5;
        let last = peak * half * (2.0 * SIXTH);
        let held = half + peak * hold;
        let way = last + hold * (half + held) * 0.5;
        let first = greater(0.0, peak + a);
        let start = u - a * a * 0.5;
        let whole = way + first * (held + first * (peak * 0.5 - first * SIXTH));
        let state = |way: f64, velocity: f64, acceleration: f64| State {
            position: -way * scale,
            velocity: velocity * scale,
            acceleration: acceleration * scale,
        };
        self.cruise(velocity, -whole * scale);
        self.put(state(whole, start, a), -scale, first);
        self.put(state(way, held, -peak), 0.0, hold);
        self.put(state(last, half, -peak), scale, peak);
        self.end();
    }

    /// The change to the final velocity at the target, from velocity and acceleration; computed backward
    /// from the end.
    fn arrive(&mut self, ramp: &Ramp, velocity: Option<f64>) {
        let mut states = [State::default(); 6];
        let mut state = State { position: 0.0, ..self.profile.end };
        for (leg, slot) in ramp.legs().iter().zip(&mut states).rev() {
            let back = Phase {
                begin: 0.0,
                position: state.position,
                velocity: state.velocity,
                acceleration: state.acceleration,
                jerk: leg.jerk * self.jerk,
            };
            state = back.after(-leg.time);
            *slot = state;
        }
        self.cruise(velocity, state.position);
        for (leg, state) in ramp.legs().iter().zip(&states) {
            self.put(*state, leg.jerk * self.jerk, leg.time);
        }
        self.end();
    }
}

#[inline]
pub(super) fn normalise(limits: &Limits) -> (Bounds, f64) {
    let scale = 1.0 / limits.jerk();
    let bounds = Bounds {
        velocity: limits.velocity() * scale,
        grow: limits.acceleration() * scale,
        fall: limits.deceleration() * scale,
        per_grow: limits.jerk() / limits.acceleration(),
        per_fall: limits.jerk() / limits.deceleration(),
    };
    (bounds, scale)
}

impl Profile {
    /// Brings the acceleration back inside its bound; returns what the profile goes on with.
    #[inline]
    fn drive(&mut self, from: &State, jerk: f64, scale: f64, bounds: &Bounds) -> Drive<'_> {
        let state = State { position: 0.0, ..*from };
        let mut drive = Drive { profile: self, jerk, len: 0, time: 0.0, state };
        for _ in 0..MAX_RESTORES {
            let (v, a) = (drive.state.velocity * scale, drive.state.acceleration * scale);
            let Some(leg) = restore(v, a, bounds) else { break };
            // Braking too hard, the bound changes where the velocity passes 0.
            let rest = if v * a < 0.0 && v * resting_velocity(v, a) < 0.0 {
                2.0 * v.abs() / (a.abs() + sqrt(a * a - 2.0 * v.abs()))
            } else {
                f64::INFINITY
            };
            if rest < leg.time {
                drive.leg(rest, leg.jerk);
                drive.state.velocity = 0.0;
            } else {
                drive.leg(leg.time, leg.jerk);
            }
        }
        drive
    }

    pub(super) fn plan_velocity(&mut self, from: &State, limits: &Limits, velocity: f64) {
        let (bounds, scale) = normalise(limits);
        let mut drive = self.drive(from, limits.jerk(), scale, &bounds);
        drive.ramp(velocity, scale, &bounds);
        let position = from.position + drive.state.position;
        self.end = State { position, velocity, acceleration: 0.0 };
    }

    #[inline]
    pub(super) fn plan_position(&mut self, from: &State, limits: &Limits, target: f64, velocity: f64) {
        self.end = State { position: target, velocity, acceleration: 0.0 };
        if from.velocity == 0.0 && from.acceleration == 0.0 && velocity == 0.0 {
            return self.plan_rest(limits);
        }
        let (bounds, scale) = normalise(limits);
        let mut drive = self.drive(from, limits.jerk(), scale, &bounds);
        let (v, a) = (drive.state.velocity * scale, drive.state.acceleration * scale);
        let d = (target - from.position - drive.state.position) * scale;
        let last = velocity * scale;
        let resting = resting_velocity(v, a);
        // The way of going to the final velocity at once tells the direction.
        let (direct, size) = if last == 0.0 {
            let sign = 1.0_f64.copysign(resting);
            let (v, a) = (v * sign, a * sign);
            let rest = solve::stopping_way(v + a * a / 2.0, &bounds);
            ((v * a + a * a * a * (2.0 * SIXTH) + rest) * sign, rest)
        } else {
            let way = change_way(v, a, last, &bounds);
            (way, way.abs())
        };
        let size =
            (from.position.abs() + target.abs() + drive.state.position.abs()) * scale + size + (v * a).abs();
        let rest = d - direct;
        if rest.abs() <= ROUNDING * size {
            drive.ramp(velocity, scale, &bounds);
            return;
        }
        let way = target - from.position;
        drive.profile.overshoots = last == 0.0 && way * rest <= 0.0 && rest.abs() > TOUCH * size;
        // A branch, so that the processor need not wait for the direction.
        if rest > 0.0 {
            drive.push::<true>(scale, velocity, &bounds, way);
        } else {
            drive.push::<false>(scale, velocity, &bounds, way);
        }
        // Braking so hard that it turns before it can be released, perhaps beyond the target. Until then
        // the velocity is at most the start's, and the time less than the release would take.
        let start = resting_velocity(from.velocity * scale, from.acceleration * scale);
        let reach = (from.velocity * from.acceleration * scale).abs();
        let turns = (from.velocity * start < 0.0) & (from.velocity * way > 0.0);
        if turns & (reach >= way.abs()) && last == 0.0 {
            self.overshoots |= self.first_turn().is_some_and(|turn| turn.abs() > way.abs());
        }
    }

    /// Way until the velocity first changes its sign; `None` if it does not before the peak.
    fn first_turn(&self) -> Option<f64> {
        let phases = self.phases().get(..usize::from(self.tail.min(self.len)))?;
        phases.windows(2).find_map(|pair| {
            let [phase, next] = pair else { return None };
            let root = sqrt(phase.acceleration * phase.acceleration - 2.0 * phase.jerk * phase.velocity);
            let time = -2.0 * phase.velocity / (phase.acceleration + root.copysign(phase.acceleration));
            let turns = time >= 0.0 && phase.begin + time <= next.begin;
            turns.then(|| phase.after(time).position)
        })
    }
}

impl Drive<'_> {
    /// Straight to a velocity, ending there.
    fn ramp(&mut self, velocity: f64, scale: f64, bounds: &Bounds) {
        let (v, a) = (self.state.velocity * scale, self.state.acceleration * scale);
        for leg in Ramp::to(v, a, velocity * scale, 1.0, bounds).legs() {
            self.leg(leg.time, leg.jerk);
        }
        self.end();
    }

    /// Forward or backward as far as can be, then to the end. `way` leads from the profile's start to its
    /// target.
    fn push<const FORWARD: bool>(&mut self, scale: f64, velocity: f64, bounds: &Bounds, way: f64) {
        let sign = if FORWARD { 1.0 } else { -1.0 };
        let turn = sign * scale;
        let (mut v, mut a) = (self.state.velocity * turn, self.state.acceleration * turn);
        let last = velocity * turn;
        let highest = bounds.velocity;
        if resting_velocity(v, a) > highest {
            // Too fast: down towards the highest velocity, from where the braking may go on.
            let excess = v - highest + a * a / 2.0;
            let low = lesser(bounds.fall, sqrt(excess));
            self.leg(a + low, -sign);
            if low == bounds.fall {
                self.leg((excess - low * low) / low, 0.0);
            }
            (v, a) = (highest + low * low / 2.0, -low);
            self.state.velocity = v * sign * self.jerk;
            self.state.acceleration = a * sign * self.jerk;
        }
        let d = (way - self.state.position) * turn;
        let peak =
            if last == 0.0 { solve::peak(v, a, d, bounds) } else { search::peak(v, a, d, last, bounds) };
        let (u, a, cruise) = match peak {
            Peak::Release(alpha) => {
                let time = alpha - a;
                self.leg(time, sign);
                let then = v + time * (a + time * 0.5);
                (then + alpha * alpha * 0.5, alpha, None)
            }
            Peak::Velocity(u) => {
                rise(v, a, u, bounds, |time, jerk| self.leg(time, jerk * sign));
                (u, 0.0, None)
            }
            Peak::Cruise => {
                rise(v, a, highest, bounds, |time, jerk| self.leg(time, jerk * sign));
                (highest, 0.0, Some(highest * sign * self.jerk))
            }
        };
        if last == 0.0 {
            self.stop(u, a, bounds, sign, cruise);
        } else {
            self.arrive(&Ramp::to(u - a * a * 0.5, a, last, sign, bounds), cruise);
        }
    }
}
