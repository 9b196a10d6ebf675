//! One drive LD 2000 behind an object IN and an object OUT (decision 14, 6.11).

use core::time::Duration;

use canopen_master::ds402::{self, Goal, Outcome, State, StatusWord};
use lb2::code::Failure;
use pdo::Payload;
use pdo::layout::ld2000::{Command, Feedback};

use crate::failure;
use crate::output::DriveSetpoint;

/// Increments of 2^-20 turn a second for one unit of the drive's speed, 1875/262144 rpm.
const INCREMENTS: i64 = 125;
/// Without an actual value for so long, it is no longer extrapolated: three SYNC periods.
const STALE: Duration = Duration::from_millis(30);

/// Actual values closer together than that tell nothing of an acceleration: they came late, or twice.
const CLOSE: Duration = Duration::from_millis(5);

/// What is known of a drive and wanted of it.
#[derive(Debug, Clone, Default)]
pub(super) struct Drive {
    control: ds402::Axis,
    enable: bool,
    /// What the axis wanted last.
    wanted: bool,
    feedback: Option<(Duration, Feedback)>,
    /// By how much its speed changes in a second, as the last two actual values tell.
    acceleration: i64,
    /// Guarding has lost it, or the bus is away.
    lost: bool,
    /// It is in another operating mode than digital speed.
    wrong_mode: bool,
    /// To be told to the axis with the next cycle.
    failure: Option<Failure>,
    faulty: bool,
    /// A warning is to be cleared: a drive that has missed its master does not move before.
    clear: bool,
}

/// Bit of the control word that clears warnings of an LD 2000.
const CLEAR_WARNING: u16 = 1 << 11;

impl Drive {
    /// Takes an actual value.
    pub(super) fn receive(&mut self, now: Duration, data: Payload) {
        let Some(feedback) = Feedback::parse(data) else { return };
        self.acceleration = match self.feedback {
            Some((before, old)) if (CLOSE..=STALE).contains(&now.saturating_sub(before)) => {
                let change = i64::from(feedback.speed) - i64::from(old.speed);
                change * 1_000_000 / (now - before).as_micros() as i64
            }
            _ => 0,
        };
        self.feedback = Some((now, feedback));
        let status = StatusWord(feedback.status_word);
        self.control.handle_status(now, status);
        let faulty = matches!(status.state(), Some(State::Fault | State::FaultReactionActive));
        if faulty && !core::mem::replace(&mut self.faulty, faulty) {
            self.failure = Some(failure::DRIVE_FAULT);
        }
        self.faulty = faulty;
        self.clear &= status.has(StatusWord::WARNING);
    }

    /// It starts anew: a scan resets what it finds.
    pub(super) fn restart(&mut self) {
        self.wrong_mode = false;
        self.forget();
    }

    /// What it showed last counts no more, nor what was asked of it.
    pub(super) fn forget(&mut self) {
        (self.enable, self.faulty) = (false, false);
        self.control = ds402::Axis::default();
    }

    /// The position now, 24 bits: SYNC is slower than the control cycle, so between two actual values it
    /// is extrapolated with the drive's own speed and its change (project-defined).
    pub(super) fn position(&self, now: Duration) -> Option<u32> {
        let (at, feedback) = self.feedback?;
        let age = now.saturating_sub(at);
        let age = if age > STALE || self.lost { Duration::ZERO } else { age };
        // At most 30 ms.
        let micros = age.as_micros() as i64;
        let mean_speed = i64::from(feedback.speed) + self.acceleration * micros / 2_000_000;
        let moved = mean_speed * INCREMENTS * micros / 1_000_000;
        Some(feedback.position.wrapping_add(moved as u32) & 0xFF_FFFF)
    }

    /// What failed since the last cycle; a drive that is lost, or in a wrong mode, fails as long as it is.
    pub(super) fn take_failure(&mut self) -> Option<Failure> {
        let lasting = if self.lost {
            Some(failure::DRIVE_LOST)
        } else {
            self.wrong_mode.then_some(failure::DRIVE_MODE)
        };
        let once = self.failure.take();
        lasting.or(once)
    }

    /// The drive is lost, or is back.
    pub(super) fn set_lost(&mut self, lost: bool) {
        if lost && !self.lost {
            // What comes back may be another drive, or the same after a loss of power; and be it back
            // before the next cycle, it has been away.
            self.forget();
            self.failure = Some(failure::DRIVE_LOST);
        }
        self.lost = lost;
    }

    /// The drive says by an emergency that it has a fault.
    pub(super) const fn emergency(&mut self) {
        if !core::mem::replace(&mut self.faulty, true) {
            self.failure = Some(failure::DRIVE_FAULT);
        }
    }

    /// The scan found it in another operating mode than digital speed.
    pub(super) const fn wrong_mode(&mut self) {
        self.wrong_mode = true;
    }

    /// What goes out in this cycle.
    pub(super) fn command(&mut self, now: Duration, wanted: &DriveSetpoint) -> Payload {
        self.control.handle_timeout(now);
        while let Some(event) = self.control.poll_event() {
            // A fault that a reset did not end is one still.
            if let ds402::Event::Outcome(_, Outcome::Fault | Outcome::TimedOut(Some(State::Fault))) = event
                && self.faulty
            {
                self.failure = Some(failure::DRIVE_FAULT);
            }
        }
        let warns = self.control.status().is_some_and(|status| status.has(StatusWord::WARNING));
        self.clear |= wanted.reset && warns;
        let anew = !core::mem::replace(&mut self.wanted, wanted.enable) && wanted.enable;
        if anew && self.faulty && !wanted.reset {
            // The axis may have forgotten it since, and must not take it for a drive that moves.
            self.failure = Some(failure::DRIVE_FAULT);
        }
        let enable = wanted.enable && !self.lost;
        let goal = if wanted.reset && self.faulty {
            Some(Goal::ResetFault)
        } else if enable != self.enable && !self.faulty {
            self.enable = enable;
            Some(Goal::State(if enable { State::OperationEnabled } else { State::ReadyToSwitchOn }))
        } else if self.faulty {
            self.enable = false;
            None
        } else {
            None
        };
        if let Some(goal) = goal {
            // Events have been polled and these states can be reached by command.
            let _ = self.control.go(now, goal);
        }
        let speed = if self.enable { wanted.speed } else { 0 };
        let clear = if self.clear { CLEAR_WARNING } else { 0 };
        Command { control_word: self.control.poll_control().0 | clear, speed }.encode()
    }
}
