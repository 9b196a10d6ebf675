//! Communication objects that are not as CiA 301, 7.5.2 has them: their types, and identifiers that they
//! must not have.

use alloc::format;
use alloc::string::String;

use pdo::CobId;
use pdo::cob::is_restricted;

use super::super::diagnostic::Rule;
use super::super::model::{Device, Entry};
use super::super::reader::Findings;
use super::super::standard::{standard_object, standard_sub_object};
use super::super::types::ObjectType;
use super::Places;
use crate::data_type::DataType;

pub(super) fn check(device: &Device, places: &Places<'_>, findings: &mut Findings) {
    for object in device.objects.iter().filter(|object| (0x1000..=0x1BFF).contains(&object.index)) {
        for entry in object.entries() {
            let (index, sub) = (object.index, object.is_composed().then_some(entry.subindex));
            let mut add = |key: &str, message| {
                let place = sub.map_or_else(String::new, |sub| format!(":{sub:02X}"));
                findings.add(
                    places.line(index, sub, key),
                    Rule::Standard,
                    format!("{index:04X}h{place}: {message}"),
                );
            };
            let found = entry.data_type.map(|data_type| device.base_type(data_type));
            if let Some((found, expected)) = found.zip(expected(index, sub))
                && found != expected
            {
                add("DataType", format!("DataType {expected} expected, {found} found"));
            }
            if let Some(id) = restricted(device, index, sub, entry) {
                add("DefaultValue", format!("{id:03X}h is a restricted identifier (7.3.5)"));
            }
        }
    }
}

/// The type that the standard gives a value.
fn expected(index: u16, sub: Option<u8>) -> Option<DataType> {
    // Its type was another one before it was withdrawn.
    const NODE_ID: u16 = 0x100B;
    let standard = standard_object(index).filter(|_| index != NODE_ID)?;
    match sub {
        None => (standard.object_type == ObjectType::VAR).then_some(standard.data_type),
        Some(sub) => match standard_sub_object(index, sub) {
            Some((_, data_type)) => Some(data_type),
            None if standard.object_type == ObjectType::ARRAY => Some(standard.data_type),
            None => None,
        },
    }
}

/// The identifier of a service that is in use and may have any but restricted ones. Of the default SDO
/// (1200h) it is fixed, and its client (1280h…) has the same.
fn restricted(device: &Device, index: u16, sub: Option<u8>, entry: &Entry) -> Option<u16> {
    let identifies = matches!(
        (index, sub),
        (0x1005 | 0x1012 | 0x1014, None)
            | (0x1201..=0x127F, Some(1 | 2))
            | (0x1400..=0x15FF | 0x1800..=0x19FF, Some(1))
    );
    let node = Some(device.node_id().unwrap_or(1));
    let bytes = entry.value_bytes(node).or_else(|| entry.default_bytes(node)).filter(|_| identifies)?.ok()?;
    let cob = CobId(u32::from_le_bytes(bytes.try_into().ok()?));
    // TIME has another meaning for the bit that switches others off, and zero is what nobody has set.
    let used = cob.is_valid() || index == 0x1012;
    cob.standard_id().filter(|id| used && *id != 0 && is_restricted(*id))
}
