//! The PDOs of a slave: their parameters as objects 1400h…1BFFh, changed at run time in the order that
//! CiA 301 (7.5.2.35…38) asks for, and process data to and from the dictionary.

use core::time::Duration;

use pdo::mapping::{Entry as Mapped, MappingError};
use pdo::{
    Address, CobId, Communication, Frame, Handled, Mapping, Payload, Rpdo, RpdoEvent, RpdoFault, Tpdo,
    Transmission, cob,
};

use super::ProcessData;
use crate::clock::earlier;
use crate::data_type::DataType;
use crate::sdo::{AbortCode, Small};

/// One PDO: its parameters and its up to `M` mapped objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PdoSlot<const M: usize> {
    /// 1400h or 1800h.
    pub communication: Communication,
    /// 1600h or 1A00h.
    pub mapping: Mapping<M>,
}

impl<const M: usize> PdoSlot<M> {
    /// With these parameters.
    #[must_use]
    pub const fn new(communication: Communication, mapping: Mapping<M>) -> Self {
        Self { communication, mapping }
    }

    /// A PDO that maps nothing does not exist.
    fn effective(&self) -> &Communication {
        if self.mapping.bits() > 0 { &self.communication } else { &Communication::OFF }
    }

    /// The value of a parameter and its bytes.
    pub(super) fn read(&self, at: Parameter) -> Result<(u32, usize), AbortCode> {
        let com = &self.communication;
        Ok(match (at.mapping, at.sub) {
            (false, 0) => (if at.rpdo { 5 } else { 6 }, 1),
            (false, 1) => (com.cob_id.0, 4),
            (false, 2) => (com.transmission.raw().into(), 1),
            (false, 3) => (com.inhibit.into(), 2),
            (false, 5) => (com.event_timer.into(), 2),
            (false, 6) if !at.rpdo => (com.sync_start.into(), 1),
            (false, _) => return Err(AbortCode::NO_SUB_INDEX),
            (true, 0) => (self.mapping.entries().len() as u32, 1),
            (true, sub) => (self.mapping.entry(sub).ok_or(AbortCode::NO_SUB_INDEX)?.raw(), 4),
        })
    }

    /// Changes a parameter that can be read; `value` has as many bytes.
    fn write(&mut self, at: Parameter, value: u32, objects: &impl ProcessData) -> Result<(), AbortCode> {
        let valid = self.communication.cob_id.is_valid();
        let com = &mut self.communication;
        match (at.mapping, at.sub) {
            (false, 0) => return Err(AbortCode::READ_ONLY),
            (false, 1) => com.cob_id = checked_cob_id(com.cob_id, CobId(value))?,
            (false, 2) => {
                let new = Transmission::new(value as u8).map_err(|_| AbortCode::INVALID_VALUE)?;
                if at.rpdo && matches!(new, Transmission::RtrSync | Transmission::RtrEvent) {
                    return Err(AbortCode::INVALID_VALUE);
                }
                com.transmission = new;
            }
            (false, 5) => com.event_timer = value as u16,
            // The inhibit time and the start value must not change while the PDO is valid.
            (false, _) if valid => return Err(AbortCode::INVALID_VALUE),
            (false, 3) => com.inhibit = value as u16,
            // 06h, the start value: nothing else is left that can be read.
            (false, _) if value > 240 => return Err(AbortCode::TOO_HIGH),
            (false, _) => com.sync_start = value as u8,
            (true, _) if valid => return Err(AbortCode::UNSUPPORTED_ACCESS),
            (true, 0) => self.mapping.enable(value as u8).map_err(|error| match error {
                MappingError::NoBits { .. } => AbortCode::NOT_MAPPABLE,
                _ => AbortCode::PDO_LENGTH,
            })?,
            (true, sub) => {
                let entry = Mapped::from_raw(value);
                if !self.mapping.entries().is_empty() {
                    return Err(AbortCode::UNSUPPORTED_ACCESS);
                }
                check_mapped(entry, at.rpdo, objects)?;
                self.mapping.set(sub, entry);
            }
        }
        Ok(())
    }
}

/// Where a parameter belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Parameter {
    rpdo: bool,
    mapping: bool,
    pdo: usize,
    sub: u8,
}

impl Parameter {
    pub(super) const fn of(at: Address) -> Option<Self> {
        // 1400h, 1600h, 1800h and 1A00h.
        let (rpdo, mapping) = (at.index < 0x1800, at.index & 0x200 != 0);
        match at.index {
            0x1400..=0x1BFF => Some(Self { rpdo, mapping, pdo: (at.index & 0x1FF) as usize, sub: at.sub }),
            _ => None,
        }
    }
}

/// An identifier must not change while the PDO is valid, must have 11 bits and not be restricted.
fn checked_cob_id(old: CobId, new: CobId) -> Result<CobId, AbortCode> {
    let id = new.standard_id().ok_or(AbortCode::INVALID_VALUE)?;
    let changed = old.id() != new.id();
    let refused = new.is_valid() && (cob::is_restricted(id) || (changed && old.is_valid()));
    if refused { Err(AbortCode::INVALID_VALUE) } else { Ok(new) }
}

