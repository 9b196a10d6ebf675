//! candump of can-utils: `-l` logs (`(1436509052.249713) can0 581#4B41600018028FAF`) and screen text
//! (` (000.001)  can0  TX - -  581   [8]  4B 41 60 00 18 02 8F AF   'KA`.....'`).

use super::log_line::LogLines;
use super::reader::{INNER_CR, Parsed, has_inner_cr};
use super::record::{Buses, Direction, FrameKind, MAX_DATA, Record, Time};
use super::scan::{SECONDS, date_time, decimal, fixed, hex, hex_byte, hex_run, nibble, word};

/// Flag of SocketCAN in an identifier of 8 digits: an error report.
const ERROR_FLAG: u32 = 0x2000_0000;
const TOO_MUCH: &str = "up to 8 bytes in hex expected after #";

/// Reads candump lines of either form, line by line.
#[derive(Debug, Default)]
pub(super) struct Candump {
    log: LogLines,
    /// The line before was an error report, whose explanation may follow on lines of its own.
    after_error: bool,
}

impl Candump {
    /// A line of the common form at the start of what is held; its length with its end. `None` of any
    /// other line, and of one that is not held whole.
    #[inline]
    pub(super) fn log_line(&mut self, held: &[u8], record: &mut Record) -> Option<usize> {
        let len = self.log.line(held, record)?;
        self.after_error = false;
        Some(len)
    }

    pub(super) fn line(&mut self, line: &[u8], record: &mut Record, buses: &mut Buses) -> Parsed {
        let parsed = self.any_line(line, record, buses);
        if parsed == Parsed::Frame
            && let Some(bus) = record.bus
        {
            self.log.set_bus(bus, buses.name(bus).unwrap_or(""));
        }
        parsed
    }

    fn any_line(&mut self, line: &[u8], record: &mut Record, buses: &mut Buses) -> Parsed {
        // An explanation that goes on, unless it is a frame.
        let explains = core::mem::take(&mut self.after_error) && line.first() == Some(&b'\t');
        let parsed = match memchr::memchr(0x1B, line) {
            _ if has_inner_cr(line) => INNER_CR,
            None => parse(line, record, buses),
            Some(_) => parse(&without_colours(line), record, buses),
        };
        if explains && parsed != Parsed::Frame {
            return Parsed::Nothing;
        }
        self.after_error = parsed == Parsed::Frame && record.frame.kind == FrameKind::Error;
        parsed
    }
}

/// The line without the escape sequences of `candump -c`.
#[cold]
fn without_colours(line: &[u8]) -> Vec<u8> {
    let mut plain = Vec::with_capacity(line.len());
    let mut parts = line.split(|&byte| byte == 0x1B);
    plain.extend_from_slice(parts.next().unwrap_or(&[]));
    for part in parts {
        let end = part.iter().position(u8::is_ascii_alphabetic).map_or(part.len(), |at| at + 1);
        plain.extend_from_slice(part.get(end..).unwrap_or(&[]));
    }
    plain
}

#[inline]
fn parse(line: &[u8], record: &mut Record, buses: &mut Buses) -> Parsed {
    let text = line.trim_ascii_start();
    let (time, text) = match text.split_first() {
        None | Some((b'#', _)) => return Parsed::Nothing,
        Some((b'(', rest)) => {
            let Some(end) = memchr::memchr(b')', rest) else { return Parsed::Damaged("time without )") };
            let (time, rest) = rest.split_at(end);
            let Some(time) = fixed(time, SECONDS).or_else(|| date_time(time)) else {
                return Parsed::Damaged("a time in brackets expected");
            };
            (Some(Time(time)), rest.get(1..).unwrap_or(&[]))
        }
        Some(_) => (None, text),
    };
    record.time = time;
    record.bus = None;
    record.direction = None;
    record.loopback = false;
    // `bus`, direction and flags stand before the identifier; a log has `id#data` in one word.
    let Some((first, rest)) = word(text) else { return Parsed::Damaged("nothing after the time") };
    if let Some((second, tail)) = word(rest)
        && let Some(hash) = memchr::memchr(b'#', second)
    {
        record.bus = buses.find(first);
        return log_frame(second, hash, tail, record);
    }
    if let Some(hash) = memchr::memchr(b'#', first) {
        return log_frame(first, hash, rest, record);
    }
    screen(first, rest, record, buses)
}

