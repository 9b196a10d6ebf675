//! The values that a parameter takes, as its drive tells them.

use core::fmt;

/// What a raw value means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Number {
    /// Of an integer type.
    Integer(i64),
    /// Of type float: the bits of an IEEE 754 single.
    Float(u32),
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Integer(number) => number.fmt(f),
            Self::Float(bits) => f32::from_bits(bits).fmt(f),
        }
    }
}

impl From<i64> for Number {
    fn from(number: i64) -> Self {
        Self::Integer(number)
    }
}

/// How raw values of a parameter are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Reading {
    Unsigned,
    /// So many bits above the sign bit.
    Signed(u32),
    Float,
}

/// Minimum and maximum of a parameter, raw, as commands 15h and 16h bring them.
///
/// Every command carries 32 bits, and the drive filters out those that do not belong to the
/// parameter's type (manual B 2.5): a value that is too wide would be kept cut off, with status 00h.
/// No command of manual B tells the type. The bounds tell what of it matters (project-defined):
/// - They are read as unsigned, as signed with the minimum's 8, 16 or 32 bits, and as float, as far as the minimum is below
///   the maximum then. Of these readings that one counts whose bounds have the fewest digits in decimal, as
///   people choose them; a type's own bound has none. Where readings are equal, the first of the list counts.
/// - Where the bounds are equal, the drive tells no range, and every 32-bit value lies in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Range {
    minimum: u32,
    maximum: u32,
    reading: Reading,
}

