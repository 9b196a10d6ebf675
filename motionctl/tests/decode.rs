//! `motionctl decode`, line by line as its contract says.

#[allow(dead_code, reason = "shared with tests that need more of it")]
mod common;
#[path = "common/decode.rs"]
mod decode;

use common::Bench;
use decode::{has, objects};
use serde_json::{Value, json};

#[track_caller]
fn expect(objects: &[Value], expected: &[Value]) {
    for (object, members) in objects.iter().zip(expected) {
        assert!(has(object, members.clone()), "{object}\nlacks {members}");
    }
    assert_eq!(objects.len(), expected.len(), "{objects:#?}");
}

#[test]
fn frames_and_transfers_of_a_log() {
    let log = "(12.345678) can0 601#4041600000000000\n\
               (12.345999) can0 581#4B41600018028FAF\n\
               (12.400000) can0 000#8201\n\
               (12.500000) can0 701#00\n\
               (12.600000) can0 701#7F\n\
               (12.700000) can0 701#R\n\
               (12.800000) can0 701#85\n\
               (12.900000) can0 081#1081430102030405\n\
               (13.000000) can0 080#\n\
               (13.000100) can0 181#37060000\n\
               (13.100000) can0 1F334455#11\n\
               (13.200000) can0 20000004#0004000000000000\n\
               (13.300000) can0 601#4018100500000000\n\
               (13.400000) can0 581#8018100511000906\n\
               (13.500000) can0 601#4018100500000000\n";
    expect(
        &objects(log.as_bytes(), &[]),
        &[
            json!({ "t": 12.345678, "bus": "can0", "id": 0x601, "ext": false, "rtr": false, "data": "4041600000000000",
                    "node": 1, "kind": "sdo-request", "index": 0x6041, "subindex": 0 }),
            json!({ "t": 12.345999, "id": 1409, "data": "4B41600018028FAF", "node": 1, "kind": "sdo-response" }),
            json!({ "kind": "sdo-transfer", "node": 1, "direction": "upload", "mode": "expedited", "index": 24641,
                    "subindex": 0, "size": 2, "data": "1802", "outcome": "done", "abort_code": null, "frames": 2,
                    "t": 12.345999 }),
            json!({ "kind": "nmt", "command": "reset-communication", "node": 1 }),
            json!({ "kind": "boot-up", "node": 1, "state": "boot-up" }),
            json!({ "kind": "heartbeat", "node": 1, "state": "pre-operational" }),
            json!({ "kind": "guard-request", "node": 1, "rtr": true, "data": "" }),
            json!({ "kind": "guard-reply", "node": 1, "state": "operational", "toggle": 1 }),
            json!({ "kind": "emcy", "node": 1, "code": 0x8110, "register": 0x43, "data": "1081430102030405" }),
            json!({ "kind": "sync", "data": "" }),
            json!({ "kind": "pdo", "node": 1 }),
            json!({ "kind": "unknown", "ext": true, "id": 0x1F33_4455 }),
            json!({ "kind": "error-frame", "id": 4 }),
            json!({ "kind": "sdo-request" }),
            json!({ "kind": "sdo-abort", "node": 1, "index": 0x1018, "subindex": 5, "code": 0x0609_0011 }),
            json!({ "kind": "sdo-transfer", "outcome": "aborted", "abort_code": 0x0609_0011, "size": 0, "data": "" }),
            json!({ "kind": "sdo-request" }),
            json!({ "kind": "sdo-transfer", "outcome": "incomplete", "abort_code": null, "frames": 1, "t": 13.5 }),
            json!({ "kind": "summary", "frames": 15, "discarded_bytes": 0, "by_kind": {
                "nmt": 1, "sync": 1, "emcy": 1, "pdo": 1, "sdo-request": 3, "sdo-response": 1, "sdo-abort": 1,
                "guard-request": 1, "guard-reply": 1, "heartbeat": 1, "boot-up": 1, "error-frame": 1, "unknown": 1 } }),
        ],
    );
}

#[test]
fn a_screen_dump_has_no_times_and_its_direction_is_no_bus() {
    expect(
        &objects(b"  RX 701   [1]  7F\n  TX 101   [1]  AA\n", &["--can-link"]),
        &[
            json!({ "t": null, "bus": null, "dir": "RX", "kind": "heartbeat" }),
            json!({ "t": null, "bus": null, "dir": "TX", "kind": "can-link", "channel": 1 }),
            json!({ "kind": "summary", "frames": 2 }),
        ],
    );
    let without = objects(b"TX 101   [1]  AA\n", &[]);
    assert_eq!(without[0]["kind"], "unknown");
}

