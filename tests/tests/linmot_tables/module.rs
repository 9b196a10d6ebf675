//! 7.1, 7.2 and 7.2.1.1 to 19: the words of every command in both directions, between client and virtual
//! drive, and every status value.

use core::time::Duration;
use std::collections::BTreeSet;

use device_sim::linmot::{Times, VirtualDrive, sg5};
use linmot::client::{Client, Outcome};
use linmot::code::Command;
use linmot::drive::{LoggedError, Module};
use linmot::request::{Access, List, Memory, Request, Value};
use linmot::table::{Entry, ListNumber};
use linmot::upid::{Layer, Upid};

/// Manual B, figure 13.
const INFO: [u32; 18] = [
    0x0003_0046,
    0x0004_000A,
    0x6D61_7845,
    0x5F65_6C70,
    0x7672_7543,
    0x65,
    0,
    0x0017_0000,
    0x4E20,
    0x0005_001A,
    0x4240_0000,
    0xF,
    0,
    0,
    0,
    0,
    0,
    0,
];
const DATA: [u32; 10] =
    [0, 0x75CA, 0x1_C8F2, 0x3_D090, 0x6_4DF8, 0x8_F448, 0xB_71B0, 0xD_794E, 0xE_CC76, 0xF_4240];

const INSTANT: Times = Times { restart: Duration::ZERO, start: Duration::ZERO, flash: Duration::ZERO };

/// A client, a drive, and what went between them.
struct Bench {
    client: Client,
    module: Module,
    drive: VirtualDrive,
    now: Duration,
    commands: BTreeSet<u8>,
    status: BTreeSet<u8>,
}

impl Bench {
    fn new(times: Times) -> Self {
        let mut drive = VirtualDrive::new(sg5(), times);
        drive.log_error(LoggedError { code: 0x01, hours: 0, milliseconds: 120 });
        drive.log_error(LoggedError { code: 0x64, hours: 0x0001_0398, milliseconds: 0x0002_28C1 });
        let (client, module, now) = (Client::default(), Module::new(), Duration::ZERO);
        let mut bench =
            Self { client, module, drive, now, commands: BTreeSet::new(), status: BTreeSet::new() };
        // The empty command that synchronises the counts, and itself.
        bench.says(Request::NoOperation, 0x00, [0; 3], 0x00, [0; 3]);
        bench
    }

    /// The client sends this ID with these words in DO 2 to 4, and the drive answers with this status and
    /// these words in DI 2 to 4.
    #[track_caller]
    fn says(&mut self, request: Request, id: u8, sent: [u16; 3], status: u8, came: [u16; 3]) {
        self.client.submit(&request).unwrap();
        let (mut control, mut shown) = ([0; 8], [0; 8]);
        while let Some(image) = self.client.poll_transmit(self.now) {
            control = image;
            self.module.handle_output(self.now, image, &mut self.drive);
            shown = self.module.poll_transmit().unwrap_or(shown);
            self.status.insert(shown[1]);
            self.client.handle_input(self.now, shown);
        }
        let words = |image: [u8; 8]| -> [u16; 4] {
            core::array::from_fn(|n| u16::from_le_bytes([image[2 * n], image[2 * n + 1]]))
        };
        let ([control, words_out @ ..], [state, words_in @ ..]) = (words(control), words(shown));
        assert_eq!((control >> 8, words_out), (id.into(), sent), "{request:?}");
        assert_eq!((state >> 8, words_in), (status.into(), came), "{request:?}");
        // Bits 7…4 are reserved, bits 3…0 are the count and its echo.
        assert_eq!((control & 0xF0, state & 0xF0, control & 0xF), (0, 0, state & 0xF));
        assert_eq!(Request::parse(Command(id), sent), Some(request));
        self.commands.insert(id);
        // What goes on ends by itself.
        self.now += Duration::from_secs(1);
        self.module.handle_timeout(self.now, &mut self.drive);
        if let Some(image) = self.module.poll_transmit() {
            self.client.handle_input(self.now, image);
        }
        let outcome = self.client.poll_event().unwrap().outcome;
        match outcome {
            Outcome::Done(reply) => assert!(status < 0x80, "{reply:?}"),
            Outcome::Refused(reply) => assert_eq!(reply.status.0, status),
            other => panic!("{request:?}: {other:?}"),
        }
    }
}

const fn low(value: u32) -> u16 {
    value as u16
}

