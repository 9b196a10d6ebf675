//! From the command line to a link, and from a link's errors to exit codes.

use std::io;

use linmot::code::Status;
use linmot::link::{Fault, Link};
use linmot::linrs::{Checksum, Config};
use linmot::request::{Reply, Request};
use motion_io::linmot::transfer::TransferError;
use motion_io::linmot::{LinRsLink, LinkError, PdoLink, SdoLink};
use motion_io::port::{Role, open};
use pdo::NodeId;

use super::cli::{Carrier, Drive, SumKind};
use crate::can::{interrupted, stop_flag};
use crate::cli::Global;
use crate::connect::{ChoiceOf, choose};
use crate::exit::Exit;

/// Reads are repeated so often.
const RETRIES: u8 = 2;

/// Any carrier. A signal that asks the program to stop ends the command that comes next, once: what was to be
/// done is told as after any other trouble, and what puts the drive in order again still passes.
pub(crate) struct AnyLink(Box<dyn Link<Error = LinkError>>);

impl Link for AnyLink {
    type Error = LinkError;

    fn call(&mut self, request: &Request) -> Result<Reply, LinkError> {
        if interrupted() {
            return Err(LinkError::Port(io::Error::other("stopped by a signal")));
        }
        self.0.call(request)
    }
}

pub(super) fn checksum(sum: SumKind) -> Checksum {
    match sum {
        SumKind::None => Checksum::None,
        SumKind::Bytes => Checksum::Sum,
        SumKind::Crc => Checksum::Crc,
    }
}

pub(super) fn connect(global: &Global, drive: &Drive) -> Result<AnyLink, Exit> {
    stop_flag()?;
    let (carrier, endpoint) = endpoint(global, drive)?;
    let wrong = |error: motion_io::endpoint::EndpointError| Exit::usage(error.to_string());
    if carrier == ChoiceOf::Port {
        let endpoint = endpoint.parse().map_err(wrong)?;
        let mut config = Config::new(drive.node);
        config.checksum = checksum(drive.checksum);
        config.answer = global.timeout.unwrap_or(config.answer);
        let port = open(&endpoint, Role::Master).map_err(|error| Exit::trouble(error.to_string()))?;
        return Ok(AnyLink(Box::new(LinRsLink::new(port, config, RETRIES))));
    }
    let node = NodeId::new(drive.node).map_err(|error| Exit::usage(format!("--node: {error}")))?;
    let endpoint = endpoint.parse().map_err(wrong)?;
    let port = motion_io::can::open(&endpoint).map_err(|error| Exit::trouble(error.to_string()))?;
    Ok(AnyLink(match drive.carrier {
        Carrier::Sdo => Box::new(SdoLink::new(port, node, global.timeout, RETRIES)),
        Carrier::Pdo => {
            let mut config = linmot::client::Config::default();
            config.echo = global.timeout.unwrap_or(config.echo);
            Box::new(PdoLink::new(port, node, linmot::client::Client::new(config)))
        }
    }))
}

/// What names the drive's endpoint, and of which kind it is: the command line before the environment before
/// the configuration, and in each of them a CAN endpoint before a serial one.
fn endpoint(global: &Global, drive: &Drive) -> Result<(ChoiceOf, String), Exit> {
    let environment = |name| std::env::var(name).ok().filter(|text| !text.is_empty());
    let named = [
        (ChoiceOf::Can, drive.can.clone()),
        (ChoiceOf::Port, drive.port.clone()),
        (ChoiceOf::Can, environment("MOTIONCTL_CAN")),
        (ChoiceOf::Port, environment("MOTIONCTL_PORT")),
    ];
    for (kind, text) in named {
        if text.is_some() {
            return Ok((kind, choose(global, text.as_deref(), kind)?));
        }
    }
    let configured =
        [ChoiceOf::Can, ChoiceOf::Port].into_iter().find_map(|kind| match choose(global, None, kind) {
            Ok(text) => Some(Ok((kind, text))),
            Err(exit) if exit.status == 2 => None,
            Err(exit) => Some(Err(exit)),
        });
    configured.unwrap_or_else(|| {
        Err(Exit::usage(
            "no drive: --can EP, --port EP, MOTIONCTL_CAN, MOTIONCTL_PORT, or `can` or `port` in the \
             configuration file expected",
        ))
    })
}

impl From<LinkError> for Exit {
    fn from(error: LinkError) -> Self {
        let status = match error {
            LinkError::NoAnswer { .. }
            | LinkError::Silence { .. }
            | LinkError::NoEcho { .. }
            | LinkError::StillBusy { .. } => 3,
            LinkError::WrongEcho { .. } | LinkError::Restarted { .. } | LinkError::Aborted { .. } => 4,
            LinkError::NotCarried(_) => 2,
            _ => 5,
        };
        let mut message = error.to_string();
        if matches!(error, LinkError::Silence { .. }) {
            message += "; --node, baud=… of the endpoint and --checksum are to be as the drive's are";
        }
        Self { status, message }
    }
}

impl From<Fault<LinkError>> for Exit {
    fn from(fault: Fault<LinkError>) -> Self {
        match fault {
            Fault::Carrier(error) => error.into(),
            Fault::Refused { request, reply } => {
                let words = hint(&request, reply.status);
                Self::refused(format!("{}{words}", Fault::<LinkError>::Refused { request, reply }))
            }
            Fault::ReadBack { .. } | Fault::TextReadBack { .. } => Self::check(fault.to_string()),
            other => Self::refused(other.to_string()),
        }
    }
}

impl From<TransferError<LinkError>> for Exit {
    fn from(error: TransferError<LinkError>) -> Self {
        match error {
            TransferError::Drive(fault) => fault.into(),
            TransferError::File(_) | TransferError::Check { .. } => Self::trouble(error.to_string()),
            other => Self::check(other.to_string()),
        }
    }
}

/// What a status means for this command, where its text leaves it open.
fn hint(request: &Request, status: Status) -> &'static str {
    match (status, request) {
        (Status::UPID, _) => ": the drive has no such parameter",
        (Status::USAGE, Request::Write { memory: linmot::request::Memory::Ram, .. }) => {
            ": read-only, or not live, so that only its ROM value can be written"
        }
        (Status::USAGE, Request::Write { memory: linmot::request::Memory::Rom, .. }) => {
            ": its ROM value cannot be written"
        }
        (Status::USAGE, Request::Write { .. }) => ": its RAM or its ROM value cannot be written",
        (Status::RANGE, Request::Write { .. }) => ": below the minimum or above the maximum",
        (Status::TYPE, _) => ": a string, read and written by its stringlets",
        (Status::DEFINED, Request::StartCurve { access: linmot::request::Access::Add, .. }) => {
            ": a curve with this ID exists"
        }
        (Status::DEFINED, Request::StartCurve { .. }) => ": no such curve",
        (Status::DEFINED, _) => ": no such entry",
        (Status::ODD_ADDRESS, _) => ": the block was finished already",
        (Status::NOT_STOPPED, _) => {
            ": it was stopped for this, and something has started it again; nothing was saved"
        }
        _ => "",
    }
}
