//! `motionctl can …`, `motionctl bus`, and virtual nodes: work on a CANopen bus.

pub(crate) mod bus;
pub(crate) mod cli;
mod dcf;
mod link;
mod lss;
mod network;
mod pdo;
pub(crate) mod record;
mod sdo;
pub(crate) mod session;
pub(crate) mod sim;
pub(crate) mod value;

use core::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use crate::cli::Global;
use crate::exit::Exit;
use crate::output::Output;
use cli::Can;

pub(crate) fn run(out: &Output, global: &Global, command: &Can) -> Result<(), Exit> {
    match command {
        Can::Scan { line, nodes } => network::scan(out, global, line, nodes.as_deref()),
        Can::Nmt { command, node, line } => network::nmt(out, global, line, *command, node),
        Can::Guard { nodes, line, period, life, stream } => {
            network::guard(out, global, line, nodes, (*period, *life), stream)
        }
        Can::Sdo { command } => sdo::run(out, global, command),
        Can::Pdo { command } => pdo::run(out, global, command),
        Can::Lss { command } => lss::run(out, global, command),
        Can::Dcf { node, file, line } => dcf::run(out, global, line, *node, file),
        Can::Link { command } => link::run(out, global, command),
        Can::Emcy { line, stream } => network::emcy(out, global, line, stream),
        Can::Monitor { line, stream } => network::monitor(out, global, line, stream),
        Can::Record { file, line, stream } => record::run(out, global, line, file, stream),
    }
}

static STOP: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Set by a signal that asks the program to stop, and by [`stop`].
pub(crate) fn stop_flag() -> Result<Arc<AtomicBool>, Exit> {
    if STOP.set(Arc::default()).is_ok() {
        let handler = || {
            SIGNAL.store(true, Ordering::Relaxed);
            stop();
        };
        ctrlc::set_handler(handler).map_err(|error| Exit::trouble(error.to_string()))?;
    }
    Ok(STOP.get().map(Arc::clone).unwrap_or_default())
}

/// A signal has come that nobody has looked at.
static SIGNAL: AtomicBool = AtomicBool::new(false);

/// Whether a signal has asked the program to stop since this was asked last; [`stop_flag`] catches them.
pub(crate) fn interrupted() -> bool {
    SIGNAL.swap(false, Ordering::Relaxed)
}

/// Asks a command that runs until it is stopped to stop.
pub(crate) fn stop() {
    if let Some(flag) = STOP.get() {
        flag.store(true, Ordering::Relaxed);
    }
}
