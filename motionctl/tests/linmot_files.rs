//! Files of LinMot drives that are made or checked without one.
#![cfg(unix)]

mod common;
#[path = "common/linmot.rs"]
mod linmot;

use common::Bench;
use linmot::{CURVE, Linmot, drive};

#[test]
fn files_are_checked_without_a_drive() {
    let bench = Bench::new();
    let file = "FileType PVL\nStartObject Parameter\nTreeLayer 2\nTreeID 4612\nMainVersion 3\nSubVersion 0\nStartData\n1194;2\n119E;x\nEndData\nEndObject\n";
    std::fs::write(bench.path("F.pvl"), file).unwrap();
    let json = bench.run(&["linmot", "pvl", "check", "F.pvl", "--json"]).ends(1).json();
    assert_eq!(json["objects"][0]["tree_id"], 4612);
    let diagnostics = json["diagnostics"].as_array().unwrap();
    assert_eq!((diagnostics.len(), diagnostics[0]["line"].as_u64()), (1, Some(9)));
    assert_eq!(diagnostics[0]["severity"], "error");
    bench.run(&["linmot", "pvl", "check", "none.pvl"]).ends(5);
    std::fs::write(bench.path("L.pvl"), vec![b'x'; 5000]).unwrap();
    bench.run(&["linmot", "pvl", "check", "L.pvl"]).ends(5).says("L.pvl: line 1 is longer than 4096 bytes");
    // Before the endpoint is opened.
    for (content, words) in [
        (
            "# length_ms=1\n0\nfive\n",
            "line 3: a setpoint, -2147483648 to 2147483647, expected, \"five\" found",
        ),
        ("0\n1\n", "line 1: # name=… length_ms=… unit=0.1um expected, \"0\" found"),
        ("# length_ms=1\n0\n", "1 setpoints, 2 to 16383 expected"),
    ] {
        std::fs::write(bench.path("C.csv"), content).unwrap();
        bench.run(&["linmot", "curve", "add", "1", "C.csv", "--can", "slcan:NONE"]).ends(5).says(words);
    }
}

/// Setpoints of a file that `curve build` wrote.
fn setpoints(bench: &Bench, file: &str) -> Vec<i32> {
    let text = std::fs::read_to_string(bench.path(file)).unwrap();
    text.lines().skip(1).map(|line| line.parse().unwrap()).collect()
}

#[test]
fn curves_are_built_without_a_drive() {
    let bench = Bench::new();
    let build = |arguments: &[&str]| {
        bench.run(&[&["linmot", "curve", "build", "--output", "C.csv"], arguments].concat())
    };
    // Manual B, figure 13.
    let example = ["--name", "Example_Curve", "--to", "100mm", "--length", "200ms", "--setpoints", "10"];
    build(&example).ends(0).says("10 setpoints, 200 ms");
    let text = std::fs::read_to_string(bench.path("C.csv")).unwrap();
    assert!(text.starts_with("# name=Example_Curve length_ms=200 unit=0.1um "), "{text}");
    assert_eq!(text.lines().skip(1).collect::<Vec<_>>(), CURVE.lines().skip(1).collect::<Vec<_>>());
    // 50 ms and 25 mm up to 1 m/s, 50 ms at that speed, 50 ms down.
    let limits = ["--to", "100mm", "--velocity", "1m/s", "--acceleration", "20m/s2", "--setpoints", "151"];
    build(&limits).ends(0).says("151 setpoints, 150 ms, up to 1.0000 m/s");
    let found = setpoints(&bench, "C.csv");
    assert_eq!(
        [found[0], found[10], found[50], found[75], found[100], found[150]],
        [0, 10_000, 250_000, 500_000, 750_000, 1_000_000]
    );
    build(&[
        "--from",
        "-1mm",
        "--to",
        "1mm",
        "--length",
        "3600inc",
        "--profile",
        "trapezoid",
        "--setpoints",
        "7",
    ])
    .ends(0)
    .says("cam, 3600 increments");
    assert_eq!(setpoints(&bench, "C.csv"), [-10_000, -8750, -5000, 0, 5000, 8750, 10_000]);
    std::fs::write(bench.path("P.csv"), "# ms; mm\n0; 0\n10; 1\n40; -2\n").unwrap();
    build(&["--points", "P.csv", "--setpoints", "5"]).ends(0).says("5 setpoints, 40 ms");
    assert_eq!(setpoints(&bench, "C.csv"), [0, 10_000, 0, -10_000, -20_000]);
    for (content, words) in [
        ("0 0\n0 1\n", "line 2: an x above the one before expected, \"0 1\" found"),
        ("0 0\n5\n", "line 2: two numbers, x and y in mm, expected, \"5\" found"),
        ("0 0\n5 five\n", "line 2"),
        ("0 0\n", "1 point, at least 2 expected"),
    ] {
        std::fs::write(bench.path("P.csv"), content).unwrap();
        build(&["--points", "P.csv"]).ends(5).says(words);
    }
    build(&["--to", "50", "--length", "1s"]).ends(2).says("a number with its unit expected");
    build(&["--to", "50mm", "--length", "1mm"]).ends(2).says("--length: a time in ms or s");
    build(&["--to", "500m", "--length", "1s"]).ends(2).says("--to: -214748mm to 214748mm expected");
}

