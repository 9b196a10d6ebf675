//! Mode Signals: 6.8.1.2.

use super::*;

const SIGNALS: [(u16, i32); 8] =
    [(600, 2), (822, 400), (828, 50), (834, 400), (840, 50), (864, 1), (870, 30), (858, 1)];

fn with(changes: &[(u16, i32)]) -> Rig {
    rig(&[&SIGNALS[..], changes].concat())
}

/// What changed in the signals on the way to a target: (ms, rest, direction, slow, fast).
fn course(rig: &mut Rig, target: i32) -> Vec<(u32, i32, i8, bool, bool)> {
    let mut course = Vec::new();
    let ends = rig.ended.len();
    let start = rig.ms;
    let mut last = (0, false, false);
    rig.go(target);
    loop {
        let signals = rig.output.command.signals;
        let now = (i8::from(signals.forward) - i8::from(signals.backward), signals.slow, signals.fast);
        if now != last {
            let rest = target - rig.output.status.position;
            course.push((rig.ms - start, rest, now.0, now.1, now.2));
            last = now;
        }
        if rig.ended.len() > ends || rig.ms - start > 20_000 {
            return course;
        }
        rig.cycle();
    }
}

/// The rests at which fast and slow go off.
fn offs(changes: &[(u16, i32)], target: i32) -> (i32, i32) {
    let course = course(&mut with(changes), target);
    let fast = course.iter().skip_while(|step| !step.4).find(|step| !step.4).map_or(0, |step| step.1);
    let slow = course.iter().skip_while(|step| !step.3).find(|step| !step.3).map_or(0, |step| step.1);
    (fast.abs(), slow.abs())
}

fn around(found: i32, expected: i32) {
    assert!((expected - 3..=expected).contains(&found), "{found}, {expected} expected");
}

#[test]
fn parameter_822_is_the_way_from_fast_to_slow_forward() {
    around(offs(&[], 5_000).0, 450);
    around(offs(&[(822, 700)], 5_000).0, 750);
    around(offs(&[(822, 700)], -5_000).0, 450);
}

#[test]
fn parameter_828_is_the_way_from_slow_to_standstill_forward() {
    around(offs(&[], 5_000).1, 50);
    around(offs(&[(828, 80)], 5_000).1, 80);
    around(offs(&[(828, 80)], -5_000).1, 50);
}

#[test]
fn parameter_834_is_the_way_from_fast_to_slow_backward() {
    around(offs(&[(834, 700)], -5_000).0, 750);
    around(offs(&[(834, 700)], 5_000).0, 450);
}

#[test]
fn parameter_840_is_the_way_from_slow_to_standstill_backward() {
    around(offs(&[(840, 80)], -5_000).1, 80);
    around(offs(&[(840, 80)], 5_000).1, 50);
}

/// Fast only where there is way enough to accelerate.
#[test]
fn parameter_816_is_the_way_from_slow_to_fast() {
    let fast = |way, target| course(&mut with(&[(816, way)]), target).iter().any(|step| step.4);
    assert_eq!(
        [fast(0, 500), fast(600, 500), fast(600, 1_040), fast(600, 1_100)],
        [true, false, false, true]
    );
}

/// Slow goes before fast by this time.
#[test]
fn parameter_852_is_the_time_from_slow_to_fast() {
    for time in [0, 40, 250] {
        let course = course(&mut with(&[(852, time)]), 5_000);
        let slow = course.iter().find(|step| step.3).unwrap().0;
        let fast = course.iter().find(|step| step.4).unwrap().0;
        assert_eq!(fast - slow, (time as u32).max(1), "{time}");
    }
}

/// A reversal: fast off, dt shut down, slow off, dt run out, the other direction.
fn reversal(changes: &[(u16, i32)]) -> (u32, u32) {
    let mut rig = with(changes);
    rig.order(Order::Jog { forward: true, fast: true });
    rig.run(500);
    rig.order(Order::Jog { forward: false, fast: false });
    assert!(!rig.output.command.signals.fast && rig.output.command.signals.slow);
    let slow = rig.until("slow off", |rig| !rig.output.command.signals.slow);
    let turn = rig.until("turned", |rig| rig.output.command.signals.backward);
    (slow, turn)
}

#[test]
fn parameter_846_is_the_time_from_fast_to_slow() {
    assert_eq!(reversal(&[(846, 20)]).0, 20);
    assert_eq!(reversal(&[(846, 300)]).0, 300);
}

#[test]
fn parameter_870_is_the_time_from_slow_to_the_other_direction() {
    // A cycle between the end of the run-out and the new direction.
    assert_eq!(reversal(&[(870, 20)]).1, 20 + 1);
    assert_eq!(reversal(&[(870, 300)]).1, 300 + 1);
}

#[test]
fn parameter_858_allows_fast_by_hand() {
    let fast = |choice| {
        let mut rig = with(&[(858, choice)]);
        rig.order(Order::Jog { forward: true, fast: true });
        rig.run(10).command.signals.fast
    };
    assert_eq!([0, 1].map(fast), [false, true]);
}

#[test]
fn parameter_864_allows_fast_while_positioning() {
    let fast = |choice| course(&mut with(&[(864, choice)]), 5_000).iter().any(|step| step.4);
    assert_eq!([0, 1].map(fast), [false, true]);
}

/// Arrives in the window from both sides, when what it needs to run out is set right.
#[test]
fn positions_in_both_directions() {
    let mut rig = with(&[(708, 20), (714, 20)]);
    rig.lag = 0.05;
    for target in [5_000, -1_000, 0] {
        // 500 units/s and 50 ms: 25 units to run out.
        rig.set(828, 25);
        rig.set(840, 25);
        course(&mut rig, target);
        assert_eq!(rig.last_end(), Some(Progress::Done), "{target}");
        assert!((rig.output.status.position - target).abs() <= 20);
    }
}

/// `[744]` delays slow, `[780]` swaps the keys, as in the other modes.
#[test]
fn brake_and_keys_as_in_the_other_modes() {
    let mut rig = with(&[(744, 5), (780, 1)]);
    rig.order(Order::Jog { forward: true, fast: false });
    assert_eq!(rig.until("slow", |rig| rig.output.command.signals.slow), 50);
    assert!(rig.output.command.signals.backward);
    rig.order(Order::Halt);
    assert_eq!(rig.output.command.signals, Signals::default());
}
