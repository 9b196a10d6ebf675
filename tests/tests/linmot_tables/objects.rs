//! 2 to 6 and 8: UPIDs, strings, layers, compatibility, curves, the command table, PVL files.

use linmot::curve::{INFO_SIZE, INFO_WORDS, InfoBlock, ObjectType, Unit};
use linmot::pvl::{Event, Parser};
use linmot::table::{ENTRIES, Entry, NOT_LINKED, Presence, VERSION};
use linmot::upid::{Incompatible, Layer, TreeIdentity, Upid, Usage, stringlet};

/// Table 1 and the strings of 2.5.
#[test]
fn table_1_strings() {
    let text = b"X Axis Left";
    for (number, upid, value) in
        [(0, 0x03F3, 0x7841_2058), (1, 0x03F4, 0x4C20_7369), (2, 0x03F5, 0x0074_6665), (3, 0x03F6, 0)]
    {
        assert_eq!(Upid(0x03F2).stringlet(number), Some(Upid(upid)));
        assert_eq!(stringlet(text, number), value);
    }
    assert_eq!((Upid::DRIVE_NAME, Upid::USER_COMMENT), (Upid(0x03E8), Upid(0x03F2)));
    let ends =
        [Upid::DRIVE_NAME, Upid::USER_COMMENT].map(|upid| [0, 7].map(|n| upid.stringlet(n).unwrap().0));
    assert_eq!(ends, [[0x03E9, 0x03F0], [0x03F3, 0x03FA]]);
}

/// Figure 2: raw values of motor definitions, as the virtual drive has them.
#[test]
fn figure_2_motor_definitions() {
    let rows = [
        (0x119E, 8000),
        (0x119F, 115),
        (0x11A0, 70),
        (0x11A1, 2380),
        (0x11A2, 650_000),
        (0x11A3, 1_000_000),
        (0x11A4, 1_000_000),
        (0x11A5, 2380),
    ];
    let tree = device_sim::linmot::sg5();
    for (upid, raw) in rows {
        let found = tree.iter().find(|parameter| parameter.upid == Upid(upid)).unwrap();
        assert_eq!((found.default, found.takes(raw)), (raw, true), "{upid:04X}h");
    }
}

/// 7.2.1.4: address usage, with the bits of the LinRS manual's examples.
#[test]
fn address_usage() {
    let rows = [
        (0x0001, Usage::RAM_READ, "RAM read"),
        (0x0002, Usage::RAM_WRITE, "RAM write"),
        (0x0004, Usage::ROM_READ, "ROM read"),
        (0x0008, Usage::ROM_WRITE, "ROM write"),
        (0x0100, Usage::LIVE, "live"),
        (0x1000, Usage::NO_HASH, "not in hash"),
    ];
    for (bits, usage, name) in rows {
        assert_eq!((usage.0, usage.to_string().as_str()), (bits, name));
    }
}

/// Tables 2, 3 and 4.
#[test]
fn tables_2_3_and_4_layers() {
    let rows = [
        (Layer::Os, 1, "os", 0x0000..=0x0EFF, [0x0539, 0x0532, 0x0533]),
        (Layer::MotionControl, 2, "mc", 0x1000..=0x1EFF, [0x0561, 0x055A, 0x055B]),
        (Layer::Interface, 3, "interface", 0x2000..=0x2EFF, [0x0589, 0x0582, 0x0583]),
        (Layer::Application, 4, "application", 0x3000..=0x3EFF, [0x05B1, 0x05AA, 0x05AB]),
    ];
    for (layer, number, name, range, identity) in rows {
        assert_eq!((layer.number(), layer.name(), layer.range()), (number, name, range.clone()));
        assert_eq!(layer.identity().map(|upid| upid.0), identity);
        let outside = [range.start().checked_sub(1), range.end().checked_add(1)];
        assert!(outside.into_iter().flatten().all(|upid| Upid(upid).layer() != Some(layer)));
        assert_eq!([*range.start(), *range.end()].map(|upid| Upid(upid).layer()), [Some(layer); 2]);
    }
}

/// Table 5, each rule by itself.
#[test]
fn table_5_compatibility() {
    let drive = TreeIdentity { tree_id: 257, main_version: 3, sub_version: 5 };
    let violations = |file: TreeIdentity| file.violations(drive, Layer::Interface).collect::<Vec<_>>();
    let layer = Layer::Interface;
    for tree_id in [256, 258] {
        let named = Incompatible::TreeId { layer, file: tree_id, drive: 257 };
        assert_eq!(violations(TreeIdentity { tree_id, ..drive }), [named]);
    }
    for main_version in [2, 4] {
        let named = Incompatible::MainVersion { layer, file: main_version, drive: 3 };
        assert_eq!(violations(TreeIdentity { main_version, ..drive }), [named]);
    }
    for sub_version in 0..=5 {
        assert_eq!(violations(TreeIdentity { sub_version, ..drive }), []);
    }
    let named = Incompatible::SubVersion { layer, file: 6, drive: 5 };
    assert_eq!(violations(TreeIdentity { sub_version: 6, ..drive }), [named]);
}

