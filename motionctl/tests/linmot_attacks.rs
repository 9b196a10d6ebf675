//! A restore that is killed, a link that dies, and peers that are no drives: what the user is told, and that the
//! same restore repairs what was begun.
#![cfg(unix)]
// Real processes are waited for, with a limit.
#![allow(clippy::disallowed_methods)]

mod common;
#[path = "common/linmot.rs"]
mod linmot;

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::process::{Child, Stdio};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Instant;

use common::{Bench, Controller, Ran};
use linmot::{CARRIERS, Linmot};
use motion_io::port::{Role, open};

/// A drive with enough parameters that a restore can be interrupted.
fn large(bench: &Bench, endpoint: &str) -> Controller {
    bench.device(&["sim", "linmot", endpoint, "--state", "FLASH", "--parameters", "1500"])
}

/// A backup of the drive, whose generated parameters all have another value than they have there.
fn other_values(bench: &Bench, linmot: &Linmot<'_>) {
    linmot.run(&["pvl", "backup", "B.pvl"]).ends(0);
    let text = std::fs::read_to_string(bench.path("B.pvl")).unwrap();
    let changed = text.lines().map(|line| {
        let generated = u16::from_str_radix(line.get(..4).unwrap_or(""), 16)
            .is_ok_and(|upid| (0x1400..0x1B00).contains(&upid) || (0x2200..0x2E00).contains(&upid));
        match (generated, line.get(7..15).map(|value| u32::from_str_radix(value, 16))) {
            (true, Some(Ok(value))) => format!("{}{:08X}{}\n", &line[..7], value ^ 0x8000, &line[15..]),
            _ => format!("{line}\n"),
        }
    });
    std::fs::write(bench.path("R.pvl"), changed.collect::<String>()).unwrap();
}

/// Begins a restore, and returns when the drive has kept something of it.
fn begun(bench: &Bench, carrier: &[&str]) -> Child {
    let before = std::fs::read(bench.path("FLASH")).unwrap();
    let all = [&["--yes", "--timeout", "0.3", "linmot", "pvl", "restore", "R.pvl"], carrier].concat();
    let mut command = bench.command(&all);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let limit = Instant::now() + Duration::from_secs(60);
    while std::fs::read(bench.path("FLASH")).unwrap() == before {
        let ended = child.try_wait().unwrap();
        assert!(Instant::now() < limit && ended.is_none(), "nothing was written: {ended:?}");
        std::thread::sleep(Duration::from_millis(1));
    }
    child
}

#[test]
fn the_same_restore_repairs_one_that_was_killed() {
    for (endpoint, carrier) in CARRIERS {
        let bench = Bench::new();
        let _drive = large(&bench, endpoint);
        let linmot = Linmot { bench: &bench, carrier };
        other_values(&bench, &linmot);
        let mut restore = begun(&bench, carrier);
        restore.kill().unwrap();
        restore.wait().unwrap();
        // Half of it is there, and it is seen.
        linmot.run(&["pvl", "compare", "R.pvl"]).ends(1).says("differences");
        let again = linmot.json(&["--yes", "pvl", "restore", "R.pvl"]);
        let written = again["written"].as_u64().unwrap();
        assert!(written > 0 && written < 1500, "{written}: nothing was left to write, or everything");
        linmot.run(&["restart", "--wait"]).ends(0);
        linmot.run(&["pvl", "compare", "R.pvl"]).ends(0);
    }
}

#[test]
fn a_restore_whose_drive_goes_says_how_far_it_came() {
    for (endpoint, carrier) in CARRIERS {
        let bench = Bench::new();
        let drive = large(&bench, endpoint);
        let linmot = Linmot { bench: &bench, carrier };
        other_values(&bench, &linmot);
        let restore = begun(&bench, carrier);
        drive.kill();
        let ran = Ran(restore.wait_with_output().unwrap());
        let status = ran.0.status.code();
        assert!([Some(3), Some(5)].contains(&status), "{status:?}: {}", ran.stderr());
        let ran = ran.says("incomplete: ").says("of them written) and 0 curves are as in the file");
        assert!(ran.stderr().contains("the same restore completes it"), "{}", ran.stderr());
        let _drive = large(&bench, endpoint);
        linmot.run(&["--yes", "pvl", "restore", "R.pvl"]).ends(0);
        linmot.run(&["pvl", "compare", "R.pvl"]).ends(0);
    }
}

/// Ctrl-C ended a restore without a word.
#[test]
fn a_restore_that_is_stopped_by_a_signal_says_how_far_it_came() {
    for (endpoint, carrier) in CARRIERS {
        let bench = Bench::new();
        let _drive = large(&bench, endpoint);
        let linmot = Linmot { bench: &bench, carrier };
        other_values(&bench, &linmot);
        let restore = begun(&bench, carrier);
        let id = rustix::process::Pid::from_child(&restore);
        rustix::process::kill_process(id, rustix::process::Signal::INT).unwrap();
        Ran(restore.wait_with_output().unwrap())
            .ends(5)
            .says("incomplete: ")
            .says("stopped by a signal")
            .says("the same restore completes it");
        linmot.run(&["--yes", "pvl", "restore", "R.pvl"]).ends(0);
        linmot.run(&["pvl", "compare", "R.pvl"]).ends(0);
    }
}

