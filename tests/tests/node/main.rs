//! The test of a node, tested: our virtual nodes pass it, and each deliberate fault is found.

use core::time::Duration;

use canopen_master::NodeId;
use canopen_master::data_type::DataType;
use canopen_master::eds::{self, Device};
use conformance::node::{Bench, Config, Line, TestError, test};
use conformance::report::{Case, Outcome, counts};
use device_sim::canopen::{FileNode, Ld2000, RemoteIo, device_file};
use pdo::Frame;

mod wrong;

use wrong::{WRONG, Wrong, recoded};

const NODE: u8 = 5;

fn id() -> NodeId {
    NodeId::new(NODE).unwrap()
}

fn config(device: &Device, permitted: bool) -> Config<'_> {
    Config { node: id(), device, answer: Duration::from_millis(200), permitted }
}

/// A file as it would be read from disk.
fn through_text(device: &Device) -> Device {
    eds::read(eds::write_eds(device).as_bytes()).unwrap().device
}

#[track_caller]
fn assert_passes(cases: &[Case]) {
    let failed: Vec<_> = cases.iter().filter(|case| matches!(case.outcome, Outcome::Failed(_))).collect();
    assert!(failed.is_empty(), "{failed:#?}");
}

fn honest(_: &[Frame], frame: Option<Frame>) -> Vec<Frame> {
    frame.into_iter().collect()
}

#[test]
fn virtual_io_passes() {
    for permitted in [false, true] {
        let node = RemoteIo::node(Some(id()), 1, true);
        let device = through_text(&device_file(&node, "Virtual I/O"));
        let mut bench = Bench::new(node, honest);
        let mut told = 0;
        let cases = test(&mut bench, &config(&device, permitted), |_| told += 1).unwrap();
        assert_passes(&cases);
        assert_eq!(told, cases.len());
        let (passed, _, skipped) = counts(&cases);
        assert!(passed > 400, "{passed}");
        // What is skipped has its reason; without permission nothing behind which an output may be is
        // written.
        let written =
            cases.iter().filter(|case| case.id.starts_with("object.62") && case.id.ends_with("write"));
        assert!(written.clone().count() > 0 && skipped > 0);
        for case in written {
            assert_eq!(case.outcome == Outcome::Passed, permitted, "{case:?}");
        }
    }
}

#[test]
fn virtual_drive_passes() {
    let node = Ld2000::node(Some(id()), 1);
    let device = through_text(&device_file(&node, "SD03"));
    let mut bench = Bench::new(node, honest);
    assert_passes(&test(&mut bench, &config(&device, true), |_| {}).unwrap());
}

/// What we write, our own check has nothing to say about.
#[test]
fn the_device_file_of_a_node_is_clean() {
    let files =
        [device_file(&RemoteIo::node(None, 1, false), "I/O"), device_file(&Ld2000::node(None, 1), "SD03")];
    for device in files {
        let reading = eds::read(eds::write_eds(&device).as_bytes()).unwrap();
        assert_eq!(eds::check(&reading), []);
    }
}

/// A node made of a device file passes a test by this file.
#[test]
fn a_node_of_a_device_file_passes() {
    let text = eds::write_eds(&device_file(&RemoteIo::node(None, 1, false), "Copy"));
    let device = eds::read(text.as_bytes()).unwrap().device;
    let node = FileNode::node(text.as_bytes(), Some(id()), 1).unwrap();
    let mut bench = Bench::new(node, honest);
    assert_passes(&test(&mut bench, &config(&device, true), |_| {}).unwrap());
}

#[test]
fn a_silent_node_and_one_at_work_are_left_alone() {
    let node = RemoteIo::node(Some(id()), 1, false);
    let device = device_file(&node, "Virtual I/O");
    let mut bench = Bench::new(node, |_: &[Frame], _: Option<Frame>| Vec::new());
    let error = test(&mut bench, &config(&device, false), |_| {}).unwrap_err();
    assert!(matches!(error, TestError::Silent(_)), "{error}");

    use conformance::node::Wire;
    let mut sent = Vec::new();
    let mut bench = Bench::new(RemoteIo::node(Some(id()), 1, false), honest);
    bench.send(&Frame::standard(0, [1, NODE])).unwrap();
    let error = test(&mut bench, &config(&device, false), |case| sent.push(case.id.clone())).unwrap_err();
    assert!(matches!(error, TestError::Operational(_)) && sent.is_empty(), "{error}");
}

