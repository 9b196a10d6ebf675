//! Scripted conversations of the master engine on virtual time.

use core::time::Duration;

use lb2::code::ErrorCode;
use lb2::frame::{DamageKind, MAX_WIRE};
use lb2::master::{Config, Event, Master, Mismatch, Outcome, SubmitError, Ticket, TimedOut};
use lb2::telegram::{Request, Response};

const fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

fn wire(response: &Response<'_>) -> Vec<u8> {
    let mut out = [0; MAX_WIRE];
    let len = response.encode(&mut out).unwrap();
    out[..len].to_vec()
}

/// Submits, sends at `now`, and lets the line turn round at `now`.
fn ask(master: &mut Master, now: Duration, request: Request<'_>, retries: u8) -> Ticket {
    let ticket = master.submit(&request, retries).unwrap();
    assert!(master.poll_transmit(now).is_some());
    assert_eq!(master.poll_transmit(now), None, "sent once");
    master.handle_transmit_done(now);
    ticket
}

#[track_caller]
fn ends(master: &mut Master, ticket: Ticket, outcome: Outcome<'_>) {
    assert_eq!(master.poll_event(), Some(Event::Outcome { ticket, outcome }));
    assert_eq!(master.poll_event(), None);
}

#[test]
fn an_answer_in_pieces_is_done() {
    let mut master = Master::default();
    let ticket = ask(&mut master, ms(0), Request::ReadParameter { index: 5 }, 0);
    assert_eq!(master.poll_timeout(), Some(ms(100)));
    let answer = wire(&Response::Parameter { index: 5, value: 0x82 });
    for (at, byte) in answer.iter().enumerate() {
        assert_eq!(master.poll_event(), None);
        // The last byte comes after the time for an answer to begin: it has begun in time.
        master.handle_timeout(ms(95 + at as u64));
        master.handle_bytes(ms(95 + at as u64), &[*byte]);
    }
    ends(&mut master, ticket, Outcome::Done(Response::Parameter { index: 5, value: 0x82 }));
    assert_eq!(master.poll_timeout(), None);
}

#[test]
fn the_answer_time_starts_when_the_line_turns_round() {
    let mut master = Master::default();
    let ticket = master.submit(&Request::DeviceType, 0).unwrap();
    assert!(master.poll_transmit(ms(0)).is_some());
    assert_eq!(master.poll_timeout(), None);
    master.handle_timeout(ms(500));
    assert_eq!(master.poll_event(), None);
    master.handle_transmit_done(ms(500));
    assert_eq!(master.poll_timeout(), Some(ms(600)));
    master.handle_timeout(ms(599));
    assert_eq!(master.poll_event(), None, "an early call does nothing");
    master.handle_timeout(ms(600));
    ends(&mut master, ticket, Outcome::TimedOut(TimedOut { attempts: 1, damage: None }));
    master.handle_timeout(ms(700));
    assert_eq!(master.poll_event(), None);
}

#[test]
fn silence_inside_an_answer_ends_it() {
    let mut master = Master::default();
    let ticket = ask(&mut master, ms(0), Request::DeviceType, 0);
    master.handle_bytes(ms(90), &[0x82, 0x96, 0x05]);
    assert_eq!(master.poll_timeout(), Some(ms(100)));
    master.handle_timeout(ms(100));
    assert!(matches!(master.poll_event(), Some(Event::Damage(d)) if d.kind == DamageKind::Gap));
    ends(&mut master, ticket, Outcome::TimedOut(TimedOut { attempts: 1, damage: Some(DamageKind::Gap) }));
}

#[test]
fn a_damaged_answer_waits_for_the_rest_of_the_answer_time() {
    let mut master = Master::default();
    let ticket = ask(&mut master, ms(0), Request::FailureCount, 0);
    master.handle_bytes(ms(20), &[0x82, 0x96, 0x03, 0x52, 0x01, 0x00]);
    let kind = DamageKind::CheckByte { expected: 0x50, found: 0 };
    assert!(matches!(master.poll_event(), Some(Event::Damage(d)) if d.kind == kind));
    assert_eq!(master.poll_event(), None);
    assert_eq!(master.poll_timeout(), Some(ms(100)));
    master.handle_timeout(ms(100));
    ends(&mut master, ticket, Outcome::TimedOut(TimedOut { attempts: 1, damage: Some(kind) }));
}

