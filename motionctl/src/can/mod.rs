//! `motionctl can …`, `motionctl bus`: work on a CANopen bus.

pub(crate) mod bus;
pub(crate) mod cli;

use core::sync::atomic::{AtomicBool, Ordering};
use std::sync::Arc;

use crate::exit::Exit;

/// Set by a signal that asks the program to stop.
pub(crate) fn stop_flag() -> Result<Arc<AtomicBool>, Exit> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed))
        .map_err(|error| Exit::trouble(error.to_string()))?;
    Ok(stop)
}
