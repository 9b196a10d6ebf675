//! Whole masters and slaves: anything on the bus, any commands, any times.

use core::time::Duration;

use canopen_master::boot::{ConciseDcf, Config as Boot, ErrorControl, Running};
use canopen_master::emcy::ErrorCode;
use canopen_master::lss::{self, Identity};
use canopen_master::master::{BusStatus, Config, Event, Master, NmtTicket};
use canopen_master::nmt::{Command, Target};
use canopen_master::od::{Communication, Dictionary, Objects, PdoSlot, Pdos};
use canopen_master::sdo::{Address, Options, Ticket};
use canopen_master::slave::{self, Slave};
use canopen_master::{Frame, NodeId, NodeSet, guarding, scan, sync};
use pdo::{CobId, DefaultPdo, Mapping};

use super::Input;
use super::canopen::{TABLE, address};

const NODES: usize = 5;
/// Bases of the predefined connection set, and what is not in it.
const SERVICES: [u16; 16] = [
    0x000, 0x080, 0x100, 0x180, 0x200, 0x280, 0x300, 0x380, 0x480, 0x500, 0x580, 0x580, 0x600, 0x700, 0x700,
    0x7E0,
];

const DCF: [u8; 12] = [1, 0, 0, 0, 0x00, 0x26, 0x00, 1, 0, 0, 0, 22];

static BOOT: Boot<'static> = Boot {
    running: Running::Reset,
    device_type: Some(0x0002_0192),
    identity: [None; 4],
    configured: None,
    dcf: match ConciseDcf::new(&DCF) {
        Ok(dcf) => dcf,
        Err(_) => panic!("one entry"),
    },
    error_control: ErrorControl::Heartbeat { producer_ms: 100, consumer_ms: 200 },
    start: true,
    boot_up: Duration::from_millis(50),
    answer: Duration::from_millis(20),
};

fn node(input: &mut Input<'_>) -> NodeId {
    NodeId::new(1 + input.u8() % (NODES as u8 + 1)).unwrap_or(NodeId::MIN)
}

fn ms(ms: impl Into<u64>) -> Duration {
    Duration::from_millis(ms.into())
}

/// A frame of any service, mostly with the bytes that it would have.
fn frame(input: &mut Input<'_>) -> Frame {
    let kind = input.u8();
    let base = SERVICES[usize::from(kind % 16)];
    let id = if base == 0x7E0 { 0x7E4 + u16::from(input.u8() % 2) } else { base + u16::from(input.u8() % 7) };
    let id = embedded_can::StandardId::new(id).unwrap();
    let len = if kind & 0x80 != 0 || base < 0x580 {
        input.u8() % 9
    } else if base == 0x700 {
        1
    } else {
        8
    };
    if kind & 0x60 == 0x60 {
        return Frame::remote_frame(id, len.into()).unwrap();
    }
    let mut bytes = [0; 8];
    bytes[0] = input.u8();
    if base == 0x580 || base == 0x600 {
        let at = address(input);
        bytes[1..3].copy_from_slice(&at.index.to_le_bytes());
        bytes[3] = at.sub;
    }
    for byte in bytes.iter_mut().skip(4).take(usize::from(input.u8() % 5)) {
        *byte = input.u8();
    }
    Frame::data_frame(id, &bytes[..usize::from(len)]).unwrap()
}

/// What waits for its one outcome.
#[derive(Default)]
struct Open {
    sdo: [Option<Ticket>; NODES],
    boot: [bool; NODES],
    nmt: Vec<NmtTicket>,
    lss: Option<lss::Ticket>,
    scan: bool,
}

impl Open {
    fn is_empty(&self) -> bool {
        self.sdo.iter().all(Option::is_none)
            && self.boot == [false; NODES]
            && self.nmt.is_empty()
            && self.lss.is_none()
            && !self.scan
    }

    fn end(&mut self, event: Event<Vec<u8>>) {
        let place = |node: NodeId| usize::from(node.raw()) - 1;
        match event {
            Event::Sdo { node, finished } => {
                assert_eq!(self.sdo[place(node)].take(), Some(finished.ticket));
            }
            Event::Booted { node, .. } => {
                assert!(core::mem::take(&mut self.boot[place(node)]), "{node:?} was not being booted");
            }
            Event::Nmt { ticket, confirmed, missing, .. } => {
                let found = self.nmt.iter().position(|open| *open == ticket).expect("an open ticket");
                self.nmt.swap_remove(found);
                assert!(confirmed.and(missing).is_empty());
            }
            Event::Lss { ticket, .. } => assert_eq!(self.lss.take(), Some(ticket)),
            Event::Scanned { found, silent } => {
                assert!(core::mem::take(&mut self.scan));
                assert!(found.and(silent).is_empty());
            }
            _ => {}
        }
    }
}

