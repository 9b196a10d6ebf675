//! LB2 master and virtual controller over the modelled serial line.

use core::time::Duration;

use device_sim::conversation::Conversation;
use device_sim::serial::{Fault, Faults, LineConfig};
use lb2::code::{ErrorCode, Failure, LoaderCode};
use lb2::device::{Device, LineError};
use lb2::frame::MAX_WIRE;
use lb2::master::Outcome;
use lb2::telegram::{Request, Response};
use motion_core::parameters::{Values, iter};
use motion_core::{Controller, Model, STORAGE_LEN};

type Virtual = Controller<Vec<u8>, Vec<u8>>;

const ANSWER: Duration = Duration::from_millis(15);

fn controller() -> Virtual {
    Controller::power_on(Model::Gel8231, vec![0xFF; STORAGE_LEN], vec![0; 65536])
}

fn line(faults: Faults) -> Conversation<Virtual> {
    let mut line = Conversation::new(LineConfig::default(), faults);
    line.connect(controller(), ANSWER);
    line
}

fn done(line: &mut Conversation<Virtual>, request: &Request<'_>) -> String {
    line.ask(request, 0, |outcome| match outcome {
        Outcome::Done(response) => format!("{response:?}"),
        other => format!("{other:?}"),
    })
}

/// A full backup over 19,200 baud 8E1 takes at most 1.02 times what its telegrams and the device's
/// answer times take.
#[test]
fn a_backup_wastes_no_time_on_the_line() {
    let mut line = line(Faults::NONE);
    let mut least = Duration::ZERO;
    let mut backup = Vec::new();
    for entry in iter() {
        let request = Request::ReadParameter { index: entry.index() };
        let mut wire = [0; MAX_WIRE];
        let mut characters = request.encode(&mut wire).unwrap() as u64;
        let value = line.ask(&request, 2, |outcome| match outcome {
            Outcome::Done(response @ Response::Parameter { value, .. }) => {
                characters += response.encode(&mut wire).unwrap() as u64;
                value
            }
            other => panic!("{other:?}"),
        });
        backup.push(value);
        least += LineConfig::default().time(characters) + ANSWER;
    }
    let ratio = line.now().as_secs_f64() / least.as_secs_f64();
    println!(
        "backup of {} parameters: {:?}, {ratio:.6} of the least possible {least:?}",
        backup.len(),
        line.now()
    );
    assert_eq!(backup, Values::factory().as_array());
    assert!((1.0..=1.02).contains(&ratio), "{ratio}");
}

/// Error codes 01h…05h are answers to faults on the line, each stored as a failure.
#[test]
fn faults_on_the_line_come_back_as_error_telegrams() {
    let cases = [
        (Fault::Mark(LineError::Parity), ErrorCode::PARITY, Failure::PARITY),
        (Fault::Flip(0x10), ErrorCode::PARITY, Failure::PARITY),
        (Fault::Mark(LineError::StopBit), ErrorCode::STOP_BIT, Failure::STOP_BIT),
        (Fault::Mark(LineError::Overwrite), ErrorCode::OVERWRITE, Failure::OVERWRITE),
        (Fault::Flip(0x11), ErrorCode::CHECK_BYTE, Failure::CHECK_BYTE),
        (Fault::Drop, ErrorCode::NUMBER, Failure::RECEIVE_COUNT),
    ];
    for (fault, code, failure) in cases {
        let mut line = line(Faults::NONE);
        // The third byte of the data of "write 7 to parameter [005]".
        line.wires().0.script(6, fault);
        let refused = line.ask(&Request::WriteParameter { index: 5, value: 7 }, 0, |outcome| {
            outcome == Outcome::Refused(code)
        });
        assert!(refused, "{fault:?}");
        let device = line.device(0).unwrap();
        assert_eq!((device.read_parameter(5), device.failure_count()), (0, 1), "{fault:?}");
        assert_eq!(device.failure(0).map(|stored| stored.failure), Some(failure));
    }
}

