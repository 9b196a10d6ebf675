//! Plants on the terminals of a controller.

use motion_core::io::{Inputs, Outputs};

use super::{Demand, Plant, Sensor, Switch};

/// How a plant's drive is connected; the number is that of the block Q1…Q3, by place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Connection {
    /// Terminals A+ and A- of Qx, ±10 V; `unipolar`: 0…10 V with backward on Qx.1.
    Analog {
        /// Block.
        block: usize,
        /// Whether the sign comes as signal Qx.1.
        unipolar: bool,
    },
    /// Clock on C of Ex, backward on Qx.1.
    Clock {
        /// Block.
        block: usize,
    },
    /// Forward Qx.2, backward Qx.1, slow Qx.3, fast Qx.4.
    Signals {
        /// Block.
        block: usize,
    },
}

/// Output that opens a brake.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BrakeOutput {
    /// Block Q1…Q3, by place.
    pub block: usize,
    /// Terminal, 0…4.
    pub terminal: u8,
}

/// A plant with its wires.
#[derive(Debug, Clone)]
pub struct Wiring {
    /// The axis.
    pub plant: Plant,
    /// Its drive.
    pub connection: Connection,
    /// The encoder and the block E1…E3 it is on, by place.
    pub sensor: Option<(usize, Sensor)>,
    /// Switches along the axis.
    pub switches: Vec<Switch>,
    /// The output that opens the brake; without one it stays open.
    pub brake: Option<BrakeOutput>,
}

impl Wiring {
    /// A plant whose drive and encoder are on blocks Qx and Ex of one number.
    #[must_use]
    pub fn new(plant: Plant, connection: Connection, sensor: Sensor) -> Self {
        let (Connection::Analog { block, .. } | Connection::Clock { block } | Connection::Signals { block }) =
            connection;
        Self { plant, connection, sensor: Some((block, sensor)), switches: Vec::new(), brake: None }
    }

    /// With one more switch.
    #[must_use]
    pub fn with_switch(mut self, switch: Switch) -> Self {
        self.switches.push(switch);
        self
    }

    fn demand(&self, outputs: &Outputs) -> Demand {
        let bits = |block: usize| outputs.digital.get(block).copied().unwrap_or(0);
        match self.connection {
            Connection::Analog { block, unipolar } => {
                let volts = f64::from(outputs.analog.get(block).copied().unwrap_or(0));
                let sign = if unipolar && bits(block) & 0b10 != 0 { -1.0 } else { 1.0 };
                Demand::Speed(sign * volts / 10_000.0)
            }
            Connection::Clock { block } => Demand::Clock {
                frequency: f64::from(outputs.pwm.get(block).map_or(0, |pwm| pwm.frequency())) / 1000.0,
                backward: bits(block) & 0b10 != 0,
            },
            Connection::Signals { block } => Demand::Signals {
                forward: bits(block) & 1 << 2 != 0,
                backward: bits(block) & 1 << 1 != 0,
                slow: bits(block) & 1 << 3 != 0,
                fast: bits(block) & 1 << 4 != 0,
            },
        }
    }
}

/// Plants on one controller.
#[derive(Debug, Clone, Default)]
pub struct Machine {
    /// The axes of the machine.
    pub axes: Vec<Wiring>,
    /// What else is on the terminals: operators' switches, analog values.
    pub inputs: Inputs,
}

impl Machine {
    /// Lets `milliseconds` pass with these outputs, and reads the terminals.
    pub fn run(&mut self, milliseconds: u32, outputs: &Outputs) -> Inputs {
        let mut inputs = self.inputs;
        for axis in &mut self.axes {
            let demand = axis.demand(outputs);
            let open = axis.brake.is_none_or(|brake| {
                outputs.digital.get(brake.block).is_some_and(|bits| bits >> brake.terminal & 1 != 0)
            });
            axis.plant.run(milliseconds, demand, open);
            let position = axis.plant.position();
            if let Some((block, sensor)) = &mut axis.sensor
                && let Some(encoder) = inputs.encoders.get_mut(*block)
            {
                *encoder = sensor.read(position);
            }
            axis.switches.iter().for_each(|switch| switch.read(position, &mut inputs.digital));
        }
        inputs
    }
}
