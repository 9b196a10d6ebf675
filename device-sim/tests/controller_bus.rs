//! The controller's CAN buses against virtual drives and against each other, on virtual time.

use core::time::Duration;

use canopen_master::ds402;
use canopen_master::scan::BusState;
use device_sim::can::{Bus, Faults, Network, Node};
use device_sim::canopen::{Fault, Ld2000};
use motion_core::bus::{CanBus, NODES};
use motion_core::control::DriveInputs;
use motion_core::failure;
use motion_core::output::DriveSetpoint;
use motion_core::parameters::Values;
use pdo::{NodeId, Payload};

const CYCLE: Duration = Duration::from_millis(2);

fn node(raw: u8) -> NodeId {
    NodeId::new(raw).unwrap()
}

fn values(changes: &[(u16, i32)]) -> Values {
    let mut values = Values::factory();
    for &(index, value) in changes {
        values.set(index, value).unwrap();
    }
    values
}

/// 6.11: axis 1 with an LD 2000 at address 1 on CAN 2.
struct Rig {
    network: Network,
    bus: CanBus,
    drive: device_sim::canopen::Node<Ld2000>,
    wanted: DriveSetpoint,
    /// The drive's plug is pulled.
    unplugged: bool,
    failure: Option<lb2::code::Failure>,
    /// Each once when it begins.
    failures: Vec<lb2::code::Failure>,
}

impl Rig {
    fn new(faults: Faults) -> Self {
        let values = values(&[(100, 2), (450, 2), (108, 0), (109, 0), (0, 2)]);
        Self {
            network: Network::new(Bus::new(500_000, faults), 2),
            bus: CanBus::new(8230, &values, 1),
            drive: Ld2000::node(Some(node(1)), 1),
            wanted: DriveSetpoint::default(),
            unplugged: false,
            failure: None,
            failures: Vec::new(),
        }
    }

    /// One control cycle; the position that the input sees.
    fn cycle(&mut self) -> Option<u32> {
        let mut inputs = DriveInputs::default();
        let now = self.network.now();
        self.bus.read_drives(now, 2, 4, &mut inputs);
        assert_eq!(inputs.input_failures, inputs.output_failures);
        // A drive that is lost fails as long as it is.
        let failure = inputs.output_failures[2];
        self.failures.extend(failure.filter(|_| failure != self.failure));
        self.failure = failure;
        self.bus.command(now, 0, &self.wanted);
        let end = now + CYCLE;
        if self.unplugged {
            let mut nodes: [&mut dyn Node; 1] = [&mut self.bus];
            while self.network.step(&mut nodes, end) {}
        } else {
            let mut nodes: [&mut dyn Node; 2] = [&mut self.bus, &mut self.drive];
            while self.network.step(&mut nodes, end) {}
        }
        inputs.positions[2]
    }

    fn run(&mut self, time: Duration) -> Option<u32> {
        let end = self.network.now() + time;
        let mut last = None;
        while self.network.now() < end {
            last = self.cycle();
        }
        last
    }

    fn state(&mut self) -> ds402::State {
        let now = self.network.now();
        self.drive.with_device(now, |drive, _| drive.state())
    }
}

#[test]
fn a_drive_is_scanned_booted_enabled_and_moved() {
    let mut rig = Rig::new(Faults::NONE);
    rig.run(Duration::from_secs(2));
    assert_eq!((rig.bus.state(), rig.bus.ready().contains(node(1))), (BusState::Ok, true));
    let row = rig.bus.row(node(1)).unwrap();
    let info = row.info.unwrap();
    assert_eq!((row.input, row.output, row.new_input), (Some(1), Some(1), true));
    assert_eq!((info.profile(), info.name.text(), info.opmode), (Some(0x0192), "SD03", Some(0)));

    rig.wanted.enable = true;
    rig.run(Duration::from_millis(200));
    assert_eq!(rig.state(), ds402::State::OperationEnabled);
    // 3000 rpm: 50 turns a second.
    rig.wanted.speed = 419_430;
    rig.run(Duration::from_secs(1));
    rig.wanted.speed = 0;
    let position = rig.run(Duration::from_millis(500)).unwrap();
    let (real, speed) = rig.drive.with_device(rig.network.now(), |drive, _| drive.motion());
    assert_eq!(speed, 0.0);
    assert_eq!(i64::from(position), (real.floor() as i64).rem_euclid(1 << 24), "exact at rest");
    assert!(real > 40.0 * f64::from(1 << 20), "{real}");
    rig.wanted.enable = false;
    rig.run(Duration::from_millis(100));
    assert_eq!(rig.state(), ds402::State::ReadyToSwitchOn);
    assert_eq!(rig.failures, []);
}

