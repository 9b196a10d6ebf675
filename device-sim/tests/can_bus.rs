//! The virtual CAN bus through its public API, on virtual time.

use core::time::Duration;

use device_sim::can::{
    Bus, ErrorKind, Event, Fault, Faults, INTERMISSION, State, StationId, TransmitError, WireBits,
};
use pdo::Frame;

const RATE: u32 = 500_000;
const BIT: Duration = Duration::from_nanos(2000);

fn bits(count: u64) -> Duration {
    BIT * u32::try_from(count).unwrap()
}

fn wire(frame: &Frame) -> u64 {
    WireBits::new(frame).frame_len() as u64
}

fn bus_of<const N: usize>() -> (Bus, [StationId; N]) {
    let mut bus = Bus::new(RATE, Faults::NONE);
    let stations = core::array::from_fn(|_| bus.connect());
    (bus, stations)
}

fn events(bus: &mut Bus, station: StationId) -> Vec<(Duration, Event)> {
    core::iter::from_fn(|| bus.poll_event(station)).collect()
}

fn frames(bus: &mut Bus, station: StationId) -> Vec<(Duration, Frame)> {
    let frame = |(at, event)| match event {
        Event::Received(frame) => Some((at, frame)),
        _ => None,
    };
    events(bus, station).into_iter().filter_map(frame).collect()
}

/// Lets the bus come to rest.
fn settle(bus: &mut Bus) {
    for _ in 0..100_000 {
        let Some(at) = bus.poll_timeout() else { return };
        bus.handle_timeout(at);
    }
    panic!("the bus does not come to rest");
}

#[test]
fn a_frame_takes_its_bits() {
    let (mut bus, [one, two, three]) = bus_of();
    let start = Duration::from_millis(3);
    // Alternating bits: only the zeros of the length and the CRC can need stuff bits.
    let frame = Frame::standard(0x555, [0x55; 8]);
    bus.send(start, one, frame).unwrap();
    bus.send(start, one, frame).unwrap();
    settle(&mut bus);
    let first = start + bits(wire(&frame));
    let second = first + bits(INTERMISSION + wire(&frame));
    assert_eq!(frames(&mut bus, two), [(first, frame), (second, frame)]);
    assert_eq!(frames(&mut bus, three).len(), 2);
    assert_eq!(events(&mut bus, one), []);
    assert_eq!(bus.statistics().bits, 2 * (wire(&frame) + INTERMISSION));
}

#[test]
fn the_lower_identifier_wins_and_the_loser_follows() {
    let (mut bus, [one, two, three]) = bus_of();
    let (low, high) = (Frame::standard(0x181, [1]), Frame::standard(0x182, [2]));
    bus.send(Duration::ZERO, one, high).unwrap();
    bus.send(Duration::ZERO, two, low).unwrap();
    // Ready while the first frame is on the wire: takes part in the next arbitration.
    let sync = Frame::standard(0x080, []);
    bus.handle_timeout(Duration::ZERO);
    bus.send(bits(10), three, sync).unwrap();
    settle(&mut bus);
    let order: Vec<_> = frames(&mut bus, three).into_iter().map(|(_, frame)| frame).collect();
    assert_eq!(order, [low, high]);
    let seen = frames(&mut bus, two);
    let sync_at = bits(wire(&low) + INTERMISSION + wire(&sync));
    assert_eq!(seen, [(sync_at, sync), (sync_at + bits(INTERMISSION + wire(&high)), high)]);
    assert_eq!(bus.counters(one).transmit(), 0);
}

