//! `motionctl can dcf NODE FILE`: a configuration, written to a node.

use std::path::Path;

use canopen_master::eds::{self, ConciseEntry, Reading, Severity};
use canopen_master::sdo::Outcome;
use canopen_master::{Address, NodeId};
use serde_json::json;

use super::cli::CanLine;
use super::sdo::tell;
use super::session::{Session, TransferError, node_id};
use super::value::hex;
use crate::cli::Global;
use crate::exit::Exit;
use crate::output::Output;

pub(crate) fn run(out: &Output, global: &Global, line: &CanLine, node: u8, file: &Path) -> Result<(), Exit> {
    let name = file.display().to_string();
    let bytes = crate::eds::bytes(file)?;
    let (entries, reading) = entries(&bytes, node).map_err(|error| Exit::file(&name, &error))?;
    if let Some(reading) = &reading {
        check(out, &name, reading, node)?;
    }
    let total = entries.len();
    if out.only_plans(|| format!("would write {total} objects to node {node}")) {
        return Ok(());
    }
    let id = node_id(node)?;
    let mut session = Session::open(global, line)?;
    session.stop_transfers()?;
    if let Some(vendor) = reading.and_then(|reading| reading.device.vendor_number()) {
        check_vendor(out, &mut session, id, vendor)?;
    }
    let bar = out.progress("writing", total);
    for (written, entry) in entries.into_iter().enumerate() {
        let at = Address::new(entry.index, entry.subindex);
        let shown = hex(&entry.data);
        let done = session.download(id, at, entry.data, false)?;
        done.map_err(|error| failed(out, error, (written, total), &shown))?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    out.document(json!({ "node": node, "written": total }), || {
        out.say(&format!("{total} objects written to node {node}"));
    });
    Ok(())
}

/// An entry that could not be written, after those that were.
fn failed(out: &Output, error: TransferError, (written, total): (usize, usize), shown: &str) -> Exit {
    let mut document = error.json();
    document["written"] = json!(written);
    document["total"] = json!(total);
    out.document(document, || {});
    let exit = Exit::from(error).context(&format!("entry {} of {total}, {shown}", written + 1));
    Exit { message: format!("{}; {written} of {total} entries are written", exit.message), ..exit }
}

/// A concise DCF is binary; a DCF or XDC says in text which values it configures.
fn entries(bytes: &[u8], node: u8) -> Result<(Vec<ConciseEntry>, Option<Reading>), String> {
    let damage = match eds::parse_concise(bytes) {
        Ok(entries) => return Ok((entries, None)),
        Err(damage) => damage,
    };
    let reading = eds::read(bytes).map_err(|error| match error {
        eds::ReadError::Binary(_) => format!("concise DCF: {damage}"),
        error => error.to_string(),
    })?;
    let entries = reading.device.to_concise(Some(node)).map_err(|error| error.to_string())?;
    Ok((entries, Some(reading)))
}

/// Whether a file is meant for the node, and how well it is read.
fn check(out: &Output, name: &str, reading: &Reading, node: u8) -> Result<(), Exit> {
    let device = &reading.device;
    let valued = |object: &eds::Object| object.entries().iter().any(|entry| entry.value.is_some());
    if !device.objects.iter().any(valued) {
        return Err(Exit::usage(format!("{name}: no ParameterValue in it, so there is nothing to write")));
    }
    if let Some(own) = device.node_id().filter(|own| *own != node) {
        out.remark(format!("{name} is for node {own}"));
    }
    let errors = eds::check(reading).iter().filter(|found| found.severity() == Severity::Error).count();
    if errors > 0 {
        out.remark(format!("errors in {name}: {errors}; `motionctl eds check` names them"));
    }
    Ok(())
}

/// Whether a node is of the vendor that its file names; it need not say so (1018h).
fn check_vendor(out: &Output, session: &mut Session, id: NodeId, vendor: u32) -> Result<(), Exit> {
    match session.upload(id, Address::new(0x1018, 1), false)? {
        Ok((data, _)) => {
            let own = data.first_chunk().map(|bytes| u32::from_le_bytes(*bytes));
            if let Some(own) = own.filter(|own| *own != vendor) {
                out.remark(format!("the file is for vendor {vendor:08X}h, node {id} is of {own:08X}h"));
            }
        }
        Err(error) if matches!(error.outcome, Outcome::Aborted(_)) => {}
        Err(error) => return Err(tell(out, error)),
    }
    Ok(())
}
