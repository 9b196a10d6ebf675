//! The real program against nodes that answer wrongly or not at all, and against being stopped.
#![cfg(unix)]

#[path = "common/can.rs"]
mod common;

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::process::Child;
use std::sync::Arc;
use std::thread::JoinHandle;

use common::{Bench, Running};
use embedded_can::StandardId;
use motion_io::can::Event;
use pdo::Frame;
use serde_json::{Value, json};

/// The node whose answers the tests make up.
const NODE: u16 = 50;

/// Answers frames on a bus, until dropped.
struct Fake {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Fake {
    /// Node [`NODE`] answers every SDO request with these bytes.
    fn server(bench: &Bench, mut answer: impl FnMut([u8; 8]) -> Vec<u8> + Send + 'static) -> Self {
        Self::new(bench, move |frame| match (frame.standard_id(), <[u8; 8]>::try_from(frame.data())) {
            (Some(id), Ok(request)) if id == 0x600 + NODE => match &answer(request)[..] {
                [] => None,
                bytes => embedded_can::Frame::new(StandardId::new(0x580 + NODE)?, bytes),
            },
            _ => None,
        })
    }

    fn new(bench: &Bench, mut answer: impl FnMut(&Frame) -> Option<Frame> + Send + 'static) -> Self {
        let mut port = motion_io::can::open(&bench.endpoint.parse().unwrap()).unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            while !stopped.load(Ordering::Relaxed) {
                if let Ok(Some(Event::Frame(frame))) = port.receive(Duration::from_millis(20))
                    && let Some(frame) = answer(&frame)
                {
                    port.send(&frame).unwrap();
                }
            }
        });
        Self { stop, thread: Some(thread) }
    }
}

impl Drop for Fake {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// What a command says that ends so.
#[track_caller]
fn told(bench: &Bench, arguments: &[&str], status: i32) -> (Value, String) {
    let output = bench.run(arguments);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(status), "{arguments:?}: {said}");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    (text.lines().last().map_or(Value::Null, |line| serde_json::from_str(line).unwrap()), said)
}

fn interrupt(child: &Child) {
    let process = rustix::process::Pid::from_child(child);
    rustix::process::kill_process(process, rustix::process::Signal::INT).unwrap();
}

#[test]
fn several_lss_devices_in_configuration_are_told_and_not_configured() {
    let mut bench = Bench::new();
    bench.sim(&["io", "--node", "255", "--serial-number", "1"]);
    bench.sim(&["io", "--node", "255", "--serial-number", "2"]);
    for command in [&["lss", "identify"][..], &["lss", "set-node", "20"], &["lss", "store"]] {
        let (_, said) = told(&bench, command, 4);
        assert!(said.contains("more than one device answers"), "{said}");
    }
    // The first one found was left in configuration beside the second one.
    bench.can(&["lss", "fastscan"], 0);
    let found = bench.can(&["lss", "fastscan"], 0);
    bench.can(&["lss", "set-node", "22"], 0);
    assert_eq!(bench.can(&["scan", "--nodes", "22"], 0)["nodes"][0]["identity"]["serial"], found["serial"]);
    assert_ne!(bench.can(&["lss", "fastscan"], 0)["serial"], found["serial"]);
}
