//! The clock of this machine.

use core::time::Duration;
use std::sync::LazyLock;
use std::time::Instant;

/// Time since this was first asked.
pub(crate) fn now() -> Duration {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    START.elapsed()
}
