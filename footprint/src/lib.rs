//! What every program here shares: a place where panics end, and values the optimiser knows nothing of.
#![no_std]

use core::hint::black_box;

use pdo::Frame;

/// None of the programs can panic; the linker drops this where that is so.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}

/// Bytes as they might come from a wire.
pub fn wire() -> &'static [u8] {
    black_box(&[0; 64])
}

/// A time as it might come from a timer.
pub fn now() -> core::time::Duration {
    core::time::Duration::from_secs(black_box(0))
}

/// A frame as it might come from a CAN controller.
pub fn received() -> Frame {
    black_box(Frame::standard(0, [0; 8]))
}
