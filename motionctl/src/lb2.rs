//! `motionctl lb2 …`: LB2 functions one by one.

use lb2::code::StoredFailure;
use lb2::frame::MAX_DATA;
use lb2::telegram::{BANK_LEN, MAX_BANK_DATA, Request, Response, bank};
use motion_io::lb2::{CallError, Client};
use serde_json::{Value, json};

use crate::cli::{Global, Lb2, Line, Range};
use crate::connect::{connect, remarks};
use crate::exit::Exit;
use crate::image;
use crate::output::Output;

pub(crate) fn run(out: &Output, global: &Global, command: &Lb2) -> Result<(), Exit> {
    match command {
        Lb2::Identify { line } => identify(out, global, line),
        Lb2::Failures { line } => failures(out, global, line),
        Lb2::ClearFailures { line } => {
            if out.only_plans(|| "would delete all stored failures".into()) {
                return Ok(());
            }
            let count = connect(out, global, line)?.delete_failures()?;
            out.document(json!({ "deleted": count }), || println!("{count} failures deleted"));
            Ok(())
        }
        Lb2::ReadRam { line, range, file, format } => {
            let bytes = read(out, global, line, &Area::new(range, false)?)?;
            image::write(file, *format, range.offset, &bytes)?;
            written(out, &file.display().to_string(), bytes.len());
            Ok(())
        }
        Lb2::ReadFlash { line, range, file, format } => {
            let bytes = read(out, global, line, &Area::new(range, true)?)?;
            image::write(file, *format, range.offset, &bytes)?;
            written(out, &file.display().to_string(), bytes.len());
            Ok(())
        }
        Lb2::WriteRam { line, range, file, format } => {
            let image = image::read(file, *format, range.offset)?;
            write(out, global, line, &Area::new(range, false)?, image, false)
        }
        Lb2::WriteFlash { line, range, erase, file, format } => {
            let image = image::read(file, *format, range.offset)?;
            write(out, global, line, &Area::new(range, true)?, image, *erase)
        }
        Lb2::EraseFlash { line, bank } => {
            let bank = checked_bank(Some(*bank), true)?;
            if out.only_plans(|| format!("would erase flash bank {bank}")) {
                return Ok(());
            }
            out.confirm(global.yes, &format!("Erase flash bank {bank}?"))?;
            connect(out, global, line)?.call(&Request::EraseFlash { bank }, |_| ())?;
            out.document(json!({ "bank": bank, "erased": true }), || println!("flash bank {bank} erased"));
            Ok(())
        }
        Lb2::Raw { line, bytes } => raw(out, global, line, &bytes.concat()),
    }
}

fn written(out: &Output, file: &str, len: usize) {
    out.document(json!({ "file": file, "bytes": len }), || println!("{len} bytes written to {file}"));
}

/// What a device says of itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Identity {
    pub(crate) model: u16,
    pub(crate) axes: u8,
    pub(crate) os_version: String,
    pub(crate) custom_version: String,
}

impl Identity {
    pub(crate) fn read(client: &mut Client) -> Result<Self, CallError> {
        let (model, axes) = client.device_type()?;
        let os_version = client.os_version()?.to_string();
        let custom_version = client.custom_version()?.to_string();
        Ok(Self { model, axes, os_version, custom_version })
    }

    /// With the device number `[005]`, where it is known.
    pub(crate) fn json(&self, number: Option<i32>) -> Value {
        json!({
            "model": self.model,
            "axes": self.axes,
            "os_version": self.os_version,
            "custom_version": self.custom_version,
            "device_number": number,
        })
    }
}

fn identify(out: &Output, global: &Global, line: &Line) -> Result<(), Exit> {
    let mut client = connect(out, global, line)?;
    let identity = Identity::read(&mut client)?;
    let number = client.read_parameter(5)?;
    remarks(out, &mut client);
    out.document(identity.json(Some(number)), || {
        let Identity { model, axes, os_version: os, custom_version: custom } = &identity;
        println!("GEL {model}, {axes} axes, operating system {os}, customized software {custom}, device number {number}");
    });
    Ok(())
}

pub(crate) fn failure_json(stored: &StoredFailure) -> Value {
    json!({ "axis": stored.axis, "failure": stored.failure.0, "text": stored.failure.to_string() })
}

fn failures(out: &Output, global: &Global, line: &Line) -> Result<(), Exit> {
    let failures = connect(out, global, line)?.failures()?;
    let list: Vec<_> = failures.iter().map(failure_json).collect();
    out.document(json!({ "failures": list }), || {
        if failures.is_empty() {
            println!("no failure stored");
        }
        for stored in &failures {
            match stored.axis {
                0 => println!("system   {:3}  {}", stored.failure.0, stored.failure),
                axis => println!("axis {axis}   {:3}  {}", stored.failure.0, stored.failure),
            }
        }
    });
    Ok(())
}

/// A part of a bank.
struct Area {
    flash: bool,
    bank: u8,
    offset: u32,
    count: Option<u32>,
}

impl Area {
    fn new(range: &Range, flash: bool) -> Result<Self, Exit> {
        let bank = checked_bank(range.bank, flash)?;
        if range.offset as usize + range.count.unwrap_or(0) as usize > BANK_LEN {
            return Err(Exit::usage("offset and count pass the bank's end at 65536"));
        }
        Ok(Self { flash, bank, offset: range.offset, count: range.count })
    }
}

