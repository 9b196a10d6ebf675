//! A virtual controller on a pseudo-terminal, and every command that talks to it.
#![cfg(unix)]

mod common;

use common::{Bench, edit};

#[test]
fn the_demo_goes_from_identification_to_the_target() {
    let bench = Bench::new();
    bench
        .run(&["demo", "--plot", "F.svg", "--record", "F.csv"])
        .ends(0)
        .says("20 of 20 values survived")
        .says("verified: [642] V max., Axis 1 = 3276800")
        .says("CAN 2: OK")
        .says("Nd01  1   1    0192h    SD03  00h")
        .says("actual position 1000000")
        .says("failures: none");
    let drawing = std::fs::read_to_string(bench.path("F.svg")).unwrap();
    assert!(drawing.starts_with("<svg") && drawing.contains("following error in units"));
    let drawn = bench.run(&["plot", "F.csv", "--from", "0.9", "-o", "G.svg", "--json"]).ends(0).json();
    assert!(drawn["samples"].as_u64().unwrap() > 400, "{drawn}");
    assert!(bench.path("G.svg").exists());
    bench.run(&["plot", "F.csv", "--axis", "2"]).ends(1).says("nothing of these axes");
    bench.run(&["plot", "missing.csv"]).ends(5).says("missing.csv");

    let json = bench.run(&["demo", "--json"]).ends(0).json();
    assert_eq!(
        (json["verified"].as_bool(), json["parameters"][9]["value"].as_i64()),
        (Some(true), Some(3_276_800))
    );
    let position = &json["position"];
    let late = position["seconds"].as_f64().unwrap() - position["analytic_seconds"].as_f64().unwrap();
    assert!(late.abs() <= position["cycle_seconds"].as_f64().unwrap(), "{position}");
    assert_eq!((position["actual"].as_i64(), position["at_target"].as_bool()), (Some(1_000_000), Some(true)));
    // The drive followed the speed set value.
    let velocity = json["jog"]["velocity"].as_i64().unwrap();
    assert!((65_000..66_000).contains(&velocity), "{velocity}");
    assert_eq!(json["bus"]["guard_requests"], json["bus"]["guard_replies"]);
}

#[test]
fn identify_backup_compare_set_restore() {
    let bench = Bench::new();
    let _controller = bench.controller(&["--model", "8231"]);
    let json = bench.run(&["lb2", "identify", "--port", "LINE", "--json"]).ends(0).json();
    assert_eq!((json["model"].as_i64(), json["axes"].as_i64()), (Some(8231), Some(6)));
    assert_eq!((json["os_version"].as_str(), json["custom_version"].as_str()), (Some("5.15"), Some("0.00")));

    let backup = bench.run(&["params", "backup", "--port", "LINE", "F.toml", "--json"]).ends(0).json();
    assert_eq!(backup["parameters"], 606);
    let compare = || bench.run(&["params", "compare", "--port", "LINE", "F.toml", "--json"]);
    assert_eq!(compare().ends(0).json()["equal"], 606);

    bench.run(&["params", "set", "--port", "LINE", "V max.@Axis 2", "5000"]).ends(0);
    let json = compare().ends(1).json();
    let different = json["different"].as_array().unwrap();
    assert_eq!((different.len(), different[0]["index"].as_i64()), (1, Some(643)));

    bench.run(&["params", "restore", "--port", "LINE", "F.toml", "--dry-run"]).ends(0).says("1 of 606");
    compare().ends(1);
    bench
        .run(&["params", "restore", "--port", "LINE", "F.toml"])
        .ends(0)
        .says("1 written, saved and verified");
    compare().ends(0);
    bench.run(&["params", "compare", "F.toml", "F.toml"]).ends(0).says("606 equal");
}

/// LB2 over CAN: a whole backup over an slcan adapter equals the one over a serial line.
#[test]
fn a_backup_over_can_equals_the_one_over_serial() {
    let bench = Bench::new();
    let controller = bench.controller(&[]);
    bench.run(&["params", "set", "--port", "LINE", "642", "1000", "756", "77", "--save"]).ends(0);
    bench.run(&["params", "backup", "--port", "LINE", "SERIAL.toml"]).ends(0);
    controller.kill();
    let _controller = bench.controller_on("slcan-pty:CAN", &[]);
    let port = "slcan:CAN?bitrate=500000";
    bench.run(&["params", "backup", "--port", port, "CAN.toml"]).ends(0);
    bench.run(&["params", "compare", "SERIAL.toml", "CAN.toml"]).ends(0).says("606 equal");
    bench.run(&["params", "set", "--port", port, "756", "78", "--save"]).ends(0);
    bench.run(&["params", "compare", "--port", port, "SERIAL.toml"]).ends(1).says("1 different");
}

