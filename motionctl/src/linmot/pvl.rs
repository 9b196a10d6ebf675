//! `motionctl linmot pvl`.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use linmot::link::Fault;
use linmot::pvl::{Encoding, Severity};
use motion_io::linmot::LinkError;
use motion_io::linmot::transfer::{self, Difference, Options, Progress, Summary, TransferError};
use serde_json::{Value, json};

use super::cli::{Drive, EncodingName, Pvl};
use super::connect::connect;
use super::curve;
use super::params::of_number;
use crate::cli::Global;
use crate::exit::Exit;
use crate::output::{Output, counted, write_file};

pub(super) fn run(out: &Output, global: &Global, command: &Pvl) -> Result<(), Exit> {
    match command {
        Pvl::Backup { drive, file, changed, encoding } => {
            let encoding = match encoding {
                EncodingName::Windows1252 => Encoding::Windows1252,
                EncodingName::Utf8 => Encoding::Utf8,
            };
            backup(out, global, drive, file, *changed, encoding)
        }
        Pvl::Restore { drive, file, replace_curves } => restore(out, global, drive, file, *replace_curves),
        Pvl::Compare { drive, file } => compare(out, global, drive, file),
        Pvl::Check { file } => check(out, file),
    }
}

fn parameters_of(count: usize) -> String {
    counted(count, "parameter", "parameters")
}

fn curves_of(count: usize) -> String {
    counted(count, "curve", "curves")
}

fn errors_of(count: usize) -> String {
    counted(count, "error", "errors")
}

fn open(path: &Path) -> Result<BufReader<File>, Exit> {
    File::open(path).map(BufReader::new).map_err(|error| Exit::file(&path.display().to_string(), &error))
}

/// A file without errors, from its beginning: what it alone can tell is told before a drive is needed.
fn checked(out: &Output, path: &Path) -> Result<BufReader<File>, Exit> {
    let mut file = open(path)?;
    let summary = Summary::of(&mut file).map_err(|error| failed(path, TransferError::File(error)))?;
    summary.check().map_err(|error| failed(path, error))?;
    for (line, _, warning) in &summary.diagnostics {
        out.remark(format!("{}:{line}: {warning}", path.display()));
    }
    if summary.more_diagnostics > 0 {
        out.remark(format!("{}: {} more warnings", path.display(), summary.more_diagnostics));
    }
    std::io::Seek::rewind(&mut file).map_err(|error| Exit::file(&path.display().to_string(), &error))?;
    Ok(file)
}

fn failed(path: &Path, error: TransferError<LinkError>) -> Exit {
    let of_file = matches!(error, TransferError::File(_) | TransferError::Check { .. });
    let exit = Exit::from(error);
    if of_file { exit.context(&path.display().to_string()) } else { exit }
}

fn backup(
    out: &Output,
    global: &Global,
    drive: &Drive,
    path: &Path,
    changed: bool,
    encoding: Encoding,
) -> Result<(), Exit> {
    let name = path.display().to_string();
    if out.only_plans(|| format!("would write ROM values and curves to {name}")) {
        return Ok(());
    }
    let mut link = connect(global, drive)?;
    let bar = out.progress("reading", 0);
    let done = write_file(path, |mut file| {
        transfer::backup(&mut link, &mut file, encoding, changed, |progress| {
            bar.set_position((progress.parameters + progress.setpoints) as u64);
        })
        .map_err(|error| failed(path, error))
    })?;
    bar.finish_and_clear();
    let Progress { parameters, curves, setpoints, .. } = done;
    let json = json!({ "file": name, "parameters": parameters, "curves": curves, "setpoints": setpoints });
    out.document(json, || {
        println!(
            "{} and {} with {} written to {name}",
            parameters_of(parameters),
            curves_of(curves),
            counted(setpoints, "setpoint", "setpoints")
        );
    });
    Ok(())
}

fn restore(
    out: &Output,
    global: &Global,
    drive: &Drive,
    path: &Path,
    delete_curves: bool,
) -> Result<(), Exit> {
    let mut file = checked(out, path)?;
    let options = Options { delete_curves, dry_run: global.dry_run };
    if !global.dry_run {
        out.confirm(global.yes, "Stop the MC software and write parameters and curves to ROM and flash?")?;
    }
    let mut link = connect(global, drive)?;
    let bar = out.progress("restoring", 0);
    let mut last = Progress::default();
    let done = transfer::restore(&mut link, &mut file, options, |progress| {
        last = progress;
        bar.set_position((progress.parameters + progress.setpoints) as u64);
    });
    bar.finish_and_clear();
    let done = done.map_err(|error| {
        let refused = matches!(&error, TransferError::Drive(fault) if !matches!(fault, Fault::Carrier(_)));
        let exit = failed(path, error);
        let Progress { begun, parameters, written, curves, .. } = last;
        if !begun {
            return exit.context("nothing was written");
        }
        let deleted = if delete_curves { "the drive's own curves may be deleted, " } else { "" };
        let remedy = if refused { "correct what it refuses and restore again" } else { "the same restore completes it" };
        exit.context(&format!(
            "incomplete: {deleted}{} ({written} of them written) and {} are as in the file, curves in RAM only, the \
             MC software may be stopped; {remedy}",
            parameters_of(parameters),
            curves_of(curves)
        ))
    })?;
    let Progress { parameters, written, curves, setpoints, .. } = done;
    if written > 0 && !global.dry_run {
        out.remark("the ROM values act after a restart");
    }
    let json = json!({
        "dry_run": global.dry_run, "parameters": parameters, "written": written,
        "curves": curves, "setpoints": setpoints, "saved": !global.dry_run,
    });
    out.document(json, || {
        let would = if global.dry_run { "would be " } else { "" };
        println!(
            "{}, {written} of them {would}written; {} {would}written and saved",
            parameters_of(parameters),
            curves_of(curves)
        );
    });
    Ok(())
}

