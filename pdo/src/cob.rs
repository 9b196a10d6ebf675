//! COB-IDs: which service an 11-bit identifier belongs to (CiA 301, 7.3.5, the predefined connection
//! set), and the 32-bit COB-ID entries of the object dictionary.

use core::fmt;

use crate::{Frame, NodeId};

/// NMT commands of the master.
pub const NMT: u16 = 0x000;
/// SYNC.
pub const SYNC: u16 = 0x080;
/// EMCY is this + node ID.
pub const EMCY: u16 = 0x080;
/// TIME.
pub const TIME: u16 = 0x100;
/// Answers of the default SDO server are this + node ID.
pub const SDO_RESPONSE: u16 = 0x580;
/// Requests to the default SDO server are this + node ID.
pub const SDO_REQUEST: u16 = 0x600;
/// Boot-up, heartbeat and node guarding are this + node ID.
pub const ERROR_CONTROL: u16 = 0x700;
/// Answers of LSS slaves (CiA 305).
pub const LSS_RESPONSE: u16 = 0x7E4;
/// Requests of the LSS master (CiA 305).
pub const LSS_REQUEST: u16 = 0x7E5;

/// One of the four PDOs that the predefined connection set gives an identifier to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DefaultPdo {
    /// PDO 1.
    First = 1,
    /// PDO 2.
    Second = 2,
    /// PDO 3.
    Third = 3,
    /// PDO 4.
    Fourth = 4,
}

impl DefaultPdo {
    /// All four in order.
    pub const ALL: [Self; 4] = [Self::First, Self::Second, Self::Third, Self::Fourth];

    /// The PDO with this number, 1…4.
    #[must_use]
    pub const fn new(number: u8) -> Option<Self> {
        match number {
            1 => Some(Self::First),
            2 => Some(Self::Second),
            3 => Some(Self::Third),
            4 => Some(Self::Fourth),
            _ => None,
        }
    }

    /// Its number, 1…4.
    #[must_use]
    pub const fn number(self) -> u8 {
        self as u8
    }
}

/// What the predefined connection set says an 11-bit identifier is for.
///
/// TPDO and RPDO are named from the device's view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Service {
    /// 000h: NMT command of the master.
    Nmt,
    /// 001h: global fail-safe command (CiA 304).
    GlobalFailSafe,
    /// 071h…076h: flying master and NMT master negotiation (CiA 302-2).
    FlyingMaster,
    /// 080h.
    Sync,
    /// 081h…0FFh.
    Emcy(NodeId),
    /// 100h.
    Time,
    /// 181h…1FFh, 281h…2FFh, 381h…3FFh, 481h…4FFh.
    Tpdo(DefaultPdo, NodeId),
    /// 201h…27Fh, 301h…37Fh, 401h…47Fh, 501h…57Fh.
    Rpdo(DefaultPdo, NodeId),
    /// 581h…5FFh: from the server of this node.
    SdoResponse(NodeId),
    /// 601h…67Fh: to the server of this node.
    SdoRequest(NodeId),
    /// 6E0h: dynamic SDO connection request (CiA 302-5).
    DynamicSdo,
    /// 701h…77Fh: boot-up, heartbeat, node guarding.
    ErrorControl(NodeId),
    /// 7E4h (CiA 305).
    LssResponse,
    /// 7E5h (CiA 305).
    LssRequest,
    /// Any other identifier: free for further PDOs and SDOs unless [`is_restricted`].
    Other(u16),
}

impl Service {
    /// What an identifier is for; bits above the 11th are cut off.
    #[must_use]
    pub const fn of(id: u16) -> Self {
        let id = id & 0x7FF;
        match id {
            NMT => return Self::Nmt,
            0x001 => return Self::GlobalFailSafe,
            0x071..=0x076 => return Self::FlyingMaster,
            SYNC => return Self::Sync,
            TIME => return Self::Time,
            0x6E0 => return Self::DynamicSdo,
            LSS_RESPONSE => return Self::LssResponse,
            LSS_REQUEST => return Self::LssRequest,
            _ => {}
        }
        let Ok(node) = NodeId::new((id & 0x7F) as u8) else { return Self::Other(id) };
        match id & !0x7F {
            EMCY => Self::Emcy(node),
            0x180 => Self::Tpdo(DefaultPdo::First, node),
            0x200 => Self::Rpdo(DefaultPdo::First, node),
            0x280 => Self::Tpdo(DefaultPdo::Second, node),
            0x300 => Self::Rpdo(DefaultPdo::Second, node),
            0x380 => Self::Tpdo(DefaultPdo::Third, node),
            0x400 => Self::Rpdo(DefaultPdo::Third, node),
            0x480 => Self::Tpdo(DefaultPdo::Fourth, node),
            0x500 => Self::Rpdo(DefaultPdo::Fourth, node),
            SDO_RESPONSE => Self::SdoResponse(node),
            SDO_REQUEST => Self::SdoRequest(node),
            ERROR_CONTROL => Self::ErrorControl(node),
            _ => Self::Other(id),
        }
    }

