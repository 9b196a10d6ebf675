//! The text layer of EDS and DCF (CiA 306-1, 6.2): sections, entries, comments, line by line.
//!
//! Nothing is interpreted and nothing is lost: the lines of a [`Document`], one after the other, are
//! the file. Names of sections and keys compare without regard to case.

use alloc::vec::Vec;

/// One line of the file, without its end.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Line<'a> {
    /// Counted from 1.
    pub number: u32,
    /// The line as it stands in the file, its end included.
    pub raw: &'a str,
    /// What it is.
    pub kind: LineKind<'a>,
}

/// What a line is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LineKind<'a> {
    /// Nothing, or blanks.
    Blank,
    /// A comment: its first character is `;`, or `#` as some tools write it.
    Comment,
    /// `[name]`.
    Section {
        /// Between the brackets, without blanks at the ends.
        name: &'a str,
        /// What follows the closing bracket.
        rest: &'a str,
    },
    /// `key=value`, both without blanks at the ends.
    Entry {
        /// Before the first `=`.
        key: &'a str,
        /// After it.
        value: &'a str,
    },
    /// None of these.
    Other,
}

/// A section: its header's line and the lines up to the next header.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Section<'a> {
    /// As it stands in the file; empty for what stands before the first header.
    pub name: &'a str,
    /// Line of the header; 0 for what stands before the first header.
    pub line: u32,
    /// The header and all lines that follow.
    pub lines: Vec<Line<'a>>,
}

impl<'a> Section<'a> {
    /// The entries: line, key, value.
    pub fn entries(&self) -> impl Iterator<Item = (u32, &'a str, &'a str)> {
        self.lines.iter().filter_map(|line| match line.kind {
            LineKind::Entry { key, value } => Some((line.number, key, value)),
            _ => None,
        })
    }

    /// Line and value of the last entry of this name.
    #[must_use]
    pub fn entry(&self, name: &str) -> Option<(u32, &'a str)> {
        let found = self.entries().filter(|(_, key, _)| key.eq_ignore_ascii_case(name)).last();
        found.map(|(line, _, value)| (line, value))
    }
}

/// A file's sections in their order.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Document<'a> {
    /// What stands before the first header is a section without a name, if there is anything.
    pub sections: Vec<Section<'a>>,
}

impl<'a> Document<'a> {
    /// Takes the text apart; any text is a document. Lines end with LF, CR LF or CR.
    #[must_use]
    pub fn parse(text: &'a str) -> Self {
        let mut sections: Vec<Section<'a>> = Vec::new();
        for line in lines(text) {
            if let LineKind::Section { name, .. } = line.kind {
                sections.push(Section { name, line: line.number, lines: Vec::new() });
            } else if sections.is_empty() {
                sections.push(Section { name: "", line: 0, lines: Vec::new() });
            }
            if let Some(section) = sections.last_mut() {
                section.lines.push(line);
            }
        }
        Self { sections }
    }

    /// The first section of this name.
    #[must_use]
    pub fn section(&self, name: &str) -> Option<&Section<'a>> {
        self.sections.iter().find(|section| section.line != 0 && section.name.eq_ignore_ascii_case(name))
    }
}

fn lines(text: &str) -> impl Iterator<Item = Line<'_>> {
    let mut rest = text;
    let mut number = 0_u32;
    core::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let end = match rest.find(['\n', '\r']) {
            Some(at) if rest.get(at..at + 2) == Some("\r\n") => at + 2,
            Some(at) => at + 1,
            None => rest.len(),
        };
        let (raw, tail) = rest.split_at(end);
        rest = tail;
        number = number.saturating_add(1);
        Some(Line { number, raw, kind: classify(raw.trim()) })
    })
}

fn classify(text: &str) -> LineKind<'_> {
    match text.as_bytes().first() {
        None => LineKind::Blank,
        Some(b';' | b'#') => LineKind::Comment,
        Some(b'[') => match text.get(1..).and_then(|inner| inner.split_once(']')) {
            Some((name, rest)) => LineKind::Section { name: name.trim(), rest: rest.trim() },
            None => LineKind::Other,
        },
        Some(_) => match text.split_once('=') {
            Some((key, value)) if !key.is_empty() => {
                LineKind::Entry { key: key.trim_end(), value: value.trim_start() }
            }
            _ => LineKind::Other,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::String;
    use alloc::vec;

    #[test]
    fn lines_are_told_apart() {
        let text = "junk\r\n[ FileInfo ] # x\n a = b = c \r;c\n\n#d\n=e\n[1000";
        let document = Document::parse(text);
        let kinds: Vec<_> = document.sections.iter().flat_map(|s| &s.lines).map(|line| line.kind).collect();
        assert_eq!(
            kinds,
            vec![
                LineKind::Other,
                LineKind::Section { name: "FileInfo", rest: "# x" },
                LineKind::Entry { key: "a", value: "b = c" },
                LineKind::Comment,
                LineKind::Blank,
                LineKind::Comment,
                LineKind::Other,
                LineKind::Other,
            ]
        );
        let raw: String = document.sections.iter().flat_map(|s| &s.lines).map(|line| line.raw).collect();
        assert_eq!(raw, text);
        assert_eq!(document.section("fileinfo").unwrap().entry("A"), Some((3, "b = c")));
    }
}
