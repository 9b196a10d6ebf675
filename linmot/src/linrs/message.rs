//! Which message carries which command.

use super::frame::Message;
use crate::code::{Command, Status};
use crate::request::{Access, List, Memory, Reply, Request, Value};
use crate::table::ListNumber;
use crate::upid::Upid;

/// Main ID of the message that carries a command without a message of its own: sub ID = command ID,
/// data = words 2, 3 and 4; the answer has sub ID F0h and, as data, status, command ID and the words
/// (project-defined).
pub const TUNNEL: u8 = 0x7F;

const CURVES: u8 = 0x04;
const PARAMETERS: u8 = 0x05;
const PROGRAMS: u8 = 0x06;
const ERRORS: u8 = 0x07;
const TABLE: u8 = 0x08;
const TUNNEL_ANSWER: u8 = 0xF0;
/// Error texts come whole.
const TEXT: usize = 32;

/// Sub and main ID of the message for a command.
fn ids(request: &Request) -> (u8, u8) {
    match request {
        Request::Read { value: Value::Rom, .. } => (0x00, PARAMETERS),
        Request::Write { memory: Memory::Rom, .. } => (0x01, PARAMETERS),
        Request::Read { value: Value::Minimum, .. } => (0x05, PARAMETERS),
        Request::Read { value: Value::Maximum, .. } => (0x06, PARAMETERS),
        Request::StartList { list: List::All, .. } => (0x0A, PARAMETERS),
        Request::NextItem(List::All) => (0x0B, PARAMETERS),
        Request::SaveCurves => (0x00, CURVES),
        Request::DeleteCurves => (0x01, CURVES),
        Request::StartCurve { access: Access::Add, .. } => (0x04, CURVES),
        Request::CurveInfo { access: Access::Add, .. } => (0x05, CURVES),
        Request::CurveData { access: Access::Add, .. } => (0x06, CURVES),
        Request::StartCurve { access: Access::Get, .. } => (0x08, CURVES),
        Request::CurveInfo { access: Access::Get, .. } => (0x09, CURVES),
        Request::CurveData { access: Access::Get, .. } => (0x0A, CURVES),
        Request::Restart => (0x02, PROGRAMS),
        Request::Stop => (0x03, PROGRAMS),
        Request::Start => (0x04, PROGRAMS),
        Request::ErrorText { .. } => (0x01, ERRORS),
        Request::ErrorCounts => (0x02, ERRORS),
        Request::SaveTable => (0x00, TABLE),
        Request::ClearTable => (0x01, TABLE),
        Request::DeleteEntry { .. } => (0x02, TABLE),
        Request::WriteEntry { .. } => (0x03, TABLE),
        Request::WriteEntryData { .. } => (0x04, TABLE),
        Request::GetEntry { .. } => (0x05, TABLE),
        Request::GetEntryData { .. } => (0x06, TABLE),
        Request::Presence { .. } => (0x07, TABLE),
        _ => (request.command().0, TUNNEL),
    }
}

/// Words of a request that its message carries.
fn words_carried(request: &Request) -> usize {
    match request {
        Request::Write { .. }
        | Request::StartCurve { access: Access::Add, .. }
        | Request::CurveInfo { access: Access::Add, .. }
        | Request::CurveData { access: Access::Add, .. }
        | Request::WriteEntryData { .. } => 3,
        Request::WriteEntry { .. } => 2,
        Request::Restart
        | Request::Stop
        | Request::Start
        | Request::SaveCurves
        | Request::DeleteCurves
        | Request::ErrorCounts
        | Request::SaveTable
        | Request::ClearTable => 0,
        _ => 1,
    }
}

fn bytes(words: [u16; 3]) -> [u8; 6] {
    let [[a, b], [c, d], [e, f]] = words.map(u16::to_le_bytes);
    [a, b, c, d, e, f]
}

/// Words from the front of data; missing ones are 0.
fn words(data: &[u8]) -> [u16; 3] {
    let byte = |at: usize| data.get(at).copied().unwrap_or(0);
    core::array::from_fn(|n| u16::from_le_bytes([byte(2 * n), byte(2 * n + 1)]))
}

/// The message that carries a command to the drive `id`.
#[must_use]
pub fn telegram(id: u8, request: &Request) -> Message {
    let (sub, main) = ids(request);
    let mut words = request.words();
    if let Request::Presence { list } = request {
        words = [list.get().into(), 0, 0];
    }
    let carried = if main == TUNNEL { 3 } else { words_carried(request) };
    Message::new(id, sub, main, bytes(words).get(..2 * carried).unwrap_or(&[]))
}

