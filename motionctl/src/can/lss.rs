//! `motionctl can lss …`: layer setting services.

use core::time::Duration;

use canopen_master::lss::{BitTiming, Identity, Mode, Operation, Outcome};
use canopen_master::master::Event;
use serde_json::json;

use super::cli::{Lss, LssTarget};
use super::session::{Session, node_id};
use super::value::number;
use crate::cli::Global;
use crate::exit::Exit;
use crate::output::Output;

/// Node ID byte of a device without one.
const NO_NODE: u8 = 255;

/// Fastscans that are made before the last one's outcome counts.
const SCANS: usize = 5;

pub(crate) fn run(out: &Output, global: &Global, command: &Lss) -> Result<(), Exit> {
    carry_out(out, global, command).inspect_err(|exit| {
        // As of other services, JSON readers get what the devices did not do.
        if matches!(exit.status, 3 | 4) {
            out.document(json!({ "error": exit.message }), || {});
        }
    })
}

fn carry_out(out: &Output, global: &Global, command: &Lss) -> Result<(), Exit> {
    match command {
        Lss::Fastscan { line } => {
            let mut session = Session::open(global, line)?;
            // Only waiting devices take part, and none but the one found is to be in configuration then.
            operate(&mut session, Operation::SwitchGlobal(Mode::Waiting))?;
            let mut outcome = operate(&mut session, Operation::Fastscan)?;
            // An answer that came later than its step took is a wrong bit, which nobody confirms.
            for _ in 1..SCANS {
                if matches!(outcome, Outcome::Unconfirmed(_)) {
                    outcome = operate(&mut session, Operation::Fastscan)?;
                }
            }
            match outcome {
                Outcome::Identity(identity) => {
                    show(out, identity, None);
                    Ok(())
                }
                Outcome::TimedOut => {
                    Err(Exit { status: 3, message: "no device without node ID answered".into() })
                }
                other => Err(failed(other)),
            }
        }
        Lss::Identify { target } => {
            let (mut session, outcome) = with_target(global, target, Operation::InquireIdentity)?;
            let Outcome::Identity(identity) = outcome else { return Err(failed(outcome)) };
            let node = match operate(&mut session, Operation::InquireNodeId)? {
                Outcome::NodeId(node) => Some(node.map_or(NO_NODE, canopen_master::NodeId::raw)),
                _ => None,
            };
            show(out, identity, node);
            Ok(())
        }
        Lss::SetNode { node, target } => {
            let wanted = if *node == NO_NODE { None } else { Some(node_id(*node)?) };
            if out.only_plans(|| format!("would give the device node ID {node}")) {
                return Ok(());
            }
            let (mut session, outcome) = with_target(global, target, Operation::ConfigureNodeId(wanted))?;
            done(outcome)?;
            // A device without node ID starts when it leaves configuration.
            operate(&mut session, Operation::SwitchGlobal(Mode::Waiting))?;
            session.flush()?;
            out.document(json!({ "set_node": node }), || out.say(&format!("node ID {node} set")));
            Ok(())
        }
        Lss::SetBitTiming { kbits, target } => {
            let rate = BitTiming::from_kbits(*kbits).ok_or_else(|| {
                Exit::usage(format!("{kbits}: 1000, 800, 500, 250, 125, 50, 20 or 10 kbit/s expected"))
            })?;
            if out.only_plans(|| format!("would give the device {kbits} kbit/s")) {
                return Ok(());
            }
            let (_, outcome) = with_target(global, target, Operation::ConfigureBitTiming(rate))?;
            done(outcome)?;
            let text = "set; `store` keeps it, the device uses it after its next start";
            out.document(json!({ "set_bit_timing": kbits }), || out.say(&format!("{kbits} kbit/s {text}")));
            Ok(())
        }
        Lss::Store { target } => {
            if out.only_plans(|| "would let the device keep node ID and bit rate".into()) {
                return Ok(());
            }
            let (mut session, outcome) = with_target(global, target, Operation::Store)?;
            done(outcome)?;
            operate(&mut session, Operation::SwitchGlobal(Mode::Waiting))?;
            session.flush()?;
            out.document(json!({ "stored": true }), || out.say("stored"));
            Ok(())
        }
    }
}

