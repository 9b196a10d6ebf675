//! Writing captures: candump log, Vector `.asc`, PEAK `.trc` 2.1, pcapng with link type 227.

use std::io::{self, Write};

use super::pcap::LINK_SOCKETCAN;
use super::record::{Direction, Frame, FrameKind, Record, Time};

/// A format that can be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WriteFormat {
    /// candump log, as `candump -l` writes it.
    Candump,
    /// Vector `.asc`, `base hex`, absolute times.
    Asc,
    /// PEAK `.trc` 2.1.
    Trc,
    /// pcapng, one interface a bus, link type 227, nanoseconds.
    PcapNg,
}

/// Writes records. Times are written as they are given, so a capture with epoch times keeps them;
/// a record without time is written at 0.
#[derive(Debug)]
pub struct Writer<W> {
    out: W,
    format: WriteFormat,
    buses: Vec<String>,
    number: u64,
    begun: bool,
}

impl<W: Write> Writer<W> {
    /// A writer; nothing is written before the first record or [`finish`](Self::finish).
    #[must_use]
    pub const fn new(out: W, format: WriteFormat) -> Self {
        Self { out, format, buses: Vec::new(), number: 0, begun: false }
    }

    /// Writes one record of the bus with this name.
    ///
    /// # Errors
    /// [`io::Error`] of the sink.
    pub fn write(&mut self, record: &Record, bus: Option<&str>) -> io::Result<()> {
        self.begin()?;
        let name = bus.unwrap_or("can0");
        let channel = match self.buses.iter().position(|known| known == name) {
            Some(at) => at,
            None => {
                if self.format == WriteFormat::PcapNg {
                    write_interface(&mut self.out, name)?;
                }
                self.buses.push(name.to_owned());
                self.buses.len() - 1
            }
        };
        self.number += 1;
        let time = record.time.unwrap_or(Time(0));
        match self.format {
            WriteFormat::Candump => write_candump(&mut self.out, time, name, &record.frame),
            WriteFormat::Asc => write_asc(&mut self.out, time, channel + 1, record),
            WriteFormat::Trc => write_trc(&mut self.out, self.number, time, channel + 1, record),
            WriteFormat::PcapNg => write_packet(&mut self.out, time, channel, &record.frame),
        }
    }

    /// Lets out what the sink holds back, so that it outlives a program that is killed.
    ///
    /// # Errors
    /// [`io::Error`] of the sink.
    pub fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }

    /// Writes what ends the file and gives back the sink.
    ///
    /// # Errors
    /// [`io::Error`] of the sink.
    pub fn finish(mut self) -> io::Result<W> {
        self.begin()?;
        if self.format == WriteFormat::Asc {
            writeln!(self.out, "End TriggerBlock")?;
        }
        self.out.flush()?;
        Ok(self.out)
    }

    fn begin(&mut self) -> io::Result<()> {
        if core::mem::replace(&mut self.begun, true) {
            return Ok(());
        }
        match self.format {
            WriteFormat::Candump => Ok(()),
            WriteFormat::Asc => self.out.write_all(
                b"date Thu Jan 1 00:00:00.000 1970\nbase hex  timestamps absolute\n\
                  no internal events logged\nBegin TriggerBlock\n   0.000000 Start of measurement\n",
            ),
            WriteFormat::Trc => {
                self.out.write_all(b";$FILEVERSION=2.1\n;$STARTTIME=25569.0\n;$COLUMNS=N,O,T,B,I,d,R,l,D\n")
            }
            WriteFormat::PcapNg => {
                let mut section = Vec::new();
                section.extend(0x1A2B_3C4D_u32.to_le_bytes());
                section.extend([1, 0, 0, 0]);
                section.extend(u64::MAX.to_le_bytes());
                write_block(&mut self.out, 0x0A0D_0D0A, &section)
            }
        }
    }
}

fn write_id(out: &mut impl Write, frame: &Frame) -> io::Result<()> {
    match frame.kind {
        FrameKind::Error => write!(out, "{:08X}", frame.id | 0x2000_0000),
        _ if frame.extended => write!(out, "{:08X}", frame.id),
        _ => write!(out, "{:03X}", frame.id),
    }
}

fn write_candump(out: &mut impl Write, time: Time, bus: &str, frame: &Frame) -> io::Result<()> {
    write!(out, "({time}) {bus} ")?;
    write_id(out, frame)?;
    match frame.kind {
        FrameKind::Remote if frame.is_empty() => out.write_all(b"#R")?,
        FrameKind::Remote => write!(out, "#R{}", frame.len())?,
        FrameKind::Fd { bit_rate_switch, error_passive } => {
            let flags = u8::from(bit_rate_switch) | u8::from(error_passive) << 1 | 0x04;
            write!(out, "##{flags:X}")?;
        }
        FrameKind::Data | FrameKind::Error => out.write_all(b"#")?,
    }
    frame.data().iter().try_for_each(|byte| write!(out, "{byte:02X}"))?;
    out.write_all(b"\n")
}

const fn way(record: &Record) -> &'static str {
    match record.direction {
        Some(Direction::Tx) => "Tx",
        _ => "Rx",
    }
}

/// The length code of a CAN FD length.
fn length_code(len: usize) -> usize {
    [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64]
        .iter()
        .position(|&known| known >= len)
        .unwrap_or(15)
}

