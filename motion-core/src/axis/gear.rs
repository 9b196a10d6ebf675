//! Gearing: an axis goes along with an actual value input, in a ratio.
//!
//! The way of a geared axis is the sum of two: the master's increments times the ratio, exact and from the
//! first cycle on, and a relative way of the set value generator, which begins with the difference of both
//! velocities and brakes to nothing within the axis' limits of acceleration and jerk. When that has ended
//! the axis is in gear. So the readings' noise neither delays it nor adds up.

use lb2::code::Failure;

use super::settings::Mode;
use super::{Axis, Brake, Motion};
use crate::application::MotionError;
use crate::failure::READING_LOST;
use crate::input::{ActualValue, Reading};
use crate::trajectory::{Goal, Limits, State};

/// What an axis is geared to, and how far it has come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Gear {
    /// Actual value input, 1…6.
    master: u8,
    numerator: i32,
    denominator: u32,
    /// The master's position up to which the axis has gone along.
    last: i32,
    /// What is left of its way, in parts of a unit by `denominator`.
    rest: u32,
    /// The master's velocity over the last cycle times the ratio, units/s.
    velocity: f64,
}

impl Gear {
    fn master(&self, inputs: &[ActualValue; 6]) -> ActualValue {
        let place = usize::from(self.master).checked_sub(1);
        place.and_then(|place| inputs.get(place)).copied().unwrap_or_default()
    }

    /// Begins with what the master does in this cycle of `time` seconds.
    fn begin(&mut self, inputs: &[ActualValue; 6], time: f64) {
        let master = self.master(inputs);
        let way = libm::round(f64::from(master.velocity) * time) as i32;
        (self.last, self.rest) = (master.position.wrapping_sub(master.shift).wrapping_sub(way), 0);
        self.velocity = self.velocity_now(inputs, time);
    }

    /// The master's way that the axis has not gone along, times the numerator; its calibration is none.
    fn way(&self, inputs: &[ActualValue; 6]) -> i64 {
        let master = self.master(inputs);
        let moved = master.position.wrapping_sub(self.last).wrapping_sub(master.shift);
        i64::from(moved) * i64::from(self.numerator)
    }

    /// Velocity by what the master does in this cycle, units/s.
    fn velocity_now(&self, inputs: &[ActualValue; 6], time: f64) -> f64 {
        self.way(inputs) as f64 / f64::from(self.denominator) / time
    }

    /// Goes along: the whole units that the axis goes.
    fn follow(&mut self, inputs: &[ActualValue; 6], time: f64) -> f64 {
        self.velocity = self.velocity_now(inputs, time);
        let denominator = i64::from(self.denominator);
        // At most 2^62 + 2^32.
        let way = i64::from(self.rest) + self.way(inputs);
        self.last = self.master(inputs).position;
        self.rest = way.rem_euclid(denominator) as u32;
        way.div_euclid(denominator) as f64
    }

    /// What failed of the master; to go on without it is to go blindly.
    fn failure(&self, inputs: &[ActualValue; 6]) -> Option<Failure> {
        let master = self.master(inputs);
        let lost = matches!(master.reading, Reading::None | Reading::Lost);
        master.failure.or_else(|| lost.then_some(READING_LOST))
    }

    /// Velocity that the axis has by it, units/s.
    pub(super) const fn velocity(&self) -> f64 {
        self.velocity
    }
}

impl Axis {
    pub(super) fn begin_gear(
        &mut self,
        (master, numerator, denominator): (u8, i32, u32),
        inputs: &[ActualValue; 6],
    ) -> Result<(), MotionError> {
        let limits = self.gear_limits().ok_or(MotionError::NOT_CONFIGURED)?;
        let itself = self.settings.input == Some(master);
        if !(1..=6).contains(&master) || itself || numerator == 0 || denominator == 0 {
            return Err(MotionError::RANGE);
        }
        let mut gear = Gear { master, numerator, denominator, last: 0, rest: 0, velocity: 0.0 };
        if let Some(failure) = gear.failure(inputs) {
            return Err(MotionError::from_failure(failure));
        }
        gear.begin(inputs, self.seconds());
        if gear.velocity.abs() > self.settings.maximum {
            return Err(MotionError::RANGE);
        }
        if gear.velocity != 0.0 {
            self.admit(if gear.velocity > 0.0 { 1 } else { -1 })?;
        }
        self.take_over();
        self.engage(&gear, limits);
        self.start(Motion::Gear(gear), true);
        Ok(())
    }

