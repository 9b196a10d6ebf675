//! What is watched in every cycle: failures, following error and limit switches, and what stops an axis.

use lb2::code::Failure;

use super::settings::{Calibration, Mode};
use super::{Axis, Motion};
use crate::application::{MotionError, Progress};
use crate::control::{AxisInput, AxisOutput, PlcStop};
use crate::failure::{HW_LIMIT_MINUS, HW_LIMIT_PLUS, READING_LOST, SW_LIMIT_MINUS, SW_LIMIT_PLUS};
use crate::input::Reading;

impl Axis {
    /// Tells a failure of the drive once, also of an axis that is not enabled.
    pub(super) fn watch_drive(&mut self, failure: Option<Failure>, output: &mut AxisOutput) {
        if core::mem::replace(&mut self.drive, failure) != failure {
            output.failure = failure;
        }
    }

    /// Failures of drive and input, following error, limit switches: all in the cycle in which they come.
    /// Without an actual value no axis stays enabled that had one, and none moves that had none.
    pub(super) fn watch(&mut self, input: &AxisInput, output: &mut AxisOutput) {
        let lost = || (self.reading == Reading::Lost).then_some(READING_LOST);
        // Told already, by who has it.
        if let Some(failure) = input.failure.or(input.actual.failure).or_else(lost) {
            let error = MotionError::from_failure(failure);
            if self.motion != Motion::Failed || self.error != error {
                self.controlled = false;
                self.fail(error, output);
            }
            return;
        }
        let moves = !matches!(self.motion, Motion::Idle | Motion::Failed);
        if self.reading == Reading::None && moves {
            self.controlled = false;
            self.fail_with(READING_LOST, output);
            return;
        }
        if let Some(failure) = self.gear_failure() {
            self.fail_with(failure, output);
            return;
        }
        if self.settings.mode == Mode::Control && self.feeds_back() && self.motion != Motion::Failed {
            let deviation = self.deviation();
            let [above, below] = self.settings.following_error.map(f64::from);
            let failure = if above > 0.0 && deviation >= above {
                Some(Failure::DELTA_S_MAX)
            } else if below > 0.0 && deviation <= -below {
                Some(Failure::DELTA_S_MIN)
            } else {
                None
            };
            if let Some(failure) = failure {
                self.fail_with(failure, output);
                return;
            }
        }
        self.watch_limits(input, output);
    }

    fn watch_limits(&mut self, input: &AxisInput, output: &mut AxisOutput) {
        let before = self.limits;
        let homing = matches!(self.motion, Motion::Home(_));
        let [upper, lower] = self.settings.ends;
        let passed = [
            upper.position.is_some_and(|end| self.actual > end),
            lower.position.is_some_and(|end| self.actual < end),
        ];
        let names = [(HW_LIMIT_PLUS, SW_LIMIT_PLUS), (HW_LIMIT_MINUS, SW_LIMIT_MINUS)];
        self.limits = [None; 2];
        for (side, (hardware, software)) in names.into_iter().enumerate() {
            let (Some(end), Some(passed), Some(slot)) =
                (self.settings.ends.get(side), passed.get(side), self.limits.get_mut(side))
            else {
                continue;
            };
            if end.switched(input.digital) {
                *slot = Some(hardware);
            } else if *passed && !homing {
                *slot = Some(software);
            }
        }
        let turning = self.turning_side();
        let direction = self.direction();
        let sides = self.limits.into_iter().zip(before).zip([direction, -direction]);
        for (side, ((limit, before), towards)) in sides.enumerate() {
            let Some(failure) = limit else { continue };
            // The calibration's turning point is no failure.
            if turning == Some(side) && homing || self.motion == Motion::Failed {
                continue;
            }
            if towards > 0 || before.is_none() && towards == 0 {
                self.fail_with(failure, output);
            }
        }
        if self.limits == [None; 2] && self.error.is_limit() && self.motion != Motion::Failed {
            self.error = MotionError::NONE;
        }
    }

    /// The side on which an automatic calibration turns: its hardware limit switch there is the turning
    /// point initiator (project-defined: the manual names no terminal for it).
    pub(super) fn turning_side(&self) -> Option<usize> {
        match self.settings.calibration {
            Calibration::None => None,
            Calibration::Forward => Some(1),
            Calibration::Backward => Some(0),
        }
    }

    /// Direction in which the axis is driven now: 1, 0 or −1.
    fn direction(&self) -> i8 {
        if self.settings.mode == Mode::Signals {
            return self.sequence.direction();
        }
        let velocity = if self.settings.mode == Mode::Ramps { self.velocity } else { self.velocity_now() };
        i8::from(velocity > 0.0) - i8::from(velocity < 0.0)
    }

    /// Fails by what it tells.
    fn fail_with(&mut self, failure: Failure, output: &mut AxisOutput) {
        self.fail(MotionError::from_failure(failure), output);
        output.failure = Some(failure);
    }

    fn fail(&mut self, error: MotionError, output: &mut AxisOutput) {
        if self.motion != Motion::Idle {
            output.ended = Some(Progress::Failed(error));
        }
        self.brake_hard();
        self.error = error;
        self.motion = Motion::Failed;
        self.at_target = false;
        self.nominal = None;
    }

    /// Acknowledges a failure, once the axis stands and its cause is gone.
    pub(super) fn acknowledge(&mut self) {
        if self.motion == Motion::Failed && self.stands() {
            self.motion = Motion::Idle;
            self.settle();
        }
        if self.motion == Motion::Idle && self.limits == [None; 2] {
            self.error = MotionError::NONE;
        }
    }

    /// Whether the set values are at rest.
    pub(super) fn stands(&self) -> bool {
        match self.settings.mode {
            Mode::Signals => self.sequence.stands(),
            Mode::Ramps => self.velocity == 0.0,
            _ => self.generator.arrived() && self.generator.state().velocity == 0.0,
        }
    }

    pub(super) fn stop_with_application(&mut self, stop: PlcStop, output: &mut AxisOutput) {
        if self.motion == Motion::Failed {
            return;
        }
        let idle = self.motion == Motion::Idle;
        match stop {
            PlcStop::Control => {
                self.controlled = false;
                self.brake_hard();
            }
            PlcStop::Regulate => self.brake_softly(),
        }
        if !idle {
            output.ended = Some(Progress::Aborted);
            self.motion = Motion::Braking { stop: false };
            self.nominal = None;
            self.at_target = false;
        }
    }
}
