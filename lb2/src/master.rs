//! The master side: one request at a time on a half-duplex line, each with exactly one outcome.

use core::time::Duration;

use crate::code::ErrorCode;
use crate::device::INTER_BYTE;
use crate::frame::{Damage, DamageKind, Decoder, EncodeError, Frame, Item, MAX_WIRE};
use crate::telegram::{Echo, NumberError, Request, Response};

/// Time that a device has to begin its answer, from the end of the request (decision 9; manual A
/// says only that it "can be longer than 15 ms").
pub const ANSWER: Duration = Duration::from_millis(100);

/// Names one request from [`Master::submit`] to its outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Ticket(u32);

/// Times of the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// Longest time from the end of a request to the first byte of its answer.
    pub answer: Duration,
    /// Longest silence inside one telegram.
    pub inter_byte: Duration,
}

impl Default for Config {
    fn default() -> Self {
        Self { answer: ANSWER, inter_byte: INTER_BYTE }
    }
}

/// Why [`Master::submit`] did not take a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SubmitError {
    /// One request at a time: the outcome of the last one has not been polled yet.
    #[error("a request is under way, its outcome must be polled first")]
    Busy,
    /// A repeated write could change the device twice.
    #[error("only reads may be repeated, function {function:02X}h is not one")]
    NotRepeatable {
        /// Function byte of the request.
        function: u8,
    },
    /// The request has more data than a telegram carries.
    #[error(transparent)]
    Encode(#[from] EncodeError),
}

/// How a request ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Outcome<'a> {
    /// The device answered.
    Done(Response<'a>),
    /// The device answered with an error telegram.
    Refused(ErrorCode),
    /// No complete answer came in time, at the last of the attempts. A write may have been carried
    /// out all the same.
    TimedOut(TimedOut),
    /// Something answered that is no answer to this request.
    WrongEcho(Mismatch),
    /// [`Master::cancel`].
    Cancelled,
}

/// What was heard in place of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimedOut {
    /// How often the request was sent, at least 1.
    pub attempts: u8,
    /// The last damage since the request was sent; `None`: silence.
    pub damage: Option<DamageKind>,
}

/// Why a good telegram is no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Mismatch {
    /// It answers another request.
    #[error("answer to {found}, expected one to {expected}")]
    Other {
        /// What an answer to the request repeats.
        expected: Echo,
        /// What came.
        found: Echo,
    },
    /// No answer of that function has such a number byte.
    #[error(transparent)]
    Number(#[from] NumberError),
}

/// What [`Master::poll_event`] tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event<'a> {
    /// The one outcome of a request.
    Outcome {
        /// Of [`Master::submit`].
        ticket: Ticket,
        /// How it ended.
        outcome: Outcome<'a>,
    },
    /// Damage on the line.
    Damage(Damage),
    /// A second answer to a request that was answered before: two devices feel addressed (two with
    /// the same number, or one with number 0, which always answers).
    SecondAnswer(Ticket),
    /// The answer to a request that had timed out or was cancelled.
    Late(Ticket),
    /// A good telegram that answers nothing asked.
    Stray(Echo),
    /// An error telegram with nothing asked.
    StrayError(ErrorCode),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Notice {
    Damage(Damage),
    SecondAnswer(Ticket),
    Late(Ticket),
    Stray(Echo),
    StrayError(ErrorCode),
}

/// Notices held until polled; more are counted in [`Master::lost_notices`].
const NOTICES: usize = 3;

