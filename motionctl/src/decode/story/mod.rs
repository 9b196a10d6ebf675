//! What happened, as an engineer would tell it: each thing once, when it happens.
//!
//! SDO frames appear as the transfers they are part of; what repeats itself (SYNC, PDOs, heartbeats,
//! guarding, a value polled again and again) is told when it begins and when it changes, and counted
//! at the end.

mod errors;
mod repeats;
mod rhythm;
mod sdo;
mod words;

use core::fmt::Write as _;
use std::collections::BTreeMap;
use std::io::Write;

use canopen_master::ds402::StatusWord;
use canopen_master::nmt::State;
use canopen_master::trace::{Kind, Outcome, PdoDirection, Tracer, Transfer};
use canopen_master::{Address, NodeId, ds402};
use motion_io::capture::{Frame, FrameKind, Record, Time};

use super::Teller;
use super::hear::number_of;
use super::names::{Names, bytes};
use crate::output::counted;
pub(crate) use repeats::{Count, Cycle};
pub(crate) use rhythm::Rhythm;
pub(super) use words::summary;
use words::{date, lss_words};

/// How many values of one object are told, unless its values are states.
const VALUES: u32 = 4;

pub(crate) struct Story<'a> {
    names: &'a Names,
    every_frame: bool,
    out: Vec<u8>,
    /// Time of the first frame, where times are times of day.
    start: Option<i64>,
    last_time: Option<i64>,
    /// Latest time so far.
    newest: Option<i64>,
    /// Time of the line told last.
    latest: Option<i64>,
    cycles: BTreeMap<Cycle, Count>,
    /// When the client last gave up on an object.
    given_up: BTreeMap<(u16, NodeId, Address), Option<core::time::Duration>>,
    objects: BTreeMap<(u16, NodeId, Address, bool), Told>,
    /// `None`: a status word that shows no state.
    drives: BTreeMap<(u16, NodeId), Option<ds402::State>>,
    silent: BTreeMap<(u16, NodeId), u32>,
    last: Last,
}

/// What has been told of an object.
#[derive(Debug, Default)]
struct Told {
    data: Vec<u8>,
    outcome: Option<Outcome>,
    faults: String,
    values: u32,
    /// Transfers that went wrong.
    failures: u32,
    again: u64,
}

/// The line told last, and how often it came again.
#[derive(Debug, Default)]
struct Last {
    text: String,
    again: u64,
}

impl<'a> Story<'a> {
    pub(crate) fn new(names: &'a Names, every_frame: bool) -> Self {
        Self {
            names,
            every_frame,
            out: Vec::new(),
            start: None,
            last_time: None,
            newest: None,
            latest: None,
            cycles: BTreeMap::new(),
            given_up: BTreeMap::new(),
            objects: BTreeMap::new(),
            drives: BTreeMap::new(),
            silent: BTreeMap::new(),
            last: Last::default(),
        }
    }

    /// What repeats itself, so far.
    pub(crate) const fn cycles(&self) -> &BTreeMap<Cycle, Count> {
        &self.cycles
    }

    /// The state that a drive's status word last showed.
    pub(crate) fn drive(&self, bus: u16, node: NodeId) -> Option<ds402::State> {
        self.drives.get(&(bus, node)).copied().flatten()
    }

    /// Guard requests that a node has not answered since its last answer.
    pub(crate) fn unanswered(&self, bus: u16, node: NodeId) -> u32 {
        self.silent.get(&(bus, node)).copied().unwrap_or(0)
    }

    /// Something that the endpoint tells about its bus.
    pub(crate) fn remark(&mut self, time: Option<Time>, what: &str) {
        self.say(time.map(|time| time.0), None, "bus", what);
    }

    /// One line, unless it is the one before again.
    fn say(&mut self, time: Option<i64>, bus: Option<&str>, who: &str, what: &str) {
        let mut text = String::new();
        if let Some(bus) = bus {
            let _ = write!(text, "{:<6} ", one_line(bus));
        }
        let _ = write!(text, "{who:<9} {what}");
        if text == self.last.text {
            self.last.again += 1;
            return;
        }
        self.repeated();
        self.latest = time.or(self.latest);
        let _ = writeln!(self.out, "{:>12}  {text}", self.clock(time));
        self.last.text = text;
    }

