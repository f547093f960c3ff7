//! Directions in which two clouds can slide along each other unnoticed.
//!
//! In a featureless corridor nothing fixes the motion along it. There the eigenvalue of the
//! information matrix is that of the surfaces' tangential weight alone, whose pull is an artefact
//! of where the rings fell; the update in that direction is taken from the prior instead, as in
//! Zhang, Kaess, Singh: "On degeneracy of optimization-based state estimation", ICRA 2016.

use nalgebra::{Matrix3, Matrix6, SymmetricEigen, Vector3, Vector6};

/// What the clouds leave open, in the source frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Degeneracy {
    /// Unit directions of translation left open; the first `translations` are filled.
    pub directions: [Vector3<f64>; 3],
    /// How many directions of translation are left open.
    pub translations: usize,
    /// Unit axes of rotation left open; the first `rotations` are filled.
    pub axes: [Vector3<f64>; 3],
    /// How many axes of rotation are left open.
    pub rotations: usize,
}

impl Degeneracy {
    /// Looks at an information matrix (rotation first), of which `tangential` is the information
    /// about translation that every direction has alike, because points are held a little to
    /// where on a surface their partners happened to be.
    ///
    /// A direction is open if the information about it, the other three dimensions being free, is
    /// less than `threshold` of that about the best-known direction. Zero or less switches this
    /// off.
    pub fn of(information: &Matrix6<f64>, tangential: f64, threshold: f64) -> Self {
        let mut out = Self::default();
        if threshold <= 0.0 {
            return out;
        }
        let block = |r: usize, c: usize| -> Matrix3<f64> {
            information.fixed_view::<3, 3>(r, c).into_owned()
        };
        let (rotation, coupling) = (block(0, 0), block(0, 3));
        let translation = block(3, 3) - Matrix3::identity() * tangential;
        let limit = threshold * largest(&translation);
        if let Some(inverse) = rotation.try_inverse() {
            let left = translation - coupling.transpose() * inverse * coupling;
            (out.directions, out.translations) = weak(left, limit);
        }
        if let Some(inverse) = translation.try_inverse() {
            let left = rotation - coupling * inverse * coupling.transpose();
            // With a lever of a metre a turn is as plain to see as a shift.
            (out.axes, out.rotations) = weak(left, limit);
        }
        out
    }

    /// Whether anything is left open.
    pub fn any(&self) -> bool {
        self.translations + self.rotations > 0
    }

    /// Information that holds the open directions, and only these, at strength `weight`.
    pub fn hold(&self, weight: f64) -> Matrix6<f64> {
        self.open().map(|v| v * v.transpose() * weight).sum()
    }

    /// Takes what a step does in the open directions out of it.
    pub fn projection_on_observed(&self) -> Matrix6<f64> {
        self.open()
            .fold(Matrix6::identity(), |p, v| p - v * v.transpose())
    }

    /// The open directions in six dimensions, rotation first; they are orthogonal.
    fn open(&self) -> impl Iterator<Item = Vector6<f64>> + '_ {
        let directions = self.directions[..self.translations]
            .iter()
            .map(|d| Vector6::new(0.0, 0.0, 0.0, d.x, d.y, d.z));
        let axes = self.axes[..self.rotations]
            .iter()
            .map(|a| Vector6::new(a.x, a.y, a.z, 0.0, 0.0, 0.0));
        directions.chain(axes)
    }
}

fn weak(block: Matrix3<f64>, limit: f64) -> ([Vector3<f64>; 3], usize) {
    let mut found = ([Vector3::zeros(); 3], 0);
    if !block.iter().all(|v| v.is_finite()) {
        return found;
    }
    let eigen = SymmetricEigen::new((block + block.transpose()) * 0.5);
    for (value, vector) in eigen
        .eigenvalues
        .iter()
        .zip(eigen.eigenvectors.column_iter())
    {
        if *value < limit {
            found.0[found.1] = vector.into_owned();
            found.1 += 1;
        }
    }
    found
}

fn largest(block: &Matrix3<f64>) -> f64 {
    if block.iter().all(|v| v.is_finite()) {
        block.symmetric_eigenvalues().max()
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use crate::{Aligner, AlignerConfig, Preparer, SurfaceCloud};
    use hachi_hal::Pose;

    /// Walls, floor and ceiling of a corridor along x with no end; with a pillar if `pillar`.
    fn corridor(pillar: bool, shift: f32) -> Vec<([f32; 3], f32)> {
        let mut points = Vec::new();
        for i in 0..400 {
            for j in 0..12 {
                let (x, s) = (i as f32 * 0.05 - 10.0 + shift, j as f32 * 0.2);
                for p in [
                    [x, -1.2, s],
                    [x, 1.2, s],
                    [x, s - 1.2, 0.0],
                    [x, s - 1.2, 2.4],
                ] {
                    points.push((p, 0.0));
                }
            }
        }
        if pillar {
            for i in 0..60 {
                for j in 0..24 {
                    let (w, z) = (i as f32 * 0.01, j as f32 * 0.1);
                    points.push(([2.0 - shift, 0.3 + w, z], 0.0));
                    points.push(([2.6 - shift, 0.3 + w, z], 0.0));
                }
            }
        }
        points
    }

    fn align(pillar: bool) -> crate::Registration {
        let prepare = |points: Vec<([f32; 3], f32)>| {
            let mut cloud = SurfaceCloud::default();
            Preparer::default().prepare(points.into_iter(), 0.1, &mut cloud);
            cloud
        };
        let (target, source) = (
            prepare(corridor(pillar, 0.0)),
            prepare(corridor(pillar, 0.013)),
        );
        let config = AlignerConfig {
            degeneracy_threshold: 0.003,
            ..AlignerConfig::default()
        };
        let guess = Pose::translation(0.02, 0.0, 0.0);
        Aligner::default().align(&source.points, &target, &guess, None, &config)
    }

    #[test]
    fn an_endless_corridor_is_open_along_its_axis_and_keeps_the_guess_there() {
        let found = align(false);
        assert_eq!(found.degeneracy.translations, 1, "{:?}", found.degeneracy);
        assert!(
            found.degeneracy.directions[0].x.abs() > 0.99,
            "{:?}",
            found.degeneracy
        );
        assert!(
            (found.target_from_source.translation.x - 0.02).abs() < 1e-3,
            "{found:?}"
        );
    }

    #[test]
    fn a_pillar_closes_it() {
        assert!(!align(true).degeneracy.any());
    }
}
