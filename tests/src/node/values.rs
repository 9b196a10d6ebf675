//! The device file against the device: identity, number of PDOs, and the values after power-on.
//!
//! A reset of the communication brings the communication objects to their power-on values: those stored
//! last, or, where nothing was stored, the file's defaults (CiA 301, 7.3.2.2.1). So
//! - const objects, 1000h, 1018h and the read-only numbers of sub-indices must be as the file says;
//! - COB-IDs must be, too: on another one, a master that was set up by the file does not hear the node. A
//!   stored parameter set may be the reason; the case says so;
//! - other parameters of the communication that can be written must be only where the file has no 1010h.
//!   Where it has one, a value of its own is told, but is no fault;
//! - what the profile and the maker define changes at work and is not compared, unless it is const.
//!
//! Of a DCF the configured value is as good as the default.

use std::io;

use canopen_master::Address;
use canopen_master::data_type::Kind;
use canopen_master::eds::{Access, DataType, Entry, Object, ObjectType, fit, to_bytes};
use canopen_master::nmt::Command;
use canopen_master::sdo::{AbortCode, Outcome as Ended};

use super::tester::{Checked, Tester, number, reads, writes};
use super::words::{bytes, coded};
use super::{Check, Problem, check, fail, object_case, skip};
use crate::report::Case;

pub(super) const CHECKS: &[Check] = &[
    check(
        "file.vendor-number",
        "CiA 306-1, 6.5; CiA 301, 7.5.2.21",
        "VendorNumber of [DeviceInfo] is the node's vendor ID, 1018h:01",
        "",
        |tester| identity(tester, 1, "VendorNumber"),
    ),
    check(
        "file.product-number",
        "CiA 306-1, 6.5; CiA 301, 7.5.2.21",
        "ProductNumber of [DeviceInfo] is the node's product code, 1018h:02",
        "",
        |tester| identity(tester, 2, "ProductNumber"),
    ),
    check(
        "file.revision-number",
        "CiA 306-1, 6.5; CiA 301, 7.5.2.21",
        "RevisionNumber of [DeviceInfo] is the node's revision number, 1018h:03",
        "",
        |tester| identity(tester, 3, "RevisionNumber"),
    ),
    check(
        "file.receive-pdos",
        "CiA 306-1, 6.5; CiA 301, 7.5.2.35",
        "The node has as many RPDOs as NrOfRXPDO of [DeviceInfo] says",
        "",
        |tester| pdos(tester, 0x1400, "NrOfRXPDO"),
    ),
    check(
        "file.transmit-pdos",
        "CiA 306-1, 6.5; CiA 301, 7.5.2.37",
        "The node has as many TPDOs as NrOfTXPDO of [DeviceInfo] says",
        "",
        |tester| pdos(tester, 0x1800, "NrOfTXPDO"),
    ),
];

fn identity(tester: &mut Tester<'_>, sub: u8, key: &str) -> Checked {
    let Some(told) = tester.device().device_info.number(key) else {
        return skip(format!("the device file gives no {key}"));
    };
    let at = Address::new(0x1018, sub);
    match tester.upload(at, &tester.options(false))? {
        (Ended::Done(_), data) if i128::from(number(&data)) == told => Ok(()),
        (Ended::Done(_), data) => {
            fail(format!("{at} is {:X}h, {key} of the device file {told:X}h", number(&data)))
        }
        (Ended::Aborted(code), _) => skip(format!("{at} cannot be read: {}", coded(code))),
        (outcome, _) => tester.unreadable(at, outcome),
    }
}

/// Counts the PDOs that the node has: those of the file, and the others only if these are too few.
fn pdos(tester: &mut Tester<'_>, base: u16, key: &str) -> Checked {
    let Some(told) = tester.device().device_info.number(key) else {
        return skip(format!("the device file gives no {key}"));
    };
    let (described, others): (Vec<u16>, Vec<u16>) =
        (base..base + 0x200).partition(|index| tester.device().object(*index).is_some());
    let mut found = 0;
    for index in &described {
        found += i128::from(exists(tester, *index)?);
    }
    for index in others {
        if found >= told {
            break;
        }
        found += i128::from(exists(tester, index)?);
    }
    if found == told { Ok(()) } else { fail(format!("the node has {found}, {key} says {told}")) }
}

fn exists(tester: &mut Tester<'_>, index: u16) -> Checked<bool> {
    let at = Address::new(index, 0);
    match tester.upload(at, &tester.options(false))? {
        (Ended::Done(_), _) => Ok(true),
        (Ended::Aborted(code), _) => Ok(code != AbortCode::NO_OBJECT && code != AbortCode::NO_SUB_INDEX),
        (outcome, _) => tester.unreadable(at, outcome),
    }
}

/// How much the file's value binds.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Bond {
    /// It never changes.
    Fixed,
    /// An identifier of the bus.
    CobId,
    /// A parameter of the communication.
    Parameter,
}

