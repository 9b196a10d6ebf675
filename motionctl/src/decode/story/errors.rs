//! Error reports in words: SocketCAN's (`linux/can/error.h`), PEAK's, Vector's.

use super::super::names::bytes;

/// The error class of SocketCAN has bits for these; [`COUNTERS`] goes without words.
const CLASSES: [&str; 9] = [
    "a frame could not be sent in time",
    "arbitration lost",
    "controller",
    "protocol violation",
    "transceiver",
    "no acknowledge",
    "bus-off",
    "bus error",
    "controller restarted",
];
const LOST_ARBITRATION: usize = 1;
const CONTROLLER: usize = 2;
const PROTOCOL: usize = 3;
const TRANSCEIVER: usize = 4;
const COUNTERS: u32 = 0x200;

/// Bits of `data[1]`.
const CONTROLLERS: [&str; 7] = [
    "receive buffer overflow",
    "transmit buffer overflow",
    "receive error warning",
    "transmit error warning",
    "receive error passive",
    "transmit error passive",
    "error active again",
];
/// Bits of `data[2]`. The first three are types of PEAK, as bits, and of the SJA1000, as numbers, too.
const PROTOCOLS: [&str; 7] = [
    "bit error",
    "form error",
    "stuff error",
    "no dominant bit could be sent",
    "no recessive bit could be sent",
    "overload",
    "active error announced",
];
const SENDING: u8 = 0x80;

/// What an error report says.
pub(super) fn error_words(class: u32, data: &[u8]) -> String {
    match (class, data) {
        // Vector: the ECC register of the SJA1000, type, direction and place.
        (0, &[code]) => {
            let what = kind(code >> 6);
            let place = at(code & 0x1F);
            format!("error frame of the bus: {what}{}{place} (ECC {code:08b})", way(code & 0x20 == 0))
        }
        (1 | 2 | 4 | 8, &[way, place, receive, transmit]) => peak(class, way, place, receive, transmit),
        (0, &[kind, way, place, receive, transmit]) => peak(kind.into(), way, place, receive, transmit),
        (0, []) => "error frame of the bus".into(),
        (0, data) => format!("error frame of the bus: {}", bytes(data)),
        (class, data) => socketcan(class, data),
    }
}

/// PEAK, "CAN TRC file format": type, direction, position, both error counters.
fn peak(of: u32, direction: u8, place: u8, receive: u8, transmit: u8) -> String {
    let what = kind(of.trailing_zeros() as u8);
    let (way, place) = (way(direction == 0), at(place));
    format!("error frame of the bus: {what}{way}{place}; {}", counters(transmit, receive))
}

/// A type of error as the SJA1000 numbers them.
fn kind(number: u8) -> &'static str {
    PROTOCOLS.get(..3).and_then(|kinds| kinds.get(usize::from(number))).copied().unwrap_or("other error")
}

const fn way(sending: bool) -> &'static str {
    if sending { " while sending" } else { " while receiving" }
}

fn counters(transmit: u8, receive: u8) -> String {
    format!("error counters: transmit {transmit}, receive {receive}")
}

fn socketcan(class: u32, data: &[u8]) -> String {
    let byte = |at: usize| data.get(at).copied().unwrap_or(0);
    let mut said: Vec<String> = Vec::new();
    for (number, name) in CLASSES.iter().enumerate().filter(|(number, _)| class & 1 << number != 0) {
        let more = match number {
            LOST_ARBITRATION if byte(0) != 0 => format!(" in bit {}", byte(0)),
            CONTROLLER => of(bits(byte(1), &CONTROLLERS)),
            PROTOCOL => {
                let what = of(bits(byte(2), &PROTOCOLS));
                let sending = if byte(2) & SENDING != 0 { way(true) } else { "" };
                format!("{what}{sending}{}", at(byte(3)))
            }
            TRANSCEIVER => of(wires(byte(4))),
            _ => String::new(),
        };
        said.push(format!("{name}{more}"));
    }
    if class & COUNTERS != 0 {
        said.push(counters(byte(6), byte(7)));
    }
    let unknown = class & !(COUNTERS | ((1 << CLASSES.len()) - 1));
    if unknown != 0 {
        said.push(format!("class {unknown:X}h, which is not known"));
    }
    format!("error report: {}", said.join("; "))
}

/// Details behind what they are of.
fn of(details: Vec<&str>) -> String {
    if details.is_empty() { String::new() } else { format!(": {}", details.join(", ")) }
}

/// The names of the bits that are set.
fn bits<'a>(byte: u8, names: &[&'a str]) -> Vec<&'a str> {
    names.iter().enumerate().filter(|(bit, _)| byte & 1 << bit != 0).map(|(_, name)| *name).collect()
}

