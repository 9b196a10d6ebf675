//! LB2 lines: telegrams with their fields, and everything between them.

use std::collections::VecDeque;
use std::io::{Read, Write};

use lb2::frame::{Damage, DamageKind, Decoder, Frame, Item, MAX_WIRE, encode};
use lb2::telegram::{self, Echo, Request, Response, Text, function};
use motion_io::capture::{CaptureError, Chunk, Damage as LineDamage, Lb2Reader, Time};
use serde_json::{Map, Value, json};

use super::{LB2, Stop, Totals};
use crate::exit::Exit;

/// Who sent a telegram.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Direction {
    Request,
    Reply,
    Unknown,
}

impl Direction {
    const fn word(self) -> &'static str {
        match self {
            Self::Request => "request",
            Self::Reply => "reply",
            Self::Unknown => "unknown",
        }
    }
}

/// What came before a telegram.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Before {
    /// Nothing, or nothing that says who spoke last.
    Nothing,
    /// A request that waits for its answer, and what the answer repeats of it.
    Request(Echo),
    /// An answer.
    Reply,
}

/// A telegram and what it says.
struct Telegram {
    offset: u64,
    len: u64,
    direction: Direction,
    function: u8,
    sub: Option<u8>,
    fields: Map<String, Value>,
    raw: String,
}

/// A stretch of bytes that is no telegram.
struct Gap {
    offset: u64,
    len: u64,
    reason: &'static str,
}

/// Finds out who speaks.
struct Listener {
    before: Before,
}

impl Listener {
    fn telegram(&mut self, offset: u64, frame: &Frame<'_>) -> Telegram {
        let request = Request::parse(frame).ok();
        let response = Response::parse(frame).ok();
        let direction = match (&request, &response) {
            (Some(_), None) => Direction::Request,
            (None, Some(_)) => Direction::Reply,
            (Some(request), Some(response)) => match self.before {
                _ if frame.function() == function::ERROR => Direction::Reply,
                Before::Nothing => Direction::Unknown,
                Before::Reply => Direction::Request,
                Before::Request(echo) if response.echo() == Some(echo) => Direction::Reply,
                // Not the answer that is waited for: a new question.
                Before::Request(_) if is_known(request) => Direction::Request,
                Before::Request(_) => Direction::Unknown,
            },
            (None, None) => Direction::Unknown,
        };
        self.before = match (direction, &request) {
            (Direction::Request, Some(request)) => Before::Request(request.echo()),
            (Direction::Reply, _) => Before::Reply,
            _ => Before::Nothing,
        };
        let fields = match (direction, request, response) {
            (Direction::Request, Some(request), _) => request_fields(frame, &request),
            (Direction::Reply, _, Some(response)) => response_fields(&response),
            (_, Some(request), Some(response)) => {
                common(request_fields(frame, &request), &response_fields(&response))
            }
            _ => [("data".to_owned(), hex(frame.data()).into())].into_iter().collect(),
        };
        let sub = (frame.function() == function::EXTENSION).then(|| frame.data().first().copied()).flatten();
        let mut wire = [0; MAX_WIRE];
        let len = encode(frame.function(), frame.data(), &mut wire).unwrap_or(0);
        let raw = hex(wire.get(..len).unwrap_or(&[]));
        Telegram {
            offset,
            len: frame.wire_len() as u64,
            direction,
            function: frame.function(),
            sub,
            fields,
            raw,
        }
    }
}

