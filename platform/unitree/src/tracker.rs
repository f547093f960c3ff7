//! From joints to ground and motion: the flow, stage by stage. Read [`LegTracker::step`] first.
//!
//! In: what legs and body measured at one moment. Out: which feet stand, where the ground is, how
//! the body moves.

use hachi_hal::{AttitudeSample, ImuSample, Leg, LegKinematics, LegState, Rotation, Vector3};

use crate::contact::{ContactConfig, ContactDetector, ContactInput, Contacts};
use crate::footprint::{Footprint, FootprintInput, FootprintTracker};
use crate::kinematics::LegGeometry;
use crate::odometry::{
    LegOdometry, LegOdometryConfig, LegOdometryError, LegOdometryEstimate, LegOdometryInput,
};
use crate::robot::Quadruped;

/// What a robot's body measured at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodySample {
    /// Joints and feet.
    pub legs: LegState,
    /// Inertial reading, axes of the base.
    pub imu: ImuSample,
    /// Attitude.
    pub attitude: AttitudeSample,
}

/// What follows from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegEstimate {
    /// Which feet stand.
    pub contacts: Contacts,
    /// Where the ground is; `None` until a foot stands.
    pub footprint: Option<Footprint>,
    /// How the body moves.
    pub motion: LegOdometryEstimate,
}

/// Follows one robot's legs.
#[derive(Debug, Clone)]
pub struct LegTracker {
    legs: LegGeometry,
    contact: ContactDetector<LegGeometry>,
    footprint: FootprintTracker,
    odometry: LegOdometry<LegGeometry>,
    ground_in_level: Option<Vector3>,
    place_in_odom: Option<Vector3>,
}

impl LegTracker {
    /// For a robot as it is delivered.
    pub fn new(robot: &Quadruped) -> Self {
        let odometry = LegOdometryConfig {
            base_from_imu: robot.base_from_imu(),
            ..LegOdometryConfig::default()
        };
        Self::with(robot, robot.contact, odometry)
    }

    /// For a robot with its own settings.
    pub fn with(robot: &Quadruped, contact: ContactConfig, odometry: LegOdometryConfig) -> Self {
        Self {
            legs: robot.geometry,
            contact: ContactDetector::new(robot.geometry, contact, robot.mass_kg),
            footprint: FootprintTracker::new(),
            odometry: LegOdometry::new(robot.geometry, odometry),
            ground_in_level: None,
            place_in_odom: None,
        }
    }

    /// The next moment.
    ///
    /// # Errors
    /// It is not later than the last, or a number in it is not finite; it is left out.
    pub fn step(&mut self, sample: &BodySample) -> Result<LegEstimate, LegOdometryError> {
        let BodySample {
            legs,
            imu,
            attitude,
        } = sample;
        self.odometry.check(sample)?;
        let base_from_level = attitude.level_from_base.inverse();
        let up = base_from_level * Vector3::z();
        let ground = self.ground_in_level.map_or(up, |n| base_from_level * n);

        let contacts = self.contact.step(&ContactInput {
            legs,
            up,
            ground_normal: ground,
            angular_velocity: imu.angular_velocity,
        });
        let motion = self.odometry.step(&LegOdometryInput {
            sample,
            contacts: &contacts,
            ground_normal: ground,
        })?;
        let feet = Leg::ALL.map(|leg| self.legs.foot_in_base(leg, &legs.angles[leg.index()]));
        let moved = self.moved(&motion, &attitude.level_from_base);
        let input = FootprintInput {
            feet: &feet,
            contacts: &contacts,
            moving: &motion.slip.feet,
            level_from_base: attitude.level_from_base,
            moved,
        };
        let footprint = self.footprint.step(&self.legs, &input);
        let normal = footprint.map(|f| attitude.level_from_base * f.normal_in_base());
        self.ground_in_level = normal.or(self.ground_in_level);
        Ok(LegEstimate {
            contacts,
            footprint,
            motion,
        })
    }

    /// The way since the last moment in the attitude's level frame; `None` at first, and while no
    /// foot was trusted.
    fn moved(
        &mut self,
        motion: &LegOdometryEstimate,
        level_from_base: &Rotation,
    ) -> Option<Vector3> {
        let pose = &motion.sample.odom_from_base;
        let place = pose.translation.vector;
        let before = self.place_in_odom.replace(place)?;
        let level_from_odom = level_from_base * pose.rotation.inverse();
        (motion.feet > 0).then(|| level_from_odom * (place - before))
    }
}
