//! A capture of an LB2 line: which functions were called, the values of parameters, and its story.

use core::time::Duration;
use std::collections::BTreeMap;
use std::io::{self, Read, Write};

use motion_io::capture::Capture;
use serde_json::{Value, json};

use super::Subject;
use super::lines::Lines;
use super::sheet::{Sheet, Table, Tone};
use crate::decode::cli::Reading;
use crate::decode::decode_lb2;
use crate::exit::Exit;

/// How often a function was called and answered.
#[derive(Debug, Default, Clone, PartialEq, Eq)]
struct Calls {
    requests: u64,
    replies: u64,
    /// Telegrams that could be either.
    unknown: u64,
}

/// What the decoder's objects told.
#[derive(Debug, Default)]
pub(super) struct Line {
    file: String,
    functions: BTreeMap<String, Calls>,
    /// By code.
    errors: BTreeMap<u64, u64>,
    values: BTreeMap<u64, i64>,
    telegrams: u64,
    gaps: u64,
    discarded_bytes: u64,
    lines: Lines,
}

/// Whole lines of what is written.
struct ByLine<F> {
    take: F,
    rest: Vec<u8>,
}

impl<F: FnMut(&str)> Write for ByLine<F> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        for byte in bytes {
            if *byte == b'\n' {
                (self.take)(&String::from_utf8_lossy(&self.rest));
                self.rest.clear();
            } else {
                self.rest.push(*byte);
            }
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Line {
    pub(super) fn read(
        file: &str,
        reading: &Reading,
        content: impl Fn() -> Result<Box<dyn Read>, Exit>,
    ) -> Result<Self, Exit> {
        let mut line = Self { file: file.to_owned(), ..Self::default() };
        let decode = |json, take: &mut dyn FnMut(&str)| {
            let capture = reading.open(content()?).map_err(|error| Exit::file(file, &error))?;
            let Capture::Lb2(reader) = capture else {
                return Err(Exit::file(file, &"it is another file now"));
            };
            let mut lines = ByLine { take, rest: Vec::new() };
            // Told once, though it is read twice.
            decode_lb2(json, file, reader, &mut lines, |damage| {
                if json {
                    eprintln!("{file}: {damage}");
                }
            })
        };
        decode(true, &mut |object| line.take(object))?;
        let mut lines = Lines::default();
        decode(false, &mut |text| lines.push(text.to_owned()))?;
        line.lines = lines;
        Ok(line)
    }

    /// One object of the decoder.
    fn take(&mut self, object: &str) {
        let Ok(object) = serde_json::from_str::<Value>(object) else { return };
        if object["kind"] == "lb2-error" {
            self.gaps += 1;
            self.discarded_bytes += object["length"].as_u64().unwrap_or(0);
            return;
        }
        self.telegrams += 1;
        let fields = &object["fields"];
        if let Some(code) = fields["error_code"].as_u64() {
            *self.errors.entry(code).or_default() += 1;
        }
        if let (Some(index), Some(value)) = (fields["index"].as_u64(), fields["value"].as_i64()) {
            self.values.insert(index, value);
        }
        let hex = |key: &str| object[key].as_u64().map(|byte| format!("{byte:02X}h"));
        let function = [hex("function"), hex("sub")].into_iter().flatten().collect::<Vec<_>>().join(" ");
        let name = object["name"].as_str().map_or_else(String::new, |name| format!("  {name}"));
        let calls = self.functions.entry(format!("{function}{name}")).or_default();
        match object["direction"].as_str() {
            Some("request") => calls.requests += 1,
            Some("reply") => calls.replies += 1,
            _ => calls.unknown += 1,
        }
    }
}

impl Subject for Line {
    fn advance(&mut self, wait: Duration) -> Result<(), Exit> {
        std::thread::sleep(wait);
        Ok(())
    }

    fn enough(&self, _: Duration) -> bool {
        true
    }

    fn sheet(&self) -> Sheet {
        let columns = ["function", "requests>", "replies>", "either>"];
        let mut functions = Table::new("Functions", &columns, "no telegram");
        for (name, calls) in &self.functions {
            let numbers = [calls.requests, calls.replies, calls.unknown].map(|number| number.to_string());
            functions.push(Tone::Plain, core::iter::once(name.clone()).chain(numbers));
        }
        let mut errors = Table::new("Errors", &["what", "times>"], "none");
        for (&code, times) in &self.errors {
            let words = lb2::code::ErrorCode(u8::try_from(code).unwrap_or(u8::MAX)).to_string();
            errors.push(Tone::Bad, [format!("{words} ({code:02X}h)"), times.to_string()]);
        }
        if self.gaps > 0 {
            let what = format!("{} bytes outside of telegrams", self.discarded_bytes);
            errors.push(Tone::Warn, [what, self.gaps.to_string()]);
        }
        let mut values = Table::new("Parameters, last values", &["parameter", "value>"], "none");
        for (&index, value) in &self.values {
            let entry = u16::try_from(index).ok().and_then(motion_core::parameters::get);
            let name = entry.map_or_else(|| format!("[{index:03}]"), |entry| entry.to_string());
            values.push(Tone::Plain, [name, value.to_string()]);
        }
        let head = format!("{}  {} LB2 telegrams", self.file, self.telegrams);
        Sheet { head, tables: vec![functions, errors, values, self.lines.table("nothing")] }
    }

    fn document(&self) -> Value {
        let functions = self.functions.iter().map(|(name, calls)| {
            json!({ "function": name, "requests": calls.requests, "replies": calls.replies, "unknown": calls.unknown })
        });
        let errors = self.errors.iter().map(|(code, times)| json!({ "error_code": code, "times": times }));
        let values = self.values.iter().map(|(index, value)| json!({ "index": index, "value": value }));
        json!({
            "source": self.file,
            "telegrams": self.telegrams,
            "discarded_bytes": self.discarded_bytes,
            "functions": functions.collect::<Vec<_>>(),
            "errors": errors.collect::<Vec<_>>(),
            "parameters": values.collect::<Vec<_>>(),
            "story": self.lines,
        })
    }
}
