//! EDS and DCF text to [`Device`].

use alloc::borrow::ToOwned;
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use super::Format;
use super::diagnostic::{Diagnostic, Rule};
use super::ini::{Document, LineKind, Section as Lines};
use super::model::{Device, Fields, Module, Section, strip_prefix};
use super::name::{ModulePart, Name};
use super::objects::Builder;
use super::types::List;
use super::value::Number;

/// Collects findings.
#[derive(Debug)]
pub(crate) struct Findings {
    pub(crate) list: Vec<Diagnostic>,
    pub(crate) format: Format,
}

/// What nobody reads to the end; a file of nothing but damage would fill the memory.
const MOST_FINDINGS: usize = 100_000;

impl Findings {
    pub(crate) fn add(&mut self, line: u32, rule: Rule, message: impl Into<String>) {
        let format = self.format;
        match self.list.len() {
            ..MOST_FINDINGS => self.list.push(Diagnostic { line, rule, format, message: message.into() }),
            MOST_FINDINGS => {
                let message = format!("more than {MOST_FINDINGS} findings; no more are listed");
                self.list.push(Diagnostic { line, rule: Rule::Line, format, message });
            }
            _ => {}
        }
    }
}

/// Reads whatever can be read and says what could not.
pub(crate) fn read(document: &Document<'_>, findings: &mut Findings) -> Device {
    let mut device = Device::default();
    let mut main = Builder::default();
    let mut lists = Lists::default();
    let mut modules: BTreeMap<u16, ModuleBuilder<'_>> = BTreeMap::new();
    let mut others = Others::default();
    let (mut file_info, mut device_info) = (0, 0);
    for section in &document.sections {
        odd_lines(section, findings);
        if section.line == 0 {
            continue;
        }
        match Name::parse(section.name) {
            Name::Object(index, part) => main.add(index, part, section, findings),
            Name::FileInfo => {
                note_repeated(&mut file_info, section, findings);
                fields(section, &mut device.file_info, findings);
            }
            Name::DeviceInfo => {
                note_repeated(&mut device_info, section, findings);
                fields(section, &mut device.device_info, findings);
            }
            Name::Commissioning(standard) => {
                if !standard {
                    let message = "the section's name in the standard is [DeviceComissioning], with one m";
                    findings.add(section.line, Rule::Commissioning, message);
                }
                fields(section, &mut device.commissioning, findings);
            }
            Name::DummyUsage => fields(section, &mut device.dummy_usage, findings),
            Name::Comments => comments(section, &mut device.comments, findings),
            Name::List(list) => lists.add(list, section, findings),
            Name::Module(number, part) => modules.entry(number).or_default().add(part, section, findings),
            Name::Other => others.add(section, findings),
        }
    }
    for (name, line) in [("FileInfo", file_info), ("DeviceInfo", device_info)] {
        if line == 0 {
            findings.add(0, Rule::MissingSection, format!("section [{name}] is missing"));
        }
    }
    let (objects, leftover) = main.finish(findings);
    device.objects = objects;
    device.other = others.sections;
    device.other.extend(leftover);
    lists.apply(&mut device, &main, findings);
    for (number, module) in modules {
        let (module, leftover) = module.finish(number, findings);
        device.modules.push(module);
        device.other.extend(leftover);
    }
    device
}

fn note_repeated(seen: &mut u32, section: &Lines<'_>, findings: &mut Findings) {
    if *seen != 0 {
        repeated(section, *seen, findings);
    }
    *seen = section.line;
}

pub(crate) fn repeated(section: &Lines<'_>, first: u32, findings: &mut Findings) {
    let message = format!("[{}] is there already; its entries are joined", section.name);
    let message = if first > 0 { format!("{message} with those of line {first}") } else { message };
    findings.add(section.line, Rule::DuplicateSection, message);
}

