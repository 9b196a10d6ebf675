//! The fast paths against byte-wise ones: 60,000 seeded streams, every kind of damage.

use lb2::frame::{DamageKind, Decoder, Item, MAX_DATA, MAX_WIRE, encode};

use oorandom::Rand32;

/// Written from the manual, without a thought for speed.
fn encode_reference(function: u8, data: &[u8]) -> Vec<u8> {
    let number = u8::try_from(data.len() + 2).unwrap();
    let mut block = vec![number, function];
    block.extend(data);
    block.push(block.iter().fold(0, |xor, byte| xor ^ byte));
    let mut wire = vec![0x82, 0x96];
    for byte in block {
        wire.push(byte);
        if byte == 0x82 {
            wire.push(byte);
        }
    }
    wire
}

fn data(random: &mut Rand32) -> Vec<u8> {
    let len = match random.rand_range(0..4) {
        0 => random.rand_range(0..18),
        1 => random.rand_range(0..80),
        2 => random.rand_range(120..140),
        _ => random.rand_range(0..MAX_DATA as u32 + 1),
    };
    // Of 100 bytes, how many are 82h: none, few, many, nearly all.
    let heads = [0, 1, 5, 50, 97][random.rand_range(0..5) as usize];
    let byte = |_| match random.rand_range(0..100) {
        n if n < heads => 0x82,
        n if n % 16 == 15 => 0x96,
        _ => random.rand_u32() as u8,
    };
    (0..len).map(byte).collect()
}

fn stream(random: &mut Rand32) -> Vec<u8> {
    let mut stream = Vec::new();
    for _ in 0..random.rand_range(1..6) {
        let mut wire = encode_reference(random.rand_u32() as u8, &data(random));
        let at = |random: &mut Rand32, wire: &[u8]| random.rand_range(0..wire.len() as u32) as usize;
        match random.rand_range(0..16) {
            0 => {
                let at = at(random, &wire);
                wire[at] ^= 1 << random.rand_range(0..8);
            }
            1 => {
                let at = at(random, &wire);
                wire.truncate(at);
            }
            2 => {
                let at = at(random, &wire);
                wire.remove(at);
            }
            3 => {
                let at = at(random, &wire);
                wire.splice(at..at, [0x82, 0x96, random.rand_u32() as u8]);
            }
            4 => {
                let at = at(random, &wire);
                wire.insert(at, 0x82);
            }
            _ => {}
        }
        stream.extend(wire);
    }
    // What follows decides whether the fast path may look ahead.
    stream.extend((0..random.rand_range(0..400)).map(|_| random.rand_u32() as u8));
    stream
}

#[derive(Debug, PartialEq)]
enum Seen {
    Frame(u64, Vec<u8>),
    Damage(u64, DamageKind),
}

fn decode(stream: &[u8], mut chunk: impl FnMut() -> usize) -> (Vec<Seen>, u64, u64) {
    let mut decoder = Decoder::new();
    let (mut seen, mut rest) = (Vec::new(), stream);
    while !rest.is_empty() {
        let (mut now, later) = rest.split_at(chunk().clamp(1, rest.len()));
        rest = later;
        loop {
            let (taken, item) = decoder.decode(now);
            now = &now[taken..];
            seen.push(match item {
                Some(Item::Frame { offset, frame }) => Seen::Frame(offset, frame.block().to_vec()),
                Some(Item::Damage(damage)) => Seen::Damage(damage.offset, damage.kind),
                None => break,
            });
        }
        assert!(now.is_empty());
    }
    (seen, decoder.discarded(), decoder.position())
}

/// Single bytes never reach the fast path, whole streams always do.
#[test]
fn decoding_at_once_is_decoding_byte_by_byte() {
    let mut random = Rand32::new(0x1B2);
    let mut frames = 0;
    for round in 0..60_000 {
        let stream = stream(&mut random);
        let wanted = decode(&stream, || 1);
        assert_eq!(decode(&stream, || usize::MAX), wanted, "stream {round}: {stream:02X?}");
        let chunks = decode(&stream, || random.rand_range(1..300) as usize);
        assert_eq!(chunks, wanted, "stream {round} in chunks: {stream:02X?}");
        frames += wanted.0.iter().filter(|seen| matches!(seen, Seen::Frame(..))).count();
    }
    assert!(frames > 100_000, "{frames} frames: the streams are too bad to show anything");
}

#[test]
fn encoding_is_what_the_manual_says_in_any_buffer() {
    let mut random = Rand32::new(0x1B2);
    let mut out = [0; 2 * MAX_WIRE];
    for _ in 0..60_000 {
        let (function, data) = ([0x33, 0x82, 0xCC][random.rand_range(0..3) as usize], data(&mut random));
        let wanted = encode_reference(function, &data);
        for room in [wanted.len(), wanted.len() + random.rand_range(0..100) as usize, out.len()] {
            out.fill(0xA5);
            let len = encode(function, &data, &mut out[..room]).unwrap();
            assert_eq!(out[..len], wanted, "{function:02X}h {data:02X?}");
            assert!(out[room..].iter().all(|&byte| byte == 0xA5));
        }
        let short = wanted.len() - 1;
        assert!(encode(function, &data, &mut out[..short]).is_err());
    }
}
