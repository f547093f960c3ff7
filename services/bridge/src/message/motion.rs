//! `sensor_msgs/Imu` and `nav_msgs/Odometry`.

use hachi_hal::{ImuSample, OdometrySample, Pose, Rotation, Vector3};
use nalgebra::{Quaternion, Translation3, UnitQuaternion};

use super::wire::Wire;
use crate::error::DecodeError;

/// Header, orientation and its covariance, angular velocity (rad/s) and its covariance, linear
/// acceleration (m/s², 9.81 upwards at rest) and its covariance.
pub(super) fn parse_imu(mut wire: Wire<'_>) -> Result<ImuSample, DecodeError> {
    let header = wire.header()?;
    wire.f64s::<{ 4 + 9 }>()?;
    let angular_velocity = vector(wire.f64s()?, "the angular velocity")?;
    wire.f64s::<9>()?;
    let specific_force = vector(wire.f64s()?, "the linear acceleration")?;
    wire.f64s::<9>()?;
    Ok(ImuSample {
        stamp: header.stamp,
        angular_velocity,
        specific_force,
    })
}

/// Header, child frame, pose (position, orientation as x, y, z, w) with covariance; the twist
/// behind it is not read.
pub(super) fn parse_odometry(mut wire: Wire<'_>) -> Result<OdometrySample, DecodeError> {
    let header = wire.header()?;
    wire.string()?;
    let position = vector(wire.f64s()?, "the position")?;
    let [x, y, z, w] = wire.f64s()?;
    let rotation = rotation(Quaternion::new(w, x, y, z))?;
    Ok(OdometrySample {
        stamp: header.stamp,
        odom_from_base: Pose::from_parts(Translation3::from(position), rotation),
    })
}

fn vector(values: [f64; 3], what: &'static str) -> Result<Vector3, DecodeError> {
    if values.iter().all(|value| value.is_finite()) {
        Ok(Vector3::from(values))
    } else {
        Err(DecodeError::Value { what })
    }
}

/// A quaternion within a tenth of unit length is one that was rounded; any other is none.
fn rotation(quaternion: Quaternion<f64>) -> Result<Rotation, DecodeError> {
    if (0.9..=1.1).contains(&quaternion.norm()) {
        Ok(UnitQuaternion::from_quaternion(quaternion))
    } else {
        Err(DecodeError::Value {
            what: "the orientation",
        })
    }
}
