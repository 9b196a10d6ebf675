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

use wrong::{WRONG, Wrong, answers, no_toggle, recoded};

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

/// A text of one segment was taken for one of two; the PDOs, the identity and the stores of a node made of
/// a file were not those of the file.
#[test]
fn a_node_of_a_device_file_with_less_than_the_engine_has_passes() {
    let mut device = device_file(&RemoteIo::node(None, 1, false), "Copy");
    for (index, count) in [(0x1018, 3), (0x1400, 2), (0x1401, 2), (0x1800, 3)] {
        let object = device.object_mut(index).unwrap();
        object.subs.retain(|entry| entry.subindex <= count);
        object.entry_mut(0).unwrap().default = Some(count.to_string());
    }
    for index in [0x1008, 0x1009, 0x100A] {
        device.object_mut(index).unwrap().own.default = Some("Short".into());
    }
    let text = eds::write_eds(&device);
    let device = eds::read(text.as_bytes()).unwrap().device;
    let node = FileNode::node(text.as_bytes(), Some(id()), 1).unwrap();
    let mut bench = Bench::new(node, honest);
    let cases = test(&mut bench, &config(&device, true), |_| {}).unwrap();
    assert_passes(&cases);
    let of_two = cases.iter().find(|case| case.id == "block.retransmission").unwrap();
    assert_eq!(of_two.outcome.reason(), Some("1008h:00 has 5 bytes: one segment, two needed"));
}

#[test]
fn nodes_of_recorded_device_files_pass() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/recorded/eds");
    if !folder.exists() {
        println!("ignored: needs ../shared/recorded");
        return;
    }
    for (name, faults) in [
        ("KITmedical__kacanopen__epos2_347717.eds", &[][..]),
        ("dianhuaeven__Eyou_Canopen_master__YiyouServo_V1.4.eds", &[]),
        ("CANopenNode__CANopenDemo__demoDevice.eds", &[]),
        ("greggg-rgb__odrive-cia402-profile__odrive-canopen-cia402.xdd", &[]),
        // Its PDOs map objects that it does not have.
        ("canopen-python__canopen__sample.eds", &["pdo.mapping"]),
    ] {
        let bytes = std::fs::read(folder.join(name)).unwrap();
        let device = eds::read(&bytes).unwrap().device;
        let mut bench = Bench::new(FileNode::node(&bytes, Some(id()), 1).unwrap(), honest);
        let cases = test(&mut bench, &config(&device, true), |_| {}).unwrap();
        let found: Vec<_> = failed(&cases).into_iter().map(|(id, _)| id).collect();
        assert_eq!(found, faults, "{name}: {:#?}", failed(&cases));
    }
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
        // In words, not as the program has it inside.
        for reason in cases.iter().filter_map(|case| case.outcome.reason()) {
            let inside = ["{", "[", "Some", "None", "Ok(", "Err("];
            assert!(!inside.iter().any(|word| reason.contains(word)), "{finds}: {reason}");
        }
    }
}

fn failed(cases: &[Case]) -> Vec<(&str, &str)> {
    let failed = cases.iter().filter(|case| matches!(case.outcome, Outcome::Failed(_)));
    failed.map(|case| (case.id.as_str(), case.outcome.reason().unwrap())).collect()
}

/// Cases of the virtual I/O by a device file that was changed.
fn by_file(change: impl FnOnce(&mut Device)) -> Vec<Case> {
    let node = RemoteIo::node(Some(id()), 1, true);
    let mut device = through_text(&device_file(&node, "Virtual I/O"));
    change(&mut device);
    test(&mut Bench::new(node, honest), &config(&device, false), |_| {}).unwrap()
}

fn default(index: u16, sub: u8, text: &str) -> impl Fn(&mut Device) {
    move |device| device.object_mut(index).unwrap().entry_mut(sub).unwrap().default = Some(text.to_owned())
}

fn info(key: &'static str, text: &str) -> impl Fn(&mut Device) {
    move |device| assert!(device.device_info.set(key, text))
}

