//! A master and what another axis takes over of it by way of Virtual2 (6.6.1.5): exact in every cycle.

use device_sim::plant::{Connection, Drive, Incremental, Plant, Sensor, Stepper, Wiring};
use lb2::device::Device;
use motion_core::application::{AxisStatus, MotionError, Order, Progress, State, Ticket};
use motion_core::failure::READING_LOST;
use motion_core::input::Reading;

use super::bench::{Bench, CONTROL, Route, V_MAX};

const MASTER: Route = Route { axis: 0, input: 0, output: 0 };
/// The slave: axis 2 with a motor on Q2 and an encoder on E2.
const SLAVE: usize = 1;
/// Input 3 by place: the master's quantity times 3/7, negated.
const GEAR: usize = 2;
/// Where the master goes: not a multiple of 7 anywhere.
const WAYS: [i32; 3] = [6_000, -3_501, 999];

/// The quantity `[156]` of number 1 as it is scaled: −3/7, rounded down.
fn geared(quantity: i32) -> i32 {
    (-3 * quantity).div_euclid(7)
}

/// With input 3 looking at input or axis 1.
fn bench(quantity: i32, changes: &[(u16, i32)]) -> Bench {
    let gear = [(102, 4), (158, quantity), (165, 1), (207, 3), (214, 7), (200, 1)];
    let slave = [(600, 1), (606, 2), (612, 2), (450, 1)].map(|(first, value)| (first + SLAVE as u16, value));
    Bench::with(MASTER, CONTROL, changes, &[&gear[..], &slave[..]].concat())
}

/// Moves the master and looks at every cycle, with what it showed in the cycle before.
fn moves(mut bench: Bench, expected: impl Fn(&Bench, &AxisStatus) -> i32) {
    for position in WAYS {
        bench.order(Order::MoveAbsolute { position, velocity: None });
        let (mut moved, end) = (0, bench.now_ms() + 2_500);
        while bench.now_ms() < end {
            let before = bench.status();
            bench.cycle();
            let seen = bench.controller.actual_values()[GEAR];
            assert!(seen.reading == Reading::Real && seen.failure.is_none());
            assert_eq!(seen.position, geared(expected(&bench, &before)), "at {} ms", bench.now_ms());
            moved += u32::from(seen.velocity != 0);
        }
        assert!(moved > 50, "{moved} cycles with a change");
        assert_eq!(bench.status().position, position);
    }
}

#[test]
fn the_actual_value_of_an_input_is_that_of_this_cycle() {
    moves(bench(0, &[]), |bench, _| bench.controller.actual_values()[0].position);
}

#[test]
fn the_frequency_of_an_input_is_that_of_this_cycle() {
    moves(bench(1, &[]), |bench, _| bench.controller.actual_values()[0].frequency);
}

#[test]
fn the_position_of_an_axis_is_its_set_value() {
    moves(bench(2, &[]), |_, before| before.nominal_position);
}

#[test]
fn the_velocity_of_an_axis_is_its_set_value() {
    moves(bench(3, &[]), |_, before| before.nominal_velocity.round() as i32);
}

/// The pulses that the motor has followed, from the first one on.
#[test]
fn the_clock_of_an_axis_is_counted_to_the_pulse() {
    let clock = [(606, 7), (450, 4), (540, 10_000), (546, 3)];
    let mut bench = bench(4, &clock);
    bench.machine.axes[0].connection = Connection::Clock { block: 0 };
    bench.machine.axes[0].sensor = None;
    let mut motor = Stepper::new(1.0);
    motor.acceleration = 200_000.0;
    bench.set_drive(Drive::Stepper(motor));
    moves(bench, |bench, _| bench.status().position);
}

/// Axis 2 enabled, with a plant of its own, geared to input 3: 1/1, for the ratio is that of the input.
fn geared_axis(quantity: i32, changes: &[(u16, i32)]) -> (Bench, Ticket) {
    let mut bench = bench(quantity, changes);
    let plant = Plant::new(Drive::first_order(V_MAX, 0.005));
    let sensor = Sensor::Incremental(Incremental::new(1.0, 0, 0));
    let connection = Connection::Analog { block: SLAVE, unipolar: false };
    bench.machine.axes.push(Wiring::new(plant, connection, sensor));
    bench.controller.axis(SLAVE).unwrap().set_power(true).unwrap();
    bench.run(12);
    let ticket = gear_in(&mut bench);
    bench.cycle();
    (bench, ticket)
}

fn gear_in(bench: &mut Bench) -> Ticket {
    let gear = Order::GearIn { master: GEAR as u8 + 1, numerator: 1, denominator: 1 };
    bench.controller.axis(SLAVE).unwrap().order(gear).unwrap()
}

fn slave(bench: &Bench) -> AxisStatus {
    *bench.controller.axis_status(SLAVE).unwrap()
}

/// Geared to another axis' actual or nominal position by way of Virtual2: it goes along in every cycle, and
/// rests where the master's increments put it, both ways.
#[test]
fn an_axis_follows_another_one_to_the_increment() {
    for quantity in [0, 2] {
        let (mut bench, _) = geared_axis(quantity, &[]);
        assert!(slave(&bench).in_velocity);
        for position in WAYS {
            bench.order(Order::MoveAbsolute { position, velocity: None });
            let end = bench.now_ms() + 3_000;
            while bench.now_ms() < end {
                let seen = bench.controller.actual_values()[GEAR].position;
                bench.cycle();
                let slave = slave(&bench);
                // The way of a cycle is known at its end.
                assert_eq!(slave.nominal_position, seen);
                assert_eq!((slave.state, slave.in_velocity), (State::SynchronizedMotion, true));
                // The drive's lag, at 3/7 of V max. and most acceleration.
                assert!(slave.deviation.abs() < 60, "{slave:?}");
            }
            let rest = geared(position);
            assert_eq!(bench.status().position, position);
            assert_eq!(slave(&bench).position, rest);
            assert_eq!(bench.machine.axes[1].plant.position().floor() as i32, rest);
        }
        assert_eq!(bench.controller.failure_count(), 0);
    }
}

