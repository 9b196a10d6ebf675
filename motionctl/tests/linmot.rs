//! A virtual LinMot drive on pseudo-terminals, and every command that talks to it, over each carrier.
#![cfg(unix)]

mod common;

use common::{Bench, Controller, edit};
use serde_json::Value;

/// The drive, and the arguments that reach it.
const CARRIERS: [(&str, &[&str]); 3] = [
    ("--serial=pty:LINE", &["--port", "LINE"]),
    ("--can=slcan-pty:LINE", &["--can", "slcan:LINE"]),
    ("--can=slcan-pty:LINE", &["--can", "slcan:LINE", "--carrier", "pdo"]),
];

/// Manual B, figure 13.
const CURVE: &str = "# name=Example_Curve length_ms=200 unit=0.1um\n0\n30154\n116978\n250000\n413176\n586824\n750000\n883022\n969846\n1000000\n";

struct Linmot<'a> {
    bench: &'a Bench,
    carrier: &'a [&'a str],
}

impl Linmot<'_> {
    fn run(&self, arguments: &[&str]) -> common::Ran {
        let mut all = vec!["linmot"];
        all.extend(arguments.iter().take_while(|argument| **argument != "--"));
        all.extend(self.carrier);
        all.extend(arguments.iter().skip_while(|argument| **argument != "--"));
        self.bench.run(&all)
    }

    #[track_caller]
    fn json(&self, arguments: &[&str]) -> Value {
        let mut all = vec!["--json"];
        all.extend(arguments);
        self.run(&all).ends(0).json()
    }
}

fn drive(bench: &Bench, endpoint: &str) -> Controller {
    bench.device(&["sim", "linmot", endpoint, "--state", "FLASH"])
}

fn entry(link: u16, name: &str) -> String {
    let [low, high] = link.to_le_bytes();
    let name: String = name.bytes().map(|byte| format!("{byte:02X}")).collect();
    format!("01A7{low:02X}{high:02X}0001{:0<64}{name:0<32}{:0<20}", "", "")
}

