//! PVL files to and from a drive, in constant memory: lines and setpoints pass one by one.

mod compare;
mod restore;

use std::io::{self, BufRead, Write};

use linmot::curve::{IDS, InfoBlock};
use linmot::link::{Fault, Link, LinkExt};
use linmot::pvl::{Encoding, Event, LineDecoder, Parser, Problem, Severity, Writer};
use linmot::request::{List, Value};
use linmot::upid::{Incompatible, Layer, TreeIdentity, Upid, Usage};

pub use compare::{Difference, compare};
pub use restore::{Options, restore};

use super::lines::Lines;

/// Why a transfer ended early.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TransferError<E> {
    /// The file.
    #[error("{0}")]
    File(#[from] io::Error),
    /// The drive.
    #[error(transparent)]
    Drive(#[from] Fault<E>),
    /// The file breaks rules; see the diagnostics.
    #[error("line {line}: {problem}{}", more(*.errors))]
    Check {
        /// The first error's line.
        line: usize,
        /// The first error.
        problem: Problem,
        /// How many errors there are.
        errors: usize,
    },
    /// The file is of another firmware.
    #[error("{}", join(.0))]
    Incompatible(Vec<Incompatible>),
    /// The drive has no such parameter, or it cannot be written, or not with this value.
    #[error("{}", refusals(.0))]
    Parameters(Vec<(Upid, String)>),
    /// A curve of another size is in the drive, and single curves cannot be deleted.
    #[error(
        "curve {0} is in the drive with another number of setpoints; delete all curves first, or restore with that option"
    )]
    CurveSize(u16),
}

fn more(errors: usize) -> String {
    match errors.saturating_sub(1) {
        0 => String::new(),
        1 => " (and 1 error more)".into(),
        more => format!(" (and {more} errors more)"),
    }
}

fn join(violations: &[Incompatible]) -> String {
    violations.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

fn refusals(list: &[(Upid, String)]) -> String {
    let shown: Vec<String> = list.iter().take(5).map(|(upid, why)| format!("UPID {upid} {why}")).collect();
    match list.len().saturating_sub(5) {
        0 => shown.join("; "),
        more => format!("{}; and {more} more", shown.join("; ")),
    }
}

/// Reads a file's events; returns its encoding.
///
/// # Errors
/// The file cannot be read, or `sink` says so.
pub fn read<E: From<io::Error>>(
    file: &mut impl BufRead,
    mut sink: impl FnMut(Event) -> Result<(), E>,
) -> Result<Encoding, E> {
    let (mut parser, mut decoder, mut lines) = (Parser::new(), LineDecoder::new(), Lines::new(file));
    let mut result = Ok(());
    loop {
        let line = lines.next_line()?;
        let mut pass = |event| {
            if result.is_ok() {
                result = sink(event);
            }
        };
        match line {
            Some((_, line)) => parser.line(&decoder.decode(line), &mut pass),
            None => {
                parser.finish(&mut pass);
                return result.map(|()| decoder.encoding());
            }
        }
        if result.is_err() {
            return result.map(|()| decoder.encoding());
        }
    }
}

/// What a file holds.
#[derive(Debug, Clone, Default)]
pub struct Summary {
    /// Objects of parameters.
    pub sections: Vec<(Option<Layer>, TreeIdentity, usize)>,
    /// Parameters in all.
    pub parameters: usize,
    /// Curves' headers.
    pub curves: Vec<InfoBlock>,
    /// Line, severity and problem.
    pub diagnostics: Vec<(usize, Severity, Problem)>,
    /// Diagnostics beyond [`MAX_DIAGNOSTICS`].
    pub more_diagnostics: usize,
    errors: usize,
}

/// Diagnostics that a summary keeps.
pub const MAX_DIAGNOSTICS: usize = 1000;

impl Summary {
    /// Errors among the diagnostics.
    #[must_use]
    pub const fn errors(&self) -> usize {
        self.errors
    }

    /// Reads and checks a file.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of(file: &mut impl BufRead) -> io::Result<Self> {
        let mut summary = Self::default();
        read(file, |event| {
            match event {
                Event::Section { layer, identity } => summary.sections.push((layer, identity, 0)),
                Event::Parameter { .. } => {
                    summary.parameters += 1;
                    if let Some((.., parameters)) = summary.sections.last_mut() {
                        *parameters += 1;
                    }
                }
                // IDs above 100 are errors, so there are no more than that many of interest.
                Event::Curve(info) if summary.curves.len() <= 200 => summary.curves.push(info),
                Event::Problem { line, severity, problem } => {
                    summary.errors += usize::from(severity == Severity::Error);
                    if summary.diagnostics.len() < MAX_DIAGNOSTICS {
                        summary.diagnostics.push((line, severity, problem));
                    } else {
                        summary.more_diagnostics += 1;
                    }
                }
                _ => {}
            }
            Ok::<(), io::Error>(())
        })?;
        Ok(summary)
    }

    /// `Ok` if nothing is wrong.
    ///
    /// # Errors
    /// [`TransferError::Check`] with the first error.
    pub fn check<E>(&self) -> Result<(), TransferError<E>> {
        let first = self.diagnostics.iter().find(|(_, severity, _)| *severity == Severity::Error);
        match first {
            Some((line, _, problem)) => {
                Err(TransferError::Check { line: *line, problem: problem.clone(), errors: self.errors })
            }
            None => Ok(()),
        }
    }

    /// Holds the file's trees against the drive's (manual B 4).
    ///
    /// # Errors
    /// [`TransferError::Incompatible`] with every violation.
    pub fn check_drive<L: Link>(&self, link: &mut L) -> Result<(), TransferError<L::Error>> {
        let mut violations = Vec::new();
        for (layer, identity, _) in &self.sections {
            if let Some(layer) = layer {
                violations.extend(identity.violations(link.identity(*layer)?, *layer));
            }
        }
        if violations.is_empty() { Ok(()) } else { Err(TransferError::Incompatible(violations)) }
    }
}

