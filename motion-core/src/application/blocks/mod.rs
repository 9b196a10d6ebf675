//! Function blocks for axes, as PLCopen names them ("Function blocks for motion control", part 1).
//!
//! A block is a value of the application's own; its inputs are fields, `call` runs it once a cycle.
//! Orders begin with a rising `execute`. Busy lasts from then to the end; done, aborted and error stay
//! as long as `execute`, and one cycle at least.

use super::{AxisAccess, AxisNumber, AxisStatus, MotionError, Order, Plc, Progress, State, Ticket};

/// Outputs of a block that gives an order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub struct Outputs {
    /// Carried out: at the target, at standstill, reference found.
    pub done: bool,
    /// Begun and not ended.
    pub busy: bool,
    /// The axis follows this order.
    pub active: bool,
    /// Active, and its velocity is reached (`MoveVelocity`, `Jog`), or the axis in gear (`GearIn`).
    pub in_velocity: bool,
    /// Another order took its place.
    pub command_aborted: bool,
    /// Failed.
    pub error: bool,
    /// Why.
    pub error_id: MotionError,
}

impl Outputs {
    fn failed(error_id: MotionError) -> Self {
        Self { error: true, error_id, ..Self::default() }
    }

    fn of(access: &AxisAccess, ticket: Ticket) -> Self {
        match access.progress(ticket) {
            Progress::Waiting => Self { busy: true, ..Self::default() },
            Progress::Active => {
                let in_velocity = access.status().in_velocity;
                Self { busy: true, active: true, in_velocity, ..Self::default() }
            }
            Progress::Done => Self { done: true, ..Self::default() },
            Progress::Aborted => Self { command_aborted: true, ..Self::default() },
            Progress::Failed(error) => Self::failed(error),
        }
    }
}

/// Whether `now` is a rising edge after `last`, which becomes `now`.
const fn rising_edge(last: &mut bool, now: bool) -> bool {
    let rising = now && !*last;
    *last = now;
    rising
}

/// What every order has: the edge of `execute` and the ticket.
#[derive(Debug, Clone, Default)]
struct Execution {
    executed: bool,
    ticket: Option<Ticket>,
    outputs: Outputs,
}

impl Execution {
    /// One cycle; a rising edge gives the order.
    fn run(&mut self, plc: &mut Plc<'_>, axis: AxisNumber, execute: bool, order: Order) -> Outputs {
        let rising = rising_edge(&mut self.executed, execute);
        if !execute && self.ticket.is_none() {
            self.outputs = Outputs::default();
            return self.outputs;
        }
        let access = match plc.axis(axis) {
            Ok(access) => access,
            Err(error) => {
                self.ticket = None;
                self.outputs = if execute { Outputs::failed(error) } else { Outputs::default() };
                return self.outputs;
            }
        };
        if rising {
            match access.order(order) {
                Ok(ticket) => self.ticket = Some(ticket),
                Err(error) => {
                    self.ticket = None;
                    self.outputs = Outputs::failed(error);
                }
            }
        }
        if let Some(ticket) = self.ticket {
            self.outputs = Outputs::of(access, ticket);
            if !self.outputs.busy {
                self.ticket = None;
            }
        }
        self.outputs
    }
}

macro_rules! order_block {
    ($(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident: $kind:ty),* } => $order:expr) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Default)]
        pub struct $name {
            /// Axis, 1…6.
            pub axis: AxisNumber,
            /// A rising edge gives the order.
            pub execute: bool,
            $($(#[$field_doc])* pub $field: $kind,)*
            execution: Execution,
        }

        impl $name {
            /// A block for an axis, 1…6.
            #[must_use]
            pub fn new(axis: AxisNumber) -> Self {
                Self { axis, ..Self::default() }
            }

            /// Runs the block: once a cycle.
            pub fn call(&mut self, plc: &mut Plc<'_>) -> Outputs {
                let order: fn(&Self) -> Order = $order;
                let order = order(self);
                self.execution.run(plc, self.axis, self.execute, order)
            }

            /// Outputs of the last call.
            #[must_use]
            pub const fn outputs(&self) -> Outputs {
                self.execution.outputs
            }
        }
    };
}

order_block! {
    /// Positions an axis. Done when `actual = nominal`.
    MoveAbsolute {
        /// Target, user measuring units.
        position: i32,
        /// User measuring units per second; `None` = V Work `[684]`.
        velocity: Option<u32>
    } => |block| Order::MoveAbsolute { position: block.position, velocity: block.velocity }
}