/// Lines that are no entries where only entries should be.
fn odd_lines(section: &Lines<'_>, findings: &mut Findings) {
    for line in &section.lines {
        match line.kind {
            LineKind::Other => {
                let text = shorten(line.raw.trim());
                findings.add(
                    line.number,
                    Rule::Line,
                    format!("neither section, entry nor comment: \"{text}\""),
                );
            }
            LineKind::Section { rest, .. } if !rest.is_empty() => {
                let message = format!("\"{}\" after the section's name is passed over", shorten(rest));
                findings.add(line.number, Rule::Header, message);
            }
            LineKind::Section { name, .. }
                if name.get(..4).is_some_and(|head| head.bytes().all(|b| b.is_ascii_hexdigit()))
                    && Name::parse(name) == Name::Other =>
            {
                let message = format!("[{name}] looks like an object's section and is none");
                findings.add(line.number, Rule::Header, message);
            }
            LineKind::Entry { key, .. } if section.line == 0 => {
                findings.add(
                    line.number,
                    Rule::Line,
                    format!("\"{}\" stands before the first section", shorten(key)),
                );
            }
            _ => {}
        }
    }
}

/// The entries of a section of which the keys are not interpreted.
pub(crate) fn fields(section: &Lines<'_>, into: &mut Fields, findings: &mut Findings) {
    for (line, key, value) in section.entries() {
        if into.set(key, value) {
            duplicate(line, key, findings);
        }
    }
}

pub(crate) fn duplicate(line: u32, key: &str, findings: &mut Findings) {
    findings.add(line, Rule::DuplicateKey, format!("{} is there already; this one counts", shorten(key)));
}

/// Sections that have no meaning here, in the order of the file.
#[derive(Default)]
struct Others {
    sections: Vec<Section>,
    /// By name in lower case.
    places: BTreeMap<String, usize>,
}

impl Others {
    fn add(&mut self, section: &Lines<'_>, findings: &mut Findings) {
        let at = *self.places.entry(section.name.to_ascii_lowercase()).or_insert(self.sections.len());
        if at == self.sections.len() {
            self.sections.push(Section { name: section.name.to_owned(), fields: Fields::default() });
        } else {
            repeated(section, 0, findings);
        }
        if let Some(place) = self.sections.get_mut(at) {
            fields(section, &mut place.fields, findings);
        }
    }
}

/// `Lines=n`, `Line1=…`: the lines in the order of their numbers.
fn comments(section: &Lines<'_>, into: &mut Vec<String>, findings: &mut Findings) {
    let mut lines: BTreeMap<u32, &str> = BTreeMap::new();
    let mut declared = None;
    for (line, key, value) in section.entries() {
        if key.eq_ignore_ascii_case("Lines") {
            declared = Some((line, Number::parse(value)));
        } else if let Some(number) = strip_prefix(key, "Line").and_then(|number| number.parse().ok()) {
            if lines.insert(number, value).is_some() {
                duplicate(line, key, findings);
            }
        } else {
            findings.add(line, Rule::Comments, format!("{} is no line of comment", shorten(key)));
        }
    }
    let (line, count) = declared.unwrap_or((section.line, None));
    if count.map(|count| count.value) != i128::try_from(lines.len()).ok() {
        let declared = count.map_or_else(|| "does not say".into(), |count| format!("says {}", count.value));
        findings.add(line, Rule::Comments, format!("Lines {declared}, {} lines are there", lines.len()));
    }
    into.extend(lines.into_values().map(ToOwned::to_owned));
}

/// A counted list of indices: `SupportedObjects=2`, `1=0x1000`, `2=0x1001`.
pub(crate) fn indices(
    section: &Lines<'_>,
    count_key: &str,
    rule: Rule,
    findings: &mut Findings,
) -> Vec<(u32, u16)> {
    let mut found: BTreeMap<u32, (u32, u16)> = BTreeMap::new();
    let mut declared = None;
    for (line, key, value) in section.entries() {
        if key.eq_ignore_ascii_case(count_key) {
            declared = Some((line, Number::parse(value)));
        } else if let Ok(position) = key.parse() {
            let number = Number::parse(value);
            match number.and_then(|number| u16::try_from(number.value).ok()) {
                Some(index) => {
                    if found.insert(position, (line, index)).is_some() {
                        duplicate(line, key, findings);
                    }
                }
                None => {
                    let message =
                        format!("entry {key} of [{}] is no index: \"{}\"", section.name, shorten(value));
                    findings.add(line, rule, message);
                }
            }
        } else {
            findings.add(line, rule, format!("{} does not belong into [{}]", shorten(key), section.name));
        }
    }
    let (line, count) = declared.unwrap_or((section.line, None));
    if count.map(|count| count.value) != i128::try_from(found.len()).ok() {
        let declared = count.map_or_else(|| "is missing".into(), |count| format!("says {}", count.value));
        findings.add(
            line,
            rule,
            format!("{count_key} of [{}] {declared}, {} are listed", section.name, found.len()),
        );
    }
    found.into_values().collect()
}

