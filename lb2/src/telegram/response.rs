//! What a device answers.

use super::{
    Data, Echo, Fields, MAX_FAILURES, MAX_GROUP, MAX_MESSAGE, MAX_NAME, MAX_VARIANT, NumberError, Text,
    data_of, function, sub,
};
use crate::code::{ErrorCode, Failure, LoaderCode, StoredFailure, Version};
use crate::frame::{EncodeError, Frame, MAX_DATA};

/// An answer of the device (manual A, Appendix 1, lines "R").
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Response<'a> {
    /// 00h: the device number, as it was asked for.
    Selected(u8),
    /// 40h
    DeviceType {
        /// Model number in binary: 2026h = GEL 8230, 2027h = GEL 8231.
        device: u16,
        /// Greatest number of axes, 6.
        axes: u8,
    },
    /// 41h
    OsVersion(Version),
    /// 43h: 0.00 where no customized software is implemented.
    CustomVersion(Version),
    /// 50h
    Failures(Failures<'a>),
    /// 52h: 0…20 stored failures.
    FailureCount(u8),
    /// 53h: failures that were deleted, 0…20 (decision 3).
    FailuresDeleted(u8),
    /// CCh 21h
    FlashErased {
        /// As asked for.
        bank: u8,
    },
    /// CCh 22h
    FlashData {
        /// As asked for.
        bank: u8,
        /// As many bytes as asked for.
        data: &'a [u8],
    },
    /// CCh 23h
    FlashWritten {
        /// As asked for.
        bank: u8,
    },
    /// CCh 24h
    RamData {
        /// As asked for.
        bank: u8,
        /// As many bytes as asked for.
        data: &'a [u8],
    },
    /// CCh 25h
    RamWritten {
        /// As asked for.
        bank: u8,
    },
    /// CCh 26h
    FlashWrittenAt {
        /// As asked for.
        bank: u8,
    },
    /// CCh 30h
    Parameter {
        /// As asked for.
        index: u16,
        /// Display units.
        value: i32,
    },
    /// CCh 31h
    ParameterDescription(Description<'a>),
    /// CCh 32h
    ParameterWritten {
        /// As asked for.
        index: u16,
        /// What the loader says of the value.
        loader: LoaderCode,
    },
    /// CCh 33h
    ParameterWrittenExtended {
        /// As asked for.
        index: u16,
        /// What the loader says of the value.
        loader: LoaderCode,
        /// The loader's message.
        text: Text<'a>,
    },
    /// CCh 34h
    LoaderCalled {
        /// Index of the first parameter at fault, −1 for none.
        offset: i32,
    },
    /// CCh 35h
    ParametersSaved,
    /// FFh in place of the function asked for.
    Error(ErrorCode),
    /// A function unknown to us, or CCh with an unknown sub-function (or none) in `data`.
    Raw {
        /// Function byte.
        function: u8,
        /// 0…253 bytes.
        data: &'a [u8],
    },
}

/// What 31h says of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Description<'a> {
    /// Parameter index, 0…999.
    pub index: u16,
    /// Text of the choice that is set, at most 8 characters.
    pub variant: Text<'a>,
    /// Least value, display units.
    pub minimum: i32,
    /// Greatest value, display units.
    pub maximum: i32,
    /// Factory default, display units.
    pub default: i32,
    /// Name, at most 20 characters.
    pub name: Text<'a>,
    /// Group, at most 25 characters.
    pub group: Text<'a>,
}

/// The failures of a 50h answer: pairs of axis and failure number.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Failures<'a>(&'a [u8]);

impl<'a> Failures<'a> {
    /// Takes pairs of axis (1…6, 0 = system) and failure number, at most 20; a byte left over and
    /// pairs beyond the 20th are not part of it.
    #[must_use]
    pub fn new(pairs: &'a [u8]) -> Self {
        let len = (pairs.len() & !1).min(2 * MAX_FAILURES);
        Self(pairs.get(..len).unwrap_or(&[]))
    }

    /// Number of failures, 0…20.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.0.len() / 2
    }

    /// Whether no failure is stored.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The failures, in the order of the telegram.
    pub fn iter(&self) -> impl Iterator<Item = StoredFailure> + 'a {
        let (pairs, _) = self.0.as_chunks::<2>();
        pairs.iter().map(|&[axis, failure]| StoredFailure { axis, failure: Failure(failure) })
    }
}

impl core::fmt::Debug for Failures<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

/// Fixed part of a 31h answer: sub, index, variant, minimum, maximum, default, name.
const DESCRIPTION: usize = 1 + 2 + (MAX_VARIANT + 1) + 3 * 4 + (MAX_NAME + 1);

