//! [`Device`] to XDD text.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt::Write as _;

use super::super::model::{Device, Entry, Fields, Object};
use super::super::types::{Access, ObjectType};
use super::{ACCESS, COMMISSIONING, FILE_INFO, GENERAL, IDENTITY, Kind, MASTER, Row, TYPES};

/// Writes an XDD, or an XDC where the device is configured, of schema version 1.1.
///
/// XML has no place for `[Comments]`, modules, other sections, `ObjectLinks`, compact storage (the
/// sub-objects are written one by one) and for `[DeviceInfo]` keys that CiA 311 does not know; the
/// second value says in words which of these the device has and the text does not.
#[must_use]
pub fn write(device: &Device) -> (String, Vec<String>) {
    let mut out = String::from("<?xml version=\"1.0\" encoding=\"utf-8\"?>\n");
    out.push_str(
        "<ISO15745ProfileContainer xmlns=\"http://www.canopen.org/xml/1.1\" \
         xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\">\n",
    );
    profile(&mut out, device, "Device", device_body);
    profile(&mut out, device, "CommunicationNetwork", network_body);
    out.push_str("</ISO15745ProfileContainer>\n");
    (out, losses(device))
}

fn profile(out: &mut String, device: &Device, class: &str, body: fn(&mut String, &Device)) {
    let identification =
        if class == "Device" { "CANopen device profile" } else { "CANopen communication network profile" };
    let _ = write!(
        out,
        "  <ISO15745Profile>\n    <ProfileHeader xmlns=\"\">\n      \
         <ProfileIdentification>{identification}</ProfileIdentification>\n      \
         <ProfileRevision>1.1</ProfileRevision>\n      <ProfileName />\n      <ProfileSource />\n      \
         <ProfileClassID>{class}</ProfileClassID>\n      <ISO15745Reference>\n        \
         <ISO15745Part>1</ISO15745Part>\n        <ISO15745Edition>1</ISO15745Edition>\n        \
         <ProfileTechnology>CANopen</ProfileTechnology>\n      </ISO15745Reference>\n    </ProfileHeader>\n    \
         <ProfileBody xmlns:q1=\"http://www.canopen.org/xml/1.1\" \
         xsi:type=\"q1:ProfileBody_{class}_CANopen\" formatName=\"CANopen\" formatVersion=\"1.0\""
    );
    put_rows(out, &FILE_INFO, &device.file_info);
    out.push_str(" supportedLanguages=\"en\" xmlns=\"\">\n");
    body(out, device);
    out.push_str("    </ProfileBody>\n  </ISO15745Profile>\n");
}

fn device_body(out: &mut String, device: &Device) {
    out.push_str("      <q1:DeviceIdentity>\n");
    for (element, key) in IDENTITY {
        if let Some(text) = device.device_info.get(key) {
            let _ = writeln!(out, "        <q1:{element}>{}</q1:{element}>", escape(text));
        }
    }
    if let Some(text) = device.file_info.get("Description") {
        let _ = write!(
            out,
            "        <q1:productText>\n          <description lang=\"en\">{}</description>\n        </q1:productText>\n",
            escape(text)
        );
    }
    out.push_str("      </q1:DeviceIdentity>\n");
    let mut parameters = String::new();
    for object in &device.objects {
        for (id, entry) in ids(object) {
            parameter(&mut parameters, &id, entry);
        }
    }
    if !parameters.is_empty() {
        let _ = write!(
            out,
            "      <q1:ApplicationProcess>\n        <q1:parameterList>\n{parameters}        </q1:parameterList>\n      \
             </q1:ApplicationProcess>\n"
        );
    }
}

fn network_body(out: &mut String, device: &Device) {
    out.push_str("      <ApplicationLayers>\n        <q1:CANopenObjectList>\n");
    for object in &device.objects {
        put_object(out, object);
    }
    out.push_str("        </q1:CANopenObjectList>\n");
    if !device.dummy_usage.is_empty() {
        out.push_str("        <dummyUsage>\n");
        for (key, value) in device.dummy_usage.iter() {
            let _ = writeln!(out, "          <dummy entry=\"{}={}\" />", escape(key), escape(value));
        }
        out.push_str("        </dummyUsage>\n");
    }
    out.push_str(
        "      </ApplicationLayers>\n      <TransportLayers>\n        <PhysicalLayer>\n          <baudRate>\n",
    );
    for rate in device.bit_rates() {
        let _ = writeln!(out, "            <supportedBaudRate value=\"{rate} Kbps\" />");
    }
    out.push_str("          </baudRate>\n        </PhysicalLayer>\n      </TransportLayers>\n      <NetworkManagement>\n");
    for (element, rows, fields) in [
        ("CANopenGeneralFeatures", &GENERAL[..], &device.device_info),
        ("CANopenMasterFeatures", &MASTER[..], &device.device_info),
        ("deviceCommissioning", &COMMISSIONING[..], &device.commissioning),
    ] {
        if element == "deviceCommissioning" && fields.is_empty() {
            continue;
        }
        let _ = write!(out, "        <{element}");
        put_rows(out, rows, fields);
        out.push_str(" />\n");
    }
    out.push_str("      </NetworkManagement>\n");
}

