//! How long SDO transfers and scans take on the virtual bus, against what the bit times allow; exact, on
//! virtual time.

use core::time::Duration;

use canopen_master::master::{Config, Event, Master};
use canopen_master::scan;
use canopen_master::sdo::{self, Outcome};
use canopen_master::{Address, Frame, NodeId, NodeSet};
use device_sim::can::{Bus, Faults, INTERMISSION, Network, Node, QUEUE, WireBits};
use device_sim::canopen::RemoteIo;

const BIT_RATE: u32 = 500_000;
const KIB64: usize = device_sim::canopen::STORE;

fn node(raw: u8) -> NodeId {
    NodeId::new(raw).unwrap()
}

fn time(bits: u64) -> Duration {
    Duration::from_nanos(bits * 1_000_000_000 / u64::from(BIT_RATE))
}

/// Bits of a frame and the intermission behind it.
fn bits(frame: &Frame) -> u64 {
    WireBits::new(frame).frame_len() as u64 + INTERMISSION
}

/// A master whose timers come late, up to this step, as those of an operating system do.
struct Station {
    master: Box<Master<'static, Vec<u8>, 127>>,
    step: Duration,
    events: Vec<(Duration, Event<Vec<u8>>)>,
}

impl Station {
    fn new(step: Duration) -> Self {
        let config = Config { bit_rate: BIT_RATE, ..Config::default() };
        Self { master: Box::new(Master::new(config)), step, events: Vec::new() }
    }

    fn collect(&mut self, now: Duration) {
        self.events.extend(core::iter::from_fn(|| self.master.poll_event()).map(|event| (now, event)));
    }
}

impl Node for Station {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        self.master.handle_frame(now, frame);
        self.collect(now);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.master.handle_timeout(now);
        self.collect(now);
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        self.master.poll_transmit(now)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        let step = self.step.as_nanos() as u64;
        let late = |at: Duration| Duration::from_nanos((at.as_nanos() as u64).next_multiple_of(step));
        self.master.poll_timeout().map(late)
    }
}

/// Sends a frame of high priority each `period`; hears everything.
struct Other {
    period: Option<Duration>,
    next: Duration,
    heard: Vec<(Duration, Frame)>,
}

impl Node for Other {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        self.heard.push((now, *frame));
    }

    fn handle_timeout(&mut self, _: Duration) {}

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        let period = self.period.filter(|_| now >= self.next)?;
        self.next = now + period;
        Some(Frame::standard(0x010, [0x55; 8]))
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.period.map(|_| self.next)
    }
}

struct Scan {
    /// From the command to its outcome.
    took: Duration,
    /// Most frames in the master's transmit queue at once.
    queued: usize,
    /// Until then.
    frames: Vec<Frame>,
}

/// Scans all addresses; these are present.
fn scan(present: &[u8], step: Duration, load: Option<Duration>) -> Scan {
    let mut master = Station::new(step);
    let mut other = Other { period: load, next: Duration::ZERO, heard: Vec::new() };
    let mut devices: Vec<_> =
        present.iter().map(|id| RemoteIo::node(Some(node(*id)), (*id).into(), false)).collect();
    let mut network = Network::new(Bus::new(BIT_RATE, Faults::NONE), 2 + devices.len());
    let station = network.station(0).unwrap();
    let mut run = |master: &mut Station, other: &mut Other, until| {
        let mut nodes: Vec<&mut dyn Node> = vec![master, other];
        nodes.extend(devices.iter_mut().map(|it| it as &mut dyn Node));
        let mut queued = 0;
        while network.step(&mut nodes, until) {
            queued = queued.max(QUEUE - network.bus().room(station));
        }
        queued
    };
    let start = 200 * MS;
    run(&mut master, &mut other, start);
    master.events.clear();
    other.heard.clear();
    let options = scan::Options { identity: true, ..scan::Options::default() };
    master.master.scan(NodeSet::ALL, options).unwrap();
    // Longer than it takes: the last time-outs are told to their nodes.
    let queued = run(&mut master, &mut other, start + 3000 * MS);
    let [(end, Event::Scanned { found, silent })] = &master.events[..] else {
        panic!("{} events", master.events.len())
    };
    assert_eq!((found.len(), silent.len()), (present.len(), 127 - present.len()));
    for id in present {
        let info = master.master.info(node(*id)).unwrap();
        assert_eq!(info.name.text(), "Virtual I/O");
        assert_eq!(info.identity.unwrap().serial, u32::from(*id));
    }
    let before = |(at, _): &(Duration, Frame)| at <= end;
    Scan {
        took: *end - start,
        queued,
        frames: other.heard.into_iter().filter(before).map(|it| it.1).collect(),
    }
}

const TEN: [u8; 10] = [1, 2, 7, 16, 31, 32, 64, 100, 126, 127];
const MS: Duration = Duration::from_millis(1);

