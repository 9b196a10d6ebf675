//! PDOs of the I/O node and of a device file.

use canopen_master::sdo::{AbortCode, Options, Outcome};
use device_sim::can::Faults;
use device_sim::canopen::{Address, FileNode, Node, RemoteIo};
use pdo::Frame;

use crate::bench::{Bench, DEVICE_INFO, MS, START, SYNC, id};

#[test]
fn io_node_speaks_through_its_pdos() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    assert_eq!(bench.get(0x1000, 0), 0x000F_0191u32.to_le_bytes());
    bench.heard();
    bench.send(START);
    // Digital inputs at once, analogue ones only when 6423h allows it.
    assert_eq!(bench.heard(), ["185#00"]);
    bench.with_io(|io| {
        io.set_inputs(0xA5);
        io.set_analogue(2, -2);
    });
    assert_eq!(bench.heard(), ["185#A5"]);
    bench.put(0x6423, 0, &[1]);
    bench.run(2 * MS);
    assert!(bench.heard().contains(&"285#00000000FEFF0000".to_owned()));
    bench.send(Frame::standard(0x205, [0x3C]));
    bench.send(Frame::standard(0x305, [1, 0, 2, 0, 3, 0, 0xFC, 0xFF]));
    assert_eq!(bench.node.device().outputs(), 0x3C);
    assert_eq!(bench.get(0x6411, 4), [0xFC, 0xFF]);
    bench.heard();
    // Too short: reported and not acted on; too long: acted on and reported once (CiA 301, 7.2.2.5).
    bench.send(Frame::standard(0x305, [9, 9]));
    assert_eq!(bench.heard(), ["085#108211011608 0200".replace(' ', "")]);
    assert_eq!(bench.get(0x6411, 1), [1, 0]);
    bench.heard();
    bench.send(Frame::standard(0x205, [0xFF, 1]));
    bench.send(Frame::standard(0x205, [0xF0, 1]));
    assert_eq!(bench.heard(), ["085#2082110016010200"]);
    assert_eq!(bench.node.device().outputs(), 0xF0);
    // Stopped: the error value shows.
    bench.send(Frame::standard(0x000, [2, 5]));
    assert_eq!(bench.node.device().outputs(), 0);
}

#[test]
fn a_mapping_is_set_up_in_the_standard_order_and_not_otherwise() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    let options = Options::default();
    let abort = |result: Result<(), Outcome>, code| assert_eq!(result, Err(Outcome::Aborted(code)));
    let entry = |index: u32, sub: u32, bits: u32| (index << 16 | sub << 8 | bits).to_le_bytes();
    abort(bench.write(0x1A00, 0, &[0], &options), AbortCode::UNSUPPORTED_ACCESS);
    abort(bench.write(0x1800, 1, &0x1A5u32.to_le_bytes(), &options), AbortCode::INVALID_VALUE);
    bench.put(0x1800, 1, &0x8000_0185u32.to_le_bytes());
    abort(bench.write(0x1A00, 1, &entry(0x6401, 2, 16), &options), AbortCode::UNSUPPORTED_ACCESS);
    bench.put(0x1A00, 0, &[0]);
    abort(bench.write(0x1A00, 1, &entry(0x6401, 9, 16), &options), AbortCode::NO_OBJECT);
    abort(bench.write(0x1A00, 1, &entry(0x7000, 1, 16), &options), AbortCode::NO_OBJECT);
    abort(bench.write(0x1A00, 1, &entry(0x1008, 0, 32), &options), AbortCode::NOT_MAPPABLE);
    abort(bench.write(0x1A00, 1, &entry(0x6401, 2, 8), &options), AbortCode::NOT_MAPPABLE);
    for sub in 1..=5 {
        bench.put(0x1A00, sub, &entry(0x6401, 2, 16));
    }
    abort(bench.write(0x1A00, 0, &[5], &options), AbortCode::PDO_LENGTH);
    bench.put(0x1A00, 1, &entry(0x6000, 1, 8));
    bench.put(0x1A00, 0, &[2]);
    abort(bench.write(0x1800, 1, &0x601u32.to_le_bytes(), &options), AbortCode::INVALID_VALUE);
    bench.put(0x1800, 2, &[2]);
    bench.put(0x1800, 1, &0x1A5u32.to_le_bytes());
    bench.heard();
    bench.send(START);
    for _ in 0..4 {
        bench.send(SYNC);
    }
    // Every second SYNC.
    assert_eq!(bench.heard(), ["1A5#000000", "1A5#000000"]);
}

