//! PEAK `.trc`, versions 1.0 to 2.1. Columns come from the header's version, from `$COLUMNS`, or,
//! in an excerpt without header, from the line itself.

use super::reader::Parsed;
use super::record::{Buses, Direction, FrameKind, Record, Time};
use super::scan::{decimal, fixed, hex, hex_byte, word, words};

/// A column of a line (the letters of `$COLUMNS`, PEAK "CAN TRC file format").
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Column {
    Number,
    /// Milliseconds since the start.
    Time,
    Type,
    Bus,
    Id,
    Direction,
    Reserved,
    /// Length code or length in bytes.
    Length,
    Data,
}

const V1_0: &[Column] = &[Column::Number, Column::Time, Column::Id, Column::Length, Column::Data];
const V1_1: &[Column] =
    &[Column::Number, Column::Time, Column::Type, Column::Id, Column::Length, Column::Data];
const V1_2: &[Column] =
    &[Column::Number, Column::Time, Column::Bus, Column::Type, Column::Id, Column::Length, Column::Data];
const V1_3: &[Column] = &[
    Column::Number,
    Column::Time,
    Column::Bus,
    Column::Type,
    Column::Id,
    Column::Reserved,
    Column::Length,
    Column::Data,
];
const V2_0: &[Column] = &[
    Column::Number,
    Column::Time,
    Column::Type,
    Column::Id,
    Column::Direction,
    Column::Length,
    Column::Data,
];
const V2_1: &[Column] = &[
    Column::Number,
    Column::Time,
    Column::Type,
    Column::Bus,
    Column::Id,
    Column::Direction,
    Column::Reserved,
    Column::Length,
    Column::Data,
];

#[derive(Debug, Default)]
pub(super) struct Trc {
    columns: Option<Vec<Column>>,
    /// `$COLUMNS` has a length code (`L`) in place of a length in bytes (`l`).
    length_code: bool,
}

const MALFORMED: Parsed = Parsed::Damaged("the columns of this file's version expected");
const ID: Parsed = Parsed::Damaged("an identifier of 11 or 29 bits expected");
const STATUS: Parsed = Parsed::Damaged("a report of the hardware, no frame of the bus");

impl Trc {
    pub(super) fn line(&mut self, line: &[u8], record: &mut Record, buses: &mut Buses) -> Parsed {
        let text = line.trim_ascii();
        match text {
            [] | [b'#', ..] => return Parsed::Nothing,
            [b';', header @ ..] => {
                self.header(header.trim_ascii());
                return Parsed::Nothing;
            }
            _ => {}
        }
        let columns = match &self.columns {
            Some(columns) => columns.as_slice(),
            None => match guess(text) {
                Some(columns) => columns,
                None => return Parsed::Damaged("a number, a time and a frame expected"),
            },
        };
        parse(text, columns, self.length_code, record, buses).unwrap_or(MALFORMED)
    }

    fn header(&mut self, header: &[u8]) {
        if let Some(version) = header.strip_prefix(b"$FILEVERSION=") {
            self.columns = match version.trim_ascii() {
                b"1.0" => Some(V1_0),
                b"1.1" => Some(V1_1),
                b"1.2" => Some(V1_2),
                b"1.3" => Some(V1_3),
                b"2.0" => Some(V2_0),
                b"2.1" => Some(V2_1),
                _ => None,
            }
            .map(<[Column]>::to_vec);
        } else if let Some(letters) = header.strip_prefix(b"$COLUMNS=") {
            let letters = letters.split(|&byte| byte == b',').map(<[u8]>::trim_ascii);
            self.length_code = letters.clone().any(|letter| letter == b"L");
            let columns = letters.map(|letter| {
                Some(match letter {
                    b"N" => Column::Number,
                    b"O" => Column::Time,
                    b"T" => Column::Type,
                    b"B" => Column::Bus,
                    b"I" => Column::Id,
                    b"d" => Column::Direction,
                    b"R" => Column::Reserved,
                    b"l" | b"L" => Column::Length,
                    b"D" => Column::Data,
                    _ => return None,
                })
            });
            self.columns = columns.collect();
        }
    }
}

