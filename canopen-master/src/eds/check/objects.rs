//! Lists, keys by kind of object, values by data type (CiA 306-1, 6.6.3).

use alloc::format;
use alloc::string::String;

use super::super::diagnostic::Rule;
use super::super::model::{Device, Entry, Object};
use super::super::objects::KEYS;
use super::super::reader::{Findings, shorten};
use super::super::types::{List, ObjectType, integer_bits};
use super::super::value::{Number, ValueError, fit, to_bytes};
use super::Places;
use crate::data_type::DataType;

/// Longest `ParameterName`.
const NAME_LENGTH: usize = 241;

pub(super) fn check(device: &Device, places: &Places<'_>, findings: &mut Findings) {
    for index in [0x1000, 0x1001, 0x1018] {
        if device.object(index).is_none() {
            findings.add(0, Rule::Mandatory, format!("object {index:04X}h is missing"));
        }
    }
    for object in &device.objects {
        let list = List::of(object.index);
        if object.list != list {
            let line = places.line(object.index, None, "");
            let message =
                format!("{:04X}h is listed in [{}], its place is [{list}]", object.index, object.list);
            findings.add(line, Rule::List, message);
        }
        composition(object, places, findings);
        let mut scope = Scope { device, places, findings, index: object.index, subindex: None };
        scope.entry(&object.own);
        for entry in &object.subs {
            // What compact storage says is said by the object's own section.
            if places.lines.contains_key(&(object.index, Some(entry.subindex))) {
                scope.subindex = Some(entry.subindex);
                scope.entry(entry);
            }
        }
    }
}

/// Keys that do not go with the kind of object, and sub-index 0.
fn composition(object: &Object, places: &Places<'_>, findings: &mut Findings) {
    let Object { index, own, .. } = object;
    let compact = object.compact.unwrap_or(0) > 0;
    if object.is_composed() && !compact {
        let given = [
            ("DataType", own.data_type.is_some() && own.object_type != ObjectType::DEFSTRUCT),
            ("AccessType", own.access.is_some()),
            ("DefaultValue", own.default.is_some()),
            ("LowLimit", own.low_limit.is_some()),
            ("HighLimit", own.high_limit.is_some()),
        ];
        for (key, _) in given.iter().filter(|(_, given)| *given) {
            let line = places.line(*index, None, key);
            let message =
                format!("{key} belongs to the sub-objects of {index:04X}h, not to the {}", own.object_type);
            findings.add(line, Rule::SurplusEntry, message);
        }
        match object.subs.first() {
            Some(first) if first.subindex == 0 => highest(object, first, places, findings),
            _ => {
                let line = places.line(*index, None, "");
                findings.add(line, Rule::MissingEntry, format!("{index:04X}h has no sub-index 0"));
            }
        }
    }
    if compact && matches!(own.object_type, ObjectType::VAR | ObjectType::DOMAIN | ObjectType::DEFTYPE) {
        let line = places.line(*index, None, "CompactSubObj");
        findings.add(
            line,
            Rule::SurplusEntry,
            format!("CompactSubObj does not go with a {}", own.object_type),
        );
    }
    if own.object_type == ObjectType::VAR && !object.subs.is_empty() && !compact {
        let line = places.line(*index, None, "ObjectType");
        findings.add(line, Rule::Value, format!("{index:04X}h is a VAR and has sub-objects"));
    }
}

/// A sub-index 0 that never changes is the highest sub-index.
fn highest(object: &Object, first: &Entry, places: &Places<'_>, findings: &mut Findings) {
    let fixed = first.access.is_some_and(|access| !access.can_write());
    let says = first.default.as_deref().and_then(Number::parse).map(|number| number.value);
    let highest = object.subs.last().map(|last| i128::from(last.subindex));
    // FFh holds the object's structure and does not count.
    let highest = highest.filter(|highest| *highest != 0xFF);
    if let (true, Some(says), Some(highest)) = (fixed, says, highest)
        && says != highest
        && object.own.object_type == ObjectType::RECORD
    {
        let line = places.line(object.index, Some(0), "DefaultValue");
        let message = format!("sub-index 0 of {:04X}h says {says}, the highest is {highest}", object.index);
        findings.add(line, Rule::Range, message);
    }
}

