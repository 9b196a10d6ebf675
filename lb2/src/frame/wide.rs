//! Whole telegrams at once, 16 bytes at a time: the fast path of builds for 64-bit processors.
//!
//! Everything here either does exactly what the byte-wise code does, or declines, and then the
//! byte-wise code does it. Nothing here has state.

use wide::u8x16;

use super::{HEAD_0, HEAD_1, MAX_BLOCK};

/// Bytes that [`stuffed`] may write beyond the block, for copies of fixed size.
pub(super) const SLACK: usize = 320;

/// Most bytes of a block that are judged as one window of 16 bytes.
const WINDOW: usize = 16;

const LOW: u64 = 0x0101_0101_0101_0101;
const HIGH: u64 = 0x8080_8080_8080_8080;

/// Longer blocks are judged in windows of this many bytes.
const LONG: usize = 64;

/// Longer blocks with doubled bytes are copied in pieces of this many bytes.
const LONG_COPY: usize = 64;

/// The last `n` bytes of a window of `N` pass through the mask at `LONG - N + n`.
static TAIL: [u8; 2 * LONG] = {
    let mut bytes = [0; 2 * LONG];
    let mut at = LONG;
    while at < 2 * LONG {
        bytes[at] = 0xFF;
        at += 1;
    }
    bytes
};

/// `FRONT[n]` lets the first `n + 1` bytes of 16 pass.
static FRONT: [u128; WINDOW] = {
    let mut masks = [0; WINDOW];
    let mut at = 0;
    while at < WINDOW {
        masks[at] = u128::MAX >> (8 * (WINDOW - 1 - at));
        at += 1;
    }
    masks
};

#[inline]
fn halves(bytes: u128) -> [u64; 2] {
    [bytes as u64, (bytes >> 64) as u64]
}

#[inline]
fn holds_head(halves: [u64; 2]) -> bool {
    let zero = |word: u64| word.wrapping_sub(LOW) & !word;
    (zero(halves[0] ^ (LOW * HEAD_0 as u64)) | zero(halves[1] ^ (LOW * HEAD_0 as u64))) & HIGH != 0
}

#[inline]
fn fold(halves: [u64; 2]) -> u8 {
    let word = halves[0] ^ halves[1];
    let word = word ^ (word >> 32);
    let word = word ^ (word >> 16);
    (word ^ (word >> 8)) as u8
}

#[inline]
fn is_head(bytes: u8x16) -> u8x16 {
    bytes.simd_eq(u8x16::splat(HEAD_0))
}

/// What is known of bytes that were looked at 16 at a time: their XOR, and whether 82h is among them.
#[derive(Clone, Copy)]
struct Seen {
    xor: u8x16,
    /// Least byte of each lane after XOR with 82h: 0 where there was one. This takes fewer
    /// instructions than comparing each byte.
    least: u8x16,
}

impl Seen {
    const NOTHING: Self = Self { xor: u8x16::ZERO, least: u8x16::MAX };

    #[inline]
    fn add(&mut self, part: u8x16) {
        let turned = part ^ u8x16::splat(HEAD_0);
        // 82h in all 16 lanes cancels out when they are folded.
        self.xor ^= turned;
        self.least = self.least.min(turned);
    }

    /// Adds the last `N` bytes, of which only the last `new` have not been added before.
    #[inline]
    fn add_tail<const N: usize>(&mut self, bytes: &[u8], new: usize) -> Option<()> {
        let mask: &[u8; N] = TAIL.get(LONG - N + new..)?.first_chunk()?;
        for (part, mask) in parts(bytes.last_chunk::<N>()?).zip(parts(mask)) {
            self.xor ^= part & mask;
            self.least = self.least.min(part ^ u8x16::splat(HEAD_0));
        }
        Some(())
    }

    #[inline]
    fn xor(&self) -> u8 {
        fold(halves(u128::from_le_bytes(self.xor.to_array())))
    }

