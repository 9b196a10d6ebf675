//! What the cycle and an axis exchange.

use lb2::code::Failure;

use crate::application::{AxisStatus, MotionError, Order, Progress};
use crate::input::ActualValue;
use crate::io::DigitalInputs;
use crate::output::Command;
use crate::parameters::Values;

/// How axes stop with the application, `[004]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlcStop {
    /// Greatest deceleration, without feedback control.
    Control,
    /// As the axis is configured.
    Regulate,
}

/// Where an axis has its actual value from, `[606]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ActualSource {
    None,
    /// Actual value input, by place.
    Input(u8),
    /// The clock pulses of its own output.
    Stepper,
    /// The set value itself.
    Virtual,
}

impl ActualSource {
    pub(crate) fn from_choice(choice: i32) -> Self {
        match choice {
            7 => Self::Stepper,
            8 => Self::Virtual,
            input => u8::try_from(input - 1).map_or(Self::None, Self::Input),
        }
    }
}

/// What an axis is given in one cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisInput {
    /// Actual value. Its `shift` moves the set values alike; `failure` stops the axis, and without a
    /// `reading` it does not move. An axis without an input (`[606]` Virtual, Stepper motor) takes
    /// `position` as the steps of its motor.
    pub actual: ActualValue,
    /// I1…I4, for the hardware limit switches.
    pub digital: DigitalInputs,
    /// Whether the drive is to be enabled.
    pub power: bool,
    /// Whether a stop is held.
    pub held: bool,
    /// Acknowledges a failure.
    pub reset: bool,
    /// A new order; it takes the place of the one before, unless it is refused.
    pub order: Option<Order>,
    /// The application has stopped in this cycle.
    pub stop: Option<PlcStop>,
    /// The drive on the CAN bus failed.
    pub failure: Option<Failure>,
}

/// What an axis gives in one cycle.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AxisOutput {
    /// For its nominal value output.
    pub command: Command,
    /// For the application.
    pub status: AxisStatus,
    /// Why the new order was refused; the one before goes on.
    pub refused: Option<MotionError>,
    /// How the present order ended in this cycle.
    pub ended: Option<Progress>,
    /// Whether its input is to calibrate on the reference signal.
    pub armed: bool,
    /// To be stored; that of the actual value is stored anyway.
    pub failure: Option<Failure>,
}

/// The control of one axis.
pub trait AxisControl {
    /// Takes over the parameters of axis `at`, 0…5, and the length of a cycle, ms; also while moving.
    fn configure(&mut self, values: &Values, at: usize, cycle: u16);

    /// One cycle. `inputs` are all actual value inputs, for an axis that goes along with one of them.
    fn cycle(&mut self, input: &AxisInput, inputs: &[ActualValue; 6]) -> AxisOutput;
}
