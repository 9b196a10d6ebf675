//! The master engine against a peer that does anything.

use core::time::Duration;

use lb2::frame::MAX_WIRE;
use lb2::master::{Event, Master, Outcome, Ticket};
use lb2::telegram::{Request, Response};

use super::Input;

/// Plays operations on a master: submissions, cancellations, bytes of any kind, answers that fit,
/// passing time. Every ticket must end in exactly one outcome, and time alone must end it.
pub fn master_ops(data: &[u8]) {
    let mut input = Input(data);
    let mut master = Master::default();
    let mut now = Duration::ZERO;
    let mut open: Option<(Ticket, Request<'_>)> = None;
    while !input.is_empty() {
        match input.u8() % 8 {
            0 | 1 => {
                let request = request(&mut input);
                let retries = input.u8() % 3;
                if let Ok(ticket) = master.submit(&request, retries) {
                    assert!(open.is_none(), "one request at a time");
                    assert!(retries == 0 || request.is_repeatable());
                    open = Some((ticket, request));
                }
            }
            2 => {
                if let Some((ticket, _)) = open {
                    master.cancel(ticket);
                }
            }
            3 => {
                let len = input.u8() % 32;
                master.handle_bytes(now, input.bytes(len));
            }
            4 => {
                let mut wire = [0; MAX_WIRE];
                let response = match input.u8() % 4 {
                    0 => Response::Error(lb2::code::ErrorCode(input.u8())),
                    1 => Response::Parameter { index: input.u16() % 4, value: input.i32() },
                    2 => Response::Selected(input.u8() % 4),
                    _ => Response::RamData { bank: 12, data: input.bytes(3) },
                };
                let len = response.encode(&mut wire).unwrap();
                let cut = usize::from(input.u8()).min(len);
                master.handle_bytes(now, &wire[..cut]);
                master.handle_bytes(now, &wire[cut..len]);
            }
            5 => {
                now += Duration::from_millis(u64::from(input.u8()));
                master.handle_timeout(now);
            }
            6 => {
                if master.poll_transmit(now).is_some() {
                    assert!(open.is_some(), "nothing to send without a request");
                    assert!(master.poll_transmit(now).is_none(), "sent once");
                }
            }
            _ => master.handle_transmit_done(now),
        }
        drain(&mut master, &mut open);
    }
    // Whatever is open ends by time alone.
    for _ in 0..16 {
        while master.poll_transmit(now).is_some() {}
        master.handle_transmit_done(now);
        if let Some(timeout) = master.poll_timeout() {
            now = now.max(timeout);
            master.handle_timeout(now);
        }
        drain(&mut master, &mut open);
    }
    assert!(open.is_none(), "a ticket without outcome");
    assert_eq!(master.poll_timeout(), None);
}

fn drain(master: &mut Master, open: &mut Option<(Ticket, Request<'_>)>) {
    while let Some(event) = master.poll_event() {
        if let Event::Outcome { ticket, outcome } = event {
            let (expected, request) = open.take().expect("an outcome without a request");
            assert_eq!(ticket, expected);
            if let Outcome::Done(response) = outcome {
                assert_eq!(response.echo(), Some(request.echo()));
            }
        }
    }
}

fn request<'a>(input: &mut Input<'a>) -> Request<'a> {
    match input.u8() % 8 {
        0 => Request::SelectDevice(input.u8() % 4),
        1 => Request::ReadParameter { index: input.u16() % 4 },
        2 => Request::WriteParameter { index: input.u16() % 4, value: input.i32() },
        3 => Request::ReadRam { bank: 12, offset: input.u16(), count: input.u8() % 4 },
        4 => Request::WriteRam { bank: 12, offset: input.u16(), data: input.bytes(9) },
        5 => Request::Failures,
        6 => Request::SaveParameters,
        _ => Request::Raw { function: input.u8(), data: input.bytes(4) },
    }
}