fn compare(out: &Output, global: &Global, drive: &Drive, path: &Path) -> Result<(), Exit> {
    let mut file = checked(out, path)?;
    let mut link = connect(global, drive)?;
    let mut differences = Vec::new();
    let bar = out.progress("comparing", 0);
    let done = transfer::compare(
        &mut link,
        &mut file,
        |difference| differences.push(difference),
        |progress| bar.set_position((progress.parameters + progress.setpoints) as u64),
    )
    .map_err(|error| failed(path, error))?;
    bar.finish_and_clear();
    let (json, lines): (Vec<Value>, Vec<String>) = differences.iter().map(describe).unzip();
    let equal = differences.is_empty();
    let Progress { parameters, curves, .. } = done;
    let document = json!({
        "equal": equal, "equal_parameters": parameters, "equal_curves": curves, "different": json,
    });
    out.document(document, || {
        lines.iter().for_each(|line| println!("{line}"));
        println!("equal: {} and {}", parameters_of(parameters), curves_of(curves));
    });
    if equal { Ok(()) } else { Err(Exit::check(counted(differences.len(), "difference", "differences"))) }
}

fn describe(difference: &Difference) -> (Value, String) {
    match *difference {
        Difference::Parameter { upid, file, drive, range } => {
            let [file_number, drive_number] = [file, drive].map(|raw| range.number(raw));
            (
                json!({ "upid": upid.0, "file": of_number(file_number), "drive": of_number(drive_number) }),
                format!(
                    "{upid}: {file_number} ({file:08X}h) in the file, {drive_number} ({drive:08X}h) in the drive"
                ),
            )
        }
        Difference::Missing(upid) => {
            (json!({ "upid": upid.0, "drive": null }), format!("{upid}: unknown to the drive"))
        }
        Difference::MissingCurve(id) => {
            (json!({ "curve": id, "what": "missing" }), format!("curve {id} is not in the drive"))
        }
        Difference::ExtraCurve(id) => {
            (json!({ "curve": id, "what": "extra" }), format!("curve {id} is not in the file"))
        }
        Difference::CurveInfo(id) => {
            (json!({ "curve": id, "what": "info" }), format!("curve {id}: the info blocks differ"))
        }
        Difference::CurveData { id, first, count } => (
            json!({ "curve": id, "what": "setpoints", "first": first, "count": count }),
            match count {
                1 => format!("curve {id}: setpoint {first} differs"),
                _ => format!("curve {id}: {count} setpoints differ, the first is number {first}"),
            },
        ),
        _ => (Value::Null, String::new()),
    }
}

fn check(out: &Output, path: &Path) -> Result<(), Exit> {
    let summary =
        Summary::of(&mut open(path)?).map_err(|error| Exit::file(&path.display().to_string(), &error))?;
    let objects: Vec<Value> = summary
        .sections
        .iter()
        .map(|(layer, identity, parameters)| {
            json!({
                "layer": layer.map(linmot::upid::Layer::number),
                "name": layer.map(linmot::upid::Layer::name),
                "tree_id": identity.tree_id,
                "main_version": identity.main_version,
                "sub_version": identity.sub_version,
                "parameters": parameters,
            })
        })
        .collect();
    let curves: Vec<Value> = summary.curves.iter().map(curve::to_json).collect();
    let word = |severity: Severity| if severity == Severity::Error { "error" } else { "warning" };
    let diagnostics: Vec<Value> = summary
        .diagnostics
        .iter()
        .map(|(line, severity, problem)| {
            json!({ "line": line, "severity": word(*severity), "message": problem.to_string() })
        })
        .collect();
    let document = json!({
        "objects": objects, "curves": curves, "diagnostics": diagnostics,
        "more_diagnostics": summary.more_diagnostics,
    });
    out.document(document, || {
        for (line, severity, problem) in &summary.diagnostics {
            println!("{}:{line}: {}: {problem}", path.display(), word(*severity));
        }
        if summary.more_diagnostics > 0 {
            println!("{} more", summary.more_diagnostics);
        }
        for (layer, identity, parameters) in &summary.sections {
            let name = layer.map_or("unknown layer", linmot::upid::Layer::name);
            println!(
                "{name}: {}, tree {} version {}.{}",
                parameters_of(*parameters),
                identity.tree_id,
                identity.main_version,
                identity.sub_version
            );
        }
        println!("{}, {}", curves_of(summary.curves.len()), errors_of(summary.errors()));
    });
    match summary.errors() {
        0 => Ok(()),
        errors => Err(Exit::check(format!("{}: {}", path.display(), errors_of(errors)))),
    }
}
