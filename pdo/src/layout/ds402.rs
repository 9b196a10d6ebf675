//! Drives (CiA 402-3, default PDOs).

use crate::mapping::Entry;

/// Control word.
pub const CONTROL_WORD: Entry = Entry::new(0x6040, 0, 16);
/// Status word.
pub const STATUS_WORD: Entry = Entry::new(0x6041, 0, 16);
/// Mode of operation wanted, INTEGER8.
pub const MODE: Entry = Entry::new(0x6060, 0, 8);
/// Mode of operation in effect, INTEGER8.
pub const MODE_DISPLAY: Entry = Entry::new(0x6061, 0, 8);
/// Actual position, INTEGER32, position units.
pub const POSITION_ACTUAL: Entry = Entry::new(0x6064, 0, 32);
/// Actual velocity, INTEGER32, velocity units.
pub const VELOCITY_ACTUAL: Entry = Entry::new(0x606C, 0, 32);
/// Target torque, INTEGER16, 1/1000 of the rated torque.
pub const TARGET_TORQUE: Entry = Entry::new(0x6071, 0, 16);
/// Actual torque, INTEGER16, 1/1000 of the rated torque.
pub const TORQUE_ACTUAL: Entry = Entry::new(0x6077, 0, 16);
/// Target position, INTEGER32, position units.
pub const TARGET_POSITION: Entry = Entry::new(0x607A, 0, 32);
/// Target velocity, INTEGER32, velocity units.
pub const TARGET_VELOCITY: Entry = Entry::new(0x60FF, 0, 32);

/// The default mapping of RPDO `number`; `None` where the profile has none here.
#[must_use]
pub const fn rpdo(number: u8) -> Option<&'static [Entry]> {
    match number {
        1 => Some(&[CONTROL_WORD]),
        2 => Some(&[CONTROL_WORD, MODE]),
        3 => Some(&[CONTROL_WORD, TARGET_POSITION]),
        4 => Some(&[CONTROL_WORD, TARGET_VELOCITY]),
        5 => Some(&[CONTROL_WORD, TARGET_TORQUE]),
        _ => None,
    }
}

/// The default mapping of TPDO `number`; `None` where the profile has none here.
#[must_use]
pub const fn tpdo(number: u8) -> Option<&'static [Entry]> {
    match number {
        1 => Some(&[STATUS_WORD]),
        2 => Some(&[STATUS_WORD, MODE_DISPLAY]),
        3 => Some(&[STATUS_WORD, POSITION_ACTUAL]),
        4 => Some(&[STATUS_WORD, VELOCITY_ACTUAL]),
        5 => Some(&[STATUS_WORD, TORQUE_ACTUAL]),
        _ => None,
    }
}
