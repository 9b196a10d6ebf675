//! The device side: a [`DeviceEngine`] that answers LB2 for anything that implements [`Device`],
//! a real controller or a virtual one (manual A, Appendix 1).
//!
//! The engine knows framing, device selection and error telegrams; the device knows everything
//! else. Damage and line errors become stored failures (4.3.4.2) at once and an error telegram when
//! the line falls silent without a good telegram following.

use core::time::Duration;

use crate::code::{ErrorCode, Failure, LoaderCode, StoredFailure, Version};
use crate::frame::{DamageKind, Decoder, Frame, Item, MAX_DATA, MAX_WIRE};
use crate::telegram::{
    Description, Failures, MAX_BANK_DATA, MAX_FAILURES, Request, Response, Text, function,
};

/// Answer of the loader to one written parameter (32h, 33h).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LoaderAnswer<'a> {
    /// 00h OK, 01h…7Fh warning, 80h…FFh error.
    pub code: LoaderCode,
    /// Message for people, at most 41 characters.
    pub text: Text<'a>,
}

/// What an LB2 device can do. Banks, counts and ranges have been checked ([`Request::check`])
/// before a method is called; the other way round, nothing that a method returns can make the
/// engine fail.
pub trait Device {
    /// Number 0…31 (parameter `[005]`); 0 answers to every selection.
    fn device_number(&self) -> u8;
    /// 40h: model number in binary and greatest number of axes.
    fn device_type(&self) -> (u16, u8);
    /// 41h
    fn os_version(&self) -> Version;
    /// 43h: 0.00 without customized software.
    fn custom_version(&self) -> Version;

    /// 52h: stored failures, 0…20.
    fn failure_count(&self) -> u8;
    /// 50h: the stored failure at `position`, 0 the first to be sent.
    fn failure(&self, position: u8) -> Option<StoredFailure>;
    /// 53h: deletes all failures and returns how many there were.
    fn delete_failures(&mut self) -> u8;
    /// Stores a failure that the engine found on the line.
    fn store_failure(&mut self, failure: StoredFailure);

    /// 21h
    ///
    /// # Errors
    /// The error code to answer with.
    fn erase_flash(&mut self, bank: u8) -> Result<(), ErrorCode>;
    /// 22h: fills `out` (0…128 bytes) from `offset` on.
    ///
    /// # Errors
    /// The error code to answer with.
    fn read_flash(&self, bank: u8, offset: u16, out: &mut [u8]) -> Result<(), ErrorCode>;
    /// 23h: writes at the bank's pointer and moves it on; `enable` is false for "write protected".
    ///
    /// # Errors
    /// The error code to answer with.
    fn write_flash(&mut self, bank: u8, enable: bool, data: &[u8]) -> Result<(), ErrorCode>;
    /// 26h
    ///
    /// # Errors
    /// The error code to answer with.
    fn write_flash_at(&mut self, bank: u8, offset: u16, data: &[u8]) -> Result<(), ErrorCode>;
    /// 24h: fills `out` (0…128 bytes) from `offset` on.
    ///
    /// # Errors
    /// The error code to answer with.
    fn read_ram(&self, bank: u8, offset: u16, out: &mut [u8]) -> Result<(), ErrorCode>;
    /// 25h
    ///
    /// # Errors
    /// The error code to answer with.
    fn write_ram(&mut self, bank: u8, offset: u16, data: &[u8]) -> Result<(), ErrorCode>;

    /// 30h: the value, 0 for an unused index (decision 4).
    fn read_parameter(&self, index: u16) -> i32;
    /// 31h: empty texts and zeros for an unused index (decision 4).
    fn describe_parameter(&self, index: u16) -> Description<'_>;
    /// 32h, 33h: writes to RAM; a value that is refused leaves the old one.
    fn write_parameter(&mut self, index: u16, value: i32) -> LoaderAnswer<'_>;
    /// 34h: index of the first parameter at fault, −1 for none.
    fn call_loader(&mut self) -> i32;
    /// 35h
    ///
    /// # Errors
    /// The error code to answer with.
    fn save_parameters(&mut self) -> Result<(), ErrorCode>;

