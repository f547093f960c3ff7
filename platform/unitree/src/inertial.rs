//! The base's velocity by its inertial sensor, led back slowly by what the legs say.
//!
//! In: specific force, angular velocity, attitude; now and then a velocity from the feet. Out: a
//! prediction that a slipping foot moves little, so that it can tell the slip: `dv/dt = f + g - w x
//! v` at the sensor's place. It is a voter, and a stand-in while no foot is trusted; the feet's
//! own mean is what is integrated, because an attitude that is off by half a degree leaves a lasting
//! acceleration of a tenth of a metre per second squared.

use hachi_hal::{ImuSample, Matrix3, Rotation, Stamp, Vector3};

use crate::vote::Prediction;

/// After a longer gap the last velocity says nothing about this one, s.
pub(crate) const LONGEST_GAP_S: f64 = 0.1;
/// Variance of the velocity of a robot of which nothing is known: it may run, (m/s)².
pub(crate) const UNKNOWN_VARIANCE: f64 = 4.0;
/// How the prediction's error grows, (m/s)² per second: 0.04 m/s after a quarter of a second, of
/// attitude, bias and impacts together.
const GROWTH: f64 = 0.0064;
/// Errors of a foot's velocity stay the same for about this long, s: lengths, zeros, rubber.
const FOOT_MEMORY_S: f64 = 0.05;
/// A prediction that no foot has agreed with for this long is wrong itself, ns.
const UNSUPPORTED_NS: i64 = 250_000_000;
/// And then has little say for this long, ns: a sensor that went wrong stays wrong.
const DISTRUSTED_NS: i64 = 2_000_000_000;
/// Smallest variance, (m/s)².
const LEAST_VARIANCE: f64 = 1e-4;

#[derive(Debug, Clone, Copy)]
struct State {
    stamp: Stamp,
    /// Velocity of the sensor's place, base frame.
    velocity: Vector3,
    variance: f64,
    specific_force: Vector3,
    angular_velocity: Vector3,
    dt_s: f64,
    supported: Stamp,
    distrusted_until: Stamp,
}

/// Follows one body.
#[derive(Debug, Clone)]
pub(crate) struct InertialVelocity {
    base_from_imu: Vector3,
    state: Option<State>,
}

impl InertialVelocity {
    pub fn new(base_from_imu: Vector3) -> Self {
        Self {
            base_from_imu,
            state: None,
        }
    }

    /// The base's velocity at the moment of `imu`.
    pub fn predict(&mut self, imu: &ImuSample, odom_from_base: &Rotation) -> Prediction {
        const GRAVITY: f64 = 9.80665;
        let stamp = imu.stamp;
        let long_ago = Stamp::from_nanos(i64::MIN);
        let mut state = State {
            stamp,
            velocity: Vector3::zeros(),
            variance: UNKNOWN_VARIANCE,
            specific_force: imu.specific_force,
            angular_velocity: imu.angular_velocity,
            dt_s: 0.0,
            supported: stamp,
            distrusted_until: long_ago,
        };
        if let Some(before) = &self.state {
            let dt_s = stamp.secs_since(before.stamp);
            state.distrusted_until = before.distrusted_until;
            if dt_s <= LONGEST_GAP_S {
                // Both ends' readings count half; the attitude is this moment's.
                let down =
                    odom_from_base.inverse_transform_vector(&Vector3::new(0.0, 0.0, -GRAVITY));
                let force = (before.specific_force + imu.specific_force) / 2.0;
                let turning = (before.angular_velocity + imu.angular_velocity) / 2.0;
                let acceleration = force + down - turning.cross(&before.velocity);
                state.velocity = before.velocity + acceleration * dt_s;
                state.variance = (before.variance + GROWTH * dt_s).min(UNKNOWN_VARIANCE);
                state.supported = before.supported;
                state.dt_s = dt_s;
            }
        }
        let prediction = Prediction {
            velocity: state.velocity - imu.angular_velocity.cross(&self.base_from_imu),
            covariance: Matrix3::identity() * state.variance,
            is_trusted: stamp >= state.distrusted_until && state.variance < UNKNOWN_VARIANCE,
        };
        self.state = Some(state);
        prediction
    }

    /// Leads the prediction towards what the feet agreed on; `None` where none was trusted.
    pub fn correct(&mut self, seen: Option<(&Vector3, &Matrix3)>, turning: &Vector3) {
        let Some(state) = &mut self.state else { return };
        let Some((velocity, covariance)) = seen else {
            if state.stamp.nanos_since(state.supported) > UNSUPPORTED_NS {
                state.distrusted_until = state.stamp + DISTRUSTED_NS;
                state.variance = UNKNOWN_VARIANCE;
            }
            return;
        };
        state.supported = state.stamp;
        let at_imu = velocity + turning.cross(&self.base_from_imu);
        // One of several readings that err alike counts for less.
        let repeats = (FOOT_MEMORY_S / state.dt_s.max(1e-4)).max(1.0);
        let fresh = state.variance >= UNKNOWN_VARIANCE;
        let variance = covariance.trace() / 3.0 * if fresh { 1.0 } else { repeats };
        let gain = state.variance / (state.variance + variance);
        state.velocity += (at_imu - state.velocity) * gain;
        state.variance = (state.variance * (1.0 - gain)).max(LEAST_VARIANCE);
    }
}
