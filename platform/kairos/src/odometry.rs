//! Wheel odometry: speeds of the wheels to a pose in a level plane.
//!
//! In: speeds of the four wheels and when they were so. Out: the pose, integrated along arcs (the
//! exponential of the plane's motions), the velocity, and what their covariance is. Wheels that
//! contradict each other slip, and the covariance grows by what they contradict.

use hachi_hal::{BodyVelocity, OdometrySample, Pose, Rotation, Stamp, Vector3};
use nalgebra::{Matrix3, Translation3};

use crate::mecanum::Mecanum;

/// Errors of the wheels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WheelOdometryConfig {
    /// Share of the speed along x that is wrong, one standard deviation: rollers and radius.
    pub forward_share: f64,
    /// The same of the speed along y, where the rollers do most.
    pub left_share: f64,
    /// The same of the turn.
    pub yaw_share: f64,
    /// Time over which these errors stay the same, s.
    pub memory_s: f64,
}

impl Default for WheelOdometryConfig {
    fn default() -> Self {
        Self {
            forward_share: 0.02,
            left_share: 0.05,
            yaw_share: 0.04,
            memory_s: 1.0,
        }
    }
}

/// Pose and motion at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WheelEstimate {
    /// The pose; `odom` lies in the plane of the axles.
    pub sample: OdometrySample,
    /// The velocity.
    pub velocity: BodyVelocity,
    /// Covariance of forward, left and turning speed.
    pub velocity_covariance: Matrix3<f64>,
    /// Covariance of x, y and heading in `odom`.
    pub pose_covariance: Matrix3<f64>,
    /// By how much the wheels contradict each other, m/s.
    pub contradiction: f64,
}

/// Speeds that were not taken in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum WheelOdometryError {
    /// Not later than those before.
    NotLater {
        /// Those before.
        last: Stamp,
        /// These.
        stamp: Stamp,
    },
    /// A speed is not finite.
    NotFinite {
        /// Which wheel.
        wheel: usize,
    },
}

impl core::fmt::Display for WheelOdometryError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotLater { last, stamp } => write!(f, "{stamp} is not later than {last}"),
            Self::NotFinite { wheel } => {
                let name = crate::mecanum::WHEEL_NAMES.get(*wheel).unwrap_or(&"?");
                write!(f, "the speed of wheel {name} is not finite")
            }
        }
    }
}

impl core::error::Error for WheelOdometryError {}

/// Integrates the motion of one base.
#[derive(Debug, Clone)]
pub struct WheelOdometry {
    wheels: Mecanum,
    config: WheelOdometryConfig,
    place: [f64; 2],
    heading: f64,
    covariance: Matrix3<f64>,
    before: Option<(Stamp, BodyVelocity)>,
}

impl WheelOdometry {
    /// Starts where the base is.
    pub fn new(wheels: Mecanum, config: WheelOdometryConfig) -> Self {
        Self {
            wheels,
            config,
            place: [0.0; 2],
            heading: 0.0,
            covariance: Matrix3::zeros(),
            before: None,
        }
    }

    /// Takes in the wheels' speeds, rad/s.
    ///
    /// # Errors
    /// They are not later than the last, or one is not finite; they are left out.
    pub fn step(
        &mut self,
        stamp: Stamp,
        wheel_speeds: &[f64; 4],
    ) -> Result<WheelEstimate, WheelOdometryError> {
        if let Some(wheel) = wheel_speeds.iter().position(|w| !w.is_finite()) {
            return Err(WheelOdometryError::NotFinite { wheel });
        }
        if let Some((last, _)) = self.before
            && stamp <= last
        {
            return Err(WheelOdometryError::NotLater { last, stamp });
        }
        let velocity = self.wheels.velocity(wheel_speeds);
        let contradiction = self.wheels.contradiction(wheel_speeds);
        let velocity_covariance = self.velocity_covariance(&velocity, contradiction);
        if let Some((last, before)) = self.before.replace((stamp, velocity)) {
            let dt = stamp.secs_since(last);
            let mean = |a: f64, b: f64| 0.5 * (a + b) * dt;
            self.advance(
                mean(before.forward, velocity.forward),
                mean(before.left, velocity.left),
                mean(before.yaw_rate, velocity.yaw_rate),
            );
            self.spread(&velocity_covariance, dt);
        }
        Ok(WheelEstimate {
            sample: OdometrySample {
                stamp,
                odom_from_base: Pose::from_parts(
                    Translation3::new(self.place[0], self.place[1], 0.0),
                    Rotation::from_axis_angle(&Vector3::z_axis(), self.heading),
                ),
            },
            velocity,
            velocity_covariance,
            pose_covariance: self.covariance,
            contradiction,
        })
    }

    fn velocity_covariance(&self, velocity: &BodyVelocity, contradiction: f64) -> Matrix3<f64> {
        let c = &self.config;
        let slip = contradiction * contradiction;
        let square = |v: f64| v * v;
        let lever = self.wheels.half_wheelbase_m + self.wheels.half_track_m;
        Matrix3::from_diagonal(&Vector3::new(
            square(c.forward_share * velocity.forward) + slip,
            square(c.left_share * velocity.left) + slip,
            square(c.yaw_share * velocity.yaw_rate) + slip / (lever * lever),
        ))
    }

    /// Moves on along an arc.
    fn advance(&mut self, forward: f64, left: f64, turn: f64) {
        // sin t / t and (1 - cos t) / t, by their series where t is small.
        let (along, across) = if turn.abs() < 1e-4 {
            (1.0 - turn * turn / 6.0, turn / 2.0)
        } else {
            (libm::sin(turn) / turn, (1.0 - libm::cos(turn)) / turn)
        };
        let (x, y) = (
            along * forward - across * left,
            across * forward + along * left,
        );
        let (s, c) = (libm::sin(self.heading), libm::cos(self.heading));
        let (dx, dy) = (c * x - s * y, s * x + c * y);
        self.place[0] += dx;
        self.place[1] += dy;
        self.heading += turn;
        // An error of the heading swings what comes after it.
        let swing = Matrix3::new(1.0, 0.0, -dy, 0.0, 1.0, dx, 0.0, 0.0, 1.0);
        self.covariance = swing * self.covariance * swing.transpose();
    }

    /// Lets the pose's covariance grow: errors that stay the same for a while count for more than
    /// fresh ones.
    fn spread(&mut self, velocity_covariance: &Matrix3<f64>, dt: f64) {
        let (s, c) = (libm::sin(self.heading), libm::cos(self.heading));
        let turn = Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0);
        let grown = velocity_covariance * (dt * dt.max(self.config.memory_s));
        self.covariance += turn * grown * turn.transpose();
    }
}
