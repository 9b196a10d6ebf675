//! Sections of objects to [`Object`]s (CiA 306-1, 6.6.3).

use alloc::borrow::ToOwned;
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use super::diagnostic::Rule;
use super::ini::Section as Lines;
use super::model::{Entry, Fields, Object, Section};
use super::name::Part;
use super::reader::{Findings, duplicate, indices, repeated, shorten};
use super::types::{Access, ObjectType, PdoMapping};
use super::value::Number;
use crate::data_type::DataType;

/// Bytes that the sub-objects of compact storage take in one file, at most: every one has the object's own text.
const COMPACT_ROOM: usize = 64 << 20;

/// Highest sub-index of a list: FFh describes the structure (CiA 301, 7.4.4).
const LAST: u8 = 0xFE;

/// Collects the sections of objects, which come in any order.
#[derive(Default)]
pub(crate) struct Builder<'a> {
    objects: BTreeMap<u16, Object>,
    /// What the objects' own sections declare.
    declared: BTreeMap<u16, Declared<'a>>,
    pending: Vec<(u16, Part, &'a Lines<'a>)>,
}

/// The last own section of an object, and what all of them say.
struct Declared<'a> {
    section: &'a Lines<'a>,
    counts: Counts,
}

impl<'a> Builder<'a> {
    pub(crate) fn add(&mut self, index: u16, part: Part, section: &'a Lines<'a>, findings: &mut Findings) {
        if part != Part::Own {
            self.pending.push((index, part, section));
            return;
        }
        let mut counts = Counts::default();
        if let Some(first) = self.declared.remove(&index) {
            repeated(section, first.section.line, findings);
            counts = first.counts;
        }
        let object = self.objects.entry(index).or_insert_with(|| Object::new(index));
        read_entry(&mut object.own, &mut counts, section, true, findings);
        object.compact = counts.compact;
        self.declared.insert(index, Declared { section, counts });
    }

    /// Line of an object's own section; 0 where it has none.
    pub(crate) fn line(&self, index: u16) -> u32 {
        self.declared.get(&index).map_or(0, |declared| declared.section.line)
    }

    /// The objects, and entries of lists that belong to no sub-object.
    pub(crate) fn finish(&mut self, findings: &mut Findings) -> (Vec<Object>, Vec<Section>) {
        let mut pending = core::mem::take(&mut self.pending);
        // Sections of the same kind stay in the order of the file.
        pending.sort_by_key(|(index, part, _)| (*index, *part));
        for same in pending.chunk_by(|one, next| (one.0, one.1) == (next.0, next.1)) {
            if let [(index, Part::Sub(subindex), _), ..] = same {
                self.add_sub(*index, *subindex, same, findings);
            }
        }
        self.check_declared(findings);
        let mut room = COMPACT_ROOM;
        for object in self.objects.values_mut() {
            let Some(count) = object.compact.filter(|count| *count > 0) else { continue };
            let needed = usize::from(count) * (size_of::<Entry>() + object.own.text_length());
            if needed > room {
                let line = self.declared.get(&object.index).map_or(0, |declared| declared.section.line);
                let message = format!(
                    "CompactSubObj={count} passed over: with it, the sub-objects of this file take more than {} MiB",
                    COMPACT_ROOM >> 20
                );
                findings.add(line, Rule::Compact, message);
                continue;
            }
            room -= needed;
            if count > LAST {
                let line = self.declared.get(&object.index).map_or(0, |declared| declared.section.line);
                let message =
                    format!("CompactSubObj={count}, {LAST} at most: FFh is no sub-object of a list");
                findings.add(line, Rule::Compact, message);
            }
            for subindex in 0..=count {
                if object.subs.binary_search_by_key(&subindex, |entry| entry.subindex).is_err() {
                    object.insert(object.compact_entry(subindex));
                }
            }
        }
        let mut leftover = Vec::new();
        for (index, part, section) in pending {
            let rest = match part {
                Part::Names | Part::Values | Part::Denotations => {
                    self.add_list(index, part, section, findings)
                }
                Part::Links => self.add_links(index, section, findings),
                Part::Own | Part::Sub(_) => continue,
            };
            if !rest.is_empty() {
                join(&mut leftover, section.name, rest);
            }
        }
        (core::mem::take(&mut self.objects).into_values().collect(), leftover)
    }

