//! The application: moves the axes as the digital inputs say.

use motion_core::application::blocks::{Home, MoveAbsolute, Power, Reset, SetPosition, Stop};
use motion_core::application::{Application, Plc};
use motion_core::io::{Pwm, Terminal};

const AXES: usize = 6;

/// Where each axis goes while its input I2.0…I2.5 is high, user measuring units; 0 while it is low.
pub const FAR: [i32; AXES] = [60_000, 40_000, 9_000, 400_000, 300_001, 250_000];

/// A positioning that begins anew with every edge of its input.
#[derive(Debug)]
struct Shuttle {
    mover: MoveAbsolute,
    high: bool,
    due: bool,
}

/// - I1.0 enables all drives, I1.1 calibrates axis 1, I1.2 stops all axes and holds them, I1.3
///   acknowledges failures, I1.4 makes the position of axis 3 77.
/// - I2.0…I2.5 move the axes.
/// - Q2.0…Q2.4 tell which of the first five are at their target; C of E2 has pulses whose frequency I61
///   sets.
#[derive(Debug)]
pub struct Program {
    power: [Power; AXES],
    home: Home,
    stop: [Stop; AXES],
    reset: [Reset; AXES],
    set_position: SetPosition,
    shuttles: [Shuttle; AXES],
    /// Targets reached, by axis.
    pub(crate) arrived: [u16; AXES],
    /// Whether the calibration was done.
    pub(crate) homed: bool,
}

impl Default for Program {
    fn default() -> Self {
        let number = |at: usize| at as u8 + 1;
        let mut set_position = SetPosition::new(3);
        set_position.position = 77;
        Self {
            power: core::array::from_fn(|at| Power::new(number(at))),
            home: Home::new(1),
            stop: core::array::from_fn(|at| Stop::new(number(at))),
            reset: core::array::from_fn(|at| Reset::new(number(at))),
            set_position,
            shuttles: core::array::from_fn(|at| Shuttle {
                mover: MoveAbsolute::new(number(at)),
                high: false,
                due: false,
            }),
            arrived: [0; AXES],
            homed: false,
        }
    }
}

impl Application for Program {
    fn cycle(&mut self, plc: &mut Plc<'_>) {
        let inputs = plc.inputs;
        let high = |block: u8, bit: usize| {
            Terminal::new(block, bit as u8).is_ok_and(|terminal| inputs.get(terminal))
        };
        for power in &mut self.power {
            power.enable = high(1, 0);
            // An axis that is not activated has no drive.
            let _ = power.call(plc);
        }
        self.home.execute = high(1, 1);
        self.homed |= self.home.call(plc).done;
        for (stop, reset) in self.stop.iter_mut().zip(&mut self.reset) {
            stop.execute = high(1, 2);
            stop.call(plc);
            reset.execute = high(1, 3);
            reset.call(plc);
        }
        self.set_position.execute = high(1, 4);
        self.set_position.call(plc);
        for (at, ((shuttle, far), arrived)) in
            self.shuttles.iter_mut().zip(FAR).zip(&mut self.arrived).enumerate()
        {
            if core::mem::replace(&mut shuttle.high, high(2, at)) != high(2, at) {
                (shuttle.due, shuttle.mover.execute) = (true, false);
            } else if core::mem::take(&mut shuttle.due) {
                shuttle.mover.position = if shuttle.high { far } else { 0 };
                shuttle.mover.execute = true;
            }
            let before = shuttle.mover.outputs().done;
            *arrived += u16::from(shuttle.mover.call(plc).done && !before);
            let at_target = plc.axis(at as u8 + 1).is_ok_and(|axis| axis.status().at_target);
            plc.outputs.set(2, at as u8, at_target);
        }
        let reading = plc.analog.channel(0).map_or(0, |channel| channel.average());
        plc.pwm[1] = Pwm::pulses(1, 1_000 * u32::from(reading), 500);
    }
}
