//! LSS, layer setting services (CiA 305): node IDs and bit rates given over the bus to devices that
//! are told apart by their identity (1018h).
//!
//! [`Request`] and [`Response`] are the messages, [`Master`] and [`Slave`] the two roles.

mod master;
mod slave;

pub use master::{Config, Master, Operation, Outcome, SubmitError, Ticket};
pub use slave::{Action, Slave};

use core::fmt;

use pdo::{Frame, NodeId, cob};

/// The node ID byte of a device that has none.
pub const UNCONFIGURED: u8 = 0xFF;

/// What tells one device from all others: object 1018h, sub-indices 1…4.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Identity {
    /// 1018h:01, given by CiA.
    pub vendor: u32,
    /// 1018h:02.
    pub product: u32,
    /// 1018h:03.
    pub revision: u32,
    /// 1018h:04.
    pub serial: u32,
}

impl Identity {
    /// One of the four numbers.
    #[must_use]
    pub const fn part(&self, part: Part) -> u32 {
        match part {
            Part::Vendor => self.vendor,
            Part::Product => self.product,
            Part::Revision => self.revision,
            Part::Serial => self.serial,
        }
    }

    /// Sets one of the four numbers.
    pub const fn set_part(&mut self, part: Part, value: u32) {
        match part {
            Part::Vendor => self.vendor = value,
            Part::Product => self.product = value,
            Part::Revision => self.revision = value,
            Part::Serial => self.serial = value,
        }
    }
}

impl fmt::Display for Identity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { vendor, product, revision, serial } = self;
        write!(f, "vendor {vendor:08X}h product {product:08X}h revision {revision:08X}h serial {serial:08X}h")
    }
}

/// A number of the identity; the value is the sub-index in 1018h less 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Part {
    /// Vendor ID.
    Vendor = 0,
    /// Product code.
    Product = 1,
    /// Revision number.
    Revision = 2,
    /// Serial number.
    Serial = 3,
}

impl Part {
    /// All four in order.
    pub const ALL: [Self; 4] = [Self::Vendor, Self::Product, Self::Revision, Self::Serial];

    /// The part with this number, 0…3.
    #[must_use]
    pub const fn new(number: u8) -> Option<Self> {
        Some(match number {
            0 => Self::Vendor,
            1 => Self::Product,
            2 => Self::Revision,
            3 => Self::Serial,
            _ => return None,
        })
    }

    /// The one after it; after the last the first.
    #[must_use]
    pub const fn next(self) -> Self {
        match self {
            Self::Vendor => Self::Product,
            Self::Product => Self::Revision,
            Self::Revision => Self::Serial,
            Self::Serial => Self::Vendor,
        }
    }
}

/// State of an LSS slave.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Mode {
    /// Takes part in the bus, waits to be selected.
    Waiting = 0,
    /// Can be configured and inquired.
    Configuration = 1,
}

/// A bit rate by its number in the standard table (CiA 305, table 3).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct BitTiming(u8);

impl BitTiming {
    const KBITS: [u16; 9] = [1000, 800, 500, 250, 125, 0, 50, 20, 10];

    /// Automatic bit rate detection.
    pub const AUTOMATIC: Self = Self(9);

    /// From the number, 0…4 and 6…9.
    #[must_use]
    pub const fn from_index(index: u8) -> Option<Self> {
        match index {
            0..=4 | 6..=9 => Some(Self(index)),
            _ => None,
        }
    }

    /// From the bit rate in kbit/s: 1000, 800, 500, 250, 125, 50, 20 or 10.
    #[must_use]
    pub fn from_kbits(kbits: u16) -> Option<Self> {
        let index = Self::KBITS.iter().position(|known| *known == kbits && kbits != 0)?;
        Some(Self(index as u8))
    }

    /// Its number.
    #[must_use]
    pub const fn index(self) -> u8 {
        self.0
    }

    /// In kbit/s; `None` for automatic detection.
    #[must_use]
    pub fn kbits(self) -> Option<u16> {
        Self::KBITS.get(usize::from(self.0)).copied()
    }
}

/// What the master sends, on 7E5h.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Request {
    /// 04h: all slaves change their state.
    SwitchGlobal(Mode),
    /// 40h…43h: one of the four numbers of the slave that is to enter configuration.
    Select(Part, u32),
    /// 11h: node ID 1…127, or [`UNCONFIGURED`].
    ConfigureNodeId(u8),
    /// 13h: bit rate.
    ConfigureBitTiming {
        /// 0 = the standard table.
        table: u8,
        /// Number in the table.
        index: u8,
    },
    /// 15h: change to the configured bit rate after the delay, send again after another.
    ActivateBitTiming {
        /// ms.
        delay_ms: u16,
    },
    /// 17h: keep node ID and bit rate.
    Store,
    /// 5Ah…5Dh: say one of your numbers.
    Inquire(Part),
    /// 5Eh: say your node ID.
    InquireNodeId,
    /// 4Ch: who has no node ID?
    IdentifyUnconfigured,
    /// 51h: who has no node ID and this number in the bits from `bit` up?
    Fastscan {
        /// The number.
        number: u32,
        /// Lowest bit to compare, 0…31; [`FASTSCAN_CONFIRM`] = everybody without node ID.
        bit: u8,
        /// Which number is compared.
        part: Part,
        /// Which is compared next.
        next: Part,
    },
}

