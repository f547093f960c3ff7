//! How a walking robot's own sensors err.

use hachi_hal::{AttitudeSample, ImuSample, LegState, Rotation, Stamp, Vector3};
use rand_chacha::ChaCha8Rng;

use crate::imu::ImuConfig;
use crate::noise::{Purpose, generator, normal_pair, normal_vector};

/// What the feet's sensors show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ForceSensors {
    /// Counts that grow with the load from a zero that differs from foot to foot and drifts.
    Counts {
        /// Counts per newton.
        per_newton: f64,
        /// Standard deviation of the zeros, about their mean.
        zero_sigma: f64,
        /// Mean of the zeros, counts.
        zero_mean: f64,
        /// White noise, counts.
        sigma: f64,
        /// How the zeros drift, counts per second.
        drift_per_s: f64,
    },
    /// The same number whatever happens, as on many B1.
    Constant(f64),
}

/// How joints, inertial sensor and attitude err.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegSensorConfig {
    /// Zeros of the joints, rad.
    pub angle_zero_sigma: f64,
    /// White noise of the joint angles, rad.
    pub angle_sigma: f64,
    /// White noise of the joint speeds, rad/s.
    pub speed_sigma: f64,
    /// White noise of the joint torques, Nm.
    pub torque_sigma: f64,
    /// Feet.
    pub forces: ForceSensors,
    /// Inertial sensor; its period is not used.
    pub imu: ImuConfig,
    /// Error of roll and pitch, rad, wandering over two seconds.
    pub tilt_sigma: f64,
    /// Drift of the yaw, rad/s, standard deviation over runs.
    pub yaw_drift: f64,
}

impl Default for LegSensorConfig {
    fn default() -> Self {
        Self {
            angle_zero_sigma: 0.003,
            angle_sigma: 0.0005,
            speed_sigma: 0.05,
            torque_sigma: 0.3,
            forces: ForceSensors::Counts {
                per_newton: 1.0,
                zero_sigma: 20.0,
                zero_mean: 100.0,
                sigma: 2.0,
                drift_per_s: 0.2,
            },
            imu: ImuConfig::default(),
            tilt_sigma: 0.004,
            yaw_drift: 3e-4,
        }
    }
}

impl LegSensorConfig {
    /// Perfect sensors.
    pub const NONE: Self = Self {
        angle_zero_sigma: 0.0,
        angle_sigma: 0.0,
        speed_sigma: 0.0,
        torque_sigma: 0.0,
        forces: ForceSensors::Counts {
            per_newton: 1.0,
            zero_sigma: 0.0,
            zero_mean: 0.0,
            sigma: 0.0,
            drift_per_s: 0.0,
        },
        imu: ImuConfig::NONE,
        tilt_sigma: 0.0,
        yaw_drift: 0.0,
    };
}

/// What is true of joints and body at one moment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Truth {
    pub stamp: Stamp,
    pub angles: [Vector3; 4],
    pub speeds: [Vector3; 4],
    pub torques: [Vector3; 4],
    /// The ground's upward push, N.
    pub loads: [f64; 4],
    pub attitude: Rotation,
    pub angular_velocity: Vector3,
    /// At the inertial sensor's place.
    pub specific_force: Vector3,
}

/// The sensors of one robot, with what is wrong with them today.
#[derive(Debug, Clone)]
pub(super) struct Sensors {
    config: LegSensorConfig,
    random: ChaCha8Rng,
    angle_zeros: [Vector3; 4],
    force_zeros: [f64; 4],
    force_drift: [f64; 4],
    gyro_bias: Vector3,
    force_bias: Vector3,
    tilt: [f64; 2],
    yaw_rate: f64,
    yaw: f64,
}

/// Time over which the error of roll and pitch wanders, s.
const TILT_TIME_S: f64 = 2.0;

impl Sensors {
    pub fn new(config: LegSensorConfig, seed: u64) -> Self {
        let mut random = generator(seed, Purpose::Legs, 0);
        let mut four = |sigma: f64| {
            let ([a, b], [c, d]) = (normal_pair(&mut random), normal_pair(&mut random));
            [a, b, c, d].map(|v| v * sigma)
        };
        let (force_zeros, force_drift) = match config.forces {
            ForceSensors::Counts {
                zero_sigma,
                zero_mean,
                drift_per_s,
                ..
            } => (four(zero_sigma).map(|z| z + zero_mean), four(drift_per_s)),
            ForceSensors::Constant(_) => ([0.0; 4], [0.0; 4]),
        };
        let angle_zeros = [0; 4].map(|_| normal_vector(&mut random) * config.angle_zero_sigma);
        let gyro_bias = normal_vector(&mut random) * config.imu.gyro_bias_sigma;
        let force_bias = normal_vector(&mut random) * config.imu.force_bias_sigma;
        let [yaw, _] = normal_pair(&mut random);
        Self {
            config,
            angle_zeros,
            force_zeros,
            force_drift,
            gyro_bias,
            force_bias,
            tilt: [0.0; 2],
            yaw_rate: yaw * config.yaw_drift,
            yaw: 0.0,
            random,
        }
    }

    pub fn measure(&mut self, truth: &Truth, dt_s: f64) -> (LegState, ImuSample, AttitudeSample) {
        let config = self.config;
        let random = &mut self.random;
        let mut noisy =
            |values: &[Vector3; 4], sigma: f64| values.map(|v| v + normal_vector(random) * sigma);
        let mut angles = noisy(&truth.angles, config.angle_sigma);
        for (angle, zero) in angles.iter_mut().zip(&self.angle_zeros) {
            *angle += zero;
        }
        let legs = LegState {
            stamp: truth.stamp,
            angles,
            speeds: noisy(&truth.speeds, config.speed_sigma),
            torques: noisy(&truth.torques, config.torque_sigma),
            foot_forces: self.foot_forces(&truth.loads, dt_s),
        };
        let imu = ImuSample {
            stamp: truth.stamp,
            angular_velocity: truth.angular_velocity
                + self.gyro_bias
                + normal_vector(&mut self.random) * config.imu.gyro_sigma,
            specific_force: truth.specific_force
                + self.force_bias
                + normal_vector(&mut self.random) * config.imu.force_sigma,
        };
        let attitude = AttitudeSample {
            stamp: truth.stamp,
            level_from_base: self.attitude_error(dt_s) * truth.attitude,
        };
        (legs, imu, attitude)
    }

    fn foot_forces(&mut self, loads: &[f64; 4], dt_s: f64) -> [f64; 4] {
        match self.config.forces {
            ForceSensors::Constant(counts) => [counts; 4],
            ForceSensors::Counts {
                per_newton, sigma, ..
            } => std::array::from_fn(|i| {
                let [noise, _] = normal_pair(&mut self.random);
                self.force_zeros[i] += self.force_drift[i] * dt_s;
                (self.force_zeros[i] + per_newton * loads[i] + noise * sigma).round()
            }),
        }
    }

    /// The error of the attitude: a slow tilt, and a yaw that drifts.
    fn attitude_error(&mut self, dt_s: f64) -> Rotation {
        let keep = (-dt_s / TILT_TIME_S).exp();
        let fresh = (1.0 - keep * keep).sqrt() * self.config.tilt_sigma;
        let noise = normal_pair(&mut self.random);
        for (tilt, noise) in self.tilt.iter_mut().zip(noise) {
            *tilt = *tilt * keep + noise * fresh;
        }
        self.yaw += self.yaw_rate * dt_s;
        Rotation::from_scaled_axis(Vector3::new(self.tilt[0], self.tilt[1], self.yaw))
    }
}