#[derive(Debug, Clone, Copy)]
enum State {
    Idle,
    /// The request lies in `buffer`, to be polled.
    ToSend,
    /// Polled; the caller has not said that the line turned round.
    Sending,
    /// Until when an answer may begin.
    Waiting(Duration),
    /// The outcome waits to be polled; of `Done`, the answer's block lies in `buffer`.
    Ended(Ended),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Ended {
    Done,
    Refused(ErrorCode),
    TimedOut,
    WrongEcho(Mismatch),
    Cancelled,
}

/// A request, as far as it is needed when its answer comes.
#[derive(Debug, Clone, Copy)]
struct Asked {
    ticket: Ticket,
    echo: Echo,
    answered: bool,
}

/// The LB2 master on one line.
///
/// - Commands: [`submit`](Self::submit), [`cancel`](Self::cancel).
/// - Input: [`handle_bytes`](Self::handle_bytes), [`handle_transmit_done`](Self::handle_transmit_done),
///   [`handle_timeout`](Self::handle_timeout).
/// - Output: [`poll_transmit`](Self::poll_transmit), [`poll_event`](Self::poll_event),
///   [`poll_timeout`](Self::poll_timeout).
/// - Getters: [`decoder`](Self::decoder), [`lost_notices`](Self::lost_notices).
///
/// Nothing is ever sent twice unless `submit` was told to, and that only for requests that change
/// nothing ([`Request::is_repeatable`]).
///
/// An answer carries nothing to tell two like requests apart: where a request timed out and the
/// very same one is asked again, a late answer to the first counts as the answer to the second.
#[derive(Debug, Clone)]
pub struct Master {
    config: Config,
    decoder: Decoder,
    state: State,
    /// The request on the wire, then the block of its answer.
    buffer: [u8; MAX_WIRE],
    len: u16,
    current: Option<Asked>,
    previous: Option<Asked>,
    next_ticket: u32,
    retries: u8,
    attempts: u8,
    damage: Option<DamageKind>,
    /// When silence ends a telegram that has begun.
    silence: Option<Duration>,
    notices: [Option<Notice>; NOTICES],
    lost_notices: u32,
}

impl Default for Master {
    fn default() -> Self {
        Self::new(Config::default())
    }
}

impl Master {
    /// An idle master.
    #[must_use]
    pub const fn new(config: Config) -> Self {
        Self {
            config,
            decoder: Decoder::new(),
            state: State::Idle,
            buffer: [0; MAX_WIRE],
            len: 0,
            current: None,
            previous: None,
            next_ticket: 0,
            retries: 0,
            attempts: 0,
            damage: None,
            silence: None,
            notices: [None; NOTICES],
            lost_notices: 0,
        }
    }

    /// The times of the line.
    #[must_use]
    pub const fn config(&self) -> Config {
        self.config
    }

    /// The receiver's decoder, for its counters.
    #[must_use]
    pub const fn decoder(&self) -> &Decoder {
        &self.decoder
    }

    /// Notices (all events but outcomes) that were dropped because nobody polled.
    #[must_use]
    pub const fn lost_notices(&self) -> u32 {
        self.lost_notices
    }

    /// Takes a request; it is sent by the next [`poll_transmit`](Self::poll_transmit), and again up
    /// to `retries` times when no answer came or the device reported a transmission error.
    ///
    /// # Errors
    /// [`SubmitError::Busy`] until the last request's outcome has been polled,
    /// [`SubmitError::NotRepeatable`] for `retries` above 0 of a request that changes the device,
    /// [`SubmitError::Encode`] for one that no telegram can carry.
    pub fn submit(&mut self, request: &Request<'_>, retries: u8) -> Result<Ticket, SubmitError> {
        if !matches!(self.state, State::Idle) {
            return Err(SubmitError::Busy);
        }
        if retries > 0 && !request.is_repeatable() {
            return Err(SubmitError::NotRepeatable { function: request.function() });
        }
        self.len = request.encode(&mut self.buffer)? as u16;
        let ticket = Ticket(self.next_ticket);
        self.next_ticket = self.next_ticket.wrapping_add(1);
        self.previous = self.current.take().or(self.previous);
        self.current = Some(Asked { ticket, echo: request.echo(), answered: false });
        self.retries = retries;
        self.attempts = 0;
        self.damage = None;
        self.state = State::ToSend;
        Ok(ticket)
    }

