//! What `motionctl run` tells while it runs.

use core::time::Duration;

use canopen_master::NodeSet;
use canopen_master::scan::BusState;
use lb2::code::StoredFailure;
use motion_core::application::{AxisStatus, State};
use motion_core::bus::{CanBus, Role, Settings};
use motion_core::failure;
use serde_json::{Value, json};

use super::pace::Jitter;
use super::program::{Ended, Outcome, Subject};
use crate::output::Output;

const fn state_name(state: State) -> &'static str {
    match state {
        State::Disabled => "disabled",
        State::Standstill => "standstill",
        State::DiscreteMotion => "discrete-motion",
        State::ContinuousMotion => "continuous-motion",
        State::Homing => "homing",
        State::SynchronizedMotion => "synchronized-motion",
        State::Stopping => "stopping",
        State::ErrorStop => "error-stop",
    }
}

const fn role_name(role: Role) -> &'static str {
    match role {
        Role::Master => "master",
        Role::Slave => "slave",
        Role::Link => "can-link",
    }
}

/// Why a bus that is connected takes no part in what happens there; `None` if it does.
pub(super) fn silence(at: usize, bus: &CanBus) -> Option<String> {
    let Settings { inputs, outputs } = *bus.settings();
    let unused = inputs.into_iter().chain(outputs).flatten().next().is_none();
    let (number, types, bypass) = if at == 0 { (1, 326, 334) } else { (2, 358, 366) };
    match bus.role() {
        Role::Master if unused => {
            Some(format!("CAN {number} is silent: a master, and none of its objects is active ([{types}])"))
        }
        Role::Slave if bus.node().is_none() => Some(format!(
            "CAN {number} is silent until LSS gives it an address: a slave has that of its first active object \
             ([{types}]) without master bypass ([{bypass}]), and there is none"
        )),
        _ => None,
    }
}

/// Tells what changed since the last cycle.
pub(super) struct Report<'a> {
    out: &'a Output,
    states: [State; 6],
    /// Nodes that have booted, by bus.
    ready: [NodeSet; 2],
    scanning: [bool; 2],
    summary: Duration,
    cycles: u64,
}

impl<'a> Report<'a> {
    pub(super) const fn new(out: &'a Output) -> Self {
        Self {
            out,
            states: [State::Disabled; 6],
            ready: [NodeSet::EMPTY; 2],
            scanning: [false; 2],
            summary: Duration::from_secs(1),
            cycles: 0,
        }
    }

    fn event(&self, at: Duration, event: &str, mut fields: Value, text: &str) {
        let mut document = json!({ "t": at.as_secs_f64(), "event": event });
        if let (Some(whole), Some(fields)) = (document.as_object_mut(), fields.as_object_mut()) {
            whole.append(fields);
        }
        self.out.document(document, || self.out.say(&format!("{:10.3} s  {text}", at.as_secs_f64())));
    }

    /// The controller runs; `roles` are those of the buses that are connected, by place.
    pub(super) fn ready(&self, at: Duration, model: u16, cycle: Duration, roles: &[(usize, Role)]) {
        let mut text = format!("GEL {model} runs, cycle {} ms", cycle.as_millis());
        let mut buses = Vec::new();
        for (bus, role) in roles {
            let (number, role) = (bus + 1, role_name(*role));
            text += &format!(", CAN {number}: {role}");
            buses.push(json!({ "bus": number, "role": role }));
        }
        let fields = json!({ "model": model, "cycle_ms": cycle.as_millis() as u64, "buses": buses });
        self.event(at, "ready", fields, &text);
    }

    pub(super) fn object(&self, at: Duration, bus: usize, number: usize, node: u8, data: &str) {
        let (bus, object) = (bus + 1, format!("IN {number}"));
        let fields = json!({ "bus": bus, "object": object, "node": node, "data": data });
        self.event(at, "object", fields, &format!("CAN {bus}: {object} of node {node}: {data}"));
    }

    pub(super) fn channel(&self, at: Duration, bus: usize, channel: u8, data: &str) {
        let bus = bus + 1;
        let fields = json!({ "bus": bus, "channel": channel, "data": data });
        self.event(at, "channel", fields, &format!("CAN {bus}: channel {channel}: {data}"));
    }

    pub(super) fn conflict(&self, at: Duration, bus: usize, channel: u8) {
        let bus = bus + 1;
        let text = format!("CAN {bus}: another device sends on channel {channel} too");
        self.event(at, "conflict", json!({ "bus": bus, "channel": channel }), &text);
    }

