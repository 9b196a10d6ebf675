//! Unique parameter IDs, firmware layers, address usage, strings (manual B, 2 and 3).

use core::fmt;
use core::ops::{BitOr, RangeInclusive};

/// Unique parameter ID, 16 bits (manual B 2.2).
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Upid(pub u16);

impl Upid {
    /// String parameter "Drive Name", 32 characters in the stringlets 03E9h…03F0h.
    pub const DRIVE_NAME: Self = Self(0x03E8);
    /// String parameter "User Comment", 32 characters in the stringlets 03F3h…03FAh.
    pub const USER_COMMENT: Self = Self(0x03F2);

    /// The firmware layer that the UPID belongs to; `None` between the ranges.
    #[must_use]
    pub fn layer(self) -> Option<Layer> {
        Layer::ALL.into_iter().find(|layer| layer.range().contains(&self.0))
    }

    /// UPID of the stringlet with this number, 0 the first: the string's UPID + 1 + `number`
    /// (manual B 2.5); `None` beyond FFFFh.
    #[must_use]
    pub fn stringlet(self, number: u16) -> Option<Self> {
        self.0.checked_add(number)?.checked_add(1).map(Self)
    }
}

impl fmt::Display for Upid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h", self.0)
    }
}

impl fmt::Debug for Upid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Upid({self})")
    }
}

/// Firmware layer (manual B, table 2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Layer {
    /// 1: operating system.
    Os,
    /// 2: motion control software.
    MotionControl,
    /// 3: interface software.
    Interface,
    /// 4: application.
    Application,
}

impl Layer {
    /// All layers, lowest first.
    pub const ALL: [Self; 4] = [Self::Os, Self::MotionControl, Self::Interface, Self::Application];

    /// 1…4.
    #[must_use]
    pub const fn number(self) -> u8 {
        self as u8 + 1
    }

    /// The layer with this number, 1…4.
    #[must_use]
    pub fn from_number(number: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|layer| u32::from(layer.number()) == number)
    }

    /// UPIDs of its parameters and variables on SG5 drives (manual B, table 3).
    #[must_use]
    pub const fn range(self) -> RangeInclusive<u16> {
        match self {
            Self::Os => 0x0000..=0x0EFF,
            Self::MotionControl => 0x1000..=0x1EFF,
            Self::Interface => 0x2000..=0x2EFF,
            Self::Application => 0x3000..=0x3EFF,
        }
    }

    /// UPIDs of tree ID, main version and sub version (manual B, table 4).
    #[must_use]
    pub const fn identity(self) -> [Upid; 3] {
        match self {
            Self::Os => [Upid(0x0539), Upid(0x0532), Upid(0x0533)],
            Self::MotionControl => [Upid(0x0561), Upid(0x055A), Upid(0x055B)],
            Self::Interface => [Upid(0x0589), Upid(0x0582), Upid(0x0583)],
            Self::Application => [Upid(0x05B1), Upid(0x05AA), Upid(0x05AB)],
        }
    }

    /// Name in tables and on command lines.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Os => "os",
            Self::MotionControl => "mc",
            Self::Interface => "interface",
            Self::Application => "application",
        }
    }
}

impl fmt::Display for Layer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Identification of one layer's parameter tree (manual B 3, table 4).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TreeIdentity {
    /// Which tree it is.
    pub tree_id: u32,
    /// Version within which sub versions are backward compatible.
    pub main_version: u32,
    /// Sub version.
    pub sub_version: u32,
}

/// A violated compatibility rule (manual B 4, table 5): why a file must not be downloaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Incompatible {
    /// Tree IDs must be equal.
    #[error("layer {layer}: tree ID {file} in the file, {drive} in the drive; they must be equal")]
    TreeId {
        /// The layer.
        layer: Layer,
        /// Value of the source file.
        file: u32,
        /// Value of the target drive.
        drive: u32,
    },
    /// Main versions must be equal.
    #[error("layer {layer}: main version {file} in the file, {drive} in the drive; they must be equal")]
    MainVersion {
        /// The layer.
        layer: Layer,
        /// Value of the source file.
        file: u32,
        /// Value of the target drive.
        drive: u32,
    },
    /// The file's sub version must be the same or smaller.
    #[error(
        "layer {layer}: sub version {file} in the file, {drive} in the drive; the file's must not be greater"
    )]
    SubVersion {
        /// The layer.
        layer: Layer,
        /// Value of the source file.
        file: u32,
        /// Value of the target drive.
        drive: u32,
    },
}

impl TreeIdentity {
    /// Every rule that `self`, of a source file, violates against the target `drive`.
    pub fn violations(self, drive: Self, layer: Layer) -> impl Iterator<Item = Incompatible> {
        let tree_id = (self.tree_id != drive.tree_id).then_some(Incompatible::TreeId {
            layer,
            file: self.tree_id,
            drive: drive.tree_id,
        });
        let main_version = (self.main_version != drive.main_version).then_some(Incompatible::MainVersion {
            layer,
            file: self.main_version,
            drive: drive.main_version,
        });
        let sub_version = (self.sub_version > drive.sub_version).then_some(Incompatible::SubVersion {
            layer,
            file: self.sub_version,
            drive: drive.sub_version,
        });
        [tree_id, main_version, sub_version].into_iter().flatten()
    }
}

/// What may be done with a parameter (manual B 7.2.1.4; bit numbers from the LinRS manual's examples).
#[derive(Clone, Copy, PartialEq, Eq, Default, Hash)]
pub struct Usage(pub u16);

