//! Every error that a LinMot drive or its wire can bring, by its name, over every carrier: the links of
//! motion-io against the virtual drive, on wires that lose, repeat and falsify answers.

use core::time::Duration;
use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard};

use device_sim::can::Node;
use device_sim::linmot::{CanDrive, Times, VirtualDrive, sg5};
use linmot::client::{self, Client};
use linmot::code::{ParameterType, Status};
use linmot::curve::InfoBlock;
use linmot::drive::Parameter;
use linmot::link::{Fault, Link, LinkExt};
use linmot::linrs::{Checksum, Config, Slave};
use linmot::module::TPDO;
use linmot::request::{Access, List, Memory, Reply, Request, Value};
use linmot::table::Entry;
use linmot::upid::{Upid, Usage};
use motion_io::can::{CanPort, Event};
use motion_io::linmot::{LinRsLink, LinkError, PdoLink, SdoLink};
use motion_io::port::Port;
use pdo::{Frame, NodeId, cob};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Carrier {
    Sdo,
    Pdo,
    LinRs,
}

const CARRIERS: [Carrier; 3] = [Carrier::Sdo, Carrier::Pdo, Carrier::LinRs];
const RESTART: Duration = Duration::from_secs(1);
const TIMES: Times =
    Times { restart: RESTART, start: Duration::from_millis(300), flash: Duration::from_millis(400) };
/// Answers that do not come are given up after this time.
const ANSWER: Duration = Duration::from_millis(200);

#[expect(clippy::large_enum_variant, reason = "one a test")]
enum Station {
    Can(CanDrive),
    LinRs { slave: Slave, drive: VirtualDrive },
}

/// The drive and the wire to it, on virtual time.
struct World {
    station: Station,
    now: Duration,
    frames: VecDeque<Frame>,
    bytes: VecDeque<u8>,
    /// So many answers are lost.
    lost: usize,
    /// Everything arrives twice, in both directions.
    twice: bool,
    /// Answers are altered.
    falsified: bool,
}

impl World {
    fn drive(&mut self) -> &mut VirtualDrive {
        match &mut self.station {
            Station::Can(node) => node.drive_mut(),
            Station::LinRs { drive, .. } => drive,
        }
    }

    fn wait(&mut self, time: Duration) {
        self.now += time;
        match &mut self.station {
            Station::Can(node) => node.handle_timeout(self.now),
            Station::LinRs { slave, drive } => slave.handle_timeout(self.now, drive),
        }
        self.collect();
    }

    fn collect(&mut self) {
        let answer = |id: u16| id & 0x780 == cob::SDO_RESPONSE || id & 0x780 == TPDO;
        match &mut self.station {
            Station::Can(node) => {
                while let Some(mut frame) = node.poll_transmit(self.now) {
                    if frame.standard_id().is_some_and(answer) {
                        if self.lost > 0 {
                            self.lost -= 1;
                            continue;
                        }
                        if self.falsified {
                            // The count of a module's answer, the sub-index of an SDO's.
                            let mut data = <[u8; 8]>::try_from(frame.data()).unwrap();
                            let at = if frame.standard_id().unwrap() & 0x780 == TPDO { 0 } else { 3 };
                            data[at] ^= 0x06;
                            frame = Frame::standard(frame.standard_id().unwrap(), data);
                        }
                    }
                    self.frames.push_back(frame);
                    if self.twice {
                        self.frames.push_back(frame);
                    }
                }
            }
            Station::LinRs { slave, .. } => {
                while let Some(answer) = slave.poll_transmit(self.now) {
                    if self.lost > 0 {
                        self.lost -= 1;
                        continue;
                    }
                    let mut answer = answer.to_vec();
                    if self.falsified {
                        answer[4] ^= 0x01;
                    }
                    self.bytes.extend(&answer);
                }
            }
        }
    }
}

struct Wire(Arc<Mutex<World>>);

impl CanPort for Wire {
    fn send(&mut self, frame: &Frame) -> io::Result<()> {
        let mut world = self.0.lock().unwrap();
        for _ in 0..if world.twice { 2 } else { 1 } {
            world.now += Duration::from_micros(250);
            let now = world.now;
            let Station::Can(node) = &mut world.station else { panic!("no CAN") };
            node.handle_frame(now, frame);
            world.collect();
        }
        Ok(())
    }

