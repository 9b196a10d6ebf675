//! `motionctl monitor`: a bus, a controller or a capture on a screen, or one snapshot of it.
//!
//! What is known of the subject (`bus`, fed by `listen` and `replay`; `controller`, fed by `poll`; `line`) is
//! kept apart from the screen: it gives a `sheet` of tables, which `screen` draws and `--once` prints, and a
//! JSON document. Its times are seconds; what is not known is null:
//!
//! - all: `source`, `story` (lines as `decode` words them);
//! - buses: `seconds`, `bitrate`, `by_kind`; `buses` with `bus`, `state`, `frames`, `error_frames`, `overruns`,
//!   and `now` (the last second), `mean` and `peak` of `frames_per_second`, `bits_per_second`, `load_percent`;
//!   `nodes` with `bus`, `node`, `state`, `drive`, `device_type`, `profile`, `name`, `identity`, `frames`, `age`,
//!   `error_control` (`kind`, `period`, `age`, `missed`, `silent`), `toggle_errors`, `boot_ups`, `emergencies`,
//!   `emergency`, `sdo`; `repeating` with `bus`, `what`, `count`, `period`, `shortest`, `longest`, `age`,
//!   `changes`, `data`, `values`; of a capture `frames` and `damaged`;
//! - a controller: `seconds`, `answers`, `identity`, `failures`, `axes_activated`, `plc`, `axes`, `can`, and what
//!   was asked for: `parameters`, `ram`;
//! - a capture of an LB2 line: `telegrams`, `discarded_bytes`, `functions`, `errors`, `parameters`.

mod bus;
pub(crate) mod cli;
mod controller;
mod draw;
mod line;
mod lines;
mod listen;
mod nodes;
mod poll;
mod replay;
mod screen;
mod sheet;
mod time;
mod traffic;

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::time::Instant;

use serde_json::Value;

use crate::cli::Global;
use crate::decode::names::Names;
use crate::exit::Exit;
use crate::output::Output;
use cli::{Monitor, Source};
use sheet::Sheet;

/// What a monitor shows.
trait Subject {
    /// Takes in what comes, waiting for it no longer than `wait`.
    fn advance(&mut self, wait: Duration) -> Result<(), Exit>;
    /// Whether enough is known for one snapshot, after so long.
    fn enough(&self, heard_for: Duration) -> bool;
    /// For people.
    fn sheet(&self) -> Sheet;
    /// For programs.
    fn document(&self) -> Value;
    /// Goes to another moment, where there are others; whether there are.
    fn go(&mut self, _step: Step) -> Result<bool, Exit> {
        Ok(false)
    }
}

/// A way through the time of a capture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Step {
    /// By a small step.
    Forth,
    Back,
    /// By a twentieth of it.
    FarForth,
    FarBack,
    Start,
    End,
}

pub(crate) fn run(out: &Output, global: &Global, args: &Monitor) -> Result<(), Exit> {
    let limit = args.stream.limit;
    if out.json && !args.once {
        return Err(Exit::usage("--json needs --once: the screen is for people"));
    }
    if !args.once {
        screen::needs_terminal()?;
    }
    let reading = &args.reading;
    let names = Names::read(&reading.eds, &reading.linmot)?;
    let mut subject: Box<dyn Subject + '_> = match args.source(global)? {
        Source::Can(endpoint) => Box::new(listen::Listening::open(&endpoint, &names, args)?),
        Source::Port(line) => Box::new(poll::Asking::open(out, global, &line, args, !args.once)?),
        Source::Capture(file) => replay::open(&file, reading, &names, args.bitrate)?,
    };
    if args.once {
        let stop = crate::can::stop_flag()?;
        once(out, &mut *subject, limit, &stop)
    } else {
        screen::show(out, &mut *subject, limit)
    }
}

/// One snapshot, after the source has been listened to for `limit`, or for as long as it takes.
fn once(
    out: &Output,
    subject: &mut dyn Subject,
    limit: Option<Duration>,
    stop: &AtomicBool,
) -> Result<(), Exit> {
    let start = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        let passed = start.elapsed();
        if limit.map_or_else(|| subject.enough(passed), |limit| passed >= limit) {
            break;
        }
        subject.advance(screen::TURN)?;
    }
    out.document(subject.document(), || crate::output::put_text(&subject.sheet().text()));
    Ok(())
}
