//! What a master asks.

use super::{BANK_LEN, Data, Echo, Fields, MAX_BANK_DATA, NumberError, bank, data_of, function, sub};
use crate::code::ErrorCode;
use crate::frame::{EncodeError, Frame, MAX_DATA};

/// A request of the master (manual A, Appendix 1, lines "S").
///
/// Offsets are byte offsets within a bank of 65536 bytes; parameter indices are 0…999; parameter
/// values are in display units, the decimal point ignored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Request<'a> {
    /// 00h: the device with this number (0…31), and a device with number 0, answer from now on.
    SelectDevice(u8),
    /// 40h
    DeviceType,
    /// 41h
    OsVersion,
    /// 43h
    CustomVersion,
    /// 50h
    Failures,
    /// 52h
    FailureCount,
    /// 53h
    DeleteFailures,
    /// CCh 21h: sets flash bank 15 or 16 to FFh.
    EraseFlash {
        /// 0Fh or 10h.
        bank: u8,
    },
    /// CCh 22h
    ReadFlash {
        /// 0Fh or 10h.
        bank: u8,
        /// First byte.
        offset: u16,
        /// 0…128 bytes.
        count: u8,
    },
    /// CCh 23h: writes from a pointer that moves on by itself; 21h resets it (decision 5).
    WriteFlash {
        /// 0Fh or 10h.
        bank: u8,
        /// `false` sends 00h "write protected", `true` 01h "not".
        enable: bool,
        /// 0…128 bytes, an even number.
        data: &'a [u8],
    },
    /// CCh 24h
    ReadRam {
        /// 0Ch.
        bank: u8,
        /// First byte.
        offset: u16,
        /// 0…128 bytes.
        count: u8,
    },
    /// CCh 25h
    WriteRam {
        /// 0Ch.
        bank: u8,
        /// First byte.
        offset: u16,
        /// 0…128 bytes.
        data: &'a [u8],
    },
    /// CCh 26h: no cell may be written twice without 21h between.
    WriteFlashAt {
        /// 0Fh or 10h.
        bank: u8,
        /// First byte.
        offset: u16,
        /// 0…128 bytes, an even number.
        data: &'a [u8],
    },
    /// CCh 30h
    ReadParameter {
        /// 0…999.
        index: u16,
    },
    /// CCh 31h
    DescribeParameter {
        /// 0…999.
        index: u16,
    },
    /// CCh 32h: 34h must follow directly, after one parameter or a block of them.
    WriteParameter {
        /// 0…999.
        index: u16,
        /// Display units.
        value: i32,
    },
    /// CCh 33h: as 32h, answered with the loader's message.
    WriteParameterExtended {
        /// 0…999.
        index: u16,
        /// Display units.
        value: i32,
    },
    /// CCh 34h
    CallLoader,
    /// CCh 35h
    SaveParameters,
    /// A function unknown to us, or CCh with an unknown sub-function (or none) in `data`.
    Raw {
        /// Function byte.
        function: u8,
        /// 0…253 bytes.
        data: &'a [u8],
    },
}

impl<'a> Request<'a> {
    /// Understands a verified telegram. Functions unknown to us come out as [`Request::Raw`].
    ///
    /// # Errors
    /// [`NumberError`] if the number byte is not one that the function permits.
    pub fn parse(frame: &Frame<'a>) -> Result<Self, NumberError> {
        let function = frame.function();
        Ok(match function {
            function::SELECT => Self::SelectDevice(Fields(data_of(frame, 1, 1)?).u8()),
            function::DEVICE_TYPE => data_of(frame, 0, 0).map(|_| Self::DeviceType)?,
            function::OS_VERSION => data_of(frame, 0, 0).map(|_| Self::OsVersion)?,
            function::CUSTOM_VERSION => data_of(frame, 0, 0).map(|_| Self::CustomVersion)?,
            function::FAILURES => data_of(frame, 0, 0).map(|_| Self::Failures)?,
            function::FAILURE_COUNT => data_of(frame, 0, 0).map(|_| Self::FailureCount)?,
            function::DELETE_FAILURES => data_of(frame, 0, 0).map(|_| Self::DeleteFailures)?,
            function::EXTENSION => return Self::parse_extension(frame),
            _ => Self::Raw { function, data: frame.data() },
        })
    }

