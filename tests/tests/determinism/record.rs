//! Makes a recording: a controller with its machine and its drives in closed loop, an operator, and a
//! workstation that talks LB2 over a line with noise.

use core::time::Duration;

use determinism::{Counts, Record, Replica, What};
use device_sim::can::{Bus, Faults, Mailbox, Network, Node};
use device_sim::canopen::{self, Ld2000};
use device_sim::plant::{
    Connection, Drive, Incremental, Machine, Plant, Sensor, Servo, Stepper, Switch, Wiring,
};
use lb2::frame::MAX_WIRE;
use lb2::telegram::Request;
use motion_core::io::{DigitalInputs, Inputs, Outputs, Terminal};
use oorandom::Rand32;
use pdo::NodeId;

/// How long is recorded.
const TIME: Duration = Duration::from_secs(11);
/// From the cable's break on, nothing comes from the second drive of CAN 1.
const BREAK: u64 = 8_000;
/// Encoder E2 fails then, for some cycles.
const FAULT: core::ops::Range<u64> = 7_000..7_030;

/// What the operator does: from when to when, ms, a digital input is high.
const SWITCHES: &[(u8, u8, core::ops::Range<u64>)] = &[
    // PLC Run, with a stop.
    (3, 7, 0..9_600),
    (3, 7, 9_800..u64::MAX),
    // Enable; calibration; stop; acknowledge; position of axis 3.
    (1, 0, 1_500..u64::MAX),
    (1, 1, 1_700..4_000),
    (1, 2, 5_200..5_400),
    (1, 3, 7_400..7_450),
    (1, 3, 9_000..9_050),
    (1, 4, 1_600..1_650),
    // The axes, to and fro, some of them changing their mind on the way.
    (2, 0, 4_000..5_000),
    (2, 0, 5_600..7_600),
    (2, 1, 2_000..3_200),
    (2, 1, 3_500..4_600),
    (2, 1, 5_600..6_800),
    (2, 2, 2_000..3_400),
    (2, 2, 4_200..5_000),
    (2, 2, 5_600..7_000),
    (2, 3, 2_000..3_600),
    (2, 3, 3_700..4_900),
    (2, 3, 6_000..8_500),
    (2, 4, 2_100..4_100),
    (2, 4, 5_600..5_900),
    (2, 4, 6_000..9_000),
    (2, 5, 2_200..4_000),
    (2, 5, 4_400..6_600),
    (2, 5, 7_000..9_000),
];

/// Six axes: 1 on a servo with a reference mark and a limit switch, 2 on a first-order drive without a limit
/// of jerk, 3 a stepper, 4 on CAN 2, 5 and 6 on CAN 1.
fn parameters() -> Vec<(u16, i32)> {
    let mut all = vec![(0, 6), (4, 2), (35, 1), (42, 10)];
    let maximum = [100_000, 80_000, 20_000, 1_000_000, 900_000, 800_000];
    for (axis, maximum) in (0..6).zip(maximum) {
        let jerk = if axis == 1 { 0 } else { 80 };
        all.extend(
            [(600, 1), (642, maximum), (648, 60), (654, 300), (660, 250), (690, jerk)]
                .map(|(first, value)| (first + axis, value)),
        );
        all.extend(
            [(696, 60_000), (702, 60_000), (708, 300), (714, 300)].map(|(i, value)| (i + axis, value)),
        );
    }
    // Axis 1: V1 and V2, turning point I1.5, reference mark of E1 rising forward is 500.
    all.extend([(792, 30_000), (798, 10_000), (804, 1), (960, 2), (966, 5), (226, 1), (233, 2), (247, 500)]);
    // Axis 3: a stepper motor that is its own actual value.
    all.extend([(608, 7), (452, 4), (542, 20_000), (109, 0)]);
    // Inputs and outputs 4 to 6 with drives.
    all.extend([(110, 1), (111, 1), (112, 1), (453, 2), (454, 2), (455, 2)]);
    all.extend([(326, 3), (327, 3), (330, 3), (331, 3)]);
    all
}

fn machine() -> Machine {
    let analog = |block| Connection::Analog { block, unipolar: false };
    let encoder = |mark| Sensor::Incremental(Incremental::new(1.0, mark, 0));
    let servo = Plant::new(Drive::Servo(Servo::new(100_000.0, 1.0, 2_000_000.0)));
    let turning_point = Terminal::new(1, 5).unwrap();
    let stepper = Wiring {
        plant: Plant::new(Drive::Stepper(Stepper::new(1.0))),
        connection: Connection::Clock { block: 2 },
        sensor: None,
        switches: Vec::new(),
        brake: None,
    };
    let axes = vec![
        Wiring::new(servo, analog(0), encoder(1_000)).with_switch(Switch::limit(
            turning_point,
            -4_000.0,
            false,
        )),
        Wiring::new(Plant::new(Drive::first_order(80_000.0, 0.01)), analog(1), encoder(5_000)),
        stepper,
    ];
    Machine { axes, inputs: Inputs::default() }
}

/// A bus with its drives and the controller's place on it.
struct Wire {
    network: Network,
    mailbox: Mailbox,
    drives: Vec<canopen::Node<Ld2000>>,
}

impl Wire {
    fn new(nodes: &[u8]) -> Self {
        Self {
            network: Network::new(Bus::new(500_000, Faults::NONE), nodes.len() + 1),
            mailbox: Mailbox::default(),
            drives: nodes.iter().map(|&node| Ld2000::node(NodeId::new(node).ok(), u32::from(node))).collect(),
        }
    }

