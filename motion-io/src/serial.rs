//! Serial ports of the machine.

use core::time::Duration;
use std::io::{self, Read, Write};
use std::path::Path;

use serialport::{DataBits, FlowControl, SerialPort, StopBits};

use crate::endpoint::{Endpoint, Parity, Settings};
use crate::port::{OpenError, Port};

/// The system takes no endless time limits.
const LONGEST: Duration = Duration::from_secs(3600);

struct Serial(Box<dyn SerialPort>);

pub(crate) fn open(endpoint: &Endpoint, path: &str, settings: &Settings) -> Result<Box<dyn Port>, OpenError> {
    #[cfg(unix)]
    check(endpoint, path)?;
    let parity = match settings.parity {
        // A pseudo-terminal has no parity bits and refuses the setting.
        _ if is_pseudo_terminal(path) => serialport::Parity::None,
        Parity::None => serialport::Parity::None,
        Parity::Odd => serialport::Parity::Odd,
        Parity::Even => serialport::Parity::Even,
    };
    let stop_bits = if settings.stop_bits == 2 { StopBits::Two } else { StopBits::One };
    let port = serialport::new(path, settings.baud)
        .data_bits(DataBits::Eight)
        .parity(parity)
        .stop_bits(stop_bits)
        .flow_control(FlowControl::None)
        .open()
        .map_err(|error| failed(endpoint, path, error))?;
    // What came before we listened is nobody's answer.
    port.clear(serialport::ClearBuffer::Input).map_err(|error| failed(endpoint, path, error))?;
    Ok(Box::new(Serial(port)))
}

/// What the system's error for such a file would not say.
#[cfg(unix)]
fn check(endpoint: &Endpoint, path: &str) -> Result<(), OpenError> {
    use std::os::unix::fs::FileTypeExt;
    let found = std::fs::metadata(path).map_err(|error| OpenError::new(endpoint, error))?;
    if found.file_type().is_char_device() {
        Ok(())
    } else {
        Err(OpenError::NotSerial { endpoint: endpoint.to_string() })
    }
}

fn is_pseudo_terminal(path: &str) -> bool {
    Path::new(path).canonicalize().is_ok_and(|path| path.starts_with("/dev/pts"))
}

fn failed(endpoint: &Endpoint, path: &str, error: serialport::Error) -> OpenError {
    match error.kind() {
        serialport::ErrorKind::NoDevice if Path::new(path).exists() => {
            OpenError::Busy { endpoint: endpoint.to_string() }
        }
        serialport::ErrorKind::NoDevice => OpenError::Missing { endpoint: endpoint.to_string() },
        serialport::ErrorKind::InvalidInput => OpenError::NotSerial { endpoint: endpoint.to_string() },
        _ => OpenError::new(endpoint, error.into()),
    }
}

impl Port for Serial {
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.0.set_timeout(timeout.min(LONGEST)).map_err(io::Error::from)?;
        match self.0.read(buffer) {
            // The system says "end of file" for a line that is gone, "timed out" for a silent one.
            Ok(0) => Err(io::Error::new(io::ErrorKind::BrokenPipe, "the port is gone")),
            Ok(len) => Ok(len),
            Err(error) if error.kind() == io::ErrorKind::TimedOut => Ok(0),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => Ok(0),
            Err(error) => Err(error),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.set_timeout(Duration::from_secs(5)).map_err(io::Error::from)?;
        self.0.write_all(bytes)?;
        self.0.flush()
    }
}

pub(crate) fn list() -> io::Result<Vec<(String, String)>> {
    let ports = serialport::available_ports().map_err(io::Error::from)?;
    let describe = |kind: &serialport::SerialPortType| match kind {
        serialport::SerialPortType::UsbPort(usb) => {
            let product = usb.product.as_deref().unwrap_or("USB");
            format!("{product} ({:04X}:{:04X})", usb.vid, usb.pid)
        }
        serialport::SerialPortType::PciPort => "PCI".into(),
        serialport::SerialPortType::BluetoothPort => "Bluetooth".into(),
        serialport::SerialPortType::Unknown => String::new(),
    };
    Ok(ports.iter().map(|port| (port.port_name.clone(), describe(&port.port_type))).collect())
}
