//! Parameters: unknown, read-only, out of range, too wide; texts.

use device_sim::linmot::sg5;
use linmot::code::{ParameterType, Status};
use linmot::drive::Parameter;
use linmot::link::{Fault, LinkExt};
use linmot::request::{Access, Memory, Request, Value};
use linmot::upid::{Upid, Usage};
use motion_io::linmot::LinkError;

use crate::bench::*;

#[test]
fn parameter_errors() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        let before = bench.world().drive().image();
        let write = |memory, upid, value| Request::Write { memory, upid: Upid(upid), value };
        for value in [Value::Rom, Value::Ram, Value::Minimum, Value::Maximum, Value::Default] {
            bench.refuses(Request::Read { value, upid: Upid(0x1111) }, Status::UPID, "UPID 1111h");
        }
        for memory in [Memory::Rom, Memory::Ram, Memory::Both] {
            bench.refuses(write(memory, 0x1111, 0), Status::UPID, "UPID 1111h");
            // Read-only.
            bench.refuses(write(memory, 0x2136, 0), Status::USAGE, "UPID 2136h");
        }
        // Not live: only its ROM value can be written.
        bench.refuses(write(Memory::Ram, 0x119E, 1), Status::USAGE, "UPID 119Eh");
        bench.refuses(write(Memory::Both, 0x119E, 1), Status::USAGE, "UPID 119Eh");
        bench.refuses(write(Memory::Rom, 0x119E, 32_001), Status::RANGE, "UPID 119Eh");
        bench.refuses(write(Memory::Rom, 0x3001, -101i32 as u32), Status::RANGE, "UPID 3001h");
        bench.refuses(write(Memory::Rom, 0x03F2, 0), Status::TYPE, "UPID 03F2h");
        assert_eq!(bench.world().drive().image(), before, "{carrier:?}: a refused command wrote something");
        assert_eq!(bench.link.read(Upid(0x119E), Value::Ram).unwrap(), 8000);
    }
}

/// A drive filters out the bits that do not belong to a parameter's type (manual B 2.5).
#[test]
fn a_value_that_the_drive_would_cut_off_is_not_written() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        let before = bench.kept();
        for memory in [Memory::Rom, Memory::Ram, Memory::Both] {
            for (upid, value, words) in [
                (0x13A2, 99_999, "UPID 13A2h: 99999 is out of range, 0 to 65535 expected"),
                (0x13A2, 70_000, "UPID 13A2h: 70000 is out of range, 0 to 65535 expected"),
                (0x13A2, -3i32 as u32, "UPID 13A2h: 4294967293 is out of range, 0 to 65535 expected"),
                (0x13A0, -32_001i32 as u32, "UPID 13A0h: -32001 is out of range, -32000 to 32000 expected"),
                (0x13A0, 0x1_FFFB, "UPID 13A0h: 131067 is out of range, -32000 to 32000 expected"),
                (0x3001, 0xFFFB, "UPID 3001h: 65531 is out of range, -100 to 100 expected"),
                (0x20A1, 3, "UPID 20A1h: 3 is out of range, 0 to 1 expected"),
                (0x20A0, 0x101, "UPID 20A0h: 257 is out of range, 1 to 127 expected"),
            ] {
                let fault = bench.link.write(Upid(upid), memory, value).unwrap_err();
                assert!(matches!(fault, Fault::Range { .. }), "{fault}");
                assert_eq!(fault.to_string(), words);
            }
        }
        let after = bench.kept();
        assert_eq!(after, before, "{carrier:?}: something was written");
        assert_eq!(bench.link.read(Upid(0x13A2), Value::Ram).unwrap(), 10);
        // A negative number in either form.
        for raw in [-5i32 as u32, 0xFFFB] {
            bench.link.write(Upid(0x13A0), Memory::Both, raw).unwrap();
            assert_eq!(bench.link.read(Upid(0x13A0), Value::Ram).unwrap(), 0xFFFB);
            bench.link.write(Upid(0x13A0), Memory::Both, 0).unwrap();
        }
    }
}

