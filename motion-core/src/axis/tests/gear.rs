//! Gearing to an actual value input.

use super::*;
use crate::failure::{HW_LIMIT_PLUS, READING_LOST};

/// Input 3.
const MASTER: u8 = 3;
const GEAR: Order = Order::GearIn { master: MASTER, numerator: -3, denominator: 7 };

/// Where −3/7 of a way ends.
fn geared(way: i32) -> i32 {
    (-3 * way).div_euclid(7)
}

fn gear(numerator: i32, denominator: u32) -> Order {
    Order::GearIn { master: MASTER, numerator, denominator }
}

fn with(changes: &[(u16, i32)]) -> Rig {
    let mut rig = rig(&[&[(690, 100), (732, 1)], changes].concat());
    rig.inputs[2].reading = Reading::Real;
    rig
}

/// A cycle in which the master moves on.
fn moved(rig: &mut Rig, way: i32) -> AxisStatus {
    let master = &mut rig.inputs[2];
    master.position = master.position.wrapping_add(way);
    master.velocity = way * 1000;
    let status = rig.cycle().status;
    (rig.inputs[2].shift, rig.inputs[2].failure) = (0, None);
    status
}

/// A cycle in which the master's scale moves, and the master does not.
fn shifted(rig: &mut Rig, shift: i32) -> AxisStatus {
    let master = &mut rig.inputs[2];
    (master.position, master.velocity) = (master.position.wrapping_add(shift), 0);
    master.shift = shift;
    let status = rig.cycle().status;
    rig.inputs[2].shift = 0;
    status
}

fn order(rig: &mut Rig, order: Order, way: i32) -> AxisStatus {
    rig.input.order = Some(order);
    moved(rig, way)
}

/// In every cycle the set value is where the master was a cycle before, to the unit, whatever its way.
#[test]
fn the_way_is_the_masters_times_the_ratio() {
    let mut rig = with(&[]);
    rig.inputs[2].position = i32::MAX - 300;
    assert!(order(&mut rig, GEAR, 0).in_velocity, "at rest it is in gear at once");
    assert_eq!(rig.output.status.state, State::SynchronizedMotion);
    let (mut way, mut random) = (0, 1u32);
    for cycle in 0..3_000 {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let step = if cycle < 2_900 { (random >> 24) as i32 / 16 - 6 } else { 0 };
        let status = moved(&mut rig, step);
        assert_eq!(status.nominal_position, geared(way), "cycle {cycle}");
        assert!(status.in_velocity && status.deviation.abs() <= 2, "{status:?}");
        way += step;
    }
    assert!(way > 3_000, "past the end of the range");
    assert_eq!((rig.position.round() as i32, rig.failures.len()), (geared(way), 0));
}

/// Onto a master that moves: within acceleration and jerk, in V/a + a/j as from rest; then rigid.
#[test]
fn getting_in_gear_keeps_within_the_limits() {
    let mut rig = with(&[]);
    for _ in 0..10 {
        moved(&mut rig, 5);
    }
    let (mut last, mut ms) = ((0.0, 0.0), 0);
    let mut status = order(&mut rig, gear(-1, 1), 5);
    while !status.in_velocity {
        let acceleration = (status.nominal_velocity - last.0) * 1000.0;
        assert!(acceleration.abs() <= 20_000.0 + 1e-6, "{acceleration} at {ms} ms");
        assert!((acceleration - last.1).abs() <= 200.0 + 1e-6, "jerk at {ms} ms");
        last = (status.nominal_velocity, acceleration);
        status = moved(&mut rig, 5);
        ms += 1;
    }
    assert!((349..=351).contains(&ms), "{ms} ms");
    let (from, mut way) = (status.nominal_position, 0);
    for _ in 0..500 {
        way += 5;
        let status = moved(&mut rig, 5);
        assert_eq!((status.nominal_position, status.nominal_velocity), (from - way, -5_000.0));
    }
}

