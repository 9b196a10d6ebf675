//! Mode Control: 6.8.1.1.

use super::*;

/// `[600]`: None takes no orders; the others drive, each in its way.
#[test]
fn parameter_600_is_the_controlling_mode() {
    let first = |mode| {
        let mut rig = rig(&[(600, mode), (894, 2000)]);
        rig.go(1_000);
        let command = rig.run(20).command;
        (rig.last_end(), command.velocity > 0.0, command.signals.slow)
    };
    let refused = Some(Progress::Failed(MotionError::NOT_CONFIGURED));
    assert_eq!(
        [0, 1, 2, 3].map(first),
        [(refused, false, false), (None, true, false), (None, false, true), (None, true, false)]
    );
}

/// 7.2: the actual value wraps at ±2^31 and an axis goes on, controlled or not, with an encoder or virtual,
/// and is positioned beyond.
#[test]
fn a_velocity_goes_on_where_the_position_wraps() {
    for changes in [&[][..], &[(600, 3), (894, 4_000)], &[(606, 8)]] {
        for sign in [1, -1] {
            let mut rig = rig(&[&[(696, 50), (702, 50)], changes].concat());
            let edge = if sign > 0 { i32::MAX } else { i32::MIN };
            let start = edge - sign * 9_000;
            rig.position = f64::from(start);
            rig.input.actual.shift = start;
            rig.input.actual.position = start;
            rig.cycle();
            rig.order(Order::MoveVelocity { velocity: sign * 10_000 });
            for _ in 0..2_000 {
                let status = rig.cycle().status;
                assert_eq!(status.state, State::ContinuousMotion, "{status:?}");
                assert!(rig.output.command.velocity.abs() <= 10_000.0 && status.deviation.abs() <= 50);
            }
            assert_eq!((rig.output.status.position < 0, rig.failures.len()), (sign > 0, 0));
            let target = edge.wrapping_add(sign * 30_000);
            rig.order(Order::Halt);
            rig.run(600);
            rig.go(target);
            let took = rig.until("arrived", |rig| rig.output.status.at_target);
            assert!(took < 6_000, "{changes:?}: {took} ms");
            assert!((rig.output.status.position - target).abs() <= 5);
        }
    }
}

/// `[606]`: Virtual follows its set values without deviation; None takes no orders.
#[test]
fn parameter_606_virtual_is_an_axis_without_following_error() {
    let mut rig = rig(&[(606, 8)]);
    rig.gain = 0.0;
    rig.go(3_000);
    while rig.ended.is_empty() {
        assert_eq!(rig.cycle().status.deviation, 0);
    }
    assert_eq!((rig.output.status.position, rig.last_end()), (3_000, Some(Progress::Done)));
    let mut rig = super::rig(&[(606, 0)]);
    rig.go(3_000);
    assert_eq!(rig.last_end(), Some(Progress::Failed(MotionError::NOT_CONFIGURED)));
}

/// `[642]`: no velocity above it, neither of an order nor by feedback; it is the output's scale.
#[test]
fn parameter_642_is_the_highest_velocity() {
    let mut rig = rig(&[(642, 4_000), (648, 9_999)]);
    rig.lag = 0.02;
    rig.order(Order::MoveAbsolute { position: 9_000, velocity: Some(4_001) });
    assert_eq!(rig.last_end(), Some(Progress::Failed(MotionError::RANGE)));
    rig.go(9_000);
    let mut most = 0.0_f64;
    rig.until("arrived", |rig| {
        most = most.max(rig.output.command.velocity.abs());
        rig.ended.len() == 2
    });
    assert_eq!((most, rig.output.command.maximum), (4_000.0, 4_000.0));
}

/// `[684]`: the velocity of orders that name none; V max. where it is 0.
#[test]
fn parameter_684_is_the_working_velocity() {
    let fastest = |working| {
        let mut rig = rig(&[(684, working)]);
        rig.go(20_000);
        rig.extremes().0
    };
    assert_eq!([0, 2_500, 10_000].map(fastest), [10_000.0, 2_500.0, 10_000.0]);
}

