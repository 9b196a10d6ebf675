//! `motionctl can record`: a bus into a capture file.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;
use std::time::SystemTime;

use embedded_can::Frame as _;
use motion_io::can::{CanPort, Event, open};
use motion_io::capture::{Frame, FrameKind, Record, Time, WriteFormat, Writer};
use serde_json::json;

use super::cli::{CanLine, Stream};
use super::network::STEP;
use super::session::{endpoint, gone};
use super::stop_flag;
use crate::cli::Global;
use crate::exit::Exit;
use crate::output::Output;

/// So much of a capture is lost at most when the program is killed.
const FLUSH: Duration = Duration::from_millis(500);

/// The format that a file's name asks for.
fn format_of(path: &Path) -> Result<WriteFormat, Exit> {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or("");
    match extension.to_ascii_lowercase().as_str() {
        "log" => Ok(WriteFormat::Candump),
        "asc" => Ok(WriteFormat::Asc),
        "trc" => Ok(WriteFormat::Trc),
        "pcapng" => Ok(WriteFormat::PcapNg),
        _ => Err(Exit::usage(format!(
            "{}: a file that ends with .log (candump), .asc, .trc or .pcapng expected",
            path.display()
        ))),
    }
}

/// A frame of the bus as a capture has it.
pub(crate) fn recorded(frame: &pdo::Frame, time: Time) -> Option<Record> {
    let (id, extended) = match frame.id() {
        embedded_can::Id::Standard(id) => (u32::from(id.as_raw()), false),
        embedded_can::Id::Extended(id) => (id.as_raw(), true),
    };
    let frame = if frame.is_remote() {
        Frame::new(id, extended, FrameKind::Remote, [0; 8].get(..frame.dlc())?)
    } else {
        Frame::new(id, extended, FrameKind::Data, frame.data())
    }?;
    Some(Record { time: Some(time), ..Record::new(frame) })
}

/// The time of day, to the microsecond.
fn now() -> Time {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    Time::from_zero(now).whole_micros()
}

/// Listens on an open endpoint, on which nothing is sent, for `limit` or until stopped. `take` is also called
/// when nothing has come for a step.
pub(super) fn listen(
    port: &mut dyn CanPort,
    limit: Option<Duration>,
    stop: &AtomicBool,
    mut take: impl FnMut(Duration, Option<Event>) -> Result<(), Exit>,
) -> Result<(), Exit> {
    let start = port.now();
    while !stop.load(Ordering::Relaxed) {
        let passed = port.now().saturating_sub(start);
        let left = limit.map_or(Duration::MAX, |limit| limit.saturating_sub(passed));
        if left.is_zero() {
            break;
        }
        let event = port.receive(left.min(STEP)).map_err(|error| gone(&error))?;
        take(port.now().saturating_sub(start), event)?;
    }
    Ok(())
}

pub(super) fn run(
    out: &Output,
    global: &Global,
    line: &CanLine,
    path: &Path,
    run: &Stream,
) -> Result<(), Exit> {
    let format = format_of(path)?;
    let limit = run.limit;
    let endpoint = endpoint(global, line)?;
    let name = path.display().to_string();
    if out.only_plans(|| format!("would record {endpoint} to {name}")) {
        return Ok(());
    }
    let trouble = |error: io::Error| Exit::file(&name, &error);
    let mut port = open(&endpoint).map_err(|error| Exit::trouble(error.to_string()))?;
    let mut writer = Writer::new(BufWriter::new(File::create(path).map_err(trouble)?), format);
    let stop = stop_flag()?;
    let text = endpoint.to_string();
    out.document(json!({ "event": "ready", "endpoint": text, "file": name }), || {
        println!("recording {text} to {name}");
    });
    let (mut frames, mut flushed) = (0u64, Duration::ZERO);
    let heard = listen(&mut *port, limit, &stop, |passed, event| {
        match event {
            Some(Event::Frame(frame)) => {
                if let Some(record) = recorded(&frame, now()) {
                    writer.write(&record, None).map_err(trouble)?;
                    frames += 1;
                }
            }
            Some(Event::Bus(event)) => out.remark(event.to_string()),
            _ => {}
        }
        if passed.saturating_sub(flushed) >= FLUSH {
            flushed = passed;
            writer.flush().map_err(trouble)?;
        }
        Ok(())
    });
    // What was recorded is kept, whatever ended it.
    writer.finish().map_err(trouble)?;
    heard?;
    out.document(json!({ "event": "recorded", "frames": frames }), || println!("{frames} frames"));
    Ok(())
}
