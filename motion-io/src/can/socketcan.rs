//! CAN interfaces of the Linux kernel.

use core::time::Duration;
use std::collections::VecDeque;
use std::io;
use std::os::fd::AsFd;
use std::time::Instant;

use pdo::Frame;
use rustix::event::{PollFd, PollFlags, poll};
use socketcan::errors::{ControllerProblems, ErrorCause};
use socketcan::{CanError, CanFrame, CanSocket, Socket, SocketOptions};

use super::{BusError, BusEvent, BusState, CanPort, Event};
use crate::endpoint::CanEndpoint;
use crate::port::{OpenError, poll_limit};

/// Room for received frames in bytes, of which the kernel counts some hundreds for each.
const RECEIVE_BUFFER: usize = 1 << 22;

struct Port {
    socket: CanSocket,
    start: Instant,
    events: VecDeque<Event>,
}

pub(super) fn open(endpoint: &CanEndpoint, interface: &str) -> Result<Box<dyn CanPort>, OpenError> {
    let failed = |error: io::Error| match error.raw_os_error() {
        // No such device, and no interface of that name.
        Some(6 | 19) => OpenError::Missing { endpoint: endpoint.to_string() },
        _ => OpenError::new(endpoint, error),
    };
    let socket = CanSocket::open(interface).map_err(failed)?;
    socket.set_nonblocking(true).map_err(failed)?;
    socket.set_error_filter_accept_all().map_err(failed)?;
    // The kernel drops what nobody has fetched in time; it gives as much room as its limit allows.
    let _ = socket.as_raw_socket().set_recv_buffer_size(RECEIVE_BUFFER);
    Ok(Box::new(Port { socket, start: Instant::now(), events: VecDeque::new() }))
}

/// An interface that somebody has taken down is gone, other than a bus that is off and comes back.
fn down(error: io::Error) -> io::Error {
    match error.raw_os_error() {
        Some(100) => io::Error::new(io::ErrorKind::NotConnected, "the interface is down"),
        _ => error,
    }
}

impl CanPort for Port {
    fn send(&mut self, frame: &Frame) -> io::Result<()> {
        let frame: CanFrame = frame.to_can().ok_or_else(|| {
            io::Error::new(io::ErrorKind::InvalidInput, "the frame is no classic CAN frame")
        })?;
        match self.socket.write_frame(&frame) {
            // No buffer space: the interface's transmit queue is full.
            Err(error) if error.raw_os_error() == Some(105) => Err(io::ErrorKind::WouldBlock.into()),
            sent => sent.map_err(down),
        }
    }

    fn receive(&mut self, timeout: Duration) -> io::Result<Option<Event>> {
        let end = self.start.elapsed().saturating_add(timeout);
        loop {
            if let Some(event) = self.events.pop_front() {
                return Ok(Some(event));
            }
            match self.socket.read_frame() {
                Ok(CanFrame::Error(frame)) => {
                    self.events.extend(events(&frame.into_error()).map(Event::Bus));
                    continue;
                }
                Ok(frame) => return Ok(Frame::from_can(&frame).map(Event::Frame)),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(down(error)),
            }
            let left = end.saturating_sub(self.start.elapsed());
            if left.is_zero() {
                return Ok(None);
            }
            let limit = poll_limit(left);
            let mut ready = [PollFd::from_borrowed_fd(self.socket.as_fd(), PollFlags::IN)];
            match poll(&mut ready, Some(&limit)) {
                Ok(_) | Err(rustix::io::Errno::INTR) => {}
                Err(error) => return Err(error.into()),
            }
        }
    }
}

/// What an error frame of the kernel tells.
fn events(error: &CanError) -> impl Iterator<Item = BusEvent> {
    error.causes().filter_map(|cause| {
        Some(match cause {
            ErrorCause::BusOff => BusEvent::State(BusState::Off),
            ErrorCause::Restarted => BusEvent::State(BusState::Active),
            ErrorCause::NoAck => BusEvent::Error(BusError::NoAcknowledge),
            ErrorCause::Protocol { .. } => BusEvent::Error(BusError::Protocol),
            ErrorCause::Transceiver { .. } => BusEvent::Error(BusError::Transceiver),
            ErrorCause::TransmitTimeout => BusEvent::Error(BusError::TransmitTimeout),
            ErrorCause::BusError => BusEvent::Error(BusError::Unspecified),
            ErrorCause::Controller(problems) => controller(*problems)?,
            // Lost arbitration is no error; counters come with a state.
            _ => return None,
        })
    })
}

fn controller(problems: ControllerProblems) -> Option<BusEvent> {
    if problems.intersects(ControllerProblems::RX_PASSIVE | ControllerProblems::TX_PASSIVE) {
        Some(BusEvent::State(BusState::Passive))
    } else if problems.intersects(ControllerProblems::RX_WARNING | ControllerProblems::TX_WARNING) {
        Some(BusEvent::State(BusState::Warning))
    } else if problems.contains(ControllerProblems::ACTIVE) {
        Some(BusEvent::State(BusState::Active))
    } else if problems.contains(ControllerProblems::RX_OVERFLOW) {
        Some(BusEvent::Overrun)
    } else if problems.contains(ControllerProblems::TX_OVERFLOW) {
        Some(BusEvent::NotSent)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_frames_become_events() {
        let said = |causes: &[ErrorCause]| {
            let error = CanError::from_iter_checked(causes.iter().copied()).unwrap();
            events(&error).collect::<Vec<_>>()
        };
        assert_eq!(said(&[ErrorCause::BusOff]), [BusEvent::State(BusState::Off)]);
        let passive = ErrorCause::Controller(ControllerProblems::TX_PASSIVE | ControllerProblems::TX_WARNING);
        let both = [passive, ErrorCause::NoAck, ErrorCause::Counters { tx: 128, rx: 0 }];
        assert_eq!(
            said(&both),
            [BusEvent::State(BusState::Passive), BusEvent::Error(BusError::NoAcknowledge)]
        );
        assert_eq!(said(&[ErrorCause::Restarted]), [BusEvent::State(BusState::Active)]);
        assert_eq!(said(&[ErrorCause::Controller(ControllerProblems::RX_OVERFLOW)]), [BusEvent::Overrun]);
    }
}
