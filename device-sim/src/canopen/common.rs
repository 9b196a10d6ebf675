//! Objects that every node has (CiA 301, 7.5.2).

use canopen_master::data_type::DataType;
use canopen_master::lss::Identity;

use super::objects::{Entry, Objects, Rights};
use super::{LONG_STORE, STORE};

/// PDOs of each direction that a node has.
pub(super) const PDOS: u16 = 4;
/// Objects that one PDO maps at most: 64 bits.
pub(super) const MAPPED: u8 = 64;

pub(super) fn unsigned8(rights: Rights, value: i128) -> Entry {
    Entry::number(DataType::UNSIGNED8, rights, value)
}

pub(super) fn unsigned16(rights: Rights, value: i128) -> Entry {
    Entry::number(DataType::UNSIGNED16, rights, value)
}

pub(super) fn unsigned32(rights: Rights, value: i128) -> Entry {
    Entry::number(DataType::UNSIGNED32, rights, value)
}

/// Communication objects with the values after power-up. COB-IDs that depend on the node ID are set by
/// the node.
pub(super) fn objects(device_type: u32, name: &str, identity: Identity) -> Objects {
    let mut objects = Objects::default();
    objects.insert(0x1000, 0, unsigned32(Rights::RO, i128::from(device_type)));
    objects.insert(0x1001, 0, unsigned8(Rights::TRANSMIT, 0));
    objects.insert(0x1003, 0, unsigned8(Rights::RW, 0));
    for sub in 1..=8 {
        objects.insert(0x1003, sub, unsigned32(Rights::RO, 0));
    }
    objects.insert(0x1005, 0, unsigned32(Rights::RW, 0x80));
    objects.insert(0x1006, 0, unsigned32(Rights::RW, 0));
    objects.insert(0x1008, 0, Entry::text(name));
    objects.insert(0x1009, 0, Entry::text("virtual hardware 1"));
    objects.insert(0x100A, 0, Entry::text(concat!("device-sim ", env!("CARGO_PKG_VERSION"))));
    objects.insert(0x100C, 0, unsigned16(Rights::RW, 0));
    objects.insert(0x100D, 0, unsigned8(Rights::RW, 0));
    objects.insert_all(0x1010, [unsigned32(Rights::RW, 1)]);
    objects.insert_all(0x1011, [unsigned32(Rights::RW, 1)]);
    objects.insert(0x1014, 0, unsigned32(Rights::RO, 0));
    objects.insert(0x1015, 0, unsigned16(Rights::RW, 0));
    objects.insert_all(0x1016, (0..4).map(|_| unsigned32(Rights::RW, 0)));
    objects.insert(0x1017, 0, unsigned16(Rights::RW, 0));
    let numbers = [identity.vendor, identity.product, identity.revision, identity.serial];
    objects.insert_all(0x1018, numbers.map(|number| unsigned32(Rights::RO, i128::from(number))));
    objects.insert(0x1019, 0, unsigned8(Rights::RW, 0));
    // Configuration date and time (CiA 302-2 compares them at boot).
    objects.insert_all(0x1020, [unsigned32(Rights::RW, 0), unsigned32(Rights::RW, 0)]);
    objects.insert_all(0x2000, [Entry::domain(STORE), Entry::domain(LONG_STORE)]);
    for number in 0..PDOS {
        for (communication, mapping) in [(0x1400, 0x1600), (0x1800, 0x1A00)] {
            let transmit = communication == 0x1800;
            objects.insert(communication + number, 0, unsigned8(Rights::RO, if transmit { 6 } else { 5 }));
            objects.insert(communication + number, 1, unsigned32(Rights::RW, 0x8000_0000));
            objects.insert(communication + number, 2, unsigned8(Rights::RW, 255));
            objects.insert(communication + number, 3, unsigned16(Rights::RW, 0));
            objects.insert(communication + number, 5, unsigned16(Rights::RW, 0));
            if transmit {
                objects.insert(communication + number, 6, unsigned8(Rights::RW, 0).within(0, 240));
            }
            objects.insert(mapping + number, 0, unsigned8(Rights::RW, 0));
            for sub in 1..=MAPPED {
                objects.insert(mapping + number, sub, unsigned32(Rights::RW, 0));
            }
        }
    }
    objects
}

/// Sets the mapping of PDO `number` (from 0) with mapping objects at `base` (1600h, 1A00h) to
/// `entries`: index, sub-index, bits.
pub(super) fn map(objects: &mut Objects, base: u16, number: u16, entries: &[(u16, u8, u8)]) {
    let index = base + number;
    for sub in 1..=MAPPED {
        objects.set(index, sub, 0);
    }
    for (&(object, sub, bits), place) in entries.iter().zip(1..) {
        let value = u32::from(object) << 16 | u32::from(sub) << 8 | u32::from(bits);
        objects.set(index, place, i128::from(value));
    }
    objects.set(index, 0, entries.len() as i128);
}
