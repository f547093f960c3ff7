//! Rigid transforms in double precision.

/// A rigid transform. `map_from_base * point_in_base` is that point in `map`.
pub type Pose = nalgebra::Isometry3<f64>;

/// A rotation as a unit quaternion.
pub type Rotation = nalgebra::UnitQuaternion<f64>;

/// A vector of three, metres unless the name says otherwise.
pub type Vector3 = nalgebra::Vector3<f64>;
