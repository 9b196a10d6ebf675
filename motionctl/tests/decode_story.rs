//! `motionctl decode` in words.

#[allow(dead_code, reason = "shared with tests that need more of it")]
mod common;
#[path = "common/decode.rs"]
mod decode;

use common::Bench;
use decode::{has, objects};
use serde_json::json;

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