fn put_rows(out: &mut String, rows: &[Row], fields: &Fields) {
    for (name, key, kind) in rows {
        if let Some(text) = fields.get(key) {
            put_attribute(out, name, &to_xml(text, *kind));
        }
    }
}

/// A value of a header as XML has it; as it is where it has not the form expected.
pub(super) fn to_xml(text: &str, kind: Kind) -> String {
    let converted = match kind {
        Kind::Text => None,
        Kind::Bool => match text {
            "1" => Some("true".into()),
            "0" => Some("false".into()),
            _ => None,
        },
        Kind::Date => match text.split('-').collect::<Vec<_>>()[..] {
            [month, day, year] if year.len() == 4 => Some(format!("{year}-{month}-{day}")),
            _ => None,
        },
        Kind::Time => clock(text),
        Kind::BitRate => text.parse::<u32>().ok().map(|rate| format!("{rate} Kbps")),
    };
    converted.unwrap_or_else(|| text.to_string())
}

/// `04:49PM` as `16:49:00`.
fn clock(text: &str) -> Option<String> {
    let (hour, rest) = text.split_once(':')?;
    let hour: u8 = hour.parse().ok().filter(|hour| (1..=12).contains(hour))?;
    let minute: u8 = rest.get(..2)?.parse().ok().filter(|minute| *minute < 60)?;
    let hour = match rest.get(2..)?.trim() {
        "AM" => hour % 12,
        "PM" => hour % 12 + 12,
        _ => return None,
    };
    Some(format!("{hour:02}:{minute:02}:00"))
}

/// The entries of an object that need a parameter besides, with the parameter's ID: those of which the
/// element's attributes cannot say everything.
fn ids(object: &Object) -> impl Iterator<Item = (String, &Entry)> {
    let own = (format!("UID_OBJ_{:04X}", object.index), &object.own);
    let subs = object
        .subs
        .iter()
        .map(|entry| (format!("UID_SUB_{:04X}{:02X}", object.index, entry.subindex), entry));
    [own].into_iter().chain(subs).filter(|(_, entry)| needs_parameter(entry))
}

fn needs_parameter(entry: &Entry) -> bool {
    let fine = matches!(entry.access, Some(Access::ReadWriteInput | Access::ReadWriteOutput));
    fine || !entry.other.is_empty() || entry.ref_name.is_some()
}

fn parameter(out: &mut String, id: &str, entry: &Entry) {
    let access = ACCESS.iter().find(|(_, access)| Some(*access) == entry.access);
    let access = access.map_or("noAccess", |(word, _)| word);
    let _ = writeln!(out, "          <q1:parameter uniqueID=\"{id}\" access=\"{access}\">");
    let _ = writeln!(out, "            <label lang=\"en\">{}</label>", escape(&entry.name));
    if let Some(text) = entry.other.get("Description") {
        let _ = writeln!(out, "            <description lang=\"en\">{}</description>", escape(text));
    }
    if let Some((word, _)) = TYPES.iter().find(|(_, data_type)| Some(*data_type) == entry.data_type) {
        let _ = writeln!(out, "            <{word} />");
    }
    let ref_name = entry.ref_name.as_deref().map(|text| ("ParameterRefName", text));
    for (name, value) in entry.other.iter().chain(ref_name).filter(|(name, _)| *name != "Description") {
        let _ = writeln!(
            out,
            "            <q1:property name=\"{}\" value=\"{}\" />",
            escape(name),
            escape(value)
        );
    }
    out.push_str("          </q1:parameter>\n");
}

