//! The drive on a CAN bus: boot-up, NMT resets, the configuration service by SDO, and the
//! configuration module in a PDO pair.

use core::time::Duration;
use std::collections::VecDeque;

use linmot::drive::{Drive, Module};
use linmot::module::{RPDO, TPDO};
use linmot::sdo::{Access, Answer, Server, abort};
use pdo::{Frame, NodeId};

use super::VirtualDrive;
use crate::can::Node;

/// COB-IDs (CiA 301).
const NMT: u16 = 0x000;
const SDO_ANSWER: u16 = 0x580;
const SDO_REQUEST: u16 = 0x600;
const BOOT_UP: u16 = 0x700;
/// NMT command specifiers that reset the node and its communication.
const RESETS: [u8; 2] = [0x81, 0x82];
/// Vendor ID of the manufacturer, 1018h:01.
const VENDOR: u32 = 0x156;

/// A virtual drive as a station of a bus.
#[derive(Debug, Clone)]
pub struct CanDrive {
    /// The drive.
    pub drive: VirtualDrive,
    node: NodeId,
    sdo: Server,
    module: Module,
    /// The restart under way ends with a boot-up message.
    away: bool,
    out: VecDeque<Frame>,
}

impl CanDrive {
    /// A drive that has just been switched on: its boot-up message goes first.
    #[must_use]
    pub fn new(drive: VirtualDrive, node: NodeId) -> Self {
        let mut can = Self {
            drive,
            node,
            sdo: Server::new(),
            module: Module::new(),
            away: false,
            out: VecDeque::new(),
        };
        can.boot_up();
        can
    }

    /// Power fails and comes back.
    pub fn power_cycle(&mut self, now: Duration) {
        self.out.clear();
        self.drive.power_cycle(now);
        self.settle(now);
    }

    fn id(&self, base: u16) -> u16 {
        base + u16::from(self.node.raw())
    }

    fn boot_up(&mut self) {
        self.out.push_back(Frame::standard(self.id(BOOT_UP), [0]));
    }

    fn settle(&mut self, now: Duration) {
        self.drive.advance(now);
        let restarting = self.drive.is_restarting(now);
        if self.away && !restarting {
            self.boot_up();
        }
        self.away = restarting;
        self.module.handle_timeout(now, &self.drive);
    }

    /// Objects beside the configuration service: device type and identity.
    fn object(&self, access: &Access) -> Answer {
        let value = match (access.index, access.sub) {
            (0x1000, 0) => 0,
            (0x1001, 0) => 0,
            (0x1018, 0) => 4,
            (0x1018, 1) => VENDOR,
            (0x1018, 2..=4) => 0,
            (0x1018, _) => return Answer::Abort(abort::NO_SUB_INDEX),
            _ => return Answer::Abort(abort::NO_OBJECT),
        };
        match access.write {
            Some(_) => Answer::Abort(abort::READ_ONLY),
            None => Answer::Read(value.to_le_bytes()),
        }
    }

    fn sdo(&mut self, now: Duration, telegram: [u8; 8]) {
        let [command, low, high, sub, ..] = telegram;
        let index = u16::from_le_bytes([low, high]);
        let answer = match Access::parse(telegram) {
            // An abort of the client needs no answer.
            None if command == 0x80 => None,
            None => Some(Answer::Abort(abort::COMMAND)),
            Some(access) if Server::serves(access.index) => self.sdo.execute(now, &access, &mut self.drive),
            Some(access) => Some(self.object(&access)),
        };
        if let Some(answer) = answer {
            self.out.push_back(Frame::standard(self.id(SDO_ANSWER), answer.encode(index, sub)));
        }
    }
}

impl Node for CanDrive {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        self.settle(now);
        if self.drive.is_restarting(now) || frame.is_remote() {
            return;
        }
        let Some(id) = frame.standard_id() else { return };
        match (id, frame.data()) {
            (NMT, [command, node]) if RESETS.contains(command) && [0, self.node.raw()].contains(node) => {
                self.drive.restart(now);
            }
            (id, data) if id == self.id(SDO_REQUEST) => {
                if let Ok(telegram) = <[u8; 8]>::try_from(data) {
                    self.sdo(now, telegram);
                }
            }
            (id, data) if id == self.id(RPDO) => {
                if let Ok(image) = <[u8; 8]>::try_from(data) {
                    self.module.handle_output(now, image, &mut self.drive);
                }
            }
            _ => {}
        }
        self.settle(now);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.settle(now);
    }

    fn poll_transmit(&mut self, _now: Duration) -> Option<Frame> {
        if let Some(frame) = self.out.pop_front() {
            return Some(frame);
        }
        let image = self.module.poll_transmit()?;
        Some(Frame::standard(self.id(TPDO), image))
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.drive.poll_timeout()
    }
}
