//! The device's side.

use super::{Command, ControlWord, Mode, State, StatusWord};

/// What the drive has to do after a control word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Reaction {
    /// The state changed; operation enabled means torque, leaving it means none.
    State(State),
    /// A quick stop begins; [`Drive::quick_stop_done`] when the drive stands.
    QuickStop,
    /// pp: a new set-point is taken (bit 4 went to 1).
    SetPoint {
        /// Go at once, not after the current one.
        immediately: bool,
        /// It is a distance.
        relative: bool,
    },
    /// hm: homing starts (bit 4 went to 1).
    Homing,
    /// hm: homing is given up (bit 4 went to 0).
    HomingStopped,
    /// Bit 8 changed.
    Halt(bool),
}

/// State machine of one drive.
///
/// After power-up it is switch on disabled. A fault is reset by bit 7 going from 0 to 1 only.
#[derive(Debug, Clone)]
pub struct Drive {
    state: State,
    control: ControlWord,
    /// The bits of the status word that are no state.
    flags: u16,
    mode: Mode,
    /// 605Ah is 5…8: the drive stays in quick stop active when it stands.
    hold_after_quick_stop: bool,
}

impl Drive {
    /// A drive that is switch on disabled. `hold_after_quick_stop`: it stays in quick stop active
    /// (605Ah 5…8) rather than go on to switch on disabled (605Ah 1…4).
    #[must_use]
    pub const fn new(hold_after_quick_stop: bool) -> Self {
        Self {
            state: State::SwitchOnDisabled,
            control: ControlWord(0),
            flags: StatusWord::REMOTE,
            mode: Mode::NONE,
            hold_after_quick_stop,
        }
    }

    /// Its state.
    #[must_use]
    pub const fn state(&self) -> State {
        self.state
    }

    /// Its mode.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// Changes the mode; the bits of the status word that depend on it are cleared.
    pub const fn set_mode(&mut self, mode: Mode) {
        if self.mode.0 != mode.0 {
            self.flags &= !(StatusWord::TARGET_REACHED | StatusWord::MODE_BIT_12 | StatusWord::MODE_BIT_13);
        }
        self.mode = mode;
    }

    /// The last control word.
    #[must_use]
    pub const fn control_word(&self) -> ControlWord {
        self.control
    }

    /// The status word.
    #[must_use]
    pub const fn status_word(&self) -> StatusWord {
        StatusWord(self.state.bits() | self.flags)
    }

    /// Sets or clears bits of the status word that are no state: [`StatusWord::WARNING`] and so on.
    pub const fn set_flag(&mut self, mask: u16, on: bool) {
        let mask = mask & !0x6F;
        self.flags = if on { self.flags | mask } else { self.flags & !mask };
    }

    /// Takes a control word; at most a change of state and one thing more come of it.
    pub fn handle_control(&mut self, word: ControlWord) -> [Option<Reaction>; 2] {
        let before = core::mem::replace(&mut self.control, word);
        let rising = word.0 & !before.0;
        let falling = before.0 & !word.0;
        let state = self.follow(word.command(), rising & ControlWord::FAULT_RESET != 0);
        let more = if (rising | falling) & ControlWord::HALT != 0 {
            Some(Reaction::Halt(word.has(ControlWord::HALT)))
        } else {
            self.mode_bits(word, rising, falling)
        };
        [state, more]
    }

    /// The drive stands after a quick stop.
    pub fn quick_stop_done(&mut self) -> Option<Reaction> {
        if self.state != State::QuickStopActive || self.hold_after_quick_stop {
            return None;
        }
        Some(self.enter(State::SwitchOnDisabled))
    }

    /// A fault: the drive reacts to it until [`fault_reaction_done`](Self::fault_reaction_done).
    pub fn fault(&mut self) -> Option<Reaction> {
        let again = matches!(self.state, State::Fault | State::FaultReactionActive);
        (!again).then(|| self.enter(State::FaultReactionActive))
    }

    /// The reaction to a fault is over.
    pub fn fault_reaction_done(&mut self) -> Option<Reaction> {
        (self.state == State::FaultReactionActive).then(|| self.enter(State::Fault))
    }

    /// pp: the set-point has been taken over, another may come: bit 12 goes to 0 with bit 4 of the
    /// control word at 0.
    pub const fn set_point_taken(&mut self) {
        if !self.control.has(ControlWord::MODE_BIT_4) {
            self.set_flag(StatusWord::MODE_BIT_12, false);
        }
    }

    fn enter(&mut self, state: State) -> Reaction {
        self.state = state;
        if state != State::OperationEnabled {
            self.set_flag(StatusWord::MODE_BIT_12 | StatusWord::TARGET_REACHED, false);
        }
        Reaction::State(state)
    }

