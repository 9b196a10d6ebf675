//! Reading and writing capture files through the public interface.

use std::io::{self, Read};
use std::path::Path;

use motion_io::capture::{
    Capture, Chunk, Direction, Format, Frame, FrameKind, Item, Record, Time, Times, WriteFormat, Writer, open,
};

const DATA: FrameKind = FrameKind::Data;
const FD: FrameKind = FrameKind::Fd { bit_rate_switch: true, error_passive: false };

/// A frame and its bus.
type Named = (Option<String>, Record);
/// Nanoseconds, bus, direction, frame.
type Expected<'a> = (Option<i64>, Option<&'a str>, Option<Direction>, Frame);

/// Every frame with its bus, and every damage as text.
fn read(content: &[u8]) -> (Format, Vec<Named>, Vec<String>) {
    read_from(content)
}

fn read_from(source: impl Read) -> (Format, Vec<Named>, Vec<String>) {
    let Capture::Can(mut reader) = open(source).expect("a capture") else { panic!("LB2") };
    let (mut frames, mut damage) = (Vec::new(), Vec::new());
    loop {
        match reader.next().expect("memory does not fail") {
            Some(Item::Frame(record)) => {
                let record = *record;
                frames.push((record.bus.and_then(|bus| reader.bus_name(bus)).map(str::to_owned), record));
            }
            Some(Item::Damage(found)) => damage.push(found.to_string()),
            None => return (reader.format(), frames, damage),
        }
    }
}

fn expect(content: &str, expected: &[Expected<'_>]) {
    let (_, frames, damage) = read(content.as_bytes());
    assert_eq!(damage, Vec::<String>::new(), "{content}");
    let frames: Vec<_> = frames
        .iter()
        .map(|(bus, record)| (record.time.map(|time| time.0), bus.as_deref(), record.direction, record.frame))
        .collect();
    assert_eq!(frames, expected, "{content}");
}

fn frame(id: u32, extended: bool, kind: FrameKind, data: &[u8]) -> Frame {
    Frame::new(id, extended, kind, data).unwrap()
}

fn standard(id: u32, data: &[u8]) -> Frame {
    frame(id, false, DATA, data)
}

fn remote(id: u32, len: usize) -> Frame {
    frame(id, false, FrameKind::Remote, &vec![0; len])
}

#[test]
fn candump_log() {
    expect(
        "(1436509052.249713) vcan0 044#2A366C2BBA\n\
         (1436509052.449847) vcan0 1F334455#1122334455667788 T\n\
         (1436509052.5) can1 701#R\n\
         (1) can1 701#R1 R\n\
         (0.123456789) can1 123##1AABB\n\
         (0.0) can1 20000004#0004000000000000\n\
         (0.0) can1 123#1122334455667788_9\r\n\
         5A1#11.2233.44556677.88\n",
        &[
            (
                Some(1_436_509_052_249_713_000),
                Some("vcan0"),
                None,
                standard(0x44, &[0x2A, 0x36, 0x6C, 0x2B, 0xBA]),
            ),
            (
                Some(1_436_509_052_449_847_000),
                Some("vcan0"),
                Some(Direction::Tx),
                frame(0x1F33_4455, true, DATA, &[0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88]),
            ),
            (Some(1_436_509_052_500_000_000), Some("can1"), None, remote(0x701, 0)),
            (Some(1_000_000_000), Some("can1"), Some(Direction::Rx), remote(0x701, 1)),
            (Some(123_456_789), Some("can1"), None, frame(0x123, false, FD, &[0xAA, 0xBB])),
            (Some(0), Some("can1"), None, frame(4, false, FrameKind::Error, &[0, 4, 0, 0, 0, 0, 0, 0])),
            (Some(0), Some("can1"), None, standard(0x123, &[0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88])),
            (None, None, None, standard(0x5A1, &[0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88])),
        ],
    );
}

/// Gives few bytes at a time, so that a line is never held whole with what follows it.
struct Trickle<'a>(&'a [u8]);

impl Read for Trickle<'_> {
    fn read(&mut self, room: &mut [u8]) -> io::Result<usize> {
        self.0.read(room.get_mut(..5).expect("room"))
    }
}