    /// Seconds, of times of day those since the first frame; to the microsecond.
    fn clock(&self, time: Option<i64>) -> String {
        let since = time.map(|time| time.saturating_sub(self.start.unwrap_or(0)));
        since.map(|nanos| Time(nanos).whole_micros().to_string()).unwrap_or_default()
    }

    fn repeated(&mut self) {
        let again = core::mem::take(&mut self.last.again);
        if again > 0 {
            let times = if again == 1 { "once".into() } else { format!("{again} times") };
            let _ = writeln!(self.out, "{:>12}  … the same {times} more", "");
        }
    }

    fn pdo(
        &mut self,
        frame: &Frame,
        time: Option<i64>,
        bus: Option<&str>,
        number: u16,
        kind: &Kind,
        tracer: &Tracer,
    ) {
        let Kind::Pdo { node, direction, number: pdo } = *kind else { return };
        let name = if direction == PdoDirection::Transmit { "TPDO" } else { "RPDO" };
        if frame.kind == FrameKind::Remote {
            return self.say(time, bus, &who(node), &format!("{name} {pdo} asked for by a remote frame"));
        }
        let cycle = Cycle::Pdo(number, node, direction, pdo);
        let (first, changed) = self.cycle(cycle, time, frame.data());
        if !changed {
            return;
        }
        let objects = tracer.mapped(number, kind, frame.data()).objects();
        let bits: usize = objects.iter().map(|object| usize::from(object.bits)).sum();
        let (expected, len) = (bits.div_ceil(8), frame.len());
        let Some(count) = self.cycles.get_mut(&cycle) else { return };
        let other = !first && count.mapping != objects;
        objects.clone_into(&mut count.mapping);
        let was_short = core::mem::replace(&mut count.short, len < expected);
        if len < expected && !was_short {
            let what = format!("{name} {pdo} has {}, its mapping {expected}", counted(len, "byte", "bytes"));
            self.say(time, bus, &who(node), &what);
        }
        let mut fields = Vec::new();
        for field in tracer.mapped(number, kind, frame.data()) {
            let at = field.object.address();
            let raw = field.raw.to_le_bytes();
            let raw = raw.get(..usize::from(field.object.bits).div_ceil(8)).unwrap_or(&raw);
            if self.is_news(number, node, at, raw) || self.moves(number, node, at, raw) || first || other {
                fields.push(format!("{} = {}", self.names.short(node, at), self.names.words(node, at, raw)));
            }
        }
        if first || other || !fields.is_empty() {
            let fields = if fields.is_empty() { bytes(frame.data()) } else { fields.join("; ") };
            let begins = match (first, other) {
                (true, _) => " begins",
                (false, true) => ", mapped anew",
                (false, false) => "",
            };
            self.say(time, bus, &who(node), &format!("{name} {pdo}{begins}: {fields}"));
        }
    }

    /// Whether a value is a state that differs from the one before.
    fn is_news(&mut self, bus: u16, node: NodeId, at: Address, data: &[u8]) -> bool {
        match (at, data) {
            (Address { index: ds402::STATUS_WORD, sub: 0 }, &[low, high]) => {
                let state = StatusWord(u16::from_le_bytes([low, high])).state();
                self.drives.insert((bus, node), state) != Some(state)
            }
            (Address { index: ds402::CONTROL_WORD | ds402::MODE | ds402::MODE_DISPLAY, sub: 0 }, data) => {
                let told = self.objects.entry((bus, node, at, false)).or_default();
                let news = told.data != data;
                told.data = data.to_vec();
                news
            }
            _ => false,
        }
    }

    /// Whether a value that is no state changes for the first time: told once, so that it is seen
    /// which values live.
    fn moves(&mut self, bus: u16, node: NodeId, at: Address, data: &[u8]) -> bool {
        if matches!(at.index, ds402::STATUS_WORD | ds402::CONTROL_WORD | ds402::MODE | ds402::MODE_DISPLAY) {
            return false;
        }
        let told = self.objects.entry((bus, node, at, false)).or_default();
        if told.values == 0 {
            told.data = data.to_vec();
            told.values = 1;
        }
        let moves = told.values == 1 && told.data != data;
        told.values += u32::from(moves);
        moves
    }

