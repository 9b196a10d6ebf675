//! The blocks against an axis that a script plays.

use super::*;
use crate::bus::CanBus;
use crate::io::{AnalogInputs, DigitalInputs, DigitalOutputs, ProcessImage};
use crate::parameters::Values;

struct Rig {
    axes: [AxisAccess; 6],
}

impl Rig {
    fn new(state: State) -> Self {
        let mut axes: [AxisAccess; 6] = Default::default();
        axes[0].activated = true;
        axes[0].set_status(AxisStatus { state, ..AxisStatus::default() });
        Self { axes }
    }

    fn run<T>(&mut self, application: impl FnOnce(&mut Plc<'_>) -> T) -> T {
        application(&mut Plc {
            cycle: 2,
            inputs: DigitalInputs::default(),
            analog: &AnalogInputs::default(),
            actual: &Default::default(),
            outputs: &mut DigitalOutputs::default(),
            pwm: &mut Default::default(),
            bus: &mut ProcessImage::default(),
            can: &mut [0, 1].map(|at| CanBus::new(8230, &Values::factory(), at)),
            axes: &mut self.axes,
        })
    }

    fn axis(&mut self) -> &mut AxisAccess {
        &mut self.axes[0]
    }
}

/// Done, busy, active, aborted, error.
fn bits(outputs: Outputs) -> [bool; 5] {
    [outputs.done, outputs.busy, outputs.active, outputs.command_aborted, outputs.error]
}

const IDLE: [bool; 5] = [false; 5];
const WAITING: [bool; 5] = [false, true, false, false, false];
const ACTIVE: [bool; 5] = [false, true, true, false, false];
const DONE: [bool; 5] = [true, false, false, false, false];
const ABORTED: [bool; 5] = [false, false, false, true, false];
const ERROR: [bool; 5] = [false, false, false, false, true];

#[test]
fn an_order_goes_from_busy_over_active_to_done() {
    let mut rig = Rig::new(State::Standstill);
    let mut block = MoveAbsolute { position: 500, velocity: Some(20), ..MoveAbsolute::new(1) };
    assert_eq!(bits(rig.run(|plc| block.call(plc))), IDLE);
    block.execute = true;
    assert_eq!(bits(rig.run(|plc| block.call(plc))), WAITING);
    assert_eq!(rig.axis().take(), Some(Order::MoveAbsolute { position: 500, velocity: Some(20) }));
    assert_eq!(bits(rig.run(|plc| block.call(plc))), ACTIVE);
    // A level is no second order.
    assert_eq!(rig.axis().take(), None);
    rig.axis().end(Progress::Done);
    assert_eq!(bits(rig.run(|plc| block.call(plc))), DONE);
    assert_eq!(bits(rig.run(|plc| block.call(plc))), DONE);
    block.execute = false;
    assert_eq!(bits(rig.run(|plc| block.call(plc))), IDLE);
}

#[test]
fn the_end_shows_for_one_cycle_when_execute_went_before() {
    let mut rig = Rig::new(State::Standstill);
    let mut block = MoveRelative { distance: -7, execute: true, ..MoveRelative::new(1) };
    rig.run(|plc| block.call(plc));
    assert_eq!(rig.axis().take(), Some(Order::MoveRelative { distance: -7, velocity: None }));
    block.execute = false;
    assert_eq!(bits(rig.run(|plc| block.call(plc))), ACTIVE);
    rig.axis().end(Progress::Done);
    assert_eq!(bits(rig.run(|plc| block.call(plc))), DONE);
    assert_eq!(bits(rig.run(|plc| block.call(plc))), IDLE);
}

/// The axis moves on, and its first order is done in the end.
#[test]
fn an_order_that_the_axis_refuses_leaves_the_one_before() {
    let mut rig = Rig::new(State::DiscreteMotion);
    let mut first = MoveAbsolute { position: 500, execute: true, ..MoveAbsolute::new(1) };
    let mut second = MoveAbsolute { velocity: Some(u32::MAX), execute: true, ..MoveAbsolute::new(1) };
    rig.run(|plc| first.call(plc));
    rig.axis().take();
    rig.run(|plc| second.call(plc));
    rig.axis().take();
    rig.axis().refuse(MotionError::RANGE);
    let outputs = rig.run(|plc| second.call(plc));
    assert_eq!((bits(outputs), outputs.error_id), (ERROR, MotionError::RANGE));
    assert_eq!(bits(rig.run(|plc| first.call(plc))), ACTIVE);
    rig.axis().end(Progress::Done);
    assert_eq!(bits(rig.run(|plc| first.call(plc))), DONE);
    assert_eq!(bits(rig.run(|plc| second.call(plc))), ERROR);
}

#[test]
fn a_later_order_aborts_the_one_before() {
    let mut rig = Rig::new(State::Standstill);
    let mut first = MoveVelocity { velocity: 30, execute: true, ..MoveVelocity::new(1) };
    let mut second = Halt { execute: true, ..Halt::new(1) };
    rig.run(|plc| first.call(plc));
    rig.axis().take();
    let (one, two) = rig.run(|plc| {
        let second = second.call(plc);
        (first.call(plc), second)
    });
    assert_eq!((bits(one), bits(two)), (ACTIVE, WAITING));
    assert_eq!(rig.axis().take(), Some(Order::Halt));
    assert_eq!(rig.run(|plc| [bits(first.call(plc)), bits(second.call(plc))]), [ABORTED, ACTIVE]);
    // Both in one cycle: the later one counts.
    let mut third = Home { execute: true, ..Home::new(1) };
    let mut fourth = MoveVelocity { velocity: 1, execute: true, ..MoveVelocity::new(1) };
    rig.run(|plc| [third.call(plc), fourth.call(plc)]);
    assert_eq!(rig.axis().take(), Some(Order::MoveVelocity { velocity: 1 }));
    assert_eq!(rig.run(|plc| [bits(third.call(plc)), bits(fourth.call(plc))]), [ABORTED, ACTIVE]);
}

#[test]
fn what_an_axis_refuses_is_an_error_with_its_reason() {
    let refused = |state, axis, error| {
        let mut rig = Rig::new(state);
        let status = AxisStatus { error, ..*rig.axis().status() };
        rig.axis().set_status(status);
        let mut block = Home { execute: true, ..Home::new(axis) };
        let outputs = rig.run(|plc| block.call(plc));
        assert_eq!(bits(outputs), ERROR);
        assert_eq!(rig.axis().take(), None);
        outputs.error_id
    };
    assert_eq!(refused(State::Standstill, 7, MotionError::NONE), MotionError::NO_AXIS);
    assert_eq!(refused(State::Standstill, 2, MotionError::NONE), MotionError::NO_AXIS);
    assert_eq!(refused(State::Disabled, 1, MotionError::NONE), MotionError::NOT_ENABLED);
    assert_eq!(refused(State::ErrorStop, 1, MotionError(5)), MotionError::IN_ERROR);
}

/// 6.8.1.1: with a limit switch passed, the axis itself decides which commands lead back.
#[test]
fn a_limit_switch_lets_orders_through_to_the_axis() {
    let mut rig = Rig::new(State::ErrorStop);
    let error = MotionError::HW_LIMIT_PLUS;
    rig.axis().set_status(AxisStatus { state: State::ErrorStop, error, ..AxisStatus::default() });
    let mut block = MoveRelative { distance: 5, execute: true, ..MoveRelative::new(1) };
    rig.run(|plc| block.call(plc));
    assert!(rig.axis().take().is_some());
    rig.axis().end(Progress::Failed(error));
    let outputs = rig.run(|plc| block.call(plc));
    assert_eq!((bits(outputs), outputs.error_id), (ERROR, MotionError(0x40)));
}

#[test]
fn a_stop_holds_the_axis() {
    let mut rig = Rig::new(State::DiscreteMotion);
    let mut stop = Stop { execute: true, ..Stop::new(1) };
    let mut start = Home { execute: true, ..Home::new(1) };
    assert_eq!(bits(rig.run(|plc| stop.call(plc))), WAITING);
    assert_eq!(rig.axis().take(), Some(Order::Stop));
    rig.axis().end(Progress::Done);
    let (stopped, started) = rig.run(|plc| (stop.call(plc), start.call(plc)));
    assert_eq!((bits(stopped), started.error_id), (DONE, MotionError::STOPPING));
    (stop.execute, start.execute) = (false, false);
    rig.run(|plc| (stop.call(plc), start.call(plc)));
    start.execute = true;
    assert_eq!(bits(rig.run(|plc| start.call(plc))), WAITING);
}

#[test]
fn jog_runs_while_one_direction_is_asked_for() {
    let mut rig = Rig::new(State::Standstill);
    let mut jog = Jog::new(1);
    assert_eq!(bits(rig.run(|plc| jog.call(plc))), IDLE);
    jog.forward = true;
    assert_eq!(bits(rig.run(|plc| jog.call(plc))), WAITING);
    assert_eq!(rig.axis().take(), Some(Order::Jog { forward: true, fast: false }));
    assert_eq!(bits(rig.run(|plc| jog.call(plc))), ACTIVE);
    jog.fast = true;
    rig.run(|plc| jog.call(plc));
    assert_eq!(rig.axis().take(), Some(Order::Jog { forward: true, fast: true }));
    jog.backward = true;
    rig.run(|plc| jog.call(plc));
    assert_eq!(rig.axis().take(), Some(Order::Halt));
    rig.axis().end(Progress::Done);
    jog.forward = false;
    rig.run(|plc| jog.call(plc));
    assert_eq!(rig.axis().take(), Some(Order::Jog { forward: false, fast: true }));
    // What another block has taken over is not halted.
    let mut other = Home { execute: true, ..Home::new(1) };
    rig.run(|plc| other.call(plc));
    assert_eq!(rig.axis().take(), Some(Order::Home));
    jog.backward = false;
    assert_eq!(bits(rig.run(|plc| jog.call(plc))), IDLE);
    assert_eq!(rig.axis().take(), None);
}

/// `in_velocity` belongs to the order that is carried out.
#[test]
fn velocity_and_gearing_tell_when_they_are_reached() {
    let mut rig = Rig::new(State::Standstill);
    let mut gear = GearIn { master: 3, numerator: -2, denominator: 5, execute: true, ..GearIn::new(1) };
    let mut velocity = MoveVelocity { velocity: 9, ..MoveVelocity::new(1) };
    rig.run(|plc| gear.call(plc));
    assert_eq!(rig.axis().take(), Some(Order::GearIn { master: 3, numerator: -2, denominator: 5 }));
    assert!(!rig.run(|plc| gear.call(plc)).in_velocity);
    let reached = AxisStatus { in_velocity: true, ..*rig.axis().status() };
    rig.axis().set_status(reached);
    let outputs = rig.run(|plc| gear.call(plc));
    assert!(outputs.in_velocity && outputs.busy && !outputs.done);
    velocity.execute = true;
    assert!(!rig.run(|plc| velocity.call(plc)).in_velocity, "not taken yet");
    rig.axis().take();
    let (first, second) = rig.run(|plc| (gear.call(plc), velocity.call(plc)));
    assert!(!first.in_velocity && first.command_aborted && second.in_velocity);
    let mut out = GearOut { execute: true, ..GearOut::new(1) };
    rig.run(|plc| out.call(plc));
    assert_eq!(rig.axis().take(), Some(Order::GearOut));
}

#[test]
fn power_reset_status_and_position_act_at_once() {
    let mut rig = Rig::new(State::Disabled);
    let mut power = Power { enable: true, ..Power::new(1) };
    assert_eq!(rig.run(|plc| power.call(plc)), Ok(false));
    assert!(rig.axis().power);
    power.axis = 3;
    assert_eq!(rig.run(|plc| power.call(plc)), Err(MotionError::NO_AXIS));

    let mut set = SetPosition { position: 77, execute: true, ..SetPosition::new(1) };
    assert_eq!(bits(rig.run(|plc| set.call(plc))), DONE);
    assert_eq!(rig.axis().set_position.take(), Some(77));
    rig.run(|plc| set.call(plc));
    assert_eq!(rig.axis().set_position, None);
    set.execute = false;
    rig.run(|plc| set.call(plc));
    rig.axis().set_status(AxisStatus { state: State::DiscreteMotion, ..AxisStatus::default() });
    set.execute = true;
    assert_eq!(rig.run(|plc| set.call(plc)).error_id, MotionError::MOVING);

    let failed = AxisStatus { state: State::ErrorStop, error: MotionError(6), ..AxisStatus::default() };
    rig.axis().set_status(failed);
    assert_eq!(rig.run(|plc| ReadStatus { axis: 1 }.call(plc)), Ok(failed));
    let mut reset = Reset { execute: true, ..Reset::new(1) };
    assert_eq!(bits(rig.run(|plc| reset.call(plc))), WAITING);
    assert!(rig.axis().reset);
    rig.axis().set_status(AxisStatus { state: State::Standstill, ..AxisStatus::default() });
    assert_eq!(bits(rig.run(|plc| reset.call(plc))), DONE);
}

#[test]
fn errors_have_a_text() {
    use alloc::string::ToString;
    assert_eq!(MotionError(4).to_string(), "upper software limit passed");
    assert_eq!(MotionError(5).to_string(), "DeltaS > DeltaS max.");
    assert_eq!(MotionError::STOPPING.to_string(), "the axis is held by a stop");
    assert_eq!(MotionError(0x222).to_string(), "error 222h");
}
