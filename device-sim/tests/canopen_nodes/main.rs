//! Virtual nodes on the virtual bus, asked by an SDO client and by plain frames.

mod bench;
mod drive;
mod pdos;

use core::time::Duration;

use canopen_master::eds::{self, ObjectType};
use canopen_master::sdo::{AbortCode, Options, Outcome};
use device_sim::can::{self, Faults};
use device_sim::canopen::{FileNode, Ld2000, RemoteIo, device_file};
use pdo::Frame;

use bench::{Bench, DEVICE_INFO, MS, START, SYNC, guard, id};

#[test]
fn boot_nmt_and_error_control() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    assert_eq!(bench.heard(), ["705#00"]);
    bench.send(guard(5));
    bench.send(guard(5));
    assert_eq!(bench.heard(), ["705#7F", "705#FF"]);
    bench.put(0x1017, 0, &100u16.to_le_bytes());
    bench.heard();
    bench.run(250 * MS);
    assert_eq!(bench.heard(), ["705#7F", "705#7F"]);
    // Stopped: no SDO.
    bench.send(Frame::standard(0x000, [2, 5]));
    let silent = bench.read(0x1000, 0, &Options::new(20 * MS));
    assert_eq!(silent, Err(Outcome::TimedOut));
    bench.heard();
    // Reset communication: the heartbeat time is gone.
    bench.send(Frame::standard(0x000, [0x82, 5]));
    bench.run(300 * MS);
    assert_eq!(bench.heard(), ["705#00"]);
    assert_eq!(bench.get(0x1017, 0), [0, 0]);
}

#[test]
fn the_store_takes_every_length_in_every_mode() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    for options in [Options::default(), Options::block(500 * MS)] {
        for len in [1, 4, 5, 7, 8, 14, 127 * 7, 127 * 7 + 1, 10_000, 65_536] {
            let data: Vec<u8> = (0..len).map(|i: usize| (i * 7 + len) as u8).collect();
            bench.write(0x2000, 1, &data, &options).unwrap();
            assert!(bench.read(0x2000, 1, &options).unwrap() == data, "{len} bytes");
        }
        let long = bench.write(0x2000, 1, &[0; 65_537], &options);
        assert_eq!(long, Err(Outcome::Aborted(AbortCode::TOO_LONG)));
    }
    assert!(bench.get(0x100A, 0).len() > 4);
}

#[test]
fn parameters_are_stored_and_restored() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    bench.put(0x6202, 1, &[0x0F]);
    let refused = bench.write(0x1010, 1, b"none", &Options::default());
    assert_eq!(refused, Err(Outcome::Aborted(AbortCode::CANNOT_STORE)));
    bench.put(0x1010, 1, b"save");
    bench.put(0x6202, 1, &[0xFF]);
    bench.send(Frame::standard(0x000, [0x81, 5]));
    assert_eq!(bench.get(0x6202, 1), [0x0F]);
    bench.put(0x1011, 1, b"load");
    assert_eq!(bench.get(0x6202, 1), [0x0F]);
    bench.send(Frame::standard(0x000, [0x81, 5]));
    assert_eq!(bench.get(0x6202, 1), [0]);
}

/// Fastscan and node ID by hand: CiA 305.
#[test]
fn a_node_without_address_gets_one() {
    let mut bench = Bench::new(RemoteIo::node(None, 0x1234, false), Faults::NONE);
    assert_eq!(bench.heard(), [""; 0]);
    bench.send(Frame::standard(0x7E5, [0x51, 0, 0, 0, 0, 0x80, 0, 0]));
    assert_eq!(bench.heard(), ["7E4#4F00000000000000"]);
    bench.send(Frame::standard(0x7E5, [0x04, 1, 0, 0, 0, 0, 0, 0]));
    bench.send(Frame::standard(0x7E5, [0x11, 9, 0, 0, 0, 0, 0, 0]));
    bench.send(Frame::standard(0x7E5, [0x17, 0, 0, 0, 0, 0, 0, 0]));
    assert_eq!(bench.heard(), ["7E4#1100000000000000", "7E4#1700000000000000"]);
    bench.send(Frame::standard(0x7E5, [0x04, 0, 0, 0, 0, 0, 0, 0]));
    assert_eq!(bench.heard(), ["709#00"]);
    assert_eq!(bench.node.node(), id(9));
}

