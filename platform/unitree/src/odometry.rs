//! Leg odometry: how the body moves, from the feet that stand still.
//!
//! In: a leg state, the inertial reading and attitude of the same moment, which feet stand, the
//! ground's normal. Out: the velocity of the base with its covariance, the pose integrated from
//! it, and which feet slip.
//!
//! A sole that stands still gives `v = -(J dq + w x p)`, with `p` the point of contact and `J` the
//! derivative of the point of the foot that is there: a round foot rolls, and its centre moves on
//! by the radius times the shank's turn. Feet vote together with what the accelerometer makes of
//! the last velocity; a foot that is outvoted slips and is left out. If none is left the velocity
//! is carried by the accelerometer and its covariance grows.
//!
//! The `odom` frame is level, its x along the first heading, its origin the base's first place.

use hachi_hal::{Leg, LegKinematics, Matrix3, OdometrySample, Pose, Rotation, Stamp, Vector3};
use nalgebra::Translation3;

use crate::contact::{ContactSource, Contacts};
use crate::inertial::{InertialVelocity, LONGEST_GAP_S, UNKNOWN_VARIANCE};
use crate::tracker::BodySample;
use crate::vote::{Candidate, Verdict, vote};

/// Errors of the sensors, one standard deviation each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegOdometryConfig {
    /// Joint speeds, rad/s.
    pub joint_speed_sigma: f64,
    /// Angular velocity, rad/s.
    pub gyro_sigma: f64,
    /// What a standing foot moves all the same: rubber and soft ground, m/s.
    pub foot_sigma: f64,
    /// Share of the way that is wrong in a lasting manner: lengths of legs, zeros of joints.
    pub scale_sigma: f64,
    /// Yaw of the body's own attitude, rad per square root of a second.
    pub yaw_walk: f64,
    /// Where the inertial sensor is in the base frame, metres.
    pub base_from_imu: Vector3,
}

impl Default for LegOdometryConfig {
    fn default() -> Self {
        Self {
            joint_speed_sigma: 0.08,
            gyro_sigma: 0.01,
            foot_sigma: 0.03,
            scale_sigma: 0.01,
            yaw_walk: 0.002,
            base_from_imu: Vector3::zeros(),
        }
    }
}

/// What one moment is judged by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegOdometryInput<'a> {
    /// What legs and body measured.
    pub sample: &'a BodySample,
    /// Which feet stand.
    pub contacts: &'a Contacts,
    /// Unit vector off the ground, base frame.
    pub ground_normal: Vector3,
}

/// Feet that slip.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Slip {
    /// Which feet were outvoted.
    pub feet: [bool; 4],
    /// How fast each standing foot moves over the ground by the verdict, m/s.
    pub speeds: [f64; 4],
}

impl Slip {
    /// Whether any foot slips.
    pub fn any(&self) -> bool {
        self.feet.contains(&true)
    }
}

/// The motion at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegOdometryEstimate {
    /// The pose.
    pub sample: OdometrySample,
    /// Velocity of the base's origin, base frame, m/s.
    pub velocity: Vector3,
    /// Its covariance, (m/s)².
    pub velocity_covariance: Matrix3,
    /// Covariance of the position in `odom`, m².
    pub position_covariance: Matrix3,
    /// Variance of the yaw, rad².
    pub yaw_variance: f64,
    /// Distance covered so far, metres.
    pub distance_m: f64,
    /// Feet that slip.
    pub slip: Slip,
    /// How many feet the velocity rests on.
    pub feet: usize,
    /// From what it was known that they stand.
    pub source: ContactSource,
}

/// Why a moment was left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LegOdometryError {
    /// Not later than the moment before.
    #[error("{stamp} is not later than {last}")]
    NotLater {
        /// The moment before.
        last: Stamp,
        /// This one.
        stamp: Stamp,
    },
    /// A number that is not finite.
    #[error("a measurement at {stamp} is not finite")]
    NotFinite {
        /// When.
        stamp: Stamp,
    },
}

/// Feet with less confidence have no vote.
const LEAST_CONFIDENCE: f64 = 0.15;

#[derive(Debug, Clone, Copy)]
struct Before {
    stamp: Stamp,
    velocity_in_odom: Vector3,
}

/// Integrates the motion of one robot.
#[derive(Debug, Clone)]
pub struct LegOdometry<K> {
    legs: K,
    config: LegOdometryConfig,
    odom_from_level: Option<Rotation>,
    before: Option<Before>,
    inertial: InertialVelocity,
    position: Vector3,
    /// Independent errors of the velocities, added up, m².
    walk: Matrix3,
    yaw_variance: f64,
    distance_m: f64,
}

impl<K: LegKinematics> LegOdometry<K> {
    /// Starts where the robot is.
    pub fn new(legs: K, config: LegOdometryConfig) -> Self {
        Self {
            legs,
            config,
            odom_from_level: None,
            before: None,
            inertial: InertialVelocity::new(config.base_from_imu),
            position: Vector3::zeros(),
            walk: Matrix3::zeros(),
            yaw_variance: 0.0,
            distance_m: 0.0,
        }
    }

