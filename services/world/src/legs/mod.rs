//! A quadruped's legs that walk a body along any path: what joints, feet and inertial sensor
//! report, and the truth beside it.
//!
//! In: the dimensions of a robot as plain numbers, a gait, the floor, and at each moment where the
//! body is and how it moves (a [`crate::Trajectory`], or a body that follows commands). Out:
//! [`LegTick`]: joint angles, speeds and torques, foot sensors, inertial reading and attitude that
//! all fit one motion, with the noise of real sensors; which feet stand, carry and slip in truth.
//! Elsewhere: the bytes of a particular robot, and its kinematics in closed form: this module goes
//! through the chain of joints link by link, and shares nothing with the code it is there to test.
//!
//! A foot is a sphere of rubber. In stance it rolls over the ground without sliding, unless it is
//! made to slip; in swing it goes from where it lifted to where the hip will be half a step before
//! it passes. Torques balance the ground's push, the links' weight and their inertia.

mod chain;
mod gait;
mod sensors;
mod walker;

pub use chain::LegDimensions;
pub use gait::{Footfall, SlipConfig};
pub use sensors::{ForceSensors, LegSensorConfig};
pub use walker::{LegTick, LegTruth, LegsConfig, WalkingLegs};
