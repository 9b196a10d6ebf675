//! IXXAT trace text: a preamble, a line that names the columns
//! (`"Time","Identifier (hex)","Format","Flags","Data (hex)"`), one line a frame; columns separated
//! by comma, semicolon or tab, quoted or not. Also dumps without a header in the order bus,
//! identifier, direction, type, length, data (`CAN1  67F Tx SD  8  2F 03 10 00 FF 00 00 00`).

use super::reader::Parsed;
use super::record::{Buses, Direction, FrameKind, MAX_DATA, Record, Time, Times};
use super::scan::{clock, decimal, fixed, hex, hex_byte, word, words};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Column {
    Time,
    Bus,
    Id,
    IdDecimal,
    Format,
    Flags,
    Length,
    Data,
    Other,
}

#[derive(Debug, Default)]
pub(super) struct Columns {
    delimiter: u8,
    columns: Vec<Column>,
    times: Times,
}

const MALFORMED: Parsed = Parsed::Damaged("the columns that the header names expected");

impl Columns {
    /// `Time (rel)` is that since the line before.
    pub(super) const fn times(&self) -> Times {
        self.times
    }

    pub(super) fn line(&mut self, line: &[u8], record: &mut Record, buses: &mut Buses) -> Parsed {
        let text = line.trim_ascii();
        if matches!(text, [] | [b'#', ..]) {
            return Parsed::Nothing;
        }
        *record = Record { frame: record.frame, ..Record::EMPTY };
        record.frame.kind = FrameKind::Data;
        record.frame.extended = false;
        if self.columns.is_empty() {
            if self.header(text) {
                return Parsed::Nothing;
            }
            // Before a preamble, for a bus may be called like a line of one.
            return match plain(text, record, buses) {
                Some(parsed) => parsed,
                None if is_preamble(text) => Parsed::Nothing,
                None => Parsed::Damaged("bus, identifier, direction, type, length and data expected"),
            };
        }
        self.fields(text, record, buses).unwrap_or(MALFORMED)
    }

    /// The line that names the columns.
    fn header(&mut self, text: &[u8]) -> bool {
        let lower = text.to_ascii_lowercase();
        let Some(delimiter) = [b';', b'\t', b','].into_iter().find(|delimiter| lower.contains(delimiter))
        else {
            return false;
        };
        let columns: Vec<Column> = split(&lower, delimiter)
            .map(|name| match name {
                [b't', b'i', b'm', b'e', ..] => Column::Time,
                [b'b', b'u', b's', ..] | [b'c', b'h', b'a', b'n', ..] | [b'p', b'o', b'r', b't', ..] => {
                    Column::Bus
                }
                [b'i', b'd', ..] if name.windows(3).any(|part| part == b"dec") => Column::IdDecimal,
                [b'i', b'd', ..] => Column::Id,
                [b'f', b'o', b'r', b'm', ..] | [b't', b'y', b'p', b'e', ..] => Column::Format,
                [b'f', b'l', b'a', b'g', ..] => Column::Flags,
                [b'd', b'l', b'c', ..] | [b'l', b'e', b'n', ..] => Column::Length,
                [b'd', b'a', b't', b'a', ..] => Column::Data,
                _ => Column::Other,
            })
            .collect();
        let names = |column| columns.contains(&column);
        if (names(Column::Id) || names(Column::IdDecimal)) && names(Column::Data) {
            let relative = split(&lower, delimiter)
                .any(|name| name.starts_with(b"time") && name.windows(3).any(|part| part == b"rel"));
            self.times = if relative { Times::Deltas } else { Times::Absolute };
            self.delimiter = delimiter;
            self.columns = columns;
            return true;
        }
        false
    }

    fn fields(&self, text: &[u8], record: &mut Record, buses: &mut Buses) -> Option<Parsed> {
        let mut has_id = false;
        let mut len = None;
        for (column, field) in self.columns.iter().zip(split(text, self.delimiter)) {
            match column {
                Column::Time if field.is_empty() => {}
                Column::Time => record.time = Some(Time(time(field)?)),
                Column::Bus => record.bus = (!field.is_empty()).then(|| buses.find(field)).flatten(),
                Column::Id | Column::IdDecimal => {
                    record.frame.id = if *column == Column::Id {
                        hex(field.strip_suffix(b"h").unwrap_or(field))?
                    } else {
                        u32::try_from(decimal(field)?).ok()?
                    };
                    has_id = true;
                }
                Column::Format => set_format(field, record),
                Column::Flags => set_flags(field, record),
                Column::Length => len = decimal(field),
                Column::Data => data(field, record)?,
                Column::Other => {}
            }
        }
        if !has_id {
            return None;
        }
        if record.frame.kind == FrameKind::Remote {
            record.frame.len = u8::try_from(len.unwrap_or(0)).ok().filter(|len| *len <= 8)?;
        }
        checked(record)
    }
}

