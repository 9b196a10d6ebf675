//! Following error, loss of a drive, of a bus and of an encoder, faults of a drive, the application's stop
//! and the brake: reaction in the same cycle, the failure stored with its axis.

use core::time::Duration;

use canopen_master::ds402;
use device_sim::can::{Faults, State as CanState};
use device_sim::plant::{Connection, Drive, Incremental, Plant, Sensor, Ssi, Wiring};
use lb2::code::Failure;
use motion_core::application::{MotionError, Order, Progress, State};
use motion_core::failure::{DRIVE_FAULT, DRIVE_LOST, READING_LOST};
use motion_core::input::Code;
use motion_core::io::Terminal;

use super::rig::{AXES, Rig, V_MAX};

const MS: Duration = Duration::from_millis(1);
const FORWARD: Order = Order::MoveVelocity { velocity: 327_680 };
const BACKWARD: Order = Order::MoveVelocity { velocity: -327_680 };

fn others_stand(rig: &Rig, axis: usize) {
    for other in (0..AXES).filter(|other| *other != axis) {
        assert_eq!(rig.status(other).state, State::Standstill, "axis {other}");
    }
}

/// After a failure is over: reset, and a move to `position` arrives.
fn moves_again(rig: &mut Rig, axis: usize, position: i32) {
    rig.reset(axis);
    rig.until("at standstill", |rig| rig.status(axis).state == State::Standstill);
    rig.until("enabled", |rig| rig.state(axis) == ds402::State::OperationEnabled);
    rig.arrive(axis, position, 327_680);
}

/// The same, to the increment.
fn works_again(rig: &mut Rig, axis: usize, position: i32) {
    moves_again(rig, axis, position);
    rig.until("at rest", |rig| {
        let real = rig.real(axis).floor();
        rig.status(axis).position == position && real == f64::from(position)
    });
}

/// A drive that does not turn although it is told to: its reference is taken away.
fn following_error(order: Order, failure: Failure) {
    let limit = 2_000;
    let axis = 4;
    let at = axis as u16;
    let mut rig = Rig::enabled(&[(696 + at, limit), (702 + at, limit)]);
    let ticket = rig.order(axis, order);
    rig.run(600 * MS);
    assert_eq!(rig.failures(), []);
    // Set values do not reach the drive any more; it still answers.
    rig.drives[axis].with_device(rig.networks[0].now(), |_, context| context.objects.set(0x35B4, 1, 2));
    let sign = if failure == Failure::DELTA_S_MAX { 1 } else { -1 };
    loop {
        rig.cycle();
        // What the cycle saw: the deviation that it reports is that of its set and actual position.
        let status = rig.status(axis);
        let passed = sign * status.deviation >= limit;
        assert_eq!(status.state == State::ErrorStop, passed, "{status:?}");
        if passed {
            break;
        }
    }
    rig.assert_failed(axis, failure);
    assert_eq!(rig.failures().len(), 1);
    others_stand(&rig, axis);
    assert_eq!(rig.progress(axis, ticket), Progress::Failed(MotionError::from_failure(failure)));
    rig.run(Duration::from_secs(1));
    assert_eq!(rig.status(axis).nominal_velocity, 0.0);
    rig.drives[axis].with_device(rig.networks[0].now(), |_, context| context.objects.set(0x35B4, 1, 0));
    works_again(&mut rig, axis, 1000);
}

#[test]
fn following_error_ahead() {
    following_error(FORWARD, Failure::DELTA_S_MAX);
}

#[test]
fn following_error_behind() {
    following_error(BACKWARD, Failure::DELTA_S_MIN);
}

/// Guarding's life time is 300 ms from the last answer, one of which comes each 100 ms.
#[test]
fn loss_of_a_drive_while_it_moves() {
    for axis in [0, 5] {
        let mut rig = Rig::enabled(&[]);
        let ticket = rig.order(axis, FORWARD);
        rig.run(1000 * MS);
        rig.plug(axis, false);
        let took = rig.until("lost", |rig| rig.status(axis).state == State::ErrorStop);
        assert!((200 * MS..=306 * MS).contains(&took), "{took:?}");
        rig.assert_failed(axis, DRIVE_LOST);
        others_stand(&rig, axis);
        assert_eq!(rig.progress(axis, ticket), Progress::Failed(MotionError::from_failure(DRIVE_LOST)));
        // Nor does the drive turn on without its master.
        rig.run(200 * MS);
        assert_eq!(rig.drive(axis, |drive| drive.motion().1), 0.0);
        // As long as it is away, a reset does not help, and nothing is told twice.
        for _ in 0..5 {
            rig.reset(axis);
            rig.run(100 * MS);
            assert_eq!(rig.status(axis).state, State::ErrorStop);
        }
        rig.plug(axis, true);
        rig.run(300 * MS);
        assert_eq!(rig.failures(), [(axis as u8 + 1, DRIVE_LOST)]);
        works_again(&mut rig, axis, -5000);
        assert_eq!(rig.failures().len(), 1);
    }
}

