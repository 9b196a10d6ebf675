//! Emergencies (CiA 301, 7.2.7): message, names of the error classes, producer with inhibit time and
//! error history, consumer with history.

use core::fmt;
use core::time::Duration;

use pdo::{Frame, NodeId, cob};

use crate::clock::{after, is_due};

/// An emergency error code. Others may add codes, so any value is one.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct ErrorCode(pub u16);

macro_rules! codes {
    ($($(#[$doc:meta])* $name:ident = $value:literal, $mask:literal, $text:literal;)*) => {
        impl ErrorCode {
            $($(#[$doc])* pub const $name: Self = Self($value);)*

            /// What CiA 301 (table 26) calls the code, or the narrowest class it belongs to.
            #[must_use]
            pub const fn name(self) -> &'static str {
                $(if self.0 & $mask == $value { return $text; })*
                "reserved"
            }
        }
    };
}

// Narrow before wide: the first line that matches names the code.
codes! {
    /// 0000h: the error is gone, or none is left.
    NO_ERROR = 0x0000, 0xFF00, "error reset or no error";
    /// 10xxh.
    GENERIC = 0x1000, 0xFF00, "generic error";
    /// 21xxh.
    CURRENT_INPUT = 0x2100, 0xFF00, "current, input side";
    /// 22xxh.
    CURRENT_INSIDE = 0x2200, 0xFF00, "current inside the device";
    /// 23xxh.
    CURRENT_OUTPUT = 0x2300, 0xFF00, "current, output side";
    /// 2xxxh.
    CURRENT = 0x2000, 0xF000, "current";
    /// 31xxh.
    VOLTAGE_MAINS = 0x3100, 0xFF00, "mains voltage";
    /// 32xxh.
    VOLTAGE_INSIDE = 0x3200, 0xFF00, "voltage inside the device";
    /// 33xxh.
    VOLTAGE_OUTPUT = 0x3300, 0xFF00, "output voltage";
    /// 3xxxh.
    VOLTAGE = 0x3000, 0xF000, "voltage";
    /// 41xxh.
    TEMPERATURE_AMBIENT = 0x4100, 0xFF00, "ambient temperature";
    /// 42xxh.
    TEMPERATURE_DEVICE = 0x4200, 0xFF00, "device temperature";
    /// 4xxxh.
    TEMPERATURE = 0x4000, 0xF000, "temperature";
    /// 5xxxh.
    HARDWARE = 0x5000, 0xF000, "device hardware";
    /// 61xxh.
    SOFTWARE_INTERNAL = 0x6100, 0xFF00, "internal software";
    /// 62xxh.
    SOFTWARE_USER = 0x6200, 0xFF00, "user software";
    /// 63xxh.
    SOFTWARE_DATA = 0x6300, 0xFF00, "data set";
    /// 6xxxh.
    SOFTWARE = 0x6000, 0xF000, "device software";
    /// 70xxh.
    MODULES = 0x7000, 0xF000, "additional modules";
    /// 8110h.
    CAN_OVERRUN = 0x8110, 0xFFFF, "CAN overrun, objects lost";
    /// 8120h.
    CAN_PASSIVE = 0x8120, 0xFFFF, "CAN in error passive mode";
    /// 8130h.
    LIFE_GUARD = 0x8130, 0xFFFF, "life guard or heartbeat error";
    /// 8140h.
    BUS_OFF_RECOVERED = 0x8140, 0xFFFF, "recovered from bus off";
    /// 8150h.
    ID_COLLISION = 0x8150, 0xFFFF, "CAN-ID collision";
    /// 81xxh.
    COMMUNICATION = 0x8100, 0xFF00, "communication";
    /// 8210h.
    PDO_LENGTH = 0x8210, 0xFFFF, "PDO not processed due to length error";
    /// 8220h.
    PDO_TOO_LONG = 0x8220, 0xFFFF, "PDO length exceeded";
    /// 8230h.
    DAM_MPDO = 0x8230, 0xFFFF, "DAM MPDO not processed, destination object not available";
    /// 8240h.
    SYNC_LENGTH = 0x8240, 0xFFFF, "unexpected SYNC data length";
    /// 8250h.
    RPDO_TIMEOUT = 0x8250, 0xFFFF, "RPDO time-out";
    /// 82xxh.
    PROTOCOL = 0x8200, 0xFF00, "protocol error";
    /// 80xxh, and what else is in 8xxxh.
    MONITORING = 0x8000, 0xF000, "monitoring";
    /// 90xxh.
    EXTERNAL = 0x9000, 0xFF00, "external error";
    /// F0xxh.
    ADDITIONAL = 0xF000, 0xFF00, "additional functions";
    /// FFxxh.
    DEVICE_SPECIFIC = 0xFF00, 0xFF00, "device specific";
}

impl ErrorCode {
    /// The bit of the error register (1001h) that an error of this class sets (CiA 301, 7.5.2.2);
    /// bit 0, generic error, is set with any of them.
    #[must_use]
    pub const fn register_bit(self) -> u8 {
        match self.0 >> 12 {
            0x0 => 0x00,
            0x2 => 0x03,
            0x3 => 0x05,
            0x4 => 0x09,
            0x8 => 0x11,
            0xF => 0x81,
            _ => 0x01,
        }
    }
}

impl fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h ({})", self.0, self.name())
    }
}

impl fmt::Debug for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ErrorCode({:04X}h)", self.0)
    }
}

