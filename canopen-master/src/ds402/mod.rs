//! CiA 402, drives: control word, status word, states, modes; [`Axis`] is the master's side of one
//! drive, [`Drive`] the device's side.

mod axis;
mod drive;
mod path;

pub use axis::{Axis, Config, Event, Goal, Outcome, SubmitError, Ticket};
pub use drive::{Drive, Reaction};
pub use path::{TRANSITIONS, next_command, steps};

use core::fmt;

/// Object of the control word, UNSIGNED16.
pub const CONTROL_WORD: u16 = 0x6040;
/// Object of the status word, UNSIGNED16.
pub const STATUS_WORD: u16 = 0x6041;
/// Object of the wanted mode, INTEGER8.
pub const MODE: u16 = 0x6060;
/// Object of the mode that the drive is in, INTEGER8.
pub const MODE_DISPLAY: u16 = 0x6061;

/// State of a drive (CiA 402-2, 7.4).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum State {
    /// Starting up.
    NotReadyToSwitchOn,
    /// Ready, but no high voltage may be switched on.
    SwitchOnDisabled,
    /// High voltage may be switched on.
    ReadyToSwitchOn,
    /// High voltage is on, no torque.
    SwitchedOn,
    /// The drive follows its set values.
    OperationEnabled,
    /// Stopping, or stopped and held, after a quick stop.
    QuickStopActive,
    /// Reacting to a fault.
    FaultReactionActive,
    /// A fault; waits for its reset.
    Fault,
}

impl State {
    /// All states.
    pub const ALL: [Self; 8] = [
        Self::NotReadyToSwitchOn,
        Self::SwitchOnDisabled,
        Self::ReadyToSwitchOn,
        Self::SwitchedOn,
        Self::OperationEnabled,
        Self::QuickStopActive,
        Self::FaultReactionActive,
        Self::Fault,
    ];

    /// Bits 0…3, 5 and 6 of the status word in this state.
    #[must_use]
    pub const fn bits(self) -> u16 {
        match self {
            Self::NotReadyToSwitchOn => 0x00,
            Self::SwitchOnDisabled => 0x40,
            Self::ReadyToSwitchOn => 0x21,
            Self::SwitchedOn => 0x23,
            Self::OperationEnabled => 0x27,
            Self::QuickStopActive => 0x07,
            Self::FaultReactionActive => 0x0F,
            Self::Fault => 0x08,
        }
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotReadyToSwitchOn => "not ready to switch on",
            Self::SwitchOnDisabled => "switch on disabled",
            Self::ReadyToSwitchOn => "ready to switch on",
            Self::SwitchedOn => "switched on",
            Self::OperationEnabled => "operation enabled",
            Self::QuickStopActive => "quick stop active",
            Self::FaultReactionActive => "fault reaction active",
            Self::Fault => "fault",
        })
    }
}

/// The status word (6041h).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct StatusWord(pub u16);

impl StatusWord {
    /// Bit 4: high voltage is there.
    pub const VOLTAGE_ENABLED: u16 = 1 << 4;
    /// Bit 7: a warning; the state does not change.
    pub const WARNING: u16 = 1 << 7;
    /// Bit 9: the control word is processed.
    pub const REMOTE: u16 = 1 << 9;
    /// Bit 10: the target is reached; with halt, the drive stands.
    pub const TARGET_REACHED: u16 = 1 << 10;
    /// Bit 11: an internal limit is active.
    pub const INTERNAL_LIMIT: u16 = 1 << 11;
    /// Bit 12 by mode: pp set-point acknowledge, pv speed is 0, hm homing attained, csp, csv and cst
    /// drive follows the command value.
    pub const MODE_BIT_12: u16 = 1 << 12;
    /// Bit 13 by mode: pp and csp following error, pv maximum slippage, hm homing error.
    pub const MODE_BIT_13: u16 = 1 << 13;

    /// The state (CiA 402-2, table 30); `None` for a combination of bits that is none.
    #[must_use]
    pub const fn state(self) -> Option<State> {
        // In the two groups bit 5, quick stop, does not count.
        match self.0 & 0x4F {
            0x00 => return Some(State::NotReadyToSwitchOn),
            0x40 => return Some(State::SwitchOnDisabled),
            0x0F => return Some(State::FaultReactionActive),
            0x08 => return Some(State::Fault),
            _ => {}
        }
        match self.0 & 0x6F {
            0x21 => Some(State::ReadyToSwitchOn),
            0x23 => Some(State::SwitchedOn),
            0x27 => Some(State::OperationEnabled),
            0x07 => Some(State::QuickStopActive),
            _ => None,
        }
    }

    /// Whether all bits of a mask are set.
    #[must_use]
    pub const fn has(self, mask: u16) -> bool {
        self.0 & mask == mask
    }
}

impl fmt::Debug for StatusWord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "StatusWord({:04X}h)", self.0)
    }
}

/// The control word (6040h).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct ControlWord(pub u16);

