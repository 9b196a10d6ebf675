//! The roles of a controller's CAN buses, as a person sets and sees them: `run`, `sim controller`,
//! `params set`.
#![cfg(unix)]
// Real processes are waited for, with a limit.
#![allow(clippy::disallowed_methods)]

mod common;

use core::time::Duration;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Instant;

use common::Bench;
use serde_json::{Value, json};

/// So long an event may take on a busy machine.
const LIMIT: Duration = Duration::from_secs(60);

/// A process that tells a stream of events.
struct Stream {
    child: Child,
    said: Receiver<Value>,
    /// What came and was not waited for yet.
    seen: Vec<Value>,
}

impl Stream {
    fn start(bench: &Bench, arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_motionctl"))
            .args(arguments)
            .arg("--json")
            .current_dir(bench.directory.path())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let stdout = BufReader::new(child.stdout.take().unwrap());
        let (events, said) = channel();
        std::thread::spawn(move || {
            for line in stdout.lines() {
                // The test may have seen what it wanted.
                let _ = events.send(serde_json::from_str(&line.unwrap()).unwrap());
            }
        });
        Self { child, said, seen: Vec::new() }
    }

    /// Waits for an event with these fields, which may have come already.
    #[track_caller]
    fn wait(&mut self, fields: &Value) -> Value {
        let fits =
            |event: &Value| fields.as_object().unwrap().iter().all(|(key, value)| event[key] == *value);
        let end = Instant::now() + LIMIT;
        loop {
            if let Some(place) = self.seen.iter().position(fits) {
                return self.seen.remove(place);
            }
            match self.said.recv_timeout(end.saturating_duration_since(Instant::now())) {
                Ok(event) => self.seen.push(event),
                Err(_) => panic!("{fields} did not come: {:#?}", self.seen),
            }
        }
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A bus for several processes, and its endpoint.
fn bus(bench: &Bench) -> (Stream, String) {
    let mut bus = Stream::start(bench, &["bus", "--listen", "127.0.0.1:0"]);
    let ready = bus.wait(&json!({ "bitrate": 500_000 }));
    (bus, format!("socketcand:{}/can0", ready["listen"].as_str().unwrap()))
}

/// Manual A's master bypass example, three processes on one bus; the slaves are switched on first.
#[test]
fn the_master_bypass_example_with_three_programs() {
    let bench = Bench::new();
    let (_bus, endpoint) = bus(&bench);
    let config = |name: &str, type_and_objects: &str, steps: &[(u8, &str)]| {
        let mut text = format!("[can1]\nendpoint = \"{endpoint}\"\n[parameters]\n{type_and_objects}\n");
        for (object, data) in steps {
            // Again and again: whoever is not operational yet has it later.
            text += &format!(
                "[[program]]\nat = 0\ndo = \"write\"\nbus = \"can1\"\nobject = {object}\ndata = \"{data}\"\n\
                 period = 0.1\n"
            );
        }
        std::fs::write(bench.path(name), text).unwrap();
    };
    let slave = |node: u8, bypass: u8| {
        format!(
            "300 = \"Slave\"\n310 = {node}\n326 = \"Digital\"\n314 = {node}\n330 = \"Digital\"\n\
             313 = 10\n329 = \"Digital\"\n337 = {bypass}\n317 = 10\n333 = \"Digital\"\n341 = {bypass}"
        )
    };
    config("first.toml", &slave(5, 1), &[(1, "51"), (4, "5A")]);
    config("second.toml", &slave(7, 0), &[(1, "71"), (4, "7A")]);
    config(
        "master.toml",
        "310 = 5\n326 = 1\n314 = 5\n330 = 1\n311 = 7\n327 = 1\n315 = 7\n331 = 1",
        &[(1, "15"), (2, "17")],
    );
    // On a busy machine a scan may find no answer in time; then a person makes it again.
    let scans = (1..12).map(|n| format!("[[program]]\nat = {}\ndo = \"scan\"\nbus = \"can1\"\n", 5 * n));
    let text = std::fs::read_to_string(bench.path("master.toml")).unwrap() + &scans.collect::<String>();
    std::fs::write(bench.path("master.toml"), text).unwrap();
    let mut first = Stream::start(&bench, &["run", "first.toml"]);
    first.wait(&json!({ "event": "ready", "buses": [{ "bus": 1, "role": "slave" }] }));
    let mut second = Stream::start(&bench, &["run", "second.toml"]);
    second.wait(&json!({ "event": "ready" }));
    let mut master = Stream::start(&bench, &["run", "master.toml"]);
    master.wait(&json!({ "event": "ready", "buses": [{ "bus": 1, "role": "master" }] }));
    master.wait(&json!({ "event": "scan", "bus": 1, "state": "OK" }));
    let object = |number: u8, node: u8, data: &str| json!({ "event": "object", "bus": 1, "object": format!("IN {number}"), "node": node, "data": data });
    first.wait(&object(1, 5, "15"));
    second.wait(&object(1, 7, "17"));
    first.wait(&object(4, 10, "7A"));
    second.wait(&object(4, 10, "5A"));
    // Which of the slaves is earlier is chance.
    let mut came: Vec<Value> = (0..2).map(|_| master.wait(&json!({ "event": "object" }))).collect();
    came.sort_by_key(|event| event["node"].as_u64());
    let came: Vec<_> = came.iter().map(|event| (&event["object"], &event["node"], &event["data"])).collect();
    assert_eq!(came, [(&json!("IN 1"), &json!(5), &json!("51")), (&json!("IN 2"), &json!(7), &json!("71"))]);
}

/// A slave that is switched on after the master takes a scan (4.3.4.4).
#[test]
fn a_scan_by_the_program_finds_who_came_later() {
    let bench = Bench::new();
    let (_bus, endpoint) = bus(&bench);
    std::fs::write(
        bench.path("master.toml"),
        format!(
            "[can1]\nendpoint = \"{endpoint}\"\n[parameters]\n310 = 5\n326 = 1\n\
             [[program]]\nat = 4\ndo = \"scan\"\nbus = \"can1\"\n\
             [[program]]\nat = 15\ndo = \"scan\"\nbus = \"can1\"\n"
        ),
    )
    .unwrap();
    let mut master = Stream::start(&bench, &["run", "master.toml"]);
    master.wait(&json!({ "event": "scan", "state": "BUS WARN" }));
    let node = ["sim", "io", "--node", "5", "--can", &endpoint];
    let mut io = Stream::start(&bench, &node);
    io.wait(&json!({ "event": "ready" }));
    master.wait(&json!({ "event": "step", "bus": 1, "do": "scan", "outcome": "done" }));
    master.wait(&json!({ "event": "scan", "state": "OK" }));
    master.wait(&json!({ "event": "node", "node": 5, "state": "ready" }));
}

/// Two controllers and a person's command on one CAN Link bus.
#[test]
fn can_link_with_run_sim_and_commands() {
    let bench = Bench::new();
    let (_bus, endpoint) = bus(&bench);
    std::fs::write(
        bench.path("run.toml"),
        format!(
            "[can1]\nendpoint = \"{endpoint}\"\n[parameters]\n\"CAN Link@CAN 1\" = \"Yes\"\n\
             [[program]]\nat = 0.1\ndo = \"send\"\nbus = \"can1\"\nchannel = 3\ndata = \"E2 04\"\nperiod = 0.02\n"
        ),
    )
    .unwrap();
    let mut run = Stream::start(&bench, &["run", "run.toml"]);
    run.wait(&json!({ "event": "ready", "buses": [{ "bus": 1, "role": "can-link" }] }));
    let mut sim = Stream::start(&bench, &["sim", "controller", "--can1", &endpoint, "--set", "302=Yes"]);
    sim.wait(&json!({ "event": "ready", "buses": [{ "bus": 1, "role": "can-link" }] }));
    sim.wait(&json!({ "event": "channel", "bus": 1, "channel": 3, "data": "E204" }));
    bench.run(&["can", "link", "set", "5", "AB", "--can", &endpoint]).ends(0);
    run.wait(&json!({ "event": "channel", "bus": 1, "channel": 5, "data": "AB" }));
    sim.wait(&json!({ "event": "channel", "bus": 1, "channel": 5, "data": "AB" }));
    bench
        .run(&["can", "link", "set", "3", "00", "--for", "0.5", "--can", &endpoint])
        .ends(1)
        .says("channel 3");
    run.wait(&json!({ "event": "conflict", "bus": 1, "channel": 3 }));
}

/// A role that was set over LB2 and saved is there after switching on again.
#[test]
fn a_role_set_over_lb2_is_taken_at_the_next_start() {
    let bench = Bench::new();
    let (_bus, endpoint) = bus(&bench);
    let arguments = ["sim", "controller", "--serial", "pty:LINE", "--can1", &endpoint, "--state", "FLASH"];
    for role in ["master", "slave", "can-link", "master"] {
        let mut controller = Stream::start(&bench, &arguments);
        controller.wait(&json!({ "event": "ready", "buses": [{ "bus": 1, "role": role }] }));
        let set = |pairs: &[&str]| {
            bench.run(&[&["params", "set", "--port", "LINE", "--save"], pairs].concat()).ends(0)
        };
        match role {
            "master" => set(&["300", "Slave"]).says("Effective after switching on again"),
            "slave" => set(&["302", "Yes"]).says("Effective after switching on again"),
            _ => set(&["302", "No", "300", "Master"]),
        };
    }
}

/// Who connects a controller that then says nothing is told why.
#[test]
fn a_controller_that_is_silent_on_its_bus_says_why() {
    let bench = Bench::new();
    let start = |parameters: &str| {
        let text = format!("[can1]\nendpoint = \"virtual:silent\"\n[parameters]\n{parameters}\n");
        std::fs::write(bench.path("run.toml"), text).unwrap();
        bench.run(&["run", "run.toml", "--for", "0.05"]).ends(0)
    };
    let quiet = |ran: common::Ran| assert!(!ran.stderr().contains("silent"), "{}", ran.stderr());
    let slave = "CAN 1 is silent until LSS gives it an address: a slave has that of its first active object \
                 ([326]) without master bypass ([334]), and there is none";
    start("300 = \"Slave\"").says(slave);
    // Bypassed objects are shared with another slave and give no address.
    start("300 = \"Slave\"\n326 = 1\n334 = 1\n330 = 1\n338 = 1").says(slave);
    quiet(start("300 = \"Slave\"\n326 = 1"));
    start("").says("CAN 1 is silent: a master, and none of its objects is active ([326])");
    quiet(start("326 = 1"));
    quiet(start("302 = \"Yes\""));
    let mut sim = Stream::start(&bench, &["sim", "controller", "--can1", "virtual:a", "--set", "300=Slave"]);
    let ready = sim.wait(&json!({ "event": "ready" }));
    assert!(ready["remarks"].as_array().unwrap().contains(&json!(slave)), "{ready}");
}

/// What was expected, what came, which parameter.
#[test]
fn wrong_combinations_are_refused_with_a_sentence() {
    let bench = Bench::new();
    let _controller = bench.controller(&[]);
    bench.run(&["params", "backup", "--port", "LINE", "F.toml"]).ends(0);
    let set = |pairs: &[&str]| bench.run(&[&["params", "set", "--port", "LINE"], pairs].concat());
    set(&["303", "Yes"])
        .ends(4)
        .says("[303] CAN Link, CAN 2 = Yes: CAN Link on a bus with axis objects")
        .says("expected: No, or no object of type Axis on this bus (6.5.1)")
        .says("the old values were put back");
    set(&["326", "Digital", "310", "5", "327", "Digital", "311", "5"])
        .ends(4)
        .says("[311] Node address, CAN 1 Object/PDO IN 2 = 5: Two objects have the same identifier")
        .says("expected: an address that gives the object an identifier of its own");
    set(&["310", "0"])
        .ends(4)
        .says("[310] Node address, CAN 1 Object/PDO IN 1")
        .says("refused 0: 0 is no address (1...127): default set");
    set(&["342", "17"])
        .ends(4)
        .says("[342] Node address, CAN 2 Object/PDO IN 1 = 17: Node address of an axis is above 16")
        .says("expected: 1 to 16 for an object of type Axis");
    for object in ["328", "329", "332", "333"] {
        set(&[object, "Axis"]).ends(2).says(
            "Axis cannot be selected here, \"Inactive\", \"Digital\", \"Analogue\", \"Other\" expected",
        );
    }
    // The same at the start of a virtual controller.
    bench
        .run(&["sim", "controller", "--can1", "virtual:a", "--set", "303=Yes"])
        .ends(2)
        .says("[303] CAN Link, CAN 2 = Yes: CAN Link on a bus with axis objects; expected: No");
    bench
        .run(&["sim", "controller", "--can1", "virtual:a", "--set", "310=0"])
        .ends(2)
        .says("[310] Node address, CAN 1 Object/PDO IN 1 = 0: 0 is no address (1...127)");
    bench.run(&["params", "compare", "--port", "LINE", "F.toml"]).ends(0);
}

/// Steps that the bus has nothing to carry out with are named before anything runs.
#[test]
fn steps_that_do_not_fit_the_role_are_named() {
    let bench = Bench::new();
    let run = |parameters: &str, step: &str| {
        let text = format!(
            "[can1]\nendpoint = \"virtual:x\"\n[parameters]\n{parameters}\n\
             [[program]]\nat = 1\nbus = \"can1\"\ndata = \"01\"\n{step}\n"
        );
        std::fs::write(bench.path("run.toml"), text).unwrap();
        bench.run(&["run", "run.toml", "--for", "0.1"])
    };
    run("330 = 1", "do = \"send\"\nchannel = 3").ends(2).says("send at 1 s: [302] CAN Link = Yes expected");
    run("330 = 1", "do = \"write\"\nobject = 2").ends(2).says("write at 1 s: an object OUT of type Digital");
    run("330 = 1", "do = \"write\"\nobject = 1").ends(0);
    run("302 = 1", "do = \"write\"\nobject = 1").ends(2).says("on a CANopen bus expected");
    run("302 = 1", "do = \"send\"\nchannel = 3\nperiod = 100").ends(2).says("1 to 65535 ms");
}
