//! `motionctl run`: a soft MotionController in real time.

mod buses;
pub(crate) mod cli;
mod config;
mod data;
mod modbus;
mod pace;
mod plants;
mod program;
mod remote;
mod report;
mod serial;
mod step;

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::path::Path;

use lb2::device::Device as _;
use lb2::telegram::BANK_LEN;
use motion_core::application::{AxisStatus, State};
use motion_core::io::Outputs;
use motion_core::parameters::get;
use motion_core::storage::Storage;
use motion_core::{AXES, Controller, STORAGE_LEN};
use motion_io::port::{Role, open};
use serde_json::json;

use crate::can::stop_flag;
use crate::exit::Exit;
use crate::output::{Output, apart, counted};
use crate::plot::{Recorder, Sample};
use crate::storage::FileStorage;
use buses::{Bus, Devices};
use config::{BusName, ComPort, Config};
use pace::Pace;
use program::{Outcome, Program, Subject};
use report::Report;
use serial::Line;
use step::Action;

/// Longest time that axes have to come to standstill when the program ends.
const STANDSTILL: Duration = Duration::from_secs(20);

pub(crate) fn run(out: &Output, arguments: &cli::Run) -> Result<(), Exit> {
    let config = Config::read(&arguments.file)?;
    let limit = match arguments.duration {
        Some(seconds) => Some(
            Duration::try_from_secs_f64(seconds)
                .map_err(|error| Exit::usage(format!("--for {seconds}: {error}")))?,
        ),
        None => None,
    };
    if let Some(record) = &arguments.record {
        apart(("the configuration", &arguments.file), ("--record", record))?;
    }
    let of_file = |exit: Exit| match exit.status {
        2 => exit.context(&arguments.file.display().to_string()),
        _ => exit,
    };
    if only_plans(out, &config, arguments.record.as_deref()).map_err(of_file)? {
        return Ok(());
    }
    let flash = match &config.controller.state {
        Some(directory) => {
            std::fs::create_dir_all(directory)
                .map_err(|error| Exit::file(&directory.display().to_string(), &error))?;
            Some(directory.join("flash.bin"))
        }
        None => None,
    };
    let recorder = arguments.record.as_deref().map(Recorder::create).transpose()?;
    let ended = begin(out, &config, flash.as_deref(), limit, recorder.as_ref()).map_err(of_file);
    // What was recorded is kept whatever ended the run.
    let recorded = recorder.map_or(Ok(()), Recorder::finish);
    ended.and(recorded)
}

/// What `sim controller` runs on CAN buses.
pub(crate) struct Device<'a> {
    pub(crate) model: u16,
    pub(crate) number: Option<u8>,
    pub(crate) serial: Option<&'a str>,
    pub(crate) can: [Option<&'a str>; 2],
    /// `KEY=VALUE`
    pub(crate) parameters: &'a [String],
    /// File for flash and retained values.
    pub(crate) state: Option<&'a Path>,
}

pub(crate) fn device(out: &Output, device: &Device<'_>) -> Result<(), Exit> {
    let Device { model, number, serial, can, parameters, state } = *device;
    let config = Config::of_controller(model, number, serial, can, parameters)?;
    if only_plans(out, &config, None)? {
        return Ok(());
    }
    begin(out, &config, state, None, None)
}

/// Whether this is a dry run, which is then told. Mistakes of the configuration are found in any case, before
/// a file, a port or a bus is touched.
fn only_plans(out: &Output, config: &Config, record: Option<&Path>) -> Result<bool, Exit> {
    prepare(config, vec![0xFF; STORAGE_LEN])?;
    let mut places = Vec::new();
    for serial in &config.serial {
        places.push(format!(", LB2 on {}", serial.endpoint()?));
    }
    for (name, text) in [(BusName::Can1, "CAN 1"), (BusName::Can2, "CAN 2")] {
        if let Some(can) = config.can(name) {
            places.push(format!(", {text} on {}", can.endpoint()?));
        }
    }
    places.extend(config.controller.state.iter().map(|state| format!(", its flash in {}", state.display())));
    places.extend(record.iter().map(|record| format!(", recorded in {}", record.display())));
    let steps = counted(config.program.len(), "step", "steps");
    let model = config.model()?.number();
    let plan = || format!("would run a GEL {model} with {steps}{}", places.concat());
    Ok(out.only_plans(plan))
}