/// `[648]`: KSP times the deviation is added to the set velocity.
#[test]
fn parameter_648_is_the_feedback_factor() {
    for (ksp, expected) in [(0, 0.0), (100, 10.0 * 30.0), (9_999, 999.9 * 30.0)] {
        let mut rig = rig(&[(648, ksp), (642, 3_000_000), (732, 1)]);
        rig.position = -30.0;
        rig.gain = 0.0;
        let velocity = rig.cycle().command.velocity;
        assert!(near(velocity, expected, 1e-12), "{ksp}: {velocity}");
    }
    // With it a drive that is 2 % too slow arrives, without it does not.
    let rest = |ksp| {
        let mut rig = rig(&[(648, ksp)]);
        rig.gain = 0.98;
        rig.go(10_000);
        rig.run(4_000).status.deviation
    };
    assert_eq!([0, 200].map(rest).map(|rest| rest.abs() > 100), [true, false]);
}

/// `[654]`: from standstill to V max.; with 0 no positioning.
#[test]
fn parameter_654_is_the_time_of_greatest_acceleration() {
    for time in [100, 500, 2_000] {
        let mut rig = rig(&[(654, time)]);
        rig.order(Order::MoveVelocity { velocity: 10_000 });
        let took = 1 + rig.until("in velocity", |rig| rig.output.status.in_velocity);
        assert!(took.abs_diff(time as u32) <= 1, "{took} ms for {time}");
    }
    let mut rig = rig(&[(654, 0)]);
    rig.go(100);
    assert_eq!(rig.last_end(), Some(Progress::Failed(MotionError::NOT_CONFIGURED)));
}

/// `[660]`: a Stop takes this from V max.; 0 = `[654]`.
#[test]
fn parameter_660_is_the_time_of_greatest_deceleration() {
    for (time, expected) in [(0, 500), (200, 200), (1_000, 1_000)] {
        let mut rig = rig(&[(660, time), (678, 3_000)]);
        rig.order(Order::MoveVelocity { velocity: 10_000 });
        rig.run(1_000);
        rig.order(Order::Stop);
        let took = 1 + rig.until("stopped", |rig| rig.last_end() == Some(Progress::Done));
        assert!(took.abs_diff(expected) <= 1, "{took} ms for {time}");
    }
}

/// `[666]`: the working acceleration; never harder than `[654]`.
#[test]
fn parameter_666_is_the_working_acceleration() {
    for (time, expected) in [(0, 20_000.0), (1_000, 10_000.0), (100, 20_000.0)] {
        let mut rig = rig(&[(666, time)]);
        rig.go(20_000);
        let (_, up, down) = rig.extremes();
        assert!(near(up, expected, 1e-6) && near(down, 20_000.0, 1e-3), "{time}: {up} {down}");
    }
}

/// `[678]`: the working deceleration; never harder than `[660]`.
#[test]
fn parameter_678_is_the_working_deceleration() {
    for (time, expected) in [(0, 20_000.0), (1_000, 10_000.0), (100, 20_000.0)] {
        let mut rig = rig(&[(678, time)]);
        rig.go(20_000);
        let (_, up, down) = rig.extremes();
        assert!(near(down, expected, 1e-3) && near(up, 20_000.0, 1e-6), "{time}: {up} {down}");
    }
}

/// `[690]`: the time to the greatest acceleration; 0 = a trapezoid.
#[test]
fn parameter_690_limits_the_jerk() {
    for time in [0, 100, 400] {
        let mut rig = rig(&[(690, time)]);
        rig.order(Order::MoveVelocity { velocity: 10_000 });
        let took = 1 + rig.until("in velocity", |rig| rig.output.status.in_velocity);
        // Up to the acceleration and from it back: one jerk time more.
        assert!(took.abs_diff(500 + time as u32) <= 1, "{took} ms for {time}");
    }
}

/// `[708]`, `[714]`: the window around the nominal position in which `actual = nominal` lasts.
fn window(parameter: u16, sign: f64) {
    let mut rig = rig(&[(parameter, 40), (738, 0)]);
    rig.arrive(1_000);
    for (off, expected) in [(40.0, true), (41.0, false), (40.0, true), (-6.0, false)] {
        rig.position = 1_000.0 + sign * off;
        assert_eq!(rig.cycle().status.at_target, expected, "{off}");
    }
}

