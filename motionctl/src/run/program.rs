//! The program of a configuration: function blocks that begin at their time.

use core::time::Duration;

use motion_core::AXES;
use motion_core::application::blocks::{
    GearIn, GearOut, Halt, Home, Jog, MoveAbsolute, MoveRelative, MoveVelocity, Outputs, Power, Reset,
    SetPosition, Stop,
};
use motion_core::application::{Application, MotionError, Plc, State};
use pdo::Payload;

use super::config::BusName;
use super::remote::Remote;
use super::step::{Action, Step};
use crate::exit::Exit;

/// A step's function block: runs one cycle, with its inputs asked for or not.
type Block = Box<dyn FnMut(&mut Plc<'_>, bool) -> Outputs>;

/// How a step ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Outcome {
    Done,
    Aborted,
    Failed(MotionError),
    /// A scan while an axis moves (4.3.4.4).
    Refused,
}

impl Outcome {
    /// Whether the step did not do what it was for. One in whose place another came is none of these.
    pub(super) const fn is_failure(self) -> bool {
        matches!(self, Self::Failed(_) | Self::Refused)
    }
}

/// What a step acts on: an axis, 1…6, or a bus, 0 or 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Subject {
    Axis(u8),
    Bus(usize),
}

/// A step that has ended.
pub(super) type Ended = (Subject, Action, Outcome);

struct Running {
    begin: Duration,
    end: Option<Duration>,
    subject: Subject,
    action: Action,
    block: Block,
    over: bool,
}

/// The program, and what stops it.
#[derive(Default)]
pub(super) struct Program {
    steps: Vec<Running>,
    now: Duration,
    /// Every axis is brought to standstill and switched off.
    stopping: bool,
    stops: Vec<(Stop, Power)>,
    /// Axes by way of the extension module.
    remote: Option<Remote>,
    /// Steps that have ended.
    pub(super) ended: Vec<Ended>,
}

impl Program {
    pub(super) fn new(steps: &[Step]) -> Result<Self, Exit> {
        let running = |step: &Step| {
            Ok(Running {
                begin: step.begin(),
                end: step.end(),
                subject: match (step.axis, step.bus) {
                    (None, Some(bus)) => Subject::Bus(bus.at()),
                    (axis, _) => Subject::Axis(axis.unwrap_or(0)),
                },
                action: step.action,
                block: block(step)?,
                over: false,
            })
        };
        Ok(Self { steps: steps.iter().map(running).collect::<Result<_, Exit>>()?, ..Self::default() })
    }

    /// The scans whose time has come: they are the device's, not the application's.
    pub(super) fn take_scans(&mut self) -> impl Iterator<Item = usize> {
        let now = self.now;
        self.steps.iter_mut().filter_map(move |step| match step.subject {
            Subject::Bus(at) if step.action == Action::Scan && !step.over && now >= step.begin => {
                step.over = true;
                Some(at)
            }
            _ => None,
        })
    }

    /// With axes that the extension module's process image moves.
    pub(super) fn with_remote(mut self) -> Self {
        self.remote = Some(Remote::new());
        self
    }

    /// Lets the next cycle begin at `now`.
    pub(super) const fn advance(&mut self, now: Duration) {
        self.now = now;
    }

    /// Brings every axis to standstill with the greatest deceleration, then disables the drives
    /// (decision 28).
    pub(super) fn stop(&mut self) {
        if !core::mem::replace(&mut self.stopping, true) {
            self.stops = (1..=AXES).map(|axis| (Stop::new(axis), Power::new(axis))).collect();
        }
    }

    fn bring_to_standstill(&mut self, plc: &mut Plc<'_>) {
        for (stop, power) in &mut self.stops {
            let Ok(status) = plc.axis(stop.axis).map(|axis| *axis.status()) else { continue };
            stop.execute = true;
            let outputs = stop.call(plc);
            let stands = match status.state {
                State::Disabled | State::Standstill => true,
                // A failed axis stops by itself, with its drive enabled as long as it can be.
                State::ErrorStop => status.nominal_velocity == 0.0,
                _ => outputs.done,
            };
            if stands {
                power.enable = false;
                // An axis that is not activated has no drive to disable.
                let _ = power.call(plc);
            }
        }
    }
}

