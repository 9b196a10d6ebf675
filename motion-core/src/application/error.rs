//! Why an order failed.

use core::fmt;

use lb2::code::Failure;

use crate::failure;

/// Error code of a function block; 0 = none. Limit switches have the manual's codes (6.8.1.1); the
/// others are project-defined: failures have their number, refusals lie above 100h.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub struct MotionError(pub u16);

impl MotionError {
    /// No error.
    pub const NONE: Self = Self(0);
    /// Upper software limit switch (6.8.1.1).
    pub const SW_LIMIT_PLUS: Self = Self(failure::SW_LIMIT_PLUS.0 as u16);
    /// Lower software limit switch.
    pub const SW_LIMIT_MINUS: Self = Self(failure::SW_LIMIT_MINUS.0 as u16);
    /// Upper hardware limit switch.
    pub const HW_LIMIT_PLUS: Self = Self(failure::HW_LIMIT_PLUS.0 as u16);
    /// Lower hardware limit switch.
    pub const HW_LIMIT_MINUS: Self = Self(failure::HW_LIMIT_MINUS.0 as u16);
    /// No such axis, or it is not activated (`[000]`, `[600]`).
    pub const NO_AXIS: Self = Self(0x101);
    /// The drive is not enabled (`Power`).
    pub const NOT_ENABLED: Self = Self(0x102);
    /// The axis is in a failure; `Reset` first.
    pub const IN_ERROR: Self = Self(0x103);
    /// A `Stop` is held.
    pub const STOPPING: Self = Self(0x104);
    /// A parameter that the order needs is not set: V max. `[642]`, t max. acceleration `[654]`, the
    /// velocity, Auto calibration `[804]`, or mode Control `[600]` for `GearIn`.
    pub const NOT_CONFIGURED: Self = Self(0x105);
    /// A value of the order is out of range.
    pub const RANGE: Self = Self(0x106);
    /// The axis moves; the order needs it at standstill.
    pub const MOVING: Self = Self(0x107);
    /// The axis is not geared.
    pub const NOT_GEARED: Self = Self(0x108);

    /// The error that a failure of the axis is.
    #[must_use]
    pub const fn from_failure(failure: Failure) -> Self {
        Self(failure.0 as u16)
    }

    /// Whether it is a limit switch, off which the axis may still move (6.8.1.1).
    #[must_use]
    pub const fn is_limit(self) -> bool {
        matches!(
            self,
            Self::SW_LIMIT_PLUS | Self::SW_LIMIT_MINUS | Self::HW_LIMIT_PLUS | Self::HW_LIMIT_MINUS
        )
    }

    /// The failure that it is; `None` for no error and for a refusal.
    #[must_use]
    pub const fn failure(self) -> Option<Failure> {
        match self.0 {
            number @ 1..=0xFF => Some(Failure(number as u8)),
            _ => None,
        }
    }

    /// What it means; `None` for an unknown number.
    #[must_use]
    pub fn text(self) -> Option<&'static str> {
        Some(match self {
            Self::NONE => "no error",
            Self::NO_AXIS => "no such axis, or not activated",
            Self::NOT_ENABLED => "the drive is not enabled",
            Self::IN_ERROR => "the axis is in a failure, reset it first",
            Self::STOPPING => "the axis is held by a stop",
            Self::NOT_CONFIGURED => "a parameter that the order needs is not set",
            Self::RANGE => "a value of the order is out of range",
            Self::MOVING => "the axis moves, standstill expected",
            Self::NOT_GEARED => "the axis is not geared",
            Self(other) => return failure::text(Failure(u8::try_from(other).ok()?)),
        })
    }
}

impl fmt::Display for MotionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.text() {
            Some(text) => f.write_str(text),
            None => write!(f, "error {:X}h", self.0),
        }
    }
}
