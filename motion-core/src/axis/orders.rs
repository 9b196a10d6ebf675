//! Orders: what is checked, and how they begin.

use super::settings::{Calibration, JogVelocities, Mode};
use super::{Axis, Home, Motion};
use crate::application::{MotionError, Order};
use crate::control::{ActualSource, AxisOutput};
use crate::failure::READING_LOST;
use crate::input::{ActualValue, Reading};
use crate::trajectory::Goal;

impl Axis {
    /// Begins an order, or refuses it; a motion under way then goes on.
    pub(super) fn order(&mut self, order: Order, inputs: &[ActualValue; 6], output: &mut AxisOutput) {
        output.refused = self.begin(order, inputs, output).err();
    }

    fn begin(
        &mut self,
        order: Order,
        inputs: &[ActualValue; 6],
        output: &mut AxisOutput,
    ) -> Result<(), MotionError> {
        if !self.powered {
            return Err(MotionError::NOT_ENABLED);
        }
        if self.settings.mode == Mode::None || self.settings.source == ActualSource::None {
            return Err(MotionError::NOT_CONFIGURED);
        }
        if let Order::Halt | Order::Stop = order {
            if self.motion == Motion::Failed {
                return Err(self.error);
            }
            let stop = order == Order::Stop;
            if stop {
                self.brake_hard();
            } else {
                self.brake_softly();
            }
            self.motion = Motion::Braking { stop };
            (self.nominal, self.at_target) = (None, false);
            return Ok(());
        }
        if self.error != MotionError::NONE && !self.error.is_limit() {
            return Err(MotionError::IN_ERROR);
        }
        if self.motion == Motion::Failed && !self.stands() {
            return Err(self.error);
        }
        if self.reading == Reading::None {
            return Err(MotionError::from_failure(READING_LOST));
        }
        match order {
            Order::MoveAbsolute { position, velocity } => self.begin_position(i64::from(position), velocity),
            Order::MoveRelative { distance, velocity } => {
                let from = match (self.nominal, self.motion) {
                    (Some(nominal), _) => nominal,
                    (None, Motion::Position { target, .. }) => target,
                    _ => super::rounded(self.generator.state().position),
                };
                self.begin_position(i64::from(from) + i64::from(distance), velocity)
            }
            Order::MoveVelocity { velocity } => {
                let fast = self.settings.jogs.fast_jog;
                self.begin_velocity(f64::from(velocity), fast, true)
            }
            Order::Jog { forward, fast } => {
                let forward = forward != self.settings.jog_swapped;
                let side = usize::from(!forward);
                let JogVelocities { slow, fast: quick } =
                    self.settings.jog.get(side).copied().unwrap_or_default();
                let speed = match self.settings.mode {
                    Mode::Signals => 1.0,
                    _ if fast => f64::from(quick),
                    _ => f64::from(slow),
                };
                let velocity = if forward { speed } else { -speed };
                let fast = fast && self.settings.jogs.fast_jog;
                self.begin_velocity(velocity, fast, self.settings.control_jog)
            }
            Order::Home => self.begin_home(),
            Order::GearIn { master, numerator, denominator } => {
                self.begin_gear((master, numerator, denominator), inputs)
            }
            Order::GearOut => self.begin_gear_out(output),
            Order::Halt | Order::Stop => Ok(()),
        }
    }

    /// To a position; the tool correction `[720]` is added to it (project-defined).
    fn begin_position(&mut self, position: i64, velocity: Option<u32>) -> Result<(), MotionError> {
        let target = position + i64::from(self.settings.tool);
        let target = i32::try_from(target).map_err(|_| MotionError::RANGE)?;
        self.admit(i64::from(target) - i64::from(self.actual))?;
        let velocity = velocity.map_or(self.settings.working, f64::from);
        if self.settings.mode != Mode::Signals {
            let limits = self.settings.limits.ok_or(MotionError::NOT_CONFIGURED)?;
            if velocity > self.settings.maximum {
                return Err(MotionError::RANGE);
            }
            let limits = limits.with_velocity(velocity).map_err(|_| MotionError::RANGE)?;
            self.take_over();
            if self.settings.mode == Mode::Control {
                let goal = Goal::Position(f64::from(target));
                self.generator.go(goal, limits).map_err(|_| MotionError::RANGE)?;
            }
        }
        self.start(Motion::Position { target, velocity }, true);
        Ok(())
    }

