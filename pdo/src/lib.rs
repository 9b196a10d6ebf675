#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod address;
pub mod cob;
mod frame;
mod handled;
mod node;

pub use address::Address;
pub use cob::{CobId, Service};
pub use frame::Frame;
pub use handled::Handled;
pub use node::{NodeId, NodeIdError};
