//! Words for objects: from an EDS where one is given, otherwise from the standards (CiA 301, 401, 402).

use core::cell::Cell;

use canopen_master::data_type::{DataType, Value};
use canopen_master::ds402::{Command, ControlWord, Mode, StatusWord};
use canopen_master::eds::{self, Device};
use canopen_master::trace::{Mapped, Tracer};
use canopen_master::{Address, NodeId, ds402, od};
use pdo::CobId;

use super::linmot;
use crate::exit::Exit;
use crate::output::counted;

/// What is known of the nodes' objects.
#[derive(Debug, Default)]
pub(crate) struct Names {
    devices: Vec<(NodeId, Device)>,
    /// One bit a node: those that are LinMot drives.
    linmot: Cell<u128>,
}

/// Number of the PDO that a communication or mapping parameter belongs to.
const fn pdo_number(index: u16) -> Option<u16> {
    match index {
        0x1400..=0x1BFF => Some((index & 0x1FF) + 1),
        _ => None,
    }
}

impl Names {
    /// Reads what `--eds NODE=FILE` names.
    /// `linmot`: nodes that are drives of LinMot.
    pub(crate) fn read(arguments: &[String], linmot: &[u8]) -> Result<Self, Exit> {
        let linmot = Cell::new(linmot.iter().fold(0, |nodes, node| nodes | 1 << (node & 0x7F)));
        let mut names = Self { devices: Vec::new(), linmot };
        for argument in arguments {
            let parts = argument.split_once('=');
            let node = parts.and_then(|(node, _)| NodeId::new(node.trim().parse().ok()?).ok());
            let (Some(node), Some((_, file))) = (node, parts) else {
                return Err(Exit::usage(format!(
                    "--eds {argument}: NODE=FILE with a node of 1 to 127 expected"
                )));
            };
            if names.devices.iter().any(|(known, _)| *known == node) {
                return Err(Exit::usage(format!("--eds {argument}: node {node} has a file already")));
            }
            let content = crate::eds::bytes(std::path::Path::new(file))?;
            let reading = eds::read(&content).map_err(|error| Exit::file(file, &error))?;
            names.devices.push((node, reading.device));
        }
        Ok(names)
    }

    /// Takes in the value of an object: who makes a device tells what its objects are.
    pub(super) fn heard(&self, node: NodeId, at: Address, data: &[u8]) {
        if at == Address::new(0x1018, 1) && data == linmot::VENDOR.to_le_bytes() {
            self.linmot.set(self.linmot.get() | 1 << node.raw());
        }
    }

    fn is_linmot(&self, node: NodeId) -> bool {
        self.linmot.get() >> node.raw() & 1 != 0
    }

    /// Tells the tracer what the EDS files say about identifiers and mappings.
    pub(crate) fn teach(&self, tracer: &mut Tracer) {
        for (node, device) in &self.devices {
            for object in device.objects.iter().filter(|object| (0x1000..=0x1BFF).contains(&object.index)) {
                for entry in object.entries() {
                    let id = Some(node.raw());
                    if let Some(Ok(value)) = entry.value_bytes(id).or_else(|| entry.default_bytes(id)) {
                        tracer.learn(*node, Address::new(object.index, entry.subindex), &value);
                    }
                }
            }
        }
    }

    fn entry(&self, node: NodeId, at: Address) -> Option<&eds::Entry> {
        let (_, device) = self.devices.iter().find(|(known, _)| *known == node)?;
        device.entry(at.index, at.sub)
    }

    /// The name that an EDS gives.
    pub(super) fn given(&self, node: NodeId, at: Address) -> Option<&str> {
        self.entry(node, at).map(|entry| entry.name.as_str())
    }

