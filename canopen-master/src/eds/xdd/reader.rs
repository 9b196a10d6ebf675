//! XDD text to [`Device`].

use alloc::borrow::ToOwned;
use alloc::collections::BTreeMap;
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::cell::Cell;

use roxmltree::{Document, Node};

use super::super::ReadError;
use super::super::diagnostic::Rule;
use super::super::model::{Device, Entry, Fields, Object};
use super::super::objects::KEYS;
use super::super::reader::{Findings, shorten};
use super::super::types::{Access, ObjectType, PdoMapping};
use super::super::value::Number;
use super::{ACCESS, COMMISSIONING, FILE_INFO, GENERAL, IDENTITY, Kind, MASTER, Row, TYPES};
use crate::data_type::DataType;

/// Whether an element has this name, in any namespace.
pub(super) fn is(node: Node<'_, '_>, name: &str) -> bool {
    node.is_element() && node.tag_name().name() == name
}

pub(super) fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|child| is(*child, name))
}

/// An attribute, in any namespace and in upper or lower case.
pub(super) fn attribute<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    let attribute = node.attributes().find(|attribute| attribute.name().eq_ignore_ascii_case(name))?;
    Some(attribute.value())
}

/// The element of the device: the first `ISO15745ProfileContainer` with an object list.
pub(super) fn container<'a, 'i>(document: &'a Document<'i>) -> Result<Node<'a, 'i>, ReadError> {
    let root = document.root_element();
    let containers = || root.descendants().filter(|node| is(*node, "ISO15745ProfileContainer"));
    let with_objects =
        containers().find(|node| node.descendants().any(|inner| is(inner, "CANopenObjectList")));
    if let Some(container) = with_objects {
        return Ok(container);
    }
    let name = root.tag_name().name().to_owned();
    Err(if containers().next().is_some() {
        ReadError::NoObjectList { root: name }
    } else if name.starts_with("CanOpenProject") {
        ReadError::EmptyProject
    } else {
        ReadError::NotCanopenXml {
            root: name,
            namespace: root.tag_name().namespace().unwrap_or_default().to_owned(),
        }
    })
}

/// Line numbers of positions in a text.
struct LineIndex(Vec<usize>);

impl LineIndex {
    fn new(text: &str) -> Self {
        Self(text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(at, _)| at).collect())
    }

    fn line(&self, node: Node<'_, '_>) -> u32 {
        let start = node.range().start;
        u32::try_from(self.0.partition_point(|end| *end < start)).unwrap_or(u32::MAX).saturating_add(1)
    }
}

/// What is needed wherever an element is read.
struct Context<'a, 'i> {
    lines: LineIndex,
    parameters: BTreeMap<&'a str, Node<'a, 'i>>,
    /// Bytes of parameters that may still be taken: a few parameters that everything refers to could
    /// otherwise be made into any amount of text.
    room: Cell<usize>,
}

/// How often the text of parameters may be repeated, in lengths of the file.
const REPEATS: usize = 16;

pub(crate) fn read(text: &str, findings: &mut Findings) -> Result<Device, ReadError> {
    let document = Document::parse(text).map_err(|error| {
        let at = error.pos();
        ReadError::Xml { line: at.row, column: at.col, message: error.to_string() }
    })?;
    let container = container(&document)?;
    let parameters = container.descendants().filter(|node| is(*node, "parameter"));
    let context = Context {
        lines: LineIndex::new(text),
        parameters: parameters.filter_map(|node| Some((attribute(node, "uniqueID")?, node))).collect(),
        room: Cell::new(text.len().saturating_mul(REPEATS)),
    };
    let mut device = Device::default();
    header(container, &mut device, &context, findings);
    let mut objects: BTreeMap<u16, Object> = BTreeMap::new();
    for node in container.descendants().filter(|node| is(*node, "CANopenObject")) {
        let Some(object) = object(node, &context, findings) else { continue };
        let index = object.index;
        if objects.insert(index, object).is_some() {
            let message = format!("object {index:04X}h is there already; this one counts");
            findings.add(context.lines.line(node), Rule::Xdd, message);
        }
    }
    device.objects = objects.into_values().collect();
    if device.objects.is_empty() {
        return Err(ReadError::NoObjectList { root: document.root_element().tag_name().name().to_owned() });
    }
    Ok(device)
}