/// Table 6: every field at its offset, by a block whose byte n is n.
#[test]
fn table_6_curve_info_block() {
    let bytes: [u8; 72] = core::array::from_fn(|n| n as u8);
    let words: [u32; INFO_WORDS] =
        core::array::from_fn(|n| u32::from_le_bytes(*bytes[4 * n..].first_chunk().unwrap()));
    let info = InfoBlock::parse(&words);
    assert_eq!((info.data_offset, info.object_type.0, info.setpoints), (0x0100, 0x0302, 0x0504));
    assert_eq!((info.setpoint_size, &info.name[..], info.id), (0x0706, &bytes[8..30], 0x1F1E));
    assert_eq!((info.x_length, info.x_unit.0, info.y_unit.0), (0x2322_2120, 0x2524, 0x2726));
    assert_eq!((info.wizard_type, info.wizard[0], info.wizard[6]), (0x2928, 0x2D2C_2B2A, 0x4544_4342));
    let mut sent = words;
    // Bytes 70 and 71 are no part of it.
    sent[17] &= 0xFFFF;
    assert_eq!((info.encode(), INFO_SIZE), (sent, 0x46));
}

/// Tables 7 and 8.
#[test]
fn tables_7_and_8_object_types_and_units() {
    for (object, number, x, length_unit, x_code) in [
        (ObjectType::POSITION_TIME, 0x0003, Unit::TIME, "0.01 ms", 0),
        (ObjectType::POSITION_ENCODER, 0x0103, Unit::ENCODER, "increments", 1),
    ] {
        assert_eq!((object.0, object.version(), object.object()), (number, 3, 0));
        assert_eq!((object.x_code(), object.y_code(), x.text()), (x_code, 0, Some(length_unit)));
    }
    assert_eq!([Unit::POSITION, Unit::TIME, Unit::ENCODER].map(|unit| unit.0), [0x0005, 0x001A, 0x001B]);
    assert_eq!((Unit::POSITION.text(), Unit(0x0006).text()), (Some("0.1 um"), None));
    // Every nibble in its place.
    let other = ObjectType(0x4213);
    assert_eq!((other.version(), other.object(), other.x_code(), other.y_code()), (3, 1, 2, 4));
    // "Allowed values are 1…100"; at least 2 setpoints; an object type that belongs to its units.
    let good = InfoBlock::cam(1, "cam", 3600, 2).unwrap();
    for (id, setpoints, taken) in
        [(0, 2, false), (1, 2, true), (100, 2, true), (101, 2, false), (7, 1, false)]
    {
        assert_eq!(InfoBlock { id, setpoints, ..good }.check().is_ok(), taken, "{id} {setpoints}");
    }
    for object in 0..=u16::MAX {
        let info = InfoBlock { object_type: ObjectType(object), ..good };
        assert_eq!(info.check().is_ok(), object == 0x0103, "{object:04X}h");
    }
}

/// Table 9: presence bits, entry 0 the lowest of the first word.
#[test]
fn table_9_presence() {
    for entry in ENTRIES {
        let mut presence = Presence::default();
        presence.set(entry, true);
        let bytes: Vec<u8> = presence.saved().iter().flat_map(|word| word.to_le_bytes()).collect();
        let (byte, bit) = (usize::from(entry / 8), entry % 8);
        assert!(bytes.iter().enumerate().all(|(n, found)| *found == if n == byte { 1 << bit } else { 0 }));
    }
}

/// Table 10: every field at its offset.
#[test]
fn table_10_entry() {
    let mut bytes: [u8; 64] = core::array::from_fn(|n| n as u8);
    assert!(Entry::parse(&bytes).is_err());
    bytes[..2].copy_from_slice(&[0x01, 0xA7]);
    let entry = Entry::parse(&bytes).unwrap();
    assert_eq!((VERSION, NOT_LINKED), (0xA701, 0xFFFF));
    assert_eq!((entry.linked(), entry.header()), (Some(0x0302), 0x0504));
    assert_eq!((entry.parameters(), entry.name()), (&bytes[0x06..0x26], &bytes[0x26..0x36]));
    assert_eq!((entry.bytes(), entry.words()[15]), (&bytes, 0x3F3E_3D3C));
}

