//! `motionctl decode`: captures to words, or to JSON objects one a line.
//!
//! `hear` understands the frames, `json` writes frames and transfers as the contract of `decode --json`
//! says, `story` tells what happened, `lb2` does both for LB2 lines, `names` has the words for objects.

pub(crate) mod cli;
mod hear;
mod json;
mod lb2;
mod linmot;
pub(crate) mod names;
pub(crate) mod story;

use std::io::{self, BufWriter, Read, Write};

use canopen_master::trace::Kind;
use motion_io::capture::{Capture, CaptureError, Damage, FrameKind, Item, Lb2Reader, Reader};

use crate::exit::Exit;
use crate::output::{Harmless, Output};
use cli::Decode;
pub(crate) use hear::{Ear, Teller, number_of};
use json::Json;
use names::Names;
use story::Story;

/// Bytes of standard output that are written at once.
const BLOCK: usize = 256 * 1024;

/// What has been decoded, for the last object or line.
#[derive(Debug, Default)]
pub(crate) struct Totals {
    frames: u64,
    /// Of these: second copies of sent frames.
    copies: u64,
    discarded_bytes: u64,
    damaged: usize,
    /// Frames that are no copies.
    by_kind: [u64; NAMES.len()],
    /// The copies.
    copies_by_kind: [u64; NAMES.len()],
}

/// A file that is of another format than it was taken for, or damaged from end to end.
const NOTHING: &str = "a capture expected, not one frame is in it; --format says which format it has";

/// Names of what a frame can be, in the order of the summary.
const NAMES: [&str; 17] = [
    "nmt",
    "sync",
    "time",
    "emcy",
    "pdo",
    "sdo-request",
    "sdo-response",
    "sdo-abort",
    "guard-request",
    "guard-reply",
    "heartbeat",
    "boot-up",
    "lss",
    "can-link",
    "error-frame",
    "unknown",
    "lb2",
];
const ERROR_FRAME: usize = 14;
const UNKNOWN: usize = 15;
const LB2: usize = 16;

/// Place in [`NAMES`].
const fn name_of(frame: FrameKind, kind: &Kind) -> usize {
    match kind {
        _ if matches!(frame, FrameKind::Error) => ERROR_FRAME,
        Kind::Nmt { .. } => 0,
        Kind::Sync { .. } => 1,
        Kind::Time(_) => 2,
        Kind::Emcy { .. } => 3,
        Kind::Pdo { .. } => 4,
        Kind::SdoRequest(_) => 5,
        Kind::SdoResponse(_) => 6,
        Kind::SdoAbort(_) => 7,
        Kind::GuardRequest { .. } => 8,
        Kind::GuardReply { .. } => 9,
        Kind::Heartbeat { .. } => 10,
        Kind::BootUp { .. } => 11,
        Kind::Lss(_) => 12,
        Kind::CanLink { .. } => 13,
        _ => UNKNOWN,
    }
}

/// What a frame is called that came from a bus.
pub(crate) const fn kind_name(kind: &Kind) -> &'static str {
    NAMES[name_of(FrameKind::Data, kind)]
}

/// Whom a frame is from or for; an NMT command to all nodes is for 0.
pub(crate) const fn node_of(kind: &Kind) -> Option<u8> {
    Some(match *kind {
        Kind::Nmt { target, .. } => target,
        Kind::Emcy { node, .. }
        | Kind::Pdo { node, .. }
        | Kind::GuardRequest { node, .. }
        | Kind::GuardReply { node, .. }
        | Kind::Heartbeat { node, .. }
        | Kind::BootUp { node, .. } => node.raw(),
        Kind::SdoRequest(frame) | Kind::SdoResponse(frame) | Kind::SdoAbort(frame) => frame.node.raw(),
        _ => return None,
    })
}

impl Totals {
    /// What gave no frame.
    const fn rejected(&self) -> u64 {
        self.damaged as u64 + self.discarded_bytes
    }

    fn count(&mut self, name: usize, copy: bool) {
        self.frames += 1;
        self.copies += u64::from(copy);
        let by_kind = if copy { &mut self.copies_by_kind } else { &mut self.by_kind };
        if let Some(count) = by_kind.get_mut(name) {
            *count += 1;
        }
    }
}

/// What of each kind was counted; copies are not.
pub(crate) fn counted_kinds(totals: &Totals) -> impl Iterator<Item = (&'static str, u64)> {
    named(&totals.by_kind)
}

/// Names with what was counted of them.
fn named(counts: &[u64; NAMES.len()]) -> impl Iterator<Item = (&'static str, u64)> {
    NAMES.into_iter().zip(*counts).filter(|(_, count)| *count > 0)
}

/// How the work ends early.
enum Stop {
    /// The reader of standard output has had enough.
    Enough,
    /// Standard output takes no more.
    Output(Exit),
    /// A capture cannot be read.
    Capture(Exit),
}