/// Lines of the elements of objects and sub-objects.
pub(crate) fn lines(text: &str) -> BTreeMap<(u16, Option<u8>), u32> {
    let Ok(document) = Document::parse(text) else { return BTreeMap::new() };
    let lines = LineIndex::new(text);
    let mut places = BTreeMap::new();
    for node in document.descendants() {
        if is(node, "CANopenObject") {
            if let Some(index) = hex_attribute(node, "index") {
                places.insert((index, None), lines.line(node));
            }
        } else if is(node, "CANopenSubObject") {
            let index = node.parent().and_then(|parent| hex_attribute(parent, "index"));
            let subindex = hex_attribute(node, "subIndex").and_then(|sub| u8::try_from(sub).ok());
            if let (Some(index), Some(subindex)) = (index, subindex) {
                places.insert((index, Some(subindex)), lines.line(node));
            }
        }
    }
    places
}

fn header(container: Node<'_, '_>, device: &mut Device, context: &Context<'_, '_>, findings: &mut Findings) {
    let line = |node| context.lines.line(node);
    for node in container.descendants().filter(Node::is_element) {
        match node.tag_name().name() {
            "ProfileBody" if device.file_info.is_empty() => rows(node, &FILE_INFO, &mut device.file_info),
            "DeviceIdentity" => {
                for (element, key) in IDENTITY {
                    if let Some(text) = child(node, element).and_then(|node| node.text()) {
                        device.device_info.set(key, squeeze(text));
                    }
                }
                let description = child(node, "productText").and_then(|text| child(text, "description"));
                if let Some(text) = description.and_then(|node| node.text()) {
                    device.file_info.set("Description", squeeze(text));
                }
            }
            "supportedBaudRate" => match attribute(node, "value").map(bit_rate) {
                Some(Some(rate)) => {
                    device.device_info.set(&format!("BaudRate_{rate}"), "1");
                }
                _ => findings.add(
                    line(node),
                    Rule::Xdd,
                    "supportedBaudRate without a bit rate such as \"500 Kbps\"",
                ),
            },
            "CANopenGeneralFeatures" => rows(node, &GENERAL, &mut device.device_info),
            "CANopenMasterFeatures" => rows(node, &MASTER, &mut device.device_info),
            "deviceCommissioning" => rows(node, &COMMISSIONING, &mut device.commissioning),
            "dummy" => match attribute(node, "entry").and_then(|entry| entry.split_once('=')) {
                Some((key, value)) => {
                    device.dummy_usage.set(key.trim(), value.trim());
                }
                None => findings.add(line(node), Rule::Xdd, "dummy without an entry such as \"Dummy0005=1\""),
            },
            _ => {}
        }
    }
}

fn rows(node: Node<'_, '_>, rows: &[Row], into: &mut Fields) {
    for (name, key, kind) in rows {
        if let Some(text) = attribute(node, name) {
            into.set(key, from_xml(text, *kind));
        }
    }
}

/// A value of a header as an EDS has it; as it is where it has not the form expected.
fn from_xml(text: &str, kind: Kind) -> String {
    let text = squeeze(text);
    let converted = match kind {
        Kind::Text => None,
        Kind::Bool => match text.as_str() {
            "true" | "1" => Some("1".to_owned()),
            "false" | "0" => Some("0".to_owned()),
            _ => None,
        },
        Kind::Date => match text.split('-').collect::<Vec<_>>()[..] {
            [year, month, day] if year.len() == 4 => Some(format!("{month}-{day}-{year}")),
            _ => None,
        },
        Kind::Time => {
            let mut parts = text.splitn(3, ':');
            let hour: Option<u8> = parts.next().and_then(|hour| hour.parse().ok());
            let minute: Option<u8> = parts.next().and_then(|minute| minute.parse().ok());
            match (hour, minute) {
                (Some(hour @ 0..24), Some(minute @ 0..60)) => {
                    let half = if hour < 12 { "AM" } else { "PM" };
                    let hour = match hour % 12 {
                        0 => 12,
                        hour => hour,
                    };
                    Some(format!("{hour:02}:{minute:02}{half}"))
                }
                _ => None,
            }
        }
        Kind::BitRate => bit_rate(&text).map(|rate| rate.to_string()),
    };
    converted.unwrap_or(text)
}

