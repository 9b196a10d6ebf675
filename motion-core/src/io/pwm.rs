//! Pulse outputs on the terminals C of E1…E3 (manual A 3.7, 7.2).

/// Greatest frequency, mHz: 100 kHz.
pub const MAX_FREQUENCY: u32 = 100_000_000;
/// Least frequency of each output, mHz: about 0.3 Hz on E1 and E3, 5 Hz on E2.
const MIN_FREQUENCY: [u32; 3] = [300, 5_000, 300];
/// Shortest pulse, ns.
const MIN_PULSE: u64 = 5_000;

/// What a pulse output does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub struct Pwm {
    /// Frequency, mHz; 0 = no pulses.
    frequency: u32,
    /// Length of a pulse, ns.
    pulse: u32,
}

impl Pwm {
    /// A clock of `frequency` mHz with half-period pulses on the output of E(`output`+1): what is below
    /// the least frequency gives no pulses, what is above the greatest one gives that.
    #[must_use]
    pub fn clock(output: usize, frequency: u32) -> Self {
        Self::pulses(output, frequency, 500)
    }

    /// Pulses of `duty` ‰ of the period, not shorter than 5 µs and not closer than that.
    #[must_use]
    pub fn pulses(output: usize, frequency: u32, duty: u16) -> Self {
        if MIN_FREQUENCY.get(output).is_none_or(|&least| frequency < least) {
            return Self::default();
        }
        let frequency = frequency.min(MAX_FREQUENCY);
        // 10^12 ns·mHz: at least 10,000 ns, at most 3.4·10^9.
        let period = 1_000_000_000_000 / u64::from(frequency);
        let pulse = period * u64::from(duty.min(1000)) / 1000;
        let pulse = pulse.clamp(MIN_PULSE, period - MIN_PULSE);
        Self { frequency, pulse: u32::try_from(pulse).unwrap_or(u32::MAX) }
    }

    /// Frequency in mHz; 0 = no pulses.
    #[must_use]
    pub const fn frequency(self) -> u32 {
        self.frequency
    }

    /// Length of a pulse in ns; 0 = no pulses.
    #[must_use]
    pub const fn pulse(self) -> u32 {
        self.pulse
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 7.2: fmax = 100 kHz, fmin ≈ 0.3 Hz (E1, E3) or 5 Hz (E2), shortest pulse 5 µs.
    #[test]
    fn frequencies_stay_within_what_the_terminal_can() {
        let all = |frequency| [0, 1, 2].map(|output| Pwm::clock(output, frequency).frequency());
        assert_eq!(all(299), [0, 0, 0]);
        assert_eq!(all(300), [300, 0, 300]);
        assert_eq!(all(5_000), [5_000; 3]);
        assert_eq!(all(u32::MAX), [MAX_FREQUENCY; 3]);
        assert_eq!(Pwm::clock(0, MAX_FREQUENCY).pulse(), 5_000);
        assert_eq!(Pwm::pulses(0, 1_000_000, 1).pulse(), 5_000);
        assert_eq!(Pwm::pulses(0, 1_000_000, 250).pulse(), 250_000);
        assert_eq!(Pwm::pulses(0, 1_000_000, 1000).pulse(), 995_000);
        assert_eq!(Pwm::clock(3, 1_000_000), Pwm::default());
    }
}
