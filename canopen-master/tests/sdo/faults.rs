//! Single frames lost, repeated, delayed or damaged, at random with a seed: each transfer ends in the
//! right data or a named outcome, and the next one works.

use core::time::Duration;
use std::collections::VecDeque;

use canopen_master::Frame;
use canopen_master::sdo::{Block, Finished, Options, Outcome};
use oorandom::Rand32;

use super::pair::{AT, Pair, ms};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Trouble {
    Loss,
    Repeat,
    /// Behind the next `n` frames of the same direction, or for 20 ms.
    Delay,
    /// One bit in the bytes behind the first, which a CRC protects; of other transfers, in any bit
    /// of the first.
    Damage,
}

/// A direction of the wire: the frames under way and when they arrive.
#[derive(Default)]
struct Wire {
    frames: VecDeque<(Duration, Frame)>,
    sent: u32,
}

impl Wire {
    fn send(&mut self, now: Duration, frame: Frame, trouble: Option<(u32, Trouble)>, random: &mut Rand32) {
        self.sent += 1;
        let trouble = trouble.filter(|&(at, _)| at == self.sent).map(|(_, trouble)| trouble);
        match trouble {
            None => self.frames.push_back((now, frame)),
            Some(Trouble::Loss) => {}
            Some(Trouble::Repeat) => self.frames.extend([(now, frame); 2]),
            Some(Trouble::Delay) => self.frames.push_back((now + ms(20), frame)),
            Some(Trouble::Damage) => {
                let mut bytes = <[u8; 8]>::try_from(frame.data()).unwrap();
                let bit = random.rand_range(0..64);
                bytes[bit as usize / 8] ^= 1 << (bit % 8);
                self.frames.push_back((now, Frame::standard(frame.standard_id().unwrap(), bytes)));
            }
        }
    }

    fn receive(&mut self, now: Duration) -> Option<Frame> {
        let due = self.frames.iter().position(|&(at, _)| at <= now)?;
        self.frames.remove(due).map(|(_, frame)| frame)
    }

    fn next(&self) -> Option<Duration> {
        self.frames.iter().map(|&(at, _)| at).min()
    }
}

struct Faulty {
    pair: Pair,
    up: Wire,
    down: Wire,
    random: Rand32,
}

impl Faulty {
    /// Runs until the transfer ends, with trouble for one frame of one direction.
    fn run(&mut self, trouble: Option<(bool, u32, Trouble)>) -> Finished<Vec<u8>> {
        (self.up.sent, self.down.sent) = (0, 0);
        let of = |request| trouble.filter(|t| t.0 == request).map(|t| (t.1, t.2));
        for _ in 0..1_000_000 {
            let pair = &mut self.pair;
            if let Some(finished) = pair.client.poll_event() {
                // The last words still go out.
                while let Some(frame) = pair.client.poll_transmit(pair.now) {
                    self.up.send(pair.now, frame, of(true), &mut self.random);
                }
                return finished;
            }
            // One frame at a time in each direction, so that neither side outruns the other.
            let mut moved = false;
            if let Some(frame) = pair.client.poll_transmit(pair.now) {
                self.up.send(pair.now, frame, of(true), &mut self.random);
                moved = true;
            }
            if let Some(frame) = pair.server.poll_transmit(pair.now, &mut pair.objects) {
                self.down.send(pair.now, frame, of(false), &mut self.random);
                moved = true;
            }
            if let Some(frame) = self.up.receive(pair.now) {
                pair.server.handle_frame(pair.now, &frame, &mut pair.objects);
                moved = true;
            }
            if let Some(frame) = self.down.receive(pair.now) {
                pair.client.handle_frame(pair.now, &frame);
                moved = true;
            }
            if moved {
                continue;
            }
            let next =
                [pair.client.poll_timeout(), pair.server.poll_timeout(), self.up.next(), self.down.next()];
            pair.now = next.into_iter().flatten().min().expect("no transfer hangs").max(pair.now);
            pair.client.handle_timeout(pair.now);
            pair.server.handle_timeout(pair.now, &mut pair.objects);
        }
        panic!("livelock");
    }

    /// Lets pass what may still come.
    fn settle(&mut self) {
        let pair = &mut self.pair;
        pair.now += ms(5000);
        while let Some(frame) = self.up.receive(pair.now) {
            pair.server.handle_frame(pair.now, &frame, &mut pair.objects);
        }
        for _ in 0..2 {
            pair.server.handle_timeout(pair.now, &mut pair.objects);
            while let Some(frame) = pair.server.poll_transmit(pair.now, &mut pair.objects) {
                self.down.send(pair.now, frame, None, &mut self.random);
            }
            pair.now += ms(5000);
        }
        while let Some(frame) = self.down.receive(pair.now) {
            pair.client.handle_frame(pair.now, &frame);
        }
        pair.client.handle_timeout(pair.now);
    }
}

fn options(random: &mut Rand32, block: bool) -> Options {
    let timeout = ms(50);
    if !block {
        return Options::new(timeout);
    }
    let block_size = [1, 2, 5, 127][random.rand_range(0..4) as usize];
    Options { timeout, block: Some(Block { block_size, crc: true, threshold: 0 }) }
}

#[test]
fn seeded_faults() {
    let mut done = 0;
    for seed in 0..6000u64 {
        let mut random = Rand32::new(seed);
        let (block, upload) = (random.rand_range(0..2) == 1, random.rand_range(0..2) == 1);
        let size = [0, 1, 4, 5, 8, 14, 30, 200, 1000][random.rand_range(0..9) as usize];
        let data: Vec<u8> = (0..size).map(|_| random.rand_u32() as u8).collect();
        let kinds = [Trouble::Loss, Trouble::Repeat, Trouble::Delay, Trouble::Damage];
        let kind = kinds[random.rand_range(0..4) as usize];
        let frames = 3 + size as u32 / 7;
        let trouble = (random.rand_range(0..2) == 1, 1 + random.rand_range(0..frames), kind);
        let options = options(&mut random, block);
        let block_size = options.block.map_or(127, |block| block.block_size);

        let mut pair = Pair::new(if upload { &data } else { &[] });
        pair.server = pair.server.with_block_size(block_size);
        let mut faulty = Faulty { pair, up: Wire::default(), down: Wire::default(), random };
        let begin = |faulty: &mut Faulty| {
            let client = &mut faulty.pair.client;
            if upload {
                client.upload(AT, Vec::new(), &options).unwrap();
            } else {
                client.download(AT, data.clone(), &options).unwrap();
            }
        };
        begin(&mut faulty);
        let first = faulty.run(Some(trouble));
        let why = format!("seed {seed}: {trouble:?}, {size} bytes, {options:?}, upload {upload}");
        if let Outcome::Done(bytes) = first.outcome {
            done += 1;
            let got = if upload { &first.buffer } else { &faulty.pair.objects.map[&AT].data };
            // Without a CRC nothing in the protocol tells that a data bit changed.
            if block || kind != Trouble::Damage {
                assert_eq!((bytes as usize, got), (data.len(), &data), "{why}");
            }
        }
        faulty.settle();
        begin(&mut faulty);
        let second = faulty.run(None);
        assert_eq!(second.outcome, Outcome::Done(size as u32), "{why}, then");
        let got = if upload { &second.buffer } else { &faulty.pair.objects.map[&AT].data };
        if !(upload && !block && kind == Trouble::Damage) {
            assert_eq!(got, &data, "{why}, then");
        }
    }
    assert!(done > 2500, "{done} of 6000 reached their end");
}
