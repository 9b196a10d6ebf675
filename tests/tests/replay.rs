//! Recorded traffic, replayed through our engines.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use canopen_master::NodeId;
use canopen_master::master::{Config, Event, Master};
use canopen_master::nmt::Command;
use conformance::replay::{Recording, Verdict, as_client, as_server, cases, read, slave};
use conformance::report::{counts, json, junit};
use device_sim::canopen::RemoteIo;
use pdo::Frame;

fn fixture(name: &str) -> (PathBuf, Recording) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("recorded").join(name);
    let recording = read(File::open(&path).unwrap()).unwrap();
    (path, recording)
}

/// Every fixture says what was recorded, with what, and how.
#[test]
fn fixtures_have_their_header() {
    let mut count = 0;
    for entry in std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("recorded")).unwrap() {
        let path = entry.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap();
        let keys: Vec<_> = text.lines().take(3).map(|line| line.split(':').next().unwrap()).collect();
        assert_eq!(keys, ["# device", "# stacks", "# taken by"], "{}", path.display());
        count += 1;
    }
    assert!(count >= 2);
}

#[track_caller]
fn assert_identical(verdicts: impl Iterator<Item = (usize, Verdict)>) -> usize {
    let mut identical = 0;
    for (number, verdict) in verdicts {
        match verdict {
            Verdict::Identical => identical += 1,
            Verdict::NotReplayed(_) => {}
            other => panic!("exchange {number}: {other}"),
        }
    }
    identical
}

/// python-canopen asked, our node answered: our server gives the same bytes.
#[test]
fn our_server_answers_python_canopen_as_recorded() {
    let (_, recording) = fixture("python-canopen-master.log");
    assert_eq!(recording.strays, 0);
    let ours =
        recording.exchanges.iter().enumerate().filter(|(_, exchange)| exchange.transfer.node.raw() == 5);
    assert!(assert_identical(ours.map(|(number, exchange)| (number, as_server(exchange)))) >= 80);
}

/// Our master asked, python-canopen answered: our client asks in the same bytes.
#[test]
fn our_client_asks_python_canopen_as_recorded() {
    let (_, recording) = fixture("motionctl-master.log");
    let ours = recording.exchanges.iter().enumerate();
    assert!(assert_identical(ours.map(|(number, exchange)| (number, as_client(exchange)))) >= 50);
}

/// The whole node: SDO, TPDOs, emergencies, states, boot-up, guarding.
#[test]
fn our_node_says_what_was_recorded() {
    let (_, recording) = fixture("python-canopen-master.log");
    let node = NodeId::new(5).unwrap();
    let expected = slave::recorded(node, &recording.frames);
    let found = slave::replayed(RemoteIo::node(Some(node), 1, true), node, &recording.frames);
    assert_eq!(found.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>());
    assert_eq!(expected.keys().copied().collect::<Vec<_>>(), [0x085, 0x185, 0x585, 0x705]);
    for (id, expected) in &expected {
        for (number, (ours, recorded)) in found[id].iter().zip(expected).enumerate() {
            assert_eq!(ours, recorded, "{id:03X}h, frame {number}");
        }
        assert_eq!(found[id].len(), expected.len(), "{id:03X}h");
    }
}

/// Our master sends the NMT commands that were recorded, and each is confirmed by what the node then showed.
#[test]
fn our_master_commands_as_recorded() {
    let (_, recording) = fixture("motionctl-master.log");
    let mut master: Master<'_, Vec<u8>, 127> = Master::new(Config::default());
    let (mut commands, mut confirmed, mut emergencies) = (0, 0, 0);
    let start = recording.frames[0].0;
    for (time, frame) in &recording.frames {
        let now = time.saturating_sub(start);
        let frame = Frame::from_can(frame).unwrap();
        if let Some((command, target)) = Command::parse(&frame) {
            // Each was a process of its own.
            master = Master::new(Config::default());
            master.nmt(now, command, target).unwrap();
            assert_eq!(master.poll_transmit(now).as_ref().map(Frame::data), Some(frame.data()));
            commands += 1;
        } else if matches!(frame.standard_id(), Some(0x094 | 0x594 | 0x714)) {
            let _ = master.handle_frame(now, &frame);
        }
        while let Some(event) = master.poll_event() {
            match event {
                Event::Nmt { confirmed: nodes, .. } => confirmed += usize::from(!nodes.is_empty()),
                Event::Emergency { emergency, .. } => {
                    assert_eq!(emergency.code.0, 0x2310);
                    emergencies += 1;
                }
                _ => {}
            }
        }
    }
    assert_eq!((commands, confirmed), (3, 3));
    assert!(emergencies > 0);
}

/// All captures that we have: every exchange is replayed from both sides, or has its reason. The report is in
/// the target directory.
#[test]
fn foreign_captures() {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/recorded");
    if !shared.exists() {
        println!("ignored: needs ../shared/recorded");
        return;
    }
    let mut all = Vec::new();
    let mut unexplained = Vec::new();
    for folder in ["can", "threads"] {
        let mut paths: Vec<_> =
            std::fs::read_dir(shared.join(folder)).unwrap().map(|entry| entry.unwrap().path()).collect();
        paths.sort();
        for path in paths {
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            let Ok(recording) = read(File::open(&path).unwrap()) else { continue };
            let mut table: BTreeMap<String, usize> = BTreeMap::new();
            for (number, exchange) in recording.exchanges.iter().enumerate() {
                for (side, verdict) in [("server", as_server(exchange)), ("client", as_client(exchange))] {
                    let text = verdict.to_string();
                    if let Verdict::Different(_) = &verdict {
                        unexplained.push(format!("{name}, exchange {number}, our {side}: {text}"));
                    }
                    *table.entry(format!("our {side}: {text}")).or_default() += 1;
                }
            }
            println!(
                "{name}: {} frames, {} exchanges, {} SDO frames outside of any",
                recording.frames.len(),
                recording.exchanges.len(),
                recording.strays
            );
            table.iter().for_each(|(text, count)| println!("    {count} x {text}"));
            all.extend(cases(&name, &recording));
        }
    }
    let target = Path::new(env!("CARGO_TARGET_TMPDIR"));
    std::fs::write(target.join("replay.xml"), junit("replay", &all)).unwrap();
    std::fs::write(target.join("replay.json"), json(&all).to_string()).unwrap();
    println!("{:?} passed, failed, skipped; report in {}", counts(&all), target.display());
    assert!(unexplained.is_empty(), "{}", unexplained.join("\n"));
}

/// A wrong server is seen: one byte of a recorded answer changed.
#[test]
fn a_changed_answer_is_a_difference() {
    let (_, mut recording) = fixture("python-canopen-master.log");
    let exchange = recording.exchanges.iter_mut().find(|exchange| exchange.messages.len() == 2).unwrap();
    assert_eq!(as_server(exchange), Verdict::Identical);
    exchange.messages[1].data[4] ^= 1;
    assert!(matches!(as_server(exchange), Verdict::Different(_)));
}
