//! Initial poses from the graph alone.
//!
//! In: a [`Graph`](crate::Graph) whose poses are unknown or not to be trusted. Out: the same graph with poses that
//! a solver can start from. Fixed poses, and of each part without one the pose with the smallest
//! key, stay where they are.

mod best;
mod rotations;
mod tree;

use nalgebra::{Matrix2, Matrix3, Rotation3, UnitComplex, UnitQuaternion, Vector2, Vector3};

use crate::group::{Dense, Group, Se2, Se3};

pub use best::{Start, optimize_from_best};
pub use rotations::rotations_first;
pub(crate) use tree::complete;
pub use tree::spanning_tree;

/// A group of rotations and translations, tangent vectors translation first.
pub trait Rigid: Group {
    /// Dimensions of the space: 2 or 3.
    const SPACE: usize;
    /// The translation.
    fn translation(&self) -> [f64; 3];
    /// The rotation matrix, column by column.
    fn rotation(&self) -> [f64; 9];
    /// A pose of this translation and the rotation nearest to this matrix, column by column.
    fn nearest(translation: &[f64], matrix: &[f64]) -> Self;

    /// How well a factor knows rotation: the mean of the diagonal of its information.
    fn rotation_weight(information: &Self::Matrix) -> f64 {
        let diagonal = (Self::SPACE..Self::DIM).map(|k| information.numbers()[k * (Self::DIM + 1)]);
        diagonal.sum::<f64>() / (Self::DIM - Self::SPACE) as f64
    }
}

impl Rigid for Se2 {
    const SPACE: usize = 2;

    fn translation(&self) -> [f64; 3] {
        [self.translation.x, self.translation.y, 0.0]
    }

    fn rotation(&self) -> [f64; 9] {
        let (c, s) = (self.rotation.re, self.rotation.im);
        [c, s, -s, c, 0.0, 0.0, 0.0, 0.0, 0.0]
    }

    fn nearest(translation: &[f64], matrix: &[f64]) -> Self {
        let m = Matrix2::from_column_slice(&matrix[..4]);
        // The angle that lies nearest to both columns.
        let theta = (m[(1, 0)] - m[(0, 1)]).atan2(m[(0, 0)] + m[(1, 1)]);
        Self {
            translation: Vector2::new(translation[0], translation[1]),
            rotation: UnitComplex::new(theta),
        }
    }
}

impl Rigid for Se3 {
    const SPACE: usize = 3;

    fn translation(&self) -> [f64; 3] {
        self.translation.into()
    }

    fn rotation(&self) -> [f64; 9] {
        let matrix = self.rotation.to_rotation_matrix().into_inner();
        let mut numbers = [0.0; 9];
        numbers.copy_from_slice(matrix.as_slice());
        numbers
    }

    fn nearest(translation: &[f64], matrix: &[f64]) -> Self {
        let svd = Matrix3::from_column_slice(&matrix[..9]).svd(true, true);
        let rotation = match (svd.u, svd.v_t) {
            (Some(u), Some(v)) => {
                let mut middle = Matrix3::identity();
                middle[(2, 2)] = (u * v).determinant().signum();
                UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(
                    u * middle * v,
                ))
            }
            _ => UnitQuaternion::identity(),
        };
        Self::new(
            Vector3::new(translation[0], translation[1], translation[2]),
            rotation,
        )
    }
}
