//! Node guarding and life guarding (CiA 301, 7.2.8.2.2.1), both roles.
//!
//! The master asks by a remote frame on 700h + node; the slave answers with its state in bits 0…6
//! and a toggle in bit 7, 0 in the first answer after boot-up and then alternating.

use core::time::Duration;

use embedded_can::{Id, StandardId};
use pdo::{Frame, NodeId, cob};

use crate::clock::{self, after_ms, earlier, is_due};
use crate::nmt::State;

/// Time between two requests to one node (decision 16).
pub const PERIOD: Duration = Duration::from_millis(100);

/// After how many periods without a good answer a node is lost (decision 16).
pub const LIFE_TIME_FACTOR: u8 = 3;

/// How one node is guarded: objects 100Ch and 100Dh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// Guard time in ms, at least 1.
    pub period_ms: u16,
    /// Life time factor, at least 1; the life time is period × factor.
    pub life_time_factor: u8,
}

impl Config {
    /// Time between two requests.
    #[must_use]
    pub const fn period(self) -> Duration {
        Duration::from_millis(if self.period_ms == 0 { 1 } else { self.period_ms as u64 })
    }

    /// After what silence the other side is lost.
    #[must_use]
    pub fn life_time(self) -> Duration {
        Duration::from_millis(u64::from(self.life_time_ms()))
    }

    /// The same in ms.
    #[must_use]
    pub fn life_time_ms(self) -> u32 {
        u32::from(self.period_ms.max(1)) * u32::from(self.life_time_factor.max(1))
    }
}

impl Default for Config {
    fn default() -> Self {
        Self { period_ms: PERIOD.as_millis() as u16, life_time_factor: LIFE_TIME_FACTOR }
    }
}

/// The remote frame that asks a node for its state.
#[must_use]
pub fn request(node: NodeId) -> Option<Frame> {
    let id = StandardId::new(cob::ERROR_CONTROL + u16::from(node.raw()))?;
    Frame::remote_frame(Id::Standard(id), 1)
}

/// What guarding tells of a node, each once.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Event {
    /// No good answer for the life time.
    Lost,
    /// A good answer or a boot-up message after `Lost`.
    Back,
    /// An answer with the toggle of the one before; it counts as none. Told once until a good one.
    Toggle {
        /// The toggle that was expected.
        expected: bool,
    },
    /// The node sends heartbeats as well, which a guarded node does not (CiA 301, 7.2.8.2.2). They are no
    /// answers. Told once.
    Heartbeats,
}

/// So many unasked messages that are no answers are heartbeats; one may be the answer to a request from before
/// a boot-up.
const HEARTBEATS: u8 = 2;

/// The master's side for one node.
#[derive(Debug, Clone, Copy)]
pub struct Guard {
    config: Config,
    next: Duration,
    /// Last good answer, or the start of guarding.
    last: Duration,
    /// The toggle of the next answer; `None` before the first answer of a node that may have been
    /// guarded before.
    toggle: Option<bool>,
    /// Whether a request waits for its answer.
    asked: bool,
    /// A request had no answer: if the answer was lost the toggle goes on, if the request was, it does not.
    missed: bool,
    lost: bool,
    toggle_told: bool,
    /// Messages that can only be heartbeats, so far.
    heartbeats: u8,
}

impl Guard {
    /// Starts guarding; the first request is due at once.
    #[must_use]
    pub const fn new(config: Config, now: Duration) -> Self {
        Self {
            config,
            next: now,
            last: now,
            toggle: None,
            asked: false,
            missed: false,
            lost: false,
            toggle_told: false,
            heartbeats: 0,
        }
    }

    /// How it guards.
    #[must_use]
    pub const fn config(&self) -> Config {
        self.config
    }

    /// Whether the node is lost.
    #[must_use]
    pub const fn is_lost(&self) -> bool {
        self.lost
    }