    fn receive(&mut self, timeout: Duration) -> io::Result<Option<Event>> {
        let mut world = self.0.lock().unwrap();
        if world.frames.is_empty() && !timeout.is_zero() {
            world.wait(timeout);
        }
        Ok(world.frames.pop_front().map(Event::Frame))
    }

    fn now(&self) -> Duration {
        self.0.lock().unwrap().now
    }
}

impl Port for Wire {
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let mut world = self.0.lock().unwrap();
        if world.bytes.is_empty() {
            world.wait(timeout);
        }
        let len = world.bytes.len().min(buffer.len());
        buffer.iter_mut().zip(world.bytes.drain(..len)).for_each(|(room, byte)| *room = byte);
        Ok(len)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut world = self.0.lock().unwrap();
        world.now += Duration::from_millis(10);
        let now = world.now;
        let Station::LinRs { slave, drive } = &mut world.station else { panic!("no line") };
        slave.handle_bytes(now, bytes, drive);
        world.collect();
        Ok(())
    }

    fn now(&self) -> Duration {
        self.0.lock().unwrap().now
    }
}

/// Any link, sized.
struct AnyLink(Box<dyn Link<Error = LinkError>>);

impl Link for AnyLink {
    type Error = LinkError;

    fn call(&mut self, request: &Request) -> Result<Reply, LinkError> {
        self.0.call(request)
    }
}

struct Bench {
    link: AnyLink,
    world: Arc<Mutex<World>>,
}

impl Bench {
    fn new(carrier: Carrier) -> Self {
        Self::with(carrier, sg5())
    }

    fn with(carrier: Carrier, tree: Vec<Parameter>) -> Self {
        let drive = VirtualDrive::new(tree, TIMES);
        let node = NodeId::new(1).unwrap();
        let station = match carrier {
            Carrier::LinRs => Station::LinRs { slave: Slave::new(1, Checksum::None), drive },
            _ => Station::Can(CanDrive::new(drive, Some(node), 1)),
        };
        let (frames, bytes) = (VecDeque::new(), VecDeque::new());
        let mut world =
            World { station, now: Duration::ZERO, frames, bytes, lost: 0, twice: false, falsified: false };
        // The drive has booted.
        world.wait(Duration::from_millis(1));
        let world = Arc::new(Mutex::new(world));
        let wire = Box::new(Wire(world.clone()));
        let link: Box<dyn Link<Error = LinkError>> = match carrier {
            Carrier::Sdo => Box::new(SdoLink::new(wire, node, Some(ANSWER), 1)),
            Carrier::Pdo => {
                let config = client::Config { echo: ANSWER, ..client::Config::default() };
                Box::new(PdoLink::new(wire, node, Client::new(config)))
            }
            Carrier::LinRs => {
                let config = Config { answer: ANSWER, ..Config::new(1) };
                Box::new(LinRsLink::new(wire, config, 1))
            }
        };
        Self { link: AnyLink(link), world }
    }

    fn world(&self) -> MutexGuard<'_, World> {
        self.world.lock().unwrap()
    }

    /// Non-volatile memory, and how often it was written.
    fn kept(&self) -> (Vec<u8>, u64) {
        let mut world = self.world();
        let drive = world.drive();
        (drive.image(), drive.writes())
    }

    /// The command is refused with this status, and the error names it and what it is about.
    #[track_caller]
    fn refuses(&mut self, request: Request, status: Status, words: &str) {
        let fault = self.link.ask(request).unwrap_err();
        let text = fault.to_string();
        let Fault::Refused { reply, .. } = fault else { panic!("{request:?}: {text}") };
        assert_eq!(reply.status, status, "{request:?}: {text}");
        assert!(text.contains(words), "{text}");
        assert!(text.contains(status.text().unwrap()), "{text}");
    }
}

fn info(setpoints: u16) -> InfoBlock {
    InfoBlock::position_over_time(5, "five", 20_000, setpoints).unwrap()
}