/// Answers on a pseudo-terminal: called with what has come, nothing every few milliseconds.
struct Peer {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Peer {
    fn new(bench: &Bench, mut answer: impl FnMut(&[u8]) -> Vec<u8> + Send + 'static) -> Self {
        let endpoint = format!("pty:{}", bench.path("LINE").display()).parse().unwrap();
        let mut port = open(&endpoint, Role::Device).unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        let thread = std::thread::spawn(move || {
            let mut buffer = [0; 256];
            while !stopped.load(Ordering::Relaxed) {
                // Nobody may be at the other end yet, or any more.
                let len = port.receive(&mut buffer, Duration::from_millis(2)).unwrap_or(0);
                let _ = port.send(&answer(&buffer[..len]));
            }
        });
        Self { stop, thread: Some(thread) }
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Bytes without meaning, the same at every run.
fn noise(seed: &mut u32) -> Vec<u8> {
    let next = |seed: &mut u32| {
        *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (*seed >> 24) as u8
    };
    (0..64).map(|_| next(seed)).collect()
}

const COMMANDS: [&[&str]; 4] =
    [&["params", "get", "13A2h"], &["params", "list"], &["curve", "list"], &["table", "list"]];

/// Runs every command against the peer: it ends with one of these statuses, in time, and says something.
fn refuses(bench: &Bench, endpoint: &[&str], name: &str, statuses: &[i32], words: &str) {
    for command in COMMANDS {
        let began = Instant::now();
        let all = [&["--timeout", "0.1", "linmot"], command, endpoint].concat();
        let ran = bench.run(&all);
        let status = ran.0.status.code().unwrap_or(-1);
        assert!(statuses.contains(&status), "{name}, {command:?}: {status}: {}", ran.stderr());
        assert!(ran.stderr().contains("error: "), "{name}: {}", ran.stderr());
        assert!(ran.stderr().contains(words), "{name}, {command:?}: {}", ran.stderr());
        assert!(!ran.stderr().contains("panicked"), "{name}: {}", ran.stderr());
        assert_eq!(ran.stdout(), "", "{name}: a result of nothing");
        assert!(began.elapsed() < Duration::from_secs(30), "{name}, {command:?}: endless");
    }
}

#[test]
fn peers_that_do_not_speak_linrs_are_named() {
    type Answer = Box<dyn FnMut(&[u8]) -> Vec<u8> + Send>;
    let on_request = |answer: &'static [u8]| -> Answer {
        Box::new(move |came: &[u8]| if came.is_empty() { Vec::new() } else { answer.to_vec() })
    };
    let mut seed = 1;
    let peers: [(&str, Answer, &[i32], &str); 8] = [
        ("silent", Box::new(|_| Vec::new()), &[3], "no answer"),
        ("noise", Box::new(move |_| noise(&mut seed)), &[3, 4], "answer"),
        ("echo", Box::new(<[u8]>::to_vec), &[3, 4], "answer"),
        // Another drive's, another command's, one with a length that no frame has, one that is cut off.
        (
            "other ID",
            on_request(b"\x01\x12\x0A\x02\x50\x00\x00\xA2\x13\x09\x00\x00\x00\x04"),
            &[3],
            "no answer",
        ),
        (
            "other request",
            on_request(b"\x01\x01\x0A\x02\x51\x00\x00\xA2\x13\x09\x00\x00\x00\x04"),
            &[3, 4],
            "answer",
        ),
        ("length 0", on_request(b"\x01\x01\x00\x02\x50\x00\x04"), &[3], "no answer"),
        ("length 255", on_request(b"\x01\x01\xFF\x02\x50\x00\x04"), &[3], "no answer"),
        ("cut off", on_request(b"\x01\x01\x0A\x02\x50\x00\x00\xA2"), &[3], "no answer"),
    ];
    for (name, answer, statuses, words) in peers {
        let bench = Bench::new();
        let _peer = Peer::new(&bench, answer);
        refuses(&bench, &["--port", "LINE"], name, statuses, words);
    }
}

#[test]
fn peers_that_are_no_drive_on_can_are_named() {
    type Answer = Box<dyn FnMut(&[u8]) -> Vec<u8> + Send>;
    // The adapter's command and its acknowledge; what begins with t is a frame.
    let adapter = |answer: &'static [u8]| -> Answer {
        Box::new(move |came: &[u8]| {
            let mut said = Vec::new();
            for command in came.split_inclusive(|byte| *byte == b'\r') {
                said.push(b'\r');
                if command.starts_with(b"t601") {
                    said.extend_from_slice(answer);
                }
            }
            said
        })
    };
    let (mut seed, mut later, mut opened) = (2, 3, false);
    let acknowledged_then_noise = move |came: &[u8]| {
        opened |= came.starts_with(b"t");
        // The next command begins with the adapter again.
        opened &= !came.contains(&b'C');
        let line = noise(&mut later).into_iter().filter(|byte| ![b'\r', 7].contains(byte));
        if opened { line.collect() } else { vec![b'\r'; came.len().min(8)] }
    };
    let peers: [(&str, Answer, &[i32], &str); 9] = [
        ("silent", adapter(b""), &[3], "no answer"),
        ("noise", Box::new(move |_| noise(&mut seed)), &[3, 5], ""),
        ("an adapter, then noise", Box::new(acknowledged_then_noise), &[3, 5], ""),
        ("endless frames", Box::new(|_| b"\rt12381122334455667788\r".repeat(8)), &[3], "no answer"),
        ("other object", adapter(b"t581843993316000000000\r"), &[3], "no answer"),
        ("short answer", adapter(b"t5814A2334301\r"), &[3], "no answer"),
        ("answer without data", adapter(b"t5810\r"), &[3], "no answer"),
        ("length 9", adapter(b"t58194399331600000000FF\r"), &[3, 5], ""),
        ("half a frame", adapter(b"t5818439"), &[3, 5], ""),
    ];
    for (name, answer, statuses, words) in peers {
        let bench = Bench::new();
        let _peer = Peer::new(&bench, answer);
        refuses(&bench, &["--can", "slcan:LINE"], name, statuses, words);
    }
}
