//! Command tables as TOML: of each entry its bytes, beside what they say for people (project-defined).

use std::collections::BTreeMap;
use std::path::Path;

use linmot::table::{ENTRIES, Entry, EntryError};
use toml_edit::{ArrayOfTables, Item, Table};

use super::text;
use crate::exit::Exit;
use crate::output::{counted, write_beside};

/// Entries by number.
pub(super) type Entries = BTreeMap<u16, Entry>;

/// Version of the files.
const FORMAT: i64 = 1;

pub(super) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

pub(super) fn parse(raw: &str) -> Result<Entry, String> {
    let digits: String = raw.chars().filter(|c| !c.is_whitespace()).collect();
    if let Some(other) = digits.chars().find(|c| !c.is_ascii_hexdigit()) {
        return Err(format!("hex digits expected, {other:?} found"));
    }
    let bytes: Option<Vec<u8>> =
        (0..digits.len()).step_by(2).map(|at| u8::from_str_radix(digits.get(at..at + 2)?, 16).ok()).collect();
    let bytes = bytes.ok_or_else(|| format!("hex digits in pairs expected, {} found", digits.len()))?;
    Entry::parse(&bytes).map_err(|error| match error {
        EntryError::Version(_) => {
            format!("{} at the beginning, 01A7 (version A701h) expected", hex(&bytes[..2]))
        }
        other => other.to_string(),
    })
}

pub(super) fn save(path: &Path, entries: &Entries) -> Result<(), Exit> {
    let mut document = toml_edit::DocumentMut::new();
    // First, so that a file that was cut off has no format or another number of entries.
    document.insert("entries", toml_edit::value(entries.len() as i64));
    document.insert("format", toml_edit::value(FORMAT));
    let mut list = ArrayOfTables::new();
    for (number, entry) in entries {
        let mut table = Table::new();
        table.insert("entry", toml_edit::value(i64::from(*number)));
        table.insert("name", toml_edit::value(text(entry.name())));
        if let Some(linked) = entry.linked() {
            table.insert("linked", toml_edit::value(i64::from(linked)));
        }
        table.insert("header", toml_edit::value(i64::from(entry.header())));
        table.insert("raw", toml_edit::value(hex(entry.bytes())));
        list.push(table);
    }
    document.insert("entry", Item::ArrayOfTables(list));
    write_beside(path, document.to_string().as_bytes())
}

/// Of each entry `raw` counts; name, link and header are there for people, and must not say anything else.
pub(super) fn load(path: &Path) -> Result<Entries, Exit> {
    let name = path.display().to_string();
    let content = std::fs::read_to_string(path).map_err(|error| Exit::file(&name, &error))?;
    let document: toml_edit::DocumentMut = content.parse().map_err(|error| Exit::file(&name, &error))?;
    let wrong = |what: &str| Exit::file(&name, &what);
    if document.get("format").and_then(Item::as_integer) != Some(FORMAT) {
        let found =
            document.get("format").map_or("nothing".into(), |item| item.to_string().trim().to_owned());
        return Err(wrong(&format!("no command table file: format = {FORMAT} expected, {found} found")));
    }
    known(&document, &["entries", "format", "entry"]).map_err(|error| wrong(&error))?;
    let list = match document.get("entry") {
        Some(item) => item.as_array_of_tables().ok_or_else(|| wrong("entry: [[entry]] expected"))?,
        None => &ArrayOfTables::new(),
    };
    let mut entries = Entries::new();
    for (position, table) in (1..).zip(list) {
        let number = table
            .get("entry")
            .and_then(Item::as_integer)
            .and_then(|number| u16::try_from(number).ok())
            .filter(|number| ENTRIES.contains(number))
            .ok_or_else(|| wrong(&format!("entry no. {position} of the file: entry = 1 to 255 expected")))?;
        let entry = entry(table).map_err(|error| wrong(&format!("entry {number}: {error}")))?;
        if entries.insert(number, entry).is_some() {
            return Err(wrong(&format!("entry {number} occurs twice")));
        }
    }
    match document.get("entries") {
        None if entries.is_empty() => Err(wrong(
            "it has no entries, so that a restore deletes all: entries = 0 in its head must say so",
        )),
        Some(said) if said.as_integer() != Some(entries.len() as i64) => Err(wrong(&format!(
            "entries = {} in its head, {} there: the file was cut off or changed",
            said.to_string().trim(),
            counted(entries.len(), "is", "are")
        ))),
        // Older files have no number.
        _ => Ok(entries),
    }
}

fn entry(table: &Table) -> Result<Entry, String> {
    known(table, &["entry", "name", "linked", "header", "raw"])?;
    let entry = parse(table.get("raw").and_then(Item::as_str).ok_or("raw = \"…\" expected")?)?;
    let name = text(entry.name());
    let linked = entry.linked().map(i64::from);
    let header = i64::from(entry.header());
    let says = |key| table.get(key).and_then(Item::as_integer);
    for (key, agrees, has) in [
        ("name", table.get("name").and_then(Item::as_str) == Some(&name), format!("{name:?}")),
        (
            "linked",
            linked.is_some() && says("linked") == linked,
            linked.map_or("none".into(), |to| to.to_string()),
        ),
        ("header", says("header") == Some(header), header.to_string()),
    ] {
        if let Some(item) = table.get(key)
            && !agrees
        {
            return Err(format!(
                "{key} = {} contradicts raw, which has {has}: raw is what counts, name, linked and header are \
                 there for people; change raw, or leave {key} out",
                item.to_string().trim()
            ));
        }
    }
    Ok(entry)
}

fn known(table: &Table, keys: &[&str]) -> Result<(), String> {
    match table.iter().find(|(key, _)| !keys.contains(key)) {
        Some((key, _)) => Err(format!("unknown key {key:?}, {} expected", keys.join(", "))),
        None => Ok(()),
    }
}
