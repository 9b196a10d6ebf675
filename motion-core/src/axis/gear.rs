//! Gearing: an axis goes along with an actual value input, in a ratio.
//!
//! The way of a geared axis is the sum of two: the master's increments times the ratio, exact and from the
//! first cycle on, and a relative way of the set value generator, which begins with the difference of both
//! velocities and brakes to nothing within the axis' limits of acceleration and jerk. When that has ended
//! the axis is in gear. So the readings' noise neither delays it nor adds up.

use lb2::code::Failure;

use super::settings::Mode;
use super::{Axis, Brake, Motion};
use crate::application::{MotionError, Progress};
use crate::control::{ActualSource, AxisOutput};
use crate::failure::READING_LOST;
use crate::input::{ActualValue, Reading};
use crate::trajectory::{Goal, Limits, State};

/// What an axis is geared to, and what the master does in this cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Gear {
    /// Actual value input, 1…6.
    master: u8,
    numerator: i32,
    denominator: u32,
    /// The master's position in this cycle.
    position: i32,
    /// The master's way to there, times the numerator; its calibration is none.
    way: i64,
    /// What failed of the master; to go on without it is to go blindly.
    failure: Option<Failure>,
    /// What is left of the axis' way, in parts of a unit by `denominator`.
    rest: u32,
    /// The axis' velocity by the way that it has gone along last, units/s.
    velocity: f64,
}

impl Gear {
    /// Begins with what the master does in this cycle of `time` seconds.
    fn new((master, numerator, denominator): (u8, i32, u32), inputs: &[ActualValue; 6], time: f64) -> Self {
        let value = value(master, inputs);
        let way = libm::round(f64::from(value.velocity) * time) as i32;
        let position = value.position.wrapping_sub(value.shift).wrapping_sub(way);
        let (failure, rest, velocity) = (None, 0, 0.0);
        let mut gear = Self { master, numerator, denominator, position, way: 0, failure, rest, velocity };
        gear.look(inputs);
        gear.velocity = gear.velocity_now(time);
        gear
    }

    /// Looks at the master: once a cycle.
    fn look(&mut self, inputs: &[ActualValue; 6]) {
        let master = value(self.master, inputs);
        let moved = master.position.wrapping_sub(self.position).wrapping_sub(master.shift);
        self.position = master.position;
        self.way = i64::from(moved) * i64::from(self.numerator);
        let lost = matches!(master.reading, Reading::None | Reading::Lost);
        self.failure = master.failure.or_else(|| lost.then_some(READING_LOST));
    }

    /// Velocity by what the master does in this cycle, units/s.
    fn velocity_now(&self, time: f64) -> f64 {
        self.way as f64 / f64::from(self.denominator) / time
    }

    /// Goes along: the whole units that the axis goes.
    fn follow(&mut self, time: f64) -> f64 {
        self.velocity = self.velocity_now(time);
        let denominator = i64::from(self.denominator);
        // At most 2^62 + 2^32.
        let way = i64::from(self.rest) + self.way;
        self.rest = way.rem_euclid(denominator) as u32;
        way.div_euclid(denominator) as f64
    }

    /// Velocity that the axis has by it, units/s.
    pub(super) const fn velocity(&self) -> f64 {
        self.velocity
    }
}

/// The value of an input, 1…6.
fn value(input: u8, inputs: &[ActualValue; 6]) -> ActualValue {
    let place = usize::from(input).checked_sub(1);
    place.and_then(|place| inputs.get(place)).copied().unwrap_or_default()
}

impl Axis {
    pub(super) fn look_at_master(&mut self, inputs: &[ActualValue; 6]) {
        if let Motion::Gear(gear) = &mut self.motion {
            gear.look(inputs);
        }
    }

    pub(super) fn begin_gear(
        &mut self,
        (master, numerator, denominator): (u8, i32, u32),
        inputs: &[ActualValue; 6],
    ) -> Result<(), MotionError> {
        let limits = self.gear_limits().ok_or(MotionError::NOT_CONFIGURED)?;
        let itself = self.settings.source == ActualSource::from_choice(master.into());
        if !(1..=6).contains(&master) || itself || numerator == 0 || denominator == 0 {
            return Err(MotionError::RANGE);
        }
        let gear = Gear::new((master, numerator, denominator), inputs, self.seconds());
        if let Some(failure) = gear.failure {
            return Err(MotionError::from_failure(failure));
        }
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

    /// Velocity that the set values are about to have, units/s.
    pub(super) fn velocity_now(&self) -> f64 {
        let own = self.generator.state().velocity;
        let Motion::Gear(gear) = self.motion else { return own };
        own + gear.velocity_now(self.seconds())
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
    pub(super) fn begin_gear_out(&mut self, output: &mut AxisOutput) -> Result<(), MotionError> {
        let (Motion::Gear(_), Some(limits)) = (self.motion, self.settings.limits) else {
            return Err(MotionError::NOT_GEARED);
        };
        self.disengage();
        let most = self.settings.maximum;
        let velocity = self.generator.state().velocity.clamp(-most, most);
        self.generator.go(Goal::Velocity(velocity), limits).map_err(|_| MotionError::RANGE)?;
        if velocity == 0.0 {
            self.motion = Motion::Braking { stop: false };
        } else {
            self.motion = Motion::Velocity { velocity, fast: false };
            output.ended = Some(Progress::Done);
        }
        Ok(())
    }

    /// The set values' way in this cycle, units.
    pub(super) fn advance(&mut self) -> f64 {
        let time = self.seconds();
        let own = self.generator.step(time).position - self.set;
        let Motion::Gear(gear) = &mut self.motion else { return own };
        let way = gear.follow(time);
        // What is told to the drive is not rounded to units.
        let told = own + gear.velocity * time;
        self.generator.shift(way);
        told
    }

    /// Until the brake is open the axis stands, and the master goes on.
    pub(super) fn wait_for_brake(&mut self) {
        if let (Motion::Gear(mut gear), Some(limits)) = (self.motion, self.settings.limits) {
            gear.velocity = gear.velocity_now(self.seconds());
            _ = self.generator.set_state(State::at_rest(self.set));
            self.engage(&gear, limits);
            self.motion = Motion::Gear(gear);
        }
    }

    /// What ends gearing by itself: the master's failure, or a master that goes faster than the axis may,
    /// which is then off its set values.
    pub(super) fn gear_failure(&self) -> Option<Failure> {
        let Motion::Gear(gear) = self.motion else { return None };
        let most = self.settings.maximum;
        match self.velocity_now() {
            _ if gear.failure.is_some() => gear.failure,
            _ if matches!(self.brake, Brake::Opening(_)) => None,
            velocity if velocity > most => Some(Failure::DELTA_S_MAX),
            velocity if velocity < -most => Some(Failure::DELTA_S_MIN),
            _ => None,
        }
    }
}
