//! The loader (LB2 34h, and leaving the programming mode at the device): checks parameter values
//! before they become effective. Every rule is one item of [`RULES`] with its clause, message and
//! severity.

use lb2::code::LoaderCode;

use crate::bus::{OBJECTS, Role, Settings};
use crate::parameters::{RangeError, Values};

/// One rule of the loader.
pub struct Rule {
    /// 01h…7Fh warning, 80h…FFh error. The numbers are project-defined: manual A gives none.
    pub code: LoaderCode,
    /// What 33h answers, at most 40 characters of ASCII.
    pub message: &'static str,
    /// Clause of manual A.
    pub clause: &'static str,
    /// Finds the parameters at fault, in ascending order, by [`Values`].
    check: fn(&Values, &mut dyn FnMut(u16)),
}

impl core::fmt::Debug for Rule {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:02X}h {:?} ({})", self.code.0, self.message, self.clause)
    }
}

/// A value was not taken because its number is not in use (decision 4).
pub const UNUSED: (LoaderCode, &str) = (LoaderCode(0x80), "No such parameter");
/// A value was not taken because it is out of range (6.1).
pub const RANGE: (LoaderCode, &str) = (LoaderCode(0x81), "Value out of range");
/// A value was not taken because this instance has no such choice (6.5.1, 6.6.1, 6.7.1).
pub const CHOICE: (LoaderCode, &str) = (LoaderCode(0x82), "Choice not available here");
/// A value was taken that needs the device switched on again (`[302]`, `[303]`; 6.5.1).
pub const SWITCH_ON: (LoaderCode, &str) = (LoaderCode(0x01), "Effective after switching on again");
/// A value was taken that needs a CAN bus scan (4.3.4.4, 6.6.1.3, 6.7.1).
pub const SCAN: (LoaderCode, &str) = (LoaderCode(0x02), "CAN bus must be scanned again");

/// Greatest velocity with all six axes activated (6.8.1.1, 6.11).
pub const SIX_AXES_VELOCITY: i32 = 2_730_666;

/// First parameters of the velocities that six axes limit (6.8.1.1, 6.8.1.3).
const VELOCITIES: [u16; 10] = [642, 684, 756, 762, 768, 774, 792, 798, 912, 918];

