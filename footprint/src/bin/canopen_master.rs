//! A CANopen master for 16 nodes without device files: NMT, guarding, heartbeat, SYNC, PDOs, SDO in
//! every mode, EMCY, boot, scan, LSS.
#![no_std]
#![no_main]

use core::hint::black_box;

use canopen_master::boot::{self, ConciseDcf};
use canopen_master::lss::Operation;
use canopen_master::master::{BusStatus, Config, Master};
use canopen_master::nmt::{Command, Target};
use canopen_master::sdo::{Options, Small};
use canopen_master::{Address, NodeId, NodeSet, guarding, scan, sync};
use footprint::{now, received, wire};
use pdo::DefaultPdo;

type Engine = Master<'static, Small, 16>;

#[used]
#[unsafe(no_mangle)]
static ENGINE_STATE: [u8; size_of::<Engine>()] = [0; size_of::<Engine>()];

static BOOT: boot::Config<'static> = boot::Config {
    running: boot::Running::TakeOver,
    device_type: Some(0x192),
    identity: [Some(1), Some(2), Some(3), Some(4)],
    configured: Some((1, 2)),
    dcf: ConciseDcf::EMPTY,
    error_control: boot::ErrorControl::Guarding(guarding::Config { period_ms: 100, life_time_factor: 3 }),
    start: true,
    boot_up: core::time::Duration::from_secs(1),
    answer: core::time::Duration::from_secs(1),
};

#[unsafe(no_mangle)]
extern "C" fn _start() {
    let mut master = engine();
    command(black_box(&mut master));
    while step(black_box(&mut master)) {}
}

#[inline(never)]
fn engine() -> Engine {
    Engine::new(black_box(Config::default()))
}

/// What an application asks for.
#[inline(never)]
fn command(master: &mut Engine) {
    let node = black_box(NodeId::MIN);
    let at = black_box(Address::new(0x1000, 0));
    let options = black_box(Options::block(now()));
    black_box(master.nmt(now(), black_box(Command::Start), black_box(Target::All)).is_ok());
    black_box(master.set_guarding(now(), node, black_box(Some(guarding::Config::default()))).is_ok());
    black_box(master.set_heartbeat(now(), node, black_box(Some(1000)), true).is_ok());
    master.set_sync(sync::Producer::new(now(), black_box(0), now(), now()).ok());
    black_box(master.upload(node, at, Small::EMPTY, &options).is_ok());
    black_box(master.download(node, at, black_box(Small::EMPTY), &options).is_ok());
    black_box(master.expect_pdo(node, black_box(DefaultPdo::First), black_box(Some(4))).is_ok());
    black_box(master.write_pdo(node, black_box(DefaultPdo::First), wire()).is_ok());
    black_box(master.boot(now(), node, black_box(&BOOT)).is_ok());
    black_box(master.scan(black_box(NodeSet::ALL), black_box(scan::Options::default())).is_ok());
    black_box(master.lss(black_box(Operation::Fastscan)).is_ok());
}

/// What a firmware does from its interrupts and its main loop.
#[inline(never)]
fn step(master: &mut Engine) -> bool {
    black_box(master.handle_frame(now(), &received()));
    master.handle_timeout(now());
    master.handle_bus(now(), black_box(BusStatus::Active));
    while let Some(frame) = master.poll_transmit(now()) {
        black_box(&frame);
        if black_box(false) {
            master.handle_refused(frame);
        }
    }
    while let Some(event) = master.poll_event() {
        black_box(&event);
    }
    while let Some((node, number)) = master.poll_pdo() {
        black_box(master.pdo(node, number));
    }
    black_box(master.poll_timeout()).is_some()
}
