//! Braking by the residual distance (mode Ramps, 6.8.1.3).

/// The highest velocity at a distance from the target: straight lines between the ramp points V1, V2 and
/// V max. from standstill at the target on (decision 21); beyond the last point there is no limit but
/// `maximum`. Points that are not farther than the one before, or not faster, are left out.
pub(super) fn velocity(distance: f64, points: &[(i32, i32); 3], maximum: f64) -> f64 {
    let (mut near, mut slow) = (0.0, 0.0);
    for &(far, fast) in points {
        let (far, fast) = (f64::from(far), f64::from(fast));
        if far <= near || fast < slow {
            continue;
        }
        if distance < far {
            return slow + (fast - slow) * (distance - near) / (far - near);
        }
        (near, slow) = (far, fast);
    }
    maximum
}

#[cfg(test)]
mod tests {
    use super::velocity;

    #[test]
    fn straight_between_the_points() {
        let points = [(100, 50), (500, 300), (2000, 1000)];
        let at = |distance| velocity(distance, &points, 1000.0);
        assert_eq!(
            [0.0, 50.0, 100.0, 300.0, 500.0, 1250.0, 2000.0, 1e6].map(at),
            [0.0, 25.0, 50.0, 175.0, 300.0, 650.0, 1000.0, 1000.0]
        );
    }

    #[test]
    fn points_that_are_not_set_are_left_out() {
        let points = [(0, 0), (0, 0), (2000, 1000)];
        assert_eq!(velocity(500.0, &points, 1000.0), 250.0);
    }
}
