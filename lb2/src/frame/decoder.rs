//! Finding telegrams in a byte stream: any chunking, any garbage, no good frame lost (decision 2).

use core::fmt;

#[cfg(target_pointer_width = "64")]
use super::wide::{self, Front, SLACK};
use super::{Frame, HEAD_0, HEAD_1, MAX_BLOCK};
#[cfg(not(target_pointer_width = "64"))]
const SLACK: usize = 0;

/// What the decoder found next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Item<'a> {
    /// A telegram whose number and check byte are right.
    Frame {
        /// Wire offset of its head since the decoder was made, in bytes.
        offset: u64,
        /// The telegram, borrowed from the input where it lies there unstuffed in one piece.
        frame: Frame<'a>,
    },
    /// Bytes that are no telegram.
    Damage(Damage),
}

/// One report of damage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Damage {
    /// Wire offset since the decoder was made: of the false head, or of the first byte that belongs
    /// to nothing.
    pub offset: u64,
    /// What is wrong.
    pub kind: DamageKind,
}

/// Every kind of damage that the decoder tells apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum DamageKind {
    /// Bytes between telegrams. One report for the whole run up to the next good frame, unless
    /// another kind of damage was reported in that run before.
    Garbage,
    /// The number byte is below 2: there is no room for function and check byte.
    Number {
        /// The number byte that came.
        found: u8,
    },
    /// A new head 82h 96h inside the block: the telegram was cut short.
    CutShort,
    /// 82h followed by neither 82h nor 96h (failure 39 of manual A 4.3.4.2).
    RepeatMissing {
        /// The byte that came in place of the second 82h.
        found: u8,
    },
    /// The check byte is not the XOR of the block (failure 35).
    CheckByte {
        /// XOR of number, function and data that came.
        expected: u8,
        /// The check byte that came.
        found: u8,
    },
    /// The line fell silent inside the telegram ([`Decoder::gap`]).
    Gap,
}

impl fmt::Display for DamageKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Garbage => f.write_str("bytes outside telegrams"),
            Self::Number { found } => write!(f, "number byte {found:02X}h, at least 02h expected"),
            Self::CutShort => f.write_str("cut short by a new head"),
            Self::RepeatMissing { found } => write!(f, "82h followed by {found:02X}h, not by its repeat"),
            Self::CheckByte { expected, found } => {
                write!(f, "check byte {found:02X}h, {expected:02X}h expected")
            }
            Self::Gap => f.write_str("cut short by silence"),
        }
    }
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at byte {}", self.kind, self.offset)
    }
}

