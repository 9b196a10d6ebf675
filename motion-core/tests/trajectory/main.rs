//! The set value generator against recorded reference cases, against a slow solver, and against its own
//! limits.
//!
//! 100,000 moves are made in each class, or as many as the variable `TRAJECTORY_MOVES` says.

mod check;
mod golden;
mod moves;
mod oracle;
mod underway;

use motion_core::trajectory::{Limits, State};
use oorandom::Rand64;

pub(crate) fn count() -> usize {
    std::env::var("TRAJECTORY_MOVES").ok().and_then(|text| text.parse().ok()).unwrap_or(100_000)
}

/// Between two positive numbers, equally often in every decade.
pub(crate) fn decades(random: &mut Rand64, low: f64, high: f64) -> f64 {
    low * (high / low).powf(random.rand_float())
}

pub(crate) fn between(random: &mut Rand64, low: f64, high: f64) -> f64 {
    low + (high - low) * random.rand_float()
}

/// Limits of an axis whose unit is small against its ways by about `scale`.
pub(crate) fn limits(random: &mut Rand64, scale: f64, symmetric: bool, jerk: bool) -> Limits {
    let velocity = decades(random, scale, 1000.0 * scale).round().max(1.0);
    let acceleration = velocity / decades(random, 0.01, 10.0);
    let deceleration = if symmetric { acceleration } else { acceleration * decades(random, 0.1, 10.0) };
    let jerk = if jerk { acceleration / decades(random, 0.01, 10.0) } else { f64::INFINITY };
    Limits::new(velocity, acceleration, deceleration, jerk).unwrap()
}

/// A state within the limits, from which they need not be left.
pub(crate) fn moving(random: &mut Rand64, limits: &Limits, position: f64) -> State {
    loop {
        let velocity = between(random, -1.0, 1.0) * limits.velocity();
        let sign = if random.rand_float() < 0.5 { -1.0 } else { 1.0 };
        let bound = if velocity * sign < 0.0 { limits.deceleration() } else { limits.acceleration() };
        let acceleration = if limits.jerk().is_finite() { sign * bound * random.rand_float() } else { 0.0 };
        let rest = velocity + acceleration * acceleration.abs() / (2.0 * limits.jerk());
        // Braking that must pass velocity 0 with more acceleration than may be there.
        let crossing = velocity * rest < 0.0
            && acceleration * acceleration - 2.0 * limits.jerk() * velocity.abs()
                > limits.acceleration().powi(2);
        if rest.abs() <= limits.velocity() && !crossing {
            return State { position, velocity, acceleration };
        }
    }
}
