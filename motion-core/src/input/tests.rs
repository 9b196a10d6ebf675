//! One test a parameter, `[013]` (display only) apart.

use super::*;
use crate::Model;
use crate::io::{CHANNELS, Terminal};
use crate::parameters::Values;

/// An input with its surroundings. Cycles are 2 ms long.
struct Rig {
    at: usize,
    values: Values,
    input: ActualValueInput,
    encoders: [Encoder; 3],
    digital: DigitalInputs,
    analog: AnalogInputs,
    can: [Option<u32>; 6],
    inputs: [ActualValue; 6],
    axes: [AxisQuantities; 6],
    armed: bool,
}

fn rig(at: usize, changes: &[(u16, i32)]) -> Rig {
    let mut values = Values::factory();
    for &(index, value) in changes {
        values.set(index, value).unwrap();
    }
    let mut analog = AnalogInputs::default();
    analog.configure(Model::Gel8236, &values);
    Rig {
        at,
        input: ActualValueInput::new(Settings::read(&values, at), 0),
        values,
        encoders: [Encoder::default(); 3],
        digital: DigitalInputs::default(),
        analog,
        can: [None; 6],
        inputs: [ActualValue::default(); 6],
        axes: [AxisQuantities::default(); 6],
        armed: false,
    }
}

impl Rig {
    fn cycle(&mut self) -> ActualValue {
        let sources = Sources {
            cycle: 2,
            encoders: &self.encoders,
            digital: self.digital,
            analog: &self.analog,
            can: self.can,
            inputs: &self.inputs,
            axes: &self.axes,
        };
        self.input.cycle(&sources, self.armed)
    }

    fn set(&mut self, index: u16, value: i32) {
        self.values.set(index, value).unwrap();
        self.input.configure(Settings::read(&self.values, self.at));
    }

    /// A cycle with encoder E1 at this count.
    fn at(&mut self, count: i32) -> ActualValue {
        self.encoders[0] = Encoder { count, ..Encoder::default() };
        self.cycle()
    }
}

/// `[100]`: each type reads its own source.
#[test]
fn parameter_100_selects_the_source() {
    let position = |kind, more: &[(u16, i32)]| {
        let mut changes = std::vec![(100, kind), (35, 1), (163, 2)];
        changes.extend(more);
        let mut rig = rig(0, &changes);
        rig.encoders[0].count = 11;
        rig.can[2] = Some(22 << 4);
        rig.inputs[1] = ActualValue { position: 44, reading: Reading::Real, ..ActualValue::default() };
        rig.analog.cycle(10, &[55; CHANNELS]);
        rig.cycle().position
    };
    assert_eq!(position(0, &[]), 11);
    assert_eq!(position(1, &[(135, 1)]), 11);
    assert_eq!(position(2, &[]), 22);
    assert_eq!(position(3, &[(170, 16_500)]), 33);
    assert_eq!(position(4, &[]), 44);
    assert_eq!(position(5, &[]), 55);
}

/// `[100]`: another type sets X back to 0, a virtual one does not (6.6.1.1).
#[test]
fn parameter_100_reselected_resets_the_internal_offset() {
    let mut rig = rig(0, &[]);
    rig.at(100);
    rig.input.set_position(30);
    assert_eq!((rig.input.offset(), rig.at(100).position), (70, 30));
    rig.set(100, 3);
    assert_eq!(rig.input.offset(), 70);
    rig.set(100, 0);
    assert_eq!((rig.input.offset(), rig.at(100).position), (0, 100));
}

/// `[107]`: an inactive input reads nothing.
#[test]
fn parameter_107_activates_the_input() {
    let mut rig = rig(0, &[(107, 0)]);
    assert_eq!(rig.at(5), ActualValue::default());
    rig.set(107, 1);
    assert_eq!(rig.at(5).position, 5);
}