/// The columns of a line without a header: 1.x numbers lines `12)`, 2.x has a type of two letters.
fn guess(text: &[u8]) -> Option<&'static [Column]> {
    let mut words = words(text);
    let (number, _time, third, fourth) = (words.next()?, words.next()?, words.next()?, words.next()?);
    let (fifth, sixth) = (words.next()?, words.next());
    if let Some(number) = number.strip_suffix(b")") {
        decimal(number)?;
        return Some(match () {
            () if is_type_1(third) => V1_1,
            () if is_type_1(fourth) && sixth == Some(b"-") => V1_3,
            () if is_type_1(fourth) => V1_2,
            () => V1_0,
        });
    }
    decimal(number)?;
    if third.len() != 2 || !third.iter().all(u8::is_ascii_uppercase) {
        return None;
    }
    Some(if is_direction(fifth) { V2_0 } else { V2_1 })
}

fn is_type_1(text: &[u8]) -> bool {
    matches!(text, b"Rx" | b"Tx" | b"Warng" | b"Error")
}

fn is_direction(text: &[u8]) -> bool {
    matches!(text, b"Rx" | b"Tx")
}

fn parse(
    text: &[u8],
    columns: &[Column],
    length_code: bool,
    record: &mut Record,
    buses: &mut Buses,
) -> Option<Parsed> {
    *record = Record { frame: record.frame, ..Record::EMPTY };
    let mut kind = FrameKind::Data;
    let mut len = 0;
    let mut rest = text;
    for column in columns {
        if *column == Column::Data {
            break;
        }
        let (word, after) = word(rest)?;
        rest = after;
        match column {
            Column::Number => _ = decimal(word.strip_suffix(b")").unwrap_or(word))?,
            Column::Time => record.time = Some(Time(fixed(word, 1_000_000)?)),
            Column::Type => match word {
                b"Rx" => record.direction = Some(Direction::Rx),
                b"Tx" => record.direction = Some(Direction::Tx),
                b"DT" => {}
                b"FD" => kind = FrameKind::Fd { bit_rate_switch: false, error_passive: false },
                b"FB" => kind = FrameKind::Fd { bit_rate_switch: true, error_passive: false },
                b"FE" => kind = FrameKind::Fd { bit_rate_switch: false, error_passive: true },
                b"BI" => kind = FrameKind::Fd { bit_rate_switch: true, error_passive: true },
                b"RR" => kind = FrameKind::Remote,
                b"ER" | b"Error" => kind = FrameKind::Error,
                b"Warng" | b"ST" | b"EC" | b"EV" => return Some(STATUS),
                _ => return None,
            },
            Column::Bus => record.bus = (word != b"-").then(|| buses.find(word)).flatten(),
            // Errors may have no identifier.
            Column::Id if word == b"-" && kind == FrameKind::Error => record.frame.id = 0,
            Column::Id => {
                let id = hex(word)?;
                record.frame.id = id;
                record.frame.extended = word.len() > 4;
            }
            Column::Direction => match word {
                b"Rx" => record.direction = Some(Direction::Rx),
                b"Tx" => record.direction = Some(Direction::Tx),
                _ => return None,
            },
            Column::Length => len = usize::try_from(decimal(word)?).ok()?,
            Column::Reserved | Column::Data => {}
        }
    }
    let frame = &mut record.frame;
    if kind == FrameKind::Error {
        frame.id &= 0x1FFF_FFFF;
    } else if frame.id > if frame.extended { 0x1FFF_FFFF } else { 0x7FF } {
        // FFFFFFFF: a warning of version 1.0, which has no column for the type.
        let is_warning = frame.id == u32::MAX;
        return Some(if is_warning { STATUS } else { ID });
    }
    let is_fd = matches!(kind, FrameKind::Fd { .. });
    if is_fd && length_code {
        len = *[0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64].get(len)?;
    }
    if len > if is_fd { 64 } else { 8 } {
        return Some(Parsed::Damaged("a length that the frame can have expected"));
    }
    frame.len = len as u8;
    let mut bytes = words(rest);
    let first = word(rest).map(|(first, _)| first);
    if kind == FrameKind::Remote || first == Some(b"RTR") {
        kind = FrameKind::Remote;
        bytes.next();
    } else {
        // Version 1.0 marks errors so.
        if first == Some(b"ERROR") {
            kind = FrameKind::Error;
            bytes.next();
        }
        for room in frame.data.get_mut(..len)? {
            match bytes.next().and_then(hex_byte) {
                Some(byte) => *room = byte,
                None => return Some(Parsed::Damaged("fewer bytes than the length says")),
            }
        }
    }
    frame.kind = kind;
    if bytes.next().is_some() && kind != FrameKind::Error {
        return Some(Parsed::Damaged("more bytes than the length says"));
    }
    Some(Parsed::Frame)
}