fn add(link: &mut AnyLink, setpoints: &[i32]) {
    let info = info(setpoints.len() as u16);
    link.start_curve(Access::Add, &info).unwrap();
    for (number, setpoint) in (1..).zip(setpoints) {
        link.write_setpoint(Access::Add, &info, number, *setpoint).unwrap();
    }
}

#[test]
fn parameter_errors() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        let before = bench.world().drive().image();
        let write = |memory, upid, value| Request::Write { memory, upid: Upid(upid), value };
        for value in [Value::Rom, Value::Ram, Value::Minimum, Value::Maximum, Value::Default] {
            bench.refuses(Request::Read { value, upid: Upid(0x1111) }, Status::UPID, "UPID 1111h");
        }
        for memory in [Memory::Rom, Memory::Ram, Memory::Both] {
            bench.refuses(write(memory, 0x1111, 0), Status::UPID, "UPID 1111h");
            // Read-only.
            bench.refuses(write(memory, 0x2136, 0), Status::USAGE, "UPID 2136h");
        }
        // Not live: only its ROM value can be written.
        bench.refuses(write(Memory::Ram, 0x119E, 1), Status::USAGE, "UPID 119Eh");
        bench.refuses(write(Memory::Both, 0x119E, 1), Status::USAGE, "UPID 119Eh");
        bench.refuses(write(Memory::Rom, 0x119E, 32_001), Status::RANGE, "UPID 119Eh");
        bench.refuses(write(Memory::Rom, 0x3001, -101i32 as u32), Status::RANGE, "UPID 3001h");
        bench.refuses(write(Memory::Rom, 0x03F2, 0), Status::TYPE, "UPID 03F2h");
        assert_eq!(bench.world().drive().image(), before, "{carrier:?}: a refused command wrote something");
        assert_eq!(bench.link.read(Upid(0x119E), Value::Ram).unwrap(), 8000);
    }
}

/// A drive filters out the bits that do not belong to a parameter's type (manual B 2.5).
#[test]
fn a_value_that_the_drive_would_cut_off_is_not_written() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        let before = bench.kept();
        for memory in [Memory::Rom, Memory::Ram, Memory::Both] {
            for (upid, value, words) in [
                (0x13A2, 99_999, "UPID 13A2h: 99999 is out of range, 0 to 65535 expected"),
                (0x13A2, 70_000, "UPID 13A2h: 70000 is out of range, 0 to 65535 expected"),
                (0x13A2, -3i32 as u32, "UPID 13A2h: 4294967293 is out of range, 0 to 65535 expected"),
                (0x13A0, -32_001i32 as u32, "UPID 13A0h: -32001 is out of range, -32000 to 32000 expected"),
                (0x13A0, 0x1_FFFB, "UPID 13A0h: 131067 is out of range, -32000 to 32000 expected"),
                (0x3001, 0xFFFB, "UPID 3001h: 65531 is out of range, -100 to 100 expected"),
                (0x20A1, 3, "UPID 20A1h: 3 is out of range, 0 to 1 expected"),
                (0x20A0, 0x101, "UPID 20A0h: 257 is out of range, 1 to 127 expected"),
            ] {
                let fault = bench.link.write(Upid(upid), memory, value).unwrap_err();
                assert!(matches!(fault, Fault::Range { .. }), "{fault}");
                assert_eq!(fault.to_string(), words);
            }
        }
        let after = bench.kept();
        assert_eq!(after, before, "{carrier:?}: something was written");
        assert_eq!(bench.link.read(Upid(0x13A2), Value::Ram).unwrap(), 10);
        // A negative number in either form.
        for raw in [-5i32 as u32, 0xFFFB] {
            bench.link.write(Upid(0x13A0), Memory::Both, raw).unwrap();
            assert_eq!(bench.link.read(Upid(0x13A0), Value::Ram).unwrap(), 0xFFFB);
            bench.link.write(Upid(0x13A0), Memory::Both, 0).unwrap();
        }
    }
}

