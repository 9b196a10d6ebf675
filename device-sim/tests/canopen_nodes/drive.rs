//! The LD 2000.

use core::time::Duration;

use canopen_master::ds402;
use canopen_master::sdo::{AbortCode, Options, Outcome};
use device_sim::can::Faults;
use device_sim::canopen::{Fault, Ld2000};
use pdo::Frame;

use crate::bench::{Bench, MS, START, SYNC, guard, id};

/// `domain-notes.md` item 2: frames as in the drive's manual, p. 116.
#[test]
fn the_drive_follows_its_set_value() {
    let mut bench = Bench::new(Ld2000::node(id(1), 1), Faults::NONE);
    assert_eq!(bench.get(0x1000, 0), 0x0002_0192u32.to_le_bytes());
    assert_eq!(bench.get(0x1008, 0), b"SD03");
    assert_eq!(bench.get(0x35B4, 1), [0; 4]);
    bench.put(0x2600, 0, &[22]);
    bench.put(0x2A00, 0, &[22]);
    let refused = bench.write(0x2A00, 0, &[99], &Options::default());
    assert_eq!(refused, Err(Outcome::Aborted(AbortCode::INVALID_VALUE)));
    bench.send(START);
    bench.heard();
    // 3000 rpm is 419430 (p. 42).
    let order = |control: u8, speed: i32| {
        let [a, b, c, d] = speed.to_le_bytes();
        Frame::standard(0x201, [control, 0, a, b, c, d])
    };
    for control in [0x06, 0x07, 0x0F] {
        bench.send(order(control, 0));
    }
    assert_eq!(bench.node.device().state(), ds402::State::OperationEnabled);
    bench.send(order(0x0F, 419_430));
    bench.run(Duration::from_secs(1));
    let (start, speed) = bench.node.device().motion();
    assert_eq!(speed, 419_430.0);
    bench.run(Duration::from_secs(1));
    // 50 turns a second of 2^20 increments, less what 419430 is short of 3000 rpm.
    let increments = bench.node.device().motion().0 - start;
    assert!((increments - 419_430.0 * 125.0).abs() < 419_430.0 * 125.0 * 0.05, "{increments}");
    bench.heard();
    bench.send(SYNC);
    let answer = bench.tester.heard.iter().find(|(_, frame)| frame.standard_id() == Some(0x181)).unwrap().1;
    let &[low, high, p0, p1, p2, s0, s1, s2] = answer.data() else { panic!("{answer}") };
    let status = ds402::StatusWord(u16::from_le_bytes([low, high]));
    assert_eq!(status.state(), Some(ds402::State::OperationEnabled));
    assert_eq!(i32::from_le_bytes([s0, s1, s2, 0]), 419_430);
    let shown = f64::from(u32::from_le_bytes([p0, p1, p2, 0]));
    let real = bench.node.device().motion().0.rem_euclid(f64::from(1 << 24));
    assert!((real - shown).abs() < 419_430.0 * 125.0 * 0.003, "{shown} {real}");
    // Quick stop: it stands, and is switch on disabled.
    bench.send(order(0x02, 419_430));
    bench.run(Duration::from_secs(1));
    assert_eq!(bench.node.device().motion().1, 0.0);
    assert_eq!(bench.node.device().state(), ds402::State::SwitchOnDisabled);
}

#[test]
fn the_drive_stops_without_its_master() {
    let mut bench = Bench::new(Ld2000::node(id(1), 1), Faults::NONE);
    bench.put(0x100C, 0, &50u16.to_le_bytes());
    bench.put(0x100D, 0, &[2]);
    bench.put(0x6060, 0, &[3]);
    bench.put(0x60FF, 0, &100_000i32.to_le_bytes());
    for control in [6u16, 7, 15] {
        bench.put(0x6040, 0, &control.to_le_bytes());
    }
    for _ in 0..10 {
        bench.send(guard(1));
        bench.run(48 * MS);
    }
    assert_eq!(bench.node.device().motion().1, 100_000.0);
    bench.heard();
    bench.run(Duration::from_secs(1));
    assert_eq!(bench.node.device().motion().1, 0.0);
    // 8130h: communication, then the drive's own warning n04.
    assert_eq!(bench.heard(), ["081#3081110000000000", "081#3081110504000000"]);
    // The master is back: motion stays blocked until bit 11 goes to 1.
    bench.send(guard(1));
    bench.run(90 * MS);
    assert_eq!(bench.node.device().motion().1, 0.0);
    bench.put(0x6040, 0, &0x080Fu16.to_le_bytes());
    bench.send(guard(1));
    bench.run(90 * MS);
    assert!(bench.node.device().motion().1 > 0.0);
}