/// Its own file violates nothing, and calls the objects of the standards what they are called there.
#[test]
fn device_files_have_the_names_and_kinds_of_the_standards() {
    let io = device_file(&RemoteIo::node(id(5), 1, false), "io");
    let drive = device_file(&Ld2000::node(id(5), 1), "drive");
    for device in [&io, &drive] {
        let reading = eds::read(eds::write_eds(device).as_bytes()).unwrap();
        let findings: Vec<String> = eds::check(&reading).iter().map(ToString::to_string).collect();
        assert_eq!(findings, [""; 0]);
        for object in device.objects.iter().filter(|object| object.index < 0x2000) {
            let numbers = object.entries().iter().map(|entry| &entry.name).chain([&object.own.name]);
            assert!(
                numbers.clone().all(|name| !name.contains("h:") && !name.starts_with("10")),
                "{object:?}"
            );
        }
        for index in [0x1003, 0x1010, 0x1011, 0x1016] {
            assert_eq!(device.object(index).unwrap().own.object_type, ObjectType::ARRAY, "{index:04X}h");
        }
        assert_eq!(device.object(0x1018).unwrap().own.object_type, ObjectType::RECORD);
        assert_eq!(device.object(0x1017).unwrap().name(), "Producer heartbeat time");
        assert_eq!(device.entry(0x1018, 1).unwrap().name, "Vendor-ID");
        assert_eq!(device.entry(0x1800, 1).unwrap().name, "COB-ID used by TPDO");
    }
    for index in [0x6000, 0x6200, 0x6401, 0x6411] {
        assert_eq!(io.object(index).unwrap().own.object_type, ObjectType::ARRAY, "{index:04X}h");
    }
    assert_eq!(drive.object(0x6040).unwrap().name(), "Controlword");
}

#[test]
fn a_node_from_a_device_file() {
    let file = "
[MandatoryObjects]
SupportedObjects=1
1=0x1000
[1000]
ParameterName=Device type
ObjectType=0x7
DataType=0x0007
AccessType=ro
DefaultValue=0x12345678
PDOMapping=0
[ManufacturerObjects]
SupportedObjects=2
1=0x3000
2=0x3001
[3000]
ParameterName=Speed
ObjectType=0x7
DataType=0x0003
AccessType=rww
DefaultValue=-7
LowLimit=-100
HighLimit=100
PDOMapping=1
[3001]
ParameterName=Name
ObjectType=0x7
DataType=0x0009
AccessType=rw
DefaultValue=hello
PDOMapping=0
";
    let node = FileNode::node([DEVICE_INFO, file].concat().as_bytes(), id(42), 5).unwrap();
    let mut bench = Bench::new(node, Faults::NONE);
    assert_eq!(bench.heard(), ["72A#00"]);
    assert_eq!(bench.get(0x1000, 0), 0x1234_5678u32.to_le_bytes());
    assert_eq!(bench.get(0x1008, 0), b"Thing");
    assert_eq!(bench.get(0x1018, 1), 7u32.to_le_bytes());
    assert_eq!(bench.get(0x1018, 4), 5u32.to_le_bytes());
    assert_eq!(bench.get(0x3000, 0), (-7i16).to_le_bytes());
    let high = bench.write(0x3000, 0, &101i16.to_le_bytes(), &Options::default());
    assert_eq!(high, Err(Outcome::Aborted(AbortCode::TOO_HIGH)));
    assert_eq!(bench.get(0x3001, 0), b"hello");
    bench.put(0x3001, 0, b"a longer name");
    assert_eq!(bench.get(0x3001, 0), b"a longer name");
    bench.put(0x2000, 1, &[1; 100]);
    assert_eq!(bench.get(0x2000, 1), [1; 100]);
}

