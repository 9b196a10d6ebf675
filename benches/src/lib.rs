//! Paired timing: all contenders run in turn within every round, so that what disturbs the machine
//! disturbs all of them, and only ratios within one round are compared. Time is the thread's own where
//! the system tells it: waiting for a processor that others use counts for nobody.
#![forbid(unsafe_code)]

use core::time::Duration;

/// Time that this thread has run.
#[cfg(unix)]
#[must_use]
pub fn thread_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec.try_into().unwrap_or(0), time.tv_nsec.try_into().unwrap_or(0))
}

/// Time since the first call.
#[cfg(not(unix))]
#[must_use]
#[allow(clippy::disallowed_methods, reason = "a bench measures time")]
pub fn thread_time() -> Duration {
    static START: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
    START.get_or_init(std::time::Instant::now).elapsed()
}

/// One of the things that are compared.
#[allow(missing_debug_implementations, reason = "holds a closure")]
pub struct Contender<'a> {
    /// What the report calls it.
    pub name: &'static str,
    run: Box<dyn FnMut() + 'a>,
}

impl<'a> Contender<'a> {
    /// A contender whose `run` does the whole work once.
    pub fn new(name: &'static str, run: impl FnMut() + 'a) -> Self {
        Self { name, run: Box::new(run) }
    }
}

/// Times of every contender, by round.
#[derive(Debug)]
pub struct Times {
    by_contender: Vec<Vec<Duration>>,
}

impl Times {
    /// Median time of one contender.
    #[must_use]
    pub fn median(&self, contender: usize) -> Duration {
        Duration::from_secs_f64(median(self.by_contender[contender].iter().map(Duration::as_secs_f64)))
    }

    /// Median over the rounds of `time(contender) / time(of)`: how many times as fast `of` is.
    #[must_use]
    pub fn ratio(&self, contender: usize, of: usize) -> f64 {
        let pairs = self.by_contender[contender].iter().zip(&self.by_contender[of]);
        median(pairs.map(|(other, own)| other.as_secs_f64() / own.as_secs_f64()))
    }
}

/// Runs every contender once per round, each round beginning with another one. The first round
/// warms up and does not count.
pub fn paired(contenders: &mut [Contender<'_>], rounds: usize) -> Times {
    let count = contenders.len();
    let mut by_contender = vec![Vec::with_capacity(rounds); count];
    for round in 0..=rounds {
        for turn in 0..count {
            let which = (round + turn) % count;
            let start = thread_time();
            (contenders[which].run)();
            let time = thread_time() - start;
            if round > 0 {
                by_contender[which].push(time);
            }
        }
    }
    Times { by_contender }
}

/// The middle one of the values.
#[must_use]
pub fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
