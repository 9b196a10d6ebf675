//! Packing and unpacking of any mapping.

use pdo::mapping::Entry;
use pdo::{Bits, Mapping, Payload};
use proptest::prelude::*;

/// Widths that together have at most 64 bits.
fn widths() -> impl Strategy<Value = Vec<u8>> {
    prop::collection::vec(prop_oneof![1u8..=8, 1u8..=64], 1..=64).prop_map(|widths| {
        let mut sum = 0u32;
        widths
            .into_iter()
            .take_while(|&bits| {
                sum += u32::from(bits);
                sum <= 64
            })
            .collect()
    })
}

proptest! {
    #[test]
    fn what_is_packed_is_unpacked(widths in widths(), values in prop::collection::vec(any::<u64>(), 64)) {
        let entries: Vec<Entry> =
            widths.iter().enumerate().map(|(i, &bits)| Entry::new(0x2000, i as u8, bits)).collect();
        let mapping: Mapping = Mapping::new(&entries).unwrap();
        let payload = mapping.pack(|entry| values[usize::from(entry.at.sub)]);
        prop_assert_eq!(payload.len(), mapping.bytes());

        // Bit by bit, as the standard draws it.
        let mut bit = 0;
        for (entry, found) in mapping.unpack(payload).unwrap() {
            let value = values[usize::from(entry.at.sub)];
            prop_assert_eq!(found, Bits::new(value, entry.bits));
            for i in 0..entry.bits {
                let byte = payload.bytes()[bit / 8];
                prop_assert_eq!(byte >> (bit % 8) & 1, (value >> i & 1) as u8);
                bit += 1;
            }
        }
        prop_assert_eq!(bit, usize::from(mapping.bits()));
    }

    #[test]
    fn signs(value: i64, bits in 1u8..=64) {
        let cut = value << (64 - bits) >> (64 - bits);
        prop_assert_eq!(Bits::from_signed(value, bits).signed(), cut);
    }

    #[test]
    fn payloads(data in prop::collection::vec(any::<u8>(), 0..=8)) {
        let payload = Payload::from_slice(&data);
        prop_assert_eq!(&payload.bytes()[..data.len()], &data[..]);
        prop_assert_eq!(Payload::new(payload.word(), payload.len()), payload);
        let id = embedded_can::StandardId::new(0x181).unwrap();
        let frame = payload.frame(id);
        prop_assert_eq!(frame.data(), &data[..]);
    }

    #[test]
    fn entries(raw: u32) {
        prop_assert_eq!(Entry::from_raw(raw).raw(), raw);
    }
}
