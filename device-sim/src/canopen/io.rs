//! A DS401 I/O node: 8 digital inputs and outputs, 4 analogue inputs and outputs.

use core::time::Duration;

use canopen_master::data_type::DataType;
use canopen_master::ds401::{
    ANALOGUE_DELTA, ANALOGUE_INPUTS, ANALOGUE_INTERRUPT_ENABLE, ANALOGUE_OUTPUTS, AnalogueDelta,
    DIGITAL_INPUTS, DIGITAL_OUTPUTS, Functions, INPUT_POLARITY, OUTPUT_ERROR_MODE, OUTPUT_ERROR_VALUE,
    OUTPUT_POLARITY, OutputGroup,
};
use canopen_master::lss::Identity;
use canopen_master::nmt::State;
use pdo::mapping::Entry as Mapped;
use pdo::{Address, NodeId};

use super::common::{OFF, objects, slot, unsigned8, unsigned32};
use super::objects::Entry;
use super::{Context, Device, Node, Pdos, Rights, Settings};

/// Analogue channels in each direction.
const ANALOGUE: u8 = 4;

/// Virtual terminals. Inputs are set with [`set_inputs`](Self::set_inputs) and
/// [`set_analogue`](Self::set_analogue), or follow the outputs if they are wired together.
#[derive(Debug, Clone, Default)]
pub struct RemoteIo {
    inputs: u8,
    analogue: [i16; ANALOGUE as usize],
    wired: bool,
    deltas: [AnalogueDelta; ANALOGUE as usize],
    failed: bool,
    outputs: u8,
}

impl RemoteIo {
    /// A node with these terminals. `wired`: every input is connected to the output of its number.
    #[must_use]
    pub fn node(node: Option<NodeId>, serial: u32, wired: bool) -> Node<Self> {
        // Vendor 0 is nobody's.
        let identity = Identity { vendor: 0, product: 0x0191, revision: 1, serial };
        let functions = Functions {
            digital_inputs: true,
            digital_outputs: true,
            analogue_inputs: true,
            analogue_outputs: true,
        };
        let mut objects = objects(functions.device_type(), "Virtual I/O", identity);
        objects.insert_all(DIGITAL_INPUTS, [unsigned8(Rights::Ro, 0).mappable()]);
        objects.insert_all(INPUT_POLARITY, [unsigned8(Rights::Rw, 0)]);
        objects.insert_all(DIGITAL_OUTPUTS, [unsigned8(Rights::Rw, 0).mappable()]);
        objects.insert_all(OUTPUT_POLARITY, [unsigned8(Rights::Rw, 0)]);
        objects.insert_all(OUTPUT_ERROR_MODE, [unsigned8(Rights::Rw, 0xFF)]);
        objects.insert_all(OUTPUT_ERROR_VALUE, [unsigned8(Rights::Rw, 0)]);
        let word =
            |rights| (0..ANALOGUE).map(move |_| Entry::number(DataType::INTEGER16, rights, 0).mappable());
        objects.insert_all(ANALOGUE_INPUTS, word(Rights::Ro));
        objects.insert_all(ANALOGUE_OUTPUTS, word(Rights::Rw));
        objects.insert(ANALOGUE_INTERRUPT_ENABLE, 0, Entry::number(DataType::BOOLEAN, Rights::Rw, 0));
        objects.insert_all(ANALOGUE_DELTA, (0..ANALOGUE).map(|_| unsigned32(Rights::Rw, 0)));
        let analogue = |index| slot(&[1, 2, 3, 4].map(|sub| Mapped::new(index, sub, 16)));
        let pdos = Pdos::new(
            [slot(&[Mapped::new(DIGITAL_OUTPUTS, 1, 8)]), analogue(ANALOGUE_OUTPUTS), OFF, OFF],
            [slot(&[Mapped::new(DIGITAL_INPUTS, 1, 8)]), analogue(ANALOGUE_INPUTS), OFF, OFF],
        );
        Node::new(Settings { node, identity }, Self { wired, ..Self::default() }, objects, pdos)
    }

    /// The digital inputs, bit 0 = input 1.
    pub const fn set_inputs(&mut self, inputs: u8) {
        self.inputs = inputs;
    }

    /// Analogue input `channel`, from 0.
    pub fn set_analogue(&mut self, channel: usize, value: i16) {
        if let Some(input) = self.analogue.get_mut(channel) {
            *input = value;
        }
    }

    /// What the digital output terminals show.
    #[must_use]
    pub const fn outputs(&self) -> u8 {
        self.outputs
    }
}

impl Device for RemoteIo {
    fn written(&mut self, context: &mut Context<'_>, _at: Address) {
        self.update(context);
    }

    fn update(&mut self, context: &mut Context<'_>) {
        let objects = &mut *context.objects;
        let group = OutputGroup {
            value: objects.get(DIGITAL_OUTPUTS, 1) as u8,
            polarity: objects.get(OUTPUT_POLARITY, 1) as u8,
            error_mode: objects.get(OUTPUT_ERROR_MODE, 1) as u8,
            error_value: objects.get(OUTPUT_ERROR_VALUE, 1) as u8,
        };
        self.outputs = group.terminals(self.failed);
        if self.wired {
            self.inputs = self.outputs;
            for (input, sub) in self.analogue.iter_mut().zip(1..) {
                *input = objects.get(ANALOGUE_OUTPUTS, sub) as i16;
            }
        }
        let inputs = self.inputs ^ objects.get(INPUT_POLARITY, 1) as u8;
        objects.set(DIGITAL_INPUTS, 1, i128::from(inputs));
        for (input, sub) in self.analogue.iter().zip(1..) {
            objects.set(ANALOGUE_INPUTS, sub, i128::from(*input));
        }
    }

    fn holds_back(&mut self, context: &mut Context<'_>, tpdo: usize) -> bool {
        if tpdo != 1 {
            return false;
        }
        // Silent until 6423h allows it; then every input that has moved by its delta.
        if context.objects.get(ANALOGUE_INTERRUPT_ENABLE, 0) == 0 {
            return true;
        }
        let mut due = false;
        for ((input, delta), sub) in self.analogue.iter().zip(&mut self.deltas).zip(1..) {
            due |= delta.is_due(*input, context.objects.get(ANALOGUE_DELTA, sub) as u32);
        }
        !due
    }

    fn poll_timeout(&self) -> Option<Duration> {
        None
    }

    fn state(&mut self, context: &mut Context<'_>, state: State) {
        match state {
            State::Stopped => self.failed = true,
            State::Operational | State::BootUp => self.failed = false,
            State::PreOperational => {}
        }
        self.update(context);
    }

    fn master(&mut self, context: &mut Context<'_>, lost: bool) {
        self.failed = lost;
        self.update(context);
    }
}
