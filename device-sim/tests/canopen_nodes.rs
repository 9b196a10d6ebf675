//! Virtual nodes on the virtual bus, asked by an SDO client and by plain frames.

use core::time::Duration;

use canopen_master::ds402;
use canopen_master::sdo::{AbortCode, Channel, Client, Options, Outcome};
use device_sim::can::{Bus, Faults, Network};
use device_sim::canopen::{Address, FileNode, Ld2000, Node, RemoteIo};
use pdo::{Frame, NodeId};

const MS: Duration = Duration::from_millis(1);

/// The master's end: an SDO client, frames to send, and everything that was heard.
struct Tester {
    client: Client<Vec<u8>>,
    send: Vec<Frame>,
    heard: Vec<(Duration, Frame)>,
}

impl Tester {
    fn new(node: u8) -> Self {
        let channel = Channel::default_of(NodeId::new(node).unwrap());
        Self { client: Client::new(channel), send: Vec::new(), heard: Vec::new() }
    }
}

impl device_sim::can::Node for Tester {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        let _ = self.client.handle_frame(now, frame);
        self.heard.push((now, *frame));
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.client.handle_timeout(now);
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        if self.send.is_empty() { self.client.poll_transmit(now) } else { Some(self.send.remove(0)) }
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.client.poll_timeout()
    }
}

struct Bench<D> {
    network: Network,
    tester: Tester,
    node: Node<D>,
}

impl<D: device_sim::canopen::Device> Bench<D> {
    fn new(node: Node<D>, faults: Faults) -> Self {
        let id = node.node().map_or(127, NodeId::raw);
        let network = Network::new(Bus::new(500_000, faults), 2);
        let mut bench = Self { network, tester: Tester::new(id), node };
        bench.run(5 * MS);
        bench
    }

    fn run(&mut self, time: Duration) {
        let limit = self.network.now() + time;
        self.network.run_until(&mut [&mut self.tester, &mut self.node], limit, |_| false);
    }

    fn send(&mut self, frame: Frame) {
        self.tester.send.push(frame);
        self.run(2 * MS);
    }

    /// Identifiers and data of what was heard since the last call.
    fn heard(&mut self) -> Vec<String> {
        self.tester.heard.drain(..).map(|(_, frame)| frame.to_string()).collect()
    }

    fn transfer(&mut self) -> (Outcome, Vec<u8>) {
        let limit = self.network.now() + Duration::from_secs(60);
        loop {
            if let Some(finished) = self.tester.client.poll_event() {
                return (finished.outcome, finished.buffer);
            }
            assert!(self.network.step(&mut [&mut self.tester, &mut self.node], limit), "no outcome");
        }
    }

    fn read(&mut self, index: u16, sub: u8, options: &Options) -> Result<Vec<u8>, Outcome> {
        self.tester.client.upload(Address::new(index, sub), Vec::new(), options).unwrap();
        match self.transfer() {
            (Outcome::Done(_), data) => Ok(data),
            (outcome, _) => Err(outcome),
        }
    }

    fn write(&mut self, index: u16, sub: u8, data: &[u8], options: &Options) -> Result<(), Outcome> {
        self.tester.client.download(Address::new(index, sub), data.to_vec(), options).unwrap();
        match self.transfer() {
            (Outcome::Done(_), _) => Ok(()),
            (outcome, _) => Err(outcome),
        }
    }

    fn put(&mut self, index: u16, sub: u8, data: &[u8]) {
        self.write(index, sub, data, &Options::default()).unwrap();
    }

    fn get(&mut self, index: u16, sub: u8) -> Vec<u8> {
        self.read(index, sub, &Options::default()).unwrap()
    }
}

fn id(raw: u8) -> Option<NodeId> {
    Some(NodeId::new(raw).unwrap())
}

const START: Frame = Frame::standard(0x000, [1, 0]);
const SYNC: Frame = Frame::standard(0x080, []);

