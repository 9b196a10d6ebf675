//! Encoder and decoder of LB2 frames.
#![no_std]
#![no_main]

use core::hint::black_box;

use lb2::frame::{Decoder, MAX_WIRE, encode};

#[used]
#[unsafe(no_mangle)]
static ENGINE_STATE: Decoder = Decoder::new();

#[unsafe(no_mangle)]
extern "C" fn _start() {
    let mut decoder = Decoder::new();
    let mut out = [0; MAX_WIRE];
    black_box(encode(black_box(0x40), footprint::wire(), &mut out).is_ok());
    let found = decoder.decode(footprint::wire());
    black_box(&found);
    decoder.gap();
    black_box(&decoder);
}
