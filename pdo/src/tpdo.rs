//! The sending side of a PDO: a device's TPDO, or a master's view of a device's RPDO.

use core::time::Duration;

use embedded_can::{Id, StandardId};

use crate::clock::{after, after_ms, is_due};
use crate::{Communication, Frame, Handled, Payload, Transmission};

/// A sent PDO.
///
/// - Commands: [`trigger`](Self::trigger), [`withdraw`](Self::withdraw).
/// - Input: [`handle_sync`](Self::handle_sync), [`handle_frame`](Self::handle_frame),
///   [`handle_timeout`](Self::handle_timeout).
/// - Output: [`poll_transmit`](Self::poll_transmit), [`poll_timeout`](Self::poll_timeout).
///
/// The data are asked for when they are due: at the SYNC of a synchronous PDO, else when it is sent.
#[derive(Debug, Clone, Copy)]
pub struct Tpdo {
    communication: Communication,
    id: Option<StandardId>,
    /// An event waits to be sent.
    pending: bool,
    /// Data sampled at SYNC, to be sent now (or, of type 252, when asked for).
    sampled: Option<Payload>,
    /// Of type 252: asked for.
    asked: bool,
    /// SYNCs until the next PDO; `None` before the first.
    countdown: Option<u8>,
    /// When the inhibit time is over.
    free: Duration,
    /// When the event timer runs out.
    event: Option<Duration>,
}

impl Tpdo {
    /// Before the first PDO. An event-driven one is sent once at the beginning, so that all know.
    #[must_use]
    pub const fn new(communication: Communication) -> Self {
        Self {
            communication,
            id: match communication.id() {
                Some(id) => StandardId::new(id),
                None => None,
            },
            pending: communication.transmission.is_event_driven(),
            sampled: None,
            asked: false,
            countdown: None,
            free: Duration::ZERO,
            event: None,
        }
    }

    /// Something has changed: sends an event-driven PDO as soon as the inhibit time allows it, an acyclic
    /// one at the next SYNC; the others do not care.
    #[inline]
    pub fn trigger(&mut self) {
        self.pending = true;
    }

    /// What has changed is not worth a PDO: takes back what [`trigger`](Self::trigger), the event timer or
    /// the beginning of an event-driven PDO asked for. The event timer runs again from the next PDO on.
    #[inline]
    pub fn withdraw(&mut self) {
        self.pending = false;
    }

    /// A SYNC has come, with its counter if it has one. `data` is asked where the PDO is due.
    #[inline]
    pub fn handle_sync(&mut self, counter: Option<u8>, data: impl FnOnce() -> Payload) {
        let due = match self.communication.transmission {
            Transmission::SyncAcyclic => core::mem::take(&mut self.pending),
            Transmission::SyncCyclic(cycle) => self.is_cycle_over(cycle, counter),
            Transmission::RtrSync => true,
            _ => false,
        };
        if due && self.id.is_some() {
            self.sampled = Some(data());
        }
    }

    #[inline]
    fn is_cycle_over(&mut self, cycle: u8, counter: Option<u8>) -> bool {
        let start = self.communication.sync_start;
        let left = match (self.countdown, counter) {
            (Some(left), _) => left,
            // The counted SYNC that the cycle starts with is its first PDO.
            (None, Some(counter)) if start != 0 => {
                if counter != start {
                    return false;
                }
                1
            }
            (None, _) => cycle,
        };
        let due = left <= 1;
        self.countdown = Some(if due { cycle } else { left - 1 });
        due
    }

    /// Takes a frame from the bus: a remote frame asks for the PDO, where its COB-ID allows it.
    #[inline]
    pub fn handle_frame(&mut self, frame: &impl embedded_can::Frame) -> Handled {
        if !frame.is_remote_frame() || self.id.map(Id::Standard) != Some(frame.id()) {
            return Handled::Ignored;
        }
        if self.communication.cob_id.allows_rtr() {
            self.asked = true;
        }
        Handled::Taken
    }

    /// Notices that the event timer ran out; early calls do nothing.
    #[inline]
    pub fn handle_timeout(&mut self, now: Duration) {
        if is_due(self.event, now) {
            self.event = None;
            self.pending = true;
        }
    }

    /// When to call [`handle_timeout`](Self::handle_timeout) and [`poll_transmit`](Self::poll_transmit);
    /// `None` = idle.
    #[must_use]
    #[inline]
    pub fn poll_timeout(&self) -> Option<Duration> {
        self.id?;
        if self.pending && self.communication.transmission.is_event_driven() {
            return Some(self.free);
        }
        self.event
    }

