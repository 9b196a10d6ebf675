//! What the master does with nodes by itself: steps of boots and scans.

use core::time::Duration;

use pdo::{Address, NodeId};

use super::Master;
use super::node::{Data, Job, Node, ScanStep};
use crate::boot::Action;
use crate::guarding::Guard;
use crate::heartbeat::Consumer;
use crate::lss::{Identity, Part};
use crate::nmt::Command;
use crate::node_set::NodeSet;
use crate::scan::{DEVICE_NAME, DEVICE_TYPE, Head, IDENTITY, Info, OPMODE, Options};
use crate::sdo::{self, Buffer, Finished, Outcome};

impl<'d, B: Buffer, const N: usize> Master<'d, B, N> {
    /// A transfer may have ended: the master's own go on, the application's wait to be polled.
    #[inline]
    pub(super) fn after_sdo(&mut self, now: Duration, id: NodeId) {
        let Some(node) = self.nodes.get_mut(usize::from(id.raw()) - 1) else { return };
        if matches!(node.job, Job::None) {
            self.sdo_ended.insert(id);
        } else {
            self.job_sdo(now, id);
        }
    }

    fn job_sdo(&mut self, now: Duration, id: NodeId) {
        let Some(node) = self.node_mut(id) else { return };
        let Some(Finished { outcome, buffer, .. }) = node.sdo.poll_event() else { return };
        node.ticket = None;
        let head = match buffer {
            Data::Head(head) => head,
            Data::Dcf(_) | Data::User(_) => Head::default(),
        };
        match &mut node.job {
            Job::Boot(process) => {
                let action = process.on_sdo(now, outcome, &head);
                self.sdo_busy.remove(id);
                self.carry_out(now, id, action);
            }
            Job::Scan(step) => {
                let step = *step;
                self.sdo_busy.remove(id);
                self.scan_step(id, step, outcome, &head);
            }
            Job::None | Job::Booted(_) => {}
        }
    }

    /// The outcome of an application's transfer, if it has ended.
    pub(super) fn take_finished(&mut self, id: NodeId) -> Option<Finished<B>> {
        let node = self.node_mut(id).filter(|node| matches!(node.job, Job::None))?;
        let Finished { ticket, at, outcome, buffer } = node.sdo.poll_event()?;
        self.sdo_busy.remove(id);
        match buffer {
            Data::User(buffer) => Some(Finished { ticket, at, outcome, buffer }),
            Data::Head(_) | Data::Dcf(_) => None,
        }
    }

    fn job_transfer(&mut self, id: NodeId, at: Address, write: Option<Data<'d, B>>, timeout: Duration) {
        let Some(node) = self.node_mut(id) else { return };
        let options = sdo::Options::new(timeout);
        let begun = match write {
            Some(data) => node.sdo.download(at, data, &options),
            None => node.sdo.upload(at, Data::Head(Head::default()), &options),
        };
        // A job begins only with an idle client, and its own data can be read.
        node.ticket = begun.ok();
        self.sdo_busy.insert(id);
        self.sdo_ready.insert(id);
    }

    /// Carries a step of a boot out.
    pub(super) fn carry_out(&mut self, now: Duration, id: NodeId, mut action: Action<'d>) {
        let Some(node) = self.node_mut(id) else { return };
        let Job::Boot(process) = &mut node.job else { return };
        let timeout = process.answer_time();
        if matches!(action, Action::Nmt(Command::Start)) {
            action = process.on_done();
            self.start_due.insert(id);
        }
        let Some(node) = self.node_mut(id) else { return };
        match action {
            Action::Wait | Action::Nmt(Command::Start) => {}
            Action::Nmt(_) => self.reset_due.insert(id),
            Action::AskState => self.ask_due.insert(id),
            Action::Read(at) => self.job_transfer(id, at, None, timeout),
            Action::Write(at, head) => self.job_transfer(id, at, Some(Data::Head(head)), timeout),
            Action::WriteDcf(at, data) => self.job_transfer(id, at, Some(Data::Dcf(data)), timeout),
            Action::WatchHeartbeat(time_ms) => {
                let mut consumer = Consumer::new(time_ms);
                consumer.start(now);
                node.heartbeat = Some(consumer);
            }
            Action::Guard(config) => node.guard = Some(Guard::new(config, now)),
            Action::End(result) => {
                if result.is_err() {
                    node.guard = None;
                    node.heartbeat = None;
                }
                node.job = Job::Booted(result);
                self.booted.insert(id);
            }
        }
        let at = self.node(id).and_then(|node| node.poll_timeout(true));
        self.due(at);
    }

