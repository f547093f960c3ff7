//! An inertial sensor in the base, that drifts as real ones do.

use std::sync::Arc;

use hachi_hal::{Imu, ImuSample, Stamp, Vector3};
use rand_chacha::ChaCha8Rng;

use crate::noise::{Purpose, generator, normal_vector};
use crate::simulation::SimulationConfig;
use crate::trajectory::Trajectory;

/// Rate and errors of the inertial sensor. The defaults are those of a small MEMS unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuConfig {
    /// From one sample to the next, ns.
    pub period_ns: i64,
    /// White noise of a sample's angular velocity, rad/s.
    pub gyro_sigma: f64,
    /// White noise of a sample's specific force, m/s².
    pub force_sigma: f64,
    /// Standard deviation of the gyroscope's bias at the start, rad/s.
    pub gyro_bias_sigma: f64,
    /// Standard deviation of the accelerometer's bias at the start, m/s².
    pub force_bias_sigma: f64,
    /// How the gyroscope's bias walks, rad/s per square root of a second.
    pub gyro_bias_walk: f64,
    /// How the accelerometer's bias walks, m/s² per square root of a second.
    pub force_bias_walk: f64,
}

impl Default for ImuConfig {
    fn default() -> Self {
        Self {
            period_ns: 5_000_000,
            gyro_sigma: 0.003,
            force_sigma: 0.03,
            gyro_bias_sigma: 0.002,
            force_bias_sigma: 0.02,
            gyro_bias_walk: 1e-4,
            force_bias_walk: 5e-4,
        }
    }
}

impl ImuConfig {
    /// A perfect sensor at 200 Hz.
    pub const NONE: Self = Self {
        period_ns: 5_000_000,
        gyro_sigma: 0.0,
        force_sigma: 0.0,
        gyro_bias_sigma: 0.0,
        force_bias_sigma: 0.0,
        gyro_bias_walk: 0.0,
        force_bias_walk: 0.0,
    };
}

/// Acceleration of free fall, m/s² (standard value).
pub const GRAVITY: f64 = 9.80665;

/// The readings of an inertial sensor whose frame is the base, in order. As an iterator it runs to
/// the end; as a [`hal::Imu`](Imu) it gives what is there by the deadline, and never waits.
#[derive(Debug, Clone)]
pub struct SimulatedImu {
    trajectory: Arc<Trajectory>,
    config: ImuConfig,
    start: Stamp,
    end: Stamp,
    index: i64,
    random: ChaCha8Rng,
    gyro_bias: Vector3,
    force_bias: Vector3,
}

impl SimulatedImu {
    pub(crate) fn new(simulation: &SimulationConfig) -> Self {
        let config = ImuConfig {
            period_ns: simulation.imu.period_ns.max(1),
            ..simulation.imu
        };
        let mut random = generator(simulation.seed, Purpose::Imu, 0);
        Self {
            trajectory: Arc::clone(&simulation.trajectory),
            start: simulation.start,
            end: simulation.end(),
            index: 0,
            gyro_bias: normal_vector(&mut random) * config.gyro_bias_sigma,
            force_bias: normal_vector(&mut random) * config.force_bias_sigma,
            random,
            config,
        }
    }

    /// The next sample if it is not after `stamp`.
    pub fn next_until(&mut self, stamp: Stamp) -> Option<ImuSample> {
        let at = self.start + self.index.saturating_mul(self.config.period_ns);
        if at > stamp || at > self.end {
            return None;
        }
        self.index += 1;
        let time_s = at.secs_since(self.start);
        let twist = self.trajectory.twist(time_s);
        let base_from_map = self.trajectory.map_from_base(time_s).rotation.inverse();
        let force = base_from_map * (twist.acceleration_in_map + Vector3::z() * GRAVITY);
        let sample = ImuSample {
            stamp: at,
            angular_velocity: twist.angular_velocity_in_base
                + self.gyro_bias
                + normal_vector(&mut self.random) * self.config.gyro_sigma,
            specific_force: force
                + self.force_bias
                + normal_vector(&mut self.random) * self.config.force_sigma,
        };
        let root_s = (self.config.period_ns as f64 * 1e-9).sqrt();
        self.gyro_bias += normal_vector(&mut self.random) * (self.config.gyro_bias_walk * root_s);
        self.force_bias += normal_vector(&mut self.random) * (self.config.force_bias_walk * root_s);
        Some(sample)
    }
}

impl Iterator for SimulatedImu {
    type Item = ImuSample;
    fn next(&mut self) -> Option<ImuSample> {
        self.next_until(self.end)
    }
}

impl Imu for SimulatedImu {
    type Error = std::convert::Infallible;
    fn read(&mut self, deadline: Stamp) -> Result<Option<ImuSample>, Self::Error> {
        Ok(self.next_until(deadline))
    }
}
