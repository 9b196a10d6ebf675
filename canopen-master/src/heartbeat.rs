//! Heartbeat (CiA 301, 7.2.8.2.2.2): producer (1017h) and consumer (1016h).

use core::time::Duration;

use pdo::{Frame, NodeId, cob};

use crate::clock::{self, after_ms, is_due};
use crate::nmt::State;

/// Sends a node's state every so often.
#[derive(Debug, Clone, Copy)]
pub struct Producer {
    node: NodeId,
    /// ms; 0 = off.
    time_ms: u16,
    next: Duration,
}

impl Producer {
    /// A producer that first sends one period after `now`; a period of 0 ms is off.
    #[must_use]
    pub fn new(node: NodeId, time_ms: u16, now: Duration) -> Self {
        Self { node, time_ms, next: after_ms(now, time_ms.into()) }
    }

    /// The period in ms, 0 = off.
    #[must_use]
    pub const fn time_ms(&self) -> u16 {
        self.time_ms
    }

    /// Changes the period (a write to 1017h), which starts it anew.
    pub fn set_time(&mut self, time_ms: u16, now: Duration) {
        *self = Self::new(self.node, time_ms, now);
    }

    /// The heartbeat, if one is due. Periods that were missed are not made up for.
    pub fn poll_transmit(&mut self, now: Duration, state: State) -> Option<Frame> {
        if !is_due(self.poll_timeout(), now) {
            return None;
        }
        self.next = clock::next(self.next, Duration::from_millis(self.time_ms.into()), now);
        Some(Frame::standard(cob::ERROR_CONTROL + u16::from(self.node.raw()), [state as u8]))
    }

    /// When the next one is due; `None` = off.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Duration> {
        (self.time_ms != 0).then_some(self.next)
    }
}

/// What a consumer tells, each once.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Event {
    /// No heartbeat for the consumer time.
    Lost,
    /// A heartbeat or boot-up message after `Lost`.
    Back,
}

/// Watches one node's heartbeat.
#[derive(Debug, Clone, Copy)]
pub struct Consumer {
    last: Duration,
    time_ms: u16,
    active: bool,
    lost: bool,
}

impl Consumer {
    /// Watches from the first heartbeat on (CiA 301), with the consumer time in ms, 1…65,535.
    #[must_use]
    pub const fn new(time_ms: u16) -> Self {
        Self { last: Duration::ZERO, time_ms, active: false, lost: false }
    }

    /// Watches from now on: a node that never sends one is lost too (CiA 302-2, start of error
    /// control).
    pub const fn start(&mut self, now: Duration) {
        self.active = true;
        self.last = now;
    }

    /// The consumer time in ms.
    #[must_use]
    pub const fn time_ms(&self) -> u16 {
        self.time_ms
    }

    /// Whether a heartbeat has come since the last loss, or none yet was waited for.
    #[must_use]
    pub const fn is_lost(&self) -> bool {
        self.lost
    }

    /// Whether the end of the consumer time would be told.
    #[must_use]
    #[inline]
    pub const fn is_watching(&self) -> bool {
        self.active && !self.lost
    }

    /// Takes a heartbeat or boot-up message.
    #[inline]
    pub fn handle(&mut self, now: Duration) -> Option<Event> {
        self.last = now;
        self.active = true;
        core::mem::replace(&mut self.lost, false).then_some(Event::Back)
    }

    /// Tells once when the consumer time has passed.
    pub fn handle_timeout(&mut self, now: Duration) -> Option<Event> {
        if !is_due(self.poll_timeout(), now) {
            return None;
        }
        self.lost = true;
        Some(Event::Lost)
    }

    /// When the consumer time ends; `None` = not watching.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Duration> {
        self.is_watching().then(|| after_ms(self.last, self.time_ms.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn the_producer_keeps_its_period() {
        let mut producer = Producer::new(NodeId::MIN, 100, ms(5));
        assert_eq!(producer.poll_transmit(ms(104), State::Operational), None);
        assert_eq!(producer.poll_transmit(ms(107), State::Operational), Some(Frame::standard(0x701, [5])));
        assert_eq!(producer.poll_timeout(), Some(ms(205)), "no drift");
        assert!(producer.poll_transmit(ms(1000), State::Stopped).is_some());
        assert_eq!(producer.poll_timeout(), Some(ms(1100)), "nothing made up for");
        producer.set_time(0, ms(1000));
        assert_eq!((producer.poll_timeout(), producer.poll_transmit(ms(9000), State::Stopped)), (None, None));
    }

    #[test]
    fn the_consumer_tells_once() {
        let mut consumer = Consumer::new(150);
        assert_eq!((consumer.poll_timeout(), consumer.handle_timeout(ms(9000))), (None, None));
        assert_eq!(consumer.handle(ms(1000)), None);
        assert_eq!(consumer.handle_timeout(ms(1149)), None);
        assert_eq!(consumer.handle_timeout(ms(1150)), Some(Event::Lost));
        assert_eq!((consumer.handle_timeout(ms(1300)), consumer.poll_timeout()), (None, None));
        assert_eq!(consumer.handle(ms(1400)), Some(Event::Back));
        assert_eq!(consumer.handle(ms(1500)), None);
        let mut never = Consumer::new(150);
        never.start(ms(0));
        assert_eq!(never.handle_timeout(ms(150)), Some(Event::Lost));
    }
}
