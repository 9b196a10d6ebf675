//! Backup files: TOML with device identity, versions and date, one line a parameter, made to be
//! edited by hand; and, for reading, plain text with number and value columns (decision 26).

use core::fmt::Write as _;
use std::collections::BTreeMap;
use std::path::Path;

use motion_core::parameters::{Entry, RangeError, ValueError, Values, get, iter};
use toml_edit::{Document, Item};

use crate::exit::Exit;
use crate::lb2::Identity;

/// Version of the file's format.
const FORMAT: i64 = 1;

/// Parameters, of a device or a file.
#[derive(Debug, Clone)]
pub(crate) struct Backup {
    /// Absent in plain text files.
    pub(crate) identity: Option<Identity>,
    /// By index; a value may be out of its parameter's range.
    pub(crate) values: BTreeMap<u16, i32>,
}

impl Backup {
    /// The values as far as they are in range, factory defaults elsewhere: for the decimal points.
    pub(crate) fn display(&self) -> Values {
        let mut values = Values::factory();
        for (&index, &value) in &self.values {
            // Out of range: the default's decimal point will do.
            let _ = values.set(index, value);
        }
        values
    }
}

pub(crate) fn write(path: &Path, backup: &Backup, changed: bool) -> Result<usize, Exit> {
    let display = backup.display();
    let mut text = String::from("# Parameters of a MotionController, by motionctl. Values may be edited.\n");
    let date = humantime::format_rfc3339_seconds(std::time::SystemTime::now());
    let _ = writeln!(text, "format = {FORMAT}\ndate = {date}\n");
    if let Some(identity) = &backup.identity {
        let _ = writeln!(
            text,
            "[device]\nmodel = {}\naxes = {}\nos_version = \"{}\"\ncustom_version = \"{}\"\n",
            identity.model, identity.axes, identity.os_version, identity.custom_version
        );
    }
    text.push_str("[parameters]\n");
    let mut count = 0;
    for (entry, value) in iter().filter_map(|entry| Some((entry, *backup.values.get(&entry.index())?))) {
        if changed && value == entry.default() {
            continue;
        }
        count += 1;
        let name = name(entry);
        let _ = match entry.choice(value) {
            Some(choice) => writeln!(
                text,
                "{:03} = {{ name = {name:?}, value = {value}, text = {:?} }}",
                entry.index(),
                choice.text
            ),
            None => {
                let shown = entry.format(value, &display).to_string();
                let shown = if shown.contains('.') { format!("{shown:?}") } else { shown };
                let unit = match entry.unit() {
                    "" => String::new(),
                    unit => format!(", unit = {unit:?}"),
                };
                writeln!(text, "{:03} = {{ name = {name:?}, value = {shown}{unit} }}", entry.index())
            }
        };
    }
    crate::output::write_beside(path, text.as_bytes())?;
    Ok(count)
}

/// `V max., Axis 1`
fn name(entry: Entry) -> String {
    entry.to_string().split_once("] ").map_or_else(String::new, |(_, name)| name.into())
}

pub(crate) fn read(path: &Path) -> Result<Backup, Exit> {
    let name = path.display().to_string();
    let text = std::fs::read(path).map_err(|error| Exit::file(&name, &error))?;
    // Old editors wrote Windows-1252; the digits that count are the same.
    let text = String::from_utf8(text)
        .unwrap_or_else(|error| error.into_bytes().iter().map(|&b| char::from(b)).collect());
    let toml = path.extension().is_some_and(|extension| extension == "toml")
        || text.lines().any(|line| line.trim() == "[parameters]");
    let backup = if toml { from_toml(&text) } else { from_columns(&text) };
    backup.map_err(|(at, message)| {
        let (line, column) = position(&text, at);
        Exit::trouble(format!("{name}, line {line}, column {column}: {message}"))
    })
}

/// Byte offset and what is wrong there.
type Fault = (usize, String);

fn position(text: &str, at: usize) -> (usize, usize) {
    let before = text.get(..at).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
    (line, column)
}