/// From a motion of its own, the other way round, without a step.
#[test]
fn getting_in_gear_from_a_motion() {
    let mut rig = with(&[]);
    rig.order(Order::MoveVelocity { velocity: 8_000 });
    rig.run(1_000);
    let mut last = 8_000.0;
    let mut status = order(&mut rig, gear(-1, 1), 4);
    assert_eq!(rig.last_end(), None);
    for _ in 0..1_000 {
        assert!((status.nominal_velocity - last).abs() <= 20.0 + 1e-6);
        last = status.nominal_velocity;
        status = moved(&mut rig, 4);
    }
    assert_eq!((last, status.in_velocity), (-4_000.0, true));
}

/// A master that fails, is switched off or jumps: the axis brakes in the same cycle and says why.
#[test]
fn the_masters_failure_stops_the_axis() {
    let jump = Some(crate::failure::ACTUAL_VALUE_JUMP);
    let lost = Some(READING_LOST);
    for (reading, failure, expected) in [
        (Reading::Lost, lost, lost),
        (Reading::Lost, None, lost),
        (Reading::None, None, lost),
        (Reading::Real, jump, jump),
    ] {
        let mut rig = with(&[]);
        order(&mut rig, gear(1, 1), 5);
        for _ in 0..1_000 {
            moved(&mut rig, 5);
        }
        (rig.inputs[2].reading, rig.inputs[2].failure) = (reading, failure);
        let status = moved(&mut rig, 0);
        let error = MotionError::from_failure(expected.unwrap());
        assert_eq!((status.state, status.error, rig.output.failure), (State::ErrorStop, error, expected));
        assert!(status.nominal_velocity < 5_000.0 && status.nominal_velocity > 4_900.0);
        assert_eq!(rig.last_end(), Some(Progress::Failed(error)));
        assert_eq!(rig.run(600).status.nominal_velocity, 0.0);
        // What is extrapolated is followed, what is not there is not.
        rig.input.reset = true;
        rig.cycle();
        rig.inputs[2].reading = Reading::Lost;
        order(&mut rig, GEAR, 0);
        assert_eq!(rig.last_end(), Some(Progress::Failed(MotionError::from_failure(READING_LOST))));
        rig.inputs[2].reading = Reading::Extrapolated;
        assert_eq!(order(&mut rig, GEAR, 0).state, State::SynchronizedMotion);
    }
}

/// Calibration of the master moves its scale, not the axis.
#[test]
fn a_calibrated_master_moves_nothing() {
    let mut rig = with(&[]);
    order(&mut rig, gear(1, 1), 0);
    let at = moved(&mut rig, 5).nominal_position;
    rig.inputs[2].shift = -40_000;
    moved(&mut rig, -40_000 + 5);
    assert_eq!(moved(&mut rig, 0).nominal_position, at + 10);
    assert!(rig.failures.is_empty());
}

/// In the cycle of the order too, and in those in which the brake opens.
#[test]
fn a_master_calibrated_as_gearing_begins_moves_nothing() {
    let mut rig = with(&[]);
    let before = rig.output.status.nominal_position;
    rig.input.order = Some(gear(1, 1));
    let status = shifted(&mut rig, -40_000);
    assert!(status.in_velocity, "{status:?}");
    assert_eq!(moved(&mut rig, 0).nominal_position, before);

    let mut rig = with(&[(744, 1), (732, 0)]);
    let before = order(&mut rig, gear(1, 1), 0).nominal_position;
    for _ in 0..20 {
        shifted(&mut rig, 700);
    }
    assert_eq!((moved(&mut rig, 0).nominal_position, rig.failures.len()), (before, 0));
    assert!(rig.output.status.in_velocity);
}

