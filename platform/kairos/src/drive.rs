//! The base as something that takes commands, and a simulated one.
//!
//! In: commands. Out: the velocity in force, to whatever carries twists to the robot. Zero from the
//! moment that a command dies.

use core::convert::Infallible;
use core::fmt;

use hachi_hal::{
    BaseAction, BaseCommand, BaseDrive, BaseStatus, BodyVelocity, CommandFault, DeviceError,
    FaultKind, Stamp,
};

use crate::mecanum::{Mecanum, WheelLimits};
use crate::{LIMITS, WHEELS};

/// Where velocities go: a ROS topic through the bridge, a simulated base.
pub trait TwistSink {
    /// What can go wrong.
    type Error: DeviceError;
    /// Hands on the velocity in force at `now`; back at once.
    fn send(&mut self, velocity: &BodyVelocity, now: Stamp) -> Result<(), Self::Error>;
}

/// What can go wrong with a [`TwistDrive`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum TwistDriveError<E> {
    /// No base may take the command.
    Faulty(CommandFault),
    /// Wheels can't do that.
    NoLegs(BaseAction),
    /// The way to the robot.
    Sink(E),
}

impl<E: fmt::Display> fmt::Display for TwistDriveError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Faulty(fault) => fault.fmt(f),
            Self::NoLegs(action) => write!(f, "a base on wheels can't do {action:?}"),
            Self::Sink(error) => error.fmt(f),
        }
    }
}

impl<E: DeviceError> DeviceError for TwistDriveError<E> {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Faulty(fault) => fault.kind(),
            Self::NoLegs(_) => FaultKind::FixConfig,
            Self::Sink(error) => error.kind(),
        }
    }
}

/// Holds the command in force.
#[derive(Debug, Clone)]
pub struct TwistDrive<S> {
    wheels: Mecanum,
    limits: WheelLimits,
    sink: S,
    command: Option<BaseCommand>,
}

impl<S: TwistSink> TwistDrive<S> {
    /// An RB-Kairos+ behind `sink`.
    pub fn new(sink: S) -> Self {
        Self::with(WHEELS, LIMITS, sink)
    }

    /// A base with its own wheels and limits.
    pub fn with(wheels: Mecanum, limits: WheelLimits, sink: S) -> Self {
        Self {
            wheels,
            limits,
            sink,
            command: None,
        }
    }

    /// What the velocities go to.
    pub fn sink(&self) -> &S {
        &self.sink
    }
}

impl<S: TwistSink> BaseDrive for TwistDrive<S> {
    type Error = TwistDriveError<S::Error>;

    fn command(&mut self, command: &BaseCommand, now: Stamp) -> Result<(), Self::Error> {
        command.check(now).map_err(TwistDriveError::Faulty)?;
        if let BaseAction::Pose(_) = command.action {
            return Err(TwistDriveError::NoLegs(command.action));
        }
        self.command = Some(*command);
        Ok(())
    }

    fn service(&mut self, now: Stamp) -> Result<BaseStatus, Self::Error> {
        let alive = self.command.filter(|command| command.is_alive(now));
        let asked = match alive.map(|command| command.action) {
            Some(BaseAction::Move(velocity)) => velocity,
            _ => BodyVelocity::ZERO,
        };
        let (velocity, saturated) = self.wheels.limited(&self.limits, &asked);
        self.sink
            .send(&velocity, now)
            .map_err(TwistDriveError::Sink)?;
        Ok(BaseStatus {
            stamp: now,
            velocity,
            expired: self.command.is_some() && alive.is_none(),
            saturated,
        })
    }
}

/// A base that goes exactly where it is told, wheels and all.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimulatedBase {
    wheels: Mecanum,
    velocity: BodyVelocity,
    told: Option<Stamp>,
    stale_ns: i64,
}

impl SimulatedBase {
    /// A base that stands still, and does so again when it is told nothing for `stale_ns`.
    pub fn new(wheels: Mecanum, stale_ns: i64) -> Self {
        Self {
            wheels,
            velocity: BodyVelocity::ZERO,
            told: None,
            stale_ns,
        }
    }

    /// Speeds of the wheels at `now`, rad/s, as their encoders show them.
    pub fn wheel_speeds(&self, now: Stamp) -> [f64; 4] {
        let fresh = self
            .told
            .is_some_and(|told| now.nanos_since(told) < self.stale_ns);
        if fresh {
            self.wheels.wheel_speeds(&self.velocity)
        } else {
            [0.0; 4]
        }
    }
}

impl TwistSink for SimulatedBase {
    type Error = Infallible;

    fn send(&mut self, velocity: &BodyVelocity, now: Stamp) -> Result<(), Infallible> {
        self.velocity = *velocity;
        self.told = Some(now);
        Ok(())
    }
}
