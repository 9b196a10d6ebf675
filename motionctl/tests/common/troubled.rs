//! A virtual LinMot drive on a pseudo-terminal, on a wire where something happens to single commands.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::collections::VecDeque;
use std::sync::Arc;
use std::thread::JoinHandle;

use device_sim::can::Node;
use device_sim::linmot::{CanDrive, Times, VirtualDrive, sg5};
use linmot::code::Command;
use linmot::drive::{Drive, Parameter};
use linmot::linrs::{Checksum, Decoder, MAX_FRAME, Slave};
use linmot::module::{Output, RPDO, TPDO};
use linmot::request::Request;
use linmot::sdo::Access;
use motion_io::can::Driver;
use motion_io::port::{Port, Role, open};
use pdo::{Frame, NodeId, cob};

use crate::common::Bench;

/// What happens to a command and its answer.
#[allow(dead_code)] // not in every test program
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Happens {
    Nothing,
    /// The answer is lost, and those to its repetitions.
    AnswerLost,
    AnswerTwice,
    /// The command comes twice, and only the second answer arrives.
    Twice,
    /// Power fails before the command is carried out.
    PowerFails,
    /// Something else has started the MC software.
    Started,
    /// The configuration module shows this count.
    Count(u8),
    /// The configuration module goes on showing what it showed.
    Stale,
}

/// Tells of every command what happens to it.
pub(crate) type Script = Box<dyn FnMut(Command) -> Happens + Send>;

const TIMES: Times =
    Times { restart: Duration::from_millis(50), start: Duration::ZERO, flash: Duration::ZERO };

/// The drive with ID 1, until dropped.
pub(crate) struct Troubled {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Troubled {
    /// On LINE, for `--can slcan:LINE` or for `--port LINE`.
    #[allow(dead_code)] // not in every test program
    pub(crate) fn new(bench: &Bench, can: bool, script: Script) -> Self {
        Self::with(bench, can, sg5(), script)
    }