/// A device file that is wrong in one value was passed with 0 failed.
#[test]
fn a_device_file_with_a_wrong_value_does_not_pass() {
    type Change = Box<dyn Fn(&mut Device)>;
    let wrong: [(Change, &str, &str); 13] = [
        (
            Box::new(default(0x1000, 0, "0x000F0192")),
            "object.1000.00.value",
            "the node has 000F0191h, the device file 000F0192h",
        ),
        (Box::new(default(0x1018, 0, "3")), "object.1018.00.value", "the node has 04h, the device file 03h"),
        (Box::new(default(0x1018, 1, "0x1234")), "object.1018.01.value", "the device file 00001234h"),
        (
            Box::new(info("VendorNumber", "0x1234")),
            "file.vendor-number",
            "VendorNumber of the device file 1234h",
        ),
        (Box::new(info("ProductNumber", "0x1234")), "file.product-number", "1018h:02 is"),
        (Box::new(info("RevisionNumber", "0x1234")), "file.revision-number", "1018h:03 is"),
        (
            Box::new(default(0x1400, 1, "$NODEID+0x300")),
            "object.1400.01.value",
            "the node has 00000205h, the device file 00000305h, unless a parameter set stored with 1010h",
        ),
        (Box::new(default(0x1801, 1, "$NODEID+0x380")), "object.1801.01.value", "the device file 00000385h"),
        (
            Box::new(default(0x1014, 0, "$NODEID+0x90")),
            "object.1014.00.value",
            "the node has 00000085h, the device file 00000095h",
        ),
        (Box::new(info("NrOfRXPDO", "3")), "file.receive-pdos", "the node has 4, NrOfRXPDO says 3"),
        (Box::new(info("NrOfRXPDO", "5")), "file.receive-pdos", "the node has 4, NrOfRXPDO says 5"),
        (Box::new(info("NrOfTXPDO", "0")), "file.transmit-pdos", "the node has 4, NrOfTXPDO says 0"),
        // Without 1010h nothing can have been stored.
        (
            Box::new(|device| {
                device.objects.retain(|object| object.index != 0x1010);
                default(0x1017, 0, "500")(device);
            }),
            "object.1017.00.value",
            "the node has 0000h, the device file 01F4h",
        ),
    ];
    for (change, finds, says) in wrong {
        let cases = by_file(change);
        let failed = failed(&cases);
        assert_eq!(failed.len(), 1, "{finds}: {failed:?}");
        assert!(failed[0].0 == finds && failed[0].1.contains(says), "{failed:?}");
        let case = cases.iter().find(|case| case.id == finds).unwrap();
        assert!(case.clause.contains("CiA 306-1") && case.clause.contains("CiA 301"), "{case:?}");
    }
}

/// What a stored parameter set may have changed is told, and is no fault; nor is what the file does not say.
#[test]
fn a_value_that_was_stored_or_is_not_given_is_skipped_with_its_reason() {
    let reason = |cases: &[Case], id: &str| {
        assert_eq!(failed(cases), []);
        let case = cases.iter().find(|case| case.id == id).unwrap();
        assert_eq!(case.outcome.word(), "skipped", "{case:?}");
        case.outcome.reason().unwrap().to_owned()
    };
    let stored = reason(&by_file(default(0x1017, 0, "500")), "object.1017.00.value");
    assert_eq!(
        stored,
        "the node has 0000h, the device file 01F4h; a parameter set stored with 1010h may have it so"
    );
    let none = by_file(|device| {
        default(0x1000, 0, "")(device);
        device.device_info = eds::Fields::default();
    });
    assert_eq!(reason(&none, "object.1000.00.value"), "the device file gives no value");
    assert_eq!(reason(&none, "file.vendor-number"), "the device file gives no VendorNumber");
    assert_eq!(reason(&none, "file.transmit-pdos"), "the device file gives no NrOfTXPDO");
    assert_eq!(reason(&none, "object.1018.04.value"), "a serial number is each device's own");
}

