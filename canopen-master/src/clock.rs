//! Deadlines, shared so that a small target holds their arithmetic once.

use core::time::Duration;

/// The earlier of two deadlines, of those there are.
pub(crate) fn earlier(one: Option<Duration>, other: Option<Duration>) -> Option<Duration> {
    match (one, other) {
        (Some(one), Some(other)) => Some(if one < other { one } else { other }),
        (one, other) => one.or(other),
    }
}

/// The earliest of some deadlines.
pub(crate) fn earliest(deadlines: &[Option<Duration>]) -> Option<Duration> {
    deadlines.iter().fold(None, |earliest, deadline| earlier(earliest, *deadline))
}

/// `ms` milliseconds after a moment.
pub(crate) fn after_ms(now: Duration, ms: u16) -> Duration {
    now.saturating_add(Duration::from_millis(u64::from(ms)))
}

/// `time` after `now`. One function on microcontrollers, where the arithmetic is long.
#[cfg_attr(target_pointer_width = "32", inline(never))]
#[cfg_attr(not(target_pointer_width = "32"), inline)]
pub(crate) fn after(now: Duration, time: Duration) -> Duration {
    now.saturating_add(time)
}