    /// When [`handle_timeout`](Self::handle_timeout) has something to do.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Duration> {
        earlier(Some(self.next), self.life_end())
    }

    /// Returns whether a request is due now, and whether the node has been lost by now.
    pub fn handle_timeout(&mut self, now: Duration) -> (bool, Option<Event>) {
        let mut event = None;
        if is_due(self.life_end(), now) {
            self.lost = true;
            event = Some(Event::Lost);
        }
        let due = is_due(Some(self.next), now);
        if due {
            self.missed |= core::mem::replace(&mut self.asked, true);
            self.next = clock::next(self.next, self.config.period(), now);
        }
        (due, event)
    }

    /// Whether an error control byte is the answer to a request, where the same node may also send
    /// heartbeats: these have bit 7 clear and come unasked.
    #[must_use]
    pub fn is_answer(&self, byte: u8) -> bool {
        let toggle = byte & 0x80 != 0;
        toggle || self.asked && self.toggle != Some(true)
    }

    /// Takes an answer, or a heartbeat.
    pub fn handle_answer(&mut self, now: Duration, byte: u8) -> Option<Event> {
        let toggle = byte & 0x80 != 0;
        let wrong = self.toggle.filter(|expected| *expected != toggle);
        if !toggle && self.is_heartbeat(wrong.is_some()) {
            self.heartbeats = self.heartbeats.saturating_add(1);
            return (self.heartbeats == HEARTBEATS).then_some(Event::Heartbeats);
        }
        self.asked = false;
        let missed = core::mem::take(&mut self.missed);
        if let Some(expected) = wrong
            && !missed
        {
            return (!core::mem::replace(&mut self.toggle_told, true)).then_some(Event::Toggle { expected });
        }
        self.toggle = Some(!toggle);
        self.toggle_told = false;
        self.alive(now)
    }

    /// Whether a message with toggle 0 is no answer: nobody has asked, or the toggle is wrong where heartbeats
    /// have been seen.
    const fn is_heartbeat(&self, wrong: bool) -> bool {
        let known = self.heartbeats >= HEARTBEATS;
        match (self.asked, wrong) {
            (false, true) => known || !self.missed,
            (true, true) => known || self.heartbeats > 0 && !self.missed,
            (asked, false) => known && !asked,
        }
    }

    /// Takes a boot-up message: the next answer has toggle 0.
    pub fn handle_boot_up(&mut self, now: Duration) -> Option<Event> {
        self.asked = false;
        self.toggle = Some(false);
        self.toggle_told = false;
        self.alive(now)
    }

    /// The life time starts anew, as after a time when the bus could not be used.
    pub fn restart(&mut self, now: Duration) {
        self.last = now;
        self.next = now;
        self.asked = false;
        self.missed = true;
    }

    fn alive(&mut self, now: Duration) -> Option<Event> {
        self.last = now;
        core::mem::replace(&mut self.lost, false).then_some(Event::Back)
    }

    /// `None` once it is lost.
    fn life_end(&self) -> Option<Duration> {
        (!self.lost).then(|| after_ms(self.last, self.config.life_time_ms()))
    }
}

/// The slave's side: answers requests, and notices when they stop coming (life guarding).
#[derive(Debug, Clone, Copy)]
pub struct Slave {
    node: NodeId,
    config: Option<Config>,
    toggle: bool,
    /// When the life time ends; `None` before the first request and after the end.
    life_end: Option<Duration>,
    lost: bool,
}

impl Slave {
    /// A slave that answers, and watches its master if there is a `config` (both 100Ch and 100Dh
    /// above 0).
    #[must_use]
    pub const fn new(node: NodeId, config: Option<Config>) -> Self {
        Self { node, config, toggle: false, life_end: None, lost: false }
    }

    /// Changes guard time and life time factor; takes effect with the next request.
    pub const fn set_config(&mut self, config: Option<Config>) {
        self.config = config;
        if config.is_none() {
            self.life_end = None;
        }
    }

    /// Takes a request; returns the answer, and [`Event::Back`] after a loss.
    pub fn handle_request(&mut self, now: Duration, state: State) -> (Frame, Option<Event>) {
        let byte = (state as u8) | if self.toggle { 0x80 } else { 0 };
        self.toggle = !self.toggle;
        self.life_end = self.config.map(|config| after_ms(now, config.life_time_ms()));
        let back = core::mem::replace(&mut self.lost, false).then_some(Event::Back);
        (Frame::standard(cob::ERROR_CONTROL + u16::from(self.node.raw()), [byte]), back)
    }

    /// Returns [`Event::Lost`] when the life time has passed without a request.
    pub fn handle_timeout(&mut self, now: Duration) -> Option<Event> {
        if is_due(self.life_end, now) {
            self.life_end = None;
            self.lost = true;
            return Some(Event::Lost);
        }
        None
    }

