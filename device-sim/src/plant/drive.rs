//! Drives: what they make of a demand.

use super::STEP;

/// What a controller demands of a drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Demand {
    /// Share of the full speed, −1…1: a voltage, or a set value on a bus.
    Speed(f64),
    /// Stepper clock.
    Clock {
        /// Pulses a second.
        frequency: f64,
        /// Whether the pulses turn the motor backward.
        backward: bool,
    },
    /// Binary signals.
    Signals {
        /// Forward.
        forward: bool,
        /// Backward.
        backward: bool,
        /// Slow jog.
        slow: bool,
        /// Fast jog.
        fast: bool,
    },
}

/// A drive with its load.
#[derive(Debug, Clone)]
pub enum Drive {
    /// Speed-controlled: reaches the demanded speed like a first-order system.
    FirstOrder {
        /// Units per second at full demand.
        speed: f64,
        /// Time constant, s.
        tau: f64,
        /// Demanded velocity now.
        target: f64,
    },
    /// Speed-controlled: a second-order system.
    SecondOrder {
        /// Units per second at full demand.
        speed: f64,
        /// Natural frequency, 1/s.
        omega: f64,
        /// Damping, 1 = aperiodic.
        damping: f64,
        /// Demanded velocity now.
        target: f64,
        /// Acceleration now.
        acceleration: f64,
    },
    /// A servo amplifier with a speed controller that moves a mass against friction.
    Servo(Servo),
    /// A hydraulic cylinder with a proportional valve.
    Hydraulic(Valve),
    /// A stepper motor.
    Stepper(Stepper),
    /// A motor with two contactor speeds.
    TwoSpeed(TwoSpeed),
}

/// A speed controller (PI) and a mass with friction.
#[derive(Debug, Clone)]
pub struct Servo {
    /// Units per second at full demand.
    pub speed: f64,
    /// Mass, kg, or inertia.
    pub mass: f64,
    /// Greatest force, in mass · units/s².
    pub force: f64,
    /// Friction in proportion to the velocity, force a unit/s.
    pub viscous: f64,
    /// Friction of a moving axis.
    pub coulomb: f64,
    /// Force that it takes to set the axis moving.
    pub stiction: f64,
    /// Force a unit/s of speed error.
    pub gain: f64,
    /// Reset time of the controller, s.
    pub reset: f64,
    target: f64,
    integral: f64,
}

impl Servo {
    /// A servo without friction: `speed` units/s, `mass`, `force`.
    #[must_use]
    pub fn new(speed: f64, mass: f64, force: f64) -> Self {
        // A loop of 5 ms, and an integral that is ten times slower.
        let gain = mass / 0.005;
        Self {
            speed,
            mass,
            force,
            viscous: 0.0,
            coulomb: 0.0,
            stiction: 0.0,
            gain,
            reset: 0.05,
            target: 0.0,
            integral: 0.0,
        }
    }

    fn step(&mut self, velocity: f64) -> f64 {
        let error = self.target - velocity;
        let wanted = self.gain * error + self.integral;
        let force = wanted.clamp(-self.force, self.force);
        if force == wanted {
            self.integral += self.gain * error * STEP / self.reset;
        }
        // Slower than friction stops within a step, and held by it: at rest.
        let grip = self.stiction.max(self.coulomb);
        if libm::fabs(velocity) <= grip / self.mass * STEP && libm::fabs(force) <= grip {
            return 0.0;
        }
        let against = if velocity == 0.0 { force } else { velocity };
        let friction = self.viscous * velocity + libm::copysign(self.coulomb, against);
        velocity + (force - friction) / self.mass * STEP
    }
}

/// A proportional valve and a cylinder.
#[derive(Debug, Clone)]
pub struct Valve {
    /// Units per second, extending, at full demand.
    pub speed: f64,
    /// Share of the demand in which nothing flows.
    pub overlap: f64,
    /// Speed backward, as a share of that forward (ratio of the cylinder's areas).
    pub backward: f64,
    /// Natural frequency of oil column and load, 1/s.
    pub omega: f64,
    /// Damping.
    pub damping: f64,
    target: f64,
    acceleration: f64,
}

impl Valve {
    /// A valve with 3 % overlap, an area ratio of 0.8, 20 Hz and a damping of 0.5.
    #[must_use]
    pub const fn new(speed: f64) -> Self {
        Self {
            speed,
            overlap: 0.03,
            backward: 0.8,
            omega: 125.0,
            damping: 0.5,
            target: 0.0,
            acceleration: 0.0,
        }
    }

    fn flow(&self, demand: f64) -> f64 {
        let open = ((libm::fabs(demand) - self.overlap) / (1.0 - self.overlap)).max(0.0);
        let full = if demand < 0.0 { -self.speed * self.backward } else { self.speed };
        open * full
    }
}

/// A stepper motor: follows each pulse, unless it is asked too much.
#[derive(Debug, Clone)]
pub struct Stepper {
    /// Units a step.
    pub step: f64,
    /// Frequency from which it starts and stops without losing steps, Hz.
    pub start: f64,
    /// Greatest change of frequency, Hz a second.
    pub acceleration: f64,
    /// Greatest frequency, Hz.
    pub pull_out: f64,
    /// Steps made, a whole number apart from the one under way.
    made: f64,
    /// Pulses so far; whole ones only are steps.
    pulses: f64,
    frequency: f64,
    lost: u64,
}

