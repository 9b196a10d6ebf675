//! The bus: who sends when, who receives what.

use core::fmt;
use core::time::Duration;
use std::collections::VecDeque;

use oorandom::Rand64;
use pdo::Frame;

use super::bits::{WireBits, arbitration};
use super::counters::{Counters, State};
use super::faults::{self, Fault, Faults};

/// Frames that a station's transmit queue holds.
pub const QUEUE: usize = 64;
/// Bits between two frames.
pub const INTERMISSION: u64 = 3;
/// Bits that an error-passive transmitter waits in addition after its own frame.
const SUSPEND: u64 = 8;
/// Bits of an error flag, and of the error delimiter.
const FLAG: u64 = 6;
const ERROR_DELIMITER: u64 = 8;
/// Recessive bits that end bus-off: 128 times 11.
const RECOVERY: u64 = 128 * 11;

/// A station's place on the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct StationId(usize);

/// What the bus tells a station.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event {
    /// A frame of another station.
    Received(Frame),
    /// An error frame: what was wrong, and whether this station was the transmitter.
    Error {
        /// What was wrong.
        kind: ErrorKind,
        /// Whether this station was sending.
        transmitter: bool,
    },
    /// The station's error state has changed.
    State(State),
    /// Bus-off took the frames that waited to be sent.
    Discarded(usize),
}

/// What an error frame was sent for (ISO 11898-1, error detection).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ErrorKind {
    /// The transmitter saw another bit than it sent.
    Bit,
    /// Six equal bits.
    Stuff,
    /// Nobody acknowledged.
    Acknowledge,
}

impl fmt::Display for ErrorKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bit => "bit error",
            Self::Stuff => "stuff error",
            Self::Acknowledge => "no acknowledge",
        })
    }
}

/// Why a frame was not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum TransmitError {
    /// The station's queue holds [`QUEUE`] frames.
    QueueFull,
    /// The station is bus-off or not connected.
    OffBus,
}

impl fmt::Display for TransmitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::QueueFull => write!(f, "the transmit queue is full, {QUEUE} frames wait"),
            Self::OffBus => f.write_str("the station is off the bus"),
        }
    }
}

impl core::error::Error for TransmitError {}

/// What the bus has seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Statistics {
    /// Frames sent without error.
    pub frames: u64,
    /// Error frames.
    pub errors: u64,
    /// Frames that a fault has touched.
    pub faulty: u64,
    /// Bits of all frames and error frames, intermissions included.
    pub bits: u64,
}

#[derive(Debug)]
struct Station {
    connected: bool,
    /// Taken away for good.
    vacant: bool,
    /// Every frame that it sends meets a bit error.
    broken: bool,
    counters: Counters,
    state: State,
    queue: VecDeque<(Duration, Frame)>,
    /// An error-passive transmitter may not start before.
    suspended: Duration,
    /// End of recovery from bus-off.
    recovering: Option<Duration>,
    inbox: VecDeque<(Duration, Event)>,
}

impl Station {
    fn on_bus(&self) -> bool {
        self.connected && self.state != State::BusOff
    }

    /// When it can begin to send; `None` if it has nothing to send or may not.
    fn ready(&self) -> Option<Duration> {
        let (since, _) = self.queue.front().filter(|_| self.on_bus())?;
        Some((*since).max(self.suspended))
    }

    fn note_state(&mut self, at: Duration) {
        let state = self.counters.state();
        if state == self.state {
            return;
        }
        self.state = state;
        self.inbox.push_back((at, Event::State(state)));
        if state == State::BusOff && !self.queue.is_empty() {
            self.inbox.push_back((at, Event::Discarded(self.queue.len())));
            self.queue.clear();
        }
    }
}

/// What is on the wire.
#[derive(Debug)]
struct Slot {
    /// The stations that send: more than one only if their frames are the same up to arbitration's end.
    senders: Vec<usize>,
    frame: Frame,
    start: Duration,
    /// End of the frame or of the error delimiter, in bits from the start.
    end: u64,
    outcome: Result<Option<Fault>, ErrorKind>,
}