/// Decision 15: whoever is there, however late the timers come and whoever else sends.
#[test]
fn a_scan_keeps_the_transmit_queue_below_8() {
    let all: Vec<u8> = (1..=127).collect();
    for present in [&[][..], &TEN, &all] {
        for step in [Duration::from_nanos(1), MS, 20 * MS] {
            for load in [None, Some(Duration::from_micros(450))] {
                let Scan { took, queued, .. } = scan(present, step, load);
                println!(
                    "{} nodes, timers each {step:?}, load {load:?}: {took:?}, {queued} frames at most",
                    present.len()
                );
                assert!(queued < 8, "{queued} frames");
            }
        }
    }
}

#[test]
fn a_scan_takes_one_time_out_and_its_frames() {
    let Scan { took, frames, .. } = scan(&TEN, Duration::from_nanos(1), None);
    // Aborts tell nodes that they were given up; nobody waits for them.
    let abort = |frame: &Frame| frame.data().first() == Some(&0x80);
    let frames: Vec<_> = frames.iter().filter(|frame| !abort(frame)).collect();
    // As many stuff bits as there can be: the pace does not look into frames.
    let longest =
        |frame: &&&Frame| 47 + 8 * frame.data().len() as u64 + (33 + 8 * frame.data().len() as u64) / 4;
    let wire = time(frames.iter().map(|frame| longest(&frame)).sum());
    let bound = wire + scan::ANSWER;
    println!(
        "{} frames take {wire:?} and one time-out {:?}: {bound:?}; took {took:?}",
        frames.len(),
        scan::ANSWER
    );
    assert!(took <= bound);
}

/// One transfer with a device's store; the time from the first frame to the last, and all frames.
fn transfer(download: bool, options: &sdo::Options) -> (Duration, Vec<Frame>) {
    const AT: Address = Address::new(0x2000, 1);
    let data: Vec<u8> = (0..KIB64).map(|i| (i * 7 + i / 256) as u8).collect();
    let mut master = Station::new(Duration::from_nanos(1));
    let mut other = Other { period: None, next: Duration::ZERO, heard: Vec::new() };
    let mut device = RemoteIo::node(Some(node(5)), 5, false);
    let mut network = Network::new(Bus::new(BIT_RATE, Faults::NONE), 3);
    let mut run = |master: &mut Station, other: &mut Other| {
        master.events.clear();
        other.heard.clear();
        let begun = network.now();
        let mut nodes: [&mut dyn Node; 3] = [master, other, &mut device];
        while network.step(&mut nodes, begun + 20_000 * MS) {}
        begun
    };
    run(&mut master, &mut other);
    let mut finish = |master: &mut Station, other: &mut Other| {
        let begun = run(master, other);
        let Some((_, Event::Sdo { finished, .. })) = master.events.pop() else { panic!("no outcome") };
        assert_eq!((finished.outcome, &finished.buffer), (Outcome::Done(KIB64 as u32), &data));
        let frames = other.heard.iter().map(|(_, frame)| *frame).collect();
        (other.heard.last().unwrap().0 - begun, frames)
    };
    master.master.download(node(5), AT, data.clone(), options).unwrap();
    let downloaded = finish(&mut master, &mut other);
    master.master.upload(node(5), AT, Vec::new(), options).unwrap();
    let uploaded = finish(&mut master, &mut other);
    if download { downloaded } else { uploaded }
}

/// What the frames that carry data take back to back is the least that any protocol of 7 bytes a frame
/// can take.
#[test]
fn block_transfers_use_98_percent_of_the_bus() {
    for download in [true, false] {
        let (took, frames) = transfer(download, &sdo::Options::block(Duration::from_millis(500)));
        let id = if download { 0x605 } else { 0x585 };
        let segments: Vec<_> = frames
            .iter()
            .filter(|frame| frame.standard_id() == Some(id) && (1..=0x7F).contains(&(frame.data()[0] & 0x7F)))
            .collect();
        let least = time(segments.iter().map(|frame| bits(frame)).sum());
        let share = least.as_secs_f64() / took.as_secs_f64();
        println!(
            "download {download}: {} data frames {least:?}, took {took:?}: {:.2} %",
            segments.len(),
            100.0 * share
        );
        assert!(share >= 0.98);
    }
}

/// Request and answer take turns: without time between them, the bus is never idle.
#[test]
fn segmented_transfers_use_98_percent_of_their_limit() {
    for download in [true, false] {
        let (took, frames) = transfer(download, &sdo::Options::new(Duration::from_millis(500)));
        // One exchange to begin, one each 7 bytes; nothing else.
        assert_eq!(frames.len(), 2 * (1 + KIB64.div_ceil(7)));
        let limit = time(frames.iter().map(bits).sum());
        let share = limit.as_secs_f64() / took.as_secs_f64();
        println!(
            "download {download}: {} frames {limit:?}, took {took:?}: {:.2} %",
            frames.len(),
            100.0 * share
        );
        assert!(share >= 0.98);
    }
}
