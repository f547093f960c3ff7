//! The Unitree B1 in numbers.
//!
//! Dimensions and mechanical limits are those of the maker's robot description (`b1_description`),
//! command limits and the library's joint limits those of the SDK's headers (3.8.3), addresses
//! those of its examples. Where a LiDAR and a camera sit differs from robot to robot: mounts are in
//! `config/b1.toml`. Sensor it carries: a VLP-16 (`hachi-velodyne`).
#![no_std]
#![forbid(unsafe_code)]

use hachi_hal::Vector3;
use hachi_unitree::command::{CommandLimits, VelocityLimits};
use hachi_unitree::contact::ContactConfig;
use hachi_unitree::frame::Layout;
use hachi_unitree::{Endpoints, JointLimits, LegGeometry, Quadruped, Span};

/// The robot.
pub const B1: Quadruped = Quadruped {
    layout: Layout::B1,
    geometry: LegGeometry {
        hip_forward: 0.3455,
        hip_sideways: 0.072,
        abduction: 0.12675,
        thigh: 0.35,
        calf: 0.35,
        foot_radius: 0.04,
    },
    joints: JointLimits {
        mechanical: [
            Span::about_zero(0.75),
            Span::new(-1.0, 3.5),
            Span::new(-2.6, -0.6),
        ],
        library: [
            Span::about_zero(0.75),
            Span::new(-1.0, 3.5),
            Span::new(-2.6, -0.6),
        ],
        torque: [91.0035, 93.33, 140.0],
        speed: [19.69, 23.32, 15.55],
    },
    limits: CommandLimits {
        trot: VelocityLimits {
            forward: Span::new(-0.8, 1.2),
            left: Span::about_zero(0.25),
            yaw_rate: Span::about_zero(0.75),
        },
        run: None,
        stairs: None,
        roll: Span::about_zero(0.3),
        pitch: Span::about_zero(0.3),
        yaw: Span::about_zero(0.6),
        body_height: Span::about_zero(0.16),
        foot_raise_height: Span::new(-0.10, 0.15),
    },
    contact: ContactConfig {
        // Users report constant 20 to 28 whatever the load: not used.
        counts_per_share: None,
        load: ContactConfig::LOAD,
    },
    endpoints: Endpoints {
        high: ([192, 168, 123, 220], 8082),
        low: ([192, 168, 123, 10], 8007),
        local_port: 8090,
    },
    mass_kg: 62.6,
    imu_in_base: [0.0; 3],
    high_state_hz: 400.0,
    refresh_hz: 400.0,
};

/// Joint angles of a standing leg, rad: the base is 0.58 m over the ground, the height that the
/// maker gives.
pub fn home() -> Vector3 {
    // Thigh and calf are equally long: cos(0.68971) = (0.58 - 0.04) / (2 x 0.35).
    Vector3::new(0.0, 0.689_71, -1.379_42)
}

/// Half the extents of the trunk, metres.
pub const HALF_TRUNK: [f64; 3] = [0.3235, 0.15, 0.075];

/// Height of the base over the ground when it stands as it usually does, metres.
pub const STANDING_HEIGHT: f64 = 0.58;
