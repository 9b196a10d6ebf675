//! Faults that befall frames, at random from a seed or scripted.

use core::time::Duration;

use oorandom::Rand64;

/// Faults that befall frames at random: each number is "one in so many frames", 0 = never. The same seed
/// gives the same faults.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Faults {
    /// Seed of the random numbers.
    pub seed: u64,
    /// A bit on the wire is turned over: all stations see the error, and the frame is sent again.
    pub wire_error: u32,
    /// Nobody receives the frame, and its sender does not know (as when receivers overrun).
    pub lose: u32,
    /// An error in the last bit of end of frame: receivers have it already, the sender sends it again.
    pub duplicate: u32,
    /// Receivers get the frame up to [`longest_delay`](Self::longest_delay) late, perhaps behind later
    /// frames (as over a gateway).
    pub delay: u32,
    /// The longest delay.
    pub longest_delay: Duration,
    /// A data bit is turned over and no CRC notices (as in a gateway's memory).
    pub corrupt: u32,
}

impl Faults {
    /// A perfect bus.
    pub const NONE: Self = Self {
        seed: 0,
        wire_error: 0,
        lose: 0,
        duplicate: 0,
        delay: 0,
        longest_delay: Duration::from_millis(20),
        corrupt: 0,
    };
}

/// One fault for one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Fault {
    /// A bit on the wire after the arbitration field is turned over; the number, modulo the bits there
    /// are, says which.
    WireError(u32),
    /// Nobody receives the frame.
    Lose,
    /// Received, then sent again.
    Duplicate,
    /// Received so much later.
    Delay(Duration),
    /// This data bit, modulo the bits there are, is turned over unnoticed.
    Corrupt(u32),
}

/// Draws a fault for a frame.
pub(super) fn draw(faults: &Faults, random: &mut Rand64) -> Option<Fault> {
    fn hit(random: &mut Rand64, one_in: u32) -> bool {
        one_in > 0 && random.rand_range(0..u64::from(one_in)) == 0
    }
    if hit(random, faults.wire_error) {
        return Some(Fault::WireError(random.rand_range(0..1 << 20) as u32));
    }
    if hit(random, faults.lose) {
        return Some(Fault::Lose);
    }
    if hit(random, faults.duplicate) {
        return Some(Fault::Duplicate);
    }
    if hit(random, faults.delay) {
        let longest = u64::try_from(faults.longest_delay.as_nanos()).unwrap_or(u64::MAX);
        return Some(Fault::Delay(Duration::from_nanos(random.rand_range(0..longest.max(1)))));
    }
    hit(random, faults.corrupt).then(|| Fault::Corrupt(random.rand_range(0..64) as u32))
}