/// Nobody acknowledges: 16 attempts to error passive, and never bus-off (ISO 11898-1, exception of the
/// acknowledge error).
#[test]
fn alone_on_the_bus() {
    let (mut bus, [one]) = bus_of();
    let frame = Frame::standard(0x701, [0]);
    bus.send(Duration::ZERO, one, frame).unwrap();
    while bus.statistics().errors < 200 {
        let at = bus.poll_timeout().unwrap();
        bus.handle_timeout(at);
    }
    assert_eq!((bus.counters(one).transmit(), bus.state(one)), (128, State::Passive));
    let seen = events(&mut bus, one);
    let states: Vec<_> = seen.iter().filter(|(_, event)| matches!(event, Event::State(_))).collect();
    let attempt = WireBits::new(&frame).acknowledge_slot() as u64 + 1 + 6 + 8;
    let ends = |number: u64| bits(number * attempt + (number - 1) * INTERMISSION);
    assert_eq!(
        states,
        [&(ends(12), Event::State(State::Warning)), &(ends(16), Event::State(State::Passive))]
    );
    assert_eq!(seen[0].1, Event::Error { kind: ErrorKind::Acknowledge, transmitter: true });
    // Somebody comes: the frame that waited is delivered.
    let two = bus.connect();
    while bus.statistics().frames == 0 {
        let at = bus.poll_timeout().unwrap();
        bus.handle_timeout(at);
    }
    assert_eq!(frames(&mut bus, two).len(), 1);
    assert_eq!((bus.counters(one).transmit(), bus.state(one)), (127, State::Warning));
}

#[test]
fn a_broken_transmitter_goes_bus_off_and_comes_back() {
    let (mut bus, [one, two]) = bus_of();
    bus.break_transmitter(one, true);
    let frame = Frame::standard(0x123, [1, 2, 3]);
    for _ in 0..3 {
        bus.send(Duration::ZERO, one, frame).unwrap();
    }
    settle(&mut bus);
    assert_eq!(bus.state(one), State::BusOff);
    assert_eq!(bus.statistics().errors, 32);
    let seen = events(&mut bus, one);
    assert_eq!(seen.last().unwrap().1, Event::Discarded(3));
    assert!(seen.iter().any(|(_, event)| *event == Event::State(State::BusOff)));
    let now = seen.last().unwrap().0;
    assert_eq!(bus.send(now, one, frame), Err(TransmitError::OffBus));
    // 32 error frames are 32 receive errors, and no frame.
    assert_eq!((bus.counters(two).receive(), bus.state(two)), (32, State::Active));
    assert_eq!(frames(&mut bus, two), []);

    bus.break_transmitter(one, false);
    bus.restart(now, one);
    settle(&mut bus);
    assert_eq!(events(&mut bus, one), [(now + bits(128 * 11), Event::State(State::Active))]);
    bus.send(now + Duration::from_secs(1), one, frame).unwrap();
    settle(&mut bus);
    assert_eq!(frames(&mut bus, two).len(), 1);
    assert_eq!(bus.counters(two).receive(), 31);
}

#[test]
fn one_identifier_twice_is_an_error_for_both() {
    let (mut bus, [one, two, three]) = bus_of();
    bus.send(Duration::ZERO, one, Frame::standard(0x181, [0x0F])).unwrap();
    bus.send(Duration::ZERO, two, Frame::standard(0x181, [0xF0])).unwrap();
    settle(&mut bus);
    // Always together: both end bus-off, which is why CANopen nodes must differ.
    assert_eq!((bus.state(one), bus.state(two)), (State::BusOff, State::BusOff));
    assert_eq!(frames(&mut bus, three), []);
    // Equal frames are one frame.
    let (mut bus, [one, two, three]) = bus_of();
    let same = Frame::standard(0x080, []);
    bus.send(Duration::ZERO, one, same).unwrap();
    bus.send(Duration::ZERO, two, same).unwrap();
    settle(&mut bus);
    assert_eq!(frames(&mut bus, three).len(), 1);
    assert_eq!(bus.statistics().frames, 1);
}

/// An error frame: the bits up to the error, 6 + 6 of the flags less the run that the receivers have seen,
/// 8 of the delimiter.
#[test]
fn a_wire_error_costs_an_error_frame_and_a_repetition() {
    let frame = Frame::standard(0x2AA, [0xAA; 8]);
    for number in 0..70 {
        let (mut bus, [one, two]) = bus_of();
        bus.script(0, Fault::WireError(number));
        bus.send(Duration::ZERO, one, frame).unwrap();
        settle(&mut bus);
        let spent = bus.statistics().bits - wire(&frame) - INTERMISSION;
        let position = WireBits::new(&frame).arbitration_len() as u64 + u64::from(number);
        let extra = spent - (position + 1) - 8 - INTERMISSION;
        assert!((6..=12).contains(&extra), "error at bit {position}: flags of {extra} bits");
        let received = frames(&mut bus, two);
        assert_eq!(received, [(bits(bus.statistics().bits - INTERMISSION), frame)]);
        assert_eq!((bus.counters(one).transmit(), bus.counters(two).receive()), (7, 0));
    }
}

