//! The virtual LinMot drive as a CANopen node: boot-up, guarding, heartbeat, LSS, SDO, PDOs, restart.

use core::time::Duration;

use device_sim::can::Node;
use device_sim::linmot::{CanDrive, Times, VirtualDrive, sg5};
use embedded_can::StandardId;
use pdo::{Frame, NodeId};

const TIMES: Times = Times {
    restart: Duration::from_millis(800),
    start: Duration::from_millis(300),
    flash: Duration::from_millis(400),
};

/// A drive on virtual time: frames in, frames out.
struct Script {
    node: CanDrive,
    now: Duration,
}

impl Script {
    fn new(node: Option<u8>) -> Self {
        let node = node.map(|node| NodeId::new(node).unwrap());
        Self { node: CanDrive::new(VirtualDrive::new(sg5(), TIMES), node, 77), now: Duration::ZERO }
    }

    fn at(&mut self, ms: u64) {
        self.now = Duration::from_millis(ms);
        self.node.handle_timeout(self.now);
    }

    #[track_caller]
    fn send(&mut self, id: u16, data: &[u8]) {
        self.node.handle_frame(self.now, &Frame::data_frame(StandardId::new(id).unwrap(), data).unwrap());
    }

    fn guard(&mut self, id: u16) {
        self.node.handle_frame(self.now, &Frame::remote_frame(StandardId::new(id).unwrap(), 1).unwrap());
    }

    #[track_caller]
    fn receive(&mut self, id: u16, data: &[u8]) {
        let frame = self.node.poll_transmit(self.now).expect("a frame");
        assert_eq!((frame.standard_id(), frame.data()), (Some(id), data), "{frame:?}");
    }

    #[track_caller]
    fn is_silent(&mut self) {
        assert_eq!(self.node.poll_transmit(self.now), None);
    }

    #[track_caller]
    fn sdo(&mut self, request: [u8; 8], answer: [u8; 8]) {
        self.send(0x601, &request);
        self.receive(0x581, &answer);
        self.is_silent();
    }
}

#[test]
fn guarding_and_heartbeat() {
    let mut drive = Script::new(Some(1));
    drive.receive(0x701, &[0]);
    drive.is_silent();
    // Toggle; pre-operational, then operational.
    drive.guard(0x701);
    drive.receive(0x701, &[0x7F]);
    drive.guard(0x701);
    drive.receive(0x701, &[0xFF]);
    drive.send(0x000, &[0x01, 1]);
    drive.guard(0x701);
    drive.receive(0x701, &[0x05]);
    // Guard time 100 ms, life time factor 3: 300 ms after the last request the drive says so.
    drive.sdo([0x2B, 0x0C, 0x10, 0, 100, 0, 0, 0], [0x60, 0x0C, 0x10, 0, 0, 0, 0, 0]);
    drive.sdo([0x2F, 0x0D, 0x10, 0, 3, 0, 0, 0], [0x60, 0x0D, 0x10, 0, 0, 0, 0, 0]);
    drive.at(50);
    drive.guard(0x701);
    drive.receive(0x701, &[0x85]);
    drive.at(349);
    drive.is_silent();
    drive.at(350);
    drive.receive(0x081, &[0x30, 0x81, 0x11, 0, 0, 0, 0, 0]);
    drive.sdo([0x40, 0x01, 0x10, 0, 0, 0, 0, 0], [0x4F, 0x01, 0x10, 0, 0x11, 0, 0, 0]);
    drive.guard(0x701);
    drive.receive(0x701, &[0x7F]);
    drive.receive(0x081, &[0; 8]);
    // Heartbeat every 200 ms.
    drive.sdo([0x2B, 0x0C, 0x10, 0, 0, 0, 0, 0], [0x60, 0x0C, 0x10, 0, 0, 0, 0, 0]);
    drive.send(0x601, &[0x2B, 0x17, 0x10, 0, 200, 0, 0, 0]);
    drive.receive(0x581, &[0x60, 0x17, 0x10, 0, 0, 0, 0, 0]);
    drive.is_silent();
    drive.at(550);
    drive.receive(0x701, &[0x7F]);
}

