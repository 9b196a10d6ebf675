//! `motionctl params …`: parameters by number or name, backup, compare, restore.

mod compare;
mod file;
mod transfer;

use std::collections::BTreeMap;

use motion_core::parameters::{Entry, Values, find, iter};
use motion_io::lb2::Client;
use serde_json::{Value, json};

use crate::cli::{Global, Line, Params};
use crate::connect::{connect, remarks};
use crate::exit::Exit;
use crate::lb2::Identity;
use crate::output::Output;
use file::Backup;

pub(crate) fn run(out: &Output, global: &Global, command: &Params) -> Result<(), Exit> {
    match command {
        Params::List { line, changed } => list(out, global, line, *changed),
        Params::Get { line, keys } => get(out, global, line, keys),
        Params::Set { line, pairs, save } => set(out, global, line, pairs, *save),
        Params::Backup { line, file, changed } => backup(out, global, line, file, *changed),
        Params::Compare { line, file, second } => {
            let there = file::read(file)?;
            let here = match second {
                Some(second) => file::read(second)?,
                None => {
                    let mut client = connect(out, global, line)?;
                    let wanted: Vec<Entry> = iter().collect();
                    Backup {
                        identity: Some(Identity::read(&mut client)?),
                        values: read(out, &mut client, &wanted)?,
                    }
                }
            };
            // Of two files the first is here; of device and file, the device.
            let (here, there) = if second.is_some() { (there, here) } else { (here, there) };
            compare::run(out, &here, &there)
        }
        Params::Restore { line, file, only, force } => {
            transfer::restore(out, global, line, file, only, *force)
        }
        Params::Reset { line, image: true, .. } => {
            let _ = line;
            Err(Exit::usage(
                "LB2 has no function to recall the parameter image: recall it at the device (menu Configuration, \
                 Factory defaults), or restore a backup",
            ))
        }
        Params::Reset { line, .. } => transfer::reset(out, global, line),
    }
}

/// The parameter of this number or name.
pub(crate) fn entry(key: &str) -> Result<Entry, Exit> {
    find(key).map_err(|error| Exit::usage(error.to_string()))
}

fn read(out: &Output, client: &mut Client, entries: &[Entry]) -> Result<BTreeMap<u16, i32>, Exit> {
    let bar = out.progress("reading", entries.len());
    let mut values = BTreeMap::new();
    for entry in entries {
        let value = client
            .read_parameter(entry.index())
            .map_err(|error| Exit::from(error).context(&entry.to_string()))?;
        values.insert(entry.index(), value);
        bar.inc(1);
    }
    bar.finish_and_clear();
    remarks(out, client);
    Ok(values)
}

/// The decimal points that the device displays `entries` with.
fn display(out: &Output, client: &mut Client, entries: &[Entry]) -> Result<Values, Exit> {
    let points = |entry: &Entry| match entry.row().kind {
        motion_core::parameters::Kind::Value {
            decimals: motion_core::parameters::Decimals::As(first),
            ..
        } => motion_core::parameters::get(first + entry.instance() as u16),
        _ => None,
    };
    let wanted: Vec<Entry> = entries.iter().filter_map(points).collect();
    let values = read(out, client, &wanted)?;
    Ok(Backup { identity: None, values }.display())
}

fn to_json(entry: Entry, value: i32, display: &Values) -> Value {
    json!({
        "index": entry.index(),
        "name": entry.name(),
        "group": entry.group(),
        "menu": entry.menu().collect::<Vec<_>>().join("/"),
        "value": value,
        "text": entry.format(value, display).to_string(),
        "unit": entry.unit(),
        "minimum": entry.minimum(),
        "maximum": entry.maximum(),
        "default": entry.default(),
    })
}

fn show(entry: Entry, value: i32, display: &Values) {
    let text = entry.format(value, display).to_string();
    match (entry.choices().is_empty(), entry.unit()) {
        (true, unit) => println!("{entry}: {text} {unit}"),
        (false, _) => println!("{entry}: {value} {text}"),
    }
}