#[test]
fn boot_nmt_and_error_control() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    assert_eq!(bench.heard(), ["705#00"]);
    let guard = Frame::remote_frame(embedded_can::StandardId::new(0x705).unwrap(), 1).unwrap();
    bench.send(guard);
    bench.send(guard);
    assert_eq!(bench.heard(), ["705#7F", "705#FF"]);
    bench.put(0x1017, 0, &100u16.to_le_bytes());
    bench.heard();
    bench.run(250 * MS);
    assert_eq!(bench.heard(), ["705#7F", "705#7F"]);
    // Stopped: no SDO.
    bench.send(Frame::standard(0x000, [2, 5]));
    let silent = bench.read(0x1000, 0, &Options::new(20 * MS));
    assert_eq!(silent, Err(Outcome::TimedOut));
    bench.heard();
    // Reset communication: the heartbeat time is gone.
    bench.send(Frame::standard(0x000, [0x82, 5]));
    bench.run(300 * MS);
    assert_eq!(bench.heard(), ["705#00"]);
    assert_eq!(bench.get(0x1017, 0), [0, 0]);
}

#[test]
fn io_node_speaks_through_its_pdos() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    assert_eq!(bench.get(0x1000, 0), 0x000F_0191u32.to_le_bytes());
    bench.heard();
    bench.send(START);
    // Digital inputs at once, analogue ones only when 6423h allows it.
    assert_eq!(bench.heard(), ["185#00"]);
    let now = bench.network.now();
    bench.node.with_device(now, |io, context| {
        io.set_inputs(0xA5);
        io.set_analogue(2, -2);
        device_sim::canopen::Device::update(io, context);
    });
    bench.run(2 * MS);
    assert_eq!(bench.heard(), ["185#A5"]);
    bench.put(0x6423, 0, &[1]);
    bench.run(2 * MS);
    assert!(bench.heard().contains(&"285#00000000FEFF0000".to_owned()));
    bench.send(Frame::standard(0x205, [0x3C]));
    bench.send(Frame::standard(0x305, [1, 0, 2, 0, 3, 0, 0xFC, 0xFF]));
    assert_eq!(bench.node.device().outputs(), 0x3C);
    assert_eq!(bench.get(0x6411, 4), [0xFC, 0xFF]);
    bench.heard();
    // Too short: reported and not acted on; too long: acted on and reported once (CiA 301, 7.2.2.5).
    bench.send(Frame::standard(0x305, [9, 9]));
    assert_eq!(bench.heard(), ["085#108211011608 0200".replace(' ', "")]);
    assert_eq!(bench.get(0x6411, 1), [1, 0]);
    bench.heard();
    bench.send(Frame::standard(0x205, [0xFF, 1]));
    bench.send(Frame::standard(0x205, [0xF0, 1]));
    assert_eq!(bench.heard(), ["085#2082110016010200"]);
    assert_eq!(bench.node.device().outputs(), 0xF0);
    // Stopped: the error value shows.
    bench.send(Frame::standard(0x000, [2, 5]));
    assert_eq!(bench.node.device().outputs(), 0);
}

#[test]
fn a_mapping_is_set_up_in_the_standard_order_and_not_otherwise() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    let options = Options::default();
    let abort = |result: Result<(), Outcome>, code| assert_eq!(result, Err(Outcome::Aborted(code)));
    let entry = |index: u32, sub: u32, bits: u32| (index << 16 | sub << 8 | bits).to_le_bytes();
    abort(bench.write(0x1A00, 0, &[0], &options), AbortCode::UNSUPPORTED_ACCESS);
    abort(bench.write(0x1800, 1, &0x1A5u32.to_le_bytes(), &options), AbortCode::INVALID_VALUE);
    bench.put(0x1800, 1, &0x8000_0185u32.to_le_bytes());
    abort(bench.write(0x1A00, 1, &entry(0x6401, 2, 16), &options), AbortCode::UNSUPPORTED_ACCESS);
    bench.put(0x1A00, 0, &[0]);
    abort(bench.write(0x1A00, 1, &entry(0x6401, 9, 16), &options), AbortCode::NO_OBJECT);
    abort(bench.write(0x1A00, 1, &entry(0x7000, 1, 16), &options), AbortCode::NO_OBJECT);
    abort(bench.write(0x1A00, 1, &entry(0x1008, 0, 32), &options), AbortCode::NOT_MAPPABLE);
    abort(bench.write(0x1A00, 1, &entry(0x6401, 2, 8), &options), AbortCode::NOT_MAPPABLE);
    for sub in 1..=5 {
        bench.put(0x1A00, sub, &entry(0x6401, 2, 16));
    }
    abort(bench.write(0x1A00, 0, &[5], &options), AbortCode::PDO_LENGTH);
    bench.put(0x1A00, 1, &entry(0x6000, 1, 8));
    bench.put(0x1A00, 0, &[2]);
    abort(bench.write(0x1800, 1, &0x601u32.to_le_bytes(), &options), AbortCode::INVALID_VALUE);
    bench.put(0x1800, 2, &[2]);
    bench.put(0x1800, 1, &0x1A5u32.to_le_bytes());
    bench.heard();
    bench.send(START);
    for _ in 0..4 {
        bench.send(SYNC);
    }
    // Every second SYNC.
    assert_eq!(bench.heard(), ["1A5#000000", "1A5#000000"]);
}

