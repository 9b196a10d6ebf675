//! Which characters the bytes of a file stand for.
//!
//! CiA 306-1, 6.2 asks for ASCII. Files in the field hold UTF-8 (with or without byte order mark),
//! Windows-1252, or an MS-DOS code page, and never say which.

use alloc::borrow::Cow;
use alloc::vec::Vec;

/// The encoding of a file, told from its bytes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum Encoding {
    /// Nothing above 7Fh.
    Ascii,
    /// UTF-8.
    Utf8,
    /// UTF-8 that begins with EF BB BF.
    Utf8Bom,
    /// Windows-1252, of which ISO 8859-1 is a part.
    Windows1252,
    /// MS-DOS code page 850 (western Europe).
    Cp850,
    /// MS-DOS code page 437 (the original IBM PC). Never guessed: where letters are concerned it
    /// is [`Self::Cp850`].
    Cp437,
}

const BOM: &[u8] = b"\xEF\xBB\xBF";

impl Encoding {
    /// What the file most probably is: UTF-8 if it is valid UTF-8; otherwise an MS-DOS code page if
    /// more of the bytes above 7Fh beside letters are in 80h…9Fh (letters there, punctuation in
    /// Windows-1252) than in C0h…FFh (the other way round), else Windows-1252, as for XML.
    #[must_use]
    pub fn detect(bytes: &[u8]) -> Self {
        if bytes.is_ascii() {
            return Self::Ascii;
        }
        if core::str::from_utf8(bytes).is_ok() {
            return if bytes.starts_with(BOM) { Self::Utf8Bom } else { Self::Utf8 };
        }
        if bytes.starts_with(b"<?xml") {
            return Self::Windows1252;
        }
        let (mut dos, mut windows) = (0_u32, 0_u32);
        for window in bytes.windows(2) {
            let high = match *window {
                [a, b] if a >= 0x80 && b.is_ascii_alphabetic() => a,
                [a, b] if b >= 0x80 && a.is_ascii_alphabetic() => b,
                _ => continue,
            };
            match high {
                0x80..=0x9F => dos += 1,
                0xC0.. => windows += 1,
                _ => {}
            }
        }
        if dos > windows { Self::Cp850 } else { Self::Windows1252 }
    }

    /// The text of the bytes. A byte that means nothing in UTF-8 becomes U+FFFD; in the 8-bit
    /// encodings every byte means something.
    #[must_use]
    pub fn decode(self, bytes: &[u8]) -> Cow<'_, str> {
        use oem_cp::code_table::{DECODING_TABLE_CP437, DECODING_TABLE_CP850};
        use oem_cp::decode_string_complete_table as complete;
        match self {
            Self::Ascii | Self::Utf8 | Self::Utf8Bom => {
                alloc::string::String::from_utf8_lossy(bytes.strip_prefix(BOM).unwrap_or(bytes))
            }
            Self::Windows1252 => encoding_rs::WINDOWS_1252.decode_without_bom_handling(bytes).0,
            Self::Cp850 => Cow::Owned(complete(bytes, &DECODING_TABLE_CP850)),
            Self::Cp437 => Cow::Owned(complete(bytes, &DECODING_TABLE_CP437)),
        }
    }

    /// The bytes of the text; `None` where it holds a character that the encoding lacks. ASCII
    /// widens to UTF-8 by itself.
    #[must_use]
    pub fn encode(self, text: &str) -> Option<Vec<u8>> {
        use oem_cp::code_table::{ENCODING_TABLE_CP437, ENCODING_TABLE_CP850};
        match self {
            Self::Ascii | Self::Utf8 => Some(text.as_bytes().to_vec()),
            Self::Utf8Bom => Some([BOM, text.as_bytes()].concat()),
            Self::Windows1252 => {
                let (bytes, _, lossy) = encoding_rs::WINDOWS_1252.encode(text);
                (!lossy).then(|| bytes.into_owned())
            }
            Self::Cp850 => oem_cp::encode_string_checked(text, &ENCODING_TABLE_CP850),
            Self::Cp437 => oem_cp::encode_string_checked(text, &ENCODING_TABLE_CP437),
        }
    }

    /// The encoding's usual name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ascii => "ASCII",
            Self::Utf8 => "UTF-8",
            Self::Utf8Bom => "UTF-8 with byte order mark",
            Self::Windows1252 => "Windows-1252",
            Self::Cp850 => "code page 850",
            Self::Cp437 => "code page 437",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn guesses_by_what_stands_beside_letters() {
        assert_eq!(Encoding::detect(b"Device"), Encoding::Ascii);
        assert_eq!(Encoding::detect("Schönaich".as_bytes()), Encoding::Utf8);
        assert_eq!(Encoding::detect(b"\xEF\xBB\xBF[FileInfo]"), Encoding::Utf8Bom);
        assert_eq!(Encoding::detect(b"Sch\x94naich"), Encoding::Cp850);
        assert_eq!(Encoding::detect(b"Sch\xF6naich, 20 \xB5m"), Encoding::Windows1252);
    }

    #[test]
    fn every_byte_survives() {
        let all: Vec<u8> = (0..=255).collect();
        for encoding in [Encoding::Windows1252, Encoding::Cp850, Encoding::Cp437] {
            assert_eq!(encoding.encode(&encoding.decode(&all)), Some(all.clone()), "{encoding:?}");
        }
        assert_eq!(Encoding::Cp850.decode(b"Sch\x94naich \xE6"), "Schönaich µ");
        assert_eq!(Encoding::Cp437.encode("€"), None);
    }
}
