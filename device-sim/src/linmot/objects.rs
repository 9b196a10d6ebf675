//! What the drive's SDO server reads and writes, and its PDOs: communication objects, the
//! configuration service, the configuration module.

use core::time::Duration;
use std::collections::BTreeMap;

use canopen_master::lss::Identity;
use canopen_master::sdo::{AbortCode, Access, Piece, Total, read_slice};
use canopen_master::slave::Objects;
use linmot::drive::Module;
use linmot::module::{RPDO, TPDO};
use linmot::sdo::{self, Answer, Server};
use pdo::{Address, Frame, Handled, NodeId, Payload};

use super::VirtualDrive;

/// Communication objects that can be written: index, sub-index, bytes, value after power-up.
const WRITABLE: [(u16, u8, u8, u32); 11] = [
    (0x1005, 0, 4, 0x80),
    (0x100C, 0, 2, 0),
    (0x100D, 0, 1, 0),
    (0x1015, 0, 2, 0),
    (0x1016, 1, 4, 0),
    (0x1016, 2, 4, 0),
    (0x1016, 3, 4, 0),
    (0x1016, 4, 4, 0),
    (0x1017, 0, 2, 0),
    (0x1019, 0, 1, 0),
    (0x1029, 1, 1, 0),
];

/// The objects of a virtual drive.
#[derive(Debug)]
pub(super) struct DriveObjects {
    drive: VirtualDrive,
    server: Server,
    module: Module,
    identity: Identity,
    /// 0: none.
    node: u8,
    now: Duration,
    communication: BTreeMap<Address, (u8, u32)>,
    /// Of the last access that wrote: bytes 4…7 of its answer.
    result: Option<[u8; 4]>,
}

impl DriveObjects {
    pub(super) fn new(drive: VirtualDrive, identity: Identity) -> Self {
        Self {
            drive,
            server: Server::new(),
            module: Module::new(),
            identity,
            node: 0,
            now: Duration::ZERO,
            communication: BTreeMap::new(),
            result: None,
        }
    }

    pub(super) const fn drive(&self) -> &VirtualDrive {
        &self.drive
    }

    pub(super) const fn drive_mut(&mut self) -> &mut VirtualDrive {
        &mut self.drive
    }

    pub(super) const fn set_time(&mut self, now: Duration) {
        self.now = now;
    }

    /// Communication objects take their power-on values; those that depend on the address follow it.
    pub(super) fn reset_communication(&mut self, node: Option<NodeId>) {
        self.node = node.map_or(0, NodeId::raw);
        let entry = |(index, sub, bytes, value)| (Address::new(index, sub), (bytes, value));
        self.communication = WRITABLE.into_iter().map(entry).collect();
    }

    /// The drive has restarted: nothing is under way, and the module's count is 0.
    pub(super) fn restarted(&mut self) {
        (self.server, self.module, self.result) = (Server::new(), Module::new(), None);
    }

    /// What the answer to the last access that wrote shall say, once.
    pub(super) const fn take_result(&mut self) -> Option<[u8; 4]> {
        self.result.take()
    }

    /// A communication object of up to 4 bytes, or a text.
    fn object(&self, at: Address) -> Result<Vec<u8>, AbortCode> {
        let long = |value: u32| value.to_le_bytes().to_vec();
        let Identity { vendor, product, revision, serial } = self.identity;
        Ok(match (at.index, at.sub) {
            (0x1000, 0) => long(0),
            (0x1008, 0) => b"Virtual LinMot drive".to_vec(),
            (0x1009, 0) => b"virtual hardware 1".to_vec(),
            (0x100A, 0) => concat!("device-sim ", env!("CARGO_PKG_VERSION")).as_bytes().to_vec(),
            (0x1014, 0) => long(u32::from(pdo::cob::EMCY) + u32::from(self.node)),
            (0x1016 | 0x1018, 0) => vec![4],
            (0x1018, 1) => long(vendor),
            (0x1018, 2) => long(product),
            (0x1018, 3) => long(revision),
            (0x1018, 4) => long(serial),
            (0x1029, 0) => vec![1],
            _ => match self.communication.get(&at) {
                Some((bytes, value)) => value.to_le_bytes().into_iter().take((*bytes).into()).collect(),
                None if at.sub != 0 && self.object(Address::new(at.index, 0)).is_ok() => {
                    return Err(AbortCode::NO_SUB_INDEX);
                }
                None => return Err(AbortCode::NO_OBJECT),
            },
        })
    }

    fn set_object(&mut self, at: Address, piece: &Piece<'_>) -> Result<(), AbortCode> {
        let Some((bytes, value)) = self.communication.get_mut(&at) else {
            return self.object(at).and(Err(AbortCode::READ_ONLY));
        };
        *value = little_endian(piece.exactly((*bytes).into())?);
        Ok(())
    }

    fn execute(&mut self, at: Address, write: Option<[u8; 4]>) -> Result<[u8; 4], AbortCode> {
        let access = sdo::Access { index: at.index, sub: at.sub, write };
        match self.server.execute(self.now, &access, &mut self.drive) {
            Some(Answer::Read(data) | Answer::Written(data)) => Ok(data),
            Some(Answer::Abort(code)) => Err(AbortCode(code)),
            // While it restarts it is asked nothing.
            None => Err(AbortCode::DEVICE_STATE),
        }
    }
}

fn little_endian(data: &[u8]) -> u32 {
    Payload::from_slice(data).word() as u32
}

impl Access for DriveObjects {
    fn read(&mut self, at: Address, offset: u32, out: &mut [u8]) -> Result<(usize, Total), AbortCode> {
        if Server::serves(at.index) {
            // What is read may go on with every reading: it is short, and asked for once.
            return self.execute(at, None).map(|data| read_slice(&data, offset, out));
        }
        self.object(at).map(|object| read_slice(&object, offset, out))
    }

    fn begin_write(&mut self, at: Address, size: Option<u32>) -> Result<(), AbortCode> {
        match size {
            Some(5..) => Err(AbortCode::TOO_LONG),
            _ if Server::serves(at.index) => Ok(()),
            _ => self.object(at).map(|_| ()),
        }
    }

    fn write(&mut self, at: Address, piece: &Piece<'_>) -> Result<(), AbortCode> {
        self.result = None;
        if !piece.is_whole() || piece.data.len() > 4 {
            return Err(AbortCode::TOO_LONG);
        }
        if Server::serves(at.index) {
            self.result = Some(self.execute(at, Some(little_endian(piece.data).to_le_bytes()))?);
            return Ok(());
        }
        self.set_object(at, piece)
    }
}

impl Objects for DriveObjects {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) -> Handled {
        let own = frame.standard_id() == Some(RPDO + u16::from(self.node)) && !frame.is_remote();
        let (true, Ok(image)) = (own, <[u8; 8]>::try_from(frame.data())) else { return Handled::Ignored };
        self.module.handle_output(now, image, &mut self.drive);
        Handled::Taken
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.module.handle_timeout(now, &mut self.drive);
    }

    fn poll_transmit(&mut self, _now: Duration) -> Option<Frame> {
        self.module.poll_transmit().map(|image| Frame::standard(TPDO + u16::from(self.node), image))
    }
}
