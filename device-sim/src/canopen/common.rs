//! Objects that every node has (CiA 301, 7.5.2).

use canopen_master::data_type::DataType;
use canopen_master::lss::Identity;
use canopen_master::od::{Communication, PdoSlot};
use pdo::mapping::Entry as Mapped;
use pdo::{CobId, Mapping};

use super::objects::{Entry, Objects};
use super::{LONG_STORE, Rights, STORE};

/// PDOs of each direction that a node has.
pub(super) const PDOS: usize = 4;
/// One PDO.
pub(super) type Slot = PdoSlot<MAPPED>;
/// Objects that one PDO maps at most: 64 bits.
pub(super) const MAPPED: usize = 64;

pub(super) fn unsigned8(rights: Rights, value: i128) -> Entry {
    Entry::number(DataType::UNSIGNED8, rights, value)
}

pub(super) fn unsigned16(rights: Rights, value: i128) -> Entry {
    Entry::number(DataType::UNSIGNED16, rights, value)
}

pub(super) fn unsigned32(rights: Rights, value: i128) -> Entry {
    Entry::number(DataType::UNSIGNED32, rights, value)
}

/// Communication objects with the values after power-up, but for those that the slave's engine has itself.
/// COB-IDs that depend on the node ID are set by the node.
pub(super) fn objects(device_type: u32, name: &str, identity: Identity) -> Objects {
    let mut objects = Objects::default();
    objects.insert(0x1000, 0, unsigned32(Rights::Ro, i128::from(device_type)));
    objects.insert(0x1005, 0, unsigned32(Rights::Rw, 0x80));
    objects.insert(0x1006, 0, unsigned32(Rights::Rw, 0));
    objects.insert(0x1008, 0, Entry::text(name));
    objects.insert(0x1009, 0, Entry::text("virtual hardware 1"));
    objects.insert(0x100A, 0, Entry::text(concat!("device-sim ", env!("CARGO_PKG_VERSION"))));
    objects.insert(0x100C, 0, unsigned16(Rights::Rw, 0));
    objects.insert(0x100D, 0, unsigned8(Rights::Rw, 0));
    objects.insert_all(0x1010, [unsigned32(Rights::Rw, 1)]);
    objects.insert_all(0x1011, [unsigned32(Rights::Rw, 1)]);
    objects.insert(0x1014, 0, unsigned32(Rights::Ro, 0));
    objects.insert(0x1015, 0, unsigned16(Rights::Rw, 0));
    objects.insert_all(0x1016, (0..4).map(|_| unsigned32(Rights::Rw, 0)));
    objects.insert(0x1017, 0, unsigned16(Rights::Rw, 0));
    let numbers = [identity.vendor, identity.product, identity.revision, identity.serial];
    objects.insert_all(0x1018, numbers.map(|number| unsigned32(Rights::Ro, i128::from(number))));
    objects.insert(0x1019, 0, unsigned8(Rights::Rw, 0));
    // Configuration date and time (CiA 302-2 compares them at boot).
    objects.insert_all(0x1020, [unsigned32(Rights::Rw, 0), unsigned32(Rights::Rw, 0)]);
    objects.insert_all(0x2000, [Entry::domain(STORE), Entry::domain(LONG_STORE)]);
    objects
}

/// A PDO with its identifier of the predefined connection set, which is on and acts at once.
pub(super) fn slot(mapped: &[Mapped]) -> Slot {
    // What the nodes themselves map fits.
    PdoSlot::new(Communication::event_driven(CobId(0)), Mapping::new(mapped).unwrap_or_default())
}

/// A PDO that is off and maps nothing.
pub(super) const OFF: Slot = PdoSlot::new(Communication::event_driven(CobId(CobId::INVALID)), Mapping::EMPTY);