    pub(super) fn axis(&mut self, at: Duration, axis: usize, status: &AxisStatus) {
        if core::mem::replace(&mut self.states[axis], status.state) == status.state {
            return;
        }
        let (number, name) = (axis + 1, state_name(status.state));
        let text = format!("axis {number}: {name} at {}", status.position);
        let fields = json!({ "axis": number, "state": name, "position": status.position });
        self.event(at, "axis", fields, &text);
    }

    pub(super) fn bus(&self, at: Duration, bus: usize, text: &str) {
        let number = bus + 1;
        self.event(at, "bus", json!({ "bus": number, "text": text }), &format!("CAN {number}: {text}"));
    }

    /// How a scan ended, and nodes that have booted, or are to boot anew.
    pub(super) fn nodes(&mut self, at: Duration, bus: usize, can: &CanBus) {
        let scanning = can.is_scanning();
        if core::mem::replace(&mut self.scanning[bus], scanning) && !scanning {
            self.scanned(at, bus + 1, can.state());
        }
        let before = core::mem::replace(&mut self.ready[bus], can.ready());
        let number = bus + 1;
        let changes =
            [("node", "ready", can.ready().without(before)), ("node", "gone", before.without(can.ready()))];
        for (event, word, nodes) in changes {
            for node in nodes.iter() {
                let fields = json!({ "bus": number, "node": node.raw(), "state": word });
                self.event(at, event, fields, &format!("CAN {number}: node {node} is {word}"));
            }
        }
    }

    fn scanned(&self, at: Duration, number: usize, state: BusState) {
        let state = if state == BusState::Ok { "OK" } else { "BUS WARN" };
        let fields = json!({ "bus": number, "state": state });
        self.event(at, "scan", fields, &format!("CAN {number}: scanned: {state}"));
    }

    pub(super) fn failure(&self, at: Duration, stored: StoredFailure) {
        let StoredFailure { axis, failure: number } = stored;
        let words = failure::text(number).unwrap_or("unknown failure");
        let fields = json!({ "axis": axis, "failure": number.0, "text": words });
        self.event(at, "failure", fields, &format!("axis {axis}: failure {}: {words}", number.0));
    }

    pub(super) fn step(&self, at: Duration, (subject, action, outcome): Ended) {
        let (word, error) = match outcome {
            Outcome::Done => ("done", None),
            Outcome::Aborted => ("aborted", None),
            Outcome::Failed(error) => ("error", Some(error)),
            Outcome::Refused => ("refused: an axis moves", None),
        };
        let action = action.name();
        let (mut fields, mut text) = match subject {
            Subject::Axis(axis) => (json!({ "axis": axis }), format!("axis {axis}")),
            Subject::Bus(bus) => (json!({ "bus": bus + 1 }), format!("CAN {}", bus + 1)),
        };
        text += &format!(": {action}: {word}");
        if let Some(fields) = fields.as_object_mut() {
            fields.extend([("do".into(), json!(action)), ("outcome".into(), json!(word))]);
        }
        if let (Some(error), Some(fields)) = (error, fields.as_object_mut()) {
            fields.insert("error".into(), json!(error.0));
            fields.insert("text".into(), json!(error.to_string()));
            text += &format!(" {:X}h, {error}", error.0);
        }
        self.event(at, "step", fields, &text);
    }

    /// Once a second, in the stream only.
    pub(super) fn cycle(&mut self, at: Duration, jitter: &Jitter) {
        if at < self.summary {
            return;
        }
        self.summary = at + Duration::from_secs(1);
        let cycles = jitter.cycles - core::mem::replace(&mut self.cycles, jitter.cycles);
        if self.out.json {
            let fields = json!({
                "cycles": cycles,
                "overruns": jitter.overruns,
                "worst_us": jitter.worst().as_micros() as u64,
            });
            self.event(at, "cycle", fields, "");
        }
    }

    pub(super) fn end(&self, at: Duration, jitter: &Jitter) {
        let fields = json!({
            "cycles": jitter.cycles,
            "overruns": jitter.overruns,
            "worst_us": jitter.worst().as_micros() as u64,
            "jitter": jitter.document(),
        });
        let mut text = format!(
            "{} cycles, {} overruns, begun at worst {} µs late",
            jitter.cycles,
            jitter.overruns,
            jitter.worst().as_micros()
        );
        for line in jitter.lines() {
            text += &format!("\n    {line}");
        }
        self.event(at, "end", fields, &text);
    }
}
