#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod channel;
mod link;
mod payload;

pub use channel::{BASE_ID, BIT_RATE, CHANNELS, Channel, ChannelError, Role, Setting, SettingError, Trigger};
pub use link::{Event, Handled, Link, Received, SubmitError};
pub use payload::Payload;
