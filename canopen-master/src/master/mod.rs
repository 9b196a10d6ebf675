//! The whole master of one bus: every engine of this crate's master side behind one dispatch.

mod command;
mod event;
mod jobs;
mod node;
mod pace;
mod receive;
mod timer;
mod transmit;

use core::time::Duration;

use pdo::cob::DefaultPdo;
use pdo::{Frame, NodeId};

use crate::clock::earlier;
use crate::emcy::History;
use crate::nmt::{Command, State};
use crate::node_set::NodeSet;
use crate::ring::Ring;
use crate::scan::{self, BusState, Info};
use crate::sdo::Buffer;
use crate::{lss, sync};

pub use crate::bus::BusStatus;
pub use event::{Event, Refused, SubmitError};
pub use node::Image;

use event::Notice;
use node::{Job, Node, UNUSUAL};
use pace::Pace;

/// Frames of NMT, TIME and [`Master::send`] that wait to be sent. PDOs, guarding, SDO and boot wait
/// where they arise, at most one frame per service and node.
pub const QUEUE: usize = 16;
/// Emergencies in the history.
pub const HISTORY: usize = 32;
/// NMT commands that wait for their confirmation at once.
pub const NMT_COMMANDS: usize = 8;
/// Events, other than outcomes, held until polled.
const EVENTS: usize = 32;

/// Names one NMT command from [`Master::nmt`] to its outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct NmtTicket(u32);

/// How the master works; everything that concerns single nodes is set by commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// Time that a node has to show the state that an NMT command leads to; a node with a longer
    /// heartbeat or guarding time has that long.
    pub confirm: Duration,
    /// Bits per second, or less: paces scans to what the bus can carry.
    pub bit_rate: u32,
    /// Times of LSS.
    pub lss: lss::Config,
}

/// 500 kbit/s (decision 12); the times are project-defined.
impl Default for Config {
    fn default() -> Self {
        Self { confirm: Duration::from_millis(500), bit_rate: 500_000, lss: lss::Config::default() }
    }
}

#[derive(Debug, Clone, Copy)]
struct NmtJob {
    ticket: NmtTicket,
    command: Command,
    waiting: NodeSet,
    confirmed: NodeSet,
    missing: NodeSet,
    /// When nodes without error control are asked, once.
    ask: Option<Duration>,
    deadline: Duration,
}

impl NmtJob {
    const fn is_over(&self) -> bool {
        self.waiting.is_empty()
    }
}

#[derive(Debug, Clone, Copy)]
struct ScanJob {
    options: scan::Options,
    todo: NodeSet,
    active: NodeSet,
    found: NodeSet,
    silent: NodeSet,
}

impl ScanJob {
    const fn is_over(&self) -> bool {
        self.todo.is_empty() && self.active.is_empty()
    }
}

/// CANopen master for nodes 1 to `N` (1…127) on one bus. `B` is the buffer of the application's SDO
/// transfers; `'d` is how long the configurations for [`boot`](Self::boot) live.
///
/// - Commands: [`nmt`](Self::nmt), [`set_guarding`](Self::set_guarding),
///   [`set_heartbeat`](Self::set_heartbeat), [`set_sync`](Self::set_sync), [`upload`](Self::upload),
///   [`download`](Self::download), [`cancel`](Self::cancel), [`expect_pdo`](Self::expect_pdo),
///   [`write_pdo`](Self::write_pdo),
///   [`boot`](Self::boot), [`scan`](Self::scan), [`lss`](Self::lss), [`send`](Self::send).
/// - Input: [`handle_frame`](Self::handle_frame), [`handle_timeout`](Self::handle_timeout), and from
///   the adapter [`handle_bus`](Self::handle_bus), [`handle_refused`](Self::handle_refused),
///   [`handle_discarded`](Self::handle_discarded).
/// - Output: [`poll_transmit`](Self::poll_transmit), [`poll_event`](Self::poll_event),
///   [`poll_pdo`](Self::poll_pdo), [`poll_timeout`](Self::poll_timeout).
/// - Getters: [`state`](Self::state), [`pdo`](Self::pdo), [`info`](Self::info),
///   [`history`](Self::history), [`waiting`](Self::waiting), …
///
/// Frames are dispatched by identifier to an array, without search. Timers of the nodes share one
/// lower bound, so that a frame costs no look at the other nodes; it is early now and then, which a
/// call of `handle_timeout` puts right.
///
/// Nothing is lost silently: outcomes wait where they arise until polled; losses of nodes are told
/// late rather than not at all where nobody polls; other events that find no place are counted in
/// [`Event::Overflow`].
#[derive(Debug)]
pub struct Master<'d, B, const N: usize> {
    config: Config,
    nodes: [Node<'d, B>; N],
    /// Nodes that have shown a state.
    seen: NodeSet,
    guard_due: NodeSet,
    ask_due: NodeSet,
    reset_due: NodeSet,
    start_due: NodeSet,
    /// Nodes whose client may have a frame to send.
    sdo_ready: NodeSet,
    /// Nodes whose client may have an outcome for the application.
    sdo_ended: NodeSet,
    /// Nodes with a transfer under way.
    sdo_busy: NodeSet,
    sdo_turn: NodeId,
    booted: NodeSet,
    input_new: [NodeSet; 4],
    input_flag: [NodeSet; 4],
    output_due: [NodeSet; 4],
    output_flag: [NodeSet; 4],
    queue: Ring<Frame, QUEUE>,
    /// Not taken by the adapter: goes first.
    refused: Option<Frame>,
    refused_told: bool,
    sync: Option<sync::Producer>,
    lss: lss::Master,
    history: History<HISTORY>,
    nmt: [Option<NmtJob>; NMT_COMMANDS],
    nmt_waiting: NodeSet,
    next_ticket: u32,
    scan: Option<ScanJob>,
    pace: Pace,
    events: Ring<Notice, EVENTS>,
    lost_events: u32,
    bus: BusStatus,
    discarded: u32,
    malformed: u32,
    /// No deadline of a node or of NMT is before this.
    bound: Option<Duration>,
}

