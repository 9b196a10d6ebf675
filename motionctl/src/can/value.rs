//! Objects and values as people write them.

use std::path::Path;

use canopen_master::Address;
use canopen_master::data_type::{DataType, Value};
use canopen_master::eds;
use serde_json::{Value as Json, json};

use crate::exit::Exit;

/// Names of types on the command line.
const TYPES: [(&str, DataType); 21] = [
    ("bool", DataType::BOOLEAN),
    ("u8", DataType::UNSIGNED8),
    ("i8", DataType::INTEGER8),
    ("u16", DataType::UNSIGNED16),
    ("i16", DataType::INTEGER16),
    ("u24", DataType::UNSIGNED24),
    ("i24", DataType::INTEGER24),
    ("u32", DataType::UNSIGNED32),
    ("i32", DataType::INTEGER32),
    ("u40", DataType::UNSIGNED40),
    ("i40", DataType::INTEGER40),
    ("u48", DataType::UNSIGNED48),
    ("i48", DataType::INTEGER48),
    ("u56", DataType::UNSIGNED56),
    ("i56", DataType::INTEGER56),
    ("u64", DataType::UNSIGNED64),
    ("i64", DataType::INTEGER64),
    ("f32", DataType::REAL32),
    ("f64", DataType::REAL64),
    ("string", DataType::VISIBLE_STRING),
    ("bytes", DataType::DOMAIN),
];

/// A device file, if one was given.
pub(crate) fn device(path: Option<&Path>) -> Result<Option<eds::Device>, Exit> {
    let Some(path) = path else { return Ok(None) };
    let name = path.display().to_string();
    let bytes = crate::eds::bytes(path)?;
    let reading = eds::read(&bytes).map_err(|error| Exit::file(&name, &error))?;
    Ok(Some(reading.device))
}

/// A type by its name on the command line.
pub(crate) fn named_type(name: &str) -> Result<DataType, Exit> {
    let known = TYPES.iter().find(|(known, _)| known.eq_ignore_ascii_case(name));
    let names = || TYPES.map(|(name, _)| name).join(", ");
    known
        .map(|(_, data_type)| *data_type)
        .ok_or_else(|| Exit::usage(format!("--type {name}: one of {} expected", names())))
}

/// The type that was named, or that the device file gives the object.
pub(crate) fn data_type(
    name: Option<&str>,
    device: Option<&eds::Device>,
    at: Address,
) -> Result<Option<DataType>, Exit> {
    if let Some(name) = name {
        return named_type(name).map(Some);
    }
    let own = device.and_then(|device| {
        let data_type = device.entry(at.index, at.sub)?.data_type?;
        Some(DataType(device.base_type(data_type).0))
    });
    Ok(own)
}

/// A number in decimal, as `0x1F` or as `1Fh`.
pub(crate) fn number(text: &str) -> Option<i128> {
    let (sign, rest) = text.strip_prefix('-').map_or((1, text), |rest| (-1, rest));
    let hex =
        rest.strip_prefix("0x").or_else(|| rest.strip_prefix("0X")).or_else(|| rest.strip_suffix(['h', 'H']));
    let value = match hex {
        Some(hex) => i128::from_str_radix(hex, 16).ok().filter(|_| !hex.starts_with(['+', '-']))?,
        None => rest.parse().ok()?,
    };
    Some(sign * value)
}

/// A number that is marked as hexadecimal, `0x1F` or `1Fh`: what indices and identifiers are written in.
pub(crate) fn hexadecimal(text: &str) -> Option<u32> {
    let marked = text.starts_with("0x") || text.starts_with("0X") || text.ends_with(['h', 'H']);
    number(text).filter(|_| marked).and_then(|value| u32::try_from(value).ok())
}

