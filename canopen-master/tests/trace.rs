//! The passive decoder on scripted traffic.
#![cfg(feature = "alloc")]

use core::time::Duration;

use canopen_master::nmt::{Command, State};
use canopen_master::sdo::AbortCode;
use canopen_master::trace::{
    Content, Direction, Kind, Lss, Mode, Outcome, PdoDirection, ShortFrame, Tracer, Transfer, Way, WrongCrc,
};
use canopen_master::{Address, Frame, NodeId, lss};
use embedded_can::StandardId;

/// A frame as candump's log has it: `601#4041600000000000`, `701#R`.
fn frame(text: &str) -> Frame {
    let (id, data) = text.split_once('#').unwrap();
    let id = StandardId::new(u16::from_str_radix(id, 16).unwrap()).unwrap();
    if data.starts_with('R') {
        return Frame::remote_frame(id, 1).unwrap();
    }
    let data: Vec<u8> = data
        .as_bytes()
        .chunks(2)
        .map(|byte| u8::from_str_radix(str::from_utf8(byte).unwrap(), 16).unwrap())
        .collect();
    Frame::data_frame(id, &data).unwrap()
}

fn node(raw: u8) -> NodeId {
    NodeId::new(raw).unwrap()
}

/// Plays frames 1 ms apart on one bus.
struct Script {
    tracer: Tracer,
    now: Duration,
}

impl Script {
    fn new() -> Self {
        Self { tracer: Tracer::new(), now: Duration::ZERO }
    }

    fn hear(&mut self, text: &str) -> Kind {
        self.now += Duration::from_millis(1);
        self.tracer.handle_frame(Some(self.now), 0, &frame(text))
    }

    /// Plays frames; what has ended.
    fn play(&mut self, frames: &[&str]) -> Vec<Transfer> {
        for text in frames {
            self.hear(text);
        }
        core::iter::from_fn(|| self.tracer.poll_event()).collect()
    }

    fn finish(&mut self) -> Vec<Transfer> {
        self.tracer.finish();
        core::iter::from_fn(|| self.tracer.poll_event()).collect()
    }
}

/// Direction, mode, object, data, outcome, frames.
fn told(transfer: &Transfer) -> (Direction, Mode, Address, &[u8], Outcome, u64) {
    assert_eq!(transfer.size, transfer.data.len() as u64);
    (transfer.direction, transfer.mode, transfer.at, &transfer.data, transfer.outcome, transfer.frames)
}

const STATUS: Address = Address::new(0x6041, 0);
const STORE: Address = Address::new(0x2000, 1);

#[test]
fn expedited_transfers() {
    let ended = Script::new().play(&[
        "601#40416000DEADBEEF",
        "581#4B41600018028FAF",
        "601#2B40600006000000",
        "581#6040600000000000",
        "601#2240600006000000",
        "581#6040600000000000",
    ]);
    assert_eq!(ended.len(), 3);
    assert_eq!(
        told(&ended[0]),
        (Direction::Upload, Mode::Expedited, STATUS, &[0x18, 0x02][..], Outcome::Done, 2)
    );
    assert_eq!(
        (ended[0].began, ended[0].ended),
        (Some(Duration::from_millis(1)), Some(Duration::from_millis(2)))
    );
    assert_eq!(ended[1].data, [6, 0]);
    assert_eq!(ended[2].data, [6, 0, 0, 0], "a size that is not indicated is 4");
}

#[test]
fn segments_of_several_nodes_interleaved() {
    let ended = Script::new().play(&[
        "601#4000200100000000",
        "602#2100200109000000",
        "581#4100200109000000",
        "582#6000200100000000",
        "601#6000000000000000",
        "602#0031323334353637",
        "581#0041424344454647",
        "582#2000000000000000",
        "601#7000000000000000",
        "602#1B38390000000000",
        "581#1B48490000000000",
        "582#3000000000000000",
    ]);
    let ended: Vec<_> = ended.iter().map(|transfer| (transfer.node.raw(), told(transfer))).collect();
    assert_eq!(
        ended,
        [
            (1, (Direction::Upload, Mode::Segmented, STORE, &b"ABCDEFGHI"[..], Outcome::Done, 6)),
            (2, (Direction::Download, Mode::Segmented, STORE, &b"123456789"[..], Outcome::Done, 6)),
        ]
    );
}

