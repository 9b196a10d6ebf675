//! `motionctl monitor`: the screen on a real terminal, and snapshots for scripts.
#![cfg(unix)]

#[allow(dead_code, reason = "shared with tests that need more of it")]
mod common;

use core::time::Duration;
use std::fs::File;
use std::process::{Child, Command, Stdio};

use common::Bench;
use motion_io::port::{Port, Role, open};
use rustix::termios::{Termios, Winsize, tcgetattr, tcsetwinsize};
use serde_json::{Value, json};

/// What enters and leaves the screen of programs that draw.
const ENTER: &str = "\x1b[?1049h";
const LEAVE: &str = "\x1b[?1049l";
const SHOW_CURSOR: &str = "\x1b[?25h";

/// The program on a terminal of its own, and the person at it.
struct Seat {
    person: Box<dyn Port>,
    terminal: File,
    before: Termios,
    child: Child,
    /// All that has come.
    seen: String,
}

impl Seat {
    fn new(bench: &Bench, arguments: &[&str], size: (u16, u16)) -> Self {
        Self::with(bench, arguments, size, &[])
    }

    fn with(bench: &Bench, arguments: &[&str], size: (u16, u16), environment: &[(&str, &str)]) -> Self {
        let link = bench.path("TERMINAL");
        let person = open(&format!("pty:{}", link.display()).parse().unwrap(), Role::Device).unwrap();
        let terminal = File::options().read(true).write(true).open(link).unwrap();
        let size = Winsize { ws_col: size.0, ws_row: size.1, ws_xpixel: 0, ws_ypixel: 0 };
        tcsetwinsize(&terminal, size).unwrap();
        let before = tcgetattr(&terminal).unwrap();
        let end = || terminal.try_clone().unwrap();
        let child = bench
            .command(arguments)
            .env_remove("NO_COLOR")
            .envs(environment.iter().copied())
            .stdin(end())
            .stdout(end())
            .stderr(end())
            .spawn()
            .unwrap();
        Self { person, terminal, before, child, seen: String::new() }
    }

    fn receive(&mut self) -> usize {
        let mut buffer = [0; 65536];
        let len = self.person.receive(&mut buffer, Duration::from_millis(20)).unwrap();
        self.seen.push_str(&String::from_utf8_lossy(&buffer[..len]));
        len
    }

    /// Waits until a text has come.
    #[track_caller]
    fn sees(&mut self, text: &str) {
        for _ in 0..3000 {
            if self.seen.contains(text) {
                return;
            }
            if self.receive() == 0 && self.child.try_wait().unwrap().is_some() {
                break;
            }
        }
        panic!("{text:?} expected in {:?}", self.seen);
    }

    /// Waits until the first line of the screen holds a text.
    #[track_caller]
    fn heads(&mut self, text: &str) {
        for _ in 0..3000 {
            if head(&self.seen).contains(text) {
                return;
            }
            self.receive();
        }
        panic!("{text:?} expected in {:?}", head(&self.seen));
    }

    fn presses(&mut self, keys: &str) {
        self.person.send(keys.as_bytes()).unwrap();
    }

    /// Waits for the end: its status; the terminal is as it was.
    #[track_caller]
    fn ends(mut self, status: i32) -> String {
        let mut ended = None;
        for _ in 0..3000 {
            ended = ended.or_else(|| self.child.try_wait().unwrap());
            if self.receive() == 0 && ended.is_some() {
                break;
            }
        }
        assert_eq!(ended.and_then(|status| status.code()), Some(status), "{:?}", self.seen);
        assert_eq!(format!("{:?}", tcgetattr(&self.terminal).unwrap()), format!("{:?}", self.before));
        let (entered, left) = (self.seen.rfind(ENTER).unwrap(), self.seen.rfind(LEAVE).unwrap());
        assert!(left > entered && self.seen[left..].contains(SHOW_CURSOR), "{:?}", self.seen);
        self.seen[left..].to_owned()
    }
}