/// Lines that are held whole are read in fewer steps: every character at every place.
#[test]
fn a_log_line_is_the_same_held_whole_and_in_pieces() {
    let mut frames = 0;
    for line in ["(1436509052.249713) can0 581#4B41600018028FAF\n", "(1436509052.249713) can0 080#\r\n"] {
        for at in 0..line.len() {
            for byte in 0..=255 {
                let mut changed = line.as_bytes().to_vec();
                changed[at] = byte;
                let content = [line.as_bytes(), &changed, line.repeat(3).as_bytes()].concat();
                let whole = read(&content);
                assert_eq!(whole, read_from(Trickle(&content)), "{}", content.escape_ascii());
                frames += whole.1.len();
            }
        }
    }
    // Most changes damage a line, some join it with the next one.
    assert!(frames > 5 * 256 * 60, "{frames}");
}

#[test]
fn candump_screen() {
    let eight = standard(0x581, &[0x4B, 0x41, 0x60, 0, 0x18, 2, 0x8F, 0xAF]);
    expect(
        "  can0  581   [8]  4B 41 60 00 18 02 8F AF\n\
         \x20(000.000003)  vcan0  581   [8]  4B 41 60 00 18 02 8F AF   'KA`.....'\n\
         \x20(2015-07-10 08:57:32.249713)  can0  TX - -  581   [8]  4B 41 60 00 18 02 8F AF\n\
         581   [8]  4B 41 60 00 18 02 8F AF   # upload\n\
         RX 701   [1]  remote request\n\
         can0  080   [0]\n\
         can0  1F334455   [2]  11 22\n\
         can0  TX B -  123  [12]  00 01 02 03 04 05 06 07 08 09 0A 0B\n\
         can0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME\n\
         \tcontroller-problem{rx-error-warning}\n\
         can0  123   [2]  22`11\n\
         \x1b[32m  can0  123\x1b[0m   [2]  11 22\n",
        &[
            (None, Some("can0"), None, eight),
            (Some(3000), Some("vcan0"), None, eight),
            (Some(1_436_518_652_249_713_000), Some("can0"), Some(Direction::Tx), eight),
            (None, None, None, eight),
            (None, None, Some(Direction::Rx), remote(0x701, 1)),
            (None, Some("can0"), None, standard(0x80, &[])),
            (None, Some("can0"), None, frame(0x1F33_4455, true, DATA, &[0x11, 0x22])),
            (
                None,
                Some("can0"),
                Some(Direction::Tx),
                frame(0x123, false, FD, &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]),
            ),
            (None, Some("can0"), None, frame(4, false, FrameKind::Error, &[0, 4, 0, 0, 0, 0, 0, 0])),
            (None, Some("can0"), None, standard(0x123, &[0x11, 0x22])),
            (None, Some("can0"), None, standard(0x123, &[0x11, 0x22])),
        ],
    );
}

#[test]
fn vector_asc() {
    let header = "date Mon Feb 6 10:00:00.000 am 2023\nbase hex  timestamps absolute\n\
                  internal events logged\n// version 8.5.0\nBegin Triggerblock\n   0.000000 Start of measurement\n";
    let lines = "   0.002500 1  181             Rx   d 2 00 FF  Length = 120000 BitCount = 62 ID = 385\n\
                 0.003 2  18FEF1FEx       Tx   d 1 07\n\
                 0.004 1  701             Tx   r\n\
                 0.005 1  701             Tx   r 1\n\
                 0.006 1  ErrorFrame\n\
                 0.007 1  Statistic: D 1 R 0 XD 0 XR 0 E 0 O 0 B 1.5%\n\
                 0.008 CANFD   1 Rx        123  Name  1 0 9 12 00 01 02 03 04 05 06 07 08 09 0A 0B 130000 130 303000 5 0 0 0\n\
                 0.009 CANFD   1 Tx        123  0 0 1 1 AA 130000 130 0 50000 0 0 0 0\nEnd TriggerBlock\n";
    expect(
        &format!("{header}{lines}"),
        &[
            (Some(2_500_000), Some("1"), Some(Direction::Rx), standard(0x181, &[0, 0xFF])),
            (Some(3_000_000), Some("2"), Some(Direction::Tx), frame(0x18FE_F1FE, true, DATA, &[7])),
            (Some(4_000_000), Some("1"), Some(Direction::Tx), remote(0x701, 0)),
            (Some(5_000_000), Some("1"), Some(Direction::Tx), remote(0x701, 1)),
            (Some(6_000_000), Some("1"), None, frame(0, false, FrameKind::Error, &[])),
            (
                Some(8_000_000),
                Some("1"),
                Some(Direction::Rx),
                frame(0x123, false, FD, &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]),
            ),
            (Some(9_000_000), Some("1"), Some(Direction::Tx), standard(0x123, &[0xAA])),
        ],
    );
    expect(
        "base dec  timestamps absolute\n0.5 1  385  Rx d 3 0 255 16\n",
        &[(Some(500_000_000), Some("1"), Some(Direction::Rx), standard(0x181, &[0, 255, 16]))],
    );
}

