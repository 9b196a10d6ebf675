//! What is known of each node by listening.

use canopen_master::emcy::ErrorCode;
use canopen_master::nmt::State;
use canopen_master::trace::{Kind, Outcome, PdoDirection, Tracer, Transfer};
use canopen_master::{NodeId, ds402};
use serde_json::{Value, json};

use super::sheet::Tone;
use super::time::{age, in_ms, seconds, since};
use crate::can::value::hex;
use crate::decode::names::text;
use crate::decode::story::{Cycle, Rhythm, Story};

/// An emergency as it was heard.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Emergency {
    code: ErrorCode,
    register: Option<u8>,
    manufacturer: Vec<u8>,
    time: Option<i64>,
}

/// What a node has sent. Times in nanoseconds.
#[derive(Debug, Default)]
pub(super) struct Node {
    /// When it was last heard, of any kind of frame.
    heard: Option<i64>,
    frames: u64,
    boot_ups: u64,
    toggle_errors: u64,
    /// The last answer to a guard request.
    answered: Option<i64>,
    /// Guard requests without an answer.
    unanswered: u64,
    device_type: Option<u32>,
    name: Option<String>,
    /// Vendor, product, revision, serial number.
    identity: [Option<u32>; 4],
    emergencies: u64,
    /// The last one that is an error.
    emergency: Option<Emergency>,
    /// It is over.
    over: bool,
    transfers: u64,
    /// Of these: refused, given up or without an answer.
    failed: u64,
}

/// The node that has sent a frame of this kind; of guarding, the one that should.
pub(super) const fn sender(kind: &Kind) -> Option<NodeId> {
    match *kind {
        Kind::Emcy { node, .. }
        | Kind::Pdo { node, direction: PdoDirection::Transmit, .. }
        | Kind::GuardRequest { node, .. }
        | Kind::GuardReply { node, .. }
        | Kind::Heartbeat { node, .. }
        | Kind::BootUp { node, .. } => Some(node),
        Kind::SdoResponse(frame) => Some(frame.node),
        Kind::SdoAbort(frame) if matches!(frame.way, canopen_master::trace::Way::Response) => {
            Some(frame.node)
        }
        _ => None,
    }
}

impl Node {
    /// A frame of the node, or a guard request to it.
    pub(super) fn frame(&mut self, time: Option<i64>, kind: &Kind, data: &[u8], remote: bool) {
        if !remote {
            self.heard = time;
            self.frames += 1;
        }
        match *kind {
            Kind::BootUp { .. } => self.boot_ups += 1,
            Kind::GuardRequest { unanswered, .. } => self.unanswered += u64::from(unanswered),
            Kind::GuardReply { wrong_toggle, .. } => {
                self.answered = time;
                self.toggle_errors += u64::from(wrong_toggle);
            }
            Kind::Emcy { code: Some(code), register, .. } => {
                self.over = code.0 == 0;
                if !self.over {
                    self.emergencies += 1;
                    let manufacturer = data.get(3..).unwrap_or(&[]).to_vec();
                    self.emergency = Some(Emergency { code, register, manufacturer, time });
                }
            }
            _ => {}
        }
    }

    /// An SDO transfer with the node has ended.
    pub(super) fn transfer(&mut self, transfer: &Transfer) {
        self.transfers += 1;
        self.failed += u64::from(transfer.outcome != Outcome::Done);
        if !transfer.is_done() || transfer.late {
            return;
        }
        let number = transfer.data.first_chunk().map(|bytes| u32::from_le_bytes(*bytes));
        match (transfer.at.index, transfer.at.sub) {
            (0x1000, 0) => self.device_type = number,
            (0x1008, 0) => {
                self.name = Some(text(&transfer.data).trim_end().to_owned());
            }
            (0x1018, sub @ 1..=4) => {
                if let Some(part) = self.identity.get_mut(usize::from(sub) - 1) {
                    *part = number;
                }
            }
            _ => {}
        }
    }
}

/// How a node shows that it lives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Control {
    name: &'static str,
    period: Option<i64>,
    /// When the last sign of life came.
    last: Option<i64>,
    missed: u64,
    silent: bool,
}

/// A node at a moment.
pub(super) struct View<'a> {
    node: &'a Node,
    id: NodeId,
    now: Option<i64>,
    state: Option<State>,
    drive: Option<ds402::State>,
    control: Option<Control>,
}

