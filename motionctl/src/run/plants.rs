//! Simulated machine axes on the controller's terminals.

use device_sim::plant::{
    Connection, Drive, Incremental, Machine, Plant, Sensor, Servo, Stepper, Switch, TwoSpeed, Valve, Wiring,
};
use motion_core::io::Terminal;

use super::config::{DriveKind, LimitSection, PlantSection, Simulated};
use crate::exit::Exit;

/// All plants of a configuration. PLC Run is high, so that the program runs.
pub(super) fn machine(devices: &[Simulated]) -> Result<Machine, Exit> {
    let mut machine = Machine::default();
    machine.inputs.digital.set(Terminal::PLC_RUN, true);
    for device in devices {
        if let Simulated::Plant(section) = device {
            machine.axes.push(wiring(section)?);
        }
    }
    Ok(machine)
}

fn wiring(section: &PlantSection) -> Result<Wiring, Exit> {
    let block = section.block - 1;
    let (drive, connection) = match section.drive {
        DriveKind::FirstOrder => (Drive::first_order(section.speed, section.tau), analog(block)),
        // Critically damped, as fast as the time constant says.
        DriveKind::SecondOrder => (Drive::second_order(section.speed, 2.0 / section.tau, 1.0), analog(block)),
        // Reaches full speed within ten time constants.
        DriveKind::Servo => {
            let force = section.speed / (10.0 * section.tau);
            (Drive::Servo(Servo::new(section.speed, 1.0, force)), analog(block))
        }
        DriveKind::Hydraulic => (Drive::Hydraulic(Valve::new(section.speed)), analog(block)),
        DriveKind::Stepper => (Drive::Stepper(Stepper::new(section.step)), Connection::Clock { block }),
        DriveKind::TwoSpeed => {
            let motor = TwoSpeed::new(section.slow, section.speed, section.speed / section.tau);
            (Drive::TwoSpeed(motor), Connection::Signals { block })
        }
    };
    let sensor = Sensor::Incremental(Incremental::new(section.edges, section.mark, section.every));
    let mut wiring = Wiring::new(Plant::new(drive), connection, sensor);
    for limit in &section.limits {
        wiring = wiring.with_switch(switch(limit)?);
    }
    Ok(wiring)
}

const fn analog(block: usize) -> Connection {
    Connection::Analog { block, unipolar: false }
}

fn switch(limit: &LimitSection) -> Result<Switch, Exit> {
    let terminal: Option<Terminal> = limit.input.strip_prefix('I').and_then(|name| {
        let (block, bit) = name.split_once('.')?;
        Terminal::new(block.parse().ok()?, bit.parse().ok()?).ok()
    });
    let terminal = terminal
        .ok_or_else(|| Exit::usage(format!("limit switch input {:?}: I1.0 to I4.7 expected", limit.input)))?;
    let switch = Switch::limit(terminal, limit.position, limit.upper);
    Ok(if limit.opener { switch.opener() } else { switch })
}
