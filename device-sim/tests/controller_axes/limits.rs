//! Limit switches, software and hardware, both sides, while jogging, positioning and calibrating: the
//! reaction comes in the cycle in which the limit is passed, and only a move back is taken.

use device_sim::plant::Switch;
use lb2::code::Failure;
use motion_core::application::{MotionError, Order, Progress, State};
use motion_core::failure::{HW_LIMIT_MINUS, HW_LIMIT_PLUS, SW_LIMIT_MINUS, SW_LIMIT_PLUS};
use motion_core::io::Terminal;

use super::rig::Rig;

/// Axis 2 of the machine.
const AXIS: usize = 1;
const LIMIT: i32 = 100_000;
/// Choices 6 and 7 of `[954]`, `[966]`: I2.0, I2.1.
const UPPER: (i32, (u8, u8)) = (6, (2, 0));
const LOWER: (i32, (u8, u8)) = (7, (2, 1));

fn terminal((block, bit): (u8, u8)) -> Terminal {
    Terminal::new(block, bit).unwrap()
}

/// Both software limits.
fn software() -> Rig {
    let at = AXIS as u16;
    Rig::enabled(&[(924 + at, 1), (930 + at, LIMIT), (936 + at, 1), (942 + at, -LIMIT)])
}

/// Both hardware limits, opened by the axis as wire-break proof ones are; `more` parameters.
fn hardware(more: &[(u16, i32)]) -> Rig {
    let at = AXIS as u16;
    let limits = [(954 + at, UPPER.0), (948 + at, 1), (966 + at, LOWER.0), (960 + at, 1)];
    let mut rig = Rig::new(&[&limits[..], more].concat(), device_sim::can::Faults::NONE);
    let limit = f64::from(LIMIT);
    rig.switches = vec![
        (AXIS, Switch::limit(terminal(UPPER.1), limit, true).opener()),
        (AXIS, Switch::limit(terminal(LOWER.1), -limit, false).opener()),
    ];
    rig.start();
    rig
}

/// Runs into a limit and comes back off it.
fn runs_into(mut rig: Rig, order: Order, upper: bool, failure: Failure) {
    let sign = if upper { 1 } else { -1 };
    let ticket = rig.order(AXIS, order);
    let cycle = rig.controller.cycle_time();
    let is_hardware = failure == HW_LIMIT_PLUS || failure == HW_LIMIT_MINUS;
    // The axis sees the switch's level, or its actual value, of the cycle before the one that reacts.
    let input = terminal(if upper { UPPER.1 } else { LOWER.1 });
    let start = rig.now();
    let mut velocity;
    loop {
        velocity = rig.status(AXIS).nominal_velocity;
        rig.cycle();
        let passed = if is_hardware {
            !rig.inputs.digital.get(input)
        } else {
            sign * rig.status(AXIS).position > LIMIT
        };
        let failed = rig.status(AXIS).state == State::ErrorStop;
        assert_eq!(failed, passed, "at {:?}", rig.now());
        if failed {
            break;
        }
        assert!(rig.now() - start < 20_000 * cycle, "no limit");
    }
    rig.assert_failed(AXIS, failure);
    assert_eq!(rig.failures().len(), 1);
    assert!(rig.status(AXIS).nominal_velocity.abs() < velocity.abs(), "brakes in this cycle");
    assert_eq!(rig.progress(AXIS, ticket), Progress::Failed(MotionError::from_failure(failure)));
    for axis in (0..super::rig::AXES).filter(|axis| *axis != AXIS) {
        assert_eq!(rig.status(axis).state, State::Standstill, "axis {axis}");
    }
    rig.until("stopped", |rig| rig.drive(AXIS, |drive| drive.motion().1) == 0.0);
    // V max./500 ms, with the way of a cycle and a period of SYNC before.
    let past = f64::from(sign) * rig.real(AXIS) - f64::from(LIMIT);
    let way = velocity * velocity / (2.0 * 1_310_720.0) + velocity.abs() * 0.03;
    assert!((0.0..way).contains(&past), "{past} of {way}");
    // Only back: further is refused at once, the rest of the way goes.
    let further = rig.order(AXIS, Order::Jog { forward: upper, fast: false });
    rig.cycle();
    assert_eq!(rig.progress(AXIS, further), Progress::Failed(MotionError::from_failure(failure)));
    rig.arrive(AXIS, 0, 327_680);
    assert_eq!((rig.status(AXIS).error, rig.failures().len()), (MotionError::NONE, 1));
    rig.until("at rest", |rig| rig.status(AXIS).position == 0);
}

