//! LB2 on an open port: a blocking master and a blocking device, driven by the machine's clock.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::io;
use std::time::Instant;

use lb2::code::{ErrorCode, LoaderCode, StoredFailure, Version};
use lb2::device::{Device, DeviceEngine};
use lb2::frame::MAX_WIRE;
use lb2::master::{Config, Event, Master, Mismatch, Outcome, SubmitError, TimedOut};
use lb2::telegram::{Description, MAX_BANK_DATA, Request, Response};

use crate::port::Port;

/// Times for a workstation: its serial adapters hold bytes back for up to 16 ms, and its scheduler
/// is in no hurry, so both are longer than the protocol's own.
pub const TIMES: Config =
    Config { answer: Duration::from_millis(250), inter_byte: Duration::from_millis(100) };

/// Why a call failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CallError {
    /// Nothing, or nothing complete, came in time.
    #[error("no answer to function {function:02X}h{}", heard(.timed_out))]
    NoAnswer {
        /// Function byte of the request.
        function: u8,
        /// How often it was sent, and what damage was heard.
        timed_out: TimedOut,
    },
    /// The device answered with an error telegram.
    #[error("the device refused function {function:02X}h: {code} ({:02X}h)", .code.0)]
    Refused {
        /// Function byte of the request.
        function: u8,
        /// Its code.
        code: ErrorCode,
    },
    /// Something answered that does not belong to the request.
    #[error("wrong answer: {0}")]
    WrongEcho(Mismatch),
    /// The port failed.
    #[error("the port failed: {0}")]
    Port(#[from] io::Error),
    /// The request cannot be sent.
    #[error(transparent)]
    Submit(#[from] SubmitError),
}

fn heard(timed_out: &TimedOut) -> String {
    let attempts = match timed_out.attempts {
        0 | 1 => String::new(),
        attempts => format!(" in {attempts} attempts"),
    };
    match timed_out.damage {
        Some(damage) => format!("{attempts}; damage on the line: {damage}"),
        None => attempts,
    }
}

/// A remark that does not fail a call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Remark {
    /// Two devices answered one request.
    SecondAnswer,
    /// An answer came after its time.
    Late,
}

/// A blocking LB2 master.
pub struct Client {
    port: Box<dyn Port>,
    master: Master,
    start: Instant,
    retries: u8,
    remarks: Vec<Remark>,
}

impl core::fmt::Debug for Client {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Client").field("retries", &self.retries).finish_non_exhaustive()
    }
}

impl Client {
    /// A master on `port` that repeats reads up to `retries` times. Writes are never repeated.
    #[must_use]
    pub fn new(port: Box<dyn Port>, times: Config, retries: u8) -> Self {
        Self { port, master: Master::new(times), start: Instant::now(), retries, remarks: Vec::new() }
    }

    /// What was remarked since the last call of this function.
    pub fn take_remarks(&mut self) -> Vec<Remark> {
        core::mem::take(&mut self.remarks)
    }

