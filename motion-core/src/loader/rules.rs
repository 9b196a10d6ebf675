//! The rules.

use lb2::code::LoaderCode;

use super::Rule;
use crate::bus::{OBJECTS, Role, Settings};
use crate::parameters::Values;

/// Greatest velocity with all six axes activated (6.8.1.1, 6.11).
pub const SIX_AXES_VELOCITY: i32 = 2_730_666;

/// First parameters of the velocities that six axes limit (6.8.1.1, 6.8.1.3).
const VELOCITIES: [u16; 10] = [642, 684, 756, 762, 768, 774, 792, 798, 912, 918];

/// All rules, errors before warnings; of two parameters at fault, that of the earlier rule is named.
pub static RULES: [Rule; 12] = [
    Rule {
        code: LoaderCode(0x83),
        message: "Invalid number of actual value inputs",
        expected: "no more active inputs than [000] has",
        clause: "6.3.1, 6.6.1",
        check: |values, fault| {
            let active = (0..6).filter(|&input| values.at(107, input) == 1);
            let allowed = usize::try_from(values.at(0, 0)).unwrap_or(0);
            active.skip(allowed).for_each(|input| fault(107 + input as u16));
        },
    },
    Rule {
        code: LoaderCode(0x84),
        message: "Velocity above 2730666 with 6 axes",
        expected: "2730666 or less",
        clause: "6.8.1.1, 6.11",
        check: |values, fault| {
            if values.at(0, 0) == 6 {
                each(&VELOCITIES, |index, axis| values.at(index, axis) > SIX_AXES_VELOCITY, fault);
            }
        },
    },
    Rule {
        code: LoaderCode(0x85),
        message: "CAN bus needs 2 activated axes",
        expected: "2 AX/AI or more, or nothing on a CAN bus",
        clause: "6.11, 7.2",
        check: |values, fault| {
            if values.at(0, 0) < 2 && uses_can(values) {
                fault(0);
            }
        },
    },
    Rule {
        code: LoaderCode(0x86),
        message: "Node address of an axis is above 16",
        expected: "1 to 16 for an object of type Axis",
        clause: "6.5.1.1",
        check: |values, fault| {
            for (address, kind) in [(310, 326), (342, 358)] {
                for object in 0..8 {
                    if values.at(kind, object) == 3 && values.at(address, object) > 16 {
                        fault(address + object as u16);
                    }
                }
            }
        },
    },
    Rule {
        code: LoaderCode(0x87),
        message: "V Work must be less than V max.",
        expected: "less than V max.",
        clause: "6.8.1.1",
        // 0 is the factory default of both: no working velocity is set.
        check: |values, fault| {
            let faulty =
                |work, axis| values.at(work, axis) != 0 && values.at(work, axis) >= values.at(642, axis);
            each(&[684], faulty, fault);
        },
    },
    Rule {
        code: LoaderCode(0x88),
        message: "t acceleration < t max. acceleration",
        expected: "t max. acceleration or more, or 0",
        clause: "6.8.1.1",
        check: |values, fault| {
            each(&[666], |work, axis| below(values.at(work, axis), values.at(654, axis)), fault);
        },
    },
    Rule {
        code: LoaderCode(0x89),
        message: "t deceleration < t max. deceleration",
        expected: "t max. deceleration or more, or 0",
        clause: "6.8.1.1",
        // With [660] = 0 the maximum is that of the acceleration.
        check: |values, fault| {
            let maximum = |axis| match values.at(660, axis) {
                0 => values.at(654, axis),
                time => time,
            };
            each(&[678], |work, axis| below(values.at(work, axis), maximum(axis)), fault);
        },
    },
    Rule {
        code: LoaderCode(0x8A),
        message: "U min. is above U max.",
        expected: "U max. or less",
        clause: "6.7.1.1",
        check: |values, fault| {
            for minimum in [504, 510] {
                for output in 0..3 {
                    if values.at(minimum, output) > values.at(480, output) {
                        fault(minimum + output as u16);
                    }
                }
            }
        },
    },
    Rule {
        code: LoaderCode(0x8B),
        message: "Multiplier denominator is 0",
        expected: "1 or more",
        clause: "6.6.1.1",
        check: |values, fault| each(&[212], |index, input| values.at(index, input) == 0, fault),
    },
    Rule {
        code: LoaderCode(0x8C),
        message: "Master bypass needs IN and OUT alike",
        expected: "Yes for an IN and an OUT object of one address",
        clause: "6.5.1.1",
        check: |values, fault| {
            for object in 0..8 {
                let bypassed = |object| values.at(334, object) == 1;
                let mut opposite = if object < 4 { 4..8 } else { 0..4 };
                let paired =
                    opposite.any(|other| bypassed(other) && values.at(310, other) == values.at(310, object));
                if bypassed(object) && !paired {
                    fault(334 + object as u16);
                }
            }
        },
    },
    Rule {
        code: LoaderCode(0x8D),
        message: "CAN Link on a bus with axis objects",
        expected: "No, or no object of type Axis on this bus",
        clause: "6.5.1",
        // 3 is `Axis`; the objects of CAN 2 are axes as delivered.
        check: |values, fault| {
            for (bus, kind) in [326, 358].into_iter().enumerate() {
                if values.at(302, bus) == 1 && (0..8).any(|object| values.at(kind, object) == 3) {
                    fault(302 + bus as u16);
                }
            }
        },
    },
    Rule {
        code: LoaderCode(0x8E),
        message: "Two objects have the same identifier",
        expected: "an address that gives the object an identifier of its own",
        clause: "6.5.1.1",
        check: |values, fault| {
            for (bus, address) in [310, 342].into_iter().enumerate() {
                let mut taken = [None; 2 * OBJECTS];
                for (place, id) in identifiers(values, bus).into_iter().enumerate() {
                    if id.is_some() && taken.contains(&id) {
                        fault(address + place as u16);
                    }
                    if let Some(slot) = taken.get_mut(place) {
                        *slot = id;
                    }
                }
            }
        },
    },
];

