//! Encoders on an axis: what the terminals E1…E3 read of a position.

use motion_core::input::{self, Encoder};

/// An encoder of either kind.
#[derive(Debug, Clone)]
pub enum Sensor {
    /// Counts from where it was when switched on.
    Incremental(Incremental),
    /// Knows where it is.
    Ssi(Ssi),
}

impl Sensor {
    /// What the terminals bring after the axis has moved to `position`.
    pub fn read(&mut self, position: f64) -> Encoder {
        match self {
            Self::Incremental(encoder) => encoder.read(position),
            Self::Ssi(encoder) => encoder.read(position),
        }
    }

    /// Breaks the encoder's wires, or mends them.
    pub const fn set_broken(&mut self, broken: bool) {
        match self {
            Self::Incremental(encoder) => encoder.broken = broken,
            Self::Ssi(encoder) => encoder.broken = broken,
        }
    }
}

/// An incremental encoder with a reference mark.
#[derive(Debug, Clone)]
pub struct Incremental {
    /// Edges a unit.
    edges: f64,
    /// Edge where the mark begins; it is one period of four edges long.
    mark: i64,
    /// Edges from one mark to the next; 0 = there is only one.
    every: i64,
    /// Edges between position 0 and where it was switched on.
    origin: i64,
    count: i64,
    started: bool,
    broken: bool,
}

/// Edges of a signal period, which is also the length of the reference mark.
const PERIOD: i64 = 4;

impl Incremental {
    /// An encoder of `edges` edges a unit (four a period), with a reference mark at edge `mark`, and again
    /// after `every` edges (0 = once).
    #[must_use]
    pub const fn new(edges: f64, mark: i64, every: u32) -> Self {
        Self { edges, mark, every: every as i64, origin: 0, count: 0, started: false, broken: false }
    }

    /// Levels of A, B and N at an edge count, for a decoder.
    #[must_use]
    pub const fn tracks(&self, edge: i64) -> (bool, bool, bool) {
        let phase = edge.rem_euclid(PERIOD);
        (matches!(phase, 1 | 2), matches!(phase, 2 | 3), self.is_mark(edge))
    }

    const fn is_mark(&self, edge: i64) -> bool {
        let from = edge.saturating_sub(self.mark);
        let within = if self.every > 0 { from.rem_euclid(self.every) } else { from };
        within >= 0 && within < PERIOD
    }

    fn read(&mut self, position: f64) -> Encoder {
        let now = libm::floor(position * self.edges) as i64;
        if !self.started {
            self.started = true;
            self.origin = now;
            self.count = now;
        }
        let before = core::mem::replace(&mut self.count, now);
        let (risen, fallen) = self.crossed(before, now);
        let count = |edge: i64| edge.wrapping_sub(self.origin) as i32;
        Encoder {
            count: count(now),
            reference: self.is_mark(now),
            risen: risen.map(count),
            fallen: fallen.map(count),
            fault: self.broken,
        }
    }

    /// The last edges at which N rose and fell between two counts.
    fn crossed(&self, from: i64, to: i64) -> (Option<i64>, Option<i64>) {
        // Upward N rises at the mark's first edge and falls after its last; downward the other way.
        let (first, after) = (self.mark, self.mark.saturating_add(PERIOD));
        if to > from {
            (self.last_up(first, from, to), self.last_up(after, from, to))
        } else {
            (self.last_down(after - 1, from, to), self.last_down(first - 1, from, to))
        }
    }

    /// Greatest edge ≡ `edge` in (from, to].
    fn last_up(&self, edge: i64, from: i64, to: i64) -> Option<i64> {
        let last = if self.every > 0 { to - (to - edge).rem_euclid(self.every) } else { edge };
        (from < last && last <= to).then_some(last)
    }

    /// Least edge ≡ `edge` in [to, from).
    fn last_down(&self, edge: i64, from: i64, to: i64) -> Option<i64> {
        let last = if self.every > 0 { to + (edge - to).rem_euclid(self.every) } else { edge };
        (to <= last && last < from).then_some(last)
    }
}

/// An absolute encoder.
#[derive(Debug, Clone)]
pub struct Ssi {
    /// Counts a unit.
    counts: f64,
    word: input::Ssi,
    broken: bool,
}

impl Ssi {
    /// An encoder of `counts` counts a unit that sends such words.
    #[must_use]
    pub const fn new(counts: f64, word: input::Ssi) -> Self {
        Self { counts, word, broken: false }
    }

    fn read(&self, position: f64) -> Encoder {
        let count = libm::floor(position * self.counts) as i64;
        Encoder { count: self.word.word(count as u32) as i32, fault: self.broken, ..Encoder::default() }
    }
}
