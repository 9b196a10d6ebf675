//! Actual value inputs with an axis that is controlled by them, 6.6. Those on the CAN buses are looked at
//! with six axes, in `controller_axes`.

use device_sim::plant::{Incremental, Sensor, Ssi, Switch};
use motion_core::application::Order;
use motion_core::failure::{ACTUAL_VALUE_JUMP, READING_LOST};
use motion_core::input::{Code, Evaluation, Kind, QuadratureDecoder, Settings};
use motion_core::io::Terminal;

use super::bench::{Bench, CONTROL, Effect, Family};

fn effect<'a>(parameter: u16, left: f64, cases: &'a [(i32, f64)], tolerance: f64) -> Effect<'a> {
    Effect { family: Family::Inputs, modes: &[CONTROL], parameter, base: &[], left, cases, tolerance }
}

fn encoders<'a>(parameter: u16, left: f64, cases: &'a [(i32, f64)], tolerance: f64) -> Effect<'a> {
    Effect { family: Family::Encoders, ..effect(parameter, left, cases, tolerance) }
}

/// Where the axis really is that was sent to 1,000.
fn arrives(bench: &mut Bench) -> f64 {
    bench.order(Order::MoveAbsolute { position: 1_000, velocity: None });
    bench.run(3_000);
    bench.real()
}

/// The actual value after the plant has jogged 1,500 ms forward, without feedback.
fn counted(bench: &mut Bench) -> f64 {
    bench.jog_speed(true, false);
    bench.order(Order::Stop);
    bench.run(600);
    // The middle of an edge, so that rounding does not count.
    let position = bench.real().floor() + 0.5;
    bench.push(position);
    bench.cycle();
    f64::from(bench.status().position) / position.floor()
}

/// `[100]`: an absolute encoder's word is taken for a position by its own type only; a counter frequency of
/// 0 stands still, and so does an analog input on which nothing is.
#[test]
fn parameter_100_selects_the_source() {
    let word = motion_core::input::Ssi::new(Code::Gray, false, 12);
    let runs_away = 5_000.0;
    let cases = [(1, 1_000.0), (3, runs_away), (5, runs_away)];
    let observe = |bench: &mut Bench| arrives(bench).min(runs_away);
    encoders(100, runs_away, &cases, 2.0).shows(|bench| {
        bench.machine.axes[0].sensor.as_mut().unwrap().1 = Sensor::Ssi(Ssi::new(1.0, word));
        // What Gray code looks like to a counter ends anywhere.
        if bench.controller.working().at(100, bench.route.input) == 0 {
            let real = arrives(bench);
            assert!((real - 1_000.0).abs() > 50.0, "{real}");
            return runs_away;
        }
        observe(bench)
    });
    encoders(100, 1_000.0, &[(0, 1_000.0), (3, runs_away)], 2.0).shows(observe);
}

/// `[107]`: an input that is not active gives the axis no position, and without one it does not move.
#[test]
fn parameter_107_activates_the_input() {
    effect(107, 1_000.0, &[(0, 0.0), (1, 1_000.0)], 2.0).shows(arrives);
}

/// `[128]`: what the decoder in front of the controller is set to. The plant turns an encoder of four edges a
/// unit whose second track is the direction: two of them are counted with Ink_S; as quadrature they are none.
#[test]
fn parameter_128_is_the_edge_evaluation() {
    encoders(128, 0.0, &[(0, 0.0), (1, 2.0)], 0.01).shows(|bench| {
        let input = bench.route.input;
        let Kind::Incremental { encoder, evaluation } =
            Settings::read(bench.controller.working(), input).kind
        else {
            panic!("not incremental")
        };
        assert_eq!(evaluation == Evaluation::FourEdges, bench.controller.working().at(128, input) == 0);
        let mut decoder = QuadratureDecoder::new(evaluation);
        decoder.sample(false, false, false);
        bench.jog(true, false);
        let mut last = 0;
        for _ in 0..250 {
            bench.cycle();
            let now = bench.real().floor() as i64;
            // A pulse a unit, the direction's level does not change.
            for _ in last..now {
                decoder.sample(true, false, false);
                decoder.sample(false, false, false);
            }
            last = now;
            bench.inputs.encoders[encoder] = decoder.take();
        }
        bench.cycle();
        f64::from(bench.status().position) / last as f64
    });
}

