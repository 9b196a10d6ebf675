//! The function blocks. A block is made once and called every cycle; an order begins with a rising
//! `execute`, and ends in exactly one of done, aborted by another order, or an error.

use core::ptr;

use motion_core::application::MotionError;
use motion_core::application::blocks::{
    GearIn, GearOut, Halt, Home, Jog, MoveAbsolute, MoveRelative, MoveVelocity, Outputs, Power, Reset,
    SetPosition, Stop,
};

use crate::plc::{Plc, plc};

/// Which block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C)]
pub enum BlockKind {
    /// Enables the drive.
    Power,
    /// Looks for the reference point.
    Home,
    /// To a position.
    MoveAbsolute,
    /// By a distance.
    MoveRelative,
    /// With a velocity, without an end.
    MoveVelocity,
    /// By hand.
    Jog,
    /// Stops with the greatest deceleration, and holds.
    Stop,
    /// Stops with the working deceleration.
    Halt,
    /// Acknowledges a failure.
    Reset,
    /// Makes the actual position what is given.
    SetPosition,
    /// Along with an actual value input.
    GearIn,
    /// Ends gearing.
    GearOut,
}

/// A function block.
#[derive(Debug)]
pub struct Block(Any);

#[derive(Debug)]
enum Any {
    Power(Power),
    Home(Home),
    MoveAbsolute(MoveAbsolute),
    MoveRelative(MoveRelative),
    MoveVelocity(MoveVelocity),
    Jog(Jog),
    Stop(Stop),
    Halt(Halt),
    Reset(Reset),
    SetPosition(SetPosition),
    GearIn(GearIn),
    GearOut(GearOut),
}

/// Outputs of a block.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[repr(C)]
pub struct BlockOutputs {
    /// Carried out: at the target, at standstill, enabled, reference found.
    pub done: bool,
    /// Begun and not ended.
    pub busy: bool,
    /// The axis follows this order.
    pub active: bool,
    /// Active, and its velocity is reached, or the axis in gear.
    pub in_velocity: bool,
    /// Another order took its place.
    pub command_aborted: bool,
    /// Failed.
    pub error: bool,
    /// Why; `motion_error_text` has the words.
    pub error_id: u16,
}

impl From<Outputs> for BlockOutputs {
    fn from(outputs: Outputs) -> Self {
        let Outputs { done, busy, active, in_velocity, command_aborted, error, error_id } = outputs;
        Self { done, busy, active, in_velocity, command_aborted, error, error_id: error_id.0 }
    }
}

impl BlockOutputs {
    fn failed(error: MotionError) -> Self {
        Self { error: true, error_id: error.0, ..Self::default() }
    }
}

/// Makes a block for an axis 1…6; to be given back with `motion_block_free`. `kind` is one of
/// `MotionBlockKind`; null for others.
#[unsafe(no_mangle)]
pub extern "C" fn motion_block_new(kind: u32, axis: u8) -> *mut Block {
    let is = |other: BlockKind| kind == other as u32;
    let block = if is(BlockKind::Power) {
        Any::Power(Power::new(axis))
    } else if is(BlockKind::Home) {
        Any::Home(Home::new(axis))
    } else if is(BlockKind::MoveAbsolute) {
        Any::MoveAbsolute(MoveAbsolute::new(axis))
    } else if is(BlockKind::MoveRelative) {
        Any::MoveRelative(MoveRelative::new(axis))
    } else if is(BlockKind::MoveVelocity) {
        Any::MoveVelocity(MoveVelocity::new(axis))
    } else if is(BlockKind::Jog) {
        Any::Jog(Jog::new(axis))
    } else if is(BlockKind::Stop) {
        Any::Stop(Stop::new(axis))
    } else if is(BlockKind::Halt) {
        Any::Halt(Halt::new(axis))
    } else if is(BlockKind::Reset) {
        Any::Reset(Reset::new(axis))
    } else if is(BlockKind::SetPosition) {
        Any::SetPosition(SetPosition::new(axis))
    } else if is(BlockKind::GearIn) {
        Any::GearIn(GearIn::new(axis))
    } else if is(BlockKind::GearOut) {
        Any::GearOut(GearOut::new(axis))
    } else {
        return ptr::null_mut();
    };
    Box::into_raw(Box::new(Block(block)))
}

/// Gives a block back. Null is allowed.
///
/// # Safety
/// `block` is null or from `motion_block_new`, and not used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_block_free(block: *mut Block) {
    if !block.is_null() {
        // SAFETY: made by Box::into_raw, and given back once.
        drop(unsafe { Box::from_raw(block) });
    }
}

/// Runs `$body` with the block of one kind and the PLC; both pointers as the caller of the function
/// promises, null or valid.
macro_rules! call {
    ($kind:ident, $block:expr, $plc:expr, |$b:ident, $p:ident| $body:expr) => {{
        // SAFETY: null or valid, by the caller's promise.
        let (block, access) = unsafe { ($block.as_mut(), plc($plc)) };
        match (block, access) {
            (Some(Block(Any::$kind($b))), Some($p)) => $body,
            // A null pointer, or a block of another kind.
            _ => BlockOutputs::failed(MotionError::RANGE),
        }
    }};
}

/// Enables the drive of the axis as long as `enable`; done when it is as asked for.
///
/// # Safety
/// `block` is from `motion_block_new`; `plc` is what the application was called with.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_power(block: *mut Block, plc: *mut Plc, enable: bool) -> BlockOutputs {
    call!(Power, block, plc, |block, plc| {
        block.enable = enable;
        match block.call(plc) {
            Ok(on) => BlockOutputs { done: on == enable, busy: on != enable, ..BlockOutputs::default() },
            Err(error) => BlockOutputs::failed(error),
        }
    })
}

