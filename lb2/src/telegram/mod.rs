//! What telegrams say: one [`Request`] and one [`Response`] variant for every function and
//! sub-function of manual A, Appendix 1, and raw ones for functions unknown to us ("can be extended
//! at will with own functions").
//!
//! Multi-byte values are sent low byte first. `parse` takes a verified [`Frame`], `encode` writes
//! one; `parse` of what `encode` wrote gives the same value back.

mod request;
mod response;
mod text;

pub use request::Request;
pub use response::{Description, Failures, Response};
pub use text::Text;

use crate::frame::Frame;

/// Most data bytes that one telegram reads from or writes to a flash or RAM bank (error 25h above).
pub const MAX_BANK_DATA: usize = 128;
/// Bytes of a flash or RAM bank; offset and length may not pass its end (error 27h).
pub const BANK_LEN: usize = 0x1_0000;
/// Longest variant text of 31h in characters; its field has 9 bytes, zero-terminated.
pub const MAX_VARIANT: usize = 8;
/// Longest name of 31h in characters; its field has 21 bytes, zero-terminated.
pub const MAX_NAME: usize = 20;
/// Longest group of 31h in characters; its field has up to 26 bytes, zero-terminated.
pub const MAX_GROUP: usize = 25;
/// Longest loader message of 33h in bytes, its terminating zero included where there is room.
pub const MAX_MESSAGE: usize = 41;
/// Most failures that a device stores and 50h reads out.
pub const MAX_FAILURES: usize = 20;

/// Function numbers (manual A, Appendix 1, "Functions").
pub mod function {
    /// Select device.
    pub const SELECT: u8 = 0x00;
    /// Request device type.
    pub const DEVICE_TYPE: u8 = 0x40;
    /// Request the version number of the operating system.
    pub const OS_VERSION: u8 = 0x41;
    /// Request the version number of the customized software.
    pub const CUSTOM_VERSION: u8 = 0x43;
    /// Read out failures.
    pub const FAILURES: u8 = 0x50;
    /// Read out number of currently stored failures.
    pub const FAILURE_COUNT: u8 = 0x52;
    /// Delete all stored failures.
    pub const DELETE_FAILURES: u8 = 0x53;
    /// Extension for the MotionController; its first data byte is the sub-function.
    pub const EXTENSION: u8 = 0xCC;
    /// Error telegram, reply only.
    pub const ERROR: u8 = 0xFF;
}

/// Sub-function numbers of function CCh.
pub mod sub {
    /// Delete flash bank.
    pub const ERASE_FLASH: u8 = 0x21;
    /// Read flash bank.
    pub const READ_FLASH: u8 = 0x22;
    /// Write flash bank, from a pointer that the device moves on.
    pub const WRITE_FLASH: u8 = 0x23;
    /// Read RAM bank.
    pub const READ_RAM: u8 = 0x24;
    /// Write RAM bank.
    pub const WRITE_RAM: u8 = 0x25;
    /// Write flash bank with offset.
    pub const WRITE_FLASH_AT: u8 = 0x26;
    /// Read parameter, simple.
    pub const READ_PARAMETER: u8 = 0x30;
    /// Read parameter, extended.
    pub const DESCRIBE_PARAMETER: u8 = 0x31;
    /// Write parameter, simple (RAM).
    pub const WRITE_PARAMETER: u8 = 0x32;
    /// Write parameter, extended (RAM).
    pub const WRITE_PARAMETER_EXTENDED: u8 = 0x33;
    /// Call loader.
    pub const CALL_LOADER: u8 = 0x34;
    /// Write parameters safe against power failure into flash.
    pub const SAVE_PARAMETERS: u8 = 0x35;
}

/// Bank numbers (manual A, Appendix 1, 21h…26h).
pub mod bank {
    /// RAM bank 12.
    pub const RAM: u8 = 0x0C;
    /// Flash bank 15.
    pub const FLASH_15: u8 = 0x0F;
    /// Flash bank 16.
    pub const FLASH_16: u8 = 0x10;
}

/// The number byte is not one that the function permits: error 05h, failure 40.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("function {function:02X}h: number byte {found:02X}h, {minimum:02X}h to {maximum:02X}h expected")]
pub struct NumberError {
    /// Function byte of the telegram.
    pub function: u8,
    /// Least number byte that the function permits.
    pub minimum: u8,
    /// Greatest number byte that the function permits.
    pub maximum: u8,
    /// Number byte that came.
    pub found: u8,
}

/// What request and answer have in common, by which a master knows whose answer it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Echo {
    /// Function byte.
    pub function: u8,
    /// Sub-function byte of CCh.
    pub sub: Option<u8>,
    /// Device number, bank or parameter index where the answer repeats it, else 0.
    pub key: u16,
    /// Bytes read by 22h and 24h, else 0.
    pub len: u8,
}

