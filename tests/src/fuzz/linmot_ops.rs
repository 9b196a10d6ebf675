//! LinMot engines against peers that do anything.

use core::time::Duration;

use device_sim::linmot::{Times, VirtualDrive, sg5};
use linmot::client::Client;
use linmot::code::{Command, Status};
use linmot::drive::{Drive, Module};
use linmot::linrs::{self, Checksum, Config, MAX_FRAME, Master, Message, Slave};
use linmot::module::{Input as ModuleInput, Output};
use linmot::request::{Reply, Request};
use linmot::sdo::{Access, Server};

use super::Input;

fn request(input: &mut Input<'_>) -> Request {
    let commands = Command::ALL;
    let command = commands[usize::from(input.u8()) % commands.len()];
    // Few UPIDs, curves and entries, so that what belongs together meets.
    const NUMBERS: [u16; 8] = [1, 2, 3, 0x13A2, 0x119E, 0x03F3, 0x2136, 0xFFFF];
    let first = NUMBERS[usize::from(input.u8() % 8)];
    Request::parse(command, [first, input.u16(), input.u16()]).unwrap()
}

/// Plays operations on both clients. Every command must end in exactly one outcome, and time alone
/// must end it.
pub fn linmot_client_ops(data: &[u8]) {
    let mut input = Input(data);
    if input.u8().is_multiple_of(2) { module_client(&mut input) } else { linrs_master(&mut input) }
}

fn module_client(input: &mut Input<'_>) {
    let mut client = Client::default();
    let (mut now, mut open) = (Duration::ZERO, None);
    while !input.is_empty() {
        match input.u8() % 7 {
            6 => client.handle_restart(),
            0 => {
                if let Ok(ticket) = client.submit(&request(input)) {
                    assert!(open.replace(ticket).is_none(), "one command at a time");
                }
            }
            1 => {
                if let Some(ticket) = open {
                    client.cancel(ticket);
                }
            }
            2 => {
                // An answer that may fit: the count asked for, or any.
                let count = if input.u8() < 200 { client.image()[0] & 0xF } else { input.u8() };
                let reply = Reply::new(Status(input.u8()), [input.u16(), input.u16(), input.u16()]);
                client.handle_input(now, ModuleInput { reply, count }.encode());
            }
            3 => {
                now += Duration::from_millis(u64::from(input.u16()));
                client.handle_timeout(now);
            }
            _ => {
                if client.poll_transmit(now).is_some() {
                    assert!(open.is_some(), "nothing to send without a command");
                    assert!(client.poll_transmit(now).is_none(), "once at a time");
                }
            }
        }
        while let Some(event) = client.poll_event() {
            assert_eq!(open.take(), Some(event.ticket));
        }
    }
    for _ in 0..4096 {
        client.poll_transmit(now);
        let Some(timeout) = client.poll_timeout() else { break };
        now = now.max(timeout);
        client.handle_timeout(now);
    }
    while let Some(event) = client.poll_event() {
        assert_eq!(open.take(), Some(event.ticket));
    }
    assert_eq!((open, client.poll_timeout()), (None, None));
}