#[test]
fn a_drive_without_node_id_waits_for_lss() {
    let mut drive = Script::new(None);
    drive.is_silent();
    drive.send(0x601, &[0x40, 0x00, 0x10, 0, 0, 0, 0, 0]);
    drive.is_silent();
    // Identify non-configured; switch all to configuration; node ID 5; back to waiting.
    drive.send(0x7E5, &[0x4C, 0, 0, 0, 0, 0, 0, 0]);
    drive.receive(0x7E4, &[0x50, 0, 0, 0, 0, 0, 0, 0]);
    drive.send(0x7E5, &[0x04, 1, 0, 0, 0, 0, 0, 0]);
    drive.send(0x7E5, &[0x11, 5, 0, 0, 0, 0, 0, 0]);
    drive.receive(0x7E4, &[0x11, 0, 0, 0, 0, 0, 0, 0]);
    drive.send(0x7E5, &[0x17, 0, 0, 0, 0, 0, 0, 0]);
    drive.receive(0x7E4, &[0x17, 0, 0, 0, 0, 0, 0, 0]);
    drive.send(0x7E5, &[0x04, 0, 0, 0, 0, 0, 0, 0]);
    drive.receive(0x705, &[0]);
    assert_eq!(drive.node.node(), NodeId::new(5).ok());
    // 1018h:04, by which LSS tells drives apart; the emergency's COB-ID follows the node ID.
    drive.send(0x605, &[0x40, 0x18, 0x10, 4, 0, 0, 0, 0]);
    drive.receive(0x585, &[0x43, 0x18, 0x10, 4, 77, 0, 0, 0]);
    drive.send(0x605, &[0x40, 0x14, 0x10, 0, 0, 0, 0, 0]);
    drive.receive(0x585, &[0x43, 0x14, 0x10, 0, 0x85, 0, 0, 0]);
    drive.send(0x605, &[0x40, 0xA2, 0x33, 1, 0, 0, 0, 0]);
    drive.receive(0x585, &[0x43, 0xA2, 0x33, 1, 10, 0, 0, 0]);
}

#[test]
fn objects_of_any_length_and_results_in_the_answer() {
    let mut drive = Script::new(Some(1));
    drive.receive(0x701, &[0]);
    // 1008h, "Virtual LinMot drive", in segments.
    drive.sdo([0x40, 0x08, 0x10, 0, 0, 0, 0, 0], [0x41, 0x08, 0x10, 0, 20, 0, 0, 0]);
    drive.sdo([0x60, 0, 0, 0, 0, 0, 0, 0], *b"\x00Virtual");
    drive.sdo([0x70, 0, 0, 0, 0, 0, 0, 0], *b"\x10 LinMot");
    drive.sdo([0x60, 0, 0, 0, 0, 0, 0, 0], *b"\x03 drive\0");
    // 2 bytes to a 16-bit parameter's RAM and ROM; 4 bytes in a segment.
    drive.sdo([0x2B, 0xA2, 0x33, 6, 77, 0, 9, 9], [0x60, 0xA2, 0x33, 6, 0, 0, 0, 0]);
    drive.sdo([0x21, 0xA2, 0x33, 6, 4, 0, 0, 0], [0x60, 0xA2, 0x33, 6, 0, 0, 0, 0]);
    drive.sdo([0x07, 78, 0, 0, 0, 0, 0, 0], [0x20, 0, 0, 0, 0, 0, 0, 0]);
    drive.sdo([0x40, 0xA2, 0x33, 2, 0, 0, 0, 0], [0x43, 0xA2, 0x33, 2, 78, 0, 0, 0]);
    // 0185-1075, 11.1: the result of a curve command is in byte 6, and can be read.
    drive.sdo([0x23, 0x01, 0x20, 0x50, 70, 0, 2, 0], [0x60, 0x01, 0x20, 0x50, 0, 0, 0xD1, 0]);
    drive.sdo([0x40, 0x00, 0x20, 0x43, 0, 0, 0, 0], [0x43, 0x00, 0x20, 0x43, 0xD1, 0, 0, 0]);
    drive.sdo([0x23, 0x01, 0x20, 0x50, 70, 0, 8, 0], [0x60, 0x01, 0x20, 0x50, 0, 0, 0, 0]);
    drive.sdo([0x23, 0x01, 0x20, 0x54, 0x46, 0, 3, 0], [0x60, 0x01, 0x20, 0x54, 0, 0, 4, 0]);
    // An answer after it has its own result.
    drive.sdo([0x2B, 0x17, 0x10, 0, 0, 0, 0, 0], [0x60, 0x17, 0x10, 0, 0, 0, 0, 0]);
    // Decision 27: what CiA 301 has a code for is aborted.
    drive.sdo([0x40, 0x11, 0x31, 1, 0, 0, 0, 0], [0x80, 0x11, 0x31, 1, 0, 0, 0x02, 0x06]);
    drive.sdo([0x23, 0x36, 0x41, 2, 0, 0, 0, 0], [0x80, 0x36, 0x41, 2, 2, 0, 0x01, 0x06]);
    drive.sdo([0x23, 0x9E, 0x31, 2, 1, 0x7D, 0, 0], [0x80, 0x9E, 0x31, 2, 0x31, 0, 0x09, 0x06]);
    drive.sdo([0x23, 0x00, 0x10, 0, 1, 0, 0, 0], [0x80, 0x00, 0x10, 0, 2, 0, 0x01, 0x06]);
    drive.sdo([0x40, 0x18, 0x10, 5, 0, 0, 0, 0], [0x80, 0x18, 0x10, 5, 0x11, 0, 0x09, 0x06]);
    drive.sdo([0x40, 0x00, 0x60, 0, 0, 0, 0, 0], [0x80, 0x00, 0x60, 0, 0, 0, 0x02, 0x06]);
    drive.sdo([0x23, 0x17, 0x10, 0, 1, 0, 0, 0], [0x80, 0x17, 0x10, 0, 0x12, 0, 0x07, 0x06]);
}

