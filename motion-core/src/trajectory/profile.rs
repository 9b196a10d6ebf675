//! A planned way, to be read at any time.

use super::limits::Limits;

/// Most stretches of constant jerk that a way can have: two back inside the limits, five up, one with
/// constant velocity, five down.
pub const MAX_PHASES: usize = 13;

/// Positions up to ±2^53 are whole numbers in `f64`.
const MAX_POSITION: f64 = 9_007_199_254_740_992.0;
/// Multiplied by, for a division costs as much as ten multiplications.
pub(super) const SIXTH: f64 = 1.0 / 6.0;
/// Greatest velocity and acceleration of a start; project-defined, far beyond any axis.
const MAX_MOTION: f64 = 1e18;

/// Position, velocity and acceleration of an axis at one time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct State {
    /// Units.
    pub position: f64,
    /// Units/s.
    pub velocity: f64,
    /// Units/s².
    pub acceleration: f64,
}

impl State {
    /// Standing still at a position.
    #[must_use]
    pub const fn at_rest(position: f64) -> Self {
        Self { position, velocity: 0.0, acceleration: 0.0 }
    }
}

/// A stretch of constant jerk.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Phase {
    /// When it begins, s since the profile's start.
    pub begin: f64,
    /// Position at its begin, units from the profile's start, or, after the peak, from its target.
    pub position: f64,
    /// Velocity at its begin, units/s.
    pub velocity: f64,
    /// Acceleration at its begin, units/s².
    pub acceleration: f64,
    /// Jerk, units/s³.
    pub jerk: f64,
}

impl Phase {
    /// The state `time` seconds after its begin, its position relative to the same point.
    #[must_use]
    #[inline]
    pub fn after(&self, time: f64) -> State {
        State {
            position: self.position
                + time * (self.velocity + time * (self.acceleration / 2.0 + time * (self.jerk * SIXTH))),
            velocity: self.velocity + time * (self.acceleration + time * (self.jerk / 2.0)),
            acceleration: self.acceleration + time * self.jerk,
        }
    }
}

/// A state or target that no way can be computed for.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// A position beyond ±2^53, a velocity or acceleration beyond ±1e18, or not a number.
    #[error("{name} {value} is not a number within ±{most:e}")]
    Range {
        /// What the number is.
        name: &'static str,
        /// The number.
        value: f64,
        /// The greatest that is taken.
        most: f64,
    },
    /// The target velocity is above the limit.
    #[error("target velocity {velocity} units/s is above the limit of {limit} units/s")]
    Velocity {
        /// The target velocity, units/s.
        velocity: f64,
        /// The highest velocity, units/s.
        limit: f64,
    },
    /// Start and limits are so far apart that the way is no number any more.
    #[error("start and limits are too far apart: the way cannot be computed")]
    Overflow,
}

/// A way of one axis: the fastest within its limits.
#[derive(Debug, Clone)]
pub struct Profile {
    pub(super) phases: [Phase; MAX_PHASES],
    pub(super) len: u8,
    /// First phase whose position counts from the target.
    pub(super) tail: u8,
    pub(super) start: f64,
    pub(super) end: State,
    pub(super) duration: f64,
    pub(super) overshoots: bool,
}

impl Profile {
    /// No motion: standing at a position.
    #[must_use]
    pub const fn at_rest(position: f64) -> Self {
        let phase = Phase { begin: 0.0, position: 0.0, velocity: 0.0, acceleration: 0.0, jerk: 0.0 };
        Self {
            phases: [phase; MAX_PHASES],
            len: 0,
            tail: 0,
            start: position,
            end: State::at_rest(position),
            duration: 0.0,
            overshoots: false,
        }
    }

    /// Plans the fastest way from a state to a standstill at `target`.
    ///
    /// # Errors
    /// [`PlanError`]; the profile is left as it was, except after [`PlanError::Overflow`], which leaves
    /// it standing at the start.
    pub fn move_to(&mut self, from: &State, limits: &Limits, target: f64) -> Result<(), PlanError> {
        self.pass(from, limits, target, 0.0)
    }

    /// Plans the fastest way from a state to `target`, reached with `velocity` and without acceleration;
    /// afterwards the velocity stays.
    ///
    /// # Errors
    /// As [`Profile::move_to`], and if `velocity` is above the limit.
    pub fn pass(
        &mut self,
        from: &State,
        limits: &Limits,
        target: f64,
        velocity: f64,
    ) -> Result<(), PlanError> {
        check_state(from)?;
        check("target position", target, MAX_POSITION)?;
        check_velocity(velocity, limits)?;
        self.begin(from);
        if limits.jerk().is_finite() {
            self.plan_position(from, limits, target, velocity);
        } else {
            self.trapezoid_position(from, limits, target, velocity);
        }
        self.finish(from)
    }

