//! LB2 framing against byte-stuffing codecs that verify nothing (corncobs, ucobs, darkbio-cobs).
//!
//! `cargo bench -p benches --bench lb2_frames` runs it all and ends with status 1 when a ratio is
//! below its bar; `-- --smoke` runs every measurement a few times and judges nothing.
//!
//! All contenders carry the same data. Where ours holds 82h, the peers' hold 00h, so that all have
//! as much to stuff. Ours carries head, number, function and check byte besides, and verifies them.
//! The peers' frames are found by `memchr`.

use core::hint::black_box;
use std::process::ExitCode;

use benches::{Contender, paired};
use lb2::frame::{Decoder, Item, MAX_WIRE, encode};

const MIB: usize = 1 << 20;
const PEERS: [&str; 3] = ["corncobs", "ucobs", "darkbio-cobs"];

/// Lengths of the data, share of 82h in percent, and the bars for decoding and encoding.
const CASES: [(&str, Lengths, u32, f64, f64); 6] = [
    ("12 B, clean", Lengths::Fixed(12), 0, 1.6, 1.5),
    ("12 B, 1 % 82h", Lengths::Fixed(12), 1, 1.5, 1.4),
    ("140 B, clean", Lengths::Fixed(140), 0, 1.8, 1.6),
    ("140 B, 1 % 82h", Lengths::Fixed(140), 1, 1.15, 1.1),
    ("mixed, clean", Lengths::Mixed, 0, 1.3, 1.3),
    ("mixed, 1 % 82h", Lengths::Mixed, 1, 1.1, 1.1),
];

#[derive(Clone, Copy)]
enum Lengths {
    Fixed(usize),
    /// 1…253 bytes, all equally frequent.
    Mixed,
}

/// The data of telegrams that fill `size` bytes on the wire, one after the other.
struct Data {
    bytes: Vec<u8>,
    ends: Vec<usize>,
}

impl Data {
    fn new(lengths: Lengths, percent: u32, size: usize) -> Self {
        let mut random = oorandom::Rand32::new(0x82_96);
        let (mut bytes, mut ends, mut wire) = (Vec::with_capacity(size), Vec::new(), 0);
        while wire < size {
            let len = match lengths {
                Lengths::Fixed(len) => len,
                Lengths::Mixed => random.rand_range(1..254) as usize,
            };
            for _ in 0..len {
                // 00h is what the peers stuff: it stands for 82h in theirs, so ours holds none.
                let byte =
                    if random.rand_range(0..100) < percent { 0x82 } else { random.rand_range(1..256) as u8 };
                bytes.push(if byte == 0x82 && percent == 0 { 0x83 } else { byte });
            }
            ends.push(bytes.len());
            wire += len + 5;
        }
        Self { bytes, ends }
    }

    fn iter(&self) -> impl Iterator<Item = &[u8]> {
        let mut start = 0;
        self.ends.iter().map(move |&end| &self.bytes[core::mem::replace(&mut start, end)..end])
    }

    /// The same with 00h in place of 82h.
    fn for_peers(&self) -> Self {
        let bytes = self.bytes.iter().map(|&byte| if byte == 0x82 { 0 } else { byte }).collect();
        Self { bytes, ends: self.ends.clone() }
    }
}

/// Writes one frame to the buffer and returns its length.
type Encode = fn(&[u8], &mut [u8]) -> usize;

#[inline]
fn encode_lb2(data: &[u8], out: &mut [u8]) -> usize {
    encode(0x33, data, out).expect("it fits")
}

#[inline]
fn encode_corncobs(data: &[u8], out: &mut [u8]) -> usize {
    corncobs::encode_buf(data, out)
}

#[inline]
fn encode_ucobs(data: &[u8], out: &mut [u8]) -> usize {
    let end = ucobs::encode(data, out).expect("it fits");
    out[end] = 0;
    end + 1
}

#[inline]
fn encode_darkbio(data: &[u8], out: &mut [u8]) -> usize {
    let end = darkbio_cobs::encode(data, out).expect("it fits");
    out[end] = 0;
    end + 1
}

/// Every frame into the same buffer, as before a write to a port.
#[inline]
fn encode_all(frames: &[&[u8]], encode: impl Fn(&[u8], &mut [u8]) -> usize) -> usize {
    let mut out = SendBuffer([0; MAX_WIRE]);
    frames.iter().fold(0, |sum, data| {
        let len = encode(data, &mut out.0);
        black_box(&out.0);
        sum + len
    })
}

#[repr(align(64))]
struct SendBuffer([u8; MAX_WIRE]);

/// Frames and the sum of their data's lengths: what all must agree on.
type Seen = (usize, usize);

fn decode_lb2(mut stream: &[u8]) -> Seen {
    let mut decoder = Decoder::new();
    let mut seen = (0, 0);
    loop {
        let (taken, item) = decoder.decode(stream);
        stream = &stream[taken..];
        match item {
            Some(Item::Frame { frame, .. }) => {
                let data = black_box(frame.data());
                seen = (seen.0 + 1, seen.1 + data.len());
            }
            Some(Item::Damage(damage)) => panic!("{damage}"),
            None => return seen,
        }
    }
}

fn decode_corncobs(stream: &[u8]) -> Seen {
    decode_split(stream, |frame, out| corncobs::decode_buf(frame, out).expect("good frames"))
}

