//! The values that a parameter takes, as its drive tells them.

use core::fmt;

/// Minimum and maximum of a parameter, raw, as commands 15h and 16h bring them.
///
/// Every command carries 32 bits, and the drive filters out those that do not belong to the
/// parameter's type (manual B 2.5): a value that is too wide would be kept cut off, with status 00h.
/// No command of manual B tells the type. The bounds tell what of it matters: a minimum that is
/// greater than the maximum is a negative number, as wide as its type. Where they are equal, the drive
/// tells no range, and every 32-bit value lies in it (project-defined).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Range {
    minimum: u32,
    maximum: u32,
}

impl Range {
    /// From the raw values.
    #[must_use]
    pub const fn new(minimum: u32, maximum: u32) -> Self {
        Self { minimum, maximum }
    }

    /// Whether the drive tells a range at all.
    #[must_use]
    pub const fn is_told(&self) -> bool {
        self.minimum != self.maximum
    }

    /// Whether the parameter is of a signed type, as far as its bounds tell.
    #[must_use]
    pub const fn is_signed(&self) -> bool {
        self.minimum > self.maximum
    }

    /// The least value.
    #[must_use]
    pub const fn minimum(&self) -> i64 {
        self.number(self.minimum)
    }

    /// The greatest value.
    #[must_use]
    pub const fn maximum(&self) -> i64 {
        self.number(self.maximum)
    }

    /// Bits above the sign bit of a signed type.
    const fn unused(&self) -> u32 {
        match self.minimum {
            0..=0xFF => 24,
            0x100..=0xFFFF => 16,
            _ => 0,
        }
    }

    /// The number that a raw value means. A signed type's may be extended by its sign or not; bits
    /// that belong to neither form stay, and no range has them.
    #[must_use]
    pub const fn number(&self, raw: u32) -> i64 {
        if self.is_signed() {
            let unused = self.unused();
            let extended = ((raw << unused) as i32) >> unused;
            if extended as u32 == raw || raw << unused >> unused == raw {
                return extended as i64;
            }
        }
        raw as i64
    }

    /// Whether a raw value lies between the bounds and is no wider than the type.
    #[must_use]
    pub const fn contains(&self, raw: u32) -> bool {
        let number = self.number(raw);
        !self.is_told() || self.minimum() <= number && number <= self.maximum()
    }

    /// The raw value of a number; `None` outside of the bounds.
    #[must_use]
    pub const fn raw(&self, number: i64) -> Option<u32> {
        if !self.is_told() {
            let fits = number >= i32::MIN as i64 && number <= u32::MAX as i64;
            return if fits { Some(number as u32) } else { None };
        }
        if number < self.minimum() || number > self.maximum() {
            return None;
        }
        let unused = if self.is_signed() { self.unused() } else { 0 };
        Some((number as u32) << unused >> unused)
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
        assert_eq!((s8.to_string().as_str(), s8.is_signed()), ("-100 to 100", true));
        assert_eq!(
            [-100, -1, 100, 101, -101].map(|n| s8.raw(n)),
            [Some(0x9C), Some(0xFF), Some(100), None, None]
        );
        // Extended by its sign or not; any other bits are too many.
        assert_eq!([0xFB, 0xFFFF_FFFB].map(|raw| (s8.number(raw), s8.contains(raw))), [(-5, true); 2]);
        assert!([0x1FB, 0xFFFB, 0xFFFF_FF05, 0x105].iter().all(|raw| !s8.contains(*raw)));
        let s32 = Range::new(i32::MIN as u32, i32::MAX as u32);
        assert_eq!((s32.number(0xFFFF_FFFF), s32.raw(-1), s32.raw(1 << 31)), (-1, Some(u32::MAX), None));
        let u32 = Range::new(0, u32::MAX);
        assert_eq!((u32.number(u32::MAX), u32.raw(-1), u32.raw(1 << 32)), (0xFFFF_FFFF, None, None));
        let untold = Range::new(7, 7);
        assert!(untold.contains(99_999) && untold.raw(-3) == Some(-3i32 as u32));
        assert_eq!((untold.raw(1 << 32), untold.to_string().as_str()), (None, "32 bits"));
    }

    proptest! {
        /// Whatever the type, its own bounds are enough to tell what the drive would keep as it came.
        #[test]
        fn what_lies_in_a_range_is_kept_whole(kind in 0u8..=6, a: u32, b: u32, raw: u32, number in -5_000_000_000i64..5_000_000_000) {
            let kind = ParameterType(kind);
            let (low, high) = if kind.number(a) < kind.number(b) { (a, b) } else { (b, a) };
            let range = Range::new(low & kind.mask(), high & kind.mask());
            prop_assume!(range.is_told());
            // Bounds that are both negative are taken for unsigned; see `is_signed`.
            prop_assume!(kind.number(high) >= 0 || kind.number(low) >= 0);
            for raw in [raw, raw & kind.mask(), kind.number(raw) as u32] {
                if range.contains(raw) {
                    prop_assert_eq!(range.number(raw), kind.number(raw & kind.mask()));
                    prop_assert_eq!(range.raw(range.number(raw)), Some(raw & kind.mask()));
                }
            }
            let within = (kind.number(low)..=kind.number(high)).contains(&number);
            prop_assert_eq!(range.raw(number).map(|raw| kind.number(raw)), within.then_some(number));
        }
    }
}
