//! The set value generator against rsruckig, and with the feature `ruckig` against Ruckig itself.
//!
//! `cargo bench -p benches --bench trajectory` runs it all and ends with status 1 when a ratio is below
//! its bar; `-- --smoke` runs every measurement a few times and judges nothing.
//!
//! The same moves go to all, in whole units. rsruckig's limits of acceleration have a direction
//! instead of growing and falling speed, so that asymmetric moves are forward ones. Ruckig has no
//! asymmetric limits, and its Rust interface copies all inputs with every call: its times are printed
//! for information.

use core::hint::black_box;
use std::process::ExitCode;

use benches::{Contender, paired};
use motion_core::trajectory::{Bank, Generator, Goal, Limits, Profile, State};
use oorandom::Rand64;
use rsruckig::prelude::{
    InputParameter, OutputParameter, Ruckig, RuckigResult, ThrowErrorHandler, Trajectory,
};

type Peer = Ruckig<1, ThrowErrorHandler>;

const MOVES: usize = 2_000;
const AXES: usize = 4_096;
const CYCLE: f64 = 0.001;
/// Cycles in a measurement.
const CYCLES: usize = 20;
/// The batch and `at_time` are measured over as many times more: what others left in the cache counts
/// for little then.
const MORE: usize = 10;
const PEER_AXES: usize = 16;
/// Short, so that the peers' moves do not end in the many cycles that they make.
const PEER_CYCLE: f64 = 1e-6;

#[derive(Clone, Copy)]
struct Move {
    from: State,
    limits: Limits,
    target: f64,
}

fn moves(scale: f64, moving: bool, symmetric: bool, count: usize) -> Vec<Move> {
    let mut random = Rand64::new(u128::from(moving) * 2 + u128::from(symmetric));
    let mut decades = move |low: f64, high: f64| low * (high / low).powf(random.rand_float());
    let mut one = move || {
        let velocity = decades(scale, 1000.0 * scale).round();
        let acceleration = velocity / decades(0.01, 10.0);
        let deceleration = if symmetric { acceleration } else { acceleration * decades(0.1, 10.0) };
        let jerk = acceleration / decades(0.01, 10.0);
        let limits = Limits::new(velocity, acceleration, deceleration, jerk).expect("in range");
        let share = move |random: f64| if moving { random.log10() / 2.0 } else { 0.0 };
        // 0.1…10 as an exponent gives −0.5…0.5.
        let from = State {
            position: (decades(1.0, 1000.0) * scale).round(),
            velocity: velocity * share(decades(0.1, 10.0)),
            acceleration: acceleration.min(deceleration) * share(decades(0.1, 10.0)),
        };
        let way = (decades(1.0, 10_000.0) * scale).round();
        Move { from, limits, target: from.position + way }
    };
    let fits = |plan: &Move| {
        let rest = plan.from.velocity
            + plan.from.acceleration * plan.from.acceleration.abs() / (2.0 * plan.limits.jerk());
        rest.abs() < plan.limits.velocity()
    };
    core::iter::repeat_with(&mut one).filter(fits).take(count).collect()
}

fn for_peer(plan: &Move) -> InputParameter<1> {
    let mut input = InputParameter::new(None);
    input.current_position[0] = plan.from.position;
    input.current_velocity[0] = plan.from.velocity;
    input.current_acceleration[0] = plan.from.acceleration;
    input.target_position[0] = plan.target;
    input.max_velocity[0] = plan.limits.velocity();
    input.max_acceleration[0] = plan.limits.acceleration();
    let mut least = input.max_acceleration.clone();
    least[0] = -plan.limits.deceleration();
    input.min_acceleration = Some(least);
    input.max_jerk[0] = plan.limits.jerk();
    input
}

fn solves(result: Result<RuckigResult, rsruckig::prelude::RuckigError>) -> bool {
    matches!(result, Ok(RuckigResult::Working | RuckigResult::Finished))
}

#[cfg(feature = "ruckig")]
fn for_ruckig(plan: &Move) -> ruckig::InputParameter {
    let mut input = ruckig::InputParameter::new(1);
    input.current_position[0] = plan.from.position;
    input.current_velocity[0] = plan.from.velocity;
    input.current_acceleration[0] = plan.from.acceleration;
    input.target_position[0] = plan.target;
    input.max_velocity[0] = plan.limits.velocity();
    input.max_acceleration[0] = plan.limits.acceleration();
    input.max_jerk[0] = plan.limits.jerk();
    input
}