    /// A function of the device's own (any but FFh, which is reply only): writes the reply's data to `reply` (253 bytes) and returns
    /// their number; the reply has the same function byte. `data` is everything between function
    /// and check byte.
    ///
    /// # Errors
    /// The error code to answer with; as provided, [`ErrorCode::SUB_FUNCTION`] for CCh and
    /// [`ErrorCode::FUNCTION`] for every other function.
    fn own_function(&mut self, function: u8, data: &[u8], reply: &mut [u8]) -> Result<usize, ErrorCode> {
        let _ = (data, reply);
        Err(match function {
            function::EXTENSION => ErrorCode::SUB_FUNCTION,
            _ => ErrorCode::FUNCTION,
        })
    }
}

/// What the receiver of a serial port reports about a character.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum LineError {
    /// Parity bit wrong.
    Parity,
    /// Stop bit low: framing error or break.
    StopBit,
    /// Characters lost because they were not read in time.
    Overwrite,
}

impl LineError {
    /// Error code of the answer and failure number to store.
    #[must_use]
    pub const fn codes(self) -> (ErrorCode, Failure) {
        match self {
            Self::Parity => (ErrorCode::PARITY, Failure::PARITY),
            Self::StopBit => (ErrorCode::STOP_BIT, Failure::STOP_BIT),
            Self::Overwrite => (ErrorCode::OVERWRITE, Failure::OVERWRITE),
        }
    }
}

/// Error code and failure number for damage inside a telegram; `None` for bytes outside of any.
/// Manual A has no error code for a missing repeat: it is answered as a check byte error
/// ("or transmission error"), project-defined.
#[must_use]
pub const fn damage_codes(kind: DamageKind) -> Option<(ErrorCode, Failure)> {
    match kind {
        DamageKind::Garbage => None,
        DamageKind::CheckByte { .. } => Some((ErrorCode::CHECK_BYTE, Failure::CHECK_BYTE)),
        DamageKind::RepeatMissing { .. } => Some((ErrorCode::CHECK_BYTE, Failure::REPEAT_MISSING)),
        DamageKind::Number { .. } | DamageKind::CutShort | DamageKind::Gap => {
            Some((ErrorCode::NUMBER, Failure::RECEIVE_COUNT))
        }
    }
}

/// Longest silence inside one telegram (decision 9).
pub const INTER_BYTE: Duration = Duration::from_millis(10);

/// Answers LB2 for a [`Device`].
///
/// - Input: [`handle_bytes`](Self::handle_bytes), [`handle_line_error`](Self::handle_line_error),
///   [`handle_timeout`](Self::handle_timeout).
/// - Output: [`poll_transmit`](Self::poll_transmit), [`poll_timeout`](Self::poll_timeout).
/// - Getters: [`decoder`](Self::decoder), [`is_selected`](Self::is_selected).
///
/// An answer is ready at once; how long a real device takes for it is the caller's to model. A
/// request that comes before the answer to the last one was polled replaces that answer.
#[derive(Debug, Clone)]
pub struct DeviceEngine {
    decoder: Decoder,
    inter_byte: Duration,
    /// When the silence after the last byte ends a telegram.
    deadline: Option<Duration>,
    /// What an error telegram would say if the line now fell silent.
    error: Option<ErrorCode>,
    /// `None` before any selection: then every device answers (decision 8).
    selected: Option<u8>,
    tx: [u8; MAX_WIRE],
    tx_len: usize,
}

impl Default for DeviceEngine {
    fn default() -> Self {
        Self::new(INTER_BYTE)
    }
}

impl DeviceEngine {
    /// An engine that ends a telegram after `inter_byte` of silence.
    #[must_use]
    pub const fn new(inter_byte: Duration) -> Self {
        Self {
            decoder: Decoder::new(),
            inter_byte,
            deadline: None,
            error: None,
            selected: None,
            tx: [0; MAX_WIRE],
            tx_len: 0,
        }
    }

    /// The receiver's decoder, for its counters.
    #[must_use]
    pub const fn decoder(&self) -> &Decoder {
        &self.decoder
    }