#[test]
fn the_store_takes_every_length_in_every_mode() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    for options in [Options::default(), Options::block(500 * MS)] {
        for len in [1, 4, 5, 7, 8, 14, 127 * 7, 127 * 7 + 1, 10_000, 65_536] {
            let data: Vec<u8> = (0..len).map(|i: usize| (i * 7 + len) as u8).collect();
            bench.write(0x2000, 1, &data, &options).unwrap();
            assert!(bench.read(0x2000, 1, &options).unwrap() == data, "{len} bytes");
        }
        let long = bench.write(0x2000, 1, &[0; 65_537], &options);
        assert_eq!(long, Err(Outcome::Aborted(AbortCode::TOO_LONG)));
    }
    assert!(bench.get(0x100A, 0).len() > 4);
}

#[test]
fn parameters_are_stored_and_restored() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    bench.put(0x6202, 1, &[0x0F]);
    let refused = bench.write(0x1010, 1, b"none", &Options::default());
    assert_eq!(refused, Err(Outcome::Aborted(AbortCode::CANNOT_STORE)));
    bench.put(0x1010, 1, b"save");
    bench.put(0x6202, 1, &[0xFF]);
    bench.send(Frame::standard(0x000, [0x81, 5]));
    assert_eq!(bench.get(0x6202, 1), [0x0F]);
    bench.put(0x1011, 1, b"load");
    assert_eq!(bench.get(0x6202, 1), [0x0F]);
    bench.send(Frame::standard(0x000, [0x81, 5]));
    assert_eq!(bench.get(0x6202, 1), [0]);
}

/// `domain-notes.md` item 2: frames as in the drive's manual, p. 116.
#[test]
fn the_drive_follows_its_set_value() {
    let mut bench = Bench::new(Ld2000::node(id(1), 1), Faults::NONE);
    assert_eq!(bench.get(0x1000, 0), 0x0002_0192u32.to_le_bytes());
    assert_eq!(bench.get(0x1008, 0), b"SD03");
    assert_eq!(bench.get(0x35B4, 1), [0; 4]);
    bench.put(0x2600, 0, &[22]);
    bench.put(0x2A00, 0, &[22]);
    let refused = bench.write(0x2A00, 0, &[99], &Options::default());
    assert_eq!(refused, Err(Outcome::Aborted(AbortCode::INVALID_VALUE)));
    bench.send(START);
    bench.heard();
    // 3000 rpm is 419430 (p. 42).
    let order = |control: u8, speed: i32| {
        let [a, b, c, d] = speed.to_le_bytes();
        Frame::standard(0x201, [control, 0, a, b, c, d])
    };
    for control in [0x06, 0x07, 0x0F] {
        bench.send(order(control, 0));
    }
    assert_eq!(bench.node.device().state(), ds402::State::OperationEnabled);
    bench.send(order(0x0F, 419_430));
    bench.run(Duration::from_secs(1));
    let (start, speed) = bench.node.device().motion();
    assert_eq!(speed, 419_430.0);
    bench.run(Duration::from_secs(1));
    // 50 turns a second of 2^20 increments, less what 419430 is short of 3000 rpm.
    let increments = bench.node.device().motion().0 - start;
    assert!((increments - 419_430.0 * 125.0).abs() < 419_430.0 * 125.0 * 0.05, "{increments}");
    bench.heard();
    bench.send(SYNC);
    let answer = bench.tester.heard.iter().find(|(_, frame)| frame.standard_id() == Some(0x181)).unwrap().1;
    let &[low, high, p0, p1, p2, s0, s1, s2] = answer.data() else { panic!("{answer}") };
    let status = ds402::StatusWord(u16::from_le_bytes([low, high]));
    assert_eq!(status.state(), Some(ds402::State::OperationEnabled));
    assert_eq!(i32::from_le_bytes([s0, s1, s2, 0]), 419_430);
    let shown = f64::from(u32::from_le_bytes([p0, p1, p2, 0]));
    let real = bench.node.device().motion().0.rem_euclid(f64::from(1 << 24));
    assert!((real - shown).abs() < 419_430.0 * 125.0 * 0.003, "{shown} {real}");
    // Quick stop: it stands, and is switch on disabled.
    bench.send(order(0x02, 419_430));
    bench.run(Duration::from_secs(1));
    assert_eq!(bench.node.device().motion().1, 0.0);
    assert_eq!(bench.node.device().state(), ds402::State::SwitchOnDisabled);
}

