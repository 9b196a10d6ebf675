//! The command line of `motionctl run`.

use std::path::PathBuf;

use clap::Args;

#[derive(Debug, Args)]
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