/// Kbit/s of `500 Kbps`, `1 Mbps` or `500`.
fn bit_rate(text: &str) -> Option<u32> {
    let text = text.trim();
    let digits = text.bytes().take_while(u8::is_ascii_digit).count();
    let number: u32 = text.get(..digits)?.parse().ok()?;
    match text.get(digits..)?.trim().to_ascii_lowercase().as_str() {
        "" | "kbps" | "kbit/s" | "k" => Some(number),
        "mbps" | "mbit/s" | "m" => number.checked_mul(1000),
        _ => None,
    }
}

/// The value of an attribute: what XML has made of it, so that what character references give stays.
fn value_text(text: &str) -> String {
    text.trim().to_owned()
}

/// A text on one line.
fn squeeze(text: &str) -> String {
    text.split(['\n', '\r', '\t'])
        .map(str::trim)
        .filter(|part| !part.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}

/// The number of an `index` or `subIndex`: hexadecimal, mostly without `0x`.
pub(super) fn hex_attribute(node: Node<'_, '_>, name: &str) -> Option<u16> {
    let text = attribute(node, name)?.trim();
    let digits = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")).unwrap_or(text);
    if digits.starts_with('+') { None } else { u16::from_str_radix(digits, 16).ok() }
}

fn object(node: Node<'_, '_>, context: &Context<'_, '_>, findings: &mut Findings) -> Option<Object> {
    let line = context.lines.line(node);
    let Some(index) = hex_attribute(node, "index") else {
        findings.add(line, Rule::Xdd, "CANopenObject without a hexadecimal index is passed over");
        return None;
    };
    let mut object = Object::new(index);
    let composed = node.children().any(|child| is(child, "CANopenSubObject"));
    object.own = entry(node, 0, composed, context, findings);
    for child in node.children().filter(|child| is(*child, "CANopenSubObject")) {
        let subindex = hex_attribute(child, "subIndex").and_then(|subindex| u8::try_from(subindex).ok());
        let Some(subindex) = subindex else {
            let message =
                format!("CANopenSubObject of {index:04X}h without a subIndex of 00…FF is passed over");
            findings.add(context.lines.line(child), Rule::Xdd, message);
            continue;
        };
        if object.subs.iter().any(|entry| entry.subindex == subindex) {
            let message = format!("{index:04X}h:{subindex:02X} is there already; this one counts");
            findings.add(context.lines.line(child), Rule::Xdd, message);
        }
        object.insert(entry(child, subindex, false, context, findings));
    }
    let declared = attribute(node, "subNumber").and_then(Number::parse).map(|number| number.value);
    if declared.is_some() && declared != i128::try_from(object.subs.len()).ok() {
        let message = format!(
            "subNumber of {index:04X}h says {}, sub-objects described: {}",
            declared.unwrap_or_default(),
            object.subs.len()
        );
        findings.add(line, Rule::SubNumber, message);
    }
    Some(object)
}

fn entry(
    node: Node<'_, '_>,
    subindex: u8,
    composed: bool,
    context: &Context<'_, '_>,
    findings: &mut Findings,
) -> Entry {
    let line = context.lines.line(node);
    let mut entry = Entry::new(subindex);
    for attribute in node.attributes() {
        let value = attribute.value();
        let mut bad = |what: &str| {
            findings.add(
                line,
                Rule::Xdd,
                format!("{} is no {what}: \"{}\"", attribute.name(), shorten(value)),
            );
        };
        match attribute.name() {
            "name" => entry.name = squeeze(value),
            "objectType" => match Number::parse(value).and_then(|number| u8::try_from(number.value).ok()) {
                Some(code) => entry.object_type = ObjectType(code),
                None => bad("object type"),
            },
            "dataType" => match hex_attribute(node, "dataType") {
                Some(index) => entry.data_type = Some(DataType(index)),
                None => bad("hexadecimal data type"),
            },
            "accessType" => match Access::parse(value) {
                Some(access) => entry.access = Some(access),
                None => bad("access type"),
            },
            "PDOmapping" => match PdoMapping::parse(value) {
                Some(mapping) => entry.pdo_mapping = Some(mapping),
                None => bad("PDO mapping"),
            },
            "objFlags" => match u32::from_str_radix(value.trim().trim_start_matches("0x"), 16) {
                Ok(flags) => entry.flags = Some(flags),
                Err(_) => bad("hexadecimal number"),
            },
            "defaultValue" => entry.default = Some(value_text(value)),
            "lowLimit" => entry.low_limit = Some(value_text(value)),
            "highLimit" => entry.high_limit = Some(value_text(value)),
            "actualValue" => entry.value = Some(value_text(value)),
            "denotation" => entry.denotation = Some(value_text(value)),
            _ => {}
        }
    }
    if let Some(id) = attribute(node, "uniqueIDRef") {
        match context.parameters.get(id) {
            Some(parameter) => match context.room.get().checked_sub(parameter.range().len()) {
                Some(rest) => {
                    context.room.set(rest);
                    complete(&mut entry, *parameter, composed, findings, context);
                }
                None => {
                    let message =
                        format!("parameter \"{}\" is referred to too often; passed over", shorten(id));
                    findings.add(line, Rule::Xdd, message);
                }
            },
            None => findings.add(line, Rule::Xdd, format!("there is no parameter \"{}\"", shorten(id))),
        }
    }
    entry
}

/// Adds what the parameter says and the element does not.
fn complete(
    entry: &mut Entry,
    parameter: Node<'_, '_>,
    composed: bool,
    findings: &mut Findings,
    context: &Context<'_, '_>,
) {
    let line = context.lines.line(parameter);
    let value = |node: Option<Node<'_, '_>>| node.and_then(|node| attribute(node, "value")).map(value_text);
    let simple = parameter.children().find_map(|child| {
        let name = child.tag_name().name();
        TYPES.iter().find(|(known, _)| *known == name).map(|(_, data_type)| *data_type)
    });
    if entry.data_type.is_none() {
        let domain = entry.object_type == ObjectType::DOMAIN && simple == Some(DataType::OCTET_STRING);
        entry.data_type = if domain { Some(DataType::DOMAIN) } else { simple };
    }
    match attribute(parameter, "access") {
        Some("noAccess") => {}
        Some(word) => match ACCESS.iter().find(|(known, _)| *known == word) {
            // The element's accessType has no words for these two.
            Some((_, access @ (Access::ReadWriteInput | Access::ReadWriteOutput)))
                if entry.access == Some(Access::ReadWrite) =>
            {
                entry.access = Some(*access);
            }
            Some((_, access)) => entry.access = entry.access.or(Some(*access)),
            None => findings.add(line, Rule::Xdd, format!("access is no access: \"{}\"", shorten(word))),
        },
        // The schema's default.
        None if entry.access.is_none() && !composed && entry.data_type.is_some() => {
            entry.access = Some(Access::ReadOnly);
        }
        None => {}
    }
    if entry.name.is_empty() {
        let label = child(parameter, "label").and_then(|node| node.text());
        entry.name = label.map(squeeze).unwrap_or_default();
    }
    entry.default = entry.default.take().or_else(|| value(child(parameter, "defaultValue")));
    entry.value = entry.value.take().or_else(|| value(child(parameter, "actualValue")));
    let range = child(parameter, "allowedValues").and_then(|allowed| child(allowed, "range"));
    if let Some(range) = range {
        entry.low_limit = entry.low_limit.take().or_else(|| value(child(range, "minValue")));
        entry.high_limit = entry.high_limit.take().or_else(|| value(child(range, "maxValue")));
    }
    if let Some(text) = child(parameter, "description").and_then(|node| node.text()) {
        let text = squeeze(text);
        if !text.is_empty() {
            entry.other.set("Description", text);
        }
    }
    for property in parameter.children().filter(|child| is(*child, "property")) {
        let (Some(name), Some(value)) = (attribute(property, "name"), attribute(property, "value")) else {
            findings.add(context.lines.line(property), Rule::Xdd, "property without name and value");
            continue;
        };
        let (name, value) = (squeeze(name), value_text(value));
        if name.eq_ignore_ascii_case("ParameterRefName") {
            entry.ref_name = Some(value);
        } else if is_key(&name) {
            entry.other.set(&name, value);
        }
    }
}

/// Whether a property's name can be a key of an EDS without being taken for another.
fn is_key(name: &str) -> bool {
    !name.is_empty()
        && !name.contains('=')
        && !name.starts_with([';', '#', '['])
        && !KEYS.iter().any(|key| key.eq_ignore_ascii_case(name))
}
