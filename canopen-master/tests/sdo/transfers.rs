//! Whole transfers between both sides.

use canopen_master::sdo::{AbortCode, Address, Options, Outcome};

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
