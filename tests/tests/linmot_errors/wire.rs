//! A drive that restarts; answers that are lost, repeated or falsified.

use device_sim::linmot::{Times, sg5};
use linmot::code::Status;
use linmot::link::LinkExt;
use linmot::request::{Access, List, Memory, Request, Value};
use linmot::upid::Upid;
use pdo::{Frame, cob};

use crate::bench::*;

#[test]
fn a_drive_that_restarts_is_named() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        bench.link.read(Upid(0x119E), Value::Rom).unwrap();
        bench.link.ask(Request::Restart).unwrap();
        let error = bench.link.read(Upid(0x119E), Value::Rom).unwrap_err().to_string();
        let words = "no answer to read ROM value of parameter by UPID; the drive is off, restarting";
        assert!(error.contains(words), "{error}");
        bench.world().wait(RESTART);
        assert_eq!(bench.link.read(Upid(0x119E), Value::Rom).unwrap(), 8000, "{carrier:?}");

        // A restart that nobody asked for, in the middle of a curve.
        bench.link.start_curve(Access::Add, &info(3)).unwrap();
        {
            let mut world = bench.world();
            // It is back before the answer is given up.
            world.drive().set_times(Times { restart: ANSWER / 2, ..TIMES });
            let now = world.now;
            match &mut world.station {
                Station::Can(node) => node.power_cycle(now),
                Station::LinRs { drive, .. } => drive.power_cycle(now),
            }
        }
        let error = bench.link.write_setpoint(Access::Add, &info(3), 1, 0).unwrap_err().to_string();
        let words = match carrier {
            Carrier::LinRs => "no answer to add curve data (RAM); the drive is off, restarting",
            // Its boot-up message tells.
            _ => "the drive restarted during add curve data (RAM)",
        };
        assert!(error.contains(words) && error.contains("it may have been carried out"), "{error}");
        assert_eq!(bench.link.curve_info(5).unwrap(), None, "{carrier:?}");
        let data = Request::CurveData { access: Access::Add, curve: 5, value: 0 };
        bench.refuses(data, Status::ODD_ADDRESS, "curve 5");
        add(&mut bench.link, &[1, 2, 3]);
    }
}

/// A repeated image has the same count, and a repeated read brings the same.
#[test]
fn a_lost_answer_is_made_up_for_where_that_is_safe() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        bench.link.read(Upid(0x13A2), Value::Ram).unwrap();
        bench.world().lost = 1;
        assert_eq!(bench.link.read(Upid(0x13A2), Value::Ram).unwrap(), 10);
        assert_eq!(bench.world().lost, 0);
        // The answers to a write are lost: over the module the echo is awaited again, otherwise nobody
        // knows, and it is said.
        let writes = bench.world().drive().writes();
        bench.world().lost = 1;
        let write = Request::Write { memory: Memory::Rom, upid: Upid(0x13A2), value: 11 };
        let wrote = bench.link.ask(write);
        if carrier == Carrier::Pdo {
            wrote.unwrap();
        } else {
            let error = wrote.unwrap_err().to_string();
            assert!(error.contains("no answer to write ROM value"), "{error}");
            assert!(error.contains("it may have been carried out all the same"), "{error}");
        }
        assert_eq!(bench.world().drive().writes(), writes + 1, "{carrier:?}: written twice");
    }
}

#[test]
fn a_count_that_is_never_echoed_is_named() {
    let mut bench = Bench::new(Carrier::Pdo);
    bench.link.read(Upid(0x13A2), Value::Ram).unwrap();
    bench.world().lost = usize::MAX;
    let writes = bench.world().drive().writes();
    let error = bench
        .link
        .ask(Request::Write { memory: Memory::Rom, upid: Upid(0x13A2), value: 12 })
        .unwrap_err()
        .to_string();
    assert!(error.contains("no answer to write ROM value"), "{error}");
    // However often its image was repeated.
    assert_eq!(bench.world().drive().writes(), writes + 1);
}

#[test]
fn an_answer_to_something_else_is_named() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        bench.link.read(Upid(0x13A2), Value::Ram).unwrap();
        bench.world().falsified = true;
        let error = bench.link.read(Upid(0x13A2), Value::Rom).unwrap_err().to_string();
        match carrier {
            Carrier::Pdo => assert!(error.contains("wrong answer") && error.contains("expected"), "{error}"),
            Carrier::LinRs => assert!(error.contains("wrong answer"), "{error}"),
            // An answer about another object is no answer to this request.
            Carrier::Sdo => assert!(error.contains("no answer"), "{error}"),
        }
        bench.world().falsified = false;
        assert_eq!(bench.link.read(Upid(0x13A2), Value::Rom).unwrap(), 10, "{carrier:?}");
    }
}

/// A bus may deliver a frame twice: an error in the last bit of a frame is seen by its sender only. A
/// repeated request would skip a word; a repeated answer must not be taken for the next one.
#[test]
fn what_arrives_twice_counts_once() {
    let mut bench = Bench::new(Carrier::Pdo);
    bench.world().twice = true;
    let mut upids = Vec::new();
    bench.link.list(List::All, Upid(0), |item| upids.push(item.upid)).unwrap();
    assert_eq!(upids, sg5().iter().map(|parameter| parameter.upid).collect::<Vec<_>>());
    let setpoints: Vec<i32> = (0..100).map(|n| n * 3).collect();
    add(&mut bench.link, &setpoints);
    let read = bench.link.curve_info(5).unwrap().unwrap();
    let found: Vec<i32> = (1..=100).map(|number| bench.link.read_setpoint(&read, number).unwrap()).collect();
    assert_eq!(found, setpoints);
}

/// Over SDO only the answers: two requests are two commands there.
#[test]
fn an_sdo_answer_that_arrives_twice_counts_once() {
    let mut bench = Bench::new(Carrier::Sdo);
    let setpoints: Vec<i32> = (0..100).map(|n| n * 3).collect();
    add(&mut bench.link, &setpoints);
    let read = bench.link.curve_info(5).unwrap().unwrap();
    let found: Vec<i32> = (1..=100)
        .map(|number| {
            let setpoint = bench.link.read_setpoint(&read, number).unwrap();
            let mut world = bench.world();
            let data = (number as i32 * 1000).to_le_bytes();
            let again = [0x43, 5, 0x20, 0x62, data[0], data[1], data[2], data[3]];
            world.frames.push_back(Frame::standard(cob::SDO_RESPONSE + 1, again));
            setpoint
        })
        .collect();
    assert_eq!(found, setpoints);
}
