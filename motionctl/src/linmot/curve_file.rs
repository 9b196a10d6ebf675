//! Curves as CSV: a head line of attributes, then one setpoint a line.

use core::fmt::Write;
use std::path::Path;

use linmot::curve::{InfoBlock, ObjectType, SETPOINT_SIZE, Unit};

use super::text;
use crate::exit::Exit;

/// Attributes of the head line. What `get` writes has all of them.
const KEYS: [&str; 8] = ["name", "length_ms", "length", "unit", "type", "x_unit", "y_unit", "wizard"];

pub(super) fn write(path: &Path, info: &InfoBlock, setpoints: &[i32]) -> Result<(), Exit> {
    let mut out = String::new();
    let name = text(info.name()).replace(|c: char| c.is_control(), "?");
    let length = if info.x_unit == Unit::TIME {
        let ms = f64::from(info.x_length) / 100.0;
        format!("length_ms={ms}")
    } else {
        format!("length={}", info.x_length)
    };
    let unit = if info.y_unit == Unit::POSITION { "0.1um" } else { "raw" };
    let wizard: Vec<String> = info.wizard.iter().map(u32::to_string).collect();
    // Writing to a string does not fail.
    let _ = writeln!(
        out,
        "# name={name} {length} unit={unit} type=0x{:04X} x_unit=0x{:04X} y_unit=0x{:04X} wizard={}:{}",
        info.object_type.0,
        info.x_unit.0,
        info.y_unit.0,
        info.wizard_type,
        wizard.join(":"),
    );
    for setpoint in setpoints {
        let _ = writeln!(out, "{setpoint}");
    }
    std::fs::write(path, out).map_err(|error| Exit::file(&path.display().to_string(), &error))
}

/// The value of an attribute: up to the next one.
fn attribute<'a>(head: &'a str, key: &str) -> Option<&'a str> {
    let begin = |key: &str| {
        let pattern = format!("{key}=");
        let at = head.find(&format!(" {pattern}")).map(|at| at + 1);
        at.or_else(|| head.starts_with(&pattern).then_some(0)).map(|at| (at, at + pattern.len()))
    };
    let (_, from) = begin(key)?;
    let to = KEYS.iter().filter_map(|key| begin(key)).map(|(at, _)| at).filter(|at| *at > from).min();
    head.get(from..to.unwrap_or(head.len())).map(str::trim)
}

