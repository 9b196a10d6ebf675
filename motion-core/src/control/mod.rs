//! The control cycle (manual A 1.4, 6.3.1, 7.2): read inputs → actual values → axes → nominal values →
//! application → outputs, every 1 ms × activated axes.

mod axis;
mod settings;

pub(crate) use axis::ActualSource;
pub use axis::{AxisControl, AxisInput, AxisOutput, PlcStop};

use lb2::code::{Failure, StoredFailure};

use crate::Model;
use crate::application::{Application, AxisAccess, AxisStatus, Plc, Progress};
use crate::bus::CanBus;
use crate::failure;
use crate::input::{self, ActualValue, ActualValueInput, AxisQuantities, Kind, Reading, Sources};
use crate::io::{
    AnalogInputs, DigitalInputs, DigitalOutputs, FieldBus, Inputs, Outputs, ProcessImage, Pwm, Terminal,
};
use crate::output::{self, Command, DriveSetpoint, Nominal, NominalValueOutput};
use crate::parameters::Values;
use settings::{AxisRoute, Settings};

/// Axes, actual value inputs and nominal value outputs.
const COUNT: usize = 6;
/// Objects that drives can be behind: CAN 1 IN/OUT 1 and 2, CAN 2 IN/OUT 1…4, by place.
pub const DRIVES: usize = 6;

/// What drives on the CAN buses bring for one cycle, by place of their object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DriveInputs {
    /// Positions, 24 bits, 2^20 a turn; `None` while there is no data.
    pub positions: [Option<u32>; DRIVES],
    /// What failed in this cycle, by object IN: a drive lost, or its own fault.
    pub input_failures: [Option<Failure>; DRIVES],
    /// The same, by object OUT.
    pub output_failures: [Option<Failure>; DRIVES],
}

/// What is put out in one cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub struct CycleOutputs {
    /// The terminals.
    pub terminals: Outputs,
    /// Set values of the drives behind CAN 1 OUT 1, OUT 2, CAN 2 OUT 1…OUT 4, by place.
    pub drives: [Option<DriveSetpoint>; DRIVES],
}

/// All that is between inputs and outputs. `A` controls one axis.
#[derive(Debug, Clone)]
pub struct Control<A> {
    model: Model,
    settings: Settings,
    analog: AnalogInputs,
    inputs: [ActualValueInput; COUNT],
    values: [ActualValue; COUNT],
    axes: [A; COUNT],
    access: [AxisAccess; COUNT],
    /// Set values for inputs of type Virtual2.
    quantities: [AxisQuantities; COUNT],
    /// Whether an axis waits for its reference point, by axis.
    armed: [bool; COUNT],
    /// Whether an axis has lost its drive to other parameters, by axis: until the next cycle.
    lost: [bool; COUNT],
    /// What SetPosition moved on axes that have no actual value input.
    shifts: [i32; COUNT],
    /// Steps at position 0 of axes whose actual value is a stepper motor's clock.
    origins: [i32; COUNT],
    outputs: [NominalValueOutput; COUNT],
    digital: DigitalOutputs,
    pwm: [Pwm; 3],
    bus: ProcessImage,
    running: bool,
}

impl<A: AxisControl + Default> Control<A> {
    /// A controller as it is switched on, with the internal offsets X of its inputs.
    #[must_use]
    pub fn new(model: Model, values: &Values, offsets: [i32; COUNT]) -> Self {
        let mut at = 0;
        let inputs = offsets.map(|offset| {
            let settings = input::Settings::read(values, at);
            at += 1;
            ActualValueInput::new(settings, offset)
        });
        let mut control = Self {
            model,
            settings: Settings::read(values),
            analog: AnalogInputs::default(),
            inputs,
            values: Default::default(),
            axes: Default::default(),
            access: Default::default(),
            quantities: Default::default(),
            armed: [false; COUNT],
            lost: [false; COUNT],
            shifts: [0; COUNT],
            origins: [0; COUNT],
            outputs: core::array::from_fn(|at| {
                NominalValueOutput::new(at, output::Settings::read(values, at))
            }),
            digital: DigitalOutputs::default(),
            pwm: Default::default(),
            bus: ProcessImage::default(),
            running: false,
        };
        control.configure(values);
        control
    }

    /// Takes over parameters; everything may change while running.
    pub fn configure(&mut self, values: &Values) {
        self.settings = Settings::read(values);
        self.analog.configure(self.model, values);
        for (at, input) in self.inputs.iter_mut().enumerate() {
            input.configure(input::Settings::read(values, at));
        }
        for (at, output) in self.outputs.iter_mut().enumerate() {
            output.configure(output::Settings::read(values, at));
        }
        for (at, axis) in self.axes.iter_mut().enumerate() {
            let (access, route) = (self.access.get_mut(at), self.settings.axes.get(at));
            let activated = route.is_some_and(Option::is_some);
            // An axis that was taken out of use begins anew.
            if let Some(access) = access
                && core::mem::replace(&mut access.activated, activated)
                && !activated
            {
                *axis = A::default();
            }
            axis.configure(values, at, self.settings.cycle);
        }
    }

