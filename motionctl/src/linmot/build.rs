//! `motionctl linmot curve build`: a curve file from a motion profile, or from points.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use linmot::curve::{CurveError, InfoBlock, Profile, resample, rounded};
use linmot::pvl::Encoding;
use motion_core::trajectory::{self, LimitError, Limits, State};
use serde_json::json;

use super::cli::{Build, Kind, ProfileName, Quantity};
use super::curve;
use crate::exit::Exit;
use crate::output::{Output, counted};

/// Units of x in a second.
const SECOND: f64 = 1e5;
/// Curves get their ID when they are added.
const ANY_ID: u16 = 1;
/// Setpoints' units in a metre.
const METRE: f64 = 1e7;

/// A curve without its ID and name.
struct Built {
    length: u32,
    /// The length is in encoder increments.
    cam: bool,
    setpoints: Vec<i32>,
    /// Greatest speed of the motion itself, from which rounded setpoints may differ, in m/s; of a curve over time.
    fastest: Option<f64>,
}

pub(super) fn run(out: &Output, arguments: &Build) -> Result<(), Exit> {
    let Built { length, cam, setpoints, fastest } = built(arguments)?;
    let build = if cam { InfoBlock::cam } else { InfoBlock::position_over_time };
    let mut info = build(ANY_ID, "", length, arguments.setpoints).map_err(refused)?;
    let name = Encoding::Windows1252
        .encode_exactly(&arguments.name)
        .filter(|name| !arguments.name.contains(char::is_control) && name.len() < info.name.len())
        .ok_or_else(|| Exit::usage("--name: up to 21 characters of Windows-1252 expected"))?;
    info.name.iter_mut().zip(name).for_each(|(room, byte)| *room = byte);
    let file = arguments.output.display().to_string();
    let fastest = fastest.map(|speed| (speed * METRE).round() / METRE);
    let speed = fastest.map_or(String::new(), |speed| format!(", up to {speed:.4} m/s"));
    let text = curve::describe(&info);
    let text = text.trim_start().trim_start_matches(|c: char| c.is_ascii_digit()).trim_start();
    if out.only_plans(|| format!("would write {text}{speed} to {file}")) {
        return Ok(());
    }
    curve::save(&arguments.output, &info, &setpoints)?;
    let mut json = curve::to_json(&info);
    if let Some(curve) = json.as_object_mut() {
        curve.remove("id");
    }
    let document = json!({ "curve": json, "file": file, "fastest_m_per_s": fastest });
    out.document(document, || println!("{text}{speed}, written to {file}"));
    Ok(())
}

fn refused(error: CurveError) -> Exit {
    Exit::usage(error.to_string())
}

fn built(arguments: &Build) -> Result<Built, Exit> {
    let count = arguments.setpoints;
    if let Some(path) = &arguments.points {
        let points = points(path)?;
        // The caller's x is in ms.
        let scale = if arguments.cam { 1.0 } else { SECOND / 1000.0 };
        let ends = points.first().zip(points.last());
        let length = ends.map_or(0.0, |(first, last)| (last.0 - first.0) * scale);
        let setpoints = (0..count).filter_map(|number| resample(&points, number, count)).collect();
        let slopes = points.iter().zip(points.iter().skip(1)).map(|(a, b)| ((b.1 - a.1) / (b.0 - a.0)).abs());
        return Ok(Built {
            length: whole("the points' length", length)?,
            cam: arguments.cam,
            setpoints,
            fastest: (!arguments.cam).then(|| slopes.fold(0.0, f64::max) * 1000.0 / METRE),
        });
    }
    let from = of(Kind::Position, "--from", arguments.from)?;
    let to = arguments.to.map_or(Ok(from), |to| of(Kind::Position, "--to", to))?;
    for (option, position) in [("--from", from), ("--to", to)] {
        if rounded(position) != position.round() as i32 || position.abs() > f64::from(i32::MAX) {
            return Err(Exit::usage(format!("{option}: -214748mm to 214748mm expected")));
        }
    }
    if let Some(velocity) = arguments.velocity {
        return within_limits(arguments, velocity, (from, to));
    }
    let length = arguments.length.ok_or_else(|| Exit::usage("--length is missing"))?;
    let cam = length.kind == Kind::Increments;
    let length = if cam { length.value } else { of(Kind::Time, "--length", length)? };
    let profile = match arguments.profile {
        ProfileName::Sine => Profile::Sine,
        ProfileName::MinimumJerk => Profile::MinimumJerk,
        ProfileName::Trapezoid => Profile::Trapezoid,
    };
    let (start, end) = (rounded(from), rounded(to));
    let length = whole("--length", length)?;
    let mean = (f64::from(end) - f64::from(start)).abs() / METRE / (f64::from(length) / SECOND);
    Ok(Built {
        length,
        cam,
        setpoints: (0..count).map(|number| profile.setpoint(start, end, number, count)).collect(),
        fastest: (!cam).then_some(mean * profile.peak()),
    })
}

