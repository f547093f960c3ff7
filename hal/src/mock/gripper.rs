//! A gripper without fingers.

use core::fmt;

use crate::{DeviceError, FaultKind, Grip, Gripper, GripperCommand, GripperSample, Stamp};

/// A gripper with a stroke of 85 mm that is where it was sent at the next report, unless something
/// as wide as `object_m` is in its way. Each report is a millisecond after the one before.
#[derive(Debug, Clone, PartialEq)]
pub struct MockGripper {
    /// How wide what lies between the fingers is, metres; 0 is nothing. A test may take it away.
    pub object_m: f64,
    ready: bool,
    opening_m: f64,
    wanted_m: f64,
    now: Stamp,
}

/// Why a [`MockGripper`] refuses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MockGripperError {
    /// It was not activated.
    NotReady,
    /// A number is not finite.
    NotFinite,
}

impl fmt::Display for MockGripperError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotReady => "the gripper is not ready: activate it",
            Self::NotFinite => "a number of the command is not finite",
        })
    }
}

impl core::error::Error for MockGripperError {}

impl DeviceError for MockGripperError {
    fn kind(&self) -> FaultKind {
        FaultKind::ReadAgain
    }
}

impl MockGripper {
    const STROKE_M: f64 = 0.085;

    /// Open, not ready, with something of this width between the fingers.
    pub fn around(object_m: f64) -> Self {
        Self {
            object_m,
            ready: false,
            opening_m: Self::STROKE_M,
            wanted_m: Self::STROKE_M,
            now: Stamp::from_nanos(0),
        }
    }
}

impl Gripper for MockGripper {
    type Error = MockGripperError;

    fn stroke_m(&self) -> f64 {
        Self::STROKE_M
    }

    fn activate(&mut self) -> Result<(), MockGripperError> {
        self.ready = true;
        Ok(())
    }

    fn command(&mut self, command: &GripperCommand) -> Result<(), MockGripperError> {
        if !command.is_finite() {
            return Err(MockGripperError::NotFinite);
        }
        if !self.ready {
            return Err(MockGripperError::NotReady);
        }
        self.wanted_m = command.opening_m.clamp(0.0, Self::STROKE_M);
        Ok(())
    }

    fn stop(&mut self) -> Result<(), MockGripperError> {
        self.wanted_m = self.opening_m;
        Ok(())
    }

    fn read_gripper(&mut self, _: Stamp) -> Result<Option<GripperSample>, MockGripperError> {
        self.now = self.now + 1_000_000;
        self.opening_m = self.wanted_m.max(self.object_m.min(Self::STROKE_M));
        let grip = if !self.ready {
            Grip::NotReady
        } else if self.opening_m > self.wanted_m {
            Grip::Holding
        } else {
            Grip::Free
        };
        Ok(Some(GripperSample {
            stamp: self.now,
            opening_m: self.opening_m,
            grip,
        }))
    }
}
