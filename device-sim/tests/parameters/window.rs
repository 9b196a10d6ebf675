//! The tolerance window of `actual = nominal`, 6.8.1.1, in every mode.

use super::bench::{Bench, CONTROL, Effect, Family, RAMPS, SIGNALS};

/// How far the axis may be pushed to one side before it is outside.
fn window(parameter: u16, sign: f64) {
    let effect = Effect {
        family: Family::Axes,
        modes: &[CONTROL, RAMPS, SIGNALS],
        parameter,
        base: &[(738, 0)],
        left: 20.0,
        cases: &[(40, 40.0), (70, 70.0)],
        tolerance: 0.0,
    };
    effect.shows(|bench: &mut Bench| {
        assert!(bench.go(1_000) > 0.0);
        bench.run(500);
        let within = |bench: &mut Bench, off: i32| {
            // The middle of an edge.
            bench.push(1_000.5 + sign * f64::from(off));
            bench.cycle();
            bench.status().at_target
        };
        let most = (0..100).take_while(|off| within(bench, *off)).last().unwrap();
        // Back inside, it is there again.
        assert!(!within(bench, most + 1) && within(bench, most));
        f64::from(most)
    });
}

#[test]
fn parameter_708_is_the_tolerance_below() {
    window(708, -1.0);
}

#[test]
fn parameter_714_is_the_tolerance_above() {
    window(714, 1.0);
}