order_block! {
    /// Moves an axis by a distance. Done when `actual = nominal`.
    MoveRelative {
        /// Distance, user measuring units.
        distance: i32,
        /// User measuring units per second; `None` = V Work `[684]`.
        velocity: Option<u32>
    } => |block| Order::MoveRelative { distance: block.distance, velocity: block.velocity }
}

order_block! {
    /// Moves an axis with a velocity until another order comes: the block stays busy. `in_velocity` means
    /// that it is reached. In mode Signals only the direction counts; fast if `[858]` allows it.
    MoveVelocity {
        /// User measuring units per second, backward < 0; not 0 (`NOT_CONFIGURED`), at most V max. `[642]`
        /// (`RANGE`).
        velocity: i32
    } => |block| Order::MoveVelocity { velocity: block.velocity }
}

order_block! {
    /// Looks for the reference point as `[804]` says. Done when it is found and the axis at rest.
    Home {} => |_| Order::Home
}

order_block! {
    /// Gears an axis to an actual value input until another order comes: the block stays busy. `in_velocity`
    /// means that it is in gear; from then on the way of the axis is that of the master times
    /// numerator/denominator, to the unit. Only in mode Control, else `NOT_CONFIGURED`; a change of the mode
    /// `[600]` brings the axis to standstill.
    ///
    /// The axis gets there within its working acceleration and jerk; what the master has gone meanwhile is
    /// not made up for. The master is any input: an encoder, or with type Virtual2 another input or axis,
    /// whose multiplier is one more ratio. If it fails, or goes faster than V max. `[642]` allows, the axis
    /// is stopped with that failure (`READING_LOST`, `DELTA_S_MAX`…).
    GearIn {
        /// Actual value input, 1…6.
        master: u8,
        /// Backward < 0; not 0.
        numerator: i32,
        /// Not 0.
        denominator: u32
    } => |block| Order::GearIn {
        master: block.master,
        numerator: block.numerator,
        denominator: block.denominator
    }
}

order_block! {
    /// Ends gearing: the axis goes on with the velocity that it has, as after `MoveVelocity`. Done at once.
    GearOut {} => |_| Order::GearOut
}

order_block! {
    /// Brings an axis to standstill with the working deceleration.
    Halt {} => |_| Order::Halt
}

/// Stops an axis with the greatest deceleration, and holds it for other orders as long as `execute`.
#[derive(Debug, Clone, Default)]
pub struct Stop {
    /// Axis, 1…6.
    pub axis: AxisNumber,
    /// Stops, and holds.
    pub execute: bool,
    execution: Execution,
}

impl Stop {
    /// A block for an axis, 1…6.
    #[must_use]
    pub fn new(axis: AxisNumber) -> Self {
        Self { axis, ..Self::default() }
    }

    /// Runs the block: once a cycle.
    pub fn call(&mut self, plc: &mut Plc<'_>) -> Outputs {
        let falling = self.execution.executed && !self.execute;
        if falling && let Ok(axis) = plc.axis(self.axis) {
            axis.release();
        }
        self.execution.run(plc, self.axis, self.execute, Order::Stop)
    }

    /// Outputs of the last call.
    #[must_use]
    pub const fn outputs(&self) -> Outputs {
        self.execution.outputs
    }
}

/// Moves an axis by hand, as long as one of the directions is asked for (not both).
#[derive(Debug, Clone, Default)]
pub struct Jog {
    /// Axis, 1…6.
    pub axis: AxisNumber,
    /// Towards greater values.
    pub forward: bool,
    /// Towards smaller values.
    pub backward: bool,
    /// With the fast velocity.
    pub fast: bool,
    wanted: Option<(bool, bool)>,
    ticket: Option<Ticket>,
    outputs: Outputs,
}

impl Jog {
    /// A block for an axis, 1…6.
    #[must_use]
    pub fn new(axis: AxisNumber) -> Self {
        Self { axis, ..Self::default() }
    }

    /// Runs the block: once a cycle.
    pub fn call(&mut self, plc: &mut Plc<'_>) -> Outputs {
        let wanted = (self.forward != self.backward).then_some((self.forward, self.fast));
        let changed = core::mem::replace(&mut self.wanted, wanted) != wanted;
        self.outputs = match plc.axis(self.axis) {
            Err(error) => Outputs::failed(error),
            Ok(axis) => self.act(axis, wanted, changed),
        };
        self.outputs
    }

