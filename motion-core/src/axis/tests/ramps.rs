//! Mode Ramps: 6.8.1.3.

use super::*;

const RAMPS: [(u16, i32); 7] =
    [(600, 3), (894, 4_000), (906, 1_000), (918, 2_000), (900, 200), (912, 300), (684, 0)];

fn with(changes: &[(u16, i32)]) -> Rig {
    rig(&[&RAMPS[..], changes].concat())
}

/// Highest velocity put out at each distance from the target, while it brakes.
fn braking(rig: &mut Rig, target: i32, distances: &[i32]) -> Vec<f64> {
    let mut found = std::vec![f64::NAN; distances.len()];
    rig.go(target);
    while rig.ended.is_empty() {
        rig.cycle();
        let rest = target - rig.output.status.position;
        for (slot, distance) in found.iter_mut().zip(distances) {
            if rest <= *distance && slot.is_nan() {
                *slot = rig.output.command.velocity;
            }
        }
    }
    found
}

/// The point moves the velocity at its distance.
fn point(changes: &[(u16, i32)], distance: i32, expected: f64) {
    let found = braking(&mut with(changes), 20_000, &[distance])[0];
    assert!(near(found, expected, 0.02), "{changes:?}: {found} at {distance}, {expected} expected");
}

#[test]
fn parameter_894_is_the_distance_of_the_first_point() {
    point(&[], 4_000, 10_000.0);
    point(&[(894, 8_000)], 4_500, 2_000.0 + 8_000.0 * 3_500.0 / 7_000.0);
}

#[test]
fn parameter_906_is_the_distance_of_the_second_point() {
    point(&[], 1_000, 2_000.0);
    point(&[(906, 2_000)], 2_000, 2_000.0);
}

#[test]
fn parameter_918_is_the_velocity_of_the_second_point() {
    point(&[(918, 4_000)], 1_000, 4_000.0);
}

#[test]
fn parameter_900_is_the_distance_of_the_last_point() {
    point(&[], 200, 300.0);
    point(&[(900, 500)], 500, 300.0);
}

#[test]
fn parameter_912_is_the_velocity_of_the_last_point() {
    point(&[(912, 600)], 200, 600.0);
}

/// "If you operate at a smaller speed the ramp entry point is reached later."
#[test]
fn a_lower_working_velocity_enters_the_ramp_later() {
    point(&[(684, 5_000)], 3_000, 5_000.0);
    point(&[(684, 5_000)], 1_000, 2_000.0);
}

/// Accelerates by time, stops in the window from both sides, without a following error.
#[test]
fn positions_in_both_directions() {
    let mut rig = with(&[(690, 100), (696, 10), (702, 10)]);
    for target in [15_000, -2_000, -1_900] {
        rig.arrive(target);
        assert_eq!(rig.last_end(), Some(Progress::Done));
        assert!((rig.output.status.position - target).abs() <= 5);
        assert!(rig.output.status.at_target && rig.failures.is_empty());
        assert_eq!(rig.cycle().command.velocity, 0.0);
    }
}

/// `[738]` in this mode: pushed away, it comes back.
#[test]
fn held_at_the_target() {
    for (choice, expected) in [(0, true), (1, false)] {
        let mut rig = with(&[(738, choice)]);
        rig.arrive(3_000);
        rig.position += 100.0;
        rig.run(2_000);
        assert_eq!((rig.output.status.position - 3_000).abs() > 5, expected);
    }
}
