//! Scripted conversations of the device engine on virtual time, with a small device of its own.

use core::time::Duration;

use lb2::code::{ErrorCode, Failure, LoaderCode, StoredFailure, Version};
use lb2::device::{Device, DeviceEngine, LineError, LoaderAnswer};
use lb2::frame::{Decoder, Item, MAX_WIRE};
use lb2::telegram::{Description, Request, Response, Text};

const fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// A device with one parameter, two bytes of each bank, and a function 77h that turns its data round.
struct Small {
    number: u8,
    failures: Vec<StoredFailure>,
    flash: [u8; 2],
    parameter: i32,
}

fn small(number: u8) -> Small {
    Small { number, failures: Vec::new(), flash: [0xFF; 2], parameter: 7 }
}

impl Device for Small {
    fn device_number(&self) -> u8 {
        self.number
    }
    fn device_type(&self) -> (u16, u8) {
        (8231, 6)
    }
    fn os_version(&self) -> Version {
        Version { version: 5, revision: 15 }
    }
    fn custom_version(&self) -> Version {
        Version { version: 0, revision: 0 }
    }
    fn failure_count(&self) -> u8 {
        self.failures.len() as u8
    }
    fn failure(&self, position: u8) -> Option<StoredFailure> {
        self.failures.get(usize::from(position)).copied()
    }
    fn delete_failures(&mut self) -> u8 {
        self.failures.drain(..).count() as u8
    }
    fn store_failure(&mut self, failure: StoredFailure) {
        self.failures.push(failure);
    }
    fn erase_flash(&mut self, _: u8) -> Result<(), ErrorCode> {
        self.flash = [0xFF; 2];
        Ok(())
    }
    fn read_flash(&self, _: u8, offset: u16, out: &mut [u8]) -> Result<(), ErrorCode> {
        out.iter_mut().zip(&self.flash[usize::from(offset)..]).for_each(|(to, from)| *to = *from);
        Ok(())
    }
    fn write_flash(&mut self, bank: u8, enable: bool, data: &[u8]) -> Result<(), ErrorCode> {
        if enable { self.write_flash_at(bank, 0, data) } else { Err(ErrorCode::FLASH_PROTECTED) }
    }
    fn write_flash_at(&mut self, _: u8, _: u16, data: &[u8]) -> Result<(), ErrorCode> {
        if self.flash != [0xFF; 2] {
            return Err(ErrorCode::FLASH_WRITE);
        }
        self.flash.copy_from_slice(data);
        Ok(())
    }
    fn read_ram(&self, _: u8, _: u16, out: &mut [u8]) -> Result<(), ErrorCode> {
        out.fill(0x82);
        Ok(())
    }
    fn write_ram(&mut self, _: u8, _: u16, _: &[u8]) -> Result<(), ErrorCode> {
        Ok(())
    }
    fn read_parameter(&self, index: u16) -> i32 {
        if index == 5 { self.parameter } else { 0 }
    }
    fn describe_parameter(&self, _: u16) -> Description<'_> {
        Description { name: Text::from("Device number"), maximum: 31, ..Description::default() }
    }
    fn write_parameter(&mut self, index: u16, value: i32) -> LoaderAnswer<'_> {
        if index != 5 || !(0..=31).contains(&value) {
            return LoaderAnswer { code: LoaderCode(0x80), text: Text::from("Value out of range") };
        }
        self.parameter = value;
        LoaderAnswer { code: LoaderCode::OK, text: Text::default() }
    }
    fn call_loader(&mut self) -> i32 {
        if self.parameter == 13 { 5 } else { -1 }
    }
    fn save_parameters(&mut self) -> Result<(), ErrorCode> {
        Err(ErrorCode::FLASH_WRITE)
    }
    fn own_function(&mut self, function: u8, data: &[u8], reply: &mut [u8]) -> Result<usize, ErrorCode> {
        match function {
            0x77 | 0xFF => {
                reply.iter_mut().zip(data.iter().rev()).for_each(|(to, from)| *to = *from);
                Ok(data.len())
            }
            0xCC => Err(ErrorCode::SUB_FUNCTION),
            _ => Err(ErrorCode::FUNCTION),
        }
    }
}

/// Sends a request and checks the answer.
#[track_caller]
fn asks(engine: &mut DeviceEngine, device: &mut Small, request: Request<'_>, answer: Option<Response<'_>>) {
    let mut out = [0; MAX_WIRE];
    let len = request.encode(&mut out).unwrap();
    engine.handle_bytes(ms(0), &out[..len], device);
    sends(engine, answer);
}

