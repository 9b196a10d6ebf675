//! Whole transfers between both sides.

use canopen_master::sdo::{AbortCode, Address, Block, Options, Outcome};

use super::pair::{AT, Pair};

/// Bytes that differ from their neighbours.
fn bytes(len: usize) -> Vec<u8> {
    (0..len).map(|i| (i * 7 + i / 256) as u8).collect()
}

#[test]
fn all_small_sizes_both_ways() {
    for len in 0..300 {
        let data = bytes(len);
        let mut pair = Pair::new(&data);
        pair.client.upload(AT, Vec::new(), &Options::default()).unwrap();
        let up = pair.run();
        assert_eq!((up.outcome, &up.buffer), (Outcome::Done(len as u32), &data));

        let mut pair = Pair::new(&[]);
        pair.client.download(AT, data.clone(), &Options::default()).unwrap();
        assert_eq!(pair.run().outcome, Outcome::Done(len as u32));
        assert_eq!(pair.objects.map[&AT].data, data);
        if len <= 8 {
            assert_eq!(pair.objects.pieces, [(0, len, true)], "up to 8 bytes come in one piece");
        }
    }
}

#[test]
fn objects_of_unknown_size() {
    for len in [0, 1, 6, 7, 8, 9, 13, 14, 15, 100] {
        let data = bytes(len);
        let mut pair = Pair::new(&data);
        pair.objects.map.get_mut(&AT).unwrap().unsized_ = true;
        pair.client.upload(AT, Vec::new(), &Options::default()).unwrap();
        let up = pair.run();
        assert_eq!((up.outcome, &up.buffer), (Outcome::Done(len as u32), &data));
    }
}

#[test]
fn a_refusal_names_the_code() {
    let mut pair = Pair::new(&[]);
    for at in [Address::new(0x3000, 0), Address::new(0x2000, 9)] {
        pair.client.upload(at, Vec::new(), &Options::default()).unwrap();
        assert_eq!(pair.run().outcome, Outcome::Aborted(AbortCode::NO_OBJECT));
        pair.client.download(at, vec![0; 20], &Options::default()).unwrap();
        assert_eq!(pair.run().outcome, Outcome::Aborted(AbortCode::NO_OBJECT));
    }
}

fn block(block_size: u8, crc: bool, threshold: u8) -> Options {
    Options { block: Some(Block { block_size, crc, threshold }), ..Options::default() }
}

#[test]
fn blocks_of_all_small_sizes_both_ways() {
    for (block_size, crc) in [(1, true), (2, false), (3, true), (127, true)] {
        let options = block(block_size, crc, 0);
        for len in 0..100 {
            let data = bytes(len);
            let mut pair = Pair::new(&data);
            pair.server = pair.server.with_block_size(block_size);
            pair.client.upload(AT, Vec::new(), &options).unwrap();
            let up = pair.run();
            assert_eq!((up.outcome, &up.buffer), (Outcome::Done(len as u32), &data));

            pair.objects.map.get_mut(&AT).unwrap().data.clear();
            pair.client.download(AT, data.clone(), &options).unwrap();
            assert_eq!(pair.run().outcome, Outcome::Done(len as u32));
            assert_eq!(pair.objects.map[&AT].data, data);
            if len <= 8 {
                assert_eq!(pair.objects.pieces, [(0, len, true)], "up to 8 bytes come in one piece");
            }
        }
    }
}

#[test]
fn blocks_of_unknown_size() {
    for len in [0, 1, 7, 8, 14, 100, 888, 889, 890] {
        let data = bytes(len);
        let mut pair = Pair::new(&data);
        pair.objects.map.get_mut(&AT).unwrap().unsized_ = true;
        pair.client.upload(AT, Vec::new(), &block(127, true, 0)).unwrap();
        let up = pair.run();
        assert_eq!((up.outcome, &up.buffer), (Outcome::Done(len as u32), &data));
    }
}

/// CiA 301, 7.2.4.2.12: up to the threshold, the server answers in segments; the client does not even
/// ask.
#[test]
fn protocol_switch() {
    for (len, threshold, switched) in [(20, 20, true), (21, 20, false), (20, 0, false), (3, 255, true)] {
        let mut pair = Pair::new(&bytes(len));
        pair.client.upload(AT, Vec::new(), &block(127, true, threshold)).unwrap();
        assert_eq!(pair.run().buffer, bytes(len));
        assert_eq!(pair.log[1].data()[0] >> 5 == 2, switched, "{len} bytes, threshold {threshold}");
        pair.log.clear();
        pair.client.download(AT, bytes(len), &block(127, true, threshold)).unwrap();
        assert_eq!(pair.run().outcome, Outcome::Done(len as u32));
        assert_eq!(pair.log[0].data()[0] >> 5 == 1, switched, "{len} bytes, threshold {threshold}");
    }
}

/// 100 kB every way; a block transfer takes the frames the standard says.
#[test]
fn large() {
    let data = bytes(100_000);
    for options in [Options::default(), block(127, true, 0), block(50, false, 0)] {
        let mut pair = Pair::new(&data);
        pair.client.upload(AT, Vec::new(), &options).unwrap();
        assert_eq!(pair.run().buffer, data);
        let segments = 100_000usize.div_ceil(7);
        let frames = match options.block {
            None => 2 + 2 * segments,
            Some(block) => 3 + segments + segments.div_ceil(block.block_size.into()) + 2,
        };
        assert_eq!(pair.log.len(), frames);
        pair.objects.map.get_mut(&AT).unwrap().data.clear();
        pair.client.download(AT, data.clone(), &options).unwrap();
        assert_eq!(pair.run().outcome, Outcome::Done(100_000));
        assert_eq!(pair.objects.map[&AT].data, data);
    }
}