impl ControlWord {
    /// Bit 4 by mode: pp new set-point, hm start homing.
    pub const MODE_BIT_4: u16 = 1 << 4;
    /// Bit 5, pp: go to the new set-point at once, not after the current one.
    pub const CHANGE_IMMEDIATELY: u16 = 1 << 5;
    /// Bit 6, pp: the set-point is a distance.
    pub const RELATIVE: u16 = 1 << 6;
    /// Bit 7: resets a fault when it goes from 0 to 1.
    pub const FAULT_RESET: u16 = 1 << 7;
    /// Bit 8: stop and hold.
    pub const HALT: u16 = 1 << 8;

    /// The command in bits 0…3 (CiA 402-2, table 29), the fault reset apart.
    #[must_use]
    pub const fn command(self) -> Command {
        match self.0 & 0x0F {
            bits if bits & 0b0010 == 0 => Command::DisableVoltage,
            bits if bits & 0b0100 == 0 => Command::QuickStop,
            bits if bits & 0b0001 == 0 => Command::Shutdown,
            bits if bits & 0b1000 == 0 => Command::SwitchOn,
            _ => Command::EnableOperation,
        }
    }

    /// Whether all bits of a mask are set.
    #[must_use]
    pub const fn has(self, mask: u16) -> bool {
        self.0 & mask == mask
    }
}

impl fmt::Debug for ControlWord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ControlWord({:04X}h)", self.0)
    }
}

/// What a control word asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Command {
    /// 06h: to ready to switch on.
    Shutdown,
    /// 07h: to switched on; in operation enabled, disable operation.
    SwitchOn,
    /// 0Fh: to operation enabled.
    EnableOperation,
    /// 00h: to switch on disabled.
    DisableVoltage,
    /// 02h: stop as object 605Ah says.
    QuickStop,
    /// 80h after 00h: leave fault.
    FaultReset,
}

impl Command {
    /// Bits 0…3 and 7 of the control word.
    #[must_use]
    pub const fn bits(self) -> u16 {
        match self {
            Self::Shutdown => 0x06,
            Self::SwitchOn => 0x07,
            Self::EnableOperation => 0x0F,
            Self::DisableVoltage => 0x00,
            Self::QuickStop => 0x02,
            Self::FaultReset => ControlWord::FAULT_RESET,
        }
    }
}

/// A mode of operation (6060h, 6061h). Negative ones are the manufacturer's, so any value is one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Mode(pub i8);

macro_rules! modes {
    ($($(#[$doc:meta])* $name:ident = $value:literal, $bit:expr, $text:literal;)*) => {
        impl Mode {
            $($(#[$doc])* pub const $name: Self = Self($value);)*

            /// Its abbreviation in CiA 402.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self.0 {
                    $($value => $text,)*
                    ..0 => "manufacturer specific",
                    _ => "reserved",
                }
            }

            /// Its bit in 6502h, supported drive modes; `None` for one that has none.
            #[must_use]
            pub const fn supported_bit(self) -> Option<u8> {
                match self.0 {
                    $($value => $bit,)*
                    _ => None,
                }
            }
        }
    };
}

modes! {
    /// No mode.
    NONE = 0, None, "no mode";
    /// Profile position.
    PROFILE_POSITION = 1, Some(0), "pp";
    /// Velocity (frequency converters).
    VELOCITY = 2, Some(1), "vl";
    /// Profile velocity.
    PROFILE_VELOCITY = 3, Some(2), "pv";
    /// Profile torque.
    PROFILE_TORQUE = 4, Some(3), "tq";
    /// Homing.
    HOMING = 6, Some(5), "hm";
    /// Interpolated position.
    INTERPOLATED_POSITION = 7, Some(6), "ip";
    /// Cyclic synchronous position.
    CYCLIC_POSITION = 8, Some(7), "csp";
    /// Cyclic synchronous velocity.
    CYCLIC_VELOCITY = 9, Some(8), "csv";
    /// Cyclic synchronous torque.
    CYCLIC_TORQUE = 10, Some(9), "cst";
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CiA 402-2, table 30.
    #[test]
    fn status_words() {
        for state in State::ALL {
            assert_eq!(StatusWord(state.bits()).state(), Some(state));
            let ignored = 0xFF90;
            assert_eq!(StatusWord(state.bits() | ignored).state(), Some(state), "other bits do not count");
        }
        assert_eq!(StatusWord(0x28).state(), Some(State::Fault), "bit 5 does not count");
        assert_eq!(StatusWord(0x60).state(), Some(State::SwitchOnDisabled));
        assert_eq!((StatusWord(0x01).state(), StatusWord(0x25).state()), (None, None));
    }

    /// CiA 402-2, table 29.
    #[test]
    fn control_words() {
        for (word, command) in [
            (0x06, Command::Shutdown),
            (0x0E, Command::Shutdown),
            (0x07, Command::SwitchOn),
            (0x0F, Command::EnableOperation),
            (0x00, Command::DisableVoltage),
            (0x0D, Command::DisableVoltage),
            (0x02, Command::QuickStop),
            (0x0B, Command::QuickStop),
        ] {
            assert_eq!(ControlWord(word).command(), command, "{word:02X}");
        }
        assert_eq!(
            (Mode::CYCLIC_VELOCITY.name(), Mode(-2).name(), Mode(5).name()),
            ("csv", "manufacturer specific", "reserved")
        );
    }
}
