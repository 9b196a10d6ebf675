//! The slcan protocol of serial CAN adapters (Lawicel CAN232 and CANUSB): host and adapter.
//!
//! Every command is a line that ends with CR. An adapter answers CR, or BEL if it refuses.

use core::fmt::Write as _;
use core::time::Duration;
use std::collections::VecDeque;
use std::io;
use std::time::Instant;

use embedded_can::{ExtendedId, Frame as _, Id, StandardId};
use pdo::Frame;

use super::{BusEvent, BusState, CanPort, Event};
use crate::endpoint::SLCAN_BIT_RATES;
use crate::port::Port;

const CR: u8 = b'\r';
const BEL: u8 = 7;
/// `T` with 8 digits of identifier, length, 8 bytes and a time stamp, and room to spare.
const LONGEST_LINE: usize = 64;

/// `t1232AABB`, `T…`, `r…`, `R…`, without CR.
fn encode(frame: &Frame, line: &mut String) {
    let _ = match (frame.id(), frame.is_remote()) {
        (Id::Standard(id), false) => write!(line, "t{:03X}{}", id.as_raw(), frame.len()),
        (Id::Extended(id), false) => write!(line, "T{:08X}{}", id.as_raw(), frame.len()),
        (Id::Standard(id), true) => write!(line, "r{:03X}{}", id.as_raw(), frame.len()),
        (Id::Extended(id), true) => write!(line, "R{:08X}{}", id.as_raw(), frame.len()),
    };
    for byte in frame.data() {
        let _ = write!(line, "{byte:02X}");
    }
}

/// A frame from its line; what follows the data (a time stamp) is not looked at.
fn parse(line: &[u8]) -> Option<Frame> {
    let (kind, rest) = line.split_first()?;
    let digits = match kind {
        b't' | b'r' => 3,
        b'T' | b'R' => 8,
        _ => return None,
    };
    let id = hex(rest.get(..digits)?)?;
    let id = match digits {
        3 => Id::Standard(StandardId::new(u16::try_from(id).ok()?)?),
        _ => Id::Extended(ExtendedId::new(id)?),
    };
    let len = usize::try_from(hex(rest.get(digits..=digits)?)?).ok().filter(|len| *len <= 8)?;
    if matches!(kind, b'r' | b'R') {
        return Frame::remote_frame(id, len);
    }
    let mut data = [0; 8];
    let digits = rest.get(digits + 1..digits + 1 + 2 * len)?;
    for (byte, pair) in data.iter_mut().zip(digits.chunks(2)) {
        *byte = u8::try_from(hex(pair)?).ok()?;
    }
    Frame::data_frame(id, data.get(..len)?)
}

fn hex(digits: &[u8]) -> Option<u32> {
    digits.iter().try_fold(0u32, |number, digit| Some(number << 4 | char::from(*digit).to_digit(16)?))
}

/// Cuts bytes into lines; BEL is a line of its own.
#[derive(Debug, Default)]
struct Lines {
    buffer: Vec<u8>,
    /// The line was too long: up to its end everything is dropped.
    overlong: bool,
}

impl Lines {
    fn push(&mut self, byte: u8) -> Option<Vec<u8>> {
        match byte {
            BEL => Some(vec![BEL]),
            CR if core::mem::take(&mut self.overlong) => {
                self.buffer.clear();
                Some(vec![b'?'])
            }
            CR => Some(core::mem::take(&mut self.buffer)),
            // Some hosts end lines with CR and LF.
            b'\n' => None,
            _ if self.buffer.len() < LONGEST_LINE => {
                self.buffer.push(byte);
                None
            }
            _ => {
                self.overlong = true;
                None
            }
        }
    }
}

/// The adapter's side, without I/O: commands in, answers and frames out.
#[derive(Debug, Default)]
struct Adapter {
    lines: Lines,
    channel: Channel,
    time_stamps: bool,
    /// Bits of the status that `F` reports and clears.
    status: u8,
}

#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
enum Channel {
    #[default]
    Closed,
    Open,
    ListenOnly,
}

/// `F`: the receive queue was full.
const STATUS_OVERRUN: u8 = 0x08;

