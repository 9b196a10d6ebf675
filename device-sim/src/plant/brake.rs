//! A brake that holds the axis while it is without current.

use super::STEP;

/// Opens and closes with delay; moving against a closed brake wears it, and is counted.
#[derive(Debug, Clone)]
pub struct Brake {
    opening: f64,
    closing: f64,
    /// 0 = closed, 1 = open.
    lift: f64,
}

impl Brake {
    /// A closed brake with the times that it takes to open and to close, s.
    #[must_use]
    pub const fn new(opening: f64, closing: f64) -> Self {
        Self { opening, closing, lift: 0.0 }
    }

    /// Whether it holds the axis.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.lift < 1.0
    }

    /// One step; whether it holds.
    pub(super) fn step(&mut self, open: bool) -> bool {
        let (time, sign) = if open { (self.opening, 1.0) } else { (self.closing, -1.0) };
        let change = if time > 0.0 { STEP / time } else { 1.0 };
        self.lift = (self.lift + sign * change).clamp(0.0, 1.0);
        // Lifted within rounding is lifted; it lets go and grips at the end of its stroke.
        if self.lift > 1.0 - 1e-9 {
            self.lift = 1.0;
        }
        if open { self.holds() } else { self.lift < 1e-9 }
    }
}
