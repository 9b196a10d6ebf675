//! The command line of `eds`.

use std::path::PathBuf;

use canopen_master::eds::Encoding;
use clap::{Args, Subcommand, ValueEnum};

#[derive(Debug, Subcommand)]
pub(crate) enum Eds {
    /// What is wrong with a file, by line and clause; status 1 with errors, not for warnings alone
    Check {
        #[command(flatten)]
        input: Input,
        /// Only what had to be guessed or passed over to read the file, not every violation of the standard
        #[arg(long)]
        lenient: bool,
        /// Status 1 for warnings too
        #[arg(long)]
        strict: bool,
    },
    /// What a file says: the device and its objects
    Show {
        #[command(flatten)]
        input: Input,
        /// Only these objects: 0x6041, 6041h, 0x1018:1, or a name
        objects: Vec<String>,
        /// Node ID to put in for $NODEID; absent: that of the file
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=127))]
        node: Option<u8>,
        /// With the PDOs that CompactPDO implies
        #[arg(long)]
        implied: bool,
    },
    /// Write a file in another format, or as another kind
    ///
    /// In the same format, every line that needs no change stays as it is.
    Convert {
        #[command(flatten)]
        input: Input,
        /// File to write; `-` is standard output
        #[arg(required_unless_present = "to_file", conflicts_with = "to_file")]
        output: Option<PathBuf>,
        /// The same, as an option
        #[arg(short, long = "output", value_name = "FILE")]
        to_file: Option<PathBuf>,
        /// Absent: by the file's name
        #[arg(long, value_enum)]
        to: Option<Kind>,
        /// Node ID to configure
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=127))]
        node: Option<u8>,
        /// Bit rate to configure, in kbit/s
        #[arg(long, value_name = "K")]
        bit_rate: Option<u16>,
        /// Values to configure: INDEX:SUB=VALUE, the index as for `show`
        #[arg(long = "set", value_name = "OBJECT=VALUE")]
        values: Vec<String>,
        /// Concise DCF with values to configure
        #[arg(long, value_name = "FILE")]
        concise: Option<PathBuf>,
        /// Written anew in the order of the standard, without comments between the lines
        #[arg(long)]
        anew: bool,
    },
}

#[derive(Debug, Clone, Args)]
pub(crate) struct Input {
    /// EDS, DCF, XDD or XDC file; `-` is standard input
    pub(crate) file: PathBuf,
    /// Encoding; absent: told from the content
    #[arg(long, value_enum)]
    pub(crate) encoding: Option<Charset>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Charset {
    #[value(name = "utf-8")]
    Utf8,
    #[value(name = "windows-1252")]
    Windows1252,
    Cp850,
    Cp437,
}

impl From<Charset> for Encoding {
    fn from(charset: Charset) -> Self {
        match charset {
            Charset::Utf8 => Self::Utf8,
            Charset::Windows1252 => Self::Windows1252,
            Charset::Cp850 => Self::Cp850,
            Charset::Cp437 => Self::Cp437,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Kind {
    /// Description of a kind of device, as sections
    Eds,
    /// Configuration of a device, as sections
    Dcf,
    /// Description as XML
    Xdd,
    /// Configuration as XML
    Xdc,
    /// Concise DCF: the values of a configuration as bytes, for 1F22h
    Concise,
}

impl Kind {
    pub(crate) fn of(name: &std::path::Path) -> Option<Self> {
        match name.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "eds" => Some(Self::Eds),
            "dcf" => Some(Self::Dcf),
            "xdd" | "xpd" => Some(Self::Xdd),
            "xdc" => Some(Self::Xdc),
            "bin" | "cdcf" => Some(Self::Concise),
            _ => None,
        }
    }

    pub(crate) const fn is_configuration(self) -> bool {
        matches!(self, Self::Dcf | Self::Xdc | Self::Concise)
    }
}
