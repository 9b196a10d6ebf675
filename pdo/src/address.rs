//! Where an object lies in an object dictionary.

use core::fmt;

/// Index and sub-index of an object (CiA 301, 7.4).
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Address {
    /// Index, 0000h…FFFFh.
    pub index: u16,
    /// Sub-index, 0 of a plain variable.
    pub sub: u8,
}

impl Address {
    /// Object `index`, sub-index `sub`.
    #[must_use]
    pub const fn new(index: u16, sub: u8) -> Self {
        Self { index, sub }
    }
}

/// As in the standard's tables: `6041h:00`.
impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h:{:02X}", self.index, self.sub)
    }
}

impl fmt::Debug for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}