/// The three lists of objects.
#[derive(Default)]
struct Lists {
    by_index: BTreeMap<u16, (List, u32)>,
    seen: Vec<List>,
}

impl Lists {
    fn add(&mut self, list: List, section: &Lines<'_>, findings: &mut Findings) {
        if self.seen.contains(&list) {
            repeated(section, 0, findings);
        }
        self.seen.push(list);
        for (line, index) in indices(section, "SupportedObjects", Rule::ListCount, findings) {
            if let Some((_, first)) = self.by_index.insert(index, (list, line)) {
                findings.add(line, Rule::List, format!("{index:04X}h is listed already in line {first}"));
            }
        }
    }

    fn apply(mut self, device: &mut Device, sections: &Builder<'_>, findings: &mut Findings) {
        for list in List::ALL {
            if !self.seen.contains(&list) {
                findings.add(0, Rule::MissingSection, format!("section [{list}] is missing"));
            }
        }
        for object in &mut device.objects {
            match self.by_index.remove(&object.index) {
                Some((list, _)) => object.list = list,
                // Without any list, the missing sections say it all.
                None if self.seen.is_empty() => {}
                None => {
                    let message = format!(
                        "{:04X}h is in none of the lists; taken as of [{}]",
                        object.index, object.list
                    );
                    findings.add(sections.line(object.index), Rule::List, message);
                }
            }
        }
        for (index, (list, line)) in self.by_index {
            findings.add(
                line,
                Rule::List,
                format!("[{list}] names {index:04X}h, and there is no section [{index:04X}]"),
            );
        }
    }
}

#[derive(Default)]
struct ModuleBuilder<'a> {
    module: Module,
    fixed: Builder<'a>,
    extends: Builder<'a>,
    lists: [Vec<(u32, u16)>; 2],
}

impl<'a> ModuleBuilder<'a> {
    fn add(&mut self, part: ModulePart, section: &'a Lines<'a>, findings: &mut Findings) {
        let [fixed, extends] = &mut self.lists;
        match part {
            ModulePart::Info => fields(section, &mut self.module.info, findings),
            ModulePart::Comments => comments(section, &mut self.module.comments, findings),
            ModulePart::FixedObjects => {
                fixed.extend(indices(section, "NrOfEntries", Rule::Modules, findings));
            }
            ModulePart::SubExtends => {
                extends.extend(indices(section, "NrOfEntries", Rule::Modules, findings));
            }
            ModulePart::Fixed(index, part) => self.fixed.add(index, part, section, findings),
            ModulePart::SubExt(index, part) => self.extends.add(index, part, section, findings),
        }
    }

    fn finish(mut self, number: u16, findings: &mut Findings) -> (Module, Vec<Section>) {
        let (fixed, mut leftover) = self.fixed.finish(findings);
        let (extends, more) = self.extends.finish(findings);
        leftover.extend(more);
        for (list, builder, objects, kind) in [
            (&self.lists[0], &self.fixed, &fixed, "Fixed"),
            (&self.lists[1], &self.extends, &extends, "SubExt"),
        ] {
            for &(line, index) in list {
                if objects.binary_search_by_key(&index, |object| object.index).is_err() {
                    let message = format!("there is no section [M{number}{kind}{index:04X}]");
                    findings.add(line, Rule::Modules, message);
                }
            }
            let listed: BTreeSet<u16> = list.iter().map(|(_, index)| *index).collect();
            for object in objects.iter().filter(|object| !listed.contains(&object.index)) {
                let message = format!("[M{number}{kind}{:04X}] is in no list", object.index);
                findings.add(builder.line(object.index), Rule::Modules, message);
            }
        }
        self.module.number = number;
        self.module.fixed = fixed;
        self.module.extends = extends;
        (self.module, leftover)
    }
}

/// At most 40 characters of a text, for a message.
pub(crate) fn shorten(text: &str) -> &str {
    text.char_indices().nth(40).map_or(text, |(at, _)| text.get(..at).unwrap_or_default())
}
