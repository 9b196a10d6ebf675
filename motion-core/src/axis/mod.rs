//! Axes 1…6 (manual A 6.8): from an actual position and orders to a set velocity or signals.
//!
//! In every mode one [`Axis::cycle`] looks at failures and limit switches first, then takes orders, then
//! moves. What a motion is for ([`Motion`]) is the same in all modes; how it is driven differs: by the
//! set value generator with feedback (Control), by its acceleration and the residual distance (Ramps),
//! or by direction, slow and fast (Signals).

mod drive;
mod gear;
mod orders;
mod ramps;
mod settings;
mod signals;
mod watch;

use crate::application::{AxisStatus, MotionError, Progress, State};
use crate::control::{ActualSource, AxisControl, AxisInput, AxisOutput};
use crate::input::{ActualValue, Reading};
use crate::output::{Command, Signals};
use crate::parameters::Values;
use crate::trajectory::{self, Generator, Goal, Limits};
use gear::Gear;
use lb2::code::Failure;
use settings::{Mode, Settings};
use signals::Sequence;

/// What the axis is doing.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Motion {
    /// Nothing: at rest.
    Idle,
    /// To a position, with this velocity at most.
    Position { target: i32, velocity: f64 },
    /// With a velocity, or by hand.
    Velocity { velocity: f64, fast: bool },
    /// Looking for the reference point.
    Home(Home),
    /// Along with an actual value input.
    Gear(Gear),
    /// Braking on an order; with the greatest deceleration on a `Stop`.
    Braking { stop: bool },
    /// Braking because of a failure.
    Failed,
}

/// Where an automatic calibration is.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Home {
    /// With V1 to the turning point.
    Turning,
    /// With V2 to the reference signal.
    Referencing,
    /// Found, braking.
    Found,
}

/// The brake, and with it the control.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Brake {
    Closed,
    /// Opens in so many ms, `[744]`.
    Opening(u16),
    Open,
    /// Closes in so many ms, `[750]`.
    Closing(u16),
}

/// One axis.
#[derive(Debug, Clone)]
pub struct Axis {
    settings: Settings,
    /// Length of a cycle, ms.
    cycle: u16,
    generator: Generator,
    /// Whether the position is controlled, not the velocity alone.
    controlled: bool,
    motion: Motion,
    brake: Brake,
    sequence: Sequence,
    /// The nominal position reached last, while it is the one that counts.
    nominal: Option<i32>,
    at_target: bool,
    homed: bool,
    powered: bool,
    held: bool,
    error: MotionError,
    /// What failed of the drive.
    drive: Option<Failure>,
    /// Limit switches reached: upper, lower.
    limits: [Option<Failure>; 2],
    /// Actual position of this cycle.
    actual: i32,
    /// What it stands for.
    reading: Reading,
    /// Set position at the moment at which the actual one was read.
    set: f64,
    /// Velocity put out last.
    velocity: f64,
}

impl Default for Axis {
    fn default() -> Self {
        let settings = Settings::read(&Values::factory(), 0);
        Self {
            settings,
            cycle: 1,
            generator: Generator::new(0.0, Limits::UNIT),
            controlled: true,
            motion: Motion::Idle,
            brake: Brake::Closed,
            sequence: Sequence::default(),
            nominal: None,
            at_target: false,
            homed: false,
            powered: false,
            held: false,
            error: MotionError::NONE,
            drive: None,
            limits: [None; 2],
            actual: 0,
            reading: Reading::None,
            set: 0.0,
            velocity: 0.0,
        }
    }
}

