//! Vector `.asc`: `   0.002500 1  181             Rx   d 8 00 11 22 33 44 55 66 77`, FD lines
//! `   0.003 CANFD   1 Rx        123  Name  1 0 8 8 00 11 …`; `base hex` or `base dec`.

use super::reader::Parsed;
use super::record::{Buses, Direction, FrameKind, Record, Time, Times};
use super::scan::{decimal, fixed, hex, nibble, word, words};

/// Bit of the flags at the end of an FD line: the frame is in FD format.
const FLAG_FD: u32 = 1 << 12;
const FLAG_REMOTE: u32 = 1 << 4;

#[derive(Debug, Default)]
pub(super) struct Asc {
    decimal: bool,
    times: Times,
}

const MALFORMED: Parsed = Parsed::Damaged("channel, identifier, direction, d or r, length and data expected");
const STATUS: Parsed = Parsed::Damaged("a status of the controller, no frame of the bus");
const OVERLOAD: Parsed = Parsed::Damaged("an overload frame, which carries nothing");
const OTHER: Parsed = Parsed::Damaged("an event that is no frame of a CAN bus");

impl Asc {
    /// `timestamps relative` are those since the event before.
    pub(super) const fn times(&self) -> Times {
        self.times
    }

    pub(super) fn line(&mut self, line: &[u8], record: &mut Record, buses: &mut Buses) -> Parsed {
        let Some((first, rest)) = word(line) else { return Parsed::Nothing };
        if !first.first().is_some_and(|&byte| byte.is_ascii_digit() || byte == b'-') {
            return self.header(first, rest);
        }
        let Some(time) = fixed(first, 1_000_000_000) else {
            return Parsed::Damaged("a time in seconds expected");
        };
        *record = Record { time: Some(Time(time)), frame: record.frame, ..Record::EMPTY };
        let Some((channel, rest)) = word(rest) else { return Parsed::Damaged("nothing after the time") };
        match channel {
            b"CANFD" => self.fd(rest, record, buses).unwrap_or(MALFORMED),
            _ if decimal(channel).is_some() => {
                record.bus = buses.find(channel);
                self.classic(rest, record).unwrap_or(MALFORMED)
            }
            // `CAN 1 Status:chip status error active`.
            b"CAN" => STATUS,
            // `Start of measurement`, `log trigger event`: where the recording begins and ends.
            b"Start" | b"log" | [b'/', b'/', ..] => Parsed::Nothing,
            // LIN, FlexRay, Ethernet, variables of the tool.
            _ if channel.first().is_some_and(u8::is_ascii_alphabetic) => OTHER,
            _ => MALFORMED,
        }
    }

    fn header(&mut self, first: &[u8], rest: &[u8]) -> Parsed {
        match first {
            b"base" => {
                self.decimal = words(rest).next() == Some(b"dec");
                let relative = words(rest).any(|word| word == b"relative");
                self.times = if relative { Times::Deltas } else { Times::Absolute };
                Parsed::Nothing
            }
            b"date" | b"internal" | b"no" | b"Begin" | b"End" | b"begin" | b"end" | b"previous" => {
                Parsed::Nothing
            }
            [b'/', b'/', ..] | [b';', ..] => Parsed::Nothing,
            _ => Parsed::Damaged("no header that is known, and no time"),
        }
    }

    fn classic(&self, rest: &[u8], record: &mut Record) -> Option<Parsed> {
        let (id, rest) = word(rest)?;
        match id {
            b"ErrorFrame" => return error_frame(rest, record),
            b"OverloadFrame" => return Some(OVERLOAD),
            // What the tool counts anew each second; nothing that happened on the bus.
            b"Statistic:" => return Some(Parsed::Nothing),
            // A transfer put together by the tool; its frames have lines of their own.
            b"J1939TP" => return Some(OTHER),
            _ => {}
        }
        self.id(id, record)?;
        let (way, rest) = word(rest)?;
        record.direction = match way {
            b"TxRq" => return Some(Parsed::Damaged("a request to send, no frame of the bus")),
            way => Some(direction(way)?),
        };
        let (kind, rest) = word(rest)?;
        let length = word(rest);
        let code = match length {
            Some((&[digit], _)) if nibble(digit) <= 0x0F => Some(nibble(digit).min(8)),
            _ => None,
        };
        match kind {
            b"r" => {
                record.frame.kind = FrameKind::Remote;
                record.frame.len = code.unwrap_or(0);
                Some(Parsed::Frame)
            }
            b"d" => {
                record.frame.kind = FrameKind::Data;
                let (_, rest) = length?;
                self.data(rest, usize::from(code?), record)
            }
            _ => None,
        }
    }

