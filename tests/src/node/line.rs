//! A real endpoint as a wire.

use core::time::Duration;
use std::collections::VecDeque;
use std::io;

use motion_io::can::{CanPort, Driver, Engine};
use pdo::Frame;

use super::Wire;

/// An open CAN endpoint as a [`Wire`].
#[derive(Debug)]
pub struct Line {
    driver: Driver,
    mail: Mail,
}

#[derive(Debug, Default)]
struct Mail {
    out: VecDeque<Frame>,
    received: VecDeque<Frame>,
}

impl Engine for Mail {
    fn handle_frame(&mut self, _now: Duration, frame: &Frame) {
        self.received.push_back(*frame);
    }

    fn handle_timeout(&mut self, _now: Duration) {}

    fn poll_transmit(&mut self, _now: Duration) -> Option<Frame> {
        self.out.pop_front()
    }

    fn poll_timeout(&self) -> Option<Duration> {
        None
    }
}

impl Line {
    /// The wire behind `port`.
    #[must_use]
    pub fn new(port: Box<dyn CanPort>) -> Self {
        Self { driver: Driver::new(port), mail: Mail::default() }
    }

    fn turn(&mut self, until: Duration) -> io::Result<()> {
        self.driver.turn(&mut self.mail, until, |_, _, _| {})
    }
}

impl Wire for Line {
    fn now(&self) -> Duration {
        self.driver.now()
    }

    fn send(&mut self, frame: &Frame) -> io::Result<()> {
        self.mail.out.push_back(*frame);
        self.turn(self.driver.now())
    }

    fn receive(&mut self, until: Duration) -> io::Result<Option<Frame>> {
        loop {
            if let Some(frame) = self.mail.received.pop_front() {
                return Ok(Some(frame));
            }
            if self.driver.now() >= until {
                return Ok(None);
            }
            self.turn(until)?;
        }
    }
}
