//! Why a procedure ended early.

use crate::code::Status;
use crate::curve::CurveError;
use crate::range::{Number, Range};
use crate::request::{Access, Reply, Request, Value};
use crate::upid::Upid;

/// Why a procedure ended early.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Fault<E> {
    /// No answer came.
    #[error(transparent)]
    Carrier(E),
    /// The drive refused a command.
    #[error("{}: the drive answered {:02X}h, {}", subject(.request), .reply.status.0, meaning(.request, .reply.status))]
    Refused {
        /// What was asked.
        request: Request,
        /// What came.
        reply: Reply,
    },
    /// A block ended earlier or later than its size says.
    #[error("{}: the block's end came after {done} words, {expected} expected", subject(.request))]
    BlockLength {
        /// The last command of it.
        request: Request,
        /// Words transferred.
        done: usize,
        /// Words that the size says.
        expected: usize,
    },
    /// A size that no block has.
    #[error("{}: size {size}, {expected} expected", subject(.request))]
    Size {
        /// The command that tells sizes.
        request: Request,
        /// What came.
        size: u16,
        /// What should have come.
        expected: &'static str,
    },
    /// A value that the parameter does not take; nothing was written.
    #[error("UPID {upid}: {value} is out of range, {range} expected")]
    Range {
        /// The parameter.
        upid: Upid,
        /// What was to be written.
        value: Number,
        /// What the drive takes.
        range: Range,
    },
    /// Another value was read back than written.
    #[error("UPID {upid}: {written} was written, but the {} value is {found}", memory_name(*.memory))]
    ReadBack {
        /// The parameter.
        upid: Upid,
        /// Which value was read.
        memory: Value,
        /// What was written.
        written: Number,
        /// What is there.
        found: Number,
    },
    /// A text that no string holds: up to 32 characters without 00h; nothing was written.
    #[error("UPID {upid}: a text of up to 32 characters, none of them 00h, expected, {len} found")]
    Text {
        /// The string.
        upid: Upid,
        /// Characters of the text.
        len: usize,
    },
    /// Another text was read back than written.
    #[error("UPID {upid}: the {} value is another text than was written", memory_name(*.memory))]
    TextReadBack {
        /// The string.
        upid: Upid,
        /// Which value was read.
        memory: Value,
    },
    /// A curve that no drive takes; nothing was written.
    #[error("curve {curve}: {error}")]
    Curve {
        /// Its ID.
        curve: u16,
        /// What is wrong.
        error: CurveError,
    },
    /// A command table entry that is none.
    #[error("entry {entry}: {error}")]
    Entry {
        /// Its number.
        entry: u16,
        /// What is wrong.
        error: crate::table::EntryError,
    },
}

/// What a request is about, in words.
fn subject(request: &Request) -> impl core::fmt::Display {
    struct Subject(Request);
    impl core::fmt::Display for Subject {
        fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
            match self.0 {
                Request::Read { upid, .. } | Request::Write { upid, .. } => {
                    write!(f, "UPID {upid}: {}", self.0.command())
                }
                Request::StartCurve { curve, .. }
                | Request::CurveInfo { curve, .. }
                | Request::CurveData { curve, .. } => write!(f, "curve {curve}: {}", self.0.command()),
                Request::DeleteEntry { entry }
                | Request::WriteEntry { entry, .. }
                | Request::WriteEntryData { entry, .. }
                | Request::GetEntry { entry }
                | Request::GetEntryData { entry } => write!(f, "entry {entry}: {}", self.0.command()),
                _ => write!(f, "{}", self.0.command()),
            }
        }
    }
    Subject(*request)
}

/// What a status means for this request: one of several texts of D4h.
fn meaning(request: &Request, status: Status) -> impl core::fmt::Display {
    struct Meaning(Status, Option<&'static str>);
    impl core::fmt::Display for Meaning {
        fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
            match self.1 {
                Some(text) => f.write_str(text),
                None => self.0.fmt(f),
            }
        }
    }
    let text = match request {
        Request::StartCurve { access: Access::Add, .. } => Some("curve already defined"),
        Request::StartCurve { .. } => Some("curve not present"),
        Request::DeleteEntry { .. } | Request::GetEntry { .. } | Request::WriteEntry { .. } => {
            Some("invalid entry number")
        }
        _ => None,
    };
    Meaning(status, text.filter(|_| status == Status::DEFINED))
}

const fn memory_name(value: Value) -> &'static str {
    match value {
        Value::Rom => "ROM",
        Value::Ram => "RAM",
        Value::Minimum => "minimal",
        Value::Maximum => "maximal",
        Value::Default => "default",
    }
}
