//! `CONFIG.toml` of `motionctl run`.

use core::time::Duration;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use motion_core::Model;
use motion_core::parameters::Values;
use motion_io::endpoint::{CanEndpoint, Endpoint};
use serde::Deserialize;

use super::step::Step;
use crate::cli::above_zero;
use crate::exit::Exit;
use crate::params::entry;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Config {
    #[serde(default)]
    pub(super) controller: ControllerSection,
    #[serde(default)]
    pub(super) serial: Vec<Serial>,
    pub(super) can1: Option<Can>,
    pub(super) can2: Option<Can>,
    pub(super) extension: Option<Extension>,
    #[serde(default)]
    parameters: BTreeMap<String, Setting>,
    #[serde(default)]
    pub(super) simulate: Vec<Simulated>,
    #[serde(default)]
    pub(super) program: Vec<Step>,
}

/// A parameter's value: in display units, as LB2 has it without the decimal point, or as people write it.
#[derive(Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "a whole number without a decimal point, or a text such as 654 = \"0.5\", expected"
)]
enum Setting {
    Number(i32),
    Text(String),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ControllerSection {
    #[serde(default = "model")]
    model: u16,
    pub(super) device_number: Option<u8>,
    /// Directory for flash and retained values.
    pub(super) state: Option<PathBuf>,
}

impl Default for ControllerSection {
    fn default() -> Self {
        Self { model: model(), device_number: None, state: None }
    }
}

const fn model() -> u16 {
    8230
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub(super) enum ComPort {
    #[serde(rename = "COM 1")]
    Com1,
    #[serde(rename = "COM 2")]
    Com2,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub(super) enum Protocol {
    #[serde(rename = "lb2")]
    Lb2,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Serial {
    pub(super) port: ComPort,
    endpoint: String,
    #[serde(rename = "protocol")]
    _protocol: Protocol,
}

impl Serial {
    pub(super) fn endpoint(&self) -> Result<Endpoint, Exit> {
        self.endpoint.parse().map_err(|error| Exit::usage(format!("endpoint {:?}: {error}", self.endpoint)))
    }
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Can {
    endpoint: String,
    bitrate: Option<u32>,
}

/// Bits per second of virtual buses.
const VIRTUAL_BIT_RATE: u32 = 500_000;

impl Can {
    /// Where the bus is, with its bit rate where the endpoint sets one.
    pub(super) fn endpoint(&self) -> Result<CanEndpoint, Exit> {
        let mut endpoint = self
            .endpoint
            .parse()
            .map_err(|error| Exit::usage(format!("endpoint {:?}: {error}", self.endpoint)))?;
        match (&mut endpoint, self.bitrate) {
            (CanEndpoint::Slcan { bit_rate, .. }, Some(rate)) => *bit_rate = rate,
            (CanEndpoint::Virtual { .. }, Some(rate)) if rate != VIRTUAL_BIT_RATE => {
                return Err(Exit::usage(format!(
                    "{endpoint}: bitrate {rate}, virtual buses have {VIRTUAL_BIT_RATE}"
                )));
            }
            _ => {}
        }
        Ok(endpoint)
    }
}

/// What is in the extension slot (6.9).
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub(super) enum Extension {
    /// Modbus TCP: the process image as registers.
    ModbusTcp {
        /// HOST:PORT.
        listen: String,
        /// Unit number; 0 answers all.
        #[serde(default)]
        unit: u8,
        /// Seconds without a request after which axes are halted.
        #[serde(default = "watchdog")]
        watchdog: f64,
    },
}

const fn watchdog() -> f64 {
    1.0
}

impl Extension {
    pub(super) fn open(&self) -> Result<super::modbus::Server, Exit> {
        let Self::ModbusTcp { listen, unit, watchdog } = self;
        let watchdog = Duration::from_secs_f64(*watchdog);
        super::modbus::Server::listen(listen, *unit, watchdog)
    }

    fn check(&self) -> Result<(), Exit> {
        let Self::ModbusTcp { watchdog, .. } = self;
        if above_zero(*watchdog).is_some() {
            return Ok(());
        }
        Err(Exit::usage(format!("[extension] watchdog = {watchdog}: a time above 0 expected")))
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum BusName {
    Can1,
    Can2,
}

impl BusName {
    /// Place among the buses of a controller, 0 or 1.
    pub(super) const fn at(self) -> usize {
        self as usize
    }
}

#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub(super) enum Simulated {
    /// A servo drive LD 2000 on a virtual bus.
    Drive { bus: BusName, node: u8 },
    /// A remote I/O node on a virtual bus.
    Io { bus: BusName, node: u8 },
    /// A machine axis on the terminals.
    Plant(PlantSection),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum DriveKind {
    FirstOrder,
    SecondOrder,
    Servo,
    Hydraulic,
    Stepper,
    TwoSpeed,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlantSection {
    /// Blocks Qx and Ex, 1…3.
    pub(super) block: usize,
    pub(super) drive: DriveKind,
    /// Units per second at full demand; fast jog of two-speed drives.
    pub(super) speed: f64,
    /// Slow jog of two-speed drives.
    #[serde(default)]
    pub(super) slow: f64,
    /// Time constant, s.
    #[serde(default = "tau")]
    pub(super) tau: f64,
    /// Units a step, of stepper motors.
    #[serde(default = "one")]
    pub(super) step: f64,
    /// Encoder edges a unit.
    #[serde(default = "one")]
    pub(super) edges: f64,
    /// Edge of the reference mark, and edges from one to the next.
    #[serde(default)]
    pub(super) mark: i64,
    #[serde(default)]
    pub(super) every: u32,
    #[serde(default)]
    pub(super) limits: Vec<LimitSection>,
}

const fn tau() -> f64 {
    0.01
}

const fn one() -> f64 {
    1.0
}

impl PlantSection {
    /// What the simulation can compute.
    fn check(&self) -> Result<(), Exit> {
        if !(1..=3).contains(&self.block) {
            return Err(Exit::usage(format!("plant: block {}, 1 to 3 expected", self.block)));
        }
        let wrong = |name: &str, value: f64, expected: &str| {
            Err(Exit::usage(format!("plant on block {}: {name} {value}, {expected} expected", self.block)))
        };
        let two_speed = self.drive == DriveKind::TwoSpeed;
        let ranges = [
            ("speed", self.speed, 1e-3, 1e9),
            ("slow", if two_speed { self.slow } else { 1.0 }, 1e-3, 1e9),
            ("tau", self.tau, 1e-4, 1e3),
            ("step", self.step, 1e-6, 1e6),
            ("edges", self.edges, 1e-6, 1e4),
        ];
        for (name, value, least, most) in ranges {
            if !(least..=most).contains(&value) {
                return wrong(name, value, &format!("{least:e} to {most:e}"));
            }
        }
        if self.mark.abs_diff(0) > 1 << 53 {
            return wrong("mark", self.mark as f64, "an edge within ±2^53");
        }
        match self.limits.iter().find(|limit| !limit.position.is_finite()) {
            Some(limit) => wrong("limit at position", limit.position, "a number"),
            None => Ok(()),
        }
    }
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LimitSection {
    /// As "I2.3".
    pub(super) input: String,
    pub(super) position: f64,
    pub(super) upper: bool,
    /// Low while operated.
    #[serde(default)]
    pub(super) opener: bool,
}

impl Config {
    /// A controller without program and simulated devices: `sim controller` with CAN buses. Parameters
    /// are `KEY=VALUE`.
    pub(super) fn of_controller(
        model: u16,
        device_number: Option<u8>,
        serial: Option<&str>,
        can: [Option<&str>; 2],
        parameters: &[String],
    ) -> Result<Self, Exit> {
        let [can1, can2] =
            can.map(|can| can.map(|endpoint| Can { endpoint: endpoint.into(), bitrate: None }));
        let serial = serial.map(|endpoint| Serial {
            port: ComPort::Com2,
            endpoint: endpoint.into(),
            _protocol: Protocol::Lb2,
        });
        let pair = |pair: &String| match pair.split_once('=') {
            Some((key, value)) => Ok((key.into(), Setting::Text(value.into()))),
            None => Err(Exit::usage(format!("--set {pair}: KEY=VALUE expected"))),
        };
        let config = Self {
            controller: ControllerSection { model, device_number, state: None },
            serial: serial.into_iter().collect(),
            can1,
            can2,
            parameters: parameters.iter().map(pair).collect::<Result<_, _>>()?,
            extension: None,
            simulate: Vec::new(),
            program: Vec::new(),
        };
        config.check()?;
        Ok(config)
    }

    pub(super) fn read(path: &Path) -> Result<Self, Exit> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|error| Exit::file(&name, &error))?;
        let config: Self =
            toml_edit::de::from_str(&text).map_err(|error| Exit::usage(format!("{name}: {error}")))?;
        config.check().map_err(|exit| exit.context(&name))?;
        Ok(config)
    }

    pub(super) fn model(&self) -> Result<Model, Exit> {
        let number = self.controller.model;
        Model::from_number(number)
            .ok_or_else(|| Exit::usage(format!("model {number}: 8230, 8231, 8235 or 8236 expected")))
    }

    fn check(&self) -> Result<(), Exit> {
        self.model()?;
        for step in &self.program {
            step.check()?;
            if let Some(bus) = step.bus.filter(|bus| self.can(*bus).is_none()) {
                return Err(Exit::usage(format!("{}: {bus:?} is not connected", step.words())));
            }
        }
        self.parameters()?;
        self.extension.as_ref().map_or(Ok(()), Extension::check)?;
        self.check_wires()?;
        for device in &self.simulate {
            if let Simulated::Drive { node, .. } | Simulated::Io { node, .. } = device
                && !(1..=127).contains(node)
            {
                return Err(Exit::usage(format!("a simulated device has node {node}, 1 to 127 expected")));
            }
            match device {
                Simulated::Plant(plant) => plant.check()?,
                Simulated::Drive { bus, .. } | Simulated::Io { bus, .. } if self.can(*bus).is_none() => {
                    return Err(Exit::usage(format!(
                        "a simulated device is on {bus:?}, which is not connected"
                    )));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Nothing is on a place where something else is.
    fn check_wires(&self) -> Result<(), Exit> {
        let mut places = Vec::new();
        for serial in &self.serial {
            places.push(format!("[[serial]] port {:?}", serial.port));
            places.push(format!("endpoint {:?}", serial.endpoint()?.to_string()));
        }
        for can in [&self.can1, &self.can2].into_iter().flatten() {
            // An adapter serves one bus; networks may be on one wire.
            if let CanEndpoint::Slcan { .. } | CanEndpoint::SlcanPty { .. } = can.endpoint()? {
                places.push(format!("endpoint {:?}", can.endpoint));
            }
        }
        places.extend(self.simulate.iter().map(|device| match device {
            Simulated::Drive { bus, node } | Simulated::Io { bus, node } => {
                format!("[[simulate]] node {node} on {bus:?}")
            }
            Simulated::Plant(plant) => format!("[[simulate]] plant on block {}", plant.block),
        }));
        match places.iter().enumerate().find(|(at, one)| places.iter().take(*at).any(|other| other == *one)) {
            Some((_, place)) => Err(Exit::usage(format!("{place} is there twice"))),
            None => Ok(()),
        }
    }

    pub(super) const fn can(&self, bus: BusName) -> Option<&Can> {
        match bus {
            BusName::Can1 => self.can1.as_ref(),
            BusName::Can2 => self.can2.as_ref(),
        }
    }

    /// Parameters to set, in display units.
    pub(super) fn parameters(&self) -> Result<Vec<(u16, i32)>, Exit> {
        let mut list = Vec::new();
        if let Some(number) = self.controller.device_number {
            list.push((5, i32::from(number)));
        }
        for (key, value) in &self.parameters {
            let entry = entry(key)?;
            let value = match value {
                Setting::Number(number) => *number,
                Setting::Text(text) => {
                    let wrong = |error: &dyn core::fmt::Display| Exit::usage(format!("{text:?}: {error}"));
                    entry.parse(text, &Values::factory()).map_err(|error| wrong(&error))?
                }
            };
            if list.iter().any(|(index, _)| *index == entry.index()) {
                return Err(Exit::usage(format!("{key}: {entry} is set twice")));
            }
            list.push((entry.index(), value));
        }
        Ok(list)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Config, String> {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("run.toml");
        std::fs::write(&path, text).unwrap();
        Config::read(&path).map_err(|exit| exit.message)
    }

    #[test]
    fn the_example_of_the_contract_is_read() {
        let config = read(
            "[controller]\nmodel = 8230\ndevice_number = 0\nstate = \"state-dir\"\n\
             [[serial]]\nport = \"COM 2\"\nendpoint = \"pty:line\"\nprotocol = \"lb2\"\n\
             [can1]\nendpoint = \"virtual:a\"\nbitrate = 500000\n\
             [can2]\nendpoint = \"slcan:/dev/ttyACM0\"\n\
             [parameters]\n642 = 3276800\n\"t max. acceleration@1\" = \"0.5\"\n\
             [[simulate]]\nkind = \"drive\"\nbus = \"can2\"\nnode = 1\n\
             [[program]]\nat = 1.0\ndo = \"move-absolute\"\naxis = 1\nposition = 1000000\nvelocity = 3276800\n",
        )
        .unwrap();
        assert_eq!(config.model().unwrap(), Model::Gel8230);
        assert_eq!(config.parameters().unwrap(), [(5, 0), (642, 3_276_800), (654, 500)]);
        assert_eq!(config.serial[0].port, ComPort::Com2);
        assert_eq!(config.program[0].position, Some(1_000_000));
        assert!(matches!(config.simulate[0], Simulated::Drive { bus: BusName::Can2, node: 1 }));
    }

    #[test]
    fn mistakes_are_named() {
        let error = |text: &str| read(text).unwrap_err();
        assert!(error("[controller]\nmodel = 8232\n").contains("8230, 8231, 8235 or 8236"));
        assert!(error("[controler]\n").contains("controler"));
        assert!(
            error("[[program]]\nat = 1\ndo = \"move-absolute\"\naxis = 1\n").contains("position is missing")
        );
        assert!(error("[[program]]\nat = 1\ndo = \"home\"\naxis = 7\n").contains("1 to 6"));
        let can = |step: &str| {
            error(&format!("[can1]\nendpoint = \"virtual:x\"\n[[program]]\nat = 1\nbus = \"can1\"\n{step}\n"))
        };
        assert!(can("do = \"write\"\ndata = \"01\"").contains("object is missing"));
        assert!(can("do = \"write\"\nobject = 5\ndata = \"01\"").contains("object 5, 1 to 4 expected"));
        assert!(can("do = \"send\"\nchannel = 15\ndata = \"01\"").contains("15"));
        assert!(can("do = \"send\"\nchannel = 1\ndata = \"0\"").contains("pairs of hex digits"));
        assert!(can("do = \"home\"").contains("axis is missing"));
        assert!(
            error("[[program]]\nat = 1\ndo = \"scan\"\nbus = \"can1\"\n").contains("Can1 is not connected")
        );
        assert!(
            error("[[simulate]]\nkind = \"drive\"\nbus = \"can1\"\nnode = 1\n").contains("not connected")
        );
        assert!(error("[parameters]\n50 = 1\n").contains("[050]"));
    }
}
