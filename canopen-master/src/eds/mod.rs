//! Device description files: EDS and DCF (CiA 306-1), XDD and XDC (CiA 311), concise DCF (CiA 302-3).
//!
//! [`read`] takes the bytes of a file, whatever its format and encoding, and gives a [`Device`]: the
//! objects with data type, access, limits, default, configured value, and everything else the file
//! says. Reading is lenient: what can be understood is, and every doubt is a [`Diagnostic`] with its
//! line; [`check`] adds every violation of the standard. [`Reading::update`] writes a changed device back into its file, leaving every line as it
//! stands that the change does not concern; [`write_eds`] writes a file anew.
//!
//! Clauses are those of CiA 306-1 version 1.4, CiA 301 version 4.2 and CiA 311.

mod check;
mod compact_pdo;
mod concise;
mod diagnostic;
mod encoding;
pub mod ini;
mod model;
mod name;
mod objects;
mod reader;
mod standard;
mod types;
mod update;
mod value;
mod writer;
mod xdd;

use alloc::borrow::Cow;
use alloc::string::String;
use alloc::vec::Vec;

pub use crate::data_type::DataType;
pub use check::check;
pub use concise::{ConciseEntry, ConciseError, ConciseValueError, encode_concise, parse_concise};
pub use diagnostic::{Diagnostic, Rule, Severity};
pub use encoding::Encoding;
pub use model::{Device, Entry, Fields, Module, Object, Section};
pub use standard::{StandardObject, standard_name, standard_object, standard_sub_object};
pub use types::{Access, List, ObjectType, PdoMapping};
pub use value::{Number, ValueError, fit, from_bytes, to_bytes};
pub use writer::{lost_in_eds, write_eds};
pub use xdd::write_xdd;

use reader::Findings;
use update::Whole;

/// How a file is written.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum Format {
    /// EDS or DCF: sections and entries (CiA 306-1).
    Eds,
    /// XDD or XDC: XML (CiA 311).
    Xdd,
}

/// A file as it came.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Source {
    /// How it is written.
    pub format: Format,
    /// What its bytes stand for.
    pub encoding: Encoding,
    /// Its text.
    pub text: String,
}

/// What [`read`] made of a file.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Reading {
    /// What the file says.
    pub device: Device,
    /// What was doubtful, by line.
    pub diagnostics: Vec<Diagnostic>,
    /// The file itself.
    pub source: Source,
}

impl Reading {
    /// The file with the changes that make it say what `device` says. Every line that no change
    /// concerns stays as it is; without a change the text is the file's, to the last blank. Where parts of
    /// the file contradict each other so that a change in its place would say something else, objects that
    /// change are written whole, or, as a last resort, the file anew.
    #[must_use]
    pub fn update(&self, device: &Device) -> String {
        let (text, before) = (&self.source.text, &self.device);
        if device == before {
            return text.clone();
        }
        let anew = match self.source.format {
            Format::Eds => write_eds(device),
            Format::Xdd => write_xdd(device).0,
        };
        let meant = said(&anew);
        let says_so = |text: &String| said(text) == meant;
        let in_place = match self.source.format {
            Format::Eds => [Whole::ListsDiffer, Whole::Changed]
                .into_iter()
                .map(|whole| update::update(text, before, device, whole))
                .find(says_so),
            Format::Xdd => xdd::update(text, before, device).filter(says_so),
        };
        in_place.unwrap_or(anew)
    }
}

/// What a text says, whatever the order of the keys within its sections.
fn said(text: &str) -> Option<Device> {
    let mut device = read_as(text.as_bytes(), Encoding::Utf8).ok()?.device;
    device.sort_keys();
    Some(device)
}

impl Source {
    /// The bytes of a text in this file's encoding; in UTF-8 where that lacks a character, and where
    /// the text is XML that says so.
    #[must_use]
    pub fn encode(&self, text: &str) -> Vec<u8> {
        let declaration = text.split_once("?>").map_or("", |(declaration, _)| declaration);
        let utf8 = declaration.starts_with("<?xml") && declaration.to_ascii_lowercase().contains("utf-8");
        let encoding =
            if utf8 && self.encoding != Encoding::Utf8Bom { Encoding::Utf8 } else { self.encoding };
        encoding.encode(text).unwrap_or_else(|| text.as_bytes().to_vec())
    }
}

/// The longest file that is read, in bytes: ten times the longest one known, and short enough that a file
/// made to fill the memory does not.
pub const MOST_BYTES: usize = 4 << 20;