const fn jog(forward: bool) -> Order {
    Order::Jog { forward, fast: true }
}

const fn position(position: i32) -> Order {
    Order::MoveAbsolute { position, velocity: None }
}

#[test]
fn upper_software_limit_while_jogging() {
    runs_into(software(), jog(true), true, SW_LIMIT_PLUS);
}

#[test]
fn lower_software_limit_while_jogging() {
    runs_into(software(), jog(false), false, SW_LIMIT_MINUS);
}

#[test]
fn upper_software_limit_while_positioning() {
    runs_into(software(), position(5 * LIMIT), true, SW_LIMIT_PLUS);
}

#[test]
fn lower_software_limit_while_positioning() {
    runs_into(software(), position(-5 * LIMIT), false, SW_LIMIT_MINUS);
}

#[test]
fn upper_hardware_limit_while_jogging() {
    runs_into(hardware(&[]), jog(true), true, HW_LIMIT_PLUS);
}

#[test]
fn lower_hardware_limit_while_jogging() {
    runs_into(hardware(&[]), jog(false), false, HW_LIMIT_MINUS);
}

#[test]
fn upper_hardware_limit_while_positioning() {
    runs_into(hardware(&[]), position(5 * LIMIT), true, HW_LIMIT_PLUS);
}

#[test]
fn lower_hardware_limit_while_positioning() {
    runs_into(hardware(&[]), position(-5 * LIMIT), false, HW_LIMIT_MINUS);
}

/// Looks for a reference point that is not there: from the turning point on over to the other end.
fn calibrates_into(choice: i32, upper: bool, failure: Failure) {
    let at = AXIS as u16;
    let more = [(792 + at, 327_680), (798 + at, 163_840), (804 + at, choice), (810 + at, 1)];
    runs_into(hardware(&more), Order::Home, upper, failure);
}

/// Forward: the lower switch is where it turns, the upper one is a failure.
#[test]
fn upper_hardware_limit_while_calibrating() {
    calibrates_into(1, true, HW_LIMIT_PLUS);
}

#[test]
fn lower_hardware_limit_while_calibrating() {
    calibrates_into(2, false, HW_LIMIT_MINUS);
}

/// Until the reference point is found a position means nothing: software limits count again afterwards.
fn software_limit_while_calibrating(upper: bool) {
    let (at, sign) = (AXIS as u16, if upper { 1 } else { -1 });
    let changes = [
        (924 + at, 1),
        (930 + at, LIMIT),
        (936 + at, 1),
        (942 + at, -LIMIT),
        (792 + at, 327_680),
        (798 + at, 163_840),
        (804 + at, if upper { 1 } else { 2 }),
    ];
    let mut rig = Rig::enabled(&changes);
    rig.order(AXIS, Order::Home);
    rig.until("beyond the limit", |rig| sign * rig.status(AXIS).position > LIMIT + 20_000);
    assert_eq!((rig.status(AXIS).state, rig.failures()), (State::Homing, vec![]));
    rig.order(AXIS, Order::Halt);
    // Taken in one cycle; in the next one it is no calibration any more.
    rig.cycle();
    rig.cycle();
    rig.assert_failed(AXIS, if upper { SW_LIMIT_PLUS } else { SW_LIMIT_MINUS });
}

#[test]
fn upper_software_limit_while_calibrating() {
    software_limit_while_calibrating(true);
}

#[test]
fn lower_software_limit_while_calibrating() {
    software_limit_while_calibrating(false);
}
