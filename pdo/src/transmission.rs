//! Transmission types (CiA 301, 7.5.2.35 and 7.5.2.37, sub-index 02h).

/// When a PDO is sent, or when what was received takes effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Transmission {
    /// 0: a TPDO at the SYNC after an event; an RPDO takes effect at the next SYNC.
    SyncAcyclic,
    /// 1…240: a TPDO at every so-manieth SYNC; an RPDO takes effect at the next SYNC.
    SyncCyclic(u8),
    /// 252: sampled at SYNC, sent when asked for by a remote frame. TPDO only.
    RtrSync,
    /// 253: sampled and sent when asked for by a remote frame. TPDO only.
    RtrEvent,
    /// 254: by events that the manufacturer defines; an RPDO takes effect at once.
    EventManufacturer,
    /// 255: by events that the device profile defines; an RPDO takes effect at once.
    EventProfile,
}

/// A number that is reserved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("transmission type {0} is reserved, 0 to 240 and 252 to 255 exist")]
pub struct TransmissionError(pub u8);

impl Transmission {
    /// From the value of sub-index 02h.
    ///
    /// # Errors
    /// [`TransmissionError`] for 241…251.
    pub const fn new(raw: u8) -> Result<Self, TransmissionError> {
        Ok(match raw {
            0 => Self::SyncAcyclic,
            1..=240 => Self::SyncCyclic(raw),
            252 => Self::RtrSync,
            253 => Self::RtrEvent,
            254 => Self::EventManufacturer,
            255 => Self::EventProfile,
            _ => return Err(TransmissionError(raw)),
        })
    }

    /// The value of sub-index 02h. A cycle outside 1…240 becomes the nearest of them.
    #[must_use]
    pub const fn raw(self) -> u8 {
        match self {
            Self::SyncAcyclic => 0,
            Self::SyncCyclic(0) => 1,
            Self::SyncCyclic(cycle @ 1..=240) => cycle,
            Self::SyncCyclic(_) => 240,
            Self::RtrSync => 252,
            Self::RtrEvent => 253,
            Self::EventManufacturer => 254,
            Self::EventProfile => 255,
        }
    }

    /// Whether an RPDO waits for the next SYNC.
    #[must_use]
    #[inline]
    pub const fn is_synchronous(self) -> bool {
        matches!(self, Self::SyncAcyclic | Self::SyncCyclic(_))
    }

    /// Whether events send a TPDO at once.
    #[must_use]
    #[inline]
    pub const fn is_event_driven(self) -> bool {
        matches!(self, Self::EventManufacturer | Self::EventProfile)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number() {
        for raw in 0..=255 {
            match Transmission::new(raw) {
                Ok(transmission) => assert_eq!(transmission.raw(), raw),
                Err(error) => assert!(error == TransmissionError(raw) && (241..=251).contains(&raw)),
            }
        }
    }
}
