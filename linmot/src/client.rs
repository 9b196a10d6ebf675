//! The client on the process data carrier: one command at a time, each with exactly one outcome
//! (manual B 7, flow of control and status word).

use core::time::Duration;

use crate::code::Status;
use crate::module::{Input, Output};
use crate::request::{Reply, Request};

/// Names one command from [`Client::submit`] to its outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Ticket(u32);

/// Times of the client, all project-defined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// Longest time from the first transmission to the echo of the count.
    pub echo: Duration,
    /// Longest time that the drive may show "running" (02h) or "busy" (05h): writing flash takes
    /// seconds.
    pub running: Duration,
    /// The same image is sent again so often while the echo is outstanding. That repeats no command,
    /// since the count stays the same.
    pub repeat: Duration,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            echo: Duration::from_secs(1),
            running: Duration::from_secs(30),
            repeat: Duration::from_millis(50),
        }
    }
}

/// Why [`Client::submit`] did not take a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SubmitError {
    /// One command at a time: the outcome of the last one has not been polled yet.
    #[error("a command is under way, its outcome must be polled first")]
    Busy,
}

/// How a command ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Outcome {
    /// Carried out, with status 00h or 04h.
    Done(Reply),
    /// The drive answered with another status.
    Refused(Reply),
    /// The count was not echoed in time. The command may have been carried out all the same.
    NoEcho {
        /// Sent with the command.
        expected: u8,
        /// What the drive showed all the time; `None` if nothing came.
        shown: Option<u8>,
    },
    /// The echo came, but the drive stayed at this status for too long.
    StillRunning(Status),
    /// The count fell back to 0: the drive has restarted. The command may have been carried out.
    Restarted,
    /// A count that was never sent.
    WrongEcho {
        /// Sent with the command.
        expected: u8,
        /// What came.
        found: u8,
    },
    /// [`Client::cancel`].
    Cancelled,
}

/// What [`Client::poll_event`] tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Event {
    /// Of [`Client::submit`].
    pub ticket: Ticket,
    /// How it ended.
    pub outcome: Outcome,
}

/// Count of the empty command that finds out whether the drive listens (control word 000Fh).
const SYNC: u8 = 15;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Idle,
    ToSend,
    /// The echo is outstanding until `deadline`; the image goes out again at `repeat`. `shown`: an
    /// earlier count, which has come meanwhile.
    Echo {
        deadline: Duration,
        repeat: Duration,
        shown: Option<u8>,
    },
    /// Echoed, with a status that another one follows.
    Running {
        deadline: Duration,
        status: Status,
    },
    Ended(Outcome),
}

/// The client of one drive's configuration module.
///
/// - Commands: [`submit`](Self::submit), [`cancel`](Self::cancel).
/// - Input: [`handle_input`](Self::handle_input), [`handle_restart`](Self::handle_restart),
///   [`handle_timeout`](Self::handle_timeout).
/// - Output: [`poll_transmit`](Self::poll_transmit), or [`image`](Self::image) for a carrier that
///   sends the process data in every cycle; [`poll_event`](Self::poll_event),
///   [`poll_timeout`](Self::poll_timeout).
///
/// The first command is preceded by an empty one with count 15, since a drive that still shows the
/// count of an earlier client would not see a command with that count. Counts run 1…15; 0 is kept for a restart, after which the drive's own count is 0 again and a
/// control word that still says 30h is not seen as new (manual B 7.1.2: "recommended with command
/// count 0").
#[derive(Debug, Clone)]
pub struct Client {
    config: Config,
    state: State,
    output: Output,
    /// Last count that the drive has shown.
    shown: Option<u8>,
    /// Follows when the drive has echoed the count of an empty command that goes first.
    pending: Option<Request>,
    ticket: u32,
}

impl Default for Client {
    fn default() -> Self {
        Self::new(Config::default())
    }
}

impl Client {
    /// An idle client.
    #[must_use]
    pub const fn new(config: Config) -> Self {
        Self { config, state: State::Idle, output: Output::IDLE, shown: None, pending: None, ticket: 0 }
    }

    /// The process data to the drive as they are now.
    #[must_use]
    pub const fn image(&self) -> [u8; 8] {
        self.output.encode()
    }

