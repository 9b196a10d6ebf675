//! Curves: info block, object type, units (manual B 5); setpoints of a motion profile or from points.

mod setpoints;

use core::fmt;

pub use setpoints::{Profile, resample, rounded};

/// Curve IDs that a drive knows (manual B 5.2.6).
pub const IDS: core::ops::RangeInclusive<u16> = 1..=100;
/// Size of the info block in bytes, which is also the data offset (manual B 5.2.1).
pub const INFO_SIZE: u16 = 70;
/// 32-bit words that carry the info block: 70 bytes and 2 of padding.
pub const INFO_WORDS: usize = 18;
/// Size of one setpoint in bytes (manual B 5.2.4).
pub const SETPOINT_SIZE: u16 = 4;
/// Greatest number of setpoints: the size of the data block must fit into 16 bits.
pub const MAX_SETPOINTS: u16 = u16::MAX / SETPOINT_SIZE;

/// Object type, four nibbles (manual B 5.2.2).
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct ObjectType(pub u16);

impl ObjectType {
    /// Position over time.
    pub const POSITION_TIME: Self = Self(0x0003);
    /// Cam profile: position over encoder position.
    pub const POSITION_ENCODER: Self = Self(0x0103);

    /// Lowest nibble: object version, must be 3.
    #[must_use]
    pub const fn version(self) -> u8 {
        (self.0 & 0xF) as u8
    }

    /// Lower middle nibble: type of object, 0 = curve.
    #[must_use]
    pub const fn object(self) -> u8 {
        (self.0 >> 4 & 0xF) as u8
    }

    /// Higher middle nibble: 0 time, 1 encoder position, 2 position.
    #[must_use]
    pub const fn x_code(self) -> u8 {
        (self.0 >> 8 & 0xF) as u8
    }

    /// Highest nibble: 0 position, 1 velocity, 2 current, 3 encoder position, 4 encoder speed,
    /// 5 microsteps.
    #[must_use]
    pub const fn y_code(self) -> u8 {
        (self.0 >> 12) as u8
    }
}

impl fmt::Debug for ObjectType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ObjectType({:04X}h)", self.0)
    }
}

/// Unique unit ID (manual B, table 8).
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Unit(pub u16);

impl Unit {
    /// 0005h: 0.1 µm.
    pub const POSITION: Self = Self(0x0005);
    /// 001Ah: 10 µs.
    pub const TIME: Self = Self(0x001A);
    /// 001Bh: encoder increments.
    pub const ENCODER: Self = Self(0x001B);

    /// Unit and scaling; `None` for an ID that manual B does not name.
    #[must_use]
    pub const fn text(self) -> Option<&'static str> {
        match self {
            Self::POSITION => Some("0.1 um"),
            Self::TIME => Some("0.01 ms"),
            Self::ENCODER => Some("increments"),
            _ => None,
        }
    }
}

impl fmt::Debug for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Unit({:04X}h: {})", self.0, self.text().unwrap_or("unknown"))
    }
}

/// The header of a curve (manual B, table 6).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InfoBlock {
    /// Bytes 0…1: 70.
    pub data_offset: u16,
    /// Bytes 2…3.
    pub object_type: ObjectType,
    /// Bytes 4…5: number of setpoints, at least 2.
    pub setpoints: u16,
    /// Bytes 6…7: bytes of one setpoint, 4.
    pub setpoint_size: u16,
    /// Bytes 8…29: name, ended by 00h.
    pub name: [u8; 22],
    /// Bytes 30…31: 1…100.
    pub id: u16,
    /// Bytes 32…35: 10 µs, or encoder increments.
    pub x_length: u32,
    /// Bytes 36…37.
    pub x_unit: Unit,
    /// Bytes 38…39.
    pub y_unit: Unit,
    /// Bytes 40…41: of the manufacturer's tool, else 0.
    pub wizard_type: u16,
    /// Bytes 42…69: of the manufacturer's tool, else 0.
    pub wizard: [u32; 7],
}

/// Why a curve cannot be downloaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CurveError {
    /// Bytes 0…1.
    #[error("data offset {0}, 70 expected")]
    DataOffset(u16),
    /// Version or type of object, or a pair of dimensions that drives do not support.
    #[error("object type {:04X}h, 0003h (position over time) or 0103h (cam) expected", .0.0)]
    ObjectType(ObjectType),
    /// Too few, or more than the size of a data block can say.
    #[error("{0} setpoints, 2 to 16383 expected")]
    Setpoints(usize),
    /// Bytes 6…7.
    #[error("setpoints of {0} bytes, 4 expected")]
    SetpointSize(u16),
    /// Bytes 30…31.
    #[error("curve ID {0}, 1 to 100 expected")]
    Id(u16),
    /// The units do not belong to the object type.
    #[error("units {:04X}h and {:04X}h do not belong to object type {:04X}h", .x.0, .y.0, .object_type.0)]
    Units {
        /// Found.
        x: Unit,
        /// Found.
        y: Unit,
        /// Which says what they should be.
        object_type: ObjectType,
    },
    /// Bytes 32…35.
    #[error("x length 0")]
    Length,
    /// The info block says another number of setpoints than there are.
    #[error("the info block says {said} setpoints, {found} are there")]
    Count {
        /// In the info block.
        said: u16,
        /// In the data block.
        found: usize,
    },
    /// 22 bytes of which the last is 00h.
    #[error("name of {0} bytes, up to 21 expected")]
    Name(usize),
}

