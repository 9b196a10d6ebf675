//! The configuration module's process data: four words in each direction (manual B 7).
//!
//! Words lie in the 8 bytes one after the other, low byte first. On CANopen the documents map no
//! PDO to the module; [`RPDO`] and [`TPDO`] are a project-defined choice.

use crate::code::{Command, Status};
use crate::request::{Reply, Request};

/// COB-ID without node ID of the PDO to the drive, its RPDO 4 (project-defined).
pub const RPDO: u16 = 0x500;
/// COB-ID without node ID of the PDO from the drive, its TPDO 4 (project-defined).
pub const TPDO: u16 = 0x480;

/// Words to the drive: control and arguments (manual B 7.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Output {
    /// Bits 15…8 of the control word.
    pub command: Command,
    /// Bits 3…0 of the control word; a command is evaluated only when they change.
    pub count: u8,
    /// Words 2, 3 and 4.
    pub words: [u16; 3],
}

impl Output {
    /// Nothing ever asked.
    pub const IDLE: Self = Self { command: Command::NO_OPERATION, count: 0, words: [0; 3] };

    /// A request under this count.
    #[must_use]
    pub const fn new(request: &Request, count: u8) -> Self {
        Self { command: request.command(), count: count & 0xF, words: request.words() }
    }

    /// The 8 bytes on the wire.
    #[must_use]
    pub const fn encode(&self) -> [u8; 8] {
        bytes([
            (self.command.0 as u16) << 8 | (self.count & 0xF) as u16,
            self.words[0],
            self.words[1],
            self.words[2],
        ])
    }

    /// From 8 bytes; the reserved bits 7…4 are ignored.
    #[must_use]
    pub const fn parse(image: [u8; 8]) -> Self {
        let [control, a, b, c] = words(image);
        Self { command: Command((control >> 8) as u8), count: (control & 0xF) as u8, words: [a, b, c] }
    }
}

/// Words from the drive: status and results (manual B 7.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Input {
    /// Bits 15…8 of the status word, and words 2, 3 and 4.
    pub reply: Reply,
    /// Bits 3…0 of the status word: echo of the control word's count.
    pub count: u8,
}

impl Input {
    /// What a drive shows after its start.
    pub const IDLE: Self = Self { reply: Reply::new(Status::OK, [0; 3]), count: 0 };

    /// The 8 bytes on the wire.
    #[must_use]
    pub const fn encode(&self) -> [u8; 8] {
        let status = (self.reply.status.0 as u16) << 8 | (self.count & 0xF) as u16;
        let [a, b, c] = self.reply.words;
        bytes([status, a, b, c])
    }

    /// From 8 bytes; the reserved bits 7…4 are ignored.
    #[must_use]
    pub const fn parse(image: [u8; 8]) -> Self {
        let [status, a, b, c] = words(image);
        Self { reply: Reply::new(Status((status >> 8) as u8), [a, b, c]), count: (status & 0xF) as u8 }
    }
}

const fn bytes(words: [u16; 4]) -> [u8; 8] {
    let ([a, b], [c, d]) = (words[0].to_le_bytes(), words[1].to_le_bytes());
    let ([e, f], [g, h]) = (words[2].to_le_bytes(), words[3].to_le_bytes());
    [a, b, c, d, e, f, g, h]
}

const fn words(bytes: [u8; 8]) -> [u16; 4] {
    let [a, b, c, d, e, f, g, h] = bytes;
    [
        u16::from_le_bytes([a, b]),
        u16::from_le_bytes([c, d]),
        u16::from_le_bytes([e, f]),
        u16::from_le_bytes([g, h]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::request::{Value, tests::any_request};
    use crate::upid::Upid;
    use proptest::prelude::*;

    /// Manual B 7.1 and 7.2: command or status in bits 8…15, count in bits 0…3, low byte first.
    #[test]
    fn control_and_status_words() {
        let read = Request::Read { value: Value::Ram, upid: Upid(0x13A2) };
        assert_eq!(Output::new(&read, 3).encode(), [0x03, 0x11, 0xA2, 0x13, 0, 0, 0, 0]);
        let input = Input { reply: Reply::with_value(Status::RANGE, 0x13A2, 0x0403_0201), count: 3 };
        assert_eq!(input.encode(), [0x03, 0xC2, 0xA2, 0x13, 1, 2, 3, 4]);
        // Reserved bits say nothing.
        assert_eq!(Input::parse([0xF3, 0xC2, 0xA2, 0x13, 1, 2, 3, 4]), input);
        assert_eq!(Output::new(&Request::Restart, 0).encode(), [0, 0x30, 0, 0, 0, 0, 0, 0]);
    }

    proptest! {
        #[test]
        fn images_come_back(request in any_request(), count in 0u8..16, status: u8, words: [u16; 3]) {
            let output = Output::new(&request, count);
            prop_assert_eq!(Output::parse(output.encode()), output);
            let input = Input { reply: Reply::new(Status(status), words), count };
            prop_assert_eq!(Input::parse(input.encode()), input);
        }
    }
}
