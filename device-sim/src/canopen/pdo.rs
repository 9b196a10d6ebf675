//! PDOs of a virtual node, as its objects 1400h…1BFFh say (CiA 301, 7.2.2 and 7.5.2.35…38).

use core::time::Duration;

use canopen_master::data_type::DataType;
use canopen_master::sdo::AbortCode;
use pdo::cob::is_restricted;
use pdo::{Address, Frame};

use super::common::{MAPPED, PDOS};
use super::objects::Objects;

/// COB-ID bit 31: the PDO is off. Bit 29: extended identifier.
const OFF: i128 = 1 << 31;
const EXTENDED: i128 = 1 << 29;
/// Objects 0001h…0007h stand for unused bits of RPDOs.
const DUMMIES: core::ops::RangeInclusive<u16> = 1..=7;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Direction {
    Receive,
    Transmit,
}

impl Direction {
    const fn communication(self) -> u16 {
        match self {
            Self::Receive => 0x1400,
            Self::Transmit => 0x1800,
        }
    }

    const fn mapping(self) -> u16 {
        match self {
            Self::Receive => 0x1600,
            Self::Transmit => 0x1A00,
        }
    }
}

/// What a PDO has to remember.
#[derive(Debug, Clone, Default)]
struct Running {
    /// SYNCs since it was sent last.
    syncs: u32,
    /// Whether SYNC counting waits for the start value.
    started: bool,
    /// Not again before.
    inhibited: Duration,
    /// Event timer, or time-out of a reception.
    timer: Option<Duration>,
    /// What was sent last, to see changes.
    sent: Option<Vec<u8>>,
    /// Asked for by RTR, by the event timer or by a change.
    due: bool,
    /// Received, acts at the next SYNC.
    held: Option<Vec<u8>>,
    too_long_told: bool,
}

/// What became of a received PDO.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Received {
    Nothing,
    /// These objects were written.
    Written(Vec<Address>),
    TooShort {
        expected: u8,
        found: u8,
    },
    TooLong {
        expected: u8,
        found: u8,
        written: Vec<Address>,
    },
}

#[derive(Debug, Clone, Default)]
pub(super) struct Pdos {
    receive: [Running; PDOS as usize],
    transmit: [Running; PDOS as usize],
}

fn mapped(objects: &Objects, direction: Direction, number: u16) -> impl Iterator<Item = (Address, u32)> {
    let index = direction.mapping() + number;
    let count = objects.get(index, 0).clamp(0, i128::from(MAPPED)) as u8;
    (1..=count).map(move |sub| {
        let raw = objects.get(index, sub) as u32;
        (Address::new((raw >> 16) as u16, (raw >> 8) as u8), raw & 0xFF)
    })
}

fn identifier(objects: &Objects, direction: Direction, number: u16) -> Option<u16> {
    let cob = objects.get(direction.communication() + number, 1);
    (cob & (OFF | EXTENDED) == 0).then_some((cob & 0x7FF) as u16)
}

fn kind(objects: &Objects, direction: Direction, number: u16) -> u8 {
    objects.get(direction.communication() + number, 2) as u8
}

fn duration(objects: &Objects, direction: Direction, number: u16, sub: u8, unit: Duration) -> Duration {
    unit * objects.get(direction.communication() + number, sub).clamp(0, 0xFFFF) as u32
}

/// Packs the mapped objects, the first one in the lowest bits.
fn pack(objects: &Objects, number: u16) -> Vec<u8> {
    let (mut value, mut used) = (0u64, 0);
    for (at, bits) in mapped(objects, Direction::Transmit, number) {
        let raw = objects.entry(at).map_or(0, |entry| entry.get() as u64);
        let mask = u64::MAX >> (64 - bits.clamp(1, 64));
        value |= (raw & mask).checked_shl(used).unwrap_or(0);
        used += bits;
    }
    let len = used.div_ceil(8).min(8) as usize;
    value.to_le_bytes().iter().take(len).copied().collect()
}

fn unpack(objects: &mut Objects, number: u16, data: &[u8]) -> Vec<Address> {
    let value = data.iter().take(8).rev().fold(0u64, |value, byte| value << 8 | u64::from(*byte));
    let entries: Vec<_> = mapped(objects, Direction::Receive, number).collect();
    let (mut used, mut written) = (0, Vec::new());
    for (at, bits) in entries {
        let mask = u64::MAX >> (64 - bits.clamp(1, 64));
        let raw = value.checked_shr(used).unwrap_or(0) & mask;
        used += bits;
        if let Some(entry) = objects.entry_mut(at) {
            entry.set(i128::from(raw));
            written.push(at);
        }
    }
    written
}

fn len(objects: &Objects, direction: Direction, number: u16) -> u8 {
    mapped(objects, direction, number).map(|(_, bits)| bits).sum::<u32>().div_ceil(8).min(255) as u8
}