impl AxisControl for Axis {
    fn configure(&mut self, values: &Values, at: usize, cycle: u16) {
        let before = core::mem::replace(&mut self.settings, Settings::read(values, at));
        self.cycle = cycle;
        if matches!(self.motion, Motion::Gear(_)) && self.gear_limits().is_none() {
            self.brake_within(self.settings.limits.or(before.limits));
            self.motion = Motion::Braking { stop: false };
        }
        // A motion goes on within the new limits; only a velocity that is above them cannot.
        let Some(limits) = self.settings.limits else { return };
        // Refused limits cannot come from parameters in range; the old ones would go on.
        match self.motion {
            Motion::Position { velocity, .. } if self.settings.mode == Mode::Control => {
                if let Ok(limits) = limits.with_velocity(velocity.min(limits.velocity())) {
                    _ = self.generator.set_limits(limits);
                }
            }
            Motion::Velocity { .. } if self.settings.mode != Mode::Signals => {
                if let Goal::Velocity(velocity) = self.generator.goal() {
                    let most = limits.velocity();
                    _ = self.generator.go(Goal::Velocity(velocity.clamp(-most, most)), limits);
                }
            }
            _ => {}
        }
    }

    fn cycle(&mut self, input: &AxisInput, inputs: &[ActualValue; 6]) -> AxisOutput {
        let mut output = AxisOutput::default();
        self.measure(input);
        self.look_at_master(inputs);
        self.power(input, &mut output);
        self.watch_drive(input.failure, &mut output);
        if self.powered {
            self.watch(input, &mut output);
            if input.reset && input.failure.is_none() && input.actual.reading == Reading::Real {
                self.acknowledge();
            }
            if let Some(stop) = input.stop {
                self.stop_with_application(stop, &mut output);
            }
        }
        if let Some(order) = input.order {
            self.order(order, inputs, &mut output);
        }
        let turned = self.turning_side().and_then(|side| self.settings.ends.get(side));
        self.follow_home(turned.is_some_and(|end| end.switched(input.digital)), input.actual.calibrated);
        self.run(&mut output);
        self.report(input, &mut output);
        output
    }
}

impl Axis {
    /// Length of a cycle, s.
    fn seconds(&self) -> f64 {
        f64::from(self.cycle) / 1000.0
    }

    fn measure(&mut self, input: &AxisInput) {
        let shift = input.actual.shift;
        if shift != 0 {
            self.generator.shift(f64::from(shift));
            self.nominal = self.nominal.map(|nominal| nominal.wrapping_add(shift));
            if let Motion::Position { target, .. } = &mut self.motion {
                *target = target.wrapping_add(shift);
            }
        }
        let before = self.actual;
        self.actual = if self.settings.source == ActualSource::Virtual {
            rounded(self.generator.state().position)
        } else {
            input.actual.position
        };
        self.wrap(before, shift);
        self.reading = input.actual.reading;
        self.homed |= input.actual.calibrated;
        self.held = input.held;
    }

    /// Where the actual value wraps, the set values do.
    fn wrap(&mut self, before: i32, shift: i32) {
        let step = i64::from(self.actual) - i64::from(before) - i64::from(shift);
        if step.unsigned_abs() > 1 << 31 {
            self.generator.shift(if step > 0 { TURN } else { -TURN });
        }
    }

    fn power(&mut self, input: &AxisInput, output: &mut AxisOutput) {
        if input.power && !self.powered {
            self.powered = true;
            self.settle();
            self.brake = Brake::Closed;
        } else if !input.power && self.powered {
            self.powered = false;
            if self.motion != Motion::Idle {
                output.ended = Some(Progress::Aborted);
            }
            self.motion = Motion::Idle;
            self.sequence = Sequence::default();
            self.error = MotionError::NONE;
            self.settle();
            self.brake = Brake::Closed;
        }
    }

    /// The set values are where the axis is, without motion.
    fn settle(&mut self) {
        // An i32 is a position in range.
        _ = self.generator.set_state(trajectory::State::at_rest(f64::from(self.actual)));
        self.nominal = None;
        self.at_target = false;
        self.set = f64::from(self.actual);
        self.velocity = 0.0;
    }

    /// Deviation of the actual from the nominal position, DeltaS.
    fn deviation(&self) -> f64 {
        self.generator.state().position - f64::from(self.actual)
    }

