//! A virtual node on the bus: frames in and out, deadlines, the state of its controller.

use core::time::Duration;

use canopen_master::emcy::ErrorCode;
use canopen_master::{guarding, lss};
use pdo::{Frame, NodeId, cob};

use super::Node;
use crate::can;
use crate::canopen::Device;

impl<D: Device> can::Node for Node<D> {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        if !self.started {
            self.boot(now);
        }
        let Some(id) = frame.standard_id() else { return };
        if let Some(request) = lss::Request::from_frame(frame) {
            return self.lss(now, request);
        }
        let Some(own) = self.lss.node() else { return };
        let state = self.nmt.state();
        if id == cob::NMT {
            self.nmt(now, frame);
        } else if let Some(event) = self.sync.handle_frame(now, frame) {
            if state.has_sdo() {
                self.synchronise(now, event);
            }
        } else if id == cob::SDO_REQUEST + u16::from(own.raw()) {
            if state.has_sdo() {
                self.serve(now, |sdo, objects| sdo.handle_frame(now, frame, objects));
            }
        } else if let Some(other) =
            id.checked_sub(cob::ERROR_CONTROL).and_then(|node| NodeId::new(node as u8).ok())
        {
            self.error_control(now, frame, other);
        } else if state.has_pdo() {
            self.with(now, Device::update);
            self.rpdo(now, frame);
        }
        if self.nmt.state().has_pdo() {
            self.look(now);
        }
    }

    fn handle_timeout(&mut self, now: Duration) {
        if !self.started {
            self.boot(now);
        }
        self.serve(now, |sdo, objects| sdo.handle_timeout(now, objects));
        if self.guard.handle_timeout(now) == Some(guarding::Event::Lost) {
            self.master(now, true);
        }
        let lost = self.masters.iter_mut().filter_map(|(_, consumer)| consumer.handle_timeout(now)).count();
        if lost > 0 {
            self.master(now, true);
        }
        let _ = self.sync.handle_timeout(now);
        if self.device.poll_timeout().is_some_and(|at| at <= now) {
            self.with(now, Device::update);
        }
        if self.nmt.state().has_pdo() {
            for _ in 0..self.pdos.timed_out(now) {
                self.communication_error(ErrorCode::RPDO_TIMEOUT, [0; 5]);
            }
            self.look(now);
        }
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        if !self.started {
            self.boot(now);
        }
        if let Some(frame) = self.out.pop_front() {
            return Some(frame);
        }
        let id = self.lss.node()?;
        let state = self.nmt.state();
        if state.has_sdo()
            && let Some(emergency) = self.emergencies.poll_transmit(now)
        {
            return Some(emergency.frame(id));
        }
        if let Some(frame) = self.heartbeat.poll_transmit(now, state) {
            return Some(frame);
        }
        if state.has_pdo() {
            self.with(now, Device::update);
            if let Some(frame) = self.pdos.transmit(now, &self.objects) {
                return Some(frame);
            }
        }
        self.serve(now, |sdo, objects| sdo.poll_transmit(now, objects))
    }

    fn poll_timeout(&self) -> Option<Duration> {
        if !self.started {
            return Some(Duration::ZERO);
        }
        self.lss.node()?;
        let state = self.nmt.state();
        let emergency = self.emergencies.poll_timeout().filter(|_| state.has_sdo());
        let pdos = if state.has_pdo() { self.pdos.poll_timeout(&self.objects) } else { None };
        [
            self.sdo.poll_timeout(),
            self.guard.poll_timeout(),
            self.heartbeat.poll_timeout(),
            self.sync.poll_timeout(),
            self.device.poll_timeout(),
            emergency,
            pdos,
        ]
        .into_iter()
        .chain(self.masters.iter().map(|(_, consumer)| consumer.poll_timeout()))
        .flatten()
        .min()
    }

    fn handle_bus(&mut self, _now: Duration, event: can::Event) {
        match event {
            can::Event::State(can::State::Passive) => {
                self.communication_error(ErrorCode::CAN_PASSIVE, [0; 5]);
            }
            can::Event::State(can::State::BusOff) => self.was_off = true,
            can::Event::State(can::State::Active) if core::mem::take(&mut self.was_off) => {
                self.communication_error(ErrorCode::BUS_OFF_RECOVERED, [0; 5]);
            }
            _ => {}
        }
    }
}