#[test]
fn out_of_gear_the_axis_goes_on() {
    let mut rig = with(&[]);
    order(&mut rig, gear(2, 1), 2);
    for _ in 0..1_000 {
        moved(&mut rig, 2);
    }
    let status = order(&mut rig, Order::GearOut, 0);
    assert_eq!((rig.last_end(), status.state), (Some(Progress::Done), State::ContinuousMotion));
    for _ in 0..100 {
        assert_eq!(moved(&mut rig, 7).nominal_velocity, 4_000.0, "whatever the master does");
    }
    rig.order(Order::Halt);
    rig.run(500);
    order(&mut rig, Order::GearOut, 0);
    assert_eq!(rig.last_end(), Some(Progress::Failed(MotionError::NOT_GEARED)));
    // From a standstill it is one.
    order(&mut rig, gear(2, 1), 0);
    order(&mut rig, Order::GearOut, 0);
    assert_eq!((rig.last_end(), rig.output.status.state), (Some(Progress::Done), State::Standstill));
}

/// Every other order takes over where the axis is and as fast as it is; and so does a stop of the application.
#[test]
fn other_orders_take_over_from_gearing() {
    let orders = [
        Some(Order::Halt),
        Some(Order::Stop),
        Some(Order::MoveAbsolute { position: 20_000, velocity: None }),
        Some(Order::MoveVelocity { velocity: -1_000 }),
        Some(Order::Jog { forward: true, fast: false }),
        None,
    ];
    for next in orders {
        let mut rig = with(&[(756, 500)]);
        order(&mut rig, gear(1, 1), 5);
        for _ in 0..1_000 {
            moved(&mut rig, 5);
        }
        let mut last = rig.output.status;
        match next {
            Some(next) => rig.input.order = Some(next),
            None => rig.input.stop = Some(crate::control::PlcStop::Regulate),
        }
        for _ in 0..2_000 {
            let status = moved(&mut rig, 5);
            let change = status.nominal_velocity - last.nominal_velocity;
            assert!(change.abs() <= 20.0 + 1e-6, "{next:?}: {change}");
            let way = f64::from(status.nominal_position - last.nominal_position);
            assert!((way - last.nominal_velocity / 1000.0).abs() <= 1.1, "{next:?}: {way}");
            last = status;
        }
        let expected = match next {
            Some(Order::MoveVelocity { .. }) => -1_000.0,
            Some(Order::Jog { .. }) => 500.0,
            _ => 0.0,
        };
        assert_eq!(last.nominal_velocity, expected, "{next:?}");
    }
}

/// Faster than V max. it cannot follow: failure 5 or 6, whatever [696] and [702] say.
#[test]
fn a_master_that_is_too_fast() {
    for (sign, failure) in [(1, Failure::DELTA_S_MAX), (-1, Failure::DELTA_S_MIN)] {
        let mut rig = with(&[]);
        order(&mut rig, gear(sign, 1), 0);
        for way in 0..=10 {
            moved(&mut rig, way);
        }
        assert!(rig.failures.is_empty(), "10,000 a second are V max.");
        moved(&mut rig, 11);
        assert_eq!((&rig.failures[..], rig.output.status.state), (&[failure][..], State::ErrorStop));
        rig.run(1_000);
        rig.input.reset = true;
        rig.cycle();
        order(&mut rig, gear(sign, 1), 11);
        assert_eq!(rig.last_end(), Some(Progress::Failed(MotionError::RANGE)));
    }
}

#[test]
fn limit_switches_while_geared() {
    let mut rig = with(&[(948, 2), (954, 6)]);
    order(&mut rig, gear(1, 1), 0);
    for _ in 0..200 {
        moved(&mut rig, 5);
    }
    rig.input.digital.set(Terminal::new(2, 0).unwrap(), true);
    moved(&mut rig, 5);
    assert_eq!((&rig.failures[..], rig.output.status.state), (&[HW_LIMIT_PLUS][..], State::ErrorStop));
    for _ in 0..600 {
        moved(&mut rig, 0);
    }
    // Off it with the master, not on.
    order(&mut rig, gear(1, 1), 0);
    moved(&mut rig, 5);
    assert_eq!(rig.output.status.state, State::ErrorStop);
    for _ in 0..600 {
        moved(&mut rig, 0);
    }
    order(&mut rig, gear(1, 1), 0);
    for _ in 0..100 {
        moved(&mut rig, -5);
    }
    assert_eq!(rig.output.status.state, State::SynchronizedMotion);
}