    #[inline]
    fn holds_head(&self) -> bool {
        self.least.simd_eq(u8x16::ZERO).any()
    }
}

/// XOR of `block` and whether it holds 82h. At least 16 bytes.
#[inline]
fn judge(block: &[u8]) -> Option<(u8, bool)> {
    if block.len() < 32 {
        return judge_by::<WINDOW>(block);
    }
    judge_by::<32>(block)
}

/// [`judge`] in windows of `N` bytes. What is left at the end is judged as part of the block's last
/// `N` bytes, of which the first ones have been judged before.
#[inline]
fn judge_by<const N: usize>(block: &[u8]) -> Option<(u8, bool)> {
    let mut seen = Seen::NOTHING;
    let (windows, rest) = block.as_chunks::<N>();
    for window in windows {
        parts(window).for_each(|part| seen.add(part));
    }
    if rest.len() > WINDOW {
        seen.add_tail::<N>(block, rest.len())?;
    } else {
        seen.add_tail::<WINDOW>(block, rest.len())?;
    }
    Some((seen.xor(), seen.holds_head()))
}

/// What lies at the front of the input.
pub(super) enum Front {
    /// A head and a good block of this length without any 82h.
    Plain(usize),
    /// A head and perhaps a good block with doubled bytes, for [`stuffed`].
    Stuffed {
        /// Length of the block, each doubled byte counted once.
        len: usize,
        /// XOR of as many bytes as they lie on the wire.
        xor: u8,
    },
}

/// Looks at the front of the input. `None`: no whole block that this path can judge.
#[inline]
pub(super) fn front(input: &[u8]) -> Option<Front> {
    let [HEAD_0, HEAD_1, number, ..] = *input else { return None };
    if number < 2 {
        return None;
    }
    let number = usize::from(number);
    let (xor, heads) = match FRONT.get(number) {
        Some(&mask) => {
            let bytes = halves(u128::from_le_bytes(*input.get(2..)?.first_chunk()?) & mask);
            (fold(bytes), holds_head(bytes))
        }
        None => judge(input.get(2..3 + number)?)?,
    };
    match (xor, heads) {
        (0, false) => Some(Front::Plain(number + 1)),
        (_, false) => None,
        (xor, true) => Some(Front::Stuffed { len: number + 1, xor }),
    }
}

/// Writes a good block of `len` bytes at the front of `raw` to `units`, each doubled byte once.
/// Returns its length on the wire; `None`: no good block, or one that this path cannot judge.
#[inline]
pub(super) fn stuffed(raw: &[u8], len: usize, xor: u8, units: &mut [u8; MAX_BLOCK + SLACK]) -> Option<usize> {
    match len {
        ..=16 => unstuff::<1, { 2 * WINDOW }>(raw, len, xor, units),
        17..=176 => unstuff::<3, LONG_COPY>(raw, len, xor, units),
        _ => unstuff::<5, LONG_COPY>(raw, len, xor, units),
    }
}

/// Looks for 82h in all of `COUNT` windows of `N` bytes first, so that what follows waits for
/// nothing. Then copies `N` bytes from the front of each window and from behind each repeat.
#[inline(never)]
fn unstuff<const COUNT: usize, const N: usize>(
    raw: &[u8],
    len: usize,
    xor: u8,
    units: &mut [u8; MAX_BLOCK + SLACK],
) -> Option<usize> {
    let mut masks = [0; COUNT];
    for (mask, window) in masks.iter_mut().zip(raw.get(..COUNT * N)?.as_chunks().0) {
        *mask = head_mask::<N>(window);
    }
    let (mut from, mut wire) = (0, len);
    for (at, mut mask) in masks.into_iter().enumerate().map(|(window, mask)| (window * N, mask)) {
        if from > at {
            // The window before ended in an 82h, whose repeat is not another one.
            mask &= !1;
        } else {
            from = at;
        }
        loop {
            *units.get_mut(from + len - wire..)?.first_chunk_mut::<N>()? = *raw.get(from..)?.first_chunk()?;
            let found = at + mask.trailing_zeros() as usize;
            if found >= wire.min(at + N) {
                break;
            }
            if raw.get(found + 1) != Some(&HEAD_0) {
                return None;
            }
            mask &= mask - 1;
            mask &= mask.wrapping_sub(1);
            from = found + 2;
            wire += 1;
        }
        if wire <= at + N {
            break;
        }
    }
    let repeats = wire - len;
    let last = u128::from_le_bytes(*raw.get(len..)?.first_chunk()?) & FRONT.get(repeats.checked_sub(1)?)?;
    let repeated = if repeats.is_multiple_of(2) { 0 } else { HEAD_0 };
    (wire <= COUNT * N && xor ^ fold(halves(last)) ^ repeated == 0).then_some(wire)
}

