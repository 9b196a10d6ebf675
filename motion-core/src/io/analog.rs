//! Analog inputs I61…I63 and PT100 inputs I54…I57 (manual A 3.9, 3.10, 6.4).

use crate::Model;
use crate::parameters::Values;

/// Analog inputs: I61, I62, I63, I54, I55, I56, I57.
pub const CHANNELS: usize = 7;
/// Greatest reading of a current or voltage input: 20 mA or 10 V (3.9).
pub const MAX_READING: u16 = 1023;
/// Greatest reading of a PT100 input: +351 °C (3.10).
pub const MAX_PT100: u16 = 1564;
/// Time from one reading to the next, ms (6.4.1: "measuring cycle ≈ 10 ms").
const MEASURING: i32 = 10;
/// Readings of the longest gate time, 1.00 s.
const RING: usize = 100;

/// The temperature that a PT100 reading stands for, in quarters of a degree Celsius
/// (3.10: T = reading/4 − 40).
#[must_use]
pub const fn celsius_quarters(reading: u16) -> i32 {
    reading as i32 - 160
}

/// One analog input: its last reading, and the mean of the readings within the gate time.
#[derive(Debug, Clone)]
pub struct AnalogChannel {
    active: bool,
    /// Greatest reading.
    maximum: u16,
    /// Readings that the gate time holds, 1…100.
    gate: u8,
    ring: [u16; RING],
    next: u8,
    filled: u8,
    sum: u32,
}

impl AnalogChannel {
    const fn new(maximum: u16) -> Self {
        Self { active: false, maximum, gate: 1, ring: [0; RING], next: 0, filled: 0, sum: 0 }
    }

    fn configure(&mut self, active: bool, gate: i32) {
        let gate = gate.clamp(1, RING as i32) as u8;
        if (active, gate) != (self.active, self.gate) {
            *self = Self { active, gate, ..Self::new(self.maximum) };
        }
    }

    /// Takes a reading; the oldest one leaves the gate.
    fn take(&mut self, reading: u16) {
        let reading = reading.min(self.maximum);
        if let Some(slot) = self.ring.get_mut(usize::from(self.next)) {
            if self.filled == self.gate {
                self.sum -= u32::from(*slot);
            } else {
                self.filled += 1;
            }
            self.sum += u32::from(reading);
            *slot = reading;
        }
        self.next = (self.next + 1) % self.gate;
    }

    /// The last reading; 0 while the input is inactive (`[035]`) or has none.
    #[must_use]
    pub fn reading(&self) -> u16 {
        let last = if self.next == 0 { self.gate - 1 } else { self.next - 1 };
        self.ring.get(usize::from(last)).copied().unwrap_or(0)
    }

    /// The mean over the gate time `[042]`, rounded down; over fewer readings while there are no more.
    #[must_use]
    pub fn average(&self) -> u16 {
        // A mean of u16 values fits u16.
        self.sum.checked_div(u32::from(self.filled)).unwrap_or(0) as u16
    }
}

/// All analog inputs, read every 10 ms.
#[derive(Debug, Clone)]
pub struct AnalogInputs {
    channels: [AnalogChannel; CHANNELS],
    /// Time until the next reading, ms.
    remaining: i32,
}

impl Default for AnalogInputs {
    fn default() -> Self {
        let channel = |at| AnalogChannel::new(if at < 3 { MAX_READING } else { MAX_PT100 });
        Self { channels: core::array::from_fn(channel), remaining: 0 }
    }
}

impl AnalogInputs {
    /// Takes over state and gate time, `[035]` and `[042]`. Inputs that the model lacks stay inactive.
    pub fn configure(&mut self, model: Model, values: &Values) {
        for (at, channel) in self.channels.iter_mut().enumerate() {
            let there = at == 0 || model.has_extra_inputs();
            channel.configure(there && values.at(35, at) == 1, values.at(42, at));
        }
    }

    /// Lets `cycle` ms pass with these voltages, currents and temperatures at the terminals.
    pub fn cycle(&mut self, cycle: u16, readings: &[u16; CHANNELS]) {
        let due = self.remaining <= 0;
        self.remaining = self.remaining + if due { MEASURING } else { 0 } - i32::from(cycle);
        if !due {
            return;
        }
        for (channel, &reading) in self.channels.iter_mut().zip(readings) {
            if channel.active {
                channel.take(reading);
            }
        }
    }

    /// An input by its place: I61, I62, I63, I54, I55, I56, I57.
    #[must_use]
    pub fn channel(&self, at: usize) -> Option<&AnalogChannel> {
        self.channels.get(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inputs(model: Model, changes: &[(u16, i32)]) -> AnalogInputs {
        let mut values = Values::factory();
        for &(index, value) in changes {
            values.set(index, value).unwrap();
        }
        let mut inputs = AnalogInputs::default();
        inputs.configure(model, &values);
        inputs
    }

    fn state(inputs: &AnalogInputs, at: usize) -> (u16, u16) {
        let channel = inputs.channel(at).unwrap();
        (channel.reading(), channel.average())
    }

    /// `[035]` State: an inactive input is not read, and the extra ones need GEL 8231 or 8236.
    #[test]
    fn parameter_035_activates_single_inputs() {
        let all = &[(35, 1), (36, 1), (41, 1)];
        let mut small = inputs(Model::Gel8230, all);
        let mut large = inputs(Model::Gel8236, all);
        let mut none = inputs(Model::Gel8236, &[]);
        for inputs in [&mut small, &mut large, &mut none] {
            inputs.cycle(3, &[500; CHANNELS]);
        }
        assert_eq!([0, 1, 2, 6].map(|at| state(&small, at).0), [500, 0, 0, 0]);
        assert_eq!([0, 1, 2, 6].map(|at| state(&large, at).0), [500, 500, 0, 500]);
        assert_eq!([0, 1, 2, 6].map(|at| state(&none, at).0), [0; 4]);
    }

    /// `[042]` Gate time: 0.03 s are three readings, one each 10 ms.
    #[test]
    fn parameter_042_is_the_time_that_is_averaged() {
        let mut inputs = inputs(Model::Gel8230, &[(35, 1), (42, 3)]);
        let mut seen = std::vec::Vec::new();
        for reading in [100, 200, 400, 700] {
            // Five cycles of 2 ms: only the first one reads.
            for within in 0..5 {
                inputs.cycle(2, &[reading + within; CHANNELS]);
            }
            seen.push(state(&inputs, 0));
        }
        assert_eq!(seen, [(100, 100), (200, 150), (400, 233), (700, 433)]);
    }

    /// 3.9 and 3.10: ranges, and the temperature's formula.
    #[test]
    fn readings_stay_within_their_range() {
        let mut inputs = inputs(Model::Gel8231, &[(35, 1), (38, 1)]);
        inputs.cycle(1, &[u16::MAX; CHANNELS]);
        assert_eq!((state(&inputs, 0).0, state(&inputs, 3).0), (1023, 1564));
        assert_eq!((celsius_quarters(0), celsius_quarters(1564)), (-40 * 4, 351 * 4));
    }
}
