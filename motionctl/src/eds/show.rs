//! `eds show`: the device and its object tree.

use core::fmt::Write as _;

use canopen_master::eds::{self, Device, Entry, Fields, Number, Object, ValueError};
use serde_json::{Map, Value, json};

use super::cli::Input;
use super::{kind_word, place, read};
use crate::exit::Exit;
use crate::output::{Output, put_text};

pub(super) fn run(
    out: &Output,
    input: &Input,
    wanted: &[String],
    node: Option<u8>,
    implied: bool,
) -> Result<(), Exit> {
    let reading = read(input)?;
    let mut device = reading.device.clone();
    if implied {
        let more = device.implied_pdos();
        device.objects.extend(more);
        device.objects.sort_by_key(|object| object.index);
    }
    if !reading.diagnostics.is_empty() {
        out.remark(super::doubts(&reading));
    }
    let node = node.or_else(|| device.node_id());
    let mut places = Vec::new();
    for text in wanted {
        let (index, subindex) = place(&device, text)?;
        let missing = match (device.object(index), subindex) {
            (None, _) => true,
            (Some(object), Some(subindex)) => object.entry(subindex).is_none(),
            _ => false,
        };
        if missing {
            return Err(Exit::usage(format!("{text} is not in {}", input.file.display())));
        }
        places.push((index, subindex));
    }
    let shown = |object: &Object, entry: &Entry| {
        places.is_empty()
            || places.iter().any(|(index, subindex)| {
                *index == object.index && subindex.is_none_or(|subindex| subindex == entry.subindex)
            })
    };
    let objects: Vec<(&Object, Vec<&Entry>)> = device
        .objects
        .iter()
        .map(|object| {
            (object, object.entries().iter().filter(|entry| shown(object, entry)).collect::<Vec<_>>())
        })
        .filter(|(object, entries)| {
            places.is_empty() || !entries.is_empty() || places.contains(&(object.index, None))
        })
        .collect();
    let document = json!({
        "file": input.file.display().to_string(),
        "format": kind_word(&reading),
        "encoding": reading.source.encoding.name(),
        "file_info": fields(&device.file_info),
        "device_info": fields(&device.device_info),
        "commissioning": fields(&device.commissioning),
        "dummies": device.dummies().map(|dummy| dummy.to_string()).collect::<Vec<_>>(),
        "comments": device.comments,
        "modules": device.modules.iter().map(|module| json!({
            "number": module.number, "info": fields(&module.info),
            "fixed": module.fixed.len(), "extends": module.extends.len(),
        })).collect::<Vec<_>>(),
        "objects": objects.iter().map(|(object, entries)| object_json(object, entries, node)).collect::<Vec<_>>(),
    });
    out.document(document, || {
        let mut text = if places.is_empty() { header(&device, kind_word(&reading)) } else { String::new() };
        for (object, entries) in &objects {
            put_object(&mut text, object, entries, node);
        }
        put_text(&text);
    });
    Ok(())
}

fn fields(fields: &Fields) -> Value {
    let pairs = fields.iter().map(|(key, value)| (key.to_owned(), json!(value)));
    Value::Object(pairs.collect::<Map<_, _>>())
}

fn object_json(object: &Object, entries: &[&Entry], node: Option<u8>) -> Value {
    json!({
        "index": object.index,
        "name": object.name(),
        "object_type": object.own.object_type.to_string(),
        "list": object.list.word(),
        "compact": object.compact,
        "links": object.links,
        "entries": entries.iter().map(|entry| json!({
            "subindex": entry.subindex,
            "name": entry.name,
            "data_type": entry.data_type.map(|data_type| data_type.to_string()),
            "access": entry.access.map(eds::Access::word),
            "pdo_mapping": entry.pdo_mapping.map(eds::PdoMapping::word),
            "default": entry.default,
            "low_limit": entry.low_limit,
            "high_limit": entry.high_limit,
            "value": entry.value,
            "denotation": entry.denotation,
            "ref_name": entry.ref_name,
            "flags": entry.flags,
            "data": hex(entry.value_bytes(node).or_else(|| entry.default_bytes(node))),
            "other": fields(&entry.other),
        })).collect::<Vec<_>>(),
    })
}

/// The value as the bytes that SDO transfers.
fn hex(bytes: Option<Result<Vec<u8>, ValueError>>) -> Option<String> {
    Some(bytes?.ok()?.iter().map(|byte| format!("{byte:02X}")).collect())
}

fn header(device: &Device, kind: &str) -> String {
    let text =
        |fields: &Fields, key: &str| fields.get(key).filter(|text| !text.is_empty()).map(str::to_owned);
    let number = |number: Option<u32>| number.map(|number| format!("{number:#010X}"));
    let rates: Vec<String> = device.bit_rates().map(|rate| rate.to_string()).collect();
    let info = &device.device_info;
    let rows = [
        ("file", text(&device.file_info, "FileName")),
        ("description", text(&device.file_info, "Description")),
        ("vendor", text(info, "VendorName")),
        ("vendor ID", number(device.vendor_number())),
        ("product", text(info, "ProductName")),
        ("product code", number(device.product_number())),
        ("revision", number(device.revision_number())),
        ("order code", text(info, "OrderCode")),
        ("kbit/s", Some(rates.join(", ")).filter(|rates| !rates.is_empty())),
        ("node ID", device.node_id().map(|id| id.to_string())),
        ("bit rate", device.bit_rate().map(|rate| format!("{rate} kbit/s"))),
    ];
    let mut out = format!("{kind}\n");
    for (name, value) in rows {
        if let Some(value) = value {
            let _ = writeln!(out, "  {name:<13}{value}");
        }
    }
    for module in &device.modules {
        let name = module.info.get("ProductName").unwrap_or_default();
        let _ = writeln!(
            out,
            "  module {:<6}{name}: {} fixed objects, {} that extend",
            module.number,
            module.fixed.len(),
            module.extends.len()
        );
    }
    out.push('\n');
    out
}

fn put_object(out: &mut String, object: &Object, entries: &[&Entry], node: Option<u8>) {
    if !object.is_composed() {
        let text = line(&object.own, object.name(), node);
        let _ = writeln!(out, "{:04X}h     {text}", object.index);
        return;
    }
    let _ = writeln!(out, "{:04X}h     {} ({})", object.index, object.name(), object.own.object_type);
    for entry in entries {
        let _ = writeln!(out, "   :{:02X}      {}", entry.subindex, line(entry, &entry.name, node));
    }
}

fn line(entry: &Entry, name: &str, node: Option<u8>) -> String {
    let mut text = format!("{name:<40}");
    if let Some(data_type) = entry.data_type {
        text += &format!(" {data_type}");
    }
    if let Some(access) = entry.access {
        text += &format!(" {access}");
    }
    if entry.is_mappable() {
        text += " PDO";
    }
    for (sign, value) in [(" = ", &entry.value), (" default ", &entry.default)] {
        if let Some(value) = value.as_deref().filter(|value| !value.is_empty()) {
            text += &format!("{sign}{value}");
            let number = Number::parse(value).filter(|number| number.node_id);
            if let Some(number) = number.and_then(|number| number.resolve(Some(node?)).ok()) {
                text += &format!(" ({number:#X})");
            }
        }
    }
    if entry.low_limit.is_some() || entry.high_limit.is_some() {
        let limit = |limit: &Option<String>| limit.clone().unwrap_or_default();
        text += &format!(" [{}…{}]", limit(&entry.low_limit), limit(&entry.high_limit));
    }
    text.trim_end().to_owned()
}