    /// The object in words: `6041h:00 status word`.
    pub(crate) fn object(&self, node: NodeId, at: Address) -> String {
        let (index, sub) = (at.index, at.sub);
        let mut text = format!("{index:04X}h:{sub:02X}");
        if let Some((_, device)) = self.devices.iter().find(|(known, _)| *known == node)
            && let Some(object) = device.object(index)
        {
            text.push_str(&format!(" {}", object.name()));
            if let Some(entry) = object.entry(sub).filter(|_| object.is_composed()) {
                text.push_str(&format!(", {}", entry.name));
                // Some files call all of them the same.
                if object.entries().iter().filter(|other| other.name == entry.name).count() > 1 {
                    text.push_str(&format!(" {sub}"));
                }
            }
            return text;
        }
        if self.is_linmot(node)
            && let Some(name) = linmot::object(at)
        {
            return format!("{text} {name}");
        }
        let Some(name) = eds::standard_object(index).map(|object| object.words) else { return text };
        text.push_str(&format!(" {name}"));
        if let Some(number) = pdo_number(index) {
            text.push_str(&format!(" {number}"));
        }
        match eds::standard_sub_object(index, sub) {
            Some((name, _)) => text.push_str(&format!(", {name}")),
            None if matches!(index, 0x1600..=0x17FF | 0x1A00..=0x1BFF) => {
                text.push_str(&format!(", object {sub}"));
            }
            None if sub > 0 => text.push_str(&format!(" {sub}")),
            None => {}
        }
        text
    }

    /// The object's name alone, where it has one.
    pub(crate) fn short(&self, node: NodeId, at: Address) -> String {
        let object = self.object(node, at);
        match object.split_once(' ') {
            Some((_, name)) => name.to_owned(),
            None => object,
        }
    }

    fn data_type(&self, node: NodeId, at: Address) -> Option<DataType> {
        match self.entry(node, at).and_then(|entry| entry.data_type) {
            Some(known) => Some(DataType(known.0)),
            None => eds::standard_sub_object(at.index, at.sub)
                .map(|(_, known)| known)
                .or_else(|| eds::standard_object(at.index).map(|object| object.data_type)),
        }
    }

    /// The value as the object's type in an EDS has it.
    pub(super) fn value(&self, node: NodeId, at: Address, data: &[u8]) -> Option<serde_json::Value> {
        let known = self.entry(node, at)?.data_type?;
        Some(match Value::parse(DataType(known.0), data).ok()? {
            Value::Boolean(value) => value.into(),
            Value::Signed(value) => value.into(),
            Value::Unsigned(value) => value.into(),
            Value::Real32(value) => value.into(),
            Value::Real64(value) => value.into(),
            Value::VisibleString(text) => String::from_utf8_lossy(text).trim_end_matches('\0').into(),
            _ => return None,
        })
    }

    /// The bits of an object as a number, negative where its type has a sign.
    pub(crate) fn signed(&self, node: NodeId, at: Address, bits: u8, raw: u64) -> i128 {
        use canopen_master::data_type::Kind;
        let signed = matches!(self.data_type(node, at).map(DataType::kind), Some(Kind::Signed(_)));
        if signed && (1..=64).contains(&bits) {
            let unused = 64 - u32::from(bits);
            return i128::from((raw << unused) as i64 >> unused);
        }
        i128::from(raw)
    }

    /// A value in words.
    pub(crate) fn words(&self, node: NodeId, at: Address, data: &[u8]) -> String {
        if let Some(words) = special(at, data) {
            let is_state = matches!(
                at.index,
                ds402::CONTROL_WORD | ds402::STATUS_WORD | ds402::MODE | ds402::MODE_DISPLAY
            );
            let len = self.data_type(node, at).filter(|_| is_state).and_then(DataType::size);
            return match len {
                Some(len) if usize::from(len) != data.len() => {
                    format!("{words}, in {}", counted(data.len(), "byte", "bytes"))
                }
                _ => words,
            };
        }
        if self.is_linmot(node)
            && let Some(words) = linmot::value(at, data)
        {
            return words;
        }
        let parsed = self.data_type(node, at).and_then(|known| Value::parse(known, data).ok());
        match parsed {
            Some(Value::Boolean(value)) => value.to_string(),
            Some(Value::Signed(value)) => value.to_string(),
            Some(Value::Unsigned(value)) if value < 10 => value.to_string(),
            Some(Value::Unsigned(value)) => format!("{value} ({value:X}h)"),
            Some(Value::Real32(value)) => value.to_string(),
            Some(Value::Real64(value)) => value.to_string(),
            Some(Value::VisibleString(text)) => quoted(text),
            _ if data.len() > 8 && data.iter().all(|byte| matches!(byte, b' '..=b'~')) => quoted(data),
            _ => bytes(data),
        }
    }
}

fn quoted(data: &[u8]) -> String {
    format!("{:?}", text(data))
}

