//! Nodes that are wrong, each in one way, and the case of the test that finds it.

use pdo::Frame;

use super::NODE;

/// A fault, and the case that finds it.
pub(super) struct Wrong {
    pub(super) finds: &'static str,
    pub(super) twist: fn(&[Frame], Frame) -> Vec<Frame>,
    /// What the node says beside that, after a frame to it.
    pub(super) add: fn(&[Frame]) -> Option<Frame>,
}

const fn wrong(finds: &'static str, twist: fn(&[Frame], Frame) -> Vec<Frame>) -> Wrong {
    Wrong { finds, twist, add: |_| None }
}

const fn added(finds: &'static str, add: fn(&[Frame]) -> Option<Frame>) -> Wrong {
    Wrong { finds, twist: |_, frame| vec![frame], add }
}

/// The last frame to the node, if it is on this identifier.
fn last(heard: &[Frame], base: u16) -> Option<&[u8]> {
    heard.last().filter(|last| is(last, base)).map(Frame::data)
}

fn is(frame: &Frame, base: u16) -> bool {
    frame.standard_id() == Some(base + u16::from(NODE))
}

fn with(frame: &Frame, change: impl FnOnce(&mut [u8])) -> Vec<Frame> {
    let mut data = frame.data().to_vec();
    change(&mut data);
    vec![Frame::data_frame(embedded_can::Frame::id(frame), &data).unwrap()]
}

/// An SDO answer whose last request begins with these bytes.
pub(super) fn answers(heard: &[Frame], frame: &Frame, request: &[u8]) -> bool {
    is(frame, 0x580) && heard.last().is_some_and(|last| is(last, 0x600) && last.data().starts_with(request))
}

/// Another abort code.
pub(super) fn recoded(frame: Frame, from: u32, to: u32) -> Vec<Frame> {
    if is(&frame, 0x580) && frame.data()[0] == 0x80 && frame.data()[4..] == from.to_le_bytes() {
        return with(&frame, |data| data[4..].copy_from_slice(&to.to_le_bytes()));
    }
    vec![frame]
}

/// In place of a refusal, a given answer.
fn taken(heard: &[Frame], frame: Frame, request: &[u8], answer: [u8; 8]) -> Vec<Frame> {
    if answers(heard, &frame, request) && frame.data()[0] == 0x80 {
        return with(&frame, |data| data.copy_from_slice(&answer));
    }
    vec![frame]
}

fn taken_away(heard: &[Frame], frame: Frame, request: &[u8]) -> Vec<Frame> {
    if answers(heard, &frame, request) {
        return with(&frame, |data| {
            data[0] = 0x80;
            data[4..].copy_from_slice(&0x0602_0000u32.to_le_bytes());
        });
    }
    vec![frame]
}

/// Another value than the device file's.
fn other(heard: &[Frame], frame: Frame, request: &[u8]) -> Vec<Frame> {
    if answers(heard, &frame, request) { with(&frame, |data| data[4] ^= 2) } else { vec![frame] }
}

/// The toggle bit is 1 in every segment.
pub(super) fn no_toggle(heard: &[Frame], frame: Frame) -> Vec<Frame> {
    let segment = answers(heard, &frame, &[0x60]) || answers(heard, &frame, &[0x70]);
    if segment && frame.data()[0] & 0xE0 == 0 { with(&frame, |data| data[0] |= 0x10) } else { vec![frame] }
}

/// Every second one.
fn slow(frame: &Frame) -> Vec<Frame> {
    use core::sync::atomic::{AtomicU32, Ordering};
    static COUNT: AtomicU32 = AtomicU32::new(0);
    if COUNT.fetch_add(1, Ordering::Relaxed).is_multiple_of(2) { vec![*frame] } else { vec![] }
}

fn block_is_open(heard: &[Frame]) -> bool {
    heard.last().is_some_and(|last| is(last, 0x600) && last.data()[0] == 0xA2)
}

fn answer(data: [u8; 8]) -> Frame {
    Frame::standard(0x580 + u16::from(NODE), data)
}

