//! A master on an open endpoint.

use core::time::Duration;

use canopen_master::master::{BusStatus, Config, Event, Master};
use canopen_master::sdo::{Options, Outcome, Ticket};
use canopen_master::{Address, NodeId};
use motion_io::can::{BusError, BusEvent, BusState, CanPort, Driver, Engine, Event as PortEvent, open};
use motion_io::endpoint::CanEndpoint;
use pdo::Frame;
use serde_json::{Value, json};

use super::cli::CanLine;
use super::network::STEP;
use super::value::hex;
use super::{interrupted, stop_flag};
use crate::cli::Global;
use crate::connect::{ChoiceOf, choose};
use crate::exit::Exit;

/// Time that a device has for each answer, unless `--timeout` says otherwise.
const ANSWER: Duration = Duration::from_millis(500);
/// Where we are the adapter, a host has so long to open its end.
const PEER: Duration = Duration::from_secs(10);
/// Time for each step of fastscan, unless `--timeout` says otherwise: adapters and servers hold answers
/// back for some milliseconds.
const FASTSCAN_STEP: Duration = Duration::from_millis(25);
/// Frames that are still to go out when a command is done wait so long for room in the transmit queue.
const FLUSH: Duration = Duration::from_millis(20);

/// Command specifier of an abort (CiA 301, 7.2.4.3.17).
const ABORT: u8 = 0x80;

type AnyMaster = Master<'static, Vec<u8>, 127>;

struct Wire(Box<AnyMaster>);

impl Engine for Wire {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        let _ = self.0.handle_frame(now, frame);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.0.handle_timeout(now);
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        self.0.poll_transmit(now)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.0.poll_timeout()
    }

    fn handle_bus(&mut self, now: Duration, event: BusEvent) {
        if let BusEvent::State(state) = event {
            self.0.handle_bus(
                now,
                match state {
                    BusState::Active => BusStatus::Active,
                    BusState::Warning => BusStatus::Warning,
                    BusState::Passive => BusStatus::Passive,
                    BusState::Off => BusStatus::Off,
                },
            );
        }
    }
}

/// How an SDO transfer was carried out, as its first frames say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Mode {
    Expedited,
    Segmented,
    Block,
}

impl Mode {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Expedited => "expedited",
            Self::Segmented => "segmented",
            Self::Block => "block",
        }
    }
}

/// What the command specifier of the frame that opens a transfer says: the server's answer to an upload,
/// the client's request of a download (CiA 301, 7.2.4.3).
fn mode_of(frame: &Frame, node: NodeId, sent: bool) -> Option<Mode> {
    let base = if sent { pdo::cob::SDO_REQUEST } else { pdo::cob::SDO_RESPONSE };
    let &[command, ..] = frame.data() else { return None };
    let expedited = if command & 2 != 0 { Mode::Expedited } else { Mode::Segmented };
    match (command >> 5, sent) {
        _ if frame.standard_id() != Some(base + u16::from(node.raw())) => None,
        (1, true) | (2, false) => Some(expedited),
        (6, _) => Some(Mode::Block),
        _ => None,
    }
}

/// An SDO transfer that did not succeed.
#[derive(Debug)]
pub(crate) struct TransferError {
    pub(crate) node: u8,
    pub(crate) at: Address,
    pub(crate) outcome: Outcome,
    /// The last frame that the node sent instead of an answer that did not come.
    pub(crate) instead: Option<Frame>,
}

impl core::fmt::Display for TransferError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match (self.outcome, self.instead) {
            (Outcome::Cancelled, _) => f.write_str("stopped"),
            (Outcome::TimedOut, Some(frame)) => {
                let shown = match frame.data() {
                    [] => "a frame without data".into(),
                    data => hex(data),
                };
                write!(f, "no answer in time; what came instead does not fit: {shown}")
            }
            (outcome, _) => outcome.fmt(f),
        }
    }
}

impl TransferError {
    /// What JSON says about it.
    pub(crate) fn json(&self) -> Value {
        let mut document = json!({ "node": self.node, "index": self.at.index, "subindex": self.at.sub, "error": self.to_string() });
        match self.outcome {
            Outcome::Aborted(code) => {
                document["abort_code"] = json!(code.0);
                document["abort"] = json!(code.text());
            }
            Outcome::GaveUp(fault) => {
                document["fault"] = json!(fault.to_string());
                document["abort_code"] = json!(fault.abort_code().0);
            }
            Outcome::TimedOut => document["abort_code"] = json!(canopen_master::sdo::AbortCode::TIMED_OUT.0),
            _ => {}
        }
        document
    }
}

