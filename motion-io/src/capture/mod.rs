//! Capture files: what a bus or a line did, recorded by whatever tool was at hand.
//!
//! [`open`] recognises the format from the content and reads it as a stream: memory does not grow
//! with the file. What cannot be read is reported with its place and skipped, never dropped
//! silently: every line or packet that is no header or comment gives a [`Record`] or a [`Damage`].
//!
//! | read | |
//! |---|---|
//! | candump | `-l` logs and screen text: with or without interface, time, direction, ASCII column; remote, error and FD frames |
//! | Vector `.asc` | classic and FD, `base hex` and `dec`; the statistic lines of the tool give nothing |
//! | PEAK `.trc` | 1.0, 1.1, 1.2, 1.3, 2.0, 2.1, and excerpts without a header |
//! | IXXAT trace text | columns named by the header, quoted or not; column dumps `CAN1  67F Tx SD  8  2F …` |
//! | pcap, pcapng | link types 227 (SocketCAN, identifier big-endian) and 113 (Linux cooked) |
//! | LB2 | raw bytes, or hex text with or without times ([`Lb2Reader`]) |
//!
//! [`Writer`] writes candump logs, `.asc`, `.trc` 2.1 and pcapng with link type 227.
//!
//! Times are the capture's own: an epoch time stays one, a difference to the line before stays one
//! ([`Reader::times`] tells which they are).

mod asc;
mod candump;
mod columns;
mod input;
mod lb2;
mod log_line;
mod pcap;
mod reader;
mod record;
mod scan;
mod sniff;
mod trc;
mod write;

use std::io::{self, Read};

pub use lb2::{Chunk, Lb2Reader};
pub use reader::{Item, Reader};
pub use record::{Bus, Damage, Direction, Frame, FrameKind, Place, Record, Time, Times};
pub use sniff::Format;
pub use write::{WriteFormat, Writer};

/// Why a capture could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureError {
    /// The file or stream itself failed.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// Text of a kind that no format here has.
    #[error("UTF-16 text; captures are ASCII or UTF-8: save it as one of these")]
    Utf16,
    /// A compressed file.
    #[error("compressed with {0}: unpack it first")]
    Compressed(&'static str),
    /// No format that is known here; the start of the content is quoted.
    #[error("no known capture format; it begins with {0:?}")]
    Unrecognised(String),
    /// A pcap file of something else.
    #[error("link type {0}, 227 (SocketCAN) or 113 (Linux cooked) expected")]
    LinkType(u32),
}

/// An opened capture.
#[derive(Debug)]
pub enum Capture<R> {
    /// Frames of a CAN bus, or of several.
    Can(Reader<R>),
    /// Bytes of an LB2 line.
    Lb2(Lb2Reader<R>),
}

/// Recognises the format from the first 64 KiB and reads from there.
///
/// # Errors
/// [`CaptureError`] if reading fails or nothing is recognised. An empty source is a capture without
/// frames.
pub fn open<R: Read>(source: R) -> Result<Capture<R>, CaptureError> {
    let mut input = input::Input::new(source);
    let start = input.peek(sniff::LOOK_AHEAD)?;
    let format = sniff::recognise(start)?;
    let deltas = format == Format::Candump && sniff::has_deltas(start);
    let mut capture = open_as_input(input, format)?;
    if let Capture::Can(reader) = &mut capture
        && deltas
    {
        reader.set_times(Times::Deltas);
    }
    Ok(capture)
}

/// Reads a capture of which the format is known. Nothing is looked at beforehand: candump's times are taken
/// for absolute ones until [`Reader::set_times`] says otherwise.
///
/// # Errors
/// [`CaptureError`] if reading fails.
pub fn open_as<R: Read>(source: R, format: Format) -> Result<Capture<R>, CaptureError> {
    open_as_input(input::Input::new(source), format)
}

fn open_as_input<R: Read>(mut input: input::Input<R>, format: Format) -> Result<Capture<R>, CaptureError> {
    let is_text = !matches!(format, Format::Pcap | Format::Lb2Raw);
    if is_text && input.peek(sniff::BYTE_ORDER_MARK.len())? == sniff::BYTE_ORDER_MARK {
        input.take(sniff::BYTE_ORDER_MARK.len());
    }
    Ok(match format {
        Format::Lb2Raw => Capture::Lb2(Lb2Reader::raw(input)),
        Format::Lb2Hex => Capture::Lb2(Lb2Reader::hex(input)),
        _ => Capture::Can(Reader::new(input, format)?),
    })
}
