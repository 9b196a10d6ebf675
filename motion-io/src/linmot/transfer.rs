//! PVL files to and from a drive, in constant memory: lines and setpoints pass one by one.

use std::io::{self, BufRead, Seek, Write};

use linmot::code::Status;
use linmot::curve::{IDS, InfoBlock};
use linmot::link::{Fault, Link, LinkExt};
use linmot::pvl::{Encoding, Event, LineDecoder, Parser, Problem, Severity, Writer};
use linmot::request::{Access, List, Memory, Request, Value};
use linmot::upid::{Incompatible, Layer, TreeIdentity, Upid, Usage};

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
    /// The drive has no such parameter, or it cannot be written.
    #[error("{}", refusals(.0))]
    Parameters(Vec<(Upid, &'static str)>),
    /// A curve of another size is in the drive, and single curves cannot be deleted.
    #[error(
        "curve {0} is in the drive with another number of setpoints; delete all curves first, or restore with that option"
    )]
    CurveSize(u16),
}

fn more(errors: usize) -> String {
    if errors > 1 { format!(" (and {} errors more)", errors - 1) } else { String::new() }
}

fn join(violations: &[Incompatible]) -> String {
    violations.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

fn refusals(list: &[(Upid, &'static str)]) -> String {
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

/// How to restore.
#[derive(Debug, Clone, Copy, Default)]
pub struct Options {
    /// Delete all curves of the drive first.
    pub delete_curves: bool,
    /// Only find out what would be written.
    pub dry_run: bool,
}

/// Checks a file, holds it against the drive, and restores it: MC software stopped, ROM parameters,
/// curves to RAM and flash, MC software started. `progress` always tells what is complete, so that
/// after an error the caller can say how far it came; the same restore then completes it.
///
/// # Errors
/// [`TransferError::Check`], [`TransferError::Incompatible`], [`TransferError::Parameters`] and
/// [`TransferError::CurveSize`] before anything was written; the drive's refusal or silence at any step.
pub fn restore<L: Link>(
    link: &mut L,
    file: &mut (impl BufRead + Seek),
    options: Options,
    mut progress: impl FnMut(Progress),
) -> Result<Progress, TransferError<L::Error>> {
    let summary = Summary::of(file)?;
    summary.check()?;
    summary.check_drive(link)?;
    check_parameters(link, file)?;
    if !options.delete_curves {
        for info in &summary.curves {
            curve_access(link, info)?;
        }
    }
    file.rewind()?;
    if !options.dry_run {
        link.ask(Request::Stop)?;
        if options.delete_curves {
            link.ask(Request::DeleteCurves)?;
        }
    }
    let mut done = Progress::default();
    let mut curve: Option<(Access, InfoBlock, usize)> = None;
    read(file, |event| -> Result<(), TransferError<L::Error>> {
        match event {
            Event::Parameter { upid, value } => {
                if link.read(upid, Value::Rom)? != value {
                    if !options.dry_run {
                        link.write(upid, Memory::Rom, value)?;
                    }
                    done.written += 1;
                }
                done.parameters += 1;
                progress(done);
            }
            Event::Curve(info) => {
                let access = if options.delete_curves { Access::Add } else { curve_access(link, &info)? };
                if !options.dry_run {
                    link.start_curve(access, &info)?;
                }
                curve = Some((access, info, 0));
            }
            Event::Setpoint(setpoint) => {
                if let Some((access, info, number)) = &mut curve {
                    *number += 1;
                    if !options.dry_run {
                        link.write_setpoint(*access, info, *number, setpoint)?;
                    }
                    done.setpoints += 1;
                    progress(done);
                }
            }
            Event::EndCurve { .. } => {
                done.curves += 1;
                progress(done);
            }
            _ => {}
        }
        Ok(())
    })?;
    if !options.dry_run {
        if !summary.curves.is_empty() {
            link.ask(Request::SaveCurves)?;
        }
        link.ask(Request::Start)?;
    }
    Ok(done)
}

/// How a curve gets into the drive: one that is there is modified, which needs the same size.
fn curve_access<L: Link>(link: &mut L, info: &InfoBlock) -> Result<Access, TransferError<L::Error>> {
    let request = Request::StartCurve { access: Access::Get, curve: info.id, info: 0, data: 0 };
    match link.ask(request) {
        Ok(reply) if u32::from(reply.words[2]) == info.data_size() => Ok(Access::Modify),
        Ok(_) => Err(TransferError::CurveSize(info.id)),
        Err(Fault::Refused { reply, .. }) if reply.status == Status::DEFINED => Ok(Access::Add),
        Err(fault) => Err(fault.into()),
    }
}

/// Every parameter of the file must exist in the drive and be writable there.
fn check_parameters<L: Link>(
    link: &mut L,
    file: &mut (impl BufRead + Seek),
) -> Result<(), TransferError<L::Error>> {
    // One bit a UPID, so that a file of any size needs no more.
    let (mut known, mut writable) = (vec![false; 1 << 16], vec![false; 1 << 16]);
    let mark = |list: &mut Vec<bool>, upid: Upid| {
        if let Some(bit) = list.get_mut(usize::from(upid.0)) {
            *bit = true;
        }
    };
    link.list(List::All, Upid(0), |item| {
        mark(&mut known, item.upid);
        if item.usage.unwrap_or_default().contains(Usage::ROM_WRITE) {
            mark(&mut writable, item.upid);
        }
    })?;
    let has = |list: &[bool], upid: Upid| list.get(usize::from(upid.0)) == Some(&true);
    let mut refused = Vec::new();
    file.rewind()?;
    read(file, |event| {
        if let Event::Parameter { upid, .. } = event {
            if !has(&known, upid) {
                refused.push((upid, "is unknown to the drive"));
            } else if !has(&writable, upid) {
                refused.push((upid, "is read-only in the drive"));
            }
        }
        Ok::<(), io::Error>(())
    })?;
    if refused.is_empty() { Ok(()) } else { Err(TransferError::Parameters(refused)) }
}

/// One difference between file and drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Difference {
    /// A parameter's ROM value.
    Parameter {
        /// Which.
        upid: Upid,
        /// Value in the file.
        file: u32,
        /// Value in the drive.
        drive: u32,
    },
    /// The drive does not have the parameter.
    Missing(Upid),
    /// The drive does not have the curve.
    MissingCurve(u16),
    /// The drive has a curve that the file does not have.
    ExtraCurve(u16),
    /// The info blocks differ.
    CurveInfo(u16),
    /// Setpoints differ.
    CurveData {
        /// Curve ID.
        id: u16,
        /// Number of the first one that differs, from 1.
        first: usize,
        /// How many.
        count: usize,
    },
}

/// The curve being compared: its info block, setpoints so far, first and number of those that differ.
type Compared = (InfoBlock, usize, Option<(usize, usize)>);

/// Compares a file with the drive's ROM parameters and its curves.
///
/// # Errors
/// The file breaks rules; the drive refuses or is silent.
pub fn compare<L: Link>(
    link: &mut L,
    file: &mut (impl BufRead + Seek),
    mut report: impl FnMut(Difference),
    mut progress: impl FnMut(Progress),
) -> Result<Progress, TransferError<L::Error>> {
    let summary = Summary::of(file)?;
    summary.check()?;
    summary.check_drive(link)?;
    file.rewind()?;
    let mut done = Progress::default();
    let mut curve: Option<Compared> = None;
    read(file, |event| -> Result<(), TransferError<L::Error>> {
        match event {
            Event::Parameter { upid, value } => {
                match link.read(upid, Value::Rom) {
                    Ok(found) if found == value => done.parameters += 1,
                    Ok(drive) => report(Difference::Parameter { upid, file: value, drive }),
                    Err(Fault::Refused { reply, .. }) if reply.status == Status::UPID => {
                        report(Difference::Missing(upid));
                    }
                    Err(fault) => return Err(fault.into()),
                }
                progress(done);
            }
            Event::Curve(info) => {
                curve = None;
                match link.curve_info(info.id)? {
                    None => report(Difference::MissingCurve(info.id)),
                    Some(found) => {
                        if found != info {
                            report(Difference::CurveInfo(info.id));
                        }
                        if found.setpoints == info.setpoints {
                            curve = Some((info, 0, None));
                        }
                    }
                }
            }
            Event::Setpoint(setpoint) => {
                if let Some((info, number, differ)) = &mut curve {
                    *number += 1;
                    if link.read_setpoint(info, *number)? == setpoint {
                        done.setpoints += 1;
                        progress(done);
                    } else {
                        let (first, count) = differ.unwrap_or((*number, 0));
                        *differ = Some((first, count + 1));
                    }
                }
            }
            Event::EndCurve { .. } => match curve.take() {
                Some((info, _, Some((first, count)))) => {
                    report(Difference::CurveData { id: info.id, first, count });
                }
                Some(_) => done.curves += 1,
                None => {}
            },
            _ => {}
        }
        Ok(())
    })?;
    for id in IDS.filter(|id| !summary.curves.iter().any(|info| info.id == *id)) {
        let request = Request::StartCurve { access: Access::Get, curve: id, info: 0, data: 0 };
        match link.ask(request) {
            Ok(_) => report(Difference::ExtraCurve(id)),
            Err(Fault::Refused { .. }) => {}
            Err(fault) => return Err(fault.into()),
        }
    }
    Ok(done)
}
