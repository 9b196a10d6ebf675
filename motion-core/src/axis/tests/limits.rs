//! Software and hardware limit switches, both sides, while jogging and positioning.

use super::*;
use crate::failure::{HW_LIMIT_MINUS, HW_LIMIT_PLUS, SW_LIMIT_MINUS, SW_LIMIT_PLUS};

const JOGS: [(u16, i32); 4] = [(756, 2_000), (762, 5_000), (768, 2_000), (774, 5_000)];

fn with(changes: &[(u16, i32)]) -> Rig {
    rig(&[&JOGS[..], changes].concat())
}

/// Runs into a limit by jog and by position, and comes back off it.
fn runs_into(mut make: impl FnMut() -> Rig, forward: bool, failure: Failure, update: impl Fn(&mut Rig)) {
    let sign = if forward { 1 } else { -1 };
    let orders =
        [Order::Jog { forward, fast: true }, Order::MoveAbsolute { position: sign * 20_000, velocity: None }];
    for order in orders {
        let mut rig = make();
        rig.order(order);
        while rig.failures.is_empty() {
            update(&mut rig);
            rig.cycle();
            assert!(rig.ms < 20_000, "{order:?}: no limit");
        }
        let error = MotionError::from_failure(failure);
        assert_eq!((&rig.failures[..], rig.last_end()), (&[failure][..], Some(Progress::Failed(error))));
        assert_eq!((rig.output.status.state, rig.output.status.error), (State::ErrorStop, error));
        for _ in 0..1_000 {
            update(&mut rig);
            rig.cycle();
        }
        assert_eq!(rig.output.command.velocity, 0.0);
        // Only back.
        update(&mut rig);
        rig.order(Order::Jog { forward, fast: false });
        assert_eq!(rig.last_end(), Some(Progress::Failed(error)));
        let ends = rig.ended.len();
        update(&mut rig);
        rig.go(0);
        while rig.ended.len() == ends {
            update(&mut rig);
            rig.cycle();
        }
        assert_eq!(rig.last_end(), Some(Progress::Done), "{order:?}");
        assert_eq!((rig.output.status.error, rig.failures.len()), (MotionError::NONE, 1));
    }
}

#[test]
fn parameter_924_activates_the_upper_software_limit() {
    runs_into(|| with(&[(924, 1), (930, 3_000)]), true, SW_LIMIT_PLUS, |_| {});
    let mut rig = with(&[(924, 0), (930, 3_000)]);
    rig.arrive(5_000);
    assert!(rig.failures.is_empty());
}

#[test]
fn parameter_930_is_the_upper_software_limit() {
    for limit in [1_000, 2_500] {
        let mut rig = with(&[(924, 1), (930, limit)]);
        rig.order(Order::Jog { forward: true, fast: false });
        rig.until("limited", |rig| !rig.failures.is_empty());
        assert!((limit + 1..=limit + 3).contains(&rig.output.status.position));
    }
}

#[test]
fn parameter_936_activates_the_lower_software_limit() {
    runs_into(|| with(&[(936, 1), (942, -3_000)]), false, SW_LIMIT_MINUS, |_| {});
    let mut rig = with(&[(936, 0), (942, -3_000)]);
    rig.arrive(-5_000);
    assert!(rig.failures.is_empty());
}

#[test]
fn parameter_942_is_the_lower_software_limit() {
    for limit in [-1_000, -2_500] {
        let mut rig = with(&[(936, 1), (942, limit)]);
        rig.order(Order::Jog { forward: false, fast: false });
        rig.until("limited", |rig| !rig.failures.is_empty());
        assert!((limit - 3..=limit - 1).contains(&rig.output.status.position));
    }
}

/// A switch that is active from a position on.
fn switch(terminal: Terminal, active: bool, from: f64) -> impl Fn(&mut Rig) {
    move |rig: &mut Rig| {
        let there = if from > 0.0 { rig.position >= from } else { rig.position <= from };
        rig.input.digital.set(terminal, there == active);
    }
}

fn hardware(polarity: i32, active: bool, plus: bool) {
    let terminal = Terminal::new(2, 3).unwrap();
    let (kind, input) = if plus { (948, 954) } else { (960, 966) };
    let failure = if plus { HW_LIMIT_PLUS } else { HW_LIMIT_MINUS };
    let update = switch(terminal, active, if plus { 3_000.0 } else { -3_000.0 });
    let make = || {
        let mut rig = with(&[]);
        rig.input.digital.set(terminal, !active);
        rig.set(input, 9);
        rig.set(kind, polarity);
        rig
    };
    runs_into(make, plus, failure, update);
}

#[test]
fn parameter_948_is_the_upper_hardware_limit_and_its_level() {
    hardware(1, false, true);
    hardware(2, true, true);
    let mut rig = with(&[(948, 0), (954, 9)]);
    rig.input.digital.set(Terminal::new(2, 3).unwrap(), true);
    rig.arrive(5_000);
    assert!(rig.failures.is_empty());
}

#[test]
fn parameter_960_is_the_lower_hardware_limit_and_its_level() {
    hardware(1, false, false);
    hardware(2, true, false);
    let mut rig = with(&[(960, 0), (966, 9)]);
    rig.input.digital.set(Terminal::new(2, 3).unwrap(), true);
    rig.arrive(-5_000);
    assert!(rig.failures.is_empty());
}

/// Every terminal of the list stops the axis, and no other.
fn terminals(kind: u16, input: u16, forward: bool) {
    for choice in 0..30 {
        let mut rig = with(&[(kind, 2), (input, choice)]);
        rig.order(Order::Jog { forward, fast: false });
        for other in (0..30).filter(|other| *other != choice) {
            rig.input.digital.set(Terminal::from_choice(other).unwrap(), true);
        }
        rig.run(10);
        assert!(rig.failures.is_empty(), "{choice}");
        rig.input.digital.set(Terminal::from_choice(choice).unwrap(), true);
        rig.cycle();
        assert_eq!(rig.failures.len(), 1, "{choice}");
    }
}

#[test]
fn parameter_954_is_the_upper_limit_switchs_input() {
    terminals(948, 954, true);
}

#[test]
fn parameter_966_is_the_lower_limit_switchs_input() {
    terminals(960, 966, false);
}

/// A reset while still on the switch leaves the error; off it, it is gone.
#[test]
fn a_reset_does_not_hide_a_limit_switch() {
    let mut rig = with(&[(924, 1), (930, 1_000)]);
    rig.go(2_000);
    rig.until("limited", |rig| !rig.failures.is_empty());
    rig.run(1_000);
    rig.input.reset = true;
    assert_eq!(rig.cycle().status.error, MotionError::SW_LIMIT_PLUS);
    rig.position = 900.0;
    rig.input.reset = true;
    rig.cycle();
    assert_eq!(rig.cycle().status.error, MotionError::NONE);
}
