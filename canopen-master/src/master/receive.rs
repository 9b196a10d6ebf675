//! Frames in.

use core::time::Duration;

use embedded_can::Id;
use pdo::{DefaultPdo, Handled, NodeId, cob};

use super::event::Notice;
use super::node::Job;
use super::{Event, Master};
use crate::boot::Action;
use crate::emcy::{Emergency, Entry};
use crate::nmt::State;
use crate::sdo::Buffer;
use crate::{guarding, heartbeat};

impl<'d, B: Buffer, const N: usize> Master<'d, B, N> {
    /// Takes a frame from the bus. Identifiers of the predefined connection set from nodes 1 to `N`
    /// are the master's; anything else is ignored, so that other engines can share the bus.
    #[inline]
    pub fn handle_frame<F: embedded_can::Frame>(&mut self, now: Duration, frame: &F) -> Handled {
        if self.pace.is_on() {
            self.pace.hear(now, frame.dlc());
        }
        let Id::Standard(id) = frame.id() else { return Handled::Ignored };
        let id = id.as_raw();
        if frame.is_remote_frame() {
            return Handled::Ignored;
        }
        let Ok(node) = NodeId::new((id & 0x7F) as u8) else { return Handled::Ignored };
        if node > Self::LAST && id < cob::LSS_RESPONSE {
            return Handled::Ignored;
        }
        match id & 0x780 {
            0x180 => self.on_pdo(0, node, frame.data()),
            0x280 => self.on_pdo(1, node, frame.data()),
            0x380 => self.on_pdo(2, node, frame.data()),
            0x480 => self.on_pdo(3, node, frame.data()),
            cob::ERROR_CONTROL => self.on_error_control(now, node, frame.data()),
            cob::SDO_RESPONSE => self.on_sdo(now, node, frame),
            cob::EMCY => self.on_emergency(now, node, frame.data()),
            _ => return self.on_other(frame),
        }
        Handled::Taken
    }

    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    fn on_pdo(&mut self, number: usize, id: NodeId, mut data: &[u8]) {
        let index = usize::from(id.raw()) - 1;
        let lengths = self.nodes.get_mut(index).map(|node| &mut node.lengths);
        if let Some(Some(length)) = lengths.and_then(|lengths| lengths.get_mut(number))
            && !length.fits(data.len() as u8)
        {
            let Some(mapped) = self.on_pdo_length(number, id, data) else { return };
            data = mapped;
        }
        let image = self.nodes.get_mut(index).and_then(|node| node.inputs.get_mut(number));
        let sets = self.input_new.get_mut(number).zip(self.input_flag.get_mut(number));
        if let Some((image, (new, flag))) = image.zip(sets) {
            image.set(data);
            new.insert(id);
            flag.insert(id);
        }
    }