/// `0x6041`, `6041h`, `0x1018:1`, or a name of the device file.
pub(crate) fn address(text: &str, device: Option<&eds::Device>) -> Result<Address, Exit> {
    let index = |text: &str| hexadecimal(text).and_then(|index| u16::try_from(index).ok());
    let (first, sub) = match text.split_once(':') {
        Some((first, sub)) => (first, number(sub).and_then(|sub| u8::try_from(sub).ok())),
        None => (text, Some(0)),
    };
    if let (Some(index), Some(sub)) = (index(first), sub) {
        return Ok(Address::new(index, sub));
    }
    if let Some((index, sub)) = device.and_then(|device| device.find(text)) {
        return Ok(Address::new(index, sub));
    }
    let or_name = if device.is_some() { "a name of the device file" } else { "with --eds a name" };
    Err(Exit::usage(format!("{text:?}: an object as 0x6041, 6041h, 0x1018:1 or {or_name} expected")))
}

/// The bytes of a value.
pub(crate) fn encode(text: &str, data_type: DataType) -> Result<Vec<u8>, Exit> {
    let wrong = |expected: &str| Exit::usage(format!("{text:?}: {expected} expected"));
    let value = match data_type.kind() {
        canopen_master::data_type::Kind::Boolean => Value::Boolean(match text {
            "0" | "false" => false,
            "1" | "true" => true,
            _ => return Err(wrong("true or false")),
        }),
        canopen_master::data_type::Kind::Unsigned(_) | canopen_master::data_type::Kind::Signed(_) => {
            let number = number(text).ok_or_else(|| wrong("a number"))?;
            match (u64::try_from(number), i64::try_from(number)) {
                (Ok(number), _) => Value::Unsigned(number),
                (_, Ok(number)) => Value::Signed(number),
                _ => return Err(wrong("a number of up to 64 bits")),
            }
        }
        canopen_master::data_type::Kind::Real(bytes) => {
            let value = match bytes {
                4 => text.parse().map(Value::Real32),
                _ => text.parse().map(Value::Real64),
            };
            let value = value.map_err(|_| wrong("a number"))?;
            // Infinity is only written where it is asked for: inf has no digit.
            let infinite = match value {
                Value::Real32(value) => value.is_infinite(),
                Value::Real64(value) => value.is_infinite(),
                _ => false,
            };
            if infinite && text.contains(|letter: char| letter.is_ascii_digit()) {
                return Err(Exit::usage(format!("{text:?}: number out of the range of {data_type}")));
            }
            value
        }
        canopen_master::data_type::Kind::VisibleString => return Ok(text.as_bytes().to_vec()),
        canopen_master::data_type::Kind::UnicodeString => {
            return Ok(text.encode_utf16().flat_map(u16::to_le_bytes).collect());
        }
        _ => return bytes(text).ok_or_else(|| wrong("pairs of hex digits")),
    };
    let mut room = [0; 8];
    let len =
        value.encode(data_type, &mut room).map_err(|error| Exit::usage(format!("{text:?}: {error}")))?;
    Ok(room.get(..len).unwrap_or(&[]).to_vec())
}

/// Bytes in hex, with blanks or without.
pub(crate) fn bytes(text: &str) -> Option<Vec<u8>> {
    let digits: Vec<char> = text.chars().filter(|c| !c.is_whitespace()).collect();
    let byte = |pair: &[char]| match pair {
        [high, low] => Some((high.to_digit(16)? * 16 + low.to_digit(16)?) as u8),
        _ => None,
    };
    digits.chunks(2).map(byte).collect()
}

/// Upper-case hex without blanks.
pub(crate) fn hex(bytes: &[u8]) -> String {
    use core::fmt::Write;
    bytes.iter().fold(String::with_capacity(2 * bytes.len()), |mut text, byte| {
        let _ = write!(text, "{byte:02X}");
        text
    })
}