/// Figures 12 and 13, as printed: the first layer, the motor type, the example curve.
const PVL: &str = "@FileType PVL\n@FormatVersion 1\n\
    @StartObject Parameter\n@TreeFileName OSTree1100DP_V3S0_b1\n@TreeLayer 1\n@TreeID 1\n@MainVersion 3\n\
    @SubVersion 0\n@Revision b1\n@StartData\n@Col1 UPID @Col2 Value @Col3 Caption @Col4 ScaledValue Unit\n\
    03E9, 6F43794D, OS\\Drive Name 1, MyCo\n03EA, 6F72746E, OS\\Drive Name 2, ntro\n\
    03EB, 72656C6C, OS\\Drive Name 3, ller\n03EC, 00000000, OS\\Drive Name 4, \n\
    03ED, 00000000, OS\\Drive Name 5, \n03EE, 00000000, OS\\Drive Name 6, \n03EF, 00000000, OS\\Drive Name 7, \n\
    03F0, 00000000, OS\\Drive Name 8, \n03F3, 78412058, OS\\User Comment 1, X Ax\n\
    03F4, 4C207369, OS\\User Comment 2, is L\n03F5, 00746665, OS\\User Comment 3, eft\n\
    03F6, 00000000, OS\\User Comment 4, \n03F7, 00000000, OS\\User Comment 5, \n\
    03F8, 00000000, OS\\User Comment 6, \n03F9, 00000000, OS\\User Comment 7, \n\
    03FA, 00000000, OS\\User Comment 8, \n@EndData\n@EndObject\n\
    @StartObject Parameter\n@TreeFileName MCTREE1100DSW4_HC_V3S0_b1\n@TreeLayer 2\n@TreeID 4612\n@MainVersion 3\n\
    @SubVersion 0\n@Revision b1\n@StartData\n@Col1 UPID @Col2 Value @Col3 Caption @Col4 ScaledValue Unit\n\
    1194, 00000002, Motion Control SW\\Motor Configuration\\Motor Type, P01\n@EndData\n@EndObject\n\
    @StartObject Curve\n@CurveName Example Curve\n@CurveID 23\n@InfoBlockByteSize 70\n@DataBlockByteSize 40\n\
    @StartInfo\n@Col1 Value\n00030046h\n0004000Ah\n6D617845h\n5F656C70h\n76727543h\n00000065h\n00000000h\n\
    00170000h\n00004E20h\n0005001Ah\n42400000h\n0000000Fh\n00000000h\n00000000h\n00000000h\n00000000h\n\
    00000000h\n00000000h\n@EndInfo\n@StartData\n@Col1 Value\n00000000h\n000075CAh\n0001C8F2h\n0003D090h\n\
    00064DF8h\n0008F448h\n000B71B0h\n000D794Eh\n000ECC76h\n000F4240h\n@EndData\n@EndObject\n";

#[test]
fn figures_12_and_13_pvl() {
    let (mut parser, mut events) = (Parser::new(), Vec::new());
    PVL.lines().for_each(|line| parser.line(line, &mut |event| events.push(event)));
    parser.finish(&mut |event| events.push(event));
    let identity = |tree_id| TreeIdentity { tree_id, main_version: 3, sub_version: 0 };
    let string = |upid: Upid, text: &[u8]| -> Vec<Event> {
        (0..8)
            .map(|n| Event::Parameter { upid: upid.stringlet(n).unwrap(), value: stringlet(text, n) })
            .collect()
    };
    let mut expected = vec![Event::Section { layer: Some(Layer::Os), identity: identity(1) }];
    expected.extend(string(Upid::DRIVE_NAME, b"MyController"));
    expected.extend(string(Upid::USER_COMMENT, b"X Axis Left"));
    expected.push(Event::EndSection { parameters: 16 });
    expected.push(Event::Section { layer: Some(Layer::MotionControl), identity: identity(4612) });
    expected.push(Event::Parameter { upid: Upid(0x1194), value: 2 });
    expected.push(Event::EndSection { parameters: 1 });
    // 200 ms, 10 setpoints; the wizard's first parameter is the stroke.
    let mut info = InfoBlock::position_over_time(23, "Example_Curve", 20_000, 10).unwrap();
    info.wizard[0] = 1_000_000;
    expected.push(Event::Curve(info));
    let setpoints = [0, 30_154, 116_978, 250_000, 413_176, 586_824, 750_000, 883_022, 969_846, 1_000_000];
    expected.extend(setpoints.map(Event::Setpoint));
    expected.push(Event::EndCurve { setpoints: 10 });
    assert_eq!(events, expected);
}
