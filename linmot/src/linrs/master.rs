//! The master: one command at a time on a half-duplex line, each with exactly one outcome.

use core::time::Duration;

use super::frame::{Checksum, Decoder, MAX_FRAME};
use super::message;
use crate::code::Status;
use crate::request::{Reply, Request};

/// Names one command from [`Master::submit`] to its outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Ticket(u32);

/// Settings of the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// ID of the drive.
    pub id: u8,
    /// Checksum that the drive is configured for (UPID 2080h).
    pub checksum: Checksum,
    /// Longest time from the end of a request to the end of its answer (project-defined).
    pub answer: Duration,
    /// The same for commands that write flash or start the software; the LinRS manual names 10 s for
    /// saving the command table and about 3 s for a start.
    pub long_answer: Duration,
}

impl Config {
    /// The drive with this ID, no checksum.
    #[must_use]
    pub const fn new(id: u8) -> Self {
        Self {
            id,
            checksum: Checksum::None,
            answer: Duration::from_millis(250),
            long_answer: Duration::from_secs(15),
        }
    }
}

/// Why [`Master::submit`] did not take a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SubmitError {
    /// One command at a time: the outcome of the last one has not been polled yet.
    #[error("a command is under way, its outcome must be polled first")]
    Busy,
    /// A repetition could change the drive twice or skip an item.
    #[error("only reads may be repeated")]
    NotRepeatable,
}

/// How a command ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Outcome {
    /// Carried out, with status 00h or 04h.
    Done(Reply),
    /// The drive answered with another status.
    Refused(Reply),
    /// No complete answer came in time, at the last of the attempts. A command that changes the drive
    /// may have been carried out all the same.
    TimedOut {
        /// How often it was sent.
        attempts: u8,
    },
    /// A good frame of this drive that is no answer to the command.
    WrongEcho {
        /// Sub ID of what came.
        sub: u8,
        /// Main ID of what came.
        main: u8,
    },
    /// [`Master::cancel`].
    Cancelled,
}

/// What [`Master::poll_event`] tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Event {
    /// Of [`Master::submit`].
    pub ticket: Ticket,
    /// How it ended.
    pub outcome: Outcome,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Idle,
    ToSend,
    Sending,
    Waiting(Duration),
    Ended(Outcome),
}

/// The LinRS master of one drive.
///
/// - Commands: [`submit`](Self::submit), [`cancel`](Self::cancel).
/// - Input: [`handle_bytes`](Self::handle_bytes), [`handle_transmit_done`](Self::handle_transmit_done),
///   [`handle_timeout`](Self::handle_timeout).
/// - Output: [`poll_transmit`](Self::poll_transmit), [`poll_event`](Self::poll_event),
///   [`poll_timeout`](Self::poll_timeout).
#[derive(Debug, Clone)]
pub struct Master {
    config: Config,
    decoder: Decoder,
    state: State,
    request: Request,
    ticket: u32,
    retries: u8,
    attempts: u8,
    buffer: [u8; MAX_FRAME],
    strays: u32,
}

impl Master {
    /// An idle master.
    #[must_use]
    pub const fn new(config: Config) -> Self {
        Self {
            config,
            decoder: Decoder::new(config.checksum),
            state: State::Idle,
            request: Request::NoOperation,
            ticket: 0,
            retries: 0,
            attempts: 0,
            buffer: [0; MAX_FRAME],
            strays: 0,
        }
    }

    /// Good frames that answered nothing asked: late answers, other drives.
    #[must_use]
    pub const fn strays(&self) -> u32 {
        self.strays
    }

    /// The receiver's decoder, for its counter.
    #[must_use]
    pub const fn decoder(&self) -> &Decoder {
        &self.decoder
    }

    /// Takes a command; it is sent by the next [`poll_transmit`](Self::poll_transmit), and again up
    /// to `retries` times when no answer came.
    ///
    /// # Errors
    /// [`SubmitError::Busy`] until the last outcome has been polled, [`SubmitError::NotRepeatable`]
    /// for `retries` above 0 of a command that is not ([`Request::is_repeatable`]).
    pub fn submit(&mut self, request: &Request, retries: u8) -> Result<Ticket, SubmitError> {
        if self.state != State::Idle {
            return Err(SubmitError::Busy);
        }
        if retries > 0 && !request.is_repeatable() {
            return Err(SubmitError::NotRepeatable);
        }
        self.request = *request;
        self.retries = retries;
        self.attempts = 0;
        self.ticket = self.ticket.wrapping_add(1);
        self.state = State::ToSend;
        Ok(Ticket(self.ticket))
    }

    /// Gives a command up; its outcome becomes [`Outcome::Cancelled`] unless it has one already.
    pub fn cancel(&mut self, ticket: Ticket) {
        let open = !matches!(self.state, State::Idle | State::Ended(_));
        if open && ticket.0 == self.ticket {
            self.state = State::Ended(Outcome::Cancelled);
        }
    }

    /// The bytes to send now, once.
    pub fn poll_transmit(&mut self, _now: Duration) -> Option<&[u8]> {
        if self.state != State::ToSend {
            return None;
        }
        self.state = State::Sending;
        self.attempts = self.attempts.saturating_add(1);
        let message = message::telegram(self.config.id, &self.request);
        let len = message.encode(self.config.checksum, &mut self.buffer);
        self.buffer.get(..len)
    }

    /// The last byte of the request has left: the time for an answer starts.
    pub fn handle_transmit_done(&mut self, now: Duration) {
        if self.state == State::Sending {
            let time = match self.request {
                Request::SaveCurves
                | Request::SaveTable
                | Request::Stop
                | Request::Start
                | Request::Defaults(_) => self.config.long_answer,
                _ => self.config.answer,
            };
            self.state = State::Waiting(now.saturating_add(time));
        }
    }

