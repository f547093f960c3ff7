//! What may be asked of a robot, by gait. The maker's header comments are the source.

use hachi_hal::{BodyPosture, BodyVelocity};

use crate::robot::Span;

/// How it walks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[repr(u8)]
pub enum GaitKind {
    /// Stands.
    Idle = 0,
    /// Trots: the usual one.
    #[default]
    Trot = 1,
    /// Runs. A Go1 alone.
    Run = 2,
    /// Climbs stairs. A Go1 alone.
    Stairs = 3,
    /// Trots over obstacles.
    Obstacles = 4,
}

/// Speeds of one gait.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VelocityLimits {
    /// Forward, m/s.
    pub forward: Span,
    /// To the left, m/s.
    pub left: Span,
    /// Turning left, rad/s.
    pub yaw_rate: Span,
}

/// What may be asked of one robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandLimits {
    /// Trotting.
    pub trot: VelocityLimits,
    /// Running, where it can.
    pub run: Option<VelocityLimits>,
    /// Climbing stairs, where it can.
    pub stairs: Option<VelocityLimits>,
    /// Roll of a standing body, rad.
    pub roll: Span,
    /// Its pitch, rad.
    pub pitch: Span,
    /// Its yaw, rad.
    pub yaw: Span,
    /// Height of the body against the usual one, m.
    pub body_height: Span,
    /// Height of the lifted feet against the usual one, m.
    pub foot_raise_height: Span,
}

impl CommandLimits {
    /// Speeds of a gait; `None` where the robot is not known to have it. Obstacles are trotted
    /// over: no speeds of their own are documented.
    pub const fn of_gait(&self, gait: GaitKind) -> Option<VelocityLimits> {
        const STILL: Span = Span::new(0.0, 0.0);
        match gait {
            GaitKind::Idle => Some(VelocityLimits {
                forward: STILL,
                left: STILL,
                yaw_rate: STILL,
            }),
            GaitKind::Trot | GaitKind::Obstacles => Some(self.trot),
            GaitKind::Run => self.run,
            GaitKind::Stairs => self.stairs,
        }
    }

    /// The nearest posture that may be asked, and whether it is another than `asked`.
    pub fn posture(&self, asked: &BodyPosture) -> (BodyPosture, bool) {
        let granted = BodyPosture {
            roll: self.roll.clamp(asked.roll),
            pitch: self.pitch.clamp(asked.pitch),
            yaw: self.yaw.clamp(asked.yaw),
            height_change_m: self.body_height.clamp(asked.height_change_m),
        };
        (granted, granted != *asked)
    }
}

impl VelocityLimits {
    /// The nearest velocity within, each component for itself, and whether it is another than
    /// `asked`.
    pub fn velocity(&self, asked: &BodyVelocity) -> (BodyVelocity, bool) {
        let granted = BodyVelocity {
            forward: self.forward.clamp(asked.forward),
            left: self.left.clamp(asked.left),
            yaw_rate: self.yaw_rate.clamp(asked.yaw_rate),
        };
        (granted, granted != *asked)
    }
}
