//! Changes of a [`Device`] written into the XDD text that it was read from.

use alloc::collections::BTreeMap;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::ops::Range;

use roxmltree::{Document, Node};

use super::super::model::{Device, Entry, Object};
use super::COMMISSIONING;
use super::reader::{child, container, hex_attribute, is};
use super::writer::{attributes, escape, put_attribute, put_object, put_sub_object, to_xml};

/// Pieces of the text to replace; an empty range is an insertion.
#[derive(Default)]
struct Edits(Vec<(Range<usize>, String)>);

impl Edits {
    fn insert(&mut self, at: usize, text: String) {
        self.0.push((at..at, text));
    }

    fn apply(mut self, text: &str) -> Option<String> {
        self.0.sort_by_key(|(range, _)| (range.start, range.end));
        let mut out = String::with_capacity(text.len() + 256);
        let mut at = 0;
        for (range, new) in self.0 {
            out.push_str(text.get(at..range.start)?);
            out.push_str(&new);
            at = range.end;
        }
        out.push_str(text.get(at..)?);
        Some(out)
    }
}

/// Changes of objects and of the commissioning go into the text as it is; no other change does. Elements
/// that contradict each other can make the result say something else.
pub(crate) fn update(text: &str, before: &Device, after: &Device) -> Option<String> {
    let mut rest = before.clone();
    rest.objects.clone_from(&after.objects);
    rest.commissioning.clone_from(&after.commissioning);
    if rest != *after {
        return None;
    }
    let document = Document::parse(text).ok()?;
    let container = container(&document).ok()?;
    let list = container.descendants().find(|node| is(*node, "CANopenObjectList"))?;
    let mut nodes = BTreeMap::new();
    for node in container.descendants().filter(|node| is(*node, "CANopenObject")) {
        nodes.insert(hex_attribute(node, "index")?, node);
    }
    let mut edits = Edits::default();
    for (index, node) in &nodes {
        match (before.object(*index)?, after.object(*index)) {
            (old, Some(new)) if old == new => {}
            (old, Some(new)) => object(&mut edits, text, *node, old, new)?,
            (_, None) => edits.0.push((node.range(), String::new())),
        }
    }
    let mut added = String::new();
    for object in after.objects.iter().filter(|object| !nodes.contains_key(&object.index)) {
        put_object(&mut added, object);
    }
    if !added.is_empty() {
        edits.insert(end_tag(text, list)?, added);
    }
    if before.commissioning != after.commissioning {
        commissioning(&mut edits, text, container, after)?;
    }
    edits.apply(text)
}

/// Where the end tag of an element begins.
fn end_tag(text: &str, node: Node<'_, '_>) -> Option<usize> {
    let range = node.range();
    let end = text.get(range.clone())?.rfind("</")?;
    Some(range.start + end)
}

/// Behind the name in the start tag of an element.
fn behind_name(text: &str, node: Node<'_, '_>) -> Option<usize> {
    let range = node.range();
    let tag = text.get(range.clone())?;
    Some(range.start + tag.find(|c: char| c.is_whitespace() || matches!(c, '/' | '>'))?)
}

fn object(edits: &mut Edits, text: &str, node: Node<'_, '_>, old: &Object, new: &Object) -> Option<()> {
    let subs: Vec<_> = node.children().filter(|child| is(*child, "CANopenSubObject")).collect();
    if old.own.other != new.own.other || (subs.is_empty() && !new.subs.is_empty()) || new.links != old.links {
        return None;
    }
    entry(edits, text, node, &old.own, &new.own)?;
    for child in &subs {
        let subindex = u8::try_from(hex_attribute(*child, "subIndex")?).ok()?;
        let find = |object: &'_ Object| object.subs.iter().find(|entry| entry.subindex == subindex).cloned();
        match (find(old)?, find(new)) {
            (old, Some(new)) => entry(edits, text, *child, &old, &new)?,
            (_, None) => edits.0.push((child.range(), String::new())),
        }
    }
    let mut added = String::new();
    for entry in new.subs.iter().filter(|entry| old.subs.iter().all(|have| have.subindex != entry.subindex)) {
        if !entry.other.is_empty() {
            return None;
        }
        put_sub_object(&mut added, new.index, entry);
    }
    if !added.is_empty() {
        edits.insert(end_tag(text, node)?, added);
    }
    if old.subs.len() != new.subs.len() {
        set_attribute(edits, text, node, "subNumber", Some(&new.subs.len().to_string()))?;
    }
    Some(())
}

fn entry(edits: &mut Edits, text: &str, node: Node<'_, '_>, old: &Entry, new: &Entry) -> Option<()> {
    if old == new {
        return Some(());
    }
    if old.other != new.other || old.ref_name != new.ref_name {
        return None;
    }
    for ((name, was), (_, is)) in attributes(old).into_iter().zip(attributes(new)) {
        // An attribute that only the parameter has cannot be taken away here.
        if was != is && (is.is_some() || node.attribute(name).is_some()) {
            set_attribute(edits, text, node, name, is.as_deref())?;
        } else if was != is {
            return None;
        }
    }
    Some(())
}

fn set_attribute(
    edits: &mut Edits,
    text: &str,
    node: Node<'_, '_>,
    name: &str,
    value: Option<&str>,
) -> Option<()> {
    match (node.attribute_node(name), value) {
        (Some(attribute), Some(value)) => edits.0.push((attribute.range_value(), escape(value))),
        (Some(attribute), None) => edits.0.push((attribute.range(), String::new())),
        (None, Some(value)) => {
            let mut piece = String::new();
            put_attribute(&mut piece, name, value);
            edits.insert(behind_name(text, node)?, piece);
        }
        (None, None) => {}
    }
    Some(())
}

fn commissioning(edits: &mut Edits, text: &str, container: Node<'_, '_>, after: &Device) -> Option<()> {
    let management = container.descendants().find(|node| is(*node, "NetworkManagement"))?;
    let fields = &after.commissioning;
    let mut piece = String::from("<deviceCommissioning");
    for (name, key, kind) in COMMISSIONING {
        if let Some(value) = fields.get(key) {
            put_attribute(&mut piece, name, &to_xml(value, kind));
        }
    }
    piece.push_str(" />");
    match child(management, "deviceCommissioning") {
        Some(node) if fields.is_empty() => edits.0.push((node.range(), String::new())),
        Some(node) => edits.0.push((node.range(), piece)),
        None => {
            piece.push('\n');
            edits.insert(end_tag(text, management)?, piece);
        }
    }
    Some(())
}