    /// Gives a request up; its outcome becomes [`Outcome::Cancelled`] unless it has one already.
    pub fn cancel(&mut self, ticket: Ticket) {
        let open = matches!(self.state, State::ToSend | State::Sending | State::Waiting(_));
        if open && self.current.is_some_and(|asked| asked.ticket == ticket) {
            self.state = State::Ended(Ended::Cancelled);
        }
    }

    /// The bytes to send now, once. The caller says when the last of them has left the line with
    /// [`handle_transmit_done`](Self::handle_transmit_done).
    pub fn poll_transmit(&mut self, _now: Duration) -> Option<&[u8]> {
        if !matches!(self.state, State::ToSend) {
            return None;
        }
        self.state = State::Sending;
        self.attempts = self.attempts.saturating_add(1);
        self.buffer.get(..usize::from(self.len))
    }

    /// The last byte of the request has left: the time for an answer starts.
    pub fn handle_transmit_done(&mut self, now: Duration) {
        if matches!(self.state, State::Sending) {
            self.state = State::Waiting(now.saturating_add(self.config.answer));
        }
    }

    /// Takes received bytes in any chunking.
    pub fn handle_bytes(&mut self, now: Duration, bytes: &[u8]) {
        if self.silence.is_some_and(|silence| now >= silence) {
            self.end_telegram(now);
        }
        self.run(now, bytes);
        if !bytes.is_empty() {
            let open = self.decoder.in_telegram();
            self.silence = open.then(|| now.saturating_add(self.config.inter_byte));
        }
    }

    /// Ends telegrams and requests whose time is over; early calls do nothing.
    pub fn handle_timeout(&mut self, now: Duration) {
        if self.silence.is_some_and(|silence| now >= silence) {
            self.end_telegram(now);
        }
        // An answer that has begun in time may go on.
        if self.silence.is_none() {
            self.check_answer_time(now);
        }
    }

    /// When to call [`handle_timeout`](Self::handle_timeout); `None` = idle.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Duration> {
        match (self.silence, self.state) {
            (Some(silence), _) => Some(silence),
            (None, State::Waiting(deadline)) => Some(deadline),
            _ => None,
        }
    }