impl core::fmt::Display for Echo {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:02X}h", self.function)?;
        if let Some(sub) = self.sub {
            write!(f, " {sub:02X}h")?;
        }
        match (self.function, self.sub) {
            (function::SELECT, _) => write!(f, " device {}", self.key),
            (_, Some(sub::READ_FLASH | sub::READ_RAM)) => write!(f, " bank {}, {} bytes", self.key, self.len),
            (_, Some(0x20..=0x2F)) => write!(f, " bank {}", self.key),
            (_, Some(sub::READ_PARAMETER..=sub::WRITE_PARAMETER_EXTENDED)) => write!(f, " [{:03}]", self.key),
            _ => Ok(()),
        }
    }
}

/// Name of a function, as manual A gives it; `sub` is the first data byte, used for CCh only.
/// `None` for functions unknown to us.
#[must_use]
pub const fn name(function: u8, sub: Option<u8>) -> Option<&'static str> {
    Some(match (function, sub) {
        (function::SELECT, _) => "Select device",
        (function::DEVICE_TYPE, _) => "Request device type",
        (function::OS_VERSION, _) => "Request OS version",
        (function::CUSTOM_VERSION, _) => "Request customized SW version",
        (function::FAILURES, _) => "Read out failures",
        (function::FAILURE_COUNT, _) => "Read number of stored failures",
        (function::DELETE_FAILURES, _) => "Delete all stored failures",
        (function::ERROR, _) => "Error telegram (reply only)",
        (function::EXTENSION, Some(sub)) => match sub {
            sub::ERASE_FLASH => "Delete flash bank",
            sub::READ_FLASH => "Read flash bank",
            sub::WRITE_FLASH => "Write flash bank",
            sub::READ_RAM => "Read RAM bank",
            sub::WRITE_RAM => "Write RAM bank",
            sub::WRITE_FLASH_AT => "Write flash bank with offset",
            sub::READ_PARAMETER => "Read parameter, simple",
            sub::DESCRIBE_PARAMETER => "Read parameter, extended",
            sub::WRITE_PARAMETER => "Write parameter, simple (RAM)",
            sub::WRITE_PARAMETER_EXTENDED => "Write parameter, extended (RAM)",
            sub::CALL_LOADER => "Call loader",
            sub::SAVE_PARAMETERS => "Save parameters to flash",
            _ => return None,
        },
        _ => return None,
    })
}

/// The data of `frame` if its number byte lies in `minimum..=maximum` data bytes.
fn data_of<'a>(frame: &Frame<'a>, minimum: usize, maximum: usize) -> Result<&'a [u8], NumberError> {
    let data = frame.data();
    if (minimum..=maximum).contains(&data.len()) {
        return Ok(data);
    }
    let number = |len: usize| u8::try_from(len + 2).unwrap_or(u8::MAX);
    Err(NumberError {
        function: frame.function(),
        minimum: number(minimum),
        maximum: number(maximum),
        found: frame.number(),
    })
}

/// Reads fields from the front of checked data; what is missing reads as zero.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        match self.0.split_first_chunk::<N>() {
            Some((head, rest)) => {
                self.0 = rest;
                *head
            }
            None => {
                self.0 = &[];
                [0; N]
            }
        }
    }

    fn u8(&mut self) -> u8 {
        let [byte] = self.bytes();
        byte
    }

    fn u16(&mut self) -> u16 {
        u16::from_le_bytes(self.bytes())
    }

    fn i32(&mut self) -> i32 {
        i32::from_le_bytes(self.bytes())
    }

    fn take(&mut self, len: usize) -> &'a [u8] {
        let (head, rest) = self.0.split_at_checked(len).unwrap_or((self.0, &[]));
        self.0 = rest;
        head
    }
}

/// Collects the data of one telegram; more than fits is remembered and refused when it is encoded.
struct Data {
    bytes: [u8; crate::frame::MAX_DATA],
    len: usize,
}

impl Data {
    const fn new() -> Self {
        Self { bytes: [0; crate::frame::MAX_DATA], len: 0 }
    }

    fn put(&mut self, bytes: &[u8]) -> &mut Self {
        if let Some(room) = self.bytes.get_mut(self.len..self.len + bytes.len()) {
            room.copy_from_slice(bytes);
        }
        self.len += bytes.len();
        self
    }

    fn encode(&self, function: u8, out: &mut [u8]) -> Result<usize, crate::frame::EncodeError> {
        match self.bytes.get(..self.len) {
            Some(data) => crate::frame::encode(function, data, out),
            None => Err(crate::frame::EncodeError::TooLong { len: self.len }),
        }
    }
}
