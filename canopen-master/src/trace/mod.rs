//! What a bus does, understood by listening: the decoder of captures and monitors.
//!
//! [`Tracer`] takes the frames of one or several buses in their order and says of each what it is
//! ([`Kind`]); SDO transfers come out whole when they end ([`Transfer`]). It sends nothing and
//! decides nothing: whatever the bus brings is described. It may start in the middle of the traffic.
//!
//! Which identifier belongs to which service begins with the predefined connection set (CiA 301,
//! 7.3.5) and follows the traffic: PDOs, their mapping and further SDO channels are learned from SDO
//! transfers that read or write 1005h, 1014h, 1200h…127Fh, 1400h…1BFFh, or given beforehand
//! ([`Tracer::learn`]) from an EDS or DCF.

mod bus;
mod kind;
mod mapping;
mod sdo;

use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::time::Duration;

use pdo::{Address, NodeId};

pub use kind::{Kind, Lss};
pub use mapping::{Field, Fields, Mapped, PdoDirection};
pub use sdo::{Content, Direction, MAX_KEPT, Mode, Outcome, SdoFrame, ShortFrame, Transfer, Way, WrongCrc};

use crate::nmt::State;
use bus::{BusState, Heard};

/// A passive decoder of CANopen traffic.
///
/// - Input: [`handle_frame`](Self::handle_frame), which returns what the frame is;
///   [`finish`](Self::finish) at the end of a capture.
/// - Output: [`poll_event`](Self::poll_event), SDO transfers that have ended.
/// - Knowledge given: [`learn`](Self::learn), [`set_can_link`](Self::set_can_link).
/// - Getters: [`state`](Self::state), [`mapped`](Self::mapped).
#[derive(Debug, Default)]
pub struct Tracer {
    /// By number, in order of appearance: captures have few.
    buses: Vec<(u16, BusState)>,
    /// Values of objects that hold on every bus from the start.
    given: Vec<(NodeId, Address, Vec<u8>)>,
    can_link: bool,
    events: VecDeque<Transfer>,
}

impl Tracer {
    /// A decoder that knows the predefined connection set.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Whether 101h…10Eh are channels of the CAN Link user protocol, on buses heard from now on.
    pub const fn set_can_link(&mut self, on: bool) {
        self.can_link = on;
    }

    /// Tells the value of an object of a node, as an EDS, a DCF or a person has it, for all buses.
    /// Communication and mapping parameters change how frames are understood from now on.
    pub fn learn(&mut self, node: NodeId, at: Address, value: &[u8]) {
        for (_, bus) in &mut self.buses {
            bus.learn(node, at, value);
        }
        self.given.push((node, at, value.into()));
    }

    /// Takes one frame of a bus and says what it is. `now` is `None` where nobody knows the time.
    #[inline]
    pub fn handle_frame(
        &mut self,
        now: Option<Duration>,
        bus: u16,
        frame: &impl embedded_can::Frame,
    ) -> Kind {
        match Heard::new(frame) {
            Some(frame) => self.handle(now, bus, frame),
            None => Kind::Unknown,
        }
    }

    fn handle(&mut self, now: Option<Duration>, bus: u16, frame: Heard<'_>) -> Kind {
        let at = match self.buses.iter().position(|(known, _)| *known == bus) {
            Some(at) => at,
            None => self.add_bus(bus),
        };
        match self.buses.get_mut(at) {
            Some((_, state)) => state.handle_frame(now, bus, frame, &mut self.events),
            None => Kind::Unknown,
        }
    }

    #[cold]
    fn add_bus(&mut self, bus: u16) -> usize {
        let mut state = BusState::new(self.can_link);
        for (node, at, value) in &self.given {
            state.learn(*node, *at, value);
        }
        self.buses.push((bus, state));
        self.buses.len() - 1
    }

    #[inline]
    fn bus(&self, bus: u16) -> Option<&BusState> {
        self.buses.iter().find(|(known, _)| *known == bus).map(|(_, state)| state)
    }

    /// Says what a frame is and draws no consequence from it: for copies of frames that a capture holds
    /// twice.
    #[must_use]
    pub fn look(&self, bus: u16, frame: &impl embedded_can::Frame) -> Kind {
        let Some(frame) = Heard::new(frame) else { return Kind::Unknown };
        match self.bus(bus) {
            Some(state) => state.look(frame),
            None => BusState::new(self.can_link).look(frame),
        }
    }

    /// The capture has ended: every transfer still open ends as incomplete.
    pub fn finish(&mut self) {
        for (_, state) in &mut self.buses {
            state.finish(&mut self.events);
        }
    }

    /// The next transfer that has ended.
    #[inline]
    pub fn poll_event(&mut self) -> Option<Transfer> {
        self.events.pop_front()
    }

    /// The state that a node last showed, or was last sent to.
    #[must_use]
    pub fn state(&self, bus: u16, node: NodeId) -> Option<State> {
        self.bus(bus)?.state(node)
    }

    /// What a frame of a PDO carries, object by object; nothing where its mapping is not known.
    #[must_use]
    #[inline]
    pub fn mapped<'a>(&'a self, bus: u16, kind: &Kind, data: &'a [u8]) -> Fields<'a> {
        let fields = match (kind, self.bus(bus)) {
            (&Kind::Pdo { node, direction, number, .. }, Some(state)) => {
                state.fields(node, direction, number)
            }
            _ => &[],
        };
        Fields::new(fields, data)
    }
}