/// The lines before the one that names the columns.
fn is_preamble(text: &[u8]) -> bool {
    let text = text.strip_prefix(b"\"").unwrap_or(text);
    ["ASCII Trace", "Date", "Start", "Stop", "Overrun", "Baudrate", "Bitrate", "Bus", "Controller", "Version"]
        .iter()
        .any(|start| text.starts_with(start.as_bytes()))
}

/// Fields of a line, without quotes and blanks.
fn split(text: &[u8], delimiter: u8) -> impl Iterator<Item = &[u8]> {
    text.split(move |&byte| byte == delimiter).map(|field| {
        let field = field.trim_ascii();
        let field = field.strip_prefix(b"\"").unwrap_or(field);
        field.strip_suffix(b"\"").unwrap_or(field).trim_ascii()
    })
}

fn time(text: &[u8]) -> Option<i64> {
    if text.contains(&b':') { clock(text) } else { fixed(text, 1_000_000_000) }
}

fn set_format(text: &[u8], record: &mut Record) {
    let lower = text.to_ascii_lowercase();
    if lower.starts_with(b"ext") {
        record.frame.extended = true;
    }
    if lower.ends_with(b"rtr") || lower.ends_with(b"remote") {
        record.frame.kind = FrameKind::Remote;
    } else if lower.starts_with(b"err") {
        record.frame.kind = FrameKind::Error;
    } else if lower.contains(&b'f') && lower.ends_with(b"fd") {
        record.frame.kind = FrameKind::Fd { bit_rate_switch: false, error_passive: false };
    }
}

fn set_flags(text: &[u8], record: &mut Record) {
    for flag in text.split(|byte| matches!(byte, b' ' | b',' | b'|')) {
        match flag.to_ascii_lowercase().as_slice() {
            b"rtr" | b"r" => record.frame.kind = FrameKind::Remote,
            b"ext" => record.frame.extended = true,
            b"srr" | b"self" | b"tx" => record.direction = Some(Direction::Tx),
            b"rx" => record.direction = Some(Direction::Rx),
            b"err" | b"error" => record.frame.kind = FrameKind::Error,
            _ => {}
        }
    }
}

fn data(text: &[u8], record: &mut Record) -> Option<()> {
    if text.eq_ignore_ascii_case(b"rtr") || text.eq_ignore_ascii_case(b"remote request") {
        record.frame.kind = FrameKind::Remote;
        return Some(());
    }
    let mut len = 0;
    for byte in words(text) {
        *record.frame.data.get_mut(len)? = hex_byte(byte)?;
        len += 1;
    }
    record.frame.len = u8::try_from(len).ok()?;
    Some(())
}

/// `CAN1  67F Tx SD  8  2F 03 …`: S or E for the identifier, D or R for the frame.
fn plain(text: &[u8], record: &mut Record, buses: &mut Buses) -> Option<Parsed> {
    let (bus, rest) = word(text)?;
    let (id, rest) = word(rest)?;
    let (way, rest) = word(rest)?;
    let (kind, rest) = word(rest)?;
    let (len, rest) = word(rest)?;
    record.frame.id = hex(id)?;
    record.direction = match way {
        b"Tx" | b"TX" => Some(Direction::Tx),
        b"Rx" | b"RX" => Some(Direction::Rx),
        _ => return None,
    };
    let &[format, content] = kind else { return None };
    record.frame.extended = match format {
        b'S' => false,
        b'E' => true,
        _ => return None,
    };
    let len = usize::try_from(decimal(len)?).ok().filter(|len| *len <= 8)?;
    record.bus = buses.find(bus);
    match content {
        b'R' => {
            record.frame.kind = FrameKind::Remote;
            record.frame.len = len as u8;
        }
        b'D' => {
            let mut bytes = words(rest);
            for room in record.frame.data.get_mut(..len.min(MAX_DATA))? {
                match bytes.next().and_then(hex_byte) {
                    Some(byte) => *room = byte,
                    None => return Some(Parsed::Damaged("fewer bytes than the length says")),
                }
            }
            if bytes.next().is_some() {
                return Some(Parsed::Damaged("more bytes than the length says"));
            }
            record.frame.len = len as u8;
        }
        _ => return None,
    }
    checked(record)
}

fn checked(record: &mut Record) -> Option<Parsed> {
    let frame = &mut record.frame;
    if frame.id > 0x7FF && frame.kind != FrameKind::Error {
        frame.extended = true;
    }
    if frame.id > 0x1FFF_FFFF {
        return Some(Parsed::Damaged("an identifier of 11 or 29 bits expected"));
    }
    let most = if matches!(frame.kind, FrameKind::Fd { .. }) { MAX_DATA } else { 8 };
    if frame.len() > most {
        return Some(Parsed::Damaged("more data than the frame can have"));
    }
    Some(Parsed::Frame)
}
