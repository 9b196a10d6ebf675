//! Engines on an open CAN endpoint.

use core::time::Duration;
use std::io;

use pdo::Frame;

#[cfg(feature = "virtual")]
use super::BusState;
use super::{BusEvent, CanPort, Event};

/// What drives an engine: frames and time in, frames out. Engines have methods of these names.
pub trait Engine {
    /// A frame of another station.
    fn handle_frame(&mut self, now: Duration, frame: &Frame);
    /// Time goes on; a spurious call changes nothing.
    fn handle_timeout(&mut self, now: Duration);
    /// The next frame to send.
    fn poll_transmit(&mut self, now: Duration) -> Option<Frame>;
    /// When to call [`handle_timeout`](Self::handle_timeout); `None` = idle.
    fn poll_timeout(&self) -> Option<Duration>;
    /// What the endpoint tells about its bus.
    fn handle_bus(&mut self, _now: Duration, _event: BusEvent) {}
}

#[cfg(feature = "virtual")]
impl<N: device_sim::can::Node> Engine for N {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        device_sim::can::Node::handle_frame(self, now, frame);
    }

    fn handle_timeout(&mut self, now: Duration) {
        device_sim::can::Node::handle_timeout(self, now);
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        device_sim::can::Node::poll_transmit(self, now)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        device_sim::can::Node::poll_timeout(self)
    }

    fn handle_bus(&mut self, now: Duration, event: BusEvent) {
        use device_sim::can::{Event, State};
        if let BusEvent::State(state) = event {
            let state = match state {
                BusState::Active => State::Active,
                BusState::Warning => State::Warning,
                BusState::Passive => State::Passive,
                BusState::Off => State::BusOff,
            };
            device_sim::can::Node::handle_bus(self, now, Event::State(state));
        }
    }
}

/// While a frame waits for room in the transmit queue, it is offered again so often.
const RETRY: Duration = Duration::from_millis(2);
/// Frames that are taken in one turn before the engine is asked what to send.
const BATCH: usize = 32;

/// An endpoint and the clock that its engine sees: time since the driver was made.
pub struct Driver {
    port: Box<dyn CanPort>,
    start: Duration,
    /// Taken from the engine, not yet by the endpoint.
    held: Option<Frame>,
}

impl core::fmt::Debug for Driver {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Driver").field("held", &self.held).finish_non_exhaustive()
    }
}

impl Driver {
    /// Drives engines on `port`.
    #[must_use]
    pub fn new(port: Box<dyn CanPort>) -> Self {
        let start = port.now();
        Self { port, start, held: None }
    }

    /// The engine's time.
    #[must_use]
    pub fn now(&self) -> Duration {
        self.port.now().saturating_sub(self.start)
    }

    /// Whether a frame waits for room in the endpoint's transmit queue.
    #[must_use]
    pub const fn is_blocked(&self) -> bool {
        self.held.is_some()
    }

    /// Sends what the engine has to send, then waits for frames until the engine's next timeout, at most
    /// until `limit` on the engine's clock. Frames that the endpoint's queue does not take wait, in order.
    /// `observe` sees everything that came and, as [`Event::Frame`] with `true`, everything that was sent.
    ///
    /// # Errors
    /// The endpoint failed or is gone.
    pub fn turn(
        &mut self,
        engine: &mut dyn Engine,
        limit: Duration,
        mut observe: impl FnMut(Duration, Event, bool),
    ) -> io::Result<()> {
        // What was sent may have ended something, which the caller wants to know before waiting.
        let sent = self.send(engine, &mut observe)?;
        let wait = if sent { Duration::ZERO } else { self.wait(engine, limit) };
        self.receive(engine, wait, &mut observe)?;
        self.handle_timeout(engine);
        Ok(())
    }

    /// Sends what the engine has to send, as far as the endpoint takes it; whether there was anything.
    pub(super) fn send(
        &mut self,
        engine: &mut dyn Engine,
        observe: &mut dyn FnMut(Duration, Event, bool),
    ) -> io::Result<bool> {
        let now = self.now();
        let mut sent = false;
        while let Some(frame) = self.held.take().or_else(|| engine.poll_transmit(now)) {
            match self.port.send(&frame) {
                Ok(()) => {
                    sent = true;
                    observe(now, Event::Frame(frame), true);
                }
                Err(error)
                    if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::NetworkDown) =>
                {
                    self.held = Some(frame);
                    break;
                }
                Err(error) => return Err(error),
            }
        }
        Ok(sent)
    }

    /// How long there is nothing to do unless something comes in, at most until `limit`.
    pub(super) fn wait(&self, engine: &dyn Engine, limit: Duration) -> Duration {
        let now = self.now();
        let until = engine.poll_timeout().map_or(limit, |at| at.min(limit));
        let until = if self.held.is_some() { until.min(now.saturating_add(RETRY)) } else { until };
        until.saturating_sub(now)
    }

    /// Waits up to `timeout` and takes what has come, at most [`BATCH`]; whether that was all.
    pub(super) fn receive(
        &mut self,
        engine: &mut dyn Engine,
        mut timeout: Duration,
        observe: &mut dyn FnMut(Duration, Event, bool),
    ) -> io::Result<bool> {
        for _ in 0..BATCH {
            let Some(event) = self.port.receive(timeout)? else { return Ok(true) };
            let now = self.now();
            match &event {
                Event::Frame(frame) => engine.handle_frame(now, frame),
                Event::Bus(event) => engine.handle_bus(now, *event),
            }
            observe(now, event, false);
            timeout = Duration::ZERO;
        }
        Ok(false)
    }

    /// Tells the engine the time, if it is due.
    pub(super) fn handle_timeout(&self, engine: &mut dyn Engine) {
        let now = self.now();
        if engine.poll_timeout().is_some_and(|at| at <= now) {
            engine.handle_timeout(now);
        }
    }

    /// Like [`turn`](Self::turn), telling only what the bus says.
    ///
    /// # Errors
    /// The endpoint failed or is gone.
    pub fn run(
        &mut self,
        engine: &mut dyn Engine,
        limit: Duration,
        mut bus: impl FnMut(BusEvent),
    ) -> io::Result<()> {
        self.turn(engine, limit, |_, event, _| {
            if let Event::Bus(event) = event {
                bus(event);
            }
        })
    }
}
