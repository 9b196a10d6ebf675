//! Scan: who is on the bus. The engine is [`Master::scan`](crate::master::Master::scan); here is what
//! it finds, and manual A's table of it (4.3.4.4).

use core::fmt;
use core::time::Duration;

use pdo::{Address, NodeId};

use crate::lss::Identity;
use crate::sdo::{AbortCode, Buffer};

/// Time that a node has for each answer (decision 15).
pub const ANSWER: Duration = Duration::from_millis(50);

/// Device type (1000h).
pub(crate) const DEVICE_TYPE: Address = Address::new(0x1000, 0);
/// Device name (1008h).
pub(crate) const DEVICE_NAME: Address = Address::new(0x1008, 0);
/// Identity (1018h), sub-index 1 and on.
pub(crate) const IDENTITY: u16 = 0x1018;
/// OPMODE of an LD 2000 (35B4h:01).
pub(crate) const OPMODE: Address = Address::new(0x35B4, 1);

/// Low 12 bits of the device type of a servo amplifier: DSP402. Newer drives set other bits of the
/// low word too.
pub const DRIVE: u16 = 0x192;

/// What to ask each node for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Time for each answer.
    pub answer: Duration,
    /// Also read the identity, 1018h; nodes that have none leave it empty.
    pub identity: bool,
    /// Also read OPMODE of drives (profile 0192h), 35B4h:01.
    pub opmode: bool,
}

/// As manual A's scan.
impl Default for Options {
    fn default() -> Self {
        Self { answer: ANSWER, identity: false, opmode: true }
    }
}

/// Bytes of a device name that are kept.
pub const NAME: usize = 24;

/// A device name (1008h); what is longer than [`NAME`] bytes is cut.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Name {
    bytes: [u8; NAME],
    len: u8,
    cut: bool,
}

impl Name {
    /// The bytes as the device gave them.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.len)).unwrap_or(&[])
    }

    /// Whether the device gave more than is kept.
    #[must_use]
    pub const fn is_cut(&self) -> bool {
        self.cut
    }

    /// As text up to the first byte that is no ASCII, or a zero.
    #[must_use]
    pub fn text(&self) -> &str {
        let bytes = self.bytes();
        let end = bytes.iter().position(|byte| !matches!(byte, 0x20..=0x7E)).unwrap_or(bytes.len());
        bytes.get(..end).and_then(|text| core::str::from_utf8(text).ok()).unwrap_or("")
    }
}

impl fmt::Debug for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.text(), f)
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.text())
    }
}

/// What has been read of one node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Info {
    /// 1000h; `None` where the node answered but would not say.
    pub device_type: Option<u32>,
    /// 1008h; empty where the node has none.
    pub name: Name,
    /// 1018h, if it was asked for and is there: with as many numbers as the node has, the rest 0.
    pub identity: Option<Identity>,
    /// 35B4h:01 of a drive.
    pub opmode: Option<u8>,
}

impl Info {
    /// The profile: the low word of the device type.
    #[must_use]
    pub fn profile(&self) -> Option<u16> {
        self.device_type.map(|device_type| device_type as u16)
    }

    /// Whether it is a drive by its profile.
    #[must_use]
    pub fn is_drive(&self) -> bool {
        self.profile().is_some_and(|profile| profile & 0x0FFF == DRIVE)
    }
}

/// Keeps the beginning of an upload of any length: numbers and names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Head {
    bytes: [u8; NAME],
    len: u8,
    cut: bool,
}

impl Head {
    pub(crate) fn new(bytes: &[u8]) -> Self {
        let mut head = Self::default();
        let _ = head.write(0, bytes);
        head
    }

    pub(crate) const fn name(&self) -> Name {
        Name { bytes: self.bytes, len: self.len, cut: self.cut }
    }

    /// As a little-endian number; bytes that the device did not send are 0.
    pub(crate) fn number(&self) -> u32 {
        self.bytes.first_chunk().copied().map_or(0, u32::from_le_bytes)
    }
}

impl Buffer for Head {
    fn begin(&mut self, _: Option<u32>) -> Result<(), AbortCode> {
        *self = Self::default();
        Ok(())
    }

    fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), AbortCode> {
        let room = self.bytes.get_mut(offset as usize..).unwrap_or(&mut []);
        for (to, from) in room.iter_mut().zip(data) {
            *to = *from;
        }
        let len = (offset as usize).saturating_add(data.len());
        self.len = len.min(NAME) as u8;
        self.cut = len > NAME;
        Ok(())
    }

    fn size(&self) -> Option<u32> {
        Some(u32::from(self.len))
    }

    fn read(&mut self, offset: u32, out: &mut [u8]) -> Result<usize, AbortCode> {
        let rest = self.bytes.get(..usize::from(self.len)).and_then(|all| all.get(offset as usize..));
        let rest = rest.unwrap_or(&[]);
        for (to, from) in out.iter_mut().zip(rest) {
            *to = *from;
        }
        Ok(rest.len().min(out.len()))
    }
}

/// The bus state of manual A.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BusState {
    /// Every node that should be there answered.
    Ok,
    /// A node that should be there did not.
    Warn,
}

impl fmt::Display for BusState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Ok => "OK",
            Self::Warn => "BUS WARN",
        })
    }
}

/// A line of manual A's table.
///
/// `Nd01  1   1   0192h   SD03  00h  dI:T  dO:T`
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Row {
    /// The node.
    pub node: NodeId,
    /// Number of its Object/PDO IN, 1…4.
    pub input: Option<u8>,
    /// Number of its Object/PDO OUT, 1…4.
    pub output: Option<u8>,
    /// What the scan has read; `None` where nobody answered.
    pub info: Option<Info>,
    /// dI: new input data came since this was asked last.
    pub new_input: bool,
    /// dO: new output data were written since this was asked last.
    pub new_output: bool,
}

/// Heading of [`Row`]'s columns.
pub const HEADING: &str = "node  In  Out  Profile  Name  OP   dI    dO";

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let flag = |on| if on { 'T' } else { 'F' };
        write!(f, "Nd{:02}", self.node.raw())?;
        for object in [self.input, self.output] {
            match object {
                Some(number) => write!(f, "  {number:<2}")?,
                None => f.write_str("  - ")?,
            }
        }
        match self.info.and_then(|info| info.profile()) {
            Some(profile) => write!(f, "   {profile:04X}h  ")?,
            None => f.write_str("   -      ")?,
        }
        write!(f, "  {:<4}", self.info.map(|info| info.name).unwrap_or_default())?;
        match self.info.and_then(|info| info.opmode) {
            Some(opmode) => write!(f, "  {opmode:02X}h")?,
            None => f.write_str("     ")?,
        }
        write!(f, "  dI:{}  dO:{}", flag(self.new_input), flag(self.new_output))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    /// The table of manual A, 4.3.4.4.
    #[test]
    fn rows() {
        let name = Head::new(b"SD03").name();
        let info = Info { device_type: Some(0x0002_0192), name, opmode: Some(0), ..Info::default() };
        let row = Row {
            node: NodeId::MIN,
            input: Some(1),
            output: Some(1),
            info: Some(info),
            new_input: true,
            new_output: true,
        };
        assert_eq!(row.to_string(), "Nd01  1   1    0192h    SD03  00h  dI:T  dO:T");
        let silent = Row { info: None, output: None, new_input: false, new_output: false, ..row };
        assert_eq!(silent.to_string(), "Nd01  1   -    -                   dI:F  dO:F");
        assert_eq!((BusState::Ok.to_string(), BusState::Warn.to_string()), ("OK".into(), "BUS WARN".into()));
    }

    #[test]
    fn names_are_cut_not_refused() {
        let mut head = Head::default();
        head.begin(Some(30)).unwrap();
        for (index, piece) in b"a device with a very long name".chunks(7).enumerate() {
            head.write(7 * index as u32, piece).unwrap();
        }
        assert_eq!(head.name().text(), "a device with a very lon");
        assert_eq!(Head::new(b"SD03\0\xFF").name().text(), "SD03");
        assert_eq!(Head::new(&[0x92, 0x01]).number(), 0x0192);
        assert!(Info { device_type: Some(0x2192), ..Info::default() }.is_drive());
    }
}
