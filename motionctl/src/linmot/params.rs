//! `motionctl linmot params`.

use linmot::code::Status;
use linmot::link::{Fault, LinkExt};
use linmot::pvl::Encoding;
use linmot::request::{List, Memory, Request, Value};
use linmot::upid::{Layer, Upid, Usage};
use serde_json::{Value as Json, json};

use super::cli::{self, Drive, LayerName, Params};
use super::connect::{AnyLink, connect};
use super::text;
use crate::cli::Global;
use crate::exit::Exit;
use crate::output::Output;

/// A string has so many characters.
const TEXT: usize = 32;

/// A parameter with what could be read of it.
struct Shown {
    upid: Upid,
    usage: Usage,
    rom: Option<u32>,
    ram: Option<u32>,
    text: Option<String>,
}

pub(super) fn run(out: &Output, global: &Global, command: &Params) -> Result<(), Exit> {
    match command {
        Params::List { drive, changed } => list(out, global, drive, *changed),
        Params::Get { drive, upid, memory } => get(out, global, drive, *upid, *memory),
        Params::Set { drive, upid, memory, value } => set(out, global, drive, *upid, *memory, value),
        Params::Defaults { drive, layer } => defaults(out, global, drive, layer),
    }
}

/// The usage of one parameter, which only the list tells.
fn usage(link: &mut AnyLink, upid: Upid) -> Result<Usage, Exit> {
    link.ask(Request::StartList { list: List::All, from: upid })?;
    let request = Request::NextItem(List::All);
    let reply = linmot::link::Link::call(link, &request)?;
    let [found, usage, _] = reply.words;
    if reply.status == Status::OK && found == upid.0 {
        return Ok(Usage(usage));
    }
    if reply.status == Status::OK || reply.status == Status::END {
        return Err(Exit::refused(format!("UPID {upid}: the drive has no such parameter (C0h, UPID error)")));
    }
    Err(Fault::<motion_io::linmot::LinkError>::Refused { request, reply }.into())
}

fn read(link: &mut AnyLink, upid: Upid, usage: Usage, memory: cli::Memory) -> Result<Shown, Exit> {
    let mut shown = Shown { upid, usage, rom: None, ram: None, text: None };
    if usage.is_opaque() {
        let mut bytes = [0; TEXT];
        let value = if memory.ram { Value::Ram } else { Value::Rom };
        let len = link.read_text(upid, value, &mut bytes)?;
        shown.text = Some(text(bytes.get(..len).unwrap_or(&[])));
        return Ok(shown);
    }
    // What was asked for by name must be readable; otherwise whatever is.
    if memory.rom || !memory.ram && usage.contains(Usage::ROM_READ) {
        shown.rom = Some(link.read(upid, Value::Rom)?);
    }
    if memory.ram || !memory.rom && usage.contains(Usage::RAM_READ) {
        shown.ram = Some(link.read(upid, Value::Ram)?);
    }
    Ok(shown)
}

const BOTH: cli::Memory = cli::Memory { ram: false, rom: false, both: true };

