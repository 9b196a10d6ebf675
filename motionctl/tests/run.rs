//! The soft controller in real time: a drive on a virtual bus, a plant on the terminals, LB2 on a
//! pseudo-terminal, and what it tells of its cycle.
#![cfg(unix)]

mod common;

use std::io::{BufRead, BufReader, Lines};
use std::process::{Child, ChildStdout, Command, Stdio};

use common::Bench;
use serde_json::Value;

/// Axis 1: the drive at address 1 on CAN 2. Axis 2: a plant on Q2 and E2.
const CONFIG: &str = r#"
[[serial]]
port = "COM 2"
endpoint = "pty:LINE"
protocol = "lb2"

[can2]
endpoint = "virtual:run"

[parameters]
0 = 2
100 = 2
109 = 0
450 = 2
602 = 0
642 = 655360
648 = 50
654 = 300
708 = 5000
714 = 5000
643 = 100000
649 = 300
655 = 100
709 = 20
715 = 20

[[simulate]]
kind = "drive"
bus = "can2"
node = 1

[[simulate]]
kind = "plant"
block = 2
drive = "first-order"
speed = 100000
tau = 0.005

[[program]]
at = 0.1
do = "power"
axis = 2
[[program]]
at = 0.3
do = "move-absolute"
axis = 2
position = 5000
[[program]]
at = 4.0
do = "power"
axis = 1
[[program]]
at = 5.0
do = "move-absolute"
axis = 1
position = 131072
"#;

/// A running controller and what it says.
struct Running {
    child: Child,
    lines: Lines<BufReader<ChildStdout>>,
    /// Every document so far.
    said: Vec<Value>,
}

impl Running {
    fn start(bench: &Bench) -> Self {
        std::fs::write(bench.path("run.toml"), CONFIG).unwrap();
        let mut child = Command::new(env!("CARGO_BIN_EXE_motionctl"))
            // The limit of all waiting below.
            .args(["run", "run.toml", "--json", "--for", "120"])
            .current_dir(bench.directory.path())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        Self { child, lines, said: Vec::new() }
    }

    fn next(&mut self) -> Option<&Value> {
        let line = self.lines.next()?.unwrap();
        self.said.push(serde_json::from_str(&line).unwrap());
        self.said.last()
    }

    /// Reads on until it says an event with these fields, unless it has.
    fn until(&mut self, event: &str, fields: &[(&str, Value)]) {
        let is = |document: &Value| {
            document["event"] == event && fields.iter().all(|(name, value)| document[name] == *value)
        };
        if self.said.iter().any(is) {
            return;
        }
        while let Some(document) = self.next() {
            if is(document) {
                return;
            }
        }
        panic!("ended without {event} {fields:?}: {:#?}", self.said);
    }

