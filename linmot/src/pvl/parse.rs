//! The reader, line by line.

use super::row::{column, hex, is_separator, number, values};
use super::{Event, Excerpt, Problem, Severity};
use crate::curve::{CurveError, INFO_WORDS, InfoBlock};
use crate::upid::{Layer, TreeIdentity, Upid};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    Outside,
    Parameters,
    ParameterRows,
    Curve,
    CurveInfo,
    CurveData,
    Unknown,
}

/// Reads a file line by line.
///
/// Give it every line without its end, then call [`finish`](Self::finish). A file whose events
/// include no problem of [`Severity::Error`] is complete and consistent; check that before anything
/// goes to a drive.
#[derive(Debug, Clone)]
pub struct Parser {
    line: usize,
    place: Place,
    began: bool,
    stray: bool,
    objects: usize,
    layer: Option<u32>,
    identity: [Option<u32>; 3],
    rows: usize,
    columns: (usize, usize),
    curve_id: Option<u32>,
    data_size: Option<u32>,
    info: [u32; INFO_WORDS],
    info_words: usize,
    curve: Option<InfoBlock>,
    data_read: bool,
    seen_curves: u128,
    seen: [u64; 1024],
}

impl Default for Parser {
    fn default() -> Self {
        Self::new()
    }
}

