//! What a state says, in the terms of hal: joints, inertial reading, attitude, battery.
//!
//! In: the body of a decoded frame and when it arrived. Out: hal's samples, each checked for
//! itself, so that one ill motor does not take the attitude with it: a number that is not finite,
//! a joint where none can be or a quaternion that is none is named, with what was seen.

use hachi_hal::{AttitudeSample, BatterySample, ImuSample, LegState, Rotation, Stamp, Vector3};
use nalgebra::Quaternion;

use crate::frame::{BodyReading, FieldError, Layout, all_finite};
use crate::robot::JointLimits;
use crate::tracker::BodySample;

/// A joint may be seen this far beyond its mechanical end, rad: zeros are calibrated by hand, and
/// links bend.
const JOINT_MARGIN: f64 = 0.2;
/// A quaternion's length may be this far from 1.
const QUATERNION_MARGIN: f32 = 0.02;
/// Leg motors of a frame.
const LEG_MOTORS: usize = 12;

/// Everything that leg odometry needs.
///
/// # Errors
/// The first value that can't be.
pub fn body_sample(
    body: &BodyReading,
    limits: &JointLimits,
    stamp: Stamp,
) -> Result<BodySample, FieldError> {
    Ok(BodySample {
        legs: leg_state(body, limits, stamp)?,
        imu: imu_sample(body, stamp)?,
        attitude: attitude(body, stamp)?,
    })
}

/// Joints and feet.
///
/// # Errors
/// A number is not finite, or a joint is beyond its mechanical ends.
pub fn leg_state(
    body: &BodyReading,
    limits: &JointLimits,
    stamp: Stamp,
) -> Result<LegState, FieldError> {
    let motors = &body.motors[..LEG_MOTORS];
    for (index, motor) in motors.iter().enumerate() {
        for (field, got) in [
            ("joint angle", motor.angle),
            ("joint speed", motor.speed),
            ("joint torque", motor.torque),
        ] {
            if !got.is_finite() {
                return Err(FieldError::NotFinite { field, index, got });
            }
        }
        let span = limits.mechanical[index % 3];
        if !span.contains(f64::from(motor.angle), JOINT_MARGIN) {
            return Err(FieldError::OutOfRange {
                field: "joint angle",
                index,
                got: motor.angle,
                least: span.least as f32,
                most: span.most as f32,
            });
        }
    }
    let of_leg = |leg: usize, value: fn(&crate::frame::MotorState) -> f32| {
        let [hip, thigh, calf] = [0, 1, 2].map(|joint| f64::from(value(&motors[3 * leg + joint])));
        Vector3::new(hip, thigh, calf)
    };
    let each = |value: fn(&crate::frame::MotorState) -> f32| {
        core::array::from_fn(|leg| of_leg(leg, value))
    };
    Ok(LegState {
        stamp,
        angles: each(|motor| motor.angle),
        speeds: each(|motor| motor.speed),
        torques: each(|motor| motor.torque),
        foot_forces: body.foot_force.map(f64::from),
    })
}

/// The inertial reading, in the axes of the base.
///
/// # Errors
/// A number is not finite.
pub fn imu_sample(body: &BodyReading, stamp: Stamp) -> Result<ImuSample, FieldError> {
    let imu = &body.imu;
    all_finite("gyroscope", &imu.gyroscope)?;
    all_finite("accelerometer", &imu.accelerometer)?;
    Ok(ImuSample {
        stamp,
        angular_velocity: Vector3::from(imu.gyroscope.map(f64::from)),
        specific_force: Vector3::from(imu.accelerometer.map(f64::from)),
    })
}

/// The robot's own estimate of its attitude.
///
/// # Errors
/// The quaternion is not one: zeros before the robot's estimate runs.
pub fn attitude(body: &BodyReading, stamp: Stamp) -> Result<AttitudeSample, FieldError> {
    let raw = body.imu.quaternion;
    all_finite("quaternion", &raw)?;
    let [w, x, y, z] = raw.map(f64::from);
    let quaternion = Quaternion::new(w, x, y, z);
    let length = quaternion.norm() as f32;
    if (length - 1.0).abs() > QUATERNION_MARGIN {
        return Err(FieldError::Quaternion { length });
    }
    Ok(AttitudeSample {
        stamp,
        level_from_base: Rotation::from_quaternion(quaternion),
    })
}

/// The battery.
///
/// # Errors
/// It claims more than all its charge.
pub fn battery(
    body: &BodyReading,
    layout: &Layout,
    stamp: Stamp,
) -> Result<BatterySample, FieldError> {
    let reading = &body.battery;
    if reading.charge_percent > 100 {
        return Err(FieldError::OutOfRange {
            field: "battery charge",
            index: 0,
            got: f32::from(reading.charge_percent),
            least: 0.0,
            most: 100.0,
        });
    }
    let cells = reading.cells_mv.iter().take(layout.cells);
    let volts = |millivolts: u32| f64::from(millivolts) * 1e-3;
    let thermistors = reading
        .monitor_temperatures_c
        .iter()
        .chain(&reading.controller_temperatures_c);
    Ok(BatterySample {
        stamp,
        charge: f64::from(reading.charge_percent) / 100.0,
        voltage: volts(cells.clone().map(|mv| u32::from(*mv)).sum()),
        current: f64::from(reading.current_ma) * 1e-3,
        temperature_c: f64::from(thermistors.copied().max().unwrap_or(0)),
        lowest_cell: volts(cells.map(|mv| u32::from(*mv)).min().unwrap_or(0)),
        cycles: u32::from(reading.cycles),
    })
}
