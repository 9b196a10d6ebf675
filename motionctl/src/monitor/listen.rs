//! A bus that is listened to.

use core::time::Duration;

use motion_io::can::{CanPort, Event, open};
use motion_io::capture::Time;
use motion_io::endpoint::CanEndpoint;
use serde_json::Value;

use super::Subject;
use super::bus::Buses;
use super::cli::Monitor;
use super::sheet::Sheet;
use crate::can::record::recorded;
use crate::can::session::gone;
use crate::decode::names::Names;
use crate::exit::Exit;

/// How long a bus is listened to for one snapshot, unless `--for` says otherwise.
const ONCE: Duration = Duration::from_secs(1);
/// Frames that are taken before the screen and the keys are looked after again.
const BATCH: usize = 2000;

/// An open endpoint on which nothing is sent.
pub(super) struct Listening<'a> {
    port: Box<dyn CanPort>,
    start: Duration,
    buses: Buses<'a>,
}

impl<'a> Listening<'a> {
    pub(super) fn open(endpoint: &CanEndpoint, names: &'a Names, args: &Monitor) -> Result<Self, Exit> {
        let bit_rate = match (args.bitrate, endpoint) {
            (None, CanEndpoint::Slcan { bit_rate, .. }) => Some(*bit_rate),
            (given, _) => given,
        };
        let port = open(endpoint).map_err(|error| Exit::trouble(error.to_string()))?;
        let mut buses = Buses::new(endpoint.to_string(), names, args.reading.can_link, bit_rate);
        buses.set_now(Time(0));
        Ok(Self { start: port.now(), port, buses })
    }

    fn now(&self) -> Time {
        // As captures have them.
        Time::from_zero(self.port.now().saturating_sub(self.start)).whole_micros()
    }
}

impl Subject for Listening<'_> {
    fn advance(&mut self, mut wait: Duration) -> Result<(), Exit> {
        for _ in 0..BATCH {
            let event = self.port.receive(wait).map_err(|error| gone(&error))?;
            let now = self.now();
            self.buses.set_now(now);
            match event {
                Some(Event::Frame(frame)) => {
                    if let Some(record) = recorded(&frame, now) {
                        self.buses.hear(&record);
                    }
                }
                Some(Event::Bus(event)) => self.buses.event(now, event),
                Some(_) => {}
                None => break,
            }
            wait = Duration::ZERO;
        }
        Ok(())
    }

    fn enough(&self, heard_for: Duration) -> bool {
        heard_for >= ONCE
    }

    fn sheet(&self) -> Sheet {
        self.buses.sheet()
    }

    fn document(&self) -> Value {
        self.buses.document()
    }
}
