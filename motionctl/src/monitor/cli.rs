//! Arguments of `motionctl monitor`.

use clap::Args;
use motion_io::endpoint::{CanEndpoint, EndpointError};

use crate::can::cli::Stream;
use crate::cli::Global;
use crate::connect::{ChoiceOf, choose};
use crate::exit::Exit;

#[derive(Debug, Clone, Args)]
pub(crate) struct Monitor {
    /// CAN endpoint to listen on; nothing is sent [env: MOTIONCTL_CAN]
    #[arg(long = "can", value_name = "EP", group = "source")]
    pub(crate) can: Option<String>,
    /// Bits per second of the bus, for its load in percent; of slcan the endpoint says it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1000..=1_000_000))]
    pub(crate) bitrate: Option<u32>,
    /// EDS or DCF that names a node's objects and says its PDO mapping
    #[arg(long, value_name = "NODE=FILE")]
    pub(crate) eds: Vec<String>,
    /// A node is a LinMot drive, though the traffic does not show its vendor
    #[arg(long, value_name = "NODE", value_parser = clap::value_parser!(u8).range(1..=127))]
    pub(crate) linmot: Vec<u8>,
    /// 101h to 10Eh are channels of CAN Link
    #[arg(long)]
    pub(crate) can_link: bool,
    /// Print one snapshot and end, of a live source after a second or `--for` so long
    #[arg(long)]
    pub(crate) once: bool,
    #[command(flatten)]
    pub(crate) stream: Stream,
}

/// What is to be shown.
#[derive(Debug)]
pub(super) enum Source {
    Can(CanEndpoint),
}

impl Monitor {
    /// What the command line names, or where it names nothing, the environment or the configuration.
    pub(super) fn source(&self, global: &Global) -> Result<Source, Exit> {
        let given = self.can.clone().or_else(|| std::env::var("MOTIONCTL_CAN").ok());
        let text = choose(global, given.as_deref(), ChoiceOf::Can)?;
        text.parse().map(Source::Can).map_err(|error: EndpointError| Exit::usage(error.to_string()))
    }
}
