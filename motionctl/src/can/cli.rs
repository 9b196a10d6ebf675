//! The command line of `can`, `bus` and of the virtual nodes.

use core::time::Duration;
use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use crate::cli::seconds;

#[derive(Debug, Clone, Args)]
pub(crate) struct Bus {
    /// Address to listen on, HOST:PORT; port 0 takes any that is free
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:29536")]
    pub(crate) listen: String,
    /// Name of a bus; may be given several times [default: can0]
    #[arg(long, value_name = "NAME")]
    pub(crate) bus: Vec<String>,
    /// Bits per second
    #[arg(long, value_name = "N", default_value_t = 500_000, value_parser = clap::value_parser!(u32).range(1000..=1_000_000))]
    pub(crate) bitrate: u32,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct CanLine {
    /// CAN endpoint: socketcan:can0, slcan:/dev/ttyACM0?bitrate=500000, slcan-pty:LINK, socketcand:HOST:PORT/BUS, or a name of the configuration
    #[arg(long = "can", value_name = "EP", env = "MOTIONCTL_CAN")]
    pub(crate) endpoint: Option<String>,
}

/// A virtual node.
#[derive(Debug, Clone, Args)]
pub(crate) struct SimNode {
    #[command(flatten)]
    pub(crate) line: CanLine,
    /// Node ID, 1 to 127; 255 waits for one over LSS
    #[arg(long, value_name = "N")]
    pub(crate) node: u8,
    /// Serial number (1018h:04)
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) serial_number: u32,
    /// Write the node's device file (EDS) first
    #[arg(long, value_name = "FILE")]
    pub(crate) write_eds: Option<PathBuf>,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct SimIo {
    #[command(flatten)]
    pub(crate) node: SimNode,
    /// Connect every input to the output of its number
    #[arg(long)]
    pub(crate) wired: bool,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct SimFile {
    #[command(flatten)]
    pub(crate) node: SimNode,
    /// Device file: EDS, DCF or XDD
    #[arg(long, value_name = "FILE")]
    pub(crate) eds: PathBuf,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Can {
    /// Who is on the bus
    Scan {
        #[command(flatten)]
        line: CanLine,
        /// Only these, such as 1-16,20
        #[arg(long, value_name = "LIST")]
        nodes: Option<String>,
    },
    /// Network management; says what the nodes then showed
    Nmt {
        command: Nmt,
        /// Node ID, or all
        node: String,
        #[command(flatten)]
        line: CanLine,
    },
    /// Guard nodes and tell what happens to them
    Guard {
        #[arg(required = true, value_parser = clap::value_parser!(u8).range(1..=127))]
        nodes: Vec<u8>,
        #[command(flatten)]
        line: CanLine,
        /// Seconds between two requests to one node
        #[arg(long, value_name = "S", default_value = "0.1", value_parser = seconds)]
        period: Duration,
        /// Life time factor: lost after so many periods without an answer
        #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u8).range(1..))]
        life: u8,
        #[command(flatten)]
        stream: Stream,
    },
    /// Read and write objects
    Sdo {
        #[command(subcommand)]
        command: Sdo,
    },
    /// How a node's PDOs are set up
    Pdo {
        #[command(subcommand)]
        command: Pdo,
    },
    /// Layer setting services: node IDs and bit rates
    Lss {
        #[command(subcommand)]
        command: Lss,
    },
    /// Load a configuration into a node: DCF, XDC or concise DCF
    Dcf {
        #[arg(value_parser = clap::value_parser!(u8).range(1..=127))]
        node: u8,
        file: PathBuf,
        #[command(flatten)]
        line: CanLine,
    },
    /// The channels of a CAN Link bus
    Link {
        #[command(subcommand)]
        command: LinkCommand,
    },
    /// Emergencies as they come
    Emcy {
        #[command(flatten)]
        line: CanLine,
        #[command(flatten)]
        stream: Stream,
    },
    /// All frames as they come
    Monitor {
        #[command(flatten)]
        line: CanLine,
        #[command(flatten)]
        stream: Stream,
    },
    /// All frames into a capture file, until stopped
    Record {
        /// Ends with .log (candump), .asc, .trc or .pcapng
        file: PathBuf,
        #[command(flatten)]
        line: CanLine,
        #[command(flatten)]
        stream: Stream,
    },
}

#[derive(Debug, Clone, Args)]
pub(crate) struct Stream {
    /// Stop after so many seconds
    #[arg(long = "for", value_name = "S", value_parser = seconds)]
    pub(crate) limit: Option<Duration>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Nmt {
    Start,
    Stop,
    Preop,
    ResetNode,
    ResetComm,
}

/// An object and how to understand it.
#[derive(Debug, Clone, Args)]
pub(crate) struct Object {
    #[arg(value_parser = clap::value_parser!(u8).range(1..=127))]
    pub(crate) node: u8,
    /// 0x6041, 6041h, 0x1018:1, or a name of the device file
    #[arg(value_name = "INDEX[:SUB]")]
    pub(crate) object: String,
    #[command(flatten)]
    pub(crate) line: CanLine,
    /// bool, u8, i8, u16, i16, u24 … u64, i64, f32, f64, string, bytes
    #[arg(long = "type", value_name = "T")]
    pub(crate) data_type: Option<String>,
    /// Device file (EDS, DCF, XDD) for names and types
    #[arg(long, value_name = "FILE")]
    pub(crate) eds: Option<PathBuf>,
    /// Block transfer
    #[arg(long)]
    pub(crate) block: bool,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Sdo {
    /// Read an object
    Read {
        #[command(flatten)]
        object: Object,
        /// Write the bytes to a file
        #[arg(long, value_name = "F")]
        output: Option<PathBuf>,
    },
    /// Write an object
    Write {
        #[command(flatten)]
        object: Object,
        /// Value; `--` before one that begins with -
        #[arg(required_unless_present = "file", allow_negative_numbers = true)]
        value: Option<String>,
        /// The bytes of a file
        #[arg(long, value_name = "F", conflicts_with = "value")]
        file: Option<PathBuf>,
    },
}

#[derive(Debug, Subcommand)]
pub(crate) enum Pdo {
    /// Identifier, transmission type, times and mapping
    Read {
        #[arg(value_parser = clap::value_parser!(u8).range(1..=127))]
        node: u8,
        /// tpdo1 … tpdo512, rpdo1 … rpdo512
        pdo: String,
        #[command(flatten)]
        line: CanLine,
    },
    /// Set a PDO up, in the order that CiA 301 asks for
    Write {
        #[arg(value_parser = clap::value_parser!(u8).range(1..=127))]
        node: u8,
        /// tpdo1 … tpdo512, rpdo1 … rpdo512
        pdo: String,
        #[command(flatten)]
        line: CanLine,
        /// Mapped objects in order, INDEX:SUB:BITS, such as 0x6041:0:16; absent: as it is
        #[arg(long, value_name = "OBJECT", num_args = 1..)]
        map: Option<Vec<String>>,
        /// Identifier, such as 0x181; absent: as it is
        #[arg(long, value_name = "ID")]
        id: Option<String>,
        /// Transmission type
        #[arg(long = "transmission", value_name = "N")]
        transmission: Option<u8>,
        /// Inhibit time in units of 100 µs
        #[arg(long, value_name = "N")]
        inhibit: Option<u16>,
        /// Event timer in ms
        #[arg(long, value_name = "MS")]
        event: Option<u16>,
        /// Leave it switched off
        #[arg(long)]
        off: bool,
    },
}

/// Whom an LSS command is for.
#[derive(Debug, Clone, Args)]
pub(crate) struct LssTarget {
    #[command(flatten)]
    pub(crate) line: CanLine,
    /// VENDOR:PRODUCT:REVISION:SERIAL; absent: the device in configuration, or if there is none, all
    #[arg(long, value_name = "V:P:R:S")]
    pub(crate) identity: Option<String>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Lss {
    /// Find a device without node ID and bring it into configuration
    Fastscan {
        #[command(flatten)]
        line: CanLine,
    },
    /// Identity and node ID of a device
    Identify {
        #[command(flatten)]
        target: LssTarget,
    },
    /// Give a device its node ID (255: none); one that had none starts with it
    SetNode {
        node: u8,
        #[command(flatten)]
        target: LssTarget,
    },
    /// Give a device its bit rate
    SetBitTiming {
        /// kbit/s: 1000, 800, 500, 250, 125, 50, 20 or 10
        kbits: u16,
        #[command(flatten)]
        target: LssTarget,
    },
    /// Let a device keep node ID and bit rate
    Store {
        #[command(flatten)]
        target: LssTarget,
    },
}

#[derive(Debug, Subcommand)]
pub(crate) enum LinkCommand {
    /// The newest value of every channel, after listening for a second or `--for` so long
    List {
        #[command(flatten)]
        line: CanLine,
        #[command(flatten)]
        content: Content,
        #[command(flatten)]
        stream: Stream,
    },
    /// Values as they come
    Watch {
        #[command(flatten)]
        line: CanLine,
        #[command(flatten)]
        content: Content,
        #[command(flatten)]
        stream: Stream,
    },
    /// Send a value on a channel, once or at a period; status 1 if another device sends on it too
    Set {
        /// 1 to 14
        channel: u8,
        /// Up to 8 bytes in hex, or a value of the type
        #[arg(allow_negative_numbers = true)]
        data: String,
        #[command(flatten)]
        content: Content,
        /// Seconds between two frames, until stopped or for `--for` so long
        #[arg(long, value_name = "S", value_parser = seconds)]
        period: Option<Duration>,
        #[command(flatten)]
        line: CanLine,
        #[command(flatten)]
        stream: Stream,
    },
}

/// How the bytes of channels are to be understood.
#[derive(Debug, Clone, Args)]
pub(crate) struct Content {
    /// bool, u8, i8, u16, i16, u24 … u64, i64, f32, f64, string, bytes; little-endian
    #[arg(long = "type", value_name = "T")]
    pub(crate) data_type: Option<String>,
}
