//! Guarding and heartbeat.

use canopen_master::guarding::{self, Config};
use canopen_master::heartbeat;
use canopen_master::master::Event;
use canopen_master::nmt::State;
use canopen_master::{Frame, NodeSet};

use super::net::{Net, ms, node};

const LOST: guarding::Event = guarding::Event::Lost;
const BACK: guarding::Event = guarding::Event::Back;

fn guarding_events(net: &mut Net) -> Vec<(u64, guarding::Event)> {
    let events = core::mem::take(&mut net.events);
    events
        .into_iter()
        .filter_map(|(at, event)| match event {
            Event::Guarding { event, .. } => Some((at.as_millis() as u64, event)),
            _ => None,
        })
        .collect()
}

#[test]
fn guarding_tells_a_loss_once_and_the_return_once() {
    let mut net = Net::new(&[1]);
    net.master.set_guarding(net.now, node(1), Some(Config::default())).unwrap();
    net.run(ms(1000));
    assert_eq!(guarding_events(&mut net), []);
    net.silent[0] = true;
    net.run(ms(2000));
    assert_eq!(net.master.lost(), NodeSet::of(node(1)));
    net.silent[0] = false;
    net.run(ms(3000));
    // The last answer was at 1000, the life time is 300 ms; the request at 2000 was not heard.
    assert_eq!(guarding_events(&mut net), [(1300, LOST), (2100, BACK)]);
    let requests = net.log.iter().filter(|(_, frame)| frame.to_string() == "701#R1").count();
    assert_eq!(requests, 31, "one each 100 ms, whether lost or not");
}

#[test]
fn a_node_that_never_was_is_lost_once() {
    let mut net = Net::new(&[]);
    for id in 1..=16 {
        net.master.set_guarding(net.now, node(id), Some(Config::default())).unwrap();
    }
    net.run(ms(5000));
    assert_eq!(guarding_events(&mut net), [(300, LOST); 16]);
}

#[test]
fn boot_up_in_between_is_no_toggle_error() {
    let mut net = Net::new(&[1]);
    net.master.set_guarding(net.now, node(1), Some(Config::default())).unwrap();
    for odd in 0..2 {
        net.run(net.now + ms(250 + 100 * odd));
        let now = net.now;
        net.slaves[0].boot(now);
    }
    net.run(net.now + ms(500));
    assert_eq!(guarding_events(&mut net), []);
}

/// Heartbeats and guarding replies come on the same identifier: neither stands in for the other.
#[test]
fn guarding_and_heartbeat_do_not_shadow_each_other() {
    for heartbeats in [true, false] {
        let mut net = Net::new(&[]);
        net.master.set_guarding(ms(0), node(1), Some(Config::default())).unwrap();
        net.master.set_heartbeat(ms(0), node(1), Some(300), true).unwrap();
        let mut toggle = 0;
        // Both until 1000 ms, then one of them.
        for step in 0..300 {
            let now = ms(10 * step);
            net.run(now);
            let both = step < 100;
            if step % 10 == 3 && (both || heartbeats) {
                net.master.handle_frame(now, &Frame::standard(0x701, [0x05]));
            }
            if step % 10 == 1 && (both || !heartbeats) {
                net.master.handle_frame(now, &Frame::standard(0x701, [0x05 | toggle]));
                toggle ^= 0x80;
            }
        }
        let events: Vec<_> =
            net.take_events().into_iter().filter(|event| !matches!(event, Event::State { .. })).collect();
        let lost = match heartbeats {
            true => Event::Guarding { node: node(1), event: LOST },
            false => Event::Heartbeat { node: node(1), event: heartbeat::Event::Lost },
        };
        let told = events.iter().filter(|event| **event == lost).count();
        assert_eq!(told, 1, "{events:?}");
        // Once the replies are gone, one heartbeat may pass for the reply that is due, no more.
        let others = events.iter().filter(|event| **event != lost).count();
        assert!(others <= usize::from(heartbeats), "{events:?}");
    }
}

#[test]
fn heartbeat_tells_a_loss_once_and_the_return_once() {
    let mut net = Net::new(&[1, 2]);
    for slave in &mut net.slaves {
        slave.objects_mut().set(0x1017, 0, &100_u16.to_le_bytes());
        slave.boot(ms(0));
    }
    net.master.set_heartbeat(ms(0), node(1), Some(250), false).unwrap();
    net.master.set_heartbeat(ms(0), node(2), Some(250), false).unwrap();
    net.run(ms(1000));
    net.silent[1] = true;
    net.run(ms(3000));
    net.silent[1] = false;
    net.run(ms(4000));
    let events: Vec<_> = net
        .events
        .iter()
        .filter_map(|(at, event)| match event {
            Event::Heartbeat { node, event } => Some((at.as_millis(), node.raw(), *event)),
            _ => None,
        })
        .collect();
    assert_eq!(events, [(1250, 2, heartbeat::Event::Lost), (3100, 2, heartbeat::Event::Back)]);
}

#[test]
fn a_slave_misses_its_master() {
    let mut net = Net::new(&[1]);
    net.slaves[0].objects_mut().set(0x100C, 0, &100_u16.to_le_bytes());
    net.slaves[0].objects_mut().set(0x100D, 0, &[3]);
    net.slaves[0].boot(ms(0));
    net.master.set_guarding(ms(0), node(1), Some(Config::default())).unwrap();
    net.master.nmt(ms(0), canopen_master::nmt::Command::Start, canopen_master::nmt::Target::All).unwrap();
    let target = canopen_master::nmt::Target::Node(node(1));
    net.run(ms(10));
    net.master.nmt(net.now, canopen_master::nmt::Command::Start, target).unwrap();
    net.run(ms(1000));
    assert_eq!(net.slaves[0].state(), State::Operational);
    net.master.set_guarding(net.now, node(1), None).unwrap();
    net.run(ms(2000));
    assert_eq!(net.slaves[0].state(), State::PreOperational, "1029h: its default");
    assert_eq!(net.slaves[0].error_register(), 0x11);
    let codes: Vec<_> = net.master.history().iter().map(|entry| entry.emergency.code.0).collect();
    assert_eq!(codes, [0x8130]);
    net.master.set_guarding(net.now, node(1), Some(Config::default())).unwrap();
    net.run(ms(2100));
    let codes: Vec<_> = net.master.history().iter().map(|entry| entry.emergency.code.0).collect();
    assert_eq!(codes, [0x0000, 0x8130], "the master is back");
}
