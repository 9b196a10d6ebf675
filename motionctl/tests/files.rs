//! What the program may do to files and lines: nothing in a dry run, and never destroy one that it reads or that
//! another program uses.
#![cfg(unix)]

mod common;

use common::Bench;

const CONFIG: &str = "
    [controller]
    state = \"state\"
    [[serial]]
    port = \"COM 2\"
    endpoint = \"pty:LINE\"
    protocol = \"lb2\"
    [can2]
    endpoint = \"virtual:a\"
";
const RECORDING: &str = "t,axis,position\n0,1,0\n1,1,5\n";

/// `--dry-run` was heeded by what talks to a device, and by nothing else.
#[test]
fn a_dry_run_touches_nothing() {
    let bench = Bench::new();
    let write = |name: &str, text: &str| std::fs::write(bench.path(name), text).unwrap();
    write("c.toml", CONFIG);
    write("r.csv", RECORDING);
    let before = bench.names();
    for (arguments, words) in [
        (&["run", "c.toml", "--record", "new.csv"][..], "would run a GEL 8230 with 0 steps, LB2 on pty:LINE"),
        (&["demo", "--plot", "d.svg", "--record", "d.csv"], "write d.csv, write d.svg"),
        (&["plot", "r.csv"], "would draw 2 samples in r.svg"),
        (&["sim", "controller", "--serial", "pty:LINE", "--state", "s"], "would be GEL 8230 on pty:LINE"),
        (&["sim", "controller", "--can1", "virtual:a", "--state", "s"], "would run a GEL 8230"),
        (
            &["sim", "io", "--node", "1", "--can", "slcan-pty:LINE", "--write-eds", "n.eds"],
            "would be io, node 1",
        ),
        (&["sim", "linmot", "--serial", "pty:LINE", "--state", "s"], "would be a LinMot drive 1 on pty:LINE"),
        (&["bus", "--listen", "127.0.0.1:1"], "would serve can0 at 127.0.0.1:1"),
        (&["can", "record", "new.log", "--can", "slcan-pty:LINE"], "would record slcan-pty:LINE to new.log"),
        (&["man", "--output", "."], "would write manual pages"),
    ] {
        bench.run(&[arguments, &["--dry-run"]].concat()).ends(0).says(words);
        let document = bench.run(&[arguments, &["--dry-run", "--json"]].concat()).ends(0).json();
        assert_eq!(document["dry_run"], true, "{arguments:?}");
        assert_eq!(bench.names(), before, "{arguments:?}");
    }
}

/// The recording, the configuration, and the first of two outputs were gone, with status 0.
#[test]
fn what_is_read_is_not_written_over() {
    let bench = Bench::new();
    std::fs::write(bench.path("c.toml"), CONFIG).unwrap();
    std::fs::write(bench.path("x.svg"), RECORDING).unwrap();
    std::os::unix::fs::symlink(bench.path("x.svg"), bench.path("link")).unwrap();
    for arguments in [
        &["plot", "x.svg"][..],
        &["plot", "x.svg", "--output", "link"],
        &["run", "c.toml", "--record", "./c.toml"],
        &["demo", "--plot", "same", "--record", "same"],
    ] {
        bench.run(arguments).ends(2).says("are the same file");
    }
    assert_eq!(std::fs::read_to_string(bench.path("x.svg")).unwrap(), RECORDING);
    assert_eq!(std::fs::read_to_string(bench.path("c.toml")).unwrap(), CONFIG);
}

/// A backup that was given as `--state` was filled up and written over.
#[test]
fn a_file_that_is_no_state_is_refused() {
    let bench = Bench::new();
    std::fs::write(bench.path("machine.toml"), "schema_version = 1\n").unwrap();
    for line in [["--serial", "pty:LINE"], ["--can1", "virtual:a"]] {
        let state = ["--state", "machine.toml"];
        let done = bench.run(&[&["sim", "controller"][..], &line, &state].concat());
        done.ends(5).says("no state of a controller: 141104 bytes expected, it has 19");
    }
    assert_eq!(std::fs::read_to_string(bench.path("machine.toml")).unwrap(), "schema_version = 1\n");
}

/// States grew by the model; those from before are states still.
#[test]
fn a_state_from_before_it_had_the_model_is_read() {
    let bench = Bench::new();
    let first = bench.controller(&[]);
    bench.run(&["params", "set", "--port", "LINE", "642", "777", "--save"]).ends(0);
    first.kill();
    std::fs::File::options().write(true).open(bench.path("FLASH")).unwrap().set_len(141_072).unwrap();
    let second = bench.controller(&[]);
    bench.run(&["params", "get", "--port", "LINE", "642"]).ends(0).says("777");
    assert_eq!(std::fs::metadata(bench.path("FLASH")).unwrap().len(), 141_104);
    drop(second);
}

/// A second program took the link of the first, which ran on where nobody could reach it.
#[test]
fn a_line_in_use_is_not_taken() {
    let bench = Bench::new();
    let first = bench.controller(&[]);
    let line = std::fs::read_link(bench.path("LINE")).unwrap();
    for arguments in [
        &["sim", "controller", "--serial", "pty:LINE"][..],
        &["params", "get", "--port", "pty:LINE", "642"],
        &["sim", "io", "--node", "1", "--can", "slcan-pty:LINE"],
        &["sim", "linmot", "--serial", "pty:./LINE"],
    ] {
        bench.run(arguments).ends(5).says("in use by another program");
    }
    assert_eq!(std::fs::read_link(bench.path("LINE")).unwrap(), line);
    drop(first);
}

/// Two drives on one state file overwrote each other's memory.
#[test]
fn a_state_file_has_one_drive() {
    let bench = Bench::new();
    let drive = |line| ["sim", "linmot", "--serial", line, "--state", "DRIVE"];
    for _ in 0..2 {
        let first = bench.device(&drive("pty:ONE"));
        bench.run(&drive("pty:TWO")).ends(5).says("DRIVE: in use by another program");
        // The file is a new one after each write.
        bench.run(&["linmot", "params", "set", "13A3h", "111", "--port", "serial:ONE"]).ends(0);
        bench.run(&drive("pty:TWO")).ends(5).says("DRIVE: in use by another program");
        drop(first);
    }
}

/// Numbers near the end of the range hung the drawing, or broke it.
#[test]
fn numbers_that_cannot_be_drawn_are_named() {
    let bench = Bench::new();
    for (rows, status) in [
        ("0,1,8e307\n1,1,-8e307\n", 5),
        ("-1e308,1,0\n1e308,1,1\n", 5),
        ("0,1,1e100\n1,1,-1e100\n", 0),
        ("-1e100,1,1e100\n1e100,1,-1e100\n", 0),
    ] {
        std::fs::write(bench.path("r.csv"), format!("t,axis,position\n{rows}")).unwrap();
        bench.run(&["plot", "r.csv"]).ends(status);
    }
}