/// Looks for the reference point as `[804]` says.
///
/// # Safety
/// `block` is from `motion_block_new`; `plc` is what the application was called with.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_home(block: *mut Block, plc: *mut Plc, execute: bool) -> BlockOutputs {
    call!(Home, block, plc, |block, plc| {
        block.execute = execute;
        block.call(plc).into()
    })
}

/// Positions the axis: user measuring units, and units per second (0 = V Work `[684]`).
///
/// # Safety
/// `block` is from `motion_block_new`; `plc` is what the application was called with.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_move_absolute(
    block: *mut Block,
    plc: *mut Plc,
    execute: bool,
    position: i32,
    velocity: u32,
) -> BlockOutputs {
    call!(MoveAbsolute, block, plc, |block, plc| {
        block.execute = execute;
        (block.position, block.velocity) = (position, (velocity > 0).then_some(velocity));
        block.call(plc).into()
    })
}

/// Moves the axis by a distance: user measuring units, and units per second (0 = V Work `[684]`).
///
/// # Safety
/// `block` is from `motion_block_new`; `plc` is what the application was called with.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_move_relative(
    block: *mut Block,
    plc: *mut Plc,
    execute: bool,
    distance: i32,
    velocity: u32,
) -> BlockOutputs {
    call!(MoveRelative, block, plc, |block, plc| {
        block.execute = execute;
        (block.distance, block.velocity) = (distance, (velocity > 0).then_some(velocity));
        block.call(plc).into()
    })
}

/// Moves the axis with a velocity, user measuring units per second, backward < 0, until another order; not 0.
/// `in_velocity` tells that it is reached. In mode Signals only the direction counts; fast if `[858]`
/// allows it.
///
/// # Safety
/// `block` is from `motion_block_new`; `plc` is what the application was called with.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_move_velocity(
    block: *mut Block,
    plc: *mut Plc,
    execute: bool,
    velocity: i32,
) -> BlockOutputs {
    call!(MoveVelocity, block, plc, |block, plc| {
        block.execute = execute;
        block.velocity = velocity;
        block.call(plc).into()
    })
}

/// Moves the axis by hand with the velocities of `[756]`…`[774]`, as long as one direction is asked for.
///
/// # Safety
/// `block` is from `motion_block_new`; `plc` is what the application was called with.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_jog(
    block: *mut Block,
    plc: *mut Plc,
    forward: bool,
    backward: bool,
    fast: bool,
) -> BlockOutputs {
    call!(Jog, block, plc, |block, plc| {
        (block.forward, block.backward, block.fast) = (forward, backward, fast);
        block.call(plc).into()
    })
}

/// Stops the axis with the greatest deceleration, and holds it for other orders as long as `execute`.
///
/// # Safety
/// `block` is from `motion_block_new`; `plc` is what the application was called with.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_stop(block: *mut Block, plc: *mut Plc, execute: bool) -> BlockOutputs {
    call!(Stop, block, plc, |block, plc| {
        block.execute = execute;
        block.call(plc).into()
    })
}

/// Brings the axis to standstill with the working deceleration.
///
/// # Safety
/// `block` is from `motion_block_new`; `plc` is what the application was called with.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_halt(block: *mut Block, plc: *mut Plc, execute: bool) -> BlockOutputs {
    call!(Halt, block, plc, |block, plc| {
        block.execute = execute;
        block.call(plc).into()
    })
}

/// Acknowledges the failure of the axis; done when it is gone.
///
/// # Safety
/// `block` is from `motion_block_new`; `plc` is what the application was called with.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_reset(block: *mut Block, plc: *mut Plc, execute: bool) -> BlockOutputs {
    call!(Reset, block, plc, |block, plc| {
        block.execute = execute;
        block.call(plc).into()
    })
}

/// Makes the actual position what is given, user measuring units; the axis must be at rest.
///
/// # Safety
/// `block` is from `motion_block_new`; `plc` is what the application was called with.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_set_position(
    block: *mut Block,
    plc: *mut Plc,
    execute: bool,
    position: i32,
) -> BlockOutputs {
    call!(SetPosition, block, plc, |block, plc| {
        block.execute = execute;
        block.position = position;
        block.call(plc).into()
    })
}

/// Gears the axis to actual value input `master`, 1…6, numerator/denominator of its units (neither is 0; < 0 is
/// backward), until another order; only in mode Control, else an error. `in_velocity` tells that it is in gear; a
/// failure of the master stops it.
///
/// # Safety
/// `block` is from `motion_block_new`; `plc` is what the application was called with.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_gear_in(
    block: *mut Block,
    plc: *mut Plc,
    execute: bool,
    master: u8,
    numerator: i32,
    denominator: u32,
) -> BlockOutputs {
    call!(GearIn, block, plc, |block, plc| {
        block.execute = execute;
        (block.master, block.numerator, block.denominator) = (master, numerator, denominator);
        block.call(plc).into()
    })
}

/// Ends gearing: the axis goes on with the velocity that it has.
///
/// # Safety
/// `block` is from `motion_block_new`; `plc` is what the application was called with.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motion_gear_out(block: *mut Block, plc: *mut Plc, execute: bool) -> BlockOutputs {
    call!(GearOut, block, plc, |block, plc| {
        block.execute = execute;
        block.call(plc).into()
    })
}