impl Adapter {
    /// Takes the host's bytes; answers are appended to `answers`, frames to send to `frames`.
    fn handle_bytes(&mut self, bytes: &[u8], answers: &mut Vec<u8>, frames: &mut VecDeque<Frame>) {
        for &byte in bytes {
            if let Some(line) = self.lines.push(byte) {
                self.command(&line, answers, frames);
            }
        }
    }

    fn command(&mut self, line: &[u8], answers: &mut Vec<u8>, frames: &mut VecDeque<Frame>) {
        let closed = self.channel == Channel::Closed;
        let done = match line {
            // An empty line clears the adapter's buffer.
            [] => true,
            [b'S', b'0'..=b'8'] | [b's', _, _, _, _] => closed,
            [b'O'] if closed => {
                self.channel = Channel::Open;
                true
            }
            [b'L'] if closed => {
                self.channel = Channel::ListenOnly;
                true
            }
            [b'C'] if !closed => {
                self.channel = Channel::Closed;
                true
            }
            [b't' | b'T' | b'r' | b'R', ..] => match parse(line) {
                Some(frame) if self.channel == Channel::Open => {
                    answers.push(if frame.is_extended() { b'Z' } else { b'z' });
                    frames.push_back(frame);
                    true
                }
                _ => false,
            },
            [b'V'] => {
                answers.extend_from_slice(b"V1013");
                true
            }
            [b'v'] => {
                answers.extend_from_slice(b"vSIM1");
                true
            }
            [b'N'] => {
                answers.extend_from_slice(b"N0001");
                true
            }
            [b'F'] if !closed => {
                let status = core::mem::take(&mut self.status);
                answers.extend_from_slice(format!("F{status:02X}").as_bytes());
                true
            }
            [b'Z', setting @ (b'0' | b'1')] if closed => {
                self.time_stamps = *setting == b'1';
                true
            }
            // Acceptance filters pass everything; frames are always sent on, not polled for.
            [b'M' | b'm', rest @ ..] => closed && rest.len() == 8 && hex(rest).is_some(),
            [b'X' | b'W' | b'U' | b'Q', b'0'..=b'9'] | [b'P' | b'A'] => true,
            _ => false,
        };
        answers.push(if done { CR } else { BEL });
    }

    /// The line for a frame from the bus; `None` while the host has the channel closed.
    fn frame(&self, frame: &Frame, since_start: Duration) -> Option<String> {
        if self.channel == Channel::Closed {
            return None;
        }
        let mut line = String::with_capacity(LONGEST_LINE);
        encode(frame, &mut line);
        if self.time_stamps {
            let _ = write!(line, "{:04X}", since_start.as_millis() % 60_000);
        }
        line.push('\r');
        Some(line)
    }
}

/// We are the adapter: what we send, the host receives, and the other way round.
pub(super) struct AdapterPort {
    port: Box<dyn Port>,
    adapter: Adapter,
    start: Instant,
    frames: VecDeque<Frame>,
}

impl AdapterPort {
    pub(super) fn new(port: Box<dyn Port>) -> Self {
        Self { port, adapter: Adapter::default(), start: Instant::now(), frames: VecDeque::new() }
    }

    /// Takes what the host sends and answers it; the number of bytes that came.
    fn listen(&mut self, timeout: Duration) -> io::Result<usize> {
        let mut buffer = [0; 512];
        let len = self.port.receive(&mut buffer, timeout)?;
        let mut answers = Vec::new();
        self.adapter.handle_bytes(buffer.get(..len).unwrap_or(&[]), &mut answers, &mut self.frames);
        if !answers.is_empty() {
            self.tell(&answers)?;
        }
        Ok(len)
    }

    /// Sends to the host. One that does not read has left: it finds the channel closed when it comes back.
    fn tell(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self.port.send(bytes) {
            Err(error) if error.kind() == io::ErrorKind::TimedOut => {
                self.adapter.channel = Channel::Closed;
                self.adapter.status |= STATUS_OVERRUN;
                Ok(())
            }
            sent => sent,
        }
    }
}

impl CanPort for AdapterPort {
    fn send(&mut self, frame: &Frame) -> io::Result<()> {
        match self.adapter.frame(frame, self.start.elapsed()) {
            Some(line) => self.tell(line.as_bytes()),
            // A bus without listeners: the frame passes unheard.
            None => Ok(()),
        }
    }

