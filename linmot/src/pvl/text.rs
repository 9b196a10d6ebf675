//! Bytes and text: files are in Windows-1252 or UTF-8, with or without its mark.

use alloc::borrow::Cow;
use alloc::vec::Vec;

use encoding_rs::WINDOWS_1252;

/// Encoding of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// Windows-1252, what the manufacturer's tool on a Windows PC writes.
    Windows1252,
    /// UTF-8.
    Utf8,
    /// UTF-8 that begins with its mark EF BB BF.
    Utf8Mark,
}

impl Encoding {
    /// The bytes of text in this encoding, without the mark. A character that Windows-1252 does not
    /// have becomes `?`.
    #[must_use]
    pub fn encode(self, text: &str) -> Vec<u8> {
        match self {
            Self::Utf8 | Self::Utf8Mark => text.as_bytes().into(),
            Self::Windows1252 => {
                let mut bytes = Vec::with_capacity(text.len());
                for character in text.chars() {
                    let mut buffer = [0; 4];
                    let (encoded, _, lost) = WINDOWS_1252.encode(character.encode_utf8(&mut buffer));
                    bytes.extend_from_slice(if lost { b"?" } else { &encoded });
                }
                bytes
            }
        }
    }

    /// The bytes of text in this encoding, without the mark; `None` if it does not have all its
    /// characters.
    #[must_use]
    pub fn encode_exactly(self, text: &str) -> Option<Vec<u8>> {
        let bytes = self.encode(text);
        (self.decode(&bytes) == text).then_some(bytes)
    }

    /// The text of bytes in this encoding, without the mark. In UTF-8 what is none becomes U+FFFD.
    #[must_use]
    pub fn decode(self, bytes: &[u8]) -> Cow<'_, str> {
        match self {
            Self::Utf8 | Self::Utf8Mark => alloc::string::String::from_utf8_lossy(bytes),
            Self::Windows1252 => WINDOWS_1252.decode_without_bom_handling(bytes).0,
        }
    }

    /// What the file begins with.
    #[must_use]
    pub const fn mark(self) -> &'static [u8] {
        match self {
            Self::Utf8Mark => &[0xEF, 0xBB, 0xBF],
            Self::Windows1252 | Self::Utf8 => &[],
        }
    }
}

/// Decodes a file line by line: a line that is no UTF-8 is Windows-1252, in which every byte is a
/// character, and so is the file then.
#[derive(Debug, Clone, Default)]
pub struct LineDecoder {
    mark: bool,
    begun: bool,
    windows: bool,
    beyond_ascii: bool,
}

impl LineDecoder {
    /// Nothing decoded.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The text of a line.
    pub fn decode<'a>(&mut self, line: &'a [u8]) -> Cow<'a, str> {
        let mark = Encoding::Utf8Mark.mark();
        let first = !core::mem::replace(&mut self.begun, true);
        let line = match line.strip_prefix(mark) {
            Some(rest) if first => {
                self.mark = true;
                rest
            }
            _ => line,
        };
        self.beyond_ascii |= !line.is_ascii();
        match core::str::from_utf8(line) {
            Ok(text) => Cow::Borrowed(text),
            Err(_) => {
                self.windows = true;
                WINDOWS_1252.decode_without_bom_handling(line).0
            }
        }
    }

    /// The encoding of what was decoded. A file of ASCII characters only counts as Windows-1252.
    #[must_use]
    pub const fn encoding(&self) -> Encoding {
        match (self.mark, self.windows || !self.beyond_ascii) {
            (true, _) => Encoding::Utf8Mark,
            (false, true) => Encoding::Windows1252,
            (false, false) => Encoding::Utf8,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encodings_are_told_apart_and_kept() {
        for (encoding, bytes) in [
            (Encoding::Windows1252, &b"Fl\xFCgel \x80"[..]),
            (Encoding::Utf8, "Flügel €".as_bytes()),
            (Encoding::Utf8Mark, "\u{FEFF}Flügel €".as_bytes()),
        ] {
            let mut decoder = LineDecoder::new();
            let text = decoder.decode(bytes).into_owned();
            assert_eq!((text.as_str(), decoder.encoding()), ("Flügel €", encoding));
            assert_eq!([encoding.mark(), &encoding.encode(&text)].concat(), bytes);
        }
        assert_eq!(Encoding::Windows1252.encode("a→b"), b"a?b");
        let mut plain = LineDecoder::new();
        assert_eq!(
            (plain.decode(b"@FileType PVL"), plain.encoding()),
            (Cow::from("@FileType PVL"), Encoding::Windows1252)
        );
    }
}
