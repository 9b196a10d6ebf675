//! Actual value inputs 1…6 (manual A 6.6): from readings of encoders, drives, analog inputs and other
//! inputs or axes to actual values in user measuring units.
//!
//! A = R·c·(mn/md)·N + H − X (1.5, "User measuring unit"), exact: the product is divided once and
//! rounded down once. R·c is counted without an end, A wraps at −2^31…2^31−1 (7.2).

mod calibration;
mod quadrature;
mod scale;
mod settings;
mod ssi;

pub use calibration::{Calibration, Direction, Edges, Signal};
pub use quadrature::{Encoder, Evaluation, QuadratureDecoder};
pub use scale::Scale;
pub use settings::{Kind, Quantity, Settings};
pub use ssi::{Code, Ssi, TURN_BITS};

use lb2::code::Failure;

use crate::failure;
use crate::io::{AnalogInputs, DigitalInputs};

/// Counts of one motor turn of a drive on the CAN bus (6.11).
pub const COUNTS_PER_TURN: i32 = 65_536;
/// Bits of a drive's position in counts: 16 turns (decision 14).
const CAN_BITS: u32 = 20;

/// What an axis gives to inputs of type Virtual2 (6.6.1.5): its set values of the cycle before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AxisQuantities {
    /// Nominal position, user measuring units.
    pub position: i32,
    /// How far calibration moved the scale of the position in this cycle.
    pub shift: i32,
    /// Nominal velocity, user measuring units per second.
    pub velocity: i32,
    /// Pulses put out to the stepper motor, backward ones counted down; wraps.
    pub steps: i32,
}

/// Everything that an actual value input can read in one cycle.
#[derive(Debug, Clone, Copy)]
pub struct Sources<'a> {
    /// Length of the cycle, ms.
    pub cycle: u16,
    /// E1…E3.
    pub encoders: &'a [Encoder; 3],
    /// I1…I4.
    pub digital: DigitalInputs,
    /// Analog inputs.
    pub analog: &'a AnalogInputs,
    /// Positions of the drives behind CAN 1 IN 1, IN 2, CAN 2 IN 1…IN 4: 24 bits, 2^20 a turn; `None`
    /// while there is no data.
    pub can: [Option<u32>; 6],
    /// Values of all inputs: those that are computed before in this cycle, the others of the last one.
    pub inputs: &'a [ActualValue; 6],
    /// Set values of all axes, of the last cycle.
    pub axes: &'a [AxisQuantities; 6],
}

/// What an actual value stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum Reading {
    /// There has been none yet: an inactive input, or a drive on the CAN bus that has not been there.
    #[default]
    None,
    /// A reading of this cycle.
    Real,
    /// Extrapolated by the failure suppression (6.6.1), here or at its source.
    Extrapolated,
    /// There is none any more; the failure was told when it began.
    Lost,
}

/// What an input gives in one cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ActualValue {
    /// Actual value A, user measuring units.
    pub position: i32,
    /// Velocity over the last cycle, user measuring units per second.
    pub velocity: i32,
    /// Counts per second over the last cycle.
    pub frequency: i32,
    /// How far calibration, or new parameters, moved the scale in this cycle: the set values of the
    /// axis have to move alike.
    pub shift: i32,
    /// Whether the reference point was found in this cycle.
    pub calibrated: bool,
    /// What the value stands for.
    pub reading: Reading,
    /// What failed in this cycle; told once, when it begins.
    pub failure: Option<Failure>,
}

/// One actual value input.
#[derive(Debug, Clone)]
pub struct ActualValueInput {
    settings: Settings,
    /// X, user measuring units.
    offset: i32,
    /// R·c.
    count: i64,
    /// Raw reading that `count` follows; `None` before the first one.
    last: Option<u32>,
    /// Thousandths of a count that Virtual1 still owes.
    rest: i64,
    /// Whether the last position is comparable with the next one.
    settled: bool,
    /// Cycles that are compensated in a row (6.6.1, failure suppression).
    suppressed: u8,
    lost: bool,
    /// What settings and SetPosition moved, to be told with the next cycle.
    moved: i32,
    signal: Signal,
    value: ActualValue,
}

impl ActualValueInput {
    /// An input with its settings and the internal offset X that it had when the power was lost.
    #[must_use]
    pub fn new(settings: Settings, offset: i32) -> Self {
        Self {
            settings,
            offset,
            count: 0,
            last: None,
            rest: 0,
            settled: false,
            suppressed: 0,
            lost: false,
            moved: 0,
            signal: Signal::default(),
            value: ActualValue::default(),
        }
    }

    /// The internal offset X, which is to survive a loss of power (6.6.1.1, `[247]`).
    #[must_use]
    pub const fn offset(&self) -> i32 {
        self.offset
    }

    /// The settings in effect.
    #[must_use]
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The value of the last cycle.
    #[must_use]
    pub const fn value(&self) -> ActualValue {
        self.value
    }