#[test]
fn the_drive_stops_without_its_master() {
    let mut bench = Bench::new(Ld2000::node(id(1), 1), Faults::NONE);
    bench.put(0x100C, 0, &50u16.to_le_bytes());
    bench.put(0x100D, 0, &[2]);
    bench.put(0x6060, 0, &[3]);
    bench.put(0x60FF, 0, &100_000i32.to_le_bytes());
    for control in [6u16, 7, 15] {
        bench.put(0x6040, 0, &control.to_le_bytes());
    }
    let guard = Frame::remote_frame(embedded_can::StandardId::new(0x701).unwrap(), 1).unwrap();
    for _ in 0..10 {
        bench.send(guard);
        bench.run(48 * MS);
    }
    assert_eq!(bench.node.device().motion().1, 100_000.0);
    bench.heard();
    bench.run(Duration::from_secs(1));
    assert_eq!(bench.node.device().motion().1, 0.0);
    // 8130h: communication, then the drive's own warning n04.
    assert_eq!(bench.heard(), ["081#3081110000000000", "081#3081110504000000"]);
    // The master is back: motion stays blocked until bit 11 goes to 1.
    bench.send(guard);
    bench.run(90 * MS);
    assert_eq!(bench.node.device().motion().1, 0.0);
    bench.put(0x6040, 0, &0x080Fu16.to_le_bytes());
    bench.send(guard);
    bench.run(90 * MS);
    assert!(bench.node.device().motion().1 > 0.0);
}

#[test]
fn a_fault_is_told_and_reset() {
    let mut bench = Bench::new(Ld2000::node(id(1), 1), Faults::NONE);
    bench.heard();
    let now = bench.network.now();
    bench.node.with_device(now, |drive, context| drive.fail(context, device_sim::canopen::Fault::Motor));
    bench.run(10 * MS);
    assert_eq!(bench.heard(), ["081#1043090100000000"]);
    assert_eq!(bench.node.device().state(), ds402::State::Fault);
    assert_eq!(bench.get(0x1003, 0), [1]);
    assert_eq!(bench.get(0x1003, 1), 0x0001_4310u32.to_le_bytes());
    bench.heard();
    bench.put(0x6040, 0, &0x80u16.to_le_bytes());
    bench.run(2 * MS);
    assert!(bench.heard().contains(&"081#0000000000000000".to_owned()));
    assert_eq!(bench.node.device().state(), ds402::State::SwitchOnDisabled);
}

