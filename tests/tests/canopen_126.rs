//! 126 nodes on one virtual 1 Mbit/s bus for 60 virtual seconds, nodes dropping out and returning.

use core::time::Duration;

use canopen_master::boot::{Config as BootConfig, ErrorControl};
use canopen_master::data_type::DataType;
use canopen_master::heartbeat;
use canopen_master::lss::Identity;
use canopen_master::master::{Config, Event, Master, SubmitError};
use canopen_master::nmt::State;
use canopen_master::od::{Communication, Dictionary, Entry, PdoSlot, Pdos, Rights, Table};
use canopen_master::sdo;
use canopen_master::slave::{self, Slave};
use canopen_master::{Address, Frame, NodeId, NodeSet, sync};
use device_sim::can::{Bus, Faults, Network, Node};
use oorandom::Rand32;
use pdo::mapping::Entry as Mapped;
use pdo::{CobId, DefaultPdo, Mapping, Transmission};

const NODES: u8 = 126;
const CONSUMER: u16 = 1500;

/// Objects of the nodes.
const PRODUCER: Address = Address::new(0x1017, 0);
/// As long as the node ID says.
const TEXT: Address = Address::new(0x2000, 0);
/// SYNCs that the node has seen in operational; its TPDO 1.
const SYNCS: Address = Address::new(0x2001, 0);

const TABLE: Table<'static, 4> = match Table::new([
    Entry::constant(0x1000, 0, DataType::UNSIGNED32, 0x0002_0192),
    Entry::variable(PRODUCER.index, 0, DataType::UNSIGNED16, 0),
    Entry::string(TEXT.index, 0, DataType::VISIBLE_STRING, 8 + NODES as u16, &[]),
    Entry::variable(SYNCS.index, 0, DataType::UNSIGNED64, 0).with_rights(Rights::Ro).mappable(),
]) {
    Ok(table) => table,
    Err(_) => panic!("entries out of order"),
};

type Device = slave::Device<'static, (), 0, 1, 1>;

fn text(node: u8) -> Vec<u8> {
    (0..8 + node).map(|index| index.wrapping_mul(node)).collect()
}

/// A node that answers each SYNC with its TPDO 1.
fn device(node: u8) -> Device {
    let mapping = Mapping::new(&[Mapped::new(SYNCS.index, SYNCS.sub, 64)]).unwrap();
    let communication = Communication {
        transmission: Transmission::SyncCyclic(1),
        ..Communication::event_driven(CobId(0x180 + u32::from(node)))
    };
    let memory = Box::leak(vec![0; TABLE.memory()].into_boxed_slice());
    let mut dictionary = Dictionary::new(const { &TABLE }.view(), memory, ()).unwrap();
    dictionary.set_bytes(TEXT, &text(node)).unwrap();
    Device { dictionary, pdos: Pdos::new([], [PdoSlot::new(communication, mapping)]) }
}

/// What the master has had of a node's TPDO 1.
#[derive(Clone, Copy, Default)]
struct Seen {
    pdos: u64,
    /// Those between that did not come.
    missing: u64,
    next: u64,
}

enum Station {
    Master { master: Box<Master<'static, Vec<u8>, 127>>, events: Vec<Event<Vec<u8>>>, seen: Vec<Seen> },
    Slave { slave: Box<Slave<Device>>, present: bool },
}

impl Station {
    fn drain(&mut self, now: Duration) {
        match self {
            Self::Master { master, events, seen } => {
                events.extend(core::iter::from_fn(|| master.poll_event()));
                while let Some((node, number)) = master.poll_pdo() {
                    assert_eq!(number, DefaultPdo::First);
                    let data = master.pdo(node, number).unwrap().data();
                    let count = u64::from_le_bytes(data.try_into().unwrap());
                    let seen = &mut seen[usize::from(node.raw())];
                    assert!(count >= seen.next, "node {node}: PDO {count} again, {} expected", seen.next);
                    seen.missing += count - seen.next;
                    seen.pdos += 1;
                    seen.next = count + 1;
                }
            }
            Self::Slave { slave, .. } => {
                while let Some(event) = slave.poll_event() {
                    match event {
                        slave::Event::ResetCommunication | slave::Event::ResetNode => {
                            boot(slave, now);
                        }
                        slave::Event::Sync(_) if slave.state() == State::Operational => {
                            let dictionary = &mut slave.objects_mut().dictionary;
                            let syncs: u64 = dictionary.get(SYNCS).unwrap();
                            dictionary.set(SYNCS, syncs + 1).unwrap();
                        }
                        _ => {}
                    }
                }
            }
        }
    }
}

/// Starts a node with its communication objects as at power-on.
fn boot(slave: &mut Slave<Device>, now: Duration) {
    slave.objects_mut().dictionary.set(PRODUCER, 0_u16).unwrap();
    assert!(slave.boot(now));
}

impl Node for Station {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        match self {
            Self::Master { master, .. } => master.handle_frame(now, frame),
            Self::Slave { slave, .. } => slave.handle_frame(now, frame),
        };
        self.drain(now);
    }

