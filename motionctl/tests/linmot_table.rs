//! Command tables in TOML files: what a file says twice, what a restore deletes, links and loops.
#![cfg(unix)]

mod common;
#[path = "common/linmot.rs"]
mod linmot;

use common::Bench;
use linmot::{Linmot, drive, entry};

const CAN: &[&str] = &["--can", "slcan:LINE"];

/// What a file says of an entry beside its bytes is not ignored when it has been edited.
#[test]
fn a_name_link_or_header_that_contradicts_raw_is_refused() {
    let bench = Bench::new();
    let _drive = drive(&bench, "--can=slcan-pty:LINE");
    let linmot = Linmot { bench: &bench, carrier: CAN };
    linmot.run(&["table", "set", "3", "--raw", &entry(7, "Move \"out\"")]).ends(0);
    linmot.run(&["table", "set", "7", "--raw", &entry(0xFFFF, "")]).ends(0);
    linmot.run(&["table", "backup", "T.toml"]).ends(0);
    let text = std::fs::read_to_string(bench.path("T.toml")).unwrap();
    for (from, to, words) in [
        (
            "'Move \"out\"'",
            "\"Move in\"",
            "entry 3: name = \"Move in\" contradicts raw, which has \"Move \\\"out\\\"\"",
        ),
        ("linked = 7", "linked = 8", "entry 3: linked = 8 contradicts raw, which has 7: raw is what counts"),
        ("header = 256", "header = 512", "header = 512 contradicts raw, which has 256: "),
        ("header = 256", "header = \"256\"", "change raw, or leave header out"),
        ("name = \"\"", "linked = 65535", "entry 7: linked = 65535 contradicts raw, which has none"),
        (
            "linked = 7",
            "link = 7",
            "entry 3: unknown key \"link\", entry, name, linked, header, raw expected",
        ),
        ("format = 1", "format = 1\nname = \"x\"", "T2.toml: unknown key \"name\""),
        (&text, "format = 1\nentry = 3\n", "entry: [[entry]] expected"),
    ] {
        assert!(text.contains(from), "{from}: {text}");
        std::fs::write(bench.path("T2.toml"), text.replacen(from, to, 1)).unwrap();
        for arguments in [&["table", "compare", "T2.toml"][..], &["--yes", "table", "restore", "T2.toml"]] {
            linmot.run(arguments).ends(5).says("T2.toml: ").says(words);
        }
    }
    // What is not said contradicts nothing.
    let raw: String =
        text.lines().filter(|line| !line.starts_with("header")).map(|line| format!("{line}\n")).collect();
    std::fs::write(bench.path("T2.toml"), raw).unwrap();
    linmot.run(&["table", "compare", "T2.toml"]).ends(0).says("2 equal");
}