#[test]
fn endless_noise_with_heads_cannot_hold_a_request_open() {
    let mut master = Master::default();
    let ticket = ask(&mut master, ms(0), Request::DeviceType, 0);
    let mut now = ms(0);
    let mut outcome = false;
    while !outcome {
        now += ms(3);
        assert!(now < ms(120), "still open");
        master.handle_timeout(now);
        master.handle_bytes(now, &[0x82, 0x96, 0xF0]);
        while let Some(event) = master.poll_event() {
            outcome |= matches!(event, Event::Outcome { outcome: Outcome::TimedOut(_), .. });
        }
    }
    let again = ask(&mut master, now, Request::OsVersion, 0);
    assert_ne!(ticket, again);
}

#[test]
fn refusals_carry_the_devices_code() {
    let mut master = Master::default();
    let ticket = ask(&mut master, ms(0), Request::EraseFlash { bank: 12 }, 0);
    master.handle_bytes(ms(5), &wire(&Response::Error(ErrorCode::BANK)));
    ends(&mut master, ticket, Outcome::Refused(ErrorCode::BANK));
}

#[test]
fn reads_are_repeated_when_asked_for_and_writes_never() {
    let mut master = Master::default();
    let write = Request::WriteParameter { index: 5, value: 1 };
    assert_eq!(master.submit(&write, 1), Err(SubmitError::NotRepeatable { function: 0xCC }));
    let raw = Request::Raw { function: 0x77, data: &[] };
    assert_eq!(master.submit(&raw, 1), Err(SubmitError::NotRepeatable { function: 0x77 }));

    let ticket = ask(&mut master, ms(0), Request::ReadParameter { index: 5 }, 2);
    master.handle_timeout(ms(100));
    assert_eq!(master.poll_event(), None);
    assert!(master.poll_transmit(ms(100)).is_some());
    master.handle_transmit_done(ms(110));
    // The device did not understand the second one: the third is the last.
    master.handle_bytes(ms(120), &wire(&Response::Error(ErrorCode::PARITY)));
    assert!(master.poll_transmit(ms(120)).is_some());
    master.handle_transmit_done(ms(130));
    master.handle_timeout(ms(230));
    assert_eq!(master.poll_transmit(ms(230)), None);
    ends(&mut master, ticket, Outcome::TimedOut(TimedOut { attempts: 3, damage: None }));
}

#[test]
fn a_wrong_echo_is_neither_done_nor_refused() {
    let mut master = Master::default();
    let asked = Request::ReadParameter { index: 5 };
    let ticket = ask(&mut master, ms(0), asked, 0);
    let answer = Response::Parameter { index: 6, value: 1 };
    master.handle_bytes(ms(5), &wire(&answer));
    let mismatch = Mismatch::Other { expected: asked.echo(), found: answer.echo().unwrap() };
    assert_eq!(mismatch.to_string(), "answer to CCh 30h [006], expected one to CCh 30h [005]");
    ends(&mut master, ticket, Outcome::WrongEcho(mismatch));

    let ticket = ask(&mut master, ms(10), Request::ReadRam { bank: 12, offset: 0, count: 2 }, 0);
    master.handle_bytes(ms(15), &wire(&Response::RamData { bank: 12, data: &[1] }));
    assert!(matches!(
        master.poll_event(),
        Some(Event::Outcome { ticket: t, outcome: Outcome::WrongEcho(_) }) if t == ticket
    ));

    let ticket = ask(&mut master, ms(20), Request::DeviceType, 0);
    master.handle_bytes(ms(25), &[0x82, 0x96, 0x03, 0x40, 0x00, 0x43]);
    assert!(matches!(
        master.poll_event(),
        Some(Event::Outcome { ticket: t, outcome: Outcome::WrongEcho(Mismatch::Number(_)) }) if t == ticket
    ));
}

