//! A recording of everything that reached a whole controller with six axes: what its terminals brought in
//! every cycle, frames of both CAN buses, bytes on its serial ports. Played to a fresh controller it gives
//! a hash of all that the controller puts out, the same on every machine.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "record")]
extern crate alloc;

mod program;
mod record;
mod replica;

pub use program::{FAR, Program};
pub use record::{Encoder, Record, What, records};
pub use replica::{Counts, Replica};

/// The recording that is committed: `tests/determinism` makes it.
pub static RECORDING: &[u8] = include_bytes!("../recording.bin");

/// Cycles between two hashes that are told.
const MILESTONE: u32 = 250;

/// Plays the committed recording; `say` is told the hash now and then, the number of cycles with it.
/// What the controller did in all.
///
/// # Errors
/// The recording is damaged.
pub fn replay(
    storage: &mut [u8],
    ram: &mut [u8],
    mut say: impl FnMut(u32, u64),
) -> Result<(Counts, u64), postcard::Error> {
    let mut replica = Replica::new(storage, ram);
    let mut told = 0;
    for record in records(RECORDING) {
        replica.take(&record?, |_, _| ());
        let cycles = replica.counts().cycles;
        if cycles >= told + MILESTONE {
            told = cycles;
            say(cycles, replica.hash());
        }
    }
    Ok((*replica.counts(), replica.hash()))
}