/// The first line of a screen of 200 columns, after all that was sent to it: characters are put where the
/// cursor was sent to.
fn head(seen: &str) -> String {
    let mut line = vec![' '; 200];
    let (mut row, mut column) = (1, 1);
    let mut rest = seen.chars();
    while let Some(char) = rest.next() {
        if char != '\x1b' {
            if let (1, Some(cell)) = (row, line.get_mut(column - 1)) {
                *cell = char;
            }
            column += 1;
            continue;
        }
        rest.next();
        let sequence: String = rest.by_ref().take_while(|char| !char.is_ascii_alphabetic()).collect();
        // Only cursor positions have two plain numbers and nothing more.
        let numbers: Vec<usize> = sequence.split(';').filter_map(|number| number.parse().ok()).collect();
        let moves = seen[..seen.len() - rest.as_str().len()].ends_with('H');
        if let (true, &[to_row, to_column]) = (moves, numbers.as_slice()) {
            (row, column) = (to_row, to_column);
        }
    }
    line.into_iter().collect()
}

impl Drop for Seat {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A bus of its own and its endpoint.
fn bus(bench: &Bench) -> (common::Controller, String) {
    let (bus, line) = bench.device_says(&["bus", "--listen", "127.0.0.1:0", "--bitrate", "1000000"]);
    (bus, line.trim().rsplit(' ').next().unwrap().to_owned())
}

#[test]
fn the_terminal_is_given_back() {
    let bench = Bench::new();
    let (bus, endpoint) = bus(&bench);
    let _io = bench.device(&["sim", "io", "--node", "5", "--can", &endpoint]);
    let screen = ["monitor", "--can", &endpoint];
    // By every key that quits.
    for keys in ["q", "\x1b", "\x03"] {
        let mut seat = Seat::new(&bench, &screen, (100, 30));
        seat.sees("q quit");
        // Small keys do no harm.
        seat.presses("\tpz\x1b[A\x1b[B2,.");
        seat.sees("PAUSED");
        seat.presses(keys);
        seat.ends(0);
    }
    // By a signal, at the end of its time, and of a terminal that knows no size.
    let mut seat = Seat::new(&bench, &screen, (20, 5));
    seat.sees("Bus");
    let pid = rustix::process::Pid::from_child(&seat.child);
    rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
    seat.ends(0);
    let seat = Seat::new(&bench, &[&screen[..], &["--for", "0.3"]].concat(), (0, 0));
    seat.ends(0);
    // By trouble, which is told on the terminal as it was.
    let mut seat = Seat::new(&bench, &screen, (100, 30));
    seat.sees("q quit");
    bus.kill();
    let told = seat.ends(5);
    assert!(told.contains("error:") && told.contains("the endpoint failed"), "{told:?}");
}

#[test]
fn colours_are_as_asked_for() {
    let bench = Bench::new();
    let (_bus, endpoint) = bus(&bench);
    let _io = bench.device(&["sim", "io", "--node", "5", "--can", &endpoint]);
    bench.run(&["can", "nmt", "start", "5", "--can", &endpoint]).ends(0);
    let green = |more: &[&str], environment: &[(&str, &str)]| {
        let _guard = Guarding::new(&bench, &endpoint);
        let arguments = [&["monitor", "--can", &endpoint], more].concat();
        let mut seat = Seat::with(&bench, &arguments, (120, 30), environment);
        seat.sees("operational");
        seat.presses("q");
        seat.child.wait().unwrap();
        let colored = seat.seen.contains("38;5;2");
        seat.ends(0);
        colored
    };
    assert!(green(&[], &[]));
    assert!(!green(&["--color", "never"], &[]));
    assert!(!green(&[], &[("NO_COLOR", "1")]));
    assert!(green(&["--color", "always"], &[("NO_COLOR", "1")]));
}

/// Somebody who guards node 5.
struct Guarding(Child);

impl Guarding {
    fn new(bench: &Bench, endpoint: &str) -> Self {
        let mut command: Command = bench.command(&["can", "guard", "5", "--can", endpoint]);
        Self(command.stdout(Stdio::null()).spawn().unwrap())
    }
}

impl Drop for Guarding {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn one_snapshot_of_a_bus() {
    let bench = Bench::new();
    let (_bus, endpoint) = bus(&bench);
    let _io = bench.device(&["sim", "io", "--node", "5", "--can", &endpoint]);
    let _guard = Guarding::new(&bench, &endpoint);
    let once = ["monitor", "--can", &endpoint, "--once", "--bitrate", "1000000", "--json"];
    let document = bench.run(&once).ends(0).json();
    assert!((1.0..3.0).contains(&document["seconds"].as_f64().unwrap()), "{document}");
    let node = &document["nodes"][0];
    assert_eq!((&node["node"], &node["state"]), (&json!(5), &json!("pre-operational")));
    assert_eq!((&node["error_control"]["kind"], &node["toggle_errors"]), (&json!("guarding"), &json!(0)));
    // It has only listened: nothing else is on the bus, but that the node's start, or an answer to what was
    // asked before, may still be on its way.
    let kinds: Vec<&str> = document["by_kind"].as_object().unwrap().keys().map(String::as_str).collect();
    let expected = ["guard-request", "guard-reply", "boot-up", "heartbeat"];
    assert!(kinds.iter().all(|kind| expected.contains(kind)), "{kinds:?}");
    let repeating = document["repeating"].as_array().unwrap();
    assert!(repeating.iter().any(|cycle| cycle["what"] == "node 5 guarding"), "{repeating:?}");
    assert!(document["buses"][0]["mean"]["load_percent"].as_f64().unwrap() > 0.0);
    let text = bench.run(&["monitor", "--can", &endpoint, "--once", "--for", "0.5"]).ends(0).stdout();
    for words in ["Nodes\n", "guarding", "master    guards node 5", "load"] {
        assert!(text.contains(words), "{words:?} expected in\n{text}");
    }
    assert!(!text.contains('\x1b'), "{text:?}");
    // A bus on which nothing is heard is one too.
    let silent = bench
        .run(&["monitor", "--can", "virtual:nobody", "--once", "--for", "0.05", "--json"])
        .ends(0)
        .json();
    assert_eq!((&silent["nodes"], &silent["buses"][0]["frames"]), (&json!([]), &json!(0)));
    assert_eq!(silent["buses"][0]["now"]["load_percent"], Value::Null);
}

#[test]
fn one_snapshot_of_a_controller() {
    let bench = Bench::new();
    let controller = bench.controller(&["--model", "8231"]);
    bench.run(&["params", "set", "--port", "LINE", "310", "7", "326", "1"]).ends(0);
    std::fs::write(bench.path("ram"), [0xFE, 0xFF, 0xFF, 0xFF]).unwrap();
    bench.run(&["lb2", "write-ram", "--port", "LINE", "--offset", "0x10", "ram"]).ends(0);
    let once = ["monitor", "--port", "LINE", "--once", "--param", "V max.@1", "--ram", "0x10:i32:position"];
    let document = bench.run(&[&once[..], &["--json"]].concat()).ends(0).json();
    assert_eq!((&document["identity"]["model"], &document["answers"]), (&json!(8231), &json!(true)));
    assert_eq!((&document["failures"], document["axes"].as_array().unwrap().len()), (&json!([]), 6));
    assert_eq!(document["can"][0]["role"], "CANopen master");
    assert_eq!(document["can"][0]["objects"][0], json!({ "object": "IN1", "type": "Digital", "node": 7 }));
    assert_eq!(document["parameters"][0]["index"], 642);
    assert_eq!((&document["ram"][0]["name"], &document["ram"][0]["value"]), (&json!("position"), &json!(-2)));
    bench.run(&once).ends(0).says("GEL 8231, 6 axes").says("none stored").says("position").says("-2");
    // On a screen, until the line is gone.
    let mut seat = Seat::new(&bench, &["monitor", "--port", "LINE"], (100, 40));
    seat.sees("8231");
    controller.kill();
    assert!(seat.ends(5).contains("the port failed"));
    // A line on which nobody answers.
    let _silent =
        open(&format!("pty:{}", bench.path("SILENT").display()).parse().unwrap(), Role::Device).unwrap();
    bench.run(&["monitor", "--port", "SILENT", "--once", "--timeout", "0.05"]).ends(3).says("no answer");
    let mut seat = Seat::new(&bench, &["monitor", "--port", "SILENT", "--timeout", "0.05"], (100, 40));
    seat.sees("NO");
    seat.sees("ANSWER");
    seat.presses("q");
    seat.ends(0);
}

/// A drive's bring-up, at its end and at other moments.
#[test]
fn a_capture() {
    let bench = Bench::new();
    let log = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/bring-up.log");
    std::fs::copy(log, bench.path("bring-up.log")).unwrap();
    let once = ["monitor", "bring-up.log", "--once", "--bitrate", "125000"];
    let document = bench.run(&[&once[..], &["--json"]].concat()).ends(0).json();
    assert_eq!((&document["frames"], &document["damaged"]), (&json!(361), &json!(0)));
    let node = &document["nodes"][0];
    assert_eq!((&node["node"], &node["bus"], &node["name"]), (&json!(1), &json!("can0"), &json!("SD03")));
    assert_eq!((&node["state"], &node["drive"]), (&json!("operational"), &json!("switch on disabled")));
    assert_eq!((&node["emergency"]["code"], &node["emergency"]["over"]), (&json!(0x8411), &json!(true)));
    assert_eq!((&node["sdo"]["transfers"], &node["sdo"]["failed"]), (&json!(18), &json!(1)));
    let repeating = document["repeating"].as_array().unwrap();
    let tpdo = repeating.iter().find(|cycle| cycle["what"] == "node 1 TPDO 1").unwrap();
    assert_eq!((&tpdo["count"], &tpdo["changes"], &tpdo["period"]), (&json!(100), &json!(51), &json!(0.01)));
    assert_eq!(tpdo["values"][0]["name"], "status word");
    let story: Vec<&str> =
        document["story"].as_array().unwrap().iter().map(|line| line.as_str().unwrap()).collect();
    let decoded = bench.run(&["decode", "bring-up.log"]).ends(0).stdout();
    assert!(decoded.starts_with(&story.join("\n")), "{story:#?}");
    let text = bench.run(&once).ends(0).stdout();
    assert!(text.contains("8411h (monitoring), over") && text.contains("status word = 0650h"), "{text}");

    let mut seat = Seat::new(&bench, &["monitor", "bring-up.log"], (120, 40));
    seat.heads("frame 361 of 361");
    for (key, frame) in [(",", 360), ("<", 342), (">", 360), ("\x1b[H", 1), (".", 2), ("\x1b[F", 361)] {
        seat.presses(key);
        seat.heads(&format!("frame {frame} of 361"));
    }
    seat.presses("q");
    seat.ends(0);

    // What a device file says of process data, without a transfer that does.
    let _node = bench.device(&["sim", "io", "--node", "5", "--can", "virtual:a", "--write-eds", "io.eds"]);
    std::fs::write(bench.path("pdo.log"), "(1.0) can0 185#03\n(1.1) can0 185#04\n").unwrap();
    let pdo = ["monitor", "pdo.log", "--once", "--json", "--eds", "5=io.eds"];
    let value = bench.run(&pdo).ends(0).json()["repeating"][0]["values"][0].clone();
    assert_eq!((&value["index"], &value["value"]), (&json!(0x6000), &json!(4)), "{value}");

    // From standard input, and what is no capture.
    let piped = bench
        .command(&["monitor", "-", "--once", "--json"])
        .stdin(File::open(log).unwrap())
        .output()
        .unwrap();
    assert_eq!(common::Ran(piped).ends(0).json()["frames"], 361);
    std::fs::write(bench.path("no.log"), "hello\n").unwrap();
    bench.run(&["monitor", "no.log", "--once"]).ends(5).says("no known capture format");
    bench.run(&["monitor", "missing.log", "--once"]).ends(5).says("missing.log");
    std::fs::write(bench.path("broken.log"), "(1.0) can0 123#11\n(1.1) can0 99999999#11\n").unwrap();
    let broken = bench.run(&["monitor", "broken.log", "--once", "--json"]).ends(0);
    assert!(broken.stderr().contains("broken.log: line 2"), "{}", broken.stderr());
    assert_eq!(broken.json()["damaged"], 1);
    bench.run(&["monitor", "broken.log", "--once"]).ends(0).says("  1 line gave no frame  ");
}

#[test]
fn a_capture_of_an_lb2_line() {
    let bench = Bench::new();
    // A request, its answer, garbage, and an error telegram.
    std::fs::write(
        bench.path("line.hex"),
        "82 96 05 CC 30 05 00 FC\n82 96 09 CC 30 05 00 07 00 00 00 F7\nFF FF\n82 96 03 FF 04 F8\n",
    )
    .unwrap();
    let document = bench.run(&["monitor", "line.hex", "--once", "--json"]).ends(0).json();
    assert_eq!((&document["telegrams"], &document["discarded_bytes"]), (&json!(3), &json!(2)));
    assert_eq!(document["parameters"], json!([{ "index": 5, "value": 7 }]));
    assert_eq!(document["errors"], json!([{ "error_code": 4, "times": 1 }]));
    let function = &document["functions"][0];
    assert_eq!((&function["requests"], &function["replies"]), (&json!(1), &json!(1)));
    bench.run(&["monitor", "line.hex", "--once"]).ends(0).says("[005] Device number").says("read parameter");
}

/// Whatever the tools of others wrote: as many frames as `decode` counts, and nothing panics.
#[test]
fn recorded_captures() {
    let shared = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/recorded");
    if !shared.exists() {
        println!("ignored: needs ../shared/recorded");
        return;
    }
    let bench = Bench::new();
    let mut files = 0;
    for folder in ["can", "threads"] {
        for entry in std::fs::read_dir(shared.join(folder)).unwrap() {
            let path = entry.unwrap().path();
            let name = path.to_str().unwrap();
            let decoded = bench.run(&["decode", name, "--json"]);
            let status = decoded.0.status.code().unwrap();
            let shown = bench.run(&["monitor", name, "--once", "--json"]).ends(status);
            if status == 0 {
                let last = decoded.stdout().lines().last().unwrap().to_owned();
                let summary: Value = serde_json::from_str(&last).unwrap();
                let document = shown.json();
                assert_eq!(document["frames"], summary["frames"], "{name}");
                bench.run(&["monitor", name, "--once"]).ends(0);
                files += 1;
            }
        }
    }
    assert!(files > 20, "{files}");
}

/// The stream of frames says of each what the decoder says: guarding is told from heartbeats.
#[test]
fn frames_as_they_come() {
    let bench = Bench::new();
    let (_bus, endpoint) = bus(&bench);
    let _io = bench.device(&["sim", "io", "--node", "5", "--can", &endpoint]);
    let _guard = Guarding::new(&bench, &endpoint);
    let ran = bench.run(&["can", "monitor", "--can", &endpoint, "--for", "1", "--json"]).ends(0);
    let frames: Vec<Value> = ran.stdout().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(frames.len() > 4, "{frames:?}");
    // The node's start, or an answer to what was asked before, may still be on its way.
    let asked = frames.iter().skip_while(|frame| frame["kind"] != "guard-request");
    for frame in asked.filter(|frame| frame["kind"] != "boot-up") {
        let kind = if frame["rtr"] == true { "guard-request" } else { "guard-reply" };
        assert_eq!((&frame["kind"], &frame["node"], &frame["id"]), (&json!(kind), &json!(5), &json!(0x705)));
        assert_eq!(frame["schema_version"], 1);
    }
}

/// It was "nothing to show".
#[test]
fn a_configuration_file_that_is_not_there_is_told() {
    Bench::new().run(&["monitor", "--once", "--config", "NO.toml"]).ends(5).says("NO.toml");
}

#[test]
fn wrong_usage() {
    let bench = Bench::new();
    bench.run(&["monitor", "--can", "virtual:a"]).ends(2).says("--once prints one snapshot");
    bench.run(&["monitor", "--can", "virtual:a", "--json"]).ends(2).says("--json needs --once");
    bench.run(&["monitor", "--once"]).ends(2).says("MOTIONCTL_CAN");
    for wrong in [
        &["--can", "nonsense"][..],
        &["--can", "virtual:a", "--for", "0"],
        &["--can", "virtual:a", "--bitrate", "7"],
        &["--can", "virtual:a", "--port", "LINE"],
        &["file", "--can", "virtual:a"],
        &["file", "--param", "642"],
        &["--port", "LINE", "--bitrate", "500000"],
        &["--port", "LINE", "--ram", "5"],
        &["--port", "LINE", "--param", "no such thing"],
        &["--can", "virtual:a", "--eds", "5"],
    ] {
        bench.run(&[&["monitor", "--once"], wrong].concat()).ends(2);
    }
    bench.run(&["monitor", "--once", "--can", "virtual:a", "--eds", "5=NOTHING"]).ends(5).says("NOTHING");
    bench.run(&["monitor", "--once", "--can", "socketcand:127.0.0.1:1/can0"]).ends(5);
    bench.run(&["monitor", "--once", "--port", "NOTHING"]).ends(5);
    // What the environment names; both are one too many.
    let with = |names: &[(&str, &str)], more: &[&str]| {
        let mut command = bench.command(&[&["monitor", "--once", "--for", "0.05"], more].concat());
        command.envs(names.iter().copied());
        common::Ran(command.output().unwrap())
    };
    let (can, port) = (("MOTIONCTL_CAN", "virtual:a"), ("MOTIONCTL_PORT", "NOTHING"));
    with(&[can], &[]).ends(0).says("virtual:a");
    with(&[port], &[]).ends(5).says("NOTHING");
    with(&[can, port], &[]).ends(2).says("--can or --port expected");
    with(&[can, port], &["--param", "642"]).ends(5).says("NOTHING");
    with(&[can, port], &["--can", "virtual:b"]).ends(0).says("virtual:b");
}
