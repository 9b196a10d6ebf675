use super::*;
use motion_core::input::{Code, Encoder, Evaluation, QuadratureDecoder};
use motion_core::io::{DigitalInputs, Inputs, Outputs, Terminal};

fn close(a: f64, b: f64, tolerance: f64) {
    assert!((a - b).abs() <= tolerance, "{a} is not {b} ± {tolerance}");
}

/// v(t) = v∞·(1 − e^(−t/τ)).
#[test]
fn first_order_drive_follows_its_formula() {
    let mut plant = Plant::new(Drive::first_order(1000.0, 0.02));
    plant.run(20, Demand::Speed(0.5), true);
    close(plant.velocity(), 500.0 * (1.0 - (-1.0f64).exp()), 1e-9);
    close(plant.position(), 500.0 * (0.02 - 0.02 * (1.0 - (-1.0f64).exp())), 1e-4);
    plant.run(1000, Demand::Speed(0.5), true);
    close(plant.velocity(), 500.0, 1e-9);
}

/// Overshoot of a second-order system: e^(−πζ/√(1−ζ²)); none when aperiodic.
#[test]
fn second_order_drive_overshoots_by_its_damping() {
    let peak = |damping: f64| {
        let mut plant = Plant::new(Drive::second_order(1000.0, 100.0, damping));
        (0..200).fold(0.0f64, |peak, _| {
            plant.run(1, Demand::Speed(1.0), true);
            peak.max(plant.velocity())
        })
    };
    let expected = (-core::f64::consts::PI * 0.4 / (1.0f64 - 0.16).sqrt()).exp();
    close(peak(0.4) / 1000.0 - 1.0, expected, 0.01);
    close(peak(1.0), 1000.0, 1.0);
}

#[test]
fn a_servo_is_limited_by_its_force_and_stuck_below_stiction() {
    let mut plant = Plant::new(Drive::Servo(Servo::new(1000.0, 2.0, 400.0)));
    plant.run(100, Demand::Speed(1.0), true);
    // F/m = 200 units/s², 0.1 s.
    close(plant.velocity(), 20.0, 1e-6);
    let mut stuck = Servo::new(1000.0, 2.0, 400.0);
    (stuck.stiction, stuck.coulomb) = (500.0, 100.0);
    let mut plant = Plant::new(Drive::Servo(stuck));
    plant.run(1000, Demand::Speed(1.0), true);
    assert_eq!((plant.velocity(), plant.position()), (0.0, 0.0));
    let mut rubbing = Servo::new(100.0, 1.0, 4000.0);
    (rubbing.coulomb, rubbing.stiction, rubbing.viscous) = (100.0, 150.0, 0.5);
    let mut plant = Plant::new(Drive::Servo(rubbing));
    plant.run(1000, Demand::Speed(1.0), true);
    close(plant.velocity(), 100.0, 0.01);
    plant.run(3000, Demand::Speed(0.0), true);
    assert_eq!(plant.velocity(), 0.0);
}

#[test]
fn a_valve_has_an_overlap_and_two_speeds() {
    let velocity = |demand| {
        let mut plant = Plant::new(Drive::Hydraulic(Valve::new(100.0)));
        plant.run(1000, Demand::Speed(demand), true);
        plant.velocity()
    };
    close(velocity(0.03), 0.0, 1e-12);
    close(velocity(1.0), 100.0, 1e-6);
    close(velocity(-1.0), -80.0, 1e-6);
    close(velocity(0.515), 50.0, 1e-6);
}

#[test]
fn a_stepper_makes_each_step_or_loses_the_pulses() {
    let mut plant = Plant::new(Drive::Stepper(Stepper::new(0.5)));
    let clock = |frequency, backward| Demand::Clock { frequency, backward };
    plant.run(1000, clock(400.0, false), true);
    assert_eq!(plant.position(), 200.0);
    plant.run(500, clock(400.0, true), true);
    assert_eq!(plant.position(), 100.0);
    // From standstill to 2 kHz at once is too much.
    plant.run(100, clock(2000.0, false), true);
    assert_eq!(plant.position(), 100.0);
    let Drive::Stepper(stepper) = &plant.drive else { panic!() };
    assert_eq!(stepper.lost(), 100);
    // A ramp of 50 Hz a millisecond is not.
    for ms in 0..40 {
        plant.run(1, clock(f64::from(ms) * 50.0, false), true);
    }
    plant.run(100, clock(2000.0, false), true);
    assert_eq!(plant.position(), 100.0 + (39.0 + 200.0) * 0.5);
}