impl From<TransferError> for Exit {
    fn from(error: TransferError) -> Self {
        let status = match error.outcome {
            Outcome::TimedOut => 3,
            Outcome::Aborted(_) | Outcome::GaveUp(_) => 4,
            Outcome::Cancelled => 1,
            _ => 5,
        };
        Self { status, message: format!("node {}, {}: {error}", error.node, error.at) }
    }
}

/// A master, driven.
pub(crate) struct Session {
    driver: Driver,
    wire: Wire,
    answer: Duration,
    watched: Option<(NodeId, bool)>,
    mode: Option<Mode>,
    /// What the watched node has answered since the last request.
    came: Option<Frame>,
    /// A signal ends a transfer, not the program.
    stoppable: bool,
    /// What of the bus was told last.
    told: Option<BusEvent>,
    /// Frames on the bus that nobody could read, so far.
    garbled: u32,
}

/// The endpoint that `--can`, the environment or the configuration names.
pub(crate) fn endpoint(global: &Global, line: &CanLine) -> Result<CanEndpoint, Exit> {
    choose(global, line.endpoint.as_deref(), ChoiceOf::Can)?
        .parse()
        .map_err(|error: motion_io::endpoint::EndpointError| Exit::usage(error.to_string()))
}

/// `--timeout`, or the default.
pub(crate) fn answer_time(global: &Global) -> Duration {
    global.timeout.unwrap_or(ANSWER)
}

/// A node ID.
pub(crate) fn node_id(raw: u8) -> Result<NodeId, Exit> {
    NodeId::new(raw).map_err(|error| Exit::usage(error.to_string()))
}

/// Opens an endpoint; where we are the adapter, a host has to open its end.
pub(crate) fn connect(endpoint: &CanEndpoint) -> Result<Box<dyn CanPort>, Exit> {
    let mut port = open(endpoint).map_err(|error| Exit::trouble(error.to_string()))?;
    if !port.wait_for_peer(PEER).map_err(|error| gone(&error))? {
        return Err(Exit::trouble(format!("{endpoint}: nobody has opened the other end")));
    }
    Ok(port)
}

/// The endpoint does not answer any more.
pub(crate) fn gone(error: &std::io::Error) -> Exit {
    Exit::trouble(format!("the endpoint failed: {error}"))
}

impl Session {
    pub(crate) fn open(global: &Global, line: &CanLine) -> Result<Self, Exit> {
        let answer = answer_time(global);
        let endpoint = endpoint(global, line)?;
        let port = connect(&endpoint)?;
        let mut config = Config {
            confirm: answer,
            lss: canopen_master::lss::Config {
                answer,
                fastscan_step: if global.timeout.is_some() { answer } else { FASTSCAN_STEP },
            },
            ..Config::default()
        };
        if let CanEndpoint::Slcan { bit_rate, .. } = endpoint {
            config.bit_rate = bit_rate;
        }
        let wire = Wire(Box::new(Master::new(config)));
        Ok(Self {
            driver: Driver::new(port),
            wire,
            answer,
            watched: None,
            mode: None,
            came: None,
            stoppable: false,
            told: None,
            garbled: 0,
        })
    }

    pub(crate) fn now(&self) -> Duration {
        self.driver.now()
    }

    pub(crate) fn master(&mut self) -> &mut AnyMaster {
        &mut self.wire.0
    }

    /// `--timeout`.
    pub(crate) const fn answer(&self) -> Duration {
        self.answer
    }

    /// One turn, at most until `limit`; `observe` sees all frames and bus events.
    pub(crate) fn turn(
        &mut self,
        limit: Duration,
        mut observe: impl FnMut(Duration, PortEvent, bool),
    ) -> Result<(), Exit> {
        let (watched, mode, came) = (self.watched, &mut self.mode, &mut self.came);
        let done = self.driver.turn(&mut self.wire, limit, |now, event, sent| {
            if let (PortEvent::Frame(frame), Some((node, is_upload))) = (&event, watched) {
                if mode.is_none() && sent != is_upload {
                    *mode = mode_of(frame, node, sent);
                }
                let base = if sent { pdo::cob::SDO_REQUEST } else { pdo::cob::SDO_RESPONSE };
                let abort = sent && frame.data().first() == Some(&ABORT);
                if frame.standard_id() == Some(base + u16::from(node.raw())) && !abort {
                    *came = (!sent).then_some(*frame);
                }
            }
            observe(now, event, sent);
        });
        done.map_err(|error| gone(&error))
    }

