//! One device at a time, on virtual time.

use core::time::Duration;

use can_link::{Channel, Event, Handled, Link, Role, Setting, SettingError, SubmitError, Trigger};
use embedded_can::{ExtendedId, Frame as _, Id, StandardId};

#[derive(Debug, Clone, PartialEq, Eq)]
struct Frame {
    id: Id,
    remote: bool,
    data: Vec<u8>,
}

impl embedded_can::Frame for Frame {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        Some(Self { id: id.into(), remote: false, data: data.to_vec() })
    }

    fn new_remote(id: impl Into<Id>, _dlc: usize) -> Option<Self> {
        Some(Self { id: id.into(), remote: true, data: Vec::new() })
    }

    fn is_extended(&self) -> bool {
        matches!(self.id, Id::Extended(_))
    }

    fn is_remote_frame(&self) -> bool {
        self.remote
    }

    fn id(&self) -> Id {
        self.id
    }

    fn dlc(&self) -> usize {
        self.data.len()
    }

    fn data(&self) -> &[u8] {
        &self.data
    }
}

const MS: fn(u64) -> Duration = Duration::from_millis;

fn channel(number: u8) -> Channel {
    Channel::new(number).unwrap()
}

fn frame(id: u16, data: &[u8]) -> Frame {
    Frame::new(StandardId::new(id).unwrap(), data).unwrap()
}

fn link(settings: &[(u8, Setting)]) -> Link {
    let mut link = Link::new();
    for (number, setting) in settings {
        link.set(channel(*number), *setting).unwrap();
    }
    link
}

fn sent(link: &mut Link, now: Duration) -> Vec<Frame> {
    core::iter::from_fn(|| link.poll_transmit(now)).collect()
}

#[test]
fn state_is_at_most_512_bytes() {
    println!("state of 14 channels: {} bytes", size_of::<Link>());
    assert!(size_of::<Link>() <= 512);
}

#[test]
fn only_channels_1_to_14_exist() {
    for number in [0, 15, 255] {
        let error = Channel::new(number).unwrap_err();
        assert_eq!(error.to_string(), format!("channel {number}, 1 to 14 expected"));
    }
    let all: Vec<u8> = Channel::all().map(Channel::number).collect();
    assert_eq!(all, (1..=14).collect::<Vec<u8>>());
}

/// Decision 11: channel n is data frame 100h + n.
#[test]
fn a_change_is_sent_once() {
    let mut link = link(&[(14, Setting::TRANSMIT), (1, Setting::TRANSMIT)]);
    assert_eq!(sent(&mut link, MS(0)), []);
    link.write(channel(14), &[1, 2]).unwrap();
    link.write(channel(1), &[]).unwrap();
    assert_eq!(sent(&mut link, MS(0)), [frame(0x101, &[]), frame(0x10E, &[1, 2])]);
    link.write(channel(14), &[1, 2]).unwrap();
    assert_eq!(sent(&mut link, MS(1)), []);
    link.write(channel(14), &[1, 2, 0]).unwrap();
    assert_eq!(sent(&mut link, MS(1)), [frame(0x10E, &[1, 2, 0])]);
    link.send(channel(14)).unwrap();
    assert_eq!(sent(&mut link, MS(1)), [frame(0x10E, &[1, 2, 0])]);
}

#[test]
fn the_least_distance_holds_back_and_the_newest_value_wins() {
    let setting = Setting { distance: MS(10), ..Setting::TRANSMIT };
    let mut link = link(&[(3, setting)]);
    link.write(channel(3), &[1]).unwrap();
    assert_eq!(link.poll_timeout(), Some(MS(0)));
    assert_eq!(sent(&mut link, MS(100)), [frame(0x103, &[1])]);
    assert_eq!(link.poll_timeout(), None);
    link.write(channel(3), &[2]).unwrap();
    link.write(channel(3), &[3]).unwrap();
    assert_eq!(link.poll_timeout(), Some(MS(110)));
    assert_eq!(sent(&mut link, MS(109)), []);
    assert_eq!(sent(&mut link, MS(110)), [frame(0x103, &[3])]);
}

#[test]
fn a_periodic_channel_starts_with_its_first_value() {
    let setting = Setting { role: Role::Transmit(Trigger::Period(MS(20))), ..Setting::OFF };
    let mut link = link(&[(2, setting)]);
    assert_eq!((link.poll_timeout(), sent(&mut link, MS(500))), (None, vec![]));
    link.write(channel(2), &[7]).unwrap();
    assert_eq!(sent(&mut link, MS(500)), [frame(0x102, &[7])]);
    assert_eq!(link.poll_timeout(), Some(MS(520)));
    link.write(channel(2), &[8]).unwrap();
    assert_eq!(sent(&mut link, MS(519)), []);
    assert_eq!(sent(&mut link, MS(520)), [frame(0x102, &[8])]);
    assert_eq!(sent(&mut link, MS(540)), [frame(0x102, &[8])]);
}

#[test]
fn on_request_means_only_then() {
    let setting = Setting { role: Role::Transmit(Trigger::Request), len: Some(2), ..Setting::OFF };
    let mut link = link(&[(5, setting)]);
    assert_eq!(link.send(channel(5)), Err(SubmitError::Empty { channel: channel(5) }));
    link.write(channel(5), &[1, 2]).unwrap();
    assert_eq!(sent(&mut link, MS(0)), []);
    link.send(channel(5)).unwrap();
    assert_eq!(sent(&mut link, MS(0)), [frame(0x105, &[1, 2])]);
    assert_eq!(link.write(channel(5), &[1]).unwrap_err().to_string(), "channel 5: 1 bytes, 2 expected");
    assert_eq!(link.write(channel(6), &[1]), Err(SubmitError::NotTransmitting { channel: channel(6) }));
}

