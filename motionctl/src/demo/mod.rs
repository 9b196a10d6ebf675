//! `motionctl demo`: the application example of manual A 6.11, end to end, on simulated hardware.
//!
//! [`setup`] configures a controller over LB2; [`machine`] is that controller on CAN 2 with its drive.

mod machine;
mod setup;

use core::time::Duration;
use std::path::PathBuf;

use canopen_master::scan;
use clap::Args;
use motion_core::application::{Order, Progress, State};
use pdo::NodeId;
use serde_json::{Value, json};

use crate::exit::Exit;
use crate::output::{Output, apart};
use crate::plot;
use machine::Machine;

/// The example's target, user measuring units: 65,536 a turn.
const TARGET: i32 = 1_000_000;
/// V max. `[642]`: 3000 rpm.
const V_MAX: u32 = 3_276_800;
/// t max. acceleration `[654]`.
const T_ACCELERATION: f64 = 0.5;

#[derive(Debug, Args)]
pub(crate) struct Demo {
    /// Draw position, velocity, acceleration and following error of axis 1
    #[arg(long, value_name = "F.svg")]
    plot: Option<PathBuf>,
    /// Write what axis 1 did, a line a control cycle, as `plot` reads it
    #[arg(long, value_name = "F.csv")]
    record: Option<PathBuf>,
}

pub(crate) fn run(out: &Output, arguments: &Demo) -> Result<(), Exit> {
    let files = [&arguments.record, &arguments.plot].map(Option::as_deref);
    if let [Some(record), Some(plot)] = files {
        apart(("--record", record), ("--plot", plot))?;
    }
    let plan = || {
        let files = files.iter().flatten().map(|file| format!(", write {}", file.display()));
        format!("would run the example on virtual devices{}", files.collect::<String>())
    };
    if out.only_plans(plan) {
        return Ok(());
    }
    out.say("Application example of manual A 6.11: one axis, LD 2000 on CAN 2.\n");
    let setup::Configured { storage, model, mut document } = setup::configure(out)?;

    let mut machine = Machine::power_on(storage);
    out.say(&format!(
        "\nThe GEL {model} runs with a virtual LD 2000 at address 1 of CAN 2, on virtual time; cycle {} ms.",
        machine.controller.cycle_time().as_millis()
    ));
    let scan = scan(out, &mut machine)?;
    let jog = jog(out, &mut machine)?;
    let position = position(out, &mut machine)?;
    machine.set_power(false)?;
    machine.until("the drive is disabled", |machine| machine.status().state == State::Disabled)?;

    let traffic = machine.traffic();
    let seconds = machine.now().as_secs_f64();
    out.say(&format!(
        "bus: {} frames in {seconds:.2} s: {} boot-up, {} SYNC, {} guarding requests and {} replies, {} RPDO, {} TPDO",
        traffic.all,
        traffic.boot_ups,
        traffic.sync,
        traffic.guard_requests,
        traffic.guard_replies,
        traffic.rpdo,
        traffic.tpdo
    ));
    let failures = machine.controller.failures().total();
    if failures > 0 || traffic.guard_requests != traffic.guard_replies {
        return Err(Exit::check(format!("{failures} failures were stored, or the drive did not answer")));
    }
    out.say("failures: none");
    if let Some(path) = &arguments.record {
        let name = path.display().to_string();
        let file = std::fs::File::create(path).map_err(|error| Exit::file(&name, &error))?;
        plot::write(&name, file, machine.samples.iter().copied())?;
        out.say(&format!("recorded in {name}"));
    }
    if let Some(path) = &arguments.plot {
        let title = "Manual A 6.11: axis 1 jogs, then moves to 1,000,000 (65,536 units a turn)";
        plot::draw(path, title, &machine.samples)?;
        out.say(&format!("drawn in {}", path.display()));
    }
    if let Value::Object(document) = &mut document {
        let bus = json!({
            "frames": traffic.all, "boot_ups": traffic.boot_ups, "sync": traffic.sync, "guard_requests": traffic.guard_requests,
            "guard_replies": traffic.guard_replies, "rpdo": traffic.rpdo, "tpdo": traffic.tpdo,
        });
        for (key, value) in [("scan", scan), ("jog", jog), ("position", position), ("bus", bus)] {
            document.insert(key.into(), value);
        }
    }
    out.document(document, || ());
    Ok(())
}