/// `[128]`: the decoder's evaluation; the same ten periods are 40 counts with Ink_V. Ink_S reads
/// pulses and a direction: ten pulses are 20 counts.
#[test]
fn parameter_128_is_the_edge_evaluation() {
    let counted = |choice, signals: &[(bool, bool)]| {
        let mut rig = rig(0, &[(128, choice)]);
        let Kind::Incremental { evaluation, .. } = rig.input.settings().kind else { panic!() };
        let mut decoder = QuadratureDecoder::new(evaluation);
        decoder.sample(false, false, false);
        (0..10).flat_map(|_| signals).for_each(|&(a, b)| decoder.sample(a, b, false));
        rig.encoders[0] = decoder.take();
        rig.cycle().position
    };
    assert_eq!(counted(0, &[(true, false), (true, true), (false, true), (false, false)]), 40);
    assert_eq!(counted(1, &[(true, false), (false, false)]), 20);
}

/// `[135]`: Gray 1011 is 13.
#[test]
fn parameter_135_is_the_ssi_code() {
    assert_eq!(rig(0, &[(100, 1), (135, 0)]).at(0b1011).position, 13);
    assert_eq!(rig(0, &[(100, 1), (135, 1)]).at(0b1011).position, 11);
}

/// `[142]`: a multi-turn word goes on above the single-turn bits; a single-turn one wraps, and is followed.
#[test]
fn parameter_142_is_the_number_of_turns_an_ssi_encoder_knows() {
    let mut multi = rig(0, &[(100, 1), (135, 1), (142, 1)]);
    assert_eq!(multi.at(5 << 12 | 7).position, 5 * 4096 + 7);
    let mut single = rig(0, &[(100, 1), (135, 1), (142, 0)]);
    assert_eq!(single.at(5 << 12 | 7).position, 7);
    assert_eq!(single.at(4000).position, 4000 - 4096);
    assert_eq!(single.at(7).position, 7);
}

/// `[149]`: where a turn ends.
#[test]
fn parameter_149_is_the_bits_of_a_turn() {
    for (bits, end) in [(12, 4096), (13, 8192), (4, 16)] {
        let mut rig = rig(0, &[(100, 1), (135, 1), (149, bits)]);
        assert_eq!(rig.at(end - 1).position, end - 1);
        assert_eq!(rig.at(0).position, end, "{bits} bits");
    }
}

/// `[156]`: five quantities.
#[test]
fn parameter_156_is_the_quantity_taken_over() {
    let position = |choice| {
        let mut rig = rig(0, &[(100, 4), (156, choice), (163, 3)]);
        rig.inputs[2] =
            ActualValue { position: 1, frequency: 2, reading: Reading::Real, ..ActualValue::default() };
        rig.axes[2] = AxisQuantities { position: 3, velocity: 4, steps: 5, ..AxisQuantities::default() };
        rig.cycle().position
    };
    assert_eq!([0, 1, 2, 3, 4].map(position), [1, 2, 3, 4, 5]);
}

/// `[163]`: the number of the input or axis.
#[test]
fn parameter_163_is_the_number_of_the_source() {
    for number in 1..=6 {
        let mut rig = rig(0, &[(100, 4), (156, 2), (163, number)]);
        for (at, axis) in rig.axes.iter_mut().enumerate() {
            axis.position = 100 * (at as i32 + 1);
        }
        assert_eq!(rig.cycle().position, 100 * number);
    }
}