/// Bit number in [`Request::Fastscan`] that everybody without node ID answers.
pub const FASTSCAN_CONFIRM: u8 = 0x80;

impl Request {
    /// The message.
    #[must_use]
    pub const fn frame(self) -> Frame {
        Frame::standard(cob::LSS_REQUEST, self.encode())
    }

    /// The 8 bytes.
    #[must_use]
    pub const fn encode(self) -> [u8; 8] {
        const fn with(command: u8, value: u32) -> [u8; 8] {
            let [a, b, c, d] = value.to_le_bytes();
            [command, a, b, c, d, 0, 0, 0]
        }
        match self {
            Self::SwitchGlobal(mode) => with(0x04, mode as u32),
            Self::Select(part, value) => with(0x40 + part as u8, value),
            Self::ConfigureNodeId(node) => with(0x11, node as u32),
            Self::ConfigureBitTiming { table, index } => {
                with(0x13, u16::from_le_bytes([table, index]) as u32)
            }
            Self::ActivateBitTiming { delay_ms } => with(0x15, delay_ms as u32),
            Self::Store => with(0x17, 0),
            Self::Inquire(part) => with(0x5A + part as u8, 0),
            Self::InquireNodeId => with(0x5E, 0),
            Self::IdentifyUnconfigured => with(0x4C, 0),
            Self::Fastscan { number, bit, part, next } => {
                let [a, b, c, d] = number.to_le_bytes();
                [0x51, a, b, c, d, bit, part as u8, next as u8]
            }
        }
    }

    /// From the 8 bytes; `None` for a command specifier or a value that CiA 305 does not know.
    #[must_use]
    pub fn parse(bytes: [u8; 8]) -> Option<Self> {
        let [command, a, b, c, d, bit, part, next] = bytes;
        let value = u32::from_le_bytes([a, b, c, d]);
        Some(match command {
            0x04 if a == Mode::Waiting as u8 => Self::SwitchGlobal(Mode::Waiting),
            0x04 if a == Mode::Configuration as u8 => Self::SwitchGlobal(Mode::Configuration),
            0x40..=0x43 => Self::Select(Part::new(command - 0x40)?, value),
            0x11 => Self::ConfigureNodeId(a),
            0x13 => Self::ConfigureBitTiming { table: a, index: b },
            0x15 => Self::ActivateBitTiming { delay_ms: u16::from_le_bytes([a, b]) },
            0x17 => Self::Store,
            0x5A..=0x5D => Self::Inquire(Part::new(command - 0x5A)?),
            0x5E => Self::InquireNodeId,
            0x4C => Self::IdentifyUnconfigured,
            0x51 if bit < 32 || bit == FASTSCAN_CONFIRM => {
                Self::Fastscan { number: value, bit, part: Part::new(part)?, next: Part::new(next)? }
            }
            _ => return None,
        })
    }

    /// From a frame; `None` for any other.
    #[must_use]
    pub fn from_frame(frame: &Frame) -> Option<Self> {
        bytes_of(frame, cob::LSS_REQUEST).and_then(Self::parse)
    }
}

/// What a slave answers, on 7E4h.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Response {
    /// 44h: selected; the slave is in configuration.
    Selected,
    /// 11h, 13h or 17h: whether it was done.
    Done {
        /// The command specifier of the request.
        command: u8,
        /// How it went.
        result: Refusal,
    },
    /// 5Ah…5Dh.
    Identity(Part, u32),
    /// 5Eh: node ID, or [`UNCONFIGURED`].
    NodeId(u8),
    /// 4Fh: fastscan matches.
    Identified,
    /// 50h: there is a slave without node ID.
    Unconfigured,
}

impl Response {
    /// The message.
    #[must_use]
    pub const fn frame(self) -> Frame {
        Frame::standard(cob::LSS_RESPONSE, self.encode())
    }

    /// The 8 bytes.
    #[must_use]
    pub const fn encode(self) -> [u8; 8] {
        match self {
            Self::Selected => [0x44, 0, 0, 0, 0, 0, 0, 0],
            Self::Done { command, result } => [command, result.code, result.specific, 0, 0, 0, 0, 0],
            Self::Identity(part, value) => {
                let [a, b, c, d] = value.to_le_bytes();
                [0x5A + part as u8, a, b, c, d, 0, 0, 0]
            }
            Self::NodeId(node) => [0x5E, node, 0, 0, 0, 0, 0, 0],
            Self::Identified => [0x4F, 0, 0, 0, 0, 0, 0, 0],
            Self::Unconfigured => [0x50, 0, 0, 0, 0, 0, 0, 0],
        }
    }

