//! Following error, loss of drive and encoder, the application's stop.

use super::*;
use crate::control::PlcStop;
use crate::failure;

/// `[696]`: an axis that falls behind is stopped in the same cycle; it stays so until it is reset.
#[test]
fn parameter_696_is_the_greatest_deviation() {
    for most in [0, 200, 400] {
        let mut rig = rig(&[(696, most), (648, 10)]);
        rig.gain = 0.0;
        rig.go(20_000);
        let mut deviation = 0;
        for _ in 0..1_000 {
            deviation = rig.cycle().status.deviation;
            if !rig.failures.is_empty() {
                break;
            }
        }
        if most == 0 {
            assert!(rig.failures.is_empty() && deviation > 4_000);
            continue;
        }
        assert_eq!(rig.failures, [Failure::DELTA_S_MAX]);
        assert!((most..most + 30).contains(&deviation), "{deviation}");
        let error = MotionError::from_failure(Failure::DELTA_S_MAX);
        assert_eq!((rig.output.status.state, rig.output.status.error), (State::ErrorStop, error));
        assert_eq!(rig.last_end(), Some(Progress::Failed(error)));
        assert_eq!(rig.run(600).command.velocity, 0.0);
        rig.go(10);
        assert_eq!(rig.last_end(), Some(Progress::Failed(MotionError::IN_ERROR)));
        rig.input.reset = true;
        assert_eq!(rig.cycle().status.state, State::Standstill);
        rig.gain = 1.0;
        rig.arrive(10);
        assert_eq!(rig.last_end(), Some(Progress::Done));
    }
}

/// `[702]`: an axis that runs ahead.
#[test]
fn parameter_702_is_the_least_deviation() {
    for most in [0, 300] {
        let mut rig = rig(&[(702, most), (648, 10)]);
        rig.gain = 1.5;
        rig.go(20_000);
        rig.run(1_000);
        let expected = if most == 0 { std::vec![] } else { std::vec![Failure::DELTA_S_MIN] };
        assert_eq!(rig.failures, expected);
    }
}

/// A drive that is lost is disabled and its axis stops, in the same cycle.
#[test]
fn a_lost_drive_stops_its_axis() {
    let mut rig = rig(&[]);
    rig.go(20_000);
    rig.run(300);
    rig.input.failure = Some(failure::DRIVE_LOST);
    let output = rig.cycle();
    assert_eq!((output.command.enable, output.failure), (false, Some(failure::DRIVE_LOST)));
    assert_eq!(output.status.state, State::ErrorStop);
    rig.input.failure = Some(failure::DRIVE_LOST);
    assert_eq!(rig.cycle().failure, None, "told once");
}

/// Without readings there is no feedback: it brakes along the set values.
#[test]
fn a_lost_encoder_brakes_without_feedback() {
    let mut rig = rig(&[]);
    rig.go(20_000);
    rig.run(500);
    let before = rig.output.command.velocity;
    rig.input.actual.failure = Some(failure::READING_LOST);
    rig.input.actual.reading = Reading::Lost;
    let output = rig.cycle();
    // The input's failure is stored by whom the input belongs to.
    assert_eq!((output.failure, output.status.state), (None, State::ErrorStop));
    assert!((output.command.velocity - (before - 20.0)).abs() < 30.0);
    assert_eq!(rig.run(600).command.velocity, 0.0);
}

/// `[004]`: Control brakes hardest and without feedback, Regulate as the axis is set.
#[test]
fn the_application_stops() {
    for (stop, expected) in [(PlcStop::Control, 250), (PlcStop::Regulate, 1_000)] {
        let mut rig = rig(&[(678, 2_000)]);
        rig.gain = 0.9;
        rig.order(Order::MoveVelocity { velocity: 5_000 });
        rig.run(1_000);
        rig.input.stop = Some(stop);
        rig.cycle();
        assert_eq!(rig.last_end(), Some(Progress::Aborted));
        let feedback = rig.output.command.velocity - rig.output.status.nominal_velocity;
        assert_eq!(feedback > 300.0, stop == PlcStop::Regulate, "{feedback}");
        let took = 1 + rig.until("stopped", |rig| rig.output.status.state == State::Standstill);
        assert!(took.abs_diff(expected) <= 2, "{stop:?}: {took} ms");
    }
}
