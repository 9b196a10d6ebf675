//! LD 2000: a servo drive of the SERVOSTAR 600 class on CAN 2 (decision 14, `domain-notes.md` item 2).
//!
//! It follows a digital speed set value, tells its position with 2^20 increments a turn modulo 16 turns,
//! and stops when its master is no longer heard.

use core::time::Duration;

use canopen_master::data_type::DataType;
use canopen_master::ds402::{
    CONTROL_WORD, ControlWord, Drive, MODE, MODE_DISPLAY, Mode, Reaction, STATUS_WORD, State as DriveState,
    StatusWord,
};
use canopen_master::emcy::ErrorCode;
use canopen_master::lss::Identity;
use canopen_master::nmt::State;
use canopen_master::sdo::AbortCode;
use pdo::mapping::Entry as Mapped;
use pdo::{Address, Mapping, NodeId, Transmission};

use super::common::{OFF, objects, slot, unsigned8, unsigned16, unsigned32};
use super::objects::{Entry, Objects};
use super::{Context, Device, Node, Pdos, Rights, Settings};

/// Manufacturer status: bit 30 = output stage enabled.
const MANUFACTURER_STATUS: u16 = 0x1002;
/// Current or speed set value.
const SET_VALUE: u16 = 0x2060;
/// Actual values: 1 position 24 bit, 2 speed 24 bit, 3 incremental position, 11h status.
const ACTUAL: u16 = 0x2070;
/// Choice of the predefined receive and transmit PDO of channel 1; channels 2…4 follow.
const RECEIVE_CHOICE: u16 = 0x2600;
const TRANSMIT_CHOICE: u16 = 0x2A00;
/// Target velocity of profile velocity mode, in the same unit as the set value (project-defined).
const TARGET_VELOCITY: u16 = 0x60FF;
/// ASCII objects: 3500h + DPR number.
const OPMODE: u16 = 0x3500 + 180;
const CBAUD: u16 = 0x3515;
const PRBASE: u16 = 0x35D1;

/// 6060h: digital speed.
const DIGITAL_SPEED: i8 = -2;
/// PDOs whose mapping is free.
const FREE: core::ops::RangeInclusive<i128> = 37..=40;

/// One unit of speed is 1875/262144 rpm: 125 increments of 2^-20 turn a second.
const INCREMENTS: f64 = 125.0;
/// 3000 rpm in 100 ms, in units of speed a second (project-defined).
const RAMP: f64 = 4_194_304.0;
/// Twice as fast, for a quick stop and for faults (project-defined).
const FAST_RAMP: f64 = 2.0 * RAMP;
/// While the drive turns, its actual values are looked at so often for event-driven PDOs.
const LOOK: Duration = Duration::from_millis(10);
/// A warning: byte 4 of the emergency (manual of the drive class: 1 reset … 5 warning).
const CATEGORY_WARNING: u8 = 5;
const CATEGORY_RESET: u8 = 1;

/// What can go wrong in a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Fault {
    /// Heat sink too hot, F01: 4210h.
    HeatSink,
    /// Motor too hot: 4310h.
    Motor,
    /// Feedback lost, F04: 7300h.
    Feedback,
    /// Mains undervoltage, F05: 3120h.
    Undervoltage,
}

impl Fault {
    const fn code(self) -> ErrorCode {
        ErrorCode(match self {
            Self::HeatSink => 0x4210,
            Self::Motor => 0x4310,
            Self::Feedback => 0x7300,
            Self::Undervoltage => 0x3120,
        })
    }
}

/// The drive.
#[derive(Debug)]
pub struct Ld2000 {
    drive: Drive,
    /// Increments of 2^-20 turn since power-up.
    position: f64,
    /// In units of the set value.
    speed: f64,
    at: Duration,
    fault: Option<Fault>,
    /// The master was lost while the drive was enabled: no motion until bit 11 or a fault reset.
    blocked: bool,
    /// It turns, or is about to.
    moves: bool,
}

impl Ld2000 {
    /// A drive with this address and serial number.
    #[must_use]
    pub fn node(node: Option<NodeId>, serial: u32) -> Node<Self> {
        let identity = Identity { vendor: 0x6A, product: 0x2000, revision: 1, serial };
        let device = Self {
            drive: Drive::new(false),
            position: 0.0,
            speed: 0.0,
            at: Duration::ZERO,
            fault: None,
            blocked: false,
            moves: false,
        };
        Node::new(Settings { node, identity }, device, dictionary(identity), pdos())
    }