    fn handle_timeout(&mut self, now: Duration) {
        match self {
            Self::Master { master, .. } => master.handle_timeout(now),
            Self::Slave { slave, .. } => slave.handle_timeout(now),
        }
        self.drain(now);
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        match self {
            Self::Master { master, .. } => master.poll_transmit(now),
            Self::Slave { slave, .. } => slave.poll_transmit(now),
        }
    }

    fn poll_timeout(&self) -> Option<Duration> {
        match self {
            Self::Master { master, .. } => master.poll_timeout(),
            Self::Slave { slave, present } => slave.poll_timeout().filter(|_| *present),
        }
    }
}

struct World {
    network: Network,
    stations: Vec<Station>,
}

impl World {
    fn new() -> Self {
        let master = Box::new(Master::new(Config { bit_rate: 1_000_000, ..Config::default() }));
        let seen = vec![Seen::default(); 1 + usize::from(NODES)];
        let mut stations = vec![Station::Master { master, events: Vec::new(), seen }];
        for id in 1..=NODES {
            let node = NodeId::new(id).unwrap();
            let identity = Identity { serial: id.into(), ..Identity::default() };
            let mut slave = Box::new(Slave::new(&slave::Config::new(identity, Some(node)), device(id)));
            boot(&mut slave, Duration::ZERO);
            stations.push(Station::Slave { slave, present: true });
        }
        let network = Network::new(Bus::new(1_000_000, Faults::NONE), stations.len());
        Self { network, stations }
    }

    fn run(&mut self, until: Duration) {
        let mut nodes: Vec<&mut dyn Node> = self.stations.iter_mut().map(|it| it as &mut dyn Node).collect();
        while self.network.step(&mut nodes, until) {}
    }

    fn master(&mut self) -> (&mut Master<'static, Vec<u8>, 127>, &mut Vec<Event<Vec<u8>>>) {
        let Some(Station::Master { master, events, .. }) = self.stations.first_mut() else { unreachable!() };
        (master, events)
    }

    fn plug(&mut self, id: u8, on: bool, anew: bool) {
        let now = self.network.now();
        let station = self.network.station(id.into()).unwrap();
        self.network.bus().plug(station, on);
        let Some(Station::Slave { slave, present }) = self.stations.get_mut(usize::from(id)) else {
            return;
        };
        *present = on;
        if on {
            // What it wanted to send meanwhile is lost.
            while slave.poll_transmit(now).is_some() {}
            if anew {
                boot(slave, now);
            }
        }
    }
}

static BOOT: BootConfig<'static> = BootConfig {
    running: canopen_master::boot::Running::Reset,
    device_type: Some(0x0002_0192),
    identity: [None; 4],
    configured: None,
    dcf: canopen_master::boot::ConciseDcf::EMPTY,
    error_control: ErrorControl::Heartbeat { producer_ms: 1000, consumer_ms: CONSUMER },
    start: true,
    boot_up: Duration::from_secs(1),
    answer: Duration::from_millis(500),
};

/// One node's absence.
#[derive(Debug)]
struct Absence {
    node: u8,
    from: u64,
    to: u64,
    reboots: bool,
}

/// A tenth of the nodes, each away once or twice, long enough to be missed.
fn absences(random: &mut Rand32) -> Vec<Absence> {
    let mut nodes: Vec<u8> = (1..=NODES).collect();
    let mut absences = Vec::new();
    for _ in 0..u32::from(NODES).div_ceil(10) {
        let node = nodes.swap_remove(random.rand_range(0..nodes.len() as u32) as usize);
        let mut from = 1000 + u64::from(random.rand_range(0..20_000));
        for _ in 0..1 + random.rand_range(0..2) {
            let to = from + 2600 + u64::from(random.rand_range(0..10_000));
            absences.push(Absence { node, from, to, reboots: random.rand_range(0..2) == 0 });
            from = to + 4000 + u64::from(random.rand_range(0..6000));
        }
    }
    absences
}