/// One CAN bus. See the [module](super) for what it models.
///
/// * commands: [`connect`](Self::connect), [`send`](Self::send), …
/// * input: [`handle_timeout`](Self::handle_timeout), time goes on
/// * output: [`poll_event`](Self::poll_event) of each station, [`poll_timeout`](Self::poll_timeout)
///
/// A frame is received at the end of its last bit. Stations that want to send while the bus is free
/// start together if they became ready at the same moment; nothing else is rounded to a bit grid.
#[derive(Debug)]
pub struct Bus {
    bit_rate: u32,
    faults: Faults,
    random: Rand64,
    scripted: VecDeque<(u64, Fault)>,
    stations: Vec<Station>,
    slot: Option<Slot>,
    /// The bus is free from then on, intermission over.
    free: Duration,
    /// Transmissions begun, to number faults.
    begun: u64,
    delayed: Vec<(Duration, Vec<usize>, Frame)>,
    statistics: Statistics,
}

impl Bus {
    /// A bus without stations at this many bits per second.
    #[must_use]
    pub fn new(bit_rate: u32, faults: Faults) -> Self {
        Self {
            bit_rate: bit_rate.max(1),
            faults,
            random: Rand64::new(u128::from(faults.seed)),
            scripted: VecDeque::new(),
            stations: Vec::new(),
            slot: None,
            free: Duration::ZERO,
            begun: 0,
            delayed: Vec::new(),
            statistics: Statistics::default(),
        }
    }

    /// Bits per second.
    #[must_use]
    pub const fn bit_rate(&self) -> u32 {
        self.bit_rate
    }

    /// Time that so many bits take, exact to the nanosecond.
    #[must_use]
    pub fn time(&self, bits: u64) -> Duration {
        bits_time(self.bit_rate, bits)
    }

    /// Other faults from now on.
    pub fn set_faults(&mut self, faults: Faults) {
        self.faults = faults;
        self.random = Rand64::new(u128::from(faults.seed));
    }

    /// One fault for the transmission with this number, counted from 0 since the bus was made,
    /// repetitions included. Numbers must come in ascending order.
    pub fn script(&mut self, transmission: u64, fault: Fault) {
        self.scripted.push_back((transmission, fault));
    }

    /// Transmissions begun so far, repetitions included.
    #[must_use]
    pub const fn transmissions(&self) -> u64 {
        self.begun
    }

    /// What the bus has seen.
    #[must_use]
    pub const fn statistics(&self) -> Statistics {
        self.statistics
    }

    /// Adds a station, error active.
    pub fn connect(&mut self) -> StationId {
        let new = Station {
            connected: true,
            vacant: false,
            broken: false,
            counters: Counters::default(),
            state: State::Active,
            queue: VecDeque::new(),
            suspended: Duration::ZERO,
            recovering: None,
            inbox: VecDeque::new(),
        };
        if let Some((index, place)) = self.stations.iter_mut().enumerate().find(|(_, old)| old.vacant) {
            *place = new;
            return StationId(index);
        }
        self.stations.push(new);
        StationId(self.stations.len() - 1)
    }

    /// Takes a station away for good; its place goes to the next one that connects.
    pub fn disconnect(&mut self, station: StationId) {
        self.plug(station, false);
        if let Some(station) = self.stations.get_mut(station.0) {
            station.vacant = true;
            station.inbox.clear();
        }
    }

    /// Plugs a station's connector out (`false`), its queue emptied, or in again, error active.
    pub fn plug(&mut self, station: StationId, connected: bool) {
        if let Some(station) = self.stations.get_mut(station.0) {
            station.connected = connected;
            station.queue.clear();
            station.counters = Counters::default();
            station.state = State::Active;
            station.recovering = None;
        }
    }