    /// The drives behind these objects OUT, by place, are not there any more: an enabled axis that has one
    /// fails in the next cycle.
    pub fn lose_drives(&mut self, drives: &[bool; DRIVES]) {
        let axes = self.settings.axes.iter().zip(&self.access);
        for (lost, (route, access)) in self.lost.iter_mut().zip(axes) {
            let drive = route.and_then(AxisRoute::writes);
            *lost |= access.power && drive.and_then(|drive| drives.get(drive)) == Some(&true);
        }
    }

    /// Length of a cycle, ms: 1 × activated axes, `[000]`.
    #[must_use]
    pub const fn cycle_time(&self) -> u16 {
        self.settings.cycle
    }

    /// Internal offsets X of all inputs, which are to survive a loss of power.
    #[must_use]
    pub fn offsets(&self) -> [i32; COUNT] {
        self.inputs.each_ref().map(ActualValueInput::offset)
    }

    /// Values of the actual value inputs in the last cycle.
    #[must_use]
    pub const fn actual_values(&self) -> &[ActualValue; COUNT] {
        &self.values
    }

    /// Status of an axis, 0…5, after the last cycle.
    #[must_use]
    pub fn status(&self, axis: usize) -> Option<&AxisStatus> {
        self.access.get(axis).map(AxisAccess::status)
    }

    /// An axis, 0…5, to be moved by hand from outside of the application (4.3.2).
    pub fn access(&mut self, axis: usize) -> Option<&mut AxisAccess> {
        self.access.get_mut(axis)
    }

    /// Whether the application runs.
    #[must_use]
    pub const fn is_running(&self) -> bool {
        self.running
    }

    /// Exchanges the process image with the field bus in the extension slot.
    pub fn exchange(&mut self, bus: &mut impl FieldBus, values: &Values) {
        self.bus.configure(bus.kind(), values);
        self.bus.exchange(bus);
    }

    /// One cycle.
    pub fn cycle(
        &mut self,
        inputs: &Inputs,
        drives: &DriveInputs,
        buses: &mut [CanBus; 2],
        application: &mut impl Application,
        mut log: impl FnMut(StoredFailure),
    ) -> CycleOutputs {
        let cycle = self.settings.cycle;
        let digital = inputs.digital.of(self.model);
        self.analog.cycle(cycle, &inputs.analog);
        let stop = self.plc_run(digital);
        self.read_inputs(inputs, digital, drives);
        let mut commands: [Option<(Command, bool)>; COUNT] = Default::default();
        self.quantities.iter_mut().for_each(|own| own.shift = 0);
        for at in 0..COUNT {
            let (Some(axis), Some(access), Some(&route)) =
                (self.axes.get_mut(at), self.access.get_mut(at), self.settings.axes.get(at))
            else {
                continue;
            };
            let Some(route) = route else {
                access.deactivate();
                self.armed.get_mut(at).map(core::mem::take);
                continue;
            };
            let input = AxisInput {
                actual: match route.source {
                    ActualSource::Input(input) => {
                        self.values.get(usize::from(input)).copied().unwrap_or_default()
                    }
                    ActualSource::Stepper | ActualSource::Virtual | ActualSource::None => ActualValue {
                        position: self
                            .quantities
                            .get(at)
                            .map_or(0, |own| own.steps)
                            .wrapping_sub(self.origins.get(at).copied().unwrap_or(0)),
                        shift: self.shifts.get_mut(at).map_or(0, core::mem::take),
                        reading: Reading::Real,
                        ..ActualValue::default()
                    },
                },
                digital,
                power: access.power,
                held: access.held,
                reset: core::mem::take(&mut access.reset),
                order: access.take(),
                stop,
                failure: if self.lost.get_mut(at).is_some_and(core::mem::take) {
                    Some(failure::DRIVE_LOST)
                } else {
                    route.failure(drives)
                },
            };
            let output = axis.cycle(&input, &self.values);
            let number = at as u8 + 1;
            for failure in [input.actual.failure, output.failure].into_iter().flatten() {
                log(StoredFailure { axis: number, failure });
            }
            access.set_status(output.status);
            if let Some(error) = output.refused {
                access.refuse(error);
            }
            if let Some(progress) = output.ended {
                access.end(progress);
            }
            if let Some(armed) = self.armed.get_mut(at) {
                *armed = output.armed;
            }
            if let Some(slot) = route.output.and_then(|to| commands.get_mut(to)) {
                // Of several axes on one output, the first has it (project-defined).
                slot.get_or_insert((output.command, input.reset));
            }
            if let Some(own) = self.quantities.get_mut(at) {
                own.position = output.status.nominal_position;
                own.shift = input.actual.shift;
                own.velocity = libm::round(output.status.nominal_velocity) as i32;
            }
        }
        self.log_inputs_without_axis(&mut log);
        let (mut put, drives) = self.put_out(&commands);
        if self.running {
            self.run(application, digital, buses);
        } else {
            self.digital.write([0; 3]);
            self.pwm = Default::default();
        }
        put.digital = self.digital.linked();
        for ((clock, pulses), taken) in put.pwm.iter_mut().zip(self.pwm).zip(self.settings.steppers) {
            if !taken {
                *clock = pulses;
            }
        }
        CycleOutputs { terminals: put, drives }
    }