fn bond(object: &Object, entry: &Entry) -> Option<Bond> {
    let (index, sub) = (object.index, entry.subindex);
    let count = sub == 0 && object.is_composed() && !writes(entry) && index != 0x1003;
    match (index, sub) {
        (0x1000 | 0x1018, _) => Some(Bond::Fixed),
        _ if entry.access == Some(Access::Const) => Some(Bond::Fixed),
        (0x1001..=0x1FFF, 0) if count => Some(Bond::Fixed),
        (0x1005 | 0x1012 | 0x1014, 0) | (0x1200..=0x127F, 1 | 2) | (0x1400..=0x15FF | 0x1800..=0x19FF, 1) => {
            Some(Bond::CobId)
        }
        (0x1006 | 0x1007 | 0x100C | 0x100D | 0x1015..=0x1017 | 0x1019 | 0x1028 | 0x1029, _)
        | (0x1200..=0x12FF | 0x1400..=0x1BFF, _) => Some(Bond::Parameter),
        _ => None,
    }
}

const fn clause(index: u16) -> &'static str {
    match index {
        0x1000 => "CiA 306-1, 6.6.3.2; CiA 301, 7.5.2.1",
        0x1014 => "CiA 306-1, 6.6.3.2; CiA 301, 7.5.2.17",
        0x1018 => "CiA 306-1, 6.6.3.2; CiA 301, 7.5.2.21",
        0x1400..=0x15FF => "CiA 306-1, 6.6.3.2; CiA 301, 7.5.2.35",
        0x1600..=0x17FF => "CiA 306-1, 6.6.3.2; CiA 301, 7.5.2.36",
        0x1800..=0x19FF => "CiA 306-1, 6.6.3.2; CiA 301, 7.5.2.37",
        0x1A00..=0x1BFF => "CiA 306-1, 6.6.3.2; CiA 301, 7.5.2.38",
        _ => "CiA 306-1, 6.6.3.2; CiA 301, 7.3.2.2.1",
    }
}

/// Compares all values that bind; `told` hears of each case.
pub(super) fn test(tester: &mut Tester<'_>, mut told: impl FnMut(Case)) -> io::Result<()> {
    // A node that does not boot has failed another case already.
    if let Err(Problem::Io(error)) = tester.restart(Command::ResetCommunication) {
        return Err(error);
    }
    for object in tester.device().objects.iter().filter(|object| object.index >= 0x1000) {
        let entries = object.entries().iter().filter(|entry| entry.object_type != ObjectType::NULL);
        for entry in entries.filter(|entry| reads(entry)) {
            let Some(bond) = bond(object, entry) else { continue };
            let at = Address::new(object.index, entry.subindex);
            let title = format!("{at} {}: after power-on as the device file says", entry.name);
            let run = |tester: &mut Tester<'_>| compare(tester, at, entry, bond);
            told(object_case(tester, at, "value", title, clause(at.index), run)?);
        }
    }
    Ok(())
}

fn compare(tester: &mut Tester<'_>, at: Address, entry: &Entry, bond: Bond) -> Checked {
    if (at.index, at.sub) == (0x1018, 4) {
        return skip("a serial number is each device's own");
    }
    let texts: Vec<_> = [&entry.default, &entry.value].into_iter().flatten().collect();
    let texts: Vec<_> = texts.into_iter().filter(|text| !text.trim().is_empty()).collect();
    let (Some(first), Some(data_type)) = (texts.first(), entry.data_type) else {
        return skip("the device file gives no value");
    };
    let base = tester.device().base_type(data_type);
    let node = Some(tester.node().raw());
    let wanted = match to_bytes(first, base, node) {
        Ok(wanted) => wanted,
        Err(error) => return skip(format!("the device file's value \"{first}\": {error}")),
    };
    let data = match tester.upload(at, &tester.options(false))? {
        (Ended::Done(_), data) => data,
        (outcome, _) => return skip(format!("it cannot be read: {outcome}")),
    };
    let mut allowed = texts.iter().filter_map(|text| to_bytes(text, base, node).ok());
    if allowed.any(|value| same(&data, &value, base)) {
        return Ok(());
    }
    let why = format!("the node has {}, the device file {}", shown(&data, base), shown(&wanted, base));
    let stores = tester.device().object(0x1010).is_some() && writes(entry);
    match bond {
        Bond::CobId if stores => fail(format!("{why}, unless a parameter set stored with 1010h has it so")),
        Bond::Parameter if stores => skip(format!("{why}; a parameter set stored with 1010h may have it so")),
        _ => fail(why),
    }
}

/// Texts come with and without zeros and blanks at their end, and in more than one encoding.
fn same(found: &[u8], wanted: &[u8], data_type: DataType) -> bool {
    if data_type.kind() != Kind::VisibleString {
        return found == wanted;
    }
    let end = |byte: &u8| !matches!(byte, 0 | b' ');
    let cut =
        |text: &[u8]| text.get(..text.iter().rposition(end).map_or(0, |last| last + 1)).map(<[u8]>::to_vec);
    let (found, wanted) = (cut(found).unwrap_or_default(), cut(wanted).unwrap_or_default());
    let latin: String = found.iter().map(|byte| char::from(*byte)).collect();
    found == wanted || latin.as_bytes() == wanted
}

fn shown(data: &[u8], data_type: DataType) -> String {
    match data_type.kind() {
        Kind::Unsigned(size) if data.len() == usize::from(size) => {
            format!("{:0width$X}h", number(data), width = data.len() * 2)
        }
        Kind::Signed(size) if data.len() == usize::from(size) => {
            fit(i128::from(number(data)), data_type).map_or_else(|| bytes(data), |value| value.to_string())
        }
        Kind::VisibleString => format!("\"{}\"", String::from_utf8_lossy(data)),
        _ => bytes(data),
    }
}
