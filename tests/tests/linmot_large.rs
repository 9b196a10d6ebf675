//! A large PVL file restored over a modelled bus: time against the bus's own limit, and memory.

use core::alloc::{GlobalAlloc, Layout};
use core::cell::Cell;
use core::time::Duration;
use std::alloc::System;
use std::io::{self, BufReader, Read, Seek, SeekFrom};

use canopen_master::nmt::{self, Target};
use device_sim::can::{Bus, Faults, Network, Node};
use device_sim::linmot::{CanDrive, Times, VirtualDrive, generated};
use linmot::client::Client;
use linmot::code::Status;
use linmot::curve::{INFO_WORDS, InfoBlock};
use linmot::drive::{Drive, Parameter};
use linmot::link::Link;
use linmot::module::{RPDO, TPDO};
use linmot::pvl::Writer;
use linmot::request::{Access as CurveAccess, List, Reply, Request, Value};
use linmot::sdo::{self, Access, Answer};
use linmot::upid::{Layer, TreeIdentity, Upid, Usage};
use motion_io::linmot::transfer::{Options, restore};
use pdo::{Frame, NodeId};

struct Counting;

std::thread_local! {
    /// Bytes that this thread holds, and the most it has held. Tests run beside each other: what
    /// others allocate is none of this one's.
    static HELD: Cell<isize> = const { Cell::new(0) };
    static PEAK: Cell<isize> = const { Cell::new(0) };
}

fn count(bytes: isize) {
    HELD.set(HELD.get() + bytes);
    PEAK.set(PEAK.get().max(HELD.get()));
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

// A counting allocator cannot be written otherwise; it hands everything on to the system's.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// A value in range that is not the default.
fn other(parameter: &Parameter) -> u32 {
    let number = |raw| parameter.kind.number(raw);
    let range = number(parameter.minimum)..=number(parameter.maximum);
    (0..3).find(|raw| *raw != parameter.default && range.contains(&number(*raw))).unwrap()
}

/// A file that is made while it is read.
struct File<'a> {
    tree: &'a [Parameter],
    curves: u16,
    setpoints: u16,
    /// The next piece: the head, a parameter each, a head and setpoints for each curve.
    piece: usize,
    text: Vec<u8>,
    at: usize,
}

impl<'a> File<'a> {
    fn new(tree: &'a [Parameter], curves: u16, setpoints: u16) -> BufReader<Self> {
        BufReader::new(Self { tree, curves, setpoints, piece: 0, text: Vec::new(), at: 0 })
    }

    fn identity(&self, layer: Layer) -> TreeIdentity {
        let value = |n: usize| {
            let upid = layer.identity()[n];
            self.tree.iter().find(|parameter| parameter.upid == upid).map_or(0, |parameter| parameter.default)
        };
        TreeIdentity { tree_id: value(0), main_version: value(1), sub_version: value(2) }
    }

    /// Text of the next piece; empty at the end.
    fn next(&self) -> String {
        let text = |write: &dyn Fn(&mut Writer<String>)| {
            let mut writer = Writer::new(String::new()).unwrap();
            writer.inner().clear();
            write(&mut writer);
            writer.into_inner()
        };
        if self.piece == 0 {
            return Writer::new(String::new()).unwrap().into_inner();
        }
        let piece = self.piece - 1;
        if let Some(layer) = Layer::ALL.get(piece) {
            return text(&|writer| {
                writer.section(*layer, self.identity(*layer)).unwrap();
                for parameter in self.tree {
                    if parameter.upid.layer() == Some(*layer) && parameter.usage.contains(Usage::ROM_WRITE) {
                        writer.parameter(parameter.upid, other(parameter), "", "").unwrap();
                    }
                }
                writer.end().unwrap();
            });
        }
        // Each curve in pieces of up to 100 setpoints, so that a piece is small.
        let of_curve = usize::from(self.setpoints.div_ceil(100));
        let (curve, part) = ((piece - 4) / of_curve, (piece - 4) % of_curve);
        if curve >= usize::from(self.curves) {
            return String::new();
        }
        text(&|writer| {
            if part == 0 {
                let id = curve as u16 + 1;
                let info = InfoBlock::position_over_time(id, "large", 100_000, self.setpoints).unwrap();
                writer.curve(&info, "large").unwrap();
            }
            let (from, to) = (part * 100, (part * 100 + 100).min(self.setpoints.into()));
            (from..to).for_each(|n| writer.setpoint(n as i32 * 7919).unwrap());
            if part + 1 == of_curve {
                writer.end().unwrap();
            }
        })
    }
}

impl Read for File<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.at == self.text.len() {
            self.text = self.next().into_bytes();
            (self.at, self.piece) = (0, self.piece + 1);
        }
        let len = buffer.len().min(self.text.len() - self.at);
        buffer[..len].copy_from_slice(&self.text[self.at..self.at + len]);
        self.at += len;
        Ok(len)
    }
}

impl Seek for File<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        assert_eq!(to, SeekFrom::Start(0));
        (self.piece, self.at) = (0, 0);
        self.text.clear();
        Ok(0)
    }
}