/// Of 1010h, 1018h, 2000h and the PDOs it had what the engine has, whatever the file said.
#[test]
fn a_node_from_a_device_file_has_the_entries_of_the_file() {
    let var = |index: &str, data_type: u8, access: &str, more: &str| {
        format!(
            "[{index}]\nParameterName=x\nObjectType=7\nDataType={data_type}\nAccessType={access}\n{more}\n"
        )
    };
    let record = |index: &str, count: u8| {
        let number = var(&format!("{index}sub0"), 5, "ro", &format!("DefaultValue={count}"));
        format!("[{index}]\nParameterName=x\nObjectType=9\nSubNumber={count}\n{number}")
    };
    let file = [
        DEVICE_INFO.to_owned(),
        "[MandatoryObjects]\nSupportedObjects=1\n1=0x1018\n".into(),
        "[OptionalObjects]\nSupportedObjects=3\n1=0x1010\n2=0x1400\n3=0x1404\n".into(),
        "[ManufacturerObjects]\nSupportedObjects=2\n1=0x2000\n2=0x2001\n".into(),
        record("1018", 3),
        ["1", "2", "3"].map(|sub| var(&format!("1018sub{sub}"), 7, "ro", "")).concat(),
        record("1010", 3),
        ["1", "3"].map(|sub| var(&format!("1010sub{sub}"), 7, "rw", "")).concat(),
        record("1400", 4),
        var("1400sub1", 7, "const", "DefaultValue=$NODEID+0x200"),
        var("1400sub2", 5, "rw", "DefaultValue=255"),
        var("1400sub4", 5, "rw", "DefaultValue=7"),
        record("1404", 2),
        var("1404sub1", 7, "rw", "DefaultValue=0x80000000"),
        var("2000", 6, "rw", "DefaultValue=9"),
        var("2001", 2, "rw", "LowLimit=3\nHighLimit=20"),
    ]
    .concat();
    let mut bench = Bench::new(FileNode::node(file.as_bytes(), id(42), 5).unwrap(), Faults::NONE);
    for (index, value) in [(0x1018, 3), (0x1010, 3), (0x1400, 4), (0x1404, 2), (0x2001, 3)] {
        assert_eq!(bench.get(index, 0), [value], "{index:04X}h");
    }
    assert_eq!(bench.get(0x1400, 1), 0x22A_u32.to_le_bytes());
    assert_eq!(bench.get(0x1400, 4), [7]);
    let mut refused = |index, sub, value: Option<&[u8]>, code| {
        let options = Options::default();
        let outcome = match value {
            Some(value) => bench.write(index, sub, value, &options),
            None => bench.read(index, sub, &options).map(drop),
        };
        assert_eq!(outcome, Err(Outcome::Aborted(code)), "{index:04X}h:{sub:02X}");
    };
    for (index, sub) in [(0x1018, 4), (0x1010, 2), (0x1400, 3), (0x1400, 5), (0x1404, 2), (0x2000, 1)] {
        refused(index, sub, None, AbortCode::NO_SUB_INDEX);
    }
    refused(0x1600, 0, None, AbortCode::NO_OBJECT);
    refused(0x1800, 0, None, AbortCode::NO_OBJECT);
    refused(0x1400, 0, Some(&[4]), AbortCode::READ_ONLY);
    refused(0x1400, 1, Some(&0x8000_022A_u32.to_le_bytes()), AbortCode::READ_ONLY);
    refused(0x1400, 2, Some(&[241]), AbortCode::INVALID_VALUE);
    bench.put(0x1400, 2, &[1]);
    assert_eq!(bench.get(0x1400, 2), [1]);
    bench.put(0x1404, 1, &0x8000_0123_u32.to_le_bytes());
    assert_eq!(bench.get(0x1404, 1), 0x8000_0123_u32.to_le_bytes());
    bench.put(0x2000, 0, &[1, 2]);
    bench.put(0x1010, 3, b"save");
    bench.send(Frame::standard(0x000, [0x81, 42]));
    assert_eq!(bench.get(0x2000, 0), [1, 2]);
    assert_eq!(bench.get(0x1404, 1), 0x8000_0123_u32.to_le_bytes());
    // Its own file has no more than that.
    let own = device_file(&FileNode::node(file.as_bytes(), id(42), 5).unwrap(), "own");
    let subs =
        |index| own.object(index).map(|object| object.entries().iter().map(|entry| entry.subindex).collect());
    assert_eq!(subs(0x1400), Some(vec![0, 1, 2, 4]));
    assert_eq!(subs(0x1800), None);
}

