//! Frames of any CAN capture, one after the other.

use std::io::Read;

use super::asc::Asc;
use super::candump::Candump;
use super::columns::Columns;
use super::input::{Input, Line};
use super::pcap::{Packet, Pcap};
use super::record::{Bus, Buses, Damage, Place, Record, Times, UNFIT};
use super::trc::Trc;
use super::{CaptureError, Format};

/// What a line gave.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Parsed {
    /// The record is filled.
    Frame,
    /// A header, a comment, an empty line.
    Nothing,
    /// No frame, and why.
    Damaged(&'static str),
}

/// What a capture gives next.
#[derive(Debug)]
pub enum Item<'a> {
    /// A frame.
    Frame(&'a Record),
    /// A line or packet that gave none.
    Damage(Damage),
}

/// A format that is read line by line.
#[derive(Debug)]
pub(super) enum TextParser {
    Candump(Candump),
    Asc(Asc),
    Trc(Trc),
    Columns(Columns),
}

/// Whether a carriage return stands inside a line, where it would end another.
pub(super) fn has_inner_cr(line: &[u8]) -> bool {
    memchr::memchr(b'\r', line.trim_ascii_end()).is_some()
}

pub(super) const INNER_CR: Parsed =
    Parsed::Damaged("one line expected, several came that a carriage return alone ends");

impl TextParser {
    pub(super) fn new(format: Format) -> Option<Self> {
        Some(match format {
            Format::Candump => Self::Candump(Candump::default()),
            Format::Asc => Self::Asc(Asc::default()),
            Format::Trc => Self::Trc(Trc::default()),
            Format::Ixxat => Self::Columns(Columns::default()),
            _ => return None,
        })
    }

    #[inline]
    pub(super) fn line(&mut self, line: &[u8], record: &mut Record, buses: &mut Buses) -> Parsed {
        let parsed = match self {
            Self::Candump(parser) => parser.line(line, record, buses),
            _ if has_inner_cr(line) => INNER_CR,
            Self::Asc(parser) => parser.line(line, record, buses),
            Self::Trc(parser) => parser.line(line, record, buses),
            Self::Columns(parser) => parser.line(line, record, buses),
        };
        match parsed {
            Parsed::Frame if !record.frame.settle() => Parsed::Damaged(UNFIT),
            parsed => parsed,
        }
    }
}

#[derive(Debug)]
enum Parser {
    Text(TextParser),
    Pcap(Box<Pcap>),
}

/// Reads the frames of a capture as a stream.
///
/// Every line or packet that is no header, comment or blank gives one [`Item`].
#[derive(Debug)]
pub struct Reader<R> {
    input: Input<R>,
    format: Format,
    parser: Parser,
    record: Record,
    buses: Buses,
    line: u64,
    times: Option<Times>,
}

impl<R: Read> Reader<R> {
    pub(super) fn new(mut input: Input<R>, format: Format) -> Result<Self, CaptureError> {
        let parser = match TextParser::new(format) {
            Some(parser) => Parser::Text(parser),
            None => Parser::Pcap(Box::new(Pcap::open(&mut input)?)),
        };
        Ok(Self {
            input,
            format,
            parser,
            record: Record::EMPTY,
            buses: Buses::default(),
            line: 0,
            times: None,
        })
    }

    /// The format that is read.
    #[must_use]
    pub const fn format(&self) -> Format {
        self.format
    }

    /// What the times are since, as far as the capture has told by now: a header may say so.
    #[must_use]
    pub const fn times(&self) -> Times {
        match (self.times, &self.parser) {
            (Some(times), _) => times,
            (None, Parser::Text(TextParser::Asc(parser))) => parser.times(),
            (None, Parser::Text(TextParser::Columns(parser))) => parser.times(),
            (None, _) => Times::Absolute,
        }
    }

    /// Says what the times are since.
    pub const fn set_times(&mut self, times: Times) {
        self.times = Some(times);
    }

    /// How the capture calls a bus of one of its records.
    #[must_use]
    pub fn bus_name(&self, bus: Bus) -> Option<&str> {
        self.buses.name(bus)
    }

    /// Whether all that was read has been given: [`next`](Self::next) waits for the source.
    #[must_use]
    #[inline]
    pub fn is_drained(&self) -> bool {
        self.input.at_hand().is_empty()
    }

    /// The frame that [`next`](Self::next) gave last.
    #[must_use]
    #[inline]
    pub const fn record(&self) -> &Record {
        &self.record
    }

    /// The next frame or damage; `None` at the end.
    ///
    /// # Errors
    /// [`CaptureError`] if reading fails.
    #[inline]
    #[allow(clippy::should_implement_trait, reason = "lends the record")]
    pub fn next(&mut self) -> Result<Option<Item<'_>>, CaptureError> {
        loop {
            let (parsed, place) = match &mut self.parser {
                Parser::Text(parser) => {
                    if let TextParser::Candump(parser) = parser
                        && let Some(len) = parser.log_line(self.input.at_hand(), &mut self.record)
                    {
                        self.input.take(len);
                        self.line += 1;
                        break;
                    }
                    let Some(line) = self.input.line()? else { return Ok(None) };
                    self.line += 1;
                    match line {
                        Line::Whole(range) => {
                            let line = self.input.held(range);
                            match parser.line(line, &mut self.record, &mut self.buses) {
                                Parsed::Frame => break,
                                Parsed::Nothing => continue,
                                Parsed::Damaged(reason) => {
                                    let damage =
                                        Damage { place: Place::Line(self.line), reason, text: excerpt(line) };
                                    return Ok(Some(Item::Damage(damage)));
                                }
                            }
                        }
                        Line::TooLong => {
                            (Parsed::Damaged("a line of more than 65,536 bytes"), Place::Line(self.line))
                        }
                    }
                }
                Parser::Pcap(pcap) => match pcap.next(&mut self.input, &mut self.record, &mut self.buses)? {
                    Packet::End => return Ok(None),
                    Packet::Frame => break,
                    Packet::Damaged { number, reason } => (Parsed::Damaged(reason), Place::Packet(number)),
                },
            };
            if let Parsed::Damaged(reason) = parsed {
                return Ok(Some(Item::Damage(Damage { place, reason, text: String::new() })));
            }
        }
        Ok(Some(Item::Frame(&self.record)))
    }
}

/// The start of a line, for people.
pub(super) fn excerpt(line: &[u8]) -> String {
    const MOST: usize = 80;
    let line = line.trim_ascii();
    let mut text = String::from_utf8_lossy(line.get(..MOST).unwrap_or(line)).into_owned();
    if line.len() > MOST {
        text.push('…');
    }
    text
}
