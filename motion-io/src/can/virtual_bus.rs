//! Virtual buses in real time: `device-sim`'s bus on the machine's clock.

use core::time::Duration;
use std::collections::HashMap;
use std::io;
use std::sync::{Arc, Condvar, LazyLock, Mutex, MutexGuard, PoisonError, Weak};
use std::time::Instant;

use device_sim::can::{
    Bus, ErrorKind, Event as StationEvent, Faults, QUEUE, State, StationId, TransmitError,
};
use pdo::Frame;

use super::{BusError, BusEvent, BusState, CanPort, Event};

/// Bits per second unless set (project-defined).
const BIT_RATE: u32 = 500_000;

/// The system takes no endless time limits.
const LONGEST: Duration = Duration::from_secs(3600);

/// Buses that `virtual:NAME` endpoints share, as long as somebody holds them.
static NAMED: LazyLock<Mutex<HashMap<String, Weak<Shared>>>> = LazyLock::new(Mutex::default);

#[derive(Debug)]
struct Shared {
    bus: Mutex<Wire>,
    changed: Condvar,
    start: Instant,
}

#[derive(Debug)]
struct Wire {
    bus: Bus,
    /// Acknowledges, so that a program alone on the bus need not wait for a second one.
    listener: StationId,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Wire> {
        self.bus.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Brings the bus up to the present.
    fn advance(&self, wire: &mut Wire) {
        let due = wire.bus.poll_timeout();
        let now = self.start.elapsed();
        if due.is_some_and(|due| due <= now) {
            wire.bus.handle_timeout(now);
            while wire.bus.poll_event(wire.listener).is_some() {}
            self.changed.notify_all();
        }
    }
}

/// A virtual bus in real time. Clones are the same bus.
#[derive(Debug, Clone)]
pub struct VirtualBus(Arc<Shared>);

impl VirtualBus {
    /// A bus at this many bits per second.
    #[must_use]
    pub fn new(bit_rate: u32, faults: Faults) -> Self {
        let mut bus = Bus::new(bit_rate, faults);
        let listener = bus.connect();
        let bus = Mutex::new(Wire { bus, listener });
        Self(Arc::new(Shared { bus, changed: Condvar::new(), start: Instant::now() }))
    }

    /// The bus with this name in this process; it is made, at 500 kbit/s, if nobody has it open.
    #[must_use]
    pub fn named(name: &str) -> Self {
        let mut named = NAMED.lock().unwrap_or_else(PoisonError::into_inner);
        named.retain(|_, bus| bus.strong_count() > 0);
        if let Some(bus) = named.get(name).and_then(Weak::upgrade) {
            return Self(bus);
        }
        let bus = Self::new(BIT_RATE, Faults::NONE);
        named.insert(name.into(), Arc::downgrade(&bus.0));
        bus
    }

    /// A new station.
    #[must_use]
    pub fn connect(&self) -> VirtualPort {
        let station = self.0.lock().bus.connect();
        let plug = Plug { shared: Arc::clone(&self.0), station };
        VirtualPort(Arc::new(plug))
    }

    /// Works on the bus itself: faults, statistics.
    pub fn with<T>(&self, work: impl FnOnce(&mut Bus) -> T) -> T {
        let mut wire = self.0.lock();
        self.0.advance(&mut wire);
        let done = work(&mut wire.bus);
        self.0.changed.notify_all();
        done
    }
}

/// A station's connection, taken off the bus with its last port.
#[derive(Debug)]
struct Plug {
    shared: Arc<Shared>,
    station: StationId,
}

impl Drop for Plug {
    fn drop(&mut self) {
        self.shared.lock().bus.disconnect(self.station);
    }
}

/// A station on a virtual bus. Clones are the same station, so that one thread may send and another
/// receive.
#[derive(Debug, Clone)]
pub struct VirtualPort(Arc<Plug>);

impl VirtualPort {
    /// The station, for [`VirtualBus::with`].
    #[must_use]
    pub fn station(&self) -> StationId {
        self.0.station
    }
}

impl VirtualPort {
    /// Waits until everything that was sent is on the wire, at most `timeout`.
    pub(super) fn drain(&self, timeout: Duration) {
        let shared = &self.0.shared;
        let end = shared.start.elapsed().saturating_add(timeout);
        let mut wire = shared.lock();
        loop {
            shared.advance(&mut wire);
            let now = shared.start.elapsed();
            let empty = wire.bus.room(self.0.station) == QUEUE;
            let Some(next) = wire.bus.poll_timeout().filter(|_| !empty && now < end) else { return };
            let left = next.min(end).saturating_sub(now);
            wire = shared.changed.wait_timeout(wire, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

impl CanPort for VirtualPort {
    fn send(&mut self, frame: &Frame) -> io::Result<()> {
        let shared = &self.0.shared;
        let mut wire = shared.lock();
        shared.advance(&mut wire);
        let sent = wire.bus.send(shared.start.elapsed(), self.0.station, *frame).map_err(|error| {
            let kind = match error {
                TransmitError::QueueFull => io::ErrorKind::WouldBlock,
                _ => io::ErrorKind::NetworkDown,
            };
            io::Error::new(kind, error)
        });
        shared.changed.notify_all();
        sent
    }

    fn receive(&mut self, timeout: Duration) -> io::Result<Option<Event>> {
        let shared = &self.0.shared;
        let end = shared.start.elapsed().saturating_add(timeout);
        let mut wire = shared.lock();
        loop {
            shared.advance(&mut wire);
            while let Some((_, event)) = wire.bus.poll_event(self.0.station) {
                if let Some(event) = translate(event) {
                    return Ok(Some(event));
                }
            }
            let now = shared.start.elapsed();
            if now >= end {
                return Ok(None);
            }
            let until = wire.bus.poll_timeout().map_or(end, |at| at.min(end));
            let left = until.saturating_sub(now).min(LONGEST);
            wire = shared.changed.wait_timeout(wire, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

fn translate(event: StationEvent) -> Option<Event> {
    Some(match event {
        StationEvent::Received(frame) => Event::Frame(frame),
        StationEvent::State(state) => Event::Bus(BusEvent::State(match state {
            State::Active => BusState::Active,
            State::Warning => BusState::Warning,
            State::Passive => BusState::Passive,
            State::BusOff => BusState::Off,
        })),
        StationEvent::Error { kind: ErrorKind::Acknowledge, .. } => {
            Event::Bus(BusEvent::Error(BusError::NoAcknowledge))
        }
        StationEvent::Error { .. } => Event::Bus(BusEvent::Error(BusError::Protocol)),
        StationEvent::Discarded(_) => Event::Bus(BusEvent::NotSent),
        _ => return None,
    })
}
