//! SSI absolute encoders (manual A 6.6.1.2).

/// Bits of the number of turns of a multi-turn encoder (project-defined: the usual 4096 turns).
pub const TURN_BITS: u32 = 12;

/// Code of the word that the encoder sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Code {
    /// Gray code.
    Gray,
    /// Binary.
    Binary,
}

/// How an SSI word is to be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ssi {
    code: Code,
    bits: u32,
}

impl Ssi {
    /// A word of `single` bits for the position within a turn, 0…13, after 12 bits for the turns if
    /// `multi`.
    #[must_use]
    pub fn new(code: Code, multi: bool, single: u32) -> Self {
        Self { code, bits: single.min(13) + if multi { TURN_BITS } else { 0 } }
    }

    /// Bits of the word; its positions wrap there.
    #[must_use]
    pub const fn bits(self) -> u32 {
        self.bits
    }

    /// The position that a right-aligned word stands for; higher bits are ignored.
    #[must_use]
    pub const fn position(self, word: u32) -> u32 {
        let word = word & ((1 << self.bits) - 1);
        match self.code {
            Code::Binary => word,
            Code::Gray => {
                let word = word ^ word >> 16;
                let word = word ^ word >> 8;
                let word = word ^ word >> 4;
                let word = word ^ word >> 2;
                word ^ word >> 1
            }
        }
    }

    /// The word that an encoder at `position` sends.
    #[must_use]
    pub const fn word(self, position: u32) -> u32 {
        let position = position & ((1 << self.bits) - 1);
        match self.code {
            Code::Binary => position,
            Code::Gray => position ^ position >> 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_positions_are_each_others_inverse() {
        for (code, multi, single) in [
            (Code::Gray, false, 13),
            (Code::Gray, true, 12),
            (Code::Binary, true, 13),
            (Code::Gray, false, 0),
        ] {
            let ssi = Ssi::new(code, multi, single);
            for position in (0..1 << ssi.bits()).step_by(97).chain([(1 << ssi.bits()) - 1]) {
                assert_eq!(ssi.position(ssi.word(position)), position);
            }
        }
    }

    /// Neighbours in Gray code differ in one bit, also where the word wraps.
    #[test]
    fn gray_neighbours_differ_in_one_bit() {
        let ssi = Ssi::new(Code::Gray, true, 13);
        let last = (1 << ssi.bits()) - 1;
        for (a, b) in [(0, 1), (4095, 4096), (8191, 8192), (last, 0)] {
            assert_eq!((ssi.word(a) ^ ssi.word(b)).count_ones(), 1);
        }
    }
}