#[test]
fn values_are_new_once_and_age() {
    let mut link = link(&[(4, Setting::RECEIVE)]);
    assert_eq!(link.read(MS(0), channel(4)), None);
    assert_eq!(link.handle_frame(MS(1000), &frame(0x104, &[9, 8])), Handled::Handled);
    assert_eq!(link.poll_event(), Some(Event::Received(channel(4))));
    assert_eq!(link.poll_event(), None);
    let first = link.read(MS(1005), channel(4)).unwrap();
    assert_eq!((first.data(), first.new, first.age), (&[9, 8][..], true, MS(5)));
    let again = link.read(MS(1007), channel(4)).unwrap();
    assert_eq!((again.data(), again.new, again.age), (&[9, 8][..], false, MS(7)));
    for value in 0..3 {
        link.handle_frame(MS(2000), &frame(0x104, &[value]));
    }
    assert_eq!((link.overruns(channel(4)), link.conflicts(channel(4))), (2, 0));
    assert_eq!(link.read(MS(2000), channel(4)).unwrap().data(), [2]);
    assert_eq!(link.poll_event(), None, "what was read is told no more");
}

#[test]
fn a_second_transmitter_is_found_and_named() {
    let mut link = link(&[(9, Setting::TRANSMIT)]);
    link.write(channel(9), &[1]).unwrap();
    assert_eq!(link.handle_frame(MS(0), &frame(0x109, &[5])), Handled::Handled);
    assert_eq!(link.handle_frame(MS(0), &frame(0x109, &[6])), Handled::Handled);
    assert_eq!(link.poll_event(), Some(Event::Conflict(channel(9))));
    assert_eq!(link.poll_event(), None);
    assert_eq!((link.conflicts(channel(9)), link.overruns(channel(9))), (2, 0));
    assert_eq!(sent(&mut link, MS(0)), [frame(0x109, &[1])], "its own value stays");
}

#[test]
fn lengths_identifiers_and_foreign_frames() {
    let mut link = link(&[
        (1, Setting { len: Some(4), ..Setting::RECEIVE }),
        (2, Setting { id: Some(0x2F0), ..Setting::RECEIVE }),
    ]);
    link.handle_frame(MS(0), &frame(0x101, &[1, 2, 3]));
    assert_eq!(link.poll_event(), Some(Event::WrongLength(channel(1))));
    assert_eq!((link.read(MS(0), channel(1)), link.wrong_lengths(channel(1))), (None, 1));
    assert_eq!(link.handle_frame(MS(0), &frame(0x102, &[1])), Handled::Ignored);
    assert_eq!(link.handle_frame(MS(0), &frame(0x2F0, &[1])), Handled::Handled);
    let extended = Frame::new(ExtendedId::new(0x2F0).unwrap(), &[1]).unwrap();
    let remote = Frame::new_remote(StandardId::new(0x2F0).unwrap(), 1).unwrap();
    for other in [frame(0x103, &[1]), frame(0x080, &[]), extended, remote] {
        assert_eq!(link.handle_frame(MS(0), &other), Handled::Ignored);
    }
}

#[test]
fn settings_that_cannot_be_leave_the_channel_as_it_was() {
    let mut link = link(&[(1, Setting::RECEIVE)]);
    let mut say = |number, setting| link.set(channel(number), setting).unwrap_err().to_string();
    let period = |time| Setting { role: Role::Transmit(Trigger::Period(time)), ..Setting::OFF };
    assert_eq!(
        say(1, Setting { id: Some(0x800), ..Setting::RECEIVE }),
        "channel 1: identifier 800h, 0 to 7FFh expected"
    );
    assert_eq!(
        say(2, Setting { id: Some(0x101), ..Setting::RECEIVE }),
        "channel 2: identifier 101h belongs to channel 1"
    );
    assert_eq!(say(1, Setting { len: Some(9), ..Setting::RECEIVE }), "channel 1: 9 bytes, 0 to 8 expected");
    for time in [MS(0), MS(65_536), Duration::from_micros(1500)] {
        assert!(matches!(link.set(channel(1), period(time)), Err(SettingError::Time { .. })), "{time:?}");
    }
    link.handle_frame(MS(0), &frame(0x101, &[1]));
    assert!(link.read(MS(0), channel(1)).is_some());
    link.set(channel(1), period(MS(65_535))).unwrap();
}

/// Times are kept modulo 2^32 ms, which is 49.7 days.
#[test]
fn the_clock_of_a_long_running_machine_wraps_unnoticed() {
    let days = MS(u64::from(u32::MAX) - 5);
    let setting = Setting { role: Role::Transmit(Trigger::Period(MS(10))), ..Setting::OFF };
    let mut link = link(&[(1, setting), (2, Setting::RECEIVE)]);
    link.write(channel(1), &[1]).unwrap();
    assert_eq!(sent(&mut link, days).len(), 1);
    assert_eq!(link.poll_timeout(), Some(days + MS(10)));
    assert_eq!(sent(&mut link, days + MS(9)), []);
    assert_eq!(sent(&mut link, days + MS(10)).len(), 1);
    link.handle_frame(days, &frame(0x102, &[1]));
    assert_eq!(link.read(days + MS(20), channel(2)).unwrap().age, MS(20));
}
