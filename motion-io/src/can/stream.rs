//! LB2 over CAN: a byte stream over an open CAN endpoint ([`lb2::can`]).

use core::fmt;
use core::time::Duration;
use std::io;
use std::time::Instant;

use embedded_can::StandardId;
use lb2::can::{FROM_DEVICE, TO_DEVICE, bytes, frames};
use pdo::Frame;

use super::{CanPort, Event};
use crate::port::{Port, Role};

/// Longest wait for a transmit queue that is full.
const QUEUE: Duration = Duration::from_secs(1);
/// How often a full queue is tried again; a frame at 125 kbit/s takes about 1 ms.
const AGAIN: Duration = Duration::from_millis(1);

/// A CAN endpoint as a [`Port`]. Frames of other identifiers are passed over, and so is what the bus
/// says of itself: the engine above tells silence.
pub struct Stream {
    port: Box<dyn CanPort>,
    out: StandardId,
    into: StandardId,
}

impl fmt::Debug for Stream {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Stream").field("out", &self.out).field("into", &self.into).finish_non_exhaustive()
    }
}

impl Stream {
    /// The stream on `port`, seen from one side.
    #[must_use]
    pub fn new(port: Box<dyn CanPort>, role: Role) -> Self {
        let (out, into) = match role {
            Role::Master => (TO_DEVICE, FROM_DEVICE),
            Role::Device => (FROM_DEVICE, TO_DEVICE),
        };
        Self { port, out, into }
    }

    fn send_frame(&mut self, frame: &Frame) -> io::Result<()> {
        let start = Instant::now();
        loop {
            match self.port.send(frame) {
                Err(error) if error.kind() == io::ErrorKind::WouldBlock && start.elapsed() < QUEUE => {
                    std::thread::sleep(AGAIN);
                }
                result => return result,
            }
        }
    }
}

impl Port for Stream {
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let start = Instant::now();
        loop {
            let Some(event) = self.port.receive(timeout.saturating_sub(start.elapsed()))? else {
                return Ok(0);
            };
            if let Event::Frame(frame) = event
                && let Some(data) = bytes(self.into, &frame).filter(|data| !data.is_empty())
            {
                // Eight bytes at most: no caller's buffer is smaller.
                let room = buffer.get_mut(..data.len()).ok_or(io::ErrorKind::InvalidInput)?;
                room.copy_from_slice(data);
                return Ok(data.len());
            }
            if start.elapsed() >= timeout {
                return Ok(0);
            }
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        frames::<Frame>(self.out, bytes).try_for_each(|frame| self.send_frame(&frame))
    }
}