const fn is_known(request: &Request<'_>) -> bool {
    !matches!(request, Request::Raw { .. })
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

/// What request and answer of the same look have in common.
fn common(mut one: Map<String, Value>, other: &Map<String, Value>) -> Map<String, Value> {
    one.retain(|key, value| other.get(key) == Some(value));
    one
}

fn map(fields: Value) -> Map<String, Value> {
    match fields {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

fn text(text: &Text<'_>) -> String {
    text.chars().collect()
}

fn request_fields(frame: &Frame<'_>, request: &Request<'_>) -> Map<String, Value> {
    map(match *request {
        Request::SelectDevice(number) => json!({ "device_number": number }),
        Request::EraseFlash { bank } => json!({ "bank": bank }),
        Request::ReadFlash { bank, offset, count } | Request::ReadRam { bank, offset, count } => {
            json!({ "bank": bank, "offset": offset, "count": count })
        }
        Request::WriteFlash { bank, data, .. } => {
            // The byte as it stands on the wire: 00h protected, 01h not.
            let enable = frame.data().get(2).copied().unwrap_or(0);
            json!({ "bank": bank, "enable": enable, "data": hex(data) })
        }
        Request::WriteRam { bank, offset, data } | Request::WriteFlashAt { bank, offset, data } => {
            json!({ "bank": bank, "offset": offset, "data": hex(data) })
        }
        Request::ReadParameter { index } | Request::DescribeParameter { index } => json!({ "index": index }),
        Request::WriteParameter { index, value } | Request::WriteParameterExtended { index, value } => {
            json!({ "index": index, "value": value })
        }
        Request::Raw { data, .. } => json!({ "data": hex(data) }),
        _ => json!({}),
    })
}

fn response_fields(response: &Response<'_>) -> Map<String, Value> {
    map(match *response {
        Response::Selected(number) => json!({ "device_number": number }),
        Response::DeviceType { device, axes } => json!({ "device": device, "axes": axes }),
        Response::OsVersion(version) | Response::CustomVersion(version) => {
            json!({ "version": version.version, "revision": version.revision })
        }
        Response::Failures(failures) => {
            let failures: Vec<_> = failures
                .iter()
                .map(|stored| json!({ "axis": stored.axis, "failure": stored.failure.0 }))
                .collect();
            json!({ "failures": failures })
        }
        Response::FailureCount(number) | Response::FailuresDeleted(number) => json!({ "number": number }),
        Response::FlashErased { bank }
        | Response::FlashWritten { bank }
        | Response::RamWritten { bank }
        | Response::FlashWrittenAt { bank } => json!({ "bank": bank }),
        Response::FlashData { bank, data } | Response::RamData { bank, data } => {
            json!({ "bank": bank, "data": hex(data) })
        }
        Response::Parameter { index, value } => json!({ "index": index, "value": value }),
        Response::ParameterDescription(description) => json!({
            "index": description.index,
            "variant": text(&description.variant),
            "minimum": description.minimum,
            "maximum": description.maximum,
            "default": description.default,
            "name": text(&description.name),
            "group": text(&description.group),
        }),
        Response::ParameterWritten { index, loader } => json!({ "index": index, "loader": loader.0 }),
        Response::ParameterWrittenExtended { index, loader, text: message } => {
            json!({ "index": index, "loader": loader.0, "text": text(&message) })
        }
        Response::LoaderCalled { offset } => json!({ "offset": offset }),
        Response::Error(code) => json!({ "error_code": code.0 }),
        Response::Raw { data, .. } => json!({ "data": hex(data) }),
        _ => json!({}),
    })
}

/// What the decoder calls damage, in a word or two.
const fn reason(kind: &DamageKind) -> &'static str {
    match kind {
        DamageKind::Number { .. } => "number byte",
        DamageKind::CutShort => "cut short",
        DamageKind::RepeatMissing { .. } => "82h repeat missing",
        DamageKind::CheckByte { .. } => "check byte",
        DamageKind::Gap => "cut short",
        _ => "outside of telegrams",
    }
}

/// Cuts the bytes between good telegrams where the decoder reported damage.
fn gaps(from: u64, to: u64, damages: &mut Vec<Damage>) -> Vec<Gap> {
    damages.sort_by_key(|damage| damage.offset);
    let mut gaps: Vec<Gap> = Vec::new();
    if from < to && damages.first().is_none_or(|first| first.offset > from) {
        gaps.push(Gap { offset: from, len: 0, reason: reason(&DamageKind::Garbage) });
    }
    for damage in damages.drain(..) {
        let offset = damage.offset.clamp(from, to);
        if gaps.last().is_some_and(|last| last.offset == offset) {
            continue;
        }
        gaps.push(Gap { offset, len: 0, reason: reason(&damage.kind) });
    }
    let mut end = to;
    for gap in gaps.iter_mut().rev() {
        gap.len = end - gap.offset;
        end = gap.offset;
    }
    gaps.retain(|gap| gap.len > 0);
    gaps
}

/// Times of the capture's lines, by the offset of their first byte.
#[derive(Default)]
struct Times {
    lines: VecDeque<(u64, Option<Time>)>,
}

impl Times {
    fn at(&mut self, offset: u64) -> Option<Time> {
        while self.lines.get(1).is_some_and(|(next, _)| *next <= offset) {
            self.lines.pop_front();
        }
        self.lines.front().and_then(|(_, time)| *time)
    }
}

/// Tells the telegrams of a line.
struct Teller<'a, W> {
    json: bool,
    totals: &'a mut Totals,
    stdout: &'a mut W,
    listener: Listener,
    times: Times,
    damages: Vec<Damage>,
    /// End of the last good telegram.
    end: u64,
}

impl<W: Write> Teller<'_, W> {
    fn gaps_to(&mut self, to: u64) -> Result<(), Stop> {
        for gap in gaps(self.end, to, &mut self.damages) {
            self.totals.discarded_bytes += gap.len;
            // Whoever spoke here is not known, so neither is whose turn it is.
            self.listener.before = Before::Nothing;
            if self.json {
                let object = json!({ "kind": "lb2-error", "offset": gap.offset, "length": gap.len, "reason": gap.reason });
                writeln!(self.stdout, "{object}")?;
            } else {
                writeln!(self.stdout, "{:>8}  ! {} bytes: {}", gap.offset, gap.len, gap.reason)?;
            }
        }
        self.end = to;
        Ok(())
    }

    fn frame(&mut self, offset: u64, frame: &Frame<'_>) -> Result<(), Stop> {
        self.gaps_to(offset)?;
        let told = self.listener.telegram(offset, frame);
        self.end = offset + told.len;
        self.totals.count(LB2, false);
        let time = self.times.at(offset);
        let name = name(told.function, told.sub);
        if self.json {
            let time = time.map(|time| time.0 as f64 / 1e9);
            let object = json!({
                "t": time,
                "kind": "lb2",
                "offset": told.offset,
                "direction": told.direction.word(),
                "function": told.function,
                "sub": told.sub,
                "name": name,
                "fields": told.fields,
                "raw": told.raw,
            });
            writeln!(self.stdout, "{object}")?;
            return Ok(());
        }
        let time = time.map_or_else(String::new, |time| format!("{time:>14}  "));
        let arrow = match told.direction {
            Direction::Request => "->",
            Direction::Reply => "<-",
            Direction::Unknown => "??",
        };
        let name = name.unwrap_or_else(|| match told.sub {
            Some(sub) => format!("function {:02X}h {sub:02X}h", told.function),
            None => format!("function {:02X}h", told.function),
        });
        writeln!(self.stdout, "{time}{:>8}  {arrow} {name}{}", told.offset, words(&told))?;
        Ok(())
    }
}

