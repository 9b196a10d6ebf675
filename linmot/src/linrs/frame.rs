//! Frames on the line: 01h, ID, length, 02h, sub ID, main ID, data, checksum where it is configured,
//! 04h. The length counts from the 02h to the last byte of data.

use crc::{CRC_16_KERMIT, Crc, Table};

use crate::upid::Upid;

/// Most bytes of data: a length of 63 less 02h and the two IDs.
pub const MAX_DATA: usize = 60;
/// Most bytes of a frame: head, length, checksum, end.
pub const MAX_FRAME: usize = 3 + 63 + 2 + 1;

const START: u8 = 0x01;
const START_DATA: u8 = 0x02;
const END: u8 = 0x04;
const MIN_LENGTH: u8 = 3;
const MAX_LENGTH: u8 = 63;

static CRC: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_KERMIT);

/// Checksum of a line, UPID 2080h. The document names the kinds; that they cover everything from the
/// 01h to the last byte of data, and that the CRC begins with 0, is project-defined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Checksum {
    /// None, as drives are delivered.
    #[default]
    None,
    /// Sum of the bytes modulo 2^16.
    Sum,
    /// CRC-CCITT, 1021h reflected.
    Crc,
}

impl Checksum {
    /// The parameter that says which one a drive uses.
    pub const UPID: Upid = Upid(0x2080);

    /// As a value of [`UPID`](Self::UPID); the numbers are project-defined.
    #[must_use]
    pub const fn raw(self) -> u32 {
        self as u32
    }

    /// What a value of [`UPID`](Self::UPID) says; `None` above 2.
    #[must_use]
    pub fn from_raw(raw: u32) -> Option<Self> {
        [Self::None, Self::Sum, Self::Crc].into_iter().find(|checksum| checksum.raw() == raw)
    }

    const fn len(self) -> usize {
        match self {
            Self::None => 0,
            Self::Sum | Self::Crc => 2,
        }
    }

    fn of(self, bytes: &[u8]) -> u16 {
        match self {
            Self::None => 0,
            Self::Sum => bytes.iter().fold(0, |sum: u16, byte| sum.wrapping_add((*byte).into())),
            Self::Crc => CRC.checksum(bytes),
        }
    }
}

/// What a frame says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Message {
    /// Of the drive that is addressed or answers.
    pub id: u8,
    /// Sub ID.
    pub sub: u8,
    /// Main ID; 00h in answers.
    pub main: u8,
    len: u8,
    data: [u8; MAX_DATA],
}

impl Message {
    /// A message with this data; what is beyond [`MAX_DATA`] bytes is cut off.
    #[must_use]
    pub fn new(id: u8, sub: u8, main: u8, data: &[u8]) -> Self {
        let mut message = Self { id, sub, main, len: data.len().min(MAX_DATA) as u8, data: [0; MAX_DATA] };
        for (room, byte) in message.data.iter_mut().zip(data) {
            *room = *byte;
        }
        message
    }

    /// Its data.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&[])
    }

    /// Writes the frame to the front of `out` and returns its length.
    pub fn encode(&self, checksum: Checksum, out: &mut [u8; MAX_FRAME]) -> usize {
        let data = self.data();
        let mut at = 0;
        let mut put = |out: &mut [u8; MAX_FRAME], bytes: &[u8]| {
            if let Some(room) = out.get_mut(at..at + bytes.len()) {
                room.copy_from_slice(bytes);
                at += bytes.len();
            }
            at
        };
        let length = MIN_LENGTH.saturating_add(self.len);
        put(out, &[START, self.id, length, START_DATA, self.sub, self.main]);
        let covered = put(out, data);
        if checksum != Checksum::None {
            let sum = checksum.of(out.get(..covered).unwrap_or(&[]));
            put(out, &sum.to_le_bytes());
        }
        put(out, &[END])
    }
}

/// Finds frames in a stream of bytes. A frame that follows damage is never lost: after a false start
/// the search goes on from the byte behind it.
#[derive(Debug, Clone)]
pub struct Decoder {
    checksum: Checksum,
    buffer: [u8; MAX_FRAME],
    len: usize,
    discarded: u64,
}

impl Decoder {
    /// Nothing received.
    #[must_use]
    pub const fn new(checksum: Checksum) -> Self {
        Self { checksum, buffer: [0; MAX_FRAME], len: 0, discarded: 0 }
    }

    /// Bytes that belonged to no good frame.
    #[must_use]
    pub const fn discarded(&self) -> u64 {
        self.discarded
    }

    /// Whether a frame has begun and not ended.
    #[must_use]
    pub const fn in_frame(&self) -> bool {
        self.len > 0
    }

    /// Takes bytes from the front of `bytes` until a frame is complete or they are used up, and says
    /// how many. Call it again with the rest; with nothing, after [`gap`](Self::gap).
    pub fn decode(&mut self, bytes: &[u8]) -> (usize, Option<Message>) {
        let mut taken = 0;
        loop {
            if let Some(message) = self.take() {
                return (taken, Some(message));
            }
            let Some(byte) = bytes.get(taken) else { return (taken, None) };
            taken += 1;
            // A buffer that `take` could not use is never full.
            if let Some(room) = self.buffer.get_mut(self.len) {
                *room = *byte;
                self.len += 1;
            }
        }
    }

