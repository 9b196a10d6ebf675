//! LB2 over CAN, frame by frame.
#![cfg(feature = "can")]

use core::time::Duration;

use embedded_can::{ExtendedId, Frame as _, Id, StandardId};
use lb2::can::{FROM_DEVICE, TO_DEVICE, bytes, frames};
use lb2::master::{Event, Master, Outcome};
use lb2::telegram::{Request, Response};

#[derive(Debug, Clone, PartialEq, Eq)]
struct Frame(Id, bool, Vec<u8>);

impl embedded_can::Frame for Frame {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        (data.len() <= 8).then(|| Self(id.into(), false, data.to_vec()))
    }

    fn new_remote(id: impl Into<Id>, _dlc: usize) -> Option<Self> {
        Some(Self(id.into(), true, Vec::new()))
    }

    fn is_extended(&self) -> bool {
        matches!(self.0, Id::Extended(_))
    }

    fn is_remote_frame(&self) -> bool {
        self.1
    }

    fn id(&self) -> Id {
        self.0
    }

    fn dlc(&self) -> usize {
        self.2.len()
    }

    fn data(&self) -> &[u8] {
        &self.2
    }
}

/// Decision 10: 7A0h to the device, 7A1h from it, up to 8 bytes a frame.
#[test]
fn a_telegram_crosses_in_frames_of_8_bytes() {
    let mut master = Master::default();
    master.submit(&Request::ReadParameter { index: 5 }, 0).unwrap();
    let request = master.poll_transmit(Duration::ZERO).unwrap();
    let sent: Vec<Frame> = frames(TO_DEVICE, request).collect();
    let id = |raw| Id::Standard(StandardId::new(raw).unwrap());
    assert_eq!(sent, [Frame(id(0x7A0), false, vec![0x82, 0x96, 0x05, 0xCC, 0x30, 0x05, 0x00, 0xFC])]);
    master.handle_transmit_done(Duration::ZERO);

    // The answer: value 7.
    let answer = [0x82, 0x96, 0x09, 0xCC, 0x30, 0x05, 0x00, 0x07, 0, 0, 0, 0xF7];
    let came: Vec<Frame> = frames(FROM_DEVICE, &answer).collect();
    assert_eq!(came.iter().map(|frame| frame.2.len()).collect::<Vec<_>>(), [8, 4]);
    for frame in &came {
        assert_eq!(bytes(TO_DEVICE, frame), None);
        master.handle_bytes(Duration::from_millis(1), bytes(FROM_DEVICE, frame).unwrap());
    }
    let Some(Event::Outcome { outcome, .. }) = master.poll_event() else { panic!("no outcome") };
    assert_eq!(outcome, Outcome::Done(Response::Parameter { index: 5, value: 7 }));
}

#[test]
fn other_frames_carry_nothing() {
    let remote = Frame::new_remote(TO_DEVICE, 8).unwrap();
    let extended = Frame::new(ExtendedId::new(0x7A0).unwrap(), &[1]).unwrap();
    let other = Frame::new(StandardId::new(0x7A2).unwrap(), &[1]).unwrap();
    for frame in [remote, extended, other] {
        assert_eq!(bytes(TO_DEVICE, &frame), None);
    }
}