#[inline]
fn head_mask<const N: usize>(window: &[u8; N]) -> u64 {
    parts(window)
        .enumerate()
        .fold(0, |mask, (at, part)| mask | u64::from(is_head(part).to_bitmask()) << (16 * at))
}

#[inline]
fn parts<const N: usize>(window: &[u8; N]) -> impl Iterator<Item = u8x16> {
    window.as_chunks::<WINDOW>().0.iter().map(|part| u8x16::new(*part))
}

/// Writes a telegram to the front of `out`. `None`: too much data, or less room in `out` than this
/// path wants; it may write anything to `out`.
#[inline]
pub(super) fn encode(function: u8, data: &[u8], out: &mut [u8]) -> Option<usize> {
    let number = u8::try_from(data.len() + 2).ok()?;
    if data.len() <= WINDOW - 4 {
        encode_short(number, function, data, out)
    } else {
        encode_long(number, function, data, out)
    }
}

/// Head and block in two words.
#[inline]
fn encode_short(number: u8, function: u8, data: &[u8], out: &mut [u8]) -> Option<usize> {
    let out: &mut [u8; 2 + 3 * WINDOW] = out.first_chunk_mut()?;
    let len = data.len();
    let (front, back) = load(data);
    let start = u32::from_le_bytes([HEAD_0, HEAD_1, number, function]);
    let wire = [u64::from(start) | u64::from(front) << 32, back];
    let check = fold(wire) ^ HEAD_0 ^ HEAD_1;
    *out.first_chunk_mut()? = wire[0].to_le_bytes();
    *out.get_mut(8..)?.first_chunk_mut()? = wire[1].to_le_bytes();
    *out.get_mut(4 + len)? = check;
    // The head's own 82h is none that is doubled.
    if !holds_head([wire[0] | 1, wire[1]]) && check != HEAD_0 {
        return Some(5 + len);
    }
    let block =
        (u128::from(wire[0]) | u128::from(wire[1]) << 64) >> 16 | u128::from(check) << (8 * (2 + len));
    let (mut to, mut heads) = (2, is_head(u8x16::new(block.to_le_bytes())).to_bitmask());
    while heads != 0 {
        let at = heads.trailing_zeros() as usize;
        to += 1;
        *out.get_mut(to + at..)?.first_chunk_mut()? = (block >> (8 * at)).to_le_bytes();
        heads &= heads - 1;
    }
    Some(to + 3 + len)
}

/// The first 4 and the other 8 of up to 12 bytes.
#[inline]
fn load(data: &[u8]) -> (u32, u64) {
    let len = data.len();
    if let (Some(first), Some(last)) = (data.first_chunk(), data.last_chunk()) {
        return (u32::from_le_bytes(*first), u64::from_le_bytes(*last) >> (8 * (12 - len)));
    }
    if let (Some(first), Some(last)) = (data.first_chunk(), data.last_chunk()) {
        let last = u64::from(u32::from_le_bytes(*last));
        return (u32::from_le_bytes(*first), last >> (8 * (8 - len)));
    }
    (data.iter().rev().fold(0, |all, &byte| all << 8 | u32::from(byte)), 0)
}

