//! Taking bytes of text apart: numbers, hex, blanks.

/// Nanoseconds: the scale of [`fixed`] for seconds.
pub(super) const SECONDS: i64 = 1_000_000_000;

/// Value of a hex digit; `FF` for other bytes.
const HEX: [u8; 256] = {
    let mut table = [0xFF; 256];
    let mut digit = 0;
    while digit < 10 {
        table[b'0' as usize + digit] = digit as u8;
        digit += 1;
    }
    let mut digit = 0;
    while digit < 6 {
        table[b'A' as usize + digit] = 10 + digit as u8;
        table[b'a' as usize + digit] = 10 + digit as u8;
        digit += 1;
    }
    table
};

#[inline]
pub(super) fn nibble(byte: u8) -> u8 {
    HEX[usize::from(byte)]
}

/// A byte of two hex digits.
#[inline]
pub(super) fn hex_byte(text: &[u8]) -> Option<u8> {
    match text {
        &[high, low] => {
            let (high, low) = (nibble(high), nibble(low));
            (high | low <= 0x0F).then_some(high << 4 | low)
        }
        _ => None,
    }
}

/// A number of 1…8 hex digits.
#[inline]
pub(super) fn hex(text: &[u8]) -> Option<u32> {
    if text.is_empty() || text.len() > 8 {
        return None;
    }
    let mut value = 0;
    let mut bad = 0;
    for &byte in text {
        let digit = nibble(byte);
        bad |= digit;
        value = value << 4 | u32::from(digit & 0x0F);
    }
    (bad <= 0x0F).then_some(value)
}

/// Hex digit pairs without blanks into `out`; how many bytes.
#[inline]
pub(super) fn hex_run(text: &[u8], out: &mut [u8]) -> Option<usize> {
    let (pairs, rest) = text.as_chunks::<2>();
    if !rest.is_empty() || pairs.len() > out.len() {
        return None;
    }
    let mut bad = 0;
    for (&[high, low], byte) in pairs.iter().zip(out) {
        let (high, low) = (nibble(high), nibble(low));
        bad |= high | low;
        *byte = high << 4 | low & 0x0F;
    }
    (bad <= 0x0F).then_some(pairs.len())
}

/// How many of 16 characters from the first one on are hex digits, and the bytes of these digits with
/// zeros behind them.
#[inline(always)]
pub(super) fn hex_of_16(text: &[u8; 16]) -> (usize, [u8; 8]) {
    let [low, high] = text.as_chunks::<8>().0 else { return (0, [0; 8]) };
    let (low_count, low) = hex_of_8(*low);
    let (high_count, high) = hex_of_8(*high);
    let count = if low_count == 8 { 8 + high_count } else { low_count };
    let used = 1_u64.checked_shl(count / 2 * 8).map_or(u64::MAX, |bit| bit - 1);
    (count as usize, ((low | high << 32) & used).to_le_bytes())
}

/// How many of 8 characters from the first one on are hex digits, and the bytes of these digits.
#[inline(always)]
fn hex_of_8(text: [u8; 8]) -> (u32, u64) {
    const ONES: u64 = u64::from_le_bytes([1; 8]);
    const TOP: u64 = 0x80 * ONES;
    /// The top bit of each byte tells whether this byte of 7 bits is at least `least`.
    const fn at_least(bytes: u64, least: u8) -> u64 {
        bytes + (0x80 - least as u64) * ONES
    }
    let text = u64::from_le_bytes(text);
    let low = text & !TOP;
    let small = low | (0x20 * ONES);
    let digits = at_least(low, b'0') & !at_least(low, b'9' + 1);
    let letters = at_least(small, b'a') & !at_least(small, b'f' + 1);
    let others = !((digits | letters) & !text) & TOP;
    let nibbles = (text & (0x0F * ONES)) + 9 * ((text >> 6) & ONES);
    // The first digit of a pair is the higher one; then the bytes of pairs move together.
    let pairs = (nibbles << 4 | nibbles >> 8) & 0x00FF_00FF_00FF_00FF;
    let pairs = (pairs | pairs >> 8) & 0x0000_FFFF_0000_FFFF;
    (others.trailing_zeros() / 8, (pairs | pairs >> 16) & 0xFFFF_FFFF)
}

/// A number of 8 decimal digits.
#[inline(always)]
pub(super) fn decimal_of_8(text: [u8; 8]) -> Option<u32> {
    const ONES: u64 = u64::from_le_bytes([1; 8]);
    let text = u64::from_le_bytes(text);
    // Digits are 30h to 39h: the upper half of a byte is 3, and still is with 6 more.
    let upper = |bytes: u64| bytes & (0xF0 * ONES);
    if upper(text) != 0x30 * ONES || upper(text.wrapping_add(6 * ONES)) != 0x30 * ONES {
        return None;
    }
    // Pairs of digits, of pairs, of fours: the first one is the higher one and in the lower place.
    let digits = text & (0x0F * ONES);
    let pairs = (10 * digits + (digits >> 8)) & 0x00FF_00FF_00FF_00FF;
    let fours = (100 * pairs + (pairs >> 16)) & 0x0000_FFFF_0000_FFFF;
    Some((10_000 * (fours & 0xFFFF) + (fours >> 32)) as u32)
}

/// A decimal number.
pub(super) fn decimal(text: &[u8]) -> Option<u64> {
    if text.is_empty() || text.len() > 19 {
        return None;
    }
    text.iter()
        .try_fold(0_u64, |value, &byte| byte.is_ascii_digit().then(|| value * 10 + u64::from(byte - b'0')))
}

