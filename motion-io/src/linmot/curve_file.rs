//! Curves as CSV: a head line of attributes, then one setpoint a line (project-defined).
//!
//! `# name=… length_ms=… unit=0.1um` is all that a file made by hand needs; a cam has `length=…` in
//! encoder increments in place of `length_ms`. What [`write()`] writes has all that the info block has, and
//! `setpoints=…`, by which a file that was cut off is known.
//! A value lies between quotes where it would be taken for something else.

use std::io::{self, BufRead, Write};

use linmot::curve::{CurveError, InfoBlock, MAX_SETPOINTS, ObjectType, Unit};
use linmot::pvl::{Encoding, LineDecoder};

use super::lines::Lines;

/// Attributes of the head line.
const KEYS: [&str; 9] =
    ["name", "length_ms", "length", "unit", "type", "x_unit", "y_unit", "wizard", "setpoints"];
/// What a head line looks like.
const HEAD: &str = "# name=… length_ms=… unit=0.1um";
/// Characters of a faulty line that an error shows.
const SHOWN: usize = 40;

/// Why a file is no curve.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CurveFileError {
    /// It cannot be read.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// A line is not what it should be.
    #[error("line {line}: {expected} expected, {found:?} found")]
    Line {
        /// Counted from 1.
        line: usize,
        /// What should have come.
        expected: &'static str,
        /// What came, cut off if it is long.
        found: String,
    },
    /// More setpoints than a curve can have.
    #[error("line {line}: 2 to {MAX_SETPOINTS} setpoints expected, here is one more")]
    TooMany {
        /// That of the first setpoint too many.
        line: usize,
    },
    /// The head line says another number of setpoints than there are.
    #[error("line 1 says setpoints={said}, {found} are there: the file was cut off or changed")]
    Count {
        /// In the head line.
        said: usize,
        /// In the file.
        found: usize,
    },
    /// The head line says the number of setpoints, and the last line may not be whole.
    #[error("the last line has no end: the file may be cut off")]
    CutOff,
    /// A drive would not take it.
    #[error(transparent)]
    Curve(#[from] CurveError),
}

fn wrong(line: usize, expected: &'static str, found: &str) -> CurveFileError {
    let mut shown: String = found.chars().take(SHOWN).collect();
    if shown.len() < found.len() {
        shown.push('…');
    }
    CurveFileError::Line { line, expected, found: shown }
}

/// Writes a curve.
///
/// # Errors
/// Those of `out`.
pub fn write(out: &mut impl Write, info: &InfoBlock, setpoints: &[i32]) -> io::Result<()> {
    let name = Encoding::Windows1252.decode(info.name()).replace(char::is_control, "?");
    let plain = !name.contains(['=', '"']) && name.trim() == name;
    let name = if plain { name } else { format!("\"{}\"", name.replace('"', "\"\"")) };
    write!(out, "# name={name} ")?;
    match info.x_unit {
        Unit::TIME => write!(out, "length_ms={}", f64::from(info.x_length) / 100.0)?,
        _ => write!(out, "length={}", info.x_length)?,
    }
    let unit = if info.y_unit == Unit::POSITION { "0.1um" } else { "raw" };
    let InfoBlock { object_type: ObjectType(kind), x_unit: Unit(x), y_unit: Unit(y), .. } = info;
    write!(
        out,
        " unit={unit} type=0x{kind:04X} x_unit=0x{x:04X} y_unit=0x{y:04X} wizard={}",
        info.wizard_type
    )?;
    for parameter in info.wizard {
        write!(out, ":{parameter}")?;
    }
    writeln!(out, " setpoints={}", setpoints.len())?;
    setpoints.iter().try_for_each(|setpoint| writeln!(out, "{setpoint}"))
}

