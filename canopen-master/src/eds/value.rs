//! Values as EDS text and as the bytes on the wire (CiA 306-1, 6.3 and 6.6.3.2).

use alloc::string::String;
use alloc::vec::Vec;

use super::types::integer_bits;
use crate::data_type::{DataType, Kind};

/// Why a text is not a value.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ValueError {
    /// Not a number in any spelling.
    #[error("not a number")]
    NotANumber,
    /// The number is out of the data type's range.
    #[error("out of range of {0}")]
    Range(DataType),
    /// `$NODEID` is used and no node ID was given.
    #[error("depends on the node ID")]
    NeedsNodeId,
    /// Not pairs of hexadecimal digits.
    #[error("not hexadecimal bytes")]
    NotHex,
    /// The data type has no form as text.
    #[error("{0} has no value as text")]
    DataType(DataType),
}

/// An integer as an EDS spells it: decimal, `0x` and hexadecimal digits, or `0` and octal digits; at
/// most one `$NODEID` added before or after.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Number {
    /// The number without the node ID.
    pub value: i128,
    /// Whether the node ID is added.
    pub node_id: bool,
    /// Whether it is spelled as CiA 306-1, 6.3 has it, so without good will.
    pub clean: bool,
}

impl Number {
    /// Reads a number, with good will: blanks anywhere, upper and lower case, a comment (`;` or `#`)
    /// behind it, a trailing `h`, `08` and `09` as decimal, `$NODEID` on either side of the `+` and
    /// with brackets around.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        if let Some((value, clean)) = integer(text) {
            return Some(Self { value, node_id: false, clean });
        }
        let code = text.split([';', '#']).next().unwrap_or_default();
        let clean = code.len() == text.len();
        let squeezed: String =
            code.chars().filter(|c| !c.is_whitespace() && !matches!(c, '(' | ')' | '{' | '}')).collect();
        let same = squeezed.len() == text.len();
        let (mut value, mut node_id, mut plain) = (0_i128, false, clean && same);
        for (position, part) in squeezed.split('+').enumerate() {
            if part.eq_ignore_ascii_case("$NODEID") {
                if node_id {
                    return None;
                }
                node_id = true;
                plain &= position == 0;
            } else {
                let (part, well) = integer(part)?;
                value = value.checked_add(part)?;
                plain &= well && (node_id || position == 0);
            }
        }
        Some(Self { value, node_id, clean: plain })
    }

    /// The number, with the node ID added where the text says so.
    ///
    /// # Errors
    /// [`ValueError::NeedsNodeId`] where the node ID is needed and `None`.
    pub fn resolve(self, node_id: Option<u8>) -> Result<i128, ValueError> {
        if !self.node_id {
            return Ok(self.value);
        }
        let node_id = node_id.ok_or(ValueError::NeedsNodeId)?;
        self.value.checked_add(i128::from(node_id)).ok_or(ValueError::NotANumber)
    }
}

/// One integer, and whether it is spelled by the rules.
fn integer(text: &str) -> Option<(i128, bool)> {
    let (negative, digits) = match text.strip_prefix('-') {
        Some(digits) => (true, digits),
        None => (false, text),
    };
    if digits.starts_with(['+', '-']) {
        return None;
    }
    let (magnitude, clean) =
        if let Some(hex) = digits.strip_prefix("0x").or_else(|| digits.strip_prefix("0X")) {
            (radix(hex, 16)?, true)
        } else if let Some(hex) = digits.strip_suffix(['h', 'H']) {
            (radix(hex, 16)?, false)
        } else if digits.len() > 1 && digits.starts_with('0') {
            match radix(digits, 8) {
                Some(octal) => (octal, true),
                None => (radix(digits, 10)?, false),
            }
        } else {
            (radix(digits, 10)?, true)
        };
    Some((if negative { magnitude.checked_neg()? } else { magnitude }, clean))
}

fn radix(digits: &str, radix: u32) -> Option<i128> {
    if digits.starts_with(['+', '-']) {
        return None;
    }
    i128::from_str_radix(digits, radix).ok()
}