/// Whether a ratio reaches its bar; prints the line.
fn judge(smoke: bool, line: &str, ratio: f64, bar: f64) -> bool {
    let good = smoke || ratio >= bar;
    let verdict = match (smoke, good) {
        (true, _) => "",
        (false, true) => "  ok",
        (false, false) => "  BELOW THE BAR",
    };
    println!("{line}  {ratio:6.2} x  bar {bar:.1}{verdict}");
    good
}

fn planning(moving: bool, symmetric: bool, rounds: usize, smoke: bool, bar: f64) -> bool {
    let all = moves(1e3, moving, symmetric, MOVES);
    let mut peer = Peer::new(None, CYCLE);
    let mut trajectory = Trajectory::<1>::new(None);
    // Only what the peer solves: it is slower where it gives up. Each has its inputs one after the other.
    let (solved, inputs): (Vec<Move>, Vec<InputParameter<1>>) = all
        .iter()
        .map(|plan| (*plan, for_peer(plan)))
        .filter(|(_, input)| solves(peer.calculate(input, &mut trajectory)))
        .unzip();
    #[cfg(feature = "ruckig")]
    let mut cpp: (Vec<_>, _, _) = (
        solved.iter().map(for_ruckig).collect(),
        ruckig::Ruckig::new_direct(1, CYCLE),
        ruckig::Trajectory::new_direct(1),
    );
    let mut profile = Profile::at_rest(0.0);
    let mut contenders = vec![
        Contender::new("ours", || {
            for plan in &solved {
                profile.move_to(&plan.from, &plan.limits, plan.target).expect("in range");
                black_box(&profile);
            }
        }),
        Contender::new("rsruckig", || {
            for input in &inputs {
                _ = black_box(peer.calculate(input, &mut trajectory));
            }
        }),
    ];
    #[cfg(feature = "ruckig")]
    contenders.push(Contender::new("ruckig", || {
        for input in &mut cpp.0 {
            _ = black_box(cpp.1.calculate(input, &mut cpp.2));
        }
    }));
    let names: Vec<_> = contenders.iter().map(|contender| contender.name).collect();
    let times = paired(&mut contenders, rounds);
    let mut line = format!(
        "new trajectory, {}, {}:",
        if moving { "moving" } else { "from rest" },
        if symmetric { "symmetric" } else { "asymmetric" }
    );
    for (at, name) in names.iter().enumerate() {
        line += &format!(" {name} {:.0} ns", times.median(at).as_secs_f64() * 1e9 / solved.len() as f64);
    }
    judge(smoke, &line, times.ratio(1, 0), bar)
}

/// The peer's `at_time` of some trajectories.
fn sample(trajectories: &[Trajectory<1>], at: f64, put: &mut OutputParameter<1>) {
    let OutputParameter { new_position: p, new_velocity: v, new_acceleration: a, .. } = put;
    for trajectory in trajectories {
        let (p, v, a) = (&mut *p, &mut *v, &mut *a);
        trajectory.at_time(at, &mut Some(p), &mut Some(v), &mut Some(a), &mut None, &mut None);
        black_box((p[0], v[0], a[0]));
    }
}