/// An axis that is not enabled tells the loss of its drive too.
#[test]
fn loss_of_a_drive_that_is_not_enabled() {
    let mut rig = Rig::new(&[], Faults::NONE);
    rig.until("booted", Rig::is_booted);
    rig.plug(2, false);
    rig.run(400 * MS);
    assert_eq!((rig.failures(), rig.status(2).state), (vec![(3, DRIVE_LOST)], State::Disabled));
    // Enabled, it does not move without its drive.
    rig.set_power(true);
    rig.run(100 * MS);
    assert_eq!(rig.status(2).state, State::ErrorStop);
    rig.plug(2, true);
    rig.run(300 * MS);
    works_again(&mut rig, 2, 7);
    assert_eq!(rig.failures().len(), 1);
}

/// A drive that was switched off and on again takes a scan; the others are booted with it.
#[test]
fn a_drive_that_starts_anew_takes_a_scan() {
    let mut rig = Rig::enabled(&[]);
    rig.power_cycle(1);
    let took = rig.until("lost", |rig| rig.status(1).state == State::ErrorStop);
    assert!(took < 20 * MS, "told by its boot-up message: {took:?}");
    rig.assert_failed(1, DRIVE_LOST);
    rig.run(1000 * MS);
    rig.reset(1);
    rig.cycle();
    assert_eq!(rig.status(1).state, State::ErrorStop, "not what it was");
    assert!(rig.controller.scan(1));
    rig.until("booted", Rig::is_booted);
    for axis in 0..4 {
        works_again(&mut rig, axis, 100);
    }
    assert_eq!(rig.failures().len(), 1);
}

/// Bus-off: every drive of the bus is lost in the next cycle, not after the life time.
#[test]
fn bus_off_stops_every_axis_of_the_bus_at_once() {
    let mut rig = Rig::enabled(&[]);
    for axis in 0..AXES {
        rig.order(axis, FORWARD);
    }
    rig.run(1000 * MS);
    let controller = rig.networks[1].station(0).unwrap();
    rig.networks[1].bus().break_transmitter(controller, true);
    loop {
        let off = rig.networks[1].bus().state(controller) == CanState::BusOff;
        rig.cycle();
        for axis in 0..AXES {
            let failed = rig.status(axis).state == State::ErrorStop;
            assert_eq!(failed, off && axis < 4, "axis {axis}");
        }
        if off {
            break;
        }
    }
    assert_eq!(rig.failures(), [1, 2, 3, 4].map(|axis| (axis, DRIVE_LOST)));
    rig.run(1000 * MS);
    let now = rig.now();
    rig.networks[1].bus().break_transmitter(controller, false);
    rig.networks[1].bus().restart(now, controller);
    rig.run(500 * MS);
    for axis in 0..4 {
        works_again(&mut rig, axis, 12_345);
    }
    assert_eq!(rig.failures().len(), 4);
    assert_eq!(rig.status(5).state, State::ContinuousMotion);
}

#[test]
fn fault_of_a_drive() {
    let mut rig = Rig::enabled(&[]);
    rig.order(3, BACKWARD);
    rig.run(1000 * MS);
    rig.fault(3);
    // Its emergency comes with this cycle.
    rig.cycle();
    rig.cycle();
    rig.assert_failed(3, DRIVE_FAULT);
    others_stand(&rig, 3);
    rig.run(500 * MS);
    assert_eq!((rig.state(3), rig.failures().len()), (ds402::State::Fault, 1));
    works_again(&mut rig, 3, 0);
    assert_eq!(rig.failures().len(), 1);
}

