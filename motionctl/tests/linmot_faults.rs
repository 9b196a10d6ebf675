//! What goes wrong between a LinMot drive and its user while a command goes on: every fault by its name and
//! with its exit status, and in what state the drive is left.
#![cfg(unix)]

mod common;
#[path = "common/linmot.rs"]
mod linmot_drive;
#[path = "common/troubled.rs"]
mod troubled;

use common::{Bench, Ran};
use linmot::code::Command;
use linmot_drive::{CARRIERS, CURVE, Linmot, entry};
use troubled::{Happens, Troubled};

const SETPOINTS: usize = 10;

/// A script: what happens to the `number`th of these commands, counted from 1.
fn nth(command: Command, number: usize, what: Happens) -> troubled::Script {
    let mut count = 0;
    Box::new(move |asked| {
        count += usize::from(asked == command);
        if asked == command && count == number { what } else { Happens::Nothing }
    })
}

/// Runs `act` on a drive with this script over every carrier.
fn over_every_carrier(script: impl Fn() -> troubled::Script, act: impl Fn(&Linmot<'_>, &str)) {
    for (_, carrier) in CARRIERS {
        let bench = Bench::new();
        std::fs::write(bench.path("C.csv"), CURVE).unwrap();
        let can = carrier.contains(&"--can");
        let _drive = Troubled::new(&bench, can, script());
        let linmot = Linmot { bench: &bench, carrier };
        act(&linmot, carrier.last().unwrap());
    }
}

fn setpoints(linmot: &Linmot<'_>, id: &str) -> Vec<String> {
    linmot.run(&["curve", "get", id, "-o", "D.csv"]).ends(0);
    let text = std::fs::read_to_string(linmot.bench.path("D.csv")).unwrap();
    text.lines().skip(1).map(str::to_owned).collect()
}

/// The last word comes twice: the drive has all, and says so.
#[test]
fn a_block_that_was_finished_already_is_named() {
    let script = || nth(Command::ADD_CURVE_DATA, SETPOINTS, Happens::Twice);
    over_every_carrier(script, |linmot, _| {
        linmot
            .run(&["curve", "add", "5", "C.csv"])
            .ends(4)
            .says("curve 5 is in RAM, perhaps not as in the file: curve 5: add curve data (RAM): the drive answered D0h")
            .says("the block was finished already");
        assert_eq!(setpoints(linmot, "5"), CURVE.lines().skip(1).collect::<Vec<_>>());
    });
    let script = || nth(Command::WRITE_ENTRY_DATA, 16, Happens::Twice);
    over_every_carrier(script, |linmot, _| {
        linmot
            .run(&["table", "set", "9", "--raw", &entry(0xFFFF, "x")])
            .ends(4)
            .says("entry 9 in RAM is there as it was to be: entry 9: command table: write entry data: the drive answered D0h")
            .says("the block was finished already");
        linmot.run(&["table", "get", "9"]).ends(0).says("x");
    });
    // The reader's block ends, too.
    let script = || nth(Command::GET_CURVE_DATA, SETPOINTS, Happens::Twice);
    over_every_carrier(script, |linmot, _| {
        linmot.run(&["curve", "add", "5", "C.csv"]).ends(0);
        linmot
            .run(&["curve", "get", "5", "-o", "D.csv"])
            .ends(4)
            .says("D0h")
            .says("the block was finished already");
        assert!(!linmot.bench.path("D.csv").exists(), "half a curve was written");
    });
}

/// A word in the middle comes twice: the block ends too early, with other setpoints than those of the file.
#[test]
fn a_block_that_ends_early_is_named() {
    let script = || nth(Command::ADD_CURVE_DATA, 3, Happens::Twice);
    over_every_carrier(script, |linmot, _| {
        linmot
            .run(&["curve", "add", "5", "C.csv"])
            .ends(4)
            .says("curve 5 is in RAM, perhaps not as in the file: ")
            .says("the block's end came after 9 words, 10 expected");
        assert_ne!(setpoints(linmot, "5"), CURVE.lines().skip(1).collect::<Vec<_>>());
    });
    let script = || nth(Command::WRITE_ENTRY_DATA, 3, Happens::Twice);
    over_every_carrier(script, |linmot, _| {
        linmot
            .run(&["table", "set", "9", "--raw", &entry(0xFFFF, "x")])
            .ends(4)
            .says("entry 9 in RAM is another one than was to be written: ")
            .says("the block's end came after 15 words, 16 expected");
    });
}

/// Something else starts the software between the stop and the writing of flash.
#[test]
fn software_that_runs_again_is_named() {
    let words = "the drive answered D7h, MC software not stopped: it was stopped for this, and something has started \
                 it again; nothing was saved";
    over_every_carrier(
        || nth(Command::SAVE_CURVES, 1, Happens::Started),
        |linmot, _| {
            linmot.run(&["curve", "add", "5", "C.csv"]).ends(0);
            linmot.run(&["curve", "save", "--yes"]).ends(4).says(words);
            linmot.run(&["pvl", "backup", "B.pvl"]).ends(0);
            linmot.run(&["restart", "--wait"]).ends(0);
            // It was in RAM only.
            linmot.run(&["curve", "list"]).ends(0).says("no curves");
            linmot.run(&["--yes", "pvl", "restore", "B.pvl"]).ends(0);
        },
    );
    over_every_carrier(
        || nth(Command::SAVE_CURVES, 1, Happens::Started),
        |linmot, _| {
            linmot.run(&["curve", "add", "5", "C.csv"]).ends(0);
            linmot.run(&["pvl", "backup", "B.pvl"]).ends(0);
            let restore = ["--yes", "pvl", "restore", "B.pvl"];
            linmot
                .run(&restore)
                .ends(4)
                .says("incomplete: 37 parameters (0 of them written) and 1 curve are as in the file, curves in RAM only")
                .says(words);
            linmot.run(&restore).ends(0);
        },
    );
    over_every_carrier(
        || nth(Command::SAVE_TABLE, 1, Happens::Started),
        |linmot, _| {
            linmot.run(&["table", "set", "9", "--raw", &entry(0xFFFF, "x")]).ends(0);
            linmot.run(&["table", "save", "--yes"]).ends(4).says(words);
            linmot.run(&["table", "backup", "T.toml"]).ends(0);
            linmot.run(&["restart", "--wait"]).ends(0);
            linmot.run(&["table", "list"]).ends(0).says("no entries");
        },
    );
    over_every_carrier(
        || nth(Command::SAVE_TABLE, 1, Happens::Started),
        |linmot, _| {
            linmot.run(&["table", "set", "9", "--raw", &entry(0xFFFF, "x")]).ends(0);
            linmot.run(&["table", "backup", "T.toml"]).ends(0);
            linmot.run(&["table", "set", "8", "--raw", &entry(0xFFFF, "y")]).ends(0);
            linmot
                .run(&["--yes", "table", "restore", "T.toml"])
                .ends(4)
                .says("1 of 1 entry written and 1 other deleted in RAM, the same restore completes it")
                .says(words);
            linmot.run(&["--yes", "table", "restore", "T.toml"]).ends(0);
        },
    );
}

/// Power fails in the middle: over CAN the boot-up message tells, on a line there is silence.
#[test]
fn a_drive_that_restarts_in_the_middle_is_named() {
    let restarted = |linmot: &Linmot<'_>, arguments: &[&str], silent: bool| -> Ran {
        // The boot-up message ends the wait.
        let timeout = if silent { "1" } else { "20" };
        let ran = linmot.run(&[&["--timeout", timeout], arguments].concat());
        if silent {
            ran.ends(3).says("no answer to ").says("the drive is off, restarting, or has another ID")
        } else {
            ran.ends(4).says("the drive restarted during ")
        }
    };
    over_every_carrier(
        || nth(Command::ADD_CURVE_DATA, 4, Happens::PowerFails),
        |linmot, carrier| {
            restarted(linmot, &["curve", "add", "5", "C.csv"], carrier == "LINE")
                .says("curve 5 was not added: ")
                .says("it may have been carried out all the same");
            linmot.run(&["curve", "list"]).ends(0).says("no curves");
        },
    );
    over_every_carrier(
        || nth(Command::WRITE_BOTH, 1, Happens::PowerFails),
        |linmot, carrier| {
            restarted(linmot, &["params", "set", "13A2h", "--", "77"], carrier == "LINE")
                .says("it may have been carried out all the same");
            linmot.run(&["params", "get", "13A2h"]).ends(0).says("ROM 10");
        },
    );
    over_every_carrier(
        || nth(Command::WRITE_ROM, 3, Happens::PowerFails),
        |linmot, carrier| {
            restarted(linmot, &["params", "set", "03F2h", "--", "X Axis Left"], carrier == "LINE")
                .says("its ROM value is \"X Axis L\" now");
        },
    );
}

