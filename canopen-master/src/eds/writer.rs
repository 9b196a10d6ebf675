//! [`Device`] to EDS and DCF text.

use alloc::borrow::ToOwned;
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

use super::ini::{Document, LineKind, Section as Lines};
use super::model::{Device, Entry, Fields, Module, Object, Section};
use super::name::{ModulePart, Name, Part};
use super::objects::KEYS;
use super::types::{List, PdoMapping};

/// Writes a file anew: sections in the order of the standard, objects by list and index, lines ended
/// by CR LF. Reading it gives the same device. An EDS becomes a DCF by what the device holds.
#[must_use]
pub fn write_eds(device: &Device) -> String {
    let mut text = String::new();
    for section in sections(device) {
        put_section(&mut text, &section, "\r\n");
        text.push_str("\r\n");
    }
    text
}

fn put_section(text: &mut String, section: &Section, end: &str) {
    for part in ["[", &section.name, "]", end] {
        text.push_str(part);
    }
    for (key, value) in section.fields.iter() {
        put_entry(text, key, value, end);
    }
}

/// What has no place in a line becomes a blank.
fn put_entry(text: &mut String, key: &str, value: &str, end: &str) {
    text.push_str(key);
    text.push('=');
    text.extend(value.chars().map(|c| if matches!(c, '\r' | '\n') { ' ' } else { c }));
    text.push_str(end);
}

/// The device as sections.
fn sections(device: &Device) -> Vec<Section> {
    let mut out = Sections { list: Vec::new(), leftover: BTreeMap::new() };
    for section in &device.other {
        if matches!(Name::parse(&section.name), Name::Object(..)) {
            out.leftover.insert(section.name.to_ascii_uppercase(), section);
        }
    }
    out.push_fields("FileInfo", &device.file_info);
    out.push_fields("DeviceInfo", &device.device_info);
    out.push_fields("DeviceComissioning", &device.commissioning);
    out.push_fields("DummyUsage", &device.dummy_usage);
    out.push_comments("Comments", &device.comments);
    for section in &device.other {
        if !matches!(Name::parse(&section.name), Name::Object(..)) {
            out.list.push(section.clone());
        }
    }
    for module in &device.modules {
        out.push_module(module);
    }
    for list in List::ALL {
        let objects = device.objects.iter().filter(|object| object.list == list);
        out.push_indices(list.word(), "SupportedObjects", objects.clone().map(|object| object.index));
        for object in objects {
            out.push_object("", object);
        }
    }
    // What no object took, in the order of the file.
    for section in &device.other {
        if out.leftover.contains_key(&section.name.to_ascii_uppercase()) {
            out.push_counted(&section.name, Fields::default());
        }
    }
    out.list
}

struct Sections<'a> {
    list: Vec<Section>,
    /// Lists of compact storage that hold more than the object has sub-objects, by upper-case name.
    leftover: BTreeMap<String, &'a Section>,
}

