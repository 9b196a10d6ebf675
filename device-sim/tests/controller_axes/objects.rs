//! What the parameters of inputs and outputs on the CAN buses do with the drives behind their objects.

use core::time::Duration;

use canopen_master::ds402;
use device_sim::can::Faults;
use lb2::device::Device;
use motion_core::Reset;
use motion_core::application::{Order, State};
use motion_core::failure::DRIVE_LOST;

use super::rig::{AXES, Rig, V_MAX};

/// Choice of `[254]` and `[486]` for the drive of an axis.
const OBJECT: [i32; AXES] = [3, 4, 5, 6, 1, 2];

/// Increments a second of a drive while its axis jogs.
fn velocity(rig: &mut Rig, axis: usize) -> f64 {
    rig.order(axis, Order::Jog { forward: true, fast: false });
    rig.run(Duration::from_millis(600));
    let before = rig.real(axis);
    // Whole cycles of 6 ms.
    rig.run(Duration::from_millis(600));
    (rig.real(axis) - before) / 0.6
}

/// An axis and the one after it.
fn pairs() -> impl Iterator<Item = (usize, usize)> {
    (0..AXES).map(|axis| (axis, (axis + 1) % AXES))
}

/// `[254]`: an axis that looks at another one's drive sees it move; left alone it sees its own, at rest.
#[test]
fn parameter_254_is_the_object_of_the_drive() {
    for (axis, other) in pairs() {
        let seen = |changes: &[(u16, i32)]| {
            let mut rig = Rig::new(changes, Faults::NONE);
            rig.until("booted", Rig::is_booted);
            rig.set_power(true);
            // The drive that nobody looks at is not enabled: its status is not taken into consideration.
            rig.until("enabled", |rig| rig.state(other) == ds402::State::OperationEnabled);
            rig.arrive(other, 50_000, V_MAX as u32);
            rig.until("at rest", |rig| rig.status(other).position == 50_000);
            assert_eq!(rig.real(axis), 0.0);
            rig.status(axis).position
        };
        assert_eq!(seen(&[]), 0);
        assert_eq!(seen(&[(254 + axis as u16, OBJECT[other])]), 50_000);
    }
}

/// `[486]`: two axes with exchanged objects move each other's drives; left alone their own.
#[test]
fn parameter_486_is_the_object_of_the_drive() {
    for (axis, other) in pairs() {
        let moved = |changes: &[(u16, i32)]| {
            let mut rig = Rig::enabled(changes);
            rig.arrive(axis, 50_000, V_MAX as u32);
            rig.until("at rest", |rig| rig.status(axis).position == 50_000);
            rig.run(Duration::from_millis(100));
            [axis, other].map(|at| rig.real(at).floor())
        };
        assert_eq!(moved(&[]), [50_000.0, 0.0]);
        let exchanged =
            |first: u16| [(first + axis as u16, OBJECT[other]), (first + other as u16, OBJECT[axis])];
        assert_eq!(moved(&[exchanged(254), exchanged(486)].concat()), [0.0, 50_000.0]);
    }
}

/// `[450]`: without CAN-Bus nothing is put out, and the drive stands.
#[test]
fn parameter_450_selects_what_is_put_out_on_the_buses() {
    for axis in 0..AXES {
        let seen = |changes: &[(u16, i32)]| {
            let mut rig = Rig::new(changes, Faults::NONE);
            rig.until("booted", Rig::is_booted);
            rig.set_power(true);
            rig.run(Duration::from_millis(500));
            velocity(&mut rig, axis)
        };
        assert!((seen(&[]) - 65_536.0).abs() < 20.0);
        assert_eq!(seen(&[(450 + axis as u16, 0)]), 0.0);
    }
}

