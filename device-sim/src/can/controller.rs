//! A MotionController's CAN bus as a station.

use core::time::Duration;

use motion_core::bus::CanBus;
use pdo::Frame;

use super::{Event, Node};

impl Node for CanBus {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        Self::handle_frame(self, now, frame);
    }

    fn handle_timeout(&mut self, now: Duration) {
        Self::handle_timeout(self, now);
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        Self::poll_transmit(self, now)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        Self::poll_timeout(self)
    }

    fn handle_bus(&mut self, now: Duration, event: Event) {
        if let Event::State(state) = event {
            Self::handle_bus(self, now, state.into());
        }
    }
}
