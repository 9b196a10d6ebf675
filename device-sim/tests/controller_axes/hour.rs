//! A long run under faults: drives that drop out, bus errors, lost frames.

use core::time::Duration;

use canopen_master::ds402;
use device_sim::can::Faults;
use lb2::code::Failure;
use motion_core::application::{Order, Progress, State, Ticket};
use motion_core::failure::{DRIVE_FAULT, DRIVE_LOST};
use oorandom::Rand32;

use super::rig::{AXES, Rig};

const MS: Duration = Duration::from_millis(1);
/// Moves go anywhere within, units.
const RANGE: i32 = 2_000_000;

/// What an axis is about.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Work {
    Idle,
    Moving(Ticket, i32),
    /// Something has been done to its drive; it is back at this time.
    Disturbed {
        kind: Kind,
        back: Duration,
        told: bool,
        stray: bool,
    },
    /// Reset, to be enabled.
    Resuming,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Dropout,
    Fault,
}

impl Kind {
    const fn failure(self) -> Failure {
        match self {
            Self::Dropout => DRIVE_LOST,
            Self::Fault => DRIVE_FAULT,
        }
    }
}

#[derive(Debug, Default)]
struct Tally {
    moves: u32,
    dropouts: u32,
    faults: u32,
    cycles: u64,
}

struct Run {
    rig: Rig,
    random: Rand32,
    work: [Work; AXES],
    tally: Tally,
    /// When each axis is disturbed next.
    next: [Duration; AXES],
}

impl Run {
    fn new(seed: u64) -> Self {
        let faults = Faults { seed, wire_error: 500, lose: 2000, ..Faults::NONE };
        // Half a turn of following error, as in 6.11.
        let limits = (0..6).flat_map(|at| [(696 + at, 32_768), (702 + at, 32_768)]);
        let mut rig = Rig::new(&limits.collect::<Vec<_>>(), faults);
        rig.start();
        let mut random = Rand32::new(seed);
        let now = rig.now();
        let next = [0; AXES].map(|_| now + random.rand_range(2_000..40_000) * MS);
        Self { rig, random, work: [Work::Idle; AXES], tally: Tally::default(), next }
    }

    fn failures(&mut self) -> Vec<(u8, Failure)> {
        self.rig.failures()
    }

    /// One cycle, all that it must do, and what happens next.
    fn cycle(&mut self) {
        let before = (self.rig.now(), self.rig.sent);
        self.rig.cycle();
        self.tally.cycles += 1;
        let now = self.rig.now();
        for (at, (was, sent)) in before.1.iter().zip(self.rig.sent).enumerate() {
            // Not one SYNC and not one set value is missed: of 10 ms, and one a cycle and ready drive.
            let bus = self.rig.controller.bus(at).unwrap();
            let ready = bus.ready().len() as u64;
            assert_eq!(sent.rpdo - was.rpdo, ready, "bus {at} at {now:?}");
            let syncs = |at: Duration| at.as_millis() as u64 / 10;
            assert!(sent.sync.abs_diff(syncs(now) + 1) <= 1, "bus {at} at {now:?}: {} SYNCs", sent.sync);
        }
        self.report();
        for axis in 0..AXES {
            let off = self.rig.real(axis) - f64::from(self.rig.status(axis).position);
            assert!(
                off.abs() < 500_000.0,
                "axis {axis} is {off} away at {now:?}: {:?} {:?}",
                self.work[axis],
                self.rig.status(axis)
            );
            self.axis(axis, now);
        }
    }

    /// Every failure is one that was caused, and is told once.
    fn report(&mut self) {
        for (axis, failure) in self.failures() {
            let work = &mut self.work[usize::from(axis) - 1];
            match work {
                Work::Disturbed { kind, told: told @ false, .. } if kind.failure() == failure => *told = true,
                // A drive that is not heard falls behind or runs ahead before guarding misses it.
                Work::Disturbed { kind: Kind::Dropout, told: false, stray: stray @ false, .. }
                    if matches!(failure, Failure::DELTA_S_MAX | Failure::DELTA_S_MIN) =>
                {
                    *stray = true;
                }
                other => panic!("axis {axis}, failure {}, {other:?} at {:?}", failure.0, self.rig.now()),
            }
        }
        if !self.rig.controller.failures().stored().is_empty() {
            lb2::device::Device::delete_failures(&mut self.rig.controller);
        }
    }

