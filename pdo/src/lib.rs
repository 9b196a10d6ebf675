#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod address;
pub mod clock;
pub mod cob;
mod communication;
mod frame;
mod handled;
pub mod layout;
pub mod mapping;
mod node;
mod payload;
mod rpdo;
mod tpdo;
mod transmission;

pub use address::Address;
pub use cob::{CobId, DefaultPdo, Service};
pub use communication::Communication;
pub use frame::Frame;
pub use handled::Handled;
pub use mapping::Mapping;
pub use node::{NodeId, NodeIdError};
pub use payload::{Bits, Payload};
pub use rpdo::{LengthCheck, Rpdo, RpdoEvent, RpdoFault};
pub use tpdo::Tpdo;
pub use transmission::{Transmission, TransmissionError};