/// Why a file is refused.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// Nothing in it.
    #[error("the file is empty")]
    Empty,
    /// Far longer than any device description.
    #[error("longer than {MOST_BYTES} bytes, which no device description is")]
    TooLong,
    /// UTF-16, which neither EDS nor XDD is written in.
    #[error(
        "UTF-16 (it begins with {0:02X} {1:02X}); a device description is ASCII or UTF-8: save it as one of these"
    )]
    Utf16(u8, u8),
    /// Bytes that no text has.
    #[error("not a text file: zero byte at offset {0}")]
    Binary(usize),
    /// Text, but without a single object.
    #[error("no device description: no section of an object such as [1000] in {lines} lines")]
    NoObjects {
        /// Lines in the file.
        lines: usize,
    },
    /// XML that is no XML.
    #[error("not well-formed XML: {message}")]
    Xml {
        /// Line, from 1.
        line: u32,
        /// Column, from 1.
        column: u32,
        /// What the XML reader says, with the position.
        message: String,
    },
    /// XML of another kind.
    #[error(
        "no CANopen device description: the root element is {root} of namespace \"{namespace}\", where CiA 311 has \
         ISO15745ProfileContainer of \"http://www.canopen.org/xml/1.1\" or 1.0"
    )]
    NotCanopenXml {
        /// Name of the root element.
        root: String,
        /// Its namespace.
        namespace: String,
    },
    /// A profile container without CANopen objects, as other fieldbuses have.
    #[error("no CANopen device description: {root} holds no CANopenObjectList with an object")]
    NoObjectList {
        /// Name of the root element.
        root: String,
    },
    /// A project file of CANopenEditor without a device.
    #[error("a project file that holds no device description")]
    EmptyProject,
}

/// Reads an EDS, DCF, XDD or XDC file. Format and encoding are told from the content.
///
/// # Errors
/// [`ReadError`] where the file is no device description at all.
pub fn read(bytes: &[u8]) -> Result<Reading, ReadError> {
    read_as(bytes, Encoding::detect(bytes))
}

/// Reads a file of which the encoding is known.
///
/// # Errors
/// [`ReadError`] where the file is no device description at all.
pub fn read_as(bytes: &[u8], encoding: Encoding) -> Result<Reading, ReadError> {
    if bytes.len() > MOST_BYTES {
        return Err(ReadError::TooLong);
    }
    if let [a @ 0xFF, b @ 0xFE, ..] | [a @ 0xFE, b @ 0xFF, ..] = *bytes {
        return Err(ReadError::Utf16(a, b));
    }
    let text = encoding.decode(bytes);
    if text.trim().is_empty() {
        return Err(ReadError::Empty);
    }
    if let Some(offset) = bytes.iter().position(|byte| *byte == 0) {
        return Err(ReadError::Binary(offset));
    }
    let format = if text.trim_start().starts_with('<') { Format::Xdd } else { Format::Eds };
    let mut findings = Findings { list: Vec::new(), format };
    let device = match format {
        Format::Eds => {
            if !matches!(encoding, Encoding::Ascii) {
                let message = alloc::format!("characters beyond ASCII, read as {}", encoding.name());
                findings.add(first_beyond_ascii(&text), Rule::Encoding, message);
            }
            read_eds(&text, &mut findings)?
        }
        Format::Xdd => xdd::read(&text, &mut findings)?,
    };
    let mut diagnostics = findings.list;
    diagnostics.sort_by_key(|diagnostic| diagnostic.line);
    let text = match text {
        Cow::Borrowed(text) => text.into(),
        Cow::Owned(text) => text,
    };
    Ok(Reading { device, diagnostics, source: Source { format, encoding, text } })
}

fn read_eds(text: &str, findings: &mut Findings) -> Result<Device, ReadError> {
    let device = reader::read(&ini::Document::parse(text), findings);
    if device.objects.is_empty() {
        return Err(ReadError::NoObjects { lines: text.lines().count() });
    }
    Ok(device)
}

fn first_beyond_ascii(text: &str) -> u32 {
    let before = text.bytes().take_while(u8::is_ascii).filter(|byte| *byte == b'\n').count();
    u32::try_from(before).unwrap_or(u32::MAX).saturating_add(1)
}

/// What tests read: made by hand, with what a change must leave as it is.
#[cfg(test)]
const DCF: &str = "; made by hand\n[DeviceInfo]\nVendorName = Ä # kept\n\n[OptionalObjects]\nSupportedObjects=2\n\
    1=0x1A00\n2=0x1017 ; odd order\n[1017]\nParameterName=Heartbeat\nObjectType=7\nDataType=6\n\
    AccessType=RW\nDefaultValue= 0\n; after\n[1A00]\nParameterName=Map\nObjectType=0x8\nDataType=0x7\n\
    AccessType=rw\nCompactSubObj=2\n[1A00Value]\nNrOfEntries=1\n2=0x60410010\n";
