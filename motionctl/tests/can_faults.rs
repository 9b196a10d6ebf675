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
        let (document, said) = told(&bench, command, 4);
        assert!(said.contains("more than one device answers"), "{said}");
        assert!(document["error"].as_str().unwrap().contains("more than one"), "{document}");
    }
    // The first one found was left in configuration beside the second one.
    bench.can(&["lss", "fastscan"], 0);
    let found = bench.can(&["lss", "fastscan"], 0);
    bench.can(&["lss", "set-node", "22"], 0);
    assert_eq!(bench.can(&["scan", "--nodes", "22"], 0)["nodes"][0]["identity"]["serial"], found["serial"]);
    assert_ne!(bench.can(&["lss", "fastscan"], 0)["serial"], found["serial"]);
}

#[test]
fn a_name_is_shown_whole_or_marked() {
    let bench = Bench::new();
    let name = b"Caf\xE9 and a name that is long".as_slice();
    let mut sent = 0;
    let _fake = Fake::server(&bench, move |request| match (request[0] >> 5, &request[1..3]) {
        (2, [0x00, 0x10]) => vec![0x43, 0, 0x10, 0, 0x91, 1, 0, 0],
        (2, [0x08, 0x10]) => {
            sent = 0;
            vec![0x40, 0x08, 0x10, 0, 0, 0, 0, 0]
        }
        (3, _) => {
            let piece = &name[sent..name.len().min(sent + 7)];
            sent += piece.len();
            let last = u8::from(sent == name.len());
            let mut answer = vec![request[0] & 0x10 | (7 - piece.len() as u8) << 1 | last];
            answer.extend(piece);
            answer.resize(8, 0);
            answer
        }
        _ => [&[0x80], &request[1..4], &[0, 0, 2, 6]].concat(),
    });
    let scan = bench.can(&["scan", "--nodes", "50", "--timeout", "1"], 0);
    assert_eq!(scan["nodes"][0]["name"], "Caf\u{FFFD} and a name that is …");
}

#[test]
fn a_pdo_that_a_node_acknowledges_but_does_not_keep_is_told() {
    let bench = Bench::new();
    let _fake = Fake::server(&bench, |request| {
        let at = [request[1], request[2], request[3]];
        let value: u32 = match at {
            [1, 0x18, 1] => 0x1B2,
            [1, 0x18, 2] => 255,
            [1, 0x1A, 0] => 1,
            [1, 0x1A, 1] => 0x6000_0108,
            _ => 0,
        };
        let command = if request[0] >> 5 == 2 { 0x43 } else { 0x60 };
        [&[command], &at[..], &value.to_le_bytes()].concat()
    });
    let map = ["pdo", "write", "50", "tpdo2", "--map", "0x6000:2:8", "--transmission", "1"];
    let (document, said) = told(&bench, &map, 1);
    assert_eq!(document["differs"], json!(["transmission type", "mapping"]));
    assert!(said.contains("did not keep: transmission type, mapping"), "{said}");
}

#[test]
fn an_answer_that_does_not_fit_is_shown() {
    let bench = Bench::new();
    // Another object's, too short, and with an unknown command specifier.
    for (came, shown) in [
        (&[0x43, 1, 0x10, 0, 1, 2, 3, 4][..], "4301100001020304"),
        (&[0x43, 0, 0x10], "430010"),
        (&[0xE0, 0, 0x10, 0, 0, 0, 0, 0], "E000100000000000"),
    ] {
        let fake = Fake::server(&bench, move |_| came.to_vec());
        let output = bench.run(&["sdo", "read", "50", "0x1000", "--timeout", "0.2"]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(3), "{said}");
        assert!(said.contains(&format!("what came instead does not fit: {shown}")), "{said}");
        drop(fake);
    }
}

#[test]
fn heartbeats_of_a_guarded_node_are_told_once() {
    let mut bench = Bench::new();
    bench.sim(&["io", "--node", "5"]);
    bench.can(&["sdo", "write", "5", "0x1017", "70", "--type", "u16"], 0);
    let output = bench.run(&["guard", "5", "--period", "0.1", "--for", "2"]);
    assert_eq!(output.status.code(), Some(0));
    let lines = String::from_utf8(output.stdout).unwrap();
    let events = lines.lines().map(|line| serde_json::from_str::<Value>(line).unwrap()["event"].clone());
    let told: Vec<Value> = events.filter(|event| event != "state").collect();
    assert_eq!(told, ["heartbeats"], "{lines}");
}

/// A node that is gone for good was told as lost, with status 0.
#[test]
fn a_node_that_is_lost_at_the_end_of_guarding_is_a_failure() {
    let bench = Bench::new();
    let mut answers = 0;
    let fake = Fake::new(&bench, move |frame| {
        (frame.standard_id() == Some(0x700 + NODE) && frame.is_remote() && answers < 3).then(|| {
            answers += 1;
            Frame::standard(0x700 + NODE, [if answers % 2 == 1 { 5 } else { 0x85 }])
        })
    });
    let guard = ["guard", "50", "--period", "0.05", "--for", "1"];
    let (_, said) = told(&bench, &guard, 1);
    assert!(said.contains("still lost: node 50"), "{said}");
    drop(fake);
    assert!(told(&bench, &guard, 3).1.contains("never heard: node 50"));
}