    /// Sends a request, waits for its outcome and hands the answer to `use_answer`.
    ///
    /// # Errors
    /// [`CallError`] tells silence, refusal, wrong answers and a failed port apart.
    pub fn call<T>(
        &mut self,
        request: &Request<'_>,
        use_answer: impl FnOnce(Response<'_>) -> T,
    ) -> Result<T, CallError> {
        let function = request.function();
        let retries = if request.is_repeatable() { self.retries } else { 0 };
        self.master.submit(request, retries)?;
        let mut buffer = [0; MAX_WIRE];
        loop {
            while let Some(event) = self.master.poll_event() {
                match event {
                    Event::Outcome { outcome, .. } => {
                        return match outcome {
                            Outcome::Done(response) => Ok(use_answer(response)),
                            Outcome::Refused(code) => Err(CallError::Refused { function, code }),
                            Outcome::TimedOut(timed_out) => Err(CallError::NoAnswer { function, timed_out }),
                            Outcome::WrongEcho(mismatch) => Err(CallError::WrongEcho(mismatch)),
                            // Nobody else can cancel what we wait for.
                            _ => Err(io::Error::from(io::ErrorKind::Interrupted).into()),
                        };
                    }
                    Event::SecondAnswer(_) => self.remarks.push(Remark::SecondAnswer),
                    Event::Late(_) => self.remarks.push(Remark::Late),
                    _ => {}
                }
            }
            if let Err(error) = self.turn(&mut buffer) {
                self.abandon();
                return Err(error.into());
            }
        }
    }

    fn turn(&mut self, buffer: &mut [u8]) -> io::Result<()> {
        if let Some(bytes) = self.master.poll_transmit(self.start.elapsed()) {
            self.port.send(bytes)?;
            self.master.handle_transmit_done(self.start.elapsed());
        }
        let now = self.start.elapsed();
        let timeout = self.master.poll_timeout().map_or(Duration::ZERO, |at| at.saturating_sub(now));
        match self.port.receive(buffer, timeout)? {
            0 => self.master.handle_timeout(self.start.elapsed()),
            len => self.master.handle_bytes(self.start.elapsed(), buffer.get(..len).unwrap_or(&[])),
        }
        Ok(())
    }

    /// After the port failed: a fresh engine, for the old one waits for a line that is gone.
    fn abandon(&mut self) {
        self.master = Master::new(self.master.config());
    }

    /// 00h: the device with this number answers from now on.
    ///
    /// # Errors
    /// As [`call`](Self::call); no answer means that there is no such device.
    pub fn select(&mut self, device: u8) -> Result<(), CallError> {
        self.call(&Request::SelectDevice(device), |_| ())
    }

    /// 40h: model number and greatest number of axes.
    ///
    /// # Errors
    /// As [`call`](Self::call).
    pub fn device_type(&mut self) -> Result<(u16, u8), CallError> {
        self.ask(&Request::DeviceType, |response| match response {
            Response::DeviceType { device, axes } => Some((device, axes)),
            _ => None,
        })
    }

    /// 41h
    ///
    /// # Errors
    /// As [`call`](Self::call).
    pub fn os_version(&mut self) -> Result<Version, CallError> {
        self.ask(&Request::OsVersion, |response| match response {
            Response::OsVersion(version) => Some(version),
            _ => None,
        })
    }

    /// 43h
    ///
    /// # Errors
    /// As [`call`](Self::call).
    pub fn custom_version(&mut self) -> Result<Version, CallError> {
        self.ask(&Request::CustomVersion, |response| match response {
            Response::CustomVersion(version) => Some(version),
            _ => None,
        })
    }

    /// 50h
    ///
    /// # Errors
    /// As [`call`](Self::call).
    pub fn failures(&mut self) -> Result<Vec<StoredFailure>, CallError> {
        self.ask(&Request::Failures, |response| match response {
            Response::Failures(failures) => Some(failures.iter().collect()),
            _ => None,
        })
    }

    /// 53h: deletes all failures; returns how many there were.
    ///
    /// # Errors
    /// As [`call`](Self::call).
    pub fn delete_failures(&mut self) -> Result<u8, CallError> {
        self.ask(&Request::DeleteFailures, |response| match response {
            Response::FailuresDeleted(count) => Some(count),
            _ => None,
        })
    }

    /// 30h
    ///
    /// # Errors
    /// As [`call`](Self::call).
    pub fn read_parameter(&mut self, index: u16) -> Result<i32, CallError> {
        self.ask(&Request::ReadParameter { index }, |response| match response {
            Response::Parameter { value, .. } => Some(value),
            _ => None,
        })
    }

    /// 31h
    ///
    /// # Errors
    /// As [`call`](Self::call).
    pub fn describe_parameter<T>(
        &mut self,
        index: u16,
        use_description: impl FnOnce(Description<'_>) -> T,
    ) -> Result<T, CallError> {
        self.ask(&Request::DescribeParameter { index }, |response| match response {
            Response::ParameterDescription(description) => Some(use_description(description)),
            _ => None,
        })
    }

    /// 33h: what the loader says of the value, and its message.
    ///
    /// # Errors
    /// As [`call`](Self::call).
    pub fn write_parameter(&mut self, index: u16, value: i32) -> Result<(LoaderCode, String), CallError> {
        self.ask(&Request::WriteParameterExtended { index, value }, |response| match response {
            Response::ParameterWrittenExtended { loader, text, .. } => Some((loader, text.to_string())),
            _ => None,
        })
    }

    /// 34h: the parameter at fault, if any.
    ///
    /// # Errors
    /// As [`call`](Self::call).
    pub fn call_loader(&mut self) -> Result<Option<i32>, CallError> {
        self.ask(&Request::CallLoader, |response| match response {
            Response::LoaderCalled { offset: -1 } => Some(None),
            Response::LoaderCalled { offset } => Some(Some(offset)),
            _ => None,
        })
    }

    /// 35h
    ///
    /// # Errors
    /// As [`call`](Self::call).
    pub fn save_parameters(&mut self) -> Result<(), CallError> {
        self.call(&Request::SaveParameters, |_| ())
    }

    /// 22h or 24h: reads up to 128 bytes of a bank into `out`.
    ///
    /// # Errors
    /// As [`call`](Self::call).
    pub fn read_bank(&mut self, flash: bool, bank: u8, offset: u16, out: &mut [u8]) -> Result<(), CallError> {
        let count = out.len().min(MAX_BANK_DATA) as u8;
        let request = match flash {
            true => Request::ReadFlash { bank, offset, count },
            false => Request::ReadRam { bank, offset, count },
        };
        self.ask(&request, |response| match response {
            Response::FlashData { data, .. } | Response::RamData { data, .. } => {
                out.get_mut(..data.len())?.copy_from_slice(data);
                Some(())
            }
            _ => None,
        })
    }

    fn ask<T>(
        &mut self,
        request: &Request<'_>,
        pick: impl FnOnce(Response<'_>) -> Option<T>,
    ) -> Result<T, CallError> {
        // The engine has matched the answer with the request: the kind is right.
        self.call(request, pick)?
            .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidData, "answer of another kind").into())
    }
}

/// Answers for `device` on `port` until `stop` is set. `pass` is called between telegrams with the
/// time that has passed since its last call.
///
/// # Errors
/// The port failed or is gone.
pub fn serve<D: Device>(
    port: &mut dyn Port,
    device: &mut D,
    stop: &AtomicBool,
    mut pass: impl FnMut(&mut D, Duration),
) -> io::Result<()> {
    const TURN: Duration = Duration::from_millis(20);
    let start = Instant::now();
    let mut engine = DeviceEngine::new(TIMES.inter_byte);
    let mut passed = Duration::ZERO;
    let mut buffer = [0; 4 * MAX_WIRE];
    while !stop.load(Ordering::Relaxed) {
        let now = start.elapsed();
        let timeout = engine.poll_timeout().map_or(TURN, |at| at.saturating_sub(now).min(TURN));
        let len = port.receive(&mut buffer, timeout)?;
        let now = start.elapsed();
        engine.handle_timeout(now, device);
        engine.handle_bytes(now, buffer.get(..len).unwrap_or(&[]), device);
        if let Some(answer) = engine.poll_transmit(now) {
            port.send(answer)?;
        }
        pass(device, now.saturating_sub(passed));
        passed = now;
    }
    Ok(())
}
