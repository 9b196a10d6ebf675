//! The application: what a PLC program is in manual A (1.4, 3.8, 6.3.2), as code behind a trait.
//!
//! [`Application::cycle`] is called once per control cycle while PLC Run (I3.7) allows it. It sees the
//! terminals, acts on the axes through the function blocks of [`blocks`] and puts out digital signals
//! and pulses. The blocks follow PLCopen: an order begins with a rising `execute`, and ends in exactly
//! one of done, aborted by another order, or an error.

mod axis;
pub mod blocks;
mod error;

pub use axis::{AxisAccess, AxisStatus, Order, Progress, State, Ticket};
pub use error::MotionError;

use crate::bus::CanBus;
use crate::input::ActualValue;
use crate::io::{AnalogInputs, DigitalInputs, DigitalOutputs, ProcessImage, Pwm};

/// Number of an axis, 1…6.
pub type AxisNumber = u8;

/// What an application sees and acts on in one cycle.
#[derive(Debug)]
pub struct Plc<'a> {
    /// Length of the cycle, ms.
    pub cycle: u16,
    /// I1…I4.
    pub inputs: DigitalInputs,
    /// I6, I5.
    pub analog: &'a AnalogInputs,
    /// Actual value inputs 1…6.
    pub actual: &'a [ActualValue; 6],
    /// Q1…Q3.
    pub outputs: &'a mut DigitalOutputs,
    /// Pulse outputs C of E1…E3; a stepper motor's clock has precedence.
    pub pwm: &'a mut [Pwm; 3],
    /// Process image of the extension module.
    pub bus: &'a mut ProcessImage,
    /// CAN 1 and CAN 2: process data of their objects, channels of CAN Link.
    pub can: &'a mut [CanBus; 2],
    pub(crate) axes: &'a mut [AxisAccess; 6],
}

impl Plc<'_> {
    /// An axis by number, 1…6.
    ///
    /// # Errors
    /// [`MotionError::NO_AXIS`] for other numbers.
    pub fn axis(&mut self, number: AxisNumber) -> Result<&mut AxisAccess, MotionError> {
        let place = usize::from(number).checked_sub(1);
        place.and_then(|place| self.axes.get_mut(place)).ok_or(MotionError::NO_AXIS)
    }
}

/// User code, called once per control cycle.
pub trait Application {
    /// One cycle.
    fn cycle(&mut self, plc: &mut Plc<'_>);
}

/// No application: the terminals are the operating system's.
impl Application for () {
    fn cycle(&mut self, _plc: &mut Plc<'_>) {}
}

impl<F: FnMut(&mut Plc<'_>)> Application for F {
    fn cycle(&mut self, plc: &mut Plc<'_>) {
        self(plc);
    }
}