impl InfoBlock {
    /// A curve of position over time: `length` in 10 µs, setpoints in 0.1 µm.
    ///
    /// # Errors
    /// What [`check`](Self::check) finds, and a name that is too long.
    pub fn position_over_time(id: u16, name: &str, length: u32, setpoints: u16) -> Result<Self, CurveError> {
        Self::new(id, name, length, setpoints, ObjectType::POSITION_TIME, Unit::TIME)
    }

    /// A cam: position over encoder position, `length` in increments, setpoints in 0.1 µm.
    ///
    /// # Errors
    /// What [`check`](Self::check) finds, and a name that is too long.
    pub fn cam(id: u16, name: &str, length: u32, setpoints: u16) -> Result<Self, CurveError> {
        Self::new(id, name, length, setpoints, ObjectType::POSITION_ENCODER, Unit::ENCODER)
    }

    fn new(
        id: u16,
        name: &str,
        x_length: u32,
        setpoints: u16,
        object_type: ObjectType,
        x_unit: Unit,
    ) -> Result<Self, CurveError> {
        let mut bytes = [0; 22];
        match bytes.get_mut(..name.len()) {
            Some(room) if name.len() < 22 => room.copy_from_slice(name.as_bytes()),
            _ => return Err(CurveError::Name(name.len())),
        }
        let info = Self {
            data_offset: INFO_SIZE,
            object_type,
            setpoints,
            setpoint_size: SETPOINT_SIZE,
            name: bytes,
            id,
            x_length,
            x_unit,
            y_unit: Unit::POSITION,
            wizard_type: 0,
            wizard: [0; 7],
        };
        info.check().map(|()| info)
    }

    /// The name up to its end, whatever its characters.
    #[must_use]
    pub fn name(&self) -> &[u8] {
        self.name.split(|byte| *byte == 0).next().unwrap_or(&[])
    }

    /// Size of the data block in bytes.
    #[must_use]
    pub const fn data_size(&self) -> u32 {
        self.setpoints as u32 * self.setpoint_size as u32
    }

    /// X of the setpoint with this number, exact as a fraction rounded down; the setpoints are
    /// equally spaced (manual B 5.3).
    #[must_use]
    pub fn x(&self, setpoint: u16) -> u32 {
        let intervals = u64::from(self.setpoints).saturating_sub(1).max(1);
        u32::try_from(u64::from(self.x_length) * u64::from(setpoint) / intervals).unwrap_or(u32::MAX)
    }

    /// Whether a drive would take it.
    ///
    /// # Errors
    /// The first rule of manual B 5.2 that it breaks.
    pub fn check(&self) -> Result<(), CurveError> {
        let units = match self.object_type {
            ObjectType::POSITION_TIME => Unit::TIME,
            ObjectType::POSITION_ENCODER => Unit::ENCODER,
            other => return Err(CurveError::ObjectType(other)),
        };
        if self.data_offset != INFO_SIZE {
            Err(CurveError::DataOffset(self.data_offset))
        } else if !(2..=MAX_SETPOINTS).contains(&self.setpoints) {
            Err(CurveError::Setpoints(self.setpoints.into()))
        } else if self.setpoint_size != SETPOINT_SIZE {
            Err(CurveError::SetpointSize(self.setpoint_size))
        } else if !IDS.contains(&self.id) {
            Err(CurveError::Id(self.id))
        } else if self.x_unit != units || self.y_unit != Unit::POSITION {
            Err(CurveError::Units { x: self.x_unit, y: self.y_unit, object_type: self.object_type })
        } else if self.x_length == 0 {
            Err(CurveError::Length)
        } else {
            Ok(())
        }
    }

    /// The 18 words on the wire: 70 bytes, low byte first, and 2 bytes of 00h.
    #[must_use]
    pub fn encode(&self) -> [u32; INFO_WORDS] {
        let mut bytes = [0u8; INFO_WORDS * 4];
        let mut at = 0;
        let mut put = |field: &[u8]| {
            if let Some(room) = bytes.get_mut(at..at + field.len()) {
                room.copy_from_slice(field);
            }
            at += field.len();
        };
        put(&self.data_offset.to_le_bytes());
        put(&self.object_type.0.to_le_bytes());
        put(&self.setpoints.to_le_bytes());
        put(&self.setpoint_size.to_le_bytes());
        put(&self.name);
        put(&self.id.to_le_bytes());
        put(&self.x_length.to_le_bytes());
        put(&self.x_unit.0.to_le_bytes());
        put(&self.y_unit.0.to_le_bytes());
        put(&self.wizard_type.to_le_bytes());
        for parameter in self.wizard {
            put(&parameter.to_le_bytes());
        }
        let mut words = [0; INFO_WORDS];
        for (word, four) in words.iter_mut().zip(bytes.as_chunks::<4>().0) {
            *word = u32::from_le_bytes(*four);
        }
        words
    }