    /// Whether a device with this number answers functions other than the selection: it is the one
    /// selected, it has the number 0, or none was selected yet (decision 8).
    #[must_use]
    pub fn is_selected(&self, device_number: u8) -> bool {
        device_number == 0 || self.selected.is_none_or(|selected| selected == device_number)
    }

    /// Takes received bytes in any chunking.
    pub fn handle_bytes(&mut self, now: Duration, bytes: &[u8], device: &mut impl Device) {
        if self.is_due(now) {
            self.handle_timeout(now, device);
        }
        self.run(bytes, device, None);
        if !bytes.is_empty() {
            self.rearm(now);
        }
    }

    /// Takes what the receiver reports in place of a character, whose byte must not be passed on.
    /// An open telegram ends here and is not carried out; unless a good one follows directly, an
    /// error telegram answers it.
    pub fn handle_line_error(&mut self, now: Duration, error: LineError, device: &mut impl Device) {
        if self.is_due(now) {
            self.handle_timeout(now, device);
        }
        self.decoder.gap();
        self.run(&[], device, Some(error));
        self.fail(error.codes(), device);
        self.rearm(now);
    }

    /// Ends an open telegram when the line was silent for too long; early calls do nothing.
    pub fn handle_timeout(&mut self, now: Duration, device: &mut impl Device) {
        if !self.is_due(now) {
            return;
        }
        self.deadline = None;
        self.decoder.gap();
        self.run(&[], device, None);
        if let Some(code) = self.error.take() {
            self.tx_len = Response::Error(code).encode(&mut self.tx).unwrap_or(0);
        }
    }

    /// When to call [`handle_timeout`](Self::handle_timeout); `None` = idle.
    #[must_use]
    pub const fn poll_timeout(&self) -> Option<Duration> {
        self.deadline
    }

    /// The bytes to send now, once.
    pub fn poll_transmit(&mut self, _now: Duration) -> Option<&[u8]> {
        match core::mem::take(&mut self.tx_len) {
            0 => None,
            len => self.tx.get(..len),
        }
    }

    fn is_due(&self, now: Duration) -> bool {
        self.deadline.is_some_and(|deadline| now >= deadline)
    }

    fn rearm(&mut self, now: Duration) {
        let open = self.decoder.in_telegram() || self.error.is_some();
        self.deadline = open.then(|| now.saturating_add(self.inter_byte));
    }

    /// `line_error` is what ended the telegram: a gap that it caused is not a failure of its own.
    fn run(&mut self, mut bytes: &[u8], device: &mut impl Device, line_error: Option<LineError>) {
        loop {
            let (taken, item) = self.decoder.decode(bytes);
            bytes = bytes.get(taken..).unwrap_or(&[]);
            match item {
                None => return,
                Some(Item::Damage(damage)) => match damage_codes(damage.kind) {
                    Some(codes) if line_error.is_none() => self.fail(codes, device),
                    _ => {}
                },
                Some(Item::Frame { frame, .. }) => {
                    self.error = None;
                    let number = device.device_number();
                    let (selected, tx) = (&mut self.selected, &mut self.tx);
                    self.tx_len = serve(&frame, selected, number, device, tx);
                }
            }
        }
    }

    /// Damage concerns the device that is selected, like the telegram that it befell.
    fn fail(&mut self, (code, failure): (ErrorCode, Failure), device: &mut impl Device) {
        if self.is_selected(device.device_number()) {
            device.store_failure(StoredFailure { axis: 0, failure });
            self.error = Some(code);
        }
    }
}