/// Every function and sub-function of the manual, on both engines.
#[test]
fn every_function_over_the_line() {
    let mut line = line(Faults::NONE);
    let mut is =
        |request: Request<'_>, answer: &str| assert_eq!(done(&mut line, &request), answer, "{request:?}");
    is(Request::SelectDevice(3), "Selected(3)");
    is(Request::DeviceType, "DeviceType { device: 8231, axes: 6 }");
    is(Request::OsVersion, "OsVersion(Version { version: 5, revision: 15 })");
    is(Request::CustomVersion, "CustomVersion(Version { version: 0, revision: 0 })");
    is(Request::Raw { function: 0x40, data: &[1] }, "Refused(ErrorCode(05h: number error))");
    is(
        Request::Failures,
        "Failures([StoredFailure { axis: 0, failure: Failure(28h: number of errors for the serial communication) }])",
    );
    is(Request::FailureCount, "FailureCount(1)");
    is(Request::DeleteFailures, "FailuresDeleted(1)");
    is(Request::EraseFlash { bank: 15 }, "FlashErased { bank: 15 }");
    is(Request::WriteFlash { bank: 15, enable: true, data: &[1, 2] }, "FlashWritten { bank: 15 }");
    is(
        Request::WriteFlash { bank: 15, enable: false, data: &[1, 2] },
        "Refused(ErrorCode(24h: flash write protection))",
    );
    is(Request::WriteFlashAt { bank: 15, offset: 2, data: &[3, 4] }, "FlashWrittenAt { bank: 15 }");
    is(
        Request::WriteFlashAt { bank: 15, offset: 2, data: &[3, 4] },
        "Refused(ErrorCode(23h: flash write error))",
    );
    is(Request::WriteFlashAt { bank: 15, offset: 4, data: &[3] }, "Refused(ErrorCode(26h: uneven number))");
    is(
        Request::ReadFlash { bank: 15, offset: 0, count: 5 },
        "FlashData { bank: 15, data: [1, 2, 3, 4, 255] }",
    );
    is(
        Request::ReadFlash { bank: 14, offset: 0, count: 5 },
        "Refused(ErrorCode(21h: wrong flash/RAM bank number))",
    );
    is(
        Request::ReadFlash { bank: 15, offset: 0, count: 129 },
        "Refused(ErrorCode(25h: number of values too large))",
    );
    is(Request::ReadFlash { bank: 15, offset: 0xFFFF, count: 2 }, "Refused(ErrorCode(27h: range overflow))");
    is(Request::WriteRam { bank: 12, offset: 9, data: &[0x82, 0x96] }, "RamWritten { bank: 12 }");
    is(Request::ReadRam { bank: 12, offset: 8, count: 4 }, "RamData { bank: 12, data: [0, 130, 150, 0] }");
    is(
        Request::WriteParameter { index: 642, value: 5083 },
        "ParameterWritten { index: 642, loader: LoaderCode(00h: OK) }",
    );
    is(Request::ReadParameter { index: 642 }, "Parameter { index: 642, value: 5083 }");
    is(
        Request::WriteParameterExtended { index: 642, value: -1 },
        "ParameterWrittenExtended { index: 642, loader: LoaderCode(81h: see the parameter), text: \"Value out of range\" }",
    );
    is(
        Request::DescribeParameter { index: 1 },
        "ParameterDescription(Description { index: 1, variant: \"DEUTSCH\", minimum: 0, maximum: 1, default: 0, name: \"Languages\", group: \"General\" })",
    );
    is(Request::CallLoader, "LoaderCalled { offset: -1 }");
    is(Request::SaveParameters, "ParametersSaved");
    is(Request::Raw { function: 0x77, data: &[] }, "Refused(ErrorCode(10h: wrong function number))");
    is(Request::Raw { function: 0xCC, data: &[0x77] }, "Refused(ErrorCode(20h: wrong sub-function number))");
}

/// Decision 1: a read of 126 bytes and a write of 124 have the number 82h.
#[test]
fn the_number_byte_82h_crosses_the_line_both_ways() {
    let mut line = line(Faults::NONE);
    let data: Vec<u8> = (0..124).collect();
    assert_eq!(
        done(&mut line, &Request::WriteRam { bank: 12, offset: 0, data: &data }),
        "RamWritten { bank: 12 }"
    );
    let ok = line.ask(&Request::ReadRam { bank: 12, offset: 0, count: 126 }, 0, |outcome| match outcome {
        Outcome::Done(Response::RamData { data: found, .. }) => {
            found[..124] == data && found[124..] == [0, 0]
        }
        other => panic!("{other:?}"),
    });
    assert!(ok);
}

/// Manual A: "a controller with device number 0 will always answer".
#[test]
fn a_device_0_among_others_is_reported() {
    let mut line = line(Faults::NONE);
    let mut other = controller();
    assert_eq!(other.write_parameter(5, 4).code, LoaderCode::OK);
    assert_eq!(other.call_loader(), -1);
    line.connect(other, ANSWER + Duration::from_millis(20));
    assert_eq!(done(&mut line, &Request::SelectDevice(4)), "Selected(4)");
    line.settle();
    assert_eq!(line.remarks(), (1, 0));
    assert_eq!(done(&mut line, &Request::SelectDevice(9)), "Selected(9)");
    line.settle();
    assert_eq!(line.remarks(), (1, 0), "only device 0 answers for a device that is not there");
}

/// On a bad line every request has an outcome, reads with repeats come through, and no write is
/// carried out that was refused.
#[test]
fn a_noisy_line_loses_nothing() {
    let faults = Faults {
        seed: 7,
        flip: 400,
        double_flip: 400,
        drop: 400,
        double: 400,
        insert: 400,
        parity: 400,
        stop_bit: 400,
        overwrite: 400,
    };
    let mut line = line(faults);
    let mut outcomes = [0; 3];
    for n in 0..500 {
        let value = n % 32;
        let before = line.device(0).unwrap().read_parameter(5);
        let outcome = line.ask(&Request::WriteParameter { index: 5, value }, 0, |outcome| match outcome {
            Outcome::Done(_) => 0,
            Outcome::Refused(code) if code.is_transmission() => 1,
            Outcome::TimedOut(_) => 2,
            other => panic!("{other:?}"),
        });
        outcomes[outcome] += 1;
        let after = line.device(0).unwrap().read_parameter(5);
        match outcome {
            0 => assert_eq!(after, value),
            1 => assert_eq!(after, before),
            _ => assert!(after == value || after == before),
        }
    }
    println!("done, refused, timed out: {outcomes:?}; wires {:?}", line.wires().0.counts());
    assert!(outcomes.iter().all(|count| *count > 10), "{outcomes:?}");
}
