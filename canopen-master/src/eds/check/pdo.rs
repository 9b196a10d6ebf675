//! PDO mappings (CiA 301, 7.5.2.36 and 7.5.2.38): what the defaults, or a DCF's values, map.

use alloc::format;

use super::super::diagnostic::Rule;
use super::super::model::{Device, Entry, Object};
use super::super::reader::Findings;
use super::super::types::{PdoMapping, length_in_bits};
use super::super::value::Number;
use super::Places;
use crate::data_type::DataType;

/// Bits of a PDO.
const PDO_BITS: u32 = 64;

pub(super) fn check(device: &Device, places: &Places<'_>, findings: &mut Findings) {
    for object in &device.objects {
        let receive = match object.index {
            0x1600..=0x17FF => true,
            0x1A00..=0x1BFF => false,
            _ => continue,
        };
        let mut bits = 0;
        for (subindex, mapped) in mapped(object) {
            let line = places.line(object.index, Some(subindex), "DefaultValue");
            let mut add = |message| {
                let message = format!("{:04X}h:{subindex:02X} maps {mapped:08X}h: {message}", object.index);
                findings.add(line, Rule::PdoMapping, message);
            };
            bits += mapped & 0xFF;
            if let Err(message) = one(device, mapped, receive) {
                add(message);
            }
        }
        if bits > PDO_BITS {
            let line = places.line(object.index, None, "");
            let message = format!("{:04X}h maps {bits} bits, {PDO_BITS} at most", object.index);
            findings.add(line, Rule::PdoMapping, message);
        }
    }
}

fn number(entry: &Entry) -> Option<u32> {
    u32::try_from(Number::parse(entry.in_force()?)?.resolve(None).ok()?).ok()
}

/// Sub-indices and entries of the mapping that are in use.
fn mapped(object: &Object) -> impl Iterator<Item = (u8, u32)> {
    let count = object.entry(0).and_then(number).filter(|count| *count <= 64).unwrap_or(0);
    let used = object.subs.iter().filter(move |entry| (1..=count).contains(&u32::from(entry.subindex)));
    used.filter_map(|entry| Some((entry.subindex, number(entry)?))).filter(|(_, mapped)| *mapped != 0)
}

fn one(device: &Device, mapped: u32, receive: bool) -> Result<(), alloc::string::String> {
    let [high, low, subindex, bits] = mapped.to_be_bytes();
    let index = u16::from_be_bytes([high, low]);
    if index < 0x20 {
        let dummy = DataType(index);
        return match length_in_bits(dummy) {
            _ if !receive => Err(format!("the dummy {dummy} goes into RPDOs only")),
            Some(length) if length != bits => Err(format!("{dummy} has {length} bits")),
            Some(_) if device.dummies().any(|allowed| allowed == dummy) => Ok(()),
            Some(_) => Err(format!("[DummyUsage] does not allow {dummy}")),
            None => Err(format!("{dummy} is no dummy")),
        };
    }
    let Some(entry) = device.entry(index, subindex) else {
        return Err(format!("there is no {index:04X}h:{subindex:02X}"));
    };
    match entry.pdo_mapping.unwrap_or(PdoMapping::No) {
        PdoMapping::No => return Err("its PDOMapping allows none".into()),
        PdoMapping::Tpdo if receive => return Err("its PDOMapping allows TPDOs only".into()),
        PdoMapping::Rpdo if !receive => return Err("its PDOMapping allows RPDOs only".into()),
        _ => {}
    }
    if let Some(access) = entry.access.filter(|access| !access.rights().can_map(receive)) {
        return Err(format!(
            "its access is {access}, which goes into {} only",
            if receive { "TPDOs" } else { "RPDOs" }
        ));
    }
    let length = entry.data_type.and_then(|data_type| length_in_bits(device.base_type(data_type)));
    match length {
        Some(length) if length != bits => Err(format!("it has {length} bits")),
        _ => Ok(()),
    }
}
