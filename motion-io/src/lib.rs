#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]
// The one crate of the family, beside the program, that reads a clock.
#![allow(clippy::disallowed_methods)]

pub mod can;
pub mod capture;
mod clock;
#[cfg(feature = "tokio")]
pub mod codec;
pub mod endpoint;
pub mod lb2;
pub mod linmot;
pub mod port;
#[cfg(all(feature = "pty", unix))]
mod pty;
#[cfg(feature = "serial")]
mod serial;
mod tcp;