    /// The same with other parameters.
    pub(crate) fn with(bench: &Bench, can: bool, tree: Vec<Parameter>, script: Script) -> Self {
        let line = bench.path("LINE");
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        let drive = VirtualDrive::new(tree, TIMES);
        let thread = if can {
            let port =
                motion_io::can::open(&format!("slcan-pty:{}", line.display()).parse().unwrap()).unwrap();
            let mut driver = Driver::new(port);
            let mut station = Station {
                node: CanDrive::new(drive, NodeId::new(1).ok(), 1),
                script,
                out: VecDeque::new(),
                shown: None,
                asked: None,
            };
            std::thread::spawn(move || {
                while !stopped.load(Ordering::Relaxed) {
                    let limit = driver.now() + Duration::from_millis(5);
                    // Nobody may be at the other end yet, or any more.
                    let _ = driver.turn(&mut station, limit, |_, _, _| ());
                }
            })
        } else {
            let port = open(&format!("pty:{}", line.display()).parse().unwrap(), Role::Device).unwrap();
            let slave = Slave::new(1, Checksum::None);
            let mut line = Line { port, slave, drive, script, decoder: Decoder::new(Checksum::None) };
            std::thread::spawn(move || {
                while !stopped.load(Ordering::Relaxed) {
                    line.turn();
                }
            })
        };
        Self { stop, thread: Some(thread) }
    }
}

impl Drop for Troubled {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Station {
    node: CanDrive,
    script: Script,
    out: VecDeque<Frame>,
    /// The module's last answer.
    shown: Option<Frame>,
    /// The last command to the module, and what happened to it.
    asked: Option<(Frame, Happens)>,
}

/// The command that a frame carries.
fn command(frame: &Frame) -> Option<Command> {
    let data = <[u8; 8]>::try_from(frame.data()).ok()?;
    match frame.standard_id()? & 0x780 {
        cob::SDO_REQUEST => Access::parse(data)?.request(false).map(|request| request.command()),
        RPDO => Some(Output::parse(data).command),
        _ => None,
    }
}

/// The frame as a second one that is seen as new.
fn again(frame: &Frame) -> Frame {
    let mut data = frame.data().to_vec();
    if frame.standard_id().unwrap() & 0x780 == RPDO {
        data[0] ^= 0x08;
    }
    Frame::standard(frame.standard_id().unwrap(), <[u8; 8]>::try_from(data).unwrap())
}

impl Station {
    fn answers(&mut self, now: Duration) -> Vec<Frame> {
        core::iter::from_fn(|| self.node.poll_transmit(now)).collect()
    }
}

impl Node for Station {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        let Some(command) = command(frame) else { return self.node.handle_frame(now, frame) };
        let happens = match self.asked {
            // An image that is sent again is no new command.
            Some((before, happens)) if before == *frame && frame.standard_id() == Some(RPDO + 1) => happens,
            _ => (self.script)(command),
        };
        // Power fails once.
        let repeated = if happens == Happens::PowerFails { Happens::Nothing } else { happens };
        self.asked = Some((*frame, repeated));
        match happens {
            Happens::PowerFails => return self.node.power_cycle(now),
            Happens::Started => {
                self.node.drive_mut().start(now);
            }
            Happens::Twice => {
                self.node.handle_frame(now, &again(frame));
                self.answers(now);
            }
            _ => {}
        }
        self.node.handle_frame(now, frame);
        for answer in self.answers(now) {
            let module = answer.standard_id() == Some(TPDO + 1);
            match happens {
                Happens::AnswerLost => {}
                Happens::AnswerTwice => self.out.extend([answer; 2]),
                Happens::Stale if module => self.out.extend(self.shown),
                Happens::Count(count) if module => {
                    let mut data = <[u8; 8]>::try_from(answer.data()).unwrap();
                    data[0] = data[0] & 0xF0 | count;
                    self.out.push_back(Frame::standard(TPDO + 1, data));
                }
                _ => {
                    self.shown = if module { Some(answer) } else { self.shown };
                    self.out.push_back(answer);
                }
            }
        }
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.node.handle_timeout(now);
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        self.out.pop_front().or_else(|| self.node.poll_transmit(now))
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.node.poll_timeout()
    }
}

struct Line {
    port: Box<dyn Port>,
    slave: Slave,
    drive: VirtualDrive,
    script: Script,
    decoder: Decoder,
}

impl Line {
    fn turn(&mut self) {
        let mut buffer = [0; 256];
        // Nobody may be at the other end yet, or any more.
        let len = self.port.receive(&mut buffer, Duration::from_millis(5)).unwrap_or(0);
        let mut came = &buffer[..len];
        self.slave.handle_timeout(self.port.now(), &mut self.drive);
        self.drive.advance(self.port.now());
        while let (taken, Some(message)) = self.decoder.decode(came) {
            came = &came[taken..];
            let happens =
                linmot::linrs::request(&message).as_ref().map(Request::command).map(&mut self.script);
            let mut frame = [0; MAX_FRAME];
            let len = message.encode(Checksum::None, &mut frame);
            self.serve(&frame[..len], happens.unwrap_or(Happens::Nothing));
        }
    }

    fn serve(&mut self, frame: &[u8], happens: Happens) {
        let now = self.port.now();
        match happens {
            Happens::PowerFails => return self.drive.power_cycle(now),
            Happens::Started => {
                self.drive.start(now);
            }
            Happens::Twice => {
                self.slave.handle_bytes(now, frame, &mut self.drive);
                self.slave.poll_transmit(now);
            }
            _ => {}
        }
        self.slave.handle_bytes(now, frame, &mut self.drive);
        let Some(answer) = self.slave.poll_transmit(now) else { return };
        let times = match happens {
            Happens::AnswerLost => 0,
            Happens::AnswerTwice => 2,
            _ => 1,
        };
        for _ in 0..times {
            let _ = self.port.send(answer);
        }
    }
}