/// Negative floats descend where their bits ascend; the drive tells no type.
#[test]
fn floats_and_ranges_below_zero_are_written_as_what_they_are() {
    let bits = f32::to_bits;
    for carrier in CARRIERS {
        let mut tree = sg5();
        let like = |upid, kind, minimum, maximum, default| {
            let usage = Usage::RAM_READ | Usage::ROM_READ | Usage::ROM_WRITE;
            Parameter { upid: Upid(upid), kind, usage, minimum, maximum, default }
        };
        tree.push(like(0x3010, ParameterType::FLOAT, bits(-100.0), bits(100.0), bits(0.0)));
        tree.push(like(0x3011, ParameterType::S16, -100i16 as u16 as u32, -1i16 as u16 as u32, 0xFFFF));
        let mut bench = Bench::with(carrier, tree);
        for value in [-1.0, -0.25, -100.0, 100.0, 0.0] {
            bench.link.write(Upid(0x3010), Memory::Rom, bits(value)).unwrap();
            assert_eq!(bench.link.read(Upid(0x3010), Value::Rom).unwrap(), bits(value), "{carrier:?}");
        }
        for (upid, raw, words) in [
            (0x3010, bits(-100.5), "UPID 3010h: -100.5 is out of range, -100 to 100 expected"),
            (0x3010, bits(f32::NAN), "UPID 3010h: NaN is out of range, -100 to 100 expected"),
            (0x3011, 0, "UPID 3011h: 0 is out of range, -100 to -1 expected"),
            (0x3011, 0xFF00, "UPID 3011h: -256 is out of range, -100 to -1 expected"),
        ] {
            let fault = bench.link.write(Upid(upid), Memory::Rom, raw).unwrap_err();
            assert_eq!(fault.to_string(), words, "{carrier:?}");
            // The drive says the same of it.
            bench.refuses(
                Request::Write { memory: Memory::Rom, upid: Upid(upid), value: raw },
                Status::RANGE,
                "write ROM value",
            );
        }
        bench.link.write(Upid(0x3011), Memory::Rom, -5i32 as u32).unwrap();
        assert_eq!(bench.link.read(Upid(0x3011), Value::Rom).unwrap(), 0xFFFB);
    }
}

/// A drive whose bounds are wider than the type that it keeps.
#[test]
fn another_value_than_was_written_is_named() {
    for carrier in CARRIERS {
        let mut tree = sg5();
        for parameter in tree.iter_mut().filter(|parameter| parameter.upid == Upid(0x13A2)) {
            parameter.maximum = u32::MAX;
        }
        for (memory, name) in [(Memory::Rom, "ROM"), (Memory::Ram, "RAM"), (Memory::Both, "RAM")] {
            let mut bench = Bench::with(carrier, tree.clone());
            let fault = bench.link.write(Upid(0x13A2), memory, 99_999).unwrap_err();
            let words = format!("UPID 13A2h: 99999 was written, but the {name} value is 34463");
            assert_eq!(fault.to_string(), words, "{carrier:?}");
            assert!(matches!(fault, Fault::ReadBack { .. }));
        }
    }
}

#[test]
fn texts_and_curves_that_would_be_cut_off_are_not_written() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        let before = bench.world().drive().image();
        for text in [&b"123456789012345678901234567890123"[..], b"X\0Y"] {
            let fault = bench.link.write_text(Upid::USER_COMMENT, Memory::Rom, text).unwrap_err();
            assert!(matches!(fault, Fault::Text { len, .. } if len == text.len()), "{fault}");
        }
        // Not live: refused with the first stringlet.
        let fault = bench.link.write_text(Upid::USER_COMMENT, Memory::Ram, b"X Axis Left").unwrap_err();
        assert!(fault.to_string().contains("UPID 03F3h: write RAM value"), "{fault}");
        // So many setpoints have no size of 16 bits.
        let mut long = info(2);
        long.setpoints = 16_385;
        let fault = bench.link.start_curve(Access::Add, &long).unwrap_err();
        assert_eq!(fault.to_string(), "curve 5: 16385 setpoints, 2 to 16383 expected");
        assert_eq!(bench.world().drive().image(), before, "{carrier:?}");
        assert_eq!(bench.link.curve_info(5).unwrap(), None);
        let longest = b"12345678901234567890123456789012";
        bench.link.write_text(Upid::USER_COMMENT, Memory::Rom, longest).unwrap();
    }
}

