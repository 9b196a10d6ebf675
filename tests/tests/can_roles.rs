//! What a bus is (manual A 6.5.1, `[300]`…`[303]`), changed at run time as a person changes it: parameters
//! over LB2, loader, flash, off and on again. And what the loader refuses.

use core::time::Duration;

use can_link::{Channel, Link, Setting};
use conformance::controllers::{Rig, Station};
use lb2::code::LoaderCode;
use motion_core::application::Plc;
use motion_core::bus::Role;
use motion_core::parameters::Values;
use pdo::{Frame, Payload};

const SWITCH_ON: LoaderCode = LoaderCode(0x01);
/// Objects IN 1 and OUT 1 at address 5, digital.
const OBJECTS: [(u16, i32); 4] = [(310, 5), (314, 5), (326, 1), (330, 1)];
const INACTIVE: [(u16, i32); 2] = [(326, 0), (330, 0)];

/// An application that serves whatever the bus is: I1 goes out with object OUT 1 or on a channel of CAN
/// Link, and object IN 1 or another channel comes on Q1. Only what has changed is sent.
fn program(sends: u8, receives: u8) -> impl FnMut(&mut Plc<'_>) {
    let channels = [sends, receives].map(|number| Channel::new(number).unwrap());
    let (mut sent, mut linked, mut now) = (0, false, Duration::ZERO);
    move |plc| {
        let [i1, ..] = plc.inputs.blocks();
        now += Duration::from_millis(plc.cycle.into());
        let q1 = match plc.can[0].link() {
            Some(link) => {
                if !core::mem::replace(&mut linked, true) {
                    link.set(channels[0], Setting::TRANSMIT).unwrap();
                    link.set(channels[1], Setting::RECEIVE).unwrap();
                }
                link.write_value(channels[0], &i1).unwrap();
                read(link, now, channels[1])
            }
            None => {
                let image = plc.can[0].image();
                if core::mem::replace(&mut sent, i1) != i1 {
                    image.write(1, Payload::from_slice(&[i1]));
                }
                image.input(1).map_or(0, |data| data.bytes()[0])
            }
        };
        plc.outputs.write([q1, 0, 0]);
    }
}

fn read(link: &mut Link, now: Duration, channel: Channel) -> u8 {
    link.read_value(now, channel).map_or(0, |(value, _)| value)
}

/// The controller whose role changes, and the one that it talks to.
fn rig() -> Rig {
    // The first one begins later: a master scans what is there (4.3.4.4).
    let one = Station::new(Duration::from_millis(5), program(3, 4));
    let other = Station::new(Duration::ZERO, program(4, 3));
    Rig::new(vec![one, other])
}

/// Gives both controllers their parameters and switches them off and on again. The later a controller is
/// switched on, the more of the others it finds.
fn change(rig: &mut Rig, [one, other]: [&[(u16, i32)]; 2], last: usize) {
    rig.stations[0].set_up(one);
    rig.stations[1].set_up(other);
    let restart = |rig: &mut Rig, number: usize| {
        let (sends, receives) = if number == 0 { (3, 4) } else { (4, 3) };
        rig.stations[number].restart(program(sends, receives));
        rig.stations.iter_mut().for_each(|station| station.set_inputs([0, 0]));
    };
    restart(rig, 1 - last);
    rig.run(Duration::from_millis(20));
    restart(rig, last);
}

/// Data go both ways; gives what each station sent meanwhile.
fn talk(rig: &mut Rig) -> Vec<Vec<Frame>> {
    rig.run(Duration::from_secs(3));
    for (first, second) in [(0x15, 0x0A), (0x0A, 0x15), (1, 0x1F)] {
        rig.stations[0].set_inputs([first, 0]);
        rig.stations[1].set_inputs([second, 0]);
        rig.run(Duration::from_millis(30));
        assert_eq!([0, 1].map(|at| rig.stations[at].outputs()[0]), [second, first]);
    }
    rig.stations[0].set_inputs([7, 0]);
    rig.stations[1].set_inputs([9, 0]);
    rig.run(Duration::from_secs(1))
}

fn role(rig: &mut Rig, station: usize) -> Role {
    rig.stations[station].controller().bus(0).unwrap().role()
}

fn identifiers(frames: &[Frame]) -> Vec<u16> {
    let mut ids: Vec<u16> = frames.iter().filter_map(Frame::standard_id).collect();
    ids.sort_unstable();
    ids.dedup();
    ids
}

fn with(more: &[(u16, i32)]) -> Vec<(u16, i32)> {
    [&OBJECTS, more].concat()
}

