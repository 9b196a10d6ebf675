//! The drive's side.

use core::time::Duration;

use super::{Access, Answer, BASE, CURVE_RESULT, END_OF_LIST, FLASH_STATE, TABLE_RESULT, abort};
use crate::code::Status;
use crate::drive::{Drive, Service};
use crate::request::{Access as Curve, Reply, Request};
use crate::upid::Upid;

/// The drive's side (decision 27 for what the documents leave open).
#[derive(Debug, Clone, Default)]
pub struct Server {
    service: Service,
    curve_result: LastResult,
    table_result: LastResult,
    modifying: bool,
    away: bool,
}

/// A result that is 00h until there is one.
#[derive(Debug, Clone, Copy, Default)]
struct LastResult(u8);

impl Server {
    /// As after a restart.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Whether this index belongs to the configuration service rather than to the drive's other
    /// objects.
    #[must_use]
    pub const fn serves(index: u16) -> bool {
        index >= BASE && index <= BASE + 0x3EFF
    }

    /// Carries one access out; `None` while the drive restarts.
    pub fn execute(&mut self, now: Duration, access: &Access, drive: &mut impl Drive) -> Option<Answer> {
        if drive.is_restarting(now) {
            self.away = true;
            return None;
        }
        if core::mem::take(&mut self.away) {
            *self = Self::new();
        }
        if access.write.is_none() && access.index == BASE {
            let busy = if drive.is_busy(now) { Status::NOT_FINISHED.0 } else { 0 };
            match access.sub {
                FLASH_STATE => return Some(Answer::Read([busy, 0, 0, 0])),
                0x80 => return Some(Answer::Read([busy, 0, 0, 0])),
                CURVE_RESULT => return Some(Answer::Read([self.curve_result.0, 0, 0, 0])),
                TABLE_RESULT => return Some(Answer::Read([self.table_result.0, 0, 0, 0])),
                _ => {}
            }
        }
        let Some(request) = access.request(self.modifying) else {
            return Some(Answer::Abort(abort::NO_SUB_INDEX));
        };
        if let Request::StartCurve { access, .. } = request {
            self.modifying = access == Curve::Modify;
        }
        let reply = self.service.execute(now, &request, drive);
        let result = LastResult(if reply.status == Status::RUNNING { 0 } else { reply.status.0 });
        match request.command().0 {
            0x40..=0x62 => self.curve_result = result,
            0x80..=0x8E => self.table_result = result,
            _ => {}
        }
        if access.write.is_some() {
            return Some(match refused(&reply, &request, drive) {
                Some(code) => Answer::Abort(code),
                None => Answer::Written([0, 0, result.0, 0]),
            });
        }
        let [first, low, high] = reply.words;
        let ([a, b], [c, d]) = (low.to_le_bytes(), high.to_le_bytes());
        let two = |low: u16, high: u16| {
            let ([a, b], [c, d]) = (low.to_le_bytes(), high.to_le_bytes());
            Answer::Read([a, b, c, d])
        };
        Some(match request {
            Request::NextItem(_) if reply.status == Status::END => two(0, END_OF_LIST),
            Request::NextItem(_) if reply.status == Status::OK => {
                let usage = drive.parameter(Upid(first)).map_or(0, |parameter| parameter.usage.0);
                two(usage, first)
            }
            Request::StartCurve { .. } if !reply.status.is_done() => Answer::Read([reply.status.0, 0, 0, 0]),
            Request::StartCurve { .. } => Answer::Read([reply.status.0, a, c, d]),
            _ if !reply.status.is_done() => {
                Answer::Abort(refused(&reply, &request, drive).unwrap_or(abort::STATE))
            }
            Request::ErrorCode { .. } => two(0, low),
            _ => Answer::Read([a, b, c, d]),
        })
    }
}

/// The abort code of a parameter access that the service refused; curve and table services give
/// their result in the answer instead.
fn refused(reply: &Reply, request: &Request, drive: &impl Drive) -> Option<u32> {
    Some(match reply.status {
        Status::UPID => abort::NO_OBJECT,
        Status::TYPE => abort::TYPE,
        Status::USAGE if matches!(request, Request::Read { .. }) => abort::WRITE_ONLY,
        Status::USAGE => abort::READ_ONLY,
        Status::BUSY | Status::NO_START => abort::STATE,
        Status::RANGE => match *request {
            Request::Write { upid, value, .. } => {
                let parameter = drive.parameter(upid)?;
                let number = |raw| parameter.kind.number(raw);
                let above = number(value & parameter.kind.mask()) > number(parameter.maximum);
                if above { abort::TOO_HIGH } else { abort::TOO_LOW }
            }
            _ => abort::VALUE,
        },
        _ => return None,
    })
}
