//! LD 2000 drive (SERVOSTAR 600 class), project-defined (decision 14): numbered PDOs that are selected
//! by writing their number, not mapped entry by entry.
//!
//! The defaults, RPDO 22 and TPDO 22, carry control word and speed to the drive and status word,
//! position and speed from it, one frame each. TPDO 33 has the position with the drive's own resolution.

use super::ds402::{CONTROL_WORD, STATUS_WORD};
use crate::mapping::Entry;
use crate::{DefaultPdo, Payload};

/// RPDO of the default layout.
pub const DEFAULT_RPDO: u8 = 22;
/// TPDO of the default layout.
pub const DEFAULT_TPDO: u8 = 22;

/// Position in TPDO 22: increments of a turn. 16 turns fit, then it begins anew.
pub const POSITION_PER_TURN: u32 = 1 << 20;

/// Set value of speed, INTEGER32; 3000 rpm are 419,430.
pub const SPEED_SET: Entry = Entry::new(0x2060, 0, 32);
/// Position, 24 bits, 2^20 a turn, modulo 16 turns.
pub const POSITION: Entry = Entry::new(0x2070, 1, 24);
/// Actual speed, 24 bits signed, 1875/262144 rpm a unit.
pub const SPEED: Entry = Entry::new(0x2070, 2, 24);
/// Incremental position, INTEGER32, in the resolution set at the drive.
pub const INCREMENTAL_POSITION: Entry = Entry::new(0x2070, 3, 32);
/// Manufacturer status in TPDO 33, UNSIGNED32.
pub const STATUS: Entry = Entry::new(0x2070, 0x11, 32);
/// Manufacturer status register, UNSIGNED32; bit 30: output stage enabled.
pub const STATUS_REGISTER: Entry = Entry::new(0x1002, 0, 32);

/// Object that selects the RPDO (UNSIGNED8) of a channel: 2600h…2603h.
#[must_use]
pub const fn rpdo_select(channel: DefaultPdo) -> u16 {
    0x2600 + channel.number() as u16 - 1
}

/// Object that selects the TPDO (UNSIGNED8) of a channel: 2A00h…2A03h.
#[must_use]
pub const fn tpdo_select(channel: DefaultPdo) -> u16 {
    0x2A00 + channel.number() as u16 - 1
}

/// What RPDO `number` carries; `None` where it is not made of objects or not known.
#[must_use]
pub const fn rpdo(number: u8) -> Option<&'static [Entry]> {
    match number {
        1 => Some(&[CONTROL_WORD]),
        22 => Some(&[CONTROL_WORD, SPEED_SET]),
        32 => Some(&[SPEED_SET]),
        _ => None,
    }
}

/// What TPDO `number` carries; `None` where it is not made of objects or not known.
#[must_use]
pub const fn tpdo(number: u8) -> Option<&'static [Entry]> {
    match number {
        1 => Some(&[STATUS_WORD]),
        22 => Some(&[STATUS_WORD, POSITION, SPEED]),
        23 => Some(&[STATUS_WORD, STATUS_REGISTER]),
        32 => Some(&[POSITION, SPEED]),
        33 => Some(&[INCREMENTAL_POSITION, STATUS]),
        _ => None,
    }
}

/// RPDO 22.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Command {
    /// 6040h.
    pub control_word: u16,
    /// 2060h, 1875/262144 rpm a unit.
    pub speed: i32,
}

impl Command {
    /// Bytes of the PDO.
    pub const LEN: u8 = 6;

    /// From a PDO; `None` if it is shorter than 6 bytes.
    #[must_use]
    pub const fn parse(payload: Payload) -> Option<Self> {
        if payload.len() < Self::LEN {
            return None;
        }
        let word = payload.word();
        Some(Self { control_word: word as u16, speed: (word >> 16) as i32 })
    }

    /// As a PDO.
    #[must_use]
    pub const fn encode(self) -> Payload {
        Payload::new(self.control_word as u64 | (self.speed as u32 as u64) << 16, Self::LEN)
    }
}

/// TPDO 22.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Feedback {
    /// 6041h.
    pub status_word: u16,
    /// 2070h:01, 24 bits, [`POSITION_PER_TURN`].
    pub position: u32,
    /// 2070h:02, 24 bits signed, 1875/262144 rpm a unit.
    pub speed: i32,
}

impl Feedback {
    /// Bytes of the PDO.
    pub const LEN: u8 = 8;

    /// From a PDO; `None` if it is shorter than 8 bytes.
    #[must_use]
    pub const fn parse(payload: Payload) -> Option<Self> {
        if payload.len() < Self::LEN {
            return None;
        }
        Some(Self {
            status_word: payload.word() as u16,
            position: payload.bits(16, 24).unsigned() as u32,
            speed: payload.bits(40, 24).signed() as i32,
        })
    }

    /// As a PDO; bits above the 24th of position and speed are cut off.
    #[must_use]
    pub const fn encode(self) -> Payload {
        let position = (self.position & 0xFF_FFFF) as u64;
        let speed = (self.speed as u32 & 0xFF_FFFF) as u64;
        Payload::new(self.status_word as u64 | position << 16 | speed << 40, Self::LEN)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Mapping;

    #[test]
    fn structs_and_mappings_agree() {
        let command = Command { control_word: 0x000F, speed: -419_430 };
        let mapping: Mapping = Mapping::new(rpdo(DEFAULT_RPDO).unwrap()).unwrap();
        assert_eq!(mapping.bytes(), Command::LEN);
        let packed = mapping.pack(|entry| if entry == CONTROL_WORD { 0x0F } else { -419_430i64 as u64 });
        assert_eq!(packed, command.encode());
        assert_eq!(Command::parse(packed), Some(command));
        assert_eq!(packed.bytes()[..6], [0x0F, 0x00, 0x9A, 0x99, 0xF9, 0xFF]);

        let feedback = Feedback { status_word: 0x0237, position: 0xFE_DCBA, speed: -2 };
        let mapping: Mapping = Mapping::new(tpdo(DEFAULT_TPDO).unwrap()).unwrap();
        assert_eq!(mapping.bytes(), Feedback::LEN);
        let packed = mapping.pack(|entry| match entry {
            STATUS_WORD => 0x0237,
            POSITION => 0xFE_DCBA,
            _ => -2i64 as u64,
        });
        assert_eq!((packed, Feedback::parse(packed)), (feedback.encode(), Some(feedback)));
    }

    #[test]
    fn every_layout_is_a_mapping() {
        for number in 0..=255 {
            let layouts = [
                rpdo(number),
                tpdo(number),
                super::super::ds402::rpdo(number),
                super::super::ds402::tpdo(number),
            ];
            for layout in layouts.into_iter().flatten() {
                assert!(Mapping::<8>::new(layout).is_ok(), "{layout:?}");
            }
        }
        use super::super::ds401;
        assert_eq!(Mapping::<8>::new(&ds401::DIGITAL_INPUTS).unwrap().bits(), 64);
        assert_eq!(Mapping::<8>::new(&ds401::analogue_outputs(1)).unwrap().bits(), 64);
        assert_eq!((rpdo_select(DefaultPdo::First), tpdo_select(DefaultPdo::Fourth)), (0x2600, 0x2A03));
    }
}
