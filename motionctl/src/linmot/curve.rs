//! `motionctl linmot curve`.

use core::fmt::Write as _;
use std::fs::File;
use std::io::{BufReader, BufWriter, Write as _};
use std::path::Path;

use linmot::curve::{IDS, InfoBlock, ObjectType, Unit};
use linmot::link::LinkExt;
use linmot::request::{Access, Request};
use motion_io::linmot::curve_file::{self, CurveFileError};
use serde_json::{Value, json};

use super::cli::{Curve, Drive};
use super::connect::{AnyLink, connect};
use super::{build, stopped, text};
use crate::cli::Global;
use crate::exit::Exit;
use crate::output::Output;

pub(super) fn run(out: &Output, global: &Global, command: &Curve) -> Result<(), Exit> {
    match command {
        Curve::List { drive } => list(out, global, drive),
        Curve::Get { drive, id, output } => {
            let (info, setpoints) = read(out, &mut connect(global, drive)?, *id)?;
            save(output, &info, &setpoints)?;
            told(out, &info, &output.display().to_string())
        }
        Curve::Plot { drive, id, output } => {
            let (info, setpoints) = read(out, &mut connect(global, drive)?, *id)?;
            let name = output.display().to_string();
            std::fs::write(output, svg(&info, &setpoints)).map_err(|error| Exit::file(&name, &error))?;
            told(out, &info, &name)
        }
        Curve::Build(arguments) => build::run(out, global, arguments),
        Curve::Add { drive, id, file } => write(out, global, drive, Access::Add, *id, file),
        Curve::Modify { drive, id, file } => write(out, global, drive, Access::Modify, *id, file),
        Curve::Save { drive } => {
            if global.dry_run {
                out.say("would save all curves to flash");
                return Ok(());
            }
            out.confirm(global.yes, "Stop the MC software and write all curves to flash?")?;
            let mut link = connect(global, drive)?;
            stopped(&mut link, |link| Ok(link.ask(Request::SaveCurves).map(|_| ())?))?;
            out.document(json!({ "saved": true }), || println!("all curves are in flash"));
            Ok(())
        }
        Curve::DeleteAll { drive } => {
            if global.dry_run {
                out.say("would delete all curves in RAM");
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
    let write = || -> std::io::Result<()> {
        let mut file = BufWriter::new(File::create(path)?);
        curve_file::write(&mut file, info, setpoints)?;
        file.flush()
    };
    write().map_err(|error| Exit::file(&path.display().to_string(), &error))
}

fn load(path: &Path, id: u16) -> Result<(InfoBlock, Vec<i32>), Exit> {
    let name = path.display().to_string();
    let file = File::open(path).map_err(|error| Exit::file(&name, &error))?;
    curve_file::read(&mut BufReader::new(file), id).map_err(|error| match error {
        CurveFileError::Io(error) => Exit::file(&name, &error),
        other => Exit::check(format!("{name}: {other}")),
    })
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
    format!("{:3}  {:21}  {} setpoints, {kind}", info.id, text(info.name()), info.setpoints)
}

fn told(out: &Output, info: &InfoBlock, file: &str) -> Result<(), Exit> {
    out.document(json!({ "curve": to_json(info), "file": file }), || {
        println!("{}, written to {file}", describe(info));
    });
    Ok(())
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
    let (info, setpoints) = load(file, id)?;
    if global.dry_run {
        out.say(&format!("would write {}", describe(&info)));
        return Ok(());
    }
    let mut link = connect(global, drive)?;
    link.start_curve(access, &info)?;
    let bar = out.progress("writing", setpoints.len());
    for (number, setpoint) in (1..).zip(&setpoints) {
        link.write_setpoint(access, &info, number, *setpoint).map_err(|fault| {
            let left = match access {
                Access::Modify => "the curve's info block is written, its setpoints are the old ones",
                _ => "the curve was not added",
            };
            Exit::from(fault).context(left)
        })?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    out.document(json!({ "curve": to_json(&info) }), || println!("{} in RAM", describe(&info)));
    Ok(())
}

/// Setpoints over x, as a line in a frame.
fn svg(info: &InfoBlock, setpoints: &[i32]) -> String {
    const WIDTH: f64 = 800.0;
    const HEIGHT: f64 = 400.0;
    const MARGIN: f64 = 60.0;
    /// Left of the frame, for positions.
    const LEFT: f64 = 120.0;
    let (low, high) =
        setpoints.iter().fold((i32::MAX, i32::MIN), |(low, high), y| (low.min(*y), high.max(*y)));
    let span = (f64::from(high) - f64::from(low)).max(1.0);
    let last = (setpoints.len().max(2) - 1) as f64;
    let points = setpoints.iter().enumerate().fold(String::new(), |mut points, (n, y)| {
        let x = LEFT + WIDTH * n as f64 / last;
        let y = MARGIN + HEIGHT * (f64::from(high) - f64::from(*y)) / span;
        let _ = write!(points, "{x:.2},{y:.2} ");
        points
    });
    let escaped = text(info.name()).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    let length = match info.x_unit {
        Unit::TIME => format!("{} ms", f64::from(info.x_length) / 100.0),
        _ => format!("{} increments", info.x_length),
    };
    // Setpoints are in 0.1 µm.
    let mm = |value: i32| f64::from(value) / 10_000.0;
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" font-family=\"sans-serif\" font-size=\"14\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
         <rect x=\"{LEFT}\" y=\"{MARGIN}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"none\" stroke=\"#999\"/>\n\
         <text x=\"{LEFT}\" y=\"30\">curve {} {escaped}</text>\n\
         <text x=\"{LEFT}\" y=\"{}\">0</text>\n\
         <text x=\"{}\" y=\"{}\" text-anchor=\"end\">{length}</text>\n\
         <text x=\"{}\" y=\"{}\" text-anchor=\"end\">{} mm</text>\n\
         <text x=\"{}\" y=\"{}\" text-anchor=\"end\">{} mm</text>\n\
         <polyline points=\"{}\" fill=\"none\" stroke=\"#06c\" stroke-width=\"2\"/>\n</svg>\n",
        LEFT + WIDTH + MARGIN,
        HEIGHT + 2.0 * MARGIN,
        info.id,
        HEIGHT + MARGIN + 20.0,
        LEFT + WIDTH,
        HEIGHT + MARGIN + 20.0,
        LEFT - 8.0,
        MARGIN + 10.0,
        mm(high),
        LEFT - 8.0,
        HEIGHT + MARGIN,
        mm(low),
        points.trim_end(),
    )
}
