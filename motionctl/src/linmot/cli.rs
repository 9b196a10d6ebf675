//! The command line of `linmot` and `sim linmot`.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use linmot::code::ParameterType;
use linmot::upid::Upid;

#[derive(Debug, Clone, Args)]
pub(crate) struct Drive {
    /// CAN endpoint: socketcan:can0, slcan:/dev/ttyACM0?bitrate=500000, socketcand:HOST:PORT/can0, or a name
    /// of the configuration; without --can and --port that of MOTIONCTL_CAN, or of the configuration
    #[arg(long, value_name = "EP", conflicts_with = "port")]
    pub(crate) can: Option<String>,
    /// Serial endpoint, for LinRS: /dev/ttyUSB0, serial:PATH?baud=…&parity=…, tcp:HOST:PORT, or a name of the
    /// configuration; MOTIONCTL_PORT where no CAN endpoint is named
    #[arg(long, value_name = "EP")]
    pub(crate) port: Option<String>,
    /// CANopen node ID, or LinRS ID
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) node: u8,
    /// How CAN carries the commands: default SDO, or the configuration module in RPDO 4 and TPDO 4, for
    /// which the node is started (operational)
    #[arg(long, value_enum, default_value_t = Carrier::Sdo, conflicts_with = "port")]
    pub(crate) carrier: Carrier,
    /// Checksum of LinRS frames, as the drive's UPID 2080h says
    #[arg(long, value_enum, default_value_t = SumKind::None, conflicts_with = "can")]
    pub(crate) checksum: SumKind,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Carrier {
    Sdo,
    Pdo,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SumKind {
    None,
    #[value(name = "sum")]
    Bytes,
    Crc,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LayerName {
    Os,
    Mc,
    Interface,
    Application,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Linmot {
    /// Parameters by UPID
    Params {
        #[command(subcommand)]
        command: Params,
    },
    /// Curves
    Curve {
        #[command(subcommand)]
        command: Curve,
    },
    /// The command table
    Table {
        #[command(subcommand)]
        command: Table,
    },
    /// The error log
    Errors {
        #[command(flatten)]
        drive: Drive,
    },
    /// Parameters and curves to and from PVL files
    Pvl {
        #[command(subcommand)]
        command: Pvl,
    },
    /// Restart the drive: ROM values and flash become RAM values
    Restart {
        #[command(flatten)]
        drive: Drive,
        /// Until it answers again
        #[arg(long)]
        wait: bool,
    },
}

#[derive(Debug, Subcommand)]
pub(crate) enum Params {
    /// All parameters
    List {
        #[command(flatten)]
        drive: Drive,
        /// Only those whose ROM value is not the default
        #[arg(long)]
        changed: bool,
    },
    /// One parameter; a string by its own UPID
    Get {
        #[command(flatten)]
        drive: Drive,
        /// Hex as 13A2h, 0x13A2 or 13A2; digits only are decimal
        #[arg(value_parser = upid)]
        upid: Upid,
        #[command(flatten)]
        memory: Memory,
        /// The parameter's type, which no command of the drive tells; without, by its minimum and maximum
        #[arg(long = "type", value_enum, value_name = "T")]
        kind: Option<TypeName>,
    },
    /// Write one parameter; without --ram, --rom or --both: both of a live one, ROM of others
    Set {
        #[command(flatten)]
        drive: Drive,
        /// Hex as 13A2h, 0x13A2 or 13A2; digits only are decimal
        #[arg(value_parser = upid)]
        upid: Upid,
        #[command(flatten)]
        memory: Memory,
        /// The parameter's type, which no command of the drive tells; without, by its minimum and maximum
        #[arg(long = "type", value_enum, value_name = "T")]
        kind: Option<TypeName>,
        /// Decimal, or raw in hex (0x10, 10h); of a string its text
        #[arg(allow_hyphen_values = true)]
        value: String,
    },
    /// ROM values of one layer to their defaults; they act after a restart
    Defaults {
        #[command(flatten)]
        drive: Drive,
        /// One or more layers
        #[arg(long, value_enum, required = true, num_args = 1..)]
        layer: Vec<LayerName>,
    },
}

/// Types of numbers, named as those of SDO.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum TypeName {
    Bool,
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    F32,
}

impl From<TypeName> for ParameterType {
    fn from(name: TypeName) -> Self {
        match name {
            TypeName::Bool => Self::BOOL,
            TypeName::U8 => Self::U8,
            TypeName::I8 => Self::S8,
            TypeName::U16 => Self::U16,
            TypeName::I16 => Self::S16,
            TypeName::U32 => Self::U32,
            TypeName::I32 => Self::S32,
            TypeName::F32 => Self::FLOAT,
        }
    }
}

#[derive(Debug, Clone, Copy, Args)]
#[group(multiple = false)]
pub(crate) struct Memory {
    /// The value that the firmware runs on
    #[arg(long)]
    pub(crate) ram: bool,
    /// The non-volatile value
    #[arg(long)]
    pub(crate) rom: bool,
    /// Both
    #[arg(long)]
    pub(crate) both: bool,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Curve {
    /// Curves in the drive's RAM
    List {
        #[command(flatten)]
        drive: Drive,
    },
    /// One curve into a file
    Get {
        #[command(flatten)]
        drive: Drive,
        /// 1 to 100
        id: u16,
        /// CSV with all that the drive knows of the curve
        #[arg(long, short, value_name = "F")]
        output: PathBuf,
    },
    /// A file into a new curve
    Add {
        #[command(flatten)]
        drive: Drive,
        /// 1 to 100
        id: u16,
        /// What `get` wrote, or CSV: `# name=… length_ms=… unit=0.1um`, then one setpoint a line
        file: PathBuf,
    },
    /// A file into a curve that exists, with the same number of setpoints
    Modify {
        #[command(flatten)]
        drive: Drive,
        /// 1 to 100
        id: u16,
        /// As for `add`
        file: PathBuf,
    },
    /// A curve file from a motion profile, or from points; needs no drive
    Build(Build),
    /// RAM to flash; the MC software is stopped meanwhile
    Save {
        #[command(flatten)]
        drive: Drive,
    },
    /// All curves in RAM
    DeleteAll {
        #[command(flatten)]
        drive: Drive,
    },
    /// One curve as a picture
    Plot {
        #[command(flatten)]
        drive: Drive,
        /// 1 to 100
        id: u16,
        /// The picture
        #[arg(long, short, value_name = "F.svg")]
        output: PathBuf,
    },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProfileName {
    /// Velocity is half a sine, as in the manufacturer's example
    Sine,
    /// Velocity and acceleration are 0 at both ends, the polynomial of fifth degree
    MinimumJerk,
    /// A third each of acceleration, constant velocity, deceleration
    Trapezoid,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct Build {
    /// The file to write, for `add` and `modify`
    #[arg(long, short, value_name = "F")]
    pub(crate) output: PathBuf,
    /// Up to 21 characters
    #[arg(long, default_value = "")]
    pub(crate) name: String,
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u16).range(2..=16383))]
    pub(crate) setpoints: u16,
    /// Where the motion begins: 12.5mm, 300um, 0.1m
    #[arg(long, value_name = "POSITION", default_value = "0mm", allow_hyphen_values = true)]
    pub(crate) from: Quantity,
    /// Where it ends
    #[arg(long, value_name = "POSITION", allow_hyphen_values = true, required_unless_present = "points")]
    pub(crate) to: Option<Quantity>,
    /// Its shape, over a given length
    #[arg(long, value_enum, default_value_t = ProfileName::Sine)]
    pub(crate) profile: ProfileName,
    /// Its length: 200ms, 0.2s; of a cam in encoder increments: 3600inc
    #[arg(long, value_name = "LENGTH", required_unless_present_any = ["points", "velocity"])]
    pub(crate) length: Option<Quantity>,
    /// In place of shape and length: the fastest way within limits, 1.5m/s or 300mm/s
    #[arg(long, value_name = "V", conflicts_with_all = ["length", "profile"], requires = "acceleration")]
    pub(crate) velocity: Option<Quantity>,
    /// 20m/s2 or 9000mm/s2
    #[arg(long, value_name = "A", requires = "velocity")]
    pub(crate) acceleration: Option<Quantity>,
    /// 1000m/s3; without, the acceleration may jump
    #[arg(long, value_name = "J", requires = "velocity")]
    pub(crate) jerk: Option<Quantity>,
    /// In place of a motion: lines of x in ms and y in mm, cut into equal steps
    #[arg(long, value_name = "F", conflicts_with_all = ["from", "to", "profile", "length", "velocity"])]
    pub(crate) points: Option<PathBuf>,
    /// x of the points is in encoder increments
    #[arg(long, requires = "points")]
    pub(crate) cam: bool,
}

/// A number with its unit, in the units that a curve has: 0.1 µm, 10 µs, seconds of rates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Quantity {
    pub(crate) value: f64,
    pub(crate) kind: Kind,
}

/// What a quantity measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Position,
    Velocity,
    Acceleration,
    Jerk,
    Time,
    Increments,
}