/// Single frames lost, doubled, delayed, destroyed: every transfer ends right or with a named error, and
/// afterwards the node answers as before.
#[test]
fn transfers_under_faults_are_right_or_fail() {
    for seed in 0..20 {
        let faults = Faults {
            seed,
            wire_error: 30,
            lose: 150,
            duplicate: 150,
            delay: 200,
            longest_delay: 5 * MS,
            ..Faults::NONE
        };
        let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), faults);
        let mut done = 0;
        for round in 0..20u8 {
            let options = if round % 2 == 0 { Options::new(50 * MS) } else { Options::block(50 * MS) };
            let data: Vec<u8> = (0..200).map(|i: u8| i.wrapping_mul(round | 1)).collect();
            if bench.write(0x2000, 1, &data, &options).is_ok()
                && let Ok(read) = bench.read(0x2000, 1, &options)
            {
                assert_eq!(read, data, "seed {seed}, round {round}");
                done += 1;
            }
        }
        assert!(done > 0, "seed {seed}: nothing went through");
        bench.network.bus().set_faults(Faults::NONE);
        bench.run(Duration::from_secs(2));
        assert_eq!(bench.get(0x1000, 0), 0x000F_0191u32.to_le_bytes(), "seed {seed}");
    }
}

/// 8120h as long as the controller is error passive, 8140h when it is back from bus-off; off the bus it sends
/// nothing.
#[test]
fn bus_trouble_is_told() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    bench.put(0x1017, 0, &50u16.to_le_bytes());
    bench.heard();
    let tell = |bench: &mut Bench<_>, state| {
        let now = bench.network.now();
        can::Node::handle_bus(&mut bench.node, now, can::Event::State(state));
        bench.run(2 * MS);
        bench.heard()
    };
    assert_eq!(tell(&mut bench, can::State::Passive), ["085#2081110000000000"]);
    assert_eq!(bench.get(0x1001, 0), [0x11]);
    bench.heard();
    assert_eq!(tell(&mut bench, can::State::BusOff), [""; 0]);
    bench.run(200 * MS);
    assert_eq!(bench.heard(), [""; 0]);
    let back = tell(&mut bench, can::State::Active);
    assert_eq!(
        back.get(..2),
        Some(&["085#0000000000000000".to_owned(), "085#4081110000000000".to_owned()][..])
    );
}

/// Life guarding: 8130h and pre-operational when the master is gone, 0000h when it is back.
#[test]
fn a_lost_master_is_told_and_so_is_its_return() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    bench.put(0x100C, 0, &50u16.to_le_bytes());
    bench.put(0x100D, 0, &[2]);
    bench.send(START);
    bench.send(guard(5));
    bench.heard();
    bench.run(110 * MS);
    assert_eq!(bench.heard(), ["085#3081110000000000"]);
    assert_eq!(bench.node.state(), canopen_master::nmt::State::PreOperational);
    bench.send(guard(5));
    assert_eq!(bench.heard(), ["705#FF", "085#0000000000000000"]);
    assert_eq!(bench.get(0x1003, 0), [1]);
}

/// A counter where none was expected; in operational the next SYNC counts as ever.
#[test]
fn a_sync_of_wrong_length_is_told() {
    let mut bench = Bench::new(Ld2000::node(id(1), 1), Faults::NONE);
    bench.heard();
    bench.send(Frame::standard(0x080, [1]));
    assert_eq!(bench.heard(), ["081#4082110001000000"]);
    let refused = bench.write(0x1001, 0, &[0], &Options::default());
    assert_eq!(refused, Err(Outcome::Aborted(AbortCode::READ_ONLY)));
    bench.send(START);
    bench.heard();
    bench.send(SYNC);
    assert_eq!(bench.heard(), ["181#5002"]);
}