/// Whole texts cannot be read then, but that breaks one clause, not those of blocks, aborts and objects.
#[test]
fn a_node_that_does_not_toggle_fails_under_that_clause_only() {
    let node = RemoteIo::node(Some(id()), 1, true);
    let device = device_file(&node, "Virtual I/O");
    let mut bench = Bench::new(node, |heard: &[Frame], frame: Option<Frame>| {
        frame.into_iter().flat_map(|frame| no_toggle(heard, frame)).collect()
    });
    let cases = test(&mut bench, &config(&device, true), |_| {}).unwrap();
    let failed = failed(&cases);
    assert_eq!(failed.iter().map(|(id, _)| *id).collect::<Vec<_>>(), ["sdo.segmented-upload"], "{failed:?}");
    for id in ["sdo.client-abort", "sdo.restart", "block.upload", "block.size-1", "object.1008.00.read"] {
        let case = cases.iter().find(|case| case.id == id).unwrap();
        assert!(
            matches!(&case.outcome, Outcome::Skipped(why) if why.contains("sdo.segmented-upload")),
            "{case:?}"
        );
    }
}

/// A node without toggle bit, and without an answer to what needs no segments.
#[test]
fn wrong_segments_do_not_excuse_silence() {
    let node = RemoteIo::node(Some(id()), 1, true);
    let device = device_file(&node, "Virtual I/O");
    let mut bench = Bench::new(node, |heard: &[Frame], frame: Option<Frame>| {
        let silent = |frame: &Frame| answers(heard, frame, &[0x40, 0x01, 0x64, 1]);
        frame.into_iter().filter(|frame| !silent(frame)).flat_map(|frame| no_toggle(heard, frame)).collect()
    });
    let cases = test(&mut bench, &config(&device, true), |_| {}).unwrap();
    let failed = failed(&cases);
    assert!(failed.iter().any(|(id, _)| *id == "sdo.segmented-upload"), "{failed:?}");
    let (_, why) = failed.iter().find(|(id, _)| *id == "object.6401.01.read").unwrap();
    assert!(why.contains("6401h:01 cannot be read"), "{why}");
}

/// Only the first one was told.
#[test]
fn every_wrong_mapping_is_told() {
    let cases = by_file(|device| {
        device.object_mut(0x6200).unwrap().entry_mut(1).unwrap().pdo_mapping = None;
        let analogue = device.object_mut(0x6401).unwrap();
        analogue.entry_mut(1).unwrap().data_type = Some(DataType::UNSIGNED32);
        analogue.entry_mut(2).unwrap().pdo_mapping = None;
    });
    let failed = failed(&cases);
    let (_, why) = failed.iter().find(|(id, _)| *id == "pdo.mapping").unwrap();
    for part in [
        "maps 6200h:01, which the device file calls not mappable",
        "maps 16 bits of 6401h:01, which has 32",
        "maps 6401h:02, which the device file calls not mappable",
    ] {
        assert!(why.contains(part), "{why}");
    }
}

#[test]
fn answers_are_told_in_words() {
    let node = RemoteIo::node(Some(id()), 1, true);
    let device = device_file(&node, "Virtual I/O");
    let mut bench = Bench::new(node, |heard: &[Frame], frame: Option<Frame>| {
        let asked = heard.last().and_then(|last| last.data().first()).copied().unwrap_or(0);
        let data = match frame {
            // Everything absent is there, everything read-only is written.
            Some(frame) if frame.standard_id() == Some(0x585) && frame.data()[0] == 0x80 => match asked {
                0x40 => [0x43, 0x18, 0x10, 2, 0x91, 0x01, 0x0F, 0],
                0x23 => [0x60, 0, 0x10, 0, 0, 0, 0, 0],
                0xE0 => [0x80, 0, 0, 0, 2, 0, 1, 6],
                _ => return vec![frame],
            },
            frame => return frame.into_iter().collect(),
        };
        vec![Frame::standard(0x585, data)]
    });
    let cases = test(&mut bench, &config(&device, false), |_| {}).unwrap();
    let failed = failed(&cases);
    let why = |id: &str| failed.iter().find(|case| case.0 == id).unwrap_or_else(|| panic!("{id}")).1;
    assert_eq!(why("sdo.no-sub-index"), "1018h:02 answered 91 01 0F 00; abort code 06090011h expected");
    assert_eq!(why("sdo.read-only"), "it was accepted, writing 1000h:00; abort code 06010002h expected");
    assert_eq!(
        why("sdo.command-specifier"),
        "aborted with 06010002h, attempt to write a read only object; 05040001h expected"
    );
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
