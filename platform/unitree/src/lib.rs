//! What Unitree's quadrupeds share: the bytes on the wire, the legs, the ground under them and the
//! motion that follows from them.
//!
//! | module | in | out |
//! |---|---|---|
//! | [`frame`] | UDP payloads | HighCmd, HighState, LowCmd, LowState, both ways |
//! | [`fresh`] | ticks, or bytes | new, repeated, late; silent and frozen links |
//! | [`reading`] | a state's body | hal's samples, ill values named |
//! | [`command`] | [`hachi_hal::BaseCommand`]s | the HighCmd in force |
//! | [`kinematics`] | joint angles | feet, Jacobians, and back |
//! | [`tracker`] | joints, inertial reading, attitude | contacts, footprint, odometry |
//! | [`contact`], [`footprint`], [`odometry`], [`vote`] | | its stages |
//! | [`robot`] | | what one robot is in numbers |
//! | `device` (feature `std`) | a socket | the robot as hal's devices; a simulated robot's side |
//!
//! Without the feature `std` nothing here allocates and everything builds for bare metal. The
//! numbers of a robot are in its own crate (`hachi-go1`, `hachi-b1`).
//!
//! Layouts, offsets and check values were measured on the maker's SDK (see [`frame`]); dimensions
//! and limits are those of the maker's robot descriptions and headers.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "std")]
extern crate std;

pub mod command;
pub mod contact;
#[cfg(feature = "std")]
pub mod device;
pub mod footprint;
pub mod frame;
pub mod fresh;
mod inertial;
pub mod kinematics;
pub mod odometry;
pub mod reading;
pub mod robot;
pub mod tracker;
pub mod vote;

pub use kinematics::LegGeometry;
pub use robot::{Endpoints, JointLimits, Quadruped, Span};
pub use tracker::{BodySample, LegEstimate, LegTracker};
