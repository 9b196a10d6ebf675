//! How many digits bounds have in decimal, in each way of reading them: people choose round ones.

/// Digits of an integer without the zeros at its end; 1 of a power of two and of the number below one.
const fn digits(number: i64) -> u32 {
    let mut rest = number.unsigned_abs();
    if rest == 0 {
        return 0;
    }
    if rest.is_power_of_two() || (rest + 1).is_power_of_two() {
        return 1;
    }
    while rest.is_multiple_of(10) {
        rest /= 10;
    }
    let mut count = 0;
    while rest > 0 {
        rest /= 10;
        count += 1;
    }
    count
}

/// Digits of both bounds as unsigned; `None` where they cannot be.
pub(super) fn digits_of_unsigned(minimum: u32, maximum: u32) -> Option<u32> {
    let own = |bound: u32| match bound {
        0xFF | 0xFFFF | u32::MAX | 0x80 | 0x8000 | 0x8000_0000 => 0,
        other => digits(other.into()),
    };
    (minimum < maximum).then(|| own(minimum) + own(maximum))
}

/// Digits by which a single is told from others, and one more if they are many; `None` where it is none that
/// anybody would choose: not a number, infinite, or a magnitude that no quantity has.
fn digits_of_float(bits: u32) -> Option<u32> {
    let value = f32::from_bits(bits);
    let magnitude = if value < 0.0 { -value } else { value };
    if magnitude == 0.0 || magnitude == f32::MAX {
        return Some(0);
    }
    // NaN is in no range.
    if !(1e-9..1e12).contains(&magnitude) {
        return None;
    }
    let mut scaled = f64::from(magnitude);
    while scaled >= 10.0 {
        scaled /= 10.0;
    }
    while scaled < 1.0 {
        scaled *= 10.0;
    }
    let shortest = (1..=9).find(|_| {
        let whole = (scaled + 0.5) as u32;
        let distance = scaled - f64::from(whole);
        // A single has 24 bits.
        let close = distance < scaled * 6e-8 && -distance < scaled * 6e-8;
        scaled *= 10.0;
        close
    });
    let digits = shortest.unwrap_or(9);
    Some(if digits > 4 { digits + 1 } else { digits })
}

/// Digits of both bounds as floats; `None` where they cannot be.
pub(super) fn digits_of_floats(minimum: u32, maximum: u32) -> Option<u32> {
    let (low, high) = (digits_of_float(minimum)?, digits_of_float(maximum)?);
    let below = f32::from_bits(minimum) < f32::from_bits(maximum);
    let symmetric = minimum == maximum | 1 << 31;
    below.then_some(if symmetric { high } else { low + high })
}

/// Bits above the sign bit, by a minimum that is negative: it comes as wide as its type.
pub(super) const fn unused(minimum: u32) -> u32 {
    match minimum {
        0..=0xFF => 24,
        0x100..=0xFFFF => 16,
        _ => 0,
    }
}

/// Digits of both bounds read as signed; `None` where they cannot be.
pub(super) fn digits_of_signed(minimum: u32, maximum: u32) -> Option<u32> {
    let unused = unused(minimum);
    let number = |raw: u32| ((raw << unused) as i32) >> unused;
    let (low, high) = (number(minimum), number(maximum));
    let own = |number: i32| {
        let end = i32::MAX >> unused;
        if number == end || number == -end - 1 || number == -1 { 0 } else { digits(number.into()) }
    };
    // Both bounds positive are as well unsigned.
    let wide = maximum << unused >> unused == maximum;
    let symmetric = low.checked_neg() == Some(high);
    (low < 0 && low < high && wide).then(|| if symmetric { own(high) } else { own(low) + own(high) })
}