/// Limits that no motion can have are told by their option, in its unit.
#[test]
fn limits_of_nothing_are_refused_by_their_option() {
    let bench = Bench::new();
    for (to, velocity, acceleration, jerk, words) in [
        (
            "1mm",
            "0m/s",
            "1m/s2",
            "1m/s3",
            "error: --velocity: a velocity in mm/s or m/s, above 0, expected\n",
        ),
        (
            "1mm",
            "1m/s",
            "0mm/s2",
            "1m/s3",
            "--acceleration: an acceleration in mm/s2 or m/s2, above 0, expected",
        ),
        ("1mm", "1m/s", "1m/s2", "0mm/s3", "--jerk: a jerk in mm/s3 or m/s3, above 0, expected"),
        ("1mm", "100000000000000m/s", "1m/s2", "1m/s3", "--velocity: out of range"),
        ("0mm", "1m/s", "1m/s2", "1m/s3", "--to: another position than --from expected, or --length"),
    ] {
        let build = ["linmot", "curve", "build", "-o", "C.csv", "--to", to, "--velocity", velocity];
        let limits = ["--acceleration", acceleration, "--jerk", jerk];
        bench.run(&[&build[..], &limits].concat()).ends(2).says(words);
    }
}

/// y is in mm in the file and in 0.1 µm of 32 bits in the curve: what does not fit is not cut off.
#[test]
fn points_beyond_a_setpoints_range_are_refused() {
    let bench = Bench::new();
    for (y, fits) in [
        ("214748.3647", true),
        ("-214748.3647", true),
        ("214748.3648", false),
        ("-214749", false),
        ("1e300", false),
        ("-1e308", false),
        ("inf", false),
        ("NaN", false),
    ] {
        std::fs::write(bench.path("P.csv"), format!("0 0\n10 {y}\n")).unwrap();
        let build = ["linmot", "curve", "build", "-o", "C.csv", "--points", "P.csv", "--setpoints", "3"];
        let ran = bench.run(&build);
        if fits {
            ran.ends(0);
            let end = (y.parse::<f64>().unwrap() * 1e4) as i32;
            assert_eq!(setpoints(&bench, "C.csv").last(), Some(&end), "{y}");
        } else {
            ran.ends(5).says("P.csv: line 2: ").says(y);
        }
    }
    std::fs::write(bench.path("P.csv"), "-1e308 0\n1e308 1\n").unwrap();
    bench
        .run(&["linmot", "curve", "build", "-o", "C.csv", "--points", "P.csv"])
        .ends(2)
        .says("the points' length: 0.01 ms to 42949672.95 ms");
}

