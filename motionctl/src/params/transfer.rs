//! Writing parameters so that the device ends with all of the new values or all of the old ones.

use std::collections::BTreeMap;
use std::path::Path;

use motion_core::loader::{self, Finding};
use motion_core::parameters::{Entry, Values, get, iter};
use motion_io::lb2::Client;
use serde_json::json;

use super::file::{self, Backup};
use super::read;
use crate::cli::{Global, Line};
use crate::connect::connect;
use crate::exit::Exit;
use crate::lb2::Identity;
use crate::output::Output;

/// Writes, reads back, calls the loader, and saves if told to. If a step fails, the old values are put
/// back and the loader is called again.
pub(super) fn write(
    out: &Output,
    client: &mut Client,
    wanted: &[(Entry, i32)],
    old: &BTreeMap<u16, i32>,
    save: bool,
) -> Result<(), Exit> {
    let Err(exit) = attempt(out, client, wanted, save) else { return Ok(()) };
    // Backwards, so that of a parameter named twice the first old value is the last written.
    for (entry, _) in wanted.iter().rev() {
        let Some(&value) = old.get(&entry.index()) else { continue };
        if let Err(error) = client.write_parameter(entry.index(), value) {
            return Err(exit.context(&format!("{entry}: the old value could not be put back ({error})")));
        }
    }
    match client.call_loader() {
        Ok(None) => Err(exit.context("the old values were put back")),
        Ok(Some(index)) => {
            Err(exit
                .context(&format!("the old values were put back, the loader remarks parameter [{index:03}]")))
        }
        Err(error) => Err(exit.context(&format!("the old values were put back but not loaded ({error})"))),
    }
}