/// A text of a device: UTF-8, or as devices older than it write, ISO 8859-1; without the zeros at its end.
pub(crate) fn text(data: &[u8]) -> String {
    let text = core::str::from_utf8(data)
        .map_or_else(|_| data.iter().copied().map(char::from).collect(), str::to_owned);
    text.trim_end_matches('\0').to_owned()
}

/// Up to 16 bytes in hex; of more, their number too.
pub(crate) fn bytes(data: &[u8]) -> String {
    const MOST: usize = 16;
    let shown: Vec<String> = data.iter().take(MOST).map(|byte| format!("{byte:02X}")).collect();
    match data.len() {
        0 => "nothing".into(),
        len if len > MOST => format!("{} … ({len} bytes)", shown.join(" ")),
        _ => shown.join(" "),
    }
}

/// Objects whose bits have a meaning of their own.
fn special(at: Address, data: &[u8]) -> Option<String> {
    let u16 = || data.first_chunk().map(|bytes| u16::from_le_bytes(*bytes));
    let u32 = || data.first_chunk().map(|bytes| u32::from_le_bytes(*bytes));
    Some(match (at.index, at.sub) {
        (ds402::CONTROL_WORD, 0) => control(ControlWord(u16()?)),
        (ds402::STATUS_WORD, 0) => status(StatusWord(u16()?)),
        (ds402::MODE | ds402::MODE_DISPLAY, 0) => {
            let &[mode, ..] = data else { return None };
            let mode = Mode(mode as i8);
            format!("{} ({})", mode.0, mode.name())
        }
        (0x1000, 0) => {
            let value = u32()?;
            let profile = match value & 0xFFFF {
                0 => ", no profile".into(),
                0x0191 => ", I/O (CiA 401)".into(),
                0x0192 => ", drive (CiA 402)".into(),
                profile => format!(", profile {profile}"),
            };
            format!("{value:08X}h{profile}")
        }
        (0x1018, 1..=4) => format!("{:08X}h", u32()?),
        (0x1016, 1..) => {
            let value = u32()?;
            format!("node {} within {} ms", value >> 16 & 0xFF, value & 0xFFFF)
        }
        (0x1010, 1..) if data == od::SAVE => "\"save\"".into(),
        (0x1011, 1..) if data == od::LOAD => "\"load\"".into(),
        (0x1005 | 0x1012 | 0x1014, 0) | (0x1200..=0x12FF, 1 | 2) | (0x1400..=0x15FF | 0x1800..=0x19FF, 1) => {
            cob_id(at.index, CobId(u32()?))
        }
        (0x1400..=0x15FF | 0x1800..=0x19FF, 2) => {
            let &[kind, ..] = data else { return None };
            match kind {
                0 => "0, acyclic, at the SYNC".into(),
                1 => "1, at every SYNC".into(),
                2..=240 => format!("{kind}, at every {kind}th SYNC"),
                252 | 253 => format!("{kind}, on request"),
                254 => "254, on events of the manufacturer".into(),
                255 => "255, on events of the profile".into(),
                _ => format!("{kind}, reserved"),
            }
        }
        (0x1600..=0x17FF | 0x1A00..=0x1BFF, 1..) => {
            let object = Mapped::from_entry(u32()?);
            let name = eds::standard_object(object.index).map_or("", |known| known.words);
            let space = if name.is_empty() { "" } else { " " };
            let bits = counted(object.bits.into(), "bit", "bits");
            format!("{:04X}h:{:02X}{space}{name}, {bits}", object.index, object.sub)
        }
        _ => return None,
    })
}

/// An identifier and what its upper bits say (CiA 301, 7.5.2): 1005h and 1012h have bits of their own.
fn cob_id(index: u16, cob: CobId) -> String {
    let upper = (cob.0 >> 30 & 1 != 0, !cob.is_valid());
    let what = match (index, upper) {
        (0x1005, (true, _)) => ", produces it",
        (0x1012, (true, true)) => ", produces and consumes it",
        (0x1012, (true, false)) => ", produces it",
        (0x1012, (false, true)) => ", consumes it",
        (0x1005 | 0x1012, _) => "",
        (_, (_, true)) => ", switched off",
        (0x1800..=0x19FF, (true, false)) => ", no remote frames",
        _ => "",
    };
    format!("{:03X}h{what}", cob.id())
}