/// A controller with the configuration's parameters, and its program.
fn prepare<S: Storage>(config: &Config, storage: S) -> Result<(Controller<S, Vec<u8>>, Program), Exit> {
    let mut controller = Controller::power_on(config.model()?, storage, vec![0; BANK_LEN]);
    set_up(&mut controller, config)?;
    data::set_up(&mut controller, &config.program)?;
    Ok((controller, Program::new(&config.program)?))
}

/// With its flash in a file, or in memory.
fn begin(
    out: &Output,
    config: &Config,
    flash: Option<&Path>,
    limit: Option<Duration>,
    recorder: Option<&Recorder>,
) -> Result<(), Exit> {
    let stop = stop_flag()?;
    match flash {
        Some(file) => {
            let storage = FileStorage::of(out, file, config.model()?)?;
            control(out, config, storage, limit, &stop, recorder)
        }
        None => control(out, config, vec![0xFF; STORAGE_LEN], limit, &stop, recorder),
    }
}

/// Sets the configuration's parameters, which must pass the loader. They are effective as if the controller
/// were switched on with them.
fn set_up<S: Storage>(controller: &mut Controller<S, Vec<u8>>, config: &Config) -> Result<(), Exit> {
    for (index, value) in config.parameters()? {
        let answer = controller.write_parameter(index, value);
        if answer.code.is_error() {
            let name = get(index).map_or(format!("[{index:03}]"), |entry| entry.to_string());
            return Err(Exit::usage(format!("{name} = {value}: {}", answer.text)));
        }
    }
    let mut fault = None;
    let loaded = controller.load(|finding| {
        fault.get_or_insert(finding);
    });
    match fault {
        Some(finding) if !loaded => Err(Exit::usage(finding.explain(controller.edited()).to_string())),
        _ => {
            controller.restart_buses();
            Ok(())
        }
    }
}