/// `kill -9` between write and save loses what was written, and nothing that was saved.
#[test]
fn a_killed_controller_keeps_what_was_saved() {
    let bench = Bench::new();
    let controller = bench.controller(&[]);
    bench.run(&["params", "set", "--port", "LINE", "642", "1000", "--save"]).ends(0);
    bench.run(&["params", "set", "--port", "LINE", "642", "2000"]).ends(0);
    controller.kill();
    let controller = bench.controller(&[]);
    bench.run(&["params", "get", "--port", "LINE", "642"]).ends(0).says("V max., Axis 1: 1000 ");
    controller.kill();

    // Killed while it saves, at whatever byte that may be: the old or the new set, never a mixture.
    for round in 1..=5 {
        let controller = bench.controller(&[]);
        let value = (1000 + round).to_string();
        std::thread::scope(|scope| {
            let set = scope.spawn(|| {
                bench.run(&["params", "set", "--port", "LINE", "642", &value, "648", "0.5", "--save"])
            });
            // The file changes when the save begins.
            let flash = bench.path("FLASH");
            let before = std::fs::read(&flash).unwrap();
            while !set.is_finished() && std::fs::read(&flash).unwrap() == before {}
            controller.kill();
            set.join().unwrap();
        });
        let controller = bench.controller(&[]);
        let json = bench.run(&["params", "get", "--port", "LINE", "642", "648", "--json"]).ends(0).json();
        let v_max = json["parameters"][0]["value"].as_i64().unwrap();
        assert!((1000..=1000 + round).contains(&v_max), "{v_max}");
        controller.kill();
    }
}

#[test]
fn bad_values_and_names_leave_the_device_unchanged() {
    let bench = Bench::new();
    let _controller = bench.controller(&[]);
    bench.run(&["params", "backup", "--port", "LINE", "F.toml"]).ends(0);
    let set = |arguments: &[&str]| {
        let mut all = vec!["params", "set", "--port", "LINE"];
        all.extend(arguments);
        bench.run(&all)
    };
    set(&["642", "3276801"]).ends(2).says("3276801 is out of range, 0 to 3276800 expected");
    set(&["5", "7", "642", "-1"]).ends(2).says("-1 is out of range");
    set(&["654", "0.0005"]).ends(2).says("at most 3 digits");
    set(&["V mxa.", "1"]).ends(2).says("nearest: \"V max.\"");
    set(&["V max.", "1"]).ends(2).says("names 6 parameters").says("what stands behind its comma");
    set(&["[642] V max., Axis 2", "1"]).ends(2).says("no parameter is called");
    set(&["50", "1"]).ends(2).says("there is no parameter [050]");
    set(&["642"]).ends(2).says("a value is missing");
    set(&["103", "Incremental"]).ends(2).says("cannot be selected here");
    // What only the loader can see is put back.
    set(&["5", "7", "0", "2"])
        .ends(4)
        .says("Invalid number of actual value inputs")
        .says("old values were put back");
    bench.run(&["params", "compare", "--port", "LINE", "F.toml"]).ends(0);
}

#[test]
fn names_are_accepted_as_they_are_printed() {
    let bench = Bench::new();
    let _controller = bench.controller(&[]);
    let set = |key: &str, value: &str| bench.run(&["params", "set", "--port", "LINE", key, value]);
    set("V max., Axis 1", "1000").ends(0).says("[642] V max., Axis 1");
    set("[642] V max., Axis 1", "2000").ends(0).says("[642] V max., Axis 1");
    bench.run(&["params", "get", "--port", "LINE", "CAN Link, CAN 1"]).ends(0).says("CAN Link, CAN 1");
}

