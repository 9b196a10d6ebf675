//! The example's machine: the controller with an LD 2000 on CAN 2, on virtual time.

use core::time::Duration;

use device_sim::can::{Bus, Faults, Network, Node};
use device_sim::canopen::Ld2000;
use lb2::telegram::BANK_LEN;
use motion_core::application::{AxisStatus, Order, Progress, Ticket};
use motion_core::bus::CanBus;
use motion_core::io::{Inputs, Terminal};
use motion_core::{Controller, Model};
use pdo::{Frame, NodeId};

use crate::exit::Exit;
use crate::plot::Sample;

/// CAN 2, by place.
const CAN_2: usize = 1;
/// As set in the drive, and in the controller from the factory.
const BIT_RATE: u32 = 500_000;

type Drive = device_sim::canopen::Node<Ld2000>;

/// What went over the bus, by service.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Traffic {
    pub(super) sync: u32,
    pub(super) guard_requests: u32,
    pub(super) guard_replies: u32,
    pub(super) boot_ups: u32,
    pub(super) rpdo: u32,
    pub(super) tpdo: u32,
    pub(super) all: u32,
}

/// A station that only listens.
#[derive(Debug, Default)]
struct Listener(Traffic);

impl Node for Listener {
    fn handle_frame(&mut self, _now: Duration, frame: &Frame) {
        let Traffic { sync, guard_requests, guard_replies, boot_ups, rpdo, tpdo, all } = &mut self.0;
        *all += 1;
        match (frame.standard_id(), frame.is_remote()) {
            (Some(0x080), _) => *sync += 1,
            (Some(0x701), true) => *guard_requests += 1,
            (Some(0x701), false) if frame.data() == [0] => *boot_ups += 1,
            (Some(0x701), false) => *guard_replies += 1,
            (Some(0x201), _) => *rpdo += 1,
            (Some(0x181), _) => *tpdo += 1,
            _ => {}
        }
    }

    fn handle_timeout(&mut self, _now: Duration) {}

    fn poll_transmit(&mut self, _now: Duration) -> Option<Frame> {
        None
    }

    fn poll_timeout(&self) -> Option<Duration> {
        None
    }
}

/// The machine, switched on.
pub(super) struct Machine {
    pub(super) controller: Controller<Vec<u8>, Vec<u8>>,
    drive: Drive,
    listener: Listener,
    network: Network,
    inputs: Inputs,
    /// Axis 1, a sample a cycle.
    pub(super) samples: Vec<Sample>,
}

impl Machine {
    pub(super) fn power_on(storage: Vec<u8>) -> Self {
        let mut inputs = Inputs::default();
        inputs.digital.set(Terminal::PLC_RUN, true);
        Self {
            controller: Controller::power_on(Model::Gel8230, storage, vec![0; BANK_LEN]),
            drive: Ld2000::node(Some(NodeId::MIN), 1),
            listener: Listener::default(),
            network: Network::new(Bus::new(BIT_RATE, Faults::NONE), 3),
            inputs,
            samples: Vec::new(),
        }
    }

    pub(super) const fn now(&self) -> Duration {
        self.network.now()
    }

    pub(super) const fn traffic(&self) -> Traffic {
        self.listener.0
    }

    pub(super) fn can(&mut self) -> Result<&mut CanBus, Exit> {
        self.controller.bus(CAN_2).ok_or_else(|| Exit::check("the controller has no CAN 2"))
    }

    pub(super) fn status(&self) -> AxisStatus {
        self.controller.axis_status(0).copied().unwrap_or_default()
    }

    /// One control cycle: terminals and set values, then what the bus does until the next one.
    pub(super) fn cycle(&mut self) -> Result<(), Exit> {
        let now = self.now();
        let cycle = self.controller.cycle_time();
        self.controller.cycle(now, &self.inputs, &mut ());
        self.controller.advance(cycle).map_err(|error| Exit::trouble(error.to_string()))?;
        self.samples.push(Sample::new(now, 1, &self.status()));
        let Self { controller, drive, listener, network, .. } = self;
        let Some(bus) = controller.bus(CAN_2) else { return Ok(()) };
        let mut nodes: [&mut dyn Node; 3] = [bus, drive, listener];
        while network.step(&mut nodes, now + cycle) {}
        Ok(())
    }

    pub(super) fn run(&mut self, time: Duration) -> Result<(), Exit> {
        let end = self.now() + time;
        while self.now() < end {
            self.cycle()?;
        }
        Ok(())
    }

    /// Cycles until `done` says so; `what` names it should it take longer than ten seconds.
    pub(super) fn until(&mut self, what: &str, mut done: impl FnMut(&mut Self) -> bool) -> Result<(), Exit> {
        let limit = self.now() + Duration::from_secs(10);
        while !done(self) {
            if self.now() >= limit {
                let failures = self.controller.failures().stored().iter();
                let failures: Vec<_> =
                    failures.map(|stored| format!(", failure {}", stored.failure.0)).collect();
                return Err(Exit::check(format!("not within 10 s: {what}{}", failures.concat())));
            }
            self.cycle()?;
        }
        Ok(())
    }

    /// Gives axis 1 an order, as with the keys of the device.
    pub(super) fn order(&mut self, order: Order) -> Result<Ticket, Exit> {
        let axis = self.controller.axis(0).ok_or_else(|| Exit::check("the controller has no axis 1"))?;
        axis.order(order).map_err(|error| Exit::check(format!("axis 1 refuses an order: {error}")))
    }

    pub(super) fn progress(&mut self, ticket: Ticket) -> Option<Progress> {
        Some(self.controller.axis(0)?.progress(ticket))
    }

    pub(super) fn set_power(&mut self, on: bool) -> Result<(), Exit> {
        let axis = self.controller.axis(0).ok_or_else(|| Exit::check("the controller has no axis 1"))?;
        axis.set_power(on).map_err(|error| Exit::check(format!("axis 1 cannot be enabled: {error}")))
    }
}
