//! The device's errors: which are there, what the error register says, what is told (CiA 301, 7.2.7).

use core::time::Duration;

use crate::emcy::{Emergency, ErrorCode, Producer, ProducerFull};

/// Errors that can be there at once, emergencies that can wait, entries of the history (1003h).
pub const EMERGENCIES: usize = 8;

#[derive(Debug, Clone)]
pub(super) struct Errors {
    /// [`ErrorCode::NO_ERROR`] where there is room.
    active: [ErrorCode; EMERGENCIES],
    producer: Producer<EMERGENCIES>,
}

impl Errors {
    pub(super) fn new() -> Self {
        Self { active: [ErrorCode::NO_ERROR; EMERGENCIES], producer: Producer::new(0) }
    }

    pub(super) fn register(&self) -> u8 {
        self.active.iter().fold(0, |register, code| register | code.register_bit())
    }

    fn slot(&mut self, code: ErrorCode) -> Option<&mut ErrorCode> {
        self.active.iter_mut().find(|slot| **slot == code)
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

    pub(super) fn raise(&mut self, code: ErrorCode, data: [u8; 5]) -> Result<(), ProducerFull> {
        if self.active.contains(&code) {
            return Ok(());
        }
        *self.slot(ErrorCode::NO_ERROR).ok_or(ProducerFull(EMERGENCIES))? = code;
        let register = self.register();
        self.producer.push(Emergency { code, register, data })
    }

    /// An error is gone, and nobody is told: the communication that it belongs to starts anew.
    pub(super) fn forget(&mut self, code: ErrorCode) {
        if let Some(slot) = self.slot(code) {
            *slot = ErrorCode::NO_ERROR;
        }
    }

    /// An error that is over as soon as it is told, such as a PDO that was too short.
    pub(super) fn mention(&mut self, code: ErrorCode, data: [u8; 5]) {
        let register = self.register() | code.register_bit();
        // The history has it, even where too many wait.
        let _ = self.producer.push(Emergency { code, register, data });
    }

    pub(super) fn clear(&mut self, code: ErrorCode) -> Result<(), ProducerFull> {
        let Some(slot) = self.slot(code) else { return Ok(()) };
        *slot = ErrorCode::NO_ERROR;
        let register = self.register();
        self.producer.push(Emergency { code: ErrorCode::NO_ERROR, register, data: [0; 5] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_register_follows_the_errors() {
        let mut errors = Errors::new();
        errors.raise(ErrorCode::TEMPERATURE, [1; 5]).unwrap();
        errors.raise(ErrorCode::LIFE_GUARD, [0; 5]).unwrap();
        errors.raise(ErrorCode::LIFE_GUARD, [0; 5]).unwrap();
        assert_eq!(errors.register(), 0x19);
        errors.clear(ErrorCode::TEMPERATURE).unwrap();
        errors.clear(ErrorCode::TEMPERATURE).unwrap();
        let mut sent = std::vec::Vec::new();
        while let Some(emergency) = errors.producer().poll_transmit(Duration::ZERO) {
            sent.push((emergency.code, emergency.register));
        }
        let expected =
            [(ErrorCode::TEMPERATURE, 0x09), (ErrorCode::LIFE_GUARD, 0x19), (ErrorCode::NO_ERROR, 0x11)];
        assert_eq!(sent, expected);
        assert_eq!(errors.producer().history().len(), 2);
    }
}
