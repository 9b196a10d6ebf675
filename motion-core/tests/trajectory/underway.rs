//! Changes while moving: limits, targets, velocities, starts beyond the limits, and many axes at once.

use motion_core::trajectory::{Bank, Generator, Goal, LimitError, Limits, PlanError, Profile, State};
use oorandom::Rand64;

use crate::check::{SLACK, assert_continuous, excess};
use crate::{between, count, decades, limits, moving, oracle};

/// The farthest that a profile gets in the direction of its target, beyond it.
fn beyond(profile: &Profile, from: &State) -> f64 {
    let target = profile.end().position;
    let sign = (target - from.position).signum();
    let times = profile.phases().iter().enumerate().flat_map(|(index, phase)| {
        let end = profile.phases().get(index + 1).map_or(profile.duration(), |next| next.begin);
        let disc = phase.acceleration * phase.acceleration - 2.0 * phase.jerk * phase.velocity;
        let root = disc.max(0.0).sqrt();
        [root, -root]
            .map(|root| phase.begin - 2.0 * phase.velocity / (phase.acceleration + root))
            .into_iter()
            .filter(move |time| (phase.begin..=end).contains(time))
    });
    times.map(|time| (profile.at(time).position - target) * sign).fold(0.0, f64::max)
}

#[test]
fn lowered_limits_never_carry_beyond_the_target() {
    let mut random = Rand64::new(41);
    let mut harder = 0;
    for _ in 0..count() {
        let before = limits(&mut random, 1e3, false, true);
        let target = (between(&mut random, -1.0, 1.0) * 1e6).round();
        let mut generator = Generator::new(0.0, before);
        generator.set_goal(Goal::Position(target)).unwrap();
        for change in 0..3 {
            generator.step(between(&mut random, 0.0, 1.0) * generator.remaining());
            let from = generator.state();
            let lower = |random: &mut Rand64| 1.0 / decades(random, 1.0, 20.0);
            let now = generator.limits();
            let lowered = Limits::new(
                now.velocity() * lower(&mut random),
                now.acceleration() * lower(&mut random),
                now.deceleration() * lower(&mut random),
                now.jerk() * lower(&mut random),
            );
            // Three times 20 makes a ratio that is refused; the limits stay then.
            let Ok(lowered) = lowered else { continue };
            generator.set_limits(lowered).unwrap();
            let what = (change, before, lowered, from, target);
            assert!(!generator.overshoots(), "{what:?}");
            assert_continuous(generator.profile(), &from, &before, &what);
            let far = beyond(generator.profile(), &from);
            assert!(far <= 1e-9 * target.abs().max(1.0), "{far} beyond the target: {what:?}");
            let mut plain = Profile::at_rest(0.0);
            plain.move_to(&from, &lowered, target).unwrap();
            harder += u32::from(plain.overshoots());
        }
        generator.step(generator.remaining());
        assert_eq!(generator.state(), State::at_rest(target));
    }
    assert!(harder > 1000, "only {harder} cases in which the old limits were needed");
}

#[test]
fn overshooting_is_said_where_nothing_prevents_it() {
    let limits = Limits::new(100.0, 50.0, 50.0, 100.0).unwrap();
    let mut generator = Generator::new(0.0, limits);
    generator.set_goal(Goal::Velocity(100.0)).unwrap();
    generator.step(generator.remaining());
    let position = generator.state().position;
    generator.set_goal(Goal::Position(position + 50.0)).unwrap();
    assert!(generator.overshoots());
    assert!(beyond(generator.profile(), &generator.state()) > 50.0);
    generator.set_goal(Goal::Position(position + 1000.0)).unwrap();
    assert!(!generator.overshoots());
    // Behind it: it has to turn, but goes beyond nothing that lies ahead.
    generator.set_goal(Goal::Position(position - 50.0)).unwrap();
    assert!(!generator.overshoots());
}

#[test]
fn targets_changed_while_moving() {
    let mut random = Rand64::new(42);
    for _ in 0..count() / 4 {
        let limits = limits(&mut random, 1e3, false, true);
        let mut generator = Generator::new(0.0, limits);
        for _ in 0..6 {
            let goal = if random.rand_float() < 0.7 {
                Goal::Position((between(&mut random, -1.0, 1.0) * 1e6).round())
            } else {
                Goal::Velocity(between(&mut random, -1.0, 1.0) * limits.velocity())
            };
            let from = generator.state();
            generator.set_goal(goal).unwrap();
            let what = (limits, from, goal);
            assert_continuous(generator.profile(), &from, &limits, &what);
            // A state inside a former profile is inside the limits up to its last digits.
            let excess = excess(generator.profile(), &limits);
            assert!(excess <= SLACK, "{excess:e}: {what:?}");
            generator.step(between(&mut random, 0.0, 1.2) * generator.remaining());
        }
        generator.set_goal(Goal::Position(-7.0)).unwrap();
        generator.step(generator.remaining());
        assert_eq!(generator.state(), State::at_rest(-7.0));
    }
}

#[test]
fn targets_at_the_stopping_distance() {
    let mut random = Rand64::new(43);
    for turn in 0..count() {
        let limits = limits(&mut random, 1e3, turn % 2 == 0, true);
        let from = moving(&mut random, &limits, 0.0);
        let mut stop = Profile::at_rest(0.0);
        stop.stop(&from, &limits).unwrap();
        let mut target = stop.end().position;
        for _ in 0..random.rand_range(0..6) {
            target = if turn % 3 == 0 { target.next_up() } else { target.next_down() };
        }
        let mut profile = Profile::at_rest(0.0);
        profile.move_to(&from, &limits, target).unwrap();
        let what = (limits, from, target);
        assert_continuous(&profile, &from, &limits, &what);
        assert!(excess(&profile, &limits) <= SLACK, "{what:?}");
        // A unit in the last place of the way costs its square root of time, or a reversal.
        let late = profile.duration() - stop.duration();
        assert!(late >= -1e-9 * stop.duration(), "{late}: {what:?}");
        assert!(late <= 1e-3 * stop.duration(), "{late} of {}: {what:?}", stop.duration());
        assert_eq!(profile.at(profile.duration()), State::at_rest(target));
    }
}