/// Digits of an integer without the zeros at its end.
const fn digits(number: i64) -> u32 {
    let mut rest = number.unsigned_abs();
    if rest == 0 {
        return 0;
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

/// Digits of a single; `None` where it is none that anybody would choose: not a number, infinite, with more
/// than 4 digits, or a magnitude that no quantity has.
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
    (1..=4).find(|_| {
        let whole = (scaled + 0.5) as u32;
        let distance = scaled - f64::from(whole);
        // A single has 24 bits.
        let close = distance < scaled * 6e-8 && -distance < scaled * 6e-8;
        scaled *= 10.0;
        close
    })
}

/// Bits above the sign bit, by a minimum that is negative: it comes as wide as its type.
const fn unused(minimum: u32) -> u32 {
    match minimum {
        0..=0xFF => 24,
        0x100..=0xFFFF => 16,
        _ => 0,
    }
}

/// Digits of both bounds read as signed; `None` where they cannot be.
fn digits_of_signed(minimum: u32, maximum: u32) -> Option<u32> {
    let unused = unused(minimum);
    let number = |raw: u32| ((raw << unused) as i32) >> unused;
    let (low, high) = (number(minimum), number(maximum));
    let own = |number: i32| {
        let end = i32::MAX >> unused;
        if number == end || number == -end - 1 { 0 } else { digits(number.into()) }
    };
    // Both bounds positive are as well unsigned.
    let wide = maximum << unused >> unused == maximum;
    (low < 0 && low < high && wide).then(|| own(low) + own(high))
}

impl Range {
    /// From the raw values.
    #[must_use]
    pub fn new(minimum: u32, maximum: u32) -> Self {
        let own = |bound: u32| match bound {
            0xFF | 0xFFFF | u32::MAX => 0,
            other => digits(other.into()),
        };
        let unsigned = (minimum < maximum).then(|| own(minimum) + own(maximum));
        let float = || {
            let below = f32::from_bits(minimum) < f32::from_bits(maximum);
            let digits = digits_of_float(minimum)? + digits_of_float(maximum)?;
            below.then_some(digits)
        };
        let readings = [
            (Reading::Unsigned, unsigned),
            (Reading::Signed(unused(minimum)), digits_of_signed(minimum, maximum)),
            (Reading::Float, float()),
        ];
        let possible = readings.into_iter().filter_map(|(reading, digits)| Some((reading, digits?)));
        let best = possible.min_by_key(|(_, digits)| *digits);
        let reading = best.map_or(Reading::Unsigned, |(reading, _)| reading);
        Self { minimum, maximum, reading }
    }

    /// Whether the drive tells a range at all.
    #[must_use]
    pub const fn is_told(&self) -> bool {
        self.minimum != self.maximum
    }

    /// Whether the parameter is of type float, as far as its bounds tell.
    #[must_use]
    pub const fn is_float(&self) -> bool {
        matches!(self.reading, Reading::Float)
    }

    /// The least value.
    #[must_use]
    pub const fn minimum(&self) -> Number {
        self.number(self.minimum)
    }

    /// The greatest value.
    #[must_use]
    pub const fn maximum(&self) -> Number {
        self.number(self.maximum)
    }

    /// The number that a raw value means. A signed type's may be extended by its sign or not; bits
    /// that belong to neither form stay, and no range has them.
    #[must_use]
    pub const fn number(&self, raw: u32) -> Number {
        match self.reading {
            Reading::Float => Number::Float(raw),
            _ => Number::Integer(self.integer(raw)),
        }
    }

    const fn integer(&self, raw: u32) -> i64 {
        if let Reading::Signed(unused) = self.reading {
            let extended = ((raw << unused) as i32) >> unused;
            if extended as u32 == raw || raw << unused >> unused == raw {
                return extended as i64;
            }
        }
        raw as i64
    }

    /// Whether a raw value lies between the bounds and is no wider than the type.
    #[must_use]
    pub fn contains(&self, raw: u32) -> bool {
        if !self.is_told() {
            return true;
        }
        if self.is_float() {
            let [low, value, high] = [self.minimum, raw, self.maximum].map(f32::from_bits);
            return (low..=high).contains(&value);
        }
        (self.integer(self.minimum)..=self.integer(self.maximum)).contains(&self.integer(raw))
    }

    /// The raw value of a whole number; `None` outside of the bounds, and of a float that has no such value.
    #[must_use]
    pub fn raw(&self, number: i64) -> Option<u32> {
        if !self.is_told() {
            return (i64::from(i32::MIN)..=i64::from(u32::MAX)).contains(&number).then_some(number as u32);
        }
        if self.is_float() {
            let value = number as f32;
            return (value as i64 == number).then(|| value.to_bits()).filter(|raw| self.contains(*raw));
        }
        let within = (self.integer(self.minimum)..=self.integer(self.maximum)).contains(&number);
        let unused = if let Reading::Signed(unused) = self.reading { unused } else { 0 };
        within.then_some((number as u32) << unused >> unused)
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_told() {
            write!(f, "{} to {}", self.minimum(), self.maximum())
        } else {
            f.write_str("32 bits")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::code::ParameterType;
    use proptest::prelude::*;
    use std::string::ToString;

    #[test]
    fn values_wider_than_the_type_lie_in_no_range() {
        let u16 = Range::new(0, 0xFFFF);
        for (number, raw) in
            [(0, Some(0)), (65_535, Some(0xFFFF)), (65_536, None), (99_999, None), (-3, None)]
        {
            assert_eq!(u16.raw(number), raw, "{number}");
        }
        assert!(!u16.contains(99_999) && !u16.contains(-3i32 as u32) && u16.contains(0xFFFF));
        let s8 = Range::new(-100i8 as u8 as u32, 100);
        assert_eq!(s8.to_string(), "-100 to 100");
        assert_eq!(
            [-100, -1, 100, 101, -101].map(|n| s8.raw(n)),
            [Some(0x9C), Some(0xFF), Some(100), None, None]
        );
        // Extended by its sign or not; any other bits are too many.
        assert_eq!([0xFB, 0xFFFF_FFFB].map(|raw| (s8.integer(raw), s8.contains(raw))), [(-5, true); 2]);
        assert!([0x1FB, 0xFFFB, 0xFFFF_FF05, 0x105].iter().all(|raw| !s8.contains(*raw)));
        let s32 = Range::new(i32::MIN as u32, i32::MAX as u32);
        assert_eq!((s32.integer(0xFFFF_FFFF), s32.raw(-1), s32.raw(1 << 31)), (-1, Some(u32::MAX), None));
        let u32 = Range::new(0, u32::MAX);
        assert_eq!((u32.integer(u32::MAX), u32.raw(-1), u32.raw(1 << 32)), (0xFFFF_FFFF, None, None));
        let untold = Range::new(7, 7);
        assert!(untold.contains(99_999) && untold.raw(-3) == Some(-3i32 as u32));
        assert_eq!((untold.raw(1 << 32), untold.to_string().as_str()), (None, "32 bits"));
    }

    /// Negative floats descend where their bits ascend: as integers, -1.0 lay below -100.0.
    #[test]
    fn floats_are_read_as_floats() {
        let bits = f32::to_bits;
        let range = Range::new(bits(-100.0), bits(100.0));
        assert_eq!((range.is_float(), range.to_string().as_str()), (true, "-100 to 100"));
        for (value, inside) in [
            (-1.0, true),
            (-0.5, true),
            (-100.0, true),
            (0.0, true),
            (99.9, true),
            (-100.1, false),
            (-1000.0, false),
            (101.0, false),
            (f32::NAN, false),
            (f32::NEG_INFINITY, false),
        ] {
            assert_eq!(range.contains(bits(value)), inside, "{value}");
        }
        assert_eq!(range.number(bits(-2.5)).to_string(), "-2.5");
        assert_eq!([-5, 101].map(|number| range.raw(number)), [Some(bits(-5.0)), None]);
        for (low, high, words) in [
            (-100.0, -1.0, "-100 to -1"),
            (-0.25, 0.25, "-0.25 to 0.25"),
            (0.0, 1.5, "0 to 1.5"),
            (0.001, 0.0, "0 to 981668463"),
        ] {
            let range = Range::new(bits(low), bits(high));
            if low < high {
                assert_eq!((range.is_float(), range.to_string().as_str()), (true, words));
            } else {
                assert!(!range.is_float());
            }
        }
        assert!(Range::new(bits(-f32::MAX), bits(f32::MAX)).is_float());
        // Bounds of integers.
        for (low, high) in [
            (-10_000_000, 10_000_000),
            (-1_000_000_000, 1_000_000_000),
            (0, 1_000_000_000),
            (0, 2_000_000_000),
            (i32::MIN, i32::MAX),
            (i32::MIN, 0),
            (i32::MIN, 1000),
            (-1, i32::MAX),
            (-500, 1_065_353_216 / 2),
        ] {
            let range = Range::new(low as u32, high as u32);
            assert_eq!(range.to_string(), std::format!("{low} to {high}"));
        }
    }

    /// Minimum and maximum of the same sign look like unsigned numbers.
    #[test]
    fn ranges_below_zero_are_negative() {
        for (low, high, words) in [
            (0x9C, 0xFF, "-100 to -1"),
            (0xFF9C, 0xFFFF, "-100 to -1"),
            (0xFFFF_FF9C, 0xFFFF_FFFF, "-100 to -1"),
            (0x80, 0xFF, "-128 to -1"),
            (0xEC78, 0xFFFD, "-5000 to -3"),
            (0x8000_0000, 0xFFFF_FFF6, "-2147483648 to -10"),
            // As these do, and are.
            (200, 255, "200 to 255"),
            (40_000, 50_000, "40000 to 50000"),
            (3_000_000_000, 4_000_000_000, "3000000000 to 4000000000"),
        ] {
            let range = Range::new(low, high);
            assert_eq!(range.to_string(), words);
            assert!(range.contains(low) && range.contains(high) && !range.contains(0), "{words}");
        }
        let s16 = Range::new(0xFF9C, 0xFFFF);
        assert_eq!([-5, -101, 0, 65_531].map(|n| s16.raw(n)), [Some(0xFFFB), None, None, None]);
        assert!(s16.contains(0xFFFF_FFFB) && !s16.contains(0x1_FFFB));
        // As wide as the minimum comes, however small the numbers are.
        let s32 = Range::new(-100i32 as u32, 100);
        assert_eq!((s32.raw(-5), s32.contains(0xFB)), (Some(-5i32 as u32), false));
    }

    proptest! {
        /// Whatever the type, what lies in a range is kept as it came, and no value of the type between the
        /// bounds is refused.
        #[test]
        fn what_lies_in_a_range_is_kept_whole(kind in 0u8..=6, a: u32, b: u32, shift in 0u32..32, raw: u32, number in -5_000_000_000i64..5_000_000_000) {
            let kind = ParameterType(kind);
            // Small numbers of wide types, of either sign, among them.
            let [a, b] = [a, b].map(|bound| ((bound as i32) >> shift) as u32);
            let (low, high) = if kind.number(a) < kind.number(b) { (a, b) } else { (b, a) };
            let range = Range::new(low & kind.mask(), high & kind.mask());
            prop_assume!(range.is_told() && !range.is_float());
            for raw in [raw, raw & kind.mask(), kind.number(raw) as u32] {
                let own = kind.number(raw & kind.mask());
                if range.contains(raw) {
                    prop_assert!(raw & kind.mask() == raw || own as u32 == raw);
                    prop_assert_eq!(range.raw(range.integer(raw)), Some(raw & kind.mask()));
                }
                if (kind.number(low)..=kind.number(high)).contains(&own) {
                    prop_assert!(range.contains(raw & kind.mask()));
                }
            }
            if let Some(raw) = range.raw(number) {
                prop_assert!((kind.number(low)..=kind.number(high)).contains(&kind.number(raw)));
            }
        }

        /// Of floats that somebody chose, too.
        #[test]
        fn floats_in_their_range_are_taken(low in -9999i32..0, high in 1i32..9999, scale in 0usize..4, share in 0.0f32..1.0) {
            let scale = [0.01f32, 0.1, 1.0, 10.0][scale];
            let (low, high) = (low as f32 * scale, high as f32 * scale);
            let range = Range::new(low.to_bits(), high.to_bits());
            prop_assume!(range.is_float());
            let value = low + (high - low) * share;
            prop_assert!(range.contains(value.clamp(low, high).to_bits()));
            prop_assert!(!range.contains((high * 1.001).to_bits()) && !range.contains((low * 1.001).to_bits()));
        }
    }
}
