//! The device file of a virtual node, made of its objects.

use canopen_master::data_type::DataType;
use canopen_master::eds::{
    Access, Device, Entry, Fields, Object, ObjectType, PdoMapping, standard_name, standard_object,
};

use canopen_master::slave::EMERGENCIES;
use pdo::Address;

use super::common::{MAPPED, PDOS, unsigned8, unsigned32};
use super::objects::{self, Objects};
use super::{Device as Behaviour, Node, Rights};

/// What a master needs to know of the node. To be asked of a node before it starts: then its values are
/// those of a device that was never configured.
#[must_use]
pub fn device_file<D: Behaviour>(node: &Node<D>, name: &str) -> Device {
    let all = everything(node);
    let pdos = |from: u16| {
        all.iter().filter(|(at, _)| at.sub == 0 && (from..from + 512).contains(&at.index)).count().to_string()
    };
    let own = |key: &str, value: &str| (key.to_owned(), value.to_owned());
    let mut device = Device {
        file_info: Fields::from_iter([
            own("FileName", &format!("{name}.eds")),
            own("FileVersion", "1"),
            own("FileRevision", "0"),
            own("EDSVersion", "4.0"),
            own("Description", "Objects of a virtual node"),
            // When the description was made, not the file: the same node gives the same file.
            own("CreationTime", "12:00AM"),
            own("CreationDate", "01-01-2026"),
            own("CreatedBy", "device-sim"),
            own("ModificationTime", "12:00AM"),
            own("ModificationDate", "01-01-2026"),
            own("ModifiedBy", "device-sim"),
        ]),
        device_info: Fields::from_iter([
            ("VendorName".to_owned(), "device-sim".to_owned()),
            ("VendorNumber".to_owned(), format!("{:#X}", all.get(0x1018, 1))),
            ("ProductName".to_owned(), name.to_owned()),
            ("ProductNumber".to_owned(), format!("{:#X}", all.get(0x1018, 2))),
            ("RevisionNumber".to_owned(), format!("{:#X}", all.get(0x1018, 3))),
            own("OrderCode", ""),
            own("BaudRate_10", "1"),
            own("BaudRate_20", "1"),
            own("BaudRate_50", "1"),
            own("BaudRate_125", "1"),
            own("BaudRate_250", "1"),
            own("BaudRate_500", "1"),
            own("BaudRate_800", "1"),
            own("BaudRate_1000", "1"),
            own("SimpleBootUpMaster", "0"),
            own("SimpleBootUpSlave", "1"),
            own("Granularity", "8"),
            own("DynamicChannelsSupported", "0"),
            own("GroupMessaging", "0"),
            own("NrOfRXPDO", &pdos(0x1400)),
            own("NrOfTXPDO", &pdos(0x1800)),
            own("LSS_Supported", "1"),
        ]),
        ..Device::default()
    };
    for (at, entry) in all.iter() {
        let described = describe(at.index, at.sub, entry);
        match device.objects.last_mut().filter(|object| object.index == at.index) {
            Some(object) => {
                if object.subs.is_empty() {
                    let mut first = core::mem::replace(&mut object.own, Entry::new(0));
                    object.own.name = parameter_name(at.index, None);
                    object.own.object_type = composed(at.index);
                    first.name = parameter_name(at.index, Some(0));
                    first.object_type = ObjectType::VAR;
                    object.insert(first);
                }
                object.insert(described);
            }
            None => {
                let mut object = Object::new(at.index);
                object.own = described;
                object.own.name = parameter_name(at.index, None);
                device.objects.push(object);
            }
        }
    }
    device
}

/// The node's objects, the engine's own among them.
fn everything<D: Behaviour>(node: &Node<D>) -> Objects {
    let mut all = node.objects().clone();
    all.insert(0x1001, 0, unsigned8(Rights::Ro, 0).mappable());
    all.insert(0x1003, 0, unsigned8(Rights::Rw, 0));
    for sub in 1..=EMERGENCIES as u8 {
        all.insert(0x1003, sub, unsigned32(Rights::Ro, 0));
    }
    for index in [0x1400, 0x1600, 0x1800, 0x1A00].into_iter().flat_map(|base| base..base + PDOS as u16) {
        for sub in 0..=MAPPED as u8 {
            let at = Address::new(index, sub);
            let Ok(value) = node.pdos().parameter(at) else { continue };
            let count = sub == 0 && index & 0x200 == 0;
            if node.device().describes_pdos() {
                if let Some(entry) = all.entry_mut(at).filter(|_| !count) {
                    entry.value = value.as_slice().to_vec();
                }
                continue;
            }
            let data_type = match value.as_slice().len() {
                1 => DataType::UNSIGNED8,
                2 => DataType::UNSIGNED16,
                _ => DataType::UNSIGNED32,
            };
            let mut entry = objects::Entry::number(data_type, if count { Rights::Ro } else { Rights::Rw }, 0);
            entry.value = value.as_slice().to_vec();
            if let (0x1800..0x1A00, 6) = (index, sub) {
                entry = entry.within(0, 240);
            }
            all.insert(index, sub, entry);
        }
    }
    all
}

/// As the standards have it, otherwise its number.
fn parameter_name(index: u16, sub: Option<u8>) -> String {
    standard_name(index, sub).unwrap_or_else(|| match sub {
        Some(sub) => format!("{index:04X}h:{sub:02X}"),
        None => format!("{index:04X}h"),
    })
}

/// What an object with sub-objects is.
fn composed(index: u16) -> ObjectType {
    let known = standard_object(index).map(|object| object.object_type);
    known.filter(|known| *known != ObjectType::VAR).unwrap_or(ObjectType::RECORD)
}

fn describe(index: u16, sub: u8, object: &objects::Entry) -> Entry {
    let mut entry = Entry::new(sub);
    entry.name = parameter_name(index, Some(sub));
    entry.object_type =
        if object.data_type == DataType::DOMAIN { ObjectType::DOMAIN } else { ObjectType::VAR };
    entry.data_type = Some(object.data_type);
    entry.access = Some(Access::of(object.rights));
    entry.pdo_mapping = Some(if object.mappable { PdoMapping::Optional } else { PdoMapping::No });
    if let Some(limits) = object.limits {
        (entry.low_limit, entry.high_limit) = (Some(limits.low.to_string()), Some(limits.high.to_string()));
    }
    // Identifiers that the node makes of its address when it starts.
    let own = match (index, sub) {
        (0x1014, 0) => Some(0x80),
        (0x1400..=0x1403, 1) => Some(0x200 + 0x100 * u32::from(index & 3)),
        (0x1800..=0x1803, 1) => Some(0x180 + 0x100 * u32::from(index & 3)),
        _ => None,
    };
    entry.default = match own {
        Some(base) => Some(format!("$NODEID+{:#X}", object.get() as u32 | base)),
        None if object.data_type == DataType::VISIBLE_STRING => {
            Some(String::from_utf8_lossy(&object.value).into_owned())
        }
        None if object.data_type.size().is_some() => Some(object.get().to_string()),
        None => None,
    };
    entry
}
