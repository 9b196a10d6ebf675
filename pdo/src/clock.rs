//! Deadlines on the caller's clock; arithmetic saturates. Engines share these functions so that a small
//! target holds them once; elsewhere they are a few instructions in place.

use core::time::Duration;

/// The earlier of two deadlines, of those there are.
#[must_use]
#[cfg_attr(target_pointer_width = "32", inline(never))]
#[cfg_attr(not(target_pointer_width = "32"), inline)]
pub fn earlier(one: Option<Duration>, other: Option<Duration>) -> Option<Duration> {
    match (one, other) {
        (Some(one), Some(other)) => Some(if one < other { one } else { other }),
        (one, other) => one.or(other),
    }
}

/// The earliest of some deadlines.
#[must_use]
pub fn earliest(deadlines: &[Option<Duration>]) -> Option<Duration> {
    deadlines.iter().fold(None, |earliest, deadline| earlier(earliest, *deadline))
}

/// Whether a deadline, if there is one, has come.
#[must_use]
#[cfg_attr(target_pointer_width = "32", inline(never))]
#[cfg_attr(not(target_pointer_width = "32"), inline)]
pub fn is_due(deadline: Option<Duration>, now: Duration) -> bool {
    deadline.is_some_and(|deadline| now >= deadline)
}

/// `ms` milliseconds after a moment.
#[must_use]
#[cfg_attr(target_pointer_width = "32", inline(never))]
#[cfg_attr(not(target_pointer_width = "32"), inline)]
pub fn after_ms(now: Duration, ms: u32) -> Duration {
    after(now, Duration::from_millis(u64::from(ms)))
}

/// `time` after `now`.
#[must_use]
#[cfg_attr(target_pointer_width = "32", inline(never))]
#[cfg_attr(not(target_pointer_width = "32"), inline)]
pub fn after(now: Duration, time: Duration) -> Duration {
    now.saturating_add(time)
}

/// `time` before `now`, zero at the earliest.
#[must_use]
#[cfg_attr(target_pointer_width = "32", inline(never))]
#[cfg_attr(not(target_pointer_width = "32"), inline)]
pub fn before(now: Duration, time: Duration) -> Duration {
    now.saturating_sub(time)
}

/// The next moment of a grid after one that has come; those that were missed are not made up for.
#[must_use]
pub fn next(last: Duration, period: Duration, now: Duration) -> Duration {
    let next = after(last, period);
    if is_due(Some(next), now) { after(now, period) } else { next }
}