/// Transmission type 0: one PDO at the SYNC after a change, and none without.
#[test]
fn an_acyclic_pdo_follows_a_change() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    bench.put(0x1800, 2, &[0]);
    bench.send(START);
    bench.heard();
    let syncs = |bench: &mut Bench<_>| {
        (0..3).for_each(|_| bench.send(SYNC));
        bench.heard()
    };
    assert_eq!(syncs(&mut bench), ["185#00"]);
    assert_eq!(syncs(&mut bench), [""; 0]);
    bench.with_io(|io| io.set_inputs(0x81));
    assert_eq!(bench.heard(), [""; 0]);
    assert_eq!(syncs(&mut bench), ["185#81"]);
    // There and back between two SYNCs: nothing has changed.
    bench.with_io(|io| io.set_inputs(0x80));
    bench.with_io(|io| io.set_inputs(0x81));
    assert_eq!(syncs(&mut bench), [""; 0]);
}

/// Whatever other frame comes while an input is different.
#[test]
fn only_the_sync_looks_for_a_change_of_an_acyclic_pdo() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    bench.put(0x1800, 2, &[0]);
    bench.send(START);
    bench.send(SYNC);
    bench.heard();
    bench.with_io(|io| io.set_inputs(0x80));
    bench.send(Frame::standard(0x205, [0x3C]));
    bench.with_io(|io| io.set_inputs(0));
    bench.send(SYNC);
    assert_eq!(bench.heard(), [""; 0]);
}

/// 1800h:03: changes within the inhibit time go out together after it; 1800h:05: a PDO without change.
#[test]
fn inhibit_time_and_event_timer() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    bench.put(0x1800, 1, &0x8000_0185u32.to_le_bytes());
    bench.put(0x1800, 3, &500u16.to_le_bytes());
    bench.put(0x1800, 5, &100u16.to_le_bytes());
    bench.put(0x1800, 1, &0x185u32.to_le_bytes());
    bench.heard();
    bench.send(START);
    assert_eq!(bench.heard(), ["185#00"]);
    (1..=4).for_each(|inputs| bench.with_io(|io| io.set_inputs(inputs)));
    assert_eq!(bench.heard(), [""; 0]);
    bench.run(45 * MS);
    assert_eq!(bench.heard(), ["185#04"]);
    bench.run(110 * MS);
    assert_eq!(bench.heard(), ["185#04"]);
}

/// 6423h holds analogue inputs back (CiA 401), also where their PDO is set up while the node runs.
#[test]
fn what_is_held_back_is_not_sent_at_the_beginning() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    bench.send(START);
    bench.heard();
    for cob_id in [0x8000_0285u32, 0x285] {
        bench.put(0x1801, 1, &cob_id.to_le_bytes());
    }
    bench.run(10 * MS);
    assert!(bench.heard().iter().all(|frame| !frame.starts_with("285#")));
    bench.put(0x6423, 0, &[1]);
    bench.run(10 * MS);
    assert!(bench.heard().contains(&"285#0000000000000000".to_owned()));
}

/// A synchronous RPDO acts at the next SYNC; what the TPDO of that SYNC carries is from before.
#[test]
fn a_synchronous_output_waits_for_sync() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, true), Faults::NONE);
    bench.put(0x1400, 2, &[1]);
    bench.put(0x1800, 2, &[1]);
    bench.send(START);
    bench.heard();
    bench.send(Frame::standard(0x205, [0x55]));
    assert_eq!(bench.node.device().outputs(), 0);
    bench.send(SYNC);
    assert_eq!((bench.node.device().outputs(), bench.heard()), (0x55, vec!["185#00".to_owned()]));
    bench.send(SYNC);
    assert_eq!(bench.heard(), ["185#55"]);
}

/// LSS, "configure node ID" and "switch mode global"; then the reset that lets it hold.
fn readdress(bench: &mut Bench<impl device_sim::canopen::Device>, from: u8, to: u8) {
    for [command, value] in [[0x04, 1], [0x11, to], [0x04, 0]] {
        bench.send(Frame::standard(0x7E5, [command, value, 0, 0, 0, 0, 0, 0]));
    }
    bench.send(Frame::standard(0x000, [0x82, from]));
    bench.heard();
    bench.send(Frame::standard(0x000, [1, to]));
}

/// The predefined identifiers are those of the address that holds.
#[test]
fn identifiers_follow_the_address() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    readdress(&mut bench, 5, 9);
    assert_eq!(bench.heard(), ["189#00"]);
    bench.send(Frame::standard(0x209, [0x3C]));
    assert_eq!(bench.node.device().outputs(), 0x3C);
    bench.send(Frame::standard(0x209, []));
    assert_eq!(bench.heard(), ["089#1082110016010000"]);
}

/// 1010h keeps that an identifier is the predefined one, and any other as it is.
#[test]
fn stored_identifiers_follow_the_address_too() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    bench.put(0x1400, 1, &0x8000_0205u32.to_le_bytes());
    bench.put(0x1400, 1, &0x333u32.to_le_bytes());
    bench.put(0x1010, 1, b"save");
    readdress(&mut bench, 5, 9);
    assert_eq!(bench.heard(), ["189#00"]);
    bench.send(Frame::standard(0x333, [0x3C]));
    assert_eq!(bench.node.device().outputs(), 0x3C);
}

