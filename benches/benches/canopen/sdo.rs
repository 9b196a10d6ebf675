//! SDO: expedited, in segments, in blocks.

use core::hint::black_box;
use core::time::Duration;

use benches::Contender;
use canopen_master::data_type::DataType as Type;
use canopen_master::od::{Dictionary, Entry, Table};
use canopen_master::sdo::{
    AbortCode, Access, Block, Channel, Client, NEXT_REQUEST, Options, Outcome, Piece, Server, Small, Total,
    read_slice,
};
use canopen_master::{Address, Frame};
use canopen_rs::sdo::{self as theirs, block};
use canopen_rs::{Address as TheirAddress, DataType, Value};

use super::Judge;

const KIB64: usize = 64 * 1024;
/// The last segment is a whole one before it is cut.
const ROOM: usize = KIB64 + 7;
const CHANNEL: Channel = Channel { request: 0x605, response: 0x585 };
const AT: Address = Address::new(0x2000, 0);

/// A small device's dictionary.
const TABLE: Table<'static, 12> = match Table::new([
    Entry::constant(0x1000, 0, Type::UNSIGNED32, 0x0002_0192),
    Entry::variable(0x1001, 0, Type::UNSIGNED8, 0),
    Entry::text(0x1008, 0, "SD03"),
    Entry::variable(0x100C, 0, Type::UNSIGNED16, 0),
    Entry::variable(0x100D, 0, Type::UNSIGNED8, 0),
    Entry::variable(0x1017, 0, Type::UNSIGNED16, 0),
    Entry::constant(0x1018, 0, Type::UNSIGNED8, 1),
    Entry::constant(0x1018, 1, Type::UNSIGNED32, 0x6A),
    Entry::variable(0x2000, 0, Type::UNSIGNED32, 0x1234_5678),
    Entry::variable(0x6040, 0, Type::UNSIGNED16, 0),
    Entry::variable(0x6041, 0, Type::UNSIGNED16, 0x0237),
    Entry::variable(0x6064, 0, Type::INTEGER32, 0),
]) {
    Ok(table) => table,
    Err(_) => panic!("entries out of order"),
};

/// One large object.
struct Domain(Vec<u8>);

impl Access for Domain {
    #[inline]
    fn read(&mut self, _: Address, offset: u32, out: &mut [u8]) -> Result<(usize, Total), AbortCode> {
        Ok(read_slice(&self.0, offset, out))
    }
    fn begin_write(&mut self, _: Address, _: Option<u32>) -> Result<(), AbortCode> {
        Err(AbortCode::READ_ONLY)
    }
    fn write(&mut self, _: Address, _: &Piece<'_>) -> Result<(), AbortCode> {
        Err(AbortCode::READ_ONLY)
    }
}

const ROUND_TRIPS: u32 = 1000;

#[inline(never)]
fn our_expedited(client: &mut Client<Small>, server: &mut Server, objects: &mut impl Access) -> u32 {
    let options = Options::new(Duration::from_millis(100));
    let mut sum = 0u32;
    for i in 0..ROUND_TRIPS {
        let now = Duration::from_micros(u64::from(i));
        client.upload(black_box(AT), Small::EMPTY, &options).expect("idle");
        let request: Frame = client.poll_transmit(now).expect("a request");
        server.handle_frame(now, black_box(&request), objects);
        let response = server.poll_transmit(now, objects).expect("an answer");
        client.handle_frame(now, black_box(&response));
        let finished = client.poll_event().expect("an outcome");
        assert_eq!(finished.outcome, Outcome::Done(4));
        sum = sum.wrapping_add(finished.buffer.get::<u32>().expect("4 bytes"));
    }
    sum
}

#[inline(never)]
fn their_expedited() -> u32 {
    let at = TheirAddress::new(0x2000, 0);
    let mut sum = 0u32;
    for _ in 0..ROUND_TRIPS {
        let request = theirs::encode_upload_request(black_box(at));
        let asked = black_box(&request);
        let at = TheirAddress::new(u16::from_le_bytes([asked[1], asked[2]]), asked[3]);
        let value = black_box(Value::Unsigned32(0x1234_5678));
        let response = theirs::encode_upload_expedited_response(at, &value).expect("4 bytes");
        let (_, value) = theirs::decode_upload_expedited_response(black_box(&response), DataType::Unsigned32)
            .expect("an answer");
        let Value::Unsigned32(value) = value else { unreachable!() };
        sum = sum.wrapping_add(value);
    }
    sum
}

