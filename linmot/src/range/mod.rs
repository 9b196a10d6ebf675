//! The values that a parameter takes, as its drive tells them.

mod digits;

use core::fmt;

use crate::code::ParameterType;
use digits::{digits_of_floats, digits_of_signed, digits_of_unsigned, unused};

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
/// No command of manual B tells the type. Who knows it makes the range with [`of`](Self::of); otherwise the
/// bounds tell what of it matters (project-defined):
/// - They are read as unsigned, as signed with the minimum's 8, 16 or 32 bits, and as float, as far as the
///   minimum is below the maximum then. Of these readings that one counts whose bounds have the fewest digits
///   in decimal, as people choose them; a type's own bound has none, and bounds that differ in their sign only
///   count once. Where readings are equal, the first of the list counts.
/// - Bounds that both have the sign bit may be signed or not: signed counts only if it has 2 digits less. A
///   number is taken in either way then, see [`other`](Self::other).
/// - Where the bounds are equal, the drive tells no range, and every 32-bit value lies in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Range {
    minimum: u32,
    maximum: u32,
    reading: Reading,
    /// Signed and unsigned are both possible; bits above the sign bit.
    either: Option<u32>,
}

impl Range {
    /// From the raw values alone.
    #[must_use]
    pub fn new(minimum: u32, maximum: u32) -> Self {
        let unsigned = digits_of_unsigned(minimum, maximum);
        let signed = digits_of_signed(minimum, maximum);
        let unused = unused(minimum);
        let (whole, either) = match (unsigned, signed) {
            (Some(unsigned), Some(signed)) if signed + 2 <= unsigned => {
                (Some((Reading::Signed(unused), signed)), Some(unused))
            }
            (Some(unsigned), Some(_)) => (Some((Reading::Unsigned, unsigned)), Some(unused)),
            (Some(unsigned), None) => (Some((Reading::Unsigned, unsigned)), None),
            (None, Some(signed)) => (Some((Reading::Signed(unused), signed)), None),
            (None, None) => (None, None),
        };
        let (reading, either) = match (whole, digits_of_floats(minimum, maximum)) {
            (Some((_, whole)), Some(float)) if float < whole => (Reading::Float, None),
            (None, Some(_)) => (Reading::Float, None),
            (Some((reading, _)), _) => (reading, either),
            (None, None) => (Reading::Unsigned, None),
        };
        Self { minimum, maximum, reading, either }
    }

    /// Of a parameter whose type is known.
    #[must_use]
    pub const fn of(kind: ParameterType, minimum: u32, maximum: u32) -> Self {
        let reading = match kind {
            ParameterType::S8 => Reading::Signed(24),
            ParameterType::S16 => Reading::Signed(16),
            ParameterType::S32 => Reading::Signed(0),
            ParameterType::FLOAT => Reading::Float,
            _ => Reading::Unsigned,
        };
        Self { minimum, maximum, reading, either: None }
    }

    /// The same bounds, of a parameter whose type is known.
    #[must_use]
    pub const fn with_type(&self, kind: ParameterType) -> Self {
        Self::of(kind, self.minimum, self.maximum)
    }

