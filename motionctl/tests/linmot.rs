//! A virtual LinMot drive on pseudo-terminals, and every command that talks to it, over each carrier.
#![cfg(unix)]

mod common;
#[path = "common/linmot.rs"]
mod linmot;

use common::{Bench, edit};
use linmot::{CARRIERS, CURVE, Linmot, drive, entry};

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
        let picture = std::fs::read_to_string(bench.path("D.svg")).unwrap();
        for words in ["<svg ", "curve 23 Example_Curve", "position in mm", "time in ms"] {
            assert!(picture.contains(words), "{words}");
        }
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
        linmot.run(&["params", "set", "2136h", "--rom", "--", "1"]).ends(4).says(
            "address usage error: its ROM value cannot be written; what can be done with it: RAM read, not in hash",
        );
        linmot.run(&["params", "set", "119Eh", "--both", "--", "1"]).ends(4).says(
            "its RAM or its ROM value cannot be written; what can be done with it: RAM read, ROM read, ROM write",
        );
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
        linmot
            .run(&["curve", "modify", "5", "C.csv"])
            .ends(4)
            .says("nothing was written: curve 5: start modifying curve (RAM): the drive answered D1h, size error")
            .says(": 9 setpoints in the file, 10 setpoints in the drive's curve");
        linmot.run(&["curve", "add", "101", "C.csv"]).ends(2).says("1 to 100 expected");
        linmot.run(&["table", "get", "9"]).ends(4).says("no such entry");
        // D4h has a meaning for each kind of command.
        let delete = linmot.run(&["table", "delete", "200"]).ends(4);
        assert_eq!(
            delete.stderr(),
            "error: entry 200: command table: delete entry: the drive answered D4h, invalid entry number: no \
             such entry\n"
        );
        linmot.run(&["table", "set", "9", "--raw", "00"]).ends(2).says("64 expected");
        let swapped = entry(10, "x").replacen("01A7", "A701", 1);
        linmot
            .run(&["table", "set", "9", "--raw", &swapped])
            .ends(2)
            .says("A701 at the beginning, 01A7 (version A701h) expected");
        linmot.run(&["table", "set", "9", "--raw", &entry(10, "x")]).ends(0);
        linmot.run(&["table", "check"]).ends(1).says("entry 9 is linked to entry 10, which does not exist");

        // Files that do not fit the drive: nothing is written.
        linmot.run(&["pvl", "backup", "B.pvl"]).ends(0);
        for (from, to, status, words) in [
            ("@TreeID 4612", "@TreeID 4613", 1, "layer mc: tree ID 4613 in the file, 4612 in the drive"),
            (
                "@SubVersion 5",
                "@SubVersion 6",
                1,
                "layer interface: sub version 6 in the file, 5 in the drive",
            ),
            ("13A2h, ", "13B2h, ", 1, "UPID 13B2h is unknown to the drive"),
            ("119Eh, ", "1B62h, ", 1, "UPID 1B62h is read-only in the drive"),
            ("119Eh, 0000", "119Eh, 000x", 5, "a hex number of up to 8 digits expected"),
        ] {
            std::fs::copy(bench.path("B.pvl"), bench.path("X.pvl")).unwrap();
            edit(&bench.path("X.pvl"), from, to);
            linmot.run(&["--yes", "pvl", "restore", "X.pvl"]).ends(status).says(words);
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
        linmot.run(&["params", "set", "03F2h", "--", ""]).ends(0).says("03F2h  ROM \"\"  RAM ");
    }
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

