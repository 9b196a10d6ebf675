//! The soft controller in real time: a drive on a virtual bus, a plant on the terminals, LB2 on a
//! pseudo-terminal, and what it tells of its cycle.
#![cfg(unix)]

mod common;

use std::io::{BufRead, BufReader, Lines};
use std::process::{Child, ChildStdout, Command, Stdio};

use common::{Bench, Ran};
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

/// Runs a configuration to its end.
fn run(bench: &Bench, config: &str, more: &[&str]) -> Ran {
    std::fs::write(bench.path("run.toml"), config).unwrap();
    bench.run(&[&["run", "run.toml"], more].concat())
}

/// What `--record run.csv` wrote of an axis under this heading.
fn recorded(bench: &Bench, axis: &str, heading: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(bench.path("run.csv")).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let headings = lines.next().unwrap();
    let place = |name: &str| headings.iter().position(|heading| *heading == name).unwrap();
    let (number, value) = (place("axis"), place(heading));
    lines.filter(|line| line[number] == axis).map(|line| line[value].parse().unwrap()).collect()
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
    let ran = run(&bench, config, &["--for", "2.0", "--record", "run.csv"]).ends(0);
    for words in ["gear-in: done", "synchronized-motion", "gear-out: done"] {
        assert!(ran.stdout().contains(words), "{words:?}: {}", ran.stdout());
    }
    let [back, left] = ["1", "2"].map(|axis| *recorded(&bench, axis, "position").last().unwrap());
    assert!(back.abs() <= 20.0, "back: {back}");
    assert!((left + 3_000.0).abs() <= 9.0, "left behind: {left}");
}

#[test]
fn the_histogram_is_drawn_for_people() {
    let bench = Bench::new();
    let text = run(&bench, "[can1]\nendpoint = \"virtual:a\"\n", &["--for", "0.1"]).ends(0).stdout();
    let end: Vec<&str> = text.lines().skip_while(|line| !line.contains(" overruns, begun")).collect();
    assert_eq!(end.len(), 12, "{text}");
    assert!(end[1].trim_start().starts_with("<    10 µs") && end[11].contains("more"), "{text}");
    assert!(end.iter().any(|line| line.ends_with('#')), "{text}");
}

#[test]
fn what_cannot_run_is_named() {
    let bench = Bench::new();
    let run = |text: &str| run(&bench, text, &["--for", "0.1"]);
    run("[parameters]\n642 = 9999999\n").ends(2).says("= 9999999: Value out of range");
    run("[parameters]\n0 = 2\n").ends(2).says("109");
    run("[[simulate]]\nkind = \"drive\"\nbus = \"can1\"\nnode = 1\n").ends(2);
    bench.run(&["run", "absent.toml"]).ends(5).says("absent.toml");
    bench.run(&["run", "."]).ends(5);
}

/// Decision 28 holds for an axis that brakes off a limit switch when the end comes: it is not let go before it
/// stands.
#[test]
fn a_failed_axis_is_brought_to_standstill_at_the_end() {
    let bench = Bench::new();
    let config = r#"
[parameters]
0 = 1
108 = 0
109 = 0
601 = 0
602 = 0
642 = 100000
648 = 300
654 = 200
660 = 1000
924 = 1
930 = 20000

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
at = 0.1
do = "move-velocity"
axis = 1
velocity = 100000
"#;
    let ran = run(&bench, config, &["--for", "0.7", "--record", "run.csv"]).ends(0);
    let ran = ran.says("error-stop").says("upper software limit passed");
    let velocities = recorded(&bench, "1", "nominal_velocity");
    assert!(velocities.contains(&100_000.0));
    assert_eq!(velocities.last(), Some(&0.0));
    // 100 a cycle; what was let go drops to 0 at once.
    let steepest = velocities.windows(2).map(|pair| pair[0] - pair[1]).fold(0.0, f64::max);
    assert!(steepest <= 101.0, "{steepest} in a cycle: {}", ran.stdout());
}

/// Status 1, and how many; a step in whose place another one came has not failed.
#[test]
fn a_step_that_fails_is_a_check_that_failed() {
    let bench = Bench::new();
    let base = "[parameters]\n0 = 1\n108 = 0\n109 = 0\n601 = 0\n602 = 0\n606 = 8\n642 = 1000\n654 = 100\n";
    let step = |at: f64, line: &str| format!("[[program]]\nat = {at}\naxis = 1\n{line}\n");
    let power = step(0.05, "do = \"power\"");
    let far = step(0.1, "do = \"move-absolute\"\nposition = 100000\nvelocity = 100");
    let run = |steps: &[&str]| run(&bench, &(base.to_string() + &steps.concat()), &["--for", "0.3"]);
    run(&[&power, &far, &step(0.15, "do = \"halt\"")]).ends(0).says("move-absolute: aborted");
    run(&[&far]).ends(1).says("error 102h").says("a step of the program failed");
    let fast = step(0.15, "do = \"move-velocity\"\nvelocity = 9999");
    let homeless = step(0.2, "do = \"home\"");
    let ran = run(&[&power, &far, &fast, &homeless]).ends(1).says("error 106h").says("error 105h");
    assert!(!ran.says("2 steps of the program failed").stdout().contains("aborted"));
}

