//! A controller that is given records, and the hash of what it puts out.

use core::time::Duration;

use crc::{CRC_64_XZ, Crc, Digest, Table};
use embedded_can::StandardId;
use lb2::device::DeviceEngine;
use motion_core::io::Inputs;
use motion_core::{Controller, Model};
use pdo::Frame;

use crate::program::Program;
use crate::record::{Record, What};

type Algorithm = Table<1>;

static HASH: Crc<u64, Algorithm> = Crc::<u64, Algorithm>::new(&CRC_64_XZ);

/// Longest silence within a telegram.
const INTER_BYTE: Duration = Duration::from_millis(10);

/// What a controller did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Control cycles.
    pub cycles: u32,
    /// Frames sent, on CAN 1 and CAN 2.
    pub frames: [u32; 2],
    /// LB2 answers.
    pub answers: u32,
    /// Failures that were stored, those included that the list has lost since.
    pub failures: u32,
    /// Targets reached, by axis.
    pub arrived: [u16; 6],
    /// Whether axis 1 was calibrated.
    pub homed: bool,
}

/// A controller with its two serial ports and its application.
#[derive(Debug)]
pub struct Replica<'a> {
    controller: Controller<&'a mut [u8], &'a mut [u8]>,
    ports: [DeviceEngine; 2],
    program: Program,
    inputs: Inputs,
    before: Duration,
    counts: Counts,
    hash: Hash,
}

/// Hash of everything that was put out so far.
struct Hash(Digest<'static, u64, Algorithm>);

impl core::fmt::Debug for Hash {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:016x}", self.0.clone().finalize())
    }
}

impl<'a> Replica<'a> {
    /// A controller as delivered, with `motion_core::STORAGE_LEN` bytes of non-volatile memory and its RAM
    /// bank.
    #[must_use]
    pub fn new(storage: &'a mut [u8], ram: &'a mut [u8]) -> Self {
        Self {
            controller: Controller::power_on(Model::Gel8231, storage, ram),
            ports: [DeviceEngine::new(INTER_BYTE), DeviceEngine::new(INTER_BYTE)],
            program: Program::default(),
            inputs: Inputs::default(),
            before: Duration::ZERO,
            counts: Counts::default(),
            hash: Hash(HASH.digest()),
        }
    }

    /// What it did so far.
    #[must_use]
    pub const fn counts(&self) -> &Counts {
        &self.counts
    }

    /// The hash of everything that it has put out: terminals, frames, answers, and the state of each axis.
    #[must_use]
    pub fn hash(&self) -> u64 {
        self.hash.0.clone().finalize()
    }

    /// Length of a control cycle.
    #[must_use]
    pub const fn cycle_time(&self) -> Duration {
        self.controller.cycle_time()
    }

    /// Takes a record; what goes out on the terminals afterwards. `sent` is told the frames, by bus.
    pub fn take(
        &mut self,
        record: &Record<'_>,
        sent: impl FnMut(usize, Frame),
    ) -> Option<motion_core::io::Outputs> {
        let now = Duration::from_micros(u64::from(record.micros));
        match record.what {
            What::Serial { port, bytes } => {
                self.serial(now, usize::from(port), bytes);
                None
            }
            What::Frame { bus, id, data } => {
                let frame = StandardId::new(id).and_then(|id| Frame::data_frame(id, data));
                if let (Some(bus), Some(frame)) = (self.controller.bus(usize::from(bus)), frame) {
                    bus.handle_frame(now, &frame);
                }
                None
            }
            What::Cycle { .. } => {
                record.what.apply(&mut self.inputs);
                Some(self.cycle(now, sent))
            }
        }
    }

    fn serial(&mut self, now: Duration, port: usize, bytes: &[u8]) {
        let Some(engine) = self.ports.get_mut(port) else { return };
        engine.handle_bytes(now, bytes, &mut self.controller);
        while let Some(answer) = engine.poll_transmit(now) {
            self.hash.0.update(answer);
            self.counts.answers += 1;
        }
    }

    fn cycle(&mut self, now: Duration, mut sent: impl FnMut(usize, Frame)) -> motion_core::io::Outputs {
        for engine in &mut self.ports {
            engine.handle_timeout(now, &mut self.controller);
            while let Some(answer) = engine.poll_transmit(now) {
                self.hash.0.update(answer);
                self.counts.answers += 1;
            }
        }
        for at in 0..2 {
            if let Some(bus) = self.controller.bus(at) {
                bus.handle_timeout(now);
            }
        }
        let outputs = self.controller.cycle(now, &self.inputs, &mut self.program);
        self.hash.0.update(&outputs.digital);
        for voltage in outputs.analog {
            self.hash.0.update(&voltage.to_le_bytes());
        }
        for pwm in outputs.pwm {
            self.hash.0.update(&pwm.frequency().to_le_bytes());
        }
        for (at, count) in self.counts.frames.iter_mut().enumerate() {
            let Some(bus) = self.controller.bus(at) else { continue };
            while let Some(frame) = bus.poll_transmit(now) {
                let id = frame.standard_id().unwrap_or(u16::MAX);
                self.hash.0.update(&id.to_le_bytes());
                self.hash.0.update(&[at as u8, u8::from(frame.is_remote()), frame.len() as u8]);
                self.hash.0.update(frame.data());
                sent(at, frame);
                *count += 1;
            }
        }
        self.statuses();
        // A memory that is as long as it is to be does not fail.
        let _ = self.controller.advance(now.saturating_sub(self.before));
        self.before = now;
        self.counts.cycles += 1;
        self.counts.failures = self.controller.failures().total();
        (self.counts.arrived, self.counts.homed) = (self.program.arrived, self.program.homed);
        self.hash.0.update(&self.counts.failures.to_le_bytes());
        outputs
    }

    fn statuses(&mut self) {
        for axis in 0..6 {
            let Some(status) = self.controller.axis_status(axis) else { continue };
            for number in [status.position, status.velocity, status.nominal_position, status.deviation] {
                self.hash.0.update(&number.to_le_bytes());
            }
            self.hash.0.update(&status.nominal_velocity.to_bits().to_le_bytes());
            let flags = [status.at_target, status.in_velocity, status.homed].map(u8::from);
            self.hash.0.update(&flags);
            self.hash.0.update(&[status.state as u8]);
        }
        for value in self.controller.actual_values() {
            for number in [value.position, value.velocity, value.frequency] {
                self.hash.0.update(&number.to_le_bytes());
            }
        }
    }
}
