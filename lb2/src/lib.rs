#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate alloc;
#[cfg(test)]
extern crate std;

#[cfg(feature = "can")]
pub mod can;
pub mod code;
pub mod device;
pub mod frame;
pub mod master;
pub mod telegram;
