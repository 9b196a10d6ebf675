//! An axis as the application sees it: orders in, progress and status out.

use super::MotionError;

/// State of an axis, as PLCopen names them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum State {
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
    /// Geared to an actual value input.
    SynchronizedMotion,
    /// Braking on a `Stop`, or held by it.
    Stopping,
    /// Stopped by a failure, until `Reset`.
    ErrorStop,
}

/// What an axis is in one cycle.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AxisStatus {
    /// State.
    pub state: State,
    /// Actual position, user measuring units.
    pub position: i32,
    /// Actual velocity, user measuring units per second.
    pub velocity: i32,
    /// Nominal position, user measuring units.
    pub nominal_position: i32,
    /// Nominal velocity, user measuring units per second.
    pub nominal_velocity: f64,
    /// Nominal acceleration, user measuring units per second squared; 0 where no set values are
    /// generated (Signals, Ramps).
    pub nominal_acceleration: f64,
    /// Nominal minus actual position, DeltaS (4.3.2).
    pub deviation: i32,
    /// `actual = nominal`: within the tolerance window of a position reached (`[708]`, `[714]`).
    pub at_target: bool,
    /// Whether the velocity of `MoveVelocity` or `Jog` is reached, or the axis in gear after `GearIn`.
    pub in_velocity: bool,
    /// Whether the reference point was found since the controller was switched on.
    pub homed: bool,
    /// What stopped the axis.
    pub error: MotionError,
}

/// What an axis is to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Order {
    /// To a position.
    MoveAbsolute {
        /// User measuring units.
        position: i32,
        /// User measuring units per second; `None` = V Work `[684]`, or V max. where that is 0.
        velocity: Option<u32>,
    },
    /// By a distance from the present nominal position.
    MoveRelative {
        /// User measuring units.
        distance: i32,
        /// As with `MoveAbsolute`.
        velocity: Option<u32>,
    },
    /// With a velocity, without an end; in mode Signals only its direction counts.
    MoveVelocity {
        /// User measuring units per second, backward < 0; not 0.
        velocity: i32,
    },
    /// By hand, with the velocities of `[756]`…`[774]`.
    Jog {
        /// Towards greater values.
        forward: bool,
        /// Fast.
        fast: bool,
    },
    /// Automatic calibration, `[792]`…`[810]`.
    Home,
    /// Along with an actual value input, numerator/denominator of its units; only in mode Control, else
    /// [`MotionError::NOT_CONFIGURED`].
    GearIn {
        /// Actual value input, 1…6; of type Virtual2 (6.6.1.5) it takes over another input or axis.
        master: u8,
        /// Backward < 0; not 0.
        numerator: i32,
        /// Not 0.
        denominator: u32,
    },
    /// Ends gearing; the axis goes on with the velocity that it has.
    GearOut,
    /// Brakes with the working deceleration; another order may follow at once.
    Halt,
    /// Brakes with the greatest deceleration; the axis takes no orders while it is held.
    Stop,
}

/// Number of an order; later ones are greater, and wrap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ticket(u32);

/// How far an order is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// Given in this cycle; the axis takes it with the next one.
    Waiting,
    /// Being carried out.
    Active,
    /// Carried out.
    Done,
    /// Another order, or the loss of the enable, took its place.
    Aborted,
    /// Failed.
    Failed(MotionError),
}

/// The application's side of an axis.
#[derive(Debug, Clone, Default)]
pub struct AxisAccess {
    status: AxisStatus,
    /// The order that the axis has not seen.
    waiting: Option<(u32, Order)>,
    /// The last order that the axis has taken, and how it went.
    taken: Option<(u32, Progress)>,
    /// The one before it, which goes on where the axis refuses the new one.
    before: Option<(u32, Progress)>,
    /// The last order that the axis has refused.
    refused: Option<(u32, MotionError)>,
    last: u32,
    /// Levels and pulses that are no orders.
    pub(crate) power: bool,
    pub(crate) held: bool,
    pub(crate) reset: bool,
    pub(crate) set_position: Option<i32>,
    /// Whether the controller has activated the axis.
    pub(crate) activated: bool,
}