/// 6.6.1.5: what fails at the source fails here in the same cycle, unless `[191]` compensates it here; what is
/// extrapolated there is no more here.
#[test]
fn virtual2_passes_on_what_its_source_stands_for() {
    for choice in [0, 1] {
        let mut rig = rig(0, &[(100, 4), (156, choice), (163, 3)]);
        let mut seen = |position, reading, failure| {
            rig.inputs[2] =
                ActualValue { position, frequency: position, reading, failure, ..ActualValue::default() };
            let value = rig.cycle();
            (value.position, value.reading, value.failure)
        };
        assert_eq!(seen(0, Reading::None, None), (0, Reading::None, None));
        assert_eq!(seen(5, Reading::Real, None), (5, Reading::Real, None));
        assert_eq!(seen(6, Reading::Extrapolated, None), (6, Reading::Extrapolated, None));
        let jump = Some(failure::ACTUAL_VALUE_JUMP);
        assert_eq!(seen(900, Reading::Real, jump), (900, Reading::Real, jump));
        let lost = Some(failure::READING_LOST);
        assert_eq!(seen(900, Reading::Lost, lost), (900, Reading::Lost, lost));
        assert_eq!(seen(900, Reading::Lost, None), (900, Reading::Lost, None));
        assert_eq!(seen(901, Reading::Real, None), (901, Reading::Real, None));
        // An input that was switched off.
        assert_eq!(seen(901, Reading::None, None), (901, Reading::Lost, lost));
    }
    let mut rig = rig(0, &[(100, 4), (163, 3), (191, 1)]);
    rig.inputs[2].reading = Reading::Real;
    rig.cycle();
    rig.inputs[2].reading = Reading::Lost;
    assert_eq!((rig.cycle().reading, rig.cycle().reading), (Reading::Extrapolated, Reading::Lost));
}

/// A source that is calibrated moves its scale: here too it is no movement, and no jump.
#[test]
fn virtual2_moves_its_scale_with_the_source() {
    for (choice, moves) in [(0, true), (2, true), (1, false), (3, false), (4, false)] {
        let mut rig = rig(0, &[(100, 4), (156, choice), (163, 3), (205, 2), (212, 1), (184, 100)]);
        let mut seen = |position, shift| {
            rig.inputs[2] = ActualValue {
                position,
                shift,
                frequency: 7,
                reading: Reading::Real,
                ..ActualValue::default()
            };
            rig.axes[2] = AxisQuantities { position, shift, velocity: 7, steps: 7 };
            let value = rig.cycle();
            (value.position, value.shift, value.velocity, value.failure)
        };
        let first = seen(0, 0);
        if moves {
            assert_eq!(first, (0, 0, 0, None));
            assert_eq!(seen(10, 0), (20, 0, 10_000, None));
            assert_eq!(seen(5_012, 5_000), (10_024, 10_000, 2_000, None));
            assert_eq!(seen(5_022, 0), (10_044, 0, 10_000, None));
        } else {
            assert_eq!(seen(0, 5_000), (14, 0, 0, None));
        }
    }
}

/// A source that is calibrated in a cycle that is compensated, or while it is lost: the scale here moves
/// with it all the same, once.
#[test]
fn virtual2_moves_its_scale_while_it_compensates() {
    let changes = [(100, 4), (163, 3), (205, 2), (212, 1), (184, 100), (191, 1)];
    let seen = |rig: &mut Rig, position, shift, reading| {
        rig.inputs[2] = ActualValue { position, shift, reading, ..ActualValue::default() };
        let value = rig.cycle();
        (value.position, value.shift, value.reading, value.failure)
    };
    let (real, extrapolated, lost) = (Reading::Real, Reading::Extrapolated, Reading::Lost);

    // A jump of 1,000 and back, and 5,000 that are none.
    let mut jumps = rig(0, &changes);
    seen(&mut jumps, 0, 0, real);
    assert_eq!(seen(&mut jumps, 10, 0, real), (20, 0, real, None));
    assert_eq!(seen(&mut jumps, 6_020, 5_000, real), (10_040, 10_000, extrapolated, None));
    assert_eq!(seen(&mut jumps, 5_030, 0, real), (10_060, 0, real, None));

    let mut lossy = rig(0, &changes);
    seen(&mut lossy, 0, 0, real);
    assert_eq!(seen(&mut lossy, 10, 0, real), (20, 0, real, None));
    assert_eq!(seen(&mut lossy, 5_010, 5_000, lost), (10_040, 10_000, extrapolated, None));
    assert_eq!(seen(&mut lossy, 5_030, 0, real), (10_060, 0, real, None));
    assert_eq!(seen(&mut lossy, 5_030, 0, lost).2, extrapolated);
    assert_eq!(seen(&mut lossy, 5_030, 0, lost).2, lost);
    assert_eq!(seen(&mut lossy, 5_130, 100, lost).1, 200);
    assert_eq!(seen(&mut lossy, 5_150, 0, real), (10_300, 0, real, None));
}

