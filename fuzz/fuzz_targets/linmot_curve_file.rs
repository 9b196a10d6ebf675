#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| conformance::fuzz::linmot_curve_file(data));
