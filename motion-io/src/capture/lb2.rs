//! LB2 lines: raw bytes, or hex text with or without a time before the bytes.

use std::io::Read;

use super::CaptureError;
use super::input::{Input, Line};
use super::reader::excerpt;
use super::record::{Damage, Place, Time};
use super::scan::{clock, date_time, fixed, hex_run, word};

/// Bytes of the line in the order of the wire, to be given to [`lb2::frame::Decoder`].
#[derive(Debug)]
pub enum Chunk<'a> {
    /// Bytes, and the time that the capture gives them.
    Bytes {
        /// Time of the text line; `None` of raw bytes and of lines without one.
        time: Option<Time>,
        /// At least one byte.
        bytes: &'a [u8],
    },
    /// A line of text that is no hex.
    Damage(Damage),
}

/// Reads the bytes of an LB2 capture as a stream.
#[derive(Debug)]
pub struct Lb2Reader<R> {
    input: Input<R>,
    hex: bool,
    bytes: Vec<u8>,
    line: u64,
}

impl<R: Read> Lb2Reader<R> {
    pub(super) const fn raw(input: Input<R>) -> Self {
        Self { input, hex: false, bytes: Vec::new(), line: 0 }
    }

    pub(super) const fn hex(input: Input<R>) -> Self {
        Self { input, hex: true, bytes: Vec::new(), line: 0 }
    }

    /// The next bytes, or a line that gave none; `None` at the end.
    ///
    /// # Errors
    /// [`CaptureError`] if reading fails.
    #[allow(clippy::should_implement_trait, reason = "lends the bytes")]
    pub fn next(&mut self) -> Result<Option<Chunk<'_>>, CaptureError> {
        if !self.hex {
            let range = self.input.chunk()?;
            return Ok(
                (!range.is_empty()).then(|| Chunk::Bytes { time: None, bytes: self.input.held(range) })
            );
        }
        loop {
            let Some(line) = self.input.line()? else { return Ok(None) };
            self.line += 1;
            let place = Place::Line(self.line);
            let Line::Whole(range) = line else {
                let reason = "a line of more than 65,536 bytes";
                return Ok(Some(Chunk::Damage(Damage { place, reason, text: String::new() })));
            };
            let line = self.input.held(range);
            match hex_line(line) {
                Some(HexLine { bytes, .. }) if bytes.is_empty() => {}
                Some(HexLine { time, bytes }) => {
                    self.bytes = bytes;
                    return Ok(Some(Chunk::Bytes { time, bytes: &self.bytes }));
                }
                None => {
                    let reason = "bytes in hex expected";
                    return Ok(Some(Chunk::Damage(Damage { place, reason, text: excerpt(line) })));
                }
            }
        }
    }
}

pub(super) struct HexLine {
    pub(super) time: Option<Time>,
    pub(super) bytes: Vec<u8>,
}

/// A line of hex: a time in seconds or `HH:MM:SS` where there is one, then bytes, `82 96`, `8296`,
/// `0x82, 0x96` or `82h 96h`. A direction or a bare word that ends in `:`, `>` or `<` may stand
/// before them; `#` and `;` begin a comment. `None` of anything else.
pub(super) fn hex_line(line: &[u8]) -> Option<HexLine> {
    let end = line.iter().position(|&byte| matches!(byte, b'#' | b';')).unwrap_or(line.len());
    let mut rest = line.get(..end).unwrap_or(&[]);
    let mut found = HexLine { time: None, bytes: Vec::new() };
    // `[2015-07-10 08:57:32.249713]`: a date and a time of day are two words.
    let bare = rest.trim_ascii_start();
    let bare = bare.strip_prefix(b"(").or_else(|| bare.strip_prefix(b"[")).unwrap_or(bare);
    let digits = bare.iter().position(|byte| !matches!(byte, b'0'..=b'9' | b'-' | b':' | b'.' | b' '));
    if let Some(time) = bare.get(..digits.unwrap_or(bare.len())).and_then(|text| {
        let text = text.trim_ascii();
        let second = text.iter().skip(11).position(|&byte| byte == b' ').map_or(text.len(), |at| at + 11);
        date_time(text.get(..second)?).map(|time| (time, second))
    }) {
        found.time = Some(Time(time.0));
        rest = bare.get(time.1..).unwrap_or(&[]);
    }
    while let Some((token, after)) = word(rest) {
        rest = after;
        let token = token.strip_suffix(b",").unwrap_or(token);
        if found.bytes.is_empty() {
            let inner = token.strip_prefix(b"(").or_else(|| token.strip_prefix(b"[")).unwrap_or(token);
            let inner = inner.strip_suffix(b")").or_else(|| inner.strip_suffix(b"]")).unwrap_or(inner);
            let inner = inner.strip_suffix(b":").unwrap_or(inner);
            let is_time = token.contains(&b'.') || token.contains(&b':') || inner.len() != token.len();
            if found.time.is_none()
                && is_time
                && let Some(time) = fixed(inner, 1_000_000_000).or_else(|| clock(inner))
            {
                found.time = Some(Time(time));
                continue;
            }
            let word = inner.strip_suffix(b">").or_else(|| inner.strip_suffix(b"<")).unwrap_or(inner);
            if matches!(
                word.to_ascii_lowercase().as_slice(),
                b"" | b"tx" | b"rx" | b"->" | b"<-" | b"s" | b"r"
            ) {
                continue;
            }
        }
        let token = token.strip_prefix(b"0x").or_else(|| token.strip_prefix(b"0X")).unwrap_or(token);
        let token = token.strip_suffix(b"h").or_else(|| token.strip_suffix(b"H")).unwrap_or(token);
        let at = found.bytes.len();
        found.bytes.resize(at + token.len() / 2, 0);
        if token.is_empty() {
            return None;
        }
        hex_run(token, found.bytes.get_mut(at..)?)?;
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hex_lines_in_any_spelling() {
        let expected = [0x82, 0x96, 0x02, 0x40, 0x42];
        for (line, time) in [
            ("82 96 02 40 42", None),
            ("8296024042  # identify", None),
            ("0x82, 0x96, 0x02, 0x40, 0x42", None),
            ("82h 96h 02h 40h 42h", None),
            ("12.5 82 96 02 40 42", Some(12_500_000_000)),
            ("(12.5) Tx 82 96 02 40 42", Some(12_500_000_000)),
            ("00:00:12.5: > 82 96 02 40 42", Some(12_500_000_000)),
            ("[2015-07-10 08:57:32.5] TX: 82 96 02 40 42", Some(1_436_518_652_500_000_000)),
        ] {
            let line = hex_line(line.as_bytes()).unwrap_or_else(|| panic!("{line}"));
            assert_eq!((line.time.map(|time| time.0), line.bytes.as_slice()), (time, &expected[..]));
        }
        assert!(hex_line(b"").unwrap().bytes.is_empty() && hex_line(b"; nothing").unwrap().bytes.is_empty());
        for line in ["hello", "82 9", "82 96 xx", "can0 123 [1] 11"] {
            assert!(hex_line(line.as_bytes()).is_none(), "{line}");
        }
    }
}