#[test]
fn peak_trc_of_every_version() {
    let rx = Some(Direction::Rx);
    let twelve = frame(0x123, false, FD, &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]);
    expect(
        ";$FILEVERSION=1.0\n     1)  1841  0001  8  00 00 00 00 00 00 00 01\n     2)  1842 18EFC034  1  7F\n",
        &[
            (Some(1_841_000_000), None, None, standard(1, &[0, 0, 0, 0, 0, 0, 0, 1])),
            (Some(1_842_000_000), None, None, frame(0x18EF_C034, true, DATA, &[0x7F])),
        ],
    );
    expect(
        ";$FILEVERSION=1.1\n     6)       234.7  Rx         070A  1  RTR\n     7)       236.3  Tx         070A  1  85 \n",
        &[
            (Some(234_700_000), None, rx, remote(0x70A, 1)),
            (Some(236_300_000), None, Some(Direction::Tx), standard(0x70A, &[0x85])),
        ],
    );
    expect(
        ";$FILEVERSION=1.3\n     1)   1059.900 2  Rx   0300 -  2    00 01\n",
        &[(Some(1_059_900_000), Some("2"), rx, standard(0x300, &[0, 1]))],
    );
    expect(
        ";$FILEVERSION=2.0\n;$COLUMNS=N,O,T,I,d,l,D\n  1  1059.900 DT  0300 Rx 2  00 01\n\
         \x20 2 1060.1 RR 0701 Rx 1\n 3 1061 FB 0123 Rx 12 00 01 02 03 04 05 06 07 08 09 0A 0B\n",
        &[
            (Some(1_059_900_000), None, rx, standard(0x300, &[0, 1])),
            (Some(1_060_100_000), None, rx, remote(0x701, 1)),
            (Some(1_061_000_000), None, rx, twelve),
        ],
    );
    expect(
        ";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n  1  1059.900 DT 1 0300 Rx - 2  00 01\n\
         \x20 2  1060.100 ER 2 - Rx - 4  04 00 02 00\n\
         \x20 3 1061 FB 1 0123 Rx - 9 00 01 02 03 04 05 06 07 08 09 0A 0B\n",
        &[
            (Some(1_059_900_000), Some("1"), rx, standard(0x300, &[0, 1])),
            (Some(1_060_100_000), Some("2"), rx, frame(0, false, FrameKind::Error, &[4, 0, 2, 0])),
            (Some(1_061_000_000), Some("1"), rx, twelve),
        ],
    );
    let (_, frames, damage) =
        read(b";$FILEVERSION=1.1\n     1)       1.0  Warng      FFFFFFFF  4  00 00 00 08  BUSHEAVY\n");
    assert_eq!((frames.len(), damage.len()), (0, 1));
    assert!(damage[0].starts_with("line 2: a report of the hardware, no frame of the bus"), "{damage:?}");
}