fn within_limits(arguments: &Build, velocity: Quantity, (from, to): (f64, f64)) -> Result<Built, Exit> {
    let velocity = of(Kind::Velocity, "--velocity", velocity)?;
    let acceleration = arguments.acceleration.ok_or_else(|| Exit::usage("--acceleration is missing"))?;
    let acceleration = of(Kind::Acceleration, "--acceleration", acceleration)?;
    let jerk = arguments.jerk.map_or(Ok(f64::INFINITY), |jerk| of(Kind::Jerk, "--jerk", jerk))?;
    if rounded(from) == rounded(to) {
        return Err(Exit::usage("--to: another position than --from expected, or --length to rest so long"));
    }
    let limits = Limits::new(velocity, acceleration, acceleration, jerk).map_err(|error| match error {
        LimitError::Range { name, .. } => Exit::usage(format!("--{name}: out of range")),
        other => Exit::usage(other.to_string()),
    })?;
    let mut way = trajectory::Profile::at_rest(from);
    way.move_to(&State::at_rest(from), &limits, to).map_err(|error| Exit::usage(error.to_string()))?;
    // The whole 10 us that the way fits into but for rounding; the drive runs that much slower.
    let length = whole("the motion's length", (way.duration() * SECOND - 1e-6).ceil())?;
    let intervals = f64::from(arguments.setpoints - 1);
    let at = |number: u16| way.at(way.duration() * f64::from(number) / intervals).position;
    // From rest to rest within the same limits, it is fastest in the middle.
    let fastest = way.at(way.duration() / 2.0).velocity.abs() / METRE;
    Ok(Built {
        length,
        cam: false,
        setpoints: (0..arguments.setpoints).map(|number| rounded(at(number))).collect(),
        fastest: Some(fastest * way.duration() * SECOND / f64::from(length)),
    })
}

fn of(kind: Kind, option: &str, quantity: Quantity) -> Result<f64, Exit> {
    let expected = match kind {
        Kind::Position => "a position in um, mm or m",
        Kind::Velocity => "a velocity in mm/s or m/s",
        Kind::Acceleration => "an acceleration in mm/s2 or m/s2",
        Kind::Jerk => "a jerk in mm/s3 or m/s3",
        Kind::Time | Kind::Increments => "a time in ms or s, or increments in inc",
    };
    let is_limit = matches!(kind, Kind::Velocity | Kind::Acceleration | Kind::Jerk);
    if quantity.kind != kind {
        Err(Exit::usage(format!("{option}: {expected} expected")))
    } else if is_limit && quantity.value <= 0.0 {
        Err(Exit::usage(format!("{option}: {expected}, above 0, expected")))
    } else {
        Ok(quantity.value)
    }
}

/// An x length: 1 to 2^32 - 1 of its units.
fn whole(what: &str, length: f64) -> Result<u32, Exit> {
    let length = length.round();
    if (1.0..=f64::from(u32::MAX)).contains(&length) {
        Ok(length as u32)
    } else {
        Err(Exit::usage(format!(
            "{what}: 0.01 ms to 42949672.95 ms, or 1 to 4294967295 increments, expected"
        )))
    }
}

/// Lines of x and y; y comes in mm and goes in 0.1 µm. x ascends.
fn points(path: &Path) -> Result<Vec<(f64, f64)>, Exit> {
    let name = path.display().to_string();
    let file = File::open(path).map_err(|error| Exit::file(&name, &error))?;
    let mut points: Vec<(f64, f64)> = Vec::new();
    for (number, line) in (1..).zip(BufReader::new(file).lines()) {
        let line = line.map_err(|error| Exit::file(&format!("{name}: line {number}"), &error))?;
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let shown: String = line.chars().take(40).collect();
        let wrong = |expected: &str| {
            Exit::file(&name, &format!("line {number}: {expected} expected, {shown:?} found"))
        };
        let numbers: Option<Vec<f64>> = line
            .split([',', ';', '\t', ' '])
            .filter(|word| !word.is_empty())
            .map(|word| word.parse().ok().filter(|number: &f64| number.is_finite()))
            .collect();
        let Some(&[x, y]) = numbers.as_deref() else { return Err(wrong("two numbers, x and y in mm,")) };
        if points.last().is_some_and(|last| last.0 >= x) {
            return Err(wrong("an x above the one before"));
        }
        let y = y * 1e4;
        if y.abs() > f64::from(i32::MAX) {
            return Err(wrong("a y of -214748 to 214748 mm"));
        }
        points.push((x, y));
    }
    if points.len() < 2 {
        let found = counted(points.len(), "point", "points");
        return Err(Exit::file(&name, &format!("{found}, at least 2 expected")));
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_have_units() {
        for (text, value, kind) in [
            ("12.5mm", 125_000.0, Kind::Position),
            ("-300um", -3000.0, Kind::Position),
            ("0.1m", 1e6, Kind::Position),
            ("1.5m/s", 1.5e7, Kind::Velocity),
            ("20 m/s2", 2e8, Kind::Acceleration),
            ("20m/s^2", 2e8, Kind::Acceleration),
            ("1000m/s3", 1e10, Kind::Jerk),
            ("200ms", 20_000.0, Kind::Time),
            ("0.2s", 20_000.0, Kind::Time),
            ("3600inc", 3600.0, Kind::Increments),
        ] {
            assert_eq!(text.parse(), Ok(Quantity { value, kind }), "{text}");
        }
        for text in ["", "5", "mm", "5cm", "1e400mm", "5 mm mm", "m/s2", "--5mm", "5mm2"] {
            assert!(text.parse::<Quantity>().is_err(), "{text}");
        }
    }
}
