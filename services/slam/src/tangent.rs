//! Small steps between poses, as vectors: translation first, then rotation, on the right of a pose.

use hachi_hal::{Pose, Rotation};
use nalgebra::Vector6;

/// The pose after a small step on its right, translation first.
pub fn stepped(pose: &Pose, step: &Vector6<f64>) -> Pose {
    let shift = step.fixed_rows::<3>(0).into_owned();
    let turn = Rotation::from_scaled_axis(step.fixed_rows::<3>(3).into_owned());
    pose * Pose::from_parts(shift.into(), turn)
}

/// The step on the right of `from` that leads to `to`: translation first.
pub fn difference(from: &Pose, to: &Pose) -> Vector6<f64> {
    let step = from.inv_mul(to);
    let (shift, turn) = (step.translation.vector, step.rotation.scaled_axis());
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}