impl Application for Program {
    fn cycle(&mut self, plc: &mut Plc<'_>) {
        if self.stopping {
            return self.bring_to_standstill(plc);
        }
        if let Some(remote) = &mut self.remote {
            remote.cycle(plc);
        }
        for step in &mut self.steps {
            if step.over || self.now < step.begin || step.action == Action::Scan {
                continue;
            }
            let asked = step.end.is_none_or(|end| self.now < end);
            let outputs = (step.block)(plc, asked);
            let outcome = if outputs.error {
                Outcome::Failed(outputs.error_id)
            } else if outputs.command_aborted {
                Outcome::Aborted
            } else if (outputs.done || outputs.in_velocity) && (step.end.is_none() || !asked)
                || !asked && !outputs.busy
            {
                Outcome::Done
            } else {
                continue;
            };
            step.over = true;
            self.ended.push((step.subject, step.action, outcome));
        }
    }
}

macro_rules! executed {
    ($block:expr) => {{
        let mut block = $block;
        Box::new(move |plc: &mut Plc<'_>, asked: bool| {
            block.execute = asked;
            block.call(plc)
        })
    }};
}

/// A motion without an end of its own, which is halted when it is not asked for any more.
fn held(axis: u8, mut motion: Block) -> Block {
    let mut halt = Halt::new(axis);
    Box::new(move |plc, asked| {
        let outputs = motion(plc, asked);
        halt.execute |= !asked && outputs.busy;
        if halt.execute { halt.call(plc) } else { outputs }
    })
}

/// An action that is done as soon as it is begun.
fn at_once(mut action: impl FnMut(&mut Plc<'_>) + 'static) -> Block {
    Box::new(move |plc, _| {
        action(plc);
        Outputs { done: true, ..Outputs::default() }
    })
}

/// An action that is repeated as long as it is asked for.
fn every(period: Duration, mut action: impl FnMut(&mut Plc<'_>) + 'static) -> Block {
    let mut wait = Duration::ZERO;
    Box::new(move |plc, asked| {
        if asked && wait.is_zero() {
            action(plc);
            wait = period;
        }
        wait = wait.saturating_sub(Duration::from_millis(plc.cycle.into()));
        Outputs { busy: asked, ..Outputs::default() }
    })
}

fn block(step: &Step) -> Result<Block, Exit> {
    let axis = step.axis.unwrap_or(0);
    let at = step.bus.map_or(0, BusName::at);
    let speed = step.velocity.map(i32::unsigned_abs);
    let (position, distance) = (step.position.unwrap_or(0), step.distance.unwrap_or(0));
    Ok(match step.action {
        Action::Power => {
            let mut power = Power::new(axis);
            power.enable = step.on;
            Box::new(move |plc, _| match power.call(plc) {
                Ok(on) => {
                    Outputs { done: on == power.enable, busy: on != power.enable, ..Outputs::default() }
                }
                Err(error_id) => Outputs { error: true, error_id, ..Outputs::default() },
            })
        }
        Action::Home => executed!(Home::new(axis)),
        Action::MoveAbsolute => {
            let mut block = MoveAbsolute::new(axis);
            (block.position, block.velocity) = (position, speed);
            executed!(block)
        }
        Action::MoveRelative => {
            let mut block = MoveRelative::new(axis);
            (block.distance, block.velocity) = (distance, speed);
            executed!(block)
        }
        Action::MoveVelocity => {
            let mut block = MoveVelocity::new(axis);
            block.velocity = step.velocity.unwrap_or(0);
            held(axis, executed!(block))
        }
        Action::Jog => {
            let mut jog = Jog::new(axis);
            let forward = step.forward;
            jog.fast = step.fast;
            Box::new(move |plc, asked| {
                (jog.forward, jog.backward) = (asked && forward, asked && !forward);
                jog.call(plc)
            })
        }
        Action::GearIn => {
            let mut block = GearIn::new(axis);
            block.master = step.input.unwrap_or(0);
            (block.numerator, block.denominator) = (step.numerator.unwrap_or(0), step.denominator);
            held(axis, executed!(block))
        }
        Action::GearOut => executed!(GearOut::new(axis)),
        Action::Stop => executed!(Stop::new(axis)),
        Action::Halt => executed!(Halt::new(axis)),
        Action::Reset => executed!(Reset::new(axis)),
        Action::SetPosition => {
            let mut block = SetPosition::new(axis);
            block.position = position;
            executed!(block)
        }
        Action::Write => {
            let (object, data) =
                (usize::from(step.object.unwrap_or(0)), Payload::from_slice(&step.payload()?));
            let write = move |plc: &mut Plc<'_>| {
                plc.can[at].image().write(object, data);
            };
            match step.period()? {
                Some(period) => every(period, write),
                None => at_once(write),
            }
        }
        Action::Send => {
            let (channel, data) = (step.channel()?, step.payload()?);
            at_once(move |plc| {
                if let Some(link) = plc.can[at].link() {
                    // The channel has been set up to be sent on, and the length is that of a frame.
                    let _ = link.write(channel, &data);
                }
            })
        }
        Action::Scan => at_once(|_| ()),
    })
}
