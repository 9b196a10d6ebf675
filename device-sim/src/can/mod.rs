//! A virtual CAN bus on virtual time: exact bit times with stuffing and CRC-15, arbitration,
//! acknowledge, error frames, error counters with error passive, bus-off and recovery (ISO 11898-1),
//! and seeded faults.
//!
//! [`Bus`] moves frames between stations. [`Network`] lets engines talk over it.

mod bits;
mod bus;
mod controller;
mod counters;
mod faults;
mod network;

pub use bits::{CRC15_POLYNOMIAL, WireBits, arbitration, crc15};
pub use bus::{Bus, ErrorKind, Event, INTERMISSION, QUEUE, StationId, Statistics, TransmitError};
pub use counters::{Counters, State};
pub use faults::{Fault, Faults};
pub use network::{Mailbox, Network, Node};