    /// Takes over new settings. Another type `[100]` starts counting anew, and sets X back to 0 unless
    /// it is a virtual one (6.6.1.1). Other changes keep the count; the next cycle tells by how much
    /// they moved the actual value.
    pub fn configure(&mut self, settings: Settings) {
        if settings == self.settings {
            return;
        }
        if !settings.kind.is_same_type(&self.settings.kind) {
            let offset = if settings.kind.is_virtual() { self.offset } else { 0 };
            let value = ActualValue { position: self.value.position, ..ActualValue::default() };
            *self = Self { value, ..Self::new(settings, offset) };
            return;
        }
        if settings.kind != self.settings.kind {
            // Another terminal, object or coding: its readings cannot be compared with the last one.
            self.last = None;
            self.settled = false;
        }
        self.settings = settings;
        if self.settled {
            self.move_to(self.scaled(self.count));
        }
    }

    /// Sets X so that the actual value becomes `position` (SetPosition). The next cycle tells by how much
    /// that moved it.
    pub fn set_position(&mut self, position: i32) {
        self.offset = self.offset.wrapping_sub(position.wrapping_sub(self.value.position));
        self.move_to(position);
    }

    fn move_to(&mut self, position: i32) {
        self.moved = self.moved.wrapping_add(position.wrapping_sub(self.value.position));
        self.value.position = position;
    }

    /// One cycle: reads the source, calibrates on the reference signal if `armed`, suppresses failures.
    pub fn cycle(&mut self, sources: &Sources<'_>, armed: bool) -> ActualValue {
        if !self.settings.active {
            self.value = ActualValue { position: self.value.position, ..ActualValue::default() };
            self.settled = false;
            return self.value;
        }
        let edge = self.signal(sources);
        self.move_with_source(sources);
        self.value = ActualValue {
            shift: core::mem::take(&mut self.moved),
            calibrated: false,
            failure: None,
            ..self.value
        };
        let previous = self.value.position;
        let count = self.count;
        let reading = self.read(sources);
        if matches!(reading, Reading::None | Reading::Lost) {
            if self.lost || !self.compensate(sources.cycle) {
                self.value.velocity = 0;
                self.value.frequency = 0;
                if self.settled || reading == Reading::Lost {
                    self.value.reading = Reading::Lost;
                    let told = core::mem::replace(&mut self.lost, true);
                    self.value.failure = (!told).then_some(failure::READING_LOST);
                }
            }
            return self.value;
        }
        let position = self.scaled(self.count);
        let step = position.wrapping_sub(previous);
        if !self.settled {
            // The first reading: where the axis is, not a movement.
            self.value.shift = self.value.shift.wrapping_add(step);
        } else if self.settings.jump != 0 && step.unsigned_abs() > self.settings.jump {
            if self.compensate(sources.cycle) {
                return self.value;
            }
            self.value.failure = Some(failure::ACTUAL_VALUE_JUMP);
        } else {
            let per_second = |delta: i64| {
                let rate = delta.saturating_mul(1000) / i64::from(sources.cycle.max(1));
                rate.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32
            };
            self.value.frequency = per_second(self.count.wrapping_sub(count));
            self.value.velocity = per_second(i64::from(step));
        }
        self.value.position = position;
        self.value.reading = reading;
        if self.value.failure.is_none() {
            self.value.failure = self.source_failure(sources);
        }
        self.suppressed = 0;
        self.lost = false;
        let step = if core::mem::replace(&mut self.settled, true) { step } else { 0 };
        if armed
            && let Some(edge) = edge
            && self.settings.calibration.direction.includes(step)
        {
            self.calibrate(self.latched(edge, sources));
        }
        self.value
    }

    /// Sets X so that the actual value at `count` is the calibration value `[247]`.
    fn calibrate(&mut self, count: i64) {
        let shift = self.settings.calibration.value.wrapping_sub(self.scaled(count));
        self.offset = self.offset.wrapping_sub(shift);
        self.value.position = self.value.position.wrapping_add(shift);
        self.value.shift = self.value.shift.wrapping_add(shift);
        self.value.calibrated = true;
    }

    fn scaled(&self, count: i64) -> i32 {
        self.settings.scale.value(count, self.offset)
    }

    /// Replaces a reading by extrapolation at the last velocity, for up to `[191]` cycles in a row.
    /// Returns false once the failure is to be taken as real.
    fn compensate(&mut self, cycle: u16) -> bool {
        self.value.reading = Reading::None;
        if !self.settled || self.suppressed >= self.settings.tolerance {
            self.suppressed = 0;
            return false;
        }
        self.value.reading = Reading::Extrapolated;
        self.suppressed += 1;
        let step = i64::from(self.value.velocity) * i64::from(cycle) / 1000;
        self.value.position = self.value.position.wrapping_add(step as i32);
        true
    }

    /// What failed of an input that this one takes over: the axis that goes by it must not go on either.
    fn source_failure(&self, sources: &Sources<'_>) -> Option<Failure> {
        match self.settings.kind {
            Kind::Virtual2 { quantity: Quantity::ActualValue | Quantity::Frequency, source } => {
                sources.inputs.get(source)?.failure
            }
            _ => None,
        }
    }

