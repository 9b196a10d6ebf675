//! Switches that the axis runs over.

use motion_core::io::{DigitalInputs, Terminal};

/// A switch on a digital input: operated within a range of positions.
#[derive(Debug, Clone, Copy)]
pub struct Switch {
    terminal: Terminal,
    from: f64,
    to: f64,
    opener: bool,
}

impl Switch {
    /// A switch that is operated from one position up to another, in units; the terminal is high then.
    #[must_use]
    pub const fn new(terminal: Terminal, from: f64, to: f64) -> Self {
        Self { terminal, from, to, opener: false }
    }

    /// A limit switch beyond `position`, upward if `upper`.
    #[must_use]
    pub const fn limit(terminal: Terminal, position: f64, upper: bool) -> Self {
        let (from, to) = if upper { (position, f64::INFINITY) } else { (f64::NEG_INFINITY, position) };
        Self::new(terminal, from, to)
    }

    /// The terminal is low while the switch is operated, as wire-break proof ones are.
    #[must_use]
    pub const fn opener(mut self) -> Self {
        self.opener = true;
        self
    }

    /// Puts the switch's state on its terminal. Both ends belong to the range.
    pub fn read(&self, position: f64, inputs: &mut DigitalInputs) {
        let operated = self.from <= position && position <= self.to;
        inputs.set(self.terminal, operated != self.opener);
    }
}