#[track_caller]
fn sends(engine: &mut DeviceEngine, answer: Option<Response<'_>>) {
    let sent = engine.poll_transmit(ms(0)).map(<[u8]>::to_vec);
    assert_eq!(engine.poll_transmit(ms(0)), None, "an answer is sent once");
    let mut decoder = Decoder::new();
    match (decoder.decode(sent.as_deref().unwrap_or(&[])).1, answer) {
        (Some(Item::Frame { frame, .. }), answer) => assert_eq!(Response::parse(&frame).ok(), answer),
        (None, None) => {}
        other => panic!("{other:?}"),
    }
}

#[test]
fn every_function_is_answered() {
    let (mut engine, mut device) = (DeviceEngine::default(), small(0));
    let mut is = |request, answer| asks(&mut engine, &mut device, request, Some(answer));
    is(Request::SelectDevice(9), Response::Selected(9));
    is(Request::DeviceType, Response::DeviceType { device: 8231, axes: 6 });
    is(Request::OsVersion, Response::OsVersion(Version { version: 5, revision: 15 }));
    is(Request::CustomVersion, Response::CustomVersion(Version { version: 0, revision: 0 }));
    is(Request::FailureCount, Response::FailureCount(0));
    let flash = |data| Request::WriteFlashAt { bank: 16, offset: 0, data };
    is(flash(&[1, 2]), Response::FlashWrittenAt { bank: 16 });
    is(flash(&[1, 2]), Response::Error(ErrorCode::FLASH_WRITE));
    is(flash(&[1]), Response::Error(ErrorCode::UNEVEN));
    is(Request::ReadFlash { bank: 16, offset: 0, count: 2 }, Response::FlashData { bank: 16, data: &[1, 2] });
    is(Request::EraseFlash { bank: 16 }, Response::FlashErased { bank: 16 });
    is(Request::EraseFlash { bank: 17 }, Response::Error(ErrorCode::BANK));
    let flash = |enable| Request::WriteFlash { bank: 15, enable, data: &[3, 4] };
    is(flash(false), Response::Error(ErrorCode::FLASH_PROTECTED));
    is(flash(true), Response::FlashWritten { bank: 15 });
    let data = [0x82; 126];
    is(Request::ReadRam { bank: 12, offset: 0, count: 126 }, Response::RamData { bank: 12, data: &data });
    is(Request::ReadRam { bank: 12, offset: 0, count: 129 }, Response::Error(ErrorCode::TOO_MANY));
    is(Request::ReadRam { bank: 12, offset: 65535, count: 2 }, Response::Error(ErrorCode::RANGE));
    is(Request::WriteRam { bank: 12, offset: 0, data: &data[..124] }, Response::RamWritten { bank: 12 });
    is(Request::ReadParameter { index: 5 }, Response::Parameter { index: 5, value: 7 });
    is(
        Request::DescribeParameter { index: 5 },
        Response::ParameterDescription(Description {
            index: 5,
            maximum: 31,
            name: Text::from("Device number"),
            ..Description::default()
        }),
    );
    is(
        Request::WriteParameter { index: 5, value: 13 },
        Response::ParameterWritten { index: 5, loader: LoaderCode::OK },
    );
    is(Request::CallLoader, Response::LoaderCalled { offset: 5 });
    is(
        Request::WriteParameterExtended { index: 5, value: 32 },
        Response::ParameterWrittenExtended {
            index: 5,
            loader: LoaderCode(0x80),
            text: Text::from("Value out of range"),
        },
    );
    is(Request::SaveParameters, Response::Error(ErrorCode::FLASH_WRITE));
    is(Request::Raw { function: 0x77, data: &[1, 2] }, Response::Raw { function: 0x77, data: &[2, 1] });
    is(Request::Raw { function: 0x78, data: &[] }, Response::Error(ErrorCode::FUNCTION));
    is(Request::Raw { function: 0xCC, data: &[0x20] }, Response::Error(ErrorCode::SUB_FUNCTION));
    is(Request::Raw { function: 0xCC, data: &[] }, Response::Error(ErrorCode::SUB_FUNCTION));
    is(Request::Raw { function: 0x40, data: &[1] }, Response::Error(ErrorCode::NUMBER));
    is(Request::Failures, Response::Failures(lb2::telegram::Failures::new(&[0, Failure::RECEIVE_COUNT.0])));
    is(Request::DeleteFailures, Response::FailuresDeleted(1));
}

/// Found by fuzzing: FFh is a reply only, its echo would read as an error telegram.
#[test]
fn function_ffh_never_reaches_the_device() {
    let (mut engine, mut device) = (DeviceEngine::default(), small(0));
    let request = Request::Raw { function: 0xFF, data: &[1, 2, 3] };
    asks(&mut engine, &mut device, request, Some(Response::Error(ErrorCode::FUNCTION)));
}

