//! What the reader brings.

use core::fmt;

use crate::curve::{CurveError, InfoBlock};
use crate::upid::{Layer, TreeIdentity, Upid};

/// What a line brings.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event {
    /// Rows of a layer's parameters begin.
    Section {
        /// Its layer; `None` where the file names none that exists.
        layer: Option<Layer>,
        /// For the compatibility rules.
        identity: TreeIdentity,
    },
    /// A parameter row.
    Parameter {
        /// First column of interest.
        upid: Upid,
        /// Second column of interest.
        value: u32,
    },
    /// The object with the layer's parameters ends.
    EndSection {
        /// Rows that were read.
        parameters: usize,
    },
    /// A curve's info block is complete; its setpoints follow.
    Curve(InfoBlock),
    /// A setpoint of the last curve.
    Setpoint(i32),
    /// The curve ends.
    EndCurve {
        /// Setpoints that were read.
        setpoints: usize,
    },
    /// Something is wrong with a line, or with what ends there.
    Problem {
        /// Line number, counted from 1.
        line: usize,
        /// Whether the file can be used.
        severity: Severity,
        /// What.
        problem: Problem,
    },
}

/// How bad a problem is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Read all the same.
    Warning,
    /// What it concerns was not read.
    Error,
}

/// What is wrong.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// The file does not begin with `FileType PVL`.
    #[error("no PVL file: FileType PVL expected at its beginning, {0:?} found")]
    FileType(Excerpt),
    /// Another format version than 1.
    #[error("format version is not 1")]
    FormatVersion,
    /// A line outside of any object or block, the first of those that follow each other.
    #[error("a keyword such as StartObject expected, {0:?} found")]
    Stray(Excerpt),
    /// An object of an unknown kind, which is passed over.
    #[error("unknown kind of object {0:?}, Parameter or Curve expected")]
    Object(Excerpt),
    /// `StartObject` inside an object, or something that ends and had not begun.
    #[error("begin and end do not match: {0:?} does not belong here")]
    Nesting(Excerpt),
    /// A number that is none, or too large.
    #[error("column {column}: a hex number of up to {digits} digits expected, {found:?} found")]
    Number {
        /// Counted from 1.
        column: usize,
        /// For its width.
        digits: usize,
        /// What is there.
        found: Excerpt,
    },
    /// A header field's number that is none.
    #[error("a number expected, {0:?} found")]
    Field(Excerpt),
    /// `TreeLayer` is missing or not 1…4.
    #[error("TreeLayer 1 to 4 expected before StartData")]
    Layer,
    /// A field that the compatibility rules need.
    #[error("{0} is missing before StartData")]
    Missing(&'static str),
    /// A UPID outside of the object's layer.
    #[error("UPID {0} is not of this layer")]
    OtherLayer(Upid),
    /// A UPID for the second time.
    #[error("UPID {0} occurs twice")]
    Twice(Upid),
    /// A curve ID for the second time.
    #[error("curve {0} occurs twice")]
    CurveTwice(u16),
    /// The info block has too many or too few words.
    #[error("info block of {0} words, 18 expected")]
    InfoWords(usize),
    /// The curve breaks a rule.
    #[error("curve: {0}")]
    Curve(CurveError),
    /// `CurveID` and the info block differ.
    #[error("CurveID is {said}, the info block says {found}")]
    CurveId {
        /// In the header.
        said: u32,
        /// In the info block.
        found: u16,
    },
    /// `DataBlockByteSize` and the info block differ.
    #[error("DataBlockByteSize is {said}, the info block says {found}")]
    DataSize {
        /// In the header.
        said: u32,
        /// By the info block.
        found: u32,
    },
    /// Setpoints before or without an info block.
    #[error("setpoints without an info block")]
    NoInfo,
    /// The file ends inside an object.
    #[error("the file ends inside an object")]
    Truncated,
    /// There is neither a parameter object nor a curve.
    #[error("the file has no parameter object and no curve")]
    Empty,
}

/// Longest excerpt, in bytes.
const EXCERPT: usize = 24;

/// The beginning of what stands in a line, to be shown.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Excerpt {
    bytes: [u8; EXCERPT],
    len: u8,
    cut: bool,
}

impl Excerpt {
    pub(super) fn of(text: &str) -> Self {
        let text = text.trim();
        let len =
            text.char_indices().map(|(at, c)| at + c.len_utf8()).take_while(|end| *end <= EXCERPT).last();
        let len = len.unwrap_or(0);
        let mut bytes = [0; EXCERPT];
        bytes.iter_mut().zip(text.bytes().take(len)).for_each(|(room, byte)| *room = byte);
        Self { bytes, len: len as u8, cut: len < text.len() }
    }

    /// The text, without what was cut off.
    #[must_use]
    pub fn as_str(&self) -> &str {
        // Whole characters were copied.
        self.bytes
            .get(..usize::from(self.len))
            .and_then(|bytes| core::str::from_utf8(bytes).ok())
            .unwrap_or("")
    }
}

/// In quotes, with dots where it was cut off.
impl fmt::Debug for Excerpt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}{}", self.as_str(), if self.cut { "…" } else { "" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn excerpts_end_between_characters() {
        let shown = |text| std::format!("{:?}", Excerpt::of(text));
        assert_eq!(shown(" a \"b\" "), r#""a \"b\"""#);
        assert_eq!(shown("123456789012345678901234"), "\"123456789012345678901234\"");
        assert_eq!(shown("12345678901234567890123€"), "\"12345678901234567890123\"…");
        assert_eq!(shown(""), "\"\"");
    }
}
