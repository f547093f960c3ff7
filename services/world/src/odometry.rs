//! Odometry as a robot's legs give it: smooth, right about roll and pitch, drifting with the way.

use std::sync::Arc;

use hachi_hal::{OdometrySample, Pose, Rotation, Stamp, Vector3};
use nalgebra::Translation3;
use rand_chacha::ChaCha8Rng;

use crate::noise::{Purpose, generator, normal_pair, normal_vector};
use crate::simulation::SimulationConfig;
use crate::trajectory::Trajectory;

/// Rate and drift of the legs' odometry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OdometryConfig {
    /// From one sample to the next, ns.
    pub period_ns: i64,
    /// Standard deviation of the error of the scale, which stays the same for a whole run.
    pub scale_sigma: f64,
    /// Yaw's drift, radians per metre walked, standard deviation over runs.
    pub yaw_drift_per_m: f64,
    /// Random walk of yaw, radians per square root of a metre walked.
    pub yaw_walk: f64,
    /// Random walk of the position, metres per square root of a metre walked.
    pub position_walk: f64,
}

/// 1 to 2 % of the way, at 100 Hz.
impl Default for OdometryConfig {
    fn default() -> Self {
        Self {
            period_ns: 10_000_000,
            scale_sigma: 0.01,
            yaw_drift_per_m: 0.001,
            yaw_walk: 0.003,
            position_walk: 0.01,
        }
    }
}

impl OdometryConfig {
    /// Perfect, at 100 Hz.
    pub const NONE: Self = Self {
        period_ns: 10_000_000,
        scale_sigma: 0.0,
        yaw_drift_per_m: 0.0,
        yaw_walk: 0.0,
        position_walk: 0.0,
    };
}

/// The poses of the legs' odometry, in order. The `odom` frame starts under the base: level, x
/// along the robot's first heading, its origin where the base is. Roll and pitch come from the
/// inertial sensor and do not drift.
#[derive(Debug, Clone)]
pub struct SimulatedOdometry {
    trajectory: Arc<Trajectory>,
    config: OdometryConfig,
    start: Stamp,
    end: Stamp,
    index: i64,
    random: ChaCha8Rng,
    scale: f64,
    yaw_per_m: f64,
    last_in_map: Pose,
    position: Vector3,
    /// Takes directions of the map to the drifted odometry frame: a turn about the vertical.
    yaw: f64,
}

impl SimulatedOdometry {
    pub(crate) fn new(simulation: &SimulationConfig) -> Self {
        let config = OdometryConfig {
            period_ns: simulation.odometry.period_ns.max(1),
            ..simulation.odometry
        };
        let mut random = generator(simulation.seed, Purpose::Odometry, 0);
        let [scale, yaw] = normal_pair(&mut random);
        let first = simulation.trajectory.map_from_base(0.0);
        let (_, _, heading) = first.rotation.euler_angles();
        Self {
            trajectory: Arc::clone(&simulation.trajectory),
            start: simulation.start,
            end: simulation.end(),
            index: 0,
            random,
            scale: 1.0 + scale * config.scale_sigma,
            yaw_per_m: yaw * config.yaw_drift_per_m,
            last_in_map: first,
            position: Vector3::zeros(),
            yaw: -heading,
            config,
        }
    }

    /// The next sample if it is not after `stamp`.
    pub fn next_until(&mut self, stamp: Stamp) -> Option<OdometrySample> {
        let at = self.start + self.index.saturating_mul(self.config.period_ns);
        if at > stamp || at > self.end {
            return None;
        }
        self.index += 1;
        let now = self.trajectory.map_from_base(at.secs_since(self.start));
        let moved = now.translation.vector - self.last_in_map.translation.vector;
        self.last_in_map = now;
        let way = moved.norm();
        let odom_from_map = Rotation::from_axis_angle(&Vector3::z_axis(), self.yaw);
        let slip = normal_vector(&mut self.random) * (self.config.position_walk * way.sqrt());
        self.position += odom_from_map * moved * self.scale + slip;
        let [walk, _] = normal_pair(&mut self.random);
        self.yaw += self.yaw_per_m * way + self.config.yaw_walk * way.sqrt() * walk;
        let odom_from_map = Rotation::from_axis_angle(&Vector3::z_axis(), self.yaw);
        Some(OdometrySample {
            stamp: at,
            odom_from_base: Pose::from_parts(
                Translation3::from(self.position),
                odom_from_map * now.rotation,
            ),
        })
    }
}

impl Iterator for SimulatedOdometry {
    type Item = OdometrySample;
    fn next(&mut self) -> Option<OdometrySample> {
        self.next_until(self.end)
    }
}
