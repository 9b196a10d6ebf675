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
    for name in &names {
        if name.is_empty() || name.contains(|c: char| c.is_whitespace() || c == '<' || c == '>') {
            return Err(Exit::usage(format!("--bus {name:?}: a name without blanks and brackets expected")));
        }
    }
    let buses = names.iter().map(|name| (name.clone(), VirtualBus::new(arguments.bitrate, Faults::NONE)));
    let stop = stop_flag()?;
    let server = Server::bind(&arguments.listen, buses.collect())
        .map_err(|error| Exit::trouble(format!("{}: {error}", arguments.listen)))?;
    let address = server.address().map_err(|error| Exit::trouble(error.to_string()))?.to_string();
    let document =
        json!({ "event": "ready", "listen": address, "buses": names, "bitrate": arguments.bitrate });
    out.document(document, || {
        let endpoints = names.iter().map(|name| format!("socketcand:{address}/{name}"));
        println!("listening on {}", endpoints.collect::<Vec<_>>().join(", "));
    });
    server.serve(&stop).map_err(|error| Exit::trouble(error.to_string()))
}