    /// Takes a command.
    ///
    /// # Errors
    /// [`SubmitError::Busy`] until the last command's outcome has been polled.
    pub fn submit(&mut self, request: &Request) -> Result<Ticket, SubmitError> {
        if self.state != State::Idle {
            return Err(SubmitError::Busy);
        }
        // The count must be another one than the drive shows, else the command is not seen as new. What
        // it shows is unknown at first, and 0 is the count of a restart: an empty command goes first.
        let first = match (self.shown, request) {
            (None, _) => Some(SYNC),
            (Some(0), Request::Restart) => Some(self.next_count()),
            _ => None,
        };
        self.pending = first.map(|_| *request);
        self.output = match first {
            Some(count) => Output::new(&Request::NoOperation, count),
            None => self.counted(request),
        };
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

    /// The process data to send now: once for a command, and again while its echo is outstanding.
    pub fn poll_transmit(&mut self, now: Duration) -> Option<[u8; 8]> {
        let repeat = now.saturating_add(self.config.repeat);
        match &mut self.state {
            State::ToSend => {
                let deadline = now.saturating_add(self.config.echo);
                self.state = State::Echo { deadline, repeat, shown: None };
            }
            State::Echo { repeat: at, .. } if now >= *at => *at = repeat,
            _ => return None,
        }
        Some(self.image())
    }

    /// Takes the process data from the drive, whenever they arrive.
    pub fn handle_input(&mut self, now: Duration, image: [u8; 8]) {
        let input = Input::parse(image);
        let before = self.shown.replace(input.count);
        let expected = self.output.count;
        let waiting = matches!(self.state, State::Echo { .. } | State::Running { .. });
        if !waiting {
            // The drive has restarted: the last command would be a new one to it.
            if input.count == 0 && before != Some(0) && self.state != State::ToSend {
                self.output = Output::IDLE;
            }
            return;
        }
        if input.count == expected {
            self.echoed(now, input.reply);
        } else if before.is_none_or(|count| count == input.count) && !self.is_running() {
            // The last command's echo, still.
            if let State::Echo { shown, .. } = &mut self.state {
                *shown = Some(input.count);
            }
        } else if input.count == 0 {
            self.handle_restart();
        } else {
            self.state = State::Ended(Outcome::WrongEcho { expected, found: input.count });
        }
    }

    /// The drive has restarted, as its carrier tells (the boot-up message of a CANopen node): its count
    /// is 0, and a command under way ends with [`Outcome::Restarted`]. The image becomes empty, since to a
    /// drive that has started anew the last command is a new one.
    pub fn handle_restart(&mut self) {
        (self.shown, self.output, self.pending) = (Some(0), Output::IDLE, None);
        if !matches!(self.state, State::Idle | State::Ended(_)) {
            self.state = State::Ended(Outcome::Restarted);
        }
    }

    /// Ends commands whose time is over; early calls do nothing.
    pub fn handle_timeout(&mut self, now: Duration) {
        match self.state {
            State::Echo { deadline, shown, .. } if now >= deadline => {
                let expected = self.output.count;
                self.state = State::Ended(Outcome::NoEcho { expected, shown });
            }
            State::Running { deadline, status } if now >= deadline => {
                self.state = State::Ended(Outcome::StillRunning(status));
            }
            _ => {}
        }
    }

    /// When to call [`handle_timeout`](Self::handle_timeout) and
    /// [`poll_transmit`](Self::poll_transmit) again; `None` = idle.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Duration> {
        match self.state {
            State::Echo { deadline, repeat, .. } => Some(deadline.min(repeat)),
            State::Running { deadline, .. } => Some(deadline),
            _ => None,
        }
    }

    /// The outcome, once.
    pub fn poll_event(&mut self) -> Option<Event> {
        let State::Ended(outcome) = self.state else { return None };
        self.state = State::Idle;
        Some(Event { ticket: Ticket(self.ticket), outcome })
    }

    fn is_running(&self) -> bool {
        matches!(self.state, State::Running { .. })
    }

    fn counted(&self, request: &Request) -> Output {
        Output::new(request, if *request == Request::Restart { 0 } else { self.next_count() })
    }

    /// Neither the last count nor one that the drive shows already.
    fn next_count(&self) -> u8 {
        let next = self.output.count % 15 + 1;
        if Some(next) == self.shown { next % 15 + 1 } else { next }
    }