/// The actual value of an axis at 500 with an absolute encoder that sends such words.
fn absolute(bench: &mut Bench, word: motion_core::input::Ssi) -> f64 {
    bench.machine.axes[0].sensor.as_mut().unwrap().1 = Sensor::Ssi(Ssi::new(1.0, word));
    bench.push(500.5);
    bench.cycle();
    f64::from(bench.status().position)
}

/// `[135]`: 500 is 270 in Gray code.
#[test]
fn parameter_135_is_the_ssi_code() {
    let word = motion_core::input::Ssi::new(Code::Gray, false, 12);
    let base = [(100, 1)];
    Effect { base: &base, ..encoders(135, 500.0, &[(0, 500.0), (1, 270.0)], 0.0) }
        .shows(|bench| absolute(bench, word));
}

/// `[142]`: the turns above the first are known, or not.
#[test]
fn parameter_142_is_the_number_of_turns_an_ssi_encoder_knows() {
    let word = motion_core::input::Ssi::new(Code::Binary, true, 12);
    let base = [(100, 1), (135, 1)];
    let turned = 3.0 * 4_096.0;
    Effect { base: &base, ..encoders(142, 500.0, &[(0, 500.0), (1, turned + 500.0)], 0.0) }.shows(|bench| {
        bench.machine.axes[0].sensor.as_mut().unwrap().1 = Sensor::Ssi(Ssi::new(1.0, word));
        bench.push(turned + 500.5);
        // As after switching on: the first reading is where the axis is.
        let single = bench.controller.working().at(142, bench.route.input) == 0;
        bench.cycle();
        let position = f64::from(bench.status().position);
        if single { position.rem_euclid(4_096.0) } else { position }
    });
}

/// `[149]`: an encoder with 10 bits a turn goes on after 1,023.
#[test]
fn parameter_149_is_the_bits_of_a_turn() {
    let word = motion_core::input::Ssi::new(Code::Binary, false, 10);
    let base = [(100, 1), (135, 1)];
    let cases = [(10, 1_500.0), (12, 476.0)];
    Effect { base: &base, ..encoders(149, 476.0, &cases, 0.0) }.shows(|bench| {
        bench.machine.axes[0].sensor.as_mut().unwrap().1 = Sensor::Ssi(Ssi::new(1.0, word));
        for position in [500.5, 900.5, 1_300.5, 1_500.5] {
            bench.push(position);
            bench.cycle();
        }
        f64::from(bench.status().position)
    });
}

/// `[156]`: what is taken over of number 1, where only the input is: its actual value, while the plant
/// stands. What moves is looked at in `gearing.rs`.
#[test]
fn parameter_156_is_the_quantity_taken_over() {
    let base = [(100, 4), (163, 1)];
    let cases = [(0, 400.0), (1, 0.0), (2, 0.0), (3, 0.0), (4, 0.0)];
    Effect { family: Family::Others, base: &base, ..effect(156, 400.0, &cases, 0.0) }
        .shows(|bench| taken_over(bench, 0));
}

/// `[163]`: the plant's encoder is that of input 1, then that of input 2; others stand at 0.
#[test]
fn parameter_163_is_the_number_of_the_source() {
    let base = [(100, 4), (156, 0), (163, 3)];
    let cases = [(1, 400.0), (2, 0.0), (3, 0.0)];
    Effect { family: Family::Others, base: &base, ..effect(163, 0.0, &cases, 0.0) }
        .shows(|bench| taken_over(bench, 0));
    let cases = [(1, 0.0), (2, 400.0), (3, 0.0)];
    Effect { family: Family::First, base: &base, ..effect(163, 0.0, &cases, 0.0) }
        .shows(|bench| taken_over(bench, 1));
}

/// The actual value, with the plant's encoder on a block by place, and the plant at 400.
fn taken_over(bench: &mut Bench, block: usize) -> f64 {
    bench.machine.axes[0].sensor.as_mut().unwrap().0 = block;
    bench.push(400.5);
    bench.run(12);
    f64::from(bench.status().position)
}

/// `[170]`: so many counts a second come without an encoder.
#[test]
fn parameter_170_is_the_counter_frequency() {
    let base = [(100, 3)];
    Effect { base: &base, ..effect(170, 0.0, &[(500, 500.0), (-1_234, -1_234.0)], 1.0) }.shows(|bench| {
        let before = bench.status().position;
        bench.run(6_000);
        f64::from(bench.status().position - before) / 6.0
    });
}

