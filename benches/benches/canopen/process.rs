//! PDOs, and a master's cycle on a full bus.

use core::hint::black_box;
use core::time::Duration;

use benches::Contender;
use canopen_master::master::Master;
use canopen_master::sdo::Small;
use canopen_master::{Frame, NodeId, sync};
use canopen_rs::pdo::{MappingEntry, PdoMapping};
use canopen_rs::{Address as TheirAddress, Entry as TheirEntry, ObjectDictionary, Value};
use pdo::mapping::Entry as Mapped;
use pdo::{CobId, Communication, Mapping, Rpdo, RpdoEvent};

use super::Judge;

const PDOS: u32 = 1000;
/// Cycles that are measured at once.
const CYCLES: u32 = 50;

#[inline(never)]
fn our_pdos(rpdo: &mut Rpdo, mapping: &Mapping<4>, frame: &Frame) -> u64 {
    let mut sum = 0u64;
    for i in 0..PDOS {
        rpdo.handle_frame(Duration::from_micros(i.into()), black_box(frame));
        let Some(RpdoEvent::Data(payload)) = rpdo.poll_event() else { panic!("no data") };
        let mut values = [0u16; 4];
        let mapped = mapping.unpack(payload).expect("8 bytes");
        values.iter_mut().zip(mapped).for_each(|(value, (_, bits))| *value = bits.unsigned() as u16);
        sum = black_box(values).iter().fold(sum, |sum, &value| sum.wrapping_add(u64::from(value)));
    }
    sum
}

/// A PDO into the four objects that it maps.
#[inline(never)]
fn their_pdos(mapping: &PdoMapping<4>, od: &mut ObjectDictionary<16>, data: &[u8; 8]) -> u64 {
    for _ in 0..PDOS {
        canopen_rs::pdo::unpack(mapping, od, black_box(data)).expect("8 bytes");
        black_box(&mut *od);
    }
    let values = (1..=4).map(|sub| match od.read(TheirAddress::new(0x6401, sub)) {
        Ok(Value::Unsigned16(value)) => u64::from(value),
        other => panic!("{other:?}"),
    });
    values.sum::<u64>().wrapping_mul(PDOS.into())
}

/// Nodes of the master's cycle, and its period.
const NODES: u16 = 126;
const PERIOD: Duration = Duration::from_millis(50);

/// A master that watches the heartbeats of all nodes and sends SYNC.
fn master() -> Master<'static, Small, 127> {
    let mut master = Master::default();
    for node in NodeId::all().take(NODES.into()) {
        master.set_heartbeat(Duration::ZERO, node, Some(1500), true).expect("a node");
    }
    let producer = sync::Producer::new(PERIOD, 0, Duration::ZERO, Duration::ZERO).expect("a period");
    master.set_sync(Some(producer));
    master
}

/// What 126 operational nodes send in a cycle, in the order that arbitration gives: TPDO 1, heartbeat.
fn cycle_frames() -> Vec<Frame> {
    let pdos = (1..=NODES).map(|node| Frame::standard(0x180 + node, u64::from(node).to_le_bytes()));
    pdos.chain((1..=NODES).map(|node| Frame::standard(0x700 + node, [5]))).collect()
}

/// One cycle as a program drives it: time-outs, SYNC, the nodes' frames, events, and every PDO's data.
#[inline(never)]
fn our_cycle(master: &mut Master<'static, Small, 127>, now: &mut Duration, frames: &[Frame]) -> u64 {
    *now += PERIOD;
    let now = *now;
    master.handle_timeout(now);
    while let Some(frame) = master.poll_transmit(now) {
        black_box(frame);
    }
    for frame in frames {
        black_box(master.handle_frame(now, black_box(frame)));
    }
    while let Some(event) = master.poll_event() {
        black_box(event);
    }
    let mut sum = 0;
    while let Some((node, number)) = master.poll_pdo() {
        let data = master.pdo(node, number).map_or(&[][..], |image| image.data());
        sum += u64::from(black_box(data).first().copied().unwrap_or(0));
    }
    black_box(master.poll_timeout());
    sum
}

pub(super) fn run(judge: &mut Judge) {
    let entries = [1, 2, 3, 4].map(|sub| Mapped::new(0x6401, sub, 16));
    let mapping: Mapping<4> = Mapping::new(&entries).expect("64 bits");
    let communication = Communication { event_timer: 100, ..Communication::event_driven(CobId(0x285)) };
    let mut rpdo = Rpdo::new(&communication, mapping.bytes());
    let bytes = [1, 2, 3, 4, 5, 6, 7, 8];
    let frame = Frame::standard(0x285, bytes);
    let mut od = ObjectDictionary::<16>::new();
    let mut their_mapping = PdoMapping::<4>::default();
    for sub in 1..=4 {
        let at = TheirAddress::new(0x6401, sub);
        od.insert(at, TheirEntry::rw(Value::Unsigned16(0))).expect("room");
        their_mapping.push(MappingEntry { address: at, bit_length: 16 }).expect("room");
    }
    assert_eq!(our_pdos(&mut rpdo, &mapping, &frame), their_pdos(&their_mapping, &mut od, &bytes));
    let mut contenders = [
        Contender::new("ours", || _ = black_box(our_pdos(&mut rpdo, &mapping, &frame))),
        Contender::new("canopen-rs", || _ = black_box(their_pdos(&their_mapping, &mut od, &bytes))),
    ];
    let times = judge.measure(1005, &mut contenders);
    judge.faster("8-byte PDO to four 16-bit values", 8.0, (PDOS.into(), "M/s "), &times);
    drop(contenders);

    let (mut master, mut now, frames) = (master(), Duration::ZERO, cycle_frames());
    our_cycle(&mut master, &mut now, &frames);
    assert_eq!(our_cycle(&mut master, &mut now, &frames), (1..=u64::from(NODES)).sum());
    let mut contenders = [
        Contender::new("a cycle", || {
            for _ in 0..CYCLES {
                black_box(our_cycle(&mut master, &mut now, &frames));
            }
        }),
        Contender::new("a PDO", || _ = black_box(their_pdos(&their_mapping, &mut od, &bytes))),
    ];
    let times = judge.measure(1005, &mut contenders);
    judge.costs("cycle of 126 nodes, in their PDOs", 20.0, [CYCLES, PDOS], &times);
}