#[inline(never)]
fn our_upload<'a>(
    client: &mut Client<&'a mut [u8]>,
    server: &mut Server,
    objects: &mut Domain,
    options: &Options,
    to: &'a mut [u8],
) -> u32 {
    let mut now = Duration::ZERO;
    client.upload(AT, to, options).map_err(|refused| refused.error).expect("idle");
    loop {
        now += Duration::from_micros(100);
        while let Some(frame) = client.poll_transmit(now) {
            server.handle_frame(now, black_box(&frame), objects);
        }
        while let Some(frame) = server.poll_transmit(now, objects) {
            client.handle_frame(now, black_box(&frame));
        }
        if let Some(finished) = client.poll_event() {
            while let Some(frame) = client.poll_transmit(now) {
                server.handle_frame(now, &frame, objects);
            }
            let Outcome::Done(bytes) = finished.outcome else { panic!("{}", finished.outcome) };
            return bytes;
        }
    }
}

/// Request, answer and data of every segment, by their codec.
#[inline(never)]
fn their_segments(data: &[u8], to: &mut [u8]) -> usize {
    let (mut toggle, mut at) = (false, 0);
    for piece in data.chunks(7) {
        let request = theirs::encode_upload_segment_request(toggle);
        let asked = theirs::decode_upload_segment_request(black_box(&request)).expect("a request");
        let last = at + piece.len() == data.len();
        let response = theirs::encode_data_segment(piece, asked, last).expect("a segment");
        let segment = theirs::decode_data_segment(black_box(&response)).expect("a segment");
        assert!(segment.toggle == toggle && segment.last == last);
        to[at..at + segment.data.len()].copy_from_slice(segment.data);
        at += segment.data.len();
        toggle = !toggle;
    }
    at
}

#[inline(never)]
fn their_blocks(data: &[u8], receiver: &mut block::BlockReceiver<ROOM>) -> usize {
    *receiver = block::BlockReceiver::new();
    let mut writer = block::BlockWriter::new(data, 127);
    let mut sent = 0;
    while sent < data.len() {
        while let Some(segment) = writer.next_segment() {
            receiver.push(&block::decode_sub_segment(black_box(&segment))).expect("in order");
            sent += 7;
        }
        let confirmed = block::encode_sub_response(127, 127);
        let (_, block_size) = block::decode_sub_response(black_box(&confirmed)).expect("a confirmation");
        writer.start_sub_block(block_size);
    }
    let end = writer.end_frame(true);
    let (unused, crc) = block::decode_end(black_box(&end)).expect("an end");
    receiver.finish(unused, crc, true).expect("right").len()
}

pub(super) fn run(judge: &mut Judge) {
    let mut memory = [0; TABLE.memory()];
    let mut dictionary = Dictionary::new(TABLE.view(), &mut memory, ()).expect("enough memory");
    let (mut client, mut server) = (Client::new(CHANNEL), Server::new(CHANNEL, NEXT_REQUEST));
    assert_eq!(our_expedited(&mut client, &mut server, &mut dictionary), their_expedited());
    let mut contenders = [
        Contender::new("ours", || _ = black_box(our_expedited(&mut client, &mut server, &mut dictionary))),
        Contender::new("canopen-rs", || _ = black_box(their_expedited())),
    ];
    let times = judge.measure(1005, &mut contenders);
    judge.faster("expedited round trips", 0.75, (ROUND_TRIPS.into(), "M/s "), &times);

    let data: Vec<u8> = (0..KIB64).map(|i| (i * 7 + i / 256) as u8).collect();
    let mut their_buffer = vec![0; KIB64];
    let mut receiver = Box::new(block::BlockReceiver::<ROOM>::new());
    assert_eq!(their_segments(&data, &mut their_buffer), KIB64);
    assert_eq!(their_buffer, data);
    assert_eq!(their_blocks(&data, &mut receiver), KIB64);
    let segmented = Options::new(Duration::from_millis(100));
    let blocks = Options { block: Some(Block::default()), ..segmented };
    for (what, options, bar) in
        [("64 KiB in segments", segmented, 0.5), ("64 KiB in blocks, with CRC", blocks, 1.6)]
    {
        let mut objects = Domain(data.clone());
        let mut to = vec![0; KIB64];
        let mut run = || {
            let mut client = Client::new(CHANNEL);
            let mut server = Server::new(CHANNEL, NEXT_REQUEST);
            assert_eq!(our_upload(&mut client, &mut server, &mut objects, &options, &mut to), KIB64 as u32);
        };
        run();
        let mut contenders = [
            Contender::new("ours", run),
            Contender::new("canopen-rs", || {
                _ = black_box(if options.block.is_some() {
                    their_blocks(black_box(&data), &mut receiver)
                } else {
                    their_segments(black_box(&data), &mut their_buffer)
                });
            }),
        ];
        let times = judge.measure(201, &mut contenders);
        judge.faster(what, bar, (KIB64 as f64, "MB/s"), &times);
        drop(contenders);
        assert_eq!(to, data);
    }
}
