//! Endpoints as people write them, parsed in one place.
//!
//! | written | means |
//! |---|---|
//! | `/dev/ttyUSB0`, `COM3` | a serial port, 19200 baud, even parity, 1 stop bit |
//! | `serial:/dev/ttyUSB0?baud=9600&parity=none&stop=2` | the same with other settings |
//! | `tcp:HOST:PORT` | a byte stream over TCP |
//! | `pty:LINK` | a pseudo-terminal made by us, linked at the path LINK |
//!
//! CAN, which carries a byte stream too (LB2 over CAN, [`lb2::can`]):
//!
//! | written | means |
//! |---|---|
//! | `socketcan:can0` | a CAN interface of the Linux kernel |
//! | `slcan:/dev/ttyACM0?bitrate=500000` | a serial adapter that speaks slcan |
//! | `slcan-pty:LINK` | be the adapter: others open LINK with their slcan driver |
//! | `socketcand:HOST:PORT/can0` | a bus of a socketcand server |
//! | `virtual:NAME` | a virtual bus inside this process |

mod can;

pub use can::{CanEndpoint, SLCAN_BIT_RATES};

use core::fmt;
use core::str::FromStr;
use core::time::Duration;
use std::path::PathBuf;

/// A serial endpoint.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Endpoint {
    /// A serial port of the machine.
    Serial {
        /// Device path or port name.
        path: String,
        /// Line settings.
        settings: Settings,
    },
    /// A byte stream over TCP: a client connects to it, a device listens on it.
    Tcp {
        /// Host name or address and port number, `HOST:PORT`.
        address: String,
    },
    /// A pseudo-terminal to be made, reachable at this path.
    Pty {
        /// Path of the symbolic link to its other end.
        link: PathBuf,
    },
    /// LB2 over CAN: the byte stream cut into CAN frames ([`lb2::can`]).
    Can(CanEndpoint),
}

/// Parity bit of a character.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parity {
    /// No parity bit.
    None,
    /// Odd.
    Odd,
    /// Even.
    Even,
}

/// Settings of a serial line: always 8 data bits, least significant first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// Bits per second.
    pub baud: u32,
    /// Parity bit.
    pub parity: Parity,
    /// Stop bits, 1 or 2.
    pub stop_bits: u8,
}

impl Default for Settings {
    /// As the controllers are delivered: 19200 baud, even parity, 1 stop bit (manual A, Appendix 1).
    fn default() -> Self {
        Self { baud: 19_200, parity: Parity::Even, stop_bits: 1 }
    }
}

impl Settings {
    /// Time that one character takes on the line: start, data, parity and stop bits.
    #[must_use]
    pub fn character_time(&self) -> Duration {
        let bits = 9 + u64::from(self.parity != Parity::None) + u64::from(self.stop_bits);
        Duration::from_nanos(bits * 1_000_000_000 / u64::from(self.baud.max(1)))
    }
}

/// Why a text is no endpoint.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum EndpointError {
    /// Nothing was written.
    #[error(
        "an endpoint is missing: /dev/ttyUSB0, serial:PATH?baud=19200&parity=even, tcp:HOST:PORT or pty:LINK expected"
    )]
    Empty,
    /// `tcp:` without host or port number.
    #[error("{0:?}: tcp:HOST:PORT expected, PORT a number up to 65535")]
    Tcp(String),
    /// No CAN endpoint.
    #[error(
        "{0:?}: socketcan:can0, slcan:PATH?bitrate=500000, slcan-pty:LINK, socketcand:HOST:PORT/BUS or virtual:NAME expected"
    )]
    Can(String),
    /// `socketcand:` without host, port number or bus.
    #[error("{0:?}: socketcand:HOST:PORT/BUS expected, PORT a number up to 65535")]
    Socketcand(String),
    /// A setting that such endpoints do not have.
    #[error("unknown setting {setting:?}: {expected} expected")]
    Setting {
        /// What came.
        setting: String,
        /// Settings that there are.
        expected: &'static str,
    },
    /// A value that a setting does not take.
    #[error("{setting} {value:?}: {expected} expected")]
    Value {
        /// The setting.
        setting: &'static str,
        /// What came.
        value: String,
        /// What it takes.
        expected: &'static str,
    },
}

impl FromStr for Endpoint {
    type Err = EndpointError;