/// `id#data`, `id#R8`, `id##flagsdata`, and what may follow it: direction, length code.
#[inline]
fn log_frame(word: &[u8], hash: usize, tail: &[u8], record: &mut Record) -> Parsed {
    let (id, data) = word.split_at(hash);
    if let Some(damaged) = set_id(id, record) {
        return damaged;
    }
    let frame = &mut record.frame;
    let data = data.get(1..).unwrap_or(&[]);
    // `_9` behind 8 bytes: the raw length code of an 8-byte frame.
    let data = match data {
        [bytes @ .., b'_', code] if bytes.len() == 16 && nibble(*code) <= 0x0F => bytes,
        data => data,
    };
    match data {
        [b'R' | b'r', length @ ..] => {
            frame.kind = FrameKind::Remote;
            frame.len = match length {
                [] => 0,
                &[digit @ b'0'..=b'8', ..] => digit - b'0',
                _ => return Parsed::Damaged("a remote frame asks for 0 to 8 bytes"),
            };
        }
        [b'#', flags, bytes @ ..] if nibble(*flags) <= 0x0F => {
            let flags = nibble(*flags);
            frame.kind = FrameKind::Fd { bit_rate_switch: flags & 1 != 0, error_passive: flags & 2 != 0 };
            match hex_run(bytes, &mut frame.data) {
                Some(len) if fd_length(len) => frame.len = len as u8,
                _ => return Parsed::Damaged("data of a length that CAN FD has expected"),
            }
        }
        bytes => match hex_run(bytes, frame.data.first_chunk_mut::<8>().map_or(&mut [], |room| room)) {
            Some(len) => frame.len = len as u8,
            None if bytes.contains(&b'.') => return dotted(bytes, record, tail),
            None => return Parsed::Damaged(TOO_MUCH),
        },
    }
    behind(tail, record)
}

/// `123#11.22.3344`, as people type it.
fn dotted(text: &[u8], record: &mut Record, tail: &[u8]) -> Parsed {
    let mut digits = [0; 16];
    let mut count = 0;
    for &digit in text.iter().filter(|&&byte| byte != b'.') {
        let Some(room) = digits.get_mut(count) else { return Parsed::Damaged(TOO_MUCH) };
        *room = digit;
        count += 1;
    }
    match digits.get(..count).and_then(|digits| hex_run(digits, &mut record.frame.data)) {
        Some(len) => record.frame.len = len as u8,
        None => return Parsed::Damaged(TOO_MUCH),
    }
    behind(tail, record)
}

/// What stands behind the data: nothing, the direction as `R` or `T`, a comment.
fn behind(text: &[u8], record: &mut Record) -> Parsed {
    let (way, rest) = word(text).unwrap_or((b"", b""));
    let (direction, rest) = match way {
        b"R" | b"Rx" | b"RX" => (Some(Direction::Rx), rest),
        b"T" | b"Tx" | b"TX" => (Some(Direction::Tx), rest),
        _ => (None, text),
    };
    record.direction = direction;
    match rest.trim_ascii() {
        [] | [b'#' | b';', ..] | [b'/', b'/', ..] => Parsed::Frame,
        _ => Parsed::Damaged("R, T or nothing expected behind the data"),
    }
}

