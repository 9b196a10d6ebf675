//! The client, byte by byte.

use canopen_master::Frame;
use canopen_master::sdo::{
    AbortCode, Address, Buffer, Channel, Client, Fault, Finished, Options, Outcome, Small, SubmitError,
};

use super::pair::ms;

const CHANNEL: Channel = Channel { request: 0x601, response: 0x581 };
const STATUS: Address = Address::new(0x6041, 0);
const OPTIONS: Options = Options::new(ms(50));

/// A conversation as a script.
struct Script<B> {
    client: Client<B>,
}

impl<B: Buffer> Script<B> {
    fn new() -> Self {
        Self { client: Client::new(CHANNEL) }
    }

    #[track_caller]
    fn sends(&mut self, at: u64, bytes: [u8; 8]) {
        assert_eq!(self.client.poll_transmit(ms(at)), Some(Frame::standard(0x601, bytes)));
    }

    #[track_caller]
    fn sends_nothing(&mut self, at: u64) {
        assert_eq!(self.client.poll_transmit(ms(at)), None);
    }

    fn gets(&mut self, at: u64, bytes: [u8; 8]) {
        assert!(self.client.handle_frame(ms(at), &Frame::standard(0x581, bytes)).is_taken());
    }

    #[track_caller]
    fn ends(&mut self) -> Finished<B> {
        self.client.poll_event().expect("an outcome")
    }
}

/// The trace of the AX2000 manual, p. 116: status word 0040h.
#[test]
fn expedited_upload() {
    let mut script = Script::new();
    let ticket = script.client.upload(STATUS, Small::EMPTY, &OPTIONS).unwrap();
    script.sends(0, [0x40, 0x41, 0x60, 0, 0, 0, 0, 0]);
    script.sends_nothing(0);
    assert_eq!(script.client.poll_timeout(), Some(ms(50)));
    script.gets(1, [0x4B, 0x41, 0x60, 0, 0x40, 0, 0, 0]);
    let finished = script.ends();
    assert_eq!((finished.ticket, finished.at, finished.outcome), (ticket, STATUS, Outcome::Done(2)));
    assert_eq!(finished.buffer.get::<u16>(), Ok(0x0040));
    assert!(script.client.is_idle() && script.client.poll_event().is_none());
    assert_eq!(script.client.poll_timeout(), None);
}

#[test]
fn expedited_download() {
    let mut script = Script::new();
    script.client.download(Address::new(0x6040, 0), Small::from(7u16), &OPTIONS).unwrap();
    script.sends(0, [0x2B, 0x40, 0x60, 0, 7, 0, 0, 0]);
    script.gets(1, [0x60, 0x40, 0x60, 0, 0xDE, 0xAD, 0xBE, 0xEF]);
    assert_eq!(script.ends().outcome, Outcome::Done(2));
}

/// CiA 301, 7.2.4.3.5 and 7.2.4.3.6.
#[test]
fn segmented_upload() {
    let mut script = Script::new();
    script.client.upload(Address::new(0x1008, 0), [0xA5; 12], &OPTIONS).unwrap();
    script.sends(0, [0x40, 0x08, 0x10, 0, 0, 0, 0, 0]);
    script.gets(0, [0x41, 0x08, 0x10, 0, 9, 0, 0, 0]);
    script.sends(0, [0x60, 0, 0, 0, 0, 0, 0, 0]);
    script.gets(0, [0x00, b'S', b'E', b'R', b'V', b'O', b'S', b'T']);
    script.sends(0, [0x70, 0, 0, 0, 0, 0, 0, 0]);
    script.gets(0, [0x1B, b'A', b'R', 0xFF, 0xFF, 0xFF, 0xFF, 0xFF]);
    let finished = script.ends();
    assert_eq!((finished.outcome, &finished.buffer), (Outcome::Done(9), b"SERVOSTAR\xA5\xA5\xA5"));
}