/// Carries an operation out on the device with `--identity`, on the one in configuration, or if there is
/// none on all.
fn with_target(
    global: &Global,
    target: &LssTarget,
    operation: Operation,
) -> Result<(Session, Outcome), Exit> {
    let identity = target.identity.as_deref().map(identity).transpose()?;
    let mut session = Session::open(global, &target.line)?;
    if let Some(identity) = identity {
        // A device is only selected while it waits.
        operate(&mut session, Operation::SwitchGlobal(Mode::Waiting))?;
        if operate(&mut session, Operation::Select(identity))? != Outcome::Done {
            return Err(Exit { status: 3, message: "no device with this identity answered".into() });
        }
    }
    let mut outcome = if identity.is_some() { operate } else { operate_alone }(&mut session, operation)?;
    if outcome == Outcome::TimedOut && identity.is_none() {
        operate(&mut session, Operation::SwitchGlobal(Mode::Configuration))?;
        outcome = operate_alone(&mut session, operation)?;
        if matches!(outcome, Outcome::Several(_)) {
            operate(&mut session, Operation::SwitchGlobal(Mode::Waiting))?;
            session.flush()?;
        }
    }
    Ok((session, outcome))
}

/// Carries an operation out unless several devices are in configuration, all of which would obey.
fn operate_alone(session: &mut Session, operation: Operation) -> Result<Outcome, Exit> {
    let before = session.garbled();
    match operate(session, Operation::InquireIdentity)? {
        Outcome::TimedOut if session.garbled() != before => Err(Exit::refused(
            "bus errors instead of an answer: more than one device may be in configuration; give --identity",
        )),
        // A device need not say who it is to be configured.
        Outcome::Identity(_) | Outcome::TimedOut if operation != Operation::InquireIdentity => {
            operate(session, operation)
        }
        outcome => Ok(outcome),
    }
}

fn operate(session: &mut Session, operation: Operation) -> Result<Outcome, Exit> {
    session.master().lss(operation).map_err(|error| Exit::trouble(error.to_string()))?;
    let outcome = session.wait(Duration::MAX, |event| match event {
        Event::Lss { outcome, .. } => Some(outcome),
        _ => None,
    })?;
    outcome.ok_or_else(|| Exit::trouble("the operation has no outcome"))
}

fn done(outcome: Outcome) -> Result<(), Exit> {
    if outcome == Outcome::Done { Ok(()) } else { Err(failed(outcome)) }
}

fn failed(outcome: Outcome) -> Exit {
    match outcome {
        Outcome::TimedOut => Exit { status: 3, message: "no device answered".into() },
        Outcome::Refused(refusal) => {
            Exit::refused(format!("the device refused: code {}, specific {}", refusal.code, refusal.specific))
        }
        Outcome::Unconfirmed(part) => {
            Exit::refused(format!("devices answered, but none confirmed its number: {part:?}"))
        }
        Outcome::Several(part) => Exit::refused(format!(
            "more than one device answers, they differ in 1018h:{:02X}h; give --identity",
            part as u8 + 1
        )),
        other => Exit::trouble(format!("{other:?}")),
    }
}

fn show(out: &Output, identity: Identity, node: Option<u8>) {
    let Identity { vendor, product, revision, serial } = identity;
    let mut document =
        json!({ "vendor": vendor, "product": product, "revision": revision, "serial": serial });
    if let Some(node) = node {
        document["node"] = json!(node);
    }
    out.document(document, || {
        println!(
            "vendor 0x{vendor:X}, product 0x{product:X}, revision 0x{revision:X}, serial number 0x{serial:X}"
        );
        match node {
            Some(NO_NODE) => println!("no node ID"),
            Some(node) => println!("node ID {node}"),
            None => {}
        }
    });
}

fn identity(text: &str) -> Result<Identity, Exit> {
    let numbers: Option<Vec<u32>> =
        text.split(':').map(|part| number(part).and_then(|number| u32::try_from(number).ok())).collect();
    match numbers.as_deref() {
        Some(&[vendor, product, revision, serial]) => Ok(Identity { vendor, product, revision, serial }),
        _ => Err(Exit::usage(format!("--identity {text:?}: VENDOR:PRODUCT:REVISION:SERIAL expected"))),
    }
}
