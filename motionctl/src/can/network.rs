//! `motionctl can scan`, `nmt`, `guard`, `emcy`, `monitor`: the network as a whole.

use core::sync::atomic::Ordering;
use core::time::Duration;

use canopen_master::NodeSet;
use canopen_master::guarding::{self, Event as GuardEvent};
use canopen_master::master::Event;
use canopen_master::nmt::{Command, State, Target};
use canopen_master::trace::Tracer;
use canopen_master::{NodeId, scan};
use motion_io::can::{Event as PortEvent, open};
use motion_io::capture::{Record, Time};
use serde_json::{Value, json};

use super::cli::{CanLine, Nmt, Stream};
use super::record::{listen, recorded};
use super::session::{Session, endpoint, node_id};
use super::stop_flag;
use super::value::hex;
use crate::cli::Global;
use crate::decode::{kind_name, node_of};
use crate::exit::Exit;
use crate::output::Output;

/// The longest step of a stream between two looks at the stop signal.
pub(super) const STEP: Duration = Duration::from_millis(100);
/// Nodes that send no heartbeat have so long to show their state when asked.
const SHOW: Duration = Duration::from_millis(100);

/// Decimal node IDs and ranges: `1-16,20`.
fn node_list(text: &str) -> Result<NodeSet, Exit> {
    let wrong = || Exit::usage(format!("--nodes {text:?}: node IDs 1 to 127 such as 1-16,20 expected"));
    let mut nodes = NodeSet::EMPTY;
    for part in text.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let id = |text: &str| text.trim().parse().ok().and_then(|id| NodeId::new(id).ok()).ok_or_else(wrong);
        let (first, last) = (id(first)?, id(last)?);
        if first > last {
            return Err(wrong());
        }
        NodeId::all().filter(|node| (first..=last).contains(node)).for_each(|node| nodes.insert(node));
    }
    Ok(nodes)
}

fn state_json(state: Option<State>) -> Value {
    state.map_or(Value::Null, |state| json!(state.to_string()))
}

/// Asks by one guarding request each for the states that are not known.
fn show_states(session: &mut Session, nodes: NodeSet) -> Result<(), Exit> {
    let now = session.now();
    let config = guarding::Config { period_ms: 10_000, life_time_factor: 1 };
    let unknown: Vec<NodeId> = nodes.iter().filter(|node| session.master().state(*node).is_none()).collect();
    for node in &unknown {
        session
            .master()
            .set_guarding(now, *node, Some(config))
            .map_err(|error| Exit::trouble(error.to_string()))?;
    }
    let limit = now + SHOW;
    loop {
        let known = unknown.iter().all(|node| session.master().state(*node).is_some());
        if known || session.now() >= limit {
            return Ok(());
        }
        session.step(limit)?;
        while session.master().poll_event().is_some() {}
    }
}

/// A device's name: what is no text is replaced, and what the scan has cut is marked.
fn name_text(name: &scan::Name) -> String {
    let bytes = name.bytes();
    let end = bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    let mark = if name.is_cut() { "…" } else { "" };
    String::from_utf8_lossy(bytes.get(..end).unwrap_or(bytes)).into_owned() + mark
}

pub(crate) fn scan(out: &Output, global: &Global, line: &CanLine, nodes: Option<&str>) -> Result<(), Exit> {
    let nodes = nodes.map_or(Ok(NodeSet::up_to(NodeId::MAX)), node_list)?;
    let mut session = Session::open(global, line)?;
    let answer = if global.timeout.is_some() { session.answer() } else { scan::ANSWER };
    let options = scan::Options { answer, identity: true, opmode: true };
    session.master().scan(nodes, options).map_err(|error| Exit::trouble(error.to_string()))?;
    let found = session.wait(Duration::MAX, |event| match event {
        Event::Scanned { found, .. } => Some(found),
        _ => None,
    })?;
    let found = found.unwrap_or(NodeSet::EMPTY);
    show_states(&mut session, found)?;
    let mut list = Vec::new();
    let mut rows = Vec::new();
    for node in found.iter() {
        let state = session.master().state(node);
        let Some(info) = session.master().info(node).copied() else { continue };
        let identity = info.identity.map(|identity| {
            json!({
                "vendor": identity.vendor,
                "product": identity.product,
                "revision": identity.revision,
                "serial": identity.serial,
            })
        });
        let name = name_text(&info.name);
        list.push(json!({
            "node": node.raw(),
            "profile": info.profile(),
            "device_type": info.device_type,
            "name": name,
            "identity": identity,
            "opmode": info.opmode,
            "state": state_json(state),
        }));
        let profile = info.profile().map_or("-".into(), |profile| format!("{profile:04X}h"));
        let state = state.map_or("-".into(), |state| state.to_string());
        rows.push(format!("{:>4}  {profile:7}  {name:24}  {state}", node.raw()));
    }
    out.document(json!({ "nodes": list }), || {
        println!("node  profile  name                      state");
        rows.iter().for_each(|row| println!("{row}"));
        if rows.is_empty() {
            println!("nobody answered");
        }
    });
    Ok(())
}

