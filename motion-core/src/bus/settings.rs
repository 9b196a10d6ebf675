//! Settings of a CAN bus, read from the parameters in one place.

use pdo::{DefaultPdo, NodeId, Service};

use crate::parameters::Values;

/// Objects in each direction.
pub const OBJECTS: usize = 4;

/// What a bus is, `[300]` to `[303]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// CANopen master.
    Master,
    /// CANopen slave.
    Slave,
    /// CAN Link, a user protocol of 14 channels.
    Link,
}

impl Role {
    /// The role of bus `at`, 0 or 1. CAN Link is effective after switching on only.
    #[must_use]
    pub fn read(values: &Values, at: usize) -> Self {
        match (values.at(302, at), values.at(300, at)) {
            (1, _) => Self::Link,
            (_, 1) => Self::Slave,
            _ => Self::Master,
        }
    }
}

/// Type of an object, `[326]`, `[358]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Digital inputs or outputs of a remote I/O node: PDO 1.
    Digital,
    /// Analog ones: PDO 2.
    Analogue,
    /// A drive LD 2000: PDO 1.
    Axis,
    /// Anything else: PDO 1, opaque, not scanned.
    Other,
}

/// An object that is not inactive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Object {
    /// Whose it is, or the address that slaves share.
    pub node: NodeId,
    /// Type.
    pub kind: Kind,
    /// `[334]`: master and slave are swapped.
    pub bypass: bool,
}

impl Object {
    const fn pdo(self) -> DefaultPdo {
        match self.kind {
            Kind::Analogue => DefaultPdo::Second,
            Kind::Digital | Kind::Axis | Kind::Other => DefaultPdo::First,
        }
    }

    /// Identifier that an object IN listens to, or that an object OUT sends with, on a bus of this role
    /// (decision 13): a master reads TPDOs and sends RPDOs, a slave does the opposite.
    #[must_use]
    pub fn id(self, role: Role, input: bool) -> u16 {
        let master = (role == Role::Master) != self.bypass;
        if master == input {
            Service::Tpdo(self.pdo(), self.node).id()
        } else {
            Service::Rpdo(self.pdo(), self.node).id()
        }
    }
}

/// Objects of a bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// IN 1…IN 4.
    pub inputs: [Option<Object>; OBJECTS],
    /// OUT 1…OUT 4.
    pub outputs: [Option<Object>; OBJECTS],
}

impl Settings {
    /// The objects of bus `at`, 0 or 1. A drive counts only where an actual value input or a nominal
    /// value output refers to it (4.3.4.4).
    #[must_use]
    pub fn read(values: &Values, at: usize) -> Self {
        let (address, kind, bypass) = if at == 0 { (310, 326, 334) } else { (342, 358, 366) };
        let object = |place: usize, used: bool| {
            let node = NodeId::new(u8::try_from(values.at(address, place)).ok()?).ok()?;
            let kind = match values.at(kind, place) {
                1 => Kind::Digital,
                2 => Kind::Analogue,
                3 if used => Kind::Axis,
                4 => Kind::Other,
                _ => return None,
            };
            Some(Object { node, kind, bypass: values.at(bypass, place) == 1 })
        };
        // Choices of [254] and [486]: 1, 2 are CAN 1, 3…6 are CAN 2.
        let choice = |place: usize| (if at == 0 { 1 } else { 3 }) + place as i32;
        let reads = |place| {
            (0..6).any(|input| {
                values.at(107, input) == 1
                    && values.at(100, input) == 2
                    && values.at(254, input) == choice(place)
            })
        };
        let writes = |place| (0..6).any(|n| values.at(450, n) == 2 && values.at(486, n) == choice(place));
        Self {
            inputs: core::array::from_fn(|place| object(place, reads(place))),
            outputs: core::array::from_fn(|place| object(OBJECTS + place, writes(place))),
        }
    }

    /// Objects of both directions.
    pub(super) fn iter(&self) -> impl Iterator<Item = Object> {
        self.inputs.into_iter().chain(self.outputs).flatten()
    }