/// Whether a PDO may carry what an entry says.
fn check_mapped(entry: Mapped, rpdo: bool, objects: &impl ProcessData) -> Result<(), AbortCode> {
    let data_type = match entry.is_dummy() {
        true if rpdo && entry.at.sub == 0 => DataType(entry.at.index),
        true => return Err(AbortCode::NOT_MAPPABLE),
        false => objects.mapped_type(entry.at, rpdo)?,
    };
    let fits = match entry.bits {
        1 => data_type == DataType::BOOLEAN,
        bits => data_type.size().is_some_and(|bytes| bytes * 8 == bits),
    };
    if fits { Ok(()) } else { Err(AbortCode::NOT_MAPPABLE) }
}

/// `R` RPDOs and `T` TPDOs of up to `M` mapped objects each.
///
/// - Input: [`handle_frame`](Self::handle_frame), [`handle_sync`](Self::handle_sync),
///   [`handle_timeout`](Self::handle_timeout).
/// - Commands: [`start`](Self::start), [`stop`](Self::stop), [`trigger`](Self::trigger),
///   [`withdraw`](Self::withdraw), [`set_rpdo_slot`](Self::set_rpdo_slot),
///   [`set_tpdo_slot`](Self::set_tpdo_slot).
/// - Output: [`poll_transmit`](Self::poll_transmit), [`poll_event`](Self::poll_event),
///   [`poll_timeout`](Self::poll_timeout).
///
/// PDOs live in the NMT state operational only; parameters written meanwhile take effect at once.
#[derive(Debug, Clone)]
pub struct Pdos<const R: usize, const T: usize, const M: usize> {
    rpdo_slots: [PdoSlot<M>; R],
    tpdo_slots: [PdoSlot<M>; T],
    rpdos: [Rpdo; R],
    tpdos: [Tpdo; T],
    running: bool,
}

impl<const R: usize, const T: usize, const M: usize> Pdos<R, T, M> {
    /// With these parameters, not running.
    #[must_use]
    pub const fn new(rpdo_slots: [PdoSlot<M>; R], tpdo_slots: [PdoSlot<M>; T]) -> Self {
        let rpdos = [const { Rpdo::new(&Communication::OFF, 0) }; R];
        let tpdos = [const { Tpdo::new(Communication::OFF) }; T];
        Self { rpdo_slots, tpdo_slots, rpdos, tpdos, running: false }
    }

    /// Parameters of the RPDOs.
    #[must_use]
    pub const fn rpdo_slots(&self) -> &[PdoSlot<M>; R] {
        &self.rpdo_slots
    }

    /// Parameters of the TPDOs.
    #[must_use]
    pub const fn tpdo_slots(&self) -> &[PdoSlot<M>; T] {
        &self.tpdo_slots
    }

    /// The node enters the NMT state operational.
    pub fn start(&mut self) {
        self.running = true;
        (0..R).for_each(|number| self.restart(true, number));
        (0..T).for_each(|number| self.restart(false, number));
    }

    /// The node leaves the NMT state operational.
    pub fn stop(&mut self) {
        self.running = false;
    }

    /// Changes an RPDO as the device itself may, whatever state it is in; it begins anew. `number` from 0;
    /// `false` where there is none.
    pub fn set_rpdo_slot(&mut self, number: usize, slot: PdoSlot<M>) -> bool {
        let place = self.rpdo_slots.get_mut(number).map(|place| *place = slot);
        self.restart(true, number);
        place.is_some()
    }

    /// Changes a TPDO, as [`set_rpdo_slot`](Self::set_rpdo_slot).
    pub fn set_tpdo_slot(&mut self, number: usize, slot: PdoSlot<M>) -> bool {
        let place = self.tpdo_slots.get_mut(number).map(|place| *place = slot);
        self.restart(false, number);
        place.is_some()
    }

    /// The value of a parameter (1400h…1BFFh), little-endian.
    ///
    /// # Errors
    /// The abort code that a client would get: no such PDO or parameter.
    pub fn parameter(&self, at: Address) -> Result<Small, AbortCode> {
        let (value, size) = self.read(Parameter::of(at).ok_or(AbortCode::NO_OBJECT)?)?;
        value.to_le_bytes().get(..size).and_then(Small::new).ok_or(AbortCode::GENERAL)
    }

    /// What TPDO `number` (from 0) carries if it is sent now; `None` while it does not exist.
    #[must_use]
    pub fn data(&self, number: usize, objects: &impl ProcessData) -> Option<Payload> {
        let slot = self.tpdo_slots.get(number).filter(|slot| slot.effective().cob_id.is_valid())?;
        Some(pack(slot, objects))
    }

    /// Sends TPDO `number` (from 0) soon: its data have changed.
    pub fn trigger(&mut self, number: usize) {
        if let Some(tpdo) = self.tpdos.get_mut(number) {
            tpdo.trigger();
        }
    }

