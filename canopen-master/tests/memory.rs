//! What the engines cost in memory, and that they allocate nothing.

#![allow(unsafe_code, reason = "an allocator that counts")]

use core::alloc::{GlobalAlloc, Layout};
use core::cell::Cell;
use core::time::Duration;
use std::alloc::System;

use canopen_master::boot::{Booted, ConciseDcf, Config as BootConfig, ErrorControl};
use canopen_master::data_type::DataType;
use canopen_master::lss::{Identity, Operation};
use canopen_master::master::{Config, Event, Master};
use canopen_master::nmt::{Command, State, Target};
use canopen_master::od::{Communication, Dictionary, Entry, PdoSlot, Pdos, Rights, Table};
use canopen_master::sdo::{Options, Outcome, Small};
use canopen_master::slave::{self, Device, Slave};
use canopen_master::{Address, NodeId, NodeSet, emcy, guarding, scan, sync};
use pdo::cob::DefaultPdo;
use pdo::mapping::Entry as Mapped;
use pdo::{CobId, Mapping, RpdoFault, Transmission};

struct Counting;

std::thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: passes everything on to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations() -> u64 {
    ALLOCATIONS.with(Cell::get)
}

const TABLE: Table<'static, 14> = match Table::new([
    Entry::constant(0x1000, 0, DataType::UNSIGNED32, 0x0002_0192),
    Entry::variable(0x1005, 0, DataType::UNSIGNED32, 0x80),
    Entry::variable(0x1006, 0, DataType::UNSIGNED32, 0),
    Entry::text(0x1008, 0, "SD03"),
    Entry::variable(0x100C, 0, DataType::UNSIGNED16, 0),
    Entry::variable(0x100D, 0, DataType::UNSIGNED8, 0),
    Entry::variable(0x1017, 0, DataType::UNSIGNED16, 0),
    Entry::constant(0x1018, 1, DataType::UNSIGNED32, 0x6A),
    Entry::variable(0x2600, 0, DataType::UNSIGNED8, 1),
    Entry::constant(0x35B4, 1, DataType::UNSIGNED8, 0),
    Entry::variable(0x6040, 0, DataType::UNSIGNED16, 0).with_rights(Rights::Rww).mappable(),
    Entry::variable(0x6041, 0, DataType::UNSIGNED16, 0x0240).with_rights(Rights::Ro).mappable(),
    Entry::variable(0x6064, 0, DataType::INTEGER32, -7i64 as u64).with_rights(Rights::Ro).mappable(),
    Entry::variable(0x60FF, 0, DataType::INTEGER32, 0).with_rights(Rights::Rww).mappable(),
]) {
    Ok(table) => table,
    Err(_) => panic!("entries out of order"),
};

type Drive<'a> = Slave<Device<'a, (), 4, 4, 4>>;

fn drive(memory: &mut [u8]) -> Drive<'_> {
    let off = PdoSlot::new(Communication::event_driven(CobId(0x8000_0000)), Mapping::EMPTY);
    let set = Mapping::new(&[Mapped::new(0x6040, 0, 16), Mapped::new(0x60FF, 0, 32)]).unwrap();
    let show = Mapping::new(&[Mapped::new(0x6041, 0, 16), Mapped::new(0x6064, 0, 32)]).unwrap();
    let each_sync = Transmission::new(1).unwrap();
    let synchronous =
        |id| Communication { transmission: each_sync, ..Communication::event_driven(CobId(id)) };
    let pdos = Pdos::new(
        [PdoSlot::new(synchronous(0x201), set), off, off, off],
        [PdoSlot::new(synchronous(0x181), show), off, off, off],
    );
    let dictionary = Dictionary::new(TABLE.view(), memory, ()).unwrap();
    Slave::new(&slave::Config::new(Identity::default(), Some(NodeId::MIN)), Device { dictionary, pdos })
}

/// Frames to and fro until nobody has one; returns how many.
fn exchange<const N: usize>(
    now: Duration,
    master: &mut Master<'static, Small, N>,
    slave: &mut Drive<'_>,
    mut told: impl FnMut(Event<Small>),
) -> u32 {
    let mut frames = 0;
    master.handle_timeout(now);
    slave.handle_timeout(now);
    loop {
        while let Some(event) = master.poll_event() {
            told(event);
        }
        while let Some(event) = slave.poll_event() {
            if matches!(event, slave::Event::ResetCommunication | slave::Event::ResetNode) {
                slave.boot(now);
            }
        }
        if let Some(frame) = master.poll_transmit(now) {
            slave.handle_frame(now, &frame);
        } else if let Some(frame) = slave.poll_transmit(now) {
            master.handle_frame(now, &frame);
        } else if slave.objects().pdos.poll_timeout().is_none_or(|at| at > now) {
            return frames;
        }
        frames += 1;
        assert!(frames < 10_000);
    }
}

static BOOT: BootConfig<'static> = BootConfig {
    running: canopen_master::boot::Running::Reset,
    device_type: Some(0x0002_0192),
    identity: [Some(0x6A), None, None, None],
    configured: None,
    dcf: ConciseDcf::EMPTY,
    error_control: ErrorControl::Guarding(guarding::Config { period_ms: 100, life_time_factor: 3 }),
    start: true,
    boot_up: Duration::from_millis(100),
    answer: Duration::from_millis(50),
};