/// Finds telegrams in a byte stream.
///
/// - Input: [`decode`](Self::decode) with the next bytes in any chunking, [`gap`](Self::gap) when
///   the line was silent longer than a telegram allows.
/// - Output: the [`Item`]s that `decode` returns, in wire order.
/// - Counters: [`discarded`](Self::discarded), [`position`](Self::position).
///
/// After damage the search for the next head goes on from the byte after the false head, so a good
/// telegram that follows, or lies inside, is never lost. Outside of telegrams `82h 82h 96h` holds a
/// head at its second byte.
#[derive(Debug, Clone)]
pub struct Decoder {
    /// Bytes held, each doubled 82h once: of the open block, or still to be searched for a head.
    units: [u8; MAX_BLOCK + SLACK],
    end: usize,
    /// How many units at the front are a frame that the caller has seen.
    spent: usize,
    /// Wire offset of the first unit that is not spent.
    base: u64,
    /// The units are an open block, whose head is at `base - 2`.
    in_block: bool,
    /// The last wire byte is an 82h that waits for its successor.
    escape: bool,
    /// `gap` was called and its consequences are not all told yet.
    gap: bool,
    /// Damage was reported since the last good frame.
    reported: bool,
    /// Wire offset of the next input byte.
    position: u64,
    /// Wire offset up to which every byte is counted as good or in `discarded`.
    accounted: u64,
    discarded: u64,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

/// What `step` found, without a borrow.
enum Found {
    /// A block in `units` (held) or in the input.
    Frame {
        offset: u64,
        held: bool,
        at: usize,
        len: usize,
    },
    Damage(Damage),
}

impl Decoder {
    /// A decoder at wire offset 0, outside of any telegram.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            units: [0; MAX_BLOCK + SLACK],
            end: 0,
            spent: 0,
            base: 0,
            in_block: false,
            escape: false,
            gap: false,
            reported: false,
            position: 0,
            accounted: 0,
            discarded: 0,
        }
    }

    /// Takes bytes from the front of `input` up to and including those of the next item; returns
    /// how many, and the item. Call again with the rest of the input until the item is `None`: then
    /// all of it has been taken.
    ///
    /// ```
    /// use lb2::frame::{Decoder, Item};
    /// let mut decoder = Decoder::new();
    /// let mut rest: &[u8] = &[0x00, 0x82, 0x96, 0x02, 0x40, 0x42, 0x82];
    /// let mut frames = 0;
    /// loop {
    ///     let (taken, item) = decoder.decode(rest);
    ///     rest = &rest[taken..];
    ///     match item {
    ///         Some(Item::Frame { offset, frame }) => {
    ///             assert_eq!((offset, frame.function()), (1, 0x40));
    ///             frames += 1;
    ///         }
    ///         Some(Item::Damage(damage)) => assert_eq!(damage.offset, 0),
    ///         None => break,
    ///     }
    /// }
    /// assert_eq!((frames, decoder.discarded()), (1, 1));
    /// ```
    #[inline]
    pub fn decode<'a>(&'a mut self, input: &'a [u8]) -> (usize, Option<Item<'a>>) {
        #[cfg(target_pointer_width = "64")]
        if self.idle()
            && let Some(front) = wide::front(input)
            && let Some(raw) = input.get(2..)
        {
            match front {
                Front::Plain(len) => {
                    let offset = self.whole(len);
                    let frame = Frame { block: raw.get(..len).unwrap_or(&[]) };
                    return (2 + len, Some(Item::Frame { offset, frame }));
                }
                Front::Stuffed { len, xor } => {
                    if let Some(wire) = wide::stuffed(raw, len, xor, &mut self.units) {
                        let offset = self.whole(wire);
                        let frame = Frame { block: self.units.get(..len).unwrap_or(&[]) };
                        return (2 + wire, Some(Item::Frame { offset, frame }));
                    }
                }
            }
        }
        let (taken, found) = self.step(input);
        let item = match found {
            None => None,
            Some(Found::Damage(damage)) => Some(Item::Damage(damage)),
            Some(Found::Frame { offset, held, at, len }) => {
                let source = if held { &self.units } else { input };
                let block = source.get(at..at + len).unwrap_or(&[]);
                Some(Item::Frame { offset, frame: Frame { block } })
            }
        };
        (taken, item)
    }

    /// Says that the line was silent for longer than telegrams allow: an open telegram ends here.
    /// What follows from it comes out of the next calls of [`decode`](Self::decode) (an empty input
    /// will do). Without an open telegram this does nothing.
    pub fn gap(&mut self) {
        self.gap = self.in_block || self.escape || self.end > 0;
    }

    /// Whether a head, or the first byte of one, has been seen whose telegram is not complete.
    #[must_use]
    pub const fn in_telegram(&self) -> bool {
        self.in_block || self.escape
    }

    /// Wire offset of the next byte: bytes taken since the decoder was made.
    #[must_use]
    pub const fn position(&self) -> u64 {
        self.position
    }

    /// Bytes known to lie outside of good telegrams so far.
    #[must_use]
    pub fn discarded(&self) -> u64 {
        let frontier = if self.in_block {
            self.base.saturating_sub(2)
        } else if self.end > 0 {
            self.base
        } else {
            self.position.saturating_sub(u64::from(self.escape))
        };
        self.discarded.saturating_add(frontier.saturating_sub(self.accounted))
    }

    /// Nothing is held: the next byte stands outside of any telegram.
    #[cfg(target_pointer_width = "64")]
    #[inline]
    fn idle(&self) -> bool {
        !(self.in_block | self.escape | self.gap | (self.end > 0))
    }

    /// A whole telegram, `len` bytes after its head, is taken: returns the offset of its head.
    #[inline]
    fn whole(&mut self, len: usize) -> u64 {
        let offset = self.position;
        self.position += 2 + len as u64;
        self.good(offset, self.position);
        offset
    }

    #[inline(never)]
    fn step(&mut self, input: &[u8]) -> (usize, Option<Found>) {
        let mut taken = 0;
        if self.spent > 0 {
            self.drop_front(self.spent);
            self.spent = 0;
        }
        loop {
            if !self.in_block
                && let Some(found) = self.search_held()
            {
                return (taken, Some(found));
            }
            if self.in_block
                && let Some(found) = self.judge_block()
            {
                return (taken, Some(found));
            }
            if self.gap {
                if self.in_block {
                    return (taken, Some(self.reject(DamageKind::Gap)));
                }
                self.gap = false;
                if core::mem::take(&mut self.escape)
                    && let Some(found) = self.garbage()
                {
                    return (taken, Some(found));
                }
            }
            if !self.in_block
                && !self.escape
                && let Some((len, found)) = self.direct(input.get(taken..).unwrap_or(&[]), taken)
            {
                return (taken + len, Some(found));
            }
            #[cfg(target_pointer_width = "64")]
            {
                let run = self.block_run(input.get(taken..).unwrap_or(&[]));
                if run > 0 {
                    taken += run;
                    continue;
                }
            }
            let Some(&byte) = input.get(taken) else { return (taken, None) };
            let waiting = self.escape;
            if self.in_block && waiting && byte != HEAD_0 {
                let kind = match byte {
                    HEAD_1 => DamageKind::CutShort,
                    found => DamageKind::RepeatMissing { found },
                };
                return (taken, Some(self.reject(kind)));
            }
            taken += 1;
            self.position += 1;
            self.escape = byte == HEAD_0 && !(self.in_block && waiting);
            if byte == HEAD_0 && !waiting {
                continue;
            }
            if self.in_block {
                // A block is judged after every byte, so it never outgrows `units`.
                if let Some(unit) = self.units.get_mut(self.end) {
                    *unit = byte;
                    self.end += 1;
                }
            } else if byte == HEAD_1 && waiting {
                self.in_block = true;
                self.base = self.position;
                self.end = 0;
            } else if let Some(found) = self.garbage() {
                return (taken, Some(found));
            }
        }
    }

    /// A whole telegram without doubled bytes at the front of `rest`, left where it lies.
    fn direct(&mut self, rest: &[u8], taken: usize) -> Option<(usize, Found)> {
        let [HEAD_0, HEAD_1, number, ..] = *rest else { return None };
        let len = usize::from(number) + 1;
        let block = rest.get(2..2 + len)?;
        let mut check = 0;
        for &byte in block {
            if byte == HEAD_0 {
                return None;
            }
            check ^= byte;
        }
        if number < 2 || check != 0 {
            return None;
        }
        let offset = self.whole(len);
        Some((2 + len, Found::Frame { offset, held: false, at: taken + 2, len }))
    }

    /// The open block is complete, or cannot become a frame, or `None`: it needs more bytes.
    fn judge_block(&mut self) -> Option<Found> {
        let held = self.units.get(..self.end)?;
        let &number = held.first()?;
        if number < 2 {
            return Some(self.reject(DamageKind::Number { found: number }));
        }
        let len = usize::from(number) + 1;
        let block = held.get(..len)?;
        let (mut rest, mut check, mut wire) = (0, 0, len);
        for &byte in block {
            rest ^= byte;
            check = byte;
            wire += usize::from(byte == HEAD_0);
        }
        if rest != 0 {
            return Some(self.reject(DamageKind::CheckByte { expected: rest ^ check, found: check }));
        }
        let offset = self.base.wrapping_sub(2);
        self.base += wire as u64;
        if self.end == len {
            self.end = 0;
        } else {
            self.spent = len;
        }
        self.in_block = false;
        self.good(offset, self.base);
        Some(Found::Frame { offset, held: true, at: 0, len })
    }

    /// Looks for a head among bytes held from a rejected block: 82h (sent twice, so that the second
    /// one begins the head and the first one is garbage) followed by 96h.
    fn search_held(&mut self) -> Option<Found> {
        if self.end == 0 {
            return None;
        }
        if let Some(found) = self.garbage() {
            return Some(found);
        }
        let held = self.units.get(..self.end).unwrap_or(&[]);
        let (mut wire, mut last) = (0_usize, 0);
        for (at, &unit) in held.iter().enumerate() {
            wire += 1 + usize::from(unit == HEAD_0);
            if (last, unit) == (HEAD_0, HEAD_1) {
                self.base += wire as u64;
                self.drop_front(at + 1);
                self.in_block = true;
                return None;
            }
            last = unit;
        }
        self.escape |= last == HEAD_0;
        self.end = 0;
        None
    }

    /// Drops `count` units, moves the others to the front.
    fn drop_front(&mut self, count: usize) {
        self.end = self.end.saturating_sub(count);
        for to in 0..self.end {
            let unit = self.units.get(count + to).copied().unwrap_or(0);
            if let Some(room) = self.units.get_mut(to) {
                *room = unit;
            }
        }
    }

    /// Takes what the open block still wants up to the next 82h; returns how many bytes.
    #[cfg(target_pointer_width = "64")]
    fn block_run(&mut self, rest: &[u8]) -> usize {
        if !self.in_block || self.escape {
            return 0;
        }
        let wanted = match self.units.first() {
            Some(&number) if self.end > 0 => (usize::from(number) + 1).saturating_sub(self.end),
            _ => 1,
        };
        let rest = rest.get(..wanted).unwrap_or(rest);
        let run = rest.iter().position(|&byte| byte == HEAD_0).unwrap_or(rest.len());
        let (Some(units), Some(rest)) = (self.units.get_mut(self.end..self.end + run), rest.get(..run))
        else {
            return 0;
        };
        units.copy_from_slice(rest);
        self.end += run;
        self.position += run as u64;
        run
    }

    #[cold]
    #[inline(never)]
    fn reject(&mut self, kind: DamageKind) -> Found {
        self.in_block = false;
        self.reported = true;
        Found::Damage(Damage { offset: self.base.wrapping_sub(2), kind })
    }

    /// Reports garbage once between two good frames, unless other damage was reported there.
    #[cold]
    #[inline(never)]
    fn garbage(&mut self) -> Option<Found> {
        if core::mem::replace(&mut self.reported, true) {
            return None;
        }
        Some(Found::Damage(Damage { offset: self.accounted, kind: DamageKind::Garbage }))
    }

    #[inline]
    fn good(&mut self, from: u64, to: u64) {
        self.discarded = self.discarded.wrapping_add(from.wrapping_sub(self.accounted));
        self.accounted = to;
        self.reported = false;
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;

    type Seen = (Vec<(u64, Vec<u8>)>, Vec<(u64, DamageKind)>, u64);

    fn run(chunks: &[&[u8]]) -> Seen {
        let mut decoder = Decoder::new();
        let (mut frames, mut damage) = (Vec::new(), Vec::new());
        for chunk in chunks {
            let mut rest = *chunk;
            loop {
                let (taken, item) = decoder.decode(rest);
                match item {
                    Some(Item::Frame { offset, frame }) => frames.push((offset, frame.block().to_vec())),
                    Some(Item::Damage(d)) => damage.push((d.offset, d.kind)),
                    None => break,
                }
                rest = &rest[taken..];
            }
        }
        (frames, damage, decoder.discarded())
    }

    fn any_chunking(stream: &[u8]) -> Seen {
        let whole = run(&[stream]);
        for size in 1..stream.len() {
            assert_eq!(run(&stream.chunks(size).collect::<Vec<_>>()), whole, "chunks of {size}");
        }
        whole
    }

    const SELECT: [u8; 6] = [0x82, 0x96, 0x03, 0x00, 0x02, 0x01];

    #[test]
    fn a_good_frame_lies_in_the_input() {
        let mut decoder = Decoder::new();
        let (taken, item) = decoder.decode(&SELECT);
        assert_eq!(taken, 6);
        let Some(Item::Frame { frame, .. }) = item else { panic!("no frame") };
        assert_eq!(frame.block().as_ptr(), SELECT[2..].as_ptr());
    }

    #[test]
    fn garbage_before_and_between_is_counted() {
        let stream = [&[1, 2, 0x82][..], &SELECT, &[0x96, 0x82, 0x82], &SELECT].concat();
        let (frames, damage, discarded) = any_chunking(&stream);
        assert_eq!(frames.iter().map(|f| f.0).collect::<Vec<_>>(), [3, 12]);
        assert_eq!(damage, [(0, DamageKind::Garbage), (9, DamageKind::Garbage)]);
        assert_eq!(discarded, 6);
    }

    /// Decision 2: a new head inside a block ends the old one, and the new frame is not lost.
    #[test]
    fn a_head_inside_a_block_starts_a_new_frame() {
        let stream = [&[0x82, 0x96, 0x09, 0xCC, 0x30][..], &SELECT].concat();
        let (frames, damage, discarded) = any_chunking(&stream);
        assert_eq!((frames.len(), frames[0].0), (1, 5));
        assert_eq!(damage, [(0, DamageKind::CutShort)]);
        assert_eq!(discarded, 5);
    }

    /// Decision 2: 82h followed by neither 82h nor 96h is failure 39.
    #[test]
    fn a_missing_repeat_is_named() {
        let stream = [&[0x82, 0x96, 0x09, 0xCC, 0x82, 0x30][..], &SELECT].concat();
        let (frames, damage, _) = any_chunking(&stream);
        assert_eq!(frames[0].0, 6);
        assert_eq!(damage, [(0, DamageKind::RepeatMissing { found: 0x30 })]);
    }

    /// Decision 2: a noise byte 82h before a frame hides its head inside a false block as
    /// `82h 82h 96h`; the frame is found all the same.
    #[test]
    fn a_good_frame_inside_a_false_one_is_found() {
        for number in [0x04, 0x09, 0x40] {
            let stream = [&[0x82, 0x96, number, 0x11, 0x82][..], &SELECT, &[0x55; 80], &SELECT].concat();
            let (frames, damage, _) = any_chunking(&stream);
            assert_eq!(frames.iter().map(|f| f.0).collect::<Vec<_>>(), [5, 91], "number {number}");
            assert!(matches!(damage[0], (0, DamageKind::CheckByte { .. })));
        }
    }

    #[test]
    fn check_byte_and_number_errors_say_what_came() {
        let (_, damage, _) = any_chunking(&[0x82, 0x96, 0x03, 0x00, 0x02, 0x07, 0x82, 0x96, 0x01, 0x01]);
        assert_eq!(
            damage,
            [
                (0, DamageKind::CheckByte { expected: 0x01, found: 0x07 }),
                (6, DamageKind::Number { found: 1 })
            ]
        );
    }

    #[test]
    fn silence_ends_a_frame_and_frees_what_it_swallowed() {
        let mut decoder = Decoder::new();
        let stream = [&[0x82, 0x96, 0xF0, 0x11, 0x82][..], &SELECT, &[0x82]].concat();
        assert_eq!(decoder.decode(&stream), (stream.len(), None));
        assert!(decoder.in_telegram());
        decoder.gap();
        let damage = Damage { offset: 0, kind: DamageKind::Gap };
        assert_eq!(decoder.decode(&[]), (0, Some(Item::Damage(damage))));
        let (_, item) = decoder.decode(&[]);
        assert!(matches!(item, Some(Item::Frame { offset: 5, .. })), "{item:?}");
        // The 82h before the silence does not join a 96h after it.
        let (_, item) = decoder.decode(&[0x96, 0x02, 0x40, 0x42]);
        assert_eq!(item, Some(Item::Damage(Damage { offset: 11, kind: DamageKind::Garbage })));
        assert_eq!(decoder.decode(&[0x96, 0x02, 0x40, 0x42]).1, None);
    }
}
