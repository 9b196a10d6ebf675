//! A drive on a CAN endpoint: by SDO, or by the configuration module in a PDO pair.

use core::time::Duration;
use std::io;
use std::time::Instant;

use linmot::client::{Client, Outcome};
use linmot::code::Status;
use linmot::link::Link;
use linmot::module::{RPDO, TPDO};
use linmot::request::{Reply, Request};
use linmot::sdo::{self, Access, Answer};
use pdo::{Frame, NodeId};

use super::{BUSY, LinkError, PAUSE};
use crate::can::{CanPort, Event};

/// COB-IDs of the default SDO without node ID (CiA 301).
const SDO_REQUEST: u16 = 0x600;
const SDO_ANSWER: u16 = 0x580;
/// Longest time for an SDO answer.
const ANSWER: Duration = Duration::from_millis(500);

/// Sends, waiting for room in the endpoint's queue.
fn send(port: &mut dyn CanPort, frame: &Frame, limit: Duration) -> io::Result<()> {
    let began = Instant::now();
    loop {
        match port.send(frame) {
            Err(error) if error.kind() == io::ErrorKind::WouldBlock && began.elapsed() < limit => {
                port.receive(Duration::from_millis(1))?;
            }
            other => return other,
        }
    }
}

/// A drive behind its default SDO.
pub struct SdoLink {
    port: Box<dyn CanPort>,
    node: NodeId,
    client: sdo::Client,
    answer: Duration,
    retries: u8,
}

impl core::fmt::Debug for SdoLink {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("SdoLink").field("node", &self.node).finish_non_exhaustive()
    }
}

impl SdoLink {
    /// The drive `node` on `port`; reads are repeated up to `retries` times. `answer` is the longest
    /// time for one answer, 0.5 s by default.
    #[must_use]
    pub fn new(port: Box<dyn CanPort>, node: NodeId, answer: Option<Duration>, retries: u8) -> Self {
        Self { port, node, client: sdo::Client::new(), answer: answer.unwrap_or(ANSWER), retries }
    }

    /// One access; `None` when no answer came.
    fn exchange(&mut self, access: &Access) -> io::Result<Option<Answer>> {
        let node = u16::from(self.node.raw());
        send(self.port.as_mut(), &Frame::standard(SDO_REQUEST + node, access.encode()), self.answer)?;
        let began = Instant::now();
        loop {
            let left = self.answer.saturating_sub(began.elapsed());
            let event = self.port.receive(left)?;
            if let Some(Event::Frame(frame)) = event
                && frame.standard_id() == Some(SDO_ANSWER + node)
                && let Ok(telegram) = <[u8; 8]>::try_from(frame.data())
                && let Some((index, sub, answer)) = Answer::parse(telegram)
                && (index, sub) == (access.index, access.sub)
            {
                return Ok(Some(answer));
            }
            if left.is_zero() {
                return Ok(None);
            }
        }
    }

    /// What the drive says about the curve or command table command that it has just aborted.
    fn result(&mut self, request: &Request) -> io::Result<Option<Reply>> {
        let Some(access) = Access::result(request) else { return Ok(None) };
        Ok(match self.exchange(&access)? {
            Some(Answer::Read([result, ..])) if result != 0 => {
                let [first, ..] = request.words();
                Some(Reply::new(Status(result), [first, 0, 0]))
            }
            _ => None,
        })
    }

    /// Flash is written and the software started while the drive answers "busy" here.
    fn wait(&mut self, command: linmot::code::Command) -> Result<(), LinkError> {
        let began = Instant::now();
        loop {
            match self.exchange(&Access::flash_state())? {
                Some(answer) if sdo::Client::is_flash_busy(answer) => {}
                Some(_) => return Ok(()),
                None => return Err(LinkError::NoAnswer { command }),
            }
            if began.elapsed() > BUSY {
                return Err(LinkError::StillBusy { command });
            }
            std::thread::sleep(PAUSE);
        }
    }
}

impl Link for SdoLink {
    type Error = LinkError;

    fn call(&mut self, request: &Request) -> Result<Reply, LinkError> {
        let command = request.command();
        let access = Access::new(request).ok_or(LinkError::NotCarried(command))?;
        let attempts = if request.is_repeatable() { 1 + u32::from(self.retries) } else { 1 };
        for _ in 0..attempts {
            let Some(answer) = self.exchange(&access)? else { continue };
            let mut reply = match self.client.reply(request, answer) {
                Ok(reply) => reply,
                Err(aborted) => {
                    let result = self.result(request)?;
                    return result.ok_or(LinkError::Aborted { command, aborted });
                }
            };
            if reply.status.is_running() {
                self.wait(command)?;
                reply.status = Status::OK;
            }
            return Ok(reply);
        }
        Err(LinkError::NoAnswer { command })
    }
}

/// A drive behind the configuration module, carried in RPDO 4 and TPDO 4 (project-defined).
pub struct PdoLink {
    port: Box<dyn CanPort>,
    node: NodeId,
    client: Client,
    start: Instant,
}

impl core::fmt::Debug for PdoLink {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("PdoLink").field("node", &self.node).finish_non_exhaustive()
    }
}

impl PdoLink {
    /// The drive `node` on `port`.
    #[must_use]
    pub fn new(port: Box<dyn CanPort>, node: NodeId, client: Client) -> Self {
        Self { port, node, client, start: Instant::now() }
    }

    fn turn(&mut self) -> io::Result<()> {
        let node = u16::from(self.node.raw());
        if let Some(image) = self.client.poll_transmit(self.start.elapsed()) {
            send(self.port.as_mut(), &Frame::standard(RPDO + node, image), ANSWER)?;
        }
        let now = self.start.elapsed();
        let timeout = self.client.poll_timeout().map_or(Duration::ZERO, |at| at.saturating_sub(now));
        let event = self.port.receive(timeout)?;
        let now = self.start.elapsed();
        if let Some(Event::Frame(frame)) = event
            && frame.standard_id() == Some(TPDO + node)
            && let Ok(image) = <[u8; 8]>::try_from(frame.data())
        {
            self.client.handle_input(now, image);
        }
        self.client.handle_timeout(now);
        Ok(())
    }
}

impl Link for PdoLink {
    type Error = LinkError;

    fn call(&mut self, request: &Request) -> Result<Reply, LinkError> {
        let command = request.command();
        let began = Instant::now();
        loop {
            let ticket =
                self.client.submit(request).map_err(|_| io::Error::from(io::ErrorKind::Interrupted))?;
            let outcome = loop {
                if let Some(event) = self.client.poll_event() {
                    break event.outcome;
                }
                if let Err(error) = self.turn() {
                    self.client.cancel(ticket);
                    self.client.poll_event();
                    return Err(error.into());
                }
            };
            return Err(match outcome {
                Outcome::Done(reply) | Outcome::Refused(reply) => return Ok(reply),
                Outcome::StillRunning(_) if began.elapsed() < BUSY => continue,
                Outcome::StillRunning(_) => LinkError::StillBusy { command },
                Outcome::Restarted => LinkError::Restarted { command },
                Outcome::WrongEcho { expected, found } => {
                    let found = format!("count {found}, {expected} expected");
                    LinkError::WrongEcho { command, found }
                }
                _ => LinkError::NoAnswer { command },
            });
        }
    }
}