/// One emergency message: code, error register (1001h), 5 bytes of the manufacturer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Emergency {
    /// The error code.
    pub code: ErrorCode,
    /// Object 1001h at that time.
    pub register: u8,
    /// Manufacturer specific.
    pub data: [u8; 5],
}

impl Emergency {
    /// The message of a node.
    #[must_use]
    pub const fn frame(&self, node: NodeId) -> Frame {
        let [low, high] = self.code.0.to_le_bytes();
        let [a, b, c, d, e] = self.data;
        Frame::standard(cob::EMCY + node.raw() as u16, [low, high, self.register, a, b, c, d, e])
    }

    /// From a message's data. A message shorter than 8 bytes, which CiA 301 does not know but
    /// devices send, has zeros in place of what is missing; `None` where even the code is missing.
    #[must_use]
    pub fn parse(data: &[u8]) -> Option<Self> {
        let mut bytes = [0; 8];
        let room = bytes.get_mut(..data.len()).filter(|room| room.len() >= 2)?;
        room.copy_from_slice(data);
        let [low, high, register, a, b, c, d, e] = bytes;
        Some(Self { code: ErrorCode(u16::from_le_bytes([low, high])), register, data: [a, b, c, d, e] })
    }

    /// Whether it says that no error is left.
    #[must_use]
    pub const fn is_reset(&self) -> bool {
        self.code.0 == 0
    }
}

/// An emergency, who sent it and when.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entry {
    /// When it came.
    pub at: Duration,
    /// Who sent it.
    pub node: NodeId,
    /// What it says.
    pub emergency: Emergency,
}

/// The consumer's history: the last `N` emergencies of all nodes.
#[derive(Debug, Clone)]
pub struct History<const N: usize> {
    entries: [Option<Entry>; N],
    next: usize,
    total: u32,
}

impl<const N: usize> Default for History<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> History<N> {
    /// An empty history.
    #[must_use]
    pub const fn new() -> Self {
        Self { entries: [None; N], next: 0, total: 0 }
    }

    /// Enters one; the oldest makes room.
    pub fn push(&mut self, entry: Entry) {
        if let Some(slot) = self.entries.get_mut(self.next) {
            *slot = Some(entry);
        }
        self.next = if self.next + 1 >= N { 0 } else { self.next + 1 };
        self.total = self.total.saturating_add(1);
    }

    /// How many came in all.
    #[must_use]
    pub const fn total(&self) -> u32 {
        self.total
    }

    /// From the latest to the oldest held.
    pub fn iter(&self) -> impl Iterator<Item = &Entry> {
        let (newer, older) = self.entries.split_at_checked(self.next).unwrap_or((&self.entries, &[]));
        newer.iter().rev().chain(older.iter().rev()).flatten()
    }

    /// The last one of a node, if still held.
    #[must_use]
    pub fn last_of(&self, node: NodeId) -> Option<&Entry> {
        self.iter().find(|entry| entry.node == node)
    }

    /// Forgets all entries.
    pub fn clear(&mut self) {
        self.entries = [None; N];
        self.next = 0;
    }
}

/// The producer has as many emergencies waiting for the inhibit time as it can hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{0} emergencies are waiting for the inhibit time already")]
pub struct ProducerFull(pub usize);

/// Sends emergencies, never closer than the inhibit time (1015h), and keeps the error history
/// (1003h).
#[derive(Debug, Clone)]
pub struct Producer<const N: usize> {
    waiting: [Emergency; N],
    len: usize,
    /// The last N codes with their additional information, latest first.
    history: [u32; N],
    known: usize,
    inhibit: Duration,
    allowed: Duration,
}

impl<const N: usize> Producer<N> {
    /// A producer with the inhibit time in units of 100 µs, 0…65,535.
    #[must_use]
    pub fn new(inhibit: u16) -> Self {
        Self {
            waiting: [Emergency::default(); N],
            len: 0,
            history: [0; N],
            known: 0,
            inhibit: Duration::from_micros(100 * u64::from(inhibit)),
            allowed: Duration::ZERO,
        }
    }

    /// Changes the inhibit time, units of 100 µs.
    pub fn set_inhibit(&mut self, inhibit: u16) {
        self.inhibit = Duration::from_micros(100 * u64::from(inhibit));
    }