    fn axis(&mut self, axis: usize, now: Duration) {
        let status = self.rig.status(axis);
        match self.work[axis] {
            Work::Idle => {
                let position = self.random.rand_range(0..2 * RANGE as u32) as i32 - RANGE;
                let velocity = Some(self.random.rand_range(100_000..600_000));
                let ticket = self.rig.order(axis, Order::MoveAbsolute { position, velocity });
                self.work[axis] = Work::Moving(ticket, position);
            }
            Work::Moving(ticket, position) => match self.rig.progress(axis, ticket) {
                Progress::Done => {
                    assert!(status.position.abs_diff(position) <= 100, "{status:?}");
                    self.tally.moves += 1;
                    self.work[axis] = Work::Idle;
                }
                Progress::Waiting | Progress::Active => {}
                other => panic!("axis {axis} at {now:?}: {other:?}"),
            },
            Work::Disturbed { kind, back, told, .. } => {
                if now >= back {
                    assert!(told, "axis {axis} at {now:?}: {kind:?} not told");
                    if kind == Kind::Dropout && !self.rig.present[axis] {
                        self.rig.plug(axis, true);
                    } else if now >= back + 500 * MS {
                        self.rig.reset(axis);
                        self.work[axis] = Work::Resuming;
                    }
                }
                return;
            }
            Work::Resuming => {
                let enabled = self.rig.state(axis) == ds402::State::OperationEnabled;
                if status.state == State::Standstill && enabled {
                    self.work[axis] = Work::Idle;
                    self.next[axis] = now + self.random.rand_range(5_000..60_000) * MS;
                }
                return;
            }
        }
        if now >= self.next[axis] {
            self.disturb(axis, now);
        }
    }

    fn disturb(&mut self, axis: usize, now: Duration) {
        let kind = if self.random.rand_range(0..2) == 0 { Kind::Dropout } else { Kind::Fault };
        match kind {
            Kind::Dropout => {
                self.rig.plug(axis, false);
                self.tally.dropouts += 1;
            }
            Kind::Fault => {
                self.rig.fault(axis);
                self.tally.faults += 1;
            }
        }
        let back = now + (500 + self.random.rand_range(0..5_000)) * MS;
        self.work[axis] = Work::Disturbed { kind, back, told: false, stray: false };
    }

    fn run(&mut self, time: Duration) {
        let end = self.rig.now() + time;
        while self.rig.now() < end {
            self.cycle();
        }
        // To an end: what is under way finishes, nothing new goes wrong.
        self.next = [Duration::MAX; AXES];
        let settled = |work: &Work| matches!(work, Work::Moving(..));
        while !self.work.iter().all(settled) {
            self.cycle();
        }
        let targets: Vec<i32> = (0..AXES).map(|axis| 1000 * axis as i32 - 2500).collect();
        for (axis, position) in targets.iter().enumerate() {
            self.rig.order(axis, Order::MoveAbsolute { position: *position, velocity: None });
        }
        self.rig.run(Duration::from_secs(12));
        for (axis, position) in targets.into_iter().enumerate() {
            let real = self.rig.real(axis).floor();
            assert_eq!(
                (self.rig.status(axis).position, real),
                (position, f64::from(position)),
                "axis {axis}"
            );
            assert_eq!(self.rig.drive(axis, |drive| drive.motion().1), 0.0);
        }
        assert_eq!(self.failures(), []);
        let [one, two] = [0, 1].map(|at| self.rig.networks[at].bus().statistics());
        println!("{:?}", self.tally);
        println!("CAN 1: {one:?}\nCAN 2: {two:?}");
    }
}

fn six_axes_for(time: Duration) -> Tally {
    let seed = 0x0600_0006;
    println!("seed {seed:#x}");
    let mut run = Run::new(seed);
    run.run(time);
    run.tally
}

#[test]
fn six_axes_for_two_minutes_with_faults() {
    let tally = six_axes_for(Duration::from_secs(120));
    assert!(tally.dropouts >= 5 && tally.faults >= 5 && tally.moves > 50, "{tally:?}");
}

#[test]
#[ignore = "takes long: cargo test --release -p device-sim --test controller_axes -- --ignored --nocapture"]
fn six_axes_for_an_hour_with_faults() {
    let tally = six_axes_for(Duration::from_secs(3600));
    assert!(tally.dropouts > 150 && tally.faults > 150 && tally.moves > 2000, "{tally:?}");
}
