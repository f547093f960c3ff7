//! The Unitree Go1 in numbers.
//!
//! Dimensions and mechanical limits are those of the maker's robot description (`go1_description`),
//! command limits and the library's joint limits those of the SDK's headers (3.8.6), addresses
//! those of its examples. Where a LiDAR and a camera sit differs from robot to robot: mounts are in
//! `config/go1.toml`. Sensors it carries: an RS-Helios-16P (`hachi-robosense`) and a RealSense D455.
#![no_std]
#![forbid(unsafe_code)]

use hachi_hal::Vector3;
use hachi_unitree::command::{CommandLimits, VelocityLimits};
use hachi_unitree::contact::ContactConfig;
use hachi_unitree::frame::Layout;
use hachi_unitree::{Endpoints, JointLimits, LegGeometry, Quadruped, Span};

/// The robot.
pub const GO1: Quadruped = Quadruped {
    layout: Layout::GO1,
    geometry: LegGeometry {
        hip_forward: 0.1881,
        hip_sideways: 0.04675,
        abduction: 0.08,
        thigh: 0.213,
        calf: 0.213,
        foot_radius: 0.02,
    },
    joints: JointLimits {
        mechanical: [
            Span::about_zero(0.863),
            Span::new(-0.686, 4.501),
            Span::new(-2.818, -0.888),
        ],
        library: [
            Span::about_zero(1.047),
            Span::new(-0.663, 2.966),
            Span::new(-2.721, -0.837),
        ],
        torque: [23.7, 23.7, 35.55],
        speed: [30.1, 30.1, 20.06],
    },
    limits: CommandLimits {
        trot: VelocityLimits {
            forward: Span::new(-1.1, 1.5),
            left: Span::about_zero(1.0),
            yaw_rate: Span::about_zero(4.0),
        },
        run: Some(VelocityLimits {
            forward: Span::new(-2.5, 3.5),
            left: Span::about_zero(1.0),
            yaw_rate: Span::about_zero(4.0),
        }),
        stairs: Some(VelocityLimits {
            forward: Span::new(-0.2, 0.25),
            left: Span::about_zero(0.15),
            yaw_rate: Span::about_zero(0.7),
        }),
        roll: Span::about_zero(0.75),
        pitch: Span::about_zero(0.75),
        yaw: Span::about_zero(0.6),
        body_height: Span::new(-0.13, 0.03),
        foot_raise_height: Span::new(-0.06, 0.03),
    },
    contact: ContactConfig {
        // Public projects see a foot stand above 40 (legged_control) to 80 counts (A1-QP-MPC) over
        // its zero, which is about half a share.
        counts_per_share: Some(100.0),
        load: ContactConfig::LOAD,
    },
    endpoints: Endpoints {
        high: ([192, 168, 123, 161], 8082),
        low: ([192, 168, 123, 10], 8007),
        local_port: 8090,
    },
    // MuJoCo Menagerie's sum, which was identified on a robot; the description's is 13.10.
    mass_kg: 12.74,
    imu_in_base: [-0.01592, -0.06659, -0.00617],
    high_state_hz: 500.0,
    refresh_hz: 50.0,
};

/// The high-level service over the robot's own access point.
pub const HIGH_OVER_WIFI: ([u8; 4], u16) = ([192, 168, 12, 1], 8082);

/// Joint angles of a standing leg, rad: the home pose of MuJoCo Menagerie.
pub fn home() -> Vector3 {
    Vector3::new(0.0, 0.9, -1.8)
}

/// Half the extents of the trunk, metres.
pub const HALF_TRUNK: [f64; 3] = [0.1881, 0.046_75, 0.057];

/// Height of the base over the ground when it stands as it usually does, metres, as its state
/// reports it.
pub const STANDING_HEIGHT: f64 = 0.28;