    /// Enters an emergency into the history and queues it.
    ///
    /// # Errors
    /// [`ProducerFull`] where `N` are waiting; the history has it all the same.
    pub fn push(&mut self, emergency: Emergency) -> Result<(), ProducerFull> {
        if !emergency.is_reset() {
            let [a, b, ..] = emergency.data;
            let entry = u32::from(emergency.code.0) | u32::from(u16::from_le_bytes([a, b])) << 16;
            self.history.rotate_right(1);
            if let Some(first) = self.history.first_mut() {
                *first = entry;
            }
            self.known = (self.known + 1).min(N);
        }
        let slot = self.waiting.get_mut(self.len).ok_or(ProducerFull(N))?;
        *slot = emergency;
        self.len += 1;
        Ok(())
    }

    /// The error history as 1003h shows it, latest first: code in the low 16 bits, the first two
    /// manufacturer bytes above.
    #[must_use]
    pub fn history(&self) -> &[u32] {
        self.history.get(..self.known).unwrap_or(&[])
    }

    /// Forgets the history (a write of 0 to 1003h:00).
    pub const fn clear_history(&mut self) {
        self.known = 0;
    }

    /// Forgets the history and what waits; the inhibit time goes on.
    pub const fn clear(&mut self) {
        self.clear_history();
        self.len = 0;
    }

    /// The emergency that may be sent now.
    pub fn poll_transmit(&mut self, now: Duration) -> Option<Emergency> {
        if !is_due(self.poll_timeout(), now) {
            return None;
        }
        let first = *self.waiting.first()?;
        self.waiting.rotate_left(1);
        self.len -= 1;
        self.allowed = after(now, self.inhibit);
        Some(first)
    }

    /// When the next may be sent; `None` if none waits.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Duration> {
        (self.len > 0).then_some(self.allowed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;
    use std::vec::Vec;

    const NODE: NodeId = NodeId::MIN;

    fn emergency(code: u16) -> Emergency {
        Emergency { code: ErrorCode(code), register: 1, data: [1, 0, 0, 0, 0] }
    }

    #[test]
    fn golden_message() {
        // A drive's trace: code 4310h, register 08h, category 1.
        let frame = Frame::standard(0x081, [0x10, 0x43, 0x08, 0x01, 0, 0, 0, 0]);
        let parsed = Emergency::parse(frame.data()).unwrap();
        assert_eq!(parsed, Emergency { code: ErrorCode(0x4310), register: 8, data: [1, 0, 0, 0, 0] });
        assert_eq!(parsed.frame(NODE), frame);
        assert_eq!(Emergency::parse(&[0x10, 0x43]).unwrap().code, ErrorCode(0x4310));
        assert_eq!(Emergency::parse(&[0x10]), None);
        assert_eq!(Emergency::parse(&[0; 9]), None);
    }

    #[test]
    fn names() {
        for (code, name) in [
            (0x0000, "error reset or no error"),
            (0x1000, "generic error"),
            (0x2310, "current, output side"),
            (0x2F00, "current"),
            (0x4310, "temperature"),
            (0x8130, "life guard or heartbeat error"),
            (0x8131, "communication"),
            (0x8210, "PDO not processed due to length error"),
            (0x8611, "monitoring"),
            (0xFF01, "device specific"),
            (0xA000, "reserved"),
        ] {
            assert_eq!(ErrorCode(code).name(), name, "{code:04X}");
        }
        assert_eq!(ErrorCode::LIFE_GUARD.to_string(), "8130h (life guard or heartbeat error)");
        assert_eq!(ErrorCode::LIFE_GUARD.register_bit(), 0x11);
    }

    #[test]
    fn the_inhibit_time_holds_emergencies_back() {
        let us = Duration::from_micros;
        let mut producer = Producer::<2>::new(50);
        producer.push(emergency(0x1000)).unwrap();
        producer.push(emergency(0x2000)).unwrap();
        assert_eq!(producer.push(emergency(0x3000)), Err(ProducerFull(2)));
        assert_eq!(producer.history(), [0x0001_3000, 0x0001_2000], "the history has it");
        assert_eq!(producer.poll_transmit(us(0)), Some(emergency(0x1000)));
        assert_eq!(producer.poll_transmit(us(4999)), None);
        assert_eq!(producer.poll_timeout(), Some(us(5000)));
        assert_eq!(producer.poll_transmit(us(5000)), Some(emergency(0x2000)));
        assert_eq!((producer.poll_transmit(us(99_000)), producer.poll_timeout()), (None, None));
    }

    #[test]
    fn the_history_keeps_the_latest() {
        let mut history = History::<3>::new();
        for code in 1..=5 {
            let at = Duration::from_millis(code);
            history.push(Entry { at, node: NODE, emergency: emergency(code as u16) });
        }
        let codes: Vec<_> = history.iter().map(|entry| entry.emergency.code.0).collect();
        assert_eq!((codes, history.total()), (Vec::from([5, 4, 3]), 5));
        assert_eq!(history.last_of(NODE).unwrap().emergency.code.0, 5);
        assert_eq!(history.last_of(NodeId::MAX), None);
        history.clear();
        assert_eq!(history.iter().count(), 0);
    }
}
