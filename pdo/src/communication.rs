//! The communication parameters of a PDO.

use crate::{CobId, Transmission};

/// Communication parameters in the units of the objects 1400h and 1800h (CiA 301, 7.5.2.35 and
/// 7.5.2.37).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Communication {
    /// Sub-index 01h. A PDO that is not valid, or has 29 bits, does not exist.
    pub cob_id: CobId,
    /// Sub-index 02h.
    pub transmission: Transmission,
    /// Sub-index 03h of a TPDO, 100 µs: shortest time between two event-driven PDOs.
    pub inhibit: u16,
    /// Sub-index 05h, 1 ms, 0: any. Of a TPDO the longest time between two event-driven PDOs; of an RPDO
    /// the longest time until the next one, after which it is missed.
    pub event_timer: u16,
    /// Sub-index 06h of a TPDO: the SYNC with this counter is the first; 0: any.
    pub sync_start: u8,
}

impl Communication {
    /// Of a PDO that does not exist.
    pub const OFF: Self = Self::event_driven(CobId(CobId::INVALID));

    /// Event-driven, by the device profile, with this COB-ID.
    #[must_use]
    pub const fn event_driven(cob_id: CobId) -> Self {
        Self { cob_id, transmission: Transmission::EventProfile, inhibit: 0, event_timer: 0, sync_start: 0 }
    }

    /// Its identifier, if it exists.
    pub(crate) const fn id(&self) -> Option<u16> {
        if self.cob_id.is_valid() { self.cob_id.standard_id() } else { None }
    }
}
