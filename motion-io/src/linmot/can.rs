//! A drive on a CAN endpoint: by SDO, or by the configuration module in a PDO pair.

use core::time::Duration;
use std::io;

use linmot::client::{Client, Outcome};
use linmot::code::{Command, Status};
use linmot::link::Link;
use linmot::module::{RPDO, TPDO};
use linmot::request::{Reply, Request};
use linmot::sdo::{self, Access, Answer};
use pdo::{Frame, NodeId, cob};

use super::{BUSY, LinkError, PAUSE};
use crate::can::{CanPort, Event};

/// NMT command specifier of "start" (CiA 301, 7.2.8.3.1).
const START: u8 = 0x01;
/// Longest time for an SDO answer.
const ANSWER: Duration = Duration::from_millis(500);

/// The same after a boot-up message: the node has forgotten the request, or received it just now.
const BOOTED: Duration = Duration::from_millis(100);

/// Frames that are looked through before a request, on a bus where they never end.
const STALE: u32 = 1000;

/// Sends, waiting for room in the endpoint's queue.
fn send(port: &mut dyn CanPort, frame: &Frame, limit: Duration) -> io::Result<()> {
    let end = port.now().saturating_add(limit);
    loop {
        match port.send(frame) {
            Err(error) if error.kind() == io::ErrorKind::WouldBlock && port.now() < end => {
                port.receive(Duration::from_millis(1))?;
            }
            other => return other,
        }
    }
}

/// Whether the node has started anew.
fn is_boot_up(frame: &Frame, node: NodeId) -> bool {
    frame.standard_id() == Some(cob::ERROR_CONTROL + u16::from(node.raw())) && frame.data() == [0]
}

/// Takes what has come and belongs to nothing any more; returns whether the node has started anew.
fn drain(port: &mut dyn CanPort, node: NodeId) -> io::Result<bool> {
    let mut booted = false;
    for _ in 0..STALE {
        let Some(event) = port.receive(Duration::ZERO)? else { break };
        booted |= matches!(event, Event::Frame(frame) if is_boot_up(&frame, node));
    }
    Ok(booted)
}

/// Why a command was not answered.
fn silence(command: Command, booted: bool) -> LinkError {
    if booted { LinkError::Restarted { command } } else { LinkError::NoAnswer { command } }
}

