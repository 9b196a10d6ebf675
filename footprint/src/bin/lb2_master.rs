//! Framing, every typed request and response, and the LB2 master engine.
#![no_std]
#![no_main]

use core::hint::black_box;

use footprint::{now, wire};
use lb2::device::INTER_BYTE;
use lb2::master::{ANSWER, Config, Event, Master, Outcome};
use lb2::telegram::{Request, Response};

#[used]
#[unsafe(no_mangle)]
static ENGINE_STATE: Master = Master::new(Config { answer: ANSWER, inter_byte: INTER_BYTE });

#[unsafe(no_mangle)]
extern "C" fn _start() {
    let mut master = Master::new(black_box(Config::default()));
    let request: Request<'static> = black_box(Request::DeviceType);
    if let Ok(ticket) = master.submit(&request, black_box(2)) {
        black_box(master.poll_transmit(now()));
        master.handle_transmit_done(now());
        master.handle_bytes(now(), wire());
        master.handle_timeout(now());
        master.cancel(ticket);
    }
    while let Some(event) = master.poll_event() {
        if let Event::Outcome { outcome: Outcome::Done(response), .. } = event {
            black_box::<Response<'_>>(response);
        } else {
            black_box(event);
        }
    }
    black_box(master.poll_timeout());
}