impl Parser {
    /// Nothing read.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            line: 0,
            place: Place::Outside,
            began: false,
            stray: false,
            objects: 0,
            layer: None,
            identity: [None; 3],
            rows: 0,
            columns: (1, 2),
            curve_id: None,
            data_size: None,
            info: [0; INFO_WORDS],
            info_words: 0,
            curve: None,
            data_read: false,
            seen_curves: 0,
            seen: [0; 1024],
        }
    }

    /// Lines read so far.
    #[must_use]
    pub const fn lines(&self) -> usize {
        self.line
    }

    /// Takes the next line.
    pub fn line(&mut self, text: &str, sink: &mut impl FnMut(Event)) {
        self.line += 1;
        let text = if self.line == 1 { text.trim_start_matches('\u{FEFF}') } else { text };
        let text = text.trim();
        if text.is_empty() {
            return;
        }
        let bare = text.strip_prefix('@').unwrap_or(text);
        let end =
            bare.find(|c: char| is_separator(c) || c == ' ' || c == '=' || c == ':').unwrap_or(bare.len());
        let (word, rest) = bare.split_at(end);
        let value =
            rest.trim_start_matches(|c: char| is_separator(c) || c == ' ' || c == '=' || c == ':').trim();
        if !self.began {
            self.began = true;
            if !word.eq_ignore_ascii_case("FileType") || !value.eq_ignore_ascii_case("PVL") {
                self.problem(sink, Severity::Error, Problem::FileType(Excerpt::of(text)));
            }
        }
        if self.keyword(word, value, bare, sink) {
            self.stray = false;
        } else {
            self.row(text, sink);
        }
    }

    /// The file has ended.
    pub fn finish(&mut self, sink: &mut impl FnMut(Event)) {
        if self.place != Place::Outside {
            self.problem(sink, Severity::Error, Problem::Truncated);
        } else if self.objects == 0 {
            self.problem(sink, Severity::Error, Problem::Empty);
        }
        self.place = Place::Outside;
    }

    fn problem(&self, sink: &mut impl FnMut(Event), severity: Severity, problem: Problem) {
        sink(Event::Problem { line: self.line.max(1), severity, problem });
    }

    /// Returns whether the line was one.
    fn keyword(&mut self, word: &str, value: &str, bare: &str, sink: &mut impl FnMut(Event)) -> bool {
        let is = |name: &str| word.eq_ignore_ascii_case(name);
        let wrong = Severity::Error;
        if is("FileType")
            || is("TreeFileName")
            || is("Revision")
            || is("CurveName")
            || is("InfoBlockByteSize")
        {
        } else if is("FormatVersion") {
            if number(value) != Some(1) {
                self.problem(sink, Severity::Warning, Problem::FormatVersion);
            }
        } else if is("StartObject") {
            if self.place != Place::Outside {
                self.problem(sink, wrong, Problem::Nesting(Excerpt::of(bare)));
            }
            self.start_object(value, sink);
        } else if is("EndObject") {
            let inside = matches!(self.place, Place::ParameterRows | Place::CurveInfo | Place::CurveData);
            if inside || self.place == Place::Outside {
                self.problem(sink, wrong, Problem::Nesting(Excerpt::of(bare)));
            }
            if inside {
                self.end_block(sink);
            }
            if self.place == Place::Curve && !self.data_read {
                self.problem(
                    sink,
                    wrong,
                    match self.curve {
                        Some(info) => Problem::Curve(CurveError::Count { said: info.setpoints, found: 0 }),
                        None => Problem::InfoWords(0),
                    },
                );
            }
            self.place = Place::Outside;
        } else if is("StartData") {
            match self.place {
                Place::Parameters => self.start_rows(sink),
                Place::Curve => {
                    if self.curve.is_none() {
                        self.problem(sink, wrong, Problem::NoInfo);
                    }
                    if core::mem::replace(&mut self.data_read, true) {
                        self.problem(sink, wrong, Problem::Nesting(Excerpt::of(bare)));
                    }
                    (self.place, self.rows, self.columns) = (Place::CurveData, 0, (1, 1));
                }
                Place::Unknown => {}
                _ => self.problem(sink, wrong, Problem::Nesting(Excerpt::of(bare))),
            }
        } else if is("StartInfo") {
            match self.place {
                Place::Curve => {
                    if self.curve.is_some() {
                        self.problem(sink, wrong, Problem::Nesting(Excerpt::of(bare)));
                    }
                    (self.place, self.info_words, self.columns) = (Place::CurveInfo, 0, (1, 1));
                }
                Place::Unknown => {}
                _ => self.problem(sink, wrong, Problem::Nesting(Excerpt::of(bare))),
            }
        } else if is("EndData") || is("EndInfo") {
            let matches = match self.place {
                Place::ParameterRows | Place::CurveData => is("EndData"),
                Place::CurveInfo => is("EndInfo"),
                Place::Unknown => true,
                _ => false,
            };
            if !matches {
                self.problem(sink, wrong, Problem::Nesting(Excerpt::of(bare)));
            }
            self.end_block(sink);
        } else if word.len() > 3
            && word.get(..3).is_some_and(|col| col.eq_ignore_ascii_case("col"))
            && word.get(3..).is_some_and(|n| n.parse::<usize>().is_ok())
        {
            self.column_names(bare);
        } else {
            let field = match self.place {
                Place::Parameters if is("TreeLayer") => &mut self.layer,
                Place::Parameters if is("TreeID") => &mut self.identity[0],
                Place::Parameters if is("MainVersion") => &mut self.identity[1],
                Place::Parameters if is("SubVersion") => &mut self.identity[2],
                Place::Curve if is("CurveID") => &mut self.curve_id,
                Place::Curve if is("DataBlockByteSize") => &mut self.data_size,
                _ => return false,
            };
            *field = number(value);
            if field.is_none() {
                self.problem(sink, wrong, Problem::Field(Excerpt::of(value)));
            }
        }
        true
    }

    fn start_object(&mut self, kind: &str, sink: &mut impl FnMut(Event)) {
        if kind.eq_ignore_ascii_case("Parameter") {
            (self.place, self.layer, self.identity) = (Place::Parameters, None, [None; 3]);
            self.objects += 1;
        } else if kind.eq_ignore_ascii_case("Curve") {
            (self.place, self.curve_id, self.data_size, self.curve) = (Place::Curve, None, None, None);
            self.data_read = false;
            self.objects += 1;
        } else {
            self.place = Place::Unknown;
            self.problem(sink, Severity::Warning, Problem::Object(Excerpt::of(kind)));
        }
    }

    fn start_rows(&mut self, sink: &mut impl FnMut(Event)) {
        (self.place, self.rows, self.columns) = (Place::ParameterRows, 0, (1, 2));
        let layer = self.layer.and_then(Layer::from_number);
        if layer.is_none() {
            self.problem(sink, Severity::Error, Problem::Layer);
        }
        for (field, name) in self.identity.iter().zip(["TreeID", "MainVersion", "SubVersion"]) {
            if field.is_none() {
                self.problem(sink, Severity::Error, Problem::Missing(name));
            }
        }
        let [tree_id, main_version, sub_version] = self.identity.map(Option::unwrap_or_default);
        sink(Event::Section { layer, identity: TreeIdentity { tree_id, main_version, sub_version } });
    }

    fn end_block(&mut self, sink: &mut impl FnMut(Event)) {
        match self.place {
            Place::ParameterRows => {
                sink(Event::EndSection { parameters: self.rows });
                self.place = Place::Parameters;
            }
            Place::CurveInfo => {
                self.place = Place::Curve;
                self.end_info(sink);
            }
            Place::CurveData => {
                if let Some(info) = self.curve {
                    if usize::from(info.setpoints) != self.rows {
                        let error = CurveError::Count { said: info.setpoints, found: self.rows };
                        self.problem(sink, Severity::Error, Problem::Curve(error));
                    }
                    sink(Event::EndCurve { setpoints: self.rows });
                }
                self.place = Place::Curve;
            }
            _ => {}
        }
    }

    fn end_info(&mut self, sink: &mut impl FnMut(Event)) {
        if self.info_words != INFO_WORDS {
            return self.problem(sink, Severity::Error, Problem::InfoWords(self.info_words));
        }
        let info = InfoBlock::parse(&self.info);
        if let Err(error) = info.check() {
            self.problem(sink, Severity::Error, Problem::Curve(error));
        }
        match self.curve_id {
            Some(said) if said != u32::from(info.id) => {
                self.problem(sink, Severity::Warning, Problem::CurveId { said, found: info.id });
            }
            _ => {}
        }
        match self.data_size {
            Some(said) if said != info.data_size() => {
                let found = info.data_size();
                self.problem(sink, Severity::Warning, Problem::DataSize { said, found });
            }
            _ => {}
        }
        let bit = 1u128.checked_shl(info.id.into()).unwrap_or(0);
        if self.seen_curves & bit != 0 {
            self.problem(sink, Severity::Error, Problem::CurveTwice(info.id));
        }
        self.seen_curves |= bit;
        self.curve = Some(info);
        sink(Event::Curve(info));
    }

    /// `Col1 UPID @Col2 Value …`, on one line or several.
    fn column_names(&mut self, bare: &str) {
        let mut column = None;
        for word in bare.split(|c: char| is_separator(c) || c == ' ' || c == '@' || c == '=') {
            let digits = word.get(..3).filter(|col| col.eq_ignore_ascii_case("col")).and(word.get(3..));
            if let Some(position) = digits.and_then(|digits| digits.parse().ok()) {
                column = Some(position);
            } else if let Some(position) = column {
                if word.eq_ignore_ascii_case("UPID") {
                    self.columns.0 = position;
                } else if word.eq_ignore_ascii_case("Value") {
                    self.columns.1 = position;
                }
            }
        }
    }

    fn row(&mut self, text: &str, sink: &mut impl FnMut(Event)) {
        match self.place {
            Place::ParameterRows => self.parameter(text, sink),
            Place::CurveInfo | Place::CurveData => {
                for (column, word) in (1..).zip(values(text)) {
                    match hex(word, 8) {
                        Some(value) => self.curve_value(value, sink),
                        None => {
                            let found = Excerpt::of(word);
                            self.problem(sink, Severity::Error, Problem::Number { column, digits: 8, found });
                        }
                    }
                }
            }
            Place::Unknown => {}
            Place::Outside | Place::Parameters | Place::Curve => {
                // Of a run of such lines one is enough: a file of another kind has nothing else.
                if !core::mem::replace(&mut self.stray, true) {
                    self.problem(sink, Severity::Warning, Problem::Stray(Excerpt::of(text)));
                }
            }
        }
    }

    fn curve_value(&mut self, value: u32, sink: &mut impl FnMut(Event)) {
        if self.place == Place::CurveInfo {
            if let Some(word) = self.info.get_mut(self.info_words) {
                *word = value;
            }
            self.info_words += 1;
        } else {
            self.rows += 1;
            if self.curve.is_some() {
                sink(Event::Setpoint(value as i32));
            }
        }
    }

    fn parameter(&mut self, text: &str, sink: &mut impl FnMut(Event)) {
        let (upid_column, value_column) = self.columns;
        let (upid_text, value_text) = (column(text, upid_column), column(text, value_column));
        let upid =
            upid_text.and_then(|text| hex(text, 4)).and_then(|upid| u16::try_from(upid).ok()).map(Upid);
        let value = value_text.and_then(|text| hex(text, 8));
        let (Some(upid), Some(value)) = (upid, value) else {
            let (column, digits, text) =
                if upid.is_none() { (upid_column, 4, upid_text) } else { (value_column, 8, value_text) };
            let found = Excerpt::of(text.unwrap_or_default());
            return self.problem(sink, Severity::Error, Problem::Number { column, digits, found });
        };
        let layer = self.layer.and_then(Layer::from_number);
        if layer.is_some() && upid.layer() != layer {
            self.problem(sink, Severity::Warning, Problem::OtherLayer(upid));
        }
        let bit = 1 << (upid.0 % 64);
        if let Some(word) = self.seen.get_mut(usize::from(upid.0 / 64)) {
            let twice = *word & bit != 0;
            *word |= bit;
            if twice {
                self.problem(sink, Severity::Error, Problem::Twice(upid));
            }
        }
        self.rows += 1;
        sink(Event::Parameter { upid, value });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::{
        string::{String, ToString},
        vec::Vec,
    };

    fn read(text: &str) -> Vec<Event> {
        let (mut parser, mut events) = (Parser::new(), Vec::new());
        text.lines().for_each(|line| parser.line(line, &mut |event| events.push(event)));
        parser.finish(&mut |event| events.push(event));
        events
    }

    fn problems(text: &str) -> Vec<(usize, Severity, String)> {
        let problem = |event| match event {
            Event::Problem { line, severity, problem } => Some((line, severity, problem.to_string())),
            _ => None,
        };
        read(text).into_iter().filter_map(problem).collect()
    }

    /// Manual B, figures 12 and 13.
    const FILE: &str = "@FileType PVL
@FormatVersion 1
@StartObject Parameter
@TreeFileName OSTree1100DP_V3S0_b1
@TreeLayer 1
@TreeID 1
@MainVersion 3
@SubVersion 0
@Revision b1
@StartData
@Col1 UPID @Col2 Value @Col3 Caption @Col4 ScaledValue Unit
03E9h, 6F43794Dh, OS\\Drive Name 1, MyCo
03EAh, 6F72746Eh, OS\\Drive Name 2, ntro
@EndData
@EndObject
@StartObject Curve
@CurveName Example Curve
@CurveID 23
@InfoBlockByteSize 72
@DataBlockByteSize 40
@StartInfo
@Col1 Value
00030046h
0004000Ah
6D617845h 5F656C70h 76727543h 00000065h
00000000h
00170000h 00004E20h 0005001Ah 42400000h 0000000Fh
00000000h 00000000h 00000000h 00000000h 00000000h 00000000h
@EndInfo
@StartData
@Col1 Value
00000000h
000075CAh
0001C8F2h 0003D090h 00064DF8h 0008F448h 000B71B0h 000D794Eh 000ECC76h 000F4240h
@EndData
@EndObject
";

    #[test]
    fn the_manuals_figures() {
        let events = read(FILE);
        let identity = TreeIdentity { tree_id: 1, main_version: 3, sub_version: 0 };
        assert_eq!(events[0], Event::Section { layer: Some(Layer::Os), identity });
        assert_eq!(events[1], Event::Parameter { upid: Upid(0x3E9), value: 0x6F43_794D });
        assert_eq!(events[3], Event::EndSection { parameters: 2 });
        let Event::Curve(info) = &events[4] else { panic!("{events:?}") };
        assert_eq!(
            (info.name(), info.id, info.setpoints, info.x_length),
            (&b"Example_Curve"[..], 23, 10, 20_000)
        );
        assert_eq!(events[5..7], [Event::Setpoint(0), Event::Setpoint(0x75CA)]);
        assert_eq!(events[15..], [Event::EndCurve { setpoints: 10 }]);
    }

    #[test]
    fn every_spelling_reads_the_same() {
        let expected = read(FILE);
        assert_eq!(read(&FILE.replace('@', "")), expected);
        assert_eq!(read(&FILE.replace("h,", ",").replace("h\n", "\n").replace("h ", " ")), expected);
        assert_eq!(read(&FILE.replace(", ", ";")), expected);
        assert_eq!(read(&FILE.replace(", ", "\t")), expected);
        assert_eq!(read(&FILE.replace(", ", " ")), expected);
        assert_eq!(read(&FILE.replace('\n', "\r\n")), expected);
        assert_eq!(read(&FILE.to_uppercase()), expected);
        assert_eq!(read(&std::format!("\u{FEFF}{FILE}")), expected);
        let swapped = FILE
            .replace("@Col1 UPID @Col2 Value", "@Col2 UPID\n@Col1 Value")
            .replace("03E9h, 6F43794Dh", "6F43794Dh, 03E9h")
            .replace("03EAh, 6F72746Eh", "6F72746Eh, 03EAh");
        assert_eq!(read(&swapped), expected);
    }

    #[test]
    fn problems_name_their_line() {
        let wrong = Severity::Error;
        let with = |from: &str, to: &str| {
            assert!(FILE.contains(from));
            problems(&FILE.replacen(from, to, 1))
        };
        assert_eq!(problems(FILE), []);
        let column = |n, digits, found| {
            std::format!("column {n}: a hex number of up to {digits} digits expected, {found:?} found")
        };
        assert_eq!(with("03E9h", "103E9h"), [(12, wrong, column(1, 4, "103E9h"))]);
        assert_eq!(with("6F43794D", "XF43794D"), [(12, wrong, column(2, 8, "XF43794Dh"))]);
        assert_eq!(with("03EAh", "03E9h"), [(13, wrong, "UPID 03E9h occurs twice".into())]);
        assert_eq!(
            with("03EAh", "13EAh"),
            [(13, Severity::Warning, "UPID 13EAh is not of this layer".into())]
        );
        assert_eq!(with("@TreeID 1\n", "\n"), [(10, wrong, "TreeID is missing before StartData".into())]);
        assert_eq!(with("@TreeLayer 1", "@TreeLayer 5")[0].2, "TreeLayer 1 to 4 expected before StartData");
        assert_eq!(
            with("@MainVersion 3", "@MainVersion x")[0],
            (7, wrong, "a number expected, \"x\" found".into())
        );
        let count = "curve: the info block says 10 setpoints, 9 are there";
        assert_eq!(with("000075CAh\n", "\n"), [(35, wrong, count.into())]);
        assert_eq!(with("0004000Ah", "")[0].2, "info block of 17 words, 18 expected");
        assert_eq!(with("00170000h", "00770000h")[0].2, "curve: curve ID 119, 1 to 100 expected");
        assert_eq!(with("@CurveID 23", "@CurveID 24")[0].1, Severity::Warning);
        assert_eq!(
            with("@FileType PVL", "")[0],
            (
                2,
                wrong,
                "no PVL file: FileType PVL expected at its beginning, \"@FormatVersion 1\" found".into()
            )
        );
        // Any other text: its kind, where its first line is, and that nothing was found.
        assert_eq!(
            problems("[package]\nname = \"x\"\n\nversion = 1"),
            [
                (1, wrong, "no PVL file: FileType PVL expected at its beginning, \"[package]\" found".into()),
                (1, Severity::Warning, "a keyword such as StartObject expected, \"[package]\" found".into()),
                (4, wrong, "the file has no parameter object and no curve".into()),
            ]
        );
        assert_eq!(with("@EndData", "").len(), 1);
        assert_eq!(
            with("Parameter", "Oscilloscope"),
            [(
                3,
                Severity::Warning,
                "unknown kind of object \"Oscilloscope\", Parameter or Curve expected".into()
            )]
        );
        let bare = "FileType PVL\nStartObject Curve\nEndObject";
        assert_eq!(problems(bare), [(3, wrong, "info block of 0 words, 18 expected".into())]);
        let data = FILE.find("@StartData\n@Col1 Value").unwrap();
        let without = std::format!("{}@EndObject\n", &FILE[..data]);
        assert_eq!(problems(&without)[0].2, "curve: the info block says 10 setpoints, 0 are there");
        let cut = &FILE[..FILE.find("000ECC76h").unwrap()];
        assert_eq!(problems(cut), [(34, wrong, "the file ends inside an object".into())]);
        assert_eq!(problems("FileType PVL")[0].2, "the file has no parameter object and no curve");
    }

    proptest! {
        #[test]
        fn any_text_is_survived(lines in proptest::collection::vec("[@a-zA-Z0-9h,; \t]{0,30}", 0..40)) {
            read(&lines.join("\n"));
        }
    }
}
