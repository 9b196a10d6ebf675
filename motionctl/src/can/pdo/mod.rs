//! `motionctl can pdo …`: how a node's PDOs are set up.

mod change;

use canopen_master::sdo::Outcome;
use canopen_master::{Address, NodeId};
use pdo::Payload;
use pdo::mapping::{Entry, MAX_ENTRIES};
use serde_json::{Value, json};

use self::change::{Failed, Setup, change};
use super::cli::Pdo;
use super::sdo::tell;
use super::session::{Session, node_id};
use super::value::{hexadecimal, number};
use crate::cli::Global;
use crate::exit::Exit;
use crate::output::Output;

/// Bit 31 of a COB-ID: the PDO is off.
const OFF: u32 = 1 << 31;

/// A PDO's objects.
#[derive(Debug, Clone, Copy)]
struct Place {
    communication: u16,
    mapping: u16,
    transmit: bool,
}

fn place(text: &str) -> Result<Place, Exit> {
    let wrong = || Exit::usage(format!("{text:?}: tpdo1 to tpdo512 or rpdo1 to rpdo512 expected"));
    let lower = text.to_ascii_lowercase();
    let (base, digits, transmit) = match (lower.strip_prefix("tpdo"), lower.strip_prefix("rpdo")) {
        (Some(digits), _) => (0x1800, digits, true),
        (_, Some(digits)) => (0x1400, digits, false),
        _ => return Err(wrong()),
    };
    let number: u16 = digits.parse().ok().filter(|number| (1..=512).contains(number)).ok_or_else(wrong)?;
    let communication = base + number - 1;
    Ok(Place { communication, mapping: communication + 0x200, transmit })
}

struct Access<'a> {
    out: &'a Output,
    session: Session,
    node: NodeId,
}

impl Access<'_> {
    fn read(&mut self, index: u16, sub: u8) -> Result<u32, Exit> {
        let read = self.session.upload(self.node, Address::new(index, sub), false)?;
        let (data, _) = read.map_err(|error| tell(self.out, error))?;
        Ok(Payload::from_slice(&data).word() as u32)
    }

    /// An object that a device need not have.
    fn read_optional(&mut self, index: u16, sub: u8) -> Result<Option<u32>, Exit> {
        match self.session.upload(self.node, Address::new(index, sub), false)? {
            Ok((data, _)) => Ok(Some(Payload::from_slice(&data).word() as u32)),
            Err(error) if matches!(error.outcome, Outcome::Aborted(_)) => Ok(None),
            Err(error) => Err(tell(self.out, error)),
        }
    }
}

pub(crate) fn run(out: &Output, global: &Global, command: &Pdo) -> Result<(), Exit> {
    match command {
        Pdo::Read { node, pdo, line } => {
            let place = place(pdo)?;
            let session = Session::open(global, line)?;
            let mut access = Access { out, session, node: node_id(*node)? };
            let document = read(&mut access, pdo, place)?;
            out.document(document.clone(), || print(&document));
            Ok(())
        }
        Pdo::Write { node, pdo, line, map, id, transmission, inhibit, event, off } => {
            let place = place(pdo)?;
            let map =
                map.as_ref().map(|map| map.iter().map(|text| entry(text)).collect::<Result<Vec<_>, _>>());
            let map = map.transpose()?;
            if let Some(map) = &map
                && map.len() > MAX_ENTRIES
            {
                return Err(Exit::usage(format!("--map: {} objects, up to 64 expected", map.len())));
            }
            let id = id.as_deref().map(identifier).transpose()?;
            if global.dry_run {
                let entry = |entry: &u32| {
                    let Entry { at, bits } = Entry::from_raw(*entry);
                    format!("{:04X}h:{:02X}, {bits} bits", at.index, at.sub)
                };
                let parts = [
                    map.as_ref().map(|map| {
                        format!("mapping {}", map.iter().map(entry).collect::<Vec<_>>().join("; "))
                    }),
                    id.map(|id| format!("identifier {id:03X}h")),
                    transmission.map(|kind| format!("transmission type {kind}")),
                    inhibit.map(|time| format!("inhibit time {time} x 100 µs")),
                    event.map(|time| format!("event timer {time} ms")),
                    off.then(|| "switched off".to_owned()),
                ];
                let parts: Vec<String> = parts.into_iter().flatten().collect();
                let parts = if parts.is_empty() { "as it is".to_owned() } else { parts.join(", ") };
                out.plan(&format!("would set {pdo} of node {node} up: {parts}"));
                return Ok(());
            }
            let mut session = Session::open(global, line)?;
            session.stop_transfers()?;
            let mut access = Access { out, session, node: node_id(*node)? };
            let cob = access.read(place.communication, 1)?;
            let new = id.map_or(cob, |id| cob & !0x1FFF_FFFF | id);
            let wanted = Setup {
                cob: if *off { new | OFF } else { new & !OFF },
                transmission: *transmission,
                inhibit: *inhibit,
                event: *event,
                mapping: map.map(|map| (map.len() as u8, map)),
            };
            let before = access
                .earlier(place, cob, &wanted)
                .map_err(|exit| exit.context("reading what is to be changed, which is not touched"))?;
            let node = access.node;
            let session = &mut access.session;
            let mut write = |at, data| Ok(session.download(node, at, data, false)?.map(|_| ()));
            if let Err(Failed { what, error, left }) = change(&mut write, place, &before, &wanted)? {
                let mut document = error.json();
                document["left"] = json!(left.name());
                out.document(document, || {});
                let exit = Exit::from(error).context(&what);
                return Err(Exit { message: format!("{}; {left}", exit.message), ..exit });
            }
            let kept =
                access.read(place.communication, 1).and_then(|cob| access.earlier(place, cob, &wanted));
            let kept = kept.map_err(|exit| exit.context("reading back what was written"))?;
            let mut document = read(&mut access, pdo, place)?;
            let differs = wanted.differs(&kept);
            if differs.is_empty() {
                out.document(document.clone(), || print(&document));
                return Ok(());
            }
            document["differs"] = json!(differs);
            out.document(document.clone(), || print(&document));
            Err(Exit::check(format!("node {node} acknowledged but did not keep: {}", differs.join(", "))))
        }
    }
}