/// Units by their name; the number of a curve's units that each has.
const UNITS: [(&str, Kind, f64); 15] = [
    ("um", Kind::Position, 1e1),
    ("mm", Kind::Position, 1e4),
    ("m", Kind::Position, 1e7),
    ("mm/s", Kind::Velocity, 1e4),
    ("m/s", Kind::Velocity, 1e7),
    ("mm/s2", Kind::Acceleration, 1e4),
    ("mm/s^2", Kind::Acceleration, 1e4),
    ("m/s2", Kind::Acceleration, 1e7),
    ("m/s^2", Kind::Acceleration, 1e7),
    ("mm/s3", Kind::Jerk, 1e4),
    ("m/s3", Kind::Jerk, 1e7),
    ("m/s^3", Kind::Jerk, 1e7),
    ("ms", Kind::Time, 1e2),
    ("s", Kind::Time, 1e5),
    ("inc", Kind::Increments, 1.0),
];

impl core::str::FromStr for Quantity {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let digits = text.trim_end_matches(|c: char| !c.is_ascii_digit() && c != '.');
        // The digit of a unit such as m/s2 is no digit of the number.
        let digits =
            digits.split_once(|c: char| c.is_ascii_alphabetic()).map_or(digits, |(number, _)| number);
        let unit = text.get(digits.len()..).unwrap_or_default().trim();
        let number = digits.trim().parse::<f64>().ok().filter(|number| number.is_finite());
        let known = UNITS.iter().find(|(name, ..)| *name == unit);
        match (number, known) {
            (Some(number), Some((_, kind, scale))) => Ok(Self { value: number * scale, kind: *kind }),
            _ => {
                Err("a number with its unit expected, such as 12.5mm, 200ms, 1.5m/s, 20m/s2, 3600inc".into())
            }
        }
    }
}