fn from_toml(text: &str) -> Result<Backup, Fault> {
    let document = Document::parse(text)
        .map_err(|error| (error.span().map_or(0, |span| span.start), error.message().to_string()))?;
    let at = |item: &Item| item.span().map_or(0, |span| span.start);
    match document.get("format") {
        Some(item) if item.as_integer() == Some(FORMAT) => {}
        Some(item) => return Err((at(item), format!("format {FORMAT} expected"))),
        None => return Err((0, format!("no line `format = {FORMAT}`: not a parameter backup"))),
    }
    let identity = match document.get("device") {
        Some(item) => Some(identity(item).map_err(|message| (at(item), message))?),
        None => None,
    };
    let parameters = document.get("parameters");
    let Some(table) = parameters.and_then(Item::as_table) else {
        return Err((0, "no section [parameters]".into()));
    };
    // The decimal points come first: they say how the other values are written.
    let mut values = BTreeMap::new();
    let mut display = Values::factory();
    for points in [true, false] {
        for (key, item) in table {
            let key_at = table.key(key).and_then(toml_edit::Key::span).map_or(at(item), |span| span.start);
            let index: u16 =
                key.parse().map_err(|_| (key_at, format!("{key:?}: a parameter number expected")))?;
            let entry = get(index).ok_or_else(|| (key_at, format!("there is no parameter [{index:03}]")))?;
            if points == (13..=31).contains(&index) {
                let value = value(text, entry, item, &display)?;
                if points {
                    display.set(index, value).map_err(|error| (at(item), error.to_string()))?;
                }
                values.insert(index, value);
            }
        }
    }
    Ok(Backup { identity, values })
}

fn identity(item: &Item) -> Result<Identity, String> {
    let table = item.as_table().ok_or("[device] must be a section")?;
    let number = |key| table.get(key).and_then(Item::as_integer);
    let string = |key: &str| table.get(key).and_then(Item::as_str).unwrap_or_default().to_string();
    Ok(Identity {
        model: number("model")
            .and_then(|n| u16::try_from(n).ok())
            .ok_or("model = 8230 or the like expected")?,
        axes: number("axes").and_then(|n| u8::try_from(n).ok()).unwrap_or(6),
        os_version: string("os_version"),
        custom_version: string("custom_version"),
    })
}

/// `{ name = …, value = …, text = … }`, or the value alone.
fn value(text: &str, entry: Entry, item: &Item, display: &Values) -> Result<i32, Fault> {
    let at = |item: &Item| item.span().map_or(0, |span| span.start);
    let table: Option<&dyn toml_edit::TableLike> = item.as_table_like();
    let value = match table {
        Some(table) => table.get("value").ok_or_else(|| (at(item), format!("{entry}: no value")))?,
        None => item,
    };
    // As written, so that no digit of a number with a decimal point is lost.
    let written = match value.as_str() {
        Some(string) => string,
        None => value.span().and_then(|span| text.get(span)).unwrap_or_default(),
    };
    let fault = |message: String| (at(value), message);
    let parsed = match entry.parse(written, display) {
        Ok(parsed) => parsed,
        // Values out of range are kept, for `compare` to name them and `restore` to refuse them.
        Err(ValueError::Range { value, .. }) => value.raw(),
        Err(ValueError::Choice(RangeError::Choice { value, .. })) => value,
        Err(error) => return Err(fault(error.to_string())),
    };
    if let (Some(said), Some(choice)) =
        (table.and_then(|table| table.get("text")).and_then(Item::as_str), entry.choice(parsed))
        && !choice.text.eq_ignore_ascii_case(said)
    {
        return Err(fault(format!("{entry}: choice {parsed} is {:?}, not {said:?}", choice.text)));
    }
    Ok(parsed)
}