    fn state(
        &mut self,
        frame: &Frame,
        time: Option<i64>,
        bus: Option<&str>,
        node: NodeId,
        is: Option<State>,
        was: Option<State>,
    ) {
        match (is, was) {
            (None, _) => {
                let data = bytes(frame.data());
                self.say(time, bus, &who(node), &format!("shows a state that there is not: {data}"));
            }
            (Some(is), None) => self.say(time, bus, &who(node), &format!("is {is}")),
            (Some(is), Some(State::BootUp)) if is != State::BootUp => {
                self.say(time, bus, &who(node), &format!("has started, is {is}"));
            }
            (Some(is), Some(was)) if is != was => {
                self.say(time, bus, &who(node), &format!("is {is} now, was {was}"));
            }
            _ => {}
        }
    }

    /// One line for every frame.
    fn raw(&mut self, record: &Record, time: Option<i64>, bus: Option<&str>, kind: &Kind) {
        let name = super::NAMES[super::name_of(record.frame.kind, kind)];
        self.repeated();
        self.last.text.clear();
        let time = time
            .map(|time| Time(time.saturating_sub(self.start.unwrap_or(0))).to_string())
            .unwrap_or_default();
        let copy = if record.loopback { "  (copy)" } else { "" };
        let channel = match kind {
            Kind::CanLink { channel } => format!(" channel {channel}"),
            _ => String::new(),
        };
        let bus = one_line(bus.unwrap_or(""));
        let _ = writeln!(self.out, "{time:>12}  {bus:<6}   · {:?}  {name}{channel}{copy}", record.frame);
    }
}

/// The name of a bus without line ends; what else could do harm is escaped where it is written.
fn one_line(name: &str) -> String {
    name.replace(['\n', '\r'], "·")
}

fn seconds(nanos: i64) -> String {
    format!("{:.1} s", nanos as f64 / 1e9)
}

fn who(node: NodeId) -> String {
    format!("node {node}")
}

