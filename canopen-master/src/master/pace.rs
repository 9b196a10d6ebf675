//! Pace of scans: how many of the frames that were handed out still wait to be sent.

use core::time::Duration;

use pdo::NodeId;

use crate::clock::{after, before, is_due};
use crate::node_set::NodeSet;

/// Frames that may wait when a scan adds one: the transmit queue stays shorter than 8 (decision 15).
const WAITING: u32 = 6;

/// Most bits of a data frame with this many bytes: with an 11-bit identifier, every stuff bit that there
/// can be, and the intermission.
const fn longest(bytes: usize) -> u32 {
    let bytes = if bytes < 8 { bytes as u32 } else { 8 };
    47 + 8 * bytes + (34 + 8 * bytes - 1) / 4
}

/// The wire as the master sees it: what it handed out goes over it one by one, and what others send comes
/// in between. Adapters say when their queue is full, not how long it is; this is never shorter, unless
/// error frames hold the bus up.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pace {
    /// ns.
    bit: u32,
    /// When all that was handed out is sent.
    sent: Duration,
    /// Nodes whose frames are a scan's, until all are sent.
    nodes: NodeSet,
    /// Whether there are such nodes: asked at every frame.
    on: bool,
}

impl Pace {
    pub(super) const fn new(bit_rate: u32) -> Self {
        let rate = if bit_rate == 0 { 1 } else { bit_rate };
        Self { bit: 1_000_000_000_u32.div_ceil(rate), sent: Duration::ZERO, nodes: NodeSet::EMPTY, on: false }
    }

    /// A scan asks a node: its frames are paced until it is [`released`](Self::release).
    pub(super) const fn add(&mut self, node: NodeId) {
        self.nodes.insert(node);
        self.on = true;
    }

    /// The scan has nothing more to send to a node.
    pub(super) const fn release(&mut self, node: NodeId) {
        self.nodes.remove(node);
        self.on = !self.nodes.is_empty();
    }

    /// Nodes whose frames are paced.
    pub(super) const fn nodes(&self) -> NodeSet {
        self.nodes
    }

    /// Whether there are such nodes.
    #[inline]
    pub(super) const fn is_on(&self) -> bool {
        self.on
    }

    /// Time of so many bits on the wire.
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    const fn time(&self, bits: u32) -> Duration {
        Duration::from_nanos(self.bit as u64 * bits as u64)
    }

    /// A frame was handed out.
    #[inline]
    pub(super) fn hand_out(&mut self, now: Duration) {
        self.sent = after(self.sent.max(now), self.time(longest(8)));
    }

    /// It was not taken.
    pub(super) fn take_back(&mut self) {
        self.sent = before(self.sent, self.time(longest(8)));
    }

    /// A frame of another station has gone over the wire; ours waited meanwhile.
    pub(super) fn hear(&mut self, now: Duration, bytes: usize) {
        let later = after(self.sent, self.time(longest(bytes)));
        if !is_due(Some(later), now) {
            self.sent = later;
        }
    }

    /// When one more frame may be handed out.
    pub(super) fn opens(&self) -> Duration {
        before(self.sent, self.time(WAITING * longest(8)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seven_frames_then_one_each_frame_time() {
        let mut pace = Pace::new(500_000);
        let us = Duration::from_micros;
        let now = us(1000);
        for frames in 1..=7 {
            assert!(pace.opens() <= now, "{frames}");
            pace.hand_out(now);
        }
        assert_eq!(pace.opens(), us(1270));
        // A heartbeat came in between: 47 + 8 + 10 bits.
        pace.hear(us(1200), 1);
        assert_eq!(pace.opens(), us(1400));
        pace.take_back();
        assert_eq!(pace.opens(), us(1130));
        // Long after all are sent, nothing waits.
        pace.hear(us(9000), 8);
        assert!(pace.opens() < us(9000));
    }
}