impl<'a> View<'a> {
    pub(super) fn new(
        node: &'a Node,
        (bus, id): (u16, NodeId),
        now: Option<i64>,
        story: &Story<'_>,
        tracer: &Tracer,
    ) -> Self {
        let rhythm = |cycle| story.cycles().get(&cycle).map(|count| count.rhythm);
        let (heartbeat, guarding) = (rhythm(Cycle::Heartbeat(bus, id)), rhythm(Cycle::Guarding(bus, id)));
        let last = |rhythm: Option<Rhythm>| rhythm.and_then(|rhythm| rhythm.last);
        let control = match (heartbeat, guarding) {
            (Some(rhythm), _) if last(heartbeat) >= last(guarding) => Some(Control {
                name: "heartbeat",
                period: rhythm.period,
                last: rhythm.last,
                missed: rhythm.missed_by(now),
                silent: rhythm.silence(now).is_some(),
            }),
            (_, Some(rhythm)) => Some(Control {
                name: "guarding",
                period: rhythm.period,
                last: node.answered,
                missed: node.unanswered,
                silent: story.unanswered(bus, id) > 0,
            }),
            _ => None,
        };
        Self { node, id, now, state: tracer.state(bus, id), drive: story.drive(bus, id), control }
    }

    fn device(&self) -> String {
        let profile = self.node.device_type.map(|device| match device & 0xFFFF {
            0 => "no profile".to_owned(),
            0x191 => "I/O (CiA 401)".into(),
            0x192 => "drive (CiA 402)".into(),
            profile => format!("profile {profile}"),
        });
        match (&self.node.name, profile) {
            (Some(name), Some(profile)) => format!("{name}, {profile}"),
            (Some(one), None) => one.clone(),
            (None, Some(one)) => one,
            (None, None) => String::new(),
        }
    }

    pub(super) const COLUMNS: [&'static str; 10] = [
        "node>",
        "state",
        "drive",
        "device",
        "lives by",
        "period>",
        "age>",
        "missed>",
        "SDO",
        "last emergency",
    ];

    pub(super) fn cells(&self) -> [String; 10] {
        let node = self.node;
        let shown = |state: Option<&dyn core::fmt::Display>| state.map_or("-".into(), ToString::to_string);
        let control = self.control;
        let sdo = match (node.transfers, node.failed) {
            (0, _) => String::new(),
            (transfers, 0) => transfers.to_string(),
            (transfers, failed) => format!("{transfers}, {failed} failed"),
        };
        let emergency = node.emergency.as_ref().map_or_else(String::new, |emergency| {
            let over = if self.node.over { ", over" } else { "" };
            let times =
                if node.emergencies > 1 { format!(" ({} in all)", node.emergencies) } else { String::new() };
            format!("{}{over}{times}", emergency.code)
        });
        [
            self.id.to_string(),
            shown(self.state.as_ref().map(|state| state as _)),
            shown(self.drive.as_ref().map(|state| state as _)),
            self.device(),
            control.map_or("nothing seen", |control| control.name).into(),
            control.and_then(|control| control.period).map_or_else(String::new, in_ms),
            age(self.now, control.map_or(node.heard, |control| control.last)),
            control.map_or_else(String::new, |control| {
                let silent = if control.silent { ", silent" } else { "" };
                let toggle = match node.toggle_errors {
                    0 => String::new(),
                    errors => format!(", toggle {errors}"),
                };
                format!("{}{silent}{toggle}", control.missed)
            }),
            sdo,
            emergency,
        ]
    }

    pub(super) fn tone(&self) -> Tone {
        let fault =
            self.drive == Some(ds402::State::Fault) || (self.node.emergency.is_some() && !self.node.over);
        match self.state {
            _ if self.control.is_some_and(|control| control.silent) => Tone::Bad,
            _ if fault => Tone::Bad,
            Some(State::Operational) => Tone::Good,
            Some(State::Stopped) => Tone::Warn,
            _ => Tone::Plain,
        }
    }

    pub(super) fn json(&self) -> Value {
        let node = self.node;
        let identity = node.identity.iter().any(Option::is_some).then(|| {
            let [vendor, product, revision, serial] = node.identity;
            json!({ "vendor": vendor, "product": product, "revision": revision, "serial": serial })
        });
        let control = self.control.map(|control| {
            json!({
                "kind": control.name,
                "period": seconds(control.period),
                "age": seconds(since(self.now, control.last)),
                "missed": control.missed,
                "silent": control.silent,
            })
        });
        let emergency = node.emergency.as_ref().map(|emergency| {
            json!({
                "code": emergency.code.0,
                "register": emergency.register,
                "manufacturer": hex(&emergency.manufacturer),
                "text": emergency.code.name(),
                "over": node.over,
                "age": seconds(since(self.now, emergency.time)),
            })
        });
        json!({
            "node": self.id.raw(),
            "state": self.state.map(|state| state.to_string()),
            "drive": self.drive.map(|state| state.to_string()),
            "device_type": node.device_type,
            "profile": node.device_type.map(|device| device & 0xFFFF),
            "name": node.name,
            "identity": identity,
            "frames": node.frames,
            "age": seconds(since(self.now, node.heard)),
            "error_control": control,
            "toggle_errors": node.toggle_errors,
            "boot_ups": node.boot_ups,
            "emergencies": node.emergencies,
            "emergency": emergency,
            "sdo": { "transfers": node.transfers, "failed": node.failed },
        })
    }
}
