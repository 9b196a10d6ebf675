//! `motionctl monitor`: a bus, a controller or a capture on a screen, or one snapshot of it.
//!
//! What is known of the subject (`bus`, fed by `listen` and `replay`; `controller`, fed by its poller) is
//! kept apart from the screen: it gives a `sheet` of tables, which `screen` draws and `--once` prints, and a
//! JSON document.

mod bus;
pub(crate) mod cli;
mod draw;
mod listen;
mod nodes;
mod screen;
mod sheet;
mod traffic;

use core::time::Duration;

use serde_json::Value;

use crate::cli::Global;
use crate::decode::names::Names;
use crate::exit::Exit;
use crate::output::Output;
use cli::Monitor;
use sheet::Sheet;

/// How long a live source is listened to for one snapshot, unless `--for` says otherwise.
const ONCE: Duration = Duration::from_secs(1);

/// What a monitor shows.
trait Subject {
    /// Takes in what comes, waiting for it no longer than `wait`; whether something new may be shown.
    fn advance(&mut self, wait: Duration) -> Result<(), Exit>;
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
    /// By a tenth of it.
    FarForth,
    FarBack,
    Start,
    End,
}

pub(crate) fn run(out: &Output, global: &Global, args: &Monitor) -> Result<(), Exit> {
    let limit = args.stream.seconds.map(|seconds| crate::can::session::duration("--for", seconds));
    let limit = limit.transpose()?;
    if out.json && !args.once {
        return Err(Exit::usage("--json needs --once: the screen is for people"));
    }
    if !args.once {
        screen::needs_terminal()?;
    }
    let names = Names::read(&args.eds, &args.linmot)?;
    let mut subject: Box<dyn Subject + '_> = match args.source(global)? {
        cli::Source::Can(endpoint) => Box::new(listen::Listening::open(&endpoint, &names, args)?),
    };
    if args.once {
        let stop = crate::can::stop_flag()?;
        once(out, &mut *subject, limit.unwrap_or(ONCE), &stop)
    } else {
        screen::show(out, &mut *subject, limit)
    }
}

/// One snapshot, after the source has been listened to.
fn once(
    out: &Output,
    subject: &mut dyn Subject,
    limit: Duration,
    stop: &core::sync::atomic::AtomicBool,
) -> Result<(), Exit> {
    let start = std::time::Instant::now();
    loop {
        let left = limit.saturating_sub(start.elapsed());
        if left.is_zero() || stop.load(core::sync::atomic::Ordering::Relaxed) {
            break;
        }
        subject.advance(left.min(screen::TURN))?;
    }
    out.document(subject.document(), || crate::output::put(subject.sheet().text()));
    Ok(())
}
