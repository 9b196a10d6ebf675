//! SYNC (CiA 301, 7.2.5): producer with counter and window, consumer.

use core::time::Duration;

use pdo::{Frame, cob};

use crate::clock::{self, after, is_due};

/// Time between two SYNCs of a master (decision 16).
pub const PERIOD: Duration = Duration::from_millis(10);

/// Why a producer cannot be set up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// Objects 1006h and 1019h do not allow it.
    #[error("SYNC counter overflow value {0}, 0 (no counter) or 2 to 240 expected")]
    Overflow(u8),
    /// A period of 0 is no period.
    #[error("SYNC period is 0")]
    Period,
}

/// Sends SYNC.
#[derive(Debug, Clone, Copy)]
pub struct Producer {
    period: Duration,
    window: Duration,
    overflow: u8,
    counter: u8,
    next: Duration,
    last: Option<Duration>,
}

impl Producer {
    /// A producer whose first SYNC is due at `now`.
    ///
    /// - `period`: time between two SYNCs (1006h).
    /// - `overflow`: 0 sends no counter, 2…240 a counter 1…`overflow` (1019h).
    /// - `window`: how long after SYNC synchronous PDOs may be sent (1007h); 0 = up to the next one.
    ///
    /// # Errors
    /// [`ConfigError`] for an overflow value of 1 or above 240 and a period of 0.
    pub const fn new(
        period: Duration,
        overflow: u8,
        window: Duration,
        now: Duration,
    ) -> Result<Self, ConfigError> {
        if overflow == 1 || overflow > 240 {
            return Err(ConfigError::Overflow(overflow));
        }
        if period.is_zero() {
            return Err(ConfigError::Period);
        }
        Ok(Self { period, window, overflow, counter: 0, next: now, last: None })
    }

    /// Time between two SYNCs.
    #[must_use]
    pub const fn period(&self) -> Duration {
        self.period
    }

    /// The counter starts again at 1 (CiA 301: when the producer starts or leaves stopped).
    pub const fn reset_counter(&mut self) {
        self.counter = 0;
    }

    /// The SYNC, if one is due. The grid is kept; SYNCs that were missed are not made up for.
    pub fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        if !is_due(Some(self.next), now) {
            return None;
        }
        self.next = clock::next(self.next, self.period, now);
        self.last = Some(now);
        if self.overflow == 0 {
            return Some(Frame::standard(cob::SYNC, []));
        }
        self.counter = if self.counter >= self.overflow { 1 } else { self.counter + 1 };
        Some(Frame::standard(cob::SYNC, [self.counter]))
    }

    /// When the next SYNC is due.
    #[must_use]
    pub const fn poll_timeout(&self) -> Duration {
        self.next
    }

    /// Whether synchronous PDOs may be sent now: the window after the last SYNC is open.
    #[must_use]
    pub fn window_is_open(&self, now: Duration) -> bool {
        self.last.is_some_and(|last| self.window.is_zero() || !is_due(Some(after(last, self.window)), now))
    }
}

/// What a consumer tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Event {
    /// A SYNC.
    Sync {
        /// Its counter, if it has one.
        counter: Option<u8>,
    },
    /// A SYNC whose counter does not follow the one before.
    Jump {
        /// The counter that was expected.
        expected: u8,
        /// The one that came.
        found: u8,
    },
    /// A SYNC of a wrong length (EMCY 8240h); it is not acted on.
    Length {
        /// 0 without counter, 1 with.
        expected: u8,
        /// Bytes that came.
        found: u8,
    },
    /// No SYNC for one and a half periods; told once.
    Lost,
}

/// Receives SYNC.
#[derive(Debug, Clone, Copy)]
pub struct Consumer {
    id: u16,
    /// Zero: SYNC is not watched.
    period: Duration,
    overflow: u8,
    counter: Option<u8>,
    deadline: Option<Duration>,
}

impl Consumer {
    /// A consumer of SYNC on 080h that expects a counter if `overflow` (1019h) is not 0 and misses
    /// SYNC after one and a half `period`s (1006h), never if that is 0.
    #[must_use]
    pub const fn new(period: Duration, overflow: u8) -> Self {
        Self { id: cob::SYNC, period, overflow, counter: None, deadline: None }
    }

