//! The cycle with axes that a script plays: what `[000]`…`[004]`, `[600]`, `[606]` and `[612]` do.

use super::*;
use crate::application::{Order, State};
use crate::failure;
use crate::input::Encoder;
use std::vec::Vec;

/// An axis that does at once what it is told, and remembers what it was given.
#[derive(Debug, Clone, Default)]
struct Puppet {
    seen: Vec<AxisInput>,
    velocity: i32,
    maximum: f64,
    cycle: u16,
}

impl AxisControl for Puppet {
    fn configure(&mut self, values: &Values, at: usize, cycle: u16) {
        self.maximum = f64::from(values.at(642, at));
        self.cycle = cycle;
    }

    fn cycle(&mut self, input: &AxisInput, _inputs: &[ActualValue; 6]) -> AxisOutput {
        self.seen.push(*input);
        match input.order {
            Some(Order::MoveVelocity { velocity }) => self.velocity = velocity,
            Some(_) => self.velocity = 0,
            None => {}
        }
        let status = AxisStatus {
            state: if input.power { State::Standstill } else { State::Disabled },
            position: input.actual.position,
            nominal_position: 1000 + input.actual.position,
            nominal_velocity: f64::from(self.velocity),
            ..AxisStatus::default()
        };
        let command = Command {
            velocity: f64::from(self.velocity),
            maximum: self.maximum,
            enable: input.power,
            ..Command::default()
        };
        AxisOutput { command, status, armed: input.power, ..AxisOutput::default() }
    }
}

struct Rig {
    values: Values,
    control: Control<Puppet>,
    inputs: Inputs,
    drives: DriveInputs,
    buses: [CanBus; 2],
    log: Vec<StoredFailure>,
}

fn rig(model: Model, changes: &[(u16, i32)]) -> Rig {
    let mut values = Values::factory();
    for &(index, value) in changes {
        values.set(index, value).unwrap();
    }
    let mut inputs = Inputs::default();
    inputs.digital.set(Terminal::PLC_RUN, true);
    Rig {
        control: Control::new(model, &values, [0; COUNT]),
        buses: [0, 1].map(|at| CanBus::new(model.number(), &values, at)),
        values,
        inputs,
        drives: DriveInputs::default(),
        log: Vec::new(),
    }
}