/// Between two SYNCs the position goes on with the drive's speed.
#[test]
fn the_position_is_extrapolated_between_two_syncs() {
    let mut rig = Rig::new(Faults::NONE);
    rig.run(Duration::from_secs(2));
    (rig.wanted.enable, rig.wanted.speed) = (true, 100_000);
    rig.run(Duration::from_secs(1));
    let mut last = rig.cycle().unwrap();
    for _ in 0..200 {
        let position = rig.cycle().unwrap();
        let step = position.wrapping_sub(last) & 0xFF_FFFF;
        // 100,000 · 125 increments a second, 2 ms; the actual value is as old as its way over the bus.
        assert!((23_000..27_000).contains(&step), "{step}");
        last = position;
    }
}

/// Also while it accelerates: with the speed alone each actual value would bring a jump of 3,125 increments.
#[test]
fn an_accelerating_drive_is_extrapolated_without_jumps() {
    let mut rig = Rig::new(Faults::NONE);
    rig.run(Duration::from_secs(2));
    rig.wanted.enable = true;
    rig.run(Duration::from_millis(200));
    let (mut last, mut step) = (rig.cycle().unwrap(), 0);
    for cycle in 0..400 {
        // 500,000 · 125 increments/s²: in 2 ms the way of a cycle grows by 250.
        rig.wanted.speed += 1000;
        let position = rig.cycle().unwrap();
        let way = i64::from(position.wrapping_sub(last) & 0xFF_FFFF);
        assert!(cycle < 50 || (way - step - 250).abs() < 1000, "cycle {cycle}: {step}, then {way}");
        (last, step) = (position, way);
    }
}

#[test]
fn an_unplugged_drive_is_lost_once_and_comes_back() {
    let mut rig = Rig::new(Faults::NONE);
    rig.run(Duration::from_secs(2));
    rig.wanted.enable = true;
    rig.run(Duration::from_secs(1));
    rig.unplugged = true;
    rig.run(Duration::from_millis(500));
    assert_eq!(rig.failures, [failure::DRIVE_LOST]);
    rig.unplugged = false;
    rig.wanted.enable = false;
    rig.run(Duration::from_millis(500));
    rig.wanted.enable = true;
    rig.run(Duration::from_millis(500));
    assert_eq!(rig.failures, [failure::DRIVE_LOST]);
    assert_eq!(rig.state(), ds402::State::OperationEnabled);
}

#[test]
fn a_drive_that_is_not_there_is_bus_warn_and_a_failure() {
    let mut rig = Rig::new(Faults::NONE);
    rig.unplugged = true;
    rig.run(Duration::from_secs(3));
    assert_eq!((rig.bus.state(), rig.failures.as_slice()), (BusState::Warn, &[failure::DRIVE_LOST][..]));
    // Switched on later: found by a scan.
    rig.unplugged = false;
    rig.bus.scan();
    rig.run(Duration::from_secs(2));
    assert_eq!((rig.bus.state(), rig.bus.ready().contains(node(1))), (BusState::Ok, true));
}