/// A drive behind its default SDO.
pub struct SdoLink {
    port: Box<dyn CanPort>,
    node: NodeId,
    client: sdo::Client,
    answer: Duration,
    retries: u8,
    /// The node has started anew since the command began.
    booted: bool,
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
        let (client, answer) = (sdo::Client::new(), answer.unwrap_or(ANSWER));
        Self { port, node, client, answer, retries, booted: false }
    }

    /// One access; `None` when no answer came.
    fn exchange(&mut self, access: &Access) -> io::Result<Option<Answer>> {
        let node = u16::from(self.node.raw());
        // An answer that the bus has delivered twice must not be taken for the next one.
        self.booted |= drain(self.port.as_mut(), self.node)?;
        send(self.port.as_mut(), &Frame::standard(cob::SDO_REQUEST + node, access.encode()), self.answer)?;
        let mut end = self.port.now().saturating_add(self.answer);
        loop {
            let left = end.saturating_sub(self.port.now());
            if let Some(Event::Frame(frame)) = self.port.receive(left)? {
                if is_boot_up(&frame, self.node) {
                    self.booted = true;
                    end = end.min(self.port.now().saturating_add(BOOTED));
                }
                if frame.standard_id() == Some(cob::SDO_RESPONSE + node)
                    && let Ok(telegram) = <[u8; 8]>::try_from(frame.data())
                    && let Some((index, sub, answer)) = Answer::parse(telegram)
                    && (index, sub) == (access.index, access.sub)
                {
                    return Ok(Some(answer));
                }
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

    fn is_busy(&mut self) -> io::Result<bool> {
        Ok(self.exchange(&Access::flash_state())?.is_some_and(sdo::Client::is_flash_busy))
    }

    /// Flash is written and the software started while the drive answers "busy" here.
    fn wait(&mut self, command: Command) -> Result<(), LinkError> {
        let end = self.port.now().saturating_add(BUSY);
        loop {
            let answer = self.exchange(&Access::flash_state())?;
            match answer {
                // What it was doing ended with its power.
                _ if self.booted => return Err(LinkError::Restarted { command }),
                Some(answer) if sdo::Client::is_flash_busy(answer) => {}
                Some(_) => return Ok(()),
                None => return Err(LinkError::NoAnswer { command }),
            }
            let again = self.port.now().saturating_add(PAUSE);
            if again > end {
                return Err(LinkError::StillBusy { command });
            }
            while self.port.now() < again {
                if let Some(Event::Frame(frame)) = self.port.receive(again.saturating_sub(self.port.now()))? {
                    self.booted |= is_boot_up(&frame, self.node);
                }
            }
        }
    }
}

impl Link for SdoLink {
    type Error = LinkError;

    fn call(&mut self, request: &Request) -> Result<Reply, LinkError> {
        let command = request.command();
        let access = Access::new(request).ok_or(LinkError::NotCarried(command))?;
        self.booted = false;
        let mut attempts = if request.is_repeatable() { 1 + u32::from(self.retries) } else { 1 };
        let mut waited = false;
        while attempts > 0 {
            attempts -= 1;
            let Some(answer) = self.exchange(&access)? else { continue };
            let mut reply = match self.client.reply(request, answer) {
                Ok(reply) => reply,
                // Refused by a drive that is busy: nothing was carried out.
                Err(aborted) if aborted.0 == sdo::abort::STATE && !waited && self.is_busy()? => {
                    self.wait(command)?;
                    (waited, attempts) = (true, attempts + 1);
                    continue;
                }
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
        Err(silence(command, self.booted))
    }
}

/// A drive behind the configuration module, carried in RPDO 4 and TPDO 4 (project-defined). A node takes
/// PDOs in operational only (CiA 301, 7.3.2.2.3): it is started with the first command, and again after
/// it has started anew.
pub struct PdoLink {
    port: Box<dyn CanPort>,
    node: NodeId,
    client: Client,
    /// The node has been told to start.
    operational: bool,
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
        Self { port, node, client, operational: false }
    }

    /// The node has started anew.
    fn booted(&mut self) {
        self.operational = false;
        // It would carry a repeated image out once more.
        self.client.handle_restart();
    }

    fn turn(&mut self) -> io::Result<()> {
        let node = u16::from(self.node.raw());
        if !core::mem::replace(&mut self.operational, true) {
            send(self.port.as_mut(), &Frame::standard(cob::NMT, [START, self.node.raw()]), ANSWER)?;
        }
        if let Some(image) = self.client.poll_transmit(self.port.now()) {
            send(self.port.as_mut(), &Frame::standard(RPDO + node, image), ANSWER)?;
        }
        let now = self.port.now();
        let timeout = self.client.poll_timeout().map_or(Duration::ZERO, |at| at.saturating_sub(now));
        let event = self.port.receive(timeout)?;
        let now = self.port.now();
        if let Some(Event::Frame(frame)) = event {
            if is_boot_up(&frame, self.node) {
                self.booted();
            } else if frame.standard_id() == Some(TPDO + node)
                && let Ok(image) = <[u8; 8]>::try_from(frame.data())
            {
                self.client.handle_input(now, image);
            }
        }
        self.client.handle_timeout(now);
        Ok(())
    }
}

impl Link for PdoLink {
    type Error = LinkError;

    fn call(&mut self, request: &Request) -> Result<Reply, LinkError> {
        let command = request.command();
        if drain(self.port.as_mut(), self.node)? {
            self.booted();
        }
        let ticket = self.client.submit(request).map_err(|_| io::Error::from(io::ErrorKind::Interrupted))?;
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
        Err(match outcome {
            Outcome::Done(reply) | Outcome::Refused(reply) => return Ok(reply),
            Outcome::StillRunning(_) => LinkError::StillBusy { command },
            Outcome::Restarted => LinkError::Restarted { command },
            Outcome::WrongEcho { expected, found } => {
                let found = format!("count {found}, {expected} expected");
                LinkError::WrongEcho { command, found }
            }
            Outcome::NoEcho { expected, shown: Some(shown) } => {
                LinkError::NoEcho { command, expected, shown }
            }
            _ => {
                self.operational = false;
                LinkError::NoAnswer { command }
            }
        })
    }
}