#[test]
fn a_full_bus_with_nodes_that_come_and_go() {
    let seed = 0x0600_1026;
    println!("seed {seed:#x}");
    let mut random = Rand32::new(seed);
    let mut world = World::new();
    world.run(Duration::from_millis(20));

    // Boot of all, in parallel.
    let now = world.network.now();
    let (master, events) = world.master();
    events.clear();
    for id in NodeId::all().take(NODES.into()) {
        master.boot(now, id, &BOOT).unwrap();
    }
    world.run(now + Duration::from_secs(3));
    let (_, events) = world.master();
    let booted = events.iter().filter(|event| matches!(event, Event::Booted { result: Ok(_), .. })).count();
    assert_eq!(booted, usize::from(NODES));
    let last = events.iter().rposition(|event| matches!(event, Event::Booted { .. }));
    println!("{} events to boot {booted} nodes, the last is event {last:?}", events.len());
    events.clear();

    // 60 s of SYNC, TPDOs, heartbeats, SDO.
    let start = world.network.now();
    let producer = sync::Producer::new(Duration::from_millis(50), 0, Duration::ZERO, start).unwrap();
    world.master().0.set_sync(Some(producer));
    let absences = absences(&mut random);
    let away = |ms: u64| {
        // A rebooted node needs a moment until it can answer.
        let gone = absences.iter().filter(move |it| (it.from..it.to + 1500).contains(&ms));
        gone.filter_map(|it| NodeId::new(it.node).ok()).collect::<NodeSet>()
    };
    let mut transfers = 0_u32;
    let mut open: Option<NodeId> = None;
    let mut seen: Vec<(u64, Event<Vec<u8>>)> = Vec::new();
    for ms in 0..60_000_u64 {
        for absence in &absences {
            if ms == absence.from || ms == absence.to {
                world.plug(absence.node, ms == absence.to, absence.reboots);
            }
        }
        if open.is_none() && ms % 5 == 0 {
            let node = NodeId::new(1 + random.rand_range(0..NODES.into()) as u8).unwrap();
            if !away(ms).contains(node) && !away(ms + 100).contains(node) {
                let options = sdo::Options::default();
                let (master, _) = world.master();
                master.upload(node, Address::new(0x2000, 0), Vec::new(), &options).unwrap();
                open = Some(node);
            }
        }
        world.run(start + Duration::from_millis(ms + 1));
        let now = world.network.now();
        let (master, events) = world.master();
        for event in events.drain(..) {
            match event {
                Event::Sdo { node, finished } => {
                    assert_eq!(open.take(), Some(node));
                    let expected = text(node.raw());
                    assert_eq!(
                        finished.outcome,
                        sdo::Outcome::Done(expected.len() as u32),
                        "node {node} at {ms}"
                    );
                    assert_eq!(finished.buffer, expected);
                    transfers += 1;
                }
                Event::BootUp(node) => {
                    // Of a node that is being booted, it is the answer to its reset.
                    let begun = master.boot(now, node, &BOOT);
                    assert!(matches!(begun, Ok(()) | Err(SubmitError::Busy(_))));
                    seen.push((ms, Event::BootUp(node)));
                }
                other => seen.push((ms, other)),
            }
        }
    }

    // Every loss and return once, at its time.
    for absence in &absences {
        let node = NodeId::new(absence.node).unwrap();
        let of_node = |from: u64, to: u64| {
            seen.iter().filter(move |(at, event)| event.node() == Some(node) && (from..to).contains(at))
        };
        let lost = Event::Heartbeat { node, event: heartbeat::Event::Lost };
        let back = Event::Heartbeat { node, event: heartbeat::Event::Back };
        let during: Vec<_> = of_node(absence.from, absence.to).map(|(_, event)| event).collect();
        assert_eq!(during, [&lost], "{absence:?}");
        let after: Vec<_> = of_node(absence.to, absence.to + 3000).map(|(_, event)| event).collect();
        let backs = after.iter().filter(|event| **event == &back).count();
        assert_eq!(backs, 1, "{absence:?}: {after:?}");
        let boots = after.iter().filter(|event| matches!(event, Event::Booted { result: Ok(_), .. })).count();
        assert_eq!(boots, usize::from(absence.reboots), "{absence:?}: {after:?}");
    }
    // And nothing else: no event of a node that was there all the time, none of the bus.
    let gone: NodeSet = absences.iter().filter_map(|it| NodeId::new(it.node).ok()).collect();
    let others: Vec<_> =
        seen.iter().filter(|(_, it)| it.node().is_none_or(|id| !gone.contains(id))).collect();
    assert!(others.is_empty(), "{others:?}");

    let Some(Station::Master { seen, .. }) = world.stations.first() else { unreachable!() };
    let mut sent = 0;
    for (station, seen) in world.stations.iter().zip(seen) {
        let Station::Slave { slave, .. } = station else { continue };
        let syncs: u64 = slave.objects().dictionary.get(SYNCS).unwrap();
        let node = slave.node().unwrap();
        // One that was away may have had a PDO in its queue when it was unplugged; no other misses any.
        let times = absences.iter().filter(|it| it.node == node.raw()).count() as u64;
        assert!(seen.missing + (syncs - seen.next) <= times, "node {node}: {} of {syncs}", seen.pdos);
        if times == 0 {
            // 60 s at 50 ms, give or take the ends.
            assert!((1199..=1201).contains(&seen.pdos), "node {node}: {} PDOs", seen.pdos);
        }
        sent += syncs;
    }
    let pdos: u64 = seen.iter().map(|seen| seen.pdos).sum();
    let statistics = world.network.bus().statistics();
    println!(
        "{} absences of {} nodes; {transfers} transfers; {pdos} of {sent} PDOs; {} frames, {:.1} % of the bus",
        absences.len(),
        gone.len(),
        statistics.frames,
        statistics.bits as f64 / 10_000.0 / world.network.now().as_secs_f64(),
    );
    assert_eq!(statistics.errors, 0);
    assert!(transfers > 5000, "{transfers}");
}