/// None, master, slave, CAN Link, none again, on one device.
#[test]
fn a_controller_takes_every_role_one_after_the_other() {
    let mut rig = rig();
    let silent = |rig: &mut Rig| rig.run(Duration::from_secs(1)).iter().all(Vec::is_empty);
    assert!(silent(&mut rig), "as delivered, nothing refers to the buses");

    // Written and loaded, but not switched off: still what it was.
    for (index, value) in with(&[(300, 1)]) {
        let (code, text) = rig.stations[0].write(index, value);
        if index == 300 {
            assert_eq!((code, text.as_str()), (SWITCH_ON, "Effective after switching on again"));
        }
    }
    assert_eq!(rig.stations[0].load(), None);
    assert_eq!((role(&mut rig, 0), silent(&mut rig)), (Role::Master, true));
    // Not saved: what it was after switching on, too.
    rig.stations[0].restart(program(3, 4));
    assert_eq!((role(&mut rig, 0), rig.stations[0].read(300)), (Role::Master, 0));

    change(&mut rig, [&with(&[(300, 0)]), &with(&[(300, 1)])], 0);
    assert_eq!([0, 1].map(|at| role(&mut rig, at)), [Role::Master, Role::Slave]);
    let sent = talk(&mut rig);
    // SYNC, RPDO 1 and guard requests; TPDO 1 and guard replies.
    assert_eq!([0, 1].map(|at| identifiers(&sent[at])), [vec![0x080, 0x205, 0x705], vec![0x185, 0x705]]);

    change(&mut rig, [&with(&[(300, 1)]), &with(&[(300, 0)])], 1);
    assert_eq!([0, 1].map(|at| role(&mut rig, at)), [Role::Slave, Role::Master]);
    let sent = talk(&mut rig);
    assert_eq!([0, 1].map(|at| identifiers(&sent[at])), [vec![0x185, 0x705], vec![0x080, 0x205, 0x705]]);

    let (code, _) = rig.stations[0].write(302, 1);
    assert_eq!((code, rig.stations[0].load(), role(&mut rig, 0)), (SWITCH_ON, None, Role::Slave));
    change(&mut rig, [&[(302, 1)], &[(302, 1)]], 1);
    assert_eq!([0, 1].map(|at| role(&mut rig, at)), [Role::Link; 2]);
    let sent = talk(&mut rig);
    assert_eq!([0, 1].map(|at| identifiers(&sent[at])), [vec![0x103], vec![0x104]], "no SYNC, no guarding");

    let none = [&INACTIVE[..], &[(300, 0), (302, 0)]].concat();
    change(&mut rig, [&none, &none], 1);
    assert_eq!([0, 1].map(|at| role(&mut rig, at)), [Role::Master; 2]);
    assert!(silent(&mut rig), "a master without objects");
}

/// What the loader refuses: the value, or all of them when it is called. The device says why, and nothing
/// of it is effective, now or after switching on again.
#[track_caller]
fn refused(parameters: &[(u16, i32)], at: u16, sentence: &str, expected: &str) {
    let mut station = Station::new(Duration::ZERO, |_: &mut Plc<'_>| ());
    for &(index, value) in parameters {
        let (code, text) = station.write(index, value);
        assert!(!code.is_error(), "[{index}] = {value}: {text}");
    }
    let mut words = String::new();
    station.controller().load(|finding| {
        words.push_str(&finding.explain(&Values::factory()).to_string());
        assert_eq!((finding.index, finding.rule.message), (at, sentence));
        assert!(finding.rule.code.is_error());
    });
    assert!(words.contains(expected), "{words}");
    assert_eq!(station.load(), Some(at));
    assert_eq!(station.controller().working(), &Values::factory());
    station.save();
    station.restart(|_: &mut Plc<'_>| ());
    assert_eq!(station.controller().edited(), &Values::factory());
}

/// [`refused`], but with the value itself.
#[track_caller]
fn not_taken(index: u16, value: i32, code: u8, sentence: &str) {
    let mut station = Station::new(Duration::ZERO, |_: &mut Plc<'_>| ());
    assert_eq!(station.write(index, value), (LoaderCode(code), sentence.into()));
    assert_eq!(station.load(), None);
    assert_eq!(station.controller().working(), &Values::factory());
}

#[test]
fn can_link_with_axis_objects_is_refused() {
    let words = "expected: No, or no object of type Axis on this bus";
    refused(&[(302, 1), (327, 3)], 302, "CAN Link on a bus with axis objects", words);
    refused(&[(303, 1)], 303, "CAN Link on a bus with axis objects", words);
}

#[test]
fn two_objects_with_one_identifier_are_refused() {
    let words = "expected: an address that gives the object an identifier of its own";
    let sentence = "Two objects have the same identifier";
    refused(&[(326, 1), (327, 1), (310, 5), (311, 5)], 311, sentence, words);
    // A bypassed IN hears what an OUT of the same address sends.
    let bypassed = [(330, 1), (314, 5), (329, 1), (313, 5), (337, 1), (333, 1), (317, 5), (341, 1)];
    refused(&bypassed, 314, sentence, words);
}

/// 6.5.1.1: "The value 0 sets the parameter its the default value."
#[test]
fn address_0_is_refused_and_the_default_set() {
    let sentence = "0 is no address (1...127): default set";
    for index in [310, 317, 342, 349] {
        not_taken(index, 0, 0x8F, sentence);
    }
    let mut station = Station::new(Duration::ZERO, |_: &mut Plc<'_>| ());
    station.set_up(&[(312, 9)]);
    assert_eq!(station.write(312, 0), (LoaderCode(0x8F), sentence.into()));
    assert_eq!(station.read(312), 3);
}

#[test]
fn an_axis_above_address_16_is_refused() {
    let words = "expected: 1 to 16 for an object of type Axis";
    refused(&[(326, 3), (310, 17)], 310, "Node address of an axis is above 16", words);
    refused(&[(342, 127)], 342, "Node address of an axis is above 16", words);
}

#[test]
fn an_axis_on_objects_3_and_4_of_can_1_is_refused() {
    for index in [328, 329, 332, 333] {
        not_taken(index, 3, 0x82, "Choice not available here");
    }
}