#[test]
fn a_segment_sent_twice_counts_once() {
    let ended = Script::new().play(&[
        "602#2100200109000000",
        "582#6000200100000000",
        "602#0031323334353637",
        "602#0031323334353637",
        "582#2000000000000000",
        "582#2000000000000000",
        "602#1B38390000000000",
        "582#3000000000000000",
    ]);
    assert_eq!(ended[0].data, b"123456789");
    assert_eq!(ended[0].outcome, Outcome::Done);
}

#[test]
fn block_download_with_lost_segments() {
    // Sub-blocks of 4; the second segment is lost and comes again with the third.
    let ended = Script::new().play(&[
        "601#C60020010F000000",
        "581#A400200104000000",
        "601#0131323334353637",
        "601#0241414141414141",
        "601#0342424242424242",
        "581#A201040000000000",
        "601#0138394041424344",
        "601#8245000000000000",
        "581#A202040000000000",
        "601#D90F780000000000",
        "581#A100000000000000",
    ]);
    assert_eq!(ended.len(), 1);
    assert_eq!(
        told(&ended[0]),
        (
            Direction::Download,
            Mode::Block,
            STORE,
            &b"123456789\x40\x41\x42\x43\x44\x45"[..],
            Outcome::Done,
            11
        )
    );
    assert_eq!(ended[0].wrong_crc, None, "segments that come again count once");
}

#[test]
fn block_upload() {
    let mut script = Script::new();
    let ended = script.play(&["601#A400200104000000", "581#C400200100000000", "601#A300000000000000"]);
    assert_eq!(ended, []);
    match script.hear("581#4041424344454647") {
        Kind::SdoResponse(frame) => {
            assert!(matches!(frame.content, Content::Segment(segment) if segment.sequence == 0x40));
        }
        other => panic!("{other:?}"),
    }
    let mut script = Script::new();
    let ended = script.play(&[
        "601#A400200104000000",
        "581#C400200100000000",
        "601#A300000000000000",
        "581#0131323334353637",
        "581#8238390000000000",
        "601#A202040000000000",
        "581#D500000000000000",
        "601#A100000000000000",
    ]);
    assert_eq!(told(&ended[0]), (Direction::Upload, Mode::Block, STORE, &b"123456789"[..], Outcome::Done, 8));
}

/// CiA 301, 7.2.4.3.16: 31C3h is that of "123456789".
#[test]
fn a_wrong_crc_is_seen_where_both_sides_agreed_on_one_and_all_was_heard() {
    let upload = |client: &str, server: &str, end: &str| {
        let [client, server, end] =
            [(0x601, client), (0x581, server), (0x581, end)].map(|(id, data)| format!("{id:X}#{data}"));
        let ended = Script::new().play(&[
            &client,
            &server,
            "601#A300000000000000",
            "581#0131323334353637",
            "581#8238390000000000",
            "601#A202040000000000",
            &end,
            "601#A100000000000000",
        ]);
        assert_eq!((&ended[0].data[..], ended[0].outcome), (&b"123456789"[..], Outcome::Done));
        ended[0].wrong_crc
    };
    let (with, without) = ("A400200104000000", "A000200104000000");
    let (agreed, refused) = ("C400200100000000", "C000200100000000");
    let wrong = Some(WrongCrc { found: 0x31C4, computed: 0x31C3 });
    assert_eq!(upload(with, agreed, "D5C3310000000000"), None);
    assert_eq!(upload(with, agreed, "D5C4310000000000"), wrong);
    assert_eq!(upload(with, refused, "D5C4310000000000"), None);
    assert_eq!(upload(without, agreed, "D5C4310000000000"), None);

    let download = [
        "601#C400200100000000",
        "581#A400200104000000",
        "601#0131323334353637",
        "601#8238390000000000",
        "581#A202040000000000",
        "601#D5C4310000000000",
        "581#8000200104000405",
    ];
    let ended = Script::new().play(&download);
    assert_eq!(
        (ended[0].wrong_crc, ended[0].outcome),
        (wrong, Outcome::Aborted { by: Way::Response, code: AbortCode::CRC })
    );
    // Without one of its segments or its acknowledge in the capture nobody knows.
    for missing in 2..=4 {
        let mut heard = download.to_vec();
        heard.remove(missing);
        assert_eq!(Script::new().play(&heard)[0].wrong_crc, None, "without {}", download[missing]);
    }
}

