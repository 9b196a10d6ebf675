//! The receiving side of a PDO: a device's RPDO, or a master's view of a device's TPDO.

use core::time::Duration;

use crate::clock::{after, is_due};
use crate::mapping::LengthError;
use crate::{Communication, Handled, Payload};

/// What [`Rpdo::poll_event`] tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RpdoEvent {
    /// Data take effect now.
    Data(Payload),
    /// Something was wrong.
    Fault(RpdoFault),
}

/// What can be wrong with a received PDO.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RpdoFault {
    /// A PDO was too short and not processed (EMCY 8210h).
    #[error("{0}: too short, not processed")]
    TooShort(LengthError),
    /// A PDO was too long; its beginning was processed (EMCY 8220h). Told once, until one of the right
    /// length has come.
    #[error("{0}: too long, processed as far as mapped")]
    TooLong(LengthError),
    /// No PDO came in time (EMCY 8250h). Told once, until the next one has come.
    #[error("no PDO in time")]
    TimedOut,
}

/// Holds the length of what is received against that of the mapping.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LengthCheck {
    expected: u8,
    was_too_long: bool,
}

impl LengthCheck {
    /// So many bytes are mapped, 0…8.
    #[must_use]
    pub const fn new(expected: u8) -> Self {
        Self { expected, was_too_long: false }
    }

    /// Bytes that are mapped.
    #[must_use]
    #[inline]
    pub const fn expected(self) -> u8 {
        self.expected
    }

    /// A PDO has come: whether it has as many bytes as are mapped. If not, [`check`](Self::check) says
    /// what becomes of it.
    #[inline]
    pub const fn fits(&mut self, found: u8) -> bool {
        let fits = found == self.expected;
        if fits {
            self.was_too_long = false;
        }
        fits
    }

    /// A PDO has come.
    ///
    /// # Errors
    /// [`RpdoFault::TooShort`]: it must not be processed. [`RpdoFault::TooLong`]: it is processed as far as
    /// mapped; told once, until one of the right length has come.
    #[inline]
    pub const fn check(&mut self, found: u8) -> Result<(), RpdoFault> {
        if self.fits(found) { Ok(()) } else { self.judge(found) }
    }

    #[cold]
    const fn judge(&mut self, found: u8) -> Result<(), RpdoFault> {
        let error = LengthError { expected: self.expected, found };
        if found < self.expected {
            return Err(RpdoFault::TooShort(error));
        }
        let told = self.was_too_long;
        self.was_too_long = true;
        if told { Ok(()) } else { Err(RpdoFault::TooLong(error)) }
    }
}

/// A received PDO.
///
/// - Input: [`handle_frame`](Self::handle_frame), [`handle_sync`](Self::handle_sync),
///   [`handle_timeout`](Self::handle_timeout).
/// - Output: [`poll_event`](Self::poll_event), [`poll_timeout`](Self::poll_timeout).
///
/// A newer PDO replaces one that has not taken effect or was not polled yet. The time-out runs from the
/// first PDO on.
#[derive(Debug, Clone, Copy)]
pub struct Rpdo {
    /// [`NONE`] where it does not exist.
    id: u16,
    synchronous: bool,
    length: LengthCheck,
    /// Zero: any.
    timeout: Duration,
    waiting: Option<Payload>,
    ready: Option<Payload>,
    fault: Option<RpdoFault>,
    deadline: Option<Duration>,
}

/// No standard frame has this identifier.
const NONE: u16 = 0xFFFF;

impl Rpdo {
    /// Before the first PDO; `bytes` are mapped, 0…8.
    #[must_use]
    pub const fn new(communication: &Communication, bytes: u8) -> Self {
        Self {
            id: match communication.id() {
                Some(id) => id,
                None => NONE,
            },
            synchronous: communication.transmission.is_synchronous(),
            length: LengthCheck::new(bytes),
            timeout: Duration::from_millis(communication.event_timer as u64),
            waiting: None,
            ready: None,
            fault: None,
            deadline: None,
        }
    }

    /// Takes a frame from the bus.
    #[inline]
    pub fn handle_frame(&mut self, now: Duration, frame: &impl embedded_can::Frame) -> Handled {
        match frame.id() {
            embedded_can::Id::Standard(id) if id.as_raw() == self.id && frame.is_data_frame() => {}
            _ => return Handled::Ignored,
        }
        self.receive(now, Payload::from_slice(frame.data()));
        Handled::Taken
    }

    #[inline]
    fn receive(&mut self, now: Duration, mut payload: Payload) {
        let expected = self.length.expected();
        if let Err(fault) = self.length.check(payload.len()) {
            self.fault = Some(fault);
            if matches!(fault, RpdoFault::TooShort(_)) {
                return;
            }
        }
        if payload.len() != expected {
            payload = Payload::new(payload.word(), expected);
        }
        if !self.timeout.is_zero() {
            self.deadline = Some(after(now, self.timeout));
        }
        let slot = if self.synchronous { &mut self.waiting } else { &mut self.ready };
        *slot = Some(payload);
    }

