//! One test a parameter, `[020]` (display only) apart.

use super::*;
use crate::parameters::Values;

fn output(at: usize, changes: &[(u16, i32)]) -> NominalValueOutput {
    let mut values = Values::factory();
    for &(index, value) in changes {
        values.set(index, value).unwrap();
    }
    NominalValueOutput::new(at, Settings::read(&values, at))
}

/// V max. is 1000 units a second.
fn at(velocity: f64) -> Command {
    Command { velocity, maximum: 1000.0, enable: true, ..Command::default() }
}

fn volts(changes: &[(u16, i32)], command: Command) -> i16 {
    output(0, changes).cycle(&command, 2).voltage.unwrap()
}

const JOG: Signals = Signals { forward: true, backward: false, slow: true, fast: true };

/// `[450]`: each type has its own way out.
#[test]
fn parameter_450_selects_what_is_put_out() {
    let given = |kind| {
        let command = Command { signals: JOG, ..at(1000.0) };
        output(0, &[(450, kind), (528, 2), (540, 1000)]).cycle(&command, 2)
    };
    assert_eq!(given(0), Nominal::default());
    assert_eq!(given(1), Nominal { voltage: Some(10_000), ..Nominal::default() });
    let drive = Some(DriveSetpoint { object: 2, speed: 128, enable: true, reset: false });
    assert_eq!(given(2), Nominal { drive, ..Nominal::default() });
    assert_eq!(given(3), Nominal { bits: 0b11000, ..Nominal::default() });
    assert_eq!(given(4), Nominal { clock: Some(Pwm::clock(0, 1_000_000)), ..Nominal::default() });
}

/// `[468]`: the sign of forward, of voltages and of drives.
#[test]
fn parameter_468_is_the_direction() {
    assert_eq!(volts(&[(468, 0)], at(500.0)), 5_000);
    assert_eq!(volts(&[(468, 1)], at(500.0)), -5_000);
    let speed = |choice| output(0, &[(450, 2), (468, choice)]).cycle(&at(7812.5), 2).drive.unwrap().speed;
    assert_eq!((speed(0), speed(1)), (1000, -1000));
}

/// `[474]`: one polarity only, whatever the direction.
#[test]
fn parameter_474_is_the_voltage_range() {
    for velocity in [500.0, -500.0] {
        assert_eq!(volts(&[(474, 1)], at(velocity)), 5_000);
        assert_eq!(volts(&[(474, 1), (468, 1)], at(velocity)), 5_000);
    }
    assert_eq!(volts(&[(474, 0)], at(-500.0)), -5_000);
}

/// `[480]`: reached at V max., never passed.
#[test]
fn parameter_480_is_the_voltage_at_v_max() {
    for (velocity, expected) in [(1000.0, 8_000), (250.0, 2_000), (1500.0, 8_000), (-1500.0, -8_000)] {
        assert_eq!(volts(&[(480, 8_000)], at(velocity)), expected);
    }
    // 7.2: resolution 2 mV.
    assert_eq!(volts(&[(480, 8_000)], at(0.2)), 2);
    assert_eq!(volts(&[(480, 8_000)], at(0.1)), 0);
}

/// `[486]`: the object that the set value goes to; outputs 4…6 too.
#[test]
fn parameter_486_is_the_object_of_the_drive() {
    for place in [0u16, 3] {
        for choice in 0..=6 {
            let mut output = output(usize::from(place), &[(450 + place, 2), (486 + place, choice)]);
            let object = output.cycle(&at(1.0), 2).drive.map(|drive| drive.object as i32 + 1);
            assert_eq!(object.unwrap_or(0), choice);
        }
    }
}

/// `[492]`: LD 2000 is the only choice: 1875/262144 rpm an increment, 3000 rpm are 419430 (decision 14).
#[test]
fn parameter_492_is_the_ld_2000() {
    let speed = |velocity| output(0, &[(450, 2), (492, 0)]).cycle(&at(velocity), 2).drive.unwrap().speed;
    assert_eq!(speed(3_276_800.0), 419_430);
    assert_eq!(speed(-3_276_800.0), -419_430);
    // Half an increment is rounded away from zero.
    assert_eq!((speed(3.906_25), speed(-3.906_25), speed(3.9)), (1, -1, 0));
}

/// `[498]`: increments a motor revolution of a separate encoder; with 0 nothing can be put out.
#[test]
fn parameter_498_is_the_increments_of_a_revolution() {
    let speed =
        |increments| output(3, &[(453, 2), (501, increments)]).cycle(&at(50_000.0), 2).drive.unwrap().speed;
    assert_eq!((speed(1000), speed(4096), speed(0)), (419_430, 102_400, 0));
    assert_eq!(speed(1), 419_430_400);
}

