//! Many axes at once.

use super::math::lesser;
use super::profile::{Phase, Profile, SIXTH};

/// Axes of a bank.
const LANES: usize = 64;

/// The present phases of up to 64 profiles side by side, so that one loop without a branch evaluates all
/// of them; more axes take more banks. Gives the same numbers as [`Profile::at`], up to the rounding of
/// their last digits; at rest exactly the same.
///
/// The bank holds what the present phases need; the profiles stay with the caller, who gives them with
/// every call in the order of the lanes.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub struct Bank {
    begin: [f64; LANES],
    start: [f64; LANES],
    speed: [f64; LANES],
    half_acceleration: [f64; LANES],
    sixth_jerk: [f64; LANES],
    position: [f64; LANES],
    velocity: [f64; LANES],
    /// When each lane's phase is over, and when the first of them is.
    next: [f64; LANES],
    earliest: f64,
    started: [f64; LANES],
    cursor: [u8; LANES],
}

impl Default for Bank {
    fn default() -> Self {
        Self::new()
    }
}

impl Bank {
    /// Axes of a bank.
    pub const LANES: usize = LANES;

    /// All axes standing at 0.
    #[must_use]
    pub const fn new() -> Self {
        let zero = [0.0; LANES];
        Self {
            begin: zero,
            start: zero,
            speed: zero,
            half_acceleration: zero,
            sixth_jerk: zero,
            position: zero,
            velocity: zero,
            next: [f64::INFINITY; LANES],
            earliest: f64::INFINITY,
            started: zero,
            cursor: [0; LANES],
        }
    }

    /// Lets an axis follow a profile from `now`, s, on. Lanes beyond [`Bank::LANES`] are ignored.
    pub fn follow(&mut self, lane: usize, profile: &Profile, now: f64) {
        if let (Some(cursor), Some(started)) = (self.cursor.get_mut(lane), self.started.get_mut(lane)) {
            *cursor = 0;
            *started = now;
            self.load(lane, profile);
            self.earliest = least(&self.next);
        }
    }

    /// Evaluates all axes at `now`, s, which must not go backwards.
    pub fn evaluate(&mut self, now: f64, profiles: &[Profile]) {
        if now >= self.earliest {
            self.turn(now, profiles);
        }
        self.sweep(now);
    }

    /// Positions evaluated last, units.
    #[must_use]
    pub const fn positions(&self) -> &[f64; LANES] {
        &self.position
    }

    /// Velocities evaluated last, units/s.
    #[must_use]
    pub const fn velocities(&self) -> &[f64; LANES] {
        &self.velocity
    }

    #[inline]
    #[expect(clippy::indexing_slicing, reason = "lane < LANES: all arrays are that long")]
    fn sweep(&mut self, now: f64) {
        for lane in 0..LANES {
            // p = s + t·(v + t·(a/2 + t·j/6)), v + t·(a + t·j/2), with what both have in common.
            let time = now - self.begin[lane];
            let slope = time * self.sixth_jerk[lane];
            let half = self.half_acceleration[lane] + slope;
            let mean = self.speed[lane] + time * half;
            self.position[lane] = self.start[lane] + time * mean;
            self.velocity[lane] = mean + time * (half + slope);
        }
    }

    /// Goes on to the next phases where they are due.
    fn turn(&mut self, now: f64, profiles: &[Profile]) {
        let due = |mask: u64, (lane, next): (usize, &f64)| mask | u64::from(now >= *next) << lane;
        let mut due = self.next.iter().enumerate().fold(0, due);
        while due != 0 {
            let lane = due.trailing_zeros() as usize;
            due &= due - 1;
            // Phases can be shorter than a cycle. The end, after the last, lasts for ever.
            while let (Some(next), Some(profile)) = (self.next.get(lane), profiles.get(lane))
                && now >= *next
                && let Some(cursor) = self.cursor.get_mut(lane)
                && usize::from(*cursor) < profile.phases().len()
            {
                *cursor += 1;
                self.load(lane, profile);
            }
        }
        self.earliest = least(&self.next);
    }

    fn load(&mut self, lane: usize, profile: &Profile) {
        let cursor = self.cursor.get(lane).map_or(0, |cursor| usize::from(*cursor));
        let started = self.started.get(lane).copied().unwrap_or(0.0);
        let phases = profile.phases();
        let (phase, origin, next) = match phases.get(cursor) {
            Some(phase) => {
                let next = phases.get(cursor + 1).map_or(profile.duration(), |next| next.begin);
                (*phase, profile.origin(cursor), started + next)
            }
            None => {
                let end = profile.end();
                let phase = Phase { begin: profile.duration(), velocity: end.velocity, ..Phase::default() };
                (phase, end.position, f64::INFINITY)
            }
        };
        let set = |array: &mut [f64; LANES], value| {
            if let Some(slot) = array.get_mut(lane) {
                *slot = value;
            }
        };
        set(&mut self.begin, started + phase.begin);
        set(&mut self.next, next);
        set(&mut self.start, origin + phase.position);
        set(&mut self.speed, phase.velocity);
        set(&mut self.half_acceleration, phase.acceleration / 2.0);
        set(&mut self.sixth_jerk, phase.jerk * SIXTH);
    }
}

/// The least of all, eight side by side.
fn least(times: &[f64; LANES]) -> f64 {
    let mut least = [f64::INFINITY; 8];
    for chunk in times.chunks_exact(least.len()) {
        for (least, time) in least.iter_mut().zip(chunk) {
            *least = lesser(*least, *time);
        }
    }
    least.into_iter().fold(f64::INFINITY, lesser)
}