/// CiA 301, 7.2.4.3.3 and 7.2.4.3.4.
#[test]
fn segmented_download() {
    let mut script = Script::new();
    script.client.download(Address::new(0x2000, 1), &b"SERVOSTAR"[..], &OPTIONS).unwrap();
    script.sends(0, [0x21, 0x00, 0x20, 1, 9, 0, 0, 0]);
    script.gets(0, [0x60, 0x00, 0x20, 1, 0, 0, 0, 0]);
    script.sends(0, [0x00, b'S', b'E', b'R', b'V', b'O', b'S', b'T']);
    script.gets(0, [0x20, 0, 0, 0, 0, 0, 0, 0]);
    script.sends(0, [0x1B, b'A', b'R', 0, 0, 0, 0, 0]);
    script.gets(0, [0x30, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(script.ends().outcome, Outcome::Done(9));
}

#[test]
fn no_bytes() {
    let mut script = Script::new();
    script.client.download(Address::new(0x2000, 1), &b""[..], &OPTIONS).unwrap();
    script.sends(0, [0x21, 0x00, 0x20, 1, 0, 0, 0, 0]);
    script.gets(0, [0x60, 0x00, 0x20, 1, 0, 0, 0, 0]);
    script.sends(0, [0x0F, 0, 0, 0, 0, 0, 0, 0]);
    script.gets(0, [0x20, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(script.ends().outcome, Outcome::Done(0));
}

#[test]
fn the_server_aborts() {
    let mut script = Script::new();
    script.client.upload(STATUS, Small::EMPTY, &OPTIONS).unwrap();
    script.sends(0, [0x40, 0x41, 0x60, 0, 0, 0, 0, 0]);
    script.gets(0, [0x80, 0x41, 0x60, 0, 0x00, 0x00, 0x02, 0x06]);
    assert_eq!(script.ends().outcome, Outcome::Aborted(AbortCode::NO_OBJECT));
    script.sends_nothing(0);
}

#[test]
fn silence_times_out_and_aborts() {
    let mut script = Script::new();
    script.client.upload(STATUS, Small::EMPTY, &OPTIONS).unwrap();
    script.sends(10, [0x40, 0x41, 0x60, 0, 0, 0, 0, 0]);
    script.client.handle_timeout(ms(59));
    assert!(script.client.poll_event().is_none());
    script.client.handle_timeout(ms(60));
    assert_eq!(script.ends().outcome, Outcome::TimedOut);
    script.sends(60, [0x80, 0x41, 0x60, 0, 0x00, 0x00, 0x04, 0x05]);
}

/// The late answer to 6041h comes while 6040h is asked: it is not taken for its answer, even if it is an
/// abort.
#[test]
fn late_answers_do_not_enter_the_next_transfer() {
    let mut script = Script::new();
    script.client.upload(STATUS, Small::EMPTY, &OPTIONS).unwrap();
    script.sends(0, [0x40, 0x41, 0x60, 0, 0, 0, 0, 0]);
    script.client.handle_timeout(ms(50));
    assert_eq!(script.ends().outcome, Outcome::TimedOut);
    script.client.upload(Address::new(0x6040, 0), Small::EMPTY, &OPTIONS).unwrap();
    script.sends(50, [0x80, 0x41, 0x60, 0, 0x00, 0x00, 0x04, 0x05]);
    script.sends(50, [0x40, 0x40, 0x60, 0, 0, 0, 0, 0]);
    script.gets(51, [0x4B, 0x41, 0x60, 0, 0x40, 0, 0, 0]);
    script.gets(51, [0x80, 0x41, 0x60, 0, 0x00, 0x00, 0x02, 0x06]);
    script.gets(51, [0x00, 1, 2, 3, 4, 5, 6, 7]);
    assert!(script.client.poll_event().is_none());
    script.gets(52, [0x4B, 0x40, 0x60, 0, 0x0F, 0, 0, 0]);
    let finished = script.ends();
    assert_eq!((finished.outcome, finished.buffer.get::<u16>()), (Outcome::Done(2), Ok(0x0F)));
    assert_eq!(script.client.strays(), 3);
}

/// Two answers to the same request cannot be told apart, so the second request waits.
#[test]
fn the_same_request_waits_for_the_old_answer() {
    let mut script = Script::new();
    let control = Address::new(0x6040, 0);
    for late_answer in [true, false] {
        script.client.download(control, Small::from(6u16), &OPTIONS).unwrap();
        script.sends(0, [0x2B, 0x40, 0x60, 0, 6, 0, 0, 0]);
        script.client.handle_timeout(ms(50));
        assert_eq!(script.ends().outcome, Outcome::TimedOut);
        script.sends(50, [0x80, 0x40, 0x60, 0, 0x00, 0x00, 0x04, 0x05]);
        script.client.download(control, Small::from(7u16), &OPTIONS).unwrap();
        script.sends_nothing(50);
        assert_eq!(script.client.poll_timeout(), Some(ms(100)));
        if late_answer {
            script.gets(60, [0x60, 0x40, 0x60, 0, 0, 0, 0, 0]);
        } else {
            script.sends_nothing(99);
            script.client.handle_timeout(ms(100));
        }
        script.sends(100, [0x2B, 0x40, 0x60, 0, 7, 0, 0, 0]);
        script.gets(101, [0x60, 0x40, 0x60, 0, 0, 0, 0, 0]);
        assert_eq!(script.ends().outcome, Outcome::Done(2));
    }
}

#[test]
fn cancelled() {
    let mut script = Script::new();
    let ticket = script.client.upload(STATUS, Small::EMPTY, &OPTIONS).unwrap();
    script.client.cancel(ticket);
    assert_eq!(script.ends().outcome, Outcome::Cancelled);
    script.sends_nothing(0);

    let second = script.client.upload(STATUS, Small::EMPTY, &OPTIONS).unwrap();
    script.sends(0, [0x40, 0x41, 0x60, 0, 0, 0, 0, 0]);
    script.client.cancel(ticket);
    assert!(script.client.poll_event().is_none(), "an old ticket cancels nothing");
    script.client.cancel(second);
    assert_eq!(script.ends().outcome, Outcome::Cancelled);
    script.sends(0, [0x80, 0x41, 0x60, 0, 0x00, 0x00, 0x04, 0x05]);
}

#[test]
fn one_transfer_at_a_time() {
    let mut script = Script::new();
    script.client.upload(STATUS, Small::EMPTY, &OPTIONS).unwrap();
    let refused = script.client.upload(STATUS, Small::from(9u8), &OPTIONS).unwrap_err();
    assert_eq!((refused.error, refused.buffer.get::<u8>()), (SubmitError::Busy, Ok(9)));
}

/// Each fault has its own name and its own abort code.
#[test]
fn faults() {
    let begin = [0x41, 0x08, 0x10, 0, 9, 0, 0, 0];
    for (answers, fault, code) in [
        (&[begin, [0x10, 1, 2, 3, 4, 5, 6, 7]][..], Fault::Toggle, AbortCode::TOGGLE),
        (&[begin, [0x20; 8]], Fault::Unexpected { command: 0x20 }, AbortCode::COMMAND),
        (&[begin, [0x05, 1, 2, 3, 4, 5, 6, 7]], Fault::Size { indicated: 9, found: 5 }, AbortCode::LENGTH),
        (
            &[begin, [0; 8], [0x10, 1, 2, 3, 4, 5, 6, 7]],
            Fault::Size { indicated: 9, found: 14 },
            AbortCode::LENGTH,
        ),
        // A server that went on like this held the transfer for ever.
        (&[begin, [0x0E, 0, 0, 0, 0, 0, 0, 0]], Fault::EmptySegment, AbortCode::LENGTH),
        (
            &[[0x41, 0x08, 0x10, 0, 11, 0, 0, 0]],
            Fault::Buffer(AbortCode::OUT_OF_MEMORY),
            AbortCode::OUT_OF_MEMORY,
        ),
    ] {
        let mut script = Script::new();
        script.client.upload(Address::new(0x1008, 0), [0; 10], &OPTIONS).unwrap();
        script.client.poll_transmit(ms(0)).unwrap();
        for (i, &answer) in answers.iter().enumerate() {
            script.gets(0, answer);
            if i + 1 < answers.len() {
                script.client.poll_transmit(ms(0)).unwrap();
            }
        }
        assert_eq!(script.ends().outcome, Outcome::GaveUp(fault));
        let [a, b, c, d] = code.0.to_le_bytes();
        script.sends(0, [0x80, 0x08, 0x10, 0, a, b, c, d]);
        script.sends_nothing(0);
    }
}

/// An upload without end filled the memory.
#[test]
fn a_vec_takes_16_mib() {
    let mut buffer = Vec::new();
    assert_eq!(buffer.begin(Some(u32::MAX)), Err(AbortCode::OUT_OF_MEMORY));
    assert_eq!(buffer.begin(Some(16 << 20)), Ok(()));
    assert_eq!(buffer.write(0, &vec![0; 16 << 20]), Ok(()));
    assert_eq!(buffer.write((16 << 20) + 1, &[0]), Err(AbortCode::OUT_OF_MEMORY));
}

#[test]
fn frames_of_others_are_ignored() {
    let mut script: Script<Small> = Script::new();
    for frame in [
        Frame::standard(0x582, [0; 8]),
        Frame::standard(0x601, [0; 8]),
        Frame::remote_frame(embedded_can::StandardId::new(0x581).unwrap(), 8).unwrap(),
        Frame::data_frame(embedded_can::ExtendedId::new(0x581).unwrap(), &[0; 8]).unwrap(),
    ] {
        assert!(!script.client.handle_frame(ms(0), &frame).is_taken());
    }
    assert_eq!(script.client.strays(), 0);
}

/// A block segment that comes late looks like a segment of an upload: no transfer begins until it has come.
#[test]
fn late_segments_do_not_enter_the_next_transfer() {
    let mut script = Script::new();
    script.client.upload(STATUS, Small::EMPTY, &OPTIONS).unwrap();
    script.sends(0, [0x40, 0x41, 0x60, 0, 0, 0, 0, 0]);
    script.gets(1, [0x41, 0x41, 0x60, 0, 7, 0, 0, 0]);
    script.sends(1, [0x60, 0, 0, 0, 0, 0, 0, 0]);
    script.client.handle_timeout(ms(51));
    assert_eq!(script.ends().outcome, Outcome::TimedOut);
    script.client.upload(STATUS, Small::EMPTY, &OPTIONS).unwrap();
    script.sends(52, [0x80, 0x41, 0x60, 0, 0, 0, 4, 5]);
    script.sends_nothing(52);
    assert_eq!(script.client.poll_timeout(), Some(ms(102)));
    script.gets(60, [0x01, 1, 2, 3, 4, 5, 6, 7]);
    script.sends_nothing(101);
    script.client.handle_timeout(ms(102));
    script.sends(102, [0x40, 0x41, 0x60, 0, 0, 0, 0, 0]);
    script.gets(103, [0x4B, 0x41, 0x60, 0, 9, 0, 0, 0]);
    assert_eq!(script.ends().outcome, Outcome::Done(2));
}
