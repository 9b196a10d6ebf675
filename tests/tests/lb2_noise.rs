//! A million frames through noise before, between and inside them.

use lb2::frame::{DamageKind, Decoder, Item, MAX_WIRE, encode};
use oorandom::Rand64;

const FRAMES: usize = 1_000_000;
const SEED: u128 = 0x82_96;

struct Stream {
    bytes: Vec<u8>,
    /// Wire offset and length of every frame that nothing has touched.
    good: Vec<(u64, usize)>,
    damaged: usize,
}

/// Noise is biased: 82h and 96h are frequent, so that false heads and false repeats are, too.
fn noise(random: &mut Rand64) -> u8 {
    match random.rand_range(0..16) {
        0 => 0x82,
        1 => 0x96,
        _ => random.rand_range(0..256) as u8,
    }
}

fn stream() -> Stream {
    let mut random = Rand64::new(SEED);
    let mut stream = Stream { bytes: Vec::new(), good: Vec::new(), damaged: 0 };
    let mut wire = [0; MAX_WIRE];
    let mut data = [0; 16];
    for _ in 0..FRAMES {
        if random.rand_range(0..4) == 0 {
            for _ in 0..random.rand_range(1..8) {
                stream.bytes.push(noise(&mut random));
            }
        }
        let len = random.rand_range(0..data.len() as u64) as usize;
        data[..len].fill_with(|| noise(&mut random));
        let len = encode(random.rand_range(0..256) as u8, &data[..len], &mut wire).unwrap();
        let frame = &wire[..len];
        let at = stream.bytes.len();
        let mut piece = frame.to_vec();
        if random.rand_range(0..8) == 0 {
            let hit = random.rand_range(0..len as u64) as usize;
            match random.rand_range(0..4) {
                0 => piece[hit] ^= 1 << random.rand_range(0..8),
                1 => {
                    piece[hit] = piece[hit].wrapping_add(1);
                    piece[random.rand_range(0..len as u64) as usize] ^= 0x40;
                }
                2 => piece[hit] = noise(&mut random),
                _ => piece.insert(hit, noise(&mut random)),
            }
        }
        // A hit that happens to change nothing, or stands before the frame, leaves it undamaged.
        match piece.windows(len).position(|window| window == frame) {
            Some(before) => stream.good.push(((at + before) as u64, len)),
            None => stream.damaged += 1,
        }
        stream.bytes.extend_from_slice(&piece);
    }
    stream
}

struct Heard {
    frames: Vec<(u64, usize)>,
    rejected: u64,
    discarded: u64,
}

fn hear(bytes: &[u8], mut chunk: impl FnMut() -> usize) -> Heard {
    let mut decoder = Decoder::new();
    let mut heard = Heard { frames: Vec::new(), rejected: 0, discarded: 0 };
    let mut rest = bytes;
    while !rest.is_empty() {
        let (mut piece, after) = rest.split_at(chunk().clamp(1, rest.len()));
        rest = after;
        loop {
            let (taken, item) = decoder.decode(piece);
            piece = &piece[taken..];
            match item {
                Some(Item::Frame { offset, frame }) => heard.frames.push((offset, frame.wire_len())),
                Some(Item::Damage(damage)) => {
                    heard.rejected += u64::from(matches!(damage.kind, DamageKind::CheckByte { .. }));
                }
                None => break,
            }
        }
    }
    heard.discarded = decoder.discarded();
    heard
}

#[test]
fn every_undamaged_frame_is_delivered() {
    let stream = stream();
    let whole = hear(&stream.bytes, || usize::MAX);
    let mut random = Rand64::new(SEED);
    for heard in [hear(&stream.bytes, || 1), hear(&stream.bytes, || random.rand_range(1..64) as usize)] {
        assert!(
            heard.frames == whole.frames && heard.rejected == whole.rejected,
            "chunking made a difference"
        );
        assert_eq!(heard.discarded, whole.discarded);
    }
    // Frames heard that were not sent so: their XOR is right by chance. Where one lies over a good
    // frame, that frame cannot be told apart from it.
    let false_frames: Vec<(u64, usize)> =
        whole.frames.iter().copied().filter(|frame| stream.good.binary_search(frame).is_err()).collect();
    let hidden = |&(at, len): &(u64, usize)| {
        let next = false_frames.partition_point(|&(start, length)| start + length as u64 <= at);
        false_frames.get(next).is_some_and(|&(start, _)| start < at + len as u64)
    };
    let missing: Vec<(u64, usize)> =
        stream.good.iter().copied().filter(|frame| whole.frames.binary_search(frame).is_err()).collect();
    let lost: Vec<_> = missing.iter().filter(|frame| !hidden(frame)).collect();
    // An 8-bit XOR lets one in 256 random blocks pass; six standard deviations above that is no chance.
    let candidates = whole.rejected as f64 + false_frames.len() as f64;
    let bound = candidates / 256.0 + 6.0 * (candidates / 256.0).sqrt();
    println!(
        "{FRAMES} frames in {} bytes, {} damaged: {} of {} undamaged delivered, {} hidden under false ones; \
         {} false frames accepted of {candidates} candidates, bound {bound:.0}; {} bytes discarded; seed {SEED:#x}",
        stream.bytes.len(),
        stream.damaged,
        stream.good.len() - missing.len(),
        stream.good.len(),
        missing.len(),
        false_frames.len(),
        whole.discarded,
    );
    assert!(lost.is_empty(), "{} undamaged frames lost, first at {:?}", lost.len(), lost.first());
    assert!(false_frames.len() as f64 <= bound);
}