impl<B: Buffer, const N: usize> Default for Master<'_, B, N> {
    fn default() -> Self {
        Self::new(Config::default())
    }
}

impl<'d, B: Buffer, const N: usize> Master<'d, B, N> {
    /// Its last node.
    const LAST: NodeId = {
        assert!(N >= 1 && N <= 127, "a CANopen network has nodes 1 to 127");
        match NodeId::new(N as u8) {
            Ok(node) => node,
            Err(_) => NodeId::MAX,
        }
    };

    /// A master that does nothing yet.
    #[must_use]
    pub fn new(config: Config) -> Self {
        Self {
            config,
            nodes: core::array::from_fn(|index| {
                Node::new(NodeId::new(index as u8 + 1).unwrap_or(Self::LAST))
            }),
            seen: NodeSet::EMPTY,
            guard_due: NodeSet::EMPTY,
            ask_due: NodeSet::EMPTY,
            reset_due: NodeSet::EMPTY,
            start_due: NodeSet::EMPTY,
            sdo_ready: NodeSet::EMPTY,
            sdo_ended: NodeSet::EMPTY,
            sdo_busy: NodeSet::EMPTY,
            sdo_turn: NodeId::MAX,
            booted: NodeSet::EMPTY,
            input_new: [NodeSet::EMPTY; 4],
            input_flag: [NodeSet::EMPTY; 4],
            output_due: [NodeSet::EMPTY; 4],
            output_flag: [NodeSet::EMPTY; 4],
            queue: Ring::new(),
            refused: None,
            refused_told: false,
            sync: None,
            lss: lss::Master::new(config.lss),
            history: History::new(),
            nmt: [None; NMT_COMMANDS],
            nmt_waiting: NodeSet::EMPTY,
            next_ticket: 0,
            scan: None,
            pace: Pace::new(config.bit_rate),
            events: Ring::new(),
            lost_events: 0,
            bus: BusStatus::Active,
            discarded: 0,
            malformed: 0,
            bound: None,
        }
    }

    /// How it works.
    #[must_use]
    pub const fn config(&self) -> Config {
        self.config
    }

    /// The state that a node showed last; `None` if it has shown none.
    #[must_use]
    pub fn state(&self, node: NodeId) -> Option<State> {
        self.node(node)?.state
    }

    /// Nodes that have shown a state.
    #[must_use]
    pub const fn seen(&self) -> NodeSet {
        self.seen
    }