impl Usage {
    /// Bit 0: the RAM value can be read.
    pub const RAM_READ: Self = Self(0x0001);
    /// Bit 1: the RAM value can be written.
    pub const RAM_WRITE: Self = Self(0x0002);
    /// Bit 2: the ROM value can be read.
    pub const ROM_READ: Self = Self(0x0004);
    /// Bit 3: the ROM value can be written.
    pub const ROM_WRITE: Self = Self(0x0008);
    /// Bit 8: live parameter; a change of its RAM value acts at once.
    pub const LIVE: Self = Self(0x0100);
    /// Bit 12: not used for hash calculation.
    pub const NO_HASH: Self = Self(0x1000);

    /// Whether all bits of `other` are set.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether neither memory can be accessed as a 32-bit value: a string, held by its stringlets.
    #[must_use]
    pub const fn is_opaque(self) -> bool {
        self.0 & 0x000F == 0
    }
}

impl BitOr for Usage {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl fmt::Display for Usage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = [
            (Self::RAM_READ, "RAM read"),
            (Self::RAM_WRITE, "RAM write"),
            (Self::ROM_READ, "ROM read"),
            (Self::ROM_WRITE, "ROM write"),
            (Self::LIVE, "live"),
            (Self::NO_HASH, "not in hash"),
        ];
        let mut set = names.into_iter().filter(|(bit, _)| self.contains(*bit)).map(|(_, name)| name);
        f.write_str(set.next().unwrap_or("no access"))?;
        set.try_for_each(|name| write!(f, ", {name}"))
    }
}

impl fmt::Debug for Usage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Usage({:04X}h: {self})", self.0)
    }
}

/// Stringlets that a string has: 32 characters in groups of 4 (manual B 2.5).
pub const STRINGLETS: u16 = 8;

/// The raw value of the stringlet with this number, 0 the first: its first character in the least
/// significant byte, filled with 00h (manual B, table 1).
#[must_use]
pub fn stringlet(text: &[u8], number: u16) -> u32 {
    let rest = text.get(usize::from(number) * 4..).unwrap_or(&[]);
    let mut bytes = [0; 4];
    for (byte, character) in bytes.iter_mut().zip(rest) {
        *byte = *character;
    }
    u32::from_le_bytes(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::{string::ToString, vec::Vec};

    /// Manual B, table 1: "X Axis Left" in 03F3h, 03F4h, 03F5h.
    #[test]
    fn x_axis_left() {
        let text = b"X Axis Left";
        let found: Vec<(u16, u32)> =
            (0..4).map(|n| (Upid::USER_COMMENT.stringlet(n).unwrap().0, stringlet(text, n))).collect();
        assert_eq!(found, [(0x3F3, 0x7841_2058), (0x3F4, 0x4C20_7369), (0x3F5, 0x0074_6665), (0x3F6, 0)]);
        // The same way back.
        let bytes: Vec<u8> = found.iter().flat_map(|(_, value)| value.to_le_bytes()).collect();
        assert_eq!(&bytes[..12], b"X Axis Left\0");
        assert_eq!(Upid(0xFFFF).stringlet(0), None);
    }

    /// Manual B, tables 2, 3 and 4.
    #[test]
    fn layers_and_their_ranges() {
        let rows: Vec<_> = Layer::ALL
            .into_iter()
            .map(|l| (l.number(), *l.range().start(), *l.range().end(), l.identity().map(|u| u.0)))
            .collect();
        assert_eq!(
            rows,
            [
                (1, 0x0000, 0x0EFF, [0x0539, 0x0532, 0x0533]),
                (2, 0x1000, 0x1EFF, [0x0561, 0x055A, 0x055B]),
                (3, 0x2000, 0x2EFF, [0x0589, 0x0582, 0x0583]),
                (4, 0x3000, 0x3EFF, [0x05B1, 0x05AA, 0x05AB]),
            ]
        );
        assert_eq!((Upid(0x13A2).layer(), Upid(0x0F00).layer()), (Some(Layer::MotionControl), None));
        assert_eq!((Layer::from_number(4), Layer::from_number(5)), (Some(Layer::Application), None));
    }

    /// Manual B, table 5.
    #[test]
    fn compatibility_rules() {
        let drive = TreeIdentity { tree_id: 4612, main_version: 3, sub_version: 2 };
        let say = |file: TreeIdentity| -> Vec<_> {
            file.violations(drive, Layer::MotionControl).map(|v| v.to_string()).collect()
        };
        assert!(say(drive).is_empty());
        assert!(say(TreeIdentity { sub_version: 0, ..drive }).is_empty());
        assert_eq!(
            say(TreeIdentity { sub_version: 3, ..drive }),
            ["layer mc: sub version 3 in the file, 2 in the drive; the file's must not be greater"]
        );
        assert_eq!(say(TreeIdentity { tree_id: 1, main_version: 2, sub_version: 9 }).len(), 3);
        assert_eq!(
            say(TreeIdentity { main_version: 2, ..drive }),
            ["layer mc: main version 2 in the file, 3 in the drive; they must be equal"]
        );
    }

    /// 010Fh, 000Dh, 1001h: the LinRS manual's examples.
    #[test]
    fn usage_bits() {
        assert_eq!(Usage(0x010F).to_string(), "RAM read, RAM write, ROM read, ROM write, live");
        assert_eq!(Usage(0x000D).to_string(), "RAM read, ROM read, ROM write");
        assert_eq!(Usage(0x1001).to_string(), "RAM read, not in hash");
        assert!(Usage(0x1000).is_opaque() && !Usage(0x1001).is_opaque());
    }
}
