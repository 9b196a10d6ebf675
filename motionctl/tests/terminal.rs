//! Where the program's input and output go: pipes that nobody reads, and a terminal that is asked on.
#![cfg(unix)]

mod common;

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::process::{Command, Stdio};

use common::Bench;
use motion_io::port::{Port, Role, open};

/// The end of a terminal that a person has, and that of the program.
fn terminal(bench: &Bench) -> (Box<dyn Port>, File) {
    let link = bench.path("TERMINAL");
    let person = open(&format!("pty:{}", link.display()).parse().unwrap(), Role::Device).unwrap();
    (person, File::options().read(true).write(true).open(link).unwrap())
}

fn motionctl(bench: &Bench, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_motionctl"));
    command.args(arguments).current_dir(bench.directory.path()).stdin(Stdio::null());
    command
}

/// Standard output of which only `lines` lines are read, as by `head`.
#[track_caller]
fn head(bench: &Bench, arguments: &[&str], lines: usize) {
    let mut child =
        motionctl(bench, arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut said = BufReader::with_capacity(16, child.stdout.take().unwrap());
    for _ in 0..lines {
        assert_ne!(said.read_line(&mut String::new()).unwrap(), 0, "{arguments:?}");
    }
    drop(said);
    let ended = child.wait().unwrap();
    let mut error = String::new();
    child.stderr.take().unwrap().read_to_string(&mut error).unwrap();
    assert_eq!((ended.code(), error.contains("panicked")), (Some(0), false), "{arguments:?}: {error}");
}

#[test]
fn a_reader_that_goes_is_no_trouble() {
    let bench = Bench::new();
    for arguments in [
        &["params", "list"][..],
        &["params", "list", "--json"],
        &["completions", "bash"],
        &["man"],
        &["ports"],
        &["--help"],
    ] {
        head(&bench, arguments, 0);
        head(&bench, arguments, 1);
    }
    // What runs until it is stopped is stopped by it, as by a signal.
    std::fs::write(bench.path("run.toml"), "[[program]]\nat = 0.1\ndo = \"power\"\naxis = 1\n").unwrap();
    head(&bench, &["run", "run.toml", "--json"], 1);
}

/// Names of files and of what is in them could move the cursor, or put words into the terminal's mouth.
#[test]
fn names_cannot_steer_the_terminal() {
    let bench = Bench::new();
    let eds = "[DeviceInfo]\nVendorName=\u{1b}]0;title\u{7}\n[MandatoryObjects]\nSupportedObjects=1\n1=0x1000\n\
               [1000]\nParameterName=Type \u{1b}[2J\u{9b}2J\nObjectType=0x7\nDataType=0x0007\nAccessType=ro\n";
    std::fs::write(bench.path("a.eds"), eds).unwrap();
    std::fs::write(bench.path("log"), "can\u{7} 601#4000100000000000\ncan\u{7} 581#4300100000000000\n")
        .unwrap();
    let lb2 = "82 96 05 CC 30 05 00 FC\n";
    std::fs::write(bench.path("line\u{1b}[2J"), lb2).unwrap();
    for (arguments, words) in [
        (&["eds", "show", "a.eds"][..], "Type \\u{1b}[2J\\u{9b}2J"),
        (&["eds", "check", "a.eds"], "a.eds"),
        (&["decode", "log", "--eds", "1=a.eds"], "Type \\u{1b}[2J"),
        (&["decode", "log", "--eds", "1=a.eds", "--frames"], "can\\u{7}"),
        (&["decode", "line\u{1b}[2J", "log"], "== line\\u{1b}[2J\n"),
        (&["monitor", "--once", "log", "--eds", "1=a.eds"], "can\\u{7}"),
        (&["monitor", "--once", "line\u{1b}[2J"], "line\\u{1b}[2J  1 LB2"),
        (&["decode", "no\u{1b}[2J"], "error: no\\u{1b}[2J"),
    ] {
        let ran = bench.run(arguments).says(words);
        let said = ran.stdout() + &ran.stderr();
        let steers = |letter: char| letter.is_control() && letter != '\n';
        assert!(!said.contains(steers), "{arguments:?}: {said:?}");
    }
    // A program gets them as they are.
    let json = bench.run(&["monitor", "--once", "log", "--json"]).ends(0).json();
    assert_eq!(json["nodes"][0]["bus"], "can\u{7}");
}

/// Other trouble with standard output is told.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_trouble() {
    let bench = Bench::new();
    let full = File::options().write(true).open("/dev/full").unwrap();
    let ended = motionctl(&bench, &["params", "list"]).stdout(full).output().unwrap();
    let error = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(5), "{error}");
    assert!(error.contains("standard output"), "{error}");
}

/// That there are errors was told, but not that nobody can read which.
#[cfg(target_os = "linux")]
#[test]
fn a_failed_check_does_not_hide_a_full_disk() {
    let bench = Bench::new();
    std::fs::write(bench.path("letter.eds"), "Dear reader,\n").unwrap();
    let check = ["eds", "check", "letter.eds"];
    bench.run(&check).ends(1);
    let full = File::options().write(true).open("/dev/full").unwrap();
    let ended = common::Ran(motionctl(&bench, &check).stdout(full).output().unwrap());
    ended.ends(5).says("letter.eds: ").says("standard output: ");
}

/// What writes flash asks on a terminal, and nowhere else; `--yes` answers.
#[test]
fn flash_is_asked_for_on_a_terminal() {
    let bench = Bench::new();
    let _controller = bench.controller(&[]);
    bench.run(&["params", "backup", "--port", "LINE", "F.toml"]).ends(0);
    bench.run(&["params", "set", "--port", "LINE", "642", "5", "--save"]).ends(0);
    let asks = |arguments: &[&str], answer: &str| {
        let (mut person, terminal) = terminal(&bench);
        let mut child = motionctl(&bench, arguments)
            .stdin(terminal)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        person.send(answer.as_bytes()).unwrap();
        let mut words = String::new();
        child.stderr.take().unwrap().read_to_string(&mut words).unwrap();
        (child.wait().unwrap().code(), words)
    };
    let value = || {
        let json = bench.run(&["params", "get", "--port", "LINE", "642", "--json"]).ends(0).json();
        json["parameters"][0]["value"].as_i64().unwrap()
    };
    for arguments in [
        &["params", "restore", "--port", "LINE", "F.toml"][..],
        &["params", "reset", "--port", "LINE", "--factory"],
        &["params", "set", "--port", "LINE", "642", "0", "--save"],
    ] {
        bench.run(&["params", "set", "--port", "LINE", "642", "5", "--save"]).ends(0);
        let (status, words) = asks(arguments, "n\n");
        assert_eq!((status, value()), (Some(1), 5), "{arguments:?}: {words}");
        assert!(words.contains("flash?"), "{arguments:?}: {words}");
        let (status, words) = asks(arguments, "y\n");
        assert_eq!((status, value()), (Some(0), 0), "{arguments:?}: {words}");
        bench.run(&["params", "set", "--port", "LINE", "642", "5", "--save"]).ends(0);
        let (status, words) = asks(&[arguments, &["--yes"]].concat(), "");
        assert_eq!((status, value()), (Some(0), 0), "{arguments:?}: {words}");
        assert!(!words.contains("flash?"), "{arguments:?}: {words}");
    }
}
