//! Taking bytes of text apart: numbers, hex, blanks.

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
    // The bytes of a classic frame are stored in one go: what is read together soon is written so.
    if pairs.len() <= 8
        && let Some(room) = out.first_chunk_mut::<8>()
    {
        let mut value = 0_u64;
        for (at, &[high, low]) in pairs.iter().enumerate() {
            let (high, low) = (nibble(high), nibble(low));
            bad |= high | low;
            value |= u64::from(high << 4 | low & 0x0F) << (8 * at);
        }
        *room = value.to_le_bytes();
        return (bad <= 0x0F).then_some(pairs.len());
    }
    for (&[high, low], byte) in pairs.iter().zip(out) {
        let (high, low) = (nibble(high), nibble(low));
        bad |= high | low;
        *byte = high << 4 | low & 0x0F;
    }
    (bad <= 0x0F).then_some(pairs.len())
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
}