    /// From the 18 words on the wire; nothing is checked, see [`check`](Self::check).
    #[must_use]
    pub fn parse(words: &[u32; INFO_WORDS]) -> Self {
        let mut bytes = [0u8; INFO_WORDS * 4];
        for (four, word) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(words) {
            *four = word.to_le_bytes();
        }
        let short = |at: usize| match bytes.get(at..at + 2) {
            Some(&[low, high]) => u16::from_le_bytes([low, high]),
            _ => 0,
        };
        let long = |at: usize| u32::from(short(at)) | u32::from(short(at + 2)) << 16;
        let mut name = [0; 22];
        name.copy_from_slice(bytes.get(8..30).unwrap_or(&[0; 22]));
        Self {
            data_offset: short(0),
            object_type: ObjectType(short(2)),
            setpoints: short(4),
            setpoint_size: short(6),
            name,
            id: short(30),
            x_length: long(32),
            x_unit: Unit(short(36)),
            y_unit: Unit(short(38)),
            wizard_type: short(40),
            wizard: core::array::from_fn(|n| long(42 + 4 * n)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Manual B, figure 13: the info block of the example curve.
    const WORDS: [u32; INFO_WORDS] = [
        0x0003_0046,
        0x0004_000A,
        0x6D61_7845,
        0x5F65_6C70,
        0x7672_7543,
        0x0000_0065,
        0,
        0x0017_0000,
        0x0000_4E20,
        0x0005_001A,
        0x4240_0000,
        0x0000_000F,
        0,
        0,
        0,
        0,
        0,
        0,
    ];
    #[test]
    fn the_example_curve() {
        let info = InfoBlock::parse(&WORDS);
        assert_eq!((info.name(), info.id, info.setpoints), (&b"Example_Curve"[..], 23, 10));
        // 200 ms in 10 µs.
        assert_eq!((info.x_length, info.x_unit, info.y_unit), (20_000, Unit::TIME, Unit::POSITION));
        assert_eq!((info.wizard_type, info.wizard[0]), (0, 1_000_000));
        assert_eq!((info.check(), info.data_size(), info.encode()), (Ok(()), 40, WORDS));
        let mut built = InfoBlock::position_over_time(23, "Example_Curve", 20_000, 10).unwrap();
        built.wizard[0] = 1_000_000;
        assert_eq!(built.encode(), WORDS);
        assert_eq!((info.x(0), info.x(1), info.x(9)), (0, 2222, 20_000));
    }

    #[test]
    fn object_type_nibbles() {
        let cam = ObjectType::POSITION_ENCODER;
        assert_eq!((cam.version(), cam.object(), cam.x_code(), cam.y_code()), (3, 0, 1, 0));
        let other = ObjectType(0x5203);
        assert_eq!((other.x_code(), other.y_code()), (2, 5));
    }

    #[test]
    fn what_a_drive_would_not_take_is_named() {
        let good = InfoBlock::parse(&WORDS);
        let check = |change: fn(&mut InfoBlock)| {
            let mut info = good;
            change(&mut info);
            info.check().unwrap_err()
        };
        assert_eq!(check(|i| i.data_offset = 72), CurveError::DataOffset(72));
        assert_eq!(check(|i| i.object_type = ObjectType(0x1003)), CurveError::ObjectType(ObjectType(0x1003)));
        assert_eq!(check(|i| i.setpoints = 1), CurveError::Setpoints(1));
        assert_eq!(check(|i| i.setpoints = 16_384), CurveError::Setpoints(16_384));
        assert_eq!(check(|i| i.setpoint_size = 2), CurveError::SetpointSize(2));
        assert_eq!(check(|i| i.id = 101), CurveError::Id(101));
        assert_eq!(check(|i| i.x_length = 0), CurveError::Length);
        assert!(matches!(check(|i| i.x_unit = Unit::ENCODER), CurveError::Units { .. }));
        let long = "a name of 22 bytes long";
        assert_eq!(InfoBlock::cam(1, long, 1, 2), Err(CurveError::Name(long.len())));
    }

    proptest! {
        #[test]
        fn info_blocks_come_back(words: [u32; INFO_WORDS]) {
            let info = InfoBlock::parse(&words);
            let mut expected = words;
            // The two bytes behind the block are padding.
            expected[INFO_WORDS - 1] &= 0xFFFF;
            prop_assert_eq!(info.encode(), expected);
        }
    }
}
