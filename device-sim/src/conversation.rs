//! An LB2 master and devices on one line, on virtual time.

use core::time::Duration;

use lb2::device::{Device, DeviceEngine};
use lb2::master::{Config, Event, Master, Outcome, Ticket};
use lb2::telegram::Request;

use crate::serial::{Faults, LineConfig, Wire};

/// More steps than any one request can need: beyond it the conversation goes in circles.
const STEPS: usize = 100_000;

struct Station<D> {
    engine: DeviceEngine,
    device: D,
    answer_time: Duration,
    /// An answer that is not sent yet.
    answer: Option<(Duration, Vec<u8>)>,
}

/// A half-duplex conversation: one wire to the devices, one from them. Devices that answer at the same
/// time are heard one after the other.
pub struct Conversation<D> {
    now: Duration,
    master: Master,
    to_devices: Wire,
    to_master: Wire,
    transmit_done: Option<Duration>,
    stations: Vec<Station<D>>,
    second_answers: u32,
    late_answers: u32,
}

impl<D> core::fmt::Debug for Conversation<D> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Conversation").field("now", &self.now).finish_non_exhaustive()
    }
}

impl<D: Device> Conversation<D> {
    /// A line without devices. The faults of the two directions differ by their seed.
    #[must_use]
    pub fn new(config: LineConfig, faults: Faults) -> Self {
        Self {
            now: Duration::ZERO,
            master: Master::new(Config::default()),
            to_devices: Wire::new(config, faults),
            to_master: Wire::new(config, Faults { seed: !faults.seed, ..faults }),
            transmit_done: None,
            stations: Vec::new(),
            second_answers: 0,
            late_answers: 0,
        }
    }

    /// Connects a device that takes `answer_time` from the end of a request to its answer.
    pub fn connect(&mut self, device: D, answer_time: Duration) {
        self.stations.push(Station { engine: DeviceEngine::default(), device, answer_time, answer: None });
    }

    /// Virtual time.
    #[must_use]
    pub const fn now(&self) -> Duration {
        self.now
    }

    /// The device that was connected first, second, ….
    pub fn device(&mut self, number: usize) -> Option<&mut D> {
        self.stations.get_mut(number).map(|station| &mut station.device)
    }

    /// The wires to the devices and to the master, to script faults and count characters.
    pub const fn wires(&mut self) -> (&mut Wire, &mut Wire) {
        (&mut self.to_devices, &mut self.to_master)
    }

    /// Second and late answers that the master has remarked.
    #[must_use]
    pub const fn remarks(&self) -> (u32, u32) {
        (self.second_answers, self.late_answers)
    }

    /// Asks, and drives the line until the outcome is there.
    ///
    /// # Panics
    /// If the request cannot be submitted, or the line goes in circles: both are bugs.
    pub fn ask<T>(
        &mut self,
        request: &Request<'_>,
        retries: u8,
        use_outcome: impl FnOnce(Outcome<'_>) -> T,
    ) -> T {
        let ticket: Ticket = match self.master.submit(request, retries) {
            Ok(ticket) => ticket,
            Err(error) => panic!("{request:?}: {error}"),
        };
        for _ in 0..STEPS {
            while let Some(event) = self.master.poll_event() {
                match event {
                    Event::Outcome { ticket: ended, outcome } => {
                        assert_eq!(ended, ticket);
                        return use_outcome(outcome);
                    }
                    Event::SecondAnswer(_) => self.second_answers += 1,
                    Event::Late(_) => self.late_answers += 1,
                    _ => {}
                }
            }
            self.step();
        }
        panic!("{request:?}: no outcome after {STEPS} steps, at {:?}", self.now);
    }

    /// Lets all that is on the way arrive and all times end.
    pub fn settle(&mut self) {
        for _ in 0..STEPS {
            while let Some(event) = self.master.poll_event() {
                match event {
                    Event::SecondAnswer(_) => self.second_answers += 1,
                    Event::Late(_) => self.late_answers += 1,
                    _ => {}
                }
            }
            if !self.step() {
                return;
            }
        }
    }

    /// Goes on to the next moment at which something happens; `false` if nothing will.
    fn step(&mut self) -> bool {
        if let Some(bytes) = self.master.poll_transmit(self.now) {
            self.transmit_done = Some(self.to_devices.send(self.now, bytes));
        }
        let stations = self
            .stations
            .iter()
            .flat_map(|station| [station.engine.poll_timeout(), station.answer.as_ref().map(|(at, _)| *at)]);
        let moments = [
            self.transmit_done,
            self.to_devices.poll_timeout(),
            self.to_master.poll_timeout(),
            self.master.poll_timeout(),
        ];
        let Some(next) = stations.chain(moments).flatten().min() else { return false };
        self.now = self.now.max(next);
        let now = self.now;
        if self.transmit_done.is_some_and(|at| at <= now) {
            self.transmit_done = None;
            self.master.handle_transmit_done(now);
        }
        while let Some(character) = self.to_devices.poll(now) {
            for Station { engine, device, .. } in &mut self.stations {
                match character.seen {
                    Ok(byte) => engine.handle_bytes(now, &[byte], device),
                    Err(error) => engine.handle_line_error(now, error, device),
                }
            }
        }
        for Station { engine, device, answer_time, answer } in &mut self.stations {
            engine.handle_timeout(now, device);
            if let Some(bytes) = engine.poll_transmit(now) {
                *answer = Some((now.saturating_add(*answer_time), bytes.to_vec()));
            }
            if let Some((_, bytes)) = answer.take_if(|(at, _)| *at <= now) {
                self.to_master.send(now, &bytes);
            }
        }
        while let Some(character) = self.to_master.poll(now) {
            // A master's receiver drops what it could not read; the telegram is short of it.
            if let Ok(byte) = character.seen {
                self.master.handle_bytes(now, &[byte]);
            }
        }
        self.master.handle_timeout(now);
        true
    }
}