pub(super) fn put_object(out: &mut String, object: &Object) {
    let _ = write!(out, "          <CANopenObject index=\"{:04X}\"", object.index);
    put_entry(out, &object.own);
    if needs_parameter(&object.own) {
        put_attribute(out, "uniqueIDRef", &format!("UID_OBJ_{:04X}", object.index));
    }
    if object.is_composed() {
        put_attribute(out, "subNumber", &object.subs.len().to_string());
    }
    if object.subs.is_empty() {
        out.push_str(" />\n");
        return;
    }
    out.push_str(">\n");
    for entry in &object.subs {
        put_sub_object(out, object.index, entry);
    }
    out.push_str("          </CANopenObject>\n");
}

pub(super) fn put_sub_object(out: &mut String, index: u16, entry: &Entry) {
    let _ = write!(out, "            <CANopenSubObject subIndex=\"{:02X}\"", entry.subindex);
    put_entry(out, entry);
    if needs_parameter(entry) {
        put_attribute(out, "uniqueIDRef", &format!("UID_SUB_{index:04X}{:02X}", entry.subindex));
    }
    out.push_str(" />\n");
}

fn put_entry(out: &mut String, entry: &Entry) {
    for (name, value) in attributes(entry) {
        if let Some(value) = value {
            put_attribute(out, name, &value);
        }
    }
}

/// The attributes of an entry's element.
pub(super) fn attributes(entry: &Entry) -> [(&'static str, Option<String>); 11] {
    let access = entry.access.map(|access| match access {
        Access::ReadWriteInput | Access::ReadWriteOutput => Access::ReadWrite.word(),
        other => other.word(),
    });
    [
        ("name", Some(entry.name.clone())),
        ("objectType", Some(entry.object_type.0.to_string())),
        ("dataType", entry.data_type.map(|data_type| format!("{:04X}", data_type.0))),
        ("accessType", access.map(String::from)),
        ("defaultValue", entry.default.clone()),
        ("lowLimit", entry.low_limit.clone()),
        ("highLimit", entry.high_limit.clone()),
        ("actualValue", entry.value.clone()),
        ("denotation", entry.denotation.clone()),
        ("PDOmapping", entry.pdo_mapping.map(|mapping| mapping.word().into())),
        (
            "objFlags",
            entry.flags.map(|flags| format!("{flags:0width$X}", width = if flags > 0xFF { 8 } else { 2 })),
        ),
    ]
}

pub(super) fn put_attribute(out: &mut String, name: &str, value: &str) {
    let _ = write!(out, " {name}=\"{}\"", escape(value));
}

/// A text inside an attribute or element. What XML 1.0 cannot hold at all becomes U+FFFD.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\t' => out.push_str("&#9;"),
            '\n' => out.push_str("&#10;"),
            '\r' => out.push_str("&#13;"),
            '\0'..='\x1F' | '\u{FFFE}' | '\u{FFFF}' => out.push(char::REPLACEMENT_CHARACTER),
            other => out.push(other),
        }
    }
    out
}

fn losses(device: &Device) -> Vec<String> {
    let mut losses = Vec::new();
    if !device.comments.is_empty() {
        losses.push(format!("[Comments]: {} lines", device.comments.len()));
    }
    if !device.modules.is_empty() {
        losses.push(format!("{} modules", device.modules.len()));
    }
    losses.extend(device.other.iter().map(|section| format!("section [{}]", section.name)));
    let known = |rows: &[Row], key: &str| rows.iter().any(|(_, known, _)| known.eq_ignore_ascii_case(key));
    for (key, value) in device.device_info.iter() {
        let zero_rate = super::super::model::strip_prefix(key, "BaudRate_").is_some();
        let identity = IDENTITY.iter().any(|(_, known)| known.eq_ignore_ascii_case(key));
        if !(known(&GENERAL, key) || known(&MASTER, key) || identity || zero_rate) {
            losses.push(format!("{key}={value} of [DeviceInfo]"));
        }
    }
    for (key, value) in device.file_info.iter() {
        if !known(&FILE_INFO, key) && !key.eq_ignore_ascii_case("Description") {
            losses.push(format!("{key}={value} of [FileInfo]"));
        }
    }
    for (key, value) in device.commissioning.iter().filter(|(key, _)| !known(&COMMISSIONING, key)) {
        losses.push(format!("{key}={value} of [DeviceComissioning]"));
    }
    for object in &device.objects {
        if !object.links.is_empty() {
            losses.push(format!("links of {:04X}h", object.index));
        }
        if object.own.object_type == ObjectType::VAR && object.compact.is_some_and(|count| count > 0) {
            losses.push(format!("CompactSubObj of {:04X}h", object.index));
        }
    }
    losses
}