impl Sections<'_> {
    fn push(&mut self, name: impl Into<String>, fields: Fields) {
        self.list.push(Section { name: name.into(), fields });
    }

    fn push_fields(&mut self, name: &str, fields: &Fields) {
        if !fields.is_empty() {
            self.push(name, fields.clone());
        }
    }

    fn push_comments(&mut self, name: &str, comments: &[String]) {
        if comments.is_empty() {
            return;
        }
        let count = ("Lines".to_owned(), comments.len().to_string());
        let lines = comments.iter().enumerate().map(|(at, line)| (format!("Line{}", at + 1), line.clone()));
        self.push(name, [count].into_iter().chain(lines).collect());
    }

    fn push_indices(&mut self, name: &str, count_key: &str, indices: impl Iterator<Item = u16> + Clone) {
        let count = (count_key.to_owned(), indices.clone().count().to_string());
        let entries = indices.enumerate().map(|(at, index)| ((at + 1).to_string(), format!("0x{index:04X}")));
        self.push(name, [count].into_iter().chain(entries).collect());
    }

    /// A list of compact storage, with what the file had besides.
    fn push_counted(&mut self, name: &str, entries: Fields) {
        let mut pairs: Vec<(String, String)> =
            entries.iter().map(|(key, value)| (key.to_owned(), value.to_owned())).collect();
        if let Some(more) = self.leftover.remove(&name.to_ascii_uppercase()) {
            pairs.extend(more.fields.iter().map(|(key, value)| (key.to_owned(), value.to_owned())));
        }
        if pairs.is_empty() {
            return;
        }
        let counted = matches!(Name::parse(name), Name::Object(_, part) if part != Part::Links)
            || matches!(Name::parse(name), Name::Module(_, ModulePart::Fixed(..) | ModulePart::SubExt(..)));
        if counted {
            pairs.insert(0, ("NrOfEntries".to_owned(), pairs.len().to_string()));
        }
        self.push(name, pairs.into_iter().collect());
    }

    fn push_module(&mut self, module: &Module) {
        let prefix = format!("M{}", module.number);
        self.push(format!("{prefix}ModuleInfo"), module.info.clone());
        self.push_comments(&format!("{prefix}Comments"), &module.comments);
        let kinds = [("FixedObjects", "Fixed", &module.fixed), ("SubExtends", "SubExt", &module.extends)];
        for (list, kind, objects) in kinds {
            if objects.is_empty() {
                continue;
            }
            let indices = objects.iter().map(|object| object.index);
            self.push_indices(&format!("{prefix}{list}"), "NrOfEntries", indices);
            for object in objects {
                self.push_object(&format!("{prefix}{kind}"), object);
            }
        }
    }

    fn push_object(&mut self, prefix: &str, object: &Object) {
        let name = format!("{prefix}{:04X}", object.index);
        let stored = Stored::new(object);
        let mut own = entry_fields(&object.own);
        let sub_number = match stored.compact {
            Some(1..) => Some(stored.explicit.len()).filter(|count| *count > 0),
            _ => object.is_composed().then_some(object.subs.len()),
        };
        if let Some(count) = sub_number {
            own.push(("SubNumber".to_owned(), count.to_string()));
        }
        if let Some(count) = stored.compact {
            own.push(("CompactSubObj".to_owned(), count.to_string()));
        }
        self.push(&name, with_other(own, &object.own));
        for entry in stored.explicit {
            let fields = with_other(entry_fields(entry), entry);
            self.push(format!("{name}sub{:X}", entry.subindex), fields);
        }
        for (part, entries) in
            [("Name", stored.names), ("Value", stored.values), ("Denotation", stored.denotations)]
        {
            self.push_counted(&format!("{name}{part}"), entries.into_iter().collect());
        }
        if !object.links.is_empty() {
            self.push_indices(&format!("{name}ObjectLinks"), "ObjectLinks", object.links.iter().copied());
        }
    }
}

/// How an object's sub-objects are stored.
struct Stored<'a> {
    compact: Option<u8>,
    explicit: Vec<&'a Entry>,
    names: Vec<(String, String)>,
    values: Vec<(String, String)>,
    denotations: Vec<(String, String)>,
}

impl<'a> Stored<'a> {
    fn new(object: &'a Object) -> Self {
        let whole = |count: u8| {
            (0..=count).all(|sub| object.subs.binary_search_by_key(&sub, |entry| entry.subindex).is_ok())
        };
        let compact = object.compact.filter(|count| *count == 0 || whole(*count));
        let mut stored = Self {
            compact,
            explicit: Vec::new(),
            names: Vec::new(),
            values: Vec::new(),
            denotations: Vec::new(),
        };
        let mut named = false;
        for entry in &object.subs {
            let expected = compact
                .filter(|count| *count > 0 && entry.subindex <= *count)
                .map(|_| object.compact_entry(entry.subindex))
                .filter(|expected| differs_only_in_lists(entry, expected));
            let Some(expected) = expected else {
                stored.explicit.push(entry);
                continue;
            };
            if entry.subindex == 0 {
                continue;
            }
            let key = || entry.subindex.to_string();
            named |= entry.name != expected.name;
            stored.names.push((key(), entry.name.clone()));
            if let Some(value) = entry.value.as_ref().filter(|_| entry.value != expected.value) {
                stored.values.push((key(), value.clone()));
            }
            if let Some(text) = entry.denotation.as_ref().filter(|_| entry.denotation != expected.denotation)
            {
                stored.denotations.push((key(), text.clone()));
            }
        }
        // Other readers want all names or none.
        if !named {
            stored.names.clear();
        }
        stored
    }
}

fn differs_only_in_lists(entry: &Entry, expected: &Entry) -> bool {
    if entry.subindex == 0 {
        return entry == expected;
    }
    let lost = |have: &Option<String>, expected: &Option<String>| have.is_none() && expected.is_some();
    if lost(&entry.value, &expected.value) || lost(&entry.denotation, &expected.denotation) {
        return false;
    }
    let mut same = expected.clone();
    same.name.clone_from(&entry.name);
    same.value.clone_from(&entry.value);
    same.denotation.clone_from(&entry.denotation);
    same == *entry
}