#[test]
fn the_module_answers_in_operational_only() {
    let mut drive = Script::new(Some(1));
    drive.receive(0x701, &[0]);
    let read = [0x01, 0x11, 0xA2, 0x13, 0, 0, 0, 0];
    drive.send(0x501, &read);
    drive.is_silent();
    drive.send(0x000, &[0x01, 1]);
    drive.send(0x501, &read);
    drive.receive(0x481, &[0x01, 0x00, 0xA2, 0x13, 10, 0, 0, 0]);
    drive.send(0x000, &[0x02, 1]);
    drive.send(0x501, &[0x02, 0x11, 0xA2, 0x13, 0, 0, 0, 0]);
    drive.is_silent();
}

#[test]
fn a_restart_is_silent_and_ends_with_boot_up() {
    let mut drive = Script::new(Some(1));
    drive.receive(0x701, &[0]);
    drive.sdo([0x2B, 0x17, 0x10, 0, 100, 0, 0, 0], [0x60, 0x17, 0x10, 0, 0, 0, 0, 0]);
    for (ms, count, by_sdo) in [(0, 5, true), (1000, 6, false)] {
        drive.at(ms);
        while drive.node.poll_transmit(drive.now).is_some() {}
        drive.send(0x000, &[0x01, 1]);
        drive.send(0x501, &[count, 0x00, 0, 0, 0, 0, 0, 0]);
        drive.receive(0x481, &[count, 0x00, 0, 0, 0, 0, 0, 0]);
        if by_sdo {
            drive.send(0x601, &[0x23, 0x00, 0x20, 0x0B, 0, 0, 0, 0]);
            drive.receive(0x581, &[0x60, 0x00, 0x20, 0x0B, 0, 0, 0, 0]);
        } else {
            drive.send(0x000, &[0x81, 1]);
        }
        drive.is_silent();
        drive.guard(0x701);
        drive.send(0x601, &[0x40, 0xA2, 0x33, 1, 0, 0, 0, 0]);
        drive.at(ms + 799);
        drive.is_silent();
        drive.at(ms + 800);
        drive.receive(0x701, &[0]);
        drive.is_silent();
        // Communication objects and the module's count are as after power-up.
        drive.sdo([0x40, 0x17, 0x10, 0, 0, 0, 0, 0], [0x4B, 0x17, 0x10, 0, 0, 0, 0, 0]);
        drive.send(0x000, &[0x01, 1]);
        drive.send(0x501, &[count, 0x11, 0xA2, 0x13, 0, 0, 0, 0]);
        drive.receive(0x481, &[count, 0x00, 0xA2, 0x13, 10, 0, 0, 0]);
    }
    // A reset of the communication leaves the drive as it is.
    drive.sdo([0x23, 0xA2, 0x33, 1, 99, 0, 0, 0], [0x60, 0xA2, 0x33, 1, 0, 0, 0, 0]);
    drive.send(0x000, &[0x82, 1]);
    drive.receive(0x701, &[0]);
    drive.sdo([0x40, 0xA2, 0x33, 1, 0, 0, 0, 0], [0x43, 0xA2, 0x33, 1, 99, 0, 0, 0]);
}
