//! LSS messages, dates and the last line in words.

use std::io::{self, Write};

use canopen_master::lss;
use canopen_master::trace::Lss;

use super::super::names::bytes;
use super::super::{Totals, named};
use crate::output::counted;

pub(super) fn lss_words(message: &Lss, data: &[u8]) -> (&'static str, String) {
    match message {
        Lss::Request(Some(request)) => {
            let what = match *request {
                lss::Request::SwitchGlobal(mode) => format!("all to {mode:?}").to_lowercase(),
                lss::Request::Select(part, value) => format!("select {} {value:08X}h", part_words(part)),
                lss::Request::ConfigureNodeId(node) => format!("node ID is to be {node}"),
                lss::Request::ConfigureBitTiming { table, index } => {
                    let rate = lss::BitTiming::from_index(index)
                        .filter(|_| table == 0)
                        .and_then(lss::BitTiming::kbits);
                    match rate {
                        Some(rate) => format!("bit rate is to be {rate} kbit/s"),
                        None => format!("bit rate is to be number {index} of table {table}"),
                    }
                }
                lss::Request::ActivateBitTiming { delay_ms } => {
                    format!("change the bit rate in {delay_ms} ms")
                }
                lss::Request::Store => "store node ID and bit rate".into(),
                lss::Request::Inquire(part) => format!("say your {}", part_words(part)),
                lss::Request::InquireNodeId => "say your node ID".into(),
                lss::Request::IdentifyUnconfigured => "who has no node ID?".into(),
                // Bit 80h begins a fastscan: every unconfigured slave answers.
                lss::Request::Fastscan { bit: 0x80, .. } => "fastscan: who has no node ID?".into(),
                lss::Request::Fastscan { number, bit, part, .. } => {
                    format!("fastscan {} {number:08X}h from bit {bit}", part_words(part))
                }
            };
            ("LSS", format!("master: {what}"))
        }
        Lss::Response(Some(response)) => {
            let what = match *response {
                lss::Response::Selected => "selected".into(),
                lss::Response::Done { result, .. } => result.to_string(),
                lss::Response::Identity(part, value) => format!("{} {value:08X}h", part_words(part)),
                lss::Response::NodeId(node) => format!("node ID {node}"),
                lss::Response::Identified => "here, it matches".into(),
                lss::Response::Unconfigured => "here, without node ID".into(),
            };
            ("LSS", format!("slave: {what}"))
        }
        Lss::Request(None) => ("LSS", format!("master: unknown command, {}", bytes(data))),
        Lss::Response(None) => ("LSS", format!("slave: unknown command, {}", bytes(data))),
    }
}

fn part_words(part: lss::Part) -> String {
    format!("{part:?}").to_lowercase()
}

/// Nanoseconds since 1970 as date and time of day, UTC.
pub(super) fn date(nanos: i64) -> String {
    let since = core::time::Duration::from_nanos(u64::try_from(nanos).unwrap_or(0));
    humantime::format_rfc3339_millis(std::time::UNIX_EPOCH + since).to_string()
}

/// The last line.
pub(in super::super) fn summary(totals: &Totals, out: &mut impl Write) -> io::Result<()> {
    let kinds: Vec<String> = named(&totals.by_kind).map(|(name, count)| format!("{count} {name}")).collect();
    let frames = usize::try_from(totals.frames - totals.copies).unwrap_or(usize::MAX);
    write!(out, "\n{}", counted(frames, "frame", "frames"))?;
    if !kinds.is_empty() {
        write!(out, ": {}", kinds.join(", "))?;
    }
    if totals.copies > 0 {
        write!(out, "; {} loop-back copies", totals.copies)?;
    }
    if totals.damaged > 0 {
        write!(out, "; {} gave no frame", counted(totals.damaged, "line", "lines"))?;
    }
    if totals.discarded_bytes > 0 {
        write!(out, "; {} bytes outside of telegrams", totals.discarded_bytes)?;
    }
    writeln!(out)
}
