//! Why the robot stands still, or is slower than was wished.

use std::fmt;

/// A reason to stand. `docs/safety.md` has a row for each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Cause {
    /// Somebody pressed the emergency stop.
    EmergencyStop,
    /// The emergency stop, or its link, is silent: taken for pressed.
    EmergencyStopSilent,
    /// The robot sends nothing new.
    RobotSilent,
    /// A task broke a promise.
    TaskOverrun,
    /// A number of the wish is not finite.
    NotFinite,
    /// The wish is stamped by a clock that is ahead.
    FromTheFuture,
    /// Nobody wishes anything, or what was wished has died of age.
    NoWish,
    /// Nobody has said for too long where the robot is.
    LocalisationStale,
    /// Where the robot is, is unknown.
    LocalisationLost,
    /// The LiDAR has not shown for too long what is around.
    LidarStale,
    /// The camera is needed and shows nothing new.
    CameraStale,
    /// The event loop hangs.
    EventLoopStale,
    /// Something stands in the way.
    Obstacle,
    /// The person that is followed is inside the safety circle.
    PersonNear,
}

impl Cause {
    /// All causes, the gravest first.
    pub const ALL: [Self; 14] = [
        Self::EmergencyStop,
        Self::EmergencyStopSilent,
        Self::RobotSilent,
        Self::TaskOverrun,
        Self::NotFinite,
        Self::FromTheFuture,
        Self::NoWish,
        Self::LocalisationStale,
        Self::LocalisationLost,
        Self::LidarStale,
        Self::CameraStale,
        Self::EventLoopStale,
        Self::Obstacle,
        Self::PersonNear,
    ];

    /// The line in the log.
    pub const fn line(self) -> &'static str {
        match self {
            Self::EmergencyStop => "standing: the emergency stop is pressed",
            Self::EmergencyStopSilent => "standing: the emergency stop is silent",
            Self::RobotSilent => "standing: the robot sends nothing new",
            Self::TaskOverrun => "standing: a task that must keep its budget did not",
            Self::NotFinite => "standing: a number of the command is not finite",
            Self::FromTheFuture => "standing: the command is stamped in the future",
            Self::NoWish => "standing: no living command",
            Self::LocalisationStale => "standing: nobody says where the robot is",
            Self::LocalisationLost => "standing: the robot does not know where it is",
            Self::LidarStale => "standing: the lidar shows nothing new",
            Self::CameraStale => "standing: the camera shows nothing new",
            Self::EventLoopStale => "standing: the event loop hangs",
            Self::Obstacle => "slower or standing: something is in the way",
            Self::PersonNear => "standing: the person is inside the safety circle",
        }
    }

    /// Whether the velocity is zero at once, and not by braking: what follows can't be relied on.
    pub const fn is_immediate(self) -> bool {
        matches!(
            self,
            Self::EmergencyStop
                | Self::EmergencyStopSilent
                | Self::RobotSilent
                | Self::TaskOverrun
                | Self::NotFinite
                | Self::FromTheFuture
        )
    }

    const fn bit(self) -> u32 {
        1 << self as u8
    }
}

/// A set of causes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Causes(u32);

impl Causes {
    /// Adds one if it is true.
    pub fn add_if(&mut self, cause: Cause, is_true: bool) {
        if is_true {
            self.0 |= cause.bit();
        }
    }

    /// Whether it is among them.
    pub fn has(self, cause: Cause) -> bool {
        self.0 & cause.bit() != 0
    }

    /// Whether there are none.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether one of them wants zero velocity at once.
    pub fn is_immediate(self) -> bool {
        self.iter().any(Cause::is_immediate)
    }

    /// The gravest first.
    pub fn iter(self) -> impl Iterator<Item = Cause> {
        Cause::ALL.into_iter().filter(move |c| self.has(*c))
    }

    /// Those that are here and not there.
    #[must_use]
    pub fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// The set as bits, to be handed on as a number.
    pub fn bits(self) -> u32 {
        self.0
    }

    /// A set from its bits; those of no cause are left out.
    pub fn from_bits(bits: u32) -> Self {
        let known = Cause::ALL.iter().fold(0, |all, cause| all | cause.bit());
        Self(bits & known)
    }
}

impl fmt::Display for Causes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut first = true;
        for cause in self.iter() {
            if !first {
                f.write_str("; ")?;
            }
            first = false;
            f.write_str(cause.line())?;
        }
        Ok(())
    }
}