    /// The PDO to send now, once; `data` is asked where it was not sampled before.
    #[inline]
    pub fn poll_transmit(&mut self, now: Duration, data: impl FnOnce() -> Payload) -> Option<Frame> {
        let id = self.id?;
        let asked = core::mem::take(&mut self.asked);
        let transmission = self.communication.transmission;
        let payload = match transmission {
            Transmission::RtrSync => self.sampled.filter(|_| asked)?,
            Transmission::SyncAcyclic | Transmission::SyncCyclic(_) => match self.sampled.take() {
                Some(sampled) => sampled,
                None if asked => data(),
                None => return None,
            },
            Transmission::RtrEvent => asked.then(data)?,
            Transmission::EventManufacturer | Transmission::EventProfile => {
                let due = self.pending && is_due(Some(self.free), now);
                if !(asked || due) {
                    return None;
                }
                self.pending = false;
                let Communication { inhibit, event_timer, .. } = self.communication;
                self.free = after(now, Duration::from_micros(u64::from(inhibit) * 100));
                self.event = (event_timer != 0).then(|| after_ms(now, event_timer.into()));
                data()
            }
        };
        Some(payload.frame(id))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CobId;

    const fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn tpdo(transmission: u8, sync_start: u8) -> Tpdo {
        Tpdo::new(Communication {
            cob_id: CobId(0x181),
            transmission: Transmission::new(transmission).unwrap(),
            inhibit: 100,
            event_timer: 100,
            sync_start,
        })
    }

    fn data() -> Payload {
        Payload::from_slice(&[7])
    }

    fn sent(tpdo: &mut Tpdo, at: u64) -> bool {
        let frame = tpdo.poll_transmit(ms(at), data);
        assert!(frame.is_none() || frame == Some(Frame::standard(0x181, [7])));
        frame.is_some()
    }

    #[test]
    fn event_driven_with_inhibit_time_and_event_timer() {
        for transmission in [254, 255] {
            let mut tpdo = tpdo(transmission, 0);
            assert!(sent(&mut tpdo, 0), "once at the beginning");
            assert!(!sent(&mut tpdo, 0));
            tpdo.trigger();
            assert!(!sent(&mut tpdo, 9));
            assert_eq!(tpdo.poll_timeout(), Some(ms(10)));
            assert!(sent(&mut tpdo, 10));
            assert_eq!(tpdo.poll_timeout(), Some(ms(110)));
            tpdo.handle_timeout(ms(109));
            assert!(!sent(&mut tpdo, 109));
            tpdo.handle_timeout(ms(110));
            assert!(sent(&mut tpdo, 110));
            tpdo.handle_sync(None, data);
            assert!(!sent(&mut tpdo, 200), "not by SYNC");
            tpdo.trigger();
            tpdo.withdraw();
            assert!(!sent(&mut tpdo, 200), "held back");
        }
    }

    #[test]
    fn acyclic_at_the_sync_after_an_event() {
        let mut tpdo = tpdo(0, 0);
        tpdo.handle_sync(None, data);
        assert!(!sent(&mut tpdo, 0));
        tpdo.trigger();
        assert!(!sent(&mut tpdo, 0));
        tpdo.handle_sync(None, data);
        assert!(sent(&mut tpdo, 0) && !sent(&mut tpdo, 0));
    }

    fn pattern(tpdo: &mut Tpdo, counters: impl Iterator<Item = Option<u8>>) -> std::string::String {
        counters
            .map(|counter| {
                tpdo.handle_sync(counter, data);
                if sent(tpdo, 0) { 'x' } else { '.' }
            })
            .collect()
    }

    #[test]
    fn cyclic() {
        let no_counter = || core::iter::repeat_n(None, 9);
        assert_eq!(pattern(&mut tpdo(1, 0), no_counter()), "xxxxxxxxx");
        assert_eq!(pattern(&mut tpdo(3, 0), no_counter()), "..x..x..x");
        assert_eq!(pattern(&mut tpdo(3, 2), no_counter()), "..x..x..x", "no counter, no start value");
    }

    /// CiA 301, 7.5.2.37, sub-index 06h: the SYNC whose counter equals the start value is the first.
    #[test]
    fn sync_start_value() {
        let counters = || (0..12).map(|i| Some(i % 4 + 1));
        assert_eq!(pattern(&mut tpdo(2, 2), counters()), ".x.x.x.x.x.x");
        assert_eq!(pattern(&mut tpdo(4, 3), counters()), "..x...x...x.");
        assert_eq!(pattern(&mut tpdo(4, 9), counters()), "............");
    }

    #[test]
    fn when_asked_for() {
        let ask = Frame::remote_frame(StandardId::new(0x181).unwrap(), 1).unwrap();
        let mut sampled = tpdo(252, 0);
        assert!(sampled.handle_frame(&ask).is_taken() && !sent(&mut sampled, 0), "nothing sampled yet");
        sampled.handle_sync(None, data);
        assert!(!sent(&mut sampled, 0));
        sampled.handle_frame(&ask);
        assert!(sent(&mut sampled, 0) && !sent(&mut sampled, 0));
        let mut now = tpdo(253, 0);
        assert!(!sent(&mut now, 0));
        now.handle_frame(&ask);
        assert!(sent(&mut now, 0) && !sent(&mut now, 0));
        let refused = Communication::event_driven(CobId(0x4000_0181));
        let mut refused = Tpdo::new(Communication { transmission: Transmission::RtrEvent, ..refused });
        assert!(refused.handle_frame(&ask).is_taken() && !sent(&mut refused, 0));
    }

    #[test]
    fn not_valid_sends_nothing() {
        let mut tpdo = Tpdo::new(Communication::event_driven(CobId(0x8000_0181)));
        assert!(!sent(&mut tpdo, 0));
        assert_eq!(tpdo.poll_timeout(), None);
    }
}
