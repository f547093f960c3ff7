//! Grippers with two fingers: what may be asked of them, and what they feel.

use crate::{DeviceError, Stamp};

/// How the fingers are to move.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GripperCommand {
    /// Distance between the fingers, metres; 0 is closed.
    pub opening_m: f64,
    /// How fast they move, m/s.
    pub speed_m_s: f64,
    /// How hard they press, N.
    pub force_n: f64,
}

impl GripperCommand {
    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        [self.opening_m, self.speed_m_s, self.force_n]
            .iter()
            .all(|v| v.is_finite())
    }
}

/// What the fingers do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Grip {
    /// It is not ready: [`Gripper::activate`] makes it so.
    NotReady,
    /// They move.
    Moving,
    /// Something between them stopped them: it is held.
    Holding,
    /// They are where they were sent, with nothing felt. After a grasp that means it is lost.
    Free,
}

/// A gripper at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GripperSample {
    /// When it was asked.
    pub stamp: Stamp,
    /// Distance between the fingers, metres.
    pub opening_m: f64,
    /// What they do.
    pub grip: Grip,
}

/// A gripper.
///
/// - `activate` makes it ready, which takes a second or two and may open and close the fingers:
///   nobody's hand and no object may be between them. `read_gripper` says when it is done;
/// - `command` replaces what was asked before; a number that is not finite is refused and changes
///   nothing, one beyond the limits is cut to them; while it is not ready it is an error;
/// - `stop` holds the fingers where they are;
/// - `read_gripper` is back by `deadline`; nothing new is `Ok(None)`; stamps strictly increase and
///   the opening lies within 0 and `stroke_m`;
/// - an error leaves the device usable, and what was asked before in force.
pub trait Gripper {
    /// What can go wrong.
    type Error: DeviceError;
    /// The widest opening, metres.
    fn stroke_m(&self) -> f64;
    /// Begins to make it ready.
    fn activate(&mut self) -> Result<(), Self::Error>;
    /// Moves the fingers.
    fn command(&mut self, command: &GripperCommand) -> Result<(), Self::Error>;
    /// Holds the fingers where they are.
    fn stop(&mut self) -> Result<(), Self::Error>;
    /// The next report.
    fn read_gripper(&mut self, deadline: Stamp) -> Result<Option<GripperSample>, Self::Error>;
}
