//! The transform that lays one set of positions over another.
//!
//! Least squares over pairs of positions, in closed form: S. Umeyama, "Least-squares estimation of
//! transformation parameters between two point patterns", PAMI 1991 (equations 34 to 43). Without
//! scale this is Horn's and Kabsch's problem.

use hachi_hal::{Pose, Rotation, Vector3};
use nalgebra::{Matrix3, Rotation3};

/// How an estimate is laid over the reference before its errors are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Alignment {
    /// As it is.
    #[default]
    None,
    /// Rotated and shifted.
    Se3,
    /// Rotated, shifted and scaled.
    Sim3,
}

/// How much of the rotation the positions determine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Observed {
    /// All of it.
    Full,
    /// The positions lie on a line: the rotation about it is arbitrary. Errors of position don't
    /// depend on it.
    Line,
    /// The positions are all one point: the rotation is left as it was.
    Point,
}

/// A rotation, a shift and a scale: `reference = scale * rotation * estimate + translation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    /// Turns the estimate.
    pub rotation: Rotation,
    /// Shifts it, metres of the reference.
    pub translation: Vector3,
    /// Stretches it; 1 without scaling.
    pub scale: f64,
}

impl Similarity {
    /// Changes nothing.
    pub fn identity() -> Self {
        Self {
            rotation: Rotation::identity(),
            translation: Vector3::zeros(),
            scale: 1.0,
        }
    }

    /// Where a pose of the estimate lies in the reference's frame. Orientation is turned, position
    /// turned, stretched and shifted.
    pub fn apply(&self, pose: &Pose) -> Pose {
        let position = self.scale * (self.rotation * pose.translation.vector) + self.translation;
        Pose::from_parts(position.into(), self.rotation * pose.rotation)
    }
}

/// Why no transform can be had.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum AlignmentError {
    /// No pairs of positions.
    #[error("there are no pairs of poses to align")]
    Empty,
    /// A scale can't be told from a robot that did not move.
    #[error("the estimate does not move, so its scale can't be told; align with se3 or none")]
    NoScale,
    /// The numbers are too large or not finite.
    #[error("the positions are too large to align")]
    NotFinite,
}

/// Singular values below this share of the largest count as zero. The positions come as text with
/// 7 to 17 digits, whose products carry about 1e-15 of rounding.
const RANK_TOLERANCE: f64 = 1e-12;

