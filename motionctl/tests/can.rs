//! The real program on a virtual bus: a `bus`, virtual nodes, and commands, each a process of its own.

#[path = "common/can.rs"]
mod common;

use std::process::{Command, Stdio};

use common::{Bench, Running};
use serde_json::{Value, json};

#[test]
fn a_network_of_drive_and_io() {
    let mut bench = Bench::new();
    bench.sim(&["drive", "--node", "1"]);
    bench.sim(&["io", "--node", "5", "--wired", "--serial-number", "9"]);

    let scan = bench.can(&["scan"], 0);
    let nodes = scan["nodes"].as_array().unwrap();
    assert_eq!(nodes.len(), 2);
    assert_eq!(
        (&nodes[0]["node"], &nodes[0]["profile"], &nodes[0]["name"]),
        (&json!(1), &json!(0x192), &json!("SD03"))
    );
    assert_eq!(nodes[0]["identity"]["vendor"], 0x6A);
    assert_eq!((&nodes[1]["node"], &nodes[1]["state"]), (&json!(5), &json!("pre-operational")));

    let read = bench.can(&["sdo", "read", "1", "1000h", "--type", "u32"], 0);
    let expected = json!({
        "schema_version": 1, "node": 1, "index": 0x1000, "subindex": 0,
        "mode": "expedited", "size": 4, "data": "92010200", "value": 0x0002_0192,
    });
    assert_eq!(read, expected);
    assert_eq!(bench.can(&["sdo", "read", "5", "0x100A", "--type", "string"], 0)["mode"], "segmented");

    // Every mode, there and back.
    let big: Vec<u8> = (0..20_000u32).map(|i| (i * 7 / 3) as u8).collect();
    std::fs::write(bench.directory.path().join("big"), &big).unwrap();
    for (more, mode) in [(&[][..], "segmented"), (&["--block"][..], "block")] {
        let written = bench.can(&[&["sdo", "write", "5", "0x2000:1", "--file", "big"], more].concat(), 0);
        assert_eq!((&written["mode"], &written["size"]), (&json!(mode), &json!(20_000)));
        let read = bench.can(&[&["sdo", "read", "5", "0x2000:1", "--output", "back"], more].concat(), 0);
        assert_eq!(read["mode"], mode);
        assert!(std::fs::read(bench.directory.path().join("back")).unwrap() == big);
    }

    // Refused, silent, misspelt, absent.
    let refused = bench.can(&["sdo", "write", "5", "0x1000", "1", "--type", "u32"], 4);
    assert_eq!(refused["abort_code"], 0x0601_0002);
    assert_eq!(bench.can(&["sdo", "read", "9", "0x1000", "--timeout", "0.05"], 3)["abort_code"], 0x0504_0000);
    bench.can(&["sdo", "read", "5", "1000"], 2);
    bench.can(&["sdo", "write", "5", "0x6411:1", "1"], 2);
    bench.can(&["sdo", "write", "5", "0x6411:1", "--type", "i16", "--", "-5"], 0);
    assert_eq!(bench.can(&["sdo", "read", "5", "0x6411:1", "--type", "i16"], 0)["value"], -5);

    assert_eq!(bench.can(&["nmt", "start", "5"], 0)["nodes"], json!([{ "node": 5, "state": "operational" }]));
    let all = bench.can(&["nmt", "start", "all"], 0);
    let operational = |node| json!({ "node": node, "state": "operational" });
    assert_eq!(all["nodes"], json!([operational(1), operational(5)]));
    assert_eq!(all["confirmed"], json!([1, 5]));
    assert_eq!(bench.can(&["nmt", "reset-node", "5"], 0)["nodes"][0]["state"], "boot-up");
    bench.can(&["nmt", "stop", "9", "--timeout", "0.05"], 3);

    let map = ["pdo", "write", "5", "tpdo2", "--map", "0x6401:1:16", "0x6000:1:8", "--transmission", "1"];
    let pdo = bench.can(&map, 0);
    assert_eq!((&pdo["id"], &pdo["enabled"], &pdo["transmission"]), (&json!(0x285), &json!(true), &json!(1)));
    assert_eq!(pdo["mapping"][1], json!({ "index": 0x6000, "subindex": 1, "bits": 8 }));
    assert_eq!(bench.can(&["pdo", "read", "5", "tpdo2"], 0), pdo);

    let guard = bench.can(&["guard", "9", "--for", "0.5", "--period", "0.05"], 3);
    assert_eq!((&guard["node"], &guard["event"]), (&json!(9), &json!("lost")));

    // A concise DCF: two entries.
    let concise = [2u8, 0, 0, 0, 0x02, 0x62, 1, 1, 0, 0, 0, 0x0F, 0x17, 0x10, 0, 2, 0, 0, 0, 0xF4, 0x01];
    std::fs::write(bench.directory.path().join("concise"), concise).unwrap();
    assert_eq!(bench.can(&["dcf", "5", "concise"], 0)["written"], 2);
    assert_eq!(bench.can(&["sdo", "read", "5", "0x1017", "--type", "u16"], 0)["value"], 500);
}

