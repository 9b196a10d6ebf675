//! Machines for a controller's terminals: drives with their mechanics, encoders with a reference mark,
//! switches and brakes, on virtual time.
//!
//! A [`Plant`] is one axis; a [`Machine`] wires several of them to the terminals of a controller
//! (manual A 3.7 to 3.11). Everything is computed in steps of 0.1 ms with `libm` only, so the same
//! commands give the same movement on every computer, bit for bit.

mod brake;
mod drive;
mod encoder;
mod machine;
mod switch;

pub use brake::Brake;
pub use drive::{Demand, Drive, Servo, Stepper, TwoSpeed, Valve};
pub use encoder::{Incremental, Sensor, Ssi};
pub use machine::{BrakeOutput, Connection, Machine, Wiring};
pub use switch::Switch;

/// Steps of the integration in a millisecond.
const STEPS: u32 = 10;
/// Length of a step, s.
const STEP: f64 = 0.001 / STEPS as f64;

/// A drive that moves an axis, with a brake that may hold it.
#[derive(Debug, Clone)]
pub struct Plant {
    drive: Drive,
    brake: Option<Brake>,
    position: f64,
    velocity: f64,
    /// Moves within these, in units.
    stops: (f64, f64),
}

impl Plant {
    /// An axis at position 0, at rest, free to move any distance.
    #[must_use]
    pub fn new(drive: Drive) -> Self {
        Self { drive, brake: None, position: 0.0, velocity: 0.0, stops: (f64::NEG_INFINITY, f64::INFINITY) }
    }

    /// With a brake, which is closed.
    #[must_use]
    pub fn with_brake(mut self, brake: Brake) -> Self {
        self.brake = Some(brake);
        self
    }

    /// With mechanical stops, in units.
    #[must_use]
    pub const fn with_stops(mut self, low: f64, high: f64) -> Self {
        self.stops = (low, high);
        self
    }

    /// Starting at `position`, in units.
    #[must_use]
    pub const fn at(mut self, position: f64) -> Self {
        self.position = position;
        self
    }

    /// Position, units.
    #[must_use]
    pub const fn position(&self) -> f64 {
        self.position
    }

    /// Velocity, units per second.
    #[must_use]
    pub const fn velocity(&self) -> f64 {
        self.velocity
    }

    /// The brake, if there is one.
    #[must_use]
    pub const fn brake(&self) -> Option<&Brake> {
        self.brake.as_ref()
    }

    /// Lets `milliseconds` pass under a demand, with the brake told to be open or closed.
    pub fn run(&mut self, milliseconds: u32, demand: Demand, open: bool) {
        for _ in 0..milliseconds {
            self.drive.begin(demand);
            for _ in 0..STEPS {
                let held = self.brake.as_mut().is_some_and(|brake| brake.step(open));
                self.step(held);
            }
        }
    }

    fn step(&mut self, held: bool) {
        let (position, velocity) = if held {
            self.drive.hold();
            (self.position, 0.0)
        } else {
            self.drive.step(self.position, self.velocity)
        };
        self.velocity = velocity;
        self.position = position;
        let (low, high) = self.stops;
        if self.position < low || self.position > high {
            self.position = self.position.clamp(low, high);
            self.velocity = 0.0;
            self.drive.hold();
        }
    }
}

#[cfg(test)]
mod tests;
