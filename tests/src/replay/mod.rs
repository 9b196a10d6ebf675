//! Recorded traffic, replayed: our SDO server in the place of the recorded one, our client in the place of
//! the recorded one. Each exchange gives the same answers, or the difference has a name.

mod client;
mod exchange;
mod server;
pub mod slave;

use core::fmt;

use canopen_master::sdo::message::{Content, Request, Response};
use canopen_master::trace::{Outcome as Ended, Way};

pub use exchange::{Exchange, Message, Recording, read};

use crate::report::{Case, Outcome};

/// How our side compares with the recorded one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Verdict {
    /// The same bytes.
    Identical,
    /// The same messages; the bytes differ where the standard leaves them open. The reason of the first
    /// difference.
    Equivalent(&'static str),
    /// Something else.
    Different(String),
    /// Not to be replayed from this side, and why.
    NotReplayed(&'static str),
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Identical => f.write_str("identical"),
            Self::Equivalent(why) => write!(f, "equivalent: {why}"),
            Self::Different(why) => write!(f, "different: {why}"),
            Self::NotReplayed(why) => write!(f, "not replayed: {why}"),
        }
    }
}

/// Our server in the place of the recorded one.
#[must_use]
pub fn as_server(exchange: &Exchange) -> Verdict {
    playable(exchange).unwrap_or_else(|| server::replay(exchange))
}

/// Our client in the place of the recorded one.
#[must_use]
pub fn as_client(exchange: &Exchange) -> Verdict {
    playable(exchange).unwrap_or_else(|| client::replay(exchange))
}

fn playable(exchange: &Exchange) -> Option<Verdict> {
    let why = match exchange.transfer.outcome {
        Ended::Incomplete => "the capture does not hold all of it",
        Ended::Aborted { by: Way::Request, .. } => "the client gave up, for reasons of its own",
        Ended::Done | Ended::Aborted { .. } if exchange.messages.len() < 2 => "one side is missing",
        _ => return None,
    };
    Some(Verdict::NotReplayed(why))
}

/// The cases of a capture, for a report.
#[must_use]
pub fn cases(name: &str, recording: &Recording) -> Vec<Case> {
    let mut cases = Vec::new();
    for (number, exchange) in recording.exchanges.iter().enumerate() {
        let transfer = &exchange.transfer;
        for (side, verdict) in [("server", as_server(exchange)), ("client", as_client(exchange))] {
            let outcome = match &verdict {
                Verdict::Identical | Verdict::Equivalent(_) => Outcome::Passed,
                Verdict::Different(why) => Outcome::Failed(why.clone()),
                Verdict::NotReplayed(why) => Outcome::Skipped((*why).into()),
            };
            let (began, ended) = (transfer.began.unwrap_or_default(), transfer.ended.unwrap_or_default());
            cases.push(Case {
                id: format!("{name}.{number}.{side}"),
                title: format!(
                    "node {}, {:?} {:?} of {}, {} bytes: our {side} does as the recorded one",
                    transfer.node, transfer.mode, transfer.direction, transfer.at, transfer.size
                ),
                clause: String::new(),
                outcome,
                time: ended.saturating_sub(began),
            });
        }
    }
    cases
}

/// Compares the frames of one side, ours with the recorded ones.
struct Comparison {
    verdict: Verdict,
}

impl Comparison {
    const fn new() -> Self {
        Self { verdict: Verdict::Identical }
    }

    /// `same`: why the two may differ, if they may.
    fn frame(&mut self, number: usize, recorded: &[u8], ours: Option<&[u8]>, same: Option<&'static str>) {
        if matches!(self.verdict, Verdict::Different(_)) || ours == Some(recorded) {
            return;
        }
        match (same, ours) {
            (Some(why), Some(_)) => {
                if self.verdict == Verdict::Identical {
                    self.verdict = Verdict::Equivalent(why);
                }
            }
            (_, ours) => {
                let ours = ours.map_or("nothing".into(), |ours| format!("{ours:02X?}"));
                self.verdict =
                    Verdict::Different(format!("frame {number}: {recorded:02X?} recorded, {ours} of ours"));
            }
        }
    }
}

/// Why two answers that are not the same bytes say the same.
fn same_response(recorded: &[u8], ours: &[u8]) -> Option<&'static str> {
    let (Ok(theirs), Ok(own)) = (Response::parse(recorded), Response::parse(ours)) else { return None };
    if theirs == own {
        return Some("reserved or unused bytes");
    }
    match (theirs, own) {
        (
            Response::InitiateUpload { at: a, content: theirs },
            Response::InitiateUpload { at: b, content: own },
        ) if a == b => same_content(theirs, own),
        (
            Response::InitiateBlockUpload { at: a, crc: theirs, size: x },
            Response::InitiateBlockUpload { at: b, crc: own, size: y },
        ) if a == b => {
            if theirs != own {
                Some("the server has a CRC, or not")
            } else {
                size(x, y)
            }
        }
        (
            Response::InitiateBlockDownload { at: a, block_size: x, .. },
            Response::InitiateBlockDownload { at: b, block_size: y, .. },
        ) if a == b && x == y => Some("the server has a CRC, or not"),
        (Response::EndBlockUpload { unused: a, .. }, Response::EndBlockUpload { unused: b, .. })
            if a == b =>
        {
            Some("CRC not agreed on")
        }
        _ => None,
    }
}

fn size(theirs: Option<u32>, own: Option<u32>) -> Option<&'static str> {
    (theirs.is_none() || own.is_none()).then_some("size indicated, or not")
}

fn same_content(theirs: Content, own: Content) -> Option<&'static str> {
    match (theirs, own) {
        (Content::Segmented(theirs), Content::Segmented(own)) => size(theirs, own),
        (
            Content::Expedited { data: theirs, sized: false },
            Content::Expedited { data: own, sized: true },
        ) if theirs.padded() == own.padded() => Some("size indicated, or not"),
        _ => None,
    }
}

/// Why two requests that are not the same bytes ask for the same.
fn same_request(recorded: &[u8], ours: &[u8]) -> Option<&'static str> {
    let (Ok(theirs), Ok(own)) = (Request::parse(recorded), Request::parse(ours)) else { return None };
    if theirs == own {
        return Some("reserved or unused bytes");
    }
    match (theirs, own) {
        (
            Request::InitiateDownload { at: a, content: theirs },
            Request::InitiateDownload { at: b, content: own },
        ) if a == b => same_content(theirs, own),
        (
            Request::InitiateBlockDownload { at: a, size: x, .. },
            Request::InitiateBlockDownload { at: b, size: y, .. },
        ) if a == b => size(x, y),
        (Request::EndBlockDownload { unused: a, .. }, Request::EndBlockDownload { unused: b, .. })
            if a == b =>
        {
            Some("CRC not agreed on")
        }
        _ => None,
    }
}