    /// As a service manager stops it; everything that it said.
    fn stop(mut self) -> Vec<Value> {
        let pid = self.child.id().to_string();
        assert!(Command::new("kill").args(["-TERM", &pid]).status().unwrap().success());
        while self.next().is_some() {}
        assert!(self.child.wait().unwrap().success(), "{:?}", self.said.last());
        core::mem::take(&mut self.said)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn a_drive_and_a_plant_are_moved_and_the_jitter_is_told() {
    let bench = Bench::new();
    let mut running = Running::start(&bench);
    running.until("ready", &[("model", 8230.into()), ("cycle_ms", 2.into())]);
    let moved =
        |axis: u8| [("axis", axis.into()), ("do", "move-absolute".into()), ("outcome", "done".into())];
    running.until("step", &moved(2));
    bench.run(&["lb2", "identify", "--port", "LINE"]).ends(0).says("GEL 8230");
    running.until("node", &[("bus", 2.into()), ("node", 1.into()), ("state", "ready".into())]);
    running.until("step", &moved(1));
    running.until("cycle", &[]);
    bench.run(&["params", "get", "--port", "LINE", "642"]).ends(0).says("655360");
    let said = running.stop();

    let end = said.last().unwrap();
    assert_eq!(end["event"], "end");
    let cycles = end["cycles"].as_u64().unwrap();
    let classes = end["jitter"].as_array().unwrap();
    let counted: u64 = classes.iter().map(|class| class["cycles"].as_u64().unwrap()).sum();
    assert_eq!((counted, classes.len()), (cycles, 11));
    assert!(classes[..10].is_sorted_by_key(|class| class["below_us"].as_u64()));
    assert!(classes[10]["below_us"].is_null() && end["worst_us"].is_u64());
    // Those made and those overrun are all that time had; the end is told a little later, at most 1 s.
    let all = cycles + end["overruns"].as_u64().unwrap();
    let due = (end["t"].as_f64().unwrap() / 0.002) as u64;
    assert!((all - 1..all + 500).contains(&due), "{cycles} cycles, {all} with overruns, {due} due");
    // Brought to standstill and switched off (decision 28).
    for axis in [1, 2] {
        let mut states =
            said.iter().filter(|document| document["event"] == "axis" && document["axis"] == axis);
        assert_eq!(states.next_back().unwrap()["state"], "disabled");
    }
    assert!(said.iter().all(|document| document["event"] != "failure"), "{said:#?}");
}

/// Axis 2, which is virtual, goes along with axis 1's encoder, and is let go.
#[test]
fn an_axis_is_geared_to_another_one() {
    let bench = Bench::new();
    let config = r#"
[parameters]
0 = 2
109 = 0
602 = 0
642 = 100000
648 = 300
654 = 100
708 = 20
714 = 20
607 = 8
643 = 100000
655 = 100

[[simulate]]
kind = "plant"
block = 1
drive = "first-order"
speed = 100000
tau = 0.005

[[program]]
at = 0.05
do = "power"
axis = 1
[[program]]
at = 0.05
do = "power"
axis = 2
[[program]]
at = 0.1
do = "gear-in"
axis = 2
input = 1
numerator = -3
denominator = 7
[[program]]
at = 0.2
do = "move-absolute"
axis = 1
position = 7000
[[program]]
at = 1.2
do = "gear-out"
axis = 2
[[program]]
at = 1.3
do = "move-absolute"
axis = 1
position = 0
"#;
    std::fs::write(bench.path("run.toml"), config).unwrap();
    let ran = bench.run(&["run", "run.toml", "--for", "2.0", "--record", "run.csv"]).ends(0);
    for words in ["gear-in: done", "synchronized-motion", "gear-out: done"] {
        assert!(ran.stdout().contains(words), "{words:?}: {}", ran.stdout());
    }
    let recorded = std::fs::read_to_string(bench.path("run.csv")).unwrap();
    let mut lines = recorded.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let place = |name: &str| names.iter().position(|other| *other == name).unwrap();
    let (axis, position) = (place("axis"), place("position"));
    let last = |number: &str| -> f64 {
        let mut own = recorded.lines().filter(|line| line.split(',').nth(axis) == Some(number));
        own.next_back().unwrap().split(',').nth(position).unwrap().parse().unwrap()
    };
    assert!(last("1").abs() <= 20.0, "back: {}", last("1"));
    assert!((last("2") + 3_000.0).abs() <= 9.0, "left behind: {}", last("2"));
}

#[test]
fn the_histogram_is_drawn_for_people() {
    let bench = Bench::new();
    std::fs::write(bench.path("run.toml"), "[can1]\nendpoint = \"virtual:a\"\n").unwrap();
    let ran = bench.run(&["run", "run.toml", "--for", "0.1"]).ends(0);
    let text = ran.stdout();
    let end: Vec<&str> = text.lines().skip_while(|line| !line.contains(" overruns, begun")).collect();
    assert_eq!(end.len(), 12, "{text}");
    assert!(end[1].trim_start().starts_with("<    10 µs") && end[11].contains("more"), "{text}");
    assert!(end.iter().any(|line| line.ends_with('#')), "{text}");
}

#[test]
fn what_cannot_run_is_named() {
    let bench = Bench::new();
    let run = |text: &str| {
        std::fs::write(bench.path("run.toml"), text).unwrap();
        bench.run(&["run", "run.toml", "--for", "0.1"])
    };
    run("[parameters]\n642 = 9999999\n").ends(2).says("= 9999999: Value out of range");
    run("[parameters]\n0 = 2\n").ends(2).says("109");
    run("[[simulate]]\nkind = \"drive\"\nbus = \"can1\"\nnode = 1\n").ends(2);
    bench.run(&["run", "absent.toml"]).ends(5).says("absent.toml");
}