    fn parse_extension(frame: &Frame<'a>) -> Result<Self, NumberError> {
        let fields = |minimum, maximum| {
            let mut fields = Fields(data_of(frame, minimum, maximum)?);
            let _sub = fields.u8();
            Ok(fields)
        };
        Ok(match frame.data().first() {
            Some(&sub::ERASE_FLASH) => Self::EraseFlash { bank: fields(2, 2)?.u8() },
            Some(&sub::READ_FLASH) => {
                let mut f = fields(5, 5)?;
                Self::ReadFlash { bank: f.u8(), offset: f.u16(), count: f.u8() }
            }
            Some(&sub::WRITE_FLASH) => {
                let mut f = fields(3, MAX_DATA)?;
                Self::WriteFlash { bank: f.u8(), enable: f.u8() != 0, data: f.0 }
            }
            Some(&sub::READ_RAM) => {
                let mut f = fields(5, 5)?;
                Self::ReadRam { bank: f.u8(), offset: f.u16(), count: f.u8() }
            }
            Some(&sub::WRITE_RAM) => {
                let mut f = fields(4, MAX_DATA)?;
                Self::WriteRam { bank: f.u8(), offset: f.u16(), data: f.0 }
            }
            Some(&sub::WRITE_FLASH_AT) => {
                let mut f = fields(4, MAX_DATA)?;
                Self::WriteFlashAt { bank: f.u8(), offset: f.u16(), data: f.0 }
            }
            Some(&sub::READ_PARAMETER) => Self::ReadParameter { index: fields(3, 3)?.u16() },
            Some(&sub::DESCRIBE_PARAMETER) => Self::DescribeParameter { index: fields(3, 3)?.u16() },
            Some(&sub::WRITE_PARAMETER) => {
                let mut f = fields(7, 7)?;
                Self::WriteParameter { index: f.u16(), value: f.i32() }
            }
            Some(&sub::WRITE_PARAMETER_EXTENDED) => {
                let mut f = fields(7, 7)?;
                Self::WriteParameterExtended { index: f.u16(), value: f.i32() }
            }
            Some(&sub::CALL_LOADER) => fields(1, 1).map(|_| Self::CallLoader)?,
            Some(&sub::SAVE_PARAMETERS) => fields(1, 1).map(|_| Self::SaveParameters)?,
            _ => Self::Raw { function: function::EXTENSION, data: frame.data() },
        })
    }