/// Onto a master that moves: the slave's plant is not thrown, and gets there.
#[test]
fn an_axis_gets_in_gear_with_one_that_moves() {
    let (mut bench, _) = geared_axis(0, &[(690, 100)]);
    bench.controller.axis(SLAVE).unwrap().order(Order::GearOut).unwrap();
    bench.order(Order::MoveVelocity { velocity: 7_000 });
    bench.run(1_200);
    assert!(bench.machine.axes[1].plant.velocity().abs() < 1.0);
    gear_in(&mut bench);
    let (mut last, start) = (0.0, bench.now_ms());
    let mut in_gear = 0;
    for _ in 0..200 {
        bench.cycle();
        let velocity = bench.machine.axes[1].plant.velocity();
        // 6 ms of V max. in 500 ms, with the drive's and the feedback's share.
        assert!((velocity - last).abs() < 1.5 * 120.0, "{velocity} after {last}");
        last = velocity;
        if in_gear == 0 && slave(&bench).in_velocity {
            in_gear = bench.now_ms() - start;
        }
    }
    // 3,000 at 20,000/s²; [691] of the slave is 0.
    assert!((150..=165).contains(&in_gear), "{in_gear} ms");
    assert!((last + 3_000.0).abs() < 30.0, "{last}");
    // Rigid from there on: the way of both until the end.
    let ends = |bench: &Bench| (bench.status().position, slave(bench).position);
    bench.order(Order::Halt);
    bench.run(1_500);
    let from = ends(&bench);
    bench.order(Order::MoveRelative { distance: 7_000, velocity: None });
    bench.run(3_000);
    let to = ends(&bench);
    assert_eq!((to.0 - from.0, to.1 - from.1), (7_000, -3_000));
}

/// The master's encoder breaks: both axes are stopped in the same cycle, and both failures stored.
#[test]
fn an_axis_does_not_follow_a_broken_encoder() {
    let (mut bench, ticket) = geared_axis(0, &[]);
    bench.order(Order::MoveVelocity { velocity: 7_000 });
    bench.run(900);
    let before = slave(&bench).nominal_velocity;
    assert!((before + 3_000.0).abs() < 100.0, "{before}");
    bench.inputs.encoders[0].fault = true;
    bench.cycle();
    let error = MotionError::from_failure(READING_LOST);
    assert_eq!((bench.status().state, bench.status().error), (State::ErrorStop, error));
    assert_eq!((slave(&bench).state, slave(&bench).error), (State::ErrorStop, error));
    assert!((slave(&bench).nominal_velocity - before - 120.0).abs() < 1.0, "brakes from where it is");
    assert_eq!(bench.controller.axis(SLAVE).unwrap().progress(ticket), Progress::Failed(error));
    let stored: Vec<_> = (0..2).map(|at| bench.controller.failure(at).unwrap()).collect();
    assert_eq!(
        stored.iter().map(|stored| (stored.axis, stored.failure)).collect::<Vec<_>>(),
        [(1, READING_LOST), (2, READING_LOST)]
    );
    assert_eq!(bench.controller.failure_count(), 2);
    bench.run(500);
    assert!(bench.machine.axes[1].plant.velocity().abs() < 1.0);
}

/// SetPosition on the master moves its scale, and the slave not at all.
#[test]
fn a_position_set_on_the_master_moves_no_slave() {
    let virtual_axis = [(606, 8)];
    for (quantity, master) in [(0, &[][..]), (2, &[]), (2, &virtual_axis)] {
        let (mut bench, _) = geared_axis(quantity, master);
        bench.order(Order::MoveAbsolute { position: 3_500, velocity: None });
        bench.run(3_000);
        let before = bench.machine.axes[1].plant.position();
        bench.controller.axis(MASTER.axis).unwrap().set_position(-90_000).unwrap();
        bench.run(500);
        assert_eq!(bench.status().position, -90_000);
        assert!((bench.machine.axes[1].plant.position() - before).abs() < 1.0);
        bench.order(Order::MoveRelative { distance: 700, velocity: None });
        bench.run(2_000);
        let moved = bench.machine.axes[1].plant.position() - before;
        assert!((moved + 300.0).abs() <= 1.0, "{moved}");
        assert_eq!(bench.controller.failure_count(), 0);
    }
}

/// Nor where the reading of that very cycle is one that input 3 suppresses, `[184]`.
#[test]
fn a_position_set_on_a_master_that_jumps_moves_no_slave() {
    let (mut bench, _) = geared_axis(0, &[(184 + GEAR as u16, 100), (191 + GEAR as u16, 1)]);
    bench.controller.axis(MASTER.axis).unwrap().set_power(false).unwrap();
    bench.run(12);
    bench.controller.axis(MASTER.axis).unwrap().set_position(-90_000).unwrap();
    let before = slave(&bench);
    bench.cycle();
    bench.inputs.encoders[0].count += 1_000;
    for reading in [Reading::Extrapolated, Reading::Real, Reading::Real] {
        bench.cycle();
        assert_eq!(bench.controller.actual_values()[GEAR].reading, reading);
        assert_eq!(slave(&bench), before);
    }
    assert_eq!(bench.controller.failure_count(), 0);
}
