//! What repeats itself, counted and told at the end.

use std::io::Write as _;

use canopen_master::NodeId;
use canopen_master::trace::{PdoDirection, Tracer};

use super::Story;

/// Something that repeats itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Cycle {
    Sync(u16),
    Time(u16),
    Pdo(u16, NodeId, PdoDirection, u16),
    Channel(u16, u8),
    Heartbeat(u16, NodeId),
    Guarding(u16, NodeId),
    /// SDO frames of no transfer.
    Stray(u16, NodeId),
    Identifier(u16, u32, bool),
}

#[derive(Debug, Default)]
pub(super) struct Count {
    number: u64,
    first: Option<i64>,
    last: Option<i64>,
    /// Data of the frame before.
    data: Vec<u8>,
    pub(super) changes: u64,
}

impl Story<'_> {
    /// Counts a frame of a cycle: whether it is the first, and whether its data are new.
    pub(super) fn cycle(&mut self, cycle: Cycle, time: Option<i64>, data: &[u8]) -> (bool, bool) {
        let count = self.cycles.entry(cycle).or_default();
        let first = count.number == 0;
        let changed = first || count.data != data;
        count.number += 1;
        if first {
            count.first = time;
        }
        count.last = time;
        if changed {
            count.data.clear();
            count.data.extend_from_slice(data);
            count.changes += u64::from(!first);
        }
        (first, changed)
    }

    /// The counts, when the capture has ended.
    pub(in super::super) fn end(&mut self, tracer: &Tracer) {
        self.repeated();
        if self.cycles.values().any(|count| count.number > 1) {
            let _ = writeln!(self.out, "\nwhat repeated itself:");
        }
        let cycles = core::mem::take(&mut self.cycles);
        for (cycle, count) in cycles.iter().filter(|(_, count)| count.number > 1) {
            let (bus, what) = match *cycle {
                Cycle::Sync(bus) => (bus, "SYNC".into()),
                Cycle::Time(bus) => (bus, "TIME".into()),
                Cycle::Pdo(bus, node, PdoDirection::Transmit, number) => {
                    (bus, format!("node {node} TPDO {number}"))
                }
                Cycle::Pdo(bus, node, PdoDirection::Receive, number) => {
                    (bus, format!("node {node} RPDO {number}"))
                }
                Cycle::Channel(bus, channel) => (bus, format!("CAN Link channel {channel}")),
                Cycle::Heartbeat(bus, node) => {
                    let state =
                        tracer.state(bus, node).map(|state| format!(", at last {state}")).unwrap_or_default();
                    (bus, format!("node {node} heartbeat{state}"))
                }
                Cycle::Guarding(bus, node) => (bus, format!("node {node} guarding")),
                Cycle::Stray(bus, node) => (bus, format!("node {node} SDO frames that fit no transfer")),
                Cycle::Identifier(bus, id, extended) => {
                    let width = if extended { 8 } else { 3 };
                    (bus, format!("identifier {id:0width$X}h"))
                }
            };
            let bus = match self.buses.get(usize::from(bus)) {
                Some(name) if self.buses.len() > 1 => format!("{name} "),
                _ => String::new(),
            };
            let period = match (count.first, count.last) {
                (Some(first), Some(last)) if last > first => {
                    let period = (last - first) as f64 / (count.number - 1) as f64 / 1e6;
                    format!(", every {period:.1} ms")
                }
                _ => String::new(),
            };
            let carries = matches!(cycle, Cycle::Pdo(..) | Cycle::Channel(..) | Cycle::Identifier(..));
            let changes = match count.changes {
                _ if !carries => String::new(),
                0 => ", always the same".into(),
                1 => ", 1 change".into(),
                changes => format!(", {changes} changes"),
            };
            let _ = writeln!(self.out, "  {bus}{what}: {} times{period}{changes}", count.number);
        }
        let again: u64 = self.objects.values().map(|told| told.again).sum();
        if again > 0 {
            let _ = writeln!(self.out, "  SDO transfers with no news: {again}");
        }
    }
}
