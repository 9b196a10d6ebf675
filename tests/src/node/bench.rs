//! A virtual node at the end of a wire, on virtual time; with faults, if the test of the test wants them.

use core::time::Duration;
use std::collections::VecDeque;
use std::io;

use device_sim::can::Node;
use pdo::Frame;

use super::Wire;

/// What a frame takes on a bus of 500 kbit/s, about.
const FRAME: Duration = Duration::from_micros(250);

/// A virtual node as a [`Wire`]. `twist` sees each frame of the node, with those that were sent to it
/// before, and puts others, or none, in its place; after each frame that is sent to the node it is called
/// without one.
pub struct Bench<N, F> {
    node: N,
    now: Duration,
    twist: F,
    /// Sent to the node, newest last.
    heard: Vec<Frame>,
    ready: VecDeque<Frame>,
}

impl<N: Node, F> core::fmt::Debug for Bench<N, F> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Bench").field("now", &self.now).finish_non_exhaustive()
    }
}

impl<N: Node, F: FnMut(&[Frame], Option<Frame>) -> Vec<Frame>> Bench<N, F> {
    /// Starts the node.
    pub const fn new(node: N, twist: F) -> Self {
        Self { node, now: Duration::ZERO, twist, heard: Vec::new(), ready: VecDeque::new() }
    }

    fn collect(&mut self) {
        while let Some(frame) = self.node.poll_transmit(self.now) {
            self.ready.extend((self.twist)(&self.heard, Some(frame)));
        }
    }
}

impl<N: Node, F: FnMut(&[Frame], Option<Frame>) -> Vec<Frame>> Wire for Bench<N, F> {
    fn now(&self) -> Duration {
        self.now
    }

    fn send(&mut self, frame: &Frame) -> io::Result<()> {
        self.collect();
        self.now += FRAME;
        self.heard.push(*frame);
        self.node.handle_frame(self.now, frame);
        self.collect();
        self.ready.extend((self.twist)(&self.heard, None));
        Ok(())
    }

    fn receive(&mut self, until: Duration) -> io::Result<Option<Frame>> {
        loop {
            self.collect();
            if let Some(frame) = self.ready.pop_front() {
                self.now += FRAME;
                return Ok(Some(frame));
            }
            match self.node.poll_timeout() {
                Some(at) if at <= until => {
                    self.now = self.now.max(at);
                    self.node.handle_timeout(self.now);
                }
                _ => {
                    self.now = self.now.max(until);
                    return Ok(None);
                }
            }
        }
    }
}
