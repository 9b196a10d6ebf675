//! One direction of a serial line: characters that take their time, and faults that befall them.

use core::time::Duration;
use std::collections::VecDeque;

use lb2::device::LineError;
use oorandom::Rand64;

/// Settings of a line: 8 data bits, least significant first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LineConfig {
    /// Bits per second.
    pub baud: u32,
    /// Whether a parity bit is sent and checked.
    pub parity: bool,
    /// Stop bits, 1 or 2.
    pub stop_bits: u8,
}

impl Default for LineConfig {
    /// 19200 baud, even parity, 1 stop bit (manual A, Appendix 1).
    fn default() -> Self {
        Self { baud: 19_200, parity: true, stop_bits: 1 }
    }
}

impl LineConfig {
    /// Time that `characters` take one after the other, exact to the nanosecond.
    #[must_use]
    pub fn time(&self, characters: u64) -> Duration {
        let bits = 9 + u128::from(self.parity) + u128::from(self.stop_bits);
        let nanos = u128::from(characters) * bits * 1_000_000_000 / u128::from(self.baud.max(1));
        Duration::from_nanos(u64::try_from(nanos).unwrap_or(u64::MAX))
    }
}

/// What the receiver sees of one character.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Character {
    /// When its last bit has arrived.
    pub at: Duration,
    /// Its byte, or what the receiver reports in place of it.
    pub seen: Result<u8, LineError>,
}

/// Faults that befall characters at random: each number is "one in so many characters", 0 = never.
/// The same seed gives the same faults.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Faults {
    /// Seed of the random numbers.
    pub seed: u64,
    /// One data bit is turned over. With parity the receiver notices.
    pub flip: u32,
    /// Two data bits are turned over, which parity does not notice.
    pub double_flip: u32,
    /// The character is lost.
    pub drop: u32,
    /// The character arrives twice.
    pub double: u32,
    /// A random character is inserted before it.
    pub insert: u32,
    /// The receiver reports a parity error.
    pub parity: u32,
    /// The receiver reports a wrong stop bit.
    pub stop_bit: u32,
    /// The receiver reports lost characters.
    pub overwrite: u32,
}

impl Faults {
    /// A perfect line.
    pub const NONE: Self = Self {
        seed: 0,
        flip: 0,
        double_flip: 0,
        drop: 0,
        double: 0,
        insert: 0,
        parity: 0,
        stop_bit: 0,
        overwrite: 0,
    };
}

/// One fault for one character.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Fault {
    /// These data bits are turned over.
    Flip(u8),
    /// The character is lost.
    Drop,
    /// The character arrives twice.
    Double,
    /// This character is inserted before it.
    Insert(u8),
    /// The receiver reports this.
    Mark(LineError),
}

/// One direction of a line.
#[derive(Debug)]
pub struct Wire {
    config: LineConfig,
    faults: Faults,
    random: Rand64,
    scripted: VecDeque<(u64, Fault)>,
    /// Characters sent so far.
    sent: u64,
    /// Characters that faults have touched.
    faulty: u64,
    /// Beginning of the transmission without pause, and characters in it.
    busy: (Duration, u64),
    on_the_way: VecDeque<Character>,
}

impl Wire {
    /// A silent line.
    #[must_use]
    pub fn new(config: LineConfig, faults: Faults) -> Self {
        Self {
            config,
            faults,
            random: Rand64::new(u128::from(faults.seed)),
            scripted: VecDeque::new(),
            sent: 0,
            faulty: 0,
            busy: (Duration::ZERO, 0),
            on_the_way: VecDeque::new(),
        }
    }

    /// One fault for the character with this number, counted from 0 since the line was made. Numbers
    /// must come in ascending order.
    pub fn script(&mut self, character: u64, fault: Fault) {
        self.scripted.push_back((character, fault));
    }

    /// Characters sent, and how many of them a fault has touched.
    #[must_use]
    pub const fn counts(&self) -> (u64, u64) {
        (self.sent, self.faulty)
    }

    /// When the characters sent so far have left the line.
    #[must_use]
    pub fn free_at(&self) -> Duration {
        self.busy.0.saturating_add(self.config.time(self.busy.1))
    }

    /// Sends characters one after the other, the first at once or when the line is free; returns when
    /// the last one has left.
    pub fn send(&mut self, now: Duration, bytes: &[u8]) -> Duration {
        if now >= self.free_at() {
            self.busy = (now, 0);
        }
        for &byte in bytes {
            let fault = self.fault();
            self.sent += 1;
            self.faulty += u64::from(fault.is_some());
            match fault {
                None => self.put(Ok(byte)),
                Some(Fault::Flip(bits)) if self.config.parity && bits.count_ones() % 2 == 1 => {
                    self.put(Err(LineError::Parity));
                }
                Some(Fault::Flip(bits)) => self.put(Ok(byte ^ bits)),
                Some(Fault::Drop) => self.busy.1 += 1,
                Some(Fault::Double) => {
                    self.put(Ok(byte));
                    self.put(Ok(byte));
                }
                Some(Fault::Insert(other)) => {
                    self.put(Ok(other));
                    self.put(Ok(byte));
                }
                Some(Fault::Mark(error)) => self.put(Err(error)),
            }
        }
        self.free_at()
    }

