//! One device on a CAN Link bus.

use core::time::Duration;

use embedded_can::{Frame, Id, StandardId};

use crate::channel::{CHANNELS, Channel, Role, Setting, SettingError, Trigger};
use crate::payload::Payload;

/// Whether a frame was this engine's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Handled {
    /// It belongs to one of the channels that this device sends or receives.
    Handled,
    /// It concerns others.
    Ignored,
}

/// What [`Link::poll_event`] tells. Several of one kind on one channel are told once; the channel's
/// counters hold their number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event {
    /// A new value, to be taken with [`Link::read`].
    Received(Channel),
    /// Another device sends on a channel that belongs to this one.
    Conflict(Channel),
    /// A frame did not have the channel's length and was not taken.
    WrongLength(Channel),
}

/// The value of a channel that this device receives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Received {
    data: [u8; 8],
    len: u8,
    /// It has not been read before.
    pub new: bool,
    /// Time since it came, exact to the millisecond, up to 49 days.
    pub age: Duration,
}

impl Received {
    /// The bytes, 0…8.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&[])
    }
}

/// Why a value was not taken for sending.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SubmitError {
    /// This device does not send on the channel.
    #[error("channel {channel} is not one that this device transmits on")]
    NotTransmitting {
        /// The channel.
        channel: Channel,
    },
    /// The channel has another length, or the value has more than 8 bytes.
    #[error("channel {channel}: {found} bytes, {expected} expected")]
    Len {
        /// The channel.
        channel: Channel,
        /// Its length; of one that allows any, 8.
        expected: u8,
        /// Bytes given.
        found: usize,
    },
    /// Nothing was written to the channel yet.
    #[error("channel {channel} has no value yet")]
    Empty {
        /// The channel.
        channel: Channel,
    },
}

#[derive(Debug, Clone, Copy)]
struct Slot {
    data: [u8; 8],
    /// Milliseconds at which the value came, or was sent last.
    stamp: u32,
    id: u16,
    /// Milliseconds between two frames of a periodic channel.
    period: u16,
    distance: u16,
    /// Receiving: values that were overwritten unread. Transmitting: frames of others.
    faults: u16,
    wrong_lengths: u16,
    len: u8,
    /// [`ANY_LEN`] or the only length allowed.
    wanted: u8,
    kind: Kind,
    /// A value has been written or has come.
    filled: bool,
    /// Received and not read, or to be sent.
    fresh: bool,
    /// Was sent at least once: `stamp` counts.
    sent: bool,
}

const ANY_LEN: u8 = 0xFF;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Off,
    Receive,
    Change,
    Request,
    Period,
}

impl Kind {
    const fn transmits(self) -> bool {
        matches!(self, Self::Change | Self::Request | Self::Period)
    }
}

impl Slot {
    const fn new(channel: u8) -> Self {
        Self {
            data: [0; 8],
            stamp: 0,
            id: crate::channel::BASE_ID + channel as u16,
            period: 0,
            distance: 0,
            faults: 0,
            wrong_lengths: 0,
            len: 0,
            wanted: ANY_LEN,
            kind: Kind::Off,
            filled: false,
            fresh: false,
            sent: false,
        }
    }

    fn fits(&self, len: usize) -> bool {
        len <= 8 && (self.wanted == ANY_LEN || len == usize::from(self.wanted))
    }

    fn store(&mut self, data: &[u8]) {
        self.data = [0; 8];
        self.data.iter_mut().zip(data).for_each(|(to, byte)| *to = *byte);
        self.len = data.len().min(8) as u8;
        self.filled = true;
    }

    fn value(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&[])
    }

    /// Milliseconds from `now` until it is to be sent; `None`: not at all.
    fn wait(&self, now: u32) -> Option<u32> {
        let after = match (self.kind, self.fresh) {
            (Kind::Period, false) if self.sent => self.period.max(self.distance),
            (Kind::Change | Kind::Request | Kind::Period, true) => self.distance,
            _ => return None,
        };
        if !self.sent {
            return Some(0);
        }
        Some(u32::from(after).saturating_sub(now.wrapping_sub(self.stamp)))
    }
}

/// One device on a CAN Link bus: sends on some of the 14 channels, receives on others.
///
/// - Set-up: [`set`](Self::set).
/// - Commands: [`write`](Self::write), [`write_value`](Self::write_value), [`send`](Self::send).
/// - Input: [`handle_frame`](Self::handle_frame), [`handle_timeout`](Self::handle_timeout).
/// - Output: [`poll_transmit`](Self::poll_transmit), [`poll_event`](Self::poll_event),
///   [`poll_timeout`](Self::poll_timeout).
/// - Getters: [`read`](Self::read), [`read_value`](Self::read_value), [`overruns`](Self::overruns),
///   [`conflicts`](Self::conflicts), [`wrong_lengths`](Self::wrong_lengths).
///
/// The newest value of a channel always wins; nothing is queued. What the device sends itself must
/// not be fed back to it: a frame on a channel that it transmits on is another device's.
#[derive(Debug, Clone)]
pub struct Link {
    slots: [Slot; CHANNELS],
    now: Duration,
    /// One bit a channel: what `poll_event` has not told yet.
    received: u16,
    conflicts: u16,
    lengths: u16,
}