const fn high(value: u32) -> u16 {
    (value >> 16) as u16
}

/// 7.2.1.1 to 7.2.1.6, and 30h to 36h.
fn parameters(bench: &mut Bench) {
    let upid = Upid(0x11A2);
    let read = |value| Request::Read { value, upid };
    let write = |memory, upid, value| Request::Write { memory, upid: Upid(upid), value };
    for (value, id, number) in [
        (Value::Rom, 0x10, 650_000u32),
        (Value::Ram, 0x11, 650_000),
        (Value::Minimum, 0x15, -10_000_000i32 as u32),
        (Value::Maximum, 0x16, 10_000_000),
        (Value::Default, 0x17, 650_000),
    ] {
        bench.says(read(value), id, [0x11A2, 0, 0], 0x00, [0x11A2, low(number), high(number)]);
    }
    let x = 0x7841_2058;
    bench.says(write(Memory::Rom, 0x03F3, x), 0x12, [0x03F3, 0x2058, 0x7841], 0x00, [0x03F3, 0x2058, 0x7841]);
    bench.says(write(Memory::Ram, 0x13A2, 11), 0x13, [0x13A2, 11, 0], 0x00, [0x13A2, 11, 0]);
    bench.says(write(Memory::Both, 0x13A2, 12), 0x14, [0x13A2, 12, 0], 0x00, [0x13A2, 12, 0]);
    // C0h to C3h.
    bench.says(write(Memory::Rom, 0x1111, 1), 0x12, [0x1111, 1, 0], 0xC0, [0x1111, 1, 0]);
    bench.says(write(Memory::Rom, 0x03F2, 1), 0x12, [0x03F2, 1, 0], 0xC1, [0x03F2, 1, 0]);
    bench.says(write(Memory::Rom, 0x119E, 32_001), 0x12, [0x119E, 32_001, 0], 0xC2, [0x119E, 32_001, 0]);
    bench.says(write(Memory::Ram, 0x119E, 1), 0x13, [0x119E, 1, 0], 0xC3, [0x119E, 1, 0]);
    // C5h: no start; C6h: the end.
    for (list, ids) in [(List::All, [0x20, 0x21]), (List::Modified, [0x22, 0x23])] {
        bench.says(Request::NextItem(list), ids[1], [0; 3], 0xC5, [0; 3]);
        let from = Upid(0x03F1);
        bench.says(Request::StartList { list, from }, ids[0], [0x03F1, 0, 0], 0x00, [0x03F1, 0, 0]);
        match list {
            // UPID found, address usage; the type beside it is project-defined.
            List::All => bench.says(Request::NextItem(list), 0x21, [0; 3], 0x00, [0x03F2, 0x0000, 0x08]),
            // UPID found, its value.
            List::Modified => {
                bench.says(Request::NextItem(list), 0x23, [0; 3], 0x00, [0x03F3, 0x2058, 0x7841]);
            }
        }
        let from = Upid(0x3F00);
        bench.says(Request::StartList { list, from }, ids[0], [0x3F00, 0, 0], 0x00, [0x3F00, 0, 0]);
        bench.says(Request::NextItem(list), ids[1], [0; 3], 0xC6, [0xFFFF, 0, 0]);
    }
    let from = Upid(0x13A2);
    bench.says(Request::StartList { list: List::All, from }, 0x20, [0x13A2, 0, 0], 0x00, [0x13A2, 0, 0]);
    bench.says(Request::NextItem(List::All), 0x21, [0; 3], 0x00, [0x13A2, 0x010F, 0x03]);
    for (layer, id) in Layer::ALL.into_iter().zip(0x31..) {
        bench.says(Request::Defaults(layer), id, [0; 3], 0x00, [0; 3]);
    }
    let rom = Request::Read { value: Value::Rom, upid: Upid(0x03F3) };
    bench.says(rom, 0x10, [0x03F3, 0, 0], 0x00, [0x03F3, 0, 0]);
    bench.says(Request::Stop, 0x35, [0; 3], 0x00, [0; 3]);
    bench.says(Request::Start, 0x36, [0; 3], 0x00, [0; 3]);
}

