//! Values as people write them: decimal point, choice names.

use core::fmt;

use super::{Entry, RangeError, Values};

/// A value as the device displays it: with its decimal point, or as the choice's text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Formatted {
    entry: Entry,
    value: i32,
    decimals: u8,
}

impl Formatted {
    /// The value in display units, without its point.
    #[must_use]
    pub const fn raw(&self) -> i32 {
        self.value
    }
}

impl fmt::Display for Formatted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(choice) = self.entry.choice(self.value) {
            return f.pad(choice.text);
        }
        let sign = if self.value < 0 { "-" } else { "" };
        let magnitude = self.value.unsigned_abs();
        match self.decimals {
            0 => write!(f, "{sign}{magnitude}"),
            decimals => {
                let scale = 10u32.pow(u32::from(decimals.min(9)));
                let (whole, part) = (magnitude / scale, magnitude % scale);
                write!(f, "{sign}{whole}.{part:0width$}", width = usize::from(decimals))
            }
        }
    }
}

/// Why a text is no value of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ValueError {
    /// Neither a number nor, for a characteristic, one of its choices.
    #[error("{entry}: {} expected", Expected { entry: *.entry, decimals: *.decimals })]
    NotANumber {
        /// The parameter.
        entry: Entry,
        /// Digits after the point that its values have.
        decimals: u8,
    },
    /// More digits after the point than the parameter has.
    #[error("{entry}: at most {decimals} digits after the decimal point")]
    Decimals {
        /// The parameter.
        entry: Entry,
        /// Digits that it has.
        decimals: u8,
    },
    /// A number that does not fit 32 bits.
    #[error("{entry}: the number is too large")]
    TooLarge {
        /// The parameter.
        entry: Entry,
    },
    /// Outside of the range.
    #[error("{entry}: {value} is out of range, {} expected", Expected { entry: *.entry, decimals: value.decimals })]
    Range {
        /// The parameter.
        entry: Entry,
        /// The value given.
        value: Formatted,
    },
    /// A choice that the parameter does not take.
    #[error(transparent)]
    Choice(#[from] RangeError),
}

/// What a parameter takes, in words.
struct Expected {
    entry: Entry,
    decimals: u8,
}

impl fmt::Display for Expected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { entry, decimals } = *self;
        if entry.choices().is_empty() {
            let bound = |value| Formatted { entry, value, decimals };
            return write!(f, "{} to {}", bound(entry.minimum()), bound(entry.maximum()));
        }
        let allowed = entry.choices().iter().zip(0..).filter(|(_, value)| entry.allows(*value));
        for (position, (choice, _)) in allowed.enumerate() {
            write!(f, "{}{:?}", if position == 0 { "" } else { ", " }, choice.text)?;
        }
        Ok(())
    }
}

impl Entry {
    /// A choice by its text, as of a parameter whose display has no point.
    pub(super) const fn chosen(&self, value: i32) -> Formatted {
        Formatted { entry: *self, value, decimals: 0 }
    }

    /// What a characteristic takes.
    pub(super) const fn takes(&self) -> impl fmt::Display {
        Expected { entry: *self, decimals: 0 }
    }

    /// The value as people read it; `values` hold the display's decimal point.
    #[must_use]
    pub fn format(&self, value: i32, values: &Values) -> Formatted {
        Formatted { entry: *self, value, decimals: self.decimals(values) }
    }

    /// Understands what [`format`](Self::format) writes, and more: a choice by its text (in any case)
    /// or number, a value with fewer digits after the point than it has. Exact: no digit is rounded.
    ///
    /// # Errors
    /// [`ValueError`] says what is wrong with the text, or what range the parameter has.
    pub fn parse(&self, text: &str, values: &Values) -> Result<i32, ValueError> {
        let text = text.trim();
        // Several choices of one row may have the same text ("-" on CAN 2): one that it takes, if any.
        let named =
            |value: &i32| self.choice(*value).is_some_and(|choice| choice.text.eq_ignore_ascii_case(text));
        let choices = 0..self.choices().len() as i32;
        let value = match choices.clone().filter(named).find(|value| self.allows(*value)) {
            Some(value) => value,
            None if self.choices().is_empty() => self.number(text, self.decimals(values))?,
            None => match choices.clone().find(named) {
                Some(value) => value,
                None => self.number(text, 0)?,
            },
        };
        if self.allows(value) {
            Ok(value)
        } else if (self.minimum()..=self.maximum()).contains(&value) {
            Err(RangeError::Choice { entry: *self, value }.into())
        } else {
            Err(ValueError::Range { entry: *self, value: self.format(value, values) })
        }
    }