/// A capture was empty until the program ended well.
#[test]
fn a_recording_that_is_killed_has_what_came() {
    let mut bench = Bench::new();
    bench.sim(&["io", "--node", "5"]);
    let (recording, _) =
        Running::start(&["can", "record", "F.log", "--can", &bench.endpoint], bench.directory.path());
    bench.can(&["sdo", "write", "5", "0x1017", "20", "--type", "u16"], 0);
    let mut ear = motion_io::can::open(&bench.endpoint.parse().unwrap()).unwrap();
    let end = ear.now() + Duration::from_secs(10);
    let file = bench.directory.path().join("F.log");
    let recorded = || std::fs::read_to_string(&file).unwrap().contains("705#7F");
    while !recorded() && ear.now() < end {
        ear.receive(Duration::from_millis(50)).unwrap();
    }
    assert!(recorded());
    drop(recording);
}

#[test]
fn a_stopped_pdo_write_puts_back_what_was() {
    let bench = Bench::new();
    let (hang, written) = (Arc::new(AtomicBool::new(false)), Arc::new(std::sync::Mutex::new(Vec::new())));
    let (hangs, writes) = (Arc::clone(&hang), Arc::clone(&written));
    let _fake = Fake::server(&bench, move |request| {
        let at = [request[1], request[2], request[3]];
        match request[0] >> 5 {
            2 => [&[0x43], &at[..], &[0xB2, 1, 0, 0]].concat(),
            1 => {
                writes.lock().unwrap().push(request);
                // The third write hangs.
                if writes.lock().unwrap().len() == 3 {
                    hangs.store(true, Ordering::Relaxed);
                    return vec![];
                }
                [&[0x60], &at[..], &[0; 4]].concat()
            }
            _ => vec![],
        }
    });
    let write = ["can", "pdo", "write", "50", "tpdo2", "--transmission", "1", "--inhibit", "5"];
    let mut child = bench.spawn(&[&write[..], &["--timeout", "20"]].concat());
    while !hang.load(Ordering::Relaxed) {
        std::thread::yield_now();
    }
    interrupt(&child);
    assert_eq!(child.wait().unwrap().code(), Some(1));
    let written = written.lock().unwrap();
    assert_eq!(written.last().unwrap()[..4], [0x23, 1, 0x18, 1], "switched on again: {written:02X?}");
}

/// The next client found the server in the middle of a transfer.
#[test]
fn a_stopped_transfer_is_aborted() {
    let bench = Bench::new();
    let (begun, aborted) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
    let (begins, aborts) = (Arc::clone(&begun), Arc::clone(&aborted));
    let _fake = Fake::server(&bench, move |request| match request[0] >> 5 {
        2 => vec![0x40, request[1], request[2], request[3], 0, 0, 0, 0],
        3 => {
            begins.store(true, Ordering::Relaxed);
            [&[request[0] & 0x10][..], &[0x41; 7]].concat()
        }
        4 => {
            aborts.store(true, Ordering::Relaxed);
            vec![]
        }
        _ => vec![],
    });
    let mut child = bench.spawn(&["can", "sdo", "read", "50", "0x2000:1"]);
    while !begun.load(Ordering::Relaxed) {
        std::thread::yield_now();
    }
    interrupt(&child);
    assert_eq!(child.wait().unwrap().code(), Some(1));
    let mut ear = motion_io::can::open(&bench.endpoint.parse().unwrap()).unwrap();
    let end = ear.now() + Duration::from_secs(5);
    while !aborted.load(Ordering::Relaxed) && ear.now() < end {
        ear.receive(Duration::from_millis(20)).unwrap();
    }
    assert!(aborted.load(Ordering::Relaxed));
}

#[test]
fn a_configuration_that_fails_says_what_is_written() {
    let mut bench = Bench::new();
    bench.sim(&["io", "--node", "5", "--write-eds", "io.eds"]);
    let path = |name: &str| bench.directory.path().join(name);
    let entry = |index: u16, data: &[u8]| {
        let mut bytes = index.to_le_bytes().to_vec();
        bytes.push(0);
        bytes.extend((data.len() as u32).to_le_bytes());
        bytes.extend(data);
        bytes
    };
    let concise = [vec![2, 0, 0, 0], entry(0x1017, &[0, 1]), entry(0x1000, &[1, 2, 3, 4])].concat();
    std::fs::write(path("refused"), &concise).unwrap();
    let (document, said) = told(&bench, &["dcf", "5", "refused"], 4);
    assert_eq!((&document["written"], &document["total"]), (&json!(1), &json!(2)));
    assert!(said.contains("entry 2 of 2") && said.contains("1 of 2 entries are written"), "{said}");
    std::fs::write(path("cut"), &concise[..concise.len() - 2]).unwrap();
    let (_, said) = told(&bench, &["dcf", "5", "cut"], 5);
    assert!(
        said.contains("concise DCF: entry 2 of 2 needs 4 bytes") && said.contains("2 are there"),
        "{said}"
    );
    let (_, said) = told(&bench, &["dcf", "5", "io.eds"], 2);
    assert!(said.contains("no ParameterValue in it"), "{said}");
    // What makes one doubt that the file is meant for the node.
    let dcf = "[DeviceInfo]\nVendorNumber=0x6A\n[DeviceComissioning]\nNodeID=9\n[1017]\nParameterName=H\n\
               DataType=6\nAccessType=rw\nDefaultValue=0\nParameterValue=1000\n";
    std::fs::write(path("other.dcf"), dcf).unwrap();
    let remarks = bench.can(&["dcf", "5", "other.dcf"], 0)["remarks"].to_string();
    for words in ["other.dcf is for node 9", "errors in other.dcf", "for vendor 0000006Ah, node 5 is of"] {
        assert!(remarks.contains(words), "{remarks}");
    }
}
