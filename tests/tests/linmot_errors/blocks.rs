//! Curves and command table: blocks of another size, finished, begun and not ended; flash while the software runs.

use core::time::Duration;

use device_sim::linmot::Times;
use linmot::code::Status;
use linmot::drive::Drive;
use linmot::link::LinkExt;
use linmot::request::{Access, Memory, Request, Value};
use linmot::table::Entry;
use linmot::upid::Upid;

use crate::bench::*;

#[test]
fn curve_errors() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        let start = |access, data| Request::StartCurve { access, curve: 5, info: 70, data };
        bench.refuses(start(Access::Get, 0), Status::DEFINED, "curve 5: start getting curve");
        bench.refuses(start(Access::Modify, 8), Status::DEFINED, "curve 5: start modifying curve");
        bench.refuses(start(Access::Add, 4), Status::SIZE, "curve 5");
        bench.refuses(start(Access::Add, 10), Status::SIZE, "curve 5");
        add(&mut bench.link, &[0, 7]);
        // The block is finished.
        let data = Request::CurveData { access: Access::Add, curve: 5, value: 9 };
        bench.refuses(data, Status::ODD_ADDRESS, "curve 5: add curve data");
        let word = Request::CurveInfo { access: Access::Add, curve: 5, value: 9 };
        bench.refuses(word, Status::ODD_ADDRESS, "curve 5: add curve info block");
        // The curve exists.
        bench.refuses(start(Access::Add, 8), Status::DEFINED, "curve 5: start adding curve");
        bench.refuses(start(Access::Modify, 12), Status::SIZE, "curve 5");
        assert_eq!(bench.world().drive().curve_in_ram(5).unwrap().data, [0, 7], "{carrier:?}");
        let read = bench.link.curve_info(5).unwrap().unwrap();
        assert_eq!(read, info(2));
        assert_eq!([1, 2].map(|number| bench.link.read_setpoint(&read, number).unwrap()), [0, 7]);
        let data = Request::CurveData { access: Access::Get, curve: 5, value: 0 };
        bench.refuses(data, Status::ODD_ADDRESS, "block already finished");
        // Flash is written only while the software is stopped.
        bench.refuses(Request::SaveCurves, Status::NOT_STOPPED, "save all curves");
        bench.link.ask(Request::Stop).unwrap();
        bench.link.ask(Request::SaveCurves).unwrap();
        bench.link.ask(Request::Start).unwrap();
    }
}

#[test]
fn command_table_errors() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        bench.refuses(Request::GetEntry { entry: 9 }, Status::DEFINED, "entry 9");
        bench.refuses(Request::DeleteEntry { entry: 9 }, Status::DEFINED, "entry 9");
        bench.refuses(Request::WriteEntry { entry: 9, size: 62 }, Status::SIZE, "entry 9");
        bench.refuses(Request::WriteEntry { entry: 300, size: 64 }, Status::DEFINED, "entry 300");
        bench.refuses(Request::GetEntryData { entry: 9 }, Status::ODD_ADDRESS, "entry 9");
        let entry = Entry::new(0x100, [7; 32]);
        bench.link.write_entry(9, &entry).unwrap();
        let data = Request::WriteEntryData { entry: 9, value: 1 };
        bench.refuses(data, Status::ODD_ADDRESS, "block already finished");
        assert_eq!(bench.link.read_entry(9).unwrap(), entry, "{carrier:?}");
        bench.refuses(Request::GetEntryData { entry: 9 }, Status::ODD_ADDRESS, "block already finished");
        bench.refuses(Request::SaveTable, Status::NOT_STOPPED, "command table: save to flash");
    }
}

