//! Whole MotionControllers whose CAN 1 is one virtual bus, with LB2 to each, on virtual time.

use core::time::Duration;

use device_sim::can::{Bus, Faults, Network, Node};
use lb2::code::LoaderCode;
use lb2::device::DeviceEngine;
use lb2::master::{Config, Event, Master, Outcome};
use lb2::telegram::{Request, Response};
use motion_core::application::Plc;
use motion_core::io::{DigitalInputs, Inputs, Outputs};
use motion_core::{Controller, Model, STORAGE_LEN};
use pdo::Frame;

/// Terminals of block I3 that are high: PLC Run.
const PLC_RUN: u8 = 0x80;
/// Longest time between two bytes of an LB2 telegram.
const INTER_BYTE: Duration = Duration::from_millis(10);

type Virtual = Controller<Vec<u8>, Vec<u8>>;
type Program = Box<dyn FnMut(&mut Plc<'_>)>;

/// A controller, its terminals and its application.
pub struct Station {
    /// `None` while it is switched off, within [`restart`](Self::restart).
    controller: Option<Virtual>,
    program: Program,
    /// Begin of the next control cycle.
    due: Duration,
    inputs: Inputs,
    outputs: Outputs,
    sent: Vec<Frame>,
}

impl core::fmt::Debug for Station {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Station").field("outputs", &self.outputs).finish_non_exhaustive()
    }
}

fn power_on(storage: Vec<u8>) -> Virtual {
    Controller::power_on(Model::Gel8230, storage, vec![0; 65536])
}

impl Station {
    /// A GEL 8230 as delivered; its first control cycle begins after `phase`.
    pub fn new(phase: Duration, program: impl FnMut(&mut Plc<'_>) + 'static) -> Self {
        let mut station = Self {
            controller: Some(power_on(vec![0xFF; STORAGE_LEN])),
            program: Box::new(program),
            due: phase,
            inputs: Inputs::default(),
            outputs: Outputs::default(),
            sent: Vec::new(),
        };
        station.set_inputs([0, 0]);
        station
    }

    /// The controller.
    pub fn controller(&mut self) -> &mut Virtual {
        self.controller.as_mut().expect("switched on")
    }

    /// Signals on I1 and I2; PLC Run is high.
    pub fn set_inputs(&mut self, [i1, i2]: [u8; 2]) {
        self.inputs.digital = DigitalInputs::new([i1, i2, PLC_RUN, 0]);
    }

    /// Signals on Q1 and Q2.
    pub fn outputs(&self) -> [u8; 2] {
        [self.outputs.digital[0], self.outputs.digital[1]]
    }

    /// Switches the controller off and on again; only what is in its flash is left.
    pub fn restart(&mut self, program: impl FnMut(&mut Plc<'_>) + 'static) {
        self.controller = self.controller.take().map(|controller| power_on(controller.power_off()));
        self.program = Box::new(program);
    }

    /// Asks over LB2, telegram by telegram through both engines.
    fn ask<T>(&mut self, request: &Request<'_>, take: impl FnOnce(Response<'_>) -> T) -> T {
        let (mut master, mut device) = (Master::new(Config::default()), DeviceEngine::new(INTER_BYTE));
        let now = Duration::ZERO;
        let ticket = master.submit(request, 0).expect("a request");
        let bytes = master.poll_transmit(now).expect("a telegram").to_vec();
        master.handle_transmit_done(now);
        device.handle_bytes(now, &bytes, self.controller());
        let answer = device.poll_transmit(now).expect("an answer").to_vec();
        master.handle_bytes(now, &answer);
        loop {
            match master.poll_event() {
                Some(Event::Outcome { ticket: ended, outcome: Outcome::Done(response) }) => {
                    assert_eq!(ended, ticket);
                    return take(response);
                }
                Some(Event::Outcome { outcome, .. }) => panic!("{request:?}: {outcome:?}"),
                Some(_) => {}
                None => panic!("{request:?}: no outcome"),
            }
        }
    }

    /// 33h: what the device says of the value.
    pub fn write(&mut self, index: u16, value: i32) -> (LoaderCode, String) {
        self.ask(&Request::WriteParameterExtended { index, value }, |response| match response {
            Response::ParameterWrittenExtended { loader, text, .. } => (loader, text.to_string()),
            other => panic!("{other:?}"),
        })
    }

    /// 30h.
    pub fn read(&mut self, index: u16) -> i32 {
        self.ask(&Request::ReadParameter { index }, |response| match response {
            Response::Parameter { value, .. } => value,
            other => panic!("{other:?}"),
        })
    }

    /// 34h: the first parameter at fault.
    pub fn load(&mut self) -> Option<u16> {
        self.ask(&Request::CallLoader, |response| match response {
            Response::LoaderCalled { offset } => u16::try_from(offset).ok(),
            other => panic!("{other:?}"),
        })
    }

    /// 35h.
    pub fn save(&mut self) {
        self.ask(&Request::SaveParameters, |response| assert_eq!(response, Response::ParametersSaved));
    }

    /// Writes parameters, calls the loader and saves to flash; all of it must be taken.
    pub fn set_up(&mut self, parameters: &[(u16, i32)]) {
        for &(index, value) in parameters {
            let (code, text) = self.write(index, value);
            assert!(!code.is_error(), "[{index}] = {value}: {text}");
        }
        assert_eq!(self.load(), None);
        self.save();
    }
}

impl Node for Station {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        let bus = self.controller().bus(0).expect("CAN 1");
        bus.handle_frame(now, frame);
    }

    fn handle_timeout(&mut self, now: Duration) {
        let Self { controller, program, due, inputs, outputs, .. } = self;
        let controller = controller.as_mut().expect("switched on");
        controller.bus(0).expect("CAN 1").handle_timeout(now);
        if now >= *due {
            *outputs = controller.cycle(now, inputs, program);
            let cycle = controller.cycle_time();
            controller.advance(cycle).expect("memory that does not fail");
            *due = now + cycle;
        }
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        let frame = self.controller().bus(0).expect("CAN 1").poll_transmit(now);
        self.sent.extend(frame);
        frame
    }

    fn poll_timeout(&self) -> Option<Duration> {
        // The bus is served in every cycle, like the terminals.
        Some(self.due)
    }
}

/// Controllers on one bus.
#[derive(Debug)]
pub struct Rig {
    network: Network,
    /// The controllers, in the order of their stations on the bus.
    pub stations: Vec<Station>,
}

impl Rig {
    /// At 500 kbit/s.
    #[must_use]
    pub fn new(stations: Vec<Station>) -> Self {
        let bus = Bus::new(500_000, Faults::NONE);
        Self { network: Network::new(bus, stations.len()), stations }
    }

    /// Lets time pass, and gives what every station sent meanwhile.
    pub fn run(&mut self, time: Duration) -> Vec<Vec<Frame>> {
        let end = self.network.now() + time;
        let mut nodes: Vec<&mut dyn Node> = self.stations.iter_mut().map(|station| station as _).collect();
        while self.network.step(&mut nodes, end) {}
        self.stations.iter_mut().map(|station| core::mem::take(&mut station.sent)).collect()
    }

    /// Pulls a station's plug out.
    pub fn unplug(&mut self, station: usize) {
        if let Some(station) = self.network.station(station) {
            self.network.bus().plug(station, false);
        }
    }
}