/// Object 2000h + UPID ends at FFFFh; what lies above must not become another object's index.
#[test]
fn a_upid_without_an_index_is_not_carried() {
    let mut bench = Bench::new(Carrier::Sdo);
    for upid in [0xE000, 0xF017, 0xFFFF] {
        let fault =
            bench.link.ask(Request::Write { memory: Memory::Rom, upid: Upid(upid), value: 1 }).unwrap_err();
        assert!(matches!(fault, Fault::Carrier(LinkError::NotCarried(_))), "{fault}");
        let fault = bench.link.read(Upid(upid), Value::Rom).unwrap_err();
        assert!(matches!(fault, Fault::Carrier(LinkError::NotCarried(_))), "{fault}");
    }
}

#[test]
fn curve_errors() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        let start = |access, data| Request::StartCurve { access, curve: 5, info: 70, data };
        bench.refuses(start(Access::Get, 0), Status::DEFINED, "curve 5: start getting curve");
        bench.refuses(start(Access::Modify, 8), Status::DEFINED, "curve 5: start modifying curve");
        bench.refuses(start(Access::Add, 4), Status::SIZE, "curve 5");
        bench.refuses(start(Access::Add, 10), Status::SIZE, "curve 5");
        add(&mut bench.link, &[0, 7]);
        // The block is finished.
        let data = Request::CurveData { access: Access::Add, curve: 5, value: 9 };
        bench.refuses(data, Status::ODD_ADDRESS, "curve 5: add curve data");
        let word = Request::CurveInfo { access: Access::Add, curve: 5, value: 9 };
        bench.refuses(word, Status::ODD_ADDRESS, "curve 5: add curve info block");
        // The curve exists.
        bench.refuses(start(Access::Add, 8), Status::DEFINED, "curve 5: start adding curve");
        bench.refuses(start(Access::Modify, 12), Status::SIZE, "curve 5");
        assert_eq!(bench.world().drive().curve_in_ram(5).unwrap().data, [0, 7], "{carrier:?}");
        let read = bench.link.curve_info(5).unwrap().unwrap();
        assert_eq!(read, info(2));
        assert_eq!([1, 2].map(|number| bench.link.read_setpoint(&read, number).unwrap()), [0, 7]);
        let data = Request::CurveData { access: Access::Get, curve: 5, value: 0 };
        bench.refuses(data, Status::ODD_ADDRESS, "block already finished");
        // Flash is written only while the software is stopped.
        bench.refuses(Request::SaveCurves, Status::NOT_STOPPED, "save all curves");
        bench.link.ask(Request::Stop).unwrap();
        bench.link.ask(Request::SaveCurves).unwrap();
        bench.link.ask(Request::Start).unwrap();
    }
}

#[test]
fn command_table_errors() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        bench.refuses(Request::GetEntry { entry: 9 }, Status::DEFINED, "entry 9");
        bench.refuses(Request::DeleteEntry { entry: 9 }, Status::DEFINED, "entry 9");
        bench.refuses(Request::WriteEntry { entry: 9, size: 62 }, Status::SIZE, "entry 9");
        bench.refuses(Request::WriteEntry { entry: 300, size: 64 }, Status::DEFINED, "entry 300");
        bench.refuses(Request::GetEntryData { entry: 9 }, Status::ODD_ADDRESS, "entry 9");
        let entry = Entry::new(0x100, [7; 32]);
        bench.link.write_entry(9, &entry).unwrap();
        let data = Request::WriteEntryData { entry: 9, value: 1 };
        bench.refuses(data, Status::ODD_ADDRESS, "block already finished");
        assert_eq!(bench.link.read_entry(9).unwrap(), entry, "{carrier:?}");
        bench.refuses(Request::GetEntryData { entry: 9 }, Status::ODD_ADDRESS, "block already finished");
        bench.refuses(Request::SaveTable, Status::NOT_STOPPED, "command table: save to flash");
    }
}