    /// Breaks a station's transmitter, or repairs it: every frame that it sends meets a bit error.
    pub fn break_transmitter(&mut self, station: StationId, broken: bool) {
        if let Some(station) = self.stations.get_mut(station.0) {
            station.broken = broken;
        }
    }

    /// Begins recovery from bus-off: after 128 times 11 recessive bits the station is error active.
    pub fn restart(&mut self, now: Duration, station: StationId) {
        let end = now.saturating_add(self.time(RECOVERY));
        if let Some(station) = self.stations.get_mut(station.0)
            && station.state == State::BusOff
        {
            station.recovering = Some(end);
        }
    }

    /// A station's error counters.
    #[must_use]
    pub fn counters(&self, station: StationId) -> Counters {
        self.stations.get(station.0).map_or_else(Counters::default, |station| station.counters)
    }

    /// A station's error state.
    #[must_use]
    pub fn state(&self, station: StationId) -> State {
        self.stations.get(station.0).map_or(State::BusOff, |station| station.state)
    }

    /// Frames that a station's queue still takes; none while it is off the bus.
    #[must_use]
    pub fn room(&self, station: StationId) -> usize {
        let station = self.stations.get(station.0).filter(|station| station.on_bus());
        station.map_or(0, |station| QUEUE.saturating_sub(station.queue.len()))
    }

    /// Queues a frame. It is on the wire when [`handle_timeout`](Self::handle_timeout) finds the bus free
    /// and the frame wins arbitration.
    ///
    /// # Errors
    /// [`TransmitError`]: the queue is full, or the station is off the bus.
    pub fn send(&mut self, now: Duration, station: StationId, frame: Frame) -> Result<(), TransmitError> {
        let station = self.stations.get_mut(station.0).filter(|station| station.on_bus());
        let station = station.ok_or(TransmitError::OffBus)?;
        if station.queue.len() >= QUEUE {
            return Err(TransmitError::QueueFull);
        }
        station.queue.push_back((now, frame));
        Ok(())
    }

    /// What a station has to be told, in order, and when it happened.
    pub fn poll_event(&mut self, station: StationId) -> Option<(Duration, Event)> {
        self.stations.get_mut(station.0)?.inbox.pop_front()
    }

