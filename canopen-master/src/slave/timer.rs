//! Deadlines, frames out, and the adapter's state.

use core::time::Duration;

use pdo::{Frame, NodeId};

use super::errors::Cause;
use super::objects::number;
use super::{CONSUMERS, Event, Objects, Slave};
use crate::bus::BusStatus;
use crate::clock::{earlier, earliest};
use crate::emcy::{Emergency, ErrorCode};
use crate::nmt::{self, State};
use crate::ring::Ring;

impl<D: Objects> Slave<D> {
    /// The adapter's state has changed. While the bus is not there, nothing is sent; what waited is
    /// dropped. Error passive and the recovery from bus-off are told by emergencies (8120h, 8140h).
    pub fn handle_bus(&mut self, now: Duration, status: BusStatus) {
        let before = core::mem::replace(&mut self.bus, status);
        match (before, status) {
            (_, BusStatus::Passive) => {
                let _ = self.raise(ErrorCode::CAN_PASSIVE, [0; 5]);
            }
            (BusStatus::Passive, BusStatus::Active | BusStatus::Warning) => {
                let _ = self.clear(ErrorCode::CAN_PASSIVE);
            }
            (BusStatus::Off, BusStatus::Active | BusStatus::Warning) => {
                let _ = self.clear(ErrorCode::CAN_PASSIVE);
                self.errors.mention(ErrorCode::BUS_OFF_RECOVERED, [0; 5]);
            }
            _ => {}
        }
        if before.is_on() && !status.is_on() {
            self.answers = Ring::new();
            self.reset_server(self.server.channel());
        } else if status.is_on() && !before.is_on() && self.producer.time_ms() != 0 {
            let time = self.producer.time_ms();
            self.producer.set_time(time, now);
        }
    }

    /// Lets everything happen whose time has come; early calls do nothing.
    pub fn handle_timeout(&mut self, now: Duration) {
        if !self.running {
            return;
        }
        let (server, mut view) = self.serving();
        server.handle_timeout(now, &mut view);
        self.objects.handle_timeout(now);
        self.collect_pdos();
        if let Some(event) = self.guard.handle_timeout(now) {
            self.tell(Event::LifeGuarding(event));
            self.on_lost(now, Cause::Guarding);
        }
        for index in 0..CONSUMERS {
            let Some((node, consumer)) = self.consumers.get_mut(index).and_then(Option::as_mut) else {
                continue;
            };
            let node = *node;
            if let Some(event) = consumer.handle_timeout(now) {
                self.tell(Event::Heartbeat { node, event });
                self.on_lost(now, Cause::Heartbeat(index));
            }
        }
        if let Some(event) = self.sync.handle_timeout(now) {
            self.on_sync(event);
        }
    }

    /// The master, or a node watched, is gone: emergency 8130h, and what 1029h:01 says (CiA 301,
    /// 7.5.2.32).
    fn on_lost(&mut self, now: Duration, cause: Cause) {
        let _ = self.errors.raise(ErrorCode::LIFE_GUARD, cause, [0; 5]);
        let next = match number(&mut self.objects, 0x1029, 1, 0) as u8 {
            0 if self.state() == State::Operational => State::PreOperational,
            2 => State::Stopped,
            _ => return,
        };
        if self.nmt.enter(next) {
            self.entered(now, next);
        }
    }

    /// The next frame to send, until `None`.
    #[inline]
    pub fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        if !self.bus.is_on() {
            return None;
        }
        if core::mem::take(&mut self.boot_up) {
            return Some(nmt::boot_up(self.nmt.node()));
        }
        if let Some(frame) = self.answers.pop() {
            return Some(frame);
        }
        if !self.running {
            return None;
        }
        let state = self.nmt.state();
        if state.has_sdo() {
            if let Some(id) = self.emcy_id
                && let Some(emergency) = self.errors.producer().poll_transmit(now)
            {
                return emergency_frame(id, &emergency);
            }
            if let Some(frame) = self.objects.poll_transmit(now).filter(|_| state.has_pdo()) {
                return Some(frame);
            }
            let (server, mut view) = self.serving();
            if let Some(frame) = server.poll_transmit(now, &mut view) {
                return Some(frame);
            }
        }
        self.producer.poll_transmit(now, state)
    }

    /// When to call [`handle_timeout`](Self::handle_timeout) and then
    /// [`poll_transmit`](Self::poll_transmit); `None` = idle.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Duration> {
        if !self.running {
            return None;
        }
        let on = self.bus.is_on();
        let emcy =
            self.emcy_id.filter(|_| on && self.state().has_sdo()).and_then(|_| self.errors.poll_timeout());
        let own = earliest(&[
            self.server.poll_timeout(),
            self.guard.poll_timeout(),
            self.producer.poll_timeout().filter(|_| on),
            self.objects.poll_timeout().filter(|_| on && self.state().has_pdo()),
            self.sync.poll_timeout(),
            emcy,
        ]);
        let consumers = self.consumers.iter().flatten().map(|(_, consumer)| consumer.poll_timeout());
        consumers.fold(own, earlier)
    }
}

fn emergency_frame(id: u16, emergency: &Emergency) -> Option<Frame> {
    let frame = emergency.frame(NodeId::MIN);
    Frame::data_frame(embedded_can::StandardId::new(id)?, frame.data())
}