/// Every line that concerns a channel of CAN Link names it.
#[test]
fn channels_of_can_link_have_their_names() {
    let bench = Bench::new();
    let values = (0..8).map(|n| format!("({n}.000000) can0 103#E20{n}\n"));
    let log: String =
        values.chain(["(9.000000) can0 10E#\n".into(), "(9.100000) can0 10F#01\n".into()]).collect();
    std::fs::write(bench.path("log"), log).unwrap();
    let text = bench.run(&["decode", "log", "--can-link", "--frames"]).ends(0).stdout();
    for words in [
        "103 Data [2] E2 00  can-link channel 3\n",
        "CAN Link  channel 3 begins: E2 00\n",
        "CAN Link  channel 3: E2 03\n",
        "CAN Link  channel 3: E2 04 (and so on)\n",
        "CAN Link  channel 14 begins: nothing\n",
        "bus       identifier of no known service: 10F Data [1] 01\n",
        "  CAN Link channel 3: 8 times, every 1000.0 ms, 7 changes\n",
    ] {
        assert!(text.contains(words), "{words:?} expected in:\n{text}");
    }
    assert!(!text.contains("channel 3: E2 05\n") && !text.contains("identifier 103h"), "{text}");
}

#[test]
fn pdo_values_by_a_mapping_from_the_traffic() {
    let log = "can0 601#23001A0110006460\ncan0 581#60001A0100000000\ncan0 181#FEFF\n";
    let objects = objects(log.as_bytes(), &[]);
    assert_eq!(objects[3]["mapped"], json!([{ "index": 0x6064, "subindex": 0, "bits": 16, "value": -2 }]));
}

#[test]
fn an_eds_names_objects_and_maps_pdos() {
    let bench = Bench::new();
    let eds = "[FileInfo]\nFileName=a.eds\n[DeviceInfo]\nVendorName=x\n\
               [MandatoryObjects]\nSupportedObjects=0\n[OptionalObjects]\nSupportedObjects=2\n1=0x1800\n2=0x1A00\n\
               [ManufacturerObjects]\nSupportedObjects=1\n1=0x2000\n\
               [2000]\nParameterName=Torque constant\nObjectType=0x7\nDataType=0x0003\nAccessType=rw\nPDOMapping=1\n\
               [1800]\nParameterName=TPDO\nObjectType=0x9\nSubNumber=2\n\
               [1800sub0]\nParameterName=n\nObjectType=0x7\nDataType=0x0005\nAccessType=ro\nDefaultValue=1\nPDOMapping=0\n\
               [1800sub1]\nParameterName=id\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\nDefaultValue=$NODEID+0x150\nPDOMapping=0\n\
               [1A00]\nParameterName=map\nObjectType=0x9\nSubNumber=2\n\
               [1A00sub0]\nParameterName=n\nObjectType=0x7\nDataType=0x0005\nAccessType=rw\nDefaultValue=1\nPDOMapping=0\n\
               [1A00sub1]\nParameterName=1\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\nDefaultValue=0x20000010\nPDOMapping=0\n";
    std::fs::write(bench.path("a.eds"), eds).unwrap();
    std::fs::write(
        bench.path("log"),
        "can0 155#FEFF\ncan0 605#4000200000000000\ncan0 585#4B00200001000000\n",
    )
    .unwrap();
    let ran = bench.run(&["--json", "decode", "log", "--eds", "5=a.eds"]).0;
    let text = String::from_utf8(ran.stdout).unwrap();
    let objects: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    expect(
        &objects,
        &[
            json!({ "kind": "pdo", "node": 5, "pdo": 1,
                    "mapped": [{ "index": 0x2000, "subindex": 0, "bits": 16, "value": -2 }] }),
            json!({ "kind": "sdo-request" }),
            json!({ "kind": "sdo-response" }),
            json!({ "kind": "sdo-transfer", "name": "Torque constant", "value": 1 }),
            json!({ "kind": "summary" }),
        ],
    );
    let refused = bench.run(&["decode", "log", "--eds", "200=a.eds"]).0;
    assert_eq!(refused.status.code(), Some(2));
}