    /// Whether a node is a drive.
    pub(super) fn is_drive(&self, node: NodeId) -> bool {
        self.iter().any(|object| object.node == node && object.kind == Kind::Axis)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(at: usize, changes: &[(u16, i32)]) -> (Role, Settings) {
        let mut values = Values::factory();
        for &(index, value) in changes {
            values.set(index, value).unwrap();
        }
        (Role::read(&values, at), Settings::read(&values, at))
    }

    fn ids(at: usize, changes: &[(u16, i32)]) -> [[u16; OBJECTS]; 2] {
        let (role, settings) = settings(at, changes);
        let id = |input| move |object: Option<Object>| object.map_or(0, |object| object.id(role, input));
        [settings.inputs.map(id(true)), settings.outputs.map(id(false))]
    }

    /// 6.5.1.1, the example's master and both slaves: parameters `[300]`, `[310]`, `[326]`, `[334]`.
    #[test]
    fn parameters_300_310_326_and_334_give_the_examples_identifiers() {
        let master =
            ids(0, &[(310, 5), (326, 1), (314, 5), (330, 1), (311, 7), (327, 1), (315, 7), (331, 1)]);
        assert_eq!(master, [[0x185, 0x187, 0, 0], [0x205, 0x207, 0, 0]]);
        let common = [(300, 1), (326, 1), (330, 1), (313, 10), (329, 1), (317, 10), (333, 1)];
        let first = ids(0, &[&common[..], &[(310, 5), (314, 5), (337, 1), (341, 1)]].concat());
        assert_eq!(first, [[0x205, 0, 0, 0x18A], [0x185, 0, 0, 0x20A]]);
        let second = ids(0, &[&common[..], &[(310, 7), (314, 7)]].concat());
        assert_eq!(second, [[0x207, 0, 0, 0x20A], [0x187, 0, 0, 0x18A]]);
    }

    /// `[326]`: analog objects are PDO 2, others PDO 1.
    #[test]
    fn parameter_326_is_the_type_of_an_object() {
        let id = |kind| ids(0, &[(326, kind), (330, kind)]).map(|ids| ids[0]);
        assert_eq!(id(0), [0, 0]);
        assert_eq!(id(1), [0x181, 0x201]);
        assert_eq!(id(2), [0x281, 0x301]);
        assert_eq!(id(4), [0x181, 0x201]);
        // A drive that nothing refers to is left out; input 5 and output 5 do by default.
        assert_eq!(id(3), [0, 0]);
        let used = ids(0, &[(326, 3), (330, 3), (111, 1), (454, 2)]);
        assert_eq!(used.map(|ids| ids[0]), [0x181, 0x201]);
    }

    /// `[342]`, `[358]`, `[366]`: CAN 2 as delivered, and 6.11.
    #[test]
    fn parameters_342_358_and_366_are_those_of_can_2() {
        assert_eq!(ids(1, &[]), [[0; 4]; 2]);
        assert_eq!(ids(1, &[(100, 2), (450, 2)]), [[0x181, 0, 0, 0], [0x201, 0, 0, 0]]);
        assert_eq!(ids(1, &[(100, 2), (342, 9), (450, 2), (346, 9)]), [[0x189, 0, 0, 0], [0x209, 0, 0, 0]]);
        assert_eq!(ids(1, &[(100, 2), (358, 0)]), [[0; 4]; 2]);
    }

    /// `[301]` is always Master; `[302]`, `[303]`: CAN Link in place of CANopen.
    #[test]
    fn parameters_302_and_303_select_can_link() {
        assert_eq!([0, 1].map(|at| settings(at, &[]).0), [Role::Master; 2]);
        assert_eq!(settings(0, &[(300, 1)]).0, Role::Slave);
        assert_eq!(settings(0, &[(300, 1), (302, 1)]).0, Role::Link);
        assert_eq!([0, 1].map(|at| settings(at, &[(303, 1)]).0), [Role::Master, Role::Link]);
    }
}