#[inline]
fn encode_long(number: u8, function: u8, data: &[u8], out: &mut [u8]) -> Option<usize> {
    let len = data.len();
    let start = [HEAD_0, HEAD_1, number, function];
    let (target, end) = out.get_mut(4..5 + len)?.split_at_mut_checked(len)?;
    let xor = if len < 32 { copy::<WINDOW>(data, target) } else { copy::<32>(data, target) };
    if let Some(xor) = xor {
        let check = xor ^ number ^ function;
        if check != HEAD_0 && number != HEAD_0 && function != HEAD_0 {
            *end.first_mut()? = check;
            *out.first_chunk_mut()? = start;
            return Some(5 + len);
        }
    }
    encode_stuffed(start, data, out)
}

/// Copies data of at least `N` bytes in windows of `N` and looks at it in the same pass. What is left
/// at the end is copied as part of the last `N` bytes. Returns the XOR, `None` when there is an 82h.
#[inline]
fn copy<const N: usize>(data: &[u8], out: &mut [u8]) -> Option<u8> {
    let mut seen = Seen::NOTHING;
    let (windows, rest) = data.as_chunks::<N>();
    for (window, out) in windows.iter().zip(out.as_chunks_mut().0) {
        *out = *window;
        parts(window).for_each(|part| seen.add(part));
    }
    if rest.len() > WINDOW {
        *out.last_chunk_mut()? = *data.last_chunk::<N>()?;
        seen.add_tail::<N>(data, rest.len())?;
    } else {
        *out.last_chunk_mut()? = *data.last_chunk::<WINDOW>()?;
        seen.add_tail::<WINDOW>(data, rest.len())?;
    }
    (!seen.holds_head()).then(|| seen.xor())
}

/// Copies from the front of each window and once more from every 82h, so that it comes out twice.
#[inline(never)]
fn encode_stuffed(start: [u8; 4], data: &[u8], out: &mut [u8]) -> Option<usize> {
    // Beyond the data there must be something to copy.
    let mut source = [0; MAX_BLOCK + LONG_COPY];
    source.get_mut(..data.len())?.copy_from_slice(data);
    let mut masks = [0; MAX_BLOCK / LONG_COPY];
    let (windows, rest) = data.as_chunks::<LONG_COPY>();
    for (mask, window) in masks.iter_mut().zip(windows) {
        *mask = head_mask(window);
    }
    *masks.get_mut(windows.len())? = match data.last_chunk::<LONG_COPY>() {
        Some(tail) => head_mask(tail).unbounded_shr((LONG_COPY - rest.len()) as u32),
        None => head_mask::<LONG_COPY>(source.first_chunk()?),
    };
    let [head_0, head_1, number, function] = start;
    *out.first_chunk_mut()? = [head_0, head_1];
    let mut to = encode_byte(number, out, 2)?;
    to = encode_byte(function, out, to)?;
    for (at, mut mask) in masks.into_iter().enumerate().map(|(window, mask)| (window * LONG_COPY, mask)) {
        let mut from = at;
        loop {
            *out.get_mut(from + to..)?.first_chunk_mut::<LONG_COPY>()? =
                *source.get(from..)?.first_chunk()?;
            if mask == 0 {
                break;
            }
            from = at + mask.trailing_zeros() as usize;
            to += 1;
            mask &= mask - 1;
        }
        if at + LONG_COPY >= data.len() {
            break;
        }
    }
    encode_byte(judge(data)?.0 ^ number ^ function, out, to + data.len())
}

#[inline]
fn encode_byte(byte: u8, out: &mut [u8], at: usize) -> Option<usize> {
    *out.get_mut(at..)?.first_chunk_mut()? = [byte; 2];
    Some(at + 1 + usize::from(byte == HEAD_0))
}