pub(super) const WRONG: &[Wrong] = &[
    wrong(
        "nmt.boot-up",
        |_, frame| if is(&frame, 0x700) && frame.data() == [0] { vec![] } else { vec![frame] },
    ),
    wrong("nmt.boot-up", |_, frame| {
        if is(&frame, 0x700) && frame.data() == [0] { vec![frame, frame] } else { vec![frame] }
    }),
    // Boots into operational.
    wrong("nmt.pre-operational", |heard, frame| {
        let started = heard
            .iter()
            .rev()
            .find(|frame| frame.standard_id() == Some(0))
            .is_some_and(|last| last.data()[0] == 0x82);
        if is(&frame, 0x700) && frame.data() == [0x7F] && started {
            with(&frame, |data| data[0] = 5)
        } else {
            vec![frame]
        }
    }),
    // Takes stop for pre-operational.
    wrong("nmt.commands", |_, frame| {
        if is(&frame, 0x700) && frame.data() == [4] {
            with(&frame, |data| data[0] = 0x7F)
        } else {
            vec![frame]
        }
    }),
    // Takes command 55h for start.
    wrong("nmt.unknown-command", |heard, frame| {
        let odd = heard
            .iter()
            .rev()
            .find(|frame| frame.standard_id() == Some(0))
            .is_some_and(|last| last.data()[0] == 0x55);
        if is(&frame, 0x700) && odd { with(&frame, |data| data[0] = 5) } else { vec![frame] }
    }),
    // The heartbeat is twice as slow.
    wrong("heartbeat.period", |heard, frame| {
        let asked = heard.iter().any(|frame| frame.data().starts_with(&[0x2B, 0x17, 0x10]));
        if is(&frame, 0x700) && asked && frame.data() == [0x7F] { slow(&frame) } else { vec![frame] }
    }),
    wrong("guarding.toggle", |_, frame| {
        if is(&frame, 0x700) { with(&frame, |data| data[0] &= 0x7F) } else { vec![frame] }
    }),
    wrong("guarding.life-time", |_, frame| {
        if is(&frame, 0x80) && frame.data().starts_with(&[0x30, 0x81]) { vec![] } else { vec![frame] }
    }),
    // Says 3 bytes of 4.
    wrong("sdo.expedited-upload", |heard, frame| {
        if answers(heard, &frame, &[0x40, 0, 0x10]) {
            with(&frame, |data| data[0] = 0x47)
        } else {
            vec![frame]
        }
    }),
    wrong("sdo.mandatory", |heard, frame| taken_away(heard, frame, &[0x40, 0x18, 0x10, 1])),
    // Names another object in its answer.
    wrong("sdo.expedited-upload", |heard, frame| {
        if answers(heard, &frame, &[0x40, 0, 0x10]) { with(&frame, |data| data[1] = 1) } else { vec![frame] }
    }),
    wrong("sdo.no-object", |_, frame| recoded(frame, 0x0602_0000, 0x0800_0000)),
    wrong("sdo.no-sub-index", |_, frame| recoded(frame, 0x0609_0011, 0x0602_0000)),
    wrong("sdo.read-only", |_, frame| recoded(frame, 0x0601_0002, 0x0601_0000)),
    wrong("sdo.read-only", |heard, frame| {
        taken(heard, frame, &[0x23, 0, 0x10], [0x60, 0, 0x10, 0, 0, 0, 0, 0])
    }),
    wrong("sdo.too-long", |heard, frame| {
        taken(heard, frame, &[0x27, 0x17, 0x10], [0x60, 0x17, 0x10, 0, 0, 0, 0, 0])
    }),
    wrong("sdo.too-short", |_, frame| recoded(frame, 0x0607_0013, 0x0609_0030)),
    wrong(
        "sdo.command-specifier",
        |heard, frame| if answers(heard, &frame, &[0xE0]) { vec![] } else { vec![frame] },
    ),
    wrong("sdo.segment-out-of-place", |_, frame| recoded(frame, 0x0504_0001, 0x0800_0000)),
    wrong("sdo.segmented-upload", no_toggle),
    // Announces one byte too many.
    wrong("sdo.segmented-upload", |heard, frame| {
        if answers(heard, &frame, &[0x40, 0x08, 0x10]) {
            with(&frame, |data| data[4] += 1)
        } else {
            vec![frame]
        }
    }),
    // Does not look at the toggle bit.
    wrong("sdo.upload-toggle", |heard, frame| {
        taken(heard, frame, &[0x70], [0x10, b'V', b'i', b'r', b't', b'u', b'a', b'l'])
    }),
    wrong("sdo.segmented-download", |heard, frame| {
        if answers(heard, &frame, &[0x0B]) { with(&frame, |data| data[0] |= 0x10) } else { vec![frame] }
    }),
    wrong("sdo.download-toggle", |heard, frame| taken(heard, frame, &[0x1B], [0x30, 0, 0, 0, 0, 0, 0, 0])),
    wrong("block.upload", |heard, frame| {
        if is(&frame, 0x580) && frame.data()[0] & 0xE3 == 0xC1 && block_is_open(heard) {
            with(&frame, |data| data[1] ^= 1)
        } else {
            vec![frame]
        }
    }),
    wrong("block.bad-size", |_, frame| recoded(frame, 0x0504_0002, 0x0504_0001)),
    wrong("block.crc", |_, frame| recoded(frame, 0x0504_0004, 0x0504_0003)),
    wrong("block.crc", |heard, frame| taken(heard, frame, &[0xD5], [0xA1, 0, 0, 0, 0, 0, 0, 0])),
    wrong("object.1018.01.read", |heard, frame| taken_away(heard, frame, &[0x40, 0x18, 0x10, 1])),
    wrong("object.6401.02.read", |heard, frame| {
        if answers(heard, &frame, &[0x40, 0x01, 0x64, 2]) {
            with(&frame, |data| data[0] = 0x43)
        } else {
            vec![frame]
        }
    }),
    wrong("object.1016.02.write", |heard, frame| {
        if answers(heard, &frame, &[0x23, 0x16, 0x10, 2]) {
            with(&frame, |data| data.copy_from_slice(&[0x80, 0x16, 0x10, 2, 0x02, 0, 1, 6]))
        } else {
            vec![frame]
        }
    }),
    wrong("object.1018.04.refuse", |heard, frame| {
        taken(heard, frame, &[0x23, 0x18, 0x10, 4], [0x60, 0x18, 0x10, 4, 0, 0, 0, 0])
    }),
    wrong("file.vendor-number", |heard, frame| other(heard, frame, &[0x40, 0x18, 0x10, 1])),
    wrong("file.product-number", |heard, frame| other(heard, frame, &[0x40, 0x18, 0x10, 2])),
    wrong("file.revision-number", |heard, frame| other(heard, frame, &[0x40, 0x18, 0x10, 3])),
    wrong("file.receive-pdos", |heard, frame| taken_away(heard, frame, &[0x40, 0x03, 0x14, 0])),
    wrong("file.transmit-pdos", |heard, frame| taken_away(heard, frame, &[0x40, 0x03, 0x18, 0])),
    wrong("object.1000.00.value", |heard, frame| other(heard, frame, &[0x40, 0x00, 0x10, 0])),
    wrong("object.1800.01.value", |heard, frame| other(heard, frame, &[0x40, 0x00, 0x18, 1])),
    // TPDO 1 on the identifier of an SDO.
    wrong("pdo.parameters", |heard, frame| {
        if answers(heard, &frame, &[0x40, 0x00, 0x18, 1]) {
            with(&frame, |data| data[4..6].copy_from_slice(&[0x85, 0x05]))
        } else {
            vec![frame]
        }
    }),
    wrong("pdo.parameters", |heard, frame| {
        if answers(heard, &frame, &[0x40, 0x00, 0x18, 2]) {
            with(&frame, |data| data[4] = 241)
        } else {
            vec![frame]
        }
    }),
    wrong("pdo.mapping", |heard, frame| {
        if answers(heard, &frame, &[0x40, 0x00, 0x1A, 1]) {
            with(&frame, |data| data[4] = 9)
        } else {
            vec![frame]
        }
    }),
    wrong("pdo.reserved-type", |heard, frame| {
        taken(heard, frame, &[0x2F, 0x00, 0x18, 2], [0x60, 0x00, 0x18, 2, 0, 0, 0, 0])
    }),
    wrong("pdo.absent-object", |_, frame| {
        recoded(recoded(frame, 0x0602_0000, 0x0609_0030)[0], 0x0604_0041, 0x0609_0030)
    }),
    wrong("pdo.synchronous", |_, frame| if is(&frame, 0x180) { vec![] } else { vec![frame] }),
    wrong("pdo.synchronous", |_, frame| if is(&frame, 0x180) { vec![frame, frame] } else { vec![frame] }),
    wrong("pdo.synchronous", |_, frame| {
        if is(&frame, 0x180) { vec![Frame::standard(0x180 + u16::from(NODE), [0, 0])] } else { vec![frame] }
    }),
    wrong("emcy.cob-id", |heard, frame| {
        if answers(heard, &frame, &[0x40, 0x14, 0x10]) {
            with(&frame, |data| data[4] += 1)
        } else {
            vec![frame]
        }
    }),
    wrong("emcy.pdo-length", |_, frame| if is(&frame, 0x80) { vec![] } else { vec![frame] }),
    wrong("emcy.pdo-length", |heard, frame| {
        if answers(heard, &frame, &[0x40, 0x01, 0x10]) {
            with(&frame, |data| data[4] = 0)
        } else {
            vec![frame]
        }
    }),
    wrong("emcy.history", |_, frame| recoded(frame, 0x0609_0030, 0x0601_0000)),
    wrong("nmt.reset-node", |heard, frame| {
        let node = heard.iter().rev().find(|frame| frame.standard_id() == Some(0));
        let reset = node.is_some_and(|last| last.data()[0] == 0x81);
        if is(&frame, 0x700) && reset { vec![] } else { vec![frame] }
    }),
    // Answers while stopped, and to everything else twice.
    added("nmt.stopped", |heard| {
        let stopped = heard.len() > 1 && heard[heard.len() - 2].data().first() == Some(&2);
        last(heard, 0x600).filter(|_| stopped).map(|_| answer([0x43, 0, 0x10, 0, 0x91, 1, 0xF, 0]))
    }),
    added("heartbeat.off", |heard| {
        let off = last(heard, 0x600).is_some_and(|data| data.starts_with(&[0x2B, 0x17, 0x10, 0, 0, 0]));
        off.then(|| Frame::standard(0x700 + u16::from(NODE), [0x7F]))
    }),
    added("sdo.abort-unanswered", |heard| {
        last(heard, 0x600).filter(|data| data[0] == 0x80).map(|_| answer([0x80, 0, 0, 0, 1, 0, 4, 5]))
    }),
    // Goes on with a transfer that was aborted.
    wrong("sdo.client-abort", |heard, frame| {
        let aborted = heard.len() > 1 && heard[heard.len() - 2].data().first() == Some(&0x80);
        let segment = [0x01, b'V', b'i', b'r', b't', b'u', b'a', b'l'];
        if aborted { taken(heard, frame, &[0x60], segment) } else { vec![frame] }
    }),
    // Refuses to begin anew.
    wrong("sdo.restart", |heard, frame| {
        let open = heard.len() > 1 && heard[heard.len() - 2].data().first() == Some(&0x60);
        if open { taken_away(heard, frame, &[0x40, 0, 0x10]) } else { vec![frame] }
    }),
    // Sends two segments where one is allowed.
    wrong("block.size-1", |heard, frame| {
        if answers(heard, &frame, &[0xA3]) && frame.data()[0] == 1 { vec![frame, frame] } else { vec![frame] }
    }),
    // Numbers go on after a sub-block.
    wrong("block.retransmission", |heard, frame| {
        if answers(heard, &frame, &[0xA2, 1, 2]) { with(&frame, |data| data[0] |= 2) } else { vec![frame] }
    }),
    wrong("block.download", |heard, frame| {
        if answers(heard, &frame, &[0xD5]) && frame.data()[0] == 0xA1 {
            with(&frame, |data| data.copy_from_slice(&[0x80, 0x17, 0x10, 0, 4, 0, 4, 5]))
        } else {
            vec![frame]
        }
    }),
];