/// After its frame an error-passive station waits 8 bits longer: another one's frame goes first.
#[test]
fn an_error_passive_station_lets_others_go_first() {
    let (mut bus, [one, two]) = bus_of();
    for number in 0..16 {
        bus.script(number, Fault::WireError(0));
    }
    let urgent = Frame::standard(0x001, []);
    bus.send(Duration::ZERO, one, urgent).unwrap();
    bus.send(Duration::ZERO, one, urgent).unwrap();
    while bus.statistics().errors < 16 {
        let at = bus.poll_timeout().unwrap();
        bus.handle_timeout(at);
    }
    assert_eq!(bus.state(one), State::Passive);
    let now = bus.poll_timeout().unwrap() - bits(5);
    bus.send(now, two, Frame::standard(0x7FF, [])).unwrap();
    settle(&mut bus);
    let first = frames(&mut bus, one);
    let after = frames(&mut bus, two);
    assert!(first[0].0 < after[0].0, "{first:?} {after:?}");
}

#[test]
fn faults_of_single_frames() {
    let (mut bus, [one, two]) = bus_of();
    let frame = |number: u16| Frame::standard(0x100 + number, [0; 4]);
    let delay = Duration::from_millis(5);
    bus.script(1, Fault::Lose);
    bus.script(2, Fault::Duplicate);
    bus.script(4, Fault::Corrupt(9));
    bus.script(5, Fault::Delay(delay));
    for number in 0..6 {
        bus.send(Duration::ZERO, one, frame(number)).unwrap();
    }
    settle(&mut bus);
    let received: Vec<_> = frames(&mut bus, two).into_iter().map(|(_, frame)| frame).collect();
    let corrupt = Frame::standard(0x103, [0, 2, 0, 0]);
    // Transmission 3 repeats frame 2.
    assert_eq!(received, [frame(0), frame(2), frame(2), corrupt, frame(5), frame(4)]);
    assert_eq!(bus.statistics().faulty, 4);
}

#[test]
fn a_seed_repeats_its_faults() {
    let faults =
        Faults { seed: 7, wire_error: 20, lose: 20, duplicate: 20, delay: 20, corrupt: 20, ..Faults::NONE };
    let run = |seed| {
        let mut bus = Bus::new(RATE, Faults { seed, ..faults });
        let (one, two) = (bus.connect(), bus.connect());
        let mut now = Duration::ZERO;
        for number in 0..2000u16 {
            bus.send(now, one, Frame::standard(number & 0x7FF, number.to_be_bytes())).unwrap();
            now += Duration::from_micros(250);
            bus.handle_timeout(now);
        }
        settle(&mut bus);
        (frames(&mut bus, two), bus.statistics())
    };
    assert_eq!(run(7), run(7));
    assert_ne!(run(7).0, run(8).0);
    let faulty = run(7).1.faulty;
    assert!((350..650).contains(&faulty), "{faulty} of 2000");
}

#[test]
fn unplugged_stations_neither_hear_nor_acknowledge() {
    let (mut bus, [one, two]) = bus_of();
    bus.plug(two, false);
    bus.send(Duration::ZERO, one, Frame::standard(0x080, [])).unwrap();
    bus.handle_timeout(Duration::from_millis(1));
    assert_eq!((bus.statistics().frames, bus.statistics().errors > 3), (0, true));
    assert_eq!(bus.send(Duration::ZERO, two, Frame::standard(0x080, [])), Err(TransmitError::OffBus));
    bus.plug(two, true);
    settle(&mut bus);
    assert_eq!(frames(&mut bus, two).len(), 1);
}

#[test]
fn a_full_queue_is_said() {
    let (mut bus, [one, _]) = bus_of();
    let frame = Frame::standard(0x080, []);
    while bus.room(one) > 0 {
        bus.send(Duration::ZERO, one, frame).unwrap();
    }
    assert_eq!(bus.send(Duration::ZERO, one, frame), Err(TransmitError::QueueFull));
    settle(&mut bus);
    assert_eq!(bus.statistics().frames, device_sim::can::QUEUE as u64);
}