/// The axis moves on to its target.
#[cfg(target_os = "linux")]
#[test]
fn a_recording_that_cannot_be_written_is_told_at_once() {
    let bench = Bench::new();
    let config = "[parameters]\n0 = 1\n108 = 0\n109 = 0\n601 = 0\n602 = 0\n606 = 8\n642 = 1000\n654 = 100\n\
                  [[program]]\nat = 0.05\ndo = \"power\"\naxis = 1\n\
                  [[program]]\nat = 0.1\ndo = \"move-absolute\"\naxis = 1\nposition = 1500\n";
    let ran = run(&bench, config, &["--for", "3", "--record", "/dev/full"]).ends(5);
    let ran = ran.says("note: nothing is recorded any more: /dev/full: ").says("move-absolute: done");
    assert!(ran.stderr().contains("error: /dev/full: "), "{}", ran.stderr());
    let ran = run(&bench, config, &["--for", "3", "--record", "/dev/full", "--json"]).ends(5);
    let told = ran.stdout().lines().position(|line| line.contains("remarks") && line.contains("/dev/full"));
    let done = ran.stdout().lines().position(|line| line.contains("\"move-absolute\""));
    assert!(told.is_some() && told < done, "{}", ran.stdout());
}

/// A state is that of one model; a bit that has changed in it is told.
#[test]
fn a_state_that_is_damaged_or_of_another_model_is_told() {
    let bench = Bench::new();
    let state = "[controller]\nstate = \"state\"\n";
    let start = |more: &str| run(&bench, &(state.to_string() + more), &["--for", "0.05"]);
    assert!(!start("").ends(0).stderr().contains("flash.bin"));
    start("model = 8231\n").ends(5).says("flash.bin: the state of a GEL 8230, GEL 8231 expected");
    let line = ["sim", "controller", "--serial", "pty:LINE", "--state", "state/flash.bin"];
    bench.run(&[&line[..], &["--model", "8231"]].concat()).ends(5).says("the state of a GEL 8230");
    {
        let _device = bench.device(&line);
        bench.run(&["params", "set", "--port", "LINE", "642", "5", "--save"]).ends(0);
    }
    let path = bench.path("state/flash.bin");
    let mut flash = std::fs::read(&path).unwrap();
    flash[100] ^= 1;
    std::fs::write(&path, flash).unwrap();
    start("").ends(0).says("flash.bin is damaged: ");
}

