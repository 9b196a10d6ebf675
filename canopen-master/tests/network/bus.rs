//! Bus trouble: told, survived, nothing lost silently.

use canopen_master::guarding;
use canopen_master::master::{BusStatus, Event, SubmitError};
use canopen_master::nmt::{Command, Target};
use canopen_master::sdo::{self, Outcome};
use canopen_master::{Address, Frame, NodeSet, scan};
use pdo::cob::DefaultPdo;

use super::net::{Net, ms, node};

#[test]
fn bus_off_is_one_event_and_every_command_has_its_outcome() {
    let mut net = Net::new(&[1, 2]);
    for id in [1, 2] {
        net.master.set_guarding(ms(0), node(id), Some(guarding::Config::default())).unwrap();
    }
    net.run(ms(250));
    net.take_events();
    let upload = net.master.upload(node(1), Address::new(0x1008, 0), Vec::new(), &sdo::Options::default());
    let ticket = upload.unwrap();
    net.master.nmt(net.now, Command::Start, Target::All).unwrap();
    net.master.write_pdo(node(2), DefaultPdo::First, &[1, 2]).unwrap();
    net.master.scan(NodeSet::up_to(node(2)), scan::Options::default()).unwrap();
    net.master.handle_bus(net.now, BusStatus::Passive);
    net.master.handle_bus(net.now, BusStatus::Off);
    net.master.handle_bus(net.now, BusStatus::Off);
    let off = SubmitError::OffBus(BusStatus::Off);
    assert_eq!(net.master.write_pdo(node(2), DefaultPdo::First, &[1]), Err(off));
    assert_eq!(net.master.nmt(net.now, Command::Start, Target::All), Err(off));
    assert_eq!(net.master.send(Frame::standard(0x300, [])), Err(off));
    net.run(ms(5000));
    net.master.handle_bus(net.now, BusStatus::Active);
    net.run(ms(6000));
    let mut events = net.take_events();
    events.retain(|event| !matches!(event, Event::State { .. }));
    let missing = NodeSet::up_to(node(2));
    assert!(
        matches!(&events[..], [
        Event::Bus(BusStatus::Passive),
        Event::Bus(BusStatus::Off),
        // The NMT command and the PDO.
        Event::Discarded(2),
        Event::Scanned { silent, .. },
        ..
    ] if *silent == missing),
        "{events:?}"
    );
    let sdo = events.iter().find_map(|event| match event {
        Event::Sdo { finished, .. } => Some((finished.ticket, finished.outcome)),
        _ => None,
    });
    assert_eq!(sdo, Some((ticket, Outcome::TimedOut)), "{events:?}");
    assert!(events.iter().any(|event| matches!(event, Event::Nmt { missing: gone, .. } if *gone == missing)));
    assert!(events.contains(&Event::Bus(BusStatus::Active)));
    assert!(!events.iter().any(|event| matches!(event, Event::Guarding { .. })), "{events:?}");
    // It all works again.
    net.master.upload(node(1), Address::new(0x1008, 0), Vec::new(), &sdo::Options::default()).unwrap();
    net.run(ms(7000));
    assert!(net.events.iter().any(|(_, event)| matches!(event, Event::Sdo { finished, .. }
        if finished.buffer == b"SD03")));
}

#[test]
fn what_the_adapter_does_not_take_goes_first_later() {
    let mut net = Net::new(&[]);
    for id in [3, 1, 2] {
        net.master.write_pdo(node(id), DefaultPdo::First, &[id]).unwrap();
    }
    let first = net.master.poll_transmit(ms(0)).unwrap();
    for _ in 0..3 {
        net.master.handle_refused(first);
        assert_eq!(net.master.poll_transmit(ms(0)), Some(first));
    }
    net.master.handle_refused(first);
    let mut sent = Vec::new();
    while let Some(frame) = net.master.poll_transmit(ms(0)) {
        sent.push(frame.to_string());
    }
    assert_eq!(sent, ["201#01", "202#02", "203#03"]);
    net.run(ms(1));
    assert_eq!(net.take_events(), [Event::TransmitFull], "told once");
}

#[test]
fn the_queue_is_bounded_and_says_so() {
    let mut net = Net::new(&[]);
    let frame = Frame::standard(0x300, [1]);
    for _ in 0..canopen_master::master::QUEUE {
        net.master.send(frame).unwrap();
    }
    let full = SubmitError::QueueFull(canopen_master::master::QUEUE);
    assert_eq!(net.master.send(frame), Err(full));
    assert_eq!(net.master.nmt(ms(0), Command::Stop, Target::All), Err(full));
    assert_eq!(net.master.waiting(), canopen_master::master::QUEUE);
    assert_eq!(net.master.write_pdo(node(1), DefaultPdo::Second, &[1]), Ok(false));
    assert_eq!(net.master.write_pdo(node(1), DefaultPdo::Second, &[2]), Ok(true), "replaced");
}

/// 127 losses at one moment, and an application that polls late.
#[test]
fn losses_wait_for_room() {
    let mut net = Net::new(&[]);
    for id in canopen_master::NodeId::all() {
        net.master.set_guarding(ms(0), id, Some(guarding::Config::default())).unwrap();
    }
    for step in 0..500 {
        net.master.handle_timeout(ms(step));
        while net.master.poll_transmit(ms(step)).is_some() {}
    }
    let mut lost = NodeSet::EMPTY;
    for step in 500..520 {
        while let Some(event) = net.master.poll_event() {
            let Event::Guarding { node, event: guarding::Event::Lost } = event else { panic!("{event:?}") };
            assert!(!lost.contains(node), "told twice");
            lost.insert(node);
        }
        net.master.handle_timeout(ms(step));
    }
    assert_eq!(lost, NodeSet::ALL);
}
