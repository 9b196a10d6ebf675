//! PDO parameters, SYNC, emergencies.

use canopen_master::Address;
use canopen_master::eds::Entry;
use canopen_master::nmt::{Command, State};
use canopen_master::sdo::message::{Bytes, Content, Request};
use canopen_master::sdo::{AbortCode, Outcome};
use pdo::cob;

use super::tester::{Checked, Tester, writes};
use super::{Check, Problem, check, fail, skip};

/// Bit 31 of a COB-ID: the PDO, or the service, does not exist.
const OFF: u32 = 1 << 31;

pub(super) const CHECKS: &[Check] = &[
    check(
        "pdo.parameters",
        "CiA 301, 7.5.2.35, 7.5.2.37",
        "Every PDO has a COB-ID that PDOs may have and a transmission type that is not reserved",
        "",
        parameters,
    ),
    check(
        "pdo.mapping",
        "CiA 301, 7.5.2.36, 7.5.2.38",
        "Every mapped object exists, can be mapped and has the mapped length; a PDO has 64 bits at most",
        "",
        mapping,
    ),
    check(
        "pdo.reserved-type",
        "CiA 301, 7.5.2.37",
        "The reserved transmission type 241 is refused with 06090030h",
        "tries to write 1800h; resets the communication",
        reserved_type,
    ),
    check(
        "pdo.absent-object",
        "CiA 301, 7.5.2.38",
        "An object that does not exist is not mapped: 06020000h or 06040041h",
        "writes a TPDO's mapping; resets the communication",
        absent_object,
    ),
    check(
        "pdo.synchronous",
        "CiA 301, 7.2.2.5, 7.2.5",
        "A TPDO of type 1 comes once after each SYNC, as long as its mapping, and only while operational",
        "writes 1800h; starts the node; sends SYNC; resets the communication",
        synchronous,
    ),
    check(
        "emcy.cob-id",
        "CiA 301, 7.5.2.17",
        "The emergency's COB-ID is 80h + node ID after power-on",
        "",
        emcy_id,
    ),
    check(
        "emcy.pdo-length",
        "CiA 301, 7.2.7, 7.5.2.2",
        "An RPDO that is too short is reported: emergency 8210h, in 1001h and 1003h",
        "starts the node; sends an RPDO without data; resets the communication",
        pdo_length,
    ),
    check(
        "emcy.history",
        "CiA 301, 7.5.2.4",
        "The error history is cleared by writing 0 to 1003h:00; another value is refused with 06090030h",
        "clears the error history",
        history,
    ),
];

/// One PDO of the device file.
#[derive(Clone, Copy)]
struct Pdo {
    index: u16,
    transmit: bool,
}

impl Pdo {
    const fn at(self, sub: u8) -> Address {
        Address::new(self.index, sub)
    }

    const fn map(self, sub: u8) -> Address {
        Address::new(self.index + 0x200, sub)
    }
}

fn pdos(tester: &Tester<'_>) -> Vec<Pdo> {
    let indices = tester.device().objects.iter().map(|object| object.index);
    let pdo = |index| match index {
        0x1400..=0x15FF => Some(Pdo { index, transmit: false }),
        0x1800..=0x19FF => Some(Pdo { index, transmit: true }),
        _ => None,
    };
    indices.filter_map(pdo).collect()
}

/// Identifiers that no PDO may have (CiA 301, 7.3.5, restricted CAN-IDs).
const fn is_restricted(id: u32) -> bool {
    matches!(id, 0..=0x7F | 0x101..=0x180 | 0x581..=0x5FF | 0x601..=0x67F | 0x6E0..=0x6FF | 0x701..)
}