#[test]
fn every_fault_is_found() {
    let device = device_file(&RemoteIo::node(Some(id()), 1, true), "Virtual I/O");
    for (number, Wrong { finds, twist, add }) in WRONG.iter().enumerate() {
        let mut bench =
            Bench::new(RemoteIo::node(Some(id()), 1, true), |heard: &[Frame], frame| match frame {
                Some(frame) => twist(heard, frame),
                None => add(heard).into_iter().collect(),
            });
        let cases = test(&mut bench, &config(&device, true), |_| {}).unwrap();
        let case = cases.iter().find(|case| case.id == *finds).unwrap_or_else(|| panic!("{finds}"));
        let failed: Vec<_> = cases
            .iter()
            .filter(|case| matches!(case.outcome, Outcome::Failed(_)))
            .map(|case| &case.id)
            .collect();
        assert!(matches!(case.outcome, Outcome::Failed(_)), "fault {number}, {case:?}; failed: {failed:?}");
    }
}

/// The same cases on hardware: `CONFORMANCE_CAN` names the endpoint, `CONFORMANCE_NODE` the node,
/// `CONFORMANCE_EDS` its device file. Nothing is written behind which outputs or axes may be.
#[test]
fn hardware() {
    let of = |name| std::env::var(name).ok();
    let (Some(can), Some(node), Some(file)) =
        (of("CONFORMANCE_CAN"), of("CONFORMANCE_NODE"), of("CONFORMANCE_EDS"))
    else {
        println!("ignored: needs CONFORMANCE_CAN, CONFORMANCE_NODE and CONFORMANCE_EDS");
        return;
    };
    let device = eds::read(&std::fs::read(&file).unwrap()).unwrap().device;
    let node = NodeId::new(node.parse().unwrap()).unwrap();
    let mut line = Line::new(motion_io::can::open(&can.parse().unwrap()).unwrap());
    let config = Config { node, device: &device, answer: Duration::from_millis(500), permitted: false };
    let cases = test(&mut line, &config, |case| println!("{case:?}")).unwrap();
    assert_passes(&cases);
}

/// No virtual node has a write-only object; one made of a device file that has one does.
#[test]
fn write_only_objects() {
    let mut device = device_file(&RemoteIo::node(None, 1, false), "Copy");
    let mut object = eds::Object::new(0x2100);
    object.own.data_type = Some(DataType::UNSIGNED8);
    object.own.access = Some(eds::Access::WriteOnly);
    let at = device.objects.iter().position(|object| object.index > 0x2100).unwrap();
    device.objects.insert(at, object);
    for right in [true, false] {
        let node = FileNode::node(eds::write_eds(&device).as_bytes(), Some(id()), 1).unwrap();
        let mut bench = Bench::new(node, |_: &[Frame], frame: Option<Frame>| match frame {
            Some(frame) if !right => recoded(frame, 0x0601_0001, 0x0601_0000),
            frame => frame.into_iter().collect(),
        });
        let cases = test(&mut bench, &config(&device, true), |_| {}).unwrap();
        let case = cases.iter().find(|case| case.id == "sdo.write-only").unwrap();
        assert_eq!(case.outcome == Outcome::Passed, right, "{case:?}");
    }
}

#[test]
fn every_check_has_its_fault() {
    let found = |id: &&str| WRONG.iter().any(|wrong| wrong.finds == *id);
    let without: Vec<_> =
        conformance::node::checks().iter().map(|check| check.id).filter(|id| !found(id)).collect();
    assert_eq!(without, ["sdo.write-only"], "which write_only_objects sees to");
}