/// A string is held by its stringlets: what may be done with them may be done with it, and each memory has its own.
#[test]
fn a_string_has_an_access_and_two_memories() {
    let bench = Bench::new();
    let _drive = drive(&bench, "--can=slcan-pty:LINE");
    let linmot = Linmot { bench: &bench, carrier: &["--can", "slcan:LINE"] };
    linmot.run(&["params", "set", "03E8h", "--", "New"]).ends(0);
    let get = ["params", "get", "03E8h"];
    let with = |memory| linmot.run(&[&get[..], &[memory]].concat()).ends(0).stdout();
    let access = "RAM read, ROM read, ROM write\n";
    assert_eq!(with("--both"), format!("03E8h  ROM \"New\"  RAM \"MyController\"  {access}"));
    assert_eq!(with("--ram"), format!("03E8h  RAM \"MyController\"  {access}"));
    assert_eq!(with("--rom"), format!("03E8h  ROM \"New\"  {access}"));
    let json = &linmot.json(&get)["parameters"][0];
    let fields = ["text", "rom", "ram", "access"].map(|key| json[key].as_str().unwrap());
    assert_eq!(fields, ["New", "New", "MyController", access.trim()]);
    assert_eq!((json["usage"].as_u64(), json["live"].as_bool()), (Some(0x000D), Some(false)));
    // What was not asked for is not shown.
    let rom = linmot.run(&["params", "get", "13A2h", "--rom"]).ends(0);
    assert!(rom.stdout().starts_with("13A2h  ROM 10 (0000000Ah)  RAM read, "), "{}", rom.stdout());
}

/// UPID 2080h says what the frames have, and what they will have after the next restart.
#[test]
fn the_checksum_of_linrs_is_a_parameter() {
    let bench = Bench::new();
    let linmot = |checksum| {
        let carrier = ["--port", "LINE", "--timeout", "0.5", "--checksum", checksum];
        let bench = &bench;
        move |arguments: &[&str]| Linmot { bench, carrier: &carrier }.run(arguments)
    };
    let sim = ["sim", "linmot", "--serial=pty:LINE", "--state", "FLASH"];
    let drive = bench.device(&[&sim[..], &["--checksum", "crc"]].concat());
    linmot("crc")(&["params", "get", "2080h"]).ends(0).says("2080h  ROM 2 (00000002h)  RAM 2");
    linmot("none")(&["params", "get", "2080h"]).ends(3).says(
        "has another ID, baud rate or checksum; --node, baud=… of the endpoint and --checksum are to be",
    );
    linmot("crc")(&["params", "set", "2080h", "--", "1"]).ends(0).says("ROM 1 (00000001h)  RAM 2");
    linmot("crc")(&["restart"]).ends(0);
    linmot("sum")(&["restart", "--wait"]).ends(0);
    linmot("sum")(&["params", "get", "2080h"]).ends(0).says("RAM 1");
    drive.kill();
    let _drive = bench.device(&sim);
    linmot("sum")(&["params", "get", "2080h"]).ends(0).says("RAM 1");
}

/// A drive that is away already is waited for too, and the restart that was asked for comes after.
#[test]
fn a_restart_is_waited_for_while_another_goes_on() {
    for (endpoint, carrier) in CARRIERS {
        let bench = Bench::new();
        let _drive = drive(&bench, endpoint);
        let linmot = Linmot { bench: &bench, carrier };
        linmot.run(&["restart"]).ends(0).says("restarting");
        linmot.run(&["restart", "--wait"]).ends(0).says("restarted, the drive answers");
    }
}

#[test]
fn the_endpoint_may_come_from_the_environment_or_the_configuration() {
    let bench = Bench::new();
    let _drive = drive(&bench, "--can=slcan-pty:LINE");
    let get = ["linmot", "params", "get", "13A2h"];
    let with = |name: &str, value: &str| {
        let mut command = bench.command(&get);
        common::Ran(command.env(name, value).output().unwrap())
    };
    with("MOTIONCTL_CAN", "slcan:LINE").ends(0).says("default 10");
    // The command line comes first.
    let mut command = bench.command(&[&get[..], &["--can", "slcan:LINE"]].concat());
    common::Ran(command.env("MOTIONCTL_CAN", "slcan:NONE").output().unwrap()).ends(0);
    std::fs::write(bench.path("N.toml"), "can = \"machine\"\n[endpoints]\nmachine = \"slcan:LINE\"\n")
        .unwrap();
    with("MOTIONCTL_CONFIG", "N.toml").ends(0).says("default 10");
    bench.run(&[&get[..], &["--config", "N.toml", "--can", "machine"]].concat()).ends(0);
    bench.run(&get).ends(2).says("no drive: --can EP, --port EP, MOTIONCTL_CAN, MOTIONCTL_PORT");
    bench.run(&[&get[..], &["--config", "none.toml"]].concat()).ends(5).says("none.toml");
}