fn entry_fields(entry: &Entry) -> Vec<(String, String)> {
    let mapping =
        entry.pdo_mapping.map(|mapping| String::from(if mapping == PdoMapping::No { "0" } else { "1" }));
    let values = [
        Some(entry.name.clone()),
        Some(format!("0x{:X}", entry.object_type.0)),
        entry.data_type.map(|data_type| format!("0x{:04X}", data_type.0)),
        entry.access.map(|access| access.word().to_owned()),
        entry.default.clone(),
        mapping,
        entry.low_limit.clone(),
        entry.high_limit.clone(),
        entry.value.clone(),
        entry.ref_name.clone(),
        entry.denotation.clone(),
        entry.flags.map(|flags| format!("0x{flags:X}")),
    ];
    let pairs = KEYS.iter().zip(values);
    pairs.filter_map(|(key, value)| Some(((*key).to_owned(), value?))).collect()
}

fn with_other(mut pairs: Vec<(String, String)>, entry: &Entry) -> Fields {
    pairs.extend(entry.other.iter().map(|(key, value)| (key.to_owned(), value.to_owned())));
    pairs.into_iter().collect()
}

/// Writes the changes between two states of a device into the text that the first one was read from.
/// Every line that no change concerns stays as it is.
pub(crate) fn update(text: &str, before: &Device, after: &Device) -> String {
    let document = Document::parse(text);
    let end = if text.contains("\r\n") { "\r\n" } else { "\n" };
    let before = by_name(sections(before));
    let order: Vec<String> = sections(after).iter().map(|section| canonical(&section.name)).collect();
    let after = by_name(sections(after));
    let whole = whole(&document, &before, &after);
    let is_whole = |name: &str| owner(name).is_some_and(|(owner, _)| whole.contains(&owner));
    let mut place: BTreeMap<String, usize> = BTreeMap::new();
    for (at, section) in document.sections.iter().enumerate().filter(|(_, section)| section.line != 0) {
        place.entry(canonical(section.name)).or_insert(at);
    }

    // New sections go behind the one that precedes them in the order of the standard.
    let mut added: BTreeMap<usize, Vec<&Section>> = BTreeMap::new();
    let mut anchor = document.sections.len().saturating_sub(1);
    for name in &order {
        match (place.get(name), after.get(name)) {
            (Some(at), _) => anchor = *at,
            // The same canonical section stood nowhere before, so the file lacks it by the change.
            (None, Some(section)) if before.get(name) != Some(section) || is_whole(name) => {
                added.entry(anchor).or_default().push(section);
            }
            _ => {}
        }
    }

    let mut out = String::with_capacity(text.len() + 64);
    for (at, section) in document.sections.iter().enumerate() {
        let name = canonical(section.name);
        let first = place.get(&name) == Some(&at);
        match (before.get(&name), after.get(&name)) {
            // An empty section of the file is filled.
            (None, Some(new)) if section.line != 0 => change(&mut out, section, None, new, first, end),
            (_, Some(new)) if is_whole(&name) => change(&mut out, section, None, new, first, end),
            (_, None) if is_whole(&name) => {}
            (Some(old), Some(new)) if old != new && section.line != 0 => {
                change(&mut out, section, Some(old), new, first, end);
            }
            (Some(_), None) if section.line != 0 => {}
            _ => section.lines.iter().for_each(|line| out.push_str(line.raw)),
        }
        for new in added.remove(&at).unwrap_or_default() {
            if !out.is_empty() && !out.ends_with(['\n', '\r']) {
                out.push_str(end);
            }
            put_section(&mut out, new, end);
            out.push_str(end);
        }
    }
    out
}

/// The objects that change and whose lists say anything else than we would write there: a list holds for
/// the object's other sections too, so that these are written whole.
fn whole(
    document: &Document<'_>,
    before: &BTreeMap<String, Section>,
    after: &BTreeMap<String, Section>,
) -> BTreeSet<String> {
    let mut changed = BTreeSet::new();
    for name in before.keys().chain(after.keys()).filter(|name| before.get(*name) != after.get(*name)) {
        changed.extend(owner(name).map(|(owner, _)| owner));
    }
    let mut lists: BTreeMap<String, Fields> = BTreeMap::new();
    for section in document.sections.iter().filter(|section| section.line != 0) {
        let Some((owner, true)) = owner(section.name) else { continue };
        if changed.contains(&owner) {
            let said = lists.entry(canonical(section.name)).or_default();
            let entries = section.entries().filter(|(_, key, _)| !key.eq_ignore_ascii_case("NrOfEntries"));
            entries.for_each(|(_, key, value)| _ = said.set(key, value));
        }
    }
    let as_written = |name: &String, said: &Fields| {
        let ours = before.get(name).map(|section| section.fields.iter()).into_iter().flatten();
        let ours = ours.filter(|(key, _)| !key.eq_ignore_ascii_case("NrOfEntries"));
        ours.map(|(key, value)| (key.to_owned(), value.to_owned())).collect::<BTreeMap<_, _>>()
            == said.iter().map(|(key, value)| (key.to_owned(), value.to_owned())).collect()
    };
    lists.retain(|name, said| !as_written(name, said));
    lists.keys().filter_map(|name| owner(name)).map(|(owner, _)| owner).collect()
}