impl Default for Link {
    fn default() -> Self {
        Self::new()
    }
}

impl Link {
    /// A device that does nothing with any channel yet.
    #[must_use]
    pub const fn new() -> Self {
        let mut slots = [Slot::new(0); CHANNELS];
        let mut rest: &mut [Slot] = &mut slots;
        let mut number = 1;
        while let [first, others @ ..] = rest {
            *first = Slot::new(number);
            number += 1;
            rest = others;
        }
        Self { slots, now: Duration::ZERO, received: 0, conflicts: 0, lengths: 0 }
    }

    /// Sets a channel up. Its value and its counters begin anew.
    ///
    /// # Errors
    /// [`SettingError`]; the channel is as it was.
    pub fn set(&mut self, channel: Channel, setting: Setting) -> Result<(), SettingError> {
        let id = setting.id.unwrap_or(channel.default_id());
        if id > StandardId::MAX.as_raw() {
            return Err(SettingError::Id { channel, id });
        }
        let others = Channel::all().zip(&self.slots);
        let taken = |(other, slot): &(Channel, &Slot)| {
            *other != channel && slot.id == id && slot.kind != Kind::Off && setting.role != Role::Off
        };
        if let Some((other, _)) = others.into_iter().find(taken) {
            return Err(SettingError::Shared { channel, id, other });
        }
        if let Some(len) = setting.len.filter(|len| *len > 8) {
            return Err(SettingError::Len { channel, len });
        }
        let (kind, period) = match setting.role {
            Role::Off => (Kind::Off, 0),
            Role::Receive => (Kind::Receive, 0),
            Role::Transmit(Trigger::Change) => (Kind::Change, 0),
            Role::Transmit(Trigger::Request) => (Kind::Request, 0),
            Role::Transmit(Trigger::Period(time)) => match milliseconds(time) {
                Some(period) if period > 0 => (Kind::Period, period),
                _ => return Err(SettingError::Time { channel, time }),
            },
        };
        let time = setting.distance;
        let distance = milliseconds(time).ok_or(SettingError::Time { channel, time })?;
        let wanted = setting.len.unwrap_or(ANY_LEN);
        if let Some(slot) = self.slots.get_mut(channel.position()) {
            *slot = Slot { id, period, distance, wanted, kind, ..Slot::new(channel.number()) };
        }
        let others = !bit(channel);
        self.received &= others;
        self.conflicts &= others;
        self.lengths &= others;
        Ok(())
    }

    /// Sets the value of a channel that this device transmits on. It is sent as the channel's
    /// [`Trigger`] says; a value that has not been sent yet is replaced.
    ///
    /// # Errors
    /// [`SubmitError::NotTransmitting`], [`SubmitError::Len`]; the old value stays.
    pub fn write(&mut self, channel: Channel, data: &[u8]) -> Result<(), SubmitError> {
        let slot = self.transmitter(channel)?;
        if !slot.fits(data.len()) {
            let expected = slot.wanted.min(8);
            return Err(SubmitError::Len { channel, expected, found: data.len() });
        }
        let changed = !slot.filled || slot.value() != data;
        slot.fresh |= match slot.kind {
            Kind::Change => changed,
            Kind::Period => !slot.sent,
            _ => false,
        };
        slot.store(data);
        Ok(())
    }

    /// [`write`](Self::write) of a typed value.
    ///
    /// # Errors
    /// As of `write`.
    pub fn write_value<P: Payload>(&mut self, channel: Channel, value: &P) -> Result<(), SubmitError> {
        let bytes = value.encode();
        self.write(channel, bytes.get(..P::LEN).unwrap_or(&bytes))
    }

    /// Has the value of a channel sent, changed or not, as soon as its distance allows.
    ///
    /// # Errors
    /// [`SubmitError::NotTransmitting`], [`SubmitError::Empty`] before the first value.
    pub fn send(&mut self, channel: Channel) -> Result<(), SubmitError> {
        let slot = self.transmitter(channel)?;
        if !slot.filled {
            return Err(SubmitError::Empty { channel });
        }
        slot.fresh = true;
        Ok(())
    }

    fn transmitter(&mut self, channel: Channel) -> Result<&mut Slot, SubmitError> {
        let slot = self.slots.get_mut(channel.position()).filter(|slot| slot.kind.transmits());
        slot.ok_or(SubmitError::NotTransmitting { channel })
    }