/// A step with position control and supervision of a few axes, and the batch evaluation of `AXES` of them,
/// beside the peer's `update` and `at_time` of a few.
fn stepping(rounds: usize, smoke: bool) -> bool {
    let plans = moves(1e3, false, false, AXES);
    let mut generators: Vec<Generator> = plans
        .iter()
        .map(|plan| {
            let mut generator = Generator::new(plan.from.position, plan.limits);
            generator.set_goal(Goal::Position(plan.target)).expect("in range");
            generator
        })
        .collect();
    let profiles: Vec<Profile> = generators.iter().map(|generator| generator.profile().clone()).collect();
    generators.truncate(PEER_AXES);
    let mut banks = vec![Bank::new(); AXES / Bank::LANES];
    for (bank, profiles) in banks.iter_mut().zip(profiles.chunks(Bank::LANES)) {
        for (lane, profile) in profiles.iter().enumerate() {
            bank.follow(lane, profile, 0.0);
        }
    }
    let mut now = 0.0;
    let (mut peers, mut at) = (Vec::new(), 0.0);
    for plan in &plans {
        let mut peer = Peer::new(None, PEER_CYCLE);
        let (input, mut output) = (for_peer(plan), OutputParameter::<1>::new(None));
        if peers.len() < PEER_AXES && solves(peer.update(&input, &mut output)) {
            peers.push((peer, input, output));
        }
    }
    let trajectories: Vec<_> = peers.iter().map(|(_, _, output)| output.trajectory.clone()).collect();
    let mut put = OutputParameter::<1>::new(None);
    assert_eq!(peers.len(), PEER_AXES);
    let mut contenders = vec![
        Contender::new("step", || {
            for _ in 0..CYCLES * AXES / PEER_AXES {
                for generator in &mut generators {
                    let state = generator.step(PEER_CYCLE);
                    let actual = state.position.trunc();
                    let deviation = state.position - actual;
                    let velocity = state.velocity + 20.0 * deviation;
                    black_box((velocity, deviation.abs() >= 1000.0));
                }
            }
        }),
        Contender::new("batch", || {
            for _ in 0..MORE * CYCLES {
                now += CYCLE;
                for (bank, profiles) in banks.iter_mut().zip(profiles.chunks(Bank::LANES)) {
                    bank.evaluate(now, profiles);
                    black_box(bank.positions());
                }
            }
        }),
        Contender::new("rsruckig update", || {
            for _ in 0..CYCLES * AXES / PEER_AXES {
                for (peer, input, output) in &mut peers {
                    _ = black_box(peer.update(input, output));
                    output.pass_to_input(input);
                }
            }
        }),
        Contender::new("rsruckig at_time", || {
            for _ in 0..MORE * CYCLES * AXES / PEER_AXES {
                at += PEER_CYCLE / MORE as f64;
                sample(&trajectories, at, &mut put);
            }
        }),
    ];
    let times = paired(&mut contenders, rounds);
    let each =
        |which: usize, more: usize| times.median(which).as_secs_f64() * 1e9 / (AXES * CYCLES * more) as f64;
    println!(
        "per axis and cycle: step {:.1} ns, batch {:.2} ns, rsruckig update {:.0} ns, at_time {:.1} ns",
        each(0, 1),
        each(1, MORE),
        each(2, 1),
        each(3, MORE)
    );
    let step = judge(smoke, "step with feedback against update:", times.ratio(2, 0), 10.0);
    let batch = judge(smoke, "batch against update:", times.ratio(2, 1) * MORE as f64, 80.0);
    let at_time = judge(smoke, "batch against at_time:", times.ratio(3, 1), 6.0);
    step && batch && at_time
}

/// How many of the same moves each leaves unsolved.
fn unsolved(count: usize) {
    for scale in [1.0, 1e3, 1e6] {
        for (moving, symmetric) in [(false, true), (false, false), (true, true), (true, false)] {
            let all = moves(scale, moving, symmetric, count);
            let mut profile = Profile::at_rest(0.0);
            let ours = all.iter().filter(|plan| {
                profile.move_to(&plan.from, &plan.limits, plan.target).is_err()
                    || profile.at(profile.duration()) != State::at_rest(plan.target)
            });
            let mut line = format!(
                "unsolved of {count}, scale {scale:e}, {}, {}: ours {}",
                if moving { "moving" } else { "from rest" },
                if symmetric { "symmetric" } else { "asymmetric" },
                ours.count()
            );
            let mut peer = Peer::new(None, CYCLE);
            let mut trajectory = Trajectory::<1>::new(None);
            let gone =
                all.iter().filter(|plan| !solves(peer.calculate(&for_peer(plan), &mut trajectory))).count();
            line += &format!(", rsruckig {gone}");
            #[cfg(feature = "ruckig")]
            if symmetric {
                let mut peer = ruckig::Ruckig::new_direct(1, CYCLE);
                let mut trajectory = ruckig::Trajectory::new_direct(1);
                let gone = all
                    .iter()
                    .filter(|plan| {
                        let result = peer.calculate(&mut for_ruckig(plan), &mut trajectory);
                        !matches!(result, ruckig::Result::Working | ruckig::Result::Finished)
                    })
                    .count();
                line += &format!(", ruckig {gone}");
            }
            println!("{line}");
        }
    }
}

fn main() -> ExitCode {
    let smoke = std::env::args().any(|arg| arg == "--smoke");
    let rounds = if smoke { 3 } else { 101 };
    let mut good = true;
    for (moving, symmetric, bar) in
        [(false, true, 3.5), (false, false, 3.5), (true, true, 2.0), (true, false, 2.0)]
    {
        good &= planning(moving, symmetric, rounds, smoke, bar);
    }
    good &= stepping(rounds, smoke);
    println!(
        "state of an axis: generator {} B, bank {} B a lane",
        size_of::<Generator>(),
        size_of::<Bank>() / Bank::LANES
    );
    unsolved(if smoke { 1_000 } else { 100_000 });
    if good { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
