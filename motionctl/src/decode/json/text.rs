//! Numbers, times, bytes and texts as JSON.

use motion_io::capture::Time;

/// `"name":` with the comma before it.
macro_rules! key {
    ($out:expr, $name:literal) => {
        $out.extend_from_slice(concat!(",\"", $name, "\":").as_bytes())
    };
}
pub(super) use key;

/// A short piece of text that is copied in one go.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece<const N: usize> {
    text: [u8; N],
    len: usize,
}

impl<const N: usize> Piece<N> {
    pub(super) const EMPTY: Self = Self { text: [0; N], len: 0 };

    /// `None` where the text is longer.
    pub(super) fn new(text: &[u8]) -> Option<Self> {
        let mut piece = Self { len: text.len(), ..Self::EMPTY };
        piece.text.get_mut(..text.len())?.copy_from_slice(text);
        Some(piece)
    }

    #[inline]
    pub(super) fn put(&self, out: &mut Vec<u8>) {
        let end = out.len() + self.len;
        out.extend_from_slice(&self.text);
        out.truncate(end);
    }
}

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

#[inline]
pub(super) fn put_hex(out: &mut Vec<u8>, data: &[u8]) {
    // The data of a classic frame in one go; of a longer one piece by piece.
    for data in data.chunks(8) {
        let bytes = match data.first_chunk() {
            Some(bytes) => u64::from_le_bytes(*bytes),
            None => data.iter().rev().fold(0, |bytes, &byte| bytes << 8 | u64::from(byte)),
        };
        let text = [hex_of_4(bytes as u32).to_le_bytes(), hex_of_4((bytes >> 32) as u32).to_le_bytes()];
        let end = out.len() + 2 * data.len();
        out.extend_from_slice(text.as_flattened());
        out.truncate(end);
    }
}

#[inline]
pub(super) fn put_number(out: &mut Vec<u8>, number: impl itoa::Integer) {
    out.extend_from_slice(itoa::Buffer::new().format(number).as_bytes());
}

/// Seconds with six decimals, or nine where six would lose something.
#[inline]
pub(super) fn put_time(out: &mut Vec<u8>, time: Option<Time>) {
    let Some(Time(nanos)) = time else { return out.extend_from_slice(b"null") };
    if nanos < 0 {
        out.push(b'-');
    }
    let nanos = nanos.unsigned_abs();
    put_number(out, nanos / 1_000_000_000);
    let fraction = (nanos % 1_000_000_000) as u32;
    let mut digits = [b'.', b'0', b'0', b'0', b'0', b'0', b'0', b'0', b'0', b'0'];
    let (mut rest, count) = if fraction.is_multiple_of(1000) { (fraction / 1000, 6) } else { (fraction, 9) };
    for digit in digits.iter_mut().take(count + 1).skip(1).rev() {
        *digit = b'0' + (rest % 10) as u8;
        rest /= 10;
    }
    out.extend_from_slice(digits.get(..=count).unwrap_or(&[]));
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