/// `data[4]`: CANH in the lower half, CANL in the upper one.
fn wires(byte: u8) -> Vec<&'static str> {
    let high = match byte & 0x0F {
        4 => Some("CANH without a wire"),
        5 => Some("CANH shorted to the battery"),
        6 => Some("CANH shorted to the supply"),
        7 => Some("CANH shorted to ground"),
        _ => None,
    };
    let low = match byte >> 4 {
        4 => Some("CANL without a wire"),
        5 => Some("CANL shorted to the battery"),
        6 => Some("CANL shorted to the supply"),
        7 => Some("CANL shorted to ground"),
        8 => Some("CANL shorted to CANH"),
        _ => None,
    };
    high.into_iter().chain(low).collect()
}

/// A place within a frame as the SJA1000 numbers them, and with it SocketCAN, PEAK and Vector.
fn at(place: u8) -> String {
    let name = match place {
        0 => return String::new(),
        0x02 => "bits 28 to 21 of the identifier",
        0x03 => "the start of the frame",
        0x04 => "SRTR",
        0x05 => "IDE",
        0x06 => "bits 20 to 18 of the identifier",
        0x07 => "bits 17 to 13 of the identifier",
        0x08 => "the CRC",
        0x09 => "reserved bit 0",
        0x0A => "the data",
        0x0B => "the length code",
        0x0C => "RTR",
        0x0D => "reserved bit 1",
        0x0E => "bits 4 to 0 of the identifier",
        0x0F => "bits 12 to 5 of the identifier",
        0x11 => "the active error flag",
        0x12 => "the intermission",
        0x13 => "the tolerated dominant bits",
        0x16 => "the passive error flag",
        0x17 => "the error delimiter",
        0x18 => "the CRC delimiter",
        0x19 => "the acknowledge slot",
        0x1A => "the end of the frame",
        0x1B => "the acknowledge delimiter",
        0x1C => "the overload flag",
        other => return format!(" at place {other:02X}h"),
    };
    format!(" at {name}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_class_of_socketcan_is_told_with_its_data() {
        for (class, data, words) in [
            (0x001, [0; 8], "a frame could not be sent in time"),
            (0x002, [0; 8], "arbitration lost"),
            (0x002, [11, 0, 0, 0, 0, 0, 0, 0], "arbitration lost in bit 11"),
            (0x004, [0; 8], "controller"),
            (
                0x004,
                [0, 3, 0, 0, 0, 0, 0, 0],
                "controller: receive buffer overflow, transmit buffer overflow",
            ),
            (0x004, [0, 0x0C, 0, 0, 0, 0, 0, 0], "controller: receive error warning, transmit error warning"),
            (0x004, [0, 0x30, 0, 0, 0, 0, 0, 0], "controller: receive error passive, transmit error passive"),
            (0x004, [0, 0x40, 0, 0, 0, 0, 0, 0], "controller: error active again"),
            (
                0x008,
                [0, 0, 0x84, 0x0A, 0, 0, 0, 0],
                "protocol violation: stuff error while sending at the data",
            ),
            (0x008, [0, 0, 0, 0x1D, 0, 0, 0, 0], "protocol violation at place 1Dh"),
            (0x010, [0, 0, 0, 0, 0x47, 0, 0, 0], "transceiver: CANH shorted to ground, CANL without a wire"),
            (0x010, [0; 8], "transceiver"),
            (0x0A0, [0; 8], "no acknowledge; bus error"),
            (0x140, [0; 8], "bus-off; controller restarted"),
            // Counters only where their bit is set.
            (0x040, [0, 0, 0, 0, 0, 0, 127, 96], "bus-off"),
            (0x240, [0, 0, 0, 0, 0, 0, 127, 96], "bus-off; error counters: transmit 127, receive 96"),
            (0x440, [0; 8], "bus-off; class 400h, which is not known"),
        ] {
            assert_eq!(error_words(class, &data), format!("error report: {words}"));
        }
        // Cut off by whoever copied it.
        assert_eq!(error_words(4, &[]), "error report: controller");
    }

    #[test]
    fn the_reports_of_peak_and_vector_have_no_class() {
        for (class, data, words) in [
            (0, &[][..], ""),
            (
                0,
                &[0b1010_0010][..],
                ": stuff error while receiving at bits 28 to 21 of the identifier (ECC 10100010)",
            ),
            (0, &[0b1101_1001], ": other error while sending at the acknowledge slot (ECC 11011001)"),
            (
                0,
                &[4, 0, 2, 0, 0],
                ": stuff error while sending at bits 28 to 21 of the identifier; error counters: transmit 0, receive 0",
            ),
            (
                8,
                &[1, 0x19, 8, 16],
                ": other error while receiving at the acknowledge slot; error counters: transmit 16, receive 8",
            ),
            (1, &[0, 0, 0, 8], ": bit error while sending; error counters: transmit 8, receive 0"),
            (0, &[1, 2, 3], ": 01 02 03"),
        ] {
            assert_eq!(error_words(class, data), format!("error frame of the bus{words}"));
        }
    }

    /// Whatever bytes there are.
    #[test]
    fn any_report_has_words() {
        for class in (0..16).chain((0..0x1000).step_by(61)) {
            for byte in 0..=255 {
                for len in [0, 1, 4, 5, 8] {
                    assert!(!error_words(class, &[byte; 8][..len]).ends_with([' ', ';', ':']));
                }
            }
        }
    }
}
