//! Node IDs (CiA 301, 7.3.3).

use core::fmt;

/// The address of a CANopen node, 1…127.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(u8);

/// A number that is no node ID.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("node ID {0}, 1 to 127 expected")]
pub struct NodeIdError(pub u8);

impl NodeId {
    /// The lowest address.
    pub const MIN: Self = Self(1);
    /// The highest address.
    pub const MAX: Self = Self(127);

    /// Checks a number.
    ///
    /// # Errors
    /// [`NodeIdError`] outside 1…127.
    pub const fn new(raw: u8) -> Result<Self, NodeIdError> {
        match raw {
            1..=127 => Ok(Self(raw)),
            _ => Err(NodeIdError(raw)),
        }
    }

    /// The number, 1…127.
    #[must_use]
    pub const fn raw(self) -> u8 {
        self.0
    }

    /// All addresses in order.
    pub fn all() -> impl Iterator<Item = Self> {
        (1..128).map(Self)
    }
}

impl TryFrom<u8> for NodeId {
    type Error = NodeIdError;

    fn try_from(raw: u8) -> Result<Self, NodeIdError> {
        Self::new(raw)
    }
}

impl fmt::Display for NodeId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}
