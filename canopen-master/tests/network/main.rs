//! The whole master against whole slaves, as scripts on virtual time.

mod boot;
mod bus;
mod length;
mod net;
mod slave;
mod watch;

use canopen_master::lss::{self, Operation, Outcome};
use canopen_master::master::{Event, SubmitError};
use canopen_master::nmt::{Command, State, Target};
use canopen_master::scan::{BusState, HEADING, Options};
use canopen_master::sdo;
use canopen_master::slave::{Config as SlaveConfig, Slave};
use canopen_master::{Address, NodeId, NodeSet};

use net::{Net, drive, identity, ms, node};

#[test]
fn nmt_commands_are_confirmed_by_what_nodes_show() {
    let mut net = Net::new(&[1, 2, 3]);
    let config = Some(canopen_master::guarding::Config::default());
    for id in [1, 2, 3] {
        net.master.set_guarding(net.now, node(id), config).unwrap();
    }
    net.run(ms(50));
    net.take_events();
    net.silent[2] = true;
    let ticket = net.master.nmt(net.now, Command::Start, Target::All).unwrap();
    let (confirmed, missing) = net.expect(ms(1000), |event| match event {
        Event::Nmt { ticket: ended, confirmed, missing, .. } if *ended == ticket => {
            Some((*confirmed, *missing))
        }
        _ => None,
    });
    assert_eq!((confirmed.to_string(), missing.to_string()), ("1, 2".into(), "3".into()));
    assert_eq!(net.master.state(node(1)), Some(State::Operational));
    net.take_events();

    // A reset is confirmed by the boot-up message.
    let reset = net.master.nmt(net.now, Command::ResetNode, Target::Node(node(1))).unwrap();
    net.run(net.now + ms(10));
    let events = net.take_events();
    assert!(events.contains(&Event::BootUp(node(1))), "{events:?}");
    let one = NodeSet::of(node(1));
    assert!(events.iter().any(|event| matches!(event, Event::Nmt { ticket, confirmed, .. }
        if *ticket == reset && *confirmed == one)));
}

#[test]
fn a_node_without_error_control_is_asked() {
    let mut net = Net::new(&[5]);
    net.master.nmt(net.now, Command::Start, Target::Node(node(5))).unwrap();
    net.run(ms(1000));
    let one = NodeSet::of(node(5));
    let events = net.take_events();
    assert!(
        events.iter().any(|event| matches!(event, Event::Nmt { confirmed, missing, .. }
            if *confirmed == one && missing.is_empty())),
        "{events:?}"
    );
    let asked = net.log.iter().filter(|(_, frame)| frame.is_remote()).count();
    assert_eq!(asked, 1);
}

#[test]
fn a_newer_command_takes_the_older_ones_place() {
    let mut net = Net::new(&[1]);
    net.silent[0] = true;
    let target = Target::Node(node(1));
    let first = net.master.nmt(net.now, Command::Start, target).unwrap();
    let second = net.master.nmt(net.now, Command::Stop, target).unwrap();
    net.run(ms(2000));
    let ended: Vec<_> = net
        .events
        .iter()
        .filter_map(|(at, event)| match event {
            Event::Nmt { ticket, confirmed, .. } => Some((*at, *ticket, confirmed.is_empty())),
            _ => None,
        })
        .collect();
    assert_eq!(ended, [(ms(0), first, true), (ms(500), second, true)]);
    for _ in 0..canopen_master::master::NMT_COMMANDS {
        net.master.nmt(net.now, Command::Start, target).unwrap();
    }
    let refused = net.master.nmt(net.now, Command::Start, target);
    assert_eq!(refused, Err(SubmitError::Unconfirmed(canopen_master::master::NMT_COMMANDS)));
}

#[test]
fn transfers_with_all_nodes_in_parallel() {
    let nodes: Vec<u8> = (1..=127).collect();
    let mut net = Net::new(&nodes);
    let at = Address::new(0x1008, 0);
    for id in NodeId::all() {
        net.master.upload(id, at, Vec::new(), &sdo::Options::default()).unwrap();
        let again = net.master.upload(id, at, Vec::new(), &sdo::Options::default()).unwrap_err();
        assert_eq!(again.error, SubmitError::Busy(id));
    }
    net.run(ms(10));
    let mut done = NodeSet::EMPTY;
    for event in net.take_events() {
        let Event::Sdo { node, finished } = event else { panic!("{event:?}") };
        assert_eq!((finished.outcome, finished.buffer.as_slice()), (sdo::Outcome::Done(4), &b"SD03"[..]));
        done.insert(node);
    }
    assert_eq!(done, NodeSet::ALL);
    net.master.download(node(7), Address::new(0x2600, 0), vec![22], &sdo::Options::default()).unwrap();
    net.run(ms(20));
    assert_eq!(net.slaves[6].objects().objects[&Address::new(0x2600, 0)], [22]);
}