    /// Adds a sub-object: all sections of its name, mostly one.
    fn add_sub(
        &mut self,
        index: u16,
        subindex: u8,
        sections: &[(u16, Part, &Lines<'_>)],
        findings: &mut Findings,
    ) {
        let Some((_, _, last)) = sections.last() else { return };
        let object = self.objects.entry(index).or_insert_with(|| {
            let line = sections.first().map_or(last.line, |(_, _, first)| first.line);
            let message = format!("there is no section [{index:04X}]; read as a RECORD without a name");
            findings.add(line, Rule::Orphan, message);
            let mut object = Object::new(index);
            object.own.object_type = ObjectType::RECORD;
            object
        });
        let mut entry = Entry::new(subindex);
        let mut counts = Counts::default();
        for (at, (_, _, section)) in sections.iter().enumerate() {
            if at > 0 {
                repeated(section, 0, findings);
            }
            read_entry(&mut entry, &mut counts, section, false, findings);
        }
        missing(&entry, last, &counts, false, findings);
        // They come in ascending order.
        object.subs.push(entry);
    }

    fn check_declared(&self, findings: &mut Findings) {
        for (index, Declared { section, counts }) in &self.declared {
            let Some(object) = self.objects.get(index) else { continue };
            missing(&object.own, section, counts, true, findings);
            let (line, described) = (section.line, object.subs.len());
            match counts.sub_number {
                Some(number)
                    if i128::try_from(described) != Ok(number) && object.compact.unwrap_or(0) == 0 =>
                {
                    let message = format!("SubNumber says {number}, sub-objects described: {described}");
                    findings.add(line, Rule::SubNumber, message);
                }
                None if described > 0 && object.compact.unwrap_or(0) == 0 => {
                    findings.add(
                        line,
                        Rule::SubNumber,
                        format!("SubNumber is missing, sub-objects described: {described}"),
                    );
                }
                _ => {}
            }
        }
    }

    /// `[xxxxName]`, `[xxxxValue]`, `[xxxxDenotation]`: gives back what belongs to no sub-object.
    fn add_list(&mut self, index: u16, part: Part, section: &Lines<'_>, findings: &mut Findings) -> Fields {
        let mut rest = Fields::default();
        let mut object = self.objects.get_mut(&index);
        if object.is_none() {
            findings.add(section.line, Rule::Orphan, format!("there is no section [{index:04X}]"));
        }
        let mut declared = None;
        let mut count = 0;
        let mut seen = BTreeSet::new();
        for (line, key, value) in section.entries() {
            if key.eq_ignore_ascii_case("NrOfEntries") {
                declared = Some((line, Number::parse(value)));
                continue;
            }
            count += 1;
            let subindex = key.parse().ok();
            let Some(entry) = subindex.and_then(|subindex| object.as_deref_mut()?.entry_mut(subindex)) else {
                if object.is_some() {
                    findings.add(
                        line,
                        Rule::Compact,
                        format!("{index:04X}h has no sub-index {}", shorten(key)),
                    );
                }
                rest.set(key, value);
                continue;
            };
            if !seen.insert(entry.subindex) {
                duplicate(line, key, findings);
            }
            match part {
                Part::Names => value.clone_into(&mut entry.name),
                Part::Values => entry.value = Some(value.to_owned()),
                _ => entry.denotation = Some(value.to_owned()),
            }
        }
        let (line, number) = declared.unwrap_or((section.line, None));
        if number.map(|number| number.value) != Some(count) {
            let declared =
                number.map_or_else(|| "is missing".into(), |number| format!("says {}", number.value));
            let message = format!("NrOfEntries of [{}] {declared}, entries: {count}", section.name);
            findings.add(line, Rule::Compact, message);
        }
        rest
    }

    fn add_links(&mut self, index: u16, section: &Lines<'_>, findings: &mut Findings) -> Fields {
        let Some(object) = self.objects.get_mut(&index) else {
            findings.add(section.line, Rule::Orphan, format!("there is no section [{index:04X}]"));
            return section.entries().map(|(_, key, value)| (key, value)).collect();
        };
        let links = indices(section, "ObjectLinks", Rule::Links, findings);
        object.links.extend(links.into_iter().map(|(_, index)| index));
        Fields::default()
    }
}

/// Adds a section, or its entries to the one before of the same name.
fn join(sections: &mut Vec<Section>, name: &str, fields: Fields) {
    match sections.last_mut().filter(|section| section.name.eq_ignore_ascii_case(name)) {
        Some(section) => fields.iter().for_each(|(key, value)| _ = section.fields.set(key, value)),
        None => sections.push(Section { name: name.to_owned(), fields }),
    }
}

/// Keys seen, and entries of an object's own section that count something.
#[derive(Default)]
struct Counts {
    /// One bit for each of [`KEYS`].
    seen: u16,
    sub_number: Option<i128>,
    compact: Option<u8>,
}

/// The keys that have a field of their own, in the order in which they are written.
pub(crate) const KEYS: [&str; 14] = [
    "ParameterName",
    "ObjectType",
    "DataType",
    "AccessType",
    "DefaultValue",
    "PDOMapping",
    "LowLimit",
    "HighLimit",
    "ParameterValue",
    "ParameterRefName",
    "Denotation",
    "ObjFlags",
    "SubNumber",
    "CompactSubObj",
];

/// Position of the key in [`KEYS`].
fn key_position(key: &str) -> Option<usize> {
    KEYS.iter().position(|known| known.len() == key.len() && known.eq_ignore_ascii_case(key))
}

fn read_entry(
    entry: &mut Entry,
    counts: &mut Counts,
    section: &Lines<'_>,
    own: bool,
    findings: &mut Findings,
) {
    let mut seen = 0_u16;
    for (line, key, value) in section.entries() {
        let Some(position) = key_position(key).filter(|position| own || *position < 12) else {
            if entry.other.set(key, value) {
                duplicate(line, key, findings);
            }
            continue;
        };
        let bit = 1 << position;
        if seen & bit != 0 {
            duplicate(line, key, findings);
        }
        seen |= bit;
        let text = || Some(value.to_owned());
        let read = match position {
            0 => {
                value.clone_into(&mut entry.name);
                true
            }
            1 => number(line, key, value, findings)
                .map(|number| entry.object_type = ObjectType(number))
                .is_some(),
            2 => number(line, key, value, findings)
                .map(|number| entry.data_type = Some(DataType(number)))
                .is_some(),
            3 => access(line, value, findings).map(|access| entry.access = Some(access)).is_some(),
            4 => assign(&mut entry.default, text()),
            5 => {
                mapping(line, key, value, findings).map(|mapping| entry.pdo_mapping = Some(mapping)).is_some()
            }
            6 => assign(&mut entry.low_limit, text()),
            7 => assign(&mut entry.high_limit, text()),
            8 => assign(&mut entry.value, text()),
            9 => assign(&mut entry.ref_name, text()),
            10 => assign(&mut entry.denotation, text()),
            11 => number(line, key, value, findings).map(|number| entry.flags = Some(number)).is_some(),
            12 => number::<u8>(line, key, value, findings)
                .map(|number| counts.sub_number = Some(number.into()))
                .is_some(),
            _ => number(line, key, value, findings).map(|number| counts.compact = Some(number)).is_some(),
        };
        if !read {
            entry.other.set(key, value);
        }
    }
    counts.seen |= seen;
}

/// What the kind of object needs (CiA 306-1, table 7).
fn missing(entry: &Entry, section: &Lines<'_>, counts: &Counts, own: bool, findings: &mut Findings) {
    let seen = counts.seen;
    let compact = own && seen & 1 << 13 != 0;
    let needs_value = matches!(entry.object_type, ObjectType::VAR) || compact;
    let needs = [(0, true), (2, needs_value), (3, needs_value)];
    for (position, needed) in needs {
        if needed && seen & 1 << position == 0 {
            let key = KEYS.get(position).copied().unwrap_or_default();
            findings.add(section.line, Rule::MissingEntry, format!("[{}] has no {key}", section.name));
        }
    }
}

fn assign(field: &mut Option<String>, text: Option<String>) -> bool {
    *field = text;
    true
}

fn number<T: TryFrom<i128>>(line: u32, key: &str, value: &str, findings: &mut Findings) -> Option<T> {
    let number = Number::parse(value).filter(|number| !number.node_id);
    let Some((number, fits)) = number.map(|number| (number, T::try_from(number.value).ok())) else {
        findings.add(line, Rule::Value, format!("{key} is no number: \"{}\"", shorten(value)));
        return None;
    };
    if fits.is_none() {
        findings.add(line, Rule::Value, format!("{key} is out of range: {}", number.value));
    } else if !number.clean {
        spelling(line, key, value, &format!("{}", number.value), findings);
    }
    fits
}

fn spelling(line: u32, key: &str, value: &str, taken: &str, findings: &mut Findings) {
    findings.add(line, Rule::Spelling, format!("{key}=\"{}\" is taken as {taken}", shorten(value)));
}

fn access(line: u32, value: &str, findings: &mut Findings) -> Option<Access> {
    if let Some(access) = Access::parse(value) {
        return Some(access);
    }
    let word: String = value
        .split([';', '#'])
        .next()
        .unwrap_or_default()
        .chars()
        .filter(char::is_ascii_alphanumeric)
        .collect();
    let access = Access::parse(&word).or_else(|| match word.to_ascii_lowercase().as_str() {
        "r" | "read" | "readonly" => Some(Access::ReadOnly),
        "w" | "write" | "writeonly" => Some(Access::WriteOnly),
        "readwrite" => Some(Access::ReadWrite),
        _ => None,
    });
    match access {
        Some(access) => spelling(line, "AccessType", value, access.word(), findings),
        None => {
            let message =
                format!("AccessType is none of ro, wo, rw, rwr, rww, const: \"{}\"", shorten(value));
            findings.add(line, Rule::Value, message);
        }
    }
    access
}

fn mapping(line: u32, key: &str, value: &str, findings: &mut Findings) -> Option<PdoMapping> {
    match number::<u8>(line, key, value, findings)? {
        0 => Some(PdoMapping::No),
        number => {
            if number > 1 {
                spelling(line, key, value, "1", findings);
            }
            Some(PdoMapping::Optional)
        }
    }
}