/// Version 1.0 marks an error within its line, and a warning by its identifier.
#[test]
fn errors_of_the_oldest_peak_trc() {
    let (_, frames, damage) = read(
        b";$FILEVERSION=1.0\n     1)  1842  0008  4  ERROR 00 19 08 08\n     2)  1843  FFFFFFFF  4  00 00 00 04 BUSLIGHT\n",
    );
    let frames: Vec<_> = frames.iter().map(|(_, record)| record.frame).collect();
    assert_eq!(frames, [frame(8, false, FrameKind::Error, &[0, 0x19, 8, 8])]);
    assert_eq!(damage.len(), 1);
    assert!(damage[0].starts_with("line 3: a report of the hardware, no frame of the bus"), "{damage:?}");
}

/// What was no frame vanished, but for what did not look like anything.
#[test]
fn an_asc_line_gives_a_frame_or_is_reported_unless_it_is_about_the_recording() {
    let log = "date Sam Sep 30 15:06:13.191 2017\nbase hex  timestamps absolute\ninternal events logged\n\
               // version 9.0.0\n;  time  can ident\nBegin Triggerblock Sam Sep 30 15:06:13.191 2017\n\
               0.000000 Start of measurement\n\
               0.000010 log trigger event\n\
               0.015991 CAN 1 Status:chip status error passive - TxErr: 132 RxErr: 0\n\
               1.015991 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%\n\
               2.501000 1 ErrorFrame\n\
               2.501010 1 ErrorFrame ECC: 10100010\n\
               2.501020 2 ErrorFrame Flags = 0xe CodeExt = 0x20a2 Code = 0x82 ID = 0 DLC = 0 Position = 5 Length = 11300\n\
               2.501030 1 ErrorFrame ECC: 102\n\
               2.6 1  OverloadFrame\n\
               3.297743 1  J1939TP FEE3p        6    0  0   -   Rx   d 23 A0 0F\n\
               4.0 L1  0x20  Rx 8 00 00 00 00 00 00 00 00\n\
               4.1 ETH 1 Rx 4e:FFFFFFFFFFFF\n\
               30.806898 CANFD   5 Tx ErrorFrame Not Acknowledge error, dominant error flag fffe c7\n\
               End TriggerBlock\n";
    let (_, frames, damage) = read(log.as_bytes());
    let error = |data: &[u8]| frame(0, false, FrameKind::Error, data);
    let frames: Vec<_> = frames.iter().map(|(_, record)| record.frame).collect();
    assert_eq!(frames, [error(&[]), error(&[0b1010_0010]), error(&[]), error(&[])]);
    let reasons: Vec<_> = damage.iter().map(|damage| damage.rsplit_once(": \"").unwrap().0).collect();
    assert_eq!(
        reasons,
        [
            "line 9: a status of the controller, no frame of the bus",
            "line 14: 8 binary digits expected behind ECC:",
            "line 15: an overload frame, which carries nothing",
            "line 16: an event that is no frame of a CAN bus",
            "line 17: an event that is no frame of a CAN bus",
            "line 18: an event that is no frame of a CAN bus",
        ]
    );
}

#[test]
fn column_texts() {
    expect(
        "ASCII Trace IXXAT Automation GmbH  Version: 1.3\nDate: 24.11.2010\nBaudrate: 500 kbit/s\n\
         \"Time\",\"Identifier (hex)\",\"Format\",\"Flags\",\"Data (hex)\"\n\
         \"00:00:01.500\",\"181\",\"Std\",\"\",\"00 FF\"\n\
         \"00:00:01.600\",\"18FEF1FE\",\"Ext\",\"\",\"\"\n\
         \"00:00:01.700\",\"701\",\"Std\",\"rtr\",\"\"\n",
        &[
            (Some(1_500_000_000), None, None, standard(0x181, &[0, 0xFF])),
            (Some(1_600_000_000), None, None, frame(0x18FE_F1FE, true, DATA, &[])),
            (Some(1_700_000_000), None, None, remote(0x701, 0)),
        ],
    );
    expect(
        "CAN1  67F Tx SD  8  2F 03 10 00 FF 00 00 00\n",
        &[(None, Some("CAN1"), Some(Direction::Tx), standard(0x67F, &[0x2F, 3, 0x10, 0, 0xFF, 0, 0, 0]))],
    );
}