#[derive(Debug, Subcommand)]
pub(crate) enum Table {
    /// All entries
    List {
        #[command(flatten)]
        drive: Drive,
    },
    /// One entry
    Get {
        #[command(flatten)]
        drive: Drive,
        /// 1 to 255
        #[arg(value_parser = clap::value_parser!(u16).range(1..=255))]
        entry: u16,
    },
    /// Write one entry
    Set {
        #[command(flatten)]
        drive: Drive,
        /// 1 to 255
        #[arg(value_parser = clap::value_parser!(u16).range(1..=255))]
        entry: u16,
        /// 64 bytes in hex, words low byte first: 01A7; the entry that follows by itself, 0500 for entry 5 or
        /// FFFF for none; motion command header; 32 bytes of its parameters; name of 16 characters, filled
        /// with 00; 10 bytes 00
        #[arg(long, value_name = "HEX")]
        raw: String,
    },
    /// Delete one entry
    Delete {
        #[command(flatten)]
        drive: Drive,
        /// 1 to 255
        #[arg(value_parser = clap::value_parser!(u16).range(1..=255))]
        entry: u16,
    },
    /// Delete all entries in RAM
    DeleteAll {
        #[command(flatten)]
        drive: Drive,
    },
    /// RAM to flash; the MC software is stopped meanwhile
    Save {
        #[command(flatten)]
        drive: Drive,
    },
    /// Links that lead nowhere, loops
    Check {
        #[command(flatten)]
        drive: Drive,
    },
    /// All entries into a TOML file
    Backup {
        #[command(flatten)]
        drive: Drive,
        file: PathBuf,
    },
    /// A TOML file into the drive, RAM and flash; entries that it does not name are deleted
    Restore {
        #[command(flatten)]
        drive: Drive,
        file: PathBuf,
    },
    /// A TOML file with the drive's entries
    Compare {
        #[command(flatten)]
        drive: Drive,
        file: PathBuf,
    },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum EncodingName {
    /// Windows-1252, as the manufacturer's tool writes
    Windows1252,
    Utf8,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Pvl {
    /// ROM values and curves into a file
    Backup {
        #[command(flatten)]
        drive: Drive,
        file: PathBuf,
        /// Only parameters that are not at their default
        #[arg(long)]
        changed: bool,
        #[arg(long, value_enum, default_value_t = EncodingName::Windows1252)]
        encoding: EncodingName,
    },
    /// A file into ROM values and curves, RAM and flash; parameters that it does not list stay as they are
    Restore {
        #[command(flatten)]
        drive: Drive,
        file: PathBuf,
        /// Delete all curves of the drive first
        #[arg(long)]
        replace_curves: bool,
    },
    /// A file with the drive; parameters that it does not list are not compared
    Compare {
        #[command(flatten)]
        drive: Drive,
        file: PathBuf,
    },
    /// A file by itself
    Check { file: PathBuf },
}

#[derive(Debug, Clone, Args)]
pub(crate) struct SimLinmot {
    /// CAN endpoint to be a node on, or a name of the configuration
    #[arg(long, value_name = "EP")]
    pub(crate) can: Option<String>,
    /// Serial endpoint to answer LinRS on: pty:LINK, tcp:HOST:PORT, a serial port, or a name of the configuration
    #[arg(long, value_name = "EP", alias = "port", conflicts_with = "can")]
    pub(crate) serial: Option<String>,
    /// CANopen node ID, 1 to 127, 255 waits for one over LSS; or LinRS ID
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) node: u8,
    /// CANopen serial number (1018h:04)
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) serial_number: u32,
    /// File for ROM values and flash; absent: in memory
    #[arg(long, value_name = "FILE")]
    pub(crate) state: Option<PathBuf>,
    /// Writable parameters that the drive has at least
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) parameters: usize,
    /// Checksum of LinRS frames, written to UPID 2080h; without, what that says, as delivered none
    #[arg(long, value_enum, conflicts_with = "can")]
    pub(crate) checksum: Option<SumKind>,
}

/// The digits of a number that is written in hex, as 0x10 or 10h.
pub(crate) fn hex(text: &str) -> Option<&str> {
    let digits = text
        .strip_prefix("0x")
        .or_else(|| text.strip_prefix("0X"))
        .or_else(|| text.strip_suffix(['h', 'H']))?;
    Some(digits).filter(|digits| digits.bytes().all(|byte| byte.is_ascii_hexdigit()))
}

fn upid(text: &str) -> Result<Upid, String> {
    let short = |digits: &str| u16::from_str_radix(digits, 16).ok();
    let value = match hex(text) {
        Some(digits) => short(digits),
        None if text.bytes().all(|byte| byte.is_ascii_digit()) => text.parse().ok(),
        None if text.bytes().all(|byte| byte.is_ascii_hexdigit()) => short(text),
        None => None,
    };
    value.map(Upid).ok_or_else(|| "a UPID expected: 13A2h, 0x13A2, or decimal up to 65535".into())
}