    /// Nodes that are lost by guarding or heartbeat.
    #[must_use]
    pub fn lost(&self) -> NodeSet {
        let lost = |node: &Node<'_, B>| {
            node.guard.is_some_and(|guard| guard.is_lost())
                || node.heartbeat.is_some_and(|consumer| consumer.is_lost())
        };
        NodeId::all().zip(&self.nodes).filter(|(_, node)| lost(node)).map(|(id, _)| id).collect()
    }

    /// TPDO 1…4 of a node as it came last.
    #[must_use]
    #[inline]
    pub fn pdo(&self, node: NodeId, number: DefaultPdo) -> Option<&Image> {
        self.node(node)?.inputs.get(number as usize - 1)
    }

    /// RPDO 1…4 of a node as it was written last.
    #[must_use]
    pub fn output(&self, node: NodeId, number: DefaultPdo) -> Option<&Image> {
        self.node(node)?.outputs.get(number as usize - 1)
    }

    /// What a scan has read of a node; `None` if it was silent, or never asked.
    #[must_use]
    pub fn info(&self, node: NodeId) -> Option<&Info> {
        self.node(node)?.info.as_ref()
    }

    /// Emergencies of all nodes, the latest first.
    #[must_use]
    pub const fn history(&self) -> &History<HISTORY> {
        &self.history
    }

    /// The adapter's state.
    #[must_use]
    pub const fn bus(&self) -> BusStatus {
        self.bus
    }

    /// Error control messages that were not one byte long or showed no state, and emergencies that
    /// were too short.
    #[must_use]
    pub const fn malformed(&self) -> u32 {
        self.malformed
    }

    /// Frames that wait to be sent.
    #[must_use]
    pub fn waiting(&self) -> usize {
        let outputs: usize = self.output_due.iter().map(|set| set.len()).sum();
        let asked = self.guard_due.or(self.ask_due).len() + self.reset_due.len() + self.start_due.len();
        self.queue.len() + usize::from(self.refused.is_some()) + outputs + asked + self.sdo_ready.len()
    }

    /// Bytes that one node costs; the rest of the engine is `size_of::<Master<_, N>>()` less `N`
    /// times this.
    #[must_use]
    pub const fn node_size() -> usize {
        size_of::<Node<'d, B>>()
    }

    /// Manual A's bus state: whether all of `expected` answered the last scan.
    #[must_use]
    pub fn bus_state(&self, expected: NodeSet) -> BusState {
        let answered = |node| self.info(node).is_some();
        if self.bus.is_on() && expected.iter().all(answered) { BusState::Ok } else { BusState::Warn }
    }

    /// A line of manual A's table for a node, with the numbers of its objects; the flags of new input
    /// and output are cleared.
    pub fn row(&mut self, node: NodeId, input: Option<u8>, output: Option<u8>) -> scan::Row {
        let take =
            |sets: &mut [NodeSet; 4]| sets.iter_mut().map(|set| set.remove(node)).max().unwrap_or(false);
        scan::Row {
            node,
            input,
            output,
            info: self.info(node).copied(),
            new_input: take(&mut self.input_flag),
            new_output: take(&mut self.output_flag),
        }
    }

    fn node(&self, node: NodeId) -> Option<&Node<'d, B>> {
        self.nodes.get(usize::from(node.raw()) - 1)
    }

    /// For anything that may change what the node's next heartbeat means.
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    fn node_mut(&mut self, node: NodeId) -> Option<&mut Node<'d, B>> {
        let node = self.nodes.get_mut(usize::from(node.raw()) - 1)?;
        node.usual = UNUSUAL;
        Some(node)
    }

    /// Room in the queue of events.
    const fn event_room(&self) -> usize {
        EVENTS - self.events.len()
    }

    fn tell(&mut self, notice: Notice) {
        if self.events.push(notice).is_err() {
            self.lost_events = self.lost_events.saturating_add(1);
        }
    }

    /// A deadline has been set.
    #[cfg_attr(target_pointer_width = "32", inline(never))]
    #[cfg_attr(not(target_pointer_width = "32"), inline)]
    fn due(&mut self, at: Option<Duration>) {
        self.bound = earlier(self.bound, at);
    }

    /// What happened, until `None`.
    pub fn poll_event(&mut self) -> Option<Event<B>> {
        if let Some(notice) = self.events.pop() {
            return Some(notice.into());
        }
        if self.lost_events > 0 {
            return Some(Event::Overflow(core::mem::take(&mut self.lost_events)));
        }
        if let Some(job) = self.nmt.iter_mut().find_map(|job| job.take_if(|job| job.is_over())) {
            let NmtJob { ticket, command, confirmed, missing, .. } = job;
            return Some(Event::Nmt { ticket, command, confirmed, missing });
        }
        while let Some(node) = self.sdo_ended.pop() {
            if let Some(finished) = self.take_finished(node) {
                return Some(Event::Sdo { node, finished });
            }
        }
        while let Some(id) = self.booted.pop() {
            let Some(node) = self.node_mut(id) else { continue };
            if let Job::Booted(result) = core::mem::replace(&mut node.job, Job::None) {
                return Some(Event::Booted { node: id, result });
            }
        }
        if let Some(ScanJob { found, silent, .. }) = self.scan.take_if(|scan| scan.is_over()) {
            return Some(Event::Scanned { found, silent });
        }
        self.lss.poll_event().map(|(ticket, outcome)| Event::Lss { ticket, outcome })
    }

    /// A PDO that has come since it was polled last: its node and number. The data are in
    /// [`pdo`](Self::pdo).
    #[inline]
    pub fn poll_pdo(&mut self) -> Option<(NodeId, DefaultPdo)> {
        for (set, number) in self.input_new.iter_mut().zip(DefaultPdo::ALL) {
            if let Some(node) = set.pop() {
                return Some((node, number));
            }
        }
        None
    }
}