/// The command that a message carries; `None` for one of another service.
#[must_use]
pub fn request(message: &Message) -> Option<Request> {
    let [first, low, high] = words(message.data());
    let value = u32::from(high) << 16 | u32::from(low);
    let (upid, curve, entry) = (Upid(first), first, first);
    Some(match (message.main, message.sub) {
        (PARAMETERS, 0x00) => Request::Read { value: Value::Rom, upid },
        (PARAMETERS, 0x01) => Request::Write { memory: Memory::Rom, upid, value },
        (PARAMETERS, 0x05) => Request::Read { value: Value::Minimum, upid },
        (PARAMETERS, 0x06) => Request::Read { value: Value::Maximum, upid },
        (PARAMETERS, 0x0A) => Request::StartList { list: List::All, from: upid },
        (PARAMETERS, 0x0B) => Request::NextItem(List::All),
        (CURVES, 0x00) => Request::SaveCurves,
        (CURVES, 0x01) => Request::DeleteCurves,
        (CURVES, 0x04) => Request::StartCurve { access: Access::Add, curve, info: low, data: high },
        (CURVES, 0x05) => Request::CurveInfo { access: Access::Add, curve, value },
        (CURVES, 0x06) => Request::CurveData { access: Access::Add, curve, value },
        (CURVES, 0x08) => Request::StartCurve { access: Access::Get, curve, info: 0, data: 0 },
        (CURVES, 0x09) => Request::CurveInfo { access: Access::Get, curve, value: 0 },
        (CURVES, 0x0A) => Request::CurveData { access: Access::Get, curve, value: 0 },
        (PROGRAMS, 0x02) => Request::Restart,
        (PROGRAMS, 0x03) => Request::Stop,
        (PROGRAMS, 0x04) => Request::Start,
        (ERRORS, 0x01) => Request::ErrorText { code: first, stringlet: 0 },
        (ERRORS, 0x02) => Request::ErrorCounts,
        (TABLE, 0x00) => Request::SaveTable,
        (TABLE, 0x01) => Request::ClearTable,
        (TABLE, 0x02) => Request::DeleteEntry { entry },
        (TABLE, 0x03) => Request::WriteEntry { entry, size: low },
        (TABLE, 0x04) => Request::WriteEntryData { entry, value },
        (TABLE, 0x05) => Request::GetEntry { entry },
        (TABLE, 0x06) => Request::GetEntryData { entry },
        (TABLE, 0x07) => Request::Presence { list: u8::try_from(first).ok().and_then(ListNumber::new)? },
        (TUNNEL, sub) => Request::parse(Command(sub), [first, low, high])?,
        _ => return None,
    })
}

/// Sub ID of the answer to a message.
fn answer_sub(sub: u8, main: u8) -> u8 {
    match (main, sub) {
        (CURVES, _) => 0x40,
        (PARAMETERS | ERRORS | TABLE, sub) => main << 4 | sub,
        (PROGRAMS, 0x04) => 0x60,
        (TUNNEL, _) => TUNNEL_ANSWER,
        // The drive's configured default answer: state, status words, actual position.
        _ => 0x00,
    }
}

/// The answer of the drive `id` to a command. `text` is the whole text of the error code asked for.
#[must_use]
pub fn response(id: u8, request: &Request, reply: &Reply, text: &[u8]) -> Message {
    let (sub, main) = ids(request);
    let mut data = [0; 1 + 2 + TEXT];
    let mut put = |at: usize, bytes: &[u8]| {
        if let Some(room) = data.get_mut(at..at + bytes.len()) {
            room.copy_from_slice(bytes);
        }
    };
    put(0, &[reply.status.0]);
    let [_, low, high] = reply.words;
    let len = match request {
        Request::Restart | Request::Stop => 9,
        Request::Start => 1,
        Request::ErrorCounts => {
            put(1, &bytes([low, high, 0]));
            5
        }
        Request::ErrorText { code, .. } => {
            put(1, &code.to_le_bytes());
            put(3, text.get(..TEXT).unwrap_or(text));
            3 + TEXT
        }
        _ if main == TUNNEL => {
            put(1, &[request.command().0]);
            put(2, &bytes(reply.words));
            8
        }
        _ => {
            put(1, &bytes(reply.words));
            7
        }
    };
    Message::new(id, answer_sub(sub, main), 0x00, data.get(..len).unwrap_or(&[]))
}