/// What was transferred so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Progress {
    /// A restore has begun to change the drive.
    pub begun: bool,
    /// Parameters of the drive that are as in the file.
    pub parameters: usize,
    /// Those among them that had to be written.
    pub written: usize,
    /// Complete curves.
    pub curves: usize,
    /// Setpoints.
    pub setpoints: usize,
}

/// Writes the drive's ROM parameters and curves into a file. With `changed`, parameters that have
/// their default are left out.
///
/// # Errors
/// The drive refuses or is silent, or the file cannot be written.
pub fn backup<L: Link>(
    link: &mut L,
    file: &mut impl Write,
    encoding: Encoding,
    changed: bool,
    mut progress: impl FnMut(Progress),
) -> Result<Progress, TransferError<L::Error>> {
    // The list first: between its commands no others may pass.
    let mut upids = Vec::new();
    link.list(List::All, Upid(0), |item| {
        let usage = item.usage.unwrap_or_default();
        if usage.contains(Usage::ROM_READ) && usage.contains(Usage::ROM_WRITE) {
            upids.push(item.upid);
        }
    })?;
    let mut done = Progress::default();
    let mut writer = Writer::new(String::new()).map_err(io::Error::other)?;
    let mut flush = |writer: &mut Writer<String>| {
        let text = core::mem::take(writer.inner());
        file.write_all(&encoding.encode(&text))
    };
    if !encoding.mark().is_empty() {
        let text = core::mem::replace(writer.inner(), "\u{FEFF}".into());
        writer.inner().push_str(&text);
    }
    for layer in Layer::ALL {
        let identity = link.identity(layer)?;
        writer.section(layer, identity).map_err(io::Error::other)?;
        for &upid in upids.iter().filter(|upid| upid.layer() == Some(layer)) {
            let value = link.read(upid, Value::Rom)?;
            if changed && value == link.read(upid, Value::Default)? {
                continue;
            }
            let caption = match layer {
                Layer::Os => "OS",
                Layer::MotionControl => "Motion Control SW",
                Layer::Interface => "Interface SW",
                Layer::Application => "Application",
            };
            writer.parameter(upid, value, caption, &value.to_string()).map_err(io::Error::other)?;
            done.parameters += 1;
            progress(done);
            flush(&mut writer)?;
        }
        writer.end().map_err(io::Error::other)?;
    }
    for id in IDS {
        let Some(info) = link.curve_info(id)? else { continue };
        let name = LineDecoder::new().decode(info.name()).replace(char::is_control, "?");
        writer.curve(&info, &name).map_err(io::Error::other)?;
        for number in 1..=usize::from(info.setpoints) {
            writer.setpoint(link.read_setpoint(&info, number)?).map_err(io::Error::other)?;
            done.setpoints += 1;
            progress(done);
            if writer.inner().len() > 1 << 16 {
                flush(&mut writer)?;
            }
        }
        writer.end().map_err(io::Error::other)?;
        done.curves += 1;
        progress(done);
    }
    flush(&mut writer)?;
    Ok(done)
}
