//! Arguments of `motionctl decode`.

use std::io::Read;

use clap::{Args, ValueEnum};
use motion_io::capture::{Capture, CaptureError, Format, Times, open, open_as};

#[derive(Debug, Clone, Args)]
pub(crate) struct Decode {
    /// Captures, `-` for standard input: candump logs and screen text, .asc, .trc, IXXAT text, pcap, pcapng,
    /// LB2 as bytes or hex text
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<String>,
    #[command(flatten)]
    pub(crate) reading: Reading,
    /// Say every frame, not only what happens
    #[arg(long)]
    pub(crate) frames: bool,
}

/// How traffic is to be understood.
#[derive(Debug, Clone, Args)]
pub(crate) struct Reading {
    /// EDS, DCF or XDD that names a node's objects and says its PDO mapping
    #[arg(long, value_name = "NODE=FILE")]
    pub(crate) eds: Vec<String>,
    /// A node is a LinMot drive, though the traffic does not show its vendor
    #[arg(long, value_name = "NODE", value_parser = clap::value_parser!(u8).range(1..=127))]
    pub(crate) linmot: Vec<u8>,
    /// 101h to 10Eh are channels of CAN Link
    #[arg(long)]
    pub(crate) can_link: bool,
    /// Format of a capture, in place of the one that the content shows; what then comes through a pipe is
    /// told at once
    #[arg(long, value_enum)]
    pub(crate) format: Option<FormatName>,
    /// What times of CAN captures are since, in place of what the content shows
    #[arg(long, value_enum)]
    pub(crate) times: Option<TimesName>,
}

impl Reading {
    /// Opens a capture.
    pub(crate) fn open<R: Read>(&self, source: R) -> Result<Capture<R>, CaptureError> {
        let mut capture = match self.format {
            Some(format) => open_as(source, format.into()),
            None => open(source),
        }?;
        if let (Capture::Can(reader), Some(times)) = (&mut capture, self.times) {
            reader.set_times(times.into());
        }
        Ok(capture)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum TimesName {
    /// 1970, or the start of the recording
    Absolute,
    /// The frame before
    Deltas,
}

impl From<TimesName> for Times {
    fn from(name: TimesName) -> Self {
        match name {
            TimesName::Absolute => Self::Absolute,
            TimesName::Deltas => Self::Deltas,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatName {
    Candump,
    Asc,
    Trc,
    Ixxat,
    Pcap,
    /// LB2, raw bytes
    Lb2,
    /// LB2, hex text
    Lb2Hex,
}

impl From<FormatName> for Format {
    fn from(name: FormatName) -> Self {
        match name {
            FormatName::Candump => Self::Candump,
            FormatName::Asc => Self::Asc,
            FormatName::Trc => Self::Trc,
            FormatName::Ixxat => Self::Ixxat,
            FormatName::Pcap => Self::Pcap,
            FormatName::Lb2 => Self::Lb2Raw,
            FormatName::Lb2Hex => Self::Lb2Hex,
        }
    }
}