impl From<Exit> for Stop {
    fn from(exit: Exit) -> Self {
        Self::Capture(exit)
    }
}

impl From<io::Error> for Stop {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::BrokenPipe => Self::Enough,
            _ => Self::Output(Exit::file("standard output", &error)),
        }
    }
}

pub(crate) fn run(out: &Output, args: &Decode) -> Result<(), Exit> {
    let names = Names::read(&args.reading.eds, &args.reading.linmot)?;
    let mut totals = Totals::default();
    let stdout = io::stdout().lock();
    let stdout: Box<dyn Write> = if out.json { Box::new(stdout) } else { Box::new(Harmless(stdout)) };
    let mut stdout = BufWriter::with_capacity(BLOCK, stdout);
    let mut unreadable = None;
    let mut decode = || -> Result<(), Stop> {
        for file in &args.files {
            if !out.json && args.files.len() > 1 {
                writeln!(stdout, "== {file}")?;
            }
            let before = (totals.frames, totals.rejected());
            let decoded = decode_file(out, args, file, &names, &mut totals, &mut stdout);
            let decoded =
                decoded.and_then(|()| match (totals.frames - before.0, totals.rejected() - before.1) {
                    (0, 1..) => Err(Stop::Capture(Exit::file(file, &NOTHING))),
                    _ => Ok(()),
                });
            match decoded {
                // The others are decoded all the same.
                Err(Stop::Capture(exit)) => {
                    if let Some(before) = unreadable.replace(exit) {
                        out.failed(&before);
                    }
                }
                done => done?,
            }
        }
        if out.json {
            json::summary(&totals, &mut stdout)?;
        } else {
            story::summary(&totals, &mut stdout)?;
        }
        Ok(stdout.flush()?)
    };
    match decode() {
        Ok(()) | Err(Stop::Enough) => unreadable.map_or(Ok(()), Err),
        Err(Stop::Output(exit) | Stop::Capture(exit)) => Err(exit),
    }
}

fn decode_file(
    out: &Output,
    args: &Decode,
    file: &str,
    names: &Names,
    totals: &mut Totals,
    stdout: &mut impl Write,
) -> Result<(), Stop> {
    let failed = |error: CaptureError| Exit::file(file, &error);
    let source: Box<dyn Read> = if file == "-" {
        Box::new(io::stdin().lock())
    } else {
        Box::new(std::fs::File::open(file).map_err(|error| Exit::file(file, &error))?)
    };
    match args.reading.open(source).map_err(failed)? {
        Capture::Lb2(reader) => {
            lb2::decode(out.json, file, reader, totals, stdout, |damage| report(file, damage))
        }
        Capture::Can(reader) => {
            let ear = &mut Ear::new(names, args.reading.can_link);
            if out.json {
                decode_can(file, reader, ear, &mut Json::new(names), totals, stdout)
            } else {
                let mut story = Story::new(names, args.frames);
                decode_can(file, reader, ear, &mut story, totals, stdout)?;
                story.end(ear);
                Ok(stdout.write_all(story.text())?)
            }
        }
    }
}

/// An LB2 line in words or, with `json`, as objects, written to `to`.
pub(crate) fn decode_lb2<R: Read>(
    json: bool,
    file: &str,
    reader: Lb2Reader<R>,
    to: &mut impl Write,
    damaged: impl FnMut(&Damage),
) -> Result<(), Exit> {
    match lb2::decode(json, file, reader, &mut Totals::default(), to, damaged) {
        Ok(()) | Err(Stop::Enough) => Ok(()),
        Err(Stop::Output(exit) | Stop::Capture(exit)) => Err(exit),
    }
}

fn decode_can<R: Read>(
    file: &str,
    mut reader: Reader<R>,
    ear: &mut Ear,
    teller: &mut impl Teller,
    totals: &mut Totals,
    stdout: &mut impl Write,
) -> Result<(), Stop> {
    let read = loop {
        match reader.next() {
            Err(error) => break Err(Exit::file(file, &error)),
            Ok(None) => break Ok(()),
            Ok(Some(Item::Damage(damage))) => {
                totals.damaged += 1;
                report(file, &damage);
                continue;
            }
            Ok(Some(Item::Frame(_))) => {}
        }
        ear.hear_next(&reader, teller, totals);
        // Who listens to a bus through a pipe sees what it does when it does it.
        let drained = reader.is_drained();
        if drained || teller.text().len() >= BLOCK {
            stdout.write_all(teller.text())?;
            teller.text().clear();
        }
        if drained {
            stdout.flush()?;
        }
    };
    ear.finish(teller);
    stdout.write_all(teller.text())?;
    teller.text().clear();
    Ok(read?)
}

/// A line that gave no frame, on standard error.
fn report(file: &str, damage: &Damage) {
    eprintln!("{file}: {damage}");
}
