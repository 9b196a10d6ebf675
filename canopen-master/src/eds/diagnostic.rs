//! What is wrong with a file, where, and by which clause.

use alloc::string::String;
use core::fmt;

use super::Format;

/// How bad a finding is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Hash)]
pub enum Severity {
    /// Against the standard, and the meaning is still plain.
    Warning,
    /// Something could not be read as it stands, or contradicts itself.
    Error,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Warning => "warning",
            Self::Error => "error",
        })
    }
}

macro_rules! rules {
    ($($(#[$doc:meta])* $name:ident = $word:literal, $severity:ident, $clause:literal;)*) => {
        /// What a finding is about. Each has a severity and the clause it comes from.
        #[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
        #[non_exhaustive]
        pub enum Rule {
            $($(#[$doc])* $name,)*
        }

        impl Rule {
            /// Every rule.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// A word for it that stays the same from version to version.
            #[must_use]
            pub const fn word(self) -> &'static str {
                match self { $(Self::$name => $word,)* }
            }

            /// How bad it is.
            #[must_use]
            pub const fn severity(self) -> Severity {
                match self { $(Self::$name => Severity::$severity,)* }
            }

            const fn eds_clause(self) -> &'static str {
                match self { $(Self::$name => $clause,)* }
            }
        }
    };
}

impl Rule {
    /// The clause that says how it should be in a file of this format.
    #[must_use]
    pub const fn clause(self, format: Format) -> &'static str {
        match (format, self) {
            (Format::Eds, _) | (Format::Xdd, Self::PdoMapping | Self::Standard) => self.eds_clause(),
            (Format::Xdd, Self::Mandatory) => "CiA 301, 7.5.2",
            (Format::Xdd, _) => "CiA 311",
        }
    }
}

rules! {
    /// Bytes above 7Fh.
    Encoding = "encoding", Warning, "CiA 306-1, 6.2";
    /// A line longer than 255 characters.
    LineLength = "line-length", Warning, "CiA 306-1, 6.2";
    /// A line that is neither blank, comment, section header nor `key=value`; an entry before the
    /// first header; a comment that begins with `#`.
    Line = "line", Warning, "CiA 306-1, 6.2";
    /// A header with more after its bracket, or a name that is almost that of an object.
    Header = "header", Warning, "CiA 306-1, 6.2";
    /// The same section twice; their entries are joined.
    DuplicateSection = "duplicate-section", Error, "CiA 306-1, 6.2";
    /// The same key twice in a section; the last one counts.
    DuplicateKey = "duplicate-key", Error, "CiA 306-1, 6.2";
    /// A section that must be there.
    MissingSection = "missing-section", Error, "CiA 306-1, 6.1";
    /// An entry of `[FileInfo]` that must be there, or is malformed.
    FileInfo = "file-info", Warning, "CiA 306-1, 6.4";
    /// An entry of `[DeviceInfo]` that must be there, or is malformed.
    DeviceInfo = "device-info", Warning, "CiA 306-1, 6.5";
    /// `[DummyUsage]`.
    DummyUsage = "dummy-usage", Warning, "CiA 306-1, 6.6";
    /// A list of objects and its count differ, or an entry is no index.
    ListCount = "list-count", Error, "CiA 306-1, 6.6.3.1";
    /// An object in the wrong list, in two lists or in none, or a listed one that is not described.
    List = "list", Error, "CiA 306-1, 6.6.3.1";
    /// 1000h, 1001h or 1018h is not there.
    Mandatory = "mandatory", Error, "CiA 306-1, 6.6.3.1; CiA 301, 7.5.2";
    /// An entry that the object's kind needs is missing.
    MissingEntry = "missing-entry", Error, "CiA 306-1, 6.6.3.2";
    /// An entry that the object's kind does not have.
    SurplusEntry = "surplus-entry", Warning, "CiA 306-1, 6.6.3.2";
    /// A value that is not what its key asks for.
    Value = "value", Error, "CiA 306-1, 6.6.3.2";
    /// A value that reads only with good will: a comment behind it, leading zeros that are no octal,
    /// another word for the same.
    Spelling = "spelling", Warning, "CiA 306-1, 6.3";
    /// A default, limit or parameter value that is out of its data type's or its limits' range.
    Range = "range", Error, "CiA 306-1, 6.6.3.2";
    /// A value with `$NODEID` that is not `$NODEID+number`.
    NodeId = "node-id", Warning, "CiA 306-1, 6.6.3.2";
    /// A name that is longer than 241 characters.
    NameLength = "name-length", Warning, "CiA 306-1, 6.6.3.2";
    /// `SubNumber` differs from the number of sub-objects described.
    SubNumber = "sub-number", Error, "CiA 306-1, 6.6.3.2";
    /// A sub-object, a list of names or of values whose object is not described.
    Orphan = "orphan", Error, "CiA 306-1, 6.6.3.2";
    /// Bits of `ObjFlags` that are reserved.
    ObjFlags = "obj-flags", Warning, "CiA 306-1, 6.6.3.3";
    /// Compact storage: a list's `NrOfEntries`, or an entry outside the object.
    Compact = "compact", Error, "CiA 306-1, 6.6.3.4";
    /// `ObjectLinks`.
    Links = "links", Error, "CiA 306-1, 6.6.4";
    /// `[Comments]`: `Lines` and the lines differ.
    Comments = "comments", Warning, "CiA 306-1, 6.6.5";
    /// `[DeviceComissioning]`: an entry is missing or malformed, or the section's name is spelled
    /// otherwise (the standard has it with one `m`).
    Commissioning = "commissioning", Warning, "CiA 306-1, 7.3.5";
    /// Modules.
    Modules = "modules", Error, "CiA 306-1, 8";
    /// A PDO maps an object that is not there, not mappable, of another length, or more than 64 bits.
    PdoMapping = "pdo-mapping", Error, "CiA 301, 7.5.2";
    /// A communication object of another type than the standard gives it, or with an identifier that it
    /// must not have.
    Standard = "standard", Warning, "CiA 301, 7.5.2";
    /// An XDD that is not as the schema says.
    Xdd = "xdd", Error, "CiA 311";
}

/// One finding.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Diagnostic {
    /// Line, counted from 1; 0 where it concerns the whole file.
    pub line: u32,
    /// What it is about.
    pub rule: Rule,
    /// What the file is written in, by which the clause is.
    pub format: Format,
    /// What was expected and what came, for people.
    pub message: String,
}

impl Diagnostic {
    /// How bad it is.
    #[must_use]
    pub const fn severity(&self) -> Severity {
        self.rule.severity()
    }

    /// The clause that says how it should be.
    #[must_use]
    pub const fn clause(&self) -> &'static str {
        self.rule.clause(self.format)
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { line, rule, message, .. } = self;
        if *line > 0 {
            write!(f, "line {line}: ")?;
        }
        write!(f, "{}: {message} ({})", rule.severity(), self.clause())
    }
}
