//! The master's side of one drive.

use core::time::Duration;

use super::{Command, ControlWord, Mode, State, StatusWord, next_command};
use crate::ring::Ring;

/// Names one goal from [`Axis::go`] to its outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Ticket(u32);

/// What the drive shall come to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Goal {
    /// A state: anything but the ones that a drive enters by itself. A fault on the way, or at the
    /// start, ends the goal; it is never reset without [`Goal::ResetFault`].
    State(State),
    /// Fault reset: bit 7 goes to 0, then to 1, and the drive must leave fault.
    ResetFault,
    /// Another mode, which 6061h must then show.
    Mode(Mode),
    /// pp: bit 4 goes from 0 to 1 and back, the drive must acknowledge by bit 12. The target must be
    /// written before or with the control word.
    SetPoint {
        /// Go at once, not after the current one.
        immediately: bool,
        /// It is a distance.
        relative: bool,
    },
    /// hm: bit 4 goes to 1 until homing is attained.
    Home,
}

/// How a goal ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Outcome {
    /// Reached, as the status word shows.
    Done,
    /// The drive has a fault; of [`Goal::ResetFault`], still, or again.
    Fault,
    /// hm: the drive reports a homing error.
    HomingError,
    /// Not reached in time; the last state shown, `None` if there was none.
    TimedOut(Option<State>),
    /// Another goal or a quick stop took its place.
    Cancelled,
}

/// What [`Axis::poll_event`] tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Event {
    /// The one outcome of a goal.
    Outcome(Ticket, Outcome),
    /// The drive shows another state.
    State(State),
    /// Bit 10 went to 1.
    TargetReached,
}

/// Why [`Axis::go`] did not take a goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SubmitError {
    /// Events must be polled first: outcomes are never dropped.
    #[error("events must be polled before another goal is set")]
    Unpolled,
    /// A drive enters this state only by itself.
    #[error("no control word leads to the state {0}")]
    State(State),
    /// Set-points and homing need their mode and operation enabled.
    #[error("mode {mode}, state {state:?}: the drive cannot start a motion so", mode = mode.name())]
    NotReady {
        /// The mode shown.
        mode: Mode,
        /// The state shown.
        state: Option<State>,
    },
}

/// How an axis is driven.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// Longest time for one step: from a control word to the status word that follows it. Homing has
    /// no limit of its own.
    pub step: Duration,
    /// The drive may go from quick stop active straight back to operation enabled (605Ah 5…8).
    pub resume: bool,
}

