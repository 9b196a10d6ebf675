#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(any(test, feature = "alloc"))]
extern crate alloc;
#[cfg(test)]
extern crate std;

pub mod client;
pub mod code;
pub mod curve;
pub mod drive;
pub mod link;
pub mod linrs;
pub mod module;
pub mod pvl;
pub mod range;
pub mod request;
pub mod sdo;
pub mod table;
pub mod upid;