fn write_asc(out: &mut impl Write, time: Time, channel: usize, record: &Record) -> io::Result<()> {
    let frame = &record.frame;
    let mark = if frame.extended { "x" } else { "" };
    let len = frame.len();
    match frame.kind {
        FrameKind::Error => {
            return match frame.data() {
                [code] => writeln!(out, "{time} {channel}  ErrorFrame  ECC: {code:08b}"),
                _ => writeln!(out, "{time} {channel}  ErrorFrame"),
            };
        }
        FrameKind::Remote => {
            return writeln!(out, "{time} {channel}  {:X}{mark}  {}   r {len:X}", frame.id, way(record));
        }
        FrameKind::Data => {
            write!(out, "{time} {channel}  {:X}{mark}  {}   d {len:X}", frame.id, way(record))?;
        }
        FrameKind::Fd { bit_rate_switch, error_passive } => write!(
            out,
            "{time} CANFD {channel} {} {:X}{mark} {} {} {:X} {len}",
            way(record),
            frame.id,
            u8::from(bit_rate_switch),
            u8::from(error_passive),
            length_code(len),
        )?,
    }
    frame.data().iter().try_for_each(|byte| write!(out, " {byte:02X}"))?;
    if let FrameKind::Fd { bit_rate_switch, error_passive } = frame.kind {
        let flags = 1 << 12 | u32::from(bit_rate_switch) << 13 | u32::from(error_passive) << 14;
        write!(out, " 0 0 {flags:X} 0 0 0 0 0")?;
    }
    out.write_all(b"\n")
}

fn write_trc(
    out: &mut impl Write,
    number: u64,
    time: Time,
    channel: usize,
    record: &Record,
) -> io::Result<()> {
    let frame = &record.frame;
    let kind = match frame.kind {
        FrameKind::Data => "DT",
        FrameKind::Remote => "RR",
        FrameKind::Error => "ER",
        FrameKind::Fd { bit_rate_switch: false, error_passive: false } => "FD",
        FrameKind::Fd { bit_rate_switch: true, error_passive: false } => "FB",
        FrameKind::Fd { bit_rate_switch: false, error_passive: true } => "FE",
        FrameKind::Fd { bit_rate_switch: true, error_passive: true } => "BI",
    };
    // Milliseconds with as many decimals as keep the nanosecond.
    let (sign, nanos) = (if time.0 < 0 { "-" } else { "" }, time.0.unsigned_abs());
    write!(out, "{number:7} {sign}{}.{:06} {kind} {channel} ", nanos / 1_000_000, nanos % 1_000_000)?;
    if frame.extended || frame.kind == FrameKind::Error {
        write!(out, "{:08X}", frame.id)?;
    } else {
        write!(out, "{:04X}", frame.id)?;
    }
    write!(out, " {} - {} ", way(record), frame.len())?;
    frame.data().iter().try_for_each(|byte| write!(out, " {byte:02X}"))?;
    out.write_all(b"\n")
}

fn write_block(out: &mut impl Write, kind: u32, body: &[u8]) -> io::Result<()> {
    let padding = body.len().next_multiple_of(4) - body.len();
    let total = u32::try_from(body.len() + padding + 12).unwrap_or(u32::MAX).to_le_bytes();
    out.write_all(&kind.to_le_bytes())?;
    out.write_all(&total)?;
    out.write_all(body)?;
    out.write_all([0; 4].get(..padding).unwrap_or(&[]))?;
    out.write_all(&total)
}

fn write_interface(out: &mut impl Write, name: &str) -> io::Result<()> {
    let name = name.as_bytes().get(..name.len().min(255)).unwrap_or(&[]);
    let mut body = Vec::new();
    body.extend((LINK_SOCKETCAN as u16).to_le_bytes());
    body.extend([0; 6]);
    body.extend(2_u16.to_le_bytes());
    body.extend((name.len() as u16).to_le_bytes());
    body.extend(name);
    body.resize(body.len().next_multiple_of(4), 0);
    // Times in units of 10^-9 s; end of options.
    body.extend([9, 0, 1, 0, 9, 0, 0, 0, 0, 0, 0, 0]);
    write_block(out, 1, &body)
}

fn write_packet(out: &mut impl Write, time: Time, interface: usize, frame: &Frame) -> io::Result<()> {
    let mut flags = 0;
    let mut id = frame.id;
    if frame.extended {
        id |= 0x8000_0000;
    }
    match frame.kind {
        FrameKind::Remote => id |= 0x4000_0000,
        FrameKind::Error => id |= 0x2000_0000,
        FrameKind::Fd { bit_rate_switch, error_passive } => {
            flags = 0x04 | u8::from(bit_rate_switch) | u8::from(error_passive) << 1;
        }
        FrameKind::Data => {}
    }
    let units = u64::try_from(time.0).unwrap_or(0);
    let mut packet = Vec::with_capacity(72);
    packet.extend(id.to_be_bytes());
    packet.extend([frame.len() as u8, flags, 0, 0]);
    packet.extend(frame.data());
    let len = (packet.len() as u32).to_le_bytes();
    let mut body = Vec::with_capacity(96);
    body.extend((interface as u32).to_le_bytes());
    body.extend(((units >> 32) as u32).to_le_bytes());
    body.extend((units as u32).to_le_bytes());
    body.extend(len);
    body.extend(len);
    body.extend(packet);
    write_block(out, 6, &body)
}