    fn receive(&mut self, timeout: Duration) -> io::Result<Option<Event>> {
        let end = self.start.elapsed().saturating_add(timeout);
        loop {
            // Bytes without meaning may come without end.
            let left = end.saturating_sub(self.start.elapsed());
            if self.frames.is_empty() {
                self.listen(left)?;
            }
            if let Some(frame) = self.frames.pop_front() {
                return Ok(Some(Event::Frame(frame)));
            }
            if left.is_zero() {
                return Ok(None);
            }
        }
    }

    fn wait_for_peer(&mut self, timeout: Duration) -> io::Result<bool> {
        let end = self.start.elapsed().saturating_add(timeout);
        while self.adapter.channel == Channel::Closed && self.start.elapsed() < end {
            let left = end.saturating_sub(self.start.elapsed());
            self.listen(left)?;
        }
        Ok(self.adapter.channel != Channel::Closed)
    }
}

/// The host's side: an adapter on a serial line.
pub(super) struct Host {
    port: Box<dyn Port>,
    lines: Lines,
    start: Instant,
    events: VecDeque<Event>,
    /// Frames sent and not yet confirmed.
    unconfirmed: usize,
    /// Whether the adapter confirms frames at all.
    confirms: bool,
}

/// Frames that may be on their way to the adapter at once, for those that confirm them.
const WINDOW: usize = 16;
/// Longest wait for the answer to a command.
const ANSWER: Duration = Duration::from_millis(500);

impl Host {
    /// Resets the adapter, sets the bit rate and opens the channel.
    pub(super) fn new(port: Box<dyn Port>, bit_rate: u32) -> io::Result<Self> {
        let code = SLCAN_BIT_RATES.iter().position(|rate| *rate == bit_rate).unwrap_or(6);
        let mut host = Self {
            port,
            lines: Lines::default(),
            start: Instant::now(),
            events: VecDeque::new(),
            unconfirmed: 0,
            confirms: false,
        };
        // Empty lines end whatever a predecessor left half sent; `C` is refused where the channel is closed.
        host.port.send(b"\r\r\rC\r")?;
        // What still comes of the predecessor's; a line that is no adapter's may never be quiet.
        let end = host.start.elapsed() + ANSWER;
        while host.port.receive(&mut [0; 256], Duration::from_millis(50))? > 0 && host.start.elapsed() < end {
        }
        host.command(&format!("S{code}"))?;
        host.command("O")?;
        Ok(host)
    }

    fn command(&mut self, command: &str) -> io::Result<()> {
        self.port.send(format!("{command}\r").as_bytes())?;
        let end = self.start.elapsed() + ANSWER;
        while self.start.elapsed() < end {
            let mut byte = [0];
            if self.port.receive(&mut byte, end.saturating_sub(self.start.elapsed()))? == 0 {
                continue;
            }
            match self.lines.push(byte[0]).as_deref() {
                Some([]) => return Ok(()),
                Some([BEL]) => {
                    return Err(io::Error::other(format!("the adapter refuses the command {command:?}")));
                }
                _ => {}
            }
        }
        let text = format!("no answer to the command {command:?}: no slcan adapter?");
        Err(io::Error::new(io::ErrorKind::TimedOut, text))
    }

    fn line(&mut self, line: &[u8]) {
        let event = match line {
            [] | [b'z' | b'Z'] => {
                self.confirms = true;
                self.unconfirmed = self.unconfirmed.saturating_sub(1);
                return;
            }
            [BEL] => {
                self.unconfirmed = self.unconfirmed.saturating_sub(1);
                Event::Bus(BusEvent::NotSent)
            }
            // The kernel's extension: s, then b, w, p or f for bus-off and the states.
            [b's', state, ..] => match state {
                b'a' => Event::Bus(BusEvent::State(BusState::Active)),
                b'w' => Event::Bus(BusEvent::State(BusState::Warning)),
                b'p' => Event::Bus(BusEvent::State(BusState::Passive)),
                b'b' => Event::Bus(BusEvent::State(BusState::Off)),
                _ => return,
            },
            _ => match parse(line) {
                Some(frame) => Event::Frame(frame),
                None => return,
            },
        };
        self.events.push_back(event);
    }
}

