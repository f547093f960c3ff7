//! The Robotnik RB-Kairos+: a base on four mecanum wheels.
//!
//! | module | in | out |
//! |---|---|---|
//! | [`mecanum`] | a velocity, or the speeds of the wheels | the other |
//! | [`drive`] | [`hachi_hal::BaseCommand`]s | the velocity in force, through any [`TwistSink`] |
//! | [`odometry`] | speeds of the wheels | pose and velocity with their covariance |
//!
//! Dimensions are those of the maker's robot description (`rbkairos_common`, the *plus*); the
//! launch files differ from it by 2 mm in the wheels' radius and by more in the track: measure
//! yours. The robot takes velocities as ROS twists, which the bridge carries. Sensors it carries: a
//! LiDAR on a mast and a RealSense D415 or D455; where they sit is in `config/kairos.toml`.
#![no_std]
#![forbid(unsafe_code)]

pub mod drive;
pub mod mecanum;
pub mod odometry;

use hachi_hal::Pose;

pub use drive::{SimulatedBase, TwistDrive, TwistSink};
pub use mecanum::{Mecanum, WheelLimits};
pub use odometry::{WheelEstimate, WheelOdometry, WheelOdometryConfig};

/// Its wheels.
pub const WHEELS: Mecanum = Mecanum {
    radius_m: 0.127,
    half_wheelbase_m: 0.215_28,
    half_track_m: 0.269,
};

/// What may be asked of it.
pub const LIMITS: WheelLimits = WheelLimits {
    // As remembered from the brochure.
    speed: 1.5,
    // No figure is published: half of what wheels at that speed would give.
    yaw_rate: 1.5,
    rim_speed: 1.5,
};

/// Half the extents of base and deck, metres; the arm is not in it.
pub const HALF_ENVELOPE: [f64; 3] = [0.489, 0.388, 0.345];

/// Where the base frame is over the footprint: at the wheels' axles, on a floor that is level with
/// them. A wheeled robot's footprint does not move.
pub fn footprint_from_base() -> Pose {
    Pose::translation(0.0, 0.0, WHEELS.radius_m)
}

/// The transform of the filters: takes points of the LiDAR to the footprint.
pub fn footprint_from_lidar(base_from_lidar: &Pose) -> Pose {
    footprint_from_base() * base_from_lidar
}
