//! Real time: the beginning of each cycle on an even grid, and how well it was met.

use core::time::Duration;
use std::time::Instant;

use serde_json::{Value, json};

/// Upper bounds of the histogram's classes, µs; the last class is above them.
const BOUNDS: [u64; 10] = [10, 20, 50, 100, 200, 500, 1_000, 2_000, 5_000, 10_000];

/// How late cycles began.
#[derive(Debug, Clone, Default)]
pub(super) struct Jitter {
    counts: [u64; BOUNDS.len() + 1],
    worst: Duration,
    pub(super) cycles: u64,
    /// Cycles that could not begin before the next one was due.
    pub(super) overruns: u64,
}

impl Jitter {
    fn record(&mut self, late: Duration) {
        let micros = u64::try_from(late.as_micros()).unwrap_or(u64::MAX);
        let class = BOUNDS.iter().position(|&bound| micros < bound).unwrap_or(BOUNDS.len());
        self.counts[class] += 1;
        self.worst = self.worst.max(late);
        self.cycles += 1;
    }

    pub(super) const fn worst(&self) -> Duration {
        self.worst
    }

    /// Classes with their upper bound in µs; of the last, `null`.
    pub(super) fn document(&self) -> Value {
        let bounds = BOUNDS.iter().copied().map(Some).chain([None]);
        bounds.zip(self.counts).map(|(bound, count)| json!({ "below_us": bound, "cycles": count })).collect()
    }

    pub(super) fn lines(&self) -> Vec<String> {
        let bounds = BOUNDS.iter().map(|bound| format!("< {bound:>5} µs")).chain(["   more   ".into()]);
        let total = self.cycles.max(1) as f64;
        bounds
            .zip(self.counts)
            .map(|(bound, count)| {
                let share = count as f64 / total;
                format!("{bound} {count:>9}  {}", "#".repeat((share * 50.0).ceil() as usize))
            })
            .collect()
    }
}

/// Keeps the grid.
#[derive(Debug)]
pub(super) struct Pace {
    start: Instant,
    /// Of the next cycle, since the start.
    next: Duration,
    pub(super) jitter: Jitter,
}

impl Pace {
    pub(super) fn new() -> Self {
        Self { start: Instant::now(), next: Duration::ZERO, jitter: Jitter::default() }
    }

    pub(super) fn now(&self) -> Duration {
        self.start.elapsed()
    }

    /// How long until the next cycle.
    pub(super) fn remaining(&self) -> Duration {
        self.next.saturating_sub(self.now())
    }

    /// Waits for the next cycle and returns when it was due. A cycle that is missed as a whole is an
    /// overrun, and is not made up for.
    pub(super) fn wait(&mut self, cycle: Duration) -> Duration {
        std::thread::sleep(self.remaining());
        let late = self.now().saturating_sub(self.next);
        self.jitter.record(late);
        let due = self.next;
        self.next += cycle;
        while self.next + cycle <= self.now() {
            self.next += cycle;
            self.jitter.overruns += 1;
        }
        due
    }
}

/// Asks the system for real time; says what it did not grant.
pub(super) fn real_time() -> Vec<String> {
    let mut missing = Vec::new();
    #[cfg(target_os = "linux")]
    {
        use rustix::mm::{MlockAllFlags, mlockall};
        use thread_priority::{
            RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy,
            set_thread_priority_and_policy, thread_native_id,
        };
        if let Err(error) = mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE) {
            missing.push(format!("memory is not locked: {error}"));
        }
        let priority = ThreadPriority::from_posix(thread_priority::ScheduleParams { sched_priority: 80 });
        let fifo = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
        if let Err(error) = set_thread_priority_and_policy(thread_native_id(), priority, fifo) {
            missing.push(format!("no real-time scheduling (SCHED_FIFO): {error:?}"));
        }
    }
    #[cfg(not(target_os = "linux"))]
    missing.push("no real-time scheduling on this system".into());
    missing
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_histogram_counts_every_cycle() {
        let mut jitter = Jitter::default();
        for micros in [0, 9, 10, 199, 200, 9_999, 10_000, 1_000_000] {
            jitter.record(Duration::from_micros(micros));
        }
        assert_eq!(jitter.counts, [2, 1, 0, 0, 1, 1, 0, 0, 0, 1, 2]);
        assert_eq!((jitter.cycles, jitter.worst()), (8, Duration::from_secs(1)));
        assert_eq!(jitter.lines().len(), 11);
    }
}