#[test]
fn a_two_speed_motor_runs_on_its_signals() {
    let mut plant = Plant::new(Drive::TwoSpeed(TwoSpeed::new(10.0, 100.0, 1000.0)));
    let signals = |forward, backward, slow, fast| Demand::Signals { forward, backward, slow, fast };
    plant.run(50, signals(true, false, true, true), true);
    close(plant.velocity(), 50.0, 1e-9);
    plant.run(500, signals(true, false, true, false), true);
    close(plant.velocity(), 10.0, 1e-9);
    plant.run(500, signals(false, true, true, false), true);
    close(plant.velocity(), -10.0, 1e-9);
    plant.run(500, signals(true, true, true, true), true);
    assert_eq!(plant.velocity(), 0.0);
}

#[test]
fn a_brake_holds_until_it_is_open() {
    let mut plant = Plant::new(Drive::first_order(1000.0, 0.001)).with_brake(Brake::new(0.03, 0.02));
    let full = Demand::Speed(1.0);
    plant.run(29, full, true);
    assert_eq!((plant.position(), plant.brake().unwrap().holds()), (0.0, true));
    plant.run(2, full, true);
    assert!(plant.position() > 0.0);
    plant.run(19, full, false);
    assert!(plant.velocity() > 0.0);
    plant.run(2, full, false);
    assert_eq!(plant.velocity(), 0.0);
}

#[test]
fn stops_end_the_movement() {
    let mut plant = Plant::new(Drive::first_order(1000.0, 0.001)).with_stops(-1.0, 5.0);
    plant.run(100, Demand::Speed(1.0), true);
    assert_eq!(plant.position(), 5.0);
    plant.run(100, Demand::Speed(-1.0), true);
    assert_eq!(plant.position(), -1.0);
}

/// The computed counts and latches are those that a decoder finds in the tracks, edge by edge.
#[test]
fn an_encoder_counts_as_its_tracks_do() {
    let mut rng = oorandom::Rand32::new(7);
    for every in [0, 400] {
        let encoder = Incremental::new(8.0, 37, every);
        let mut decoder = QuadratureDecoder::new(Evaluation::FourEdges);
        let mut sensor = Sensor::Incremental(encoder.clone());
        let mut edge = 0i64;
        let (a, b, n) = encoder.tracks(edge);
        decoder.sample(a, b, n);
        decoder.take();
        sensor.read(0.0);
        for cycle in 0..2000 {
            let to = edge + i64::from(rng.rand_range(0..121)) - 60;
            while edge != to {
                edge += (to - edge).signum();
                let (a, b, n) = encoder.tracks(edge);
                decoder.sample(a, b, n);
            }
            let read = sensor.read(edge as f64 / 8.0);
            assert_eq!(read, decoder.take(), "cycle {cycle}, every {every}");
        }
        sensor.set_broken(true);
        assert!(sensor.read(0.0).fault);
    }
}

#[test]
fn an_absolute_encoder_sends_its_word() {
    let word = motion_core::input::Ssi::new(Code::Gray, true, 12);
    let mut sensor = Sensor::Ssi(Ssi::new(4096.0, word));
    let read = sensor.read(3.5);
    assert_eq!(word.position(read.count as u32), 3 * 4096 + 2048);
    let before_zero = sensor.read(-1.0 / 4096.0);
    assert_eq!(word.position(before_zero.count as u32), (1 << 24) - 1);
}

#[test]
fn a_machine_is_wired_to_the_terminals() {
    let limit = Terminal::new(2, 3).unwrap();
    let sensor = Sensor::Incremental(Incremental::new(1.0, i64::MAX - 8, 0));
    let wiring = Wiring::new(
        Plant::new(Drive::first_order(1000.0, 0.001)),
        Connection::Analog { block: 1, unipolar: false },
        sensor,
    )
    .with_switch(Switch::limit(limit, 400.0, true).opener());
    let mut machine = Machine { axes: vec![wiring], inputs: Inputs::default() };
    machine.inputs.digital.set(Terminal::PLC_RUN, true);
    let mut outputs = Outputs::default();
    assert!(machine.run(1, &outputs).digital.get(limit));
    outputs.analog = [0, 5_000, 0];
    let inputs = machine.run(1000, &outputs);
    close(f64::from(inputs.encoders[1].count), 499.5, 1.0);
    assert_eq!(inputs.encoders[0], Encoder::default());
    assert!(!inputs.digital.get(limit) && inputs.digital.get(Terminal::PLC_RUN));
    let mut expected = DigitalInputs::default();
    expected.set(Terminal::PLC_RUN, true);
    assert_eq!(inputs.digital, expected);
}