fn checked_bank(bank: Option<u8>, flash: bool) -> Result<u8, Exit> {
    match (bank, flash) {
        (None | Some(bank::RAM), false) => Ok(bank::RAM),
        (Some(bank @ (bank::FLASH_15 | bank::FLASH_16)), true) => Ok(bank),
        (_, true) => Err(Exit::usage("--bank 15 or --bank 16 expected")),
        (Some(bank), false) => Err(Exit::usage(format!("--bank {bank}: RAM is bank 12"))),
    }
}

fn read(out: &Output, global: &Global, line: &Line, area: &Area) -> Result<Vec<u8>, Exit> {
    let mut client = connect(out, global, line)?;
    let len = area.count.map_or(BANK_LEN - area.offset as usize, |count| count as usize);
    read_back(out, &mut client, area, area.offset, len)
}

fn read_back(
    out: &Output,
    client: &mut Client,
    area: &Area,
    offset: u32,
    len: usize,
) -> Result<Vec<u8>, Exit> {
    let mut bytes = vec![0; len];
    let bar = out.progress("reading", len);
    for (block, room) in bytes.chunks_mut(MAX_BANK_DATA).enumerate() {
        let at = offset as usize + block * MAX_BANK_DATA;
        client.read_bank(area.flash, area.bank, at as u16, room)?;
        bar.inc(room.len() as u64);
    }
    bar.finish_and_clear();
    Ok(bytes)
}

fn write(
    out: &Output,
    global: &Global,
    line: &Line,
    area: &Area,
    (offset, mut bytes): (u32, Vec<u8>),
    erase: bool,
) -> Result<(), Exit> {
    let kind = if area.flash { "flash" } else { "RAM" };
    if area.flash && offset % 2 != 0 {
        return Err(Exit::usage(format!(
            "offset {offset}: flash is written in words, an even offset is expected"
        )));
    }
    if area.flash && bytes.len() % 2 != 0 {
        bytes.push(0xFF);
    }
    let plan = format!("{} bytes to {kind} bank {} from offset {offset}", bytes.len(), area.bank);
    if out.only_plans(|| format!("would write {plan}{}", if erase { ", after erasing it" } else { "" })) {
        return Ok(());
    }
    if area.flash {
        out.confirm(global.yes, &format!("Write {plan}?"))?;
    }
    let mut client = connect(out, global, line)?;
    let bank = area.bank;
    if erase {
        client.call(&Request::EraseFlash { bank }, |_| ())?;
    }
    let bar = out.progress("writing", bytes.len());
    for (block, data) in bytes.chunks(MAX_BANK_DATA).enumerate() {
        let offset = (offset as usize + block * MAX_BANK_DATA) as u16;
        let request = match area.flash {
            true => Request::WriteFlashAt { bank, offset, data },
            false => Request::WriteRam { bank, offset, data },
        };
        client.call(&request, |_| ()).map_err(|error| {
            Exit::from(error).context(&format!("{} of {} bytes written", block * MAX_BANK_DATA, bytes.len()))
        })?;
        bar.inc(data.len() as u64);
    }
    bar.finish_and_clear();
    let found = read_back(out, &mut client, area, offset, bytes.len())?;
    if let Some(at) = found.iter().zip(&bytes).position(|(found, wanted)| found != wanted) {
        return Err(Exit::check(format!("verify failed at offset {}", offset as usize + at)));
    }
    out.document(json!({ "bank": bank, "offset": offset, "bytes": bytes.len(), "verified": true }), || {
        println!("{plan}: written and verified");
    });
    Ok(())
}

fn raw(out: &Output, global: &Global, line: &Line, hex: &str) -> Result<(), Exit> {
    let digits: Vec<char> = hex.chars().filter(|c| !c.is_whitespace()).collect();
    let byte = |pair: &[char]| u8::from_str_radix(&pair.iter().collect::<String>(), 16).ok();
    let bytes: Option<Vec<u8>> =
        digits.chunks(2).map(|pair| byte(pair).filter(|_| pair.len() == 2)).collect();
    let bytes = bytes.ok_or_else(|| Exit::usage(format!("{hex:?}: pairs of hex digits expected")))?;
    let [function, data @ ..] = bytes.as_slice() else {
        return Err(Exit::usage("a function byte is missing"));
    };
    if data.len() > MAX_DATA {
        return Err(Exit::usage(format!("{} data bytes, a telegram carries at most {MAX_DATA}", data.len())));
    }
    let request = Request::Raw { function: *function, data };
    if out.only_plans(|| format!("would send function {function:02X}h with {} data bytes", data.len())) {
        return Ok(());
    }
    // Known functions are answered in their own form, which a raw request does not expect.
    let mut wire = [0; lb2::frame::MAX_WIRE];
    request.encode(&mut wire).map_err(|error| Exit::usage(error.to_string()))?;
    let mut decoder = lb2::frame::Decoder::new();
    let known = match decoder.decode(&wire).1 {
        Some(lb2::frame::Item::Frame { frame, .. }) => Request::parse(&frame).unwrap_or(request),
        _ => request,
    };
    let mut client = connect(out, global, line)?;
    let block = client.call(&known, |response: Response<'_>| {
        let mut wire = [0; lb2::frame::MAX_WIRE];
        let len = response.encode(&mut wire).unwrap_or(0);
        let mut decoder = lb2::frame::Decoder::new();
        match decoder.decode(wire.get(..len).unwrap_or(&[])).1 {
            Some(lb2::frame::Item::Frame { frame, .. }) => (frame.function(), frame.data().to_vec()),
            _ => (response.function(), Vec::new()),
        }
    })?;
    let hex = block.1.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>();
    out.document(json!({ "function": block.0, "data": hex.concat() }), || {
        println!("{:02X}  {}", block.0, hex.join(" "));
    });
    Ok(())
}
