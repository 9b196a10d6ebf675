//! `motionctl bus`: virtual CAN buses for other programs.

use device_sim::can::Faults;
use motion_io::can::{Server, VirtualBus};
use serde_json::json;

use super::cli::Bus;
use super::stop_flag;
use crate::exit::Exit;
use crate::output::Output;

pub(crate) fn run(out: &Output, arguments: &Bus) -> Result<(), Exit> {
    let names = if arguments.bus.is_empty() { vec!["can0".into()] } else { arguments.bus.clone() };
    for (at, name) in names.iter().enumerate() {
        if name.is_empty() || name.contains(|c: char| c.is_whitespace() || c == '<' || c == '>') {
            return Err(Exit::usage(format!("--bus {name:?}: a name without blanks and brackets expected")));
        }
        if names.iter().take(at).any(|other| other == name) {
            return Err(Exit::usage(format!("--bus {name}: two buses of one name")));
        }
    }
    let buses = names.iter().map(|name| (name.clone(), VirtualBus::new(arguments.bitrate, Faults::NONE)));
    let listen = &arguments.listen;
    if out.only_plans(|| format!("would serve {} at {listen}", names.join(", "))) {
        return Ok(());
    }
    let stop = stop_flag()?;
    let server = Server::bind(listen, buses.collect()).map_err(|error| match error.kind() {
        std::io::ErrorKind::InvalidInput => Exit::usage(format!("--listen {listen}: HOST:PORT expected")),
        _ => Exit::trouble(format!("{listen}: {error}")),
    })?;
    let address = server.address().map_err(|error| Exit::trouble(error.to_string()))?.to_string();
    let document =
        json!({ "event": "ready", "listen": address, "buses": names, "bitrate": arguments.bitrate });
    out.document(document, || {
        let endpoints = names.iter().map(|name| format!("socketcand:{address}/{name}"));
        println!("listening on {}", endpoints.collect::<Vec<_>>().join(", "));
    });
    server.serve(&stop).map_err(|error| Exit::trouble(error.to_string()))
}
