//! Calibration of an input by a reference signal (manual A 6.6.1.1, `[226]`…`[252]`).

use super::{COUNTS_PER_TURN, Encoder, Kind, Sources};
use crate::io::Terminal;

/// Direction of travel in which the reference value is set, `[226]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// Not at all.
    Inactive,
    /// Actual values counting up.
    Forward,
    /// Actual values counting down.
    Backward,
    /// Both.
    Both,
}

impl Direction {
    /// Whether a movement by `step` is in this direction.
    pub(super) const fn includes(self, step: i32) -> bool {
        match self {
            Self::Inactive => false,
            Self::Forward => step > 0,
            Self::Backward => step < 0,
            Self::Both => true,
        }
    }
}

/// Edges of the reference signal that count, `[233]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Edges {
    /// None.
    Inactive,
    /// H->L.
    Falling,
    /// L->H.
    Rising,
    /// H->L and L->H.
    Both,
}

/// An edge that came.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Edge {
    Rising,
    Falling,
}

impl Edge {
    /// The count that the encoder latched at this edge.
    pub(super) const fn latch(self, encoder: &Encoder) -> Option<i32> {
        match self {
            Self::Rising => encoder.risen,
            Self::Falling => encoder.fallen,
        }
    }
}

/// Where the reference signal comes from, `[240]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Input {
    None,
    /// Track N of E1…E3, by place.
    Reference(usize),
    Digital(Terminal),
    /// The drive's turn: high in its first half, so that it rises where a turn begins (project-defined).
    CanBus,
}

/// Level of a reference signal, and the pulses it made since the cycle before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Level {
    high: bool,
    risen: bool,
    fallen: bool,
}

impl Input {
    pub(super) fn from_choice(choice: i32) -> Self {
        match choice {
            1..=3 => Self::Reference(choice as usize - 1),
            4..=9 => Terminal::from_choice(choice - 4).map_or(Self::None, Self::Digital),
            10 => Self::CanBus,
            _ => Self::None,
        }
    }

    pub(super) fn level(self, sources: &Sources<'_>, kind: Kind) -> Option<Level> {
        let steady = |high| Some(Level { high, risen: false, fallen: false });
        match self {
            Self::None => None,
            Self::Reference(at) => sources.encoders.get(at).map(|encoder| Level {
                high: encoder.reference,
                risen: encoder.risen.is_some(),
                fallen: encoder.fallen.is_some(),
            }),
            Self::Digital(terminal) => steady(sources.digital.get(terminal)),
            Self::CanBus => {
                let Kind::Can { object } = kind else { return None };
                let position = object.and_then(|at| sources.can.get(at).copied().flatten())?;
                steady((position >> 4) & (COUNTS_PER_TURN as u32 - 1) < COUNTS_PER_TURN as u32 / 2)
            }
        }
    }
}

/// Settings of the calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Calibration {
    /// `[226]`.
    pub direction: Direction,
    /// `[233]`.
    pub edges: Edges,
    /// `[240]`.
    pub(super) input: Input,
    /// `[247]`, user measuring units.
    pub value: i32,
}

/// The reference signal, followed from cycle to cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Signal {
    last: Option<bool>,
}

impl Signal {
    /// The edge that counts, if one came since the last cycle; of two, the rising one.
    pub(super) fn follow(&mut self, level: Option<Level>, edges: Edges) -> Option<Edge> {
        let Some(level) = level else {
            self.last = None;
            return None;
        };
        let last = self.last.replace(level.high);
        let risen = level.risen || last == Some(false) && level.high;
        let fallen = level.fallen || last == Some(true) && !level.high;
        match edges {
            Edges::Rising | Edges::Both if risen => Some(Edge::Rising),
            Edges::Falling | Edges::Both if fallen => Some(Edge::Falling),
            _ => None,
        }
    }
}
