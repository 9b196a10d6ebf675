//! A master and what another axis takes over of it by way of Virtual2 (6.6.1.5): exact in every cycle.

use device_sim::plant::{Connection, Drive, Incremental, Plant, Sensor, Stepper, Wiring};
use motion_core::application::Order;
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
fn moves(mut bench: Bench, expected: impl Fn(&Bench, &motion_core::application::AxisStatus) -> i32) {
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

/// An axis that is sent to where its master's gear is, cycle by cycle: it goes along, and rests where the
/// master's increments put it, both ways.
#[test]
fn an_axis_follows_another_one_to_the_increment() {
    let mut bench = bench(0, &[]);
    let plant = Plant::new(Drive::first_order(V_MAX, 0.005));
    let sensor = Sensor::Incremental(Incremental::new(1.0, 0, 0));
    let connection = Connection::Analog { block: SLAVE, unipolar: false };
    bench.machine.axes.push(Wiring::new(plant, connection, sensor));
    bench.controller.axis(SLAVE).unwrap().set_power(true).unwrap();
    bench.run(12);
    for position in WAYS {
        bench.order(Order::MoveAbsolute { position, velocity: None });
        let (mut farthest, end) = (0, bench.now_ms() + 3_000);
        while bench.now_ms() < end {
            let target = bench.controller.actual_values()[GEAR].position;
            let order = Order::MoveAbsolute { position: target, velocity: None };
            bench.controller.axis(SLAVE).unwrap().order(order).unwrap();
            bench.cycle();
            let slave = bench.controller.axis_status(SLAVE).unwrap();
            farthest = farthest.max((slave.position - target).abs());
        }
        let rest = geared(position);
        assert_eq!(bench.status().position, position);
        assert_eq!(bench.controller.axis_status(SLAVE).unwrap().position, rest);
        assert_eq!(bench.machine.axes[1].plant.position().floor() as i32, rest);
        // It goes along: a tenth of the longest way at most behind.
        assert!(farthest < 900, "{farthest}");
    }
}