/// Reads a curve that shall have this ID, and checks that a drive would take it.
///
/// # Errors
/// [`CurveFileError`]: the first line that is wrong, and what was expected there.
pub fn read(file: &mut impl BufRead, id: u16) -> Result<(InfoBlock, Vec<i32>), CurveFileError> {
    let (mut lines, mut decoder) = (Lines::new(file), LineDecoder::new());
    let first =
        lines.next_line()?.map(|(_, line)| decoder.decode(line).trim().to_owned()).unwrap_or_default();
    let Some(head) = first.strip_prefix('#') else { return Err(wrong(1, HEAD, &first)) };
    let head = Head::parse(head.trim())?;
    let mut setpoints = Vec::new();
    while let Some((number, line)) = lines.next_line()? {
        let text = decoder.decode(line);
        let text = text.trim().trim_end_matches([',', ';']);
        if text.is_empty() || text.starts_with('#') {
            continue;
        }
        let setpoint =
            text.parse().map_err(|_| wrong(number, "a setpoint, -2147483648 to 2147483647,", text))?;
        if setpoints.len() == usize::from(MAX_SETPOINTS) {
            return Err(CurveFileError::TooMany { line: number });
        }
        setpoints.push(setpoint);
    }
    match head.parsed("setpoints", "setpoints=NUMBER", |value| value.parse().ok())? {
        Some(said) if said != setpoints.len() => {
            return Err(CurveFileError::Count { said, found: setpoints.len() });
        }
        Some(_) if !lines.ended() => return Err(CurveFileError::CutOff),
        _ => {}
    }
    let info = head.info(id, setpoints.len() as u16)?;
    info.check()?;
    Ok((info, setpoints))
}

/// The attributes of the head line.
struct Head<'a> {
    /// The line without its `#`.
    text: &'a str,
    values: Vec<(&'static str, String)>,
}

