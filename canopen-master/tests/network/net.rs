//! A master and slaves on virtual time; frames take none.

use core::time::Duration;
use std::collections::BTreeMap;

use canopen_master::lss::Identity;
use canopen_master::master::{Config, Event, Master};
use canopen_master::sdo::{AbortCode, Access, Piece, Total, read_slice};
use canopen_master::slave::{self, Slave};
use canopen_master::{Address, Frame, NodeId};

pub(crate) type TestMaster = Master<'static, Vec<u8>, 127>;

pub(crate) const fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

pub(crate) fn node(id: u8) -> NodeId {
    NodeId::new(id).unwrap()
}

/// Objects by address; what is not there does not exist.
#[derive(Debug, Clone, Default)]
pub(crate) struct Dictionary {
    pub(crate) objects: BTreeMap<Address, Vec<u8>>,
    incoming: Vec<u8>,
}

impl Dictionary {
    pub(crate) fn set(&mut self, index: u16, sub: u8, value: &[u8]) {
        self.objects.insert(Address::new(index, sub), value.into());
    }
}

impl Access for Dictionary {
    fn read(&mut self, at: Address, offset: u32, out: &mut [u8]) -> Result<(usize, Total), AbortCode> {
        let object = self.objects.get(&at).ok_or(AbortCode::NO_OBJECT)?;
        Ok(read_slice(object, offset, out))
    }

    fn begin_write(&mut self, at: Address, _: Option<u32>) -> Result<(), AbortCode> {
        self.incoming.clear();
        self.objects.contains_key(&at).then_some(()).ok_or(AbortCode::NO_OBJECT)
    }

    fn write(&mut self, at: Address, piece: &Piece<'_>) -> Result<(), AbortCode> {
        let object = self.objects.get_mut(&at).ok_or(AbortCode::NO_OBJECT)?;
        if piece.offset == 0 {
            self.incoming.clear();
        }
        self.incoming.extend_from_slice(piece.data);
        if piece.last {
            *object = core::mem::take(&mut self.incoming);
        }
        Ok(())
    }
}

impl slave::Objects for Dictionary {}

/// A drive as manual A's LD 2000 shows itself.
pub(crate) fn drive(identity: Identity) -> Dictionary {
    let mut objects = Dictionary::default();
    objects.set(0x1000, 0, &0x0002_0192_u32.to_le_bytes());
    objects.set(0x1008, 0, b"SD03");
    objects.set(0x1017, 0, &[0, 0]);
    objects.set(0x100C, 0, &[0, 0]);
    objects.set(0x100D, 0, &[0]);
    for (sub, value) in (1..).zip([identity.vendor, identity.product, identity.revision, identity.serial]) {
        objects.set(0x1018, sub, &value.to_le_bytes());
    }
    objects.set(0x1020, 1, &[0; 4]);
    objects.set(0x1020, 2, &[0; 4]);
    objects.set(0x2600, 0, &[1]);
    objects.set(0x35B4, 1, &[0]);
    objects
}

pub(crate) fn identity(serial: u32) -> Identity {
    Identity { vendor: 0x6A, product: 3, revision: 1, serial }
}

pub(crate) struct Net {
    pub(crate) now: Duration,
    pub(crate) master: TestMaster,
    pub(crate) slaves: Vec<Slave<Dictionary>>,
    /// Slaves that nobody hears and who hear nobody.
    pub(crate) silent: Vec<bool>,
    pub(crate) events: Vec<(Duration, Event<Vec<u8>>)>,
    /// Every frame, in order.
    pub(crate) log: Vec<(Duration, Frame)>,
}

impl Net {
    /// A master and running slaves with these addresses; their boot-up messages are over.
    pub(crate) fn new(nodes: &[u8]) -> Self {
        let slave = |id: &u8| {
            let identity = identity((*id).into());
            Slave::new(&slave::Config::new(identity, Some(node(*id))), drive(identity))
        };
        let mut net = Self {
            now: Duration::ZERO,
            master: Master::new(Config::default()),
            slaves: nodes.iter().map(slave).collect(),
            silent: vec![false; nodes.len()],
            events: Vec::new(),
            log: Vec::new(),
        };
        for slave in &mut net.slaves {
            assert!(slave.boot(Duration::ZERO));
            while slave.poll_transmit(Duration::ZERO).is_some() {}
        }
        net
    }

    /// Frames go to everybody at once, until nobody has one.
    pub(crate) fn exchange(&mut self) {
        for _ in 0..10_000 {
            self.collect();
            if let Some(frame) = self.master.poll_transmit(self.now) {
                self.log.push((self.now, frame));
                for (slave, silent) in self.slaves.iter_mut().zip(&self.silent) {
                    if !silent {
                        slave.handle_frame(self.now, &frame);
                    }
                }
                continue;
            }
            let mut sent = None;
            for (slave, silent) in self.slaves.iter_mut().zip(&self.silent) {
                if let Some(frame) = slave.poll_transmit(self.now) {
                    sent = (!silent).then_some(frame);
                    if sent.is_some() {
                        break;
                    }
                }
            }
            let Some(frame) = sent else {
                if self.slaves.iter_mut().all(|slave| slave.poll_event().is_none()) {
                    return;
                }
                continue;
            };
            self.log.push((self.now, frame));
            self.master.handle_frame(self.now, &frame);
        }
        panic!("frames without end at {:?}", self.now);
    }

    fn collect(&mut self) {
        while let Some(event) = self.master.poll_event() {
            self.events.push((self.now, event));
        }
        for slave in &mut self.slaves {
            while let Some(event) = slave.poll_event() {
                if matches!(event, slave::Event::ResetNode | slave::Event::ResetCommunication) {
                    slave.boot(self.now);
                }
            }
        }
    }

    /// Lets time go on.
    pub(crate) fn run(&mut self, until: Duration) {
        for _ in 0..1_000_000 {
            self.exchange();
            let timeouts = self.slaves.iter().filter_map(Slave::poll_timeout);
            let next = timeouts.chain(self.master.poll_timeout()).min();
            let Some(next) = next.filter(|next| *next <= until) else {
                self.now = until;
                return;
            };
            assert!(next >= self.now || self.master.poll_timeout() != Some(next), "time stands still");
            self.now = self.now.max(next);
            self.master.handle_timeout(self.now);
            for slave in &mut self.slaves {
                slave.handle_timeout(self.now);
            }
        }
        panic!("no end at {:?}", self.now);
    }

    /// What the master told, without the times.
    pub(crate) fn take_events(&mut self) -> Vec<Event<Vec<u8>>> {
        self.events.drain(..).map(|(_, event)| event).collect()
    }

    /// Runs until an event of a kind.
    pub(crate) fn expect<T>(
        &mut self,
        limit: Duration,
        mut wanted: impl FnMut(&Event<Vec<u8>>) -> Option<T>,
    ) -> T {
        let end = self.now + limit;
        loop {
            let found = self.events.iter().position(|(_, event)| wanted(event).is_some());
            if let Some(index) = found {
                return wanted(&self.events.remove(index).1).unwrap();
            }
            assert!(self.now < end, "not within {limit:?}; {:?}", self.events);
            self.run((self.now + ms(1)).min(end));
        }
    }
}
