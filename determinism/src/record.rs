//! What a recording is made of.

use motion_core::io::{DigitalInputs, Inputs};
use serde::{Deserialize, Serialize};

/// Something that reached the controller.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record<'a> {
    /// Since it was switched on, µs.
    pub micros: u32,
    /// What it is.
    #[serde(borrow)]
    pub what: What<'a>,
}

/// What reached the controller.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum What<'a> {
    /// Bytes on COM 1 (0) or COM 2 (1).
    Serial {
        /// The port.
        port: u8,
        /// The bytes.
        bytes: &'a [u8],
    },
    /// A data frame on CAN 1 (0) or CAN 2 (1).
    Frame {
        /// The bus.
        bus: u8,
        /// Its identifier, 11 bits.
        id: u16,
        /// Its data.
        data: &'a [u8],
    },
    /// A control cycle with these terminals. Absent: as in the cycle before.
    Cycle {
        /// I1…I4.
        digital: Option<[u8; 4]>,
        /// I61, I62, I63, I54…I57.
        analog: Option<[u16; 7]>,
        /// E1…E3.
        encoders: [Option<Encoder>; 3],
    },
}

/// An encoder's terminals, as `motion_core::input::Encoder` has them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "those of the original")]
pub struct Encoder {
    pub count: i32,
    pub reference: bool,
    pub risen: Option<i32>,
    pub fallen: Option<i32>,
    pub fault: bool,
}

impl From<motion_core::input::Encoder> for Encoder {
    fn from(from: motion_core::input::Encoder) -> Self {
        let motion_core::input::Encoder { count, reference, risen, fallen, fault } = from;
        Self { count, reference, risen, fallen, fault }
    }
}

impl From<Encoder> for motion_core::input::Encoder {
    fn from(from: Encoder) -> Self {
        let Encoder { count, reference, risen, fallen, fault } = from;
        Self { count, reference, risen, fallen, fault }
    }
}

impl What<'_> {
    /// A cycle in which the terminals became `now` from `before`.
    #[must_use]
    pub fn cycle(before: &Inputs, now: &Inputs) -> Self {
        let mut encoders = [None; 3];
        for ((slot, before), now) in encoders.iter_mut().zip(before.encoders).zip(now.encoders) {
            *slot = (before != now).then(|| now.into());
        }
        Self::Cycle {
            digital: (before.digital != now.digital).then(|| now.digital.blocks()),
            analog: (before.analog != now.analog).then_some(now.analog),
            encoders,
        }
    }

    /// Puts on the terminals what has changed; other records change nothing.
    pub fn apply(&self, inputs: &mut Inputs) {
        let Self::Cycle { digital, analog, encoders } = *self else { return };
        if let Some(blocks) = digital {
            inputs.digital = DigitalInputs::new(blocks);
        }
        if let Some(analog) = analog {
            inputs.analog = analog;
        }
        for (slot, encoder) in inputs.encoders.iter_mut().zip(encoders) {
            if let Some(encoder) = encoder {
                *slot = encoder.into();
            }
        }
    }
}

/// The records of a recording, in order; damage is the last one.
pub fn records(mut bytes: &[u8]) -> impl Iterator<Item = Result<Record<'_>, postcard::Error>> {
    core::iter::from_fn(move || {
        if bytes.is_empty() {
            return None;
        }
        Some(match postcard::take_from_bytes(bytes) {
            Ok((record, rest)) => {
                bytes = rest;
                Ok(record)
            }
            Err(error) => {
                bytes = &[];
                Err(error)
            }
        })
    })
}

#[cfg(feature = "record")]
impl Record<'_> {
    /// Appends the record to a recording.
    ///
    /// # Errors
    /// None with a heap that has room.
    pub fn append(&self, recording: &mut alloc::vec::Vec<u8>) -> Result<(), postcard::Error> {
        recording.extend(postcard::to_allocvec(self)?);
        Ok(())
    }
}