/// 7.2.1.2, with the flow of 5.5 and 5.6.
fn curves(bench: &mut Bench) {
    let start = |access, info, data| Request::StartCurve { access, curve: 23, info, data };
    let block = |bench: &mut Bench, access, ids: [u8; 2]| {
        for (done, value) in (1..).zip(INFO) {
            let status = if done == INFO.len() { 0x00 } else { 0x04 };
            let sent = if access == Access::Get { 0 } else { value };
            let request = Request::CurveInfo { access, curve: 23, value: sent };
            bench.says(request, ids[0], [23, low(sent), high(sent)], status, [23, low(value), high(value)]);
        }
        for (done, value) in (1..).zip(DATA) {
            let status = if done == DATA.len() { 0x00 } else { 0x04 };
            let sent = if access == Access::Get { 0 } else { value };
            let request = Request::CurveData { access, curve: 23, value: sent };
            bench.says(request, ids[1], [23, low(sent), high(sent)], status, [23, low(value), high(value)]);
        }
        // Finished already.
        let sent = if access == Access::Get { 0 } else { 5 };
        let request = Request::CurveData { access, curve: 23, value: sent };
        bench.says(request, ids[1], [23, sent as u16, 0], 0xD0, [23, sent as u16, 0]);
    };
    bench.says(start(Access::Get, 0, 0), 0x60, [23, 0, 0], 0xD4, [23, 0, 0]);
    bench.says(start(Access::Add, 70, 4), 0x50, [23, 70, 4], 0xD1, [23, 70, 4]);
    bench.says(start(Access::Add, 70, 40), 0x50, [23, 70, 40], 0x00, [23, 70, 40]);
    block(bench, Access::Add, [0x51, 0x52]);
    bench.says(start(Access::Add, 70, 40), 0x50, [23, 70, 40], 0xD4, [23, 70, 40]);
    bench.says(start(Access::Modify, 70, 40), 0x53, [23, 70, 40], 0x00, [23, 70, 40]);
    block(bench, Access::Modify, [0x54, 0x55]);
    bench.says(start(Access::Get, 0, 0), 0x60, [23, 0, 0], 0x00, [23, 70, 40]);
    block(bench, Access::Get, [0x61, 0x62]);
    bench.says(Request::SaveCurves, 0x40, [0; 3], 0xD7, [0; 3]);
    bench.says(Request::Stop, 0x35, [0; 3], 0x00, [0; 3]);
    bench.says(Request::SaveCurves, 0x40, [0; 3], 0x00, [0; 3]);
    bench.says(Request::DeleteCurves, 0x41, [0; 3], 0x00, [0; 3]);
}

/// 7.2.1.7 to 7.2.1.11.
fn errors(bench: &mut Bench) {
    bench.says(Request::ErrorCounts, 0x70, [0; 3], 0x00, [0, 2, 2]);
    bench.says(Request::ErrorCode { entry: 0 }, 0x71, [0; 3], 0x00, [0, 0x64, 0]);
    bench.says(Request::ErrorCode { entry: 1 }, 0x71, [1, 0, 0], 0x00, [1, 0x01, 0]);
    // 32-bit milliseconds, 32-bit hours.
    bench.says(Request::ErrorTimeLow { entry: 0 }, 0x72, [0; 3], 0x00, [0, 0x28C1, 0x0002]);
    bench.says(Request::ErrorTimeHigh { entry: 0 }, 0x73, [0; 3], 0x00, [0, 0x0398, 0x0001]);
    for (stringlet, characters) in
        (0..).zip(["Cfg ", "Err:", " No ", "Moto", "r De", "fine", "d\0\0\0", "\0\0\0\0"])
    {
        let &[a, b, c, d] = characters.as_bytes().first_chunk().unwrap();
        let came = [0x64, u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d])];
        bench.says(Request::ErrorText { code: 0x64, stringlet }, 0x74, [0x64, stringlet, 0], 0x00, came);
    }
}