fn read(access: &mut Access<'_>, pdo: &str, place: Place) -> Result<Value, Exit> {
    let cob = access.read(place.communication, 1)?;
    let transmission = access.read(place.communication, 2)?;
    let inhibit = access.read_optional(place.communication, 3)?;
    let event = access.read_optional(place.communication, 5)?;
    let start = if place.transmit { access.read_optional(place.communication, 6)? } else { None };
    let count = access.read(place.mapping, 0)?;
    let mut mapping = Vec::new();
    for sub in 1..=count.min(64) as u8 {
        let Entry { at, bits } = Entry::from_raw(access.read(place.mapping, sub)?);
        mapping.push(json!({ "index": at.index, "subindex": at.sub, "bits": bits }));
    }
    Ok(json!({
        "node": access.node.raw(),
        "pdo": pdo,
        "id": cob & 0x1FFF_FFFF,
        "enabled": cob & OFF == 0,
        "rtr": cob & 1 << 30 == 0,
        "transmission": transmission,
        "inhibit": inhibit,
        "event": event,
        "sync_start": start,
        "mapping": mapping,
    }))
}

fn print(document: &Value) {
    let number = |key: &str| document[key].as_u64().map_or("-".into(), |number| number.to_string());
    let enabled = if document["enabled"] == true { "" } else { ", off" };
    println!(
        "{} of node {}: identifier {:03X}h{enabled}, transmission type {}, inhibit time {} x 100 µs, event timer {} ms",
        document["pdo"].as_str().unwrap_or(""),
        document["node"],
        document["id"].as_u64().unwrap_or(0),
        document["transmission"],
        number("inhibit"),
        number("event"),
    );
    for entry in document["mapping"].as_array().into_iter().flatten() {
        let number = |key: &str| entry[key].as_u64().unwrap_or(0);
        println!("  {:04X}h:{:02X}  {} bits", number("index"), number("subindex"), number("bits"));
    }
}

/// `0x6041:0:16`.
fn entry(text: &str) -> Result<u32, Exit> {
    let wrong = || Exit::usage(format!("--map {text:?}: INDEX:SUB:BITS such as 0x6041:0:16 expected"));
    let mut parts = text.splitn(3, ':');
    let index = parts.next().and_then(hexadecimal);
    let rest: Option<Vec<i128>> = parts.map(number).collect();
    match (index, rest.as_deref()) {
        (Some(index @ 0..=0xFFFF), Some(&[sub @ 0..=0xFF, bits @ 1..=64])) => {
            Ok(Entry::new(index as u16, sub as u8, bits as u8).raw())
        }
        _ => Err(wrong()),
    }
}

/// An identifier, marked as hexadecimal: 181 could be 181h or 0B5h.
fn identifier(text: &str) -> Result<u32, Exit> {
    let known = hexadecimal(text).filter(|id| (1..=0x7FF).contains(id));
    known.ok_or_else(|| {
        Exit::usage(format!("--id {text:?}: 0x001 to 0x7FF expected, in hex as 0x181 or 181h"))
    })
}