    /// The line was silent: a frame that has begun has not ended in time.
    pub fn gap(&mut self) {
        if self.len > 0 {
            self.drop_front(1);
        }
    }

    fn drop_front(&mut self, count: usize) {
        self.buffer.copy_within(count..self.len, 0);
        self.len -= count;
        self.discarded = self.discarded.saturating_add(count as u64);
    }

    fn take(&mut self) -> Option<Message> {
        loop {
            let held = self.buffer.get(..self.len)?;
            match examine(held, self.checksum) {
                Verdict::Incomplete => return None,
                Verdict::No => self.drop_front(1),
                Verdict::Good(message, length) => {
                    self.buffer.copy_within(length..self.len, 0);
                    self.len -= length;
                    return Some(message);
                }
            }
        }
    }
}

enum Verdict {
    Incomplete,
    No,
    Good(Message, usize),
}

fn examine(held: &[u8], checksum: Checksum) -> Verdict {
    let head = (held.first(), held.get(2), held.get(3));
    let length = match head {
        (None, ..) => return Verdict::Incomplete,
        (Some(&first), ..) if first != START => return Verdict::No,
        (_, Some(length), _) if !(MIN_LENGTH..=MAX_LENGTH).contains(length) => return Verdict::No,
        (_, _, Some(&data)) if data != START_DATA => return Verdict::No,
        (_, Some(&length), Some(_)) => usize::from(length),
        _ => return Verdict::Incomplete,
    };
    let covered = 3 + length;
    let Some(tail) = held.get(covered..=covered + checksum.len()) else { return Verdict::Incomplete };
    let (Some(frame), Some((&end, sum))) = (held.get(..covered), tail.split_last()) else {
        return Verdict::No;
    };
    let sums = checksum == Checksum::None || sum == checksum.of(frame).to_le_bytes();
    match frame {
        [_, id, _, _, sub, main, data @ ..] if end == END && sums => {
            Verdict::Good(Message::new(*id, *sub, *main, data), covered + checksum.len() + 1)
        }
        _ => Verdict::No,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn all(decoder: &mut Decoder, mut bytes: &[u8]) -> Vec<Message> {
        let mut found = Vec::new();
        loop {
            let (taken, message) = decoder.decode(bytes);
            bytes = &bytes[taken..];
            match message {
                Some(message) => found.push(message),
                None => return found,
            }
        }
    }

    /// LinRS manual, "read ROM value": P gain of the position controller.
    #[test]
    fn the_documents_example() {
        let wire = [0x01, 0x11, 0x05, 0x02, 0x00, 0x05, 0xA2, 0x13, 0x04];
        let message = Message::new(0x11, 0x00, 0x05, &[0xA2, 0x13]);
        let mut out = [0xA5; MAX_FRAME];
        let len = message.encode(Checksum::None, &mut out);
        assert_eq!(out[..len], wire);
        assert_eq!(all(&mut Decoder::new(Checksum::None), &wire), [message]);
    }

    #[test]
    fn a_frame_behind_a_false_start_is_found() {
        let good = [0x01, 0x11, 0x03, 0x02, 0x03, 0x06, 0x04];
        let mut decoder = Decoder::new(Checksum::None);
        let mut bytes = Vec::from([0x55, 0x01, 0x11, 0x3F, 0x02, 0x00]);
        bytes.extend(good);
        assert_eq!(all(&mut decoder, &bytes), []);
        // The false start promises 63 bytes; silence ends it.
        decoder.gap();
        assert_eq!(all(&mut decoder, &[]), [Message::new(0x11, 3, 6, &[])]);
        assert_eq!((decoder.discarded(), decoder.in_frame()), (6, false));
    }

    proptest! {
        #[test]
        fn frames_come_back_in_any_pieces(
            id: u8, sub: u8, main: u8,
            data in proptest::collection::vec(any::<u8>(), 0..=MAX_DATA),
            kind in prop_oneof![Just(Checksum::None), Just(Checksum::Sum), Just(Checksum::Crc)],
            noise in proptest::collection::vec(2u8.., 0..20),
            cut in 1usize..9,
        ) {
            let message = Message::new(id, sub, main, &data);
            let mut out = [0; MAX_FRAME];
            let len = message.encode(kind, &mut out);
            let mut wire = noise.clone();
            wire.extend(&out[..len]);
            let mut decoder = Decoder::new(kind);
            let found: Vec<_> = wire.chunks(cut).flat_map(|piece| all(&mut decoder, piece)).collect();
            prop_assert_eq!(found, [message]);
            prop_assert_eq!(decoder.discarded(), noise.len() as u64);
        }

        #[test]
        fn any_bytes_are_survived(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            let mut decoder = Decoder::new(Checksum::Sum);
            all(&mut decoder, &bytes);
            while decoder.in_frame() {
                decoder.gap();
                all(&mut decoder, &[]);
            }
        }
    }
}
