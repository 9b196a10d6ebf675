//! A socketcand server for virtual buses.

use core::net::SocketAddr;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::io::{self, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

use super::super::{BusError, BusEvent, BusState, CanPort, Event, VirtualBus, VirtualPort};
use super::{Messages, frame_message, parse_send};
use crate::tcp::read_at_once;

/// How often a waiting thread looks whether it is to end.
const POLL: Duration = Duration::from_millis(100);
/// A client that takes nothing for so long is dropped.
const WRITE: Duration = Duration::from_secs(1);
/// Clients compare the answer to `< rawmode >` with what one read brings, so frames follow a little later.
const AFTER_RAWMODE: Duration = Duration::from_millis(20);
/// Frames that came before the bus had room are tried again so often.
const RETRY: Duration = Duration::from_millis(1);

/// Serves virtual buses to other programs over TCP.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    buses: Vec<(String, VirtualBus)>,
}

impl Server {
    /// Listens on `address` (`HOST:PORT`, port 0 = any that is free).
    ///
    /// # Errors
    /// The address cannot be had.
    pub fn bind(address: &str, buses: Vec<(String, VirtualBus)>) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        Ok(Self { listener, buses })
    }

    /// Where it listens.
    ///
    /// # Errors
    /// The system cannot tell.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// Serves clients, each with threads of its own, until `stop` is set.
    ///
    /// # Errors
    /// The listener failed.
    pub fn serve(&self, stop: &Arc<AtomicBool>) -> io::Result<()> {
        while !stop.load(Ordering::Relaxed) {
            match self.listener.accept() {
                Ok((stream, _)) => {
                    let (buses, stop) = (self.buses.clone(), Arc::clone(stop));
                    std::thread::spawn(move || {
                        // A client that is gone concerns nobody else.
                        let _ = Session::run(stream, &buses, &stop);
                    });
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    std::thread::sleep(POLL / 10);
                }
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

/// One client, as both of its threads see it.
struct Session {
    stream: TcpStream,
    out: Mutex<Out>,
    ended: AtomicBool,
}

/// What both threads write to.
struct Out {
    stream: TcpStream,
    /// The client hears frames. It changes with the answer that says so: a client may be sent a frame as
    /// soon as it has read that answer.
    raw: bool,
}

impl Out {
    fn say(&mut self, text: &str) -> io::Result<()> {
        self.stream.write_all(text.as_bytes())
    }
}

impl Session {
    fn run(stream: TcpStream, buses: &[(String, VirtualBus)], stop: &AtomicBool) -> io::Result<()> {
        stream.set_nonblocking(false)?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(POLL))?;
        stream.set_write_timeout(Some(WRITE))?;
        let session = Self {
            out: Mutex::new(Out { stream: stream.try_clone()?, raw: false }),
            stream,
            ended: AtomicBool::new(false),
        };
        session.out().say("< hi >")?;
        std::thread::scope(|scope| {
            let mut station = None;
            let done = session.read(buses, stop, |port| {
                station = Some(port.clone());
                scope.spawn(|| session.forward(port));
            });
            // What a client sent before it left still goes out.
            if let Some(port) = station {
                port.drain(WRITE);
            }
            session.ended.store(true, Ordering::Relaxed);
            done
        })
    }

    fn out(&self) -> MutexGuard<'_, Out> {
        self.out.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn set_raw(&self, raw: bool) -> io::Result<()> {
        let mut out = self.out();
        out.raw = raw;
        out.say("< ok >")
    }

    fn read(
        &self,
        buses: &[(String, VirtualBus)],
        stop: &AtomicBool,
        mut open: impl FnMut(VirtualPort),
    ) -> io::Result<()> {
        let mut messages = Messages::default();
        let mut port: Option<VirtualPort> = None;
        let mut buffer = [0; 2048];
        while !stop.load(Ordering::Relaxed) && !self.ended.load(Ordering::Relaxed) {
            let len = match read_at_once(&self.stream, &mut buffer) {
                Ok(0) => return Ok(()),
                Ok(len) => len,
                Err(error)
                    if matches!(
                        error.kind(),
                        io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted
                    ) =>
                {
                    continue;
                }
                Err(error) => return Err(error),
            };
            for &byte in buffer.get(..len).unwrap_or(&[]) {
                let Some(message) = messages.push(byte) else { continue };
                let mut words = message.split_whitespace();
                match (words.next().unwrap_or(""), &mut port) {
                    ("echo", _) => self.out().say("< echo >")?,
                    ("open", None) => {
                        let name = words.next().unwrap_or("");
                        let Some((_, bus)) = buses.iter().find(|(known, _)| known == name) else {
                            return self.out().say("< error could not open bus >");
                        };
                        let new = bus.connect();
                        open(new.clone());
                        port = Some(new);
                        self.out().say("< ok >")?;
                    }
                    ("rawmode", Some(_)) => self.set_raw(true)?,
                    ("bcmmode", Some(_)) => self.set_raw(false)?,
                    (command @ ("send" | "sendrtr"), Some(port)) => {
                        match parse_send(words, command == "sendrtr") {
                            Some(frame) => self.send(port, &frame, stop)?,
                            None => self.out().say("< error syntax >")?,
                        }
                    }
                    _ => self.out().say("< error unknown command >")?,
                }
            }
        }
        Ok(())
    }

    /// The stream itself holds back a client that sends faster than its bus.
    fn send(&self, port: &mut VirtualPort, frame: &pdo::Frame, stop: &AtomicBool) -> io::Result<()> {
        loop {
            match port.send(frame) {
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                // Bus-off: as on a real interface, what is sent meanwhile is lost, and the client was told.
                Err(error) if error.kind() == io::ErrorKind::NetworkDown => return Ok(()),
                sent => return sent,
            }
            if stop.load(Ordering::Relaxed) || self.ended.load(Ordering::Relaxed) {
                return Ok(());
            }
            std::thread::sleep(RETRY);
        }
    }

    /// Bus to client.
    fn forward(&self, mut port: VirtualPort) {
        let mut raw = false;
        while !self.ended.load(Ordering::Relaxed) {
            let Ok(event) = port.receive(POLL) else { break };
            let changed = self.out().raw != raw;
            if changed {
                raw = !raw;
                std::thread::sleep(AFTER_RAWMODE);
            }
            let Some(event) = event.filter(|_| raw) else { continue };
            let at = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
            let text = match event {
                Event::Frame(frame) => frame_message(&frame, at),
                Event::Bus(event) => {
                    let class = match event {
                        BusEvent::State(BusState::Off) => 0x40,
                        BusEvent::State(BusState::Active) => 0x100,
                        BusEvent::Error(BusError::NoAcknowledge) => 0x20,
                        BusEvent::Error(BusError::Protocol) => 0x08,
                        BusEvent::State(_) | BusEvent::Overrun => 0x04,
                        BusEvent::Error(_) | BusEvent::NotSent => 0x80,
                    };
                    format!("< error {class:03X} {}.{:06} >", at.as_secs(), at.subsec_micros())
                }
            };
            if self.out().say(&text).is_err() {
                break;
            }
        }
        self.ended.store(true, Ordering::Relaxed);
    }
}
