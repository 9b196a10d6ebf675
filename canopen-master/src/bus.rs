//! The state of the CAN adapter (ISO 11898-1, fault confinement).

/// The adapter's state, as its driver tells it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub enum BusStatus {
    /// Error active.
    #[default]
    Active,
    /// An error counter has reached 96.
    Warning,
    /// Error passive.
    Passive,
    /// Bus-off: nothing is sent or received until it recovers.
    Off,
    /// The adapter is not there.
    Unplugged,
}

impl BusStatus {
    /// Whether frames can be sent.
    #[must_use]
    pub const fn is_on(self) -> bool {
        matches!(self, Self::Active | Self::Warning | Self::Passive)
    }
}
