//! I/O modules (CiA 401, default PDOs): PDO 1 digital, PDO 2…4 analogue.

use crate::DefaultPdo;
use crate::mapping::Entry;

/// Digital inputs, 8 bits each: 6000h:01…08.
pub const DIGITAL_INPUTS: [Entry; 8] = eight(0x6000);
/// Digital outputs, 8 bits each: 6200h:01…08.
pub const DIGITAL_OUTPUTS: [Entry; 8] = eight(0x6200);

/// Four analogue inputs of 16 bits from number `first` on: 6401h.
#[must_use]
pub const fn analogue_inputs(first: u8) -> [Entry; 4] {
    four(0x6401, first)
}

/// Four analogue outputs of 16 bits from number `first` on: 6411h.
#[must_use]
pub const fn analogue_outputs(first: u8) -> [Entry; 4] {
    four(0x6411, first)
}

const fn eight(index: u16) -> [Entry; 8] {
    [
        Entry::new(index, 1, 8),
        Entry::new(index, 2, 8),
        Entry::new(index, 3, 8),
        Entry::new(index, 4, 8),
        Entry::new(index, 5, 8),
        Entry::new(index, 6, 8),
        Entry::new(index, 7, 8),
        Entry::new(index, 8, 8),
    ]
}

const fn four(index: u16, first: u8) -> [Entry; 4] {
    [
        Entry::new(index, first, 16),
        Entry::new(index, first.saturating_add(1), 16),
        Entry::new(index, first.saturating_add(2), 16),
        Entry::new(index, first.saturating_add(3), 16),
    ]
}

/// First analogue channel of PDO 2, 3 and 4; PDO 1 is digital.
#[must_use]
pub const fn first_analogue(pdo: DefaultPdo) -> Option<u8> {
    match pdo {
        DefaultPdo::First => None,
        DefaultPdo::Second => Some(1),
        DefaultPdo::Third => Some(5),
        DefaultPdo::Fourth => Some(9),
    }
}
