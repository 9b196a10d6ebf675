//! Settings of the cycle: what is activated and how axes, inputs and outputs are assigned, read from the
//! parameters in one place.

use lb2::code::Failure;

use super::axis::{ActualSource, PlcStop};
use super::{COUNT, DRIVES, DriveInputs};
use crate::parameters::Values;
use crate::{input, output};

/// How an activated axis is connected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct AxisRoute {
    pub(super) source: ActualSource,
    /// `[612]`, by place.
    pub(super) output: Option<usize>,
    /// Objects of the drives that its input and output use, by place.
    drives: (Option<usize>, Option<usize>),
}

impl AxisRoute {
    /// Whether its actual value is that of an input, by place.
    pub(super) fn is_on(self, input: usize) -> bool {
        matches!(self.source, ActualSource::Input(own) if usize::from(own) == input)
    }

    /// Object OUT of the drive that its output has, by place.
    pub(super) const fn writes(self) -> Option<usize> {
        self.drives.1
    }

    /// What failed of its drives.
    pub(super) fn failure(self, inputs: &DriveInputs) -> Option<Failure> {
        let (reads, writes) = self.drives;
        let failed = |failures: &[Option<Failure>; DRIVES], at: Option<usize>| {
            at.and_then(|at| failures.get(at).copied().flatten())
        };
        failed(&inputs.output_failures, writes).or_else(|| failed(&inputs.input_failures, reads))
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Settings {
    /// ms.
    pub(super) cycle: u16,
    /// `[003]`.
    pub(super) plc: bool,
    /// `[004]`.
    pub(super) stop: Option<PlcStop>,
    /// Of the axes that are activated and controlled.
    pub(super) axes: [Option<AxisRoute>; COUNT],
    /// Whether C of E1…E3 belongs to a stepper motor.
    pub(super) steppers: [bool; 3],
}

impl Settings {
    pub(super) fn read(values: &Values) -> Self {
        let activated = usize::try_from(values.at(0, 0)).unwrap_or(0).min(COUNT);
        let place = |choice: i32| usize::try_from(choice - 1).ok();
        let axis = |at: usize| {
            let controlled = at < activated && values.at(600, at) != 0;
            controlled.then(|| {
                let output = place(values.at(612, at));
                let writes = output.and_then(|output| match output::Settings::read(values, output).kind {
                    output::Kind::CanBus { object, .. } => object,
                    _ => None,
                });
                let source = ActualSource::from_choice(values.at(606, at));
                let reads = match source {
                    ActualSource::Input(input) => match input::Settings::read(values, input.into()).kind {
                        input::Kind::Can { object } => object,
                        _ => None,
                    },
                    _ => None,
                };
                AxisRoute { source, output, drives: (reads, writes) }
            })
        };
        Self {
            cycle: (activated as u16).max(1),
            plc: values.at(3, 0) == 0,
            stop: match values.at(4, 0) {
                1 => Some(PlcStop::Control),
                2 => Some(PlcStop::Regulate),
                _ => None,
            },
            axes: core::array::from_fn(axis),
            steppers: core::array::from_fn(|at| values.at(450, at) == 4),
        }
    }
}
