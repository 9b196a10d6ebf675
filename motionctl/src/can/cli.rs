//! The command line of `can` and `bus`.

use clap::Args;

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
