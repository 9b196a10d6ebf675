//! Byte streams over TCP, as serial device servers give them.

use core::time::Duration;
use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream, ToSocketAddrs};

use crate::endpoint::Endpoint;
use crate::port::{OpenError, Port, Role};

/// Longest wait for a connection.
const CONNECT: Duration = Duration::from_secs(5);

pub(crate) fn open(endpoint: &Endpoint, address: &str, role: Role) -> Result<Box<dyn Port>, OpenError> {
    let failed = |error| OpenError::new(endpoint, error);
    match role {
        Role::Master => {
            let mut last = io::Error::from(io::ErrorKind::AddrNotAvailable);
            for address in address.to_socket_addrs().map_err(failed)? {
                match TcpStream::connect_timeout(&address, CONNECT) {
                    Ok(stream) => {
                        stream.set_nodelay(true).map_err(failed)?;
                        return Ok(Box::new(Stream(stream)));
                    }
                    Err(error) => last = error,
                }
            }
            Err(failed(last))
        }
        Role::Device => {
            let listener = TcpListener::bind(address).map_err(failed)?;
            listener.set_nonblocking(true).map_err(failed)?;
            Ok(Box::new(Listener { listener, stream: None }))
        }
    }
}

/// Waits for bytes, or the end of the stream.
#[cfg(unix)]
fn readable(stream: &TcpStream, timeout: Duration) -> io::Result<bool> {
    // The socket's own time limit is rounded up to the kernel's ticks, several milliseconds.
    use rustix::event::{PollFd, PollFlags, poll};
    let limit = crate::port::poll_limit(timeout);
    match poll(&mut [PollFd::new(stream, PollFlags::IN)], Some(&limit)) {
        Ok(ready) => Ok(ready > 0),
        Err(rustix::io::Errno::INTR) => Ok(false),
        Err(error) => Err(error.into()),
    }
}

#[cfg(not(unix))]
fn readable(stream: &TcpStream, timeout: Duration) -> io::Result<bool> {
    // A zero limit would mean "for ever". The read that follows ends in time.
    stream.set_read_timeout(Some(timeout.max(Duration::from_millis(1))))?;
    Ok(true)
}

/// Reads, and has what came acknowledged at once: a peer that gathers small messages until its last one is
/// acknowledged would else wait for the kernel's 40 ms. The kernel forgets the wish, so each read renews it.
pub(crate) fn read_at_once(mut stream: &TcpStream, buffer: &mut [u8]) -> io::Result<usize> {
    let len = stream.read(buffer)?;
    #[cfg(target_os = "linux")]
    let _ = std::os::linux::net::TcpStreamExt::set_quickack(stream, true);
    Ok(len)
}

struct Stream(TcpStream);

impl Port for Stream {
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        if !readable(&self.0, timeout)? {
            return Ok(0);
        }
        match read_at_once(&self.0, buffer) {
            Ok(0) => Err(io::Error::new(io::ErrorKind::BrokenPipe, "the peer closed the connection")),
            Ok(len) => Ok(len),
            Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {
                Ok(0)
            }
            Err(error) => Err(error),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }
}

/// One master at a time; when it leaves, the next may come.
struct Listener {
    listener: TcpListener,
    stream: Option<Stream>,
}

impl Port for Listener {
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        if let Some(stream) = &mut self.stream {
            let received = stream.receive(buffer, timeout);
            if received.is_err() {
                self.stream = None;
            }
            return Ok(received.unwrap_or(0));
        }
        match self.listener.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(false)?;
                stream.set_nodelay(true)?;
                self.stream = Some(Stream(stream));
            }
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => std::thread::sleep(timeout),
            Err(error) => return Err(error),
        }
        Ok(0)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        if let Some(stream) = &mut self.stream
            && stream.send(bytes).is_err()
        {
            self.stream = None;
        }
        Ok(())
    }
}