#[test]
fn a_size_that_is_not_the_one_announced_is_seen() {
    let misannounced = |frames: &[&str]| {
        let ended = Script::new().play(frames);
        assert_eq!((ended.len(), ended[0].size, ended[0].is_done()), (1, 9, true), "{ended:?}");
        ended[0].misannounced()
    };
    // 9 announced, 15 announced, nothing announced.
    for (size, expected) in [(Some("09"), None), (Some("0F"), Some(15)), (None, None)] {
        let begins = |id: &str, command: u8, sized: u8| match size {
            Some(size) => format!("{id}#{:02X}002001{size}000000", command | sized),
            None => format!("{id}#{command:02X}00200100000000"),
        };
        let uploaded = [
            "601#4000200100000000",
            &begins("581", 0x40, 1),
            "601#6000000000000000",
            "581#0031323334353637",
            "601#7000000000000000",
            "581#1B38390000000000",
        ];
        assert_eq!(misannounced(&uploaded), expected, "{uploaded:?}");
        let downloaded = [
            &begins("601", 0x20, 1),
            "581#6000200100000000",
            "601#0031323334353637",
            "581#2000000000000000",
            "601#1B38390000000000",
            "581#3000000000000000",
        ];
        assert_eq!(misannounced(&downloaded), expected, "{downloaded:?}");
        let block_uploaded = [
            "601#A000200104000000",
            &begins("581", 0xC0, 2),
            "601#A300000000000000",
            "581#0131323334353637",
            "581#8238390000000000",
            "601#A202040000000000",
            "581#D500000000000000",
            "601#A100000000000000",
        ];
        assert_eq!(misannounced(&block_uploaded), expected, "{block_uploaded:?}");
        let block_downloaded = [
            &begins("601", 0xC0, 2),
            "581#A000200104000000",
            "601#0131323334353637",
            "601#8238390000000000",
            "581#A202040000000000",
            "601#D500000000000000",
            "581#A100000000000000",
        ];
        assert_eq!(misannounced(&block_downloaded), expected, "{block_downloaded:?}");
    }
}

/// CiA 301, 7.2.4.3: SDO frames have 8 bytes.
#[test]
fn a_short_frame_is_taken_and_marked() {
    let ended = Script::new().play(&[
        "605#4000100000",
        "585#4F00100007",
        "605#4000100000000000",
        "585#43001000920102",
        "585#4300100092010200",
        "605#4000100000000000",
        "585#4F00100007",
    ]);
    let ended: Vec<_> = ended.iter().map(|transfer| (&transfer.data[..], transfer.short)).collect();
    assert_eq!(
        ended,
        [
            (&[7][..], Some(ShortFrame { way: Way::Request, len: 5 })),
            (&[0x92, 1, 2, 0], None),
            (&[7], Some(ShortFrame { way: Way::Response, len: 5 })),
        ]
    );
}

#[test]
fn a_block_upload_answered_as_a_plain_one() {
    let ended = Script::new().play(&["601#A400200104050000", "581#4300200101020304"]);
    assert_eq!(
        told(&ended[0]),
        (Direction::Upload, Mode::Expedited, STORE, &[1, 2, 3, 4][..], Outcome::Done, 2)
    );
}

#[test]
fn segments_missing_in_the_capture_make_a_transfer_incomplete_and_end_its_data() {
    let ended = Script::new().play(&[
        "601#C200200115000000",
        "581#A000200104000000",
        "601#0131323334353637",
        "601#8341424344454647",
        "581#A203040000000000",
        "601#0151525354555657",
        "601#8261626364656667",
        "581#A202040000000000",
        "601#C100000000000000",
        "581#A100000000000000",
    ]);
    assert_eq!((ended.len(), ended[0].outcome, ended[0].lacking), (1, Outcome::Incomplete, true));
    assert_eq!((&ended[0].data[..], ended[0].size), (&b"1234567"[..], 7));
}

