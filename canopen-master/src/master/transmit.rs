//! Frames out.

use core::time::Duration;

use pdo::cob::DefaultPdo;
use pdo::{Frame, Service};

use super::Master;
use super::event::Notice;
use super::node::Job;
use crate::clock::is_due;
use crate::guarding;
use crate::nmt::{Command, Target};
use crate::node_set::NodeSet;
use crate::sdo::Buffer;

impl<B: Buffer, const N: usize> Master<'_, B, N> {
    /// The next frame to send, until `None`: SYNC, what was queued, PDOs, guarding, NMT of boots,
    /// then SDO of all nodes in turn, LSS. To be polled while the adapter takes frames; one that it
    /// did not take goes back by [`handle_refused`](Self::handle_refused).
    pub fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        if !self.bus.is_on() {
            self.drain(now);
            return None;
        }
        let frame = self.next_frame(now)?;
        self.pace.hand_out(now);
        Some(frame)
    }

    fn next_frame(&mut self, now: Duration) -> Option<Frame> {
        if let Some(frame) = self.refused.take() {
            return Some(frame);
        }
        self.refused_told = false;
        if let Some(frame) = self.sync.as_mut().and_then(|sync| sync.poll_transmit(now)) {
            return Some(frame);
        }
        if let Some(frame) = self.queue.pop() {
            return Some(frame);
        }
        if let Some(frame) = self.poll_output().or_else(|| self.poll_error_control()) {
            return Some(frame);
        }
        let mut held = NodeSet::EMPTY;
        if self.scan.is_some() || self.pace.is_on() {
            if is_due(Some(self.pace.opens()), now) {
                self.start_scan();
            } else {
                held = self.pace.nodes();
            }
        }
        self.poll_sdo(now, held).or_else(|| self.lss.poll_transmit(now))
    }

    /// The adapter did not take the frame that was polled last: it goes first when it is asked for
    /// again.
    pub fn handle_refused(&mut self, frame: Frame) {
        self.pace.take_back();
        if self.refused.replace(frame).is_some() {
            self.handle_discarded(1);
        }
        if !core::mem::replace(&mut self.refused_told, true) {
            self.tell(Notice::TransmitFull);
        }
    }

    fn poll_output(&mut self) -> Option<Frame> {
        for number in DefaultPdo::ALL {
            let index = usize::from(number.number()) - 1;
            let Some(id) = self.output_due.get_mut(index).and_then(NodeSet::pop) else { continue };
            let image = self.node(id)?.outputs.get(index)?;
            let can_id = embedded_can::StandardId::new(Service::Rpdo(number, id).id())?;
            return Frame::data_frame(can_id, image.data());
        }
        None
    }

    fn poll_error_control(&mut self) -> Option<Frame> {
        if let Some(id) = self.guard_due.pop().or_else(|| self.ask_due.pop()) {
            return guarding::request(id);
        }
        if let Some(id) = self.reset_due.pop() {
            return Some(Command::ResetCommunication.frame(Target::Node(id)));
        }
        self.start_due.pop().map(|id| Command::Start.frame(Target::Node(id)))
    }

    #[inline]
    fn poll_sdo(&mut self, now: Duration, held: NodeSet) -> Option<Frame> {
        while let Some(id) = self.sdo_ready.without(held).after(self.sdo_turn) {
            let Some(node) = self.nodes.get_mut(usize::from(id.raw()) - 1) else {
                self.sdo_ready.remove(id);
                continue;
            };
            let frame = node.sdo.poll_transmit(now);
            let at = node.sdo.poll_timeout();
            let scanning = matches!(node.job, Job::Scan(_));
            self.due(at);
            match frame {
                Some(frame) => {
                    self.sdo_turn = id;
                    return Some(frame);
                }
                None => {
                    self.sdo_ready.remove(id);
                    if !scanning {
                        self.pace.release(id);
                    }
                }
            }
        }
        None
    }

    /// The bus is away: transfers go on to their time-outs, their frames nowhere.
    fn drain(&mut self, now: Duration) {
        while self.poll_sdo(now, NodeSet::EMPTY).is_some() || self.lss.poll_transmit(now).is_some() {
            self.discarded = self.discarded.saturating_add(1);
        }
        // Nodes of a scan that have not been asked yet are as silent as the others.
        if let Some(scan) = &mut self.scan {
            scan.silent = scan.silent.or(core::mem::take(&mut scan.todo));
        }
    }
}