/// A part that the node refuses leaves the PDO as it was, and that is said.
#[test]
fn a_refused_pdo_write_puts_back_what_was() {
    let mut bench = Bench::new();
    bench.sim(&["io", "--node", "5"]);
    let map = ["pdo", "write", "5", "tpdo2", "--map", "0x6401:1:16", "--transmission", "1"];
    let before = bench.can(&map, 0);
    let write = |more: &[&str]| bench.run(&[&["pdo", "write", "5", "tpdo2"], more].concat());
    let refused = [
        (&["--map", "0x6401:2:16", "0x1000:0:32", "--event", "100"][..], 0x0604_0041, "mapped object 2"),
        // NMT's identifier: refused when the PDO is to be switched on.
        (&["--map", "0x6401:2:16", "--id", "0x001", "--transmission", "2"], 0x0609_0030, "switching"),
    ];
    for (more, code, what) in refused {
        let output = write(more);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(4), "{said}");
        assert!(said.contains(what) && said.contains("the PDO is again as it was before"), "{said}");
        let document: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!((&document["abort_code"], &document["left"]), (&json!(code), &json!("restored")));
        assert_eq!(bench.can(&["pdo", "read", "5", "tpdo2"], 0), before);
    }
    // What is not there is noticed before anything is touched.
    let output = bench.run(&["pdo", "write", "5", "tpdo9", "--transmission", "1"]);
    assert_eq!(output.status.code(), Some(4));
}

#[test]
fn layer_setting_services() {
    let mut bench = Bench::new();
    bench.can(&["lss", "fastscan"], 3);
    bench.sim(&["io", "--node", "255", "--serial-number", "77"]);
    // A step of 25 ms, as it is without --timeout, can pass while the machine has other work.
    let found = bench.can(&["--timeout", "0.05", "lss", "fastscan"], 0);
    assert_eq!((&found["product"], &found["serial"]), (&json!(0x191), &json!(77)));
    assert_eq!(bench.can(&["lss", "identify"], 0)["node"], 255);
    bench.can(&["lss", "set-bit-timing", "300"], 2);
    bench.can(&["lss", "set-bit-timing", "500"], 0);
    bench.can(&["lss", "set-node", "9"], 0);
    bench.can(&["lss", "store"], 0);
    assert_eq!(bench.can(&["scan", "--nodes", "9"], 0)["nodes"][0]["node"], 9);
    assert_eq!(bench.can(&["lss", "identify", "--identity", "0:0x191:1:77"], 0)["node"], 9);
    bench.can(&["lss", "identify", "--identity", "0:0x191:1:78"], 3);
}

#[test]
fn endpoints_that_are_not_there() {
    let bench = Bench::new();
    for (endpoint, status) in [
        ("nonsense", 2),
        ("socketcand:127.0.0.1:1/can0", 5),
        ("slcan:/dev/nothing", 5),
        ("socketcan:nothing", 5),
    ] {
        let ended = Command::new(env!("CARGO_BIN_EXE_motionctl"))
            .args(["can", "scan", "--can", endpoint])
            .stdin(Stdio::null())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(status), "{endpoint}: {said}");
    }
    drop(bench);
}

