//! What the application asks for.

use core::time::Duration;

use pdo::cob::DefaultPdo;
use pdo::{Address, Frame, LengthCheck, NodeId};

use super::node::{Data, Job};
use super::{Master, NMT_COMMANDS, NmtJob, NmtTicket, QUEUE, Refused, ScanJob, SubmitError};
use crate::boot::{self, Action, Process};
use crate::clock::after;
use crate::guarding::{self, Guard};
use crate::heartbeat::Consumer;
use crate::nmt::{Command, Target};
use crate::node_set::NodeSet;
use crate::sdo::{self, Buffer};
use crate::{lss, scan, sync};

impl<'d, B: Buffer, const N: usize> Master<'d, B, N> {
    /// Sends an NMT command. Its outcome is which nodes then showed the state that it leads to, of
    /// [`Target::All`] those that have shown any state before. Nodes without error control are asked
    /// by one guarding request.
    ///
    /// # Errors
    /// [`SubmitError::Unconfirmed`], [`SubmitError::QueueFull`], [`SubmitError::OffBus`],
    /// [`SubmitError::Node`].
    pub fn nmt(&mut self, now: Duration, command: Command, target: Target) -> Result<NmtTicket, SubmitError> {
        let waiting = match target {
            Target::All => self.seen,
            Target::Node(node) => {
                self.check(node)?;
                NodeSet::of(node)
            }
        };
        let slot = self.nmt.iter().position(Option::is_none).ok_or(SubmitError::Unconfirmed(NMT_COMMANDS))?;
        self.send(command.frame(target))?;
        self.next_ticket = self.next_ticket.wrapping_add(1);
        let ticket = NmtTicket(self.next_ticket);
        for older in self.nmt.iter_mut().flatten() {
            older.missing = older.missing.or(older.waiting.and(waiting));
            older.waiting = older.waiting.without(waiting);
        }
        let mut longest = 0;
        for id in waiting.iter() {
            let Some(node) = self.node_mut(id) else { continue };
            let heartbeat = node.heartbeat.map_or(0, |consumer| consumer.time_ms().into());
            longest = longest.max(heartbeat).max(node.guard.map_or(0, |guard| guard.config().life_time_ms()));
        }
        let longest = Duration::from_millis(longest.into());
        let deadline = after(now, self.config.confirm.max(longest));
        let ask = (!command.is_reset()).then(|| after(now, self.config.confirm / 2));
        if let Some(slot) = self.nmt.get_mut(slot) {
            let (confirmed, missing) = (NodeSet::EMPTY, NodeSet::EMPTY);
            *slot = Some(NmtJob { ticket, command, waiting, confirmed, missing, ask, deadline });
        }
        self.nmt_waiting = self.nmt_waiting.or(waiting);
        self.due(ask.or(Some(deadline)));
        Ok(ticket)
    }

    /// Begins or ends guarding a node; [`guarding::Config::default`] is manual A's.
    ///
    /// # Errors
    /// [`SubmitError::Node`].
    pub fn set_guarding(
        &mut self,
        now: Duration,
        node: NodeId,
        config: Option<guarding::Config>,
    ) -> Result<(), SubmitError> {
        self.check(node)?;
        if let Some(slot) = self.node_mut(node) {
            slot.guard = config.map(|config| Guard::new(config, now));
        }
        self.guard_due.remove(node);
        self.due(config.map(|_| now));
        Ok(())
    }

    /// Begins or ends watching a node's heartbeat, consumer time in ms. `from_now`: a node that never
    /// sends one is lost too, else it is watched from its first heartbeat on.
    ///
    /// # Errors
    /// [`SubmitError::Node`].
    pub fn set_heartbeat(
        &mut self,
        now: Duration,
        node: NodeId,
        consumer_ms: Option<u16>,
        from_now: bool,
    ) -> Result<(), SubmitError> {
        self.check(node)?;
        let mut consumer = consumer_ms.map(Consumer::new);
        if let Some(consumer) = consumer.as_mut().filter(|_| from_now) {
            consumer.start(now);
        }
        if let Some(slot) = self.node_mut(node) {
            slot.heartbeat = consumer;
        }
        self.due(consumer.and_then(|consumer| consumer.poll_timeout()));
        Ok(())
    }

