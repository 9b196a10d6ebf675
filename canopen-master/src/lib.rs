#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(any(test, feature = "std"))]
extern crate std;

pub mod boot;
mod bus;
pub mod data_type;
pub mod ds401;
pub mod ds402;
#[cfg(feature = "eds")]
pub mod eds;
pub mod emcy;
pub mod guarding;
pub mod heartbeat;
pub mod lss;
pub mod master;
pub mod nmt;
mod node_set;
pub mod od;
pub mod pdo_setup;
mod ring;
pub mod scan;
pub mod sdo;
pub mod slave;
pub mod sync;
pub mod time;
#[cfg(feature = "alloc")]
pub mod trace;

pub use bus::BusStatus;
pub use node_set::NodeSet;
pub use pdo::{Address, Frame, Handled, NodeId};

use pdo::clock;