    fn fd(&self, rest: &[u8], record: &mut Record, buses: &mut Buses) -> Option<Parsed> {
        let (channel, rest) = word(rest)?;
        decimal(channel)?;
        record.bus = buses.find(channel);
        let (way, rest) = word(rest)?;
        record.direction = Some(direction(way)?);
        let (id, rest) = word(rest)?;
        if id == b"ErrorFrame" {
            return error_frame(rest, record);
        }
        self.id(id, record)?;
        // A symbolic name may stand before the two flags.
        let (mut rate, mut rest) = word(rest)?;
        if !matches!(rate, b"0" | b"1") {
            (rate, rest) = word(rest)?;
        }
        let (passive, rest) = word(rest)?;
        let (_code, rest) = word(rest)?;
        let (len, rest) = word(rest)?;
        let len = usize::try_from(decimal(len)?).ok()?;
        record.frame.kind = FrameKind::Fd { bit_rate_switch: rate == b"1", error_passive: passive == b"1" };
        let parsed = self.data(rest, len, record)?;
        // Duration, bit count, flags: classic frames are written in this form, too.
        if let Some(flags) = words(rest).nth(len + 2).and_then(hex)
            && flags & FLAG_FD == 0
            && len <= 8
        {
            record.frame.kind = if flags & FLAG_REMOTE != 0 { FrameKind::Remote } else { FrameKind::Data };
        }
        Some(parsed)
    }

    fn id(&self, text: &[u8], record: &mut Record) -> Option<()> {
        let (text, extended) = match text {
            [id @ .., b'x' | b'X'] => (id, true),
            id => (id, false),
        };
        let id = self.number(text)?;
        record.frame.id = id;
        record.frame.extended = extended;
        (id <= if extended { 0x1FFF_FFFF } else { 0x7FF }).then_some(())
    }

    fn number(&self, text: &[u8]) -> Option<u32> {
        if self.decimal { decimal(text).and_then(|number| u32::try_from(number).ok()) } else { hex(text) }
    }

    fn data(&self, rest: &[u8], len: usize, record: &mut Record) -> Option<Parsed> {
        let mut bytes = words(rest);
        for room in record.frame.data.get_mut(..len)? {
            let byte = bytes.next().filter(|text| self.decimal || text.len() == 2);
            match byte.and_then(|byte| self.number(byte)).and_then(|byte| u8::try_from(byte).ok()) {
                Some(byte) => *room = byte,
                None => return Some(Parsed::Damaged("fewer bytes than the length says")),
            }
        }
        record.frame.len = len as u8;
        Some(Parsed::Frame)
    }
}

/// What follows `ErrorFrame`: nothing, `ECC: 10100010`, or what is not read.
fn error_frame(rest: &[u8], record: &mut Record) -> Option<Parsed> {
    let frame = &mut record.frame;
    frame.id = 0;
    frame.kind = FrameKind::Error;
    frame.len = 0;
    let mut words = words(rest);
    if words.next() == Some(b"ECC:") {
        let Some(code) = words.next().and_then(binary) else {
            return Some(Parsed::Damaged("8 binary digits expected behind ECC:"));
        };
        *frame.data.first_mut()? = code;
        frame.len = 1;
    }
    Some(Parsed::Frame)
}

/// A byte of 8 binary digits.
fn binary(text: &[u8]) -> Option<u8> {
    let digits: &[u8; 8] = text.try_into().ok()?;
    digits.iter().try_fold(0, |value, digit| matches!(digit, b'0' | b'1').then(|| value << 1 | digit & 1))
}

fn direction(text: &[u8]) -> Option<Direction> {
    match text {
        b"Rx" => Some(Direction::Rx),
        b"Tx" => Some(Direction::Tx),
        _ => None,
    }
}