    /// Plans the fastest way from a state to a velocity, wherever that is reached; afterwards the
    /// velocity stays.
    ///
    /// # Errors
    /// As [`Profile::pass`].
    pub fn reach(&mut self, from: &State, limits: &Limits, velocity: f64) -> Result<(), PlanError> {
        check_state(from)?;
        check_velocity(velocity, limits)?;
        self.begin(from);
        if limits.jerk().is_finite() {
            self.plan_velocity(from, limits, velocity);
        } else {
            self.trapezoid_velocity(from, limits, velocity);
        }
        self.finish(from)
    }

    /// Plans the fastest stop.
    ///
    /// # Errors
    /// As [`Profile::move_to`].
    pub fn stop(&mut self, from: &State, limits: &Limits) -> Result<(), PlanError> {
        self.reach(from, limits, 0.0)
    }

    pub(super) fn shift(&mut self, distance: f64) {
        self.start += distance;
        self.end.position += distance;
    }

    fn begin(&mut self, from: &State) {
        self.len = 0;
        self.tail = MAX_PHASES as u8;
        self.start = from.position;
        self.duration = 0.0;
        self.overshoots = false;
    }

    fn finish(&mut self, from: &State) -> Result<(), PlanError> {
        if self.duration.is_finite() && self.end.position.is_finite() {
            Ok(())
        } else {
            *self = Self::at_rest(from.position);
            Err(PlanError::Overflow)
        }
    }

    /// When the end is reached, s after the start.
    #[must_use]
    pub const fn duration(&self) -> f64 {
        self.duration
    }

    /// The state at the end. Its position is the target, exactly.
    #[must_use]
    pub const fn end(&self) -> State {
        self.end
    }

    /// Whether the way leads beyond its target and comes back to it from the other side, because no
    /// braking within the limits can end before it.
    #[must_use]
    pub const fn overshoots(&self) -> bool {
        self.overshoots
    }

    /// The stretches of constant jerk, in order.
    #[must_use]
    pub fn phases(&self) -> &[Phase] {
        self.phases.get(..usize::from(self.len)).unwrap_or(&[])
    }

    /// What a phase's positions count from: the start, or after the peak the target.
    #[must_use]
    pub fn origin(&self, phase: usize) -> f64 {
        if phase < usize::from(self.tail) { self.start } else { self.end.position }
    }

    /// The state at a time, s after the start. Before the start it is that of the start; after the
    /// end the velocity stays that of the end.
    #[must_use]
    pub fn at(&self, time: f64) -> State {
        let mut cursor = 0;
        self.at_from(time, &mut cursor)
    }

    /// As [`Profile::at`], beginning the search at the phase `cursor`, which moves with the time.
    #[must_use]
    #[inline]
    pub(super) fn at_from(&self, time: f64, cursor: &mut usize) -> State {
        if time >= self.duration {
            let end = self.end;
            let position = if end.velocity == 0.0 {
                end.position
            } else {
                end.position + end.velocity * (time - self.duration)
            };
            return State { position, ..end };
        }
        while let Some(next) = self.phases().get(*cursor + 1)
            && next.begin <= time
        {
            *cursor += 1;
        }
        let phase = self.phases().get(*cursor).copied().unwrap_or_default();
        let state = phase.after((time - phase.begin).max(0.0));
        State { position: self.origin(*cursor) + state.position, ..state }
    }
}

fn check(name: &'static str, value: f64, most: f64) -> Result<(), PlanError> {
    if value.abs() <= most { Ok(()) } else { Err(PlanError::Range { name, value, most }) }
}

fn check_state(state: &State) -> Result<(), PlanError> {
    check("position", state.position, MAX_POSITION)?;
    check("velocity", state.velocity, MAX_MOTION)?;
    check("acceleration", state.acceleration, MAX_MOTION)
}

fn check_velocity(velocity: f64, limits: &Limits) -> Result<(), PlanError> {
    check("target velocity", velocity, MAX_MOTION)?;
    if velocity.abs() <= limits.velocity() {
        Ok(())
    } else {
        Err(PlanError::Velocity { velocity, limit: limits.velocity() })
    }
}
