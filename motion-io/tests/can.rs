//! CAN endpoints against each other, in this process: virtual bus, socketcand over TCP, slcan over a
//! pseudo-terminal.
#![cfg(feature = "virtual")]

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::sync::Arc;

use device_sim::can::Faults;
use embedded_can::{ExtendedId, StandardId};
use motion_io::can::{BusEvent, BusState, CanPort, Event, Server, VirtualBus, open};
use motion_io::endpoint::CanEndpoint;
use pdo::Frame;

const SOON: Duration = Duration::from_secs(5);

fn endpoint(text: &str) -> Box<dyn CanPort> {
    open(&text.parse::<CanEndpoint>().unwrap()).unwrap()
}

/// The next frame; events of the bus are passed over.
#[track_caller]
fn next(port: &mut dyn CanPort) -> Frame {
    loop {
        match port.receive(SOON).unwrap() {
            Some(Event::Frame(frame)) => return frame,
            Some(_) => {}
            None => panic!("nothing came"),
        }
    }
}

fn samples() -> Vec<Frame> {
    vec![
        Frame::standard(0x000, [1, 5]),
        Frame::standard(0x080, []),
        Frame::standard(0x581, [0x4B, 0x41, 0x60, 0, 0x18, 2, 0, 0]),
        Frame::remote_frame(StandardId::new(0x701).unwrap(), 1).unwrap(),
        Frame::data_frame(ExtendedId::new(0x123).unwrap(), &[1, 2, 3]).unwrap(),
        Frame::remote_frame(ExtendedId::new(0x1FFF_FFFF).unwrap(), 8).unwrap(),
    ]
}

#[track_caller]
fn pass(from: &mut dyn CanPort, to: &mut dyn CanPort) {
    for frame in samples() {
        from.send(&frame).unwrap();
        assert_eq!(next(to), frame);
    }
}

#[test]
fn virtual_buses_by_name() {
    let (mut one, mut two) = (endpoint("virtual:test"), endpoint("virtual:test"));
    pass(&mut *one, &mut *two);
    pass(&mut *two, &mut *one);
    let mut other = endpoint("virtual:other");
    one.send(&Frame::standard(0x123, [])).unwrap();
    assert_eq!(other.receive(Duration::ZERO).unwrap(), None);
}

struct Served {
    address: String,
    stop: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Served {
    fn new(bus: &VirtualBus) -> Self {
        let server = Server::bind("127.0.0.1:0", vec![("can0".into(), bus.clone())]).unwrap();
        let address = server.address().unwrap().to_string();
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        let thread = std::thread::spawn(move || server.serve(&flag).unwrap());
        Self { address, stop, thread: Some(thread) }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

#[test]
fn socketcand_both_ways() {
    let bus = VirtualBus::new(1_000_000, Faults::NONE);
    let served = Served::new(&bus);
    let mut inside = bus.connect();
    let mut client = endpoint(&format!("socketcand:{}/can0", served.address));
    pass(&mut *client, &mut inside);
    pass(&mut inside, &mut *client);
    let mut second = endpoint(&format!("socketcand:{}/can0", served.address));
    pass(&mut *second, &mut *client);
    // More frames at once than any queue holds.
    for number in 0..500u16 {
        client.send(&Frame::standard(0x100, number.to_be_bytes())).unwrap();
    }
    for number in 0..500u16 {
        assert_eq!(next(&mut *second).data(), number.to_be_bytes());
    }
}

/// As soon as a client is open, the frames on its bus reach it.
#[test]
fn a_frame_right_after_raw_mode_is_not_lost() {
    let bus = VirtualBus::new(1_000_000, Faults::NONE);
    let served = Served::new(&bus);
    let mut inside = bus.connect();
    for number in 0..50u8 {
        let mut client = endpoint(&format!("socketcand:{}/can0", served.address));
        inside.send(&Frame::standard(0x100, [number])).unwrap();
        assert_eq!(next(&mut *client).data(), [number]);
    }
}

#[test]
fn socketcand_says_what_is_wrong() {
    let served = Served::new(&VirtualBus::new(1_000_000, Faults::NONE));
    let say = |text: &str| open(&text.parse().unwrap()).err().unwrap().to_string();
    let said = say(&format!("socketcand:{}/can7", served.address));
    assert!(said.contains("the server does not open the bus \"can7\""), "{said}");
    let address = served.address.clone();
    drop(served);
    let endpoint = format!("socketcand:{address}/can0");
    let said = say(&endpoint);
    assert!(said.starts_with(&format!("{endpoint}: ")), "{said}");
}

#[test]
fn a_client_hears_of_errors_and_of_a_server_that_leaves() {
    let bus = VirtualBus::new(1_000_000, Faults::NONE);
    let served = Served::new(&bus);
    let mut client = endpoint(&format!("socketcand:{}/can0", served.address));
    // The first frames that a client is sent are a little late.
    let mut inside = bus.connect();
    inside.send(&Frame::standard(0x100, [])).unwrap();
    next(&mut *client);
    bus.with(|bus| bus.break_transmitter(inside.station(), true));
    inside.send(&Frame::standard(0x100, [])).unwrap();
    let states = core::iter::from_fn(|| inside.receive(Duration::from_millis(200)).unwrap());
    let last = states.filter(|event| matches!(event, Event::Bus(BusEvent::State(_)))).last();
    assert_eq!(last, Some(Event::Bus(BusEvent::State(BusState::Off))));
    let refused = inside.send(&Frame::standard(0x100, [])).unwrap_err();
    assert_eq!(refused.kind(), std::io::ErrorKind::NetworkDown);
    assert!(matches!(client.receive(SOON).unwrap(), Some(Event::Bus(BusEvent::Error(_)))));
    drop(served);
    let gone = core::iter::repeat_with(|| client.receive(SOON)).find_map(Result::err).unwrap();
    assert!(gone.to_string().contains("closed the connection"), "{gone}");
}

#[cfg(all(unix, feature = "serial", feature = "pty"))]
#[test]
fn slcan_host_and_adapter() {
    let directory = tempfile::tempdir().unwrap();
    let link = directory.path().join("can");
    let mut adapter = endpoint(&format!("slcan-pty:{}", link.display()));
    let path = link.display().to_string();
    let (done, told) = std::sync::mpsc::channel();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            // The adapter has to answer while the host opens.
            let mut host = endpoint(&format!("slcan:{path}?bitrate=1000000"));
            for frame in samples() {
                host.send(&frame).unwrap();
            }
            for frame in samples() {
                assert_eq!(next(&mut *host), frame);
            }
            done.send(()).unwrap();
        });
        for frame in samples() {
            assert_eq!(next(&mut *adapter), frame);
        }
        for frame in samples() {
            adapter.send(&frame).unwrap();
        }
        while told.try_recv().is_err() {
            assert_eq!(adapter.receive(Duration::from_millis(5)).unwrap(), None);
        }
    });
    // The host has closed the channel: frames pass unheard, and the adapter does not wait for anybody.
    adapter.receive(Duration::from_millis(50)).unwrap();
    for _ in 0..10_000 {
        adapter.send(&Frame::standard(0x100, [0; 8])).unwrap();
    }
}
