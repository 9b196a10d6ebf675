//! A PVL file beside a drive.

use std::io::{BufRead, Seek};

use linmot::code::Status;
use linmot::curve::{IDS, InfoBlock};
use linmot::link::{Fault, Link, LinkExt};
use linmot::pvl::Event;
use linmot::range::Range;
use linmot::request::{Access, Request};
use linmot::upid::Upid;

use super::restore::other;
use super::{Progress, Summary, TransferError, read};

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
        /// The drive's range, by which the raw values are numbers.
        range: Range,
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

/// The curve being compared.
struct Compared {
    /// Of the file.
    info: InfoBlock,
    /// Whether the drive has the same.
    same_info: bool,
    /// Setpoints so far.
    number: usize,
    /// The first that differs, and how many do.
    differ: Option<(usize, usize)>,
}

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
                match other(link, upid, value) {
                    Ok(None) => done.parameters += 1,
                    Ok(Some((drive, range))) => {
                        report(Difference::Parameter { upid, file: value, drive, range });
                    }
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
                            curve =
                                Some(Compared { info, same_info: found == info, number: 0, differ: None });
                        }
                    }
                }
            }
            Event::Setpoint(setpoint) => {
                if let Some(Compared { info, number, differ, .. }) = &mut curve {
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
                Some(Compared { info, differ: Some((first, count)), .. }) => {
                    report(Difference::CurveData { id: info.id, first, count });
                }
                Some(Compared { same_info, .. }) => done.curves += usize::from(same_info),
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
            Err(Fault::Refused { reply, .. }) if reply.status == Status::DEFINED => {}
            Err(fault) => return Err(fault.into()),
        }
    }
    Ok(done)
}