    fn follow(&mut self, command: Command, reset: bool) -> Option<Reaction> {
        use State::{
            FaultReactionActive, NotReadyToSwitchOn, OperationEnabled, QuickStopActive, ReadyToSwitchOn,
            SwitchOnDisabled, SwitchedOn,
        };
        let next = match (self.state, command) {
            (State::Fault, _) if reset => SwitchOnDisabled,
            (State::Fault | FaultReactionActive | NotReadyToSwitchOn, _) => return None,
            (SwitchOnDisabled | SwitchedOn | OperationEnabled, Command::Shutdown) => ReadyToSwitchOn,
            (ReadyToSwitchOn | OperationEnabled, Command::SwitchOn) => SwitchedOn,
            // CiA 402-2 allows 3 and 4 by one control word.
            (ReadyToSwitchOn | SwitchedOn, Command::EnableOperation) => OperationEnabled,
            (QuickStopActive, Command::EnableOperation) if self.hold_after_quick_stop => OperationEnabled,
            (OperationEnabled, Command::QuickStop) => {
                self.enter(QuickStopActive);
                return Some(Reaction::QuickStop);
            }
            (ReadyToSwitchOn | SwitchedOn, Command::QuickStop) => SwitchOnDisabled,
            (ReadyToSwitchOn | SwitchedOn | OperationEnabled | QuickStopActive, Command::DisableVoltage) => {
                SwitchOnDisabled
            }
            _ => return None,
        };
        Some(self.enter(next))
    }

    fn mode_bits(&mut self, word: ControlWord, rising: u16, falling: u16) -> Option<Reaction> {
        let started = rising & ControlWord::MODE_BIT_4 != 0 && self.state == State::OperationEnabled;
        let stopped = falling & ControlWord::MODE_BIT_4 != 0;
        match self.mode {
            Mode::PROFILE_POSITION if started && !self.status_word().has(StatusWord::MODE_BIT_12) => {
                self.set_flag(StatusWord::MODE_BIT_12, true);
                self.set_flag(StatusWord::TARGET_REACHED, false);
                Some(Reaction::SetPoint {
                    immediately: word.has(ControlWord::CHANGE_IMMEDIATELY),
                    relative: word.has(ControlWord::RELATIVE),
                })
            }
            Mode::PROFILE_POSITION if stopped => {
                self.set_point_taken();
                None
            }
            Mode::HOMING if started => {
                self.set_flag(
                    StatusWord::MODE_BIT_12 | StatusWord::MODE_BIT_13 | StatusWord::TARGET_REACHED,
                    false,
                );
                Some(Reaction::Homing)
            }
            Mode::HOMING if stopped => Some(Reaction::HomingStopped),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::TRANSITIONS;
    use super::*;

    fn in_state(state: State) -> Drive {
        let mut drive = Drive::new(false);
        drive.state = state;
        drive
    }

    #[test]
    fn every_transition_of_the_table() {
        for (number, from, to, command) in TRANSITIONS {
            let mut drive = in_state(from);
            drive.handle_control(ControlWord(command.bits()));
            assert_eq!(drive.state(), to, "transition {number}");
            assert_eq!(drive.status_word().state(), Some(to));
        }
    }

    #[test]
    fn a_fault_needs_an_edge() {
        let mut drive = Drive::new(false);
        drive.handle_control(ControlWord(ControlWord::FAULT_RESET));
        assert_eq!(drive.fault(), Some(Reaction::State(State::FaultReactionActive)));
        assert_eq!(drive.fault(), None);
        drive.fault_reaction_done();
        drive.handle_control(ControlWord(ControlWord::FAULT_RESET | 0x06));
        assert_eq!(drive.state(), State::Fault, "bit 7 was 1 all the time");
        drive.handle_control(ControlWord(0x06));
        assert_eq!(drive.state(), State::Fault);
        drive.handle_control(ControlWord(ControlWord::FAULT_RESET));
        assert_eq!(drive.state(), State::SwitchOnDisabled);
    }

    #[test]
    fn quick_stop_goes_on_or_holds() {
        for hold in [false, true] {
            let mut drive = Drive::new(hold);
            for word in [0x06, 0x07, 0x0F] {
                drive.handle_control(ControlWord(word));
            }
            assert_eq!(drive.handle_control(ControlWord(0x02))[0], Some(Reaction::QuickStop));
            drive.quick_stop_done();
            let expected = if hold { State::QuickStopActive } else { State::SwitchOnDisabled };
            assert_eq!(drive.state(), expected);
            drive.handle_control(ControlWord(0x0F));
            assert_eq!(drive.state() == State::OperationEnabled, hold);
        }
    }

    #[test]
    fn set_points_shake_hands() {
        let mut drive = in_state(State::OperationEnabled);
        drive.set_mode(Mode::PROFILE_POSITION);
        let taken = Reaction::SetPoint { immediately: true, relative: false };
        assert_eq!(drive.handle_control(ControlWord(0x3F)), [None, Some(taken)]);
        assert!(drive.status_word().has(StatusWord::MODE_BIT_12));
        assert_eq!(drive.handle_control(ControlWord(0x3F)), [None, None]);
        drive.handle_control(ControlWord(0x0F));
        assert!(!drive.status_word().has(StatusWord::MODE_BIT_12));
        assert_eq!(drive.handle_control(ControlWord(0x10F))[1], Some(Reaction::Halt(true)));
    }
}
