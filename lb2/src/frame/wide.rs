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
    let (mut xor, mut heads) = (u8x16::ZERO, u8x16::ZERO);
    let (windows, rest) = block.as_chunks::<N>();
    for window in windows {
        for part in parts(window) {
            heads |= is_head(part);
            xor ^= part;
        }
    }
    let mask: &[u8; N] = TAIL.get(LONG - N + rest.len()..)?.first_chunk()?;
    for (part, mask) in parts(block.last_chunk::<N>()?).zip(parts(mask)) {
        heads |= is_head(part);
        xor ^= part & mask;
    }
    Some((fold(halves(u128::from_le_bytes(xor.to_array()))), heads.any()))
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
    if data.len() <= WINDOW - 3 {
        encode_short(number, function, data, out)
    } else {
        encode_long(number, function, data, out)
    }
}

/// The block as one integer.
#[inline]
fn encode_short(number: u8, function: u8, data: &[u8], out: &mut [u8]) -> Option<usize> {
    let out: &mut [u8; 2 + 3 * WINDOW] = out.first_chunk_mut()?;
    let len = data.len() + 3;
    let mut block = u128::from(number) | u128::from(function) << 8 | load(data) << 16;
    let check = fold(halves(block));
    *out.first_chunk_mut()? = [HEAD_0, HEAD_1];
    *out.get_mut(2..)?.first_chunk_mut()? = block.to_le_bytes();
    *out.get_mut(1 + len)? = check;
    if !holds_head(halves(block)) && check != HEAD_0 {
        return Some(2 + len);
    }
    block |= u128::from(check) << (8 * (len - 1));
    let (mut to, mut heads) = (2, is_head(u8x16::new(block.to_le_bytes())).to_bitmask());
    while heads != 0 {
        let at = heads.trailing_zeros() as usize;
        to += 1;
        *out.get_mut(to + at..)?.first_chunk_mut()? = (block >> (8 * at)).to_le_bytes();
        heads &= heads - 1;
    }
    Some(to + len)
}

/// Up to 13 bytes. Pieces that overlap agree where they do.
#[inline]
fn load(data: &[u8]) -> u128 {
    let len = data.len();
    if let (Some(first), Some(last)) = (data.first_chunk(), data.last_chunk()) {
        return u128::from(u64::from_le_bytes(*first))
            | u128::from(u64::from_le_bytes(*last)) << (8 * (len - 8));
    }
    if let (Some(first), Some(last)) = (data.first_chunk(), data.last_chunk()) {
        let last = u64::from(u32::from_le_bytes(*last)) << (8 * (len - 4));
        return u128::from(u64::from(u32::from_le_bytes(*first)) | last);
    }
    data.iter().rev().fold(0, |all, &byte| all << 8 | u128::from(byte))
}

#[inline]
fn encode_long(number: u8, function: u8, data: &[u8], out: &mut [u8]) -> Option<usize> {
    let len = data.len();
    let start = [HEAD_0, HEAD_1, number, function];
    let target = out.get_mut(4..5 + len)?;
    let xor = if len < 32 { copy::<WINDOW>(data, target) } else { copy::<32>(data, target) };
    if let Some(xor) = xor {
        let check = xor ^ number ^ function;
        if check != HEAD_0 && number != HEAD_0 && function != HEAD_0 {
            *target.last_mut()? = check;
            *out.first_chunk_mut()? = start;
            return Some(5 + len);
        }
    }
    encode_stuffed(start, data, out)
}

/// Copies data of at least `N` bytes in windows of `N`, folds it and looks for 82h in one pass.
/// Returns the XOR, `None` as soon as there is an 82h.
#[inline]
fn copy<const N: usize>(data: &[u8], out: &mut [u8]) -> Option<u8> {
    let (windows, rest) = data.as_chunks::<N>();
    let mut xor = u8x16::ZERO;
    for (window, out) in windows.iter().zip(out.as_chunks_mut::<N>().0) {
        let mut heads = u8x16::ZERO;
        for (part, out) in parts(window).zip(out.as_chunks_mut().0) {
            *out = part.to_array();
            heads |= is_head(part);
            xor ^= part;
        }
        if heads.any() {
            return None;
        }
    }
    let tail: &[u8; N] = data.last_chunk()?;
    let mask: &[u8; N] = TAIL.get(LONG - N + rest.len()..)?.first_chunk()?;
    let out: &mut [u8; N] = out.get_mut(data.len() - N..)?.first_chunk_mut()?;
    let mut heads = u8x16::ZERO;
    for ((part, mask), out) in parts(tail).zip(parts(mask)).zip(out.as_chunks_mut().0) {
        *out = part.to_array();
        heads |= is_head(part);
        xor ^= part & mask;
    }
    (!heads.any()).then(|| fold(halves(u128::from_le_bytes(xor.to_array()))))
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