    /// The same bounds in the other reading, where they may as well be signed as unsigned.
    #[must_use]
    pub const fn other(&self) -> Option<Self> {
        let Some(unused) = self.either else { return None };
        let reading = match self.reading {
            Reading::Unsigned => Reading::Signed(unused),
            _ => Reading::Unsigned,
        };
        Some(Self { reading, either: None, ..*self })
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
        let (signed, unused) = match (self.reading, self.either) {
            (Reading::Signed(unused), _) => (true, unused),
            (_, Some(unused)) => (false, unused),
            _ => return raw as i64,
        };
        let (extended, cut) = (((raw << unused) as i32) >> unused, raw << unused >> unused);
        if extended as u32 != raw && cut != raw {
            return raw as i64;
        }
        if signed { extended as i64 } else { cut as i64 }
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
        if self.is_float() {
            let value = number as f32;
            return (value as i64 == number).then(|| value.to_bits()).filter(|raw| self.contains(*raw));
        }
        if !self.is_told() {
            return (i64::from(i32::MIN)..=i64::from(u32::MAX)).contains(&number).then_some(number as u32);
        }
        if !(self.integer(self.minimum)..=self.integer(self.maximum)).contains(&number) {
            return self.other()?.raw(number);
        }
        let unused = if let Reading::Signed(unused) = self.reading { unused } else { 0 };
        Some((number as u32) << unused >> unused)
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.is_told() {
            return f.write_str("32 bits");
        }
        write!(f, "{} to {}", self.minimum(), self.maximum())?;
        match self.other() {
            Some(other) => write!(f, ", or {} to {},", other.minimum(), other.maximum()),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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

    /// Minimum and maximum of the same sign look like unsigned numbers, and unsigned ones like them.
    #[test]
    fn bounds_that_both_have_the_sign_bit_are_read_in_either_way() {
        for (low, high, words, number, raw) in [
            (0x9C, 0xFF, "-100 to -1, or 156 to 255,", -5, 0xFB),
            (0xFF9C, 0xFFFF, "-100 to -1, or 65436 to 65535,", -5, 0xFFFB),
            (0xFFFF_FF9C, 0xFFFF_FFFF, "-100 to -1, or 4294967196 to 4294967295,", -5, 0xFFFF_FFFB),
            (0xEC78, 0xFFFD, "-5000 to -3, or 60536 to 65533,", -4000, 0xF060),
            (0x8000_0000, 0xFFFF_FFF6, "-2147483648 to -10, or 2147483648 to 4294967286,", -11, 0xFFFF_FFF5),
            (128, 200, "128 to 200, or -128 to -56,", 150, 150),
            (128, 250, "128 to 250, or -128 to -6,", 150, 150),
            (150, 250, "150 to 250, or -106 to -6,", 200, 200),
            (200, 255, "200 to 255, or -56 to -1,", 250, 250),
            (0x80, 0xFF, "128 to 255, or -128 to -1,", 150, 150),
            (32_768, 50_000, "32768 to 50000, or -32768 to -15536,", 40_000, 40_000),
            (40_000, 50_000, "40000 to 50000, or -25536 to -15536,", 45_000, 45_000),
            (40_000, 65_535, "40000 to 65535, or -25536 to -1,", 45_000, 45_000),
            (
                3_000_000_000,
                4_000_000_000,
                "3000000000 to 4000000000, or -1294967296 to -294967296,",
                3_500_000_000,
                3_500_000_000,
            ),
            (
                1 << 31,
                u32::MAX,
                "2147483648 to 4294967295, or -2147483648 to -1,",
                3_000_000_000,
                3_000_000_000,
            ),
        ] {
            let range = Range::new(low, high);
            assert_eq!(range.to_string(), words);
            assert!(range.contains(low) && range.contains(high) && !range.contains(0), "{words}");
            assert_eq!((range.raw(number), range.number(raw)), (Some(raw), Number::Integer(number)));
            // The same value, as the other reading has it.
            let Number::Integer(other) = range.other().unwrap().number(raw) else { panic!() };
            assert_eq!((range.raw(other), range.raw(0)), (Some(raw), None), "{words}");
            assert!(other.signum() == -number.signum());
        }
        let s16 = Range::new(0xFF9C, 0xFFFF);
        assert_eq!([-5, -101, 0, 65_531].map(|n| s16.raw(n)), [Some(0xFFFB), None, None, Some(0xFFFB)]);
        assert!(s16.contains(0xFFFF_FFFB) && !s16.contains(0x1_FFFB));
        // A minimum that is not negative in any way, or a maximum of the lower half: one reading.
        for (low, high, words) in [(100, 200, "100 to 200"), (0x9C, 100, "-100 to 100"), (0, 255, "0 to 255")]
        {
            assert_eq!(
                (Range::new(low, high).to_string().as_str(), Range::new(low, high).other()),
                (words, None)
            );
        }
        // As wide as the minimum comes, however small the numbers are.
        let s32 = Range::new(-100i32 as u32, 100);
        assert_eq!((s32.raw(-5), s32.contains(0xFB)), (Some(-5i32 as u32), false));
    }

    /// A type that is known leaves nothing open.
    #[test]
    fn a_known_type_is_taken_at_its_word() {
        let of = |kind, low, high| Range::of(kind, low, high).to_string();
        assert_eq!(of(ParameterType::U8, 0x9C, 0xFF), "156 to 255");
        assert_eq!(of(ParameterType::S8, 128, 200), "-128 to -56");
        assert_eq!(of(ParameterType::S16, 40_000, 50_000), "-25536 to -15536");
        assert_eq!(of(ParameterType::U32, 0x3F80_0000, 0x4000_0000), "1065353216 to 1073741824");
        assert_eq!(of(ParameterType::FLOAT, 0, 1_234_567_890), "0 to 1228890.3");
        assert_eq!(Range::of(ParameterType::S8, 128, 200).raw(150), None);
        assert_eq!(Range::of(ParameterType::FLOAT, 7, 7).raw(5), Some(5f32.to_bits()));
    }

    /// Bounds that nobody would type, but that quantities have.
    #[test]
    fn floats_of_many_digits_are_floats() {
        use core::f32::consts::{FRAC_PI_2, PI, TAU};
        for (low, high) in [
            (-PI, PI),
            (-2.7654, 2.7654),
            (-PI, TAU),
            (0.0, PI),
            (-FRAC_PI_2, 0.0),
            (-1.0 / 3.0, 1.0 / 3.0),
            (-273.15, 1000.0),
            (-0.12345, -0.001),
        ] {
            let range = Range::new(low.to_bits(), high.to_bits());
            assert_eq!((range.is_float(), range.to_string()), (true, std::format!("{low} to {high}")));
            assert!(
                range.contains(((low + high) / 2.0).to_bits()) && !range.contains((high + 0.1).to_bits())
            );
        }
        for (low, high) in [
            (0, 1_234_567_890),
            (-1_234_567_890, 1_234_567_890),
            (0, (1 << 30) - 1),
            (-(1 << 30), (1 << 30) - 1),
            (-1_000_000_001, 1_000_000_001),
        ] {
            assert_eq!(Range::new(low as u32, high as u32).to_string(), std::format!("{low} to {high}"));
        }
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