fn decode_split(stream: &[u8], decode: impl Fn(&[u8], &mut [u8]) -> usize) -> Seen {
    let mut out = [0; MAX_WIRE];
    let (mut seen, mut start) = ((0, 0), 0);
    for end in memchr::memchr_iter(0, stream) {
        let len = decode(&stream[start..=end], &mut out);
        black_box(&out[..len]);
        seen = (seen.0 + 1, seen.1 + len);
        start = end + 1;
    }
    seen
}

fn decode_ucobs(stream: &[u8]) -> Seen {
    decode_split(stream, |frame, out| ucobs::decode(&frame[..frame.len() - 1], out).expect("good frames"))
}

fn decode_darkbio(stream: &[u8]) -> Seen {
    decode_split(stream, |frame, out| {
        darkbio_cobs::decode(&frame[..frame.len() - 1], out).expect("good frames")
    })
}

struct Report {
    ratio: f64,
    line: String,
}

/// Contender 0 is ours, 1…3 are the peers, 4 is memcpy.
fn compare(contenders: &mut [Contender<'_>], bytes: usize, rounds: usize) -> Report {
    let times = paired(contenders, rounds);
    let ratios: Vec<f64> = (1..=PEERS.len()).map(|peer| times.ratio(peer, 0)).collect();
    let ratio = ratios.iter().copied().fold(f64::INFINITY, f64::min);
    let rate = |which: usize| bytes as f64 / times.median(which).as_secs_f64() / 1e9;
    let mut line = format!("{:6.2} GB/s  {ratio:5.2} x  (", rate(0));
    for (peer, ratio) in PEERS.iter().zip(&ratios) {
        line += &format!("{peer} {ratio:.2}, ");
    }
    line += &format!("memcpy {:.2})", times.ratio(PEERS.len() + 1, 0));
    Report { ratio, line }
}

fn decoding(data: &Data, rounds: usize) -> Report {
    let peers_data = data.for_peers();
    let wire = |data: &Data, encode: Encode| {
        let mut out = [0; MAX_WIRE];
        let frames = data.iter().flat_map(|data| {
            let len = encode(data, &mut out);
            out[..len].to_vec()
        });
        frames.collect::<Vec<u8>>()
    };
    let ours = wire(data, encode_lb2);
    let theirs =
        [encode_corncobs as Encode, encode_ucobs, encode_darkbio].map(|encode| wire(&peers_data, encode));
    let wanted = (data.ends.len(), data.bytes.len());
    assert_eq!(decode_lb2(&ours), wanted);
    assert_eq!(decode_corncobs(&theirs[0]), wanted);
    assert_eq!(decode_ucobs(&theirs[1]), wanted);
    assert_eq!(decode_darkbio(&theirs[2]), wanted);
    let mut copy = vec![0; data.bytes.len()];
    let mut contenders = [
        Contender::new("lb2", || _ = black_box(decode_lb2(black_box(&ours)))),
        Contender::new(PEERS[0], || _ = black_box(decode_corncobs(black_box(&theirs[0])))),
        Contender::new(PEERS[1], || _ = black_box(decode_ucobs(black_box(&theirs[1])))),
        Contender::new(PEERS[2], || _ = black_box(decode_darkbio(black_box(&theirs[2])))),
        Contender::new("memcpy", || black_box(&mut copy).copy_from_slice(black_box(&data.bytes))),
    ];
    compare(&mut contenders, data.bytes.len(), rounds)
}

fn encoding(data: &Data, rounds: usize) -> Report {
    let peers_data = data.for_peers();
    let (ours, theirs): (Vec<_>, Vec<_>) = (data.iter().collect(), peers_data.iter().collect());
    let mut copy = vec![0; data.bytes.len()];
    let mut contenders = [
        Contender::new("lb2", || _ = black_box(encode_all(black_box(&ours), encode_lb2))),
        Contender::new(PEERS[0], || _ = black_box(encode_all(black_box(&theirs), encode_corncobs))),
        Contender::new(PEERS[1], || _ = black_box(encode_all(black_box(&theirs), encode_ucobs))),
        Contender::new(PEERS[2], || _ = black_box(encode_all(black_box(&theirs), encode_darkbio))),
        Contender::new("memcpy", || black_box(&mut copy).copy_from_slice(black_box(&data.bytes))),
    ];
    compare(&mut contenders, data.bytes.len(), rounds)
}

fn main() -> ExitCode {
    let smoke = std::env::args().any(|arg| arg == "--smoke");
    let (rounds, large_rounds) = if smoke { (3, 1) } else { (401, 7) };
    let mut below = 0;
    println!("1 MiB streams; data bytes per second, times as fast as the fastest peer");
    for (name, lengths, percent, decode_bar, encode_bar) in CASES {
        let data = Data::new(lengths, percent, MIB);
        for (what, report, bar) in
            [("decode", decoding(&data, rounds), decode_bar), ("encode", encoding(&data, rounds), encode_bar)]
        {
            let verdict = match (smoke, report.ratio >= bar) {
                (true, _) => "",
                (false, true) => "  ok",
                (false, false) => "  BELOW THE BAR",
            };
            below += u32::from(!smoke && report.ratio < bar);
            println!("{what}  {name:14} {}  bar {bar:.2}{verdict}", report.line);
        }
    }
    let size = if smoke { 4 * MIB } else { 64 * MIB };
    println!("{} MiB streams, for information: memory pages decide here, not code", size / MIB);
    for (name, lengths, percent, ..) in CASES {
        let data = Data::new(lengths, percent, size);
        println!("decode  {name:14} {}", decoding(&data, large_rounds).line);
        println!("encode  {name:14} {}", encoding(&data, large_rounds).line);
    }
    if below > 0 {
        println!("{below} ratios are below their bars");
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}
