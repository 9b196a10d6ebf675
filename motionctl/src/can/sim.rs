//! `motionctl sim drive`, `sim io`, `sim node`: virtual CANopen nodes.

use core::sync::atomic::Ordering;
use core::time::Duration;

use canopen_master::eds::write_eds;
use device_sim::canopen::{Device, FileNode, Ld2000, Node, RemoteIo, device_file};
use motion_io::can::{BusEvent, Driver, open};
use pdo::NodeId;
use serde_json::json;

use super::cli::{SimFile, SimIo, SimNode};
use super::session::endpoint;
use super::stop_flag;
use crate::cli::Global;
use crate::exit::Exit;
use crate::output::{Output, write_beside};

/// Longest time between two looks at the stop signal.
const STEP: Duration = Duration::from_millis(100);
/// `--node 255`.
const NO_NODE: u8 = 255;

/// The address of a virtual node; `None` waits for one over LSS.
pub(crate) fn address(node: u8) -> Result<Option<NodeId>, Exit> {
    if node == NO_NODE {
        return Ok(None);
    }
    NodeId::new(node).map(Some).map_err(|_| {
        Exit::usage(format!("--node {node}: 1 to 127, or 255 to wait for one over LSS expected"))
    })
}

pub(crate) fn drive(out: &Output, global: &Global, arguments: &SimNode) -> Result<(), Exit> {
    let device = Ld2000::node(address(arguments.node)?, arguments.serial_number);
    run(out, global, arguments, "drive", device)
}

pub(crate) fn io(out: &Output, global: &Global, arguments: &SimIo) -> Result<(), Exit> {
    let device = RemoteIo::node(address(arguments.node.node)?, arguments.node.serial_number, arguments.wired);
    run(out, global, &arguments.node, "io", device)
}

pub(crate) fn file(out: &Output, global: &Global, arguments: &SimFile) -> Result<(), Exit> {
    let name = arguments.eds.display().to_string();
    let bytes = crate::eds::bytes(&arguments.eds)?;
    let device = FileNode::node(&bytes, address(arguments.node.node)?, arguments.node.serial_number)
        .map_err(|error| Exit::file(&name, &error))?;
    run(out, global, &arguments.node, "node", device)
}

fn run<D: Device>(
    out: &Output,
    global: &Global,
    arguments: &SimNode,
    kind: &str,
    mut node: Node<D>,
) -> Result<(), Exit> {
    let endpoint = endpoint(global, &arguments.line)?;
    if out.only_plans(|| format!("would be {kind}, node {}, on {endpoint}", arguments.node)) {
        return Ok(());
    }
    if let Some(path) = &arguments.write_eds {
        let name = path.file_stem().map_or(kind.into(), |stem| stem.to_string_lossy().into_owned());
        write_beside(path, write_eds(&device_file(&node, &name)).as_bytes())?;
    }
    let stop = stop_flag()?;
    let port = open(&endpoint).map_err(|error| Exit::trouble(error.to_string()))?;
    let mut driver = Driver::new(port);
    let text = endpoint.to_string();
    out.document(json!({ "event": "ready", "kind": kind, "node": arguments.node, "endpoint": text }), || {
        println!("{kind}, node {}, listening on {text}", arguments.node);
    });
    while !stop.load(Ordering::Relaxed) {
        let limit = driver.now() + STEP;
        let told = |event| {
            if let BusEvent::State(_) = event {
                out.remark(event.to_string());
            }
        };
        driver.run(&mut node, limit, told).map_err(|error| Exit::trouble(format!("{text}: {error}")))?;
    }
    Ok(())
}
