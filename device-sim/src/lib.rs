#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod can;
pub mod canopen;
pub mod conversation;
pub mod linmot;
pub mod plant;
pub mod serial;
