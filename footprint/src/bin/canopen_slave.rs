//! A CANopen slave: object dictionary, SDO server with block transfer, 4 + 4 PDOs, guarding,
//! heartbeat, EMCY, SYNC, LSS.
#![no_std]
#![no_main]

use core::hint::black_box;

use canopen_master::data_type::DataType;
use canopen_master::emcy::ErrorCode;
use canopen_master::lss::Identity;
use canopen_master::od::{Communication, Dictionary, Entry, PdoSlot, Pdos, Rights, Table};
use canopen_master::slave::{Config, Device, Slave};
use canopen_master::{BusStatus, NodeId};
use footprint::{now, received};
use pdo::{CobId, Mapping};

type Engine<'a> = Slave<Device<'a, (), 4, 4, 8>>;

const TABLE: Table<'static, 16> = match Table::new([
    Entry::constant(0x1000, 0, DataType::UNSIGNED32, 0x0002_0192),
    Entry::variable(0x1005, 0, DataType::UNSIGNED32, 0x80),
    Entry::variable(0x1006, 0, DataType::UNSIGNED32, 0),
    Entry::text(0x1008, 0, "a device with a name"),
    Entry::variable(0x100C, 0, DataType::UNSIGNED16, 0),
    Entry::variable(0x100D, 0, DataType::UNSIGNED8, 0),
    Entry::store(1),
    Entry::restore(1),
    Entry::variable(0x1014, 0, DataType::UNSIGNED32, 0x81),
    Entry::variable(0x1015, 0, DataType::UNSIGNED16, 0),
    Entry::variable(0x1017, 0, DataType::UNSIGNED16, 0),
    Entry::constant(0x1018, 1, DataType::UNSIGNED32, 1),
    Entry::string(0x2000, 1, DataType::DOMAIN, 1024, &[]),
    Entry::variable(0x6040, 0, DataType::UNSIGNED16, 0).with_rights(Rights::Rww).mappable(),
    Entry::variable(0x6041, 0, DataType::UNSIGNED16, 0).with_rights(Rights::Ro).mappable(),
    Entry::variable(0x6064, 0, DataType::INTEGER32, 0).with_rights(Rights::Ro).mappable(),
]) {
    Ok(table) => table,
    Err(_) => panic!("entries out of order"),
};

#[used]
#[unsafe(no_mangle)]
static ENGINE_STATE: [u8; size_of::<Engine<'static>>()] = [0; size_of::<Engine<'static>>()];

#[unsafe(no_mangle)]
extern "C" fn _start() {
    let mut memory = black_box([0; TABLE.memory()]);
    let Ok(dictionary) = Dictionary::new(TABLE.view(), &mut memory, ()) else { return };
    let mut slave = engine(dictionary);
    while step(black_box(&mut slave)) {}
}

#[inline(never)]
fn engine(dictionary: Dictionary<'_, ()>) -> Engine<'_> {
    let slot = PdoSlot::new(Communication::event_driven(black_box(CobId(0x181))), Mapping::EMPTY);
    let pdos = Pdos::new([slot; 4], [slot; 4]);
    let config = black_box(Config::new(Identity::default(), Some(NodeId::MIN)));
    Engine::new(&config, Device { dictionary, pdos })
}

/// What a firmware does from its interrupts and its main loop.
#[inline(never)]
fn step(slave: &mut Engine<'_>) -> bool {
    if black_box(true) {
        black_box(slave.boot(now()));
    }
    black_box(slave.handle_frame(now(), &received()));
    slave.handle_timeout(now());
    slave.handle_bus(now(), black_box(BusStatus::Active));
    black_box(slave.raise(black_box(ErrorCode::TEMPERATURE), [0; 5]).is_ok());
    black_box(slave.clear(black_box(ErrorCode::TEMPERATURE)).is_ok());
    while let Some(frame) = slave.poll_transmit(now()) {
        black_box(&frame);
    }
    while let Some(event) = slave.poll_event() {
        black_box(&event);
    }
    black_box(slave.poll_timeout()).is_some()
}