    /// Its state (CiA 402).
    #[must_use]
    pub const fn state(&self) -> DriveState {
        self.drive.state()
    }

    /// Position in increments of 2^-20 turn since power-up, and speed in units of the set value.
    #[must_use]
    pub const fn motion(&self) -> (f64, f64) {
        (self.position, self.speed)
    }

    /// A fault happens.
    pub fn fail(&mut self, context: &mut Context<'_>, fault: Fault) {
        self.update(context);
        // The first one counts until it is reset.
        if self.drive.fault().is_some() {
            self.fault = Some(fault);
            context.raise(fault.code(), [CATEGORY_RESET, 0, 0, 0, 0]);
        }
        self.update(context);
    }

    fn is_enabled(&self) -> bool {
        self.drive.state() == DriveState::OperationEnabled
    }

    /// Where the speed goes, and how fast.
    fn target(&self, objects: &Objects) -> (f64, f64) {
        match self.drive.state() {
            DriveState::OperationEnabled if self.blocked => (0.0, FAST_RAMP),
            DriveState::OperationEnabled if self.drive.control_word().has(ControlWord::HALT) => (0.0, RAMP),
            DriveState::OperationEnabled if self.drive.mode() == Mode::PROFILE_VELOCITY => {
                (objects.get(TARGET_VELOCITY, 0) as f64, RAMP)
            }
            // OPMODE 0 is digital speed; in any other the set value is no speed.
            DriveState::OperationEnabled if objects.get(OPMODE, 1) == 0 => {
                (objects.get(SET_VALUE, 0) as f64, RAMP)
            }
            _ => (0.0, FAST_RAMP),
        }
    }

    /// Lets the axis turn from `at` to `now`.
    fn turn(&mut self, now: Duration, objects: &Objects) {
        let (target, ramp) = self.target(objects);
        let time = now.saturating_sub(self.at).as_secs_f64();
        self.at = self.at.max(now);
        let ramp_time = ((target - self.speed).abs() / ramp).min(time);
        let reached = if ramp_time < time {
            target
        } else {
            self.speed + (target - self.speed).signum() * ramp * ramp_time
        };
        self.position +=
            INCREMENTS * (f64::midpoint(self.speed, reached) * ramp_time + reached * (time - ramp_time));
        self.speed = if (reached - target).abs() < 0.5 { target } else { reached };
    }

    fn control(&mut self, context: &mut Context<'_>, word: u16) {
        let before = self.drive.state();
        let word = ControlWord(word);
        let was = self.drive.control_word();
        // Bit 11 clears warnings.
        if word.0 & !was.0 & (1 << 11 | ControlWord::FAULT_RESET) != 0 {
            self.blocked = false;
        }
        for reaction in self.drive.handle_control(word).into_iter().flatten() {
            if reaction == Reaction::State(DriveState::SwitchOnDisabled)
                && before == DriveState::Fault
                && let Some(fault) = self.fault.take()
            {
                context.clear(fault.code());
            }
        }
    }

    fn show(&mut self, objects: &mut Objects) {
        let stands = self.speed == 0.0;
        self.moves = !stands || !self.at_target(objects);
        self.drive.set_flag(StatusWord::VOLTAGE_ENABLED, self.fault != Some(Fault::Undervoltage));
        self.drive.set_flag(StatusWord::WARNING, self.blocked);
        self.drive.set_flag(StatusWord::TARGET_REACHED, self.is_enabled() && self.at_target(objects));
        objects.set(STATUS_WORD, 0, i128::from(self.drive.status_word().0));
        objects.set(MODE_DISPLAY, 0, objects.get(MODE, 0));
        let status = i128::from(self.is_enabled()) << 30 | i128::from(!stands) << 16;
        objects.set(MANUFACTURER_STATUS, 0, status);
        objects.set(ACTUAL, 0x11, status);
        let position = self.position.floor() as i128;
        objects.set(ACTUAL, 1, position & 0xFF_FFFF);
        objects.set(ACTUAL, 2, self.speed.round() as i128);
        // The incremental position has as many bits a turn as PRBASE says, 16 or 20.
        let shift = if objects.get(PRBASE, 1) == 16 { 4 } else { 0 };
        objects.set(ACTUAL, 3, position >> shift);
    }

    fn at_target(&self, objects: &Objects) -> bool {
        self.speed == self.target(objects).0
    }

