//! `motionctl linmot params`.

use linmot::code::Status;
use linmot::link::{Fault, Link, LinkExt};
use linmot::pvl::Encoding;
use linmot::range::{Number, Range};
use linmot::request::{List, Memory, Request, Value};
use linmot::upid::{Layer, Upid, Usage};
use serde_json::{Value as Json, json};

use super::cli::{self, Drive, LayerName, Params, TypeName};
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
    /// Of a string that of its stringlets.
    usage: Usage,
    rom: Option<Held>,
    ram: Option<Held>,
    /// By which the raw values are numbers; read where it matters.
    range: Option<Range>,
}

/// What a memory holds.
enum Held {
    Raw(u32),
    Text(String),
}

impl Shown {
    fn number(&self, raw: u32) -> Number {
        self.range.map_or(Number::Integer(raw.into()), |range| range.number(raw))
    }

    fn json(&self, held: Option<&Held>) -> Json {
        match held {
            Some(Held::Raw(raw)) => of_number(self.number(*raw)),
            Some(Held::Text(text)) => json!(text),
            None => Json::Null,
        }
    }

    fn words(&self, held: &Held) -> String {
        match held {
            Held::Raw(raw) => format!("{} ({raw:08X}h)", self.number(*raw)),
            Held::Text(text) => format!("{text:?}"),
        }
    }
}

pub(super) fn run(out: &Output, global: &Global, command: &Params) -> Result<(), Exit> {
    match command {
        Params::List { drive, changed } => list(out, global, drive, *changed),
        Params::Get { drive, upid, memory, kind } => get(out, global, drive, *upid, *memory, *kind),
        Params::Set { drive, upid, memory, kind, value } => {
            set(out, global, drive, *upid, *memory, *kind, value)
        }
        Params::Defaults { drive, layer } => defaults(out, global, drive, layer),
    }
}

/// The usage of one parameter, which only the list tells.
fn usage(link: &mut AnyLink, upid: Upid) -> Result<Usage, Exit> {
    link.ask(Request::StartList { list: List::All, from: upid })?;
    let request = Request::NextItem(List::All);
    let reply = link.call(&request)?;
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
    let mut shown = Shown { upid, usage, rom: None, ram: None, range: None };
    if usage.is_opaque()
        && let Some(first) = upid.stringlet(0)
    {
        shown.usage = self::usage(link, first)?;
    }
    let mut held = |value| -> Result<Held, Exit> {
        if !usage.is_opaque() {
            return Ok(Held::Raw(link.read(upid, value)?));
        }
        let mut bytes = [0; TEXT];
        let len = link.read_text(upid, value, &mut bytes)?;
        Ok(Held::Text(text(bytes.get(..len).unwrap_or(&[]))))
    };
    // What was asked for by name must be readable; otherwise whatever is.
    if memory.rom || !memory.ram && shown.usage.contains(Usage::ROM_READ) {
        shown.rom = Some(held(Value::Rom)?);
    }
    if memory.ram || !memory.rom && shown.usage.contains(Usage::RAM_READ) {
        shown.ram = Some(held(Value::Ram)?);
    }
    let unclear = |held: &Held| matches!(held, Held::Raw(raw) if needs_range(*raw));
    if [&shown.rom, &shown.ram].into_iter().flatten().any(unclear) {
        shown.range = Some(link.range(upid)?);
    }
    Ok(shown)
}

/// Whether a raw value may be another number than an unsigned one, and its range must be known: the sign bit
/// of a type is its highest, or it is as great as a float's bits are.
fn needs_range(raw: u32) -> bool {
    matches!(raw.leading_zeros(), 0..=2 | 16 | 24)
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
    let json: Vec<Json> = list.iter().map(to_json).collect();
    out.document(json!({ "parameters": json }), || {
        if list.is_empty() {
            println!("{}", if changed { "none changed" } else { "no parameters" });
        }
        list.iter().for_each(print);
    });
    Ok(())
}

/// A float as few digits as tell it from others, not as the digits of a double.
pub(super) fn of_number(number: Number) -> Json {
    match number {
        Number::Integer(number) => json!(number),
        Number::Float(_) => number.to_string().parse::<f64>().map_or(Json::Null, |value| json!(value)),
    }
}

