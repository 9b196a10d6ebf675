//! Incremental encoders: what a counter brings, and a decoder that counts the edges of A, B and N
//! (manual A 3.7, 6.6.1.1).

/// How the signals of an incremental encoder are counted, `[128]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Evaluation {
    /// Ink_V: every edge of two tracks in quadrature, four a period.
    FourEdges,
    /// Ink_S: both edges of track A, two a period; track B says the direction, low = forward.
    TwoEdges,
}

/// What an encoder terminal block E1…E3 brings in one cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Encoder {
    /// Of an incremental encoder: edges counted so far, R·c of manual A 1.5; wraps. Of an SSI encoder:
    /// the word it sent, right-aligned.
    pub count: i32,
    /// Level of the reference track N.
    pub reference: bool,
    /// Count at the last rising edge of N since the cycle before.
    pub risen: Option<i32>,
    /// Count at the last falling edge of N since the cycle before.
    pub fallen: Option<i32>,
    /// No usable signal: wire break, or edges that the counter could not follow.
    pub fault: bool,
}

/// Counts the edges of an incremental encoder's tracks from samples of their levels.
///
/// Sampled at least once per edge it loses nothing; a sample in which both tracks changed is an edge
/// missed, and is told as a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QuadratureDecoder {
    evaluation: Evaluation,
    tracks: Option<(bool, bool)>,
    encoder: Encoder,
}

impl QuadratureDecoder {
    /// A decoder at count 0.
    #[must_use]
    pub const fn new(evaluation: Evaluation) -> Self {
        let encoder = Encoder { count: 0, reference: false, risen: None, fallen: None, fault: false };
        Self { evaluation, tracks: None, encoder }
    }

    /// Takes a sample of the tracks. With four edges, A ahead of B is forward.
    pub fn sample(&mut self, a: bool, b: bool, n: bool) {
        if let Some((last_a, last_b)) = self.tracks.replace((a, b)) {
            let step = match self.evaluation {
                Evaluation::FourEdges => match (phase(a, b) - phase(last_a, last_b)) & 3 {
                    0 => 0,
                    1 => 1,
                    3 => -1,
                    _ => {
                        self.encoder.fault = true;
                        0
                    }
                },
                Evaluation::TwoEdges if a == last_a => 0,
                Evaluation::TwoEdges if b => -1,
                Evaluation::TwoEdges => 1,
            };
            self.encoder.count = self.encoder.count.wrapping_add(step);
        }
        let count = self.encoder.count;
        match (self.encoder.reference, n) {
            (false, true) => self.encoder.risen = Some(count),
            (true, false) => self.encoder.fallen = Some(count),
            _ => {}
        }
        self.encoder.reference = n;
    }

    /// What was counted; the edges of N and the fault begin anew.
    pub fn take(&mut self) -> Encoder {
        let taken = self.encoder;
        self.encoder.risen = None;
        self.encoder.fallen = None;
        self.encoder.fault = false;
        taken
    }
}

/// Place within a period: 00, 10, 11, 01 are 0…3.
const fn phase(a: bool, b: bool) -> i8 {
    match (a, b) {
        (false, false) => 0,
        (true, false) => 1,
        (true, true) => 2,
        (false, true) => 3,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A period of two tracks in quadrature.
    const PERIOD: [(bool, bool); 4] = [(true, false), (true, true), (false, true), (false, false)];

    fn run(evaluation: Evaluation, samples: &[(bool, bool)]) -> Encoder {
        let mut decoder = QuadratureDecoder::new(evaluation);
        decoder.sample(false, false, false);
        samples.iter().for_each(|&(a, b)| decoder.sample(a, b, false));
        decoder.take()
    }

    #[test]
    fn four_edges_count_both_ways() {
        let forward = PERIOD.repeat(1000);
        assert_eq!(run(Evaluation::FourEdges, &forward).count, 4000);
        let mut backward: std::vec::Vec<_> = forward.iter().rev().skip(1).copied().collect();
        backward.push((false, false));
        assert_eq!(run(Evaluation::FourEdges, &backward).count, -4000);
        // Chatter on one edge counts up and down.
        let chatter = [(true, false), (false, false), (true, false), (false, false), (true, false)];
        assert_eq!(run(Evaluation::FourEdges, &chatter).count, 1);
    }

    #[test]
    fn two_edges_take_the_direction_from_b() {
        let pulses = |b| [(true, b), (false, b)].repeat(500);
        assert_eq!(run(Evaluation::TwoEdges, &pulses(false)).count, 1000);
        assert_eq!(run(Evaluation::TwoEdges, &pulses(true)).count, -1000);
    }

    #[test]
    fn a_missed_edge_is_a_fault_once() {
        let mut decoder = QuadratureDecoder::new(Evaluation::FourEdges);
        decoder.sample(false, false, false);
        decoder.sample(true, true, false);
        assert!(decoder.take().fault);
        assert!(!decoder.take().fault);
    }

    #[test]
    fn edges_of_the_reference_track_latch_the_count() {
        let mut decoder = QuadratureDecoder::new(Evaluation::FourEdges);
        for (at, &(a, b)) in PERIOD.repeat(3).iter().enumerate() {
            decoder.sample(a, b, (5..7).contains(&at));
        }
        // The first sample only sets the levels: sample n is count n.
        let taken = decoder.take();
        assert_eq!((taken.risen, taken.fallen, taken.reference), (Some(5), Some(7), false));
        assert_eq!(decoder.take().risen, None);
    }
}
