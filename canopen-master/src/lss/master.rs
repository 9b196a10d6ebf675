//! The master's side: one operation at a time, each with exactly one outcome.

use core::time::Duration;

use pdo::{Frame, Handled, NodeId, cob};

use crate::clock::{after, is_due};

use super::{
    BitTiming, FASTSCAN_CONFIRM, Identity, Mode, Part, Refusal, Request, Response, UNCONFIGURED, node_of,
};

/// Names one operation from [`Master::submit`] to its outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Ticket(u32);

/// What to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Operation {
    /// All slaves change their state; nobody answers.
    SwitchGlobal(Mode),
    /// The slave with this identity enters configuration.
    Select(Identity),
    /// Gives the slave in configuration a node ID, `None` takes it away.
    ConfigureNodeId(Option<NodeId>),
    /// Sets the bit rate of the slave in configuration.
    ConfigureBitTiming(BitTiming),
    /// All slaves in configuration change to the bit rate set; nobody answers. The master's own
    /// adapter is the caller's.
    ActivateBitTiming {
        /// ms before the change, and again before anything is sent.
        delay_ms: u16,
    },
    /// The slave in configuration stores node ID and bit rate.
    Store,
    /// Reads the identity of the slave in configuration. It takes [`Config::answer`], so that a second slave
    /// is noticed.
    InquireIdentity,
    /// Reads the node ID of the slave in configuration.
    InquireNodeId,
    /// Finds one slave without node ID and brings it into configuration.
    Fastscan,
}

/// How an operation ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Outcome {
    /// Done; of operations that nobody answers, sent.
    Done,
    /// The identity of the slave in configuration: of [`Operation::InquireIdentity`] and
    /// [`Operation::Fastscan`].
    Identity(Identity),
    /// The node ID of the slave in configuration, `None` if it has none.
    NodeId(Option<NodeId>),
    /// The slave refused.
    Refused(Refusal),
    /// Nobody answered in time; of [`Operation::Fastscan`], there is no slave without node ID.
    TimedOut,
    /// Fastscan: slaves answered, but none confirmed the number found; up to this part.
    Unconfirmed(Part),
    /// [`Operation::InquireIdentity`]: a second slave in configuration answered with another number here.
    Several(Part),
    /// [`Master::cancel`].
    Cancelled,
}

/// Why [`Master::submit`] did not take an operation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SubmitError {
    /// One operation at a time: the outcome of the last one has not been polled yet.
    #[error("an LSS operation is under way, its outcome must be polled first")]
    Busy,
}

/// Times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// Longest time to an answer.
    pub answer: Duration,
    /// Time that every step of fastscan takes: several slaves may answer a step, and an answer that
    /// comes in the next step would be taken for one to that.
    pub fastscan_step: Duration,
}

/// Project-defined; CiA 305 leaves both to the master.
impl Default for Config {
    fn default() -> Self {
        Self { answer: Duration::from_millis(100), fastscan_step: Duration::from_millis(10) }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Idle,
    Send(Step),
    Wait(Step, Duration),
    Ended(Outcome),
}

/// Where in an operation the engine is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Step {
    /// The only request of its operation.
    Single,
    /// One number of `Select` or `InquireIdentity`.
    Part(Part),
    /// Fastscan: is anybody there?
    Anybody,
    /// Fastscan: one bit of a number.
    Bit(Part, u8),
    /// Fastscan: the whole number.
    Confirm(Part),
}

/// The LSS master on one bus.
///
/// - Commands: [`submit`](Self::submit), [`cancel`](Self::cancel).
/// - Input: [`handle_frame`](Self::handle_frame), [`handle_timeout`](Self::handle_timeout).
/// - Output: [`poll_transmit`](Self::poll_transmit), [`poll_event`](Self::poll_event),
///   [`poll_timeout`](Self::poll_timeout).
#[derive(Debug, Clone)]
pub struct Master {
    config: Config,
    state: State,
    operation: Operation,
    ticket: u32,
    identity: Identity,
    answered: bool,
}

impl Default for Master {
    fn default() -> Self {
        Self::new(Config::default())
    }
}