/// What is no such file at all: it is said what was expected and what came, and nothing reaches the drive.
#[test]
fn files_of_another_kind_are_named_as_such() {
    let bench = Bench::new();
    std::fs::write(bench.path("text"), "[package]\nname = \"x\"\n\nversion = \"1\"\n").unwrap();
    std::fs::write(bench.path("empty"), "").unwrap();
    std::fs::write(bench.path("binary"), (0..=255).cycle().take(3000).collect::<Vec<u8>>()).unwrap();
    std::fs::write(bench.path("curve"), CURVE).unwrap();
    std::fs::create_dir(bench.path("directory")).unwrap();
    let pvl = [
        ("text", "line 1: no PVL file: FileType PVL expected at its beginning, \"[package]\" found"),
        ("empty", "line 1: the file has no parameter object and no curve"),
        ("binary", "line 1: no PVL file: FileType PVL expected at its beginning"),
        ("curve", "line 1: no PVL file: FileType PVL expected at its beginning, \"# name=Example_Curve"),
        ("directory", "directory: Is a directory"),
    ];
    for (file, words) in pvl {
        for command in ["restore", "compare"] {
            let arguments = ["--yes", "linmot", "pvl", command, file, "--can", "slcan:NONE"];
            bench.run(&arguments).ends(5).says(file).says(words);
        }
        // A check that finds errors is a check that failed; a directory cannot be read.
        let status = if file == "directory" { 5 } else { 1 };
        bench.run(&["linmot", "pvl", "check", file]).ends(status).says(words.trim_start_matches("line 1: "));
    }
    let table = [
        ("text", "text: no command table file: format = 1 expected, nothing found"),
        ("empty", "empty: no command table file: format = 1 expected, nothing found"),
        ("binary", "binary: "),
        ("curve", "curve: TOML parse error at line 2"),
        ("directory", "directory: Is a directory"),
    ];
    for (file, words) in table {
        for command in ["restore", "compare"] {
            let arguments = ["--yes", "linmot", "table", command, file, "--can", "slcan:NONE"];
            bench.run(&arguments).ends(5).says(words);
        }
    }
    for (content, words) in [
        ("format = 2\n", "format = 1 expected, 2 found"),
        (
            "format = 1\n",
            "it has no entries, so that a restore deletes all: entries = 0 in its head must say so",
        ),
        ("format = 1\n[[entry]]\nentry = 256\n", "entry no. 1 of the file: entry = 1 to 255 expected"),
        ("format = 1\n[[entry]]\nentry = 1\n", "entry 1: raw = \"…\" expected"),
        ("format = 1\n[[entry]]\nentry = 1\nraw = \"01A7\"\n", "2 bytes, 64 expected"),
        ("format = 1\n[[entry]]\nentry = 1\nraw = \"01A\"\n", "hex digits in pairs expected, 3 found"),
        ("format = 1\n[[entry]]\nentry = 1\nraw = \"xx\"\n", "hex digits expected, 'x' found"),
        ("format = \n", "line 1"),
    ] {
        std::fs::write(bench.path("T.toml"), content).unwrap();
        let arguments = ["linmot", "table", "compare", "T.toml", "--can", "slcan:NONE"];
        bench.run(&arguments).ends(5).says("T.toml: ").says(words);
    }
    for file in ["text", "empty", "binary", "directory"] {
        bench.run(&["linmot", "curve", "add", "1", file, "--can", "slcan:NONE"]).ends(5).says(file);
        bench.run(&["linmot", "curve", "build", "-o", "C", "--points", file]).ends(5).says(file);
    }
}

/// A disk that is full is said, with status 5; a device stays what it is, and an older file whole.
#[test]
fn a_full_disk_is_said() {
    if !std::path::Path::new("/dev/full").exists() {
        return;
    }
    let bench = Bench::new();
    let _drive = drive(&bench, "--can=slcan-pty:LINE");
    let linmot = Linmot { bench: &bench, carrier: &["--can", "slcan:LINE"] };
    std::fs::write(bench.path("C.csv"), CURVE).unwrap();
    linmot.run(&["curve", "add", "23", "C.csv"]).ends(0);
    for arguments in [
        &["pvl", "backup", "/dev/full"][..],
        &["table", "backup", "/dev/full"],
        &["curve", "get", "23", "-o", "/dev/full"],
        &["curve", "plot", "23", "-o", "/dev/full"],
    ] {
        linmot.run(arguments).ends(5).says("/dev/full: No space left on device");
    }
    let full = std::fs::metadata("/dev/full").unwrap();
    assert!(!full.is_file(), "a file took the device's place");
    // Standard output that takes nothing.
    let mut command = bench.command(&["linmot", "params", "list", "--can", "slcan:LINE"]);
    let out = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    common::Ran(command.stdout(out).output().unwrap()).ends(5).says("standard output: No space left");
    linmot.run(&["pvl", "backup", "none/B.pvl"]).ends(5).says("none/B.pvl: ");
}

