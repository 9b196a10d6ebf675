//! Deadlines.

use core::time::Duration;

use pdo::NodeId;

use super::event::Notice;
use super::node::Job;
use super::{BusStatus, Master};
use crate::boot::Action;
use crate::clock::{after, earlier, earliest, is_due};
use crate::node_set::NodeSet;
use crate::sdo::Buffer;

/// Events that one node's deadlines can cause.
const PER_NODE: usize = 2;

/// When to look again where events found no room.
const LATER: Duration = Duration::from_millis(1);

impl<B: Buffer, const N: usize> Master<'_, B, N> {
    /// Lets everything happen whose time has come; early calls do nothing.
    pub fn handle_timeout(&mut self, now: Duration) {
        self.lss.handle_timeout(now);
        if !is_due(self.bound, now) {
            return;
        }
        self.bound = None;
        self.nmt_timeout(now);
        for id in NodeId::all().take(N) {
            // A loss that finds no place is told later, not never.
            if self.event_room() < PER_NODE {
                self.due(Some(after(now, LATER)));
                break;
            }
            self.node_timeout(now, id);
        }
    }

    /// When to call [`handle_timeout`](Self::handle_timeout) and then
    /// [`poll_transmit`](Self::poll_transmit); `None` = idle.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Duration> {
        let on = self.bus.is_on();
        let sync = self.sync.as_ref().filter(|_| on).map(crate::sync::Producer::poll_timeout);
        earliest(&[self.bound, sync, self.scan_due(), self.lss.poll_timeout()])
    }

    fn node_timeout(&mut self, now: Duration, id: NodeId) {
        let on = self.bus.is_on();
        // Most nodes: what is usual of them stays so.
        let next = self.node(id).and_then(|node| node.poll_timeout(on));
        if !is_due(next, now) {
            return self.due(next);
        }
        let Some(node) = self.node_mut(id) else { return };
        if let Job::Boot(process) = &mut node.job {
            let action = process.on_timeout(now);
            if !matches!(action, Action::Wait) {
                self.carry_out(now, id, action);
            }
        }
        let Some(node) = self.node_mut(id) else { return };
        if on {
            let (due, guarding) =
                node.guard.as_mut().map_or((false, None), |guard| guard.handle_timeout(now));
            let heartbeat = node.heartbeat.as_mut().and_then(|consumer| consumer.handle_timeout(now));
            if due {
                self.guard_due.insert(id);
            }
            self.tell_error_control(id, guarding, heartbeat);
        }
        if self.sdo_busy.contains(id) {
            if let Some(node) = self.node_mut(id) {
                node.sdo.handle_timeout(now);
            }
            self.sdo_ready.insert(id);
            self.after_sdo(now, id);
        }
        let at = self.node(id).and_then(|node| node.poll_timeout(on));
        self.due(at);
    }

    fn nmt_timeout(&mut self, now: Duration) {
        let mut waiting = NodeSet::EMPTY;
        let mut ask = NodeSet::EMPTY;
        let mut bound = None;
        for job in self.nmt.iter_mut().flatten().filter(|job| !job.is_over()) {
            if is_due(Some(job.deadline), now) {
                job.missing = job.missing.or(core::mem::take(&mut job.waiting));
                continue;
            }
            if is_due(job.ask, now) {
                job.ask = None;
                ask = ask.or(job.waiting);
            }
            waiting = waiting.or(job.waiting);
            bound = earlier(bound, job.ask.or(Some(job.deadline)));
        }
        self.nmt_waiting = waiting;
        let unwatched =
            |id: &NodeId| self.node(*id).is_some_and(|node| node.guard.is_none() && node.heartbeat.is_none());
        let ask: NodeSet = ask.iter().filter(unwatched).collect();
        self.ask_due = self.ask_due.or(ask);
        self.due(bound);
    }

    /// The adapter's state has changed.
    ///
    /// While the bus is not there, nothing is watched (one event tells it, not one per node), what
    /// waits to be sent is given up and told, new commands are refused, and transfers under way run
    /// into their time-outs. When it is back, error control starts anew.
    pub fn handle_bus(&mut self, now: Duration, status: BusStatus) {
        let before = core::mem::replace(&mut self.bus, status);
        if before == status {
            return;
        }
        self.tell(Notice::Bus(status));
        match (before.is_on(), status.is_on()) {
            (true, false) => self.discard_waiting(),
            (false, true) => self.restart(now),
            _ => {}
        }
    }

    /// The adapter has lost this many frames that it had taken.
    pub fn handle_discarded(&mut self, frames: u32) {
        if frames > 0 {
            self.tell(Notice::Discarded(frames));
        }
    }

    fn discard_waiting(&mut self) {
        // Transfers hold their frames until they are polled.
        let frames = self.waiting() - self.sdo_ready.len();
        while self.queue.pop().is_some() {}
        self.refused = None;
        self.output_due = [NodeSet::EMPTY; 4];
        self.guard_due = NodeSet::EMPTY;
        self.ask_due = NodeSet::EMPTY;
        self.reset_due = NodeSet::EMPTY;
        self.start_due = NodeSet::EMPTY;
        self.handle_discarded(frames as u32);
    }

    fn restart(&mut self, now: Duration) {
        for node in &mut self.nodes {
            if let Some(guard) = &mut node.guard {
                guard.restart(now);
            }
            if let Some(consumer) = node.heartbeat.as_mut().filter(|it| it.poll_timeout().is_some()) {
                consumer.start(now);
            }
        }
        let discarded = core::mem::take(&mut self.discarded);
        self.handle_discarded(discarded);
        self.due(Some(now));
    }
}