    /// A PDO is not as long as its mapping: what is taken of it.
    #[cold]
    #[inline(never)]
    fn on_pdo_length<'a>(&mut self, number: usize, id: NodeId, data: &'a [u8]) -> Option<&'a [u8]> {
        let node = self.nodes.get_mut(usize::from(id.raw()) - 1)?;
        let length = node.lengths.get_mut(number)?.as_mut()?;
        let (fault, mapped) = (length.check(data.len() as u8).err(), usize::from(length.expected()));
        if let Some((fault, number)) = fault.zip(DefaultPdo::new(number as u8 + 1)) {
            self.tell(Notice::Pdo(id, number, fault));
        }
        data.get(..mapped)
    }

    #[inline]
    fn on_error_control(&mut self, now: Duration, id: NodeId, data: &[u8]) {
        let Some(node) = self.nodes.get_mut(usize::from(id.raw()) - 1) else { return };
        // Most frames.
        if let (&[byte], Some(consumer)) = (data, &mut node.heartbeat)
            && byte == node.usual
        {
            consumer.handle(now);
            return;
        }
        self.on_new_state(now, id, data);
    }

    #[cold]
    fn on_new_state(&mut self, now: Duration, id: NodeId, data: &[u8]) {
        let known = match data {
            &[byte] => State::from_raw(byte).map(|state| (byte, state)),
            _ => None,
        };
        let Some((byte, state)) = known else {
            self.malformed = self.malformed.saturating_add(1);
            return;
        };
        if byte == State::BootUp as u8 {
            return self.on_boot_up(now, id);
        }
        let Some(node) = self.node_mut(id) else { return };
        let toggled = byte & 0x80 != 0;
        let (mut guarding, mut heartbeat, mut at) = (None, None, None);
        match (&mut node.guard, &mut node.heartbeat) {
            (Some(guard), heartbeat) if heartbeat.is_none() || guard.is_answer(byte) => {
                guarding = guard.handle_answer(now, byte);
            }
            (_, Some(consumer)) if !toggled => {
                heartbeat = consumer.handle(now);
                at = consumer.poll_timeout();
            }
            _ => {}
        }
        self.due(at);
        self.tell_error_control(id, guarding, heartbeat);
        if matches!(guarding, Some(guarding::Event::Toggle { .. })) {
            return;
        }
        self.note_state(now, id, state);
        let awaited = toggled || self.nmt_waiting.contains(id);
        if let Some(node) = self.node_mut(id).filter(|_| !awaited) {
            node.note_usual(byte);
        }
    }

    /// What guarding and heartbeat have noticed.
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    pub(super) fn tell_error_control(
        &mut self,
        id: NodeId,
        guarding: Option<guarding::Event>,
        heartbeat: Option<heartbeat::Event>,
    ) {
        if let Some(event) = guarding {
            self.tell(Notice::Guarding(id, event));
        }
        if let Some(event) = heartbeat {
            self.tell(Notice::Heartbeat(id, event));
        }
    }

    fn on_boot_up(&mut self, now: Duration, id: NodeId) {
        let Some(node) = self.node_mut(id) else { return };
        let guarding = node.guard.as_mut().and_then(|guard| guard.handle_boot_up(now));
        let heartbeat = node.heartbeat.as_mut().and_then(|consumer| consumer.handle(now));
        let at = node.heartbeat.as_ref().and_then(heartbeat::Consumer::poll_timeout);
        // It comes to pre-operational by itself (CiA 301, 7.3.2.2.2).
        node.state = Some(State::PreOperational);
        let action = match &mut node.job {
            Job::Boot(process) => process.on_boot_up(now),
            _ => Action::Wait,
        };
        self.seen.insert(id);
        self.due(at);
        self.tell(Notice::BootUp(id));
        self.tell_error_control(id, guarding, heartbeat);
        self.confirm(id, State::BootUp);
        self.carry_out(now, id, action);
    }

    fn note_state(&mut self, now: Duration, id: NodeId, state: State) {
        let Some(node) = self.node_mut(id) else { return };
        let changed = node.state.replace(state) != Some(state);
        let action = match &mut node.job {
            Job::Boot(process) => process.on_state(now, state),
            _ => Action::Wait,
        };
        self.seen.insert(id);
        if changed {
            self.tell(Notice::State(id, state));
        }
        self.confirm(id, state);
        self.carry_out(now, id, action);
    }

    /// A node shows a state: NMT commands that lead to it have done what they should.
    fn confirm(&mut self, id: NodeId, state: State) {
        if !self.nmt_waiting.contains(id) {
            return;
        }
        let mut waiting = NodeSetOr::default();
        for job in self.nmt.iter_mut().flatten() {
            if job.command.leads_to() == state && job.waiting.remove(id) {
                job.confirmed.insert(id);
            }
            waiting.add(job.waiting);
        }
        self.nmt_waiting = waiting.0;
    }

    #[inline]
    fn on_sdo(&mut self, now: Duration, id: NodeId, frame: &impl embedded_can::Frame) {
        let Some(node) = self.nodes.get_mut(usize::from(id.raw()) - 1) else { return };
        node.sdo.handle_frame(now, frame);
        self.sdo_ready.insert(id);
        self.after_sdo(now, id);
    }

    fn on_emergency(&mut self, now: Duration, id: NodeId, data: &[u8]) {
        match Emergency::parse(data) {
            Some(emergency) => {
                self.history.push(Entry { at: now, node: id, emergency });
                self.tell(Notice::Emergency(id, emergency));
            }
            None => self.malformed = self.malformed.saturating_add(1),
        }
    }

    #[cold]
    fn on_other(&mut self, frame: &impl embedded_can::Frame) -> Handled {
        match pdo::Frame::from_can(frame) {
            Some(frame) => self.lss.handle_frame(&frame),
            None => Handled::Ignored,
        }
    }
}

/// Gathers sets.
#[derive(Default)]
struct NodeSetOr(crate::node_set::NodeSet);

impl NodeSetOr {
    const fn add(&mut self, set: crate::node_set::NodeSet) {
        self.0 = self.0.or(set);
    }
}

impl<B> Event<B> {
    /// The node it is about; `None` of events about several, or none.
    #[must_use]
    pub const fn node(&self) -> Option<NodeId> {
        match self {
            Self::BootUp(node)
            | Self::State { node, .. }
            | Self::Guarding { node, .. }
            | Self::Heartbeat { node, .. }
            | Self::Emergency { node, .. }
            | Self::Pdo { node, .. }
            | Self::Sdo { node, .. }
            | Self::Booted { node, .. } => Some(*node),
            _ => None,
        }
    }
}
