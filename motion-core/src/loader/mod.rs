//! The loader (LB2 34h, and leaving the programming mode at the device): checks parameter values
//! before they become effective. Every rule is one item of [`RULES`] with its clause, message and
//! severity.

mod rules;

use lb2::code::LoaderCode;

use crate::parameters::{RangeError, Values, get};

pub use rules::{ODD_PARITY, RULES, SIX_AXES_VELOCITY};

/// One rule of the loader.
pub struct Rule {
    /// 01h…7Fh warning, 80h…FFh error. The numbers are project-defined: manual A gives none.
    pub code: LoaderCode,
    /// What 33h answers, at most 40 characters of ASCII.
    pub message: &'static str,
    /// What the parameter at fault could be, in words for people.
    pub expected: &'static str,
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
/// A node address 0 was not taken: the parameter has its default (6.5.1.1). That this is told as an error
/// is project-defined.
pub const NO_ADDRESS: (LoaderCode, &str) = (LoaderCode(0x8F), "0 is no address (1...127): default set");
/// A value was taken that needs the device switched on again (`[300]`…`[303]`; 6.5.1).
pub const SWITCH_ON: (LoaderCode, &str) = (LoaderCode(0x01), "Effective after switching on again");
/// A value was taken that needs a CAN bus scan (4.3.4.4, 6.6.1.3, 6.7.1).
pub const SCAN: (LoaderCode, &str) = (LoaderCode(0x02), "CAN bus must be scanned again");

/// One parameter at fault.
#[derive(Debug, Clone, Copy)]
pub struct Finding {
    /// Number of the parameter.
    pub index: u16,
    /// The rule that it breaks.
    pub rule: &'static Rule,
}

impl Finding {
    /// What people are told: the parameter with its value among `values`, what is wrong, what was
    /// expected, and the clause.
    #[must_use]
    pub const fn explain<'a>(&self, values: &'a Values) -> Explanation<'a> {
        Explanation { finding: *self, values }
    }
}

/// A finding in words: `[302] CAN Link, CAN 1 = Yes: CAN Link on a bus with axis objects, expected …`.
#[derive(Debug, Clone, Copy)]
pub struct Explanation<'a> {
    finding: Finding,
    values: &'a Values,
}

impl core::fmt::Display for Explanation<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { finding: Finding { index, rule }, values } = *self;
        match get(index) {
            Some(entry) => write!(f, "{entry} = {}", entry.format(values.of(entry), values))?,
            None => write!(f, "[{index:03}]")?,
        }
        write!(f, ": {}; expected: {} ({})", rule.message, rule.expected, rule.clause)
    }
}

/// Whether a value is the node address 0 (6.5.1.1).
pub(crate) const fn is_no_address(index: u16, value: i32) -> bool {
    value == 0 && matches!(index, 310..=317 | 342..=349)
}

/// Sets what the loader corrects by itself: a node address 0 becomes its default (6.5.1.1).
pub fn correct(values: &mut Values) {
    for entry in [310, 342].into_iter().flat_map(|first| (first..first + 8).filter_map(get)) {
        if values.of(entry) == 0 {
            // A default is always within its range.
            let _ = values.set(entry.index(), entry.default());
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
        300..=303 if changed => SWITCH_ON,
        254..=259 | 310..=373 | 450..=455 | 486..=491 if changed => SCAN,
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

    #[test]
    fn people_learn_what_came_and_what_was_expected() {
        let mut values = Values::factory();
        values.set(303, 1).unwrap();
        let mut words = Vec::new();
        check(&values, |finding| words.push(alloc::format!("{}", finding.explain(&values))));
        let expected = "[303] CAN Link, CAN 2 = Yes: CAN Link on a bus with axis objects; \
                        expected: No, or no object of type Axis on this bus (6.5.1)";
        assert_eq!(words, [expected]);
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
        codes.extend([UNUSED, RANGE, CHOICE, NO_ADDRESS, SWITCH_ON, SCAN].map(|(code, _)| code.0));
        codes.sort_unstable();
        assert!(codes.windows(2).all(|pair| pair[0] != pair[1]), "{codes:X?}");
        assert!(RULES.iter().all(|rule| rule.message.len() <= 40 && rule.code.is_error()));
        assert!(NO_ADDRESS.1.len() <= 40 && NO_ADDRESS.0.is_error());
        assert!(ODD_PARITY.code.is_warning());
    }
}
