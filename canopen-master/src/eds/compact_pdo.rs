//! PDOs that a device has and its description does not spell out (`CompactPDO`, CiA 306-1, 6.5).

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use super::model::{Device, Entry, Object};
use super::types::{Access, ObjectType, PdoMapping};
use crate::data_type::DataType;

/// Sub-objects of a PDO communication parameter: name and type; bit n of `CompactPDO` stands for
/// sub-index n + 1 (CiA 301, 7.5.2.35 and 7.5.2.37).
const COMMUNICATION: [(&str, DataType); 6] = [
    ("COB-ID", DataType::UNSIGNED32),
    ("Transmission type", DataType::UNSIGNED8),
    ("Inhibit time", DataType::UNSIGNED16),
    ("Reserved", DataType::UNSIGNED8),
    ("Event timer", DataType::UNSIGNED16),
    ("SYNC start value", DataType::UNSIGNED8),
];

/// Most objects of one PDO.
const MAPPED: u8 = 64;

impl Device {
    /// Communication and mapping parameters of the first `NrOfRXPDO` and `NrOfTXPDO` PDOs that
    /// `CompactPDO` says the device has, as far as they are not described; in ascending order.
    #[must_use]
    pub fn implied_pdos(&self) -> Vec<Object> {
        let mask: u8 = self.device_info.int("CompactPDO").unwrap_or(0);
        let mut objects = Vec::new();
        if mask == 0 {
            return objects;
        }
        for (key, communication, first_cob_id) in [("NrOfRXPDO", 0x1400, 0x200), ("NrOfTXPDO", 0x1800, 0x180)]
        {
            let count: u16 = self.device_info.int(key).unwrap_or(0).min(512);
            let kind = key.get(4..).unwrap_or_default();
            for number in 0..count {
                let cob_id = (number < 4).then(|| first_cob_id + 0x100 * u32::from(number));
                objects.push(communication_parameter(communication + number, kind, mask, cob_id));
                objects.push(mapping_parameter(communication + 0x200 + number, kind));
            }
        }
        objects.retain(|object| self.object(object.index).is_none());
        objects.sort_by_key(|object| object.index);
        objects
    }
}

fn record(index: u16, name: String) -> Object {
    let mut object = Object::new(index);
    object.own.name = name;
    object.own.object_type = ObjectType::RECORD;
    object
}

fn entry(subindex: u8, name: &str, data_type: DataType, access: Access, default: Option<String>) -> Entry {
    let mut entry = Entry::new(subindex);
    entry.name = name.into();
    entry.data_type = Some(data_type);
    entry.access = Some(access);
    entry.pdo_mapping = Some(PdoMapping::No);
    entry.default = default;
    entry
}

fn communication_parameter(index: u16, kind: &str, mask: u8, cob_id: Option<u32>) -> Object {
    let mut object = record(index, format!("{kind} communication parameter"));
    let mut highest = 0;
    for (subindex, (name, data_type)) in (1_u8..).zip(COMMUNICATION) {
        if mask & 1 << (subindex - 1) == 0 {
            continue;
        }
        highest = subindex;
        // Only the first four have a COB-ID of their own; the others are out of service.
        let cob_id = match cob_id {
            Some(cob_id) => format!("$NODEID+0x{cob_id:X}"),
            None => "0x80000000".into(),
        };
        let default = (subindex == 1).then_some(cob_id);
        object.insert(entry(subindex, name, data_type, Access::ReadWrite, default));
    }
    let default = Some(format!("{highest}"));
    object.insert(entry(0, "Highest sub-index supported", DataType::UNSIGNED8, Access::Const, default));
    object
}

fn mapping_parameter(index: u16, kind: &str) -> Object {
    let mut object = record(index, format!("{kind} mapping parameter"));
    let zero = || Some("0".into());
    object.insert(entry(0, "Number of mapped objects", DataType::UNSIGNED8, Access::ReadWrite, zero()));
    for subindex in 1..=MAPPED {
        let name = format!("Mapped object {subindex}");
        object.insert(entry(subindex, &name, DataType::UNSIGNED32, Access::ReadWrite, zero()));
    }
    object
}

#[cfg(test)]
mod tests {
    use super::super::read;
    use alloc::vec::Vec;

    #[test]
    fn what_is_described_is_not_implied() {
        let text = "[DeviceInfo]\nCompactPDO=0x13\nNrOfRXPDO=1\nNrOfTXPDO=5\n[1800]\nParameterName=T\nObjectType=9\n";
        let device = read(text.as_bytes()).unwrap().device;
        let implied = device.implied_pdos();
        let indices: Vec<_> = implied.iter().map(|object| object.index).collect();
        let expected =
            [0x1400, 0x1600, 0x1801, 0x1802, 0x1803, 0x1804, 0x1A00, 0x1A01, 0x1A02, 0x1A03, 0x1A04];
        assert_eq!(indices, expected);
        let rpdo = &implied[0];
        assert_eq!(rpdo.subs.iter().map(|entry| entry.subindex).collect::<Vec<_>>(), [0, 1, 2, 5]);
        assert_eq!(rpdo.entry(1).unwrap().default_bytes(Some(3)), Some(Ok([3, 2, 0, 0].to_vec())));
        assert_eq!(implied[5].entry(1).unwrap().default.as_deref(), Some("0x80000000"));
        assert_eq!(implied[1].subs.len(), 65);
    }
}
