//! CAN buses: a thread for each endpoint, and simulated devices on virtual buses.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::io;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::JoinHandle;

use canopen_master::master::BusStatus;
use device_sim::canopen::{Ld2000, RemoteIo};
use motion_core::bus::CanBus;
use motion_io::can::{BusEvent, BusState, CanPort, Driver, Engine, Event, VirtualBus, open};
use motion_io::endpoint::CanEndpoint;
use pdo::{Frame, NodeId};

use super::config::{BusName, Config, Simulated};
use crate::exit::Exit;

/// Longest time that a frame waits for its bus.
const TURN: Duration = Duration::from_micros(500);
/// How often a simulated device looks whether it is to end.
const LOOK: Duration = Duration::from_millis(50);

/// One connected bus.
pub(super) struct Bus {
    name: String,
    received: Receiver<io::Result<Event>>,
    frames: Option<Sender<Frame>>,
    thread: Option<JoinHandle<()>>,
}

impl Bus {
    pub(super) fn connect(endpoint: &CanEndpoint) -> Result<Self, Exit> {
        let port = open(endpoint).map_err(|error| Exit::trouble(error.to_string()))?;
        let (to_control, received) = channel();
        let (frames, from_control) = channel();
        let thread = std::thread::spawn(move || {
            if let Err(error) = pass(port, &from_control, &to_control) {
                // Nobody listens any more when the program ends.
                let _ = to_control.send(Err(error));
            }
        });
        Ok(Self { name: endpoint.to_string(), received, frames: Some(frames), thread: Some(thread) })
    }

    /// Takes what has come; telling what the adapter says.
    pub(super) fn receive(
        &self,
        now: Duration,
        bus: &mut CanBus,
        mut told: impl FnMut(BusEvent),
    ) -> Result<(), Exit> {
        while let Ok(event) = self.received.try_recv() {
            match event.map_err(|error| Exit::file(&self.name, &error))? {
                Event::Frame(frame) => {
                    bus.handle_frame(now, &frame);
                }
                Event::Bus(event) => {
                    if let BusEvent::State(state) = event {
                        bus.handle_bus(now, status(state));
                    }
                    told(event);
                }
                _ => {}
            }
        }
        bus.handle_timeout(now);
        Ok(())
    }

    /// Sends what the bus has to send.
    pub(super) fn send(&self, now: Duration, bus: &mut CanBus) {
        while let Some(frame) = bus.poll_transmit(now) {
            if let Some(frames) = &self.frames {
                // A thread that has ended has told why, and the next turn says so.
                let _ = frames.send(frame);
            }
        }
    }
}

impl Drop for Bus {
    fn drop(&mut self) {
        // Without a sender the thread ends with its next turn.
        self.frames = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

const fn status(state: BusState) -> BusStatus {
    match state {
        BusState::Active => BusStatus::Active,
        BusState::Warning => BusStatus::Warning,
        BusState::Passive => BusStatus::Passive,
        BusState::Off => BusStatus::Off,
    }
}

/// Passes frames both ways until the control has gone.
fn pass(
    mut port: Box<dyn CanPort>,
    from_control: &Receiver<Frame>,
    to_control: &Sender<io::Result<Event>>,
) -> io::Result<()> {
    let mut held = None;
    loop {
        loop {
            let frame = match held.take() {
                Some(frame) => frame,
                None => match from_control.try_recv() {
                    Ok(frame) => frame,
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => return Ok(()),
                },
            };
            match port.send(&frame) {
                Ok(()) => {}
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    held = Some(frame);
                    break;
                }
                // Off the bus: what could not be sent is old by the time it could.
                Err(error) if error.kind() == io::ErrorKind::NetworkDown => {}
                Err(error) => return Err(error),
            }
        }
        let mut timeout = TURN;
        while let Some(event) = port.receive(timeout)? {
            if to_control.send(Ok(event)).is_err() {
                return Ok(());
            }
            timeout = Duration::ZERO;
        }
    }
}

/// Simulated devices, until dropped.
#[derive(Default)]
pub(super) struct Devices {
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Devices {
    pub(super) fn start(config: &Config) -> Result<Self, Exit> {
        let mut devices = Self::default();
        for (place, device) in config.simulate.iter().enumerate() {
            let serial = place as u32 + 1;
            match *device {
                Simulated::Drive { bus, node } => {
                    devices.run(config, bus, Box::new(Ld2000::node(NodeId::new(node).ok(), serial)))?;
                }
                Simulated::Io { bus, node } => {
                    devices.run(
                        config,
                        bus,
                        Box::new(RemoteIo::node(NodeId::new(node).ok(), serial, true)),
                    )?;
                }
                Simulated::Plant(_) => {}
            }
        }
        Ok(devices)
    }

    fn run(&mut self, config: &Config, bus: BusName, mut engine: Box<dyn Engine + Send>) -> Result<(), Exit> {
        let endpoint = config.can(bus).map(super::config::Can::endpoint).transpose()?;
        let Some(CanEndpoint::Virtual { name }) = endpoint else {
            return Err(Exit::usage(format!("a simulated device needs a virtual bus, {bus:?} is none")));
        };
        let mut driver = Driver::new(Box::new(VirtualBus::named(&name).connect()));
        let stop = Arc::clone(&self.stop);
        self.threads.push(std::thread::spawn(move || {
            while !stop.load(Ordering::Relaxed) {
                let limit = driver.now() + LOOK;
                // A virtual bus does not fail.
                if driver.run(engine.as_mut(), limit, |_| ()).is_err() {
                    break;
                }
            }
        }));
        Ok(())
    }
}

impl Drop for Devices {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}