    /// What moved the scale of what this input takes over moves the one here, and is no movement, whatever
    /// becomes of this cycle's reading.
    fn move_with_source(&mut self, sources: &Sources<'_>) {
        let Kind::Virtual2 { quantity, source } = self.settings.kind else { return };
        let shift = match quantity {
            Quantity::ActualValue => sources.inputs.get(source).map(|input| input.shift),
            Quantity::Position => sources.axes.get(source).map(|axis| axis.shift),
            Quantity::Frequency | Quantity::Velocity | Quantity::Steps => None,
        };
        if let (Some(shift), Some(last)) = (shift, &mut self.last) {
            *last = last.wrapping_add(shift as u32);
            let before = self.scaled(self.count);
            self.count = self.count.wrapping_add(shift.into());
            let moved = self.scaled(self.count).wrapping_sub(before);
            self.move_to(self.value.position.wrapping_add(moved));
        }
    }

    /// Takes the reading of this cycle into `count`, if there is one.
    fn read(&mut self, sources: &Sources<'_>) -> Reading {
        let mut taken = Reading::Real;
        match self.settings.kind {
            Kind::Incremental { encoder, .. } => {
                let Some(encoder) = sources.encoders.get(encoder).filter(|encoder| !encoder.fault) else {
                    return Reading::Lost;
                };
                self.follow(encoder.count as u32, 32);
            }
            Kind::Ssi { encoder, ssi } => {
                let Some(encoder) = sources.encoders.get(encoder).filter(|encoder| !encoder.fault) else {
                    return Reading::Lost;
                };
                self.follow(ssi.position(encoder.count as u32), ssi.bits());
            }
            Kind::Can { object } => {
                let Some(position) = object.and_then(|at| sources.can.get(at).copied().flatten()) else {
                    return Reading::None;
                };
                self.follow(position >> 4, CAN_BITS);
            }
            Kind::Virtual1 { frequency } => {
                let owed = self.rest + i64::from(frequency) * i64::from(sources.cycle);
                self.count = self.count.wrapping_add(owed.div_euclid(1000));
                self.rest = owed.rem_euclid(1000);
            }
            Kind::Virtual2 { quantity, source } => {
                let input = sources.inputs.get(source).copied().unwrap_or_default();
                let axis = sources.axes.get(source).copied().unwrap_or_default();
                if let Quantity::ActualValue | Quantity::Frequency = quantity {
                    taken = input.reading;
                }
                match quantity {
                    _ if matches!(taken, Reading::None | Reading::Lost) => {}
                    Quantity::ActualValue => self.follow(input.position as u32, 32),
                    Quantity::Frequency => self.count = i64::from(input.frequency),
                    Quantity::Position => self.follow(axis.position as u32, 32),
                    Quantity::Velocity => self.count = i64::from(axis.velocity),
                    Quantity::Steps => self.follow(axis.steps as u32, 32),
                }
            }
            Kind::Analog { channel, average } => {
                let Some(channel) = sources.analog.channel(channel) else { return Reading::Lost };
                self.count = i64::from(if average { channel.average() } else { channel.reading() });
            }
        }
        taken
    }

    /// Follows a reading of `bits` bits that wraps: the shorter way round counts. The first reading is
    /// taken as it is; 32 bits are signed.
    fn follow(&mut self, reading: u32, bits: u32) {
        // Shifted to the top, a difference of readings is a signed number of that many bits.
        let unused = 32u32.saturating_sub(bits).min(31);
        let signed = |difference: u32| i64::from((difference << unused) as i32 >> unused);
        self.count = match self.last {
            Some(last) => self.count.wrapping_add(signed(reading.wrapping_sub(last))),
            None if bits == 32 => i64::from(reading as i32),
            None => i64::from(reading),
        };
        self.last = Some(reading);
    }

    /// Follows the calibration signal; the edge that counts, if one came.
    fn signal(&mut self, sources: &Sources<'_>) -> Option<calibration::Edge> {
        let calibration = &self.settings.calibration;
        let level = calibration.input.level(sources, self.settings.kind);
        self.signal.follow(level, calibration.edges)
    }

    /// The count at which an edge came: what the encoder's own latch says, else that of this cycle.
    fn latched(&self, edge: calibration::Edge, sources: &Sources<'_>) -> i64 {
        let own = match (self.settings.kind, self.settings.calibration.input) {
            (Kind::Incremental { encoder, .. }, calibration::Input::Reference(reference))
                if encoder == reference =>
            {
                sources.encoders.get(encoder)
            }
            _ => None,
        };
        own.and_then(|encoder| Some((encoder.count, edge.latch(encoder)?)))
            .map_or(self.count, |(now, latched)| {
                self.count.wrapping_sub(i64::from(now.wrapping_sub(latched)))
            })
    }
}

#[cfg(test)]
mod tests;
