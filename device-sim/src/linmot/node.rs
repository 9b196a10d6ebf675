//! The drive on a CAN bus: a CANopen slave with guarding, heartbeat and LSS, whose objects from 2000h
//! on are the configuration service, and the configuration module in a PDO pair.

use core::time::Duration;
use std::collections::VecDeque;

use canopen_master::lss::{BitTiming, Identity};
use canopen_master::slave::{Config, Event, Slave};
use linmot::drive::Drive;
use pdo::{Frame, NodeId, cob};

use super::VirtualDrive;
use super::objects::DriveObjects;
use crate::can::Node;

/// Vendor ID of the manufacturer, 1018h:01.
const VENDOR: u32 = 0x156;
/// 1018h:02 of the virtual drive; project-defined.
const PRODUCT: u32 = 0x1250;
/// Command specifier of the answer that begins or ends a download (CiA 301, 7.2.4.3.3).
const DOWNLOADED: u8 = 0x60;

/// A virtual drive as a station of a bus.
#[derive(Debug)]
pub struct CanDrive {
    slave: Slave<DriveObjects>,
    /// The restart under way ends with a boot-up message.
    away: bool,
    out: VecDeque<Frame>,
}

impl CanDrive {
    /// A drive that has just been switched on: its boot-up message goes first. Without an address it
    /// waits for one over LSS. `serial`: 1018h:04.
    #[must_use]
    pub fn new(drive: VirtualDrive, node: Option<NodeId>, serial: u32) -> Self {
        let identity = Identity { vendor: VENDOR, product: PRODUCT, revision: 1, serial };
        let rates: Vec<_> = (0..=8).filter_map(BitTiming::from_index).collect();
        let config = Config { bit_rates: &rates, ..Config::new(identity, node) };
        let slave = Slave::new(&config, DriveObjects::new(drive, identity));
        let mut can = Self { slave, away: false, out: VecDeque::new() };
        can.boot(Duration::ZERO);
        can
    }

    /// The drive.
    #[must_use]
    pub const fn drive(&self) -> &VirtualDrive {
        self.slave.objects().drive()
    }

    /// The drive, to let something happen to it.
    pub const fn drive_mut(&mut self) -> &mut VirtualDrive {
        self.slave.objects_mut().drive_mut()
    }

    /// Its address; `None` while it waits for one.
    #[must_use]
    pub const fn node(&self) -> Option<NodeId> {
        self.slave.node()
    }

    /// Power fails and comes back.
    pub fn power_cycle(&mut self, now: Duration) {
        self.out.clear();
        self.drive_mut().power_cycle(now);
        self.away = true;
        self.settle(now);
    }

    fn boot(&mut self, now: Duration) {
        // A node ID that LSS has given holds from now on, and objects depend on it.
        let node = self.slave.next_node();
        self.slave.objects_mut().reset_communication(node);
        self.slave.boot(now);
    }

    /// What has happened takes effect; a drive that restarts falls silent when its answer has gone.
    fn settle(&mut self, now: Duration) {
        self.drive_mut().advance(now);
        while let Some(event) = self.slave.poll_event() {
            match event {
                Event::ResetNode => self.drive_mut().restart(now),
                Event::ResetCommunication => self.boot(now),
                // The store is this process's memory, and a virtual bus has one bit rate.
                Event::Lss(canopen_master::lss::Action::Store { .. }) => self.slave.stored(Ok(())),
                _ => {}
            }
        }
        let restarting = self.drive().is_restarting(now);
        if restarting && !self.away {
            while let Some(frame) = self.next_frame(now) {
                self.out.push_back(frame);
            }
        }
        if self.away && !restarting {
            self.slave.objects_mut().restarted();
            self.boot(now);
        }
        self.away = restarting;
    }

    fn next_frame(&mut self, now: Duration) -> Option<Frame> {
        let frame = self.slave.poll_transmit(now)?;
        let answer = self.slave.node().map(|node| cob::SDO_RESPONSE + u16::from(node.raw()));
        // The documents have the result of a command in an answer's bytes that CiA 301 reserves.
        if frame.standard_id() == answer
            && let Some(&[DOWNLOADED, low, high, sub, ..]) = frame.data().first_chunk::<8>()
            && let Some([a, b, c, d]) = self.slave.objects_mut().take_result()
        {
            return Some(Frame::standard(frame.standard_id()?, [DOWNLOADED, low, high, sub, a, b, c, d]));
        }
        Some(frame)
    }
}

impl Node for CanDrive {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        self.settle(now);
        if !self.away {
            self.slave.objects_mut().set_time(now);
            self.slave.handle_frame(now, frame);
            self.settle(now);
        }
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.settle(now);
        if !self.away {
            self.slave.objects_mut().set_time(now);
            self.slave.handle_timeout(now);
            self.settle(now);
        }
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        self.out.pop_front().or_else(|| if self.away { None } else { self.next_frame(now) })
    }

    fn poll_timeout(&self) -> Option<Duration> {
        let slave = if self.away { None } else { self.slave.poll_timeout() };
        [slave, self.drive().poll_timeout()].into_iter().flatten().min()
    }
}
