//! `eds`: device description files (EDS, DCF, XDD, XDC) checked, shown and converted.

mod check;
pub(crate) mod cli;
mod convert;
mod show;

use std::io::Read;

use canopen_master::eds::{self, Device, Format, Reading};
use serde_json::{Value, json};

use crate::exit::Exit;
use crate::output::Output;
use cli::{Eds, Input};

pub(crate) fn run(out: &Output, dry_run: bool, command: &Eds) -> Result<(), Exit> {
    match command {
        Eds::Check { input, lenient, strict } => check::run(out, input, *lenient, *strict),
        Eds::Show { input, objects, node, implied } => show::run(out, input, objects, *node, *implied),
        Eds::Convert { input, output, to_file, to, node, bit_rate, values, concise, anew } => convert::run(
            out,
            dry_run,
            input,
            output.as_deref().or(to_file.as_deref()).unwrap_or_else(|| std::path::Path::new("-")),
            *to,
            &convert::Changes {
                node: *node,
                bit_rate: *bit_rate,
                values,
                concise: concise.as_deref(),
                anew: *anew,
            },
        ),
    }
}

/// The bytes of a file, or of standard input for `-`; not more than a device description has.
pub(crate) fn bytes(path: &std::path::Path) -> Result<Vec<u8>, Exit> {
    let name = path.display().to_string();
    let most = eds::MOST_BYTES as u64 + 1;
    let mut bytes = Vec::new();
    let read = if path.as_os_str() == "-" {
        std::io::stdin().take(most).read_to_end(&mut bytes)
    } else {
        std::fs::File::open(path).and_then(|file| file.take(most).read_to_end(&mut bytes))
    };
    read.map_err(|error| Exit::file(&name, &error))?;
    if bytes.len() > eds::MOST_BYTES {
        return Err(Exit::file(&name, &eds::ReadError::TooLong));
    }
    Ok(bytes)
}

fn read_bytes(input: &Input, bytes: &[u8]) -> Result<Reading, eds::ReadError> {
    match input.encoding {
        Some(charset) => eds::read_as(bytes, charset.into()),
        None => eds::read(bytes),
    }
}

fn read(input: &Input) -> Result<Reading, Exit> {
    read_bytes(input, &bytes(&input.file)?)
        .map_err(|error| Exit::file(&input.file.display().to_string(), &error))
}

/// What the file is, in one word.
fn kind_word(reading: &Reading) -> &'static str {
    match (reading.source.format, reading.device.is_configuration()) {
        (Format::Eds, false) => "EDS",
        (Format::Eds, true) => "DCF",
        (Format::Xdd, false) => "XDD",
        (Format::Xdd, true) => "XDC",
    }
}

/// That the file was not read without doubt.
fn doubts(reading: &Reading) -> String {
    format!("doubtful places in the file: {}; `motionctl eds check` names them", reading.diagnostics.len())
}

fn counts(device: &Device) -> (usize, usize) {
    (device.objects.len(), device.objects.iter().map(|object| object.entries().len()).sum())
}

fn diagnostic_json(diagnostic: &eds::Diagnostic) -> Value {
    json!({
        "line": diagnostic.line,
        "severity": diagnostic.severity().to_string(),
        "rule": diagnostic.rule.word(),
        "clause": diagnostic.clause(),
        "message": diagnostic.message,
    })
}

/// Index and, where given, sub-index of `0x6041`, `6041h`, `0x1018:1`, `Statusword`.
fn place(device: &Device, text: &str) -> Result<(u16, Option<u8>), Exit> {
    if let Some(place) = number_place(text) {
        return Ok(place);
    }
    let (index, subindex) = device.find(text).ok_or_else(|| {
        Exit::usage(format!(
            "\"{text}\" is neither an index such as 0x6041 or 1018h:1 nor a name of the file"
        ))
    })?;
    let composed = device
        .object(index)
        .is_some_and(|object| object.is_composed() && object.name().eq_ignore_ascii_case(text));
    Ok((index, (!composed).then_some(subindex)))
}

fn number_place(text: &str) -> Option<(u16, Option<u8>)> {
    let hex = |text: &str| {
        let digits = text
            .strip_prefix("0x")
            .or_else(|| text.strip_prefix("0X"))
            .or_else(|| text.strip_suffix(['h', 'H']))?;
        u16::from_str_radix(digits, 16).ok()
    };
    match text.split_once(':') {
        Some((index, sub)) => {
            let subindex = hex(sub).and_then(|sub| u8::try_from(sub).ok()).or_else(|| sub.parse().ok())?;
            Some((hex(index)?, Some(subindex)))
        }
        None => Some((hex(text)?, None)),
    }
}
