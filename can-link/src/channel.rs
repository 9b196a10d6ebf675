//! Channels, and what one device does with each of them.

use core::fmt;
use core::time::Duration;

/// Channels of one bus. The CAN controller of the MotionController's C167 has 14 message objects for
/// general use: one channel, one message object, one identifier.
pub const CHANNELS: usize = 14;

/// Identifier of channel n is this plus n (decision 11, project-defined): 101h…10Eh.
pub const BASE_ID: u16 = 0x100;

/// Bit rate unless set otherwise, bit/s (decision 12).
pub const BIT_RATE: u32 = 500_000;

/// One of the channels 1…14.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Channel(u8);

/// A number that is no channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("channel {0}, 1 to 14 expected")]
pub struct ChannelError(pub u8);

impl Channel {
    /// Checks a number.
    ///
    /// # Errors
    /// [`ChannelError`] outside 1…14.
    pub const fn new(number: u8) -> Result<Self, ChannelError> {
        match number {
            1..=14 => Ok(Self(number)),
            _ => Err(ChannelError(number)),
        }
    }

    /// The number, 1…14.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.0
    }

    /// All channels in order.
    pub fn all() -> impl DoubleEndedIterator<Item = Self> + ExactSizeIterator {
        (0..CHANNELS as u8).map(|position| Self(position + 1))
    }

    /// The identifier that the channel has unless set otherwise.
    #[must_use]
    pub const fn default_id(self) -> u16 {
        BASE_ID + self.0 as u16
    }

    pub(crate) const fn position(self) -> usize {
        self.0 as usize - 1
    }
}

impl TryFrom<u8> for Channel {
    type Error = ChannelError;

    fn try_from(number: u8) -> Result<Self, ChannelError> {
        Self::new(number)
    }
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// When a channel that this device transmits on is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Trigger {
    /// When a value is written that differs from the last one.
    #[default]
    Change,
    /// Only when asked to, with [`Link::send`](crate::Link::send).
    Request,
    /// Every so often, once a first value has been written. 1 ms…65.535 s, whole milliseconds.
    Period(Duration),
}

/// What this device does with a channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Role {
    /// Nothing: its frames are not looked at.
    #[default]
    Off,
    /// It is the channel's one transmitter.
    Transmit(Trigger),
    /// It is one of any number of receivers.
    Receive,
}

/// How one channel is set up on this device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Setting {
    /// What the device does with it.
    pub role: Role,
    /// 11-bit identifier; `None` is the channel's default.
    pub id: Option<u16>,
    /// The only length that its frames may have, 0…8 bytes; `None` allows any.
    pub len: Option<u8>,
    /// Least time between two frames that this device sends on it, 0…65.535 s, whole milliseconds.
    pub distance: Duration,
}

impl Setting {
    /// A channel that nothing is done with.
    pub const OFF: Self = Self { role: Role::Off, id: None, len: None, distance: Duration::ZERO };
    /// A channel of any length that this device receives.
    pub const RECEIVE: Self = Self { role: Role::Receive, ..Self::OFF };
    /// A channel of any length that this device sends on every change.
    pub const TRANSMIT: Self = Self { role: Role::Transmit(Trigger::Change), ..Self::OFF };
}

/// Why a channel cannot be set up so.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingError {
    /// More than 11 bits.
    #[error("channel {channel}: identifier {id:X}h, 0 to 7FFh expected")]
    Id {
        /// The channel.
        channel: Channel,
        /// The identifier given.
        id: u16,
    },
    /// Two channels of this device would have one identifier.
    #[error("channel {channel}: identifier {id:X}h belongs to channel {other}")]
    Shared {
        /// The channel.
        channel: Channel,
        /// The identifier given.
        id: u16,
        /// The channel that has it.
        other: Channel,
    },
    /// A CAN frame carries no more than 8 bytes.
    #[error("channel {channel}: {len} bytes, 0 to 8 expected")]
    Len {
        /// The channel.
        channel: Channel,
        /// The length given.
        len: u8,
    },
    /// A time that is not a number of milliseconds of 16 bits, or a period of 0.
    #[error("channel {channel}: {time:?}, 0 to 65535 ms expected (a period: 1 to 65535 ms)")]
    Time {
        /// The channel.
        channel: Channel,
        /// The time given.
        time: Duration,
    },
}