#[test]
fn aborts() {
    let ended = Script::new().play(&[
        "601#4018100500000000",
        "581#8018100511000906",
        "601#4018100500000000",
        "601#8018100500000405",
        "581#8018100500000405", // nothing is open
        "601#4018100500000000",
        "581#8041600000000405", // of another object
        "581#8000000011000906", // of an object the server cannot tell
    ]);
    let outcomes: Vec<_> = ended.iter().map(|transfer| (transfer.outcome, transfer.frames)).collect();
    assert_eq!(
        outcomes,
        [
            (Outcome::Aborted { by: Way::Response, code: AbortCode::NO_SUB_INDEX }, 2),
            (Outcome::Aborted { by: Way::Request, code: AbortCode::TIMED_OUT }, 2),
            (Outcome::Aborted { by: Way::Response, code: AbortCode::NO_SUB_INDEX }, 2),
        ]
    );
}

#[test]
fn what_is_not_answered_is_incomplete() {
    let mut script = Script::new();
    let ended = script.play(&[
        "581#4B41600018020000", // its request came before the capture
        "67D#2B300050005A5A00",
        "67D#2B300050005A5A00",
        "5FD#6030005000000000",
        "5FD#6030005000000000",
        "601#4041600000000000",
    ]);
    let ended: Vec<_> = ended.iter().map(|transfer| (transfer.outcome, transfer.frames)).collect();
    assert_eq!(ended, [(Outcome::Incomplete, 1), (Outcome::Done, 2)]);
    let open = script.finish();
    assert_eq!(told(&open[0]), (Direction::Upload, Mode::Expedited, STATUS, &[][..], Outcome::Incomplete, 1));
    assert_eq!(script.finish(), []);
}

#[test]
fn buses_are_apart() {
    let mut tracer = Tracer::new();
    tracer.handle_frame(None, 0, &frame("601#4041600000000000"));
    tracer.handle_frame(None, 1, &frame("581#4B41600018020000"));
    assert_eq!(tracer.poll_event(), None);
    tracer.handle_frame(None, 0, &frame("581#4B41600018020000"));
    assert_eq!(tracer.poll_event().map(|transfer| transfer.outcome), Some(Outcome::Done));
}

#[test]
fn states_and_guarding() {
    let mut script = Script::new();
    let one = node(1);
    assert_eq!(script.hear("701#00"), Kind::BootUp { node: one, before: None });
    assert_eq!(
        script.hear("701#7F"),
        Kind::Heartbeat { node: one, state: Some(State::PreOperational), before: Some(State::BootUp) }
    );
    assert_eq!(script.hear("000#0100"), Kind::Nmt { command: Some(Command::Start), target: 0 });
    assert_eq!(script.tracer.state(0, one), Some(State::Operational));
    assert_eq!(script.hear("701#R"), Kind::GuardRequest { node: one, unanswered: false });
    let reply = |toggle, wrong_toggle, before| Kind::GuardReply {
        node: one,
        toggle,
        wrong_toggle,
        state: Some(State::Operational),
        before: Some(before),
    };
    // Shown before, not told since.
    assert_eq!(script.hear("701#05"), reply(false, false, State::PreOperational));
    script.hear("701#R");
    assert_eq!(script.hear("701#85"), reply(true, false, State::Operational));
    script.hear("701#R");
    assert_eq!(script.hear("701#85"), reply(true, true, State::Operational));
    script.hear("701#R");
    assert_eq!(script.hear("701#R"), Kind::GuardRequest { node: one, unanswered: true });
    assert_eq!(script.hear("701#0500"), Kind::Unknown, "two bytes are no state");
    assert_eq!(script.hear("000#81"), Kind::Unknown);
    assert_eq!(script.hear("700#05"), Kind::Unknown, "there is no node 0");
}