/// A control word: what it asks for.
fn control(word: ControlWord) -> String {
    let command = match word.command() {
        _ if word.has(ControlWord::FAULT_RESET) => "fault reset",
        Command::Shutdown => "shutdown",
        Command::SwitchOn => "switch on",
        Command::EnableOperation => "enable operation",
        Command::DisableVoltage => "disable voltage",
        Command::QuickStop => "quick stop",
        Command::FaultReset => "fault reset",
    };
    let halt = if word.has(ControlWord::HALT) { ", halt" } else { "" };
    let start = if word.command() == Command::EnableOperation && word.has(ControlWord::MODE_BIT_4) {
        ", new set-point or start"
    } else {
        ""
    };
    format!("{:04X}h, {command}{start}{halt}", word.0)
}

/// A status word: the state it shows.
fn status(word: StatusWord) -> String {
    let mut text = format!("{:04X}h, ", word.0);
    match word.state() {
        Some(state) => text.push_str(&state.to_string()),
        None => text.push_str("no state of CiA 402"),
    }
    for (bit, name) in [
        (StatusWord::WARNING, ", warning"),
        (StatusWord::TARGET_REACHED, ", target reached"),
        (StatusWord::INTERNAL_LIMIT, ", internal limit"),
    ] {
        if word.has(bit) {
            text.push_str(name);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standard_objects_are_in_order_and_have_words() {
        let names = Names::default();
        let node = NodeId::MIN;
        assert_eq!(names.object(node, Address::new(0x1A01, 2)), "1A01h:02 mapping of TPDO 2, object 2");
        assert_eq!(names.object(node, Address::new(0x1800, 1)), "1800h:01 TPDO 1, identifier");
        assert_eq!(names.object(node, Address::new(0x2000, 1)), "2000h:01");
        for (at, data, words) in [
            (Address::new(0x6041, 0), &[0x37, 0x06][..], "0637h, operation enabled, target reached"),
            (Address::new(0x6040, 0), &[0x0F, 0x00], "000Fh, enable operation"),
            (Address::new(0x6040, 0), &[0x06, 0x00, 0x01, 0x00], "0006h, shutdown, in 4 bytes"),
            (Address::new(0x6060, 0), &[8], "8 (csp)"),
            (Address::new(0x1000, 0), &[0x92, 0x01, 0x02, 0x00], "00020192h, drive (CiA 402)"),
            (Address::new(0x1A00, 1), &[0x10, 0x00, 0x41, 0x60], "6041h:00 status word, 16 bits"),
            (Address::new(0x1800, 1), &[0x81, 0x01, 0x00, 0xC0], "181h, switched off"),
            (Address::new(0x1800, 1), &[0x81, 0x01, 0x00, 0x40], "181h, no remote frames"),
            (Address::new(0x1400, 1), &[0x01, 0x02, 0x00, 0x40], "201h"),
            (Address::new(0x1280, 1), &[0x07, 0x06, 0x00, 0x80], "607h, switched off"),
            (Address::new(0x1005, 0), &[0x80, 0x00, 0x00, 0x40], "080h, produces it"),
            (Address::new(0x1005, 0), &[0x80, 0x00, 0x00, 0x80], "080h"),
            (Address::new(0x1012, 0), &[0x00, 0x01, 0x00, 0x80], "100h, consumes it"),
            (Address::new(0x1012, 0), &[0x00, 0x01, 0x00, 0xC0], "100h, produces and consumes it"),
            (Address::new(0x1012, 0), &[0x00, 0x01, 0x00, 0x00], "100h"),
            (Address::new(0x1014, 0), &[0x85, 0x00, 0x00, 0x80], "085h, switched off"),
            (Address::new(0x1008, 0), b"LD 2000\0", "\"LD 2000\""),
            (Address::new(0x1008, 0), b"Sonderger\xE4t", "\"Sonderger\u{E4}t\""),
            (Address::new(0x1008, 0), "Ger\u{E4}t".as_bytes(), "\"Ger\u{E4}t\""),
            (Address::new(0x6064, 0), &[0xFF, 0xFF, 0xFF, 0xFF], "-1"),
            (Address::new(0x2000, 0), &[1, 2], "01 02"),
        ] {
            assert_eq!(names.words(node, at, data), words);
        }
        assert_eq!(names.signed(node, Address::new(0x6064, 0), 24, 0x00FF_FFFF), -1);
        assert_eq!(names.signed(node, Address::new(0x6041, 0), 16, 0xFFFF), 0xFFFF);
    }
}