/// All rules, errors before warnings; of two parameters at fault, that of the earlier rule is named.
pub static RULES: [Rule; 12] = [
    Rule {
        code: LoaderCode(0x83),
        message: "Invalid number of actual value inputs",
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
        clause: "6.8.1.1",
        check: |values, fault| {
            each(&[666], |work, axis| below(values.at(work, axis), values.at(654, axis)), fault);
        },
    },
    Rule {
        code: LoaderCode(0x89),
        message: "t deceleration < t max. deceleration",
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
        clause: "6.6.1.1",
        check: |values, fault| each(&[212], |index, input| values.at(index, input) == 0, fault),
    },
    Rule {
        code: LoaderCode(0x8C),
        message: "Master bypass needs IN and OUT alike",
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

/// One parameter at fault.
#[derive(Debug, Clone, Copy)]
pub struct Finding {
    /// Number of the parameter.
    pub index: u16,
    /// The rule that it breaks.
    pub rule: &'static Rule,
}

/// Sets what the loader corrects by itself: a node address 0 becomes its default (6.5.1.1).
pub fn correct(values: &mut Values) {
    for first in [310, 342] {
        for index in first..first + 8 {
            if values.get(index) == Some(0)
                && let Some(entry) = crate::parameters::get(index)
            {
                // A default is always within its range.
                let _ = values.set(index, entry.default());
            }
        }
    }
}

/// Tells every finding, errors first.
pub fn check(values: &Values, mut found: impl FnMut(Finding)) {
    for rule in RULES.iter().chain([&ODD_PARITY]) {
        (rule.check)(values, &mut |index| found(Finding { index, rule }));
    }
}

/// Code and message for a value that was not taken.
#[must_use]
pub const fn refusal(error: &RangeError) -> (LoaderCode, &'static str) {
    match error {
        RangeError::Unused { .. } => UNUSED,
        RangeError::Range { .. } => RANGE,
        RangeError::Choice { .. } => CHOICE,
    }
}

/// Code and message for a value that was taken in place of another one.
#[must_use]
pub const fn remark(index: u16, changed: bool) -> (LoaderCode, &'static str) {
    match index {
        302 | 303 if changed => SWITCH_ON,
        254..=259 | 300..=301 | 310..=373 | 450..=455 | 486..=491 if changed => SCAN,
        _ => (LoaderCode::OK, "OK"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    fn findings(changes: &[(u16, i32)]) -> Vec<(u16, u8)> {
        let mut values = Values::factory();
        for &(index, value) in changes {
            values.set(index, value).unwrap();
        }
        correct(&mut values);
        let mut found = Vec::new();
        check(&values, |finding| found.push((finding.index, finding.rule.code.0)));
        found
    }

    #[test]
    fn factory_defaults_are_faultless() {
        assert_eq!(findings(&[]), []);
    }

    /// Manual A 6.11: the inputs must be deactivated before `[000]` is reduced.
    #[test]
    fn each_rule_names_the_parameter() {
        assert_eq!(findings(&[(0, 2)]), [(109, 0x83)]);
        assert_eq!(findings(&[(0, 2), (108, 0), (109, 0)]), []);
        let six = [(0, 6), (642, 2_730_667), (684, 2_730_666), (779, 3_276_800), (919, 2_730_667)];
        assert_eq!(findings(&six), [(642, 0x84), (779, 0x84), (919, 0x84)]);
        assert_eq!(findings(&[(642, 3_276_800)]), []);
        assert_eq!(findings(&[(0, 1), (108, 0), (109, 0), (450, 2)]), [(0, 0x85)]);
        assert_eq!(findings(&[(0, 1), (108, 0), (109, 0), (326, 1)]), [(0, 0x85)]);
        assert_eq!(findings(&[(345, 17)]), [(345, 0x86)]);
        assert_eq!(findings(&[(310, 17), (326, 1)]), []);
        assert_eq!(findings(&[(642, 100), (684, 100)]), [(684, 0x87)]);
        assert_eq!(findings(&[(642, 100), (684, 99)]), []);
        assert_eq!(findings(&[(655, 500), (667, 499)]), [(667, 0x88)]);
        assert_eq!(findings(&[(655, 500), (667, 500)]), []);
        assert_eq!(findings(&[(654, 500), (678, 499)]), [(678, 0x89)]);
        assert_eq!(findings(&[(654, 500), (660, 400), (678, 499)]), []);
        assert_eq!(findings(&[(480, 5000), (504, 5001), (510, 5000)]), [(504, 0x8A)]);
        assert_eq!(findings(&[(217, 0)]), [(217, 0x8B)]);
        assert_eq!(findings(&[(337, 1), (313, 10), (341, 1), (317, 11)]), [(337, 0x8C), (341, 0x8C)]);
        assert_eq!(findings(&[(337, 1), (313, 10), (341, 1), (317, 10)]), []);
        assert_eq!(findings(&[(303, 1)]), [(303, 0x8D)]);
        assert_eq!(findings(&[(302, 1), (327, 3)]), [(302, 0x8D)]);
        assert_eq!(findings(&[(302, 1), (327, 1)]), []);
        let no_axes: Vec<(u16, i32)> = (358..=365).map(|index| (index, 0)).chain([(303, 1)]).collect();
        assert_eq!(findings(&no_axes), []);
        // IN 1 and IN 2 both listen to TPDO 1 of node 5; analog ones to TPDO 2.
        assert_eq!(findings(&[(326, 1), (327, 1), (310, 5), (311, 5)]), [(311, 0x8E)]);
        assert_eq!(findings(&[(326, 1), (327, 2), (310, 5), (311, 5)]), []);
        assert_eq!(findings(&[(330, 4), (331, 1), (314, 5), (315, 5)]), [(315, 0x8E)]);
        assert_eq!(findings(&[(10, 1)]), [(10, 0x03)]);
        assert_eq!(findings(&[(9, 1)]), []);
    }

    /// 6.5.1.1: "The value 0 sets the parameter its the default value."
    #[test]
    fn an_address_0_becomes_the_default() {
        let mut values = Values::factory();
        values.set(312, 0).unwrap();
        values.set(346, 0).unwrap();
        correct(&mut values);
        assert_eq!((values.get(312), values.get(346)), (Some(3), Some(1)));
    }

    #[test]
    fn messages_fit_their_field_and_codes_are_told_apart() {
        let mut codes: Vec<u8> = RULES.iter().chain([&ODD_PARITY]).map(|rule| rule.code.0).collect();
        codes.extend([UNUSED.0.0, RANGE.0.0, CHOICE.0.0, SWITCH_ON.0.0, SCAN.0.0]);
        codes.sort_unstable();
        assert!(codes.windows(2).all(|pair| pair[0] != pair[1]), "{codes:X?}");
        assert!(RULES.iter().all(|rule| rule.message.len() <= 40 && rule.code.is_error()));
        assert!(ODD_PARITY.code.is_warning());
    }
}
