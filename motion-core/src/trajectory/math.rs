//! Roots that come out the same on every machine, and extremes.

/// The lesser of two numbers: one instruction, where `f64::min` looks for a NaN as well. `a` if one is.
#[inline(always)]
pub(super) fn lesser(a: f64, b: f64) -> f64 {
    if b < a { b } else { a }
}

/// The greater of two numbers; `a` if one is a NaN.
#[inline(always)]
pub(super) fn greater(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

/// Square root, correctly rounded everywhere (IEEE 754); 0 for what rounding made negative.
#[inline]
pub(super) fn sqrt(x: f64) -> f64 {
    libm::sqrt(greater(0.0, x))
}

/// Cube root of a positive normal number to a few units in the last place, 0 for others. Without a
/// division and without a table, so that it costs little and rounds the same on every machine.
#[inline]
pub(super) fn cbrt(x: f64) -> f64 {
    if x < f64::MIN_POSITIVE {
        return 0.0;
    }
    // A third of the exponent, negated: x^(-1/3) to 3.5 %. Each step below leaves about the fourth
    // power of the error.
    let mut r = f64::from_bits(0x553e_f0ff_289d_d796 - x.to_bits() / 3);
    for _ in 0..2 {
        let h = 1.0 - x * r * (r * r);
        r += r * h * (1.0 / 3.0 + h * (2.0 / 9.0 + h * (14.0 / 81.0)));
    }
    x * (r * r)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cube_root_is_good_to_the_last_digits() {
        let mut x = 1e-300;
        while x < 1e300 {
            let error = (cbrt(x) / libm::cbrt(x) - 1.0).abs();
            assert!(error < 1e-15, "{x}: {error}");
            x *= 1.37;
        }
        assert_eq!((cbrt(0.0), cbrt(-1.0)), (0.0, 0.0));
    }
}
