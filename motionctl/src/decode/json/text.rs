//! Numbers, times, bytes and texts as JSON.

use std::io::Write as _;

use motion_io::capture::Time;

/// `"name":` with the comma before it.
macro_rules! key {
    ($out:expr, $name:literal) => {
        $out.extend_from_slice(concat!(",\"", $name, "\":").as_bytes())
    };
}
pub(super) use key;

/// Eight digits of four bytes, the first byte lowest in both: one nibble goes to each byte of the
/// result.
#[inline]
const fn hex_of_4(bytes: u32) -> u64 {
    const ONES: u64 = 0x0101_0101_0101_0101;
    let spread = bytes as u64;
    let spread = (spread | spread << 16) & 0x0000_FFFF_0000_FFFF;
    let spread = (spread | spread << 8) & 0x00FF_00FF_00FF_00FF;
    let nibbles = (spread >> 4 & 0x000F_000F_000F_000F) | (spread & 0x000F_000F_000F_000F) << 8;
    let letters = (nibbles + 6 * ONES) >> 4 & ONES;
    nibbles + b'0' as u64 * ONES + letters * (b'A' - b'9' - 1) as u64
}

/// Sixteen digits of eight bytes.
#[inline]
pub(super) const fn hex_of_8(bytes: [u8; 8]) -> u128 {
    let bytes = u64::from_le_bytes(bytes);
    hex_of_4(bytes as u32) as u128 | (hex_of_4((bytes >> 32) as u32) as u128) << 64
}

pub(super) fn put_hex(out: &mut Vec<u8>, data: &[u8]) {
    let (eights, rest) = data.as_chunks();
    for &bytes in eights {
        out.extend_from_slice(&hex_of_8(bytes).to_le_bytes());
    }
    for &byte in rest {
        out.extend(hex_of_4(byte.into()).to_le_bytes().iter().take(2));
    }
}

#[inline]
pub(super) fn put_number(out: &mut Vec<u8>, number: impl itoa::Integer) {
    out.extend_from_slice(itoa::Buffer::new().format(number).as_bytes());
}

/// Two digits each.
const PAIRS: [[u8; 2]; 100] = {
    let mut pairs = [[0; 2]; 100];
    let mut number = 0;
    while number < 100 {
        pairs[number] = [b'0' + number as u8 / 10, b'0' + number as u8 % 10];
        number += 1;
    }
    pairs
};

/// A time of whole microseconds, from zero on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment {
    pub(super) seconds: u64,
    micros: u32,
}

impl Moment {
    #[inline]
    pub(super) fn of(time: Time) -> Option<Self> {
        let nanos = u64::try_from(time.0).ok()?;
        let micros = nanos / 1000;
        let seconds = micros / 1_000_000;
        (micros * 1000 == nanos).then_some(Self { seconds, micros: (micros - seconds * 1_000_000) as u32 })
    }

    /// The digits behind the point.
    #[inline]
    pub(super) fn decimals(self) -> [u8; 6] {
        let pair = |number: u32| PAIRS.get((number % 100) as usize).copied().unwrap_or_default();
        let ([a, b], [c, d], [e, f]) =
            (pair(self.micros / 10_000), pair(self.micros / 100), pair(self.micros));
        [a, b, c, d, e, f]
    }
}

/// Seconds with six decimals, or nine where six would lose something.
#[inline]
pub(super) fn put_time(out: &mut Vec<u8>, time: Option<Time>) {
    let Some(time) = time else { return out.extend_from_slice(b"null") };
    match Moment::of(time) {
        Some(moment) => {
            put_number(out, moment.seconds);
            out.push(b'.');
            out.extend_from_slice(&moment.decimals());
        }
        // Writing to a vector does not fail.
        None => _ = write!(out, "{time}"),
    }
}

/// Any text, quoted.
pub(super) fn put_text(out: &mut Vec<u8>, text: &str) {
    // Writing to a vector does not fail.
    let _ = serde_json::to_writer(out, text);
}

/// A text without characters that would have to be escaped.
#[inline]
pub(super) fn put_word(out: &mut Vec<u8>, word: &str) {
    out.push(b'"');
    out.extend_from_slice(word.as_bytes());
    out.push(b'"');
}

pub(super) fn put_option(out: &mut Vec<u8>, number: Option<impl itoa::Integer>) {
    match number {
        Some(number) => put_number(out, number),
        None => out.extend_from_slice(b"null"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hex_and_times() {
        let every: Vec<u8> = (0..=255).collect();
        let mut out = Vec::new();
        put_hex(&mut out, &every);
        let expected: String = every.iter().map(|byte| format!("{byte:02X}")).collect();
        assert_eq!(String::from_utf8(out).unwrap(), expected);
        for (nanos, text) in [
            (Some(0), "0.000000"),
            (Some(1_682_489_978_627_243_000), "1682489978.627243"),
            (Some(1_000_000_001), "1.000000001"),
            (Some(-1_500_000_000), "-1.500000"),
            (None, "null"),
        ] {
            let mut out = Vec::new();
            put_time(&mut out, nanos.map(Time));
            assert_eq!(String::from_utf8(out).unwrap(), text);
        }
    }
}
