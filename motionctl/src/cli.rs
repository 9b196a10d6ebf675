//! The command line.

use core::time::Duration;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

/// Back up, compare, restore and simulate Lenord+Bauer MotionControllers GEL 8230, 8231, 8235, 8236.
///
/// Exit status: 0 done or equal, 1 differs or a check failed, 2 usage, 3 no answer in time, 4 refused
/// by the device, 5 port or file trouble.
#[derive(Debug, Parser)]
#[command(name = "motionctl", version)]
pub(crate) struct Cli {
    #[command(flatten)]
    pub(crate) global: Global,
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct Global {
    /// One JSON document on standard output, or one JSON object a line for streams
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Only results and errors
    #[arg(long, short, global = true)]
    pub(crate) quiet: bool,
    /// Colours in messages
    #[arg(long, global = true, value_enum, default_value_t = Color::Auto)]
    pub(crate) color: Color,
    /// Seconds that a device has to begin its answer, above 0 and below 1.8e19 [default: by protocol; CANopen 0.5, `scan` 0.05, steps of `lss fastscan` 0.025]
    #[arg(long, global = true, value_name = "SECONDS", value_parser = seconds)]
    pub(crate) timeout: Option<Duration>,
    /// File with named endpoints: `[endpoints]` with lines `name = "endpoint"`, and `port = "…"` for all commands
    #[arg(long, global = true, value_name = "FILE", env = "MOTIONCTL_CONFIG")]
    pub(crate) config: Option<PathBuf>,
    /// Print the plan and touch nothing
    #[arg(long, global = true)]
    pub(crate) dry_run: bool,
    /// Do it without asking
    #[arg(long, short, global = true)]
    pub(crate) yes: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Color {
    Auto,
    Always,
    Never,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// The application example of manual A 6.11 on a virtual controller, end to end
    Demo(crate::demo::Demo),
    /// A soft MotionController: LB2 on its serial endpoints, axes, program, until stopped
    Run(crate::run::cli::Run),
    /// Positions, velocities, accelerations and errors of a recording as SVG
    Plot(crate::plot::Plot),
    /// One virtual device on the named endpoints
    Sim {
        #[command(subcommand)]
        command: Sim,
    },
    /// Work on a CANopen bus
    Can {
        #[command(subcommand)]
        command: crate::can::cli::Can,
    },
    /// Test a CANopen node against CiA 301 and its device file; it is reset, nothing is stored, and without
    /// --yes nothing is written behind which outputs or axes may be
    Conform(crate::conform::Conform),
    /// Virtual CAN buses for other programs, over the socketcand protocol, until stopped
    Bus(crate::can::cli::Bus),
    /// Serial ports and CAN interfaces found
    Ports,
    /// LB2 functions one by one
    Lb2 {
        #[command(subcommand)]
        command: Lb2,
    },
    /// Parameters by number or name
    Params {
        #[command(subcommand)]
        command: Params,
    },
    /// Captures to words, or to JSON objects one a line
    Decode(crate::decode::cli::Decode),
    /// A bus, a controller or a capture on a screen that lives, or one snapshot of it
    ///
    /// Keys: q, Esc and Ctrl-C end it; Tab, Shift-Tab and 1 to 9 choose a table, the arrows, Page Up and Page
    /// Down scroll it, z or Enter gives it the whole screen; p or the space bar halts the screen. Of a capture, `.` and `,` go a frame
    /// forth and back, `>` and `<` a twentieth of it, Home and End to its ends.
    Monitor(crate::monitor::cli::Monitor),
    /// EDS, DCF, XDD and XDC files
    Eds {
        #[command(subcommand)]
        command: crate::eds::cli::Eds,
    },
    /// LinMot drives: parameters, curves, command table, error log, PVL files
    Linmot {
        #[command(subcommand)]
        command: crate::linmot::cli::Linmot,
    },
    /// Completions for a shell
    Completions { shell: clap_complete::Shell },
    /// The manual page
    Man {
        /// Write the pages of all commands into this folder
        #[arg(long, value_name = "DIR")]
        output: Option<PathBuf>,
    },
}

#[derive(Debug, Subcommand)]
pub(crate) enum Sim {
    /// A virtual GEL 823x that answers LB2; with CAN buses, all of a controller, whose parameters say
    /// whether it is CANopen master, CANopen slave or on CAN Link
    Controller {
        /// 8230, 8231, 8235 or 8236
        #[arg(long, default_value_t = 8230)]
        model: u16,
        /// Endpoint to answer on: pty:LINK, tcp:HOST:PORT, a serial port, or for LB2 over CAN a CAN endpoint
        #[arg(long, value_name = "EP", required_unless_present_any = ["can1", "can2"])]
        serial: Option<String>,
        /// CAN endpoint that is its CAN 1
        #[arg(long, value_name = "EP")]
        can1: Option<String>,
        /// CAN endpoint that is its CAN 2
        #[arg(long, value_name = "EP")]
        can2: Option<String>,
        /// Parameter by number or name ("CAN Link, CAN 1=1"), set before the start; may be given several times
        #[arg(long, value_name = "KEY=VALUE")]
        set: Vec<String>,
        /// File for flash and retained values; absent: in memory
        #[arg(long, value_name = "FILE")]
        state: Option<PathBuf>,
        /// Device number, as parameter `[005]` would set it
        #[arg(long, value_name = "N")]
        device: Option<u8>,
    },
    /// A virtual LinMot drive behind CANopen or LinRS
    Linmot(crate::linmot::cli::SimLinmot),
    /// A virtual LD 2000 servo drive on a CAN bus
    Drive(crate::can::cli::SimNode),
    /// A virtual DS401 I/O node: 8 digital and 4 analogue inputs and outputs
    Io(crate::can::cli::SimIo),
    /// A virtual node with the objects of a device file
    Node(crate::can::cli::SimFile),
}

#[derive(Debug, Clone, Args)]
pub(crate) struct Line {
    /// Serial endpoint: /dev/ttyUSB0, serial:PATH?baud=…&parity=…&stop=…, tcp:HOST:PORT, or a name of the
    /// configuration; a CAN endpoint for LB2 over CAN
    #[arg(long, value_name = "EP", env = "MOTIONCTL_PORT")]
    pub(crate) port: Option<String>,
    /// Select the device with this number (0 to 31) first
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=31))]
    pub(crate) device: Option<u8>,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct Range {
    /// Bank number: 12 for RAM, 15 or 16 for flash
    #[arg(long)]
    pub(crate) bank: Option<u8>,
    /// First byte
    #[arg(long, default_value = "0", value_parser = number)]
    pub(crate) offset: u32,
    /// Bytes; absent: up to the bank's end
    #[arg(long, value_parser = number)]
    pub(crate) count: Option<u32>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// Raw bytes
    Bin,
    /// Intel HEX
    Hex,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Lb2 {
    /// Model, axes, versions
    Identify {
        #[command(flatten)]
        line: Line,
    },
    /// The stored failures
    Failures {
        #[command(flatten)]
        line: Line,
    },
    /// Delete the stored failures
    ClearFailures {
        #[command(flatten)]
        line: Line,
    },
    /// RAM bank 12 into a file
    ReadRam {
        #[command(flatten)]
        line: Line,
        #[command(flatten)]
        range: Range,
        /// Intel HEX where the name ends in .hex, .h86, .ihex; raw bytes otherwise
        file: PathBuf,
        /// Format of the file, whatever its name
        #[arg(long)]
        format: Option<Format>,
    },
    /// A file into RAM bank 12
    WriteRam {
        #[command(flatten)]
        line: Line,
        #[command(flatten)]
        range: Range,
        file: PathBuf,
        /// Format of the file, whatever its name
        #[arg(long)]
        format: Option<Format>,
    },
    /// A flash bank into a file
    ReadFlash {
        #[command(flatten)]
        line: Line,
        #[command(flatten)]
        range: Range,
        file: PathBuf,
        /// Format of the file, whatever its name
        #[arg(long)]
        format: Option<Format>,
    },
    /// Set a flash bank to FFh
    EraseFlash {
        #[command(flatten)]
        line: Line,
        /// 15 or 16
        #[arg(long)]
        bank: u8,
    },
    /// A file into a flash bank; what is read back must be the same
    WriteFlash {
        #[command(flatten)]
        line: Line,
        #[command(flatten)]
        range: Range,
        /// Erase the bank first
        #[arg(long)]
        erase: bool,
        file: PathBuf,
        /// Format of the file, whatever its name
        #[arg(long)]
        format: Option<Format>,
    },
    /// Any function: its byte and data in hex, such as `CC 30 05 00`
    Raw {
        #[command(flatten)]
        line: Line,
        #[arg(required = true)]
        bytes: Vec<String>,
    },
}

#[derive(Debug, Subcommand)]
pub(crate) enum Params {
    /// All parameters in use; with --port, with the device's values
    List {
        #[command(flatten)]
        line: Line,
        /// Only those that differ from the factory default
        #[arg(long)]
        changed: bool,
    },
    /// Values of some parameters
    Get {
        #[command(flatten)]
        line: Line,
        /// Number, or name as it is printed: 642, "V max., Axis 1"; "V max.@1", "V max.@Axis 1"
        #[arg(required = true)]
        keys: Vec<String>,
    },
    /// Write parameters and call the loader
    Set {
        #[command(flatten)]
        line: Line,
        /// KEY VALUE [KEY VALUE…]; KEY as for get: 642, "V max., Axis 1", "V max.@1"
        #[arg(required = true, allow_negative_numbers = true)]
        pairs: Vec<String>,
        /// Save to flash afterwards
        #[arg(long)]
        save: bool,
    },
    /// All parameters into a file
    Backup {
        #[command(flatten)]
        line: Line,
        file: PathBuf,
        /// Only those that differ from the factory default
        #[arg(long)]
        changed: bool,
    },
    /// Device and file (with --port), or two files
    Compare {
        #[command(flatten)]
        line: Line,
        file: PathBuf,
        second: Option<PathBuf>,
    },
    /// A file into the device: check, write, read back, loader, flash, verify
    Restore {
        #[command(flatten)]
        line: Line,
        file: PathBuf,
        /// Only these parameters
        #[arg(long, num_args = 1.., value_name = "KEY")]
        only: Vec<String>,
        /// Even if the file is of another model
        #[arg(long)]
        force: bool,
    },
    /// All parameters back to the factory defaults, loader, flash
    Reset {
        #[command(flatten)]
        line: Line,
        #[arg(long, required_unless_present = "image")]
        factory: bool,
        /// The image kept in the device
        #[arg(long, conflicts_with = "factory")]
        image: bool,
    },
}

/// Seconds above 0 as a time; none of other numbers.
pub(crate) fn above_zero(seconds: f64) -> Option<Duration> {
    Duration::try_from_secs_f64(seconds).ok().filter(|time| !time.is_zero())
}

/// Seconds above 0.
pub(crate) fn seconds(text: &str) -> Result<Duration, String> {
    text.parse().ok().and_then(above_zero).ok_or_else(|| "seconds above 0 expected, below 1.8e19".into())
}

fn number(text: &str) -> Result<u32, String> {
    let hex = text.strip_prefix("0x").or_else(|| text.strip_suffix(['h', 'H']));
    let number = match hex {
        Some(hex) => u32::from_str_radix(hex, 16),
        None => text.parse(),
    };
    number
        .ok()
        .filter(|n| *n <= 0x1_0000)
        .ok_or_else(|| "0 to 65536 expected, or hex as 0x1000 or 1000h".into())
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        super::Cli::command().debug_assert();
    }
}