/// Lines of number and value, or number, name and value, separated by tabs, semicolons, commas or
/// (two columns only) blanks. Lines that do not begin with a digit are headings.
fn from_columns(text: &str) -> Result<Backup, Fault> {
    let mut rows: Vec<(usize, Entry, &str)> = Vec::new();
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        let start = at;
        at += line.len();
        let line = line.trim().trim_start_matches('[');
        if !line.starts_with(|c: char| c.is_ascii_digit()) {
            continue;
        }
        let separator = ['\t', ';', ','].into_iter().find(|separator| line.contains(*separator));
        let columns: Vec<&str> = match separator {
            Some(separator) => line.split(separator).map(str::trim).collect(),
            None => line.split_whitespace().collect(),
        };
        let (number, value) = match columns.as_slice() {
            [number, value] => (number, value),
            [number, _, value, ..] if separator.is_some() => (number, value),
            _ => return Err((start, "a parameter number and a value expected".into())),
        };
        let index: u16 = number
            .trim_end_matches(']')
            .parse()
            .map_err(|_| (start, format!("{number:?}: a parameter number expected")))?;
        let entry = get(index).ok_or_else(|| (start, format!("there is no parameter [{index:03}]")))?;
        rows.push((start, entry, value));
    }
    if rows.is_empty() {
        return Err((0, "no line with a parameter number and a value: not a parameter file".into()));
    }
    let mut display = Values::factory();
    let mut values = BTreeMap::new();
    // Decimal points first, as in TOML files.
    rows.sort_by_key(|(_, entry, _)| !(13..=31).contains(&entry.index()));
    for (start, entry, written) in rows {
        let value = entry.parse(written, &display).map_err(|error| (start, error.to_string()))?;
        if (13..=31).contains(&entry.index()) {
            display.set(entry.index(), value).map_err(|error| (start, error.to_string()))?;
        }
        values.insert(entry.index(), value);
    }
    Ok(Backup { identity: None, values })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(text: &str) -> String {
        let (at, message) = from_toml(text).unwrap_err();
        let (line, column) = position(text, at);
        format!("{line}:{column} {message}")
    }

    #[test]
    fn what_is_written_is_read() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("b.toml");
        let mut values: BTreeMap<u16, i32> = iter().map(|entry| (entry.index(), entry.maximum())).collect();
        values.insert(930, -5);
        values.insert(26, 2);
        let identity =
            Identity { model: 8231, axes: 6, os_version: "5.15".into(), custom_version: "0.00".into() };
        let backup = Backup { identity: Some(identity.clone()), values: values.clone() };
        assert_eq!(write(&path, &backup, false).unwrap(), 606);
        let read = read(&path).unwrap();
        assert_eq!((read.identity, read.values), (Some(identity), values));
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains(
            "930 = { name = \"SW limit position +, Axis 1\", value = \"-0.05\", unit = \"user units\" }"
        ));
    }

    #[test]
    fn faults_have_a_place() {
        let head = "format = 1\n[device]\nmodel = 8230\n[parameters]\n";
        assert_eq!(
            fault(&format!("{head}642 = {{ value = 1.5 }}\n")),
            "5:17 [642] V max., Axis 1: at most 0 digits after the decimal point"
        );
        assert_eq!(fault(&format!("{head}050 = 1\n")), "5:1 there is no parameter [050]");
        assert_eq!(fault(&format!("{head}5 = {{ name = \"x\" }}\n")), "5:5 [005] Device number: no value");
        assert_eq!(
            fault(&format!("{head}1 = {{ value = 1, text = \"Deutsch\" }}\n")),
            "5:15 [001] Languages: choice 1 is \"English\", not \"Deutsch\""
        );
        assert!(fault(&format!("{head}642 = {{ value = \n")).starts_with("5:"));
        assert_eq!(fault("[parameters]\n"), "1:1 no line `format = 1`: not a parameter backup");
    }

    #[test]
    fn columns_are_read_too() {
        let text = "No;Name;Value\n0642;V max.;27350\n0026;Display decimal pnt.;1\n0780\t0\n";
        let read = from_columns(text).unwrap();
        assert_eq!(read.values, BTreeMap::from([(26, 1), (642, 273_500), (780, 0)]));
        assert_eq!(from_columns("642 1\n654 0.5\n").unwrap().values, BTreeMap::from([(642, 1), (654, 500)]));
        assert!(from_columns("hello\n").is_err());
        assert_eq!(position("a\nbc", 3), (2, 2));
    }
}
