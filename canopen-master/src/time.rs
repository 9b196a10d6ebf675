//! TIME (CiA 301, 7.2.6): the time of day for all nodes, on 100h.

use pdo::{Frame, cob};

/// Milliseconds of a day.
const DAY_MS: u64 = 86_400_000;

/// Days from 1970-01-01 to 1984-01-01.
const EPOCH_DAYS: u64 = 5113;

/// TIME_OF_DAY and TIME_DIFFERENCE (CiA 301, 7.1.6.5): 28 bits of milliseconds, 4 reserved bits, 16
/// bits of days; 6 bytes, little endian. As a time of day, the days count from 1984-01-01.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct TimeOfDay {
    days: u16,
    ms: u32,
}

impl TimeOfDay {
    /// `days` since 1984-01-01 and `ms` after midnight; `None` where 28 bits do not hold the
    /// milliseconds.
    #[must_use]
    pub const fn new(days: u16, ms: u32) -> Option<Self> {
        if ms < 1 << 28 { Some(Self { days, ms }) } else { None }
    }

    /// Whole days.
    #[must_use]
    pub const fn days(self) -> u16 {
        self.days
    }

    /// Milliseconds, less than 2^28; of a time of day, since midnight.
    #[must_use]
    pub const fn ms(self) -> u32 {
        self.ms
    }

    /// From milliseconds since 1970-01-01 00:00; `None` outside 1984…2163.
    #[must_use]
    pub const fn from_unix_ms(ms: u64) -> Option<Self> {
        let Some(days) = (ms / DAY_MS).checked_sub(EPOCH_DAYS) else { return None };
        if days > u16::MAX as u64 {
            return None;
        }
        Self::new(days as u16, (ms % DAY_MS) as u32)
    }

    /// Milliseconds since 1970-01-01 00:00.
    #[must_use]
    pub const fn unix_ms(self) -> u64 {
        (self.days as u64 + EPOCH_DAYS) * DAY_MS + self.ms as u64
    }

    /// The 6 bytes.
    #[must_use]
    pub const fn encode(self) -> [u8; 6] {
        let [a, b, c, d] = self.ms.to_le_bytes();
        let [e, f] = self.days.to_le_bytes();
        [a, b, c, d, e, f]
    }

    /// From the 6 bytes; the reserved bits are ignored.
    #[must_use]
    pub const fn parse(bytes: [u8; 6]) -> Self {
        let [a, b, c, d, e, f] = bytes;
        Self { days: u16::from_le_bytes([e, f]), ms: u32::from_le_bytes([a, b, c, d & 0x0F]) }
    }

    /// The TIME message.
    #[must_use]
    pub const fn frame(self) -> Frame {
        Frame::standard(cob::TIME, self.encode())
    }

    /// From a TIME message; `None` of any other frame, and where it is not 6 bytes long.
    #[must_use]
    pub fn from_frame(frame: &Frame) -> Option<Self> {
        let is_time = frame.standard_id() == Some(cob::TIME) && !frame.is_remote();
        is_time.then_some(frame.data())?.try_into().ok().map(Self::parse)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn golden_time() {
        // 2004-05-17 12:34:56.789 UTC.
        let time = TimeOfDay::from_unix_ms(1_084_797_296_789).unwrap();
        assert_eq!((time.days(), time.ms()), (7442, 45_296_789));
        assert_eq!(time.frame(), Frame::standard(0x100, [0x95, 0x2C, 0xB3, 0x02, 0x12, 0x1D]));
        assert_eq!(TimeOfDay::from_frame(&time.frame()), Some(time));
        assert_eq!(time.unix_ms(), 1_084_797_296_789);
        assert_eq!(TimeOfDay::parse([0x95, 0x2C, 0xB3, 0xF2, 0x12, 0x1D]), time, "reserved bits");
    }

    #[test]
    fn what_does_not_fit() {
        assert_eq!(TimeOfDay::new(0, 1 << 28), None);
        assert_eq!(TimeOfDay::from_unix_ms(0), None);
        assert_eq!(TimeOfDay::from_unix_ms(u64::MAX), None);
        assert_eq!(TimeOfDay::from_frame(&Frame::standard(0x100, [0; 5])), None);
        assert_eq!(TimeOfDay::from_frame(&Frame::standard(0x101, [0; 6])), None);
    }
}