#[test]
fn a_fault_is_told_and_reset() {
    let mut bench = Bench::new(Ld2000::node(id(1), 1), Faults::NONE);
    bench.heard();
    bench.fail(Fault::Motor);
    assert_eq!(bench.heard(), ["081#1043090100000000"]);
    assert_eq!(bench.node.device().state(), ds402::State::Fault);
    assert_eq!(bench.get(0x1003, 0), [1]);
    assert_eq!(bench.get(0x1003, 1), 0x0001_4310u32.to_le_bytes());
    bench.heard();
    bench.put(0x6040, 0, &0x80u16.to_le_bytes());
    bench.run(2 * MS);
    assert!(bench.heard().contains(&"081#0000000000000000".to_owned()));
    assert_eq!(bench.node.device().state(), ds402::State::SwitchOnDisabled);
}

/// Decision 14: 2600h and 2A00h choose what the PDOs of a channel carry, at once; a mapping of one's own makes
/// the channel a free one.
#[test]
fn the_choice_of_a_pdo_is_its_mapping() {
    let mut bench = Bench::new(Ld2000::node(id(1), 1), Faults::NONE);
    bench.send(START);
    bench.heard();
    bench.send(SYNC);
    assert_eq!(bench.heard(), ["181#5002"]);
    bench.put(0x2A01, 0, &[33]);
    bench.put(0x2A00, 0, &[22]);
    assert_eq!(bench.get(0x1A00, 0), [3]);
    assert_eq!(bench.get(0x1A00, 3), 0x2070_0218u32.to_le_bytes());
    assert_eq!(bench.get(0x1801, 1), 0x281u32.to_le_bytes());
    bench.heard();
    bench.send(SYNC);
    assert_eq!(bench.heard(), ["181#5002000000000000"]);
    bench.put(0x1400, 1, &0x8000_0201u32.to_le_bytes());
    bench.put(0x1600, 0, &[0]);
    assert_eq!(bench.get(0x2600, 0), [37]);
    // 37 to 40 are the free ones: choosing them changes nothing.
    bench.put(0x2A00, 0, &[40]);
    assert_eq!(bench.get(0x1A00, 0), [3]);
    bench.send(Frame::standard(0x000, [0x81, 1]));
    assert_eq!((bench.get(0x2A00, 0), bench.get(0x1A00, 0)), (vec![1], vec![1]));
}

/// 1001h shows a fault as long as it is there, through a reset too.
#[test]
fn a_fault_outlives_a_reset() {
    let mut bench = Bench::new(Ld2000::node(id(1), 1), Faults::NONE);
    bench.fail(Fault::Motor);
    // The first one counts.
    bench.fail(Fault::Undervoltage);
    assert_eq!(bench.heard(), ["701#00", "081#1043090100000000"]);
    bench.send(Frame::standard(0x000, [0x81, 1]));
    assert_eq!(bench.node.device().state(), ds402::State::Fault);
    assert_eq!((bench.get(0x1001, 0), bench.get(0x1003, 0)), (vec![9], vec![0]));
    bench.heard();
    bench.put(0x6040, 0, &0x80u16.to_le_bytes());
    bench.run(2 * MS);
    assert!(bench.heard().contains(&"081#0000000000000000".to_owned()));
    assert_eq!(bench.get(0x1001, 0), [0]);
}
