#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(any(test, feature = "alloc"))]
extern crate alloc;
#[cfg(test)]
extern crate std;

pub mod application;
mod axis;
pub mod bus;
pub mod control;
mod controller;
pub mod failure;
pub mod input;
pub mod io;
pub mod loader;
pub mod output;
pub mod parameters;
pub mod storage;
pub mod trajectory;

pub use axis::Axis;
pub use controller::{
    AXES, CONFIGURATION_PASSWORD, ComPort, Controller, Model, OS_VERSION, Parity, Reset, ResetError,
    SERVICE_PASSWORD, STORAGE_LEN, SerialPort, WrongPassword, is_damaged, stored_model,
};
