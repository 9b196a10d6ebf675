//! `motionctl linmot table`.

use std::path::Path;

use linmot::code::Status;
use linmot::link::{Fault, LinkExt};
use linmot::request::Request;
use linmot::table::{Entry, LinkFault, Presence, check_links};
use serde_json::{Value, json};

use super::cli::{Drive, Table};
use super::connect::{AnyLink, connect};
use super::table_file::{self, Entries, hex, load, parse};
use super::{stopped, text};
use crate::cli::Global;
use crate::exit::Exit;
use crate::output::{Output, counted};

pub(super) fn run(out: &Output, global: &Global, command: &Table) -> Result<(), Exit> {
    match command {
        Table::List { drive } => {
            let entries = read(out, &mut connect(global, drive)?)?;
            show(out, &entries);
            Ok(())
        }
        Table::Get { drive, entry } => {
            let content = connect(global, drive)?.read_entry(*entry)?;
            show(out, &Entries::from([(*entry, content)]));
            Ok(())
        }
        Table::Set { drive, entry, raw } => set(out, global, drive, *entry, raw),
        Table::Delete { drive, entry } => {
            if out.only_plans(|| format!("would delete entry {entry} in RAM")) {
                return Ok(());
            }
            connect(global, drive)?.ask(Request::DeleteEntry { entry: *entry })?;
            out.document(json!({ "deleted": entry }), || println!("entry {entry} deleted in RAM"));
            Ok(())
        }
        Table::DeleteAll { drive } => {
            if out.only_plans(|| "would delete all entries in RAM".into()) {
                return Ok(());
            }
            out.confirm_on_terminal(global.yes, "Delete all command table entries in RAM?")?;
            connect(global, drive)?.ask(Request::ClearTable)?;
            out.document(json!({ "deleted": "all" }), || println!("no entries are left in RAM"));
            Ok(())
        }
        Table::Save { drive } => {
            if out.only_plans(|| "would save the command table to flash".into()) {
                return Ok(());
            }
            out.confirm(global.yes, "Stop the MC software and write the command table to flash?")?;
            stopped(&mut connect(global, drive)?, |link| Ok(link.ask(Request::SaveTable).map(|_| ())?))?;
            out.document(json!({ "saved": true }), || println!("the command table is in flash"));
            Ok(())
        }
        Table::Check { drive } => check(out, &read(out, &mut connect(global, drive)?)?),
        Table::Backup { drive, file } => backup(out, global, drive, file),
        Table::Restore { drive, file } => restore(out, global, drive, file),
        Table::Compare { drive, file } => compare(out, global, drive, file),
    }
}

fn entries_of(entries: &Entries) -> String {
    counted(entries.len(), "entry", "entries")
}