/// `[504]`: where forward begins.
#[test]
fn parameter_504_is_the_least_positive_voltage() {
    let changes = &[(504, 1_000)];
    assert_eq!([0.0, 0.001, 500.0, 1000.0].map(|v| volts(changes, at(v))), [0, 1_000, 5_500, 10_000]);
    assert_eq!(volts(changes, at(-500.0)), -5_000);
}

/// `[510]`: where backward begins.
#[test]
fn parameter_510_is_the_least_negative_voltage() {
    let changes = &[(510, 1_000)];
    assert_eq!([-0.001, -500.0, -1000.0].map(|v| volts(changes, at(v))), [-1_000, -5_500, -10_000]);
    assert_eq!(volts(changes, at(500.0)), 5_000);
}

fn resting(changes: &[(u16, i32)], deviation: i32) -> i16 {
    volts(changes, Command { deviation, at_rest: true, ..at(100.0) })
}

/// `[516]`: below the nominal position (the deviation is positive), after it has been reached.
#[test]
fn parameter_516_is_the_dead_range_below() {
    let changes = &[(516, 10)];
    assert_eq!([0, 10, 11, -1].map(|deviation| resting(changes, deviation)), [0, 0, 1_000, 1_000]);
    assert_eq!(volts(changes, Command { deviation: 5, ..at(100.0) }), 1_000);
}

/// `[522]`: above the nominal position.
#[test]
fn parameter_522_is_the_dead_range_above() {
    let changes = &[(522, 10)];
    assert_eq!([0, -10, -11, 1].map(|deviation| resting(changes, deviation)), [0, 0, 1_000, 1_000]);
}

/// `[528]`: None leaves the terminals to the application.
#[test]
fn parameter_528_is_the_jog_signals() {
    let bits = |choice| {
        output(1, &[(451, 3), (529, choice)]).cycle(&Command { signals: JOG, ..Command::default() }, 2).bits
    };
    assert_eq!([0, 1, 2].map(bits), [0, 0b01000, 0b11000]);
}

/// Direction bits for forward and backward.
fn directions(changes: &[(u16, i32)]) -> [u8; 3] {
    [1.0, -1.0, 0.0].map(|v| {
        let signals = Signals { forward: v > 0.0, backward: v < 0.0, ..Signals::default() };
        output(0, changes).cycle(&Command { signals, ..at(v) }, 2).bits
    })
}

/// `[534]`: swapped, of signals and stepper motors; an analog output has no such setting (6.7.1.1).
#[test]
fn parameter_534_reverses_the_direction_signals() {
    for kind in [3, 4] {
        assert_eq!(directions(&[(450, kind), (546, 3), (534, 1)]), [0b010, 0b100, 0]);
        assert_eq!(directions(&[(450, kind), (546, 1), (534, 1)]), [0, 0b100, 0]);
    }
    assert_eq!(directions(&[(450, 1), (546, 3), (534, 1)]), [0b100, 0b010, 0]);
}

/// `[540]`: pulses a second at V max.; each one is counted, backward ones down.
#[test]
fn parameter_540_is_the_stepping_frequency() {
    let mut output = output(0, &[(450, 4), (540, 1_234)]);
    let clock = output.cycle(&at(500.0), 2).clock.unwrap();
    assert_eq!(clock.frequency(), 617_000);
    for _ in 1..500 * 3 {
        output.cycle(&at(500.0), 2);
    }
    assert_eq!(output.steps(), 617 * 3);
    for _ in 0..500 {
        output.cycle(&at(-500.0), 2);
    }
    assert_eq!(output.steps(), 617 * 2);
    assert_eq!(output.cycle(&at(0.1), 2).clock.unwrap(), Pwm::default());
}

/// `[546]`: the direction as signals, of every type that has them.
#[test]
fn parameter_546_is_the_direction_signals() {
    for kind in [1, 3, 4] {
        let bits = |choice| directions(&[(450, kind), (546, choice)]);
        assert_eq!(bits(0), [0, 0, 0]);
        assert_eq!(bits(1), [0b100, 0, 0]);
        assert_eq!(bits(2), [0, 0b100, 0]);
        assert_eq!(bits(3), [0b100, 0b010, 0]);
    }
    assert_eq!(directions(&[(450, 2), (546, 3)]), [0; 3]);
}

/// Without a V max. nothing moves.
#[test]
fn nothing_without_v_max() {
    let command = Command { velocity: 5.0, ..Command::default() };
    assert_eq!(volts(&[], command), 0);
    assert_eq!(output(0, &[(450, 4), (540, 100)]).cycle(&command, 2).clock, Some(Pwm::default()));
}