/// The answers to a command are lost: a write may have been carried out, a read is repeated.
#[test]
fn a_lost_answer_is_named() {
    over_every_carrier(
        || nth(Command::WRITE_BOTH, 1, Happens::AnswerLost),
        |linmot, _| {
            linmot
                .run(&["--timeout", "1", "params", "set", "13A2h", "--", "77"])
                .ends(3)
                .says("no answer to write RAM and ROM value")
                .says("it may have been carried out all the same");
            linmot.run(&["params", "get", "13A2h"]).ends(0).says("ROM 77");
        },
    );
    over_every_carrier(
        || nth(Command::ADD_CURVE_DATA, SETPOINTS, Happens::AnswerLost),
        |linmot, _| {
            linmot
                .run(&["--timeout", "1", "curve", "add", "5", "C.csv"])
                .ends(3)
                .says("curve 5 is in RAM, perhaps not as in the file: no answer to add curve data");
            assert_eq!(setpoints(linmot, "5"), CURVE.lines().skip(1).collect::<Vec<_>>());
        },
    );
}

/// The configuration module's count: never echoed, echoed wrongly, and echoed twice.
#[test]
fn a_count_that_is_lost_wrong_or_repeated_is_named() {
    let carrier = CARRIERS.into_iter().find(|(_, carrier)| carrier.contains(&"pdo")).unwrap().1;
    let run = |what: Happens| {
        let bench = Bench::new();
        let _drive = Troubled::new(&bench, true, nth(Command::WRITE_BOTH, 1, what));
        let linmot = Linmot { bench: &bench, carrier };
        let ran = linmot.run(&["--timeout", "1", "params", "set", "13A2h", "--", "77"]);
        // The next client finds its way.
        linmot.run(&["params", "get", "13A2h"]).ends(0).says("ROM 77");
        ran
    };
    let lost = run(Happens::Stale).ends(3);
    assert!(lost.stderr().contains("error: the drive does not echo count 5 of write RAM and ROM value of parameter by UPID, it shows count 4 still; it may have been carried out all the same"), "{}", lost.stderr());
    run(Happens::Count(9))
        .ends(4)
        .says("wrong answer to write RAM and ROM value of parameter by UPID: count 9, 5 expected")
        .says("it may have been carried out all the same");
    // A count of 0 is what a drive shows after its start.
    run(Happens::Count(0)).ends(4).says("the drive restarted during write RAM and ROM value");
    run(Happens::AnswerTwice).ends(0).says("ROM 77");
    // Every answer twice.
    let bench = Bench::new();
    std::fs::write(bench.path("C.csv"), CURVE).unwrap();
    let _drive = Troubled::new(&bench, true, Box::new(|_| Happens::AnswerTwice));
    let linmot = Linmot { bench: &bench, carrier };
    linmot.run(&["curve", "add", "5", "C.csv"]).ends(0);
    assert_eq!(setpoints(&linmot, "5"), CURVE.lines().skip(1).collect::<Vec<_>>());
    let list = linmot.json(&["params", "list"]);
    assert_eq!(list["parameters"].as_array().unwrap().len(), device_sim::linmot::sg5().len());
}