#[test]
fn parameter_708_is_the_tolerance_below() {
    window(708, -1.0);
}

#[test]
fn parameter_714_is_the_tolerance_above() {
    window(714, 1.0);
}

/// `actual = nominal` only after the nominal position has been reached once.
#[test]
fn passing_the_window_is_no_arrival() {
    let mut rig = rig(&[(708, 5_000), (714, 5_000)]);
    rig.go(4_000);
    let arrival = rig.until("at target", |rig| rig.output.status.at_target);
    let way = (4_000.0_f64 / 20_000.0).sqrt() * 2_000.0;
    assert!((f64::from(arrival) - way).abs() <= 2.0, "{arrival} ms, {way} expected");
}

/// `[720]`: added to every position that is ordered.
#[test]
fn parameter_720_corrects_for_the_tool() {
    let mut rig = rig(&[(720, -15)]);
    rig.arrive(1_000);
    assert_eq!(rig.output.status.nominal_position, 985);
    rig.order(Order::MoveRelative { distance: 100, velocity: None });
    rig.until("arrived", |rig| rig.ended.len() == 2);
    assert_eq!(rig.output.status.nominal_position, 985 + 85);
}

/// `[732]`: holds the position after a stop; without it, it drifts.
#[test]
fn parameter_732_controls_the_position_in_stop() {
    let after = |choice| {
        let mut rig = rig(&[(732, choice)]);
        rig.order(Order::Halt);
        rig.run(2);
        rig.position += 50.0;
        rig.run(500);
        rig.position.round()
    };
    assert_eq!([0, 1].map(after), [50.0, 0.0]);
}

/// `[738]`: holds the nominal position once it is reached.
#[test]
fn parameter_738_controls_the_nominal_position() {
    let after = |choice| {
        let mut rig = rig(&[(738, choice)]);
        rig.arrive(1_000);
        rig.position += 50.0;
        rig.run(500);
        rig.position.round()
    };
    assert_eq!([0, 1].map(after), [1_050.0, 1_000.0]);
}

/// `[744]`: the control waits for the brake to open, the drive is enabled meanwhile.
#[test]
fn parameter_744_delays_the_start() {
    for time in [0, 3, 50] {
        let mut rig = rig(&[(744, time), (738, 0)]);
        assert_eq!(rig.output.command.enable, time == 0);
        let first = rig.go(1_000);
        assert!(first.command.enable);
        let waited = rig.until("moving", |rig| rig.output.command.velocity > 0.0);
        assert_eq!(waited, time as u32 * 10);
        // At work the brake is open: another order starts at once.
        rig.go(-1_000);
        assert!(rig.run(200).command.velocity < 0.0);
    }
}

/// `[750]`: after the window is reached, the control goes on so long.
#[test]
fn parameter_750_delays_the_end_of_control() {
    for time in [0, 4, 20] {
        let mut rig = rig(&[(744, 1), (750, time), (738, 0), (708, 100)]);
        rig.arrive(1_000);
        rig.position = 950.0;
        rig.gain = 0.0;
        let held = rig.until("released", |rig| !rig.output.command.enable);
        assert_eq!(held, time as u32 * 10, "{time}");
    }
}

/// `[756]`…`[774]`: the four velocities of manual operation.
fn jog(parameter: u16, forward: bool, fast: bool) {
    let mut rig = rig(&[(756, 11), (762, 12), (768, 13), (774, 14), (parameter, 700)]);
    rig.order(Order::Jog { forward, fast });
    rig.until("in velocity", |rig| rig.output.status.in_velocity);
    assert_eq!(rig.output.status.nominal_velocity, if forward { 700.0 } else { -700.0 });
    assert_eq!(rig.output.status.state, State::ContinuousMotion);
}

#[test]
fn parameter_756_is_jog_slow_forward() {
    jog(756, true, false);
}

#[test]
fn parameter_762_is_jog_fast_forward() {
    jog(762, true, true);
}

#[test]
fn parameter_768_is_jog_slow_backward() {
    jog(768, false, false);
}

#[test]
fn parameter_774_is_jog_fast_backward() {
    jog(774, false, true);
}

