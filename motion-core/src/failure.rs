//! The list of stored failures (manual A 4.3.4.2), and failure numbers that the manual does not name,
//! for what its operating system watches all the same.
//!
//! These are all project-defined; they go into the same list as the manual's own and are read over LB2
//! 50h. A limit switch has the number of the error code that it gives a motion command (6.8.1.1).

use lb2::code::{Failure, StoredFailure};
use lb2::telegram::MAX_FAILURES;

/// Upper software limit `[930]` passed.
pub const SW_LIMIT_PLUS: Failure = Failure(0x04);
/// Lower software limit `[942]` passed.
pub const SW_LIMIT_MINUS: Failure = Failure(0x08);
/// Upper hardware limit switch `[954]`.
pub const HW_LIMIT_PLUS: Failure = Failure(0x40);
/// Lower hardware limit switch `[966]`.
pub const HW_LIMIT_MINUS: Failure = Failure(0x80);
/// An actual value input gives no reading: wire break, or no answer from a drive on the CAN bus.
pub const READING_LOST: Failure = Failure(100);
/// An actual value jumped by more than `[184]` and stayed there for more than `[191]` cycles (6.6.1).
pub const ACTUAL_VALUE_JUMP: Failure = Failure(101);
/// A drive on a CAN bus does not answer its guarding any more (6.5.1.1), or other parameters have taken it
/// from its axis.
pub const DRIVE_LOST: Failure = Failure(102);
/// A drive on a CAN bus reports a fault.
pub const DRIVE_FAULT: Failure = Failure(103);
/// A drive is not in the operating mode "digital speed" (6.6.1.3).
pub const DRIVE_MODE: Failure = Failure(104);

/// What a failure means: the manual's text, or this project's; `None` for a number of neither.
#[must_use]
pub const fn text(failure: Failure) -> Option<&'static str> {
    match failure {
        SW_LIMIT_PLUS => Some("upper software limit passed"),
        SW_LIMIT_MINUS => Some("lower software limit passed"),
        HW_LIMIT_PLUS => Some("upper hardware limit switch"),
        HW_LIMIT_MINUS => Some("lower hardware limit switch"),
        READING_LOST => Some("no reading from the actual value input"),
        ACTUAL_VALUE_JUMP => Some("actual value jumped by more than Failure diff. MAX"),
        DRIVE_LOST => Some("drive lost on the CAN bus"),
        DRIVE_FAULT => Some("drive reports a fault"),
        DRIVE_MODE => Some("drive is not in the operating mode digital speed"),
        other => other.text(),
    }
}

/// The list of up to 20 failures; of more, the oldest is dropped (project-defined).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FailureLog {
    stored: [StoredFailure; MAX_FAILURES],
    count: usize,
    total: u32,
}

impl Default for FailureLog {
    fn default() -> Self {
        Self { stored: [StoredFailure { axis: 0, failure: Failure(0) }; MAX_FAILURES], count: 0, total: 0 }
    }
}

impl FailureLog {
    /// The failures, oldest first.
    #[must_use]
    pub fn stored(&self) -> &[StoredFailure] {
        self.stored.get(..self.count).unwrap_or(&[])
    }

    /// Adds one.
    pub fn store(&mut self, failure: StoredFailure) {
        self.total = self.total.wrapping_add(1);
        if self.count == MAX_FAILURES {
            self.stored.rotate_left(1);
            self.count -= 1;
        }
        if let Some(slot) = self.stored.get_mut(self.count) {
            *slot = failure;
            self.count += 1;
        }
    }

    /// How many were ever added since switching on, for those who watch for new ones; wraps.
    #[must_use]
    pub const fn total(&self) -> u32 {
        self.total
    }

    /// Deletes all; how many there were.
    pub const fn clear(&mut self) -> usize {
        core::mem::replace(&mut self.count, 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn own_numbers_are_none_of_the_manuals() {
        let own = [
            SW_LIMIT_PLUS,
            SW_LIMIT_MINUS,
            HW_LIMIT_PLUS,
            HW_LIMIT_MINUS,
            READING_LOST,
            ACTUAL_VALUE_JUMP,
            DRIVE_LOST,
            DRIVE_FAULT,
            DRIVE_MODE,
        ];
        for (at, failure) in own.iter().enumerate() {
            assert!(failure.text().is_none() && text(*failure).is_some(), "{failure:?}");
            assert!(!own[..at].contains(failure));
        }
        assert_eq!(text(Failure::DELTA_S_MAX), Some("DeltaS > DeltaS max."));
    }
}