    /// Follows PLC Run (I3.7, `[003]`); what the axes are to do when it falls (`[004]`).
    fn plc_run(&mut self, digital: DigitalInputs) -> Option<PlcStop> {
        let run = self.settings.plc && digital.get(Terminal::PLC_RUN);
        let stopped = core::mem::replace(&mut self.running, run) && !run;
        if stopped {
            self.access.iter_mut().for_each(|access| access.drop_waiting(Progress::Aborted));
        }
        self.settings.stop.filter(|_| stopped)
    }

    fn read_inputs(&mut self, inputs: &Inputs, digital: DigitalInputs, drives: &DriveInputs) {
        // What an input takes over from another one is that of this cycle, as far as possible.
        for virtual2 in [false, true] {
            for at in 0..COUNT {
                let Some(input) = self.inputs.get_mut(at) else { continue };
                if matches!(input.settings().kind, Kind::Virtual2 { .. }) != virtual2 {
                    continue;
                }
                let armed = self
                    .settings
                    .axes
                    .iter()
                    .zip(self.armed)
                    .any(|(route, armed)| armed && route.is_some_and(|route| route.is_on(at)));
                let sources = Sources {
                    cycle: self.settings.cycle,
                    encoders: &inputs.encoders,
                    digital,
                    analog: &self.analog,
                    can: drives.positions,
                    inputs: &self.values,
                    axes: &self.quantities,
                };
                let value = input.cycle(&sources, armed);
                if let Some(slot) = self.values.get_mut(at) {
                    *slot = value;
                }
            }
        }
    }

    /// Failures of inputs that belong to no axis are the system's; of what Virtual2 takes over, the source
    /// has told.
    fn log_inputs_without_axis(&self, log: &mut impl FnMut(StoredFailure)) {
        for (at, value) in self.values.iter().enumerate() {
            let used = self.settings.axes.iter().flatten().any(|route| route.is_on(at));
            let kind = self.inputs.get(at).map(|input| input.settings().kind);
            if let Some(failure) = value.failure
                && !used
                && !matches!(kind, Some(Kind::Virtual2 { .. }))
            {
                log(StoredFailure { axis: 0, failure });
            }
        }
    }

    fn put_out(
        &mut self,
        commands: &[Option<(Command, bool)>; COUNT],
    ) -> (Outputs, [Option<DriveSetpoint>; DRIVES]) {
        let mut put = Outputs::default();
        let mut drives = [None; DRIVES];
        self.digital.begin();
        for (at, (output, command)) in self.outputs.iter_mut().zip(commands).enumerate() {
            let (command, reset) = command.unwrap_or_default();
            let nominal: Nominal = output.cycle(&command, self.settings.cycle);
            self.digital.link(at, nominal.bits);
            if let (Some(voltage), Some(slot)) = (nominal.voltage, put.analog.get_mut(at)) {
                *slot = voltage;
            }
            if let (Some(clock), Some(slot)) = (nominal.clock, put.pwm.get_mut(at)) {
                *slot = clock;
            }
            if let Some(drive) = nominal.drive
                && let Some(slot) = drives.get_mut(drive.object)
            {
                *slot = Some(DriveSetpoint { reset, ..drive });
            }
        }
        for (own, route) in self.quantities.iter_mut().zip(&self.settings.axes) {
            let output = route.and_then(|route| self.outputs.get(route.output?));
            own.steps = output.map_or(0, NominalValueOutput::steps);
        }
        (put, drives)
    }

    fn run(&mut self, application: &mut impl Application, digital: DigitalInputs, can: &mut [CanBus; 2]) {
        application.cycle(&mut Plc {
            cycle: self.settings.cycle,
            inputs: digital,
            analog: &self.analog,
            actual: &self.values,
            outputs: &mut self.digital,
            pwm: &mut self.pwm,
            bus: &mut self.bus,
            can,
            axes: &mut self.access,
        });
        for at in 0..COUNT {
            let position = self.access.get_mut(at).and_then(|access| access.set_position.take());
            if let (Some(position), Some(&Some(route))) = (position, self.settings.axes.get(at)) {
                self.set_position(at, route, position);
            }
        }
    }

    fn set_position(&mut self, at: usize, route: AxisRoute, position: i32) {
        if let ActualSource::Input(input) = route.source {
            if let Some(input) = self.inputs.get_mut(usize::from(input)) {
                input.set_position(position);
            }
            return;
        }
        let now = self.access.get(at).map_or(0, |access| access.status().position);
        let moved = position.wrapping_sub(now);
        if let (Some(shift), Some(origin)) = (self.shifts.get_mut(at), self.origins.get_mut(at)) {
            *shift = shift.wrapping_add(moved);
            *origin = origin.wrapping_sub(moved);
        }
    }
}

#[cfg(test)]
mod tests;