impl Master {
    /// An idle master.
    #[must_use]
    pub fn new(config: Config) -> Self {
        Self {
            config,
            state: State::Idle,
            operation: Operation::Store,
            ticket: 0,
            identity: Identity::default(),
            answered: false,
        }
    }

    /// Starts an operation.
    ///
    /// # Errors
    /// [`SubmitError::Busy`] until the outcome of the last one has been polled.
    pub fn submit(&mut self, operation: Operation) -> Result<Ticket, SubmitError> {
        if self.state != State::Idle {
            return Err(SubmitError::Busy);
        }
        self.ticket = self.ticket.wrapping_add(1);
        self.operation = operation;
        self.answered = false;
        self.identity = match operation {
            Operation::Select(identity) => identity,
            _ => Identity::default(),
        };
        self.state = State::Send(match operation {
            Operation::Select(_) | Operation::InquireIdentity => Step::Part(Part::Vendor),
            Operation::Fastscan => Step::Anybody,
            _ => Step::Single,
        });
        Ok(Ticket(self.ticket))
    }

    /// Gives an operation up, unless it has its outcome already.
    pub fn cancel(&mut self, ticket: Ticket) {
        if ticket.0 == self.ticket && matches!(self.state, State::Send(_) | State::Wait(..)) {
            self.state = State::Ended(Outcome::Cancelled);
        }
    }