/// What a message answers to a command; `None` if it is no answer to this one.
#[must_use]
pub fn reply(request: &Request, message: &Message) -> Option<Reply> {
    let (sub, main) = ids(request);
    if message.main != 0 || message.sub != answer_sub(sub, main) {
        return None;
    }
    let (&state, rest) = message.data().split_first()?;
    let [first, ..] = request.words();
    let (status, answer) = (Status(state), words(rest));
    let long_enough = |len: usize| (rest.len() >= len).then_some(());
    Some(match request {
        Request::Restart | Request::Stop | Request::Start => Reply::new(status, [0; 3]),
        Request::ErrorCounts => {
            long_enough(4)?;
            let [logged, occurred, _] = answer;
            Reply::new(status, [0, logged, occurred])
        }
        Request::ErrorText { code, stringlet } => {
            long_enough(2 + TEXT)?;
            let [answered, ..] = answer;
            if answered != *code {
                return None;
            }
            let text = rest.get(2..).unwrap_or(&[]);
            Reply::with_value(status, *code, crate::upid::stringlet(text, *stringlet))
        }
        _ if main == TUNNEL => {
            long_enough(7)?;
            let (&command, rest) = rest.split_first()?;
            if command != request.command().0 {
                return None;
            }
            Reply::new(status, words(rest))
        }
        _ => {
            long_enough(6)?;
            let [answered, ..] = answer;
            // These answer with what they found, or with nothing.
            let free = words_carried(request) == 0
                || matches!(request, Request::NextItem(_) | Request::Presence { .. });
            if !free && answered != first {
                return None;
            }
            Reply::new(status, answer)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linrs::{Checksum, MAX_FRAME};
    use crate::request::tests::any_request;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn wire(message: &Message) -> Vec<u8> {
        let mut out = [0; MAX_FRAME];
        let len = message.encode(Checksum::None, &mut out);
        out[..len].to_vec()
    }

    /// The telegrams printed in the LinRS manual, requests and answers.
    #[test]
    fn the_documents_telegrams() {
        let upid = Upid(0x13A2);
        let ok = |first, value| Reply::with_value(Status::OK, first, value);
        let curve = Request::CurveData { access: Access::Get, curve: 1, value: 0 };
        let rows: [(Request, &[u8], Reply, &[u8]); 8] = [
            (
                Request::Read { value: Value::Rom, upid },
                &[0x01, 0x11, 0x05, 0x02, 0x00, 0x05, 0xA2, 0x13, 0x04],
                ok(0x13A2, 9),
                &[0x01, 0x11, 0x0A, 0x02, 0x50, 0x00, 0x00, 0xA2, 0x13, 0x09, 0x00, 0x00, 0x00, 0x04],
            ),
            (
                Request::Write { memory: Memory::Rom, upid, value: 16 },
                &[0x01, 0x11, 0x09, 0x02, 0x01, 0x05, 0xA2, 0x13, 0x10, 0x00, 0x00, 0x00, 0x04],
                ok(0x13A2, 16),
                &[0x01, 0x11, 0x0A, 0x02, 0x51, 0x00, 0x00, 0xA2, 0x13, 0x10, 0x00, 0x00, 0x00, 0x04],
            ),
            (
                Request::StartList { list: List::All, from: Upid(0x2000) },
                &[0x01, 0x11, 0x05, 0x02, 0x0A, 0x05, 0x00, 0x20, 0x04],
                ok(0x2000, 0),
                &[0x01, 0x11, 0x0A, 0x02, 0x5A, 0x00, 0x00, 0x00, 0x20, 0x00, 0x00, 0x00, 0x00, 0x04],
            ),
            (
                curve,
                &[0x01, 0x11, 0x05, 0x02, 0x0A, 0x04, 0x01, 0x00, 0x04],
                Reply::with_value(Status::NOT_FINISHED, 1, 0x180C),
                &[0x01, 0x11, 0x0A, 0x02, 0x40, 0x00, 0x04, 0x01, 0x00, 0x0C, 0x18, 0x00, 0x00, 0x04],
            ),
            (
                Request::Start,
                &[0x01, 0x11, 0x03, 0x02, 0x04, 0x06, 0x04],
                Reply::new(Status::OK, [0; 3]),
                &[0x01, 0x11, 0x04, 0x02, 0x60, 0x00, 0x00, 0x04],
            ),
            (
                Request::ErrorCounts,
                &[0x01, 0x11, 0x03, 0x02, 0x02, 0x07, 0x04],
                Reply::new(Status::OK, [0, 0x15, 0x90]),
                &[0x01, 0x11, 0x08, 0x02, 0x72, 0x00, 0x00, 0x15, 0x00, 0x90, 0x00, 0x04],
            ),
            (
                Request::DeleteEntry { entry: 2 },
                &[0x01, 0x11, 0x05, 0x02, 0x02, 0x08, 0x02, 0x00, 0x04],
                ok(2, 0),
                &[0x01, 0x11, 0x0A, 0x02, 0x82, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x00, 0x00, 0x04],
            ),
            (
                Request::ClearTable,
                &[0x01, 0x11, 0x03, 0x02, 0x01, 0x08, 0x04],
                ok(0, 0),
                &[0x01, 0x11, 0x0A, 0x02, 0x81, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x04],
            ),
        ];
        for (asked, request_wire, answer, answer_wire) in rows {
            let sent = telegram(0x11, &asked);
            assert_eq!((wire(&sent), request(&sent)), (request_wire.to_vec(), Some(asked)));
            let came = response(0x11, &asked, &answer, &[]);
            assert_eq!((wire(&came), reply(&asked, &came)), (answer_wire.to_vec(), Some(answer)));
        }
        // "Err: X4 Logic Supply Too Low", whole.
        let text = b"Err: X4 Logic Supply Too Low";
        let asked = Request::ErrorText { code: 1, stringlet: 2 };
        assert_eq!(wire(&telegram(0x11, &asked)), [0x01, 0x11, 0x05, 0x02, 0x01, 0x07, 0x01, 0x00, 0x04]);
        let came = response(0x11, &asked, &Reply::new(Status::OK, [1, 0, 0]), text);
        let bytes = wire(&came);
        assert_eq!(
            (bytes.len(), &bytes[..9]),
            (42, &[0x01, 0x11, 0x26, 0x02, 0x71, 0x00, 0x00, 0x01, 0x00][..])
        );
        assert_eq!(reply(&asked, &came).unwrap().value().to_le_bytes(), *b"Logi");
        // The configured default answer to a stop.
        let stop = Message::new(0x11, 0, 0, &[0, 0, 0, 0, 0, 0x87, 0, 0, 0]);
        assert_eq!(reply(&Request::Stop, &stop), Some(Reply::new(Status::OK, [0; 3])));
    }

    #[test]
    fn answers_to_others_are_told_apart() {
        let read = Request::Read { value: Value::Rom, upid: Upid(0x13A2) };
        let of = |sub, main, data: &[u8]| reply(&read, &Message::new(1, sub, main, data));
        assert_eq!(of(0x51, 0, &[0, 0xA2, 0x13, 0, 0, 0, 0]), None);
        assert_eq!(of(0x50, 5, &[0, 0xA2, 0x13, 0, 0, 0, 0]), None);
        assert_eq!(of(0x50, 0, &[0, 0xA3, 0x13, 0, 0, 0, 0]), None);
        assert_eq!(of(0x50, 0, &[0, 0xA2, 0x13, 0, 0, 0]), None);
        assert_eq!(of(0x50, 0, &[]), None);
    }

    proptest! {
        /// Every command comes out at the drive as it went in, but for the stringlet of an error
        /// text, which is cut out of the whole text at the master.
        #[test]
        fn commands_come_back_from_their_message(asked in any_request()) {
            let expected = match asked {
                Request::ErrorText { code, .. } => Request::ErrorText { code, stringlet: 0 },
                Request::StartCurve { access: Access::Get, curve, .. } =>
                    Request::StartCurve { access: Access::Get, curve, info: 0, data: 0 },
                Request::CurveInfo { access: Access::Get, curve, .. } =>
                    Request::CurveInfo { access: Access::Get, curve, value: 0 },
                Request::CurveData { access: Access::Get, curve, .. } =>
                    Request::CurveData { access: Access::Get, curve, value: 0 },
                other => other,
            };
            prop_assert_eq!(request(&telegram(9, &asked)), Some(expected));
        }
    }
}
