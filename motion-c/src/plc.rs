//! What an application sees and acts on during its cycle.

use core::ffi::{CStr, c_char};

use motion_core::application::blocks::ReadStatus;
use motion_core::application::{self, MotionError, State};
use motion_core::io::Terminal;

/// The controller as the application sees it; valid during one call of the application.
#[derive(Debug)]
pub struct Plc(());

/// # Safety
/// `plc` is null, or what the application was called with, during that call.
pub(crate) unsafe fn plc<'a, 'b: 'a>(plc: *mut Plc) -> Option<&'a mut application::Plc<'b>> {
    // SAFETY: it points to the PLC of this call, and the application has no other reference to it.
    unsafe { plc.cast::<application::Plc<'b>>().as_mut() }
}

/// State of an axis, as PLCopen names them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(C)]
pub enum AxisState {
    /// Not enabled.
    #[default]
    Disabled,
    /// Enabled, at rest.
    Standstill,
    /// Moving to a position.
    DiscreteMotion,
    /// Moving without an end: velocity or jog.
    ContinuousMotion,
    /// Looking for the reference point.
    Homing,
    /// Braking on a stop, or held by it.
    Stopping,
    /// Stopped by a failure, until reset.
    ErrorStop,
    /// Geared to an actual value input.
    SynchronizedMotion,
}

/// What an axis is. Positions in user measuring units, velocities a second.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C)]
pub struct AxisStatus {
    /// State.
    pub state: AxisState,
    /// Actual position.
    pub position: i32,
    /// Actual velocity.
    pub velocity: i32,
    /// Nominal position.
    pub nominal_position: i32,
    /// Nominal velocity.
    pub nominal_velocity: f64,
    /// Nominal minus actual position.
    pub deviation: i32,
    /// `actual = nominal`: within the tolerance window of a position reached.
    pub at_target: bool,
    /// Whether the velocity of a velocity order is reached, or the axis in gear.
    pub in_velocity: bool,
    /// Whether the reference point was found since power-on.
    pub homed: bool,
    /// What stopped the axis; 0 = nothing.
    pub error_id: u16,
}

/// Reads what an axis 1…6 is. An error number, 0 = done.
///
/// # Safety
/// `plc` is what the application was called with; `status` is null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_read_status(plc: *mut Plc, axis: u8, status: *mut AxisStatus) -> u16 {
    // SAFETY: as the caller promises for both pointers.
    let (plc, to) = unsafe { (self::plc(plc), status.as_mut()) };
    let (Some(plc), Some(to)) = (plc, to) else { return MotionError::RANGE.0 };
    let status = match (ReadStatus { axis }).call(plc) {
        Ok(status) => status,
        Err(error) => return error.0,
    };
    *to = AxisStatus {
        state: match status.state {
            State::Disabled => AxisState::Disabled,
            State::Standstill => AxisState::Standstill,
            State::DiscreteMotion => AxisState::DiscreteMotion,
            State::ContinuousMotion => AxisState::ContinuousMotion,
            State::Homing => AxisState::Homing,
            State::SynchronizedMotion => AxisState::SynchronizedMotion,
            State::Stopping => AxisState::Stopping,
            State::ErrorStop => AxisState::ErrorStop,
        },
        position: status.position,
        velocity: status.velocity,
        nominal_position: status.nominal_position,
        nominal_velocity: status.nominal_velocity,
        deviation: status.deviation,
        at_target: status.at_target,
        in_velocity: status.in_velocity,
        homed: status.homed,
        error_id: status.error.0,
    };
    0
}

/// Terminal I`block`.`bit`, block 1…4, bit 0…7; false for one that is not there.
///
/// # Safety
/// `plc` is what the application was called with.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_plc_digital_input(plc: *mut Plc, block: u8, bit: u8) -> bool {
    // SAFETY: as the caller promises.
    let Some(plc) = (unsafe { self::plc(plc) }) else { return false };
    Terminal::new(block, bit).is_ok_and(|terminal| plc.inputs.get(terminal))
}

/// Sets terminal Q`block`.`terminal`, block 1…3, terminal 0…4; others are ignored.
///
/// # Safety
/// `plc` is what the application was called with.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_plc_set_digital_output(plc: *mut Plc, block: u8, terminal: u8, high: bool) {
    // SAFETY: as the caller promises.
    if let Some(plc) = unsafe { self::plc(plc) } {
        plc.outputs.set(block, terminal, high);
    }
}

/// Average reading of analog channel 0…6 (I61, I62, I63: 0…1023; I54…I57: 0…1564); 0 for others.
///
/// # Safety
/// `plc` is what the application was called with.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_plc_analog_input(plc: *mut Plc, channel: u8) -> i32 {
    // SAFETY: as the caller promises.
    let Some(plc) = (unsafe { self::plc(plc) }) else { return 0 };
    plc.analog.channel(usize::from(channel)).map_or(0, |channel| i32::from(channel.average()))
}

/// Position of actual value input 1…6, user measuring units; 0 for others.
///
/// # Safety
/// `plc` is what the application was called with.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_plc_actual_value(plc: *mut Plc, input: u8) -> i32 {
    // SAFETY: as the caller promises.
    let Some(plc) = (unsafe { self::plc(plc) }) else { return 0 };
    let place = usize::from(input).checked_sub(1);
    place.and_then(|place| plc.actual.get(place)).map_or(0, |value| value.position)
}

macro_rules! texts {
    ($($error:expr => $text:literal,)*) => {
        const TEXTS: &[(u16, &CStr)] = &[$(($error.0, $text)),*];
    };
}

texts! {
    MotionError::NONE => c"no error",
    MotionError::NO_AXIS => c"no such axis, or not activated",
    MotionError::NOT_ENABLED => c"the drive is not enabled",
    MotionError::IN_ERROR => c"the axis is in a failure, reset it first",
    MotionError::STOPPING => c"the axis is held by a stop",
    MotionError::NOT_CONFIGURED => c"a parameter that the order needs is not set",
    MotionError::RANGE => c"a value of the order is out of range",
    MotionError::MOVING => c"the axis moves, standstill expected",
    MotionError::NOT_GEARED => c"the axis is not geared",
}

/// What an error number means, as a static text.
#[unsafe(no_mangle)]
pub extern "C" fn motion_error_text(error_id: u16) -> *const c_char {
    let text = TEXTS.iter().find(|(number, _)| *number == error_id).map(|(_, text)| *text);
    text.unwrap_or(c"a failure of the axis, see manual A 4.3.4.2").as_ptr()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The texts are motion-core's.
    #[test]
    fn the_texts_agree() {
        for (number, text) in TEXTS {
            assert_eq!(MotionError(*number).text(), text.to_str().ok());
        }
    }
}