    fn echoed(&mut self, now: Duration, reply: Reply) {
        if let Some(request) = self.pending.take() {
            self.output = self.counted(&request);
            self.state = State::ToSend;
            return;
        }
        self.state = match reply.status {
            status if status.is_running() => match self.state {
                State::Running { deadline, .. } => State::Running { deadline, status },
                _ => State::Running { deadline: now.saturating_add(self.config.running), status },
            },
            status if status.is_done() => State::Ended(Outcome::Done(reply)),
            _ => State::Ended(Outcome::Refused(reply)),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::code::Command;
    use crate::request::Value;
    use crate::upid::Upid;

    const READ: Request = Request::Read { value: Value::Rom, upid: Upid(0x13A2) };
    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn shows(status: Status, count: u8, value: u32) -> [u8; 8] {
        Input { reply: Reply::with_value(status, 0x13A2, value), count }.encode()
    }

    fn sent(client: &mut Client, at: u64) -> (Command, u8) {
        let output = Output::parse(client.poll_transmit(ms(at)).unwrap());
        (output.command, output.count)
    }

    /// A client whose drive has echoed the first, empty command.
    fn synchronised() -> Client {
        let mut client = Client::default();
        client.submit(&READ).unwrap();
        assert_eq!(sent(&mut client, 0), (Command::NO_OPERATION, 15));
        client.handle_input(ms(0), shows(Status::OK, 15, 0));
        assert_eq!(sent(&mut client, 0), (Command::READ_ROM, 1));
        client.handle_input(ms(0), shows(Status::OK, 1, 0));
        assert!(client.poll_event().is_some());
        client
    }

    /// Without the empty command the drive's old answer would be taken for the new one.
    #[test]
    fn an_earlier_clients_count_is_not_taken_for_an_echo() {
        let mut client = Client::default();
        client.submit(&READ).unwrap();
        sent(&mut client, 0);
        client.handle_input(ms(0), shows(Status::OK, 1, 77));
        assert_eq!(client.poll_event(), None);
        client.handle_input(ms(1), shows(Status::OK, 15, 0));
        assert_eq!(sent(&mut client, 1), (Command::READ_ROM, 1));
        client.handle_input(ms(2), shows(Status::OK, 1, 9));
        let Outcome::Done(reply) = client.poll_event().unwrap().outcome else { panic!() };
        assert_eq!(reply.value(), 9);
    }

    #[test]
    fn a_command_waits_for_its_echo() {
        let mut client = synchronised();
        let ticket = client.submit(&READ).unwrap();
        assert_eq!(client.submit(&READ), Err(SubmitError::Busy));
        assert_eq!(sent(&mut client, 0), (Command::READ_ROM, 2));
        assert_eq!(client.poll_transmit(ms(1)), None);
        client.handle_input(ms(2), shows(Status::OK, 1, 7));
        assert_eq!(client.poll_event(), None);
        // Repeated with the same count, which no drive takes for a new command.
        assert_eq!(client.poll_timeout(), Some(ms(50)));
        assert_eq!(sent(&mut client, 50), (Command::READ_ROM, 2));
        client.handle_input(ms(60), shows(Status::OK, 2, 9));
        let outcome = Outcome::Done(Reply::with_value(Status::OK, 0x13A2, 9));
        assert_eq!(client.poll_event(), Some(Event { ticket, outcome }));
        assert_eq!((client.poll_event(), client.poll_timeout()), (None, None));
    }

    #[test]
    fn running_is_followed_by_the_end() {
        let mut client = synchronised();
        client.submit(&Request::SaveCurves).unwrap();
        sent(&mut client, 0);
        client.handle_input(ms(5), shows(Status::RUNNING, 2, 0));
        assert_eq!((client.poll_event(), client.poll_timeout()), (None, Some(ms(30_005))));
        client.handle_input(ms(2000), shows(Status::RUNNING, 2, 0));
        assert_eq!(client.poll_timeout(), Some(ms(30_005)));
        client.handle_input(ms(4000), shows(Status::OK, 2, 0));
        assert!(matches!(client.poll_event().unwrap().outcome, Outcome::Done(_)));
        // And one that never ends.
        client.submit(&Request::SaveCurves).unwrap();
        sent(&mut client, 5000);
        client.handle_input(ms(5000), shows(Status::BUSY, 3, 0));
        client.handle_timeout(ms(34_999));
        assert_eq!(client.poll_event(), None);
        client.handle_timeout(ms(35_000));
        assert_eq!(client.poll_event().unwrap().outcome, Outcome::StillRunning(Status::BUSY));
    }

    #[test]
    fn every_other_end_has_its_name() {
        let end = |inputs: &[[u8; 8]], timeout: u64| {
            let mut client = synchronised();
            client.submit(&READ).unwrap();
            sent(&mut client, 0);
            for image in inputs {
                client.handle_input(ms(1), *image);
            }
            client.handle_timeout(ms(timeout));
            client.poll_event().map(|event| event.outcome)
        };
        assert_eq!(end(&[], 999), None);
        // Lost: nothing comes at all, or the last command's count over and over.
        let lost = |shown| Some(Outcome::NoEcho { expected: 2, shown });
        assert_eq!(end(&[], 1000), lost(None));
        assert_eq!(end(&[shows(Status::OK, 1, 0); 3], 1000), lost(Some(1)));
        assert_eq!(end(&[shows(Status::OK, 0, 0)], 2), Some(Outcome::Restarted));
        let wrong = Outcome::WrongEcho { expected: 2, found: 4 };
        assert_eq!(end(&[shows(Status::OK, 4, 0)], 2), Some(wrong));
        let refused = Outcome::Refused(Reply::with_value(Status::UPID, 0x13A2, 0));
        assert_eq!(end(&[shows(Status::UPID, 2, 0)], 2), Some(refused));
        let mut client = Client::default();
        let ticket = client.submit(&READ).unwrap();
        client.cancel(ticket);
        assert_eq!(client.poll_event(), Some(Event { ticket, outcome: Outcome::Cancelled }));
        assert_eq!(client.poll_transmit(ms(0)), None);
    }

    /// To a drive that has started anew a control word of before is a new command.
    #[test]
    fn nothing_is_repeated_after_a_restart() {
        let mut client = synchronised();
        client.submit(&READ).unwrap();
        sent(&mut client, 0);
        client.handle_restart();
        assert_eq!(client.poll_event().unwrap().outcome, Outcome::Restarted);
        assert_eq!((client.image(), client.poll_transmit(ms(1))), ([0; 8], None));
        // The idle image of the start comes after the message that told of it.
        client.submit(&READ).unwrap();
        assert_eq!(sent(&mut client, 2), (Command::READ_ROM, 1));
        client.handle_input(ms(3), shows(Status::OK, 0, 0));
        assert_eq!(client.poll_event(), None);
        client.handle_input(ms(4), shows(Status::OK, 1, 9));
        assert!(matches!(client.poll_event().unwrap().outcome, Outcome::Done(_)));
        // Seen by the count alone, between two commands.
        client.handle_input(ms(5), shows(Status::OK, 0, 0));
        assert_eq!((client.image(), client.poll_event()), ([0; 8], None));
        client.submit(&READ).unwrap();
        assert_eq!(sent(&mut client, 6), (Command::READ_ROM, 1));
        client.handle_input(ms(7), shows(Status::OK, 1, 9));
        assert!(matches!(client.poll_event().unwrap().outcome, Outcome::Done(_)));
    }

    /// Manual B 7.1.2: 30h with count 0; the counts in use never reach 0 otherwise.
    #[test]
    fn restart_uses_count_0() {
        let mut client = synchronised();
        for round in 0..40 {
            client.submit(&READ).unwrap();
            let (_, count) = sent(&mut client, round);
            assert!((1..=15).contains(&count));
            client.handle_input(ms(round), shows(Status::OK, count, 0));
            assert!(client.poll_event().is_some());
        }
        client.submit(&Request::Restart).unwrap();
        assert_eq!(sent(&mut client, 100), (Command::RESTART, 0));
        client.handle_input(ms(101), shows(Status::OK, 0, 0));
        assert!(matches!(client.poll_event().unwrap().outcome, Outcome::Done(_)));
        // A drive that shows 0 would not see 30h with count 0: another count goes first.
        client.submit(&Request::Restart).unwrap();
        let (command, count) = sent(&mut client, 200);
        assert_eq!((command, count > 0), (Command::NO_OPERATION, true));
        client.handle_input(ms(201), shows(Status::OK, count, 0));
        assert_eq!(client.poll_event(), None);
        assert_eq!(sent(&mut client, 202), (Command::RESTART, 0));
        client.handle_input(ms(203), shows(Status::OK, 0, 0));
        assert!(matches!(client.poll_event().unwrap().outcome, Outcome::Done(_)));
    }
}