/// What an axis is doing when its drive is lost or faulty, in both modes that can drive it.
#[test]
fn loss_and_fault_of_a_drive_in_every_motion() {
    let axis = 2;
    let at = axis as u16;
    let orders = [
        Order::Jog { forward: true, fast: true },
        Order::MoveAbsolute { position: 1_000_000, velocity: Some(327_680) },
        Order::Home,
    ];
    for mode in [1, 3] {
        for order in orders {
            for failure in [DRIVE_LOST, DRIVE_FAULT] {
                println!("mode {mode}, {order:?}, {failure:?}");
                let calibration = [(804 + at, 1), (792 + at, 327_680), (798 + at, 327_680)];
                let ramps = [(600 + at, mode), (894 + at, 50_000)];
                let mut rig = Rig::enabled(&[&calibration[..], &ramps].concat());
                let ticket = rig.order(axis, order);
                rig.run(900 * MS);
                assert!(rig.drive(axis, |drive| drive.motion().1) > 0.0);
                if failure == DRIVE_LOST {
                    rig.plug(axis, false);
                    rig.until("lost", |rig| rig.status(axis).state == State::ErrorStop);
                } else {
                    rig.fault(axis);
                    rig.cycle();
                    rig.cycle();
                }
                rig.assert_failed(axis, failure);
                others_stand(&rig, axis);
                assert_eq!(rig.progress(axis, ticket), Progress::Failed(MotionError::from_failure(failure)));
                rig.run(300 * MS);
                assert_eq!(rig.drive(axis, |drive| drive.motion().1), 0.0);
                rig.plug(axis, true);
                rig.run(300 * MS);
                moves_again(&mut rig, axis, 1_000);
                assert_eq!(rig.failures().len(), 1);
            }
        }
    }
}

/// An axis that is switched off and on again knows nothing of the fault that its drive still has: it is told
/// again, and does not take orders which the drive would catch up with once it is reset.
#[test]
fn a_drive_that_is_enabled_in_a_fault_tells_it_again() {
    let mut rig = Rig::enabled(&[]);
    rig.fault(0);
    rig.run(30 * MS);
    rig.assert_failed(0, DRIVE_FAULT);
    rig.set_power(false);
    rig.run(30 * MS);
    assert_eq!(rig.status(0).state, State::Disabled);
    rig.set_power(true);
    rig.run(30 * MS);
    rig.assert_failed(0, DRIVE_FAULT);
    assert!(rig.controller.axis(0).unwrap().order(FORWARD).is_err());
    rig.run(300 * MS);
    works_again(&mut rig, 0, 1_000);
}

/// With [744] a drive is enabled by its brake; it is not any more once a failure has brought it to rest.
#[test]
fn a_failed_axis_is_not_enabled_at_rest() {
    let mut rig = Rig::new(&[(744, 20), (696, 300)], Faults::NONE);
    rig.until("booted", Rig::is_booted);
    rig.set_power(true);
    rig.run(100 * MS);
    rig.order(0, FORWARD);
    rig.run(600 * MS);
    assert_eq!(rig.state(0), ds402::State::OperationEnabled);
    rig.drives[0].with_device(rig.networks[0].now(), |_, context| context.objects.set(0x35B4, 1, 2));
    rig.until("failed", |rig| rig.status(0).state == State::ErrorStop);
    rig.run(600 * MS);
    assert_ne!(rig.state(0), ds402::State::OperationEnabled);
    rig.reset(0);
    rig.run(100 * MS);
    assert_eq!(rig.status(0).state, State::Standstill);
    assert_ne!(rig.state(0), ds402::State::OperationEnabled);
}

/// Before its drive has booted an axis can be enabled, and takes no orders; nor if it is not found.
#[test]
fn an_axis_without_its_drive_takes_no_orders() {
    let mut rig = Rig::new(&[], Faults::NONE);
    rig.plug(1, false);
    rig.set_power(true);
    rig.run(12 * MS);
    let ticket = rig.order(1, FORWARD);
    rig.cycle();
    assert_eq!(rig.progress(1, ticket), Progress::Failed(MotionError::from_failure(READING_LOST)));
    assert_eq!((rig.status(1).state, rig.failures()), (State::Standstill, vec![]));
    rig.run(2_000 * MS);
    rig.assert_failed(1, DRIVE_LOST);
    others_stand(&rig, 1);
    rig.plug(1, true);
    assert!(rig.controller.scan(1));
    rig.until("booted", Rig::is_booted);
    works_again(&mut rig, 1, 1_000);
}

/// Axis 1 with a motor on Q1 and an encoder on E1.
fn analog(kind: i32, sensor: Sensor, more: &[(u16, i32)]) -> Rig {
    let changes =
        [(100, kind), (450, 1), (642, 10_000), (756, 1_000), (762, 5_000), (768, 1_000), (774, 5_000)];
    let mut rig = Rig::new(&[&changes[..], more].concat(), Faults::NONE);
    let plant = Plant::new(Drive::first_order(10_000.0, 0.005));
    rig.machine.axes = vec![Wiring::new(plant, Connection::Analog { block: 0, unipolar: false }, sensor)];
    rig.set_power(true);
    rig.run(200 * MS);
    rig
}

