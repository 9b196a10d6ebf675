//! Steps of the program of a configuration.

use core::time::Duration;

use can_link::{Channel, Trigger};
use motion_core::AXES;
use motion_core::bus::OBJECTS;
use serde::Deserialize;

use super::config::BusName;
use crate::can::value::bytes;
use crate::cli::above_zero;
use crate::exit::Exit;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Action {
    Power,
    Home,
    MoveAbsolute,
    MoveRelative,
    MoveVelocity,
    Jog,
    Stop,
    Halt,
    Reset,
    SetPosition,
    GearIn,
    GearOut,
    /// Process data of an object OUT.
    Write,
    /// A channel of CAN Link.
    Send,
    /// A CAN bus, as by hand (4.3.4.4).
    Scan,
}

impl Action {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Power => "power",
            Self::Home => "home",
            Self::MoveAbsolute => "move-absolute",
            Self::MoveRelative => "move-relative",
            Self::MoveVelocity => "move-velocity",
            Self::Jog => "jog",
            Self::Stop => "stop",
            Self::Halt => "halt",
            Self::Reset => "reset",
            Self::SetPosition => "set-position",
            Self::GearIn => "gear-in",
            Self::GearOut => "gear-out",
            Self::Write => "write",
            Self::Send => "send",
            Self::Scan => "scan",
        }
    }
}

/// One step of the program.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Step {
    /// Seconds since the start.
    pub(super) at: f64,
    #[serde(rename = "do")]
    pub(super) action: Action,
    pub(super) axis: Option<u8>,
    /// Of write, send, scan.
    pub(super) bus: Option<BusName>,
    /// Of write: OUT 1…4.
    pub(super) object: Option<u8>,
    /// Of send: 1…14.
    pub(super) channel: Option<u8>,
    /// Of write and send: up to 8 bytes in hex.
    pub(super) data: Option<String>,
    /// Of write and send: seconds between two frames.
    pub(super) period: Option<f64>,
    pub(super) position: Option<i32>,
    pub(super) distance: Option<i32>,
    pub(super) velocity: Option<i32>,
    /// Of gear-in: actual value input 1…6, and the ratio of the axis' way to its own.
    pub(super) input: Option<u8>,
    pub(super) numerator: Option<i32>,
    #[serde(default = "one")]
    pub(super) denominator: u32,
    /// Of jog: direction and speed.
    #[serde(default = "yes")]
    pub(super) forward: bool,
    #[serde(default)]
    pub(super) fast: bool,
    /// Of power: on or off.
    #[serde(default = "yes")]
    pub(super) on: bool,
    /// Seconds that jog, stop, a velocity or gearing is held.
    #[serde(rename = "for")]
    pub(super) duration: Option<f64>,
}

const fn one() -> u32 {
    1
}

const fn yes() -> bool {
    true
}

impl Step {
    /// What and when, for messages.
    pub(super) fn words(&self) -> String {
        format!("{} at {} s", self.action.name(), self.at)
    }

    fn wrong(&self, what: impl core::fmt::Display) -> Exit {
        Exit::usage(format!("{}: {what}", self.words()))
    }

    fn need<T>(&self, value: Option<T>, field: &str) -> Result<T, Exit> {
        value.ok_or_else(|| self.wrong(format!("{field} is missing")))
    }

    pub(super) fn check(&self) -> Result<(), Exit> {
        if Duration::try_from_secs_f64(self.at).is_err() {
            return Err(self.wrong("at: a time from 0 on expected"));
        }
        if let Some(time) = self.duration.filter(|time| above_zero(*time).is_none()) {
            return Err(self.wrong(format!("for {time}, a time above 0 expected")));
        }
        let to_a_position = matches!(self.action, Action::MoveAbsolute | Action::MoveRelative);
        if let Some(velocity) = self.velocity.filter(|velocity| to_a_position && *velocity <= 0) {
            return Err(self.wrong(format!("velocity {velocity}, above 0 expected")));
        }
        match self.action {
            Action::Write => {
                let object = self.need(self.object, "object")?;
                if !(1..=OBJECTS).contains(&usize::from(object)) {
                    return Err(self.wrong(format!("object {object}, 1 to {OBJECTS} expected")));
                }
                self.payload()?;
                self.period()?;
            }
            Action::Send => {
                self.channel()?;
                self.payload()?;
                self.trigger()?;
            }
            Action::Scan => {}
            _ => {
                let axis = self.need(self.axis, "axis")?;
                if !(1..=AXES).contains(&axis) {
                    return Err(self.wrong(format!("axis {axis}, 1 to {AXES} expected")));
                }
            }
        }
        match self.action {
            Action::Write | Action::Send | Action::Scan => self.need(self.bus, "bus").map(drop),
            Action::MoveAbsolute | Action::SetPosition => self.need(self.position, "position").map(drop),
            Action::MoveRelative => self.need(self.distance, "distance").map(drop),
            Action::MoveVelocity => self.need(self.velocity, "velocity").map(drop),
            Action::Jog => self.need(self.duration, "for").map(drop),
            Action::GearIn => {
                let input = self.need(self.input, "input")?;
                if !(1..=6).contains(&input) {
                    return Err(self.wrong(format!("input {input}, 1 to 6 expected")));
                }
                if self.need(self.numerator, "numerator")? == 0 || self.denominator == 0 {
                    return Err(self.wrong("numerator and denominator other than 0 expected"));
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// The bytes of write and send.
    pub(super) fn payload(&self) -> Result<Vec<u8>, Exit> {
        let text = self.need(self.data.as_deref(), "data")?;
        let data = bytes(text).filter(|data| data.len() <= 8);
        data.ok_or_else(|| self.wrong(format!("data {text:?}: up to 8 pairs of hex digits expected")))
    }

    /// The channel of send.
    pub(super) fn channel(&self) -> Result<Channel, Exit> {
        Channel::new(self.need(self.channel, "channel")?).map_err(|error| self.wrong(error))
    }

    /// How often write and send send.
    pub(super) fn period(&self) -> Result<Option<Duration>, Exit> {
        let Some(seconds) = self.period else { return Ok(None) };
        above_zero(seconds)
            .map(Some)
            .ok_or_else(|| self.wrong(format!("period {seconds}, a time above 0 expected")))
    }

    /// When a channel is sent.
    pub(super) fn trigger(&self) -> Result<Trigger, Exit> {
        Ok(self.period()?.map_or(Trigger::Change, Trigger::Period))
    }

    pub(super) fn begin(&self) -> Duration {
        Duration::from_secs_f64(self.at)
    }

    /// When what is held ends.
    pub(super) fn end(&self) -> Option<Duration> {
        self.duration.map(|duration| self.begin().saturating_add(Duration::from_secs_f64(duration)))
    }
}
