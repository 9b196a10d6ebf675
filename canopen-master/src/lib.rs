#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod ds401;
pub mod ds402;
pub mod emcy;
pub mod guarding;
pub mod heartbeat;
pub mod lss;
pub mod nmt;
mod ring;
pub mod sync;
pub mod time;