/// `[170]`: 1234 counts a second, exact over any number of cycles, both ways.
#[test]
fn parameter_170_is_the_counter_frequency() {
    for frequency in [1234, -1234, 1] {
        let mut rig = rig(0, &[(100, 3), (170, frequency)]);
        let last = (0..500 * 7).map(|_| rig.cycle()).last().unwrap();
        assert_eq!(last.position, 7 * frequency);
    }
}

/// `[184]`: a jump above it is a failure; up to it, or with 0, it is a movement.
#[test]
fn parameter_184_is_the_greatest_jump() {
    for (limit, failure) in [(0, None), (100, None), (99, Some(failure::ACTUAL_VALUE_JUMP))] {
        let mut rig = rig(0, &[(184, limit)]);
        rig.at(5);
        let value = rig.at(105);
        assert_eq!((value.position, value.failure), (105, failure), "{limit}");
        // Told once.
        assert_eq!(rig.at(105).failure, None);
    }
}

/// `[191]`: so many cycles go on at the last velocity; then the jump is real, and logged.
#[test]
fn parameter_191_is_how_long_a_jump_is_compensated() {
    for tolerance in 0..=3 {
        let mut rig = rig(0, &[(184, 50), (191, tolerance)]);
        rig.at(0);
        rig.at(10);
        for cycle in 1..=tolerance {
            let value = rig.at(5000);
            assert_eq!(
                (value.position, value.reading, value.failure),
                (10 + 10 * cycle, Reading::Extrapolated, None)
            );
        }
        let value = rig.at(5000);
        assert_eq!(
            (value.position, value.reading, value.failure),
            (5000, Reading::Real, Some(failure::ACTUAL_VALUE_JUMP))
        );
    }
    // A single bad reading leaves no trace.
    let mut rig = rig(0, &[(184, 50), (191, 1)]);
    let seen: std::vec::Vec<i32> = [0, 10, 9999, 30, 40].map(|count| rig.at(count).position).into();
    assert_eq!(seen, [0, 10, 20, 30, 40]);
}

/// Encoder failure: compensated for `[191]` cycles, told once, and the axis learns that nothing is read.
#[test]
fn a_lost_reading_is_a_failure_of_the_same_cycle() {
    let mut rig = rig(0, &[(191, 1)]);
    rig.at(0);
    rig.at(10);
    let mut fault = || {
        rig.encoders[0].fault = true;
        let value = rig.cycle();
        (value.position, value.reading, value.failure)
    };
    assert_eq!(fault(), (20, Reading::Extrapolated, None));
    assert_eq!(fault(), (20, Reading::Lost, Some(failure::READING_LOST)));
    for _ in 0..5 {
        assert_eq!(fault(), (20, Reading::Lost, None), "nothing to extrapolate any more");
    }
    let back = rig.at(25);
    assert_eq!((back.position, back.reading), (25, Reading::Real));
}

/// `[198]`: counting is reversed, `floor` still downwards.
#[test]
fn parameter_198_negates() {
    let mut rig = rig(0, &[(198, 1), (205, 1), (212, 2)]);
    assert_eq!([1, 2, 3, -1].map(|count| rig.at(count).position), [-1, -1, -2, 0]);
}

/// `[205]`, `[212]`: 6000/10000 (6.6.1.1).
#[test]
fn parameters_205_and_212_are_the_multiplier() {
    let mut rig = rig(0, &[(205, 6_000)]);
    assert_eq!(rig.at(10_000).position, 6_000);
    rig.set(212, 3_000);
    assert_eq!(rig.at(10_000).position, 20_000);
}