impl CanPort for Host {
    fn send(&mut self, frame: &Frame) -> io::Result<()> {
        if self.confirms && self.unconfirmed >= WINDOW {
            return Err(io::Error::new(io::ErrorKind::WouldBlock, "the adapter's queue is full"));
        }
        let mut line = String::with_capacity(LONGEST_LINE);
        encode(frame, &mut line);
        line.push('\r');
        self.unconfirmed += 1;
        self.port.send(line.as_bytes())
    }

    fn receive(&mut self, timeout: Duration) -> io::Result<Option<Event>> {
        let end = self.start.elapsed().saturating_add(timeout);
        loop {
            if let Some(event) = self.events.pop_front() {
                return Ok(Some(event));
            }
            let mut buffer = [0; 512];
            let left = end.saturating_sub(self.start.elapsed());
            let len = self.port.receive(&mut buffer, left)?;
            for &byte in buffer.get(..len).unwrap_or(&[]) {
                if let Some(line) = self.lines.push(byte) {
                    self.line(&line);
                }
            }
            // Bytes without meaning may come without end.
            if left.is_zero() && self.events.is_empty() {
                return Ok(None);
            }
        }
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        let _ = self.port.send(b"C\r");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn talk(adapter: &mut Adapter, text: &str) -> (String, Vec<String>) {
        let (mut answers, mut frames) = (Vec::new(), VecDeque::new());
        adapter.handle_bytes(text.as_bytes(), &mut answers, &mut frames);
        let answers = String::from_utf8(answers).unwrap();
        (answers.replace('\r', "<").replace('\u{7}', "!"), frames.iter().map(ToString::to_string).collect())
    }

    #[test]
    fn frames_and_their_lines() {
        for (line, text) in [
            ("t1232AABB", "123#AABB"),
            ("t0000", "000#"),
            ("T1ABCDEF01FF", "1ABCDEF0#FF"),
            ("r7011", "701#R1"),
            ("R000000018", "00000001#R8"),
        ] {
            let frame = parse(line.as_bytes()).unwrap();
            assert_eq!(frame.to_string(), text);
            let mut back = String::new();
            encode(&frame, &mut back);
            assert_eq!(back, line);
        }
        // With a time stamp, and in lower case.
        assert_eq!(parse(b"t1231ab0102").unwrap().to_string(), "123#AB");
        for bad in ["t", "t12", "t8000", "t1239", "t1232AA", "tG232AABB", "T200000000", "x1230", "z"] {
            assert_eq!(parse(bad.as_bytes()), None, "{bad}");
        }
    }

    #[test]
    fn a_session_with_the_adapter() {
        let mut adapter = Adapter::default();
        assert_eq!(talk(&mut adapter, "\r\rC\r").0, "<<!");
        assert_eq!(talk(&mut adapter, "t1230\r"), ("!".into(), vec![]));
        assert_eq!(talk(&mut adapter, "S6\rO\rS6\rO\r").0, "<<!!");
        assert_eq!(talk(&mut adapter, "t1232AABB\rT00000001"), ("z<".into(), vec!["123#AABB".into()]));
        assert_eq!(talk(&mut adapter, "0\r"), ("Z<".into(), vec!["00000001#".into()]));
        assert_eq!(talk(&mut adapter, "V\rN\rF\rnonsense\r").0, "V1013<N0001<F00<!");
        let frame = Frame::standard(0x581, [0x4B]);
        assert_eq!(adapter.frame(&frame, Duration::ZERO).unwrap(), "t58114B\r");
        assert_eq!(talk(&mut adapter, "C\rZ1\rL\r").0, "<<<");
        assert_eq!(adapter.frame(&frame, Duration::from_millis(60_255)).unwrap(), "t58114B00FF\r");
        // Listen only: nothing is sent.
        assert_eq!(talk(&mut adapter, "t1230\r"), ("!".into(), vec![]));
        assert_eq!(talk(&mut adapter, "C\r").0, "<");
        assert_eq!(adapter.frame(&frame, Duration::ZERO), None);
        // A line without end is not kept, and refused when it does end.
        assert_eq!(talk(&mut adapter, &"t".repeat(10_000)), (String::new(), vec![]));
        assert!(adapter.lines.buffer.len() <= LONGEST_LINE);
        assert_eq!(talk(&mut adapter, "\rV\r").0, "!V1013<");
    }
}