/// The bytes on the wire (little-endian, CiA 301, 7.1.4) of a value's text.
///
/// Integers may be given as two's complement (`0xFFFFFFFF` for an INTEGER32 is −1); an empty text
/// is zero or nothing. Real numbers are decimal, or hexadecimal for their bit pattern. Octet strings and domains
/// are hexadecimal bytes with or without blanks; visible strings are as they stand, without the
/// terminating zero; unicode strings UTF-16.
///
/// # Errors
/// See [`ValueError`].
pub fn to_bytes(text: &str, data_type: DataType, node_id: Option<u8>) -> Result<Vec<u8>, ValueError> {
    if let Some(bits) = integer_bits(data_type) {
        let number = if text.is_empty() {
            0
        } else {
            Number::parse(text).ok_or(ValueError::NotANumber)?.resolve(node_id)?
        };
        let number = fit(number, data_type).ok_or(ValueError::Range(data_type))?;
        let len = usize::from(bits.div_ceil(8));
        return Ok(number.to_le_bytes().into_iter().take(len).collect());
    }
    match data_type {
        DataType::REAL32 => real(text).map(|real| match real {
            Real::Value(value) => (value as f32).to_le_bytes().to_vec(),
            Real::Bits(bits) => (bits as u32).to_le_bytes().to_vec(),
        }),
        DataType::REAL64 => real(text).map(|real| match real {
            Real::Value(value) => value.to_le_bytes().to_vec(),
            Real::Bits(bits) => bits.to_le_bytes().to_vec(),
        }),
        DataType::VISIBLE_STRING => Ok(text.as_bytes().to_vec()),
        DataType::UNICODE_STRING => Ok(text.encode_utf16().flat_map(u16::to_le_bytes).collect()),
        DataType::OCTET_STRING | DataType::DOMAIN => hex(text).ok_or(ValueError::NotHex),
        DataType::TIME_OF_DAY | DataType::TIME_DIFFERENCE => match hex(text) {
            Some(bytes) if bytes.len() == 6 => Ok(bytes),
            _ => {
                let number = Number::parse(text).ok_or(ValueError::NotANumber)?.resolve(node_id)?;
                let bytes = u64::try_from(number).map_err(|_| ValueError::Range(data_type))?.to_le_bytes();
                match bytes {
                    [a, b, c, d, e, f, 0, 0] => Ok([a, b, c, d, e, f].to_vec()),
                    _ => Err(ValueError::Range(data_type)),
                }
            }
        },
        other => Err(ValueError::DataType(other)),
    }
}

/// The integer that the number stands for in this data type: itself, or its two's complement; `None`
/// where it does not fit.
#[must_use]
pub fn fit(number: i128, data_type: DataType) -> Option<i128> {
    let bits = u32::from(integer_bits(data_type)?);
    let span = 1_i128 << bits;
    if !matches!(data_type.kind(), Kind::Signed(_)) {
        return (0..span).contains(&number).then_some(number);
    }
    let half = span >> 1;
    match number {
        n if (-half..half).contains(&n) => Some(n),
        n if (half..span).contains(&n) => Some(n - span),
        _ => None,
    }
}

enum Real {
    Value(f64),
    Bits(u64),
}

fn real(text: &str) -> Result<Real, ValueError> {
    let text = text.split([';', '#']).next().unwrap_or_default().trim();
    if text.is_empty() {
        return Ok(Real::Value(0.0));
    }
    if let Some(bits) = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        return u64::from_str_radix(bits, 16).map(Real::Bits).map_err(|_| ValueError::NotANumber);
    }
    text.replace(',', ".").parse().map(Real::Value).map_err(|_| ValueError::NotANumber)
}

/// The text of a value that came as bytes: what [`to_bytes`] of the same data type gives back.
#[must_use]
pub fn from_bytes(bytes: &[u8], data_type: DataType) -> String {
    let mut wide = [0_u8; 16];
    let number = (bytes.len() <= 8).then(|| {
        wide.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        i128::from_le_bytes(wide)
    });
    match (data_type, number) {
        (DataType::VISIBLE_STRING, _) if core::str::from_utf8(bytes).is_ok() => {
            String::from_utf8_lossy(bytes).into_owned()
        }
        (DataType::UNICODE_STRING, _) => {
            let units = bytes.as_chunks::<2>().0.iter().map(|unit| u16::from_le_bytes(*unit));
            char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
        }
        (DataType::REAL32, Some(bits)) if bytes.len() == 4 => {
            let value = f32::from_bits(bits as u32);
            // Only its bits say which NaN it is.
            if value.is_nan() { alloc::format!("0x{bits:08X}") } else { alloc::format!("{value}") }
        }
        (DataType::REAL64, Some(bits)) if bytes.len() == 8 => {
            let value = f64::from_bits(bits as u64);
            if value.is_nan() { alloc::format!("0x{bits:016X}") } else { alloc::format!("{value}") }
        }
        (_, Some(number)) if integer_bits(data_type).is_some() => match fit(number, data_type) {
            Some(value) if matches!(data_type.kind(), Kind::Signed(_)) => alloc::format!("{value}"),
            _ => alloc::format!("0x{number:0width$X}", width = bytes.len() * 2),
        },
        _ => bytes.iter().map(|byte| alloc::format!("{byte:02X}")).collect(),
    }
}

