//! What the communication objects say, and the states in which they hold.

use core::time::Duration;

use pdo::{CobId, NodeId, cob};

use super::errors::Cause;
use super::objects::{View, number};
use super::{CONSUMERS, Event, Objects, Slave};
use crate::heartbeat::{Consumer, Producer};
use crate::nmt::State;
use crate::ring::Ring;
use crate::sdo::{Channel, Server};
use crate::{guarding, nmt, sync};

impl<D: Objects> Slave<D> {
    /// Starts the communication: reads the communication objects, sends the boot-up message and is
    /// pre-operational. Returns whether it did: not without an address.
    pub fn boot(&mut self, now: Duration) -> bool {
        self.lss.restart();
        self.objects.stop();
        let Some(node) = self.lss.node() else {
            self.running = false;
            return false;
        };
        self.nmt = nmt::Slave::new(node);
        self.nmt.boot();
        self.boot_up = true;
        self.running = true;
        self.answers = Ring::new();
        self.reset_server(Channel::default_of(node));
        // Nothing is told: the boot-up message says more.
        let _ = self.errors.clear(|_, cause| cause != Cause::Device, false);
        self.guard = guarding::Slave::new(node, None);
        self.producer = Producer::new(node, 0, now);
        self.consumers = [None; CONSUMERS];
        for index in [0x1005, 0x100C, 0x1014, 0x1015, 0x1016, 0x1017] {
            self.configure(now, index);
        }
        true
    }

    /// The NMT state has changed.
    pub(super) fn entered(&mut self, now: Duration, state: State) {
        if state.has_pdo() {
            self.objects.start(now);
        } else {
            self.objects.stop();
        }
        if !state.has_sdo() {
            self.reset_server(self.server.channel());
        }
        self.tell(Event::State(state));
    }

    /// Transfers end, unfinished.
    pub(super) fn reset_server(&mut self, channel: Channel) {
        let (server, mut view) = self.serving();
        server.reset(channel, &mut view);
    }

    /// Takes over what a communication object says.
    pub(super) fn configure(&mut self, now: Duration, index: u16) {
        let mut number = |sub: u8, index, absent| number(&mut self.objects, index, sub, absent);
        match index {
            0x1005 | 0x1006 | 0x1019 => {
                let id = CobId(number(0, 0x1005, cob::SYNC.into()) & 0x1FFF_FFFF).standard_id();
                let period = Duration::from_micros(number(0, 0x1006, 0).into());
                let overflow = number(0, 0x1019, 0) as u8;
                self.sync = sync::Consumer::new(period, overflow).with_id(id.unwrap_or(cob::SYNC));
            }
            0x100C | 0x100D => {
                let period_ms = number(0, 0x100C, 0) as u16;
                let life_time_factor = number(0, 0x100D, 0) as u8;
                let on = period_ms != 0 && life_time_factor != 0;
                self.guard.set_config(on.then_some(guarding::Config { period_ms, life_time_factor }));
                if !on {
                    self.errors.clear_cause(Cause::Guarding);
                }
            }
            0x1014 => {
                let default = cob::EMCY + u16::from(self.nmt.node().raw());
                let entry = CobId(number(0, 0x1014, default.into()));
                self.emcy_id = entry.standard_id().filter(|_| entry.is_valid());
            }
            0x1015 => {
                let inhibit = number(0, 0x1015, 0) as u16;
                self.errors.producer().set_inhibit(inhibit);
            }
            0x1016 => {
                for (index, slot) in self.consumers.iter_mut().enumerate() {
                    let entry = number(index as u8 + 1, 0x1016, 0) & 0xFF_FFFF;
                    // An entry that has not changed goes on watching.
                    let held = |(node, consumer): &(NodeId, Consumer)| {
                        u32::from(node.raw()) << 16 | u32::from(consumer.time_ms())
                    };
                    if entry != slot.as_ref().map_or(0, held) {
                        let time_ms = entry as u16;
                        let node = NodeId::new((entry >> 16) as u8).ok().filter(|_| time_ms != 0);
                        *slot = node.map(|node| (node, Consumer::new(time_ms)));
                        self.errors.clear_cause(Cause::Heartbeat(index));
                    }
                }
            }
            0x1017 => {
                let time_ms = number(0, 0x1017, 0) as u16;
                if time_ms != self.producer.time_ms() {
                    self.producer.set_time(time_ms, now);
                }
            }
            _ => {}
        }
    }

    /// The SDO server and what it serves.
    pub(super) fn serving(&mut self) -> (&mut Server, View<'_, D>) {
        let view = View { dictionary: &mut self.objects, errors: &mut self.errors, written: None };
        (&mut self.server, view)
    }
}