/// A name means the same to the virtual device as to its client.
#[test]
fn virtual_devices_know_the_names_of_the_configuration() {
    let bench = Bench::new();
    let endpoints = "[endpoints]\nbus = \"slcan-pty:BUS\"\nline = \"pty:LINE\"\ngel = \"pty:GEL\"\n";
    std::fs::write(bench.path("S.toml"), endpoints).unwrap();
    let sim = |arguments: &[&str]| bench.device(&[&["--config", "S.toml", "sim"], arguments].concat());
    let _devices = [
        sim(&["linmot", "--can", "bus"]),
        sim(&["linmot", "--serial", "line"]),
        sim(&["controller", "--serial", "gel"]),
    ];
    bench.run(&["linmot", "params", "get", "13A2h", "--can", "slcan:BUS"]).ends(0).says("default 10");
    bench.run(&["linmot", "params", "get", "13A2h", "--port", "LINE"]).ends(0).says("default 10");
    bench.run(&["lb2", "identify", "--port", "GEL"]).ends(0);
    bench.run(&["--config", "S.toml", "sim", "linmot", "--can", "other"]).ends(2).says("other");
}

#[test]
fn a_dry_run_of_reading_a_curve_touches_nothing() {
    let bench = Bench::new();
    for command in ["get", "plot"] {
        let arguments = ["--dry-run", "linmot", "curve", command, "23", "-o", "D", "--can", "slcan:NONE"];
        bench.run(&arguments).ends(0).says("would read curve 23 and write it to D");
        bench.run(&["linmot", "curve", command, "101", "-o", "D"]).ends(2).says("1 to 100 expected");
    }
    assert!(!bench.path("D").exists());
}

/// The plan is the result of a dry run: text, or one document, and nothing is opened or written for it.
#[test]
fn a_dry_run_says_its_plan_in_words_or_as_json() {
    let bench = Bench::new();
    let _drive = drive(&bench, "--can=slcan-pty:LINE");
    let linmot = Linmot { bench: &bench, carrier: &["--can", "slcan:LINE"] };
    std::fs::write(bench.path("C.csv"), CURVE).unwrap();
    let entry = entry(0xFFFF, "x");
    for (arguments, plan) in [
        (&["params", "set", "13A2h", "--", "77"][..], "would write 77 to 13A2h in RAM and ROM"),
        (
            &["params", "defaults", "--layer", "os", "mc"],
            "would set the ROM values of os, mc to their defaults",
        ),
        (&["curve", "add", "5", "C.csv"], "would write   5  Example_Curve          10 setpoints, 200 ms"),
        (&["curve", "get", "5", "-o", "D.csv"], "would read curve 5 and write it to D.csv"),
        (&["curve", "save"], "would save all curves to flash"),
        (&["curve", "delete-all"], "would delete all curves in RAM"),
        (&["table", "set", "5", "--raw", &entry], "would write entry 5 in RAM"),
        (&["table", "delete", "5"], "would delete entry 5 in RAM"),
        (&["table", "delete-all"], "would delete all entries in RAM"),
        (&["table", "save"], "would save the command table to flash"),
        (&["table", "backup", "T.toml"], "would write 0 entries to T.toml"),
        (&["pvl", "backup", "B.pvl"], "would write ROM values and curves to B.pvl"),
        (&["restart"], "would restart the drive"),
    ] {
        let words = linmot.run(&[&["--dry-run"], arguments].concat()).ends(0);
        assert_eq!(words.stdout(), format!("{plan}\n"), "{arguments:?}");
        let json = linmot.json(&[&["--dry-run"], arguments].concat());
        assert_eq!((json["dry_run"].as_bool(), json["plan"].as_str()), (Some(true), Some(plan)));
    }
    let build =
        ["--dry-run", "--json", "linmot", "curve", "build", "-o", "D.csv", "--to", "1mm", "--length", "1s"];
    assert_eq!(bench.run(&build).ends(0).json()["dry_run"], true);
    for file in ["B.pvl", "D.csv", "T.toml"] {
        assert!(!bench.path(file).exists(), "{file}");
    }
    linmot.run(&["params", "list", "--changed"]).ends(0).says("none changed");
}