impl<'a> Response<'a> {
    /// Understands a verified telegram. Functions unknown to us come out as [`Response::Raw`].
    ///
    /// # Errors
    /// [`NumberError`] if the number byte is not one that an answer of the function can have.
    pub fn parse(frame: &Frame<'a>) -> Result<Self, NumberError> {
        let function = frame.function();
        let fields = |len| data_of(frame, len, len).map(Fields);
        let version = || {
            let mut f = fields(4)?;
            Ok(Version { version: f.u16(), revision: f.u16() })
        };
        Ok(match function {
            function::SELECT => Self::Selected(fields(1)?.u8()),
            function::DEVICE_TYPE => {
                let mut f = fields(3)?;
                Self::DeviceType { device: f.u16(), axes: f.u8() }
            }
            function::OS_VERSION => Self::OsVersion(version()?),
            function::CUSTOM_VERSION => Self::CustomVersion(version()?),
            function::FAILURES => {
                let data = data_of(frame, 0, 2 * MAX_FAILURES)?;
                if data.len() % 2 != 0 {
                    fields(data.len() - 1)?;
                }
                Self::Failures(Failures::new(data))
            }
            function::FAILURE_COUNT => Self::FailureCount(fields(1)?.u8()),
            function::DELETE_FAILURES => Self::FailuresDeleted(fields(1)?.u8()),
            function::ERROR => Self::Error(ErrorCode(fields(1)?.u8())),
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
            Some(&sub::ERASE_FLASH) => Self::FlashErased { bank: fields(2, 2)?.u8() },
            Some(&sub::READ_FLASH) => {
                let mut f = fields(2, MAX_DATA)?;
                Self::FlashData { bank: f.u8(), data: f.0 }
            }
            Some(&sub::WRITE_FLASH) => Self::FlashWritten { bank: fields(2, 2)?.u8() },
            Some(&sub::READ_RAM) => {
                let mut f = fields(2, MAX_DATA)?;
                Self::RamData { bank: f.u8(), data: f.0 }
            }
            Some(&sub::WRITE_RAM) => Self::RamWritten { bank: fields(2, 2)?.u8() },
            Some(&sub::WRITE_FLASH_AT) => Self::FlashWrittenAt { bank: fields(2, 2)?.u8() },
            Some(&sub::READ_PARAMETER) => {
                let mut f = fields(7, 7)?;
                Self::Parameter { index: f.u16(), value: f.i32() }
            }
            Some(&sub::DESCRIBE_PARAMETER) => {
                let mut f = fields(DESCRIPTION, DESCRIPTION + MAX_GROUP + 1)?;
                Self::ParameterDescription(Description {
                    index: f.u16(),
                    variant: Text::limited(f.take(MAX_VARIANT + 1), MAX_VARIANT),
                    minimum: f.i32(),
                    maximum: f.i32(),
                    default: f.i32(),
                    name: Text::limited(f.take(MAX_NAME + 1), MAX_NAME),
                    group: Text::limited(f.0, MAX_GROUP),
                })
            }
            Some(&sub::WRITE_PARAMETER) => {
                let mut f = fields(4, 4)?;
                Self::ParameterWritten { index: f.u16(), loader: LoaderCode(f.u8()) }
            }
            Some(&sub::WRITE_PARAMETER_EXTENDED) => {
                let mut f = fields(4, 4 + MAX_MESSAGE)?;
                Self::ParameterWrittenExtended {
                    index: f.u16(),
                    loader: LoaderCode(f.u8()),
                    text: Text::new(f.0),
                }
            }
            Some(&sub::CALL_LOADER) => Self::LoaderCalled { offset: fields(5, 5)?.i32() },
            Some(&sub::SAVE_PARAMETERS) => fields(1, 1).map(|_| Self::ParametersSaved)?,
            _ => Self::Raw { function: function::EXTENSION, data: frame.data() },
        })
    }