const NODE: u8 = 1;

/// The client's station: one command at a time, by SDO or by the configuration module.
enum Station {
    Sdo {
        out: Option<Frame>,
        answer: Option<Answer>,
    },
    /// With the frame that makes the drive operational, which takes PDOs in no other state.
    Module {
        start: Option<Frame>,
        client: Client,
    },
}

impl Node for Station {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        let telegram = <[u8; 8]>::try_from(frame.data());
        match (self, frame.standard_id(), telegram) {
            (Self::Sdo { answer, .. }, Some(0x581), Ok(telegram)) => {
                *answer = Answer::parse(telegram).map(|(_, _, answer)| answer);
            }
            (Self::Module { client, .. }, Some(id), Ok(image)) if id == TPDO + u16::from(NODE) => {
                client.handle_input(now, image);
            }
            _ => {}
        }
    }

    fn handle_timeout(&mut self, now: Duration) {
        if let Self::Module { client, .. } = self {
            client.handle_timeout(now);
        }
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        match self {
            Self::Sdo { out, .. } => out.take(),
            Self::Module { start, .. } if start.is_some() => start.take(),
            Self::Module { client, .. } => {
                let image = client.poll_transmit(now)?;
                Some(Frame::standard(RPDO + u16::from(NODE), image))
            }
        }
    }

    fn poll_timeout(&self) -> Option<Duration> {
        match self {
            Self::Sdo { .. } => None,
            Self::Module { client, .. } => client.poll_timeout(),
        }
    }
}

/// A client and a drive on one bus, on virtual time.
struct OverBus {
    network: Network,
    station: Station,
    drive: CanDrive,
    sdo: sdo::Client,
    /// Bits of the frames that carry what the file holds.
    needed: u64,
    /// How many frames these are.
    frames: u64,
}

impl OverBus {
    fn new(tree: &[Parameter], station: Station) -> Self {
        let drive = VirtualDrive::new(tree.iter().copied(), Times::default());
        let drive = CanDrive::new(drive, NodeId::new(NODE).ok(), 1);
        let network = Network::new(Bus::new(500_000, Faults::NONE), 2);
        Self { network, station, drive, sdo: sdo::Client::new(), needed: 0, frames: 0 }
    }

    fn until<T>(&mut self, mut done: impl FnMut(&mut Station) -> Option<T>) -> T {
        let limit = self.network.now() + Duration::from_secs(60);
        loop {
            if let Some(found) = done(&mut self.station) {
                return found;
            }
            assert!(self.network.step(&mut [&mut self.station, &mut self.drive], limit), "no answer");
        }
    }

    fn exchange(&mut self, access: Access) -> Answer {
        self.station = Station::Sdo { out: Some(Frame::standard(0x601, access.encode())), answer: None };
        self.until(|station| match station {
            Station::Sdo { answer, .. } => answer.take(),
            Station::Module { .. } => None,
        })
    }
}

impl Link for OverBus {
    type Error = sdo::Aborted;

    fn call(&mut self, request: &Request) -> Result<Reply, sdo::Aborted> {
        let before = self.network.bus().statistics();
        let mut reply = match &mut self.station {
            Station::Module { client, .. } => {
                client.submit(request).unwrap();
                self.until(|station| match station {
                    Station::Module { client, .. } => client.poll_event(),
                    Station::Sdo { .. } => None,
                })
                .outcome
                .into_reply()
            }
            Station::Sdo { .. } => {
                let answer = self.exchange(Access::new(request).unwrap());
                self.sdo.reply(request, answer)?
            }
        };
        // While flash is written the client asks every 20 ms.
        while reply.status.is_running() {
            let now = self.network.now() + Duration::from_millis(20);
            while self.network.step(&mut [&mut self.station, &mut self.drive], now) {}
            if !sdo::Client::is_flash_busy(self.exchange(Access::flash_state())) {
                reply.status = Status::OK;
            }
        }
        let writes = matches!(
            request,
            Request::Write { .. }
                | Request::StartCurve { access: CurveAccess::Add, .. }
                | Request::CurveInfo { .. }
                | Request::CurveData { .. }
        );
        if writes {
            let now = self.network.bus().statistics();
            self.needed += now.bits - before.bits;
            self.frames += now.frames - before.frames;
        }
        Ok(reply)
    }
}

trait IntoReply {
    fn into_reply(self) -> Reply;
}

impl IntoReply for linmot::client::Outcome {
    fn into_reply(self) -> Reply {
        match self {
            Self::Done(reply) | Self::Refused(reply) => reply,
            other => panic!("{other:?}"),
        }
    }
}