    /// One turn, at most until `limit`; what the bus says is told to the user, who may wonder why nobody
    /// answers.
    pub(crate) fn step(&mut self, limit: Duration) -> Result<(), Exit> {
        let (mut told, mut garbled) = (self.told, self.garbled);
        self.turn(limit, |_, event, _| {
            if let PortEvent::Bus(event) = event {
                garbled += u32::from(event == BusEvent::Error(BusError::Protocol));
                if told.replace(event) != Some(event) {
                    eprintln!("note: {event}");
                }
            }
        })?;
        (self.told, self.garbled) = (told, garbled);
        Ok(())
    }

    /// How many frames nobody on the bus could read, such as those of several nodes at once.
    pub(crate) const fn garbled(&self) -> u32 {
        self.garbled
    }

    /// Runs until `pick` takes an event, at most until `limit`.
    pub(crate) fn wait<T>(
        &mut self,
        limit: Duration,
        mut pick: impl FnMut(Event<Vec<u8>>) -> Option<T>,
    ) -> Result<Option<T>, Exit> {
        loop {
            while let Some(event) = self.wire.0.poll_event() {
                if let Some(picked) = pick(event) {
                    return Ok(Some(picked));
                }
            }
            if self.now() >= limit {
                return Ok(None);
            }
            self.step(limit)?;
        }
    }

    /// Lets out what is still to be sent, such as an abort or the end of a block upload.
    pub(crate) fn flush(&mut self) -> Result<(), Exit> {
        let limit = self.now() + FLUSH;
        self.step(self.now())?;
        while self.driver.is_blocked() && self.now() < limit {
            self.step(limit)?;
        }
        Ok(())
    }

    /// From now on a signal ends the transfer that is under way, or the next one, and not the program: the node
    /// is told, and what was begun can be undone.
    pub(crate) fn stop_transfers(&mut self) -> Result<(), Exit> {
        stop_flag()?;
        self.stoppable = true;
        Ok(())
    }

    fn transfer(
        &mut self,
        node: NodeId,
        at: Address,
        begin: impl FnOnce(&mut AnyMaster) -> Result<Ticket, Exit>,
    ) -> Result<Result<Vec<u8>, TransferError>, Exit> {
        (self.mode, self.came) = (None, None);
        let ticket = begin(&mut self.wire.0)?;
        let finished = loop {
            if self.stoppable && interrupted() {
                self.wire.0.cancel(node, ticket);
            }
            let finished = self.wait(self.now() + STEP, |event| match event {
                Event::Sdo { finished, .. } => Some(finished),
                _ => None,
            })?;
            if let Some(finished) = finished {
                break finished;
            }
        };
        self.watched = None;
        self.flush()?;
        Ok(match finished.outcome {
            Outcome::Done(_) => Ok(finished.buffer),
            outcome => Err(TransferError { node: node.raw(), at, outcome, instead: self.came }),
        })
    }

    fn options(&self, block: bool) -> Options {
        if block { Options::block(self.answer) } else { Options::new(self.answer) }
    }

    /// Reads an object.
    pub(crate) fn upload(
        &mut self,
        node: NodeId,
        at: Address,
        block: bool,
    ) -> Result<Result<(Vec<u8>, Mode), TransferError>, Exit> {
        let options = self.options(block);
        self.watched = Some((node, true));
        let done = self.transfer(node, at, |master| {
            let begun = master.upload(node, at, Vec::new(), &options);
            begun.map_err(|refused| Exit::trouble(refused.to_string()))
        })?;
        Ok(done.map(|data| (data, self.mode.unwrap_or(Mode::Segmented))))
    }

    /// Writes an object.
    pub(crate) fn download(
        &mut self,
        node: NodeId,
        at: Address,
        data: Vec<u8>,
        block: bool,
    ) -> Result<Result<Mode, TransferError>, Exit> {
        let options = self.options(block);
        self.watched = Some((node, false));
        let done = self.transfer(node, at, |master| {
            let begun = master.download(node, at, data, &options);
            begun.map_err(|refused| Exit::trouble(refused.to_string()))
        })?;
        Ok(done.map(|_| self.mode.unwrap_or(Mode::Segmented)))
    }
}