/// Fastscan and node ID by hand: CiA 305.
#[test]
fn a_node_without_address_gets_one() {
    let mut bench = Bench::new(RemoteIo::node(None, 0x1234, false), Faults::NONE);
    assert_eq!(bench.heard(), [""; 0]);
    bench.send(Frame::standard(0x7E5, [0x51, 0, 0, 0, 0, 0x80, 0, 0]));
    assert_eq!(bench.heard(), ["7E4#4F00000000000000"]);
    bench.send(Frame::standard(0x7E5, [0x04, 1, 0, 0, 0, 0, 0, 0]));
    bench.send(Frame::standard(0x7E5, [0x11, 9, 0, 0, 0, 0, 0, 0]));
    bench.send(Frame::standard(0x7E5, [0x17, 0, 0, 0, 0, 0, 0, 0]));
    assert_eq!(bench.heard(), ["7E4#1100000000000000", "7E4#1700000000000000"]);
    bench.send(Frame::standard(0x7E5, [0x04, 0, 0, 0, 0, 0, 0, 0]));
    assert_eq!(bench.heard(), ["709#00"]);
    assert_eq!(bench.node.node(), id(9));
}

#[test]
fn a_node_from_a_device_file() {
    let file = "
[DeviceInfo]
VendorName=Nobody
VendorNumber=7
ProductName=Thing
ProductNumber=8
RevisionNumber=9
LSS_Supported=1
[MandatoryObjects]
SupportedObjects=1
1=0x1000
[1000]
ParameterName=Device type
ObjectType=0x7
DataType=0x0007
AccessType=ro
DefaultValue=0x12345678
PDOMapping=0
[ManufacturerObjects]
SupportedObjects=2
1=0x3000
2=0x3001
[3000]
ParameterName=Speed
ObjectType=0x7
DataType=0x0003
AccessType=rww
DefaultValue=-7
LowLimit=-100
HighLimit=100
PDOMapping=1
[3001]
ParameterName=Name
ObjectType=0x7
DataType=0x0009
AccessType=rw
DefaultValue=hello
PDOMapping=0
";
    let node = FileNode::node(file.as_bytes(), id(42), 5).unwrap();
    let mut bench = Bench::new(node, Faults::NONE);
    assert_eq!(bench.heard(), ["72A#00"]);
    assert_eq!(bench.get(0x1000, 0), 0x1234_5678u32.to_le_bytes());
    assert_eq!(bench.get(0x1008, 0), b"Thing");
    assert_eq!(bench.get(0x1018, 1), 7u32.to_le_bytes());
    assert_eq!(bench.get(0x1018, 4), 5u32.to_le_bytes());
    assert_eq!(bench.get(0x3000, 0), (-7i16).to_le_bytes());
    let high = bench.write(0x3000, 0, &101i16.to_le_bytes(), &Options::default());
    assert_eq!(high, Err(Outcome::Aborted(AbortCode::TOO_HIGH)));
    assert_eq!(bench.get(0x3001, 0), b"hello");
    bench.put(0x3001, 0, b"a longer name");
    assert_eq!(bench.get(0x3001, 0), b"a longer name");
    bench.put(0x2000, 1, &[1; 100]);
    assert_eq!(bench.get(0x2000, 1), [1; 100]);
}

/// Single frames lost, doubled, delayed, destroyed: every transfer ends right or with a named error, and
/// afterwards the node answers as before.
#[test]
fn transfers_under_faults_are_right_or_fail() {
    for seed in 0..20 {
        let faults = Faults {
            seed,
            wire_error: 30,
            lose: 150,
            duplicate: 150,
            delay: 200,
            longest_delay: 5 * MS,
            ..Faults::NONE
        };
        let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), faults);
        let mut done = 0;
        for round in 0..20u8 {
            let options = if round % 2 == 0 { Options::new(50 * MS) } else { Options::block(50 * MS) };
            let data: Vec<u8> = (0..200).map(|i: u8| i.wrapping_mul(round | 1)).collect();
            if bench.write(0x2000, 1, &data, &options).is_ok()
                && let Ok(read) = bench.read(0x2000, 1, &options)
            {
                assert_eq!(read, data, "seed {seed}, round {round}");
                done += 1;
            }
        }
        assert!(done > 0, "seed {seed}: nothing went through");
        bench.network.bus().set_faults(Faults::NONE);
        bench.run(Duration::from_secs(2));
        assert_eq!(bench.get(0x1000, 0), 0x000F_0191u32.to_le_bytes(), "seed {seed}");
    }
}
