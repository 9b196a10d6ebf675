//! Recognising a format from the content.

use super::CaptureError;
use super::lb2::hex_line;
use super::pcap::is_pcap;
use super::reader::{Parsed, TextParser};
use super::record::{Buses, Record, Time};

/// How much of the content is looked at.
pub(super) const LOOK_AHEAD: usize = 64 * 1024;
/// How a text may begin that is UTF-8.
pub(super) const BYTE_ORDER_MARK: &[u8] = b"\xEF\xBB\xBF";

/// How compressed files begin.
const COMPRESSED: [(&[u8], &str); 5] = [
    (b"\x1F\x8B", "gzip"),
    (b"PK\x03\x04", "zip"),
    (b"\xFD7zXZ\0", "xz"),
    (b"BZh", "bzip2"),
    (b"\x28\xB5\x2F\xFD", "zstd"),
];

/// A capture format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// candump logs and screen text.
    Candump,
    /// Vector `.asc`.
    Asc,
    /// PEAK `.trc`, any version.
    Trc,
    /// IXXAT trace text and column dumps.
    Ixxat,
    /// pcap or pcapng.
    Pcap,
    /// Bytes of an LB2 line.
    Lb2Raw,
    /// Bytes of an LB2 line as hex text.
    Lb2Hex,
}

impl Format {
    /// The name that people use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Candump => "candump",
            Self::Asc => "asc",
            Self::Trc => "trc",
            Self::Ixxat => "ixxat",
            Self::Pcap => "pcap",
            Self::Lb2Raw => "lb2",
            Self::Lb2Hex => "lb2-hex",
        }
    }
}

/// The format of a capture that begins so.
pub(super) fn recognise(start: &[u8]) -> Result<Format, CaptureError> {
    if is_pcap(start) {
        return Ok(Format::Pcap);
    }
    let text = start.strip_prefix(BYTE_ORDER_MARK).unwrap_or(start);
    if text.iter().all(u8::is_ascii_whitespace) {
        return Ok(Format::Candump);
    }
    if let [0xFF, 0xFE, _, 0, ..] | [0xFE, 0xFF, 0, ..] = *start {
        return Err(CaptureError::Utf16);
    }
    if let Some((_, by)) = COMPRESSED.iter().find(|(magic, _)| start.starts_with(magic)) {
        return Err(CaptureError::Compressed(by));
    }
    let lines = || text.split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii);
    for line in lines() {
        if line.starts_with(b";$FILEVERSION=") {
            return Ok(Format::Trc);
        }
        if line.starts_with(b"base hex") || line.starts_with(b"base dec") {
            return Ok(Format::Asc);
        }
        if line.starts_with(b"ASCII Trace IXXAT") || line.starts_with(b"\"ASCII Trace IXXAT") {
            return Ok(Format::Ixxat);
        }
    }
    let mut record = Record::EMPTY;
    let mut buses = Buses::default();
    let mut best = (0, Format::Candump);
    for format in [Format::Candump, Format::Trc, Format::Ixxat, Format::Asc] {
        let Some(mut parser) = TextParser::new(format) else { continue };
        let frames =
            lines().filter(|line| parser.line(line, &mut record, &mut buses) == Parsed::Frame).count();
        if frames > best.0 {
            best = (frames, format);
        }
    }
    if best.0 == 0 && !is_text(text) {
        return Ok(Format::Lb2Raw);
    }
    let hex = lines().filter(|line| hex_line(line).is_some_and(|line| !line.bytes.is_empty())).count();
    if hex > best.0 {
        best = (hex, Format::Lb2Hex);
    }
    if best.0 > 0 { Ok(best.1) } else { Err(CaptureError::Unrecognised(super::reader::excerpt(first(text)))) }
}

/// Whether the times of a candump capture that begins so are differences (`candump -td`): nothing in a line
/// says so, but times since one fixed point do not go back again and again. A few that do are frames of
/// several buses that were not read in order.
pub(super) fn has_deltas(start: &[u8]) -> bool {
    const OFTEN: usize = 8;
    let Some(mut parser) = TextParser::new(Format::Candump) else { return false };
    let (mut record, mut buses) = (Record::EMPTY, Buses::default());
    let (mut last, mut times, mut back) = (Time(i64::MIN), 0, 0);
    for line in start.split(|&byte| byte == b'\n') {
        if parser.line(line.trim_ascii_end(), &mut record, &mut buses) != Parsed::Frame {
            continue;
        }
        let Some(time) = record.time else { continue };
        if time >= Time::EPOCH {
            return false;
        }
        back += usize::from(time < last);
        times += 1;
        last = time;
    }
    back * OFTEN > times
}

fn first(text: &[u8]) -> &[u8] {
    text.split(|&byte| byte == b'\n').find(|line| !line.trim_ascii().is_empty()).unwrap_or(&[])
}

/// Text has no control characters but blanks, line ends and the escape of colours. Letters beyond
/// ASCII appear in names and comments.
fn is_text(bytes: &[u8]) -> bool {
    let control = |byte: &u8| *byte < b' ' && !matches!(byte, b'\t' | b'\n' | b'\r' | 0x1B | 0x0C);
    let beyond = bytes.iter().filter(|&&byte| byte >= 0x7F).count();
    !bytes.iter().any(control) && (beyond == 0 || beyond * 4 < bytes.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_told_apart() {
        for (content, format) in [
            (&b"(1.0) can0 123#11\n"[..], Format::Candump),
            (b"  can0  123   [1]  11\n", Format::Candump),
            (b"123   [1]  11\n", Format::Candump),
            (b";$FILEVERSION=1.1\n", Format::Trc),
            (b"   64     18153.283 DT     0670 Rx 8  C2 50 1F 01 78 87 00 00\n", Format::Trc),
            (b"     1)       144.5  Rx         0728  1  7F \n", Format::Trc),
            (b"date Mon\nbase hex  timestamps absolute\n", Format::Asc),
            (b"CAN1  67F Tx SD  8  2F 03 10 00 FF 00 00 00\n", Format::Ixxat),
            (b"\"Time\",\"Identifier (hex)\",\"Format\",\"Flags\",\"Data (hex)\"\n\"0:0:1.5\",\"181\",\"Std\",\"\",\"11\"\n", Format::Ixxat),
            (b"82 96 02 40 42\n", Format::Lb2Hex),
            (b"0.125 8296024042\n", Format::Lb2Hex),
            (b"\x82\x96\x02\x40\x42", Format::Lb2Raw),
            (b"\x00\x01\x02", Format::Lb2Raw),
            // A log whose end was not yet on the disk when the power went.
            (b"(1.0) can0 123#11\n\0\0\0\0\0\0", Format::Candump),
            // One byte of noise in it, and what could begin a telegram.
            (b"(1.0) can0 123#11\n(1.1) can0 1\x0223#11 \x82\x96\n", Format::Candump),
            (b"\xD4\xC3\xB2\xA1", Format::Pcap),
            (b"", Format::Candump),
        ] {
            assert_eq!(recognise(content).unwrap(), format, "{}", String::from_utf8_lossy(content));
        }
        for utf16 in [b"\xFF\xFE(\x001\0", b"\xFE\xFF\0(\x001"] {
            assert!(matches!(recognise(utf16), Err(CaptureError::Utf16)));
        }
        let error = recognise(b"\x1F\x8B\x08\0 \x82\x96").unwrap_err();
        assert_eq!(error.to_string(), "compressed with gzip: unpack it first");
        let error = recognise(b"\nDear reader,\n").unwrap_err();
        assert_eq!(error.to_string(), "no known capture format; it begins with \"Dear reader,\"");
    }
}