pub(crate) fn nmt(
    out: &Output,
    global: &Global,
    line: &CanLine,
    command: Nmt,
    node: &str,
) -> Result<(), Exit> {
    let command = match command {
        Nmt::Start => Command::Start,
        Nmt::Stop => Command::Stop,
        Nmt::Preop => Command::EnterPreOperational,
        Nmt::ResetNode => Command::ResetNode,
        Nmt::ResetComm => Command::ResetCommunication,
    };
    let target = match node {
        "all" => Target::All,
        text => {
            let raw =
                text.parse().map_err(|_| Exit::usage(format!("{text:?}: a node ID or all expected")))?;
            Target::Node(node_id(raw)?)
        }
    };
    if out.only_plans(|| format!("would send {command} to {node}")) {
        return Ok(());
    }
    let mut session = Session::open(global, line)?;
    let now = session.now();
    session.master().nmt(now, command, target).map_err(|error| Exit::trouble(error.to_string()))?;
    let mut shown: Vec<(NodeId, State)> = Vec::new();
    let mut note = |node, state| {
        shown.retain(|(known, _)| *known != node);
        shown.push((node, state));
    };
    let outcome = session.wait(Duration::MAX, |event| match event {
        Event::Nmt { confirmed, missing, .. } => Some((confirmed, missing)),
        Event::BootUp(node) => {
            note(node, State::BootUp);
            None
        }
        Event::State { node, state } => {
            note(node, state);
            None
        }
        _ => None,
    })?;
    let (mut confirmed, missing) = outcome.unwrap_or((NodeSet::EMPTY, NodeSet::EMPTY));
    if target == Target::All {
        // Nobody has been heard before: who sends no heartbeat is asked.
        let all = NodeSet::up_to(NodeId::MAX);
        show_states(&mut session, all)?;
        for node in all.iter() {
            if let Some(state) = session.master().state(node) {
                shown.retain(|(known, _)| *known != node);
                shown.push((node, state));
            }
        }
        let there = shown.iter().filter(|(_, state)| *state == command.leads_to());
        there.for_each(|(node, _)| confirmed.insert(*node));
    }
    shown.sort_by_key(|(node, _)| *node);
    let states: Vec<_> =
        shown.iter().map(|(node, state)| json!({ "node": node.raw(), "state": state.to_string() })).collect();
    let ids = |set: NodeSet| set.iter().map(NodeId::raw).collect::<Vec<_>>();
    let document = json!({
        "command": command.to_string(),
        "node": target.raw(),
        "confirmed": ids(confirmed),
        "missing": ids(missing),
        "nodes": states,
    });
    out.document(document, || {
        for (node, state) in &shown {
            println!("node {node}: {state}");
        }
        if shown.is_empty() && missing.is_empty() {
            println!("sent; no node has shown its state since");
        }
    });
    if missing.is_empty() {
        return Ok(());
    }
    Err(Exit { status: 3, message: format!("node {node} did not show that it is {}", command.leads_to()) })
}

/// Runs a stream until `--for` is over or a signal comes.
fn stream(
    session: &mut Session,
    stream: &Stream,
    mut turn: impl FnMut(&mut Session, Duration) -> Result<(), Exit>,
) -> Result<(), Exit> {
    let stop = stop_flag()?;
    let end = stream.limit.map_or(Duration::MAX, |limit| session.now().saturating_add(limit));
    while !stop.load(Ordering::Relaxed) && session.now() < end {
        let limit = (session.now() + STEP).min(end);
        turn(session, limit)?;
    }
    Ok(())
}

