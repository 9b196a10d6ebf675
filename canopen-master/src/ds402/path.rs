//! Which commands lead from state to state (CiA 402-2, figure 10).

use super::{Command, State};

/// The transitions that a control word causes: number in CiA 402, from, to, command.
pub const TRANSITIONS: [(u8, State, State, Command); 12] = [
    (2, State::SwitchOnDisabled, State::ReadyToSwitchOn, Command::Shutdown),
    (3, State::ReadyToSwitchOn, State::SwitchedOn, Command::SwitchOn),
    (4, State::SwitchedOn, State::OperationEnabled, Command::EnableOperation),
    (5, State::OperationEnabled, State::SwitchedOn, Command::SwitchOn),
    (6, State::SwitchedOn, State::ReadyToSwitchOn, Command::Shutdown),
    (7, State::ReadyToSwitchOn, State::SwitchOnDisabled, Command::DisableVoltage),
    (8, State::OperationEnabled, State::ReadyToSwitchOn, Command::Shutdown),
    (9, State::OperationEnabled, State::SwitchOnDisabled, Command::DisableVoltage),
    (10, State::SwitchedOn, State::SwitchOnDisabled, Command::DisableVoltage),
    (11, State::OperationEnabled, State::QuickStopActive, Command::QuickStop),
    (12, State::QuickStopActive, State::SwitchOnDisabled, Command::DisableVoltage),
    (15, State::Fault, State::SwitchOnDisabled, Command::FaultReset),
];

/// Transition 16: quick stop active back to operation enabled, which a drive allows where 605Ah is
/// 5…8.
const RESUME: (u8, State, State, Command) =
    (16, State::QuickStopActive, State::OperationEnabled, Command::EnableOperation);

/// How many commands lead from a state to another, at least; `None` where none do, as out of the
/// states that a drive leaves by itself. `resume`: transition 16 may be used.
#[must_use]
pub fn steps(from: State, to: State, resume: bool) -> Option<u8> {
    // From the goal backwards, one transition at a time.
    let mut distance = [None; State::ALL.len()];
    *distance.get_mut(to as usize)? = Some(0);
    for step in 0..State::ALL.len() as u8 {
        for (_, before, after, _) in transitions(resume) {
            if distance.get(after as usize).copied().flatten() == Some(step)
                && let Some(slot @ None) = distance.get_mut(before as usize)
            {
                *slot = Some(step + 1);
            }
        }
    }
    distance.get(from as usize).copied().flatten()
}

/// The next command on a shortest way; `None` where there is none, or nothing to do.
#[must_use]
pub fn next_command(from: State, to: State, resume: bool) -> Option<Command> {
    let ahead = steps(from, to, resume)?.checked_sub(1)?;
    transitions(resume)
        .find(|(_, before, after, _)| *before == from && steps(*after, to, resume) == Some(ahead))
        .map(|(.., command)| command)
}

fn transitions(resume: bool) -> impl Iterator<Item = (u8, State, State, Command)> {
    TRANSITIONS.into_iter().chain(resume.then_some(RESUME))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_ways() {
        use Command::*;
        use State::*;
        for (from, to, resume, command, count) in [
            (SwitchOnDisabled, OperationEnabled, false, Shutdown, 3),
            (ReadyToSwitchOn, OperationEnabled, false, SwitchOn, 2),
            (SwitchedOn, OperationEnabled, false, EnableOperation, 1),
            (OperationEnabled, ReadyToSwitchOn, false, Shutdown, 1),
            (OperationEnabled, SwitchOnDisabled, false, DisableVoltage, 1),
            (OperationEnabled, SwitchedOn, false, SwitchOn, 1),
            (QuickStopActive, OperationEnabled, false, DisableVoltage, 4),
            (QuickStopActive, OperationEnabled, true, EnableOperation, 1),
            (Fault, OperationEnabled, false, FaultReset, 4),
            (SwitchOnDisabled, QuickStopActive, false, Shutdown, 4),
        ] {
            assert_eq!(next_command(from, to, resume), Some(command), "{from} to {to}");
            assert_eq!(steps(from, to, resume), Some(count));
        }
        assert_eq!(next_command(FaultReactionActive, OperationEnabled, true), None);
        assert_eq!(next_command(OperationEnabled, Fault, true), None, "nobody commands a fault");
        assert_eq!(next_command(SwitchedOn, SwitchedOn, true), None);
    }

    #[test]
    fn every_way_arrives_in_as_many_steps_as_said() {
        for from in State::ALL {
            for to in State::ALL {
                let Some(count) = steps(from, to, true) else { continue };
                let mut state = from;
                for _ in 0..count {
                    let command = next_command(state, to, true).unwrap();
                    state = transitions(true)
                        .find(|(_, before, _, with)| (*before, *with) == (state, command))
                        .map(|(_, _, after, _)| after)
                        .unwrap();
                }
                assert_eq!(state, to);
            }
        }
    }
}