struct Scope<'a> {
    device: &'a Device,
    places: &'a Places<'a>,
    findings: &'a mut Findings,
    index: u16,
    subindex: Option<u8>,
}

impl Scope<'_> {
    fn add(&mut self, key: &str, rule: Rule, message: String) {
        let line = self.places.line(self.index, self.subindex, key);
        let place = match self.subindex {
            Some(subindex) => format!("{:04X}h:{subindex:02X}", self.index),
            None => format!("{:04X}h", self.index),
        };
        self.findings.add(line, rule, format!("{place}: {message}"));
    }

    fn entry(&mut self, entry: &Entry) {
        let length = entry.name.chars().count();
        if length > NAME_LENGTH {
            let message = format!("ParameterName has {length} characters, {NAME_LENGTH} at most");
            self.add("ParameterName", Rule::NameLength, message);
        }
        if entry.object_type.name().is_none() {
            self.add("ObjectType", Rule::Value, format!("{} is none of CiA 301", entry.object_type));
        }
        if let Some(flags) = entry.flags.filter(|flags| *flags > 3) {
            self.add("ObjFlags", Rule::ObjFlags, format!("ObjFlags={flags:#X} sets reserved bits"));
        }
        if let Some(data_type) = entry.data_type {
            let known = data_type.name().is_some() || self.device.object(data_type.0).is_some();
            if !known {
                let message =
                    format!("DataType {:04X}h is none of CiA 301 and not defined here", data_type.0);
                self.add("DataType", Rule::Value, message);
            }
            self.values(entry, self.device.base_type(data_type));
        }
        for (key, _) in entry.other.iter() {
            // A typed key is among the others where its value could not be read, which is said already;
            // SubNumber and CompactSubObj do not go with a sub-object.
            if self.subindex.is_some() && KEYS.iter().skip(12).any(|known| known.eq_ignore_ascii_case(key)) {
                self.add(key, Rule::SurplusEntry, format!("{key} does not go with a sub-object"));
            }
        }
    }

    fn values(&mut self, entry: &Entry, data_type: DataType) {
        let texts = [
            ("DefaultValue", &entry.default),
            ("ParameterValue", &entry.value),
            ("LowLimit", &entry.low_limit),
            ("HighLimit", &entry.high_limit),
        ];
        let mut numbers = [None; 4];
        for ((key, text), number) in texts.into_iter().zip(&mut numbers) {
            let Some(text) = text.as_deref().filter(|text| !text.is_empty()) else { continue };
            *number = self.value(key, text, data_type);
        }
        let [default, value, low, high] = numbers;
        if let (Some(low), Some(high)) = (low, high)
            && low > high
        {
            self.add("LowLimit", Rule::Range, format!("LowLimit {low} is above HighLimit {high}"));
            return;
        }
        for (key, number) in [("DefaultValue", default), ("ParameterValue", value)] {
            let Some(number) = number else { continue };
            if low.is_some_and(|low| number < low) || high.is_some_and(|high| number > high) {
                let limit = |limit: Option<i128>| limit.map_or_else(String::new, |limit| format!("{limit}"));
                let message = format!("{key} {number} is outside of {}…{}", limit(low), limit(high));
                self.add(key, Rule::Range, message);
            }
        }
    }

    /// Checks one value and gives an integer's number, unless it depends on the node ID.
    fn value(&mut self, key: &str, text: &str, data_type: DataType) -> Option<i128> {
        let node_id = self.device.node_id();
        // Any node ID shows whether the rest is well-formed.
        match to_bytes(text, data_type, node_id.or(Some(1))) {
            Ok(_) | Err(ValueError::DataType(_)) => {}
            Err(error) => {
                self.add(key, Rule::Range, format!("{key}=\"{}\" is {error}", shorten(text)));
                return None;
            }
        }
        integer_bits(data_type)?;
        let number = Number::parse(text)?;
        if number.node_id && !number.clean {
            let message = format!("{key}=\"{}\" is to be written $NODEID+number", shorten(text));
            self.add(key, Rule::NodeId, message);
        } else if !number.clean {
            let message = format!("{key}=\"{}\" is taken as {}", shorten(text), number.value);
            self.add(key, Rule::Spelling, message);
        }
        number.resolve(node_id).ok().and_then(|number| fit(number, data_type))
    }
}
