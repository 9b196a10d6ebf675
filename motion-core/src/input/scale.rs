//! From counts to user measuring units (manual A 1.5).

/// Multiplier, negation and home offset of an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Scale {
    /// mn·N.
    numerator: i64,
    /// md, at least 1.
    denominator: i64,
    /// H.
    home: i32,
}

impl Scale {
    /// `numerator` `[205]`, `denominator` `[212]` (0, which the loader refuses, stands for 1),
    /// `negate` `[198]`, `home` `[219]`.
    #[must_use]
    pub fn new(numerator: i32, denominator: i32, negate: bool, home: i32) -> Self {
        let numerator = i64::from(numerator);
        Self {
            numerator: if negate { -numerator } else { numerator },
            denominator: i64::from(denominator.max(1)),
            home,
        }
    }

    /// One unit a count, shifted by `home`.
    #[must_use]
    pub fn unity(home: i32) -> Self {
        Self::new(1, 1, false, home)
    }

    /// A = count·(mn/md)·N + H − X, divided once, rounded down, and wrapped into −2^31…2^31−1.
    #[must_use]
    pub fn value(&self, count: i64, offset: i32) -> i32 {
        let scaled = match count.checked_mul(self.numerator) {
            Some(product) => i128::from(product.div_euclid(self.denominator)),
            None => {
                let product = i128::from(count) * i128::from(self.numerator);
                product.div_euclid(i128::from(self.denominator))
            }
        };
        // Low 32 bits: the counting range wraps (7.2).
        (scaled as i32).wrapping_add(self.home).wrapping_sub(offset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// 1.5: 40,000 counts a turn, multiplier 36000/40000: 360.00°.
    #[test]
    fn the_manuals_example() {
        let scale = Scale::new(36_000, 40_000, false, 0);
        assert_eq!([0, 1, 39_999, 40_000, -1].map(|count| scale.value(count, 0)), [0, 0, 35_999, 36_000, -1]);
    }

    proptest! {
        /// Against the definition: A·md ≤ count·mn·N < (A + 1)·md before the wrap.
        #[test]
        fn rounded_down_once(
            count: i64, numerator in 0..=16_777_215, denominator in 1..=16_777_215,
            negate: bool, home in -99_999_999..=99_999_999, offset: i32,
        ) {
            let signed = if negate { -i128::from(numerator) } else { i128::from(numerator) };
            let product = i128::from(count) * signed;
            let mut quotient = product / i128::from(denominator);
            if quotient * i128::from(denominator) > product {
                quotient -= 1;
            }
            let exact = quotient + i128::from(home) - i128::from(offset);
            let value = Scale::new(numerator, denominator, negate, home).value(count, offset);
            prop_assert_eq!((exact - i128::from(value)).rem_euclid(1 << 32), 0);
        }
    }
}