/// Two programs on one bus: one sends on a channel at a period, the others see it, and a second
/// transmitter is told.
#[test]
fn channels_of_can_link() {
    let net = Bench::new();
    let sender = ["can", "link", "set", "3", "E2 04", "--period", "0.01", "--can", &net.endpoint];
    let (_sender, ready) = Running::start(&sender, net.directory.path());
    assert_eq!(ready["event"], "ready");
    let list = net.can(&["link", "list", "--for", "0.5"], 0);
    let channels = list["channels"].as_array().unwrap();
    assert_eq!(channels.len(), 14);
    assert_eq!((channels[2]["channel"].as_i64(), channels[2]["data"].as_str()), (Some(3), Some("E204")));
    assert!(channels[2]["age"].as_f64().unwrap() < 0.5);
    assert!(channels[0]["data"].is_null());
    let second = net.can(&["link", "set", "3", "00", "--for", "0.3"], 1);
    assert_eq!(second["conflict"], true);
    let once = net.can(&["link", "set", "4", "01", "--for", "0.1"], 0);
    assert_eq!((once["data"].as_str(), once["conflict"].as_bool()), (Some("01"), Some(false)));
    // Typed values.
    let typed =
        ["can", "link", "set", "5", "-1250", "--type", "i32", "--period", "0.01", "--can", &net.endpoint];
    let (_typed, _) = Running::start(&typed, net.directory.path());
    let list = net.can(&["link", "list", "--for", "0.5", "--type", "i32"], 0);
    let channel =
        |number: usize| (&list["channels"][number - 1]["data"], &list["channels"][number - 1]["value"]);
    assert_eq!(channel(5), (&json!("1EFBFFFF"), &json!(-1250)));
    assert_eq!(channel(3), (&json!("E204"), &Value::Null), "two bytes are no such value");
    assert_eq!(net.run(&["link", "set", "5", "70000", "--type", "u16"]).status.code(), Some(2));
    assert_eq!(net.run(&["link", "set", "5", "1", "--type", "word"]).status.code(), Some(2));
    let plan = net.run(&["link", "set", "5", "00", "--dry-run", "--can", "socketcan:nothing"]);
    assert_eq!(plan.status.code(), Some(0));
    for wrong in [["15", "00"], ["1", "0"], ["1", "000102030405060708"]] {
        let [channel, data] = wrong;
        assert_eq!(net.run(&["link", "set", channel, data]).status.code(), Some(2), "{wrong:?}");
    }
}

/// A node passes by its own device file, and does not by one that says more than it has.
#[test]
fn conformance_of_a_node() {
    let mut bench = Bench::new();
    bench.sim(&["io", "--node", "5", "--write-eds", "io.eds"]);
    let path = |name: &str| bench.directory.path().join(name);
    let conform = |eds: &str, more: &[&str], status| {
        let output = Command::new(env!("CARGO_BIN_EXE_motionctl"))
            .args(["--json", "conform", "--can", &bench.endpoint, "--node", "5", "--timeout", "5"])
            .args(["--eds", path(eds).to_str().unwrap()])
            .args(more)
            .current_dir(bench.directory.path())
            .output()
            .unwrap();
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(status), "{error}");
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    let plan = conform("io.eds", &["--dry-run"], 0);
    assert_eq!(plan["checks"][0]["id"], "nmt.boot-up");
    let report = conform("io.eds", &["--junit", "report.xml"], 0);
    assert_eq!(report["failed"], 0);
    assert!(report["passed"].as_u64().unwrap() > 400);
    let junit = std::fs::read_to_string(path("report.xml")).unwrap();
    assert!(junit.contains("failures=\"0\"") && junit.contains("CiA 301, 7.2.8.3.3"));

    let eds = std::fs::read_to_string(path("io.eds")).unwrap();
    let more = "\r\n[2F00]\r\nParameterName=not there\r\nDataType=7\r\nAccessType=rw\r\n";
    let list = eds.replace(
        "[ManufacturerObjects]\r\nSupportedObjects=1\r\n1=0x2000",
        "[ManufacturerObjects]\r\nSupportedObjects=2\r\n1=0x2000\r\n2=0x2F00",
    );
    assert_ne!(list, eds);
    std::fs::write(path("more.eds"), list + more).unwrap();
    let report = conform("more.eds", &[], 1);
    let failed: Vec<_> =
        report["cases"].as_array().unwrap().iter().filter(|case| case["outcome"] == "failed").collect();
    assert_eq!((failed.len(), &failed[0]["id"]), (1, &json!("object.2F00.00.read")), "{failed:?}");
}