/// `[744]`: while the brake opens the axis stands; then it gets in gear with what the master does then.
#[test]
fn the_brake_opens_first() {
    let mut rig = with(&[(744, 5), (732, 0)]);
    let before = order(&mut rig, gear(1, 1), 2).nominal_position;
    for way in [2, 5] {
        for _ in 0..24 {
            let status = moved(&mut rig, way);
            assert_eq!((status.nominal_position, rig.output.command.velocity), (before, 0.0));
        }
    }
    for _ in 0..400 {
        moved(&mut rig, 5);
    }
    assert!(rig.output.status.in_velocity && rig.failures.is_empty());
    assert_eq!(rig.output.status.nominal_velocity, 5_000.0);
}

#[test]
fn what_cannot_be_geared_is_refused() {
    let refused = |changes: &[(u16, i32)], order| {
        let mut rig = with(changes);
        rig.order(order);
        rig.last_end()
    };
    let failed = |error| Some(Progress::Failed(error));
    for master in [0, 7, 255] {
        let order = Order::GearIn { master, numerator: 1, denominator: 1 };
        assert_eq!(refused(&[], order), failed(MotionError::RANGE));
    }
    assert_eq!(refused(&[], gear(0, 1)), failed(MotionError::RANGE));
    assert_eq!(refused(&[], gear(1, 0)), failed(MotionError::RANGE));
    let own = Order::GearIn { master: 1, numerator: 1, denominator: 1 };
    assert_eq!(refused(&[], own), failed(MotionError::RANGE), "itself");
    for mode in [2, 3] {
        assert_eq!(refused(&[(600, mode)], GEAR), failed(MotionError::NOT_CONFIGURED));
    }
    assert_eq!(refused(&[(654, 0)], GEAR), failed(MotionError::NOT_CONFIGURED));
    // Another mode while geared brings it to rest.
    let mut rig = with(&[(894, 1_000)]);
    order(&mut rig, gear(1, 1), 0);
    for _ in 0..100 {
        moved(&mut rig, 5);
    }
    rig.set(600, 3);
    for _ in 0..1_000 {
        assert!(moved(&mut rig, 5).nominal_velocity.abs() <= 5_000.0);
    }
    assert_eq!((rig.output.status.state, rig.output.command.velocity), (State::Standstill, 0.0));
}

/// Parameters with which gearing could not begin end it, within the limits that the axis had.
#[test]
fn gearing_ends_with_the_parameters_it_needs() {
    for changes in [&[(654, 0), (600, 3)][..], &[(654, 0), (600, 2)], &[(654, 0)]] {
        let mut rig = with(&[]);
        order(&mut rig, gear(1, 1), 5);
        for _ in 0..1_000 {
            moved(&mut rig, 5);
        }
        for &(index, value) in changes {
            rig.values.set(index, value).unwrap();
        }
        rig.axis.configure(&rig.values, 0, 1);
        let mut last = rig.output.status.nominal_velocity;
        for _ in 0..1_000 {
            let velocity = moved(&mut rig, 5).nominal_velocity;
            assert!((velocity - last).abs() <= 20.0 + 1e-6 || changes.contains(&(600, 2)), "{velocity}");
            last = velocity;
        }
        assert_eq!((rig.output.status.state, last), (State::Standstill, 0.0), "{changes:?}");
        order(&mut rig, Order::GearOut, 5);
        assert_eq!(rig.last_end(), Some(Progress::Failed(MotionError::NOT_GEARED)));
    }
}

/// The largest ratio and way there are: nothing overflows.
#[test]
fn extreme_ratios() {
    for (numerator, denominator) in [(i32::MIN, 1), (i32::MAX, u32::MAX), (1, u32::MAX), (i32::MIN, u32::MAX)]
    {
        let mut rig = with(&[]);
        order(&mut rig, gear(numerator, denominator), 0);
        for way in [i32::MAX, i32::MIN, 1, -1, 0] {
            rig.inputs[2].position = rig.inputs[2].position.wrapping_add(way);
            assert!(rig.cycle().status.nominal_velocity.is_finite());
        }
    }
}
