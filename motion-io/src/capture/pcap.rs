//! pcap and pcapng with link types 227 (SocketCAN, identifier big-endian) and 113 (Linux cooked,
//! identifier in the order of the recording machine, or big-endian from newer recorders).

use std::collections::VecDeque;
use std::io::{self, Read};

use super::CaptureError;
use super::input::Input;
use super::record::{Bus, Buses, Direction, FrameKind, Record, Time, UNFIT};

/// Link types (tcpdump.org, "Link-layer header types").
pub(super) const LINK_SOCKETCAN: u32 = 227;
const LINK_COOKED: u32 = 113;

const SECTION: u32 = 0x0A0D_0D0A;
const INTERFACE: u32 = 1;
/// Of old files; like an enhanced one, but that the number of the interface has 16 bits.
const PACKET: u32 = 2;
const SIMPLE_PACKET: u32 = 3;
const ENHANCED_PACKET: u32 = 6;
/// Byte order mark of a pcapng section.
const BYTE_ORDER: u32 = 0x1A2B_3C4D;
/// Flags of SocketCAN in an identifier.
const EXTENDED: u32 = 0x8000_0000;
const REMOTE: u32 = 0x4000_0000;
const ERROR: u32 = 0x2000_0000;
/// What of a packet is looked at: cooked header and the largest FD frame.
const MOST: usize = 96;
/// How many packets, and nanoseconds, a sent frame and its other copy may lie apart.
const PAIR_PACKETS: usize = 1024;
const PAIR_TIME: u64 = 1_000_000_000;

/// What a capture file gives next.
pub(super) enum Packet {
    Frame,
    Damaged { number: u64, reason: &'static str },
    End,
}

#[derive(Debug, Clone, Copy)]
struct Interface {
    link: u32,
    bus: Option<Bus>,
    /// Units of time a second; 0: so many that the time is not told.
    per_second: u64,
    offset: i64,
}

/// Type of a cooked packet (`sll_pkttype`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cooked {
    /// 1, 2 or 3: heard.
    Heard,
    /// 4: sent by the recording machine.
    Sent,
    Other,
}

#[derive(Debug, Clone, Copy)]
struct Held {
    number: u64,
    content: Result<Record, &'static str>,
    cooked: Cooked,
    paired: bool,
}

#[derive(Debug)]
enum Layout {
    Pcap { per_second: u64 },
    PcapNg { in_section: bool },
}

#[derive(Debug)]
pub(super) struct Pcap {
    layout: Layout,
    big_endian: bool,
    interfaces: Vec<Interface>,
    /// The order of identifiers of cooked packets, once one could only be read one way.
    big_endian_ids: Option<bool>,
    number: u64,
    /// Packets read, not given out: a sent one waits until it is known whether it is there twice.
    queue: VecDeque<Held>,
    /// Heard frames given out, of which the sent copy may follow.
    recent: VecDeque<Held>,
    ended: bool,
}

