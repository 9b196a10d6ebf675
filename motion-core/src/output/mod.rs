//! Nominal value outputs 1…6 (manual A 6.7): from an axis' set velocity and signals to a voltage, a
//! drive on the CAN bus, binary signals or a stepper motor's clock.

mod settings;

pub use settings::{Analog, DirectionSignals, JogSignals, Kind, Settings};

use crate::io::{MAX_FREQUENCY, Pwm};

/// Step of the analog outputs, mV (7.2: "resolution 2 mV").
const STEP: f64 = 2.0;
/// Increments of a drive's speed set value for one revolution a second: 60 · 262144/1875 (decision 14).
const SPEED_SCALE: f64 = 8388.608;

/// Binary signals of an axis: what the fast/slow jog control puts out (6.8.1.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub struct Signals {
    /// Forward: the actual value is to count up.
    pub forward: bool,
    /// Backward.
    pub backward: bool,
    /// Slow jog.
    pub slow: bool,
    /// Fast jog.
    pub fast: bool,
}

/// What an axis wants of its output in one cycle.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Command {
    /// Set velocity, user measuring units per second, forward > 0.
    pub velocity: f64,
    /// V max. `[642]`, user measuring units per second.
    pub maximum: f64,
    /// Nominal minus actual position, user measuring units.
    pub deviation: i32,
    /// Whether the nominal position has been reached and is held: the dead range applies.
    pub at_rest: bool,
    /// Whether the drive is to be enabled.
    pub enable: bool,
    /// For an output of type Signals.
    pub signals: Signals,
}

/// Set value of a drive on the CAN bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub struct DriveSetpoint {
    /// CAN 1 OUT 1, OUT 2, CAN 2 OUT 1…OUT 4, by place.
    pub object: usize,
    /// Speed, increments of 1875/262144 rpm; rounded half away from zero.
    pub speed: i32,
    /// Whether the drive is to be enabled.
    pub enable: bool,
    /// Whether its fault is acknowledged.
    pub reset: bool,
}

/// What an output gives in one cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub struct Nominal {
    /// Real-time signals on block Qx, x = number of the output: bit n = terminal n.
    pub bits: u8,
    /// Voltage between A+ and A- of Qx, mV.
    pub voltage: Option<i16>,
    /// Clock on C of Ex.
    pub clock: Option<Pwm>,
    /// Drive on a CAN bus.
    pub drive: Option<DriveSetpoint>,
}

/// One nominal value output.
#[derive(Debug, Clone)]
pub struct NominalValueOutput {
    at: usize,
    settings: Settings,
    /// Pulses put out so far, backward ones counted down.
    steps: i32,
    /// Millionths of a pulse that are still to come.
    rest: u64,
}

impl NominalValueOutput {
    /// Output `at`, 0…5.
    #[must_use]
    pub const fn new(at: usize, settings: Settings) -> Self {
        Self { at, settings, steps: 0, rest: 0 }
    }

    /// Takes over new settings.
    pub const fn configure(&mut self, settings: Settings) {
        self.settings = settings;
    }

    /// The settings in effect.
    #[must_use]
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Clock pulses of the stepper motor so far, backward ones counted down; wraps (6.6.1.5, 6.8.1).
    #[must_use]
    pub const fn steps(&self) -> i32 {
        self.steps
    }

    /// One cycle of `cycle` ms.
    pub fn cycle(&mut self, command: &Command, cycle: u16) -> Nominal {
        let settings = self.settings;
        match settings.kind {
            Kind::None => Nominal::default(),
            Kind::Analog(analog) => Nominal {
                voltage: Some(analog.voltage(command, settings.inverted)),
                bits: settings.direction.bits(moving(command), false),
                ..Nominal::default()
            },
            Kind::CanBus { object, increments } => Nominal {
                drive: object.map(|object| DriveSetpoint {
                    object,
                    speed: speed(command.velocity, increments, settings.inverted),
                    enable: command.enable,
                    reset: false,
                }),
                ..Nominal::default()
            },
            Kind::Signals(jog) => {
                let Signals { forward, backward, slow, fast } = command.signals;
                Nominal {
                    bits: jog.bits(slow, fast)
                        | settings.direction.bits((forward, backward), settings.reversed),
                    ..Nominal::default()
                }
            }
            Kind::Stepper { frequency } => {
                let clock = Pwm::clock(self.at, stepping(command, frequency));
                let moving = moving(command);
                self.count(clock.frequency(), moving.1, cycle);
                Nominal {
                    clock: Some(clock),
                    bits: settings.direction.bits(moving, settings.reversed),
                    ..Nominal::default()
                }
            }
        }
    }

    fn count(&mut self, frequency: u32, backward: bool, cycle: u16) {
        self.rest += u64::from(frequency) * u64::from(cycle);
        let pulses = (self.rest / 1_000_000) as i32;
        self.rest %= 1_000_000;
        self.steps = self.steps.wrapping_add(if backward { -pulses } else { pulses });
    }
}

/// Forward and backward.
fn moving(command: &Command) -> (bool, bool) {
    (command.velocity > 0.0, command.velocity < 0.0)
}

/// |v|/Vmax, 0…1; 0 without a V max.
fn share(command: &Command) -> f64 {
    if command.maximum > 0.0 { (libm::fabs(command.velocity) / command.maximum).min(1.0) } else { 0.0 }
}

impl Analog {
    /// U = sgn(v)·(Umin± + |v|/Vmax·(Umax − Umin±)), 0 for v = 0 and inside the dead range (decision 19).
    fn voltage(&self, command: &Command, inverted: bool) -> i16 {
        let dead = command.at_rest && self.dead.contains(command.deviation);
        let share = share(command);
        if dead || share == 0.0 {
            return 0;
        }
        let backward = command.velocity < 0.0;
        let minimum = f64::from(if backward { self.minimum.1 } else { self.minimum.0 });
        let maximum = f64::from(self.maximum);
        let volts = (minimum + share * (maximum - minimum)).min(maximum);
        // At most U max. = 10,000 mV.
        let volts = (libm::round(volts / STEP) * STEP) as i16;
        if (backward != inverted) && !self.unipolar { -volts } else { volts }
    }
}

fn speed(velocity: f64, increments: i32, inverted: bool) -> i32 {
    if increments <= 0 {
        return 0;
    }
    let speed = libm::round(velocity * SPEED_SCALE / f64::from(increments));
    // Saturates; negated before the conversion, so that −2^31 is no trap.
    (if inverted { -speed } else { speed }) as i32
}

/// f = |v|/Vmax·[540], in mHz.
fn stepping(command: &Command, frequency: i32) -> u32 {
    (libm::round(share(command) * f64::from(frequency) * 1000.0) as u32).min(MAX_FREQUENCY)
}

#[cfg(test)]
mod tests;