    fn from_str(text: &str) -> Result<Self, EndpointError> {
        if let Some(address) = text.strip_prefix("tcp:") {
            let wrong = || EndpointError::Tcp(address.into());
            let (host, port) = address.rsplit_once(':').ok_or_else(wrong)?;
            if host.is_empty() || port.parse::<u16>().is_err() {
                return Err(wrong());
            }
            return Ok(Self::Tcp { address: address.into() });
        }
        if let Some(link) = text.strip_prefix("pty:") {
            return if link.is_empty() {
                Err(EndpointError::Empty)
            } else {
                Ok(Self::Pty { link: link.into() })
            };
        }
        if CanEndpoint::names(text) {
            return text.parse().map(Self::Can);
        }
        let (path, query) = match text.strip_prefix("serial:") {
            Some(rest) => rest.split_once('?').unwrap_or((rest, "")),
            None => (text, ""),
        };
        if path.is_empty() {
            return Err(EndpointError::Empty);
        }
        let mut settings = Settings::default();
        for pair in query.split('&').filter(|pair| !pair.is_empty()) {
            settings.set(pair)?;
        }
        Ok(Self::Serial { path: path.into(), settings })
    }
}

impl Settings {
    fn set(&mut self, pair: &str) -> Result<(), EndpointError> {
        let (setting, value) = pair.split_once('=').unwrap_or((pair, ""));
        let wrong = |setting, expected| EndpointError::Value { setting, value: value.into(), expected };
        match setting {
            "baud" => {
                let baud = value.parse().ok().filter(|baud| (50..=4_000_000).contains(baud));
                self.baud = baud.ok_or_else(|| wrong("baud", "50 to 4000000"))?;
            }
            "parity" => {
                self.parity = match value {
                    "none" => Parity::None,
                    "odd" => Parity::Odd,
                    "even" => Parity::Even,
                    _ => return Err(wrong("parity", "none, odd or even")),
                };
            }
            "stop" => {
                self.stop_bits = match value {
                    "1" => 1,
                    "2" => 2,
                    _ => return Err(wrong("stop", "1 or 2")),
                };
            }
            _ => {
                let expected = "baud, parity or stop";
                return Err(EndpointError::Setting { setting: setting.into(), expected });
            }
        }
        Ok(())
    }
}

impl fmt::Display for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Serial { path, settings } if *settings == Settings::default() => f.write_str(path),
            Self::Serial { path, settings } => {
                let parity = match settings.parity {
                    Parity::None => "none",
                    Parity::Odd => "odd",
                    Parity::Even => "even",
                };
                write!(f, "serial:{path}?baud={}&parity={parity}&stop={}", settings.baud, settings.stop_bits)
            }
            Self::Tcp { address } => write!(f, "tcp:{address}"),
            Self::Pty { link } => write!(f, "pty:{}", link.display()),
            Self::Can(endpoint) => endpoint.fmt(f),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endpoints_come_back_from_their_text() {
        for text in [
            "/dev/ttyUSB0",
            "COM3",
            "serial:/dev/ttyS0?baud=57600&parity=none&stop=2",
            "tcp:127.0.0.1:4000",
            "tcp:[::1]:4000",
            "pty:/tmp/line",
            "socketcan:can0",
            "slcan-pty:/tmp/can",
        ] {
            assert_eq!(text.parse::<Endpoint>().unwrap().to_string(), text);
        }
        let short: Endpoint = "serial:/dev/ttyS0?baud=9600".parse().unwrap();
        assert_eq!(short.to_string(), "serial:/dev/ttyS0?baud=9600&parity=even&stop=1");
    }

    #[test]
    fn errors_say_what_is_expected() {
        let say = |text: &str| text.parse::<Endpoint>().unwrap_err().to_string();
        assert!(say("").starts_with("an endpoint is missing"));
        assert!(say("pty:").starts_with("an endpoint is missing"));
        assert_eq!(say("tcp:host"), "\"host\": tcp:HOST:PORT expected, PORT a number up to 65535");
        assert_eq!(
            say("tcp:host:99999"),
            "\"host:99999\": tcp:HOST:PORT expected, PORT a number up to 65535"
        );
        assert_eq!(
            say("serial:/dev/ttyS0?speed=1"),
            "unknown setting \"speed\": baud, parity or stop expected"
        );
        assert_eq!(say("serial:/dev/ttyS0?parity=mark"), "parity \"mark\": none, odd or even expected");
        assert_eq!(say("serial:/dev/ttyS0?baud=fast"), "baud \"fast\": 50 to 4000000 expected");
    }

    /// 19,200 baud 8E1: 11 bits, 572.9 µs.
    #[test]
    fn character_times() {
        assert_eq!(Settings::default().character_time(), Duration::from_nanos(572_916));
        let plain = Settings { baud: 9600, parity: Parity::None, stop_bits: 1 };
        assert_eq!(plain.character_time(), Duration::from_nanos(1_041_666));
    }
}
