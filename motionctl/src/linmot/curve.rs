//! `motionctl linmot curve`.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use linmot::code::Status;
use linmot::curve::{CurveError, IDS, InfoBlock, ObjectType, Unit};
use linmot::link::{Fault, LinkExt};
use linmot::request::{Access, Request};
use motion_io::linmot::{LinkError, curve_file};
use serde_json::{Value, json};

use super::cli::{Curve as Command, Drive};
use super::connect::{AnyLink, connect};
use super::{build, stopped, text};
use crate::cli::Global;
use crate::exit::Exit;
use crate::output::{Output, counted, write_beside, write_file};
use crate::plot::{Curve, Panel, drawing};

pub(super) fn run(out: &Output, global: &Global, command: &Command) -> Result<(), Exit> {
    match command {
        Command::List { drive } => list(out, global, drive),
        Command::Get { drive, id, output } => {
            take(out, global, drive, *id, output, |info, setpoints| save(output, info, setpoints))
        }
        Command::Plot { drive, id, output } => {
            take(out, global, drive, *id, output, |info, setpoints| plot(output, info, setpoints))
        }
        Command::Build(arguments) => build::run(out, arguments),
        Command::Add { drive, id, file } => write(out, global, drive, Access::Add, *id, file),
        Command::Modify { drive, id, file } => write(out, global, drive, Access::Modify, *id, file),
        Command::Save { drive } => {
            if out.only_plans(|| "would save all curves to flash".into()) {
                return Ok(());
            }
            out.confirm(global.yes, "Stop the MC software and write all curves to flash?")?;
            let mut link = connect(global, drive)?;
            stopped(&mut link, |link| Ok(link.ask(Request::SaveCurves).map(|_| ())?))?;
            out.document(json!({ "saved": true }), || println!("all curves are in flash"));
            Ok(())
        }
        Command::DeleteAll { drive } => {
            if out.only_plans(|| "would delete all curves in RAM".into()) {
                return Ok(());
            }
            out.confirm_on_terminal(global.yes, "Delete all curves in RAM?")?;
            connect(global, drive)?.ask(Request::DeleteCurves)?;
            out.document(json!({ "deleted": true }), || println!("no curves are left in RAM"));
            Ok(())
        }
    }
}

pub(super) fn save(path: &Path, info: &InfoBlock, setpoints: &[i32]) -> Result<(), Exit> {
    write_file(path, |mut file| {
        curve_file::write(&mut file, info, setpoints)
            .map_err(|error| Exit::file(&path.display().to_string(), &error))
    })
}

fn load(path: &Path, id: u16) -> Result<(InfoBlock, Vec<i32>), Exit> {
    let name = path.display().to_string();
    let file = File::open(path).map_err(|error| Exit::file(&name, &error))?;
    curve_file::read(&mut BufReader::new(file), id).map_err(|error| Exit::file(&name, &error))
}

pub(super) fn to_json(info: &InfoBlock) -> Value {
    json!({
        "id": info.id,
        "name": text(info.name()),
        "type": info.object_type.0,
        "setpoints": info.setpoints,
        "x_length": info.x_length,
        "x_unit": info.x_unit.0,
        "y_unit": info.y_unit.0,
        "length_ms": (info.x_unit == Unit::TIME).then(|| f64::from(info.x_length) / 100.0),
    })
}

pub(super) fn describe(info: &InfoBlock) -> String {
    let kind = match info.object_type {
        ObjectType::POSITION_TIME => format!("{} ms", f64::from(info.x_length) / 100.0),
        ObjectType::POSITION_ENCODER => format!("cam, {} increments", info.x_length),
        other => format!("type {:04X}h, length {}", other.0, info.x_length),
    };
    format!("{:3}  {:21}  {}, {kind}", info.id, text(info.name()), setpoints_of(info))
}

/// One curve of the drive into a file.
fn take(
    out: &Output,
    global: &Global,
    drive: &Drive,
    id: u16,
    file: &Path,
    keep: impl FnOnce(&InfoBlock, &[i32]) -> Result<(), Exit>,
) -> Result<(), Exit> {
    let id = usable(id)?;
    let file = file.display();
    if out.only_plans(|| format!("would read curve {id} and write it to {file}")) {
        return Ok(());
    }
    let (info, setpoints) = read(out, &mut connect(global, drive)?, id)?;
    keep(&info, &setpoints)?;
    out.document(json!({ "curve": to_json(&info), "file": file.to_string() }), || {
        println!("{}, written to {file}", describe(&info));
    });
    Ok(())
}

fn usable(id: u16) -> Result<u16, Exit> {
    let known = IDS.contains(&id);
    known.then_some(id).ok_or_else(|| Exit::usage(CurveError::Id(id).to_string()))
}

