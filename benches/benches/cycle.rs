//! A whole controller's cycle with six axes in motion, each position controlled with speed pre-control,
//! following error and limit supervision, moving to and fro under an application's function blocks.
//!
//! - Without CAN: three axes on encoders and analog outputs, three virtual ones.
//! - With CAN: six drives LD 2000 on both buses, with SYNC, guarding, and set values and actual values as
//!   PDOs; what the buses cost counts: frames in, timers, frames out.
//!
//! What comes in is recorded first, from virtual drives on virtual buses; only the controller's part is
//! measured. `cargo bench -p benches --bench cycle` ends with status 1 when a cycle takes longer than its
//! bar; `-- --smoke` judges nothing.

use core::hint::black_box;
use core::time::Duration;
use std::process::ExitCode;

use benches::thread_time;
use device_sim::can::{Bus, Faults, Mailbox, Network, Node};
use device_sim::canopen::{self, Ld2000};
use lb2::device::Device;
use motion_core::application::blocks::{MoveAbsolute, Power};
use motion_core::application::{Application, Plc};
use motion_core::io::{Inputs, Outputs, Terminal};
use motion_core::{Controller, Model, STORAGE_LEN};
use pdo::{Frame, NodeId};

type Virtual = Controller<Vec<u8>, Vec<u8>>;

const AXES: u8 = 6;
/// 1 ms an axis.
const CYCLE: Duration = Duration::from_millis(6);
/// Until scan and boot are over, which is not measured.
const START: usize = 500;
/// Until then no axis moves: without its drive it takes no orders.
const BOOTED: usize = 300;
const MEASURED: usize = 5_000;
const MAXIMUM: i32 = 500_000;
const FAR: i32 = 400_000;

/// To and fro with every axis.
struct Shuttle {
    power: Vec<Power>,
    moves: Vec<MoveAbsolute>,
    cycles: usize,
    arrived: u32,
    failed: u32,
}

impl Shuttle {
    fn new() -> Self {
        Self {
            power: (1..=AXES).map(|axis| Power { enable: true, ..Power::new(axis) }).collect(),
            moves: (1..=AXES).map(MoveAbsolute::new).collect(),
            cycles: 0,
            arrived: 0,
            failed: 0,
        }
    }
}

impl Application for Shuttle {
    fn cycle(&mut self, plc: &mut Plc<'_>) {
        self.cycles += 1;
        for (power, mover) in self.power.iter_mut().zip(&mut self.moves) {
            let on = power.call(plc).expect("activated") && self.cycles > BOOTED;
            let outputs = mover.call(plc);
            self.arrived += u32::from(outputs.done);
            self.failed += u32::from(outputs.error);
            if mover.execute && !outputs.busy {
                mover.execute = false;
            } else if on && !mover.execute {
                mover.position = FAR - mover.position;
                mover.execute = true;
            }
        }
    }
}

/// What one cycle of the controller is given.
struct Turn {
    now: Duration,
    inputs: Inputs,
    frames: Vec<(usize, Duration, Frame)>,
}

fn controller(can: bool) -> Virtual {
    let mut controller = Controller::power_on(Model::Gel8230, vec![0xFF; STORAGE_LEN], vec![0; 65536]);
    let mut set = |index: u16, value: i32| {
        let answer = controller.write_parameter(index, value);
        assert!(!answer.code.is_error(), "[{index}] = {value}: {}", answer.text);
    };
    set(0, i32::from(AXES));
    for axis in 0..u16::from(AXES) {
        // Control, V max., KSP, t max. acceleration, T jerking, following error, tolerance.
        let common = [(600, 1), (642, MAXIMUM), (648, 50), (654, 400), (690, 100), (696, 20_000)];
        let ends = [(702, 20_000), (708, 2_000), (714, 2_000), (924, 1), (930, FAR + 50_000)];
        for (first, value) in common.into_iter().chain(ends).chain([(936, 1), (942, -50_000)]) {
            set(first + axis, value);
        }
        if can {
            set(100 + axis, 2);
            set(107 + axis, 1);
            set(450 + axis, 2);
        } else if axis >= 3 {
            // Virtual, no output.
            set(606 + axis, 8);
            set(612 + axis, 0);
        }
    }
    if can {
        // IN 1, IN 2, OUT 1, OUT 2 of CAN 1: drives; those of CAN 2 are by default.
        for object in [326, 327, 330, 331] {
            set(object, 3);
        }
    }
    assert_eq!(controller.call_loader(), -1);
    assert_eq!(controller.cycle_time(), CYCLE);
    controller
}

