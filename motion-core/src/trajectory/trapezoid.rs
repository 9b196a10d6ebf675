//! Ways without a limit of jerk: the acceleration may jump, so the start's does not matter.

use super::limits::Limits;
use super::math::sqrt;
use super::plan::{ROUNDING, TOUCH};
use super::profile::{Phase, Profile, State};

impl Profile {
    pub(super) fn trapezoid_velocity(&mut self, from: &State, limits: &Limits, velocity: f64) {
        let mut at = State { position: 0.0, acceleration: 0.0, ..*from };
        self.change(&mut at, velocity, limits);
        self.end = State { position: from.position + at.position, velocity, acceleration: 0.0 };
    }

    pub(super) fn trapezoid_position(&mut self, from: &State, limits: &Limits, target: f64, last: f64) {
        self.end = State { position: target, velocity: last, acceleration: 0.0 };
        let mut at = State { position: 0.0, acceleration: 0.0, ..*from };
        let way = target - from.position;
        let direct = change_way(at.velocity, last, limits);
        let rest = way - direct;
        let size = from.position.abs() + target.abs() + direct.abs();
        if rest.abs() <= ROUNDING * size {
            self.change(&mut at, last, limits);
            return;
        }
        self.overshoots = last == 0.0 && way * rest <= 0.0 && rest.abs() > TOUCH * size;
        let sign = 1.0_f64.copysign(rest);
        let highest = limits.velocity() * sign;
        if at.velocity * sign > limits.velocity() {
            self.change(&mut at, highest, limits);
        }
        // What squares of the peak velocity cost on the way up and down, and what is left for it.
        let (grow, fall) = (limits.acceleration(), limits.deceleration());
        let reach = |v: f64| if v * sign >= 0.0 { v * v / (2.0 * grow) } else { v * v / (2.0 * fall) };
        let leave = |v: f64| if v * sign >= 0.0 { v * v / (2.0 * fall) } else { v * v / (2.0 * grow) };
        let square =
            ((way - at.position) * sign + reach(at.velocity) + leave(last)) / (0.5 / grow + 0.5 / fall);
        let peak = sqrt(square).max(at.velocity * sign).max(last * sign);
        if peak < limits.velocity() {
            self.change(&mut at, peak * sign, limits);
        } else {
            self.change(&mut at, highest, limits);
            let gap = way - at.position - change_way(highest, last, limits);
            self.hold(&mut at, gap / highest, 0.0);
        }
        // Backward from the target, so that the last digits are its own.
        self.tail = self.len;
        let mut at = State { position: -change_way(at.velocity, last, limits), ..at };
        self.change(&mut at, last, limits);
    }

    /// Straight to another velocity, braking to 0 first where the sign changes.
    fn change(&mut self, at: &mut State, velocity: f64, limits: &Limits) {
        if at.velocity * velocity < 0.0 {
            self.change(at, 0.0, limits);
        }
        let change = velocity - at.velocity;
        let bound = bound(at.velocity, velocity, limits);
        self.hold(at, change.abs() / bound, bound.copysign(change));
        at.velocity = velocity;
    }

    fn hold(&mut self, at: &mut State, time: f64, acceleration: f64) {
        if time > 0.0 {
            let phase = Phase {
                begin: self.duration,
                position: at.position,
                velocity: at.velocity,
                acceleration,
                jerk: 0.0,
            };
            if let Some(slot) = self.phases.get_mut(usize::from(self.len)) {
                *slot = phase;
                self.len += 1;
            }
            self.duration += time;
            *at = phase.after(time);
        }
    }
}

fn bound(from: f64, to: f64, limits: &Limits) -> f64 {
    if to.abs() > from.abs() { limits.acceleration() } else { limits.deceleration() }
}

/// Way of the fastest change of velocity.
fn change_way(from: f64, to: f64, limits: &Limits) -> f64 {
    if from * to < 0.0 {
        return change_way(from, 0.0, limits) + change_way(0.0, to, limits);
    }
    let way = (to - from).abs() / bound(from, to, limits) * ((from + to) / 2.0);
    if way.is_nan() { f64::INFINITY } else { way }
}
