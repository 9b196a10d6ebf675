//! Device models.

/// Device models (manual A 1.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Model {
    /// GEL 8230: with display and keys.
    Gel8230,
    /// GEL 8231: as 8230, with more inputs.
    Gel8231,
    /// GEL 8235: for mounting plates, without display.
    Gel8235,
    /// GEL 8236: as 8235, with more inputs.
    Gel8236,
}

impl Model {
    /// All models.
    pub const ALL: [Self; 4] = [Self::Gel8230, Self::Gel8231, Self::Gel8235, Self::Gel8236];

    /// The model number, which is also the device code of LB2 40h in binary: 8230 = 2026h.
    #[must_use]
    pub const fn number(self) -> u16 {
        match self {
            Self::Gel8230 => 8230,
            Self::Gel8231 => 8231,
            Self::Gel8235 => 8235,
            Self::Gel8236 => 8236,
        }
    }

    /// Whether it has the inputs I4, I62, I63 and I54…I57 (3.8 to 3.10, 7.2).
    #[must_use]
    pub const fn has_extra_inputs(self) -> bool {
        matches!(self, Self::Gel8231 | Self::Gel8236)
    }

    /// The model with this number.
    #[must_use]
    pub fn from_number(number: u16) -> Option<Self> {
        Self::ALL.into_iter().find(|model| model.number() == number)
    }
}
