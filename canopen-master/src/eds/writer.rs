//! [`Device`] to EDS and DCF text.

use alloc::borrow::ToOwned;
use alloc::collections::BTreeMap;
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

use super::model::{Device, Entry, Fields, Module, Object, Section};
use super::name::{ModulePart, Name, Part};
use super::objects::KEYS;
use super::types::{Access, List, PdoMapping};

/// Writes a file anew: sections in the order of the standard, objects by list and index, lines ended
/// by CR LF. Reading it gives the same device, but for [`lost_in_eds`]. An EDS becomes a DCF by what the
/// device holds.
#[must_use]
pub fn write_eds(device: &Device) -> String {
    let mut text = String::new();
    for section in sections(device) {
        put_section(&mut text, &section, "\r\n");
        text.push_str("\r\n");
    }
    text
}

/// What only XML has a place for, in words: entries without access, directions of PDOs that no `AccessType`
/// says, mappings by default, line ends.
#[must_use]
pub fn lost_in_eds(device: &Device) -> Vec<String> {
    let mut lost = Vec::new();
    for object in &device.objects {
        for entry in object.entries() {
            let place = format!("{:04X}h:{:02X}", object.index, entry.subindex);
            if entry.access.is_none() && entry.data_type.is_some() {
                lost.push(format!("that {place} has no access: it is written without AccessType"));
            }
            if let Some(mapping) = entry.pdo_mapping.filter(|mapping| !says(written_access(entry), *mapping))
            {
                lost.push(format!("PDOmapping=\"{mapping}\" of {place}: it is written as mappable"));
            }
            let texts = [
                ("DefaultValue", &entry.default),
                ("ParameterValue", &entry.value),
                ("Denotation", &entry.denotation),
            ];
            for (key, _) in
                texts.iter().filter(|(_, text)| text.iter().any(|text| text.contains(['\r', '\n'])))
            {
                lost.push(format!("line ends in {key} of {place}: blanks stand for them"));
            }
        }
    }
    lost
}

/// The access as an EDS has it: there, it tells into which PDOs a value may go.
fn written_access(entry: &Entry) -> Option<Access> {
    match (entry.access, entry.pdo_mapping) {
        (Some(Access::ReadWrite), Some(PdoMapping::Rpdo)) => Some(Access::ReadWriteOutput),
        (Some(Access::ReadWrite), Some(PdoMapping::Tpdo)) => Some(Access::ReadWriteInput),
        (access, _) => access,
    }
}

/// Whether `PDOMapping` of 0 or 1 and this access say as much as the mapping does.
const fn says(access: Option<Access>, mapping: PdoMapping) -> bool {
    match mapping {
        PdoMapping::No | PdoMapping::Optional => true,
        PdoMapping::Default => false,
        PdoMapping::Rpdo => goes_only(access, true),
        PdoMapping::Tpdo => goes_only(access, false),
    }
}

const fn goes_only(access: Option<Access>, receive: bool) -> bool {
    matches!(access, Some(access) if access.rights().can_map(receive) && !access.rights().can_map(!receive))
}

pub(super) fn put_section(text: &mut String, section: &Section, end: &str) {
    for part in ["[", &section.name, "]", end] {
        text.push_str(part);
    }
    for (key, value) in section.fields.iter() {
        put_entry(text, key, value, end);
    }
}

/// What has no place in a line becomes a blank.
pub(super) fn put_entry(text: &mut String, key: &str, value: &str, end: &str) {
    text.push_str(key);
    text.push('=');
    text.extend(value.chars().map(|c| if matches!(c, '\r' | '\n') { ' ' } else { c }));
    text.push_str(end);
}

/// The device as sections.
pub(super) fn sections(device: &Device) -> Vec<Section> {
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

    /// A list of compact storage, with what the file had besides and under the name it has there.
    fn push_counted(&mut self, name: &str, entries: Fields) {
        let mut pairs: Vec<(String, String)> =
            entries.iter().map(|(key, value)| (key.to_owned(), value.to_owned())).collect();
        let more = self.leftover.remove(&name.to_ascii_uppercase());
        let name = more.map_or(name, |more| &more.name);
        if let Some(more) = more {
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
        written_access(entry).map(|access| access.word().to_owned()),
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

#[cfg(test)]
mod tests {
    use super::super::{DCF, read};
    use super::*;

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

    /// Found by fuzzing: it was written as `1003Denotation`, which is another section of the same device.
    #[test]
    fn a_list_with_entries_of_no_sub_object_keeps_its_name() {
        let text = "[1003]\nParameterName=a\n[1003DenotatioN]\n9=d\n";
        let device = read(text.as_bytes()).unwrap().device;
        assert_eq!(device.other[0].name, "1003DenotatioN");
        assert_eq!(read(write_eds(&device).as_bytes()).unwrap().device, device);
    }
}