/// One cycle of the controller; frames that it sends go to `sent`.
#[inline]
fn turn(
    controller: &mut Virtual,
    application: &mut Shuttle,
    turn: &Turn,
    mut sent: impl FnMut(usize, Frame),
) -> Outputs {
    let now = turn.now;
    for (at, time, frame) in &turn.frames {
        if let Some(bus) = controller.bus(*at) {
            bus.handle_frame(*time, frame);
        }
    }
    for at in 0..2 {
        if let Some(bus) = controller.bus(at) {
            bus.handle_timeout(now);
        }
    }
    let outputs = controller.cycle(now, &turn.inputs, application);
    for at in 0..2 {
        if let Some(bus) = controller.bus(at) {
            while let Some(frame) = bus.poll_transmit(now) {
                sent(at, frame);
            }
        }
    }
    outputs
}

/// A bus with its drives and the controller's place on it.
struct Wire {
    network: Network,
    mailbox: Mailbox,
    drives: Vec<canopen::Node<Ld2000>>,
}

impl Wire {
    fn new(drives: u8) -> Self {
        let drive = |node: u8| Ld2000::node(NodeId::new(node).ok(), u32::from(node));
        Self {
            network: Network::new(Bus::new(500_000, Faults::NONE), usize::from(drives) + 1),
            mailbox: Mailbox::default(),
            drives: (1..=drives).map(drive).collect(),
        }
    }

    fn run(&mut self, end: Duration) {
        let mut nodes: Vec<&mut dyn Node> = vec![&mut self.mailbox];
        nodes.extend(self.drives.iter_mut().map(|drive| drive as &mut dyn Node));
        while self.network.step(&mut nodes, end) {}
    }
}

/// Plays it once in closed loop. Without CAN the axes of the terminals do what they are told at once.
fn record(can: bool) -> (Vec<Turn>, u32) {
    let mut controller = controller(can);
    let mut application = Shuttle::new();
    let mut wires = if can { vec![Wire::new(2), Wire::new(4)] } else { Vec::new() };
    let mut positions = [0.0; 3];
    let mut turns = Vec::new();
    let mut inputs = Inputs::default();
    inputs.digital.set(Terminal::PLC_RUN, true);
    for number in 0..START + MEASURED {
        let now = CYCLE * number as u32;
        let mut frames = Vec::new();
        for (at, wire) in wires.iter_mut().enumerate() {
            wire.run(now);
            frames.extend(wire.mailbox.received.drain(..).map(|(time, frame)| (at, time, frame)));
        }
        let this = Turn { now, inputs, frames };
        let outputs = turn(&mut controller, &mut application, &this, |at, frame| {
            if let Some(wire) = wires.get_mut(at) {
                wire.mailbox.to_send.push_back(frame);
            }
        });
        turns.push(this);
        for ((position, encoder), voltage) in
            positions.iter_mut().zip(&mut inputs.encoders).zip(outputs.analog)
        {
            *position += f64::from(voltage) / 10_000.0 * f64::from(MAXIMUM) * CYCLE.as_secs_f64();
            encoder.count = *position as i32;
        }
    }
    (turns, application.arrived)
}

/// Time of a cycle; least and median of the rounds.
fn measure(can: bool, rounds: usize) -> [f64; 2] {
    let (turns, arrived) = record(can);
    assert!(arrived >= 60, "only {arrived} moves: the axes do not move");
    let frames: usize = turns.iter().skip(START).map(|turn| turn.frames.len()).sum();
    let mut sent = 0;
    let mut times: Vec<f64> = (0..rounds)
        .map(|_| {
            let mut controller = controller(can);
            let mut application = Shuttle::new();
            let (start, measured) = turns.split_at(START);
            for this in start {
                turn(&mut controller, &mut application, this, |_, _| ());
            }
            sent = 0;
            let begin = thread_time();
            for this in measured {
                let outputs = turn(&mut controller, &mut application, this, |_, frame| {
                    black_box(frame);
                    sent += 1;
                });
                black_box(outputs);
            }
            let time = thread_time() - begin;
            assert_eq!((application.arrived, application.failed), (arrived, 0), "not as recorded");
            time.as_secs_f64() * 1e9 / MEASURED as f64
        })
        .collect();
    println!(
        "six axes {} CAN: {arrived} moves, {:.1} frames in and {:.1} out a cycle",
        if can { "with" } else { "without" },
        frames as f64 / MEASURED as f64,
        f64::from(sent) / MEASURED as f64
    );
    times.sort_by(f64::total_cmp);
    [times[0], times[times.len() / 2]]
}

fn main() -> ExitCode {
    let smoke = std::env::args().any(|arg| arg == "--smoke");
    let mut good = true;
    for (can, bar) in [(false, 1_000.0), (true, 3_000.0)] {
        let [least, median] = measure(can, if smoke { 1 } else { 31 });
        let verdict = match (smoke, median <= bar) {
            (true, _) => "",
            (false, true) => "  ok",
            (false, false) => "  ABOVE THE BAR",
        };
        good &= smoke || median <= bar;
        println!("  {median:.0} ns a cycle (least {least:.0} ns)  bar {bar:.0} ns{verdict}");
    }
    println!("state of the controller: {} B", size_of::<Controller<&mut [u8], &mut [u8]>>());
    if good { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