/// Negative floats descend where their bits ascend; the drive tells no type.
#[test]
fn floats_and_ranges_below_zero_are_written_as_what_they_are() {
    let bits = f32::to_bits;
    for carrier in CARRIERS {
        let mut tree = sg5();
        let like = |upid, kind, minimum, maximum, default| {
            let usage = Usage::RAM_READ | Usage::ROM_READ | Usage::ROM_WRITE;
            Parameter { upid: Upid(upid), kind, usage, minimum, maximum, default }
        };
        tree.push(like(0x3010, ParameterType::FLOAT, bits(-100.0), bits(100.0), bits(0.0)));
        tree.push(like(0x3011, ParameterType::S16, -100i16 as u16 as u32, -1i16 as u16 as u32, 0xFFFF));
        let mut bench = Bench::with(carrier, tree);
        for value in [-1.0, -0.25, -100.0, 100.0, 0.0] {
            bench.link.write(Upid(0x3010), Memory::Rom, bits(value)).unwrap();
            assert_eq!(bench.link.read(Upid(0x3010), Value::Rom).unwrap(), bits(value), "{carrier:?}");
        }
        for (upid, raw, words) in [
            (0x3010, bits(-100.5), "UPID 3010h: -100.5 is out of range, -100 to 100 expected"),
            (0x3010, bits(f32::NAN), "UPID 3010h: NaN is out of range, -100 to 100 expected"),
            (0x3011, 0, "UPID 3011h: 0 is out of range, -100 to -1, or 65436 to 65535, expected"),
            (0x3011, 0xFF00, "UPID 3011h: -256 is out of range, -100 to -1, or 65436 to 65535, expected"),
        ] {
            let fault = bench.link.write(Upid(upid), Memory::Rom, raw).unwrap_err();
            assert_eq!(fault.to_string(), words, "{carrier:?}");
            // The drive says the same of it.
            bench.refuses(
                Request::Write { memory: Memory::Rom, upid: Upid(upid), value: raw },
                Status::RANGE,
                "write ROM value",
            );
        }
        bench.link.write(Upid(0x3011), Memory::Rom, -5i32 as u32).unwrap();
        assert_eq!(bench.link.read(Upid(0x3011), Value::Rom).unwrap(), 0xFFFB);
    }
}

/// A drive whose bounds are wider than the type that it keeps.
#[test]
fn another_value_than_was_written_is_named() {
    for carrier in CARRIERS {
        let mut tree = sg5();
        for parameter in tree.iter_mut().filter(|parameter| parameter.upid == Upid(0x13A2)) {
            parameter.maximum = u32::MAX;
        }
        for (memory, name) in [(Memory::Rom, "ROM"), (Memory::Ram, "RAM"), (Memory::Both, "RAM")] {
            let mut bench = Bench::with(carrier, tree.clone());
            let fault = bench.link.write(Upid(0x13A2), memory, 99_999).unwrap_err();
            let words = format!("UPID 13A2h: 99999 was written, but the {name} value is 34463");
            assert_eq!(fault.to_string(), words, "{carrier:?}");
            assert!(matches!(fault, Fault::ReadBack { .. }));
        }
    }
}

#[test]
fn texts_and_curves_that_would_be_cut_off_are_not_written() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        let before = bench.world().drive().image();
        for text in [&b"123456789012345678901234567890123"[..], b"X\0Y"] {
            let fault = bench.link.write_text(Upid::USER_COMMENT, Memory::Rom, text).unwrap_err();
            assert!(matches!(fault, Fault::Text { len, .. } if len == text.len()), "{fault}");
        }
        // Not live: refused with the first stringlet.
        let fault = bench.link.write_text(Upid::USER_COMMENT, Memory::Ram, b"X Axis Left").unwrap_err();
        assert!(fault.to_string().contains("UPID 03F3h: write RAM value"), "{fault}");
        // So many setpoints have no size of 16 bits.
        let mut long = info(2);
        long.setpoints = 16_385;
        let fault = bench.link.start_curve(Access::Add, &long).unwrap_err();
        assert_eq!(fault.to_string(), "curve 5: 16385 setpoints, 2 to 16383 expected");
        assert_eq!(bench.world().drive().image(), before, "{carrier:?}");
        assert_eq!(bench.link.curve_info(5).unwrap(), None);
        let longest = b"12345678901234567890123456789012";
        bench.link.write_text(Upid::USER_COMMENT, Memory::Rom, longest).unwrap();
    }
}

/// Object 2000h + UPID ends at FFFFh; what lies above must not become another object's index.
#[test]
fn a_upid_without_an_index_is_not_carried() {
    let mut bench = Bench::new(Carrier::Sdo);
    for upid in [0xE000, 0xF017, 0xFFFF] {
        let fault =
            bench.link.ask(Request::Write { memory: Memory::Rom, upid: Upid(upid), value: 1 }).unwrap_err();
        assert!(matches!(fault, Fault::Carrier(LinkError::NotCarried(_))), "{fault}");
        let fault = bench.link.read(Upid(upid), Value::Rom).unwrap_err();
        assert!(matches!(fault, Fault::Carrier(LinkError::NotCarried(_))), "{fault}");
    }
}