/// Backup to PVL → factory default → restart → restore → save → restart → compare equal.
#[test]
fn a_drive_comes_back_from_its_files_over_every_carrier() {
    for (endpoint, carrier) in CARRIERS {
        let bench = Bench::new();
        let drive = drive(&bench, endpoint);
        let linmot = Linmot { bench: &bench, carrier };
        std::fs::write(bench.path("C.csv"), CURVE).unwrap();
        linmot.run(&["params", "set", "11A2h", "--", "-5"]).ends(0);
        linmot.run(&["params", "set", "13A2h", "--", "77"]).ends(0);
        linmot.run(&["params", "set", "03F2h", "--", "X Axis Left"]).ends(0);
        linmot.run(&["curve", "add", "23", "C.csv"]).ends(0);
        linmot.run(&["curve", "save", "--yes"]).ends(0);
        linmot.run(&["table", "set", "3", "--raw", &entry(7, "Move out")]).ends(0);
        linmot.run(&["table", "set", "7", "--raw", &entry(0xFFFF, "Move back")]).ends(0);
        linmot.run(&["table", "save", "--yes"]).ends(0);

        let backup = linmot.json(&["pvl", "backup", "B.pvl"]);
        assert_eq!((backup["parameters"].as_u64(), backup["curves"].as_u64()), (Some(37), Some(1)));
        linmot.run(&["table", "backup", "T.toml"]).ends(0).says("2 entries");
        let text = std::fs::read_to_string(bench.path("B.pvl")).unwrap();
        // Manual B, table 1.
        for row in ["03F3h, 78412058h", "03F4h, 4C207369h", "03F5h, 00746665h", "000F4240h"] {
            assert!(text.contains(row), "{row}");
        }
        let defaults = ["params", "defaults", "--layer", "os", "mc", "interface", "application"];
        linmot.run(&defaults).ends(2).says("--yes must say so");
        linmot.run(&[&["--yes"], &defaults[..]].concat()).ends(0);
        linmot.run(&["curve", "delete-all"]).ends(0);
        linmot.run(&["curve", "save", "--yes"]).ends(0);
        linmot.run(&["table", "delete-all"]).ends(0);
        linmot.run(&["table", "save", "--yes"]).ends(0);
        linmot.run(&["restart", "--wait"]).ends(0);
        linmot
            .run(&["pvl", "compare", "B.pvl"])
            .ends(1)
            .says("curve 23 is not in the drive")
            .says("6 differences");
        linmot.run(&["table", "compare", "T.toml"]).ends(1).says("entry 3 is not in the drive");

        linmot.run(&["--dry-run", "pvl", "restore", "B.pvl"]).ends(0).says("5 of them would be written");
        linmot.run(&["pvl", "restore", "B.pvl"]).ends(2).says("--yes");
        let restored = linmot.json(&["--yes", "pvl", "restore", "B.pvl"]);
        assert_eq!((restored["written"].as_u64(), restored["curves"].as_u64()), (Some(5), Some(1)));
        linmot.run(&["--yes", "table", "restore", "T.toml"]).ends(0);
        linmot.run(&["restart", "--wait"]).ends(0);
        let compared = linmot.json(&["pvl", "compare", "B.pvl"]);
        assert_eq!(
            (compared["equal"].as_bool(), compared["equal_parameters"].as_u64()),
            (Some(true), Some(37))
        );
        linmot.run(&["table", "compare", "T.toml"]).ends(0).says("2 equal");
        let get = linmot.json(&["params", "get", "03F2h"]);
        assert_eq!(get["parameters"][0]["text"], "X Axis Left");

        // Power fails: what was saved is there.
        drive.kill();
        let _drive = self::drive(&bench, endpoint);
        linmot.run(&["pvl", "compare", "B.pvl"]).ends(0);
        linmot.run(&["curve", "get", "23", "-o", "D.csv"]).ends(0);
        let again = std::fs::read_to_string(bench.path("D.csv")).unwrap();
        assert_eq!(again.lines().skip(1).collect::<Vec<_>>(), CURVE.lines().skip(1).collect::<Vec<_>>());
        linmot.run(&["curve", "modify", "23", "D.csv"]).ends(0);
        linmot.run(&["curve", "plot", "23", "-o", "D.svg"]).ends(0);
        assert!(std::fs::read_to_string(bench.path("D.svg")).unwrap().starts_with("<svg "));
        let errors = linmot.json(&["errors"]);
        assert_eq!((errors["logged"].as_u64(), errors["errors"][0]["code"].as_u64()), (Some(2), Some(0x64)));
        assert_eq!(errors["errors"][0]["text"], "Cfg Err: No Motor Defined");
    }
}

