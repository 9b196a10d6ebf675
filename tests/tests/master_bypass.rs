//! Manual A 6.5.1.1, "Master bypass": its example of a master and two slaves that also exchange digital
//! data past the master, with whole controllers on a virtual bus.

use core::time::Duration;
use std::collections::BTreeMap;

use conformance::controllers::{Rig, Station};
use motion_core::application::Plc;
use oorandom::Rand32;
use pdo::{Frame, NodeId, Payload};

const SEED: u64 = 0x0B;

/// "Master device".
const MASTER: [(u16, i32); 15] = [
    (300, 0),
    (310, 5),
    (326, 1),
    (334, 0),
    (314, 5),
    (330, 1),
    (338, 0),
    (311, 7),
    (327, 1),
    (335, 0),
    (315, 7),
    (331, 1),
    (339, 0),
    (332, 0),
    (333, 0),
];
/// "First slave device".
const FIRST: [(u16, i32); 15] = [
    (300, 1),
    (310, 5),
    (326, 1),
    (334, 0),
    (314, 5),
    (330, 1),
    (338, 0),
    (313, 10),
    (329, 1),
    (337, 1),
    (317, 10),
    (333, 1),
    (341, 1),
    (331, 0),
    (332, 0),
];
/// "Second slave device".
const SECOND: [(u16, i32); 15] = [
    (300, 1),
    (310, 7),
    (326, 1),
    (334, 0),
    (314, 7),
    (330, 1),
    (338, 0),
    (313, 10),
    (329, 1),
    (337, 0),
    (317, 10),
    (333, 1),
    (341, 0),
    (331, 0),
    (332, 0),
];

/// Sends I1 and I2 with two objects OUT when they change, and puts two objects IN on Q1 and Q2.
fn exchange(objects: [usize; 2]) -> impl FnMut(&mut Plc<'_>) {
    let mut sent = [0; 2];
    move |plc| {
        let [i1, i2, ..] = plc.inputs.blocks();
        let image = plc.can[0].image();
        for ((object, bits), sent) in objects.into_iter().zip([i1, i2]).zip(&mut sent) {
            if core::mem::replace(sent, bits) != bits {
                assert!(image.write(object, Payload::from_slice(&[bits])));
            }
        }
        let bits = |object| image.input(object).map_or(0, |data| data.bytes()[0]);
        let [q1, q2] = objects.map(bits);
        plc.outputs.write([q1, q2, 0]);
    }
}

/// The master and both slaves, switched on before it: it scans them once (4.3.4.4).
fn rig() -> Rig {
    let devices = [(&MASTER, [1, 2], 5000), (&FIRST, [1, 4], 0), (&SECOND, [1, 4], 700)];
    let mut stations = Vec::new();
    for (parameters, objects, phase) in devices {
        let mut station = Station::new(Duration::from_micros(phase), exchange(objects));
        station.set_up(parameters);
        station.restart(exchange(objects));
        stations.push(station);
    }
    Rig::new(stations)
}

/// Identifiers and kinds of what a station sent, with their number.
fn list(frames: &[Frame]) -> BTreeMap<(u16, bool), usize> {
    let mut list = BTreeMap::new();
    for frame in frames {
        *list.entry((frame.standard_id().expect("11 bits"), frame.is_remote())).or_default() += 1;
    }
    list
}

fn identifiers(frames: &[Frame]) -> Vec<(u16, bool)> {
    list(frames).into_keys().collect()
}

const DATA: bool = false;
const REMOTE: bool = true;

