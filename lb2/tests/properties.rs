//! `parse ∘ encode = identity`, and the decoder against any chunking of any stream.

use lb2::code::{ErrorCode, LoaderCode, Version};
use lb2::frame::{Decoder, Item, MAX_WIRE};
use lb2::telegram::{Description, Failures, Request, Response, Text};
use proptest::prelude::*;

fn round_trip<T>(encode: impl Fn(&mut [u8]) -> usize, parse: impl Fn(&lb2::frame::Frame<'_>) -> T) -> T {
    let mut out = [0xA5; MAX_WIRE];
    let len = encode(&mut out);
    let mut decoder = Decoder::new();
    match decoder.decode(&out[..len]) {
        (taken, Some(Item::Frame { frame, .. })) if taken == len => parse(&frame),
        other => panic!("{other:?}"),
    }
}

/// Bytes in which 82h and 96h are as frequent as they must be to make trouble.
fn wire_bytes(max: usize) -> impl Strategy<Value = Vec<u8>> {
    let byte = prop_oneof![4 => any::<u8>(), 2 => Just(0x82), 1 => Just(0x96), 2 => 0u8..8];
    prop::collection::vec(byte, 0..=max)
}

fn items(stream: &[u8], cuts: &[usize]) -> (Vec<String>, u64) {
    let mut decoder = Decoder::new();
    let mut seen = Vec::new();
    let mut cuts: Vec<usize> = cuts.iter().map(|cut| cut % (stream.len() + 1)).collect();
    cuts.extend([0, stream.len()]);
    cuts.sort_unstable();
    for pair in cuts.windows(2) {
        let mut rest = &stream[pair[0]..pair[1]];
        loop {
            let (taken, item) = decoder.decode(rest);
            rest = &rest[taken..];
            match item {
                Some(item) => seen.push(format!("{item:?}")),
                None => break,
            }
        }
        assert!(rest.is_empty());
    }
    assert_eq!(decoder.position(), stream.len() as u64);
    (seen, decoder.discarded())
}

proptest! {
    #[test]
    fn requests_come_back(
        bank: u8, offset: u16, count: u8, index: u16, value: i32, enable: bool, function in 0x60u8..0xC0,
        data in wire_bytes(249),
    ) {
        let data = &data[..];
        for request in [
            Request::SelectDevice(bank),
            Request::DeviceType,
            Request::OsVersion,
            Request::CustomVersion,
            Request::Failures,
            Request::FailureCount,
            Request::DeleteFailures,
            Request::EraseFlash { bank },
            Request::ReadFlash { bank, offset, count },
            Request::WriteFlash { bank, enable, data },
            Request::ReadRam { bank, offset, count },
            Request::WriteRam { bank, offset, data },
            Request::WriteFlashAt { bank, offset, data },
            Request::ReadParameter { index },
            Request::DescribeParameter { index },
            Request::WriteParameter { index, value },
            Request::WriteParameterExtended { index, value },
            Request::CallLoader,
            Request::SaveParameters,
            Request::Raw { function, data },
        ] {
            round_trip(
                |out| request.encode(out).unwrap(),
                |frame| assert_eq!(Request::parse(frame), Ok(request)),
            );
        }
    }

    #[test]
    fn responses_come_back(
        byte: u8, device: u16, index: u16, value: i32, data in wire_bytes(250), text in wire_bytes(60),
    ) {
        let failures = Failures::new(&data);
        let clip = |max: usize| Text::new(&text[..text.len().min(max)]);
        for response in [
            Response::Selected(byte),
            Response::DeviceType { device, axes: byte },
            Response::OsVersion(Version { version: device, revision: index }),
            Response::CustomVersion(Version { version: device, revision: index }),
            Response::Failures(failures),
            Response::FailureCount(byte),
            Response::FailuresDeleted(byte),
            Response::FlashErased { bank: byte },
            Response::FlashData { bank: byte, data: &data },
            Response::FlashWritten { bank: byte },
            Response::RamData { bank: byte, data: &data },
            Response::RamWritten { bank: byte },
            Response::FlashWrittenAt { bank: byte },
            Response::Parameter { index, value },
            Response::ParameterDescription(Description {
                index,
                variant: clip(8),
                minimum: value,
                maximum: !value,
                default: value / 2,
                name: clip(20),
                group: clip(25),
            }),
            Response::ParameterWritten { index, loader: LoaderCode(byte) },
            Response::ParameterWrittenExtended { index, loader: LoaderCode(byte), text: clip(41) },
            Response::LoaderCalled { offset: value },
            Response::ParametersSaved,
            Response::Error(ErrorCode(byte)),
            Response::Raw { function: 0x60, data: &data },
        ] {
            round_trip(
                |out| response.encode(out).unwrap(),
                |frame| assert_eq!(Response::parse(frame), Ok(response)),
            );
        }
    }

    #[test]
    fn chunking_makes_no_difference(stream in wire_bytes(400), cuts in prop::collection::vec(any::<usize>(), 0..20)) {
        let whole = items(&stream, &[]);
        prop_assert_eq!(&items(&stream, &cuts), &whole);
        let bytewise: Vec<usize> = (0..stream.len()).collect();
        prop_assert_eq!(&items(&stream, &bytewise), &whole);
    }

    /// A good frame is found after any garbage that does not end in a block of its own, and every
    /// byte before it is counted.
    #[test]
    fn a_good_frame_after_garbage_is_never_lost(garbage in wire_bytes(300), data in wire_bytes(130)) {
        let mut out = [0; MAX_WIRE];
        let len = lb2::frame::encode(0x33, &data, &mut out).unwrap();
        // Enough to fill whatever block the garbage has left open.
        let mut stream = garbage;
        stream.extend([0x01; 256]);
        stream.extend(&out[..len]);
        let (seen, discarded) = items(&stream, &[]);
        let good: Vec<_> = seen.iter().filter(|item| item.starts_with("Frame")).collect();
        let wanted = format!("offset: {}, frame: Frame(33h", stream.len() - len);
        prop_assert!(good.iter().any(|item| item.contains(&wanted)), "{:?}", seen);
        if good.len() == 1 {
            prop_assert_eq!(discarded, (stream.len() - len) as u64);
        }
    }

    #[test]
    fn parsers_take_any_frame(function: u8, data in wire_bytes(253)) {
        let mut out = [0; MAX_WIRE];
        let len = lb2::frame::encode(function, &data, &mut out).unwrap();
        let mut decoder = Decoder::new();
        if let (_, Some(Item::Frame { frame, .. })) = decoder.decode(&out[..len]) {
            let _ = (Request::parse(&frame), Response::parse(&frame));
        }
    }
}