    fn number(&self, text: &str, decimals: u8) -> Result<i32, ValueError> {
        let wrong = ValueError::NotANumber { entry: *self, decimals };
        let (negative, digits) = match text.strip_prefix('-') {
            Some(digits) => (true, digits),
            None => (false, text.strip_prefix('+').unwrap_or(text)),
        };
        let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
        if whole.is_empty() && part.is_empty() {
            return Err(wrong);
        }
        if part.len() > usize::from(decimals) {
            return Err(ValueError::Decimals { entry: *self, decimals });
        }
        let zeros = core::iter::repeat_n(b'0', usize::from(decimals) - part.len());
        let mut value = 0i64;
        for digit in whole.bytes().chain(part.bytes()).chain(zeros) {
            if !digit.is_ascii_digit() {
                return Err(wrong);
            }
            value = value * 10 + i64::from(digit - b'0');
            if value > 1 << 32 {
                return Err(ValueError::TooLarge { entry: *self });
            }
        }
        i32::try_from(if negative { -value } else { value })
            .map_err(|_| ValueError::TooLarge { entry: *self })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::{get, iter};
    use alloc::string::ToString;

    #[test]
    fn decimal_points_are_exact() {
        let mut values = Values::factory();
        let (acceleration, gate, speed) = (get(654).unwrap(), get(42).unwrap(), get(642).unwrap());
        assert_eq!(acceleration.format(500, &values).to_string(), "0.500");
        assert_eq!(acceleration.parse("0.5", &values), Ok(500));
        assert_eq!(acceleration.parse(".5", &values), Ok(500));
        assert_eq!(acceleration.parse("9.999", &values), Ok(9999));
        assert_eq!(gate.parse("1.00", &values), Ok(100));
        assert_eq!(speed.format(3_276_800, &values).to_string(), "3276800");
        // The display's decimal point of axis 1 is [026].
        values.set(26, 2).unwrap();
        assert_eq!(speed.format(5083, &values).to_string(), "50.83");
        assert_eq!(speed.parse("50.83", &values), Ok(5083));
        assert_eq!(get(930).unwrap().format(-5, &values).to_string(), "-0.05");
        assert_eq!(get(930).unwrap().parse("-0.05", &values), Ok(-5));
    }

    /// Of an input, an output, an axis: each its own.
    #[test]
    fn parameters_013_020_and_026_place_the_decimal_point() {
        for (point, first) in [(13, 247), (20, 516), (26, 930)] {
            for instance in 0..3 {
                let mut values = Values::factory();
                values.set(point + instance, 3).unwrap();
                let shown = |at: u16| get(first + at).unwrap().format(12_345, &values).to_string();
                for at in 0..3 {
                    let expected = if at == instance { "12.345" } else { "12345" };
                    assert_eq!(shown(at), expected, "[{:03}] with [{:03}]", first + at, point + instance);
                }
            }
        }
    }

    #[test]
    fn errors_say_what_the_parameter_takes() {
        let values = Values::factory();
        let say = |index, text| get(index).unwrap().parse(text, &values).unwrap_err().to_string();
        assert_eq!(
            say(642, "3276801"),
            "[642] V max., Axis 1: 3276801 is out of range, 0 to 3276800 expected"
        );
        assert_eq!(
            say(654, "0.0005"),
            "[654] t max. acceleration, Axis 1: at most 3 digits after the decimal point"
        );
        assert_eq!(say(642, "fast"), "[642] V max., Axis 1: 0 to 3276800 expected");
        assert_eq!(say(642, ""), "[642] V max., Axis 1: 0 to 3276800 expected");
        assert_eq!(
            say(654, "70"),
            "[654] t max. acceleration, Axis 1: 70.000 is out of range, 0.000 to 9.999 expected"
        );
        assert_eq!(say(108, "on"), "[108] State, Actual value input 2: \"Inactive\", \"Active\" expected");
        assert_eq!(say(642, "99999999999999999999"), "[642] V max., Axis 1: the number is too large");
        assert_eq!(say(642, "5-3"), "[642] V max., Axis 1: 0 to 3276800 expected");
        assert_eq!(
            say(103, "incremental"),
            "[103] Type, Actual value input 4: Incremental cannot be selected here, \
             \"CAN bus\", \"Virtual1\", \"Virtual2\", \"Analog\" expected"
        );
    }

    #[test]
    fn every_value_comes_back_from_its_text() {
        let values = Values::factory();
        for entry in iter() {
            for value in [entry.minimum(), entry.default(), entry.maximum()] {
                if entry.allows(value) && entry.choice(value).is_none_or(|choice| choice.text != "-") {
                    assert_eq!(
                        entry.parse(&entry.format(value, &values).to_string(), &values),
                        Ok(value),
                        "{entry}"
                    );
                    assert_eq!(
                        entry.parse(&alloc::format!(" {value}"), &Values::factory()).is_ok(),
                        entry.decimals(&values) == 0
                            || value == 0
                            || entry.allows(value * 10i32.pow(u32::from(entry.decimals(&values)))),
                        "{entry}"
                    );
                }
            }
        }
        assert_eq!(get(7).unwrap().parse("19200 bd", &values), Ok(1));
        assert_eq!(get(7).unwrap().parse("4", &values), Ok(4));
    }
}