/// Restores and returns the time as a multiple of the bus's own.
fn ratio(station: Station, parameters: usize, curves: u16, setpoints: u16) -> f64 {
    let tree = generated(parameters);
    let mut over = OverBus::new(&tree, station);
    let mut file = File::new(&tree, curves, setpoints);
    let done = restore(&mut over, &mut file, Options::default(), |_| ()).unwrap();
    assert_eq!((done.parameters, usize::from(curves)), (parameters.max(done.parameters), done.curves));
    assert_eq!(done.setpoints, usize::from(curves) * usize::from(setpoints));
    // What was sent has arrived.
    let curve = over.drive.drive().curve_in_ram(curves).unwrap();
    assert_eq!(curve.data[usize::from(setpoints) - 1], (i32::from(setpoints) - 1) as u32 * 7919);
    let last = tree.last().unwrap();
    assert_eq!(over.drive.drive().rom(last.upid), other(last));
    // The limit is that of the frames which carry the file: a question and an answer each for a
    // parameter, a curve's start, each word of its info block and each setpoint.
    let carried = done.parameters + done.curves * (1 + INFO_WORDS) + done.setpoints;
    assert_eq!(over.frames, 2 * carried as u64);
    let limit = over.network.bus().time(over.needed);
    let ratio = over.network.now().as_secs_f64() / limit.as_secs_f64();
    println!(
        "{parameters} parameters, {curves} curves of {setpoints}: {:?}, bus {limit:?}, {ratio:.4}",
        over.network.now()
    );
    ratio
}

fn sdo_station() -> Station {
    Station::Sdo { out: None, answer: None }
}

fn module_station() -> Station {
    let start = nmt::Command::Start.frame(Target::Node(NodeId::new(NODE).unwrap()));
    Station::Module { start: Some(start), client: Client::default() }
}

/// The whole size takes minutes in a debug build; `cargo test --release -- --ignored` runs it.
#[test]
#[ignore = "two million frames"]
fn two_thousand_parameters_and_a_million_setpoints() {
    for station in [sdo_station(), module_station()] {
        let ratio = ratio(station, 2000, 100, 10_000);
        assert!(ratio <= 1.05, "{ratio}");
    }
}

/// A fiftieth of it: the fixed times (flash, start) and the reads weigh more.
#[test]
fn a_smaller_file_is_near_the_bus_limit_too() {
    for station in [sdo_station(), module_station()] {
        let ratio = ratio(station, 40, 2, 10_000);
        assert!(ratio <= 1.12, "{ratio}");
    }
}

/// Answers like a drive of `tree` without curves, and keeps nothing but the last value written.
struct Sink<'a> {
    tree: &'a [Parameter],
    last: Option<(Upid, u32)>,
    list: usize,
    info: usize,
    data: usize,
}

impl Link for Sink<'_> {
    type Error = sdo::Aborted;

    fn call(&mut self, request: &Request) -> Result<Reply, sdo::Aborted> {
        let [first, ..] = request.words();
        let next = |left: &mut usize| {
            *left -= 1;
            Reply::new(if *left == 0 { Status::OK } else { Status::NOT_FINISHED }, [first, 0, 0])
        };
        Ok(match *request {
            Request::StartList { .. } => {
                self.list = 0;
                Reply::new(Status::OK, [first, 0, 0])
            }
            Request::NextItem(List::All) => {
                let item = self.tree.get(self.list);
                self.list += 1;
                item.map_or(Reply::new(Status::END, [0; 3]), |parameter| {
                    Reply::new(Status::OK, [parameter.upid.0, parameter.usage.0, 0])
                })
            }
            Request::Read { upid, value: Value::Ram | Value::Rom } => {
                let default = self.tree.iter().find(|p| p.upid == upid).map_or(0, |p| p.default);
                let last = self.last.filter(|(last, _)| *last == upid).map(|(_, value)| value);
                Reply::with_value(Status::OK, upid.0, last.unwrap_or(default))
            }
            Request::Write { upid, value, .. } => {
                self.last = Some((upid, value));
                Reply::with_value(Status::OK, upid.0, value)
            }
            Request::StartCurve { access: CurveAccess::Get, .. } => {
                Reply::new(Status::DEFINED, [first, 0, 0])
            }
            Request::StartCurve { data, .. } => {
                (self.info, self.data) = (INFO_WORDS, usize::from(data / 4));
                Reply::new(Status::OK, [first, 0, 0])
            }
            Request::CurveInfo { .. } => next(&mut self.info),
            Request::CurveData { .. } => next(&mut self.data),
            _ => Reply::new(Status::OK, [first, 0, 0]),
        })
    }
}

#[test]
fn memory_does_not_grow_with_the_file() {
    let tree = generated(2000);
    let peak = |curves: u16, setpoints: u16| {
        let mut sink = Sink { tree: &tree, last: None, list: 0, info: 0, data: 0 };
        let mut file = File::new(&tree, curves, setpoints);
        let before = HELD.get();
        PEAK.set(before);
        let done = restore(&mut sink, &mut file, Options::default(), |_| ()).unwrap();
        assert_eq!(done.setpoints, usize::from(curves) * usize::from(setpoints));
        PEAK.get() - before
    };
    let (small, large) = (peak(1, 100), peak(100, 2000));
    println!("peak {small} bytes with 100 setpoints, {large} with 200,000");
    assert!(large < small + 64 * 1024, "{small} -> {large}");
}
