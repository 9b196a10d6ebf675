//! Flash and RAM images: raw bytes or Intel HEX.

use std::path::Path;

use ihex::{Reader, Record};
use lb2::telegram::BANK_LEN;

use crate::cli::Format;
use crate::exit::Exit;

/// Data bytes of one Intel HEX line.
const LINE: usize = 16;
/// What is between the pieces of an Intel HEX file: erased flash.
const FILL: u8 = 0xFF;

fn format(path: &Path, format: Option<Format>) -> Format {
    format.unwrap_or_else(|| match path.extension().and_then(|extension| extension.to_str()) {
        Some("hex" | "h86" | "ihex" | "HEX" | "H86") => Format::Hex,
        _ => Format::Bin,
    })
}

/// First byte's offset and the bytes. Raw files begin at `offset`, Intel HEX files say where.
pub(crate) fn read(path: &Path, wanted: Option<Format>, offset: u32) -> Result<(u32, Vec<u8>), Exit> {
    let name = path.display().to_string();
    let bytes = std::fs::read(path).map_err(|error| Exit::file(&name, &error))?;
    let (offset, bytes) = match format(path, wanted) {
        Format::Bin => (offset, bytes),
        Format::Hex => {
            let text = String::from_utf8(bytes).map_err(|_| Exit::file(&name, &"not a text file"))?;
            let (first, bytes) = parse_hex(&text).map_err(|error| Exit::file(&name, &error))?;
            (first + offset, bytes)
        }
    };
    if offset as usize + bytes.len() > BANK_LEN {
        let text = format!("{} bytes from offset {offset} pass the bank's end at 65536", bytes.len());
        return Err(Exit::file(&name, &text));
    }
    Ok((offset, bytes))
}

fn parse_hex(text: &str) -> Result<(u32, Vec<u8>), String> {
    let mut base = 0u32;
    let mut pieces: Vec<(u32, Vec<u8>)> = Vec::new();
    let mut ended = false;
    for (line, record) in Reader::new(text).enumerate() {
        let record = record.map_err(|error| format!("line {}: {error}", line + 1))?;
        match record {
            Record::Data { offset, value } => pieces.push((base + u32::from(offset), value)),
            Record::ExtendedSegmentAddress(segment) => base = u32::from(segment) << 4,
            Record::ExtendedLinearAddress(upper) => base = u32::from(upper) << 16,
            Record::EndOfFile => ended = true,
            Record::StartSegmentAddress { .. } | Record::StartLinearAddress(_) => {}
        }
    }
    if !ended {
        return Err("no end-of-file record".into());
    }
    let first = pieces.iter().map(|piece| piece.0).min().unwrap_or(0);
    let end = pieces.iter().map(|(at, value)| *at as usize + value.len()).max().unwrap_or(0);
    if end > BANK_LEN {
        return Err(format!("data up to {end:X}h, a bank ends at 10000h"));
    }
    let mut bytes = vec![FILL; end - first as usize];
    for (at, value) in pieces {
        let at = (at - first) as usize;
        if let Some(room) = bytes.get_mut(at..at + value.len()) {
            room.copy_from_slice(&value);
        }
    }
    Ok((first, bytes))
}

/// Writes an image that begins at `offset`.
pub(crate) fn write(path: &Path, wanted: Option<Format>, offset: u32, bytes: &[u8]) -> Result<(), Exit> {
    let name = path.display().to_string();
    let content = match format(path, wanted) {
        Format::Bin => bytes.to_vec(),
        Format::Hex => to_hex(offset, bytes).map_err(|error| Exit::file(&name, &error))?.into_bytes(),
    };
    std::fs::write(path, content).map_err(|error| Exit::file(&name, &error))
}

fn to_hex(offset: u32, bytes: &[u8]) -> Result<String, String> {
    let mut records = vec![Record::ExtendedSegmentAddress(0)];
    for (line, value) in bytes.chunks(LINE).enumerate() {
        let at = u16::try_from(offset as usize + line * LINE).map_err(|_| "image passes the bank's end")?;
        records.push(Record::Data { offset: at, value: value.to_vec() });
    }
    records.push(Record::EndOfFile);
    let text = ihex::create_object_file_representation(&records).map_err(|error| error.to_string())?;
    Ok(text + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intel_hex_comes_back() {
        let bytes: Vec<u8> = (0..=255).chain(0..77).collect();
        for offset in [0, 0x1234, 0x1_0000 - 333] {
            assert_eq!(parse_hex(&to_hex(offset, &bytes).unwrap()), Ok((offset, bytes.clone())));
        }
        assert!(to_hex(0, &[0; 20]).unwrap().starts_with(":020000020000FC\n"));
    }

    #[test]
    fn segments_gaps_and_errors() {
        let text = ":020000020010EC\n:02000000AABB99\n:02000400CCDD51\n:00000001FF\n";
        assert_eq!(parse_hex(text), Ok((0x100, vec![0xAA, 0xBB, 0xFF, 0xFF, 0xCC, 0xDD])));
        assert!(parse_hex(":02000000AABB98\n:00000001FF\n").unwrap_err().starts_with("line 1: "));
        assert_eq!(parse_hex(":02000000AABB99\n"), Err("no end-of-file record".into()));
        assert!(parse_hex(":020000040001F9\n:02000000AABB99\n:00000001FF\n").is_err());
    }
}