fn encoder_failure(mut rig: Rig) {
    let ticket = rig.order(0, Order::MoveVelocity { velocity: 4_000 });
    rig.run(1000 * MS);
    let before = rig.outputs.analog[0];
    assert!((3_900..4_100).contains(&before), "{before} mV");
    rig.machine.axes[0].sensor.as_mut().unwrap().1.set_broken(true);
    rig.until_failed(0, READING_LOST, |rig| rig.inputs.encoders[0].fault);
    assert_eq!(rig.progress(0, ticket), Progress::Failed(MotionError::from_failure(READING_LOST)));
    // It brakes from this cycle on, along the set values: 20,000 units/s².
    let after = rig.outputs.analog[0];
    assert!(after < before && after > before - 500, "{after} mV");
    rig.run(500 * MS);
    assert_eq!(rig.outputs.analog[0], 0);
    rig.reset(0);
    rig.cycle();
    assert_eq!(rig.status(0).state, State::ErrorStop, "the encoder is still broken");
    rig.machine.axes[0].sensor.as_mut().unwrap().1.set_broken(false);
    rig.cycle();
    rig.reset(0);
    rig.cycle();
    assert_eq!((rig.status(0).state, rig.failures().len()), (State::Standstill, 1));
}

#[test]
fn failure_of_an_incremental_encoder() {
    encoder_failure(analog(0, Sensor::Incremental(Incremental::new(1.0, i64::MAX - 8, 0)), &[]));
}

#[test]
fn failure_of_an_absolute_encoder() {
    let word = motion_core::input::Ssi::new(Code::Gray, true, 12);
    encoder_failure(analog(1, Sensor::Ssi(Ssi::new(1.0, word)), &[(142, 1)]));
}

/// `[004]`; I3.7 falls while axes move. 500 ms from V max. at most, 2000 ms as the axis is set.
fn plc_stop(choice: i32) -> (Rig, Duration) {
    let mut rig = Rig::enabled(&[(4, choice), (678, 2_000)]);
    let ticket = rig.order(0, FORWARD);
    rig.run(3000 * MS);
    assert!(rig.controller.is_running());
    let before = rig.status(0).nominal_velocity;
    assert_eq!(before, 327_680.0);
    rig.inputs.digital.set(Terminal::PLC_RUN, false);
    rig.cycle();
    assert!(!rig.controller.is_running());
    assert_eq!(rig.status(0).nominal_velocity < before, choice != 0, "in the same cycle");
    let aborted = rig.progress(0, ticket) == Progress::Aborted;
    assert_eq!(aborted, choice != 0);
    let start = rig.now();
    let limit = start + Duration::from_secs(3);
    while rig.status(0).state != State::Standstill && rig.now() < limit {
        rig.cycle();
    }
    assert_eq!(rig.failures(), [], "a stop is no failure");
    let took = rig.now() - start;
    (rig, took)
}

#[test]
fn plc_stop_no() {
    let (rig, _) = plc_stop(0);
    assert_eq!((rig.status(0).state, rig.status(0).nominal_velocity), (State::ContinuousMotion, 327_680.0));
}

#[test]
fn plc_stop_control() {
    let (mut rig, took) = plc_stop(1);
    assert!((240 * MS..=256 * MS).contains(&took), "{took:?}");
    assert_eq!(rig.state(0), ds402::State::OperationEnabled);
}

#[test]
fn plc_stop_regulate() {
    let (_, took) = plc_stop(2);
    assert!((990 * MS..=1006 * MS).contains(&took), "{took:?}");
}

/// `[744]`, `[750]` with the enable by software (6.7.1.2): the drive is enabled with the start signal, the
/// axis starts once the brake is open, and the drive stays enabled until it has closed.
#[test]
fn brake_timing() {
    let (axis, open, close) = (2, 300 * MS, 150 * MS);
    let at = axis as u16;
    let mut rig = Rig::new(&[(744 + at, 30), (750 + at, 15), (738 + at, 0)], Faults::NONE);
    rig.until("booted", Rig::is_booted);
    rig.set_power(true);
    rig.run(500 * MS);
    assert_eq!(rig.state(axis), ds402::State::SwitchOnDisabled, "at rest it is not enabled");
    let ticket = rig.order(axis, Order::MoveAbsolute { position: 50_000, velocity: Some(V_MAX as u32 / 2) });
    let enabled = rig.until("enabled", |rig| rig.state(axis) == ds402::State::OperationEnabled);
    assert!(enabled <= 180 * MS, "30 ms an axis: {enabled:?}");
    let moved = enabled + rig.until("moving", |rig| rig.status(axis).nominal_velocity > 0.0);
    assert!((open..=open + 12 * MS).contains(&moved), "{moved:?}");
    rig.until("arrived", |rig| rig.progress(axis, ticket) == Progress::Done);
    let closing = rig.until("disabled", |rig| rig.state(axis) != ds402::State::OperationEnabled);
    assert!((close..=close + 18 * MS).contains(&closing), "{closing:?}");
    assert_eq!(rig.failures(), []);
}