#[test]
fn the_other_services() {
    let mut script = Script::new();
    assert_eq!(script.hear("080#"), Kind::Sync { counter: None, interval: None });
    assert_eq!(
        script.hear("080#05"),
        Kind::Sync { counter: Some(5), interval: Some(Duration::from_millis(1)) }
    );
    let Kind::Emcy { node: from, code, register } = script.hear("081#108143") else { panic!() };
    assert_eq!((from, code.map(|code| code.0), register), (node(1), Some(0x8110), Some(0x43)));
    assert!(matches!(script.hear("081#"), Kind::Emcy { code: None, register: None, .. }));
    let Kind::Time(Some(time)) = script.hear("100#0100000002000000") else { panic!() };
    assert_eq!((time.ms(), time.days()), (1, 2));
    assert_eq!(
        script.hear("7E5#0401000000000000"),
        Kind::Lss(Lss::Request(Some(lss::Request::SwitchGlobal(lss::Mode::Configuration))))
    );
    assert_eq!(
        script.hear("7E4#4F00000000000000"),
        Kind::Lss(Lss::Response(Some(lss::Response::Identified)))
    );
    assert_eq!(script.hear("101#01"), Kind::Unknown);
    assert_eq!(script.hear("081#R"), Kind::Unknown);
    script.tracer.set_can_link(true);
    let link = script.tracer.handle_frame(None, 7, &frame("10E#01"));
    assert_eq!(link, Kind::CanLink { channel: 14 });
}

#[test]
fn pdos_follow_the_traffic() {
    let mut script = Script::new();
    let pdo = |number, direction| Kind::Pdo { node: node(1), direction, number };
    let first = pdo(1, PdoDirection::Transmit);
    assert_eq!(script.hear("181#3706"), first);
    assert_eq!(script.tracer.mapped(0, &first, &[0x37, 0x06]).count(), 0);
    script.play(&[
        "601#2F001A0000000000",
        "581#60001A0000000000",
        "601#23001A0110004160",
        "581#60001A0100000000",
        "601#23001A0208006160",
        "581#60001A0200000000",
        "601#2F001A0002000000",
        "581#60001A0000000000",
        "601#2300180134010000", // TPDO 1 gets 134h
        "581#6000180100000000",
        "601#2304140135010000", // RPDO 5 gets 135h
        "581#6004140100000000",
    ]);
    assert_eq!(script.hear("134#370601"), first);
    let fields: Vec<_> = script
        .tracer
        .mapped(0, &first, &[0x37, 0x06, 0x01])
        .map(|field| (field.object.index, field.object.bits, field.raw))
        .collect();
    assert_eq!(fields, [(0x6041, 16, 0x0637), (0x6061, 8, 1)]);
    assert_eq!(script.hear("135#01"), pdo(5, PdoDirection::Receive));
}

#[test]
fn what_an_eds_says_holds_on_every_bus() {
    let mut tracer = Tracer::new();
    tracer.learn(node(3), Address::new(0x1800, 1), &0x155_u32.to_le_bytes());
    tracer.learn(node(3), Address::new(0x1201, 1), &0x640_u32.to_le_bytes());
    tracer.learn(node(3), Address::new(0x1201, 2), &0x5C0_u32.to_le_bytes());
    let kind = tracer.handle_frame(None, 9, &frame("155#00"));
    assert_eq!(kind, Kind::Pdo { node: node(3), direction: PdoDirection::Transmit, number: 1 });
    // A further SDO channel is its own conversation.
    tracer.handle_frame(None, 9, &frame("603#4041600000000000"));
    tracer.handle_frame(None, 9, &frame("640#4041600000000000"));
    tracer.handle_frame(None, 9, &frame("5C0#4B41600018020000"));
    let ended = tracer.poll_event().unwrap();
    assert_eq!((ended.node, ended.outcome, ended.frames), (node(3), Outcome::Done, 2));
}

#[test]
fn a_copy_has_no_consequences() {
    let mut script = Script::new();
    script.hear("601#4041600000000000");
    let copy = script.tracer.look(0, &frame("581#4B41600018020000"));
    assert!(matches!(copy, Kind::SdoResponse(frame) if frame.at == Some(STATUS)));
    script.hear("701#R");
    assert!(matches!(script.tracer.look(0, &frame("701#05")), Kind::GuardReply { .. }));
    assert!(matches!(script.hear("701#05"), Kind::GuardReply { .. }));
    assert_eq!(script.tracer.poll_event(), None);
}