/// Hexadecimal digits in pairs, blanks ignored.
#[must_use]
fn hex(text: &str) -> Option<Vec<u8>> {
    let mut digits = text.bytes().filter(|byte| !byte.is_ascii_whitespace());
    let mut bytes = Vec::with_capacity(text.len() / 2);
    while let Some(high) = digits.next() {
        let digit = |byte: u8| char::from(byte).to_digit(16);
        let pair = digit(high)? << 4 | digit(digits.next()?)?;
        bytes.push(pair as u8);
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(text: &str) -> Option<(i128, bool, bool)> {
        Number::parse(text).map(|n| (n.value, n.node_id, n.clean))
    }

    #[test]
    fn numbers_in_every_spelling() {
        assert_eq!(number("0x07"), Some((7, false, true)));
        assert_eq!(number("0X7f"), Some((127, false, true)));
        assert_eq!(number("017"), Some((15, false, true)));
        assert_eq!(number("00000000000000000000"), Some((0, false, true)));
        assert_eq!(number("-5"), Some((-5, false, true)));
        assert_eq!(number("-0x10"), Some((-16, false, true)));
        assert_eq!(number("08"), Some((8, false, false)));
        assert_eq!(number("1000h"), Some((0x1000, false, false)));
        assert_eq!(number("0x07 # VAR"), Some((7, false, false)));
        assert_eq!(number("1;comment"), Some((1, false, false)));
        for bad in ["", "x", "0x", "--1", "1 2x", "+", "0x-1", "1++2", "$NODEID+$NODEID", "$NODEID-1"] {
            assert_eq!(number(bad), None, "{bad}");
        }
    }

    #[test]
    fn node_id_on_either_side() {
        assert_eq!(number("$NODEID+0x180"), Some((0x180, true, true)));
        assert_eq!(number("$NodeId + 0x180"), Some((0x180, true, false)));
        assert_eq!(number("0x180+$NODEID"), Some((0x180, true, false)));
        assert_eq!(number("($nodeid)"), Some((0, true, false)));
        assert_eq!(number("$NODEID"), Some((0, true, true)));
        let cob_id = to_bytes("$NODEID+0x40000180", DataType::UNSIGNED32, Some(5));
        assert_eq!(cob_id, Ok(alloc::vec![0x85, 0x01, 0x00, 0x40]));
        assert_eq!(to_bytes("$NODEID", DataType::UNSIGNED8, None), Err(ValueError::NeedsNodeId));
    }

    #[test]
    fn bytes_by_data_type() {
        assert_eq!(to_bytes("0xFFFFFFFF", DataType::INTEGER32, None), Ok(alloc::vec![0xFF; 4]));
        assert_eq!(to_bytes("-1", DataType::INTEGER24, None), Ok(alloc::vec![0xFF; 3]));
        assert_eq!(to_bytes("256", DataType::UNSIGNED8, None), Err(ValueError::Range(DataType::UNSIGNED8)));
        assert_eq!(to_bytes("1.5", DataType::REAL32, None), Ok(1.5_f32.to_le_bytes().to_vec()));
        assert_eq!(to_bytes("0x3FC00000", DataType::REAL32, None), Ok(1.5_f32.to_le_bytes().to_vec()));
        assert_eq!(to_bytes("C8 3D BB", DataType::OCTET_STRING, None), Ok(alloc::vec![0xC8, 0x3D, 0xBB]));
        assert_eq!(to_bytes("A", DataType::UNICODE_STRING, None), Ok(alloc::vec![0x41, 0]));
        assert_eq!(to_bytes("xyz", DataType::DOMAIN, None), Err(ValueError::NotHex));
    }

    #[test]
    fn text_of_bytes_gives_the_bytes_back() {
        let cases: [(&[u8], DataType); 10] = [
            (&[0xFE, 0xFF], DataType::INTEGER16),
            (&[0x80, 0x01, 0, 0xC0], DataType::UNSIGNED32),
            (&[0, 0, 0xC0, 0x3F], DataType::REAL32),
            (&[1, 0, 0xC0, 0xFF], DataType::REAL32),
            (&[0xCD, 0xCC, 0xCC, 0x3D], DataType::REAL32),
            (&[1, 0, 0, 0, 0, 0, 0xF0, 0x7F], DataType::REAL64),
            (b"text", DataType::VISIBLE_STRING),
            (&[0x41, 0, 0xAC, 0x20], DataType::UNICODE_STRING),
            (&[1, 2, 3], DataType::DOMAIN),
            (&[1, 2, 3, 4, 5, 6], DataType::TIME_OF_DAY),
        ];
        for (bytes, data_type) in cases {
            let text = from_bytes(bytes, data_type);
            assert_eq!(to_bytes(&text, data_type, None).as_deref(), Ok(bytes), "{text}");
        }
    }
}