    /// Writes the telegram to the front of `out` and returns its length on the wire. Texts longer
    /// than their field are cut to it.
    ///
    /// # Errors
    /// As [`crate::frame::encode`].
    pub fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let mut data = Data::new();
        if let Some(sub) = self.sub() {
            data.put(&[sub]);
        }
        match *self {
            Self::Selected(byte)
            | Self::FailureCount(byte)
            | Self::FailuresDeleted(byte)
            | Self::FlashErased { bank: byte }
            | Self::FlashWritten { bank: byte }
            | Self::RamWritten { bank: byte }
            | Self::FlashWrittenAt { bank: byte }
            | Self::Error(ErrorCode(byte)) => data.put(&[byte]),
            Self::DeviceType { device, axes } => data.put(&device.to_le_bytes()).put(&[axes]),
            Self::OsVersion(v) | Self::CustomVersion(v) => {
                data.put(&v.version.to_le_bytes()).put(&v.revision.to_le_bytes())
            }
            Self::Failures(Failures(pairs)) => data.put(pairs),
            Self::FlashData { bank, data: bytes } | Self::RamData { bank, data: bytes } => {
                data.put(&[bank]).put(bytes)
            }
            Self::Parameter { index, value } => data.put(&index.to_le_bytes()).put(&value.to_le_bytes()),
            Self::ParameterDescription(d) => data
                .put(&d.index.to_le_bytes())
                .put(&field::<{ MAX_VARIANT + 1 }>(d.variant))
                .put(&d.minimum.to_le_bytes())
                .put(&d.maximum.to_le_bytes())
                .put(&d.default.to_le_bytes())
                .put(&field::<{ MAX_NAME + 1 }>(d.name))
                .put(cut(d.group, MAX_GROUP))
                .put(&[0]),
            Self::ParameterWritten { index, loader } => data.put(&index.to_le_bytes()).put(&[loader.0]),
            Self::ParameterWrittenExtended { index, loader, text } => {
                let text = cut(text, MAX_MESSAGE);
                data.put(&index.to_le_bytes()).put(&[loader.0]).put(text);
                if text.len() < MAX_MESSAGE { data.put(&[0]) } else { &mut data }
            }
            Self::LoaderCalled { offset } => data.put(&offset.to_le_bytes()),
            Self::ParametersSaved => &mut data,
            Self::Raw { data: bytes, .. } => data.put(bytes),
        };
        data.encode(self.function(), out)
    }

    /// The function byte.
    #[must_use]
    pub const fn function(&self) -> u8 {
        match self {
            Self::Selected(_) => function::SELECT,
            Self::DeviceType { .. } => function::DEVICE_TYPE,
            Self::OsVersion(_) => function::OS_VERSION,
            Self::CustomVersion(_) => function::CUSTOM_VERSION,
            Self::Failures(_) => function::FAILURES,
            Self::FailureCount(_) => function::FAILURE_COUNT,
            Self::FailuresDeleted(_) => function::DELETE_FAILURES,
            Self::Error(_) => function::ERROR,
            Self::Raw { function, .. } => *function,
            _ => function::EXTENSION,
        }
    }

    /// The sub-function byte of CCh; `None` for other functions and for [`Response::Raw`], whose
    /// data already begin with it.
    #[must_use]
    pub const fn sub(&self) -> Option<u8> {
        Some(match self {
            Self::FlashErased { .. } => sub::ERASE_FLASH,
            Self::FlashData { .. } => sub::READ_FLASH,
            Self::FlashWritten { .. } => sub::WRITE_FLASH,
            Self::RamData { .. } => sub::READ_RAM,
            Self::RamWritten { .. } => sub::WRITE_RAM,
            Self::FlashWrittenAt { .. } => sub::WRITE_FLASH_AT,
            Self::Parameter { .. } => sub::READ_PARAMETER,
            Self::ParameterDescription(_) => sub::DESCRIBE_PARAMETER,
            Self::ParameterWritten { .. } => sub::WRITE_PARAMETER,
            Self::ParameterWrittenExtended { .. } => sub::WRITE_PARAMETER_EXTENDED,
            Self::LoaderCalled { .. } => sub::CALL_LOADER,
            Self::ParametersSaved => sub::SAVE_PARAMETERS,
            _ => return None,
        })
    }

    /// What this answer repeats of its request; `None` for an error telegram, which answers every
    /// request.
    #[must_use]
    pub fn echo(&self) -> Option<Echo> {
        let (key, len) = match *self {
            Self::Error(_) => return None,
            Self::Selected(number) => (u16::from(number), 0),
            Self::FlashErased { bank }
            | Self::FlashWritten { bank }
            | Self::RamWritten { bank }
            | Self::FlashWrittenAt { bank } => (u16::from(bank), 0),
            Self::FlashData { bank, data } | Self::RamData { bank, data } => (u16::from(bank), data.len()),
            Self::Parameter { index, .. }
            | Self::ParameterDescription(Description { index, .. })
            | Self::ParameterWritten { index, .. }
            | Self::ParameterWrittenExtended { index, .. } => (index, 0),
            _ => (0, 0),
        };
        let sub = match *self {
            Self::Raw { function: function::EXTENSION, data } => data.first().copied(),
            _ => self.sub(),
        };
        Some(Echo { function: self.function(), sub, key, len: u8::try_from(len).unwrap_or(u8::MAX) })
    }
}

fn cut(text: Text<'_>, max: usize) -> &[u8] {
    let bytes = text.as_bytes();
    bytes.get(..max).unwrap_or(bytes)
}

/// A text in a field of `N` bytes, at least one of them the terminating zero.
fn field<const N: usize>(text: Text<'_>) -> [u8; N] {
    let mut field = [0; N];
    for (slot, &byte) in field.iter_mut().take(N - 1).zip(text.as_bytes()) {
        *slot = byte;
    }
    field
}