impl<'a> Head<'a> {
    /// A value is what is between its quotes, or up to the next attribute. Each attribute comes once, and none
    /// that is unknown: an equals sign in a value without quotes belongs to one.
    fn parse(text: &'a str) -> Result<Self, CurveFileError> {
        let mut values: Vec<(&'static str, String)> = Vec::new();
        let mut rest = text;
        while let Some((key, at)) = next_key(rest) {
            none_unknown(rest.get(..at).unwrap_or_default())?;
            let value = rest.get(at + key.len() + 1..).unwrap_or_default();
            let (value, behind) = match value.strip_prefix('"') {
                Some(quoted) => unquoted(quoted),
                None => {
                    let (value, behind) = value.split_at(next_key(value).map_or(value.len(), |(_, at)| at));
                    none_unknown(value)?;
                    (value.trim().to_owned(), behind)
                }
            };
            if values.iter().any(|(other, _)| *other == key) {
                return Err(wrong(1, "each attribute once", &format!("{key}={value}")));
            }
            values.push((key, value));
            rest = behind;
        }
        none_unknown(rest)?;
        let head = Self { text, values };
        if head.get("length_ms").is_some() && head.get("length").is_some() {
            return Err(wrong(1, "length_ms=MILLISECONDS or length=INCREMENTS, one of them,", text));
        }
        Ok(head)
    }

    fn get(&self, wanted: &str) -> Option<&str> {
        self.values.iter().find(|(key, _)| *key == wanted).map(|(_, value)| value.as_str())
    }

    /// The value of an attribute, which must be as `expected` says if it is there.
    fn parsed<T>(
        &self,
        key: &str,
        expected: &'static str,
        parse: impl FnOnce(&str) -> Option<T>,
    ) -> Result<Option<T>, CurveFileError> {
        self.get(key)
            .map(|value| parse(value).ok_or_else(|| wrong(1, expected, &format!("{key}={value}"))))
            .transpose()
    }

    fn info(&self, id: u16, setpoints: u16) -> Result<InfoBlock, CurveFileError> {
        let cam = self.get("length").is_some() || self.get("type") == Some("cam");
        let length = if cam {
            self.parsed("length", "length=INCREMENTS", |value| value.parse().ok())?
        } else {
            self.parsed(
                "length_ms",
                "length_ms=MILLISECONDS, 0.01 to 42949672.95 in steps of 0.01,",
                |value| {
                    // In 10 µs.
                    let exact = value.parse::<f64>().ok()? * 100.0;
                    let length = exact.round();
                    let fits = (1.0..=f64::from(u32::MAX)).contains(&length) && (exact - length).abs() < 1e-5;
                    fits.then_some(length as u32)
                },
            )?
        };
        let missing = if cam { "length=INCREMENTS" } else { "length_ms=MILLISECONDS" };
        let length = length.ok_or_else(|| wrong(1, missing, self.text))?;
        let build = if cam { InfoBlock::cam } else { InfoBlock::position_over_time };
        let mut info = build(id, "", length, setpoints)?;
        self.parsed("unit", "unit=0.1um", |value| matches!(value, "0.1um" | "raw").then_some(()))?;
        if let Some(name) = self.get("name") {
            let bytes = Encoding::Windows1252.encode_exactly(name);
            let bytes =
                bytes.filter(|bytes| bytes.len() < info.name.len() && !name.contains(char::is_control));
            let bytes =
                bytes.ok_or_else(|| wrong(1, "a name of up to 21 characters of Windows-1252", name))?;
            info.name.iter_mut().zip(bytes).for_each(|(room, byte)| *room = byte);
        }
        let kind = self.parsed("type", "type=0x0003, type=0x0103 or type=cam", |value| match value {
            "cam" => Some(ObjectType::POSITION_ENCODER),
            _ => number(value).map(ObjectType),
        })?;
        info.object_type = kind.unwrap_or(info.object_type);
        info.x_unit = self.parsed("x_unit", "x_unit=0x001A", number)?.map_or(info.x_unit, Unit);
        info.y_unit = self.parsed("y_unit", "y_unit=0x0005", number)?.map_or(info.y_unit, Unit);
        let wizard = self.parsed("wizard", "wizard=TYPE:PAR1:…:PAR7", |value| {
            let numbers: Vec<u32> =
                value.split(':').map(|number| number.parse().ok()).collect::<Option<_>>()?;
            let (kind, parameters) = numbers.split_first()?;
            Some((u16::try_from(*kind).ok()?, <[u32; 7]>::try_from(parameters).ok()?))
        })?;
        (info.wizard_type, info.wizard) = wizard.unwrap_or_default();
        Ok(info)
    }
}

/// The first attribute that begins in `text`, and where: at its beginning or behind a blank.
fn next_key(text: &str) -> Option<(&'static str, usize)> {
    let begins = |at: usize| at == 0 || text.get(..at).is_some_and(|before| before.ends_with([' ', '\t']));
    let found = text.match_indices('=').find_map(|(equals, _)| {
        let before = text.get(..equals)?;
        KEYS.iter()
            .filter(|key| before.ends_with(**key))
            .map(|key| (*key, equals - key.len()))
            .find(|(_, at)| begins(*at))
    })?;
    Some(found)
}

/// Refuses text between attributes that an unknown one is in.
fn none_unknown(text: &str) -> Result<(), CurveFileError> {
    match text.split_whitespace().find(|word| word.contains('=')) {
        Some(word) => Err(wrong(1, "a known attribute, or quotes around a value with an equals sign,", word)),
        None => Ok(()),
    }
}

/// A quoted value from behind its first quote, and what comes after it; `""` is one quote in it.
fn unquoted(text: &str) -> (String, &str) {
    let mut value = String::new();
    let mut rest = text;
    while let Some((part, behind)) = rest.split_once('"') {
        value.push_str(part);
        match behind.strip_prefix('"') {
            Some(more) => {
                value.push('"');
                rest = more;
            }
            None => return (value, behind),
        }
    }
    value.push_str(rest);
    (value, "")
}

/// Decimal, or hex with `0x`.
fn number(text: &str) -> Option<u16> {
    match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(hex) if hex.bytes().all(|byte| byte.is_ascii_hexdigit()) => u16::from_str_radix(hex, 16).ok(),
        _ => text.parse().ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn again(info: &InfoBlock, setpoints: &[i32]) -> (InfoBlock, Vec<i32>) {
        let mut file = Vec::new();
        write(&mut file, info, setpoints).unwrap();
        read(&mut file.as_slice(), info.id).unwrap()
    }

    #[test]
    fn curves_come_back_from_their_file() {
        for name in ["Move out = fast", "x length=5", " \"quoted\" type=", "", "a unit=mm \"", "tab"] {
            let mut info = InfoBlock::position_over_time(7, name, 20_050, 3).unwrap();
            (info.wizard_type, info.wizard[6]) = (2, 1_000_000);
            assert_eq!(again(&info, &[0, -5, i32::MAX]), (info, vec![0, -5, i32::MAX]), "{name}");
        }
        let cam = InfoBlock::cam(8, "cam", 3600, 2).unwrap();
        assert_eq!(again(&cam, &[1, 2]), (cam, vec![1, 2]));
        let mut umlaut = cam;
        umlaut.name[..2].copy_from_slice(&[0xC3, 0xBC]);
        assert_eq!(again(&umlaut, &[1, 2]), (umlaut, vec![1, 2]));
    }

    #[test]
    fn a_file_made_by_hand() {
        let mut file =
            &b"\xEF\xBB\xBF# name=By hand length_ms=200.5 unit=0.1um\r\n0;\r\n\r\n100\r\n# half way\r\n50"[..];
        let (info, setpoints) = read(&mut file, 9).unwrap();
        assert_eq!((info.name(), info.x_length, info.setpoints), (&b"By hand"[..], 20_050, 3));
        assert_eq!(setpoints, [0, 100, 50]);
    }

    #[test]
    fn a_file_that_was_cut_off_is_no_shorter_curve() {
        let info = InfoBlock::position_over_time(7, "seven", 20_000, 3).unwrap();
        let mut file = Vec::new();
        write(&mut file, &info, &[0, -5, 1_000_000]).unwrap();
        let head = file.iter().position(|byte| *byte == b'\n').unwrap();
        for len in head..file.len() {
            let error = read(&mut &file[..len], 7).unwrap_err().to_string();
            let half_a_number = error.contains("line 3: a setpoint");
            assert!(error.contains("cut off") || half_a_number, "{len} of {} bytes: {error}", file.len());
        }
        assert!(read(&mut file.as_slice(), 7).is_ok());
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        let many = format!("# length_ms=1\n{}", "7\n".repeat(20_000));
        let long = format!("# length_ms=1\n{}", "7".repeat(5000));
        for (content, words) in [
            ("", "line 1: # name=… length_ms=… unit=0.1um expected, \"\" found"),
            ("0\n1\n", "line 1: # name=… length_ms=… unit=0.1um expected, \"0\" found"),
            ("# length_ms=1\n0\nx\n", "line 3: a setpoint, -2147483648 to 2147483647, expected, \"x\" found"),
            ("# length_ms=1\n0\n2147483648\n", "\"2147483648\" found"),
            ("# length_ms=1\n0.5\n1\n", "line 2"),
            ("# length_ms=1\n0\n", "1 setpoints, 2 to 16383 expected"),
            ("# name=x\n0\n1\n", "length_ms=MILLISECONDS expected, \"name=x\" found"),
            ("# length_ms=-1\n0\n1\n", "\"length_ms=-1\" found"),
            ("# length_ms=NaN\n0\n1\n", "\"length_ms=NaN\" found"),
            ("# length=1.5\n0\n1\n", "length=INCREMENTS expected, \"length=1.5\" found"),
            ("# length_ms=1 unit=mm\n0\n1\n", "unit=0.1um expected, \"unit=mm\" found"),
            (
                "# length_ms=0.0149\n0\n1\n",
                "0.01 to 42949672.95 in steps of 0.01, expected, \"length_ms=0.0149\"",
            ),
            (
                "# length_ms=1 lenght=5\n0\n1\n",
                "a known attribute, or quotes around a value with an equals sign",
            ),
            ("# name=a units=mm length_ms=1\n0\n1\n", "expected, \"units=mm\" found"),
            ("# x=1 length_ms=1\n0\n1\n", "\"x=1\" found"),
            ("# name=\"a\" x=1\n0\n1\n", "\"x=1\" found"),
            (
                "# length_ms=1 name=a length_ms=2\n0\n1\n",
                "each attribute once expected, \"length_ms=2\" found",
            ),
            ("# length_ms=1 length=2\n0\n1\n", "length_ms=MILLISECONDS or length=INCREMENTS, one of them,"),
            ("# length_ms=1 type=0x1003\n0\n1\n", "object type 1003h"),
            ("# length_ms=1 x_unit=0x10000\n0\n1\n", "x_unit=0x001A expected"),
            ("# length_ms=1 wizard=0:1\n0\n1\n", "wizard=TYPE:PAR1:…:PAR7 expected"),
            ("# length_ms=1 setpoints=x\n0\n1\n", "setpoints=NUMBER expected, \"setpoints=x\" found"),
            ("# length_ms=1 name=1234567890123456789012\n0\n1\n", "a name of up to 21 characters"),
            (&many, "line 16385: 2 to 16383 setpoints expected, here is one more"),
            (&long, "line 2 is longer than 4096 bytes"),
        ] {
            let message = read(&mut content.as_bytes(), 1).unwrap_err().to_string();
            assert!(message.contains(words), "{message}");
        }
        assert!(read(&mut &b"# length_ms=1\n0\n1\n"[..], 101).unwrap_err().to_string().contains("1 to 100"));
    }
}