pub(crate) fn guard(
    out: &Output,
    global: &Global,
    line: &CanLine,
    nodes: &[u8],
    (period, life): (Duration, u8),
    run: &Stream,
) -> Result<(), Exit> {
    let period_ms = u16::try_from(period.as_millis()).ok().filter(|ms| *ms > 0).ok_or_else(|| {
        Exit::usage(format!("--period {}: 0.001 to 65.535 s expected", period.as_secs_f64()))
    })?;
    let config = guarding::Config { period_ms, life_time_factor: life };
    let nodes = nodes.iter().map(|node| node_id(*node)).collect::<Result<Vec<_>, _>>()?;
    let mut session = Session::open(global, line)?;
    let now = session.now();
    for node in &nodes {
        session
            .master()
            .set_guarding(now, *node, Some(config))
            .map_err(|error| Exit::trouble(error.to_string()))?;
    }
    let mut lost = NodeSet::EMPTY;
    stream(&mut session, run, |session, limit| {
        session.step(limit)?;
        while let Some(event) = session.master().poll_event() {
            let (node, event) = match event {
                Event::Guarding { node, event: GuardEvent::Lost } => {
                    lost.insert(node);
                    (node, "lost")
                }
                Event::Guarding { node, event: GuardEvent::Back } => {
                    lost.remove(node);
                    (node, "back")
                }
                Event::Guarding { node, event: GuardEvent::Heartbeats } => {
                    out.remark(format!("node {node} sends heartbeats (1017h); it cannot be guarded as well"));
                    (node, "heartbeats")
                }
                Event::Guarding { node, event: GuardEvent::Toggle { .. } } => (node, "toggle-error"),
                Event::State { node, .. } | Event::BootUp(node) if nodes.contains(&node) => (node, "state"),
                _ => continue,
            };
            let (t, state) = (session.now().as_secs_f64(), session.master().state(node));
            out.line(
                json!({ "t": t, "node": node.raw(), "event": event, "state": state_json(state) }),
                || {
                    let state = state.map_or("not known".into(), |state| state.to_string());
                    format!("{t:10.3}  node {node}: {event}, {state}")
                },
            );
        }
        Ok(())
    })?;
    let silent: NodeSet = lost.iter().filter(|node| session.master().state(*node).is_none()).collect();
    match (silent.is_empty(), lost.is_empty()) {
        (false, _) => Err(Exit { status: 3, message: format!("never heard: node {silent}") }),
        (_, false) => Err(Exit::check(format!("still lost: node {lost}"))),
        _ => Ok(()),
    }
}

pub(crate) fn emcy(out: &Output, global: &Global, line: &CanLine, run: &Stream) -> Result<(), Exit> {
    let mut session = Session::open(global, line)?;
    stream(&mut session, run, |session, limit| {
        session.step(limit)?;
        while let Some(event) = session.master().poll_event() {
            let Event::Emergency { node, emergency } = event else { continue };
            let t = session.now().as_secs_f64();
            let document = json!({
                "t": t,
                "node": node.raw(),
                "code": emergency.code.0,
                "register": emergency.register,
                "data": hex(&emergency.data),
                "text": emergency.code.name(),
            });
            out.line(document, || {
                let data = hex(&emergency.data);
                format!(
                    "{t:10.3}  node {node}: {}, register {:02X}h, data {data}",
                    emergency.code, emergency.register
                )
            });
        }
        Ok(())
    })
}

pub(crate) fn monitor(out: &Output, global: &Global, line: &CanLine, run: &Stream) -> Result<(), Exit> {
    let limit = run.limit;
    let mut port = open(&endpoint(global, line)?).map_err(|error| Exit::trouble(error.to_string()))?;
    let mut tracer = Tracer::new();
    listen(&mut *port, limit, &*stop_flag()?, |now, event| {
        let t = now.as_secs_f64();
        match event {
            Some(PortEvent::Frame(frame)) => {
                let kind = tracer.handle_frame(Some(now), 0, &frame);
                while tracer.poll_event().is_some() {}
                let (name, node) = (kind_name(&kind), node_of(&kind));
                let Some(Record { frame: seen, .. }) = recorded(&frame, Time::from_zero(now)) else {
                    return Ok(());
                };
                let document = json!({
                    "t": t,
                    "id": seen.id,
                    "ext": seen.extended,
                    "rtr": frame.is_remote(),
                    "data": hex(frame.data()),
                    "node": node,
                    "kind": name,
                });
                out.line(document, || format!("{t:10.6}  {frame}  {name}"));
            }
            Some(PortEvent::Bus(event)) => {
                let text = event.to_string();
                let document = json!({ "t": t, "kind": "error-frame", "text": text });
                out.line(document, || format!("{t:10.6}  {text}"));
            }
            _ => {}
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_nodes() {
        let ids = |text| node_list(text).map(|set| set.iter().map(NodeId::raw).collect::<Vec<_>>());
        assert_eq!(ids("1-3,20").unwrap(), [1, 2, 3, 20]);
        assert_eq!(ids("127").unwrap(), [127]);
        for wrong in ["", "0", "128", "3-1", "a"] {
            assert_eq!(ids(wrong).unwrap_err().status, 2, "{wrong}");
        }
    }
}