/// The fields for a person.
fn words(told: &Telegram) -> String {
    let number = |key: &str| told.fields.get(key).and_then(Value::as_u64);
    let mut words: Vec<String> = Vec::new();
    for (key, value) in &told.fields {
        let value = match value {
            Value::String(text) if key == "data" && text.len() > 32 => {
                format!("{}… ({} bytes)", text.get(..32).unwrap_or(""), text.len() / 2)
            }
            Value::String(text) => text.clone(),
            Value::Array(list) => {
                let failures = list.iter().map(|stored| {
                    let of = |key: &str| stored.get(key).and_then(Value::as_u64).unwrap_or(0);
                    format!("axis {} {}", of("axis"), lb2::code::Failure(of("failure") as u8))
                });
                let failures: Vec<_> = failures.collect();
                if failures.is_empty() { "none".into() } else { failures.join(", ") }
            }
            value => value.to_string(),
        };
        words.push(format!("{} {value}", key.replace('_', " ")));
    }
    if let Some(code) = number("error_code") {
        words.push(lb2::code::ErrorCode(code as u8).to_string());
    }
    if let Some(device) = number("device") {
        words.push(format!("GEL {device}"));
    }
    if words.is_empty() { String::new() } else { format!(": {}", words.join(", ")) }
}

/// Name of a function as the manual's table has it, beginning with a small letter.
fn name(function: u8, sub: Option<u8>) -> Option<String> {
    let name = telegram::name(function, sub)?;
    let mut letters = name.chars();
    let first = letters.next()?.to_ascii_lowercase();
    Some(core::iter::once(first).chain(letters).collect())
}

pub(super) fn decode<R: Read>(
    json: bool,
    file: &str,
    mut reader: Lb2Reader<R>,
    totals: &mut Totals,
    stdout: &mut impl Write,
    mut damaged: impl FnMut(&LineDamage),
) -> Result<(), Stop> {
    let mut decoder = Decoder::new();
    let mut teller = Teller {
        json,
        totals,
        stdout,
        listener: Listener { before: Before::Nothing },
        times: Times::default(),
        damages: Vec::new(),
        end: 0,
    };
    let failed = |error: CaptureError| Exit::file(file, &error);
    while let Some(chunk) = reader.next().map_err(failed)? {
        match chunk {
            Chunk::Damage(damage) => {
                teller.totals.damaged += 1;
                damaged(&damage);
            }
            Chunk::Bytes { time, bytes } => {
                teller.times.lines.push_back((decoder.position(), time));
                feed(&mut decoder, bytes, &mut teller)?;
                // What has been decided needs no times any more.
                teller.times.at(teller.end);
            }
        }
    }
    // An open telegram ends with the capture; good ones may lie inside it.
    decoder.gap();
    feed(&mut decoder, &[], &mut teller)?;
    teller.gaps_to(decoder.position())
}

fn feed<W: Write>(decoder: &mut Decoder, mut bytes: &[u8], teller: &mut Teller<'_, W>) -> Result<(), Stop> {
    loop {
        let (taken, item) = decoder.decode(bytes);
        match item {
            Some(Item::Frame { offset, frame }) => teller.frame(offset, &frame)?,
            Some(Item::Damage(damage)) => teller.damages.push(damage),
            None => return Ok(()),
        }
        bytes = bytes.get(taken..).unwrap_or(&[]);
    }
}