#[test]
fn nothing_is_allocated_after_construction() {
    let mut memory = [0; TABLE.memory()];
    let mut slave = drive(&mut memory);
    let mut master = Master::<'static, Small, 127>::new(Config::default());
    let before = allocations();

    slave.boot(Duration::ZERO);
    let mut booted = false;
    let (mut frames, mut sdo, mut scanned, mut nmt, mut lss, mut emergencies) = (0, 0, 0, 0, 0, 0);
    master.boot(Duration::ZERO, NodeId::MIN, &BOOT).unwrap();
    let second = Duration::from_secs(1);
    for step in 0..3000u64 {
        let now = Duration::from_millis(step);
        if step == 1000 {
            let sync = sync::Producer::new(Duration::from_millis(10), 0, Duration::ZERO, now);
            master.set_sync(sync.ok());
            master.lss(Operation::InquireNodeId).unwrap();
            slave.raise(emcy::ErrorCode::TEMPERATURE, [0; 5]).unwrap();
        }
        if now >= second && step % 10 == 5 {
            master.write_pdo(NodeId::MIN, DefaultPdo::First, &[6, 0, step as u8, 1, 0, 0]).unwrap();
            let _ = master.upload(NodeId::MIN, Address::new(0x1008, 0), Small::EMPTY, &Options::default());
        }
        if step == 2000 {
            master.scan(NodeSet::ALL, scan::Options::default()).unwrap();
            master.nmt(now, Command::Start, Target::All).unwrap();
        }
        frames += exchange(now, &mut master, &mut slave, |event| match event {
            Event::Booted { result, .. } => {
                booted = result == Ok(Booted { device_type: 0x0002_0192, taken_over: false, written: 0 });
            }
            Event::Sdo { finished, .. } => {
                assert_eq!((finished.outcome, finished.buffer.as_slice()), (Outcome::Done(4), &b"SD03"[..]));
                sdo += 1;
            }
            Event::Scanned { found, .. } => scanned = found.len(),
            Event::Nmt { confirmed, .. } => nmt = confirmed.len(),
            Event::Lss { .. } => lss += 1,
            Event::Emergency { .. } => emergencies += 1,
            _ => {}
        });
    }
    let allocated = allocations() - before;

    assert!(booted);
    assert_eq!((scanned, nmt, lss, emergencies), (1, 1, 1, 1));
    assert_eq!(master.state(NodeId::MIN), Some(State::Operational));
    assert!(sdo > 150 && frames > 1200, "{sdo} transfers, {frames} frames");
    let show = master.pdo(NodeId::MIN, DefaultPdo::First).unwrap();
    assert_eq!(show.data(), [0x40, 0x02, 0xF9, 0xFF, 0xFF, 0xFF]);
    let control = slave.objects().dictionary.get::<u16>(Address::new(0x6040, 0));
    assert_eq!(control, Ok(6));
    assert_eq!(allocated, 0, "allocations in {frames} frames");
    println!("{frames} frames, {sdo} transfers, {allocated} allocations");
}

#[test]
fn sizes() {
    let node = Master::<'static, Small, 127>::node_size();
    let all = size_of::<Master<'static, Small, 127>>();
    let sixteen = size_of::<Master<'static, Small, 16>>();
    println!("master for 127 nodes {all} bytes, for 16 nodes {sixteen}; {node} a node");
    println!("slave with 4 + 4 PDOs of 4 objects {} bytes", size_of::<Drive<'_>>());
    assert!((all - sixteen).abs_diff((127 - 16) * node) < 16, "alignment apart");
    assert!(node <= 512, "{node}");
    assert!(all - 127 * node <= 4096, "{}", all - 127 * node);
}

/// An RPDO of the wrong length is told by an emergency (8210h, 8220h).
#[test]
fn wrong_lengths_of_pdos_are_told() {
    let mut memory = [0; TABLE.memory()];
    let mut slave = drive(&mut memory);
    let mut master = Master::<'static, Small, 1>::new(Config::default());
    let now = Duration::ZERO;
    slave.boot(now);
    exchange(now, &mut master, &mut slave, |_| {});
    master.nmt(now, Command::Start, Target::All).unwrap();
    exchange(now, &mut master, &mut slave, |_| {});
    for data in [&[1, 2, 3][..], &[1, 2, 3, 4, 5, 6, 7]] {
        master.write_pdo(NodeId::MIN, DefaultPdo::First, data).unwrap();
        let frame = master.poll_transmit(now).unwrap();
        slave.handle_frame(now, &frame);
        let event = core::iter::from_fn(|| slave.poll_event()).last();
        let told =
            matches!(event, Some(slave::Event::Rpdo(0, Err(RpdoFault::TooShort(_) | RpdoFault::TooLong(_)))));
        assert!(told, "{event:?}");
    }
    exchange(now, &mut master, &mut slave, |_| {});
    let told: Vec<_> = master.history().iter().map(|entry| entry.emergency).collect();
    let codes: Vec<_> = told.iter().map(|emergency| emergency.code.0).collect();
    assert_eq!(codes, [0x8220, 0x8210]);
    assert_eq!(told[1].data, [0x00, 0x16, 6, 3, 0]);
    assert_eq!(slave.error_register(), 0x11);
    slave.handle_frame(now, &canopen_master::Frame::standard(0x080, []));
    assert_eq!(slave.error_register(), 0, "the long one is taken");
}