/// What the command line cannot mean is refused before anything is opened, in the user's words.
#[test]
fn wrong_usage_is_named() {
    let bench = Bench::new();
    let run = |arguments: &[&str]| bench.run(arguments);
    let get = ["linmot", "params", "get", "13A2h"];
    let with = |more: &[&str]| run(&[&get[..], more].concat());
    with(&["--port", "LINE", "--carrier", "pdo"]).ends(2).says("cannot be used with '--carrier <CARRIER>'");
    with(&["--can", "slcan:LINE", "--checksum", "crc"]).ends(2).says("cannot be used with");
    with(&["--can", "slcan:LINE", "--port", "LINE"]).ends(2).says("cannot be used with");
    with(&["--can", "slcan:LINE", "--node", "128"]).ends(2).says("1 to 127 expected");
    with(&["--can", "slcan:LINE", "--timeout", "0"]).ends(2).says("seconds above 0 expected");
    // The endpoint as it was written, not the part of it that failed.
    with(&["--can", "slcan:NONE"]).ends(5).says("error: slcan:NONE").says("no such port");
    run(&["sim", "linmot"]).ends(2).says("--can EP or --serial EP expected");
    for dry_run in [&[][..], &["--dry-run"]] {
        let none = ["sim", "linmot", "--can", "slcan-pty:LINE", "--node", "0"];
        run(&[dry_run, &none].concat()).ends(2).says("--node 0: 1 to 127, or 255");
    }
    let many = ["sim", "linmot", "--can", "slcan-pty:LINE", "--parameters", "20000"];
    run(&many).ends(2).says("--parameters 20000: up to 8229 expected");
    run(&["sim", "linmot", "--can", "slcan-pty:none/X"])
        .ends(5)
        .says("error: slcan-pty:none/X: the directory of the link does not exist");
    let build = ["linmot", "curve", "build", "--to", "1mm", "--length", "1s", "-o", "none/C.csv"];
    let ran = run(&build).ends(5);
    assert_eq!(ran.stderr(), "error: none/C.csv: No such file or directory (os error 2)\n");
}

#[test]
fn a_damaged_state_file_is_told_in_words() {
    let bench = Bench::new();
    for (content, words) in [
        (&b"no image"[..], "it does not begin with VLM1"),
        (b"VLM1\x01", "its length is no multiple of 4 bytes"),
        (b"VLM1\x01\0\0\0", "it is cut off"),
        (b"VLM1\x01\0\0\0\0\0\x01\0\0\0\0\0", "a UPID, curve or entry number is above 65535"),
    ] {
        std::fs::write(bench.path("FLASH"), content).unwrap();
        let sim = ["sim", "linmot", "--can=slcan-pty:LINE", "--state", "FLASH"];
        let words = format!("error: FLASH: no image of a virtual LinMot drive's memory: {words}\n");
        assert_eq!(bench.run(&sim).ends(5).stderr(), words);
    }
}

/// ROM without RAM, and RAM without flash.
#[test]
fn what_does_not_act_yet_or_does_not_last_is_said() {
    let bench = Bench::new();
    let _drive = drive(&bench, "--can=slcan-pty:LINE");
    let linmot = Linmot { bench: &bench, carrier: &["--can", "slcan:LINE"] };
    linmot.run(&["pvl", "backup", "B.pvl"]).ends(0);
    let restart = "after a restart";
    linmot
        .run(&["params", "set", "119Eh", "--", "5"])
        .ends(0)
        .says(&format!("note: the ROM value acts {restart}"));
    let live = linmot.run(&["params", "set", "13A2h", "--", "10"]).ends(0);
    assert!(!live.stderr().contains(restart), "{}", live.stderr());
    let restore = ["--yes", "pvl", "restore", "B.pvl"];
    linmot.run(&restore).ends(0).says(&format!("note: the ROM values act {restart}"));
    let nothing = linmot.run(&restore).ends(0);
    assert!(!nothing.stderr().contains(restart), "{}", nothing.stderr());
    linmot
        .run(&["table", "set", "5", "--raw", &entry(0xFFFF, "x")])
        .ends(0)
        .says("note: entry 5 is in RAM, ");
    linmot.run(&["table", "delete", "5"]).ends(0).says("entry 5 deleted in RAM");
}