impl Rig {
    fn cycle(&mut self, application: impl FnMut(&mut Plc<'_>)) -> CycleOutputs {
        let mut application = application;
        self.control.cycle(&self.inputs, &self.drives, &mut self.buses, &mut application, |failure| {
            self.log.push(failure);
        })
    }

    fn idle(&mut self) -> CycleOutputs {
        self.cycle(|_| {})
    }

    /// Powers an axis and gives it a velocity.
    fn drive(&mut self, axis: u8, velocity: i32) -> CycleOutputs {
        self.cycle(|plc| plc.axis(axis).unwrap().set_power(true).unwrap());
        self.idle();
        self.cycle(|plc| {
            plc.axis(axis).unwrap().order(Order::MoveVelocity { velocity }).unwrap();
        });
        self.idle()
    }

    fn last(&self, axis: usize) -> AxisInput {
        *self.control.axes[axis].seen.last().unwrap()
    }
}

/// `[000]`: 1 ms an axis; axes beyond are not controlled.
#[test]
fn parameter_000_is_the_activated_axes_and_the_cycle() {
    for activated in 0..=6u16 {
        let mut rig = rig(Model::Gel8230, &[(0, i32::from(activated)), (603, 1), (604, 1), (605, 1)]);
        rig.idle();
        assert_eq!(rig.control.cycle_time(), activated.max(1));
        let cycled = rig.control.axes.iter().filter(|axis| !axis.seen.is_empty()).count();
        assert_eq!(cycled, usize::from(activated));
        assert!(rig.control.axes.iter().all(|axis| axis.cycle == activated.max(1)));
    }
}

/// `[003]`: Yes = I3.7 runs the application; No = it never runs.
#[test]
fn parameter_003_lets_plc_run_start_the_application() {
    let runs = |choice, high| {
        let mut rig = rig(Model::Gel8230, &[(3, choice)]);
        rig.inputs.digital.set(Terminal::PLC_RUN, high);
        let mut runs = 0;
        rig.cycle(|_| runs += 1);
        (runs, rig.control.is_running())
    };
    assert_eq!([runs(0, true), runs(0, false), runs(1, true)], [(1, true), (0, false), (0, false)]);
}

/// `[004]`: told to every axis in the cycle in which I3.7 falls, once.
#[test]
fn parameter_004_is_the_stop_with_the_application() {
    for (choice, stop) in [(0, None), (1, Some(PlcStop::Control)), (2, Some(PlcStop::Regulate))] {
        let mut rig = rig(Model::Gel8230, &[(4, choice)]);
        rig.idle();
        rig.inputs.digital.set(Terminal::PLC_RUN, false);
        rig.idle();
        assert_eq!([0, 1, 2].map(|axis| rig.last(axis).stop), [stop; 3]);
        rig.idle();
        assert_eq!(rig.last(0).stop, None);
    }
}

/// A stopped application's outputs fall, and its orders do not come late.
#[test]
fn what_a_stopped_application_put_out_is_gone() {
    let mut rig = rig(Model::Gel8230, &[]);
    let on = rig.cycle(|plc| {
        plc.outputs.set(3, 0, true);
        plc.pwm[1] = Pwm::clock(1, 50_000);
        plc.axis(1).unwrap().set_power(true).unwrap();
    });
    assert_eq!((on.terminals.digital, on.terminals.pwm[1].frequency()), ([0, 0, 1], 50_000));
    let mut given = None;
    rig.cycle(|plc| given = plc.axis(1).unwrap().order(Order::Home).ok());
    assert!(given.is_some());
    rig.inputs.digital.set(Terminal::PLC_RUN, false);
    let off = rig.idle();
    assert_eq!((off.terminals.digital, off.terminals.pwm[1].frequency()), ([0; 3], 0));
    assert_eq!(rig.last(0).order, None);
}

/// `[600]`: None leaves the axis out.
#[test]
fn parameter_600_none_leaves_the_axis_out() {
    let mut rig = rig(Model::Gel8230, &[(601, 0)]);
    let mut refused = None;
    rig.cycle(|plc| refused = Some(plc.axis(2).unwrap().set_power(true)));
    assert_eq!(refused, Some(Err(crate::application::MotionError::NO_AXIS)));
    assert_eq!([0, 1, 2].map(|axis| rig.control.axes[axis].seen.len()), [1, 0, 1]);
}

/// `[606]`: an input, the clock of its own output, or nothing.
#[test]
fn parameter_606_is_the_actual_value_of_the_axis() {
    let steppers = [(450, 4), (540, 1000), (642, 1000)];
    let position = |choice| {
        let mut rig = rig(Model::Gel8230, &[&steppers[..], &[(606, choice)]].concat());
        for (at, encoder) in rig.inputs.encoders.iter_mut().enumerate() {
            encoder.count = 10 * (at as i32 + 1);
        }
        rig.drive(1, 500);
        // 500 Hz for two cycles of 3 ms before it is read in the third.
        rig.idle();
        rig.idle();
        rig.last(0).actual.position
    };
    assert_eq!([0, 1, 2, 3].map(position), [3, 10, 20, 30]);
    assert_eq!(position(7), 3);
}

/// SetPosition goes to the input, or to the axis that has none.
#[test]
fn a_set_position_moves_the_scale() {
    for source in [1, 7, 8] {
        let mut rig = rig(Model::Gel8230, &[(606, source)]);
        rig.inputs.encoders[0].count = 500;
        rig.idle();
        let before = rig.last(0).actual.position;
        rig.cycle(|plc| plc.axis(1).unwrap().set_position(70).unwrap());
        rig.idle();
        let actual = rig.last(0).actual;
        assert_eq!((actual.position, actual.shift), (70, 70 - before), "{source}");
        rig.idle();
        assert_eq!((rig.last(0).actual.position, rig.last(0).actual.shift), (70, 0));
    }
}

/// `[612]`: the output that the axis commands; of two axes on one output the first has it.
#[test]
fn parameter_612_is_the_output_of_the_axis() {
    for choice in 0..=3usize {
        let mut rig = rig(Model::Gel8230, &[(642, 1000), (612, choice as i32), (613, 0), (614, 0)]);
        let mut expected = [0; 3];
        if let Some(place) = choice.checked_sub(1) {
            expected[place] = 5_000;
        }
        assert_eq!(rig.drive(1, 500).terminals.analog, expected);
    }
    let mut rig = rig(Model::Gel8230, &[(642, 1000), (643, 1000), (613, 1)]);
    rig.drive(1, 500);
    assert_eq!(rig.drive(2, -500).terminals.analog, [5_000, 0, 0]);
}

/// 6.6.1.5: an input takes over another one's value of the same cycle, and an axis' of the last one.
#[test]
fn virtual2_follows_inputs_at_once_and_axes_a_cycle_later() {
    let mut rig = rig(Model::Gel8230, &[(100, 4), (163, 2), (102, 4), (158, 2), (165, 2)]);
    rig.inputs.encoders[1].count = 42;
    rig.idle();
    assert_eq!(rig.control.actual_values().map(|value| value.position), [42, 42, 0, 0, 0, 0]);
    rig.inputs.encoders[1].count = 50;
    rig.idle();
    assert_eq!(rig.control.actual_values().map(|value| value.position), [50, 50, 1042, 0, 0, 0]);
}

/// 6.8.1, `[606]`: an input failure is logged with its axis in the same cycle, one without axis as 0.
#[test]
fn failures_are_logged_with_their_axis() {
    let mut rig = rig(Model::Gel8230, &[(608, 0)]);
    rig.idle();
    rig.inputs.encoders[1].fault = true;
    rig.inputs.encoders[2].fault = true;
    rig.idle();
    let lost = |axis| StoredFailure { axis, failure: failure::READING_LOST };
    assert_eq!(rig.log, [lost(2), lost(0)]);
    assert_eq!(rig.last(1).actual.reading, Reading::Lost);
    rig.idle();
    assert_eq!(rig.log.len(), 2);
}

/// A drive behind a CAN object: its position comes in, its set value goes out, its failure stops the axis.
#[test]
fn drives_are_joined_to_axes() {
    let changes = [(100, 2), (450, 2), (642, 3_276_800), (0, 2), (109, 0)];
    let mut rig = rig(Model::Gel8230, &changes);
    rig.drives.positions[2] = Some(1234 << 4);
    let put = rig.drive(1, 3_276_800);
    assert_eq!(put.drives[2], Some(DriveSetpoint { object: 2, speed: 419_430, enable: true, reset: false }));
    assert_eq!(rig.last(0).actual.position, 1234);
    rig.drives.output_failures[2] = Some(failure::DRIVE_LOST);
    rig.idle();
    assert_eq!(rig.last(0).failure, Some(failure::DRIVE_LOST));
    assert_eq!(rig.last(1).failure, None);
}

/// 6.7.1.3: the operating system's signals and the application's on one terminal.
#[test]
fn real_time_signals_and_the_application_are_or_linked() {
    let mut rig = rig(Model::Gel8230, &[(546, 3), (642, 1000)]);
    rig.drive(1, 500);
    let put = rig.cycle(|plc| plc.outputs.write([0b00011, 0, 0]));
    assert_eq!(put.terminals.digital, [0b00111, 0, 0]);
}

/// 3.7, 6.7.1.4: a stepper motor's clock has its terminal for itself.
#[test]
fn pulses_of_the_application_leave_the_clock_alone() {
    let mut rig = rig(Model::Gel8230, &[(450, 4), (540, 1000), (642, 1000)]);
    rig.drive(1, 500);
    let put = rig.cycle(|plc| *plc.pwm = [Pwm::clock(0, 9_000), Pwm::clock(1, 9_000), Pwm::default()]);
    assert_eq!(put.terminals.pwm.map(Pwm::frequency), [500_000, 9_000, 0]);
}

/// 3.8, 7.2: I4 is there on GEL 8231 and 8236 only.
#[test]
fn models_have_their_inputs() {
    for model in Model::ALL {
        let mut rig = rig(model, &[]);
        rig.inputs.digital.set(Terminal::new(4, 2).unwrap(), true);
        let mut seen = 0;
        rig.cycle(|plc| seen = plc.inputs.blocks()[3]);
        assert_eq!(seen, if model.has_extra_inputs() { 4 } else { 0 }, "{model:?}");
    }
}

/// Nothing is left of what it was: neither state nor order nor enable.
#[test]
fn an_axis_that_is_taken_out_of_use_is_disabled() {
    let mut rig = rig(Model::Gel8230, &[(642, 1000)]);
    rig.drive(1, 500);
    let order = Order::MoveVelocity { velocity: 400 };
    let ticket = rig.control.access(0).unwrap().order(order).unwrap();
    rig.values.set(600, 0).unwrap();
    rig.control.configure(&rig.values);
    rig.idle();
    assert_eq!(rig.control.status(0), Some(&AxisStatus::default()));
    assert_eq!(rig.control.access(0).unwrap().progress(ticket), Progress::Aborted);
    rig.values.set(600, 1).unwrap();
    rig.control.configure(&rig.values);
    rig.idle();
    assert!(!rig.last(0).power && rig.last(0).order.is_none());
}

/// Everything can change at run time: an axis is taken out and comes back where it is, not enabled.
#[test]
fn parameters_change_while_running() {
    let mut rig = rig(Model::Gel8230, &[(642, 1000)]);
    rig.inputs.encoders[0].count = 77;
    rig.drive(1, 500);
    rig.values.set(600, 0).unwrap();
    rig.control.configure(&rig.values);
    assert_eq!(rig.idle().terminals.analog, [0; 3]);
    rig.values.set(600, 1).unwrap();
    rig.values.set(480, 5_000).unwrap();
    rig.control.configure(&rig.values);
    assert_eq!((rig.idle().terminals.analog[0], rig.last(0).actual.position), (0, 77));
    assert_eq!(rig.drive(1, 500).terminals.analog[0], 2_500);
}

/// Calibration needs the axis' consent, and the offset is there to be kept.
#[test]
fn an_armed_axis_calibrates_its_input() {
    let mut rig = rig(Model::Gel8230, &[(226, 1), (233, 2), (247, 10)]);
    rig.drive(1, 0);
    rig.inputs.encoders[0] = Encoder { count: 40, risen: Some(30), ..Encoder::default() };
    rig.idle();
    assert_eq!((rig.last(0).actual.position, rig.control.offsets()[0]), (20, 20));
}
