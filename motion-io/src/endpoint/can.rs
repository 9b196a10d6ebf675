//! CAN endpoints.

use core::fmt;
use core::str::FromStr;
use std::path::PathBuf;

use super::EndpointError;

/// A CAN endpoint.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum CanEndpoint {
    /// A CAN interface of the Linux kernel.
    SocketCan {
        /// Its name, `can0`.
        interface: String,
    },
    /// A serial adapter that speaks the slcan (Lawicel) protocol.
    Slcan {
        /// Device path or port name.
        path: String,
        /// Bits per second on the CAN bus: one of [`SLCAN_BIT_RATES`].
        bit_rate: u32,
        /// Bits per second of the serial line, where there is one.
        baud: u32,
    },
    /// A pseudo-terminal to be made, on which we are the slcan adapter.
    SlcanPty {
        /// Path of the symbolic link that others open.
        link: PathBuf,
    },
    /// A bus of a socketcand server.
    Socketcand {
        /// Host name or address and port number, `HOST:PORT`.
        address: String,
        /// Name of the bus there.
        bus: String,
    },
    /// A virtual bus inside this process.
    Virtual {
        /// Its name.
        name: String,
    },
}

/// Bit rates that slcan adapters know, `S0` to `S8`, in bits per second.
pub const SLCAN_BIT_RATES: [u32; 9] =
    [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];

/// Bit rate unless set (project-defined).
const BIT_RATE: u32 = 500_000;
/// Most slcan adapters are USB devices that ignore it.
const BAUD: u32 = 115_200;

impl CanEndpoint {
    /// Whether a text is meant as a CAN endpoint, right or wrong.
    pub(super) fn names(text: &str) -> bool {
        const KINDS: [&str; 5] = ["socketcan", "virtual", "slcan-pty", "slcan", "socketcand"];
        text.split_once(':').is_some_and(|(kind, _)| KINDS.contains(&kind))
    }
}

impl FromStr for CanEndpoint {
    type Err = EndpointError;

    fn from_str(text: &str) -> Result<Self, EndpointError> {
        let (kind, rest) = text.split_once(':').unwrap_or((text, ""));
        if rest.is_empty() {
            return Err(EndpointError::Can(text.into()));
        }
        match kind {
            "socketcan" => Ok(Self::SocketCan { interface: rest.into() }),
            "virtual" => Ok(Self::Virtual { name: rest.into() }),
            "slcan-pty" => Ok(Self::SlcanPty { link: rest.into() }),
            "slcan" => slcan(rest),
            "socketcand" => {
                let wrong = || EndpointError::Socketcand(rest.into());
                let (address, bus) = rest.split_once('/').ok_or_else(wrong)?;
                let (host, port) = address.rsplit_once(':').ok_or_else(wrong)?;
                let plain = |c: char| !c.is_whitespace() && c != '<' && c != '>';
                if host.is_empty()
                    || port.parse::<u16>().is_err()
                    || bus.is_empty()
                    || !bus.chars().all(plain)
                {
                    return Err(wrong());
                }
                Ok(Self::Socketcand { address: address.into(), bus: bus.into() })
            }
            _ => Err(EndpointError::Can(text.into())),
        }
    }
}

fn slcan(rest: &str) -> Result<CanEndpoint, EndpointError> {
    let (path, query) = rest.split_once('?').unwrap_or((rest, ""));
    let (mut bit_rate, mut baud) = (BIT_RATE, BAUD);
    for pair in query.split('&').filter(|pair| !pair.is_empty()) {
        let (setting, value) = pair.split_once('=').unwrap_or((pair, ""));
        let wrong = |setting, expected| EndpointError::Value { setting, value: value.into(), expected };
        match setting {
            "bitrate" => {
                let known = value.parse().ok().filter(|rate| SLCAN_BIT_RATES.contains(rate));
                bit_rate = known.ok_or_else(|| {
                    wrong("bitrate", "10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000 or 1000000")
                })?;
            }
            "baud" => {
                let known = value.parse().ok().filter(|baud| (50..=4_000_000).contains(baud));
                baud = known.ok_or_else(|| wrong("baud", "50 to 4000000"))?;
            }
            _ => {
                return Err(EndpointError::Setting { setting: setting.into(), expected: "bitrate or baud" });
            }
        }
    }
    if path.is_empty() {
        Err(EndpointError::Empty)
    } else {
        Ok(CanEndpoint::Slcan { path: path.into(), bit_rate, baud })
    }
}

impl fmt::Display for CanEndpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SocketCan { interface } => write!(f, "socketcan:{interface}"),
            Self::Slcan { path, bit_rate, baud: BAUD } => write!(f, "slcan:{path}?bitrate={bit_rate}"),
            Self::Slcan { path, bit_rate, baud } => {
                write!(f, "slcan:{path}?bitrate={bit_rate}&baud={baud}")
            }
            Self::SlcanPty { link } => write!(f, "slcan-pty:{}", link.display()),
            Self::Socketcand { address, bus } => write!(f, "socketcand:{address}/{bus}"),
            Self::Virtual { name } => write!(f, "virtual:{name}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endpoints_come_back_from_their_text() {
        for text in [
            "socketcan:can0",
            "slcan:/dev/ttyACM0?bitrate=250000",
            "slcan:COM4?bitrate=1000000&baud=57600",
            "slcan-pty:/tmp/can",
            "socketcand:127.0.0.1:29536/can0",
            "socketcand:[::1]:29536/vcan1",
            "virtual:a",
        ] {
            assert_eq!(text.parse::<CanEndpoint>().unwrap().to_string(), text);
        }
        let short: CanEndpoint = "slcan:/dev/ttyACM0".parse().unwrap();
        assert_eq!(short.to_string(), "slcan:/dev/ttyACM0?bitrate=500000");
    }

    #[test]
    fn errors_say_what_is_expected() {
        let say = |text: &str| text.parse::<CanEndpoint>().unwrap_err().to_string();
        for text in ["", "can0", "socketcan:", "tcp:host:1", "virtual"] {
            assert!(say(text).ends_with("or virtual:NAME expected"), "{}", say(text));
        }
        for text in
            ["socketcand:host/can0", "socketcand:host:99999/can0", "socketcand:host:1", "socketcand:h:1/a b"]
        {
            assert!(say(text).ends_with("socketcand:HOST:PORT/BUS expected, PORT a number up to 65535"));
        }
        assert!(say("slcan:/dev/ttyACM0?bitrate=300000").starts_with("bitrate \"300000\": 10000, "));
        assert_eq!(say("slcan:/dev/ttyACM0?speed=1"), "unknown setting \"speed\": bitrate or baud expected");
    }
}