/// The count has no end, the value wraps as 7.2 says, and the velocity does not notice.
#[test]
fn the_counting_range_wraps() {
    let mut rig = rig(0, &[]);
    rig.at(i32::MAX - 9);
    let value = rig.at((i32::MAX - 9).wrapping_add(20));
    assert_eq!((value.position, value.velocity), (i32::MIN + 10, 10_000));
}

/// `[219]`: added; a change while running moves the scale, not the axis.
#[test]
fn parameter_219_is_the_home_offset() {
    let mut rig = rig(0, &[(219, 100)]);
    assert_eq!(rig.at(5).position, 105);
    rig.set(219, -40);
    let value = rig.at(7);
    assert_eq!((value.position, value.shift, value.velocity), (-33, -140, 1000));
    assert_eq!(rig.at(9).shift, 0);
}

/// A pass over a reference switch on I1.0 that is high from 100 up to 110, there and back.
fn pass(changes: &[(u16, i32)]) -> std::vec::Vec<(i32, i32)> {
    let mut rig = rig(0, changes);
    rig.armed = true;
    let mut hits = std::vec::Vec::new();
    for count in (90..120).step_by(5).chain((90..121).rev().step_by(5)) {
        rig.digital.set(Terminal::new(1, 0).unwrap(), (100..110).contains(&count));
        rig.encoders[0].reference = (60..65).contains(&count);
        let value = rig.at(count);
        if value.calibrated {
            hits.push((count, value.position));
        }
    }
    hits
}

/// `[226]`: the direction in which the reference value is set.
#[test]
fn parameter_226_is_the_direction_of_the_calibration() {
    let hits = |direction| pass(&[(226, direction), (233, 2), (240, 4)]);
    assert_eq!(hits(0), []);
    assert_eq!(hits(1), [(100, 0)]);
    assert_eq!(hits(2), [(105, 0)]);
    assert_eq!(hits(3), [(100, 0), (105, 0)]);
}

/// `[233]`: the edges that count.
#[test]
fn parameter_233_is_the_edge_of_the_calibration() {
    let hits = |edges| pass(&[(226, 1), (233, edges), (240, 4)]);
    assert_eq!(hits(0), []);
    assert_eq!(hits(1), [(110, 0)]);
    assert_eq!(hits(2), [(100, 0)]);
    assert_eq!(hits(3), [(100, 0), (110, 0)]);
}

/// `[240]`: each choice listens to its own signal.
#[test]
fn parameter_240_is_the_input_of_the_calibration() {
    for choice in 0..=10 {
        let mut rig = rig(0, &[(100, 2), (226, 3), (233, 2), (240, choice)]);
        rig.armed = true;
        let mut hits = std::vec::Vec::new();
        for source in 0..=10usize {
            // Every signal low, then the one high.
            rig.encoders = [Encoder::default(); 3];
            rig.digital = DigitalInputs::default();
            rig.can[2] = Some(0xF_0000 << 4);
            rig.cycle();
            match source {
                1..=3 => rig.encoders[source - 1].reference = true,
                4..=9 => rig.digital.set(Terminal::new(1, source as u8 - 4).unwrap(), true),
                10 => rig.can[2] = Some(0),
                _ => {}
            }
            if source == 10 {
                // Low in the second half of a turn first.
                rig.can[2] = Some(0xF_FFF0 << 4);
                rig.cycle();
                rig.can[2] = Some(0);
            }
            if rig.cycle().calibrated {
                hits.push(source);
            }
        }
        let expected: &[usize] = if choice == 0 { &[] } else { &[choice as usize] };
        assert_eq!(hits, expected);
    }
}

