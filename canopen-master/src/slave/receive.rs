//! Frames in.

use core::time::Duration;

use embedded_can::Id;
use pdo::{Frame, Handled, RpdoFault, cob};

use super::errors::Cause;
use super::{Event, Objects, Slave};
use crate::emcy::ErrorCode;
use crate::nmt::{Change, Command};
use crate::ring::Ring;
use crate::time::TimeOfDay;
use crate::{lss, sync};

impl<D: Objects> Slave<D> {
    /// Takes a frame from the bus.
    #[inline]
    pub fn handle_frame<F: embedded_can::Frame>(&mut self, now: Duration, frame: &F) -> Handled {
        let Id::Standard(id) = frame.id() else { return Handled::Ignored };
        let id = id.as_raw();
        if self.running && id == self.server.channel().request {
            return self.on_sdo(now, frame);
        }
        let Some(frame) = Frame::from_can(frame) else { return Handled::Ignored };
        if id == cob::LSS_REQUEST {
            return self.on_lss(&frame);
        }
        if !self.running {
            return Handled::Ignored;
        }
        let own = u16::from(self.nmt.node().raw());
        match id {
            cob::NMT => {
                let change =
                    Command::parse(&frame).and_then(|(command, target)| self.nmt.handle(command, target));
                self.on_change(now, change);
                Handled::Taken
            }
            cob::TIME if self.state().has_sdo() => {
                if let Some(time) = TimeOfDay::from_frame(&frame) {
                    self.tell(Event::Time(time));
                }
                Handled::Taken
            }
            _ if id == cob::ERROR_CONTROL + own && frame.is_remote() => {
                let (answer, event) = self.guard.handle_request(now, self.nmt.state());
                self.answer(answer);
                if let Some(event) = event {
                    self.errors.clear_cause(Cause::Guarding);
                    self.tell(Event::LifeGuarding(event));
                }
                Handled::Taken
            }
            _ if id == self.sync.id() && self.state().has_sdo() => {
                if let Some(event) = self.sync.handle_frame(now, &frame) {
                    self.on_sync(event);
                }
                Handled::Taken
            }
            cob::ERROR_CONTROL.. => self.on_heartbeat(now, id, &frame),
            _ if self.state().has_pdo() => {
                let handled = self.objects.handle_frame(now, &frame);
                self.collect_pdos();
                handled
            }
            _ => Handled::Ignored,
        }
    }

    /// What RPDOs brought.
    pub(super) fn collect_pdos(&mut self) {
        while let Some((number, event)) = self.objects.poll_event() {
            let cause = Cause::Rpdo(number);
            let [low, high] = (0x1600 + number as u16).to_le_bytes();
            match event {
                Ok(()) => self.errors.clear_cause(cause),
                // Its beginning is taken.
                Err(RpdoFault::TooLong(error)) => {
                    self.errors.mention(ErrorCode::PDO_TOO_LONG, [low, high, error.expected, error.found, 0]);
                }
                Err(fault) => {
                    let (code, expected, found) = match fault {
                        RpdoFault::TooShort(error) => (ErrorCode::PDO_LENGTH, error.expected, error.found),
                        _ => (ErrorCode::RPDO_TIMEOUT, 0, 0),
                    };
                    let _ = self.errors.raise(code, cause, [low, high, expected, found, 0]);
                }
            }
            self.tell(Event::Rpdo(number, event));
        }
    }

    fn on_sdo<F: embedded_can::Frame>(&mut self, now: Duration, frame: &F) -> Handled {
        if !self.nmt.state().has_sdo() {
            return Handled::Taken;
        }
        let (server, mut view) = self.serving();
        let handled = server.handle_frame(now, frame, &mut view);
        if let Some(at) = view.written {
            self.configure(now, at.index);
            self.tell(Event::Written(at));
        }
        handled
    }

    fn on_lss(&mut self, frame: &Frame) -> Handled {
        // In any NMT state, and without address too.
        let Some(request) = lss::Request::from_frame(frame) else { return Handled::Taken };
        let (answer, action) = self.lss.handle(request);
        if let Some(answer) = answer {
            self.answer(answer);
        }
        match action {
            Some(lss::Action::Start(_)) => self.tell(Event::ResetCommunication),
            Some(action) => self.tell(Event::Lss(action)),
            None => {}
        }
        Handled::Taken
    }

    fn on_change(&mut self, now: Duration, change: Option<Change>) {
        match change {
            Some(Change::State(state)) => self.entered(now, state),
            Some(reset) => {
                self.running = false;
                self.objects.stop();
                self.boot_up = false;
                self.answers = Ring::new();
                self.errors.producer().clear();
                self.tell(match reset {
                    Change::ResetNode => Event::ResetNode,
                    _ => Event::ResetCommunication,
                });
            }
            None => {}
        }
    }

    pub(super) fn on_sync(&mut self, event: sync::Event) {
        if let sync::Event::Length { expected, found } = event {
            self.errors.mention(ErrorCode::SYNC_LENGTH, [expected, found, 0, 0, 0]);
        }
        let counter = match event {
            sync::Event::Sync { counter } => Some(counter),
            sync::Event::Jump { found, .. } => Some(Some(found)),
            _ => None,
        };
        if let Some(counter) = counter.filter(|_| self.state().has_pdo()) {
            self.objects.handle_sync(counter);
            self.collect_pdos();
        }
        self.tell(Event::Sync(event));
    }

    fn on_heartbeat(&mut self, now: Duration, id: u16, frame: &Frame) -> Handled {
        let mut watched = self.consumers.iter_mut().enumerate();
        let watched = watched.find_map(|(index, slot)| {
            let (node, consumer) = slot.as_mut()?;
            (cob::ERROR_CONTROL + u16::from(node.raw()) == id).then_some((index, *node, consumer))
        });
        let Some((index, node, consumer)) = watched.filter(|_| !frame.is_remote()) else {
            return Handled::Ignored;
        };
        if let Some(event) = consumer.handle(now) {
            self.errors.clear_cause(Cause::Heartbeat(index));
            self.tell(Event::Heartbeat { node, event });
        }
        Handled::Taken
    }

    pub(super) fn answer(&mut self, frame: Frame) {
        // A master that asks again without having seen the answer has lost the older one anyway.
        if let Err(frame) = self.answers.push(frame) {
            self.answers.pop();
            let _ = self.answers.push(frame);
        }
    }
}
