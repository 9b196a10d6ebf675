//! Changes of a [`Device`] written into the EDS or DCF text that it was read from.

use alloc::borrow::ToOwned;
use alloc::collections::{BTreeMap, BTreeSet};
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use super::ini::{Document, LineKind, Section as Lines};
use super::model::{Device, Fields, Section};
use super::name::{ModulePart, Name, Part};
use super::writer::{put_entry, put_section, sections};

/// Which objects are written whole.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Whole {
    /// Those that change and whose lists say anything else than we would write there: a list holds for
    /// the object's other sections too.
    ListsDiffer,
    /// All that change.
    Changed,
}

/// Writes the changes between two states of a device into the text that the first one was read from.
/// Every line that no change concerns stays as it is. Sections that contradict each other can make the
/// result say something else.
pub(crate) fn update(text: &str, before: &Device, after: &Device, whole: Whole) -> String {
    let document = Document::parse(text);
    let end = if text.contains("\r\n") { "\r\n" } else { "\n" };
    let before = by_name(sections(before));
    let after = sections(after);
    let order: Vec<String> = after.iter().map(|section| canonical(&section.name)).collect();
    let after = by_name(after);
    let changed = changed(&before, &after);
    let whole = match whole {
        Whole::ListsDiffer => with_other_lists(&document, &before, &changed),
        Whole::Changed => changed,
    };
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

/// The objects whose sections change.
fn changed(before: &BTreeMap<String, Section>, after: &BTreeMap<String, Section>) -> BTreeSet<String> {
    let names = before.keys().chain(after.keys()).filter(|name| before.get(*name) != after.get(*name));
    names.filter_map(|name| owner(name)).map(|(owner, _)| owner).collect()
}

/// Those of the objects whose lists in the file say anything else than we would write there.
fn with_other_lists(
    document: &Document<'_>,
    before: &BTreeMap<String, Section>,
    objects: &BTreeSet<String>,
) -> BTreeSet<String> {
    let mut lists: BTreeMap<String, Fields> = BTreeMap::new();
    for section in document.sections.iter().filter(|section| section.line != 0) {
        let Some((owner, true)) = owner(section.name) else { continue };
        if objects.contains(&owner) {
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
    use super::super::model::{Entry, Object};
    use super::super::{DCF, read};

    #[test]
    fn an_unchanged_device_leaves_the_text_as_it_is() {
        let reading = read(DCF.as_bytes()).unwrap();
        assert_eq!(reading.update(&reading.device), DCF);
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
        let text = reading.update(&changed);
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
                let text = reading.update(&changed);
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
        let text = reading.update(&changed);
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
        let text = reading.update(&changed);
        assert_eq!(read(text.as_bytes()).unwrap().device, changed, "{text}");
        assert!(text.starts_with("; made by hand\n[DeviceInfo]\nVendorName = Ä # kept\n"), "{text}");
        assert!(!text.contains("[1017]"), "{text}");
    }

    /// Found by fuzzing: a count that is no number was replaced by the one that the change needs.
    #[test]
    fn an_entry_that_says_nothing_outlasts_a_change_that_needs_its_key() {
        let dcf = "; kept\n[1200]\nParameterName=a\nSubNumber=\nCompactSubObj=2\n";
        let reading = read(dcf.as_bytes()).unwrap();
        let mut changed = reading.device.clone();
        changed.object_mut(0x1200).unwrap().entry_mut(0).unwrap().value = Some("0x12".into());
        let text = reading.update(&changed);
        assert_eq!(read(text.as_bytes()).unwrap().device, changed, "{text}");
    }
}