    /// Begins or ends producing SYNC.
    pub const fn set_sync(&mut self, sync: Option<sync::Producer>) {
        self.sync = sync;
    }

    /// The producer of SYNC.
    #[must_use]
    pub const fn sync(&self) -> Option<&sync::Producer> {
        self.sync.as_ref()
    }

    /// Reads an object of a node into `buffer`.
    ///
    /// # Errors
    /// [`Refused`] with the buffer: [`SubmitError::Busy`], [`SubmitError::OffBus`],
    /// [`SubmitError::Node`], [`SubmitError::Sdo`].
    pub fn upload(
        &mut self,
        node: NodeId,
        at: Address,
        buffer: B,
        options: &sdo::Options,
    ) -> Result<sdo::Ticket, Refused<B>> {
        self.transfer(node, at, buffer, options, false)
    }

    /// Writes what `buffer` holds to an object of a node.
    ///
    /// # Errors
    /// As [`upload`](Self::upload).
    pub fn download(
        &mut self,
        node: NodeId,
        at: Address,
        buffer: B,
        options: &sdo::Options,
    ) -> Result<sdo::Ticket, Refused<B>> {
        self.transfer(node, at, buffer, options, true)
    }

    fn transfer(
        &mut self,
        id: NodeId,
        at: Address,
        buffer: B,
        options: &sdo::Options,
        write: bool,
    ) -> Result<sdo::Ticket, Refused<B>> {
        if let Err(error) = self.check(id).and_then(|()| self.check_bus()) {
            return Err(Refused { error, buffer });
        }
        let Some(node) = self.node_mut(id).filter(|node| node.is_free()) else {
            return Err(Refused { error: SubmitError::Busy(id), buffer });
        };
        let begun = node.sdo.submit(at, buffer, options, write, Data::User);
        let ticket =
            begun.map_err(|sdo::Refused { error, buffer }| Refused { error: error.into(), buffer })?;
        self.sdo_busy.insert(id);
        self.sdo_ready.insert(id);
        Ok(ticket)
    }

    /// Gives a transfer up, unless it has its outcome already.
    pub fn cancel(&mut self, id: NodeId, ticket: sdo::Ticket) {
        let Some(node) = self.node_mut(id).filter(|node| matches!(node.job, Job::None)) else { return };
        node.sdo.cancel(ticket);
        self.sdo_ready.insert(id);
        self.sdo_ended.insert(id);
    }

    /// Bytes transferred and bytes in all, if known, of the transfer with a node.
    #[must_use]
    pub fn progress(&self, node: NodeId) -> Option<(u32, Option<u32>)> {
        self.node(node).filter(|_| self.sdo_busy.contains(node)).map(|node| node.sdo.progress())
    }

    /// TPDO 1…4 of a node has so many bytes, 0…8: as many as its mapping. One that is too short is not
    /// taken, one that is too long as far as it is mapped; [`Event::Pdo`](super::Event::Pdo) tells of
    /// both. `None`: any length, as it is until this is called.
    ///
    /// # Errors
    /// [`SubmitError::Length`], [`SubmitError::Node`].
    pub fn expect_pdo(
        &mut self,
        node: NodeId,
        number: DefaultPdo,
        bytes: Option<u8>,
    ) -> Result<(), SubmitError> {
        if let Some(bytes) = bytes.filter(|&bytes| bytes > 8) {
            return Err(SubmitError::Length(bytes.into()));
        }
        self.check(node)?;
        let lengths = self.node_mut(node).map(|node| &mut node.lengths);
        if let Some(length) = lengths.and_then(|lengths| lengths.get_mut(number as usize - 1)) {
            *length = bytes.map(LengthCheck::new);
        }
        Ok(())
    }

    /// Sets the data of RPDO 1…4 of a node, to be sent as soon as the bus allows; returns whether
    /// data that had not been sent yet were replaced.
    ///
    /// # Errors
    /// [`SubmitError::Length`], [`SubmitError::OffBus`], [`SubmitError::Node`].
    pub fn write_pdo(&mut self, node: NodeId, number: DefaultPdo, data: &[u8]) -> Result<bool, SubmitError> {
        if data.len() > 8 {
            return Err(SubmitError::Length(data.len()));
        }
        self.check(node)?;
        self.check_bus()?;
        let index = usize::from(number.number()) - 1;
        let slot = self.nodes.get_mut(usize::from(node.raw()) - 1);
        if let Some(image) = slot.and_then(|node| node.outputs.get_mut(index)) {
            image.set(data);
        }
        if let Some(flag) = self.output_flag.get_mut(index) {
            flag.insert(node);
        }
        let Some(due) = self.output_due.get_mut(index) else { return Ok(false) };
        let replaced = due.contains(node);
        due.insert(node);
        Ok(replaced)
    }

