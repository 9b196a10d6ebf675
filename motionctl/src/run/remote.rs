//! Axes by way of the process image (manual A 6.9 leaves its use to the PLC program; the layout here is
//! project-defined). Numbers are in the byte order of `[056]`.
//!
//! Twelve bytes an axis each way, axis n from byte 12·(n − 1) on:
//!
//! | byte | input | output |
//! |---|---|---|
//! | 0 | control word | status word |
//! | 2 | not used | error number |
//! | 4 | position to move to, 32 bits | actual position, 32 bits |
//! | 8 | velocity, 32 bits without sign, 0 = V Work | actual velocity, 32 bits |
//!
//! A velocity above V max., and so also what would be a negative one, is refused with error 106h.
//!
//! Control word: 0 enable, 1 move to the position (rising edge), 2 halt (rising edge), 3 stop, 4 jog
//! forward, 5 jog backward, 6 jog fast, 7 home (rising edge), 8 reset (rising edge). Status word: 0
//! enabled, 1 standstill, 2 moving, 3 actual = nominal, 4 homed, 5 stopped by an error, 6 move done,
//! 7 move aborted or failed.
//!
//! Where the bus is not in data exchange the axis is halted; when it is back, orders are taken once their
//! bits have all been 0: what stood in the image before the loss moves nothing.

use motion_core::AXES;
use motion_core::application::blocks::{Halt, Home, Jog, MoveAbsolute, Power, Reset, Stop};
use motion_core::application::{MotionError, Plc, State};

/// Bytes an axis.
const LEN: usize = 12;

/// Blocks of one axis.
#[derive(Debug)]
struct Axis {
    power: Power,
    motion: MoveAbsolute,
    halt: Halt,
    stop: Stop,
    jog: Jog,
    home: Home,
    reset: Reset,
    /// Orders are taken: their bits were 0 since the bus is in data exchange.
    armed: bool,
}

/// Bits that begin something: 1, 4, 5, 7.
const ORDERS: i16 = 0b1011_0010;

/// All axes that the image has room for.
#[derive(Debug)]
pub(super) struct Remote {
    axes: Vec<Axis>,
}

impl Remote {
    pub(super) fn new() -> Self {
        let axes = (1..=AXES).map(|axis| Axis {
            power: Power::new(axis),
            motion: MoveAbsolute::new(axis),
            halt: Halt::new(axis),
            stop: Stop::new(axis),
            jog: Jog::new(axis),
            home: Home::new(axis),
            reset: Reset::new(axis),
            armed: false,
        });
        Self { axes: axes.collect() }
    }

    /// One cycle.
    pub(super) fn cycle(&mut self, plc: &mut Plc<'_>) {
        for (at, axis) in self.axes.iter_mut().enumerate() {
            if plc.bus.output().len() < LEN * (at + 1) || plc.bus.input().len() < LEN * (at + 1) {
                break;
            }
            axis.cycle(plc, LEN * at);
        }
    }
}

impl Axis {
    fn cycle(&mut self, plc: &mut Plc<'_>, at: usize) {
        let live = plc.bus.is_live();
        let control = plc.bus.read_i16(at).unwrap_or(0);
        self.armed = live && (self.armed || control & ORDERS == 0);
        let armed = self.armed;
        let bit = |number: u8| control >> number & 1 != 0;
        let number = |offset| plc.bus.read_i32(at + offset).unwrap_or(0);
        let (position, velocity) = (number(4), number(8));

        self.power.enable = bit(0);
        self.motion.execute = armed && bit(1);
        self.motion.position = position;
        self.motion.velocity = (velocity != 0).then_some(velocity as u32);
        self.halt.execute = !live || bit(2);
        self.stop.execute = bit(3);
        (self.jog.forward, self.jog.backward, self.jog.fast) = (armed && bit(4), armed && bit(5), bit(6));
        self.home.execute = armed && bit(7);
        self.reset.execute = armed && bit(8);

        // An axis that is not activated says so in its error number.
        let enabled = self.power.call(plc);
        self.reset.call(plc);
        self.stop.call(plc);
        let halted = self.halt.call(plc);
        self.home.call(plc);
        self.jog.call(plc);
        let moved = self.motion.call(plc);

        let status = plc.axis(self.power.axis).map(|axis| *axis.status()).unwrap_or_default();
        let moving = !matches!(status.state, State::Disabled | State::Standstill | State::ErrorStop);
        let flags = [
            enabled == Ok(true),
            status.state == State::Standstill,
            moving,
            status.at_target,
            status.homed,
            status.state == State::ErrorStop,
            moved.done,
            moved.command_aborted || moved.error,
        ];
        let word = flags.iter().rev().fold(0, |word, flag| word << 1 | i16::from(*flag));
        let refused = [moved.error_id, halted.error_id].into_iter().find(|error| *error != MotionError::NONE);
        let error = match (enabled, status.error) {
            (Err(error), _) => error,
            (_, MotionError::NONE) => refused.filter(|_| live).unwrap_or(MotionError::NONE),
            (_, error) => error,
        };
        plc.bus.write_i16(at, word);
        plc.bus.write_i16(at + 2, error.0 as i16);
        plc.bus.write_i32(at + 4, status.position);
        plc.bus.write_i32(at + 8, status.velocity);
    }
}