/// 4.3.4.4: after the CAN parameters were set, the bus is scanned.
fn scan(out: &Output, machine: &mut Machine) -> Result<Value, Exit> {
    machine.until("the drive at address 1 has been scanned and booted", |machine| {
        machine.can().is_ok_and(|bus| !bus.is_scanning() && bus.ready().contains(NodeId::MIN))
    })?;
    // New data have come and gone by the time that a person looks.
    machine.run(Duration::from_millis(100))?;
    let at = machine.now().as_secs_f64();
    let bus = machine.can()?;
    let state = bus.state();
    let row = bus.row(NodeId::MIN).ok_or_else(|| Exit::check("CAN 2 is no CANopen master"))?;
    out.say(&format!("{at:7.3} s  CAN 2: {state}"));
    out.say(&format!("           {}", scan::HEADING));
    out.say(&format!("           {row}"));
    let info = row.info.unwrap_or_default();
    if info.profile() != Some(0x0192) || info.name.text() != "SD03" {
        return Err(Exit::check("the scan did not find a drive 0192h SD03"));
    }
    Ok(json!({
        "state": state.to_string(), "node": row.node.raw(), "profile": info.profile(),
        "name": info.name.text(), "opmode": info.opmode,
    }))
}

/// Manual operation: slow forward for half a second.
fn jog(out: &Output, machine: &mut Machine) -> Result<Value, Exit> {
    machine.set_power(true)?;
    machine.until("axis 1 is enabled", |machine| machine.status().state == State::Standstill)?;
    machine.run(Duration::from_millis(100))?;
    let at = machine.now().as_secs_f64();
    let from = machine.status().position;
    machine.order(Order::Jog { forward: true, fast: false })?;
    machine.run(Duration::from_millis(500))?;
    let velocity = machine.status().velocity;
    machine.order(Order::Halt)?;
    machine.until("axis 1 stands", |machine| machine.status().state == State::Standstill)?;
    machine.run(Duration::from_millis(200))?;
    let to = machine.status().position;
    out.say(&format!(
        "{at:7.3} s  jog slow forward: from {from} to {to}, the drive turned at {velocity} units/s"
    ));
    Ok(json!({ "from": from, "to": to, "velocity": velocity }))
}

/// Seconds that a move from rest to rest takes with the trapezoid of 6.8.1.1.
fn analytic(distance: f64) -> f64 {
    let velocity = f64::from(V_MAX);
    let acceleration = velocity / T_ACCELERATION;
    if distance < velocity * velocity / acceleration {
        2.0 * (distance / acceleration).sqrt()
    } else {
        distance / velocity + velocity / acceleration
    }
}

fn position(out: &Output, machine: &mut Machine) -> Result<Value, Exit> {
    let cycle = machine.controller.cycle_time().as_secs_f64();
    let begin = machine.now();
    let from = machine.status().nominal_position;
    out.say(&format!("{:7.3} s  position to {TARGET} with V max. {V_MAX}", begin.as_secs_f64()));
    let ticket = machine.order(Order::MoveAbsolute { position: TARGET, velocity: Some(V_MAX) })?;
    machine
        .until("the nominal position is the target", |machine| machine.status().nominal_position == TARGET)?;
    let took = (machine.now() - begin).as_secs_f64();
    machine.until("actual = nominal", |machine| machine.progress(ticket) == Some(Progress::Done))?;
    let settled = (machine.now() - begin).as_secs_f64();
    let expected = analytic(f64::from(TARGET) - f64::from(from));
    machine.run(Duration::from_millis(500))?;
    let status = machine.status();
    let samples = machine.samples.iter().filter(|sample| sample.t >= begin.as_secs_f64());
    let error = samples.filter_map(|sample| sample.following_error).fold(0.0, |max: f64, e| max.max(e.abs()));
    out.say(&format!(
        "{:7.3} s  at the target after {took:.3} s (analytic {expected:.6} s, cycle {cycle:.3} s); actual = nominal after {settled:.3} s",
        begin.as_secs_f64() + took,
    ));
    out.say(&format!("           actual position {}, greatest following error {error}", status.position));
    if (took - expected).abs() > cycle || !status.at_target {
        return Err(Exit::check(format!(
            "arrival after {took:.3} s, {expected:.6} s expected within one cycle; actual position {}",
            status.position
        )));
    }
    Ok(json!({
        "from": from, "target": TARGET, "seconds": took, "analytic_seconds": expected, "cycle_seconds": cycle,
        "settled_seconds": settled, "actual": status.position, "at_target": status.at_target,
        "greatest_following_error": error,
    }))
}