/// 7.2.1.12 to 7.2.1.19.
fn command_table(bench: &mut Bench) {
    let mut entry = Entry::new(0x0100, core::array::from_fn(|n| n as u8));
    entry.link(Some(6));
    bench.says(Request::GetEntry { entry: 33 }, 0x85, [33, 0, 0], 0xD4, [33, 0, 0]);
    bench.says(Request::WriteEntry { entry: 33, size: 62 }, 0x83, [33, 62, 0], 0xD1, [33, 62, 0]);
    bench.says(Request::WriteEntry { entry: 33, size: 64 }, 0x83, [33, 64, 0], 0x00, [33, 64, 0]);
    for (done, value) in (1..).zip(entry.words()) {
        let (status, words) = (if done == 16 { 0x00 } else { 0x04 }, [33, low(value), high(value)]);
        bench.says(Request::WriteEntryData { entry: 33, value }, 0x84, words, status, words);
    }
    bench.says(Request::GetEntry { entry: 33 }, 0x85, [33, 0, 0], 0x00, [33, 64, 0]);
    for (done, value) in (1..).zip(entry.words()) {
        let (status, words) = (if done == 16 { 0x00 } else { 0x04 }, [33, low(value), high(value)]);
        bench.says(Request::GetEntryData { entry: 33 }, 0x86, [33, 0, 0], status, words);
    }
    bench.says(Request::GetEntryData { entry: 33 }, 0x86, [33, 0, 0], 0xD0, [33, 0, 0]);
    // Offset in bytes; a bit set is an entry undefined, cleared one used.
    for (list, id) in ListNumber::all().zip(0x87..) {
        let offset = u16::from(list.get()) * 4;
        let bits = if list.get() == 1 { 0xFFFD } else { 0xFFFF };
        bench.says(Request::Presence { list }, id, [0; 3], 0x00, [offset, bits, 0xFFFF]);
    }
    bench.says(Request::SaveTable, 0x80, [0; 3], 0x00, [0; 3]);
    bench.says(Request::DeleteEntry { entry: 33 }, 0x82, [33, 0, 0], 0x00, [33, 0, 0]);
    bench.says(Request::ClearTable, 0x81, [0; 3], 0x00, [0; 3]);
}

#[test]
fn every_command_has_its_words_in_both_directions() {
    let mut bench = Bench::new(INSTANT);
    parameters(&mut bench);
    curves(&mut bench);
    errors(&mut bench);
    command_table(&mut bench);
    bench.says(Request::Restart, 0x30, [0; 3], 0x00, [0; 3]);
    let all: Vec<u8> = Command::ALL.iter().map(|command| command.0).collect();
    assert_eq!(bench.commands.into_iter().collect::<Vec<_>>(), all);
    // 02h and 05h follow below.
    let status: Vec<u8> = bench.status.into_iter().collect();
    assert_eq!(status, [0x00, 0x04, 0xC0, 0xC1, 0xC2, 0xC3, 0xC5, 0xC6, 0xD0, 0xD1, 0xD4, 0xD7]);
}

/// 02h and 05h: what takes its time.
#[test]
fn running_and_busy_are_shown() {
    let mut bench = Bench::new(Times { flash: Duration::from_millis(400), ..INSTANT });
    bench.says(Request::Stop, 0x35, [0; 3], 0x00, [0; 3]);
    bench.says(Request::SaveCurves, 0x40, [0; 3], 0x02, [0; 3]);
    let now = bench.now;
    linmot::drive::Drive::save_curves(&mut bench.drive, now);
    bench.says(Request::ErrorCounts, 0x70, [0; 3], 0x05, [0; 3]);
    assert!(bench.status.is_superset(&[0x00, 0x02, 0x05].into()));
}

/// 7.1.1: a command is evaluated only if its count is another one.
#[test]
fn a_command_with_the_same_count_is_none() {
    let mut drive = VirtualDrive::new(sg5(), INSTANT);
    let mut module = Module::new();
    let mut show = |image: [u8; 8]| {
        module.handle_output(Duration::ZERO, image, &mut drive);
        module.image()
    };
    // 12h, count 1: ROM value of 13A2h becomes 11.
    assert_eq!(show([0x01, 0x12, 0xA2, 0x13, 11, 0, 0, 0]), [0x01, 0x00, 0xA2, 0x13, 11, 0, 0, 0]);
    assert_eq!(show([0x01, 0x12, 0xA2, 0x13, 12, 0, 0, 0]), [0x01, 0x00, 0xA2, 0x13, 11, 0, 0, 0]);
    // Bit 0 toggles; the reserved bits say nothing.
    assert_eq!(show([0xF0, 0x10, 0xA2, 0x13, 0, 0, 0, 0]), [0x00, 0x00, 0xA2, 0x13, 11, 0, 0, 0]);
    assert_eq!(show([0xA0, 0x12, 0xA2, 0x13, 12, 0, 0, 0]), [0x00, 0x00, 0xA2, 0x13, 11, 0, 0, 0]);
}
