#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod can;
pub mod conversation;
pub mod plant;
pub mod serial;
