//! From limits and states to phases: normalises the problem, decides the direction, and integrates the
//! legs forward from the start and backward from the target, so that both ends are exact.

use super::limits::Limits;
use super::math::sqrt;
use super::profile::{Phase, Profile, State};
use super::ramp::{Bounds, Leg, Ramp, resting_velocity, restore};
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
    time: f64,
    /// Position from the start, velocity, acceleration.
    state: State,
}

impl Drive<'_> {
    #[inline]
    fn leg(&mut self, time: f64, jerk: f64) {
        if time > 0.0 {
            let phase = self.put(jerk * self.jerk);
            self.time += time;
            self.state = phase.after(time);
        }
    }

    #[inline]
    fn put(&mut self, jerk: f64) -> Phase {
        let State { position, velocity, acceleration } = self.state;
        let phase = Phase { begin: self.time, position, velocity, acceleration, jerk };
        push(self.profile, phase);
        phase
    }

    /// Constant velocity as long as it takes from here to the first leg of `tail`, then those legs,
    /// computed backward from the end.
    #[inline]
    fn arrive(&mut self, tail: &[Leg], cruise: Option<f64>) {
        let mut states = [State::default(); 6];
        let end = self.profile.end;
        let mut state = State { position: 0.0, ..end };
        for (leg, slot) in tail.iter().zip(&mut states).rev() {
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
        if let Some(velocity) = cruise {
            self.state.velocity = velocity;
            self.state.acceleration = 0.0;
            let gap = end.position - self.profile.start + (state.position - self.state.position);
            let time = gap / velocity;
            if time > 0.0 {
                self.put(0.0);
                self.time += time;
            }
        }
        self.profile.tail = self.profile.len;
        for (leg, state) in tail.iter().zip(&states) {
            self.state = *state;
            self.put(leg.jerk * self.jerk);
            self.time += leg.time;
        }
        self.profile.duration = self.time;
    }
}

#[inline]
pub(super) fn push(profile: &mut Profile, phase: Phase) {
    if let Some(slot) = profile.phases.get_mut(profile.len) {
        *slot = phase;
        profile.len += 1;
    }
}

#[inline]
fn normalise(limits: &Limits) -> (Bounds, f64) {
    let scale = 1.0 / limits.jerk();
    let bounds = Bounds {
        velocity: limits.velocity() * scale,
        grow: limits.acceleration() * scale,
        fall: limits.deceleration() * scale,
    };
    (bounds, scale)
}

impl Profile {
    /// Brings the acceleration back inside its bound; returns what the profile goes on with.
    #[inline]
    fn drive(&mut self, from: &State, jerk: f64, bounds: &Bounds) -> Drive<'_> {
        let scale = 1.0 / jerk;
        let state = State { position: 0.0, ..*from };
        let mut drive = Drive { profile: self, jerk, time: 0.0, state };
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
        let mut drive = self.drive(from, limits.jerk(), &bounds);
        drive.ramp(velocity, scale, &bounds);
        let position = from.position + drive.state.position;
        self.end = State { position, velocity, acceleration: 0.0 };
    }

    #[inline]
    pub(super) fn plan_position(&mut self, from: &State, limits: &Limits, target: f64, velocity: f64) {
        let (bounds, scale) = normalise(limits);
        self.end = State { position: target, velocity, acceleration: 0.0 };
        let mut drive = self.drive(from, limits.jerk(), &bounds);
        let (v, a) = (drive.state.velocity * scale, drive.state.acceleration * scale);
        let d = (target - from.position - drive.state.position) * scale;
        let last = velocity * scale;
        let resting = resting_velocity(v, a);
        // The way of going to the final velocity at once tells the direction.
        let (direct, size) = if last == 0.0 {
            let sign = 1.0_f64.copysign(resting);
            let (v, a) = (v * sign, a * sign);
            let way = solve::stop(v, a, bounds.fall) * sign;
            (way, solve::stopping_way(v + a * a / 2.0, bounds.fall))
        } else {
            let way = Ramp::to(v, a, last, &bounds).way(v, a);
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
        drive.push(1.0_f64.copysign(rest), scale, velocity, &bounds, way);
        // Braking so hard that it turns before it can be released, perhaps beyond the target.
        let start = resting_velocity(from.velocity * scale, from.acceleration * scale);
        if last == 0.0 && from.velocity * way > 0.0 && from.velocity * start < 0.0 {
            self.overshoots |= self.first_turn().is_some_and(|turn| turn.abs() > way.abs());
        }
    }

    /// Way until the velocity first changes its sign; `None` if it does not before the peak.
    fn first_turn(&self) -> Option<f64> {
        let phases = self.phases().get(..self.tail.min(self.len))?;
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
        for leg in Ramp::to(v, a, velocity * scale, bounds).legs() {
            self.leg(leg.time, leg.jerk);
        }
        self.profile.duration = self.time;
    }

    /// In the direction `sign` as far as can be, then to the end. `way` leads from the profile's start
    /// to its target.
    #[inline]
    fn push(&mut self, sign: f64, scale: f64, velocity: f64, bounds: &Bounds, way: f64) {
        let turn = sign * scale;
        let (mut v, mut a) = (self.state.velocity * turn, self.state.acceleration * turn);
        let last = velocity * turn;
        let highest = bounds.velocity;
        if resting_velocity(v, a) > highest {
            // Too fast: down towards the highest velocity, from where the braking may go on.
            let excess = v - highest + a * a / 2.0;
            let low = bounds.fall.min(sqrt(excess));
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
        match peak {
            Peak::Release(alpha) => {
                let time = alpha - a;
                self.leg(time, sign);
                let then = v + time * (a + time / 2.0);
                self.tail(then, alpha, last, sign, bounds, None);
            }
            Peak::Velocity(u) => {
                self.legs(&Ramp::to(v, a, u, bounds), sign);
                self.tail(u, 0.0, last, sign, bounds, None);
            }
            Peak::Cruise => {
                self.legs(&Ramp::to(v, a, highest, bounds), sign);
                let velocity = highest * sign * self.jerk;
                self.tail(highest, 0.0, last, sign, bounds, Some(velocity));
            }
        }
    }

    #[inline]
    fn legs(&mut self, ramp: &Ramp, sign: f64) {
        for leg in ramp.legs() {
            self.leg(leg.time, leg.jerk * sign);
        }
    }

    #[inline]
    fn tail(&mut self, v: f64, a: f64, last: f64, sign: f64, bounds: &Bounds, cruise: Option<f64>) {
        let mut ramp = Ramp::to(v, a, last, bounds);
        ramp.turn(sign);
        self.arrive(ramp.legs(), cruise);
    }
}