    /// The request to send now.
    pub fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        let State::Send(step) = self.state else { return None };
        let frame = self.request(step).frame();
        self.answered = false;
        let silent = matches!(
            (self.operation, step),
            (Operation::SwitchGlobal(_) | Operation::ActivateBitTiming { .. }, _)
        );
        let wait = match self.operation {
            Operation::Fastscan => self.config.fastscan_step,
            _ => self.config.answer,
        };
        self.state = match (self.operation, step) {
            _ if silent => State::Ended(Outcome::Done),
            (Operation::Select(_), Step::Part(part)) if part != Part::Serial => {
                State::Send(Step::Part(part.next()))
            }
            _ => State::Wait(step, after(now, wait)),
        };
        Some(frame)
    }

    /// Takes a frame.
    pub fn handle_frame(&mut self, frame: &Frame) -> Handled {
        if frame.standard_id() != Some(cob::LSS_RESPONSE) {
            return Handled::Ignored;
        }
        let Some(response) = Response::from_frame(frame) else { return Handled::Taken };
        if let (Operation::InquireIdentity, Response::Identity(part, value)) = (self.operation, response) {
            self.on_number(part, value);
        }
        let State::Wait(step, _) = self.state else { return Handled::Taken };
        match (self.operation, response) {
            (Operation::Select(_), Response::Selected) => self.state = State::Ended(Outcome::Done),
            (Operation::InquireNodeId, Response::NodeId(node)) => {
                self.state = State::Ended(Outcome::NodeId(node_of(node)));
            }
            (Operation::Fastscan, Response::Identified) => self.answered = true,
            (_, Response::Done { command, result }) => {
                let [asked, ..] = self.request(step).encode();
                if command == asked {
                    self.state = State::Ended(match result {
                        Refusal { code: 0, .. } => Outcome::Done,
                        refusal => Outcome::Refused(refusal),
                    });
                }
            }
            _ => {}
        }
        Handled::Taken
    }

    /// A slave in configuration says one of its numbers, asked for now or before.
    fn on_number(&mut self, part: Part, value: u32) {
        let (asked, waits) = match self.state {
            State::Send(Step::Part(next)) => (next, false),
            State::Wait(Step::Part(asked), _) => (asked, true),
            _ => return,
        };
        if part < asked || self.answered {
            if value != self.identity.part(part) {
                self.state = State::Ended(Outcome::Several(part));
            }
        } else if part == asked && waits {
            self.identity.set_part(part, value);
            match part {
                // The number that tells most slaves apart: all have time to answer.
                Part::Serial => self.answered = true,
                part => self.state = State::Send(Step::Part(part.next())),
            }
        }
    }

    /// Ends waiting when its time is over; early calls do nothing.
    pub fn handle_timeout(&mut self, now: Duration) {
        let State::Wait(step, deadline) = self.state else { return };
        if !is_due(Some(deadline), now) {
            return;
        }
        let next = match step {
            Step::Anybody if self.answered => Step::Bit(Part::Vendor, 31),
            Step::Bit(part, bit) => {
                if !self.answered {
                    let number = self.identity.part(part) | 1u32.checked_shl(u32::from(bit)).unwrap_or(0);
                    self.identity.set_part(part, number);
                }
                bit.checked_sub(1).map_or(Step::Confirm(part), |bit| Step::Bit(part, bit))
            }
            Step::Confirm(Part::Serial) | Step::Part(Part::Serial) if self.answered => {
                self.state = State::Ended(Outcome::Identity(self.identity));
                return;
            }
            Step::Confirm(part) if self.answered => Step::Bit(part.next(), 31),
            Step::Confirm(part) => {
                self.state = State::Ended(Outcome::Unconfirmed(part));
                return;
            }
            Step::Anybody | Step::Single | Step::Part(_) => {
                self.state = State::Ended(Outcome::TimedOut);
                return;
            }
        };
        self.state = State::Send(next);
    }

    /// When to call [`handle_timeout`](Self::handle_timeout); `None` = idle.
    #[must_use]
    pub const fn poll_timeout(&self) -> Option<Duration> {
        match self.state {
            State::Wait(_, deadline) => Some(deadline),
            _ => None,
        }
    }

    /// The outcome of the operation, once.
    pub fn poll_event(&mut self) -> Option<(Ticket, Outcome)> {
        let State::Ended(outcome) = self.state else { return None };
        self.state = State::Idle;
        Some((Ticket(self.ticket), outcome))
    }

    fn request(&self, step: Step) -> Request {
        let fastscan =
            |bit, part: Part, next| Request::Fastscan { number: self.identity.part(part), bit, part, next };
        match (step, self.operation) {
            (Step::Anybody, _) => fastscan(FASTSCAN_CONFIRM, Part::Vendor, Part::Vendor),
            (Step::Bit(part, bit), _) => fastscan(bit, part, part),
            (Step::Confirm(part), _) => fastscan(0, part, part.next()),
            (Step::Part(part), Operation::Select(identity)) => Request::Select(part, identity.part(part)),
            (Step::Part(part), _) => Request::Inquire(part),
            (Step::Single, Operation::SwitchGlobal(mode)) => Request::SwitchGlobal(mode),
            (Step::Single, Operation::ConfigureNodeId(node)) => {
                Request::ConfigureNodeId(node.map_or(UNCONFIGURED, NodeId::raw))
            }
            (Step::Single, Operation::ConfigureBitTiming(rate)) => {
                Request::ConfigureBitTiming { table: 0, index: rate.index() }
            }
            (Step::Single, Operation::ActivateBitTiming { delay_ms }) => {
                Request::ActivateBitTiming { delay_ms }
            }
            (Step::Single, Operation::InquireNodeId) => Request::InquireNodeId,
            (Step::Single, _) => Request::Store,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Action, Slave};
    use super::*;
    use std::vec::Vec;

    /// One operation against slaves on virtual time.
    fn run(master: &mut Master, slaves: &mut [Slave], operation: Operation) -> (Outcome, Duration) {
        let mut now = Duration::ZERO;
        let ticket = master.submit(operation).unwrap();
        assert_eq!(master.submit(operation), Err(SubmitError::Busy));
        for _ in 0..1000 {
            while let Some(frame) = master.poll_transmit(now) {
                let request = Request::from_frame(&frame).unwrap();
                for slave in &mut *slaves {
                    let (answer, action) = slave.handle(request);
                    let stored = action
                        .filter(|action| matches!(action, Action::Store { .. }))
                        .map(|_| Slave::stored(Err(Refusal::NOT_SUPPORTED)));
                    for frame in answer.into_iter().chain(stored) {
                        assert_eq!(master.handle_frame(&frame), Handled::Taken);
                    }
                }
            }
            if let Some((ended, outcome)) = master.poll_event() {
                assert_eq!(ended, ticket);
                assert_eq!(master.poll_event(), None);
                return (outcome, now);
            }
            now = master.poll_timeout().unwrap();
            master.handle_timeout(now);
        }
        panic!("no outcome")
    }

    fn identity(seed: u32) -> Identity {
        Identity { vendor: 0x6A, product: seed.wrapping_mul(0x9E37_79B9), revision: 1, serial: !seed }
    }

    #[test]
    fn fastscan_finds_every_slave_once() {
        let mut slaves: Vec<_> = (0..5).map(|seed| Slave::new(identity(seed), None, &[])).collect();
        let mut master = Master::default();
        let mut found = Vec::new();
        for node in 1.. {
            let (outcome, time) = run(&mut master, &mut slaves, Operation::Fastscan);
            let Outcome::Identity(identity) = outcome else {
                assert_eq!((outcome, found.len()), (Outcome::TimedOut, 5));
                break;
            };
            assert_eq!(time, Config::default().fastscan_step * (1 + 4 * 33));
            found.push(identity);
            let node = NodeId::new(node).ok();
            assert_eq!(run(&mut master, &mut slaves, Operation::ConfigureNodeId(node)).0, Outcome::Done);
            let read = run(&mut master, &mut slaves, Operation::InquireIdentity).0;
            assert_eq!(read, Outcome::Identity(identity));
            run(&mut master, &mut slaves, Operation::SwitchGlobal(Mode::Waiting));
        }
        found.sort();
        let mut all: Vec<_> = (0..5).map(identity).collect();
        all.sort();
        assert_eq!(found, all);
        let mut nodes: Vec<_> = slaves.iter().map(|slave| slave.node().unwrap().raw()).collect();
        nodes.sort_unstable();
        assert_eq!(nodes, [1, 2, 3, 4, 5]);
    }

    #[test]
    fn selective_operations() {
        let mut slaves = [1, 2].map(|seed| Slave::new(identity(seed), NodeId::new(seed as u8).ok(), &[]));
        let mut master = Master::default();
        let mut run = |operation| run(&mut master, &mut slaves, operation).0;
        assert_eq!(run(Operation::Select(identity(3))), Outcome::TimedOut);
        assert_eq!(run(Operation::Select(identity(2))), Outcome::Done);
        assert_eq!(run(Operation::InquireNodeId), Outcome::NodeId(NodeId::new(2).ok()));
        assert_eq!(run(Operation::Store), Outcome::Refused(Refusal::NOT_SUPPORTED));
        let rate = BitTiming::from_kbits(20).unwrap();
        assert_eq!(run(Operation::ConfigureBitTiming(rate)), Outcome::Refused(Refusal::NOT_SUPPORTED));
        assert_eq!(run(Operation::Fastscan), Outcome::TimedOut, "all have a node ID");
    }

    #[test]
    fn a_second_slave_in_configuration_is_noticed() {
        let mut master = Master::default();
        for part in Part::ALL {
            let mut other = identity(1);
            other.set_part(part, 77);
            let mut slaves = [identity(1), other].map(|identity| Slave::new(identity, None, &[]));
            let mut run = |operation| run(&mut master, &mut slaves, operation).0;
            run(Operation::SwitchGlobal(Mode::Configuration));
            assert_eq!(run(Operation::InquireIdentity), Outcome::Several(part));
        }
        // An answer that comes twice is one.
        let mut slaves = [1, 1].map(|seed| Slave::new(identity(seed), None, &[]));
        let mut run = |operation| run(&mut master, &mut slaves, operation);
        run(Operation::SwitchGlobal(Mode::Configuration));
        let read = run(Operation::InquireIdentity);
        assert_eq!(read, (Outcome::Identity(identity(1)), Config::default().answer));
    }

    #[test]
    fn an_operation_can_be_given_up() {
        let mut master = Master::default();
        let ticket = master.submit(Operation::Store).unwrap();
        master.poll_transmit(Duration::ZERO);
        master.cancel(ticket);
        assert_eq!(master.poll_event(), Some((ticket, Outcome::Cancelled)));
        assert_eq!(master.poll_timeout(), None);
    }
}