#[test]
fn a_scan_finds_who_is_there_in_one_time_out() {
    let mut net = Net::new(&[1, 5, 64, 127]);
    net.slaves[1].objects_mut().objects.remove(&Address::new(0x1008, 0));
    net.master.scan(NodeSet::ALL, Options { identity: true, ..Options::default() }).unwrap();
    assert_eq!(net.master.scan(NodeSet::ALL, Options::default()), Err(SubmitError::Scanning));
    let (found, silent) = net.expect(ms(200), |event| match event {
        Event::Scanned { found, silent } => Some((*found, *silent)),
        _ => None,
    });
    assert_eq!((found.to_string().as_str(), silent.len()), ("1, 5, 64, 127", 123));
    // Requests and answers at the pace of the bus, and one time-out; nobody waits for the aborts.
    let frames = net.log.iter().filter(|(_, frame)| frame.data().first() != Some(&0x80)).count() as u64;
    assert!(net.now <= ms(frames * 270 / 1000 + 50 + 2), "{frames} frames, {:?}", net.now);
    let info = *net.master.info(node(1)).unwrap();
    assert_eq!((info.profile(), info.name.text(), info.opmode), (Some(0x0192), "SD03", Some(0)));
    assert_eq!(info.identity, Some(identity(1)));
    assert_eq!(net.master.info(node(5)).unwrap().name.text(), "");
    assert!(net.master.info(node(2)).is_none());
    assert_eq!(net.master.bus_state(found), BusState::Ok);
    assert_eq!(net.master.bus_state(NodeSet::up_to(node(2))), BusState::Warn);
    let table = [1, 2].map(|id| net.master.row(node(id), Some(id), Some(id)).to_string());
    assert_eq!(HEADING, "node  In  Out  Profile  Name  OP   dI    dO");
    assert_eq!(table[0], "Nd01  1   1    0192h    SD03  00h  dI:F  dO:F");
    assert_eq!(table[1], "Nd02  2   2    -                   dI:F  dO:F");
    // Nobody was asked anything before the answer to the last request.
    let mut asked = NodeSet::EMPTY;
    for (_, frame) in &net.log {
        let id = frame.standard_id().unwrap();
        let node = node((id & 0x7F) as u8);
        match id & 0x780 {
            0x600 if frame.data()[0] != 0x80 => {
                assert!(!asked.contains(node), "{frame}");
                asked.insert(node);
            }
            _ => {
                asked.remove(node);
            }
        }
    }
}

#[test]
fn devices_get_their_address_by_lss() {
    let mut net = Net::new(&[]);
    let new = |serial| {
        let mut slave = Slave::new(&SlaveConfig::new(identity(serial), None), drive(identity(serial)));
        assert!(!slave.boot(ms(0)), "it has no address");
        slave
    };
    net.slaves = vec![new(0x1234_5678), new(0x8000_0001)];
    net.silent = vec![false; 2];
    for id in [3, 4] {
        let mut run = |operation| {
            let ticket = net.master.lss(operation).unwrap();
            net.expect(ms(5000), |event| match event {
                Event::Lss { ticket: ended, outcome } => {
                    Some((*ended == ticket).then_some(*outcome).unwrap())
                }
                _ => None,
            })
        };
        assert!(matches!(run(Operation::Fastscan), Outcome::Identity(_)));
        assert_eq!(run(Operation::ConfigureNodeId(Some(node(id)))), Outcome::Done);
        assert_eq!(run(Operation::SwitchGlobal(lss::Mode::Waiting)), Outcome::Done);
    }
    net.run(net.now + ms(1));
    let events = net.take_events();
    assert_eq!(events, [Event::BootUp(node(3)), Event::BootUp(node(4))]);
}

#[test]
fn misuse_is_refused_by_name() {
    let mut master = canopen_master::master::Master::<'static, Vec<u8>, 16>::default();
    let beyond = node(17);
    let error = master.nmt(ms(0), Command::Start, Target::Node(beyond)).unwrap_err();
    assert_eq!(error.to_string(), "node 17, this master has nodes 1 to 16");
    assert!(master.scan(NodeSet::ALL, Options::default()).is_err());
    let long = master.write_pdo(node(1), pdo::cob::DefaultPdo::First, &[0; 9]);
    assert_eq!(long, Err(SubmitError::Length(9)));
    let foreign = canopen_master::Frame::standard(0x711, [5]);
    assert_eq!(master.handle_frame(ms(0), &foreign), canopen_master::Handled::Ignored);
}