#[test]
fn a_drive_that_restarts_is_named() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        bench.link.read(Upid(0x119E), Value::Rom).unwrap();
        bench.link.ask(Request::Restart).unwrap();
        let error = bench.link.read(Upid(0x119E), Value::Rom).unwrap_err().to_string();
        let words = "no answer to read ROM value of parameter by UPID; the drive is off, restarting";
        assert!(error.contains(words), "{error}");
        bench.world().wait(RESTART);
        assert_eq!(bench.link.read(Upid(0x119E), Value::Rom).unwrap(), 8000, "{carrier:?}");

        // A restart that nobody asked for, in the middle of a curve.
        bench.link.start_curve(Access::Add, &info(3)).unwrap();
        {
            let mut world = bench.world();
            // It is back before the answer is given up.
            world.drive().set_times(Times { restart: ANSWER / 2, ..TIMES });
            let now = world.now;
            match &mut world.station {
                Station::Can(node) => node.power_cycle(now),
                Station::LinRs { drive, .. } => drive.power_cycle(now),
            }
        }
        let error = bench.link.write_setpoint(Access::Add, &info(3), 1, 0).unwrap_err().to_string();
        let words = match carrier {
            Carrier::LinRs => "no answer to add curve data (RAM); the drive is off, restarting",
            // Its boot-up message tells.
            _ => "the drive restarted during add curve data (RAM)",
        };
        assert!(error.contains(words) && error.contains("it may have been carried out"), "{error}");
        assert_eq!(bench.link.curve_info(5).unwrap(), None, "{carrier:?}");
        let data = Request::CurveData { access: Access::Add, curve: 5, value: 0 };
        bench.refuses(data, Status::ODD_ADDRESS, "curve 5");
        add(&mut bench.link, &[1, 2, 3]);
    }
}

/// A repeated image has the same count, and a repeated read brings the same.
#[test]
fn a_lost_answer_is_made_up_for_where_that_is_safe() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        bench.link.read(Upid(0x13A2), Value::Ram).unwrap();
        bench.world().lost = 1;
        assert_eq!(bench.link.read(Upid(0x13A2), Value::Ram).unwrap(), 10);
        assert_eq!(bench.world().lost, 0);
        // The answers to a write are lost: over the module the echo is awaited again, otherwise nobody
        // knows, and it is said.
        let writes = bench.world().drive().writes();
        bench.world().lost = 1;
        let write = Request::Write { memory: Memory::Rom, upid: Upid(0x13A2), value: 11 };
        let wrote = bench.link.ask(write);
        if carrier == Carrier::Pdo {
            wrote.unwrap();
        } else {
            let error = wrote.unwrap_err().to_string();
            assert!(error.contains("no answer to write ROM value"), "{error}");
            assert!(error.contains("it may have been carried out all the same"), "{error}");
        }
        assert_eq!(bench.world().drive().writes(), writes + 1, "{carrier:?}: written twice");
    }
}

#[test]
fn a_count_that_is_never_echoed_is_named() {
    let mut bench = Bench::new(Carrier::Pdo);
    bench.link.read(Upid(0x13A2), Value::Ram).unwrap();
    bench.world().lost = usize::MAX;
    let writes = bench.world().drive().writes();
    let error = bench
        .link
        .ask(Request::Write { memory: Memory::Rom, upid: Upid(0x13A2), value: 12 })
        .unwrap_err()
        .to_string();
    assert!(error.contains("no answer to write ROM value"), "{error}");
    // However often its image was repeated.
    assert_eq!(bench.world().drive().writes(), writes + 1);
}

#[test]
fn an_answer_to_something_else_is_named() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        bench.link.read(Upid(0x13A2), Value::Ram).unwrap();
        bench.world().falsified = true;
        let error = bench.link.read(Upid(0x13A2), Value::Rom).unwrap_err().to_string();
        match carrier {
            Carrier::Pdo => assert!(error.contains("wrong answer") && error.contains("expected"), "{error}"),
            Carrier::LinRs => assert!(error.contains("wrong answer"), "{error}"),
            // An answer about another object is no answer to this request.
            Carrier::Sdo => assert!(error.contains("no answer"), "{error}"),
        }
        bench.world().falsified = false;
        assert_eq!(bench.link.read(Upid(0x13A2), Value::Rom).unwrap(), 10, "{carrier:?}");
    }
}

