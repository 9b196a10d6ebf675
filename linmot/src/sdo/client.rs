//! The client's side.

use core::fmt;

use super::{Answer, END_OF_LIST, abort};
use crate::code::Status;
use crate::curve::INFO_WORDS;
use crate::request::{Reply, Request};
use crate::table::ENTRY_WORDS;

/// An abort that is no answer of the configuration service.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Aborted(pub u32);

impl fmt::Display for Aborted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the drive aborted with {:08X}h", self.0)?;
        match abort::text(self.0) {
            "" => Ok(()),
            text => write!(f, ", {text}"),
        }
    }
}

impl core::error::Error for Aborted {}

/// The client's side: what SDO answers leave out (how many words a block still has) is remembered
/// here, so that replies are the same as on the other carriers.
#[derive(Debug, Clone, Default)]
pub struct Client {
    info: usize,
    data: usize,
    entry: usize,
}

impl Client {
    /// No block under way.
    #[must_use]
    pub const fn new() -> Self {
        Self { info: 0, data: 0, entry: 0 }
    }

    /// What the answer to `request` says.
    ///
    /// # Errors
    /// [`Aborted`] with a code that stands for no status.
    pub fn reply(&mut self, request: &Request, answer: Answer) -> Result<Reply, Aborted> {
        let [first, ..] = request.words();
        let value = |status, data: [u8; 4]| Reply::with_value(status, first, u32::from_le_bytes(data));
        let next = |left: &mut usize| {
            *left = left.saturating_sub(1);
            if *left == 0 { Status::OK } else { Status::NOT_FINISHED }
        };
        let data = match answer {
            Answer::Abort(code) => return refusal(code).map(|status| Reply::new(status, [first, 0, 0])),
            Answer::Written([_, _, result, _]) => {
                let status = match (Status(result), request) {
                    // The examples show 04h for a list that was started.
                    (Status::NOT_FINISHED, Request::StartList { .. }) => Status::OK,
                    // Writing flash goes on; its state tells when it ends.
                    (Status::OK, Request::SaveCurves | Request::SaveTable | Request::Start) => {
                        Status::RUNNING
                    }
                    (status, _) => status,
                };
                return Ok(Reply::new(status, request.words()));
            }
            Answer::Read(data) => data,
        };
        let [a, b, c, d] = data;
        let (low, high) = (u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]));
        Ok(match request {
            Request::NextItem(_) if high == END_OF_LIST => Reply::new(Status::END, [high, 0, 0]),
            Request::NextItem(_) => Reply::new(Status::OK, [high, low, 0]),
            Request::StartCurve { .. } => {
                self.info = INFO_WORDS;
                self.data = usize::from(high / 4);
                Reply::new(Status(a), [first, b.into(), high])
            }
            Request::CurveInfo { .. } => value(next(&mut self.info), data),
            Request::CurveData { .. } => value(next(&mut self.data), data),
            // The code lies in the upper two bytes.
            Request::ErrorCode { .. } => Reply::new(Status::OK, [first, high, 0]),
            Request::GetEntry { .. } => {
                self.entry = ENTRY_WORDS;
                Reply::new(Status::OK, [first, low, 0])
            }
            Request::GetEntryData { .. } => value(next(&mut self.entry), data),
            _ => value(Status::OK, data),
        })
    }

    /// Whether an answer to [`Access::flash_state`](super::Access::flash_state) says that flash is still being written.
    #[must_use]
    pub const fn is_flash_busy(answer: Answer) -> bool {
        matches!(answer, Answer::Read([state, ..]) if state != 0)
    }
}

fn refusal(code: u32) -> Result<Status, Aborted> {
    Ok(match code {
        abort::NO_OBJECT => Status::UPID,
        abort::READ_ONLY | abort::WRITE_ONLY => Status::USAGE,
        abort::VALUE | abort::TOO_HIGH | abort::TOO_LOW => Status::RANGE,
        abort::TYPE => Status::TYPE,
        _ => return Err(Aborted(code)),
    })
}
