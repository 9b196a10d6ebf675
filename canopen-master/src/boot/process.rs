//! The boot of one node, step by step; the master carries the steps out.

use core::time::Duration;

use pdo::Address;

use super::{Booted, Config, ErrorControl, Failure, Running, runs};
use crate::clock::{after, after_ms, is_due};
use crate::guarding;
use crate::lss::Part;
use crate::nmt::{Command, State};
use crate::scan::{DEVICE_TYPE, Head, IDENTITY};
use crate::sdo::Outcome;

/// Producer heartbeat time (1017h).
const HEARTBEAT_TIME: Address = Address::new(0x1017, 0);

/// What the master has to do next.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Action<'d> {
    /// Nothing until something comes, or the deadline.
    Wait,
    /// Ask for the node's state by a remote frame.
    AskState,
    Nmt(Command),
    Read(Address),
    Write(Address, Head),
    WriteDcf(Address, &'d [u8]),
    WatchHeartbeat(u16),
    Guard(guarding::Config),
    End(Result<Booted, Failure>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Step {
    CheckState,
    BootUp,
    DeviceType,
    Identity(Part),
    Date,
    Time,
    Dcf(Address),
    HeartbeatTime,
    ErrorControl,
    /// All is done but the start command.
    Start,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Process<'d> {
    config: &'d Config<'d>,
    step: Step,
    deadline: Option<Duration>,
    dcf: super::ConciseDcf<'d>,
    booted: Booted,
    /// The node has started anew in the middle of it.
    again: bool,
}

impl<'d> Process<'d> {
    pub(crate) fn new(config: &'d Config<'d>) -> Self {
        let booted = Booted { device_type: 0, taken_over: false, written: 0 };
        Self { config, step: Step::CheckState, deadline: None, dcf: config.dcf, booted, again: false }
    }

    pub(crate) const fn answer_time(&self) -> Duration {
        self.config.answer
    }

    pub(crate) const fn deadline(&self) -> Option<Duration> {
        self.deadline
    }

    pub(crate) fn begin(&mut self, now: Duration) -> Action<'d> {
        if self.config.running == Running::Reset {
            return self.reset(now);
        }
        self.step = Step::CheckState;
        let (wait, ask) = match self.config.error_control {
            ErrorControl::Heartbeat { consumer_ms, .. } => (millis(consumer_ms), false),
            ErrorControl::Guarding(config) => (config.life_time(), true),
            ErrorControl::None => (self.config.answer, true),
        };
        self.deadline = Some(after(now, wait));
        if ask { Action::AskState } else { Action::Wait }
    }

    /// The node has shown a state.
    pub(crate) fn on_state(&mut self, now: Duration, state: State) -> Action<'d> {
        match self.step {
            Step::CheckState if runs(state) => {
                self.booted.taken_over = true;
                self.read_device_type()
            }
            Step::CheckState => self.reset(now),
            Step::ErrorControl => self.start(),
            _ => Action::Wait,
        }
    }

    pub(crate) fn on_boot_up(&mut self, now: Duration) -> Action<'d> {
        match self.step {
            Step::CheckState => self.reset(now),
            Step::BootUp => self.read_device_type(),
            // What was written may be gone: so do we, from the beginning.
            Step::ErrorControl => self.again(),
            Step::DeviceType | Step::Start => Action::Wait,
            _ => {
                self.again = true;
                Action::Wait
            }
        }
    }

    pub(crate) fn on_timeout(&mut self, now: Duration) -> Action<'d> {
        if !is_due(self.deadline, now) {
            return Action::Wait;
        }
        self.deadline = None;
        match (self.step, self.config.error_control) {
            // Whether it is there at all, the device type tells.
            (Step::BootUp, _) => self.read_device_type(),
            (Step::CheckState, ErrorControl::Heartbeat { consumer_ms, .. }) => {
                fail(Failure::NoHeartbeat(consumer_ms))
            }
            (Step::CheckState, ErrorControl::None) => fail(Failure::NoGuarding(self.config.answer)),
            (Step::CheckState | Step::ErrorControl, ErrorControl::Guarding(config)) => {
                fail(Failure::NoGuarding(config.life_time()))
            }
            (Step::ErrorControl, ErrorControl::Heartbeat { consumer_ms, .. }) => {
                fail(Failure::NoHeartbeatAtStart(consumer_ms))
            }
            _ => Action::Wait,
        }
    }

    /// A read or write that an action asked for has ended.
    pub(crate) fn on_sdo(&mut self, now: Duration, outcome: Outcome, read: &Head) -> Action<'d> {
        if core::mem::take(&mut self.again) {
            return self.again();
        }
        let done = matches!(outcome, Outcome::Done(_));
        let found = read.number();
        match self.step {
            Step::DeviceType if !done => fail(Failure::NoDeviceType(outcome)),
            Step::DeviceType => {
                self.booted.device_type = found;
                match self.config.device_type {
                    Some(expected) if expected != found => fail(Failure::DeviceType { expected, found }),
                    _ => self.next_identity(now, Some(Part::Vendor)),
                }
            }
            Step::Identity(part) => match self.expected(part) {
                Some(expected) if !done => fail(Failure::NoIdentity { part, expected, outcome }),
                Some(expected) if expected != found => fail(Failure::Identity { part, expected, found }),
                _ => self.next_identity(now, following(part)),
            },
            Step::Date => match self.config.configured {
                Some((date, _)) if done && date == found => {
                    self.step = Step::Time;
                    Action::Read(Address::new(0x1020, 2))
                }
                _ => self.configure(now),
            },
            Step::Time => match self.config.configured {
                Some((_, time)) if done && time == found => self.error_control(now),
                _ => self.configure(now),
            },
            Step::Dcf(at) if !done => {
                fail(Failure::Configuration { entry: self.booted.written + 1, at, outcome })
            }
            Step::Dcf(_) => {
                self.booted.written += 1;
                self.configure(now)
            }
            Step::HeartbeatTime if !done => {
                fail(Failure::Configuration { entry: 0, at: HEARTBEAT_TIME, outcome })
            }
            Step::HeartbeatTime => self.watch(now),
            Step::CheckState | Step::BootUp | Step::ErrorControl | Step::Start => Action::Wait,
        }
    }

    /// The action has been carried out and brings nothing by itself.
    pub(crate) fn on_done(&mut self) -> Action<'d> {
        match self.step {
            Step::Start => Action::End(Ok(self.booted)),
            _ => Action::Wait,
        }
    }

    #[inline(never)]
    fn reset(&mut self, now: Duration) -> Action<'d> {
        self.step = Step::BootUp;
        self.deadline = Some(after(now, self.config.boot_up));
        Action::Nmt(Command::ResetCommunication)
    }

    fn again(&mut self) -> Action<'d> {
        self.dcf = self.config.dcf;
        self.booted.written = 0;
        self.booted.taken_over = false;
        self.read_device_type()
    }

    fn read_device_type(&mut self) -> Action<'d> {
        self.deadline = None;
        self.step = Step::DeviceType;
        Action::Read(DEVICE_TYPE)
    }

    fn expected(&self, part: Part) -> Option<u32> {
        self.config.identity.get(part as usize).copied().flatten()
    }

    fn next_identity(&mut self, now: Duration, mut part: Option<Part>) -> Action<'d> {
        while let Some(candidate) = part {
            if self.expected(candidate).is_some() {
                self.step = Step::Identity(candidate);
                return Action::Read(Address::new(IDENTITY, candidate as u8 + 1));
            }
            part = following(candidate);
        }
        if self.booted.taken_over {
            return self.error_control(now);
        }
        if self.config.configured.is_some() {
            self.step = Step::Date;
            return Action::Read(Address::new(0x1020, 1));
        }
        self.configure(now)
    }

    fn configure(&mut self, now: Duration) -> Action<'d> {
        match self.dcf.next() {
            Some((at, data)) => {
                self.step = Step::Dcf(at);
                Action::WriteDcf(at, data)
            }
            None => self.error_control(now),
        }
    }

    fn error_control(&mut self, now: Duration) -> Action<'d> {
        match self.config.error_control {
            ErrorControl::Heartbeat { producer_ms, .. } if producer_ms != 0 => {
                self.step = Step::HeartbeatTime;
                Action::Write(HEARTBEAT_TIME, Head::new(&producer_ms.to_le_bytes()))
            }
            _ => self.watch(now),
        }
    }

    fn watch(&mut self, now: Duration) -> Action<'d> {
        self.step = Step::ErrorControl;
        match self.config.error_control {
            ErrorControl::None => self.start(),
            ErrorControl::Heartbeat { consumer_ms, .. } => {
                self.deadline = Some(after_ms(now, consumer_ms.into()));
                Action::WatchHeartbeat(consumer_ms)
            }
            ErrorControl::Guarding(config) => {
                self.deadline = Some(after_ms(now, config.life_time_ms()));
                Action::Guard(config)
            }
        }
    }

    #[inline(never)]
    fn start(&mut self) -> Action<'d> {
        self.deadline = None;
        self.step = Step::Start;
        if self.config.start && !self.booted.taken_over {
            Action::Nmt(Command::Start)
        } else {
            Action::End(Ok(self.booted))
        }
    }
}

const fn fail<'d>(failure: Failure) -> Action<'d> {
    Action::End(Err(failure))
}

const fn following(part: Part) -> Option<Part> {
    match part {
        Part::Serial => None,
        part => Some(part.next()),
    }
}

const fn millis(ms: u16) -> Duration {
    Duration::from_millis(ms as u64)
}
