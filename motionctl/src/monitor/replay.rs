//! A capture of buses: its end, or any other moment of it.

use core::time::Duration;
use std::io::{Cursor, Read};
use std::path::PathBuf;
use std::sync::Arc;

use motion_io::capture::{Capture, Item, Reader};
use serde_json::{Value, json};

use super::bus::Buses;
use super::line::Line;
use super::sheet::Sheet;
use super::{Step, Subject};
use crate::decode::cli::Reading;
use crate::decode::names::Names;
use crate::exit::Exit;
use crate::output::counted;

/// A long step is so many parts of the capture.
const PARTS: u64 = 20;

/// Content that can be read again.
#[derive(Debug, Clone)]
enum Content {
    File(PathBuf),
    /// Of standard input.
    Bytes(Arc<[u8]>),
}

impl Content {
    fn read(file: &str) -> Result<Self, Exit> {
        if file != "-" {
            return Ok(Self::File(file.into()));
        }
        let mut bytes = Vec::new();
        std::io::stdin().read_to_end(&mut bytes).map_err(|error| Exit::file("standard input", &error))?;
        Ok(Self::Bytes(bytes.into()))
    }

    fn open(&self) -> std::io::Result<Box<dyn Read>> {
        Ok(match self {
            Self::File(path) => Box::new(std::fs::File::open(path)?),
            Self::Bytes(bytes) => Box::new(Cursor::new(Arc::clone(bytes))),
        })
    }
}

/// Opens a capture, of buses or of a line, and goes to its end.
pub(super) fn open<'a>(
    file: &str,
    reading: &'a Reading,
    names: &'a Names,
    bit_rate: Option<u32>,
) -> Result<Box<dyn Subject + 'a>, Exit> {
    let content = Content::read(file)?;
    let source = content.open().map_err(|error| Exit::file(file, &error))?;
    match reading.open(source).map_err(|error| Exit::file(file, &error))? {
        Capture::Lb2(_) => {
            // Read twice: for its tables, and in words.
            let again = || content.open().map_err(|error| Exit::file(file, &error));
            Ok(Box::new(Line::read(file, reading, again)?))
        }
        Capture::Can(reader) => {
            let buses = Buses::new(file.to_owned(), names, reading.can_link, bit_rate);
            let mut replay = Replay {
                file: file.to_owned(),
                content,
                reading,
                names,
                bit_rate,
                reader,
                buses,
                at: 0,
                total: None,
                damaged: 0,
            };
            replay.forth(u64::MAX)?;
            Ok(Box::new(replay))
        }
    }
}

/// A capture of buses at a moment.
struct Replay<'a> {
    file: String,
    content: Content,
    reading: &'a Reading,
    names: &'a Names,
    bit_rate: Option<u32>,
    reader: Reader<Box<dyn Read>>,
    buses: Buses<'a>,
    /// Frames that have been heard.
    at: u64,
    /// Frames of all of it, once its end has been reached.
    total: Option<u64>,
    /// Lines that gave no frame.
    damaged: usize,
}

impl Replay<'_> {
    /// Hears frames up to this number, or to the end.
    fn forth(&mut self, to: u64) -> Result<(), Exit> {
        while self.at < to {
            match self.reader.next().map_err(|error| Exit::file(&self.file, &error))? {
                Some(Item::Frame(_)) => {
                    self.buses.hear_next(&self.reader);
                    self.at += 1;
                }
                Some(Item::Damage(damage)) => {
                    self.damaged += 1;
                    // The first time through.
                    if self.total.is_none() {
                        eprintln!("{}: {damage}", self.file);
                    }
                }
                None => {
                    self.buses.finish();
                    self.total = Some(self.at);
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Begins anew.
    fn rewind(&mut self) -> Result<(), Exit> {
        let source = self.content.open().map_err(|error| Exit::file(&self.file, &error))?;
        match self.reading.open(source).map_err(|error| Exit::file(&self.file, &error))? {
            Capture::Can(reader) => self.reader = reader,
            Capture::Lb2(_) => return Err(Exit::file(&self.file, &"it is another file now")),
        }
        self.buses = Buses::new(self.file.clone(), self.names, self.reading.can_link, self.bit_rate);
        (self.at, self.damaged) = (0, 0);
        Ok(())
    }
}

impl Subject for Replay<'_> {
    fn advance(&mut self, wait: Duration) -> Result<(), Exit> {
        std::thread::sleep(wait);
        Ok(())
    }

    fn enough(&self, _: Duration) -> bool {
        true
    }

    fn sheet(&self) -> Sheet {
        let mut sheet = self.buses.sheet();
        let total = self.total.unwrap_or(self.at);
        let damaged = match self.damaged {
            0 => String::new(),
            lines => format!("{} gave no frame  ", counted(lines, "line", "lines")),
        };
        sheet.head = format!("frame {} of {total}  {damaged}{}", self.at, sheet.head);
        sheet
    }

    fn document(&self) -> Value {
        let mut document = self.buses.document();
        document["frames"] = json!(self.at);
        document["damaged"] = json!(self.damaged);
        document
    }

    fn go(&mut self, step: Step) -> Result<bool, Exit> {
        let total = self.total.unwrap_or(self.at);
        let far = (total / PARTS).max(1);
        let to = match step {
            Step::Forth => self.at.saturating_add(1).min(total),
            Step::Back => self.at.saturating_sub(1),
            Step::FarForth => self.at.saturating_add(far).min(total),
            Step::FarBack => self.at.saturating_sub(far),
            Step::Start => 1.min(total),
            Step::End => total,
        };
        if to < self.at {
            self.rewind()?;
        }
        if to > self.at {
            // Behind the last frame is the end, where what is open shows.
            self.forth(if to == total { u64::MAX } else { to })?;
        }
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What was still open at the end was told on the first way there alone.
    #[test]
    fn the_end_is_the_same_however_it_is_reached() {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        let log = "(1.0) can0 601#4000100000000000\n(2.0) can0 701#05\nend\n";
        std::io::Write::write_all(&mut file, log.as_bytes()).unwrap();
        let reading =
            Reading { eds: Vec::new(), linmot: Vec::new(), can_link: false, format: None, times: None };
        let names = Names::default();
        let mut replay = open(file.path().to_str().unwrap(), &reading, &names, None).unwrap();
        let end = replay.document();
        assert!(end["story"].to_string().contains("NO ANSWER") && end["damaged"] == 1, "{end}");
        for way in [[Step::Start, Step::End], [Step::Back, Step::Forth], [Step::FarBack, Step::FarForth]] {
            for step in way {
                replay.go(step).unwrap();
            }
            assert_eq!(replay.document(), end, "{way:?}");
        }
    }
}
