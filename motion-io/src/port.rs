//! An open serial endpoint: bytes out, bytes in with a time limit.

use core::time::Duration;
use std::io;

use crate::endpoint::Endpoint;

/// An open serial endpoint.
pub trait Port: Send {
    /// Waits up to `timeout` for bytes and returns how many were put into `buffer`; 0 = none came.
    ///
    /// # Errors
    /// The endpoint failed or is gone.
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize>;

    /// Sends all bytes and returns when the last one has left, as far as the endpoint can tell.
    ///
    /// # Errors
    /// The endpoint failed or is gone.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// The time by which whoever uses the endpoint reckons its deadlines, since any fixed moment: the
    /// clock of this machine, or that of a virtual wire.
    fn now(&self) -> Duration {
        crate::clock::now()
    }
}

/// A time limit for the kernel's `poll`, which takes no endless ones.
#[cfg(unix)]
pub(crate) fn poll_limit(timeout: Duration) -> rustix::event::Timespec {
    const LONGEST: Duration = Duration::from_secs(3600);
    let timeout = timeout.min(LONGEST);
    rustix::event::Timespec {
        tv_sec: timeout.as_secs().cast_signed(),
        tv_nsec: timeout.subsec_nanos().into(),
    }
}

/// Which side of the line to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Talks to a device: connects to TCP addresses.
    Master,
    /// Is a device: listens on TCP addresses.
    Device,
}

/// Why an endpoint could not be opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// Nothing is there.
    #[error("{endpoint}: no such port")]
    Missing {
        /// As written.
        endpoint: String,
    },
    /// Another program has it open.
    #[error("{endpoint}: busy, another program has it open")]
    Busy {
        /// As written.
        endpoint: String,
    },
    /// The user may not open it.
    #[error(
        "{endpoint}: permission denied; on Linux the user must be in the group that owns the port, often dialout"
    )]
    Permission {
        /// As written.
        endpoint: String,
    },
    /// It is there but is no serial port.
    #[error("{endpoint}: not a serial port")]
    NotSerial {
        /// As written.
        endpoint: String,
    },
    /// This build has no such endpoints.
    #[error("{endpoint}: this build has no such endpoints (feature {feature:?})")]
    NotBuilt {
        /// As written.
        endpoint: String,
        /// Cargo feature that is missing.
        feature: &'static str,
    },
    /// Anything else that the system says.
    #[error("{endpoint}: {error}")]
    Io {
        /// As written.
        endpoint: String,
        /// The system's error.
        error: io::Error,
    },
}

impl OpenError {
    pub(crate) fn new(endpoint: &impl ToString, error: io::Error) -> Self {
        let endpoint = endpoint.to_string();
        match error.kind() {
            io::ErrorKind::NotFound => Self::Missing { endpoint },
            io::ErrorKind::PermissionDenied => Self::Permission { endpoint },
            io::ErrorKind::ResourceBusy | io::ErrorKind::WouldBlock => Self::Busy { endpoint },
            _ => Self::Io { endpoint, error },
        }
    }

    /// The same of the endpoint that this one is a part of.
    pub(crate) fn of(mut self, whole: &impl ToString) -> Self {
        let (Self::Missing { endpoint }
        | Self::Busy { endpoint }
        | Self::Permission { endpoint }
        | Self::NotSerial { endpoint }
        | Self::NotBuilt { endpoint, .. }
        | Self::Io { endpoint, .. }) = &mut self;
        *endpoint = whole.to_string();
        self
    }
}

/// Opens an endpoint.
///
/// # Errors
/// [`OpenError`] names the endpoint and what is wrong with it.
pub fn open(endpoint: &Endpoint, role: Role) -> Result<Box<dyn Port>, OpenError> {
    match endpoint {
        Endpoint::Serial { path, settings } => {
            #[cfg(feature = "serial")]
            return crate::serial::open(endpoint, path, settings);
            #[cfg(not(feature = "serial"))]
            return {
                let _ = (path, settings);
                Err(OpenError::NotBuilt { endpoint: endpoint.to_string(), feature: "serial" })
            };
        }
        Endpoint::Can(can) => Ok(Box::new(crate::can::Stream::new(crate::can::open(can)?, role))),
        Endpoint::Tcp { address } => crate::tcp::open(endpoint, address, role),
        Endpoint::Pty { link } => {
            #[cfg(all(feature = "pty", unix))]
            return match crate::pty::Pty::create(link) {
                Ok(pty) => Ok(Box::new(pty)),
                Err(error) => Err(OpenError::new(endpoint, error)),
            };
            #[cfg(not(all(feature = "pty", unix)))]
            return {
                let _ = link;
                Err(OpenError::NotBuilt { endpoint: endpoint.to_string(), feature: "pty" })
            };
        }
    }
}

/// Names of the serial ports that the machine has.
///
/// # Errors
/// The system cannot tell.
#[cfg(feature = "serial")]
pub fn list() -> io::Result<Vec<(String, String)>> {
    crate::serial::list()
}