fn control(
    out: &Output,
    config: &Config,
    storage: impl Storage,
    limit: Option<Duration>,
    stop: &AtomicBool,
    recorder: Option<&Recorder>,
) -> Result<(), Exit> {
    let model = config.model()?;
    let (mut controller, mut program) = prepare(config, storage)?;
    let mut machine = plants::machine(&config.simulate)?;
    let mut extension = config.extension.as_ref().map(config::Extension::open).transpose()?;
    if let Some(server) = &mut extension {
        // The sizes of the images are known before anybody knows the address.
        controller.exchange(server);
        let address = server.address().to_string();
        out.document(json!({ "t": 0.0, "event": "modbus", "address": address }), || {
            out.say(&format!("Modbus TCP at {address}"));
        });
        if [60, 61].map(|index| controller.working().at(index, 0)) == [0, 0] {
            out.remark("[060] and [061] are 0: there are no registers, and every Modbus request is refused");
        }
        program = program.with_remote();
    }
    let mut lines = Vec::new();
    for serial in &config.serial {
        let endpoint = serial.endpoint()?;
        let port = open(&endpoint, Role::Device).map_err(|error| Exit::trouble(error.to_string()))?;
        // LB2 has the port that CoDeSys does not have (6.3.3, [006]).
        let com = match serial.port {
            ComPort::Com1 => motion_core::ComPort::Com1,
            ComPort::Com2 => motion_core::ComPort::Com2,
        };
        if controller.serial_port(com).codesys {
            out.remark(format!("{endpoint}: [006] gives this port to CoDeSys; LB2 answers all the same"));
        }
        lines.push((endpoint.to_string(), Line::new(port)));
    }
    let mut connected = Vec::new();
    for (at, name) in [BusName::Can1, BusName::Can2].into_iter().enumerate() {
        if let Some(can) = config.can(name) {
            connected.push((at, Bus::connect(&can.endpoint()?)?));
        }
    }
    let _devices = Devices::start(config)?;
    for missing in pace::real_time() {
        out.remark(missing);
    }
    for (at, _) in &connected {
        if let Some(silent) = controller.bus(*at).and_then(|bus| report::silence(*at, bus)) {
            out.remark(silent);
        }
    }
    let mut report = Report::new(out);
    let mut pace = Pace::new();
    let role = |at: usize| controller.bus(at).map(|bus| (at, bus.role()));
    let roles: Vec<_> = connected.iter().map(|(at, _)| *at).filter_map(role).collect();
    report.ready(pace.now(), model.number(), controller.cycle_time(), &roles);
    let mut told: [data::Told; 2] = Default::default();
    let mut outputs = Outputs::default();
    let mut stored = controller.failures().total();
    // Steps of the program.
    let mut failed = 0;
    let mut ending = None;
    let mut before = Duration::ZERO;
    loop {
        let cycle = controller.cycle_time();
        let now = pace.wait(cycle);
        program.advance(now);
        for (at, port) in &connected {
            if let Some(bus) = controller.bus(*at) {
                port.receive(now, bus, |event| report.bus(now, *at, &event.to_string()))?;
                told[*at].tell(&report, now, *at, bus);
            }
        }
        let resting = |status: &AxisStatus| matches!(status.state, State::Disabled | State::Standstill);
        let at_rest = (0..usize::from(AXES)).filter_map(|axis| controller.axis_status(axis)).all(resting);
        for at in program.take_scans() {
            let outcome = if at_rest && controller.scan(at) { Outcome::Done } else { Outcome::Refused };
            failed += usize::from(outcome.is_failure());
            report.step(now, (Subject::Bus(at), Action::Scan, outcome));
        }
        let inputs = machine.run(cycle.as_millis() as u32, &outputs);
        if let Some(bus) = &mut extension {
            controller.exchange(bus);
        }
        outputs = controller.cycle(now, &inputs, &mut program);
        for (at, port) in &connected {
            if let Some(bus) = controller.bus(*at) {
                port.send(now, bus);
                report.nodes(now, *at, bus);
            }
        }
        for (name, line) in &mut lines {
            line.serve(now, &mut controller).map_err(|error| Exit::file(name, &error))?;
        }
        controller.advance(now.saturating_sub(before)).map_err(|error| Exit::trouble(error.to_string()))?;
        before = now;
        let activated = usize::try_from(controller.working().at(0, 0)).unwrap_or(0);
        for axis in 0..usize::from(AXES) {
            if let Some(status) = controller.axis_status(axis) {
                report.axis(now, axis, status);
                if let Some(recorder) = recorder.filter(|_| axis < activated) {
                    recorder.put(Sample::new(now, axis as u8 + 1, status));
                }
            }
        }
        let total = controller.failures().total();
        let new = total.wrapping_sub(core::mem::replace(&mut stored, total)) as usize;
        let list = controller.failures().stored();
        list.iter().skip(list.len().saturating_sub(new)).for_each(|&failure| report.failure(now, failure));
        for ended in program.ended.drain(..) {
            failed += usize::from(ended.2.is_failure());
            report.step(now, ended);
        }
        if let Some(trouble) = recorder.and_then(Recorder::poll_trouble) {
            out.remark(format!("nothing is recorded any more: {trouble}"));
        }
        report.cycle(now, &pace.jitter);
        if ending.is_none() && (stop.load(Ordering::Relaxed) || limit.is_some_and(|limit| now >= limit)) {
            program.stop();
            ending = Some(now);
        } else if let Some(since) = ending {
            let resting = |axis| controller.axis_status(axis).is_none_or(|s| s.state == State::Disabled);
            if (0..usize::from(AXES)).all(resting) {
                break;
            }
            if now > since + STANDSTILL {
                report.end(now, &pace.jitter);
                return Err(Exit::check("an axis did not come to standstill"));
            }
        }
    }
    report.end(pace.now(), &pace.jitter);
    // What the last moments brought is retained like a battery would.
    controller.advance(Duration::from_secs(60)).map_err(|error| Exit::trouble(error.to_string()))?;
    match failed {
        0 => Ok(()),
        1 => Err(Exit::check("a step of the program failed")),
        _ => Err(Exit::check(format!("{failed} steps of the program failed"))),
    }
}
