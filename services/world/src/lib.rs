//! The simulated world: the sensors' own bytes from a robot that walks through a building or a
//! campus, and the exact truth beside them.
//!
//! In: a seed and a [`Preset`], or a scene and a patrol put together with [`SceneBuilder`] and
//! [`TrajectoryBuilder`]. Out: UDP payloads as a VLP-16 or an RS-Helios-16P sends them, inertial
//! samples, leg odometry, and for each moment and each return what is true. The same
//! configuration gives the same bytes, for any number of threads.
//!
//! | module | holds |
//! |---|---|
//! | [`material`], [`scene`], [`scene_builder`], [`floor`] | what stands where and how it answers a laser |
//! | [`optics`], [`returns`] | a pulse's echoes; what is reported of them, and the truth |
//! | [`motion`], [`trajectory`] | where the robot is at any time |
//! | [`sensor`] | which sensors there are, and when their lasers fire |
//! | [`simulation`], [`lidar`] | packet after packet; as a [`hachi_hal::PacketSource`] |
//! | [`camera`], [`person`] | depth and colour pictures; the people in them |
//! | [`scenes`] | ten scripted scenes with people |
//! | [`imu`], [`odometry`] | the other sensors |
//! | [`legs`] | joints, feet and body of a quadruped that walks the path |
//! | [`commanded`], [`live`] | a quadruped that goes where it is told; the sensor on it |
//! | [`loops`] | when the robot truly comes back to where it has been |
//! | [`preset`] | ready-made buildings and campuses |
//! | [`capture`] | pcap and TUM files |
//!
//! ```
//! use hachi_world::{Preset, Simulation, SimulationConfig};
//!
//! let mut simulation = Simulation::new(SimulationConfig::preset(Preset::Corridor, 1, 0.01));
//! while let Some(packet) = simulation.next_packet() {
//!     assert!(packet.bytes.len() == 1206 || packet.bytes.len() == 512);
//! }
//! ```
#![forbid(unsafe_code)]

mod actor;
mod aim;
mod building;
mod calendar;
pub mod camera;
mod campus;
pub mod capture;
mod cast;
pub mod commanded;
mod fan;
pub mod floor;
mod ground;
mod helios;
pub mod imu;
pub mod legs;
pub mod lidar;
pub mod live;
pub mod loops;
pub mod material;
mod moment;
pub mod motion;
mod noise;
pub mod odometry;
pub mod optics;
mod path;
pub mod person;
pub mod preset;
pub mod returns;
pub mod scene;
pub mod scene_builder;
pub mod scenes;
pub mod sensor;
pub mod simulation;
mod smooth;
pub mod trajectory;
mod vlp16;

pub use camera::{CameraConfig, CameraFrame, Light, PersonTruth, PixelBox, SimulatedCamera};
pub use capture::{CaptureError, CaptureWriter, write_pcap, write_tum};
pub use commanded::CommandedBody;
pub use floor::{Floor, RaisedFloor, Terrain, Wave};
pub use imu::{GRAVITY, ImuConfig, SimulatedImu};
pub use legs::{LegDimensions, LegTick, LegsConfig, WalkingLegs};
pub use lidar::{SimulatedLidar, SimulatedLidarError};
pub use live::LiveLidar;
pub use loops::{Direction, LoopPass, LoopSearch, Revisit, TrueLoops};
pub use material::{Finish, Material};
pub use motion::{Axis, BodyMotion, Harmonic};
pub use odometry::{OdometryConfig, SimulatedOdometry};
pub use optics::ReturnLabel;
pub use person::{Outfit, Person, Visit};
pub use preset::{Preset, World};
pub use returns::ReturnTruth;
pub use scene::{ObjectId, Role, Scene};
pub use scene_builder::SceneBuilder;
pub use sensor::SensorKind;
pub use simulation::{NoiseConfig, SimulatedPacket, Simulation, SimulationConfig};
pub use trajectory::{Gait, Trajectory, TrajectoryBuilder, TrajectoryError, Twist};
