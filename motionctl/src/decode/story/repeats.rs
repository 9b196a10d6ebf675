//! What repeats itself, counted and told at the end.

use std::io::Write as _;

use canopen_master::NodeId;
use canopen_master::trace::{Mapped, PdoDirection};

use super::super::Ear;
use super::rhythm::Rhythm;
use super::{Story, one_line, seconds};

/// Something that repeats itself; the number of its bus first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Cycle {
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
pub(crate) struct Count {
    pub(crate) rhythm: Rhythm,
    /// Data of the frame before.
    pub(crate) data: Vec<u8>,
    pub(crate) changes: u64,
    /// Of a PDO.
    pub(super) mapping: Vec<Mapped>,
    /// A PDO has fewer bytes than its mapping.
    pub(super) short: bool,
}

impl Cycle {
    /// The number of its bus.
    pub(crate) const fn bus(self) -> u16 {
        match self {
            Self::Sync(bus)
            | Self::Time(bus)
            | Self::Pdo(bus, ..)
            | Self::Channel(bus, _)
            | Self::Heartbeat(bus, _)
            | Self::Guarding(bus, _)
            | Self::Stray(bus, _)
            | Self::Identifier(bus, ..) => bus,
        }
    }

    /// Whether its data are worth looking at.
    pub(crate) const fn carries(self) -> bool {
        matches!(self, Self::Pdo(..) | Self::Channel(..) | Self::Identifier(..))
    }

    /// What it is called.
    pub(crate) fn name(self) -> String {
        match self {
            Self::Sync(_) => "SYNC".into(),
            Self::Time(_) => "TIME".into(),
            Self::Pdo(_, node, PdoDirection::Transmit, number) => format!("node {node} TPDO {number}"),
            Self::Pdo(_, node, PdoDirection::Receive, number) => format!("node {node} RPDO {number}"),
            Self::Channel(_, channel) => format!("CAN Link channel {channel}"),
            Self::Heartbeat(_, node) => format!("node {node} heartbeat"),
            Self::Guarding(_, node) => format!("node {node} guarding"),
            Self::Stray(_, node) => format!("node {node} SDO frames that fit no transfer"),
            Self::Identifier(_, id, extended) => {
                let width = if extended { 8 } else { 3 };
                format!("identifier {id:0width$X}h")
            }
        }
    }
}

/// How often something comes, and its longest gap where that is no jitter.
fn period(rhythm: &Rhythm) -> String {
    let Some(mean) = rhythm.mean() else { return String::new() };
    let longest = rhythm.longest.map(|gap| gap as f64).filter(|gap| *gap > mean * 1.5);
    let longest = longest.map_or_else(String::new, |gap| format!(" (longest {:.1})", gap / 1e6));
    format!(", every {:.1} ms{longest}", mean / 1e6)
}

impl Story<'_> {
    /// Counts a frame of a cycle: whether it is the first, and whether its data are new.
    pub(super) fn cycle(&mut self, cycle: Cycle, time: Option<i64>, data: &[u8]) -> (bool, bool) {
        let count = self.cycles.entry(cycle).or_default();
        let first = count.rhythm.number == 0;
        let changed = first || count.data != data;
        count.rhythm.beat(time);
        if changed {
            count.data.clear();
            count.data.extend_from_slice(data);
            count.changes += u64::from(!first);
        }
        (first, changed)
    }

    /// The counts, when the capture has ended.
    pub(in super::super) fn end(&mut self, ear: &Ear) {
        self.repeated();
        let again: u64 = self.objects.values().map(|told| told.again).sum();
        if again > 0 || self.cycles.values().any(|count| count.rhythm.number > 1) {
            let _ = writeln!(self.out, "\nwhat repeated itself:");
        }
        let cycles = core::mem::take(&mut self.cycles);
        for (cycle, count) in cycles.iter().filter(|(_, count)| count.rhythm.number > 1) {
            let mut what = cycle.name();
            if let Cycle::Heartbeat(bus, node) = *cycle
                && let Some(state) = ear.tracer().state(bus, node)
            {
                what = format!("{what}, at last {state}");
            }
            let name = ear.bus_name(cycle.bus()).filter(|_| ear.has_several_buses());
            let bus = name.map_or_else(String::new, |name| format!("{} ", one_line(name)));
            let period = period(&count.rhythm);
            let changes = match count.changes {
                _ if !cycle.carries() => String::new(),
                0 => ", always the same".into(),
                1 => ", 1 change".into(),
                changes => format!(", {changes} changes"),
            };
            let silent = match (cycle, count.rhythm.silence(self.newest)) {
                (Cycle::Heartbeat(..), Some(gap)) => format!(", silent for the last {}", seconds(gap)),
                _ => String::new(),
            };
            let _ =
                writeln!(self.out, "  {bus}{what}: {} times{period}{changes}{silent}", count.rhythm.number);
        }
        if again > 0 {
            let _ = writeln!(self.out, "  SDO transfers like those told: {again}");
        }
    }
}