    fn run(&mut self, end: Duration) {
        let mut nodes: Vec<&mut dyn Node> = vec![&mut self.mailbox];
        nodes.extend(self.drives.iter_mut().map(|drive| drive as &mut dyn Node));
        while self.network.step(&mut nodes, end) {}
    }
}

/// Appends to the recording, and plays it to the controller at once.
struct Recorder<'a> {
    replica: Replica<'a>,
    recording: Vec<u8>,
}

impl Recorder<'_> {
    fn put(&mut self, now: Duration, what: What<'_>, wires: &mut [Wire; 2]) -> Option<Outputs> {
        let record = Record { micros: u32::try_from(now.as_micros()).unwrap(), what };
        record.append(&mut self.recording).unwrap();
        self.replica.take(&record, |at, frame| wires[at].mailbox.to_send.push_back(frame))
    }
}

fn telegram(request: &Request<'_>) -> Vec<u8> {
    let mut wire = [0; MAX_WIRE];
    let len = request.encode(&mut wire).unwrap();
    wire[..len].to_vec()
}

/// What the workstation sends in this cycle, if anything, in pieces.
struct Workstation {
    random: Rand32,
    rest: Vec<u8>,
    changed: bool,
}

impl Workstation {
    fn next(&mut self, ms: u64) -> Vec<u8> {
        if self.rest.is_empty() {
            let random = &mut self.random;
            let request = match random.rand_range(0..9) {
                // A new V Work of axis 5 and the loader, while the axes move.
                0 if ms > 2_500 && !core::mem::replace(&mut self.changed, true) => {
                    self.rest = telegram(&Request::WriteParameter { index: 688, value: 500_000 });
                    Request::CallLoader
                }
                0 | 1 => Request::Failures,
                2 => Request::DescribeParameter { index: 600 + random.rand_range(0..300) as u16 },
                3..6 => Request::ReadParameter { index: random.rand_range(0..1_000) as u16 },
                6 => Request::ReadRam { bank: 12, offset: 0, count: 16 },
                7 => Request::DeviceType,
                _ => return Vec::new(),
            };
            self.rest.extend(telegram(&request));
            if self.random.rand_range(0..10) == 0 {
                // A byte that the line has damaged.
                let at = self.random.rand_range(0..self.rest.len() as u32) as usize;
                self.rest[at] ^= 1 << self.random.rand_range(0..8);
            }
        }
        let len = self.random.rand_range(1..9).min(self.rest.len() as u32) as usize;
        self.rest.drain(..len).collect()
    }
}

/// A recording, what the controller did in it, and the hash of what it put out.
pub(crate) fn record() -> (Vec<u8>, Counts, u64) {
    let (mut storage, mut ram) = super::memory();
    let mut recorder = Recorder { replica: Replica::new(&mut storage, &mut ram), recording: Vec::new() };
    let mut wires = [Wire::new(&[1, 2]), Wire::new(&[4])];
    for (index, value) in parameters() {
        let bytes = telegram(&Request::WriteParameter { index, value });
        recorder.put(Duration::ZERO, What::Serial { port: 1, bytes: &bytes }, &mut wires);
    }
    let load = telegram(&Request::CallLoader);
    recorder.put(Duration::ZERO, What::Serial { port: 1, bytes: &load }, &mut wires);
    let cycle = recorder.replica.cycle_time();
    assert_eq!(cycle, Duration::from_millis(6), "the loader has refused the parameters");

    let mut machine = machine();
    let mut workstation = Workstation { random: Rand32::new(6), rest: Vec::new(), changed: false };
    let (mut before, mut outputs) = (Inputs::default(), Outputs::default());
    let mut now = Duration::ZERO;
    while now < TIME {
        let ms = now.as_millis() as u64;
        let broken = wires[0].network.station(2).unwrap();
        wires[0].network.bus().plug(broken, ms < BREAK);
        let mut frames = Vec::new();
        for (at, wire) in wires.iter_mut().enumerate() {
            wire.run(now);
            frames.extend(wire.mailbox.received.drain(..).map(|(time, frame)| (time, at, frame)));
        }
        frames.sort_by_key(|&(time, at, _)| (time, at));
        for (time, at, frame) in frames {
            // The drives send data frames with identifiers of 11 bits only.
            let id = frame.standard_id().unwrap();
            recorder.put(time, What::Frame { bus: at as u8, id, data: frame.data() }, &mut wires);
        }
        let bytes = workstation.next(ms);
        if !bytes.is_empty() {
            recorder.put(now, What::Serial { port: 1, bytes: &bytes }, &mut wires);
        }
        let mut switches = [0; 4];
        for (block, bit, range) in SWITCHES {
            switches[usize::from(*block) - 1] |= u8::from(range.contains(&ms)) << bit;
        }
        machine.inputs.digital = DigitalInputs::new(switches);
        machine.inputs.analog[0] = (ms / 50 % 1_024) as u16;
        let mut inputs = machine.run(cycle.as_millis() as u32, &outputs);
        inputs.encoders[1].fault = FAULT.contains(&ms);
        let what = What::cycle(&before, &inputs);
        outputs = recorder.put(now, what, &mut wires).unwrap();
        before = inputs;
        now += cycle;
    }
    (recorder.recording, *recorder.replica.counts(), recorder.replica.hash())
}
