//! What one line or packet of a capture says.

use core::fmt;

use embedded_can::{ExtendedId, Id, StandardId};

/// Longest data of a CAN FD frame in bytes.
pub(super) const MAX_DATA: usize = 64;

/// A time as the capture gives it, in nanoseconds: since 1970, since the start, or since the line
/// before, whatever the tool recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Time(pub i64);

/// What the times of a capture are since.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum Times {
    /// 1970, or the start of the recording: they do not decrease.
    #[default]
    Absolute,
    /// The frame before.
    Deltas,
}

impl Time {
    /// A time from here on is one since 1970: no recording lasts three years.
    pub const EPOCH: Self = Self(100_000_000 * 1_000_000_000);

    /// The time for engines, which know no time before zero.
    #[must_use]
    pub fn since_zero(self) -> core::time::Duration {
        core::time::Duration::from_nanos(u64::try_from(self.0).unwrap_or(0))
    }

    /// The time of an engine; the latest that there is for one beyond it.
    #[must_use]
    pub fn from_zero(time: core::time::Duration) -> Self {
        Self(i64::try_from(time.as_nanos()).unwrap_or(i64::MAX))
    }

    /// Without the part of a microsecond.
    #[must_use]
    pub const fn whole_micros(self) -> Self {
        Self(self.0 / 1000 * 1000)
    }
}

/// Seconds with six decimals, nine where six would lose something.
impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.0 < 0 { "-" } else { "" };
        let (seconds, nanos) = (self.0.unsigned_abs() / 1_000_000_000, self.0.unsigned_abs() % 1_000_000_000);
        if nanos.is_multiple_of(1000) {
            write!(f, "{sign}{seconds}.{:06}", nanos / 1000)
        } else {
            write!(f, "{sign}{seconds}.{nanos:09}")
        }
    }
}

/// One bus of the capture; [`Reader::bus_name`](super::Reader::bus_name) knows how the capture calls it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Bus(pub u16);

/// Which way a frame went, seen from the recording tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Direction {
    /// Received.
    Rx,
    /// Sent.
    Tx,
}

/// What kind of frame it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum FrameKind {
    /// Classic data frame.
    Data,
    /// Classic remote frame.
    Remote,
    /// Report of the controller or of the driver, as the capture has it. SocketCAN: the error class as
    /// identifier, 8 bytes (`linux/can/error.h`). PEAK 1.x: the type of error as identifier, then
    /// direction, position and both error counters; 2.x: all 5 as data. Vector: the ECC register of the
    /// SJA1000 as the one byte, or nothing.
    Error,
    /// CAN FD data frame, 0…64 bytes.
    Fd {
        /// Bit rate switched.
        bit_rate_switch: bool,
        /// Transmitter is error passive.
        error_passive: bool,
    },
}

/// One word, of an FD frame with those of its bits that are set, as ISO 11898-1 calls them: `FD BRS ESI`.
impl fmt::Display for FrameKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Data => "Data",
            Self::Remote => "Remote",
            Self::Error => "Error",
            Self::Fd { bit_rate_switch: false, error_passive: false } => "FD",
            Self::Fd { bit_rate_switch: true, error_passive: false } => "FD BRS",
            Self::Fd { bit_rate_switch: false, error_passive: true } => "FD ESI",
            Self::Fd { bit_rate_switch: true, error_passive: true } => "FD BRS ESI",
        })
    }
}

/// A frame of a capture: classic, FD, or an error report.
#[derive(Clone, Copy)]
pub struct Frame {
    /// 11 or 29 bits; of an error report what [`FrameKind::Error`] says.
    pub id: u32,
    /// 29-bit identifier; never of an error report.
    pub extended: bool,
    /// Kind.
    pub kind: FrameKind,
    pub(super) len: u8,
    pub(super) data: [u8; MAX_DATA],
}

/// What a reader says of a frame that is not one of those that [`Frame::new`] makes.
pub(super) const UNFIT: &str = "more bytes than such a frame has, or too large an identifier";

impl Frame {
    pub(super) const EMPTY: Self =
        Self { id: 0, extended: false, kind: FrameKind::Data, len: 0, data: [0; MAX_DATA] };

    /// A frame; `None` for more data than its kind carries, or an identifier that does not fit.
    #[must_use]
    pub fn new(id: u32, extended: bool, kind: FrameKind, data: &[u8]) -> Option<Self> {
        let mut frame = Self { id, extended, kind, ..Self::EMPTY };
        frame.data.get_mut(..data.len())?.copy_from_slice(data);
        frame.len = u8::try_from(data.len()).ok()?;
        frame.settle().then_some(frame)
    }

    /// Takes the width of the identifier from an error report; whether the length and the identifier are
    /// those that such a frame may have.
    #[inline]
    pub(super) fn settle(&mut self) -> bool {
        self.extended &= self.kind != FrameKind::Error;
        let most = if matches!(self.kind, FrameKind::Fd { .. }) { MAX_DATA } else { 8 };
        let ids = if self.extended || self.kind == FrameKind::Error { 0x1FFF_FFFF } else { 0x7FF };
        usize::from(self.len) <= most && self.id <= ids
    }