    fn act(&mut self, axis: &mut AxisAccess, wanted: Option<(bool, bool)>, changed: bool) -> Outputs {
        if changed {
            let order = match wanted {
                Some((forward, fast)) => Some(Order::Jog { forward, fast }),
                // Only what this block moves is halted.
                None => self.ticket.filter(|&ticket| Outputs::of(axis, ticket).busy).map(|_| Order::Halt),
            };
            self.ticket = None;
            if let Some(order) = order {
                match axis.order(order) {
                    Ok(ticket) => self.ticket = Some(ticket),
                    Err(error) => return Outputs::failed(error),
                }
            }
        }
        match self.ticket {
            Some(ticket) => Outputs::of(axis, ticket),
            None if wanted.is_some() => self.outputs,
            None => Outputs::default(),
        }
    }

    /// Outputs of the last call.
    #[must_use]
    pub const fn outputs(&self) -> Outputs {
        self.outputs
    }
}

/// Enables the drive of an axis as long as `enable`.
#[derive(Debug, Clone, Default)]
pub struct Power {
    /// Axis, 1…6.
    pub axis: AxisNumber,
    /// Enables the drive.
    pub enable: bool,
}

impl Power {
    /// A block for an axis, 1…6.
    #[must_use]
    pub const fn new(axis: AxisNumber) -> Self {
        Self { axis, enable: false }
    }

    /// Runs the block: once a cycle. Whether the axis is enabled.
    ///
    /// # Errors
    /// There is no such axis.
    pub fn call(&mut self, plc: &mut Plc<'_>) -> Result<bool, MotionError> {
        let axis = plc.axis(self.axis)?;
        axis.set_power(self.enable)?;
        Ok(axis.status().state != State::Disabled)
    }
}

/// Acknowledges the failure of an axis on a rising `execute`; done when the failure is gone.
#[derive(Debug, Clone, Default)]
pub struct Reset {
    /// Axis, 1…6.
    pub axis: AxisNumber,
    /// A rising edge resets.
    pub execute: bool,
    executed: bool,
}

impl Reset {
    /// A block for an axis, 1…6.
    #[must_use]
    pub const fn new(axis: AxisNumber) -> Self {
        Self { axis, execute: false, executed: false }
    }

    /// Runs the block: once a cycle.
    pub fn call(&mut self, plc: &mut Plc<'_>) -> Outputs {
        let rising = rising_edge(&mut self.executed, self.execute);
        let axis = match plc.axis(self.axis) {
            Ok(axis) => axis,
            Err(error) => return Outputs::failed(error),
        };
        if rising {
            axis.reset();
        }
        let done = !rising && self.execute && axis.status().state != State::ErrorStop;
        Outputs { done, busy: self.execute && !done, ..Outputs::default() }
    }
}

/// Makes the actual position what is given, on a rising `execute`.
#[derive(Debug, Clone, Default)]
pub struct SetPosition {
    /// Axis, 1…6.
    pub axis: AxisNumber,
    /// A rising edge sets.
    pub execute: bool,
    /// User measuring units.
    pub position: i32,
    executed: bool,
    outputs: Outputs,
}

impl SetPosition {
    /// A block for an axis, 1…6.
    #[must_use]
    pub fn new(axis: AxisNumber) -> Self {
        Self { axis, ..Self::default() }
    }

    /// Runs the block: once a cycle. The status shows the new position from the next cycle on.
    pub fn call(&mut self, plc: &mut Plc<'_>) -> Outputs {
        let rising = rising_edge(&mut self.executed, self.execute);
        if rising {
            self.outputs = match plc.axis(self.axis).and_then(|axis| axis.set_position(self.position)) {
                Ok(()) => Outputs { done: true, ..Outputs::default() },
                Err(error) => Outputs::failed(error),
            };
        } else if !self.execute {
            self.outputs = Outputs::default();
        }
        self.outputs
    }
}

/// Reads what an axis is.
#[derive(Debug, Clone, Copy)]
pub struct ReadStatus {
    /// Axis, 1…6.
    pub axis: AxisNumber,
}

impl ReadStatus {
    /// Runs the block.
    ///
    /// # Errors
    /// There is no such axis.
    pub fn call(self, plc: &mut Plc<'_>) -> Result<AxisStatus, MotionError> {
        plc.axis(self.axis).map(|axis| *axis.status())
    }
}

#[cfg(test)]
mod tests;
