//! A frame as bits on the wire: CRC-15, bit stuffing, lengths (ISO 11898-1, classic frames).
//!
//! `true` is recessive (1), `false` dominant (0).

use embedded_can::{Frame as _, Id};
use pdo::Frame;

/// CRC delimiter, acknowledge slot and delimiter, end of frame.
const TAIL: usize = 1 + 1 + 1 + 7;
/// Longest stuffed part: an extended frame of 8 bytes has 118 bits, and every fifth run a stuff bit.
const MAX_STUFFED: usize = 118 + 29;

/// The generator polynomial of the CRC, x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1.
pub const CRC15_POLYNOMIAL: u16 = 0x4599;

/// The CRC sequence over bits before stuffing, 15 bits.
#[must_use]
pub fn crc15(bits: impl IntoIterator<Item = bool>) -> u16 {
    bits.into_iter().fold(0, |crc, bit| {
        let out = (crc >> 14) & 1 == 1;
        let shifted = (crc << 1) & 0x7FFF;
        if bit != out { shifted ^ CRC15_POLYNOMIAL } else { shifted }
    })
}

/// The value that decides arbitration: the arbitration field from its first bit on, as a number. The
/// smaller one wins (dominant is 0).
#[must_use]
pub fn arbitration(frame: &Frame) -> u32 {
    let remote = u32::from(frame.is_remote());
    match frame.id() {
        // Identifier, RTR, IDE dominant.
        Id::Standard(id) => u32::from(id.as_raw()) << 21 | remote << 20,
        // Base identifier, SRR and IDE recessive, extension, RTR.
        Id::Extended(id) => {
            let (base, extension) = (id.as_raw() >> 18, id.as_raw() & 0x3_FFFF);
            base << 21 | 0b11 << 19 | extension << 1 | remote
        }
    }
}

/// A frame as its transmitter sends it, from start of frame to the last bit of the CRC sequence.
#[derive(Debug, Clone)]
pub struct WireBits {
    bits: [bool; MAX_STUFFED],
    len: usize,
    /// Bits up to the end of the arbitration field.
    arbitration: usize,
}

impl WireBits {
    /// Encodes a frame: fields, CRC, stuffing.
    #[must_use]
    pub fn new(frame: &Frame) -> Self {
        let mut plain = Plain { bits: [false; 118], len: 0 };
        plain.put(0, 1);
        let key = arbitration(frame);
        if frame.is_extended() {
            plain.put(key, 32);
        } else {
            plain.put(key >> 20, 12);
        }
        let arbitration = plain.len;
        // IDE and r0, or r1 and r0: all dominant.
        plain.put(0, 2);
        plain.put(frame.len() as u32, 4);
        for &byte in frame.data() {
            plain.put(u32::from(byte), 8);
        }
        let crc = crc15(plain.bits.iter().take(plain.len).copied());
        plain.put(u32::from(crc), 15);

        let mut wire = Self { bits: [false; MAX_STUFFED], len: 0, arbitration: 0 };
        let (mut last, mut run) = (true, 0);
        for (position, &bit) in plain.bits.iter().take(plain.len).enumerate() {
            run = if bit == last { run + 1 } else { 1 };
            last = bit;
            wire.put(bit);
            if run == 5 {
                wire.put(!bit);
                (last, run) = (!bit, 1);
            }
            if position + 1 == arbitration {
                wire.arbitration = wire.len;
            }
        }
        wire
    }

    fn put(&mut self, bit: bool) {
        if let Some(place) = self.bits.get_mut(self.len) {
            *place = bit;
            self.len += 1;
        }
    }

    /// The stuffed bits, start of frame to CRC sequence.
    #[must_use]
    pub fn stuffed(&self) -> &[bool] {
        self.bits.get(..self.len).unwrap_or(&[])
    }

    /// How many of the stuffed bits belong to start of frame and arbitration field.
    #[must_use]
    pub const fn arbitration_len(&self) -> usize {
        self.arbitration
    }