    /// What happened, until `None`. An answer's data are borrowed from the engine: the next request
    /// can be submitted when they have been used.
    pub fn poll_event(&mut self) -> Option<Event<'_>> {
        if let [Some(notice), second, third] = self.notices {
            self.notices = [second, third, None];
            return Some(match notice {
                Notice::Damage(damage) => Event::Damage(damage),
                Notice::SecondAnswer(ticket) => Event::SecondAnswer(ticket),
                Notice::Late(ticket) => Event::Late(ticket),
                Notice::Stray(echo) => Event::Stray(echo),
                Notice::StrayError(code) => Event::StrayError(code),
            });
        }
        let State::Ended(ended) = self.state else { return None };
        let ticket = self.current?.ticket;
        self.state = State::Idle;
        let outcome = match ended {
            Ended::Done => {
                let frame = Frame::new_checked(self.buffer.get(..usize::from(self.len))?).ok()?;
                Outcome::Done(Response::parse(&frame).ok()?)
            }
            Ended::Refused(code) => Outcome::Refused(code),
            Ended::TimedOut => Outcome::TimedOut(TimedOut { attempts: self.attempts, damage: self.damage }),
            Ended::WrongEcho(mismatch) => Outcome::WrongEcho(mismatch),
            Ended::Cancelled => Outcome::Cancelled,
        };
        Some(Event::Outcome { ticket, outcome })
    }

    fn end_telegram(&mut self, now: Duration) {
        self.silence = None;
        self.decoder.gap();
        self.run(now, &[]);
    }

    fn check_answer_time(&mut self, now: Duration) {
        if matches!(self.state, State::Waiting(deadline) if now >= deadline) {
            self.unanswered(Ended::TimedOut);
        }
    }

    /// No answer, or one that says the request was not understood: once more, if that is wanted.
    fn unanswered(&mut self, ended: Ended) {
        self.state = if self.attempts <= self.retries { State::ToSend } else { State::Ended(ended) };
    }

    fn run(&mut self, now: Duration, mut bytes: &[u8]) {
        loop {
            let (taken, item) = self.decoder.decode(bytes);
            bytes = bytes.get(taken..).unwrap_or(&[]);
            match item {
                None => return,
                Some(Item::Damage(damage)) => {
                    self.damage = Some(damage.kind);
                    notify(&mut self.notices, &mut self.lost_notices, Notice::Damage(damage));
                    self.check_answer_time(now);
                }
                Some(Item::Frame { frame, .. }) => {
                    let waiting = matches!(self.state, State::Sending | State::Waiting(_));
                    let verdict = judge(&frame, waiting, self.current.as_ref(), self.previous.as_ref());
                    match verdict {
                        Verdict::Notice(notice) => notify(&mut self.notices, &mut self.lost_notices, notice),
                        Verdict::Done => {
                            if let Some(room) = self.buffer.get_mut(..frame.block().len()) {
                                room.copy_from_slice(frame.block());
                                self.len = frame.block().len() as u16;
                            }
                            self.answered(Ended::Done);
                        }
                        Verdict::Refused(code) if code.is_transmission() => {
                            self.unanswered(Ended::Refused(code));
                        }
                        Verdict::Refused(code) => self.answered(Ended::Refused(code)),
                        Verdict::Wrong(mismatch) => self.state = State::Ended(Ended::WrongEcho(mismatch)),
                    }
                }
            }
        }
    }

    fn answered(&mut self, ended: Ended) {
        self.state = State::Ended(ended);
        if let Some(asked) = &mut self.current {
            asked.answered = true;
        }
    }
}

enum Verdict {
    Notice(Notice),
    Done,
    Refused(ErrorCode),
    Wrong(Mismatch),
}

fn notify(notices: &mut [Option<Notice>], lost: &mut u32, notice: Notice) {
    match notices.iter_mut().find(|slot| slot.is_none()) {
        Some(slot) => *slot = Some(notice),
        None => *lost = lost.saturating_add(1),
    }
}

/// Whose answer a telegram is. `waiting`: the answer to `current` is still outstanding.
fn judge(frame: &Frame<'_>, waiting: bool, current: Option<&Asked>, previous: Option<&Asked>) -> Verdict {
    let response = match Response::parse(frame) {
        Ok(response) => response,
        Err(error) if waiting => return Verdict::Wrong(Mismatch::Number(error)),
        Err(error) => {
            let echo = Echo { function: error.function, sub: None, key: 0, len: 0 };
            return Verdict::Notice(Notice::Stray(echo));
        }
    };
    let Some(found) = response.echo() else {
        let Response::Error(code) = response else { return Verdict::Done };
        return if waiting { Verdict::Refused(code) } else { Verdict::Notice(Notice::StrayError(code)) };
    };
    if let Some(current) = current
        && current.echo == found
    {
        return match (waiting, current.answered) {
            (true, _) => Verdict::Done,
            (false, true) => Verdict::Notice(Notice::SecondAnswer(current.ticket)),
            (false, false) => Verdict::Notice(Notice::Late(current.ticket)),
        };
    }
    match (previous, current) {
        (Some(previous), _) if previous.echo == found => Verdict::Notice(match previous.answered {
            true => Notice::SecondAnswer(previous.ticket),
            false => Notice::Late(previous.ticket),
        }),
        (_, Some(current)) if waiting => Verdict::Wrong(Mismatch::Other { expected: current.echo, found }),
        _ => Verdict::Notice(Notice::Stray(found)),
    }
}