/// A bus may deliver a frame twice: an error in the last bit of a frame is seen by its sender only. A
/// repeated request would skip a word; a repeated answer must not be taken for the next one.
#[test]
fn what_arrives_twice_counts_once() {
    let mut bench = Bench::new(Carrier::Pdo);
    bench.world().twice = true;
    let mut upids = Vec::new();
    bench.link.list(List::All, Upid(0), |item| upids.push(item.upid)).unwrap();
    assert_eq!(upids, sg5().iter().map(|parameter| parameter.upid).collect::<Vec<_>>());
    let setpoints: Vec<i32> = (0..100).map(|n| n * 3).collect();
    add(&mut bench.link, &setpoints);
    let read = bench.link.curve_info(5).unwrap().unwrap();
    let found: Vec<i32> = (1..=100).map(|number| bench.link.read_setpoint(&read, number).unwrap()).collect();
    assert_eq!(found, setpoints);
}

/// Over SDO only the answers: two requests are two commands there.
#[test]
fn an_sdo_answer_that_arrives_twice_counts_once() {
    let mut bench = Bench::new(Carrier::Sdo);
    let setpoints: Vec<i32> = (0..100).map(|n| n * 3).collect();
    add(&mut bench.link, &setpoints);
    let read = bench.link.curve_info(5).unwrap().unwrap();
    let found: Vec<i32> = (1..=100)
        .map(|number| {
            let setpoint = bench.link.read_setpoint(&read, number).unwrap();
            let mut world = bench.world();
            let data = (number as i32 * 1000).to_le_bytes();
            let again = [0x43, 5, 0x20, 0x62, data[0], data[1], data[2], data[3]];
            world.frames.push_back(Frame::standard(cob::SDO_RESPONSE + 1, again));
            setpoint
        })
        .collect();
    assert_eq!(found, setpoints);
}

/// What was begun and not ended is not there, and what was there is as it was.
#[test]
fn nothing_is_left_half_written() {
    for carrier in CARRIERS {
        let mut bench = Bench::new(carrier);
        let entry = Entry::new(0x100, [7; 32]);
        bench.link.write_entry(9, &entry).unwrap();
        bench.link.ask(Request::WriteEntry { entry: 9, size: 64 }).unwrap();
        bench.link.ask(Request::WriteEntryData { entry: 9, value: 0xA701 }).unwrap();
        assert_eq!(bench.link.read_entry(9).unwrap(), entry, "{carrier:?}");

        bench.link.start_curve(Access::Add, &info(3)).unwrap();
        bench.link.write_setpoint(Access::Add, &info(3), 1, 1).unwrap();
        assert_eq!(bench.link.curve_info(5).unwrap(), None, "{carrier:?}");
        add(&mut bench.link, &[1, 2, 3]);
        let mut other = info(3);
        other.x_length = 30_000;
        bench.link.start_curve(Access::Modify, &other).unwrap();
        bench.link.write_setpoint(Access::Modify, &other, 1, 9).unwrap();
        // The info block ended, the setpoints did not.
        let curve = bench.world().drive().curve_in_ram(5).cloned().unwrap();
        assert_eq!((curve.data, curve.info), (vec![1, 2, 3], other.encode()), "{carrier:?}");
        // A block that contradicts itself is refused as a whole.
        let start = Request::StartCurve { access: Access::Modify, curve: 5, info: 70, data: 12 };
        bench.link.ask(start).unwrap();
        let mut wrong = other;
        wrong.setpoints = 4;
        let words = wrong.encode();
        for value in &words[..17] {
            bench.link.ask(Request::CurveInfo { access: Access::Modify, curve: 5, value: *value }).unwrap();
        }
        let last = Request::CurveInfo { access: Access::Modify, curve: 5, value: words[17] };
        bench.refuses(last, Status::SIZE, "curve 5");
        assert_eq!(bench.world().drive().curve_in_ram(5).unwrap().info, other.encode(), "{carrier:?}");
    }
}
