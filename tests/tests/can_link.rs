//! Eight CAN Link devices on one virtual bus, all 14 channels busy.

use core::time::Duration;

use can_link::{BIT_RATE, Channel, Event, Link, Setting};
use device_sim::can::{Bus, Faults, INTERMISSION, Network, Node, WireBits};
use oorandom::Rand32;
use pdo::Frame;

const DEVICES: usize = 8;
const SEED: u32 = 0xCA41;

/// The one transmitter of a channel.
fn owner(channel: Channel) -> usize {
    usize::from(channel.number() - 1) % DEVICES
}

/// A device, and what must be true of it.
struct Device {
    link: Link,
    /// Number of the last value of each channel that came in, and how many frames came.
    last: [u64; 14],
    came: [u32; 14],
    /// Frames of others on its own channels.
    intruders: [u16; 14],
    conflicts: [bool; 14],
    /// Bits of all frames that it handed to the bus.
    bits: u64,
    frames: u64,
}

impl Device {
    fn new(number: usize) -> Self {
        let mut link = Link::new();
        for channel in Channel::all() {
            let setting = if owner(channel) == number { Setting::TRANSMIT } else { Setting::RECEIVE };
            link.set(channel, setting).unwrap();
        }
        Self {
            link,
            last: [0; 14],
            came: [0; 14],
            intruders: [0; 14],
            conflicts: [false; 14],
            bits: 0,
            frames: 0,
        }
    }
}

/// A device with its number.
struct Station {
    number: usize,
    device: Device,
}

impl Node for Station {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        let channel = Channel::new((frame.standard_id().unwrap() - 0x100) as u8).unwrap();
        let at = usize::from(channel.number() - 1);
        let device = &mut self.device;
        device.link.handle_frame(now, frame);
        if owner(channel) == self.number {
            device.intruders[at] += 1;
        } else {
            // What the link gives out is what came last, and never older than what came before.
            let (value, new): (u64, bool) = device.link.read_value(now, channel).unwrap();
            assert_eq!(value.to_le_bytes(), frame.data());
            assert!(new);
            assert!(value >= device.last[at], "seed {SEED:X}h: {value} after {}", device.last[at]);
            device.last[at] = value;
            device.came[at] += 1;
        }
        while let Some(event) = device.link.poll_event() {
            match event {
                Event::Conflict(channel) => device.conflicts[usize::from(channel.number() - 1)] = true,
                other => panic!("{other:?}"),
            }
        }
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.device.link.handle_timeout(now);
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        let frame: Frame = self.device.link.poll_transmit(now)?;
        // CRC delimiter, acknowledge slot and delimiter, 7 bits end of frame.
        self.device.bits += WireBits::new(&frame).stuffed().len() as u64 + 10 + INTERMISSION;
        self.device.frames += 1;
        Some(frame)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.device.link.poll_timeout()
    }
}

struct Line {
    network: Network,
    stations: Vec<Station>,
    /// Number of the newest value of each channel.
    written: [u64; 14],
}

impl Line {
    fn new(faults: Faults) -> Self {
        let stations = (0..DEVICES).map(|number| Station { number, device: Device::new(number) }).collect();
        Self { network: Network::new(Bus::new(BIT_RATE, faults), DEVICES), stations, written: [0; 14] }
    }

    /// Lets every channel's owner write a new value, and the bus carry them all; returns how long the
    /// bus took for it.
    fn round(&mut self) -> Duration {
        for channel in Channel::all() {
            let value = &mut self.written[usize::from(channel.number() - 1)];
            *value += 1;
            self.stations[owner(channel)].device.link.write_value(channel, value).unwrap();
        }
        self.settle()
    }

    fn settle(&mut self) -> Duration {
        let mut nodes: Vec<&mut dyn Node> = self.stations.iter_mut().map(|station| station as _).collect();
        let start = self.network.now();
        let mut end = start;
        while self.network.step(&mut nodes, start + Duration::from_secs(1)) {
            end = self.network.now();
        }
        end - start
    }

