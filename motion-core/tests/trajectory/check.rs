//! What every way must keep.

use motion_core::trajectory::{Limits, Profile, State};

/// Relative excess that rounding may make.
pub(crate) const SLACK: f64 = 1e-9;

/// Greatest of the relative excesses over a limit; only rounding may make it more than 0.
pub(crate) fn excess(profile: &Profile, limits: &Limits) -> f64 {
    let mut most = 0.0_f64;
    for (index, phase) in profile.phases().iter().enumerate() {
        let end = profile.phases().get(index + 1).map_or(profile.duration(), |next| next.begin);
        let length = end - phase.begin;
        let mut times = vec![0.0, length];
        if phase.jerk != 0.0 {
            times.push(-phase.acceleration / phase.jerk);
        }
        // Where the velocity is 0 the bound of |a| changes: just before and just after.
        let disc = phase.acceleration * phase.acceleration - 2.0 * phase.jerk * phase.velocity;
        if disc >= 0.0 {
            for root in [disc.sqrt(), -disc.sqrt()] {
                let zero = -2.0 * phase.velocity / (phase.acceleration + root);
                times.extend([zero * (1.0 - 1e-8), zero * (1.0 + 1e-8)]);
            }
        }
        for time in times.into_iter().filter(|time| (0.0..=length).contains(time)) {
            let State { velocity: v, acceleration: a, .. } = phase.after(time);
            // A time of some hundred seconds cannot say the moment of velocity 0 better than so.
            let bound = if v.abs() <= SLACK * limits.velocity() {
                limits.acceleration().max(limits.deceleration())
            } else if v * a < 0.0 {
                limits.deceleration()
            } else {
                limits.acceleration()
            };
            most = most.max(v.abs() / limits.velocity() - 1.0).max(a.abs() / bound - 1.0);
        }
        most = most.max(phase.jerk.abs() / limits.jerk() - 1.0);
    }
    most
}

/// Every phase continues the one before; the first continues the start and the last ends at the target.
pub(crate) fn assert_continuous(
    profile: &Profile,
    from: &State,
    limits: &Limits,
    what: &dyn core::fmt::Debug,
) {
    let end = profile.end();
    let mut before = *from;
    let mut at = 0.0;
    let way = profile
        .phases()
        .iter()
        .enumerate()
        .map(|(index, phase)| (profile.origin(index) + phase.position - from.position).abs());
    let scale = way.fold((end.position - from.position).abs(), f64::max);
    let v = profile.phases().iter().map(|phase| phase.velocity.abs()).fold(limits.velocity(), f64::max);
    let last = f64::EPSILON * (from.position.abs() + end.position.abs());
    let near = |a: f64, b: f64, scale: f64| (a - b).abs() <= SLACK * scale;
    for (index, phase) in profile.phases().iter().enumerate() {
        assert!(phase.begin >= at, "time goes backwards: {what:?}");
        let origin = profile.origin(index);
        let position = origin + phase.position;
        assert!(
            (position - before.position).abs() <= SLACK * scale + 4.0 * last,
            "jump of position {} in phase {index}: {what:?}",
            position - before.position
        );
        assert!(near(phase.velocity, before.velocity, v), "jump of velocity in phase {index}: {what:?}");
        if limits.jerk().is_finite() {
            let a = limits.acceleration().max(limits.deceleration()).max(from.acceleration.abs());
            assert!(
                near(phase.acceleration, before.acceleration, a),
                "jump of acceleration in phase {index}: {what:?}"
            );
        }
        at = profile.phases().get(index + 1).map_or(profile.duration(), |next| next.begin);
        before = phase.after(at - phase.begin);
        before.position += origin;
    }
    if !profile.phases().is_empty() {
        assert!(
            (end.position - before.position).abs() <= SLACK * scale + 4.0 * last,
            "ends {} off: {what:?}",
            end.position - before.position
        );
        assert!(near(end.velocity, before.velocity, limits.velocity()), "ends too fast: {what:?}");
    }
    assert_eq!(profile.at(profile.duration()), end, "{what:?}");
}