#[test]
fn refusals_are_named() {
    for (endpoint, carrier) in CARRIERS {
        let bench = Bench::new();
        let drive = drive(&bench, endpoint);
        let linmot = Linmot { bench: &bench, carrier };
        linmot.run(&["params", "get", "1111h"]).ends(4).says("UPID error");
        linmot.run(&["params", "set", "2136h", "--rom", "--", "1"]).ends(4).says("address usage error");
        linmot.run(&["params", "set", "119Eh", "--ram", "--", "1"]).ends(4).says("not live");
        linmot
            .run(&["params", "set", "119Eh", "--", "32001"])
            .ends(4)
            .says("UPID 119Eh: 32001 is out of range, 0 to 32000 expected; nothing was written");
        linmot.run(&["params", "set", "3001h", "--", "101"]).ends(4).says("-100 to 100 expected");
        linmot.run(&["params", "set", "119Eh", "--", "x"]).ends(2).says("a number of 32 bits expected");
        linmot.run(&["curve", "get", "5", "-o", "X"]).ends(4).says("no such curve");
        std::fs::write(bench.path("C.csv"), CURVE).unwrap();
        linmot.run(&["curve", "modify", "5", "C.csv"]).ends(4).says("no such curve");
        linmot.run(&["curve", "add", "5", "C.csv"]).ends(0);
        linmot.run(&["curve", "add", "5", "C.csv"]).ends(4).says("a curve with this ID exists");
        edit(&bench.path("C.csv"), "30154\n", "");
        linmot.run(&["curve", "modify", "5", "C.csv"]).ends(4).says("size error");
        linmot.run(&["curve", "add", "101", "C.csv"]).ends(1).says("1 to 100 expected");
        linmot.run(&["table", "get", "9"]).ends(4).says("no such entry");
        linmot.run(&["table", "set", "9", "--raw", "00"]).ends(2).says("64 expected");
        linmot.run(&["table", "set", "9", "--raw", &entry(10, "x")]).ends(0);
        linmot.run(&["table", "check"]).ends(1).says("entry 9 is linked to entry 10, which does not exist");

        // Files that do not fit the drive: nothing is written.
        linmot.run(&["pvl", "backup", "B.pvl"]).ends(0);
        for (from, to, words) in [
            ("@TreeID 4612", "@TreeID 4613", "layer mc: tree ID 4613 in the file, 4612 in the drive"),
            ("@SubVersion 5", "@SubVersion 6", "layer interface: sub version 6 in the file, 5 in the drive"),
            ("13A2h, ", "13B2h, ", "UPID 13B2h is unknown to the drive"),
            ("119Eh, ", "1B62h, ", "UPID 1B62h is read-only in the drive"),
            ("119Eh, 0000", "119Eh, 000x", "a hex number of up to 8 digits expected"),
        ] {
            std::fs::copy(bench.path("B.pvl"), bench.path("X.pvl")).unwrap();
            edit(&bench.path("X.pvl"), from, to);
            linmot.run(&["--yes", "pvl", "restore", "X.pvl"]).ends(1).says(words);
        }
        // A value that the drive would cut off.
        std::fs::copy(bench.path("B.pvl"), bench.path("X.pvl")).unwrap();
        edit(&bench.path("X.pvl"), "119Eh, 00001F40h", "119Eh, 00000001h");
        edit(&bench.path("X.pvl"), "20A0h, 00000001h", "20A0h, 00000101h");
        linmot
            .run(&["--yes", "pvl", "restore", "X.pvl"])
            .ends(1)
            .says("nothing was written: UPID 20A0h is 257 in the file, out of range: 1 to 127 expected");
        linmot.run(&["--dry-run", "pvl", "restore", "X.pvl"]).ends(1).says("out of range");
        linmot.run(&["--yes", "pvl", "restore", "B.pvl"]).ends(0).says("0 of them written");
        // A negative number extended by its sign is the same number.
        edit(&bench.path("B.pvl"), "3001h, 000000FBh", "3001h, FFFFFFFBh");
        linmot.run(&["pvl", "compare", "B.pvl"]).ends(0);
        // A curve of another size, which only deleting makes room for.
        linmot.run(&["curve", "delete-all"]).ends(0);
        linmot.run(&["curve", "add", "5", "C.csv"]).ends(0);
        linmot
            .run(&["--yes", "pvl", "restore", "B.pvl"])
            .ends(1)
            .says("nothing was written: curve 5 is in the drive with another number of setpoints");
        linmot.run(&["--yes", "pvl", "restore", "B.pvl", "--replace-curves"]).ends(0);
        linmot.run(&["pvl", "compare", "B.pvl"]).ends(0);
        drive.kill();
        let gone = linmot.run(&["--timeout", "0.2", "params", "get", "13A2h"]);
        assert!([3, 5].contains(&gone.0.status.code().unwrap()), "{}", gone.stderr());
    }
}

