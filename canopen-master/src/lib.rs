#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(any(test, feature = "std"))]
extern crate std;

pub mod data_type;
pub mod ds401;
pub mod ds402;
#[cfg(feature = "eds")]
pub mod eds;
pub mod emcy;
pub mod guarding;
pub mod heartbeat;
pub mod lss;
pub mod nmt;
mod ring;
pub mod sdo;
pub mod sync;
pub mod time;

pub use pdo::{Address, Frame, Handled, NodeId};
