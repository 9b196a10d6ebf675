//! The terminals as an image: what was read at the begin of a cycle, and what is written at its end
//! (manual A 3.7 to 3.11, 6.4, 7.2).
//!
//! [`Inputs`] is what hardware or a simulation brings, [`Outputs`] what it is to put on the terminals.
//! The operating system's real-time signals and the application's outputs stay apart until the end of
//! a cycle, where they are OR-linked ([`DigitalOutputs`]).

mod analog;
mod digital;
mod extension;
mod pwm;

pub use analog::{AnalogChannel, AnalogInputs, CHANNELS, MAX_PT100, MAX_READING, celsius_quarters};
pub use digital::{DigitalInputs, DigitalOutputs, Terminal, TerminalError};
pub use extension::{BusKind, ByteOrder, FieldBus, MAX_IMAGE, ProcessImage};
pub use pwm::{MAX_FREQUENCY, Pwm};

use crate::input::Encoder;

/// What the terminals bring for one cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Inputs {
    /// I1…I4.
    pub digital: DigitalInputs,
    /// Readings of the analog inputs I61, I62, I63 (0…1023) and I54…I57 (0…1564). I62…I57 exist on
    /// GEL 8231 and 8236 only.
    pub analog: [u16; CHANNELS],
    /// E1…E3.
    pub encoders: [Encoder; 3],
}

/// What is on the terminals after a cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub struct Outputs {
    /// Q1…Q3: bit x of element n is terminal Q(n+1).x, 0…4.
    pub digital: [u8; 3],
    /// Voltage between A+ and A- of Q1…Q3, mV, −10,000…10,000.
    pub analog: [i16; 3],
    /// Pulse outputs C of E1…E3.
    pub pwm: [Pwm; 3],
}
