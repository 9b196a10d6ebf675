//! How much a bus carries: frames and bits a second, and what part of its capacity that is.

use core::time::Duration;
use std::collections::VecDeque;

use device_sim::can::{INTERMISSION, WireBits};
use motion_io::can::{BusEvent, BusState};
use motion_io::capture::Frame;

/// Rates are those of the last second, counted in steps of a tenth.
const STEP: i64 = 100_000_000;
const STEPS: usize = 10;

/// Frames and bits.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Carried {
    frames: u64,
    bits: u64,
}

impl core::ops::AddAssign for Carried {
    fn add_assign(&mut self, other: Self) {
        self.frames += other.frames;
        self.bits += other.bits;
    }
}

/// Frames and bits in a second.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Rate {
    pub(super) frames: f64,
    pub(super) bits: f64,
}

/// What is counted of one bus. Times in nanoseconds.
#[derive(Debug, Default)]
pub(super) struct Traffic {
    all: Carried,
    /// Steps by their number, the newest last.
    steps: VecDeque<(i64, Carried)>,
    /// The fullest second.
    peak: Carried,
    /// Error frames, or reports of them.
    pub(super) errors: u64,
    /// How often frames were lost because nobody fetched them in time.
    pub(super) overruns: u64,
    pub(super) state: Option<BusState>,
}

/// Bits of a frame on the wire with the intermission behind it; those of FD frames and of error frames are not
/// known.
fn bits(frame: &Frame) -> u64 {
    use embedded_can::Frame as _;
    let Some(frame) = frame.classic() else { return 0 };
    let plain = if frame.is_remote_frame() {
        pdo::Frame::new_remote(frame.id(), frame.len())
    } else {
        pdo::Frame::new(frame.id(), frame.data())
    };
    plain.map_or(0, |frame| WireBits::new(&frame).frame_len() as u64 + INTERMISSION)
}

impl Traffic {
    /// A frame of the bus.
    pub(super) fn frame(&mut self, time: Option<i64>, frame: &Frame) {
        let one = Carried { frames: 1, bits: bits(frame) };
        self.all += one;
        let Some(time) = time else { return };
        let step = time.div_euclid(STEP);
        match self.steps.back_mut() {
            // A capture may have frames that are a little out of order.
            Some((newest, carried)) if *newest >= step => *carried += one,
            _ => self.steps.push_back((step, one)),
        }
        self.forget(step);
        let mut second = Carried::default();
        self.steps.iter().for_each(|(_, carried)| second += *carried);
        if second.bits > self.peak.bits {
            self.peak = second;
        }
    }

    fn forget(&mut self, step: i64) {
        while self.steps.front().is_some_and(|(oldest, _)| step - oldest >= STEPS as i64) {
            self.steps.pop_front();
        }
    }

    /// Something that the endpoint tells about the bus.
    pub(super) fn event(&mut self, event: BusEvent) {
        match event {
            BusEvent::State(state) => self.state = Some(state),
            BusEvent::Error(_) => self.errors += 1,
            BusEvent::Overrun => self.overruns += 1,
            _ => {}
        }
    }

    pub(super) const fn frames(&self) -> u64 {
        self.all.frames
    }

    /// In the second before `now`, or since `start` where that is less.
    pub(super) fn rate(&self, now: i64, start: i64) -> Rate {
        let newest = now.div_euclid(STEP);
        let from = (newest - STEPS as i64 + 1).saturating_mul(STEP);
        let span = now.saturating_sub(from.max(start));
        let mut carried = Carried::default();
        let steps = self.steps.iter().filter(|(step, _)| newest - step < STEPS as i64);
        steps.for_each(|(_, step)| carried += *step);
        per_second(carried, span)
    }

    /// In the fullest second.
    pub(super) const fn peak(&self) -> Rate {
        Rate { frames: self.peak.frames as f64, bits: self.peak.bits as f64 }
    }

    /// From `start` to `now`.
    pub(super) fn mean(&self, now: i64, start: i64) -> Rate {
        per_second(self.all, now.saturating_sub(start))
    }
}

fn per_second(carried: Carried, nanos: i64) -> Rate {
    // A few frames within no time are no rate.
    if nanos <= 0 {
        return Rate::default();
    }
    let seconds = Duration::from_nanos(nanos as u64).as_secs_f64();
    Rate { frames: carried.frames as f64 / seconds, bits: carried.bits as f64 / seconds }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motion_io::capture::FrameKind;

    /// 47 bits with the intermission, 8 bytes, and one stuff bit in the CRC sequence.
    #[test]
    fn bits_on_the_wire() {
        let of = |id, kind, data: &[u8]| bits(&Frame::new(id, id > 0x7FF, kind, data).unwrap());
        assert_eq!(of(0x555, FrameKind::Data, &[0x55; 8]), 47 + 64 + 1);
        assert!(of(0x555, FrameKind::Data, &[0; 8]) > 47 + 64 + 10);
        assert!((47..60).contains(&of(0x2AA, FrameKind::Remote, &[0; 8])));
        assert_eq!(of(0x123, FrameKind::Error, &[0; 8]), 0);
    }

    #[test]
    fn rates_are_those_of_the_last_second() {
        let frame = Frame::new(0x555, false, FrameKind::Data, &[0x55; 8]).unwrap();
        let mut traffic = Traffic::default();
        // A frame a millisecond for two seconds, then nothing.
        (0..2000).for_each(|ms| traffic.frame(Some(ms * 1_000_000), &frame));
        let at = |seconds: f64| traffic.rate((seconds * 1e9) as i64, 0);
        assert_eq!(at(2.0).frames.round(), 1000.0);
        assert_eq!(at(2.0).bits.round(), 112_000.0);
        assert!(at(2.5).frames < 600.0 && at(2.5).frames > 400.0, "{:?}", at(2.5));
        assert_eq!(at(4.0), Rate::default());
        assert_eq!(traffic.peak(), Rate { frames: 1000.0, bits: 112_000.0 });
        assert_eq!(traffic.mean(4_000_000_000, 0).frames.round(), 500.0);
        // Of a bus that is heard for less than a second, the rate is that since then.
        let mut young = Traffic::default();
        (0..100).for_each(|ms| young.frame(Some(ms * 1_000_000), &frame));
        assert_eq!(young.rate(100_000_000, 0).frames.round(), 1000.0);
    }
}