    /// Bits from start of frame to the last bit of end of frame; the intermission of 3 bits follows.
    #[must_use]
    pub const fn frame_len(&self) -> usize {
        self.len + TAIL
    }

    /// Number of the acknowledge slot, counted from start of frame as 0.
    #[must_use]
    pub const fn acknowledge_slot(&self) -> usize {
        self.len + 1
    }
}

struct Plain {
    bits: [bool; 118],
    len: usize,
}

impl Plain {
    /// Appends the low `count` bits of a value, most significant first.
    fn put(&mut self, value: u32, count: usize) {
        for shift in (0..count).rev() {
            if let Some(place) = self.bits.get_mut(self.len) {
                *place = value >> shift & 1 == 1;
                self.len += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_can::{ExtendedId, StandardId};

    fn text(bits: &[bool]) -> String {
        bits.iter().map(|bit| if *bit { '1' } else { '0' }).collect()
    }

    /// CRC-15/CAN of the usual check text "123456789" is 059Eh.
    #[test]
    fn crc_check_value() {
        let bits = b"123456789".iter().flat_map(|byte| (0..8).rev().map(move |bit| byte >> bit & 1 == 1));
        assert_eq!(crc15(bits), 0x059E);
    }

    /// SOF and 11 dominant identifier bits: a recessive stuff bit after every five (ISO 11898-1, 10.5).
    #[test]
    fn stuffing() {
        let frame = Frame::standard(0x000, []);
        let wire = WireBits::new(&frame);
        // 0x 12 (SOF, identifier) + RTR, IDE, r0, DLC: 19 dominant bits, then the CRC, 0 as well.
        let plain = 19 + 15;
        assert_eq!(crc15([false; 19]), 0);
        assert!(text(wire.stuffed()).starts_with("000001000001000001"), "{}", text(wire.stuffed()));
        assert_eq!(wire.stuffed().len(), plain + plain / 5);
        assert_eq!(wire.frame_len(), wire.stuffed().len() + 10);
        // Start of frame, 11 + 1 bits, and 2 stuff bits so far.
        assert_eq!(wire.arbitration_len(), 15);
    }

    /// Lengths without stuffing: 44 + 8n bits standard, 64 + 8n extended, to the end of frame.
    #[test]
    fn lengths() {
        for len in 0..=8 {
            let standard = Frame::data_frame(StandardId::new(0x555).unwrap(), &[0x55; 8][..len]).unwrap();
            let extended =
                Frame::data_frame(ExtendedId::new(0x1555_5555).unwrap(), &[0x55; 8][..len]).unwrap();
            for (frame, least) in [(standard, 44 + 8 * len), (extended, 64 + 8 * len)] {
                let wire = WireBits::new(&frame);
                assert!((least..=least + 4).contains(&wire.frame_len()), "{frame}: {}", wire.frame_len());
            }
        }
        let worst = Frame::data_frame(ExtendedId::new(0).unwrap(), &[0; 8]).unwrap();
        assert!(WireBits::new(&worst).frame_len() <= MAX_STUFFED + TAIL);
    }

    #[test]
    fn arbitration_order() {
        let data = Frame::standard(0x123, [1]);
        let remote = Frame::remote_frame(StandardId::new(0x123).unwrap(), 1).unwrap();
        let extended = Frame::data_frame(ExtendedId::new(0x123 << 18).unwrap(), &[]).unwrap();
        let extended_remote = Frame::remote_frame(ExtendedId::new(0x123 << 18).unwrap(), 0).unwrap();
        let next = Frame::standard(0x124, []);
        let keys = [data, remote, extended, extended_remote, next].map(|frame| arbitration(&frame));
        assert!(keys.is_sorted() && keys.windows(2).all(|pair| pair[0] != pair[1]), "{keys:08X?}");
    }
}