/// What is wrong on the command line is told before anything is opened or sent.
#[test]
fn wrong_usage_of_buses_and_nodes() {
    let bench = Bench::new();
    let says = |arguments: &[&str], status: i32, words: &str| {
        let ended = Command::new(env!("CARGO_BIN_EXE_motionctl"))
            .args(arguments)
            .env("MOTIONCTL_CAN", &bench.endpoint)
            .env_remove("MOTIONCTL_CONFIG")
            .current_dir(bench.directory.path())
            .stdin(Stdio::null())
            .output()
            .unwrap();
        let said =
            String::from_utf8_lossy(&ended.stdout).into_owned() + &String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(status), "{arguments:?}: {said}");
        assert!(said.contains(words), "{arguments:?}: {said}");
    };
    says(&["bus", "--listen", "nonsense"], 2, "--listen nonsense: HOST:PORT expected");
    says(
        &["bus", "--listen", "127.0.0.1:0", "--bus", "a", "--bus", "b", "--bus", "a"],
        2,
        "two buses of one name",
    );
    says(&["sim", "io", "--node", "128"], 2, "1 to 127, or 255 to wait");
    // 181 may be meant as 181h, and 6041 as 6041h: neither is guessed.
    let write = ["can", "pdo", "write", "5", "tpdo2"];
    says(&[&write[..], &["--id", "181"]].concat(), 2, "in hex as 0x181 or 181h");
    says(&[&write[..], &["--map", "6041:0:16"]].concat(), 2, "0x6041:0:16 expected");
    // The plan says what would be set.
    let plan = ["--id", "281h", "--map", "0x6401:1:16", "6000h:1:8", "--transmission", "1", "--dry-run"];
    let words = "would set tpdo2 of node 5 up: mapping 6401h:01, 16 bits; 6000h:01, 8 bits, identifier 281h, \
                 transmission type 1";
    says(&[&write[..], &plan].concat(), 0, words);
    says(&["can", "sdo", "write", "5", "0x2000:1", "00", "--type", "bytes", "--dry-run"], 0, "1 byte to");
}

#[test]
fn ports_and_pages() {
    let directory = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_motionctl"));
        command.args(arguments).current_dir(directory.path()).output().unwrap()
    };
    let ports: Value = serde_json::from_slice(&run(&["ports", "--json"]).stdout).unwrap();
    assert!(ports["serial"].is_array() && ports["can"].is_array(), "{ports}");
    assert_eq!(run(&["man", "--output", "."]).status.code(), Some(0));
    for page in ["motionctl.1", "motionctl-monitor.1", "motionctl-can-sdo-read.1"] {
        let text = std::fs::read_to_string(directory.path().join(page)).unwrap();
        assert!(text.contains(".SH NAME"), "{page}");
    }
    assert_eq!(run(&["man", "--output", "nowhere"]).status.code(), Some(5));
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = run(&["completions", shell]);
        assert!(String::from_utf8_lossy(&script.stdout).contains("monitor"), "{shell}");
    }
}

/// The program ended before the frame that ends a block upload had gone out.
#[test]
fn a_block_upload_is_ended_on_the_wire() {
    let mut bench = Bench::new();
    bench.sim(&["io", "--node", "5"]);
    let mut ear = motion_io::can::open(&bench.endpoint.parse().unwrap()).unwrap();
    bench.can(&["sdo", "write", "5", "0x2000:1", &"a long text ".repeat(9), "--type", "string"], 0);
    assert_eq!(bench.can(&["sdo", "read", "5", "0x2000:1", "--block"], 0)["mode"], "block");
    loop {
        let event = ear.receive(core::time::Duration::from_secs(10)).unwrap();
        let Some(motion_io::can::Event::Frame(frame)) = event else { panic!("no end: {event:?}") };
        if frame.standard_id() == Some(0x605) && frame.data().first() == Some(&0xA1) {
            break;
        }
    }
}

