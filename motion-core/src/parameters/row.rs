//! The types of the parameter table.

use lb2::telegram::{MAX_VARIANT, Text};

/// One line of the parameter table: a parameter with all its instances.
#[derive(Debug)]
pub struct Row {
    /// Number of the first instance.
    pub first: u16,
    /// Number of the last instance; the numbers between are the instances in order.
    pub last: u16,
    /// What there are instances of.
    pub family: Family,
    /// Name, at most 20 characters.
    pub name: &'static str,
    /// Sub-menu below the instance's (or, for single parameters, the main) menu; may be empty.
    pub page: &'static str,
    /// Value or characteristic.
    pub kind: Kind,
    /// Factory default.
    pub default: Default,
    /// Clause of manual A.
    pub clause: &'static str,
}

/// What a parameter's instances belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// One value for the whole device.
    Single,
    /// COM 1 and COM 2.
    Com,
    /// Analog inputs 1…7 (I61, I62, I63, I54…I57); 2…7 exist on GEL 8231 and 8236.
    AnalogInput,
    /// CAN 1 and CAN 2.
    Can,
    /// CAN 1: objects IN 1…IN 4, OUT 1…OUT 4.
    Can1Object,
    /// CAN 2: objects IN 1…IN 4, OUT 1…OUT 4.
    Can2Object,
    /// Actual value inputs 1…6.
    Input,
    /// Nominal value outputs 1…6.
    Output,
    /// Axes 1…6.
    Axis,
}

impl Family {
    /// Menu under which all instances stand (manual A 4.3.4.1); of single parameters, decided by
    /// their number.
    pub(super) const fn menu(self, index: u16) -> &'static str {
        match self {
            Self::Single if index < 50 => "Basic settings",
            Self::Single => "Extension module",
            Self::Com => "Basic settings",
            Self::AnalogInput => "Analog inputs",
            Self::Can | Self::Can1Object | Self::Can2Object => "CAN bus",
            Self::Input => "Actual value inputs",
            Self::Output => "Nominal value outputs",
            Self::Axis => "Axes configuration",
        }
    }

    /// Menu of each instance, at most 25 characters: the group of 31h.
    pub(super) const fn labels(self) -> &'static [&'static str] {
        match self {
            Self::Single => &[],
            Self::Com => &["COM 1", "COM 2"],
            Self::AnalogInput => &[
                "Analog input 1",
                "Analog input 2",
                "Analog input 3",
                "Analog input 4",
                "Analog input 5",
                "Analog input 6",
                "Analog input 7",
            ],
            Self::Can => &["CAN 1", "CAN 2"],
            Self::Can1Object => &[
                "CAN 1 Object/PDO IN 1",
                "CAN 1 Object/PDO IN 2",
                "CAN 1 Object/PDO IN 3",
                "CAN 1 Object/PDO IN 4",
                "CAN 1 Object/PDO OUT 1",
                "CAN 1 Object/PDO OUT 2",
                "CAN 1 Object/PDO OUT 3",
                "CAN 1 Object/PDO OUT 4",
            ],
            Self::Can2Object => &[
                "CAN 2 Object/PDO IN 1",
                "CAN 2 Object/PDO IN 2",
                "CAN 2 Object/PDO IN 3",
                "CAN 2 Object/PDO IN 4",
                "CAN 2 Object/PDO OUT 1",
                "CAN 2 Object/PDO OUT 2",
                "CAN 2 Object/PDO OUT 3",
                "CAN 2 Object/PDO OUT 4",
            ],
            Self::Input => &[
                "Actual value input 1",
                "Actual value input 2",
                "Actual value input 3",
                "Actual value input 4",
                "Actual value input 5",
                "Actual value input 6",
            ],
            Self::Output => &[
                "Nominal value output 1",
                "Nominal value output 2",
                "Nominal value output 3",
                "Nominal value output 4",
                "Nominal value output 5",
                "Nominal value output 6",
            ],
            Self::Axis => &["Axis 1", "Axis 2", "Axis 3", "Axis 4", "Axis 5", "Axis 6"],
        }
    }
}

/// What kind of parameter it is (manual A 6.1).
#[derive(Debug, Clone, Copy)]
pub enum Kind {
    /// A number, entered and shown with a decimal point, stored in display units without it.
    Value {
        /// Least value, display units.
        minimum: i32,
        /// Greatest value, display units.
        maximum: i32,
        /// Unit of the value as displayed; may be empty.
        unit: &'static str,
        /// Digits after the point.
        decimals: Decimals,
    },
    /// A characteristic: the value is the number of the choice, from 0.
    Choice(&'static [Choice]),
}

/// Where the digits after the decimal point come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Decimals {
    /// Always so many.
    Fixed(u8),
    /// As many as the parameter "Display decimal pnt." of the same instance says; this is the number
    /// of its first instance: `[013]`, `[020]` or `[026]`.
    As(u16),
}

/// Factory default.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Default {
    /// The same for every instance.
    Same(i32),
    /// One for each instance.
    Each(&'static [i32]),
}

/// One choice of a characteristic.
#[derive(Debug, PartialEq, Eq)]
pub struct Choice {
    /// As manual A prints it.
    pub text: &'static str,
    variant: [u8; MAX_VARIANT],
}

impl Choice {
    /// As the device displays it and 31h sends it: upper case, at most 8 characters (which letters
    /// of a longer text are dropped is project-defined: those after the eighth).
    #[must_use]
    pub fn variant(&self) -> Text<'_> {
        Text::new(&self.variant)
    }
}

pub(super) const fn choice(text: &'static str) -> Choice {
    let bytes = text.as_bytes();
    let mut variant = [0; MAX_VARIANT];
    let mut at = 0;
    while at < bytes.len() && at < MAX_VARIANT {
        variant[at] = bytes[at].to_ascii_uppercase();
        at += 1;
    }
    Choice { text, variant }
}