fn u16_at(bytes: &[u8], at: usize, big: bool) -> Option<u16> {
    let bytes = *bytes.get(at..)?.first_chunk::<2>()?;
    Some(if big { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
}

fn u32_at(bytes: &[u8], at: usize, big: bool) -> Option<u32> {
    let bytes = *bytes.get(at..)?.first_chunk::<4>()?;
    Some(if big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
}

/// Whether a file begins as pcap or pcapng do.
pub(super) fn is_pcap(start: &[u8]) -> bool {
    pcap_magic(start).is_some() || u32_at(start, 0, true) == Some(SECTION)
}

/// Byte order and units of time a second.
fn pcap_magic(start: &[u8]) -> Option<(bool, u64)> {
    match u32_at(start, 0, true)? {
        0xA1B2_C3D4 => Some((true, 1_000_000)),
        0xD4C3_B2A1 => Some((false, 1_000_000)),
        0xA1B2_3C4D => Some((true, 1_000_000_000)),
        0x4D3C_B2A1 => Some((false, 1_000_000_000)),
        _ => None,
    }
}

impl Pcap {
    pub(super) fn open<R: Read>(input: &mut Input<R>) -> Result<Self, CaptureError> {
        let start = input.peek(24)?;
        let mut interfaces = Vec::new();
        let (layout, big_endian) = match pcap_magic(start) {
            Some((big, per_second)) => {
                let link = u32_at(start, 20, big).unwrap_or(0) & 0xFFFF;
                if link != LINK_SOCKETCAN && link != LINK_COOKED {
                    return Err(CaptureError::LinkType(link));
                }
                interfaces.push(Interface { link, bus: None, per_second, offset: 0 });
                input.take(24);
                (Layout::Pcap { per_second }, big)
            }
            None => (Layout::PcapNg { in_section: false }, false),
        };
        Ok(Self {
            layout,
            big_endian,
            interfaces,
            big_endian_ids: None,
            number: 0,
            queue: VecDeque::new(),
            recent: VecDeque::new(),
            ended: false,
        })
    }

    pub(super) fn next<R: Read>(
        &mut self,
        input: &mut Input<R>,
        record: &mut Record,
        buses: &mut Buses,
    ) -> io::Result<Packet> {
        loop {
            let waits = match self.queue.front() {
                None => true,
                Some(front) => {
                    let recent = match self.queue.back() {
                        Some(back) => near(&front.content, &back.content),
                        None => true,
                    };
                    let open = front.cooked == Cooked::Sent && !front.paired;
                    open && recent && self.queue.len() <= PAIR_PACKETS
                }
            };
            if waits && !self.ended {
                match self.read(input, buses)? {
                    Some(held) => self.hold(held),
                    None => self.ended = true,
                }
                continue;
            }
            let Some(held) = self.queue.pop_front() else { return Ok(Packet::End) };
            if held.cooked == Cooked::Heard && !held.paired {
                if self.recent.len() == PAIR_PACKETS {
                    self.recent.pop_front();
                }
                self.recent.push_back(held);
            }
            return Ok(match held.content {
                Ok(content) => {
                    *record = content;
                    record.loopback = held.cooked == Cooked::Sent && held.paired;
                    Packet::Frame
                }
                Err(reason) => Packet::Damaged { number: held.number, reason },
            });
        }
    }

    /// Puts a packet behind the others and pairs it with its other copy.
    fn hold(&mut self, mut held: Held) {
        let other = match held.cooked {
            Cooked::Heard => Cooked::Sent,
            Cooked::Sent => Cooked::Heard,
            Cooked::Other => return self.queue.push_back(held),
        };
        let partner = self.recent.iter_mut().chain(&mut self.queue).find(|earlier| {
            earlier.cooked == other && !earlier.paired && same(&earlier.content, &held.content)
        });
        if let Some(partner) = partner {
            partner.paired = true;
            held.paired = true;
        }
        self.recent.retain(|heard| !heard.paired);
        self.queue.push_back(held);
    }

    /// The next packet of the file.
    fn read<R: Read>(&mut self, input: &mut Input<R>, buses: &mut Buses) -> io::Result<Option<Held>> {
        match self.layout {
            Layout::Pcap { per_second } => self.read_pcap(input, per_second),
            Layout::PcapNg { .. } => self.read_block(input, buses),
        }
    }

    fn damaged(&mut self, reason: &'static str) -> Held {
        self.number += 1;
        Held { number: self.number, content: Err(reason), cooked: Cooked::Other, paired: false }
    }

    /// Nothing can be read after this.
    fn broken<R: Read>(&mut self, input: &mut Input<R>, reason: &'static str) -> io::Result<Option<Held>> {
        while !input.chunk()?.is_empty() {}
        Ok(Some(self.damaged(reason)))
    }

    fn read_pcap<R: Read>(&mut self, input: &mut Input<R>, per_second: u64) -> io::Result<Option<Held>> {
        let big = self.big_endian;
        let header = input.peek(16)?;
        if header.is_empty() {
            return Ok(None);
        }
        let (Some(seconds), Some(fraction), Some(len)) =
            (u32_at(header, 0, big), u32_at(header, 4, big), u32_at(header, 8, big))
        else {
            return self.broken(input, "the file ends inside the header of a packet");
        };
        let nanos =
            i64::from(seconds) * 1_000_000_000 + i64::from(fraction) * (1_000_000_000 / per_second as i64);
        input.take(16);
        let mut held = self.packet(input, 0, Some(Time(nanos)), len)?;
        if !input.skip(u64::from(len))? {
            held.content = Err("the file ends inside a packet");
            held.cooked = Cooked::Other;
        }
        Ok(Some(held))
    }

    fn read_block<R: Read>(&mut self, input: &mut Input<R>, buses: &mut Buses) -> io::Result<Option<Held>> {
        loop {
            let head = input.peek(28)?;
            if head.is_empty() {
                return Ok(None);
            }
            if u32_at(head, 0, true) == Some(SECTION) {
                self.big_endian = match u32_at(head, 8, true) {
                    Some(BYTE_ORDER) => true,
                    Some(order) if order.swap_bytes() == BYTE_ORDER => false,
                    _ => return self.broken(input, "no byte order mark in the section header"),
                };
                self.layout = Layout::PcapNg { in_section: true };
                self.interfaces.clear();
            } else if !matches!(self.layout, Layout::PcapNg { in_section: true }) {
                return self.broken(input, "a block outside of a section");
            }
            let big = self.big_endian;
            let (Some(kind), Some(total)) = (u32_at(head, 0, big), u32_at(head, 4, big)) else {
                return self.broken(input, "the file ends inside the header of a block");
            };
            if total < 12 || total % 4 != 0 {
                return self.broken(input, "the length of a block is no multiple of 4, or below 12");
            }
            let mut held = None;
            let mut rest = u64::from(total);
            match kind {
                INTERFACE => {
                    let block = input.peek(total.min(64 * 1024) as usize)?;
                    let interface = interface(block, big, self.interfaces.len(), buses);
                    if interface.is_none() {
                        held = Some(self.damaged("an interface without a link type"));
                    }
                    self.interfaces.push(interface.unwrap_or(Interface::UNKNOWN));
                }
                ENHANCED_PACKET | PACKET if total >= 32 => {
                    let word = |at| u32_at(head, at, big).unwrap_or(0);
                    let which = match kind {
                        PACKET => usize::from(u16_at(head, 8, big).unwrap_or(0)),
                        _ => word(8) as usize,
                    };
                    let len = word(20).min(total - 32);
                    let units = u64::from(word(12)) << 32 | u64::from(word(16));
                    let time = self.interfaces.get(which).and_then(|interface| interface.time(units));
                    input.take(28);
                    rest -= 28;
                    held = Some(self.packet(input, which, time, len)?);
                }
                SIMPLE_PACKET if total >= 16 => {
                    let len = u32_at(head, 8, big).unwrap_or(0).min(total - 16);
                    input.take(12);
                    rest -= 12;
                    held = Some(self.packet(input, 0, None, len)?);
                }
                ENHANCED_PACKET | PACKET | SIMPLE_PACKET => {
                    held = Some(self.damaged("a packet block that is too short"));
                }
                _ => {}
            }
            if !input.skip(rest)? {
                let mut last = held.unwrap_or_else(|| self.damaged(""));
                last.content = Err("the file ends inside a block");
                last.cooked = Cooked::Other;
                held = Some(last);
            }
            if held.is_some() {
                return Ok(held);
            }
        }
    }

    /// The packet of `len` bytes that comes next; they are not taken.
    fn packet<R: Read>(
        &mut self,
        input: &mut Input<R>,
        interface: usize,
        time: Option<Time>,
        len: u32,
    ) -> io::Result<Held> {
        let Some(&Interface { link, bus, .. }) = self.interfaces.get(interface) else {
            return Ok(self.damaged("a packet of an interface that is not described"));
        };
        let mut record = Record { time, bus, ..Record::EMPTY };
        let bytes = input.peek((len as usize).min(MOST))?;
        let (cooked, content) = match link {
            LINK_SOCKETCAN => (Cooked::Other, socketcan(bytes, true, false, &mut record)),
            LINK_COOKED => match (u16_at(bytes, 0, true), u16_at(bytes, 14, true), bytes.get(16..)) {
                (Some(kind), Some(protocol @ (0x0C | 0x0D)), Some(frame)) => {
                    let big = self.cooked_order(frame);
                    record.direction = Some(if kind == 4 { Direction::Tx } else { Direction::Rx });
                    let cooked = match kind {
                        1..=3 => Cooked::Heard,
                        4 => Cooked::Sent,
                        _ => Cooked::Other,
                    };
                    (cooked, socketcan(frame, big, protocol == 0x0D, &mut record))
                }
                (Some(_), Some(0x0E), _) => (Cooked::Other, Err("a CAN XL frame, which is not read")),
                (Some(_), Some(_), _) => (Cooked::Other, Err("a cooked packet that is no CAN frame")),
                _ => (Cooked::Other, Err("a cooked packet that is too short")),
            },
            _ => (Cooked::Other, Err("a packet of a link that is no CAN bus")),
        };
        self.number += 1;
        let content = content.and_then(|()| if record.frame.settle() { Ok(record) } else { Err(UNFIT) });
        Ok(Held { number: self.number, content, cooked, paired: false })
    }

    /// Whether the identifier of a cooked frame is big-endian.
    fn cooked_order(&mut self, frame: &[u8]) -> bool {
        let plausible = |big| {
            u32_at(frame, 0, big)
                .is_some_and(|id| id & EXTENDED != 0 || id & ERROR != 0 || id & 0x1FFF_F800 == 0)
        };
        let standard = |big| u32_at(frame, 0, big).is_some_and(|id| id <= 0x7FF);
        match (plausible(true), plausible(false)) {
            (true, false) => *self.big_endian_ids.insert(true),
            (false, true) => *self.big_endian_ids.insert(false),
            // Until a frame has told: of 181h and its reverse, which has the flag of 29 bits, the former.
            _ => self.big_endian_ids.unwrap_or(match (standard(true), standard(false)) {
                (true, false) => true,
                (false, true) => false,
                _ => self.big_endian,
            }),
        }
    }
}

impl Interface {
    const UNKNOWN: Self = Self { link: u32::MAX, bus: None, per_second: 0, offset: 0 };

    fn time(&self, units: u64) -> Option<Time> {
        let nanos = (u128::from(units) * 1_000_000_000).checked_div(u128::from(self.per_second))?;
        Some(Time(i64::try_from(nanos).unwrap_or(i64::MAX).saturating_add(self.offset)))
    }
}

/// Whether two packets lie so near that they may be the two copies of one frame.
fn near(one: &Result<Record, &'static str>, other: &Result<Record, &'static str>) -> bool {
    let time = |content: &Result<Record, &'static str>| content.as_ref().ok().and_then(|record| record.time);
    match (time(one), time(other)) {
        (Some(one), Some(other)) => one.0.abs_diff(other.0) <= PAIR_TIME,
        _ => true,
    }
}

/// Whether two packets are the same frame on the same bus at nearly the same time.
fn same(one: &Result<Record, &'static str>, other: &Result<Record, &'static str>) -> bool {
    match (one, other) {
        (Ok(first), Ok(second)) => first.frame == second.frame && first.bus == second.bus && near(one, other),
        _ => false,
    }
}

/// An interface description block.
/// `number` names an interface behind the first one that has no name.
fn interface(block: &[u8], big: bool, number: usize, buses: &mut Buses) -> Option<Interface> {
    let link = u32::from(u16_at(block, 8, big)?);
    let mut interface = Interface { link, bus: None, per_second: 1_000_000, offset: 0 };
    let mut at = 16;
    while let (Some(code), Some(len)) = (u16_at(block, at, big), u16_at(block, at + 2, big)) {
        let Some(value) = block.get(at + 4..at + 4 + usize::from(len)) else { break };
        match (code, value) {
            (0, _) => break,
            (2, name) => {
                let end = name.iter().position(|&byte| byte == 0).unwrap_or(name.len());
                interface.bus = name.get(..end).and_then(|name| buses.find(name));
            }
            (9, &[resolution]) => {
                let power = u32::from(resolution & 0x7F);
                let base: u64 = if resolution & 0x80 == 0 { 10 } else { 2 };
                interface.per_second = base.checked_pow(power).unwrap_or(0);
            }
            (14, value) => {
                let Some(&seconds) = value.first_chunk::<8>() else { break };
                let seconds = if big { i64::from_be_bytes(seconds) } else { i64::from_le_bytes(seconds) };
                interface.offset = seconds.saturating_mul(1_000_000_000);
            }
            _ => {}
        }
        at += 4 + usize::from(len).next_multiple_of(4);
    }
    if interface.bus.is_none() && number > 0 {
        interface.bus = buses.find(format!("interface {number}").as_bytes());
    }
    Some(interface)
}

/// A `struct can_frame` or `canfd_frame`.
fn socketcan(bytes: &[u8], big: bool, fd: bool, record: &mut Record) -> Result<(), &'static str> {
    let (Some(id), Some(&len), Some(&flags)) = (u32_at(bytes, 0, big), bytes.get(4), bytes.get(5)) else {
        return Err("a CAN frame that is too short");
    };
    let frame = &mut record.frame;
    frame.extended = id & EXTENDED != 0;
    frame.id = id & if frame.extended || id & ERROR != 0 { 0x1FFF_FFFF } else { 0x7FF };
    // Flag 04h: an FD frame, where the recorder says so.
    let fd = fd || flags & 0x04 != 0 || len > 8;
    frame.kind = match () {
        () if id & ERROR != 0 => FrameKind::Error,
        () if fd => FrameKind::Fd { bit_rate_switch: flags & 1 != 0, error_passive: flags & 2 != 0 },
        () if id & REMOTE != 0 => FrameKind::Remote,
        () => FrameKind::Data,
    };
    frame.len = len;
    if frame.kind == FrameKind::Remote {
        return Ok(());
    }
    let data = bytes.get(8..).and_then(|data| data.get(..usize::from(len)));
    match (data, frame.data.get_mut(..usize::from(len))) {
        (Some(data), Some(room)) => {
            room.copy_from_slice(data);
            Ok(())
        }
        _ => Err("fewer bytes than the length says"),
    }
}