    fn put(&mut self, seen: Result<u8, LineError>) {
        self.busy.1 += 1;
        let at = self.free_at();
        self.on_the_way.push_back(Character { at, seen });
    }

    fn fault(&mut self) -> Option<Fault> {
        if self.scripted.front().is_some_and(|(character, _)| *character == self.sent) {
            return self.scripted.pop_front().map(|(_, fault)| fault);
        }
        let faults = self.faults;
        let bit = |random: &mut Rand64| 1u8 << random.rand_range(0..8);
        let mut hit = |one_in: u32| one_in > 0 && self.random.rand_range(0..u64::from(one_in)) == 0;
        if hit(faults.flip) {
            Some(Fault::Flip(bit(&mut self.random)))
        } else if hit(faults.double_flip) {
            let first = bit(&mut self.random);
            let second = first.rotate_left(self.random.rand_range(1..8) as u32);
            Some(Fault::Flip(first | second))
        } else if hit(faults.drop) {
            Some(Fault::Drop)
        } else if hit(faults.double) {
            Some(Fault::Double)
        } else if hit(faults.insert) {
            Some(Fault::Insert(self.random.rand_range(0..256) as u8))
        } else if hit(faults.parity) {
            Some(Fault::Mark(LineError::Parity))
        } else if hit(faults.stop_bit) {
            Some(Fault::Mark(LineError::StopBit))
        } else if hit(faults.overwrite) {
            Some(Fault::Mark(LineError::Overwrite))
        } else {
            None
        }
    }

    /// The next character that has arrived by `now`.
    pub fn poll(&mut self, now: Duration) -> Option<Character> {
        self.on_the_way.pop_front_if(|character| character.at <= now)
    }

    /// When the next character arrives.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Duration> {
        self.on_the_way.front().map(|character| character.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn received(wire: &mut Wire) -> Vec<Result<u8, LineError>> {
        core::iter::from_fn(|| wire.poll(Duration::MAX)).map(|character| character.seen).collect()
    }

    #[test]
    fn characters_take_their_time_and_do_not_drift() {
        let config = LineConfig::default();
        let mut wire = Wire::new(config, Faults::NONE);
        let start = Duration::from_millis(7);
        assert_eq!(wire.send(start, &[1; 19_200]), start + Duration::from_secs(11));
        assert_eq!(wire.poll_timeout(), Some(start + Duration::from_nanos(572_916)));
        assert_eq!(wire.poll(start), None);
        // While the line is busy, what is sent waits its turn.
        assert_eq!(wire.send(start, &[2; 19_200]), start + Duration::from_secs(22));
        assert_eq!(received(&mut wire).len(), 38_400);
        let plain = LineConfig { parity: false, stop_bits: 2, baud: 9600 };
        assert_eq!(plain.time(9600), Duration::from_secs(11));
    }

    #[test]
    fn scripted_faults_hit_their_character() {
        let mut wire = Wire::new(LineConfig::default(), Faults::NONE);
        wire.script(1, Fault::Flip(0x01));
        wire.script(2, Fault::Flip(0x03));
        wire.script(3, Fault::Drop);
        wire.script(4, Fault::Double);
        wire.script(5, Fault::Insert(0x99));
        wire.script(6, Fault::Mark(LineError::StopBit));
        wire.send(Duration::ZERO, &[0x10, 0x11, 0x12, 0x13, 0x14, 0x15, 0x16, 0x17]);
        let (parity, stop) = (Err(LineError::Parity), Err(LineError::StopBit));
        let expected = [Ok(0x10), parity, Ok(0x11), Ok(0x14), Ok(0x14), Ok(0x99), Ok(0x15), stop, Ok(0x17)];
        assert_eq!(received(&mut wire), expected);
        assert_eq!(wire.counts(), (8, 6));
    }

    #[test]
    fn a_seed_repeats_its_faults() {
        let faults = Faults { seed: 42, flip: 50, drop: 50, insert: 50, parity: 50, ..Faults::NONE };
        let run = |seed| {
            let mut wire = Wire::new(LineConfig::default(), Faults { seed, ..faults });
            wire.send(Duration::ZERO, &[0x55; 10_000]);
            (received(&mut wire), wire.counts().1)
        };
        assert_eq!(run(42), run(42));
        assert_ne!(run(42).0, run(43).0);
        // Four kinds, each one in fifty.
        assert!((600..1000).contains(&run(42).1), "{}", run(42).1);
    }
}
