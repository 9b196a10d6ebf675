//! What a user interface in front of the controller goes by: the password of the configuration, service
//! mode, and the settings of the serial ports (manual A 4.3.4.1, 4.3.4.5, 6.3.1, 6.3.3).

use super::Controller;
use crate::parameters::Values;

/// Password of the configuration menu and of a scan by hand (4.3.4.1, 4.3.4.4).
pub const CONFIGURATION_PASSWORD: u16 = 9228;
/// Password that switches service mode on (4.3.4.5).
pub const SERVICE_PASSWORD: u16 = 8117;

/// The password is another one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("wrong password")]
pub struct WrongPassword;

/// A port of connector C1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ComPort {
    /// COM 1.
    Com1,
    /// COM 2.
    Com2,
}

/// Parity check of a serial port.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum Parity {
    /// No parity bit.
    None,
    /// Odd.
    Odd,
    /// Even, as delivered.
    #[default]
    Even,
}

/// How a serial port is set (6.3.3.1); 8 data bits always.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SerialPort {
    /// Bits per second, `[007]`, `[008]`.
    pub baud_rate: u32,
    /// `[009]`, `[010]`.
    pub parity: Parity,
    /// 1 or 2, `[011]`, `[012]`.
    pub stop_bits: u8,
    /// Whether CoDeSys has the port, `[006]`; LB2 is on the other one.
    pub codesys: bool,
    /// Whether the PC parameter editor has it, `[019]`.
    pub ascii: bool,
}

impl ComPort {
    /// How the parameters set this port.
    #[must_use]
    pub fn settings(self, values: &Values) -> SerialPort {
        let at = match self {
            Self::Com1 => 0,
            Self::Com2 => 1,
        };
        let own = |selected: u16| values.at(selected, 0) == at as i32;
        SerialPort {
            baud_rate: match values.at(7, at) {
                0 => 9600,
                2 => 28_800,
                3 => 38_400,
                4 => 57_600,
                _ => 19_200,
            },
            parity: match values.at(9, at) {
                0 => Parity::None,
                1 => Parity::Odd,
                _ => Parity::Even,
            },
            stop_bits: if values.at(11, at) == 1 { 2 } else { 1 },
            codesys: own(6),
            ascii: own(19),
        }
    }
}

impl<S, R> Controller<S, R> {
    /// Whether a user interface asks for [`CONFIGURATION_PASSWORD`] before it lets somebody change
    /// parameters or scan by hand: unless `[002]` or service mode says otherwise.
    #[must_use]
    pub fn asks_for_password(&self) -> bool {
        !self.service_mode && self.working.at(2, 0) == 0
    }

    /// Lets somebody into the configuration with a password, which counts only where one is asked for.
    ///
    /// # Errors
    /// [`WrongPassword`].
    pub fn enter_configuration(&self, password: u16) -> Result<(), WrongPassword> {
        let good = !self.asks_for_password() || password == CONFIGURATION_PASSWORD;
        if good { Ok(()) } else { Err(WrongPassword) }
    }

    /// Switches service mode on: until it ends, or power is lost, no password is asked for.
    ///
    /// # Errors
    /// [`WrongPassword`] unless it is [`SERVICE_PASSWORD`].
    pub const fn begin_service_mode(&mut self, password: u16) -> Result<(), WrongPassword> {
        if password != SERVICE_PASSWORD {
            return Err(WrongPassword);
        }
        self.service_mode = true;
        Ok(())
    }

    /// Switches service mode off.
    pub const fn end_service_mode(&mut self) {
        self.service_mode = false;
    }

    /// How a serial port is set now.
    #[must_use]
    pub fn serial_port(&self, port: ComPort) -> SerialPort {
        port.settings(&self.working)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Model, STORAGE_LEN};
    use alloc::vec;
    use alloc::vec::Vec;
    use lb2::device::Device;

    fn controller(storage: Vec<u8>) -> Controller<Vec<u8>, Vec<u8>> {
        Controller::power_on(Model::Gel8230, storage, vec![0; 65_536])
    }

    fn port(changes: &[(u16, i32)], port: ComPort) -> SerialPort {
        let mut values = Values::factory();
        changes.iter().for_each(|&(index, value)| {
            values.set(index, value).unwrap();
        });
        port.settings(&values)
    }

    /// 4.3.4.5: for the duration of service, as long as the device remains switched on.
    #[test]
    fn service_mode_lasts_until_power_is_lost() {
        let mut on = controller(vec![0xFF; STORAGE_LEN]);
        assert!(on.asks_for_password());
        assert_eq!(on.enter_configuration(SERVICE_PASSWORD), Err(WrongPassword));
        assert_eq!(on.enter_configuration(9228), Ok(()));
        assert!(on.asks_for_password(), "again each time");
        assert_eq!(on.begin_service_mode(9228), Err(WrongPassword));
        assert_eq!(on.begin_service_mode(8117), Ok(()));
        assert!(!on.asks_for_password());
        assert_eq!(on.enter_configuration(0), Ok(()));
        on.end_service_mode();
        assert!(on.asks_for_password());
        on.begin_service_mode(8117).unwrap();
        assert!(controller(on.power_off()).asks_for_password());
    }

    #[test]
    fn parameter_002_switches_the_password_off_for_good() {
        let mut on = controller(vec![0xFF; STORAGE_LEN]);
        assert_eq!(on.write_parameter(2, 1).code.0, 0);
        assert!(on.asks_for_password(), "not before the loader has it");
        assert_eq!(on.call_loader(), -1);
        assert!(!on.asks_for_password());
        on.save_parameters().unwrap();
        assert!(!controller(on.power_off()).asks_for_password());
    }

    #[test]
    fn ports_as_delivered() {
        let lb2 = port(&[], ComPort::Com2);
        assert_eq!((lb2.baud_rate, lb2.parity, lb2.stop_bits, lb2.codesys), (19_200, Parity::Even, 1, false));
        assert!(port(&[], ComPort::Com1).codesys);
    }

    #[test]
    fn parameters_006_and_019_give_the_ports_away() {
        for (index, has) in [(6, (|port| port.codesys) as fn(SerialPort) -> bool), (19, |port| port.ascii)] {
            for (value, expected) in [(0, [true, false]), (1, [false, true])] {
                let found = [ComPort::Com1, ComPort::Com2].map(|com| has(port(&[(index, value)], com)));
                assert_eq!(found, expected, "[{index:03}] = {value}");
            }
        }
    }

    #[test]
    fn parameter_007_is_the_baud_rate() {
        let rates = [0, 1, 2, 3, 4].map(|value| port(&[(7, value)], ComPort::Com1).baud_rate);
        assert_eq!(rates, [9600, 19_200, 28_800, 38_400, 57_600]);
        assert_eq!(port(&[(8, 4)], ComPort::Com2).baud_rate, 57_600);
        assert_eq!(port(&[(8, 4)], ComPort::Com1).baud_rate, 19_200);
    }

    #[test]
    fn parameter_009_is_the_parity_check() {
        let found = [0, 1, 2].map(|value| port(&[(9, value)], ComPort::Com1).parity);
        assert_eq!(found, [Parity::None, Parity::Odd, Parity::Even]);
        assert_eq!(port(&[(10, 0)], ComPort::Com2).parity, Parity::None);
    }

    #[test]
    fn parameter_011_is_the_stop_bits() {
        assert_eq!([0, 1].map(|value| port(&[(11, value)], ComPort::Com1).stop_bits), [1, 2]);
        assert_eq!(port(&[(12, 1)], ComPort::Com2).stop_bits, 2);
    }
}