    /// What a frame is for; `None` of a frame with a 29-bit identifier.
    #[must_use]
    pub const fn of_frame(frame: &Frame) -> Option<Self> {
        match frame.standard_id() {
            Some(id) => Some(Self::of(id)),
            None => None,
        }
    }

    /// Its identifier; of [`FlyingMaster`](Self::FlyingMaster) the first one.
    #[must_use]
    pub const fn id(self) -> u16 {
        match self {
            Self::Nmt => NMT,
            Self::GlobalFailSafe => 0x001,
            Self::FlyingMaster => 0x071,
            Self::Sync => SYNC,
            Self::Emcy(node) => EMCY + node.raw() as u16,
            Self::Time => TIME,
            Self::Tpdo(pdo, node) => 0x080 + 0x100 * pdo.number() as u16 + node.raw() as u16,
            Self::Rpdo(pdo, node) => 0x100 + 0x100 * pdo.number() as u16 + node.raw() as u16,
            Self::SdoResponse(node) => SDO_RESPONSE + node.raw() as u16,
            Self::SdoRequest(node) => SDO_REQUEST + node.raw() as u16,
            Self::DynamicSdo => 0x6E0,
            Self::ErrorControl(node) => ERROR_CONTROL + node.raw() as u16,
            Self::LssResponse => LSS_RESPONSE,
            Self::LssRequest => LSS_REQUEST,
            Self::Other(id) => id,
        }
    }

    /// The node whose service it is; `None` of a broadcast.
    #[must_use]
    pub const fn node(self) -> Option<NodeId> {
        match self {
            Self::Emcy(node)
            | Self::Tpdo(_, node)
            | Self::Rpdo(_, node)
            | Self::SdoResponse(node)
            | Self::SdoRequest(node)
            | Self::ErrorControl(node) => Some(node),
            _ => None,
        }
    }
}

impl fmt::Display for Service {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Nmt => f.write_str("NMT"),
            Self::GlobalFailSafe => f.write_str("GFC"),
            Self::FlyingMaster => f.write_str("flying master"),
            Self::Sync => f.write_str("SYNC"),
            Self::Emcy(node) => write!(f, "EMCY of node {node}"),
            Self::Time => f.write_str("TIME"),
            Self::Tpdo(pdo, node) => write!(f, "TPDO {} of node {node}", pdo.number()),
            Self::Rpdo(pdo, node) => write!(f, "RPDO {} of node {node}", pdo.number()),
            Self::SdoResponse(node) => write!(f, "SDO from node {node}"),
            Self::SdoRequest(node) => write!(f, "SDO to node {node}"),
            Self::DynamicSdo => f.write_str("dynamic SDO"),
            Self::ErrorControl(node) => write!(f, "error control of node {node}"),
            Self::LssResponse => f.write_str("LSS from a slave"),
            Self::LssRequest => f.write_str("LSS from the master"),
            Self::Other(id) => write!(f, "{id:03X}h"),
        }
    }
}

/// Whether CiA 301 (7.3.5, "restricted CAN-IDs") forbids an identifier to any object whose COB-ID can
/// be set: NMT, the default SDO, error control and reserved ranges.
#[must_use]
pub const fn is_restricted(id: u16) -> bool {
    matches!(id, 0x000..=0x07F | 0x101..=0x180 | 0x581..=0x5FF | 0x601..=0x67F | 0x6E0..=0x6FF | 0x701..)
}

/// A COB-ID entry of the object dictionary, UNSIGNED32 (1005h, 1014h, 1200h, 1400h, 1800h, …).
///
/// Bits 0…28 are the identifier, bit 29 says that it has 29 bits, bits 30 and 31 depend on the
/// object; those of a PDO are named here (CiA 301, 7.5.2.35 and 7.5.2.37).
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct CobId(pub u32);

impl CobId {
    /// Bit 31 of a PDO, SDO or EMCY: the object does not exist.
    pub const INVALID: u32 = 1 << 31;
    /// Bit 30 of a TPDO: remote frames are not answered.
    pub const NO_RTR: u32 = 1 << 30;
    /// Bit 29: the identifier has 29 bits.
    pub const EXTENDED: u32 = 1 << 29;