/// Identifiers of objects IN 1…4 and OUT 1…4 of a CANopen bus, as far as they are active.
fn identifiers(values: &Values, bus: usize) -> [Option<u16>; 2 * OBJECTS] {
    let (role, settings) = (Role::read(values, bus), Settings::read(values, bus));
    let mut ids = [None; 2 * OBJECTS];
    let inputs = settings.inputs.into_iter().map(|object| (object, true));
    let outputs = settings.outputs.into_iter().map(|object| (object, false));
    if role != Role::Link {
        for (id, (object, input)) in ids.iter_mut().zip(inputs.chain(outputs)) {
            *id = object.map(|object| object.id(role, input));
        }
    }
    ids
}

/// A port that LB2 uses must not check for odd parity (Appendix 1, "Transmission").
pub static ODD_PARITY: Rule = Rule {
    code: LoaderCode(0x03),
    message: "LB2 allows even parity or none",
    expected: "None or Even",
    clause: "Appendix 1, 6.3.3",
    check: |values, fault| {
        // LB2 uses the port that [006] does not give to CoDeSys.
        let port = if values.at(6, 0) == 0 { 1 } else { 0 };
        if values.at(9, port) == 1 {
            fault(9 + port as u16);
        }
    },
};

fn each(firsts: &[u16], faulty: impl Fn(u16, usize) -> bool, fault: &mut dyn FnMut(u16)) {
    for &first in firsts {
        (0..6)
            .filter(|&instance| faulty(first, instance))
            .for_each(|instance| fault(first + instance as u16));
    }
}

/// 0 stands for the maximum itself.
const fn below(work: i32, maximum: i32) -> bool {
    work != 0 && work < maximum
}

/// Whether an active actual value input, a nominal value output or an object of CAN 1 uses a CAN bus.
/// The objects of CAN 2 are axes as delivered and count only together with an input or output.
fn uses_can(values: &Values) -> bool {
    (0..6).any(|n| (values.at(107, n) == 1 && values.at(100, n) == 2) || values.at(450, n) == 2)
        || (0..8).any(|object| values.at(326, object) != 0)
}