    fn all_have_the_newest(&self) {
        for station in &self.stations {
            for channel in Channel::all().filter(|channel| owner(*channel) != station.number) {
                let at = usize::from(channel.number() - 1);
                assert_eq!(station.device.last[at], self.written[at], "channel {channel}");
            }
        }
    }
}

/// One million frames with loss and duplication: the newest value arrives, order is kept, and no
/// conflict is invented.
#[test]
fn a_million_frames_with_loss_and_duplication() {
    let faults = Faults { seed: u64::from(SEED), lose: 50, duplicate: 50, ..Faults::NONE };
    let mut line = Line::new(faults);
    while line.network.bus().statistics().frames < 1_000_000 {
        line.round();
    }
    let lost: u64 = line.written.iter().sum::<u64>() * (DEVICES as u64 - 1)
        - line.stations.iter().flat_map(|station| station.device.came).map(u64::from).sum::<u64>();
    let statistics = line.network.bus().statistics();
    println!(
        "{} frames, {} touched by faults, {lost} receptions fewer than sent",
        statistics.frames, statistics.faulty
    );
    assert!(statistics.faulty > 30_000, "the faults were at work");

    line.network.bus().set_faults(Faults::NONE);
    line.round();
    line.all_have_the_newest();
    for station in &line.stations {
        assert_eq!(station.device.conflicts, [false; 14]);
        assert!(Channel::all().all(|channel| station.device.link.conflicts(channel) == 0));
    }
}

/// The bus is busy for as long as its frames take, bit by bit.
#[test]
fn bus_load_is_what_the_frames_add_up_to() {
    let mut line = Line::new(Faults::NONE);
    let busy: Duration = (0..1000).map(|_| line.round()).sum();
    line.all_have_the_newest();
    let statistics = line.network.bus().statistics();
    let bits: u64 = line.stations.iter().map(|station| station.device.bits).sum();
    let frames: u64 = line.stations.iter().map(|station| station.device.frames).sum();
    assert_eq!((statistics.frames, statistics.bits), (frames, bits));
    println!("{frames} frames, {bits} bits, {busy:?} at {BIT_RATE} bit/s");
    // Nobody waits while another one has something to send; behind the last frame of a round there
    // is no intermission to wait for.
    assert_eq!(busy, line.network.bus().time(bits - 1000 * INTERMISSION));
}

/// Every device that sends on a channel of another is found by that other one, frame by frame.
#[test]
fn every_conflict_is_found_and_none_invented() {
    let mut random = Rand32::new(SEED.into());
    let mut line = Line::new(Faults { seed: u64::from(SEED), lose: 20, duplicate: 20, ..Faults::NONE });
    let mut wronged = [false; 14];
    for round in 0..2000_u64 {
        if round % 3 == 0 {
            line.round();
            continue;
        }
        let channel = Channel::new(random.rand_range(1..8) as u8).unwrap();
        let intruder = random.rand_range(0..DEVICES as u32) as usize;
        if intruder == owner(channel) {
            continue;
        }
        // For one frame, with the owner silent; then it goes back to what it was.
        let before = line.stations[owner(channel)].device.intruders;
        let link = &mut line.stations[intruder].device.link;
        link.set(channel, Setting::TRANSMIT).unwrap();
        link.write_value(channel, &u64::MAX).unwrap();
        // The others receive it like any other value.
        let last: Vec<[u64; 14]> = line.stations.iter().map(|station| station.device.last).collect();
        line.settle();
        for (station, last) in line.stations.iter_mut().zip(last) {
            station.device.last = last;
        }
        line.stations[intruder].device.link.set(channel, Setting::RECEIVE).unwrap();
        wronged[usize::from(channel.number() - 1)] |=
            line.stations[owner(channel)].device.intruders != before;
    }
    for channel in Channel::all() {
        let at = usize::from(channel.number() - 1);
        for station in &line.stations {
            let found = if owner(channel) == station.number { wronged[at] } else { false };
            assert_eq!(station.device.conflicts[at], found, "channel {channel}, device {}", station.number);
        }
        let device = &line.stations[owner(channel)].device;
        assert_eq!(device.link.conflicts(channel), device.intruders[at], "channel {channel}");
    }
    assert!(wronged[..7].iter().all(|wronged| *wronged), "{wronged:?}");
}