const FILE: &str = "
[ManufacturerObjects]
SupportedObjects=2
1=0x3000
2=0x3001
[3000]
ParameterName=Out
ObjectType=0x7
DataType=0x0006
AccessType=rww
PDOMapping=1
[3001]
ParameterName=In
ObjectType=0x7
DataType=0x0006
AccessType=ro
DefaultValue=0x1234
PDOMapping=1
[OptionalObjects]
SupportedObjects=4
1=0x1400
2=0x1600
3=0x1801
4=0x1A01
[1400]
ParameterName=RPDO
ObjectType=0x9
SubNumber=2
[1400sub0]
ParameterName=Count
ObjectType=0x7
DataType=0x0005
AccessType=ro
DefaultValue=1
[1400sub1]
ParameterName=COB-ID
ObjectType=0x7
DataType=0x0007
AccessType=rw
DefaultValue=$NODEID+0x200
[1600]
ParameterName=Mapping
ObjectType=0x9
SubNumber=2
[1600sub0]
ParameterName=Count
ObjectType=0x7
DataType=0x0005
AccessType=rw
DefaultValue=1
[1600sub1]
ParameterName=Entry
ObjectType=0x7
DataType=0x0007
AccessType=rw
DefaultValue=0x30000010
[1801]
ParameterName=TPDO
ObjectType=0x9
SubNumber=3
[1801sub0]
ParameterName=Count
ObjectType=0x7
DataType=0x0005
AccessType=ro
DefaultValue=2
[1801sub1]
ParameterName=COB-ID
ObjectType=0x7
DataType=0x0007
AccessType=rw
DefaultValue=0x333
[1801sub2]
ParameterName=Type
ObjectType=0x7
DataType=0x0005
AccessType=rw
DefaultValue=2
[1A01]
ParameterName=Mapping
ObjectType=0x9
SubNumber=2
[1A01sub0]
ParameterName=Count
ObjectType=0x7
DataType=0x0005
AccessType=rw
DefaultValue=1
[1A01sub1]
ParameterName=Entry
ObjectType=0x7
DataType=0x0007
AccessType=rw
DefaultValue=0x30010010
";

#[test]
fn a_device_file_says_what_its_pdos_are() {
    let out = |node: &Node<FileNode>| node.objects().get(0x3000, 0);
    let file = [DEVICE_INFO, FILE].concat();
    for address in [id(42), None] {
        let mut bench = Bench::new(FileNode::node(file.as_bytes(), address, 5).unwrap(), Faults::NONE);
        readdress(&mut bench, 42, 43);
        bench.send(Frame::standard(0x22B, [0x78, 0x56]));
        assert_eq!(out(&bench.node), 0x5678);
        assert_eq!(bench.heard(), [""; 0]);
        (0..4).for_each(|_| bench.send(SYNC));
        assert_eq!(bench.heard(), ["333#3412", "333#3412"]);
        let parameter = |index, sub| bench.node.pdos().parameter(Address::new(index, sub)).unwrap();
        assert_eq!(parameter(0x1600, 1).get::<u32>(), Ok(0x3000_0010));
        assert_eq!(parameter(0x1801, 2).get::<u8>(), Ok(2));
        // The others are off.
        assert_eq!(parameter(0x1800, 1).get::<u32>(), Ok(0x8000_01AB));
    }
}

/// 8210h and 8250h are there, in 1001h too, until a good PDO of that number comes; told once.
#[test]
fn a_missing_pdo_is_an_error_until_one_comes() {
    let mut bench = Bench::new(RemoteIo::node(id(5), 1, false), Faults::NONE);
    bench.put(0x1400, 5, &20u16.to_le_bytes());
    bench.send(START);
    bench.heard();
    for _ in 0..2 {
        bench.send(Frame::standard(0x205, []));
    }
    assert_eq!(bench.heard(), ["085#1082110016010000"]);
    bench.send(Frame::standard(0x305, [0; 8]));
    assert_eq!((bench.heard(), bench.get(0x1001, 0)), (vec![], vec![0x11]), "another PDO");
    bench.heard();
    bench.send(Frame::standard(0x205, [0]));
    assert_eq!(bench.heard(), ["085#0000000000000000"]);
    bench.run(100 * MS);
    assert_eq!(bench.heard(), ["085#5082110016000000"]);
    bench.send(Frame::standard(0x205, [0]));
    assert_eq!(bench.heard(), ["085#0000000000000000"]);
    assert_eq!(bench.get(0x1001, 0), [0]);
}