#[test]
fn lb2_telegrams_with_their_fields_and_every_byte_between() {
    // Read [005]; its answer; a damaged telegram; a write in hex text with a time.
    let text = "0.5 82 96 05 CC 30 05 00 FC\n\
                82 96 09 CC 30 05 00 07 00 00 00 F7\n\
                11 82 96 02 40 43\n\
                82 96 03 FF 04 F8\n";
    expect(
        &objects(text.as_bytes(), &[]),
        &[
            json!({ "t": 0.5, "kind": "lb2", "offset": 0, "direction": "request", "function": 204, "sub": 48,
                    "name": "read parameter, simple", "fields": { "index": 5 }, "raw": "829605CC300500FC" }),
            json!({ "t": null, "kind": "lb2", "offset": 8, "direction": "reply",
                    "fields": { "index": 5, "value": 7 } }),
            json!({ "kind": "lb2-error", "offset": 20, "length": 1 }),
            json!({ "kind": "lb2-error", "offset": 21, "length": 5, "reason": "check byte" }),
            json!({ "kind": "lb2", "offset": 26, "direction": "reply", "fields": { "error_code": 4 } }),
            json!({ "kind": "summary", "frames": 3, "discarded_bytes": 6, "by_kind": { "lb2": 3 } }),
        ],
    );
}

#[test]
fn a_telegram_that_could_be_either_is_told_by_what_came_before() {
    let select = [0x82, 0x96, 0x03, 0x00, 0x02, 0x01];
    let save = [0x82, 0x96, 0x03, 0xCC, 0x35, 0xFA];
    let identify = [0x82, 0x96, 0x02, 0x40, 0x42];
    let identified = [0x82, 0x96, 0x05, 0x40, 0x26, 0x20, 0x06, 0x45];
    let directions = |telegrams: &[&[u8]]| -> Vec<String> {
        objects(&telegrams.concat(), &[])
            .iter()
            .filter(|object| object["kind"] == "lb2")
            .map(|object| object["direction"].as_str().unwrap().to_owned())
            .collect()
    };
    assert_eq!(directions(&[&select, &select]), ["unknown", "unknown"]);
    assert_eq!(
        directions(&[&identify, &identified, &select, &select, &save, &save]),
        ["request", "reply", "request", "reply", "request", "reply"]
    );
    // A request that nobody answered, then another one.
    assert_eq!(directions(&[&identify, &save, &save]), ["request", "request", "reply"]);
    // What was lost may have been the answer.
    assert_eq!(
        directions(&[&identify, &identified, &select, &[0x55], &select]),
        ["request", "reply", "request", "unknown"]
    );
}

#[test]
fn raw_bytes_from_standard_input_and_broken_files() {
    let bench = Bench::new();
    std::fs::write(bench.path("raw"), [0x00, 0x82, 0x96, 0x02, 0x40, 0x42, 0x82, 0x96]).unwrap();
    let input = std::fs::File::open(bench.path("raw")).unwrap();
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_motionctl"))
        .args(["--json", "decode", "-"])
        .stdin(input)
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let last: Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
    assert!(has(&last, json!({ "frames": 1, "discarded_bytes": 3 })), "{text}");

    assert_eq!(bench.run(&["decode", "nowhere"]).0.status.code(), Some(5));
    std::fs::write(bench.path("letter"), "Dear reader,\n").unwrap();
    assert_eq!(bench.run(&["decode", "letter"]).0.status.code(), Some(5));
    std::fs::write(bench.path("log"), "can0 701#05\nnonsense\n").unwrap();
    let ran = bench.run(&["--json", "decode", "log"]).0;
    assert_eq!(
        String::from_utf8_lossy(&ran.stderr).lines().next().unwrap().split(": ").nth(1),
        Some("line 2")
    );
    assert!(String::from_utf8_lossy(&ran.stdout).contains("\"damaged\":1"));
}

/// The README shows what the command really says.
#[test]
fn the_readme_shows_a_real_story() {
    let log = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/bring-up.log");
    let readme = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../README.md")).unwrap();
    let story = String::from_utf8(Bench::new().run(&["decode", log]).0.stdout).unwrap();
    assert!(readme.contains(&story), "README.md lacks:\n{story}");
}

