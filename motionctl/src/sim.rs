//! `motionctl sim …`: virtual devices.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;

use lb2::device::Device;
use lb2::telegram::BANK_LEN;
use motion_core::storage::Storage;
use motion_core::{Controller, Model, STORAGE_LEN};
use motion_io::endpoint::Endpoint;
use motion_io::lb2::serve;
use motion_io::port::{Role, open};
use serde_json::json;

use crate::can::{self, stop_flag};
use crate::cli::{Global, Sim};
use crate::connect::{ChoiceOf, choose};
use crate::exit::Exit;
use crate::output::Output;
use crate::run;
use crate::storage::FileStorage;

pub(crate) fn start(out: &Output, global: &Global, command: &Sim) -> Result<(), Exit> {
    let (model, serial, can, set, state, device) = match command {
        Sim::Controller { model, serial, can1, can2, set, state, device } => {
            (*model, serial.as_deref(), [can1.as_deref(), can2.as_deref()], set, state.as_deref(), *device)
        }
        Sim::Drive(arguments) => return can::sim::drive(out, global, arguments),
        Sim::Io(arguments) => return can::sim::io(out, global, arguments),
        Sim::Node(arguments) => return can::sim::file(out, global, arguments),
        Sim::Linmot(arguments) => return crate::linmot::sim::run(out, global, arguments),
    };
    let named = |given: Option<&str>, what| given.map(|given| choose(global, Some(given), what)).transpose();
    let serial = named(serial, ChoiceOf::Port)?;
    let [can1, can2] = can;
    let can = [named(can1, ChoiceOf::Can)?, named(can2, ChoiceOf::Can)?];
    let (serial, can) = (serial.as_deref(), can.each_ref().map(Option::as_deref));
    let Some(line) = serial.filter(|_| can == [None; 2] && set.is_empty()) else {
        let whole = run::Device { model, number: device, serial, can, parameters: set, state };
        return run::device(out, &whole);
    };
    let model = Model::from_number(model)
        .ok_or_else(|| Exit::usage(format!("--model {model}: 8230, 8231, 8235 or 8236 expected")))?;
    let endpoint: Endpoint =
        line.parse().map_err(|error: motion_io::endpoint::EndpointError| Exit::usage(error.to_string()))?;
    if out.only_plans(|| format!("would be GEL {} on {endpoint}", model.number())) {
        return Ok(());
    }
    let stop = stop_flag()?;
    match state {
        Some(path) => {
            let storage = FileStorage::of(out, path, model)?;
            controller(out, model, storage, &endpoint, device, &stop)
        }
        None => controller(out, model, vec![0xFF; STORAGE_LEN], &endpoint, device, &stop),
    }
}

fn controller(
    out: &Output,
    model: Model,
    storage: impl Storage,
    endpoint: &Endpoint,
    device: Option<u8>,
    stop: &AtomicBool,
) -> Result<(), Exit> {
    let mut controller = Controller::power_on(model, storage, vec![0; BANK_LEN]);
    if let Some(number) = device {
        if controller.write_parameter(5, i32::from(number)).code.is_error() {
            return Err(Exit::usage(format!("--device {number}: 0 to 31 expected")));
        }
        controller.load(|_| ());
    }
    let mut port = open(endpoint, Role::Device).map_err(|error| Exit::trouble(error.to_string()))?;
    let number = model.number();
    out.document(json!({ "event": "ready", "model": number, "endpoint": endpoint.to_string() }), || {
        out.say(&format!("GEL {number} listening on {endpoint}"));
    });
    let mut trouble = None;
    serve(port.as_mut(), &mut controller, stop, |controller, elapsed| {
        if let Err(error) = controller.advance(elapsed) {
            trouble = Some(error);
            stop.store(true, Ordering::Relaxed);
        }
    })
    .map_err(|error| Exit::file(&endpoint.to_string(), &error))?;
    // What the last moments brought is retained like a battery would.
    let retained = controller.advance(Duration::from_secs(60));
    match trouble.or(retained.err()) {
        Some(error) => Err(Exit::trouble(error.to_string())),
        None => Ok(()),
    }
}
