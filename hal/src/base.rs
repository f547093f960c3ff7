//! Moving a base: what may be asked of it, and the promise that every request dies of age.
//!
//! In: nothing; plain data and the trait that bases implement. Elsewhere: who may ask (the safety
//! gate), and what a particular robot makes of it (the platform crates).

use core::fmt;

use crate::{DeviceError, FaultKind, Stamp};

/// A velocity of the base in its own frame: x forward, y left, turning left is positive.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BodyVelocity {
    /// Forward, m/s.
    pub forward: f64,
    /// To the left, m/s.
    pub left: f64,
    /// Turning left, rad/s.
    pub yaw_rate: f64,
}

impl BodyVelocity {
    /// Standing still.
    pub const ZERO: Self = Self {
        forward: 0.0,
        left: 0.0,
        yaw_rate: 0.0,
    };

    /// Whether every component is finite.
    pub fn is_finite(&self) -> bool {
        self.forward.is_finite() && self.left.is_finite() && self.yaw_rate.is_finite()
    }

    /// Whether it is standing still.
    pub fn is_zero(&self) -> bool {
        *self == Self::ZERO
    }
}

/// How a standing body holds itself, against its usual stance.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BodyPosture {
    /// Roll, rad.
    pub roll: f64,
    /// Pitch, rad; nose down is positive.
    pub pitch: f64,
    /// Yaw against the feet, rad.
    pub yaw: f64,
    /// Height above the usual one, metres.
    pub height_change_m: f64,
}

impl BodyPosture {
    /// Whether every component is finite.
    pub fn is_finite(&self) -> bool {
        [self.roll, self.pitch, self.yaw, self.height_change_m]
            .iter()
            .all(|v| v.is_finite())
    }
}

/// What a base is asked to do.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum BaseAction {
    /// Stand still, at once.
    Stop,
    /// Move.
    Move(BodyVelocity),
    /// Stand and hold a posture.
    Pose(BodyPosture),
    /// Get up, from lying to standing. A wheeled base has nothing to do.
    StandUp,
    /// Lie down. A wheeled base has nothing to do.
    LieDown,
}

/// A request with its age limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BaseCommand {
    /// When it was decided.
    pub stamp: Stamp,
    /// How long after `stamp` it may move the robot, ns.
    pub time_to_live_ns: i64,
    /// What is asked.
    pub action: BaseAction,
}

impl BaseCommand {
    /// No command moves a robot for longer than this, whatever it says: half a second. A robot at
    /// 1 m/s has gone half a metre by then.
    pub const LONGEST_TIME_TO_LIVE_NS: i64 = 500_000_000;

    /// A command may be stamped this much later than the base's clock, ns: two readings of one
    /// clock by two threads. More is another clock, or one that jumped.
    pub const FUTURE_SLACK_NS: i64 = 20_000_000;

    /// When it dies: its own limit, or the longest one.
    pub fn dies_at(&self) -> Stamp {
        self.stamp + self.time_to_live_ns.clamp(0, Self::LONGEST_TIME_TO_LIVE_NS)
    }

    /// Whether it may still move the robot. The moment of death is dead.
    pub fn is_alive(&self, now: Stamp) -> bool {
        now < self.dies_at()
    }

    /// Refuses what no base may take at `now`.
    ///
    /// # Errors
    /// A number in it is not finite, its clock is ahead, or it is dead.
    pub fn check(&self, now: Stamp) -> Result<(), CommandFault> {
        if !self.is_finite() {
            Err(CommandFault::NotFinite)
        } else if self.stamp > now + Self::FUTURE_SLACK_NS {
            let ahead_ns = self.stamp.nanos_since(now);
            Err(CommandFault::FromTheFuture { ahead_ns })
        } else if !self.is_alive(now) {
            let late_ns = now.nanos_since(self.dies_at());
            Err(CommandFault::Dead { late_ns })
        } else {
            Ok(())
        }
    }