    /// From the 8 bytes; `None` for a command specifier that CiA 305 does not know.
    #[must_use]
    pub fn parse(bytes: [u8; 8]) -> Option<Self> {
        let [command, a, b, c, d, ..] = bytes;
        Some(match command {
            0x44 => Self::Selected,
            0x11 | 0x13 | 0x17 => Self::Done { command, result: Refusal { code: a, specific: b } },
            0x5A..=0x5D => Self::Identity(Part::new(command - 0x5A)?, u32::from_le_bytes([a, b, c, d])),
            0x5E => Self::NodeId(a),
            0x4F => Self::Identified,
            0x50 => Self::Unconfigured,
            _ => return None,
        })
    }

    /// From a frame; `None` for any other.
    #[must_use]
    pub fn from_frame(frame: &Frame) -> Option<Self> {
        bytes_of(frame, cob::LSS_RESPONSE).and_then(Self::parse)
    }
}

fn bytes_of(frame: &Frame, id: u16) -> Option<[u8; 8]> {
    (frame.standard_id() == Some(id) && !frame.is_remote()).then_some(frame.data())?.try_into().ok()
}

/// How a slave took a configuration: a code, 0 = done, and a manufacturer's code where that is 255.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, thiserror::Error)]
#[error("{}", self.text())]
pub struct Refusal {
    /// 0 done; 1 out of range, not supported (store); 2 storage failed; 255 manufacturer specific.
    pub code: u8,
    /// The manufacturer's code.
    pub specific: u8,
}

impl Refusal {
    /// Done, no refusal.
    pub const NONE: Self = Self { code: 0, specific: 0 };
    /// Node ID or bit rate out of range; storing not supported.
    pub const NOT_SUPPORTED: Self = Self { code: 1, specific: 0 };
    /// The storage cannot be accessed.
    pub const STORAGE: Self = Self { code: 2, specific: 0 };

    const fn text(self) -> &'static str {
        match self.code {
            0 => "done",
            1 => "out of range or not supported (code 1)",
            2 => "storage access error (code 2)",
            255 => "manufacturer specific error (code 255)",
            _ => "error of a reserved code",
        }
    }
}

/// The node ID of a node ID byte; `None` for [`UNCONFIGURED`] and all that is none.
#[must_use]
pub const fn node_of(byte: u8) -> Option<NodeId> {
    match NodeId::new(byte) {
        Ok(node) => Some(node),
        Err(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// CiA 305: command specifiers.
    #[test]
    fn golden_messages() {
        for (request, bytes) in [
            (Request::SwitchGlobal(Mode::Configuration), [0x04, 1, 0, 0, 0, 0, 0, 0]),
            (Request::Select(Part::Vendor, 0x1234_5678), [0x40, 0x78, 0x56, 0x34, 0x12, 0, 0, 0]),
            (Request::Select(Part::Serial, 1), [0x43, 1, 0, 0, 0, 0, 0, 0]),
            (Request::ConfigureNodeId(5), [0x11, 5, 0, 0, 0, 0, 0, 0]),
            (Request::ConfigureBitTiming { table: 0, index: 2 }, [0x13, 0, 2, 0, 0, 0, 0, 0]),
            (Request::ActivateBitTiming { delay_ms: 1000 }, [0x15, 0xE8, 0x03, 0, 0, 0, 0, 0]),
            (Request::Store, [0x17, 0, 0, 0, 0, 0, 0, 0]),
            (Request::Inquire(Part::Revision), [0x5C, 0, 0, 0, 0, 0, 0, 0]),
            (Request::InquireNodeId, [0x5E, 0, 0, 0, 0, 0, 0, 0]),
            (
                Request::Fastscan { number: 0x8000_0000, bit: 30, part: Part::Product, next: Part::Product },
                [0x51, 0, 0, 0, 0x80, 30, 1, 1],
            ),
        ] {
            assert_eq!((request.encode(), Request::parse(bytes)), (bytes, Some(request)));
            assert_eq!(Request::from_frame(&request.frame()), Some(request));
        }
        assert_eq!(Request::parse([0x51, 0, 0, 0, 0, 32, 0, 0]), None);
        assert_eq!(Request::parse([0x51, 0, 0, 0, 0, 0, 4, 0]), None);
        assert_eq!(BitTiming::from_kbits(500), BitTiming::from_index(2));
        assert_eq!((BitTiming::from_index(5), BitTiming::from_kbits(0)), (None, None));
    }

    proptest! {
        #[test]
        fn what_parses_encodes_the_same(bytes: [u8; 8], command in prop::sample::select(
            &[0x04u8, 0x11, 0x13, 0x15, 0x17, 0x40, 0x43, 0x44, 0x4C, 0x4F, 0x50, 0x51, 0x5A, 0x5D, 0x5E][..]
        )) {
            let mut bytes = bytes;
            bytes[0] = command;
            if let Some(request) = Request::parse(bytes) {
                prop_assert_eq!(Request::parse(request.encode()), Some(request));
            }
            if let Some(response) = Response::parse(bytes) {
                prop_assert_eq!(Response::parse(response.encode()), Some(response));
            }
        }
    }
}
