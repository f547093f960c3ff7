//! Inertial samples.

use crate::{Stamp, Vector3};

/// One reading of an inertial measurement unit, in the IMU's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuSample {
    /// When it was measured.
    pub stamp: Stamp,
    /// Angular velocity, rad/s.
    pub angular_velocity: Vector3,
    /// Specific force, m/s²: at rest it points up with 9.81.
    pub specific_force: Vector3,
}
