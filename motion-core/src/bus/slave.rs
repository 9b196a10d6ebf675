//! The controller as a CANopen slave on CAN 1 (6.5.1, `[300]`): NMT, guarding, and the objects that a
//! master's scan reads.

use canopen_master::lss::Identity;
use canopen_master::sdo::{AbortCode, Access, Piece, Total, read_slice};
use canopen_master::slave;
use pdo::{Address, NodeId};

/// The engine.
pub(super) type Slave = slave::Slave<Dictionary>;

/// Vendor ID of Lenord, Bauer & Co. is not in manual A: none (project-defined).
const VENDOR: u32 = 0;

/// Objects of the communication area; process data are configured by parameters, not over SDO.
#[derive(Debug, Clone, Copy)]
pub(super) struct Dictionary {
    name: [u8; 8],
    model: u16,
}

impl Access for Dictionary {
    fn read(&mut self, at: Address, offset: u32, out: &mut [u8]) -> Result<(usize, Total), AbortCode> {
        let long = |value: u32| value.to_le_bytes();
        match (at.index, at.sub) {
            // 1000h: no standard profile.
            (0x1000, 0) | (0x1018, 1) => Ok(read_slice(&long(VENDOR), offset, out)),
            (0x1001, 0) => Ok(read_slice(&[0], offset, out)),
            (0x1008, 0) => Ok(read_slice(&self.name, offset, out)),
            (0x1018, 0) => Ok(read_slice(&[2], offset, out)),
            (0x1018, 2) => Ok(read_slice(&long(u32::from(self.model)), offset, out)),
            (0x1000 | 0x1001 | 0x1008 | 0x1018, _) => Err(AbortCode::NO_SUB_INDEX),
            _ => Err(AbortCode::NO_OBJECT),
        }
    }

    fn begin_write(&mut self, at: Address, _size: Option<u32>) -> Result<(), AbortCode> {
        self.read(at, 0, &mut [])?;
        Err(AbortCode::READ_ONLY)
    }

    fn write(&mut self, at: Address, _piece: &Piece<'_>) -> Result<(), AbortCode> {
        self.begin_write(at, None)
    }
}

/// Process data are the bus's, not the dictionary's.
impl slave::Objects for Dictionary {}

/// A slave of this model at an address.
pub(super) fn new(model: u16, node: Option<NodeId>) -> Slave {
    let mut name = *b"GEL 0000";
    let digits = [model / 1000, model / 100, model / 10, model].map(|digit| b'0' + (digit % 10) as u8);
    for (to, digit) in name.iter_mut().skip(4).zip(digits) {
        *to = digit;
    }
    let identity = Identity { vendor: VENDOR, product: u32::from(model), revision: 0, serial: 0 };
    Slave::new(&slave::Config::new(identity, node), Dictionary { name, model })
}
