//! Set values cycle by cycle, with changes on the way.

use super::limits::Limits;
use super::profile::{PlanError, Profile, State};

/// What a generator is on its way to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// A standstill at this position, units.
    Position(f64),
    /// This velocity, units/s; 0 is a stop.
    Velocity(f64),
}

/// Follows the fastest way to its goal, and plans anew from wherever it is when the goal or the limits
/// change.
#[derive(Debug, Clone)]
pub struct Generator {
    profile: Profile,
    cursor: usize,
    time: f64,
    state: State,
    limits: Limits,
    /// What the present way was planned with.
    planned: Limits,
    goal: Goal,
}

impl Generator {
    /// Standing at a position.
    #[must_use]
    pub fn new(position: f64, limits: Limits) -> Self {
        Self {
            profile: Profile::at_rest(position),
            cursor: 0,
            time: 0.0,
            state: State::at_rest(position),
            limits,
            planned: limits,
            goal: Goal::Velocity(0.0),
        }
    }

    /// The present set values.
    #[must_use]
    pub const fn state(&self) -> State {
        self.state
    }

    /// What it is on its way to.
    #[must_use]
    pub const fn goal(&self) -> Goal {
        self.goal
    }

    /// The limits set last.
    #[must_use]
    pub const fn limits(&self) -> Limits {
        self.limits
    }

    /// The way it is on, beginning where the goal or the limits were changed last.
    #[must_use]
    pub const fn profile(&self) -> &Profile {
        &self.profile
    }

    /// Time left until the goal is reached, s.
    #[must_use]
    pub fn remaining(&self) -> f64 {
        (self.profile.duration() - self.time).max(0.0)
    }

    /// Whether the goal is reached.
    #[must_use]
    pub fn arrived(&self) -> bool {
        self.time >= self.profile.duration()
    }

    /// Whether the present way goes beyond its target and returns, because no braking within the
    /// limits can end before it.
    #[must_use]
    pub const fn overshoots(&self) -> bool {
        self.profile.overshoots()
    }

    /// On for `time` seconds: the set values then.
    #[inline]
    pub fn step(&mut self, time: f64) -> State {
        self.time += time.max(0.0);
        self.state = self.profile.at_from(self.time, &mut self.cursor);
        self.state
    }

    /// Another goal, from here.
    ///
    /// # Errors
    /// [`PlanError`]: the goal is out of range; the old one stays.
    pub fn set_goal(&mut self, goal: Goal) -> Result<(), PlanError> {
        let limits = self.limits;
        self.plan(goal, &limits)?;
        self.goal = goal;
        Ok(())
    }

    /// Other limits, from here. If with them the axis could no longer stop before its target, but
    /// can with those of before, it goes on braking with those of before: a lowered limit never
    /// carries an axis beyond its target. [`Generator::overshoots`] tells where nothing could
    /// prevent it.
    ///
    /// # Errors
    /// [`PlanError`]: the goal's velocity is above the new limit; limits and way stay.
    pub fn set_limits(&mut self, limits: Limits) -> Result<(), PlanError> {
        let before = self.planned;
        let was_overshooting = self.profile.overshoots();
        self.plan(self.goal, &limits)?;
        if self.profile.overshoots() && !was_overshooting {
            self.plan(self.goal, &limits.braking_as(&before))?;
        }
        self.limits = limits;
        Ok(())
    }

    /// Another goal within other limits, from here.
    ///
    /// # Errors
    /// [`PlanError`]: the goal is out of range; the old one stays, and the old limits.
    pub fn go(&mut self, goal: Goal, limits: Limits) -> Result<(), PlanError> {
        self.plan(goal, &limits)?;
        (self.goal, self.limits) = (goal, limits);
        Ok(())
    }

    /// Moves the scale of positions: state, way and goal, by `distance`, units.
    pub fn shift(&mut self, distance: f64) {
        self.profile.shift(distance);
        self.state.position += distance;
        if let Goal::Position(target) = &mut self.goal {
            *target += distance;
        }
    }

    /// Sets the state of motion, as when control takes over a moving axis, and stops from there.
    ///
    /// # Errors
    /// [`PlanError`]: the state is out of range; the old one stays.
    pub fn set_state(&mut self, state: State) -> Result<(), PlanError> {
        let mut profile = Profile::at_rest(state.position);
        profile.stop(&state, &self.limits)?;
        self.profile = profile;
        self.planned = self.limits;
        self.goal = Goal::Velocity(0.0);
        self.begin(state);
        Ok(())
    }

    fn plan(&mut self, goal: Goal, limits: &Limits) -> Result<(), PlanError> {
        let from = self.state;
        match goal {
            Goal::Position(target) => self.profile.move_to(&from, limits, target)?,
            Goal::Velocity(velocity) => self.profile.reach(&from, limits, velocity)?,
        }
        self.planned = *limits;
        self.begin(from);
        Ok(())
    }

    fn begin(&mut self, state: State) {
        self.state = state;
        self.cursor = 0;
        self.time = 0.0;
    }
}