/// Nobody reads to the end: no trouble, and what was asked for is done.
#[test]
fn a_reader_that_leaves_is_no_trouble() {
    let bench = Bench::new();
    let _drive = drive(&bench, "--can=slcan-pty:LINE");
    for arguments in
        [&["params", "list"][..], &["errors"], &["table", "list"], &["params", "set", "13A2h", "77"]]
    {
        let all = [&["linmot"], arguments, &["--can", "slcan:LINE"]].concat();
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let ran = common::Ran(bench.command(&all).stdout(writer).output().unwrap()).ends(0);
        assert!(!ran.stderr().contains("panic"), "{}", ran.stderr());
    }
    let get = ["linmot", "params", "get", "13A2h", "--can", "slcan:LINE"];
    bench.run(&get).ends(0).says("ROM 77");
}

/// What `pvl check` warns of is said before anything is written, too.
#[test]
fn warnings_of_a_file_are_said_before_it_is_restored() {
    let bench = Bench::new();
    let _drive = drive(&bench, "--can=slcan-pty:LINE");
    let linmot = Linmot { bench: &bench, carrier: &["--can", "slcan:LINE"] };
    std::fs::write(bench.path("C.csv"), CURVE).unwrap();
    linmot.run(&["curve", "add", "7", "C.csv"]).ends(0);
    linmot.run(&["pvl", "backup", "B.pvl"]).ends(0);
    common::edit(&bench.path("B.pvl"), "@CurveID 7", "@CurveID 71");
    let words = "CurveID is 71, the info block says 7";
    bench.run(&["linmot", "pvl", "check", "B.pvl"]).ends(0).says(words);
    for arguments in [
        &["pvl", "compare", "B.pvl"][..],
        &["--dry-run", "pvl", "restore", "B.pvl"],
        &["--yes", "pvl", "restore", "B.pvl"],
    ] {
        let ran = linmot.run(arguments).ends(0).says("note: B.pvl:").says(words);
        assert!(ran.stderr().contains(words));
        assert!(linmot.json(arguments)["remarks"][0].as_str().unwrap().ends_with(words));
    }
    let asked = linmot.run(&["pvl", "restore", "B.pvl"]).ends(2);
    assert!(asked.stderr().find(words) < asked.stderr().find("--yes"), "{}", asked.stderr());
}

/// Steps between rounded setpoints are up to a unit longer than the motion's own.
#[test]
fn the_told_speed_of_a_built_curve_is_the_motions_own() {
    let bench = Bench::new();
    let build = |arguments: &[&str]| {
        let json = bench.run(&[&["--json", "linmot", "curve", "build", "-o", "C.csv"], arguments].concat());
        let json = json.ends(0).json();
        assert!(json["curve"].get("id").is_none(), "{json}");
        json["fastest_m_per_s"].as_f64()
    };
    let limits = ["--to", "1mm", "--velocity", "7mm/s", "--acceleration", "1m/s2", "--setpoints", "1000"];
    let found = build(&limits).unwrap();
    assert!(found <= 0.007 && found > 0.006_99, "{found}");
    let steps = setpoints(&bench, "C.csv").windows(2).map(|two| two[1] - two[0]).max().unwrap();
    assert!(steps > 10, "{steps}");
    let shape = |profile| build(&["--to", "20mm", "--length", "200ms", "--profile", profile]);
    let found = ["sine", "minimum-jerk", "trapezoid"].map(shape);
    assert_eq!(found, [Some(0.157_079_6), Some(0.1875), Some(0.15)]);
    assert_eq!(build(&["--to", "20mm", "--length", "200inc"]), None);
    std::fs::write(bench.path("P.csv"), "0 0\n10 1\n40 -2\n").unwrap();
    assert_eq!(build(&["--points", "P.csv", "--setpoints", "7"]), Some(0.1));
}