    /// The motion at the next moment.
    ///
    /// # Errors
    /// The moment is not later than the last, or has a number that is not finite; it is left out.
    pub fn step(
        &mut self,
        input: &LegOdometryInput<'_>,
    ) -> Result<LegOdometryEstimate, LegOdometryError> {
        self.check(input.sample)?;
        let BodySample {
            legs,
            imu,
            attitude,
        } = input.sample;
        let (stamp, turning) = (legs.stamp, imu.angular_velocity);
        let level_from_base = attitude.level_from_base;
        let odom_from_level = *self
            .odom_from_level
            .get_or_insert_with(|| unheaded(&level_from_base));
        let odom_from_base = odom_from_level * level_from_base;

        let prediction = self.inertial.predict(imu, &odom_from_base);
        let candidates = Leg::ALL.map(|leg| self.foot_says(leg, input));
        let Verdict {
            velocity,
            covariance,
            slips,
            feet,
        } = vote(&candidates, &prediction);
        let seen = (feet > 0).then_some((&velocity, &covariance));
        self.inertial.correct(seen, &turning);

        let in_odom = odom_from_base * velocity;
        self.advance(stamp, &in_odom, &rotated(&odom_from_base, &covariance));
        self.before = Some(Before {
            stamp,
            velocity_in_odom: in_odom,
        });
        let speeds = candidates.map(|c| c.map_or(0.0, |c| (c.velocity - velocity).norm()));
        Ok(LegOdometryEstimate {
            sample: OdometrySample {
                stamp,
                odom_from_base: Pose::from_parts(Translation3::from(self.position), odom_from_base),
            },
            velocity,
            velocity_covariance: covariance,
            position_covariance: self.position_covariance(),
            yaw_variance: self.yaw_variance,
            distance_m: self.distance_m,
            slip: Slip {
                feet: slips,
                speeds,
            },
            feet,
            source: input.contacts.source,
        })
    }

    /// Whether this moment can follow the last one.
    pub(crate) fn check(&self, sample: &BodySample) -> Result<(), LegOdometryError> {
        let stamp = sample.legs.stamp;
        if let Some(Before { stamp: last, .. }) = self.before
            && stamp <= last
        {
            return Err(LegOdometryError::NotLater { last, stamp });
        }
        let vectors = [&sample.imu.angular_velocity, &sample.imu.specific_force];
        let mut numbers = vectors.into_iter().flat_map(|v| v.iter());
        let attitude = &sample.attitude.level_from_base.coords;
        let finite = sample.legs.is_finite()
            && numbers.all(|v| v.is_finite())
            && attitude.iter().all(|v| v.is_finite());
        if finite {
            Ok(())
        } else {
            Err(LegOdometryError::NotFinite { stamp })
        }
    }

    /// The base's velocity if this foot stands still.
    fn foot_says(&self, leg: Leg, input: &LegOdometryInput<'_>) -> Option<Candidate> {
        let i = leg.index();
        let contact = &input.contacts.feet[i];
        if !contact.standing || contact.confidence < LEAST_CONFIDENCE {
            return None;
        }
        let BodySample { legs, imu, .. } = input.sample;
        let (angles, speeds) = (&legs.angles[i], &legs.speeds[i]);
        let to_sole = input.ground_normal * -self.legs.foot_radius_m();
        let sole = self.legs.foot_in_base(leg, angles) + to_sole;
        // The shank's turn moves the foot's lowest point against its centre.
        let jacobian = self.legs.jacobian(leg, angles)
            - to_sole.cross_matrix() * self.legs.shank_axes(leg, angles);
        let velocity = -(jacobian * speeds + imu.angular_velocity.cross(&sole));
        let config = &self.config;
        let square = |sigma: f64| sigma * sigma;
        let arm = sole.cross_matrix();
        let covariance = jacobian * jacobian.transpose() * square(config.joint_speed_sigma)
            + arm * arm.transpose() * square(config.gyro_sigma)
            + Matrix3::identity() * square(config.foot_sigma);
        Some(Candidate {
            velocity,
            covariance: covariance / contact.confidence,
        })
    }

    /// Moves the pose on by the mean of the last velocity and this one.
    fn advance(&mut self, stamp: Stamp, velocity: &Vector3, covariance: &Matrix3) {
        let Some(before) = &self.before else { return };
        let dt = stamp.secs_since(before.stamp);
        let step = (before.velocity_in_odom + velocity) * (0.5 * dt);
        self.position += step;
        self.distance_m += step.norm();
        self.walk += covariance * (dt * dt);
        if dt > LONGEST_GAP_S {
            // Nobody knows what it did meanwhile.
            self.walk += Matrix3::identity() * (UNKNOWN_VARIANCE * dt * dt);
        }
        self.yaw_variance += self.config.yaw_walk * self.config.yaw_walk * dt;
    }

    fn position_covariance(&self) -> Matrix3 {
        let lasting = self.config.scale_sigma * self.distance_m;
        let across = self.yaw_variance * self.position.norm_squared() / 3.0;
        self.walk + Matrix3::identity() * (lasting * lasting / 3.0 + across)
    }
}

/// The turn about the vertical that takes the heading off an attitude.
fn unheaded(level_from_base: &Rotation) -> Rotation {
    let (_, _, yaw) = level_from_base.euler_angles();
    Rotation::from_axis_angle(&Vector3::z_axis(), -yaw)
}

fn rotated(rotation: &Rotation, covariance: &Matrix3) -> Matrix3 {
    let r = rotation.to_rotation_matrix();
    r.matrix() * covariance * r.matrix().transpose()
}
