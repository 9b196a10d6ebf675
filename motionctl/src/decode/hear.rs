//! Frames in, what they are out: of captures and of buses that are listened to.

use canopen_master::trace::{Kind, Tracer, Transfer};
use motion_io::capture::{Bus, Reader, Record, Time, Times};

use super::names::Names;
use super::{Totals, name_of};

/// Says what a frame is, to a machine or to a person.
pub(crate) trait Teller {
    /// The times of the capture are differences. Before the first frame.
    fn deltas(&mut self) {}
    /// One frame. FD frames and error reports are of an unknown kind. `time` has differences added up.
    fn frame(&mut self, record: &Record, time: Option<Time>, bus: Option<&str>, kind: &Kind, tracer: &Tracer);
    /// A transfer that has ended. `given` is the time of its last frame as the capture has it.
    fn transfer(&mut self, transfer: &Transfer, given: Option<Time>, bus: Option<&str>);
    /// What is written so far.
    fn text(&mut self) -> &mut Vec<u8>;
}

/// The number of a frame's bus; frames without a bus are on one of their own.
pub(crate) fn number_of(record: &Record) -> u16 {
    record.bus.map_or(u16::MAX, |bus| bus.0)
}

/// Time of a transfer's last frame.
fn ended(transfer: &Transfer) -> Option<Time> {
    transfer.ended.map(Time::from_zero)
}

/// Understands frames in their order and has them told.
#[derive(Debug)]
pub(crate) struct Ear {
    tracer: Tracer,
    /// Names of the buses by their numbers.
    buses: Vec<Option<String>>,
    /// Times are differences, and their sum so far.
    deltas: bool,
    sum: i64,
}

impl Ear {
    pub(crate) fn new(names: &Names, can_link: bool) -> Self {
        let mut tracer = Tracer::new();
        tracer.set_can_link(can_link);
        names.teach(&mut tracer);
        Self { tracer, buses: Vec::new(), deltas: false, sum: 0 }
    }

    pub(crate) const fn tracer(&self) -> &Tracer {
        &self.tracer
    }

    /// The name of a bus by its number, where it has one.
    pub(crate) fn bus_name(&self, number: u16) -> Option<&str> {
        self.buses.get(usize::from(number)).and_then(Option::as_deref)
    }

    /// Whether a bus has to be named.
    pub(crate) const fn has_several_buses(&self) -> bool {
        self.buses.len() > 1
    }

    /// The frame that the reader of a capture has just read.
    pub(crate) fn hear_next<R: std::io::Read>(
        &mut self,
        reader: &Reader<R>,
        teller: &mut impl Teller,
        totals: &mut Totals,
    ) {
        if !core::mem::replace(&mut self.deltas, reader.times() == Times::Deltas) && self.deltas {
            teller.deltas();
        }
        let record = reader.record();
        while let Some(bus) = record.bus
            && self.buses.len() <= usize::from(bus.0)
        {
            let next = u16::try_from(self.buses.len()).map_or(bus, Bus);
            self.buses.push(reader.bus_name(next).map(str::to_owned));
        }
        self.hear(record, teller, totals);
    }

    /// One frame.
    #[inline]
    pub(crate) fn hear(&mut self, record: &Record, teller: &mut impl Teller, totals: &mut Totals) {
        let Self { tracer, buses, deltas, sum } = self;
        let name = |bus: u16| buses.get(usize::from(bus)).and_then(Option::as_deref);
        let bus = number_of(record);
        let time = match record.time {
            Some(Time(since_the_one_before)) if *deltas => {
                *sum = sum.saturating_add(since_the_one_before);
                Some(Time(*sum))
            }
            time => time,
        };
        let now = time.filter(|time| time.0 >= 0).map(Time::since_zero);
        let kind = match record.frame.classic() {
            Some(frame) if record.loopback => tracer.look(bus, frame),
            Some(frame) => tracer.handle_frame(now, bus, frame),
            None => Kind::Unknown,
        };
        totals.count(name_of(record.frame.kind, &kind), record.loopback);
        teller.frame(record, time, name(bus), &kind, tracer);
        while let Some(transfer) = tracer.poll_event() {
            let given = match *deltas {
                true => record.time.filter(|_| transfer.ended == now),
                false => ended(&transfer),
            };
            teller.transfer(&transfer, given, name(transfer.bus));
        }
    }

    /// The capture has ended, and with it every transfer that is still open.
    pub(crate) fn finish(&mut self, teller: &mut impl Teller) {
        self.tracer.finish();
        while let Some(transfer) = self.tracer.poll_event() {
            let bus = self.bus_name(transfer.bus);
            teller.transfer(&transfer, ended(&transfer).filter(|_| !self.deltas), bus);
        }
    }
}
