//! `motionctl decode`, line by line as its contract says.

#[allow(dead_code, reason = "shared with tests that need more of it")]
mod common;

use common::Bench;
use serde_json::{Value, json};

/// The objects that a capture gives.
fn objects(content: &[u8], more: &[&str]) -> Vec<Value> {
    let bench = Bench::new();
    std::fs::write(bench.path("capture"), content).unwrap();
    let mut arguments = vec!["--json", "decode", "capture"];
    arguments.extend(more);
    let ran = bench.run(&arguments).0;
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let text = String::from_utf8(ran.stdout).unwrap();
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}")))
        .collect()
}

/// Whether an object has these members.
fn has(object: &Value, members: Value) -> bool {
    members.as_object().unwrap().iter().all(|(key, value)| object.get(key) == Some(value))
}

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

/// Of every report a class was told, which only SocketCAN has, and that as a number.
#[test]
fn error_reports_are_told_as_their_capture_means_them() {
    let told = |log: &str, words: &str| {
        let told = story(log, &[]);
        assert!(told.contains(&format!("bus       {words}\n")), "{told}");
    };
    told(
        "(0.1) can0 20000204#0004000000006000\n",
        "error report: controller: receive error warning; error counters: transmit 96, receive 0",
    );
    told(
        "base hex  timestamps absolute\n 2.5 1 ErrorFrame ECC: 10100010\n",
        "error frame of the bus: stuff error while receiving at bits 28 to 21 of the identifier (ECC 10100010)",
    );
    told("base hex  timestamps absolute\n 2.5 1 ErrorFrame\n", "error frame of the bus");
    told(
        ";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,I,d,R,l,D\n 1 1060.1 ER 2 - Rx - 5  04 00 02 00 00\n",
        "error frame of the bus: stuff error while sending at bits 28 to 21 of the identifier; \
         error counters: transmit 0, receive 0",
    );
    told(
        ";$FILEVERSION=1.3\n 1) 1060.1 1 Error 0008 - 4  01 19 08 00\n",
        "error frame of the bus: other error while receiving at the acknowledge slot; \
         error counters: transmit 0, receive 8",
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

#[test]
fn the_story_tells_each_thing_once() {
    let mut log = String::from(
        "(1.0) can0 000#8101\n(1.1) can0 701#00\n(1.2) can0 601#2B40600006000000\n(1.3) can0 581#6040600000000000\n",
    );
    for at in 20..60 {
        log.push_str(&format!("({}.{}) can0 701#7F\n", at / 10, at % 10));
    }
    let bench = Bench::new();
    std::fs::write(bench.path("log"), log).unwrap();
    let text = String::from_utf8(bench.run(&["decode", "log"]).0.stdout).unwrap();
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    assert_eq!(
        lines,
        [
            "1.000000  can0   master    tells node 1: reset node",
            "1.100000  can0   node 1    boots up",
            "1.300000  can0   node 1    write 6040h:00 control word = 0006h, shutdown",
            "2.000000  can0   node 1    has started, is pre-operational",
            "",
            "what repeated itself:",
            "node 1 heartbeat, at last pre-operational: 40 times, every 100.0 ms",
            "",
            "44 frames: 1 nmt, 1 sdo-request, 1 sdo-response, 40 heartbeat, 1 boot-up",
        ]
    );
}

/// The README shows what the command really says.
#[test]
fn the_readme_shows_a_real_story() {
    let log = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/bring-up.log");
    let readme = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../README.md")).unwrap();
    let story = String::from_utf8(Bench::new().run(&["decode", log]).0.stdout).unwrap();
    assert!(readme.contains(&story), "README.md lacks:\n{story}");
}

/// The story of a log.
fn story(log: impl AsRef<[u8]>, more: &[&str]) -> String {
    let bench = Bench::new();
    std::fs::write(bench.path("log"), log).unwrap();
    let mut arguments = vec!["decode", "log"];
    arguments.extend(more);
    bench.run(&arguments).ends(0).stdout()
}

#[track_caller]
fn expect_lines(text: &str, lines: &[&str]) {
    let told: Vec<&str> = text.lines().map(str::trim).collect();
    assert_eq!(told, lines, "{text}");
}

#[test]
fn an_abort_or_answer_without_its_request_is_told() {
    let log = "(0.1) can0 581#4B41600037060000\n\
               (0.2) can0 581#8018100511000906\n\
               (0.3) can0 602#8000200100000405\n\
               (0.4) can0 581#6040600000000000\n\
               (0.5) can0 601#4041600000000000\n\
               (0.6) can0 581#8018100511000906\n\
               (0.7) can0 581#4B41600037060000\n\
               (0.8) can0 581#0041424344454647\n\
               (0.9) can0 581#FF41424344454647\n";
    expect_lines(
        &story(log, &[]),
        &[
            "0.100000  can0   node 1    read  6041h:00 status word = 0637h, operation enabled, target reached, \
             answer to no request in the capture",
            "0.200000  can0   node 1    ABORTS 1018h:05 identity 5, sub-index does not exist (06090011h): no transfer \
             of it is open",
            "0.300000  can0   node 2    2000h:01: the client ABORTS, SDO protocol timed out (05040000h): no transfer of it is open",
            "0.400000  can0   node 1    write 6040h:00 control word is confirmed: answer to no request in the capture",
            "0.600000  can0   node 1    ABORTS 1018h:05 identity 5, sub-index does not exist (06090011h): no transfer \
             of it is open",
            "0.700000  can0   node 1    read  6041h:00 status word = 0637h, operation enabled, target reached",
            "0.800000  can0   node 1    SDO frame that fits no transfer: 00 41 42 43 44 45 46 47",
            "",
            "what repeated itself:",
            "node 1 SDO frames that fit no transfer: 2 times, every 100.0 ms",
            "",
            "9 frames: 1 sdo-request, 5 sdo-response, 3 sdo-abort",
        ],
    );
}

#[test]
fn a_transfer_that_began_before_the_capture_is_told_as_one() {
    let log = "(0.1) can0 581#0044726976652053\n\
               (0.2) can0 601#7000000000000000\n\
               (0.3) can0 581#1944303300000000\n\
               (0.4) can0 582#6000200100000000\n\
               (0.5) can0 582#A203040000000000\n";
    expect_lines(
        &story(log, &[]),
        &[
            "0.300000  can0   node 1    read  an object that is not named = \"Drive SD03\"  [segmented, 10 bytes in \
             200.0 ms], begun before the capture",
            "0.400000  can0   node 2    write 2000h:01 is confirmed: answer to no request in the capture",
            "0.500000  can0   node 2    write an object that is not named: unfinished, nothing  [block, 0 bytes], \
             begun before the capture",
            "",
            "5 frames: 1 sdo-request, 4 sdo-response",
        ],
    );
    // The contract of --json: an answer without its request is a frame object only.
    let objects = objects(log.as_bytes(), &[]);
    assert!(objects.iter().all(|object| object["kind"] != "sdo-transfer"), "{objects:?}");
}

/// A transfer of node 1 with its frames 1 ms apart, again and again.
fn log_of(transfers: &[&[&str]]) -> String {
    let lines = transfers.concat();
    lines.iter().zip(1..).map(|(frame, ms)| format!("(0.{ms:03}) can0 {frame}\n")).collect()
}

/// It was told as done without a word, and not at all after the same data with the right CRC.
#[test]
fn a_wrong_crc_of_a_block_transfer_is_told() {
    let upload = |end| {
        [
            "601#A400200104000000",
            "581#C400200100000000",
            "601#A300000000000000",
            "581#0131323334353637",
            "581#8238390000000000",
            "601#A202040000000000",
            end,
            "601#A100000000000000",
        ]
    };
    let (right, wrong) = (upload("581#D5C3310000000000"), upload("581#D5C4310000000000"));
    let log = log_of(&[&right, &wrong, &wrong]);
    expect_lines(
        &story(&log, &[]),
        &[
            "0.008000  can0   node 1    read  2000h:01 = \"123456789\"  [block, 9 bytes in 7.0 ms]",
            "0.016000  can0   node 1    read  2000h:01 = \"123456789\"  [block, 9 bytes in 7.0 ms], CRC WRONG: 31C4h \
             came, 31C3h computed",
            "",
            "what repeated itself:",
            "SDO transfers like those told: 1",
            "",
            "24 frames: 12 sdo-request, 12 sdo-response",
        ],
    );
    let objects = objects(log.as_bytes(), &[]);
    let transfers: Vec<_> = objects.iter().filter(|object| object["kind"] == "sdo-transfer").collect();
    assert!(transfers.iter().all(|transfer| transfer["outcome"] == "done"), "{transfers:?}");
    let errors: Vec<_> = transfers.iter().map(|transfer| transfer.get("crc_error")).collect();
    assert_eq!(errors, [None, Some(&json!(true)), Some(&json!(true))]);
}

/// There was no remark.
#[test]
fn a_size_that_is_not_the_one_announced_is_told() {
    let log = log_of(&[
        &[
            "601#4000200100000000",
            "581#4100200114000000",
            "601#6000000000000000",
            "581#0031323334353637",
            "601#7000000000000000",
            "581#1B38390000000000",
        ],
        &["601#2100200204000000", "581#6000200200000000", "601#0131323334353637", "581#2000000000000000"],
        &["601#2100200300100000", "581#8000200312000706"],
    ]);
    expect_lines(
        &story(&log, &[]),
        &[
            "0.006000  can0   node 1    read  2000h:01 = \"123456789\"  [segmented, 9 bytes in 5.0 ms], 20 bytes \
             announced",
            "0.010000  can0   node 1    write 2000h:02 = 31 32 33 34 35 36 37  [segmented, 7 bytes in 3.0 ms], 4 bytes \
             announced",
            "0.012000  can0   node 1    write 2000h:03 = nothing: REFUSED, data type does not match, length of \
             service parameter too high (06070012h)  [segmented, 0 bytes in 1.0 ms], 4096 bytes announced",
            "",
            "12 frames: 6 sdo-request, 5 sdo-response, 1 sdo-abort",
        ],
    );
    let objects = objects(log.as_bytes(), &[]);
    let transfers = objects.iter().filter(|object| object["kind"] == "sdo-transfer");
    let sizes: Vec<_> = transfers.map(|transfer| json!([transfer["size"], transfer["announced"]])).collect();
    assert_eq!(json!(sizes), json!([[9, 20], [7, 4], [0, 4096]]));
}

/// They were taken for proper ones.
#[test]
fn an_sdo_frame_that_is_too_short_is_told_as_short() {
    let log = log_of(&[
        &["605#4000100000", "585#4300100092010200"],
        &["605#4041600000000000", "585#4B4160003706"],
        &["605#4008100000", "605#4018100000000000"],
        &["585#80181000", "585#8018100000000206", "585#4F18100004"],
    ]);
    expect_lines(
        &story(&log, &[]),
        &[
            "0.002000  can0   node 5    read  1000h:00 device type = 00020192h, drive (CiA 402), request of 5 bytes, \
             8 expected",
            "0.004000  can0   node 5    read  6041h:00 status word = 0637h, operation enabled, target reached, answer \
             of 6 bytes, 8 expected",
            "0.005000  can0   node 5    read  1008h:00 device name: NO ANSWER, request of 5 bytes, 8 expected",
            "0.007000  can0   node 5    SDO frame that fits no transfer: 80 18 10 00, answer of 4 bytes, 8 expected",
            "0.008000  can0   node 5    read  1018h:00 identity, number of entries: REFUSED, object does not exist in \
             the object dictionary (06020000h)",
            "0.009000  can0   node 5    read  1018h:00 identity, number of entries = 4, answer to no request in the \
             capture, answer of 5 bytes, 8 expected",
            "",
            "9 frames: 4 sdo-request, 4 sdo-response, 1 sdo-abort",
        ],
    );
}

/// It was an "answer to no request in the capture". The traffic is that of a drive that starts slowly
/// (ros2_canopen, issue 36).
#[test]
fn an_answer_after_the_client_has_given_up_is_told_as_late() {
    let log = log_of(&[
        &["602#4000100000000000", "602#8000100000000405", "582#4300100092010200"],
        &["602#2B17100000000000", "602#8017100000000405", "582#6017100000000000"],
        &["602#4008100000000000", "602#8008100000000405", "582#4108100009000000", "582#8008100000000405"],
        &["602#4000100000000000", "582#4300100092010200", "582#4300100092010200"],
    ]);
    expect_lines(
        &story(&log, &[]),
        &[
            "0.002000  can0   node 2    read  1000h:00 device type: the client gave up, SDO protocol timed out \
             (05040000h)",
            "0.003000  can0   node 2    read  1000h:00 device type = 00020192h, drive (CiA 402), late answer: the \
             client had given up 1.0 ms before",
            "0.005000  can0   node 2    write 1017h:00 heartbeat period in ms: the client gave up, SDO protocol timed out \
             (05040000h)",
            "0.006000  can0   node 2    write 1017h:00 heartbeat period in ms is confirmed: late answer: the client \
             had given up 1.0 ms before",
            "0.008000  can0   node 2    read  1008h:00 device name: the client gave up, SDO protocol timed out \
             (05040000h)",
            "0.009000  can0   node 2    begins a transfer of 1008h:00 device name: late answer: the client had given \
             up 1.0 ms before",
            "0.010000  can0   node 2    ABORTS 1008h:00 device name, SDO protocol timed out (05040000h): late answer: \
             the client had given up 2.0 ms before",
            "0.012000  can0   node 2    read  1000h:00 device type = 00020192h, drive (CiA 402)",
            "0.013000  can0   node 2    read  1000h:00 device type = 00020192h, drive (CiA 402), answer to no request \
             in the capture",
            "",
            "13 frames: 4 sdo-request, 5 sdo-response, 4 sdo-abort",
        ],
    );
    let without_times =
        story("can0 602#4000100000000000\ncan0 602#8000100000000405\ncan0 582#4300100092010200\n", &[]);
    assert!(without_times.contains(", late answer: the client had given up before\n"), "{without_times}");
}

#[test]
fn times_since_the_frame_before_are_added_up() {
    let log = " (000.000000)  can0  080   [0]\n (000.000200)  can0  601   [8]  40 41 60 00 00 00 00 00\n \
               (000.000100)  can0  581   [8]  4B 41 60 00 37 06 00 00\n (000.009700)  can0  080   [0]\n \
               (000.000050)  can0  601   [8]  40 41 60 00 00 00 00 00\n (000.009950)  can0  080   [0]\n";
    expect_lines(
        &story(log, &[]),
        &[
            "times of this capture are those since the frame before, added up here",
            "0.000000  can0   SYNC      begins",
            "0.000300  can0   node 1    read  6041h:00 status word = 0637h, operation enabled, target reached",
            "0.010050  can0   node 1    read  6041h:00 status word: NO ANSWER",
            "",
            "what repeated itself:",
            "SYNC: 3 times, every 10.0 ms",
            "",
            "6 frames: 3 sync, 2 sdo-request, 1 sdo-response",
        ],
    );
    assert!(story(log, &["--times", "absolute"]).contains("0.000100  can0   node 1    read  6041h:00"));
    // With --json times are the capture's own, and intervals are right.
    let objects = objects(log.as_bytes(), &[]);
    let times: Vec<_> = objects.iter().filter_map(|object| object.get("t")).collect();
    assert_eq!(json!(times), json!([0.0, 0.0002, 0.0001, 0.0001, 0.0097, 0.00005, 0.00995, null]));
    let intervals: Vec<_> = objects.iter().filter_map(|object| object.get("interval")).collect();
    assert_eq!(json!(intervals), json!([0.01, 0.01]));
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

/// What a maker's objects are is told once the vendor is known, or given.
#[test]
fn objects_of_a_linmot_drive_in_words() {
    let traffic = "can0 603#4004330100000000\ncan0 583#4304330110270000\n\
                   can0 603#23A1350690010000\ncan0 583#60A1350600000000\n\
                   can0 603#2300200B00000000\ncan0 583#6000200B00000000\n\
                   can0 603#4001207100000000\ncan0 583#8001207100000206\n";
    let vendor = "can0 603#4018100100000000\ncan0 583#4318100156010000\n";
    let words = [
        "can0   node 3    read  3304h:01 UPID 1304h, RAM value = 10000 (2710h)",
        "can0   node 3    write 35A1h:06 UPID 15A1h, RAM and ROM value = 400 (190h)",
        "can0   node 3    write 2000h:0B restart of the drive = 00 00 00 00",
        "can0   node 3    read  2001h:71 error log entry 1, code: REFUSED, object does not exist in the object \
         dictionary (06020000h)",
        "",
        "8 frames: 4 sdo-request, 3 sdo-response, 1 sdo-abort",
    ];
    expect_lines(&story(traffic, &["--linmot", "3"]), &words);
    let learned = story(format!("{vendor}{traffic}"), &[]);
    assert!(words[..4].iter().all(|line| learned.contains(line)), "{learned}");
    let unknown = story(traffic, &[]);
    assert!(!unknown.contains("UPID"), "{unknown}");
}

/// The bus that spoke second but was described first had no name, and in the counts at the end that of the
/// other.
#[test]
fn every_bus_has_its_name_in_whatever_order_they_speak() {
    let block = |kind: u32, body: &[u8]| {
        let total = (12 + body.len() as u32).to_le_bytes();
        [&kind.to_le_bytes()[..], &total, body, &total].concat()
    };
    let interface = |name: &[u8; 4]| block(1, &[&[227, 0, 0, 0, 0, 0, 0, 0, 2, 0, 4, 0][..], name].concat());
    let packet = |interface: u8| {
        let head = [[interface, 0, 0, 0], [0; 4], [0; 4], [9, 0, 0, 0], [9, 0, 0, 0]].concat();
        block(6, &[&head[..], &[0, 0, 7, 1, 1, 0, 0, 0, 5, 0, 0, 0]].concat())
    };
    let head = [&0x1A2B_3C4D_u32.to_le_bytes()[..], &[1, 0, 0, 0], &[0xFF; 8]].concat();
    let file =
        [block(0x0A0D_0D0A, &head), interface(b"canA"), interface(b"canB"), packet(1), packet(0), packet(0)]
            .concat();
    let told = story(&file, &[]);
    assert!(told.contains("  canA node 1 heartbeat, at last operational: 2 times"), "{told}");
    let objects = objects(&file, &[]);
    let buses: Vec<_> =
        objects.iter().filter(|object| has(object, json!({ "id": 0x701 }))).map(|o| &o["bus"]).collect();
    assert_eq!(buses, ["canB", "canA", "canA"]);
}

/// `what repeated itself` was missing above a count of transfers alone; frames of a transfer that
/// began before the capture named 0000h:00, which is no object.
#[test]
fn what_is_not_known_is_not_told_as_known() {
    let log = "can0 601#4041600000000000\ncan0 581#4B41600000000000\n".repeat(9);
    assert!(
        story(&log, &[]).contains("what repeated itself:\n  SDO transfers like those told"),
        "{}",
        story(&log, &[])
    );
    let late = "can0 601#6000000000000000\ncan0 581#0041424344454647\ncan0 601#7000000000000000\ncan0 581#1141424344454647\n";
    let objects = objects(late.as_bytes(), &[]);
    let segments: Vec<_> = objects.iter().filter(|object| object["command"] == "upload-segment").collect();
    assert_eq!(segments.len(), 4);
    assert!(segments.iter().all(|segment| segment.get("index").is_none()), "{objects:?}");
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

/// An FD frame was `123 Fd { bit_rate_switch: true, error_passive: false } [3] 11 22 33`.
#[test]
fn an_fd_frame_is_told_in_words() {
    let log = "(0.1) can0 123##1112233\n(0.2) can0 124##0\n";
    for more in [&[][..], &["--frames"]] {
        let told = story(log, more);
        assert!(told.contains("123 FD BRS [3] 11 22 33") && told.contains("124 FD [0]"), "{told}");
        assert!(!told.contains('{'), "{told}");
    }
}

#[test]
fn a_node_that_falls_silent_is_told_and_is_not_in_its_period() {
    let mut log = String::new();
    for beat in (0..20).chain(60..80) {
        log.push_str(&format!("({}.{}) can0 705#05\n", beat / 10, beat % 10));
    }
    for beat in 0..100 {
        log.push_str(&format!("({}.{}) can0 080#\n", 8 + beat / 10, beat % 10));
    }
    let told = story(&log, &[]);
    assert!(told.contains("6.000000  can0   node 5    its heartbeat is back after 4.1 s"), "{told}");
    assert!(told.contains("40 times, every 100.0 ms (longest 4100.0), silent for the last 10.0 s"), "{told}");
    let reset = story(log.replacen("(6.0) can0 705#05", "(6.0) can0 705#00", 1), &[]);
    assert!(reset.contains("node 5    boots up again, 4.1 s after its last heartbeat"), "{reset}");
}

/// Two captures, one behind the other.
#[test]
fn a_time_that_goes_back_is_told() {
    let beats: String = (0..5).map(|beat| format!("(5.{beat}) can0 705#05\n")).collect();
    let told = story(format!("{beats}(1.0) can0 705#05\n(1.1) can0 705#05\n"), &["--times", "absolute"]);
    assert!(told.contains("1.000000  capture   its time goes back by 4.4 s"), "{told}");
    assert!(told.contains("7 times, every 100.0 ms\n"), "{told}");
}

/// What a node was told is not yet what it is.
#[test]
fn a_state_is_told_when_the_node_shows_it() {
    let told = story("(1.0) can0 705#7F\n(1.1) can0 000#0105\n(1.2) can0 705#7F\n(1.3) can0 705#05\n", &[]);
    assert!(!told.contains("pre-operational now"), "{told}");
    assert!(told.contains("1.300000  can0   node 5    is operational now, was pre-operational"), "{told}");
}

#[test]
fn a_pdo_shorter_than_its_mapping_is_told_once() {
    let mapping = "(1.0) can0 605#23001A0110004160\n(1.1) can0 585#60001A0100000000\n\
        (1.2) can0 605#23001A0220006460\n(1.3) can0 585#60001A0200000000\n\
        (1.4) can0 605#2F001A0002000000\n(1.5) can0 585#60001A0000000000\n";
    let frames = "(2.0) can0 185#370601000000\n(2.1) can0 185#3706\n(2.2) can0 185#3606\n(2.3) can0 185#370602000000\n\
        (2.4) can0 185#\n";
    let told = story(format!("{mapping}{frames}"), &[]);
    let said: Vec<&str> = told.lines().filter(|line| line.contains("its mapping")).collect();
    assert_eq!(said.len(), 2, "{told}");
    assert!(said[0].contains("TPDO 1 has 2 bytes, its mapping 6"), "{told}");
    assert!(said[1].contains("TPDO 1 has 0 bytes, its mapping 6"), "{told}");
}

#[test]
fn an_emergency_that_leaves_others_is_not_over() {
    let told = story(
        "(1.0) can0 085#3081110000000000\n(1.1) can0 085#0000040000000000\n(1.2) can0 085#0000000000000000\n",
        &[],
    );
    assert!(told.contains("an emergency is over, others are not, register 04h"), "{told}");
    assert!(told.contains("emergency over: no error, register 00h"), "{told}");
}

#[test]
fn a_status_word_without_a_state_is_told() {
    let told = story(
        "(1.0) can0 605#23001A0110004160\n(1.1) can0 585#60001A0100000000\n(1.2) can0 605#2F001A0001000000\n\
         (1.3) can0 585#60001A0000000000\n(2.0) can0 185#3706\n(2.1) can0 185#1122\n(2.2) can0 185#3706\n",
        &[],
    );
    assert!(
        told.contains("2.100000  can0   node 5    TPDO 1: status word = 2211h, no state of CiA 402"),
        "{told}"
    );
    assert!(told.contains("2.200000  can0   node 5    TPDO 1: status word = 0637h"), "{told}");
}

#[test]
fn the_begin_of_a_fastscan_is_no_bit_128() {
    let told = story("(1.0) can0 7E5#5100000000800000\n(1.1) can0 7E5#516A0000001F0000\n", &[]);
    assert!(told.contains("master: fastscan: who has no node ID?"), "{told}");
    assert!(told.contains("fastscan vendor 0000006Ah from bit 31"), "{told}");
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

#[test]
fn a_pdo_that_is_mapped_anew_is_told() {
    let told = story(
        "(1.0) can0 605#23001A0110004160\n(1.1) can0 585#60001A0100000000\n(1.2) can0 605#2F001A0001000000\n\
         (1.3) can0 585#60001A0000000000\n(2.0) can0 185#37060000\n(2.1) can0 605#23001A0120006460\n\
         (2.2) can0 585#60001A0100000000\n(2.3) can0 185#37060001\n(2.4) can0 185#37060002\n",
        &[],
    );
    assert!(
        told.contains("2.300000  can0   node 5    TPDO 1, mapped anew: position actual = 16778807"),
        "{told}"
    );
}

/// Frames of two interfaces that were not written in order, with times since 1970.
#[test]
fn times_since_1970_are_no_differences() {
    let log: String = (0..50)
        .map(|n| {
            let at = 1_700_000_000.0 + f64::from(n) * 0.1;
            format!("({:.6}) can0 701#05\n({:.6}) can1 701#05\n", at, at - 0.000_005)
        })
        .collect();
    let told = story(log, &[]);
    assert!(!told.contains("since the frame before"), "{told}");
    assert!(
        told.contains("can0 node 1 heartbeat, at last operational: 50 times, every 100.0 ms\n"),
        "{told}"
    );
}

#[test]
fn a_name_of_a_bus_does_not_break_a_line() {
    let mut packets = vec![0x0A, 0x0D, 0x0D, 0x0A, 28, 0, 0, 0, 0x4D, 0x3C, 0x2B, 0x1A, 1, 0, 0, 0];
    packets.extend([0xFF; 8]);
    packets.extend([28, 0, 0, 0]);
    // Interface of link type 227 with the name "can\n".
    packets.extend([1, 0, 0, 0, 32, 0, 0, 0, 227, 0, 0, 0, 0, 0, 0, 0, 2, 0, 4, 0]);
    packets.extend(b"can\n");
    packets.extend([0, 0, 0, 0, 32, 0, 0, 0]);
    packets.extend([6, 0, 0, 0, 44, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 9, 0, 0, 0, 9, 0, 0, 0]);
    packets.extend([0, 0, 7, 5, 1, 0, 0, 0, 5, 0, 0, 0, 44, 0, 0, 0]);
    let told = story(packets, &[]);
    assert!(told.contains("can·   node 5    is operational"), "{told}");
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

/// However often an object was read before.
#[test]
fn a_transfer_that_fails_is_told_after_many_that_did_not() {
    let mut log = String::new();
    for at in 0..8 {
        log.push_str(&format!(
            "(1.{at}0) can0 605#4041600000000000\n(1.{at}5) can0 585#4B4160003{at}060000\n"
        ));
    }
    for at in 0..6 {
        log.push_str(&format!(
            "(2.{at}0) can0 605#4041600000000000\n(2.{at}5) can0 585#8041600000000{at}08\n"
        ));
    }
    log.push_str("(3.0) can0 605#4041600000000000\n(4.0) can0 605#4041600000000000\n");
    let told = story(log, &[]);
    let refused = told.lines().filter(|line| line.contains("REFUSED")).count();
    assert_eq!(refused, 4, "{told}");
    assert!(told.contains("(and so on)"), "{told}");
}