fn list(out: &Output, global: &Global, drive: &Drive) -> Result<(), Exit> {
    let mut link = connect(global, drive)?;
    let mut curves = Vec::new();
    for id in IDS {
        curves.extend(link.curve_info(id)?);
    }
    let json: Vec<Value> = curves.iter().map(to_json).collect();
    out.document(json!({ "curves": json }), || {
        if curves.is_empty() {
            println!("no curves");
        }
        curves.iter().for_each(|info| println!("{}", describe(info)));
    });
    Ok(())
}

fn read(out: &Output, link: &mut AnyLink, id: u16) -> Result<(InfoBlock, Vec<i32>), Exit> {
    let absent = || Exit::refused(format!("curve {id}: no such curve (D4h, curve not present)"));
    let info = link.curve_info(id)?.ok_or_else(absent)?;
    let bar = out.progress("reading", info.setpoints.into());
    let mut setpoints = Vec::with_capacity(info.setpoints.into());
    for number in 1..=usize::from(info.setpoints) {
        setpoints.push(link.read_setpoint(&info, number)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok((info, setpoints))
}

fn write(
    out: &Output,
    global: &Global,
    drive: &Drive,
    access: Access,
    id: u16,
    file: &Path,
) -> Result<(), Exit> {
    let (info, setpoints) = load(file, usable(id)?)?;
    if out.only_plans(|| format!("would write {}", describe(&info))) {
        return Ok(());
    }
    let mut link = connect(global, drive)?;
    link.start_curve(access, &info).map_err(|fault| not_started(&mut link, access, &info, fault))?;
    let bar = out.progress("writing", setpoints.len());
    for (number, setpoint) in (1..).zip(&setpoints) {
        link.write_setpoint(access, &info, number, *setpoint)
            .map_err(|fault| Exit::from(fault).context(&left(&mut link, access, id)))?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    out.document(json!({ "curve": to_json(&info) }), || println!("{} in RAM", describe(&info)));
    Ok(())
}

/// What a curve is that was begun and whose end was not confirmed, as far as the drive tells.
fn left(link: &mut AnyLink, access: Access, id: u16) -> String {
    match (access, link.curve_info(id)) {
        (Access::Add, Ok(None)) => format!("curve {id} was not added"),
        (Access::Add, Ok(Some(_))) => format!("curve {id} is in RAM, perhaps not as in the file"),
        (Access::Add, Err(_)) => format!("curve {id} may be in RAM, perhaps not as in the file"),
        _ => format!("curve {id} in RAM may be the old one, as in the file, or as in the file in part"),
    }
}

/// Why a curve could not be begun; of another size than the drive's, both are told.
fn not_started(link: &mut AnyLink, access: Access, info: &InfoBlock, fault: Fault<LinkError>) -> Exit {
    let (start, size) = match fault {
        Fault::Curve { .. } => (true, false),
        Fault::Refused { request: Request::StartCurve { .. }, reply } => (true, reply.status == Status::SIZE),
        _ => (false, false),
    };
    let state = if start { "nothing was written".to_owned() } else { left(link, access, info.id) };
    let mut exit = Exit::from(fault).context(&state);
    if size
        && access == Access::Modify
        && let Ok(Some(found)) = link.curve_info(info.id)
    {
        exit.message = format!(
            "{}: {} in the file, {} in the drive's curve",
            exit.message,
            setpoints_of(info),
            setpoints_of(&found)
        );
    }
    exit
}

fn setpoints_of(info: &InfoBlock) -> String {
    counted(info.setpoints.into(), "setpoint", "setpoints")
}

/// Draws position over x.
fn plot(path: &Path, info: &InfoBlock, setpoints: &[i32]) -> Result<(), Exit> {
    let (x, length) = match info.x_unit {
        Unit::TIME => ("time in ms", f64::from(info.x_length) / 100.0),
        _ => ("encoder position in increments", f64::from(info.x_length)),
    };
    let last = (setpoints.len().max(2) - 1) as f64;
    let point = |(number, setpoint): (usize, &i32)| {
        // Setpoints are in 0.1 µm.
        (length * number as f64 / last, f64::from(*setpoint) / 10_000.0)
    };
    let points = setpoints.iter().enumerate().map(point).collect();
    let panel = Panel { title: "position in mm".into(), curves: vec![Curve { name: String::new(), points }] };
    let title = format!("curve {} {}", info.id, text(info.name()));
    let drawn = drawing(title.trim(), x, &[panel])
        .map_err(|error| Exit::file(&path.display().to_string(), &error))?;
    write_beside(path, drawn.as_bytes())
}