/// Found by fuzzing: a length of CAN FD on a frame that is none.
#[test]
fn a_remote_frame_of_12_bytes_is_damage() {
    let good = "  can0  123   [8]  remote request\n";
    let (_, frames, damage) = read(format!("{good}  can0  123  [12]  remote request 05 06\n").as_bytes());
    assert_eq!(frames.len(), 1);
    let [damage] = &damage[..] else { panic!("{damage:?}") };
    assert!(damage.starts_with("line 2: more bytes than such a frame has"), "{damage}");
}

/// A time whose nanoseconds do not fit 64 bits, in the form that is read fast.
#[test]
fn a_time_too_late_to_be_one_is_damage() {
    let text = "(1754539247.539624) can0 3FF#0200010000000200\n(9754539247.637690) can0 1FF#E40D\n\
                (9223372036.999999) can0 1FF#E40D\n";
    let (_, frames, damage) = read(text.as_bytes());
    assert_eq!((frames.len(), damage.len()), (1, 2), "{damage:?}");
    assert!(damage[0].starts_with("line 2: a time in brackets expected"), "{damage:?}");
}

#[test]
fn damaged_lines_are_reported_with_their_number() {
    let long = "x".repeat(600_000);
    let text = format!(
        "can0  581   [8]  4B 41\n\ncan0  701   [1]  05\ncan0 18C#500\ncan0 FFF#\n(x) can0 123#\n{long}\n\
         can0  701   [1]  05 7F\ncan0  1234   [0]\nhello\ncan0  701   [9]  00"
    );
    let (format, frames, damage) = read(text.as_bytes());
    assert_eq!((format, frames.len()), (Format::Candump, 1));
    assert_eq!(
        damage,
        [
            "line 1: fewer bytes than the length in brackets says: \"can0  581   [8]  4B 41\"",
            "line 4: up to 8 bytes in hex expected after #: \"can0 18C#500\"",
            "line 5: an identifier of 3 or 8 hex digits expected: \"can0 FFF#\"",
            "line 6: a time in brackets expected: \"(x) can0 123#\"",
            "line 7: a line of more than 65,536 bytes",
            "line 8: more bytes than the length in brackets says: \"can0  701   [1]  05 7F\"",
            "line 9: an identifier of 3 or 8 hex digits expected: \"can0  1234   [0]\"",
            "line 10: no frame: an identifier and a length in brackets expected: \"hello\"",
            "line 11: a length of 0 to 8 expected in the brackets: \"can0  701   [9]  00\"",
        ]
    );
}

fn samples() -> Vec<Record> {
    let at = |nanos, direction, frame| {
        let mut record = Record::new(frame);
        record.time = Some(Time(nanos));
        record.direction = direction;
        record
    };
    let rx = Some(Direction::Rx);
    vec![
        at(0, rx, standard(0, &[1, 0])),
        at(1_682_489_978_627_243_000, rx, standard(0x581, &[0x4B, 0x41, 0x60, 0, 0x18, 2, 0x8F, 0xAF])),
        at(1_682_489_978_627_243_001, Some(Direction::Tx), frame(0x1FFF_FFFF, true, DATA, &[0xFF; 8])),
        at(1_682_489_979_000_000_000, rx, remote(0x701, 1)),
        at(1_682_489_979_000_000_000, rx, frame(0x7FF, false, FD, &[0x5A; 64])),
        at(1_682_489_980_000_000_000, rx, frame(4, false, FrameKind::Error, &[0, 4, 0, 0, 0, 0, 0, 0])),
        at(1_682_489_981_000_000_000, rx, frame(0, false, FrameKind::Error, &[0b1010_0010])),
    ]
}