    fn begin_velocity(&mut self, velocity: f64, fast: bool, controlled: bool) -> Result<(), MotionError> {
        if velocity == 0.0 {
            return Err(MotionError::NOT_CONFIGURED);
        }
        self.admit(if velocity > 0.0 { 1 } else { -1 })?;
        self.reach_velocity(velocity)?;
        self.start(Motion::Velocity { velocity, fast }, controlled);
        Ok(())
    }

    /// The set values towards a velocity; nothing where signals do it.
    fn reach_velocity(&mut self, velocity: f64) -> Result<(), MotionError> {
        if self.settings.mode == Mode::Signals {
            return Ok(());
        }
        let limits = self.settings.limits.ok_or(MotionError::NOT_CONFIGURED)?;
        if velocity.abs() > self.settings.maximum {
            return Err(MotionError::RANGE);
        }
        self.take_over();
        self.generator.go(Goal::Velocity(velocity), limits).map_err(|_| MotionError::RANGE)
    }

    /// With V1 to the turning point, if there is one and the axis is not there; else with V2 at once.
    fn begin_home(&mut self) -> Result<(), MotionError> {
        let forward = match self.settings.calibration {
            Calibration::None => return Err(MotionError::NOT_CONFIGURED),
            Calibration::Forward => true,
            Calibration::Backward => false,
        };
        let side = usize::from(forward);
        let turns = self.settings.ends.get(side).is_some_and(|end| end.switch.is_some());
        let there = self.limits.get(side).copied().flatten().is_some();
        let home = if turns && !there { Home::Turning } else { Home::Referencing };
        let velocities = (self.settings.calibration_fast, self.settings.calibration_slow);
        if self.settings.mode != Mode::Signals && (velocities.0 == 0 || velocities.1 == 0) {
            return Err(MotionError::NOT_CONFIGURED);
        }
        self.admit(if forward == (home == Home::Referencing) { 1 } else { -1 })?;
        self.reach_velocity(self.home_velocity(home))?;
        self.start(Motion::Home(home), self.settings.control_calibration);
        Ok(())
    }

    /// Velocity of an automatic calibration.
    pub(super) fn home_velocity(&self, home: Home) -> f64 {
        let forward = self.settings.calibration == Calibration::Forward;
        let speed = match home {
            Home::Turning => -f64::from(self.settings.calibration_fast),
            Home::Referencing => f64::from(self.settings.calibration_slow),
            Home::Found => 0.0,
        };
        if forward { speed } else { -speed }
    }

    /// Turns at the turning point, stops at the reference point.
    pub(super) fn follow_home(&mut self, turned: bool, calibrated: bool) {
        let next = match self.motion {
            Motion::Home(Home::Turning) if turned => Home::Referencing,
            Motion::Home(Home::Referencing) if calibrated => Home::Found,
            _ => return,
        };
        self.motion = Motion::Home(next);
        if next == Home::Found {
            self.brake_softly();
        } else {
            // Checked when the calibration began.
            _ = self.reach_velocity(self.home_velocity(next));
        }
    }

    /// Only orders that lead off a limit switch are carried out while it is reached (6.8.1.1).
    pub(super) fn admit(&self, way: i64) -> Result<(), MotionError> {
        let [upper, lower] = self.limits;
        match (way, upper, lower) {
            (0.., Some(failure), _) | (..=0, _, Some(failure)) => Err(MotionError::from_failure(failure)),
            _ => Ok(()),
        }
    }

    pub(super) fn start(&mut self, motion: Motion, controlled: bool) {
        self.motion = motion;
        self.controlled = controlled;
        (self.nominal, self.at_target) = (None, false);
        self.open_brake();
    }

    /// Where the position was not controlled, the set values begin where the axis is; where it was geared,
    /// with its velocity.
    pub(super) fn take_over(&mut self) {
        self.disengage();
        if self.motion == Motion::Failed || self.motion == Motion::Idle && !self.feeds_back() {
            self.settle();
        }
    }

    /// Stops with the greatest deceleration.
    pub(super) fn brake_hard(&mut self) {
        self.brake_within(self.settings.hardest);
    }

    /// Stops with the working deceleration.
    pub(super) fn brake_softly(&mut self) {
        self.brake_within(self.settings.limits);
    }

    /// Stops within these limits; at once where there are none.
    pub(super) fn brake_within(&mut self, limits: Option<crate::trajectory::Limits>) {
        self.disengage();
        let stopped = limits.is_some_and(|limits| self.generator.go(Goal::Velocity(0.0), limits).is_ok());
        if !stopped {
            self.settle();
        }
    }
}