    /// Maps the PDO that 2600h + channel chooses, or 2A00h + channel.
    fn choose(context: &mut Context<'_>, choice: u16, channel: usize) {
        let number = context.objects.get(choice + channel as u16, 0);
        let Some(mapping) = predefined(choice, number).and_then(|mapped| Mapping::new(mapped).ok()) else {
            return;
        };
        let receive = choice == RECEIVE_CHOICE;
        let slots = if receive { context.pdos.rpdo_slots() } else { context.pdos.tpdo_slots() };
        let Some(&(mut slot)) = slots.get(channel) else { return };
        slot.mapping = mapping;
        slot.communication.cob_id = slot.communication.cob_id.with_valid(true);
        if receive {
            context.pdos.set_rpdo_slot(channel, slot);
        } else {
            context.pdos.set_tpdo_slot(channel, slot);
        }
    }
}

const RPDO_1: &[Mapped] = &[Mapped::new(CONTROL_WORD, 0, 16)];
const RPDO_22: &[Mapped] = &[Mapped::new(CONTROL_WORD, 0, 16), Mapped::new(SET_VALUE, 0, 32)];
const RPDO_32: &[Mapped] = &[Mapped::new(SET_VALUE, 0, 32)];
const TPDO_1: &[Mapped] = &[Mapped::new(STATUS_WORD, 0, 16)];
const TPDO_22: &[Mapped] =
    &[Mapped::new(STATUS_WORD, 0, 16), Mapped::new(ACTUAL, 1, 24), Mapped::new(ACTUAL, 2, 24)];
const TPDO_23: &[Mapped] = &[Mapped::new(STATUS_WORD, 0, 16), Mapped::new(MANUFACTURER_STATUS, 0, 32)];
const TPDO_32: &[Mapped] = &[Mapped::new(ACTUAL, 1, 24), Mapped::new(ACTUAL, 2, 24)];
const TPDO_33: &[Mapped] = &[Mapped::new(ACTUAL, 3, 32), Mapped::new(ACTUAL, 0x11, 32)];

/// The mapping of a predefined PDO; `None` for the free ones.
fn predefined(choice: u16, number: i128) -> Option<&'static [Mapped]> {
    match (choice, number) {
        (RECEIVE_CHOICE, 1) => Some(RPDO_1),
        (RECEIVE_CHOICE, 22) => Some(RPDO_22),
        (RECEIVE_CHOICE, 32) => Some(RPDO_32),
        (TRANSMIT_CHOICE, 1) => Some(TPDO_1),
        (TRANSMIT_CHOICE, 22) => Some(TPDO_22),
        (TRANSMIT_CHOICE, 23) => Some(TPDO_23),
        (TRANSMIT_CHOICE, 32) => Some(TPDO_32),
        (TRANSMIT_CHOICE, 33) => Some(TPDO_33),
        (_, 0) => Some(&[]),
        _ => None,
    }
}

/// PDO 1 of each direction: set values act at once, actual values answer SYNC.
fn pdos() -> Pdos {
    let mut status = slot(TPDO_1);
    status.communication.transmission = Transmission::SyncCyclic(1);
    Pdos::new([slot(RPDO_1), OFF, OFF, OFF], [status, OFF, OFF, OFF])
}

fn dictionary(identity: Identity) -> Objects {
    // Type 02, profile 402; four characters, so that the name is transferred at once.
    let mut objects = objects(0x0002_0192, "SD03", identity);
    objects.insert(0x100B, 0, unsigned8(Rights::Ro, 0));
    objects.insert(MANUFACTURER_STATUS, 0, unsigned32(Rights::Ro, 0).mappable());
    objects.insert(CONTROL_WORD, 0, unsigned16(Rights::Rw, 0).mappable());
    objects.insert(STATUS_WORD, 0, unsigned16(Rights::Ro, 0).mappable());
    let mode = |rights| Entry::number(DataType::INTEGER8, rights, i128::from(DIGITAL_SPEED)).mappable();
    objects.insert(MODE, 0, mode(Rights::Rw));
    objects.insert(MODE_DISPLAY, 0, mode(Rights::Ro));
    objects.insert(SET_VALUE, 0, Entry::number(DataType::INTEGER32, Rights::Rw, 0).mappable());
    objects.insert(TARGET_VELOCITY, 0, Entry::number(DataType::INTEGER32, Rights::Rw, 0).mappable());
    objects.insert(ACTUAL, 0, unsigned8(Rights::Ro, 0x11));
    objects.insert(ACTUAL, 1, Entry::number(DataType::UNSIGNED24, Rights::Ro, 0).mappable());
    objects.insert(ACTUAL, 2, Entry::number(DataType::INTEGER24, Rights::Ro, 0).mappable());
    objects.insert(ACTUAL, 3, Entry::number(DataType::INTEGER32, Rights::Ro, 0).mappable());
    objects.insert(ACTUAL, 0x11, unsigned32(Rights::Ro, 0).mappable());
    for channel in 0..4 {
        let choice = if channel == 0 { 1 } else { 0 };
        objects.insert(RECEIVE_CHOICE + channel, 0, unsigned8(Rights::Rw, choice));
        objects.insert(TRANSMIT_CHOICE + channel, 0, unsigned8(Rights::Rw, choice));
    }
    // Name, value, lowest, highest, default.
    for (index, value, low, high) in [(OPMODE, 0, 0, 8), (CBAUD, 500, 10, 1000), (PRBASE, 20, 16, 20)] {
        let long = |value| Entry::number(DataType::INTEGER32, Rights::Ro, value);
        let own = Entry { rights: Rights::Rw, ..long(value) }.within(low, high);
        // Format 7 is a 32-bit number.
        let format = Entry::number(DataType::UNSIGNED8, Rights::Ro, 7);
        objects.insert_all(index, [own, long(low.into()), long(high.into()), long(value), format]);
    }
    objects.insert_all(0x3500, [unsigned16(Rights::Ro, 3)]);
    objects
}