/// The object that a section belongs to, and whether the section is a list of its sub-objects' values.
fn owner(name: &str) -> Option<(String, bool)> {
    let (owner, part) = match Name::parse(name) {
        Name::Object(index, part) => (format!("{index:04X}"), part),
        Name::Module(number, ModulePart::Fixed(index, part)) => (format!("M{number}Fixed{index:04X}"), part),
        Name::Module(number, ModulePart::SubExt(index, part)) => {
            (format!("M{number}SubExt{index:04X}"), part)
        }
        _ => return None,
    };
    Some((owner, matches!(part, Part::Names | Part::Values | Part::Denotations)))
}

/// A section with other entries; without the old ones, all are written anew.
fn change(
    out: &mut String,
    section: &Lines<'_>,
    old: Option<&Section>,
    new: &Section,
    first: bool,
    end: &str,
) {
    let by_key = matches!(
        Name::parse(section.name),
        Name::FileInfo
            | Name::DeviceInfo
            | Name::Commissioning(_)
            | Name::DummyUsage
            | Name::Other
            | Name::Object(_, Part::Own | Part::Sub(_))
            | Name::Module(_, ModulePart::Info)
    );
    let old = old.filter(|_| by_key);
    // Where entries are numbered, one change moves the others: only comments stay.
    let last_entry =
        section.lines.iter().rposition(|line| matches!(line.kind, LineKind::Entry { .. })).unwrap_or(0);
    for (at, line) in section.lines.iter().enumerate() {
        match line.kind {
            LineKind::Entry { key, value } => match (old.map(|old| old.fields.get(key)), new.fields.get(key))
            {
                (None, _) => {}
                (Some(was), Some(is)) if was != Some(is) => {
                    let head = line.raw.split_once('=').map_or(key, |(head, _)| head);
                    let gap = if line.raw.contains("= ") && !value.is_empty() { " " } else { "" };
                    put_entry(out, head, &format!("{gap}{is}"), end);
                }
                (Some(Some(_)), None) => {}
                _ => out.push_str(line.raw),
            },
            _ => out.push_str(line.raw),
        }
        if at == last_entry && first {
            if !out.ends_with(['\n', '\r']) {
                out.push_str(end);
            }
            for (key, value) in new.fields.iter() {
                let there = section.entries().any(|(_, have, _)| have.eq_ignore_ascii_case(key));
                if old.is_none_or(|old| !there && old.fields.get(key) != Some(value)) {
                    put_entry(out, key, value, end);
                }
            }
        }
    }
}

fn by_name(sections: Vec<Section>) -> BTreeMap<String, Section> {
    sections.into_iter().map(|section| (canonical(&section.name), section)).collect()
}