type FuzzMaster = Master<'static, Vec<u8>, NODES>;

/// Takes what the master has to send, as an adapter that is full now and then.
fn send(master: &mut FuzzMaster, now: Duration, refuses: bool) {
    for _ in 0..5000 {
        let Some(frame) = master.poll_transmit(now) else { return };
        assert!(!frame.is_remote() || frame.standard_id().is_some_and(|id| id & 0x780 == 0x700), "{frame}");
        if refuses {
            master.handle_refused(frame);
            return;
        }
    }
    panic!("frames without end");
}

/// Plays a bus and an application. Every command ends in exactly one outcome, the master never sends
/// without end, and on a silent bus it comes to rest.
pub fn canopen_master_ops(data: &[u8]) {
    let mut input = Input(data);
    let mut master: Box<FuzzMaster> = Box::new(Master::new(Config::default()));
    let mut open = Open::default();
    let mut now = Duration::ZERO;
    while !input.is_empty() {
        match input.u8() % 20 {
            0..4 => {
                let frame = frame(&mut input);
                master.handle_frame(now, &frame);
            }
            4 => {
                now += ms(input.u8());
                master.handle_timeout(now);
            }
            5 => send(&mut master, now, input.u8().is_multiple_of(8)),
            6 => {
                if let Some(at) = master.poll_timeout() {
                    now = now.max(at);
                }
                master.handle_timeout(now);
                send(&mut master, now, false);
            }
            7 => {
                let command =
                    [Command::Start, Command::Stop, Command::EnterPreOperational, Command::ResetNode];
                let command = command[usize::from(input.u8() % 4)];
                let target =
                    if input.u8().is_multiple_of(2) { Target::All } else { Target::Node(node(&mut input)) };
                open.nmt.extend(master.nmt(now, command, target));
            }
            8 => {
                let config = guarding::Config {
                    period_ms: u16::from(input.u8() % 8) * 10,
                    life_time_factor: input.u8() % 4,
                };
                let config = (!input.u8().is_multiple_of(3)).then_some(config);
                let _ = master.set_guarding(now, node(&mut input), config);
            }
            9 => {
                let consumer = (!input.u8().is_multiple_of(3)).then_some(u16::from(input.u8()));
                let _ = master.set_heartbeat(now, node(&mut input), consumer, input.u8().is_multiple_of(2));
            }
            10 => {
                let (period, overflow) = (ms(input.u8()), input.u8());
                master.set_sync(sync::Producer::new(period, overflow, Duration::ZERO, now).ok());
            }
            11 | 12 => {
                let (id, at) = (node(&mut input), address(&mut input));
                let timeout = ms(1 + input.u8() % 64);
                let options = if input.u8().is_multiple_of(3) {
                    Options::block(timeout)
                } else {
                    Options::new(timeout)
                };
                let len = input.u8();
                let begun = if len.is_multiple_of(2) {
                    master.upload(id, at, Vec::new(), &options)
                } else {
                    master.download(id, at, input.bytes(len).to_vec(), &options)
                };
                if let Ok(ticket) = begun {
                    let place = &mut open.sdo[usize::from(id.raw()) - 1];
                    assert_eq!(place.replace(ticket), None, "two transfers with one node");
                }
            }
            13 => {
                let id = node(&mut input);
                if let Some(ticket) = open.sdo.get(usize::from(id.raw()) - 1).copied().flatten() {
                    master.cancel(id, ticket);
                }
            }
            14 => {
                let number = DefaultPdo::ALL[usize::from(input.u8() % 4)];
                let id = node(&mut input);
                let len = input.u8() % 10;
                let _ = master.write_pdo(id, number, input.bytes(len));
            }
            15 => {
                let id = node(&mut input);
                if master.boot(now, id, &BOOT).is_ok() {
                    let place = &mut open.boot[usize::from(id.raw()) - 1];
                    assert!(!core::mem::replace(place, true), "two boots of one node");
                }
            }
            16 => master.cancel_boot(now, node(&mut input)),
            17 => {
                let nodes = NodeSet::up_to(node(&mut input));
                let options = scan::Options { answer: ms(1 + input.u8() % 64), identity: true, opmode: true };
                if master.scan(nodes, options).is_ok() {
                    assert!(!core::mem::replace(&mut open.scan, true), "two scans");
                }
            }
            18 => {
                let operation = match input.u8() % 5 {
                    0 => lss::Operation::Fastscan,
                    1 => lss::Operation::InquireIdentity,
                    2 => lss::Operation::ConfigureNodeId(Some(node(&mut input))),
                    3 => lss::Operation::Select(Identity::default()),
                    _ => lss::Operation::Store,
                };
                if let Ok(ticket) = master.lss(operation) {
                    assert_eq!(open.lss.replace(ticket), None, "two LSS operations");
                }
            }
            _ => {
                let status = [BusStatus::Active, BusStatus::Warning, BusStatus::Passive, BusStatus::Off];
                master.handle_bus(now, status[usize::from(input.u8() % 4)]);
            }
        }
        // Somebody who polls now and then.
        if input.u8().is_multiple_of(2) {
            while let Some(event) = master.poll_event() {
                open.end(event);
            }
            while master.poll_pdo().is_some() {}
        }
    }
    // A silent bus: what is cyclic goes on, everything else ends.
    for id in NodeId::all().take(NODES) {
        master.set_guarding(now, id, None).unwrap();
        master.set_heartbeat(now, id, None, false).unwrap();
    }
    master.set_sync(None);
    for _ in 0..3000 {
        send(&mut master, now, false);
        while let Some(event) = master.poll_event() {
            open.end(event);
        }
        let Some(at) = master.poll_timeout() else { break };
        now = now.max(at);
        master.handle_timeout(now);
    }
    assert!(open.is_empty(), "something has no outcome");
}