#[test]
fn a_value_is_written_whole_or_not_at_all() {
    for (endpoint, carrier) in CARRIERS {
        let bench = Bench::new();
        let _drive = drive(&bench, endpoint);
        let linmot = Linmot { bench: &bench, carrier };
        let flash = std::fs::read(bench.path("FLASH")).unwrap();
        for (value, shown) in [
            ("99999", "99999"),
            ("70000", "70000"),
            ("-3", "-3"),
            ("0x10000", "65536"),
            ("FFFFFFFDh", "4294967293"),
            ("4294967296", "4294967296"),
        ] {
            let words =
                format!("UPID 13A2h: {shown} is out of range, 0 to 65535 expected; nothing was written");
            for memory in [&[][..], &["--ram"], &["--rom"], &["--both"], &["--dry-run"]] {
                let set = [&["params", "set", "13A2h"], memory, &["--", value]].concat();
                let ran = linmot.run(&set).ends(4).says(&words);
                assert!(!ran.stdout().contains("would write"), "{}", ran.stdout());
            }
        }
        for (upid, value, range) in [
            ("13A0h", "-32001", "-32000 to 32000"),
            ("13A0h", "0x1FFFB", "-32000 to 32000"),
            ("3001h", "-101", "-100 to 100"),
            ("3001h", "0xFFFB", "-100 to 100"),
            ("3000h", "2147483648", "-2147483648 to 2147483647"),
            ("3002h", "-1", "0 to 4294967295"),
            ("20A1h", "2", "0 to 1"),
        ] {
            linmot.run(&["params", "set", upid, "--", value]).ends(4).says(&format!("{range} expected"));
        }
        for value in ["0x+5", "1e3", "12h4", "123456789h", "99999999999999999999"] {
            linmot.run(&["params", "set", "13A2h", "--", value]).ends(2).says("a number of 32 bits expected");
        }
        for (text, words) in [
            ("123456789012345678901234567890123", "up to 32 characters expected, 33 found"),
            ("\u{65E5}\u{672C}", "characters of Windows-1252 expected"),
        ] {
            linmot.run(&["params", "set", "03F2h", "--", text]).ends(2).says(words);
        }
        assert_eq!(std::fs::read(bench.path("FLASH")).unwrap(), flash, "{carrier:?}: something was written");

        // Numbers of signed types are numbers, in and out.
        for (upid, value) in [("13A0h", "-5"), ("13A0h", "0xFFFA"), ("13A0h", "FFFFFFF9h")] {
            linmot.run(&["params", "set", upid, "--", value]).ends(0);
        }
        linmot
            .run(&["params", "get", "13A0h"])
            .ends(0)
            .says("ROM -7 (0000FFF9h)  RAM -7")
            .says("minimum -32000,");
        let get = linmot.json(&["params", "get", "13A0h"]);
        let fields =
            ["ram", "rom", "minimum", "maximum", "default"].map(|key| get["parameters"][0][key].as_i64());
        assert_eq!(fields, [-7, -7, -32_000, 32_000, 0].map(Some));
        linmot.run(&["params", "set", "3002h", "--", "4294967295"]).ends(0).says("ROM 4294967295");
        linmot.run(&["params", "set", "3001h", "--", "-100"]).ends(0).says("ROM -100 (0000009Ch)");
        linmot
            .run(&["--dry-run", "params", "set", "3001h", "--", "0xFB"])
            .ends(0)
            .says("would write -5 to 3001h");
        linmot.run(&["params", "list", "--changed"]).ends(0).says("3001h  ROM -100 (0000009Ch)");
        // Characters that 8 bits have.
        linmot.run(&["params", "set", "03F2h", "--", "Achse für 1 €"]).ends(0).says("Achse für 1 €");
        linmot.run(&["params", "set", "03F2h", "--", ""]).ends(0).says("03F2h  \"\"");
    }
}

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
        bench.run(&["linmot", "curve", "add", "1", "C.csv", "--can", "slcan:NONE"]).ends(1).says(words);
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
        ("0 0\n", "1 points, at least 2 expected"),
    ] {
        std::fs::write(bench.path("P.csv"), content).unwrap();
        build(&["--points", "P.csv"]).ends(1).says(words);
    }
    build(&["--to", "50", "--length", "1s"]).ends(2).says("a number with its unit expected");
    build(&["--to", "50mm", "--length", "1mm"]).ends(2).says("--length: a time in ms or s");
    build(&["--to", "500m", "--length", "1s"]).ends(2).says("--to: -214748mm to 214748mm expected");
}

#[test]
fn a_drive_on_can_waits_for_its_node_id_and_is_guarded() {
    let bench = Bench::new();
    let sim = ["sim", "linmot", "--can=slcan-pty:LINE", "--node", "255", "--serial-number", "77"];
    let _drive = bench.device(&sim);
    let can = ["--can", "slcan:LINE"];
    let run = |arguments: &[&str]| bench.run(&[arguments, &can].concat());
    run(&["can", "lss", "set-node", "5"]).ends(0);
    run(&["can", "sdo", "read", "5", "0x1018:4", "--type", "u32"]).ends(0).says("77");
    run(&["can", "sdo", "read", "5", "0x1008", "--type", "string"]).ends(0).says("Virtual LinMot drive");
    run(&["can", "guard", "5", "--for", "0.3"]).ends(0).says("pre-operational");
    run(&["linmot", "params", "get", "13A2h", "--node", "5"]).ends(0).says("default 10");
}