fn parameters(tester: &mut Tester<'_>) -> Checked {
    let pdos = pdos(tester);
    if pdos.is_empty() {
        return skip("the device file has no PDOs");
    }
    let mut faults = Vec::new();
    for pdo in pdos {
        if let Some(cob) = faults_but(tester.read_number(pdo.at(1)), &mut faults)? {
            let cob = cob as u32;
            let id = cob & 0x1FFF_FFFF;
            if cob & OFF == 0 && cob & 1 << 29 == 0 && is_restricted(id) {
                faults.push(format!("{}: PDOs must not have the identifier {id:03X}h", pdo.at(1)));
            }
        }
        let kind = faults_but(tester.read_number(pdo.at(2)), &mut faults)?;
        let reserved = if pdo.transmit { 241..=251 } else { 241..=253 };
        if let Some(kind) = kind.filter(|kind| reserved.contains(kind)) {
            faults.push(format!("{}: transmission type {kind} is reserved", pdo.at(2)));
        }
    }
    none_of(&faults)
}

/// What was read; that it cannot be is one fault more. What was found before stands, whatever follows.
fn faults_but<T>(read: Checked<T>, faults: &mut Vec<String>) -> Checked<Option<T>> {
    match read {
        Ok(read) => Ok(Some(read)),
        Err(Problem::Fail(why)) => {
            faults.push(why);
            Ok(None)
        }
        Err(Problem::Skip(_)) if !faults.is_empty() => Ok(None),
        Err(other) => Err(other),
    }
}

fn none_of(faults: &[String]) -> Checked {
    if faults.is_empty() { Ok(()) } else { fail(faults.join("; ")) }
}

/// Length in bits of an object, as its type says.
fn bits(tester: &Tester<'_>, entry: &Entry) -> Option<u64> {
    let base = tester.device().base_type(entry.data_type?);
    if base.0 == 1 { Some(1) } else { base.size().map(|bytes| u64::from(bytes) * 8) }
}

/// The mapped bits of a PDO, each entry looked at.
fn mapped(tester: &mut Tester<'_>, pdo: Pdo, faults: &mut Vec<String>) -> Checked<u64> {
    let Some(count) = faults_but(tester.read_number(pdo.map(0)), faults)? else { return Ok(0) };
    if count > 64 {
        faults.push(format!("{}: {count} mapped objects, 64 at most", pdo.map(0)));
        return Ok(0);
    }
    let mut sum = 0;
    for sub in 1..=count as u8 {
        let Some(raw) = faults_but(tester.read_number(pdo.map(sub)), faults)? else { continue };
        let (at, length) = (Address::new((raw >> 16) as u16, (raw >> 8) as u8), raw & 0xFF);
        sum += length;
        // Types as placeholders.
        if at.index < 0x20 {
            continue;
        }
        let map = pdo.map(sub);
        match tester.entry(at) {
            None => faults.push(format!("{map} maps {at}, which the device file has not")),
            Some(entry) if !entry.is_mappable() => {
                faults.push(format!("{map} maps {at}, which the device file calls not mappable"));
            }
            Some(entry) => {
                if let Some(bits) = bits(tester, entry).filter(|bits| *bits != length) {
                    faults.push(format!("{map} maps {length} bits of {at}, which has {bits}"));
                }
            }
        }
    }
    if sum > 64 {
        faults.push(format!("{}: {sum} bits, 64 at most", pdo.map(0)));
    }
    Ok(sum)
}

/// The mapped bits of a PDO that is mapped as it must be; otherwise 0.
fn well_mapped(tester: &mut Tester<'_>, pdo: Pdo) -> Checked<u64> {
    let mut faults = Vec::new();
    let bits = mapped(tester, pdo, &mut faults)?;
    Ok(if faults.is_empty() { bits } else { 0 })
}

fn mapping(tester: &mut Tester<'_>) -> Checked {
    let pdos = pdos(tester);
    if pdos.is_empty() {
        return skip("the device file has no PDOs");
    }
    let mut faults = Vec::new();
    for pdo in pdos {
        mapped(tester, pdo, &mut faults)?;
    }
    none_of(&faults)
}