/// `conform` of an address, as a person has it.
fn conform(bench: &Bench, node: &str, eds: &str, more: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_motionctl"))
        .args(["conform", "--can", &bench.endpoint, "--node", node, "--eds", eds])
        .args(more)
        .current_dir(bench.directory.path())
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

/// There were more than 550 lines of skipped entries, one each and without their clause.
#[test]
fn conform_tells_what_it_skips_in_rows_with_reason_and_clause() {
    let mut bench = Bench::new();
    bench.sim(&["io", "--node", "5", "--write-eds", "io.eds"]);
    let (status, told, _) = conform(&bench, "5", "io.eds", &["--timeout", "5"]);
    assert_eq!(status, Some(0), "{told}");
    let lines: Vec<_> = told.lines().collect();
    assert!(lines.len() < 100, "{told}");
    let skipped: Vec<_> = lines.iter().filter(|line| line.starts_with("skipped")).collect();
    assert!(skipped.iter().all(|line| line.contains("(CiA 30") && line.ends_with(')')), "{skipped:#?}");
    let row = "1600h to 1603h, 1800h to 1803h, 1A00h to 1A03h, ";
    assert!(
        skipped.iter().any(|line| line.contains(row) && line.contains(" entries: not written:")),
        "{told}"
    );
}

/// The report was found to be unwritable after the whole test, under the name of a temporary file.
#[test]
fn conform_asks_first_whether_its_report_can_be_written() {
    let mut bench = Bench::new();
    bench.sim(&["io", "--node", "5", "--write-eds", "io.eds"]);
    // Nobody there: the bus must not even be looked for.
    bench.endpoint = "socketcand:127.0.0.1:1/can0".into();
    for (path, why) in [("nodir/x.xml", "No such file or directory"), (".", "is a directory")] {
        let (status, told, error) = conform(&bench, "5", "io.eds", &["--junit", path]);
        assert_eq!((status, told.as_str()), (Some(5), ""), "{error}");
        assert!(error.starts_with(&format!("error: {path}: {why}")), "{error}");
    }
    // Its own device file would be lost.
    let file = bench.directory.path().join("io.eds");
    let before = std::fs::read(&file).unwrap();
    let (status, _, error) = conform(&bench, "5", "io.eds", &["--junit", "io.eds"]);
    assert_eq!(status, Some(2), "{error}");
    assert_eq!(std::fs::read(&file).unwrap(), before);
}

/// Nothing was written then, so that an older report was taken for that of this run.
#[test]
fn conform_of_an_absent_node_reports_so() {
    let mut bench = Bench::new();
    bench.sim(&["io", "--node", "5", "--write-eds", "io.eds"]);
    let path = bench.directory.path().join("report.xml");
    std::fs::write(&path, "an older report").unwrap();
    let (status, told, error) = conform(&bench, "9", "io.eds", &["--json", "--junit", "report.xml"]);
    assert_eq!(status, Some(3), "{error}");
    let why = "node 9 does not answer a request for 1000h";
    let document: Value = serde_json::from_str(&told).unwrap();
    assert_eq!(
        (&document["node"], &document["passed"], &document["failed"]),
        (&json!(9), &json!(0), &json!(1))
    );
    assert_eq!(document["cases"][0]["reason"], why);
    let junit = std::fs::read_to_string(&path).unwrap();
    assert!(junit.contains("tests=\"1\" failures=\"1\"") && junit.contains(why), "{junit}");
    // Nor is a bus that is not there.
    bench.endpoint = "socketcand:127.0.0.1:1/can0".into();
    assert_eq!(conform(&bench, "9", "io.eds", &["--junit", "report.xml"]).0, Some(5));
    let junit = std::fs::read_to_string(&path).unwrap();
    assert!(junit.contains("127.0.0.1:1"), "{junit}");
}