impl Teller for Story<'_> {
    fn deltas(&mut self) {
        let _ = writeln!(
            self.out,
            "{:>12}  times of this capture are those since the frame before, added up here",
            ""
        );
    }

    fn frame(
        &mut self,
        record: &Record,
        time: Option<Time>,
        bus: Option<&str>,
        kind: &Kind,
        tracer: &Tracer,
    ) {
        let time = time.map(|time| time.0);
        if self.start.is_none()
            && let Some(first) = time.filter(|time| Time(*time) >= Time::EPOCH)
        {
            self.start = Some(first);
            let _ = writeln!(self.out, "{:>12}  is {}", "0.000000", date(first));
        }
        if let Some((newest, now)) =
            self.newest.zip(time).filter(|(newest, now)| newest.saturating_sub(*now) >= 1_000_000_000)
        {
            let back = seconds(newest.saturating_sub(now));
            self.say(time, None, "capture", &format!("its time goes back by {back}"));
            self.newest = time;
        }
        self.newest = self.newest.max(time);
        self.last_time = time;
        let number = number_of(record);
        if self.every_frame {
            self.raw(record, time, bus, kind);
        }
        if record.loopback {
            return;
        }
        let frame = &record.frame;
        if frame.classic().is_none() {
            if frame.kind == FrameKind::Error {
                self.say(time, bus, "bus", &errors::error_words(frame.id, frame.data()));
            } else if self.cycle(Cycle::Identifier(number, frame.id, frame.extended), time, frame.data()).0 {
                self.say(time, bus, "bus", &format!("CAN frame {frame:?}"));
            }
            return;
        }
        match *kind {
            Kind::Nmt { command, target } => {
                let whom = match target {
                    0 => "all nodes".into(),
                    1..=127 => format!("node {target}"),
                    _ => format!("node {target}, which is no node ID"),
                };
                let what = command.map_or_else(|| "an unknown command".into(), |command| command.to_string());
                self.say(time, bus, "master", &format!("tells {whom}: {what}"));
            }
            Kind::Sync { counter, .. } => {
                if self.cycle(Cycle::Sync(number), time, &[]).0 {
                    let counter = if counter.is_some() { ", with counter" } else { "" };
                    self.say(time, bus, "SYNC", &format!("begins{counter}"));
                }
            }
            Kind::Time(day) => {
                if self.cycle(Cycle::Time(number), time, &[]).0 {
                    let day = day.map_or_else(
                        || "shorter than 6 bytes".into(),
                        |day| date(i64::try_from(day.unix_ms()).unwrap_or(0).saturating_mul(1_000_000)),
                    );
                    self.say(time, bus, "TIME", &day);
                }
            }
            Kind::Emcy { node, code, register } => {
                let what = match code {
                    Some(code) if code.0 == 0 && register.is_some_and(|register| register != 0) => {
                        "an emergency is over, others are not".into()
                    }
                    Some(code) if code.0 == 0 => "emergency over: no error".into(),
                    Some(code) => format!("EMERGENCY {:04X}h, {}", code.0, code.name()),
                    None => "EMERGENCY without a code".into(),
                };
                let register =
                    register.map(|register| format!(", register {register:02X}h")).unwrap_or_default();
                let rest = match frame.data().get(3..) {
                    Some(rest) if rest.iter().any(|byte| *byte != 0) => {
                        format!(", manufacturer {}", bytes(rest))
                    }
                    _ => String::new(),
                };
                self.say(time, bus, &who(node), &format!("{what}{register}{rest}"));
            }
            Kind::Pdo { .. } => self.pdo(frame, time, bus, number, kind, tracer),
            Kind::GuardRequest { node, unanswered } => {
                let (first, _) = self.cycle(Cycle::Guarding(number, node), time, &[]);
                if first {
                    self.say(time, bus, "master", &format!("guards node {node}"));
                }
                if unanswered {
                    let silent = self.silent.entry((number, node)).or_default();
                    *silent += 1;
                    if *silent == 1 {
                        self.say(time, bus, &who(node), "does not answer when guarded");
                    }
                }
            }
            Kind::GuardReply { node, wrong_toggle, state, before, .. } => {
                if let Some(silent) = self.silent.remove(&(number, node)) {
                    self.say(time, bus, &who(node), &format!("answers again after {silent} guard requests"));
                }
                if wrong_toggle {
                    self.say(time, bus, &who(node), "guard reply with the toggle bit of the one before");
                }
                self.state(frame, time, bus, node, state, before);
            }
            Kind::Heartbeat { node, state, before } => {
                let heartbeat = Cycle::Heartbeat(number, node);
                if let Some(gap) = self.cycles.get(&heartbeat).and_then(|count| count.rhythm.silence(time)) {
                    self.say(time, bus, &who(node), &format!("its heartbeat is back after {}", seconds(gap)));
                }
                self.cycle(heartbeat, time, &[]);
                self.state(frame, time, bus, node, state, before);
            }
            Kind::BootUp { node, before } => {
                self.drives.remove(&(number, node));
                let mut silent = String::new();
                if let Some(count) = self.cycles.get_mut(&Cycle::Heartbeat(number, node)) {
                    if let Some(gap) = count.rhythm.silence(time) {
                        silent = format!(", {} after its last heartbeat", seconds(gap));
                    }
                    count.rhythm.pause();
                }
                let again = if before.is_some_and(|before| before != State::BootUp) { " again" } else { "" };
                self.say(time, bus, &who(node), &format!("boots up{again}{silent}"));
            }
            Kind::Lss(message) => {
                let (from, what) = lss_words(&message, frame.data());
                self.say(time, bus, from, &what);
            }
            Kind::CanLink { channel } => {
                let cycle = Cycle::Channel(number, channel);
                let (first, changed) = self.cycle(cycle, time, frame.data());
                let changes = self.cycles.get(&cycle).map_or(0, |count| count.changes);
                // Enough changes that it is seen how the channel lives.
                if changed && changes <= u64::from(VALUES) {
                    let begins = if first { " begins" } else { "" };
                    let more = if changes == u64::from(VALUES) { " (and so on)" } else { "" };
                    let what = format!("channel {channel}{begins}: {}{more}", bytes(frame.data()));
                    self.say(time, bus, "CAN Link", &what);
                }
            }
            Kind::SdoRequest(sdo) | Kind::SdoResponse(sdo) | Kind::SdoAbort(sdo) => {
                // The others are told as the transfers that they are part of.
                if !sdo.belongs {
                    self.stray(time, bus, number, &sdo, frame.data());
                }
            }
            _ => {
                if self.cycle(Cycle::Identifier(number, frame.id, frame.extended), time, frame.data()).0 {
                    self.say(time, bus, "bus", &format!("identifier of no known service: {frame:?}"));
                }
            }
        }
    }

    fn transfer(&mut self, transfer: &Transfer, _given: Option<Time>, bus: Option<&str>) {
        self.tell(transfer, bus, if transfer.late { ", begun before the capture" } else { "" });
    }

    fn text(&mut self) -> &mut Vec<u8> {
        &mut self.out
    }
}