/// Which entries go is said before and after; a file that was cut off deletes nothing.
#[test]
fn a_table_restore_says_what_it_deletes() {
    let bench = Bench::new();
    let _drive = drive(&bench, "--can=slcan-pty:LINE");
    let linmot = Linmot { bench: &bench, carrier: CAN };
    let set = |number: &str| {
        linmot.run(&["table", "set", number, "--raw", &entry(0xFFFF, "x")]).ends(0);
    };
    ["1", "2", "3"].into_iter().for_each(set);
    linmot.run(&["table", "backup", "T.toml"]).ends(0);
    let text = std::fs::read_to_string(bench.path("T.toml")).unwrap();
    for (at, _) in text.match_indices('\n') {
        std::fs::write(bench.path("C.toml"), &text[..=at]).unwrap();
        if at + 1 < text.trim_end().len() {
            linmot.run(&["--yes", "table", "restore", "C.toml"]).ends(5).says("C.toml: ");
        }
    }
    let (cut, _) = text.split_at(text.rfind("[[entry]]").unwrap());
    std::fs::write(bench.path("C.toml"), cut).unwrap();
    linmot
        .run(&["--yes", "table", "restore", "C.toml"])
        .ends(5)
        .says("C.toml: entries = 3 in its head, 2 are there: the file was cut off or changed");

    ["7", "9"].into_iter().for_each(set);
    let words = "entries 7, 9, which the file does not have, ";
    let json = linmot.json(&["--dry-run", "table", "restore", "T.toml"]);
    assert_eq!(json["plan"], format!("would write 3 entries to RAM and flash; {words}would be deleted"));
    assert_eq!(json["deleted"], serde_json::json!([7, 9]));
    linmot.run(&["table", "restore", "T.toml"]).ends(2).says(&format!("{words}will be deleted?"));
    linmot.run(&["--yes", "table", "restore", "T.toml"]).ends(0).says(&format!("{words}deleted"));
    set("7");
    let json = linmot.json(&["--yes", "table", "restore", "T.toml"]);
    assert_eq!(json["deleted"], serde_json::json!([7]));

    // Files of before have no number of entries; one without any entry must say that.
    std::fs::write(bench.path("O.toml"), text.replacen("entries = 3\n", "", 1)).unwrap();
    linmot.run(&["table", "compare", "O.toml"]).ends(0);
    std::fs::write(bench.path("O.toml"), "format = 1\n").unwrap();
    linmot.run(&["--yes", "table", "restore", "O.toml"]).ends(5).says("it has no entries");
    std::fs::write(bench.path("O.toml"), "entries = 0\nformat = 1\n").unwrap();
    linmot
        .run(&["table", "restore", "O.toml"])
        .ends(2)
        .says("0 entries, to RAM and flash; entries 1, 2, 3, all that the drive has, will be deleted?");
    linmot.run(&["--yes", "table", "restore", "O.toml"]).ends(0);
    linmot.run(&["table", "list"]).ends(0).says("no entries");
    linmot.run(&["table", "backup", "T.toml"]).ends(0);
    linmot.run(&["--yes", "table", "restore", "T.toml"]).ends(0).says("0 entries written");
}

/// A loop may be what the machine is meant to do, a link to nothing never is.
#[test]
fn a_loop_is_no_fault() {
    let bench = Bench::new();
    let _drive = drive(&bench, "--can=slcan-pty:LINE");
    let linmot = Linmot { bench: &bench, carrier: CAN };
    let set = |number: &str, link| {
        linmot.run(&["table", "set", number, "--raw", &entry(link, "x")]).ends(0);
    };
    set("6", 6);
    linmot
        .run(&["table", "check"])
        .ends(0)
        .says("note: entry 6 begins a loop of 1 entry\n1 entry, 0 faults, 1 loop");
    let json = linmot.json(&["table", "check"]);
    assert_eq!(json["faults"], serde_json::json!([]));
    assert_eq!((json["loops"][0]["entry"].as_u64(), json["loops"][0]["length"].as_u64()), (Some(6), Some(1)));
    set("7", 99);
    linmot
        .run(&["table", "check"])
        .ends(1)
        .says("error: entry 7 is linked to entry 99, which does not exist\n");
    set("8", 100);
    linmot
        .run(&["table", "check"])
        .ends(1)
        .says("3 entries, 2 faults, 1 loop")
        .says("error: entry 7 is linked to entry 99, which does not exist; and 1 more");
}

#[test]
fn a_table_with_a_link_to_nothing_is_restored_as_it_was() {
    let bench = Bench::new();
    let _drive = drive(&bench, "--can=slcan-pty:LINE");
    let linmot = Linmot { bench: &bench, carrier: CAN };
    linmot.run(&["table", "set", "9", "--raw", &entry(10, "x")]).ends(0);
    let words = "entry 9 is linked to entry 10, which does not exist";
    linmot.run(&["table", "backup", "T.toml"]).ends(0).says(&format!("note: {words}"));
    linmot.run(&["table", "delete", "9"]).ends(0);
    let json = linmot.json(&["--yes", "table", "restore", "T.toml"]);
    assert_eq!(json["remarks"], serde_json::json!([words]));
    linmot.run(&["table", "compare", "T.toml"]).ends(0).says("1 equal");
}