/// The least-squares transform from the estimate's positions to the reference's, over pairs
/// `(reference, estimate)` in metres, and how much of the rotation they determine.
///
/// # Errors
/// [`AlignmentError`] when it does not exist.
pub fn align(
    pairs: &[(Vector3, Vector3)],
    alignment: Alignment,
) -> Result<(Similarity, Observed), AlignmentError> {
    if alignment == Alignment::None {
        return Ok((Similarity::identity(), Observed::Full));
    }
    if pairs.is_empty() {
        return Err(AlignmentError::Empty);
    }
    let count = pairs.len() as f64;
    let sum = |pick: fn(&(Vector3, Vector3)) -> Vector3| pairs.iter().map(pick).sum::<Vector3>();
    let reference_mean = sum(|p| p.0) / count;
    let estimate_mean = sum(|p| p.1) / count;

    let mut covariance = Matrix3::zeros();
    let mut estimate_variance = 0.0;
    for (reference, estimate) in pairs {
        let from_mean = estimate - estimate_mean;
        covariance += (reference - reference_mean) * from_mean.transpose() / count;
        estimate_variance += from_mean.norm_squared() / count;
    }
    if !covariance.iter().all(|c| c.is_finite()) || !estimate_variance.is_finite() {
        return Err(AlignmentError::NotFinite);
    }

    let svd = covariance.svd(true, true);
    let (Some(u), Some(v_transposed)) = (svd.u, svd.v_t) else {
        return Err(AlignmentError::NotFinite);
    };
    let largest = svd.singular_values[0];
    let observed = if largest <= f64::EPSILON * f64::EPSILON {
        Observed::Point
    } else if svd.singular_values[1] <= RANK_TOLERANCE * largest {
        Observed::Line
    } else {
        Observed::Full
    };

    // The last direction flips where the best orthogonal matrix is a reflection (equation 43).
    let mut signs = Vector3::new(1.0, 1.0, 1.0);
    if u.determinant() * v_transposed.determinant() < 0.0 {
        signs.z = -1.0;
    }
    let rotation = match observed {
        Observed::Point => Rotation::identity(),
        _ => {
            let matrix = u * Matrix3::from_diagonal(&signs) * v_transposed;
            Rotation::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix))
        }
    };
    let scale = match alignment {
        Alignment::Sim3 if estimate_variance <= 0.0 => return Err(AlignmentError::NoScale),
        Alignment::Sim3 => svd.singular_values.dot(&signs) / estimate_variance,
        _ => 1.0,
    };
    if alignment == Alignment::Sim3 && scale <= 0.0 {
        return Err(AlignmentError::NoScale);
    }
    let translation = reference_mean - scale * (rotation * estimate_mean);
    let similarity = Similarity {
        rotation,
        translation,
        scale,
    };
    Ok((similarity, observed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn moved(points: &[Vector3], truth: &Similarity) -> Vec<(Vector3, Vector3)> {
        let to_reference = |p: &Vector3| truth.scale * (truth.rotation * p) + truth.translation;
        points.iter().map(|p| (to_reference(p), *p)).collect()
    }

    fn corner() -> Vec<Vector3> {
        [[0., 0., 0.], [1., 0., 0.], [1., 2., 0.], [1., 2., 3.]]
            .map(Vector3::from)
            .to_vec()
    }

    proptest! {
        #[test]
        fn a_known_similarity_is_found(
            axis in prop::array::uniform3(-3.0f64..3.0),
            shift in prop::array::uniform3(-100.0f64..100.0),
            scale in 0.1f64..10.0,
        ) {
            let truth = Similarity {
                rotation: Rotation::new(axis.into()),
                translation: shift.into(),
                scale,
            };
            let (found, observed) = align(&moved(&corner(), &truth), Alignment::Sim3).unwrap();
            prop_assert_eq!(observed, Observed::Full);
            prop_assert!((found.scale - scale).abs() < 1e-9 * scale);
            prop_assert!(found.rotation.angle_to(&truth.rotation) < 1e-7);
            prop_assert!((found.translation - truth.translation).norm() < 1e-8 * scale.max(1.0));
        }
    }

    #[test]
    fn a_mirrored_path_is_never_reflected() {
        let pairs: Vec<_> = corner()
            .iter()
            .map(|p| (Vector3::new(-p.x, p.y, p.z), *p))
            .collect();
        let (found, _) = align(&pairs, Alignment::Se3).unwrap();
        let determinant = found.rotation.to_rotation_matrix().matrix().determinant();
        assert!((determinant - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_straight_path_is_aligned_and_said_to_be_a_line() {
        let line: Vec<Vector3> = (0..10)
            .map(|i| Vector3::new(f64::from(i), 0.0, 0.0))
            .collect();
        let truth = Similarity {
            rotation: Rotation::new(Vector3::new(0.0, 0.0, 1.0)),
            translation: Vector3::new(4.0, 5.0, 6.0),
            scale: 1.0,
        };
        let pairs = moved(&line, &truth);
        let (found, observed) = align(&pairs, Alignment::Se3).unwrap();
        assert_eq!(observed, Observed::Line);
        for (reference, estimate) in pairs {
            let error = found.rotation * estimate + found.translation - reference;
            assert!(error.norm() < 1e-12);
        }
    }

    #[test]
    fn a_robot_that_stood_still_is_shifted_but_has_no_scale() {
        let pairs = [(Vector3::new(1.0, 2.0, 3.0), Vector3::zeros()); 5];
        let (found, observed) = align(&pairs, Alignment::Se3).unwrap();
        assert_eq!(observed, Observed::Point);
        assert_eq!(found.translation, Vector3::new(1.0, 2.0, 3.0));
        assert_eq!(align(&pairs, Alignment::Sim3), Err(AlignmentError::NoScale));
    }

    #[test]
    fn numbers_too_large_to_square_are_refused() {
        let pairs = [
            (Vector3::repeat(1e200), Vector3::zeros()),
            (Vector3::zeros(), Vector3::repeat(-1e200)),
        ];
        assert_eq!(
            align(&pairs, Alignment::Se3),
            Err(AlignmentError::NotFinite)
        );
    }
}
