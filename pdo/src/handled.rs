//! What an engine says to a frame.

/// Whether a received frame was for the engine that was given it; several engines share one bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Handled {
    /// It was, even if there was something wrong with it.
    Taken,
    /// Not its identifier.
    Ignored,
}

impl Handled {
    /// Whether the frame was for the engine.
    #[must_use]
    pub const fn is_taken(self) -> bool {
        matches!(self, Self::Taken)
    }
}
