//! Velocities, accelerations, jerk, tool correction and brake: 6.8.1.1, modes Control and Ramps.

use motion_core::application::{MotionError, Order, Progress};

use super::bench::{Bench, CONTROL, Effect, Family, RAMPS, SIGNALS, V_MAX};

const DRIVEN: [i32; 2] = [CONTROL, RAMPS];
const FORWARD: Order = Order::MoveVelocity { velocity: 10_000 };

fn effect<'a>(parameter: u16, left: f64, cases: &'a [(i32, f64)], tolerance: f64) -> Effect<'a> {
    Effect { family: Family::Axes, modes: &DRIVEN, parameter, base: &[], left, cases, tolerance }
}

/// ms from standstill to half of V max.
fn half(bench: &mut Bench) -> f64 {
    bench.order(FORWARD);
    bench.until(|bench| bench.speed() >= V_MAX / 2.0)
}

/// ms from V max. down to half of it.
fn braking(bench: &mut Bench, order: Order) -> f64 {
    bench.order(FORWARD);
    bench.run(3_000);
    assert!((bench.speed() - V_MAX).abs() < 10.0, "{}", bench.speed());
    bench.order(order);
    bench.until(|bench| bench.speed() <= V_MAX / 2.0)
}

/// `[642]`: V max. is what the output's 10 V stand for, and no order may ask for more.
#[test]
fn parameter_642_is_the_highest_velocity() {
    effect(642, 1_000.0, &[(5_000, 2_000.0), (20_000, 500.0)], 4.0)
        .shows(|bench| bench.jog_speed(true, false));
    let allowed = [(5_000, 0.0), (6_001, 1.0), (20_000, 1.0)];
    effect(642, 1.0, &allowed, 0.0).shows(|bench| {
        let progress = bench.ordered(Order::MoveVelocity { velocity: 6_000 }, 60);
        let refused = progress == Progress::Failed(MotionError::RANGE);
        assert_eq!(bench.real() == 0.0, refused);
        f64::from(u8::from(!refused))
    });
}

/// `[654]`: from standstill to V max.; with 0 nothing is positioned.
#[test]
fn parameter_654_is_the_time_of_greatest_acceleration() {
    effect(654, 250.0, &[(200, 100.0), (1_000, 500.0), (0, -1.0)], 16.0).shows(half);
}

/// `[660]`: a Stop from V max. takes this; with 0 as long as `[654]`.
#[test]
fn parameter_660_is_the_time_of_greatest_deceleration() {
    let cases = [(200, 100.0), (1_000, 500.0), (0, 250.0)];
    Effect { base: &[(678, 3_000)], ..effect(660, 250.0, &cases, 16.0) }
        .shows(|bench| braking(bench, Order::Stop));
}

/// `[666]`: the working acceleration.
#[test]
fn parameter_666_is_the_working_acceleration() {
    effect(666, 250.0, &[(1_000, 500.0), (2_000, 1_000.0), (0, 250.0)], 16.0).shows(half);
}

/// `[678]`: the working deceleration.
#[test]
fn parameter_678_is_the_working_deceleration() {
    effect(678, 250.0, &[(1_000, 500.0), (2_000, 1_000.0), (0, 250.0)], 16.0)
        .shows(|bench| braking(bench, Order::Halt));
}

/// `[684]`: the velocity of orders that name none; V max. where it is 0.
#[test]
fn parameter_684_is_the_working_velocity() {
    effect(684, V_MAX, &[(2_500, 2_500.0), (5_000, 5_000.0), (0, V_MAX)], 4.0).shows(|bench| {
        bench.order(Order::MoveAbsolute { position: 20_000, velocity: None });
        bench.run(1_500);
        bench.speed()
    });
}

/// `[690]`: the time to the greatest acceleration is added to that to V max.
#[test]
fn parameter_690_limits_the_jerk() {
    effect(690, 250.0, &[(100, 300.0), (400, 450.0)], 16.0).shows(half);
}

/// `[720]`: added to every position that is ordered.
#[test]
fn parameter_720_corrects_for_the_tool() {
    effect(720, 1_000.0, &[(-150, 850.0), (300, 1_300.0)], 21.0).shows(|bench| {
        bench.go(1_000);
        bench.run(500);
        bench.real()
    });
}

/// `[744]`: from the start signal until the axis moves.
#[test]
fn parameter_744_delays_the_start() {
    Effect { modes: &[CONTROL, RAMPS, SIGNALS], ..effect(744, 6.0, &[(30, 300.0), (100, 1_000.0)], 13.0) }
        .shows(|bench| {
            bench.order(Order::MoveAbsolute { position: 5_000, velocity: None });
            bench.until(|bench| bench.speed() > 1.0)
        });
}

/// `[750]`: once the nominal position is reached, an axis that is pushed away is driven back for this time.
#[test]
fn parameter_750_delays_the_end_of_control() {
    Effect { base: &[(738, 0)], ..effect(750, 0.0, &[(20, 200.0), (60, 600.0)], 13.0) }.shows(|bench| {
        assert!(bench.go(1_000) > 0.0);
        // As long as the voltage works against it.
        let mut first = true;
        bench.until(|bench| {
            let released = !core::mem::take(&mut first) && bench.voltage() == 0;
            bench.push(900.0);
            released
        }) - 6.0
    });
}