    /// A valid entry with an 11-bit identifier; bits above the 11th are cut off.
    #[must_use]
    pub const fn standard(id: u16) -> Self {
        Self((id & 0x7FF) as u32)
    }

    /// Whether the object exists (bit 31 is 0).
    #[must_use]
    pub const fn is_valid(self) -> bool {
        self.0 & Self::INVALID == 0
    }

    /// The same with bit 31 set or cleared.
    #[must_use]
    pub const fn with_valid(self, valid: bool) -> Self {
        if valid { Self(self.0 & !Self::INVALID) } else { Self(self.0 | Self::INVALID) }
    }

    /// Whether a TPDO may be asked for by a remote frame (bit 30 is 0).
    #[must_use]
    pub const fn allows_rtr(self) -> bool {
        self.0 & Self::NO_RTR == 0
    }

    /// The 11-bit identifier; `None` where bit 29 or an identifier bit above the 11th is set.
    #[must_use]
    pub const fn standard_id(self) -> Option<u16> {
        let id = self.0 & 0x3FFF_FFFF;
        if id <= 0x7FF { Some(id as u16) } else { None }
    }

    /// The identifier without the flags, 11 or 29 bits.
    #[must_use]
    pub const fn id(self) -> u32 {
        self.0 & 0x1FFF_FFFF
    }
}

impl fmt::Display for CobId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:08X}h", self.0)
    }
}

impl fmt::Debug for CobId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "CobId({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(id: u8) -> NodeId {
        NodeId::new(id).unwrap()
    }

    /// CiA 301, table of the predefined connection set.
    #[test]
    fn predefined_connection_set() {
        use DefaultPdo::*;
        for (id, service) in [
            (0x000, Service::Nmt),
            (0x080, Service::Sync),
            (0x081, Service::Emcy(node(1))),
            (0x0FF, Service::Emcy(node(127))),
            (0x100, Service::Time),
            (0x181, Service::Tpdo(First, node(1))),
            (0x1FF, Service::Tpdo(First, node(127))),
            (0x201, Service::Rpdo(First, node(1))),
            (0x27F, Service::Rpdo(First, node(127))),
            (0x281, Service::Tpdo(Second, node(1))),
            (0x301, Service::Rpdo(Second, node(1))),
            (0x381, Service::Tpdo(Third, node(1))),
            (0x401, Service::Rpdo(Third, node(1))),
            (0x481, Service::Tpdo(Fourth, node(1))),
            (0x501, Service::Rpdo(Fourth, node(1))),
            (0x57F, Service::Rpdo(Fourth, node(127))),
            (0x581, Service::SdoResponse(node(1))),
            (0x601, Service::SdoRequest(node(1))),
            (0x701, Service::ErrorControl(node(1))),
            (0x77F, Service::ErrorControl(node(127))),
            (0x7E4, Service::LssResponse),
            (0x7E5, Service::LssRequest),
            (0x101, Service::Other(0x101)),
            (0x180, Service::Other(0x180)),
            (0x580, Service::Other(0x580)),
            (0x680, Service::Other(0x680)),
        ] {
            assert_eq!(Service::of(id), service);
        }
    }

    #[test]
    fn every_identifier_comes_back() {
        for id in 0..0x800 {
            let service = Service::of(id);
            match service {
                Service::FlyingMaster => assert!((0x071..=0x076).contains(&id)),
                _ => assert_eq!(service.id(), id, "{service}"),
            }
            // What the set fixes and nobody may configure; SYNC, EMCY, TIME and PDOs may be moved.
            let fixed = matches!(
                service,
                Service::Nmt
                    | Service::SdoRequest(_)
                    | Service::SdoResponse(_)
                    | Service::ErrorControl(_)
                    | Service::LssRequest
                    | Service::LssResponse
            );
            assert!(!fixed || is_restricted(id), "{service}");
        }
        assert!(!is_restricted(0x080) && !is_restricted(0x181) && !is_restricted(0x57F));
        assert!(is_restricted(0x180) && is_restricted(0x6E0) && is_restricted(0x7FF));
    }

    #[test]
    fn cob_id_entries() {
        let entry = CobId(0x4000_0181);
        assert_eq!((entry.is_valid(), entry.allows_rtr(), entry.standard_id()), (true, false, Some(0x181)));
        assert_eq!(entry.with_valid(false), CobId(0xC000_0181));
        assert_eq!(entry.with_valid(false).standard_id(), Some(0x181));
        assert_eq!(CobId(0x2000_0181).standard_id(), None);
        assert_eq!(CobId(0x0000_0800).standard_id(), None);
        assert_eq!(CobId(0x3FFF_FFFF).id(), 0x1FFF_FFFF);
    }
}