impl Device for Ld2000 {
    fn check(&mut self, _objects: &Objects, at: Address, value: &[u8]) -> Result<(), AbortCode> {
        let number = i128::from(value.first().copied().unwrap_or(0));
        match at.index {
            RECEIVE_CHOICE..0x2604 | TRANSMIT_CHOICE..0x2A04 => {
                let choice = at.index & 0xFF00;
                let known = predefined(choice, number).is_some() || FREE.contains(&number);
                if known { Ok(()) } else { Err(AbortCode::INVALID_VALUE) }
            }
            MODE if ![DIGITAL_SPEED, Mode::PROFILE_VELOCITY.0].contains(&(number as u8 as i8)) => {
                Err(AbortCode::INVALID_VALUE)
            }
            _ => Ok(()),
        }
    }

    fn written(&mut self, context: &mut Context<'_>, at: Address) {
        match at.index {
            CONTROL_WORD => {
                let word = context.objects.get(CONTROL_WORD, 0) as u16;
                self.turn(context.now, context.objects);
                self.control(context, word);
            }
            RECEIVE_CHOICE..0x2604 | TRANSMIT_CHOICE..0x2A04 => {
                Self::choose(context, at.index & 0xFF00, usize::from(at.index & 3));
            }
            // A mapping of one's own makes the channel a free one.
            0x1600..0x1604 => context.objects.set(at.index - 0x1600 + RECEIVE_CHOICE, 0, 37),
            0x1A00..0x1A04 => context.objects.set(at.index - 0x1A00 + TRANSMIT_CHOICE, 0, 37),
            MODE => self.drive.set_mode(Mode(context.objects.get(MODE, 0) as i8)),
            _ => {}
        }
        self.update(context);
    }

    fn update(&mut self, context: &mut Context<'_>) {
        self.turn(context.now, context.objects);
        if self.speed == 0.0 {
            let _ = self.drive.quick_stop_done();
            let _ = self.drive.fault_reaction_done();
        }
        self.show(context.objects);
    }

    fn poll_timeout(&self) -> Option<Duration> {
        let stopping =
            matches!(self.drive.state(), DriveState::QuickStopActive | DriveState::FaultReactionActive);
        (self.moves || stopping).then(|| self.at.saturating_add(LOOK))
    }

    fn state(&mut self, context: &mut Context<'_>, state: State) {
        self.turn(context.now, context.objects);
        match state {
            // A cold start: power stays on, the output stage does not.
            State::BootUp => {
                self.drive = Drive::new(false);
                self.blocked = false;
                self.drive.set_mode(Mode(context.objects.get(MODE, 0) as i8));
                if self.fault.is_some() {
                    let _ = self.drive.fault();
                }
            }
            State::Stopped => self.control(context, 0x02),
            _ => {}
        }
        self.update(context);
    }

    fn master(&mut self, context: &mut Context<'_>, lost: bool) {
        // Warning n04: only an enabled output stage reacts.
        if lost && self.is_enabled() {
            self.blocked = true;
            context.mention(ErrorCode::LIFE_GUARD, [CATEGORY_WARNING, 4, 0, 0, 0]);
        }
        self.update(context);
    }
}
