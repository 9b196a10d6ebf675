//! What a bus does as a CANopen master: nodes boot, are guarded, are lost and come back.

use core::time::Duration;

use canopen_master::boot::{self, ConciseDcf, ErrorControl};
use canopen_master::master::{BusStatus, Event};
use canopen_master::sdo::Small;
use canopen_master::{NodeSet, emcy, guarding, nmt};
use pdo::NodeId;
use pdo::layout::ld2000::{DEFAULT_RPDO, DEFAULT_TPDO};

use super::{CanBus, Engine, Kind, NODES};

/// What a drive is told at boot, as a concise DCF: 2600h:00 = 22 and 2A00h:00 = 22, so that its PDO 1
/// in both directions is number 22 (decision 14); guard time 100Ch and life time factor 100Dh as the
/// controller guards, so that a drive which does not hear it any more stops (project-defined).
#[rustfmt::skip]
const DRIVE_DCF: [u8; 37] = [
    4, 0, 0, 0,
    0x0C, 0x10, 0x00, 2, 0, 0, 0, guarding::PERIOD.as_millis() as u8, 0,
    0x0D, 0x10, 0x00, 1, 0, 0, 0, guarding::LIFE_TIME_FACTOR,
    0x00, 0x26, 0x00, 1, 0, 0, 0, DEFAULT_RPDO,
    0x00, 0x2A, 0x00, 1, 0, 0, 0, DEFAULT_TPDO,
];

/// How a drive boots.
static DRIVE_BOOT: boot::Config<'static> = boot_config(match ConciseDcf::new(&DRIVE_DCF) {
    Ok(dcf) => dcf,
    Err(_) => panic!("the entries are not what they should be"),
});
/// How any other node boots.
static NODE_BOOT: boot::Config<'static> = boot_config(ConciseDcf::EMPTY);

/// Guarded as decision 16 says, then started.
const fn boot_config(dcf: ConciseDcf<'static>) -> boot::Config<'static> {
    boot::Config {
        running: boot::Running::Reset,
        device_type: None,
        identity: [None; 4],
        configured: None,
        dcf,
        error_control: ErrorControl::Guarding(guarding::Config {
            period_ms: guarding::PERIOD.as_millis() as u16,
            life_time_factor: guarding::LIFE_TIME_FACTOR,
        }),
        start: true,
        boot_up: Duration::from_secs(1),
        answer: Duration::from_millis(500),
    }
}

impl CanBus {
    /// Follows one event.
    pub(super) fn event(&mut self, now: Duration, event: &Event<Small>) {
        match *event {
            Event::Scanned { found, silent } => {
                self.scanning = false;
                self.to_boot = found;
                self.watch_silent(now, silent);
                self.start_others();
            }
            Event::Booted { node, result } => match result {
                Ok(_) => {
                    self.ready.insert(node);
                    if let Some(drive) = self.drive_mut(node) {
                        // It still sent what it was during the scan.
                        drive.restart();
                        drive.set_lost(false);
                    }
                }
                Err(_) => self.set_lost(node, true),
            },
            Event::Guarding { node, event: guarding::Event::Lost } => self.set_lost(node, true),
            // What has not booted since is not what it was.
            Event::Guarding { node, event: guarding::Event::Back } if self.ready.contains(node) => {
                self.follow_state(now, node);
            }
            Event::Emergency { node, emergency } if is_fault(&emergency) => {
                if let Some(drive) = self.drive_mut(node) {
                    drive.emergency();
                }
            }
            Event::Bus(status) => self.bus_changed(status),
            Event::State { node, .. } if self.ready.contains(node) => self.follow_state(now, node),
            Event::Nmt { missing, .. } => {
                let again = missing.and(self.ready).without(self.guarding_lost());
                again.iter().for_each(|node| self.start_node(now, node));
            }
            // A node that has started anew is not what it was: it takes a scan (4.3.4.4).
            Event::BootUp(node) if self.ready.contains(node) => {
                self.ready.remove(node);
                self.set_lost(node, true);
            }
            _ => {}
        }
    }

    /// Without a bus every drive is lost at once; when it is back, guarding tells who is not there.
    fn bus_changed(&mut self, status: BusStatus) {
        let lost = if status.is_on() { self.guarding_lost() } else { self.ready };
        for node in self.ready.iter() {
            self.set_lost(node, lost.contains(node));
        }
    }

    fn guarding_lost(&self) -> NodeSet {
        match &self.engine {
            Engine::Master(master) => master.lost(),
            Engine::Slave(_) | Engine::Link(_) => NodeSet::EMPTY,
        }
    }

    /// A drive that missed its master takes no set values until it is started again.
    fn follow_state(&mut self, now: Duration, node: NodeId) {
        let Engine::Master(master) = &self.engine else { return };
        let operational = master.state(node) == Some(nmt::State::Operational);
        self.set_lost(node, !operational);
        if !operational {
            self.start_node(now, node);
        }
    }

    fn start_node(&mut self, now: Duration, node: NodeId) {
        let Engine::Master(master) = &mut self.engine else { return };
        // A bus has at most 8 nodes with objects, and as many commands find a place. Off the bus, the
        // node shows its state when the bus is back.
        let _ = master.nmt(now, nmt::Command::Start, nmt::Target::Node(node));
    }

    fn set_lost(&mut self, node: NodeId, lost: bool) {
        if let Some(drive) = self.drive_mut(node) {
            drive.set_lost(lost);
        }
    }

    /// Silent nodes are guarded all the same (decision 16), so that their loss is told.
    fn watch_silent(&mut self, now: Duration, silent: NodeSet) {
        let Engine::Master(master) = &mut self.engine else { return };
        for node in silent.iter() {
            // Only nodes of the scan, which the master has.
            let _ = master.set_guarding(now, node, Some(guarding::Config::default()));
        }
    }

    /// Nodes that are not scanned are started as they are.
    pub(super) fn start_others(&mut self) {
        let others = self.settings.iter().filter(|object| {
            !object.bypass && (object.kind == Kind::Other || usize::from(object.node.raw()) > NODES)
        });
        let others: NodeSet = others.map(|object| object.node).collect();
        let Engine::Master(master) = &mut self.engine else { return };
        for node in others.iter() {
            // The queue holds 16 frames, of which a bus has at most 8 such nodes.
            let _ = master.send(nmt::Command::Start.frame(nmt::Target::Node(node)));
        }
    }

    /// Boots the next node that was found. A drive in a wrong operating mode stays as it is (6.6.1.3).
    pub(super) fn boot_next(&mut self, now: Duration) {
        while let Some(node) = self.to_boot.first() {
            let drive = self.settings.is_drive(node);
            let Engine::Master(master) = &mut self.engine else { return };
            let wrong_mode =
                drive && master.info(node).is_some_and(|info| info.opmode.is_some_and(|opmode| opmode != 0));
            if wrong_mode {
                self.to_boot.remove(node);
                if let Some(drive) = self.drive_mut(node) {
                    drive.wrong_mode();
                }
                continue;
            }
            let config = if drive { &DRIVE_BOOT } else { &NODE_BOOT };
            if master.boot(now, node, config).is_err() {
                // Its client is still busy with the scan: with the next event.
                return;
            }
            self.to_boot.remove(node);
        }
    }
}

/// Category byte of a drive's emergency that is only a warning (AX2000 CANopen profile, page 27).
const WARNING: u8 = 5;

/// Whether an emergency tells of a fault: not of its end, nor of a warning.
fn is_fault(emergency: &emcy::Emergency) -> bool {
    emergency.code != emcy::ErrorCode(0) && emergency.data.first() != Some(&WARNING)
}