fn linrs_master(input: &mut Input<'_>) {
    let mut master = Master::new(Config::new(0x11));
    let (mut now, mut open) = (Duration::ZERO, None);
    let mut asked = Request::NoOperation;
    while !input.is_empty() {
        match input.u8() % 6 {
            0 => {
                let next = request(input);
                if let Ok(ticket) = master.submit(&next, input.u8() % 3) {
                    assert!(open.replace(ticket).is_none(), "one command at a time");
                    asked = next;
                }
            }
            1 => {
                if let Some(ticket) = open {
                    master.cancel(ticket);
                }
            }
            2 => {
                let reply = Reply::new(Status(input.u8()), [asked.words()[0], input.u16(), input.u16()]);
                let mut out = [0; MAX_FRAME];
                let answer = linrs::response(0x10 | (input.u8() & 1), &asked, &reply, b"text");
                let len = answer.encode(Checksum::None, &mut out);
                let cut = usize::from(input.u8()).min(len);
                master.handle_bytes(now, &out[..cut]);
                master.handle_bytes(now, &out[cut..len]);
            }
            3 => {
                let len = input.u8() % 32;
                master.handle_bytes(now, input.bytes(len));
            }
            4 => {
                now += Duration::from_millis(u64::from(input.u16()));
                master.handle_timeout(now);
            }
            _ => {
                if master.poll_transmit(now).is_some() {
                    assert!(open.is_some() && master.poll_transmit(now).is_none());
                    master.handle_transmit_done(now);
                }
            }
        }
        while let Some(event) = master.poll_event() {
            assert_eq!(open.take(), Some(event.ticket));
        }
    }
    for _ in 0..8 {
        master.poll_transmit(now);
        master.handle_transmit_done(now);
        let Some(timeout) = master.poll_timeout() else { break };
        now = now.max(timeout);
        master.handle_timeout(now);
    }
    while let Some(event) = master.poll_event() {
        assert_eq!(open.take(), Some(event.ticket));
    }
    assert_eq!((open, master.poll_timeout()), (None, None));
}

/// Plays operations on a drive behind one carrier: commands, any bytes, time, loss of power. ROM
/// values stay inside their ranges, and read-only ones as they are.
pub fn linmot_drive_ops(data: &[u8]) {
    let mut input = Input(data);
    let mut drive = VirtualDrive::new(sg5(), Times::default());
    let (mut module, mut server, mut slave) =
        (Module::new(), Server::new(), Slave::new(0x11, Checksum::None));
    let carrier = input.u8() % 3;
    let (mut now, mut count) = (Duration::ZERO, 0u8);
    while !input.is_empty() {
        match (input.u8() % 8, carrier) {
            (0, _) => now += Duration::from_millis(u64::from(input.u16() % 2000)),
            (1, _) => drive.power_cycle(now),
            (2, 0) => {
                let mut image = [0; 8];
                image.iter_mut().for_each(|byte| *byte = input.u8());
                module.handle_output(now, image, &mut drive);
            }
            (2, 1) => {
                let access = Access { index: 0x2000 + input.u16() % 0x4000, sub: input.u8(), write: None };
                server.execute(now, &access, &mut drive);
            }
            (2, _) => {
                let len = input.u8() % 16;
                slave.handle_bytes(now, input.bytes(len), &mut drive);
            }
            (_, 0) => {
                count = count % 15 + 1;
                let image = Output::new(&request(&mut input), count).encode();
                module.handle_output(now, image, &mut drive);
                if !drive.is_restarting(now) {
                    let shown = ModuleInput::parse(module.image());
                    assert!(shown.count == count || shown.reply.status.is_running());
                }
            }
            (_, 1) => {
                if let Some(access) = Access::new(&request(&mut input)) {
                    let answer = server.execute(now, &access, &mut drive);
                    assert!(answer.is_some() || drive.is_restarting(now));
                }
            }
            _ => {
                let mut out = [0; MAX_FRAME];
                let message: Message = linrs::telegram(0x11, &request(&mut input));
                let len = message.encode(Checksum::None, &mut out);
                slave.handle_bytes(now, &out[..len], &mut drive);
            }
        }
        drive.advance(now);
        module.handle_timeout(now, &mut drive);
        slave.handle_timeout(now, &mut drive);
        while slave.poll_transmit(now).is_some() {}
    }
    for parameter in sg5() {
        let rom = drive.rom(parameter.upid);
        assert!(parameter.takes(rom));
        if !parameter.usage.contains(linmot::upid::Usage::ROM_WRITE) {
            assert_eq!(rom, parameter.default);
        }
    }
    assert!(VirtualDrive::new(sg5(), Times::default()).load_image(&drive.image()).is_ok());
}