/// Before the first write nothing is incomplete.
#[test]
fn a_restore_that_never_began_says_so() {
    over_every_carrier(
        || nth(Command::NEXT_ITEM, 120, Happens::PowerFails),
        |linmot, carrier| {
            linmot.run(&["pvl", "backup", "B.pvl"]).ends(0);
            let timeout = if carrier == "LINE" { "1" } else { "20" };
            // The list is asked for once more behind the last UPID known.
            linmot.run(&["--timeout", timeout, "--yes", "pvl", "restore", "B.pvl"]).ends(0);
        },
    );
    let lost = || -> troubled::Script {
        let mut backups = 0;
        Box::new(move |asked| {
            backups += usize::from(asked == Command::START_LIST);
            if backups > 1 { Happens::AnswerLost } else { Happens::Nothing }
        })
    };
    over_every_carrier(lost, |linmot, _| {
        linmot.run(&["pvl", "backup", "B.pvl"]).ends(0);
        linmot
            .run(&["--timeout", "0.2", "--yes", "pvl", "restore", "B.pvl"])
            .ends(3)
            .says("error: nothing was written: no answer to start getting UPID list");
    });
}

/// "Delete all curves of the drive first" is true of flash, too, where the file has none.
#[test]
fn replaced_curves_are_gone_after_a_restart() {
    over_every_carrier(
        || Box::new(|_| Happens::Nothing),
        |linmot, _| {
            linmot.run(&["pvl", "backup", "B.pvl"]).ends(0);
            linmot.run(&["curve", "add", "5", "C.csv"]).ends(0);
            linmot.run(&["curve", "save", "--yes"]).ends(0);
            linmot.run(&["--yes", "pvl", "restore", "B.pvl", "--replace-curves"]).ends(0);
            linmot.run(&["restart", "--wait"]).ends(0);
            linmot.run(&["curve", "list"]).ends(0).says("no curves");
            linmot.run(&["pvl", "compare", "B.pvl"]).ends(0);
        },
    );
}