/// Project-defined.
impl Default for Config {
    fn default() -> Self {
        Self { step: Duration::from_secs(1), resume: false }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Idle,
    State(State),
    /// Bit 7 or bit 4 must be seen at 0 first.
    Low(Edge),
    High(Edge),
    /// pp: bit 4 is at 0 again, bit 12 must follow.
    Release,
    Mode(Mode),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Edge {
    Reset,
    SetPoint(u16),
    Home,
}

/// Events held until polled; the last two places are kept for outcomes.
const EVENTS: usize = 8;

/// Brings one drive where it shall be, a control word at a time.
///
/// - Commands: [`go`](Self::go), [`quick_stop`](Self::quick_stop), [`set_halt`](Self::set_halt).
/// - Input: [`handle_status`](Self::handle_status), [`handle_mode`](Self::handle_mode),
///   [`handle_timeout`](Self::handle_timeout).
/// - Output: [`poll_control`](Self::poll_control) whenever a control word is sent,
///   [`poll_event`](Self::poll_event), [`poll_timeout`](Self::poll_timeout).
#[derive(Debug, Clone)]
pub struct Axis {
    config: Config,
    command: Command,
    halt: bool,
    mode: Mode,
    shown_mode: Mode,
    status: Option<StatusWord>,
    phase: Phase,
    ticket: u32,
    deadline: Option<Duration>,
    events: Ring<Event, EVENTS>,
    lost_events: u32,
}

impl Default for Axis {
    fn default() -> Self {
        Self::new(Config::default())
    }
}

impl Axis {
    /// An axis that asks for nothing (control word 0) until told to.
    #[must_use]
    pub const fn new(config: Config) -> Self {
        Self {
            config,
            command: Command::DisableVoltage,
            halt: false,
            mode: Mode::NONE,
            shown_mode: Mode::NONE,
            status: None,
            phase: Phase::Idle,
            ticket: 0,
            deadline: None,
            events: Ring::new(),
            lost_events: 0,
        }
    }

    /// The state that the drive showed last.
    #[must_use]
    pub fn state(&self) -> Option<State> {
        self.status.and_then(StatusWord::state)
    }

    /// The status word that came last.
    #[must_use]
    pub const fn status(&self) -> Option<StatusWord> {
        self.status
    }

    /// The mode to write to 6060h.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// Events, other than outcomes, that were dropped because nobody polled.
    #[must_use]
    pub const fn lost_events(&self) -> u32 {
        self.lost_events
    }

    /// Sets a goal; one that is under way ends as [`Outcome::Cancelled`].
    ///
    /// # Errors
    /// [`SubmitError::Unpolled`] where an outcome could find no place, [`SubmitError::State`] for a
    /// state that no command leads to, [`SubmitError::NotReady`] for a motion in the wrong mode or
    /// state.
    pub fn go(&mut self, now: Duration, goal: Goal) -> Result<Ticket, SubmitError> {
        if self.events.len() + 2 > EVENTS {
            return Err(SubmitError::Unpolled);
        }
        let ready = |mode| {
            let (shown, state) = (self.shown_mode, self.state());
            (shown == mode && state == Some(State::OperationEnabled))
                .then_some(())
                .ok_or(SubmitError::NotReady { mode: shown, state })
        };
        let phase = match goal {
            Goal::State(state @ (State::NotReadyToSwitchOn | State::FaultReactionActive | State::Fault)) => {
                return Err(SubmitError::State(state));
            }
            Goal::State(state) => Phase::State(state),
            Goal::ResetFault => Phase::Low(Edge::Reset),
            Goal::Mode(mode) => Phase::Mode(mode),
            Goal::SetPoint { immediately, relative } => {
                ready(Mode::PROFILE_POSITION)?;
                let bits = if immediately { ControlWord::CHANGE_IMMEDIATELY } else { 0 }
                    | if relative { ControlWord::RELATIVE } else { 0 };
                Phase::Low(Edge::SetPoint(bits))
            }
            Goal::Home => {
                ready(Mode::HOMING)?;
                Phase::Low(Edge::Home)
            }
        };
        self.end(Outcome::Cancelled);
        self.ticket = self.ticket.wrapping_add(1);
        self.phase = phase;
        if let Phase::Mode(mode) = phase {
            self.mode = mode;
        }
        self.deadline = Some(now.saturating_add(self.config.step));
        self.advance(now);
        Ok(Ticket(self.ticket))
    }

    /// Quick stop, from the next control word on and whatever is under way; a later goal ends it.
    pub fn quick_stop(&mut self) {
        self.end(Outcome::Cancelled);
        self.command = Command::QuickStop;
    }

    /// Sets or clears halt (bit 8): the drive stops and holds, its state stays.
    pub const fn set_halt(&mut self, halt: bool) {
        self.halt = halt;
    }

    /// Takes a status word.
    pub fn handle_status(&mut self, now: Duration, word: StatusWord) {
        let before = self.status.replace(word);
        let state = word.state();
        if let Some(state) = state
            && before.and_then(StatusWord::state) != Some(state)
        {
            // One step of the way is done: the next has its own time.
            self.deadline = self.deadline.map(|_| now.saturating_add(self.config.step));
            self.tell(Event::State(state));
        }
        let reached = |word: StatusWord| word.has(StatusWord::TARGET_REACHED);
        if reached(word) && !before.is_some_and(reached) {
            self.tell(Event::TargetReached);
        }
        self.advance(now);
    }

    /// Takes the mode that the drive is in (6061h).
    pub fn handle_mode(&mut self, now: Duration, mode: Mode) {
        self.shown_mode = mode;
        self.advance(now);
    }

    /// The control word to send now. To be called once for each control word that is sent: edges of
    /// bits 4 and 7 go out one level at a time.
    pub fn poll_control(&mut self) -> ControlWord {
        let halt = if self.halt { ControlWord::HALT } else { 0 };
        let word = ControlWord(self.command.bits() | halt);
        match self.phase {
            Phase::Low(edge) => {
                self.phase = Phase::High(edge);
                word
            }
            Phase::High(Edge::Reset) => ControlWord(word.0 | ControlWord::FAULT_RESET),
            Phase::High(Edge::SetPoint(bits)) => ControlWord(word.0 | ControlWord::MODE_BIT_4 | bits),
            Phase::High(Edge::Home) => ControlWord(word.0 | ControlWord::MODE_BIT_4),
            _ => word,
        }
    }

    /// Ends a goal whose time is over; early calls do nothing.
    pub fn handle_timeout(&mut self, now: Duration) {
        if self.deadline.is_none_or(|deadline| now < deadline) {
            return;
        }
        let outcome = match self.phase {
            Phase::High(Edge::Reset) if self.state() == Some(State::Fault) => Outcome::Fault,
            _ => Outcome::TimedOut(self.state()),
        };
        self.end(outcome);
    }

    /// When to call [`handle_timeout`](Self::handle_timeout); `None` = no goal.
    #[must_use]
    pub const fn poll_timeout(&self) -> Option<Duration> {
        self.deadline
    }

    /// What happened, until `None`.
    pub fn poll_event(&mut self) -> Option<Event> {
        self.events.pop()
    }

    /// Looks whether the phase has got where it wants to.
    fn advance(&mut self, now: Duration) {
        let Some(status) = self.status else { return };
        let state = status.state();
        let faulty = matches!(state, Some(State::Fault | State::FaultReactionActive));
        match self.phase {
            Phase::Idle => {}
            Phase::Mode(mode) if self.shown_mode == mode => self.end(Outcome::Done),
            Phase::Mode(_) => {}
            Phase::Low(Edge::Reset) if !faulty && state.is_some() => self.end(Outcome::Done),
            Phase::High(Edge::Reset) if !faulty && state.is_some() => {
                self.command = Command::DisableVoltage;
                self.end(Outcome::Done);
            }
            Phase::Low(Edge::Reset) | Phase::High(Edge::Reset) => {}
            _ if faulty => {
                self.command = Command::DisableVoltage;
                self.end(Outcome::Fault);
            }
            Phase::State(wanted) => match state {
                Some(state) if state == wanted => {
                    self.command = hold(state);
                    self.end(Outcome::Done);
                }
                Some(state) => {
                    let next = next_command(state, wanted, self.config.resume);
                    self.command = next.unwrap_or(self.command);
                }
                None => {}
            },
            Phase::Low(_) => {}
            Phase::High(Edge::SetPoint(_)) if status.has(StatusWord::MODE_BIT_12) => {
                self.phase = Phase::Release;
                self.deadline = Some(now.saturating_add(self.config.step));
            }
            Phase::Release if !status.has(StatusWord::MODE_BIT_12) => self.end(Outcome::Done),
            Phase::High(Edge::Home) => {
                // The drive follows; how far the reference is, nobody knows.
                self.deadline = None;
                if status.has(StatusWord::MODE_BIT_13) {
                    self.end(Outcome::HomingError);
                } else if status.has(StatusWord::MODE_BIT_12 | StatusWord::TARGET_REACHED) {
                    self.end(Outcome::Done);
                }
            }
            Phase::High(Edge::SetPoint(_)) | Phase::Release => {}
        }
    }

    fn end(&mut self, outcome: Outcome) {
        if core::mem::replace(&mut self.phase, Phase::Idle) == Phase::Idle {
            return;
        }
        self.deadline = None;
        // `go` has kept a place.
        let _ = self.events.push(Event::Outcome(Ticket(self.ticket), outcome));
    }

    fn tell(&mut self, event: Event) {
        if self.events.len() + 2 > EVENTS || self.events.push(event).is_err() {
            self.lost_events = self.lost_events.saturating_add(1);
        }
    }
}

/// The command that leaves a drive in the state it is in.
const fn hold(state: State) -> Command {
    match state {
        State::OperationEnabled => Command::EnableOperation,
        State::SwitchedOn => Command::SwitchOn,
        State::ReadyToSwitchOn => Command::Shutdown,
        State::QuickStopActive => Command::QuickStop,
        _ => Command::DisableVoltage,
    }
}

#[cfg(test)]
mod tests {
    use super::super::Drive;
    use super::*;
    use std::vec::Vec;

    /// An axis and a drive that exchange words once a cycle of 10 ms.
    struct Pair {
        now: Duration,
        axis: Axis,
        drive: Drive,
        words: Vec<u16>,
        /// The drive ignores control words.
        deaf: bool,
    }

    impl Pair {
        fn new() -> Self {
            let (axis, drive) = (Axis::default(), Drive::new(false));
            let mut pair = Self { now: Duration::ZERO, axis, drive, words: Vec::new(), deaf: false };
            pair.cycle();
            pair.events();
            pair.words.clear();
            pair
        }

        fn cycle(&mut self) {
            let word = self.axis.poll_control();
            if self.words.last() != Some(&word.0) {
                self.words.push(word.0);
            }
            if !self.deaf {
                self.drive.handle_control(word);
                self.drive.set_mode(self.axis.mode());
            }
            self.now += Duration::from_millis(10);
            self.axis.handle_status(self.now, self.drive.status_word());
            self.axis.handle_mode(self.now, self.drive.mode());
            self.axis.handle_timeout(self.now);
        }

        fn go(&mut self, goal: Goal) -> Outcome {
            let ticket = self.axis.go(self.now, goal).unwrap();
            for _ in 0..500 {
                while let Some(event) = self.axis.poll_event() {
                    if let Event::Outcome(ended, outcome) = event {
                        assert_eq!(ended, ticket);
                        return outcome;
                    }
                }
                self.cycle();
            }
            panic!("no outcome")
        }

        fn events(&mut self) -> Vec<Event> {
            core::iter::from_fn(|| self.axis.poll_event()).collect()
        }
    }

    #[test]
    fn the_shortest_way_up_and_down() {
        let mut pair = Pair::new();
        assert_eq!(pair.go(Goal::State(State::OperationEnabled)), Outcome::Done);
        assert_eq!(pair.words, [0x06, 0x07, 0x0F]);
        pair.words.clear();
        assert_eq!(pair.go(Goal::State(State::ReadyToSwitchOn)), Outcome::Done);
        assert_eq!(pair.words, [0x06]);
        let refused = pair.axis.go(pair.now, Goal::State(State::Fault));
        assert_eq!(refused, Err(SubmitError::State(State::Fault)));
    }

    #[test]
    fn fault_reset_is_an_edge_and_verified() {
        let mut pair = Pair::new();
        pair.go(Goal::State(State::OperationEnabled));
        pair.drive.fault();
        pair.drive.fault_reaction_done();
        pair.cycle();
        assert_eq!(pair.go(Goal::State(State::OperationEnabled)), Outcome::Fault, "never reset unasked");
        pair.words.clear();
        assert_eq!(pair.go(Goal::ResetFault), Outcome::Done);
        assert_eq!(pair.words, [0x00, 0x80]);
        pair.cycle();
        assert_eq!(pair.words, [0x00, 0x80, 0x00], "bit 7 goes back");
        pair.drive.fault();
        pair.drive.fault_reaction_done();
        pair.cycle();
        pair.deaf = true;
        assert_eq!(pair.go(Goal::ResetFault), Outcome::Fault, "the drive stays in fault");
    }

    #[test]
    fn a_fault_on_the_way_ends_the_goal() {
        let mut pair = Pair::new();
        pair.axis.go(pair.now, Goal::State(State::OperationEnabled)).unwrap();
        pair.cycle();
        pair.drive.fault();
        pair.cycle();
        assert!(matches!(pair.events().last(), Some(Event::Outcome(_, Outcome::Fault))));
        assert_eq!(pair.axis.poll_control(), ControlWord(0));
    }

    #[test]
    fn silence_times_out() {
        let mut pair = Pair::new();
        pair.deaf = true;
        let outcome = pair.go(Goal::State(State::OperationEnabled));
        assert_eq!(outcome, Outcome::TimedOut(Some(State::SwitchOnDisabled)));
        assert_eq!(
            pair.go(Goal::Mode(Mode::CYCLIC_VELOCITY)),
            Outcome::TimedOut(Some(State::SwitchOnDisabled))
        );
    }

    #[test]
    fn quick_stop_takes_effect_with_the_next_word() {
        let mut pair = Pair::new();
        pair.go(Goal::State(State::OperationEnabled));
        let ticket = pair.axis.go(pair.now, Goal::Mode(Mode::HOMING)).unwrap();
        pair.axis.quick_stop();
        assert_eq!(pair.events(), [Event::Outcome(ticket, Outcome::Cancelled)]);
        pair.cycle();
        assert_eq!(pair.drive.state(), State::QuickStopActive);
        pair.axis.set_halt(true);
        assert!(pair.axis.poll_control().has(ControlWord::HALT));
    }

    #[test]
    fn set_points_and_homing() {
        let mut pair = Pair::new();
        let set_point = Goal::SetPoint { immediately: true, relative: false };
        assert!(matches!(pair.axis.go(pair.now, set_point), Err(SubmitError::NotReady { .. })));
        assert_eq!(pair.go(Goal::Mode(Mode::PROFILE_POSITION)), Outcome::Done);
        pair.go(Goal::State(State::OperationEnabled));
        pair.words.clear();
        for _ in 0..2 {
            assert_eq!(pair.go(set_point), Outcome::Done);
        }
        assert_eq!(pair.words, [0x0F, 0x3F, 0x0F, 0x3F, 0x0F]);
        assert_eq!(pair.go(Goal::Mode(Mode::HOMING)), Outcome::Done);
        let ticket = pair.axis.go(pair.now, Goal::Home).unwrap();
        for _ in 0..1000 {
            pair.cycle();
        }
        assert_eq!(pair.events(), [], "homing takes as long as it takes");
        pair.drive.set_flag(StatusWord::MODE_BIT_12 | StatusWord::TARGET_REACHED, true);
        pair.cycle();
        assert_eq!(pair.events(), [Event::TargetReached, Event::Outcome(ticket, Outcome::Done)]);
    }
}
