//! Error counters and what they make of a station (ISO 11898-1, fault confinement).

use core::fmt;

use canopen_master::BusStatus;

/// What a station may do on the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum State {
    /// Both counters below 96.
    Active,
    /// A counter has reached 96; no change of behaviour.
    Warning,
    /// A counter is above 127: the station no longer disturbs others, and waits 8 bits between frames.
    Passive,
    /// The transmit counter passed 255: the station is off the bus until it is restarted.
    BusOff,
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Active => "error active",
            Self::Warning => "error warning",
            Self::Passive => "error passive",
            Self::BusOff => "bus-off",
        })
    }
}

impl From<State> for BusStatus {
    fn from(state: State) -> Self {
        match state {
            State::Active => Self::Active,
            State::Warning => Self::Warning,
            State::Passive => Self::Passive,
            State::BusOff => Self::Off,
        }
    }
}

/// TEC and REC.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    transmit: u16,
    receive: u16,
}

impl Counters {
    /// The transmit error counter.
    #[must_use]
    pub const fn transmit(self) -> u16 {
        self.transmit
    }

    /// The receive error counter.
    #[must_use]
    pub const fn receive(self) -> u16 {
        self.receive
    }

    /// What the counters amount to.
    #[must_use]
    pub const fn state(self) -> State {
        match (self.transmit, self.receive) {
            (256.., _) => State::BusOff,
            (128.., _) | (_, 128..) => State::Passive,
            (96.., _) | (_, 96..) => State::Warning,
            _ => State::Active,
        }
    }

    pub(super) const fn transmit_error(&mut self) {
        self.transmit += 8;
    }

    pub(super) const fn transmit_done(&mut self) {
        self.transmit = self.transmit.saturating_sub(1);
    }

    pub(super) fn receive_error(&mut self) {
        self.receive = (self.receive + 1).min(255);
    }

    pub(super) const fn receive_done(&mut self) {
        // Out of error passive, the counter starts again just below its limit: 119…127 allowed.
        self.receive = if self.receive > 127 { 119 } else { self.receive.saturating_sub(1) };
    }
}