#[test]
fn starts_beyond_the_limits_come_back_as_fast_as_the_jerk_allows() {
    let mut random = Rand64::new(44);
    for _ in 0..count() {
        let limits = limits(&mut random, 1e3, false, true);
        let within = |random: &mut Rand64| between(random, -1.0, 1.0);
        let from = State {
            position: 0.0,
            velocity: 3.0 * within(&mut random) * limits.velocity(),
            acceleration: 3.0 * within(&mut random) * limits.acceleration().max(limits.deceleration()),
        };
        let target = (within(&mut random) * 1e6).round();
        let mut profile = Profile::at_rest(0.0);
        profile.move_to(&from, &limits, target).unwrap();
        let what = (limits, from, target);
        assert_continuous(&profile, &from, &limits, &what);
        let least = oracle::least_time(&from, &limits, target, 0.0);
        let late = profile.duration() / least - 1.0;
        assert!(late.abs() <= SLACK, "{late:e} slower than {least}: {what:?}\n{profile:?}");
        assert_eq!(profile.at(profile.duration()), State::at_rest(target));
    }
}

#[test]
fn cycles_do_not_change_the_arrival() {
    let limits = Limits::new(3_276_800.0, 6_553_600.0, 6_553_600.0, 65_536_000.0).unwrap();
    let mut arrivals = [0.0; 2];
    for (cycle, arrival) in [0.001, 0.006].into_iter().zip(&mut arrivals) {
        let mut generator = Generator::new(0.0, limits);
        generator.set_goal(Goal::Position(1_000_000.0)).unwrap();
        let duration = generator.profile().duration();
        let mut cycles = 0.0;
        while !generator.arrived() {
            generator.step(cycle);
            cycles += 1.0;
        }
        assert!((cycles - 1.0) * cycle < duration && duration <= cycles * cycle + 1e-9);
        assert_eq!(generator.state(), State::at_rest(1_000_000.0));
        *arrival = duration;
    }
    assert_eq!(arrivals[0].to_bits(), arrivals[1].to_bits());
}

#[test]
fn a_bank_gives_the_same_as_its_profiles() {
    let mut random = Rand64::new(45);
    let mut bank = Bank::new();
    let profiles: Vec<Profile> = (0..Bank::LANES)
        .map(|lane| {
            let limits = limits(&mut random, 1e3, false, lane % 5 != 0);
            let from = moving(&mut random, &limits, lane as f64);
            let last = if lane % 3 == 0 { limits.velocity() / 2.0 } else { 0.0 };
            let mut profile = Profile::at_rest(0.0);
            profile.pass(&from, &limits, 1e5, last).unwrap();
            profile
        })
        .collect();
    for (lane, profile) in profiles.iter().enumerate() {
        bank.follow(lane, profile, 0.0);
    }
    let longest = profiles.iter().map(Profile::duration).fold(0.0, f64::max);
    let mut now = 0.0;
    while now < 1.1 * longest {
        bank.evaluate(now, &profiles);
        for (lane, profile) in profiles.iter().enumerate() {
            let state = profile.at(now);
            let scale = 1e5 + state.position.abs();
            assert!((bank.positions()[lane] - state.position).abs() < 1e-12 * scale, "lane {lane} at {now}");
            assert!((bank.velocities()[lane] - state.velocity).abs() < 1e-9, "lane {lane} at {now}");
            if now >= profile.duration() && state.velocity == 0.0 {
                assert_eq!((bank.positions()[lane], bank.velocities()[lane]), (1e5, 0.0));
            }
        }
        now += decades(&mut random, 1e-5, 0.3);
    }
}

#[test]
fn what_cannot_be_planned_is_refused() {
    let limits = Limits::new(100.0, 50.0, 50.0, 100.0).unwrap();
    assert!(matches!(Limits::new(0.0, 1.0, 1.0, 1.0), Err(LimitError::Range { name: "velocity", .. })));
    assert!(matches!(Limits::new(1.0, 1.0, 1.0, f64::NAN), Err(LimitError::Range { name: "jerk", .. })));
    assert!(matches!(Limits::new(1.0, 1.0, 1e5, 1.0), Err(LimitError::Ratio { .. })));
    let mut profile = Profile::at_rest(3.0);
    let from = State::at_rest(3.0);
    assert!(matches!(profile.move_to(&from, &limits, f64::NAN), Err(PlanError::Range { .. })));
    assert!(matches!(profile.move_to(&from, &limits, 1e16), Err(PlanError::Range { .. })));
    assert!(matches!(profile.reach(&from, &limits, -101.0), Err(PlanError::Velocity { .. })));
    let fast = State { velocity: 1e300, ..from };
    assert!(matches!(profile.move_to(&fast, &limits, 0.0), Err(PlanError::Range { name: "velocity", .. })));
    assert_eq!((profile.duration(), profile.at(9.0)), (0.0, from));
    // No way at all.
    profile.move_to(&from, &limits, 3.0).unwrap();
    assert_eq!((profile.duration(), profile.at(1.0)), (0.0, from));
}
