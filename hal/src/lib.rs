//! What a robot is, with no robot named: the plain data that sensors produce and the traits that
//! devices implement.
//!
//! `no_std`, no allocation in the default features. Everything else in Hachi depends on this crate
//! and this crate depends on nothing of Hachi's. Frames follow REP-103 and REP-105 (x forward,
//! y left, z up; `map -> odom -> base -> {lidar, imu, footprint}`); a transform `map_from_base`
//! takes points in `base` to `map`.
//!
//! | module | holds |
//! |---|---|
//! | [`time`] | [`Stamp`]: integer nanoseconds on the robot's clock |
//! | [`point`] | [`Point`]: one LiDAR return; [`PointSink`]: where decoders put them |
//! | [`scan`] | [`ScanHeader`]: one turn of a LiDAR |
//! | [`geometry`] | [`Pose`] and friends |
//! | [`camera`] | colour and depth images; [`RgbdCamera`] |
//! | [`imu`], [`motion`] | inertial samples, external odometry |
//! | [`legs`] | joints and feet of a quadruped; [`LegKinematics`] |
//! | [`base`] | commands to a base, which die of age; [`BaseDrive`] |
//! | [`gripper`] | two fingers: [`Gripper`] |
//! | [`power`], [`safety`] | battery, emergency stop, watchdog |
//! | [`device`] | the device traits and [`FaultKind`] |
//! | `mock`, `conformance` | scripted devices; each trait's promise as a check (features) |
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "alloc")]
extern crate alloc;

pub mod base;
pub mod camera;
pub mod device;
pub mod geometry;
pub mod gripper;
pub mod imu;
pub mod legs;
pub mod motion;
pub mod point;
pub mod power;
pub mod safety;
pub mod scan;
pub mod time;

#[cfg(feature = "conformance")]
pub mod conformance;
#[cfg(feature = "mock")]
pub mod mock;

pub use base::{
    BaseAction, BaseCommand, BaseDrive, BaseStatus, BodyPosture, BodyVelocity, CommandFault,
};
pub use camera::{Distortion, Intrinsics, RgbdCamera, RgbdGeometry, RgbdHeader, RgbdImages};
pub use device::{Clock, DeviceError, FaultKind, Imu, LidarScans, PacketSource, Received};
pub use geometry::{Pose, Rotation, Vector3};
pub use gripper::{Grip, Gripper, GripperCommand, GripperSample};
pub use imu::ImuSample;
pub use legs::{AttitudeSample, Leg, LegKinematics, LegPosture, LegState, LegStates, Matrix3};
pub use motion::OdometrySample;
pub use point::{Point, PointSink, ReturnKind, SinkFull};
pub use power::{Battery, BatterySample};
pub use safety::{EmergencyStop, StopSample, Watchdog};
pub use scan::{Completeness, ScanHeader};
pub use time::Stamp;