/// `[247]`: the value at the reference point, exact to the count when the encoder latched it; the set
/// values are told how far to move.
#[test]
fn parameter_247_is_the_value_at_the_reference_point() {
    let mut rig = rig(0, &[(226, 1), (233, 2), (240, 1), (247, 5000), (205, 1), (212, 1)]);
    rig.armed = true;
    rig.at(90);
    rig.encoders[0] = Encoder { count: 117, reference: true, risen: Some(101), ..Encoder::default() };
    let value = rig.cycle();
    assert_eq!((value.position, value.calibrated, value.shift), (5016, true, 5016 - 117));
    assert_eq!((rig.input.offset(), rig.at(120).position), (-4899, 5019));
    // Not armed: nothing happens.
    rig.armed = false;
    rig.encoders[0] = Encoder { count: 217, risen: Some(201), ..Encoder::default() };
    assert!(!rig.cycle().calibrated);
}

/// `[247]`: X survives a loss of power.
#[test]
fn the_internal_offset_is_kept() {
    let settings = Settings::read(&Values::factory(), 0);
    let mut rig = rig(0, &[]);
    rig.input = ActualValueInput::new(settings, 250);
    assert_eq!(rig.at(0).position, -250);
}

/// `[254]`: the object that the drive's position comes with; 16 turns are followed beyond their end.
#[test]
fn parameter_254_is_the_object_of_the_drive() {
    for choice in 1..=6 {
        let mut rig = rig(3, &[(110, 1), (254 + 3, choice)]);
        rig.can = [Some(1 << 4), Some(2 << 4), Some(3 << 4), Some(4 << 4), Some(5 << 4), Some(6 << 4)];
        assert_eq!(rig.cycle().position, choice);
    }
    let mut rig = rig(0, &[(100, 2)]);
    let turns = |rig: &mut Rig, counts: i32| {
        rig.can[2] = Some((counts as u32) << 4 & 0xFF_FFFF);
        rig.cycle().position
    };
    for turn in 0..40 {
        assert_eq!(turns(&mut rig, turn * COUNTS_PER_TURN), turn * COUNTS_PER_TURN);
    }
    rig.set(254, 0);
    assert_eq!(rig.cycle().reading, Reading::None);
}

/// A drive whose data stop is a failure; one that has never been there is not the input's.
#[test]
fn a_drive_without_data_is_told_once_it_had_some() {
    let mut rig = rig(0, &[(100, 2)]);
    assert_eq!((rig.cycle().failure, rig.cycle().reading), (None, Reading::None));
    rig.can[2] = Some(0);
    assert_eq!(rig.cycle().reading, Reading::Real);
    rig.can[2] = None;
    assert_eq!(rig.cycle().failure, Some(failure::READING_LOST));
}

/// `[261]`: LD 2000 is the only choice: 2^20 increments of the drive are 65,536 counts.
#[test]
fn parameter_261_is_the_ld_2000() {
    let mut rig = rig(0, &[(100, 2), (261, 0)]);
    rig.can[2] = Some(1 << 20);
    assert_eq!(rig.cycle().position, COUNTS_PER_TURN);
}

/// `[268]`: the analog input that is read.
#[test]
fn parameter_268_is_the_analog_input() {
    for choice in 0..7 {
        let active: std::vec::Vec<_> = (35..=41).map(|index| (index, 1)).collect();
        let mut rig = rig(0, &[&active[..], &[(100, 5), (268, choice)]].concat());
        rig.analog.cycle(10, &[10, 11, 12, 13, 14, 15, 16]);
        assert_eq!(rig.cycle().position, 10 + choice);
    }
}

/// `[275]`: mean over the gate time, or the last reading.
#[test]
fn parameter_275_is_average_or_reading() {
    let position = |choice| {
        let mut rig = rig(0, &[(35, 1), (42, 2), (100, 5), (275, choice)]);
        rig.analog.cycle(10, &[100; CHANNELS]);
        rig.analog.cycle(10, &[300; CHANNELS]);
        rig.cycle().position
    };
    assert_eq!((position(0), position(1)), (200, 300));
}