/// `[184]`: a jump of 300 is a failure, or a movement.
#[test]
fn parameter_184_is_the_greatest_jump() {
    effect(184, 0.0, &[(0, 0.0), (299, 1.0), (300, 0.0)], 0.0).shows(|bench| {
        let stored = |bench: &mut Bench| bench.failures() == [ACTUAL_VALUE_JUMP];
        bench.push(0.5);
        bench.cycle();
        bench.push(300.5);
        bench.cycle();
        assert!(stored(bench) || bench.failures().is_empty());
        f64::from(u8::from(stored(bench)))
    });
}

/// `[191]`: so many cycles of a wire break the axis moves on at its velocity, then it fails.
#[test]
fn parameter_191_is_how_long_a_jump_is_compensated() {
    let cases = [(0, 1.0), (1, 2.0), (2, 3.0), (3, 4.0)];
    encoders(191, 1.0, &cases, 0.0).shows(|bench| {
        bench.order(Order::MoveVelocity { velocity: 2_000 });
        bench.run(1_500);
        bench.machine.axes[0].sensor.as_mut().unwrap().1.set_broken(true);
        bench.cycle();
        let mut cycles = 0.0;
        while bench.failures().is_empty() {
            let before = bench.status().position;
            bench.cycle();
            cycles += 1.0;
            let way = bench.status().position - before;
            assert!(!bench.failures().is_empty() || (11..=13).contains(&way), "{way}");
        }
        assert_eq!(bench.failures(), [READING_LOST]);
        cycles
    });
}

/// `[198]`: a plant that moves forward counts down.
#[test]
fn parameter_198_negates() {
    effect(198, 1.0, &[(0, 1.0), (1, -1.0)], 0.01).shows(counted);
}

/// `[205]`: A = R · mn/md; the way of the plant is its inverse.
#[test]
fn parameter_205_is_the_multipliers_numerator() {
    effect(205, 1_000.0, &[(20_000, 500.0), (6_250, 1_600.0)], 3.0).shows(arrives);
}

#[test]
fn parameter_212_is_the_multipliers_denominator() {
    effect(212, 1_000.0, &[(20_000, 2_000.0), (5_000, 500.0)], 3.0).shows(arrives);
}

/// `[219]`: added to the actual value.
#[test]
fn parameter_219_is_the_home_offset() {
    effect(219, 1_000.0, &[(100, 900.0), (-400, 1_400.0)], 2.0).shows(arrives);
}

const CALIBRATION: [(u16, i32); 4] = [(226, 3), (233, 3), (240, 4), (247, 0)];

/// Looks for a cam on I1.0 from 600 up to 900, from 0 forward or from 1,200 backward: where the actual value
/// is 0 then, −1 if it was not found.
fn calibrates(bench: &mut Bench, backward: bool) -> f64 {
    bench.add_switch(Switch::new(Terminal::new(1, 0).unwrap(), 600.0, 900.0));
    if backward {
        bench.push(1_200.5);
        bench.cycle();
    }
    bench.order(Order::Home);
    if bench.until(|bench| bench.status().homed) < 0.0 {
        return -1.0;
    }
    bench.run(500);
    bench.real() - f64::from(bench.status().position)
}

/// `[226]`: in the other direction nothing is found.
#[test]
fn parameter_226_is_the_direction_of_the_calibration() {
    let base = [&CALIBRATION[1..], &[(804, 1)]].concat();
    let cases = [(0, -1.0), (1, 600.0), (2, -1.0), (3, 600.0)];
    Effect { base: &base, ..effect(226, -1.0, &cases, 4.0) }.shows(|bench| calibrates(bench, false));
    let base = [&CALIBRATION[1..], &[(804, 2)]].concat();
    let cases = [(0, -1.0), (1, -1.0), (2, 900.0), (3, 900.0)];
    Effect { base: &base, ..effect(226, -1.0, &cases, 4.0) }.shows(|bench| calibrates(bench, true));
}

/// `[233]`: where the cam ends, or begins.
#[test]
fn parameter_233_is_the_edge_of_the_calibration() {
    let base = [CALIBRATION[0], CALIBRATION[2], (804, 1)];
    let cases = [(0, -1.0), (1, 900.0), (2, 600.0), (3, 600.0)];
    Effect { base: &base, ..effect(233, -1.0, &cases, 4.0) }.shows(|bench| calibrates(bench, false));
}