    /// Boots a node. Its error control, if it has one, is replaced by what `config` says.
    ///
    /// # Errors
    /// [`SubmitError::Busy`], [`SubmitError::OffBus`], [`SubmitError::Node`].
    pub fn boot(
        &mut self,
        now: Duration,
        id: NodeId,
        config: &'d boot::Config<'d>,
    ) -> Result<(), SubmitError> {
        self.check(id)?;
        self.check_bus()?;
        let mut process = Process::new(config);
        let action = process.begin(now);
        let Some(node) = self.node_mut(id).filter(|node| node.is_free()) else {
            return Err(SubmitError::Busy(id));
        };
        node.guard = None;
        node.heartbeat = None;
        node.job = Job::Boot(process);
        self.guard_due.remove(id);
        self.carry_out(now, id, action);
        Ok(())
    }

    /// Gives a boot up; its outcome becomes [`boot::Failure::Cancelled`] unless it has one already.
    pub fn cancel_boot(&mut self, now: Duration, id: NodeId) {
        let Some(node) = self.node_mut(id).filter(|node| matches!(node.job, Job::Boot(_))) else { return };
        if let Some(ticket) = node.ticket.take() {
            node.sdo.cancel(ticket);
            node.sdo.poll_event();
        }
        self.sdo_busy.remove(id);
        self.sdo_ready.insert(id);
        self.carry_out(now, id, Action::End(Err(boot::Failure::Cancelled)));
    }

    /// Asks nodes who they are, as many at once as the bus carries. A node that is busy is asked when
    /// it is free.
    ///
    /// # Errors
    /// [`SubmitError::Scanning`], [`SubmitError::OffBus`], [`SubmitError::Node`].
    pub fn scan(&mut self, nodes: NodeSet, options: scan::Options) -> Result<(), SubmitError> {
        self.check_bus()?;
        if self.scan.is_some() {
            return Err(SubmitError::Scanning);
        }
        if let Some(node) = nodes.without(NodeSet::up_to(Self::LAST)).first() {
            return Err(SubmitError::Node { node, last: Self::LAST.raw() });
        }
        for id in nodes.iter() {
            if let Some(node) = self.node_mut(id) {
                node.info = None;
            }
        }
        let empty = NodeSet::EMPTY;
        let job = ScanJob { options, todo: nodes, active: empty, found: empty, silent: empty };
        self.scan = Some(job);
        Ok(())
    }

    /// Starts an LSS operation.
    ///
    /// # Errors
    /// [`SubmitError::Lss`], [`SubmitError::OffBus`].
    pub fn lss(&mut self, operation: lss::Operation) -> Result<lss::Ticket, SubmitError> {
        self.check_bus()?;
        Ok(self.lss.submit(operation)?)
    }

    /// Gives an LSS operation up.
    pub fn cancel_lss(&mut self, ticket: lss::Ticket) {
        self.lss.cancel(ticket);
    }

    /// Sends a frame as it is: TIME, PDOs on identifiers of their own.
    ///
    /// # Errors
    /// [`SubmitError::QueueFull`], [`SubmitError::OffBus`].
    pub fn send(&mut self, frame: Frame) -> Result<(), SubmitError> {
        self.check_bus()?;
        self.queue.push(frame).map_err(|_| SubmitError::QueueFull(QUEUE))
    }

    fn check(&self, node: NodeId) -> Result<(), SubmitError> {
        if node > Self::LAST { Err(SubmitError::Node { node, last: Self::LAST.raw() }) } else { Ok(()) }
    }

    const fn check_bus(&self) -> Result<(), SubmitError> {
        if self.bus.is_on() { Ok(()) } else { Err(SubmitError::OffBus(self.bus)) }
    }
}
