//! How a motion is driven: brake, set values with feedback, ramps, signals, tolerance window.

use super::settings::{Calibration, Mode};
use super::signals::{self, Wanted};
use super::{Axis, Brake, Home, Motion, ramps, rounded};
use crate::application::Progress;
use crate::control::{ActualSource, AxisOutput};
use crate::trajectory::{self, Goal};

impl Axis {
    pub(super) fn run(&mut self, output: &mut AxisOutput) {
        self.move_brake();
        let opening = matches!(self.brake, Brake::Opening(_));
        if !self.powered {
            self.velocity = 0.0;
            self.settle();
            return;
        }
        match self.settings.mode {
            Mode::None => {}
            Mode::Control => self.run_controlled(opening, output),
            Mode::Ramps => self.run_ramps(opening, output),
            Mode::Signals => self.run_signals(opening, output),
        }
        if self.settings.source == ActualSource::Virtual {
            let before = core::mem::replace(&mut self.actual, rounded(self.generator.state().position));
            self.wrap(before, 0);
            self.set = self.generator.state().position;
        }
        self.watch_window(output);
    }

    pub(super) fn move_brake(&mut self) {
        let cycle = self.cycle;
        self.brake = match self.brake {
            Brake::Opening(left) if left > cycle => Brake::Opening(left - cycle),
            Brake::Opening(_) => Brake::Open,
            Brake::Closing(left) if left > cycle => Brake::Closing(left - cycle),
            Brake::Closing(_) => Brake::Closed,
            other => other,
        };
    }

    /// The start signal: the brake opens, unless it is open.
    pub(super) fn open_brake(&mut self) {
        self.brake = match self.brake {
            Brake::Closed if self.settings.brake_open > 0 => {
                // This cycle counts for it.
                Brake::Opening(self.settings.brake_open.saturating_add(self.cycle))
            }
            Brake::Opening(left) => Brake::Opening(left),
            _ => Brake::Open,
        };
    }

    /// Set values with feedback: v = v_d + KSP · (s_d − s_act) (decision 19). s_d is that of the moment
    /// at which the actual position was read; v_d the mean until the next one, so that a drive which does
    /// what it is told is where it should be then.
    fn run_controlled(&mut self, opening: bool, output: &mut AxisOutput) {
        let feeds_back = self.feeds_back();
        let rests = self.motion == Motion::Idle && self.nominal.is_none();
        if !feeds_back && (rests || !self.controlled) {
            self.follow_actual();
        }
        let feedback = if feeds_back && !opening { self.settings.ksp * self.deviation() } else { 0.0 };
        self.set = self.generator.state().position;
        let mut velocity = feedback;
        if opening {
            self.wait_for_brake();
        } else {
            velocity += self.advance() / self.seconds();
        }
        self.velocity = velocity.clamp(-self.settings.maximum, self.settings.maximum);
        if self.generator.arrived() {
            self.arrive(output);
        }
    }

    /// The generator's way is done.
    pub(super) fn arrive(&mut self, output: &mut AxisOutput) {
        match self.motion {
            Motion::Braking { stop } => {
                if !(stop && self.held) {
                    self.motion = Motion::Idle;
                    self.close_brake();
                }
                output.ended.get_or_insert(Progress::Done);
            }
            Motion::Home(Home::Found) => {
                self.motion = Motion::Idle;
                output.ended = Some(Progress::Done);
                self.close_brake();
            }
            Motion::Position { .. } | Motion::Home(_) | Motion::Velocity { .. } | Motion::Gear(_) => {}
            // Nothing controls it until it is reset.
            Motion::Failed => self.brake = Brake::Closed,
            Motion::Idle => {}
        }
    }

    /// At rest without position control, the brake closes at once; [750] counts from the tolerance
    /// window on.
    pub(super) fn close_brake(&mut self) {
        if !(self.settings.control_in_stop && self.controls_position()) {
            self.brake = Brake::Closed;
        }
    }

    /// Whether the mode controls the position of an axis at rest, if [732] or [738] say so: without KSP and
    /// by signals nothing does.
    fn controls_position(&self) -> bool {
        match self.settings.mode {
            Mode::Control => self.settings.ksp > 0.0,
            Mode::Ramps => true,
            Mode::Signals | Mode::None => false,
        }
    }