#[test]
fn a_fault_of_the_drive_is_told_once_and_reset_on_demand() {
    let mut rig = Rig::new(Faults::NONE);
    rig.run(Duration::from_secs(2));
    rig.wanted.enable = true;
    rig.run(Duration::from_millis(200));
    let now = rig.network.now();
    rig.drive.with_device(now, |drive, context| drive.fail(context, Fault::Motor));
    rig.run(Duration::from_millis(300));
    assert_eq!(rig.failures, [failure::DRIVE_FAULT]);
    assert_eq!(rig.state(), ds402::State::Fault, "not reset unasked");
    rig.wanted = DriveSetpoint { enable: false, reset: true, ..rig.wanted };
    rig.cycle();
    rig.wanted.reset = false;
    rig.run(Duration::from_millis(300));
    rig.wanted.enable = true;
    rig.run(Duration::from_millis(300));
    assert_eq!((rig.state(), rig.failures.len()), (ds402::State::OperationEnabled, 1));
}

/// 6.6.1.3: OPMODE must be digital speed.
#[test]
fn a_drive_in_another_operating_mode_is_refused() {
    let mut rig = Rig::new(Faults::NONE);
    // It boots first; its objects then have their values after power-up.
    Node::handle_timeout(&mut rig.drive, Duration::ZERO);
    rig.drive.with_device(Duration::ZERO, |_, context| context.objects.set(0x35B4, 1, 2));
    rig.run(Duration::from_secs(2));
    assert_eq!(rig.failures, [failure::DRIVE_MODE]);
    assert!(!rig.bus.ready().contains(node(1)));
}

/// 6.5.1.1: the example's master, two slaves, and the slaves among themselves, past the master.
#[test]
fn master_and_slaves_exchange_process_data() {
    let own = [(326, 1), (330, 1)];
    let master = values(&[&own[..], &[(310, 5), (314, 5), (311, 7), (327, 1), (315, 7), (331, 1)]].concat());
    let common = [&own[..], &[(300, 1), (313, 10), (329, 1), (317, 10), (333, 1)]].concat();
    let first = values(&[&common[..], &[(310, 5), (314, 5), (337, 1), (341, 1)]].concat());
    let second = values(&[&common[..], &[(310, 7), (314, 7)]].concat());
    let mut buses = [master, first, second].map(|values| CanBus::new(8230, &values, 0));
    let mut network = Network::new(Bus::new(500_000, Faults::NONE), 3);
    let mut run = |buses: &mut [CanBus; 3]| {
        let [a, b, c] = buses;
        let end = network.now() + Duration::from_secs(3);
        while network.step(&mut [a, b, c], end) {}
    };
    run(&mut buses);
    assert_eq!(buses[0].state(), BusState::Ok);
    assert_eq!(buses[0].ready().iter().map(NodeId::raw).collect::<Vec<_>>(), [5, 7]);
    let data = |byte: u8| Payload::from_slice(&[byte; 8]);
    buses[0].image().write(1, data(1));
    buses[0].image().write(2, data(2));
    buses[1].image().write(1, data(3));
    buses[2].image().write(1, data(4));
    buses[1].image().write(4, data(5));
    buses[2].image().write(4, data(6));
    run(&mut buses);
    assert_eq!([1, 2].map(|number| buses[0].image().input(number)), [Some(data(3)), Some(data(4))]);
    assert_eq!([1, 4].map(|number| buses[1].image().input(number)), [Some(data(1)), Some(data(6))]);
    assert_eq!([1, 4].map(|number| buses[2].image().input(number)), [Some(data(2)), Some(data(5))]);
    assert!(buses[0].image().take_new(1) && !buses[0].image().take_new(1));
}

/// 6.5.1: CAN Link has the bus for itself.
#[test]
fn can_link_replaces_canopen() {
    let values = values(&[(303, 1)]);
    let mut bus = CanBus::new(8230, &values, 1);
    bus.handle_timeout(Duration::ZERO);
    assert!(bus.link().is_some());
    for ms in 0..500 {
        let now = Duration::from_millis(ms);
        bus.handle_timeout(now);
        assert_eq!(bus.poll_transmit(now), None, "neither SYNC nor guarding");
    }
    assert!(CanBus::new(8230, &values, 0).link().is_none());
    assert_eq!(NODES, 16);
}