    /// Within which it gets in gear and out; `None` where it cannot be geared.
    pub(super) fn gear_limits(&self) -> Option<Limits> {
        self.settings.limits.filter(|_| self.settings.mode == Mode::Control)
    }

    /// Length of a cycle, s.
    fn seconds(&self) -> f64 {
        f64::from(self.cycle) / 1000.0
    }

    /// Velocity that the set values are about to have, units/s.
    pub(super) fn velocity_now(&self, inputs: &[ActualValue; 6]) -> f64 {
        let own = self.generator.state().velocity;
        let Motion::Gear(gear) = self.motion else { return own };
        own + gear.velocity_now(inputs, self.seconds())
    }

    /// The generator's way is relative to the master from here on.
    fn engage(&mut self, gear: &Gear, limits: Limits) {
        let state = self.generator.state();
        // Brakes and accelerates alike: in the relative way one may be the other.
        let rate = limits.acceleration().min(limits.deceleration());
        let limits = Limits::new(limits.velocity(), rate, rate, limits.jerk()).unwrap_or(limits);
        // In range: velocities are at most twice the greatest.
        _ = self.generator.set_state(State { velocity: state.velocity - gear.velocity, ..state });
        _ = self.generator.go(Goal::Velocity(0.0), limits);
    }

    /// The generator's way is the axis' again, which goes on with its velocity.
    pub(super) fn disengage(&mut self) {
        if let Motion::Gear(gear) = self.motion {
            let state = self.generator.state();
            let velocity = state.velocity + gear.velocity;
            _ = self.generator.set_state(State { velocity, ..state });
            self.motion = Motion::Velocity { velocity, fast: false };
        }
    }

    /// Goes on with the velocity that it has, or stops where it has none.
    pub(super) fn begin_gear_out(&mut self) -> Result<(), MotionError> {
        let (Motion::Gear(_), Some(limits)) = (self.motion, self.settings.limits) else {
            return Err(MotionError::NOT_GEARED);
        };
        self.disengage();
        let most = self.settings.maximum;
        let velocity = self.generator.state().velocity.clamp(-most, most);
        self.generator.go(Goal::Velocity(velocity), limits).map_err(|_| MotionError::RANGE)?;
        self.motion = if velocity == 0.0 {
            Motion::Braking { stop: false }
        } else {
            Motion::Velocity { velocity, fast: false }
        };
        Ok(())
    }

    /// The set values' way in a cycle of `time` seconds, units.
    pub(super) fn advance(&mut self, time: f64, inputs: &[ActualValue; 6]) -> f64 {
        let own = self.generator.step(time).position - self.set;
        let Motion::Gear(gear) = &mut self.motion else { return own };
        let way = gear.follow(inputs, time);
        // What is told to the drive is not rounded to units.
        let told = own + gear.velocity * time;
        self.generator.shift(way);
        told
    }

    /// Until the brake is open the axis stands, and the master goes on.
    pub(super) fn wait_for_brake(&mut self, inputs: &[ActualValue; 6]) {
        if let (Motion::Gear(mut gear), Some(limits)) = (self.motion, self.settings.limits) {
            gear.begin(inputs, self.seconds());
            gear.last = gear.master(inputs).position;
            _ = self.generator.set_state(State::at_rest(self.set));
            self.engage(&gear, limits);
            self.motion = Motion::Gear(gear);
        }
    }

    /// What ends gearing by itself: the master's failure, or a master that goes faster than the axis may,
    /// which is then off its set values.
    pub(super) fn gear_failure(&self, inputs: &[ActualValue; 6]) -> Option<Failure> {
        let Motion::Gear(gear) = self.motion else { return None };
        if let Some(failure) = gear.failure(inputs) {
            return Some(failure);
        }
        let most = self.settings.maximum;
        match self.velocity_now(inputs) {
            _ if matches!(self.brake, Brake::Opening(_)) => None,
            velocity if velocity > most => Some(Failure::DELTA_S_MAX),
            velocity if velocity < -most => Some(Failure::DELTA_S_MIN),
            _ => None,
        }
    }
}
