//! The device engine against a master that does anything.

use core::time::Duration;

use lb2::code::{ErrorCode, StoredFailure, Version};
use lb2::device::{Device, DeviceEngine, LineError, LoaderAnswer};
use lb2::frame::{Decoder, Item, encode};
use lb2::telegram::{BANK_LEN, Description, MAX_BANK_DATA, Response, Text};

use super::Input;

/// A device whose answers come from the fuzz input; checks what the engine promises it.
struct Any<'a> {
    number: u8,
    salt: u8,
    text: &'a [u8],
}

impl Any<'_> {
    fn result(&self) -> Result<(), ErrorCode> {
        if self.salt < 0x80 { Ok(()) } else { Err(ErrorCode(self.salt)) }
    }
}

fn in_bank(offset: u16, len: usize) {
    assert!(len <= MAX_BANK_DATA && usize::from(offset) + len <= BANK_LEN);
}

impl Device for Any<'_> {
    fn device_number(&self) -> u8 {
        self.number
    }
    fn device_type(&self) -> (u16, u8) {
        (8230, 6)
    }
    fn os_version(&self) -> Version {
        Version { version: 5, revision: 15 }
    }
    fn custom_version(&self) -> Version {
        Version { version: 0, revision: 0 }
    }
    fn failure_count(&self) -> u8 {
        self.salt
    }
    fn failure(&self, position: u8) -> Option<StoredFailure> {
        (position < self.salt)
            .then_some(StoredFailure { axis: position, failure: lb2::code::Failure(self.salt) })
    }
    fn delete_failures(&mut self) -> u8 {
        self.salt
    }
    fn store_failure(&mut self, failure: StoredFailure) {
        assert_eq!(failure.axis, 0);
    }
    fn erase_flash(&mut self, bank: u8) -> Result<(), ErrorCode> {
        assert!(matches!(bank, 15 | 16));
        self.result()
    }
    fn read_flash(&self, bank: u8, offset: u16, out: &mut [u8]) -> Result<(), ErrorCode> {
        assert!(matches!(bank, 15 | 16));
        in_bank(offset, out.len());
        out.fill(self.salt);
        self.result()
    }
    fn write_flash(&mut self, bank: u8, _: bool, data: &[u8]) -> Result<(), ErrorCode> {
        assert!(matches!(bank, 15 | 16) && data.len().is_multiple_of(2));
        in_bank(0, data.len());
        self.result()
    }
    fn write_flash_at(&mut self, bank: u8, offset: u16, data: &[u8]) -> Result<(), ErrorCode> {
        assert!(matches!(bank, 15 | 16) && data.len().is_multiple_of(2));
        in_bank(offset, data.len());
        self.result()
    }
    fn read_ram(&self, bank: u8, offset: u16, out: &mut [u8]) -> Result<(), ErrorCode> {
        assert_eq!(bank, 12);
        in_bank(offset, out.len());
        out.fill(0x82);
        self.result()
    }
    fn write_ram(&mut self, bank: u8, offset: u16, data: &[u8]) -> Result<(), ErrorCode> {
        assert_eq!(bank, 12);
        in_bank(offset, data.len());
        self.result()
    }
    fn read_parameter(&self, index: u16) -> i32 {
        i32::from(index) << 8
    }
    fn describe_parameter(&self, _: u16) -> Description<'_> {
        let text = Text::new(self.text);
        Description { variant: text, name: text, group: text, ..Description::default() }
    }
    fn write_parameter(&mut self, _: u16, _: i32) -> LoaderAnswer<'_> {
        LoaderAnswer { code: lb2::code::LoaderCode(self.salt), text: Text::new(self.text) }
    }
    fn call_loader(&mut self) -> i32 {
        -1
    }
    fn save_parameters(&mut self) -> Result<(), ErrorCode> {
        self.result()
    }
    fn own_function(&mut self, _: u8, data: &[u8], reply: &mut [u8]) -> Result<usize, ErrorCode> {
        reply[..data.len()].copy_from_slice(data);
        self.result()?;
        Ok(usize::from(self.salt) * 4)
    }
}

/// Plays telegrams, damage, line errors and passing time. Whatever the engine sends must be one good
/// telegram that parses as a response, and a silent line must leave the engine idle.
pub fn device_ops(data: &[u8]) {
    let mut input = Input(data);
    let mut engine = DeviceEngine::default();
    let len = input.u8() % 64;
    let mut device = Any { number: input.u8() % 3, salt: 0, text: input.bytes(len) };
    let mut now = Duration::ZERO;
    while !input.is_empty() {
        device.salt = input.u8();
        match input.u8() % 6 {
            0 | 1 => {
                let (function, len) = (input.u8(), input.u8() % 254);
                let mut wire = [0; lb2::frame::MAX_WIRE];
                let len = encode(function, input.bytes(len), &mut wire).unwrap();
                engine.handle_bytes(now, &wire[..len], &mut device);
            }
            2 => {
                let len = input.u8() % 32;
                engine.handle_bytes(now, input.bytes(len), &mut device);
            }
            3 => {
                let error = match input.u8() % 3 {
                    0 => LineError::Parity,
                    1 => LineError::StopBit,
                    _ => LineError::Overwrite,
                };
                engine.handle_line_error(now, error, &mut device);
            }
            4 => {
                now += Duration::from_millis(u64::from(input.u8() % 16));
                engine.handle_timeout(now, &mut device);
            }
            _ => sent(&mut engine, now),
        }
    }
    sent(&mut engine, now);
    if let Some(timeout) = engine.poll_timeout() {
        engine.handle_timeout(timeout, &mut device);
        sent(&mut engine, timeout);
    }
    assert_eq!(engine.poll_timeout(), None);
}

fn sent(engine: &mut DeviceEngine, now: Duration) {
    let Some(wire) = engine.poll_transmit(now) else { return };
    let len = wire.len();
    match Decoder::new().decode(wire) {
        (taken, Some(Item::Frame { frame, .. })) if taken == len => {
            Response::parse(&frame).expect("an answer that parses");
        }
        other => panic!("{other:?}"),
    }
}