impl AxisAccess {
    /// What the axis was at the begin of the cycle.
    #[must_use]
    pub const fn status(&self) -> &AxisStatus {
        &self.status
    }

    /// Enables the drive, or takes the enable back.
    ///
    /// # Errors
    /// [`MotionError::NO_AXIS`] if the axis is not activated.
    pub const fn set_power(&mut self, on: bool) -> Result<(), MotionError> {
        if !self.activated {
            return Err(MotionError::NO_AXIS);
        }
        self.power = on;
        Ok(())
    }

    /// Gives an order; it takes the place of the one before, unless the axis refuses it.
    ///
    /// # Errors
    /// The axis is not activated, not enabled, in a failure, or held by a stop.
    pub const fn order(&mut self, order: Order) -> Result<Ticket, MotionError> {
        if !self.activated {
            return Err(MotionError::NO_AXIS);
        }
        match (self.status.state, &order) {
            (State::Disabled, _) => return Err(MotionError::NOT_ENABLED),
            (State::ErrorStop, _) if self.status.error.0 != 0 && !self.status.error.is_limit() => {
                return Err(MotionError::IN_ERROR);
            }
            (_, Order::Stop) => self.held = true,
            _ if self.held => return Err(MotionError::STOPPING),
            _ => {}
        }
        self.last = self.last.wrapping_add(1);
        self.waiting = Some((self.last, order));
        Ok(Ticket(self.last))
    }

    /// How far an order is.
    #[must_use]
    pub fn progress(&self, Ticket(ticket): Ticket) -> Progress {
        match (self.waiting, self.taken) {
            (Some((waiting, _)), _) if waiting == ticket => Progress::Waiting,
            (_, Some((taken, progress))) if taken == ticket => progress,
            _ => match self.refused {
                Some((refused, error)) if refused == ticket => Progress::Failed(error),
                _ => Progress::Aborted,
            },
        }
    }

    /// Lets go of a stop.
    pub const fn release(&mut self) {
        self.held = false;
    }

    /// Acknowledges a failure.
    pub const fn reset(&mut self) {
        self.reset = true;
    }

    /// Makes the actual position `position`, user measuring units, by way of the internal offset X.
    ///
    /// # Errors
    /// The axis is not activated, or moves.
    pub const fn set_position(&mut self, position: i32) -> Result<(), MotionError> {
        match self.status.state {
            _ if !self.activated => Err(MotionError::NO_AXIS),
            State::Disabled | State::Standstill | State::ErrorStop => {
                self.set_position = Some(position);
                Ok(())
            }
            _ => Err(MotionError::MOVING),
        }
    }

    /// The order that the axis is to take now. What it was carrying out is aborted, unless it
    /// [refuses](Self::refuse) the new one.
    pub(crate) const fn take(&mut self) -> Option<Order> {
        match self.waiting.take() {
            Some((ticket, order)) => {
                self.before = self.taken;
                self.taken = Some((ticket, Progress::Active));
                Some(order)
            }
            None => None,
        }
    }

    /// The axis does not carry out the order that it has just taken: the one before goes on.
    pub(crate) const fn refuse(&mut self, error: MotionError) {
        if let Some((ticket, _)) = self.taken {
            self.refused = Some((ticket, error));
            self.taken = self.before;
        }
    }

    /// Ends the order that is being carried out.
    pub(crate) const fn end(&mut self, progress: Progress) {
        if let Some((_, taken)) = &mut self.taken
            && matches!(taken, Progress::Active)
        {
            *taken = progress;
        }
    }

    /// Drops an order that the axis has not seen.
    pub(crate) const fn drop_waiting(&mut self, progress: Progress) {
        if let Some((ticket, _)) = self.waiting.take() {
            self.taken = Some((ticket, progress));
        }
    }

    /// The axis is not activated any more: not enabled, without orders and status.
    pub(crate) fn deactivate(&mut self) {
        *self = Self { last: self.last, ..Self::default() };
    }

    pub(crate) const fn set_status(&mut self, status: AxisStatus) {
        self.status = status;
    }
}