fn print(out: &Output, values: &BTreeMap<u16, i32>, display: &Values) {
    let shown: Vec<(Entry, i32)> = values
        .iter()
        .filter_map(|(&index, &value)| Some((motion_core::parameters::get(index)?, value)))
        .collect();
    let list: Vec<Value> = shown.iter().map(|&(entry, value)| to_json(entry, value, display)).collect();
    out.document(json!({ "parameters": list }), || {
        let mut last = String::new();
        for &(entry, value) in &shown {
            let menu = entry.menu().collect::<Vec<_>>().join("/");
            if shown.len() > 20 && menu != last {
                println!("\n{menu}");
                last = menu;
            }
            show(entry, value, display);
        }
    });
}

fn list(out: &Output, global: &Global, line: &Line, changed: bool) -> Result<(), Exit> {
    let mut entries: Vec<Entry> = iter().collect();
    entries.sort_by_key(|entry| (entry.menu().collect::<Vec<_>>(), entry.index()));
    let mut values: BTreeMap<u16, i32> = match line.port {
        Some(_) => read(out, &mut connect(out, global, line)?, &entries)?,
        None => entries.iter().map(|entry| (entry.index(), entry.default())).collect(),
    };
    let display = Backup { identity: None, values: values.clone() }.display();
    if changed {
        for entry in entries {
            if values.get(&entry.index()) == Some(&entry.default()) {
                values.remove(&entry.index());
            }
        }
    }
    print(out, &values, &display);
    Ok(())
}

fn get(out: &Output, global: &Global, line: &Line, keys: &[String]) -> Result<(), Exit> {
    let entries: Vec<Entry> = keys.iter().map(|key| entry(key)).collect::<Result<_, _>>()?;
    let mut client = connect(out, global, line)?;
    let values = read(out, &mut client, &entries)?;
    let display = display(out, &mut client, &entries)?;
    print(out, &values, &display);
    Ok(())
}

fn set(out: &Output, global: &Global, line: &Line, pairs: &[String], save: bool) -> Result<(), Exit> {
    let (pairs, rest) = pairs.as_chunks::<2>();
    if let [key] = rest {
        return Err(Exit::usage(format!("{key}: a value is missing; KEY VALUE [KEY VALUE…] expected")));
    }
    let entries: Vec<Entry> = pairs.iter().map(|[key, _]| entry(key)).collect::<Result<_, _>>()?;
    // What is wrong with any display setting is wrong before the port is opened.
    for (entry, [_, text]) in entries.iter().zip(pairs) {
        if entry.decimals(&Values::factory()) > 0 || !entry.choices().is_empty() {
            entry.parse(text, &Values::factory()).map_err(|error| Exit::usage(error.to_string()))?;
        }
    }
    let mut client = connect(out, global, line)?;
    let display = display(out, &mut client, &entries)?;
    let mut wanted = Vec::new();
    for (entry, [_, text]) in entries.iter().zip(pairs) {
        wanted.push((*entry, entry.parse(text, &display).map_err(|error| Exit::usage(error.to_string()))?));
    }
    let old = read(out, &mut client, &entries)?;
    if global.dry_run {
        let line = |(entry, value): &(Entry, i32)| {
            let before = old.get(&entry.index()).copied().unwrap_or(0);
            let (before, after) = (entry.format(before, &display), entry.format(*value, &display));
            format!("would set {entry}: {before} -> {after}")
        };
        out.plan(&wanted.iter().map(line).collect::<Vec<_>>().join("\n"));
        return Ok(());
    }
    if save {
        out.confirm_on_terminal(global.yes, "Save the parameters to the device's flash?")?;
    }
    transfer::write(out, &mut client, &wanted, &old, save)?;
    let values = wanted.iter().map(|(entry, value)| (entry.index(), *value)).collect();
    print(out, &values, &display);
    Ok(())
}

fn backup(
    out: &Output,
    global: &Global,
    line: &Line,
    path: &std::path::Path,
    changed: bool,
) -> Result<(), Exit> {
    let mut client = connect(out, global, line)?;
    let identity = Identity::read(&mut client)?;
    let entries: Vec<Entry> = iter().collect();
    let (count, model, path_name) = (entries.len(), identity.model, path.display());
    if out.only_plans(|| format!("would back up {count} parameters of a GEL {model} to {path_name}")) {
        return Ok(());
    }
    let values = read(out, &mut client, &entries)?;
    let model = identity.model;
    let count = file::write(path, &Backup { identity: Some(identity), values }, changed)?;
    let name = path.display().to_string();
    out.document(json!({ "file": name, "model": model, "parameters": count }), || {
        println!("{count} parameters of GEL {model} written to {name}");
    });
    Ok(())
}