    /// When to call [`handle_timeout`](Self::handle_timeout).
    #[must_use]
    pub const fn poll_timeout(&self) -> Option<Duration> {
        self.life_end
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NODE: NodeId = NodeId::MIN;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn master_and_slave_agree() {
        let mut guard = Guard::new(Config::default(), ms(0));
        let mut slave = Slave::new(NODE, Some(Config::default()));
        assert_eq!(request(NODE).unwrap().to_can::<Frame>(), request(NODE));
        for (step, expected) in [0x7F, 0xFF, 0x7F, 0xFF].into_iter().enumerate() {
            let now = ms(100 * step as u64);
            assert_eq!(guard.poll_timeout(), Some(now));
            assert_eq!(guard.handle_timeout(now), (true, None));
            assert_eq!(guard.handle_timeout(now), (false, None), "spurious");
            let (answer, event) = slave.handle_request(now, State::PreOperational);
            assert_eq!((answer, event), (Frame::standard(0x701, [expected]), None));
            assert!(guard.is_answer(expected));
            assert_eq!(guard.handle_answer(now, expected), None);
        }
        assert_eq!(slave.poll_timeout(), Some(ms(600)));
        assert_eq!(slave.handle_timeout(ms(599)), None);
        assert_eq!(slave.handle_timeout(ms(600)), Some(Event::Lost));
        assert_eq!((slave.handle_timeout(ms(900)), slave.poll_timeout()), (None, None), "told once");
        assert_eq!(slave.handle_request(ms(1000), State::PreOperational).1, Some(Event::Back));
    }

    #[test]
    fn lost_once_back_once() {
        let mut guard = Guard::new(Config { period_ms: 100, life_time_factor: 3 }, ms(0));
        let mut events = std::vec::Vec::new();
        for step in 0..10 {
            let (due, event) = guard.handle_timeout(ms(100 * step));
            assert!(due, "requests go on");
            events.extend(event.map(|event| (step, event)));
            if step == 7 || step == 8 {
                events.extend(guard.handle_answer(ms(100 * step + 1), 0x05).map(|event| (step, event)));
            }
        }
        assert_eq!(events, [(3, Event::Lost), (7, Event::Back), (8, Event::Toggle { expected: true })]);
    }

    #[test]
    fn a_stuck_toggle_is_told_once_and_ends_in_a_loss() {
        let mut guard = Guard::new(Config::default(), ms(0));
        let mut events = std::vec::Vec::new();
        for step in 0..8 {
            events.extend(guard.handle_timeout(ms(100 * step)).1);
            events.extend(guard.handle_answer(ms(100 * step + 1), 0x05));
        }
        assert_eq!(events, [Event::Toggle { expected: true }, Event::Lost]);
    }

    #[test]
    fn heartbeats_of_a_guarded_node_are_no_answers_and_told_once() {
        // Answers first and heartbeats first.
        for heartbeat in [20, 80] {
            let mut guard = Guard::new(Config::default(), ms(0));
            let mut slave = Slave::new(NODE, Some(Config::default()));
            let mut events = std::vec::Vec::new();
            for step in 0..20 {
                let now = ms(100 * step);
                if heartbeat == 80 && step > 0 {
                    events.extend(guard.handle_answer(ms(100 * step - 20), State::Operational as u8));
                }
                events.extend(guard.handle_timeout(now).1);
                let (answer, _) = slave.handle_request(now, State::Operational);
                events.extend(guard.handle_answer(now, answer.data()[0]));
                if heartbeat == 20 {
                    events.extend(guard.handle_answer(ms(100 * step + 20), State::Operational as u8));
                }
            }
            assert_eq!(events, [Event::Heartbeats]);
        }
        // A node that only sends heartbeats is lost.
        let mut guard = Guard::new(Config::default(), ms(0));
        let mut events = std::vec::Vec::new();
        for step in 0..20 {
            events.extend(guard.handle_timeout(ms(50 * step)).1);
            events.extend(guard.handle_answer(ms(50 * step + 1), State::Operational as u8));
        }
        assert_eq!(events, [Event::Heartbeats, Event::Lost]);
    }

    #[test]
    fn after_a_lost_answer_or_request_the_next_one_is_good() {
        let mut guard = Guard::new(Config::default(), ms(0));
        guard.handle_timeout(ms(0));
        assert_eq!(guard.handle_answer(ms(1), 0x05), None);
        guard.handle_timeout(ms(100)); // 85h is lost on the way
        guard.handle_timeout(ms(200));
        assert_eq!(guard.handle_answer(ms(201), 0x05), None);
        guard.handle_timeout(ms(300)); // the request is lost on the way
        guard.handle_timeout(ms(400));
        assert_eq!(guard.handle_answer(ms(401), 0x85), None);
        guard.handle_timeout(ms(500));
        assert_eq!(guard.handle_answer(ms(501), 0x85), Some(Event::Toggle { expected: false }));
    }

    #[test]
    fn boot_up_sets_the_toggle_to_0() {
        let mut guard = Guard::new(Config::default(), ms(0));
        guard.handle_timeout(ms(0));
        assert_eq!(guard.handle_answer(ms(1), 0x85), None, "guarded before: either toggle is taken");
        guard.handle_timeout(ms(100));
        assert_eq!(guard.handle_answer(ms(101), 0x05), None);
        assert_eq!(guard.handle_boot_up(ms(150)), None);
        guard.handle_timeout(ms(200));
        assert_eq!(guard.handle_answer(ms(201), 0x7F), None);
    }
}
