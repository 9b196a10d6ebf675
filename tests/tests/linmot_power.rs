//! A LinMot drive whose power fails at any step of a restore: the same restore repairs it.

use core::time::Duration;
use std::io::Cursor;

use device_sim::linmot::{Times, VirtualDrive, sg5};
use linmot::curve::{InfoBlock, Profile};
use linmot::drive::{Drive, Service};
use linmot::link::{Link, LinkExt};
use linmot::pvl::Encoding;
use linmot::request::{Access, Memory, Reply, Request};
use linmot::table::Entry;
use linmot::upid::{Layer, Upid};
use motion_io::linmot::transfer::{self, Options, Progress};

/// Carries commands straight to a drive, 1 ms each; power fails before, or in the middle of, the
/// command with a given number.
struct Direct {
    drive: VirtualDrive,
    service: Service,
    now: Duration,
    commands: usize,
    fail_at: Option<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("no answer")]
struct NoAnswer;

impl Direct {
    fn new() -> Self {
        let drive = VirtualDrive::new(sg5(), Times::default());
        Self { drive, service: Service::new(), now: Duration::ZERO, commands: 0, fail_at: None }
    }

    fn power_cycle(&mut self) {
        self.drive.power_cycle(self.now);
        self.service = Service::new();
        self.wait();
    }

    /// Until the drive is back and idle.
    fn wait(&mut self) {
        while self.drive.is_restarting(self.now) || self.drive.is_busy(self.now) {
            self.now += Duration::from_millis(10);
        }
        self.drive.advance(self.now);
    }
}

impl Link for Direct {
    type Error = NoAnswer;

    fn call(&mut self, request: &Request) -> Result<Reply, NoAnswer> {
        self.now += Duration::from_millis(1);
        self.commands += 1;
        let fails = self.fail_at == Some(self.commands);
        // Half of the failures come before the command, half while it is carried out.
        if fails && self.commands.is_multiple_of(2) {
            self.power_cycle();
            return Err(NoAnswer);
        }
        let mut reply = self.service.execute(self.now, request, &mut self.drive);
        if fails {
            self.power_cycle();
            return Err(NoAnswer);
        }
        if reply.status.is_running() {
            self.wait();
            reply.status = linmot::code::Status::OK;
        }
        Ok(reply)
    }
}

fn fill(link: &mut Direct) -> [Entry; 2] {
    link.write(Upid(0x11A2), Memory::Rom, -5i32 as u32).unwrap();
    link.write(Upid(0x13A2), Memory::Both, 77).unwrap();
    link.write_text(Upid::USER_COMMENT, Memory::Rom, b"X Axis Left").unwrap();
    for (id, count) in [(23, 10), (1, 5)] {
        let info = InfoBlock::position_over_time(id, "Example_Curve", 20_000, count).unwrap();
        link.start_curve(Access::Add, &info).unwrap();
        for number in 1..=count {
            let setpoint = Profile::Sine.setpoint(0, 1_000_000, number - 1, count);
            link.write_setpoint(Access::Add, &info, number.into(), setpoint).unwrap();
        }
    }
    let mut entries = [Entry::new(0x100, [1; 32]), Entry::new(0x200, [2; 32])];
    entries[0].link(Some(2));
    link.ask(Request::Stop).unwrap();
    link.ask(Request::SaveCurves).unwrap();
    link.ask(Request::Start).unwrap();
    entries
}

fn write_table(link: &mut Direct, entries: &[Entry; 2]) -> Result<(), linmot::link::Fault<NoAnswer>> {
    link.ask(Request::Stop)?;
    for (number, entry) in (1..).zip(entries) {
        link.write_entry(number, entry)?;
    }
    link.ask(Request::SaveTable)?;
    link.ask(Request::Start).map(|_| ())
}

fn to_defaults(link: &mut Direct) {
    for layer in Layer::ALL {
        link.ask(Request::Defaults(layer)).unwrap();
    }
    for request in [Request::DeleteCurves, Request::ClearTable, Request::Stop, Request::SaveCurves] {
        link.ask(request).unwrap();
    }
    for request in [Request::SaveTable, Request::Start, Request::Restart] {
        link.ask(request).unwrap();
    }
    link.wait();
}

fn restore(link: &mut Direct, file: &[u8], entries: &[Entry; 2]) -> Result<(), String> {
    transfer::restore(link, &mut Cursor::new(file), Options::default(), |_| ()).map_err(|e| e.to_string())?;
    write_table(link, entries).map_err(|error| error.to_string())
}

fn equals(link: &mut Direct, file: &[u8], entries: &[Entry; 2]) -> Result<(), String> {
    let mut differences = Vec::new();
    let compared: Progress =
        transfer::compare(link, &mut Cursor::new(file), |difference| differences.push(difference), |_| ())
            .map_err(|error| error.to_string())?;
    if !differences.is_empty() || compared.curves != 2 {
        return Err(format!("{differences:?}"));
    }
    for (number, entry) in (1..).zip(entries) {
        let found = link.read_entry(number).map_err(|error| error.to_string())?;
        if found != *entry {
            return Err(format!("entry {number}"));
        }
    }
    Ok(())
}

#[test]
fn the_same_restore_repairs_a_power_cut_at_any_step() {
    let mut link = Direct::new();
    let entries = fill(&mut link);
    write_table(&mut link, &entries).unwrap();
    let mut file = Vec::new();
    transfer::backup(&mut link, &mut file, Encoding::Windows1252, false, |_| ()).unwrap();
    to_defaults(&mut link);
    assert!(equals(&mut link, &file, &entries).is_err());

    let blank = link.drive.image();
    let begin = link.commands;
    restore(&mut link, &file, &entries).unwrap();
    let steps = link.commands - begin;
    link.power_cycle();
    equals(&mut link, &file, &entries).unwrap();
    assert!(steps > 150, "{steps}");

    let mut survived = 0;
    for step in 1..=steps {
        let mut link = Direct::new();
        link.drive.load_image(&blank).unwrap();
        link.fail_at = Some(step);
        // Before anything is written a list may just have been read again.
        if restore(&mut link, &file, &entries).is_ok() {
            survived += 1;
            link.power_cycle();
            equals(&mut link, &file, &entries).unwrap_or_else(|error| panic!("step {step}: {error}"));
        }
        restore(&mut link, &file, &entries).unwrap_or_else(|error| panic!("step {step}: {error}"));
        link.power_cycle();
        equals(&mut link, &file, &entries).unwrap_or_else(|error| panic!("step {step}: {error}"));
    }
    assert!(survived <= sg5().len() + 1, "{survived} of {steps} failures went unnoticed");
}

/// A list that loses an answer goes on behind the last UPID known, and loses no parameter.
#[test]
fn a_lost_list_answer_loses_no_parameter() {
    struct Lossy(Direct, usize);
    impl Link for Lossy {
        type Error = NoAnswer;
        fn call(&mut self, request: &Request) -> Result<Reply, NoAnswer> {
            let reply = self.0.call(request)?;
            self.1 += 1;
            // Carried out, but the answer is lost.
            let lost = matches!(request, Request::NextItem(_)) && self.1.is_multiple_of(5);
            if lost { Err(NoAnswer) } else { Ok(reply) }
        }
    }
    let mut found = Vec::new();
    let mut lossy = Lossy(Direct::new(), 0);
    lossy.list(linmot::request::List::All, Upid(0), |item| found.push(item.upid)).unwrap();
    let expected: Vec<Upid> = sg5().iter().map(|parameter| parameter.upid).collect();
    assert_eq!(found, expected);
}