    /// Writes the telegram to the front of `out` and returns its length on the wire.
    ///
    /// # Errors
    /// As [`crate::frame::encode`].
    pub fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let mut data = Data::new();
        if let Some(sub) = self.sub() {
            data.put(&[sub]);
        }
        match *self {
            Self::SelectDevice(number) => data.put(&[number]),
            Self::DeviceType
            | Self::OsVersion
            | Self::CustomVersion
            | Self::Failures
            | Self::FailureCount
            | Self::DeleteFailures
            | Self::CallLoader
            | Self::SaveParameters => &mut data,
            Self::EraseFlash { bank } => data.put(&[bank]),
            Self::ReadFlash { bank, offset, count } | Self::ReadRam { bank, offset, count } => {
                data.put(&[bank]).put(&offset.to_le_bytes()).put(&[count])
            }
            Self::WriteFlash { bank, enable, data: bytes } => data.put(&[bank, u8::from(enable)]).put(bytes),
            Self::WriteRam { bank, offset, data: bytes }
            | Self::WriteFlashAt { bank, offset, data: bytes } => {
                data.put(&[bank]).put(&offset.to_le_bytes()).put(bytes)
            }
            Self::ReadParameter { index } | Self::DescribeParameter { index } => {
                data.put(&index.to_le_bytes())
            }
            Self::WriteParameter { index, value } | Self::WriteParameterExtended { index, value } => {
                data.put(&index.to_le_bytes()).put(&value.to_le_bytes())
            }
            Self::Raw { data: bytes, .. } => data.put(bytes),
        };
        data.encode(self.function(), out)
    }

    /// The function byte.
    #[must_use]
    pub const fn function(&self) -> u8 {
        match self {
            Self::SelectDevice(_) => function::SELECT,
            Self::DeviceType => function::DEVICE_TYPE,
            Self::OsVersion => function::OS_VERSION,
            Self::CustomVersion => function::CUSTOM_VERSION,
            Self::Failures => function::FAILURES,
            Self::FailureCount => function::FAILURE_COUNT,
            Self::DeleteFailures => function::DELETE_FAILURES,
            Self::Raw { function, .. } => *function,
            _ => function::EXTENSION,
        }
    }

    /// The sub-function byte of CCh; `None` for other functions and for [`Request::Raw`], whose
    /// data already begin with it.
    #[must_use]
    pub const fn sub(&self) -> Option<u8> {
        Some(match self {
            Self::EraseFlash { .. } => sub::ERASE_FLASH,
            Self::ReadFlash { .. } => sub::READ_FLASH,
            Self::WriteFlash { .. } => sub::WRITE_FLASH,
            Self::ReadRam { .. } => sub::READ_RAM,
            Self::WriteRam { .. } => sub::WRITE_RAM,
            Self::WriteFlashAt { .. } => sub::WRITE_FLASH_AT,
            Self::ReadParameter { .. } => sub::READ_PARAMETER,
            Self::DescribeParameter { .. } => sub::DESCRIBE_PARAMETER,
            Self::WriteParameter { .. } => sub::WRITE_PARAMETER,
            Self::WriteParameterExtended { .. } => sub::WRITE_PARAMETER_EXTENDED,
            Self::CallLoader => sub::CALL_LOADER,
            Self::SaveParameters => sub::SAVE_PARAMETERS,
            _ => return None,
        })
    }

    /// What an answer to this request repeats of it.
    #[must_use]
    pub fn echo(&self) -> Echo {
        let (key, len) = match *self {
            Self::SelectDevice(number) => (u16::from(number), 0),
            Self::EraseFlash { bank }
            | Self::WriteFlash { bank, .. }
            | Self::WriteRam { bank, .. }
            | Self::WriteFlashAt { bank, .. } => (u16::from(bank), 0),
            Self::ReadFlash { bank, count, .. } | Self::ReadRam { bank, count, .. } => {
                (u16::from(bank), count)
            }
            Self::ReadParameter { index }
            | Self::DescribeParameter { index }
            | Self::WriteParameter { index, .. }
            | Self::WriteParameterExtended { index, .. } => (index, 0),
            _ => (0, 0),
        };
        let sub = match *self {
            Self::Raw { function: function::EXTENSION, data } => data.first().copied(),
            _ => self.sub(),
        };
        Echo { function: self.function(), sub, key, len }
    }

    /// Whether sending the request twice has the same effect as sending it once: reads and the
    /// selection. Of [`Request::Raw`] that is not known, so it counts as a write.
    #[must_use]
    pub const fn is_repeatable(&self) -> bool {
        matches!(
            self,
            Self::SelectDevice(_)
                | Self::DeviceType
                | Self::OsVersion
                | Self::CustomVersion
                | Self::Failures
                | Self::FailureCount
                | Self::ReadFlash { .. }
                | Self::ReadRam { .. }
                | Self::ReadParameter { .. }
                | Self::DescribeParameter { .. }
        )
    }

    /// Checks what a device checks before it touches a bank, in the order 21h, 25h, 26h, 27h.
    /// Requests without a bank always pass.
    ///
    /// # Errors
    /// [`ErrorCode::BANK`] unless the bank is one of the function's, [`ErrorCode::TOO_MANY`] above
    /// 128 bytes, [`ErrorCode::UNEVEN`] for an odd number of bytes to flash, [`ErrorCode::RANGE`] if
    /// offset and length pass the bank's end.
    pub const fn check(&self) -> Result<(), ErrorCode> {
        let (flash, bank, offset, len) = match self {
            Self::EraseFlash { bank } => (true, *bank, 0, 0),
            Self::ReadFlash { bank, offset, count } => (true, *bank, *offset, *count as usize),
            Self::WriteFlash { bank, data, .. } => (true, *bank, 0, data.len()),
            Self::WriteFlashAt { bank, offset, data } => (true, *bank, *offset, data.len()),
            Self::ReadRam { bank, offset, count } => (false, *bank, *offset, *count as usize),
            Self::WriteRam { bank, offset, data } => (false, *bank, *offset, data.len()),
            _ => return Ok(()),
        };
        let known = if flash { matches!(bank, bank::FLASH_15 | bank::FLASH_16) } else { bank == bank::RAM };
        if !known {
            Err(ErrorCode::BANK)
        } else if len > MAX_BANK_DATA {
            Err(ErrorCode::TOO_MANY)
        } else if matches!(self, Self::WriteFlash { .. } | Self::WriteFlashAt { .. }) && len % 2 != 0 {
            Err(ErrorCode::UNEVEN)
        } else if offset as usize + len > BANK_LEN {
            Err(ErrorCode::RANGE)
        } else {
            Ok(())
        }
    }
}
