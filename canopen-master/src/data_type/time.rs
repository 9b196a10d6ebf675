//! TIME_OF_DAY and TIME_DIFFERENCE (CiA 301, 7.1.6.5 and 7.1.6.6).

use core::time::Duration;

/// A date and time, in milliseconds since 1984-01-01T00:00 in whatever time zone the network uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TimeOfDay {
    days: u16,
    milliseconds: u32,
}

/// A span of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TimeDifference {
    days: u16,
    milliseconds: u32,
}

/// The upper 4 of 32 bits are reserved.
const MILLISECONDS: u32 = (1 << 28) - 1;
/// Milliseconds of a day.
const DAY: u64 = 24 * 60 * 60 * 1000;

const fn to_wire(days: u16, milliseconds: u32) -> [u8; 6] {
    let [a, b, c, d] = (milliseconds & MILLISECONDS).to_le_bytes();
    let [e, f] = days.to_le_bytes();
    [a, b, c, d, e, f]
}

const fn from_wire([a, b, c, d, e, f]: [u8; 6]) -> (u16, u32) {
    (u16::from_le_bytes([e, f]), u32::from_le_bytes([a, b, c, d]) & MILLISECONDS)
}

macro_rules! time {
    ($name:ident, $since:literal) => {
        impl $name {
            /// `milliseconds` of the day, of which 28 bits count, and `days`.
            #[must_use]
            pub const fn new(days: u16, milliseconds: u32) -> Self {
                Self { days, milliseconds: milliseconds & MILLISECONDS }
            }

            #[doc = concat!("From a duration", $since, ", cut to milliseconds; `None` beyond 65,535 days.")]
            #[must_use]
            pub fn from_duration(duration: Duration) -> Option<Self> {
                let milliseconds = duration.as_millis();
                let days = u16::try_from(milliseconds / u128::from(DAY)).ok()?;
                Some(Self { days, milliseconds: (milliseconds % u128::from(DAY)) as u32 })
            }

            #[doc = concat!("The duration", $since, ".")]
            #[must_use]
            pub const fn to_duration(self) -> Duration {
                Duration::from_millis(self.days as u64 * DAY + self.milliseconds as u64)
            }

            /// Days.
            #[must_use]
            pub const fn days(self) -> u16 {
                self.days
            }

            /// Milliseconds in the day, 28 bits: a device may send more than a day has.
            #[must_use]
            pub const fn milliseconds(self) -> u32 {
                self.milliseconds
            }

            /// 6 bytes: milliseconds (28 bits, 4 reserved), days.
            #[must_use]
            pub const fn to_wire(self) -> [u8; 6] {
                to_wire(self.days, self.milliseconds)
            }

            /// From 6 bytes; the 4 reserved bits are not looked at.
            #[must_use]
            pub const fn from_wire(bytes: [u8; 6]) -> Self {
                let (days, milliseconds) = from_wire(bytes);
                Self { days, milliseconds }
            }
        }
    };
}

time!(TimeOfDay, " since 1984-01-01T00:00");
time!(TimeDifference, "");
