//! The device's errors: which are there, what the error register says, what is told (CiA 301, 7.2.7).

use core::time::Duration;

use crate::emcy::{Emergency, ErrorCode, Producer, ProducerFull};

/// Errors that can be there at once, emergencies that can wait, entries of the history (1003h).
pub const EMERGENCIES: usize = 8;

/// What an error comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Cause {
    /// The device itself, or its CAN controller.
    Device,
    /// The master's guarding.
    Guarding,
    /// A heartbeat that is watched: entry of 1016h, from 0.
    Heartbeat(usize),
    /// An RPDO, from 0.
    Rpdo(usize),
}

#[derive(Debug, Clone)]
pub(super) struct Errors {
    active: [Option<(ErrorCode, Cause)>; EMERGENCIES],
    producer: Producer<EMERGENCIES>,
}

impl Errors {
    pub(super) fn new() -> Self {
        Self { active: [None; EMERGENCIES], producer: Producer::new(0) }
    }

    pub(super) fn register(&self) -> u8 {
        self.active.iter().flatten().fold(0, |register, (code, _)| register | code.register_bit())
    }

    pub(super) const fn producer(&mut self) -> &mut Producer<EMERGENCIES> {
        &mut self.producer
    }

    /// As 1003h shows it.
    pub(super) fn history(&self) -> &[u32] {
        self.producer.history()
    }

    pub(super) fn poll_timeout(&self) -> Option<Duration> {
        self.producer.poll_timeout()
    }

    pub(super) fn raise(&mut self, code: ErrorCode, cause: Cause, data: [u8; 5]) -> Result<(), ProducerFull> {
        if self.active.contains(&Some((code, cause))) {
            return Ok(());
        }
        // One without room is told all the same, as if it were over.
        if let Some(room) = self.active.iter_mut().find(|slot| slot.is_none()) {
            *room = Some((code, cause));
        }
        self.send(code, data)
    }

    /// An error that is over as soon as it is told, such as a PDO that was too long.
    pub(super) fn mention(&mut self, code: ErrorCode, data: [u8; 5]) {
        // The history has it, even where too many wait.
        let _ = self.send(code, data);
    }

    fn send(&mut self, code: ErrorCode, data: [u8; 5]) -> Result<(), ProducerFull> {
        let register = self.register() | code.register_bit();
        self.producer.push(Emergency { code, register, data })
    }

    /// Errors are gone; `told`: and it is told.
    pub(super) fn clear(
        &mut self,
        gone: impl Fn(ErrorCode, Cause) -> bool,
        told: bool,
    ) -> Result<(), ProducerFull> {
        let mut any = false;
        for slot in &mut self.active {
            any |= slot.take_if(|(code, cause)| gone(*code, *cause)).is_some();
        }
        if any && told { self.send(ErrorCode::NO_ERROR, [0; 5]) } else { Ok(()) }
    }

    /// All errors of a cause are gone.
    pub(super) fn clear_cause(&mut self, cause: Cause) {
        // A full queue drops the message, not the register.
        let _ = self.clear(|_, active| active == cause, true);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_register_follows_the_errors() {
        let mut errors = Errors::new();
        errors.raise(ErrorCode::TEMPERATURE, Cause::Device, [1; 5]).unwrap();
        errors.raise(ErrorCode::LIFE_GUARD, Cause::Guarding, [0; 5]).unwrap();
        errors.raise(ErrorCode::LIFE_GUARD, Cause::Guarding, [0; 5]).unwrap();
        assert_eq!(errors.register(), 0x19);
        errors.clear(|code, _| code == ErrorCode::TEMPERATURE, true).unwrap();
        errors.clear(|code, _| code == ErrorCode::TEMPERATURE, true).unwrap();
        let mut sent = std::vec::Vec::new();
        while let Some(emergency) = errors.producer().poll_transmit(Duration::ZERO) {
            sent.push((emergency.code, emergency.register));
        }
        let expected =
            [(ErrorCode::TEMPERATURE, 0x09), (ErrorCode::LIFE_GUARD, 0x19), (ErrorCode::NO_ERROR, 0x11)];
        assert_eq!(sent, expected);
        assert_eq!(errors.producer().history().len(), 2);
    }

    #[test]
    fn an_error_too_many_is_sent_and_recorded() {
        let mut errors = Errors::new();
        for code in 0x1000..0x1008 {
            errors.raise(ErrorCode(code), Cause::Device, [0; 5]).unwrap();
            errors.producer().poll_transmit(Duration::ZERO).unwrap();
        }
        errors.raise(ErrorCode::TEMPERATURE, Cause::Device, [0; 5]).unwrap();
        let sent = errors.producer().poll_transmit(Duration::ZERO).unwrap();
        assert_eq!((sent.code, sent.register), (ErrorCode::TEMPERATURE, 0x09));
        assert_eq!(errors.history().first(), Some(&0x4000));
        assert_eq!(errors.register(), 0x01, "it is not held");
    }
}