/// `[780]`: the keys' direction is swapped.
#[test]
fn parameter_780_swaps_the_jog_keys() {
    let velocity = |choice| {
        let mut rig = rig(&[(780, choice), (756, 100), (768, 200)]);
        rig.order(Order::Jog { forward: true, fast: false });
        rig.run(100).command.velocity.round()
    };
    assert_eq!([0, 1].map(velocity), [100.0, -200.0]);
}

/// `[786]`: with feedback the jog keeps to its set position, without it the voltage is fixed.
#[test]
fn parameter_786_controls_the_jog() {
    let after = |choice| {
        let mut rig = rig(&[(786, choice), (756, 1_000)]);
        rig.gain = 0.9;
        rig.order(Order::Jog { forward: true, fast: false });
        rig.run(3_000);
        (rig.output.command.velocity.round(), rig.output.status.deviation.abs() <= 1)
    };
    assert_eq!(after(0), (1_000.0, true));
    let (velocity, follows) = after(1);
    assert!((1_100.0..1_125.0).contains(&velocity) && !follows, "{velocity}");
}

/// 6.11: 1,000,000 increments at V max. 3,276,800 arrive within a cycle of the analytic time.
#[test]
fn arrival_is_that_of_the_formula() {
    let mut rig = rig(&[(642, 3_276_800), (690, 100), (708, 0), (714, 0)]);
    let took = rig.arrive(1_000_000);
    let (v, a) = (3_276_800.0_f64, 6_553_600.0_f64);
    let j = a / 0.1_f64;
    // V max. is not reached: s = u/2 · (2 (u/a + a/j)).
    let u = (-(a / j) + ((a / j).powi(2) + 4.0 * 1e6 / a).sqrt()) * a / 2.0;
    assert!(u < v);
    let time = 2.0 * (u / a + a / j) * 1000.0;
    assert!((f64::from(took) - time).abs() <= 2.0, "{took} ms, {time} expected");
    assert_eq!(rig.output.status.nominal_position, 1_000_000);
}

/// Another target, another velocity and other limits while it moves; exact at the end.
#[test]
fn changes_while_moving() {
    let mut rig = rig(&[(690, 50)]);
    rig.go(20_000);
    rig.run(700);
    rig.order(Order::MoveAbsolute { position: -3_000, velocity: Some(2_000) });
    rig.run(300);
    rig.set(666, 2_000);
    rig.set(642, 5_000);
    rig.until("arrived", |rig| rig.last_end() == Some(Progress::Done));
    rig.run(300);
    assert_eq!((rig.output.status.position, rig.position.round()), (-3_000, -3_000.0));
}

/// `Stop` is held until it is let go; `Halt` is not.
#[test]
fn stop_is_held() {
    let mut rig = rig(&[]);
    rig.go(20_000);
    rig.run(500);
    rig.input.held = true;
    rig.order(Order::Stop);
    assert_eq!(rig.run(2_000).status.state, State::Stopping);
    rig.input.held = false;
    assert_eq!(rig.run(2).status.state, State::Standstill);
    rig.go(20_000);
    rig.run(100);
    rig.order(Order::Halt);
    assert_eq!(rig.run(2_000).status.state, State::Standstill);
}

/// Without power nothing moves, and what was moving is aborted.
#[test]
fn power_off_aborts() {
    let mut rig = rig(&[]);
    rig.go(20_000);
    rig.run(500);
    rig.input.power = false;
    let output = rig.cycle();
    assert_eq!((output.command.velocity, output.command.enable), (0.0, false));
    assert_eq!((output.status.state, rig.last_end()), (State::Disabled, Some(Progress::Aborted)));
    rig.go(100);
    assert_eq!(rig.last_end(), Some(Progress::Failed(MotionError::NOT_ENABLED)));
}

/// Calibration and SetPosition move the scale under a moving axis without a jerk.
#[test]
fn a_shift_of_the_scale_moves_the_set_values() {
    let mut rig = rig(&[]);
    rig.go(5_000);
    let before = rig.run(300).command.velocity;
    rig.position += 777.0;
    rig.input.actual.shift = 777;
    let after = rig.cycle().command.velocity;
    assert!((after - before).abs() < 50.0, "{before} {after}");
    rig.until("arrived", |rig| rig.last_end() == Some(Progress::Done));
    assert_eq!(rig.output.status.nominal_position, 5_777);
}