    /// A SYNC has come: what was received before takes effect.
    #[inline]
    pub fn handle_sync(&mut self) {
        if self.waiting.is_some() {
            self.ready = self.waiting.take();
        }
    }

    /// Notices a missing PDO; early calls do nothing.
    pub fn handle_timeout(&mut self, now: Duration) {
        if is_due(self.deadline, now) {
            self.deadline = None;
            self.fault = Some(RpdoFault::TimedOut);
        }
    }

    /// When to call [`handle_timeout`](Self::handle_timeout); `None` = idle.
    #[must_use]
    #[inline]
    pub const fn poll_timeout(&self) -> Option<Duration> {
        self.deadline
    }

    /// What happened, until `None`.
    #[inline]
    pub fn poll_event(&mut self) -> Option<RpdoEvent> {
        if let Some(fault) = self.fault.take() {
            return Some(RpdoEvent::Fault(fault));
        }
        self.ready.take().map(RpdoEvent::Data)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CobId, Frame, Transmission};

    const fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn rpdo(transmission: u8) -> Rpdo {
        let transmission = Transmission::new(transmission).unwrap();
        let communication = Communication::event_driven(CobId(0x201));
        Rpdo::new(&Communication { transmission, event_timer: 100, ..communication }, 2)
    }

    #[test]
    fn event_driven_takes_effect_at_once() {
        let mut rpdo = rpdo(255);
        assert_eq!(rpdo.handle_frame(ms(0), &Frame::standard(0x202, [1, 2])), Handled::Ignored);
        assert_eq!(rpdo.handle_frame(ms(0), &Frame::standard(0x201, [1, 2])), Handled::Taken);
        assert_eq!(rpdo.poll_event(), Some(RpdoEvent::Data(Payload::from_slice(&[1, 2]))));
        assert_eq!(rpdo.poll_event(), None);
    }

    #[test]
    fn synchronous_waits_for_sync_and_the_newest_counts() {
        for transmission in [0, 1, 240] {
            let mut rpdo = rpdo(transmission);
            rpdo.handle_frame(ms(0), &Frame::standard(0x201, [1, 2]));
            rpdo.handle_frame(ms(0), &Frame::standard(0x201, [3, 4]));
            assert_eq!(rpdo.poll_event(), None);
            rpdo.handle_sync();
            assert_eq!(rpdo.poll_event(), Some(RpdoEvent::Data(Payload::from_slice(&[3, 4]))));
            rpdo.handle_sync();
            assert_eq!(rpdo.poll_event(), None);
        }
    }

    #[test]
    fn lengths() {
        let mut rpdo = rpdo(254);
        rpdo.handle_frame(ms(0), &Frame::standard(0x201, [1]));
        let error = LengthError { expected: 2, found: 1 };
        assert_eq!(
            (rpdo.poll_event(), rpdo.poll_event()),
            (Some(RpdoEvent::Fault(RpdoFault::TooShort(error))), None)
        );
        assert_eq!(rpdo.poll_timeout(), None, "a short one is none");
        let error = LengthError { expected: 2, found: 3 };
        let data = Some(RpdoEvent::Data(Payload::from_slice(&[1, 2])));
        for told in [true, false] {
            rpdo.handle_frame(ms(0), &Frame::standard(0x201, [1, 2, 3]));
            if told {
                assert_eq!(rpdo.poll_event(), Some(RpdoEvent::Fault(RpdoFault::TooLong(error))));
            }
            assert_eq!((rpdo.poll_event(), rpdo.poll_event()), (data, None));
        }
        rpdo.handle_frame(ms(0), &Frame::standard(0x201, [1, 2]));
        assert_eq!((rpdo.poll_event(), rpdo.poll_event()), (data, None));
        rpdo.handle_frame(ms(0), &Frame::standard(0x201, [1, 2, 3]));
        assert_eq!(
            rpdo.poll_event(),
            Some(RpdoEvent::Fault(RpdoFault::TooLong(error))),
            "again after a good one"
        );
    }

    #[test]
    fn a_missing_pdo_is_told_once() {
        let mut rpdo = rpdo(255);
        rpdo.handle_timeout(ms(1000));
        assert_eq!(rpdo.poll_event(), None, "not before the first");
        rpdo.handle_frame(ms(1000), &Frame::standard(0x201, [1, 2]));
        rpdo.poll_event();
        assert_eq!(rpdo.poll_timeout(), Some(ms(1100)));
        rpdo.handle_timeout(ms(1099));
        assert_eq!(rpdo.poll_event(), None);
        rpdo.handle_timeout(ms(1100));
        assert_eq!(
            (rpdo.poll_event(), rpdo.poll_timeout()),
            (Some(RpdoEvent::Fault(RpdoFault::TimedOut)), None)
        );
    }

    #[test]
    fn not_valid_receives_nothing() {
        let mut rpdo = Rpdo::new(&Communication::event_driven(CobId(0x8000_0201)), 2);
        assert_eq!(rpdo.handle_frame(ms(0), &Frame::standard(0x201, [1, 2])), Handled::Ignored);
    }
}