#[test]
fn what_is_written_reads_back() {
    for format in [WriteFormat::Candump, WriteFormat::Asc, WriteFormat::Trc, WriteFormat::PcapNg] {
        let mut writer = Writer::new(Vec::new(), format);
        for (at, record) in samples().iter().enumerate() {
            writer.write(record, Some(if at % 2 == 0 { "can0" } else { "can1" })).unwrap();
        }
        let content = writer.finish().unwrap();
        let (_, frames, damage) = read(&content);
        assert_eq!(damage, Vec::<String>::new(), "{format:?}");
        let keeps_direction = matches!(format, WriteFormat::Asc | WriteFormat::Trc);
        for ((bus, read), written) in frames.iter().zip(&samples()) {
            assert_eq!(read.time, written.time, "{format:?}");
            // `.asc` knows of an error only that there was one, and Vector's code of it.
            if written.frame.kind == FrameKind::Error && format == WriteFormat::Asc {
                let code = if written.frame.len() == 1 { written.frame.data() } else { &[] };
                assert_eq!(read.frame, frame(0, false, FrameKind::Error, code));
                continue;
            }
            assert_eq!(read.frame, written.frame, "{format:?}");
            assert!(!keeps_direction || read.direction == written.direction, "{format:?}");
            assert!(bus.is_some());
        }
        assert_eq!(frames.len(), samples().len(), "{format:?}");
    }
}

#[test]
fn sent_frames_of_cooked_captures_are_told_from_their_copies() {
    // pcap, nanoseconds, little-endian, link type 113.
    let mut file = vec![0x4D, 0x3C, 0xB2, 0xA1, 2, 0, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 4, 0, 113, 0, 0, 0];
    let mut packet = |micros: u32, kind: u8, id: [u8; 4], byte: u8| {
        file.extend(1_u32.to_le_bytes());
        file.extend((micros * 1000).to_le_bytes());
        file.extend(32_u32.to_le_bytes());
        file.extend(32_u32.to_le_bytes());
        file.extend([0, kind, 0x01, 0x18, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x0C]);
        file.extend(id);
        file.extend([1, 0, 0, 0, byte, 0, 0, 0, 0, 0, 0, 0]);
    };
    let heartbeat = [1, 7, 0, 0];
    packet(0, 4, heartbeat, 5); // the copy of the next but one
    packet(1, 1, [2, 7, 0, 0], 5); // heard from elsewhere
    packet(2, 1, heartbeat, 5);
    packet(3, 1, [3, 7, 0, 0], 5); // heard first, its copy follows
    packet(4, 4, [3, 7, 0, 0], 5);
    packet(5, 4, [4, 7, 0, 0], 5); // sent, with no second copy
    packet(6, 0, [5, 7, 0, 0], 5);
    packet(7, 0, [0, 0, 1, 0x81], 5); // 181h big-endian; the identifiers before it were little-endian
    packet(8, 4, [0, 0, 7, 6], 5); // a big-endian identifier, which can be read one way only
    let (_, frames, damage) = read(&file);
    assert_eq!(damage, Vec::<String>::new());
    let seen: Vec<_> = frames.iter().map(|(_, record)| (record.frame.id, record.loopback)).collect();
    assert_eq!(
        seen,
        [
            (0x701, true),
            (0x702, false),
            (0x701, false),
            (0x703, false),
            (0x703, true),
            (0x704, false),
            (0x705, false),
            (0x0101_0000, false),
            (0x706, false)
        ]
    );
    file.truncate(file.len() - 20);
    let (_, frames, damage) = read(&file);
    assert_eq!(frames.len(), 8);
    assert_eq!(damage, ["packet 9: the file ends inside a packet"]);
}

/// Every file of the recorded data: what comes in comes out, as a frame or as a report.
#[test]
fn recorded_files_lose_nothing() {
    let recorded = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/recorded");
    if !recorded.is_dir() {
        println!("ignored: needs ../shared/recorded");
        return;
    }
    let mut files: Vec<_> = ["can", "threads"]
        .iter()
        .flat_map(|folder| std::fs::read_dir(recorded.join(folder)).expect("a folder"))
        .map(|entry| entry.expect("an entry").path())
        .collect();
    files.sort();
    assert!(!files.is_empty());
    for path in files {
        let content = std::fs::read(&path).expect("a file");
        let (format, frames, damage) = read(&content);
        // Counted without the reader: lines that are neither blank nor comment, packet blocks.
        let expected = if format == Format::Pcap {
            packet_blocks(&content)
        } else {
            let text = String::from_utf8_lossy(&content);
            text.lines()
                .map(str::trim)
                .filter(|line| !line.is_empty() && !line.starts_with(['#', ';']))
                .count()
        };
        println!(
            "{}: {expected} in, {} frames, {} reported",
            path.file_name().unwrap_or_default().display(),
            frames.len(),
            damage.len()
        );
        assert_eq!(expected, frames.len() + damage.len(), "{}: {damage:?}", path.display());
        assert!(damage.len() <= 1, "{damage:?}");
    }
}