/// Plays a bus and an application. The slave sends nothing before it boots and nothing without end; limits
/// of its objects hold.
pub fn canopen_slave_ops(data: &[u8]) {
    let mut input = Input(data);
    let mut memory = [0; TABLE.memory()];
    let dictionary = Dictionary::new(TABLE.view(), &mut memory, ()).unwrap();
    let slot = |id| PdoSlot::new(Communication::event_driven(CobId(id)), Mapping::EMPTY);
    let objects: Objects<Dictionary<'_, ()>, 1, 1, 4> =
        Objects { dictionary, pdos: Pdos::new([slot(0x8000_0201)], [slot(0xC000_0181)]) };
    let address = (!input.u8().is_multiple_of(4)).then_some(NodeId::MIN);
    let mut slave = Slave::new(&slave::Config::new(Identity::default(), address), objects);
    let mut now = Duration::ZERO;
    assert!(slave.poll_transmit(now).is_none() && slave.poll_timeout().is_none());
    assert_eq!(slave.boot(now), address.is_some());
    while !input.is_empty() {
        match input.u8() % 10 {
            0..5 => {
                let frame = frame(&mut input);
                slave.handle_frame(now, &frame);
            }
            5 => {
                now += ms(input.u8());
                slave.handle_timeout(now);
            }
            6 => {
                now = slave.poll_timeout().unwrap_or(now).max(now);
                slave.handle_timeout(now);
            }
            7 => {
                let code = ErrorCode(input.u16());
                let _ =
                    if input.u8().is_multiple_of(2) { slave.raise(code, [1; 5]) } else { slave.clear(code) };
            }
            8 => {
                let status = [BusStatus::Active, BusStatus::Warning, BusStatus::Passive, BusStatus::Off];
                slave.handle_bus(now, status[usize::from(input.u8() % 4)]);
            }
            _ => slave.stored(Ok(())),
        }
        if input.u8().is_multiple_of(2) {
            for _ in 0..2000 {
                if slave.poll_transmit(now).is_none() {
                    break;
                }
            }
            assert!(slave.poll_transmit(now).is_none(), "frames without end");
        }
        while let Some(event) = slave.poll_event() {
            if matches!(event, slave::Event::ResetNode | slave::Event::ResetCommunication) {
                slave.boot(now);
            }
        }
        let value = slave.objects().dictionary.get::<i16>(Address::new(0x2000, 0)).unwrap();
        assert!((-5..=100).contains(&value));
    }
}