#[test]
fn the_manuals_example() {
    let mut rig = rig();
    // The master scans, boots and starts both slaves.
    let start = rig.run(Duration::from_secs(3));
    let ready = rig.stations[0].controller().bus(0).unwrap().ready();
    assert_eq!(ready.iter().map(NodeId::raw).collect::<Vec<_>>(), [5, 7]);

    // Both ways on all three lines, in 200 patterns.
    let mut random = Rand32::new(SEED);
    let mut frames: [Vec<Frame>; 3] = Default::default();
    let mut changes = [[0; 2]; 3];
    let mut last = [[0; 2]; 3];
    for round in 0..200 {
        let bits = [(); 3].map(|()| [(); 2].map(|()| random.rand_range(0..32) as u8));
        for ((station, bits), (changes, last)) in
            rig.stations.iter_mut().zip(bits).zip(changes.iter_mut().zip(&mut last))
        {
            station.set_inputs(bits);
            for ((changes, last), bits) in changes.iter_mut().zip(last).zip(bits) {
                *changes += usize::from(core::mem::replace(last, bits) != bits);
            }
        }
        for (all, new) in frames.iter_mut().zip(rig.run(Duration::from_millis(30))) {
            all.extend(new);
        }
        let [master, first, second] = bits;
        let seen: Vec<[u8; 2]> = rig.stations.iter().map(Station::outputs).collect();
        assert_eq!(seen[0], [first[0], second[0]], "slaves to master, round {round}, seed {SEED:X}h");
        assert_eq!(seen[1], [master[0], second[1]], "to slave 1, round {round}, seed {SEED:X}h");
        assert_eq!(seen[2], [master[1], first[1]], "to slave 2, round {round}, seed {SEED:X}h");
    }

    // The frame list: SYNC, guard requests and PDOs of the master, replies and PDOs of the slaves.
    for (name, frames) in ["master", "slave 1", "slave 2"].into_iter().zip(&frames) {
        for ((id, remote), count) in list(frames) {
            println!("{name}: {id:03X}{} {count} times", if remote { " remote" } else { "" });
        }
    }
    let [master, first, second] = &frames;
    assert_eq!(
        identifiers(master),
        [(0x080, DATA), (0x205, DATA), (0x207, DATA), (0x705, REMOTE), (0x707, REMOTE)]
    );
    assert_eq!(identifiers(first), [(0x185, DATA), (0x20A, DATA), (0x705, DATA)]);
    assert_eq!(identifiers(second), [(0x187, DATA), (0x18A, DATA), (0x707, DATA)]);
    // Nothing but the slaves' own PDOs belongs to address 10, one frame for each change: they wait for no
    // SYNC, and SYNC, guarding and the start-up say nothing of it.
    for (station, ids) in [(0, [0x205, 0x207]), (1, [0x185, 0x20A]), (2, [0x187, 0x18A])] {
        let list = list(&frames[station]);
        assert_eq!(ids.map(|id| list[&(id, DATA)]), changes[station], "station {station}");
    }
    let syncs = list(master)[&(0x080, DATA)];
    assert!((599..=601).contains(&syncs), "{syncs} in 6 s");
    for frames in start.iter().chain(&frames) {
        let commands = frames.iter().filter(|frame| frame.standard_id() == Some(0));
        assert!(commands.clone().all(|frame| matches!(frame.data(), [_, 5 | 7])), "{commands:?}");
    }
    let started = start.iter().flat_map(|frames| identifiers(frames)).map(|(id, _)| id & 0x7F);
    assert!(started.clone().all(|node| matches!(node, 0 | 5 | 7)), "{:?}", started.collect::<Vec<_>>());
}

/// Not bound to the master as a mediator: what the slaves tell each other goes on without it.
#[test]
fn the_slaves_go_on_without_the_master() {
    let mut rig = rig();
    rig.run(Duration::from_secs(3));
    rig.unplug(0);
    rig.run(Duration::from_secs(1));
    rig.stations[1].set_inputs([0, 0x15]);
    rig.stations[2].set_inputs([0, 0x0A]);
    let sent = rig.run(Duration::from_millis(30));
    assert_eq!((rig.stations[1].outputs()[1], rig.stations[2].outputs()[1]), (0x0A, 0x15));
    assert_eq!(identifiers(&sent[1]), [(0x20A, DATA)]);
    assert_eq!(identifiers(&sent[2]), [(0x18A, DATA)]);
}

/// A master's own bypassed objects are a slave's: neither scanned nor guarded nor started.
#[test]
fn a_bypassed_address_of_the_master_is_left_alone() {
    let mut master = Station::new(Duration::from_millis(5), exchange([1, 4]));
    master.set_up(&[&MASTER[..6], &[(313, 10), (329, 1), (337, 1), (317, 10), (333, 1), (341, 1)]].concat());
    master.restart(exchange([1, 4]));
    let mut slave = Station::new(Duration::ZERO, exchange([1, 4]));
    slave.set_up(&FIRST);
    slave.restart(exchange([1, 4]));
    let mut rig = Rig::new(vec![master, slave]);
    rig.stations[0].set_inputs([1, 2]);
    let sent = rig.run(Duration::from_secs(3));
    let mut ids = identifiers(&sent[0]);
    ids.retain(|&(id, _)| id & 0x7F == 10);
    assert_eq!(ids, [(0x18A, DATA)], "as a slave of address 10 sends");
    assert!(sent[0].iter().all(|frame| frame.standard_id() != Some(0) || matches!(frame.data(), [_, 5])));
}