fn list(out: &Output, global: &Global, drive: &Drive, changed: bool) -> Result<(), Exit> {
    let mut link = connect(global, drive)?;
    let mut items = Vec::new();
    link.list(List::All, Upid(0), |item| items.push((item.upid, item.usage.unwrap_or_default())))?;
    if changed {
        let mut modified = std::collections::BTreeSet::new();
        link.list(List::Modified, Upid(0), |item| {
            modified.insert(item.upid);
        })?;
        // A string has changed if one of its stringlets has.
        let string = |upid: Upid| {
            (0..linmot::upid::STRINGLETS).any(|n| upid.stringlet(n).is_some_and(|s| modified.contains(&s)))
        };
        items.retain(|(upid, usage)| modified.contains(upid) || usage.is_opaque() && string(*upid));
    }
    let bar = out.progress("reading", items.len());
    let mut list = Vec::new();
    for (upid, usage) in items {
        list.push(read(&mut link, upid, usage, BOTH)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let json: Vec<Json> = list.iter().map(|shown| to_json(shown, None)).collect();
    out.document(json!({ "parameters": json }), || list.iter().for_each(print));
    Ok(())
}

fn to_json(shown: &Shown, range: Option<[u32; 3]>) -> Json {
    let mut json = json!({
        "upid": shown.upid.0,
        "hex": shown.upid.to_string(),
        "layer": shown.upid.layer().map(Layer::name),
        "ram": shown.ram,
        "rom": shown.rom,
        "usage": shown.usage.0,
        "access": shown.usage.to_string(),
        "live": shown.usage.contains(Usage::LIVE),
    });
    if let (Some(text), Some(json)) = (&shown.text, json.as_object_mut()) {
        json.insert("text".into(), json!(text));
    }
    if let (Some([minimum, maximum, default]), Some(json)) = (range, json.as_object_mut()) {
        json.extend([
            ("minimum".to_owned(), json!(minimum)),
            ("maximum".to_owned(), json!(maximum)),
            ("default".to_owned(), json!(default)),
        ]);
    }
    json
}

fn print(shown: &Shown) {
    let value = |value: Option<u32>| value.map_or("-".into(), |value| format!("{value} ({value:08X}h)"));
    match &shown.text {
        Some(text) => println!("{}  {text:?}", shown.upid),
        None => {
            println!("{}  ROM {}  RAM {}  {}", shown.upid, value(shown.rom), value(shown.ram), shown.usage);
        }
    }
}

fn get(out: &Output, global: &Global, drive: &Drive, upid: Upid, memory: cli::Memory) -> Result<(), Exit> {
    let mut link = connect(global, drive)?;
    let usage = usage(&mut link, upid)?;
    let shown = read(&mut link, upid, usage, memory)?;
    let range = match shown.text {
        Some(_) => None,
        None => Some([
            link.read(upid, Value::Minimum)?,
            link.read(upid, Value::Maximum)?,
            link.read(upid, Value::Default)?,
        ]),
    };
    out.document(json!({ "parameters": [to_json(&shown, range)] }), || {
        print(&shown);
        if let Some([minimum, maximum, default]) = range {
            println!("minimum {minimum} ({minimum:08X}h), maximum {maximum} ({maximum:08X}h), default {default} ({default:08X}h)");
        }
    });
    Ok(())
}

fn set(
    out: &Output,
    global: &Global,
    drive: &Drive,
    upid: Upid,
    memory: cli::Memory,
    value: &str,
) -> Result<(), Exit> {
    let mut link = connect(global, drive)?;
    let usage = usage(&mut link, upid)?;
    let live = usage.contains(Usage::LIVE) && usage.contains(Usage::RAM_WRITE);
    let memory = match (memory.ram, memory.rom, memory.both) {
        (true, ..) => Memory::Ram,
        (_, true, _) => Memory::Rom,
        (_, _, true) => Memory::Both,
        _ if live => Memory::Both,
        _ => Memory::Rom,
    };
    let name = match memory {
        Memory::Ram => "RAM",
        Memory::Rom => "ROM",
        Memory::Both => "RAM and ROM",
    };
    if usage.is_opaque() {
        let bytes = Encoding::Windows1252.encode(value);
        if bytes.len() > TEXT {
            return Err(Exit::usage(format!("{value:?}: up to {TEXT} characters expected")));
        }
        if !global.dry_run {
            out.confirm_on_terminal(global.yes, &format!("Write {upid} in {name}?"))?;
            link.write_text(upid, memory, &bytes)?;
        }
    } else {
        let raw = cli::number(value).ok_or_else(|| {
            Exit::usage(format!("{value:?}: a number of 32 bits expected, decimal or hex (0x10, 10h)"))
        })?;
        if !global.dry_run {
            out.confirm_on_terminal(global.yes, &format!("Write {upid} in {name}?"))?;
            if let Err(fault) = link.write(upid, memory, raw) {
                let range = match &fault {
                    Fault::Refused { reply, .. } if reply.status == Status::RANGE => range(&mut link, upid),
                    _ => None,
                };
                let exit = Exit::from(fault);
                return Err(match range {
                    Some(range) => Exit { message: format!("{}; {range} expected", exit.message), ..exit },
                    None => exit,
                });
            }
        }
    }
    if global.dry_run {
        out.say(&format!("would write {value} to {upid} in {name}"));
        return Ok(());
    }
    let shown = read(&mut link, upid, usage, BOTH)?;
    out.document(json!({ "parameters": [to_json(&shown, None)] }), || print(&shown));
    Ok(())
}

/// Minimum and maximum, as far as the drive tells. Of a signed type the minimum is the greater of the raw
/// values, as wide as its type.
fn range(link: &mut AnyLink, upid: Upid) -> Option<String> {
    let minimum = link.read(upid, Value::Minimum).ok()?;
    let maximum = link.read(upid, Value::Maximum).ok()?;
    let signed = match minimum {
        _ if minimum <= maximum => i64::from(minimum),
        0..=0xFF => i64::from(minimum as u8 as i8),
        0x100..=0xFFFF => i64::from(minimum as u16 as i16),
        _ => i64::from(minimum as i32),
    };
    Some(format!("{signed} to {maximum}"))
}

fn defaults(out: &Output, global: &Global, drive: &Drive, layers: &[LayerName]) -> Result<(), Exit> {
    let layers = layers.iter().map(|layer| match layer {
        LayerName::Os => Layer::Os,
        LayerName::Mc => Layer::MotionControl,
        LayerName::Interface => Layer::Interface,
        LayerName::Application => Layer::Application,
    });
    let layers: Vec<Layer> = layers.collect();
    let names: Vec<&str> = layers.iter().map(|layer| layer.name()).collect();
    if global.dry_run {
        out.say(&format!("would set the ROM values of {} to their defaults", names.join(", ")));
        return Ok(());
    }
    let question = format!("Set the ROM values of {} to their defaults?", names.join(", "));
    out.confirm_on_terminal(global.yes, &question)?;
    let mut link = connect(global, drive)?;
    for layer in layers {
        link.ask(Request::Defaults(layer))?;
    }
    out.document(json!({ "defaults": names }), || {
        println!("ROM values of {} are at their defaults; they act after a restart", names.join(", "));
    });
    Ok(())
}
