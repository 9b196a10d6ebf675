//! Settings of the cycle: what is activated and how axes, inputs and outputs are assigned, read from the
//! parameters in one place.

use super::COUNT;
use super::axis::PlcStop;
use crate::output::{self, Kind};
use crate::parameters::Values;

/// Where an axis has its actual value from, `[606]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ActualSource {
    None,
    /// Actual value input, by place.
    Input(usize),
    /// The clock pulses of its own output.
    Stepper,
    /// The set value itself.
    Virtual,
}

/// How an activated axis is connected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct AxisRoute {
    pub(super) source: ActualSource,
    /// `[612]`, by place.
    pub(super) output: Option<usize>,
    /// Object of the drive that its output or input uses, by place.
    pub(super) drive: Option<usize>,
}

impl AxisRoute {
    /// Whether its actual value is that of an input, by place.
    pub(super) fn is_on(self, input: usize) -> bool {
        self.source == ActualSource::Input(input)
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
                let drive = output.and_then(|output| match output::Settings::read(values, output).kind {
                    Kind::CanBus { object, .. } => object,
                    _ => None,
                });
                let source = match values.at(606, at) {
                    0 => ActualSource::None,
                    7 => ActualSource::Stepper,
                    8 => ActualSource::Virtual,
                    input => place(input).map_or(ActualSource::None, ActualSource::Input),
                };
                AxisRoute { source, output, drive }
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