/// What was begun and not ended is not there, and what was there is as it was.
#[test]
fn nothing_is_left_half_written() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        let entry = Entry::new(0x100, [7; 32]);
        bench.link.write_entry(9, &entry).unwrap();
        bench.link.ask(Request::WriteEntry { entry: 9, size: 64 }).unwrap();
        bench.link.ask(Request::WriteEntryData { entry: 9, value: 0xA701 }).unwrap();
        assert_eq!(bench.link.read_entry(9).unwrap(), entry, "{carrier:?}");

        bench.link.start_curve(Access::Add, &info(3)).unwrap();
        bench.link.write_setpoint(Access::Add, &info(3), 1, 1).unwrap();
        assert_eq!(bench.link.curve_info(5).unwrap(), None, "{carrier:?}");
        add(&mut bench.link, &[1, 2, 3]);
        let mut other = info(3);
        other.x_length = 30_000;
        bench.link.start_curve(Access::Modify, &other).unwrap();
        bench.link.write_setpoint(Access::Modify, &other, 1, 9).unwrap();
        // The info block ended, the setpoints did not.
        let curve = bench.world().drive().curve_in_ram(5).cloned().unwrap();
        assert_eq!((curve.data, curve.info), (vec![1, 2, 3], other.encode()), "{carrier:?}");
        // A block that contradicts itself is refused as a whole.
        let start = Request::StartCurve { access: Access::Modify, curve: 5, info: 70, data: 12 };
        bench.link.ask(start).unwrap();
        let mut wrong = other;
        wrong.setpoints = 4;
        let words = wrong.encode();
        for value in &words[..17] {
            bench.link.ask(Request::CurveInfo { access: Access::Modify, curve: 5, value: *value }).unwrap();
        }
        let last = Request::CurveInfo { access: Access::Modify, curve: 5, value: words[17] };
        bench.refuses(last, Status::SIZE, "curve 5");
        assert_eq!(bench.world().drive().curve_in_ram(5).unwrap().info, other.encode(), "{carrier:?}");
    }
}

/// Flash is being written for somebody else: the command is carried out when that is over, and once.
#[test]
fn a_busy_drive_is_asked_again() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        bench.link.read(Upid(0x13A2), Value::Ram).unwrap();
        for flash in [Duration::from_millis(400), Duration::from_secs(60)] {
            let began = {
                let mut world = bench.world();
                let (now, times) = (world.now, Times { flash, ..TIMES });
                world.drive().set_times(times);
                world.drive().save_curves(now);
                now
            };
            let read = bench.link.read(Upid(0x13A2), Value::Ram);
            let waited = bench.world().now - began;
            if flash < Duration::from_secs(15) {
                assert_eq!(read.unwrap(), 10, "{carrier:?}");
                assert!(waited < flash + Duration::from_millis(100), "{carrier:?}: {waited:?}");
                let writes = bench.world().drive().writes();
                bench
                    .link
                    .ask(Request::Write { memory: Memory::Rom, upid: Upid(0x13A2), value: 10 })
                    .unwrap();
                assert_eq!(bench.world().drive().writes(), writes + 1, "{carrier:?}");
            } else {
                let error = read.unwrap_err().to_string();
                assert!(
                    error.contains("the drive is still busy with read RAM value"),
                    "{carrier:?}: {error}"
                );
                assert!(waited < Duration::from_secs(31), "{carrier:?}: {waited:?}");
                let write = Request::Write { memory: Memory::Rom, upid: Upid(0x13A2), value: 11 };
                let error = bench.link.ask(write).unwrap_err().to_string();
                assert!(error.contains("it may have been carried out all the same"), "{carrier:?}: {error}");
            }
        }
    }
}

/// A command that was under way when the drive lost its power is not called done because the drive, which
/// has started anew, is not busy any more.
#[test]
fn a_restart_while_flash_is_written_is_named() {
    for (carrier, words) in [
        (Carrier::Sdo, "restarted during"),
        (Carrier::Pdo, "restarted during"),
        (Carrier::LinRs, "no answer to"),
    ] {
        for after in [5, 30, 100, 250] {
            let mut bench = Bench::new(carrier);
            add(&mut bench.link, &[0, 7]);
            bench.link.ask(Request::Stop).unwrap();
            {
                let mut world = bench.world();
                let times = Times { restart: Duration::from_millis(3), ..TIMES };
                world.drive().set_times(times);
                world.power_fails = Some(world.now + Duration::from_millis(after));
            }
            let error =
                bench.link.ask(Request::SaveCurves).expect_err(&format!("{carrier:?} {after}")).to_string();
            assert!(error.contains(words), "{carrier:?} {after}: {error}");
            assert!(error.contains("may have been carried out"), "{carrier:?} {after}: {error}");
        }
    }
}