/// Whether a write to a communication or mapping object is allowed; `None` if it is none of them.
pub(super) fn check(objects: &Objects, at: Address, value: &[u8]) -> Option<Result<(), AbortCode>> {
    let (direction, number, is_mapping) = match at.index {
        0x1400..0x1600 => (Direction::Receive, at.index - 0x1400, false),
        0x1600..0x1800 => (Direction::Receive, at.index - 0x1600, true),
        0x1800..0x1A00 => (Direction::Transmit, at.index - 0x1800, false),
        0x1A00..0x1C00 => (Direction::Transmit, at.index - 0x1A00, true),
        _ => return None,
    };
    let new = value.iter().take(4).rev().fold(0u32, |new, byte| new << 8 | u32::from(*byte));
    let on = objects.get(direction.communication() + number, 1) & OFF == 0;
    Some(match (is_mapping, at.sub) {
        (false, 1) => check_identifier(objects, at, new, on),
        (false, 2) => match new {
            241..=251 => Err(AbortCode::INVALID_VALUE),
            252 | 253 if direction == Direction::Receive => Err(AbortCode::INVALID_VALUE),
            _ => Ok(()),
        },
        // Inhibit time and SYNC start value stand while the PDO is on (CiA 301, 7.5.2.37).
        (false, 3 | 6) if on => Err(AbortCode::UNSUPPORTED_ACCESS),
        (true, _) if on => Err(AbortCode::UNSUPPORTED_ACCESS),
        (true, 0) => check_count(objects, direction, number, new),
        (true, _) if objects.get(at.index, 0) != 0 => Err(AbortCode::UNSUPPORTED_ACCESS),
        (true, _) => check_entry(objects, direction, new),
        _ => Ok(()),
    })
}

fn check_identifier(objects: &Objects, at: Address, new: u32, on: bool) -> Result<(), AbortCode> {
    let same = (objects.get(at.index, at.sub) as u32 ^ new) & 0x1FFF_FFFF == 0;
    let off = i128::from(new) & OFF != 0;
    if on && !off && !same {
        return Err(AbortCode::INVALID_VALUE);
    }
    // Only 11-bit identifiers, and none that belongs to another service.
    let taken = u16::try_from(new & 0x1FFF_FFFF).map_or(true, is_restricted);
    if i128::from(new) & EXTENDED != 0 || (!off && taken) {
        return Err(AbortCode::INVALID_VALUE);
    }
    Ok(())
}

fn check_count(objects: &Objects, direction: Direction, number: u16, count: u32) -> Result<(), AbortCode> {
    if count > u32::from(MAPPED) {
        return Err(AbortCode::PDO_LENGTH);
    }
    let mut bits = 0;
    for sub in 1..=count as u8 {
        let raw = objects.get(direction.mapping() + number, sub) as u32;
        check_entry(objects, direction, raw)?;
        bits += raw & 0xFF;
    }
    if bits > 64 { Err(AbortCode::PDO_LENGTH) } else { Ok(()) }
}

fn check_entry(objects: &Objects, direction: Direction, raw: u32) -> Result<(), AbortCode> {
    let (at, bits) = (Address::new((raw >> 16) as u16, (raw >> 8) as u8), raw & 0xFF);
    if direction == Direction::Receive && DUMMIES.contains(&at.index) && at.sub == 0 {
        let size = if at.index == 1 { 1 } else { 8 * u32::from(DataType(at.index).size().unwrap_or(0)) };
        return if bits == size { Ok(()) } else { Err(AbortCode::PDO_LENGTH) };
    }
    let entry = objects.entry(at).ok_or_else(|| objects.missing(at))?;
    let allowed = match direction {
        Direction::Receive => entry.rights.receive,
        Direction::Transmit => entry.rights.transmit,
    };
    match entry.bits() {
        Some(size) if allowed && bits == size => Ok(()),
        Some(_) if allowed => Err(AbortCode::PDO_LENGTH),
        _ => Err(AbortCode::NOT_MAPPABLE),
    }
}

impl Pdos {
    /// Operational begins: counts and timers start, nothing has been sent yet.
    pub(super) fn start(&mut self, now: Duration, objects: &Objects) {
        *self = Self::default();
        for number in 0..PDOS {
            self.restart_timer(now, objects, number);
        }
    }

    fn restart_timer(&mut self, now: Duration, objects: &Objects, number: u16) {
        let period = duration(objects, Direction::Transmit, number, 5, Duration::from_millis(1));
        let timed = kind(objects, Direction::Transmit, number) >= 254 && !period.is_zero();
        if let Some(running) = self.transmit.get_mut(usize::from(number)) {
            running.timer = timed.then(|| now.saturating_add(period));
        }
    }