    /// Begins with the next node of a scan, unless one that has begun still has to send something.
    pub(super) fn start_scan(&mut self) {
        if !self.sdo_ready.and(self.pace.nodes()).is_empty() {
            return;
        }
        let Some(id) = self.scan_candidate() else { return };
        let Some(scan) = &mut self.scan else { return };
        scan.todo.remove(id);
        scan.active.insert(id);
        self.pace.add(id);
        let timeout = scan.options.answer;
        if let Some(node) = self.node_mut(id) {
            node.job = Job::Scan(ScanStep::DeviceType);
        }
        self.job_transfer(id, DEVICE_TYPE, None, timeout);
    }

    /// When the next frame of a scan may be sent.
    pub(super) fn scan_due(&self) -> Option<Duration> {
        let waits = !self.sdo_ready.and(self.pace.nodes()).is_empty() || self.scan_candidate().is_some();
        waits.then(|| self.pace.opens())
    }

    fn scan_candidate(&self) -> Option<NodeId> {
        let scan = self.scan.as_ref()?;
        let free = |id: &NodeId| self.node(*id).is_some_and(Node::is_free);
        scan.todo.iter().find(free)
    }

    fn scan_step(&mut self, id: NodeId, step: ScanStep, outcome: Outcome, head: &Head) {
        let Some(scan) = &self.scan else { return };
        let options = scan.options;
        let Some(node) = self.node_mut(id) else { return };
        let silent = matches!(outcome, Outcome::TimedOut | Outcome::Cancelled);
        if silent && step == ScanStep::DeviceType {
            return self.end_scan(id, false);
        }
        let info = node.info.get_or_insert_default();
        if matches!(outcome, Outcome::Done(_)) {
            note(info, step, head);
        }
        let next = following(&options, info, step, outcome).filter(|_| !silent);
        match next {
            Some((step, at)) => {
                node.job = Job::Scan(step);
                self.job_transfer(id, at, None, options.answer);
            }
            None => self.end_scan(id, true),
        }
    }

    fn end_scan(&mut self, id: NodeId, found: bool) {
        if let Some(node) = self.node_mut(id) {
            node.job = Job::None;
        }
        let Some(scan) = &mut self.scan else { return };
        scan.active.remove(id);
        let set: &mut NodeSet = if found { &mut scan.found } else { &mut scan.silent };
        set.insert(id);
    }
}

fn note(info: &mut Info, step: ScanStep, head: &Head) {
    match step {
        ScanStep::DeviceType => info.device_type = Some(head.number()),
        ScanStep::Name => info.name = head.name(),
        ScanStep::Identity(sub) => {
            if let Some(part) = sub.checked_sub(1).and_then(Part::new) {
                info.identity.get_or_insert(Identity::default()).set_part(part, head.number());
            }
        }
        ScanStep::OpMode => info.opmode = Some(head.number() as u8),
    }
}

/// What to read after a step.
fn following(
    options: &Options,
    info: &Info,
    step: ScanStep,
    outcome: Outcome,
) -> Option<(ScanStep, Address)> {
    let opmode = (options.opmode && info.is_drive()).then_some((ScanStep::OpMode, OPMODE));
    let identity = |sub| (ScanStep::Identity(sub), Address::new(IDENTITY, sub));
    match step {
        ScanStep::DeviceType => Some((ScanStep::Name, DEVICE_NAME)),
        ScanStep::Name if options.identity => Some(identity(1)),
        // A device without one of the numbers has none of the following either.
        ScanStep::Identity(sub @ 1..=3) if matches!(outcome, Outcome::Done(_)) => Some(identity(sub + 1)),
        ScanStep::Name | ScanStep::Identity(_) => opmode,
        ScanStep::OpMode => None,
    }
}
