//! Set value generator: the fastest way of one axis from any state of motion to a target, within
//! limits of velocity, acceleration, deceleration and jerk (manual A 6.8.1.1, "speed pre-control").
//!
//! - A [`Profile`] is one planned way: to a position ([`Profile::move_to`]), to a position passed with a
//!   velocity ([`Profile::pass`]), to a velocity ([`Profile::reach`]) or to a standstill
//!   ([`Profile::stop`]). It is computed in continuous time and read at any time, so that when it arrives
//!   does not depend on the cycle.
//! - A [`Generator`] steps along profiles and takes new targets, velocities and limits on the way.
//! - A [`Bank`] evaluates many profiles at once.
//!
//! Units are the caller's: positions are whole user measuring units held in `f64` (exact up to ±2^53),
//! velocities units/s, accelerations units/s², jerks units/s³, times s. Only additions,
//! multiplications, divisions and correctly rounded square roots are used, so the results are the same
//! bit for bit on every machine.
//!
//! The way is optimal: full jerk up, held at the limits, full jerk down, where deceleration is what
//! bounds |a| while the speed falls and acceleration while it grows (standstill counts as growing). A
//! start outside of the limits is brought back inside as fast as the jerk allows, first.

mod bank;
mod generator;
mod limits;
mod math;
mod plan;
mod profile;
mod ramp;
mod rest;
mod search;
mod solve;
mod trapezoid;

pub use bank::Bank;
pub use generator::{Generator, Goal};
pub use limits::{LimitError, Limits, MAX_RATIO};
pub use profile::{MAX_PHASES, Phase, PlanError, Profile, State};
