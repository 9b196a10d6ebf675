//! Golden telegrams of manual A, Appendix 1, byte for byte, in both directions.

use lb2::code::{ErrorCode, LoaderCode, Version};
use lb2::frame::{Decoder, Frame, Item, MAX_WIRE};
use lb2::telegram::{Description, Failures, NumberError, Request, Response, Text};

fn decoded(wire: &[u8], check: impl FnOnce(&Frame<'_>)) {
    let mut decoder = Decoder::new();
    let (taken, item) = decoder.decode(wire);
    let Some(Item::Frame { frame, .. }) = item else { panic!("{wire:02X?}: {item:?}") };
    assert_eq!(taken, wire.len());
    check(&frame);
}

#[track_caller]
fn request(wire: &[u8], request: Request<'_>) {
    let mut out = [0xA5; MAX_WIRE];
    let len = request.encode(&mut out).unwrap();
    assert_eq!(out[..len], *wire, "{request:?}");
    decoded(wire, |frame| assert_eq!(Request::parse(frame), Ok(request)));
}

#[track_caller]
fn response(wire: &[u8], response: Response<'_>) {
    let mut out = [0xA5; MAX_WIRE];
    let len = response.encode(&mut out).unwrap();
    assert_eq!(out[..len], *wire, "{response:?}");
    decoded(wire, |frame| assert_eq!(Response::parse(frame), Ok(response)));
}

/// "Calling the MotionController with the number 2", both ways.
#[test]
fn select_device() {
    request(&[0x82, 0x96, 0x03, 0x00, 0x02, 0x01], Request::SelectDevice(2));
    response(&[0x82, 0x96, 0x03, 0x00, 0x02, 0x01], Response::Selected(2));
}

/// The check bytes that the manual prints: 42h, 43h, 41h, 52h, 50h, 51h.
#[test]
fn standard_functions() {
    request(&[0x82, 0x96, 0x02, 0x40, 0x42], Request::DeviceType);
    response(
        &[0x82, 0x96, 0x05, 0x40, 0x26, 0x20, 0x06, 0x45],
        Response::DeviceType { device: 8230, axes: 6 },
    );
    request(&[0x82, 0x96, 0x02, 0x41, 0x43], Request::OsVersion);
    response(
        &[0x82, 0x96, 0x06, 0x41, 0x05, 0x00, 0x01, 0x00, 0x43],
        Response::OsVersion(Version { version: 5, revision: 1 }),
    );
    request(&[0x82, 0x96, 0x02, 0x43, 0x41], Request::CustomVersion);
    response(
        &[0x82, 0x96, 0x06, 0x43, 0, 0, 0, 0, 0x45],
        Response::CustomVersion(Version { version: 0, revision: 0 }),
    );
    request(&[0x82, 0x96, 0x02, 0x50, 0x52], Request::Failures);
    response(&[0x82, 0x96, 0x02, 0x50, 0x52], Response::Failures(Failures::new(&[])));
    response(
        &[0x82, 0x96, 0x06, 0x50, 0x01, 0x05, 0x00, 0x27, 0x75],
        Response::Failures(Failures::new(&[1, 5, 0, 39])),
    );
    request(&[0x82, 0x96, 0x02, 0x52, 0x50], Request::FailureCount);
    response(&[0x82, 0x96, 0x03, 0x52, 0x14, 0x45], Response::FailureCount(20));
    request(&[0x82, 0x96, 0x02, 0x53, 0x51], Request::DeleteFailures);
    response(&[0x82, 0x96, 0x03, 0x53, 0x02, 0x52], Response::FailuresDeleted(2));
}

#[test]
fn banks() {
    request(&[0x82, 0x96, 0x04, 0xCC, 0x21, 0x0F, 0xE6], Request::EraseFlash { bank: 15 });
    response(&[0x82, 0x96, 0x04, 0xCC, 0x21, 0x0F, 0xE6], Response::FlashErased { bank: 15 });
    request(
        &[0x82, 0x96, 0x07, 0xCC, 0x22, 0x10, 0x34, 0x12, 0x80, 0x5F],
        Request::ReadFlash { bank: 16, offset: 0x1234, count: 0x80 },
    );
    response(
        &[0x82, 0x96, 0x06, 0xCC, 0x22, 0x10, 0xAA, 0x55, 0x07],
        Response::FlashData { bank: 16, data: &[0xAA, 0x55] },
    );
    request(
        &[0x82, 0x96, 0x07, 0xCC, 0x23, 0x0F, 0x01, 0xAA, 0x55, 0x19],
        Request::WriteFlash { bank: 15, enable: true, data: &[0xAA, 0x55] },
    );
    response(&[0x82, 0x96, 0x04, 0xCC, 0x23, 0x0F, 0xE4], Response::FlashWritten { bank: 15 });
    request(
        &[0x82, 0x96, 0x07, 0xCC, 0x24, 0x0C, 0xFF, 0xFF, 0x01, 0xE2],
        Request::ReadRam { bank: 12, offset: 0xFFFF, count: 1 },
    );
    response(&[0x82, 0x96, 0x05, 0xCC, 0x24, 0x0C, 0x07, 0xE6], Response::RamData { bank: 12, data: &[7] });
    request(
        &[0x82, 0x96, 0x07, 0xCC, 0x25, 0x0C, 0x00, 0x01, 0x07, 0xE4],
        Request::WriteRam { bank: 12, offset: 0x100, data: &[7] },
    );
    response(&[0x82, 0x96, 0x04, 0xCC, 0x25, 0x0C, 0xE1], Response::RamWritten { bank: 12 });
    request(
        &[0x82, 0x96, 0x08, 0xCC, 0x26, 0x10, 0x00, 0x01, 0x07, 0x08, 0xFC],
        Request::WriteFlashAt { bank: 16, offset: 0x100, data: &[7, 8] },
    );
    response(&[0x82, 0x96, 0x04, 0xCC, 0x26, 0x10, 0xFE], Response::FlashWrittenAt { bank: 16 });
}

/// "50.83 user measuring units = 5083 display units = 000013DBh (transmission: DB 13 00 00)."
#[test]
fn parameters() {
    request(&[0x82, 0x96, 0x05, 0xCC, 0x30, 0x82, 0x82, 0x02, 0x79], Request::ReadParameter { index: 642 });
    response(
        &[0x82, 0x96, 0x09, 0xCC, 0x30, 0x05, 0x00, 0xDB, 0x13, 0x00, 0x00, 0x38],
        Response::Parameter { index: 5, value: 5083 },
    );
    request(&[0x82, 0x96, 0x05, 0xCC, 0x31, 0x20, 0x00, 0xD8], Request::DescribeParameter { index: 32 });
    request(
        &[0x82, 0x96, 0x09, 0xCC, 0x32, 0x05, 0x00, 0xDB, 0x13, 0x00, 0x00, 0x3A],
        Request::WriteParameter { index: 5, value: 5083 },
    );
    response(
        &[0x82, 0x96, 0x06, 0xCC, 0x32, 0x05, 0x00, 0x80, 0x7D],
        Response::ParameterWritten { index: 5, loader: LoaderCode(0x80) },
    );
    request(
        &[0x82, 0x96, 0x09, 0xCC, 0x33, 0x05, 0x00, 0xFF, 0xFF, 0xFF, 0xFF, 0xF3],
        Request::WriteParameterExtended { index: 5, value: -1 },
    );
    response(
        &[0x82, 0x96, 0x09, 0xCC, 0x33, 0x05, 0x00, 0x00, b'O', b'K', 0x00, 0xF7],
        Response::ParameterWrittenExtended { index: 5, loader: LoaderCode::OK, text: Text::from("OK") },
    );
    request(&[0x82, 0x96, 0x03, 0xCC, 0x34, 0xFB], Request::CallLoader);
    response(
        &[0x82, 0x96, 0x07, 0xCC, 0x34, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF],
        Response::LoaderCalled { offset: -1 },
    );
    request(&[0x82, 0x96, 0x03, 0xCC, 0x35, 0xFA], Request::SaveParameters);
    response(&[0x82, 0x96, 0x03, 0xCC, 0x35, 0xFA], Response::ParametersSaved);
}

/// 31h: Variant 9 bytes, Minimum, Maximum, Default 4 bytes each, Name 21 bytes, Group up to 26.
#[test]
fn extended_read_has_the_manuals_fields() {
    let description = Description {
        index: 1,
        variant: Text::from("ENGLISH"),
        minimum: 0,
        maximum: 1,
        default: 1,
        name: Text::from("Languages"),
        group: Text::from("General"),
    };
    let mut wire = vec![0x82, 0x96, 5 + 9 + 12 + 21 + 8, 0xCC, 0x31, 1, 0];
    wire.extend(b"ENGLISH\0\0\0\0\0\0\x01\0\0\0\x01\0\0\0");
    wire.extend(b"Languages\0\0\0\0\0\0\0\0\0\0\0\0General\0");
    wire.push(wire[2..].iter().fold(0, |x, b| x ^ b));
    response(&wire, Response::ParameterDescription(description));
}

/// "82h 96h 03h FFh xxh ??h" with every code; the check byte is FCh XOR code.
#[test]
fn error_telegrams() {
    for &code in ErrorCode::ALL {
        response(&[0x82, 0x96, 0x03, 0xFF, code.0, 0xFC ^ code.0], Response::Error(code));
    }
    response(&[0x82, 0x96, 0x03, 0xFF, 0x7E, 0x82, 0x82], Response::Error(ErrorCode(0x7E)));
}

/// Decision 1: number 82h is doubled both ways (a read of 126 bytes, a RAM write of 124).
#[test]
fn number_82h_is_doubled() {
    let data = [0x11; 126];
    let mut wire = vec![0x82, 0x96, 0x82, 0x82, 0xCC, 0x24, 0x0C];
    wire.extend(data);
    wire.push(0x82 ^ 0xCC ^ 0x24 ^ 0x0C);
    response(&wire, Response::RamData { bank: 12, data: &data });
    let mut wire = vec![0x82, 0x96, 0x82, 0x82, 0xCC, 0x25, 0x0C, 0x00, 0x01];
    wire.extend(&data[..124]);
    wire.push(0x82 ^ 0xCC ^ 0x25 ^ 0x0C ^ 0x01);
    request(&wire, Request::WriteRam { bank: 12, offset: 0x100, data: &data[..124] });
}

/// "can be extended at will with own functions": unknown ones pass through.
#[test]
fn unknown_functions_are_raw() {
    request(&[0x82, 0x96, 0x04, 0x77, 1, 2, 0x70], Request::Raw { function: 0x77, data: &[1, 2] });
    response(&[0x82, 0x96, 0x02, 0x77, 0x75], Response::Raw { function: 0x77, data: &[] });
    request(&[0x82, 0x96, 0x03, 0xCC, 0x99, 0x56], Request::Raw { function: 0xCC, data: &[0x99] });
    request(&[0x82, 0x96, 0x02, 0xCC, 0xCE], Request::Raw { function: 0xCC, data: &[] });
}

#[test]
fn a_number_that_the_function_does_not_permit_is_named() {
    let frame = Frame::new_checked(&[0x03, 0x40, 0x00, 0x43]).unwrap();
    let error = NumberError { function: 0x40, minimum: 2, maximum: 2, found: 3 };
    assert_eq!(Request::parse(&frame), Err(error));
    assert_eq!(error.to_string(), "function 40h: number byte 03h, 02h to 02h expected");
    let frame = Frame::new_checked(&[0x05, 0x50, 0x01, 0x05, 0x00, 0x51]).unwrap();
    assert!(Response::parse(&frame).is_err(), "half a failure");
}

/// 21h, 25h, 26h, 27h are found in this order, before a bank is touched.
#[test]
fn bank_requests_are_checked() {
    let long = [0; 130];
    let check = |request: Request<'_>| request.check();
    assert_eq!(check(Request::EraseFlash { bank: 12 }), Err(ErrorCode::BANK));
    assert_eq!(check(Request::WriteRam { bank: 15, offset: 0, data: &long }), Err(ErrorCode::BANK));
    assert_eq!(check(Request::ReadRam { bank: 12, offset: 0, count: 129 }), Err(ErrorCode::TOO_MANY));
    assert_eq!(
        check(Request::WriteFlash { bank: 15, enable: true, data: &long[..129] }),
        Err(ErrorCode::TOO_MANY)
    );
    assert_eq!(
        check(Request::WriteFlashAt { bank: 16, offset: 0xFFFF, data: &long[..3] }),
        Err(ErrorCode::UNEVEN)
    );
    assert_eq!(
        check(Request::WriteFlashAt { bank: 16, offset: 0xFFFF, data: &long[..2] }),
        Err(ErrorCode::RANGE)
    );
    assert_eq!(check(Request::ReadFlash { bank: 16, offset: 0xFF81, count: 128 }), Err(ErrorCode::RANGE));
    assert_eq!(check(Request::ReadFlash { bank: 16, offset: 0xFF80, count: 128 }), Ok(()));
    assert_eq!(check(Request::WriteRam { bank: 12, offset: 0xFFFF, data: &long[..1] }), Ok(()));
}