/// Decision 8.
#[test]
fn only_the_selected_device_answers() {
    let (mut engine, mut device) = (DeviceEngine::default(), small(3));
    let version = Response::OsVersion(Version { version: 5, revision: 15 });
    asks(&mut engine, &mut device, Request::OsVersion, Some(version));
    asks(&mut engine, &mut device, Request::SelectDevice(4), None);
    asks(&mut engine, &mut device, Request::OsVersion, None);
    asks(&mut engine, &mut device, Request::Raw { function: 0x40, data: &[1] }, None);
    asks(&mut engine, &mut device, Request::SelectDevice(3), Some(Response::Selected(3)));
    asks(&mut engine, &mut device, Request::OsVersion, Some(version));
    assert!(device.failures.is_empty(), "{:?}", device.failures);
}

#[test]
fn damage_is_stored_at_once_and_answered_when_the_line_is_silent() {
    let cases: [(&[u8], Failure, ErrorCode); 5] = [
        (&[0x82, 0x96, 0x02, 0x40, 0x43], Failure::CHECK_BYTE, ErrorCode::CHECK_BYTE),
        (&[0x82, 0x96, 0x05, 0x82, 0x40], Failure::REPEAT_MISSING, ErrorCode::CHECK_BYTE),
        (&[0x82, 0x96, 0x01, 0x01], Failure::RECEIVE_COUNT, ErrorCode::NUMBER),
        (&[0x82, 0x96, 0x05, 0x40], Failure::RECEIVE_COUNT, ErrorCode::NUMBER),
        (&[0x82, 0x96, 0x05, 0x82, 0x96, 0x01], Failure::RECEIVE_COUNT, ErrorCode::NUMBER),
    ];
    for (bytes, failure, code) in cases {
        let (mut engine, mut device) = (DeviceEngine::default(), small(0));
        engine.handle_bytes(ms(1), bytes, &mut device);
        assert_eq!(engine.poll_transmit(ms(1)), None);
        assert_eq!(engine.poll_timeout(), Some(ms(11)));
        engine.handle_timeout(ms(10), &mut device);
        assert_eq!(engine.poll_transmit(ms(10)), None, "an early call does nothing");
        engine.handle_timeout(ms(11), &mut device);
        sends(&mut engine, Some(Response::Error(code)));
        assert!(device.failures.iter().all(|stored| *stored == StoredFailure { axis: 0, failure }));
        assert!(!device.failures.is_empty());
        assert_eq!(engine.poll_timeout(), None);
    }
}

/// Parity 01h/27, stop bit 02h/26, overwrite 03h/34; the telegram they befall is not carried out.
#[test]
fn line_errors_leave_as_error_telegrams_and_failures() {
    for (error, code, failure) in [
        (LineError::Parity, ErrorCode::PARITY, Failure::PARITY),
        (LineError::StopBit, ErrorCode::STOP_BIT, Failure::STOP_BIT),
        (LineError::Overwrite, ErrorCode::OVERWRITE, Failure::OVERWRITE),
    ] {
        let (mut engine, mut device) = (DeviceEngine::default(), small(0));
        engine.handle_bytes(ms(1), &[0x82, 0x96, 0x09, 0xCC, 0x32, 0x05, 0x00, 0x0D], &mut device);
        engine.handle_line_error(ms(2), error, &mut device);
        engine.handle_bytes(ms(3), &[0x00, 0x00, 0xFF], &mut device);
        assert_eq!(engine.poll_timeout(), Some(ms(13)));
        engine.handle_timeout(ms(13), &mut device);
        sends(&mut engine, Some(Response::Error(code)));
        assert_eq!(device.failures, [StoredFailure { axis: 0, failure }]);
        assert_eq!(device.parameter, 7);
    }
}

#[test]
fn a_good_telegram_after_damage_is_answered_in_its_place() {
    let (mut engine, mut device) = (DeviceEngine::default(), small(0));
    engine.handle_bytes(ms(1), &[0x82, 0x96, 0x03, 0x40, 0x00, 0x00], &mut device);
    engine.handle_bytes(ms(2), &[0x82, 0x96, 0x02, 0x52, 0x50], &mut device);
    sends(&mut engine, Some(Response::FailureCount(1)));
    assert_eq!(engine.poll_timeout(), None);
}

#[test]
fn bytes_between_telegrams_are_no_failure() {
    let (mut engine, mut device) = (DeviceEngine::default(), small(0));
    engine.handle_bytes(ms(1), &[0x00, 0xFF, 0x96], &mut device);
    assert_eq!((engine.poll_timeout(), engine.decoder().discarded()), (None, 3));
    assert!(device.failures.is_empty());
}
