//! Digital inputs I1…I4 and outputs Q1…Q3.

use core::fmt;

use crate::Model;

/// A digital input terminal: I1.0…I1.5, I2.0…I2.7, I3.0…I3.7, I4.0…I4.7.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Terminal {
    block: u8,
    bit: u8,
}

/// A digital input that does not exist.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("there is no digital input I{block}.{bit}: I1.0 to I1.5 and I2.0 to I4.7 expected")]
pub struct TerminalError {
    /// The block given.
    pub block: u8,
    /// The terminal given.
    pub bit: u8,
}

impl Terminal {
    /// PLC Run: starts and stops the application (3.8).
    pub const PLC_RUN: Self = Self { block: 3, bit: 7 };

    /// Terminal `bit` of block I`block`.
    ///
    /// # Errors
    /// [`TerminalError`] if there is none: block I1 has 6, the others have 8.
    pub const fn new(block: u8, bit: u8) -> Result<Self, TerminalError> {
        match (block, bit) {
            (1, 0..=5) | (2..=4, 0..=7) => Ok(Self { block, bit }),
            _ => Err(TerminalError { block, bit }),
        }
    }

    /// The choice of `[954]` and `[966]`: 0 = I1.0 … 5 = I1.5, 6 = I2.0 … 29 = I4.7.
    #[must_use]
    pub fn from_choice(choice: i32) -> Option<Self> {
        let choice = u8::try_from(choice).ok()?;
        match choice {
            0..=5 => Some(Self { block: 1, bit: choice }),
            6..=29 => Some(Self { block: 2 + (choice - 6) / 8, bit: (choice - 6) % 8 }),
            _ => None,
        }
    }
}

impl fmt::Display for Terminal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "I{}.{}", self.block, self.bit)
    }
}

/// Signal states of I1…I4, high = true.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub struct DigitalInputs([u8; 4]);

impl DigitalInputs {
    /// One byte a block, bit x = terminal x; bits without a terminal are dropped.
    #[must_use]
    pub const fn new(blocks: [u8; 4]) -> Self {
        let [i1, i2, i3, i4] = blocks;
        Self([i1 & 0x3F, i2, i3, i4])
    }

    /// One byte a block, bit x = terminal x.
    #[must_use]
    pub const fn blocks(self) -> [u8; 4] {
        self.0
    }

    /// Whether a terminal is high.
    #[must_use]
    pub fn get(self, terminal: Terminal) -> bool {
        self.0.get(usize::from(terminal.block) - 1).is_some_and(|block| block >> terminal.bit & 1 != 0)
    }

    /// Sets the state of a terminal.
    pub fn set(&mut self, terminal: Terminal, high: bool) {
        if let Some(block) = self.0.get_mut(usize::from(terminal.block) - 1) {
            *block = *block & !(1 << terminal.bit) | u8::from(high) << terminal.bit;
        }
    }

    /// What a model has of them: I4 exists on GEL 8231 and 8236 only (7.2).
    #[must_use]
    pub const fn of(self, model: Model) -> Self {
        let [i1, i2, i3, i4] = self.0;
        Self([i1, i2, i3, if model.has_extra_inputs() { i4 } else { 0 }])
    }
}

/// Outputs Q1…Q3, five terminals each: the operating system's signals and the application's, which
/// are OR-linked where they share a terminal (6.7.1.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DigitalOutputs {
    system: [u8; 3],
    application: [u8; 3],
}

/// Terminals 0…4 of a block.
const TERMINALS: u8 = 0x1F;

impl DigitalOutputs {
    /// Forgets the operating system's signals of the last cycle.
    pub const fn begin(&mut self) {
        self.system = [0; 3];
    }

    /// Adds signals of the operating system on block Q(`block`+1).
    pub fn link(&mut self, block: usize, bits: u8) {
        if let Some(system) = self.system.get_mut(block) {
            *system |= bits & TERMINALS;
        }
    }

    /// Sets what the application puts on Q1…Q3: bit x = terminal x, 0…4; other bits are dropped.
    pub fn write(&mut self, blocks: [u8; 3]) {
        self.application = blocks.map(|bits| bits & TERMINALS);
    }

    /// Sets one terminal of the application: `block` 1…3, `terminal` 0…4; others are ignored.
    pub fn set(&mut self, block: u8, terminal: u8, high: bool) {
        let application = usize::from(block).checked_sub(1).and_then(|at| self.application.get_mut(at));
        if let Some(bits) = application
            && terminal < 5
        {
            *bits = *bits & !(1 << terminal) | u8::from(high) << terminal;
        }
    }

    /// What is on the terminals: both, OR-linked.
    #[must_use]
    pub fn linked(&self) -> [u8; 3] {
        let [a, b, c] = self.system;
        let [x, y, z] = self.application;
        [a | x, b | y, c | z]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;

    /// 7.2: 22 digital inputs, GEL 8231 and 8236: 30.
    #[test]
    fn terminals_of_the_models() {
        let all = DigitalInputs::new([0xFF; 4]);
        let count = |model| all.of(model).blocks().iter().map(|block| block.count_ones()).sum::<u32>();
        assert_eq!(Model::ALL.map(count), [22, 30, 22, 30]);
    }

    /// 6.8.1.1, `[954]`: I1.0…I4.7.
    #[test]
    fn choices_name_terminals() {
        let names = |choice| Terminal::from_choice(choice).map(|terminal| terminal.to_string());
        assert_eq!(names(0).as_deref(), Some("I1.0"));
        assert_eq!(names(5).as_deref(), Some("I1.5"));
        assert_eq!(names(6).as_deref(), Some("I2.0"));
        assert_eq!(names(21).as_deref(), Some("I3.7"));
        assert_eq!(names(29).as_deref(), Some("I4.7"));
        assert_eq!((names(30), names(-1)), (None, None));
        for choice in 0..30 {
            let terminal = Terminal::from_choice(choice).unwrap();
            let mut inputs = DigitalInputs::default();
            inputs.set(terminal, true);
            let set: u32 = inputs.blocks().iter().map(|block| block.count_ones()).sum();
            assert!(inputs.get(terminal) && set == 1);
            inputs.set(terminal, false);
            assert_eq!(inputs, DigitalInputs::default());
        }
        assert_eq!(Terminal::new(1, 6), Err(TerminalError { block: 1, bit: 6 }));
    }

    /// 6.7.1.3: "If two or more signals are assigned the same terminal then these signals are OR-linked."
    #[test]
    fn shared_terminals_are_or_linked() {
        let mut outputs = DigitalOutputs::default();
        outputs.write([0b00001, 0xFF, 0]);
        outputs.link(0, 0b00100);
        outputs.link(0, 0b01100);
        outputs.set(3, 4, true);
        outputs.set(3, 5, true);
        assert_eq!(outputs.linked(), [0b01101, 0b11111, 0b10000]);
        outputs.begin();
        assert_eq!(outputs.linked(), [0b00001, 0b11111, 0b10000]);
    }
}