    /// Takes received bytes in any chunking.
    pub fn handle_bytes(&mut self, _now: Duration, mut bytes: &[u8]) {
        loop {
            let (taken, found) = self.decoder.decode(bytes);
            bytes = bytes.get(taken..).unwrap_or(&[]);
            let Some(found) = found else { return };
            let waiting = matches!(self.state, State::Sending | State::Waiting(_));
            // A line that echoes what is sent brings the request itself.
            let own = found == message::telegram(self.config.id, &self.request);
            if !waiting || found.id != self.config.id || own {
                self.strays = self.strays.saturating_add(1);
                continue;
            }
            self.state = State::Ended(match message::reply(&self.request, &found) {
                Some(reply) if reply.status.is_done() => Outcome::Done(reply),
                Some(reply) => Outcome::Refused(reply),
                None => Outcome::WrongEcho { sub: found.sub, main: found.main },
            });
        }
    }

    /// Ends attempts whose time is over; early calls do nothing.
    pub fn handle_timeout(&mut self, now: Duration) {
        let State::Waiting(deadline) = self.state else { return };
        if now < deadline {
            return;
        }
        // What has begun and not ended is damage; a good frame may be hidden in it.
        while self.decoder.in_frame() {
            self.decoder.gap();
            self.handle_bytes(now, &[]);
        }
        if matches!(self.state, State::Waiting(_)) {
            self.state = if self.attempts <= self.retries {
                State::ToSend
            } else {
                State::Ended(Outcome::TimedOut { attempts: self.attempts })
            };
        }
    }

    /// When to call [`handle_timeout`](Self::handle_timeout); `None` = idle.
    #[must_use]
    pub const fn poll_timeout(&self) -> Option<Duration> {
        match self.state {
            State::Waiting(deadline) => Some(deadline),
            _ => None,
        }
    }

    /// The outcome, once.
    pub fn poll_event(&mut self) -> Option<Event> {
        let State::Ended(outcome) = self.state else { return None };
        self.state = State::Idle;
        Some(Event { ticket: Ticket(self.ticket), outcome })
    }

    /// Whether this status is the drive's way to say "later".
    #[must_use]
    pub const fn is_later(outcome: &Outcome) -> bool {
        matches!(outcome, Outcome::Refused(Reply { status: Status::BUSY | Status::RUNNING, .. }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::request::Value;
    use crate::upid::Upid;

    const READ: Request = Request::Read { value: Value::Rom, upid: Upid(0x13A2) };
    const ANSWER: [u8; 14] = [0x01, 0x11, 0x0A, 0x02, 0x50, 0, 0, 0xA2, 0x13, 0x09, 0, 0, 0, 0x04];

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn asked(request: &Request, retries: u8) -> (Master, Ticket) {
        let mut master = Master::new(Config::new(0x11));
        let ticket = master.submit(request, retries).unwrap();
        assert!(master.poll_transmit(ms(0)).is_some());
        master.handle_transmit_done(ms(1));
        (master, ticket)
    }

    #[test]
    fn a_read_and_its_answer() {
        let (mut master, ticket) = asked(&READ, 1);
        assert_eq!(master.submit(&READ, 0), Err(SubmitError::Busy));
        ANSWER.chunks(3).for_each(|piece| master.handle_bytes(ms(5), piece));
        let outcome = Outcome::Done(Reply::with_value(Status::OK, 0x13A2, 9));
        assert_eq!(master.poll_event(), Some(Event { ticket, outcome }));
        // A second one answers nothing.
        master.handle_bytes(ms(6), &ANSWER);
        assert_eq!((master.poll_event(), master.strays()), (None, 1));
    }

    #[test]
    fn silence_and_wrong_answers() {
        let (mut master, _) = asked(&READ, 1);
        master.handle_timeout(ms(250));
        assert_eq!(master.poll_timeout(), Some(ms(251)));
        master.handle_timeout(ms(251));
        assert!(master.poll_transmit(ms(251)).is_some());
        master.handle_transmit_done(ms(252));
        master.handle_timeout(ms(600));
        assert_eq!(master.poll_event().unwrap().outcome, Outcome::TimedOut { attempts: 2 });
        let (mut master, _) = asked(&READ, 0);
        let mut other = ANSWER;
        other[4] = 0x51;
        master.handle_bytes(ms(5), &other);
        assert_eq!(master.poll_event().unwrap().outcome, Outcome::WrongEcho { sub: 0x51, main: 0 });
        // Another drive's answer is not ours.
        let (mut master, ticket) = asked(&READ, 0);
        other[1] = 0x12;
        master.handle_bytes(ms(5), &other);
        assert_eq!(master.poll_event(), None);
        master.cancel(ticket);
        assert_eq!(master.poll_event().unwrap().outcome, Outcome::Cancelled);
        let mut master = Master::new(Config::new(1));
        assert_eq!(master.submit(&Request::Restart, 1), Err(SubmitError::NotRepeatable));
    }

    #[test]
    fn flash_takes_its_time() {
        let (mut master, _) = asked(&Request::SaveCurves, 0);
        assert_eq!(master.poll_timeout(), Some(ms(15_001)));
        master.handle_bytes(ms(9000), &[0x01, 0x11, 0x0A, 0x02, 0x40, 0, 0xD7, 0, 0, 9, 0, 0, 0, 0x04]);
        let Outcome::Refused(reply) = master.poll_event().unwrap().outcome else { panic!() };
        assert_eq!(reply.status, Status::NOT_STOPPED);
    }
}