fn to_json(shown: &Shown) -> Json {
    let [rom, ram] = [&shown.rom, &shown.ram].map(|held| shown.json(held.as_ref()));
    let mut json = json!({
        "upid": shown.upid.0,
        "hex": shown.upid.to_string(),
        "layer": shown.upid.layer().map(Layer::name),
        "ram": ram,
        "rom": rom,
        "usage": shown.usage.0,
        "access": shown.usage.to_string(),
        "live": shown.usage.contains(Usage::LIVE),
    });
    if let (Some(Held::Text(text)), Some(json)) =
        (shown.rom.as_ref().or(shown.ram.as_ref()), json.as_object_mut())
    {
        json.insert("text".into(), json!(text));
    }
    json
}

fn print(shown: &Shown) {
    let held = [("ROM", &shown.rom), ("RAM", &shown.ram)]
        .into_iter()
        .filter_map(|(name, held)| held.as_ref().map(|held| format!("{name} {}  ", shown.words(held))));
    println!("{}  {}{}", shown.upid, held.collect::<String>(), shown.usage);
}

fn get(
    out: &Output,
    global: &Global,
    drive: &Drive,
    upid: Upid,
    memory: cli::Memory,
    kind: Option<TypeName>,
) -> Result<(), Exit> {
    let mut link = connect(global, drive)?;
    let usage = usage(&mut link, upid)?;
    numeric(upid, usage, kind)?;
    let mut shown = read(&mut link, upid, usage, memory)?;
    let mut default = None;
    if !usage.is_opaque() {
        shown.range = Some(typed(link.range(upid)?, kind));
        default = Some(link.read(upid, Value::Default)?);
    }
    let mut json = to_json(&shown);
    if let (Some(range), Some(default), Some(json)) = (shown.range, default, json.as_object_mut()) {
        json.extend([
            ("minimum".to_owned(), of_number(range.minimum())),
            ("maximum".to_owned(), of_number(range.maximum())),
            ("default".to_owned(), of_number(range.number(default))),
        ]);
    }
    out.document(json!({ "parameters": [json] }), || {
        print(&shown);
        if let (Some(range), Some(default)) = (shown.range, default) {
            let words = |range: &Range| {
                format!(
                    "minimum {}, maximum {}, default {}",
                    range.minimum(),
                    range.maximum(),
                    range.number(default)
                )
            };
            println!("{} ({default:08X}h)", words(&range));
            if let Some(other) = range.other() {
                println!("or, which --type decides: {}", words(&other));
            }
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
    kind: Option<TypeName>,
    value: &str,
) -> Result<(), Exit> {
    let mut link = connect(global, drive)?;
    let usage = usage(&mut link, upid)?;
    numeric(upid, usage, kind)?;
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
    let value = if usage.is_opaque() {
        Wanted::Text(characters(value)?)
    } else {
        let range = link.range(upid).map_err(|fault| Exit::from(fault).context("nothing was written"))?;
        let range = typed(range, kind);
        Wanted::Number(raw(upid, value, &range)?, range)
    };
    let said = match &value {
        Wanted::Text(bytes) => format!("{:?}", text(bytes)),
        Wanted::Number(raw, range) => range.number(*raw).to_string(),
    };
    if out.only_plans(|| format!("would write {said} to {upid} in {name}")) {
        return Ok(());
    }
    out.confirm_on_terminal(global.yes, &format!("Write {said} to {upid} in {name}?"))?;
    let mut told = None;
    match value {
        Wanted::Text(bytes) => {
            link.write_text(upid, memory, &bytes)
                .map_err(|fault| half_written(&mut link, upid, memory, fault))?;
        }
        Wanted::Number(value, range) => {
            link.ask(Request::Write { memory, upid, value }).map_err(|fault| {
                let access = matches!(fault, Fault::Refused { reply, .. } if reply.status == Status::USAGE);
                let mut exit = Exit::from(fault);
                if access {
                    exit.message += &format!("; what can be done with it: {usage}");
                }
                exit
            })?;
            link.verify(upid, memory, value, &range).map_err(|fault| match fault {
                Fault::ReadBack { .. } => Exit::check(fault.to_string()),
                other => Exit::from(other).context("it was written, but could not be read back"),
            })?;
            told = Some(range);
        }
    }
    let mut shown = read(&mut link, upid, usage, BOTH)?;
    shown.range = told.or(shown.range);
    if memory == Memory::Rom {
        out.remark("the ROM value acts after a restart");
    }
    out.document(json!({ "parameters": [to_json(&shown)] }), || print(&shown));
    Ok(())
}

/// A string has no type of a number.
fn numeric(upid: Upid, usage: Usage, kind: Option<TypeName>) -> Result<(), Exit> {
    if usage.is_opaque() && kind.is_some() {
        return Err(Exit::usage(format!("--type: UPID {upid} is a string")));
    }
    Ok(())
}

fn typed(range: Range, kind: Option<TypeName>) -> Range {
    kind.map_or(range, |kind| range.with_type(kind.into()))
}

/// What shall be written.
enum Wanted {
    Text(Vec<u8>),
    Number(u32, Range),
}

/// The characters of a string parameter.
fn characters(value: &str) -> Result<Vec<u8>, Exit> {
    let wrong = |what: &str| Exit::usage(format!("{value:?}: {what}"));
    let bytes = Encoding::Windows1252
        .encode_exactly(value)
        .ok_or_else(|| wrong("characters of Windows-1252 expected, others cannot be kept"))?;
    if bytes.len() > TEXT {
        return Err(wrong(&format!("up to {TEXT} characters expected, {} found", bytes.len())));
    }
    Ok(bytes)
}

/// The raw value of what was typed, which the drive will keep as it is: hex stands for the raw value, a decimal
/// for the number that it is in the parameter's type.
fn raw(upid: Upid, value: &str, range: &Range) -> Result<u32, Exit> {
    let (raw, number) = match cli::hex(value).map(|digits| u32::from_str_radix(digits, 16)) {
        Some(Ok(raw)) => (Some(raw), range.number(raw)),
        Some(Err(_)) => {
            return Err(no_number(value, "a number of 32 bits expected, decimal or hex (0x10, 10h)"));
        }
        None if range.is_float() => {
            let number = value.parse::<f32>().ok().filter(|number| number.is_finite());
            let number =
                number.ok_or_else(|| no_number(value, "a decimal number expected, or raw in hex"))?;
            (Some(number.to_bits()), Number::Float(number.to_bits()))
        }
        None => {
            let number = value
                .parse::<i64>()
                .map_err(|_| no_number(value, "a number of 32 bits expected, decimal or hex (0x10, 10h)"))?;
            (range.raw(number), number.into())
        }
    };
    let fault = Fault::<motion_io::linmot::LinkError>::Range { upid, value: number, range: *range };
    raw.filter(|raw| range.contains(*raw))
        .ok_or_else(|| Exit::refused(format!("{fault}; nothing was written")))
}

fn no_number(value: &str, expected: &str) -> Exit {
    Exit::usage(format!("{value:?}: {expected}"))
}

/// A string is written in pieces: what it is now.
fn half_written(
    link: &mut AnyLink,
    upid: Upid,
    memory: Memory,
    fault: Fault<motion_io::linmot::LinkError>,
) -> Exit {
    let mut now = String::new();
    for (value, name) in memory.values().iter().map(|v| (*v, if *v == Value::Ram { "RAM" } else { "ROM" })) {
        let mut bytes = [0; TEXT];
        match link.read_text(upid, value, &mut bytes) {
            Ok(len) => {
                now += &format!("its {name} value is {:?} now; ", text(bytes.get(..len).unwrap_or(&[])));
            }
            Err(_) => now += &format!("its {name} value may be written in part; "),
        }
    }
    Exit::from(fault).context(now.trim_end_matches("; "))
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
    if out.only_plans(|| format!("would set the ROM values of {} to their defaults", names.join(", "))) {
        return Ok(());
    }
    out.confirm(global.yes, &format!("Set the ROM values of {} to their defaults?", names.join(", ")))?;
    let mut link = connect(global, drive)?;
    for (done, layer) in layers.iter().enumerate() {
        link.ask(Request::Defaults(*layer)).map_err(|fault| {
            let exit = Exit::from(fault);
            match names.get(..done) {
                None | Some([]) => exit,
                Some(done) => exit.context(&format!("{} at their defaults already", done.join(", "))),
            }
        })?;
    }
    out.document(json!({ "defaults": names }), || {
        println!("ROM values of {} are at their defaults; they act after a restart", names.join(", "));
    });
    Ok(())
}
