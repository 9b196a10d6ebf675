//! LinMot drives on an open port: links for the client's side, and a virtual or real drive served.

mod can;
pub mod curve_file;
mod lines;
pub mod transfer;

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::io;
use std::time::Instant;

use linmot::code::Command;
use linmot::drive::Drive;
use linmot::link::Link;
use linmot::linrs::{Config, MAX_FRAME, Master, Outcome, Slave, SubmitError};
use linmot::request::{Reply, Request};

pub use can::{PdoLink, SdoLink};

use crate::port::Port;

/// Why no answer came.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LinkError {
    /// Nothing, or nothing complete, came in time.
    #[error("no answer to {command}; the drive is off, restarting, or has another ID{}", unknown(*.command))]
    NoAnswer {
        /// What was asked.
        command: Command,
    },
    /// The same of a serial line, where more must agree.
    #[error(
        "no answer to {command}; the drive is off, restarting, or has another ID, baud rate or checksum{}",
        unknown(*.command)
    )]
    Silence {
        /// What was asked.
        command: Command,
    },
    /// Answers come, but they show the count of an earlier command.
    #[error(
        "the drive does not echo count {expected} of {command}, it shows count {shown} still{}",
        unknown(*.command)
    )]
    NoEcho {
        /// What was asked.
        command: Command,
        /// Sent with it.
        expected: u8,
        /// What the drive shows.
        shown: u8,
    },
    /// The drive restarted while the command was under way.
    #[error("the drive restarted during {command}{}", unknown(*.command))]
    Restarted {
        /// What was asked.
        command: Command,
    },
    /// Something answered that does not belong to the command.
    #[error("wrong answer to {command}: {found}{}", unknown(*.command))]
    WrongEcho {
        /// What was asked.
        command: Command,
        /// What came, in words.
        found: String,
    },
    /// The drive says "busy" for longer than anything takes.
    #[error("the drive is still busy with {command}{}", unknown(*.command))]
    StillBusy {
        /// What was asked.
        command: Command,
    },
    /// The drive aborted an SDO transfer.
    #[error("{command}: {aborted}")]
    Aborted {
        /// What was asked.
        command: Command,
        /// With which code.
        aborted: linmot::sdo::Aborted,
    },
    /// The carrier has no form for the command.
    #[error("this connection cannot carry {0}")]
    NotCarried(Command),
    /// The endpoint failed or is gone.
    #[error("the port failed: {0}")]
    Port(#[from] io::Error),
}

/// What is left open by a command that was not answered.
fn unknown(command: Command) -> &'static str {
    if command.is_reading() { "" } else { "; it may have been carried out all the same" }
}

/// How long a drive that says "busy" is asked again.
const BUSY: Duration = Duration::from_secs(15);
/// Between two questions to a busy drive.
const PAUSE: Duration = Duration::from_millis(20);

/// A drive behind LinRS on a serial endpoint.
pub struct LinRsLink {
    port: Box<dyn Port>,
    master: Master,
    retries: u8,
}

impl core::fmt::Debug for LinRsLink {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("LinRsLink").field("retries", &self.retries).finish_non_exhaustive()
    }
}

impl LinRsLink {
    /// A master on `port` that repeats reads up to `retries` times.
    #[must_use]
    pub fn new(port: Box<dyn Port>, config: Config, retries: u8) -> Self {
        Self { port, master: Master::new(config), retries }
    }

    fn once(&mut self, request: &Request) -> Result<Outcome, LinkError> {
        let retries = if request.is_repeatable() { self.retries } else { 0 };
        let ticket = match self.master.submit(request, retries) {
            Ok(ticket) => ticket,
            // Every call polls its own outcome, and repeats only what may be.
            Err(SubmitError::Busy | SubmitError::NotRepeatable | _) => {
                return Err(io::Error::from(io::ErrorKind::Interrupted).into());
            }
        };
        let mut buffer = [0; 4 * MAX_FRAME];
        loop {
            if let Some(event) = self.master.poll_event() {
                return Ok(event.outcome);
            }
            if let Err(error) = self.turn(&mut buffer) {
                self.master.cancel(ticket);
                self.master.poll_event();
                return Err(error.into());
            }
        }
    }

    fn turn(&mut self, buffer: &mut [u8]) -> io::Result<()> {
        if let Some(bytes) = self.master.poll_transmit(self.port.now()) {
            self.port.send(bytes)?;
            self.master.handle_transmit_done(self.port.now());
        }
        let now = self.port.now();
        let timeout = self.master.poll_timeout().map_or(Duration::ZERO, |at| at.saturating_sub(now));
        let len = self.port.receive(buffer, timeout)?;
        let now = self.port.now();
        self.master.handle_bytes(now, buffer.get(..len).unwrap_or(&[]));
        self.master.handle_timeout(now);
        Ok(())
    }
}

impl Link for LinRsLink {
    type Error = LinkError;

    fn call(&mut self, request: &Request) -> Result<Reply, LinkError> {
        let command = request.command();
        let end = self.port.now().saturating_add(BUSY);
        loop {
            let outcome = self.once(request)?;
            if Master::is_later(&outcome) {
                let again = self.port.now().saturating_add(PAUSE);
                if again > end {
                    return Err(LinkError::StillBusy { command });
                }
                // What still comes belongs to nothing.
                while self.port.now() < again {
                    let left = again.saturating_sub(self.port.now());
                    self.port.receive(&mut [0; MAX_FRAME], left)?;
                }
                continue;
            }
            return match outcome {
                Outcome::Done(reply) | Outcome::Refused(reply) => Ok(reply),
                Outcome::WrongEcho { sub, main } => {
                    let found = format!("message {main:02X}h, sub ID {sub:02X}h");
                    Err(LinkError::WrongEcho { command, found })
                }
                _ => Err(LinkError::Silence { command }),
            };
        }
    }
}

/// Answers LinRS for `drive` on `port` until `stop` is set. `pass` is called between frames with the
/// time since the start.
///
/// # Errors
/// The port failed or is gone.
pub fn serve_linrs<D: Drive>(
    port: &mut dyn Port,
    slave: &mut Slave,
    drive: &mut D,
    stop: &AtomicBool,
    mut pass: impl FnMut(&mut D, Duration) -> io::Result<()>,
) -> io::Result<()> {
    const TURN: Duration = Duration::from_millis(20);
    let start = Instant::now();
    let mut buffer = [0; 4 * MAX_FRAME];
    while !stop.load(Ordering::Relaxed) {
        let now = start.elapsed();
        let timeout = slave.poll_timeout(drive).map_or(TURN, |at| at.saturating_sub(now).min(TURN));
        let len = port.receive(&mut buffer, timeout)?;
        let now = start.elapsed();
        slave.handle_timeout(now, drive);
        slave.handle_bytes(now, buffer.get(..len).unwrap_or(&[]), drive);
        if let Some(answer) = slave.poll_transmit(now) {
            port.send(answer)?;
        }
        drive.advance(now);
        pass(drive, now)?;
    }
    Ok(())
}
