//! A PVL file into a drive.

use std::io::{BufRead, Seek};

use linmot::code::Status;
use linmot::curve::InfoBlock;
use linmot::link::{Fault, Link, LinkExt};
use linmot::pvl::Event;
use linmot::range::Range;
use linmot::request::{Access, List, Memory, Request, Value};
use linmot::upid::{Upid, Usage};

use super::{Progress, Summary, TransferError, read};

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
    let mut done = Progress { begun: !options.dry_run, ..Progress::default() };
    progress(done);
    if !options.dry_run {
        link.ask(Request::Stop)?;
        if options.delete_curves {
            link.ask(Request::DeleteCurves)?;
        }
    }
    let mut curve: Option<(Access, InfoBlock, usize)> = None;
    read(file, |event| -> Result<(), TransferError<L::Error>> {
        match event {
            Event::Parameter { upid, value } => {
                if let Some((_, range)) = other(link, upid, value)? {
                    if !options.dry_run {
                        link.ask(Request::Write { memory: Memory::Rom, upid, value })?;
                        link.verify(upid, Memory::Rom, value, &range)?;
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
        if options.delete_curves || !summary.curves.is_empty() {
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

/// The ROM value of a parameter, raw, with its range, if it is another number than `value`. Of a signed type
/// a file may have either form of a negative number.
pub(super) fn other<L: Link>(
    link: &mut L,
    upid: Upid,
    value: u32,
) -> Result<Option<(u32, Range)>, Fault<L::Error>> {
    let found = link.read(upid, Value::Rom)?;
    if found == value {
        return Ok(None);
    }
    let range = link.range(upid)?;
    Ok((range.number(found) != range.number(value)).then_some((found, range)))
}

/// Every parameter of the file must exist in the drive, be writable there, and take its value.
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
    read(file, |event| -> Result<(), TransferError<L::Error>> {
        if let Event::Parameter { upid, value } = event {
            if !has(&known, upid) {
                refused.push((upid, "is unknown to the drive".to_owned()));
            } else if !has(&writable, upid) {
                refused.push((upid, "is read-only in the drive".to_owned()));
            } else if let Some((_, range)) = other(link, upid, value)?
                && !range.contains(value)
            {
                let number = range.number(value);
                refused.push((upid, format!("is {number} in the file, out of range: {range} expected")));
            }
        }
        Ok(())
    })?;
    if refused.is_empty() { Ok(()) } else { Err(TransferError::Parameters(refused)) }
}
