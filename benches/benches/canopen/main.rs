//! SDO, PDO and the master's cycle against canopen-rs 0.6, whose loops here are its codec alone: encode,
//! decode, store. Ours are the whole engines: frame dispatch by identifier, transfer state, time-outs,
//! checks, outcome, and on the server's side the object dictionary.
//!
//! `cargo bench -p benches --bench canopen` runs it all and ends with status 1 when a ratio is below its
//! bar; `-- --smoke` runs every measurement a few times and judges nothing.

mod process;
mod sdo;

use std::process::ExitCode;

use benches::{Contender, Times, paired};

/// Measures and judges; contender 0 is always ours, 1 canopen-rs.
struct Judge {
    smoke: bool,
    missed: u32,
}

impl Judge {
    fn measure(&self, rounds: usize, contenders: &mut [Contender<'_>]) -> Times {
        paired(contenders, if self.smoke { 3 } else { rounds })
    }

    /// How many times as fast as canopen-rs, at least `bar`; both do the same `work`, in millions of
    /// `unit`.
    fn faster(&mut self, what: &str, bar: f64, (work, unit): (f64, &str), times: &Times) {
        let rate = |which: usize| work / times.median(which).as_secs_f64() / 1e6;
        let ratio = times.ratio(1, 0);
        let (ours, theirs, verdict) = (rate(0), rate(1), self.verdict(ratio >= bar));
        println!(
            "{what:34} {ours:8.1} {unit}  canopen-rs {theirs:8.1} {unit}  {ratio:5.2} x  at least {bar:.2}{verdict}"
        );
    }

    /// How many of canopen-rs's units of work take as long as one of ours, at most `bar`; each contender
    /// does so many at once.
    fn costs(&mut self, what: &str, bar: f64, units: [u32; 2], times: &Times) {
        let [ours, theirs] = [0, 1].map(|which| times.median(which) / units[which]);
        let ratio = times.ratio(0, 1) * f64::from(units[1]) / f64::from(units[0]);
        let verdict = self.verdict(ratio <= bar);
        println!(
            "{what:34} {ours:8.1?}       canopen-rs {theirs:8.1?}       {ratio:5.2} x  at most {bar:.2}{verdict}"
        );
    }

    fn verdict(&mut self, met: bool) -> &'static str {
        self.missed += u32::from(!met);
        if met { "" } else { "  MISSED" }
    }
}

fn main() -> ExitCode {
    let mut judge = Judge { smoke: std::env::args().any(|arg| arg == "--smoke"), missed: 0 };
    sdo::run(&mut judge);
    process::run(&mut judge);
    if judge.missed > 0 && !judge.smoke {
        println!("{} bars are missed", judge.missed);
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}
