//! Boot: what CiA 302-2 calls each failure, and what the sentence says.

use canopen_master::boot::{Booted, ConciseDcf, Config, ErrorControl, Failure, Report, Running};
use canopen_master::guarding;
use canopen_master::master::{Event, SubmitError};
use canopen_master::nmt::State;
use canopen_master::{Address, sdo};

use super::net::{Net, identity, ms, node};

/// 1017h := 100 ms, 2600h:00 := 22, 1020h:01 := 7, 1020h:02 := 9.
const DCF: [u8; 43] = [
    4, 0, 0, 0, 0x17, 0x10, 0, 2, 0, 0, 0, 100, 0, 0x00, 0x26, 0, 1, 0, 0, 0, 22, 0x20, 0x10, 1, 4, 0, 0, 0,
    7, 0, 0, 0, 0x20, 0x10, 2, 4, 0, 0, 0, 9, 0, 0, 0,
];

fn dcf() -> ConciseDcf<'static> {
    ConciseDcf::new(&DCF).unwrap()
}

fn config() -> Config<'static> {
    let own = identity(1);
    Config {
        device_type: Some(0x0002_0192),
        identity: [own.vendor, own.product, own.revision, own.serial].map(Some),
        configured: Some((7, 9)),
        dcf: dcf(),
        error_control: ErrorControl::Heartbeat { producer_ms: 0, consumer_ms: 300 },
        ..Config::default()
    }
}

fn boot(net: &mut Net, config: Config<'static>) -> Result<Booted, Failure> {
    net.events.clear();
    let now = net.now;
    net.master.boot(now, node(1), Box::leak(Box::new(config))).unwrap();
    net.expect(ms(10_000), |event| match event {
        Event::Booted { result, .. } => Some(*result),
        _ => None,
    })
}

#[test]
fn a_node_is_identified_configured_watched_and_started() {
    let mut net = Net::new(&[1]);
    let booted = boot(&mut net, config());
    assert_eq!(booted, Ok(Booted { device_type: 0x0002_0192, taken_over: false, written: 4 }));
    assert_eq!(Report(booted).to_string(), "booted, device type 00020192h, 4 objects configured");
    assert_eq!(net.slaves[0].objects().objects[&Address::new(0x2600, 0)], [22]);
    net.run(net.now + ms(1000));
    assert_eq!(net.master.state(node(1)), Some(State::Operational));
    assert_eq!(net.slaves[0].state(), State::Operational);

    // Configured by now: not again.
    let again = boot(&mut net, config());
    assert_eq!(again, Ok(Booted { device_type: 0x0002_0192, taken_over: false, written: 0 }));

    // Running by now: left alone.
    net.run(net.now + ms(500));
    let kept = boot(&mut net, Config { running: Running::TakeOver, ..config() });
    assert_eq!(kept, Ok(Booted { device_type: 0x0002_0192, taken_over: true, written: 0 }));
    assert_eq!(Report(kept).to_string(), "L: was operational and was taken over, device type 00020192h");
    assert_eq!(net.slaves[0].state(), State::Operational);
}

#[test]
fn every_failure_has_its_letter_and_its_sentence() {
    let gone = |net: &mut Net, index: u16, sub: u8| {
        net.slaves[0].objects_mut().objects.remove(&Address::new(index, sub));
    };
    let check = |prepare: &dyn Fn(&mut Net), config: Config<'static>, expected: &str| {
        let mut net = Net::new(&[1]);
        prepare(&mut net);
        let result = boot(&mut net, config);
        assert_eq!(Report(result).to_string(), expected);
        // Nothing is watched that failed.
        net.run(net.now + ms(2000));
        let watched = net
            .events
            .iter()
            .any(|(_, event)| matches!(event, Event::Guarding { .. } | Event::Heartbeat { .. }));
        assert!(!watched, "{:?}", net.events);
    };
    let nothing = |_: &mut Net| {};
    let silent = |net: &mut Net| net.silent[0] = true;
    check(&silent, config(), "B: device type (1000h) not read: no answer in time");
    check(
        &|net| gone(net, 0x1000, 0),
        config(),
        "B: device type (1000h) not read: aborted by the device: \
         object does not exist in the object dictionary (06020000h)",
    );
    let other = Config { device_type: Some(0x0191), ..config() };
    check(&nothing, other, "C: device type is 00020192h, 00000191h expected");
    for (part, letter, name, found) in [
        (0, 'D', "vendor ID", 0x6A_u32),
        (1, 'M', "product code", 3),
        (2, 'N', "revision number", 1),
        (3, 'O', "serial number", 1),
    ] {
        let mut other = config();
        other.identity[part] = Some(0xABCD);
        let expected = format!("{letter}: {name} is {found:08X}h, 0000ABCDh expected");
        check(&nothing, other, &expected);
    }
    check(
        &|net| gone(net, 0x1018, 4),
        config(),
        "O: serial number (1018h) not read, 00000001h expected: aborted by the device: \
         object does not exist in the object dictionary (06020000h)",
    );
    let keep = Config { running: Running::TakeOver, ..config() };
    check(&silent, keep, "E: no heartbeat within 300 ms while the node's state was checked");
    let guarded = ErrorControl::Guarding(guarding::Config::default());
    let keep = Config { running: Running::TakeOver, error_control: guarded, ..config() };
    check(&silent, keep, "F: no answer to node guarding within 300ms");
    check(
        &|net| gone(net, 0x2600, 0),
        config(),
        "J: configuration entry 2 (2600h:00) not written: aborted by the device: \
         object does not exist in the object dictionary (06020000h)",
    );
    let unwatched = Config { dcf: ConciseDcf::EMPTY, ..config() };
    check(&nothing, unwatched, "K: no heartbeat within 300 ms when error control was started");
}

#[test]
fn guarding_is_started_too() {
    let mut net = Net::new(&[1]);
    let error_control = ErrorControl::Guarding(guarding::Config::default());
    boot(&mut net, Config { error_control, start: false, ..config() }).unwrap();
    net.run(net.now + ms(1000));
    assert_eq!(net.master.state(node(1)), Some(State::PreOperational), "not started");
    net.silent[0] = true;
    net.run(net.now + ms(1000));
    let lost = Event::Guarding { node: node(1), event: guarding::Event::Lost };
    assert_eq!(net.take_events().into_iter().filter(|event| *event == lost).count(), 1);
}

#[test]
fn a_boot_can_be_given_up_and_keeps_others_out() {
    let mut net = Net::new(&[1]);
    net.silent[0] = true;
    let config: &'static _ = Box::leak(Box::new(config()));
    net.master.boot(ms(0), node(1), config).unwrap();
    assert_eq!(net.master.boot(ms(0), node(1), config), Err(SubmitError::Busy(node(1))));
    let at = Address::new(0x1000, 0);
    let busy = net.master.upload(node(1), at, Vec::new(), &sdo::Options::default());
    assert_eq!(busy.unwrap_err().error, SubmitError::Busy(node(1)));
    // In the middle of its first read.
    net.run(ms(1100));
    net.master.cancel_boot(net.now, node(1));
    net.run(ms(1200));
    assert_eq!(net.take_events(), [Event::Booted { node: node(1), result: Err(Failure::Cancelled) }]);
    net.silent[0] = false;
    net.master.upload(node(1), Address::new(0x1008, 0), Vec::new(), &sdo::Options::default()).unwrap();
    net.run(ms(1300));
    assert!(matches!(&net.take_events()[..], [Event::Sdo { finished, .. }] if finished.buffer == b"SD03"));
}