    /// The same on another identifier (1005h).
    #[must_use]
    pub const fn with_id(mut self, id: u16) -> Self {
        self.id = id;
        self
    }

    /// Its identifier.
    #[must_use]
    pub const fn id(&self) -> u16 {
        self.id
    }

    /// Takes a frame; `None` if it is no SYNC.
    pub fn handle_frame(&mut self, now: Duration, frame: &Frame) -> Option<Event> {
        if frame.standard_id() != Some(self.id) || frame.is_remote() {
            return None;
        }
        let expected = u8::from(self.overflow != 0);
        if frame.len() != usize::from(expected) {
            return Some(Event::Length { expected, found: frame.len() as u8 });
        }
        if !self.period.is_zero() {
            self.deadline = Some(after(now, after(self.period, self.period / 2)));
        }
        let &[found] = frame.data() else { return Some(Event::Sync { counter: None }) };
        let before = self.counter.replace(found);
        let expected = before.map(|before| if before >= self.overflow { 1 } else { before + 1 });
        match expected {
            Some(expected) if expected != found => Some(Event::Jump { expected, found }),
            _ => Some(Event::Sync { counter: Some(found) }),
        }
    }

    /// Tells when SYNC has stopped.
    pub fn handle_timeout(&mut self, now: Duration) -> Option<Event> {
        is_due(self.deadline, now).then(|| {
            self.deadline = None;
            self.counter = None;
            Event::Lost
        })
    }

    /// When to call [`handle_timeout`](Self::handle_timeout).
    #[must_use]
    pub const fn poll_timeout(&self) -> Option<Duration> {
        self.deadline
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn the_counter_runs_from_1_to_its_overflow() {
        let mut producer = Producer::new(PERIOD, 3, ms(2), ms(0)).unwrap();
        let mut consumer = Consumer::new(PERIOD, 3);
        assert!(!producer.window_is_open(ms(0)));
        for (step, counter) in [1, 2, 3, 1, 2].into_iter().enumerate() {
            let now = ms(10 * step as u64);
            assert_eq!(producer.poll_timeout(), now);
            let frame = producer.poll_transmit(now).unwrap();
            assert_eq!(frame, Frame::standard(0x080, [counter]));
            assert_eq!(producer.poll_transmit(now), None);
            assert_eq!(consumer.handle_frame(now, &frame), Some(Event::Sync { counter: Some(counter) }));
            assert!(producer.window_is_open(now + ms(1)) && !producer.window_is_open(now + ms(2)));
        }
        let jump = Frame::standard(0x080, [1]);
        assert_eq!(consumer.handle_frame(ms(50), &jump), Some(Event::Jump { expected: 3, found: 1 }));
        let short = Frame::standard(0x080, []);
        assert_eq!(consumer.handle_frame(ms(60), &short), Some(Event::Length { expected: 1, found: 0 }));
        assert_eq!(consumer.handle_timeout(ms(64)), None);
        assert_eq!(consumer.handle_timeout(ms(65)), Some(Event::Lost));
        assert_eq!((consumer.handle_timeout(ms(99)), consumer.poll_timeout()), (None, None));
    }

    #[test]
    fn without_counter_the_frame_is_empty() {
        let mut producer = Producer::new(PERIOD, 0, Duration::ZERO, ms(0)).unwrap();
        assert_eq!(producer.poll_transmit(ms(0)), Some(Frame::standard(0x080, [])));
        assert_eq!(producer.poll_transmit(ms(1000)), Some(Frame::standard(0x080, [])));
        assert_eq!(producer.poll_timeout(), ms(1010), "nothing made up for");
        assert!(producer.window_is_open(ms(1009)));
    }

    #[test]
    fn refused_settings() {
        let new = |period, overflow| Producer::new(period, overflow, Duration::ZERO, Duration::ZERO).err();
        assert_eq!(new(PERIOD, 1), Some(ConfigError::Overflow(1)));
        assert_eq!(new(PERIOD, 241), Some(ConfigError::Overflow(241)));
        assert_eq!((new(PERIOD, 2), new(PERIOD, 240)), (None, None));
        assert_eq!(new(Duration::ZERO, 0), Some(ConfigError::Period));
    }
}