pub(super) fn read(path: &Path, id: u16) -> Result<(InfoBlock, Vec<i32>), Exit> {
    let name = path.display().to_string();
    let content = std::fs::read(path).map_err(|error| Exit::file(&name, &error))?;
    let content = text(&content);
    let wrong =
        |line: usize, expected: &str| Exit::check(format!("{name}: line {line}: {expected} expected"));
    let mut lines = (1..).zip(content.lines());
    let head = lines.next().and_then(|(_, line)| line.trim_start_matches('\u{FEFF}').strip_prefix('#'));
    let head = head.ok_or_else(|| wrong(1, "# name=… length_ms=… unit=0.1um"))?.trim();
    let mut setpoints = Vec::new();
    for (number, line) in lines {
        let line = line.trim().trim_end_matches([',', ';']);
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        setpoints.push(line.parse().map_err(|_| wrong(number, "a setpoint, -2147483648 to 2147483647"))?);
    }
    match attribute(head, "unit") {
        None | Some("0.1um" | "raw") => {}
        Some(_) => return Err(wrong(1, "unit=0.1um")),
    }
    let count = u16::try_from(setpoints.len()).unwrap_or(u16::MAX);
    let hex = |key: &str| match attribute(head, key) {
        None => Ok(None),
        Some(value) => super::cli::number(value)
            .and_then(|value| u16::try_from(value).ok())
            .map(Some)
            .ok_or_else(|| wrong(1, &format!("{key}=0x0003"))),
    };
    let cam = attribute(head, "type") == Some("cam") || attribute(head, "length").is_some();
    let length = if cam {
        attribute(head, "length")
            .and_then(|value| value.parse().ok())
            .ok_or_else(|| wrong(1, "length=INCREMENTS"))?
    } else {
        let ms: Option<f64> = attribute(head, "length_ms").and_then(|value| value.parse().ok());
        // In 10 µs.
        let length =
            ms.map(|ms| (ms * 100.0).round()).filter(|length| (1.0..=f64::from(u32::MAX)).contains(length));
        length.ok_or_else(|| wrong(1, "length_ms=MILLISECONDS"))? as u32
    };
    let curve_name = attribute(head, "name").unwrap_or_default();
    let build = if cam { InfoBlock::cam } else { InfoBlock::position_over_time };
    let mut info = build(id, "", length, count).map_err(|error| Exit::check(format!("{name}: {error}")))?;
    let bytes = linmot::pvl::Encoding::Windows1252.encode(curve_name);
    if bytes.len() >= info.name.len() {
        return Err(wrong(1, "a name of up to 21 characters"));
    }
    for (room, byte) in info.name.iter_mut().zip(bytes) {
        *room = byte;
    }
    info.setpoint_size = SETPOINT_SIZE;
    if attribute(head, "type") != Some("cam") {
        info.object_type = hex("type")?.map_or(info.object_type, ObjectType);
    }
    info.x_unit = hex("x_unit")?.map_or(info.x_unit, Unit);
    info.y_unit = hex("y_unit")?.map_or(info.y_unit, Unit);
    if let Some(wizard) = attribute(head, "wizard") {
        let numbers: Option<Vec<u32>> = wizard.split(':').map(|number| number.parse().ok()).collect();
        let numbers = numbers.ok_or_else(|| wrong(1, "wizard=TYPE:PAR1:…:PAR7"))?;
        let (kind, parameters) = numbers.split_first().ok_or_else(|| wrong(1, "wizard=TYPE:PAR1:…:PAR7"))?;
        info.wizard_type = u16::try_from(*kind).map_err(|_| wrong(1, "a wizard type up to 65535"))?;
        for (room, parameter) in info.wizard.iter_mut().zip(parameters) {
            *room = *parameter;
        }
    }
    info.check().map_err(|error| Exit::check(format!("{name}: {error}")))?;
    Ok((info, setpoints))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_come_back_from_their_file() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("curve.csv");
        let mut info = InfoBlock::position_over_time(7, "Move out = fast", 20_050, 3).unwrap();
        (info.wizard_type, info.wizard[6]) = (2, 1_000_000);
        write(&path, &info, &[0, -5, i32::MAX]).unwrap();
        let (found, setpoints) = read(&path, 7).unwrap();
        assert_eq!((found, setpoints), (info, vec![0, -5, i32::MAX]));
        let cam = InfoBlock::cam(8, "cam", 3600, 2).unwrap();
        write(&path, &cam, &[1, 2]).unwrap();
        assert_eq!(read(&path, 8).unwrap(), (cam, vec![1, 2]));
        std::fs::write(&path, "# name=By hand length_ms=200.5 unit=0.1um\n0\n100\n50\n").unwrap();
        let (found, setpoints) = read(&path, 9).unwrap();
        assert_eq!((found.name(), found.x_length, found.setpoints), (&b"By hand"[..], 20_050, 3));
        assert_eq!(setpoints, [0, 100, 50]);
        for (content, words) in [
            ("0\n1\n", "line 1"),
            ("# length_ms=1\n0\nx\n", "line 3"),
            ("# length_ms=1\n0\n", "1 setpoints, 2 to 16383 expected"),
            ("# name=x\n0\n1\n", "length_ms=MILLISECONDS"),
            ("# length_ms=1 unit=mm\n0\n1\n", "unit=0.1um"),
        ] {
            std::fs::write(&path, content).unwrap();
            let message = read(&path, 1).unwrap_err().message;
            assert!(message.contains(words), "{message}");
        }
    }
}
