//! The command line of `motionctl run`.

use std::path::PathBuf;

use clap::Args;

/// What a configuration may hold, for `--help`.
const FILE: &str = r#"CONFIG.toml:
  [controller]          model = 8230, device_number = 0, state = "directory for flash"
  [[serial]]            port = "COM 2", endpoint = "pty:line", protocol = "lb2"
  [can1], [can2]        endpoint = "socketcan:can0", bitrate = 500000
  [parameters]          by number or name, as at switching on: 642 = 3276800, "CAN Link@CAN 1" = "Yes"
                        A bus is a CANopen master or slave by [300], on CAN Link by [302], [303];
                        with all its objects inactive it is silent.
  [[simulate]]          kind = "drive", "io" (bus = "can2", node = 1) or "plant"
  [[program]]           at = seconds, do = …
    power, home, move-absolute, move-relative, move-velocity, jog, stop, halt, reset, set-position
                        axis = 1, position, distance, velocity, for = seconds, …
    gear-in, gear-out   axis = 2, input = 1 (actual value input; type Virtual2 for another axis),
                        numerator = -3, denominator = 7, for = seconds
    write               bus = "can1", object = 1 (OUT 1 to 4), data = "A5", period = seconds
    send                bus = "can1", channel = 1 (CAN Link, 1 to 14), data = "E2 04", period = seconds
    scan                bus = "can1": as by hand, with all axes at rest
                        A step that ends with an error makes the exit status 1."#;

#[derive(Debug, Args)]
#[command(after_long_help = FILE)]
pub(crate) struct Run {
    /// What to run: controller, endpoints, parameters, simulated devices, program
    #[arg(value_name = "CONFIG.toml")]
    pub(crate) file: PathBuf,
    /// Stop after this many seconds
    #[arg(long = "for", value_name = "SECONDS")]
    pub(crate) duration: Option<f64>,
    /// Write what the activated axes do, a line a control cycle and axis, as `plot` reads it
    #[arg(long, value_name = "F.csv")]
    pub(crate) record: Option<PathBuf>,
}