/// The first TPDO with a value that can be written.
fn tpdo(tester: &Tester<'_>, value: impl Fn(Pdo) -> Address) -> Checked<Pdo> {
    let found =
        pdos(tester).into_iter().find(|pdo| pdo.transmit && tester.entry(value(*pdo)).is_some_and(writes));
    found.map_or_else(|| skip("the device file has no TPDO that can be set up so"), Ok)
}

fn reserved_type(tester: &mut Tester<'_>) -> Checked {
    let pdo = tpdo(tester, |pdo| pdo.at(2))?;
    let content = Content::Expedited { data: Bytes::new(&[241]).unwrap_or(Bytes::EMPTY), sized: true };
    let refused = tester
        .expect_abort(Request::InitiateDownload { at: pdo.at(2), content }, &[AbortCode::INVALID_VALUE]);
    tester.restart(Command::ResetCommunication)?;
    refused
}

fn absent_object(tester: &mut Tester<'_>) -> Checked {
    let pdo = tpdo(tester, |pdo| pdo.map(1))?;
    if !tester.is_writable(pdo.map(0)) || !tester.is_writable(pdo.at(1)) {
        return skip("the device file has no TPDO whose mapping can be changed");
    }
    let cob = tester.read_number(pdo.at(1))? as u32;
    let absent = (0x5F00..=0x5FFF).rev().find(|index| tester.device().object(*index).is_none());
    let entry = u32::from(absent.unwrap_or(0x5FFF)) << 16 | 8;
    let tried = try_mapping(tester, pdo, cob, entry);
    tester.restart(Command::ResetCommunication)?;
    tried
}

fn try_mapping(tester: &mut Tester<'_>, pdo: Pdo, cob: u32, entry: u32) -> Checked {
    tester.write(pdo.at(1), &(cob | OFF).to_le_bytes())?;
    tester.write(pdo.map(0), &[0])?;
    let codes = [AbortCode::NO_OBJECT, AbortCode::NOT_MAPPABLE];
    match tester.download(pdo.map(1), &entry.to_le_bytes(), &tester.options(false))? {
        Outcome::Aborted(code) if codes.contains(&code) => return Ok(()),
        Outcome::Done(_) => {}
        outcome => return fail(format!("{}: {outcome}", pdo.map(1))),
    }
    // It may be looked at when the mapping is switched on.
    match tester.download(pdo.map(0), &[1], &tester.options(false))? {
        Outcome::Aborted(code) if codes.contains(&code) => Ok(()),
        outcome => fail(format!("{} with {entry:08X}h: {outcome}", pdo.map(0))),
    }
}

fn synchronous(tester: &mut Tester<'_>) -> Checked {
    if tester.others && !tester.config.permitted {
        return skip("SYNC would act on the other nodes of the bus, too, which needs permission");
    }
    let candidates: Vec<Pdo> = pdos(tester)
        .into_iter()
        .filter(|pdo| pdo.transmit && tester.entry(pdo.at(2)).is_some_and(writes))
        .collect();
    for pdo in candidates {
        let cob = tester.read_number(pdo.at(1))? as u32;
        let bits = well_mapped(tester, pdo)?;
        if cob & (OFF | 1 << 29) == 0 && bits > 0 {
            let run = run_synchronous(tester, pdo, (cob & 0x7FF) as u16, bits.div_ceil(8) as usize);
            tester.restart(Command::ResetCommunication)?;
            return run;
        }
    }
    skip("no TPDO is on, has a mapping and can be set to type 1")
}

