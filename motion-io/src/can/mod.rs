//! CAN endpoints, opened: frames out, frames and what the bus says in, with a time limit; and engines
//! driven on them by the machine's clock.

mod drive;
mod slcan;
#[cfg(all(feature = "socketcan", target_os = "linux"))]
mod socketcan;
mod socketcand;
mod stream;
#[cfg(all(feature = "socketcan", feature = "tokio", target_os = "linux"))]
mod tokio;
#[cfg(feature = "virtual")]
mod virtual_bus;

use core::fmt;
use core::time::Duration;
use std::io;
use std::path::Path;

use pdo::Frame;

pub use drive::{Driver, Engine};
#[cfg(feature = "virtual")]
pub use socketcand::Server;
pub use stream::Stream;
#[cfg(all(feature = "socketcan", feature = "tokio", target_os = "linux"))]
pub use tokio::AsyncDriver;
#[cfg(feature = "virtual")]
pub use virtual_bus::{VirtualBus, VirtualPort};

use crate::endpoint::{CanEndpoint, Endpoint, Parity, Settings};
use crate::port::{OpenError, Role};

/// What comes from an open CAN endpoint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event {
    /// A frame of another station.
    Frame(Frame),
    /// Something about the bus or the adapter.
    Bus(BusEvent),
}

/// What an endpoint tells about its bus. Which of them come depends on the adapter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum BusEvent {
    /// The controller's error state has changed.
    State(BusState),
    /// An error frame.
    Error(BusError),
    /// Frames were lost because nobody fetched them in time.
    Overrun,
    /// A frame that was sent before has not been taken by the adapter.
    NotSent,
}

/// Error state of a CAN controller (ISO 11898-1, fault confinement).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum BusState {
    /// All well.
    Active,
    /// An error counter has reached 96.
    Warning,
    /// An error counter is above 127.
    Passive,
    /// The controller is off the bus.
    Off,
}

/// What an error frame was about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum BusError {
    /// Nobody acknowledged a frame.
    NoAcknowledge,
    /// Bit, stuff, form or CRC error.
    Protocol,
    /// The driver waited too long for a frame to go out.
    TransmitTimeout,
    /// The transceiver reports a fault of the wires.
    Transceiver,
    /// A bus error without details.
    Unspecified,
}

impl fmt::Display for BusState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Active => "error active",
            Self::Warning => "error warning",
            Self::Passive => "error passive",
            Self::Off => "bus-off",
        })
    }
}

impl fmt::Display for BusEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::State(state) => state.fmt(f),
            Self::Error(error) => f.write_str(match error {
                BusError::NoAcknowledge => {
                    "no acknowledge: no other station is on the bus, or at another bit rate"
                }
                BusError::Protocol => "error frame: bit, stuff, form or CRC error",
                BusError::TransmitTimeout => "a frame could not be sent in time",
                BusError::Transceiver => "the transceiver reports a fault of the wires",
                BusError::Unspecified => "bus error",
            }),
            Self::Overrun => f.write_str("frames were lost: received faster than fetched"),
            Self::NotSent => f.write_str("the adapter did not take a frame"),
        }
    }
}

/// An open CAN endpoint.
pub trait CanPort: Send {
    /// Sends a frame, or queues it for sending.
    ///
    /// # Errors
    /// [`io::ErrorKind::WouldBlock`]: the transmit queue is full and the frame was not taken, try again
    /// later; [`io::ErrorKind::NetworkDown`]: the bus is off, the frame was not taken. Anything else: the
    /// endpoint failed or is gone.
    fn send(&mut self, frame: &Frame) -> io::Result<()>;

    /// Waits up to `timeout` for a frame or an event of the bus.
    ///
    /// # Errors
    /// The endpoint failed or is gone.
    fn receive(&mut self, timeout: Duration) -> io::Result<Option<Event>>;

    /// The time by which whoever uses the endpoint reckons its deadlines, since any fixed moment: the
    /// clock of this machine, or that of a virtual wire.
    fn now(&self) -> Duration {
        crate::clock::now()
    }

    /// Waits up to `timeout` until somebody can hear us, where the endpoint knows: of an adapter that we
    /// are, until a host has opened the channel. Returns whether somebody can.
    ///
    /// # Errors
    /// The endpoint failed or is gone.
    fn wait_for_peer(&mut self, timeout: Duration) -> io::Result<bool> {
        let _ = timeout;
        Ok(true)
    }
}