    /// The newest value of a channel that this device receives, and marks it as read; `None` before
    /// the first one.
    pub fn read(&mut self, now: Duration, channel: Channel) -> Option<Received> {
        let slot = self.slots.get_mut(channel.position())?;
        if slot.kind != Kind::Receive || !slot.filled {
            return None;
        }
        let new = core::mem::take(&mut slot.fresh);
        self.received &= !bit(channel);
        let age = Duration::from_millis(u64::from(stamp(now).wrapping_sub(slot.stamp)));
        Some(Received { data: slot.data, len: slot.len, new, age })
    }

    /// The newest value as a typed one, and whether it is new; `None` before the first one and where
    /// the bytes are no such value.
    pub fn read_value<P: Payload>(&mut self, now: Duration, channel: Channel) -> Option<(P, bool)> {
        let received = self.read(now, channel)?;
        Some((P::decode(received.data())?, received.new))
    }

    /// Values of a channel that came before the last one had been read; stops at 65535.
    #[must_use]
    pub fn overruns(&self, channel: Channel) -> u16 {
        self.faults(channel, false)
    }

    /// Frames of other devices on a channel that this one transmits on; stops at 65535.
    #[must_use]
    pub fn conflicts(&self, channel: Channel) -> u16 {
        self.faults(channel, true)
    }

    fn faults(&self, channel: Channel, transmits: bool) -> u16 {
        let slot = self.slots.get(channel.position()).filter(|slot| slot.kind.transmits() == transmits);
        slot.map_or(0, |slot| slot.faults)
    }

    /// Frames of a channel that did not have its length and were not taken; stops at 65535.
    #[must_use]
    pub fn wrong_lengths(&self, channel: Channel) -> u16 {
        self.slots.get(channel.position()).map_or(0, |slot| slot.wrong_lengths)
    }

    /// Takes a frame from the bus.
    pub fn handle_frame(&mut self, now: Duration, frame: &impl Frame) -> Handled {
        self.now = now;
        let Id::Standard(id) = frame.id() else { return Handled::Ignored };
        if frame.is_remote_frame() {
            return Handled::Ignored;
        }
        let found = Channel::all().zip(&mut self.slots);
        let Some((channel, slot)) =
            found.into_iter().find(|(_, slot)| slot.id == id.as_raw() && slot.kind != Kind::Off)
        else {
            return Handled::Ignored;
        };
        if slot.kind.transmits() {
            slot.faults = slot.faults.saturating_add(1);
            self.conflicts |= bit(channel);
        } else if !slot.fits(frame.data().len()) {
            slot.wrong_lengths = slot.wrong_lengths.saturating_add(1);
            self.lengths |= bit(channel);
        } else {
            slot.faults = slot.faults.saturating_add(u16::from(slot.fresh));
            slot.store(frame.data());
            slot.fresh = true;
            slot.stamp = stamp(now);
            self.received |= bit(channel);
        }
        Handled::Handled
    }

    /// Notes the time; what has become due is sent by [`poll_transmit`](Self::poll_transmit).
    pub fn handle_timeout(&mut self, now: Duration) {
        self.now = now;
    }

    /// The next frame to send now, of the lowest channel that is due; `None` when there is none, or
    /// when the frame type `F` refuses an 11-bit data frame.
    pub fn poll_transmit<F: Frame>(&mut self, now: Duration) -> Option<F> {
        self.now = now;
        let now = stamp(now);
        let slot = self.slots.iter_mut().find(|slot| slot.wait(now) == Some(0))?;
        let frame = F::new(StandardId::new(slot.id)?, slot.value());
        slot.fresh = false;
        slot.sent = true;
        slot.stamp = now;
        frame
    }

    /// What happened, until `None`.
    pub fn poll_event(&mut self) -> Option<Event> {
        if let Some(channel) = take(&mut self.conflicts) {
            return Some(Event::Conflict(channel));
        }
        if let Some(channel) = take(&mut self.lengths) {
            return Some(Event::WrongLength(channel));
        }
        take(&mut self.received).map(Event::Received)
    }

    /// When [`poll_transmit`](Self::poll_transmit) will have something next; `None` = nothing planned.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Duration> {
        let now = stamp(self.now);
        let wait = self.slots.iter().filter_map(|slot| slot.wait(now)).min()?;
        let whole = Duration::from_millis(u64::try_from(self.now.as_millis()).unwrap_or(u64::MAX));
        Some(whole.saturating_add(Duration::from_millis(u64::from(wait))).max(self.now))
    }
}

const fn bit(channel: Channel) -> u16 {
    1 << channel.position()
}

fn take(bits: &mut u16) -> Option<Channel> {
    let channel = Channel::new(bits.trailing_zeros() as u8 + 1).ok()?;
    *bits &= !bit(channel);
    Some(channel)
}

/// Milliseconds, modulo 2^32.
const fn stamp(now: Duration) -> u32 {
    now.as_millis() as u32
}

/// Whole milliseconds of 16 bits.
fn milliseconds(time: Duration) -> Option<u16> {
    let whole = u16::try_from(time.as_millis()).ok()?;
    (Duration::from_millis(u64::from(whole)) == time).then_some(whole)
}
