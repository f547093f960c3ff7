//! Legs: what a quadruped's joints and feet report, and the geometry that turns it into places.
//!
//! In: nothing; plain data and the traits of their sources. Who reads joints, and which geometry a
//! robot has, is for the platform crates; contact, footprint and odometry are computed there too.

use crate::{DeviceError, Rotation, Stamp, Vector3};

/// A matrix of three by three, double precision.
pub type Matrix3 = nalgebra::Matrix3<f64>;

/// A leg of a quadruped. The discriminant is its index in every array of four.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(u8)]
pub enum Leg {
    /// Front right.
    FrontRight = 0,
    /// Front left.
    FrontLeft = 1,
    /// Rear right.
    RearRight = 2,
    /// Rear left.
    RearLeft = 3,
}

impl Leg {
    /// All four, in the order of every array of four.
    pub const ALL: [Self; 4] = [
        Self::FrontRight,
        Self::FrontLeft,
        Self::RearRight,
        Self::RearLeft,
    ];

    /// Index in every array of four.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// +1 for a leg on the left side, -1 on the right: the sign of y.
    pub const fn side(self) -> f64 {
        match self {
            Self::FrontLeft | Self::RearLeft => 1.0,
            Self::FrontRight | Self::RearRight => -1.0,
        }
    }

    /// +1 for a front leg, -1 for a rear one: the sign of x.
    pub const fn end(self) -> f64 {
        match self {
            Self::FrontRight | Self::FrontLeft => 1.0,
            Self::RearRight | Self::RearLeft => -1.0,
        }
    }

    /// Two letters, as robots' manuals write it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::FrontRight => "FR",
            Self::FrontLeft => "FL",
            Self::RearRight => "RR",
            Self::RearLeft => "RL",
        }
    }
}

/// What the twelve joints and four feet of a quadruped report at one moment.
///
/// Arrays of four go by [`Leg`]; the components of a vector are hip (abduction), thigh and calf.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegState {
    /// When it was measured.
    pub stamp: Stamp,
    /// Joint angles, rad.
    pub angles: [Vector3; 4],
    /// Joint speeds, rad/s.
    pub speeds: [Vector3; 4],
    /// Estimated joint torques, Nm: positive turns the joint the positive way.
    pub torques: [Vector3; 4],
    /// Foot sensors in the robot's own unit and with its own zero; larger is more load.
    pub foot_forces: [f64; 4],
}

impl LegState {
    /// Whether every value is finite.
    pub fn is_finite(&self) -> bool {
        let joints = [&self.angles, &self.speeds, &self.torques];
        let finite = |v: &f64| v.is_finite();
        joints
            .into_iter()
            .flatten()
            .flat_map(|v| v.iter())
            .all(finite)
            && self.foot_forces.iter().all(finite)
    }
}

/// How a body stands in space, as its own inertial estimate has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeSample {
    /// When it was true.
    pub stamp: Stamp,
    /// Takes directions in `base` to a frame whose z points up. Roll and pitch do not drift, yaw
    /// does and has an arbitrary zero.
    pub level_from_base: Rotation,
}

/// Where leg states come from.
///
/// - `read_legs` is back by `deadline`; nothing to report is `Ok(None)`;
/// - stamps strictly increase: a state that the robot only repeats is not delivered again;
/// - every value is finite; an error leaves the device usable.
pub trait LegStates {
    /// What can go wrong.
    type Error: DeviceError;
    /// The next state.
    fn read_legs(&mut self, deadline: Stamp) -> Result<Option<LegState>, Self::Error>;
}

/// Joint angles that put a foot somewhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegPosture {
    /// Hip, thigh and calf, rad.
    pub angles: Vector3,
    /// Whether the foot gets there. Where it does not, the angles stretch or fold the leg towards
    /// the place as far as it goes.
    pub reachable: bool,
}

/// The geometry of a quadruped's legs: joints to feet and back, in the base frame.
///
/// - `jacobian` is the derivative of `foot_in_base` by the joint angles;
/// - `joints_for(leg, foot_in_base(leg, q))` is `q` for every `q` within the joints' limits that keeps
///   the foot below its hip, the base upright;
/// - nothing panics, whatever the numbers; not-a-number in gives not-a-number out, or unreachable.
pub trait LegKinematics {
    /// The centre of the foot's sphere, metres.
    fn foot_in_base(&self, leg: Leg, angles: &Vector3) -> Vector3;
    /// The derivative of [`Self::foot_in_base`], metres per radian.
    fn jacobian(&self, leg: Leg, angles: &Vector3) -> Matrix3;
    /// The angular velocity of the lowest link against the base is this times the joint speeds.
    fn shank_axes(&self, leg: Leg, angles: &Vector3) -> Matrix3;
    /// Joint angles that put the foot's centre at a place in the base frame.
    fn joints_for(&self, leg: Leg, foot: &Vector3) -> LegPosture;
    /// Radius of the foot's sphere, metres.
    fn foot_radius_m(&self) -> f64;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legs_stand_in_the_order_of_the_robots_arrays() {
        let names = Leg::ALL.map(Leg::name);
        assert_eq!(names, ["FR", "FL", "RR", "RL"]);
        assert_eq!(Leg::ALL.map(Leg::side), [-1.0, 1.0, -1.0, 1.0]);
        assert_eq!(Leg::ALL.map(Leg::end), [1.0, 1.0, -1.0, -1.0]);
        assert!(Leg::ALL.iter().enumerate().all(|(i, leg)| leg.index() == i));
    }
}