fn packet_blocks(mut file: &[u8]) -> usize {
    let mut count = 0;
    while let Some((head, _)) = file.split_first_chunk::<8>() {
        let [a, b, c, d, rest @ ..] = *head;
        count += usize::from([a, b, c, d] == [6, 0, 0, 0]);
        file = &file[u32::from_le_bytes(rest) as usize..];
    }
    count
}

/// What the times of a capture are since.
fn times(content: &str) -> Times {
    let Capture::Can(mut reader) = open(content.as_bytes()).unwrap() else { panic!("{content}") };
    while reader.next().unwrap().is_some() {}
    reader.times()
}

#[test]
fn differences_are_told_from_times() {
    let screen = |times: &[&str]| -> String {
        times.iter().map(|time| format!(" ({time})  can0  080   [0]\n")).collect()
    };
    for (text, expected) in [
        // candump -td, -tz, -ta; an excerpt; one frame of another bus read late.
        (screen(&["000.000000", "000.009000", "000.001000", "000.010000"]), Times::Deltas),
        (screen(&["000.000000", "000.009000", "000.010000", "000.010000"]), Times::Absolute),
        (screen(&["1436509052.249713", "1436509052.249714"]), Times::Absolute),
        (screen(&["000.304418", "000.304952", "543.665902"]), Times::Absolute),
        (screen(&["1.0", "1.1", "1.2", "1.3", "1.4", "1.39999", "1.5", "1.6", "1.7"]), Times::Absolute),
        ("base hex  timestamps relative\n 0.5 1 80 Rx d 0\n".into(), Times::Deltas),
        ("base hex  timestamps absolute\n 0.5 1 80 Rx d 0\n".into(), Times::Absolute),
        ("\"Time (rel)\",\"Identifier (hex)\",\"Data (hex)\"\n\"0.5\",\"80\",\"\"\n".into(), Times::Deltas),
        ("\"Time (abs)\",\"Identifier (hex)\",\"Data (hex)\"\n\"0.5\",\"80\",\"\"\n".into(), Times::Absolute),
    ] {
        assert_eq!(times(&text), expected, "{text}");
    }
}

/// Found by fuzzing: eight digits without the flag of an error frame made an error report extended.
#[test]
fn an_error_report_has_no_identifier_of_29_bits() {
    let line = "  can0  00200004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME\n";
    let content = frame(0x20_0004, false, FrameKind::Error, &[0, 4, 0, 0, 0, 0, 0, 0]);
    expect(line, &[(None, Some("can0"), None, content)]);
    assert_eq!(Frame::new(4, true, FrameKind::Error, &[]), Frame::new(4, false, FrameKind::Error, &[]));
}

/// `0080` behind six bytes was taken for nothing, and a frame of six bytes for the frame.
#[test]
fn what_stands_behind_the_data_of_a_log_line_is_told() {
    let (_, frames, damage) =
        read(b"(1.4) can0 605#230018018501 0080\n(1.5) can0 701#00 T\n(1.6) can0 701#05 # started\n");
    assert_eq!(frames.len(), 2);
    assert_eq!(
        damage,
        ["line 1: R, T or nothing expected behind the data: \"(1.4) can0 605#230018018501 0080\""]
    );
}

/// The first line with it was damage.
#[test]
fn a_byte_order_mark_before_lb2_hex_text_is_no_damage() {
    let content = b"\xEF\xBB\xBF82 96 02 40 42\n";
    let Capture::Lb2(mut reader) = open(&content[..]).unwrap() else { panic!("CAN") };
    let first = reader.next().unwrap();
    assert!(matches!(first, Some(Chunk::Bytes { bytes: [0x82, 0x96, 2, 0x40, 0x42], .. })), "{first:?}");
    assert!(reader.next().unwrap().is_none());
}

