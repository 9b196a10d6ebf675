//! Setpoints of a motion profile, or of the line through points.

use core::f64::consts::PI;

/// A motion from rest to rest of a given length, by its shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Profile {
    /// Velocity is half a sine: what manual B's example curve follows (figure 13).
    Sine,
    /// The polynomial of fifth degree whose velocity and acceleration are 0 at both ends.
    MinimumJerk,
    /// Constant acceleration, velocity and deceleration, a third of the length each.
    Trapezoid,
}

impl Profile {
    /// Every profile.
    pub const ALL: [Self; 3] = [Self::Sine, Self::MinimumJerk, Self::Trapezoid];

    /// The share of the way, 0…1, that is done after this share of the length; 0 before the beginning,
    /// 1 after the end.
    #[must_use]
    pub fn share(self, length: f64) -> f64 {
        let x = if length > 0.0 { length.min(1.0) } else { 0.0 };
        match self {
            Self::Sine => (1.0 - libm::cos(PI * x)) / 2.0,
            Self::MinimumJerk => x * x * x * (10.0 + x * (6.0 * x - 15.0)),
            // The velocity in the middle is 1.5, the acceleration 4.5.
            Self::Trapezoid if x < 1.0 / 3.0 => 2.25 * x * x,
            Self::Trapezoid if x <= 2.0 / 3.0 => 1.5 * x - 0.25,
            Self::Trapezoid => 1.0 - 2.25 * (1.0 - x) * (1.0 - x),
        }
    }

    /// Its greatest velocity, which is that in the middle, as a multiple of the mean one.
    #[must_use]
    pub const fn peak(self) -> f64 {
        match self {
            Self::Sine => PI / 2.0,
            Self::MinimumJerk => 1.875,
            Self::Trapezoid => 1.5,
        }
    }

    /// Setpoint `number`, from 0, of a curve from `start` to `end` with so many setpoints, all in
    /// 0.1 µm: rounded half away from zero.
    #[must_use]
    pub fn setpoint(self, start: i32, end: i32, number: u16, setpoints: u16) -> i32 {
        let intervals = f64::from(setpoints.max(2) - 1);
        let way = f64::from(end) - f64::from(start);
        rounded(f64::from(start) + way * self.share(f64::from(number) / intervals))
    }
}

/// One setpoint of the line through `points` (x in ascending order, y), cut into equal steps from
/// the first x to the last; before and behind them the nearest y. `None` without points.
#[must_use]
pub fn resample(points: &[(f64, f64)], number: u16, setpoints: u16) -> Option<i32> {
    let (first, last) = (points.first()?, points.last()?);
    let intervals = f64::from(setpoints.max(2) - 1);
    let x = first.0 + (last.0 - first.0) * f64::from(number) / intervals;
    let after = points.partition_point(|point| point.0 < x);
    let (Some(right), Some(left)) = (points.get(after), after.checked_sub(1).and_then(|n| points.get(n)))
    else {
        return Some(rounded(points.get(after).unwrap_or(last).1));
    };
    let width = right.0 - left.0;
    let share = if width > 0.0 { (x - left.0) / width } else { 1.0 };
    Some(rounded(left.1 + (right.1 - left.1) * share))
}

/// A position in 0.1 µm as a setpoint: rounded half away from zero, saturated at the ends of the range.
#[must_use]
pub fn rounded(position: f64) -> i32 {
    libm::round(position) as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    /// Manual B, figure 13: the setpoints of the example curve.
    const DATA: [i32; 10] =
        [0, 0x75CA, 0x1_C8F2, 0x3_D090, 0x6_4DF8, 0x8_F448, 0xB_71B0, 0xD_794E, 0xE_CC76, 0xF_4240];

    fn curve(profile: Profile, end: i32, setpoints: u16) -> Vec<i32> {
        (0..setpoints).map(|n| profile.setpoint(0, end, n, setpoints)).collect()
    }

    #[test]
    fn the_examples_setpoints_are_a_sine() {
        assert_eq!(curve(Profile::Sine, 1_000_000, 10), DATA);
    }

    #[test]
    fn the_other_profiles() {
        assert_eq!(curve(Profile::Trapezoid, 72, 7), [0, 5, 18, 36, 54, 68, 72]);
        // 10 x³ - 15 x⁴ + 6 x⁵ at quarters: 106, 512 and 918 of 1024.
        assert_eq!(curve(Profile::MinimumJerk, 1024, 5), [0, 106, 512, 918, 1024]);
    }

    #[test]
    fn the_peak_is_the_slope_in_the_middle() {
        for profile in Profile::ALL {
            let slope = (profile.share(0.501) - profile.share(0.499)) / 0.002;
            assert!((slope - profile.peak()).abs() < 1e-4, "{profile:?}: {slope}");
        }
    }

    #[test]
    fn lines_are_cut_into_equal_steps() {
        let points = [(0.0, 0.0), (1.0, 100.0), (4.0, -200.0)];
        let cut: Vec<i32> = (0..5).map(|n| resample(&points, n, 5).unwrap()).collect();
        assert_eq!(cut, [0, 100, 0, -100, -200]);
        assert_eq!(resample(&[], 0, 2), None);
        assert_eq!(resample(&[(3.0, 7.4)], 1, 2), Some(7));
    }

    proptest! {
        /// From start to end, never back, the same from behind.
        #[test]
        fn profiles_rise_and_are_symmetric(x in 0.0..1.0f64, more in 0.0..1.0f64) {
            for profile in Profile::ALL {
                let share = profile.share(x);
                prop_assert!((0.0..=1.0).contains(&share));
                prop_assert!(profile.share((x + more).min(1.0)) >= share - 1e-12);
                prop_assert!((share + profile.share(1.0 - x) - 1.0).abs() < 1e-12, "{profile:?} at {x}");
                prop_assert_eq!((profile.share(-x), profile.share(1.0 + x)), (0.0, 1.0));
            }
        }
    }
}