/// The name that all spellings of a section's name share.
fn canonical(name: &str) -> String {
    match Name::parse(name) {
        Name::Commissioning(_) => "DEVICECOMISSIONING".to_owned(),
        Name::Object(index, Part::Sub(subindex)) => format!("{index:04X}SUB{subindex:X}"),
        _ => name.to_ascii_uppercase(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::read;
    use super::*;

    const DCF: &str = "; made by hand\n[DeviceInfo]\nVendorName = Ä # kept\n\n[OptionalObjects]\nSupportedObjects=2\n\
        1=0x1A00\n2=0x1017 ; odd order\n[1017]\nParameterName=Heartbeat\nObjectType=7\nDataType=6\n\
        AccessType=RW\nDefaultValue= 0\n; after\n[1A00]\nParameterName=Map\nObjectType=0x8\nDataType=0x7\n\
        AccessType=rw\nCompactSubObj=2\n[1A00Value]\nNrOfEntries=1\n2=0x60410010\n";

    #[test]
    fn an_unchanged_device_leaves_the_text_as_it_is() {
        let reading = read(DCF.as_bytes()).unwrap();
        assert_eq!(update(DCF, &reading.device, &reading.device), DCF);
    }

    #[test]
    fn a_change_touches_its_lines_only() {
        let reading = read(DCF.as_bytes()).unwrap();
        let mut changed = reading.device.clone();
        let heartbeat = changed.object_mut(0x1017).unwrap().entry_mut(0).unwrap();
        heartbeat.default = Some("500".into());
        heartbeat.value = Some("1000".into());
        let map = changed.object_mut(0x1A00).unwrap();
        map.entry_mut(1).unwrap().value = Some("0x60640020".into());
        let text = update(DCF, &reading.device, &changed);
        let expected = DCF
            .replace("DefaultValue= 0\n", "DefaultValue= 500\nParameterValue=1000\n")
            .replace("NrOfEntries=1\n2=", "NrOfEntries=2\n1=0x60640020\n2=");
        assert_eq!(text, expected);
        assert_eq!(read(text.as_bytes()).unwrap().device, changed);
    }

    #[test]
    fn entries_of_a_list_that_other_sections_rely_on_stay() {
        // Sub-index 1 stands apart and has its denotation from the list; so has 0, which is described nowhere.
        let dcf = "[1003]\nParameterName=Errors\nObjectType=8\nDataType=7\nAccessType=rw\nParameterValue=1\n\
            CompactSubObj=2\n[1003sub1]\nParameterName=First\nDataType=7\nAccessType=ro\n; kept\n\
            [1003sub2]\nParameterName=Errors\nDataType=7\nAccessType=rw\n\
            [1003Denotation]\n0=zero\n1=one\n2=two\n9=none\n";
        let reading = read(dcf.as_bytes()).unwrap();
        let change = |edit: fn(&mut Entry)| {
            for sub in 0..=2 {
                let mut changed = reading.device.clone();
                edit(changed.object_mut(0x1003).unwrap().entry_mut(sub).unwrap());
                let text = update(dcf, &reading.device, &changed);
                assert_eq!(read(text.as_bytes()).unwrap().device, changed, "{text}");
                assert!(text.contains("; kept"), "{text}");
            }
        };
        change(|entry| entry.value = Some("0x12".into()));
        change(|entry| entry.denotation = Some("other".into()));
        change(|entry| entry.denotation = None);
    }

    #[test]
    fn an_empty_section_is_filled() {
        let dcf = "[DeviceCommissioning]\n; kept\n[1000]\nParameterName=Type\nDataType=7\nAccessType=ro\n";
        let reading = read(dcf.as_bytes()).unwrap();
        let mut changed = reading.device.clone();
        changed.commissioning.set("NodeID", "5");
        let text = update(dcf, &reading.device, &changed);
        assert_eq!(read(text.as_bytes()).unwrap().device, changed, "{text}");
        assert!(text.contains("; kept"), "{text}");
    }

    #[test]
    fn new_and_removed_objects() {
        let reading = read(DCF.as_bytes()).unwrap();
        let mut changed = reading.device.clone();
        changed.objects.retain(|object| object.index != 0x1017);
        let mut object = Object::new(0x2000);
        object.own.name = "Own".into();
        changed.objects.push(object);
        changed.commissioning.set("NodeID", "5");
        let text = update(DCF, &reading.device, &changed);
        assert_eq!(read(text.as_bytes()).unwrap().device, changed, "{text}");
        assert!(text.starts_with("; made by hand\n[DeviceInfo]\nVendorName = Ä # kept\n"), "{text}");
        assert!(!text.contains("[1017]"), "{text}");
    }

    #[test]
    fn written_anew_it_says_the_same() {
        let device = read(DCF.as_bytes()).unwrap().device;
        let text = write_eds(&device);
        assert_eq!(read(text.as_bytes()).unwrap().device, device, "{text}");
        assert!(text.contains("[1A00Value]\r\nNrOfEntries=1\r\n2=0x60410010\r\n"), "{text}");
        assert!(!text.contains("1A00sub"), "{text}");
    }

    /// Found by fuzzing: of two such lists the second one got lost, and their order changed.
    #[test]
    fn lists_that_belong_to_no_object_are_all_kept() {
        let text = "[1000]\nParameterName=a\nCompactSubObj=1\n[1003Value]\n1=x\n[1003Name]\n1=a\n2=b\n\
            [1000Denotation]\n9=d\n[1003name]\n1=c\n[1000Name]\n9=n\n";
        let device = read(text.as_bytes()).unwrap().device;
        let others: Vec<String> =
            device.other.iter().map(|section| format!("{} {:?}", section.name, section.fields)).collect();
        assert_eq!(
            others,
            [
                r#"1000Name {"9": "n"}"#,
                r#"1000Denotation {"9": "d"}"#,
                r#"1003Name {"1": "c", "2": "b"}"#,
                r#"1003Value {"1": "x"}"#,
            ]
        );
        assert_eq!(read(write_eds(&device).as_bytes()).unwrap().device, device);
    }
}
