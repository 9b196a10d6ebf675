//! Engines on one bus, on virtual time.

use core::time::Duration;
use std::collections::VecDeque;

use pdo::Frame;

use super::bus::{Bus, Event, StationId};

/// Anything with an engine's shape: frames and time in, frames out.
pub trait Node {
    /// A frame of another station.
    fn handle_frame(&mut self, now: Duration, frame: &Frame);
    /// Time goes on; a spurious call changes nothing.
    fn handle_timeout(&mut self, now: Duration);
    /// The next frame to send.
    fn poll_transmit(&mut self, now: Duration) -> Option<Frame>;
    /// When to call [`handle_timeout`](Self::handle_timeout); `None` = idle.
    fn poll_timeout(&self) -> Option<Duration>;
    /// What the bus says beside frames: errors, error states.
    fn handle_bus(&mut self, _now: Duration, _event: Event) {}
}

/// A station whose program looks after the bus only now and then, as one does that works in cycles: what
/// is received waits for it, and what it sends is put here.
#[derive(Debug, Default)]
pub struct Mailbox {
    /// Frames received and when, oldest first.
    pub received: VecDeque<(Duration, Frame)>,
    /// Frames to send.
    pub to_send: VecDeque<Frame>,
}

impl Node for Mailbox {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        self.received.push_back((now, *frame));
    }

    fn handle_timeout(&mut self, _now: Duration) {}

    fn poll_transmit(&mut self, _now: Duration) -> Option<Frame> {
        self.to_send.pop_front()
    }

    fn poll_timeout(&self) -> Option<Duration> {
        None
    }
}

/// Nodes on a bus. The caller keeps the nodes; node `i` of the slice is station `i` of the bus.
#[derive(Debug)]
pub struct Network {
    now: Duration,
    bus: Bus,
    stations: Vec<StationId>,
}

impl Network {
    /// A network of `nodes` stations.
    #[must_use]
    pub fn new(mut bus: Bus, nodes: usize) -> Self {
        let stations = (0..nodes).map(|_| bus.connect()).collect();
        Self { now: Duration::ZERO, bus, stations }
    }

    /// Virtual time.
    #[must_use]
    pub const fn now(&self) -> Duration {
        self.now
    }

    /// The bus.
    pub const fn bus(&mut self) -> &mut Bus {
        &mut self.bus
    }

    /// The station of a node.
    #[must_use]
    pub fn station(&self, node: usize) -> Option<StationId> {
        self.stations.get(node).copied()
    }

    /// Goes on to the next moment at which something happens; `false` if nothing does by `limit`, which
    /// then is the time.
    pub fn step(&mut self, nodes: &mut [&mut dyn Node], limit: Duration) -> bool {
        for (node, station) in nodes.iter_mut().zip(&self.stations) {
            while self.bus.room(*station) > 0 {
                let Some(frame) = node.poll_transmit(self.now) else { break };
                // There is room; a station off the bus loses the frame, as a driver's queue would.
                let _ = self.bus.send(self.now, *station, frame);
            }
        }
        // A node that waits for room in its queue is not asked again until there is.
        let now = self.now;
        let waits = |station: &StationId| self.bus.room(*station) == 0;
        let timeouts = nodes
            .iter()
            .zip(&self.stations)
            .filter_map(|(node, station)| node.poll_timeout().filter(|at| *at > now || !waits(station)));
        let next = timeouts.chain(self.bus.poll_timeout()).min().filter(|next| *next <= limit);
        let Some(next) = next else {
            self.now = self.now.max(limit);
            return false;
        };
        self.now = self.now.max(next);
        self.bus.handle_timeout(self.now);
        for (node, station) in nodes.iter_mut().zip(&self.stations) {
            while let Some((at, event)) = self.bus.poll_event(*station) {
                match event {
                    Event::Received(frame) => node.handle_frame(at, &frame),
                    other => node.handle_bus(at, other),
                }
            }
            if node.poll_timeout().is_some_and(|at| at <= self.now) {
                node.handle_timeout(self.now);
            }
        }
        true
    }

    /// Steps until `done` says so or `limit` has come; whether `done` did.
    pub fn run_until(
        &mut self,
        nodes: &mut [&mut dyn Node],
        limit: Duration,
        mut done: impl FnMut(&mut [&mut dyn Node]) -> bool,
    ) -> bool {
        loop {
            if done(nodes) {
                return true;
            }
            if !self.step(nodes, limit) {
                return done(nodes);
            }
        }
    }
}
