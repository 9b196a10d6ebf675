//! Settings of an input, read from the parameters in one place.

use super::calibration::Input;
use super::{Calibration, Code, Direction, Edges, Evaluation, Scale, Ssi};
use crate::parameters::Values;

/// What an input of type Virtual2 takes over, `[156]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Actual value of another input.
    ActualValue,
    /// Counts per second of another input, as the reading.
    Frequency,
    /// Nominal position of an axis.
    Position,
    /// Nominal velocity of an axis, as the reading.
    Velocity,
    /// Clock of an axis' stepper motor.
    Steps,
}

/// Type of an input and what belongs to it, `[100]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// 6.6.1.1.
    Incremental {
        /// Terminal block E1…E3, by place: that of the input's number.
        encoder: usize,
        /// `[128]`.
        evaluation: Evaluation,
    },
    /// 6.6.1.2.
    Ssi {
        /// Terminal block E1…E3, by place.
        encoder: usize,
        /// `[135]`, `[142]`, `[149]`.
        ssi: Ssi,
    },
    /// 6.6.1.3: a drive LD 2000.
    Can {
        /// `[254]`: CAN 1 IN 1, IN 2, CAN 2 IN 1…IN 4, by place; `None` = inactive.
        object: Option<usize>,
    },
    /// 6.6.1.4.
    Virtual1 {
        /// `[170]`, counts per second.
        frequency: i32,
    },
    /// 6.6.1.5.
    Virtual2 {
        /// `[156]`.
        quantity: Quantity,
        /// `[163]`: input or axis, by place.
        source: usize,
    },
    /// 6.6.1.6.
    Analog {
        /// `[268]`: I61, I62, I63, I54…I57, by place.
        channel: usize,
        /// `[275]`: the mean over the gate time instead of the last reading.
        average: bool,
    },
}

impl Kind {
    /// Whether both are the same choice of `[100]`.
    pub(super) fn is_same_type(&self, other: &Self) -> bool {
        core::mem::discriminant(self) == core::mem::discriminant(other)
    }

    /// Whether it is one of the virtual types.
    pub(super) const fn is_virtual(&self) -> bool {
        matches!(self, Self::Virtual1 { .. } | Self::Virtual2 { .. })
    }
}

/// All settings of an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// `[107]`.
    pub active: bool,
    /// `[100]`.
    pub kind: Kind,
    /// `[198]`…`[224]`.
    pub scale: Scale,
    /// `[226]`…`[252]`.
    pub calibration: Calibration,
    /// `[184]`, user measuring units; 0 = no failure suppression.
    pub jump: u32,
    /// `[191]`, cycles.
    pub tolerance: u8,
}

impl Settings {
    /// The settings of input `at`, 0…5.
    #[must_use]
    pub fn read(values: &Values, at: usize) -> Self {
        let value = |first| values.at(first, at);
        let place = |first| usize::try_from(value(first) - 1).ok();
        let kind = match value(100) {
            0 => Kind::Incremental {
                encoder: at,
                evaluation: if value(128) == 0 { Evaluation::FourEdges } else { Evaluation::TwoEdges },
            },
            1 => {
                let code = if value(135) == 0 { Code::Gray } else { Code::Binary };
                Kind::Ssi { encoder: at, ssi: Ssi::new(code, value(142) == 1, value(149).unsigned_abs()) }
            }
            2 => Kind::Can { object: place(254) },
            3 => Kind::Virtual1 { frequency: value(170) },
            4 => Kind::Virtual2 {
                quantity: match value(156) {
                    0 => Quantity::ActualValue,
                    1 => Quantity::Frequency,
                    2 => Quantity::Position,
                    3 => Quantity::Velocity,
                    _ => Quantity::Steps,
                },
                source: place(163).unwrap_or(at),
            },
            _ => Kind::Analog { channel: usize::try_from(value(268)).unwrap_or(0), average: value(275) == 0 },
        };
        let scale = match kind {
            // 6.6.1.4: has only the settings from [219] on.
            Kind::Virtual1 { .. } => Scale::unity(value(219)),
            _ => Scale::new(value(205), value(212), value(198) == 1, value(219)),
        };
        let calibration = Calibration {
            direction: match value(226) {
                1 => Direction::Forward,
                2 => Direction::Backward,
                3 => Direction::Both,
                _ => Direction::Inactive,
            },
            edges: match value(233) {
                1 => Edges::Falling,
                2 => Edges::Rising,
                3 => Edges::Both,
                _ => Edges::Inactive,
            },
            input: Input::from_choice(value(240)),
            value: value(247),
        };
        Self {
            active: value(107) == 1,
            kind,
            scale,
            calibration,
            jump: value(184).unsigned_abs(),
            tolerance: value(191).clamp(0, 3) as u8,
        }
    }
}