fn attempt(out: &Output, client: &mut Client, wanted: &[(Entry, i32)], save: bool) -> Result<(), Exit> {
    let bar = out.progress("writing", wanted.len());
    for &(entry, value) in wanted {
        let (code, text) = client
            .write_parameter(entry.index(), value)
            .map_err(|error| Exit::from(error).context(&entry.to_string()))?;
        if code.is_error() {
            return Err(Exit::refused(format!(
                "{entry}: the device refused {value}: {text} ({:02X}h)",
                code.0
            )));
        }
        if code.is_warning() {
            out.remark(format!("{entry}: {text}"));
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    let entries: Vec<Entry> = wanted.iter().map(|(entry, _)| *entry).collect();
    let found = read(out, client, &entries)?;
    let last: BTreeMap<u16, (Entry, i32)> =
        wanted.iter().map(|&(entry, value)| (entry.index(), (entry, value))).collect();
    for (entry, value) in last.values() {
        if found.get(&entry.index()) != Some(value) {
            return Err(Exit::check(format!("{entry}: {value} was written, another value read back")));
        }
    }
    if let Some(index) = client.call_loader()? {
        judge(out, client, index)?;
    }
    if save {
        client.save_parameters().map_err(|error| Exit::from(error).context("saving to flash"))?;
    }
    Ok(())
}

/// 34h names a parameter but not the reason: our own rules, on the device's values, say whether it is
/// more than a warning.
fn judge(out: &Output, client: &mut Client, index: i32) -> Result<(), Exit> {
    let entries: Vec<Entry> = iter().collect();
    let values = Backup { identity: None, values: read(out, client, &entries)? }.display();
    let mut reason: Option<Finding> = None;
    loader::check(&values, |finding| {
        if i32::from(finding.index) == index {
            reason.get_or_insert(finding);
        }
    });
    let name =
        u16::try_from(index).ok().and_then(get).map_or(format!("[{index}]"), |entry| entry.to_string());
    match reason {
        Some(finding) if finding.rule.code.is_warning() => {
            out.remark(format!("{name}: {}", finding.rule.message));
            Ok(())
        }
        Some(finding) => Err(Exit::refused(format!("the loader refused {}", finding.explain(&values)))),
        None => Err(Exit::refused(format!("the loader refused {name}"))),
    }
}

pub(super) fn restore(
    out: &Output,
    global: &Global,
    line: &Line,
    path: &Path,
    only: &[String],
    force: bool,
) -> Result<(), Exit> {
    let backup = file::read(path)?;
    let only: Vec<Entry> = only.iter().map(|key| super::entry(key)).collect::<Result<_, _>>()?;
    if let Some(missing) = only.iter().find(|entry| !backup.values.contains_key(&entry.index())) {
        return Err(Exit::usage(format!("{missing} is not in {}", path.display())));
    }
    let mut wanted: Vec<(Entry, i32)> = Vec::new();
    for (&index, &value) in &backup.values {
        let Some(entry) = get(index) else { continue };
        if !only.is_empty() && !only.contains(&entry) {
            continue;
        }
        if !entry.allows(value) {
            let range = format!("{} to {} expected", entry.minimum(), entry.maximum());
            return Err(Exit::check(format!(
                "{}: {entry}: {value} is out of range, {range}",
                path.display()
            )));
        }
        wanted.push((entry, value));
    }
    let mut client = connect(out, global, line)?;
    let device = Identity::read(&mut client)?;
    if let Some(identity) = &backup.identity
        && identity.model != device.model
        && !force
    {
        return Err(Exit::check(format!(
            "{} is of a GEL {}, the device is a GEL {}; --force restores it all the same",
            path.display(),
            identity.model,
            device.model
        )));
    }
    apply(out, global, &mut client, wanted, "restored")
}

pub(super) fn reset(out: &Output, global: &Global, line: &Line) -> Result<(), Exit> {
    let mut client = connect(out, global, line)?;
    let factory = iter().map(|entry| (entry, entry.default())).collect();
    apply(out, global, &mut client, factory, "reset to the factory defaults")
}

/// Writes what differs, saves it and verifies all.
fn apply(
    out: &Output,
    global: &Global,
    client: &mut Client,
    wanted: Vec<(Entry, i32)>,
    done: &str,
) -> Result<(), Exit> {
    let entries: Vec<Entry> = wanted.iter().map(|(entry, _)| *entry).collect();
    let old = read(out, client, &entries)?;
    let changes: Vec<(Entry, i32)> =
        wanted.iter().copied().filter(|(entry, value)| old.get(&entry.index()) != Some(value)).collect();
    let display = Backup { identity: None, values: old.clone() }.display();
    if global.dry_run {
        for (entry, value) in &changes {
            let before = old.get(&entry.index()).copied().unwrap_or(0);
            let (before, after) =
                (entry.format(before, &display), entry.format(*value, &new_display(&wanted)));
            out.say(&format!("would write {entry}: {before} -> {after}"));
        }
        let indices: Vec<u16> = changes.iter().map(|(entry, _)| entry.index()).collect();
        out.document(json!({ "dry_run": true, "write": indices }), || {
            println!("{} of {} parameters would be written, loaded and saved", changes.len(), wanted.len());
        });
        return Ok(());
    }
    if !changes.is_empty() {
        let question = format!("Write {} parameters to the device's flash?", changes.len());
        out.confirm_on_terminal(global.yes, &question)?;
    }
    write(out, client, &changes, &old, true)?;
    let found = read(out, client, &entries)?;
    if let Some((entry, value)) =
        wanted.iter().find(|(entry, value)| found.get(&entry.index()) != Some(value))
    {
        return Err(Exit::check(format!("verify failed: {entry} is not {value}")));
    }
    let (all, changed) = (wanted.len(), changes.len());
    out.document(json!({ "parameters": all, "written": changed, "saved": true, "verified": true }), || {
        println!("{all} parameters {done}: {changed} written, saved and verified");
    });
    Ok(())
}

fn new_display(wanted: &[(Entry, i32)]) -> Values {
    let values = wanted.iter().map(|(entry, value)| (entry.index(), *value)).collect();
    Backup { identity: None, values }.display()
}