#[test]
fn a_late_answer_is_told_apart_from_the_answer_awaited() {
    let mut master = Master::default();
    let late = ask(&mut master, ms(0), Request::ReadParameter { index: 5 }, 0);
    master.handle_timeout(ms(100));
    ends(&mut master, late, Outcome::TimedOut(TimedOut { attempts: 1, damage: None }));
    let ticket = ask(&mut master, ms(100), Request::ReadParameter { index: 6 }, 0);
    master.handle_bytes(ms(101), &wire(&Response::Parameter { index: 5, value: 1 }));
    assert_eq!(master.poll_event(), Some(Event::Late(late)));
    master.handle_bytes(ms(110), &wire(&Response::Parameter { index: 6, value: 2 }));
    ends(&mut master, ticket, Outcome::Done(Response::Parameter { index: 6, value: 2 }));
}

/// Manual A: "a device with this number [0] will always reply".
#[test]
fn two_answers_to_one_selection_are_reported() {
    let mut master = Master::default();
    let ticket = ask(&mut master, ms(0), Request::SelectDevice(5), 0);
    let echo = wire(&Response::Selected(5));
    master.handle_bytes(ms(5), &[&echo[..], &echo].concat());
    assert_eq!(master.poll_event(), Some(Event::SecondAnswer(ticket)));
    ends(&mut master, ticket, Outcome::Done(Response::Selected(5)));
    // Also when it comes while the next answer is awaited.
    let next = ask(&mut master, ms(10), Request::DeviceType, 0);
    master.handle_bytes(ms(11), &echo);
    assert_eq!(master.poll_event(), Some(Event::SecondAnswer(ticket)));
    let answer = Response::DeviceType { device: 8230, axes: 6 };
    master.handle_bytes(ms(12), &wire(&answer));
    ends(&mut master, next, Outcome::Done(answer));
}

#[test]
fn cancelled_requests_end_once_and_their_answer_is_late() {
    let mut master = Master::default();
    let ticket = ask(&mut master, ms(0), Request::DeviceType, 0);
    master.cancel(ticket);
    master.cancel(ticket);
    master.handle_bytes(ms(5), &wire(&Response::DeviceType { device: 8230, axes: 6 }));
    assert_eq!(master.poll_event(), Some(Event::Late(ticket)));
    ends(&mut master, ticket, Outcome::Cancelled);
    master.cancel(ticket);
    assert_eq!(master.poll_event(), None);
}

#[test]
fn one_request_at_a_time() {
    let mut master = Master::new(Config { answer: ms(7), ..Config::default() });
    let ticket = ask(&mut master, ms(0), Request::DeviceType, 0);
    assert_eq!(master.submit(&Request::OsVersion, 0), Err(SubmitError::Busy));
    master.handle_timeout(ms(7));
    assert_eq!(master.submit(&Request::OsVersion, 0), Err(SubmitError::Busy), "outcome not polled");
    ends(&mut master, ticket, Outcome::TimedOut(TimedOut { attempts: 1, damage: None }));
    assert!(master.submit(&Request::OsVersion, 0).is_ok());
    let long = [0; 254];
    let mut idle = Master::default();
    assert!(matches!(
        idle.submit(&Request::Raw { function: 0x77, data: &long }, 0),
        Err(SubmitError::Encode(_))
    ));
}

#[test]
fn notices_that_nobody_polls_are_counted() {
    let mut master = Master::default();
    for _ in 0..5 {
        master.handle_bytes(ms(0), &wire(&Response::FailureCount(0)));
    }
    assert_eq!(master.lost_notices(), 2);
    let stray = Response::FailureCount(0).echo().unwrap();
    for _ in 0..3 {
        assert_eq!(master.poll_event(), Some(Event::Stray(stray)));
    }
    assert_eq!(master.poll_event(), None);
}