/// Packets of link type 113 in a pcap file, microseconds apart.
fn cooked(packets: &[(u8, u32, &[u8])]) -> Vec<u8> {
    let mut file = Vec::from([
        0xD4, 0xC3, 0xB2, 0xA1, 2, 0, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF, 0, 0, 113, 0, 0, 0,
    ]);
    for (at, (kind, id, data)) in (0_u32..).zip(packets) {
        let mut packet = vec![0, *kind, 0x01, 0x18, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x0C];
        packet.extend(id.to_be_bytes());
        packet.extend([data.len() as u8, 0, 0, 0]);
        packet.extend(*data);
        let len = packet.len() as u32;
        file.extend([1, at, len, len].iter().flat_map(|word| word.to_le_bytes()));
        file.extend(packet);
    }
    file
}

#[test]
fn loop_back_copies_are_counted_apart() {
    let file =
        cooked(&[(4, 0x181, &[1]), (1, 0x181, &[1]), (1, 0x701, &[5]), (4, 0x181, &[2]), (1, 0x181, &[2])]);
    let bench = Bench::new();
    std::fs::write(bench.path("sent.pcap"), &file).unwrap();
    let text = bench.run(&["decode", "sent.pcap"]).ends(0).stdout();
    assert_eq!(text.lines().last(), Some("3 frames: 2 pdo, 1 heartbeat; 2 loop-back copies"), "{text}");
    assert!(text.contains("node 1 TPDO 1: 2 times"), "{text}");
    // Every object counts where every frame gives one.
    let objects = objects(&file, &[]);
    let last = objects.last().unwrap();
    assert!(
        has(last, json!({ "frames": 5, "loopback": 2, "by_kind": { "pdo": 4, "heartbeat": 1 } })),
        "{last}"
    );
}

/// The first one that cannot be read was the end of all.
#[test]
fn what_cannot_be_read_keeps_no_other_capture_from_being_decoded() {
    let bench = Bench::new();
    std::fs::write(bench.path("log"), "can0 701#05\n").unwrap();
    std::fs::write(bench.path("letter"), "Dear reader,\n").unwrap();
    let files = ["decode", "missing", "log", "letter", "log"];
    let ran = bench
        .run(&[&files[..], &["--json"]].concat())
        .ends(5)
        .says("missing")
        .says("letter: no known capture");
    let kinds: Vec<Value> = ran.stdout().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    expect(
        &kinds,
        &[
            json!({ "kind": "heartbeat" }),
            json!({ "kind": "heartbeat" }),
            json!({ "kind": "summary", "frames": 2 }),
        ],
    );
    let ran = bench.run(&files).ends(5).says("missing").says("letter: no known capture");
    assert!(ran.stdout().ends_with("\n2 frames: 2 heartbeat\n"), "{}", ran.stdout());
}

/// A file of another format than it was taken for is not one without traffic.
#[test]
fn a_capture_without_a_frame_is_trouble_with_a_file() {
    let bench = Bench::new();
    std::fs::write(bench.path("log"), "(1.0) can0 705#05\n").unwrap();
    std::fs::write(bench.path("empty"), "").unwrap();
    for format in ["asc", "trc", "pcap", "lb2", "lb2-hex"] {
        bench
            .run(&["decode", "--format", format, "log"])
            .ends(5)
            .says("log: a capture expected, not one frame");
        bench.run(&["--json", "decode", "--format", format, "log", "log"]).ends(5);
    }
    bench.run(&["decode", "--format", "candump", "log"]).ends(0);
    bench.run(&["decode", "--format", "candump", "empty"]).ends(0).says("0 frames");
    bench.run(&["decode", "--eds", "5=a.eds", "--eds", "5=b.eds", "log"]).ends(5);
}

/// A bus that is listened to through a pipe.
#[test]
fn what_comes_through_a_pipe_is_told_at_once() {
    use std::io::{BufRead as _, BufReader, Write as _};
    use std::process::Stdio;
    for (how, told) in [("--json", "\"kind\":\"heartbeat\""), ("--quiet", "is operational")] {
        let bench = Bench::new();
        // Without a given format the first 64 KiB are waited for, to recognise it.
        let mut command = bench.command(&[how, "decode", "--format", "candump", "-"]);
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let mut input = child.stdin.take().unwrap();
        input.write_all(b"(1.0) can0 705#05\n").unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let line = lines.next().unwrap().unwrap();
        assert!(line.contains(told), "{line}");
        drop(input);
        assert!(child.wait().unwrap().success());
    }
}
