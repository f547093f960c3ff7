//! One leg as a chain of joints: hip about x, thigh and calf about y.

use hachi_hal::{Leg, Matrix3, Pose, Rotation, Vector3};
use nalgebra::Translation3;

/// A quadruped's legs in numbers, metres and kilograms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegDimensions {
    /// From the base's middle to the hip joints, forward.
    pub hip_forward: f64,
    /// From the base's middle to the hip joints, sideways.
    pub hip_sideways: f64,
    /// From the hip's axis to the plane of thigh and calf.
    pub abduction: f64,
    /// Length of the thigh.
    pub thigh: f64,
    /// Length of the calf, to the centre of the foot.
    pub calf: f64,
    /// Radius of the foot.
    pub foot_radius: f64,
    /// Weight of the whole robot.
    pub mass_kg: f64,
    /// Weight of a thigh.
    pub thigh_kg: f64,
    /// Weight of a calf with its foot.
    pub calf_kg: f64,
}

/// Frames of one leg in the base frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chain {
    pub hip: Pose,
    pub thigh: Pose,
    pub calf: Pose,
    pub foot: Vector3,
}

impl Chain {
    pub fn new(dimensions: &LegDimensions, leg: Leg, angles: &Vector3) -> Self {
        let d = dimensions;
        let about = |axis: Vector3, angle: f64| Rotation::from_scaled_axis(axis * angle);
        let link = |x: f64, y: f64, z: f64, turn: Rotation| {
            Pose::from_parts(Translation3::new(x, y, z), turn)
        };
        let hip = link(
            leg.end() * d.hip_forward,
            leg.side() * d.hip_sideways,
            0.0,
            about(Vector3::x(), angles.x),
        );
        let turn = about(Vector3::y(), angles.y);
        let thigh = hip * link(0.0, leg.side() * d.abduction, 0.0, turn);
        let calf = thigh * link(0.0, 0.0, -d.thigh, about(Vector3::y(), angles.z));
        let foot = calf * nalgebra::Point3::new(0.0, 0.0, -d.calf);
        Self {
            hip,
            thigh,
            calf,
            foot: foot.coords,
        }
    }

    /// Axes of the three joints.
    pub fn axes(&self) -> [Vector3; 3] {
        [
            Vector3::x(),
            self.hip.rotation * Vector3::y(),
            self.thigh.rotation * Vector3::y(),
        ]
    }

    /// How joint speeds move a point of the link that `joints` joints lie before.
    pub fn jacobian(&self, point: &Vector3, joints: usize) -> Matrix3 {
        let origins = [&self.hip, &self.thigh, &self.calf].map(|f| f.translation.vector);
        let mut columns = [Vector3::zeros(); 3];
        for (column, (axis, origin)) in columns
            .iter_mut()
            .zip(self.axes().iter().zip(origins))
            .take(joints)
        {
            *column = axis.cross(&(point - origin));
        }
        Matrix3::from_columns(&columns)
    }

    /// Angular velocity of the calf per joint speed.
    pub fn calf_axes(&self) -> Matrix3 {
        Matrix3::from_columns(&self.axes())
    }

    /// Middle of the thigh and of the calf: their centres of mass.
    pub fn centres(&self, dimensions: &LegDimensions) -> [Vector3; 2] {
        let middle = |frame: &Pose, length: f64| {
            (frame * nalgebra::Point3::new(0.0, 0.0, -length / 2.0)).coords
        };
        [
            middle(&self.thigh, dimensions.thigh),
            middle(&self.calf, dimensions.calf),
        ]
    }
}

/// Joint angles that put the foot's centre at `foot`, by Newton's method from `guess`; `None`
/// where the leg does not reach.
pub(super) fn reach(
    dimensions: &LegDimensions,
    leg: Leg,
    foot: &Vector3,
    guess: &Vector3,
) -> Option<Vector3> {
    const STEPS: usize = 30;
    const NEAR_M: f64 = 1e-10;
    let mut angles = *guess;
    for _ in 0..STEPS {
        let chain = Chain::new(dimensions, leg, &angles);
        let off = foot - chain.foot;
        if off.norm() < NEAR_M {
            return Some(angles);
        }
        let step = chain.jacobian(&chain.foot, 3).try_inverse()? * off;
        // Half a radian at a time, so that no step leaves the branch of the guess.
        angles += step * (0.5 / step.amax().max(0.5));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) const GO1_LIKE: LegDimensions = LegDimensions {
        hip_forward: 0.1881,
        hip_sideways: 0.04675,
        abduction: 0.08,
        thigh: 0.213,
        calf: 0.213,
        foot_radius: 0.02,
        mass_kg: 12.74,
        thigh_kg: 0.92,
        calf_kg: 0.196,
    };

    #[test]
    fn a_hanging_leg_is_straight_and_a_bent_one_shorter() {
        let hanging = Chain::new(&GO1_LIKE, Leg::FrontLeft, &Vector3::zeros());
        let expected = Vector3::new(0.1881, 0.12675, -0.426);
        assert!((hanging.foot - expected).norm() < 1e-12);
        // Thigh and calf lean 0.9 rad each way: 2 x 0.213 x cos 0.9.
        let bent = Chain::new(&GO1_LIKE, Leg::RearRight, &Vector3::new(0.0, 0.9, -1.8));
        let expected = Vector3::new(-0.1881, -0.12675, -0.264806);
        assert!((bent.foot - expected).norm() < 1e-6, "{}", bent.foot);
    }

    #[test]
    fn a_foot_reaches_where_it_is_sent() {
        let place = Vector3::new(0.25, 0.15, -0.22);
        let guess = Vector3::new(0.0, 0.9, -1.8);
        let angles = reach(&GO1_LIKE, Leg::FrontLeft, &place, &guess).unwrap();
        let foot = Chain::new(&GO1_LIKE, Leg::FrontLeft, &angles).foot;
        assert!((foot - place).norm() < 1e-9);
        let far = Vector3::new(1.0, 0.0, -1.0);
        assert_eq!(reach(&GO1_LIKE, Leg::FrontLeft, &far, &guess), None);
    }
}
