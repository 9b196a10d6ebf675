//! CAN interfaces of the Linux kernel.

use core::time::Duration;
use std::collections::VecDeque;
use std::io;
use std::io::IoSliceMut;
use std::os::fd::{AsFd, AsRawFd};
use std::time::Instant;

use embedded_can::{ExtendedId, Id, StandardId};
use nix::sys::socket::{ControlMessageOwned, MsgFlags, recvmsg, setsockopt, sockopt};
use pdo::Frame;
use rustix::event::{PollFd, PollFlags, poll};
use socketcan::errors::{ControllerProblems, ErrorCause};
use socketcan::{CanError, CanErrorFrame, CanFrame, CanSocket, Socket, SocketOptions};

use super::{BusError, BusEvent, BusState, CanPort, Event};
use crate::endpoint::CanEndpoint;
use crate::port::{OpenError, poll_limit};

/// Room for received frames in bytes, of which the kernel counts some hundreds for each.
const RECEIVE_BUFFER: usize = 1 << 22;

struct Port {
    socket: CanSocket,
    start: Instant,
    events: VecDeque<Event>,
    /// Frames that the kernel has dropped because nobody fetched them, as it counts them.
    dropped: u32,
    /// Room for what the kernel says beside a frame.
    beside: Vec<u8>,
}

pub(super) fn open(endpoint: &CanEndpoint, interface: &str) -> Result<Box<dyn CanPort>, OpenError> {
    Ok(Box::new(Port::open(endpoint, interface)?))
}

/// The same, with a handle that tells when there is something to receive.
#[cfg(feature = "tokio")]
pub(super) fn open_with_handle(
    endpoint: &CanEndpoint,
    interface: &str,
) -> Result<(Box<dyn CanPort>, std::os::fd::OwnedFd), OpenError> {
    let port = Port::open(endpoint, interface)?;
    let handle = port.socket.as_fd().try_clone_to_owned().map_err(|error| OpenError::new(endpoint, error))?;
    Ok((Box::new(port), handle))
}

impl Port {
    fn open(endpoint: &CanEndpoint, interface: &str) -> Result<Self, OpenError> {
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
        // With what is dropped nevertheless, its number comes beside the frame after it.
        setsockopt(&socket, sockopt::RxqOvfl, &1).map_err(|error| failed(error.into()))?;
        Ok(Self {
            socket,
            start: Instant::now(),
            events: VecDeque::new(),
            dropped: 0,
            beside: nix::cmsg_space!(u32),
        })
    }
}

impl Port {
    /// Takes one frame from the kernel, as events.
    fn fetch(&mut self) -> io::Result<()> {
        let mut raw = [0; FRAME];
        let mut room = [IoSliceMut::new(&mut raw)];
        let socket = self.socket.as_raw_socket().as_raw_fd();
        let message = recvmsg::<()>(socket, &mut room, Some(&mut self.beside), MsgFlags::empty())?;
        let dropped = message.cmsgs()?.find_map(|beside| match beside {
            ControlMessageOwned::RxqOvfl(dropped) => Some(dropped),
            _ => None,
        });
        let len = message.bytes;
        if dropped.is_some_and(|dropped| dropped != self.dropped) {
            self.dropped = dropped.unwrap_or_default();
            self.events.push_back(Event::Bus(BusEvent::Overrun));
        }
        let came = raw.get(..len).and_then(|raw| <&[u8; FRAME]>::try_from(raw).ok()).ok_or_else(|| {
            io::Error::new(
                io::ErrorKind::InvalidData,
                format!("a frame of {FRAME} bytes expected, {len} came"),
            )
        })?;
        read(came, &mut self.events);
        Ok(())
    }
}

/// Bytes of a `struct can_frame` (linux/can.h): identifier and flags, length, 3 bytes, data.
const FRAME: usize = 16;
const EXTENDED: u32 = 1 << 31;
const REMOTE: u32 = 1 << 30;
const ERROR: u32 = 1 << 29;

/// What a `struct can_frame` says; nothing of one that is no classic frame.
fn read(raw: &[u8; FRAME], to: &mut VecDeque<Event>) {
    let &[a, b, c, d, len, _, _, _, ref data @ ..] = raw;
    let (word, len) = (u32::from_ne_bytes([a, b, c, d]), usize::from(len));
    let Some(data) = data.get(..len) else { return };
    if word & ERROR != 0 {
        if let Ok(frame) = CanErrorFrame::new_error(word & (ERROR - 1), data) {
            to.extend(events(&frame.into_error()).map(Event::Bus));
        }
        return;
    }
    let raw_id = word & (ERROR - 1);
    let id = if word & EXTENDED != 0 {
        ExtendedId::new(raw_id).map(Id::Extended)
    } else {
        StandardId::new((raw_id & 0x7FF) as u16).map(Id::Standard)
    };
    let frame = id.and_then(|id| {
        if word & REMOTE != 0 { Frame::remote_frame(id, len) } else { Frame::data_frame(id, data) }
    });
    to.extend(frame.map(Event::Frame));
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
            match self.fetch() {
                Ok(()) => continue,
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

    #[test]
    fn kernel_frames_become_events() {
        let said = |word: u32, len: u8, data: [u8; 8]| {
            let mut raw = [0xA5; FRAME];
            raw[..4].copy_from_slice(&word.to_ne_bytes());
            raw[4] = len;
            raw[8..].copy_from_slice(&data);
            let mut to = VecDeque::new();
            read(&raw, &mut to);
            Vec::from(to)
        };
        let data = [1, 2, 3, 4, 5, 6, 7, 8];
        assert_eq!(said(0x581, 8, data), [Event::Frame(Frame::standard(0x581, data))]);
        assert_eq!(said(0x80, 0, data), [Event::Frame(Frame::standard(0x80, []))]);
        let extended = ExtendedId::new(0x1234_5678).unwrap();
        let frame = Frame::data_frame(extended, &[1, 2, 3]).unwrap();
        assert_eq!(said(0x1234_5678 | EXTENDED, 3, data), [Event::Frame(frame)]);
        let asked = Frame::remote_frame(StandardId::new(0x701).unwrap(), 1).unwrap();
        assert_eq!(said(0x701 | REMOTE, 1, data), [Event::Frame(asked)]);
        // linux/can/error.h: CAN_ERR_BUSOFF is 40h.
        assert_eq!(said(ERROR | 0x40, 8, [0; 8]), [Event::Bus(BusEvent::State(BusState::Off))]);
        assert_eq!(said(0x581, 9, data), []);
    }
}
