//! The fast/slow jog control (mode Signals, 6.8.1.2): direction, slow and fast, and their times.

use super::settings::Jogs;
use crate::output::Signals;

/// What is wanted of the drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Wanted {
    pub(super) forward: bool,
    pub(super) fast: bool,
}

/// Puts out the signals one after the other: slow before fast by dt acceleration `[852]`, and before a
/// reversal fast off, dt shut down `[846]`, slow off, dt run out `[870]`.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sequence {
    /// Present direction; `None` once it has run out.
    forward: Option<bool>,
    slow: bool,
    fast: bool,
    /// Fast went off for a reversal.
    shutting_down: bool,
    /// Since the last change, ms.
    since: u16,
}

impl Sequence {
    /// Whether the drive stands, as far as its times tell.
    pub(super) fn stands(&self) -> bool {
        self.forward.is_none()
    }

    /// Whether fast is on.
    pub(super) fn is_fast(&self) -> bool {
        self.fast
    }

    /// Present direction of the signals, 0 when there are none.
    pub(super) fn direction(&self) -> i8 {
        match self.forward {
            Some(forward) if self.slow || self.fast => {
                if forward {
                    1
                } else {
                    -1
                }
            }
            _ => 0,
        }
    }

    /// One cycle of `cycle` ms.
    pub(super) fn cycle(&mut self, wanted: Option<Wanted>, settings: &Jogs, cycle: u16) -> Signals {
        self.since = self.since.saturating_add(cycle);
        match (self.forward, wanted) {
            (None, None) => {}
            (None, Some(wanted)) => {
                self.forward = Some(wanted.forward);
                (self.slow, self.fast) = (true, false);
                self.since = 0;
            }
            (Some(forward), Some(wanted)) if forward == wanted.forward => {
                if !self.slow {
                    self.slow = true;
                    self.since = 0;
                }
                if !wanted.fast {
                    self.fast = false;
                } else if self.since >= settings.acceleration_time {
                    self.fast = true;
                }
            }
            // Another direction: step by step.
            (Some(_), Some(_)) => {
                if self.fast {
                    (self.fast, self.shutting_down) = (false, true);
                    self.since = 0;
                } else if self.slow {
                    if !self.shutting_down || self.since >= settings.shut_down_time {
                        (self.slow, self.shutting_down) = (false, false);
                        self.since = 0;
                    }
                } else if self.since >= settings.run_out_time {
                    self.forward = None;
                }
            }
            (Some(_), None) => {
                if self.slow || self.fast {
                    (self.slow, self.fast) = (false, false);
                    self.since = 0;
                } else if self.since >= settings.run_out_time {
                    self.forward = None;
                }
            }
        }
        let on = self.slow || self.fast;
        Signals {
            forward: on && self.forward == Some(true),
            backward: on && self.forward == Some(false),
            slow: self.slow,
            fast: self.fast,
        }
    }
}

/// What is wanted on the way to a target `rest` ahead (behind: < 0): slow until ds run out is left, fast
/// until ds shut down more is left, and fast only if it is worth it (ds acceleration). `None` where
/// only the run-out is left.
pub(super) fn approach(rest: i64, is_fast: bool, settings: &Jogs) -> Option<Wanted> {
    let forward = rest > 0;
    let side = usize::from(!forward);
    let of = |both: &[i32; 2]| i64::from(both.get(side).copied().unwrap_or(0));
    let (run_out, shut_down) = (of(&settings.run_out), of(&settings.shut_down));
    let rest = rest.saturating_abs();
    if rest <= run_out {
        return None;
    }
    let slow = run_out.saturating_add(shut_down);
    let worth = rest > slow.saturating_add(settings.acceleration.into());
    let fast = settings.fast_position && (worth || is_fast && rest > slow);
    Some(Wanted { forward, fast })
}