fn run_synchronous(tester: &mut Tester<'_>, pdo: Pdo, id: u16, length: usize) -> Checked {
    tester.write(pdo.at(2), &[1])?;
    tester.send(cob::SYNC, &[])?;
    tester.expect_silence(id, "SYNC while pre-operational")?;
    tester.let_show()?;
    tester.command(Command::Start)?;
    tester.expect_state(State::Operational)?;
    // Some send once when they start.
    tester.expect_silence(id, "without SYNC").or_else(|_| tester.expect_silence(id, "without SYNC"))?;
    for number in 1..=3 {
        tester.send(cob::SYNC, &[])?;
        let until = tester.now() + tester.config.answer;
        match tester.wait(id, until)? {
            Some(data) if data.len() == length => {}
            Some(data) => return fail(format!("the TPDO has {} bytes, its mapping {length}", data.len())),
            None => return fail(format!("no TPDO after SYNC {number}")),
        }
        tester.expect_silence(id, "after the TPDO, before the next SYNC")?;
    }
    Ok(())
}

fn emcy_id(tester: &mut Tester<'_>) -> Checked {
    if tester.device().object(0x1014).is_none() {
        return skip("the device file has no emergencies (1014h)");
    }
    let expected = u64::from(cob::EMCY) + u64::from(tester.node().raw());
    match tester.read_number(Address::new(0x1014, 0))? {
        found if found == expected => Ok(()),
        found => fail(format!("1014h is {found:X}h, {expected:X}h expected")),
    }
}

fn pdo_length(tester: &mut Tester<'_>) -> Checked {
    if tester.device().object(0x1014).is_none() {
        return skip("the device file has no emergencies (1014h)");
    }
    // The profile in the lower half.
    if tester.read_number(Address::new(0x1000, 0))? & 0xFFFF == 402 && !tester.config.permitted {
        return skip("the node is a drive, whose start needs permission");
    }
    for pdo in pdos(tester).into_iter().filter(|pdo| !pdo.transmit) {
        let cob = tester.read_number(pdo.at(1))? as u32;
        // A synchronous one is looked at only with SYNC.
        let kind = tester.read_number(pdo.at(2))?;
        if cob & (OFF | 1 << 29) == 0 && well_mapped(tester, pdo)? > 0 && kind >= 254 {
            let run = run_pdo_length(tester, (cob & 0x7FF) as u16);
            tester.restart(Command::ResetCommunication)?;
            return run;
        }
    }
    skip("no event-driven RPDO is on and has a mapping")
}

fn run_pdo_length(tester: &mut Tester<'_>, id: u16) -> Checked {
    tester.let_show()?;
    tester.command(Command::Start)?;
    tester.expect_state(State::Operational)?;
    tester.emergencies.clear();
    tester.send(id, &[])?;
    let until = tester.now() + tester.config.answer;
    if !tester.wait_for_emergency(0x8210, until)? {
        return fail("no emergency 8210h after an RPDO without data");
    }
    let register = tester.read_number(Address::new(0x1001, 0))?;
    if register & 1 == 0 {
        return fail(format!("the error register is {register:02X}h, bit 0 (generic error) expected"));
    }
    if tester.device().object(0x1003).is_some() {
        let count = tester.read_number(Address::new(0x1003, 0))?;
        let newest = if count > 0 { tester.read_number(Address::new(0x1003, 1))? & 0xFFFF } else { 0 };
        if newest != 0x8210 {
            return fail(format!("the newest error of the history is {newest:04X}h, 8210h expected"));
        }
    }
    Ok(())
}

fn history(tester: &mut Tester<'_>) -> Checked {
    let at = Address::new(0x1003, 0);
    if !tester.is_writable(at) {
        return skip("the device file has no error history (1003h) that can be cleared");
    }
    let content =
        |value: u8| Content::Expedited { data: Bytes::new(&[value]).unwrap_or(Bytes::EMPTY), sized: true };
    let request = Request::InitiateDownload { at, content: content(1) };
    tester.expect_abort(request, &[AbortCode::INVALID_VALUE])?;
    tester.write(at, &[0])?;
    match tester.read_number(at)? {
        0 => Ok(()),
        count => fail(format!("1003h:00 is {count} after it was cleared")),
    }
}