    /// When something happens next.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Duration> {
        let delayed = self.delayed.iter().map(|(at, ..)| *at);
        let recovering = self.stations.iter().filter_map(|station| station.recovering);
        let wire = match &self.slot {
            Some(slot) => Some(slot.start.saturating_add(self.time(slot.end))),
            None => self.next_start(),
        };
        delayed.chain(recovering).chain(wire).min()
    }

    fn next_start(&self) -> Option<Duration> {
        Some(self.stations.iter().filter_map(Station::ready).min()?.max(self.free))
    }

    /// Lets everything happen that is due by `now`.
    pub fn handle_timeout(&mut self, now: Duration) {
        while let Some(at) = self.poll_timeout().filter(|at| *at <= now) {
            for station in &mut self.stations {
                if station.recovering.is_some_and(|end| end <= at) {
                    station.recovering = None;
                    station.counters = Counters::default();
                    station.note_state(at);
                }
            }
            self.deliver_delayed(at);
            let ends = |slot: &mut Slot| slot.start.saturating_add(bits_time(self.bit_rate, slot.end)) <= at;
            if let Some(slot) = self.slot.take_if(ends) {
                self.finish(&slot, at);
            } else if self.slot.is_none() && self.next_start().is_some_and(|start| start <= at) {
                self.begin(at);
            }
        }
    }

    fn deliver_delayed(&mut self, at: Duration) {
        let mut due: Vec<_> = self.delayed.extract_if(.., |(due, ..)| *due <= at).collect();
        due.sort_by_key(|(due, ..)| *due);
        for (due, senders, frame) in due {
            self.deliver(due, &senders, frame);
        }
    }

    /// Arbitration, and what becomes of the winner's frame.
    fn begin(&mut self, at: Duration) {
        let contenders: Vec<(usize, Frame)> = self
            .stations
            .iter()
            .enumerate()
            .filter(|(_, station)| station.ready().is_some_and(|ready| ready <= at))
            .filter_map(|(index, station)| station.queue.front().map(|(_, frame)| (index, *frame)))
            .collect();
        let Some(lowest) = contenders.iter().map(|(_, frame)| arbitration(frame)).min() else { return };
        let winners: Vec<_> =
            contenders.into_iter().filter(|(_, frame)| arbitration(frame) == lowest).collect();
        let Some(&(_, frame)) = winners.first() else { return };
        let senders: Vec<usize> = winners.iter().map(|(index, _)| *index).collect();
        let wire = WireBits::new(&frame);
        let fault = self.fault();
        let others = || self.stations.iter().enumerate().filter(|(index, _)| !senders.contains(index));
        let heard = others().any(|(_, station)| station.on_bus());
        let active = others().any(|(_, station)| station.on_bus() && station.state < State::Passive);
        let broken = senders.iter().any(|index| self.stations.get(*index).is_some_and(|s| s.broken));
        let clash = clash(&wire, &winners);

        let body = wire.stuffed().len() - wire.arbitration_len();
        // Where the error is seen, and as what.
        let error = if broken {
            Some((wire.arbitration_len(), ErrorKind::Bit))
        } else if let Some(position) = clash {
            Some((position, ErrorKind::Bit))
        } else if let Some(Fault::WireError(number)) = fault {
            Some((wire.arbitration_len() + number as usize % body.max(1), ErrorKind::Bit))
        } else if !heard {
            Some((wire.acknowledge_slot(), ErrorKind::Acknowledge))
        } else {
            None
        };
        let (end, outcome) = match error {
            None => (wire.frame_len() as u64, Ok(fault)),
            Some((position, kind)) => {
                let passive = senders
                    .iter()
                    .all(|index| self.stations.get(*index).is_some_and(|s| s.state >= State::Passive));
                let flags = flags(&wire, position, passive, active && kind != ErrorKind::Acknowledge);
                (position as u64 + 1 + flags + ERROR_DELIMITER, Err(kind))
            }
        };
        self.slot = Some(Slot { senders, frame, start: at, end, outcome });
    }

    fn fault(&mut self) -> Option<Fault> {
        let number = self.begun;
        self.begun += 1;
        let fault = if self.scripted.front().is_some_and(|(at, _)| *at == number) {
            self.scripted.pop_front().map(|(_, fault)| fault)
        } else {
            faults::draw(&self.faults, &mut self.random)
        };
        self.statistics.faulty += u64::from(fault.is_some());
        fault
    }

    fn finish(&mut self, slot: &Slot, at: Duration) {
        let mut bits = slot.end + INTERMISSION;
        match slot.outcome {
            Err(kind) => {
                self.statistics.errors += 1;
                self.count_error(at, &slot.senders, kind);
            }
            Ok(fault) => {
                let mut frame = slot.frame;
                let repeat = matches!(fault, Some(Fault::Duplicate));
                match fault {
                    Some(Fault::Lose) => {}
                    Some(Fault::Delay(delay)) => {
                        self.delayed.push((at.saturating_add(delay), slot.senders.clone(), frame));
                    }
                    Some(Fault::Corrupt(bit)) => {
                        frame = turn_over(&frame, bit);
                        self.deliver(at, &slot.senders, frame);
                    }
                    _ => self.deliver(at, &slot.senders, frame),
                }
                if repeat {
                    // The senders saw an error in the last bit, after the receivers were content.
                    self.statistics.errors += 1;
                    bits += FLAG + ERROR_DELIMITER;
                    self.count_error(at, &slot.senders, ErrorKind::Bit);
                } else {
                    self.statistics.frames += 1;
                    self.count_success(at, slot);
                }
            }
        }
        self.statistics.bits += bits;
        self.free = slot.start.saturating_add(self.time(bits));
        let suspended = slot.start.saturating_add(self.time(bits + SUSPEND));
        for index in &slot.senders {
            if let Some(station) = self.stations.get_mut(*index)
                && station.state == State::Passive
            {
                station.suspended = suspended;
            }
        }
    }

    fn deliver(&mut self, at: Duration, senders: &[usize], frame: Frame) {
        for (index, station) in self.stations.iter_mut().enumerate() {
            if station.on_bus() && !senders.contains(&index) {
                station.inbox.push_back((at, Event::Received(frame)));
            }
        }
    }

    fn count_success(&mut self, at: Duration, slot: &Slot) {
        for (index, station) in self.stations.iter_mut().enumerate().filter(|(_, s)| s.on_bus()) {
            if slot.senders.contains(&index) {
                // Unplugged and in again meanwhile: the queue is another one.
                station.queue.pop_front_if(|(_, frame)| *frame == slot.frame);
                station.counters.transmit_done();
            } else {
                station.counters.receive_done();
            }
            station.note_state(at);
        }
    }

    fn count_error(&mut self, at: Duration, senders: &[usize], kind: ErrorKind) {
        for (index, station) in self.stations.iter_mut().enumerate().filter(|(_, s)| s.on_bus()) {
            let transmitter = senders.contains(&index);
            let kind = if transmitter { kind } else { ErrorKind::Stuff };
            station.inbox.push_back((at, Event::Error { kind, transmitter }));
            if !transmitter {
                station.counters.receive_error();
            } else if kind != ErrorKind::Acknowledge || station.state < State::Passive {
                // An error-passive station that nobody acknowledges is alone: it does not count on.
                station.counters.transmit_error();
            }
            station.note_state(at);
        }
    }
}