    /// Length in bytes: of the data, or of what a remote frame asks for.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.len as usize
    }

    /// Whether the length is 0.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The data; none of a remote frame.
    #[must_use]
    #[inline]
    pub fn data(&self) -> &[u8] {
        if self.kind == FrameKind::Remote {
            return &[];
        }
        self.data.get(..self.len()).unwrap_or(&[])
    }

    /// The first 8 bytes of the data, whatever its length; what lies behind the data has no meaning.
    #[must_use]
    #[inline]
    pub fn first_8(&self) -> [u8; 8] {
        self.data.first_chunk().copied().unwrap_or_default()
    }

    /// The frame itself, as engines take it; `None` of FD frames and error reports.
    #[must_use]
    #[inline]
    pub const fn classic(&self) -> Option<&Self> {
        match self.kind {
            FrameKind::Data | FrameKind::Remote => Some(self),
            FrameKind::Error | FrameKind::Fd { .. } => None,
        }
    }
}

/// Data frames of more than 8 bytes come out as FD frames.
impl embedded_can::Frame for Frame {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        let (id, extended) = raw(id.into());
        let fd = FrameKind::Fd { bit_rate_switch: false, error_passive: false };
        Self::new(id, extended, if data.len() > 8 { fd } else { FrameKind::Data }, data)
    }

    fn new_remote(id: impl Into<Id>, dlc: usize) -> Option<Self> {
        let (id, extended) = raw(id.into());
        Self::new(id, extended, FrameKind::Remote, [0; 8].get(..dlc)?)
    }

    fn is_extended(&self) -> bool {
        self.extended
    }

    fn is_remote_frame(&self) -> bool {
        self.kind == FrameKind::Remote
    }

    #[inline]
    fn id(&self) -> Id {
        let standard = if self.extended { None } else { StandardId::new(self.id as u16) };
        match standard {
            Some(id) => Id::Standard(id),
            None => Id::Extended(ExtendedId::new(self.id).unwrap_or(ExtendedId::ZERO)),
        }
    }

    fn dlc(&self) -> usize {
        self.len()
    }

    #[inline]
    fn data(&self) -> &[u8] {
        self.data()
    }
}

fn raw(id: Id) -> (u32, bool) {
    match id {
        Id::Standard(id) => (u32::from(id.as_raw()), false),
        Id::Extended(id) => (id.as_raw(), true),
    }
}

impl PartialEq for Frame {
    fn eq(&self, other: &Self) -> bool {
        (self.id, self.extended, self.kind, self.len) == (other.id, other.extended, other.kind, other.len)
            && self.data() == other.data()
    }
}

impl Eq for Frame {}

impl fmt::Debug for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = if self.extended { 8 } else { 3 };
        write!(f, "{:0width$X} {} [{}]", self.id, self.kind, self.len)?;
        self.data().iter().try_for_each(|byte| write!(f, " {byte:02X}"))
    }
}

/// One frame of a capture and what the capture says about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Record {
    /// When; `None` where the capture gives no times.
    pub time: Option<Time>,
    /// Where; `None` where the capture names no bus.
    pub bus: Option<Bus>,
    /// Received or sent, where the capture tells.
    pub direction: Option<Direction>,
    /// The recorded copy of a frame that the capture holds twice (link type 113).
    pub loopback: bool,
    /// What.
    pub frame: Frame,
}

impl Record {
    pub(super) const EMPTY: Self =
        Self { time: None, bus: None, direction: None, loopback: false, frame: Frame::EMPTY };

    /// A received frame without time and bus.
    #[must_use]
    pub const fn new(frame: Frame) -> Self {
        Self { frame, ..Self::EMPTY }
    }
}

/// Where in the capture something stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Line number, from 1.
    Line(u64),
    /// Number of the packet in a pcap file, from 1.
    Packet(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(number) => write!(f, "line {number}"),
            Self::Packet(number) => write!(f, "packet {number}"),
        }
    }
}

/// A line or packet that gave no frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// Where.
    pub place: Place,
    /// Why.
    pub reason: &'static str,
    /// The line, shortened; empty of a packet.
    pub text: String,
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.reason)?;
        if self.text.is_empty() { Ok(()) } else { write!(f, ": {:?}", self.text) }
    }
}

/// The buses of a capture by name, in order of appearance.
#[derive(Debug, Default)]
pub(super) struct Buses {
    names: Vec<String>,
    last: usize,
}

impl Buses {
    /// The bus with this name; `None` past 65,536 buses.
    #[inline]
    pub(super) fn find(&mut self, name: &[u8]) -> Option<Bus> {
        if self.names.get(self.last).is_none_or(|last| last.as_bytes() != name) {
            self.last = match self.names.iter().position(|known| known.as_bytes() == name) {
                Some(at) => at,
                None if self.names.len() > usize::from(u16::MAX) => return None,
                None => {
                    self.names.push(String::from_utf8_lossy(name).into_owned());
                    self.names.len() - 1
                }
            };
        }
        u16::try_from(self.last).ok().map(Bus)
    }

    pub(super) fn name(&self, bus: Bus) -> Option<&str> {
        self.names.get(usize::from(bus.0)).map(String::as_str)
    }
}