/// The CAN interfaces that the system has, by name, each with whether it is up; none where the system has no
/// SocketCAN.
///
/// # Errors
/// The system cannot tell.
pub fn interfaces() -> io::Result<Vec<(String, bool)>> {
    interfaces_in(Path::new("/sys/class/net"))
}

/// The same of a folder like the kernel's.
fn interfaces_in(folder: &Path) -> io::Result<Vec<(String, bool)>> {
    /// What the kernel calls the hardware (ARPHRD_CAN), and the flag of an interface that is up (IFF_UP).
    const CAN: &str = "280";
    const UP: u32 = 1;
    let entries = match std::fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut found = Vec::new();
    for entry in entries {
        let entry = entry?;
        let read = |name: &str| std::fs::read_to_string(entry.path().join(name)).unwrap_or_default();
        if read("type").trim() != CAN {
            continue;
        }
        let flags = read("flags");
        let flags = u32::from_str_radix(flags.trim().trim_start_matches("0x"), 16).unwrap_or(0);
        found.push((entry.file_name().to_string_lossy().into_owned(), flags & UP != 0));
    }
    found.sort();
    Ok(found)
}

/// Opens an endpoint.
///
/// # Errors
/// [`OpenError`] names the endpoint and what is wrong with it.
pub fn open(endpoint: &CanEndpoint) -> Result<Box<dyn CanPort>, OpenError> {
    match endpoint {
        CanEndpoint::SocketCan { interface } => {
            #[cfg(all(feature = "socketcan", target_os = "linux"))]
            return socketcan::open(endpoint, interface);
            #[cfg(not(all(feature = "socketcan", target_os = "linux")))]
            return {
                let _ = interface;
                Err(OpenError::NotBuilt { endpoint: endpoint.to_string(), feature: "socketcan" })
            };
        }
        CanEndpoint::Slcan { path, bit_rate, baud } => {
            let settings = Settings { baud: *baud, parity: Parity::None, stop_bits: 1 };
            let line = Endpoint::Serial { path: path.clone(), settings };
            let port = crate::port::open(&line, Role::Master).map_err(|error| error.of(endpoint))?;
            let host = slcan::Host::new(port, *bit_rate).map_err(|error| OpenError::new(endpoint, error))?;
            Ok(Box::new(host))
        }
        CanEndpoint::SlcanPty { link } => {
            let line = Endpoint::Pty { link: link.clone() };
            let port = crate::port::open(&line, Role::Device).map_err(|error| error.of(endpoint))?;
            Ok(Box::new(slcan::AdapterPort::new(port)))
        }
        CanEndpoint::Socketcand { address, bus } => {
            let line = Endpoint::Tcp { address: address.clone() };
            let port = crate::port::open(&line, Role::Master).map_err(|error| error.of(endpoint))?;
            let client =
                socketcand::Client::new(port, bus).map_err(|error| OpenError::new(endpoint, error))?;
            Ok(Box::new(client))
        }
        CanEndpoint::Virtual { name } => {
            #[cfg(feature = "virtual")]
            return Ok(Box::new(VirtualBus::named(name).connect()));
            #[cfg(not(feature = "virtual"))]
            return {
                let _ = name;
                Err(OpenError::NotBuilt { endpoint: endpoint.to_string(), feature: "virtual" })
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interfaces_are_told_from_others() {
        let folder = tempfile::tempdir().unwrap();
        for (name, kind, flags) in
            [("vcan0", "280\n", "0xc1\n"), ("can0", "280\n", "0x80\n"), ("eth0", "1\n", "0x1003\n")]
        {
            std::fs::create_dir(folder.path().join(name)).unwrap();
            std::fs::write(folder.path().join(name).join("type"), kind).unwrap();
            std::fs::write(folder.path().join(name).join("flags"), flags).unwrap();
        }
        std::fs::write(folder.path().join("bonding_masters"), "").unwrap();
        let found = interfaces_in(folder.path()).unwrap();
        assert_eq!(found, [("can0".to_owned(), false), ("vcan0".to_owned(), true)]);
        assert_eq!(interfaces_in(&folder.path().join("nothing")).unwrap(), []);
    }
}