    /// TPDO `number` (from 0) is not sent after all, whether [`trigger`](Self::trigger), the event timer or the
    /// start asked for it: the device profile holds the event back. A remote frame is still answered.
    pub fn withdraw(&mut self, number: usize) {
        if let Some(tpdo) = self.tpdos.get_mut(number) {
            tpdo.withdraw();
        }
    }

    /// Takes a frame from the bus; what an event-driven RPDO brings goes to the dictionary with
    /// [`poll_event`](Self::poll_event).
    #[inline]
    pub fn handle_frame(&mut self, now: Duration, frame: &impl embedded_can::Frame) -> Handled {
        let taken = self.running
            && (self.rpdos.iter_mut().any(|rpdo| rpdo.handle_frame(now, frame).is_taken())
                || self.tpdos.iter_mut().any(|tpdo| tpdo.handle_frame(frame).is_taken()));
        if taken { Handled::Taken } else { Handled::Ignored }
    }

    /// A SYNC has come, with its counter if it has one.
    pub fn handle_sync(&mut self, counter: Option<u8>, objects: &impl ProcessData) {
        if !self.running {
            return;
        }
        self.rpdos.iter_mut().for_each(Rpdo::handle_sync);
        for (tpdo, slot) in self.tpdos.iter_mut().zip(&self.tpdo_slots) {
            tpdo.handle_sync(counter, || pack(slot, objects));
        }
    }

    /// Notices what is missing and what is due; early calls do nothing.
    pub fn handle_timeout(&mut self, now: Duration) {
        if !self.running {
            return;
        }
        self.rpdos.iter_mut().for_each(|rpdo| rpdo.handle_timeout(now));
        self.tpdos.iter_mut().for_each(|tpdo| tpdo.handle_timeout(now));
    }

    /// When to call [`handle_timeout`](Self::handle_timeout) and
    /// [`poll_transmit`](Self::poll_transmit); `None` = idle.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Duration> {
        if !self.running {
            return None;
        }
        let rpdos = self.rpdos.iter().map(Rpdo::poll_timeout).fold(None, earlier);
        self.tpdos.iter().map(Tpdo::poll_timeout).fold(rpdos, earlier)
    }

    /// The frame to send now, once.
    pub fn poll_transmit(&mut self, now: Duration, objects: &impl ProcessData) -> Option<Frame> {
        if !self.running {
            return None;
        }
        let mut tpdos = self.tpdos.iter_mut().zip(&self.tpdo_slots);
        tpdos.find_map(|(tpdo, slot)| tpdo.poll_transmit(now, || pack(slot, objects)))
    }

    /// Writes what has come to the dictionary; tells the number (from 0) of the RPDO whose data are there
    /// now, or what was wrong, until `None`.
    pub fn poll_event(&mut self, objects: &mut impl ProcessData) -> Option<(usize, Result<(), RpdoFault>)> {
        let mut rpdos = self.rpdos.iter_mut().zip(&self.rpdo_slots).enumerate();
        let (number, slot, event) =
            rpdos.find_map(|(number, (rpdo, slot))| Some((number, slot, rpdo.poll_event()?)))?;
        match event {
            RpdoEvent::Data(payload) => {
                let values = slot.mapping.unpack(payload).into_iter().flatten();
                values
                    .filter(|(entry, _)| !entry.is_dummy())
                    .for_each(|(entry, bits)| objects.set_bits(entry.at, bits.unsigned()));
                Some((number, Ok(())))
            }
            RpdoEvent::Fault(fault) => Some((number, Err(fault))),
        }
    }

    /// A PDO begins anew, with its parameters as they are now.
    fn restart(&mut self, rpdo: bool, number: usize) {
        if rpdo {
            if let (Some(rpdo), Some(slot)) = (self.rpdos.get_mut(number), self.rpdo_slots.get(number)) {
                *rpdo = Rpdo::new(slot.effective(), slot.mapping.bytes());
            }
        } else if let (Some(tpdo), Some(slot)) = (self.tpdos.get_mut(number), self.tpdo_slots.get(number)) {
            *tpdo = Tpdo::new(*slot.effective());
        }
    }

    pub(super) fn read(&self, at: Parameter) -> Result<(u32, usize), AbortCode> {
        let slots: &[PdoSlot<M>] = if at.rpdo { &self.rpdo_slots } else { &self.tpdo_slots };
        slots.get(at.pdo).ok_or(AbortCode::NO_OBJECT)?.read(at)
    }

    pub(super) fn write(
        &mut self,
        at: Parameter,
        value: u32,
        objects: &impl ProcessData,
    ) -> Result<(), AbortCode> {
        let slots: &mut [PdoSlot<M>] = if at.rpdo { &mut self.rpdo_slots } else { &mut self.tpdo_slots };
        slots.get_mut(at.pdo).ok_or(AbortCode::NO_OBJECT)?.write(at, value, objects)?;
        self.restart(at.rpdo, at.pdo);
        Ok(())
    }
}

fn pack<const M: usize>(slot: &PdoSlot<M>, objects: &impl ProcessData) -> Payload {
    slot.mapping.pack(|entry| objects.bits(entry.at))
}
