//! Every object of the device file: it can be read and written as its access says.

use std::io;

use canopen_master::Address;
use canopen_master::data_type::Kind;
use canopen_master::eds::{Entry, ObjectType};
use canopen_master::sdo::{AbortCode, Outcome as Ended};

use super::tester::{Checked, Tester, reads, writes};
use super::words::bytes;
use super::{fail, object_case, skip};
use crate::report::Case;

const CLAUSE: &str = "CiA 301, 7.4.3; CiA 306-1, 6.6.3.2";
/// Values longer than this are read, not written back.
const LONGEST: usize = 1024;

/// Why an object is not written, if so.
fn untouchable(index: u16, permitted: bool) -> Option<&'static str> {
    match index {
        0x1003 => Some("the error history is only cleared, which the check of emergencies does"),
        0x1010 | 0x1011 => Some("stores and restores parameters"),
        0x1005 | 0x1012 | 0x1014 | 0x1200..=0x12FF | 0x1400..=0x1BFF => {
            Some("identifiers and PDOs are changed in an order of their own, which the checks of PDOs keep")
        }
        0x1023..=0x1026 | 0x1F20..=0x1F2F | 0x1F50..=0x1F5F | 0x1F80..=0x1F9F => {
            Some("commands, programs and the start of the network")
        }
        0x1000..=0x1FFF => None,
        _ if permitted => None,
        _ => Some("outputs and axes may be behind it, which needs permission"),
    }
}

/// Tests all objects; `told` hears of each case.
pub(super) fn test(tester: &mut Tester<'_>, mut told: impl FnMut(Case)) -> io::Result<()> {
    let objects = &tester.device().objects;
    for object in objects.iter().filter(|object| object.index >= 0x1000) {
        for entry in object.entries().iter().filter(|entry| entry.object_type != ObjectType::NULL) {
            let at = Address::new(object.index, entry.subindex);
            let mut case = |tester: &mut Tester<'_>, what: &str, title: &str, run: Run| {
                let title = format!("{at} {}: {title}", entry.name);
                told(object_case(tester, at, what, title, CLAUSE, |tester| run(tester, at, entry))?);
                io::Result::Ok(())
            };
            let access = entry.access.map_or("ro", |access| access.word());
            if reads(entry) {
                case(tester, "read", &format!("{access}, can be read as its type and limits say"), read)?;
            }
            if writes(entry) && reads(entry) {
                case(tester, "write", &format!("{access}, takes its own value"), write_back)?;
            } else if reads(entry) {
                case(tester, "refuse", &format!("{access}, refuses to be written with 06010002h"), refuse)?;
            }
        }
    }
    Ok(())
}

type Run = fn(&mut Tester<'_>, Address, &Entry) -> Checked;

/// The value, or why there is none to be had now.
fn value(tester: &mut Tester<'_>, at: Address) -> Checked<Vec<u8>> {
    match tester.upload(at, &tester.options(false))? {
        (Ended::Done(_), data) => Ok(data),
        (Ended::Aborted(code @ (AbortCode::NO_DATA | AbortCode::DEVICE_STATE | AbortCode::NO_SDO)), _) => {
            skip(format!("no value now: {code}"))
        }
        (outcome, _) => tester.unreadable(at, outcome),
    }
}

fn read(tester: &mut Tester<'_>, at: Address, entry: &Entry) -> Checked {
    let data = value(tester, at)?;
    let Some(data_type) = entry.data_type else { return Ok(()) };
    let base = tester.device().base_type(data_type);
    if let Some(size) = base.size()
        && data.len() != usize::from(size)
    {
        return fail(format!("{} bytes, {base} has {size}", data.len()));
    }
    let signed = matches!(base.kind(), Kind::Signed(_));
    if !matches!(base.kind(), Kind::Signed(_) | Kind::Unsigned(_)) {
        return Ok(());
    }
    let fill = if signed && data.last().is_some_and(|byte| byte & 0x80 != 0) { 0xFF } else { 0 };
    let mut wide = [fill; 16];
    wide.iter_mut().zip(&data).for_each(|(place, byte)| *place = *byte);
    let number = i128::from_le_bytes(wide);
    let (low, high) = entry.limits(Some(tester.node().raw()));
    if low.is_some_and(|low| number < low) || high.is_some_and(|high| number > high) {
        let text = |limit: Option<i128>| limit.map_or("none".to_owned(), |limit| limit.to_string());
        return fail(format!("the value {number} is outside its limits {} to {}", text(low), text(high)));
    }
    Ok(())
}

fn write_back(tester: &mut Tester<'_>, at: Address, _entry: &Entry) -> Checked {
    if let Some(why) = untouchable(at.index, tester.config.permitted) {
        return skip(format!("not written: {why}"));
    }
    let data = value(tester, at)?;
    if data.is_empty() || data.len() > LONGEST {
        return skip(format!("not written back: {} bytes", data.len()));
    }
    match tester.download(at, &data, &tester.options(false))? {
        Ended::Done(_) => {}
        Ended::Aborted(code @ (AbortCode::DEVICE_STATE | AbortCode::LOCAL_CONTROL)) => {
            return skip(format!("not to be written now: {code}"));
        }
        outcome => return fail(format!("its own value {} is not taken: {outcome}", bytes(&data))),
    }
    Ok(())
}

fn refuse(tester: &mut Tester<'_>, at: Address, _entry: &Entry) -> Checked {
    // The device file may be wrong about the access: what must not be written is not tried either.
    if let Some(reason) = untouchable(at.index, tester.config.permitted) {
        return skip(format!("not tried: {reason}"));
    }
    let data = value(tester, at)?;
    if data.is_empty() || data.len() > LONGEST {
        return skip(format!("not tried: {} bytes", data.len()));
    }
    match tester.download(at, &data, &tester.options(false))? {
        Ended::Aborted(AbortCode::READ_ONLY) => Ok(()),
        Ended::Done(_) => fail("it was accepted; abort code 06010002h expected"),
        outcome => fail(format!("{outcome}; abort code 06010002h expected")),
    }
}
