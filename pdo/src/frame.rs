//! One CAN frame as a small value (ISO 11898-1, classic CAN).

use core::fmt;

use embedded_can::{ExtendedId, Id, StandardId};

use crate::Payload;

/// A classic CAN data or remote frame: an 11-bit or 29-bit identifier and 0…8 bytes.
///
/// Engines hold frames in this form; at their boundary any [`embedded_can::Frame`] goes in
/// ([`from_can`](Self::from_can)) and out ([`to_can`](Self::to_can)).
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Frame {
    /// Identifier, [`EXTENDED`], [`REMOTE`], and the length from bit 32 on: one word, which moves as fast
    /// as the data.
    head: u64,
    data: [u8; 8],
}

const EXTENDED: u64 = 1 << 31;
const REMOTE: u64 = 1 << 30;
const LEN: u32 = 32;

impl Frame {
    /// A data frame; `None` for more than 8 bytes.
    #[must_use]
    #[inline]
    pub fn data_frame(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        let mut frame = Self::remote_frame(id, data.len())?;
        frame.data.get_mut(..data.len())?.copy_from_slice(data);
        frame.head &= !REMOTE;
        Some(frame)
    }

    /// A remote frame that asks for `len` bytes; `None` for more than 8.
    #[must_use]
    #[inline]
    pub fn remote_frame(id: impl Into<Id>, len: usize) -> Option<Self> {
        let id = match id.into() {
            Id::Standard(id) => u64::from(id.as_raw()),
            Id::Extended(id) => u64::from(id.as_raw()) | EXTENDED,
        };
        (len <= 8).then_some(Self { head: id | REMOTE | (len as u64) << LEN, data: [0; 8] })
    }

    /// A data frame with an 11-bit identifier, for the services of CANopen; bits of `id` above the
    /// 11th are cut off.
    #[must_use]
    #[inline]
    pub const fn standard<const N: usize>(id: u16, bytes: [u8; N]) -> Self {
        const { assert!(N <= 8, "a CAN frame carries up to 8 bytes") };
        let mut data = [0; 8];
        let (room, _) = data.split_at_mut(N);
        room.copy_from_slice(&bytes);
        Self { head: (id & 0x7FF) as u64 | (N as u64) << LEN, data }
    }

    /// A data frame with what a PDO carries.
    #[inline]
    pub(crate) fn of_payload(id: StandardId, payload: Payload) -> Self {
        Self { head: u64::from(id.as_raw()) | u64::from(payload.len()) << LEN, data: payload.bytes() }
    }

    /// The same content as another crate's frame.
    #[must_use]
    #[inline]
    pub fn from_can(frame: &impl embedded_can::Frame) -> Option<Self> {
        if frame.is_remote_frame() {
            Self::remote_frame(frame.id(), frame.dlc())
        } else {
            Self::data_frame(frame.id(), frame.data())
        }
    }

    /// The same content as a frame of another crate; `None` when that crate refuses it.
    #[must_use]
    #[inline]
    pub fn to_can<F: embedded_can::Frame>(&self) -> Option<F> {
        if self.is_remote() { F::new_remote(self.id(), self.len()) } else { F::new(self.id(), self.data()) }
    }

    const fn raw_id(&self) -> u32 {
        (self.head & (REMOTE - 1)) as u32
    }

    const fn has_extended_id(&self) -> bool {
        self.head & EXTENDED != 0
    }

    /// The identifier.
    #[must_use]
    #[inline]
    pub fn id(&self) -> Id {
        let standard = if self.has_extended_id() { None } else { StandardId::new(self.raw_id() as u16) };
        standard.map_or_else(
            || Id::Extended(ExtendedId::new(self.raw_id()).unwrap_or(ExtendedId::ZERO)),
            Id::Standard,
        )
    }

    /// The 11-bit identifier; `None` of an extended frame.
    #[must_use]
    #[inline]
    pub const fn standard_id(&self) -> Option<u16> {
        if self.has_extended_id() { None } else { Some(self.raw_id() as u16) }
    }

    /// Whether it is a remote frame (RTR).
    #[must_use]
    #[inline]
    pub const fn is_remote(&self) -> bool {
        self.head & REMOTE != 0
    }

    /// The data length code, 0…8 bytes; of a remote frame, how many bytes it asks for.
    #[must_use]
    #[inline]
    pub const fn len(&self) -> usize {
        (self.head >> LEN) as usize
    }

    /// Whether the data length code is 0.
    #[must_use]
    #[inline]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The data, 0…8 bytes; none of a remote frame.
    #[must_use]
    #[inline]
    pub fn data(&self) -> &[u8] {
        let len = if self.is_remote() { 0 } else { self.len() };
        if len >= 8 { &self.data } else { self.data.get(..len).unwrap_or(&[]) }
    }
}

impl embedded_can::Frame for Frame {
    #[inline]
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        Self::data_frame(id, data)
    }

    #[inline]
    fn new_remote(id: impl Into<Id>, dlc: usize) -> Option<Self> {
        Self::remote_frame(id, dlc)
    }

    #[inline]
    fn is_extended(&self) -> bool {
        self.has_extended_id()
    }

    #[inline]
    fn is_remote_frame(&self) -> bool {
        self.is_remote()
    }

    #[inline]
    fn id(&self) -> Id {
        self.id()
    }

    #[inline]
    fn dlc(&self) -> usize {
        self.len()
    }

    #[inline]
    fn data(&self) -> &[u8] {
        self.data()
    }
}

/// As in a candump log: `581#4B41600018028FAF`, `701#R1`.
impl fmt::Display for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.has_extended_id() {
            write!(f, "{:08X}#", self.raw_id())?;
        } else {
            write!(f, "{:03X}#", self.raw_id())?;
        }
        if self.is_remote() {
            return write!(f, "R{}", self.len());
        }
        self.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

impl fmt::Debug for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Frame({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn frames_keep_what_they_are_given() {
        let frame = Frame::standard(0x581, [0x4B, 0x41, 0x60]);
        assert_eq!(
            (frame.standard_id(), frame.data(), frame.is_remote()),
            (Some(0x581), &[0x4B, 0x41, 0x60][..], false)
        );
        assert_eq!(frame.to_string(), "581#4B4160");
        assert_eq!(Frame::from_can(&frame), Some(frame));
        assert_eq!(frame.to_can::<Frame>(), Some(frame));
        let guard = Frame::remote_frame(StandardId::new(0x701).unwrap(), 1).unwrap();
        assert_eq!((guard.to_string().as_str(), guard.data()), ("701#R1", &[][..]));
        assert_eq!(guard.to_can::<Frame>(), Some(guard));
        let extended = Frame::data_frame(ExtendedId::new(0x123).unwrap(), &[]).unwrap();
        assert_eq!((extended.to_string().as_str(), extended.standard_id()), ("00000123#", None));
        assert_ne!(extended.id(), Frame::standard(0x123, []).id());
    }

    #[test]
    fn nine_bytes_are_refused() {
        assert_eq!(Frame::data_frame(StandardId::ZERO, &[0; 9]), None);
        assert_eq!(Frame::remote_frame(StandardId::ZERO, 9), None);
    }
}
