//! Odometry that comes from elsewhere: legs, wheels, another estimator.

use crate::{Pose, Stamp};

/// A pose in a smooth, drifting frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OdometrySample {
    /// When it was true.
    pub stamp: Stamp,
    /// Takes points in `base` to `odom`.
    pub odom_from_base: Pose,
}