/// What the first frames of a capture are from the middle of.
#[test]
fn a_transfer_that_began_before_the_capture_is_told_from_there_on() {
    let late = |frames: &[&str]| -> Vec<_> {
        let mut script = Script::new();
        let ended = script.play(frames);
        assert_eq!(script.finish(), []);
        assert!(ended.iter().all(|transfer| transfer.late));
        ended
    };
    let unnamed = Address::new(0, 0);
    let uploaded = late(&[
        "581#0044454647484950",
        "601#7000000000000000",
        "581#1B51520000000000",
        "581#0053545556575859",
    ]);
    assert_eq!(uploaded.len(), 1, "the answer that comes again answers nothing");
    assert_eq!(
        told(&uploaded[0]),
        (Direction::Upload, Mode::Segmented, unnamed, &b"DEFGHIPQR"[..], Outcome::Done, 3)
    );
    let answered = late(&["581#4100200102000000", "601#6000000000000000", "581#0B41420000000000"]);
    assert_eq!(told(&answered[0]), (Direction::Upload, Mode::Segmented, STORE, &b"AB"[..], Outcome::Done, 3));
    let downloaded = late(&[
        "602#1031323334353637",
        "582#3000000000000000",
        "602#0B38390000000000",
        "582#2000000000000000",
    ]);
    assert_eq!(
        told(&downloaded[0]),
        (Direction::Download, Mode::Segmented, unnamed, &b"123456789"[..], Outcome::Done, 4)
    );
    let given_up = late(&["581#0044454647484950", "601#8000200100000405"]);
    assert_eq!(
        told(&given_up[0]),
        (
            Direction::Upload,
            Mode::Segmented,
            STORE,
            &b"DEFGHIP"[..],
            Outcome::Aborted { by: Way::Request, code: AbortCode::TIMED_OUT },
            2
        )
    );
}

/// Its segments look like whatever their numbers look like: 40h like the request of an upload, 60h like one
/// for a segment.
#[test]
fn a_capture_that_begins_inside_a_block_misreads_no_segments() {
    for first in [0x0A, 0x1E, 0x3F, 0x40, 0x41, 0x5E, 0x60, 0x7B] {
        let mut script = Script::new();
        let segment = |at: u8, last: u8| format!("601#{:02X}31323334353637", (first + at) | last);
        let frames: Vec<_> = (0..4).map(|at| segment(at, if at == 3 { 0x80 } else { 0 })).collect();
        let mut ended = script.play(&frames.iter().map(String::as_str).collect::<Vec<_>>());
        let acknowledge = format!("581#A2{:02X}7F0000000000", first + 3);
        ended.extend(script.play(&[&acknowledge, "601#C900000000000000", "581#A100000000000000"]));
        let late: Vec<_> = ended.iter().filter(|transfer| transfer.late).collect();
        assert_eq!(late.len(), 1, "from {first:02X}h: {ended:?}");
        assert_eq!(
            (late[0].direction, late[0].mode, late[0].outcome),
            (Direction::Download, Mode::Block, Outcome::Done)
        );
        assert_eq!(ended.len(), 1, "from {first:02X}h: {ended:?}");
        let again = script.play(&["601#40416000DEADBEEF", "581#4B41600018028FAF"]);
        assert!(again.len() == 1 && !again[0].late);
    }
}

#[test]
fn what_answers_nothing_belongs_to_no_transfer() {
    let mut script = Script::new();
    let belongs = |kind| match kind {
        Kind::SdoRequest(frame) | Kind::SdoResponse(frame) | Kind::SdoAbort(frame) => frame.belongs,
        other => panic!("{other:?}"),
    };
    let heard = [
        ("581#4B41600018020000", false),
        ("581#8041600011000906", false),
        ("601#4041600000000000", true),
        ("581#8041600011000906", true),
        ("581#8041600011000906", false),
        ("581#0041424344454647", false),
    ];
    for (text, expected) in heard {
        assert_eq!(belongs(script.hear(text)), expected, "{text}");
    }
}