/// Every mistake is named with its place, with status 2, before anything is begun.
#[test]
fn mistakes_in_a_configuration_are_named() {
    let bench = Bench::new();
    let plant =
        |line: &str| format!("[[simulate]]\nkind = \"plant\"\nblock = 1\ndrive = \"first-order\"\n{line}\n");
    let step = |line: &str| format!("[[program]]\naxis = 1\n{line}\n");
    let bus = "[can1]\nendpoint = \"virtual:a\"\n";
    let io = "[[simulate]]\nkind = \"io\"\nbus = \"can1\"\nnode = 5\n";
    let serial = |line: &str| format!("[[serial]]\nport = \"COM 2\"\nprotocol = \"lb2\"\n{line}\n");
    let cases: &[(String, &[&str])] = &[
        ("[parameters\n".into(), &["line 1"]),
        ("[can1]\nendpoint = 5\n".into(), &["line 2", "string"]),
        ("[can1]\nendpoint = \"virtual:a\"\nbitrat = 1\n".into(), &["line 3", "bitrat"]),
        (format!("{bus}{bus}"), &["can1", "duplicate key"]),
        ("[can1]\nendpoint = \"virtual\"\n".into(), &["virtual"]),
        ("[can3]\nendpoint = \"virtual:a\"\n".into(), &["can3"]),
        ("[controller]\nmodel = \"x\"\n".into(), &["line 2"]),
        ("[controller]\ndevice_number = 256\n".into(), &["line 2", "256"]),
        ("[controller]\ndevice_number = 32\n".into(), &["= 32"]),
        ("[parameters]\nnonsense = 1\n".into(), &["nonsense"]),
        ("[parameters]\n50 = 1\n".into(), &["50"]),
        ("[parameters]\n654 = 0.5\n".into(), &["line 2", "whole number", "654 = \"0.5\""]),
        ("[parameters]\n642 = 99999999999\n".into(), &["line 2"]),
        ("[parameters]\n642 = 1\n\"V max.@Axis 1\" = 2\n".into(), &["set twice", "V max."]),
        ("[parameters]\n300 = \"Chief\"\n".into(), &["Chief"]),
        (serial("endpoint = \"serial:/dev/null?baud=fast\""), &["baud", "fast"]),
        (serial("endpoint = \"pty:A\"") + &serial("endpoint = \"pty:B\""), &["Com2", "twice"]),
        (
            "[can1]\nendpoint = \"slcan-pty:A\"\n[can2]\nendpoint = \"slcan-pty:A\"\n".into(),
            &["slcan-pty:A", "twice"],
        ),
        (format!("{bus}{io}{io}"), &["node 5", "twice"]),
        (format!("{bus}{}", io.replace("node = 5", "node = 0")), &["node 0", "1 to 127"]),
        (plant("speed = nan"), &["speed NaN"]),
        (plant("speed = inf"), &["speed inf"]),
        (plant("speed = -5"), &["speed -5"]),
        (plant("speed = 1\ntau = 0"), &["tau 0"]),
        (plant("speed = 1\nedges = 0"), &["edges 0"]),
        (plant("speed = 1\nmark = -9223372036854775808"), &["mark"]),
        (plant("speed = 1\nlimits = [{ input = \"I9.0\", position = 1, upper = true }]"), &["I9.0"]),
        (plant("speed = 1\nlimits = [{ input = \"I1.0\", position = nan, upper = true }]"), &["NaN"]),
        (plant("speed = 1") + &plant("speed = 1"), &["block 1", "twice"]),
        (plant("speed = 1").replace("block = 1", "block = 4"), &["block 4", "1 to 3"]),
        (step("at = -1\ndo = \"home\""), &["home at -1 s", "from 0 on"]),
        (step("at = nan\ndo = \"home\""), &["from 0 on"]),
        (step("at = 1e300\ndo = \"home\""), &["from 0 on"]),
        (step("at = 0\ndo = \"jog\"\nfor = inf"), &["for inf", "above 0"]),
        (step("at = 0\ndo = \"jog\"\nfor = -1"), &["for -1", "above 0"]),
        (step("at = 0\ndo = \"fly\""), &["line 4", "fly"]),
        (step("at = 0\ndo = \"move-absolute\"\nposition = 9999999999"), &["line 5"]),
        (step("at = 0\ndo = \"move-absolute\"\nposition = 1\nvelocity = -1"), &["velocity -1"]),
        (step("at = 0\ndo = \"home\"").replace("axis = 1", "axis = 7"), &["axis 7", "1 to 6"]),
        (step("at = 0\ndo = \"gear-in\"\ninput = 7\nnumerator = 1"), &["input 7", "1 to 6"]),
        (step("at = 0\ndo = \"gear-in\"\ninput = 1"), &["numerator is missing"]),
        (step("at = 0\ndo = \"gear-in\"\ninput = 1\nnumerator = 1\ndenominator = 0"), &["other than 0"]),
        ("[extension]\nkind = \"modbus-tcp\"\nlisten = \"here\"\n".into(), &["listen", "HOST:PORT"]),
        ("[extension]\nkind = \"modbus-tcp\"\nlisten = \"[::1]:0\"\nwatchdog = -1\n".into(), &["watchdog"]),
        ("[extension]\nkind = \"carrier-pigeon\"\n".into(), &["carrier-pigeon"]),
    ];
    let mut wrong = Vec::new();
    for (text, words) in cases {
        let ran = run(&bench, text, &["--for", "0.05"]);
        let said = ran.stderr();
        let named = words.iter().chain(&["run.toml"]).all(|word| said.contains(word));
        if ran.0.status.code() != Some(2) || !named {
            wrong.push(format!("{text}{:?}, {words:?} expected: {said}", ran.0.status.code()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for seconds in ["-1", "nan", "1e300"] {
        run(&bench, "", &[&format!("--for={seconds}")]).ends(2).says("--for");
    }
    bench.run(&["run", "run.toml", "--for", "0.05", "--record", "no/such.csv"]).ends(5).says("no/such.csv");
    std::fs::write(bench.path("run.toml"), [0xFF, 0xFE, 0]).unwrap();
    bench.run(&["run", "run.toml"]).ends(5).says("run.toml");
    let state = "[controller]\nstate = \"run.toml\"\n";
    run(&bench, state, &["--for", "0.05"]).ends(5).says("run.toml");
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = listener.local_addr().unwrap().to_string();
    let text = format!("[extension]\nkind = \"modbus-tcp\"\nlisten = \"{taken}\"\n");
    run(&bench, &text, &["--for", "0.05"]).ends(5).says(&taken);
}
