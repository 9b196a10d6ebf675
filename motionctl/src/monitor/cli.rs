//! Arguments of `motionctl monitor`.

use clap::Args;
use motion_io::endpoint::{CanEndpoint, EndpointError};

use crate::can::cli::Stream;
use crate::cli::{Global, Line};
use crate::connect::{ChoiceOf, choose, named};
use crate::decode::cli::Reading;
use crate::exit::Exit;

#[derive(Debug, Clone, Args)]
pub(crate) struct Monitor {
    /// Capture, as `decode` reads it, to be shown at its end or at another moment; `-` for standard input
    #[arg(value_name = "FILE", group = "source")]
    pub(crate) file: Option<String>,
    /// CAN endpoint to listen on; nothing is sent [env: MOTIONCTL_CAN]
    #[arg(long, value_name = "EP", group = "source")]
    pub(crate) can: Option<String>,
    /// Serial endpoint of a controller that is asked over LB2 [env: MOTIONCTL_PORT]
    #[arg(long, value_name = "EP", group = "source")]
    pub(crate) port: Option<String>,
    /// Of the controllers on the line, the one with this number (0 to 31)
    #[arg(long, value_name = "N", conflicts_with_all = ["file", "can"], value_parser = clap::value_parser!(u8).range(0..=31))]
    pub(crate) device: Option<u8>,
    /// Parameter of the controller to show too, by number or name; may be given several times
    #[arg(long, value_name = "KEY", conflicts_with_all = ["file", "can"])]
    pub(crate) param: Vec<String>,
    /// Value in the controller's RAM bank 12 to show too, such as 0x10:i32:position; may be given several times
    #[arg(long, value_name = "OFFSET:TYPE[:NAME]", conflicts_with_all = ["file", "can"])]
    pub(crate) ram: Vec<String>,
    /// Bits per second of the bus, for its load in percent; of slcan the endpoint says it
    #[arg(long, value_name = "N", conflicts_with = "port", value_parser = clap::value_parser!(u32).range(1000..=1_000_000))]
    pub(crate) bitrate: Option<u32>,
    #[command(flatten)]
    pub(crate) reading: Reading,
    /// Print one snapshot and end: of a bus after a second or `--for` so long, of a controller when all has been read
    #[arg(long)]
    pub(crate) once: bool,
    #[command(flatten)]
    pub(crate) stream: Stream,
}

/// What is to be shown.
#[derive(Debug)]
pub(super) enum Source {
    Can(CanEndpoint),
    Port(Line),
    Capture(String),
}

impl Monitor {
    /// What the command line names, or where it names nothing, the environment or the configuration.
    pub(super) fn source(&self, global: &Global) -> Result<Source, Exit> {
        if let Some(file) = &self.file {
            return Ok(Source::Capture(file.clone()));
        }
        let of = |name| std::env::var(name).ok();
        let (can, port) = match (&self.can, &self.port) {
            (None, None) => {
                // Of a controller alone there are these.
                let asks = self.device.is_some() || !self.param.is_empty() || !self.ram.is_empty();
                let named = |given: Option<String>, what| -> Result<_, Exit> {
                    Ok(named(global, given.as_deref(), what)?.map(|_| given))
                };
                let can = named(of("MOTIONCTL_CAN"), ChoiceOf::Can)?.filter(|_| !asks);
                let port = named(of("MOTIONCTL_PORT"), ChoiceOf::Port)?.filter(|_| self.bitrate.is_none());
                match (can, port) {
                    (Some(can), None) => (Some(can), None),
                    (None, Some(port)) => (None, Some(port)),
                    (Some(_), Some(_)) => {
                        return Err(Exit::usage(
                            "the environment or the configuration names a bus and a serial port: --can or --port expected",
                        ));
                    }
                    (None, None) => {
                        return Err(Exit::usage(
                            "nothing to show: --can EP, --port EP or FILE expected, or MOTIONCTL_CAN or MOTIONCTL_PORT, \
                             or `can` or `port` in the configuration file",
                        ));
                    }
                }
            }
            (can, port) => (can.clone().map(Some), port.clone().map(Some)),
        };
        match (can, port) {
            (Some(can), _) => choose(global, can.as_deref(), ChoiceOf::Can)?
                .parse()
                .map(Source::Can)
                .map_err(|error: EndpointError| Exit::usage(error.to_string())),
            (_, port) => Ok(Source::Port(Line { port: port.flatten(), device: self.device })),
        }
    }
}