fn read(out: &Output, link: &mut AnyLink) -> Result<Entries, Exit> {
    let presence = link.presence()?;
    let bar = out.progress("reading", presence.iter().count());
    let mut entries = Entries::new();
    for entry in presence.iter() {
        entries.insert(entry, link.read_entry(entry)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(entries)
}

fn to_json(number: u16, entry: &Entry) -> Value {
    json!({
        "entry": number,
        "name": text(entry.name()),
        "linked": entry.linked(),
        "header": entry.header(),
        "raw": hex(entry.bytes()),
    })
}

fn show(out: &Output, entries: &Entries) {
    let json: Vec<Value> = entries.iter().map(|(number, entry)| to_json(*number, entry)).collect();
    out.document(json!({ "entries": json }), || {
        if entries.is_empty() {
            println!("no entries");
        }
        for (number, entry) in entries {
            let linked = entry.linked().map_or(String::new(), |linked| format!(" -> {linked}"));
            println!("{number:3}{linked}  {:04X}h  {}", entry.header(), text(entry.name()));
            println!("     {}", hex(entry.parameters()));
        }
    });
}

fn set(out: &Output, global: &Global, drive: &Drive, number: u16, raw: &str) -> Result<(), Exit> {
    let entry = parse(raw).map_err(|error| Exit::usage(format!("--raw: {error}")))?;
    if out.only_plans(|| format!("would write entry {number} in RAM")) {
        return Ok(());
    }
    let mut link = connect(global, drive)?;
    write(&mut link, number, &entry)?;
    out.remark(format!("entry {number} is in RAM, `table save` writes all to flash"));
    show(out, &Entries::from([(number, entry)]));
    Ok(())
}

fn write(link: &mut AnyLink, number: u16, entry: &Entry) -> Result<(), Exit> {
    if let Err(fault) = link.write_entry(number, entry) {
        let now = match link.read_entry(number) {
            Ok(found) if found == *entry => "is there as it was to be",
            Ok(_) => "is another one than was to be written",
            Err(Fault::Refused { reply, .. }) if reply.status == Status::DEFINED => "does not exist",
            Err(_) => "may be written, perhaps in part",
        };
        return Err(Exit::from(fault).context(&format!("entry {number} in RAM {now}")));
    }
    if link.read_entry(number)? != *entry {
        return Err(Exit::check(format!("entry {number}: other bytes were read back than written")));
    }
    Ok(())
}

/// Links that lead nowhere, and loops.
fn links(entries: &Entries) -> (Vec<LinkFault>, Vec<LinkFault>) {
    let mut presence = Presence::default();
    entries.keys().for_each(|entry| presence.set(*entry, true));
    let mut found = Vec::new();
    let linked = |entry| entries.get(&entry).and_then(Entry::linked);
    check_links(&presence, linked, |fault| found.push(fault));
    found.into_iter().partition(|fault| matches!(fault, LinkFault::Missing { .. }))
}

/// Links that lead nowhere are told and kept: what a backup has, a restore brings back.
fn remark_missing(out: &Output, entries: &Entries) {
    links(entries).0.iter().for_each(|fault| out.remark(fault.to_string()));
}

fn check(out: &Output, entries: &Entries) -> Result<(), Exit> {
    // A loop may be what the machine is meant to do; a missing entry never is.
    let (missing, loops) = links(entries);
    let json = |fault: &LinkFault| match fault {
        LinkFault::Missing { entry, linked } => {
            json!({ "entry": entry, "fault": "missing", "linked": linked, "message": fault.to_string() })
        }
        LinkFault::Loop { entry, length } => {
            json!({ "entry": entry, "length": length, "message": fault.to_string() })
        }
        _ => json!({ "message": fault.to_string() }),
    };
    let [faults, notes] = [&missing, &loops].map(|list| list.iter().map(json).collect::<Vec<Value>>());
    out.document(json!({ "entries": entries.len(), "faults": faults, "loops": notes }), || {
        missing.iter().for_each(|fault| println!("{fault}"));
        loops.iter().for_each(|note| println!("note: {note}"));
        println!(
            "{}, {}, {}",
            entries_of(entries),
            counted(missing.len(), "fault", "faults"),
            counted(loops.len(), "loop", "loops")
        );
    });
    match missing.as_slice() {
        [] => Ok(()),
        [fault] => Err(Exit::check(fault.to_string())),
        [first, rest @ ..] => Err(Exit::check(format!("{first}; and {} more", rest.len()))),
    }
}

fn backup(out: &Output, global: &Global, drive: &Drive, path: &Path) -> Result<(), Exit> {
    let entries = read(out, &mut connect(global, drive)?)?;
    let name = path.display().to_string();
    remark_missing(out, &entries);
    if out.only_plans(|| format!("would write {} to {name}", entries_of(&entries))) {
        return Ok(());
    }
    table_file::save(path, &entries)?;
    out.document(json!({ "file": name, "entries": entries.len() }), || {
        println!("{} written to {name}", entries_of(&entries));
    });
    Ok(())
}

fn restore(out: &Output, global: &Global, drive: &Drive, path: &Path) -> Result<(), Exit> {
    let entries = load(path)?;
    remark_missing(out, &entries);
    let mut link = connect(global, drive)?;
    let present = link.presence()?;
    let extra: Vec<u16> = present.iter().filter(|entry| !entries.contains_key(entry)).collect();
    let count = entries_of(&entries);
    let numbers = extra.iter().map(u16::to_string).collect::<Vec<_>>().join(", ");
    let not_in_file =
        if entries.is_empty() { "all that the drive has" } else { "which the file does not have" };
    let deletes = |verb: &str| match extra.len() {
        0 => String::new(),
        1 => format!("; entry {numbers}, {not_in_file}, {verb}"),
        _ => format!("; entries {numbers}, {not_in_file}, {verb}"),
    };
    if global.dry_run {
        let plan = format!("would write {count} to RAM and flash{}", deletes("would be deleted"));
        out.document(json!({ "dry_run": true, "plan": plan, "deleted": extra }), || println!("{plan}"));
        return Ok(());
    }
    out.confirm(
        global.yes,
        &format!(
            "Stop the MC software and write the command table, {count}, to RAM and flash{}?",
            deletes("will be deleted")
        ),
    )?;
    let (mut deleted, mut written) = (0, 0);
    let restored = stopped(&mut link, |link| {
        for &entry in &extra {
            link.ask(Request::DeleteEntry { entry })?;
            deleted += 1;
        }
        let bar = out.progress("writing", entries.len());
        for (number, entry) in &entries {
            write(link, *number, entry)?;
            written += 1;
            bar.inc(1);
        }
        bar.finish_and_clear();
        link.ask(Request::SaveTable)?;
        Ok(())
    });
    restored.map_err(|exit| {
        let others = counted(deleted, "other", "others");
        exit.context(&format!(
            "{written} of {count} written and {others} deleted in RAM, the same restore completes it"
        ))
    })?;
    out.document(json!({ "entries": entries.len(), "deleted": extra, "saved": true }), || {
        println!("{count} written to RAM and flash{}", deletes("deleted"));
    });
    Ok(())
}

fn compare(out: &Output, global: &Global, drive: &Drive, path: &Path) -> Result<(), Exit> {
    let wanted = load(path)?;
    let found = read(out, &mut connect(global, drive)?)?;
    let numbers = |from: &Entries, other: &Entries| -> Vec<u16> {
        from.keys().filter(|number| !other.contains_key(number)).copied().collect()
    };
    let (missing, extra) = (numbers(&wanted, &found), numbers(&found, &wanted));
    let different: Vec<u16> = wanted
        .iter()
        .filter(|(number, entry)| found.get(number).is_some_and(|other| other != *entry))
        .map(|(number, _)| *number)
        .collect();
    let equal = wanted.len() - missing.len() - different.len();
    let json = json!({ "equal": equal, "different": different, "only_file": missing, "only_drive": extra });
    out.document(json, || {
        different.iter().for_each(|entry| println!("entry {entry} differs"));
        missing.iter().for_each(|entry| println!("entry {entry} is not in the drive"));
        extra.iter().for_each(|entry| println!("entry {entry} is not in the file"));
        println!("{equal} equal");
    });
    if different.is_empty() && missing.is_empty() && extra.is_empty() {
        Ok(())
    } else {
        Err(Exit::check("file and drive differ"))
    }
}
