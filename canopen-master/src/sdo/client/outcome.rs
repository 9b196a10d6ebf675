//! How a transfer ends.

use core::fmt;

use super::super::message::MessageError;
use super::super::{AbortCode, Address};

/// Names one transfer from its submission to its outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Ticket(pub(super) u32);

/// Why a transfer was not begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SubmitError {
    /// One transfer at a time: the outcome of the last one has not been polled yet.
    #[error("a transfer is under way, its outcome must be polled first")]
    Busy,
    /// The buffer to download cannot be read.
    #[error("the data to download cannot be read: {0}")]
    Source(AbortCode),
}

/// A transfer that was not begun, with its buffer.
#[derive(Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{error}")]
pub struct Refused<B> {
    /// Why.
    pub error: SubmitError,
    /// As it was given.
    pub buffer: B,
}

impl<B> fmt::Debug for Refused<B> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Refused({:?})", self.error)
    }
}

/// The end of a transfer.
// In this order no padding lies before the buffer: copied together with it, the buffer would be read
// across the borders of what was just written, for which a processor waits longer than a whole transfer
// takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub struct Finished<B> {
    /// Of the command.
    pub ticket: Ticket,
    /// The object.
    pub at: Address,
    /// How it ended.
    pub outcome: Outcome,
    /// The caller's buffer; of an upload that is [`Outcome::Done`] it holds the data.
    pub buffer: B,
}

/// How a transfer ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Outcome {
    /// All data were transferred, so many bytes.
    Done(u32),
    /// The server ended it.
    Aborted(AbortCode),
    /// We ended it for this reason, and told the server.
    GaveUp(Fault),
    /// No answer came in time. A download may have been carried out all the same.
    TimedOut,
    /// [`Client::cancel`](super::Client::cancel).
    Cancelled,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Done(bytes) => write!(f, "done, {bytes} bytes"),
            Self::Aborted(code) => write!(f, "aborted by the device: {code}"),
            Self::GaveUp(fault) => write!(f, "given up: {fault}"),
            Self::TimedOut => f.write_str("no answer in time"),
            Self::Cancelled => f.write_str("cancelled"),
        }
    }
}

/// What was wrong with an answer, or with our own end of the transfer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// The toggle bit did not alternate.
    #[error("toggle bit not alternated")]
    Toggle,
    /// A good frame that is no answer in this state.
    #[error("answer with command byte {command:02X}h not expected")]
    Unexpected {
        /// First byte.
        command: u8,
    },
    /// A frame that says nothing.
    #[error("answer not understood: {0}")]
    Message(MessageError),
    /// More or fewer bytes than the server had indicated.
    #[error("{found} bytes received, {indicated} were indicated")]
    Size {
        /// Announced by the server.
        indicated: u32,
        /// Received so far.
        found: u32,
    },
    /// A segment of an upload without data that is not the last one.
    #[error("segment without data, though more are to follow")]
    EmptySegment,
    /// The caller's buffer refused the data or had none to give.
    #[error("own buffer: {0}")]
    Buffer(AbortCode),
    /// A block size outside 1…127.
    #[error("block size {0}, 1 to 127 expected")]
    BlockSize(u8),
    /// A segment confirmed that was not sent.
    #[error("segment {found} confirmed, {sent} were sent")]
    Sequence {
        /// Segments sent in the sub-block.
        sent: u8,
        /// Number confirmed.
        found: u8,
    },
    /// Sub-block after sub-block without a segment arriving.
    #[error("{0} sub-blocks without progress")]
    NoProgress(u8),
    /// The check sum over a block transfer is wrong.
    #[error("CRC {found:04X}h received, {computed:04X}h computed")]
    Crc {
        /// Over the data that came.
        computed: u16,
        /// Sent by the server.
        found: u16,
    },
}

impl Fault {
    /// What the server is told.
    #[must_use]
    pub const fn abort_code(self) -> AbortCode {
        match self {
            Self::Toggle => AbortCode::TOGGLE,
            Self::Unexpected { .. } | Self::Message(_) => AbortCode::COMMAND,
            Self::Size { .. } | Self::EmptySegment => AbortCode::LENGTH,
            Self::Buffer(code) => code,
            Self::BlockSize(_) => AbortCode::BLOCK_SIZE,
            Self::Sequence { .. } | Self::NoProgress(_) => AbortCode::SEQUENCE,
            Self::Crc { .. } => AbortCode::CRC,
        }
    }
}