    /// Whether it makes the base move in any way, rather than stand still.
    pub fn moves(&self) -> bool {
        match &self.action {
            BaseAction::Stop => false,
            BaseAction::Move(velocity) => !velocity.is_zero(),
            BaseAction::Pose(_) | BaseAction::StandUp | BaseAction::LieDown => true,
        }
    }

    /// Whether every number in it is finite.
    pub fn is_finite(&self) -> bool {
        match &self.action {
            BaseAction::Move(velocity) => velocity.is_finite(),
            BaseAction::Pose(posture) => posture.is_finite(),
            BaseAction::Stop | BaseAction::StandUp | BaseAction::LieDown => true,
        }
    }
}

/// Why no base may take a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum CommandFault {
    /// A number in it is not finite.
    NotFinite,
    /// It was dead on arrival.
    Dead {
        /// How long before it died.
        late_ns: i64,
    },
    /// It is stamped by a clock that is ahead, or jumped.
    FromTheFuture {
        /// By how much.
        ahead_ns: i64,
    },
}

impl fmt::Display for CommandFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite => f.write_str("a number of the command is not finite"),
            Self::Dead { late_ns } => write!(f, "the command died {late_ns} ns before it came"),
            Self::FromTheFuture { ahead_ns } => {
                write!(f, "the command is stamped {ahead_ns} ns in the future")
            }
        }
    }
}

impl core::error::Error for CommandFault {}

impl DeviceError for CommandFault {
    fn kind(&self) -> FaultKind {
        FaultKind::ReadAgain
    }
}

/// What the base does at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BaseStatus {
    /// The moment.
    pub stamp: Stamp,
    /// The velocity that is asked of the motors now, after limits.
    pub velocity: BodyVelocity,
    /// Whether the last command has died of age and zero velocity stands in for it.
    pub expired: bool,
    /// Whether the velocity asked for was beyond the base's limits and was cut to them.
    pub saturated: bool,
}

/// A base that moves on command.
///
/// - `command` replaces whatever was asked before, and is back at once;
/// - a command with a number that is not finite, from the future or already dead is refused with
///   an error and changes nothing: what was asked before goes on dying at its own time;
/// - velocities beyond the limits are cut to them, and the status says so;
/// - from [`BaseCommand::dies_at`] on, `service` gives the motors zero velocity, until the next
///   command;
/// - an error leaves the device usable.
///
/// `service` sends what is in force and must be called at the base's command rate; it never gives
/// the motors a command that is dead at `now`.
pub trait BaseDrive {
    /// What can go wrong.
    type Error: DeviceError;
    /// Takes a command at `now`.
    fn command(&mut self, command: &BaseCommand, now: Stamp) -> Result<(), Self::Error>;
    /// Sends what is in force at `now`.
    fn service(&mut self, now: Stamp) -> Result<BaseStatus, Self::Error>;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn command(time_to_live_ns: i64) -> BaseCommand {
        BaseCommand {
            stamp: Stamp::from_nanos(1_000_000_000),
            time_to_live_ns,
            action: BaseAction::Stop,
        }
    }

    #[test]
    fn a_command_dies_at_its_limit_and_never_later_than_the_longest() {
        let at = |nanos| Stamp::from_nanos(1_000_000_000 + nanos);
        assert!(command(100).is_alive(at(99)));
        assert!(!command(100).is_alive(at(100)));
        assert!(!command(i64::MAX).is_alive(at(BaseCommand::LONGEST_TIME_TO_LIVE_NS)));
        assert!(!command(-5).is_alive(at(0)));
    }

    #[test]
    fn a_clock_that_is_ahead_is_noticed() {
        let now = Stamp::from_nanos(1_000_000_000 - BaseCommand::FUTURE_SLACK_NS);
        assert_eq!(command(1).check(now), Ok(()));
        let ahead_ns = BaseCommand::FUTURE_SLACK_NS + 1;
        let fault = CommandFault::FromTheFuture { ahead_ns };
        assert_eq!(command(1).check(now + -1), Err(fault));
    }
}
