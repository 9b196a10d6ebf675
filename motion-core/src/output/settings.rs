//! Settings of an output, read from the parameters in one place.

use crate::parameters::Values;

/// Direction signals in real time, `[546]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DirectionSignals {
    /// None: the application has the terminals for itself.
    None,
    /// Forward on Qx.2.
    Forward,
    /// Backward on Qx.2.
    Backward,
    /// Forward on Qx.2, backward on Qx.1.
    Both,
}

impl DirectionSignals {
    /// Bits of block Qx for forward and backward, swapped if `reversed` (`[534]`).
    pub(super) const fn bits(self, (forward, backward): (bool, bool), reversed: bool) -> u8 {
        let (forward, backward) = if reversed { (backward, forward) } else { (forward, backward) };
        match self {
            Self::None => 0,
            Self::Forward => (forward as u8) << 2,
            Self::Backward => (backward as u8) << 2,
            Self::Both => (forward as u8) << 2 | (backward as u8) << 1,
        }
    }
}

/// Jog signals in real time, `[528]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JogSignals {
    /// None: the application has the terminals for itself.
    None,
    /// Slow jog on Qx.3.
    Slow,
    /// Slow jog on Qx.3, fast jog on Qx.4.
    SlowFast,
}

impl JogSignals {
    pub(super) const fn bits(self, slow: bool, fast: bool) -> u8 {
        match self {
            Self::None => 0,
            Self::Slow => (slow as u8) << 3,
            Self::SlowFast => (slow as u8) << 3 | (fast as u8) << 4,
        }
    }
}

/// Dead range around the nominal position, user measuring units (6.7.1.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct DeadRange {
    /// `[516]`: below the nominal position.
    below: i32,
    /// `[522]`: above it.
    above: i32,
}

impl DeadRange {
    /// Whether an axis whose nominal minus actual position is `deviation` is within.
    pub(super) const fn contains(self, deviation: i32) -> bool {
        deviation <= self.below && deviation >= -self.above
    }
}

/// Settings of an analog output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Analog {
    /// `[474]`: 0…+10 V, the direction as a signal.
    pub unipolar: bool,
    /// `[480]`, mV.
    pub maximum: i32,
    /// `[504]` forward and `[510]` backward, mV.
    pub minimum: (i32, i32),
    pub(super) dead: DeadRange,
}

/// Type of an output and what belongs to it, `[450]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Nothing is put out.
    None,
    /// 6.7.1.1.
    Analog(Analog),
    /// 6.7.1.2: a drive LD 2000.
    CanBus {
        /// `[486]`: CAN 1 OUT 1, OUT 2, CAN 2 OUT 1…OUT 4, by place; `None` = inactive.
        object: Option<usize>,
        /// `[498]`, increments a motor revolution.
        increments: i32,
    },
    /// 6.7.1.3.
    Signals(JogSignals),
    /// 6.7.1.4.
    Stepper {
        /// `[540]`, Hz at V max.
        frequency: i32,
    },
}

/// All settings of an output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// `[450]`.
    pub kind: Kind,
    /// `[468]`: negative values for forward. Outputs 4…6 have no such parameter.
    pub inverted: bool,
    /// `[546]`.
    pub direction: DirectionSignals,
    /// `[534]`: the direction signals are swapped.
    pub reversed: bool,
}

impl Settings {
    /// The settings of output `at`, 0…5.
    #[must_use]
    pub fn read(values: &Values, at: usize) -> Self {
        // Only outputs 1…3 have terminals; the parameters of the others are not in use.
        let value = |first| if at < 3 { values.at(first, at) } else { 0 };
        let kind = match values.at(450, at) {
            1 => Kind::Analog(Analog {
                unipolar: value(474) == 1,
                maximum: value(480),
                minimum: (value(504), value(510)),
                dead: DeadRange { below: value(516), above: value(522) },
            }),
            2 => Kind::CanBus {
                object: usize::try_from(values.at(486, at) - 1).ok(),
                increments: values.at(498, at),
            },
            3 => Kind::Signals(match value(528) {
                1 => JogSignals::Slow,
                2 => JogSignals::SlowFast,
                _ => JogSignals::None,
            }),
            4 => Kind::Stepper { frequency: value(540) },
            _ => Kind::None,
        };
        Self {
            kind,
            inverted: value(468) == 1,
            direction: match value(546) {
                1 => DirectionSignals::Forward,
                2 => DirectionSignals::Backward,
                3 => DirectionSignals::Both,
                _ => DirectionSignals::None,
            },
            reversed: value(534) == 1,
        }
    }
}
