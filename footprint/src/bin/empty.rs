//! The base that is subtracted from the others.
#![no_std]
#![no_main]

#[unsafe(no_mangle)]
extern "C" fn _start() {
    core::hint::black_box((footprint::wire(), footprint::now()));
}