/// Sets identifier and kind; 3 digits are a standard identifier, 8 an extended one or an error.
#[inline]
fn set_id(text: &[u8], record: &mut Record) -> Option<Parsed> {
    let frame = &mut record.frame;
    frame.kind = FrameKind::Data;
    match (text.len(), hex(text)) {
        (1..=3, Some(id @ 0..=0x7FF)) => {
            frame.id = id;
            frame.extended = false;
            None
        }
        (8, Some(id)) if id & ERROR_FLAG != 0 => {
            frame.id = id & (ERROR_FLAG - 1);
            frame.kind = FrameKind::Error;
            None
        }
        (8, Some(id @ 0..=0x1FFF_FFFF)) => {
            frame.id = id;
            frame.extended = true;
            None
        }
        _ => Some(Parsed::Damaged("an identifier of 3 or 8 hex digits expected")),
    }
}

/// Lengths that a CAN FD frame can have (ISO 11898-1, table of the data length code).
fn fd_length(len: usize) -> bool {
    len <= 8 || matches!(len, 12 | 16 | 20 | 24 | 32 | 48 | 64)
}

fn screen(first: &[u8], mut rest: &[u8], record: &mut Record, buses: &mut Buses) -> Parsed {
    const NO_FRAME: Parsed = Parsed::Damaged("no frame: an identifier and a length in brackets expected");
    let mut id = first;
    let mut words = 0;
    let mut fd = (false, false);
    let length = loop {
        let Some((next, after)) = word(rest) else { return NO_FRAME };
        if let [b'[' | b'{', digits @ .., b']' | b'}'] = next {
            rest = after;
            break digits;
        }
        // `id` was not the identifier but one of the words before it.
        match id {
            b"RX" | b"Rx" => record.direction = Some(Direction::Rx),
            b"TX" | b"Tx" => record.direction = Some(Direction::Tx),
            b"-" => {}
            b"B" if words > 0 => fd.0 = true,
            b"E" if words > 0 => fd.1 = true,
            name if record.bus.is_none() && words == 0 => record.bus = buses.find(name),
            _ => return NO_FRAME,
        }
        words += 1;
        id = next;
        rest = after;
    };
    if let Some(damaged) = set_id(id, record) {
        return damaged;
    }
    let frame = &mut record.frame;
    let len = match *length {
        [digit @ b'0'..=b'8'] => usize::from(digit - b'0'),
        [b'0'..=b'9', b'0'..=b'9'] => {
            let len = decimal(length).unwrap_or(u64::MAX) as usize;
            if !fd_length(len) {
                return Parsed::Damaged("a length that CAN FD has expected in the brackets");
            }
            frame.kind = FrameKind::Fd { bit_rate_switch: fd.0, error_passive: fd.1 };
            len
        }
        _ => return Parsed::Damaged("a length of 0 to 8 expected in the brackets"),
    };
    frame.len = len as u8;
    if rest.trim_ascii_start().starts_with(b"remote request") {
        frame.kind = FrameKind::Remote;
        return Parsed::Frame;
    }
    let Some(rest) = spaced(rest, len, &mut frame.data) else {
        return Parsed::Damaged("fewer bytes than the length in brackets says");
    };
    // What follows the data is an ASCII column or a comment.
    if let Some((more, _)) = word(rest) {
        if more == b"ERRORFRAME" {
            frame.kind = FrameKind::Error;
        } else if hex_byte(more).is_some() && rest.starts_with(b" ") && !rest.starts_with(b"  ") {
            return Parsed::Damaged("more bytes than the length in brackets says");
        }
    }
    Parsed::Frame
}

/// `len` bytes, `11 22 33` or, with swapped bytes, ``33`22`11``; what follows them.
fn spaced<'a>(text: &'a [u8], len: usize, data: &mut [u8; MAX_DATA]) -> Option<&'a [u8]> {
    let mut rest = text;
    if let Some((first, after)) = word(rest)
        && first.contains(&b'`')
    {
        let mut at = len;
        for byte in first.split(|&byte| byte == b'`') {
            at = at.checked_sub(1)?;
            *data.get_mut(at)? = hex_byte(byte)?;
        }
        return (at == 0).then_some(after);
    }
    for room in data.get_mut(..len)? {
        let (byte, after) = word(rest)?;
        *room = hex_byte(byte)?;
        rest = after;
    }
    Some(rest)
}