/// Carries one request out; returns the length of the answer in `tx`, 0 for none.
fn serve(
    frame: &Frame<'_>,
    selected: &mut Option<u8>,
    number: u8,
    device: &mut impl Device,
    tx: &mut [u8],
) -> usize {
    let request = Request::parse(frame);
    if let Ok(Request::SelectDevice(asked)) = request {
        *selected = Some(asked);
        if number != asked && number != 0 {
            return 0;
        }
    } else if number != 0 && selected.is_some_and(|selected| selected != number) {
        return 0;
    }
    let sent = match request {
        Ok(request) => request.check().and_then(|()| execute(&request, device, tx)),
        Err(_) => {
            device.store_failure(StoredFailure { axis: 0, failure: Failure::RECEIVE_COUNT });
            Err(ErrorCode::NUMBER)
        }
    };
    match sent {
        Ok(len) => len,
        Err(code) => Response::Error(code).encode(tx).unwrap_or(0),
    }
}

fn execute(request: &Request<'_>, device: &mut impl Device, tx: &mut [u8]) -> Result<usize, ErrorCode> {
    let mut buffer = [0; MAX_DATA];
    let response = match *request {
        Request::SelectDevice(number) => Response::Selected(number),
        Request::DeviceType => {
            let (device, axes) = device.device_type();
            Response::DeviceType { device, axes }
        }
        Request::OsVersion => Response::OsVersion(device.os_version()),
        Request::CustomVersion => Response::CustomVersion(device.custom_version()),
        Request::Failures => {
            let mut len = 0;
            let stored = (0..MAX_FAILURES as u8).map_while(|position| device.failure(position));
            for (pair, stored) in buffer.chunks_exact_mut(2).zip(stored) {
                pair.copy_from_slice(&[stored.axis, stored.failure.0]);
                len += 2;
            }
            Response::Failures(Failures::new(buffer.get(..len).unwrap_or(&[])))
        }
        Request::FailureCount => Response::FailureCount(device.failure_count()),
        Request::DeleteFailures => Response::FailuresDeleted(device.delete_failures()),
        Request::EraseFlash { bank } => device.erase_flash(bank).map(|()| Response::FlashErased { bank })?,
        Request::ReadFlash { bank, offset, count } => {
            let data = room(&mut buffer, count);
            device.read_flash(bank, offset, data)?;
            Response::FlashData { bank, data }
        }
        Request::WriteFlash { bank, enable, data } => {
            device.write_flash(bank, enable, data).map(|()| Response::FlashWritten { bank })?
        }
        Request::ReadRam { bank, offset, count } => {
            let data = room(&mut buffer, count);
            device.read_ram(bank, offset, data)?;
            Response::RamData { bank, data }
        }
        Request::WriteRam { bank, offset, data } => {
            device.write_ram(bank, offset, data).map(|()| Response::RamWritten { bank })?
        }
        Request::WriteFlashAt { bank, offset, data } => {
            device.write_flash_at(bank, offset, data).map(|()| Response::FlashWrittenAt { bank })?
        }
        Request::ReadParameter { index } => {
            Response::Parameter { index, value: device.read_parameter(index) }
        }
        Request::DescribeParameter { index } => {
            Response::ParameterDescription(Description { index, ..device.describe_parameter(index) })
        }
        Request::WriteParameter { index, value } => {
            let LoaderAnswer { code: loader, .. } = device.write_parameter(index, value);
            Response::ParameterWritten { index, loader }
        }
        Request::WriteParameterExtended { index, value } => {
            let LoaderAnswer { code: loader, text } = device.write_parameter(index, value);
            Response::ParameterWrittenExtended { index, loader, text }
        }
        Request::CallLoader => Response::LoaderCalled { offset: device.call_loader() },
        Request::SaveParameters => device.save_parameters().map(|()| Response::ParametersSaved)?,
        // FFh is reply only: an answer with it would be taken for an error telegram.
        Request::Raw { function: function::ERROR, .. } => return Err(ErrorCode::FUNCTION),
        Request::Raw { function, data } => {
            let len = device.own_function(function, data, &mut buffer)?.min(MAX_DATA);
            Response::Raw { function, data: buffer.get(..len).unwrap_or(&[]) }
        }
    };
    Ok(response.encode(tx).unwrap_or(0))
}

/// `Request::check` has bounded `count`.
fn room(buffer: &mut [u8; MAX_DATA], count: u8) -> &mut [u8] {
    let (room, _) = buffer.split_at_mut(usize::from(count).min(MAX_BANK_DATA));
    room
}