/// `[498]`: a drive whose turn counts twice as many increments is told half the speed.
#[test]
fn parameter_498_is_the_increments_of_a_revolution() {
    for axis in 0..AXES {
        for (changes, expected) in [
            (vec![], 65_536.0),
            (vec![(498 + axis as u16, 131_072)], 32_768.0),
            (vec![(498 + axis as u16, 32_768)], 131_072.0),
            (vec![(498 + ((axis + 1) % AXES) as u16, 32_768)], 65_536.0),
        ] {
            let mut rig = Rig::enabled(&changes);
            let velocity = velocity(&mut rig, axis);
            assert!((velocity - expected).abs() < 20.0, "{changes:?}: {velocity}");
        }
    }
}

/// `[261]`, `[492]`: LD 2000 is the only choice; with it a drive arrives at the increment.
#[test]
fn parameters_261_and_492_are_the_ld_2000() {
    let mut rig = Rig::enabled(&[]);
    for axis in 0..AXES {
        for index in [261, 492].map(|first| first + axis as u16) {
            assert!(rig.controller.write_parameter(index, 1).code.is_error(), "[{index}]");
            assert!(!rig.controller.write_parameter(index, 0).code.is_error(), "[{index}]");
        }
        rig.arrive(axis, 1 << 16, V_MAX as u32);
        rig.until("at rest", |rig| rig.status(axis).position == 1 << 16);
        assert_eq!(rig.real(axis).floor(), 65_536.0, "one turn");
        assert_eq!(rig.status(axis).state, State::Standstill);
    }
}

/// Parameters change in mid-move so that an output loses its drive; what the drive then is.
fn loses_its_drive(axis: usize, change: impl Fn(&mut Rig)) -> Rig {
    let mut rig = Rig::enabled(&[]);
    rig.order(axis, Order::MoveVelocity { velocity: 327_680 });
    rig.run(Duration::from_secs(1));
    assert!(rig.drive(axis, |drive| drive.motion().1) > 0.0);
    change(&mut rig);
    rig.cycle();
    rig.run(Duration::from_millis(500));
    assert_eq!(rig.state(axis), ds402::State::SwitchOnDisabled, "axis {axis}");
    assert_eq!(rig.drive(axis, |drive| drive.motion().1), 0.0, "axis {axis}");
    rig
}

fn set(rig: &mut Rig, index: u16, value: i32) {
    assert!(!rig.controller.write_parameter(index, value).code.is_error());
    assert_eq!(rig.controller.call_loader(), -1);
}

#[test]
fn a_drive_whose_output_is_taken_away_in_mid_move_stops_and_the_axis_fails() {
    for (axis, choice) in OBJECT.into_iter().enumerate() {
        let (at, object) = (axis as u16, choice as u16 - 1);
        // Address and type of the object OUT.
        let (address, kind) =
            if object < 2 { (314 + object, 330 + object) } else { (344 + object, 360 + object) };
        let changes = [(450 + at, 0), (486 + at, 0), (address, 12), (kind, 0)];
        for (index, value) in changes {
            let mut rig = loses_its_drive(axis, |rig| {
                set(rig, index, value);
                rig.cycle();
                rig.assert_failed(axis, DRIVE_LOST);
            });
            for other in (0..AXES).filter(|other| *other != axis) {
                assert_eq!(rig.state(other), ds402::State::OperationEnabled, "[{index}]: axis {other}");
            }
        }
    }
}

#[test]
fn a_reset_to_factory_defaults_in_mid_move_stops_the_drives() {
    for axis in 0..AXES {
        loses_its_drive(axis, |rig| rig.controller.reset(Reset::Factory).unwrap());
    }
}

/// A drive that keeps its object takes no notice of what becomes of others.
#[test]
fn other_drives_move_on_when_an_output_is_taken_away() {
    let mut rig = Rig::enabled(&[]);
    rig.order(1, Order::MoveVelocity { velocity: 327_680 });
    rig.run(Duration::from_secs(1));
    set(&mut rig, 450, 0);
    for _ in 0..50 {
        rig.cycle();
        assert_eq!(rig.state(1), ds402::State::OperationEnabled);
    }
}
