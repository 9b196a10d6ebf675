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
    let green = |more: &[&str]| {
        let _guard = Guarding::new(&bench, &endpoint);
        let mut seat = Seat::new(&bench, &[&["monitor", "--can", &endpoint], more].concat(), (120, 30));
        seat.sees("operational");
        seat.presses("q");
        seat.child.wait().unwrap();
        let colored = seat.seen.contains("38;5;2");
        seat.ends(0);
        colored
    };
    assert!(green(&[]));
    assert!(!green(&["--color", "never"]));
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
    let count = |kind: &str| document["by_kind"][kind].as_u64().unwrap();
    // It has only listened: nothing else is on the bus.
    assert_eq!(
        count("guard-request") + count("guard-reply"),
        document["buses"][0]["frames"].as_u64().unwrap()
    );
    assert_eq!(document["repeating"][0]["what"], "node 5 guarding");
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
fn wrong_usage() {
    let bench = Bench::new();
    bench.run(&["monitor", "--can", "virtual:a"]).ends(2).says("--once prints one snapshot");
    bench.run(&["monitor", "--can", "virtual:a", "--json"]).ends(2).says("--json needs --once");
    bench.run(&["monitor", "--once"]).ends(2).says("MOTIONCTL_CAN");
    bench.run(&["monitor", "--once", "--can", "nonsense"]).ends(2);
    bench.run(&["monitor", "--once", "--can", "virtual:a", "--for", "0"]).ends(2).says("--for 0");
    bench.run(&["monitor", "--once", "--can", "virtual:a", "--bitrate", "7"]).ends(2);
    bench.run(&["monitor", "--once", "--can", "virtual:a", "--eds", "5=NOTHING"]).ends(5).says("NOTHING");
    bench.run(&["monitor", "--once", "--can", "socketcand:127.0.0.1:1/can0"]).ends(5);
}