    /// A frame that may be a PDO; the RPDO's number, if it is one.
    pub(super) fn receive(
        &mut self,
        now: Duration,
        objects: &mut Objects,
        frame: &Frame,
    ) -> Vec<(u16, Received)> {
        let Some(id) = frame.standard_id() else { return Vec::new() };
        if frame.is_remote() {
            self.requested(objects, id);
            return Vec::new();
        }
        let mut all = Vec::new();
        for number in 0..PDOS {
            if identifier(objects, Direction::Receive, number) != Some(id) {
                continue;
            }
            let timeout = duration(objects, Direction::Receive, number, 5, Duration::from_millis(1));
            let synchronous = kind(objects, Direction::Receive, number) <= 240;
            let Some(running) = self.receive.get_mut(usize::from(number)) else { continue };
            let (expected, found) = (len(objects, Direction::Receive, number), frame.len() as u8);
            if found < expected {
                all.push((number, Received::TooShort { expected, found }));
                continue;
            }
            running.timer = (!timeout.is_zero()).then(|| now.saturating_add(timeout));
            let too_long =
                found > expected && !core::mem::replace(&mut running.too_long_told, found > expected);
            let written = if synchronous {
                running.held = Some(frame.data().to_vec());
                Vec::new()
            } else {
                unpack(objects, number, frame.data())
            };
            all.push((
                number,
                if too_long {
                    Received::TooLong { expected, found, written }
                } else if written.is_empty() {
                    Received::Nothing
                } else {
                    Received::Written(written)
                },
            ));
        }
        all
    }

    fn requested(&mut self, objects: &Objects, id: u16) {
        for number in 0..PDOS {
            let own = identifier(objects, Direction::Transmit, number) == Some(id);
            let allowed = objects.get(Direction::Transmit.communication() + number, 1) & 1 << 30 == 0;
            if own
                && allowed
                && let Some(running) = self.transmit.get_mut(usize::from(number))
            {
                running.due = true;
            }
        }
    }

    /// SYNC: what was received before acts now. Returns the objects written.
    pub(super) fn sync_receive(&mut self, objects: &mut Objects) -> Vec<Address> {
        let mut written = Vec::new();
        for (running, number) in self.receive.iter_mut().zip(0..) {
            if let Some(data) = running.held.take() {
                written.extend(unpack(objects, number, &data));
            }
        }
        written
    }

    /// SYNC: synchronous TPDOs whose turn it is become due.
    pub(super) fn sync_transmit(&mut self, objects: &Objects, counter: Option<u8>) {
        for (running, number) in self.transmit.iter_mut().zip(0..) {
            let start = objects.get(Direction::Transmit.communication() + number, 6);
            if let Some(counter) = counter.filter(|_| !running.started && start != 0)
                && i128::from(counter) != start
            {
                continue;
            }
            running.started = true;
            match kind(objects, Direction::Transmit, number) {
                // Acyclic: at the SYNC after a change.
                0 => running.due = running.sent.as_deref() != Some(pack(objects, number).as_slice()),
                every @ 1..=240 => {
                    running.syncs += 1;
                    if running.syncs >= u32::from(every) {
                        running.syncs = 0;
                        running.due = true;
                    }
                }
                _ => {}
            }
        }
    }

    /// Event-driven TPDOs whose objects have changed since they were sent, or that were never sent.
    pub(super) fn changed(&self, objects: &Objects) -> Vec<u16> {
        let changed = self.transmit.iter().zip(0..).filter(|(running, number)| {
            !running.due
                && kind(objects, Direction::Transmit, *number) >= 254
                && identifier(objects, Direction::Transmit, *number).is_some()
                && running.sent.as_deref() != Some(pack(objects, *number).as_slice())
        });
        changed.map(|(_, number)| number).collect()
    }

    /// A TPDO is to be sent.
    pub(super) fn trigger(&mut self, number: u16) {
        if let Some(running) = self.transmit.get_mut(usize::from(number)) {
            running.due = true;
        }
    }

    /// The next TPDO.
    pub(super) fn transmit(&mut self, now: Duration, objects: &Objects) -> Option<Frame> {
        for number in 0..PDOS {
            let Some(running) = self.transmit.get_mut(usize::from(number)) else { continue };
            if running.timer.is_some_and(|at| at <= now) {
                running.due = true;
            }
            let Some(id) = identifier(objects, Direction::Transmit, number).filter(|_| running.due) else {
                continue;
            };
            let event_driven = kind(objects, Direction::Transmit, number) >= 254;
            if event_driven && now < running.inhibited {
                continue;
            }
            running.due = false;
            let inhibit = duration(objects, Direction::Transmit, number, 3, Duration::from_micros(100));
            running.inhibited = now.saturating_add(inhibit);
            let data = pack(objects, number);
            running.sent = Some(data.clone());
            self.restart_timer(now, objects, number);
            if data.is_empty() {
                continue;
            }
            return Frame::data_frame(embedded_can::StandardId::new(id)?, &data);
        }
        None
    }

    /// RPDOs that stayed away for too long.
    pub(super) fn timed_out(&mut self, now: Duration) -> usize {
        let late = self.receive.iter_mut().filter_map(|running| running.timer.take_if(|at| *at <= now));
        late.count()
    }

    /// When something is due by time.
    pub(super) fn poll_timeout(&self, objects: &Objects) -> Option<Duration> {
        let transmit = self.transmit.iter().zip(0..).filter_map(|(running, number)| {
            identifier(objects, Direction::Transmit, number)?;
            let waiting = running.due.then_some(running.inhibited);
            [waiting, running.timer].into_iter().flatten().min()
        });
        transmit.chain(self.receive.iter().filter_map(|running| running.timer)).min()
    }
}
