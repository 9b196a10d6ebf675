//! A link to the virtual drive, on a wire that loses, repeats and falsifies answers, on virtual time.

use core::time::Duration;
use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard};

use device_sim::can::Node;
use device_sim::linmot::{CanDrive, Times, VirtualDrive, sg5};
use linmot::client::{self, Client};
use linmot::code::Status;
use linmot::curve::InfoBlock;
use linmot::drive::Parameter;
use linmot::link::{Fault, Link, LinkExt};
use linmot::linrs::{Checksum, Config, Slave};
use linmot::module::TPDO;
use linmot::request::{Access, Reply, Request};
use motion_io::can::{CanPort, Event};
use motion_io::linmot::{LinRsLink, LinkError, PdoLink, SdoLink};
use motion_io::port::Port;
use pdo::{Frame, NodeId, cob};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Carrier {
    Sdo,
    Pdo,
    LinRs,
}

pub(crate) const CARRIERS: [Carrier; 3] = [Carrier::Sdo, Carrier::Pdo, Carrier::LinRs];
pub(crate) const RESTART: Duration = Duration::from_secs(1);
pub(crate) const TIMES: Times =
    Times { restart: RESTART, start: Duration::from_millis(300), flash: Duration::from_millis(400) };
/// Answers that do not come are given up after this time.
pub(crate) const ANSWER: Duration = Duration::from_millis(200);

#[expect(clippy::large_enum_variant, reason = "one a test")]
pub(crate) enum Station {
    Can(CanDrive),
    LinRs { slave: Slave, drive: VirtualDrive },
}

/// The drive and the wire to it, on virtual time.
pub(crate) struct World {
    pub(crate) station: Station,
    pub(crate) now: Duration,
    pub(crate) frames: VecDeque<Frame>,
    pub(crate) bytes: VecDeque<u8>,
    /// So many answers are lost.
    pub(crate) lost: usize,
    /// Everything arrives twice, in both directions.
    pub(crate) twice: bool,
    /// Answers are altered.
    pub(crate) falsified: bool,
    /// The drive's power fails for a moment then.
    pub(crate) power_fails: Option<Duration>,
}

impl World {
    pub(crate) fn drive(&mut self) -> &mut VirtualDrive {
        match &mut self.station {
            Station::Can(node) => node.drive_mut(),
            Station::LinRs { drive, .. } => drive,
        }
    }

    pub(crate) fn wait(&mut self, time: Duration) {
        self.now += time;
        if self.power_fails.take_if(|at| *at <= self.now).is_some() {
            match &mut self.station {
                Station::Can(node) => node.power_cycle(self.now),
                Station::LinRs { slave, drive } => {
                    *slave = Slave::new(1, Checksum::None);
                    drive.power_cycle(self.now);
                }
            }
        }
        match &mut self.station {
            Station::Can(node) => node.handle_timeout(self.now),
            Station::LinRs { slave, drive } => slave.handle_timeout(self.now, drive),
        }
        self.collect();
    }

    /// Time passes until something has come, at most this long.
    fn pass(&mut self, time: Duration) {
        let end = self.now + time;
        while self.now < end && self.frames.is_empty() && self.bytes.is_empty() {
            let next = match &self.station {
                Station::Can(node) => node.poll_timeout(),
                Station::LinRs { slave, drive } => slave.poll_timeout(drive),
            };
            let next = next.into_iter().chain(self.power_fails).min();
            let next = next.unwrap_or(end).clamp(self.now + Duration::from_micros(1), end);
            self.wait(next - self.now);
        }
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

pub(crate) struct Wire(Arc<Mutex<World>>);

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
        world.pass(timeout);
        Ok(world.frames.pop_front().map(Event::Frame))
    }

    fn now(&self) -> Duration {
        self.0.lock().unwrap().now
    }
}

impl Port for Wire {
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let mut world = self.0.lock().unwrap();
        world.pass(timeout);
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
pub(crate) struct AnyLink(Box<dyn Link<Error = LinkError>>);

impl Link for AnyLink {
    type Error = LinkError;

    fn call(&mut self, request: &Request) -> Result<Reply, LinkError> {
        self.0.call(request)
    }
}

pub(crate) struct Bench {
    pub(crate) link: AnyLink,
    pub(crate) world: Arc<Mutex<World>>,
}

impl Bench {
    pub(crate) fn new(carrier: Carrier) -> Self {
        Self::with(carrier, sg5())
    }

    pub(crate) fn with(carrier: Carrier, tree: Vec<Parameter>) -> Self {
        let drive = VirtualDrive::new(tree, TIMES);
        let node = NodeId::new(1).unwrap();
        let station = match carrier {
            Carrier::LinRs => Station::LinRs { slave: Slave::new(1, Checksum::None), drive },
            _ => Station::Can(CanDrive::new(drive, Some(node), 1)),
        };
        let (frames, bytes) = (VecDeque::new(), VecDeque::new());
        let mut world = World {
            station,
            now: Duration::ZERO,
            frames,
            bytes,
            lost: 0,
            twice: false,
            falsified: false,
            power_fails: None,
        };
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

    pub(crate) fn world(&self) -> MutexGuard<'_, World> {
        self.world.lock().unwrap()
    }

    /// Non-volatile memory, and how often it was written.
    pub(crate) fn kept(&self) -> (Vec<u8>, u64) {
        let mut world = self.world();
        let drive = world.drive();
        (drive.image(), drive.writes())
    }

    /// The command is refused with this status, and the error names it and what it is about.
    #[track_caller]
    pub(crate) fn refuses(&mut self, request: Request, status: Status, words: &str) {
        let fault = self.link.ask(request).unwrap_err();
        let text = fault.to_string();
        let Fault::Refused { reply, .. } = fault else { panic!("{request:?}: {text}") };
        assert_eq!(reply.status, status, "{request:?}: {text}");
        assert!(text.contains(words), "{text}");
        // Of the meanings of D4h the one that fits the request.
        let meanings = match status {
            Status::DEFINED => &["curve already defined", "curve not present", "invalid entry number"][..],
            other => &[other.text().unwrap()],
        };
        assert!(meanings.iter().any(|meaning| text.ends_with(meaning)), "{text}");
    }
}

pub(crate) fn info(setpoints: u16) -> InfoBlock {
    InfoBlock::position_over_time(5, "five", 20_000, setpoints).unwrap()
}

pub(crate) fn add(link: &mut AnyLink, setpoints: &[i32]) {
    let info = info(setpoints.len() as u16);
    link.start_curve(Access::Add, &info).unwrap();
    for (number, setpoint) in (1..).zip(setpoints) {
        link.write_setpoint(Access::Add, &info, number, *setpoint).unwrap();
    }
}