/// `[240]`: the cam is on I1.0.
#[test]
fn parameter_240_is_the_input_of_the_calibration() {
    let base = [CALIBRATION[0], CALIBRATION[1], (804, 1)];
    let cases = [(0, -1.0), (4, 600.0), (5, -1.0), (9, -1.0)];
    let observe = |bench: &mut Bench| {
        // Without a mark on the encoder.
        if let Some((_, sensor)) = &mut bench.machine.axes[0].sensor {
            *sensor = Sensor::Incremental(Incremental::new(1.0, i64::MAX - 8, 0));
        }
        calibrates(bench, false)
    };
    Effect { base: &base, ..effect(240, -1.0, &cases, 4.0) }.shows(observe);
    // With the mark at 1,000, on the encoder of the input's own number: exact to the edge.
    let base = [CALIBRATION[0], (233, 2), (804, 1)];
    let marks = Effect { base: &base, ..encoders(240, 0.0, &[], 0.0) };
    marks.each(&[], |bench| {
        bench.order(Order::Home);
        assert!(bench.until(|bench| bench.status().homed) > 0.0);
        bench.run(500);
        assert_eq!(bench.real().floor() as i32 - bench.status().position, 1_000);
    });
}

/// `[247]`: the value at the reference point.
#[test]
fn parameter_247_is_the_value_at_the_reference_point() {
    let base = [&CALIBRATION[..3], &[(804, 1)]].concat();
    let cases = [(250, 350.0), (-4_000, 4_600.0)];
    Effect { base: &base, ..effect(247, 600.0, &cases, 4.0) }.shows(|bench| calibrates(bench, false));
}

/// Where an axis ends, at most 5,000, that is sent to 400 with its plant's position on I61.
fn analog(bench: &mut Bench) -> f64 {
    bench.machine.axes[0].sensor = None;
    let end = bench.now_ms() + 3_000;
    bench.order(Order::MoveAbsolute { position: 400, velocity: None });
    while bench.now_ms() < end {
        bench.inputs.analog[0] = bench.real().clamp(0.0, 1_023.0) as u16;
        bench.cycle();
    }
    bench.real().min(5_000.0)
}

/// `[268]`: the position is on I61; the others stand at 0.
#[test]
fn parameter_268_is_the_analog_input() {
    let base = [(100, 5), (35, 1), (36, 1), (275, 1), (648, 50)];
    let cases = [(0, 400.0), (1, 5_000.0)];
    for (family, left) in [(Family::First, 400.0), (Family::Others, 5_000.0)] {
        Effect { family, base: &base, ..effect(268, left, &cases, 5.0) }.shows(analog);
    }
}

/// `[035]`: an analog input that is not active reads 0.
#[test]
fn parameter_035_activates_an_analog_input() {
    let base = [(100, 5), (268, 0), (275, 1), (648, 50)];
    let cases = [(0, 5_000.0), (1, 400.0)];
    Effect { family: Family::First, base: &base, ..effect(35, 5_000.0, &cases, 5.0) }.shows(analog);
}

/// `[042]`: half a second after a jump of 500 the mean over 1 s has gone half the way.
#[test]
fn parameter_042_is_the_gate_time() {
    let base = [(100, 5), (35, 1), (268, 0), (275, 0)];
    Effect { family: Family::First, base: &base, ..effect(42, 500.0, &[(100, 250.0)], 6.0) }
        .shows(after_a_jump);
}

/// `[275]`: the mean over `[042]` lags behind a reading that jumps.
#[test]
fn parameter_275_is_average_or_reading() {
    let base = [(100, 5), (35, 1), (42, 100), (268, 0)];
    Effect { base: &base, ..effect(275, 250.0, &[(0, 250.0), (1, 500.0)], 6.0) }.shows(after_a_jump);
}

/// The actual value half a second after a jump of I61 from 0 to 500.
fn after_a_jump(bench: &mut Bench) -> f64 {
    bench.run(1_200);
    let end = bench.now_ms() + 498;
    while bench.now_ms() < end {
        bench.inputs.analog[0] = 500;
        bench.cycle();
    }
    f64::from(bench.status().position)
}