fn bits_time(bit_rate: u32, bits: u64) -> Duration {
    let nanos = u128::from(bits) * 1_000_000_000 / u128::from(bit_rate);
    Duration::from_nanos(u64::try_from(nanos).unwrap_or(u64::MAX))
}

/// The first bit at which frames that arbitration could not tell apart differ.
fn clash(wire: &WireBits, winners: &[(usize, Frame)]) -> Option<usize> {
    let others = winners.iter().skip(1).map(|(_, frame)| WireBits::new(frame));
    let differs = |other: WireBits| {
        let (one, two) = (wire.stuffed(), other.stuffed());
        one.iter().zip(two).position(|(one, two)| one != two).or_else(|| {
            let shorter = one.len().min(two.len());
            (one.len() != two.len()).then_some(shorter)
        })
    };
    others.filter_map(differs).min()
}

/// Bits of the superposed error flags after an error seen at `position`: six of the transmitter's, and
/// six of the others' from the moment at which they see six equal bits.
fn flags(wire: &WireBits, position: usize, passive: bool, others_answer: bool) -> u64 {
    if !others_answer {
        return FLAG;
    }
    // The turned-over bit, and the bits before it that are equal to the flag's.
    let level = passive;
    let seen = wire.stuffed().get(position).map_or(level, |bit| !bit);
    let before = wire.stuffed().get(..position).unwrap_or(&[]).iter().rev();
    let run = if seen == level { 1 + before.take_while(|bit| **bit == level).count() as u64 } else { 0 };
    2 * FLAG - run.min(FLAG)
}

fn turn_over(frame: &Frame, bit: u32) -> Frame {
    let mut data = [0; 8];
    let len = frame.data().len();
    for (to, from) in data.iter_mut().zip(frame.data()) {
        *to = *from;
    }
    let bit = bit as usize % (8 * len).max(1);
    if let Some(byte) = data.get_mut(bit / 8) {
        *byte ^= 1 << (bit % 8);
    }
    // Remote frames carry nothing that could be turned over.
    Frame::data_frame(frame.id(), data.get(..len).unwrap_or(&[])).filter(|_| len > 0).unwrap_or(*frame)
}
