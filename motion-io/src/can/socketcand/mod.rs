//! The socketcand protocol: CAN over a TCP stream, as text in angle brackets.

mod client;
#[cfg(feature = "virtual")]
mod server;

use core::fmt::Write as _;
use core::time::Duration;

use embedded_can::{ExtendedId, Id, StandardId};
use pdo::Frame;

pub(super) use client::Client;
#[cfg(feature = "virtual")]
pub use server::Server;

/// A message longer than this is none.
const LONGEST: usize = 256;

/// Cuts a stream into messages: what stands between `<` and `>`, without blanks at its ends.
#[derive(Debug, Default)]
struct Messages {
    buffer: Option<String>,
}

impl Messages {
    fn push(&mut self, byte: u8) -> Option<String> {
        match (byte, &mut self.buffer) {
            (b'<', buffer) => {
                *buffer = Some(String::new());
                None
            }
            (b'>', buffer) => buffer.take().map(|text| text.trim().to_owned()),
            (_, Some(text)) if text.len() < LONGEST && byte.is_ascii() => {
                text.push(char::from(byte));
                None
            }
            (_, buffer) => {
                *buffer = None;
                None
            }
        }
    }
}

/// Identifiers are written with 3 digits, or with 8 if extended.
fn write_id(text: &mut String, id: Id) {
    let _ = match id {
        Id::Standard(id) => write!(text, "{:03X}", id.as_raw()),
        Id::Extended(id) => write!(text, "{:08X}", id.as_raw()),
    };
}

fn parse_id(text: &str) -> Option<Id> {
    let raw = u32::from_str_radix(text, 16).ok()?;
    match text.len() {
        8 => ExtendedId::new(raw).map(Id::Extended),
        1..=3 => StandardId::new(u16::try_from(raw).ok()?).map(Id::Standard),
        _ => None,
    }
}

/// Hex bytes, with or without blanks between them.
fn parse_data<'a>(words: impl Iterator<Item = &'a str>) -> Option<(usize, [u8; 8])> {
    let (mut data, mut len) = ([0; 8], 0);
    for word in words {
        let digits = word.as_bytes();
        // "1" is a byte too.
        for pair in digits.chunks(2) {
            let pair = core::str::from_utf8(pair).ok()?;
            *data.get_mut(len)? = u8::from_str_radix(pair, 16).ok()?;
            len += 1;
        }
    }
    Some((len, data))
}

/// `< send 123 2 AA BB >`, `< sendrtr 701 1 >`.
fn send_message(frame: &Frame) -> String {
    let mut text = String::from(if frame.is_remote() { "< sendrtr " } else { "< send " });
    write_id(&mut text, frame.id());
    let _ = write!(text, " {}", frame.len());
    for byte in frame.data() {
        let _ = write!(text, " {byte:02X}");
    }
    text.push_str(" >");
    text
}

/// The words after `send` and `sendrtr`.
#[cfg(any(test, feature = "virtual"))]
fn parse_send<'a>(mut words: impl Iterator<Item = &'a str>, remote: bool) -> Option<Frame> {
    let id = parse_id(words.next()?)?;
    let len: usize = words.next()?.parse().ok()?;
    if remote {
        return Frame::remote_frame(id, len).filter(|_| words.next().is_none());
    }
    let (found, data) = parse_data(words)?;
    (found == len).then(|| Frame::data_frame(id, data.get(..len)?)).flatten()
}

/// `< frame 123 23.424242 AABB >`, `< rtr 701 23.424242 1 >`. Without data two blanks stand before the
/// bracket, which clients count on.
#[cfg(feature = "virtual")]
fn frame_message(frame: &Frame, at: Duration) -> String {
    let mut text = String::from(if frame.is_remote() { "< rtr " } else { "< frame " });
    write_id(&mut text, frame.id());
    let _ = write!(text, " {}.{:06} ", at.as_secs(), at.subsec_micros());
    if frame.is_remote() {
        let _ = write!(text, "{}", frame.len());
    }
    for byte in frame.data() {
        let _ = write!(text, "{byte:02X}");
    }
    text.push_str(" >");
    text
}

/// The words after `frame` and `rtr`.
fn parse_frame<'a>(mut words: impl Iterator<Item = &'a str>, remote: bool) -> Option<(Frame, Duration)> {
    let id = parse_id(words.next()?)?;
    let (seconds, micros) = words.next()?.split_once('.')?;
    let at = Duration::from_secs(seconds.parse().ok()?)
        .checked_add(Duration::from_micros(micros.parse().ok()?))?;
    let frame = if remote {
        Frame::remote_frame(id, words.next()?.parse().ok()?)?
    } else {
        let (len, data) = parse_data(words)?;
        Frame::data_frame(id, data.get(..len)?)?
    };
    Some((frame, at))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> impl Iterator<Item = &str> {
        text.trim_matches(['<', '>', ' ']).split_whitespace().skip(1)
    }

    #[test]
    fn messages_come_in_any_pieces() {
        let mut messages = Messages::default();
        let mut all = |text: &str| text.bytes().filter_map(|byte| messages.push(byte)).collect::<Vec<_>>();
        assert_eq!(all("< hi >noise< ok ><echo><"), ["hi", "ok", "echo"]);
        assert_eq!(all(" sen"), [""; 0]);
        assert_eq!(all("d 1 0 ><send < hi >"), ["send 1 0", "hi"]);
        let long = format!("<{}>< ok >", "x".repeat(10_000));
        assert_eq!(all(&long), ["ok"]);
    }

    #[test]
    fn frames_both_ways() {
        let data = Frame::standard(0x123, [0x11, 0x22, 0x33, 0x44]);
        let empty = Frame::standard(0x080, []);
        let extended = Frame::data_frame(ExtendedId::new(0x123).unwrap(), &[1]).unwrap();
        let remote = Frame::remote_frame(StandardId::new(0x701).unwrap(), 1).unwrap();
        for (frame, text) in [
            (data, "< send 123 4 11 22 33 44 >"),
            (empty, "< send 080 0 >"),
            (extended, "< send 00000123 1 01 >"),
            (remote, "< sendrtr 701 1 >"),
        ] {
            assert_eq!(send_message(&frame), text);
            assert_eq!(parse_send(words(text), frame.is_remote()), Some(frame));
        }
        // As other clients write it.
        assert_eq!(parse_send(words("< send 7FF 2 1 F1 >"), false), Some(Frame::standard(0x7FF, [1, 0xF1])));
        assert_eq!(parse_send(words("< send 7FF 3 1 F1 >"), false), None);
        assert_eq!(parse_send(words("< send 800 0 >"), false), None);
        assert_eq!(parse_send(words("< send 7FF 9 1 2 3 4 5 6 7 8 9 >"), false), None);
    }

    #[cfg(feature = "virtual")]
    #[test]
    fn received_frames_both_ways() {
        let at = Duration::from_micros(23_424_242);
        let remote = Frame::remote_frame(StandardId::new(0x701).unwrap(), 1).unwrap();
        for (frame, text) in [
            (Frame::standard(0x123, [0x11, 0x22]), "< frame 123 23.424242 1122 >"),
            (Frame::standard(0x080, []), "< frame 080 23.424242  >"),
            (remote, "< rtr 701 23.424242 1 >"),
        ] {
            assert_eq!(frame_message(&frame, at), text);
            assert_eq!(parse_frame(words(text), frame.is_remote()), Some((frame, at)));
        }
        let spaced = parse_frame(words("< frame 123 23.424242 11 22 >"), false);
        assert_eq!(spaced, Some((Frame::standard(0x123, [0x11, 0x22]), at)));
    }
}
