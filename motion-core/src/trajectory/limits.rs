//! What a profile must keep within.

/// Acceleration and deceleration may differ by this factor at most; project-defined. Beyond it the
/// last digits of the shorter ramp are lost.
pub const MAX_RATIO: f64 = 1e4;

/// Limits of velocity, acceleration, deceleration and jerk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    velocity: f64,
    acceleration: f64,
    deceleration: f64,
    jerk: f64,
}

/// Limits that no profile can be computed with.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LimitError {
    /// Not a positive number.
    #[error("{name} {value} is not within {MIN_LIMIT:e}…{MAX_LIMIT:e}")]
    Range {
        /// Which limit.
        name: &'static str,
        /// The value given.
        value: f64,
    },
    /// Acceleration and deceleration are too far apart.
    #[error(
        "acceleration {acceleration} and deceleration {deceleration} differ by more than a factor of {MAX_RATIO}"
    )]
    Ratio {
        /// The acceleration given, units/s².
        acceleration: f64,
        /// The deceleration given, units/s².
        deceleration: f64,
    },
}

/// Least value of a limit; project-defined, far beyond what an axis can be set to.
const MIN_LIMIT: f64 = 1e-12;
/// Greatest value of a limit that is not infinite; project-defined.
const MAX_LIMIT: f64 = 1e18;

impl Limits {
    /// One of everything, without a limit of jerk.
    pub(crate) const UNIT: Self =
        Self { velocity: 1.0, acceleration: 1.0, deceleration: 1.0, jerk: f64::INFINITY };

    /// Limits in units/s, units/s² (while the speed grows, while it falls) and units/s³. A jerk of
    /// [`f64::INFINITY`] makes trapezoids.
    ///
    /// # Errors
    /// Each must be within 1e-12…1e18, acceleration and deceleration within a factor of 1e4.
    pub fn new(velocity: f64, acceleration: f64, deceleration: f64, jerk: f64) -> Result<Self, LimitError> {
        let range = MIN_LIMIT..=MAX_LIMIT;
        for (name, value) in
            [("velocity", velocity), ("acceleration", acceleration), ("deceleration", deceleration)]
        {
            if !range.contains(&value) {
                return Err(LimitError::Range { name, value });
            }
        }
        if !range.contains(&jerk) && jerk != f64::INFINITY {
            return Err(LimitError::Range { name: "jerk", value: jerk });
        }
        if acceleration > deceleration * MAX_RATIO || deceleration > acceleration * MAX_RATIO {
            return Err(LimitError::Ratio { acceleration, deceleration });
        }
        Ok(Self { velocity, acceleration, deceleration, jerk })
    }

    /// Highest speed, units/s.
    #[must_use]
    pub const fn velocity(&self) -> f64 {
        self.velocity
    }

    /// Highest acceleration while the speed grows, units/s².
    #[must_use]
    pub const fn acceleration(&self) -> f64 {
        self.acceleration
    }

    /// Highest acceleration while the speed falls, units/s².
    #[must_use]
    pub const fn deceleration(&self) -> f64 {
        self.deceleration
    }

    /// Highest change of acceleration, units/s³; infinite for a trapezoid.
    #[must_use]
    pub const fn jerk(&self) -> f64 {
        self.jerk
    }

    /// These limits, with another highest speed.
    ///
    /// # Errors
    /// As [`Limits::new`].
    pub fn with_velocity(self, velocity: f64) -> Result<Self, LimitError> {
        Self::new(velocity, self.acceleration, self.deceleration, self.jerk)
    }

    /// These limits, braking as hard as the harder of both.
    pub(super) fn braking_as(self, other: &Self) -> Self {
        let deceleration = self.deceleration.max(other.deceleration.min(self.acceleration * MAX_RATIO));
        Self { deceleration, jerk: self.jerk.max(other.jerk), ..self }
    }
}