/// The value of an object's bytes.
pub(crate) fn decode(data: &[u8], data_type: DataType) -> Result<Json, Exit> {
    let value = Value::parse(data_type, data).map_err(|error| {
        let bytes = if data.is_empty() { String::new() } else { format!(": {}", hex(data)) };
        Exit::check(format!("the object is no {data_type}: {error}{bytes}"))
    })?;
    Ok(match value {
        Value::Boolean(value) => json!(value),
        Value::Signed(value) => json!(value),
        Value::Unsigned(value) => json!(value),
        // The shortest text that reads back as the same number.
        Value::Real32(value) => real(value.to_string().parse().unwrap_or(f64::NAN)),
        Value::Real64(value) => real(value),
        Value::VisibleString(text) => {
            let end = text.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
            json!(String::from_utf8_lossy(text.get(..end).unwrap_or(text)))
        }
        Value::UnicodeString(text) => {
            let units = text
                .chunks(2)
                .map(|pair| pair.iter().rev().fold(0, |unit, byte| unit << 8 | u16::from(*byte)));
            json!(String::from_utf16_lossy(&units.collect::<Vec<_>>()))
        }
        _ => json!(hex(data)),
    })
}

/// A number; JSON has none for infinity and NaN, which are texts.
fn real(value: f64) -> Json {
    if value.is_finite() { json!(value) } else { json!(value.to_string()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses() {
        assert_eq!(address("0x6041", None).unwrap(), Address::new(0x6041, 0));
        assert_eq!(address("6041h", None).unwrap(), Address::new(0x6041, 0));
        assert_eq!(address("1018h:01h", None).unwrap(), Address::new(0x1018, 1));
        assert_eq!(address("0x1A00:10", None).unwrap(), Address::new(0x1A00, 10));
        for wrong in ["6041", "0x10000", "0x1018:256", "speed", ""] {
            assert_eq!(address(wrong, None).unwrap_err().status, 2, "{wrong}");
        }
    }

    #[test]
    fn an_object_of_another_length_is_told_with_its_bytes_if_it_has_any() {
        let told = |data: &[u8]| decode(data, DataType::UNSIGNED32).unwrap_err().message;
        assert_eq!(told(&[]), "the object is no UNSIGNED32: UNSIGNED32 has 4 bytes, 0 came");
        assert_eq!(told(&[1, 0xAB]), "the object is no UNSIGNED32: UNSIGNED32 has 4 bytes, 2 came: 01AB");
    }

    #[test]
    fn values_go_in_and_out() {
        for (text, data_type, data, back) in [
            ("1", DataType::BOOLEAN, "01", json!(true)),
            ("-2", DataType::INTEGER16, "FEFF", json!(-2)),
            ("0x123456", DataType::UNSIGNED24, "563412", json!(0x12_3456)),
            ("18446744073709551615", DataType::UNSIGNED64, "FFFFFFFFFFFFFFFF", json!(u64::MAX)),
            ("1.5", DataType::REAL32, "0000C03F", json!(1.5)),
            ("0.1", DataType::REAL32, "CDCCCC3D", json!(0.1)),
            ("hello", DataType::VISIBLE_STRING, "68656C6C6F", json!("hello")),
            ("01 ff", DataType::DOMAIN, "01FF", json!("01FF")),
        ] {
            let bytes = encode(text, data_type).unwrap();
            assert_eq!(hex(&bytes), data);
            assert_eq!(decode(&bytes, data_type).unwrap(), back);
        }
        for (text, data_type) in [
            ("256", DataType::UNSIGNED8),
            ("-1", DataType::UNSIGNED8),
            ("x", DataType::INTEGER8),
            ("0", DataType::DOMAIN),
        ] {
            assert_eq!(encode(text, data_type).unwrap_err().status, 2, "{text}");
        }
    }

    #[test]
    fn a_real_number_out_of_range_is_not_written_as_infinity() {
        for (text, data_type) in
            [("1e40", DataType::REAL32), ("-3.5e38", DataType::REAL32), ("1e400", DataType::REAL64)]
        {
            let error = encode(text, data_type).unwrap_err();
            assert_eq!(error.status, 2);
            assert!(error.message.contains("out of the range of REAL"), "{}", error.message);
        }
        for data_type in [DataType::REAL32, DataType::REAL64] {
            for text in ["inf", "-inf", "NaN"] {
                assert_eq!(decode(&encode(text, data_type).unwrap(), data_type).unwrap(), text);
            }
        }
    }
}