#[test]
fn bad_backups_are_refused_with_their_place() {
    let bench = Bench::new();
    let _controller = bench.controller(&["--model", "8236"]);
    bench.run(&["params", "backup", "--port", "LINE", "F.toml"]).ends(0);
    let restore = |file: &str| bench.run(&["params", "restore", "--port", "LINE", file]);
    let spoil = |name: &str, from: &str, to: &str| {
        std::fs::copy(bench.path("F.toml"), bench.path(name)).unwrap();
        edit(&bench.path(name), from, to);
    };
    spoil("model.toml", "model = 8236", "model = 8230");
    restore("model.toml").ends(1).says("is of a GEL 8230, the device is a GEL 8236").says("--force");
    bench.run(&["params", "restore", "--port", "LINE", "model.toml", "--force"]).ends(0);
    spoil("range.toml", "\"V max., Axis 1\", value = 0", "\"V max., Axis 1\", value = 9999999");
    restore("range.toml").ends(1).says("[642] V max., Axis 1: 9999999 is out of range");
    bench.run(&["params", "compare", "--port", "LINE", "range.toml"]).ends(1).says("1 out of range");
    spoil("syntax.toml", "value = 3, text", "value = , text");
    restore("syntax.toml").ends(5).says("syntax.toml, line 12, column ");
    spoil("text.toml", "\"3 AX/AI\"", "\"4 AX/AI\"");
    restore("text.toml").ends(5).says("line 12, column").says("choice 3 is \"3 AX/AI\", not \"4 AX/AI\"");
    std::fs::write(bench.path("empty.toml"), "").unwrap();
    restore("empty.toml").ends(5).says("not a parameter backup");
    restore("missing.toml").ends(5).says("missing.toml");
    bench
        .run(&["params", "restore", "--port", "LINE", "F.toml", "--only", "642", "vmax@2"])
        .ends(0)
        .says("2 parameters restored");
    bench.run(&["params", "compare", "--port", "LINE", "F.toml"]).ends(0);
}

#[test]
fn bad_ports_are_named() {
    let bench = Bench::new();
    let identify = |port: &str| bench.run(&["lb2", "identify", "--port", port, "--timeout", "0.05"]);
    identify("/dev/there-is-no-such-port").ends(5).says("no such port");
    std::fs::write(bench.path("file"), "").unwrap();
    identify("file").ends(5).says("not a serial port");
    identify("serial:file?parity=mark").ends(2).says("none, odd or even expected");
    identify("tcp:127.0.0.1:1").ends(5);
    bench.run(&["lb2", "identify"]).ends(2).says("no port");
    bench.run(&["lb2", "identify", "--port", "x", "--device", "32"]).ends(2);

    // Busy: somebody else has the port open and locked.
    let controller = bench.controller(&["--device", "3"]);
    let holder = std::fs::File::options().read(true).write(true).open(bench.path("LINE")).unwrap();
    holder.try_lock().unwrap();
    identify("LINE").ends(5).says("busy");
    drop(holder);
    identify("LINE").ends(0);

    // A device number that nobody has.
    bench
        .run(&["lb2", "identify", "--port", "LINE", "--device", "9", "--timeout", "0.05"])
        .ends(3)
        .says("device 9");
    bench
        .run(&["lb2", "identify", "--port", "LINE", "--device", "3", "--json"])
        .ends(0)
        .says("\"device_number\":3");
    controller.kill();
    identify("LINE").ends(5);
}

/// A line that is up with nobody behind it, as of a device that is off or in reset.
#[test]
fn a_silent_device_is_no_answer() {
    let bench = Bench::new();
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp:{}", listener.local_addr().unwrap());
    std::thread::scope(|scope| {
        let silent = scope.spawn(|| listener.accept().unwrap());
        bench
            .run(&["lb2", "identify", "--port", &port, "--timeout", "0.05"])
            .ends(3)
            .says("no answer to function 40h in 3 attempts");
        silent.join().unwrap();
    });
}

/// A device in reset sends the beginning of an answer, or nothing that makes sense.
#[test]
fn garbage_in_place_of_an_answer_is_named() {
    use std::io::{Read, Write};
    let bench = Bench::new();
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp:{}", listener.local_addr().unwrap());
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let (mut stream, _) = listener.accept().unwrap();
            let mut request = [0; 64];
            while stream.read(&mut request).is_ok_and(|len| len > 0) {
                stream.write_all(&[0x00, 0x82, 0x96, 0x05, 0x40]).unwrap();
            }
        });
        bench
            .run(&["lb2", "identify", "--port", &port, "--timeout", "0.05"])
            .ends(3)
            .says("damage on the line: cut short by silence");
    });
}