impl Stepper {
    /// A motor of `step` units a step that starts at 500 Hz, gains 100 kHz a second and falls out of step
    /// above 50 kHz.
    #[must_use]
    pub const fn new(step: f64) -> Self {
        Self {
            step,
            start: 500.0,
            acceleration: 100_000.0,
            pull_out: 50_000.0,
            made: 0.0,
            pulses: 0.0,
            frequency: 0.0,
            lost: 0,
        }
    }

    /// Milliseconds in which pulses were lost.
    #[must_use]
    pub const fn lost(&self) -> u64 {
        self.lost
    }

    fn begin(&mut self, frequency: f64) {
        let change = libm::fabs(frequency - self.frequency);
        let within = libm::fabs(frequency) <= self.start || change <= self.acceleration * 0.001;
        let follows = within && libm::fabs(frequency) <= self.pull_out;
        if !follows {
            self.lost += 1;
        }
        self.frequency = if follows { frequency } else { 0.0 };
    }

    /// Moves on by a step of time; the units moved.
    fn advance(&mut self) -> f64 {
        self.pulses += self.frequency * STEP;
        // Rounding must not swallow the pulse that ends a period.
        let made = libm::floor(self.pulses + 1e-6);
        let moved = made - self.made;
        self.made = made;
        moved * self.step
    }
}

/// A motor behind contactors: creep and rapid speed, with the times that it needs to change.
#[derive(Debug, Clone)]
pub struct TwoSpeed {
    /// Creep speed, units per second.
    pub slow: f64,
    /// Rapid speed, units per second.
    pub fast: f64,
    /// Units per second that the speed changes in a second.
    pub acceleration: f64,
    target: f64,
}

impl TwoSpeed {
    /// A motor of these two speeds and this acceleration.
    #[must_use]
    pub const fn new(slow: f64, fast: f64, acceleration: f64) -> Self {
        Self { slow, fast, acceleration, target: 0.0 }
    }
}

impl Drive {
    /// A first-order drive: `speed` units/s at full demand, time constant `tau` s.
    #[must_use]
    pub const fn first_order(speed: f64, tau: f64) -> Self {
        Self::FirstOrder { speed, tau, target: 0.0 }
    }

    /// A second-order drive: `speed` units/s at full demand, `omega` 1/s, `damping`.
    #[must_use]
    pub const fn second_order(speed: f64, omega: f64, damping: f64) -> Self {
        Self::SecondOrder { speed, omega, damping, target: 0.0, acceleration: 0.0 }
    }

    /// Takes the demand of the next millisecond. A demand of another kind than the drive's is none.
    pub(super) fn begin(&mut self, demand: Demand) {
        let share = match demand {
            Demand::Speed(share) => share.clamp(-1.0, 1.0),
            Demand::Clock { .. } | Demand::Signals { .. } => 0.0,
        };
        match self {
            Self::FirstOrder { speed, target, .. } | Self::SecondOrder { speed, target, .. } => {
                *target = share * *speed;
            }
            Self::Servo(servo) => servo.target = share * servo.speed,
            Self::Hydraulic(valve) => valve.target = valve.flow(share),
            Self::Stepper(stepper) => stepper.begin(match demand {
                Demand::Clock { frequency, backward } => {
                    if backward {
                        -frequency
                    } else {
                        frequency
                    }
                }
                _ => 0.0,
            }),
            Self::TwoSpeed(motor) => {
                motor.target = match demand {
                    Demand::Signals { forward, backward, slow, fast } if forward != backward => {
                        let speed = if fast {
                            motor.fast
                        } else if slow {
                            motor.slow
                        } else {
                            0.0
                        };
                        if forward { speed } else { -speed }
                    }
                    _ => 0.0,
                }
            }
        }
    }

    /// Position and velocity a step later.
    pub(super) fn step(&mut self, position: f64, velocity: f64) -> (f64, f64) {
        let next = match self {
            Self::FirstOrder { tau, target, .. } => {
                velocity + (*target - velocity) * (1.0 - libm::exp(-STEP / *tau))
            }
            Self::SecondOrder { omega, damping, target, acceleration, .. } => {
                second_order(velocity, acceleration, *target, *omega, *damping)
            }
            Self::Servo(servo) => servo.step(velocity),
            Self::Hydraulic(valve) => {
                second_order(velocity, &mut valve.acceleration, valve.target, valve.omega, valve.damping)
            }
            Self::Stepper(stepper) => {
                let moved = stepper.advance();
                return (position + moved, stepper.frequency * stepper.step);
            }
            Self::TwoSpeed(motor) => {
                let most = motor.acceleration * STEP;
                velocity + (motor.target - velocity).clamp(-most, most)
            }
        };
        // The trapezoid between two velocities is exact while the acceleration is constant.
        (position + (velocity + next) / 2.0 * STEP, next)
    }

    /// Forgets what drives on while a brake or a stop holds the axis.
    pub(super) fn hold(&mut self) {
        match self {
            Self::SecondOrder { acceleration, .. } => *acceleration = 0.0,
            Self::Servo(servo) => servo.integral = 0.0,
            Self::Hydraulic(valve) => valve.acceleration = 0.0,
            Self::Stepper(stepper) => stepper.frequency = 0.0,
            Self::FirstOrder { .. } | Self::TwoSpeed(_) => {}
        }
    }
}

fn second_order(velocity: f64, acceleration: &mut f64, target: f64, omega: f64, damping: f64) -> f64 {
    *acceleration += (omega * omega * (target - velocity) - 2.0 * damping * omega * *acceleration) * STEP;
    velocity + *acceleration * STEP
}
