//! Typed channel contents.

/// What a channel carries, as the application understands it: 0…8 bytes.
///
/// The byte order is the application's: CAN Link carries bytes. The implementations here are
/// little-endian, like everything else on these machines.
pub trait Payload: Sized {
    /// Length on the wire in bytes, at most 8.
    const LEN: usize;

    /// The bytes, of which the first [`LEN`](Self::LEN) are sent.
    fn encode(&self) -> [u8; 8];

    /// What [`LEN`](Self::LEN) bytes say; `None` for any other number of bytes, or a value that
    /// means nothing.
    fn decode(data: &[u8]) -> Option<Self>;
}

macro_rules! integers {
    ($($integer:ty),*) => {$(
        impl Payload for $integer {
            const LEN: usize = size_of::<$integer>();

            fn encode(&self) -> [u8; 8] {
                let mut bytes = [0; 8];
                bytes.iter_mut().zip(self.to_le_bytes()).for_each(|(to, byte)| *to = byte);
                bytes
            }

            fn decode(data: &[u8]) -> Option<Self> {
                data.try_into().ok().map(Self::from_le_bytes)
            }
        }
    )*};
}

integers!(u8, i8, u16, i16, u32, i32, u64, i64, f32, f64);

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_lowest_byte_comes_first() {
        assert_eq!(0x1234_5678_u32.encode(), [0x78, 0x56, 0x34, 0x12, 0, 0, 0, 0]);
        assert_eq!(i16::decode(&[0xFE, 0xFF]), Some(-2));
        assert_eq!(i16::decode(&[0xFE]), None);
        assert_eq!(i16::decode(&[0xFE, 0xFF, 0]), None);
    }

    proptest! {
        #[test]
        fn what_is_encoded_is_decoded(a: i32, b: u64, c: i8) {
            prop_assert_eq!(i32::decode(&a.encode()[..i32::LEN]), Some(a));
            prop_assert_eq!(u64::decode(&b.encode()[..u64::LEN]), Some(b));
            prop_assert_eq!(i8::decode(&c.encode()[..i8::LEN]), Some(c));
        }
    }
}