/// The plug is pulled in the middle of a backup: an older backup is still there.
#[test]
fn a_pulled_plug_is_port_trouble() {
    use std::io::{Read, Write};
    let bench = Bench::new();
    std::fs::write(bench.path("F.toml"), "the old backup").unwrap();
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp:{}", listener.local_addr().unwrap());
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let (mut stream, _) = listener.accept().unwrap();
            let mut request = [0; 64];
            for answer in [&[0x82, 0x96, 0x05, 0x40, 0x26, 0x20, 0x06, 0x45][..], &[0x82]] {
                let _ = stream.read(&mut request).unwrap();
                stream.write_all(answer).unwrap();
            }
        });
        bench.run(&["params", "backup", "--port", &port, "F.toml"]).ends(5).says("closed the connection");
    });
    assert_eq!(std::fs::read_to_string(bench.path("F.toml")).unwrap(), "the old backup");
}

#[test]
fn flash_ram_failures_and_raw() {
    let bench = Bench::new();
    let _controller = bench.controller(&[]);
    let image: Vec<u8> = (0..1001u32).map(|n| (n * 7) as u8).collect();
    std::fs::write(bench.path("in.bin"), &image).unwrap();
    let lb2 = |arguments: &[&str]| {
        let mut all = vec!["lb2"];
        all.extend(arguments);
        all.extend(["--port", "LINE"]);
        bench.run(&all)
    };
    lb2(&["write-flash", "--bank", "15", "in.bin"]).ends(2).says("--yes");
    lb2(&["write-flash", "--bank", "15", "in.bin", "--dry-run"]).ends(0).says("would write 1002 bytes");
    lb2(&["write-flash", "--bank", "15", "in.bin", "--yes"]).ends(0).says("written and verified");
    lb2(&["write-flash", "--bank", "15", "in.bin", "--yes"]).ends(4).says("flash write error");
    lb2(&["read-flash", "--bank", "15", "--count", "1001", "out.hex"]).ends(0);
    lb2(&["write-ram", "out.hex"]).ends(0);
    lb2(&["read-ram", "--count", "1001", "out.bin"]).ends(0);
    assert_eq!(std::fs::read(bench.path("out.bin")).unwrap(), image);
    lb2(&["erase-flash", "--bank", "15", "--yes"]).ends(0);
    lb2(&["erase-flash", "--bank", "12", "--yes"]).ends(2);
    lb2(&["read-flash", "--bank", "15", "--offset", "0FFF0h", "out.bin"]).ends(0);
    assert_eq!(std::fs::read(bench.path("out.bin")).unwrap(), [0xFF; 16]);

    lb2(&["failures"]).ends(0).says("no failure stored");
    lb2(&["raw", "40", "00"]).ends(4).says("number error");
    let failures = lb2(&["failures", "--json"]).ends(0).json();
    assert_eq!(failures["failures"][0]["failure"], 40);
    lb2(&["clear-failures"]).ends(0).says("1 failures deleted");
    lb2(&["raw", "CC", "30 05 00"]).ends(0).says("CC  30 05 00 00 00 00 00");
    lb2(&["raw", "XY"]).ends(2).says("pairs of hex digits");
}

#[test]
fn reset_goes_back_to_the_factory_defaults() {
    let bench = Bench::new();
    let _controller = bench.controller(&[]);
    bench.run(&["params", "set", "--port", "LINE", "642", "5", "--save"]).ends(0);
    let changed = bench.run(&["params", "list", "--port", "LINE", "--changed", "--json"]).ends(0).json();
    assert_eq!(changed["parameters"].as_array().unwrap().len(), 1);
    bench
        .run(&["params", "reset", "--port", "LINE", "--factory"])
        .ends(0)
        .says("1 written, saved and verified");
    bench.run(&["params", "reset", "--port", "LINE", "--image"]).ends(2).says("parameter image");
    bench.run(&["params", "reset", "--port", "LINE"]).ends(2);
    bench.run(&["params", "list"]).ends(0).says("Axes configuration/Axis 6/Ramps");
}

#[test]
fn endpoints_have_names_in_the_configuration() {
    let bench = Bench::new();
    let _controller = bench.controller(&[]);
    std::fs::write(bench.path("c.toml"), "port = \"press\"\n[endpoints]\npress = \"LINE\"\n").unwrap();
    bench.run(&["lb2", "identify", "--config", "c.toml"]).ends(0).says("GEL 8230");
    bench
        .run(&["lb2", "identify", "--config", "c.toml", "--port", "elsewhere"])
        .ends(5)
        .says("elsewhere: no such port");
}