    /// Acceleration by time, braking by the residual distance, no feedback (6.8.1.3).
    pub(super) fn run_ramps(&mut self, opening: bool, output: &mut AxisOutput) {
        if opening {
            self.velocity = 0.0;
            return;
        }
        let time = self.seconds();
        let target = match self.motion {
            Motion::Position { target, velocity } => Some((target, velocity)),
            Motion::Idle if self.settings.control_in_position || matches!(self.brake, Brake::Closing(_)) => {
                self.nominal.map(|nominal| (nominal, self.settings.working))
            }
            _ => None,
        };
        let Some((target, speed)) = target else {
            self.generator.step(time);
            self.follow_actual();
            self.velocity = self.generator.state().velocity;
            if self.generator.arrived() {
                self.arrive(output);
            }
            return;
        };
        let rest = f64::from(target) - f64::from(self.actual);
        let most = ramps::velocity(rest.abs(), &self.settings.ramp, self.settings.maximum);
        let speed = speed.copysign(rest);
        if self.in_window(target) || rest == 0.0 {
            self.rest();
            return;
        }
        let limits = self.settings.limits.or(self.settings.hardest);
        let goal = Goal::Velocity(speed);
        if self.generator.goal() != goal
            && let Some(limits) = limits
        {
            // The velocity is within the limits: it is the lesser of both.
            _ = self.generator.go(goal, limits);
        }
        let state = self.generator.step(time);
        self.follow_actual();
        self.velocity = state.velocity;
        if state.velocity * rest > 0.0 && state.velocity.abs() > most {
            self.velocity = most.copysign(rest);
            let position = self.generator.state().position;
            let now = trajectory::State { position, velocity: self.velocity, acceleration: 0.0 };
            // Finite and in range; from here it accelerates again when the distance allows it.
            _ = self.generator.set_state(now);
        }
    }

    /// Nothing holds the position: the set values go with the axis.
    pub(super) fn follow_actual(&mut self) {
        if self.settings.source != ActualSource::Virtual {
            let deviation = self.deviation();
            self.generator.shift(-deviation);
        }
    }

    pub(super) fn rest(&mut self) {
        self.velocity = 0.0;
        // An i32 is a position in range.
        _ = self.generator.set_state(trajectory::State::at_rest(f64::from(self.actual)));
    }

    /// Direction, slow and fast (6.8.1.2).
    pub(super) fn run_signals(&mut self, opening: bool, output: &mut AxisOutput) {
        let wanted = match self.motion {
            _ if opening => None,
            Motion::Position { target, .. } => {
                let rest = i64::from(target) - i64::from(self.actual);
                signals::approach(rest, self.sequence.is_fast(), &self.settings.jogs)
            }
            Motion::Velocity { velocity, fast } => Some(Wanted { forward: velocity > 0.0, fast }),
            Motion::Home(Home::Found) | Motion::Idle | Motion::Failed => None,
            // There is no gearing by signals.
            Motion::Braking { .. } | Motion::Gear(_) => None,
            Motion::Home(home) => {
                let forward = self.settings.calibration == Calibration::Forward;
                Some(Wanted { forward: forward == (home == Home::Referencing), fast: false })
            }
        };
        output.command.signals = self.sequence.cycle(wanted, &self.settings.jogs, self.cycle);
        if wanted.is_none() && self.sequence.stands() {
            self.arrive(output);
        }
        self.rest();
    }

    pub(super) fn in_window(&self, target: i32) -> bool {
        let deviation = i64::from(target) - i64::from(self.actual);
        let [below, above] = self.settings.tolerance.map(i64::from);
        (-above..=below).contains(&deviation)
    }

    /// `actual = nominal`: once the nominal position has been reached, as long as the actual one stays in
    /// the tolerance window.
    pub(super) fn watch_window(&mut self, output: &mut AxisOutput) {
        let target = match self.motion {
            Motion::Position { target, .. } => target,
            Motion::Idle => match self.nominal {
                Some(nominal) => nominal,
                None => return,
            },
            _ => return,
        };
        let within = self.in_window(target);
        let set = match (self.motion, self.settings.mode) {
            (Motion::Position { .. }, Mode::Control) => self.generator.arrived(),
            (Motion::Position { .. }, Mode::Signals) => self.sequence.stands(),
            _ => true,
        };
        self.at_target = within && set;
        if let Motion::Position { target, .. } = self.motion
            && self.at_target
        {
            self.motion = Motion::Idle;
            self.nominal = Some(target);
            output.ended = Some(Progress::Done);
            if !(self.settings.control_in_position && self.controls_position()) {
                self.brake = match self.settings.brake_close {
                    0 => Brake::Closed,
                    time => Brake::Closing(time),
                };
            }
        }
    }
}