/// Nothing behind the first 400 lines was looked at.
#[test]
fn a_log_behind_many_lines_of_comment_is_recognised() {
    let comment = "# a note\n".repeat(1000);
    let (format, frames, _) = read(format!("{comment}(1.0) can0 701#05\n").as_bytes());
    assert_eq!((format, frames.len()), (Format::Candump, 1));
}

/// Each of these lines was taken for nothing, or for the first of its frames.
#[test]
fn frames_are_not_lost_among_what_looks_like_something_else() {
    let lost = |content: &[u8]| {
        let (_, frames, damage) = read(content);
        (frames.len(), damage.len())
    };
    assert_eq!(lost(b"(1.0) can0 701#00\r(2.0) can0 702#00\r(3.0) can0 703#00\n(4.0) can0 704#00\n"), (1, 1));
    assert_eq!(
        lost(b"base hex timestamps absolute\n 0.1 1 701 Rx d 1 00\r 0.2 1 702 Rx d 1 00\r\n 0.3 1 703 Rx d 1 00\r\n"),
        (1, 1)
    );
    // Behind an error report a line that begins with a tab explains it, unless it is a frame.
    assert_eq!(lost(b"(1.0) can0 20000004#0000000000000000\n\tbus-off\n(3.0) can0 702#00\n"), (2, 0));
    assert_eq!(
        lost(b"(1.0) can0 20000004#0000000000000000\n\t(2.0) can0 701#00\n(3.0) can0 702#00\n"),
        (3, 0)
    );
    // Buses with names that a preamble could begin with.
    assert_eq!(lost(b"CAN1  701 Rx SD  1  00\nBus2  702 Rx SD  1  00\nController3 703 Rx SD 1 00\n"), (3, 0));
}

/// A block of a pcapng file, little endian.
fn block(kind: u32, body: &[u8]) -> Vec<u8> {
    let total = (12 + body.len() as u32).to_le_bytes();
    [&kind.to_le_bytes()[..], &total, body, &total].concat()
}

/// An interface of link type 227 with options, each of a code and up to 4 bytes.
fn interface(options: &[(u16, &[u8])]) -> Vec<u8> {
    let mut body = vec![227, 0, 0, 0, 0, 0, 0, 0];
    for (code, value) in options {
        body.extend_from_slice(&code.to_le_bytes());
        body.extend_from_slice(&(value.len() as u16).to_le_bytes());
        body.extend_from_slice(value);
        body.resize(body.len().next_multiple_of(4), 0);
    }
    block(1, &body)
}

/// A packet block with one byte of identifier `id`.
fn packet(kind: u32, interface: u32, id: u8) -> Vec<u8> {
    let frame = [0, 0, 0, id, 1, 0, 0, 0, 0xAA, 0, 0, 0];
    let words = [interface, 0, 1_000_000, 9, 9];
    let head: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    block(kind, &[&head[..], &frame].concat())
}

/// Frames of the obsolete packet block were skipped; an interface with an odd resolution gave its number to
/// the next one; interfaces without a name were one bus.
#[test]
fn interfaces_of_pcapng_are_told_apart_whatever_they_lack() {
    let section =
        block(0x0A0D_0D0A, &[&0x1A2B_3C4D_u32.to_le_bytes()[..], &[1, 0, 0, 0], &[0xFF; 8]].concat());
    let file = [
        section,
        interface(&[(2, b"canA"), (9, &[0xC0])]),
        interface(&[(2, b"canB")]),
        interface(&[]),
        packet(6, 1, 1),
        packet(2, 0, 2),
        packet(6, 2, 3),
    ]
    .concat();
    let (_, frames, damage) = read(&file);
    assert_eq!(damage, Vec::<String>::new());
    let seen: Vec<_> = frames
        .iter()
        .map(|(bus, record)| (record.frame.id, bus.as_deref(), record.time.map(|time| time.0)))
        .collect();
    assert_eq!(
        seen,
        [
            (1, Some("canB"), Some(1_000_000_000)),
            (2, Some("canA"), None),
            (3, Some("interface 2"), Some(1_000_000_000)),
        ]
    );
}