/// A decimal fraction, point or comma, in units of `scale` (10^9 or 10^6): seconds or milliseconds
/// as nanoseconds. Digits beyond the nanosecond are cut off.
#[inline]
pub(super) fn fixed(text: &[u8], scale: i64) -> Option<i64> {
    let (negative, text) = match text.split_first() {
        Some((b'-', rest)) => (true, rest),
        _ => (false, text),
    };
    let mut whole = 0_i64;
    let mut digits = 0;
    let mut bytes = text.iter();
    let mut fraction = 0_i64;
    let mut weight = scale;
    loop {
        match bytes.next() {
            Some(&byte) if byte.is_ascii_digit() => {
                digits += 1;
                whole = whole.checked_mul(10)?.checked_add(i64::from(byte - b'0'))?;
            }
            Some(b'.' | b',') => break,
            Some(_) => return None,
            None => {
                let value = whole.checked_mul(scale)?;
                return (digits > 0).then_some(if negative { -value } else { value });
            }
        }
    }
    for &byte in bytes {
        if !byte.is_ascii_digit() {
            return None;
        }
        digits += 1;
        weight /= 10;
        fraction += weight * i64::from(byte - b'0');
    }
    let value = whole.checked_mul(scale)?.checked_add(fraction)?;
    (digits > 0).then_some(if negative { -value } else { value })
}

/// `HH:MM:SS.fff` (or `MM:SS`) as nanoseconds.
pub(super) fn clock(text: &[u8]) -> Option<i64> {
    let mut parts = text.rsplitn(3, |&byte| byte == b':');
    let seconds = fixed(parts.next()?, 1_000_000_000)?;
    let mut minutes = 0_i64;
    let mut weight = 1_i64;
    for part in parts {
        minutes += weight * i64::try_from(decimal(part)?).ok()?.min(1_000_000);
        weight *= 60;
    }
    minutes.checked_mul(60_000_000_000)?.checked_add(seconds)
}

/// `2015-07-10 08:57:32.249713` as nanoseconds since 1970.
pub(super) fn date_time(text: &[u8]) -> Option<i64> {
    let (date, time) = text.split_at_checked(10)?;
    let [b' ' | b'T', time @ ..] = time else { return None };
    let &[a, b, c, d, b'-', e, f, b'-', g, h] = date else { return None };
    let (year, month, day) = (decimal(&[a, b, c, d])?, decimal(&[e, f])?, decimal(&[g, h])?);
    if year < 1970 || !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    // Years are counted from March, so that the leap day is the last one.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let days = 365 * year + year / 4 - year / 100 + year / 400 + (153 * month + 2) / 5 + day - 1;
    let days = i64::try_from(days).ok()? - 719_468;
    days.checked_mul(86_400_000_000_000)?.checked_add(clock(time)?)
}

/// The first word of the text, and what follows it.
#[inline]
pub(super) fn word(text: &[u8]) -> Option<(&[u8], &[u8])> {
    let text = text.trim_ascii_start();
    if text.is_empty() {
        return None;
    }
    let end = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
    Some(text.split_at(end))
}

/// All words of the text.
pub(super) fn words(mut text: &[u8]) -> impl Iterator<Item = &[u8]> {
    core::iter::from_fn(move || {
        let (word, rest) = word(text)?;
        text = rest;
        Some(word)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers() {
        assert_eq!(
            (hex(b"581"), hex(b"1FFFFFFF"), hex(b"5G1"), hex(b"")),
            (Some(0x581), Some(0x1FFF_FFFF), None, None)
        );
        assert_eq!((hex_byte(b"aF"), hex_byte(b"0x")), (Some(0xAF), None));
        let mut out = [0; 2];
        assert_eq!((hex_run(b"1122", &mut out), out), (Some(2), [0x11, 0x22]));
        assert_eq!((hex_run(b"112", &mut out), hex_run(b"112233", &mut out)), (None, None));
        assert_eq!(
            (decimal_of_8(*b"00627243"), decimal_of_8(*b"99999999")),
            (Some(627_243), Some(99_999_999))
        );
        assert_eq!(fixed(b"1682489978.627243", 1_000_000_000), Some(1_682_489_978_627_243_000));
        assert_eq!(fixed(b"144.5", 1_000_000), Some(144_500_000));
        assert_eq!(
            (fixed(b"-0.25", 1000), fixed(b"3", 10), fixed(b".", 10), fixed(b"1.x", 10)),
            (Some(-250), Some(30), None, None)
        );
        assert_eq!(fixed(b"99999999999999999999", 1_000_000_000), None);
        assert_eq!(clock(b"01:02:03.5"), Some(3_723_500_000_000));
        assert_eq!(date_time(b"2015-07-10 08:57:32.249713"), Some(1_436_518_652_249_713_000));
        assert_eq!((date_time(b"2015-13-10 08:57:32"), date_time(b"")), (None, None));
    }

    /// Every byte at every place, among digits.
    #[test]
    fn eight_and_sixteen_at_once() {
        for at in 0..16 {
            for byte in 0..=255 {
                let mut text = *b"0123456789abCDEF";
                text[at] = byte;
                let (count, bytes) = hex_of_16(&text);
                let digits = text.iter().take_while(|digit| digit.is_ascii_hexdigit()).count();
                let mut expected = [0; 8];
                hex_run(&text[..digits / 2 * 2], &mut expected).unwrap();
                assert_eq!((count, bytes), (digits, expected), "{byte} at {at}");
            }
        }
        for at in 0..8 {
            for byte in 0..=255 {
                let mut text = *b"12345678";
                text[at] = byte;
                let expected = decimal(&text).map(|number| number as u32);
                assert_eq!(decimal_of_8(text), expected, "{byte} at {at}");
            }
        }
    }
}