    /// Whether the position control is active.
    fn feeds_back(&self) -> bool {
        let is_virtual = self.settings.source == ActualSource::Virtual;
        if self.settings.mode != Mode::Control || is_virtual || !self.powered {
            return false;
        }
        match self.motion {
            Motion::Failed => false,
            Motion::Idle if self.settings.ksp == 0.0 => false,
            Motion::Idle if self.nominal.is_some() => {
                self.settings.control_in_position || matches!(self.brake, Brake::Closing(_))
            }
            Motion::Idle => self.settings.control_in_stop,
            _ => self.controlled,
        }
    }

    fn report(&mut self, input: &AxisInput, output: &mut AxisOutput) {
        let generator = self.generator.state();
        let follows = self.settings.mode != Mode::Control;
        let nominal = match self.motion {
            Motion::Position { target, .. } if follows => target,
            Motion::Idle if follows && self.nominal.is_some() => self.nominal.unwrap_or(self.actual),
            _ if follows => self.actual,
            _ => rounded(self.set),
        };
        let deviation =
            if follows { nominal.saturating_sub(self.actual) } else { nominal.wrapping_sub(self.actual) };
        // A drive that is enabled by software: only while its control works (6.7.1.2).
        let by_software = self.settings.brake_open > 0 && self.brake == Brake::Closed && !self.feeds_back();
        let lost =
            matches!(self.error.failure(), Some(crate::failure::DRIVE_LOST | crate::failure::DRIVE_FAULT));
        let enable = self.powered && !by_software && !lost;
        output.command = Command {
            velocity: if enable { self.velocity } else { 0.0 },
            maximum: self.settings.maximum,
            deviation,
            at_rest: self.motion == Motion::Idle && (self.nominal.is_some() || self.feeds_back()),
            enable,
            signals: if enable { output.command.signals } else { Signals::default() },
        };
        output.armed = self.motion == Motion::Home(Home::Referencing);
        let in_velocity = match self.motion {
            Motion::Velocity { .. } if self.settings.mode == Mode::Signals => self.sequence.direction() != 0,
            Motion::Velocity { velocity, .. } => self.generator.arrived() && generator.velocity == velocity,
            Motion::Gear(_) => self.generator.arrived(),
            _ => false,
        };
        let set_velocity = self.set_velocity();
        output.status = AxisStatus {
            state: self.state(),
            position: self.actual,
            velocity: match self.settings.source {
                ActualSource::Virtual => rounded(set_velocity),
                _ => input.actual.velocity,
            },
            nominal_position: nominal,
            nominal_velocity: if follows { self.velocity } else { set_velocity },
            nominal_acceleration: if follows { 0.0 } else { generator.acceleration },
            deviation,
            at_target: self.at_target,
            in_velocity,
            homed: self.homed,
            error: self.error,
        };
    }

    /// Velocity of the set values, units/s.
    fn set_velocity(&self) -> f64 {
        let own = self.generator.state().velocity;
        if let Motion::Gear(gear) = self.motion { own + gear.velocity() } else { own }
    }

    fn state(&self) -> State {
        match self.motion {
            _ if !self.powered => State::Disabled,
            Motion::Failed => State::ErrorStop,
            Motion::Idle if self.error != MotionError::NONE => State::ErrorStop,
            Motion::Braking { stop: true } => State::Stopping,
            Motion::Idle if self.held => State::Stopping,
            Motion::Idle => State::Standstill,
            Motion::Position { .. } | Motion::Braking { stop: false } => State::DiscreteMotion,
            Motion::Velocity { .. } => State::ContinuousMotion,
            Motion::Home(_) => State::Homing,
            Motion::Gear(_) => State::SynchronizedMotion,
        }
    }
}

/// Units from one position to the next one that reads the same (7.2).
const TURN: f64 = 4_294_967_296.0;

/// To the nearest whole unit, wrapping.
fn rounded(position: f64) -> i32 {
    libm::round(position) as i64 as i32
}

#[cfg(test)]
mod tests;
