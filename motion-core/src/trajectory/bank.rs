//! Many axes at once.

use super::profile::{Profile, SIXTH};

/// Axes of a bank.
const LANES: usize = 64;

/// The present phases of up to 64 profiles side by side, so that one loop without a branch evaluates all
/// of them; more axes take more banks. Gives the same numbers as [`Profile::at`].
///
/// The bank holds what the present phases need; the profiles stay with the caller, who gives them with
/// every call in the order of the lanes.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub struct Bank {
    begin: [f64; LANES],
    next: [f64; LANES],
    origin: [f64; LANES],
    start: [f64; LANES],
    speed: [f64; LANES],
    half_acceleration: [f64; LANES],
    sixth_jerk: [f64; LANES],
    position: [f64; LANES],
    velocity: [f64; LANES],
    cursor: [u8; LANES],
    started: [f64; LANES],
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
            next: [f64::INFINITY; LANES],
            origin: zero,
            start: zero,
            speed: zero,
            half_acceleration: zero,
            sixth_jerk: zero,
            position: zero,
            velocity: zero,
            cursor: [0; LANES],
            started: zero,
        }
    }

    /// Lets an axis follow a profile from `now`, s, on. Lanes beyond [`Bank::LANES`] are ignored.
    pub fn follow(&mut self, lane: usize, profile: &Profile, now: f64) {
        if let (Some(cursor), Some(started)) = (self.cursor.get_mut(lane), self.started.get_mut(lane)) {
            *cursor = 0;
            *started = now;
            self.load(lane, profile);
        }
    }

    /// Evaluates all axes at `now`, s, which must not go backwards.
    pub fn evaluate(&mut self, now: f64, profiles: &[Profile]) {
        let mut due = self.sweep(now);
        // Phases can be shorter than a cycle.
        for _ in 0..=super::MAX_PHASES {
            if due == 0 {
                break;
            }
            for (lane, profile) in profiles.iter().enumerate().take(LANES) {
                if self.next.get(lane).is_some_and(|next| now >= *next)
                    && let Some(cursor) = self.cursor.get_mut(lane)
                {
                    *cursor += 1;
                    self.load(lane, profile);
                }
            }
            due = self.sweep(now);
        }
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
    fn sweep(&mut self, now: f64) -> usize {
        let mut due = 0;
        for lane in 0..LANES {
            let time = now - self.begin[lane];
            let (speed, half, sixth) =
                (self.speed[lane], self.half_acceleration[lane], self.sixth_jerk[lane]);
            self.position[lane] =
                self.origin[lane] + (self.start[lane] + time * (speed + time * (half + time * sixth)));
            self.velocity[lane] = speed + time * (2.0 * half + time * (3.0 * sixth));
            due += u64::from(now >= self.next[lane]);
        }
        due as usize
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
                let phase = super::Phase {
                    begin: profile.duration(),
                    velocity: end.velocity,
                    ..super::Phase::default()
                };
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
        set(&mut self.origin, origin);
        set(&mut self.start, phase.position);
        set(&mut self.speed, phase.velocity);
        set(&mut self.half_acceleration, phase.acceleration / 2.0);
        set(&mut self.sixth_jerk, phase.jerk * SIXTH);
    }
}
